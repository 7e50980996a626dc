//! Warm starts of pairs from one question to the next. They change how long an answer takes, never
//! the answer beyond its bracket, so a wrong entry is harmless and the table may forget.

use std::sync::atomic::{AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, TryLockError};

use sublevel_core::measure::WarmStart;

use super::object::Slot;

/// Entries of a table: a pair has one place only, so memory is bounded by about 41 MB, and by what
/// is used, block by block.
const ENTRIES: usize = 1 << 16;

/// Entries that are allocated together.
const BLOCK: usize = 64;

/// How often questions found a warm start, in all scenes of this process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarmStartUse {
    /// The pair was there from an earlier question.
    pub hits: u64,
    /// The pair was new, in the place of another, or in use by another thread.
    pub misses: u64,
}

impl WarmStartUse {
    /// Up to now.
    pub fn now() -> Self {
        let sum = |count: fn(&Uses) -> &AtomicU64| USES.iter().map(|uses| count(uses).load(Ordering::Relaxed)).sum();
        Self { hits: sum(|uses| &uses.hits), misses: sum(|uses| &uses.misses) }
    }
}

/// A part of the counts with a cache line of its own, so that threads do not wait for each other.
#[derive(Debug)]
#[repr(align(128))]
struct Uses {
    hits: AtomicU64,
    misses: AtomicU64,
}

/// Counts by the place of the entry.
static USES: [Uses; 64] = [const { Uses { hits: AtomicU64::new(0), misses: AtomicU64::new(0) } }; 64];

/// Warm starts of the pairs of one scene and its forks.
#[derive(Debug)]
pub(crate) struct PairCache {
    blocks: Box<[OnceLock<Block>]>,
    /// Where a pair that is new here starts from; it is not written.
    origin: Option<Arc<PairCache>>,
}

/// Entries side by side, each with a lock of its own.
type Block = Box<[Mutex<Entry>]>;

#[derive(Debug, Default)]
struct Entry {
    key: PairKey,
    warm: WarmStart,
}

/// What a warm start is of.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct PairKey {
    pub(crate) a: Slot,
    pub(crate) b: Slot,
    /// Rungs of the two.
    pub(crate) rungs: [u8; 2],
    /// Kind of the question: hints of one kind are of no use to another.
    pub(crate) kind: u8,
}

impl PairKey {
    /// A number that is spread evenly (the finalizer of SplitMix64).
    fn mixed(self) -> u64 {
        let [rung_a, rung_b] = self.rungs.map(u64::from);
        let mut x = (u64::from(self.a) << 32 | u64::from(self.b)) ^ (rung_a << 59 | rung_b << 27);
        x = x.wrapping_add(u64::from(self.kind)).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        x = (x ^ x >> 30).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        x ^ x >> 31
    }
}

impl Default for PairCache {
    fn default() -> Self {
        Self::with_entries(ENTRIES)
    }
}

impl PairCache {
    /// A table of so many entries, rounded up to a power of two.
    pub(crate) fn with_entries(entries: usize) -> Self {
        let blocks = entries.next_power_of_two().div_ceil(BLOCK);
        Self { blocks: (0..blocks).map(|_| OnceLock::new()).collect(), origin: None }
    }

    /// A table of so many entries whose new pairs start as they would in another one.
    pub(crate) fn beside(origin: Arc<Self>, entries: usize) -> Self {
        Self { origin: Some(origin), ..Self::with_entries(entries) }
    }

    /// Whether it was made beside this table.
    pub(crate) fn is_beside(&self, origin: &Arc<Self>) -> bool {
        self.origin.as_ref().is_some_and(|own| Arc::ptr_eq(own, origin))
    }

    fn index(&self, key: PairKey) -> usize {
        key.mixed() as usize % (self.blocks.len() * BLOCK)
    }

    /// The warm start of a pair, if it is known and not in use.
    fn copied(&self, key: PairKey) -> Option<WarmStart> {
        let index = self.index(key);
        let entry = self.blocks[index / BLOCK].get()?[index % BLOCK].try_lock().ok()?;
        (entry.key == key).then_some(entry.warm)
    }

    /// Lends the warm start of a pair; a cold one where it is not known or in use elsewhere.
    pub(crate) fn with<T>(&self, key: PairKey, solve: impl FnOnce(&mut WarmStart) -> T) -> T {
        let index = self.index(key);
        let block = self.blocks[index / BLOCK].get_or_init(|| (0..BLOCK).map(|_| Mutex::default()).collect());
        let uses = &USES[index % USES.len()];
        let mut entry = match block[index % BLOCK].try_lock() {
            Ok(entry) => entry,
            // A panic elsewhere left a hint, which may be anything.
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner(),
            Err(TryLockError::WouldBlock) => {
                uses.misses.fetch_add(1, Ordering::Relaxed);
                return solve(&mut WarmStart::default());
            }
        };
        let mut is_known = entry.key == key;
        if !is_known {
            let start = self.origin.as_ref().and_then(|origin| origin.copied(key));
            is_known = start.is_some();
            *entry = Entry { key, warm: start.unwrap_or_default() };
        }
        let count = if is_known { &uses.hits } else { &uses.misses };
        count.fetch_add(1, Ordering::Relaxed);
        solve(&mut entry.warm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn uses_are_counted() {
        let before = WarmStartUse::now();
        let cache = PairCache::with_entries(64);
        let key = PairKey { a: 1, b: 2, ..PairKey::default() };
        (0..5).for_each(|_| cache.with(key, |_| ()));
        // Other tests count, too.
        let WarmStartUse { hits, misses } = WarmStartUse::now();
        assert!(hits >= before.hits + 4 && misses > before.misses);
    }

    #[test]
    fn an_entry_is_lent_to_its_pair_only() {
        let cache = PairCache::with_entries(64);
        let key = |a| PairKey { a, b: 1_000_000, ..PairKey::default() };
        let put = |a| cache.with(key(a), |warm| *warm = WarmStart::default());
        // More pairs than places: nothing grows, nothing fails.
        (0..1000).for_each(put);
        cache.with(key(5), |_| cache.with(key(5), |_| ()));
        assert_eq!(cache.blocks.iter().filter(|block| block.get().is_some()).count(), 1);
    }
}
