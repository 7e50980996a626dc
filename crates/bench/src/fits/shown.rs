//! What pages show of `fits.csv`: tables, a picture, and a sentence.

use std::fmt::Write;

use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

use super::fitting::{Fitting, Method};
use crate::csv::{CsvError, Row, Table};

/// The rows of a CSV.
pub(crate) struct Shown {
    fittings: Vec<Fitting>,
}

impl Shown {
    /// Reads what [`Fits::csv`](super::Fits::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let fitting = |row: Row<'_>| {
            Ok(Fitting {
                mesh: row.text("mesh")?.to_owned(),
                vertices: row.get("hull_vertices")?,
                method: row.text("method")?.to_owned(),
                degree: row.get("degree")?,
                seconds: row.number("seconds")?,
                ratio: row.number("volume_over_hull")?,
                objective: row.maybe("objective")?,
                gap: row.maybe("gap")?,
                rounds: row.get("rounds")?,
                iterations: row.get("iterations")?,
            })
        };
        Ok(Self { fittings: Table::read(csv)?.rows().map(fitting).collect::<Result<_, CsvError>>()? })
    }

    /// The picture.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        Ok(vec![("fits.svg".into(), self.chart()?)])
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "medians" => Some(self.medians() + "\n![fits.svg](fits.svg)\n"),
            "table" => Some(self.medians()),
            "agreement" => Some(self.agreement()),
            "all" => Some(self.all()),
            "solvers" => self.solvers(),
            _ => None,
        }
    }

    fn of(&self, method: Method, degree: usize) -> impl Iterator<Item = &Fitting> {
        self.fittings.iter().filter(move |fitting| fitting.method == method.name() && fitting.degree == degree)
    }

    fn degrees(&self) -> Vec<usize> {
        [2, 4, 6, 8].into_iter().filter(|&degree| self.of(Method::Clarabel, degree).next().is_some()).collect()
    }

    /// Medians of times and of volumes over those of the hulls.
    fn median(&self, method: Method, degree: usize) -> Option<(f64, f64)> {
        let middle = |value: fn(&Fitting) -> f64| {
            let mut values: Vec<f64> = self.of(method, degree).map(value).collect();
            values.sort_by(f64::total_cmp);
            values.get(values.len() / 2).copied()
        };
        Some((middle(|fitting| fitting.seconds)?, middle(|fitting| fitting.ratio)?))
    }

    fn medians(&self) -> String {
        let mut text = String::from("| degree |");
        Method::ALL.iter().for_each(|method| text += &format!(" {} s | volume:hull |", method.name()));
        text += "\n|---|";
        Method::ALL.iter().for_each(|_| text += "---|---|");
        text.push('\n');
        for degree in self.degrees() {
            text += &format!("| {degree} |");
            for method in Method::ALL {
                text += &self
                    .median(method, degree)
                    .map_or(" - | - |".into(), |(seconds, ratio)| format!(" {seconds:.3} | {ratio:.4} |"));
            }
            text.push('\n');
        }
        text
    }

    fn agreement(&self) -> String {
        let mut text = String::from(
            "| mesh | degree | structured s | clarabel s | clarabel over structured | objectives differ by | volumes differ by | \
             gap structured | gap clarabel |\n|---|---|---|---|---|---|---|---|---|\n",
        );
        for degree in self.degrees() {
            for clarabel in self.of(Method::Clarabel, degree) {
                let same = self.of(Method::Structured, degree).find(|fitting| fitting.mesh == clarabel.mesh);
                let Some(structured) = same else { continue };
                let objective = clarabel.objective.zip(structured.objective).map_or(f64::NAN, |(a, b)| a - b);
                let gap = |fitting: &Fitting| fitting.gap.map_or("-".into(), |gap| format!("{gap:.1e}"));
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "| {} | {degree} | {:.3} | {:.3} | {:.2} | {objective:.1e} | {:.1e} | {} | {} |",
                    clarabel.mesh,
                    structured.seconds,
                    clarabel.seconds,
                    clarabel.seconds / structured.seconds,
                    clarabel.ratio / structured.ratio - 1.0,
                    gap(structured),
                    gap(clarabel)
                );
            }
        }
        text
    }

    fn all(&self) -> String {
        let mut text = String::from(
            "| mesh | hull vertices | degree | method | seconds | volume:hull | objective | programs | iterations |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for fitting in &self.fittings {
            let Fitting { mesh, vertices, method, degree, seconds, ratio, rounds, iterations, .. } = fitting;
            let objective = fitting.objective.map_or("-".into(), |objective| format!("{objective:.6}"));
            let _ = writeln!(
                text,
                "| {mesh} | {vertices} | {degree} | {method} | {seconds:.3} | {ratio:.5} | {objective} | {rounds} | {iterations} |"
            );
        }
        text
    }

    /// Times of both solvers as a sentence.
    fn solvers(&self) -> Option<String> {
        let degrees = self.degrees();
        let times = |method| {
            let times = degrees.iter().map(|&degree| Some(format!("{:.2}", self.median(method, degree)?.0)));
            Some(times.collect::<Option<Vec<_>>>()?.join(" / "))
        };
        let names: Vec<_> = degrees.iter().map(ToString::to_string).collect();
        Some(format!(
            "At degree {} a fit takes {} s by clarabel and {} s by the structured solver (medians of five meshes, one core).\n",
            names.join(" / "),
            times(Method::Clarabel)?,
            times(Method::Structured)?
        ))
    }

    fn chart(&self) -> Result<String, ChartError> {
        let looks = [
            (Method::Clarabel, Ink::Blue, Marker::Disc),
            (Method::Structured, Ink::Green, Marker::Triangle),
            (Method::Refined, Ink::Orange, Marker::Disc),
            (Method::Sdsos, Ink::Purple, Marker::Ring),
            (Method::Dsos, Ink::Grey, Marker::Cross),
        ];
        let groups = looks.into_iter().map(|(method, ink, marker)| {
            let point = |degree| {
                let (seconds, ratio) = self.median(method, degree)?;
                Some(Point { x: seconds, y: 100.0 * (ratio - 1.0), label: degree.to_string() })
            };
            let points = self.degrees().into_iter().filter_map(point).collect();
            Group { label: method.name().into(), ink, marker, points, joined: true }
        });
        Scatter {
            title: "Fits of degree 2 to 8: medians of five meshes".into(),
            x_label: "time of a fit (s)".into(),
            y_label: "volume beyond the convex hull (%)".into(),
            groups: groups.collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}
