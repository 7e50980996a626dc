//! One scene at one revision.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

use super::MAX_NAME_BYTES;

/// A body placed in a scene.
#[derive(Debug, Clone)]
pub struct Object {
    /// Unique in its scene.
    pub name: Arc<str>,
    /// The shape, shared with the catalogue and every other object made of it.
    pub body: Arc<Body>,
    /// Body frame to world frame, metres.
    pub pose: Pose,
    /// Free label that puts objects together; may be empty.
    pub group: Arc<str>,
}

/// An immutable snapshot of a scene.
#[derive(Debug, Clone)]
pub struct Scene {
    pub(super) name: Arc<str>,
    pub(super) revision: u64,
    pub(super) objects: BTreeMap<Arc<str>, Object>,
    /// Shared with the snapshot before as long as no update changes it.
    pub(super) allowed: Arc<BTreeSet<(Arc<str>, Arc<str>)>>,
}

/// Why a name is not usable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// Names hold at least one byte.
    #[error("is empty; give a name of 1 to {MAX_NAME_BYTES} bytes")]
    Empty,
    /// Names are short enough to print.
    #[error("is {0} bytes long; give a name of 1 to {MAX_NAME_BYTES} bytes")]
    Long(usize),
    /// Names print on one line.
    #[error("holds a control character; use printable characters only")]
    Control,
}

/// Checks that a name of a scene or object is usable: 1 to [`MAX_NAME_BYTES`] bytes, no control
/// characters.
///
/// # Errors
/// The first rule the name breaks.
pub fn check_name(name: &str) -> Result<(), NameError> {
    if name.is_empty() {
        Err(NameError::Empty)
    } else if name.len() > MAX_NAME_BYTES {
        Err(NameError::Long(name.len()))
    } else if name.chars().any(char::is_control) {
        Err(NameError::Control)
    } else {
        Ok(())
    }
}

impl Scene {
    /// An empty scene at the given revision.
    ///
    /// # Errors
    /// When the name is not usable, see [`check_name`].
    pub fn new(name: &str, revision: u64) -> Result<Self, NameError> {
        check_name(name)?;
        Ok(Self { name: name.into(), revision, objects: BTreeMap::new(), allowed: Arc::default() })
    }

    /// A scene as it was stored. The caller vouches that the names are usable and that every
    /// allowed pair is made of two of the objects; objects are distinguished by their names.
    pub fn restored(
        name: Arc<str>,
        revision: u64,
        objects: impl IntoIterator<Item = Object>,
        allowed: impl IntoIterator<Item = (Arc<str>, Arc<str>)>,
    ) -> Self {
        let objects = objects.into_iter().map(|object| (object.name.clone(), object)).collect();
        let allowed = allowed.into_iter().map(|(a, b)| ordered(a, b)).collect::<BTreeSet<_>>();
        let allowed = Arc::new(allowed);
        Self { name, revision, objects, allowed }
    }

    /// Its name, unique in a catalogue.
    pub fn name(&self) -> &Arc<str> {
        &self.name
    }

    /// Grows by one with every change and never goes back.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// One object by name.
    pub fn object(&self, name: &str) -> Option<&Object> {
        self.objects.get(name)
    }

    /// All objects in the order of their names.
    pub fn objects(&self) -> impl ExactSizeIterator<Item = &Object> {
        self.objects.values()
    }

    /// Pairs of object names that may touch, each with the smaller name first, in order.
    pub fn allowed_pairs(&self) -> impl ExactSizeIterator<Item = &(Arc<str>, Arc<str>)> {
        self.allowed.iter()
    }

    /// Whether the allowed pairs are untouched since `before`, an earlier snapshot of this scene.
    /// Takes no time.
    pub fn same_allowed_pairs(&self, before: &Self) -> bool {
        Arc::ptr_eq(&self.allowed, &before.allowed)
    }

    /// Whether two objects may touch; the order of the names does not matter.
    pub fn is_allowed(&self, a: &str, b: &str) -> bool {
        self.allowed.contains(&ordered(a.into(), b.into()))
    }
}

/// The one order in which an unordered pair is kept.
pub(super) fn ordered(a: Arc<str>, b: Arc<str>) -> (Arc<str>, Arc<str>) {
    if a <= b { (a, b) } else { (b, a) }
}
