use super::*;
use crate::body::Body;
use crate::measure::solver::stages::{Stage, asked};
use crate::measure::tests::edges::cut;
use crate::measure::tests::{random_pose, twisted, zoo};
use crate::measure::{Decision, Status, Twist, distance_to_point};
use nalgebra::Vector3;
use sublevel_testkit::Seeded;

/// The distance of a body from the axis by golden sections, which use no derivatives.
fn brute_force(body: &Body, pose: &Pose, capsule: &Capsule, capsule_pose: &Pose) -> f64 {
    let axis = capsule_pose.transform_direction(&Vector3::z());
    let mut warm = WarmStart::default();
    let mut at = |t: f64| {
        let point = capsule_pose.translation() + axis * t;
        distance_to_point(body, pose, &point, &Options::default(), &mut warm).unwrap().upper
    };
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (-capsule.half_height_m(), capsule.half_height_m());
    for _ in 0..60 {
        let (p, q) = (high - golden * (high - low), low + golden * (high - low));
        if at(p) <= at(q) { high = q } else { low = p }
    }
    at(0.5 * (low + high)) - capsule.radius_m()
}

fn random_capsule(random: &mut Seeded, size: f64) -> Capsule {
    let mut length = || size * 10_f64.powf(random.signed() - 0.5);
    let (radius, half) = (length(), length());
    match random.next() % 6 {
        0 => Capsule::new(0.0, half),
        1 => Capsule::new(radius, 0.0),
        2 => Capsule::new(0.0, 0.0),
        _ => Capsule::new(radius, half),
    }
    .unwrap()
}

#[test]
fn capsules_are_as_far_as_points_of_their_axes() {
    let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
    let (mut apart, mut deep) = (0, 0);
    for seed in 0..1200 {
        let mut random = Seeded(81_000 + seed);
        let bodies = &zoos[(seed % 6) as usize];
        let body = &bodies[random.next() as usize % bodies.len()];
        let size = body.circumscribed().radius;
        let capsule = random_capsule(&mut random, size);
        let pose = random_pose(&mut random, 1.0);
        let middle = pose.transform_point(&body.circumscribed().center);
        let far = (size + capsule.reach_m()) * (0.2 + random.signed().abs());
        let turned = random_pose(&mut random, 0.0);
        let capsule_pose = turned.with_translation(middle + random.unit() * far);
        let truth = brute_force(body, &pose, &capsule, &capsule_pose);
        let mut warm = WarmStart::default();
        for round in 0..2 {
            let found = distance_to_capsule(body, &pose, &capsule, &capsule_pose, &Options::default(), &mut warm);
            let label = format!("seed {seed}, {}, {capsule:?}, round {round}: {found:?}, {truth}", body.name());
            let slack = 1e-7 * size;
            // Of balls depths are known beyond that.
            assert!(found.lower <= truth + slack, "{label}");
            if truth > slack - capsule.radius_m() {
                apart += 1;
                assert!(found.status == Status::Converged, "{label}");
                assert!(truth - slack <= found.upper && found.upper - truth < slack, "{label}");
                let n = found.normal.expect("the axis is outside");
                let along = (found.witness - found.witness_of_capsule).dot(&n);
                assert!((along - found.upper).abs() < slack, "{label}");
            } else if capsule.radius_m() > 0.0 && found.upper == -capsule.radius_m() {
                deep += 1;
                assert!(found.lower == f64::NEG_INFINITY && found.normal.is_none(), "{label}");
            }
        }
    }
    assert!(apart > 1200 && deep > 50, "{apart} {deep}");
}

#[test]
fn gradients_of_capsules_are_differences() {
    let egg = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 1.0, 0.8)).unwrap();
    let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.5, 0.7)).unwrap();
    let options = Options::default().with_accuracy(1e-12).unwrap();
    let mut count = 0;
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let body = if seed % 2 == 0 { &egg } else { &crate_ };
        let capsule = Capsule::new(0.4, 0.5).unwrap();
        let (pose, capsule_pose) = (random_pose(&mut random, 1.0), random_pose(&mut random, 2.2));
        let at = |pose: &Pose, capsule_pose: &Pose| {
            distance_to_capsule(body, pose, &capsule, capsule_pose, &options, &mut WarmStart::default())
        };
        let Some([of_body, of_capsule]) = at(&pose, &capsule_pose).gradients(&pose, &capsule_pose) else {
            continue;
        };
        for axis in 0..3 {
            let e = Vector3::ith(axis, 1.0);
            for turn in [false, true] {
                let part = |twist: &Twist| if turn { twist.angular[axis] } else { twist.linear[axis] };
                let h = 1e-5;
                let of = |step: f64| at(&twisted(&pose, &e, turn, step), &capsule_pose).value();
                let other = |step: f64| at(&pose, &twisted(&capsule_pose, &e, turn, step)).value();
                let slopes = [(of(h) - of(-h)) / (2.0 * h), (other(h) - other(-h)) / (2.0 * h)];
                let expected = [part(&of_body), part(&of_capsule)];
                // Where the nearest feature of a box changes, the second derivative jumps.
                assert!((0..2).all(|i| (slopes[i] - expected[i]).abs() < 1e-4), "seed {seed}: {slopes:?} {expected:?}");
            }
        }
        count += 1;
    }
    assert!(count > 100, "{count}");
}

#[test]
fn sizes_of_capsules_are_checked() {
    for bad in [-1.0, f64::NAN, f64::INFINITY, 1e16] {
        assert!(Capsule::new(bad, 1.0).is_err() && Capsule::new(1.0, bad).is_err());
    }
    // From needles to planets.
    for (radius, half) in [(1e-9, 1e3), (1e6, 1e-9), (0.0, 0.0), (1e9, 1e9)] {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let capsule = Capsule::new(radius, half).unwrap();
        let pose = Pose::from_quaternion(Vector3::new(3.0 + radius, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
        let found = distance_to_capsule(
            &ball,
            &Pose::identity(),
            &capsule,
            &pose,
            &Options::default(),
            &mut WarmStart::default(),
        );
        assert!(found.lower <= 2.0 && 2.0 <= found.upper, "{radius} {half}: {found:?}");
    }
}

/// Beside bodies with several constraints the projection of the axis has the answer, and hardly
/// ever the distances of single points of it.
#[test]
fn capsules_beside_edged_bodies_are_solved_at_once() {
    let bodies: Vec<_> = (0..30).map(|seed| cut(&mut Seeded(seed))).collect();
    let (mut along_axis, mut undecided, mut count) = (0, 0, 0);
    for seed in 0..1500 {
        let mut random = Seeded(95_000 + seed);
        let body = &bodies[random.next() as usize % bodies.len()];
        let size = body.circumscribed().radius;
        let capsule = random_capsule(&mut random, size);
        let far = (size + capsule.reach_m()) * 2_f64.powf(random.signed());
        let (pose, capsule_pose) = (random_pose(&mut random, 0.1 * size), random_pose(&mut random, far));
        let options = Options::default();
        let (found, mut stages) =
            asked(|| distance_to_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default()));
        along_axis += u32::from(stages.any(|stage| stage == Stage::AlongAxis));
        let (contact, mut stages) =
            asked(|| overlap_with_capsule(body, &pose, &capsule, &capsule_pose, &options, &mut WarmStart::default()));
        undecided += u32::from(stages.any(|stage| stage == Stage::AlongAxis));
        match contact {
            Decision::Yes => assert!(found.lower <= 0.0, "seed {seed}: {found:?}"),
            Decision::No => assert!(found.upper > 0.0, "seed {seed}: {found:?}"),
            Decision::Undecided { .. } => assert!(found.lower <= 0.0 && found.upper > 0.0, "seed {seed}: {found:?}"),
        }
        count += 1;
    }
    println!("along the axis {along_axis} distances and {undecided} decisions of {count}");
    assert!(along_axis < count / 50 && undecided < count / 100, "{along_axis}, {undecided} of {count}");
}

/// A segment without a radius that leads through a body overlaps it, far from its inscribed ball,
/// too; and axes too short for their square to be a number are points.
#[test]
fn segments_through_edges_overlap_and_the_shortest_are_points() {
    let body = cut(&mut Seeded(3));
    let segment = Capsule::new(0.0, 5.0).unwrap();
    let (mut overlaps, mut count) = (0, 0);
    for seed in 0..400 {
        let mut random = Seeded(96_000 + seed);
        // Through a point of the body near its surface.
        let support = body.support(&random.unit()).point;
        let inside = body.interior_point().lerp(&support, 0.99);
        let turned = random_pose(&mut random, 0.0);
        let pose = turned.with_translation(inside);
        let options = Options::default();
        let found =
            overlap_with_capsule(&body, &Pose::identity(), &segment, &pose, &options, &mut WarmStart::default());
        count += 1;
        overlaps += u32::from(found == Decision::Yes);
        assert_ne!(found, Decision::No, "seed {seed}");

        let (tiny, ball) = (Capsule::new(0.1, 1e-170).unwrap(), Capsule::new(0.1, 0.0).unwrap());
        let pose = turned.with_translation(inside + random.unit() * 4.0);
        let [one, other] = [tiny, ball].map(|capsule| {
            distance_to_capsule(&body, &Pose::identity(), &capsule, &pose, &options, &mut WarmStart::default())
        });
        assert_eq!(one.status, Status::Converged, "seed {seed}");
        assert!((one.upper - other.upper).abs() < 1e-9 && one.iterations <= other.iterations + 2, "seed {seed}");
    }
    assert!(overlaps > count * 9 / 10, "{overlaps} of {count}");
}
