//! Contact in many states.

use std::sync::atomic::{AtomicUsize, Ordering};

use sublevel_core::measure::{DEFAULT_DEPTH_ACCURACY, Pose};

use super::answer::Verdict;
use super::ask::{Ask, AskError, Measure, check_accuracy, options};
use super::decide::{Bracket, decide};
use super::placed::{Other, Placed, StatesError, with_starts};
use super::solver::{Pair, Solver};
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
    /// A pose is none.
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
#[derive(Clone, Copy, Debug)]
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
}

impl StateAnswer {
    fn without(verdict: StateVerdict) -> Self {
        let (lower_m, upper_m) = (f64::NAN, f64::NAN);
        Self { verdict, certainty: Certainty::None, pair: None, lower_m, upper_m, solved: 0 }
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
        let placed = Placed::new(scene, slots, poses, include_allowed)?;
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
        (solver, poses): (&Solver<'_>, &mut Vec<Pose>),
        last: &mut Option<Contact>,
    ) -> StateAnswer {
        if self.stop_at_first && self.first_bad.load(Ordering::Relaxed) < state || solver.stop.is_set() {
            return StateAnswer::without(StateVerdict::NotChecked);
        }
        if self.placed.poses(state, poses).is_none() {
            return StateAnswer::without(StateVerdict::Invalid);
        }
        let answer = if self.worst { self.worst_pair(solver, poses) } else { self.first_contact(solver, poses, last) };
        if solver.stop.is_set() && answer.verdict != StateVerdict::Contact {
            return StateAnswer { solved: answer.solved, ..StateAnswer::without(StateVerdict::NotChecked) };
        }
        answer
    }

    /// What touched in the state before comes first: it often still does.
    fn first_contact(&self, solver: &Solver<'_>, poses: &[Pose], last: &mut Option<Contact>) -> StateAnswer {
        let mut answer = StateAnswer::without(StateVerdict::Free);
        if let Some(contact) = *last
            && let Some((pair, slots)) = self.pair(poses, contact.index, contact.other)
        {
            let found = self.decide(solver, &pair, contact.threshold);
            answer.solved += u32::from(found.solved);
            if found.verdict == Verdict::Yes {
                return self.settled(answer, slots, &found);
            }
        }
        *last = None;
        self.placed.visit(poses, self.margin_m, |index, other, threshold| {
            let Some((pair, slots)) = self.pair(poses, index, other) else { return true };
            let found = self.decide(solver, &pair, threshold);
            answer.solved += u32::from(found.solved);
            match found.verdict {
                Verdict::No => true,
                Verdict::Yes => {
                    answer = self.settled(answer, slots, &found);
                    *last = Some(Contact { index, other, threshold });
                    false
                }
                Verdict::Undecided => {
                    if answer.verdict == StateVerdict::Free {
                        answer = self.settled(answer, slots, &found);
                    }
                    true
                }
            }
        });
        answer
    }

    fn worst_pair(&self, solver: &Solver<'_>, poses: &[Pose]) -> StateAnswer {
        let mut candidates = Vec::new();
        // Every pair counts, however far.
        self.placed.visit(poses, f64::MAX, |index, other, _| {
            candidates.push((index, other));
            true
        });
        let scene = self.placed.scene();
        let mut open: Vec<_> = candidates
            .into_iter()
            .filter_map(|(index, other)| {
                let (pair, slots) = self.pair(poses, index, other)?;
                let padding = scene.padding_m(slots[0], slots[1]);
                Some((pair.a.ball_gap_m(&pair.b) - padding, pair, slots, padding))
            })
            .collect();
        open.sort_by(|a, b| a.0.total_cmp(&b.0));
        let mut answer = StateAnswer::without(StateVerdict::Free);
        let (mut least, mut solved) = (f64::INFINITY, 0);
        // The pair that may be nearest of those that are not proven to be free.
        let mut doubtful: Option<([Slot; 2], Bracket, f64)> = None;
        for (bound, pair, slots, padding) in open {
            if bound > least {
                break;
            }
            if decide(solver, &pair, least.min(MOST_M) + padding, self.options(solver)).verdict == Verdict::No {
                continue;
            }
            solved += 1;
            let found = solver.measure(0, &pair);
            let value = if found.value.is_finite() { found.value } else { found.lower };
            let verdict = super::decide::compare::against(found.lower, found.upper, self.margin_m + padding);
            let bracket = Bracket { verdict, lower: found.lower, upper: found.upper, rungs: found.rungs, solved: true };
            if verdict != Verdict::No && doubtful.is_none_or(|(_, _, lower)| found.lower - padding < lower) {
                doubtful = Some((slots, bracket, found.lower - padding));
            }
            if value - padding < least {
                least = value - padding;
                answer = self.settled(answer, slots, &bracket);
            }
        }
        // The pair with the least value may be free while a wider bracket is not.
        if let Some((slots, bracket, _)) = doubtful.filter(|_| answer.verdict == StateVerdict::Free) {
            answer = self.settled(answer, slots, &bracket);
        }
        answer.solved = solved;
        answer
    }

    fn options<'a>(&self, solver: &Solver<'a>) -> sublevel_core::measure::Options<'a> {
        options(self.accuracy, self.accuracy.max(DEFAULT_DEPTH_ACCURACY), solver.stop)
    }

    fn decide(&self, solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64) -> Bracket {
        decide(solver, pair, threshold, options(DECISION_ACCURACY, DEFAULT_DEPTH_ACCURACY, solver.stop))
    }

    fn pair<'a>(&'a self, poses: &'a [Pose], index: usize, other: Other) -> Option<(Pair<'a>, [Slot; 2])> {
        let (slot, a) = self.placed.moving(index, poses);
        let (other, b): (Slot, Thing<'a>) = match other {
            Other::Moving(other) => self.placed.moving(other, poses),
            Other::Standing(other) => (other, self.placed.standing(other)?),
        };
        Some((Pair { a, b, slots: Some(PairSlots { a: slot, b: other }) }, [slot, other]))
    }

    fn settled(&self, answer: StateAnswer, pair: [Slot; 2], found: &Bracket) -> StateAnswer {
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
        StateAnswer { verdict, certainty, pair: Some(pair), lower_m: found.lower, upper_m: found.upper, ..answer }
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

/// The pair that touched in the state before.
#[derive(Clone, Copy, Debug)]
struct Contact {
    index: usize,
    other: Other,
    threshold: f64,
}

/// Whether the body is the object itself.
fn is_exact(object: &Object) -> bool {
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
            let (mut poses, mut last) = (Vec::new(), None);
            let states = chunk * CHUNK..((chunk + 1) * CHUNK).min(self.placed.states());
            states
                .map(|state| {
                    let answer = self.check(state, (&solver, &mut poses), &mut last);
                    if answer.verdict != StateVerdict::Free {
                        self.first_bad.fetch_min(state, Ordering::Relaxed);
                    }
                    answer
                })
                .collect()
        })
    }
}
