//! Time of impact: 22.

use super::Draws;
use crate::bodies::{b, c, cylinder, e, q};
use crate::random::pose;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;
use sublevel_core::body::Body;
use sublevel_core::measure::{ImpactOptions, Motion, Pose};

/// A rigid motion: the velocity of the body's origin, metres a second, and the rotation about it,
/// radians a second, both in the world.
#[derive(Clone, Copy, Debug)]
pub struct Flight {
    pub start: Pose,
    pub velocity: Vector3<f64>,
    pub spin: Vector3<f64>,
}

impl Flight {
    fn still(start: Pose) -> Self {
        Self { start, velocity: Vector3::zeros(), spin: Vector3::zeros() }
    }

    pub fn motion(&self) -> Motion {
        Motion::new(self.start, self.velocity, self.spin, *self.start.translation()).expect("finite")
    }
}

/// Two moving bodies, and what is known of their meeting.
pub struct Meeting {
    pub a: (Body, Flight),
    pub b: (Body, Flight),
    /// How long to look, seconds.
    pub duration: f64,
    /// Distance that counts as contact, relative to the smaller body.
    pub contact: f64,
    pub truth: Truth,
    /// Half-extents of the first body and radius of the second, metres, if they are a box and a
    /// ball.
    pub box_and_ball: Option<(Vector3<f64>, f64)>,
    /// Bodies and settings in words.
    pub what: String,
}

/// When they meet, seconds.
#[derive(Clone, Copy, Debug)]
pub enum Truth {
    /// At this time; `early` is how much earlier the contact distance makes it, `rounding` what
    /// rounding of poses does, `turn` the whole time that errors are relative to.
    At { time: f64, early: f64, rounding: f64, turn: f64 },
    /// At this time or before.
    Before(f64),
    /// Never.
    Never,
    /// At some time.
    Sometime,
    /// Nothing is known but by sampling.
    Open,
}

impl Meeting {
    pub fn motions(&self) -> [Motion; 2] {
        [self.a.1.motion(), self.b.1.motion()]
    }

    pub fn options(&self) -> ImpactOptions<'static> {
        ImpactOptions::new(self.duration).and_then(|options| options.with_contact(self.contact)).expect("in range")
    }
}

/// Settings of [`blade`]: three blades, at four turns before they strike, to both hands.
pub const BLADES: u64 = 24;

/// A blade strikes a ball where the ball's distance from the axis times the sine of the angle
/// between them is the sum of half the blade's thickness and the ball's radius.
///
/// The blade lies in the plane of its two long axes and turns about one across its face's normal; a
/// disc turns about a diameter.
pub fn blade(setting: u64, random: &mut dyn Draws) -> Meeting {
    const CONTACT: f64 = 1e-6;
    let (thin, radius) = (random.between(1e-3, 0.05), random.between(1e-3, 0.1));
    // Nearly touching starts, and many turns away.
    let ahead = [1e-7, 1e-3, 0.3, 2.8][(setting / 2 % 4) as usize];
    let (half, hand) = match (setting % 2, setting / 8 % 3) {
        (kind, side @ 0..2) => {
            let width = if kind == 0 { 0.1 } else { 1.0 };
            (Some(Vector3::new(2.0, thin, width)), if side == 0 { 1.0 } else { -1.0 })
        }
        (kind, _) => (None, if kind == 0 { 1.0 } else { -1.0 }),
    };
    let (place, rate) = (1.0 + 0.8 * random.positive(), random.between(1e-2, 1e3));
    let strike = ((thin + radius) / place).asin();
    let turn = strike + ahead;
    let far = random.unit() * [0.0, 1.0, 1e3][random.index(3)];
    let frame = random.rotation();
    let angle = hand * turn;
    let ahead = Vector3::new(place * angle.cos(), place * angle.sin(), 0.05 * random.signed());
    let spin = frame * Vector3::new(0.0, 0.0, rate * hand);
    let truth = Truth::At {
        time: (turn - strike) / rate,
        early: 2.0 * CONTACT * radius / (place * strike.cos() * rate),
        // Where the blade really is at a time is rounded by as much as its pose.
        rounding: 1e-13 * (1.0 + far.norm()) / (place * rate),
        turn: turn / rate,
    };
    let (blade, upright) = match half {
        Some(half) => (b(half.x, half.y, half.z), UnitQuaternion::identity()),
        None => (cylinder(2.0, thin), UnitQuaternion::from_scaled_axis(Vector3::x() * -FRAC_PI_2)),
    };
    let start = pose(far, &if half.is_some() { frame } else { frame * upright });
    Meeting {
        a: (blade, Flight { start, velocity: Vector3::zeros(), spin }),
        b: (e(radius, radius, radius), Flight::still(pose(far + frame * ahead, &frame))),
        duration: 9.0 / rate,
        contact: CONTACT,
        truth,
        box_and_ball: half.map(|half| (half, radius)),
        what: format!("blade {thin} m thin, ball of {radius} m, {rate} rad/s"),
    }
}

/// What flies through a slab.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Bullet {
    /// A ball through a box, which has a closed form.
    BallThroughBox,
    /// Anything but a ball, through any slab.
    NoBall,
    /// Anything, through any slab.
    Any,
}

/// Half the thickness of a slab of a centimetre, metres.
const SLAB: f64 = 0.005;

/// Something small at 100 m/s through a slab, straight or slanted, spinning or not: within a
/// millisecond in front of it, in it, and past it.
pub fn slab(bullet: Bullet, random: &mut dyn Draws) -> Meeting {
    const CONTACT: f64 = 1e-6;
    const SPEED: f64 = 100.0;
    let size = random.between(1e-3, 0.02);
    let slant: f64 = [0.0, 0.3, 1.3][random.index(3)];
    let is_known = bullet == Bullet::BallThroughBox;
    let kinds = if bullet == Bullet::Any { 4 } else { 3 };
    let (wall, bullet) = if is_known {
        (b(1.0, 1.0, SLAB), e(size, size, size))
    } else {
        let wall = match random.index(4) {
            0 => b(1.0, 1.0, SLAB),
            1 => q(8, 1.0, 1.0, SLAB),
            2 => e(2.0, 2.0, SLAB),
            _ => c(8, 1.0, SLAB),
        };
        let bullet = match random.index(kinds) {
            0 => e(0.5 * size, 0.5 * size, size),
            1 => b(0.3 * size, 0.4 * size, 0.5 * size),
            2 => c(4, 0.3 * size, size),
            _ => e(size, size, size),
        };
        (wall, bullet)
    };
    let velocity = Vector3::new(slant.sin(), 0.0, -slant.cos()) * SPEED;
    let crossing = Vector3::new(0.3 * random.signed(), 0.3 * random.signed(), 0.0);
    // In five milliseconds it would be in the middle.
    let start = crossing - velocity * 0.005;
    let rate = if random.index(2) == 0 { 0.0 } else { random.between(1.0, 1e3) };
    let (spin, turn, frame) = (random.unit() * rate, random.rotation(), random.rotation());
    let start = pose(frame * start, &(frame * turn));
    let time = 0.005 - (SLAB + size) / (SPEED * slant.cos());
    let truth = if is_known {
        let early = 2.0 * CONTACT * size / (SPEED * slant.cos());
        Truth::At { time, early, rounding: 1e-15, turn: 0.005 }
    } else {
        Truth::Sometime
    };
    let what = format!("{} of {size} m through {}, slant {slant} rad, {rate} rad/s", bullet.name(), wall.name());
    Meeting {
        a: (wall, Flight::still(pose(Vector3::zeros(), &frame))),
        b: (bullet, Flight { start, velocity: frame * velocity, spin: frame * spin }),
        duration: 0.02,
        contact: CONTACT,
        truth,
        box_and_ball: is_known.then_some((Vector3::new(1.0, 1.0, SLAB), size)),
        what,
    }
}

/// Past each other by a billionth of a metre, or touching by one: tip to tip, face to face, or one
/// of each. A ball past a box if `is_known`.
pub fn grazing(misses: bool, is_known: bool, random: &mut dyn Draws) -> Meeting {
    let aside = if misses { 1e-9 } else { -1e-9 };
    let (half, other_half) = (random.between(0.1, 1.0), random.between(0.1, 1.0));
    // Both lie along the frame, their tops and bottoms facing.
    let tall = |kind: usize, half: f64| match kind {
        0 => e(half, half, half),
        1 => b(0.4, 0.5, half),
        2 => q(4, 0.5, 0.7, half),
        3 => q(8, 0.7, 0.5, half),
        _ => cylinder(0.4, half),
    };
    let (kind_a, kind_b) = if is_known { (1, 0) } else { (random.index(5), random.index(5)) };
    let (frame, speed) = (random.rotation(), random.between(1e-2, 1e2));
    let (direction, side) = (frame * Vector3::x(), frame * Vector3::z());
    let origin = random.unit() * random.positive();
    let start = pose(origin - direction * 3.0 + side * (half + other_half + aside), &frame);
    let (a, b) = (tall(kind_a, half), tall(kind_b, other_half));
    let what = format!("{} past {}, {aside:e} m aside, {speed} m/s", b.name(), a.name());
    Meeting {
        a: (a, Flight::still(pose(origin, &frame))),
        b: (b, Flight { start, velocity: direction * speed, spin: Vector3::zeros() }),
        duration: 6.0 / speed,
        contact: 1e-10,
        // Halfway they are above each other.
        truth: if misses { Truth::Never } else { Truth::Before(3.0 / speed) },
        box_and_ball: is_known.then_some((Vector3::new(0.4, 0.5, half), other_half)),
        what,
    }
}

/// Turning past each other with nothing in closed form.
pub fn tumbling(random: &mut dyn Draws) -> Meeting {
    let bodies = [e(1.0, 0.2, 0.1), b(0.8, 0.1, 0.3), q(8, 0.05, 0.9, 0.3), cylinder(0.1, 1.0), c(6, 0.7, 0.05)];
    let (a, b) = (&bodies[random.index(bodies.len())], &bodies[random.index(bodies.len())]);
    let (start, spread) = (random.pose(0.2), random.unit() * 1.5);
    let mut spin = || random.unit() * random.between(0.1, 30.0);
    let (spin_a, spin_b) = (spin(), spin());
    let from = random.pose(2.2);
    let velocity = (start.translation() + spread - from.translation()) * 0.8;
    Meeting {
        a: (a.clone(), Flight { start, velocity: Vector3::zeros(), spin: spin_a }),
        b: (b.clone(), Flight { start: from, velocity, spin: spin_b }),
        duration: 2.0,
        contact: 1e-6,
        truth: Truth::Open,
        box_and_ball: None,
        what: format!("{}-{} tumbling", a.name(), b.name()),
    }
}
