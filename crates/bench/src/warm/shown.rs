//! What pages show of `warm.csv`: tables, pictures, and sentences with numbers.

use super::steps::{Cell, Steps, Who};
use super::sweep::{Passage, Stop};
use crate::comparison::sweep::median;
use crate::csv::{CsvError, Row, Table};
use crate::words::Span;
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, LineChart, Mark, Marker, Point, Scatter, Series, stacked};

/// The paper's times of a level distance at degree 6, without and with a warm start, seconds.
const PAPER: (f64, f64) = (0.15, 0.010);
/// Where unrelated poses stand on the axis of step sizes.
const TELEPORT: f64 = 6.0;

/// The tables of a CSV.
pub(crate) struct Shown {
    steps: Vec<Steps>,
    passage: Passage,
}

impl Shown {
    /// Reads what [`Warm::csv`](super::Warm::csv) wrote: two tables, an empty line between them.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let (first, second) = csv.split_once("\n\n").unwrap_or((csv, ""));
        let mut steps: Vec<Steps> = Vec::new();
        for row in Table::read(first)?.rows() {
            let (pair, cell) = (row.text("pair")?, cell(&row)?);
            match steps.last_mut().filter(|steps| steps.pair == pair) {
                Some(steps) => steps.cells.push(cell),
                // The CSV does not hold the unit and the number of queries, which no block shows.
                None => steps.push(Steps { pair: pair.to_owned(), unit_m: f64::NAN, queries: 0, cells: vec![cell] }),
            }
        }
        let stops = Table::read(second)?.rows().map(|row| stop(&row)).collect::<Result<_, _>>()?;
        Ok(Self { steps, passage: Passage { stops } })
    }

    /// The pictures by name, the most telling first.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for steps in &self.steps {
            all.push((steps.picture(), stacked(&[steps.times()?, steps.iterations()?])));
        }
        all.push(("warm-passage.svg".into(), stacked(&[self.passage.levels()?, self.passage.times()?])));
        Ok(all)
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        let mut text = String::new();
        match name {
            "hints" => return self.hints(),
            "passage" => {
                self.passage.write(&mut text);
                text.push_str("\n![warm-passage.svg](warm-passage.svg)\n");
            }
            pair => {
                let steps = self.steps.iter().find(|steps| steps.pair == pair)?;
                steps.write(&mut text);
                // Writing to a string cannot fail.
                let _ = writeln!(text, "\n![{0}]({0})", steps.picture());
            }
        }
        Some(text)
    }

    /// Up to which step a hint pays.
    fn hints(&self) -> Option<String> {
        let part = |of: &dyn Fn(f64) -> bool| {
            let cells = self.steps.iter().flat_map(|steps| &steps.cells);
            let ours = cells.filter(|cell| matches!(cell.who, Who::Degree(_)) && of(cell.step.unwrap_or(TELEPORT)));
            Span::of(ours.map(|cell| cell.warm / cell.cold))
        };
        let near = part(&|step| step <= 0.01)?.text(2);
        let (tenth, far) = (part(&|step| step == 0.1)?.text(2), part(&|step| step >= 0.3)?.text(2));
        Some(format!(
            "A hint pays while the pose is near: for steps of up to a hundredth of half the larger diameter, with a turn of 1\n\
             degree, a warm query takes {near} of the time of a cold one; at a tenth {tenth}; from three tenths on\n\
             {far}. Reset the hint (`WarmStart::default()`) after a jump.\n"
        ))
    }
}

fn cell(row: &Row<'_>) -> Result<Cell, CsvError> {
    let name = row.text("who")?;
    let who = match name {
        "hulls, coal" => Some(Who::Coal),
        "hulls, parry" => Some(Who::Parry),
        degree => degree.strip_prefix("degree ").and_then(|degree| degree.parse().ok()).map(Who::Degree),
    };
    let iterations = |mean: &str, most: &str| Ok(row.maybe(mean)?.zip(row.maybe(most)?));
    Ok(Cell {
        who: who.ok_or_else(|| row.error(format!("no solver is named '{name}'")))?,
        step: if row.text("step")? == "teleport" { None } else { Some(row.get("step")?) },
        cold: row.number("cold_ns")?,
        warm: row.number("warm_ns")?,
        cold_iterations: iterations("cold_iterations", "cold_most")?,
        warm_iterations: iterations("warm_iterations", "warm_most")?,
        failed: row.get("failed")?,
        contradictions: row.get("contradictions")?,
    })
}

fn stop(row: &Row<'_>) -> Result<Stop, CsvError> {
    Ok(Stop {
        position_m: row.number("position_m")?,
        levels: [row.number("chair_human")?, row.number("human_chair")?],
        width: row.number("bracket_width")?,
        cold: row.number("cold_ns")?,
        warm: row.number("warm_ns")?,
        cold_iterations: row.get("cold_iterations")?,
        warm_iterations: row.get("warm_iterations")?,
        wrong: row.get("wrong")?,
    })
}

impl Who {
    pub(super) fn name(self) -> String {
        match self {
            Self::Degree(degree) => format!("degree {degree}"),
            Self::Coal => "hulls, coal".into(),
            Self::Parry => "hulls, parry".into(),
        }
    }

    fn ink(self) -> Ink {
        match self {
            Self::Degree(4) => Ink::Green,
            Self::Degree(6) => Ink::Blue,
            Self::Degree(_) => Ink::Purple,
            Self::Coal => Ink::Orange,
            Self::Parry => Ink::Grey,
        }
    }
}

impl Steps {
    fn picture(&self) -> String {
        format!("warm-{}.svg", self.pair)
    }

    fn of(&self, who: Who) -> impl Iterator<Item = &Cell> {
        self.cells.iter().filter(move |cell| cell.who == who)
    }

    fn whos(&self) -> Vec<Who> {
        let mut whos: Vec<Who> = Vec::new();
        for cell in &self.cells {
            if !whos.contains(&cell.who) {
                whos.push(cell.who);
            }
        }
        whos
    }

    fn times(&self) -> Result<String, ChartError> {
        self.chart("time of a query (µs)", "distance queries against the step from the pose before", |cell| {
            [Some(1e-3 * cell.cold), Some(1e-3 * cell.warm)]
        })
    }

    fn iterations(&self) -> Result<String, ChartError> {
        self.chart("mean iterations of a query", "iterations against the step from the pose before", |cell| {
            [cell.cold_iterations, cell.warm_iterations].map(|of| of.map(|(mean, _)| mean))
        })
    }

    /// Curves over step sizes: without hints rings, with them discs.
    fn chart(&self, y_label: &str, what: &str, of: impl Fn(&Cell) -> [Option<f64>; 2]) -> Result<String, ChartError> {
        let mut groups = Vec::new();
        for who in self.whos() {
            for (form, marker) in [(0, Marker::Ring), (1, Marker::Disc)] {
                let point = |cell: &Cell| {
                    Some(Point { x: cell.step.unwrap_or(TELEPORT), y: of(cell)[form]?, label: String::new() })
                };
                let points: Vec<Point> = self.of(who).filter_map(point).collect();
                let label = format!("{}, {}", who.name(), ["cold", "warm"][form]);
                if !points.is_empty() {
                    groups.push(Group { label, ink: who.ink(), marker, points, joined: true });
                }
            }
        }
        Scatter {
            title: format!("{}: {what}", self.pair),
            x_label: "step (part of half the larger diameter; hundreds of degrees)".into(),
            y_label: y_label.into(),
            groups,
            stairs: Vec::new(),
            edge: None,
            named: Some((TELEPORT, "teleport".into())),
        }
        .to_svg()
    }

    fn write(&self, text: &mut String) {
        let _ = writeln!(
            text,
            "| step | solver | cold ns | warm ns | cold over warm | iterations cold | worst | warm | worst | failed | wrong |\n\
             |---|---|---|---|---|---|---|---|---|---|---|"
        );
        for cell in &self.cells {
            let counts =
                |of: Option<(f64, u32)>| of.map_or("- | -".into(), |(mean, most)| format!("{mean:.2} | {most}"));
            let _ = writeln!(
                text,
                "| {} | {} | {:.0} | {:.0} | {:.2} | {} | {} | {} | {} |",
                cell.step.map_or("teleport".into(), |step| step.to_string()),
                cell.who.name(),
                cell.cold,
                cell.warm,
                cell.cold / cell.warm,
                counts(cell.cold_iterations),
                counts(cell.warm_iterations),
                cell.failed,
                cell.contradictions
            );
        }
    }
}

impl Passage {
    fn medians(&self) -> (f64, f64) {
        let of = |time: fn(&super::sweep::Stop) -> f64| median(&self.stops.iter().map(time).collect::<Vec<_>>());
        (of(|stop| stop.cold), of(|stop| stop.warm))
    }

    fn write(&self, text: &mut String) {
        let (cold, warm) = self.medians();
        let worst = |time: fn(&super::sweep::Stop) -> f64| self.stops.iter().map(time).fold(0.0, f64::max);
        let overlapping = self.stops.iter().filter(|stop| stop.levels[0] <= 1.0).count();
        let _ = writeln!(
            text,
            "The paper's experiment: bodies of degree 6, d(chair‖human) and d(human‖chair) at {} positions of the \
             chair, {overlapping} of them in overlap. Each query of d(chair‖human) is timed by repeating it, with the hint of the position before or \
             without.\n\n\
             | | without warm start | with |\n|---|---|---|\n\
             | the paper | {:.0} ms | {:.0} ms |\n\
             | ours, median position | {:.2} µs | {:.2} µs |\n\
             | ours, worst position | {:.2} µs | {:.2} µs |\n\
             | paper over ours, medians | {:.0} | {:.0} |\n\n\
             Widest bracket {:.1e} of max(1, d); {} positions with a wrong or wide answer.",
            self.stops.len(),
            1e3 * PAPER.0,
            1e3 * PAPER.1,
            1e-3 * cold,
            1e-3 * warm,
            1e-3 * worst(|stop| stop.cold),
            1e-3 * worst(|stop| stop.warm),
            1e9 * PAPER.0 / cold,
            1e9 * PAPER.1 / warm,
            self.stops.iter().map(|stop| stop.width).fold(0.0, f64::max),
            self.stops.iter().filter(|stop| stop.wrong).count()
        );
    }

    fn levels(&self) -> Result<String, ChartError> {
        let series = |label: &str, ink, dashed, which: usize| {
            let points = self.stops.iter().map(|stop| (stop.position_m, stop.levels[which])).collect();
            Series { label: label.into(), ink, dashed, points }
        };
        LineChart {
            title: "The chair passes through the human: level distances at degree 6".into(),
            x_label: "position of the chair (m)".into(),
            y_label: "level distance".into(),
            series: vec![series("d(chair‖human)", Ink::Blue, false, 0), series("d(human‖chair)", Ink::Orange, true, 1)],
            mark: Mark { value: 1.0, label: "touching".into() },
        }
        .to_svg()
    }

    fn times(&self) -> Result<String, ChartError> {
        let ends = [self.stops.first(), self.stops.last()].map(|stop| stop.map_or(0.0, |stop| stop.position_m));
        let flat = |label: &str, seconds: f64, ink| Series {
            label: label.into(),
            ink,
            dashed: true,
            points: ends.iter().map(|x| (*x, 1e3 * seconds)).collect(),
        };
        let ours = |label: &str, ink, time: fn(&super::sweep::Stop) -> f64| {
            let points = self.stops.iter().map(|stop| (stop.position_m, 1e-6 * time(stop))).collect();
            Series { label: label.into(), ink, dashed: false, points }
        };
        LineChart {
            title: "Time of a level distance, degree 6, as the chair passes".into(),
            x_label: "position of the chair (m)".into(),
            y_label: "time of a query (ms)".into(),
            series: vec![
                flat("paper, cold", PAPER.0, Ink::Orange),
                flat("paper, warm", PAPER.1, Ink::Purple),
                ours("ours, cold", Ink::Blue, |stop| stop.cold),
                ours("ours, warm", Ink::Green, |stop| stop.warm),
            ],
            mark: Mark { value: 1e-3, label: "a microsecond".into() },
        }
        .to_svg()
    }
}
