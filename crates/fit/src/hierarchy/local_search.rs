//! Near points of two sets, by Newton's method from many starts.

use super::placed_set::PlacedSet;
use nalgebra::Vector3;
use sublevel_core::branch_and_bound::{self, NearPoints};

/// Starts of the search: the nearest pairs of the points that the sets come with.
const STARTS: usize = 12;

/// Near points of two sets, proven to lie in them, and their distances, metres, the nearest first;
/// one point, at distance 0, if one was found that both sets hold.
pub(super) fn nearest_points(sets: [&PlacedSet; 2], guesses: &[[Vector3<f64>; 2]]) -> Vec<NearPoints> {
    let (Some(first), Some(second)) = (sets[0].posed(), sets[1].posed()) else { return Vec::new() };
    branch_and_bound::nearest_points([&first, &second], guesses.iter().copied().chain(nearest_pairs(sets)))
}

fn nearest_pairs(sets: [&PlacedSet; 2]) -> Vec<[Vector3<f64>; 2]> {
    let placed = sets.map(|set| {
        let to_common = |x: &Vector3<f64>| set.pose.transform_point(&(*x).into()).coords;
        set.near_boundary.iter().map(to_common).collect::<Vec<_>>()
    });
    let nearest = |x: &Vector3<f64>| {
        let distances = placed[1].iter().map(|y| ((x - y).norm_squared(), [*x, *y]));
        distances.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let mut pairs: Vec<_> = placed[0].iter().filter_map(nearest).collect();
    pairs.sort_by(|a, b| a.0.total_cmp(&b.0));
    // Every eighth, so that not all starts are of one spot.
    pairs
        .iter()
        .take(STARTS / 2)
        .chain(pairs.iter().skip(STARTS / 2).step_by(8).take(STARTS / 2))
        .map(|pair| pair.1)
        .collect()
}
