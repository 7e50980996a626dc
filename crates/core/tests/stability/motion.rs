//! Families about motion: 22.

use crate::judge::small;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{
    Impact, ImpactOptions, ImpactStatus, Motion, Options, Pose, WarmStart, distance, time_of_impact,
};
use sublevel_testkit::bodies::{b, c, cylinder, e, q};
use sublevel_testkit::random::{Seeded, draws, pose};

/// Contact distance of these searches, relative to the smaller body.
const CONTACT: f64 = 1e-6;

fn gliding(start: Pose, velocity: Vector3<f64>) -> Motion {
    Motion::new(start, velocity, Vector3::zeros(), *start.translation()).expect("finite")
}

/// Whether the bodies are proven to overlap at a time.
fn overlap((a, one): (&Body, &Motion), (b, other): (&Body, &Motion), t: f64, warm: &mut WarmStart) -> bool {
    distance(a, &one.pose(t), b, &other.pose(t), &Options::default(), warm).upper == 0.0
}

/// The impact is no later than dense sampling finds, and contact is contact.
fn never_late(
    (a, one): (&Body, &Motion),
    (b, other): (&Body, &Motion),
    found: &Impact,
    (duration, samples): (f64, u32),
    label: &str,
) {
    let end = if found.status == ImpactStatus::Apart { duration } else { found.time };
    assert!(found.time <= duration, "{label}");
    let mut warm = WarmStart::default();
    for k in 0..=samples {
        let t = end * f64::from(k) / f64::from(samples);
        assert!(t >= end || !overlap((a, one), (b, other), t, &mut warm), "{label}: late, overlap at {t}");
    }
    // Just before the impact they are to be apart too.
    for k in 1..=50 {
        let t = end * (1.0 - 10_f64.powf(-0.3 * f64::from(k)));
        assert!(!overlap((a, one), (b, other), t, &mut warm), "{label}: late, overlap at {t}");
    }
    if found.status == ImpactStatus::Contact {
        let there = distance(a, &one.pose(end), b, &other.pose(end), &Options::default(), &mut WarmStart::default());
        assert!(there.lower <= 1.001 * CONTACT * small(a, b), "{label}: contact, yet {there:?}");
    }
}

/// A rotating blade with closed form: faces strike a ball where its distance from the axis times
/// the sine of the angle between is the sum of half thickness and radius.
#[test]
fn family_22_rotating_blade() {
    for seed in 0..draws(300) {
        let mut random = Seeded(220_000 + seed);
        let thin = random.between(1e-3, 0.05);
        let blade = match seed % 3 {
            0 => b(2.0, thin, 0.1),
            1 => b(2.0, thin, 1.0),
            _ => cylinder(2.0, thin),
        };
        let radius = random.between(1e-3, 0.1);
        let ball = e(radius, radius, radius);
        let (place, rate) = (1.0 + 0.8 * random.positive(), random.between(1e-2, 1e3));
        // Nearly touching starts, and many turns away.
        let strike = ((thin + radius) / place).asin();
        let turn = strike + [1e-7, 1e-3, 0.3, 2.8][(seed / 3 % 4) as usize];
        let hand = if random.signed() < 0.0 { -1.0 } else { 1.0 };
        let frame = random.rotation();
        let far = random.unit() * [0.0, 1.0, 1e3][random.index(3)];
        // The blade lies in the plane of its two long axes and turns about one across its face's
        // normal; a disc turns about a diameter.
        let (upright, spin_axis) = match seed % 3 {
            2 => (UnitQuaternion::from_scaled_axis(Vector3::x() * -std::f64::consts::FRAC_PI_2), Vector3::z()),
            _ => (UnitQuaternion::identity(), Vector3::z()),
        };
        let start = pose(far, &(frame * upright));
        let spin = Motion::new(start, Vector3::zeros(), frame * (spin_axis * (rate * hand)), far).expect("finite");
        let angle = hand * turn;
        let ahead = frame * Vector3::new(place * angle.cos(), place * angle.sin(), 0.05 * random.signed());
        let still = Motion::still(pose(far + ahead, &frame));
        let truth = (turn - strike) / rate;
        let duration = 9.0 / rate;
        let options = ImpactOptions::new(duration).expect("a time").with_contact(CONTACT).expect("in range");
        let found = time_of_impact(&blade, &spin, &ball, &still, &options);
        let label = format!("seed {seed} thin {thin} radius {radius} rate {rate}: {found:?} against {truth}");
        assert_eq!(found.status, ImpactStatus::Contact, "{label}");
        // Where the blade really is at a time is rounded by as much as its pose.
        let rounding = 1e-13 * (1.0 + far.norm()) / (place * rate);
        let early = 2.0 * CONTACT * radius.min(2.0) / (place * strike.cos() * rate);
        assert!(found.time <= truth + rounding, "{label}: late");
        assert!(found.time >= truth - early - rounding, "{label}: early");
        if seed % 10 == 0 {
            never_late((&blade, &spin), (&ball, &still), &found, (duration, 300), &label);
        }
    }
}

/// 100 m/s through a 1 cm slab: within a millisecond in front of it, in it, and past it.
#[test]
fn family_22_through_a_slab() {
    let slabs = [b(1.0, 1.0, 0.005), q(8, 1.0, 1.0, 0.005), e(2.0, 2.0, 0.005), c(8, 1.0, 0.005)];
    for seed in 0..draws(240) {
        let mut random = Seeded(221_000 + seed);
        let slab = &slabs[random.index(slabs.len())];
        let size = random.between(1e-3, 0.02);
        let bullet = match random.index(4) {
            0 => e(size, size, size),
            1 => e(0.5 * size, 0.5 * size, size),
            2 => b(0.3 * size, 0.4 * size, 0.5 * size),
            _ => c(4, 0.3 * size, size),
        };
        // Straight through, or slanted; spinning at up to 1000 rad/s.
        let slant = [0.0, 0.3, 1.3][random.index(3)];
        let velocity = Vector3::new(f64::sin(slant), 0.0, -f64::cos(slant)) * 100.0;
        let crossing = Vector3::new(0.3 * random.signed(), 0.3 * random.signed(), 0.0);
        let start = crossing - velocity * 0.005;
        let spin = random.unit() * if seed % 2 == 0 { 0.0 } else { random.between(1.0, 1e3) };
        let frame = random.rotation();
        let flight = Motion::new(
            pose(frame * start, &(frame * random.rotation())),
            frame * velocity,
            frame * spin,
            frame * start,
        )
        .expect("finite");
        let still = Motion::still(pose(Vector3::zeros(), &frame));
        let duration = 0.02;
        let options = ImpactOptions::new(duration).expect("a time").with_contact(CONTACT).expect("in range");
        for swapped in [false, true] {
            let found = if swapped {
                time_of_impact(slab, &still, &bullet, &flight, &options)
            } else {
                time_of_impact(&bullet, &flight, slab, &still, &options)
            };
            let label = format!("seed {seed} {}-{} slant {slant}: {found:?}", bullet.name(), slab.name());
            assert_eq!(found.status, ImpactStatus::Contact, "{label}");
            never_late((&bullet, &flight), (slab, &still), &found, (duration, 100), &label);
            // Balls against flat faces have a closed form.
            let ball = bullet.circumscribed().radius < 1.0001 * size && bullet.in_radius() > 0.9999 * size;
            if ball && slab.name() == "B" && slant == 0.0 {
                let truth = (0.5 - 0.005 - size) / 100.0;
                assert!(found.time <= truth + 1e-15 && found.time > truth - 2e-6 * size / 100.0, "{label}: {truth}");
            }
        }
    }
}

/// Grazing ±1e-9: past each other by a billionth, or touching by a billionth.
#[test]
fn family_22_grazing() {
    let contact = 1e-10;
    for seed in 0..draws(240) {
        let mut random = Seeded(222_000 + seed);
        let aside = [1e-9, -1e-9][(seed % 2) as usize];
        let frame = random.rotation();
        let speed = random.between(1e-2, 1e2);
        let direction = frame * Vector3::x();
        let side = frame * Vector3::z();
        let (half, other_half) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
        // Both lie along the frame, their tops and bottoms facing: tip to tip, face to face, or one
        // of each.
        let tall = |kind: usize, half: f64| match kind {
            0 => e(half, half, half),
            1 => q(4, 0.5, 0.7, half),
            2 => q(8, 0.7, 0.5, half),
            3 => b(0.4, 0.5, half),
            _ => cylinder(0.4, half),
        };
        let (kind_a, kind_b) = (random.index(5), random.index(5));
        let (a, b) = (tall(kind_a, half), tall(kind_b, other_half));
        let start = -direction * 3.0 + side * (half + other_half + aside);
        let origin = random.unit() * random.positive();
        let flight = gliding(pose(origin + start, &frame), direction * speed);
        let still = Motion::still(pose(origin, &frame));
        let duration = 6.0 / speed;
        let options = ImpactOptions::new(duration).expect("a time").with_contact(contact).expect("in range");
        let found = time_of_impact(&a, &flight, &b, &still, &options);
        let label = format!("seed {seed} {}-{} aside {aside:e} speed {speed}: {found:?}", a.name(), b.name());
        if aside > 0.0 {
            assert!(found.status != ImpactStatus::Contact, "{label}");
        } else {
            // At 3 / speed the tops are above each other, overlapping by a billionth.
            assert!(found.status != ImpactStatus::Apart && found.time <= 3.0 / speed, "{label}");
        }
        // No search may end without an answer where tips, not faces, pass each other.
        if kind_a == 0 || kind_b == 0 {
            assert!(found.status != ImpactStatus::Stopped, "{label}");
        }
        let dense = if found.status == ImpactStatus::Apart { duration } else { found.time };
        let mut warm = WarmStart::default();
        for k in 0..200 {
            let t = dense * f64::from(k) / 200.0;
            assert!(!overlap((&a, &flight), (&b, &still), t, &mut warm), "{label}: late, overlap at {t}");
        }
    }
}

/// Turning past each other with nothing in closed form: held against dense sampling only.
#[test]
fn family_22_tumbling() {
    let bodies = [e(1.0, 0.2, 0.1), b(0.8, 0.1, 0.3), q(8, 0.05, 0.9, 0.3), cylinder(0.1, 1.0), c(6, 0.7, 0.05)];
    let (mut hits, mut misses) = (0, 0);
    for seed in 0..draws(80) {
        let mut random = Seeded(223_000 + seed);
        let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
        let duration = 2.0;
        let (start, spread) = (random.pose(0.2), random.unit() * 1.5);
        let mut spin = || random.unit() * random.between(0.1, 30.0);
        let (spin_a, spin_b) = (spin(), spin());
        let one = Motion::new(start, Vector3::zeros(), spin_a, *start.translation()).expect("finite");
        let from = random.pose(2.2);
        let aim = (start.translation() + spread - from.translation()) * 0.8;
        let other = Motion::new(from, aim, spin_b, *from.translation()).expect("finite");
        let options = ImpactOptions::new(duration).expect("a time").with_contact(CONTACT).expect("in range");
        let found = time_of_impact(a, &one, b, &other, &options);
        let label = format!("seed {seed} {}-{}: {found:?}", a.name(), b.name());
        assert_ne!(found.status, ImpactStatus::Stopped, "{label}");
        *(if found.status == ImpactStatus::Contact { &mut hits } else { &mut misses }) += 1;
        never_late((a, &one), (b, &other), &found, (duration, 400), &label);
    }
    assert!(hits > 10 && misses > 10, "{hits} hits, {misses} misses");
}
