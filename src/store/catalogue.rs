//! All bodies, scenes and jobs in memory, every change written through.

mod jobs;
mod live_scene;
mod scenes;

pub use live_scene::{FORK_IDLE, LiveScene, MAX_FORKS, Origin};

use std::collections::BTreeMap;
use std::ops::Bound;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread;

use redb::WriteTransaction;

use crate::body::{BodyId, Shape};
use crate::scene::{Geometry, GeometryFileError, Ladder, LadderError, NameError, SceneError};

use super::copy::copy;
use super::disk::Contents;
use super::job::{Job, MAX_QUEUED_JOBS};
use super::rows::{BODIES, LADDERS, LadderRow};
use super::{Store, StoreError};
use live_scene::Scenes;

/// The catalogue of one server. Reading takes a lock for the time of a map look-up; changes are
/// made one after the other, each on disk before it is seen. All methods that change block on the
/// disk.
#[derive(Debug)]
pub struct Catalogue {
    /// Held over a whole change: check, commit, make visible.
    store: Mutex<Store>,
    state: RwLock<State>,
}

#[derive(Debug, Default)]
struct State {
    /// Bodies of every kind.
    bodies: BTreeMap<BodyId, Geometry>,
    scenes: Scenes,
    jobs: BTreeMap<u64, Arc<Job>>,
    /// No new scene starts at or below it.
    revision_floor: u64,
}

/// Why a change was not made. Memory and disk are as they were.
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// No body has this id.
    #[error("no body {0}; list the bodies, or create it first")]
    NoBody(BodyId),
    /// The body is in use.
    #[error("body {id} is used by object \"{object}\" of scene \"{scene}\"; remove the object first")]
    BodyUsed {
        /// The body.
        id: BodyId,
        /// A scene that uses it.
        scene: Arc<str>,
        /// An object made of it.
        object: Arc<str>,
    },
    /// The body is a rung.
    #[error("body {id} is a rung of ladder {ladder}; delete the ladder first")]
    RungUsed {
        /// The body.
        id: BodyId,
        /// The ladder.
        ladder: BodyId,
    },
    /// A rung was stored before, without what a ladder needs of it.
    #[error("a rung of the ladder is stored already, and {0}; delete that body, and store the ladder again")]
    Ladder(#[from] LadderError),
    /// No scene has this name.
    #[error("no scene \"{0}\"; list the scenes, or create it first")]
    NoScene(String),
    /// The name is taken.
    #[error("there is a scene \"{0}\"; use it, delete it, or choose another name")]
    SceneExists(String),
    /// The scene is no fork.
    #[error("scene \"{0}\" is no fork; name one that ForkScene made")]
    NoFork(String),
    /// A fork has lost its parent.
    #[error("scene \"{parent}\", of which \"{fork}\" was made, was deleted; delete the fork")]
    NoParent {
        /// The fork.
        fork: String,
        /// Its parent.
        parent: Arc<str>,
    },
    /// The parent has changed since the fork was made.
    #[error(
        "fork \"{fork}\" was made at revision {expected} of its parent, which is at {current} now; fork it again and \
         repeat the changes"
    )]
    ParentChanged {
        /// The fork.
        fork: String,
        /// Revision of the parent then.
        expected: u64,
        /// Revision of the parent now.
        current: u64,
    },
    /// Too many forks.
    #[error("there are {MAX_FORKS} forks (max_forks); delete or commit some")]
    TooManyForks,
    /// The name is not usable.
    #[error("the name of the scene {0}")]
    SceneName(#[from] NameError),
    /// The update cannot be applied to the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// No fit job has this id.
    #[error("no fit job {0}; list the jobs, or create it first")]
    NoJob(String),
    /// The request id names another job.
    #[error(
        "the request id \"{request_id}\" was used for fit job {job}, which has other points or options; choose another id"
    )]
    RequestUsed {
        /// The request id.
        request_id: String,
        /// The job it made.
        job: u64,
    },
    /// A group names a body that is not there.
    #[error("no body {id}; list the bodies, or create it first")]
    NoMember {
        /// Its place in the group.
        index: usize,
        /// The body.
        id: BodyId,
    },
    /// Too many jobs wait.
    #[error("{MAX_QUEUED_JOBS} fit jobs wait already; try again when some are done, or cancel some")]
    QueueFull,
    /// The disk failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}

impl Catalogue {
    /// Reads everything from the store and re-proves every body.
    ///
    /// # Errors
    /// When the file cannot be read, or holds a body, pose or name that does not hold up.
    pub fn load(store: Store) -> Result<Self, StoreError> {
        let state = State::read(&store, &BTreeMap::new())?;
        Ok(Self { store: Mutex::new(store), state: RwLock::new(state) })
    }

    /// Directory of its file.
    pub fn dir(&self) -> PathBuf {
        self.store.lock().unwrap_or_else(PoisonError::into_inner).dir().to_owned()
    }

    /// Copies the catalogue, with all poses that were streamed, into a new file.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn backup(&self, to: &Path) -> Result<(), StoreError> {
        self.write_poses(false)?;
        let (dir, snapshot) = {
            let store = self.writer()?;
            (store.dir().to_owned(), store.snapshot()?)
        };
        copy(&snapshot, to).map_err(|error| StoreError::from_redb(&dir, error))
    }

    /// One body of whatever kind by id.
    pub fn geometry(&self, id: &BodyId) -> Option<Geometry> {
        self.read(|state| state.bodies.get(id).cloned())
    }

    /// Up to `count` bodies in the order of their ids, from the first one after `after`; and
    /// whether more follow.
    pub fn bodies(&self, after: Option<&BodyId>, count: usize) -> (Vec<Geometry>, bool) {
        self.read(|state| page(&state.bodies, after, count))
    }

    /// How many bodies and scenes there are.
    pub fn counts(&self) -> (usize, usize) {
        self.read(|state| (state.bodies.len(), state.scenes.len()))
    }

    /// Stores a body, of a ladder with its rungs; the one that was there first when the content is
    /// known. Returns whether it is new.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn create_body(&self, body: Geometry) -> Result<(Geometry, bool), CatalogueError> {
        let mut store = self.writer()?;
        if let Some(known) = self.geometry(body.id()) {
            return Ok((known, false));
        }
        let fresh = self.read(|state| state.fresh(vec![body.clone()]))?;
        self.commit(&mut store, |transaction| put_bodies(transaction, &fresh))?;
        self.write(|state| state.bodies.extend(fresh.into_iter().map(|body| (*body.id(), body))));
        tracing::debug!(id = %body.id(), "body created");
        Ok((body, true))
    }

    /// Removes a body that no scene and no ladder uses.
    ///
    /// # Errors
    /// When there is none, when it is in use, or when the disk fails.
    pub fn delete_body(&self, id: &BodyId) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        self.read(|state| {
            if !state.bodies.contains_key(id) {
                return Err(CatalogueError::NoBody(*id));
            }
            let holds = |body: &&Geometry| match body {
                Geometry::Ladder(ladder) => ladder.rungs().iter().any(|rung| rung.id() == id),
                Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::HalfSpace(_) => false,
            };
            if let Some(ladder) = state.bodies.values().find(holds) {
                return Err(CatalogueError::RungUsed { id: *id, ladder: *ladder.id() });
            }
            for live in state.scenes.values() {
                let scene = live.snapshot();
                if let Some((_, object, _)) = scene.objects().find(|(_, object, _)| object.geometry.id() == id) {
                    let (scene, object) = (scene.name().clone(), object.name.clone());
                    return Err(CatalogueError::BodyUsed { id: *id, scene, object });
                }
            }
            Ok(())
        })?;
        let key = id.to_string();
        self.commit(&mut store, |transaction| {
            transaction.open_table(BODIES)?.remove(key.as_str())?;
            transaction.open_table(LADDERS)?.remove(key.as_str())?;
            Ok(())
        })?;
        self.write(|state| state.bodies.remove(id));
        tracing::debug!(%id, "body deleted");
        Ok(())
    }

    /// The one place for changes. After a failed commit the file is opened and read again first.
    fn writer(&self) -> Result<MutexGuard<'_, Store>, StoreError> {
        let mut store = self.store.lock().unwrap_or_else(PoisonError::into_inner);
        if store.is_closed() {
            self.reread(&mut store)?;
        }
        Ok(store)
    }

    fn commit(
        &self,
        store: &mut Store,
        write: impl FnOnce(&WriteTransaction) -> Result<(), redb::Error>,
    ) -> Result<(), StoreError> {
        store.commit(write).inspect_err(|_| {
            // The next change tries again; until then nothing can be changed, and somebody should
            // know.
            if let Err(error) = self.reread(store) {
                tracing::error!(%error, "the catalogue cannot be read back after a failed change; changes are refused");
            }
        })
    }

    /// Makes memory say what the disk says. Forks, which are not on disk, stay; so do scenes that
    /// are on disk as they are here or further behind, with those who watch them.
    fn reread(&self, store: &mut Store) -> Result<(), StoreError> {
        store.reopen()?;
        let known = self.read(|state| state.bodies.clone());
        let fresh = State::read(store, &known)?;
        self.write(|state| state.replace(fresh));
        Ok(())
    }

    // Changes of the state do not panic half way, so a poisoned lock guards a sound state.
    fn read<T>(&self, look: impl FnOnce(&State) -> T) -> T {
        look(&self.state.read().unwrap_or_else(PoisonError::into_inner))
    }

    /// What the change replaces is dropped by the caller, after the lock.
    fn write<T>(&self, change: impl FnOnce(&mut State) -> T) -> T {
        change(&mut self.state.write().unwrap_or_else(PoisonError::into_inner))
    }
}

impl State {
    /// Everything in the store; bodies in `known` are not proven again.
    fn read(store: &Store, known: &BTreeMap<BodyId, Geometry>) -> Result<Self, StoreError> {
        let damaged = |what: String| StoreError::damaged(store.dir(), what);
        let Contents { bodies, ladders, scenes, objects, jobs, revision_floor } = store.read()?;
        tracing::info!(
            bodies = bodies.len(),
            scenes = scenes.len(),
            "loading; every body that is not known is re-proven"
        );
        let bodies: BTreeMap<_, _> =
            prove(&bodies, known).map_err(damaged)?.into_iter().map(|body| (*body.id(), body)).collect();
        let jobs = jobs.into_iter().map(|job| (job.id, Arc::new(job))).collect();
        let mut state = Self { scenes: Scenes::new(), revision_floor, bodies, jobs };
        for (id, row) in ladders {
            let ladder = row.ladder(|id| state.bodies.get(id).cloned());
            let ladder = ladder.map_err(|why| damaged(format!("ladder {id} {why}")))?;
            if ladder.id().to_string() != id {
                return Err(damaged(format!("ladder {id} has the content of ladder {}", ladder.id())));
            }
            state.bodies.insert(*ladder.id(), Geometry::Ladder(Arc::new(ladder)));
        }
        state.restore_scenes(scenes, objects, store)?;
        Ok(state)
    }

    /// Takes over what was read again.
    fn replace(&mut self, fresh: Self) -> Self {
        let before = std::mem::replace(self, fresh);
        self.revision_floor = self.revision_floor.max(before.revision_floor);
        self.keep_live(&before.scenes);
        before
    }

    /// Of these bodies and the rungs of their ladders, those that are not there, each once; rungs
    /// come before their ladder, which is made of those that are there already where they are.
    ///
    /// # Errors
    /// A ladder with a rung that is there already, without the points that it has to contain.
    fn fresh(&self, bodies: Vec<Geometry>) -> Result<Vec<Geometry>, LadderError> {
        let mut fresh: Vec<Geometry> = Vec::new();
        for body in bodies {
            let mut all = Vec::new();
            let body = match body {
                Geometry::Ladder(ladder) => {
                    let stored = |rung: &Arc<Shape>| match self.bodies.get(rung.id()) {
                        Some(Geometry::Solid(stored)) => stored.clone(),
                        _ => rung.clone(),
                    };
                    let rungs: Vec<_> = ladder.rungs().iter().map(stored).collect();
                    all.extend(rungs.iter().cloned().map(Geometry::Solid));
                    Geometry::Ladder(Arc::new(Ladder::new(ladder.name(), rungs)?))
                }
                body @ (Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::HalfSpace(_)) => body,
            };
            for body in all.into_iter().chain([body]) {
                let known = self.bodies.contains_key(body.id()) || fresh.iter().any(|other| other.id() == body.id());
                if !known {
                    fresh.push(body);
                }
            }
        }
        Ok(fresh)
    }
}

/// Rows of bodies that are new; of a ladder which rungs it has.
fn put_bodies(transaction: &WriteTransaction, bodies: &[Geometry]) -> Result<(), redb::Error> {
    let (mut files, mut ladders) = (transaction.open_table(BODIES)?, transaction.open_table(LADDERS)?);
    for body in bodies {
        let id = body.id().to_string();
        match body {
            Geometry::Ladder(ladder) => {
                ladders.insert(id.as_str(), json(&LadderRow::of(ladder))?.as_slice())?;
            }
            Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::HalfSpace(_) => {
                files.insert(id.as_str(), body.to_json().as_bytes())?;
            }
        }
    }
    Ok(())
}

/// Bodies from their files, re-proven on all cores: the only part of loading that takes time.
fn prove(files: &[(String, String)], known: &BTreeMap<BodyId, Geometry>) -> Result<Vec<Geometry>, String> {
    let one = |(id, file): &(String, String)| {
        if let Some(body) = id.parse().ok().and_then(|id: BodyId| known.get(&id)) {
            return Ok(body.clone());
        }
        let body = Geometry::from_json(file).map_err(|error: GeometryFileError| format!("body {id}: {error}"))?;
        if body.id().to_string() == *id {
            Ok(body)
        } else {
            Err(format!("body {id} has the content of body {}", body.id()))
        }
    };
    let threads = thread::available_parallelism().map_or(1, usize::from);
    let share = files.len().div_ceil(threads).max(1);
    thread::scope(|scope| {
        let workers: Vec<_> = files
            .chunks(share)
            .map(|share| scope.spawn(move || share.iter().map(one).collect::<Result<Vec<_>, _>>()))
            .collect();
        let mut bodies = Vec::with_capacity(files.len());
        for worker in workers {
            bodies.extend(worker.join().map_err(|_| "re-proving a body failed by a defect".to_owned())??);
        }
        Ok(bodies)
    })
}

fn json(row: &impl serde::Serialize) -> Result<Vec<u8>, redb::Error> {
    serde_json::to_vec(row).map_err(|error| redb::Error::Io(error.into()))
}

fn page<K: Ord, V: Clone>(map: &BTreeMap<K, V>, after: Option<&K>, count: usize) -> (Vec<V>, bool) {
    let from = after.map_or(Bound::Unbounded, Bound::Excluded);
    let mut rest = map.range((from, Bound::Unbounded)).map(|(_, value)| value.clone());
    let page = rest.by_ref().take(count).collect();
    (page, rest.next().is_some())
}
