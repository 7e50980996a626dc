//! The growth distance as a relation of two points: `x - y` along the vector between the centres,
//! the bodies' centres on top of each other.

use super::answer::GrowthDistance;
use crate::body::Body;
use crate::measure::frames::pose::{Pose, RELATIVE_QUATERNION_ERROR};
use crate::measure::frames::twist::Twist;
use crate::measure::frames::vector::{M3, V3, add, apply, dot, normalized, rows, scaled, subtract};
use crate::measure::solver::continuation::Proven;
use crate::measure::solver::initial_guess::{Start, facing_along, meeting};
use crate::measure::solver::tangent_newton::{
    ALIGNED, Bracket, Plane, Relative, Response, Step, SurfaceCurvature, TAYLOR_ROUNDING, newton_along,
};
use crate::measure::solver::two_point_problem::{Relation, Verdict};
use crate::measure::status::Status;
use crate::polynomial::{Scalar, Simd, gamma};
use nalgebra::{Matrix3, Vector3};

/// A pair whose B is moved so that its centre lies on A's; metres, in A's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Along {
    rotation: M3<f64>,
    /// From A's frame to that of the moved B.
    translation: V3<f64>,
    /// From A's centre to where B's really is.
    pub(super) delta: V3<f64>,
    delta_error: f64,
    /// Square of the length of delta.
    square: f64,
    /// Bound of the distance of the centres that should lie on each other.
    center_error: f64,
    /// Radius of a ball about 0 in the difference of the bodies.
    radius: f64,
    /// Width of the bracket that is narrow enough, relative to the answer.
    accuracy: f64,
}

impl Along {
    #[inline(always)]
    pub(super) fn new(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, accuracy: f64) -> Self {
        let (ball_a, ball_b) = (a.growth_ball(), b.growth_ball());
        let conjugate = pose_a.rotation().conjugate();
        let moved = conjugate * (pose_b.translation() - pose_a.translation());
        let rotation: Matrix3<f64> = (conjugate * pose_b.rotation()).to_rotation_matrix().into_inner();
        let translation = ball_a.center - rotation * ball_b.center;
        let delta = moved - translation;
        let lengths = moved.norm() + ball_a.center.norm() + ball_b.center.norm();
        Self {
            rotation: rows::<Scalar, f64>(Scalar, &rotation),
            translation: translation.into(),
            delta: delta.into(),
            delta_error: (RELATIVE_QUATERNION_ERROR + gamma(16)) * lengths,
            square: delta.norm_squared(),
            center_error: (RELATIVE_QUATERNION_ERROR + gamma(16)) * (ball_a.center.norm() + ball_b.center.norm()),
            radius: ball_a.radius + ball_b.radius,
            accuracy,
        }
    }

    /// Whether the centres are apart for sure.
    pub(super) fn is_sure(&self) -> bool {
        self.square > self.delta_error * self.delta_error
    }

    /// `t` with `t w` nearest to delta along w, for points with the difference w.
    #[inline(always)]
    fn scale<S: Simd>(&self, w: V3<f64>, delta: V3<f64>) -> f64 {
        let along = dot::<S, f64>(w, delta);
        if along > 0.0 { self.square / along } else { 0.0 }
    }

    /// The answer that a proof gives.
    pub(super) fn answer(&self, a: &Body, pose_a: &Pose, pose_b: &Pose, proven: &Proven) -> GrowthDistance {
        let ball_a = a.growth_ball();
        let delta = Vector3::from(self.delta);
        let w = Vector3::from(subtract::<Scalar, f64>(proven.x, proven.y));
        let t = self.scale::<Scalar>(w.into(), self.delta);
        // Of what is missing of delta A's inscribed ball takes its share.
        let rest = (delta - w * t) * (ball_a.radius / self.radius);
        let arm = Vector3::from(proven.x) + (a.normalization().center - ball_a.center);
        let witness = pose_a.transform_point(&(ball_a.center + arm * t + rest));
        let n = Vector3::from(proven.n);
        let normal = pose_a.transform_direction(&n);
        // ∂s/∂Δ = n / (H_A(n) + H_B(-n)) = s n / (n·Δ).
        let slope = normal * (proven.upper / n.dot(&delta));
        GrowthDistance {
            tied: false,
            status: Status::Converged,
            lower: proven.lower,
            upper: proven.upper,
            witness,
            normal: Some(normal),
            gradients: Some([
                Twist::of_gradient(-slope, &witness, pose_a.translation()),
                Twist::of_gradient(slope, &witness, pose_b.translation()),
            ]),
            iterations: proven.rounds,
        }
    }
}

impl Relation for Along {
    #[inline(always)]
    fn relative<S: Simd>(&self, simd: S, a: &Body, b: &Body) -> Relative<f64> {
        let home = (&a.normalization().center, a.trust().center);
        let mut relative = Relative::from_parts(simd, home, self.rotation, self.translation, b);
        relative.displacement += self.center_error;
        relative
    }

    #[inline(always)]
    fn start<S: Simd>(&self, simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> (Start<f64>, [f64; 2]) {
        let n = normalized(simd, facing_along(simd, a, b, relative, self.delta));
        meeting(simd, a, b, relative, n, Some(self.delta))
    }

    #[inline(always)]
    fn newton<S: Simd>(
        &self,
        simd: S,
        a: (&Plane<f64>, &SurfaceCurvature<f64>),
        b: (&Plane<f64>, &SurfaceCurvature<f64>),
        frame: &M3<f64>,
        difference: V3<f64>,
        smallest: f64,
    ) -> (Step<f64>, Response<f64>) {
        newton_along(simd, a, b, difference, apply::<S, f64>(frame, self.delta), smallest)
    }

    #[inline(always)]
    fn aside<S: Simd>(&self, _: S, frame: &M3<f64>, difference: V3<f64>) -> [f64; 2] {
        let ray = apply::<S, f64>(frame, self.delta);
        let times = difference[2] / ray[2];
        [difference[0] - times * ray[0], difference[1] - times * ray[1]]
    }

    /// With `H = H_A(n) + H_B(-n)`, which the bracket of the distance bounds, and a point w of the
    /// difference of the bodies, the two bounds at the head of [`super`].
    #[inline(always)]
    fn judge<S: Simd>(&self, _: S, found: &Bracket<f64>, frame: &M3<f64>, difference: V3<f64>) -> Verdict {
        let delta = apply::<S, f64>(frame, self.delta);
        let gap = self.square.sqrt();
        let delta_error = self.delta_error + TAYLOR_ROUNDING * gap;
        let width = -found.lower;
        let lower = (-dot::<S, f64>(found.normal, delta) - delta_error) / width * (1.0 - TAYLOR_ROUNDING);

        let w = subtract::<S, f64>(add::<S, f64>(difference, found.to_a), found.to_b);
        let t = self.scale::<S>(w, delta);
        let rest = subtract::<S, f64>(delta, scaled::<S, f64>(w, t));
        // What the points are off by counts at most half of what rounding leaves.
        let rest = dot::<S, f64>(rest, rest).sqrt() + delta_error + t * found.rounding;
        let upper = (t + rest / self.radius) * (1.0 + TAYLOR_ROUNDING);
        // The bracket of the distance is not a number where its points are not proven to be in the
        // bodies.
        let narrow =
            upper - lower <= tolerance(self.accuracy, upper, self.delta_error / self.radius) && found.off <= ALIGNED;
        // Without a bound above 0 there is no normal either: the centres may coincide.
        if lower > 0.0 && width > 0.0 && found.upper.is_finite() && narrow {
            Verdict::Proven { lower, upper }
        } else {
            Verdict::Wide
        }
    }
}

/// Width of a bracket that is narrow enough. It is relative to s, as normals of deep pairs need as
/// much; but the vector between centres that all but coincide is known to `error` of the bodies
/// only, and what that makes of either bound no method takes off.
#[inline(always)]
pub(super) fn tolerance(accuracy: f64, upper: f64, error: f64) -> f64 {
    (accuracy * upper + 2.0 * error).min(accuracy * upper.max(1.0))
}
