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
use super::unsolved::ProgramError;
use nalgebra::{DMatrix, DVector};

/// Tolerance asked of the solver, which stops where rounding stands in its way; dimensionless.
///
/// Near the edge the answer is as small as its error. A larger value leaves more polynomials
/// undecided. Pinned by `the_edge_of_convexity_is_found_from_both_sides`.
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
/// with definite moment matrices.
///
/// # Errors
/// What the solver says.
pub(super) fn largest_margin(
    target: &DVector<f64>,
    cones: &[LocalizingMatrix],
    inside: &DVector<f64>,
) -> Result<Margin, ProgramError> {
    let mut program = ConicProgram::default();
    let functional = program.variables(target.len());
    functional.clone().zip(target.iter()).for_each(|(variable, &cost)| program.add_cost(variable, cost));
    let trace = |cone: &LocalizingMatrix| cone.trace().map(|(k, factor)| (k, -factor)).collect::<Vec<_>>();
    let trace = program.zero([Expression { terms: cones.iter().flat_map(trace).collect(), constant: 1.0 }]).start;
    let rows: Vec<_> = cones.iter().map(|cone| cone.constrain(&mut program, functional.start)).collect();
    let mut ignored = |_| std::ops::ControlFlow::Continue(());
    let solution = solve(&program, TOLERANCE, 1.0, &mut Watch::new(&mut ignored)).map_err(|error| match error {
        FitError::Program(why) => why,
        _ => ProgramError::Solver("it was cancelled"),
    })?;
    // f = Σ collapse(D (Z + t I) D), t the negative multiplier of `1 - trace`
    let margin = -solution.multipliers[trace];
    let grams = cones.iter().zip(rows).map(|(cone, rows)| cone.gram(&solution, rows, 1.0, margin)).collect();
    let functional = solution.values(functional);
    let bound = feasible(functional, cones, inside).map_or(f64::INFINITY, |y| {
        let rounding =
            4.0 * f64::EPSILON * y.len() as f64 * target.iter().zip(&y).map(|(f, y)| (f * y).abs()).sum::<f64>();
        let trace: f64 = cones.iter().flat_map(LocalizingMatrix::trace).map(|(k, factor)| factor * y[k]).sum();
        (target.dot(&y) + rounding) / trace
    });
    Ok(Margin { bound, grams })
}

/// The functional with as little of one inside as makes its moment matrices definite.
fn feasible(y: DVector<f64>, cones: &[LocalizingMatrix], inside: &DVector<f64>) -> Option<DVector<f64>> {
    let size = y.amax() / inside.amax();
    let shares = (-15..-2).map(|exponent| size * 10_f64.powi(exponent));
    shares.map(|share| &y + inside * share).find(|y| cones.iter().all(|cone| cone.is_definite(y)))
}
