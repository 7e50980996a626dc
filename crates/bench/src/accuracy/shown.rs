//! What pages show of `accuracy.csv`: tables, pictures, and a summary.

use super::methods::{Cell, Method, OFF};
use crate::csv::{CsvError, Row, Table};
use crate::words::Span;
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter, stacked};

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

/// Accuracies whose times are shown.
const GOALS: [f64; 3] = [1e-3, 1e-6, 1e-9];
/// A setting is no longer better than another if its error is above this part of the other's.
const BETTER: f64 = 0.5;

/// Larger errors are not drawn: nothing is known there.
const DRAWN: f64 = 10.0;

const NOTES: &str = "\
- Errors and widths are parts of the circumradius of the smaller body, medians over the poses unless a column says otherwise. The truth is the middle of the \
narrowest bracket of ours; no error is given below half of its width, which each case states. Times are means per query, one thread; clarabel is asked about fewer poses.
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

/// The cells of a case.
struct Cells {
    name: String,
    cells: Vec<Cell>,
}

/// The cases of a CSV.
pub(crate) struct Shown {
    cases: Vec<Cells>,
}

impl Shown {
    /// Reads what [`Accuracy::csv`](super::Accuracy::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let mut cases: Vec<Cells> = Vec::new();
        for row in Table::read(csv)?.rows() {
            let (name, cell) = (row.text("case")?, cell(&row)?);
            match cases.last_mut().filter(|case| case.name == name) {
                Some(case) => case.cells.push(cell),
                None => cases.push(Cells { name: name.to_owned(), cells: vec![cell] }),
            }
        }
        Ok(Self { cases })
    }

    /// The pictures by name, the most telling first.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for case in &self.cases {
            let times = case.chart("time of a query (µs)", |cell| Some(1e-3 * cell.nanoseconds))?;
            let counts = case.chart("iterations", |cell| cell.iterations)?;
            all.push((case.picture(), stacked(&[times, counts])));
        }
        Ok(all)
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        Some(match name {
            "notes" => NOTES.to_owned(),
            "all cases" => self.summary(),
            "methods" => self.methods(),
            "narrow brackets" => self.narrow()?,
            name => {
                let case = self.cases.iter().find(|case| case.name == name)?;
                let mut text = String::new();
                case.write(&mut text);
                // Writing to a string cannot fail.
                let _ = writeln!(text, "\n![{0}]({0})", case.picture());
                text
            }
        })
    }

    /// Times to an accuracy of 1e-9, in short.
    fn methods(&self) -> String {
        let mut text = String::from(
            "| method | cases that get there | time | answers off by more than 1e-3 |\n|---|---|---|---|\n",
        );
        for curve in CURVES {
            let times: Vec<f64> = self.times(&curve, 1e-9);
            let (off, of) = self.off(&curve);
            if of == 0 {
                continue;
            }
            let mean = if times.is_empty() { "-".into() } else { time(mean(&times)) };
            let _ =
                writeln!(text, "| {} | {} of {} | {mean} | {off} of {of} |", curve.name, times.len(), self.cases.len());
        }
        text
    }

    /// What brackets of 1e-12 take, and where hulls of boundary points end.
    fn narrow(&self) -> Option<String> {
        let ours = |degree_4: bool| {
            let cases = self.cases.iter().filter(|case| case.name.ends_with("-d4") == degree_4);
            let cells = cases.flat_map(|case| &case.cells);
            let ours =
                cells.filter(|cell| matches!(cell.method, Method::Cold | Method::Warm) && cell.setting == "1e-12");
            Some(Span::of(ours.map(|cell| cell.nanoseconds))?.microseconds())
        };
        let hulls = CURVES.iter().filter(|curve| matches!(curve.method, Method::Parry | Method::Coal));
        let floors =
            hulls.flat_map(|curve| self.cases.iter().filter_map(|case| Some(curve.value(curve.floor(&case.cells)?))));
        let Span { least, most } = Span::of(floors)?;
        Some(format!(
            "Brackets to 1e-12 take {} at degree 4, and {} at degree 6 and for flat faces of degree 8, where\n\
             double-double arithmetic has to take over. Hulls of boundary points end at errors of {least:.0e} to {most:.0e}.\n",
            ours(true)?,
            ours(false)?
        ))
    }

    /// Of the cases that get to an accuracy.
    fn times(&self, curve: &Curve, goal: f64) -> Vec<f64> {
        self.cases.iter().filter_map(|case| Some(curve.reaches(&case.cells, goal)?.nanoseconds)).collect()
    }

    fn off(&self, curve: &Curve) -> (usize, usize) {
        let all = self.cases.iter().map(|case| curve.off(&case.cells));
        all.fold((0, 0), |(off, of), (more, queries)| (off + more, of + queries))
    }

    /// All cases together.
    fn summary(&self) -> String {
        let mut text = String::new();
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
                let times = self.times(&curve, goal);
                let mean = mean(&times);
                match times.len() {
                    0 => "-".into(),
                    all if all == count => time(mean),
                    some => format!("{} ({some} of {count})", time(mean)),
                }
            });
            let (off, of) = self.off(&curve);
            let _ =
                writeln!(text, "| {} | {least:.0e} | {most:.0e} | {} | {off} of {of} |", curve.name, goals.join(" | "));
        }
        text
    }
}

/// The geometric mean.
fn mean(times: &[f64]) -> f64 {
    (times.iter().map(|ns| ns.ln()).sum::<f64>() / times.len() as f64).exp()
}

fn cell(row: &Row<'_>) -> Result<Cell, CsvError> {
    let name = row.text("method")?;
    let method = CURVES.iter().map(|curve| curve.method).find(|method| method.name() == name);
    Ok(Cell {
        method: method.ok_or_else(|| row.error(format!("no method is named '{name}'")))?,
        setting: row.text("setting")?.to_owned(),
        queries: row.get("queries")?,
        nanoseconds: row.number("ns")?,
        iterations: row.maybe("iterations")?,
        error: [row.number("error_median")?, row.number("error_max")?],
        width: row.maybe("width_median")?.zip(row.maybe("width_max")?).map(|(median, most)| [median, most]),
        off: row.get("off")?,
        short: row.maybe("short")?,
    })
}

impl Method {
    /// Without blanks and commas, for tables.
    pub(super) fn name(self) -> &'static str {
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

impl Cells {
    fn picture(&self) -> String {
        format!("accuracy-{}.svg", self.name)
    }

    fn write(&self, text: &mut String) {
        let cells = &self.cells;
        let _ = writeln!(
            text,
            "| method | floor | largest there | from setting | time there | to 1e-3 (iterations) | to 1e-6 | to 1e-9 | off | short |\n\
             |---|---|---|---|---|---|---|---|---|---|"
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
             the tolerance of that setting, and say so. Off: poses whose error is above 1e-3 at the tightest setting.\n",
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
