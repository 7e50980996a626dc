//! The distance of a point from a body with a closed form: from its projection.

use super::cuboid::Cuboid;
use super::cylinder::Cylinder;
use super::placed::{direction_to_world, to_world};
use super::projectable::Projectable;
use super::segment::Segment;
use super::shapes::Placed;
use crate::body::ExactShape;
use crate::measure::frames::pose::RELATIVE_ERROR;
use crate::measure::frames::vector::{V3, add_scaled};
use crate::polynomial::{Scalar, gamma};
use nalgebra::Vector3;

/// A proven bracket of the distance of a point, metres, and where it is attained; world frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct PointOffset {
    /// Above 0.
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    /// Unit vector from the shape to the point.
    pub(in crate::measure) normal: Vector3<f64>,
    /// The same in the frame of the shape.
    pub(in crate::measure) own_normal: V3<f64>,
    /// Nearest point of the shape.
    pub(in crate::measure) witness: Vector3<f64>,
}

/// On which side of a surface a point is.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum PointSide {
    Inside,
    Outside(PointOffset),
    /// Neither is proven: it is on the surface within rounding.
    Open,
}

/// Where a point (world frame, metres) is as seen from a shape.
pub(in crate::measure) fn offset_of_point(of_shape: Placed<'_>, point: &Vector3<f64>) -> PointSide {
    offset_of_vector(of_shape, &(point - of_shape.1.translation()), 0.0)
}

/// Where a point is as seen from a shape, by the vector to it from where the pose of the shape is
/// (orientation of the world, metres), which is known to within an error, metres.
#[inline(always)]
pub(in crate::measure) fn offset_of_vector(of_shape: Placed<'_>, vector: &Vector3<f64>, error: f64) -> PointSide {
    match *of_shape.0.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => {
            of_set(Cuboid { half_extents: half_extents_m }, 0.0, of_shape, (vector, error))
        }
        ExactShape::Cylinder { radius_m, half_height_m, .. } => {
            of_set(Cylinder { radius: radius_m, half_height: half_height_m }, 0.0, of_shape, (vector, error))
        }
        ExactShape::Capsule { radius_m, half_length_m } => {
            of_set(Segment { half_length: half_length_m }, radius_m, of_shape, (vector, error))
        }
    }
}

/// The same of all points within a radius of a set.
fn of_set<P: Projectable>(
    set: P,
    radius: f64,
    (form, pose): Placed<'_>,
    (vector, error): (&Vector3<f64>, f64),
) -> PointSide {
    let between = pose.rotation().inverse_transform_vector(vector);
    let offset = between - form.center();
    let (x, factor): (V3<f64>, f64) = match form.axes() {
        Some(axes) => (axes.tr_mul(&offset).into(), 2.0),
        None => (offset.into(), 1.0),
    };
    let displacement =
        factor * (RELATIVE_ERROR + gamma(8)) * (between.norm() + form.center().norm()) + form.displacement_m() + error;
    let seen = set.offset(Scalar, x);
    let size = x[0].abs() + x[1].abs() + x[2].abs() + set.reach() + radius;
    let rounding = gamma(48) * size + displacement;
    let n = set.in_normal_cone(Scalar, seen.feature, seen.frame[2]);
    let lower = set.separation(Scalar, n, (x, 0.0)) - radius - rounding;
    // Not `<=`: in the set it is NaN.
    if !(lower > 0.0) {
        let is_in_set = || set.thinnest() > rounding && set.shrunk(rounding).offset(Scalar, x).distance == 0.0;
        let is_inside = seen.distance + rounding <= radius || is_in_set();
        return if is_inside { PointSide::Inside } else { PointSide::Open };
    }
    let witness = add_scaled::<Scalar, f64>(set.project(Scalar, x), radius, n);
    PointSide::Outside(PointOffset {
        lower,
        upper: seen.distance - radius + rounding,
        normal: direction_to_world(form, pose, n),
        own_normal: n,
        witness: to_world(form, pose, witness),
    })
}
