//! What the cases of a family are drawn by.

use crate::comparison::Random;

/// The index of a seed's case among so many that go through all settings, permuted so that the
/// first seeds meet all settings.
pub(super) fn permuted_index(seed: u64, cases: u64) -> u64 {
    // Prime, and no factor of the numbers of cases.
    seed % cases * 61 % cases
}

/// A draw for a case of a family.
pub(super) fn random(family: u64, seed: u64) -> Random {
    Random(family * 1_000_000 + seed)
}
