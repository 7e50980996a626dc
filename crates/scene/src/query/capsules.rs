//! Pairs with a capsule in them.

use nalgebra::Vector3;
use sublevel_core::measure::{
    Capsule, CapsuleDistance, Options, Pose, Status, Twist, WithinMargin, capsules_within_margin,
    distance_of_capsule_to_half_space, distance_of_capsules, distance_to_capsule, within_margin_of_capsule,
};

use super::answer::{Answer, AnswerStatus};
use super::ask::Measure;
use super::decide::decide;
use super::solve::from_signed;
use super::solver::{Pair, Solver};
use super::thing::{Thing, WorldHalfSpace};

/// The signed distance of a pair with a capsule in it, metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SignedCapsule {
    status: Status,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    witnesses: [Vector3<f64>; 2],
    /// From the second to the first.
    normal: Option<Vector3<f64>>,
    gradients: Option<[Twist; 2]>,
    tied: bool,
    iterations: u32,
}

impl SignedCapsule {
    /// What balls say, where nothing else is known.
    fn open(lower: f64) -> Self {
        Self {
            status: Status::BracketWide,
            lower,
            upper: f64::INFINITY,
            witnesses: [Vector3::zeros(); 2],
            normal: None,
            gradients: None,
            tied: false,
            iterations: 0,
        }
    }

    fn of(found: &CapsuleDistance, poses: Option<(&Pose, &Pose)>) -> Self {
        Self {
            status: found.status,
            lower: found.lower,
            upper: found.upper,
            witnesses: [found.witness, found.witness_of_capsule],
            normal: found.normal,
            gradients: poses.and_then(|(pose, capsule_pose)| found.gradients(pose, capsule_pose)),
            tied: found.tied,
            iterations: found.iterations,
        }
    }

    fn swapped(self) -> Self {
        let ([first, second], gradients) = (self.witnesses, self.gradients.map(|[a, b]| [b, a]));
        Self { witnesses: [second, first], normal: self.normal.map(|n| -n), gradients, ..self }
    }
}

impl Solver<'_> {
    /// A measure of a pair with a capsule in it.
    pub(crate) fn capsules(&self, index: usize, measure: Measure, pair: &Pair<'_>) -> Answer {
        let options = self.ask.options(index, self.stop);
        match measure {
            Measure::Overlap => return self.decided(&decide(self, pair, 0.0, options)),
            Measure::NearerThan => return self.decided(&decide(self, pair, self.ask.threshold_m, options)),
            _ => {}
        }
        self.answer_of_capsule(measure, pair, &self.capsule_distance(pair, &options))
    }

    /// What the signed distance of a pair with a capsule in it says of a measure.
    pub(crate) fn answer_of_capsule(&self, measure: Measure, pair: &Pair<'_>, found: &SignedCapsule) -> Answer {
        let answer = from_signed(measure, self.of_capsule(pair, found), self.ask.threshold_m);
        // A distance is known where the depth is not.
        let settled = measure == Measure::Distance && answer.upper == 0.0;
        if settled { Answer { status: AnswerStatus::Converged, ..answer } } else { answer }
    }

    /// The signed distance that was found of a body and a capsule, whichever comes first.
    pub(crate) fn signed_capsule(&self, pair: &Pair<'_>, found: &CapsuleDistance) -> Answer {
        let is_first = matches!(pair.a, Thing::Capsule { .. });
        let (capsule, body) = if is_first { (&pair.a, &pair.b) } else { (&pair.b, &pair.a) };
        let found = SignedCapsule::of(found, body.pose().zip(capsule.pose()));
        self.of_capsule(pair, &if is_first { found.swapped() } else { found })
    }

    fn of_capsule(&self, pair: &Pair<'_>, found: &SignedCapsule) -> Answer {
        let stopped = self.stop.is_set();
        Answer {
            witnesses: (found.upper < f64::INFINITY).then_some(found.witnesses),
            normal: found.normal,
            gradients: found.gradients.filter(|_| self.ask.gradients),
            not_unique: found.tied,
            iterations: found.iterations,
            rungs: pair.finest_rungs(),
            ..Answer::bracket(found.status, found.lower, found.upper, stopped)
        }
    }

    /// The signed distance of a pair with a capsule in it, unless it is beyond a margin that is not
    /// negative, metres: then it is not worked out.
    pub(crate) fn capsule_within(
        &self,
        pair: &Pair<'_>,
        margin_m: f64,
        options: &Options<'_>,
    ) -> Option<SignedCapsule> {
        let (found, poses) = match (&pair.a, &pair.b) {
            (Thing::Capsule { .. }, Thing::Solid { set: None, .. }) => {
                return Some(self.capsule_within(&pair.swapped(), margin_m, options)?.swapped());
            }
            (Thing::Solid { rungs, pose, set: None }, Thing::Capsule { capsule, pose: capsule_pose }) => {
                let solid = &**rungs.last()?;
                let found = self.warm(pair.slots, [rungs.len() - 1, 0], Measure::Signed, |warm| {
                    within_margin_of_capsule(solid, pose, capsule, capsule_pose, margin_m, options, warm)
                });
                (found, (*pose, *capsule_pose))
            }
            (Thing::Capsule { capsule, pose }, Thing::Capsule { capsule: other, pose: other_pose }) => {
                (capsules_within_margin(capsule, pose, other, other_pose, margin_m, options), (*pose, *other_pose))
            }
            _ => return Some(self.capsule_distance(pair, options)).filter(|found| found.lower <= margin_m),
        };
        match found {
            Ok(WithinMargin::Beyond { .. }) => None,
            Ok(WithinMargin::Within(found)) => Some(SignedCapsule::of(&found, Some(poses))),
            Err(_) => Some(self.capsule_distance(pair, options)),
        }
    }

    /// The signed distance of a pair with a capsule in it.
    pub(crate) fn capsule_distance(&self, pair: &Pair<'_>, options: &Options<'_>) -> SignedCapsule {
        match (&pair.a, &pair.b) {
            (Thing::Solid { rungs, pose, set }, Thing::Capsule { capsule, pose: capsule_pose }) => {
                let Some(solid) = rungs.last() else { return SignedCapsule::open(f64::NEG_INFINITY) };
                let rung = rungs.len() - 1;
                let found = self.warm(pair.slots, [rung, 0], Measure::Signed, |warm| {
                    distance_to_capsule(&**solid, pose, capsule, capsule_pose, options, warm)
                });
                if set.is_some() {
                    // The solid only contains the set.
                    return SignedCapsule::open(found.lower);
                }
                SignedCapsule::of(&found, Some((pose, capsule_pose)))
            }
            (Thing::Capsule { capsule, pose }, Thing::Capsule { capsule: other, pose: other_pose }) => {
                let found = distance_of_capsules(capsule, pose, other, other_pose, options);
                SignedCapsule::of(&found, Some((pose, other_pose)))
            }
            (Thing::Capsule { capsule, pose }, Thing::Point(point)) => {
                let (place, dot) = (Pose::identity().with_translation(*point), Capsule::POINT);
                let found = distance_of_capsules(capsule, pose, &dot, &place, options);
                SignedCapsule::of(&found, Some((pose, &place)))
            }
            (Thing::Capsule { capsule, pose }, Thing::HalfSpace(half_space)) => {
                above_plane(capsule, pose, half_space, options)
            }
            _ => self.capsule_distance(&pair.swapped(), options).swapped(),
        }
    }
}

/// The signed distance of a capsule from a half-space: that of the lower end of its axis.
fn above_plane(capsule: &Capsule, pose: &Pose, half_space: &WorldHalfSpace, options: &Options<'_>) -> SignedCapsule {
    let plane = &half_space.half_space;
    let found = distance_of_capsule_to_half_space(capsule, pose, plane, options);
    let slack = half_space.slack_m(pose.translation().norm() + capsule.reach_m());
    let (normal, witness) = (plane.normal(), found.witness);
    let on_plane = witness - normal * (normal.dot(&witness) - plane.offset());
    let arm = witness - half_space.origin;
    let gradients = [found.pose_gradient(pose, plane), Twist { linear: -normal, angular: normal.cross(&arm) }];
    SignedCapsule {
        status: found.status,
        lower: found.lower - slack,
        upper: found.upper + slack,
        witnesses: [witness, on_plane],
        normal: Some(*normal),
        gradients: Some(gradients),
        tied: found.tied,
        iterations: found.iterations,
    }
}
