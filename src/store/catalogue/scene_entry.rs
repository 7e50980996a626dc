//! What a list of scenes says of each.

use std::sync::Arc;

use crate::scene::Scene;

use super::live_scene::Origin;
use super::stored_scene::StoredScene;

/// A scene of a list.
#[derive(Clone, Debug)]
pub struct SceneEntry {
    /// Its name.
    pub name: Arc<str>,
    /// Its revision.
    pub revision: u64,
    /// How many objects it has.
    pub objects: usize,
    /// What it was made of; none if it is no fork.
    pub origin: Option<Origin>,
}

impl SceneEntry {
    /// Of a snapshot.
    pub fn of(scene: &Scene, origin: Option<&Origin>) -> Self {
        let (name, revision) = (scene.name().clone(), scene.revision());
        Self { name, revision, objects: scene.len(), origin: origin.cloned() }
    }

    pub(super) fn of_stored(stored: &StoredScene) -> Self {
        let (name, revision) = (stored.name.clone(), stored.revision);
        Self { name, revision, objects: stored.objects().len(), origin: None }
    }
}
