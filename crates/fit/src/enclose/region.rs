//! A set made ready to be contained: its frame, its constraints there, and a functional to start
//! from.

use crate::FitError;
use crate::basis::{Affine, of_monomials};
use crate::localizing::LocalizingMatrix;
use crate::object::Object;
use crate::unsolved::ProgramError;
use nalgebra::{DVector, Matrix3, Vector3};
use sublevel_core::body::{BasicSet, Body, Normalization, Obstacle, ProofFrame, SosBody};
use sublevel_core::polynomial::{Polynomial, degree_of, monomials, position};

/// How far the points in the interior of a body are from its centre, relative to its boundary: as
/// many as a polynomial of degree 8 can tell apart.
const SHELLS: [f64; 4] = [0.4, 0.7, 0.9, 1.0];

/// Rays whose chords give the points of a set that need not be convex, and where on them, from end
/// to end.
const CHORD_RAYS: usize = 1000;
/// See [`CHORD_RAYS`].
const ALONG: [f64; 4] = [1e-3, 0.3, 0.7, 0.999];

/// A basic set to be contained, and points of it.
#[derive(Clone, Debug)]
pub struct Region<'a> {
    /// The set.
    pub set: BasicSet<'a>,
    /// Points of the set, metres, all over its interior and close to its boundary: a few hundred.
    /// They give the frames and where the solver starts, and prove nothing.
    pub inside: Vec<Vector3<f64>>,
}

impl<'a> From<&'a Body> for Region<'a> {
    fn from(body: &'a Body) -> Self {
        let center = body.interior_point();
        let shell = |share: f64| body.boundary().iter().map(move |x| center + (x - center) * share);
        Self { set: body.into(), inside: SHELLS.into_iter().flat_map(shell).collect() }
    }
}

impl<'a> From<&'a SosBody> for Region<'a> {
    fn from(body: &'a SosBody) -> Self {
        let inside = |(from, to): (Vector3<f64>, Vector3<f64>)| ALONG.map(|share| from + (to - from) * share);
        Self { set: body.into(), inside: body.chords(CHORD_RAYS).into_iter().flat_map(inside).collect() }
    }
}

impl<'a> From<&'a Obstacle> for Region<'a> {
    fn from(obstacle: &'a Obstacle) -> Self {
        match obstacle {
            Obstacle::Body(body) => (&**body).into(),
            Obstacle::SosBody(body) => (&**body).into(),
        }
    }
}

/// The functionals that stand for a set: definite on squares and on squares times each constraint's
/// slack, up to a degree.
pub(super) struct Prepared {
    /// The frame v in which the set about fills the unit ball.
    pub(super) frame: ProofFrame,
    /// Squares first, then one per constraint, scaled by what they are at the mean.
    pub(super) cones: Vec<LocalizingMatrix>,
    /// The mean over points inside: a functional in the interior of all cones.
    pub(super) mean: DVector<f64>,
}

impl Prepared {
    /// For polynomials of degree `contained` to be bounded on the region, with multipliers of at
    /// least `multiplier` (even), and as much more as is left to the same total degree.
    ///
    /// # Errors
    /// Points that are flat or no numbers.
    pub(super) fn new(region: &Region, contained: usize, multiplier: usize) -> Result<Self, FitError> {
        let frame = frame_of(&region.inside)?;
        let highest = region.set.polynomials.iter().map(|g| g.degree()).max().unwrap_or(0);
        let degree = contained.max(highest + multiplier);
        let slack = |g: &&Polynomial| -substituted(g, &affine(&frame, region.set.normalization)) + one(g.degree());
        let slacks = region.set.polynomials.iter().map(|g| LocalizingMatrix::multiples(&slack(g), degree));
        let inverse = frame.axes.try_inverse().ok_or(ProgramError::Singular)?;
        let order = monomials(degree);
        let share = 1.0 / region.inside.len() as f64;
        let mut mean = DVector::zeros(order.len());
        for x in &region.inside {
            let v = inverse * (x - frame.origin);
            let mut values = vec![share; order.len()];
            for (place, exponents) in order.iter().enumerate().skip(1) {
                let Some(axis) = (0..3).find(|&k| exponents[k] > 0) else { continue };
                let mut lower = *exponents;
                lower[axis] -= 1;
                values[place] = values[position(lower)] * v[axis];
            }
            mean += DVector::from_vec(values);
        }
        let cones = std::iter::once(LocalizingMatrix::squares(degree)).chain(slacks);
        let cones = cones.map(|cone| cone.scaled_at(&mean)).collect();
        Ok(Self { frame, cones, mean })
    }

    /// Coefficients of a polynomial of other normalized coordinates, as one of v, on the monomials
    /// of the functionals.
    pub(super) fn see(&self, polynomial: &Polynomial, normalization: &Normalization) -> DVector<f64> {
        substituted(polynomial, &affine(&self.frame, normalization)).resize_vertically(self.mean.len(), 0.0)
    }
}

/// The map from v to the normalized coordinates, rounded.
pub(super) fn affine(frame: &ProofFrame, normalization: &Normalization) -> Affine {
    let Normalization { center, linear } = normalization;
    Affine { linear: linear * frame.axes, offset: linear * (frame.origin - center) }
}

/// `p(A v + b)`, rounded.
fn substituted(polynomial: &Polynomial, map: &Affine) -> DVector<f64> {
    let mut coefficients = DVector::zeros(monomials(polynomial.degree()).len());
    for &(exponents, coefficient) in polynomial.terms() {
        debug_assert!(degree_of(exponents) <= polynomial.degree());
        coefficients[position(exponents)] = coefficient;
    }
    of_monomials(polynomial.degree(), map).tr_mul(&coefficients)
}

/// The polynomial 1.
fn one(degree: usize) -> DVector<f64> {
    let mut coefficients = DVector::zeros(monomials(degree).len());
    coefficients[0] = 1.0;
    coefficients
}

/// The frame in which the smallest ellipsoid around the points is the unit ball.
fn frame_of(points: &[Vector3<f64>]) -> Result<ProofFrame, FitError> {
    let Normalization { center, linear } = Object::new("set", points, "")?.normalization();
    let axes: Matrix3<f64> = linear.try_inverse().ok_or(ProgramError::Singular)?;
    Ok(ProofFrame { origin: center, axes })
}
