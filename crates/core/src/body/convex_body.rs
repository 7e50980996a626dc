//! The certified convex body.

use super::body_error::{BodyError, check_name};
use super::bounds::{Aabb, Ball};
use super::closed_form::ClosedForm;
use super::constraint::{Constraint, MAX_CONSTRAINTS, MIN_DEPTH, largest};
use super::contained_points::{ContainedPoints, NotContained, all_inside};
use super::containment::{BasicSet, ContainedSet};
use super::error_bounds::{BodyLengths, Trust};
use super::id::BodyId;
use super::normalization::{Normalization, invert};
use super::placement::Placement;
use super::provenance::Provenance;
use super::radial::{self, Volume};
use super::support_bounds::{self, Extent, SupportProblem, TangentBound};
use super::support_heights::{CornerBound, SupportGuess, SupportHeights};
use super::support_table::Outline;
use crate::polynomial::{NotContaining, Scalar};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};

/// How far a body reaches along a direction, body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Point farthest along it, up to the accuracy of its computation.
    pub point: Vector3<f64>,
    /// Proven upper bound of the height of all points along it above the interior point, metres.
    pub height_m: f64,
}

/// A closed bounded convex set with non-empty interior, certified; immutable.
#[derive(Clone, Debug)]
pub struct Body {
    pub(super) name: String,
    pub(super) id: BodyId,
    pub(super) normalization: Normalization,
    pub(super) inverse: Matrix3<f64>,
    pub(super) constraints: Vec<Constraint>,
    pub(super) placement: Placement,
    pub(super) interior_point: Vector3<f64>,
    pub(super) min_value: f64,
    pub(super) in_radius: f64,
    pub(super) growth: Option<Ball>,
    pub(super) bounding_box: Aabb,
    pub(super) circumscribed: Ball,
    pub(super) z_extent: Vector3<f64>,
    pub(super) trust: Trust,
    pub(super) boundary: Vec<Vector3<f64>>,
    pub(super) outline: Outline,
    pub(super) closed_form: Option<ClosedForm>,
    /// None of what has a closed form.
    pub(super) heights: Option<SupportHeights>,
    pub(super) volume: Volume,
    pub(super) points: Option<ContainedPoints>,
    pub(super) sets: Vec<ContainedSet>,
    pub(super) gap: Option<f64>,
    pub(super) provenance: Option<Provenance>,
}

impl Body {
    /// Makes a body of its defining numbers: proves every constraint sos-convex and the set bounded
    /// with an interior, and computes everything derived. No semidefinite program is solved.
    ///
    /// # Errors
    /// What could not be proven, and by how much it failed.
    pub fn new(name: &str, normalization: Normalization, constraints: Vec<Constraint>) -> Result<Self, BodyError> {
        Self::with_interior(name, normalization, constraints, None)
    }

    /// As [`Body::new`], with an interior point that is already known (and is re-proven).
    pub(super) fn with_interior(
        name: &str,
        normalization: Normalization,
        constraints: Vec<Constraint>,
        interior: Option<Vector3<f64>>,
    ) -> Result<Self, BodyError> {
        check_name(name)?;
        if !(1..=MAX_CONSTRAINTS).contains(&constraints.len()) {
            return Err(BodyError::ConstraintCount(constraints.len()));
        }
        for (index, constraint) in constraints.iter().enumerate() {
            constraint.gram.prove(&constraint.polynomial).map_err(|source| BodyError::Certificate { index, source })?;
        }
        Self::of_proven(name, normalization, constraints, interior)
    }

    /// The body of constraints that are proven sos-convex: proves the rest and computes everything
    /// derived.
    fn of_proven(
        name: &str,
        normalization: Normalization,
        constraints: Vec<Constraint>,
        interior: Option<Vector3<f64>>,
    ) -> Result<Self, BodyError> {
        let inverse = invert(&normalization)?;
        let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
        let interior_point =
            interior.unwrap_or_else(|| inverse * support_bounds::deepest_point(&constraints).0 + normalization.center);
        let min_value = largest(constraints.iter().map(|c| placement.sample(c, &interior_point).value_upper(0.0)));
        if !(min_value <= 1.0 - MIN_DEPTH) {
            return Err(BodyError::Interior { min_value });
        }
        let Extent { bounding_box, circumscribed, z_extent } =
            Extent::prove(&constraints, &placement, &inverse, &interior_point)?;
        let boundary = radial::proven_boundary(&constraints, &placement, &inverse, &interior_point);
        let in_radius = radial::in_radius(&boundary, &interior_point, inverse.determinant() < 0.0);
        if !(in_radius > 0.0) {
            return Err(BodyError::Thin);
        }
        let interior_z = normalization.linear * (interior_point - normalization.center);
        let (outline, corners) = Outline::new(&constraints, &inverse, &interior_z);
        let lengths = BodyLengths { z_extent, reach: outline.reach(), interior_z };
        let trust = Trust::new(&constraints, &normalization, &inverse, &lengths);
        let volume = radial::volume(&constraints, &normalization.linear, &interior_z);
        let id = BodyId::of(&normalization, &constraints, None);
        let closed_form = ClosedForm::of(&normalization, &constraints);
        let heights = closed_form.is_none().then(|| {
            let guesses = corners.iter().map(|(point, active)| SupportGuess { point: *point, active });
            let (constraints, interior) = (&constraints[..], &interior_z);
            let bound = CornerBound { constraints, interior, trust: &trust, extent: &z_extent };
            SupportHeights::new(&bound, &inverse, guesses)
        });
        Ok(Self {
            name: name.to_owned(),
            id,
            normalization,
            inverse,
            constraints,
            placement,
            interior_point,
            min_value,
            in_radius,
            growth: None,
            bounding_box,
            circumscribed,
            z_extent,
            trust,
            boundary,
            outline,
            closed_form,
            heights,
            volume,
            points: None,
            sets: Vec::new(),
            gap: None,
            provenance: None,
        })
    }

    /// The same set moved within its frame by `x -> rotation x + translation` (metres): another
    /// normalization for the same constraints with the same certificates. Bounds are proven again;
    /// the records of contained points and sets do not move along.
    ///
    /// # Errors
    /// Numbers that are not finite, or a place so far away that the body drowns in rounding.
    pub fn moved(&self, rotation: &UnitQuaternion<f64>, translation: &Vector3<f64>) -> Result<Self, BodyError> {
        let matrix = rotation.to_rotation_matrix();
        let place = |x: &Vector3<f64>| matrix * x + translation;
        // z = L (x - c) and x' = R x + t give z = L Rᵀ (x' - (R c + t)).
        let Normalization { center, linear } = &self.normalization;
        let normalization = Normalization { center: place(center), linear: linear * matrix.inverse().matrix() };
        let interior = place(&self.interior_point);
        let body = Self::of_proven(&self.name, normalization, self.constraints.clone(), Some(interior))?;
        Ok(Self { gap: self.gap, provenance: self.provenance.clone(), ..body })
    }

    /// Name given by its maker; not part of the identity.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// The same body of another name.
    ///
    /// # Errors
    /// [`BodyError::Name`].
    pub fn renamed(&self, name: &str) -> Result<Self, BodyError> {
        check_name(name)?;
        Ok(Self { name: name.to_owned(), ..self.clone() })
    }

    /// Hash of the content.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// Highest degree of the constraints.
    pub fn degree(&self) -> usize {
        self.constraints.iter().map(|c| c.polynomial.degree()).max().unwrap_or(0)
    }

    /// Map to the normalized frame.
    pub fn normalization(&self) -> &Normalization {
        &self.normalization
    }

    /// Inverse of the normalization's `linear`, metres; rounded.
    pub fn inverse(&self) -> &Matrix3<f64> {
        &self.inverse
    }

    /// The constraints `g_i <= 1`, in the normalized frame.
    pub fn constraints(&self) -> &[Constraint] {
        &self.constraints
    }

    /// The body's place in its own frame.
    pub fn placement(&self) -> &Placement {
        &self.placement
    }

    /// Minimiser of the largest constraint, up to the accuracy of its computation; proven to lie
    /// inside.
    pub fn interior_point(&self) -> &Vector3<f64> {
        &self.interior_point
    }

    /// Upper bound of the largest constraint at the interior point: `min p` up to the accuracy of
    /// its computation.
    pub fn min_value(&self) -> f64 {
        self.min_value
    }

    /// Radius of a ball about the interior point that is proven to lie inside.
    pub fn in_radius(&self) -> f64 {
        self.in_radius
    }

    /// A ball proven to lie inside, about the centre from which the body grows in the growth
    /// distance: the interior point unless [`Body::with_growth_center`] set another.
    pub fn growth_ball(&self) -> Ball {
        self.growth.unwrap_or(Ball { center: self.interior_point, radius: self.in_radius })
    }

    /// A ball proven to contain the body.
    pub fn circumscribed(&self) -> &Ball {
        &self.circumscribed
    }

    /// A box proven to contain the body.
    pub fn bounding_box(&self) -> &Aabb {
        &self.bounding_box
    }

    /// Bounds of `|z_i|` over the body, z its normalized coordinates; proven.
    pub fn z_extent(&self) -> &Vector3<f64> {
        &self.z_extent
    }

    /// Error and curvature bounds near the body.
    pub fn trust(&self) -> &Trust {
        &self.trust
    }

    /// Where the body reaches farthest, roughly.
    pub fn outline(&self) -> &Outline {
        &self.outline
    }

    /// About the point of the body that is farthest along a unit vector, by its outline; both in
    /// the body frame, metres. Of bodies with edges one on the surface, with the constraint active
    /// there.
    pub(crate) fn farthest_in_table(&self, n: &Vector3<f64>) -> (Vector3<f64>, usize) {
        let n: [f64; 3] = (*n).into();
        let cell = self.outline.cell::<_, f64>(Scalar, n);
        let from_center = if self.is_smooth() { cell.farthest(Scalar, n) } else { cell.point };
        (self.normalization.center + Vector3::from(from_center), self.outline.active(cell.place))
    }

    /// The shape that the body is, if its projection has a closed form: box, cylinder, ball.
    #[inline(always)]
    pub fn closed_form(&self) -> Option<&ClosedForm> {
        self.closed_form.as_ref()
    }

    /// Points proven to lie in the body, close to its boundary, spread all around.
    pub fn boundary(&self) -> &[Vector3<f64>] {
        &self.boundary
    }

    /// Volume by quadrature.
    pub fn volume(&self) -> Volume {
        self.volume
    }

    /// Which points the body was proven to contain.
    pub fn points(&self) -> Option<&ContainedPoints> {
        self.points.as_ref()
    }

    /// Sets that it was fitted around, with proofs that can be checked when the set is given.
    pub fn sets(&self) -> &[ContainedSet] {
        &self.sets
    }

    /// Upper bound of the distance of any point of the body from the convex hull of its object,
    /// metres, as its maker proved it; it cannot be computed from the body alone.
    pub fn gap_m(&self) -> Option<f64> {
        self.gap
    }

    /// Where the body comes from.
    pub fn provenance(&self) -> Option<&Provenance> {
        self.provenance.as_ref()
    }

    /// The largest constraint at a point of the body frame, up to rounding: at most 1 inside.
    pub fn value(&self, x: &Vector3<f64>) -> f64 {
        largest(self.constraints.iter().map(|c| self.placement.jet(c, x).value))
    }

    /// Whether one constraint bounds the body, so that it has neither edges nor corners.
    pub fn is_smooth(&self) -> bool {
        self.constraints.len() == 1
    }

    /// Rigorous upper bound of the largest constraint at a point of the body frame.
    pub fn value_upper(&self, x: &Vector3<f64>) -> f64 {
        self.value_upper_within(x, 0.0)
    }

    /// Rigorous upper bound of the largest constraint over the ball of a radius (metres) about a
    /// point of the body frame.
    pub fn value_upper_within(&self, x: &Vector3<f64>, radius: f64) -> f64 {
        largest(self.constraints.iter().map(|c| self.placement.sample(c, x).value_upper(radius)))
    }

    /// Boundary point of the body frame met by the ray from the interior point along `direction` of
    /// the normalized frame.
    pub fn boundary_along(&self, direction: &Vector3<f64>) -> Vector3<f64> {
        let start = self.normalization.linear * (self.interior_point - self.normalization.center);
        let radius = radial::radius(&self.constraints, &start, direction);
        self.inverse * (direction * radius) + self.interior_point
    }

    /// How far the body reaches along the unit vector `n` of the body frame.
    pub fn support(&self, n: &Vector3<f64>) -> Support {
        let bound = support_bounds::support(&self.support_problem(), n);
        Support { point: bound.point, height_m: self.height_of(&bound) }
    }

    /// A support point along the unit vector `n` of the body frame, and the positions of the
    /// constraints with their multipliers there, metres: what [`Body::tangent_height`] takes.
    pub fn support_multipliers(&self, n: &Vector3<f64>) -> (Vector3<f64>, Vec<(usize, f64)>) {
        let (point, multipliers) = support_bounds::support_point(&self.support_problem(), n);
        let of_constraints = multipliers.into_iter().enumerate().take(self.constraints.len());
        (point, of_constraints.filter(|(_, multiplier)| *multiplier > 0.0).collect())
    }

    /// Proven upper bound of the height of the body along the unit vector `n` of the body frame
    /// above its interior point, metres, from any point x0 of the body frame and multipliers λ_i >=
    /// 0 of its constraints, metres: `n·(x - x0) <= Σ λ_i (1 - g_i(x0)) + |n - Σ λ_i ∇g_i(x0)| |x -
    /// x0|`. It is close where the two are a support point and its multipliers, as an answer's
    /// witness and active constraints are. Infinite where a multiplier is negative or of no
    /// constraint.
    pub fn tangent_height(
        &self,
        n: &Vector3<f64>,
        point: &Vector3<f64>,
        multipliers: impl IntoIterator<Item = (usize, f64)>,
    ) -> f64 {
        let bound = support_bounds::tangent(&self.support_problem(), n, point, multipliers.into_iter());
        let height = self.height_of(&bound);
        if height.is_finite() { height } else { f64::INFINITY }
    }

    fn support_problem(&self) -> SupportProblem<'_> {
        let interior_z = self.normalization.linear * (self.interior_point - self.normalization.center);
        SupportProblem {
            constraints: &self.constraints,
            placement: &self.placement,
            inverse: &self.inverse,
            interior_z,
            anchor: &self.interior_point,
        }
    }

    /// A tangent bound over the ball around the body.
    fn height_of(&self, bound: &TangentBound) -> f64 {
        let Ball { center, radius } = &self.circumscribed;
        let farthest = (bound.point - center).norm() + radius;
        (bound.reach + bound.slope * farthest) * (1.0 + 1e-14)
    }

    /// Proven upper bound of the height of the body along n above its interior point, `max n·(x -
    /// a)`: closed for boxes, cylinders and balls, else from a table, at most some hundredths too
    /// large. n of any length, body frame; metres times that length.
    #[inline(always)]
    pub fn height(&self, n: &Vector3<f64>) -> f64 {
        match (&self.heights, &self.closed_form) {
            (Some(heights), _) => heights.along(n),
            (None, Some(form)) => form.height(n) + n.dot(&(form.center() - self.interior_point)),
            (None, None) => f64::INFINITY,
        }
    }

    /// Size of the table that [`Body::height`] is looked up in, bytes.
    pub fn heights_bytes(&self) -> usize {
        self.heights.as_ref().map_or(0, SupportHeights::bytes)
    }

    /// Proves every point inside, rounding included; with convexity their whole convex hull is.
    ///
    /// # Errors
    /// The point that fails most.
    pub fn prove_contains(&self, points: &[Vector3<f64>]) -> Result<f64, NotContained> {
        all_inside(points.iter().map(|point| self.value_upper(point)))
    }

    /// The same body with the record of the points it is proven to contain.
    ///
    /// # Errors
    /// The point that fails most.
    pub fn with_points(mut self, points: &[Vector3<f64>]) -> Result<Self, NotContained> {
        self.prove_contains(points)?;
        self.points = Some(ContainedPoints::of(points));
        Ok(self)
    }

    /// The same body with the record of a set it contains, which is proven here and now.
    ///
    /// # Errors
    /// Why the proof fails.
    pub fn with_set(mut self, set: &BasicSet, record: ContainedSet) -> Result<Self, NotContaining> {
        record.containment.prove(&BasicSet::from(&self), set)?;
        self.sets.push(record);
        Ok(self)
    }

    /// The same body with the note of its [`Body::gap_m`]; a body's file with one that is negative
    /// or beyond the body's size is refused.
    pub fn with_gap(mut self, gap_m: f64) -> Self {
        self.gap = Some(gap_m);
        self
    }

    /// The same body growing from `center` (metres, body frame) in the growth distance. As it
    /// changes answers it changes the id, and the body's file keeps it.
    ///
    /// # Errors
    /// [`BodyError::GrowthCenter`] for a point that is not proven inside: it must lie within the
    /// polytope of [`Body::boundary`], which all but reaches the boundary.
    pub fn with_growth_center(mut self, center: Vector3<f64>) -> Result<Self, BodyError> {
        let radius = radial::in_radius(&self.boundary, &center, self.inverse.determinant() < 0.0);
        // Not `<=`: a NaN is not inside.
        if !(radius > 0.0) {
            return Err(BodyError::GrowthCenter { center: center.into() });
        }
        self.growth = Some(Ball { center, radius });
        self.id = BodyId::of(&self.normalization, &self.constraints, Some(&center));
        Ok(self)
    }

    /// The same body with its origin noted; texts should pass [`check_name`], or the body's file is
    /// refused.
    pub fn with_provenance(mut self, provenance: Provenance) -> Self {
        self.provenance = Some(provenance);
        self
    }
}

impl<'a> From<&'a Body> for BasicSet<'a> {
    fn from(body: &'a Body) -> Self {
        let polynomials = body.constraints().iter().map(|constraint| &constraint.polynomial).collect();
        Self { normalization: body.normalization(), polynomials }
    }
}
