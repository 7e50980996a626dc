//! One body around whole sets: the union of several bodies, or a set that is not convex.
//!
//! [`enclose`] solves the program of section V of Ahmadi, Hall, Makadia and Sindhwani (RSS 2017),
//! sos-convex p with multipliers for every set, by the central path of its dual (`path`): the
//! strictly feasible polynomial at its end comes with all Gram matrices, which become the
//! [`Containment`] of each set. [`containment`] looks for such a proof when body and set are given
//! both, and [`group`](group()) puts many bodies into few. Every set has a frame of its own for its
//! proof (`region`), with the frames' rounding paid for ([`Containment`]).

mod cone;
mod group;
mod path;
mod program;
mod prove;
mod region;

pub use group::{Cover, Group, group};
pub use prove::{NoContainment, containment};
pub use region::Region;

use super::object::Object;
use super::progress::{Progress, Watch};
use super::structure::Structure;
use super::{DEFAULT_MARGIN, FitError, Gap};
use nalgebra::{DMatrix, Vector3};
use program::{prepare, program};
use region::Prepared;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{BasicSet, Body, BodyError, BodyId, Constraint, ContainedSet, Containment, Obstacle};
use sublevel_core::polynomial::{ContainmentProof, HessianGram, NotContaining, Polynomial, Substituted};

/// Most sets in one body.
pub const MAX_SETS: usize = 64;

/// Highest degree of multipliers that can be asked for.
pub const MAX_MULTIPLIER_DEGREE: usize = 4;

/// Distance to the optimum asked of the path, in units of log dets.
const GAP: f64 = 1e-5;

/// Largest such distance of an enclosure.
const OPTIMALITY_GAP: f64 = 1e-3;

/// Factors on the margin for further attempts, when the body could not be proven.
const MARGIN_ATTEMPTS: [f64; 3] = [1.0, 10.0, 100.0];

/// How to enclose.
#[derive(Clone, Debug, PartialEq)]
pub struct EncloseOptions {
    /// Degree of the polynomial: 2, 4, 6 or 8.
    pub degree: usize,
    /// Least degree of the multipliers: 0, 2 or 4. Where polynomial or set leave room for a higher
    /// one it is used, since nothing is saved otherwise. Multipliers of too low a degree make the
    /// body larger than it need be: around a quartic peanut, degree 6 with 2 is 8 % larger than
    /// with 4, and larger than degree 4.
    pub multiplier_degree: usize,
}

/// A body around sets, and how it came about.
#[derive(Clone, Debug)]
pub struct Enclosure {
    /// The body, proven sos-convex and bounded, with the proofs of the sets that have an identity.
    pub body: Body,
    /// A proof for every set, in their order.
    pub containments: Vec<Containment>,
    /// How far the body reaches at most beyond the convex hull of the sets' known points, and so of
    /// the sets.
    pub gap: Gap,
    /// `-log det P`, in the frame in which the smallest ellipsoid around the known points is the
    /// unit ball.
    pub objective_value: f64,
    /// It minus its lower bound from the dual.
    pub optimality_gap: f64,
    /// Newton steps.
    pub iterations: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Why there is no body around the sets.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum EncloseError {
    /// No set or too many.
    #[error("sets: {0} given; between 1 and {MAX_SETS} can be enclosed in one body, group them in several")]
    Count(usize),
    /// A set without polynomials.
    #[error("sets[{0}] has no polynomial; it is the whole space, which no body contains")]
    NoPolynomial(usize),
    /// The degree of the multipliers is odd or too high.
    #[error("multiplier degree: {0} is not one of 0, 2, 4; leave it away unless the body is too large")]
    MultiplierDegree(usize),
    /// The growth that groups are allowed is no such number.
    #[error(
        "max growth: {0} is not positive; give the volume that grouping may add, such as 0.2 of that of all bodies"
    )]
    Growth(f64),
    /// A set's points tell too little of it.
    #[error("sets[{index}]: its points cannot be used: {source}")]
    Points {
        /// Which set.
        index: usize,
        /// What is wrong with them.
        source: FitError,
    },
    /// The multipliers prove nothing about a set from where its points are.
    #[error(
        "sets[{0}]: its points do not lie in its interior, or are too few to span the polynomials of this degree; give more \
         points, all over the set"
    )]
    Start(usize),
    /// What goes wrong in fits to points, too.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// No multipliers were found.
    #[error(
        "no body with multipliers of degree {multiplier_degree} was found around the sets; raise the degree of the multipliers, \
         or that of the body"
    )]
    Unsolved {
        /// Least degree of the multipliers.
        multiplier_degree: usize,
    },
    /// A containment could not be proven.
    #[error("sets[{index}] could not be proven inside: {source}; lower the degree of the body or of the multipliers")]
    Unproven {
        /// Which set.
        index: usize,
        /// What the proof lacks.
        source: NotContaining,
    },
}

impl EncloseError {
    /// The error of a single set, with the name of the set that it is among others.
    fn of_set(self, index: usize) -> Self {
        match self {
            Self::NoPolynomial(_) => Self::NoPolynomial(index),
            Self::Points { source, .. } => Self::Points { index, source },
            Self::Start(_) => Self::Start(index),
            Self::Unproven { source, .. } => Self::Unproven { index, source },
            error => error,
        }
    }
}

impl EncloseOptions {
    /// Multipliers that fill up to the degree of the polynomial where constraints are quadratic, as
    /// in the paper; of degree 4 at most.
    pub fn new(degree: usize) -> Self {
        Self { degree, multiplier_degree: degree.saturating_sub(2).min(MAX_MULTIPLIER_DEGREE) }
    }

    /// Checks the options, before any work.
    ///
    /// # Errors
    /// [`FitError::Degree`], [`EncloseError::MultiplierDegree`].
    pub fn check(&self) -> Result<(), EncloseError> {
        if ![2, 4, 6, 8].contains(&self.degree) {
            return Err(FitError::Degree(self.degree).into());
        }
        if !self.multiplier_degree.is_multiple_of(2) || self.multiplier_degree > MAX_MULTIPLIER_DEGREE {
            return Err(EncloseError::MultiplierDegree(self.multiplier_degree));
        }
        Ok(())
    }
}

/// The sos-convex body with the largest `log det P` that the multipliers prove to contain all
/// regions, with its proofs.
///
/// The same in every affine frame, but for the margin. `progress` hears of every Newton step and
/// can stop it.
///
/// # Errors
/// [`EncloseError`]: bad input, or what could not be solved or proven.
pub fn enclose(
    name: &str,
    regions: &[Region],
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Enclosure, EncloseError> {
    let start = Instant::now();
    options.check()?;
    sublevel_core::body::check_name(name).map_err(FitError::Name)?;
    if !(1..=MAX_SETS).contains(&regions.len()) {
        return Err(EncloseError::Count(regions.len()));
    }
    let prepared = prepare(regions, options)?;
    let points: Vec<Vector3<f64>> = regions.iter().flat_map(|region| region.inside.iter().copied()).collect();
    let object = Object::new(name, &points, "")?;
    let structure = Structure::new(options.degree);
    let mut watch = Watch::new(progress);
    let mut attempts = MARGIN_ATTEMPTS.iter().map(|factor| factor * DEFAULT_MARGIN);
    loop {
        let margin = attempts.next().unwrap_or(DEFAULT_MARGIN);
        let program = program(&structure, &object, &prepared, margin).map_err(FitError::from)?;
        watch.round(regions.len(), 0.0);
        let unsolved = EncloseError::Unsolved { multiplier_degree: options.multiplier_degree };
        let centre = program.follow(GAP, &mut watch)?.ok_or_else(|| unsolved.clone())?;
        let (objective_value, optimality_gap) = program.objective(&centre).ok_or(unsolved.clone())?;
        if !(optimality_gap <= OPTIMALITY_GAP * objective_value.abs().max(1.0)) {
            return Err(FitError::NotOptimal { gap: optimality_gap }.into());
        }
        let terms = structure.monomials.iter().copied().zip(centre.coefficients.iter().copied()).collect();
        let polynomial = Polynomial::new(terms).map_err(FitError::from)?;
        let hessian = &centre.grams[regions.len()][0]
            + DMatrix::identity(structure.hessian.size, structure.hessian.size) * margin;
        let body = match body(&object, &structure, &polynomial, hessian) {
            Ok(body) => body,
            Err(BodyError::Certificate { .. }) if attempts.len() > 0 => continue,
            Err(error) => return Err(FitError::from(error).into()),
        };
        let containments = regions
            .iter()
            .zip(&prepared)
            .zip(&centre.grams)
            .enumerate()
            .map(|(index, ((region, prepared), grams))| {
                contained(&body, &region.set, prepared, grams)
                    .map_err(|source| EncloseError::Unproven { index, source })
            })
            .collect::<Result<Vec<_>, _>>()?;
        let (body, gap) = object.finish(body, "logdet-p", false);
        let (iterations, seconds) = (watch.progress().iterations, start.elapsed().as_secs_f64());
        return Ok(Enclosure { body, containments, gap, objective_value, optimality_gap, iterations, seconds });
    }
}

/// The smallest body around obstacles, whose file keeps the proofs. Around one that is not convex
/// it is its convexification.
///
/// # Errors
/// As [`enclose`].
pub fn enclose_obstacles(
    name: &str,
    obstacles: &[&Obstacle],
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Enclosure, EncloseError> {
    let regions: Vec<Region> = obstacles.iter().map(|&obstacle| obstacle.into()).collect();
    let mut enclosure = enclose(name, &regions, options, progress)?;
    for (index, (inner, containment)) in obstacles.iter().zip(&enclosure.containments).enumerate() {
        let id: BodyId = *inner.id();
        let record = ContainedSet { id, name: inner.name().to_owned(), containment: containment.clone() };
        enclosure.body = enclosure
            .body
            .with_set(&BasicSet::from(*inner), record)
            .map_err(|source| EncloseError::Unproven { index, source })?;
    }
    Ok(enclosure)
}

fn body(
    object: &Object,
    structure: &Structure,
    polynomial: &Polynomial,
    hessian: DMatrix<f64>,
) -> Result<Body, BodyError> {
    let gram = HessianGram::nearest(polynomial, structure.hessian_basis.clone(), hessian)
        .map_err(|source| BodyError::Certificate { index: 0, source })?;
    Body::new(object.name(), object.normalization(), vec![Constraint { polynomial: polynomial.clone(), gram }])
}

/// The proof of one set from the Gram matrices of its cones.
fn contained(
    body: &Body,
    set: &BasicSet,
    prepared: &Prepared,
    grams: &[DMatrix<f64>],
) -> Result<Containment, NotContaining> {
    let outer = BasicSet::from(body);
    let frame = prepared.frame;
    let set_map = frame.to(set.normalization);
    let substituted = Substituted { polynomials: &set.polynomials, map: &set_map };
    let proof = ContainmentProof::nearest(
        outer.polynomials[0],
        &frame.to(outer.normalization),
        substituted,
        grams[1..].to_vec(),
        grams[0].clone(),
    )?;
    let containment = Containment { frame, proofs: vec![proof] };
    containment.prove(&outer, set)?;
    Ok(containment)
}

#[cfg(test)]
mod tests;
