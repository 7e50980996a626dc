//! Batches of a ball beside a box, a cylinder or another ball, against single queries and, of two
//! balls, their formula.

use crate::pose;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{Distance, Options, Pose, WarmStart, distance, distance_batch, is_solved_in_lanes};
use sublevel_testkit::Seeded;

/// A ball and another shape off the origins of their frames, either first.
fn pair(random: &mut Seeded, seed: usize) -> [Body; 2] {
    let mut size = || 2_f64.powf(random.signed());
    let ball = Body::ball("ball", Vector3::new(size(), -size(), 0.1), size()).unwrap();
    let shape = match seed % 3 {
        0 => Body::cuboid("box", Vector3::new(size(), size(), size())).unwrap(),
        1 => Body::cylinder("rod", size(), size()).unwrap(),
        _ => Body::ball("other", Vector3::zeros(), size()).unwrap(),
    };
    let shift = Vector3::from_fn(|_, _| 0.7 * random.signed());
    let shape = shape.moved(&UnitQuaternion::identity(), &shift).unwrap();
    if (seed / 3).is_multiple_of(2) { [ball, shape] } else { [shape, ball] }
}

fn batch(a: &Body, pose_a: &Pose, b: &Body, poses: &[Pose]) -> Vec<Distance> {
    let mut answers = vec![Distance::default(); poses.len()];
    distance_batch(a, pose_a, b, poses, &Options::default(), &mut answers).unwrap();
    answers
}

fn single(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> Distance {
    distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
}

fn check(answer: &Distance, single: &Distance, of: [(&Body, &Pose); 2], context: &str) {
    let context = format!("{context}: {answer:?} against {single:?}");
    assert_eq!(answer.status, single.status, "{context}");
    assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
    let between = (answer.witness_a - answer.witness_b).norm();
    let size = 1.0 + answer.upper + of.iter().map(|(_, pose)| pose.translation().norm()).sum::<f64>();
    assert!((between - answer.upper).abs() <= 1e-13 * size, "{context}");
    for ((body, pose), witness) in of.into_iter().zip([answer.witness_a, answer.witness_b]) {
        let own = pose.rotation().inverse() * (witness - pose.translation());
        assert!(body.value(&own) <= 1.0 + 1e-12 * size, "{context}");
    }
    assert_eq!(answer.normal.is_some(), single.normal.is_some(), "{context}");
    let (Some(n), Some(m)) = (answer.normal, single.normal) else { return };
    // Near contact the way between two balls is known no better than their places.
    assert!((n - m).norm() < 1e-6, "{context}");
    for (ours, theirs) in [(&answer.active_a, &single.active_a), (&answer.active_b, &single.active_b)] {
        let (ours, theirs): (Vec<_>, Vec<_>) = (ours.iter().collect(), theirs.iter().collect());
        assert_eq!(ours.len(), theirs.len(), "{context}");
        for ((i, of_batch), (j, of_single)) in ours.into_iter().zip(theirs) {
            assert!(i == j && (of_batch - of_single).abs() <= 1e-6 * (1.0 + of_single), "{context}");
        }
    }
}

/// Near and far, apart and in contact, and far from the origin of the world.
#[test]
fn balls_are_as_far_as_single_queries_say() {
    for seed in 0..96 {
        let mut random = Seeded(seed as u64);
        let [a, b] = pair(&mut random, seed);
        assert!(is_solved_in_lanes(&a, &b), "seed {seed}");
        let origin = if seed % 5 == 4 { Vector3::new(1e6, -2e6, 5e5) } else { Vector3::zeros() };
        let mut there = |far: f64| {
            let near = pose(&mut random, far);
            near.with_translation(origin + near.translation())
        };
        let pose_a = there(2.0);
        let far = |i: usize| if i.is_multiple_of(8) { 1e3 } else { 1.0 + 0.1 * i as f64 };
        let poses: Vec<Pose> = (0..61).map(|i| there(far(i))).collect();
        for (i, (answer, pose_b)) in batch(&a, &pose_a, &b, &poses).iter().zip(&poses).enumerate() {
            let truth = single(&a, &pose_a, &b, pose_b);
            check(answer, &truth, [(&a, &pose_a), (&b, pose_b)], &format!("seed {seed}, pose {i}"));
        }
    }
}

/// At gaps from 1 to 1e-12 on either side of contact.
#[test]
fn near_contact_balls_are_as_far_as_single_queries_say() {
    for seed in 0..48 {
        let mut random = Seeded(500 + seed as u64);
        let [a, b] = pair(&mut random, seed);
        let pose_a = pose(&mut random, 1.0);
        let start = pose(&mut random, 0.0);
        let away = start.with_translation(pose_a.translation() + random.unit() * 9.0);
        let found = single(&a, &pose_a, &b, &away);
        let n = found.normal.expect("they are apart");
        let gaps = [1.0, 1e-3, 1e-6, 1e-9, 1e-12, 0.0, -1e-12, -1e-9, -1e-6, -1e-2];
        let poses: Vec<Pose> =
            gaps.iter().map(|gap| away.with_translation(away.translation() + n * (found.upper - gap))).collect();
        for ((answer, pose_b), gap) in batch(&a, &pose_a, &b, &poses).iter().zip(&poses).zip(gaps) {
            let truth = single(&a, &pose_a, &b, pose_b);
            let context = format!("seed {seed}, gap {gap}: {answer:?} against {truth:?}");
            assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{context}");
            // What the first distance may be less than its upper bound the gap may be, too.
            let least = gap - (found.upper - found.lower);
            assert!(answer.lower <= gap.max(0.0) + 2e-14 && least.max(0.0) - 2e-14 <= answer.upper, "{context}");
            assert_eq!(answer.status, truth.status, "{context}");
        }
    }
}

#[test]
fn two_balls_have_their_formula() {
    for seed in 0..60 {
        let mut random = Seeded(900 + seed);
        let mut ball = || {
            let center = Vector3::from_fn(|_, _| random.signed());
            Body::ball("ball", center, 10_f64.powf(2.0 * random.signed())).unwrap()
        };
        let (a, b) = (ball(), ball());
        let radii = a.circumscribed().radius + b.circumscribed().radius;
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..33).map(|_| pose(&mut random, 2.0 * (1.0 + radii))).collect();
        let [of_a, of_b] = [&a, &b].map(|ball| ball.closed_form().expect("a ball"));
        for (answer, pose_b) in batch(&a, &pose_a, &b, &poses).iter().zip(&poses) {
            let centers = pose_a.transform_point(of_a.center()) - pose_b.transform_point(of_b.center());
            let inner = |ball: &Body| 1.0 / ball.normalization().linear[(0, 0)];
            let truth = (centers.norm() - inner(&a) - inner(&b)).max(0.0);
            let slack = 1e-13 * (1.0 + radii);
            let context = format!("seed {seed}: {answer:?} against {truth}");
            assert!(answer.lower <= truth + slack && truth - slack <= answer.upper, "{context}");
            assert!(answer.upper - answer.lower <= 1e-9 * radii, "{context}");
        }
    }
}

/// Every number of an answer, bit by bit.
fn bits(answer: &Distance) -> Vec<u64> {
    let mut numbers = vec![answer.lower, answer.upper, f64::from(answer.iterations)];
    numbers.extend(answer.witness_a.iter().chain(answer.witness_b.iter()));
    numbers.extend(answer.normal.unwrap_or_default().iter());
    numbers.extend([answer.active_a, answer.active_b].iter().flat_map(|active| active.iter().map(|(_, m)| m)));
    numbers.into_iter().map(f64::to_bits).collect()
}

#[test]
fn an_answer_does_not_depend_on_its_neighbours() {
    for seed in 0..12 {
        let mut random = Seeded(seed as u64);
        let [a, b] = pair(&mut random, seed);
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..61).map(|_| pose(&mut random, 4.0)).collect();
        let solve = |poses: &[Pose]| batch(&a, &pose_a, &b, poses).iter().map(bits).collect::<Vec<_>>();
        let answers = solve(&poses);
        for size in 1..=20 {
            for (chunk, known) in poses.chunks(size).zip(answers.chunks(size)) {
                assert_eq!(solve(chunk), known, "seed {seed}, size {size}");
            }
        }
        // Neighbours that overlap, that are far away, that are the same.
        for neighbour in [pose_a, pose(&mut random, 1e6), poses[0]] {
            for i in 0..poses.len() {
                let mut others = vec![neighbour; 17];
                others[i % 17] = poses[i];
                assert_eq!(solve(&others)[i % 17], answers[i], "seed {seed}, pose {i}");
            }
        }
    }
}
