//! The measures under test: a table to extend when one is added.

use crate::companion::{capsule, half_space};
use crate::draw::Aim;
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{
    CapsuleDistance, Distance, GrowthDistance, HalfSpaceDistance, LevelDistance, Options, PointDistance, Pose,
    SignedDistance, Status, WarmStart, distance, distance_to_capsule, distance_to_half_space, distance_to_point,
    growth_distance, level_distance, signed_distance,
};
use sublevel_testkit::bodies::Placed;

/// An answer of any measure.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Answer {
    Distance(Distance),
    Level(LevelDistance),
    Growth(GrowthDistance),
    Signed(SignedDistance),
    Capsule(CapsuleDistance),
    Point(PointDistance),
    HalfSpace(HalfSpaceDistance),
}

type Solve = fn(Placed<'_>, Placed<'_>, &Options<'_>, &mut WarmStart) -> Answer;
type Program = fn(Placed<'_>, Placed<'_>) -> Option<f64>;

/// A measure: its name, its solver, its semidefinite program, and what grazing poses are made by if
/// not by the distance of the bodies.
pub(crate) struct Measure {
    pub(crate) name: &'static str,
    pub(crate) solve: Solve,
    pub(crate) program: Option<Program>,
    pub(crate) aim: Option<Aim>,
}

const fn measure(name: &'static str, solve: Solve) -> Measure {
    Measure { name, solve, program: None, aim: None }
}

/// By the numbers that queries are drawn with. In place of the second body of the last three stands
/// what is made from it.
pub(crate) const MEASURES: [Measure; crate::draw::MEASURES] = [
    Measure {
        program: Some(crate::sos::distance),
        ..measure("distance", |a, b, options, warm| Answer::Distance(distance(a.0, a.1, b.0, b.1, options, warm)))
    },
    Measure {
        program: Some(crate::sos::level_distance),
        ..measure("level distance", |a, b, options, warm| {
            Answer::Level(level_distance(a.0, a.1, b.0, b.1, options, warm))
        })
    },
    measure("growth distance", |a, b, options, warm| {
        Answer::Growth(growth_distance(a.0, a.1, b.0, b.1, options, warm))
    }),
    measure("signed distance", |a, b, options, warm| {
        Answer::Signed(signed_distance(a.0, a.1, b.0, b.1, options, warm))
    }),
    Measure {
        aim: Some(|a, b| {
            let options = Options::default().with_accuracy(1e-6).expect("within range");
            let found = distance_to_capsule(a.0, a.1, &capsule(b.0), b.1, &options, &mut WarmStart::default());
            Some((found.normal?, found.upper))
        }),
        ..measure("capsule", |a, b, options, warm| {
            Answer::Capsule(distance_to_capsule(a.0, a.1, &capsule(b.0), b.1, options, warm))
        })
    },
    Measure {
        aim: Some(|a, b| {
            let options = Options::default().with_accuracy(1e-6).expect("within range");
            let found = distance_to_point(a.0, a.1, b.1.translation(), &options, &mut WarmStart::default());
            let found = found.expect("coordinates of a pose");
            Some((-found.normal?, found.upper))
        }),
        ..measure("point", |a, b, options, warm| {
            let found = distance_to_point(a.0, a.1, b.1.translation(), options, warm);
            Answer::Point(found.expect("coordinates of a pose"))
        })
    },
    Measure {
        aim: Some(|a, b| {
            let options = Options::default().with_accuracy(1e-6).expect("within range");
            let plane = half_space(b.1);
            let found = distance_to_half_space(a.0, a.1, &plane, &options, &mut WarmStart::default());
            Some((*plane.normal(), found.upper))
        }),
        ..measure("half-space", |a, b, options, warm| {
            Answer::HalfSpace(distance_to_half_space(a.0, a.1, &half_space(b.1), options, warm))
        })
    },
];

/// Rounding of the height over a plane, relative to the coordinates.
const PLANE: f64 = 256.0 * f64::EPSILON;

impl Answer {
    /// Whether it is what was asked for. How deep the axis of a capsule is in a body is not
    /// measured, that it meets it, to within the accuracy, is an answer; and a half-space is known
    /// by its height over the origin of the world, so that far from there rounding keeps the
    /// bracket wide.
    pub(crate) fn converged(&self, (a, pose_a): Placed<'_>, (b, pose_b): Placed<'_>) -> bool {
        let (lower, upper) = self.bracket();
        self.status() == Status::Converged
            || match self {
                Self::Capsule(_) => {
                    let of_axis = upper + capsule(b).radius_m();
                    lower == f64::NEG_INFINITY && of_axis <= self.tolerance(a, b, Options::default().accuracy())
                }
                Self::HalfSpace(_) => {
                    upper - lower <= PLANE * pose_a.translation().norm().max(pose_b.translation().norm())
                }
                _ => false,
            }
    }

    /// Whether the status says what the bracket is.
    pub(crate) fn is_honest(&self, a: &Body, b: &Body) -> bool {
        let (lower, upper) = self.bracket();
        (upper - lower <= self.tolerance(a, b, Options::default().accuracy())) == (self.status() == Status::Converged)
    }

    fn status(&self) -> Status {
        match self {
            Answer::Distance(answer) => answer.status,
            Answer::Level(answer) => answer.status,
            Answer::Growth(answer) => answer.status,
            Answer::Signed(answer) => answer.status,
            Answer::Capsule(answer) => answer.status,
            Answer::Point(answer) => answer.status,
            Answer::HalfSpace(answer) => answer.status,
        }
    }

    pub(crate) fn bracket(&self) -> (f64, f64) {
        match self {
            Answer::Distance(answer) => (answer.lower, answer.upper),
            Answer::Level(answer) => (answer.lower, answer.upper),
            Answer::Growth(answer) => (answer.lower, answer.upper),
            Answer::Signed(answer) => (answer.lower, answer.upper),
            Answer::Capsule(answer) => (answer.lower, answer.upper),
            Answer::Point(answer) => (answer.lower, answer.upper),
            Answer::HalfSpace(answer) => (answer.lower, answer.upper),
        }
    }

    pub(crate) fn iterations(&self) -> u32 {
        match self {
            Answer::Distance(answer) => answer.iterations,
            Answer::Level(answer) => answer.iterations,
            Answer::Growth(answer) => answer.iterations,
            Answer::Signed(answer) => answer.iterations,
            Answer::Capsule(answer) => answer.iterations,
            Answer::Point(answer) => answer.iterations,
            Answer::HalfSpace(answer) => answer.iterations,
        }
    }

    /// Width that a converged bracket may have.
    pub(crate) fn tolerance(&self, a: &Body, b: &Body, accuracy: f64) -> f64 {
        let small = a.circumscribed().radius.min(b.circumscribed().radius);
        let scale = match self {
            Answer::Distance(_) => small,
            Answer::Level(answer) => answer.upper.abs().max(1.0),
            Answer::Growth(answer) => answer.upper.max(1.0),
            Answer::Signed(answer) if answer.upper < 0.0 => {
                // Of a depth in parts of it.
                small.max(-answer.lower * Options::default().depth_accuracy() / accuracy)
            }
            Answer::Signed(_) => small,
            Answer::Capsule(_) => a.circumscribed().radius.min(capsule(b).reach_m()),
            Answer::Point(_) | Answer::HalfSpace(_) => a.circumscribed().radius,
        };
        accuracy * scale * (1.0 + 1e-12)
    }

    /// Whether the witnesses lie in their bodies, up to what rounding them to world coordinates and
    /// in each other's frame moves them.
    pub(crate) fn feasible(&self, a: Placed<'_>, b: Placed<'_>) -> bool {
        let seen_from = |(body, pose): Placed<'_>, x: &Vector3<f64>| {
            (x - pose.translation()).norm() + body.circumscribed().center.norm()
        };
        let of_two =
            |x: &Vector3<f64>, y: &Vector3<f64>| within(a, x, seen_from(b, x)) && within(b, y, seen_from(a, y));
        match self {
            Answer::Distance(answer) => of_two(&answer.witness_a, &answer.witness_b),
            Answer::Signed(answer) if answer.lower > 0.0 => of_two(&answer.witness_a, &answer.witness_b),
            // The ends of a translation, and points of bodies as they have grown, which are theirs
            // to check.
            Answer::Signed(_) | Answer::Growth(_) => true,
            Answer::Level(answer) => within(b, &answer.witness, 0.0),
            Answer::Capsule(answer) => {
                // Where the axis is met one point stands for both, as near to each as the bracket
                // is wide.
                answer.normal.is_none() || within(a, &answer.witness, seen_from(b, &answer.witness))
            }
            Answer::Point(answer) => answer.inside || within(a, &answer.witness, seen_from(b, &answer.witness)),
            Answer::HalfSpace(answer) => within(a, &answer.witness, 0.0),
        }
    }

    /// The answer's value and the size that an arbiter's 1e-6 is relative to. None where a
    /// semidefinite program in doubles cannot resolve: sizes or values that are too far apart.
    pub(crate) fn comparable(&self, a: &Body, b: &Body) -> Option<(f64, f64)> {
        let (small, large) = (a.circumscribed().radius, b.circumscribed().radius);
        let (small, large) = (small.min(large), small.max(large));
        let value = self.bracket().1;
        match self {
            Answer::Distance(_) => (value < 10.0 * large).then_some((value, large)),
            Answer::Level(_) => (value < 1e3 && large < 10.0 * small).then_some((value, value.abs().max(1.0))),
            _ => None,
        }
    }
}

/// Whether a point of the world lies in a body, up to the rounding of its coordinates in the world,
/// in the body's frame, and in another one from whose origin it is `away`, metres.
fn within((body, pose): (&Body, &Pose), witness: &Vector3<f64>, away: f64) -> bool {
    let local = pose.rotation().inverse_transform_vector(&(witness - pose.translation()));
    let moved = 16.0 * f64::EPSILON * (witness.norm() + pose.translation().norm() + local.norm() + away);
    body.constraints().iter().all(|constraint| {
        let jet = body.placement().jet(constraint, &local);
        jet.value <= 1.0 + jet.gradient.norm() * moved * (1.0 + 1e-3) + 1e-12
    })
}
