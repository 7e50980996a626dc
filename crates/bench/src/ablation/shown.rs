//! What pages show of `ablation.csv`.

use crate::csv::{CsvError, Row, Table};
use crate::words::listed;
use std::fmt::Write;

/// The stages in the order in which they are tried, as they are named in the CSV and for people,
/// with the numbers of their methods.
const TITLES: [(&str, &str); 32] = [
    ("Balls", "balls, of decisions"),
    ("Planes", "planes, of decisions"),
    ("ClosedForm", "0: closed forms"),
    ("ExactLevel", "0: restart from the least value"),
    ("EdgesBesideShape", "0: active sets beside a shape"),
    ("Saturation", "level: least value within the other body"),
    ("Follow", "1: `Follow`"),
    ("Edges", "1, 2: `Edges`"),
    ("Newton", "1, 2, 4, 5: Newton with active sets"),
    ("Seek", "2: `Seek`"),
    ("SupportTables", "2: GJK on support tables"),
    ("Deepest", "2, 5: deepest point"),
    ("UnsureDeepest", "5: deepest point where a bracket contains 0"),
    ("Ray", "2, 3, 4: quadratic programs along the normal"),
    ("Again", "3, 4: these from the best points"),
    ("InteriorDistance", "4: interior points, distance"),
    ("InteriorLevel", "4: interior points, deepest point"),
    ("Refinement", "5: double-double"),
    ("Alignment", "5: alignment"),
    ("Lanes", "batches: lanes"),
    ("DirectionSampling", "depth: sampling of directions"),
    ("CompassSearch", "depth: search around a direction"),
    ("SupportLanes", "supports: Newton"),
    ("AlongAxis", "capsules: single points of the axis"),
    ("ProjectionSteps", "one body: quadratic programs"),
    ("ProjectionInterior", "one body: interior points"),
    ("Interpolation", "casts: interpolation"),
    ("Curvature", "casts: curvature"),
    ("Halving", "casts: middle of the bracket"),
    ("MovingBalls", "impact: moving balls"),
    ("PlaneOfA", "impact: plane of the first body"),
    ("PlaneOfB", "impact: plane of the second body"),
];

/// A stage on one kind of queries.
struct Line {
    set: String,
    title: &'static str,
    queries: u64,
    rescued: u64,
    wrong: u64,
    iterations: [f64; 2],
    worst: [u32; 2],
    time: f64,
}

/// All stages on one kind of queries.
struct All {
    set: String,
    queries: u64,
    unsure: u64,
    iterations: f64,
    worst: u32,
}

/// The rows of a CSV.
pub(crate) struct Shown {
    /// How it was made.
    head: String,
    all: Vec<All>,
    lines: Vec<Line>,
}

impl Shown {
    /// Reads what the command `ablation` wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let head = csv.lines().find_map(|line| line.strip_prefix("# ")).unwrap_or_default().to_owned();
        let (mut all, mut lines) = (Vec::new(), Vec::new());
        for row in Table::read(csv)?.rows() {
            let set = row.text("set")?.to_owned();
            if row.text("stage")? == "all" {
                all.push(All {
                    set,
                    queries: row.get("queries")?,
                    unsure: row.get("unsure")?,
                    iterations: row.get("iterations")?,
                    worst: row.get("worst")?,
                });
            } else {
                lines.push(line(set, row)?);
            }
        }
        Ok(Self { head, all, lines })
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "head" => Some(format!("{}\n", self.head)),
            "idle" => Some(self.idle()),
            set => self.all.iter().find(|all| all.set == set).map(|all| self.table(all)),
        }
    }

    /// One kind of queries: a sentence, and the stages that came to their turn.
    fn table(&self, all: &All) -> String {
        let All { set, queries, unsure, iterations, worst } = all;
        let mut text = format!(
            "With all stages, of {queries} queries {unsure} are not converged or not decided; {iterations:.2} iterations, \
             worst {worst}.\n\n\
             | stage, by the number of its method | at its turn | rescued | wrong | mean iterations | worst | time |\n\
             |---|---:|---:|---:|---:|---:|---:|\n"
        );
        let of_set = |title| self.lines.iter().find(|line| line.set == *set && line.title == title);
        for line in TITLES.iter().filter_map(|(_, title)| of_set(*title)).filter(|line| line.queries > 0) {
            let Line { title, queries, rescued, wrong, iterations: [with, without], worst, time, .. } = line;
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {title} | {queries} | {rescued} | {wrong} | {with:.2} → {without:.2} | {} → {} | {time:.2} |",
                worst[0], worst[1]
            );
        }
        text
    }

    /// The stages that never came to their turn, as a sentence.
    fn idle(&self) -> String {
        let queries =
            |title: &str| self.lines.iter().filter(|line| line.title == title).map(|line| line.queries).sum::<u64>();
        let idle = TITLES.iter().filter(|(_, title)| queries(title) == 0).map(|(_, title)| (*title).to_owned());
        format!("Stages that never came to their turn: {}.\n", listed(idle))
    }
}

fn line(set: String, row: Row<'_>) -> Result<Line, CsvError> {
    let stage = row.text("stage")?;
    let title = TITLES.iter().find(|(name, _)| *name == stage).ok_or_else(|| row.error(format!("no stage {stage}")))?.1;
    Ok(Line {
        set,
        title,
        queries: row.get("queries")?,
        rescued: row.get("rescued")?,
        wrong: row.get("wrong")?,
        iterations: [row.get("iterations")?, row.get("iterations_without")?],
        worst: [row.get("worst")?, row.get("worst_without")?],
        time: row.get("time")?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const CSV: &str = "# Made by hand.\n\
        set,stage,queries,unsure,rescued,wrong,iterations,iterations_without,worst,worst_without,time\n\
        draws,all,100,2,,,3.5,,40,,\n\
        draws,Seek,60,,7,0,3.25,4.5,40,50,1.25\n\
        draws,Ray,0,,0,0,0,0,0,0,1\n";

    #[test]
    fn stages_that_came_to_their_turn_are_shown() {
        let shown = Shown::read(CSV).unwrap();
        assert_eq!(shown.block("head").unwrap(), "Made by hand.\n");
        let table = shown.block("draws").unwrap();
        assert!(table.contains("of 100 queries 2 are not converged"), "{table}");
        assert!(table.contains("| 2: `Seek` | 60 | 7 | 0 | 3.25 → 4.50 | 40 → 50 | 1.25 |"), "{table}");
        assert!(!table.contains("quadratic programs"), "{table}");
        let idle = shown.block("idle").unwrap();
        assert!(idle.contains("3, 4: these") && !idle.contains("`Seek`"), "{idle}");
        assert!(shown.block("families").is_none());
    }

    #[test]
    fn unknown_stages_are_refused() {
        let error = Shown::read(&CSV.replace("Seek", "Sought")).err().unwrap().to_string();
        assert!(error.contains("no stage Sought"), "{error}");
    }
}
