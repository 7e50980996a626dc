//! A robot of the catalogue. One that was read from the disk is made before its first use.

use std::sync::{Arc, OnceLock};

use crate::body::BodyId;
use crate::scene::{Geometry, RobotId};
use crate::store::robot::{LoadedRobot, RobotSource};
use crate::store::robot_row::RobotRow;

use super::error::CatalogueError;

#[derive(Debug)]
pub(super) struct StoredRobot {
    id: RobotId,
    source: RobotSource,
    /// Of all links that have one, each once.
    bodies: Vec<BodyId>,
    /// The robot, or why it is not what was stored.
    loaded: OnceLock<Result<Arc<LoadedRobot>, Arc<str>>>,
}

impl StoredRobot {
    /// A robot that was just loaded.
    pub(super) fn new(loaded: Arc<LoadedRobot>) -> Self {
        let stored = Self::read(*loaded.robot.id(), RobotRow::of(&loaded));
        Self { loaded: Ok(loaded).into(), ..stored }
    }

    /// A robot that was read from the disk.
    pub(super) fn read(id: RobotId, row: RobotRow) -> Self {
        let (source, bodies) = row.into_parts();
        Self { id, source, bodies, loaded: OnceLock::new() }
    }

    /// Ids of the bodies of its links.
    pub(super) fn bodies(&self) -> &[BodyId] {
        &self.bodies
    }

    /// Whether it was looked at since it was read.
    pub(super) fn is_examined(&self) -> bool {
        self.loaded.get().is_some()
    }

    /// Whether it was looked at, and is not what was stored.
    pub(super) fn is_damaged(&self) -> bool {
        matches!(self.loaded.get(), Some(Err(_)))
    }

    /// The robot. The first call makes it; `body` looks a body up by its id.
    ///
    /// # Errors
    /// When it is not what was stored.
    pub(super) fn loaded(
        &self,
        body: impl Fn(&BodyId) -> Option<Geometry>,
    ) -> Result<Arc<LoadedRobot>, CatalogueError> {
        let loaded = self.loaded.get_or_init(|| {
            let loaded = self.source.clone().load(body).map_err(|error| error.to_string());
            let loaded = loaded.and_then(|loaded| match loaded.robot.id() {
                id if *id == self.id => Ok(Arc::new(loaded)),
                id => Err(format!("it has the content of robot {id}")),
            });
            loaded.map_err(|why| {
                tracing::error!(id = %self.id, why, "a robot of the catalogue is damaged and is not used");
                why.into()
            })
        });
        loaded.clone().map_err(|why| CatalogueError::DamagedRobot { id: self.id, why })
    }
}
