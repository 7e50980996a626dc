//! Points of one set where the largest polynomial of another is low, by Newton's method from many
//! starts.

use super::placed_set::PlacedSet;
use nalgebra::Vector3;
use sublevel_core::branch_and_bound;

/// Starts of the search among the points that the second set comes with.
const STARTS: usize = 12;

/// Points that are proven to lie in the second set, and proven upper bounds of the largest
/// polynomial of the first set there, the lowest first: from guesses, or where there are none from
/// the middles of the sets and from points that the second set comes with.
pub(super) fn lowest_points(sets: [&PlacedSet; 2], guesses: &[Vector3<f64>]) -> Vec<(f64, [Vector3<f64>; 1])> {
    let (Some(first), Some(second)) = (sets[0].posed(), sets[1].posed()) else { return Vec::new() };
    let starts = if guesses.is_empty() { starts(sets) } else { guesses.to_vec() };
    let found = branch_and_bound::lowest_points([&first, &second], starts);
    found.into_iter().map(|(upper, x)| (upper, [x])).collect()
}

/// The middles of both sets, and of the points that the second one comes with the lowest and some
/// of the others, so that not all starts are of one spot.
fn starts(sets: [&PlacedSet; 2]) -> Vec<Vector3<f64>> {
    let value = |x: &Vector3<f64>| {
        let (g, z) = sets[0].largest_at(x);
        g.evaluate(&z).value
    };
    let to_common = |x: &Vector3<f64>| sets[1].pose.transform_point(&(*x).into()).coords;
    let mut near: Vec<_> = sets[1].near_boundary.iter().map(to_common).map(|x| (value(&x), x)).collect();
    near.sort_by(|a, b| a.0.total_cmp(&b.0));
    let stride = (near.len() / STARTS).max(1);
    let lowest = near.iter().take(STARTS / 2);
    let spread = near.iter().skip(STARTS / 2).step_by(stride).take(STARTS / 2);
    let middles = sets.map(|set| set.in_common_frame(&Vector3::zeros()));
    middles.into_iter().chain(lowest.chain(spread).map(|(_, x)| *x)).collect()
}
