//! The program of an enclosure.
//!
//! Wanted is the sos-convex p with the largest `log det P` that is proven at most 1 on sets S_k:
//!
//! ```text
//! minimise  -log det P   subject to  p = zᵀPz,  yᵀ∇²p y = wᵀHw,  H ⪰ εI,
//!                              1 - p = σ_k + Σ_j τ_kj (1 - g_kj),  all σ and τ sums of squares
//! ```
//!
//! (Ahmadi, Hall, Makadia and Sindhwani, RSS 2017, section V), the Gram matrices of σ and τ
//! definite by a margin like H, so that they can be proven. In its dual each set has a functional
//! y_k that is nonnegative on squares and on squares times each `1 - g_kj`, where a fit to points
//! has weights of evaluations at points (`moment_program`):
//!
//! ```text
//! maximise  log det M(m) + N - Σ y_k(1) + ε tr S(s) + ε' Σ tr D_kj M_kj(y_k) D_kj
//! subject to  m = Σ y_k|p - D*s,  M_kj(y_k) ⪰ 0,  S(s) ⪰ 0
//! ```
//!
//! with y_k|p its values on the monomials of p, which have another frame.

use super::error::EncloseError;
use super::options::EncloseOptions;
use super::region::{Prepared, Region, affine};
use crate::basis::of_monomials;
use crate::moment_program::Source;
use crate::object::Object;
use crate::structure::Structure;
use nalgebra::{DMatrix, DVector};

/// ε': the margin of the Gram matrices of σ and τ relative to the scales of their rows, at a margin
/// of H of [`DEFAULT_MARGIN`](crate::DEFAULT_MARGIN); dimensionless.
///
/// A larger value makes bodies larger; a smaller one leaves proofs to the rounding of the solver.
/// Pinned by `programs_agree_with_the_printed_one`.
const MULTIPLIER_MARGIN: f64 = 1e-8;

/// The frames and cones of all sets, whose functionals have a start.
pub(super) fn prepare(regions: &[Region], options: &EncloseOptions) -> Result<Vec<Prepared>, EncloseError> {
    let prepare = |(index, region): (usize, &Region)| {
        if region.set.polynomials.is_empty() {
            return Err(EncloseError::NoPolynomial(index));
        }
        let prepared = Prepared::new(region, options.degree, options.multiplier_degree)
            .map_err(|source| EncloseError::Points { index, source })?;
        let definite = prepared.cones.iter().all(|cone| cone.is_definite(&prepared.mean));
        definite.then_some(prepared).ok_or(EncloseError::Start(index))
    };
    regions.iter().enumerate().map(prepare).collect()
}

/// Each set's functional on monomials of p, in the normalized frame of the object.
pub(super) fn maps(structure: &Structure, object: &Object, prepared: &[Prepared]) -> Vec<DMatrix<f64>> {
    let normalization = object.normalization();
    let map = |set: &Prepared| {
        let change = of_monomials(structure.degree, &affine(&set.frame, &normalization));
        change.resize_horizontally(set.mean.len(), 0.0)
    };
    prepared.iter().map(map).collect()
}

/// The margin of the multipliers at a `factor` of the usual margins.
pub(super) fn multiplier_margin(factor: f64) -> f64 {
    MULTIPLIER_MARGIN * factor
}

/// The sets' functionals as sources of moments; equal masses that add up to the rows of P are
/// inside.
pub(super) fn sources<'a>(
    structure: &Structure,
    prepared: &'a [Prepared],
    maps: &'a [DMatrix<f64>],
    margin: f64,
) -> Vec<Source<'a>> {
    let share = structure.gram.size as f64 / prepared.len() as f64;
    let source = |(set, map): (&'a Prepared, &'a DMatrix<f64>)| {
        let mut cost = DVector::zeros(set.mean.len());
        cost[0] = 1.0;
        Source { map, cost, cones: Some((&set.cones, margin)), inside: &set.mean * share }
    };
    prepared.iter().zip(maps).map(source).collect()
}
