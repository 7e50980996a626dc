//! Cutting bodies by slabs: pairs of parallel planes between which the object lies.
//!
//! A slab with the unit normal n around points with heights n·x between `m - h` and `m + h` is
//! `l(x)² <= 1`, `l = (n·x - m) / h`. Its Hessian `2 n nᵀ / h²` is singular, and a certificate has
//! to survive rounding; so what is stored is
//!
//! ```text
//! (1 - ε) l(z)² + ε |z|² / r² <= 1,
//! ```
//!
//! r the largest norm of the points in normalized coordinates z: it holds them too, and bulges by
//! ε/2 of its thickness at most.

use nalgebra::{DMatrix, Matrix3, Vector3};
use sublevel_core::body::{Body, BodyError, Constraint, MAX_CONSTRAINTS, NotContained};
use sublevel_core::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial, PolynomialError};

/// Most slabs a body may be cut by.
pub const MAX_SLABS: usize = MAX_CONSTRAINTS - 1;

/// ε: share of the round term in the quadratic of a slab; dimensionless.
///
/// The slab bulges by half of it. The certificate needs eigenvalues above the rounding of 1e-15 in
/// proportion. A larger value leaves a visible bulge; a smaller one fails proofs of slabs across
/// long objects. Pinned by `slabs_leave_a_polytope_no_gap` and
/// `slabs_bring_a_body_closer_each_time`.
const BULGE: f64 = 1e-6;

/// Why a body could not be cut.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum CutError {
    /// The cut body could not be proven.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The points are too thin along the slab's normal for its numbers.
    #[error(transparent)]
    Polynomial(#[from] PolynomialError),
    /// A point could not be proven inside.
    #[error(transparent)]
    Points(#[from] NotContained),
}

/// The body cut by the slab across the unit vector n that contains the balls of radius `clearance`
/// about the points; what is noted of the body stays but for the gap.
pub(super) fn cut(body: &Body, points: &[Vector3<f64>], clearance: f64, n: &Vector3<f64>) -> Result<Body, CutError> {
    let mut constraints = body.constraints().to_vec();
    constraints.push(slab(body, points, clearance, n)?);
    let cut = Body::new(body.name(), *body.normalization(), constraints)?.with_points(points)?;
    Ok(match body.provenance() {
        Some(provenance) => cut.with_provenance(provenance.clone()),
        None => cut,
    })
}

/// The slab in the body's normalized coordinates.
fn slab(body: &Body, points: &[Vector3<f64>], clearance: f64, n: &Vector3<f64>) -> Result<Constraint, CutError> {
    let normalization = body.normalization();
    let seen = |x: &Vector3<f64>| x - normalization.center;
    let heights = points.iter().map(|x| n.dot(&seen(x)));
    let (low, high) = heights.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), t| (low.min(t), high.max(t)));
    let square = points.iter().map(|x| (normalization.linear * seen(x)).norm_squared()).fold(0.0, f64::max);
    let (middle, half) = ((low + high) * 0.5, (high - low) * 0.5);
    // l(z) = slope·z + offset
    let (slope, offset) = (body.inverse().tr_mul(n) / half, -middle / half);
    let (share, round) = (1.0 - BULGE, BULGE / square);
    let unit = |i: usize| Vector3::<u8>::ith(i, 1);
    let exponents = |v: Vector3<u8>| -> Exponents { v.into() };
    let hessian = (slope * slope.transpose() * share + Matrix3::identity() * round) * 2.0;
    let mut terms = vec![(exponents(Vector3::zeros()), share * offset * offset)];
    for i in 0..3 {
        terms.push((exponents(unit(i)), 2.0 * share * offset * slope[i]));
        for j in i..3 {
            let part = if i == j { 0.5 } else { 1.0 };
            terms.push((exponents(unit(i) + unit(j)), part * hessian[(i, j)]));
        }
    }
    let polynomial = Polynomial::new(terms)?;
    let basis = (0..3).map(|i| HessianMonomial { direction: i, exponents: [0, 0, 0] }).collect();
    let gram = HessianGram::nearest(&polynomial, basis, DMatrix::from_fn(3, 3, |i, j| hessian[(i, j)]))
        .map_err(|source| BodyError::Certificate { index: body.constraints().len(), source })?;
    let mut slab = Constraint { polynomial, gram };
    // Thin objects feel the rounding of coordinates: what it may add the constant takes back, which
    // leaves the Hessian as it is.
    let value = |slab: &Constraint, x| body.placement().sample(slab, x).value_upper(clearance);
    let excess = points.iter().map(|x| value(&slab, x)).fold(f64::NEG_INFINITY, f64::max) - 1.0;
    if excess > 0.0 {
        slab.polynomial = slab.polynomial.with_constant_shifted(-(2.0 * excess + 4.0 * f64::EPSILON));
    }
    Ok(slab)
}
