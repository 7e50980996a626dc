//! A proof that a given body contains a given set, if there is one.
//!
//! Of all Gram matrices of `1 - p = σ + Σ τ_j (1 - g_j)`, those with the largest product of
//! determinants are as far from singular as can be wished for. Their dual has one functional y,
//!
//! ```text
//! minimise  y(1 - p) - Σ log det M_j(y),
//! with the inverses of the M_j as Gram matrices at the minimum,
//! ```
//!
//! by Newton's method, as in `certificate`. Where `y(1 - p) <= 0` on the way, y being nonnegative
//! on all squares and products, there is no proof with these multipliers.

use super::error::EncloseError;
use super::localizing::LocalizingMatrix;
use super::options::EncloseOptions;
use super::program::prepare;
use super::region::{Prepared, Region};
use crate::factor::regularised_factor;
use nalgebra::{DMatrix, DVector};
use sublevel_core::body::{BasicSet, Body, Containment};
use sublevel_core::polynomial::{ContainmentProof, NotContaining, Substituted};

/// Newton steps before giving up.
const MAX_NEWTON_STEPS: usize = 300;

/// Newton decrement at which the matrices are the best ones for all practical purposes.
const CENTRED_DECREMENT: f64 = 1e-4;

/// Decrement below which a step's prediction is definite.
const DEFINITE_DECREMENT: f64 = 0.5;

/// Why a set has no proof that a body contains it.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum NoContainment {
    /// The set, or the degree of the multipliers.
    #[error(transparent)]
    Input(#[from] EncloseError),
    /// A point is outside.
    #[error("the body does not contain the set: at {point:?} m its largest constraint is {value}")]
    Outside {
        /// A point of the set, metres.
        point: [f64; 3],
        /// Largest constraint of the body there.
        value: f64,
    },
    /// There is no proof with these multipliers.
    #[error(
        "constraint {constraint} of the body has no proof with multipliers of degree {multiplier_degree}: a functional that is \
         nonnegative on all their products is {bound:.1e} on what should be positive; the set may reach outside, or higher \
         multipliers are needed"
    )]
    None {
        /// Which constraint of the body.
        constraint: usize,
        /// Least degree of the multipliers.
        multiplier_degree: usize,
        /// Value of the functional.
        bound: f64,
    },
    /// What was found is not proven.
    #[error(transparent)]
    Unproven(#[from] NotContaining),
}

/// Proves that the interior of a body contains a set, with multipliers of at least that degree.
///
/// # Errors
/// [`NoContainment`].
pub fn containment(body: &Body, region: &Region, multiplier_degree: usize) -> Result<Containment, NoContainment> {
    EncloseOptions { degree: 2, multiplier_degree }.check()?;
    let outer = BasicSet::from(body);
    let values = region.inside.iter().map(|x| (body.value(x), x));
    if let Some((value, x)) = values.max_by(|a, b| a.0.total_cmp(&b.0)).filter(|(value, _)| *value > 1.0 + 1e-9) {
        return Err(NoContainment::Outside { point: (*x).into(), value });
    }
    let options = EncloseOptions { degree: body.degree(), multiplier_degree };
    let prepared = prepare(std::slice::from_ref(region), &options)?.remove(0);
    let map = prepared.frame.to(outer.normalization);
    let set_map = prepared.frame.to(region.set.normalization);
    let set = Substituted { polynomials: &region.set.polynomials, map: &set_map };
    let proof = |(constraint, &polynomial)| {
        let slack = -prepared.see(polynomial, outer.normalization);
        let mut grams =
            centre(&prepared, slack).map_err(|bound| NoContainment::None { constraint, multiplier_degree, bound })?;
        let rest = grams.remove(0);
        Ok(ContainmentProof::nearest(polynomial, &map, set, grams, rest)?)
    };
    let proofs = outer.polynomials.iter().enumerate().map(proof).collect::<Result<_, NoContainment>>()?;
    let containment = Containment { frame: prepared.frame, proofs };
    containment.prove(&outer, &region.set)?;
    Ok(containment)
}

/// The Gram matrices with the largest product of determinants for `1 + minus_p`.
///
/// # Errors
/// The least value of a functional, relative to its trace, on what should be positive.
fn centre(prepared: &Prepared, minus_p: DVector<f64>) -> Result<Vec<DMatrix<f64>>, f64> {
    let mut target = minus_p;
    target[0] += 1.0;
    let mut y = prepared.mean.clone();
    let mut bound = f64::INFINITY;
    let mut found = None;
    for step in 0..MAX_NEWTON_STEPS {
        let value = target.dot(&y);
        bound = bound.min(value / y[0]);
        if value <= 0.0 {
            return Err(bound);
        }
        if step == 0 {
            // The best multiple.
            y *= prepared.rows() as f64 / value;
            continue;
        }
        let Some(derivatives) = prepared.cones.iter().map(|cone| cone.derivatives(&y)).collect::<Option<Vec<_>>>()
        else {
            break;
        };
        let slope = derivatives.iter().fold(target.clone(), |slope, (gradient, _)| slope - gradient);
        let curvature = derivatives.into_iter().map(|(_, curvature)| curvature).sum::<DMatrix<f64>>();
        let Some(factor) = regularised_factor(&curvature) else { break };
        let Some(half) = factor.solve_lower_triangular(&slope) else { break };
        let Some(change) = factor.tr_solve_lower_triangular(&half).map(|change| -change) else { break };
        let decrement = half.norm();
        if decrement < DEFINITE_DECREMENT {
            let predicted = |cone: &LocalizingMatrix| cone.predicted(&y, &(&y + &change));
            found = prepared.cones.iter().map(predicted).collect::<Option<Vec<_>>>().or(found);
        }
        if !(decrement > CENTRED_DECREMENT) {
            break;
        }
        y += change / (1.0 + decrement);
    }
    found.ok_or(bound)
}
