//! The scenes of the catalogue. What is created, updated, committed or deleted is on disk before it
//! is seen; streamed poses are seen at once and written by [`Catalogue::write_poses`]; forks are in
//! memory only.
//!
//! Streamed poses give out revisions that are not on disk. So before a scene takes the first of
//! them a reserve of revisions is written, and a scene that was cut off starts above its reserve:
//! no revision is given out twice.

use std::collections::HashMap;
use std::ops::Bound;
use std::sync::atomic::Ordering;
use std::sync::{Arc, Weak};
use std::time::Duration;

use redb::WriteTransaction;

use crate::body::BodyId;
use crate::measure::Pose;
use crate::scene::{Placement, Scene, SceneError, Slot, Update, check_name};
use crate::store::robot_row::InstanceRow;
use crate::store::rows::{INSTANCES, META, OBJECTS, ObjectRow, RESERVES, REVISIONS, SCENES, SceneRow, json};
use crate::store::{Store, StoreError};

use super::live_scene::{LiveScene, MAX_FORKS, Origin, RESERVE, Scenes};
use super::scene_entry::SceneEntry;
use super::stored_scene::StoredScene;
use super::{Catalogue, CatalogueError, State};

/// Rows with the names of their scenes and their own.
type RowsOf<T> = Vec<(String, String, T)>;

impl Catalogue {
    /// A scene or fork by name; its bodies are proven here if they are not yet. Forks that are
    /// asked for stay.
    ///
    /// # Errors
    /// When there is none, or when it or one of its bodies is damaged.
    pub fn live_scene(&self, name: &str) -> Result<Arc<LiveScene>, CatalogueError> {
        loop {
            let (live, stored) =
                self.read(|state| (state.scenes.get(name).cloned(), state.stored_scenes.get(name).cloned()));
            match (live, stored) {
                (Some(live), _) => {
                    if live.origin.is_some() {
                        live.touch();
                    }
                    return Ok(live);
                }
                (None, Some(stored)) => self.enliven(&stored)?,
                (None, None) => return Err(CatalogueError::NoScene(name.to_owned())),
            }
        }
    }

    /// The latest snapshot of one scene.
    ///
    /// # Errors
    /// See [`Catalogue::live_scene`].
    pub fn scene(&self, name: &str) -> Result<Scene, CatalogueError> {
        Ok(self.live_scene(name)?.snapshot())
    }

    /// Up to `count` scenes and forks in the order of their names, from the first one after
    /// `after`; and whether more follow.
    pub fn scenes(&self, after: Option<&str>, count: usize) -> (Vec<SceneEntry>, bool) {
        self.read(|state| {
            let range = (after.map_or(Bound::Unbounded, Bound::Excluded), Bound::Unbounded);
            let live =
                state.scenes.range::<str, _>(range).map(|(_, live)| SceneEntry::of(&live.snapshot(), live.origin()));
            let stored = state.stored_scenes.range::<str, _>(range).map(|(_, stored)| SceneEntry::of_stored(stored));
            let mut entries: Vec<_> = live.take(count + 1).chain(stored.take(count + 1)).collect();
            entries.sort_by(|a, b| a.name.cmp(&b.name));
            let more = entries.len() > count;
            entries.truncate(count);
            (entries, more)
        })
    }

    /// Creates an empty scene, one revision above every scene and fork that was deleted.
    ///
    /// # Errors
    /// When the name is taken or not usable, or when the disk fails.
    pub fn create_scene(&self, name: &str) -> Result<Scene, CatalogueError> {
        check_name(name)?;
        let mut store = self.writer()?;
        let (taken, floor) = self.read(|state| (state.has_scene(name), state.revision_floor));
        if taken {
            return Err(CatalogueError::SceneExists(name.to_owned()));
        }
        let scene = Scene::new(name, floor + 1)?;
        self.commit(&mut store, |transaction| put_scene(transaction, &scene))?;
        let live = Arc::new(LiveScene::new(scene.clone(), None, floor));
        self.write(|state| state.scenes.insert(scene.name().clone(), live));
        tracing::debug!(scene = name, revision = scene.revision(), "scene created");
        Ok(scene)
    }

    /// Applies an update whole and returns the snapshot it is part of.
    ///
    /// # Errors
    /// When there is no such scene, when the update cannot be applied, or when the disk fails.
    pub fn update_scene(&self, name: &str, update: &Update) -> Result<Scene, CatalogueError> {
        let bodies = |id: &BodyId| self.geometry(id).ok();
        let live = self.live_scene(name)?;
        self.prove_bodies(update.upserts.iter().map(|placement| &placement.body))?;
        if live.origin.is_some() {
            // Deleting a body looks at forks, too, under the same lock.
            let _store = self.writer()?;
            self.check_placed_robots(update)?;
            let _changing = live.change();
            let next = live.snapshot().updated(update, bodies)?;
            live.publish(next.clone());
            return Ok(next);
        }
        let mut store = self.writer()?;
        self.check_placed_robots(update)?;
        let live = self.live_scene(name)?;
        let _changing = live.change();
        let scene = live.snapshot();
        let next = scene.updated(update, bodies)?;
        if !update.is_empty() {
            self.commit_scene(&mut store, &live, (&scene, &next))?;
            tracing::debug!(scene = name, revision = next.revision(), "scene updated");
        }
        Ok(next)
    }

    /// Writes what differs between two snapshots of a scene, then makes the later one current.
    fn commit_scene(
        &self,
        store: &mut Store,
        live: &LiveScene,
        (scene, next): (&Scene, &Scene),
    ) -> Result<(), StoreError> {
        let written = live.written.load(Ordering::Relaxed);
        self.commit(store, |transaction| {
            if next.same_structure(scene) {
                put_revision(transaction, next)?;
            } else {
                put_scene(transaction, next)?;
            }
            put_objects(transaction, scene, next, written)?;
            put_robots(transaction, scene, next, written)?;
            transaction.open_table(RESERVES)?.remove(&**next.name())?;
            Ok(())
        })?;
        live.written.store(next.revision(), Ordering::Relaxed);
        live.reserved.store(next.revision(), Ordering::Relaxed);
        live.publish(next.clone());
        Ok(())
    }

    /// Removes a scene with its objects, or a fork; the bodies stay.
    ///
    /// # Errors
    /// When there is no such scene, or when the disk fails.
    pub fn delete_scene(&self, name: &str) -> Result<(), CatalogueError> {
        let mut store = self.writer()?;
        if let Some(stored) = self.read(|state| state.stored_scenes.get(name).cloned()) {
            // Not proven for that: one that is damaged can be deleted.
            let objects = stored.objects().map(|(object, _)| object);
            let robots = stored.robots().map(|(robot, _)| robot);
            let floor = self.forget_scene(&mut store, (name, stored.revision), objects, robots)?;
            self.write(|state| {
                state.revision_floor = state.revision_floor.max(floor);
                state.scenes.remove(name);
                let removed = state.stored_scenes.remove(name);
                self.note_proofs(state);
                removed
            });
            return Ok(());
        }
        let live = self.live_scene(name)?;
        let _changing = live.change();
        let scene = live.snapshot();
        if live.origin.is_none() {
            let objects = scene.objects().map(|(_, object, _)| &*object.name);
            let robots = scene.robots().map(|robot| &**robot.name());
            self.forget_scene(&mut store, (name, scene.revision()), objects, robots)?;
            tracing::debug!(scene = name, revision = scene.revision(), "scene deleted");
        }
        self.write(|state| state.remove_scene(name));
        Ok(())
    }

    /// Removes the rows of a scene. Returns the revision that no later scene starts at or below.
    fn forget_scene<'a>(
        &self,
        store: &mut Store,
        (name, revision): (&str, u64),
        objects: impl Iterator<Item = &'a str>,
        robots: impl Iterator<Item = &'a str>,
    ) -> Result<u64, StoreError> {
        let floor = self.read(|state| state.revision_floor).max(revision);
        self.commit(store, |transaction| {
            transaction.open_table(META)?.insert("revision_floor", floor)?;
            transaction.open_table(SCENES)?.remove(name)?;
            transaction.open_table(REVISIONS)?.remove(name)?;
            transaction.open_table(RESERVES)?.remove(name)?;
            let mut rows = transaction.open_table(OBJECTS)?;
            for object in objects {
                rows.remove((name, object))?;
            }
            let mut rows = transaction.open_table(INSTANCES)?;
            for robot in robots {
                rows.remove((name, robot))?;
            }
            Ok(())
        })?;
        Ok(floor)
    }

    /// Makes a fork, in constant time and in memory only.
    ///
    /// # Errors
    /// When there is no such scene, when it is not at the expected revision, when the name is taken
    /// or not usable, or when there are too many forks.
    pub fn fork_scene(
        &self,
        name: &str,
        fork: &str,
        expected_revision: Option<u64>,
    ) -> Result<Arc<LiveScene>, CatalogueError> {
        self.live_scene(name)?;
        // Bodies of scenes are kept, see `delete_body`; so the snapshot becomes one of a scene
        // under the same lock.
        self.write(|state| {
            let parent = state.scenes.get(name).ok_or_else(|| CatalogueError::NoScene(name.to_owned()))?;
            let scene = parent.snapshot();
            if let Some(expected) = expected_revision.filter(|expected| *expected != scene.revision()) {
                return Err(SceneError::Revision { expected, current: scene.revision() }.into());
            }
            let forked = scene.fork(fork)?;
            if state.has_scene(fork) {
                return Err(CatalogueError::SceneExists(fork.to_owned()));
            }
            if state.scenes.values().filter(|live| live.origin.is_some()).count() >= MAX_FORKS {
                return Err(CatalogueError::TooManyForks);
            }
            let (parent, live) = (scene.name().clone(), Arc::downgrade(parent));
            let origin = Origin { parent, revision: scene.revision(), live };
            let begun = state.revision_floor.max(scene.revision());
            let live = Arc::new(LiveScene::new(forked, Some(origin), begun));
            state.scenes.insert(fork.into(), live.clone());
            Ok(live)
        })
    }

    /// Makes the content of a fork the next revision of its parent, and removes the fork.
    ///
    /// # Errors
    /// When it is no fork, when the parent is gone or has changed since, or when the disk fails.
    pub fn commit_fork(&self, name: &str) -> Result<Scene, CatalogueError> {
        // What was read from the disk is no fork, and is not proven to say so.
        if self.read(|state| state.stored_scenes.contains_key(name)) {
            return Err(CatalogueError::NoFork(name.to_owned()));
        }
        let mut store = self.writer()?;
        let fork = self.live_scene(name)?;
        let Some(origin) = fork.origin.clone() else { return Err(CatalogueError::NoFork(name.to_owned())) };
        let gone = || CatalogueError::NoParent { fork: name.to_owned(), parent: origin.parent.clone() };
        let is_it = |parent: &Arc<LiveScene>| Weak::ptr_eq(&Arc::downgrade(parent), &origin.live);
        let parent = self.live_scene(&origin.parent).ok().filter(is_it).ok_or_else(gone)?;
        let _changing_fork = fork.change();
        let _changing_parent = parent.change();
        let scene = parent.snapshot();
        if scene.revision() != origin.revision {
            let (expected, current) = (origin.revision, scene.revision());
            return Err(CatalogueError::ParentChanged { fork: name.to_owned(), expected, current });
        }
        let next = fork.snapshot().committed_to(&scene);
        if parent.origin.is_some() {
            parent.publish(next.clone());
        } else {
            self.commit_scene(&mut store, &parent, (&scene, &next))?;
        }
        self.write(|state| state.remove_scene(name));
        tracing::debug!(scene = &*origin.parent, revision = next.revision(), "fork committed");
        Ok(next)
    }

    /// Removes forks that nobody has used for a while.
    pub fn expire_forks(&self, idle: Duration) {
        let is_idle =
            |live: &LiveScene| live.origin.is_some() && live.current.receiver_count() == 0 && live.idle_for() >= idle;
        self.write(|state| {
            let idle: Vec<_> =
                state.scenes.iter().filter(|(_, live)| is_idle(live)).map(|(name, _)| name.clone()).collect();
            for name in idle {
                tracing::debug!(scene = &*name, "fork expired");
                state.remove_scene(&name);
            }
        });
    }

    /// Sets poses without writing them; [`Catalogue::write_poses`] does that. `place` turns the
    /// current snapshot into slots and poses.
    ///
    /// # Errors
    /// When a pose cannot be set, or when the first reserve of revisions cannot be written.
    pub fn stream_poses<E: From<CatalogueError>>(
        &self,
        live: &LiveScene,
        place: impl FnOnce(&Scene) -> Result<Vec<(Slot, Pose)>, E>,
    ) -> Result<Scene, E> {
        let (_changing, scene) = loop {
            if live.origin.is_some() {
                live.touch();
            } else if live.current.borrow().revision() + RESERVE / 2 > live.reserved.load(Ordering::Relaxed) {
                self.reserve(live).map_err(CatalogueError::from)?;
            }
            let changing = live.change();
            let scene = live.snapshot();
            // An update in between has given the reserve up.
            if live.origin.is_some() || scene.revision() < live.reserved.load(Ordering::Relaxed) {
                break (changing, scene);
            }
        };
        let next = scene.with_poses(&place(&scene)?).map_err(CatalogueError::from)?;
        live.publish(next.clone());
        Ok(next)
    }

    /// The same where nothing has to be written and nobody else changes the scene: then it takes no
    /// longer than to set the poses, and need not run on a thread that may block. None elsewhere.
    pub fn stream_poses_at_once<E: From<CatalogueError>>(
        &self,
        live: &LiveScene,
        place: impl FnOnce(&Scene) -> Result<Vec<(Slot, Pose)>, E>,
    ) -> Option<Result<Scene, E>> {
        let _changing = live.try_change()?;
        let scene = live.snapshot();
        if live.origin.is_some() {
            live.touch();
        } else if scene.revision() + RESERVE / 2 > live.reserved.load(Ordering::Relaxed) {
            return None;
        }
        let next = place(&scene).and_then(|poses| Ok(scene.with_poses(&poses).map_err(CatalogueError::from)?));
        if let Ok(next) = &next {
            live.publish(next.clone());
        }
        Some(next)
    }

    fn reserve(&self, live: &LiveScene) -> Result<(), StoreError> {
        let mut store = self.writer()?;
        let scene = live.snapshot();
        let reserved = scene.revision() + RESERVE;
        self.commit(&mut store, |transaction| {
            transaction.open_table(RESERVES)?.insert(&**scene.name(), reserved)?;
            Ok(())
        })?;
        live.reserved.store(reserved, Ordering::Relaxed);
        Ok(())
    }

    /// Writes poses that were streamed since the last time; with `last`, revisions that are
    /// reserved are given up, too. Returns how many scenes were written.
    ///
    /// # Errors
    /// When the disk fails; poses stay to be written.
    pub fn write_poses(&self, last: bool) -> Result<usize, StoreError> {
        let is_open = |live: &LiveScene| {
            let revision = live.current.borrow().revision();
            live.origin.is_none()
                && (revision > live.written.load(Ordering::Relaxed)
                    || last && live.reserved.load(Ordering::Relaxed) > revision)
        };
        let open: Vec<_> = self.read(|state| state.scenes.values().filter(|live| is_open(live)).cloned().collect());
        for live in &open {
            let mut store = self.writer()?;
            // Deleted meanwhile, or written by an update.
            let name = live.snapshot().name().clone();
            let is_there = self.read(|state| state.scenes.get(&name).is_some_and(|now| Arc::ptr_eq(now, live)));
            if !is_there {
                continue;
            }
            let (scene, written) = (live.snapshot(), live.written.load(Ordering::Relaxed));
            self.commit(&mut store, |transaction| {
                put_revision(transaction, &scene)?;
                put_objects(transaction, &scene, &scene, written)?;
                if last {
                    transaction.open_table(RESERVES)?.remove(&**scene.name())?;
                }
                Ok(())
            })?;
            live.written.store(scene.revision(), Ordering::Relaxed);
        }
        Ok(open.len())
    }
}

impl State {
    /// No later scene of the name takes its revisions again.
    fn remove_scene(&mut self, name: &str) -> Option<Arc<LiveScene>> {
        let live = self.scenes.remove(name)?;
        self.revision_floor = self.revision_floor.max(live.snapshot().revision());
        Some(live)
    }

    /// Whether there is a scene or fork of this name.
    fn has_scene(&self, name: &str) -> bool {
        self.scenes.contains_key(name) || self.stored_scenes.contains_key(name)
    }

    /// Forks stay, and scenes that were read again go on where they are, if that is not behind the
    /// disk.
    pub(super) fn keep_live(&mut self, before: &Scenes) {
        for (name, live) in before {
            if live.origin.is_some() {
                self.scenes.insert(name.clone(), live.clone());
                continue;
            }
            let Some(stored) = self.stored_scenes.get(name) else { continue };
            if stored.revision > live.snapshot().revision() {
                // The change that seemed to fail is on disk; its bodies were proven for it.
                match stored.live(|id| self.bodies.get(id)?.geometry().ok(), |id| self.known_robot(id)) {
                    Ok(there) => {
                        live.written.store(stored.revision, Ordering::Relaxed);
                        live.publish(there.snapshot());
                    }
                    Err(error) => {
                        tracing::error!(%error, "a scene that was read again is not used");
                        continue;
                    }
                }
            }
            self.stored_scenes.remove(name);
            self.scenes.insert(name.clone(), live.clone());
        }
    }

    /// The scenes as they were stored.
    pub(super) fn read_scenes(
        &mut self,
        scenes: Vec<(String, u64, SceneRow)>,
        (objects, instances): (RowsOf<ObjectRow>, RowsOf<InstanceRow>),
        store: &Store,
    ) -> Result<(), StoreError> {
        let damaged = |what: String| StoreError::damaged(store.dir(), what);
        let mut placed: HashMap<String, Vec<Placement>> = HashMap::new();
        for (scene, name, row) in objects {
            let fault = |what: String| damaged(format!("object \"{name}\" of scene \"{scene}\" {what}"));
            let placement = row.placement(&name).map_err(fault)?;
            if !self.bodies.contains_key(&placement.body) {
                return Err(fault(format!("is made of body {}, which is not stored", placement.body)));
            }
            placed.entry(scene).or_default().push(placement);
        }
        let mut robots: HashMap<String, Vec<(String, InstanceRow)>> = HashMap::new();
        for (scene, name, row) in instances {
            let id = row.robot();
            if !self.robots.contains_key(id) {
                let what = format!("robot \"{name}\" of scene \"{scene}\" is robot {id}, which is not stored");
                return Err(damaged(what));
            }
            robots.entry(scene).or_default().push((name, row));
        }
        for (name, revision, row) in scenes {
            check_name(&name).map_err(|error| damaged(format!("scene \"{name}\" has a name that {error}")))?;
            let placed = placed.remove(&name).unwrap_or_default();
            let robots = robots.remove(&name).unwrap_or_default();
            let stored = StoredScene::new(&name, revision, &row, (placed, robots));
            self.stored_scenes.insert(stored.name.clone(), Arc::new(stored));
        }
        match placed.keys().chain(robots.keys()).next() {
            Some(scene) => Err(damaged(format!("objects or robots of scene \"{scene}\", which is not stored"))),
            None => Ok(()),
        }
    }
}

fn put_scene(transaction: &WriteTransaction, scene: &Scene) -> Result<(), redb::Error> {
    transaction.open_table(SCENES)?.insert(&**scene.name(), json(&SceneRow::of(scene))?.as_slice())?;
    put_revision(transaction, scene)
}

fn put_revision(transaction: &WriteTransaction, scene: &Scene) -> Result<(), redb::Error> {
    transaction.open_table(REVISIONS)?.insert(&**scene.name(), scene.revision())?;
    Ok(())
}

/// Rows of objects that are new, changed or moved since a revision, and those of objects that are
/// gone.
fn put_objects(transaction: &WriteTransaction, before: &Scene, scene: &Scene, written: u64) -> Result<(), redb::Error> {
    let mut rows = transaction.open_table(OBJECTS)?;
    let name = &**scene.name();
    let mut put = |slot: Slot| -> Result<(), redb::Error> {
        // Links of robots are where their joints put them.
        if let (Some(object), Some(pose)) = (scene.object(slot), scene.pose(slot))
            && object.link.is_none()
        {
            rows.insert((name, &*object.name), json(&ObjectRow::of(object, pose))?.as_slice())?;
        }
        Ok(())
    };
    let mut moved: Vec<Slot> = scene.moved_since(written).collect();
    if !scene.same_structure(before) {
        for (slot, object, _) in scene.objects() {
            let same = before.object(slot).is_some_and(|earlier| Arc::ptr_eq(earlier, object));
            if !same {
                moved.push(slot);
            }
        }
    }
    moved.into_iter().try_for_each(&mut put)?;
    if !scene.same_structure(before) {
        for (_, object, _) in before.objects() {
            if scene.slot(&object.name).is_none() {
                rows.remove((name, &*object.name))?;
            }
        }
    }
    Ok(())
}

/// Rows of robots that are new, changed or moved since a revision, and those of robots that are
/// gone.
fn put_robots(transaction: &WriteTransaction, before: &Scene, scene: &Scene, written: u64) -> Result<(), redb::Error> {
    let mut rows = transaction.open_table(INSTANCES)?;
    let name = &**scene.name();
    let is_same = scene.same_structure(before);
    for robot in scene.robots().filter(|robot| !is_same || robot.moved_at() > written) {
        rows.insert((name, &**robot.name()), json(&InstanceRow::of(scene, &robot))?.as_slice())?;
    }
    for robot in before.robots().filter(|robot| scene.robot(robot.name()).is_none()) {
        rows.remove((name, &**robot.name()))?;
    }
    Ok(())
}
