//! What a signed distance says beside its bracket.

use super::answer::SignedDistance;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::solver::continuation::Proven;
use crate::measure::status::Status;
use nalgebra::Vector3;

/// A bracket, metres, without the points and the normal that it is known from.
pub(super) struct Answer {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) tied: bool,
    pub(super) iterations: u32,
    pub(super) status: Status,
}

impl Answer {
    pub(super) fn of(proven: &Proven) -> Self {
        let Proven { lower, upper, rounds, .. } = *proven;
        Self { lower, upper, tied: false, iterations: rounds, status: Status::Converged }
    }

    pub(super) fn report(
        self,
        (witness_a, witness_b): (Vector3<f64>, Vector3<f64>),
        normal: Option<Vector3<f64>>,
        pose_a: &Pose,
        pose_b: &Pose,
    ) -> SignedDistance {
        let Self { lower, upper, tied, iterations, status } = self;
        let gradients = normal.map(|n| {
            [
                Twist::of_gradient(n, &witness_a, pose_a.translation()),
                Twist::of_gradient(-n, &witness_b, pose_b.translation()),
            ]
        });
        let at_contact = lower <= 0.0 && upper >= 0.0;
        SignedDistance { status, lower, upper, witness_a, witness_b, normal, gradients, at_contact, tied, iterations }
    }
}
