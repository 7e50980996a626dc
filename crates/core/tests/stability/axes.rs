//! Two capsules, and a capsule and a ball, in closed form: brackets of rounding width around the
//! answer of 200 bits.

use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::PI;
use sublevel_core::body::Body;
use sublevel_core::measure::{Capsule, Options, WarmStart, distance_of_capsules, distance_to_capsule};
use sublevel_testkit::random::{Seeded, draws, pose};
use sublevel_testkit::reference::capsule;

/// From crossing to parallel, side by side, end to end, on one line and in each other, whatever the
/// lengths are.
#[test]
fn all_pairs_of_axes_are_known_to_rounding() {
    for seed in 0..draws(20_000) {
        let mut random = Seeded(seed);
        let ratio = 10_f64.powi(random.index(7) as i32);
        let sizes = [random.between(0.1, 3.0), random.between(0.1, 3.0) / ratio];
        let tilt = [0.0, 1e-16, 1e-14, 1e-12, 1e-9, 1e-7, 1e-6, 1e-4, 1e-2, 1.0, PI][random.index(11)];
        let here = if random.index(3) == 0 { UnitQuaternion::identity() } else { random.rotation() };
        let turn = UnitQuaternion::new_normalize(*(UnitQuaternion::new(random.unit() * tilt) * here));
        let axis = here * Vector3::z();
        let away = [random.unit(), axis, here * Vector3::x()][random.index(3)];
        let reach = [0.0, 1e-12, 1e-6, 1e-2, 0.5, 1.0, 30.0][random.index(7)];
        let along = axis * (random.signed() * sizes[0] * [0.0, 1.0][random.index(2)]);
        let from = random.unit() * [0.0, 1.0, 1e6][random.index(3)];
        let (pose_a, pose_b) = (pose(from, &here), pose(from + along + away * reach, &turn));
        let [a, b] = sizes.map(|half| {
            let half = if random.index(4) == 0 { 0.0 } else { half };
            Capsule::new(0.1 * half, half).unwrap()
        });
        let found = distance_of_capsules(&a, &pose_a, &b, &pose_b, &Options::default());
        let truth = capsule::signed_distance_of_two((&a, &pose_a), (&b, &pose_b));
        let size = sizes[0].max(sizes[1]) + (pose_a.translation() - pose_b.translation()).norm();
        let label = format!("seed {seed} tilt {tilt:e} ratio {ratio}: {found:?} {truth:?}");
        assert!(found.lower <= found.upper && found.upper - found.lower < 1e-13 * size, "{label}");
        assert!(truth.inside(found.lower, found.upper), "{label}");
        let of_axes = truth.value() + a.radius_m() + b.radius_m();
        // Nothing is promised of the normal of axes nearer to each other than the accuracy.
        if of_axes > 1e-9 * size {
            let (n, m) = (found.normal.expect(&label), truth.normal.expect(&label));
            assert!((n - m).norm() <= 1e-9 + 1e-14 * size / of_axes, "{label}");
        }
    }
}

/// A ball about a point of its frame is one about the origin at another pose: 200 balls in turn, as
/// making them takes longer than measuring them.
#[test]
fn balls_may_be_anywhere_in_their_frames() {
    let new_ball = |seed: u64| {
        let mut random = Seeded(700_000 + seed);
        let (center, radius) = (random.unit() * (10.0 * random.positive()), random.between(0.1, 2.0));
        (center, radius, Body::ball("ball", center, radius).unwrap())
    };
    let balls: Vec<_> = (0..200).map(new_ball).collect();
    for seed in 0..draws(2000) {
        let mut random = Seeded(seed);
        let (center, radius, body) = &balls[(seed % 200) as usize];
        let (place, capsule_pose) = (random.pose(1.0), random.pose(1.0));
        let limb = Capsule::new(0.2, 3.0 * random.positive()).unwrap();
        let warm = &mut WarmStart::default();
        let found = distance_to_capsule(body, &place, &limb, &capsule_pose, &Options::default(), warm);
        let alone = Capsule::new(*radius, 0.0).unwrap();
        let there = pose(place.transform_point(center), place.rotation());
        let truth = capsule::signed_distance_of_two((&alone, &there), (&limb, &capsule_pose));
        // The other pose rounds, too.
        let floor = 16.0 * f64::EPSILON * (1.0 + center.norm());
        let label = format!("seed {seed}: {found:?} {truth:?}");
        assert!(found.lower <= truth.value() + floor && truth.value() - floor <= found.upper, "{label}");
        assert!(found.upper - found.lower < 1e-13 * (2.0 + center.norm() + radius), "{label}");
    }
}
