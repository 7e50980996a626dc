//! One measure of one pair.

use nalgebra::Vector3;
use sublevel_core::measure::{Status, Twist};

/// How an answer came about. The bracket is true whatever it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnswerStatus {
    /// As narrow as asked for; both bounds are finite.
    Converged,
    /// True, but wider than asked for.
    BracketWide,
    /// The time of the call ended first.
    Deadline,
    /// The measure does not exist for such a pair.
    NotDefined,
    /// The pair may touch, and was left out.
    Allowed,
}

/// Answer to a yes-or-no question.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// Proven.
    Yes,
    /// Proven not to be.
    No,
    /// Neither.
    Undecided,
}

/// One measure of one pair; lengths in metres, times in seconds, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Answer {
    /// How it came about.
    pub status: AnswerStatus,
    /// Proven lower bound, −∞ if there is none.
    pub lower: f64,
    /// Proven upper bound, ∞ if there is none.
    pub upper: f64,
    /// The value inside the bracket; NaN without an upper bound.
    pub value: f64,
    /// Of yes-or-no questions and times of impact.
    pub verdict: Option<Verdict>,
    /// Points of the first and of the second side.
    pub witnesses: Option<[Vector3<f64>; 2]>,
    /// Unit vector from the second to the first.
    pub normal: Option<Vector3<f64>>,
    /// Derivatives with respect to the twists of the two.
    pub gradients: Option<[Twist; 2]>,
    /// Whether another minimiser may be as good.
    pub not_unique: bool,
    /// Of level distances: the value says no more about depth.
    pub saturated: bool,
    /// Of signed distances: within rounding of contact.
    pub one_sided: bool,
    /// Parts of the two the answer is about.
    pub parts: [u16; 2],
    /// Rungs of the two that were used.
    pub rungs: [u8; 2],
    /// Iterations of the solver.
    pub iterations: u32,
    /// Sum of multipliers of a level distance; NaN elsewhere.
    pub multiplier: f64,
    /// Upper bound of the distance of the objects inside, NaN where unknown.
    pub objects_upper: f64,
}

impl Answer {
    /// An answer that says nothing but why.
    pub(crate) fn without(status: AnswerStatus) -> Self {
        Self {
            status,
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            value: f64::NAN,
            verdict: None,
            witnesses: None,
            normal: None,
            gradients: None,
            not_unique: false,
            saturated: false,
            one_sided: false,
            parts: [0; 2],
            rungs: [0; 2],
            iterations: 0,
            multiplier: f64::NAN,
            objects_upper: f64::NAN,
        }
    }

    /// A bracket with how the solver ended; `stopped`: the call's time is over.
    pub(crate) fn bracket(status: Status, lower: f64, upper: f64, stopped: bool) -> Self {
        let status = match status {
            Status::Converged if lower.is_finite() && upper.is_finite() => AnswerStatus::Converged,
            _ if stopped => AnswerStatus::Deadline,
            _ => AnswerStatus::BracketWide,
        };
        let value = if upper.is_finite() { upper } else { f64::NAN };
        Self { lower, upper, value, ..Self::without(status) }
    }

    /// The same for sides that may be displaced by so much against each other, metres.
    pub(crate) fn widened(self, slack_m: f64) -> Self {
        let (lower, upper) = (self.lower - slack_m, self.upper + slack_m);
        Self { lower, upper, objects_upper: self.objects_upper + slack_m, ..self }
    }

    /// The same with the sides exchanged.
    pub(crate) fn swapped(self) -> Self {
        Self {
            witnesses: self.witnesses.map(|[a, b]| [b, a]),
            normal: self.normal.map(|normal| -normal),
            gradients: self.gradients.map(|[a, b]| [b, a]),
            parts: [self.parts[1], self.parts[0]],
            rungs: [self.rungs[1], self.rungs[0]],
            ..self
        }
    }
}
