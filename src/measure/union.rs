//! Distance of solids with several parts: the distance of their closest parts.
//!
//! The bracket of a minimum is the minimum of the brackets. A pair of parts counts no more once its lower bound exceeds
//! the best upper bound, which the bounds of its balls often do, and its own search else.

use super::Status;
use super::decide::{Goal, ball_gap, settle};
use super::distance::Distance;
use super::options::Options;
use super::pose::Pose;
use super::warm::WarmStart;
use crate::body::{Body, Solid};

/// Distance of two solids, or as much of it as the goal needs.
#[inline]
pub(super) fn distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    if let ([a], [b]) = (a.parts(), b.parts()) {
        return settle((a, pose_a), (b, pose_b), goal, options, warm);
    }
    let radius = a.circumscribed().radius.min(b.circumscribed().radius);
    let mut found = closest((a.parts(), pose_a), (b.parts(), pose_b), goal, options, warm);
    let narrow = found.upper - found.lower <= options.accuracy() * radius;
    found.status = if narrow { Status::Converged } else { Status::BracketWide };
    found
}

/// The smallest distance of a part of one solid from a part of the other. The closest parts of the last answer come first,
/// or those with the closest balls: the smaller the first distance, the more of the others need not be looked at.
fn closest(
    (a, pose_a): (&[Body], &Pose),
    (b, pose_b): (&[Body], &Pose),
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    let pairs = || (0..a.len()).flat_map(|i| (0..b.len()).map(move |j| (i, j)));
    let (mut i, mut j) = (usize::from(warm.parts.0), usize::from(warm.parts.1));
    if warm.is_cold() || i >= a.len() || j >= b.len() {
        let gap = |&(i, j): &(usize, usize)| ball_gap((&a[i], pose_a), (&b[j], pose_b));
        (i, j) = pairs().min_by(|p, q| gap(p).total_cmp(&gap(q))).unwrap_or((0, 0));
        *warm = WarmStart::default();
    }
    let first = (i, j);
    let mut best = settle((&a[i], pose_a), (&b[j], pose_b), goal, options, warm);
    for (i, j) in pairs().filter(|pair| *pair != first) {
        if best.upper <= goal.near.max(0.0) {
            break;
        }
        let nearer = Goal { near: goal.near, far: goal.far.min(best.upper) };
        let mut hint = WarmStart::default();
        let found = settle((&a[i], pose_a), (&b[j], pose_b), &nearer, options, &mut hint);
        let lower = best.lower.min(found.lower);
        let iterations = best.iterations + found.iterations;
        if found.upper < best.upper {
            best = found;
            *warm = hint;
            warm.parts = (i as u16, j as u16);
        }
        (best.lower, best.iterations) = (lower, iterations);
    }
    best
}

#[cfg(test)]
mod tests {
    use super::super::tests::{random_pose, unit};
    use super::super::{Decision, nearer_than, overlap};
    use super::*;
    use crate::body::Compound;
    use crate::polynomial::tests::Seeded;
    use nalgebra::{UnitQuaternion, Vector3};

    pub(in crate::measure) fn heap(random: &mut Seeded, count: usize) -> Compound {
        let mut part = || {
            let half = Vector3::from_fn(|_, _| 0.5 * 2_f64.powf(random.signed()));
            let body = match random.next() % 4 {
                0 => Body::ball("part", Vector3::zeros(), half.x),
                1 => Body::ellipsoid("part", Vector3::zeros(), half),
                2 => Body::cuboid("part", half),
                _ => Body::cylinder("part", half.x, half.y),
            };
            let turn = UnitQuaternion::from_euler_angles(random.signed(), random.signed(), random.signed());
            body.unwrap().moved(&turn, &Vector3::from_fn(|_, _| 2.0 * random.signed())).unwrap()
        };
        Compound::new("heap", (0..count).map(|_| part()).collect()).unwrap()
    }

    #[test]
    fn the_closest_parts_count() {
        let heaps: Vec<_> = (0..8).map(|seed| heap(&mut Seeded(seed), 1 + seed as usize % 5)).collect();
        for seed in 0..400 {
            let mut random = Seeded(900 + seed);
            let (a, b) = (&heaps[random.next() as usize % 8], &heaps[random.next() as usize % 8]);
            let pose_a = random_pose(&mut random, 1.0);
            let options = Options::default();
            let mut warm = WarmStart::default();
            let start = unit(&mut random) * 6.0;
            let step = unit(&mut random) * 0.2;
            for k in 0..5 {
                let place = pose_a.translation() + start + step * f64::from(k);
                let pose_b = Pose::from_quaternion(place, [0.5, 0.5, -0.5, 0.5]).unwrap();
                let pairs = a.parts().iter().flat_map(|p| b.parts().iter().map(move |q| (p, q)));
                let each = pairs
                    .map(|(p, q)| super::super::distance(p, &pose_a, q, &pose_b, &options, &mut WarmStart::default()));
                let (lower, upper) = each.fold((f64::MAX, f64::MAX), |(l, u), d| (l.min(d.lower), u.min(d.upper)));
                let found = super::super::distance(a, &pose_a, b, &pose_b, &options, &mut warm);
                let label = format!("seed {seed} step {k}: {found:?} against {lower} {upper}");
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= upper && lower <= found.upper, "{label}");
                assert!(((found.witness_a - found.witness_b).norm() - found.upper).abs() < 1e-11, "{label}");
                let decided = overlap(a, &pose_a, b, &pose_b, &options, &mut warm);
                match decided {
                    Decision::Yes => assert!(lower == 0.0, "{label}"),
                    Decision::No => assert!(upper > 0.0, "{label}"),
                    Decision::Undecided { .. } => assert!(lower == 0.0 && upper > 0.0, "{label}"),
                }
                for factor in [0.7, 1.3] {
                    let nearer = nearer_than(a, &pose_a, b, &pose_b, factor * upper, &options, &mut warm);
                    let expected = if factor > 1.0 && upper > 0.0 { Decision::Yes } else { Decision::No };
                    assert_eq!(nearer, Ok(expected), "{label}");
                }
            }
        }
    }

    #[test]
    fn hints_of_other_solids_do_no_harm() {
        let (large, small) = (heap(&mut Seeded(1), 5), heap(&mut Seeded(2), 2));
        let pose = Pose::from_quaternion(Vector3::new(7.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
        let mut warm = WarmStart::default();
        let options = Options::default();
        super::super::distance(&large, &Pose::identity(), &large, &pose, &options, &mut warm);
        let odd = super::super::distance(&small, &Pose::identity(), &small, &pose, &options, &mut warm);
        let cold =
            super::super::distance(&small, &Pose::identity(), &small, &pose, &options, &mut WarmStart::default());
        assert!(odd.lower <= cold.upper && cold.lower <= odd.upper, "{odd:?} {cold:?}");
    }
}
