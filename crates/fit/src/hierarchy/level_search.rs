//! Points of one set where the largest polynomial of another is low, by Newton's method from many
//! starts.

use super::placed_set::PlacedSet;
use nalgebra::{DMatrix, DVector, Vector3};
use sublevel_core::polynomial::{Jet, Polynomial};

/// Starts of the search among the points that the second set comes with.
const STARTS: usize = 12;
/// Newton steps at most.
const MAX_STEPS: usize = 30;
/// Changes of the active constraints at most.
const MAX_CHANGES: usize = 6;
/// Constraints within this of the largest polynomial, or of the boundary, begin as active.
const ACTIVE: f64 = 0.15;
/// At most as many are active as a point and a level have coordinates.
const MAX_ACTIVE: usize = 4;

/// Points that are proven to lie in the second set, and proven upper bounds of the largest
/// polynomial of the first set there, the lowest first: from guesses, or where there are none from
/// the middles of the sets and from points that the second set comes with.
pub(super) fn lowest_points(sets: [&PlacedSet; 2], guesses: &[Vector3<f64>]) -> Vec<(f64, [Vector3<f64>; 1])> {
    let (Some(first), Some(second)) = (sets[0].posed(), sets[1].posed()) else { return Vec::new() };
    let (Some(levels), Some(member)) = (first.membership(), second.membership()) else { return Vec::new() };
    let starts = if guesses.is_empty() { starts(sets) } else { guesses.to_vec() };
    let candidates = starts.into_iter().flat_map(|start| [Some(start), refined(sets, start)]).flatten();
    let found = candidates.filter_map(|x| {
        let x = member.pulled(x)?;
        let upper = levels.largest_value(&x);
        upper.is_finite().then_some((upper, [x]))
    });
    let mut found: Vec<_> = found.collect();
    found.sort_by(|a, b| a.0.total_cmp(&b.0));
    found
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

/// A polynomial of either set, with the set.
type Active<'a> = (&'a PlacedSet<'a>, &'a Polynomial);

/// Value and derivatives in the common frame.
fn jet((set, polynomial): Active, x: &Vector3<f64>) -> Jet {
    let jet = polynomial.evaluate(&set.normalized(x));
    let map = set.set.normalization.linear * set.pose.rotation.to_rotation_matrix().into_inner().transpose();
    let transposed = map.transpose();
    Jet { value: jet.value, gradient: transposed * jet.gradient, hessian: transposed * jet.hessian * map }
}

/// A point where `Σ λ_i ∇p_i + Σ μ_j ∇q_j = 0`, `Σ λ_i = 1`, `p_i = t`, `q_j = 1` for active i and
/// j, multipliers nonnegative and other constraints satisfied, unless the search ends before.
fn refined(sets: [&PlacedSet; 2], start: Vector3<f64>) -> Option<Vector3<f64>> {
    let constraints = sets.map(|set| set.set.polynomials.iter().map(|&g| (set, g)).collect::<Vec<Active>>());
    let values = |x: &Vector3<f64>| {
        let [p, q] = [0, 1].map(|side| {
            constraints[side].iter().map(|&(set, g)| g.evaluate(&set.normalized(x)).value).collect::<Vec<_>>()
        });
        let most = p.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        (most, p, q)
    };
    let (most, p, q) = values(&start);
    let slack = ACTIVE * most.abs().max(1.0);
    let mut levels: Vec<usize> = (0..p.len()).filter(|&i| p[i] >= most - slack).collect();
    levels.sort_by(|&a, &b| p[b].total_cmp(&p[a]));
    levels.truncate(MAX_ACTIVE);
    let mut bounds: Vec<usize> = (0..q.len()).filter(|&j| q[j] >= 1.0 - ACTIVE).collect();
    bounds.sort_by(|&a, &b| q[b].total_cmp(&q[a]));
    bounds.truncate(MAX_ACTIVE - levels.len());
    let mut x = start;
    for _ in 0..MAX_CHANGES {
        let active = [&levels, &bounds].map(|list| list.to_vec());
        let of = |side: usize| active[side].iter().map(|&i| constraints[side][i]).collect::<Vec<_>>();
        let (next, multipliers) = stationary([&of(0), &of(1)], x, 0.3 * sets[1].radius_m())?;
        x = next;
        // The multiplier that is most negative leaves.
        let (count, least) = (levels.len(), multipliers.imin());
        if multipliers[least] < 0.0 && !(count == 1 && least == 0) {
            if least < count {
                levels.remove(least);
            } else {
                bounds.remove(least - count);
            }
            continue;
        }
        // What is violated most enters.
        let (most, p, q) = values(&x);
        let active_level = levels.iter().map(|&i| p[i]).fold(f64::NEG_INFINITY, f64::max);
        let highest = (0..p.len()).max_by(|&a, &b| p[a].total_cmp(&p[b]))?;
        let outermost = (0..q.len()).max_by(|&a, &b| q[a].total_cmp(&q[b]))?;
        if q[outermost] > 1.0 + 1e-9 && !bounds.contains(&outermost) {
            bounds.push(outermost);
        } else if most > active_level + 1e-9 * most.abs().max(1.0) && !levels.contains(&highest) {
            levels.push(highest);
        } else {
            break;
        }
        if levels.len() + bounds.len() > MAX_ACTIVE {
            break;
        }
    }
    Some(x)
}

/// Newton's method on the equations of the active constraints, steps at most `longest` metres; the
/// point and the multipliers, those of levels first.
fn stationary(
    [levels, bounds]: [&[Active]; 2],
    mut x: Vector3<f64>,
    longest: f64,
) -> Option<(Vector3<f64>, DVector<f64>)> {
    let (m, n) = (levels.len(), levels.len() + bounds.len());
    let jets = |x: &Vector3<f64>| levels.iter().chain(bounds).map(|&active| jet(active, x)).collect::<Vec<_>>();
    let first = jets(&x);
    // Multipliers that balance the gradients best.
    let size = first.iter().map(|jet| jet.gradient.norm()).fold(f64::MIN_POSITIVE, f64::max);
    let balance = DMatrix::from_fn(4, n, |row, i| match row {
        3 => f64::from(u8::from(i < m)),
        row => first[i].gradient[row] / size,
    });
    let right = DVector::from_fn(4, |row, _| f64::from(u8::from(row == 3)));
    let mut multipliers = balance.svd(true, true).solve(&right, 1e-9).ok()?;
    let mut level = first[..m].iter().map(|jet| jet.value).fold(f64::NEG_INFINITY, f64::max);
    for _ in 0..MAX_STEPS {
        let jets = jets(&x);
        // Unknowns: point, level, multipliers.
        let mut matrix = DMatrix::zeros(4 + n, 4 + n);
        let mut right = DVector::zeros(4 + n);
        right[3] = 1.0 - multipliers.rows(0, m).sum();
        for (i, jet) in jets.iter().enumerate() {
            let is_level = i < m;
            for row in 0..3 {
                for column in 0..3 {
                    matrix[(row, column)] += multipliers[i] * jet.hessian[(row, column)];
                }
                matrix[(row, 4 + i)] = jet.gradient[row];
                matrix[(4 + i, row)] = jet.gradient[row];
                right[row] -= multipliers[i] * jet.gradient[row];
            }
            if is_level {
                matrix[(3, 4 + i)] = 1.0;
                matrix[(4 + i, 3)] = -1.0;
            }
            right[4 + i] = (if is_level { level } else { 1.0 }) - jet.value;
        }
        let step = matrix.lu().solve(&right)?;
        if !step.iter().all(|value| value.is_finite()) {
            return None;
        }
        let length = step.rows(0, 3).norm();
        let share = (longest / length.max(f64::MIN_POSITIVE)).min(1.0);
        x += step.fixed_rows::<3>(0) * share;
        level += step[3] * share;
        multipliers += step.rows(4, n) * share;
        if length <= 1e-14 * longest {
            break;
        }
    }
    Some((x, multipliers))
}
