//! What pages show of `speed.csv`: verdicts, tables, pictures, and sentences with numbers.

use super::front::{Entry, front, standing};
use super::ours::Method;
use super::pictures::{Timing, Truth, as_entries, entries, means, picture, pictures};
use super::race::{Line, ModelError, Race, Who};
use crate::csv::{CsvError, Row, Table};
use crate::words::{Span, listed};
use std::fmt::Write;
use sublevel::draw::ChartError;

/// How to read the tables.
pub(super) const NOTES: &str = "\
How to read this:

- Model error: distance of the convex hulls (parry's GJK on all their vertices) less the distance that a representation answers, \
relative to the larger diameter of the pair; so a thousandth is a millimetre for an object of 1 m. Where a representation overlaps although \
the hulls do not, less minus its depth. `mesh` is the same against the distance of the triangle meshes.
- Compounds and covers of balls contain the mesh, not its hull: they stand in the charts against meshes only.
- Smooth motions of steps of 0.5 % of the larger diameter and one degree about each other; bodies of degree 2 and up stay apart, the closest of \
them mostly by 2.5 to 37 % of the larger diameter. Seeds 1, 2, ... of SplitMix64, those that come too close left out. Everybody walks the same \
poses; rows take turns; in a turn each motion is walked nine times on end (once if a query takes more than 5 µs), as coal's program does it, and the median counts, then the median of the \
turns; one thread. Parry's meshes are asked at a few of the poses only.
- warm: with the hint from the pose before (ours, coal's cached guess, parry's initial direction). batch: all poses of a motion in one call, each \
solved cold. Peers have no batch and stand with the faster of their two times there.
- Hulls of n vertices are intersections of half-spaces that touch the hull, chosen one by one to cut off what stands out farthest: they contain \
the hull like our bodies do. An object whose hull has no more vertices keeps it. Where \
they overlap they answer 0, so that the coarsest look a little better than they are.
- wrong: queries in which brackets of ours exclude each other or the truth, or in which coal and parry differ by more than 1e-5 of the \
diameter.
";

/// Of runs that have them.
const ROUND_NOTE: &str = "\
- Cylinders and capsules are the smallest about one of the axes of the oriented box. Capsules are a formula, which takes no hint.
";

/// The figures: mean model errors, and how many times as fast as the fastest peer of equal or
/// better accuracy one of ours is to be.
const FIGURES: [(f64, f64); 2] = [(0.05, 2.0), (0.03, 1.6)];

/// The pairs of a CSV.
pub(crate) struct Shown {
    races: Vec<Race>,
}

impl Shown {
    /// Reads what [`Speed::csv`](super::Speed::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let mut races: Vec<Race> = Vec::new();
        for row in Table::read(csv)?.rows() {
            let name = row.text("pair")?;
            let line = line(&row)?;
            match races.last_mut().filter(|race| race.name == name) {
                Some(race) => race.lines.push(line),
                None => races.push(Race {
                    name: name.to_owned(),
                    diameter_m: row.get("diameter_m")?,
                    queries: row.get("queries")?,
                    lines: vec![line],
                }),
            }
        }
        Ok(Self { races })
    }

    /// The pictures by name, the most telling first.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        pictures(&self.races)
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        Some(match name {
            "verdicts" => self.verdicts(),
            "notes" => self.notes(),
            "times as fast" => self.times_as_fast(),
            "cold" => self.cold()?,
            "small errors" => self.small_errors(),
            "errors of degree 6" => self.errors_of_degree_6()?,
            pair => {
                let race = self.races.iter().find(|race| race.name == pair)?;
                let mut text = String::new();
                race.write(&mut text);
                let _ = writeln!(text, "\n![{0}]({0})", picture(race));
                text
            }
        })
    }

    fn notes(&self) -> String {
        let mut lines = self.races.iter().flat_map(|race| &race.lines);
        let is_round = |line: &Line| matches!(line.who, Who::Ours(Method::Cylinder | Method::Capsule));
        format!("{NOTES}{}", if lines.any(is_round) { ROUND_NOTE } else { "" })
    }

    /// Whether the figures are met, pair by pair.
    fn verdicts(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(
            text,
            "At each error allowed, the fastest of ours and the fastest peer of equal or better accuracy:\n\n\
             | pair | against | timing | error allowed | ours | its error | peer | times as fast | figure | | as fast as any peer of the error allowed |\n\
             |---|---|---|---|---|---|---|---|---|---|---|"
        );
        let mut missed = Vec::new();
        for race in &self.races {
            let mut against = vec![(Truth::Hulls, "hulls", Timing::Warm, "warm")];
            against.push((Truth::Hulls, "hulls", Timing::Cold, "cold"));
            against.push((Truth::Hulls, "hulls", Timing::Batch, "batch"));
            if race.is_hollow() {
                against.push((Truth::Meshes, "meshes", Timing::Warm, "warm"));
            }
            for (truth, of, timing, how) in against {
                let entries = entries(race, truth, timing);
                for (error, figure) in FIGURES {
                    let name = &race.name;
                    let Some(found) = standing(&entries, error) else {
                        let _ = writeln!(
                            text,
                            "| {name} | {of} | {how} | {} | none | | | | {figure} | missed | |",
                            percent(error)
                        );
                        missed
                            .push(format!("{name} ({of}, {how}) at {}: none of ours is that accurate", percent(error)));
                        continue;
                    };
                    let held = found.times >= figure;
                    if !held {
                        missed.push(format!(
                            "{name} ({of}, {how}) at {}: {:.2} of {figure}",
                            percent(error),
                            found.times
                        ));
                    }
                    let _ = writeln!(
                        text,
                        "| {name} | {of} | {how} | {} | {} | {} | {} | {:.2} | {figure} | {} | {:.2} |",
                        percent(error),
                        found.ours,
                        percent(found.error),
                        found.peer,
                        found.times,
                        if held { "holds" } else { "missed" },
                        found.allowed
                    );
                }
            }
        }
        let holds = "The figures (2 times at 5 %, 1.6 times at 3 %) hold everywhere.".to_owned();
        let verdict =
            if missed.is_empty() { holds } else { format!("Where the figures are missed: {}.", missed.join("; ")) };
        let _ = writeln!(text, "\n{verdict}");
        let pareto = pareto(&as_entries(&means(&self.races)));
        let _ = writeln!(text, "\nPareto front of the means over all pairs, with a hint, against hulls: {pareto}.");
        let (count, ours) = (self.races.len(), self.on_our_fronts());
        let _ =
            writeln!(text, "\nOn how many of the {count} fronts of ours alone, without a hint, against hulls: {ours}.");
        text
    }

    /// Ours that none of ours as accurate is faster than, with the number of pairs.
    fn on_our_fronts(&self) -> String {
        let mut counts: Vec<(String, usize)> = Vec::new();
        for race in &self.races {
            let all = entries(race, Truth::Hulls, Timing::Cold);
            for entry in front(all.iter().filter(|entry| entry.ours)) {
                match counts.iter_mut().find(|(name, _)| *name == entry.name) {
                    Some((_, count)) => *count += 1,
                    None => counts.push((entry.name.clone(), 1)),
                }
            }
        }
        counts.sort_by_key(|(_, count)| std::cmp::Reverse(*count));
        counts.iter().map(|(name, count)| format!("{name} {count}")).collect::<Vec<_>>().join("; ")
    }

    /// How many times as fast as the fastest peer of equal or better accuracy.
    fn times_as_fast(&self) -> String {
        let mut text = String::from("| model error allowed | with a hint | cold | in batches |\n|---|---|---|---|\n");
        for (error, _) in FIGURES {
            let cells = [Timing::Warm, Timing::Cold, Timing::Batch].map(|timing| {
                let span = Span::of(self.standings(error, timing).into_iter().map(|(_, times)| times));
                span.map_or("-".to_owned(), |span| span.text(2))
            });
            let _ = writeln!(text, "| {:.0} % | {} |", 100.0 * error, cells.join(" | "));
        }
        text
    }

    /// Of each pair, against hulls.
    fn standings(&self, error: f64, timing: Timing) -> Vec<(&str, f64)> {
        let of = |race: &Race| standing(&entries(race, Truth::Hulls, timing), error).map(|found| found.times);
        self.races.iter().filter_map(|race| Some((race.name.as_str(), of(race)?))).collect()
    }

    /// Nanoseconds of a representation, from the least to the largest over the pairs.
    fn span(&self, who: Who, of: impl Fn(&Line) -> f64) -> Option<Span> {
        let lines = self.races.iter().flat_map(|race| &race.lines).filter(|line| line.who == who);
        Span::of(lines.map(of).filter(|value| value.is_finite()))
    }

    /// Where ours are slower than their peers without a hint.
    fn cold(&self) -> Option<String> {
        let mut sentences = Vec::new();
        for (error, _) in FIGURES {
            let all = self.standings(error, Timing::Cold);
            let mut slower: Vec<f64> = all.iter().map(|(_, times)| *times).filter(|times| *times < 1.0).collect();
            slower.sort_by(f64::total_cmp);
            let most = Span::of(all.iter().map(|(_, times)| *times))?.most;
            let list = listed(slower.iter().map(|times| format!("{times:.2}")));
            sentences.push(format!(
                "at a model error of {:.0} % it is slower for {} of {} pairs ({list} times as fast) and at most {most:.1} times as fast for the others",
                100.0 * error,
                slower.len(),
                all.len()
            ));
        }
        Some(format!(
            "From nothing but the poses, Sublevel is often slower than the fastest peer of equal or better accuracy: {}.\n",
            sentences.join("; ")
        ))
    }

    /// What degree 8 and hulls of few vertices cost.
    fn small_errors(&self) -> String {
        let eight = Who::Ours(Method::Body { degree: 8, refine: false });
        let percents = |who| {
            let span = self.span(who, |line| 100.0 * line.hull.mean);
            span.map_or("-".into(), |span| span.text(1))
        };
        let warm = |who| self.span(who, |line| line.warm).map_or("-".into(), Span::microseconds);
        let [few, more] = [64, 128].map(|count| Who::CoalHull(Some(count)));
        format!(
            "Degree 8 has mean errors of {} % and takes {} with a hint; coal on a hull of 64 vertices has {} % and takes {}, on one of 128 \
             vertices {} % and {}. Smaller errors than that of degree 8 need slabs or compounds, which take microseconds.\n",
            percents(eight),
            warm(eight),
            percents(few),
            warm(few),
            percents(more),
            warm(more)
        )
    }

    /// How much too near bodies of degree 6 are, for the pairs of the measures.
    fn errors_of_degree_6(&self) -> Option<String> {
        let six = Who::Ours(Method::Body { degree: 6, refine: false });
        let errors = ["chair-human", "hand-vase", "octopus-chair"].map(|pair| {
            let race = self.races.iter().find(|race| race.name == pair)?;
            let line = race.lines.iter().find(|line| line.who == six)?;
            Some(format!("{:.1}", 100.0 * line.hull.mean))
        });
        let errors: Vec<String> = errors.into_iter().collect::<Option<_>>()?;
        Some(format!(
            "coal and parry answer for the hulls exactly; bodies of degree 6 are too near by {} % of the larger\n\
             diameter in the mean.\n",
            listed(errors)
        ))
    }
}

fn line(row: &Row<'_>) -> Result<Line, CsvError> {
    let name = row.text("representation")?;
    let error = |of: &str| {
        let number = |which: &str| row.number(&format!("{of}_error_{which}"));
        Ok(ModelError { mean: number("mean")?, most: number("max")?, least: number("min")? })
    };
    Ok(Line {
        who: Who::named(name).ok_or_else(|| row.error(format!("no representation is named '{name}'")))?,
        hull: error("hull")?,
        mesh: error("mesh")?,
        cold: row.number("cold_ns")?,
        warm: row.number("warm_ns")?,
        batch: row.number("batch_ns")?,
        failed: row.get("failed")?,
        overlaps: row.get("overlaps")?,
        contradictions: row.get("wrong")?,
    })
}

impl Who {
    /// The one of this name.
    fn named(name: &str) -> Option<Self> {
        let hull = |text: &str| match text {
            "hull" => Some(None),
            some => Some(Some(some.strip_prefix("hull, ")?.strip_suffix(" vertices")?.parse().ok()?)),
        };
        let single = [Self::ParryBall, Self::ParryBox, Self::ParryMesh];
        let known = Method::all(false).into_iter().map(Self::Ours).chain(single).find(|who| who.name() == name);
        known
            .or_else(|| Some(Self::ParryHull(hull(name.strip_suffix(", parry")?)?)))
            .or_else(|| Some(Self::CoalHull(hull(name.strip_suffix(", coal")?)?)))
    }
}

fn percent(part: f64) -> String {
    format!("{:.2} %", 100.0 * part)
}

/// Representations that nothing as accurate is faster than, with their errors and times.
fn pareto(entries: &[Entry]) -> String {
    let named = |entry: &&Entry| format!("{} ({}, {:.0} ns)", entry.name, percent(entry.error), entry.nanoseconds);
    front(entries.iter()).iter().map(named).collect::<Vec<_>>().join("; ")
}

impl Race {
    fn write(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "| representation | mean error | largest | mean mm at 1 m | mesh: mean | largest | warm ns | cold ns | batch ns | failed | overlap | wrong |\n\
             |---|---|---|---|---|---|---|---|---|---|---|---|"
        );
        for line in &self.lines {
            let time = |v: f64| if v.is_finite() { format!("{v:.0}") } else { "-".into() };
            let _ = writeln!(
                text,
                "| {} | {} | {} | {:.1} | {} | {} | {} | {} | {} | {} | {} | {} |",
                line.who.name(),
                percent(line.hull.mean),
                percent(line.hull.most),
                1e3 * line.hull.mean,
                percent(line.mesh.mean),
                percent(line.mesh.most),
                time(line.warm),
                time(line.cold),
                time(line.batch),
                line.failed,
                line.overlaps,
                line.contradictions
            );
        }
        let fronts = [(Timing::Warm, "with a hint"), (Timing::Cold, "without")]
            .map(|(timing, how)| format!("{how} {}", pareto(&entries(self, Truth::Hulls, timing))));
        let _ = writeln!(text, "\nPareto front against hulls: {}.", fronts.join(". The same "));
    }
}
