//! What 200 bits say of an answer.

use crate::companion::capsule;
use crate::measures::Answer;
use nalgebra::Vector3;
use sublevel::measure::{Distance, Options, Pose, SignedDistance, Status};
use sublevel_testkit::bodies::Placed;
use sublevel_testkit::catalogue::primitives::{Pair, Shape, Solved};
use sublevel_testkit::reference::{self, growth, signed};

/// Width of a reference's own bracket, in parts of that asked for, up to which it decides.
const SHARP: f64 = 1e-2;

/// The comparison of a bracket with 200 bits.
pub(crate) struct Verdict {
    /// Whether the bracket contains the truth.
    pub(crate) inside: bool,
    /// Whether the reference is sharp enough to say so.
    pub(crate) decided: bool,
    pub(crate) truth: f64,
}

impl Verdict {
    /// None where there is nothing to compare with.
    pub(crate) fn of(answer: &Answer, a: Placed<'_>, b: Placed<'_>) -> Option<Self> {
        let small = a.0.circumscribed().radius.min(b.0.circumscribed().radius);
        Some(match answer {
            Answer::Distance(answer) => Self::of_distance(answer, a, b, small),
            Answer::Level(answer) => {
                let truth = reference::level_distance(a.0, a.1, b.0, b.1, answer);
                Self { inside: truth.inside(answer), decided: truth.decides(answer), truth: truth.value() }
            }
            Answer::Growth(answer) => {
                // Where the centres coincide the answer is 0 and has no normal.
                let start = growth::Start { witness: answer.witness, value: answer.upper, normal: answer.normal? };
                let centres = (a.0.growth_ball().center, b.0.growth_ball().center);
                let truth = growth::growth_distance((a.0, a.1, &centres.0), (b.0, b.1, &centres.1), &start)?;
                Self { inside: truth.inside(answer), decided: truth.decides(answer), truth: truth.value() }
            }
            Answer::Signed(answer) if answer.lower > 0.0 => {
                let SignedDistance { status, lower, upper, witness_a, witness_b, normal, iterations, .. } = *answer;
                let apart =
                    Distance { status, lower, upper, witness_a, witness_b, normal, iterations, ..Distance::default() };
                Self::of_distance(&apart, a, b, small)
            }
            Answer::Signed(answer) => Self::of_depth(answer, a, b, small)?,
            Answer::Capsule(found) => {
                let shape = Shape::Capsule(capsule(b.0));
                Self::of_shape(answer, (found.status, found.witness, found.normal), a, (shape, b.1))
            }
            Answer::Point(found) => {
                Self::of_shape(answer, (found.status, found.witness, found.normal), a, (Shape::Point, b.1))
            }
            Answer::HalfSpace(found) => {
                Self::of_shape(answer, (found.status, found.witness, None), a, (Shape::HalfSpace, b.1))
            }
        })
    }

    fn of_distance(answer: &Distance, a: Placed<'_>, b: Placed<'_>, small: f64) -> Self {
        let truth = reference::distance(a.0, a.1, b.0, b.1, answer);
        let decided = truth.decides(answer, 1e-16 * small);
        Self { inside: truth.inside(answer), decided, truth: truth.value() }
    }

    /// A plane of any direction shows that no translation along it is shorter: the least depth, and
    /// with it the bracket, is not above that of the stationary translation by the answer's normal.
    /// That no other one is shorter is what the answer proves, and 200 bits do not.
    fn of_depth(answer: &SignedDistance, a: Placed<'_>, b: Placed<'_>, small: f64) -> Option<Self> {
        let truth = signed::signed_distance(a.0, a.1, b.0, b.1, answer)?;
        let rounding = 16.0 * f64::EPSILON * (a.0.circumscribed().radius + b.0.circumscribed().radius + small);
        let decided = truth.value >= answer.lower - rounding;
        Some(Self { inside: truth.value <= answer.upper + rounding, decided, truth: truth.value })
    }

    /// Of a body and what stands in place of the second one.
    fn of_shape(
        answer: &Answer,
        (status, witness, normal): (Status, Vector3<f64>, Option<Vector3<f64>>),
        a: Placed<'_>,
        (shape, pose_b): (Shape, &Pose),
    ) -> Self {
        let pair = Pair::new(Shape::Body(Box::new(a.0.clone())), *a.1, shape, *pose_b, "soak");
        let (lower, upper) = answer.bracket();
        let found = Solved {
            status,
            lower,
            upper,
            value: upper,
            witness_a: witness,
            witness_b: witness,
            normal,
            tied: false,
            iterations: answer.iterations(),
            gradients: None,
        };
        let truth = pair.truth();
        let wanted = SHARP * (Options::default().accuracy() * pair.size()).max(pair.rounding());
        let decided = truth.lower.is_none() || truth.width() <= wanted || truth.all_inside(&found);
        Self { inside: truth.inside(&found), decided, truth: truth.value() }
    }
}
