//! What was read from the disk is proven before its first use: at once when somebody asks for it,
//! else in the background.

use std::collections::BTreeSet;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;

use crate::body::BodyId;
use crate::scene::Geometry;
use crate::store::job::{JobKind, JobState};

use super::counts::{Counts, JobCounts};
use super::live_scene::LiveScene;
use super::stored_body::{StoredBody, prove_each};
use super::stored_scene::StoredScene;
use super::{Catalogue, CatalogueError, State};

impl Catalogue {
    /// How much there is.
    pub fn counts(&self) -> Counts {
        self.read(|state| Counts {
            bodies: state.bodies.len(),
            unproven_bodies: state.bodies.values().filter(|body| !body.is_examined()).count(),
            damaged_bodies: state.bodies.values().filter(|body| body.is_damaged()).count(),
            scenes: state.scenes.len() + state.stored_scenes.len(),
            jobs: JobKind::ALL.map(|kind| {
                let of_kind = |wanted: &JobState| {
                    state.jobs.values().filter(|job| job.task.kind() == kind && job.state == *wanted).count()
                };
                JobCounts { queued: of_kind(&JobState::Queued), running: of_kind(&JobState::Running) }
            }),
        })
    }

    /// Whether every body and scene was looked at: nothing has to be proven for any question.
    pub fn is_proven(&self) -> bool {
        self.proven.load(Ordering::Relaxed)
    }

    /// Whether nothing has to be proven for a question about a scene, or there is no such scene.
    pub fn is_scene_proven(&self, name: &str) -> bool {
        self.is_proven() || self.read(|state| !state.stored_scenes.contains_key(name))
    }

    /// Proves on all cores what is not proven yet, that of scenes first, until `stop`. Returns
    /// whether it came to its end. What is damaged is logged.
    pub fn prove_all(&self, stop: &AtomicBool) -> bool {
        let names: Vec<_> = self.read(|state| state.stored_scenes.keys().cloned().collect());
        for name in names {
            self.examine(self.bodies_of_scene(&name), stop);
            if stop.load(Ordering::Relaxed) {
                return false;
            }
            if let Err(error) = self.live_scene(&name) {
                tracing::error!(scene = &*name, %error, "a scene of the catalogue cannot be used");
            }
        }
        let rest = self.read(|state| state.bodies.values().filter(|body| !body.is_examined()).cloned().collect());
        self.examine(rest, stop);
        let robots: Vec<_> = self.read(|state| state.robots.keys().copied().collect());
        for id in robots.iter().take_while(|_| !stop.load(Ordering::Relaxed)) {
            if let Err(error) = self.robot(id) {
                tracing::error!(%id, %error, "a robot of the catalogue cannot be used");
            }
        }
        self.write(|state| self.note_proofs(state));
        !stop.load(Ordering::Relaxed)
    }

    /// Sets what [`Catalogue::is_proven`] says, under the lock of those who change the state.
    pub(super) fn note_proofs(&self, state: &State) {
        self.proven.store(state.is_proven(), Ordering::Relaxed);
    }

    /// What is known to be damaged after [`Catalogue::prove_all`].
    pub fn damage(&self) -> Vec<CatalogueError> {
        let (bodies, robots, scenes) = self.read(|state| {
            let damaged: Vec<_> = state.bodies.values().filter(|body| body.is_damaged()).cloned().collect();
            let robots = state.robots.iter().filter(|(_, robot)| robot.is_damaged()).map(|(id, _)| *id);
            (damaged, robots.collect::<Vec<_>>(), state.stored_scenes.keys().cloned().collect::<Vec<_>>())
        });
        let bodies = bodies.iter().filter_map(|body| body.geometry().err());
        let bodies = bodies.chain(robots.iter().filter_map(|id| self.robot(id).err()));
        bodies.chain(scenes.iter().filter_map(|name| self.live_scene(name).err())).collect()
    }

    /// Proves bodies on all cores; those that are not there are left out.
    ///
    /// # Errors
    /// When one is not what was stored.
    pub(super) fn prove_bodies<'a>(&self, ids: impl IntoIterator<Item = &'a BodyId>) -> Result<(), CatalogueError> {
        let ids: BTreeSet<_> = ids.into_iter().collect();
        let bodies: Vec<_> =
            self.read(|state| ids.into_iter().filter_map(|id| state.bodies.get(id)).cloned().collect());
        self.examine(bodies.iter().filter(|body| !body.is_examined()).cloned().collect(), &AtomicBool::new(false));
        bodies.iter().try_for_each(|body| body.geometry().map(drop))
    }

    /// Makes a scene that was read from the disk a live one, when somebody asks for it.
    pub(super) fn enliven(&self, stored: &Arc<StoredScene>) -> Result<(), CatalogueError> {
        let robots = stored.robots().try_for_each(|(_, id)| self.robot(id).map(drop));
        let proven = robots.and_then(|()| self.prove_bodies(stored.objects().map(|(_, body)| body)));
        let live = proven.and_then(|()| self.live(stored)).inspect_err(|_| stored.set_damaged())?;
        let live = Arc::new(live);
        self.write(|state| {
            // Deleted, or made by somebody else meanwhile.
            let is_it = state.stored_scenes.get(&stored.name).is_some_and(|now| Arc::ptr_eq(now, stored));
            if is_it {
                state.stored_scenes.remove(&stored.name);
                state.scenes.insert(stored.name.clone(), live);
            }
        });
        Ok(())
    }

    fn live(&self, stored: &StoredScene) -> Result<LiveScene, CatalogueError> {
        stored.live(
            |id: &BodyId| -> Option<Geometry> { self.geometry(id).ok() },
            |id| Some(self.robot(id).ok()?.robot.clone()),
        )
    }

    fn bodies_of_scene(&self, name: &str) -> Vec<Arc<StoredBody>> {
        self.read(|state| {
            let Some(scene) = state.stored_scenes.get(name) else { return Vec::new() };
            let ids: BTreeSet<_> = scene.objects().map(|(_, body)| body).collect();
            let bodies = ids.into_iter().filter_map(|id| state.bodies.get(id));
            bodies.filter(|body| !body.is_examined()).cloned().collect()
        })
    }

    fn examine(&self, bodies: Vec<Arc<StoredBody>>, stop: &AtomicBool) {
        prove_each(&bodies, thread::available_parallelism().map_or(1, usize::from), stop);
    }
}

impl State {
    pub(super) fn is_proven(&self) -> bool {
        self.stored_scenes.values().all(|stored| stored.is_damaged())
            && self.bodies.values().all(|body| body.is_examined())
            && self.robots.values().all(|robot| robot.is_examined())
    }
}
