//! Where the ellipsoid that stands for a thin body is nearest to a set with a closed form.
//!
//! Its point is looked for and not its normal. With `x = c + A z`, |z| = 1, `v = x - P x` and J the
//! derivative of v, Newton's method on the sphere for the least `|v|² / 2` has the step s across z
//! with
//!
//! ```text
//! (AᵀJA + μ I) s = -Aᵀv + ν z,    μ = -z·Aᵀv,
//! ```
//!
//! which starts where the way from the centre to the set leaves the ellipsoid: μ is above 0 there.

use super::projectable::Projectable;
use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, normalized, rows, scaled,
};
use crate::measure::solver::tangent_newton::Relative;
use crate::polynomial::{Simd, WithSimd};

/// The search for it, as vectorized work: what is inlined where it is seldom needed makes the rest
/// slower.
pub(super) struct ThinEllipsoid<'a, P> {
    pub(super) set: &'a P,
    pub(super) body: &'a Body,
    pub(super) relative: &'a Relative<f64>,
    /// The set's normal at the body's centre.
    pub(super) n: V3<f64>,
    /// Most steps.
    pub(super) steps: usize,
    /// Square of the step, in normalized coordinates, that is the last one.
    pub(super) small: f64,
}

impl<P: Projectable> WithSimd for ThinEllipsoid<'_, P> {
    /// The ellipsoid's inward normal there, which is the set's.
    type Output = V3<f64>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> V3<f64> {
        let Self { set, body, relative, n, steps, small } = self;
        let linear: M3<f64> = rows(simd, &body.normalization().linear);
        let inverse: M3<f64> = rows(simd, body.inverse());
        let radius = body.outline().radius();
        let mut z = normalized(simd, apply::<S, f64>(&linear, apply_transposed::<S, f64>(&relative.rotation, n)));
        z = scaled::<S, f64>(z, -1.0);
        for _ in 0..steps {
            let out = scaled::<S, f64>(apply::<S, f64>(&inverse, z), radius);
            let out = apply::<S, f64>(&relative.rotation, out);
            let seen = set.offset(simd, add::<S, f64>(relative.origin, out));
            if !(seen.distance > 0.0) {
                break;
            }
            // The set's tangents and normal in normalized coordinates.
            let [t0, t1, m] = seen.frame.map(|t| {
                let own = apply_transposed::<S, f64>(&relative.rotation, t);
                scaled::<S, f64>(apply_transposed::<S, f64>(&inverse, own), radius)
            });
            // Where the ellipsoid reaches through the set there is no nearest point.
            let pull = -dot::<S, f64>(z, m);
            if !(pull > 0.0) {
                break;
            }
            let [k00, k01, k11] = seen.curvature;
            let (b0, b1) = (
                add_scaled::<S, f64>(scaled::<S, f64>(t0, k00), k01, t1),
                add_scaled::<S, f64>(scaled::<S, f64>(t1, k11), k01, t0),
            );
            // Everything over the distance.
            let entry = |i: usize, j: usize| b0[i] * t0[j] + b1[i] * t1[j] + m[i] * m[j] / seen.distance;
            let hessian =
                [entry(0, 0) + pull, entry(0, 1), entry(0, 2), entry(1, 1) + pull, entry(1, 2), entry(2, 2) + pull];
            let (cofactors, determinant) = cofactors(simd, hessian);
            let (of_m, of_z) = (apply_symmetric::<S, f64>(&cofactors, m), apply_symmetric::<S, f64>(&cofactors, z));
            let across = dot::<S, f64>(z, of_m) / dot::<S, f64>(z, of_z);
            let step = scaled::<S, f64>(add_scaled::<S, f64>(of_m, -across, of_z), -1.0 / determinant);
            let square = dot::<S, f64>(step, step);
            if !square.is_finite() {
                break;
            }
            z = normalized(simd, add::<S, f64>(z, step));
            if square < small {
                break;
            }
        }
        let outward = apply::<S, f64>(&relative.rotation, apply_transposed::<S, f64>(&linear, z));
        scaled::<S, f64>(normalized(simd, outward), -1.0)
    }
}
