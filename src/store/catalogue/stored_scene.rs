//! A scene as it was read from the disk: its bodies are proven before its first use.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::body::BodyId;
use crate::scene::{Geometry, Placement, Robot, RobotId, Scene, Update};
use crate::store::robot_row::InstanceRow;
use crate::store::rows::SceneRow;

use super::error::CatalogueError;
use super::live_scene::LiveScene;

#[derive(Debug)]
pub(super) struct StoredScene {
    pub(super) name: Arc<str>,
    pub(super) revision: u64,
    /// Without its robots.
    contents: Update,
    /// Robots by their names in it.
    robots: Vec<(String, InstanceRow)>,
    /// Whether it was looked at and cannot be used.
    damaged: AtomicBool,
}

impl StoredScene {
    pub(super) fn new(
        name: &str,
        revision: u64,
        row: &SceneRow,
        (placed, robots): (Vec<Placement>, Vec<(String, InstanceRow)>),
    ) -> Self {
        let object_paddings = robots.iter().flat_map(|(name, robot)| robot.paddings(name)).collect();
        Self {
            name: name.into(),
            revision,
            contents: Update { upserts: placed, object_paddings, ..row.update() },
            robots,
            damaged: AtomicBool::new(false),
        }
    }

    /// Names of its objects and the bodies they are made of.
    pub(super) fn objects(&self) -> impl ExactSizeIterator<Item = (&str, &BodyId)> {
        self.contents.upserts.iter().map(|placement| (&*placement.name, &placement.body))
    }

    /// Names of its robots, and which they are.
    pub(super) fn robots(&self) -> impl ExactSizeIterator<Item = (&str, &RobotId)> {
        self.robots.iter().map(|(name, row)| (name.as_str(), row.robot()))
    }

    pub(super) fn is_damaged(&self) -> bool {
        self.damaged.load(Ordering::Relaxed)
    }

    pub(super) fn set_damaged(&self) {
        self.damaged.store(true, Ordering::Relaxed);
    }

    /// The scene, made of proven bodies.
    ///
    /// # Errors
    /// When it is not what was stored.
    pub(super) fn live(
        &self,
        bodies: impl Fn(&BodyId) -> Option<Geometry>,
        robots: impl Fn(&RobotId) -> Option<Arc<Robot>>,
    ) -> Result<LiveScene, CatalogueError> {
        let damaged = |why: String| CatalogueError::DamagedScene { scene: self.name.clone(), why };
        let scene = Scene::new(&self.name, 0).map_err(|error| damaged(format!("its name {error}")))?;
        let mut contents = self.contents.clone();
        for (name, row) in &self.robots {
            let id = row.robot();
            let robot = robots(id).ok_or_else(|| damaged(format!("its robot \"{name}\", {id}, cannot be used")))?;
            contents.robots.push(row.placement(name, robot).map_err(damaged)?);
        }
        let scene = scene.updated(&contents, bodies).map_err(|error| damaged(error.to_string()))?;
        Ok(LiveScene::new(scene.at_revision(self.revision), None, self.revision))
    }
}
