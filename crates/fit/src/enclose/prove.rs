//! A proof that a given body contains a given set, if there is one.
//!
//! Of all Gram matrices of `1 - p = σ + Σ τ_j (1 - g_j)`, those that are farthest from singular are
//! taken (`margin_program`). A functional that is nonnegative on all squares and products, and not
//! on `1 - p`, shows that there are none with these multipliers.

use super::error::EncloseError;
use super::options::EncloseOptions;
use super::program::prepare;
use super::region::{Prepared, Region};
use crate::margin_program::{Margin, largest_margin};
use crate::unsolved::ProgramError;
use nalgebra::DVector;
use sublevel_core::body::{BasicSet, Body, Containment};
use sublevel_core::polynomial::{ContainmentProof, NotContaining, Substituted};

/// Value of a functional, relative to its traces, whose sign rounding leaves open.
const LEAST_PROVABLE_BOUND: f64 = 1e-14;

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
    /// The search failed.
    #[error(
        "clarabel did not solve the program of a proof of degree {degree} with multipliers of degree {multiplier_degree}: {why}; \
         take multipliers of another degree"
    )]
    Unsolved {
        /// Degree of the body.
        degree: usize,
        /// Least degree of the multipliers.
        multiplier_degree: usize,
        /// What happened.
        why: ProgramError,
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
    let unsolved = |why| NoContainment::Unsolved { degree: body.degree(), multiplier_degree, why };
    let proof = |(constraint, &polynomial)| {
        let slack = -prepared.see(polynomial, outer.normalization);
        let Margin { bound, mut grams } = margin(&prepared, slack).map_err(unsolved)?;
        if bound < -LEAST_PROVABLE_BOUND {
            return Err(NoContainment::None { constraint, multiplier_degree, bound });
        }
        let rest = grams.remove(0);
        Ok(ContainmentProof::nearest(polynomial, &map, set, grams, rest)?)
    };
    let proofs = outer.polynomials.iter().enumerate().map(proof).collect::<Result<_, NoContainment>>()?;
    let containment = Containment { frame: prepared.frame, proofs };
    containment.prove(&outer, &region.set)?;
    Ok(containment)
}

/// The Gram matrices with the largest margin for `1 + minus_p`.
fn margin(prepared: &Prepared, minus_p: DVector<f64>) -> Result<Margin, ProgramError> {
    let mut target = minus_p;
    target[0] += 1.0;
    largest_margin(&target, &prepared.cones, &prepared.mean)
}
