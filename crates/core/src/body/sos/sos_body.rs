//! A certified set that need not be convex.

use super::coverage::Coverage;
use super::error::SosBodyError;
use super::relaxation::Relaxation;
use super::{support_bounds, volume};
use crate::body::body_error::check_name;
use crate::body::bounds::{Aabb, Ball};
use crate::body::contained_points::{ContainedPoints, NotContained, all_inside};
use crate::body::containment::BasicSet;
use crate::body::id::BodyId;
use crate::body::normalization::{Normalization, invert};
use crate::body::placement::Placement;
use crate::body::provenance::Provenance;
use crate::body::radial::Volume;
use crate::body::sphere::fibonacci_lattice;
use crate::polynomial::{Chords, Polynomial, SosGram};
use nalgebra::Vector3;

/// A closed bounded set `{x : p(x) <= 1}` with non-empty interior, p a sum of squares, certified;
/// immutable. It need not be convex, star-shaped or connected. Lengths are metres in the body
/// frame.
#[derive(Clone, Debug)]
pub struct SosBody {
    pub(super) name: String,
    pub(super) id: BodyId,
    pub(super) normalization: Normalization,
    pub(super) placement: Placement,
    pub(super) polynomial: Polynomial,
    pub(super) gram: SosGram,
    pub(super) relaxation: Option<Relaxation>,
    pub(super) interior_point: Vector3<f64>,
    pub(super) bounding_box: Aabb,
    pub(super) circumscribed: Ball,
    pub(super) volume: Volume,
    pub(super) points: Option<ContainedPoints>,
    pub(super) coverage: Option<Coverage>,
    pub(super) provenance: Option<Provenance>,
}

impl SosBody {
    /// Makes an sos-body of its defining numbers: proves the polynomial a sum of squares, the
    /// relaxation if there is one, the set bounded and not empty, and computes everything derived.
    /// No semidefinite program is solved.
    ///
    /// # Errors
    /// What could not be proven, and by how much it failed.
    pub fn new(
        name: &str,
        normalization: Normalization,
        polynomial: Polynomial,
        gram: SosGram,
        relaxation: Option<Relaxation>,
    ) -> Result<Self, SosBodyError> {
        check_name(name)?;
        let inverse = invert(&normalization)?;
        gram.prove(&polynomial).map_err(SosBodyError::NotSos)?;
        if let Some(relaxation) = &relaxation {
            let Relaxation { c, linear, offset, gram } = relaxation;
            if !(*c > 0.0 && c.is_finite() && linear.iter().chain(offset).all(|value| value.is_finite())) {
                return Err(SosBodyError::Relaxation(*c));
            }
            gram.prove_with(&polynomial, &relaxation.power(polynomial.degree())).map_err(SosBodyError::NotRelaxed)?;
        }
        let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
        let extent = support_bounds::Extent::prove(&polynomial, &gram, &placement, &inverse)?;
        let (volume, deepest) = volume::measure(&polynomial, &normalization, &inverse, &extent.circumscribed);
        let interior_point = deepest.ok_or(SosBodyError::Empty)?;
        if !(placement.sample_of(&polynomial, &interior_point).value_upper(0.0) < 1.0) {
            return Err(SosBodyError::Empty);
        }
        Ok(Self {
            name: name.to_owned(),
            id: BodyId::of_sos(&normalization, &polynomial),
            normalization,
            placement,
            polynomial,
            gram,
            relaxation,
            interior_point,
            bounding_box: extent.bounding_box,
            circumscribed: extent.circumscribed,
            volume,
            points: None,
            coverage: None,
            provenance: None,
        })
    }

    /// Name given by its maker; not part of the identity.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hash of normalization and polynomial.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// Degree of the polynomial: 2, 4, 6 or 8.
    pub fn degree(&self) -> usize {
        self.polynomial.degree()
    }

    /// Map to the normalized frame.
    pub fn normalization(&self) -> &Normalization {
        &self.normalization
    }

    /// The polynomial p, in the normalized frame.
    pub fn polynomial(&self) -> &Polynomial {
        &self.polynomial
    }

    /// Gram matrix that proves p a sum of squares.
    pub fn gram(&self) -> &SosGram {
        &self.gram
    }

    /// How far p is from sos-convex; none if nothing is claimed.
    pub fn relaxation(&self) -> Option<&Relaxation> {
        self.relaxation.as_ref()
    }

    /// A point proven inside, in the middle of the longest chord of the rays that measure the
    /// volume.
    pub fn interior_point(&self) -> &Vector3<f64> {
        &self.interior_point
    }

    /// A box proven to contain the set.
    pub fn bounding_box(&self) -> &Aabb {
        &self.bounding_box
    }

    /// A ball proven to contain the set.
    pub fn circumscribed(&self) -> &Ball {
        &self.circumscribed
    }

    /// Volume by quadrature.
    pub fn volume(&self) -> Volume {
        self.volume
    }

    /// Which points the set was proven to contain.
    pub fn points(&self) -> Option<&ContainedPoints> {
        self.points.as_ref()
    }

    /// Which of the triangles between them it was proven to contain.
    pub fn covered(&self) -> Option<&Coverage> {
        self.coverage.as_ref()
    }

    /// Where the set comes from.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// Where this number of rays from the centre of the circumscribed ball run through the set:
    /// both ends of each piece, metres. Thin parts may lie between them.
    pub fn chords(&self, rays: usize) -> Vec<(Vector3<f64>, Vector3<f64>)> {
        let Normalization { center, linear } = &self.normalization;
        let ball = self.circumscribed;
        let chords = Chords::new(&self.polynomial, &(linear * (ball.center - center)));
        let mut found = Vec::new();
        for u in fibonacci_lattice(rays) {
            let towards = linear * u;
            chords.along(&towards, ball.radius, &mut |from, to| {
                found.push((ball.center + u * from, ball.center + u * to));
            });
        }
        found
    }

    /// p at a point of the body frame, up to rounding: at most 1 inside.
    pub fn value(&self, x: &Vector3<f64>) -> f64 {
        self.placement.sample_of(&self.polynomial, x).value()
    }

    /// Rigorous upper bound of p at a point of the body frame.
    pub fn value_upper(&self, x: &Vector3<f64>) -> f64 {
        self.placement.sample_of(&self.polynomial, x).value_upper(0.0)
    }

    /// Proves every point inside, rounding included, and nothing of what is between them.
    ///
    /// # Errors
    /// The point that fails most.
    pub fn prove_contains(&self, points: &[Vector3<f64>]) -> Result<f64, NotContained> {
        all_inside(points.iter().map(|point| self.value_upper(point)))
    }

    /// The same set with the record of the points it is proven to contain.
    ///
    /// # Errors
    /// The point that fails most.
    pub fn with_points(mut self, points: &[Vector3<f64>]) -> Result<Self, NotContained> {
        self.prove_contains(points)?;
        self.points = Some(ContainedPoints::of(points));
        Ok(self)
    }

    /// The same set with the note of how many triangles it is proven to contain.
    pub fn with_coverage(mut self, coverage: Coverage) -> Self {
        self.coverage = Some(coverage);
        self
    }

    /// The same set with its origin noted; texts should pass [`check_name`], or its file is
    /// refused.
    pub fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = Some(provenance);
        self
    }
}

impl<'a> From<&'a SosBody> for BasicSet<'a> {
    fn from(body: &'a SosBody) -> Self {
        Self { normalization: body.normalization(), polynomials: vec![body.polynomial()] }
    }
}
