//! Lower bounds of a distance by planes across a few directions, the likeliest first.

use crate::body::Body;
use crate::measure::bounds::separation::Separation;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::V3;
use crate::measure::solver::exact_shape::normals_towards;
use crate::measure::solver::initial_guess::facing;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::Relative;
use crate::measure::warm::Hint;
use crate::polynomial::{Simd, WithSimd, dispatch};
use nalgebra::Vector3;

/// Most that a plane loses to the rounding up of heights in tables, of the radii of both bodies.
///
/// Larger, planes that would decide are left out; smaller, more are tried in vain. It changes time
/// only; no test pins it.
const SETTLED: f64 = 0.02;

/// Planes between two bodies.
pub(super) struct Planes<'a> {
    separation: Separation<'a>,
    of_a: (&'a Body, &'a Pose),
    of_b: (&'a Body, &'a Pose),
    hint: &'a Hint,
}

impl<'a> Planes<'a> {
    pub(super) fn new(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose), hint: &'a Hint) -> Self {
        Self { separation: Separation::new(of_a, of_b), of_a, of_b, hint }
    }

    /// The best lower bound of the distance, metres, or the first beyond which a goal asks for no
    /// more: across the normal of the last answer, along the line of the centres, across the sides
    /// of a shape that the other body's centre lies beyond, and across the gap of the ellipsoids
    /// that stand for the bodies. Also the normal there, in A's frame, if it came to that.
    ///
    /// The last witnesses where they stand now bound what any plane can show: none is tried where
    /// they are too near for the goal, and none after that of the last normal where it is within
    /// [`SETTLED`] of them.
    pub(super) fn lower(&self, goal: &StopCriterion) -> (f64, Option<V3<f64>>) {
        let (a, pose_a) = self.of_a;
        let (b, pose_b) = self.of_b;
        let mut best = f64::NEG_INFINITY;
        if let (Some([x, y]), Some(normal)) = (self.hint.witnesses(a, b), self.hint.normal_a()) {
            let apart = (pose_a.transform_point(&x) - pose_b.transform_point(&y)).norm();
            if apart <= goal.far {
                return (best, None);
            }
            best = self.separation.along(&pose_a.transform_direction(&normal));
            let settled = SETTLED * (a.circumscribed().radius + b.circumscribed().radius);
            if best > goal.far || apart - best <= settled {
                return (best, None);
            }
        }
        let mut meets = |n: &Vector3<f64>| {
            best = best.max(self.separation.along(n));
            best > goal.far
        };
        let between = self.separation.between();
        let mut shapes = false;
        for (of_form, of_other, side) in [(self.of_b, self.of_a, 1.0), (self.of_a, self.of_b, -1.0)] {
            let Some(form) = of_form.0.closed_form() else { continue };
            shapes = true;
            let point = of_other.1.transform_point(of_other.0.interior_point());
            let (normals, count) = normals_towards(form, of_form.1, &point);
            if normals[..count].iter().any(|n| meets(&(n * side))) {
                return (best, None);
            }
        }
        if !shapes {
            if between.try_normalize(0.0).is_some_and(|n| meets(&n)) {
                return (best, None);
            }
            let facing = dispatch(Facing { a, pose_a, b, pose_b });
            meets(&pose_a.transform_direction(&facing.into()));
            return (best, Some(facing));
        }
        (best, None)
    }
}

/// The unit vector across the gap of the ellipsoids that stand for two bodies, from B to A, in A's
/// frame; as vectorized work.
struct Facing<'a> {
    a: &'a Body,
    pose_a: &'a Pose,
    b: &'a Body,
    pose_b: &'a Pose,
}

impl WithSimd for Facing<'_> {
    type Output = V3<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> V3<f64> {
        let Self { a, pose_a, b, pose_b } = self;
        facing(simd, a, b, &Relative::new(simd, a, pose_a, b, pose_b))
    }
}
