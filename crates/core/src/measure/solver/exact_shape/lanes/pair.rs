//! The distance of two sets with closed forms at several poses, one in each lane of the vectors:
//! the method and the proof of [`super::super::shape_pair`], with all of a round computed in every
//! lane.

use super::bracket::LaneBracket;
use super::least::LaneLeast;
use super::set::{LaneOffset, LaneSet};
use crate::measure::frames::pose::RELATIVE_QUATERNION_ERROR;
use crate::measure::frames::vector::{M3, V3, add, add_scaled, apply, apply_transposed, dot, scaled, subtract};
use crate::measure::solver::exact_shape::shape_pair::{
    CROSSED, FINELY_ALIGNED, FLAT, LEVEL, LEVEL_SLOPE, MOST_CUTS, share_of_step,
};
use crate::measure::solver::tangent_newton::TAYLOR_ROUNDING;
use crate::polynomial::{Number, Simd, Vector, gamma};
use nalgebra::Vector3;

/// Two sets, A where it stands as seen from B.
pub(in crate::measure) struct LanePair<A, B, N> {
    a: A,
    b: B,
    /// From A's frame to B's.
    rotation: M3<N>,
    /// Of A's centre in B's frame, metres.
    translation: V3<N>,
    /// Bound of all errors of places, metres.
    displacement: N,
}

/// What a point of A sees of B.
pub(in crate::measure) struct PairView<N> {
    /// The point in A's frame, metres.
    own: V3<N>,
    seen: LaneOffset<N>,
    /// The vector from B's nearest point to it in A's frame, metres, which is the gradient of the
    /// half squared distance.
    gradient: V3<N>,
    /// Of a bound of the distance, metres.
    rounding: N,
}

impl<A: LaneLeast, B: LaneSet, N: Copy> LanePair<A, B, N> {
    /// A turned by `rotation` and moved by `translation` (metres, body frame of B), each set about
    /// its centre in the frame of its body. `displacement` bounds how far both are from what they
    /// stand for, metres.
    #[inline(always)]
    pub(in crate::measure) fn from_parts<S: Simd>(
        simd: S,
        (a, center_a): (A, &Vector3<f64>),
        (b, center_b): (B, &Vector3<f64>),
        (rotation, translation): (M3<N>, V3<N>),
        displacement: f64,
    ) -> Self
    where
        N: Number<S>,
    {
        let splat = |v: &Vector3<f64>| [N::splat(simd, v.x), N::splat(simd, v.y), N::splat(simd, v.z)];
        let turned = add(translation, apply(&rotation, splat(center_a)));
        let far = translation[0].abs() + translation[1].abs() + translation[2].abs();
        // As single queries count, with the matrix of a quaternion; a translation is no longer than
        // what is far and A's centre.
        let share = RELATIVE_QUATERNION_ERROR + gamma(8);
        let fixed = share * (2.0 * center_a.norm() + center_b.norm() + a.reach()) + displacement;
        Self {
            a,
            b,
            rotation,
            translation: subtract(turned, splat(center_b)),
            displacement: N::splat(simd, share).mul_add(far, N::splat(simd, fixed * (1.0 + 1e-13))),
        }
    }

    /// The point of A that is nearest to B's centre, in A's frame.
    #[inline(always)]
    pub(in crate::measure) fn start<S: Simd>(&self, simd: S) -> V3<N>
    where
        N: Number<S>,
    {
        let away = apply_transposed(&self.rotation, self.translation);
        self.a.project(simd, [-away[0], -away[1], -away[2]])
    }

    /// The bracket at a point of A's frame, and the lanes in which it is as narrow as `tolerance`
    /// (metres), the normals of both sets agree and the distance is above 0.
    #[inline(always)]
    pub(in crate::measure) fn bracket<S: Simd>(
        &self,
        simd: S,
        own: V3<N>,
        tolerance: f64,
    ) -> (PairView<N>, LaneBracket<N>, N::Mask)
    where
        N: Number<S>,
    {
        let splat = |value: f64| N::splat(simd, value);
        let x = self.placed(own);
        let seen = self.b.offset(simd, x);
        let distance = seen.distance;
        let reach = splat(self.a.reach() + self.b.reach());
        let size = x[0].abs() + x[1].abs() + x[2].abs() + splat(2.0) * reach;
        let rounding = splat(TAYLOR_ROUNDING).mul_add(size, self.displacement);
        let (n, apart) = self.plane(simd, own, &seen);
        let (lower, upper) = (apart - rounding, distance + rounding);
        let gradient = scaled(apply_transposed(&self.rotation, seen.frame[2]), distance);
        let off = scaled(subtract(seen.frame[2], n), distance);
        let slide = self.a.slide(simd, own, scaled(gradient, splat(-1.0)));
        // Far away the places count, not the angle; at short distances rounding allows no better
        // direction.
        let floor = splat(2.0 * f64::EPSILON) * (reach + distance);
        let enough = (splat(FINELY_ALIGNED) * distance.min(reach)).max(floor);
        let level = (splat(LEVEL_SLOPE) * distance).max(floor).min(enough);
        let is_aligned = N::and(simd, dot(off, off).le(enough * enough), dot(slide, slide).le(level * level));
        let is_narrow = N::and(simd, lower.le(upper), (upper - lower).le(splat(tolerance)));
        let is_apart = splat(f64::MIN_POSITIVE).le(lower);
        let is_proven = N::and(simd, is_aligned, N::and(simd, is_narrow, is_apart));
        let nearest = self.b.project(simd, x);
        // Multipliers of shapes follow from the normal.
        let found = LaneBracket { lower, upper, x, nearest, n, multiplier: splat(0.0) };
        (PairView { own, seen, gradient, rounding }, found, is_proven)
    }

    /// Where Newton's step leads in A's frame, and the lanes in which it leads on: not where the
    /// sets may touch, nor where rounding is wider than the tolerance, metres.
    #[inline(always)]
    pub(in crate::measure) fn step<S: Simd>(&self, simd: S, at: &PairView<N>, tolerance: f64) -> (V3<N>, N::Mask)
    where
        N: Vector<S>,
    {
        let PairView { own, seen, gradient, rounding } = at;
        let can_be_narrow = (*rounding + *rounding).le(N::splat(simd, tolerance));
        let open = N::and(simd, rounding.le(seen.distance), can_be_narrow);
        let farthest = seen.distance * N::splat(simd, 1.0 + LEVEL);
        let mut next = self.a.least(simd, *own, *gradient, &self.hessian(simd, seen));
        let mut leads_on = self.distance(simd, next).le(farthest);
        for _ in 0..MOST_CUTS {
            if N::bits(simd, open) & !N::bits(simd, leads_on) == 0 {
                break;
            }
            let cut = self.cut(simd, *own, next);
            for i in 0..3 {
                next[i] = next[i].select(leads_on, cut[i]);
            }
            leads_on = self.distance(simd, next).le(farthest);
        }
        (next, N::and(simd, open, leads_on))
    }

    /// About the point between two of A's frame that is nearest to B, from the second one on.
    #[inline(always)]
    fn cut<S: Simd>(&self, simd: S, from: V3<N>, to: V3<N>) -> V3<N>
    where
        N: Number<S>,
    {
        let seen = self.b.offset(simd, self.placed(to));
        let way = subtract(to, from);
        let share = share_of_step(simd, (&seen.frame, seen.curvature, seen.distance), apply(&self.rotation, way));
        add_scaled(from, share, way)
    }

    /// A point of A's frame in B's.
    #[inline(always)]
    fn placed<S: Simd>(&self, own: V3<N>) -> V3<N>
    where
        N: Number<S>,
    {
        add(self.translation, apply(&self.rotation, own))
    }

    /// Distance of a point of A's frame from B.
    #[inline(always)]
    fn distance<S: Simd>(&self, simd: S, own: V3<N>) -> N
    where
        N: Number<S>,
    {
        let x = self.placed(own);
        let v = subtract(x, self.b.project(simd, x));
        dot(v, v).sqrt()
    }

    /// How far a plane across n keeps the sets apart.
    #[inline(always)]
    fn along<S: Simd>(&self, simd: S, n: V3<N>) -> N
    where
        N: Number<S>,
    {
        let own = apply_transposed(&self.rotation, n);
        dot(n, self.translation) - self.a.height(simd, own) - self.b.height(simd, n)
    }

    /// The normal from B to A, of those that touch the features of B and of A, whose plane keeps
    /// the sets farther apart, and how far that is.
    #[inline(always)]
    fn plane<S: Simd>(&self, simd: S, own: V3<N>, seen: &LaneOffset<N>) -> (V3<N>, N)
    where
        N: Number<S>,
    {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let (n, of_b, of_a) = (seen.frame[2], seen.cone, self.a.cone_at(simd, own));
        let first = self.b.in_normal_cone(simd, of_b, n);
        let outward = self.a.in_normal_cone(simd, of_a, apply_transposed(&self.rotation, first));
        let mut second = apply(&self.rotation, outward);
        // Normals of edges and walls span two coordinates: the third one is along them.
        let line = |cone: V3<N>| [one - cone[0], one - cone[1], one - cone[2]];
        let is_line = |cone: V3<N>| (cone[0] + cone[1] + cone[2] - N::splat(simd, 2.0)).abs().le(zero);
        let (a, b) = (apply(&self.rotation, line(of_a)), line(of_b));
        let across = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
        let square = dot(across, across);
        let is_crossed = N::and(simd, N::and(simd, is_line(of_a), is_line(of_b)), N::splat(simd, CROSSED).le(square));
        let inverse = one / square.sqrt();
        let across = scaled(across, inverse.select(zero.le(dot(across, n)), -inverse));
        for i in 0..3 {
            second[i] = across[i].select(is_crossed, second[i]);
        }
        let (by_first, by_second) = (self.along(simd, first), self.along(simd, second));
        let is_second = by_first.le(by_second);
        let mut n = first;
        for i in 0..3 {
            n[i] = second[i].select(is_second, first[i]);
        }
        (n, by_second.select(is_second, by_first))
    }

    /// `n nᵀ + D T K Tᵀ` in A's frame, D the distance.
    #[inline(always)]
    fn hessian<S: Simd>(&self, simd: S, seen: &LaneOffset<N>) -> [N; 6]
    where
        N: Number<S>,
    {
        let k = scaled(seen.curvature, seen.distance);
        let turned = |v: V3<N>| apply_transposed(&self.rotation, v);
        let [t0, t1, n] = [turned(seen.frame[0]), turned(seen.frame[1]), turned(seen.frame[2])];
        let (b0, b1) = (add(scaled(t0, k[0]), scaled(t1, k[1])), add(scaled(t0, k[1]), scaled(t1, k[2])));
        let entry = |i: usize, j: usize| b1[i].mul_add(t1[j], b0[i].mul_add(t0[j], n[i] * n[j]));
        let flat = N::splat(simd, FLAT);
        [entry(0, 0) + flat, entry(0, 1), entry(0, 2), entry(1, 1) + flat, entry(1, 2), entry(2, 2) + flat]
    }
}
