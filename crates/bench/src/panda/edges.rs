//! Straight edges in joint space: candidates of a problem, and what their samples are.

use super::arm::Arm;
use super::states::on_the_way;
use crate::comparison::Random;

/// Samples that checkers take per radian in joint space.
const SAMPLES_PER_RAD: f64 = 32.0;

/// Where edges start, and how long they are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct EdgeKind {
    /// From the goal of the problem, otherwise from anywhere.
    pub(super) from_goal: bool,
    pub(super) length_rad: f64,
    /// Candidates of a problem.
    candidates: usize,
}

/// The kinds that are measured.
pub(super) const KINDS: [EdgeKind; 3] = [
    EdgeKind { from_goal: true, length_rad: 0.5, candidates: 8 },
    EdgeKind { from_goal: false, length_rad: 1.0, candidates: 16 },
    EdgeKind { from_goal: false, length_rad: 5.0, candidates: 60 },
];

/// An edge by its ends, radians.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    /// Position of its kind in [`KINDS`].
    pub(super) kind: usize,
    pub(super) from: Vec<f64>,
    pub(super) to: Vec<f64>,
}

impl EdgeKind {
    /// In tables.
    pub(super) fn from(self) -> &'static str {
        if self.from_goal { "goals" } else { "anywhere" }
    }
}

impl Edge {
    /// Both ends, packed.
    pub(super) fn packed(&self) -> Vec<f64> {
        [&self.from[..], &self.to].concat()
    }

    /// States on the edge as checkers sample it, packed, both ends included.
    pub(super) fn samples(&self) -> Vec<f64> {
        self.evenly(samples(KINDS[self.kind].length_rad))
    }

    /// So many states on the edge, packed.
    pub(super) fn evenly(&self, count: usize) -> Vec<f64> {
        on_the_way(&self.from, &self.to, count)
    }
}

/// Number of samples of an edge of this length, radians, both ends included.
pub(super) fn samples(length_rad: f64) -> usize {
    (SAMPLES_PER_RAD * length_rad) as usize + 1
}

/// Candidates of a problem, kind by kind: towards configurations anywhere, within the limits.
pub(super) fn candidates(arm: &Arm, goal: &[f64], seed: u64) -> Vec<Edge> {
    let mut random = Random(seed);
    let mut edges = Vec::new();
    for (place, kind) in KINDS.iter().enumerate() {
        for _ in 0..kind.candidates {
            let mut anywhere = || arm.within_limits(|| random.positive());
            let from = if kind.from_goal { goal.to_vec() } else { anywhere() };
            let towards = anywhere();
            let length = from.iter().zip(&towards).map(|(a, b)| (b - a) * (b - a)).sum::<f64>().sqrt();
            // Two configurations may be nearer to each other than the edge is long.
            if length > kind.length_rad {
                let part = kind.length_rad / length;
                let to = from.iter().zip(&towards).map(|(a, b)| a + part * (b - a)).collect();
                edges.push(Edge { kind: place, from, to });
            }
        }
    }
    edges
}

#[cfg(test)]
mod tests {
    use sublevel_testkit::data;

    use super::*;

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn candidates_are_as_long_as_their_kind_says() {
        let arm = Arm::read(&data("")).expect("the files of the arm");
        let goal = arm.within_limits(|| 0.5);
        let edges = candidates(&arm, &goal, 1);
        for (place, kind) in KINDS.iter().enumerate() {
            let of_kind: Vec<_> = edges.iter().filter(|edge| edge.kind == place).collect();
            assert!(of_kind.len() * 2 > kind.candidates, "{kind:?}");
            for edge in of_kind {
                let length = edge.from.iter().zip(&edge.to).map(|(a, b)| (b - a).powi(2)).sum::<f64>().sqrt();
                assert!((length - kind.length_rad).abs() < 1e-9);
                assert_eq!(edge.from == goal, kind.from_goal);
                let states = (32.0 * kind.length_rad) as usize + 1;
                assert_eq!(edge.samples().len(), 7 * states);
                assert_eq!(arm.kinematics.check(&edge.to), Ok(()));
            }
        }
    }
}
