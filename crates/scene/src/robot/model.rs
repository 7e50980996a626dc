//! What is loaded: kinematics, the geometry of links, and links that may touch.

use std::collections::BTreeMap;
use std::sync::Arc;

use sublevel_core::body::BodyId;
use sublevel_robot::{Description, Kinematics, KinematicsError, Semantics};

use super::RobotId;
use super::link_geometry::{PrimitiveError, geometry};
use super::link_pairs::LinkPairs;
use crate::Geometry;

/// A robot that can be placed in scenes; immutable.
#[derive(Clone, Debug)]
pub struct Robot {
    id: RobotId,
    kinematics: Arc<Kinematics>,
    /// In the order of the kinematics; none: a frame.
    links: Vec<Option<RobotLink>>,
    pairs: LinkPairs,
}

/// The geometry of a link.
#[derive(Clone, Debug)]
pub struct RobotLink {
    /// Everything of the link that can touch anything, in the frame of the link, metres.
    pub geometry: Geometry,
}

impl RobotLink {
    /// Id of the geometry.
    pub fn body(&self) -> &BodyId {
        self.geometry.id()
    }
}

/// Why a description makes no robot.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum RobotError {
    /// Links and joints that are no tree.
    #[error(transparent)]
    Kinematics(#[from] KinematicsError),
    /// A mesh, and no body that stands for it.
    #[error(
        "collision {piece} of link \"{link}\" is the mesh {uri}; fit a body to all meshes of the link, in the frame \
         of the link, and give it for this link, or send the meshes along"
    )]
    Mesh {
        /// Name of the link.
        link: Arc<str>,
        /// Position of the mesh among the collision elements of the link.
        piece: usize,
        /// The file that the description names.
        uri: String,
    },
    /// Primitives that make no geometry.
    #[error("collision {piece} of link \"{link}\": {error}; give a body for this link")]
    Primitive {
        /// Name of the link.
        link: Arc<str>,
        /// Position among the collision elements of the link.
        piece: usize,
        /// The reason.
        error: PrimitiveError,
    },
    /// A body for a link that is not there.
    #[error("robot \"{robot}\" has no link \"{link}\"; give bodies for its links only")]
    NoLink {
        /// Name of the link.
        link: Arc<str>,
        /// Name of the robot.
        robot: Arc<str>,
    },
    /// A half-space as a link.
    #[error("link \"{link}\" cannot be a half-space, which has no end; give a body or a capsule")]
    HalfSpace {
        /// Name of the link.
        link: Arc<str>,
    },
}

impl Robot {
    /// A robot of links and joints. `bodies` are geometries by the names of links, in the frame of
    /// the link, and replace what the description says of these; what else has collision elements
    /// must be made of primitives, which are taken exactly. Pairs of links may touch that
    /// `semantics` disable, and a link and the next one before it that has geometry.
    ///
    /// # Errors
    /// Links and joints that are no tree, a mesh without a body, primitives that no body can be,
    /// and bodies for links that are not there.
    pub fn new(
        id: RobotId,
        description: &Description,
        semantics: &Semantics,
        bodies: &BTreeMap<Arc<str>, Geometry>,
    ) -> Result<Self, RobotError> {
        let kinematics = Kinematics::new(description)?;
        for (link, body) in bodies {
            if kinematics.link(link).is_none() {
                return Err(RobotError::NoLink { link: link.clone(), robot: description.name.clone() });
            }
            if matches!(body, Geometry::HalfSpace(_)) {
                return Err(RobotError::HalfSpace { link: link.clone() });
            }
        }
        let mut links = vec![None; kinematics.links().len()];
        for link in &description.links {
            let of_pieces = |(piece, error): (usize, PrimitiveError)| match (&error, &link.collisions[piece].geometry) {
                (PrimitiveError::Mesh, sublevel_robot::Geometry::Mesh { uri, .. }) => {
                    RobotError::Mesh { link: link.name.clone(), piece, uri: uri.clone() }
                }
                _ => RobotError::Primitive { link: link.name.clone(), piece, error },
            };
            let geometry = match bodies.get(&link.name) {
                Some(body) => Some(body.clone()),
                None => geometry(&link.name, &link.collisions).map_err(of_pieces)?,
            };
            if let Some(place) = kinematics.link(&link.name) {
                links[place] = geometry.map(|geometry| RobotLink { geometry });
            }
        }
        let pairs = allowed(description, semantics, (&kinematics, &links));
        Ok(Self { id, kinematics: Arc::new(kinematics), links, pairs })
    }

    /// Hash of what it was loaded from.
    pub fn id(&self) -> &RobotId {
        &self.id
    }

    /// Name that its description gives it.
    pub fn name(&self) -> &Arc<str> {
        self.kinematics.name()
    }

    /// Its tree of links.
    pub fn kinematics(&self) -> &Arc<Kinematics> {
        &self.kinematics
    }

    /// The geometry of links, in the order of [`Kinematics::links`]; none of frames.
    pub fn links(&self) -> &[Option<RobotLink>] {
        &self.links
    }

    /// Whether two links, by their positions in [`Kinematics::links`], may touch: pairs that an
    /// SRDF disables, and a link with the next one before it that has geometry.
    ///
    /// # Panics
    /// When there are no such links.
    pub fn may_touch(&self, a: usize, b: usize) -> bool {
        self.pairs.is_allowed(a, b)
    }
}

/// The pairs of links that may touch.
fn allowed(
    description: &Description,
    semantics: &Semantics,
    (kinematics, links): (&Kinematics, &[Option<RobotLink>]),
) -> LinkPairs {
    let mut pairs = LinkPairs::none(links.len());
    let places: Vec<_> = description.links.iter().map(|link| kinematics.link(&link.name)).collect();
    for (a, place_a) in places.iter().enumerate() {
        for (b, place_b) in places.iter().enumerate().skip(a + 1) {
            if let (Some(place_a), Some(place_b), true) = (*place_a, *place_b, semantics.is_disabled(a, b)) {
                pairs.allow(place_a, place_b);
            }
        }
    }
    for link in 0..links.len() {
        let mut before = kinematics.parent(link);
        while let Some(parent) = before.filter(|&parent| links[parent].is_none()) {
            before = kinematics.parent(parent);
        }
        if let Some(parent) = before {
            pairs.allow(link, parent);
        }
    }
    pairs
}
