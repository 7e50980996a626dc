//! The robots of the catalogue.

use std::sync::Arc;

use crate::body::BodyId;
use crate::scene::{Geometry, Robot, RobotId, Update};
use crate::store::robot::{LoadError, LoadedRobot, RobotSource};
use crate::store::robot_row::RobotRow;
use crate::store::rows::{ROBOTS, json};

use super::stored_robot::StoredRobot;
use super::{Catalogue, CatalogueError, State, page, put_bodies};

impl Catalogue {
    /// Loads and stores a robot with the bodies of its links; the one that was there first when the
    /// content is known. Returns whether it is new.
    ///
    /// # Errors
    /// When its texts cannot be read, a body is not there or damaged, or when the disk fails.
    pub fn load_robot(&self, source: RobotSource) -> Result<(Arc<LoadedRobot>, bool), CatalogueError> {
        self.prove_bodies(source.bodies.values())?;
        let given = source.bodies.clone();
        let loaded = Arc::new(source.load(|id| self.geometry(id).ok())?);
        let id = *loaded.robot.id();
        let mut store = self.writer()?;
        if let Ok(known) = self.robot(&id) {
            return Ok((known, false));
        }
        // Deleted meanwhile.
        if let Some((link, id)) = given.iter().find(|(_, id)| self.geometry(id).is_err()) {
            return Err(LoadError::NoBody { link: link.clone(), id: *id }.into());
        }
        let fresh = self.read(|state| state.fresh(loaded.bodies().cloned().collect()))?;
        let (key, row) = (id.to_string(), RobotRow::of(&loaded));
        self.commit(&mut store, |transaction| {
            put_bodies(transaction, &fresh)?;
            transaction.open_table(ROBOTS)?.insert(key.as_str(), json(&row)?.as_slice())?;
            Ok(())
        })?;
        self.write(|state| {
            state.keep(fresh);
            state.robots.insert(id, Arc::new(StoredRobot::new(loaded.clone())));
        });
        tracing::debug!(%id, "robot loaded");
        Ok((loaded, true))
    }

    /// One robot by id; made here if it is not yet.
    ///
    /// # Errors
    /// When there is none, or when it or one of its bodies is damaged.
    pub fn robot(&self, id: &RobotId) -> Result<Arc<LoadedRobot>, CatalogueError> {
        let stored = self.read(|state| state.robots.get(id).cloned()).ok_or(CatalogueError::NoRobot(*id))?;
        if !stored.is_examined() {
            self.prove_bodies(stored.bodies())?;
        }
        stored.loaded(|id| self.geometry(id).ok())
    }

    /// Up to `count` robots in the order of their ids, from the first one after `after`, without
    /// those that are damaged; and the last of the ids if more follow.
    pub fn robots(&self, after: Option<&RobotId>, count: usize) -> (Vec<Arc<LoadedRobot>>, Option<RobotId>) {
        let (ids, more) = self.read(|state| {
            let ids = state.robots.keys().map(|id| (*id, *id)).collect();
            page(&ids, after, count)
        });
        let last = ids.last().copied();
        (ids.iter().filter_map(|id| self.robot(id).ok()).collect(), last.filter(|_| more))
    }

    /// Removes a robot of which no scene and no fork has an instance; the bodies of its links stay.
    ///
    /// # Errors
    /// When there is none, when it is in use, or when the disk fails.
    pub fn delete_robot(&self, id: &RobotId) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        self.read(|state| state.check_robot_is_free(id))?;
        let key = id.to_string();
        self.commit(&mut store, |transaction| {
            transaction.open_table(ROBOTS)?.remove(key.as_str())?;
            Ok(())
        })?;
        self.write(|state| state.robots.remove(id));
        tracing::debug!(%id, "robot deleted");
        Ok(())
    }

    /// Robots that an update places are stored still; held under the lock of those who delete them.
    pub(super) fn check_placed_robots(&self, update: &Update) -> Result<(), CatalogueError> {
        self.read(|state| {
            for (index, placed) in update.robots.iter().enumerate() {
                let id = *placed.robot.id();
                if !state.robots.contains_key(&id) {
                    return Err(CatalogueError::NoPlacedRobot { index, id });
                }
            }
            Ok(())
        })
    }
}

impl State {
    fn check_robot_is_free(&self, id: &RobotId) -> Result<(), CatalogueError> {
        if !self.robots.contains_key(id) {
            return Err(CatalogueError::NoRobot(*id));
        }
        let used = |scene: &Arc<str>, robot: &str| {
            Err(CatalogueError::RobotUsed { id: *id, scene: scene.clone(), robot: robot.into() })
        };
        for stored in self.stored_scenes.values() {
            if let Some((name, _)) = stored.robots().find(|(_, robot)| *robot == id) {
                return used(&stored.name, name);
            }
        }
        for live in self.scenes.values() {
            let scene = live.snapshot();
            if let Some(instance) = scene.robots().find(|instance| instance.robot().id() == id) {
                return used(scene.name(), instance.name());
            }
        }
        Ok(())
    }

    /// The robot of which a body is a link.
    pub(super) fn robot_with(&self, body: &BodyId) -> Option<RobotId> {
        self.robots.iter().find(|(_, robot)| robot.bodies().contains(body)).map(|(id, _)| *id)
    }

    /// A robot for a scene that is read again; its bodies were proven before.
    pub(super) fn known_robot(&self, id: &RobotId) -> Option<Arc<Robot>> {
        let body = |id: &BodyId| -> Option<Geometry> { self.bodies.get(id)?.geometry().ok() };
        Some(self.robots.get(id)?.loaded(body).ok()?.robot.clone())
    }
}
