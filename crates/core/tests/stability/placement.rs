//! Families about where bodies stand: far apart, overlapping, aligned, concentric, swapped: 4, 5,
//! 6, 7, 19.

use crate::judge::{all, judged, plain};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{Options, Pose, Status, WarmStart, level_distance};
use sublevel_testkit::bodies::{b, c, cylinder, e, q, support, zoo};
use sublevel_testkit::random::{Seeded, at, pose};

/// Exactly 0 for bodies far apart: 1e6 random pairs: lower bound of the arbiter never exceeded.
///
/// The arbiter is the support gap in closed form over many directions.
#[test]
fn family_04_zero_far_apart() {
    let bodies: Vec<Body> = zoo().into_iter().filter(|body| !body.name().starts_with(['F', 'P'])).collect();
    let (mut apart, mut sharp) = (0, 0);
    for seed in 0..3000 {
        let mut random = Seeded(40_000 + seed);
        let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let reach = sum * random.between(0.2, 100.0);
        let (pose_a, pose_b) = (random.pose(1.0), random.pose(reach));
        let label = format!("seed {seed}");
        let answer = plain((a, &pose_a), (b, &pose_b), &Options::default(), &label);
        let label = format!("{label}: {}-{} {answer:?}", a.name(), b.name());
        assert_eq!(answer.status, Status::Converged, "{label}");
        let gap = |n: &Vector3<f64>| {
            let local = |pose: &Pose| pose.rotation().inverse_transform_vector(n);
            n.dot(&(pose_a.translation() - pose_b.translation()))
                - support(a, &-local(&pose_a))
                - support(b, &local(&pose_b))
        };
        let slack = 1e-14 * (reach + sum);
        let axis = (pose_a.translation() - pose_b.translation()).normalize();
        for k in 0..500 {
            let wide = if k == 0 { 0.0 } else { random.between(1e-6, 2.0) };
            let n = (axis + random.unit() * wide).normalize();
            assert!(gap(&n) <= answer.upper + slack, "{label}: gap {} along {n}", gap(&n));
        }
        if let Some(n) = answer.normal {
            apart += 1;
            assert!(gap(&n) <= answer.upper + slack, "{label}: gap {}", gap(&n));
            sharp += u32::from(gap(&n) >= answer.lower - slack);
        }
    }
    println!("{apart} apart, of which {sharp} have a normal that parts them by the lower bound");
    assert!(apart > 1000, "only {apart} apart");
}

/// A point of the body frame where the largest constraint is below `value`.
fn inner(body: &Body, random: &mut Seeded, value: f64) -> Vector3<f64> {
    loop {
        let x = body.boundary_along(&random.unit());
        let point = body.interior_point() + (x - body.interior_point()) * random.positive();
        if body.value(&point) < value {
            return point;
        }
    }
}

/// Overlap reported as separated: construct a common point with p1, p2 < 0.9.
#[test]
fn family_05_overlap_reported_as_separated() {
    let zoo = zoo();
    for seed in 0..1500 {
        let mut random = Seeded(50_000 + seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let (x, y) = (inner(a, &mut random, 0.9), inner(b, &mut random, 0.9));
        let (pose_a, turn) = (random.pose(0.5), random.rotation());
        let pose_b = pose(pose_a.transform_point(&x) - turn * y, &turn);
        let label = format!("seed {seed}");
        let answer = plain((a, &pose_a), (b, &pose_b), &Options::default(), &label);
        let label = format!("{label}: {}-{}", a.name(), b.name());
        assert!(answer.status == Status::Converged && answer.upper == 0.0, "{label}: {answer:?}");
        for (p, pose_p, q, pose_q) in [(a, &pose_a, b, &pose_b), (b, &pose_b, a, &pose_a)] {
            let level = level_distance(p, pose_p, q, pose_q, &Options::default(), &mut WarmStart::default());
            assert!(level.status == Status::Converged && level.upper < 0.9 + 1e-9, "{label}: {level:?}");
        }
    }
}

/// Axis-aligned, symmetric poses: identical bodies shifted along one axis, integer coordinates.
#[test]
fn family_06_axis_aligned() {
    let bodies = [
        e(1.0, 1.0, 1.0),
        e(2.0, 1.0, 3.0),
        q(4, 1.0, 2.0, 3.0),
        q(6, 2.0, 2.0, 2.0),
        q(8, 1.0, 1.0, 4.0),
        b(1.0, 2.0, 3.0),
        cylinder(1.0, 2.0),
        c(6, 1.0, 2.0),
    ];
    for body in &bodies {
        for axis in 0..3 {
            let along = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
            let half = support(body, &along);
            for shift in [-9.0, -5.0, -4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 100.0] {
                let shift_ = along * shift;
                let label = format!("{} axis {axis} shift {shift}", body.name());
                let exact = (f64::abs(shift) - 2.0 * half).max(0.0);
                let (answer, _) = all((body, &Pose::identity()), (body, &at(shift_.x, shift_.y, shift_.z)), &label);
                let error = (answer.value() - exact).abs();
                assert!(error <= 1e-9 * body.circumscribed().radius, "{label}: {answer:?} is off {exact} by {error:e}");
            }
        }
    }
}

/// Coincident centres: identical pose, then offsets 1e-18..1e-6: defined value, non-unique flag, no
/// NaN.
#[test]
fn family_07_coincident_centres() {
    let zoo = zoo();
    for (i, a) in zoo.iter().enumerate() {
        for (j, b) in zoo.iter().enumerate().filter(|(j, _)| (i + j) % 3 == 0) {
            let mut random = Seeded((100 * i + j) as u64);
            let pose_a = random.pose(0.0);
            for offset in [0.0, 1e-18, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9, 1e-6] {
                // Centres are the interior points: of fitted bodies they are not the origins.
                let meet = pose_a.transform_point(a.interior_point()) - pose_a.rotation() * b.interior_point();
                let pose_b = pose(meet + random.unit() * offset, pose_a.rotation());
                let label = format!("offset {offset:e}");
                let (answer, _) = all((a, &pose_a), (b, &pose_b), &label);
                assert!(
                    answer.upper == 0.0 && answer.normal.is_none(),
                    "{label}: {}-{} {answer:?}",
                    a.name(),
                    b.name()
                );
            }
        }
    }
}

/// Argument order, frame: swap; random rigid motion of both.
#[test]
fn family_19_argument_order() {
    let zoo = zoo();
    for seed in 0..300 {
        let mut random = Seeded(190_000 + seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let reach = sum * random.between(0.3, 5.0);
        let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
        let options = Options::default();
        let label = format!("seed {seed}");
        let (first, truth) = judged((a, &pose_a), (b, &pose_b), &options, &label);
        let (swapped, _) = judged((b, &pose_b), (a, &pose_a), &options, &label);
        let (turn, shift) = (random.rotation(), random.unit() * 3.0);
        let moved = |from: &Pose| {
            pose(turn * from.translation() + shift, &UnitQuaternion::new_normalize(*(turn * from.rotation())))
        };
        let (carried, _) = judged((a, &moved(&pose_a)), (b, &moved(&pose_b)), &options, &label);
        let width = 1e-9 * crate::judge::small(a, b);
        for (name, other, normal) in [
            ("swapped", swapped, swapped.normal.map(|n| -n)),
            ("carried", carried, carried.normal.map(|n| turn.inverse_transform_vector(&n))),
        ] {
            let label = format!("seed {seed} {name}: {}-{} {first:?} {other:?}", a.name(), b.name());
            assert_eq!(other.status, Status::Converged, "{label}");
            let floor = 1e-14 * (sum + shift.norm() + pose_b.translation().norm());
            assert!(other.lower <= first.upper + floor && first.lower <= other.upper + floor, "{label}");
            assert!((other.value() - first.value()).abs() <= width + floor, "{label}");
            if let (Some(n), Some(m)) = (first.normal, normal) {
                // The bracket holds the angle to its square root.
                assert!((n - m).norm() <= 1e-3 || truth.value() < 1e-6 * sum, "{label}");
            }
        }
    }
}
