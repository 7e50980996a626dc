//! Batches of a body and a capsule, against single queries.

use crate::{pose, smooth};
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use sublevel_core::body::{Body, Compound};
use sublevel_core::measure::{
    BatchError, Capsule, CapsuleDistance, Options, Pose, WarmStart, distance_to_capsule, distance_to_capsule_batch,
    distance_to_point,
};
use sublevel_testkit::Seeded;

/// A capsule, a ball, a segment or a point.
fn capsule(random: &mut Seeded, seed: usize) -> Capsule {
    let (radius, half) = (2_f64.powf(random.signed() - 1.0), 2_f64.powf(random.signed()));
    match seed % 4 {
        1 => Capsule::new(radius, 0.0).unwrap(),
        2 => Capsule::new(0.0, half).unwrap(),
        3 => Capsule::POINT,
        _ => Capsule::new(radius, half).unwrap(),
    }
}

fn batch(
    body: &Body,
    poses: &[Pose],
    capsule: &Capsule,
    capsule_poses: &[Pose],
    options: &Options<'_>,
) -> Vec<CapsuleDistance> {
    let mut answers = vec![CapsuleDistance::default(); poses.len().max(capsule_poses.len())];
    distance_to_capsule_batch(body, poses, capsule, capsule_poses, options, &mut answers).unwrap();
    answers
}

#[test]
fn answers_are_those_of_single_queries() {
    let options = Options::default();
    let (mut outside, mut inside) = (0, 0);
    for seed in 0..64 {
        let mut random = Seeded(seed as u64);
        let (body, capsule) = (smooth(&mut random, [2, 4, 6, 8][seed / 4 % 4]), capsule(&mut random, seed));
        // Some in contact, some far away; either side moves, or both.
        let mut many = |moves: bool| -> Vec<Pose> {
            let far = |i: usize| if i.is_multiple_of(8) { 1e3 } else { 0.3 + 0.1 * i as f64 };
            (0..if moves { 64 } else { 1 }).map(|i| pose(&mut random, far(i))).collect()
        };
        let (poses, capsule_poses) = (many(seed % 3 != 0), many(seed % 3 != 1));
        let of = |poses: &[Pose], i: usize| poses[if poses.len() == 1 { 0 } else { i }];
        for (i, answer) in batch(&body, &poses, &capsule, &capsule_poses, &options).iter().enumerate() {
            let (pose, capsule_pose) = (of(&poses, i), of(&capsule_poses, i));
            let single =
                distance_to_capsule(&body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default());
            let context = format!("seed {seed}, pose {i}: {answer:?} against {single:?}");
            assert_eq!(answer.status, single.status, "{context}");
            assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
            let local = pose.rotation().inverse() * (answer.witness - pose.translation());
            assert!(body.value(&local) <= 1.0 + 1e-9, "{context}");
            let Some(n) = answer.normal else {
                assert!(single.normal.is_none(), "{context}");
                inside += 1;
                continue;
            };
            outside += 1;
            let between = n.dot(&(answer.witness - answer.witness_of_capsule));
            assert!((between - answer.upper).abs() <= 1e-9 * (1.0 + answer.upper), "{context}");
            // Gradients are promised to 1e-6.
            assert!((n - single.normal.expect("apart")).norm() < 2e-6, "{context}");
        }
    }
    println!("{outside} axes outside, {inside} inside");
    assert!(outside > 3000 && inside > 100, "{outside} {inside}");
}

/// Every number of an answer, bit by bit.
fn bits(answer: &CapsuleDistance) -> Vec<u64> {
    let mut numbers = vec![answer.lower, answer.upper, f64::from(answer.iterations)];
    numbers.extend(answer.witness.iter().chain(answer.witness_of_capsule.iter()));
    numbers.extend(answer.normal.unwrap_or_default().iter());
    numbers.into_iter().map(f64::to_bits).collect()
}

#[test]
fn an_answer_does_not_depend_on_its_neighbours() {
    let options = Options::default();
    for seed in 0..16 {
        let mut random = Seeded(seed as u64);
        let (body, capsule) = (smooth(&mut random, [2, 4, 6, 8][seed / 4 % 4]), capsule(&mut random, seed));
        let here = [pose(&mut random, 1.0)];
        let poses: Vec<Pose> = (0..61).map(|_| pose(&mut random, 4.0)).collect();
        let solve = |poses: &[Pose]| -> Vec<Vec<u64>> {
            batch(&body, &here, &capsule, poses, &options).iter().map(bits).collect()
        };
        let answers = solve(&poses);
        for size in 1..=20 {
            for (chunk, known) in poses.chunks(size).zip(answers.chunks(size)) {
                assert_eq!(solve(chunk), known, "seed {seed}, size {size}");
            }
        }
        // Neighbours that overlap, that are far away, that are the same.
        for neighbour in [here[0], pose(&mut random, 1e6), poses[0]] {
            for i in 0..poses.len() {
                let mut others = vec![neighbour; 17];
                others[i % 17] = poses[i];
                assert_eq!(solve(&others)[i % 17], answers[i], "seed {seed}, pose {i}");
            }
        }
    }
}

/// One pose that stands for all is as many of the same, to the last bit.
#[test]
fn a_pose_that_stands_for_all_is_as_many_of_it() {
    let options = Options::default();
    for seed in 0..8 {
        let mut random = Seeded(50 + seed as u64);
        let (body, capsule) = (smooth(&mut random, [2, 4, 6, 8][seed / 4 % 4]), capsule(&mut random, seed));
        let here = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 4.0)).collect();
        let numbers = |found: Vec<CapsuleDistance>| found.iter().map(bits).collect::<Vec<_>>();
        let (one, all) = ([here], vec![here; 40]);
        assert_eq!(
            numbers(batch(&body, &one, &capsule, &poses, &options)),
            numbers(batch(&body, &all, &capsule, &poses, &options)),
            "seed {seed}"
        );
        assert_eq!(
            numbers(batch(&body, &poses, &capsule, &one, &options)),
            numbers(batch(&body, &poses, &capsule, &all, &options)),
            "seed {seed}"
        );
    }
}

/// Powers of two change no bit, whatever the unit; along the axes as well, above flat tips.
#[test]
fn units_change_nothing() {
    let options = Options::default();
    for degree in [2, 4, 6, 8] {
        for (radius, half_height) in [(0.2, 0.5), (0.3, 0.0), (0.0, 0.4)] {
            let solved = |unit: f64| {
                let half = Vector3::new(0.7, 0.5, 0.4) * unit;
                let egg = if degree == 2 {
                    Body::ellipsoid("egg", Vector3::zeros(), half).unwrap()
                } else {
                    Body::superellipsoid("q", Vector3::zeros(), half, degree).unwrap()
                };
                let capsule = Capsule::new(radius * unit, half_height * unit).unwrap();
                let mut random = Seeded(11);
                let mut poses: Vec<Pose> = (0..100)
                    .map(|_| {
                        let near = pose(&mut random, 2.5);
                        Pose::from_quaternion(near.translation() * unit, near.rotation().coords.into()).unwrap()
                    })
                    .collect();
                for axis in 0..6 {
                    let way = Vector3::ith(axis % 3, if axis < 3 { 2.0 } else { -2.0 });
                    poses.push(Pose::from_quaternion(way * unit, [0.0, 0.0, 0.0, 1.0]).unwrap());
                }
                let numbers = |answer: &CapsuleDistance| {
                    let lengths = [answer.lower, answer.upper].into_iter();
                    let places = answer.witness.iter().chain(answer.witness_of_capsule.iter()).copied();
                    let lengths = lengths.chain(places).map(|length| (length / unit).to_bits());
                    lengths.chain([u64::from(answer.iterations)]).collect()
                };
                let answers = batch(&egg, &poses, &capsule, &[Pose::identity()], &options);
                answers.iter().map(numbers).collect::<Vec<Vec<u64>>>()
            };
            let metres = solved(1.0);
            for exponent in [-30, -20, -10, 10, 20, 30] {
                let found = solved(2_f64.powi(exponent));
                for (i, (found, metres)) in found.iter().zip(&metres).enumerate() {
                    assert_eq!(found, metres, "degree {degree}, radius {radius}, unit 2^{exponent}, pose {i}");
                }
            }
        }
    }
}

/// Beside the axis of the capsule, beyond its ends, and straight above them, in units from
/// micrometres to kilometres.
#[test]
fn balls_beside_capsules_have_their_closed_form() {
    for unit in [1e-6, 1e-3, 1.0, 1e3] {
        let mut random = Seeded(7);
        let (ball_radius, radius, half) = (0.2 * unit, 0.1 * unit, 0.5 * unit);
        let ball = Body::ball("ball", Vector3::zeros(), ball_radius).unwrap();
        let capsule = Capsule::new(radius, half).unwrap();
        let mut points: Vec<Vector3<f64>> =
            (0..200).map(|_| Vector3::from_fn(|_, _| 2.0 * unit * random.signed())).collect();
        for axis in 0..3 {
            points.push(Vector3::ith(axis, 1.5 * unit));
            points.push(Vector3::ith(axis, -1.5 * unit));
        }
        let poses: Vec<Pose> =
            points.iter().map(|x| Pose::from_quaternion(*x, random.rotation().coords.into()).unwrap()).collect();
        let answers = batch(&ball, &poses, &capsule, &[Pose::identity()], &Options::default());
        for (x, answer) in points.iter().zip(answers) {
            let truth = x.xy().norm().hypot((x.z.abs() - half).max(0.0)) - ball_radius - radius;
            let slack = 1e-15 * unit;
            assert!(answer.lower <= truth + slack && truth <= answer.upper + slack, "{x}: {truth} {answer:?}");
            assert!(answer.upper - answer.lower <= 1e-9 * unit, "{x}: {answer:?}");
        }
    }
}

#[test]
fn points_are_capsules_without_sizes() {
    for seed in 0..12 {
        let mut random = Seeded(70 + seed as u64);
        let body = smooth(&mut random, [2, 4, 6, 8][seed % 4]);
        let here = pose(&mut random, 1.0);
        let places: Vec<Pose> = (0..100).map(|_| pose(&mut random, 4.0)).collect();
        let options = Options::default();
        for (place, answer) in places.iter().zip(batch(&body, &[here], &Capsule::POINT, &places, &options)) {
            let single = distance_to_point(&body, &here, place.translation(), &options, &mut WarmStart::default());
            let single = single.expect("a point");
            if single.lower > 0.0 {
                assert!(answer.lower <= single.upper && single.lower <= answer.upper, "seed {seed}: {answer:?}");
                assert!((answer.witness - single.witness).norm() < 1e-6, "seed {seed}: {answer:?} {single:?}");
            } else {
                assert!(answer.lower <= 0.0, "seed {seed}: {answer:?}");
            }
        }
    }
}

/// Boxes that are turned in their frames and compounds are solved one by one.
#[test]
fn others_are_answered_too() {
    let mut random = Seeded(9);
    let options = Options::default();
    let crate_ = Body::cuboid("crate", Vector3::new(0.4, 0.5, 0.6)).unwrap();
    let far = Body::ball("ball", Vector3::new(2.0, 0.0, 0.0), 0.5).unwrap();
    let both = Compound::new("both", vec![crate_.clone(), far]).unwrap();
    let capsule = Capsule::new(0.1, 0.3).unwrap();
    let poses: Vec<Pose> = (0..20).map(|_| pose(&mut random, 3.0)).collect();
    let here = pose(&mut random, 1.0);
    let mut answers = [CapsuleDistance::default(); 20];
    distance_to_capsule_batch(&both, &poses, &capsule, &[here], &options, &mut answers).unwrap();
    for (pose, answer) in poses.iter().zip(&answers) {
        let single = distance_to_capsule(&both, pose, &capsule, &here, &options, &mut WarmStart::default());
        assert_eq!(bits(answer), bits(&single));
    }
    let turned = crate_.moved(pose(&mut random, 0.0).rotation(), &Vector3::zeros()).unwrap();
    for (pose, answer) in poses.iter().zip(batch(&turned, &poses, &capsule, &[here], &options)) {
        let single = distance_to_capsule(&turned, pose, &capsule, &here, &options, &mut WarmStart::default());
        assert_eq!(bits(&answer), bits(&single));
    }
}

#[test]
fn limits_and_stops_leave_true_brackets() {
    let mut random = Seeded(8);
    let stop = AtomicBool::new(true);
    for seed in 0..4 {
        let (body, capsule) = (smooth(&mut random, [2, 4, 6, 8][seed]), capsule(&mut random, seed));
        let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 4.0)).collect();
        let here = Pose::identity();
        let few = [1, 8, 9, 15, 16].map(|most| Options::default().with_max_iterations(most).unwrap());
        for (most, options) in few.into_iter().map(Some).chain([None]).enumerate() {
            let options = options.unwrap_or_else(|| Options::default().with_stop(&stop));
            for (answer, pose) in batch(&body, &poses, &capsule, &[here], &options).iter().zip(&poses) {
                let ask = (Options::default(), &mut WarmStart::default());
                let truth = distance_to_capsule(&body, pose, &capsule, &here, &ask.0, ask.1);
                assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
                if let Some(limit) = [1, 8, 9, 15, 16].get(most) {
                    assert!(answer.iterations <= *limit, "at most {limit}: {answer:?}");
                }
            }
        }
    }
}

#[test]
fn what_does_not_fit_together_is_refused() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let capsule = Capsule::new(0.1, 0.3).unwrap();
    let mut answers = [CapsuleDistance::default(); 3];
    let poses = [Pose::identity(); 3];
    let mut ask = |of_solid: usize, of_capsule: usize, places: usize| {
        let (solid, other) = (&poses[..of_solid], &poses[..of_capsule]);
        distance_to_capsule_batch(&ball, solid, &capsule, other, &Options::default(), &mut answers[..places])
    };
    assert_eq!(ask(0, 1, 1), Err(BatchError::Empty));
    assert_eq!(ask(3, 0, 3), Err(BatchError::Empty));
    assert_eq!(ask(3, 2, 3), Err(BatchError::Sides { solid: 3, capsule: 2 }));
    assert_eq!(ask(3, 1, 2), Err(BatchError::Lengths { poses: 3, answers: 2 }));
    assert_eq!(ask(1, 3, 1), Err(BatchError::Lengths { poses: 3, answers: 1 }));
    assert_eq!(ask(1, 1, 1), Ok(()));
    assert_eq!(ask(3, 3, 3), Ok(()));
}
