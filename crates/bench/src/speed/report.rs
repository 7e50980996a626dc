//! The report: what was measured, whether the figures hold, tables, pictures, raw numbers.

use super::Speed;
use super::race::{About, Line, Race, Who};
use crate::blocks::block;
use crate::comparison::parry_version;
use std::fmt::Write;
use sublevel::measure::DEFAULT_ACCURACY;

/// How to read the tables.
pub(super) const NOTES: &str = "\
How to read this:

- Model error: distance of the convex hulls (parry's GJK on all their vertices) less the distance that a representation answers, \
relative to the larger diameter of the pair; so a thousandth is a millimetre for an object of 1 m. Where a representation overlaps although \
the hulls do not, less minus its depth. `mesh` is the same against the distance of the triangle meshes.
- Compounds and covers of balls contain the mesh, not its hull: they stand in the charts against meshes only.
- Smooth motions of steps of 0.5 % of the larger diameter and one degree about each other; bodies of degree 2 and up stay apart, the closest of \
them mostly by 2.5 to 37 % of the larger diameter. Seeds 1, 2, ... of SplitMix64, those that come too close left out. Everybody walks the same \
poses; rows take turns; in a turn each motion is walked nine times on end (once if a query takes more than 5 µs), as coal's program does it, and the median counts, then the median of the \
turns; one thread. Parry's meshes are asked at a few of the poses only.
- warm: with the hint from the pose before (ours, coal's cached guess, parry's initial direction). batch: all poses of a motion in one call, each \
solved cold. Peers have no batch and stand with the faster of their two times there.
- Hulls of n vertices are intersections of half-spaces that touch the hull, chosen one by one to cut off what stands out farthest: they contain \
the hull like our bodies do. An object whose hull has no more vertices keeps it. Where \
they overlap they answer 0, so that the coarsest look a little better than they are.
- wrong: queries in which brackets of ours exclude each other or the truth, or in which coal and parry differ by more than 1e-5 of the \
diameter.
";

impl Speed {
    /// The report, but for what [`Shown`](super::Shown) writes into its blocks.
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
                let number = |v: f64| if v.is_finite() { format!("{v:e}") } else { String::new() };
                let errors = [hull, mesh].map(|e| [e.mean, e.most, e.least].map(number).join(","));
                let times = [*warm, *cold, *batch].map(number).join(",");
                let Race { name, queries, diameter_m, .. } = race;
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
