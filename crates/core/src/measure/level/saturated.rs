//! Level distances that are the minimum of A's polynomial, which it takes in B.

use super::answer::LevelDistance;
use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::frames::vector::dot;
use crate::measure::options::Options;
use crate::measure::solver::tangent_newton::{Relative, Side};
use crate::measure::status::Status;
use crate::polynomial::{Simd, WithSimd, dispatch, gamma};

/// The answer where the interior point of `a` is proven to lie in `b` and what is known of the
/// minimum is enough.
pub(super) fn saturated(
    a: &Body,
    pose_a: &Pose,
    b: &Body,
    pose_b: &Pose,
    options: &Options<'_>,
) -> Option<LevelDistance> {
    let (lower, upper) = (a.trust().least, a.min_value());
    let narrow = upper - lower <= options.accuracy() * upper.abs().max(1.0);
    (narrow && dispatch(Saturated { a, pose_a, b, pose_b })).then(|| LevelDistance {
        status: Status::Converged,
        lower,
        upper,
        witness: pose_a.transform_point(a.interior_point()),
        multiplier: 0.0,
        saturated: true,
        gradient_a: Twist::ZERO,
        gradient_b: Twist::ZERO,
        tied: false,
        iterations: 0,
    })
}

/// Whether the interior point of A is proven to lie in B: then B's constraint is inactive at the
/// minimiser of A's polynomial.
struct Saturated<'a> {
    a: &'a Body,
    pose_a: &'a Pose,
    b: &'a Body,
    pose_b: &'a Pose,
}

impl WithSimd for Saturated<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { a, b, .. } = self;
        let relative = Relative::new(simd, a, self.pose_a, b, self.pose_b);
        let from = a.interior_point();
        let x = from - a.normalization().center;
        let displaced = relative.displacement + gamma(4) * (from.norm() + a.normalization().center.norm());
        let trust = b.trust();
        let dz = trust.linear_norm * displaced;
        let mut hold = displaced <= trust.leeway;
        for (i, constraint) in trust.constraints.iter().enumerate() {
            let (jet, inside) = Side::away(simd, b, i, &relative).jet(simd, x.into());
            let slope =
                dot::<S, f64>(jet.gradient, jet.gradient).sqrt() + constraint.gradient_error / trust.linear_norm;
            let rise = slope * dz + constraint.curvature_ceiling * displaced * displaced;
            hold &= inside && jet.value + constraint.value_error + 1.01 * rise <= 1.0;
        }
        hold
    }
}
