//! All bodies, scenes and jobs in memory, every change written through.

mod jobs;

use std::collections::{BTreeMap, HashMap};
use std::ops::Bound;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, RwLock};
use std::thread;

use redb::WriteTransaction;

use crate::body::{Body, BodyId};
use crate::scene::{NameError, Object, Scene, SceneError, Update, check_name};

use super::disk::Contents;
use super::job::{Job, MAX_QUEUED_JOBS};
use super::rows::{BODIES, META, OBJECTS, ObjectRow, REVISIONS, SCENES, SceneRow};
use super::{Store, StoreError};

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
    bodies: BTreeMap<BodyId, Arc<Body>>,
    scenes: BTreeMap<Arc<str>, Arc<Scene>>,
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
    /// No scene has this name.
    #[error("no scene \"{0}\"; list the scenes, or create it first")]
    NoScene(String),
    /// The name is taken.
    #[error("there is a scene \"{0}\"; use it, delete it, or choose another name")]
    SceneExists(String),
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

    /// One body by id.
    pub fn body(&self, id: &BodyId) -> Option<Arc<Body>> {
        self.read(|state| state.bodies.get(id).cloned())
    }

    /// Up to `count` bodies in the order of their ids, from the first one after `after`; and
    /// whether more follow.
    pub fn bodies(&self, after: Option<&BodyId>, count: usize) -> (Vec<Arc<Body>>, bool) {
        self.read(|state| page(&state.bodies, after, count))
    }

    /// The latest snapshot of one scene.
    pub fn scene(&self, name: &str) -> Option<Arc<Scene>> {
        self.read(|state| state.scenes.get(name).cloned())
    }

    /// Up to `count` scenes in the order of their names, from the first one after `after`; and
    /// whether more follow.
    pub fn scenes(&self, after: Option<&str>, count: usize) -> (Vec<Arc<Scene>>, bool) {
        let after: Option<Arc<str>> = after.map(Into::into);
        self.read(|state| page(&state.scenes, after.as_ref(), count))
    }

    /// How many bodies and scenes there are.
    pub fn counts(&self) -> (usize, usize) {
        self.read(|state| (state.bodies.len(), state.scenes.len()))
    }

    /// Stores a body; the one that was there first when the content is known. Tells whether it is
    /// new.
    ///
    /// # Errors
    /// When the disk fails.
    pub fn create_body(&self, body: Body) -> Result<(Arc<Body>, bool), CatalogueError> {
        let mut store = self.writer()?;
        if let Some(known) = self.body(body.id()) {
            return Ok((known, false));
        }
        let (key, file) = (body.id().to_string(), body.to_json());
        self.commit(&mut store, |transaction| {
            transaction.open_table(BODIES)?.insert(key.as_str(), file.as_bytes())?;
            Ok(())
        })?;
        let body = Arc::new(body);
        self.write(|state| state.bodies.insert(*body.id(), body.clone()));
        tracing::debug!(id = %body.id(), "body created");
        Ok((body, true))
    }

    /// Removes a body that no scene uses.
    ///
    /// # Errors
    /// When there is none, when it is in use, or when the disk fails.
    pub fn delete_body(&self, id: &BodyId) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        self.read(|state| {
            if !state.bodies.contains_key(id) {
                return Err(CatalogueError::NoBody(*id));
            }
            let mut objects =
                state.scenes.values().flat_map(|scene| scene.objects().map(move |object| (scene, object)));
            match objects.find(|(_, object)| object.body.id() == id) {
                None => Ok(()),
                Some((scene, object)) => {
                    Err(CatalogueError::BodyUsed { id: *id, scene: scene.name().clone(), object: object.name.clone() })
                }
            }
        })?;
        let key = id.to_string();
        self.commit(&mut store, |transaction| {
            transaction.open_table(BODIES)?.remove(key.as_str())?;
            Ok(())
        })?;
        self.write(|state| state.bodies.remove(id));
        tracing::debug!(%id, "body deleted");
        Ok(())
    }

    /// Creates an empty scene, one revision above every scene that was deleted.
    ///
    /// # Errors
    /// When the name is taken or not usable, or when the disk fails.
    pub fn create_scene(&self, name: &str) -> Result<Arc<Scene>, CatalogueError> {
        check_name(name)?;
        let mut store = self.writer()?;
        let (taken, floor) = self.read(|state| (state.scenes.contains_key(name), state.revision_floor));
        if taken {
            return Err(CatalogueError::SceneExists(name.to_owned()));
        }
        let scene = Arc::new(Scene::new(name, floor + 1)?);
        self.commit(&mut store, |transaction| put_scene(transaction, &scene))?;
        self.write(|state| state.scenes.insert(scene.name().clone(), scene.clone()));
        tracing::debug!(scene = name, revision = scene.revision(), "scene created");
        Ok(scene)
    }

    /// Applies an update whole and returns the snapshot it is part of.
    ///
    /// # Errors
    /// When there is no such scene, when the update cannot be applied, or when the disk fails.
    pub fn update_scene(&self, name: &str, update: &Update) -> Result<Arc<Scene>, CatalogueError> {
        let mut store = self.writer()?;
        let scene = self.scene(name).ok_or_else(|| CatalogueError::NoScene(name.to_owned()))?;
        let next = Arc::new(scene.updated(update, |id| self.body(id))?);
        if update.is_empty() {
            return Ok(next);
        }
        self.commit(&mut store, |transaction| {
            if next.same_allowed_pairs(&scene) {
                put_revision(transaction, &next)?;
            } else {
                put_scene(transaction, &next)?;
            }
            let mut objects = transaction.open_table(OBJECTS)?;
            for removed in &update.removals {
                objects.remove((name, &**removed))?;
            }
            for object in update.written().filter_map(|written| next.object(written)) {
                objects.insert((name, &*object.name), json(&ObjectRow::of(object))?.as_slice())?;
            }
            Ok(())
        })?;
        self.write(|state| state.scenes.insert(next.name().clone(), next.clone()));
        tracing::debug!(scene = name, revision = next.revision(), "scene updated");
        Ok(next)
    }

    /// Removes a scene and its objects; their bodies stay.
    ///
    /// # Errors
    /// When there is no such scene, or when the disk fails.
    pub fn delete_scene(&self, name: &str) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        let scene = self.scene(name).ok_or_else(|| CatalogueError::NoScene(name.to_owned()))?;
        let floor = self.read(|state| state.revision_floor).max(scene.revision());
        self.commit(&mut store, |transaction| {
            transaction.open_table(META)?.insert("revision_floor", floor)?;
            transaction.open_table(SCENES)?.remove(name)?;
            transaction.open_table(REVISIONS)?.remove(name)?;
            let mut objects = transaction.open_table(OBJECTS)?;
            for object in scene.objects() {
                objects.remove((name, &*object.name))?;
            }
            Ok(())
        })?;
        self.write(|state| {
            state.revision_floor = floor;
            state.scenes.remove(name)
        });
        tracing::debug!(scene = name, revision = scene.revision(), "scene deleted");
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

    /// Makes memory say what the disk says.
    fn reread(&self, store: &mut Store) -> Result<(), StoreError> {
        store.reopen()?;
        let known = self.read(|state| state.bodies.clone());
        let fresh = State::read(store, &known)?;
        self.write(|state| std::mem::replace(state, fresh));
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
    fn read(store: &Store, known: &BTreeMap<BodyId, Arc<Body>>) -> Result<Self, StoreError> {
        let damaged = |what: String| StoreError::damaged(store.dir(), what);
        let Contents { bodies, scenes, objects, jobs, revision_floor } = store.read()?;
        tracing::info!(
            bodies = bodies.len(),
            scenes = scenes.len(),
            "loading; every body that is not known is re-proven"
        );
        let bodies: BTreeMap<_, _> =
            prove(&bodies, known).map_err(damaged)?.into_iter().map(|body| (*body.id(), body)).collect();
        let ids: HashMap<String, &Arc<Body>> = bodies.iter().map(|(id, body)| (id.to_string(), body)).collect();

        let mut placed: HashMap<String, Vec<Object>> = HashMap::new();
        for (scene, name, row) in objects {
            let fault = |what: &str| damaged(format!("object \"{name}\" of scene \"{scene}\" {what}"));
            let body = ids.get(&row.body).ok_or_else(|| fault("is made of a body that is not stored"))?;
            let pose = row.pose().map_err(|error| fault(&format!("has no pose: {error}")))?;
            check_name(&name).map_err(|error| fault(&error.to_string()))?;
            let object =
                Object { name: name.as_str().into(), body: Arc::clone(body), pose, group: row.group.as_str().into() };
            placed.entry(scene).or_default().push(object);
        }
        let jobs = jobs.into_iter().map(|job| (job.id, Arc::new(job))).collect();
        let mut state = Self { scenes: BTreeMap::new(), revision_floor, bodies: BTreeMap::new(), jobs };
        for (name, revision, row) in scenes {
            check_name(&name).map_err(|error| damaged(format!("scene {name:?} {error}")))?;
            let objects = placed.remove(&name).unwrap_or_default();
            let allowed = row.allowed.into_iter().map(|(a, b)| (a.into(), b.into()));
            let scene = Scene::restored(name.as_str().into(), revision, objects, allowed);
            if scene.allowed_pairs().any(|(a, b)| scene.object(a).is_none() || scene.object(b).is_none()) {
                return Err(damaged(format!("scene \"{name}\" allows a pair of objects it does not have")));
            }
            state.scenes.insert(scene.name().clone(), Arc::new(scene));
        }
        if let Some(scene) = placed.keys().next() {
            return Err(damaged(format!("objects of scene \"{scene}\", which is not stored")));
        }
        drop(ids);
        state.bodies = bodies;
        Ok(state)
    }
}

/// Bodies from their files, re-proven on all cores: the only part of loading that takes time.
fn prove(files: &[(String, String)], known: &BTreeMap<BodyId, Arc<Body>>) -> Result<Vec<Arc<Body>>, String> {
    let one = |(id, file): &(String, String)| {
        if let Some(body) = id.parse().ok().and_then(|id: BodyId| known.get(&id)) {
            return Ok(body.clone());
        }
        let body = Body::from_json(file).map_err(|error| format!("body {id}: {error}"))?;
        if body.id().to_string() == *id {
            Ok(Arc::new(body))
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

fn put_scene(transaction: &WriteTransaction, scene: &Scene) -> Result<(), redb::Error> {
    transaction.open_table(SCENES)?.insert(&**scene.name(), json(&SceneRow::of(scene))?.as_slice())?;
    put_revision(transaction, scene)
}

fn put_revision(transaction: &WriteTransaction, scene: &Scene) -> Result<(), redb::Error> {
    transaction.open_table(REVISIONS)?.insert(&**scene.name(), scene.revision())?;
    Ok(())
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
