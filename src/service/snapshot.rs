//! The snapshot of a scene that a question is about.

use tonic::Status;

use super::app_state::AppState;
use super::error;
use super::limits::REVISION_PATIENCE;
use super::reason::Reason;
use crate::scene::Scene;
use crate::store::CatalogueError;

/// The scene of a name, once it has a revision; waits a second for it.
///
/// # Errors
/// When there is no such scene, or it does not reach the revision.
pub(super) async fn snapshot(app: &AppState, name: &str, at_least_revision: Option<u64>) -> Result<Scene, Status> {
    let live = app.live_scene(name, "scene").await?;
    let scene = live.snapshot();
    let Some(least) = at_least_revision.filter(|least| *least > scene.revision()) else { return Ok(scene) };
    let mut changes = live.changes();
    let reached = changes.wait_for(|scene| scene.revision() >= least);
    match tokio::time::timeout(REVISION_PATIENCE, reached).await {
        Ok(Ok(scene)) => Ok(scene.clone()),
        Ok(Err(_)) => Err(error::catalogue(&CatalogueError::NoScene(name.to_owned()), "scene")),
        Err(_) => {
            let why = format!(
                "scene \"{name}\" is at revision {}, not yet at {least} (at_least_revision); try again",
                live.snapshot().revision()
            );
            Err(error::unavailable(Reason::RevisionNotReached, &why))
        }
    }
}
