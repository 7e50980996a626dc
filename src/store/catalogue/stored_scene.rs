//! A scene as it was read from the disk: its bodies are proven before its first use.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use crate::body::BodyId;
use crate::scene::{Geometry, Placement, Scene, Update};
use crate::store::rows::SceneRow;

use super::error::CatalogueError;
use super::live_scene::LiveScene;

#[derive(Debug)]
pub(super) struct StoredScene {
    pub(super) name: Arc<str>,
    pub(super) revision: u64,
    contents: Update,
    /// Whether it was looked at and cannot be used.
    damaged: AtomicBool,
}

impl StoredScene {
    pub(super) fn new(name: &str, revision: u64, row: &SceneRow, placed: Vec<Placement>) -> Self {
        Self {
            name: name.into(),
            revision,
            contents: Update { upserts: placed, ..row.update() },
            damaged: AtomicBool::new(false),
        }
    }

    /// Names of its objects and the bodies they are made of.
    pub(super) fn objects(&self) -> impl ExactSizeIterator<Item = (&str, &BodyId)> {
        self.contents.upserts.iter().map(|placement| (&*placement.name, &placement.body))
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
    pub(super) fn live(&self, bodies: impl Fn(&BodyId) -> Option<Geometry>) -> Result<LiveScene, CatalogueError> {
        let damaged = |why: String| CatalogueError::DamagedScene { scene: self.name.clone(), why };
        let scene = Scene::new(&self.name, 0).map_err(|error| damaged(format!("its name {error}")))?;
        let scene = scene.updated(&self.contents, bodies).map_err(|error| damaged(error.to_string()))?;
        Ok(LiveScene::new(scene.at_revision(self.revision), None, self.revision))
    }
}
