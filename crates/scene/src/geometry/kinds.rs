//! The kinds of shapes that an object can have.

use std::sync::Arc;

use sublevel_core::body::{Aabb, Body, BodyId, Compound, Shape, Solid, SosBody};

use super::capsule::NamedCapsule;
use super::half_space::NamedHalfSpace;
use super::ladder::Ladder;

/// The shape of an object, immutable and named by the hash of its content. Clones share it.
#[derive(Clone, Debug)]
pub enum Geometry {
    /// A convex body or a union of several.
    Solid(Arc<Shape>),
    /// One object at several levels of detail.
    Ladder(Arc<Ladder>),
    /// A set that need not be convex: measured by branch and bound; rays know the box around it.
    SosBody(Arc<SosBody>),
    /// All points within a radius of a segment.
    Capsule(Arc<NamedCapsule>),
    /// Everything below a plane.
    HalfSpace(Arc<NamedHalfSpace>),
}

impl Geometry {
    /// Hash of its content.
    pub fn id(&self) -> &BodyId {
        match self {
            Self::Solid(shape) => shape.id(),
            Self::Ladder(ladder) => ladder.id(),
            Self::SosBody(body) => body.id(),
            Self::Capsule(capsule) => capsule.id(),
            Self::HalfSpace(half_space) => half_space.id(),
        }
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        match self {
            Self::Solid(shape) => shape.name(),
            Self::Ladder(ladder) => ladder.name(),
            Self::SosBody(body) => body.name(),
            Self::Capsule(capsule) => capsule.name(),
            Self::HalfSpace(half_space) => half_space.name(),
        }
    }

    /// A box around it, metres, body frame; none around a half-space. Of a ladder that of its
    /// finest rung.
    pub fn bounding_box(&self) -> Option<&Aabb> {
        match self {
            Self::Solid(shape) => Some(shape.bounding_box()),
            Self::Ladder(ladder) => Some(ladder.finest().bounding_box()),
            Self::SosBody(body) => Some(body.bounding_box()),
            Self::Capsule(capsule) => Some(capsule.bounding_box()),
            Self::HalfSpace(_) => None,
        }
    }

    /// The solids that measures take, coarsest first: the rungs of a ladder, or the solid itself;
    /// none for sos-bodies, capsules and half-spaces.
    pub fn rungs(&self) -> &[Arc<Shape>] {
        match self {
            Self::Solid(shape) => std::slice::from_ref(shape),
            Self::Ladder(ladder) => ladder.rungs(),
            Self::SosBody(_) | Self::Capsule(_) | Self::HalfSpace(_) => &[],
        }
    }

    /// Whether it is one convex body, a capsule or a half-space: no parts, no rungs.
    pub fn is_single(&self) -> bool {
        match self {
            Self::Solid(shape) => matches!(**shape, Shape::Body(_)),
            Self::Capsule(_) | Self::HalfSpace(_) => true,
            Self::Ladder(_) | Self::SosBody(_) => false,
        }
    }

    /// Highest degree of its polynomials; 1 of a plane, 2 of a capsule.
    pub fn degree(&self) -> usize {
        let of_shape = |shape: &Shape| match shape {
            Shape::Body(body) => body.degree(),
            Shape::Compound(compound) => compound.degree(),
        };
        match self {
            Self::Solid(_) | Self::Ladder(_) => self.rungs().iter().map(|shape| of_shape(shape)).max().unwrap_or(0),
            Self::SosBody(body) => body.degree(),
            Self::Capsule(_) => 2,
            Self::HalfSpace(_) => 1,
        }
    }

    /// How far it reaches beyond the convex hull of its object, metres, where known; 0: not at all.
    /// Of a ladder that of its finest rung.
    pub fn gap_m(&self) -> Option<f64> {
        match self {
            Self::Solid(_) | Self::Ladder(_) => self.rungs().last().and_then(|finest| finest.gap_m()),
            Self::SosBody(_) => None,
            Self::Capsule(_) | Self::HalfSpace(_) => Some(0.0),
        }
    }
}

impl From<Body> for Geometry {
    fn from(body: Body) -> Self {
        Self::Solid(Arc::new(Shape::Body(Box::new(body))))
    }
}

impl From<Compound> for Geometry {
    fn from(compound: Compound) -> Self {
        Self::Solid(Arc::new(Shape::Compound(Box::new(compound))))
    }
}

impl From<NamedCapsule> for Geometry {
    fn from(capsule: NamedCapsule) -> Self {
        Self::Capsule(Arc::new(capsule))
    }
}

impl From<SosBody> for Geometry {
    fn from(body: SosBody) -> Self {
        Self::SosBody(Arc::new(body))
    }
}
