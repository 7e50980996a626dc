//! The box.

use super::projectable::{ON, Offset, Projectable};
use crate::measure::frames::vector::{V3, add, basis, dot, normalized, scaled, subtract};
use crate::polynomial::{Number, Simd};

/// `|y_i| <= half_extents[i]`, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Cuboid {
    pub(in crate::measure) half_extents: V3<f64>,
}

/// Most coordinates of a quadratic's minimiser that are found one after the other to lie on faces.
pub(super) const ROUNDS: usize = 4;

/// Least pivot that a vector is divided by: small enough that a step along what is flat but not
/// level leaves every body, and large enough that its square is finite.
pub(super) const FLATTEST: f64 = 1e-100;

impl Projectable for Cuboid {
    #[inline(always)]
    fn project<S: Simd>(&self, _: S, x: V3<f64>) -> V3<f64> {
        let h = self.half_extents;
        [x[0].max(-h[0]).min(h[0]), x[1].max(-h[1]).min(h[1]), x[2].max(-h[2]).min(h[2])]
    }

    /// Features are numbered by the axes that a point lies beyond, a bit each.
    #[inline(always)]
    fn offset<S: Simd>(&self, simd: S, x: V3<f64>) -> Offset {
        let nearest = self.project(simd, x);
        let v = subtract::<S, f64>(x, nearest);
        let distance = dot::<S, f64>(v, v).sqrt();
        let frame = basis(simd, v);
        let inverse = 1.0 / distance;
        let beyond = |i: usize| if v[i] == 0.0 { 0.0 } else { inverse };
        let bent = [beyond(0), beyond(1), beyond(2)];
        let curvature = |a: V3<f64>, b: V3<f64>| dot::<S, f64>([a[0] * bent[0], a[1] * bent[1], a[2] * bent[2]], b);
        let [t0, t1, _] = frame;
        Offset {
            distance,
            frame,
            curvature: [curvature(t0, t0), curvature(t0, t1), curvature(t1, t1)],
            feature: u8::from(v[0] != 0.0) | u8::from(v[1] != 0.0) << 1 | u8::from(v[2] != 0.0) << 2,
        }
    }

    #[inline(always)]
    fn height<S: Simd>(&self, _: S, n: V3<f64>) -> f64 {
        dot::<S, f64>(self.half_extents, n.map(f64::abs))
    }

    #[inline(always)]
    fn in_normal_cone<S: Simd>(&self, simd: S, feature: u8, n: V3<f64>) -> V3<f64> {
        let part = |i: usize| if feature >> i & 1 == 1 { n[i] } else { 0.0 };
        normalized(simd, [part(0), part(1), part(2)])
    }

    #[inline(always)]
    fn feature_at<S: Simd>(&self, _: S, y: V3<f64>) -> u8 {
        let on = |i: usize| u8::from(y[i].abs() >= self.half_extents[i] * ON) << i;
        on(0) | on(1) | on(2)
    }

    #[inline(always)]
    fn slide<S: Simd>(&self, _: S, y: V3<f64>, pull: V3<f64>) -> f64 {
        let off = |i: usize| {
            let held = y[i].abs() >= self.half_extents[i] * ON && y[i] * pull[i] >= 0.0;
            if held { 0.0 } else { pull[i] }
        };
        let off = [off(0), off(1), off(2)];
        dot::<S, f64>(off, off).sqrt()
    }

    #[inline(always)]
    fn line<S: Simd>(&self, _: S, feature: u8) -> Option<V3<f64>> {
        match feature {
            0b011 => Some([0.0, 0.0, 1.0]),
            0b101 => Some([0.0, 1.0, 0.0]),
            0b110 => Some([1.0, 0.0, 0.0]),
            _ => None,
        }
    }

    fn thinnest(&self) -> f64 {
        self.half_extents[0].min(self.half_extents[1]).min(self.half_extents[2])
    }

    #[inline(always)]
    fn shrunk(&self, by: f64) -> Self {
        Self { half_extents: self.half_extents.map(|half| (half - by).max(0.0)) }
    }

    #[inline(always)]
    fn faces_towards<S: Simd>(&self, _: S, x: V3<f64>) -> ([V3<f64>; 3], usize) {
        let (mut normals, mut count) = ([[0.0; 3]; 3], 0);
        for i in 0..3 {
            if x[i].abs() > self.half_extents[i] {
                normals[count][i] = 1_f64.copysign(x[i]);
                count += 1;
            }
        }
        (normals, count)
    }

    /// Coordinates that the quadratic's minimiser leads beyond a face are fixed there, the farthest
    /// first.
    #[inline(always)]
    fn least<S: Simd>(&self, simd: S, y: V3<f64>, gradient: V3<f64>, hessian: &[f64; 6]) -> V3<f64> {
        let h = self.half_extents;
        let [xx, xy, xz, yy, yz, zz] = *hessian;
        let rows = [[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]];
        let mut step = [0.0; 3];
        let mut fixed = [false; 3];
        for i in 0..3 {
            fixed[i] = y[i].abs() >= h[i] && gradient[i] * y[i] < 0.0;
        }
        for _ in 0..ROUNDS {
            let (mut matrix, mut right) = (rows, scaled::<S, f64>(gradient, -1.0));
            for i in (0..3).filter(|&i| fixed[i]) {
                for j in 0..3 {
                    right[j] -= rows[j][i] * step[i];
                    (matrix[i][j], matrix[j][i]) = (0.0, 0.0);
                }
                matrix[i][i] = 1.0;
            }
            for i in (0..3).filter(|&i| fixed[i]) {
                right[i] = step[i];
            }
            let free = solve(simd, &matrix, right);
            // The first face on the way.
            let (mut first, mut share) = (None, 1.0);
            for i in (0..3).filter(|&i| !fixed[i]) {
                let to = y[i] + free[i];
                if to.abs() > h[i] {
                    let part = (h[i].copysign(to) - y[i]) / free[i];
                    if first.is_none() || part < share {
                        (first, share) = (Some(i), part);
                    }
                }
            }
            for i in (0..3).filter(|&i| !fixed[i]) {
                step[i] = free[i];
            }
            let Some(i) = first else { break };
            step[i] = h[i].copysign(y[i] + free[i]) - y[i];
            fixed[i] = true;
        }
        self.project(simd, add::<S, f64>(y, step))
    }

    #[inline(always)]
    fn reach(&self) -> f64 {
        let h = self.half_extents;
        (h[0] * h[0] + h[1] * h[1] + h[2] * h[2]).sqrt()
    }
}

/// `M⁻¹ v` of a symmetric matrix by its rows: by its factors `L D Lᵀ`, which lose no more than
/// rounding where M is nearly singular along some directions. Pivots count by their amount, and at
/// least [`FLATTEST`]: M is semidefinite up to rounding, and so the solution descends.
#[inline(always)]
pub(super) fn solve<S: Simd, N: Number<S>>(simd: S, m: &[V3<N>; 3], v: V3<N>) -> V3<N> {
    let (one, flattest) = (N::splat(simd, 1.0), N::splat(simd, FLATTEST));
    let inverse = |pivot: N| one / pivot.abs().max(flattest);
    let first = inverse(m[0][0]);
    let (l10, l20) = (m[1][0] * first, m[2][0] * first);
    let second = inverse(m[1][1] - l10 * m[1][0]);
    let below = m[2][1] - l20 * m[1][0];
    let l21 = below * second;
    let third = inverse(m[2][2] - l20 * m[2][0] - l21 * below);
    let y1 = v[1] - l10 * v[0];
    let z = (v[2] - l20 * v[0] - l21 * y1) * third;
    let y = y1 * second - l21 * z;
    [v[0] * first - l10 * y - l20 * z, y, z]
}
