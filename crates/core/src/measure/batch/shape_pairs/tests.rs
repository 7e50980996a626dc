//! Batches of two boxes or cylinders, and of one of them and a capsule, against single queries.

use crate::body::Body;
use crate::measure::batch::{distance_batch, distance_to_capsule_batch};
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::stages::{Stage, only};
use crate::measure::{
    Capsule, CapsuleDistance, Distance, Options, Pose, Status, WarmStart, distance, distance_to_capsule,
};
use nalgebra::{UnitQuaternion, Vector3, Vector4};
use std::sync::atomic::AtomicBool;
use sublevel_testkit::Seeded;

fn rotation(random: &mut Seeded) -> [f64; 4] {
    Vector4::from_fn(|_, _| random.signed()).normalize().into()
}

fn pose(random: &mut Seeded, far: f64) -> Pose {
    Pose::from_quaternion(Vector3::from_fn(|_, _| far * random.signed()), rotation(random)).unwrap()
}

fn direction(random: &mut Seeded) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.signed()).normalize()
}

/// A box or a rod off the origin of its frame.
fn shape(random: &mut Seeded, is_box: bool) -> Body {
    let mut size = || 2_f64.powf(random.signed());
    let shape = if is_box {
        Body::cuboid("box", Vector3::new(size(), size(), size())).unwrap()
    } else {
        Body::cylinder("rod", size(), size()).unwrap()
    };
    shape.moved(&UnitQuaternion::identity(), &(0.7 * direction(random))).unwrap()
}

/// Two boxes, a box and a rod in either order, or two rods.
fn pair(random: &mut Seeded, seed: u64) -> [Body; 2] {
    [shape(random, seed & 1 == 0), shape(random, seed & 2 == 0)]
}

fn batch(a: &Body, pose_a: &Pose, b: &Body, poses: &[Pose], options: &Options<'_>) -> Vec<Distance> {
    let mut answers = vec![Distance::default(); poses.len()];
    distance_batch(a, pose_a, b, poses, options, &mut answers).unwrap();
    answers
}

fn single(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> Distance {
    distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
}

fn radii(a: &Body, b: &Body) -> f64 {
    a.circumscribed().radius + b.circumscribed().radius
}

/// Poses of B at this distance from A, metres, which is about exact; below 0 so much into A.
fn at_gap(a: &Body, pose_a: &Pose, b: &Body, gap: f64, random: &mut Seeded) -> Pose {
    let about = pose_a.transform_point(a.closed_form().unwrap().center());
    let turned = Pose::from_quaternion(Vector3::zeros(), rotation(random)).unwrap();
    let own = turned.transform_point(b.closed_form().unwrap().center());
    let away = turned.with_translation(about - own + direction(random) * (1.5 * radii(a, b)));
    let found = single(a, pose_a, b, &away);
    let n = found.normal.expect("apart");
    away.with_translation(away.translation() + n * (found.value() - gap))
}

/// What an answer of a batch has to be beside one of a single query.
fn check(answer: &Distance, single: &Distance, (a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose), what: &str) {
    let context = format!("{what}: {answer:?} against {single:?}");
    assert!(answer.status == Status::Converged || answer.status == single.status, "{context}");
    assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
    let between = (answer.witness_a - answer.witness_b).norm();
    assert!((between - answer.upper).abs() <= 1e-9 * (1.0 + answer.upper), "{context}");
    for (body, pose, witness) in [(a, pose_a, answer.witness_a), (b, pose_b, answer.witness_b)] {
        let own = pose.rotation().inverse() * (witness - pose.translation());
        // Relative to the thinnest size, which is 1e-4 at least.
        let rounding = 1e-11 * (1.0 + pose.translation().norm());
        assert!(body.value(&own) <= 1.0 + 1e-9 + rounding, "{context}");
    }
    let far = single.lower > 1e-9 * radii(a, b);
    assert!(!far || answer.normal.is_some() && single.normal.is_some(), "{context}");
    if let (true, Some(n), Some(m)) = (far, answer.normal, single.normal) {
        // Gradients are promised to 1e-6.
        assert!((n - m).norm() < 2e-6, "{context}");
        let dense = |active: &ActiveConstraints| {
            active.iter().fold([0.0; 3], |mut all, (index, multiplier)| {
                all[index] += multiplier;
                all
            })
        };
        for (ours, theirs, size) in [
            (&answer.active_a, &single.active_a, a.circumscribed().radius),
            (&answer.active_b, &single.active_b, b.circumscribed().radius),
        ] {
            let (ours, theirs) = (dense(ours), dense(theirs));
            assert!((0..3).all(|i| (ours[i] - theirs[i]).abs() <= 1e-3 * theirs[i] + 1e-5 * size), "{context}");
        }
    }
}

#[test]
fn answers_are_those_of_single_queries() {
    let gaps = [1e-6, 1e-4, 1e-2, 0.3, 1.0, 10.0, 1e3, -1e-6, -0.1];
    for seed in 0..80 {
        let mut random = Seeded(81_000 + seed);
        let [a, b] = pair(&mut random, seed);
        let (pose_a, size) = (pose(&mut random, 2.0), radii(&a, &b));
        let poses: Vec<Pose> =
            (0..63).map(|i| at_gap(&a, &pose_a, &b, gaps[i % gaps.len()] * size, &mut random)).collect();
        for (i, (answer, pose_b)) in batch(&a, &pose_a, &b, &poses, &Options::default()).iter().zip(&poses).enumerate()
        {
            let single = single(&a, &pose_a, &b, pose_b);
            let what = format!("seed {seed}, gap {}", gaps[i % gaps.len()]);
            check(answer, &single, (&a, &pose_a), (&b, pose_b), &what);
            // So far away that rounding may leave brackets wider, single queries say which.
            assert!(gaps[i % gaps.len()] > 100.0 || answer.status == Status::Converged, "{what}: {answer:?}");
        }
    }
}

/// The distance of boxes on faces, edges and corners, parallel and tilted by next to nothing.
#[test]
fn parallel_sides_have_their_distance() {
    let a = Body::cuboid("a", Vector3::new(1.0, 0.8, 0.6)).unwrap();
    let b = Body::cuboid("b", Vector3::new(0.5, 0.4, 0.3)).unwrap();
    let rod = Body::cylinder("rod", 0.4, 0.3).unwrap();
    let tilts = [0.0, 1e-16, 1e-12, 1e-9, 1e-7, 1e-6, 1e-4];
    for seed in 0..30 {
        let mut random = Seeded(82_000 + seed);
        let gaps = [[0.3, 0.0, 0.0], [0.0, 0.3, 0.4], [0.2, 0.3, 0.6]][seed as usize % 3];
        let sums = [1.5, 1.2, 0.9];
        let place = Vector3::from_fn(|i, _| if gaps[i] > 0.0 { sums[i] + gaps[i] } else { 0.1 });
        let poses = tilts.map(|tilt| {
            let turn = UnitQuaternion::from_scaled_axis(direction(&mut random) * tilt);
            Pose::from_quaternion(place, turn.coords.into()).unwrap()
        });
        let here = Pose::identity();
        for ((answer, tilt), pose) in batch(&a, &here, &b, &poses, &Options::default()).iter().zip(tilts).zip(&poses) {
            let what = format!("seed {seed}, tilt {tilt:e}");
            let (truth, slack) = (Vector3::from(gaps).norm(), 2.0 * tilt + 1e-14);
            assert!(answer.lower <= truth + slack && truth - slack <= answer.upper, "{what}: {answer:?}");
            check(answer, &single(&a, &here, &b, pose), (&a, &here), (&b, pose), &what);
        }
        for (a, b) in [(&a, &rod), (&rod, &a), (&rod, &rod)] {
            for (answer, pose) in batch(a, &here, b, &poses, &Options::default()).iter().zip(&poses) {
                let what = format!("seed {seed}, {} and {}", a.name(), b.name());
                check(answer, &single(a, &here, b, pose), (a, &here), (b, pose), &what);
            }
        }
    }
}

#[test]
fn needles_and_plates_are_answered_as_by_single_queries() {
    let thin = 1e-4;
    let shapes = [
        Body::cuboid("needle", Vector3::new(1.0, thin, thin)).unwrap(),
        Body::cuboid("plate", Vector3::new(1.0, 1.0, thin)).unwrap(),
        Body::cuboid("box", Vector3::new(0.5, 0.4, 0.3)).unwrap(),
        Body::cylinder("rod", thin, 1.0).unwrap(),
        Body::cylinder("disc", 1.0, thin).unwrap(),
    ];
    for seed in 0..75 {
        let mut random = Seeded(83_000 + seed);
        let (a, b) = (&shapes[seed as usize % 5], &shapes[seed as usize / 5 % 5]);
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> =
            [1e-3, 1e-2, 0.1, 1.0, 10.0].map(|gap| at_gap(a, &pose_a, b, gap, &mut random)).into_iter().collect();
        for (answer, pose_b) in batch(a, &pose_a, b, &poses, &Options::default()).iter().zip(&poses) {
            let what = format!("seed {seed}, {} and {}", a.name(), b.name());
            check(answer, &single(a, &pose_a, b, pose_b), (a, &pose_a), (b, pose_b), &what);
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
    for seed in 0..8 {
        let mut random = Seeded(84_000 + seed);
        let [a, b] = pair(&mut random, seed);
        let pose_a = pose(&mut random, 1.0);
        let poses: Vec<Pose> = (0..1000).map(|_| pose(&mut random, 4.0)).collect();
        let solve = |poses: &[Pose]| batch(&a, &pose_a, &b, poses, &options).iter().map(bits).collect::<Vec<_>>();
        let answers = solve(&poses);
        for size in 1..=17 {
            for (chunk, known) in poses[..85].chunks(size).zip(answers.chunks(size)) {
                assert_eq!(solve(chunk), known[..chunk.len()], "seed {seed}, size {size}");
            }
        }
        // Neighbours that overlap, that are far away, that are the same.
        for neighbour in [pose_a, pose(&mut random, 1e6), poses[0]] {
            for i in 0..40 {
                let mut others = vec![neighbour; 17];
                others[i % 17] = poses[i];
                assert_eq!(solve(&others)[i % 17], answers[i], "seed {seed}, pose {i}");
            }
        }
    }
}

/// Of poses apart, few are left to single queries, in any unit and at any distance: of rods some
/// diameters apart it would be a tenth without steps that only turn the normal.
#[test]
fn poses_apart_are_answered_in_lanes() {
    let options = Options::default();
    let here = Pose::identity();
    for (first, second) in [("box", "box"), ("box", "rod"), ("rod", "box"), ("rod", "rod")] {
        let answered_in = |unit: f64, far: f64| {
            let mut random = Seeded(5);
            let [a, b] = [first, second].map(|kind| match kind {
                "box" => Body::cuboid("box", Vector3::new(0.5, 0.4, 0.6) * unit).unwrap(),
                _ => Body::cylinder("rod", 0.4 * unit, 0.6 * unit).unwrap(),
            });
            let poses: Vec<Pose> = (0..400)
                .map(|_| {
                    let place = direction(&mut random) * ((far + random.positive()) * unit);
                    Pose::from_quaternion(place, rotation(&mut random)).unwrap()
                })
                .collect();
            // Alone no method is left.
            let answers = only(&[Stage::Lanes], || batch(&a, &here, &b, &poses, &options));
            answers.iter().filter(|answer| answer.status == Status::Converged && answer.lower > 0.0).count()
        };
        for far in [2.0, 6.0, 60.0, 600.0] {
            let count = answered_in(1.0, far);
            println!("{first}, {second}, {far} m: {count} of 400");
            assert!(count >= 396, "{first}, {second}, {far} m: {count} of 400");
            for exponent in [-20, 20] {
                assert_eq!(answered_in(2_f64.powi(exponent), far), count, "{first}, {second}, unit 2^{exponent}");
            }
        }
    }
}

/// Signed distances of capsules, whichever side moves, from far away to axes that meet the shape.
#[test]
fn capsules_are_answered_as_by_single_queries() {
    let options = Options::default();
    for seed in 0..40 {
        let mut random = Seeded(85_000 + seed);
        let body = shape(&mut random, seed % 2 == 0);
        let capsule = Capsule::new([0.2, 0.0][seed as usize / 2 % 2], [0.6, 2.0][seed as usize / 4 % 2]).unwrap();
        let still = [pose(&mut random, 1.0)];
        let poses: Vec<Pose> = (0..61).map(|i| pose(&mut random, if i % 8 == 0 { 100.0 } else { 4.0 })).collect();
        for (of_body, of_capsule) in [(&still[..], &poses[..]), (&poses[..], &still[..])] {
            let mut answers = vec![CapsuleDistance::default(); poses.len()];
            distance_to_capsule_batch(&body, of_body, &capsule, of_capsule, &options, &mut answers).unwrap();
            for (i, answer) in answers.iter().enumerate() {
                let (pose, at) = (&of_body[i % of_body.len()], &of_capsule[i % of_capsule.len()]);
                let single = distance_to_capsule(&body, pose, &capsule, at, &options, &mut WarmStart::default());
                let context = format!("seed {seed}, pose {i}: {answer:?} against {single:?}");
                assert!(answer.status == Status::Converged || answer.status == single.status, "{context}");
                assert!(answer.lower <= single.upper && single.lower <= answer.upper, "{context}");
                if let (Some(n), Some(m)) = (answer.normal, single.normal)
                    && single.lower + capsule.radius_m() > 1e-6
                {
                    assert!((n - m).norm() < 2e-6, "{context}");
                    let between = (answer.witness - answer.witness_of_capsule).dot(&n);
                    assert!((between - answer.value()).abs() < 1e-7, "{context}");
                }
            }
        }
    }
}

/// Of axes apart from a shape nearly all.
#[test]
fn axes_apart_are_answered_in_lanes() {
    let options = Options::default();
    let shapes = [Body::cuboid("box", Vector3::new(0.5, 0.4, 0.6)).unwrap(), Body::cylinder("rod", 0.4, 0.6).unwrap()];
    let capsule = Capsule::new(0.2, 0.6).unwrap();
    for body in &shapes {
        let mut random = Seeded(6);
        let poses: Vec<Pose> = (0..400)
            .map(|_| {
                let place = direction(&mut random) * (2.0 + random.positive());
                Pose::from_quaternion(place, rotation(&mut random)).unwrap()
            })
            .collect();
        let mut answers = vec![CapsuleDistance::default(); poses.len()];
        only(&[Stage::Lanes], || {
            distance_to_capsule_batch(body, &[Pose::identity()], &capsule, &poses, &options, &mut answers)
        })
        .unwrap();
        let count = answers.iter().filter(|answer| answer.status == Status::Converged && answer.normal.is_some());
        let count = count.count();
        println!("{}: {count} of 400", body.name());
        assert!(count >= 396, "{}: {count} of 400", body.name());
    }
}

#[test]
fn limits_and_stops_leave_true_brackets() {
    let mut random = Seeded(86_000);
    let stop = AtomicBool::new(true);
    for seed in 0..4 {
        let [a, b] = pair(&mut random, seed);
        let poses: Vec<Pose> = (0..40).map(|_| pose(&mut random, 4.0)).collect();
        let here = Pose::identity();
        let few = [1, 7, 8, 9, 16].map(|most| (most, Options::default().with_max_iterations(most).unwrap()));
        for (most, options) in few.into_iter().chain([(u32::MAX, Options::default().with_stop(&stop))]) {
            for (answer, pose_b) in batch(&a, &here, &b, &poses, &options).iter().zip(&poses) {
                let truth = single(&a, &here, &b, pose_b);
                assert!(answer.lower <= truth.upper && truth.lower <= answer.upper, "{answer:?} {truth:?}");
                assert!(answer.iterations <= most, "at most {most}: {answer:?}");
            }
        }
    }
}
