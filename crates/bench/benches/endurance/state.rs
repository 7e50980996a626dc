//! The state of a run on disk: it is written whole or not at all, and a run continues from it.

use crate::tally::Tally;
use serde::{Deserialize, Serialize};
use std::collections::BTreeSet;
use std::path::Path;

/// A run, finished or not.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(crate) struct State {
    pub(crate) seed: u64,
    /// Hash of the bodies: another catalogue draws other queries.
    pub(crate) bodies: String,
    /// Commits that took part.
    pub(crate) commits: BTreeSet<String>,
    /// All blocks below are done.
    pub(crate) next: u64,
    /// Blocks done out of order.
    pub(crate) beyond: BTreeSet<u64>,
    /// Seconds of work, all sittings together.
    pub(crate) seconds: f64,
    pub(crate) tally: Tally,
}

impl State {
    pub(crate) fn read(path: &Path) -> Option<Self> {
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return None,
            Err(error) => panic!("{}: {error}", path.display()),
        };
        Some(serde_json::from_str(&text).unwrap_or_else(|error| panic!("{}: {error}", path.display())))
    }

    pub(crate) fn write(&self, path: &Path) {
        write(path, &serde_json::to_string_pretty(self).expect("a state is plain data"));
    }

    pub(crate) fn has(&self, block: u64) -> bool {
        block < self.next || self.beyond.contains(&block)
    }

    pub(crate) fn done(&mut self, block: u64, tally: Tally) {
        self.beyond.insert(block);
        while self.beyond.remove(&self.next) {
            self.next += 1;
        }
        self.tally.add(tally);
    }

    pub(crate) fn blocks(&self) -> u64 {
        self.next + self.beyond.len() as u64
    }
}

/// Writes a file beside its place and moves it there: a reader finds the old text or the new, never
/// half of it.
pub(crate) fn write(path: &Path, text: &str) {
    let beside = path.with_extension("new");
    let written = std::fs::write(&beside, text).and_then(|()| std::fs::rename(&beside, path));
    written.unwrap_or_else(|error| panic!("{}: {error}", path.display()));
}
