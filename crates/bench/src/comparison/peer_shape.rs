//! Shapes as other libraries take them.

use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::shape::{Ball, Capsule, ConvexPolyhedron, Cuboid, Cylinder, SharedShape};
use std::f64::consts::FRAC_PI_2;
use std::ffi::OsString;
use std::path::PathBuf;

use super::parry::NoHull;
use super::peer::PeerError;

/// A convex hull, or a shape about the origin whose axis is z; metres.
#[derive(Clone, Copy, Debug)]
pub enum PeerShape<'a> {
    /// The convex hull of points.
    Hull(&'a [Vector3<f64>]),
    /// A ball.
    Ball {
        /// Its radius.
        radius_m: f64,
    },
    /// A box.
    Cuboid {
        /// Half of its edges.
        half_extents_m: Vector3<f64>,
    },
    /// A cylinder.
    Cylinder {
        /// Its radius.
        radius_m: f64,
        /// Half of its height.
        half_height_m: f64,
    },
    /// All points within a radius of a segment.
    Capsule {
        /// The radius.
        radius_m: f64,
        /// Half of the length of the segment.
        half_height_m: f64,
    },
}

impl PeerShape<'_> {
    /// What coal's program takes in place of it on its command line.
    ///
    /// # Errors
    /// [`PeerError`] where the points of a hull cannot be `kept`, in a file that is named instead.
    pub(super) fn coal_argument(
        &self,
        kept: impl FnOnce(&[Vector3<f64>]) -> Result<PathBuf, PeerError>,
    ) -> Result<OsString, PeerError> {
        let text = match *self {
            Self::Hull(points) => return kept(points).map(PathBuf::into_os_string),
            Self::Ball { radius_m } => format!("ball:{radius_m:e}"),
            Self::Cuboid { half_extents_m: h } => format!("box:{:e},{:e},{:e}", h.x, h.y, h.z),
            Self::Cylinder { radius_m, half_height_m } => format!("cylinder:{radius_m:e},{half_height_m:e}"),
            Self::Capsule { radius_m, half_height_m } => format!("capsule:{radius_m:e},{half_height_m:e}"),
        };
        Ok(text.into())
    }

    /// Parry's shape, and its frame in ours: the axis of parry's cylinders is y.
    ///
    /// # Errors
    /// [`NoHull`].
    pub fn parry(&self) -> Result<(SharedShape, ParryPose), NoHull> {
        let shape = match *self {
            Self::Hull(points) => {
                let points: Vec<Vector> = points.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
                SharedShape::new(ConvexPolyhedron::from_convex_hull(&points).ok_or(NoHull)?)
            }
            Self::Ball { radius_m } => SharedShape::new(Ball::new(radius_m)),
            Self::Cuboid { half_extents_m: h } => SharedShape::new(Cuboid::new(Vector::new(h.x, h.y, h.z))),
            Self::Cylinder { radius_m, half_height_m } => {
                let turned = ParryPose::from_parts(Vector::ZERO, Rotation::from_rotation_x(FRAC_PI_2));
                return Ok((SharedShape::new(Cylinder::new(half_height_m, radius_m)), turned));
            }
            Self::Capsule { radius_m, half_height_m } => {
                let end = Vector::new(0.0, 0.0, half_height_m);
                SharedShape::new(Capsule::new(-end, end, radius_m))
            }
        };
        Ok((shape, ParryPose::IDENTITY))
    }
}
