//! What moves and what stands in its way.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::{Body, Shape, Solid};
use sublevel_core::measure::{Capsule, HalfSpace, Pose};

/// Geometry of a body of a robot or of an obstacle, in a frame of its own; metres.
#[derive(Clone, Debug)]
pub enum MotionShape {
    /// A body or a compound.
    Solid(Arc<Shape>),
    /// A capsule about the z axis.
    Capsule(Capsule),
}

/// A body or an obstacle, by its position in the list of these.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, serde::Serialize, serde::Deserialize)]
pub enum MotionItem {
    /// A body that is fixed to a link.
    Body(usize),
    /// An obstacle.
    Obstacle(usize),
}

/// A body that is fixed to a link.
#[derive(Clone, Debug)]
pub struct MotionBody {
    /// Unique among bodies and obstacles.
    pub name: Arc<str>,
    /// Position of the link in [`Kinematics::links`](crate::Kinematics::links).
    pub link: usize,
    /// Frame of the body to the frame of the link.
    pub place: Pose,
    /// What it is.
    pub shape: MotionShape,
}

/// What stands in the way.
#[derive(Clone, Debug)]
pub struct MotionObstacle {
    /// Unique among bodies and obstacles.
    pub name: Arc<str>,
    /// What it is, and where.
    pub placed: PlacedObstacle,
}

/// An obstacle where it is.
#[derive(Clone, Debug)]
pub enum PlacedObstacle {
    /// At a pose: its frame to the world.
    Still(MotionShape, Pose),
    /// In a frame that moves: its origin along a line at a constant velocity, while it turns at a
    /// constant rate by the smaller angle.
    Moving {
        /// What it is.
        shape: MotionShape,
        /// The moving frame at the start of the path, to the world.
        from: Pose,
        /// The moving frame at the end of the path, to the world.
        to: Pose,
        /// Frame of the shape to the moving frame: the identity of what moves by itself, else the
        /// place of what is held there.
        place: Pose,
    },
    /// A half-space of the world frame, with a bound of the error of its offset, metres.
    HalfSpace(HalfSpace, f64),
}

/// A convex piece of a body or of an obstacle.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Piece<'a> {
    Body(&'a Body),
    Capsule(&'a Capsule),
    HalfSpace(&'a HalfSpace, f64),
}

impl MotionShape {
    /// Number of convex pieces.
    pub(crate) fn pieces(&self) -> usize {
        match self {
            Self::Solid(shape) => shape.parts().len(),
            Self::Capsule(_) => 1,
        }
    }

    /// One of them; the last one if there are not so many.
    pub(crate) fn piece(&self, index: usize) -> Piece<'_> {
        match self {
            Self::Solid(shape) => {
                let parts = shape.parts();
                Piece::Body(&parts[index.min(parts.len() - 1)])
            }
            Self::Capsule(capsule) => Piece::Capsule(capsule),
        }
    }
}

impl PlacedObstacle {
    pub(crate) fn pieces(&self) -> usize {
        match self {
            Self::Still(shape, _) | Self::Moving { shape, .. } => shape.pieces(),
            Self::HalfSpace(..) => 1,
        }
    }

    pub(crate) fn piece(&self, index: usize) -> Piece<'_> {
        match self {
            Self::Still(shape, _) | Self::Moving { shape, .. } => shape.piece(index),
            Self::HalfSpace(half_space, error_m) => Piece::HalfSpace(half_space, *error_m),
        }
    }
}

impl Piece<'_> {
    /// Centre, in its own frame, and radius of a ball that contains it, metres; infinite around
    /// half-spaces.
    pub(crate) fn ball(&self) -> (Vector3<f64>, f64) {
        match self {
            Self::Body(body) => {
                let ball = body.circumscribed();
                (ball.center, ball.radius)
            }
            Self::Capsule(capsule) => (Vector3::zeros(), capsule.reach_m() * (1.0 + 1e-15)),
            Self::HalfSpace(..) => (Vector3::zeros(), f64::INFINITY),
        }
    }
}
