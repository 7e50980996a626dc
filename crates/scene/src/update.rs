//! From one snapshot to the next: an update is checked whole, then applied whole.

use std::collections::BTreeSet;
use std::fmt;
use std::sync::Arc;

use sublevel_core::body::{Body, BodyId};
use sublevel_core::measure::Pose;

use super::snapshot::ordered;
use super::{MAX_ALLOWED_PAIRS, MAX_NAME_BYTES, MAX_OBJECTS, NameError, Object, Scene, check_name};

/// An object to add or to replace.
#[derive(Debug, Clone)]
pub struct Placement {
    /// Unique in its scene.
    pub name: Arc<str>,
    /// Id of the body it is made of.
    pub body: BodyId,
    /// Body frame to world frame, metres.
    pub pose: Pose,
    /// Free label, may be empty.
    pub group: Arc<str>,
}

/// A set of changes that happen together. An object may be named once over `upserts`, `poses` and
/// `removals`, so that the order in which they are applied does not matter.
#[derive(Debug, Clone, Default)]
pub struct Update {
    /// When set, the update is for this revision only.
    pub expected_revision: Option<u64>,
    /// Objects to add, or to replace whole.
    pub upserts: Vec<Placement>,
    /// New poses (body frame to world frame, metres) of objects that are there.
    pub poses: Vec<(Arc<str>, Pose)>,
    /// Objects to remove, with their allowed pairs.
    pub removals: Vec<Arc<str>>,
    /// Pairs that may touch from now on.
    pub allow: Vec<(Arc<str>, Arc<str>)>,
    /// Pairs that may not touch any more.
    pub forbid: Vec<(Arc<str>, Arc<str>)>,
}

/// The lists of an [`Update`].
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum List {
    /// [`Update::upserts`].
    Upserts,
    /// [`Update::poses`].
    Poses,
    /// [`Update::removals`].
    Removals,
    /// [`Update::allow`].
    Allow,
    /// [`Update::forbid`].
    Forbid,
}

/// An entry of an [`Update`]: which list, and the position in it from 0.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// The list.
    pub list: List,
    /// Position in the list, from 0.
    pub index: usize,
}

/// Why an update cannot be applied. The scene is as it was.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum SceneError {
    /// Somebody else changed the scene first.
    #[error("the scene is at revision {current}, not at the expected {expected}; read it again and repeat the update")]
    Revision {
        /// What the update was made for.
        expected: u64,
        /// Where the scene is.
        current: u64,
    },
    /// A name cannot be stored.
    #[error("name {error}")]
    Name {
        /// Where.
        at: Entry,
        /// The rule it breaks.
        error: NameError,
    },
    /// A group label cannot be stored.
    #[error("group is longer than {MAX_NAME_BYTES} bytes or holds a control character; shorten it")]
    Group {
        /// Where.
        at: Entry,
    },
    /// Two entries change one object, so their order would matter.
    #[error("object \"{name}\" is named twice in one update; name it once")]
    Twice {
        /// The second entry.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// The update speaks of an object that the scene does not have.
    #[error("no object \"{name}\" in the scene; add it first")]
    NoObject {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// The update places a body that is not stored.
    #[error("no body {id}; create it first")]
    NoBody {
        /// Where.
        at: Entry,
        /// The body.
        id: BodyId,
    },
    /// A pair needs two objects.
    #[error("object \"{name}\" is paired with itself; name two objects")]
    Itself {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// The scene would be too large.
    #[error("the scene would hold {count} {what}, at most {limit} fit; split it into several scenes")]
    Full {
        /// Objects or allowed pairs.
        what: &'static str,
        /// How many there would be.
        count: usize,
        /// How many fit.
        limit: usize,
    },
}

impl Update {
    /// Whether there is nothing to do.
    pub fn is_empty(&self) -> bool {
        self.upserts.is_empty()
            && self.poses.is_empty()
            && self.removals.is_empty()
            && self.allow.is_empty()
            && self.forbid.is_empty()
    }

    /// Names of the objects that are there afterwards and may differ from before.
    pub fn written(&self) -> impl Iterator<Item = &Arc<str>> {
        self.upserts.iter().map(|placement| &placement.name).chain(self.poses.iter().map(|(name, _)| name))
    }

    /// Every object named in `upserts`, `poses` and `removals` is named once, with a usable name.
    fn check_names(&self) -> Result<(), SceneError> {
        let mut seen = BTreeSet::new();
        let upserts = entries(List::Upserts, self.upserts.iter().map(|placement| &placement.name));
        let poses = entries(List::Poses, self.poses.iter().map(|(name, _)| name));
        let removals = entries(List::Removals, self.removals.iter());
        for (at, name) in upserts.chain(poses).chain(removals) {
            check_name(name).map_err(|error| SceneError::Name { at, error })?;
            if !seen.insert(name) {
                return Err(SceneError::Twice { at, name: name.clone() });
            }
        }
        Ok(())
    }
}

impl Scene {
    /// The next snapshot: this one with all of `update` applied and the revision grown by one; a
    /// plain copy when the update is empty. `bodies` looks a body up by its id.
    ///
    /// # Errors
    /// The first entry that cannot be applied; then nothing is.
    pub fn updated(&self, update: &Update, bodies: impl Fn(&BodyId) -> Option<Arc<Body>>) -> Result<Self, SceneError> {
        if let Some(expected) = update.expected_revision
            && expected != self.revision
        {
            return Err(SceneError::Revision { expected, current: self.revision });
        }
        update.check_names()?;

        let mut next = self.clone();
        if update.is_empty() {
            return Ok(next);
        }
        for (at, name) in entries(List::Removals, &update.removals) {
            next.objects.remove(name).ok_or_else(|| SceneError::NoObject { at, name: name.clone() })?;
        }
        let stays = |(a, b): &(Arc<str>, Arc<str>)| next.objects.contains_key(a) && next.objects.contains_key(b);
        if !update.removals.is_empty() && !next.allowed.iter().all(stays) {
            Arc::make_mut(&mut next.allowed).retain(stays);
        }
        for (at, (name, pose)) in entries(List::Poses, &update.poses) {
            let object = next.objects.get_mut(name).ok_or_else(|| SceneError::NoObject { at, name: name.clone() })?;
            object.pose = *pose;
        }
        for (at, placement) in entries(List::Upserts, &update.upserts) {
            let object = place(at, placement, &bodies)?;
            next.objects.insert(object.name.clone(), object);
        }
        for (at, (a, b)) in entries(List::Allow, &update.allow) {
            let pair = next.pair(at, a, b)?;
            if !next.allowed.contains(&pair) {
                Arc::make_mut(&mut next.allowed).insert(pair);
            }
        }
        for (at, (a, b)) in entries(List::Forbid, &update.forbid) {
            let pair = next.pair(at, a, b)?;
            if next.allowed.contains(&pair) {
                Arc::make_mut(&mut next.allowed).remove(&pair);
            }
        }
        within("objects", next.objects.len(), MAX_OBJECTS)?;
        within("allowed pairs", next.allowed.len(), MAX_ALLOWED_PAIRS)?;
        next.revision += 1;
        Ok(next)
    }

    /// A pair of two different objects of this scene, in the order it is kept.
    fn pair(&self, at: Entry, a: &Arc<str>, b: &Arc<str>) -> Result<(Arc<str>, Arc<str>), SceneError> {
        for name in [a, b] {
            check_name(name).map_err(|error| SceneError::Name { at, error })?;
            if !self.objects.contains_key(name) {
                return Err(SceneError::NoObject { at, name: name.clone() });
            }
        }
        if a == b {
            return Err(SceneError::Itself { at, name: a.clone() });
        }
        Ok(ordered(a.clone(), b.clone()))
    }
}

fn place(
    at: Entry,
    placement: &Placement,
    bodies: impl Fn(&BodyId) -> Option<Arc<Body>>,
) -> Result<Object, SceneError> {
    let Placement { name, body: id, pose, group } = placement;
    if !group.is_empty() && check_name(group).is_err() {
        return Err(SceneError::Group { at });
    }
    let body = bodies(id).ok_or(SceneError::NoBody { at, id: *id })?;
    Ok(Object { name: name.clone(), body, pose: *pose, group: group.clone() })
}

fn within(what: &'static str, count: usize, limit: usize) -> Result<(), SceneError> {
    if count <= limit { Ok(()) } else { Err(SceneError::Full { what, count, limit }) }
}

fn entries<T>(list: List, items: impl IntoIterator<Item = T>) -> impl Iterator<Item = (Entry, T)> {
    items.into_iter().enumerate().map(move |(index, item)| (Entry { list, index }, item))
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}[{}]", self.list, self.index)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    fn at(x: f64) -> Pose {
        Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).expect("a pose")
    }

    fn ball() -> Arc<Body> {
        Arc::new(Body::ball("ball", Vector3::zeros(), 1.0).expect("a ball"))
    }

    fn put(name: &str, body: &Body) -> Placement {
        Placement { name: name.into(), body: *body.id(), pose: at(0.0), group: "".into() }
    }

    fn two() -> (Scene, Arc<Body>) {
        let body = ball();
        let update = Update {
            upserts: vec![put("a", &body), put("b", &body)],
            allow: vec![("b".into(), "a".into())],
            ..Update::default()
        };
        let scene = Scene::new("s", 7).expect("a name").updated(&update, |_| Some(body.clone())).expect("an update");
        (scene, body)
    }

    #[test]
    fn an_update_makes_the_next_revision_and_leaves_the_old_snapshot() {
        let (scene, body) = two();
        assert_eq!(scene.revision(), 8);
        assert!(scene.is_allowed("a", "b") && scene.is_allowed("b", "a"));
        let update = Update {
            poses: vec![("b".into(), at(3.0))],
            removals: vec!["a".into()],
            upserts: vec![put("c", &body)],
            ..Update::default()
        };
        let next = scene.updated(&update, |_| Some(body.clone())).expect("an update");
        assert_eq!(next.revision(), 9);
        assert_eq!(next.objects().map(|object| &*object.name).collect::<Vec<_>>(), ["b", "c"]);
        assert_eq!(next.object("b").expect("b").pose, at(3.0));
        assert_eq!(next.allowed_pairs().len(), 0);
        assert_eq!(scene.object("b").expect("b").pose, at(0.0));
        assert_eq!(scene.objects().len(), 2);
    }

    #[test]
    fn allowed_pairs_are_shared_until_they_change() {
        let (scene, _) = two();
        let shares = |update: Update| scene.updated(&update, |_| None).expect("an update").same_allowed_pairs(&scene);
        let d = Update::default;
        assert!(shares(Update { poses: vec![("a".into(), at(1.0))], ..d() }));
        assert!(shares(Update { allow: vec![("a".into(), "b".into())], ..d() }), "allowed before");
        assert!(!shares(Update { forbid: vec![("a".into(), "b".into())], ..d() }));
        assert!(!shares(Update { removals: vec!["a".into()], ..d() }));
    }

    #[test]
    fn an_empty_update_changes_nothing() {
        let (scene, _) = two();
        assert_eq!(scene.updated(&Update::default(), |_| None).expect("nothing").revision(), 8);
    }

    #[test]
    fn each_bad_update_is_refused_by_name() {
        let (scene, body) = two();
        let refused = |update: Update| {
            scene.updated(&update, |id| (id == body.id()).then(|| body.clone())).map(|_| ()).expect_err("refused")
        };
        let other = Body::ball("other", Vector3::zeros(), 2.0).expect("a ball");
        let entry = |list, index| Entry { list, index };
        let d = Update::default;
        assert_eq!(
            refused(Update { expected_revision: Some(7), ..d() }),
            SceneError::Revision { expected: 7, current: 8 }
        );
        assert_eq!(
            refused(Update { removals: vec!["a".into()], poses: vec![("a".into(), at(1.0))], ..d() }),
            SceneError::Twice { at: entry(List::Removals, 0), name: "a".into() }
        );
        assert_eq!(
            refused(Update { upserts: vec![put("c", &body), put("", &body)], ..d() }),
            SceneError::Name { at: entry(List::Upserts, 1), error: NameError::Empty }
        );
        assert_eq!(
            refused(Update { upserts: vec![put("c", &other)], ..d() }),
            SceneError::NoBody { at: entry(List::Upserts, 0), id: *other.id() }
        );
        assert_eq!(
            refused(Update { poses: vec![("z".into(), at(1.0))], ..d() }),
            SceneError::NoObject { at: entry(List::Poses, 0), name: "z".into() }
        );
        assert_eq!(
            refused(Update { removals: vec!["z".into()], ..d() }),
            SceneError::NoObject { at: entry(List::Removals, 0), name: "z".into() }
        );
        assert_eq!(
            refused(Update { allow: vec![("a".into(), "a".into())], ..d() }),
            SceneError::Itself { at: entry(List::Allow, 0), name: "a".into() }
        );
        assert_eq!(
            refused(Update { removals: vec!["a".into()], allow: vec![("a".into(), "b".into())], ..d() }),
            SceneError::NoObject { at: entry(List::Allow, 0), name: "a".into() }
        );
        assert_eq!(
            refused(Update { upserts: vec![Placement { group: "x".repeat(129).into(), ..put("c", &body) }], ..d() }),
            SceneError::Group { at: entry(List::Upserts, 0) }
        );
    }

    #[test]
    fn a_scene_has_room_for_so_many_objects() {
        let (scene, body) = two();
        let upserts = (0..MAX_OBJECTS).map(|i| put(&format!("o{i}"), &body)).collect();
        let error = scene.updated(&Update { upserts, ..Update::default() }, |_| Some(body.clone())).expect_err("full");
        assert_eq!(error, SceneError::Full { what: "objects", count: MAX_OBJECTS + 2, limit: MAX_OBJECTS });
    }
}
