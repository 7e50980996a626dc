//! Penetration depths against closed forms, brute force over directions, and laws.

use super::*;
use crate::body::Body;
use crate::measure::tests::{at, random_pose, zoo};
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

fn cold(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> Penetration {
    penetration(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
}

/// That the bracket contains the truth and is as narrow as asked for.
fn check(answer: &Penetration, truth: f64, accuracy: f64, size: f64, label: &str) {
    let floor = 1e-14 * size;
    let label = format!("{label}, depth {truth:e}: {answer:?}");
    assert_eq!(answer.status, Status::Converged, "{label}");
    assert!(answer.lower <= truth + floor && truth - floor <= answer.upper, "{label}");
    assert!(answer.upper - answer.lower <= (accuracy * answer.upper).max(1e-9 * size), "{label}");
}

#[test]
fn ball_pairs() {
    for seed in 0..120 {
        let mut random = Seeded(seed);
        let scale = 10_f64.powi((seed % 5) as i32 * 4 - 8);
        let (ra, rb) = (scale, scale * 10_f64.powf(2.0 * random.signed()));
        let (a, b) = (Body::ball("a", Vector3::zeros(), ra).unwrap(), Body::ball("b", Vector3::zeros(), rb).unwrap());
        let small = ra.min(rb);
        let truth = [-0.5, -1e-6, 0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, 1.0][(seed % 9) as usize] * small;
        let pose_a = random_pose(&mut random, 3.0 * scale);
        let direction = random.unit();
        let moved = pose_a.translation() + direction * (ra + rb - truth);
        let pose_b = Pose::from_quaternion(moved, [0.5, 0.5, 0.5, 0.5]).unwrap();
        let answer = cold(&a, &pose_a, &b, &pose_b);
        check(&answer, truth.max(0.0), 1e-3, ra.max(rb), &format!("seed {seed}, radii {ra:e} {rb:e}"));
        if truth > 1e-5 * small {
            assert!((answer.direction.unwrap() + direction).norm() < 1e-3, "seed {seed}: {answer:?}");
            assert!((answer.upper - truth).abs() < 2e-9 * small + 1e-13 * ra.max(rb), "seed {seed}: {answer:?}");
        }
    }
}

#[test]
fn boxes_leave_by_the_nearest_face() {
    for seed in 0..150 {
        let mut random = Seeded(seed);
        let half = |random: &mut Seeded| Vector3::from_fn(|_, _| 5_f64.powf(random.signed()));
        let (ha, hb) = (half(&mut random), half(&mut random));
        let shift = (ha + hb).map(|reach| reach * 1.1 * random.signed());
        let ways = ha + hb - shift.abs();
        let truth = ways.min().max(0.0);
        let (a, b) = (Body::cuboid("a", ha).unwrap(), Body::cuboid("b", hb).unwrap());
        // Turned together, so that the faces are across no axis of the table of directions but in
        // A's frame.
        let turn = random_pose(&mut random, 1.0);
        let pose_b = turn.with_translation(turn.transform_point(&shift));
        let size = ha.norm().max(hb.norm());
        let answer = cold(&a, &turn, &b, &pose_b);
        check(&answer, truth, 1e-3, size, &format!("seed {seed}"));
        let swapped = cold(&b, &pose_b, &a, &turn);
        check(&swapped, truth, 1e-3, size, &format!("seed {seed} swapped"));
        if let Some(n) = answer.direction {
            let axis = ways.imin();
            let out = Vector3::from_fn(|i, _| if i == axis { -shift[i].signum() } else { 0.0 });
            let separates = turn.transform_direction(&out).dot(&n) > 0.99;
            assert!(separates || answer.upper > truth * (1.0 + 1e-9), "seed {seed}: {answer:?}");
        }
    }
}

#[test]
fn coaxial_powers_come_out_along_the_axis_or_shorter() {
    for seed in 0..96 {
        let mut random = Seeded(seed);
        let degrees = [2_u8, 4, 6, 8];
        let (ka, kb) = (degrees[(seed % 4) as usize], degrees[(seed / 4 % 4) as usize]);
        // Thin along the axis, so that no other translation out is shorter.
        let mut half =
            |_| Vector3::new(1.0, 3.0 + random.signed(), 3.0 + random.signed()) * 2_f64.powf(random.signed());
        let (ha, hb) = (half(0), half(1));
        let a = Body::superellipsoid("a", Vector3::zeros(), ha, ka).unwrap();
        let b = Body::superellipsoid("b", Vector3::zeros(), hb, kb).unwrap();
        let truth = [1e-9, 1e-6, 1e-3, 0.3, 1.0][(seed % 5) as usize] * ha.x.min(hb.x);
        let offset = ha.x + hb.x - truth;
        let answer = cold(&a, &Pose::identity(), &b, &at(if seed % 2 == 0 { offset } else { -offset }, 0.0, 0.0));
        check(&answer, truth, 1e-3, ha.norm().max(hb.norm()), &format!("seed {seed} ({ka}, {kb})"));
    }
}

/// The least over many directions of the support gap, improved around the best: the depth from
/// above.
fn brute_force(support: impl Fn(&Vector3<f64>) -> f64, random: &mut Seeded) -> f64 {
    let mut best = (f64::INFINITY, Vector3::x());
    for _ in 0..20_000 {
        let n = random.unit();
        let value = support(&n);
        if value < best.0 {
            best = (value, n);
        }
    }
    let mut radius = 0.1;
    while radius > 1e-9 {
        for _ in 0..40 {
            let n = (best.1 + random.unit() * radius).normalize();
            let value = support(&n);
            if value < best.0 {
                best = (value, n);
            }
        }
        radius *= 0.7;
    }
    best.0
}

#[test]
fn ellipsoid_pairs_against_brute_force() {
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let half = |random: &mut Seeded| Vector3::from_fn(|_, _| 4_f64.powf(random.signed()));
        let (ha, hb) = (half(&mut random), half(&mut random));
        let (a, b) =
            (Body::ellipsoid("a", Vector3::zeros(), ha).unwrap(), Body::ellipsoid("b", Vector3::zeros(), hb).unwrap());
        let near = 0.8 * (ha.min() + hb.min()) * random.signed().abs();
        let (pose_a, pose_b) = (random_pose(&mut random, 0.0), random_pose(&mut random, near));
        let reach = |half: &Vector3<f64>, pose: &Pose, n: &Vector3<f64>| {
            pose.rotation().inverse_transform_vector(n).component_mul(half).norm()
        };
        let apart = pose_b.translation() - pose_a.translation();
        let truth = brute_force(|n| reach(&ha, &pose_a, n) + reach(&hb, &pose_b, n) + n.dot(&apart), &mut random);
        for accuracy in [1e-3, 1e-6] {
            let options = Options::default().with_depth_accuracy(accuracy).unwrap();
            let answer = penetration(&a, &pose_a, &b, &pose_b, &options, &mut WarmStart::default());
            let label = format!("seed {seed}, accuracy {accuracy:e}");
            // Brute force is above the truth by little.
            assert!(
                answer.lower <= truth && truth <= answer.upper * (1.0 + 2.0 * accuracy),
                "{label}, {truth}: {answer:?}"
            );
            assert_eq!(answer.status, Status::Converged, "{label}: {answer:?}");
            assert!(answer.upper - answer.lower <= accuracy * answer.upper, "{label}: {answer:?}");
        }
    }
}

#[test]
fn moving_out_by_the_depth_separates_and_by_less_does_not() {
    let mut met = 0;
    for seed in 0..150 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (i, j) = (random.next() as usize % bodies.len(), random.next() as usize % bodies.len());
        let (a, b) = (&bodies[i], &bodies[j]);
        let s = a.circumscribed().radius.max(b.circumscribed().radius);
        let far = s * random.signed().abs();
        let (pose_a, pose_b) = (random_pose(&mut random, 0.1), random_pose(&mut random, far));
        let answer = cold(a, &pose_a, b, &pose_b);
        let label = format!("seed {seed} {}-{}: {answer:?}", a.name(), b.name());
        assert!(answer.lower <= answer.upper, "{label}");
        assert_eq!(answer.status, Status::Converged, "{label}");
        let Some(n) = answer.direction else { continue };
        met += 1;

        let clear = answer.upper + 1e-9 * s;
        let moved = pose_a.with_translation(pose_a.translation() + n * clear);
        let apart = crate::measure::tests::cold(a, &moved, b, &pose_b);
        assert!(apart.upper > 0.0 || apart.lower > 0.0, "{label}: {apart:?}");
        // Less than the lower bound is not enough, whatever the direction.
        for _ in 0..10 {
            let shift = random.unit() * answer.lower * 0.999;
            let moved = pose_a.with_translation(pose_a.translation() + shift);
            let still = crate::measure::tests::cold(a, &moved, b, &pose_b);
            assert!(still.lower == 0.0, "{label}: {still:?}");
        }
        let swapped = cold(b, &pose_b, a, &pose_a);
        assert!(
            swapped.lower <= answer.upper * (1.0 + 1e-12) && answer.lower <= swapped.upper * (1.0 + 1e-12),
            "{label} swapped {swapped:?}"
        );
    }
    assert!(met > 60, "{met}");
}

#[test]
fn ties_are_flagged_and_limits_admitted() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let concentric = cold(&ball, &Pose::identity(), &ball, &Pose::identity());
    check(&concentric, 2.0, 1e-12, 1e-3, "concentric balls");
    assert!(concentric.tied, "{concentric:?}");
    // Nearly a ball: more directions than the table has, of which it drops those it needs no more.
    let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 1.0 + 1e-9)).unwrap();
    let concentric = cold(&egg, &Pose::identity(), &egg, &Pose::identity());
    check(&concentric, 2.0, 1e-3, 1.0, "nearly concentric balls");
    assert!(concentric.tied && concentric.directions > 4096, "{concentric:?}");
    let options = Options::default().with_depth_accuracy(1e-2).unwrap();
    let coarse = penetration(&egg, &Pose::identity(), &egg, &Pose::identity(), &options, &mut WarmStart::default());
    check(&coarse, 2.0, 1e-2, 1.0, "concentric");
    let cube = Body::cuboid("cube", Vector3::repeat(1.0)).unwrap();
    let slab = Body::cuboid("slab", Vector3::new(1.0, 2.0, 3.0)).unwrap();
    for (body, pose, depth, tied) in [
        (&cube, at(0.5, 0.5, 0.0), 1.5, true),
        (&cube, at(0.5, 0.1, 0.0), 1.5, false),
        (&slab, at(0.0, 0.0, 0.0), 2.0, true),
        (&slab, at(0.1, 0.0, 0.0), 1.9, false),
    ] {
        let answer = cold(body, &Pose::identity(), body, &pose);
        check(&answer, depth, 1e-3, 2.0, body.name());
        assert_eq!(answer.tied, tied, "{answer:?}");
    }
    for limit in 1..=3 {
        let options = Options::default().with_max_iterations(limit).unwrap();
        let answer =
            penetration(&cube, &Pose::identity(), &ball, &at(0.7, 0.3, 0.1), &options, &mut WarmStart::default());
        assert!(answer.lower <= 1.3 && 1.3 <= answer.upper * (1.0 + 1e-12), "{answer:?}");
        assert_eq!(
            answer.status == Status::Converged,
            answer.upper - answer.lower <= 1e-3 * answer.upper,
            "{answer:?}"
        );
    }
    let stop = std::sync::atomic::AtomicBool::new(true);
    let answer = penetration(
        &cube,
        &Pose::identity(),
        &ball,
        &at(0.7, 0.3, 0.1),
        &Options::default().with_stop(&stop),
        &mut WarmStart::default(),
    );
    assert!(answer.lower <= 1.3 && 1.3 <= answer.upper * (1.0 + 1e-12) && answer.iterations <= 2, "{answer:?}");
}
