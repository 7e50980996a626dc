//! The report and its pictures.

use super::methods::{Cell, Method, OFF};
use super::{Accuracy, Measured};
use crate::duel::parry_version;
use crate::machine::locked;
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

/// A method's error, or the width of its bracket.
#[derive(Clone, Copy)]
struct Curve {
    name: &'static str,
    method: Method,
    proven: bool,
    /// None where another curve says the same in a picture.
    look: Option<(Ink, Marker)>,
}

const fn curve(name: &'static str, method: Method, proven: bool, look: Option<(Ink, Marker)>) -> Curve {
    Curve { name, method, proven, look }
}

const CURVES: [Curve; 11] = [
    curve("ours, cold, bracket", Method::Cold, true, Some((Ink::Blue, Marker::Disc))),
    curve("ours, cold, error", Method::Cold, false, Some((Ink::Blue, Marker::Ring))),
    curve("ours, warm, bracket", Method::Warm, true, Some((Ink::Green, Marker::Disc))),
    curve("ours, warm, error", Method::Warm, false, None),
    curve("Newton, plain start", Method::NewtonPlain, false, Some((Ink::Orange, Marker::Ring))),
    curve("Newton, our start", Method::NewtonOurs, false, Some((Ink::Orange, Marker::Triangle))),
    curve("Newton, pose before", Method::NewtonBefore, false, Some((Ink::Orange, Marker::Cross))),
    curve("SLSQP", Method::Slsqp, false, Some((Ink::Purple, Marker::Triangle))),
    curve("level 0, clarabel", Method::LevelZero, false, Some((Ink::Purple, Marker::Disc))),
    curve("hulls, parry", Method::Parry, false, Some((Ink::Grey, Marker::Cross))),
    curve("hulls, coal", Method::Coal, false, Some((Ink::Grey, Marker::Ring))),
];

/// Accuracies whose times are reported.
const GOALS: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// A setting is no longer better than another if its error is above this part of the other's.
const BETTER: f64 = 0.5;

/// Larger errors are not drawn: nothing is known there.
const DRAWN: f64 = 10.0;

const NOTES: &str = "\
- Errors and widths are parts of the circumradius of the smaller body, medians over the poses unless a column says otherwise. The truth is the middle of the \
narrowest bracket of ours; no error is reported below half of its width, which each case states. Times are means per query, one thread; clarabel is asked about fewer poses.
- The poses of fitted bodies are random, gaps between 0.5 and 37 % of the larger diameter (seeds 1, 2, ... of SplitMix64, one for each pose); the flat faces of \
two superellipsoids of degree 8 are turned against each other by 1e-4 to 1e-2 rad, 1 to 30 cm apart. `warm` and `pose before` know the answer a step \
before: a hundredth of half the diameter and a degree, or a centimetre along the faces.
- Ours: tolerances from 1e-3 to 1e-12; the bracket is proven, rounding included. Nobody else's answer has a proof.
- Newton: full steps on the eight optimality equations, 1 to 100 of them, without any test of the end; started where the line between interior points leaves the \
bodies (plain), at our witnesses of an answer to a tolerance of 1 (its time counts, its iterations do not), or at the witnesses of the pose before.
- SLSQP: sequential quadratic programming of NLopt, exact gradients, plain start, unit lengths; 2 to 1000 evaluations at most, which count as iterations; `ftol_rel` 1e-16; the last \
point evaluated counts, feasible or not.
- Level 0: the hierarchy's semidefinite program in moments, one matrix per body, stated again and solved for every query; gap and feasibility tolerances from 1e-3 to \
1e-12, faer, no chordal decomposition, one thread; the time is that of set-up and solve. It is exact here, the constraints being sos-convex.
- Hulls: of 100 points and more of the boundary, spread evenly in the normalized frame; GJK at its own tolerance, cold. A hull of boundary points lies inside, so that \
its distance is too large.
";

impl Accuracy {
    /// The pictures by name.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if nothing was measured.
    pub fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for case in &self.cases {
            let times = case.chart("time of a query (µs)", |cell| Some(1e-3 * cell.nanoseconds));
            all.push((format!("accuracy-{}.svg", case.name), times?));
            let counts = case.chart("iterations", |cell| cell.iterations);
            all.push((format!("accuracy-{}-iterations.svg", case.name), counts?));
        }
        Ok(all)
    }

    /// The report; the pictures lie beside it under these names.
    pub fn markdown(&self, pictures: &[&str]) -> String {
        let mut text = String::from("# Solver accuracy against time\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench accuracy --data DIR{flags}")));
        let part = |name: &str, version: &Option<String>, hint: &str| {
            version.as_ref().map_or(format!("{name} did not take part ({hint})"), |version| format!("{name} {version}"))
        };
        let _ = writeln!(
            text,
            "Peers: {}; {}; slsqp {}; parry3d-f64 {}. Passes: {}; rows take turns, medians count.\n\n{NOTES}",
            part(
                "clarabel",
                &self.solver,
                "`cargo build --release -p sublevel-bench --example clarabel` makes its program"
            ),
            part("coal", &self.coal, "SUBLEVEL_COAL is not set"),
            locked("slsqp"),
            parry_version(),
            self.passes
        );
        self.write_summary(&mut text);
        for case in &self.cases {
            case.write(&mut text);
            for picture in pictures {
                if *picture == format!("accuracy-{}.svg", case.name)
                    || *picture == format!("accuracy-{}-iterations.svg", case.name)
                {
                    let _ = writeln!(text, "![{picture}]({picture})\n");
                }
            }
        }
        text
    }

    /// All cases together.
    fn write_summary(&self, text: &mut String) {
        let count = self.cases.len();
        let _ = writeln!(
            text,
            "## All {count} cases\n\nFloor: the best median error at any setting, in the best and in the worst case. Times to an accuracy: geometric means \
             over the cases that get there, of the fastest setting whose median error is that small; how many of the cases do, if not all. Off: poses \
             whose error is above {OFF:e} at the tightest setting, all cases together.\n\n\
             | method | floor, best case | worst case | to 1e-3 | to 1e-6 | to 1e-9 | off |\n|---|---|---|---|---|---|---|"
        );
        for curve in CURVES {
            let floors: Vec<&Cell> = self.cases.iter().filter_map(|case| curve.floor(&case.cells)).collect();
            if floors.is_empty() {
                continue;
            }
            let values = || floors.iter().map(|cell| curve.value(cell));
            let (least, most) = (values().fold(f64::INFINITY, f64::min), values().fold(0.0, f64::max));
            let goals = GOALS.map(|goal| {
                let times: Vec<f64> =
                    self.cases.iter().filter_map(|case| Some(curve.reaches(&case.cells, goal)?.nanoseconds)).collect();
                let mean = (times.iter().map(|ns| ns.ln()).sum::<f64>() / times.len() as f64).exp();
                match times.len() {
                    0 => "-".into(),
                    all if all == count => time(mean),
                    some => format!("{} ({some} of {count})", time(mean)),
                }
            });
            let (off, of) = self.cases.iter().fold((0, 0), |(off, of), case| {
                let (more, queries) = curve.off(&case.cells);
                (off + more, of + queries)
            });
            let _ =
                writeln!(text, "| {} | {least:.0e} | {most:.0e} | {} | {off} of {of} |", curve.name, goals.join(" | "));
        }
        text.push('\n');
    }

    /// One line per case, method and setting.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "case,method,setting,queries,ns,iterations,error_median,error_max,width_median,width_max,off,short\n",
        );
        for case in &self.cases {
            for cell in &case.cells {
                let Cell { method, setting, queries, nanoseconds, iterations, error, width, off, short } = cell;
                let name = method.name();
                let announce = |value: Option<f64>| value.map_or(String::new(), |value| format!("{value:e}"));
                let widths = width.map_or([None; 2], |width| width.map(Some)).map(announce).join(",");
                let _ = writeln!(
                    text,
                    "{},{name},{setting},{queries},{nanoseconds:.1},{},{:e},{:e},{widths},{off},{}",
                    case.name,
                    announce(*iterations),
                    error[0],
                    error[1],
                    short.map_or(String::new(), |short| short.to_string())
                );
            }
        }
        text
    }
}

impl Method {
    /// Without blanks and commas, for tables.
    fn name(self) -> &'static str {
        match self {
            Self::Cold => "cold",
            Self::Warm => "warm",
            Self::NewtonPlain => "newton-plain",
            Self::NewtonOurs => "newton-ours",
            Self::NewtonBefore => "newton-before",
            Self::Slsqp => "slsqp",
            Self::LevelZero => "level0-clarabel",
            Self::Parry => "hulls-parry",
            Self::Coal => "hulls-coal",
        }
    }
}

impl Curve {
    fn of<'a>(&self, cells: &'a [Cell]) -> impl Iterator<Item = &'a Cell> + use<'a> {
        let method = self.method;
        cells.iter().filter(move |cell| cell.method == method)
    }

    fn value(&self, cell: &Cell) -> f64 {
        match cell.width {
            Some([median, _]) if self.proven => median,
            _ => cell.error[0],
        }
    }

    fn largest(&self, cell: &Cell) -> f64 {
        match cell.width {
            Some([_, most]) if self.proven => most,
            _ => cell.error[1],
        }
    }

    /// The cheapest setting that no other is better than by a factor of two: where it stops
    /// improving.
    fn floor<'a>(&self, cells: &'a [Cell]) -> Option<&'a Cell> {
        let best = self.of(cells).map(|cell| self.value(cell)).fold(f64::INFINITY, f64::min);
        let near = self.of(cells).filter(|cell| BETTER * self.value(cell) <= best);
        near.min_by(|a, b| a.nanoseconds.total_cmp(&b.nanoseconds))
    }

    /// Poses that are off at the tightest setting, and all of them.
    fn off(&self, cells: &[Cell]) -> (usize, usize) {
        self.of(cells).last().map_or((0, 0), |cell| (cell.off, cell.queries))
    }

    /// The fastest setting with this accuracy.
    fn reaches<'a>(&self, cells: &'a [Cell], goal: f64) -> Option<&'a Cell> {
        let good = self.of(cells).filter(|cell| self.value(cell) <= goal);
        good.min_by(|a, b| a.nanoseconds.total_cmp(&b.nanoseconds))
    }
}

impl Measured {
    fn write(&self, text: &mut String) {
        let Self { name, size_m, queries, reference, cells } = self;
        let _ = writeln!(
            text,
            "## {name}\n\nCircumradius of the smaller body {size_m:.3} m, {queries} poses; half of the reference's bracket: {:.0e}, at most {:.0e}.\n\n\
             | method | floor | largest there | from setting | time there | to 1e-3 (iterations) | to 1e-6 | to 1e-9 | off | short |\n\
             |---|---|---|---|---|---|---|---|---|---|",
            reference[0], reference[1]
        );
        for curve in CURVES {
            let Some(floor) = curve.floor(cells) else { continue };
            let (off, of) = curve.off(cells);
            let goals = GOALS.map(|goal| {
                curve.reaches(cells, goal).map_or("-".into(), |cell| {
                    let count = cell.iterations.map_or(String::new(), |count| format!(" ({count:.1})"));
                    format!("{}{count}", time(cell.nanoseconds))
                })
            });
            let _ = writeln!(
                text,
                "| {} | {:.1e} | {:.1e} | {} | {} | {} | {off} of {of} | {} |",
                curve.name,
                curve.value(floor),
                curve.largest(floor),
                floor.setting,
                time(floor.nanoseconds),
                goals.join(" | "),
                floor.short.map_or("-".into(), |short| short.to_string())
            );
        }
        text.push_str(
            "\nFloor: the median at the cheapest setting that no other is better than by a factor of two. Short: poses that do not keep \
             the tolerance of that setting, and say so. Off: poses whose error is above 1e-3 at the tightest setting.\n\n",
        );
    }

    /// Errors and widths against what `x` says.
    fn chart(&self, x_label: &str, x: impl Fn(&Cell) -> Option<f64>) -> Result<String, ChartError> {
        let groups = CURVES.iter().filter_map(|curve| {
            let (ink, marker) = curve.look?;
            let mut points: Vec<Point> = curve
                .of(&self.cells)
                .filter_map(|cell| Some(Point { x: x(cell)?, y: curve.value(cell), label: String::new() }))
                .filter(|point| point.x > 0.0 && point.y <= DRAWN)
                .collect();
            // The ends of a curve that counts something are known by what it counts.
            if matches!(curve.method, Method::Parry | Method::Coal) {
                let settings: Vec<&str> = curve.of(&self.cells).map(|cell| cell.setting.as_str()).collect();
                for at in [0, points.len().saturating_sub(1)] {
                    if let (Some(point), Some(setting)) = (points.get_mut(at), settings.get(at)) {
                        point.label = format!("{setting} points");
                    }
                }
            }
            let some = !points.is_empty();
            some.then(|| Group { label: curve.name.into(), ink, marker, points, joined: true })
        });
        Scatter {
            title: format!("{}: error and width of brackets", self.name),
            x_label: x_label.into(),
            y_label: "part of the smaller circumradius".into(),
            groups: groups.collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}

/// With a fitting unit.
fn time(nanoseconds: f64) -> String {
    match nanoseconds {
        ns if ns < 1e3 => format!("{ns:.0} ns"),
        ns if ns < 1e5 => format!("{:.2} µs", 1e-3 * ns),
        ns if ns < 1e6 => format!("{:.0} µs", 1e-3 * ns),
        ns => format!("{:.1} ms", 1e-6 * ns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cell(method: Method, nanoseconds: f64, error: f64) -> Cell {
        Cell {
            method,
            setting: "1".into(),
            queries: 10,
            nanoseconds,
            iterations: Some(2.0),
            error: [error, 2.0 * error],
            width: None,
            off: 0,
            short: None,
        }
    }

    #[test]
    fn the_floor_is_where_it_stops_improving() {
        let cells = [
            cell(Method::Slsqp, 1e3, 1e-4),
            cell(Method::Slsqp, 2e3, 1.5e-8),
            cell(Method::Slsqp, 3e3, 1e-8),
            cell(Method::Parry, 1e2, 1e-12),
        ];
        let slsqp = CURVES.iter().find(|curve| curve.method == Method::Slsqp).unwrap();
        assert_eq!(slsqp.floor(&cells).unwrap().nanoseconds, 2e3);
        assert_eq!(slsqp.reaches(&cells, 1e-3).unwrap().nanoseconds, 1e3);
        assert_eq!(slsqp.reaches(&cells, 1e-6).unwrap().nanoseconds, 2e3);
        assert!(slsqp.reaches(&cells, 1e-9).is_none());
        assert_eq!(slsqp.off(&cells), (0, 10), "of the last setting alone");
    }

    #[test]
    fn times_have_units() {
        assert_eq!([612.3, 12_345.0, 123_456.0, 2.5e7].map(time), ["612 ns", "12.35 µs", "123 µs", "25.0 ms"]);
    }
}
