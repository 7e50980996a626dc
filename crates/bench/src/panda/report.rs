//! The report, the CSV and the JSON.

use serde::Serialize;

use super::rows::{LinkRow, MeshRow, MotionRow, SrdfRow, StateRow, Tables};
use super::summary::{Figure, summary};
use super::{Machine, Panda, Representation, csv};
use crate::blocks::block;

const CSV: &str = "panda.csv";

impl Panda {
    /// The report, but for what `Shown` writes into its blocks.
    pub fn markdown(&self) -> String {
        let flags = if self.quick { " --quick" } else { "" };
        let command = format!("sublevel-bench panda --data DIR{flags}");
        let head = self.machine.head_with(&command, "of which one is used where nothing else is said");
        let coal = match &self.coal {
            Some(version) => format!(
                "Coal {version} is timed by a program of its own, in turns with ours, in double precision on one thread."
            ),
            None => "Coal took no part: `SUBLEVEL_COAL_PANDA` did not name the program that times it.".into(),
        };
        let block = |name: &str| block(CSV, name, "");
        let [summary, states, families, links] = ["summary", "states", "families", "links"].map(block);
        let [meshes, srdf] = ["meshes", "srdf"].map(block);
        let [motions, proofs, of_families] = ["motions", "proofs", "motions of families"].map(block);
        format!(
            "# A planner's workload\n\n{head}\n\n\
             A Franka Emika Panda (7 joints, 11 links with geometry) among the boxes and cylinders of planning problems in \
             several families. Obstacles are exact; links are what the rows say. {coal}\n\n\
             ## In short\n\n{summary}\n\
             ## States\n\n\
             Starts and goals of the problems are known to be free: *kept* are those that a representation proves free among \
             the obstacles. The base link does not move and counts against the other links only, for coal as well. Times are \
             those of 25 states of each problem: start, goal, 20 on the straight way between them, 3 anywhere. A state ends at \
             its first contact. Ours begin with joint values: kinematics and their rounding are included, and so is making the \
             question; with *poses given* the poses of the links that move are computed before the clock starts. Coal gets \
             the poses of its hulls, looks at pairs whose bounding spheres meet, and knows no self-collision; `cold` is \
             without hints or cached guesses. *Distances* are those of all pairs of a moving link and an obstacle, accurate to 1e-6, \
             in the states that the default proves free. *Missed* are states anywhere that are \
             proven free while the convex hull of a link touches: the spheres leave parts of the links out, and two parts need \
             not fill the hull of a link. The last two columns are states with self-collision in batches of 1 000 on all \
             cores, of the first problem of each family.\n\n{states}\n\
             ![time of a state against states kept](panda-states.svg)\n\n\
             ### Meshes\n\n\
             The same states anywhere against the meshes of the links, as they are in the files: triangles that are proven to \
             intersect those of an obstacle (a prism inside a cylinder) or of another link, and corners inside an obstacle. \
             What a representation proves free of obstacles, or of these and of other links, must have none.\n\n{meshes}\n\
             ### By family\n\nKnown-free states kept, and µs per state among the obstacles.\n\n{families}\n\
             ![time of a state against states kept, family by family](panda-families.svg)\n\n\
             ### Links\n\nConvex parts, their largest degree, and how far they reach at most beyond the hull of the link, or of the \
             part of it that they are fitted to. *{}* is what `sublevel robot` makes where no other gap and no degree are asked \
             for.\n\n{links}\n\
             ### The SRDF\n\n\
             Whether each pair of links can touch at all within the joint limits, by branch and bound over the joint values \
             (`sublevel robot --pairs`), beside what the SRDF says; one core. *Wrong* are pairs that the SRDF leaves out and whose bodies \
             overlap by more than their gaps, so that the hulls of the links touch.\n\n{srdf}\n\
             ## Motions\n\n\
             Straight edges in joint space towards configurations anywhere, with self-collision; of each problem the first \
             candidate that a representation proves free. A proof holds for the whole edge. Beside it the states that a \
             checker would sample on the same edge at 1/32 rad: ours with self-collision and kinematics, coal's on the edges \
             of the default, with neither. Ladders prove motions by their finest bodies, those of degree 6.\n\n{motions}\n\
             ![time of a radian against states kept](panda-motions.svg)\n\n\
             ### Proofs\n\n\
             Percentiles are over the edges of all families. A state check is one with self-collision of the same \
             representation, as in the first table, where many states are in contact; a check of a sample is one of a state \
             on the same edges, which is free. Afterwards the edges are sampled densely: a proof that is right leaves no sample in contact.\n\n\
             {proofs}\n\
             ### By family\n\nµs per radian that is proven.\n\n{of_families}",
            Representation::Default.name()
        )
    }

    /// The tables, an empty line between them.
    pub fn csv(&self) -> String {
        csv::written(&self.tables)
    }

    /// One JSON object with everything; null where something is not measured.
    ///
    /// # Errors
    /// None that plain numbers can have.
    pub fn json(&self) -> Result<String, serde_json::Error> {
        #[derive(Serialize)]
        struct All<'a> {
            machine: &'a Machine,
            quick: bool,
            summary: Vec<Figure>,
            states: &'a [StateRow],
            motions: &'a [MotionRow],
            links: &'a [LinkRow],
            meshes: &'a [MeshRow],
            srdf: &'a [SrdfRow],
        }
        let Tables { states, motions, links, meshes, srdf } = &self.tables;
        let (machine, quick, summary) = (&self.machine, self.quick, summary(&self.tables));
        serde_json::to_string(&All { machine, quick, summary, states, motions, links, meshes, srdf })
    }
}
