//! Impacts against closed forms, samples and planes.

use super::*;
use crate::body::{Body, Compound};
use crate::measure::tests::{random_pose, zoo};
use crate::measure::{Options, Pose, WarmStart, distance};
use nalgebra::Vector3;
use std::sync::atomic::AtomicBool;
use sublevel_testkit::Seeded;

fn at(x: Vector3<f64>) -> Pose {
    Pose::from_quaternion(x, [0.0, 0.0, 0.0, 1.0]).unwrap()
}

fn gliding(start: Vector3<f64>, velocity: Vector3<f64>) -> Motion {
    Motion::new(at(start), velocity, Vector3::zeros(), start).unwrap()
}

#[test]
fn balls_meet_when_the_closed_form_says() {
    let (a, b) = (Body::ball("a", Vector3::zeros(), 0.3).unwrap(), Body::ball("b", Vector3::zeros(), 0.7).unwrap());
    let mut queries = [0_u32; 500];
    for seed in 0..500 {
        let mut random = Seeded(seed);
        let d = random.unit();
        let side = d.cross(&random.unit()).normalize();
        // Head on to past each other; grazing by a billionth on purpose.
        let aside = [0.0, 0.6, 0.99, 1.0 - 1e-9, 1.0 + 1e-9, 1.01][(seed % 6) as usize];
        let speed = 10_f64.powf(2.0 * random.signed());
        let drift = random.unit() * speed * 3.0;
        let origin = random.unit() * 10.0;
        let back = 2.0 + random.signed();
        let (one, other) = (gliding(origin, d * speed + drift), gliding(origin + d * back + side * aside, drift));
        let options = ImpactOptions::new(10.0 / speed).unwrap().with_contact(1e-10).unwrap();
        let found = time_of_impact(&a, &one, &b, &other, &options);
        let contact = 1e-10 * 0.3 * 1.03;
        let truth = |reach: f64| (back - (reach * reach - aside * aside).sqrt()) / speed;
        let label = format!("seed {seed} aside {aside}: {found:?} against {}", truth(1.0));
        queries[seed as usize] = found.queries;
        if aside > 1.0 {
            assert_eq!(found.status, ImpactStatus::Apart, "{label}");
        } else {
            assert_eq!(found.status, ImpactStatus::Contact, "{label}");
            // Not late, and no earlier than the contact distance explains.
            assert!(found.time <= truth(1.0), "{label}");
            assert!(found.time >= truth(1.0 + contact) - 1e-13 / speed, "{label}");
        }
    }
    queries.sort_unstable();
    assert!(queries[250] <= 20, "median {}, most {}", queries[250], queries[499]);
}

#[test]
fn a_blade_strikes_when_the_closed_form_says() {
    let blade = Body::cuboid("blade", Vector3::new(2.0, 0.02, 0.1)).unwrap();
    let ball = Body::ball("ball", Vector3::zeros(), 0.05).unwrap();
    let mut queries = Vec::new();
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let (place, rate) = (1.0 + 0.9 * random.signed().abs(), 10_f64.powf(2.0 * random.signed()));
        let turn = 0.3 + 2.4 * random.signed().abs();
        // The ball lies at an angle `turn` ahead; the blade's face meets it where place · sin =
        // 0.02 + 0.05.
        let pose = at(Vector3::new(place * turn.cos(), place * turn.sin(), 0.03 * random.signed()));
        let spin = Motion::new(Pose::identity(), Vector3::zeros(), Vector3::z() * rate, Vector3::zeros()).unwrap();
        let truth = (turn - (0.07 / place).asin()) / rate;
        let found =
            time_of_impact(&blade, &spin, &ball, &Motion::still(pose), &ImpactOptions::new(9.0 / rate).unwrap());
        let label = format!("seed {seed}: {found:?} against {truth}");
        assert_eq!(found.status, ImpactStatus::Contact, "{label}");
        assert!(found.time <= truth && found.time > truth - 2e-6 / rate, "{label}");
        queries.push(found.queries);
    }
    queries.sort_unstable();
    assert!(queries[100] <= 20, "median {}, most {}", queries[100], queries[199]);
}

#[test]
fn a_tip_grazes_by_a_billionth() {
    let blade = Body::ellipsoid("blade", Vector3::zeros(), Vector3::new(2.0, 0.02, 0.1)).unwrap();
    let ball = Body::ball("ball", Vector3::zeros(), 0.05).unwrap();
    let mut most = 0;
    for seed in 0..100 {
        let mut random = Seeded(seed);
        let (rate, turn) = (10_f64.powf(2.0 * random.signed()), 0.3 + 2.4 * random.signed().abs());
        let spin = Motion::new(Pose::identity(), Vector3::zeros(), Vector3::z() * rate, Vector3::zeros()).unwrap();
        let options = ImpactOptions::new(6.0 / rate).unwrap().with_contact(1e-9).unwrap();
        for (gap, status) in [(-1e-9, ImpactStatus::Contact), (1e-9, ImpactStatus::Apart)] {
            let pose = at(Vector3::new(turn.cos(), turn.sin(), 0.0) * (2.05 + gap));
            let found = time_of_impact(&blade, &spin, &ball, &Motion::still(pose), &options);
            let label = format!("seed {seed} gap {gap}: {found:?}");
            assert_eq!(found.status, status, "{label}");
            // Contact is where the tip is, or where it will be half a turn later.
            let tips = [turn, turn - std::f64::consts::PI].map(|angle| angle / rate);
            assert!(
                gap > 0.0 || tips.iter().any(|tip| found.time <= *tip && found.time > tip - 1e-3 / rate),
                "{label}"
            );
            most = most.max(found.queries);
        }
    }
    assert!(most <= 300, "{most}");
}

#[test]
fn nothing_tunnels_through_a_slab() {
    let slab = Body::cuboid("slab", Vector3::new(0.005, 2.0, 2.0)).unwrap();
    let bodies = [
        Body::ball("ball", Vector3::zeros(), 0.02).unwrap(),
        Body::cuboid("brick", Vector3::new(0.01, 0.02, 0.03)).unwrap(),
        Body::superellipsoid("q8", Vector3::zeros(), Vector3::new(0.01, 0.02, 0.03), 8).unwrap(),
        Body::ellipsoid("needle", Vector3::zeros(), Vector3::new(0.1, 0.001, 0.001)).unwrap(),
    ];
    for seed in 0..200 {
        let mut random = Seeded(seed);
        let body = &bodies[(seed % 4) as usize];
        let start = random_pose(&mut random, 0.0);
        let start = Pose::from_quaternion(
            Vector3::new(-10.0, random.signed(), random.signed()),
            start.rotation().coords.into(),
        )
        .unwrap();
        let spin = if seed % 3 == 0 { Vector3::zeros() } else { random.unit() * 30.0 };
        let shot = Motion::new(start, Vector3::new(100.0, 0.0, 0.0), spin, *start.translation()).unwrap();
        let still = Motion::still(Pose::identity());
        let found = time_of_impact(body, &shot, &slab, &still, &ImpactOptions::new(1.0).unwrap());
        let label = format!("seed {seed} {}: {found:?}", body.name());
        assert_eq!(found.status, ImpactStatus::Contact, "{label}");
        never_late((body, &shot), (&slab, &still), &found, &label);
        assert!(found.queries <= 60, "{label}");
    }
}

/// Dense sampling before the impact finds no contact, and at the impact the bodies are close.
fn never_late((a, motion_a): (&Body, &Motion), (b, motion_b): (&Body, &Motion), found: &Impact, label: &str) {
    let mut warm = WarmStart::default();
    let contact = 1e-6 * a.circumscribed().radius.min(b.circumscribed().radius);
    let mut at = |t: f64| distance(a, &motion_a.pose(t), b, &motion_b.pose(t), &Options::default(), &mut warm);
    for k in 0..200 {
        let t = found.time * (1.0 - f64::from(k) / 200.0) * (1.0 - 1e-15);
        let sampled = at(t);
        assert!(sampled.upper > 0.4 * contact || found.time == 0.0, "{label}: at {t} already {sampled:?}");
    }
    if found.status == ImpactStatus::Contact {
        assert!(at(found.time).upper <= contact * (1.0 + 1e-3), "{label}: only {:?}", at(found.time));
    }
}

#[test]
fn random_motions_are_never_late() {
    let zoos: Vec<_> = (0..5).map(|seed| zoo(&mut Seeded(seed))).collect();
    let (mut queries, mut hits) = (Vec::new(), 0);
    for seed in 0..400 {
        let mut random = Seeded(40_000 + seed);
        let bodies = &zoos[(seed % 5) as usize];
        let (a, b) = (&bodies[random.next() as usize % bodies.len()], &bodies[random.next() as usize % bodies.len()]);
        let reach = a.circumscribed().radius + b.circumscribed().radius;
        let motion = |random: &mut Seeded, start: Pose, towards: Vector3<f64>| {
            let spin = random.unit() * 2.0 * random.signed();
            let center = start.translation() + random.unit() * reach * 0.3;
            Motion::new(start, towards, spin, center).unwrap()
        };
        let far = reach * 2.5;
        let (pose_a, pose_b) = (random_pose(&mut random, 0.3), random_pose(&mut random, far));
        let aim = (pose_a.translation() - pose_b.translation()) + random.unit() * reach * 0.7;
        let (one, other) = (motion(&mut random, pose_a, Vector3::zeros()), motion(&mut random, pose_b, aim));
        let found = time_of_impact(a, &one, b, &other, &ImpactOptions::new(2.0).unwrap());
        let label = format!("seed {seed} {}-{}: {found:?}", a.name(), b.name());
        assert_ne!(found.status, ImpactStatus::Stopped, "{label}");
        never_late((a, &one), (b, &other), &found, &label);
        hits += u32::from(found.status == ImpactStatus::Contact);
        queries.push(found.queries);
    }
    queries.sort_unstable();
    assert!(hits > 150 && queries[200] <= 20 && queries[399] <= 200, "{hits} hits, queries {queries:?}");
}

#[test]
fn compounds_meet_with_their_first_part() {
    let at = |x: f64| Body::ball("part", Vector3::new(x, 0.0, 0.0), 1.0).unwrap();
    let row = Compound::new("row", vec![at(10.0), at(0.0), at(5.0)]).unwrap();
    let ball = at(0.0);
    let still = Motion::still(Pose::identity());
    for (start, velocity, truth) in [
        (Vector3::new(20.0, 0.0, 0.0), -Vector3::x(), 8.0),
        (Vector3::new(-20.0, 0.0, 0.0), Vector3::x(), 18.0),
        (Vector3::new(5.0, 30.0, 0.0), -Vector3::y(), 28.0),
    ] {
        let found = time_of_impact(&row, &still, &ball, &gliding(start, velocity), &ImpactOptions::new(50.0).unwrap());
        assert!(found.status == ImpactStatus::Contact && found.time <= truth, "{found:?}");
        assert!(found.time > truth - 1e-5, "{found:?}");
    }
    let past = gliding(Vector3::new(20.0, 2.001, 0.0), -Vector3::x());
    let found = time_of_impact(&row, &still, &ball, &past, &ImpactOptions::new(50.0).unwrap());
    assert_eq!(found.status, ImpactStatus::Apart, "{found:?}");
}

#[test]
fn starts_limits_and_nonsense() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let still = Motion::still(Pose::identity());
    let one = |start: f64, speed: f64, options: &ImpactOptions<'_>| {
        time_of_impact(&ball, &still, &ball, &gliding(Vector3::x() * start, Vector3::x() * speed), options)
    };
    let second = ImpactOptions::new(1.0).unwrap();
    let found = one(1.5, 0.0, &second);
    assert!(found.status == ImpactStatus::Contact && found.time == 0.0, "{found:?}");
    assert_eq!(one(3.0, 0.0, &second).status, ImpactStatus::Apart);
    assert_eq!(one(3.0, 5.0, &second).status, ImpactStatus::Apart);
    assert_eq!(one(3.0, 0.0, &ImpactOptions::new(0.0).unwrap()).status, ImpactStatus::Apart);
    let found = one(3.0, -5.0, &second.with_max_queries(1).unwrap());
    assert!(found.status == ImpactStatus::Stopped && found.time <= 0.2, "{found:?}");
    let stop = AtomicBool::new(true);
    let found = one(3.0, -5.0, &second.with_stop(&stop));
    assert!(found.status == ImpactStatus::Stopped && found.time == 0.0, "{found:?}");
    // Overflowing motions end without an answer and without a panic.
    let found = one(3.0, -1e15, &ImpactOptions::new(1e300).unwrap());
    assert!(found.status != ImpactStatus::Apart && found.time <= 1e-15, "{found:?}");
    for bad in [-1.0, f64::NAN, f64::INFINITY] {
        assert!(ImpactOptions::new(bad).is_err() && second.with_contact(bad).is_err());
    }
    assert!(second.with_max_queries(0).is_err() && second.with_max_queries(MAX_QUERIES + 1).is_err());
}
