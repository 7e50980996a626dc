//! Batches against single queries.

use super::{BatchError, distance_batch, distance_to_capsule_batch};
use crate::body::{Body, Compound};
use crate::measure::solver::stages::{Stage, only};
use crate::measure::{Capsule, CapsuleDistance, Distance, Options, Pose, Status, WarmStart, distance};
use nalgebra::{UnitQuaternion, Vector3, Vector4};
use std::sync::atomic::AtomicBool;
use sublevel_testkit::Seeded;

fn pose(random: &mut Seeded, far: f64) -> Pose {
    let q = Vector4::from_fn(|_, _| random.signed()).normalize();
    Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), q.into()).unwrap()
}

fn body(random: &mut Seeded, degree: u8) -> Body {
    let center = Vector3::from_fn(|_, _| random.signed());
    let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
    if degree == 2 {
        Body::ellipsoid("egg", center, half).unwrap()
    } else {
        Body::superellipsoid("q", center, half, degree).unwrap()
    }
}

/// Every number of an answer, bit by bit.
fn bits(answer: &Distance) -> [u64; 19] {
    let mut numbers = vec![answer.lower, answer.upper, answer.value(), f64::from(answer.iterations)];
    numbers.extend(answer.witness_a.iter().chain(answer.witness_b.iter()));
    numbers.extend(answer.normal.unwrap_or_default().iter());
    numbers.push(f64::from(u8::from(answer.normal.is_some())));
    numbers.push(f64::from(u8::from(answer.status == Status::Converged)));
    for active in [answer.active_a, answer.active_b] {
        let (sum, first) = active.iter().fold((0.0, 0.0), |(sum, _), (index, m)| (sum + m, index as f64));
        numbers.extend([sum, first]);
    }
    std::array::from_fn(|i| numbers[i].to_bits())
}

fn solve(a: &Body, pose_a: &Pose, b: &Body, poses: &[Pose]) -> Vec<[u64; 19]> {
    let mut answers = vec![Distance::default(); poses.len()];
    distance_batch(a, pose_a, b, poses, &Options::default(), &mut answers).unwrap();
    answers.iter().map(bits).collect()
}

#[test]
fn answers_are_those_of_single_queries() {
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let degrees = [2_u8, 4, 6, 8];
        let (a, b) = (body(&mut random, degrees[seed as usize % 4]), body(&mut random, degrees[seed as usize / 4 % 4]));
        let pose_a = pose(&mut random, 2.0);
        // Some in contact, some far away.
        let poses: Vec<Pose> =
            (0..64).map(|i| pose(&mut random, if i % 8 == 0 { 1e3 } else { 2.0 + 0.1 * i as f64 })).collect();
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(&a, &pose_a, &b, &poses, &Options::default(), &mut answers).unwrap();
        for (i, (answer, pose_b)) in answers.iter().zip(&poses).enumerate() {
            let single = distance(&a, &pose_a, &b, pose_b, &Options::default(), &mut WarmStart::default());
            let context = format!("seed {seed}, pose {i}: {answer:?} against {single:?}");
            assert_eq!(answer.status, single.status, "{context}");
            assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
            let between = (answer.witness_a - answer.witness_b).norm();
            assert!((between - answer.upper).abs() <= 1e-9 * (1.0 + answer.upper), "{context}");
            let inverse = |pose: &Pose, x: &Vector3<f64>| pose.rotation().inverse() * (x - pose.translation());
            assert!(a.value(&inverse(&pose_a, &answer.witness_a)) <= 1.0 + 1e-9, "{context}");
            assert!(b.value(&inverse(pose_b, &answer.witness_b)) <= 1.0 + 1e-9, "{context}");
            if let (Some(n), Some(m)) = (answer.normal, single.normal) {
                // Each is good to the square root of its bracket.
                assert!((n - m).norm() < 1e-3, "{context}");
                let multiplier = |answer: &Distance| answer.active_a.iter().map(|(_, value)| value).sum::<f64>();
                let (of_batch, of_single) = (multiplier(answer), multiplier(&single));
                assert!((of_batch - of_single).abs() <= 1e-3 * of_single, "{context}");
            }
        }
    }
}

#[test]
fn far_poses_are_as_narrow_as_single_queries() {
    let small = Body::superellipsoid("small", Vector3::zeros(), Vector3::new(0.03, 0.02, 0.025), 4).unwrap();
    let large = Body::superellipsoid("large", Vector3::zeros(), Vector3::new(0.8, 0.5, 1.1), 8).unwrap();
    let mut random = Seeded(21);
    let poses: Vec<Pose> = (0..400).map(|_| pose(&mut random, 60.0)).collect();
    for (a, b) in [(&small, &large), (&large, &small), (&small, &small)] {
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(a, &Pose::identity(), b, &poses, &Options::default(), &mut answers).unwrap();
        for (answer, pose_b) in answers.iter().zip(&poses) {
            let single = distance(a, &Pose::identity(), b, pose_b, &Options::default(), &mut WarmStart::default());
            assert_eq!(answer.status, single.status, "{answer:?} against {single:?}");
        }
    }
}

#[test]
fn an_answer_does_not_depend_on_its_neighbours() {
    for seed in 0..12 {
        let mut random = Seeded(seed);
        let (a, b) = (body(&mut random, 6), body(&mut random, if seed % 2 == 0 { 6 } else { 4 }));
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..61).map(|_| pose(&mut random, 4.0)).collect();
        let answers = solve(&a, &pose_a, &b, &poses);
        let mut order: Vec<usize> = (0..poses.len()).collect();
        for round in 0..4 {
            for i in (1..order.len()).rev() {
                order.swap(i, ((random.signed().abs() * (i + 1) as f64) as usize).min(i));
            }
            let shuffled: Vec<Pose> = order.iter().map(|&i| poses[i]).collect();
            for (found, &i) in solve(&a, &pose_a, &b, &shuffled).iter().zip(&order) {
                assert_eq!(*found, answers[i], "seed {seed}, round {round}, pose {i}");
            }
        }
        for size in 1..=20 {
            for (chunk, known) in poses.chunks(size).zip(answers.chunks(size)) {
                assert_eq!(solve(&a, &pose_a, &b, chunk), known, "seed {seed}, size {size}");
            }
        }
        // Neighbours that overlap, that are far away, that are the same.
        for neighbour in [pose_a, pose(&mut random, 1e6), poses[0]] {
            for i in 0..poses.len() {
                let mut others = vec![neighbour; 17];
                others[i % 17] = poses[i];
                assert_eq!(solve(&a, &pose_a, &b, &others)[i % 17], answers[i], "seed {seed}, pose {i}");
            }
        }
    }
}

#[test]
fn other_solids_are_solved_one_by_one() {
    let mut random = Seeded(3);
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let cuboid = Body::cuboid("box", Vector3::new(1.0, 0.5, 0.7)).unwrap();
    let compound = Compound::new("two", vec![ball.clone(), cuboid.clone()]).unwrap();
    let poses: Vec<Pose> = (0..20).map(|_| pose(&mut random, 3.0)).collect();
    let options = Options::default();
    let mut answers = vec![Distance::default(); poses.len()];
    distance_batch(&compound, &Pose::identity(), &ball, &poses, &options, &mut answers).unwrap();
    for (answer, pose_b) in answers.iter().zip(&poses) {
        let single = distance(&compound, &Pose::identity(), &ball, pose_b, &options, &mut WarmStart::default());
        assert_eq!(bits(answer), bits(&single));
    }
    // With axes of its own.
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, -0.5));
    let turned = cuboid.moved(&turn, &Vector3::zeros()).unwrap();
    assert!(turned.closed_form().is_some_and(|form| form.axes().is_some()));
    distance_batch(&cuboid, &Pose::identity(), &turned, &poses, &options, &mut answers).unwrap();
    for (answer, pose_b) in answers.iter().zip(&poses) {
        let single = distance(&cuboid, &Pose::identity(), &turned, pose_b, &options, &mut WarmStart::default());
        assert_eq!(bits(answer), bits(&single));
    }
}

#[test]
fn what_makes_no_sense_is_refused() {
    let ball = Body::ball("ball", Vector3::zeros(), 0.5).unwrap();
    let here = Pose::identity();
    let batch = |poses: &[Pose], answers: &mut [Distance]| {
        distance_batch(&ball, &here, &ball, poses, &Options::default(), answers)
    };
    assert_eq!(batch(&[], &mut []), Err(BatchError::Empty));
    let mut answers = [Distance::default(); 2];
    assert_eq!(batch(&[here; 3], &mut answers), Err(BatchError::Lengths { poses: 3, answers: 2 }));
    assert_eq!(batch(&[], &mut answers), Err(BatchError::Lengths { poses: 0, answers: 2 }));
}

#[test]
fn limits_and_stops_leave_true_brackets() {
    let mut random = Seeded(8);
    let (a, b) = (body(&mut random, 6), body(&mut random, 8));
    let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 6.0)).collect();
    let stop = AtomicBool::new(true);
    let limits = [Options::default().with_max_iterations(1).unwrap(), Options::default().with_stop(&stop)];
    for options in limits {
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(&a, &Pose::identity(), &b, &poses, &options, &mut answers).unwrap();
        for (answer, pose_b) in answers.iter().zip(&poses) {
            let truth = distance(&a, &Pose::identity(), &b, pose_b, &Options::default(), &mut WarmStart::default());
            assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
        }
    }
}

/// How many poses are answered in lanes, without any method that solves a pose alone.
fn answered(a: &Body, b: &Body, poses: &[Pose]) -> usize {
    let mut answers = vec![Distance::default(); poses.len()];
    let options = Options::default();
    only(&[Stage::Lanes], || distance_batch(a, &Pose::identity(), b, poses, &options, &mut answers)).unwrap();
    answers.iter().filter(|answer| answer.status == Status::Converged && answer.lower > 0.0).count()
}

#[test]
fn lanes_answer_alike_in_any_unit() {
    // From nanometres to gigametres; powers of two change no digit.
    let answered_in = |unit: f64, degrees: [u8; 2], far: f64| {
        let mut random = Seeded(5);
        let [a, b] = degrees.map(|degree| {
            let half = Vector3::from_fn(|_, _| unit * 2_f64.powf(random.signed()));
            if degree == 2 {
                Body::ellipsoid("egg", Vector3::zeros(), half).unwrap()
            } else {
                Body::superellipsoid("q", Vector3::zeros(), half, degree).unwrap()
            }
        });
        let poses: Vec<Pose> = (0..200)
            .map(|_| {
                let q = Vector4::from_fn(|_, _| random.signed()).normalize();
                let t = Vector3::from_fn(|_, _| random.signed()).normalize() * (far * unit);
                Pose::from_quaternion(t, q.into()).unwrap()
            })
            .collect();
        answered(&a, &b, &poses)
    };
    for degrees in [[2, 2], [4, 6], [8, 2]] {
        for far in [6.0, 60.0, 600.0] {
            let count = answered_in(1.0, degrees, far);
            assert!(count >= 180, "degrees {degrees:?}, far {far}: {count} of 200");
            for exponent in [-30, -20, -10, 10, 20, 30] {
                let unit = 2_f64.powi(exponent);
                let found = answered_in(unit, degrees, far);
                let context = format!("unit {unit:e}, degrees {degrees:?}, far {far}: {found} of 200");
                // So far away that single precision runs out of numbers some poses are solved
                // alone.
                assert!(if far < 100.0 { found == count } else { found >= 180 }, "{context}, {count} in metres");
            }
        }
    }
}

/// Of poses apart, few are left to single queries: those whose start lies beyond a flat tip, and
/// those that take too many rounds.
#[test]
fn boxes_and_cylinders_are_answered_in_lanes() {
    for degree in [2, 4, 6, 8] {
        for kind in ["box", "rod"] {
            for exponent in [-20, 0, 20] {
                let mut random = Seeded(5);
                let unit = 2_f64.powi(exponent);
                let half = Vector3::new(0.7, 0.5, 0.4) * unit;
                let egg = if degree == 2 {
                    Body::ellipsoid("egg", Vector3::zeros(), half).unwrap()
                } else {
                    Body::superellipsoid("q", Vector3::zeros(), half, degree).unwrap()
                };
                let other = match kind {
                    "box" => Body::cuboid("box", Vector3::new(0.5, 0.4, 0.6) * unit).unwrap(),
                    _ => Body::cylinder("rod", 0.4 * unit, 0.6 * unit).unwrap(),
                };
                let poses: Vec<Pose> = (0..400)
                    .map(|_| {
                        let q = Vector4::from_fn(|_, _| random.signed()).normalize();
                        let t =
                            Vector3::from_fn(|_, _| random.signed()).normalize() * ((2.0 + random.positive()) * unit);
                        Pose::from_quaternion(t, q.into()).unwrap()
                    })
                    .collect();
                for (a, b) in [(&egg, &other), (&other, &egg)] {
                    let count = answered(a, b, &poses);
                    println!("degree {degree}, {kind}, unit {unit:e}: {count} of 400");
                    assert!(count >= 360, "degree {degree}, {kind}, unit {unit:e}: {count} of 400");
                }
            }
        }
    }
}

/// The same beside capsules, segments and points, whichever side moves.
#[test]
fn capsules_are_answered_in_lanes() {
    for degree in [2, 4, 6, 8] {
        for (radius, half) in [(0.2, 0.6), (0.3, 0.0), (0.0, 0.6), (0.0, 0.0)] {
            for exponent in [-20, 0, 20] {
                let mut random = Seeded(5);
                let unit = 2_f64.powi(exponent);
                let half_axes = Vector3::new(0.7, 0.5, 0.4) * unit;
                let egg = if degree == 2 {
                    Body::ellipsoid("egg", Vector3::zeros(), half_axes).unwrap()
                } else {
                    Body::superellipsoid("q", Vector3::zeros(), half_axes, degree).unwrap()
                };
                let capsule = Capsule::new(radius * unit, half * unit).unwrap();
                let poses: Vec<Pose> = (0..400)
                    .map(|_| {
                        let q = Vector4::from_fn(|_, _| random.signed()).normalize();
                        let t =
                            Vector3::from_fn(|_, _| random.signed()).normalize() * ((2.0 + random.positive()) * unit);
                        Pose::from_quaternion(t, q.into()).unwrap()
                    })
                    .collect();
                let here = [Pose::identity()];
                for (of_egg, of_capsule) in [(&here[..], &poses[..]), (&poses[..], &here[..])] {
                    let mut answers = [CapsuleDistance::default(); 400];
                    let options = Options::default();
                    only(&[Stage::Lanes], || {
                        distance_to_capsule_batch(&egg, of_egg, &capsule, of_capsule, &options, &mut answers)
                    })
                    .unwrap();
                    // Alone no method is left but the way to the interior point.
                    let count = answers.iter().filter(|answer| answer.lower.is_finite()).count();
                    println!("degree {degree}, radius {radius}, half {half}, unit {unit:e}: {count} of 400");
                    assert!(count >= 360, "degree {degree}, radius {radius}, half {half}, unit {unit:e}: {count}");
                }
            }
        }
    }
}

#[test]
fn concentric_bodies_do_not_linger() {
    let (a, b) = (body(&mut Seeded(1), 2), body(&mut Seeded(1), 2));
    let mut answers = [Distance::default(); 3];
    distance_batch(&a, &Pose::identity(), &b, &[Pose::identity(); 3], &Options::default(), &mut answers).unwrap();
    for answer in &answers {
        assert_eq!((answer.status, answer.lower), (Status::Converged, 0.0), "{answer:?}");
    }
    assert_eq!(answered(&a, &b, &[Pose::identity(); 3]), 0);
}

#[test]
fn what_the_places_held_before_is_gone() {
    let mut random = Seeded(4);
    let (a, b) = (body(&mut random, 4), body(&mut random, 6));
    let poses: Vec<Pose> = (0..90).map(|_| pose(&mut random, 5.0)).collect();
    let stop = AtomicBool::new(true);
    let here = Pose::identity();
    let truth = |pose| distance(&a, &here, &b, pose, &Options::default(), &mut WarmStart::default());
    for options in [Options::default(), Options::default().with_stop(&stop)] {
        let stale = Distance { status: Status::Converged, lower: 40.0, upper: 40.0, ..Distance::default() };
        let mut answers = vec![stale; poses.len()];
        distance_batch(&a, &here, &b, &poses, &options, &mut answers).unwrap();
        for (answer, truth) in answers.iter().zip(poses.iter().map(truth)) {
            assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
        }
    }
}

#[test]
fn iterations_keep_their_limit() {
    let mut random = Seeded(9);
    let (a, b) = (body(&mut random, 8), body(&mut random, 8));
    // Many at touch, where Newton's method in lanes comes to nothing.
    let poses: Vec<Pose> = (0..600).map(|i| pose(&mut random, if i % 2 == 0 { 1.5 } else { 4.0 })).collect();
    for most in [15, 16, 17, 40] {
        let options = Options::default().with_max_iterations(most).unwrap();
        let mut answers = vec![Distance::default(); poses.len()];
        distance_batch(&a, &Pose::identity(), &b, &poses, &options, &mut answers).unwrap();
        for answer in &answers {
            assert!(answer.iterations <= most, "at most {most}: {answer:?}");
        }
    }
}
