//! The program of an enclosure: its blocks and where its path starts.

use super::error::EncloseError;
use super::localizing::LocalizingMatrix;
use super::options::EncloseOptions;
use super::path::{Block, Path};
use super::region::{Prepared, Region, affine};
use crate::basis::of_monomials;
use crate::object::Object;
use crate::program::ProgramError;
use crate::structure::{Structure, isotropic_form};
use nalgebra::{Cholesky, DVector};
use std::borrow::Cow;

/// The frames and cones of all sets, whose functionals have a start.
pub(super) fn prepare(regions: &[Region], options: &EncloseOptions) -> Result<Vec<Prepared>, EncloseError> {
    let prepare = |(index, region): (usize, &Region)| {
        if region.set.polynomials.is_empty() {
            return Err(EncloseError::NoPolynomial(index));
        }
        let prepared = Prepared::new(region, options.degree, options.multiplier_degree)
            .map_err(|source| EncloseError::Points { index, source })?;
        let definite = prepared.cones.iter().all(|cone| cone.log_det(&prepared.mean).is_some());
        definite.then_some(prepared).ok_or(EncloseError::Start(index))
    };
    regions.iter().enumerate().map(prepare).collect()
}

/// The program in the normalized frame of the object; the last block is the Hessian form's.
pub(super) fn program<'a>(
    structure: &'a Structure,
    object: &Object,
    prepared: &'a [Prepared],
    margin: f64,
) -> Result<Path<'a>, ProgramError> {
    let rows = structure.gram.size as f64;
    let normalization = object.normalization();
    let mut blocks = Vec::with_capacity(prepared.len() + 1);
    let mut mean = DVector::zeros(structure.monomials.len());
    for set in prepared {
        let change = of_monomials(structure.degree, &affine(&set.frame, &normalization));
        let map = change.resize_horizontally(set.mean.len(), 0.0);
        let mut cost = DVector::zeros(set.mean.len());
        cost[0] = 1.0;
        // Equal masses that add up to the rows of P.
        let start = &set.mean * (rows / prepared.len() as f64);
        mean += &map * &set.mean / prepared.len() as f64;
        blocks.push(Block { cones: Cow::Borrowed(&set.cones), cost, map, start });
    }
    let form = &structure.hessian;
    let mut trace = DVector::zeros(form.keys);
    for i in 0..form.size {
        trace[form.key(i, i)] += 1.0;
    }
    // y isotropic and independent of z, and small enough to leave M definite.
    let isotropic = isotropic_form(structure, &mean);
    let start = (0..40)
        .map(|halvings| &isotropic * 0.5_f64.powi(halvings))
        .find(|form| Cholesky::new(structure.gram.spread(&(&mean * rows - structure.pull_back(form)))).is_some())
        .ok_or(ProgramError::Singular)?;
    blocks.push(Block {
        cones: Cow::Owned(vec![LocalizingMatrix::of(form.clone())]),
        cost: -trace * margin,
        map: -structure.derivative_matrix().transpose(),
        start: start * 0.5,
    });
    Ok(Path { structure, blocks })
}
