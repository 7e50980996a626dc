//! Batches of a smooth body beside a box or a cylinder, against single queries.

use crate::{pose, smooth};
use nalgebra::{UnitQuaternion, Vector3};
use std::sync::atomic::AtomicBool;
use sublevel_core::body::Body;
use sublevel_core::measure::{Distance, Options, Pose, WarmStart, distance, distance_batch};
use sublevel_testkit::Seeded;

/// A box or a rod off the origin of its frame.
fn shape(random: &mut Seeded, kind: usize) -> Body {
    let mut size = || 2_f64.powf(random.signed());
    let shape = if kind == 0 {
        Body::cuboid("box", Vector3::new(size(), size(), size())).unwrap()
    } else {
        Body::cylinder("rod", size(), size()).unwrap()
    };
    let shift = Vector3::from_fn(|_, _| 0.7 * random.signed());
    shape.moved(&UnitQuaternion::identity(), &shift).unwrap()
}

/// A smooth body and a shape, either first.
fn pair(random: &mut Seeded, seed: usize) -> [Body; 2] {
    let bodies = [smooth(random, [2, 4, 6, 8][seed / 4 % 4]), shape(random, seed % 2)];
    let [a, b] = bodies;
    if (seed / 2).is_multiple_of(2) { [a, b] } else { [b, a] }
}

fn batch(a: &Body, pose_a: &Pose, b: &Body, poses: &[Pose], options: &Options<'_>) -> Vec<Distance> {
    let mut answers = vec![Distance::default(); poses.len()];
    distance_batch(a, pose_a, b, poses, options, &mut answers).unwrap();
    answers
}

#[test]
fn answers_are_those_of_single_queries() {
    let options = Options::default();
    for seed in 0..64 {
        let mut random = Seeded(seed as u64);
        let [a, b] = pair(&mut random, seed);
        let pose_a = pose(&mut random, 2.0);
        // Some in contact, some far away.
        let far = |i: usize| if i.is_multiple_of(8) { 1e3 } else { 2.0 + 0.1 * i as f64 };
        let poses: Vec<Pose> = (0..64).map(|i| pose(&mut random, far(i))).collect();
        for (i, (answer, pose_b)) in batch(&a, &pose_a, &b, &poses, &options).iter().zip(&poses).enumerate() {
            let single = distance(&a, &pose_a, &b, pose_b, &options, &mut WarmStart::default());
            let context = format!("seed {seed}, pose {i}: {answer:?} against {single:?}");
            assert_eq!(answer.status, single.status, "{context}");
            assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
            let between = (answer.witness_a - answer.witness_b).norm();
            assert!((between - answer.upper).abs() <= 1e-9 * (1.0 + answer.upper), "{context}");
            let inverse = |pose: &Pose, x: &Vector3<f64>| pose.rotation().inverse() * (x - pose.translation());
            assert!(a.value(&inverse(&pose_a, &answer.witness_a)) <= 1.0 + 1e-9, "{context}");
            assert!(b.value(&inverse(pose_b, &answer.witness_b)) <= 1.0 + 1e-9, "{context}");
            if let (Some(n), Some(m)) = (answer.normal, single.normal) {
                // Gradients are promised to 1e-6.
                assert!((n - m).norm() < 2e-6, "{context}");
                for (ours, theirs) in [(&answer.active_a, &single.active_a), (&answer.active_b, &single.active_b)] {
                    let (ours, theirs): (Vec<_>, Vec<_>) = (ours.iter().collect(), theirs.iter().collect());
                    assert_eq!(ours.len(), theirs.len(), "{context}");
                    for ((i, of_batch), (j, of_single)) in ours.into_iter().zip(theirs) {
                        let fine = i == j && (of_batch - of_single).abs() <= 1e-3 * of_single.abs() + 1e-5;
                        assert!(fine, "{context}");
                    }
                }
            }
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
    let options = Options::default();
    for seed in 0..16 {
        let mut random = Seeded(seed as u64);
        let [a, b] = pair(&mut random, seed);
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..61).map(|_| pose(&mut random, 4.0)).collect();
        let solve = |poses: &[Pose]| batch(&a, &pose_a, &b, poses, &options).iter().map(bits).collect::<Vec<_>>();
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

/// Far from the origin of the world brackets are as wide as what the coordinates lose.
#[test]
fn far_from_the_origin_answers_are_those_of_single_queries() {
    let options = Options::default();
    for seed in 0..16 {
        let mut random = Seeded(100 + seed as u64);
        let [a, b] = pair(&mut random, seed);
        let far = Vector3::new(1e6, -2e6, 5e5);
        let mut there = |reach: f64| {
            let near = pose(&mut random, reach);
            Pose::from_quaternion(far + near.translation(), near.rotation().coords.into()).unwrap()
        };
        let pose_a = there(1.0);
        let poses: Vec<Pose> = (0..40).map(|_| there(5.0)).collect();
        for (answer, pose_b) in batch(&a, &pose_a, &b, &poses, &options).iter().zip(&poses) {
            let single = distance(&a, &pose_a, &b, pose_b, &options, &mut WarmStart::default());
            assert_eq!(answer.status, single.status, "seed {seed}: {answer:?} against {single:?}");
            assert!(answer.lower <= single.upper && single.lower <= answer.upper, "seed {seed}: {answer:?} {single:?}");
            assert!((answer.witness_a - single.witness_a).norm() < 1e-4, "seed {seed}: {answer:?} {single:?}");
        }
    }
}

/// Powers of two change no bit, whatever the unit; along the axes as well, above flat tips.
#[test]
fn units_change_nothing() {
    let options = Options::default();
    for degree in [2, 4, 6, 8] {
        for kind in 0..2 {
            let solved = |unit: f64| {
                let half = Vector3::new(0.7, 0.5, 0.4) * unit;
                let egg = if degree == 2 {
                    Body::ellipsoid("egg", Vector3::zeros(), half).unwrap()
                } else {
                    Body::superellipsoid("q", Vector3::zeros(), half, degree).unwrap()
                };
                let other = if kind == 0 {
                    Body::cuboid("box", Vector3::new(0.5, 0.4, 0.6) * unit).unwrap()
                } else {
                    Body::cylinder("rod", 0.4 * unit, 0.6 * unit).unwrap()
                };
                let mut random = Seeded(11);
                let mut poses: Vec<Pose> = (0..100)
                    .map(|_| {
                        let near = pose(&mut random, 2.5);
                        let place = near.translation() * unit;
                        Pose::from_quaternion(place, near.rotation().coords.into()).unwrap()
                    })
                    .collect();
                for axis in 0..6 {
                    let way = Vector3::ith(axis % 3, if axis < 3 { 2.0 } else { -2.0 });
                    poses.push(Pose::from_quaternion(way * unit, [0.0, 0.0, 0.0, 1.0]).unwrap());
                }
                let answers = batch(&other, &Pose::identity(), &egg, &poses, &options);
                let numbers = |answer: &Distance| {
                    let lengths = [answer.lower, answer.upper].into_iter();
                    let lengths = lengths.chain(answer.witness_a.iter().chain(answer.witness_b.iter()).copied());
                    lengths.map(|length| (length / unit).to_bits()).chain([u64::from(answer.iterations)]).collect()
                };
                answers.iter().map(numbers).collect::<Vec<Vec<u64>>>()
            };
            let metres = solved(1.0);
            for exponent in [-30, -20, -10, 10, 20, 30] {
                let found = solved(2_f64.powi(exponent));
                for (i, (found, metres)) in found.iter().zip(&metres).enumerate() {
                    assert_eq!(found, metres, "degree {degree}, kind {kind}, unit 2^{exponent}, pose {i}");
                }
            }
        }
    }
}

/// Distance of a point, metres.
type Truth<'a> = &'a dyn Fn(&Vector3<f64>) -> f64;

/// Poses whose nearest points are on faces, edges and corners, and straight above them, in units
/// from micrometres to kilometres.
#[test]
fn balls_beside_shapes_have_their_closed_forms() {
    for unit in [1e-6, 1e-3, 1.0, 1e3] {
        let mut random = Seeded(7);
        let half = Vector3::new(0.5, 0.4, 0.3) * unit;
        let (cuboid, rod) =
            (Body::cuboid("box", half).unwrap(), Body::cylinder("rod", 0.4 * unit, 0.6 * unit).unwrap());
        let radius = 0.2 * unit;
        let ball = Body::ball("ball", Vector3::zeros(), radius).unwrap();
        let mut points: Vec<Vector3<f64>> =
            (0..200).map(|_| Vector3::from_fn(|_, _| 2.0 * unit * random.signed())).collect();
        for axis in 0..3 {
            points.push(Vector3::ith(axis, 1.5 * unit));
            points.push(Vector3::ith(axis, -1.5 * unit));
        }
        let poses: Vec<Pose> =
            points.iter().map(|x| Pose::from_quaternion(*x, random.rotation().coords.into()).unwrap()).collect();
        let of_box = |x: &Vector3<f64>| (x.abs() - half).sup(&Vector3::zeros()).norm();
        let of_rod = |x: &Vector3<f64>| {
            let (beside, above) = ((x.xy().norm() - 0.4 * unit).max(0.0), (x.z.abs() - 0.6 * unit).max(0.0));
            beside.hypot(above)
        };
        let truths: [Truth<'_>; 2] = [&of_box, &of_rod];
        for (shape, truth) in [&cuboid, &rod].into_iter().zip(truths) {
            let options = Options::default();
            for (x, answer) in points.iter().zip(batch(shape, &Pose::identity(), &ball, &poses, &options)) {
                let truth = (truth(x) - radius).max(0.0);
                let slack = 1e-15 * unit;
                assert!(answer.lower <= truth + slack && truth <= answer.upper + slack, "{x}: {truth} {answer:?}");
                assert!(answer.upper - answer.lower <= 1e-9 * unit, "{x}: {answer:?}");
            }
        }
    }
}

#[test]
fn limits_and_stops_leave_true_brackets() {
    let mut random = Seeded(8);
    let stop = AtomicBool::new(true);
    for seed in 0..4 {
        let [a, b] = pair(&mut random, seed);
        let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 4.0)).collect();
        let here = Pose::identity();
        let few = [1, 8, 9, 15, 16].map(|most| Options::default().with_max_iterations(most).unwrap());
        for (most, options) in few.into_iter().map(Some).chain([None]).enumerate() {
            let options = options.unwrap_or_else(|| Options::default().with_stop(&stop));
            for (answer, pose_b) in batch(&a, &here, &b, &poses, &options).iter().zip(&poses) {
                let truth = distance(&a, &here, &b, pose_b, &Options::default(), &mut WarmStart::default());
                assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
                if let Some(limit) = [1, 8, 9, 15, 16].get(most) {
                    assert!(answer.iterations <= *limit, "at most {limit}: {answer:?}");
                }
            }
        }
    }
}
