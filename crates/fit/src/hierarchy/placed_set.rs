//! A basic set and where it is.

use super::error::HierarchyError;
use nalgebra::{Isometry3, Vector3};
use sublevel_core::body::{Aabb, BasicSet, Body, Normalization, Obstacle, SosBody};
use sublevel_core::branch_and_bound::{self, BoundedSet};
use sublevel_core::measure::Pose;
use sublevel_core::polynomial::{Polynomial, Substitution};

/// A basic set at a pose.
#[derive(Clone, Debug)]
pub struct PlacedSet<'a> {
    /// The set in its own frame.
    pub set: BasicSet<'a>,
    /// A box that contains it, metres in its own frame; where the set reaches outside, only the
    /// part in the box counts.
    pub bounding_box: Aabb,
    /// From its own frame to a common one, metres.
    pub pose: Isometry3<f64>,
    /// Points of the set near its boundary, metres in its own frame: where a search for near points
    /// begins. They prove nothing.
    pub near_boundary: Vec<Vector3<f64>>,
}

/// Largest deviation of the squared length of a quaternion from 1.
const UNIT_LENGTH: f64 = 2e-15;

/// Rays whose ends are the points that a search begins with.
const RAYS: usize = 200;

impl<'a> PlacedSet<'a> {
    /// A convex body.
    pub fn of_body(body: &'a Body, pose: Isometry3<f64>) -> Self {
        let near_boundary = body.boundary().iter().take(RAYS).copied().collect();
        Self { set: body.into(), bounding_box: *body.bounding_box(), pose, near_boundary }
    }

    /// A set that need not be convex.
    pub fn of_sos_body(body: &'a SosBody, pose: Isometry3<f64>) -> Self {
        let near_boundary = body.chords(RAYS).into_iter().flat_map(|(from, to)| [from, to]).collect();
        Self { set: body.into(), bounding_box: *body.bounding_box(), pose, near_boundary }
    }

    /// Either.
    pub fn of(obstacle: &'a Obstacle, pose: Isometry3<f64>) -> Self {
        match obstacle {
            Obstacle::Body(body) => Self::of_body(body, pose),
            Obstacle::SosBody(body) => Self::of_sos_body(body, pose),
        }
    }

    /// Whether it can be used.
    pub(super) fn check(&self, index: usize) -> Result<(), HierarchyError> {
        if self.set.polynomials.is_empty() {
            return Err(HierarchyError::NoPolynomial(index));
        }
        let pose = self.pose.to_matrix();
        if !pose.iter().all(|value| value.is_finite()) {
            return Err(HierarchyError::Set { index, why: "its pose is not finite; send finite numbers" });
        }
        if !((self.pose.rotation.norm_squared() - 1.0).abs() <= UNIT_LENGTH) {
            return Err(HierarchyError::Set { index, why: "its rotation is not of unit length; normalise it" });
        }
        let normalization = self.set.normalization;
        if !normalization.center.iter().chain(&normalization.linear).all(|value| value.is_finite()) {
            return Err(HierarchyError::Set { index, why: "its normalization is not finite; fit it again" });
        }
        let Aabb { min, max } = self.bounding_box;
        if !(0..3).all(|axis| min[axis] <= max[axis] && min[axis].is_finite() && max[axis].is_finite()) {
            return Err(HierarchyError::Set { index, why: "its bounding box is empty or unbounded; bound the set" });
        }
        Ok(())
    }

    /// The map from its normalized coordinates to the common frame, enclosed.
    pub(super) fn frame(&self, index: usize) -> Result<Substitution, HierarchyError> {
        let rotation = self.pose.rotation.to_rotation_matrix().into_inner();
        let normalization = self.set.normalization;
        let frame = Substitution::to_space(
            &normalization.linear,
            &normalization.center,
            &rotation,
            &self.pose.translation.vector,
        );
        frame.ok_or(HierarchyError::Set { index, why: "its normalization cannot be inverted; fit it again" })
    }

    /// Upper bounds of the magnitudes of its normalized coordinates.
    pub(super) fn coordinate_bounds(&self) -> [f64; 3] {
        let normalization = self.set.normalization;
        let Aabb { min, max } = self.bounding_box;
        let reach = Vector3::from_fn(|k, _| {
            let center = normalization.center[k];
            ((max[k] - center).abs()).max((min[k] - center).abs()).next_up()
        });
        std::array::from_fn(|row| {
            let terms = (0..3).map(|k| normalization.linear[(row, k)].abs() * reach[k]);
            terms.sum::<f64>() * (1.0 + 8.0 * f64::EPSILON)
        })
    }

    /// Half the diagonal of its box, metres.
    pub(super) fn radius_m(&self) -> f64 {
        0.5 * (self.bounding_box.max - self.bounding_box.min).norm()
    }

    /// The polynomial with the largest value at a point of the common frame.
    pub(super) fn largest_at(&self, x: &Vector3<f64>) -> (&'a Polynomial, Vector3<f64>) {
        let z = self.normalized(x);
        let value = |g: &&'a Polynomial| g.evaluate(&z).value;
        let largest = self.set.polynomials.iter().copied().max_by(|a, b| value(a).total_cmp(&value(b)));
        (largest.unwrap_or(self.set.polynomials[0]), z)
    }

    /// Normalized coordinates of a point of the common frame.
    pub(super) fn normalized(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let body = self.pose.inverse_transform_point(&(*x).into()).coords;
        self.set.normalization.linear * (body - self.set.normalization.center)
    }

    /// The point of the common frame that has these normalized coordinates, up to rounding.
    pub(super) fn in_common_frame(&self, z: &Vector3<f64>) -> Vector3<f64> {
        let Normalization { center, linear } = self.set.normalization;
        self.pose.transform_point(&(linear.try_inverse().unwrap_or_default() * z + center).into()).coords
    }

    /// The map from its normalized coordinates to those of another set, enclosed.
    pub(super) fn frame_in(&self, index: usize, other: &PlacedSet) -> Result<Substitution, HierarchyError> {
        let rotation = other.pose.rotation.to_rotation_matrix().into_inner();
        let Normalization { center, linear } = other.set.normalization;
        Ok(self.frame(index)?.then_normalized(linear, center, &rotation, &other.pose.translation.vector))
    }

    /// The same for [`sublevel_core::branch_and_bound`]; none of a pose that is none.
    pub(super) fn posed(&self) -> Option<branch_and_bound::PlacedSet<'a>> {
        let pose = Pose::from_quaternion(self.pose.translation.vector, self.pose.rotation.coords.into()).ok()?;
        let of = BoundedSet { set: self.set.clone(), bounding_box: self.bounding_box, id: None };
        Some(branch_and_bound::PlacedSet { of, pose })
    }
}
