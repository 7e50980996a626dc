//! The report and its pictures.

use super::steps::{Cell, Steps, Who};
use super::{Passage, Warm};
use crate::duel::{parry_version, sweep::median};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, LineChart, Mark, Marker, Point, Scatter, Series};

/// The paper's times of a level distance at degree 6, without and with a warm start, seconds.
const PAPER: (f64, f64) = (0.15, 0.010);
/// Where unrelated poses stand on the axis of step sizes.
const TELEPORT: f64 = 6.0;

impl Who {
    fn name(self) -> String {
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

impl Warm {
    /// The pictures by name.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if nothing was measured.
    pub fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for steps in &self.steps {
            all.push((format!("warm-{}.svg", steps.pair), steps.times()?));
            all.push((format!("warm-{}-iterations.svg", steps.pair), steps.iterations()?));
        }
        all.push(("warm-passage.svg".into(), self.passage.levels()?));
        all.push(("warm-passage-time.svg".into(), self.passage.times()?));
        Ok(all)
    }

    /// The report; the pictures lie beside it under these names.
    pub fn markdown(&self, pictures: &[&str]) -> String {
        let mut text = String::from("# Warm starts\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench warm --data DIR{flags}")));
        let coal = self.coal.as_ref().map_or("coal did not take part (SUBLEVEL_COAL is not set)".to_owned(), |version| {
            format!("coal {version} is the wheel from PyPI, a generic build, at its default tolerance of 1e-6 m, warm by its cached guess")
        });
        let _ = writeln!(
            text,
            "Peers: {coal}; parry3d-f64 {}, warm by its initial direction. Passes: {}; rows take turns, in each of which a motion is walked nine times on end; medians \
             count; one thread.\n",
            parry_version(),
            self.passes
        );
        let _ = writeln!(
            text,
            "A step of s moves the second object by s times half of the larger diameter and turns it by 100 s degrees, in random directions (seeds 1, \
             2, ... of SplitMix64); `teleport` are poses that have nothing to do with each other. The gap of the widest bodies stays between 0.5 and \
             37 % of the larger diameter.\n"
        );
        for steps in &self.steps {
            steps.write(&mut text);
        }
        self.passage.write(&mut text);
        for picture in pictures {
            let _ = writeln!(text, "![{picture}]({picture})\n");
        }
        text
    }

    /// Two tables, an empty line between them.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "pair,who,step,cold_ns,warm_ns,cold_iterations,cold_most,warm_iterations,warm_most,failed,contradictions\n",
        );
        for Steps { pair, cells, .. } in &self.steps {
            for Cell { who, step, cold, warm, cold_iterations, warm_iterations, failed, contradictions } in cells {
                let step = step.map_or("teleport".into(), |step| step.to_string());
                let counts = |of: &Option<(f64, u32)>| of.map_or(",".into(), |(mean, most)| format!("{mean},{most}"));
                let (cold_count, warm_count) = (counts(cold_iterations), counts(warm_iterations));
                let name = who.name();
                let _ = writeln!(
                    text,
                    "{pair},\"{name}\",{step},{cold},{warm},{cold_count},{warm_count},{failed},{contradictions}"
                );
            }
        }
        text.push_str("\nposition_m,chair_human,human_chair,bracket_width,cold_ns,warm_ns,cold_iterations,warm_iterations,wrong\n");
        for stop in &self.passage.stops {
            let _ = writeln!(
                text,
                "{},{},{},{:e},{},{},{},{},{}",
                stop.position_m,
                stop.levels[0],
                stop.levels[1],
                stop.width,
                stop.cold,
                stop.warm,
                stop.cold_iterations,
                stop.warm_iterations,
                stop.wrong
            );
        }
        text
    }
}

impl Steps {
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
        let Self { pair, unit_m, queries, .. } = self;
        let _ = writeln!(
            text,
            "## {pair}\n\nA step of 1 is {unit_m:.3} m; {queries} queries per cell.\n\n\
             | step | solver | cold ns | warm ns | cold over warm | iterations cold | worst | warm | worst | failed | wrong |\n\
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
        text.push('\n');
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
            "## The chair passes the human\n\nThe paper's experiment: bodies of degree 6, d(chair‖human) and d(human‖chair) at {} positions of the \
             chair, {overlapping} of them in overlap. Each query of d(chair‖human) is timed by repeating it, with the hint of the position before or \
             without.\n\n\
             | | without warm start | with |\n|---|---|---|\n\
             | the paper | {:.0} ms | {:.0} ms |\n\
             | ours, median position | {:.2} µs | {:.2} µs |\n\
             | ours, worst position | {:.2} µs | {:.2} µs |\n\
             | paper over ours, medians | {:.0} | {:.0} |\n\n\
             Widest bracket {:.1e} of max(1, d); {} positions with a wrong or wide answer.\n",
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
