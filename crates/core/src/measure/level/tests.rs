//! Level distances by continuation against closed forms, cold answers and differences of values.

use super::*;
use crate::measure::Twist;
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use sublevel_testkit::Seeded;

fn at(x: f64, y: f64, z: f64) -> Pose {
    Pose::from_quaternion(Vector3::new(x, y, z), [0.0, 0.0, 0.0, 1.0]).unwrap()
}

/// A pose turned by an angle vector of any length.
fn turned(translation: Vector3<f64>, rotation: Vector3<f64>) -> Pose {
    let q = nalgebra::UnitQuaternion::from_scaled_axis(rotation);
    Pose::from_quaternion(translation, [q.i, q.j, q.k, q.w]).unwrap()
}

fn signed(random: &mut Seeded) -> Vector3<f64> {
    Vector3::from_fn(|_, _| random.signed())
}

fn smooth(random: &mut Seeded, name: &str) -> Body {
    let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
    let center = signed(random) * 0.3;
    match random.next() % 5 {
        0 => Body::ball(name, center, half.x).unwrap(),
        1 | 2 => Body::ellipsoid(name, center, half).unwrap(),
        3 => Body::superellipsoid(name, center, half, 4).unwrap(),
        _ => Body::superellipsoid(name, center, half, 6).unwrap(),
    }
}

fn cold(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, accuracy: f64) -> LevelDistance {
    let options = Options::default().with_accuracy(accuracy).unwrap();
    level_distance(a, pose_a, b, pose_b, &options, &mut WarmStart::default())
}

#[test]
fn continuation_through_all_regimes_meets_the_closed_form() {
    for seed in 0..48 {
        let mut random = Seeded(seed);
        let degrees = [2_u8, 4, 6, 8];
        let (ka, kb) = (degrees[(seed % 4) as usize], degrees[(seed / 4 % 4) as usize]);
        let mut half = || Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
        let (ha, hb) = (half(), half());
        let a = Body::superellipsoid("a", Vector3::zeros(), ha, ka).unwrap();
        let b = Body::superellipsoid("b", Vector3::zeros(), hb, kb).unwrap();
        let axis = (seed / 16 % 3) as usize;
        let mut warm = WarmStart::default();
        let steps = 400;
        for k in 0..=steps {
            // From several sizes away to concentric.
            let offset = (hb[axis] + 6.0 * ha[axis]) * (1.0 - f64::from(k) / f64::from(steps));
            let mut shift = Vector3::zeros();
            shift[axis] = offset;
            let pose = at(shift.x, shift.y, shift.z);
            let level = level_distance(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut warm);
            let truth = ((offset - hb[axis]).max(0.0) / ha[axis]).powi(i32::from(ka));
            let slack = 1e-13 * truth.max(1.0);
            let label = format!("seed {seed} ({ka}, {kb}) step {k}, {truth:e}: {level:?}");
            assert_eq!(level.status, Status::Converged, "{label}");
            assert!(level.lower <= truth + slack && truth <= level.upper + slack, "{label}");
            assert!(level.upper - level.lower <= 1e-9 * truth.max(1.0), "{label}");
            if offset < 0.99 * hb[axis] {
                assert!(level.saturated && level.multiplier == 0.0, "{label}");
            }
            if offset > 1.5 * hb[axis] + 0.5 * ha[axis] {
                assert!(!level.saturated && level.multiplier > 0.0, "{label}");
            }
        }
    }
}

#[test]
fn continuation_agrees_with_cold_answers_and_is_short() {
    let (mut rounds, mut queries) = (0, 0);
    for seed in 0..60 {
        let mut random = Seeded(700 + seed);
        let (a, b) = (smooth(&mut random, "a"), smooth(&mut random, "b"));
        let (start, velocity) = (signed(&mut random) * 6.0, signed(&mut random) * 0.01);
        let (spin_a, spin_b) = (signed(&mut random) * 0.01, signed(&mut random) * 0.01);
        let accuracy = [1e-3, 1e-6, 1e-9][(seed % 3) as usize];
        let options = Options::default().with_accuracy(accuracy).unwrap();
        let mut warm = WarmStart::default();
        for k in 0..60 {
            let t = f64::from(k);
            let pose_a = turned(velocity * t, spin_a * t);
            let pose_b = turned(start - start * (t / 60.0), spin_b * t);
            let level = level_distance(&a, &pose_a, &b, &pose_b, &options, &mut warm);
            let fine = cold(&a, &pose_a, &b, &pose_b, 1e-12);
            let label = format!("seed {seed} step {k}: {level:?} against {fine:?}");
            assert_eq!(level.status, Status::Converged, "{label}");
            assert!(level.lower <= fine.upper && fine.lower <= level.upper, "{label}");
            let inside = |body: &Body, pose: &Pose| {
                body.value(&pose.rotation().inverse_transform_vector(&(level.witness - pose.translation())))
            };
            assert!(inside(&b, &pose_b) <= 1.0 + 1e-12, "{label}");
            assert!(inside(&a, &pose_a) <= level.upper + 1e-12 * level.upper.abs().max(1.0), "{label}");
            if k > 1 && accuracy == 1e-9 {
                rounds += level.iterations;
                queries += 1;
            }
        }
    }
    // Steps here are long; some leave the smooth regime.
    assert!(f64::from(rounds) < 3.0 * f64::from(queries), "{rounds} rounds in {queries} queries");
}

#[test]
fn far_values_stay_bracketed() {
    for seed in 0..40 {
        let mut random = Seeded(1900 + seed);
        let half = Vector3::from_fn(|_, _| 2_f64.powf(random.signed()));
        let a = Body::superellipsoid("a", Vector3::zeros(), half, [4, 6, 8][(seed % 3) as usize]).unwrap();
        let b = smooth(&mut random, "b");
        let far = signed(&mut random).normalize() * 10_f64.powf(2.0 + random.signed());
        let mut warm = WarmStart::default();
        for k in 0..8 {
            let pose = turned(far * (1.0 + 1e-3 * f64::from(k)), far * (0.01 * f64::from(k) / far.norm()));
            let level = level_distance(&a, &Pose::identity(), &b, &pose, &Options::default(), &mut warm);
            let fine = cold(&a, &Pose::identity(), &b, &pose, 1e-12);
            let label = format!("seed {seed} step {k}: {level:?} against {fine:?}");
            assert_eq!(level.status, Status::Converged, "{label}");
            assert!(level.lower <= fine.upper && fine.lower <= level.upper, "{label}");
            assert!(level.upper - level.lower <= 1e-9 * level.upper, "{label}");
        }
    }
}

/// Derivatives of the value with respect to both twists: central differences, extrapolated to
/// step 0.
fn differences(a: &Body, b: &Body, poses: [Pose; 2], step: f64) -> [Twist; 2] {
    let value = |body: usize, linear: Vector3<f64>, angular: Vector3<f64>| {
        let mut moved = poses;
        let rotation = nalgebra::UnitQuaternion::from_scaled_axis(angular) * poses[body].rotation();
        let translation = poses[body].translation() + linear;
        moved[body] = Pose::from_quaternion(translation, rotation.coords.into()).unwrap();
        cold(a, &moved[0], b, &moved[1], 1e-13).value()
    };
    let derivative = |f: &dyn Fn(f64) -> f64| {
        let central = |h: f64| (f(h) - f(-h)) / (2.0 * h);
        let [coarse, middle, fine] = [step, 0.5 * step, 0.25 * step].map(central);
        let (first, second) = ((4.0 * middle - coarse) / 3.0, (4.0 * fine - middle) / 3.0);
        (16.0 * second - first) / 15.0
    };
    [0, 1].map(|body| {
        let along = |i: usize, t: f64| Vector3::from_fn(|j, _| if i == j { t } else { 0.0 });
        Twist {
            linear: Vector3::from_fn(|i, _| derivative(&|t| value(body, along(i, t), Vector3::zeros()))),
            angular: Vector3::from_fn(|i, _| derivative(&|t| value(body, Vector3::zeros(), along(i, t)))),
        }
    })
}

#[test]
fn gradients_are_the_derivatives_of_the_value() {
    for seed in 0..60 {
        let mut random = Seeded(3000 + seed);
        let (a, b) = (smooth(&mut random, "a"), smooth(&mut random, "b"));
        let direction = signed(&mut random).normalize();
        let (turn_a, turn_b) = (signed(&mut random), signed(&mut random));
        let pose_a = turned(signed(&mut random), turn_a);
        let centre = pose_a.transform_point(a.interior_point());
        // The place along the direction where the value is as asked for.
        let place = |distance: f64| turned(centre + direction * distance, turn_b);
        let regime = seed % 4;
        let wanted = [4.0, 1.0, 0.4][(regime as usize).min(2)];
        let mut between = [0.0, 20.0];
        for _ in 0..40 {
            let middle = 0.5 * (between[0] + between[1]);
            let above = cold(&a, &pose_a, &b, &place(middle), 1e-9).value() > wanted;
            between[usize::from(above)] = middle;
        }
        let pose_b = if regime == 3 { place(0.0) } else { place(between[1]) };
        // The cold answer, and one by continuation from a little before.
        let mut warm = WarmStart::default();
        let options = Options::default();
        for t in [2e-3, 1e-3] {
            let before = turned(pose_b.translation() + direction * t, turn_b);
            level_distance(&a, &pose_a, &b, &before, &options, &mut warm);
        }
        let followed = level_distance(&a, &pose_a, &b, &pose_b, &options, &mut warm);
        let truth = differences(&a, &b, [pose_a, pose_b], 2e-3);
        for answer in [cold(&a, &pose_a, &b, &pose_b, 1e-9), followed] {
            let label = format!("seed {seed} {}-{}: {answer:?} against {truth:?}", a.degree(), b.degree());
            assert_eq!(answer.status, Status::Converged, "{label}");
            if regime == 3
                && b.value(&pose_b.rotation().inverse_transform_vector(&(centre - pose_b.translation()))) < 1.0
            {
                assert!(answer.saturated, "{label}");
            }
            let all = |twists: [Twist; 2]| {
                nalgebra::SVector::<f64, 12>::from_fn(|i, _| {
                    let twist = &twists[i / 6];
                    if i % 6 < 3 { twist.linear[i % 3] } else { twist.angular[i % 3] }
                })
            };
            let (found, truth) = (all([answer.gradient_a, answer.gradient_b]), all(truth));
            assert!((found - truth).norm() <= 1e-6 * truth.norm().max(1e-3), "{label}");
        }
    }
}

#[test]
fn limits_end_in_true_brackets() {
    let mut wide = 0;
    for seed in 0..60 {
        let mut random = Seeded(4000 + seed);
        let (a, b) = (smooth(&mut random, "a"), smooth(&mut random, "b"));
        let pose = turned(signed(&mut random).normalize() * 6.0, signed(&mut random));
        let fine = cold(&a, &Pose::identity(), &b, &pose, 1e-12);
        let query = |options: &Options<'_>, warm: &mut WarmStart| {
            level_distance(&a, &Pose::identity(), &b, &pose, options, warm)
        };
        for limit in [1, 2, 3] {
            let options = Options::default().with_max_iterations(limit).unwrap();
            let level = query(&options, &mut WarmStart::default());
            let label = format!("seed {seed} limit {limit}: {level:?} against {fine:?}");
            let narrow = level.upper - level.lower <= options.accuracy() * level.upper.abs().max(1.0);
            assert_eq!(level.status == Status::Converged, narrow, "{label}");
            wide += usize::from(!narrow);
            assert!(level.iterations <= limit, "{label}");
            assert!(level.lower <= fine.upper && fine.lower <= level.upper, "{label}");
            assert!(level.upper.is_finite() && level.lower.is_finite(), "{label}");
        }
        // A stop flag acts at once, on continuation too.
        let stop = AtomicBool::new(true);
        let options = Options::default().with_stop(&stop);
        let mut warm = WarmStart::default();
        query(&Options::default(), &mut warm);
        for mut warm in [WarmStart::default(), warm] {
            let level = query(&options, &mut warm);
            let label = format!("seed {seed} stopped: {level:?} against {fine:?}");
            assert_eq!((level.status, level.iterations), (Status::BracketWide, 0), "{label}");
            assert!(level.lower <= fine.upper && fine.lower <= level.upper, "{label}");
        }
    }
    assert!(wide > 60, "{wide}");
}

#[test]
fn hints_of_other_pairs_change_nothing() {
    for seed in 0..40 {
        let mut random = Seeded(5000 + seed);
        let bodies: [Body; 4] = std::array::from_fn(|_| smooth(&mut random, "body"));
        let mut warm = WarmStart::default();
        for k in 0..40 {
            let pick = |random: &mut Seeded| (random.next() % 4) as usize;
            let (i, j) = (pick(&mut random), pick(&mut random));
            let far = 4.0 * random.signed();
            let pose = turned(signed(&mut random) * far, signed(&mut random) * 3.0);
            let (a, b) = (&bodies[i], &bodies[j]);
            let level = level_distance(a, &Pose::identity(), b, &pose, &Options::default(), &mut warm);
            let fine = cold(a, &Pose::identity(), b, &pose, 1e-12);
            let label = format!("seed {seed} query {k}: {level:?} against {fine:?}");
            assert_eq!(level.status, Status::Converged, "{label}");
            assert!(level.lower <= fine.upper && fine.lower <= level.upper, "{label}");
        }
    }
}

#[test]
fn nearly_parallel_sides_show_their_edges() {
    let cuboid = |x, y, z| Body::cuboid("box", Vector3::new(x, y, z)).unwrap();
    let needle = || Body::cylinder("needle", 0.01, 1.0).unwrap();
    let pairs = [(cuboid(1.0, 1.0, 1e-3), needle()), (cuboid(1.0, 1.0, 1e-3), cuboid(0.6, 0.9, 0.3))];
    let mut longest = 0;
    for seed in 0..240 {
        let mut random = Seeded(seed);
        let (a, b) = &pairs[(seed % 2) as usize];
        let tilt = signed(&mut random) * 10_f64.powf(-8.5 + random.signed());
        let mut place = Vector3::zeros();
        place[(seed / 2 % 3) as usize] = 3.0 + random.signed();
        let pose = turned(place, tilt);
        for (a, pose_a, b, pose_b) in [(a, Pose::identity(), b, pose), (b, pose, a, Pose::identity())] {
            let level = cold(a, &pose_a, b, &pose_b, 1e-9);
            let label = format!("seed {seed}, tilt {:e}, {} over {}: {level:?}", tilt.norm(), a.name(), b.name());
            assert_eq!(level.status, Status::Converged, "{label}");
            longest = longest.max(level.iterations);
        }
    }
    assert!(longest <= 30, "{longest}");
}

#[test]
fn flats_of_different_orders_take_few_iterations() {
    let body = |name, half: [f64; 3], k| Body::superellipsoid(name, Vector3::zeros(), half.into(), k).unwrap();
    let bodies = [
        body("needle", [0.05, 0.05, 1.0], 8),
        body("block", [0.5, 0.4, 0.3], 6),
        body("plate", [1.0, 1.0, 0.02], 8),
        Body::cuboid("box", Vector3::new(0.6, 0.9, 0.3)).unwrap(),
    ];
    let halves = [1.0, 0.3, 0.02, 0.3];
    let (mut slow, mut solves) = (Vec::new(), 0);
    for seed in 0..200 {
        let mut random = Seeded(seed);
        // Shallow tilts decide where on its side B is lowest; 1 m apart.
        let tilt = signed(&mut random).normalize() * 10_f64.powf(-7.0 + 5.0 * random.signed());
        for (i, j) in (0..4).flat_map(|i| (0..4).map(move |j| (i, j))).filter(|(i, j)| i != j) {
            let pose = turned(Vector3::new(0.0, 0.0, 1.0 + halves[i] + halves[j]), tilt);
            let level = cold(&bodies[i], &Pose::identity(), &bodies[j], &pose, 1e-9);
            let label = format!("seed {seed}, tilt {:e}, {} over {}", tilt.norm(), bodies[i].name(), bodies[j].name());
            assert_eq!(level.status, Status::Converged, "{label}: {level:?}");
            solves += 1;
            if level.iterations > 30 {
                slow.push((level.iterations, label));
            }
        }
    }
    assert!(slow.len() * 200 <= solves, "{} of {solves}: {slow:?}", slow.len());
}
