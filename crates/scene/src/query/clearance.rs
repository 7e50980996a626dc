//! Pairs within an influence distance, state by state, with gradients.

use sublevel_core::measure::{DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, Pose, WithinMargin, within_margin};

use super::answer::{Answer, Verdict};
use super::ask::{Ask, AskError, Measure, options};
use super::decide::decide;
use super::placed::{Other, Placed, StatesError, with_starts};
use super::solver::{Pair, Solids, Solver};
use super::thing::{PairSlots, Thing};
use crate::crew::{Question, Stop};
use crate::object::Slot;
use crate::scene::Scene;

/// States of a chunk.
const CHUNK: usize = 16;

/// A pair within the influence distance.
#[derive(Clone, Debug)]
pub struct ClearanceRow {
    /// A moving object, then the other one.
    pub pair: [Slot; 2],
    /// Signed distance with its gradients.
    pub answer: Answer,
    /// Padding of the pair, metres.
    pub padding_m: f64,
}

/// The pairs of a state.
#[derive(Clone, Debug, Default)]
pub struct StateClearance {
    /// In the order of names.
    pub rows: Vec<ClearanceRow>,
    /// Whether the poses are usable and all pairs were looked at.
    pub checked: bool,
}

/// For each of many states the pairs whose signed distance less their padding is below an influence
/// distance.
#[derive(Debug)]
pub struct Clearance {
    placed: Placed,
    ask: Ask,
    accuracy: f64,
    influence_m: f64,
    max_pairs: usize,
}

impl Clearance {
    /// States as in [`States::new`](super::States::new); `influence_m` at least 0.
    ///
    /// # Errors
    /// No object, one twice, and numbers that are not whole states.
    pub fn new(
        scene: Scene,
        slots: &[Slot],
        poses: Vec<f64>,
        influence_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        let placed = Placed::new(scene, slots, poses, include_allowed)?;
        let Ok(mut ask) = Ask::new(vec![Measure::Signed]) else { return Err(StatesError::NoObject) };
        ask.gradients = true;
        Ok(Self { placed, ask, accuracy: DEFAULT_ACCURACY, influence_m, max_pairs: usize::MAX })
    }

    /// Another accuracy, relative.
    ///
    /// # Errors
    /// A number that is none.
    pub fn with_accuracy(mut self, accuracy: f64) -> Result<Self, AskError> {
        let gradients = self.ask.gradients;
        self.ask = self.ask.with_accuracy(accuracy)?;
        self.ask.gradients = gradients;
        self.accuracy = accuracy;
        Ok(self)
    }

    /// At most so many pairs a state, the nearest.
    pub fn with_max_pairs(mut self, max_pairs: usize) -> Self {
        self.max_pairs = max_pairs;
        self
    }

    /// Without gradients.
    pub fn without_gradients(mut self) -> Self {
        self.ask.gradients = false;
        self
    }

    /// Uses no earlier answers as starts.
    pub fn cold(mut self) -> Self {
        self.ask.cold = true;
        self
    }

    /// Number of states.
    pub fn states(&self) -> usize {
        self.placed.states()
    }

    fn state(&self, state: usize, solver: &Solver<'_>, poses: &mut Vec<Pose>) -> StateClearance {
        if solver.stop.is_set() || self.placed.poses(state, poses).is_none() {
            return StateClearance::default();
        }
        let mut rows = Vec::new();
        self.placed.visit(poses, self.influence_m, |index, other, threshold| {
            let (slot, a) = self.placed.moving(index, poses);
            let other = match other {
                Other::Moving(other) => Some(self.placed.moving(other, poses)),
                Other::Standing(other) => self.placed.standing(other).map(|thing| (other, thing)),
            };
            let Some((other, b)) = other else { return true };
            let pair = Pair { a, b, slots: Some(PairSlots { a: slot, b: other }) };
            if let Some(answer) = self.within(solver, &pair, threshold) {
                rows.push(ClearanceRow { pair: [slot, other], answer, padding_m: threshold - self.influence_m });
            }
            !solver.stop.is_set()
        });
        let ranks = &self.placed.scene().structure.ranks;
        let rank = |row: &ClearanceRow| row.pair.map(|slot| ranks[slot as usize]);
        if rows.len() > self.max_pairs {
            let clearance = |row: &ClearanceRow| row.answer.lower - row.padding_m;
            rows.sort_by(|a, b| clearance(a).total_cmp(&clearance(b)).then(rank(a).cmp(&rank(b))));
            rows.truncate(self.max_pairs);
        }
        rows.sort_by_key(rank);
        StateClearance { rows, checked: !solver.stop.is_set() }
    }

    /// The signed distance unless it is beyond the threshold.
    fn within(&self, solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64) -> Option<Answer> {
        let options = options(self.accuracy, self.accuracy.max(DEFAULT_DEPTH_ACCURACY), solver.stop);
        // The search for the distance that decides is the answer, too, where the two are apart.
        if let (
            Thing::Solid { rungs: rungs_a, pose: pose_a, outer: false },
            Thing::Solid { rungs: rungs_b, pose: pose_b, outer: false },
        ) = (&pair.a, &pair.b)
            && let ([a], [b]) = (rungs_a, rungs_b)
            && threshold >= 0.0
        {
            if pair.a.box_gap_m(&pair.b) > threshold {
                return None;
            }
            let found = solver.warm(pair.slots, [0; 2], Measure::Distance, |warm| {
                within_margin(&**a, pose_a, &**b, pose_b, threshold, &options, warm)
            });
            match found {
                Ok(WithinMargin::Beyond { .. }) => return None,
                Ok(WithinMargin::Within(found)) if found.lower > 0.0 => {
                    return Some(solver.distance(&found, &Solids { a, pose_a, b, pose_b }));
                }
                _ => return Some(solver.measure(0, pair)),
            }
        }
        let found = decide(solver, pair, threshold, options);
        (found.verdict != Verdict::No).then(|| solver.measure(0, pair))
    }
}

impl Question for Clearance {
    type Part = Vec<StateClearance>;

    fn chunks(&self) -> usize {
        self.placed.states().div_ceil(CHUNK)
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> Vec<StateClearance> {
        with_starts(|starts| {
            let cache = (!self.ask.cold).then_some(starts);
            let solver = Solver { ask: &self.ask, cache, stop };
            let mut poses = Vec::new();
            let states = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.placed.states());
            states.map(|state| self.state(state, &solver, &mut poses)).collect()
        })
    }
}
