//! The report and the CSV.

use std::fmt::Write;

use super::Pairs;
use super::race::Time;
use crate::blocks::block;

impl Pairs {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let flags = if self.quick { " --quick" } else { "" };
        let head = self.machine.head(&format!("sublevel-bench pairs --data DIR{flags}"));
        let coal =
            self.coal.as_ref().map_or("coal did not take part (SUBLEVEL_COAL is not set)".to_owned(), |version| {
                format!("coal {version}")
            });
        let names = ["cold", "warm", "near", "near-distance", "apart", "coal", "parry", "agreement"];
        let [cold, warm, near, near_distance, apart, against_coal, against_parry, agreement] =
            names.map(|name| block("pairs.csv", name, ""));
        format!(
            "# Pairs by type\n\n{head}\nPeers: {coal}, parry3d-f64 {}.\n\n\
             Shapes of every kind about the chair (first) and the human (second) of the Princeton Mesh Segmentation Benchmark: \
             the smallest ball, fitted bodies of degree 2 (ellipsoids) to 8, bodies of degree 6 that six slabs cut, and a box, \
             a cylinder and a capsule of about the size of the object; and half-spaces: the others turn above them, as far \
             away as about the smallest ball of the human, and the decision of a capsule there is the sign of its distance. Two capsules, \
             and a capsule above a half-space, have no use for a hint. Each pair has walks of its own in steps of a centimetre \
             and a degree, for objects of two metres, mostly 5 to 75 cm apart. A time is the median of five turns, in each of \
             which everybody walks the same poses nine times. Brackets are proven to 1e-9 of the smaller body.\n\n\
             ## Distance, from nothing but the poses (ns)\n\n{cold}\n\
             ## Distance, with a hint from the pose before (ns)\n\n{warm}\n\
             ## Overlap or not, near contact (ns)\n\nThe same poses, moved along the normal to between a centimetre apart and \
             8 mm deep, none of them in contact; nothing known before.\n\n{near}\n\
             ## Distance, near contact (ns)\n\nAt the poses of those decisions, from nothing but the poses, too; in brackets the time of the \
             decision in parts of it.\n\n{near_distance}\n\
             ## Overlap or not, apart (ns)\n\n{apart}\n\
             ## Beside coal\n\nTime of a distance in parts of that of coal for the same pair, without a guess and with the one from the pose \
             before. Coal takes balls, boxes, cylinders and capsules as they are, and the convex hull of the object for the rest; its program knows no half-spaces.\n\n\
             {against_coal}\n\
             ## Beside parry\n\nTime of a distance and of a decision, apart, in parts of that of parry, which keeps nothing from pose to \
             pose.\n\n{against_parry}\n\
             {agreement}",
            self.parry
        )
    }

    /// A row for each pair, library and question.
    pub fn csv(&self) -> String {
        let mut text = String::from("a,b,who,question,ns,queries,failed,differs_m\n");
        for Time { kinds: [a, b], who, question, nanoseconds, queries, failed, differs_m } in &self.times {
            let differs = differs_m.map(|differs| format!("{differs:.3e}")).unwrap_or_default();
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "{},{},{},{},{nanoseconds:.2},{queries},{failed},{differs}",
                a.name(),
                b.name(),
                who.name(),
                question.name()
            );
        }
        text
    }
}
