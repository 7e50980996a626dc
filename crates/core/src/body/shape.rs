//! The content of a file: a body or a compound.

use super::bounds::{Aabb, Ball};
use super::compound::Compound;
use super::convex_body::Body;
use super::file_error::BodyFileError;
use super::file_format::{COMPOUND_KIND, kind};
use super::id::BodyId;
use super::part_tree::PartTree;
use super::solid::{Sealed, Solid};

/// A body or a compound, which measures take alike.
#[derive(Clone, Debug)]
pub enum Shape {
    /// One convex body.
    Body(Box<Body>),
    /// The union of several.
    Compound(Box<Compound>),
}

impl Shape {
    /// Reads and re-proves a file, of a body or of a compound as its `kind` says.
    ///
    /// # Errors
    /// As [`Body::from_json`] and [`Compound::from_json`].
    pub fn from_json(text: &str) -> Result<Self, BodyFileError> {
        if kind(text)? == COMPOUND_KIND {
            Compound::from_json(text).map(|compound| Shape::Compound(Box::new(compound)))
        } else {
            Body::from_json(text).map(|body| Shape::Body(Box::new(body)))
        }
    }

    /// Its id.
    pub fn id(&self) -> &BodyId {
        match self {
            Shape::Body(body) => body.id(),
            Shape::Compound(compound) => compound.id(),
        }
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        match self {
            Shape::Body(body) => body.name(),
            Shape::Compound(compound) => compound.name(),
        }
    }

    /// How far it reaches beyond the convex hull of its object, or those of the pieces of its
    /// object, metres.
    pub fn gap_m(&self) -> Option<f64> {
        match self {
            Shape::Body(body) => body.gap_m(),
            Shape::Compound(compound) => compound.gap_m(),
        }
    }
}

impl Sealed for Shape {}

impl Solid for Shape {
    #[inline]
    fn parts(&self) -> &[Body] {
        match self {
            Shape::Body(body) => std::slice::from_ref(body),
            Shape::Compound(compound) => compound.parts(),
        }
    }

    fn id(&self) -> &BodyId {
        Shape::id(self)
    }

    fn circumscribed(&self) -> &Ball {
        match self {
            Shape::Body(body) => body.circumscribed(),
            Shape::Compound(compound) => compound.circumscribed(),
        }
    }

    fn bounding_box(&self) -> &Aabb {
        match self {
            Shape::Body(body) => body.bounding_box(),
            Shape::Compound(compound) => compound.bounding_box(),
        }
    }

    fn tree(&self) -> Option<&PartTree> {
        match self {
            Shape::Body(body) => body.tree(),
            Shape::Compound(compound) => compound.tree(),
        }
    }
}
