//! What a Newton step promises before the bracket where it leads is computed.

use crate::measure::solver::tangent_newton::Step;
use crate::measure::solver::two_point_problem::Relation;
use crate::polynomial::Simd;

/// Length of a step relative to the longest one allowed, dimensionless, beyond which no bracket is
/// expected to decide. It changes time only: `sublevel-bench pairs` shows it.
const DECISIVE: f64 = 0.5;

/// What is to be expected where a step leads that is too long for a narrow bracket.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::measure) enum Prospect {
    Open,
    /// The bracket probably decides what is asked.
    Decided,
    /// The bodies probably have a point between the trial points in common.
    Common,
}

impl Prospect {
    /// Of a step from points that are `height` apart along the normal, metres: that is off by about
    /// the cube of the step.
    #[inline(always)]
    pub(in crate::measure) fn new<S: Simd>(
        simd: S,
        relation: &impl Relation,
        step: &Step<f64>,
        height: f64,
        limits: [f64; 2],
    ) -> Self {
        let square = step.square(simd, limits);
        let width = square * square.sqrt() * limits[0].min(limits[1]);
        let height = height + step.dx[2] - step.dy[2];
        if !(square <= DECISIVE * DECISIVE) {
            Self::Open
        } else if height < -width && relation.ends_at_contact() {
            Self::Common
        } else if relation.decided_by(height, width) {
            Self::Decided
        } else {
            Self::Open
        }
    }
}
