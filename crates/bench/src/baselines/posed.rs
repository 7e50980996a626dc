//! The one constraint of a body in the world frame: what a solver is given that knows nothing of
//! certificates and brackets.

use nalgebra::{Matrix3, Vector3};
use sublevel::body::Body;
use sublevel::measure::Pose;
use sublevel::polynomial::Jet;

/// A body of one constraint at a pose.
pub(crate) struct Posed<'a> {
    body: &'a Body,
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl<'a> Posed<'a> {
    pub(crate) fn new(body: &'a Body, pose: &Pose) -> Self {
        let rotation = pose.rotation().to_rotation_matrix().into_inner();
        Self { body, rotation, translation: *pose.translation() }
    }

    /// Constraint at a point of the world, derivatives per metre. It holds where the value is at
    /// most 1.
    pub(crate) fn jet(&self, x: &Vector3<f64>) -> Jet {
        let at = self.rotation.tr_mul(&(x - self.translation));
        let jet = self.body.placement().jet(&self.body.constraints()[0], &at);
        Jet {
            value: jet.value,
            gradient: self.rotation * jet.gradient,
            hessian: self.rotation * jet.hessian * self.rotation.transpose(),
        }
    }

    /// An interior point.
    pub(crate) fn inside(&self) -> Vector3<f64> {
        self.rotation * self.body.interior_point() + self.translation
    }

    /// Where the ray from the interior point towards another point leaves the body; any ray if that
    /// is the same point.
    pub(crate) fn facing(&self, target: &Vector3<f64>) -> Vector3<f64> {
        let towards = self.body.normalization().linear * self.rotation.tr_mul(&(target - self.inside()));
        self.rotation * self.body.boundary_along(&towards.try_normalize(0.0).unwrap_or(Vector3::x())) + self.translation
    }
}

/// A pair of boundary points to start from: where the line between the interior points leaves both
/// bodies.
pub(crate) fn between([a, b]: &[Posed<'_>; 2]) -> [Vector3<f64>; 2] {
    [a.facing(&b.inside()), b.facing(&a.inside())]
}
