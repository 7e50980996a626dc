//! Support points of smooth surfaces, from an outline: mostly by one or two evaluations.
//!
//! The point z of a body farthest along e (both in normalized coordinates, `e·z = n·x`) has `λ ∇g(z) = e`, `g(z) = 1`. Newton's
//! step for the two,
//!
//! ```text
//! λ' = (g·H⁻¹e - λ (1 - g(z))) / (g·H⁻¹g),   dz = (H⁻¹e - λ' H⁻¹g) / λ
//! ```
//!
//! leaves an error of the order of its square, and what that costs along e is of the square again. Taylor's formula proves how
//! far the end of the last step is from the best, and a point of the body beside it.

use crate::body::Body;
use crate::measure::tangent::Side;
use crate::measure::vector::{
    V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, rows, scaled,
};
use crate::polynomial::{NumberJet, Simd, WithSimd};
use nalgebra::Vector3;

/// The point of a body farthest along n within the tolerance, as work for the widest arithmetic.
pub(super) struct Farthest<'a> {
    pub(super) body: &'a Body,
    /// Unit vector, body frame.
    pub(super) n: Vector3<f64>,
    /// What it may lack, metres.
    pub(super) tolerance: f64,
}

/// Most evaluations.
const MAX_ROUNDS: u32 = 4;

impl WithSimd for Farthest<'_> {
    type Output = Option<(Vector3<f64>, usize)>;

    /// A point within whose displacement (the rounding of its normalized coordinates) a point of the body is proven to lie,
    /// from the centre of the normalization on, body frame, metres, and the active constraint; none where Newton's method does
    /// not arrive.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<(Vector3<f64>, usize)> {
        let Self { body, n, tolerance } = self;
        let n: V3<f64> = n.into();
        let cell = body.outline().cell(simd, n);
        let active = body.outline().active(cell.place);
        let side = Side::at_home(simd, body, active);
        let inverse = rows(simd, body.inverse());
        let e = apply_transposed::<S, f64>(&inverse, n);
        let mut x = add::<S, f64>(cell.point, apply_symmetric::<S, f64>(&cell.turn, n));
        let axes = side.localize(simd, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        for _ in 0..MAX_ROUNDS {
            let (jet, inside) = side.jet(simd, x);
            if !inside {
                return None;
            }
            let dx = apply::<S, f64>(&inverse, step(simd, &jet, e)?);
            let next = side.extrapolate(simd, &jet, &axes, dx);
            if let Some(inward) = side.inward(simd, &next)
                && side.lack(simd, &next, n) - dot::<S, f64>(n, inward) <= tolerance
            {
                let x = add::<S, f64>(add::<S, f64>(x, dx), inward);
                return side.others_hold(simd, x).then(|| (x.into(), active));
            }
            x = add::<S, f64>(x, dx);
        }
        None
    }
}

/// Newton's step from a point near the surface; none if its normal has nothing to do with e.
#[inline(always)]
fn step<S: Simd>(simd: S, jet: &NumberJet<f64>, e: V3<f64>) -> Option<V3<f64>> {
    let g = jet.gradient;
    let (square, along) = (dot::<S, f64>(g, g), dot::<S, f64>(g, e));
    let (cofactors, determinant) = cofactors(simd, jet.hessian);
    let (of_e, of_g) = (apply_symmetric::<S, f64>(&cofactors, e), apply_symmetric::<S, f64>(&cofactors, g));
    let multiplier = along / square;
    let missing = determinant * (1.0 - jet.value);
    let next = (dot::<S, f64>(g, of_e) - multiplier * missing) / dot::<S, f64>(g, of_g);
    let dz = scaled::<S, f64>(add_scaled::<S, f64>(of_e, -next, of_g), 1.0 / (multiplier * determinant));
    let bend = 0.5 * dot::<S, f64>(dz, apply_symmetric::<S, f64>(&jet.hessian, dz));
    // The surface bends away from the tangent plane by as much.
    let dz = add_scaled::<S, f64>(dz, -bend / square, g);
    let finite = along > 0.0 && next > 0.0 && dot::<S, f64>(dz, dz) < LONGEST * LONGEST;
    finite.then_some(dz)
}

/// Longest step, in normalized coordinates, that the linearization may mean anything for.
const LONGEST: f64 = 0.5;
