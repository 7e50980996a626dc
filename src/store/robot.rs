//! A robot as it is stored: what it was loaded from.

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::body::BodyId;
use crate::robot::{Description, DescriptionError, Semantics, read_srdf, read_urdf};
use crate::scene::{Geometry, Robot, RobotError, RobotId};

/// What a robot is loaded from.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RobotSource {
    /// Text of the URDF; metres, radians.
    pub urdf: String,
    /// Text of the SRDF; empty: none.
    pub srdf: String,
    /// Bodies by the names of links, in the frame of the link.
    pub bodies: BTreeMap<Arc<str>, BodyId>,
}

/// A robot with all that its texts say.
#[derive(Clone, Debug)]
pub struct LoadedRobot {
    /// What it was loaded from.
    pub source: RobotSource,
    /// What scenes place.
    pub robot: Arc<Robot>,
    /// What the URDF says.
    pub description: Description,
    /// What the SRDF says.
    pub semantics: Semantics,
}

/// Why a robot cannot be loaded.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum LoadError {
    /// The URDF.
    #[error(transparent)]
    Urdf(DescriptionError),
    /// The SRDF.
    #[error(transparent)]
    Srdf(DescriptionError),
    /// A body of a link is not there.
    #[error("no body {id} for link \"{link}\"; create it first")]
    NoBody {
        /// Name of the link.
        link: Arc<str>,
        /// The body.
        id: BodyId,
    },
    /// Links that make no robot.
    #[error(transparent)]
    Robot(#[from] RobotError),
}

impl RobotSource {
    /// Id of the robot.
    pub fn id(&self) -> RobotId {
        RobotId::of(&self.urdf, &self.srdf, self.bodies.iter().map(|(link, id)| (&**link, id)))
    }

    /// Makes the robot; `body` looks a body up by its id.
    ///
    /// # Errors
    /// A text that cannot be read, a body that is not there, and links that make no robot.
    pub fn load(self, body: impl Fn(&BodyId) -> Option<Geometry>) -> Result<LoadedRobot, LoadError> {
        let description = read_urdf(&self.urdf).map_err(LoadError::Urdf)?;
        let semantics = if self.srdf.is_empty() {
            Semantics::default()
        } else {
            read_srdf(&self.srdf, &description).map_err(LoadError::Srdf)?
        };
        let mut bodies = BTreeMap::new();
        for (link, id) in &self.bodies {
            let found = body(id).ok_or_else(|| LoadError::NoBody { link: link.clone(), id: *id })?;
            bodies.insert(link.clone(), found);
        }
        let robot = Arc::new(Robot::new(self.id(), &description, &semantics, &bodies)?);
        Ok(LoadedRobot { source: self, robot, description, semantics })
    }
}

impl LoadedRobot {
    /// Geometries of the links that have one.
    pub(super) fn bodies(&self) -> impl Iterator<Item = &Geometry> {
        self.robot.links().iter().flatten().map(|link| &link.geometry)
    }
}
