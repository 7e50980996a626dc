//! All bodies, scenes and jobs in memory, every change written through.

mod counts;
mod error;
mod jobs;
mod live_scene;
mod proofs;
mod robots;
mod scene_entry;
mod scenes;
mod stored_body;
mod stored_robot;
mod stored_scene;

pub use counts::{Counts, JobCounts};
pub use error::CatalogueError;
pub use live_scene::{FORK_IDLE, LiveScene, MAX_FORKS, Origin};
pub use scene_entry::SceneEntry;

use std::collections::BTreeMap;
use std::ops::Bound;
use std::path::{Path, PathBuf};
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};

use redb::WriteTransaction;

use crate::body::{BodyId, Shape};
use crate::scene::{Geometry, Ladder, LadderError, RobotId};

use super::copy::copy;
use super::disk::Contents;
use super::job::Job;
use super::rows::{BODIES, LADDERS, LadderRow, json};
use super::{Store, StoreError};
use live_scene::Scenes;
use stored_body::{BodyRow, StoredBody};
use stored_robot::StoredRobot;
use stored_scene::StoredScene;

/// The catalogue of one server. Reading takes a lock for the time of a map look-up; changes are
/// made one after the other, each on disk before it is seen. All methods that change block on the
/// disk.
#[derive(Debug)]
pub struct Catalogue {
    /// Held over a whole change: check, commit, make visible.
    store: Mutex<Store>,
    state: RwLock<State>,
    /// See [`Catalogue::is_proven`].
    proven: AtomicBool,
}

/// Bodies of every kind by their ids.
type Bodies = BTreeMap<BodyId, Arc<StoredBody>>;

#[derive(Debug, Default)]
struct State {
    bodies: Bodies,
    robots: BTreeMap<RobotId, Arc<StoredRobot>>,
    scenes: Scenes,
    /// Scenes that nobody asked for since they were read; none of them is in `scenes`.
    stored_scenes: BTreeMap<Arc<str>, Arc<StoredScene>>,
    jobs: BTreeMap<u64, Arc<Job>>,
    /// No new scene starts at or below it.
    revision_floor: u64,
}

impl Catalogue {
    /// Reads everything from the store. Bodies are proven when they are asked for first, or by
    /// [`Catalogue::prove_all`].
    ///
    /// # Errors
    /// When the file cannot be read, or holds a row, pose or name that is not valid.
    pub fn load(store: Store) -> Result<Self, StoreError> {
        let state = State::read(&store, &BTreeMap::new())?;
        let proven = AtomicBool::new(state.is_proven());
        Ok(Self { store: Mutex::new(store), state: RwLock::new(state), proven })
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

    /// One body of whatever kind by id; proven here if it is not yet.
    ///
    /// # Errors
    /// When there is none, or when it is damaged.
    pub fn geometry(&self, id: &BodyId) -> Result<Geometry, CatalogueError> {
        self.read(|state| state.bodies.get(id).cloned()).ok_or(CatalogueError::NoBody(*id))?.geometry()
    }

    /// Up to `count` bodies in the order of their ids, from the first one after `after`, without
    /// those that are damaged; and the last of the ids if more follow.
    pub fn bodies(&self, after: Option<&BodyId>, count: usize) -> (Vec<Geometry>, Option<BodyId>) {
        let (page, more) = self.read(|state| page(&state.bodies, after, count));
        let last = page.last().map(|body| *body.id());
        // Those that are damaged are left out.
        let _ = self.prove_bodies(page.iter().map(|body| body.id()));
        let bodies = page.iter().filter_map(|body| body.geometry().ok()).collect();
        (bodies, last.filter(|_| more))
    }

    /// Stores a body, of a ladder with its rungs; the one that was there first when the content is
    /// known. Returns whether it is new. A damaged one is replaced.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn create_body(&self, body: Geometry) -> Result<(Geometry, bool), CatalogueError> {
        // Those that are stored already are proven before others have to wait for it; one that is
        // damaged is replaced.
        let rungs: Vec<_> = body.rungs().iter().map(|rung| *rung.id()).collect();
        let _ = self.prove_bodies(rungs.iter().chain([body.id()]));
        let mut store = self.writer()?;
        if let Ok(known) = self.geometry(body.id()) {
            return Ok((known, false));
        }
        let fresh = self.read(|state| state.fresh(vec![body.clone()]))?;
        self.commit(&mut store, |transaction| put_bodies(transaction, &fresh))?;
        self.write(|state| state.keep(fresh));
        tracing::debug!(id = %body.id(), "body created");
        Ok((body, true))
    }

    /// Removes a body that no scene, no robot and no ladder uses.
    ///
    /// # Errors
    /// When there is none, when it is in use, or when the disk fails.
    pub fn delete_body(&self, id: &BodyId) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        self.read(|state| {
            if !state.bodies.contains_key(id) {
                return Err(CatalogueError::NoBody(*id));
            }
            if let Some(ladder) = state.bodies.values().find(|body| body.rungs().contains(id)) {
                return Err(CatalogueError::RungUsed { id: *id, ladder: *ladder.id() });
            }
            if let Some(robot) = state.robot_with(id) {
                return Err(CatalogueError::BodyOfRobot { id: *id, robot });
            }
            for stored in state.stored_scenes.values() {
                if let Some((object, _)) = stored.objects().find(|(_, body)| *body == id) {
                    let (scene, object) = (stored.name.clone(), object.into());
                    return Err(CatalogueError::BodyUsed { id: *id, scene, object });
                }
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
        self.write(|state| {
            let before = state.replace(fresh);
            self.note_proofs(state);
            before
        });
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
    fn read(store: &Store, known: &Bodies) -> Result<Self, StoreError> {
        let damaged = |what: String| StoreError::damaged(store.dir(), what);
        let Contents { bodies, ladders, scenes, objects, robots, instances, jobs, revision_floor } = store.read()?;
        let jobs = jobs.into_iter().map(|job| (job.id, Arc::new(job))).collect();
        let mut state = Self { revision_floor, jobs, ..Self::default() };
        let parsed = |kind: &str, id: &str| {
            id.parse::<BodyId>().map_err(|error| damaged(format!("{kind} \"{id}\" has no usable id: {error}")))
        };
        for (id, file) in bodies {
            let id = parsed("body", &id)?;
            state.read_body(id, BodyRow::File(file), known);
        }
        for (id, row) in ladders {
            let id = parsed("ladder", &id)?;
            let rung = |rung: &BodyId| {
                let stored = state.bodies.get(rung).cloned();
                stored.ok_or_else(|| damaged(format!("ladder {id} has a rung {rung} that is not stored")))
            };
            let rungs = row.rungs().iter().map(rung).collect::<Result<_, _>>()?;
            state.read_body(id, BodyRow::Ladder(row, rungs), known);
        }
        for (id, row) in robots {
            let parsed = id.parse::<RobotId>();
            let id = parsed.map_err(|error| damaged(format!("robot \"{id}\" has no usable id: {error}")))?;
            let robot = StoredRobot::read(id, row);
            if let Some(body) = robot.bodies().iter().find(|body| !state.bodies.contains_key(body)) {
                return Err(damaged(format!("robot {id} has a link of body {body}, which is not stored")));
            }
            state.robots.insert(id, Arc::new(robot));
        }
        state.read_scenes(scenes, (objects, instances), store)?;
        Ok(state)
    }

    fn read_body(&mut self, id: BodyId, row: BodyRow, known: &Bodies) {
        let known = known.get(&id).cloned();
        self.bodies.insert(id, known.unwrap_or_else(|| Arc::new(StoredBody::read(id, row))));
    }

    /// Takes bodies in that were just made. A ladder keeps the rungs it was read with: one of which
    /// a rung was damaged has to be stored again, too.
    fn keep(&mut self, bodies: Vec<Geometry>) {
        self.bodies.extend(bodies.into_iter().map(|body| (*body.id(), Arc::new(StoredBody::new(body)))));
    }

    /// Takes over what was read again.
    fn replace(&mut self, fresh: Self) -> Self {
        let before = std::mem::replace(self, fresh);
        self.revision_floor = self.revision_floor.max(before.revision_floor);
        // What has the same id has the same content.
        for (id, robot) in &mut self.robots {
            if let Some(known) = before.robots.get(id) {
                *robot = known.clone();
            }
        }
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
                    let stored = |rung: &Arc<Shape>| match self.bodies.get(rung.id()).map(|body| body.geometry()) {
                        Some(Ok(Geometry::Solid(stored))) => stored,
                        _ => rung.clone(),
                    };
                    let rungs: Vec<_> = ladder.rungs().iter().map(stored).collect();
                    all.extend(rungs.iter().cloned().map(Geometry::Solid));
                    Geometry::Ladder(Arc::new(Ladder::new(ladder.name(), rungs)?))
                }
                body @ (Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::Capsule(_) | Geometry::HalfSpace(_)) => {
                    body
                }
            };
            for body in all.into_iter().chain([body]) {
                let stored = self.bodies.get(body.id()).is_some_and(|stored| !stored.is_damaged());
                let known = stored || fresh.iter().any(|other| other.id() == body.id());
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
            Geometry::Solid(_) | Geometry::SosBody(_) | Geometry::Capsule(_) | Geometry::HalfSpace(_) => {
                files.insert(id.as_str(), body.to_json().as_bytes())?;
            }
        }
    }
    Ok(())
}

fn page<K: Ord, V: Clone>(map: &BTreeMap<K, V>, after: Option<&K>, count: usize) -> (Vec<V>, bool) {
    let from = after.map_or(Bound::Unbounded, Bound::Excluded);
    let mut rest = map.range((from, Bound::Unbounded)).map(|(_, value)| value.clone());
    let page = rest.by_ref().take(count).collect();
    (page, rest.next().is_some())
}
