//! Families about limits, hints and bad input: 2, 18, 25.

use crate::judge::{judged, judged_level, options_of, plain, small, verdict, warm};
use nalgebra::UnitQuaternion;
use std::sync::atomic::AtomicBool;
use sublevel_core::measure::{
    Distance, Options, Pose, Status, WarmStart, distance, distance_batch, growth_distance, level_distance,
};
use sublevel_testkit::bodies::{fitted, zoo};
use sublevel_testkit::catalogue::data::{EXTREMES, KINDS, attempts, extreme, nearly_orthonormal};
use sublevel_testkit::catalogue::limits::{Hints, LIMITS, bad_hints, few_iterations};
use sublevel_testkit::random::{Seeded, draws, pose};
use sublevel_testkit::reference;

/// Iteration limit passed off as an answer: limit 1, 2, 3: status not converged and the bracket
/// still contains the truth.
#[test]
fn family_02_iteration_limit() {
    let zoo = zoo();
    let (mut wide, mut narrow) = (0, 0);
    for seed in 20_000..20_200 {
        for limit in LIMITS {
            let case = few_iterations(limit, &zoo, &mut Seeded(seed));
            let ((a, pose_a), (b, pose_b)) = case.placed();
            let label = format!("seed {seed} {}", case.what);
            let full = plain((a, pose_a), (b, pose_b), &Options::default(), &label);
            let full_level = level_distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default());
            // The limit and a true status are part of every verdict.
            let options = options_of(&case);
            let answer = plain((a, pose_a), (b, pose_b), &options, &label);
            // The reference needs a start near the solution, which is what the limit denies.
            let truth = reference::distance(a, pose_a, b, pose_b, &full);
            assert!(truth.width() <= 1e-16 * small(a, b) && truth.inside(&answer), "{label}: {answer:?}");
            let level = level_distance(a, pose_a, b, pose_b, &options, &mut WarmStart::default());
            let truth_of_level = reference::level_distance(a, pose_a, b, pose_b, &full_level);
            let sharp = 1e-12 * truth_of_level.value().abs().max(1.0);
            assert!(truth_of_level.width() <= sharp && truth_of_level.inside(&level), "{label}: {level:?}");
            assert!(level.iterations <= limit, "{label}: {level:?}");
            *(if answer.status == Status::BracketWide { &mut wide } else { &mut narrow }) += 1;

            let stop = AtomicBool::new(true);
            let options = Options::default().with_stop(&stop);
            let answer = plain((a, pose_a), (b, pose_b), &options, &format!("{label} stopped"));
            assert!(truth.inside(&answer), "{label} stopped: {answer:?}");
            let level = level_distance(a, pose_a, b, pose_b, &options, &mut WarmStart::default());
            assert!(answer.iterations <= 1 && level.iterations <= 1, "stopped, yet {answer:?} {level:?}");
        }
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
    for seed in 180_000..180_200 {
        let Hints { case, sources } = bad_hints(&zoo, &mut Seeded(seed));
        let ((a, pose_a), (b, pose_b)) = case.placed();
        let options = Options::default();
        let (cold, _) = judged((a, pose_a), (b, pose_b), &options, &format!("seed {seed} cold"));
        let mut hints = Vec::new();
        for (p, pose_p, q, pose_q) in &sources {
            let mut hint = WarmStart::default();
            distance(p, pose_p, q, pose_q, &options, &mut hint);
            hints.push(hint);
            level_distance(p, pose_p, q, pose_q, &options, &mut hint);
            hints.push(hint);
        }
        let level = level_distance(a, pose_a, b, pose_b, &options, &mut WarmStart::default());
        for (k, hint) in hints.iter().enumerate() {
            let label = format!("seed {seed} hint {k} {hint:?}");
            let answer = warm((a, pose_a), (b, pose_b), &options, &mut hint.clone(), &label);
            verdict((a, pose_a), (b, pose_b), &answer, &label);
            assert_eq!(answer.status, Status::Converged, "{label}: {answer:?}");
            assert!(answer.lower <= cold.upper && cold.lower <= answer.upper, "{label}: {cold:?} {answer:?}");
            assert!((answer.value() - cold.value()).abs() <= 1e-9 * small(a, b), "{label}: {cold:?} {answer:?}");
            let again = level_distance(a, pose_a, b, pose_b, &options, &mut hint.clone());
            assert_eq!(again.status, Status::Converged, "{label}: {again:?}");
            assert!(again.lower <= level.upper && level.lower <= again.upper, "{label}: {level:?} {again:?}");
        }
    }
}

/// Ill-conditioned data: min p = 1 - 1e-12, radius 1e-8, coefficients 1e±12, perturbed Gram, NaN,
/// non-orthonormal rotation: rejected or flagged.
#[test]
fn family_25_ill_conditioned_data() {
    for attempt in (0..KINDS).flat_map(attempts) {
        assert!(attempt.is_right(), "{attempt:?}");
    }
    // A radius of 1e-8 and coefficients of 1e±12 are refused, or served within their bracket.
    for kind in 0..EXTREMES {
        for seed in 250_000..250_005 {
            let Some(case) = extreme(kind, &mut Seeded(seed)) else {
                println!("body {kind} is refused");
                continue;
            };
            let (a, b) = case.placed();
            let label = format!("body {kind} seed {seed}");
            judged(a, b, &Options::default(), &label);
            judged_level(a, b, &Options::default(), &label);
            judged_level(b, a, &Options::default(), &label);
        }
    }
    let case = nearly_orthonormal();
    let (a, b) = case.placed();
    judged(a, b, &Options::default(), &case.what);
}
