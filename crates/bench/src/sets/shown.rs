//! What pages show of `sets.csv`: tables, pictures, and a sentence.

use std::collections::BTreeMap;
use std::fmt::Write;

use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

use super::counterexample::Level;
use super::models::{KINDS, Model};
use super::pairs::{BRANCH, Bracket, level_name};
use crate::csv::{CsvError, Row, Table};

/// Relative width of the brackets that the sentence is about.
const NARROW: f64 = 1e-2;

/// The rows of a CSV.
pub(crate) struct Shown {
    brackets: Vec<Bracket>,
    counterexample: Vec<Level>,
    models: Vec<Model>,
}

impl Shown {
    /// Reads what [`Sets::csv`](super::Sets::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let (mut brackets, mut counterexample, mut models) = (Vec::new(), Vec::new(), Vec::new());
        for row in Table::read(csv)?.rows() {
            match row.text("row")? {
                "pair" => brackets.push(bracket(row)?),
                "counterexample" => counterexample.push(level(row)?),
                kind => models.push(model(kind, row)?),
            }
        }
        Ok(Self { brackets, counterexample, models })
    }

    /// The pictures.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        Ok(vec![
            ("sets.svg".into(), self.chart_of_widths()?),
            ("sets-hierarchy.svg".into(), self.chart_of_levels()?),
            ("sets-models.svg".into(), self.chart_of_models()?),
        ])
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "widths" => Some(self.widths() + "\n![sets.svg](sets.svg)\n"),
            "hierarchy" => Some(self.hierarchy() + "\n![sets-hierarchy.svg](sets-hierarchy.svg)\n"),
            "counterexample" => Some(self.levels()),
            "models" => Some(self.table_of_models() + "\n![sets-models.svg](sets-models.svg)\n"),
            "sentence" => self.sentence(),
            _ => None,
        }
    }

    fn degrees(&self) -> Vec<usize> {
        let mut degrees: Vec<usize> = self.brackets.iter().map(|bracket| bracket.degree).collect();
        degrees.sort_unstable();
        degrees.dedup();
        degrees
    }

    fn of(&self, degree: usize, method: &str) -> impl Iterator<Item = &Bracket> {
        self.brackets.iter().filter(move |bracket| bracket.degree == degree && bracket.method == method)
    }

    /// Per number of divisions: median time and median relative width.
    fn by_steps(&self, degree: usize) -> Vec<(usize, f64, f64)> {
        let mut groups: BTreeMap<usize, Vec<&Bracket>> = BTreeMap::new();
        for bracket in self.of(degree, BRANCH) {
            groups.entry(bracket.steps).or_default().push(bracket);
        }
        let middles = |(steps, group): (usize, Vec<&Bracket>)| {
            let seconds = median(group.iter().map(|bracket| bracket.seconds));
            (steps, seconds, median(group.iter().map(|bracket| width(bracket))))
        };
        groups.into_iter().map(middles).collect()
    }

    /// Time by which the bracket of a pair was as narrow as that: of the first run that was; ∞ if
    /// none was.
    fn time_to(&self, degree: usize, narrow: f64) -> Vec<f64> {
        let mut times: BTreeMap<u64, f64> = BTreeMap::new();
        for bracket in self.of(degree, BRANCH) {
            let time = times.entry(bracket.pair).or_insert(f64::INFINITY);
            if width(bracket) <= narrow {
                *time = time.min(bracket.seconds);
            }
        }
        let mut times: Vec<f64> = times.into_values().collect();
        times.sort_by(f64::total_cmp);
        times
    }

    fn widths(&self) -> String {
        let mut text = String::from("| degree | divisions | median ms | median relative width |\n|---|---|---|---|\n");
        for degree in self.degrees() {
            for (steps, seconds, width) in self.by_steps(degree) {
                // Writing to a string cannot fail.
                let _ = writeln!(text, "| {degree} | {steps} | {:.2} | {width:.1e} |", 1e3 * seconds);
            }
        }
        if let Some(sentence) = self.sentence() {
            text += &format!("\n{sentence}");
        }
        text
    }

    /// When brackets are narrow.
    fn sentence(&self) -> Option<String> {
        let of = |degree: usize| {
            let times = self.time_to(degree, NARROW);
            let (middle, most) = (times.get(times.len() / 2)?, times.last()?);
            Some(format!("{:.1} ms at degree {degree} (at most {:.1} ms)", 1e3 * middle, 1e3 * most))
        };
        let parts = self.degrees().into_iter().map(of).collect::<Option<Vec<_>>>()?;
        Some(format!("A bracket of 1 % of the distance takes {} at the median.\n", parts.join(" and ")))
    }

    fn hierarchy(&self) -> String {
        let mut text = String::from(
            "| degree | level | pairs | exact | share | largest upper:lower | median s |\n|---|---|---|---|---|---|---|\n",
        );
        for degree in self.degrees() {
            for level in 0..=1 {
                let found: Vec<_> = self.of(degree, &level_name(level)).collect();
                if found.is_empty() {
                    continue;
                }
                let exact = found.iter().filter(|bracket| bracket.exact).count();
                // Of sets that overlap both are 0.
                let ratio = found.iter().map(|bracket| bracket.upper / bracket.lower).fold(1.0, f64::max);
                let seconds = median(found.iter().map(|bracket| bracket.seconds));
                let _ = writeln!(
                    text,
                    "| {degree} | {level} | {} | {exact} | {:.1} % | {ratio:.6} | {seconds:.3} |",
                    found.len(),
                    100.0 * exact as f64 / found.len() as f64
                );
            }
        }
        text + "\nLevel 1 is asked at degree 4 where level 0 is not exact.\n"
    }

    fn levels(&self) -> String {
        let mut text = String::from("| level | lower bound m | upper bound m | exact | s |\n|---|---|---|---|---|\n");
        for Level { level, seconds, lower, upper, exact } in &self.counterexample {
            let exact = if *exact { "yes" } else { "no" };
            let _ = writeln!(text, "| {level} | {lower:.6} | {upper:.6} | {exact} | {seconds:.3} |");
        }
        text
    }

    fn table_of_models(&self) -> String {
        let mut text = String::from(
            "| object | model | | mean error, % of the diameter | false contacts, % | median µs of a query |\n|---|---|---|---|---|---|\n",
        );
        for Model { object, kind, name, error, false_contacts, seconds } in &self.models {
            let _ = writeln!(
                text,
                "| {object} | {kind} | {name} | {:.2} | {:.1} | {:.2} |",
                100.0 * error,
                100.0 * false_contacts,
                1e6 * seconds
            );
        }
        text
    }

    fn chart_of_widths(&self) -> Result<String, ChartError> {
        let looks = [(Ink::Blue, Marker::Disc), (Ink::Orange, Marker::Triangle)];
        let mut groups = Vec::new();
        for (degree, (ink, marker)) in self.degrees().into_iter().zip(looks) {
            let point = |(steps, seconds, width): (usize, f64, f64)| Point {
                x: 1e3 * seconds,
                y: width,
                label: steps.to_string(),
            };
            // Where nothing is known yet there is no width to draw.
            let points = self.by_steps(degree).into_iter().filter(|found| found.2.is_finite() && found.2 > 0.0);
            let points = points.map(point).collect();
            groups.push(Group { label: format!("{BRANCH}, degree {degree}"), ink, marker, points, joined: true });
            let level = level_name(0);
            let seconds = median(self.of(degree, &level).map(|bracket| bracket.seconds));
            let width = median(self.of(degree, &level).map(width));
            let points = vec![Point { x: 1e3 * seconds, y: width, label: level.clone() }];
            groups.push(Group {
                label: format!("{level}, degree {degree}"),
                ink,
                marker: Marker::Cross,
                points,
                joined: false,
            });
        }
        Scatter {
            title: "Brackets of distances of sets that bend inwards: medians".into(),
            x_label: "time (ms)".into(),
            y_label: "width of the bracket over the distance".into(),
            groups,
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }

    /// The relative widths of level 0 against the distance, one point a pair.
    fn chart_of_levels(&self) -> Result<String, ChartError> {
        let of = |degree: usize, exact: bool, ink, marker| {
            let level = level_name(0);
            let found = self.of(degree, &level).filter(|bracket| bracket.exact == exact);
            let point =
                |bracket: &Bracket| Point { x: bracket.upper, y: width(bracket).max(1e-12), label: String::new() };
            let label = format!("degree {degree}, {}", if exact { "exact" } else { "not exact" });
            Group { label, ink, marker, points: found.map(point).collect(), joined: false }
        };
        let looks = [
            (4, true, Ink::Blue, Marker::Disc),
            (4, false, Ink::Orange, Marker::Triangle),
            (6, true, Ink::Green, Marker::Ring),
            (6, false, Ink::Purple, Marker::Cross),
        ];
        let groups = looks.into_iter().map(|(degree, exact, ink, marker)| of(degree, exact, ink, marker));
        Scatter {
            title: "Level 0 of the hierarchy on random pairs".into(),
            x_label: "distance".into(),
            y_label: "width of the bracket over the distance".into(),
            groups: groups.filter(|group| !group.points.is_empty()).collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }

    /// Means of the objects.
    fn chart_of_models(&self) -> Result<String, ChartError> {
        let looks = [
            (Ink::Blue, Marker::Disc),
            (Ink::Green, Marker::Triangle),
            (Ink::Orange, Marker::Ring),
            (Ink::Purple, Marker::Cross),
        ];
        let groups = KINDS.iter().zip(looks).map(|(kind, (ink, marker))| {
            let mut names: Vec<&str> = Vec::new();
            for model in self.models.iter().filter(|model| model.kind == *kind) {
                if !names.contains(&model.name.as_str()) {
                    names.push(&model.name);
                }
            }
            let point = |name: &str| {
                let of = |value: fn(&Model) -> f64| {
                    median(self.models.iter().filter(|model| model.kind == *kind && model.name == name).map(value))
                };
                Point { x: 1e6 * of(|model| model.seconds), y: 100.0 * of(|model| model.error), label: name.into() }
            };
            let points = names.into_iter().map(point).collect();
            Group { label: (*kind).into(), ink, marker, points, joined: false }
        });
        Scatter {
            title: "Models of objects that are not convex: medians of the objects".into(),
            x_label: "time of a query (µs)".into(),
            y_label: "mean error of the distance (% of the diameter)".into(),
            groups: groups.filter(|group| !group.points.is_empty()).collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}

fn bracket(row: Row<'_>) -> Result<Bracket, CsvError> {
    Ok(Bracket {
        degree: row.get("degree")?,
        pair: row.get("of")?,
        method: row.text("name")?.to_owned(),
        steps: row.get("steps")?,
        seconds: row.number("seconds")?,
        lower: row.number("lower")?,
        upper: row.number("upper")?,
        exact: row.text("exact")? == "1",
    })
}

fn level(row: Row<'_>) -> Result<Level, CsvError> {
    Ok(Level {
        level: row.get("of")?,
        seconds: row.number("seconds")?,
        lower: row.number("lower")?,
        upper: row.number("upper")?,
        exact: row.text("exact")? == "1",
    })
}

fn model(kind: &str, row: Row<'_>) -> Result<Model, CsvError> {
    Ok(Model {
        object: row.text("of")?.to_owned(),
        kind: kind.to_owned(),
        name: row.text("name")?.to_owned(),
        error: row.number("error")?,
        false_contacts: row.number("false_contacts")?,
        seconds: row.number("seconds")?,
    })
}

/// Width over the upper bound; ∞ without one, 0 of sets with a common point.
fn width(bracket: &Bracket) -> f64 {
    match bracket.upper {
        0.0 => 0.0,
        upper if upper.is_finite() => (upper - bracket.lower) / upper,
        _ => f64::INFINITY,
    }
}

fn median(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.collect();
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
