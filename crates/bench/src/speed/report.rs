//! The report: what was measured, whether the figures hold, tables, pictures, raw numbers.

use super::Speed;
use super::race::{About, Line, Race, Who};
use crate::blocks::block;
use crate::comparison::parry_version;
use crate::csv::{MEASURED, significant};
use std::fmt::Write;
use sublevel::measure::DEFAULT_ACCURACY;

impl Speed {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let mut text = String::from("# Speed against accuracy\n\n");
        // Writing to a string cannot fail.
        let flags = if self.quick { " --quick" } else { "" };
        let _ = writeln!(text, "{}\n", self.machine.head(&format!("sublevel-bench speed --data DIR{flags}")));
        self.write_builds(&mut text);
        text.push_str("![speed against accuracy](speed.svg)\n\n");
        text += &block("speed.csv", "verdicts", "");
        text.push('\n');
        text += &block("speed.csv", "notes", "");
        for (race, about) in &self.races {
            let Race { name, diameter_m, queries, .. } = race;
            let About { hull_vertices: [a, b], triangles: [c, d], distances_m: [least, middle, most] } = about;
            let _ = writeln!(
                text,
                "\n## {name}\n\nLarger diameter {diameter_m:.3} m; hulls of {a} and {b} vertices, meshes of {c} and {d} triangles; {queries} poses, hulls \
                 {least:.3} to {most:.3} m apart, median {middle:.3}.\n"
            );
            text += &block("speed.csv", name, "");
        }
        text
    }

    fn write_builds(&self, text: &mut String) {
        let coal = self.coal.as_ref().map_or("coal did not take part (SUBLEVEL_COAL is not set)".to_owned(), |version| {
            format!(
                "coal {version} is the wheel from PyPI, a generic build without this machine's vector instructions, at its default tolerance \
                 of 1e-6 m, in processes of its own"
            )
        });
        let _ = writeln!(
            text,
            "Peers: parry3d-f64 {}, built with this program, its GJK ends at 10 roundings; {coal}. Ours: brackets of at most {DEFAULT_ACCURACY:e} \
             of the smaller body, proven. Passes: {}.\n",
            parry_version(),
            self.passes
        );
    }

    /// One line per pair and representation.
    pub fn csv(&self) -> String {
        let mut text = String::from(
            "pair,representation,ours,hull_error_mean,hull_error_max,hull_error_min,mesh_error_mean,mesh_error_max,mesh_error_min,warm_ns,cold_ns,\
             batch_ns,queries,failed,overlaps,wrong,diameter_m\n",
        );
        for (race, _) in &self.races {
            for Line { who, hull, mesh, cold, warm, batch, failed, overlaps, contradictions } in &race.lines {
                let number =
                    |v: f64| if v.is_finite() { format!("{:e}", significant(v, MEASURED)) } else { String::new() };
                let errors = [hull, mesh].map(|e| [e.mean, e.most, e.least].map(number).join(","));
                let times = [*warm, *cold, *batch].map(number).join(",");
                let Race { name, queries, .. } = race;
                let diameter_m = significant(race.diameter_m, MEASURED);
                let ours = matches!(who, Who::Ours(_));
                let _ = writeln!(
                    text,
                    "{name},\"{}\",{ours},{},{},{times},{queries},{failed},{overlaps},{contradictions},{diameter_m}",
                    who.name(),
                    errors[0],
                    errors[1]
                );
            }
        }
        text
    }
}
