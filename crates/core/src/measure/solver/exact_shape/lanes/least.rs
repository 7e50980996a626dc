//! The least value of a convex quadratic over a box or a cylinder, in lanes; derived in
//! [`super::super::cuboid`] and [`super::super::cylinder`].

use super::set::LaneSet;
use crate::measure::frames::vector::{V3, add, add_scaled, apply_symmetric, dot};
use crate::measure::solver::exact_shape::cuboid::{Cuboid, FLATTEST, ROUNDS, solve};
use crate::measure::solver::exact_shape::cylinder::Cylinder;
use crate::measure::solver::exact_shape::projectable::ON;
use crate::polynomial::{Number, Simd, Vector};

/// A convex set whose points lanes search; see [`super::super::projectable::Projectable`].
pub(in crate::measure) trait LaneLeast: LaneSet {
    /// Which coordinates the normals at a point of the set span: 1, else 0, as of
    /// [`super::LaneOffset`]; none inside.
    fn cone_at<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>) -> V3<N>;

    /// The part of a vector that pulls a point of the set along it, and not off it, along axes that
    /// differ from set to set: its length counts, 0 for an outward normal there.
    fn slide<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>, pull: V3<N>) -> V3<N>;

    /// About the point of the set where a convex function is least that has this gradient and
    /// Hessian (xx, xy, xz, yy, yz, zz) at the point y of the set.
    fn least<S: Simd, N: Vector<S>>(&self, simd: S, y: V3<N>, gradient: V3<N>, hessian: &[N; 6]) -> V3<N>;
}

/// 1, and 0 where a coordinate at or beyond a bound is pulled farther out.
#[inline(always)]
fn freedom<S: Simd, N: Number<S>>(simd: S, (y, bound): (N, N), gradient: N) -> N {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    one.select(zero.le(gradient * y), zero.select(bound.le(y.abs()), one))
}

impl LaneLeast for Cuboid {
    #[inline(always)]
    fn cone_at<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>) -> V3<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let on = |i: usize| one.select(N::splat(simd, self.half_extents[i] * ON).le(y[i].abs()), zero);
        [on(0), on(1), on(2)]
    }

    #[inline(always)]
    fn slide<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>, pull: V3<N>) -> V3<N> {
        let zero = N::splat(simd, 0.0);
        let off = |i: usize| {
            let on = N::splat(simd, self.half_extents[i] * ON).le(y[i].abs());
            zero.select(N::and(simd, on, zero.le(y[i] * pull[i])), pull[i])
        };
        [off(0), off(1), off(2)]
    }

    /// Coordinates that the quadratic's minimiser leads beyond a face are fixed there, the first
    /// one on the way first. A round more changes nothing in a lane that needs none.
    #[inline(always)]
    fn least<S: Simd, N: Vector<S>>(&self, simd: S, y: V3<N>, gradient: V3<N>, hessian: &[N; 6]) -> V3<N> {
        let (zero, one, two) = (N::splat(simd, 0.0), N::splat(simd, 1.0), N::splat(simd, 2.0));
        let half = self.half_extents.map(|half| N::splat(simd, half));
        let [xx, xy, xz, yy, yz, zz] = *hessian;
        let mut free = [one; 3];
        for i in 0..3 {
            free[i] = freedom(simd, (y[i], half[i]), gradient[i]);
        }
        let mut step = [zero; 3];
        for _ in 0..ROUNDS {
            let [fx, fy, fz] = free;
            let (ix, iy, iz) = (one - fx, one - fy, one - fz);
            let held = [ix * step[0], iy * step[1], iz * step[2]];
            let pull = add(gradient, apply_symmetric(hessian, held));
            let right = [held[0] - fx * pull[0], held[1] - fy * pull[1], held[2] - fz * pull[2]];
            let (xy, xz, yz) = (xy * fx * fy, xz * fx * fz, yz * fy * fz);
            let matrix = [[xx * fx + ix, xy, xz], [xy, yy * fy + iy, yz], [xz, yz, zz * fz + iz]];
            step = solve(simd, &matrix, right);
            // The share of each coordinate's step to its face; 2 where it does not lead beyond.
            let (mut to_face, mut share) = ([zero; 3], [two; 3]);
            for i in 0..3 {
                let to = y[i] + step[i];
                to_face[i] = half[i].select(zero.le(to), -half[i]) - y[i];
                let is_within = (free[i] * (to.abs() - half[i])).le(zero);
                share[i] = two.select(is_within, to_face[i] / step[i]);
            }
            let first = share[0].min(share[1]).min(share[2]);
            let is_beyond = first.le(N::splat(simd, 1.5));
            if N::bits(simd, is_beyond) == 0 {
                break;
            }
            for i in 0..3 {
                let is_first = N::and(simd, is_beyond, share[i].le(first));
                step[i] = to_face[i].select(is_first, step[i]);
                free[i] = zero.select(is_first, free[i]);
            }
        }
        LaneSet::project(self, simd, add(y, step))
    }
}

/// Distance of a point from the z axis, and the direction from there to it; any on the axis.
#[inline(always)]
fn around<S: Simd, N: Number<S>>(simd: S, y: V3<N>) -> (N, V3<N>) {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let rho = y[1].mul_add(y[1], y[0] * y[0]).sqrt();
    let is_on_axis = rho.le(zero);
    let inverse = one / rho;
    (rho, [one.select(is_on_axis, y[0] * inverse), zero.select(is_on_axis, y[1] * inverse), zero])
}

impl Cylinder {
    /// Where a quadratic is least from a point of the wall with this outward normal on, along the
    /// wall, which bends towards the gradient.
    #[inline(always)]
    fn least_along_wall<S: Simd, N: Number<S>>(
        &self,
        simd: S,
        (u, height): (V3<N>, N),
        gradient: V3<N>,
        hessian: &[N; 6],
    ) -> V3<N> {
        let (zero, one, flattest) = (N::splat(simd, 0.0), N::splat(simd, 1.0), N::splat(simd, FLATTEST));
        let (radius, half) = (N::splat(simd, self.radius), N::splat(simd, self.half_height));
        let tangent = [-u[1], u[0], zero];
        let bent = apply_symmetric(hessian, tangent);
        let (slope, mixed) = (dot(gradient, tangent), bent[2]);
        let stiff = dot(bent, tangent) - dot(gradient, u) / radius;
        let inverse = one / stiff.abs().max(flattest);
        let free = freedom(simd, (height, N::splat(simd, self.half_height * ON)), gradient[2]);
        let coupled = mixed * free;
        let pivot = hessian[5] * free + (one - free) - coupled * coupled * inverse;
        let rise = (slope * coupled * inverse - gradient[2] * free) / pivot.abs().max(flattest);
        let to = (height + rise).max(-half).min(half);
        let turn = -((to - height).mul_add(mixed, slope) * inverse) / radius;
        let v = add_scaled(u, turn.max(-one).min(one), tangent);
        let length = radius / dot(v, v).sqrt();
        [v[0] * length, v[1] * length, to]
    }
}

impl LaneLeast for Cylinder {
    #[inline(always)]
    fn cone_at<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>) -> V3<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let rho = y[1].mul_add(y[1], y[0] * y[0]).sqrt();
        let wall = one.select(N::splat(simd, self.radius * ON).le(rho), zero);
        [wall, wall, one.select(N::splat(simd, self.half_height * ON).le(y[2].abs()), zero)]
    }

    #[inline(always)]
    fn slide<S: Simd, N: Number<S>>(&self, simd: S, y: V3<N>, pull: V3<N>) -> V3<N> {
        let zero = N::splat(simd, 0.0);
        let (rho, u) = around(simd, y);
        let (outwards, along) = (u[0] * pull[0] + u[1] * pull[1], u[0] * pull[1] - u[1] * pull[0]);
        let wall = N::and(simd, N::splat(simd, self.radius * ON).le(rho), zero.le(outwards));
        let on_cap = N::splat(simd, self.half_height * ON).le(y[2].abs());
        let cap = N::and(simd, on_cap, zero.le(y[2] * pull[2]));
        [zero.select(wall, outwards), along, zero.select(cap, pull[2])]
    }

    /// Points on the wall that are pulled outwards stay there, and those from which the quadratic's
    /// minimiser leads beyond it are moved there first.
    #[inline(always)]
    fn least<S: Simd, N: Vector<S>>(&self, simd: S, y: V3<N>, gradient: V3<N>, hessian: &[N; 6]) -> V3<N> {
        let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
        let radius = N::splat(simd, self.radius);
        let [xx, xy, xz, yy, yz, zz] = *hessian;
        let (rho, u) = around(simd, y);
        let free = freedom(simd, (y[2], N::splat(simd, self.half_height * ON)), gradient[2]);
        let (xz, yz) = (xz * free, yz * free);
        let matrix = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz * free + (one - free)]];
        let to = add(y, solve(simd, &matrix, [-gradient[0], -gradient[1], -(gradient[2] * free)]));
        let within = LaneSet::project(self, simd, to);
        let on_wall = add_scaled(gradient, radius - rho, apply_symmetric(hessian, u));
        let along = self.least_along_wall(simd, (u, y[2]), on_wall, hessian);
        // 1 off the wall, on it where the pull is inwards, and where the step does not lead beyond
        // it.
        let off = freedom(simd, (rho, N::splat(simd, self.radius * ON)), dot(gradient, u));
        let short = one.select(to[1].mul_add(to[1], to[0] * to[0]).le(radius * radius), zero);
        let is_short = one.le(off * short);
        let is_inwards = zero.le(dot(on_wall, u));
        let mut least = within;
        for i in 0..3 {
            least[i] = within[i].select(is_inwards, within[i].select(is_short, along[i]));
        }
        least
    }
}
