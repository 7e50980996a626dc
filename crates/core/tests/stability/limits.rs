//! Families about limits, hints and bad input: 2, 18, 25.

use crate::judge::{judged, judged_level, plain, small, verdict, warm};
use nalgebra::{DMatrix, Matrix3, UnitQuaternion, Vector3};
use std::sync::atomic::AtomicBool;
use sublevel_core::body::{Body, BodyError, Constraint, Normalization};
use sublevel_core::measure::{
    Distance, Options, OptionsError, Pose, PoseError, Status, WarmStart, distance, distance_batch, growth_distance,
    level_distance,
};
use sublevel_core::polynomial::{HessianGram, Polynomial, PolynomialError};
use sublevel_testkit::bodies::{b, e, fitted, p, q, zoo};
use sublevel_testkit::random::{Seeded, draws, pose, shifted};
use sublevel_testkit::reference;

/// Iteration limit passed off as an answer: limit 1, 2, 3: status not converged and the bracket
/// still contains the truth.
#[test]
fn family_02_iteration_limit() {
    let zoo = zoo();
    let (mut wide, mut narrow) = (0, 0);
    for seed in 0..200 {
        let mut random = Seeded(20_000 + seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let reach = sum * random.between(0.2, 4.0);
        let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
        let full = plain((a, &pose_a), (b, &pose_b), &Options::default(), &format!("seed {seed}"));
        let full_level = level_distance(a, &pose_a, b, &pose_b, &Options::default(), &mut WarmStart::default());
        for limit in 1..=3 {
            // The limit and the honest status are part of every verdict.
            let options = Options::default().with_max_iterations(limit).unwrap();
            let label = format!("seed {seed} limit {limit}");
            let answer = plain((a, &pose_a), (b, &pose_b), &options, &label);
            // The reference needs a start near the solution, which is what the limit denies.
            let truth = reference::distance(a, &pose_a, b, &pose_b, &full);
            assert!(truth.width() <= 1e-16 * small(a, b) && truth.inside(&answer), "{label}: {answer:?}");
            let level = level_distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
            let truth = reference::level_distance(a, &pose_a, b, &pose_b, &full_level);
            assert!(
                truth.width() <= 1e-12 * truth.value().abs().max(1.0) && truth.inside(&level),
                "{label}: {level:?}"
            );
            assert!(level.iterations <= limit, "{label}: {level:?}");
            *(if answer.status == Status::BracketWide { &mut wide } else { &mut narrow }) += 1;
        }
        let stop = AtomicBool::new(true);
        let options = Options::default().with_stop(&stop);
        let answer = plain((a, &pose_a), (b, &pose_b), &options, &format!("seed {seed} stopped"));
        assert!(reference::distance(a, &pose_a, b, &pose_b, &full).inside(&answer), "seed {seed} stopped: {answer:?}");
        let level = level_distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        assert!(answer.iterations <= 1 && level.iterations <= 1, "stopped, yet {answer:?} {level:?}");
    }
    println!("{wide} wide, {narrow} narrow");
    // A flat pair far from its start cannot be solved in one iteration.
    assert!(wide > 0, "no limit was ever felt");
}

/// Bodies around meshes converge in 30 iterations however far apart, deep in each other, grazing or
/// aligned they are: one by one, in batches, and where their centres all but coincide.
#[test]
fn fitted_bodies_take_few_iterations() {
    let bodies = fitted();
    if bodies.is_empty() {
        return;
    }
    let options = Options::default();
    let mut most = [0; 4];
    for seed in 0..draws(2_000) {
        let mut random = Seeded(290_000 + seed);
        let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let poses: [Pose; 16] = std::array::from_fn(|_| {
            let reach = match random.index(4) {
                0 => random.between(1.0, 100.0),
                1 => random.between(1e-15, 1e-3),
                _ => 1.6 * random.positive(),
            };
            let turn = if random.index(4) == 0 { UnitQuaternion::identity() } else { random.rotation() };
            // About the interior points: the origin of a fitted body may lie at its foot.
            pose(a.interior_point() + random.unit() * (reach * sum) - turn * b.interior_point(), &turn)
        });
        let here = Pose::identity();
        let mut answers = [Distance::default(); 16];
        distance_batch(a, &here, b, &poses, &options, &mut answers).unwrap();
        for (pose_b, answer) in poses.iter().zip(&answers) {
            let label = format!("seed {seed} {}-{} {pose_b:?}", a.name(), b.name());
            let level = level_distance(a, &here, b, pose_b, &options, &mut WarmStart::default());
            let cold = distance(a, &here, b, pose_b, &options, &mut WarmStart::default());
            let growth = growth_distance(a, &here, b, pose_b, &options, &mut WarmStart::default());
            let of_all = [answer.status, cold.status, level.status, growth.status];
            assert!(of_all.iter().all(|status| *status == Status::Converged), "{label}: {of_all:?}");
            let spent = [answer.iterations, cold.iterations, level.iterations, growth.iterations];
            assert!(spent.iter().all(|iterations| *iterations <= 30), "{label}: {spent:?}");
            most = std::array::from_fn(|i| most[i].max(spent[i]));
        }
    }
    println!("most: distances in batches {}, alone {}, level {}, growth {}", most[0], most[1], most[2], most[3]);
}

/// Bad warm start: previous, another pair's, NaN, after a 180° teleport: same bracketed value, only
/// time differs.
#[test]
fn family_18_bad_warm_start() {
    let zoo = zoo();
    // Overflow fills a hint with what floating point has to offer.
    let tiny = q(8, 1e-24, 1e-24, 1e-24);
    let nowhere = pose(Vector3::new(1e15, -1e15, 1e15), &UnitQuaternion::identity());
    let mut bad = Vec::new();
    for (a, b) in [(&tiny, &tiny), (&tiny, &zoo[0]), (&zoo[0], &tiny)] {
        let mut hint = WarmStart::default();
        sublevel_core::measure::distance(a, &Pose::identity(), b, &nowhere, &Options::default(), &mut hint);
        bad.push(hint);
        level_distance(a, &Pose::identity(), b, &nowhere, &Options::default(), &mut hint);
        bad.push(hint);
    }
    for seed in 0..200 {
        let mut random = Seeded(180_000 + seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let (other_a, other_b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let reach = sum * random.between(0.3, 3.0);
        let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
        let options = Options::default();
        let (cold, _) = judged((a, &pose_a), (b, &pose_b), &options, &format!("seed {seed} cold"));
        let mut hints = bad.clone();
        let mut hint = |a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose| {
            let mut hint = WarmStart::default();
            sublevel_core::measure::distance(a, pose_a, b, pose_b, &options, &mut hint);
            hints.push(hint);
            level_distance(a, pose_a, b, pose_b, &options, &mut hint);
            hints.push(hint);
        };
        // Previous: a small step before; another pair's; the same pair swapped; from the other side
        // of the world.
        hint(a, &pose_a, b, &shifted(&pose_b, random.unit() * 0.01 * sum));
        hint(other_a, &pose_a, other_b, &pose_b);
        hint(b, &pose_b, a, &pose_a);
        let half_turn = UnitQuaternion::from_scaled_axis(random.unit() * std::f64::consts::PI);
        hint(a, &pose_a, b, &pose(-pose_b.translation(), &(half_turn * pose_b.rotation())));
        hint(a, &pose_a, b, &pose_a);
        let level = level_distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        for (k, hint) in hints.iter().enumerate() {
            let label = format!("seed {seed} hint {k} {hint:?}");
            let answer = warm((a, &pose_a), (b, &pose_b), &options, &mut hint.clone(), &label);
            verdict((a, &pose_a), (b, &pose_b), &answer, &label);
            assert_eq!(answer.status, Status::Converged, "{label}: {answer:?}");
            assert!(answer.lower <= cold.upper && cold.lower <= answer.upper, "{label}: {cold:?} {answer:?}");
            assert!((answer.value() - cold.value()).abs() <= 1e-9 * small(a, b), "{label}: {cold:?} {answer:?}");
            let again = level_distance(a, &pose_a, b, &pose_b, &options, &mut hint.clone());
            assert_eq!(again.status, Status::Converged, "{label}: {again:?}");
            assert!(again.lower <= level.upper && level.lower <= again.upper, "{label}: {level:?} {again:?}");
        }
    }
}

fn square(coefficients: [f64; 3], constant: f64) -> Result<Polynomial, PolynomialError> {
    let axis = |i: usize| std::array::from_fn(|j| if i == j { 2 } else { 0 });
    let mut terms: Vec<_> = (0..3).map(|i| (axis(i), coefficients[i])).collect();
    terms.push(([0, 0, 0], constant));
    Polynomial::new(terms)
}

fn ball_of(coefficients: [f64; 3], constant: f64, linear: Matrix3<f64>) -> Result<Body, BodyError> {
    let polynomial = square(coefficients, constant).expect("finite");
    let matrix = DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(3, coefficients.iter().map(|c| 2.0 * c)));
    let gram = HessianGram::new(HessianGram::full_basis(2), matrix).expect("well formed");
    Body::new("ball", Normalization { center: Vector3::zeros(), linear }, vec![Constraint { polynomial, gram }])
}

/// Ill-conditioned data: min p = 1 - 1e-12, radius 1e-8, coefficients 1e±12, perturbed Gram, NaN,
/// non-orthonormal rotation: rejected or flagged.
#[test]
fn family_25_ill_conditioned_data() {
    // Too shallow to be distinguished from empty.
    assert!(matches!(ball_of([1.0; 3], 1.0 - 1e-12, Matrix3::identity()), Err(BodyError::Interior { .. })));
    // A radius of 1e-8 and coefficients of 1e±12 are refused, or served within their bracket.
    let partner = e(1.0, 0.5, 0.7);
    let small_ball = Body::ball("small", Vector3::zeros(), 1e-8);
    let bodies = [
        small_ball,
        ball_of([1e12; 3], 0.0, Matrix3::identity()),
        ball_of([1e-12; 3], 0.0, Matrix3::identity()),
        ball_of([1e12, 1.0, 1e-12], 0.0, Matrix3::identity()),
        ball_of([1.0; 3], 0.0, Matrix3::from_diagonal(&Vector3::new(1e8, 1.0, 1e-4))),
    ];
    for (k, body) in bodies.iter().enumerate() {
        let Ok(body) = body else {
            println!("{k}: {}", body.as_ref().unwrap_err());
            continue;
        };
        for seed in 0..5 {
            let mut random = Seeded(250_000 + seed);
            let reach = 2.0 * random.positive() + 1.5 * body.circumscribed().radius;
            let (pose_a, pose_b) = (random.pose(0.1), random.pose(reach));
            let label = format!("body {k} seed {seed}");
            judged((body, &pose_a), (&partner, &pose_b), &Options::default(), &label);
            judged_level((body, &pose_a), (&partner, &pose_b), &Options::default(), &label);
            judged_level((&partner, &pose_b), (body, &pose_a), &Options::default(), &label);
        }
    }
    // A Gram matrix that is off.
    let polynomial = square([1.0; 3], 0.0).unwrap();
    for off in [1e-3, 1.0, -1.0, 3.0] {
        let mut matrix = DMatrix::identity(3, 3) * 2.0;
        matrix[(0, 0)] += off;
        let gram = HessianGram::new(HessianGram::full_basis(2), matrix).unwrap();
        let made = Body::new(
            "off",
            Normalization { center: Vector3::zeros(), linear: Matrix3::identity() },
            vec![Constraint { polynomial: polynomial.clone(), gram }],
        );
        // The smallest eigenvalue pays for a small residual, never for a gross one.
        assert!(made.is_ok() == (off == 1e-3 || off == 1.0), "{off}: {made:?}");
    }
    assert!(matches!(square([f64::NAN, 1.0, 1.0], 0.0), Err(PolynomialError::NotFinite { .. })));
    assert!(matches!(square([f64::INFINITY, 1.0, 1.0], 0.0), Err(PolynomialError::NotFinite { .. })));
    for bad in [f64::NAN, f64::INFINITY, 0.0, -1.0] {
        assert!(Body::ball("bad", Vector3::zeros(), bad).is_err());
        assert!(Body::cuboid("bad", Vector3::new(1.0, bad, 1.0)).is_err());
        assert!(Body::cylinder("bad", 1.0, bad).is_err());
        assert!(Body::ball("bad", Vector3::new(bad, 0.0, 0.0), 1.0).is_err() || bad.abs() <= 1.0);
        assert!(Options::default().with_accuracy(bad).is_err());
    }
    assert!(matches!(Options::default().with_max_iterations(0), Err(OptionsError::Iterations(0))));
    let none = Vector3::zeros();
    for quaternion in [[f64::NAN, 0.0, 0.0, 1.0], [0.0; 4], [0.0, 0.0, 0.0, 1.001], [f64::INFINITY, 0.0, 0.0, 0.0]] {
        assert!(Pose::from_quaternion(none, quaternion).is_err());
    }
    assert!(matches!(
        Pose::from_quaternion(Vector3::new(0.0, f64::NAN, 0.0), [0.0, 0.0, 0.0, 1.0]),
        Err(PoseError::NotFinite { .. })
    ));
    let sheared = Matrix3::new(1.0, 1e-3, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0);
    for matrix in
        [sheared, Matrix3::identity() * 1.01, -Matrix3::identity(), Matrix3::zeros(), Matrix3::repeat(f64::NAN)]
    {
        assert!(Pose::from_matrix(&matrix, none).is_err());
    }
    // Deviations that are taken are removed, not carried along.
    let nearly =
        UnitQuaternion::from_scaled_axis(Vector3::new(0.3, 0.2, 0.1)).to_rotation_matrix().into_inner() * (1.0 + 1e-7);
    let (a, b) = (p(4, 0.5), b(0.3, 0.2, 0.4));
    let pose_a = Pose::from_matrix(&nearly, Vector3::new(2.0, 0.0, 0.0)).unwrap();
    judged((&a, &pose_a), (&b, &Pose::identity()), &Options::default(), "nearly orthonormal");
}
