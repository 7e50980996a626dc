//! Normals across which pairs of parts of two solids were apart: what a query of solids with
//! several parts keeps of others than the nearest ones, so that the next one looks up one height of
//! each instead of searching.

use nalgebra::Vector3;

/// Most pairs that are kept, those with the lowest bounds. It changes time only;
/// `other_parts_are_parted_by_their_last_normals` counts what is spared.
const MOST_PAIRS: usize = 4;

/// Pairs of parts, by their positions, with normals.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PartingNormals {
    /// By their bounds, the lowest first.
    pairs: [Parted; MOST_PAIRS],
    len: usize,
}

/// Two parts that are apart.
#[derive(Clone, Copy, Debug, Default)]
struct Parted {
    parts: (u16, u16),
    /// Lower bound of their distance, metres.
    lower: f64,
    /// From B to A, in A's frame, of any length.
    normal_a: Vector3<f64>,
}

impl PartingNormals {
    /// The normal of two parts, if it is kept.
    pub(super) fn of(&self, (i, j): (usize, usize)) -> Option<Vector3<f64>> {
        let mut kept = self.pairs[..self.len].iter();
        kept.find(|pair| pair.parts == (i as u16, j as u16)).map(|pair| pair.normal_a)
    }

    /// Keeps that of two parts at least `lower` metres apart, if few are nearer to each other.
    pub(super) fn keep(&mut self, (i, j): (usize, usize), lower: f64, normal_a: Vector3<f64>) {
        let place = self.pairs[..self.len].partition_point(|pair| pair.lower <= lower);
        if place == MOST_PAIRS {
            return;
        }
        self.len = MOST_PAIRS.min(self.len + 1);
        self.pairs.copy_within(place..self.len - 1, place + 1);
        self.pairs[place] = Parted { parts: (i as u16, j as u16), lower, normal_a };
    }
}

#[cfg(test)]
mod tests {
    use super::{MOST_PAIRS, PartingNormals};
    use nalgebra::Vector3;

    #[test]
    fn the_lowest_bounds_are_kept() {
        let mut kept = PartingNormals::default();
        for (i, lower) in [5.0, 1.0, 4.0, 2.0, 6.0, 3.0, 0.5].into_iter().enumerate() {
            kept.keep((i, 1), lower, Vector3::new(lower, 0.0, 0.0));
        }
        let mut lowers = [5.0, 1.0, 4.0, 2.0, 6.0, 3.0, 0.5].map(|lower| (lower, kept_at(&kept, lower)));
        lowers.sort_by(|a, b| a.0.total_cmp(&b.0));
        for (rank, (lower, is_kept)) in lowers.into_iter().enumerate() {
            assert_eq!(is_kept, rank < MOST_PAIRS, "{lower}: {kept:?}");
        }
        assert_eq!(kept.of((0, 0)), None);
    }

    fn kept_at(kept: &PartingNormals, lower: f64) -> bool {
        let position = [5.0, 1.0, 4.0, 2.0, 6.0, 3.0, 0.5].iter().position(|other| *other == lower).unwrap();
        kept.of((position, 1)) == Some(Vector3::new(lower, 0.0, 0.0))
    }
}
