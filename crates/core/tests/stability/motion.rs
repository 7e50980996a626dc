//! Families about motion: 22.

use crate::judge::small;
use sublevel_core::measure::{Impact, ImpactStatus, Motion, Options, WarmStart, distance, time_of_impact};
use sublevel_testkit::catalogue::motion::{BLADES, Bullet, Meeting, Truth, blade, grazing, slab, tumbling};
use sublevel_testkit::random::{Seeded, draws};

/// Whether the bodies are proven to overlap at a time.
fn overlap(meeting: &Meeting, [one, other]: &[Motion; 2], t: f64, warm: &mut WarmStart) -> bool {
    let options = Options::default();
    distance(&meeting.a.0, &one.pose(t), &meeting.b.0, &other.pose(t), &options, warm).upper == 0.0
}

/// The first impact of a meeting.
fn first(meeting: &Meeting) -> Impact {
    let [one, other] = meeting.motions();
    time_of_impact(&meeting.a.0, &one, &meeting.b.0, &other, &meeting.options())
}

/// The impact is no later than dense sampling finds, and contact is contact.
fn never_late(meeting: &Meeting, found: &Impact, samples: u32, label: &str) {
    let motions = meeting.motions();
    let end = if found.status == ImpactStatus::Apart { meeting.duration } else { found.time };
    assert!(found.time <= meeting.duration, "{label}");
    let mut warm = WarmStart::default();
    for k in 0..=samples {
        let t = end * f64::from(k) / f64::from(samples);
        assert!(t >= end || !overlap(meeting, &motions, t, &mut warm), "{label}: late, overlap at {t}");
    }
    // Just before the impact they are to be apart too.
    for k in 1..=50 {
        let t = end * (1.0 - 10_f64.powf(-0.3 * f64::from(k)));
        assert!(!overlap(meeting, &motions, t, &mut warm), "{label}: late, overlap at {t}");
    }
    if found.status == ImpactStatus::Contact {
        let (a, b) = (&meeting.a.0, &meeting.b.0);
        let [one, other] = motions.map(|motion| motion.pose(end));
        let there = distance(a, &one, b, &other, &Options::default(), &mut WarmStart::default());
        assert!(there.lower <= 1.001 * meeting.contact * small(a, b), "{label}: contact, yet {there:?}");
    }
}

/// Where the time is known, it is met: no later, and earlier by no more than contact makes it.
fn met(meeting: &Meeting, found: &Impact, label: &str) {
    let Truth::At { time, early, rounding, .. } = meeting.truth else { return };
    assert!(found.time <= time + rounding, "{label}: late");
    assert!(found.time >= time - early - rounding, "{label}: early");
}

/// A rotating blade with closed form.
#[test]
fn family_22_rotating_blade() {
    for seed in 0..draws(300) {
        let meeting = blade(seed % BLADES, &mut Seeded(220_000 + seed));
        let found = first(&meeting);
        let label = format!("seed {seed} {}: {found:?} against {:?}", meeting.what, meeting.truth);
        assert_eq!(found.status, ImpactStatus::Contact, "{label}");
        met(&meeting, &found, &label);
        if seed % 10 == 0 {
            never_late(&meeting, &found, 300, &label);
        }
    }
}

/// 100 m/s through a 1 cm slab: within a millisecond in front of it, in it, and past it.
#[test]
fn family_22_through_a_slab() {
    for seed in 0..draws(240) {
        // Balls against flat faces have a closed form.
        let bullet = if seed % 2 == 0 { Bullet::BallThroughBox } else { Bullet::Any };
        let meeting = slab(bullet, &mut Seeded(221_000 + seed));
        let [wall, bullet] = meeting.motions();
        let swapped = time_of_impact(&meeting.b.0, &bullet, &meeting.a.0, &wall, &meeting.options());
        for found in [first(&meeting), swapped] {
            let label = format!("seed {seed} {}: {found:?} against {:?}", meeting.what, meeting.truth);
            assert_eq!(found.status, ImpactStatus::Contact, "{label}");
            never_late(&meeting, &found, 100, &label);
            met(&meeting, &found, &label);
        }
    }
}

/// Grazing ±1e-9: past each other by a billionth, or touching by a billionth.
#[test]
fn family_22_grazing() {
    for seed in 0..draws(240) {
        let meeting = grazing(seed % 2 == 0, false, &mut Seeded(222_000 + seed));
        let found = first(&meeting);
        let label = format!("seed {seed} {}: {found:?}", meeting.what);
        match meeting.truth {
            // When the tops are above each other, they overlap by a billionth.
            Truth::Before(time) => assert!(found.status != ImpactStatus::Apart && found.time <= time, "{label}"),
            _ => assert!(found.status != ImpactStatus::Contact, "{label}"),
        }
        // No search may end without an answer where tips, not faces, pass each other.
        if meeting.a.0.name() == "E" || meeting.b.0.name() == "E" {
            assert!(found.status != ImpactStatus::Stopped, "{label}");
        }
        let motions = meeting.motions();
        let dense = if found.status == ImpactStatus::Apart { meeting.duration } else { found.time };
        let mut warm = WarmStart::default();
        for k in 0..200 {
            let t = dense * f64::from(k) / 200.0;
            assert!(!overlap(&meeting, &motions, t, &mut warm), "{label}: late, overlap at {t}");
        }
    }
}

/// Turning past each other with nothing in closed form: compared with dense sampling only.
#[test]
fn family_22_tumbling() {
    let (mut hits, mut misses) = (0, 0);
    for seed in 0..draws(80) {
        let meeting = tumbling(&mut Seeded(223_000 + seed));
        let found = first(&meeting);
        let label = format!("seed {seed} {}: {found:?}", meeting.what);
        assert_ne!(found.status, ImpactStatus::Stopped, "{label}");
        *(if found.status == ImpactStatus::Contact { &mut hits } else { &mut misses }) += 1;
        never_late(&meeting, &found, 400, &label);
    }
    assert!(hits > 10 && misses > 10, "{hits} hits, {misses} misses");
}
