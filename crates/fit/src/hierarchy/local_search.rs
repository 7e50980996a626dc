//! Near points of two sets, by Newton's method from many starts.

use super::placed_set::{Membership, PlacedSet};
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Starts of the search: the nearest pairs of the points that the sets come with.
const STARTS: usize = 12;
/// Newton steps at most.
const MAX_STEPS: usize = 40;
/// Steps that pull a point into its set.
const MAX_PULLS: usize = 60;

/// Near points of two sets, proven to lie in them, and their distances, metres, the nearest first;
/// one point, at distance 0, if one was found that both sets hold.
pub(super) fn nearest_points(sets: [&PlacedSet; 2], guesses: &[[Vector3<f64>; 2]]) -> Vec<(f64, [Vector3<f64>; 2])> {
    let (Some(first), Some(second)) = (sets[0].membership(), sets[1].membership()) else { return Vec::new() };
    let members = [first, second];
    let mut found: Vec<(f64, [Vector3<f64>; 2])> = Vec::new();
    let mut keep = |points: [Vector3<f64>; 2]| {
        let inside = [0, 1].map(|side| pulled(sets[side], &members[side], points[side]));
        let [Some(x), Some(y)] = inside else { return false };
        // One point in both is no distance apart.
        let common = [x, y].into_iter().find(|z| members.iter().all(|set| set.holds(z)));
        found.push(common.map_or((distance_up(&x, &y), [x, y]), |z| (0.0, [z, z])));
        common.is_some()
    };
    for start in guesses.iter().copied().chain(nearest_pairs(sets)) {
        if keep(start) || refined(sets, start).is_some_and(&mut keep) {
            break;
        }
    }
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    if found.first().is_some_and(|nearest| nearest.0 == 0.0) {
        found.truncate(1);
    }
    found
}

/// Rounded up.
fn distance_up(x: &Vector3<f64>, y: &Vector3<f64>) -> f64 {
    ((x - y).norm() * (1.0 + 8.0 * f64::EPSILON)).next_up()
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

/// Newton's method on `x - y + λ∇g(x) = 0, y - x + μ∇h(y) = 0, g(x) = h(y) = 1`.
fn refined(sets: [&PlacedSet; 2], start: [Vector3<f64>; 2]) -> Option<[Vector3<f64>; 2]> {
    let [mut x, mut y] = start;
    let polynomials = [sets[0].largest_at(&x).0, sets[1].largest_at(&y).0];
    let maps =
        sets.map(|set| set.set.normalization.linear * set.pose.rotation.to_rotation_matrix().into_inner().transpose());
    let at = |side: usize, x: &Vector3<f64>| {
        let jet = polynomials[side].evaluate(&sets[side].normalized(x));
        let map: Matrix3<f64> = maps[side];
        (jet.value, map.transpose() * jet.gradient, map.transpose() * jet.hessian * map)
    };
    let gap = x - y;
    let [mut lambda, mut mu] =
        [(0, x), (1, y)].map(|(side, x)| gap.norm() / at(side, &x).1.norm().max(f64::MIN_POSITIVE));
    for _ in 0..MAX_STEPS {
        let ((g, dg, hg), (h, dh, hh)) = (at(0, &x), at(1, &y));
        let mut matrix = SMatrix::<f64, 8, 8>::zeros();
        let identity = Matrix3::identity();
        matrix.fixed_view_mut::<3, 3>(0, 0).copy_from(&(identity + hg * lambda));
        matrix.fixed_view_mut::<3, 3>(0, 3).copy_from(&-identity);
        matrix.fixed_view_mut::<3, 3>(3, 0).copy_from(&-identity);
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&(identity + hh * mu));
        matrix.fixed_view_mut::<3, 1>(0, 6).copy_from(&dg);
        matrix.fixed_view_mut::<1, 3>(6, 0).copy_from(&dg.transpose());
        matrix.fixed_view_mut::<3, 1>(3, 7).copy_from(&dh);
        matrix.fixed_view_mut::<1, 3>(7, 3).copy_from(&dh.transpose());
        let mut right = SVector::<f64, 8>::zeros();
        right.fixed_rows_mut::<3>(0).copy_from(&-(x - y + dg * lambda));
        right.fixed_rows_mut::<3>(3).copy_from(&-(y - x + dh * mu));
        right[6] = 1.0 - g;
        right[7] = 1.0 - h;
        let step = matrix.lu().solve(&right)?;
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        // Not beyond a fraction of the sets: the model is good near by only.
        let length = step.fixed_rows::<6>(0).amax();
        let most = 0.3 * sets[0].radius_m().min(sets[1].radius_m());
        let share = (most / length.max(f64::MIN_POSITIVE)).min(1.0);
        x += step.fixed_rows::<3>(0) * share;
        y += step.fixed_rows::<3>(3) * share;
        lambda += step[6] * share;
        mu += step[7] * share;
        if length <= 1e-14 * most {
            break;
        }
    }
    Some([x, y])
}

/// The point moved against the gradient until it is proven inside; none if it does not get there.
pub(super) fn pulled(set: &PlacedSet, member: &Membership, mut x: Vector3<f64>) -> Option<Vector3<f64>> {
    let map = set.set.normalization.linear * set.pose.rotation.to_rotation_matrix().into_inner().transpose();
    let mut extra = 1e-14;
    for _ in 0..MAX_PULLS {
        if member.holds(&x) {
            return Some(x);
        }
        let (g, z) = set.largest_at(&x);
        let jet = g.evaluate(&z);
        let gradient: Vector3<f64> = map.transpose() * jet.gradient;
        let excess = (jet.value - 1.0).max(0.0) + extra;
        extra *= 4.0;
        x -= gradient * (excess / gradient.norm_squared().max(f64::MIN_POSITIVE));
    }
    None
}
