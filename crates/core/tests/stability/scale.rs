//! Families about sizes and units: 9, 10, 11, 12.

use crate::judge::{all, judged, judged_level, large, plain, small};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Pose, Status, WarmStart, level_distance};
use sublevel_testkit::bodies::{b, c, e, fitted, p, q};
use sublevel_testkit::random::{Seeded, pose, shifted};

/// Size ratio: ratio 1e1..1e6; error <= 1e-9 s_small + 64 eps s_large (circumradii).
#[test]
fn family_09_size_ratio() {
    for seed in 0..240 {
        let mut random = Seeded(90_000 + seed);
        let ratio = 10_f64.powi((seed % 6) as i32 + 1);
        let any = |random: &mut Seeded, s: f64| match random.index(5) {
            0 => e(s, 0.6 * s, 0.8 * s),
            1 => q(8, s, 0.5 * s, 0.7 * s),
            2 => p(6, s),
            3 => b(s, 0.4 * s, 0.6 * s),
            _ => c(4, s, 0.5 * s),
        };
        let (a, b) = (any(&mut random, 1.0), any(&mut random, 1.0 / ratio));
        let (a, b) = if seed % 2 == 0 { (a, b) } else { (b, a) };
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let (pose_a, far) = (random.pose(0.5), random.pose(2.5 * sum));
        let (first, truth) = judged((&a, &pose_a), (&b, &far), &Options::default(), &format!("seed {seed} apart"));
        let gap = [1.0, 1e-3, 1e-6, -0.1, 0.0][(seed / 6 % 5) as usize] * small(&a, &b);
        for pose_b in [far, shifted(&far, truth.normal() * (first.upper - gap))] {
            let label = format!("seed {seed} ratio {ratio:e} gap {gap:e}");
            // At ratios above 1e5 the default accuracy lies below the rounding floor: the error
            // counts, not the status.
            let (answer, truth) = judged((&a, &pose_a), (&b, &pose_b), &Options::default(), &label);
            judged_level((&a, &pose_a), (&b, &pose_b), &Options::default(), &label);
            judged_level((&b, &pose_b), (&a, &pose_a), &Options::default(), &label);
            let error = (answer.value() - truth.value()).abs();
            let bound = 1e-9 * small(&a, &b) + 64.0 * f64::EPSILON * large(&a, &b);
            assert!(error <= bound, "{label}: {}-{} {answer:?}: error {error:e} above {bound:e}", a.name(), b.name());
        }
    }
}

/// Far from the origin: both translated by 1..1e9 m: invariant up to c·eps·|T|.
#[test]
fn family_10_far_from_the_origin() {
    let bodies = [e(1.0, 0.6, 0.8), q(8, 0.5, 1.0, 0.7), b(0.5, 0.4, 0.3), p(6, 0.8), c(6, 0.4, 0.9)];
    for seed in 0..100 {
        let mut random = Seeded(100_000 + seed);
        let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
        let reach = random.positive() * 3.0 + 0.5;
        let (pose_a, pose_b) = (random.pose(0.5), random.pose(reach));
        let options = Options::default();
        let (near, _) = judged((a, &pose_a), (b, &pose_b), &options, &format!("seed {seed}"));
        let direction = random.unit();
        for k in 0..=9 {
            let length = 10_f64.powi(k);
            let (far_a, far_b) = (shifted(&pose_a, direction * length), shifted(&pose_b, direction * length));
            let label = format!("seed {seed} at {length:e}");
            // The poses round; about them as they are, the bracket is exact.
            let (far, _) = judged((a, &far_a), (b, &far_b), &options, &label);
            assert_eq!(far.status, Status::Converged, "{label}: {far:?}");
            let bound = 1e-9 * small(a, b) + 4.0 * f64::EPSILON * length;
            let change = (far.value() - near.value()).abs();
            assert!(change <= bound, "{label}: {}-{} {near:?} {far:?}: {change:e} above {bound:e}", a.name(), b.name());
        }
    }
}

/// The families' bodies at another scale.
fn scaled_pairs(s: f64) -> Vec<(Body, Body)> {
    vec![
        (e(s, 0.6 * s, 0.8 * s), e(0.3 * s, 0.9 * s, 0.5 * s)),
        (q(8, s, 0.5 * s, 0.7 * s), q(4, 0.4 * s, 0.5 * s, 0.3 * s)),
        (p(6, s), q(6, 0.5 * s, 0.6 * s, 0.7 * s)),
        (b(s, 0.4 * s, 0.6 * s), c(4, s, 0.5 * s)),
    ]
}

/// Units: everything scaled by 1e-9..1e9: d/s and iterations unchanged.
#[test]
fn family_11_units() {
    let ones = scaled_pairs(1.0);
    // The query frame is scaled by powers of two, so that scales of other factors round
    // differently: the count of iterations is compared where nothing rounds.
    let powers_of_two = [-29, -20, -9, -1, 4, 15, 29].map(|k| 2_f64.powi(k));
    for s in (-9..=9).map(|k| 10_f64.powi(k)).chain(powers_of_two) {
        let exact = powers_of_two.contains(&s);
        for (index, ((a, b), (one_a, one_b))) in scaled_pairs(s).iter().zip(&ones).enumerate() {
            for seed in 0..12 {
                let mut random = Seeded(110_000 + 100 * index as u64 + seed);
                let reach = 3.5 * random.positive();
                let (pose_a, pose_b) = (random.pose(0.5), random.pose(reach));
                let times = |from: &Pose| pose(from.translation() * s, from.rotation());
                let label = format!("scale {s:e} seed {seed}");
                let one = plain((one_a, &pose_a), (one_b, &pose_b), &Options::default(), &label);
                let (answer, _) = judged((a, &times(&pose_a)), (b, &times(&pose_b)), &Options::default(), &label);
                let label = format!("{label}: {}-{} {one:?} {answer:?}", a.name(), b.name());
                assert_eq!(answer.status, Status::Converged, "{label}");
                assert!((answer.value() / s - one.value()).abs() <= 1e-9 * small(one_a, one_b), "{label}");
                assert!(answer.iterations == one.iterations || !exact, "{label}");
                let level = |a, pose_a: &Pose, b, pose_b: &Pose| {
                    level_distance(a, pose_a, b, pose_b, &Options::default(), &mut WarmStart::default())
                };
                let one = level(one_a, &pose_a, one_b, &pose_b);
                let other = level(a, &times(&pose_a), b, &times(&pose_b));
                let label = format!("{label}: {one:?} {other:?}");
                assert!((other.value() - one.value()).abs() <= 1e-9 * one.value().abs().max(1.0), "{label}");
                assert!(other.iterations == one.iterations || !exact, "{label}");
            }
        }
    }
}

/// Needles and plates: aspect 1e2..1e5, slab 1e-3, needle against slab.
#[test]
fn family_12_needles_and_plates() {
    for k in 2..=5 {
        let aspect = 10_f64.powi(k);
        let thin = 1.0 / aspect;
        let needles = [
            e(thin, thin, 1.0),
            q(8, thin, thin, 1.0),
            q(4, thin, 2.0 * thin, 1.0),
            b(thin, thin, 1.0),
            c(6, thin, 1.0),
        ];
        let plates = [b(1.0, 1.0, 1e-3), q(8, 1.0, 1.0, thin), e(1.0, 1.0, thin), b(1.0, 0.5, thin), c(8, 1.0, thin)];
        for (i, needle) in needles.iter().enumerate() {
            for (j, plate) in plates.iter().chain(needles.iter().take(2)).enumerate() {
                for seed in 0..4 {
                    let mut random = Seeded((120_000 + 1000 * k as usize + 100 * i + 10 * j + seed) as u64);
                    let (pose_a, far) = (random.pose(0.2), random.pose(3.5));
                    let label = format!("aspect {aspect:e} seed {seed}");
                    let (first, truth) = judged((needle, &pose_a), (plate, &far), &Options::default(), &label);
                    assert_eq!(
                        first.status,
                        Status::Converged,
                        "{label}: {}-{} {first:?}",
                        needle.name(),
                        plate.name()
                    );
                    let gap = [1.0, 1e-3, 0.1 * thin, -0.1 * thin][seed];
                    let near = shifted(&far, truth.normal() * (first.upper - gap));
                    all((needle, &pose_a), (plate, &near), &format!("{label} gap {gap:e}"));
                }
                // Parallel to the plate, as needles lie on tables.
                let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::FRAC_PI_2);
                let flat = pose(Vector3::new(0.1, 0.2, 0.01), &lying);
                all((needle, &flat), (plate, &Pose::identity()), &format!("aspect {aspect:e} lying"));
            }
        }
    }
}

/// The fitted bodies take part in 9 to 12 with a small partner.
#[test]
fn fitted_bodies_against_small_and_thin() {
    for (i, body) in fitted().iter().enumerate() {
        for (j, other) in [e(1e-3, 1e-3, 1e-3), q(8, 1e-4, 1e-4, 0.3), b(1.0, 1.0, 1e-3)].iter().enumerate() {
            for seed in 0..6 {
                let mut random = Seeded((130_000 + 100 * i + 10 * j + seed) as u64);
                let reach = 2.0 * random.positive();
                let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
                let label = format!("seed {seed}");
                all((body, &pose_a), (other, &pose_b), &label);
                let _ = judged_level((body, &pose_a), (other, &pose_b), &Options::default(), &label);
            }
        }
    }
}
