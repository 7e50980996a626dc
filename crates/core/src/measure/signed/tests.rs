//! Signed distances against closed forms, differences, and themselves through contact.

use super::*;
use crate::body::Body;
use crate::measure::tests::{at, random_pose, twisted, zoo};
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

fn cold(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> SignedDistance {
    signed_distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
}

#[test]
fn ball_pairs_on_both_sides() {
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let scale = 10_f64.powi((seed % 5) as i32 * 4 - 8);
        let (ra, rb) = (scale, scale * 10_f64.powf(2.0 * random.signed()));
        let (small, large) = (ra.min(rb), ra.max(rb));
        let (a, b) = (Body::ball("a", Vector3::zeros(), ra).unwrap(), Body::ball("b", Vector3::zeros(), rb).unwrap());
        let gaps = [-1.0, -0.1, -1e-3, -1e-6, -1e-9, -1e-12, 0.0, 1e-12, 1e-9, 1e-6, 1e-3, 1.0, 30.0];
        let truth = gaps[(seed % 13) as usize] * small;
        let pose_a = random_pose(&mut random, 3.0 * scale);
        let direction = random.unit();
        let moved = pose_a.translation() + direction * (ra + rb + truth);
        let pose_b = Pose::from_quaternion(moved, [0.5, 0.5, 0.5, 0.5]).unwrap();
        let answer = cold(&a, &pose_a, &b, &pose_b);
        let label = format!("seed {seed}, gap {truth:e}, radii {ra:e} {rb:e}: {answer:?}");
        let floor = 1e-14 * (large + 30.0 * small);
        assert_eq!(answer.status, Status::Converged, "{label}");
        assert!(answer.lower <= truth + floor && truth - floor <= answer.upper, "{label}");
        assert!((answer.value() - truth).abs() <= 2e-9 * small + 1e-13 * large, "{label}");
        assert!((answer.normal.unwrap() + direction).norm() < 1e-3, "{label}");
        assert_eq!(answer.at_contact, answer.lower <= 0.0 && answer.upper >= 0.0, "{label}");
        if truth.abs() > 1e-8 * large {
            assert!(!answer.at_contact, "{label}");
        }
    }
}

#[test]
fn slides_from_touching_to_concentric_are_continuous_and_monotone() {
    for seed in 0..24 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (i, j) = (random.next() as usize % 7, random.next() as usize % 7);
        let (a, b) = (&bodies[i], &bodies[j]);
        let s = a.circumscribed().radius.max(b.circumscribed().radius);
        let small = a.circumscribed().radius.min(b.circumscribed().radius);
        let turn = random_pose(&mut random, 0.0);
        let (ca, cb) = (*a.interior_point(), turn.transform_point(b.interior_point()));
        let direction = random.unit();
        let start = 1.2 * (a.circumscribed().radius + b.circumscribed().radius);
        let mut warm = WarmStart::default();
        let mut last: Option<(f64, SignedDistance)> = None;
        let steps = 60;
        for k in 0..=steps {
            let offset = start * f64::from(steps - k) / f64::from(steps);
            let pose = turn.with_translation(ca - cb + direction * offset);
            let answer = signed_distance(a, &Pose::identity(), b, &pose, &Options::default(), &mut warm);
            let label = format!("seed {seed} {}-{} offset {offset}: {answer:?}", a.name(), b.name());
            assert_eq!(answer.status, Status::Converged, "{label}");
            let one = cold(a, &Pose::identity(), b, &pose);
            assert!(one.lower <= answer.upper && answer.lower <= one.upper, "{label} cold {one:?}");
            if let Some((before, previous)) = last {
                // It changes by at most what was moved; and for bodies about their centres the way
                // in only decreases.
                let moved = before - offset;
                assert!(answer.lower <= previous.upper + moved + 1e-9 * s, "{label} after {previous:?}");
                assert!(answer.upper >= previous.lower - moved - 1e-9 * s, "{label} after {previous:?}");
                let symmetric =
                    [a, b].iter().all(|body| body.growth_ball().center.norm() < 1e-9 * small) || i == 0 && j == 0;
                if symmetric && !answer.tied {
                    assert!(answer.lower <= previous.upper + 2e-9 * s, "{label} rises after {previous:?}");
                }
            }
            last = Some((offset, answer));
        }
        let deepest = last.unwrap().1;
        assert!(deepest.upper < 0.0, "{deepest:?}");
    }
}

#[test]
fn gradients_are_the_derivatives_on_both_sides() {
    let options = Options::default().with_accuracy(1e-13).unwrap();
    let (mut apart, mut inside) = (0, 0);
    for seed in 0..24 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (i, j) = ((random.next() % 5) as usize, (random.next() % 5) as usize);
        let (a, b) = (&bodies[i], &bodies[j]);
        let reach = a.circumscribed().radius + b.circumscribed().radius;
        let far = reach * [0.2, 0.45, 0.6, 1.2][(seed % 4) as usize];
        let poses = [random_pose(&mut random, 0.1 * reach), random_pose(&mut random, far)];
        let mut warm = WarmStart::default();
        let answer = signed_distance(a, &poses[0], b, &poses[1], &options, &mut warm);
        if answer.tied || answer.at_contact {
            continue;
        }
        let value = |poses: &[Pose; 2]| {
            let answer = signed_distance(a, &poses[0], b, &poses[1], &options, &mut warm.clone());
            (!answer.tied).then(|| answer.value())
        };
        let gradients = answer.gradients.unwrap();
        for (which, gradient) in gradients.iter().enumerate() {
            for component in 0..6 {
                let axis = Vector3::from_fn(|i, _| f64::from(u8::from(i == component % 3)));
                let moved = |h: f64| {
                    let mut poses = poses;
                    poses[which] = twisted(&poses[which], &axis, component >= 3, h);
                    value(&poses)
                };
                let central = |h: f64| Some((moved(h)? - moved(-h)?) / (2.0 * h));
                let h = if component < 3 { 2e-3 * reach } else { 2e-3 };
                let (Some(d1), Some(d2), Some(d3)) = (central(h), central(0.5 * h), central(0.25 * h)) else {
                    continue;
                };
                let (e1, e2) = ((4.0 * d2 - d1) / 3.0, (4.0 * d3 - d2) / 3.0);
                let difference = (16.0 * e2 - e1) / 15.0;
                let unit = if component < 3 { 1.0 } else { 1.0 / reach };
                let exact = if component < 3 { gradient.linear } else { gradient.angular }.dot(&axis);
                if (e1 - e2).abs() * unit < 1e-7 {
                    if answer.upper < 0.0 {
                        inside += 1;
                    } else {
                        apart += 1;
                    }
                    let error = (difference - exact).abs() * unit;
                    let label = format!("seed {seed} {}-{} body {which} component {component}", a.name(), b.name());
                    assert!(error < 1e-6, "{label}: {difference} against {exact}, {answer:?}");
                }
            }
        }
    }
    assert!(apart > 60 && inside > 40, "{apart} {inside}");
}

#[test]
fn one_normal_and_one_slope_through_contact() {
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (i, j) = (random.next() as usize % 7, random.next() as usize % 7);
        let (a, b) = (&bodies[i], &bodies[j]);
        let small = a.circumscribed().radius.min(b.circumscribed().radius);
        let far = 1.5 * (a.circumscribed().radius + b.circumscribed().radius);
        let pose = random_pose(&mut random, far);
        let first = cold(a, &Pose::identity(), b, &pose);
        let (n, gap) = (first.normal.unwrap(), first.value());
        let mut warm = WarmStart::default();
        for level in [1e-2, 1e-3, 1e-5, 1e-7, 0.0, -1e-7, -1e-5, -1e-3, -1e-2] {
            // Moving B along the normal brings it nearer by exactly as much, as long as no other
            // way is shorter.
            let moved = pose.with_translation(pose.translation() + n * (gap - level * small));
            let answer = signed_distance(a, &Pose::identity(), b, &moved, &Options::default(), &mut warm);
            let label = format!("seed {seed} {}-{} level {level:e}: {answer:?}", a.name(), b.name());
            let truth = level * small;
            // In overlap as shallow as 1e-7, where edges touch, hardly any direction is worse than
            // the best.
            let smooth = i < 5 && j < 5;
            assert!(answer.status == Status::Converged || level < 0.0 && level > -1e-4 && !smooth, "{label}");
            let floor = 3e-9 * small + 1e-13 * far;
            let apart = (answer.witness_a - answer.witness_b).norm();
            assert!(answer.upper < 0.0 || (apart - answer.upper).abs() <= floor, "{label}");
            assert!(answer.upper >= truth - floor, "{label}");
            // In overlap another direction may be shorter for bodies with edges.
            if level >= 0.0 || smooth {
                assert!((answer.value() - truth).abs() <= floor, "{label}");
            }
            // Where corners just touch, normals are anything.
            if level > 1e-6 || smooth {
                // A bracket of 1e-9 leaves normals of bodies with edges about its root.
                assert!((answer.normal.unwrap() - n).norm() < 3e-3, "{label} after normal {n}");
            }
        }
    }
}

#[test]
fn limits_are_admitted_and_orders_agree() {
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let bodies = zoo(&mut random);
        let (a, b) = (&bodies[(seed % 9) as usize], &bodies[(seed / 7 % 9) as usize]);
        let pose = random_pose(&mut random, 1.0);
        let truth = cold(a, &Pose::identity(), b, &pose);
        let swapped = cold(b, &pose, a, &Pose::identity());
        let label = format!("seed {seed} {}-{}: {truth:?}", a.name(), b.name());
        let floor = 1e-12 * truth.lower.abs();
        assert!(
            swapped.lower <= truth.upper + floor && truth.lower <= swapped.upper + floor,
            "{label} swapped {swapped:?}"
        );
        for limit in 1..=3 {
            let options = Options::default().with_max_iterations(limit).unwrap();
            let answer = signed_distance(a, &Pose::identity(), b, &pose, &options, &mut WarmStart::default());
            assert!(
                answer.lower <= truth.upper + floor && truth.lower <= answer.upper + floor,
                "{label} limit {limit} {answer:?}"
            );
        }
    }
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let concentric = cold(&ball, &Pose::identity(), &ball, &Pose::identity());
    assert!(concentric.tied && concentric.lower <= -2.0 && concentric.upper >= -2.0, "{concentric:?}");
    let apart = cold(&ball, &Pose::identity(), &ball, &at(5.0, 0.0, 0.0));
    assert!(!apart.tied && (apart.value() - 3.0).abs() < 1e-8, "{apart:?}");
}
