//! Boxes, cylinders and segments as several points see them at once.

use crate::measure::frames::vector::{M3, V3, basis, dot, normalized, subtract};
use crate::measure::solver::exact_shape::cuboid::Cuboid;
use crate::measure::solver::exact_shape::cylinder::Cylinder;
use crate::measure::solver::exact_shape::segment::Segment;
use crate::measure::solver::tangent_newton::Symmetric2;
use crate::polynomial::{Number, Simd};

/// Where a point is as seen from a set; see [`super::super::projectable::Offset`].
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LaneOffset<N> {
    /// Distance, metres; 0 inside, where the rest is not a number.
    pub(in crate::measure) distance: N,
    /// Tangents and outward unit normal, by rows.
    pub(in crate::measure) frame: M3<N>,
    /// Curvature of the offset surface along the tangents, 1/m.
    pub(in crate::measure) curvature: Symmetric2<N>,
    /// Which coordinates the normals of the nearest face, edge or corner span: 1, else 0.
    pub(in crate::measure) cone: V3<N>,
}

impl<N: Copy> LaneOffset<N> {
    /// The lanes in which both see another face, edge or corner.
    #[inline(always)]
    pub(super) fn sees_another<S: Simd>(&self, simd: S, other: &Self) -> N::Mask
    where
        N: Number<S>,
    {
        let [a, b, c] = subtract(self.cone, other.cone);
        N::splat(simd, 0.5).le(a.abs() + b.abs() + c.abs())
    }
}

/// A convex set about the origin of its frame, metres: the part of
/// [`super::super::projectable::Projectable`] that lanes take.
pub(in crate::measure) trait LaneSet: Copy {
    /// Nearest point of the set.
    fn project<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> V3<N>;

    /// Where a point is as seen from the set.
    fn offset<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> LaneOffset<N>;

    /// Support function: the largest `n·y` over the set.
    fn height<S: Simd, N: Number<S>>(&self, simd: S, n: V3<N>) -> N;

    /// Radius of the ball about the origin that contains the set.
    fn reach(&self) -> f64;

    /// The part of a vector that the normals of a face, edge or corner span, of length 1.
    #[inline(always)]
    fn in_normal_cone<S: Simd, N: Number<S>>(&self, simd: S, cone: V3<N>, n: V3<N>) -> V3<N> {
        normalized(simd, [cone[0] * n[0], cone[1] * n[1], cone[2] * n[2]])
    }
}

impl LaneSet for Cuboid {
    #[inline(always)]
    fn project<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> V3<N> {
        let mut nearest = x;
        for (entry, half) in nearest.iter_mut().zip(self.half_extents) {
            let half = N::splat(simd, half);
            *entry = entry.max(-half).min(half);
        }
        nearest
    }

    #[inline(always)]
    fn offset<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> LaneOffset<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let v = subtract(x, LaneSet::project(self, simd, x));
        let distance = dot(v, v).sqrt();
        let frame = basis(simd, v);
        let inverse = one / distance;
        let mut cone = [one; 3];
        for (entry, off) in cone.iter_mut().zip(v) {
            *entry = zero.select(off.abs().le(zero), one);
        }
        let bent = [cone[0] * inverse, cone[1] * inverse, cone[2] * inverse];
        let [t0, t1, _] = frame;
        let (b0, b1) =
            ([t0[0] * bent[0], t0[1] * bent[1], t0[2] * bent[2]], [t1[0] * bent[0], t1[1] * bent[1], t1[2] * bent[2]]);
        LaneOffset { distance, frame, curvature: [dot(b0, t0), dot(b0, t1), dot(b1, t1)], cone }
    }

    #[inline(always)]
    fn height<S: Simd, N: Number<S>>(&self, simd: S, n: V3<N>) -> N {
        let [x, y, z] = self.half_extents;
        let half = [N::splat(simd, x), N::splat(simd, y), N::splat(simd, z)];
        dot(half, [n[0].abs(), n[1].abs(), n[2].abs()])
    }

    fn reach(&self) -> f64 {
        self.half_extents.iter().map(|half| half * half).sum::<f64>().sqrt()
    }
}

impl LaneSet for Cylinder {
    #[inline(always)]
    fn project<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> V3<N> {
        let (radius, half) = (N::splat(simd, self.radius), N::splat(simd, self.half_height));
        let rho = x[1].mul_add(x[1], x[0] * x[0]).sqrt();
        let share = radius / rho.max(radius);
        [x[0] * share, x[1] * share, x[2].max(-half).min(half)]
    }

    #[inline(always)]
    fn offset<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> LaneOffset<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let rho = x[1].mul_add(x[1], x[0] * x[0]).sqrt();
        let on_axis = rho.le(zero);
        let inverse_rho = zero.select(on_axis, one / rho);
        let u = [one.select(on_axis, x[0] * inverse_rho), zero.select(on_axis, x[1] * inverse_rho)];
        let beside = (rho - N::splat(simd, self.radius)).max(zero);
        let above = (x[2].abs() - N::splat(simd, self.half_height)).max(zero);
        let distance = above.mul_add(above, beside * beside).sqrt();
        let inverse = one / distance;
        let (n_r, n_z) = (beside * inverse, above.select(zero.le(x[2]), -above) * inverse);
        let (wall, cap) = (zero.select(beside.le(zero), one), zero.select(above.le(zero), one));
        LaneOffset {
            distance,
            frame: [[-u[1], u[0], zero], [-(n_z * u[0]), -(n_z * u[1]), n_r], [n_r * u[0], n_r * u[1], n_z]],
            curvature: [n_r * inverse_rho, zero, wall * cap * inverse],
            cone: [wall, wall, cap],
        }
    }

    #[inline(always)]
    fn height<S: Simd, N: Number<S>>(&self, simd: S, n: V3<N>) -> N {
        let around = n[1].mul_add(n[1], n[0] * n[0]).sqrt();
        N::splat(simd, self.radius).mul_add(around, N::splat(simd, self.half_height) * n[2].abs())
    }

    fn reach(&self) -> f64 {
        self.radius.hypot(self.half_height)
    }
}

impl LaneSet for Segment {
    #[inline(always)]
    fn project<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> V3<N> {
        let (zero, half) = (N::splat(simd, 0.0), N::splat(simd, self.half_length));
        [zero, zero, x[2].max(-half).min(half)]
    }

    #[inline(always)]
    fn offset<S: Simd, N: Number<S>>(&self, simd: S, x: V3<N>) -> LaneOffset<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let v = subtract(x, LaneSet::project(self, simd, x));
        let distance = dot(v, v).sqrt();
        let frame = basis(simd, v);
        let inverse = one / distance;
        // Across the axis alone where the segment is beside.
        let beside = if self.half_length == 0.0 { zero } else { one.select(v[2].abs().le(zero), zero) };
        let bent = beside * inverse;
        let [t0, t1, _] = frame;
        let curvature = [inverse - bent * t0[2] * t0[2], -(bent * t0[2] * t1[2]), inverse - bent * t1[2] * t1[2]];
        LaneOffset { distance, frame, curvature, cone: [one, one, one - beside] }
    }

    #[inline(always)]
    fn height<S: Simd, N: Number<S>>(&self, simd: S, n: V3<N>) -> N {
        N::splat(simd, self.half_length) * n[2].abs()
    }

    fn reach(&self) -> f64 {
        self.half_length
    }
}
