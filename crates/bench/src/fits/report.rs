//! The report and the CSV.

use std::fmt::Write;

use super::Fits;
use super::fitting::Fitting;
use crate::blocks::block;

impl Fits {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let flags = if self.quick { " --quick" } else { "" };
        let head = self.machine.head(&format!("sublevel-bench fits --data DIR{flags}"));
        let medians = block("fits.csv", "medians", "");
        let agreement = block("fits.csv", "agreement", "");
        let all = block("fits.csv", "all", "");
        format!(
            "# Fits: time against volume\n\n{head}\n\n\
             Five meshes of the Princeton Mesh Segmentation Benchmark, each fitted whole: reading apart, hull, program, certificate, \
             proofs and gap. A time is the median of five runs, or one run where that takes over three seconds. `structured` and \
             `clarabel` solve the same program, the largest log det of P; `refined` goes on from its optimum to the least volume; \
             `sdsos` and `dsos` minimise the volume over smaller cones.\n\n\
             ## Medians of the five meshes\n\n{medians}\n\
             ## Both solvers beside each other\n\n{agreement}\n\
             ## All fits\n\n{all}"
        )
    }

    /// A row for each fit.
    pub fn csv(&self) -> String {
        let mut text =
            String::from("mesh,hull_vertices,method,degree,seconds,volume_over_hull,objective,gap,rounds,iterations\n");
        for fitting in &self.fittings {
            let Fitting { mesh, vertices, method, degree, seconds, ratio, rounds, iterations, .. } = fitting;
            let [objective, gap] =
                [fitting.objective, fitting.gap].map(|value| value.map(|value| value.to_string()).unwrap_or_default());
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{mesh},{vertices},{method},{degree},{seconds},{ratio},{objective},{gap},{rounds},{iterations}"
            );
        }
        text
    }
}
