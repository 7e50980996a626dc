//! Balls beside boxes, cylinders and other balls at several poses at once: the projection of the
//! ball's centre is all there is to find.

use super::shapes::{ShapeAnswers, ShapeBatch, write};
use super::waiting::Group;
use crate::measure::frames::vector::{add_scaled, dot};
use crate::measure::solver::exact_shape::{LaneBracket, LaneSet};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::{Lanes, MAX_LANES, Number, Simd, Vector, WithSimd, gamma};

/// Rounding of a distance by the projection of a point, relative to the sizes that it is the sum
/// of; dimensionless. As many roundings as single queries count for the same.
///
/// A smaller value could make brackets miss the distance; a larger one widens them. Exercised by
/// `balls_are_as_far_as_single_queries_say`.
const ROUNDING: f64 = gamma(48);

/// A batch whose smooth body is a ball, as work for the widest arithmetic.
pub(super) struct BallBatch<'a, P, A> {
    pub(super) batch: ShapeBatch<'a, P, A>,
    /// Of the ball, metres.
    pub(super) radius: f64,
    /// Of the shape, which is all that is within it of the set: of another ball, whose set is its
    /// centre, else 0; metres.
    pub(super) form_radius: f64,
    /// Bound of how far the ball is from what it stands for, metres.
    pub(super) displacement: f64,
}

impl<P: LaneSet, A: ShapeAnswers> WithSimd for BallBatch<'_, P, A> {
    type Output = ();

    #[inline(always)]
    fn with_simd<S: Simd>(mut self, simd: S) {
        let (count, lanes) = (self.batch.answers.count(), Lanes::<S>::COUNT);
        for first in (0..count).step_by(lanes) {
            let group = Group::fresh(first..count.min(first + lanes));
            let proven = if self.batch.answers.is_stopped() { 0 } else { self.prove(simd, &group) };
            for lane in (0..group.count).filter(|lane| proven >> lane & 1 == 0) {
                self.batch.answers.solve_alone(group.pose[lane], 0);
            }
        }
    }
}

impl<P: LaneSet, A: ShapeAnswers> BallBatch<'_, P, A> {
    /// Writes the answers of the lanes in which the ball is proven apart as narrowly as asked for,
    /// and which these are.
    #[inline(always)]
    fn prove<S: Simd>(&mut self, simd: S, group: &Group<MAX_LANES>) -> u32 {
        let splat = |value: f64| Lanes::<S>::splat(simd, value);
        let relative: Relative<Lanes<S>> = self.batch.relative(simd, &group.pose);
        // A ball's normalization has its centre.
        let (set, x) = (self.batch.set, relative.origin);
        let seen = set.offset(simd, x);
        let n = set.in_normal_cone(simd, seen.cone, seen.frame[2]);
        let radii = self.radius + self.form_radius;
        let size = x[0].abs() + x[1].abs() + x[2].abs() + splat(set.reach() + radii);
        let displacement = self.displacement + self.batch.form.0.displacement_m();
        let displaced = (relative.displacement + splat(displacement)) * splat(1.0 + ROUNDING);
        let rounding = splat(ROUNDING).mul_add(size, displaced);
        let lower = dot(n, x) - set.height(simd, n) - splat(radii) - rounding;
        let upper = seen.distance - splat(radii) + rounding;
        // None of these where the centre lies in the set: there nothing is a number.
        let is_apart = splat(f64::MIN_POSITIVE).le(lower);
        let is_narrow = (upper - lower).le(splat(self.batch.tolerance));
        let is_proven = Lanes::<S>::and(simd, is_apart, Lanes::<S>::and(simd, is_narrow, lower.le(upper)));
        let proven = Lanes::<S>::bits(simd, is_proven) & ((1 << group.count) - 1);
        let nearest = add_scaled(set.project(simd, x), splat(self.form_radius), n);
        let x = add_scaled(x, splat(-self.radius), n);
        // The gradient of |z|² / r² is 2 / r there.
        let multiplier = splat(0.5 * self.radius);
        write(&mut self.batch.answers, group, proven, &LaneBracket { lower, upper, x, nearest, n, multiplier });
        proven
    }
}
