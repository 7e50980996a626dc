//! What a body can be proven to contain whole: a body, or a set that need not be convex.

use super::file_error::BodyFileError;
use super::{BasicSet, Body, BodyId, SosBody, Volume};

/// A set of space that bodies are put around, with the proof that they contain it.
#[derive(Clone, Debug)]
pub enum Obstacle {
    /// A convex body.
    Body(Box<Body>),
    /// A set that need not be convex.
    SosBody(Box<SosBody>),
}

impl From<Body> for Obstacle {
    fn from(body: Body) -> Self {
        Self::Body(Box::new(body))
    }
}

impl From<SosBody> for Obstacle {
    fn from(body: SosBody) -> Self {
        Self::SosBody(Box::new(body))
    }
}

impl<'a> From<&'a Obstacle> for BasicSet<'a> {
    fn from(obstacle: &'a Obstacle) -> Self {
        match obstacle {
            Obstacle::Body(body) => (&**body).into(),
            Obstacle::SosBody(body) => (&**body).into(),
        }
    }
}

impl Obstacle {
    /// Reads and re-proves a file, of a body or of an sos-body as its `kind` says.
    ///
    /// # Errors
    /// As [`Body::from_json`] and [`SosBody::from_json`].
    pub fn from_json(text: &str) -> Result<Self, BodyFileError> {
        if SosBody::is_file(text) { Ok(SosBody::from_json(text)?.into()) } else { Ok(Body::from_json(text)?.into()) }
    }

    /// Its name.
    pub fn name(&self) -> &str {
        match self {
            Self::Body(body) => body.name(),
            Self::SosBody(body) => body.name(),
        }
    }

    /// Digest of what defines it.
    pub fn id(&self) -> &BodyId {
        match self {
            Self::Body(body) => body.id(),
            Self::SosBody(body) => body.id(),
        }
    }

    /// Its volume.
    pub fn volume(&self) -> Volume {
        match self {
            Self::Body(body) => body.volume(),
            Self::SosBody(body) => body.volume(),
        }
    }
}
