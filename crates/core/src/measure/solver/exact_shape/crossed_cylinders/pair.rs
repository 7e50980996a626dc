//! Two cylinders at an angle, in the frame that both axes lie in a plane of.

use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// Two cylinders, in a frame whose x axis is along the first axis and whose z axis is across both;
/// of either handedness.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure::solver::exact_shape) struct CrossedCylinders {
    /// Metres.
    pub(super) radii: [f64; 2],
    pub(super) half_heights: [f64; 2],
    /// Unit vectors along the axes; the second has no negative component.
    pub(super) axes: [Vector3<f64>; 2],
    /// Sine of their angle.
    pub(super) sine: f64,
    /// From the centre of the first to that of the second, metres; not downwards.
    pub(super) between: Vector3<f64>,
    /// From this frame to that of the first cylinder.
    pub(super) frame: Matrix3<f64>,
    /// Both sizes and the vector between the centres, metres.
    pub(super) reach: f64,
    /// Bound of the error of the axes, radians.
    pub(super) turned: f64,
    /// Bound of the error of the overlap along a direction, metres.
    pub(super) error: f64,
}

impl CrossedCylinders {
    /// Of a cylinder along z, and another one with this axis, a unit vector not along z, that far
    /// from it; radii and half heights in metres. Axes are off by at most `turned` radians, places
    /// by `displacement` metres besides.
    pub(in crate::measure::solver::exact_shape) fn new(
        [radii, half_heights]: [[f64; 2]; 2],
        (axis, between): (Vector3<f64>, Vector3<f64>),
        (turned, displacement): (f64, f64),
    ) -> Self {
        let axis = axis * 1_f64.copysign(axis.z);
        let sine = axis.x.hypot(axis.y);
        let (x, y) = (axis.x / sine, axis.y / sine);
        let up = Vector3::new(-y, x, 0.0);
        let up = up * 1_f64.copysign(up.dot(&between));
        let frame = Matrix3::from_columns(&[Vector3::z(), Vector3::new(x, y, 0.0), up]);
        let reach = radii[0].hypot(half_heights[0]) + radii[1].hypot(half_heights[1]) + between.norm();
        Self {
            radii,
            half_heights,
            axes: [Vector3::x(), Vector3::new(axis.z.min(1.0), sine, 0.0)],
            sine,
            between: frame.tr_mul(&between),
            frame,
            reach,
            turned,
            error: displacement + (turned + gamma(64)) * reach,
        }
    }

    /// Bound of the error of the overlap along a direction, metres.
    pub(in crate::measure::solver::exact_shape) fn error(&self) -> f64 {
        self.error
    }
}
