//! Which states of a problem are asked for.

use std::error::Error;

use super::arm::Arm;
use super::problems::Problem;
use crate::comparison::Random;

/// States on the straight way from start to goal.
const ON_THE_WAY: usize = 20;
/// States anywhere, of those that are timed.
const ANYWHERE: usize = 3;

/// States of a problem, packed joint values, radians.
pub(super) struct ProblemStates {
    /// Start and goal, which are known to be free.
    pub(super) ends: Vec<f64>,
    /// What is timed: start, goal, states on the straight way between them, and some anywhere.
    pub(super) timed: Vec<f64>,
    /// Those of the timed states that are known to be free; none at first.
    pub(super) free: Vec<f64>,
    /// States anywhere.
    pub(super) random: Vec<f64>,
}

impl ProblemStates {
    /// The states of a problem; the same for the same seed.
    pub(super) fn new(arm: &Arm, problem: &Problem, random: usize, seed: u64) -> Result<Self, Box<dyn Error>> {
        let [start, goal] = problem.ends(&arm.kinematics)?;
        let mut draws = Random(seed);
        let mut anywhere =
            |count: usize| -> Vec<f64> { (0..count).flat_map(|_| arm.within_limits(|| draws.positive())).collect() };
        let ends = [&start[..], &goal].concat();
        let timed = [ends.clone(), on_the_way(&start, &goal, ON_THE_WAY), anywhere(ANYWHERE)].concat();
        Ok(Self { ends, timed, free: Vec::new(), random: anywhere(random) })
    }
}

/// So many configurations, at least two, evenly from the first to the last.
pub(super) fn on_the_way(from: &[f64], to: &[f64], count: usize) -> Vec<f64> {
    let part = |index: usize| index as f64 / (count as f64 - 1.0);
    (0..count).flat_map(|index| from.iter().zip(to).map(move |(a, b)| a + part(index) * (b - a))).collect()
}

/// Those states of a packed list that are marked.
pub(super) fn marked(states: &[f64], width: usize, marks: &[bool]) -> Vec<f64> {
    states.chunks_exact(width).zip(marks).filter(|(_, mark)| **mark).flat_map(|(state, _)| state.to_vec()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_has_both_ends() {
        assert_eq!(on_the_way(&[0.0, 1.0], &[1.0, 3.0], 3), [0.0, 1.0, 0.5, 2.0, 1.0, 3.0]);
        assert_eq!(marked(&[0.0, 1.0, 2.0, 3.0], 2, &[false, true]), [2.0, 3.0]);
    }
}
