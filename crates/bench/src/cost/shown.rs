//! What pages show of `cost.csv`: tables with exponents, and pictures.

use super::growth::{AXES, Growth, Line, Unit};
use crate::csv::{CsvError, Table};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter, stacked};

const LOOKS: [(Ink, Marker); 4] = [
    (Ink::Blue, Marker::Disc),
    (Ink::Orange, Marker::Triangle),
    (Ink::Green, Marker::Ring),
    (Ink::Purple, Marker::Cross),
];

/// From here on a picture has the next larger unit.
const LONG_NS: f64 = 2e7;
const LARGE_BYTES: f64 = 1e7;

/// Curves of a summary, by what they grow with and their name.
const SUMMARY: [(&str, &str); 9] = [
    ("degree", "cold"),
    ("degree", "warm"),
    ("constraints", "cold"),
    ("constraints", "warm"),
    ("parts", "cold"),
    ("parts", "warm"),
    ("batch", "a batch"),
    ("message", "a message"),
    ("degree", "in memory"),
];

/// The growths of a CSV.
pub(crate) struct Shown {
    growths: Vec<Growth>,
}

impl Shown {
    /// Reads what [`Cost::csv`](super::Cost::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let mut growths: Vec<Growth> = Vec::new();
        for row in Table::read(csv)?.rows() {
            let key = row.text("against")?;
            let axis = AXES.into_iter().find(|axis| axis.key == key);
            let axis = axis.ok_or_else(|| row.error(format!("nothing is measured against '{key}'")))?;
            if growths.last().is_none_or(|growth| growth.axis != axis) {
                // The CSV does not hold what was measured, which no block shows.
                growths.push(Growth { axis, what: String::new(), lines: Vec::new() });
            }
            let unit = match row.text("unit")? {
                "ns" => Unit::Nanoseconds,
                "bytes" => Unit::Bytes,
                other => return Err(row.error(format!("no unit is named '{other}'"))),
            };
            let name = row.text("curve")?;
            let point = (row.number("size")?, row.number("cost")?);
            let Some(Growth { lines, .. }) = growths.last_mut() else { continue };
            match lines.last_mut().filter(|line| line.name == name && line.unit == unit) {
                Some(line) => line.points.push(point),
                None => lines.push(Line { points: vec![point], ..Line::new(name, unit) }),
            }
        }
        Ok(Self { growths })
    }

    /// The pictures by name, the most telling first: of each growth time, and memory below.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for growth in &self.growths {
            let mut charts = vec![growth.chart(Unit::Nanoseconds)?];
            if growth.of(Unit::Bytes).next().is_some() {
                charts.push(growth.chart(Unit::Bytes)?);
            }
            all.push((growth.picture(), stacked(&charts)));
        }
        Ok(all)
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "exponents" => Some(self.exponents()),
            "summary" => Some(self.summary()),
            "fits" => self.fits(),
            key => {
                let growth = self.growths.iter().find(|growth| growth.axis.key == key)?;
                let mut text = String::new();
                growth.write(&mut text);
                // Writing to a string cannot fail.
                let _ = writeln!(text, "\n![{0}]({0})", growth.picture());
                Some(text)
            }
        }
    }

    fn exponents(&self) -> String {
        let mut text = String::new();
        let _ = writeln!(text, "| cost | against | from | to | exponent |\n|---|---|---|---|---|");
        for growth in &self.growths {
            for line in &growth.lines {
                let (Some(first), Some(last)) = (line.points.first(), line.points.last()) else { continue };
                let _ = writeln!(
                    text,
                    "| {}, {} | {} | {} at {} | {} at {} | {} |",
                    growth.axis.key,
                    line.name,
                    growth.axis.size,
                    line.unit.text(first.1),
                    first.0,
                    line.unit.text(last.1),
                    last.0,
                    power(line)
                );
            }
        }
        text
    }

    fn line(&self, key: &str, name: &str) -> Option<(&Growth, &Line)> {
        let growth = self.growths.iter().find(|growth| growth.axis.key == key)?;
        Some((growth, growth.lines.iter().find(|line| line.name == name)?))
    }

    fn summary(&self) -> String {
        let mut text = String::from("| cost | from | to | exponent |\n|---|---|---|---|\n");
        for (key, name) in SUMMARY {
            let Some((growth, line)) = self.line(key, name) else { continue };
            let (Some(first), Some(last)) = (line.points.first(), line.points.last()) else { continue };
            let _ = writeln!(
                text,
                "| {}, {name} | {} at {} | {} at {} | {} |",
                growth.axis.size,
                line.unit.text(first.1),
                first.0,
                line.unit.text(last.1),
                last.0,
                line.exponent().map_or("-".into(), |exponent| format!("{exponent:.1}"))
            );
        }
        text
    }

    /// Times of whole fits as a sentence.
    fn fits(&self) -> Option<String> {
        let at = |key: &str, name: &str, size: f64| {
            let (_, line) = self.line(key, name)?;
            Some(line.unit.text(line.points.iter().find(|point| point.0 == size)?.1))
        };
        let degree = |degree| at("fit-degree", "fit", degree);
        Some(format!(
            "Whole fits of a chair take {} at degree 2, {} at degree 4, {} at degree 6 and {} at degree 8, and a\n\
             million points on it {} at degree 6. What is slow is many points that are all vertices of their hull: {} of\n\
             10 000 and {} of 100 000.\n",
            degree(2.0)?,
            degree(4.0)?,
            degree(6.0)?,
            degree(8.0)?,
            at("fit-points", "on chair", 1e6)?,
            at("fit-points", "all on their hull", 1e4)?,
            at("fit-points", "all on their hull", 1e5)?
        ))
    }
}

/// Without a sign before nothing.
fn two_places(value: f64) -> String {
    format!("{:.2}", (100.0 * value).round() / 100.0 + 0.0)
}

fn power(line: &Line) -> String {
    line.exponent().map_or("-".into(), two_places)
}

impl Unit {
    /// With a fitting prefix.
    fn text(self, value: f64) -> String {
        let scaled = |names: [&str; 4]| {
            let step = (0..3).find(|&step| value < 1000_f64.powi(step + 1)).unwrap_or(3);
            let digits = value / 1000_f64.powi(step);
            // Three digits.
            let places = if step == 0 || digits >= 100.0 { 0 } else { 1 + usize::from(digits < 10.0) };
            format!("{digits:.places$} {}", names[step as usize])
        };
        match self {
            Self::Nanoseconds => scaled(["ns", "µs", "ms", "s"]),
            Self::Bytes => scaled(["B", "kB", "MB", "GB"]),
        }
    }
}

impl Growth {
    fn of(&self, unit: Unit) -> impl Iterator<Item = &Line> {
        self.lines.iter().filter(move |line| line.unit == unit && !line.points.is_empty())
    }

    fn picture(&self) -> String {
        format!("cost-{}.svg", self.axis.key)
    }

    fn chart(&self, unit: Unit) -> Result<String, ChartError> {
        let most = self.of(unit).flat_map(|line| &line.points).map(|point| point.1).fold(0.0, f64::max);
        let (y_label, scale) = match unit {
            Unit::Nanoseconds if most > LONG_NS => ("time (ms)", 1e-6),
            Unit::Nanoseconds => ("time (µs)", 1e-3),
            Unit::Bytes if most > LARGE_BYTES => ("memory (MB)", 1e-6),
            Unit::Bytes => ("memory (kB)", 1e-3),
        };
        let groups = self.of(unit).zip(LOOKS).map(|(line, (ink, marker))| {
            let last = line.points.len() - 1;
            let word = line.exponent().map_or(String::new(), |exponent| format!("~ n^{}", two_places(exponent)));
            let point = |(i, (x, y)): (usize, &(f64, f64))| Point {
                x: *x,
                y: scale * y,
                label: if i == last { word.clone() } else { String::new() },
            };
            let points = line.points.iter().enumerate().map(point).collect();
            Group { label: line.name.clone(), ink, marker, points, joined: true }
        });
        let title = match unit {
            Unit::Nanoseconds => self.axis.title.to_owned(),
            Unit::Bytes => format!("{}: memory", self.axis.title),
        };
        Scatter {
            title,
            x_label: self.axis.size.into(),
            y_label: y_label.into(),
            groups: groups.collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }

    fn write(&self, text: &mut String) {
        let lines: Vec<&Line> = self.lines.iter().filter(|line| !line.points.is_empty()).collect();
        let heads: Vec<&str> = lines.iter().map(|line| line.name.as_str()).collect();
        let _ = writeln!(text, "| {} | {} |\n|---{}|", self.axis.size, heads.join(" | "), "|---".repeat(heads.len()));
        let mut sizes: Vec<f64> = lines.iter().flat_map(|line| &line.points).map(|point| point.0).collect();
        sizes.sort_by(f64::total_cmp);
        sizes.dedup();
        for size in sizes {
            let cell = |line: &&Line| {
                let found = line.points.iter().find(|point| point.0 == size);
                found.map_or("-".into(), |point| line.unit.text(point.1))
            };
            let cells: Vec<String> = lines.iter().map(cell).collect();
            let _ = writeln!(text, "| {size} | {} |", cells.join(" | "));
        }
        let powers: Vec<String> = lines.iter().map(|line| power(line)).collect();
        let _ = writeln!(text, "| exponent | {} |", powers.join(" | "));
    }
}

#[cfg(test)]
mod tests {
    use super::super::Cost;
    use super::super::growth::DEGREE;
    use super::*;

    #[test]
    fn numbers_have_fitting_units() {
        let times = [5.4, 999.0, 1234.0, 56_789.0, 1.5e6, 2.5e9].map(|ns| Unit::Nanoseconds.text(ns));
        assert_eq!(times, ["5 ns", "999 ns", "1.23 µs", "56.8 µs", "1.50 ms", "2.50 s"]);
        assert_eq!(Unit::Bytes.text(34_560.0), "34.6 kB");
        assert_eq!([-0.001, -1.256].map(two_places), ["0.00", "-1.26"]);
    }

    #[test]
    fn a_growth_is_shown_with_its_exponent() {
        let mut line = Line::new("cold", Unit::Nanoseconds);
        line.points = (0..5).map(|i| 10_f64.powi(i)).map(|x| (x, 7.0 * x * x)).collect();
        let growth = Growth { axis: DEGREE, what: "Bodies.".into(), lines: vec![line] };
        let machine = crate::Machine::this();
        let cost = Cost { machine, quick: true, passes: 1, growths: vec![growth] };
        let report = cost.markdown();
        for words in ["sublevel-bench cost --data DIR --quick", "Bodies.", "<!-- from cost.csv: degree -->"] {
            assert!(report.contains(words), "{words}: {report}");
        }
        assert_eq!(cost.csv().lines().count(), 6);
        let shown = Shown::read(&cost.csv()).unwrap();
        let table = shown.block("degree").unwrap();
        for words in ["| exponent | 2.00 |", "](cost-degree.svg)", "700 ms"] {
            assert!(table.contains(words), "{words}: {table}");
        }
        let [(name, picture)] = &shown.pictures().unwrap()[..] else { panic!("one picture") };
        assert!(name == "cost-degree.svg" && picture.contains("~ n^2.00") && !picture.contains("NaN"));
        assert_eq!(shown.block("unknown"), None);
    }
}
