//! A scene or fork in memory: its latest snapshot, and what of it is on disk.

use std::collections::BTreeMap;
use std::sync::atomic::AtomicU64;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError, TryLockError, Weak};
use std::time::{Duration, Instant};

use tokio::sync::watch;

use crate::scene::Scene;

/// Scenes by name.
pub(super) type Scenes = BTreeMap<Arc<str>, Arc<LiveScene>>;

/// Most forks at a time.
pub const MAX_FORKS: usize = 1024;

/// Time after which a fork that nobody uses is removed.
pub const FORK_IDLE: Duration = Duration::from_secs(600);

/// Revisions that are reserved at a time: more than the poses of minutes take.
pub(super) const RESERVE: u64 = 1 << 20;

/// A scene or fork that changes.
#[derive(Debug)]
pub struct LiveScene {
    pub(super) current: watch::Sender<Scene>,
    /// Held while the next snapshot is made, so that none is lost.
    pub(super) changing: Mutex<()>,
    pub(super) origin: Option<Origin>,
    /// Revisions up to this one may be of an earlier scene of its name, or of this one before it
    /// was loaded.
    begun: u64,
    /// The last revision whose poses are on disk.
    pub(super) written: AtomicU64,
    /// Revisions up to this one may be given out before they are written.
    pub(super) reserved: AtomicU64,
    used: Mutex<Instant>,
}

/// What a fork was made of.
#[derive(Clone, Debug)]
pub struct Origin {
    /// Name of the parent.
    pub parent: Arc<str>,
    /// Revision of the parent then.
    pub revision: u64,
    pub(super) live: Weak<LiveScene>,
}

impl LiveScene {
    /// Of a snapshot; no scene that had its name went beyond revision `begun`.
    pub(super) fn new(scene: Scene, origin: Option<Origin>, begun: u64) -> Self {
        let revision = scene.revision();
        Self {
            current: watch::Sender::new(scene),
            changing: Mutex::new(()),
            origin,
            begun,
            written: AtomicU64::new(revision),
            reserved: AtomicU64::new(revision),
            used: Mutex::new(Instant::now()),
        }
    }

    /// The latest snapshot.
    pub fn snapshot(&self) -> Scene {
        self.current.borrow().clone()
    }

    /// The latest snapshot, and every later one; ends when the scene is deleted.
    pub fn changes(&self) -> watch::Receiver<Scene> {
        self.current.subscribe()
    }

    /// Whether it has given out this revision since it was made or loaded. Who knows such a
    /// revision knows the slots of its objects.
    pub fn knows(&self, revision: u64) -> bool {
        revision > self.begun && revision <= self.current.borrow().revision()
    }

    /// What it was made of; none if it is no fork.
    pub fn origin(&self) -> Option<&Origin> {
        self.origin.as_ref()
    }

    pub(super) fn publish(&self, scene: Scene) {
        self.current.send_replace(scene);
    }

    pub(super) fn touch(&self) {
        *self.used.lock().unwrap_or_else(PoisonError::into_inner) = Instant::now();
    }

    pub(super) fn idle_for(&self) -> Duration {
        self.used.lock().unwrap_or_else(PoisonError::into_inner).elapsed()
    }

    /// The right to change it, if nobody else has it.
    pub(super) fn try_change(&self) -> Option<MutexGuard<'_, ()>> {
        match self.changing.try_lock() {
            Ok(changing) => Some(changing),
            Err(TryLockError::Poisoned(poisoned)) => Some(poisoned.into_inner()),
            Err(TryLockError::WouldBlock) => None,
        }
    }

    pub(super) fn change(&self) -> MutexGuard<'_, ()> {
        self.changing.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
