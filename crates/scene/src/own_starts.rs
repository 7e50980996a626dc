//! Warm starts of one caller, which nobody else changes.

use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};

use super::pair_cache::PairCache;
use super::scene::Scene;

/// Entries of a table: some 2.6 MB when all are used.
const ENTRIES: usize = 4096;

/// Tables of all callers together, so that their number does not matter to memory; who comes when
/// all are given out uses the starts of the scene, as all others do.
const MOST: usize = 64;

/// Tables that are given out.
static GIVEN: AtomicUsize = AtomicUsize::new(0);

/// Warm starts of one caller that asks again and again about the same pairs, such as a stream: how
/// another caller moves these pairs changes nothing here. It keeps one table; questions about
/// another scene, which is not a fork, begin a new one.
#[derive(Debug, Default)]
pub struct OwnStarts(Option<Table>);

#[derive(Debug)]
struct Table {
    starts: Arc<PairCache>,
    _place: Place,
}

/// One of the tables that may be given out.
#[derive(Debug)]
struct Place;

impl Place {
    fn take() -> Option<Self> {
        let next = |given| (given < MOST).then_some(given + 1);
        GIVEN.fetch_update(Ordering::Relaxed, Ordering::Relaxed, next).ok().map(|_| Self)
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        GIVEN.fetch_sub(1, Ordering::Relaxed);
    }
}

impl OwnStarts {
    /// The same snapshot, whose questions start where those of this caller ended; pairs that are
    /// new to it start where those of others did.
    pub fn lend(&mut self, scene: &Scene) -> Scene {
        let shared = &scene.cache;
        if self.0.as_ref().is_none_or(|table| !table.starts.is_beside(shared)) {
            // First the place of the table that is not needed any more.
            self.0 = None;
            let table = |place| Table { starts: Arc::new(PairCache::beside(shared.clone(), ENTRIES)), _place: place };
            self.0 = Place::take().map(table);
        }
        match &self.0 {
            Some(table) => scene.with_cache(table.starts.clone()),
            None => scene.clone(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_are_bounded_and_given_back() {
        let scene = Scene::new("cell", 0).expect("a name");
        for _ in 0..3 {
            let mut callers: Vec<OwnStarts> = (0..2 * MOST).map(|_| OwnStarts::default()).collect();
            let lent: Vec<Scene> = callers.iter_mut().map(|own| own.lend(&scene)).collect();
            let own = lent.iter().filter(|lent| !Arc::ptr_eq(&lent.cache, &scene.cache)).count();
            // Other tests may hold some.
            assert!((MOST / 2..=MOST).contains(&own), "{own}");
        }
    }
}
