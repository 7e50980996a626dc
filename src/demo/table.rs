//! The sweep as a table for people and as CSV for programs.

use super::sweep::{Answer, Sample, Sweep};
use std::fmt::Write as _;
use std::io::{self, Write};

/// Prints every third step and the positions of contact.
pub(super) fn print(text: &mut impl Write, sweep: &Sweep) -> io::Result<()> {
    let samples = &sweep.samples;
    writeln!(text, "The chair is swept through the human; a server answers over gRPC (degree 6):\n")?;
    writeln!(
        text,
        "{:>9}  {:>11}  {:>15}  {:>15}  state",
        "chair x/m", "distance/m", "d(chair‖human)", "d(human‖chair)"
    )?;
    for sample in samples.iter().step_by(3) {
        let (chair, human) = (sample.chair_on_human.value, sample.human_on_chair.value);
        let state = state(sample);
        writeln!(text, "{:>9.3}  {:>11.6}  {chair:>15.6}  {human:>15.6}  {state}", sample.x, sample.distance.value)?;
    }
    writeln!(text, "\nLevel distance: above 1 apart, 1 touching, below 1 overlapping, in both orders.")?;
    for (name, answer) in
        [("d(chair‖human)", chair_on_human as fn(&Sample) -> Answer), ("d(human‖chair)", human_on_chair)]
    {
        let found: Vec<_> = crossings(samples, answer).iter().map(|x| format!("{x:.3} m")).collect();
        if !found.is_empty() {
            writeln!(text, "{name} passes 1 near x = {}.", found.join(" and "))?;
        }
    }
    let width = |answer: fn(&Sample) -> Answer, scale: fn(f64) -> f64| {
        let widths = samples.iter().map(answer).map(|a| (a.upper - a.lower) / scale(a.value));
        widths.fold(0.0, f64::max)
    };
    let level = width(chair_on_human, at_least_one).max(width(human_on_chair, at_least_one));
    writeln!(
        text,
        "{} updates and {} answers in {:.0} ms, scene revision {}. Widest proven brackets: distance {:.1e} m, level \
         distance {level:.1e} of max(1, value).",
        samples.len(),
        3 * samples.len(),
        sweep.elapsed.as_secs_f64() * 1e3,
        sweep.revision,
        width(|s| s.distance, |_| 1.0),
    )
}

fn chair_on_human(sample: &Sample) -> Answer {
    sample.chair_on_human
}

fn human_on_chair(sample: &Sample) -> Answer {
    sample.human_on_chair
}

fn at_least_one(value: f64) -> f64 {
    value.abs().max(1.0)
}

/// What the brackets of all three answers prove; they never contradict each other.
fn state(sample: &Sample) -> &'static str {
    let levels = [sample.chair_on_human, sample.human_on_chair];
    if sample.distance.lower > 0.0 || levels.iter().any(|level| level.lower > 1.0) {
        "apart"
    } else if levels.iter().any(|level| level.upper < 1.0) {
        "overlapping"
    } else if levels.iter().any(|level| level.upper - level.lower < 1e-6) {
        "touching" // within a millionth
    } else {
        "undecided"
    }
}

/// Positions where an answer passes 1, interpolated between the steps in the logarithm: level
/// distances grow like a power.
pub(super) fn crossings(samples: &[Sample], answer: fn(&Sample) -> Answer) -> Vec<f64> {
    let steps = samples.windows(2).filter_map(|pair| {
        let [before, after] = [&pair[0], &pair[1]].map(|sample| answer(sample).value.max(f64::MIN_POSITIVE).ln());
        (before * after < 0.0).then(|| pair[0].x + (pair[1].x - pair[0].x) * before / (before - after))
    });
    steps.collect()
}

/// All steps with all brackets, comma-separated, a heading first.
pub(super) fn csv(sweep: &Sweep) -> String {
    let mut text = String::from(
        "chair_x_m,distance_m,distance_lower_m,distance_upper_m,\
         level_chair_on_human,level_chair_on_human_lower,level_chair_on_human_upper,\
         level_human_on_chair,level_human_on_chair_lower,level_human_on_chair_upper\n",
    );
    for sample in &sweep.samples {
        let _ = write!(text, "{:.3}", sample.x);
        for answer in [sample.distance, sample.chair_on_human, sample.human_on_chair] {
            let _ = write!(text, ",{},{},{}", answer.value, answer.lower, answer.upper);
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::time::Duration;

    /// Unit balls: the distance is |x| - 2, the level distance (|x| - 1)² outside.
    fn balls() -> Sweep {
        let exact = |value: f64| Answer { value, lower: value, upper: value };
        let samples = (-30..=30).map(|i| {
            let x = f64::from(i) / 10.0;
            let level = exact((x.abs() - 1.0).max(0.0).powi(2));
            Sample { x, distance: exact((x.abs() - 2.0).max(0.0)), chair_on_human: level, human_on_chair: level }
        });
        Sweep { samples: samples.collect(), revision: 63, elapsed: Duration::from_millis(5) }
    }

    #[test]
    fn contacts_are_found_and_named() {
        let mut text = Vec::new();
        print(&mut text, &balls()).unwrap();
        let text = String::from_utf8(text).unwrap();
        for word in ["apart", "overlapping", "revision 63", "183 answers"] {
            assert!(text.contains(word), "{word} is missing in\n{text}");
        }
        let mut shifted = balls().samples;
        shifted.iter_mut().for_each(|s| s.x += 0.05);
        shifted.retain(|s| s.chair_on_human.value != 1.0);
        let found = crossings(&shifted, |s| s.chair_on_human);
        assert!(found.len() == 2 && (found[0] + 1.95).abs() < 0.01 && (found[1] - 2.05).abs() < 0.01, "{found:?}");
    }

    #[test]
    fn every_line_of_the_csv_has_every_column() {
        let text = csv(&balls());
        assert_eq!(text.lines().count(), 62);
        assert!(text.lines().all(|line| line.split(',').count() == 10));
    }
}
