//! Families about touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use crate::judge::{all_of, judged, judged_level, judged_of, large, plain, small, verdict};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Distance, Options, Pose, Status};
use sublevel_testkit::catalogue::contact::{
    KISSING, PARALLEL_FACES, PARALLEL_FLATS, SMOOTH, TIPS, TOUCHING, kissing, parallel_faces, parallel_flats, smooth,
    smooth_along_x, smooth_gap, tips, touching,
};
use sublevel_testkit::random::{Seeded, twisted};

/// Kissing contact, sub-epsilon gap: sphere-E, Q8-Q8 coaxial, gap 0, ±1 ulp(L) .. ±1e-2: monotone,
/// error <= 1e-12, normal continuous.
#[test]
fn family_01_kissing_contact() {
    for index in 0..KISSING {
        let mut last: Option<Distance> = None;
        for case in kissing(index, None) {
            let (a, b) = case.placed();
            let label = format!("index {index} {}", case.what);
            let options = Options::default().with_accuracy(case.accuracy).unwrap();
            let answer = plain(a, b, &options, &label);
            verdict(a, b, &answer, &label);
            let (exact, offset) = (case.exact.expect("known"), case.pose_b.translation());
            let label = format!("{label}: {answer:?}");
            assert!((answer.value() - exact).abs() <= 1e-12, "{label}");
            if let Some(last) = last {
                let slack = 4.0 * f64::EPSILON * offset.norm();
                assert!(last.value() <= answer.value() + slack, "{label} after {last:?}");
            }
            if let Some(normal) = answer.normal {
                assert!((normal + offset.normalize()).norm() <= 1e-6, "{label}");
            }
            last = Some(answer);
        }
    }
}

/// Endless loops: parallel Q8 faces, gap 1e-3..1e-12, tilt 1e-9..1e-3 rad: caps are kept.
#[test]
fn family_03_endless_loops() {
    for index in 0..PARALLEL_FACES {
        let case = parallel_faces(index);
        // The caps are part of every verdict; here the answers are also to arrive.
        all_of(&case, &case.what);
    }
}

/// Undefined normal at contact: touching pairs: normal = ±g/|g|; one-sided derivatives agree.
#[test]
fn family_08_normal_at_contact() {
    for seed in 800..860 {
        // From the outside. At no gap at all it is the signed distance that has slopes.
        for gap in TOUCHING.into_iter().filter(|gap| *gap > 0.0) {
            let case = touching(gap, &mut Seeded(seed));
            let ((a, pose_a), (b, near)) = case.placed();
            let label = format!("seed {seed} {}", case.what);
            let options = Options::default().with_accuracy(case.accuracy).unwrap();
            let (answer, truth) = judged((a, pose_a), (b, near), &options, &label);
            let label = format!("{label}: {answer:?}");
            if answer.upper == 0.0 {
                continue;
            }
            let n = answer.normal.unwrap_or_else(|| panic!("{label}: no normal"));
            assert!((n - truth.normal()).norm() <= 1e-6, "{label}: normal off {:?}", truth.normal());
            if gap < 1e-6 {
                continue;
            }
            // One-sided differences, away from contact.
            for k in 0..12 {
                let sign = if truth.gradient[k] < 0.0 { -1.0 } else { 1.0 };
                let h = 1e-4 * sign * gap.max(1e-4);
                let (pose_p, pose_q) = (twisted(pose_a, k, 0, h), twisted(near, k, 6, h));
                let (further, _) = judged((a, &pose_p), (b, &pose_q), &options, &label);
                let slope = (further.value() - answer.value()) / h;
                // Second derivatives are of order 1 / length; each value is known to its bracket.
                let known = (answer.upper - answer.lower + further.upper - further.lower) / h.abs();
                assert!(
                    (slope - truth.gradient[k]).abs() <= 1e-6 + 20.0 * h.abs() + known,
                    "{label}: {k}: {slope} {}",
                    truth.gradient[k]
                );
            }
        }
    }
}

/// Nearly parallel flats, tight tolerance: Q8/P8 faces, tilt 1e-12..1e-2, tolerance 1e-4..1e-14:
/// error falls to the stated rounding floor, beyond it the status says the bracket is still wide.
#[test]
fn family_13_parallel_flats() {
    for index in 0..PARALLEL_FLATS {
        let case = parallel_flats(index);
        let (answer, truth) = judged_of(&case, &case.what);
        let label = format!("{}: {answer:?}", case.what);
        // The floor that `with_accuracy` states for flat surfaces.
        let floor = 1e-12 * (large(&case.a, &case.b) + truth.value());
        let error = (answer.value() - truth.value()).abs();
        let wanted = case.accuracy * small(&case.a, &case.b);
        assert!(error <= wanted.max(floor), "{label}: error {error:e}");
        assert!(answer.status == Status::Converged || wanted < floor, "{label}");
    }
}

/// Stopping on small progress: Q8 tip against Q8 flat (linear-rate Newton): accept by bracket only.
/// Witnesses are certified, on the surfaces and as far apart as the answer says, never matched.
#[test]
fn family_14_small_progress() {
    for index in 0..TIPS {
        let case = tips(index, &mut Seeded(14_000 + index));
        let label = format!("index {index} {}", case.what);
        let (answer, _) = all_of(&case, &label);
        let label = format!("{label}: {answer:?}");
        let apart = (answer.witness_a - answer.witness_b).norm();
        let is_as_far = apart <= answer.upper + 1e-14 && apart >= answer.lower - 1e-14;
        assert!(is_as_far, "{label}: witnesses are {apart:e} apart");
        let level = |body: &Body, pose: &Pose, w: &Vector3<f64>| {
            body.value(&pose.rotation().inverse_transform_vector(&(w - pose.translation())))
        };
        // A coordinate's rounding moves the value of the thinnest body by 8 of its relative errors.
        let thin = 1e-16 * 8.0 / 0.01 * 4.0;
        assert!(level(&case.a, &case.pose_a, &answer.witness_a) <= 1.0 + thin, "{label}");
        assert!(level(&case.b, &case.pose_b, &answer.witness_b) <= 1.0 + thin, "{label}");
    }
}

/// Smooth shapes through polytope code: 20 cm E-E, C4-E, Q4-Q4 at ±2 mm: error <= 1e-10 m.
#[test]
fn family_15_smooth_shapes() {
    for index in 0..160 {
        let case = smooth(index, &mut Seeded(1500 + index));
        let label = format!("index {index} {}", case.what);
        let (answer, truth) = all_of(&case, &label);
        let error = (answer.value() - truth.value()).abs();
        assert!(error <= SMOOTH, "{label}: {answer:?}: error {error:e}");
        let off = (truth.value() - smooth_gap(index).max(0.0)).abs();
        assert!(off < 1e-9, "{label}: the pair is off its gap by {off:e}");
    }
    let [apart, overlap] = smooth_along_x();
    let (answer, _) = all_of(&apart, "closed form");
    assert!((answer.value() - apart.exact.expect("known")).abs() <= SMOOTH);
    let (a, b) = overlap.placed();
    let _ = judged_level(a, b, &Options::default(), "overlap");
}
