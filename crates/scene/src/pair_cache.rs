//! Warm starts of pairs from one question to the next. They change how long an answer takes, never
//! the answer beyond its bracket, so a wrong entry is harmless and the table may forget.

use std::sync::atomic::{AtomicU32, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock, TryLockError};

use sublevel_core::measure::WarmStart;

use super::object::Slot;

/// Entries of a table, so that memory is bounded by about 55 MB, and by what is used, block by
/// block.
const ENTRIES: usize = 1 << 16;

/// Entries that are allocated together.
const BLOCK: usize = 64;

/// Cells in which a pair may stand. In one only, an eighth of the pairs of a scene of 10 000 objects
/// would put each other out again and again.
const WAYS: usize = 4;

/// How often questions found a warm start, in all scenes of this process.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WarmStartUse {
    /// The pair was there from an earlier question.
    pub hits: u64,
    /// The pair was new, had been put out by another, or was in use by another thread.
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
///
/// Entries stand in the order in which they were first used. Questions come in about the same order
/// again, so that the processor finds neighbours on the same pages and fetches them ahead; spread
/// over the whole table each would cost a quarter of a microsecond.
#[derive(Debug)]
pub(crate) struct PairCache {
    /// Where the entries of pairs are, by the hash of a pair; allocated when first used.
    sets: OnceLock<Box<[Set]>>,
    /// Entries that are given to a cell.
    used: AtomicU32,
    blocks: Box<[OnceLock<Block>]>,
    /// Where a pair that is new here starts from; it is not written.
    origin: Option<Arc<PairCache>>,
}

/// The cells of a pair, in one cache line.
#[derive(Debug, Default)]
#[repr(align(32))]
struct Set([Cell; WAYS]);

/// The position of an entry plus one in the lower half, 0 where there is none yet, and a part of
/// the hash of the pair that stands there in the upper one. The entry says for sure.
#[derive(Debug, Default)]
struct Cell(AtomicU64);

impl Cell {
    fn of(tag: u64, position: usize) -> u64 {
        tag << 32 | (position as u64 + 1)
    }

    /// The position, if there is one, and the tag.
    fn read(&self) -> (Option<usize>, u64) {
        let value = self.0.load(Ordering::Relaxed);
        ((value as u32 as usize).checked_sub(1), value >> 32)
    }
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
        let blocks = (0..blocks).map(|_| OnceLock::new()).collect();
        Self { sets: OnceLock::new(), used: AtomicU32::new(0), blocks, origin: None }
    }

    /// A table of so many entries whose new pairs start as they would in another one.
    pub(crate) fn beside(origin: Arc<Self>, entries: usize) -> Self {
        Self { origin: Some(origin), ..Self::with_entries(entries) }
    }

    /// Whether it was made beside this table.
    pub(crate) fn is_beside(&self, origin: &Arc<Self>) -> bool {
        self.origin.as_ref().is_some_and(|own| Arc::ptr_eq(own, origin))
    }

    fn entries(&self) -> usize {
        self.blocks.len() * BLOCK
    }

    /// Where among so many sets a pair may stand, and its tag.
    fn place(key: PairKey, sets: &[Set]) -> (&[Cell], u64) {
        let hash = key.mixed();
        (&sets[hash as usize % sets.len()].0, hash >> 32)
    }

    /// The position of the entry of a pair, if it has one.
    fn position(cells: &[Cell], tag: u64) -> Option<usize> {
        cells.iter().find_map(|cell| {
            let (position, of) = cell.read();
            position.filter(|_| of == tag)
        })
    }

    /// Gives a new pair an entry: the next one, or that of another pair.
    fn claim(&self, cells: &[Cell], tag: u64) -> Option<usize> {
        let next = |used| ((used as usize) < self.entries()).then_some(used + 1);
        if let Some(cell) = cells.iter().find(|cell| cell.read().0.is_none())
            && let Ok(position) = self.used.fetch_update(Ordering::Relaxed, Ordering::Relaxed, next)
        {
            let position = position as usize;
            let claimed = Cell::of(tag, position);
            // Threads that claim one cell at once lose an entry.
            return cell
                .0
                .compare_exchange(0, claimed, Ordering::Relaxed, Ordering::Relaxed)
                .is_ok()
                .then_some(position);
        }
        let from = tag as usize % WAYS;
        let (cell, position) = (0..WAYS).find_map(|k| {
            let cell = &cells[(from + k) % WAYS];
            cell.read().0.map(|position| (cell, position))
        })?;
        cell.0.store(Cell::of(tag, position), Ordering::Relaxed);
        Some(position)
    }

    fn entry(&self, position: usize) -> &Mutex<Entry> {
        let block = &self.blocks[position / BLOCK];
        &block.get_or_init(|| (0..BLOCK).map(|_| Mutex::default()).collect())[position % BLOCK]
    }

    /// The warm start of a pair, if it is known and not in use.
    fn copied(&self, key: PairKey) -> Option<WarmStart> {
        let (cells, tag) = Self::place(key, self.sets.get()?);
        let entry = self.entry(Self::position(cells, tag)?).try_lock().ok()?;
        (entry.key == key).then_some(entry.warm)
    }

    /// Lends the warm start of a pair; a cold one where it is not known or in use elsewhere.
    pub(crate) fn with<T>(&self, key: PairKey, solve: impl FnOnce(&mut WarmStart) -> T) -> T {
        let sets = self.sets.get_or_init(|| (0..self.entries() / WAYS).map(|_| Set::default()).collect());
        let (cells, tag) = Self::place(key, sets);
        let Some(position) = Self::position(cells, tag).or_else(|| self.claim(cells, tag)) else {
            USES[0].misses.fetch_add(1, Ordering::Relaxed);
            return solve(&mut WarmStart::default());
        };
        let uses = &USES[position % USES.len()];
        let mut entry = match self.entry(position).try_lock() {
            Ok(entry) => entry,
            // A panic elsewhere left a hint, which may be anything. What is proven of other parts
            // names its solids and pair, and is written whole.
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

    fn key(a: Slot) -> PairKey {
        PairKey { a, b: 1_000_000, ..PairKey::default() }
    }

    #[test]
    fn an_entry_is_lent_to_its_pair_only() {
        let cache = PairCache::with_entries(64);
        let put = |a| cache.with(key(a), |warm| *warm = WarmStart::default());
        // More pairs than places: nothing grows, nothing fails.
        (0..1000).for_each(put);
        cache.with(key(5), |_| cache.with(key(5), |_| ()));
        assert_eq!(cache.blocks.iter().filter(|block| block.get().is_some()).count(), 1);
    }

    #[test]
    fn entries_are_given_in_order_and_few_pairs_put_others_out() {
        let cache = PairCache::with_entries(4096);
        let position = |a| {
            let (cells, tag) = PairCache::place(key(a), cache.sets.get()?);
            let position = PairCache::position(cells, tag)?;
            (cache.entry(position).lock().expect("nobody panics").key == key(a)).then_some(position)
        };
        // An eighth of the table.
        (0..512).for_each(|a| cache.with(key(a), |_| ()));
        let kept: Vec<usize> = (0..512).filter_map(position).collect();
        assert!(kept.is_sorted() && kept.len() > 505, "{}", kept.len());
        // Twice as many as there are places: nearly all of these are in use, by different pairs.
        (0..8192).for_each(|a| cache.with(key(a), |_| ()));
        let mut kept: Vec<usize> = (0..8192).filter_map(position).collect();
        let count = kept.len();
        kept.sort_unstable();
        kept.dedup();
        assert!(kept.len() == count && count > 3500, "{} {count}", kept.len());
    }

    #[test]
    fn threads_that_claim_at_once_are_answered() {
        let cache = PairCache::with_entries(256);
        let answered: usize = std::thread::scope(|scope| {
            let ask = |_| scope.spawn(|| (0..20_000).filter(|k| cache.with(key(k % 700), |_| true)).count());
            let threads: Vec<_> = (0..4).map(ask).collect();
            threads.into_iter().map(|thread| thread.join().expect("nobody panics")).sum()
        });
        assert_eq!(answered, 80_000);
        // No entry stands in two cells.
        let cells = cache.sets.get().expect("used").iter().flat_map(|set| &set.0);
        let mut positions: Vec<usize> = cells.filter_map(|cell| cell.read().0).collect();
        let count = positions.len();
        positions.sort_unstable();
        positions.dedup();
        assert!(positions.len() == count && count > 200, "{count}");
    }
}
