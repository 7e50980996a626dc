//! Contact in many states.

use std::sync::atomic::{AtomicUsize, Ordering};

use sublevel_core::measure::DEFAULT_DEPTH_ACCURACY;

use super::answer::Verdict;
use super::ask::{Ask, AskError, Measure, check_accuracy, options};
use super::certain::decide_within;
use super::decide::{Bracket, decide};
use super::invalid_state::InvalidState;
use super::packed::State;
use super::placed::{Candidate, JointValues, Other, Placed, with_starts};
use super::solver::{Pair, Solver};
use super::states_error::StatesError;
use super::thing::{PairSlots, Thing};
use crate::crew::{Question, Stop};
use crate::geometry::Geometry;
use crate::object::{Object, Slot};
use crate::scene::Scene;

/// What a state is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StateVerdict {
    /// No pair is in contact: proven.
    Free,
    /// A pair is in contact: proven for the finest bodies.
    Contact,
    /// Neither is proven.
    Undecided,
    /// A pose is none, or a joint value is not finite or outside its limits; the answer says which.
    Invalid,
    /// The question ended before.
    NotChecked,
}

/// Whether contact of bodies is one of the objects inside.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Certainty {
    /// No contact.
    None,
    /// The bodies are exact.
    Certain,
    /// Within the gaps of the bodies.
    Possible,
}

/// What is known of a state.
#[derive(Clone, Debug)]
pub struct StateAnswer {
    /// What it is.
    pub verdict: StateVerdict,
    /// About the objects inside the bodies.
    pub certainty: Certainty,
    /// The pair that decided, or the worst one, the moving object first.
    pub pair: Option<[Slot; 2]>,
    /// Its signed distance is at least this, metres; NaN without a pair.
    pub lower_m: f64,
    /// Its signed distance is at most this, metres; NaN without a pair.
    pub upper_m: f64,
    /// Pairs that had to be solved.
    pub solved: u32,
    /// Why it is invalid, if it is.
    pub invalid: Option<Box<InvalidState>>,
}

impl StateAnswer {
    fn without(verdict: StateVerdict) -> Self {
        let (lower_m, upper_m) = (f64::NAN, f64::NAN);
        Self { verdict, certainty: Certainty::None, pair: None, lower_m, upper_m, solved: 0, invalid: None }
    }
}

/// States of a chunk: enough for the starts of one to serve the next.
const CHUNK: usize = 16;

/// Whether anything is in contact, in each of many states.
#[derive(Debug)]
pub struct States {
    placed: Placed,
    ask: Ask,
    accuracy: f64,
    margin_m: f64,
    worst: bool,
    /// The first state in order that is known not to be free; states after it are not looked at.
    first_bad: AtomicUsize,
    stop_at_first: bool,
}

impl States {
    /// States of some objects as packed poses, 7 numbers each (translation in metres, quaternion x
    /// y z w), state after state; in contact below `margin_m`, at least 0, and the padding.
    ///
    /// # Errors
    /// No object, one twice, and numbers that are not whole states.
    pub fn new(
        scene: Scene,
        slots: &[Slot],
        poses: Vec<f64>,
        margin_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        Self::of(Placed::new(scene, slots, poses, include_allowed)?, margin_m)
    }

    /// States of a robot as packed values of joints, state after state: of those named, in their
    /// order, or of all that follow no other one; what is not named is as in the scene. The links
    /// and what is attached to them are checked against each other and against everything else.
    /// What is proven holds for exact arithmetic on these values: the rounding of the kinematics is
    /// counted.
    ///
    /// # Errors
    /// A robot or a joint that is not there, a joint twice, and numbers that are not whole states.
    pub fn of_joints(
        scene: Scene,
        asked: JointValues<'_>,
        margin_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        Self::of(Placed::of_joints(scene, asked, include_allowed)?, margin_m)
    }

    fn of(placed: Placed, margin_m: f64) -> Result<Self, StatesError> {
        let Ok(ask) = Ask::new(vec![Measure::Signed]) else { return Err(StatesError::NoObject) };
        Ok(Self {
            placed,
            ask,
            accuracy: DEFAULT_STATE_ACCURACY,
            margin_m,
            worst: false,
            first_bad: AtomicUsize::new(usize::MAX),
            stop_at_first: false,
        })
    }

    /// Looks for the worst pair of every state, with brackets of a relative width.
    ///
    /// # Errors
    /// An accuracy that is none.
    pub fn with_worst_pair(mut self, accuracy: Option<f64>) -> Result<Self, AskError> {
        self.accuracy = accuracy.unwrap_or(DEFAULT_STATE_ACCURACY);
        check_accuracy(self.accuracy)?;
        self.worst = true;
        Ok(self)
    }

    /// Ends at the first state, in order, that is not free.
    pub fn stopping_at_first(mut self) -> Self {
        self.stop_at_first = true;
        self
    }

    /// Uses no earlier answers as starts.
    pub fn cold(mut self) -> Self {
        self.ask.cold = true;
        self
    }

    /// Number of states.
    pub fn len(&self) -> usize {
        self.placed.states()
    }

    /// Whether there are no states; there always are.
    pub fn is_empty(&self) -> bool {
        false
    }

    fn check(
        &self,
        state: usize,
        (solver, place): (&Solver<'_>, &mut State),
        last: &mut Option<Candidate>,
    ) -> StateAnswer {
        if self.stop_at_first && self.first_bad.load(Ordering::Relaxed) < state || solver.stop.is_set() {
            return StateAnswer::without(StateVerdict::NotChecked);
        }
        if let Err(invalid) = self.placed.place(state, place) {
            return StateAnswer { invalid: Some(Box::new(invalid)), ..StateAnswer::without(StateVerdict::Invalid) };
        }
        let answer = if self.worst { self.worst_pair(solver, place) } else { self.first_contact(solver, place, last) };
        if solver.stop.is_set() && answer.verdict != StateVerdict::Contact {
            return StateAnswer { solved: answer.solved, ..StateAnswer::without(StateVerdict::NotChecked) };
        }
        answer
    }

    /// What touched in the state before comes first: it often still does.
    fn first_contact(&self, solver: &Solver<'_>, state: &State, last: &mut Option<Candidate>) -> StateAnswer {
        let mut answer = StateAnswer::without(StateVerdict::Free);
        if let Some(contact) = *last
            && let Some((pair, slots)) = self.pair(state, contact)
        {
            let of_other = if let Other::Moving(other) = contact.other { state.error_m(other) } else { 0.0 };
            let contact = Candidate { slack_m: state.error_m(contact.index) + of_other, ..contact };
            let found = self.decide(solver, &pair, contact);
            answer.solved += u32::from(found.solved);
            if found.verdict == Verdict::Yes {
                return self.settled(answer.solved, slots, &found);
            }
        }
        *last = None;
        self.placed.visit(state, self.margin_m, |candidate| {
            let Some((pair, slots)) = self.pair(state, candidate) else { return true };
            let found = self.decide(solver, &pair, candidate);
            answer.solved += u32::from(found.solved);
            match found.verdict {
                Verdict::No => true,
                Verdict::Yes => {
                    answer = self.settled(answer.solved, slots, &found);
                    *last = Some(candidate);
                    false
                }
                Verdict::Undecided => {
                    if answer.verdict == StateVerdict::Free {
                        answer = self.settled(answer.solved, slots, &found);
                    }
                    true
                }
            }
        });
        answer
    }

    fn worst_pair(&self, solver: &Solver<'_>, state: &State) -> StateAnswer {
        let mut candidates = Vec::new();
        // Every pair counts, however far.
        self.placed.visit(state, f64::MAX, |candidate| {
            candidates.push(candidate);
            true
        });
        let scene = self.placed.scene();
        let mut open: Vec<_> = candidates
            .into_iter()
            .filter_map(|candidate| {
                let (pair, slots) = self.pair(state, candidate)?;
                let (padding, slack_m) = (scene.padding_m(slots[0], slots[1]), candidate.slack_m);
                Some((pair.a.ball_gap_m(&pair.b) - slack_m - padding, pair, slots, (padding, slack_m)))
            })
            .collect();
        open.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut answer = StateAnswer::without(StateVerdict::Free);
        let (mut least, mut solved) = (f64::INFINITY, 0);
        // The pair that may be nearest of those that are not proven to be free.
        let mut doubtful: Option<([Slot; 2], Bracket, f64)> = None;
        for (bound, pair, slots, (padding, slack_m)) in open {
            if bound > least {
                break;
            }
            let cutoff = least.min(MOST_M) + padding + slack_m;
            if decide(solver, &pair, cutoff, self.options(solver)).verdict == Verdict::No {
                continue;
            }
            solved += 1;
            let found = solver.measure(0, &pair);
            let value = if found.value.is_finite() { found.value } else { found.lower };
            let (lower, upper) = (found.lower - slack_m, found.upper + slack_m);
            let verdict = super::decide::compare::against(lower, upper, self.margin_m + padding);
            let bracket = Bracket { verdict, lower, upper, rungs: found.rungs, solved: true };
            if verdict != Verdict::No && doubtful.is_none_or(|(_, _, least)| lower - padding < least) {
                doubtful = Some((slots, bracket, lower - padding));
            }
            if value - padding < least {
                least = value - padding;
                answer = self.settled(solved, slots, &bracket);
            }
        }
        // The pair with the least value may be free while a wider bracket is not.
        if let Some((slots, bracket, _)) = doubtful.filter(|_| answer.verdict == StateVerdict::Free) {
            answer = self.settled(solved, slots, &bracket);
        }
        answer.solved = solved;
        answer
    }

    fn options<'a>(&self, solver: &Solver<'a>) -> sublevel_core::measure::Options<'a> {
        options(self.accuracy, self.accuracy.max(DEFAULT_DEPTH_ACCURACY), solver.stop)
    }

    fn decide(&self, solver: &Solver<'_>, pair: &Pair<'_>, candidate: Candidate) -> Bracket {
        let options = || options(DECISION_ACCURACY, DEFAULT_DEPTH_ACCURACY, solver.stop);
        decide_within(solver, pair, (candidate.threshold, candidate.slack_m), options)
    }

    fn pair<'a>(&'a self, state: &'a State, candidate: Candidate) -> Option<(Pair<'a>, [Slot; 2])> {
        let (slot, a) = self.placed.moving(candidate.index, state);
        let (other, b): (Slot, Thing<'a>) = match candidate.other {
            Other::Moving(other) => self.placed.moving(other, state),
            Other::Standing(other) => (other, self.placed.standing(other)?),
        };
        Some((Pair { a, b, slots: Some(PairSlots { a: slot, b: other }) }, [slot, other]))
    }

    fn settled(&self, solved: u32, pair: [Slot; 2], found: &Bracket) -> StateAnswer {
        let verdict = match found.verdict {
            Verdict::Yes => StateVerdict::Contact,
            Verdict::No => StateVerdict::Free,
            Verdict::Undecided => StateVerdict::Undecided,
        };
        let certainty = match verdict {
            StateVerdict::Contact if pair.iter().all(|&slot| self.is_exact(slot)) => Certainty::Certain,
            StateVerdict::Contact | StateVerdict::Undecided => Certainty::Possible,
            _ => Certainty::None,
        };
        let (lower_m, upper_m) = (found.lower, found.upper);
        StateAnswer { verdict, certainty, pair: Some(pair), lower_m, upper_m, solved, invalid: None }
    }

    fn is_exact(&self, slot: Slot) -> bool {
        self.placed.scene().object(slot).is_some_and(|object| is_exact(object))
    }
}

/// Width of the brackets of worst pairs, relative, where none is asked for.
const DEFAULT_STATE_ACCURACY: f64 = 1e-3;

/// Width of the bracket below which a decision is given up as open, relative to the smaller body.
const DECISION_ACCURACY: f64 = 1e-9;

/// Beyond any distance of two poses, metres.
const MOST_M: f64 = 1e16;

/// Whether the body is the object itself.
pub(super) fn is_exact(object: &Object) -> bool {
    match &object.geometry {
        Geometry::Capsule(_) | Geometry::HalfSpace(_) => true,
        Geometry::SosBody(_) => false,
        Geometry::Solid(_) | Geometry::Ladder(_) => {
            object.solids().last().is_some_and(|finest| finest.gap_m() == Some(0.0))
        }
    }
}

impl Question for States {
    type Part = Vec<StateAnswer>;

    fn chunks(&self) -> usize {
        self.placed.states().div_ceil(CHUNK)
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> Vec<StateAnswer> {
        with_starts(|starts| {
            let cache = (!self.ask.cold).then_some(starts);
            let solver = Solver { ask: &self.ask, cache, stop };
            let (mut place, mut last) = (State::default(), None);
            let states = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.placed.states());
            states
                .map(|state| {
                    let answer = self.check(state, (&solver, &mut place), &mut last);
                    if answer.verdict != StateVerdict::Free {
                        self.first_bad.fetch_min(state, Ordering::Relaxed);
                    }
                    answer
                })
                .collect()
        })
    }
}
