//! Certified convex bodies: `{x : g_1(x) <= 1, ..., g_m(x) <= 1}` with sos-convex `g_i`, proven
//! bounded and non-empty.
//!
//! A [`Body`] exists only with its proofs: making one, from numbers or from a file, checks every
//! certificate and proves or recomputes everything derived from the polynomials. What need not be
//! convex is an [`SosBody`], which no measure takes. Lengths are metres in the body frame unless a
//! name says otherwise; `z` is the unit-free normalized frame, `z = L (x - c)`.

mod cap;
mod component;
mod compound;
mod compound_file;
mod cone;
mod contained_file;
mod containment;
mod division;
mod error_bounds;
mod file;
mod id;
mod mesh_cover;
mod mesh_piece;
mod objective;
mod obstacle;
mod placement;
mod primitives;
mod radial;
mod shape;
mod sos;
mod sphere;
mod support_bounds;
mod support_table;
mod union;

pub use compound::{Compound, CompoundError, MAX_PARTS, Solid};
pub use cone::{Cone, UnknownCone};
pub use containment::{BasicSet, ContainedSet, Containment, ProofFrame};
pub use division::{Cut, Division, DivisionError};
pub use error_bounds::{ConstraintTrust, Trust};
pub use file::BodyFileError;
pub use id::{BodyId, ParseIdError};
pub use mesh_cover::{Covered, Covering, NotCovered};
pub use mesh_piece::{Caps, MeshError, Piece, Spot};
pub use objective::{Objective, UnknownObjective};
pub use obstacle::Obstacle;
pub use placement::{Placement, Sample};
pub use radial::Volume;
pub use radial::{boundary_radius, sphere_rule};
pub use shape::Shape;
pub use sos::{Coverage, Relaxation, SosBody, SosBodyError, SosMethod, TriangleError, Uncovered};
pub use sphere::{Sphere, fibonacci_lattice};
pub use support_table::{Cell, Outline};

use crate::polynomial::{CertificateError, HessianGram, NotContaining, Polynomial};
use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use serde::{Deserialize, Serialize};
use support_bounds::Extent;

/// Most constraints a body may have.
pub const MAX_CONSTRAINTS: usize = 16;

/// Smallest depth `1 - min g` of a body; below it the interior drowns in rounding.
const MIN_DEPTH: f64 = 1e-9;

/// The affine map `z = linear (x - center)` from the body frame (x, metres) to the normalized frame
/// (z, unit-free).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Normalization {
    /// Point of the body frame that z = 0 stands for, metres.
    pub center: Vector3<f64>,
    /// Matrix per metre.
    pub linear: Matrix3<f64>,
}

/// One sos-convex constraint `g(z) <= 1` with the certificate that it is sos-convex.
#[derive(Clone, Debug, PartialEq)]
pub struct Constraint {
    /// The polynomial g, in the normalized frame.
    pub polynomial: Polynomial,
    /// Gram matrix of its Hessian form.
    pub gram: HessianGram,
}

/// A ball, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ball {
    /// Centre.
    pub center: Vector3<f64>,
    /// Radius.
    pub radius: f64,
}

/// An axis-aligned box, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vector3<f64>,
    /// Largest coordinates.
    pub max: Vector3<f64>,
}

/// How far a body reaches along a direction, body frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Support {
    /// Point farthest along it, up to the accuracy of its computation.
    pub point: Vector3<f64>,
    /// Proven upper bound of the height of all points along it above the interior point, metres.
    pub height_m: f64,
}

/// Which points a body was proven to contain.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ContainedPoints {
    /// Number of points.
    pub count: usize,
    /// SHA-256 of their coordinates in metres as little-endian f64, in input order, as 64
    /// hexadecimal digits.
    pub sha256: String,
}

impl ContainedPoints {
    /// Count and hash of these points.
    pub fn of(points: &[Vector3<f64>]) -> Self {
        Self { count: points.len(), sha256: id::hash_points(points) }
    }
}

/// Where a fitted body comes from; information only, not part of its identity.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Provenance {
    /// Name of the input, without its folder.
    pub input: String,
    /// Objective of the fit, such as `logdet-p`.
    pub objective: String,
    /// Whether the volume was refined after the fit.
    pub refined: bool,
    /// Vertices of the convex hull of the input.
    pub hull_vertices: usize,
    /// Volume of the convex hull, m³.
    pub hull_volume_m3: f64,
}

/// Why numbers do not make a body.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyError {
    /// A name that is empty, too long or has control characters.
    #[error("name {0:?} must have 1 to 200 characters and no control characters")]
    Name(String),
    /// No constraint or too many.
    #[error("a body has 1 to {MAX_CONSTRAINTS} constraints, not {0}; intersect fewer or fit one polynomial")]
    ConstraintCount(usize),
    /// A degree other than 2, 4, 6, 8.
    #[error("degree {0} is not one of 2, 4, 6, 8")]
    Degree(u8),
    /// The normalization is not an invertible affine map.
    #[error("normalization: {0}; it must be finite and invertible, with lengths between 1e-30 and 1e30 m")]
    Normalization(&'static str),
    /// A constraint is not proven sos-convex.
    #[error("constraints[{index}]: {source}")]
    Certificate {
        /// Which constraint.
        index: usize,
        /// What is missing.
        source: CertificateError,
    },
    /// The interior is empty or too shallow.
    #[error(
        "the body has no proven interior: min g = {min_value:e}, which must be at most 1 - {MIN_DEPTH:e}; \
         renormalise g to 1 + (g - 1)/(1 - min g) if the set is meant to have one"
    )]
    Interior {
        /// Smallest value found of the largest constraint.
        min_value: f64,
    },
    /// No ball inside survives rounding.
    #[error(
        "no ball around the interior point is proven inside: the body is too thin, or too far from the origin of its frame \
         for its size; move the frame to the body"
    )]
    Thin,
    /// A growth centre that is not proven to lie well inside.
    #[error(
        "the growth centre {center:?} is not proven inside; take a point farther from the boundary, such as the interior \
         point of the body"
    )]
    GrowthCenter {
        /// The point, metres in the body frame.
        center: [f64; 3],
    },
    /// No proof that the body is bounded.
    #[error(
        "the body is not proven bounded (residual {residual:.1e}); add constraints that close it in every direction"
    )]
    Unbounded {
        /// Largest residual of a support bound along an axis.
        residual: f64,
    },
}

/// A point that is not proven inside.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("point {index} is not proven inside: largest constraint {value} > 1")]
pub struct NotContained {
    /// Position of the point.
    pub index: usize,
    /// Rigorous upper bound of the largest constraint there.
    pub value: f64,
}

/// A closed bounded convex set with non-empty interior, certified; immutable.
#[derive(Clone, Debug)]
pub struct Body {
    name: String,
    id: BodyId,
    normalization: Normalization,
    inverse: Matrix3<f64>,
    constraints: Vec<Constraint>,
    placement: Placement,
    interior_point: Vector3<f64>,
    min_value: f64,
    in_radius: f64,
    growth: Option<Ball>,
    bounding_box: Aabb,
    circumscribed: Ball,
    z_extent: Vector3<f64>,
    trust: Trust,
    boundary: Vec<Vector3<f64>>,
    outline: Outline,
    volume: Volume,
    points: Option<ContainedPoints>,
    sets: Vec<ContainedSet>,
    gap: Option<f64>,
    provenance: Option<Provenance>,
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
    fn with_interior(
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
        let outline = Outline::new(&constraints, &inverse, &interior_z);
        let trust = Trust::new(&constraints, &normalization, &inverse, &z_extent, outline.reach(), &interior_z);
        let volume = radial::volume(&constraints, &normalization.linear, &interior_z);
        let id = BodyId::of(&normalization, &constraints, None);
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

    /// Sets that it was fitted around, with proofs that hold whenever the set is at hand.
    pub fn sets(&self) -> &[ContainedSet] {
        &self.sets
    }

    /// Upper bound of the distance of any point of the body from the convex hull of its object,
    /// metres, as its maker proved it; the body alone does not tell.
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
        let interior_z = self.normalization.linear * (self.interior_point - self.normalization.center);
        let anchor = &self.interior_point;
        let bound = support_bounds::support(&self.constraints, &self.placement, &self.inverse, &interior_z, anchor, n);
        let Ball { center, radius } = &self.circumscribed;
        let farthest = (bound.point - center).norm() + radius;
        Support { point: bound.point, height_m: (bound.reach + bound.slope * farthest) * (1.0 + 1e-14) }
    }

    /// Proves every point inside, rounding included; with convexity their whole convex hull is.
    ///
    /// # Errors
    /// The point that fails most.
    pub fn prove_contains(&self, points: &[Vector3<f64>]) -> Result<f64, NotContained> {
        prove_contains(points, |point| self.value_upper(point))
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
    /// What the proof lacks.
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

/// The largest of the bounds of the values at the points, if it is at most 1.
fn prove_contains(points: &[Vector3<f64>], value_upper: impl Fn(&Vector3<f64>) -> f64) -> Result<f64, NotContained> {
    let mut worst = NotContained { index: 0, value: f64::MIN };
    for (index, point) in points.iter().enumerate() {
        let value = value_upper(point);
        // A NaN is never inside.
        if !(value <= worst.value) {
            worst = NotContained { index, value };
            if value.is_nan() {
                break;
            }
        }
    }
    if worst.value <= 1.0 { Ok(worst.value) } else { Err(worst) }
}

/// Whether a text can name a body, or what it was made from.
///
/// # Errors
/// [`BodyError::Name`].
pub fn check_name(name: &str) -> Result<(), BodyError> {
    if name.is_empty() || name.chars().count() > 200 || name.chars().any(char::is_control) {
        return Err(BodyError::Name(name.chars().take(200).collect()));
    }
    Ok(())
}

/// Largest of the values; NaN if any is NaN, which `f64::max` would pass over.
pub(crate) fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::NEG_INFINITY, |most, value| if value.is_nan() || value > most { value } else { most })
}

/// The largest of values that must be at most 1; of none, the least number.
fn all_inside(values: impl Iterator<Item = f64>) -> Result<f64, NotContained> {
    let mut worst = NotContained { index: 0, value: f64::MIN };
    for (index, value) in values.enumerate() {
        // A NaN is never inside.
        if !(value <= worst.value) {
            worst = NotContained { index, value };
            if value.is_nan() {
                break;
            }
        }
    }
    if worst.value <= 1.0 { Ok(worst.value) } else { Err(worst) }
}

fn invert(normalization: &Normalization) -> Result<Matrix3<f64>, BodyError> {
    let Normalization { center, linear } = normalization;
    if !center.iter().chain(linear.iter()).all(|value| value.is_finite()) {
        return Err(BodyError::Normalization("an entry is not finite"));
    }
    if center.amax() > 1e30 || !(1e-30..=1e30).contains(&linear.amax()) {
        return Err(BodyError::Normalization("an entry is out of range"));
    }
    let inverse = linear.try_inverse().ok_or(BodyError::Normalization("linear is singular"))?;
    // Relative to the rows, whose lengths may differ by any factor: the bounds of a placement rest
    // on it.
    let rows = Vector3::from_fn(|i, _| linear.row(i).norm());
    let error = (linear * inverse - Matrix3::identity()).abs() * rows;
    if (0..3).all(|i| error[i] <= 1e-6 * rows[i]) && inverse.amax() <= 1e30 {
        Ok(inverse)
    } else {
        Err(BodyError::Normalization("linear is numerically singular"))
    }
}

#[cfg(test)]
mod tests;
