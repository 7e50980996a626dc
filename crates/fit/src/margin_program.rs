//! The Gram matrices of an identity that are farthest from singular.
//!
//! Of all Gram matrices with `f = Σ_j ⟨G_j, products_j⟩`, those with the largest t in `G_j ⪰ t
//! D_j²` are the easiest to prove. The dual has one functional y:
//!
//! ```text
//! minimise  f(y)   subject to  M_j(y) ⪰ 0,  Σ_j tr D_j M_j(y) D_j = 1,
//! ```
//!
//! with M_j its moment matrices. Its optimum is t, and `f(y) >= t` for every feasible y: where it
//! is negative, no Gram matrices are all semidefinite.

use super::FitError;
use super::conic_program::{ConicProgram, Expression, solve};
use super::localizing::LocalizingMatrix;
use super::progress::Watch;
use nalgebra::{Cholesky, DMatrix, DVector};

/// Tolerance asked of the solver, which stops where rounding stands in its way; dimensionless.
///
/// Near the edge the answer is as small as its error. A larger value leaves more polynomials
/// undecided. Pinned by `the_edge_of_convexity_is_told_from_both_sides`.
const TOLERANCE: f64 = 1e-12;

/// What the program says about an identity.
#[derive(Clone, Debug)]
pub(super) struct Margin {
    /// No Gram matrices have a larger t, dimensionless: `f(y)` of a functional that is feasible.
    pub(super) bound: f64,
    /// The Gram matrices, one for each moment matrix.
    pub(super) grams: Vec<DMatrix<f64>>,
}

/// The largest margin of the identity for `target`, coefficients of f. `inside` is a functional
/// with definite moment matrices, and `scales` are the diagonals of the D_j.
///
/// # Errors
/// Those of the solver.
pub(super) fn largest_margin(
    target: &DVector<f64>,
    cones: &[LocalizingMatrix],
    scales: &[Vec<f64>],
    inside: &DVector<f64>,
) -> Result<Margin, FitError> {
    let mut program = ConicProgram::default();
    let functional = program.variables(target.len());
    functional.clone().zip(target.iter()).for_each(|(variable, &cost)| program.add_cost(variable, cost));
    let mut trace = Expression::constant(1.0);
    for (cone, scales) in cones.iter().zip(scales) {
        for (i, scale) in scales.iter().enumerate() {
            trace.terms.extend(cone.entry(i, i).into_iter().map(|(k, factor)| (k, -scale * scale * factor)));
        }
    }
    let trace = program.zero([trace]).start;
    let rows: Vec<_> = cones
        .iter()
        .zip(scales)
        .map(|(cone, scales)| {
            program.semidefinite(cone.size(), |i, j| {
                let scaled = |(k, factor)| (k, scales[i] * scales[j] * factor);
                Expression { terms: cone.entry(i, j).into_iter().map(scaled).collect(), constant: 0.0 }
            })
        })
        .collect();
    let mut ignored = |_| std::ops::ControlFlow::Continue(());
    let solution = solve(&program, TOLERANCE, 1.0, &mut Watch::new(&mut ignored))?;
    // f = Σ collapse(D (Z + t I) D), t the negative multiplier of `1 - trace`
    let margin = -solution.multipliers[trace];
    let gram = |((cone, scales), rows): ((&LocalizingMatrix, &Vec<f64>), std::ops::Range<usize>)| {
        let mut gram = solution.matrix_multiplier(rows, cone.size());
        for i in 0..cone.size() {
            gram[(i, i)] += margin;
        }
        DMatrix::from_fn(cone.size(), cone.size(), |i, j| scales[i] * scales[j] * gram[(i, j)])
    };
    let grams = cones.iter().zip(scales).zip(rows).map(gram).collect();
    let functional = solution.values(functional);
    let bound = feasible(functional, cones, inside).map_or(f64::INFINITY, |y| {
        let rounding =
            4.0 * f64::EPSILON * y.len() as f64 * target.iter().zip(&y).map(|(f, y)| (f * y).abs()).sum::<f64>();
        let trace = |(cone, scales): (&LocalizingMatrix, &Vec<f64>)| {
            let matrix = cone.matrix(&y);
            scales.iter().enumerate().map(|(i, scale)| scale * scale * matrix[(i, i)]).sum::<f64>()
        };
        (target.dot(&y) + rounding) / cones.iter().zip(scales).map(trace).sum::<f64>()
    });
    Ok(Margin { bound, grams })
}

/// The functional with as little of one inside as makes its moment matrices definite.
fn feasible(y: DVector<f64>, cones: &[LocalizingMatrix], inside: &DVector<f64>) -> Option<DVector<f64>> {
    let size = y.amax() / inside.amax();
    let shares = (-15..-2).map(|exponent| size * 10_f64.powi(exponent));
    shares.map(|share| &y + inside * share).find(|y| cones.iter().all(|cone| Cholesky::new(cone.matrix(y)).is_some()))
}
