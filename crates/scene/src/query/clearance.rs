//! Pairs within an influence distance, state by state, with nearest points and gradients.

use std::collections::BTreeMap;

use sublevel_core::body::Shape;
use sublevel_core::measure::{
    Capsule, CapsuleDistance, DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, Distance, Options, Pose, WithinMargin,
    distance_batch, distance_to_capsule_batch, is_capsule_solved_in_lanes, is_solved_in_lanes, within_margin,
};

use super::answer::{Answer, Verdict};
use super::ask::{Ask, AskError, Measure, options};
use super::decide::decide;
use super::invalid_state::InvalidState;
use super::packed::State;
use super::placed::{Candidate, JointValues, Other, Placed, with_starts};
use super::solver::{Pair, Solids, Solver};
use super::states_error::StatesError;
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
    /// Signed distance with its witnesses and gradients.
    pub answer: Answer,
    /// Padding of the pair, metres.
    pub padding_m: f64,
}

/// The pairs of a state.
#[derive(Clone, Debug, Default)]
pub struct StateClearance {
    /// In the order of names.
    pub rows: Vec<ClearanceRow>,
    /// Whether the poses or joint values are usable and all pairs were looked at.
    pub checked: bool,
    /// Of states of a robot with gradients: for every row in turn the derivatives of the signed
    /// distance with respect to the values of the state, metres per unit of each; NaN where there
    /// are none.
    pub joint_gradients: Vec<f64>,
    /// Why the poses or joint values are not usable, if they are not.
    pub invalid: Option<Box<InvalidState>>,
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
        Self::of(Placed::new(scene, slots, poses, include_allowed)?, influence_m)
    }

    /// States of a robot as in [`States::of_joints`](super::States::of_joints); `influence_m` at
    /// least 0.
    ///
    /// # Errors
    /// A robot or a joint that is not there, a joint twice, and numbers that are not whole states.
    pub fn of_joints(
        scene: Scene,
        asked: JointValues<'_>,
        influence_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        Self::of(Placed::of_joints(scene, asked, include_allowed)?, influence_m)
    }

    fn of(placed: Placed, influence_m: f64) -> Result<Self, StatesError> {
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

    /// Number of values in a row of [`StateClearance::joint_gradients`]; none of states that are
    /// poses.
    pub fn joint_width(&self) -> Option<usize> {
        Some(self.placed.joints()?.width())
    }

    /// What is near in a state, in no order; pairs that may be near in other states of the chunk,
    /// too, go to the batches.
    fn look(
        &self,
        state: usize,
        (solver, at): (&Solver<'_>, &mut State),
        (place, batches): (usize, &mut Batches),
    ) -> StateClearance {
        if solver.stop.is_set() {
            return StateClearance::default();
        }
        if let Err(invalid) = self.placed.place(state, at) {
            return StateClearance { invalid: Some(Box::new(invalid)), ..StateClearance::default() };
        }
        let mut rows = Vec::new();
        self.placed.visit(at, self.influence_m, |Candidate { index, other, threshold, slack_m }| {
            let (slot, a) = self.placed.moving(index, at);
            let thing = match other {
                Other::Moving(other) => Some(self.placed.moving(other, at)),
                Other::Standing(other) => self.placed.standing(other).map(|thing| (other, thing)),
            };
            let Some((other_slot, b)) = thing else { return true };
            // Distances say nothing below 0; signed ones of capsules are asked for one by one
            // there.
            let stands = matches!(other, Other::Standing(_));
            if stands && threshold >= 0.0 && LanePair::of(&a, &b).is_some() {
                batches.push((index, other_slot), Near { place, pose: at.poses[index], threshold, slack_m });
                return true;
            }
            let pair = Pair { a, b, slots: Some(PairSlots { a: slot, b: other_slot }) };
            if let Some(answer) = self.within(solver, &pair, threshold + slack_m) {
                rows.push(self.row([slot, other_slot], answer, (threshold, slack_m)));
            }
            !solver.stop.is_set()
        });
        StateClearance { rows, checked: !solver.stop.is_set(), ..StateClearance::default() }
    }

    fn row(&self, pair: [Slot; 2], answer: Answer, (threshold, slack_m): (f64, f64)) -> ClearanceRow {
        ClearanceRow { pair, answer: answer.widened(slack_m), padding_m: threshold - self.influence_m }
    }

    /// Fills in the gradients with respect to joint values.
    fn fill_joint_gradients(&self, at: &mut State, index: usize, found: &mut StateClearance) {
        let Some(joints) = self.placed.joints().filter(|_| self.ask.gradients && !found.rows.is_empty()) else {
            return;
        };
        if self.placed.place(index, at).is_err() {
            return;
        }
        let (width, mut all) = (joints.width(), Vec::new());
        found.joint_gradients.resize(found.rows.len() * width, 0.0);
        for (row, values) in found.rows.iter().zip(found.joint_gradients.chunks_mut(width)) {
            let Some(gradients) = &row.answer.gradients else {
                values.fill(f64::NAN);
                continue;
            };
            let twists = row.pair.iter().zip(gradients).filter_map(|(slot, twist)| {
                let (index, moving) = self.placed.find(*slot)?;
                Some((moving, &at.poses[index], twist))
            });
            joints.add_gradients(at, twists, &mut all, values);
        }
    }

    /// Measures a moving body where it stands in several states against one that stands still.
    fn measure_batch(
        &self,
        solver: &Solver<'_>,
        ((index, other), near): ((usize, Slot), &[Near]),
        states: &mut [StateClearance],
    ) {
        let poses: Vec<Pose> = near.iter().map(|near| near.pose).collect();
        let (Some(standing), Some(first)) = (self.placed.standing(other), poses.first()) else { return };
        let (slot, moving) = self.placed.moving_at(index, first);
        let (Some(lanes), Some(pose_b)) = (LanePair::of(&moving, &standing), standing.pose()) else { return };
        let Some(found) = lanes.measure(&poses, pose_b, &self.options(solver)) else { return };
        for (i, Near { place, pose, threshold, slack_m }) in near.iter().enumerate() {
            let state = &mut states[*place];
            if found.lower(i) > threshold + slack_m {
                continue;
            }
            let answer = match &found {
                LaneAnswers::Solids { of: [a, b], found } if found[i].lower > 0.0 => {
                    solver.distance(&found[i], &Solids { a: b, pose_a: pose_b, b: a, pose_b: pose }).swapped()
                }
                LaneAnswers::Solids { .. } => {
                    let (_, moving) = self.placed.moving_at(index, pose);
                    solver.measure(0, &Pair { a: moving, b: standing, slots: Some(PairSlots { a: slot, b: other }) })
                }
                LaneAnswers::Capsules(found) => {
                    let (_, moving) = self.placed.moving_at(index, pose);
                    let pair = Pair { a: moving, b: standing, slots: None };
                    solver.signed_capsule(&pair, &found[i])
                }
            };
            state.checked &= !solver.stop.is_set();
            state.rows.push(self.row([slot, other], answer, (*threshold, *slack_m)));
        }
    }

    /// The nearest pairs of a state, in the order of names.
    fn order(&self, rows: &mut Vec<ClearanceRow>) {
        let ranks = &self.placed.scene().structure.ranks;
        let rank = |row: &ClearanceRow| row.pair.map(|slot| ranks[slot as usize]);
        if rows.len() > self.max_pairs {
            let clearance = |row: &ClearanceRow| row.answer.lower - row.padding_m;
            rows.sort_by(|a, b| clearance(a).total_cmp(&clearance(b)).then(rank(a).cmp(&rank(b))));
            rows.truncate(self.max_pairs);
        }
        rows.sort_by_key(rank);
    }

    fn options<'a>(&self, solver: &Solver<'a>) -> Options<'a> {
        options(self.accuracy, self.accuracy.max(DEFAULT_DEPTH_ACCURACY), solver.stop)
    }

    /// The signed distance unless it is beyond the threshold.
    fn within(&self, solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64) -> Option<Answer> {
        let options = self.options(solver);
        // The search for the distance that decides is the answer, too, where the two are apart.
        if let (
            Thing::Solid { rungs: rungs_a, pose: pose_a, set: None },
            Thing::Solid { rungs: rungs_b, pose: pose_b, set: None },
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
        // So is that of a capsule, however deep.
        if pair.has_capsule() && threshold >= 0.0 {
            if pair.a.box_gap_m(&pair.b) > threshold {
                return None;
            }
            let found = solver.capsule_within(pair, threshold, &options)?;
            return Some(solver.answer_of_capsule(Measure::Signed, pair, &found));
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
            let (mut at, mut batches) = (State::default(), Batches::default());
            let indices = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.placed.states());
            let look = |(place, state)| self.look(state, (&solver, &mut at), (place, &mut batches));
            let mut states: Vec<StateClearance> = indices.clone().enumerate().map(look).collect();
            for (pair, near) in &batches.0 {
                self.measure_batch(&solver, (*pair, near), &mut states);
            }
            for (index, state) in indices.zip(&mut states) {
                self.order(&mut state.rows);
                self.fill_joint_gradients(&mut at, index, state);
            }
            states
        })
    }
}

/// Pairs of a moving body, by its position, and one that stands still, with the states of a chunk
/// in which they may be near: pairs of which several poses are measured at a time.
#[derive(Debug, Default)]
struct Batches(BTreeMap<(usize, Slot), Vec<Near>>);

/// A state in which a pair may be near.
#[derive(Debug)]
struct Near {
    /// Position of the state in its chunk.
    place: usize,
    /// World pose of the moving body.
    pose: Pose,
    threshold: f64,
    slack_m: f64,
}

impl Batches {
    fn push(&mut self, pair: (usize, Slot), near: Near) {
        self.0.entry(pair).or_default().push(near);
    }
}

/// A moving thing and one that stands still, of which several poses are measured at a time.
enum LanePair<'a> {
    /// Two bodies.
    Solids([&'a Shape; 2]),
    /// A body and a capsule, and whether that is the one that moves.
    Capsule { body: &'a Shape, capsule: &'a Capsule, moves: bool },
}

impl<'a> LanePair<'a> {
    fn of(moving: &Thing<'a>, standing: &Thing<'a>) -> Option<Self> {
        match (single(moving), single(standing)) {
            (Some(a), Some(b)) => is_solved_in_lanes(a, b).then_some(Self::Solids([a, b])),
            (Some(body), None) => Self::of_capsule(body, standing, false),
            (None, Some(body)) => Self::of_capsule(body, moving, true),
            (None, None) => None,
        }
    }

    fn of_capsule(body: &'a Shape, other: &Thing<'a>, moves: bool) -> Option<Self> {
        let Thing::Capsule { capsule, .. } = other else { return None };
        is_capsule_solved_in_lanes(body, capsule).then_some(Self::Capsule { body, capsule, moves })
    }

    /// Measured with the moving one at these poses and the other one at this.
    fn measure(self, moving: &[Pose], standing: &Pose, options: &Options<'_>) -> Option<LaneAnswers<'a>> {
        match self {
            Self::Solids([a, b]) => {
                let mut found = vec![Distance::default(); moving.len()];
                distance_batch(b, standing, a, moving, options, &mut found).ok()?;
                Some(LaneAnswers::Solids { of: [a, b], found })
            }
            Self::Capsule { body, capsule, moves } => {
                let mut found = vec![CapsuleDistance::default(); moving.len()];
                let standing = std::slice::from_ref(standing);
                let (of_body, of_capsule) = if moves { (standing, moving) } else { (moving, standing) };
                distance_to_capsule_batch(body, of_body, capsule, of_capsule, options, &mut found).ok()?;
                Some(LaneAnswers::Capsules(found))
            }
        }
    }
}

/// What is found of such a pair, pose by pose.
enum LaneAnswers<'a> {
    /// Distances of the standing body from the moving one.
    Solids { of: [&'a Shape; 2], found: Vec<Distance> },
    /// Signed distances of a body from a capsule.
    Capsules(Vec<CapsuleDistance>),
}

impl LaneAnswers<'_> {
    /// Lower bound at a pose, metres.
    fn lower(&self, pose: usize) -> f64 {
        match self {
            Self::Solids { found, .. } => found[pose].lower,
            Self::Capsules(found) => found[pose].lower,
        }
    }
}

/// The body of a thing that is a single one.
fn single<'a>(thing: &Thing<'a>) -> Option<&'a Shape> {
    match thing {
        Thing::Solid { rungs: [solid], set: None, .. } => match &**solid {
            Shape::Body(_) => Some(solid),
            Shape::Compound(_) => None,
        },
        _ => None,
    }
}
