//! Simple sets that contain a body.

use nalgebra::Vector3;

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
