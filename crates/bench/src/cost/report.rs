//! The report and its pictures.

use super::Cost;
use super::growth::{Growth, Line, Unit};
use std::fmt::Write;
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

const NOTES: &str = "\
Exponents are slopes of least squares through the logarithms, over the sizes from the geometric mean of the least and the largest on: the cost grows like that power of \
the size there. An exponent of a short range, such as of degrees, is a description of it and no law.

- Queries: distances to 1e-9 of the smaller circumradius at poses that are a hundredth of half the larger diameter and a degree apart (seeds 1, 2, ... of \
SplitMix64), cold and with the hint of the pose before, the same poses for all sizes; means per query, medians over passes, one thread.
- Memory of a solid: the slope of resident memory over many copies of it; a query allocates nothing.
- Fits: time of the fit alone, all its proofs made; memory is the peak of a process that reads the points and fits them (VmHWM).
";

const LOOKS: [(Ink, Marker); 4] = [
    (Ink::Blue, Marker::Disc),
    (Ink::Orange, Marker::Triangle),
    (Ink::Green, Marker::Ring),
    (Ink::Purple, Marker::Cross),
];

/// From here on a picture has the next larger unit.
const LONG_NS: f64 = 2e7;
const LARGE_BYTES: f64 = 1e7;

impl Cost {
    /// The pictures by name.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if nothing was measured.
    pub fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let mut all = Vec::new();
        for growth in &self.growths {
            all.push((growth.picture(Unit::Nanoseconds), growth.chart(Unit::Nanoseconds)?));
            if growth.of(Unit::Bytes).next().is_some() {
                all.push((growth.picture(Unit::Bytes), growth.chart(Unit::Bytes)?));
            }
        }
        Ok(all)
    }

    /// The report; the pictures lie beside it under these names.
    pub fn markdown(&self, pictures: &[&str]) -> String {
        let mut text = String::from("# How costs grow\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench cost --data DIR{flags}")));
        let _ = writeln!(text, "Passes: {}.\n\n{NOTES}", self.passes);
        let _ = writeln!(text, "| cost | against | from | to | exponent |\n|---|---|---|---|---|");
        for growth in &self.growths {
            for line in &growth.lines {
                let (Some(first), Some(last)) = (line.points.first(), line.points.last()) else { continue };
                let _ = writeln!(
                    text,
                    "| {}, {} | {} | {} at {} | {} at {} | {} |",
                    growth.key,
                    line.name,
                    growth.size,
                    line.unit.text(first.1),
                    first.0,
                    line.unit.text(last.1),
                    last.0,
                    power(line)
                );
            }
        }
        text.push('\n');
        for growth in &self.growths {
            growth.write(&mut text);
            for unit in [Unit::Nanoseconds, Unit::Bytes] {
                let name = growth.picture(unit);
                if pictures.contains(&name.as_str()) {
                    let _ = writeln!(text, "![{name}]({name})\n");
                }
            }
        }
        text
    }

    /// One line per point; the exponent is that of its curve.
    pub fn csv(&self) -> String {
        let mut text = String::from("against,curve,unit,size,cost,exponent\n");
        for growth in &self.growths {
            for line in &growth.lines {
                let unit = match line.unit {
                    Unit::Nanoseconds => "ns",
                    Unit::Bytes => "bytes",
                };
                for (size, cost) in &line.points {
                    let _ = writeln!(
                        text,
                        "{},\"{}\",{unit},{size},{cost:.1},{:.3}",
                        growth.key,
                        line.name,
                        line.exponent().unwrap_or(f64::NAN)
                    );
                }
            }
        }
        text
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

    fn picture(&self, unit: Unit) -> String {
        match unit {
            Unit::Nanoseconds => format!("cost-{}.svg", self.key),
            Unit::Bytes => format!("cost-{}-memory.svg", self.key),
        }
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
            Unit::Nanoseconds => self.title.to_owned(),
            Unit::Bytes => format!("{}: memory", self.title),
        };
        Scatter {
            title,
            x_label: self.size.into(),
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
        let _ = writeln!(
            text,
            "## {}\n\n{}\n\n| {} | {} |\n|---{}|",
            self.title,
            self.what,
            self.size,
            heads.join(" | "),
            "|---".repeat(heads.len())
        );
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
        let _ = writeln!(text, "| exponent | {} |\n", powers.join(" | "));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_fitting_units() {
        let times = [5.4, 999.0, 1234.0, 56_789.0, 1.5e6, 2.5e9].map(|ns| Unit::Nanoseconds.text(ns));
        assert_eq!(times, ["5 ns", "999 ns", "1.23 µs", "56.8 µs", "1.50 ms", "2.50 s"]);
        assert_eq!(Unit::Bytes.text(34_560.0), "34.6 kB");
        assert_eq!([-0.001, -1.256].map(two_places), ["0.00", "-1.26"]);
    }

    #[test]
    fn a_growth_is_told_with_its_exponent() {
        let mut line = Line::new("cold", Unit::Nanoseconds);
        line.points = (0..5).map(|i| 10_f64.powi(i)).map(|x| (x, 7.0 * x * x)).collect();
        let growth =
            Growth { key: "degree", title: "A query", size: "degree", what: "Bodies.".into(), lines: vec![line] };
        let machine = crate::Machine::this();
        let cost = Cost { machine, quick: true, passes: 1, growths: vec![growth] };
        let report = cost.markdown(&["cost-degree.svg"]);
        for words in ["sublevel-bench cost --data DIR --quick", "| exponent | 2.00 |", "](cost-degree.svg)", "700 ms"] {
            assert!(report.contains(words), "{words}: {report}");
        }
        let [(name, picture)] = &cost.pictures().unwrap()[..] else { panic!("one picture") };
        assert!(name == "cost-degree.svg" && picture.contains("~ n^2.00") && !picture.contains("NaN"));
        assert_eq!(cost.csv().lines().count(), 6);
    }
}
