//! A bounded basic set, and where it is.

use crate::body::{Aabb, BasicSet, Body, BodyId, Obstacle, Placement, SosBody};
use crate::measure::Pose;
use crate::polynomial::{Polynomial, Substitution};
use nalgebra::{Matrix3, Vector3};

/// Rounding of a point moved by a pose, relative to the sum of the lengths of point and
/// translation; dimensionless. A quaternion of unit length to a few units in the last place,
/// applied in some thirty operations.
///
/// A smaller value could leave out points of the set and make a lower bound false; a larger one
/// makes brackets of far poses wider. Exercised by
/// `two_of_the_same_share_their_cover_and_far_ones_lose_what_poses_round`.
const POSE_ROUNDING: f64 = 128.0 * f64::EPSILON;

/// Steps that pull a point into its set.
const MAX_PULLS: usize = 60;

/// A basic set in its own frame, with a box that contains it.
#[derive(Clone, Debug)]
pub struct BoundedSet<'a> {
    /// The set.
    pub set: BasicSet<'a>,
    /// A box around it, metres; where the set reaches outside, only the part in the box counts.
    pub bounding_box: Aabb,
    /// Names the set, so that what is known of it is kept from query to query; none if it has no
    /// name.
    pub id: Option<BodyId>,
}

impl<'a> From<&'a Body> for BoundedSet<'a> {
    fn from(body: &'a Body) -> Self {
        Self { set: body.into(), bounding_box: *body.bounding_box(), id: Some(*body.id()) }
    }
}

impl<'a> From<&'a SosBody> for BoundedSet<'a> {
    fn from(body: &'a SosBody) -> Self {
        Self { set: body.into(), bounding_box: *body.bounding_box(), id: Some(*body.id()) }
    }
}

impl<'a> From<&'a Obstacle> for BoundedSet<'a> {
    fn from(obstacle: &'a Obstacle) -> Self {
        match obstacle {
            Obstacle::Body(body) => (&**body).into(),
            Obstacle::SosBody(body) => (&**body).into(),
        }
    }
}

/// A bounded set at a pose.
#[derive(Clone, Debug)]
pub struct PlacedSet<'a> {
    /// The set.
    pub of: BoundedSet<'a>,
    /// From its own frame to a common one.
    pub pose: Pose,
}

/// Why a set cannot be used.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PlacedSetError {
    /// No polynomial.
    #[error("it has no polynomial: it is the whole space; send one at least")]
    NoPolynomial,
    /// A map with numbers that are not finite, or without an inverse that can be enclosed.
    #[error("its normalization is not finite or cannot be inverted; fit it again")]
    Normalization,
    /// A box that is empty or unbounded.
    #[error("its bounding box is empty or unbounded; bound the set")]
    BoundingBox,
}

impl<'a> PlacedSet<'a> {
    /// A set where it stands.
    pub fn new(of: impl Into<BoundedSet<'a>>, pose: Pose) -> Self {
        Self { of: of.into(), pose }
    }

    /// The map from its normalized coordinates to the common frame, enclosed.
    ///
    /// # Errors
    /// A set that cannot be used.
    pub fn frame(&self) -> Result<Substitution, PlacedSetError> {
        if self.of.set.polynomials.is_empty() {
            return Err(PlacedSetError::NoPolynomial);
        }
        let Aabb { min, max } = self.of.bounding_box;
        if !(0..3).all(|axis| min[axis] <= max[axis] && min[axis].is_finite() && max[axis].is_finite()) {
            return Err(PlacedSetError::BoundingBox);
        }
        let normalization = self.of.set.normalization;
        if !normalization.center.iter().chain(&normalization.linear).all(|value| value.is_finite()) {
            return Err(PlacedSetError::Normalization);
        }
        let rotation = self.pose.rotation().to_rotation_matrix().into_inner();
        Substitution::to_space(&normalization.linear, &normalization.center, &rotation, self.pose.translation())
            .ok_or(PlacedSetError::Normalization)
    }

    /// The map from its normalized coordinates to those of another set, enclosed.
    ///
    /// # Errors
    /// A set that cannot be used.
    pub fn frame_to(&self, other: &PlacedSet<'_>) -> Result<Substitution, PlacedSetError> {
        let normalization = other.of.set.normalization;
        let rotation = other.pose.rotation().to_rotation_matrix().into_inner();
        let space = self.frame()?;
        Ok(space.then_normalized(&normalization.linear, &normalization.center, &rotation, other.pose.translation()))
    }

    /// Half the diagonal of its box, metres.
    pub fn radius_m(&self) -> f64 {
        0.5 * (self.of.bounding_box.max - self.of.bounding_box.min).norm()
    }

    /// Normalized coordinates of a point of the common frame, up to rounding.
    pub(super) fn normalized(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.of.set.normalization.linear * (self.to_body(x) - self.of.set.normalization.center)
    }

    /// The polynomial with the largest value at a point of the common frame, and the normalized
    /// coordinates of that.
    pub(super) fn largest_at(&self, x: &Vector3<f64>) -> (&'a Polynomial, Vector3<f64>) {
        let z = self.normalized(x);
        let value = |g: &&'a Polynomial| g.evaluate(&z).value;
        let largest = self.of.set.polynomials.iter().copied().max_by(|a, b| value(a).total_cmp(&value(b)));
        (largest.unwrap_or(self.of.set.polynomials[0]), z)
    }

    /// The linear part of the map from the common frame to normalized coordinates, up to rounding.
    pub(super) fn linear(&self) -> Matrix3<f64> {
        self.of.set.normalization.linear * self.pose.rotation().to_rotation_matrix().into_inner().transpose()
    }

    /// A test whether points are in the set; none where its map cannot be inverted.
    pub fn membership(&self) -> Option<Membership<'_>> {
        let normalization = self.of.set.normalization;
        let inverse = normalization.linear.try_inverse()?;
        let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
        Some(Membership { set: self, placement })
    }

    fn to_body(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation().inverse_transform_vector(&(x - self.pose.translation()))
    }
}

/// Whether points of the common frame are in a set.
pub struct Membership<'a> {
    set: &'a PlacedSet<'a>,
    placement: Placement,
}

impl Membership<'_> {
    /// Whether a point is proven to be in the set, wherever the rounding of the pose leads.
    pub fn contains(&self, x: &Vector3<f64>) -> bool {
        let PlacedSet { of, pose } = self.set;
        let Aabb { min, max } = of.bounding_box;
        let rounding = POSE_ROUNDING * (x.norm() + pose.translation().norm());
        let body = self.set.to_body(x);
        (0..3).all(|axis| body[axis] - rounding >= min[axis] && body[axis] + rounding <= max[axis])
            && of.set.polynomials.iter().all(|g| self.placement.sample_of(g, &body).value_upper(rounding) <= 1.0)
    }

    /// The point moved against the gradient until it is proven inside; none if it does not get
    /// there.
    pub fn pulled(&self, mut x: Vector3<f64>) -> Option<Vector3<f64>> {
        let linear = self.set.linear();
        let mut extra = 1e-14;
        for _ in 0..MAX_PULLS {
            if self.contains(&x) {
                return Some(x);
            }
            let (g, z) = self.set.largest_at(&x);
            let jet = g.evaluate(&z);
            let gradient = linear.tr_mul(&jet.gradient);
            let excess = (jet.value - 1.0).max(0.0) + extra;
            extra *= 4.0;
            x -= gradient * (excess / gradient.norm_squared().max(f64::MIN_POSITIVE));
        }
        None
    }

    /// Upper bound of the largest polynomial at a point; NaN where one is not a number.
    pub fn largest_value(&self, x: &Vector3<f64>) -> f64 {
        let PlacedSet { of, pose } = self.set;
        let rounding = POSE_ROUNDING * (x.norm() + pose.translation().norm());
        let body = self.set.to_body(x);
        let values = of.set.polynomials.iter().map(|g| self.placement.sample_of(g, &body).value_upper(rounding));
        values.fold(f64::NEG_INFINITY, |most, value| if value.is_nan() { value } else { most.max(value) })
    }
}
