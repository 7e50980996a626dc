//! Time of impact: 22.

use super::super::case::{CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{b, c, cylinder, e, q};
use super::random;
use crate::comparison::{Flight, Random, parry_impact};
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{
    Impact, ImpactOptions, ImpactStatus, Motion, Options, Pose, WarmStart, distance, time_of_impact,
};

/// How much too late or early others may be, relative to the time.
const PEER_ERROR: f64 = 1e-4;

/// Times before an impact, evenly and closer and closer to it, at which nothing may overlap.
const SAMPLES: u32 = 100;
/// See [`SAMPLES`].
const CLOSER: u32 = 50;

/// Two moving bodies, and what is known of their meeting.
struct Meeting {
    a: (Body, Flight),
    b: (Body, Flight),
    /// How long to look, seconds.
    duration: f64,
    /// Distance that counts as contact, relative to the smaller body.
    contact: f64,
    truth: Truth,
    /// Half-extents of the first body and radius of the second, metres, if they are a box and a
    /// ball.
    box_and_ball: Option<(Vector3<f64>, f64)>,
}

/// When they meet, seconds.
enum Truth {
    /// At this time; `early` is how much earlier the contact distance makes it, `rounding` what
    /// rounding of poses does, `turn` all that errors are relative to.
    At { time: f64, early: f64, rounding: f64, turn: f64 },
    /// At this time or before.
    Before(f64),
    /// Never.
    Never,
    /// Nothing is known but by sampling.
    Open,
}

/// A blade that turns, a flight through a slab, and grazing by a billionth: never later than the
/// closed form and dense sampling.
pub(super) fn impact(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Parry) {
        return Ok(None);
    }
    let mut random = random(22, seed);
    let meeting = match seed % 3 {
        0 => blade(seed / 3, &mut random),
        1 => slab(seed / 3, &mut random),
        _ => grazing(seed / 3, &mut random),
    }?;
    if method == Method::Cold { meeting.ours().map(Some) } else { Ok(meeting.of_parry()) }
}

/// A blade strikes a ball where the ball's distance from the axis times the sine of the angle
/// between them is the sum of half the blade's thickness and the ball's radius.
fn blade(index: u64, random: &mut Random) -> Result<Meeting, CaseError> {
    const CONTACT: f64 = 1e-6;
    let (thin, radius) = (random.between(1e-3, 0.05), random.between(1e-3, 0.1));
    let half = Vector3::new(2.0, thin, if index.is_multiple_of(2) { 0.1 } else { 1.0 });
    let (place, rate) = (1.0 + 0.8 * random.positive(), random.between(1e-2, 1e3));
    let strike = ((thin + radius) / place).asin();
    let turn = strike + [1e-7, 1e-3, 0.3, 2.8][(index / 2 % 4) as usize];
    let far = random.direction() * [0.0, 1.0, 1e3][random.index(3)];
    let frame = random.rotation();
    let ahead = Vector3::new(place * turn.cos(), place * turn.sin(), 0.05 * random.signed());
    let spin = frame * Vector3::new(0.0, 0.0, rate);
    let truth = Truth::At {
        time: (turn - strike) / rate,
        early: 2.0 * CONTACT * radius / (place * strike.cos() * rate),
        // Where the blade really is at a time is rounded by as much as its pose.
        rounding: 1e-13 * (1.0 + far.norm()) / (place * rate),
        turn: turn / rate,
    };
    Ok(Meeting {
        a: (b(half.x, half.y, half.z)?, Flight { start: pose(far, &frame)?, velocity: Vector3::zeros(), spin }),
        b: (e(radius, radius, radius)?, still(pose(far + frame * ahead, &frame)?)),
        duration: 9.0 / rate,
        contact: CONTACT,
        truth,
        box_and_ball: Some((half, radius)),
    })
}

/// Half the thickness of a slab of a centimetre, metres.
const SLAB: f64 = 0.005;

/// Something small at 100 m/s through a slab, straight or slanted, spinning or not; every other
/// time a ball through a box, which has a closed form.
fn slab(index: u64, random: &mut Random) -> Result<Meeting, CaseError> {
    const CONTACT: f64 = 1e-6;
    const SPEED: f64 = 100.0;
    let size = random.between(1e-3, 0.02);
    let slant: f64 = [0.0, 0.3, 1.3][random.index(3)];
    let is_known = index.is_multiple_of(2);
    let (wall, bullet) = if is_known {
        (b(1.0, 1.0, SLAB)?, e(size, size, size)?)
    } else {
        let wall = match random.index(4) {
            0 => b(1.0, 1.0, SLAB)?,
            1 => q(8, 1.0, 1.0, SLAB)?,
            2 => e(2.0, 2.0, SLAB)?,
            _ => c(8, 1.0, SLAB)?,
        };
        let bullet = match random.index(3) {
            0 => e(0.5 * size, 0.5 * size, size)?,
            1 => b(0.3 * size, 0.4 * size, 0.5 * size)?,
            _ => c(4, 0.3 * size, size)?,
        };
        (wall, bullet)
    };
    let velocity = Vector3::new(slant.sin(), 0.0, -slant.cos()) * SPEED;
    let crossing = Vector3::new(0.3 * random.signed(), 0.3 * random.signed(), 0.0);
    // In five milliseconds it would be in the middle.
    let start = crossing - velocity * 0.005;
    let rate = if random.index(2) == 0 { 0.0 } else { random.between(1.0, 1e3) };
    let (spin, turn, frame) = (random.direction() * rate, random.rotation(), random.rotation());
    let flight =
        Flight { start: pose(frame * start, &(frame * turn))?, velocity: frame * velocity, spin: frame * spin };
    let time = 0.005 - (SLAB + size) / (SPEED * slant.cos());
    let truth = if is_known {
        let early = 2.0 * CONTACT * size / (SPEED * slant.cos());
        Truth::At { time, early, rounding: 1e-15, turn: 0.005 }
    } else {
        Truth::Open
    };
    Ok(Meeting {
        a: (wall, still(pose(Vector3::zeros(), &frame)?)),
        b: (bullet, flight),
        duration: 0.02,
        contact: CONTACT,
        truth,
        box_and_ball: is_known.then_some((Vector3::new(1.0, 1.0, SLAB), size)),
    })
}

/// Past each other by a billionth of a metre, or touching by one: tip to tip, face to face, or one
/// of each.
fn grazing(index: u64, random: &mut Random) -> Result<Meeting, CaseError> {
    let aside = if index.is_multiple_of(2) { 1e-9 } else { -1e-9 };
    let (half, other_half) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
    // Both lie along the frame, their tops and bottoms facing.
    let tall = |kind: usize, half: f64| match kind {
        0 => e(half, half, half),
        1 => b(0.4, 0.5, half),
        2 => q(4, 0.5, 0.7, half),
        3 => q(8, 0.7, 0.5, half),
        _ => cylinder(0.4, half),
    };
    let is_known = (index / 2).is_multiple_of(2);
    let (kind_a, kind_b) = if is_known { (1, 0) } else { (random.index(5), random.index(5)) };
    let (frame, speed) = (random.rotation(), random.between(1e-2, 1e2));
    let (direction, side) = (frame * Vector3::x(), frame * Vector3::z());
    let origin = random.direction() * random.positive();
    let start = origin - direction * 3.0 + side * (half + other_half + aside);
    let flight = Flight { start: pose(start, &frame)?, velocity: direction * speed, spin: Vector3::zeros() };
    Ok(Meeting {
        a: (tall(kind_a, half)?, still(pose(origin, &frame)?)),
        b: (tall(kind_b, other_half)?, flight),
        duration: 6.0 / speed,
        contact: 1e-10,
        // Halfway they are above each other.
        truth: if aside > 0.0 { Truth::Never } else { Truth::Before(3.0 / speed) },
        box_and_ball: is_known.then_some((Vector3::new(0.4, 0.5, half), other_half)),
    })
}

fn still(start: Pose) -> Flight {
    Flight { start, velocity: Vector3::zeros(), spin: Vector3::zeros() }
}

impl Meeting {
    fn of_parry(&self) -> Option<Verdict> {
        let (half, radius) = self.box_and_ball?;
        let found = parry_impact((&half, &self.a.1), (radius, &self.b.1), self.duration);
        Some(match (&self.truth, found) {
            (Truth::At { time, turn, .. }, Some(found)) => {
                let off = (found - time).abs() / turn;
                if off <= PEER_ERROR { Verdict::Pass } else { Verdict::Off(off) }
            }
            (Truth::Before(time), Some(found)) if found <= time * (1.0 + PEER_ERROR) => Verdict::Pass,
            (Truth::Before(time), Some(found)) => Verdict::Off(found / time - 1.0),
            (Truth::At { .. } | Truth::Before(_), None) => Verdict::NoAnswer,
            (Truth::Never, None) | (Truth::Open, _) => Verdict::Pass,
            (Truth::Never, Some(found)) => {
                Verdict::WrongStatus(format!("an impact at {found:e} s of bodies that miss"))
            }
        })
    }

    fn ours(&self) -> Result<Verdict, CaseError> {
        let motion = |flight: &Flight| {
            let Flight { start, velocity, spin } = *flight;
            Motion::new(start, velocity, spin, *start.translation()).map_err(CaseError::other)
        };
        let motions = [motion(&self.a.1)?, motion(&self.b.1)?];
        let options = ImpactOptions::new(self.duration).and_then(|options| options.with_contact(self.contact));
        let options = options.map_err(CaseError::other)?;
        let found = time_of_impact(&self.a.0, &motions[0], &self.b.0, &motions[1], &options);
        let Impact { status, time, .. } = found;
        let wrong = |what: &str| Ok(Verdict::WrongStatus(format!("{status:?} at {time:e} s, {what}")));
        match self.truth {
            Truth::At { .. } | Truth::Open if status != ImpactStatus::Contact => return wrong("where they meet"),
            Truth::At { time: truth, early, rounding, turn } => {
                let off = (time - truth).max(truth - early - time) - rounding;
                if !(off <= 0.0) {
                    return Ok(Verdict::Off(off / turn));
                }
            }
            Truth::Before(_) if status == ImpactStatus::Apart => return wrong("where they meet"),
            Truth::Before(latest) if !(time <= latest) => return Ok(Verdict::Off(time / latest - 1.0)),
            Truth::Never if status == ImpactStatus::Contact => return wrong("where they miss"),
            Truth::Before(_) | Truth::Never | Truth::Open => {}
        }
        Ok(self.late(&motions, &found).unwrap_or(Verdict::Pass))
    }

    /// What sampling finds: overlap before the time, or no contact at it.
    fn late(&self, motions: &[Motion; 2], found: &Impact) -> Option<Verdict> {
        let mut warm = WarmStart::default();
        let mut at = |t: f64| {
            let poses = motions.map(|motion| motion.pose(t));
            distance(&self.a.0, &poses[0], &self.b.0, &poses[1], &Options::default(), &mut warm)
        };
        let end = if found.status == ImpactStatus::Apart { self.duration } else { found.time };
        let evenly = (0..SAMPLES).map(|k| end * f64::from(k) / f64::from(SAMPLES));
        let closer = (1..=CLOSER).map(|k| end * (1.0 - 10_f64.powf(-0.3 * f64::from(k))));
        for t in evenly.chain(closer).filter(|t| *t < end) {
            if at(t).upper == 0.0 {
                return Some(Verdict::WrongStatus(format!("late: {end:e} s, overlap at {t:e} s")));
            }
        }
        let small = self.a.0.circumscribed().radius.min(self.b.0.circumscribed().radius);
        let gap = at(end).lower;
        let is_contact = found.status != ImpactStatus::Contact || gap <= 1.001 * self.contact * small;
        (!is_contact).then(|| Verdict::WrongStatus(format!("contact, yet {gap:e} m apart")))
    }
}
