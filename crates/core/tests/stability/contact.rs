//! Families about touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use crate::judge::{all, judged, judged_level, large, plain, small, verdict};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{Distance, Options, Pose, Status};
use sublevel_testkit::bodies::{c, e, p, q};
use sublevel_testkit::random::{Seeded, at, pose, shifted, twisted};

/// Both signs of the gaps 0, 1 ulp of the offset, and 1e-15 to 1e-2, in increasing order.
fn gaps(offset: f64) -> Vec<f64> {
    let mut gaps: Vec<f64> = (2..=15).map(|k| -(10_f64.powi(-k))).collect();
    gaps.extend([-(offset.next_up() - offset), 0.0, offset.next_up() - offset]);
    gaps.extend((2..=15).rev().map(|k| 10_f64.powi(-k)));
    gaps.sort_by(f64::total_cmp);
    gaps
}

/// Kissing contact, sub-epsilon gap: sphere-E, Q8-Q8 coaxial, gap 0, ±1 ulp(L) .. ±1e-2: monotone,
/// error <= 1e-12, normal continuous.
#[test]
fn family_01_kissing_contact() {
    let pairs = [
        (e(0.5, 0.5, 0.5), e(1.0, 0.25, 2.0)),
        (e(1.0, 0.25, 2.0), e(0.5, 0.5, 0.5)),
        (q(8, 1.0, 0.5, 0.25), q(8, 0.5, 2.0, 1.0)),
        (q(8, 0.25, 1.0, 1.0), q(8, 0.25, 0.5, 0.125)),
    ];
    let options = Options::default().with_accuracy(1e-13).unwrap();
    for (a, b) in &pairs {
        for axis in 0..3 {
            let half = |body: &Body| 1.0 / body.normalization().linear[(axis, axis)];
            let offset = half(a) + half(b);
            let mut last: Option<Distance> = None;
            for gap in gaps(offset) {
                let direction = Vector3::from_fn(|i, _| if i == axis { offset + gap } else { 0.0 });
                let pose = pose(direction, &UnitQuaternion::identity());
                // The offset is rounded; what it is past the half-axes is exact.
                let exact = (pose.translation()[axis] - offset).max(0.0);
                let label = format!("axis {axis} gap {gap:e}");
                let answer = plain((a, &Pose::identity()), (b, &pose), &options, &label);
                verdict((a, &Pose::identity()), (b, &pose), &answer, &label);
                let label = format!("{label}: {}-{} {answer:?}", a.name(), b.name());
                assert!((answer.value() - exact).abs() <= 1e-12, "{label}");
                if let Some(last) = last {
                    assert!(last.value() <= answer.value() + 4.0 * f64::EPSILON * offset, "{label} after {last:?}");
                }
                if let Some(normal) = answer.normal {
                    let off = normal + Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
                    assert!(off.norm() <= 1e-6, "{label}");
                }
                last = Some(answer);
            }
        }
    }
}

/// Endless loops: parallel Q8 faces, gap 1e-3..1e-12, tilt 1e-9..1e-3 rad: caps hold.
#[test]
fn family_03_endless_loops() {
    let (a, b) = (q(8, 1.0, 1.0, 0.5), q(8, 0.75, 1.25, 0.5));
    for gap in (3..=12).map(|k| 10_f64.powi(-k)) {
        for tilt in [0.0, 1e-9, 1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3] {
            let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, 0.8 * tilt, 0.0));
            let pose = pose(Vector3::new(0.0, 0.0, 1.0 + gap), &tilted);
            // The caps are part of every verdict; here the answers are also to arrive.
            all((&a, &Pose::identity()), (&b, &pose), &format!("gap {gap:e} tilt {tilt:e}"));
        }
    }
}

/// Undefined normal at contact: touching pairs: normal = ±g/|g|; one-sided derivatives agree.
#[test]
fn family_08_normal_at_contact() {
    for seed in 0..60 {
        let mut random = Seeded(800 + seed);
        let zoo = [e(1.0, 0.6, 0.8), q(4, 0.5, 0.7, 0.9), c(4, 0.6, 0.4), p(6, 0.7), q(6, 0.3, 1.0, 0.6)];
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let (pose_a, far) = (random.pose(0.3), random.pose(4.0));
        let options = Options::default();
        let (first, _) = judged((a, &pose_a), (b, &far), &options, &format!("seed {seed} apart"));
        let normal = first.normal.expect("apart");
        // Nearer along the normal until they touch, from the outside.
        for gap in [1e-3, 1e-6, 1e-9, 1e-12] {
            let near = shifted(&far, normal * (first.upper - gap));
            let label = format!("seed {seed} gap {gap:e}");
            let options = Options::default().with_accuracy(1e-13).unwrap();
            let (answer, truth) = judged((a, &pose_a), (b, &near), &options, &label);
            let label = format!("{label}: {}-{} {answer:?}", a.name(), b.name());
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
                let moved = |from: &Pose, start: usize| twisted(from, k, start, h);
                let (pose_p, pose_q) = (moved(&pose_a, 0), moved(&near, 6));
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
    let pairs =
        [(q(8, 1.0, 1.0, 0.5), q(8, 0.75, 1.25, 0.5)), (q(8, 1.0, 1.0, 0.5), p(8, 0.5)), (p(8, 1.0), p(8, 1.0))];
    for (a, b) in &pairs {
        // In the direction z both kinds have a face of zero curvature, or nearly.
        let height = |body: &Body| body.boundary_along(&Vector3::z()).z;
        for tilt in [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2] {
            let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, -0.8 * tilt, 0.0));
            let pose = pose(Vector3::new(0.0, 0.0, height(a) + height(b) + 0.1), &tilted);
            for k in [4, 6, 8, 9, 10, 11, 12, 13, 14] {
                let accuracy = 10_f64.powi(-k);
                let options = Options::default().with_accuracy(accuracy).unwrap();
                let label = format!("tilt {tilt:e} accuracy {accuracy:e}");
                let (answer, truth) = judged((a, &Pose::identity()), (b, &pose), &options, &label);
                let label = format!("{label}: {}-{} {answer:?}", a.name(), b.name());
                // The floor that `with_accuracy` states for flat surfaces.
                let floor = 1e-12 * (large(a, b) + truth.value());
                let error = (answer.value() - truth.value()).abs();
                let wanted = accuracy * small(a, b);
                assert!(error <= wanted.max(floor), "{label}: error {error:e}");
                assert!(answer.status == Status::Converged || wanted < floor, "{label}");
            }
        }
    }
}

/// Stopping on small progress: Q8 tip against Q8 flat (linear-rate Newton): accept by bracket only.
/// Witnesses are certified, on the surfaces and as far apart as the answer says, never matched.
#[test]
fn family_14_small_progress() {
    let tips = [q(8, 0.1, 0.1, 1.0), q(8, 0.01, 0.02, 1.0), q(6, 0.05, 0.05, 1.0), q(4, 0.1, 0.05, 1.0)];
    let flats = [q(8, 1.0, 1.0, 0.1), q(8, 2.0, 1.0, 0.01), q(6, 1.0, 1.0, 0.05)];
    for (i, tip) in tips.iter().enumerate() {
        for (j, flat) in flats.iter().enumerate() {
            for (k, gap) in [1e-9, 1e-6, 1e-3, 0.3].into_iter().enumerate() {
                for aside in [0.0, 1e-6, 1e-3, 0.2] {
                    let mut random = Seeded((1000 * i + 100 * j + 10 * k) as u64);
                    let height = 1.0 + 1.0 / flat.normalization().linear[(2, 2)];
                    let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * random.signed());
                    let pose = pose(Vector3::new(aside, -0.5 * aside, height + gap), &turn);
                    let label = format!("gap {gap:e} aside {aside:e}");
                    let (answer, _) = all((flat, &Pose::identity()), (tip, &pose), &label);
                    let apart = (answer.witness_a - answer.witness_b).norm();
                    let label = format!("{label}: {}-{} {answer:?}", flat.name(), tip.name());
                    assert!(
                        apart <= answer.upper + 1e-14 && apart >= answer.lower - 1e-14,
                        "{label}: witnesses are {apart:e} apart"
                    );
                    let inside = |body: &Body, pose: &Pose, w: &Vector3<f64>| {
                        body.value(&pose.rotation().inverse_transform_vector(&(w - pose.translation())))
                    };
                    // A coordinate's rounding moves the value of the thinnest body by 8 of its
                    // relative errors.
                    let thin = 1e-16 * 8.0 / 0.01 * 4.0;
                    assert!(inside(flat, &Pose::identity(), &answer.witness_a) <= 1.0 + thin, "{label}");
                    assert!(inside(tip, &pose, &answer.witness_b) <= 1.0 + thin, "{label}");
                }
            }
        }
    }
}

/// Smooth shapes through polytope code: 20 cm E-E, C4-E, Q4-Q4 at ±2 mm: error <= 1e-10 m.
#[test]
fn family_15_smooth_shapes() {
    let pairs = [
        (e(0.2, 0.15, 0.1), e(0.1, 0.2, 0.12)),
        (c(4, 0.1, 0.2), e(0.2, 0.1, 0.15)),
        (q(4, 0.2, 0.1, 0.15), q(4, 0.1, 0.2, 0.2)),
    ];
    for (index, (a, b)) in pairs.iter().enumerate() {
        for seed in 0..20 {
            let mut random = Seeded(1500 + 100 * index as u64 + seed);
            let (pose_a, far) = (random.pose(0.1), random.pose(1.0));
            let (first, truth) = all((a, &pose_a), (b, &far), &format!("seed {seed} apart"));
            for gap in [2e-3, -2e-3] {
                let near = shifted(&far, truth.normal() * (first.upper - gap));
                let (answer, truth) = all((a, &pose_a), (b, &near), &format!("seed {seed} gap {gap:e}"));
                let error = (answer.value() - truth.value()).abs();
                assert!(
                    error <= 1e-10,
                    "seed {seed} gap {gap:e}: {}-{} {answer:?}: error {error:e}",
                    a.name(),
                    b.name()
                );
                assert!((truth.value() - gap.max(0.0)).abs() < 1e-9, "the pair was not moved to {gap:e}");
            }
        }
    }
    // Along an axis in closed form.
    let (a, b) = (q(4, 0.25, 0.125, 0.0625), q(4, 0.125, 0.25, 0.0625));
    let (answer, _) = all((&a, &Pose::identity()), (&b, &at(0.377, 0.0, 0.0)), "closed form");
    assert!((answer.value() - (0.377 - 0.375)).abs() <= 1e-10);
    let _ = judged_level((&a, &Pose::identity()), (&b, &at(0.373, 0.0, 0.0)), &Options::default(), "overlap");
}
