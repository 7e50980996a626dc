//! The inverse-moment polynomial of points.

use super::FitError;
use super::structure::Structure;
use nalgebra::{Cholesky, DMatrix, DVector, Vector3};

/// Smallest eigenvalue of the moment matrix, relative to the largest, below which the points count
/// as lying on a surface of half the degree; dimensionless.
///
/// The inverse is then lost in rounding. A larger value refuses clouds that can be fitted; a
/// smaller one ends in unproven polynomials. Pinned by `bad_input_is_refused_by_field` of sets that
/// need not be convex.
const LEAST_MOMENT_EIGENVALUE: f64 = 1e-13;

/// Checks that no polynomial of half the degree vanishes at all points (whitened), also but for
/// rounding. Their moment matrix `M = mean of m(x) m(x)ᵀ`, m the monomials of half the degree.
pub(super) fn moments(structure: &Structure, points: &[Vector3<f64>]) -> Result<DMatrix<f64>, FitError> {
    let share = 1.0 / points.len() as f64;
    let mean = points.iter().fold(DVector::zeros(structure.monomials.len()), |mut sum, point| {
        sum.axpy(share, &structure.values(point), 1.0);
        sum
    });
    let matrix = structure.gram.spread(&mean);
    let eigenvalues = matrix.symmetric_eigenvalues();
    let rank = eigenvalues.iter().filter(|&&value| value > LEAST_MOMENT_EIGENVALUE * eigenvalues.max()).count();
    if rank < matrix.nrows() {
        return Err(FitError::Span { degree: structure.degree, rank, monomials: matrix.nrows() });
    }
    Ok(matrix)
}

/// `m(x)ᵀ M⁻¹ m(x)` (Lasserre and Pauwels, NIPS 2016), with M over all `points` (whitened), divided
/// by its largest value there: the Gram matrix. Affine maps of the points take the set along.
pub(super) fn inverse_moment(structure: &Structure, points: &[Vector3<f64>]) -> Result<DMatrix<f64>, FitError> {
    let matrix = moments(structure, points)?;
    let (rank, monomials) = (matrix.nrows() - 1, matrix.nrows());
    let factor = Cholesky::new(matrix).ok_or(FitError::Span { degree: structure.degree, rank, monomials })?;
    let inverse = factor.inverse();
    let inverse = (&inverse + inverse.transpose()) * 0.5;
    let coefficients = structure.gram.collapse(&inverse);
    let level = points.iter().map(|point| structure.values(point).dot(&coefficients)).fold(0.0, f64::max);
    Ok(inverse / level)
}
