//! Bodies around sets, with the proofs that they contain them.

use super::error::{EncloseError, MAX_SETS};
use super::options::EncloseOptions;
use super::program::{maps, multiplier_margin, prepare, sources};
use super::region::{Prepared, Region};
use crate::coordinates::Coordinates;
use crate::error::FitError;
use crate::gap::Gap;
use crate::margin::{DEFAULT_MARGIN, MARGIN_ATTEMPTS};
use crate::moment_program::MomentProgram;
use crate::object::Object;
use crate::path::Interior;
use crate::program::Problem;
use crate::progress::{Progress, Watch};
use crate::structure::Structure;
use crate::unsolved::{Fault, ProgramError};
use nalgebra::{DMatrix, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{
    BasicSet, Body, BodyError, BodyId, Constraint, ContainedSet, Containment, Objective, Obstacle, Solver, SolverStep,
};
use sublevel_core::polynomial::{ContainmentProof, HessianGram, NotContaining, Polynomial, Substituted};

/// Largest distance of an enclosure's objective to its lower bound, relative to the objective (or
/// 1).
const ENCLOSURE_OPTIMALITY_GAP: f64 = 1e-3;

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
    /// Iterations of the solver.
    pub iterations: usize,
    /// Each of them.
    pub log: Vec<SolverStep>,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// The sos-convex body with the largest `log det P` that the multipliers prove to contain all
/// regions, with its proofs.
///
/// The same in every affine frame, but for the margin. `progress` is called at every iteration
/// of the solver and can stop it.
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
    let maps = maps(&structure, &object, &prepared);
    let coordinates = object.coordinates(Coordinates::Unit).map_err(FitError::from)?;
    let mut attempts = MARGIN_ATTEMPTS.iter().copied();
    loop {
        let factor = attempts.next().unwrap_or(1.0);
        let margin = factor * DEFAULT_MARGIN;
        let problem = Problem::new(&structure, Objective::LogDetP, &coordinates, margin);
        let sources = sources(&structure, &prepared, &maps, multiplier_margin(factor));
        watch.round(regions.len(), 0.0);
        let EncloseOptions { degree, multiplier_degree } = *options;
        let unsolved = |source| EncloseError::Unsolved { degree, multiplier_degree, sets: regions.len(), source };
        let optimum = MomentProgram::new(&problem, sources).solve(&mut watch).map_err(|error| match error {
            FitError::Program(source) => unsolved(source),
            error => error.into(),
        })?;
        let stop = optimum.stop;
        let objective_value =
            problem.spectral.measure(&optimum.gram).ok_or_else(|| unsolved(ProgramError::singular(stop)))?;
        let optimality_gap = objective_value - optimum.lower_bound;
        if !(optimality_gap.abs() <= ENCLOSURE_OPTIMALITY_GAP * objective_value.abs().max(1.0)) {
            return Err(unsolved(ProgramError::Unusable { stop, fault: Fault::Gap(optimality_gap) }));
        }
        let Interior { coefficients, hessian } = optimum.interior;
        let terms = structure.monomials.iter().copied().zip(coefficients.iter().copied()).collect();
        let polynomial = Polynomial::new(terms).map_err(FitError::from)?;
        let body = match body(&object, &structure, &polynomial, hessian) {
            Ok(body) => body,
            Err(BodyError::Certificate { .. }) if attempts.len() > 0 => continue,
            Err(error) => return Err(FitError::from(error).into()),
        };
        let containments = regions
            .iter()
            .zip(&prepared)
            .zip(optimum.grams)
            .enumerate()
            .map(|(index, ((region, prepared), grams))| {
                contained(&body, &region.set, prepared, grams)
                    .map_err(|source| EncloseError::Unproven { index, source })
            })
            .collect::<Result<Vec<_>, _>>();
        let containments = match containments {
            Err(EncloseError::Unproven { .. }) if attempts.len() > 0 => continue,
            containments => containments?,
        };
        let (body, gap) = object.finish(body, "logdet-p", false, Some(Solver::Clarabel));
        let (iterations, seconds) = (watch.progress().iterations, start.elapsed().as_secs_f64());
        let log = watch.log().to_vec();
        return Ok(Enclosure { body, containments, gap, objective_value, optimality_gap, iterations, log, seconds });
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
    mut grams: Vec<DMatrix<f64>>,
) -> Result<Containment, NotContaining> {
    let outer = BasicSet::from(body);
    let frame = prepared.frame;
    let squares = grams.remove(0);
    let set_map = frame.to(set.normalization);
    let substituted = Substituted { polynomials: &set.polynomials, map: &set_map };
    let proof =
        ContainmentProof::nearest(outer.polynomials[0], &frame.to(outer.normalization), substituted, grams, squares)?;
    let containment = Containment { frame, proofs: vec![proof] };
    containment.prove(&outer, set)?;
    Ok(containment)
}
