//! The cylinder about the z axis.

use super::cuboid::solve;
use super::projectable::{ON, Offset, Projectable};
use crate::measure::frames::vector::{V3, add, add_scaled, apply_symmetric, dot, scaled};
use crate::polynomial::Simd;

/// `y_0² + y_1² <= radius²`, `|y_2| <= half_height`, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Cylinder {
    pub(in crate::measure) radius: f64,
    pub(in crate::measure) half_height: f64,
}

/// Beside the wall.
const WALL: u8 = 1;

/// Above or below a cap.
const CAP: u8 = 2;

impl Cylinder {
    /// The same from a point of the wall with this outward normal, along the wall. It bends towards
    /// the gradient, which adds to the curvature around it.
    #[inline(always)]
    fn least_on_wall<S: Simd>(
        &self,
        simd: S,
        y: V3<f64>,
        u: V3<f64>,
        gradient: V3<f64>,
        hessian: &[f64; 6],
    ) -> V3<f64> {
        let (r, h) = (self.radius, self.half_height);
        let around = [-u[1], u[0], 0.0];
        let outwards = dot::<S, f64>(gradient, u);
        let bent = apply_symmetric::<S, f64>(hessian, around);
        let (slope, stiff) = (dot::<S, f64>(gradient, around), dot::<S, f64>(bent, around) - outwards / r);
        let (mut turn, mut rise) = (-slope / stiff, 0.0);
        let on_cap = y[2].abs() >= h * ON && gradient[2] * y[2] < 0.0;
        if !on_cap {
            let mixed = bent[2];
            let matrix = [[stiff, mixed, 0.0], [mixed, hessian[5], 0.0], [0.0; 3]];
            [turn, rise, _] = solve(simd, &matrix, [-slope, -gradient[2], 0.0]);
            let to = y[2] + rise;
            if to.abs() > h {
                rise = h.copysign(to) - y[2];
                turn = -(slope + mixed * rise) / stiff;
            }
        }
        let v = add_scaled::<S, f64>(u, (turn / r).clamp(-1.0, 1.0), around);
        let length = r / dot::<S, f64>(v, v).sqrt();
        [v[0] * length, v[1] * length, (y[2] + rise).max(-h).min(h)]
    }
}

impl Projectable for Cylinder {
    #[inline(always)]
    fn project<S: Simd>(&self, _: S, x: V3<f64>) -> V3<f64> {
        let rho = (x[0] * x[0] + x[1] * x[1]).sqrt();
        let share = if rho > self.radius { self.radius / rho } else { 1.0 };
        [x[0] * share, x[1] * share, x[2].max(-self.half_height).min(self.half_height)]
    }

    /// Features: beside the wall, above or below a cap, or both: around a rim.
    #[inline(always)]
    fn offset<S: Simd>(&self, _: S, x: V3<f64>) -> Offset {
        let rho = (x[0] * x[0] + x[1] * x[1]).sqrt();
        let inverse_rho = if rho > 0.0 { 1.0 / rho } else { 0.0 };
        let u = if rho > 0.0 { [x[0] * inverse_rho, x[1] * inverse_rho] } else { [1.0, 0.0] };
        let beside = (rho - self.radius).max(0.0);
        let above = (x[2].abs() - self.half_height).max(0.0);
        let distance = (beside * beside + above * above).sqrt();
        let inverse = 1.0 / distance;
        let (n_r, n_z) = (beside * inverse, above.copysign(x[2]) * inverse);
        let rim = beside > 0.0 && above > 0.0;
        Offset {
            distance,
            frame: [[-u[1], u[0], 0.0], [-n_z * u[0], -n_z * u[1], n_r], [n_r * u[0], n_r * u[1], n_z]],
            curvature: [n_r * inverse_rho, 0.0, if rim { inverse } else { 0.0 }],
            feature: (if beside > 0.0 { WALL } else { 0 }) | (if above > 0.0 { CAP } else { 0 }),
        }
    }

    #[inline(always)]
    fn height<S: Simd>(&self, _: S, n: V3<f64>) -> f64 {
        self.radius * (n[0] * n[0] + n[1] * n[1]).sqrt() + self.half_height * n[2].abs()
    }

    #[inline(always)]
    fn in_normal_cone<S: Simd>(&self, _: S, feature: u8, n: V3<f64>) -> V3<f64> {
        match feature {
            WALL => {
                let inverse = 1.0 / (n[0] * n[0] + n[1] * n[1]).sqrt();
                [n[0] * inverse, n[1] * inverse, 0.0]
            }
            CAP => [0.0, 0.0, 1_f64.copysign(n[2])],
            _ => n,
        }
    }

    #[inline(always)]
    fn feature_at<S: Simd>(&self, _: S, y: V3<f64>) -> u8 {
        let wall = (y[0] * y[0] + y[1] * y[1]).sqrt() >= self.radius * ON;
        (if wall { WALL } else { 0 }) | (if y[2].abs() >= self.half_height * ON { CAP } else { 0 })
    }

    #[inline(always)]
    fn slide<S: Simd>(&self, _: S, y: V3<f64>, pull: V3<f64>) -> f64 {
        let rho = (y[0] * y[0] + y[1] * y[1]).sqrt();
        let u = if rho > 0.0 { [y[0] / rho, y[1] / rho] } else { [1.0, 0.0] };
        let (outwards, around) = (u[0] * pull[0] + u[1] * pull[1], u[0] * pull[1] - u[1] * pull[0]);
        let wall = rho >= self.radius * ON && outwards >= 0.0;
        let cap = y[2].abs() >= self.half_height * ON && y[2] * pull[2] >= 0.0;
        let off = [if wall { 0.0 } else { outwards }, around, if cap { 0.0 } else { pull[2] }];
        dot::<S, f64>(off, off).sqrt()
    }

    #[inline(always)]
    fn line<S: Simd>(&self, _: S, feature: u8) -> Option<V3<f64>> {
        (feature == WALL).then_some([0.0, 0.0, 1.0])
    }

    fn thinnest(&self) -> f64 {
        self.radius.min(self.half_height)
    }

    #[inline(always)]
    fn shrunk(&self, by: f64) -> Self {
        Self { radius: (self.radius - by).max(0.0), half_height: (self.half_height - by).max(0.0) }
    }

    #[inline(always)]
    fn faces_towards<S: Simd>(&self, _: S, x: V3<f64>) -> ([V3<f64>; 3], usize) {
        let (mut normals, mut count) = ([[0.0; 3]; 3], 0);
        let rho = (x[0] * x[0] + x[1] * x[1]).sqrt();
        if rho > self.radius {
            normals[0] = [x[0] / rho, x[1] / rho, 0.0];
            count = 1;
        }
        if x[2].abs() > self.half_height {
            normals[count] = [0.0, 0.0, 1_f64.copysign(x[2])];
            count += 1;
        }
        (normals, count)
    }

    /// A point from which the quadratic's minimiser leads beyond the wall is moved there first.
    #[inline(always)]
    fn least<S: Simd>(&self, simd: S, y: V3<f64>, gradient: V3<f64>, hessian: &[f64; 6]) -> V3<f64> {
        let (r, h) = (self.radius, self.half_height);
        let rho = (y[0] * y[0] + y[1] * y[1]).sqrt();
        let u = if rho > 0.0 { [y[0] / rho, y[1] / rho, 0.0] } else { [1.0, 0.0, 0.0] };
        if rho >= r * ON && dot::<S, f64>(gradient, u) < 0.0 {
            return self.least_on_wall(simd, y, u, gradient, hessian);
        }
        let on_cap = y[2].abs() >= h * ON && gradient[2] * y[2] < 0.0;
        let [xx, xy, xz, yy, yz, zz] = *hessian;
        let matrix =
            if on_cap { [[xx, xy, 0.0], [xy, yy, 0.0], [0.0; 3]] } else { [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]] };
        let step = solve(simd, &matrix, scaled::<S, f64>(gradient, -1.0));
        let to = add::<S, f64>(y, step);
        if to[0] * to[0] + to[1] * to[1] > r * r {
            let bent = add::<S, f64>(gradient, scaled::<S, f64>(apply_symmetric::<S, f64>(hessian, u), r - rho));
            if dot::<S, f64>(bent, u) < 0.0 {
                return self.least_on_wall(simd, [u[0] * r, u[1] * r, y[2]], u, bent, hessian);
            }
        }
        self.project(simd, to)
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        (self.radius * self.radius + self.half_height * self.half_height).sqrt()
    }
}
