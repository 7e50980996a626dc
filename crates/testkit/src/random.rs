//! Seeded draws: a failing seed can be replayed.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};
use sublevel_core::measure::Pose;

/// Number of random queries: `few`, or where `SUBLEVEL_LONG` is set 1e5, or what it says if that is
/// a number above 1.
pub fn draws(few: u64) -> u64 {
    match std::env::var("SUBLEVEL_LONG").map(|value| value.parse()) {
        Err(_) => few,
        Ok(Ok(number @ 2..)) => number,
        Ok(_) => 100_000,
    }
}

/// The seeds of that many draws from `first` on and some that have failed before, or those that
/// `SUBLEVEL_SEEDS` lists, with commas, to replay them.
pub fn seeds(first: u64, few: u64, failed: &[u64]) -> Vec<u64> {
    match std::env::var("SUBLEVEL_SEEDS") {
        Err(_) => failed.iter().copied().chain(first..first + draws(few)).collect(),
        Ok(list) => list.split(',').map(|seed| seed.trim().parse().expect("seeds with commas between them")).collect(),
    }
}

/// Whether seeds are replayed: too few for claims about many.
pub fn replayed() -> bool {
    std::env::var_os("SUBLEVEL_SEEDS").is_some()
}

/// Number of draws of a family that takes long: `few`, or `many` where `SUBLEVEL_LONG` is set.
pub fn few_or(few: u64, many: u64) -> u64 {
    if std::env::var_os("SUBLEVEL_LONG").is_some() { many } else { few }
}

/// Numbers that look random and are the same everywhere, as the catalogue draws its cases from
/// them. Each kind of generator keeps its own ways to indices and rotations, for the sake of the
/// seeds that are on record for it.
pub trait Draws {
    /// Uniform in [-1, 1).
    fn signed(&mut self) -> f64;

    /// Below `count`, which is positive.
    fn index(&mut self, count: usize) -> usize;

    /// Uniform on the sphere.
    fn unit(&mut self) -> Vector3<f64>;

    fn rotation(&mut self) -> UnitQuaternion<f64>;

    /// A rotation, and a translation of this length, metres.
    fn pose(&mut self, length: f64) -> Pose;

    /// Uniform in [0, 1).
    fn positive(&mut self) -> f64 {
        0.5 * (self.signed() + 1.0)
    }

    /// Between `low` and `high`, uniform in the logarithm.
    fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.positive())
    }
}

impl Draws for Seeded {
    fn signed(&mut self) -> f64 {
        Self::signed(self)
    }

    fn index(&mut self, count: usize) -> usize {
        Self::index(self, count)
    }

    fn unit(&mut self) -> Vector3<f64> {
        Self::unit(self)
    }

    fn rotation(&mut self) -> UnitQuaternion<f64> {
        Self::rotation(self)
    }

    fn pose(&mut self, length: f64) -> Pose {
        Self::pose(self, length)
    }
}

/// SplitMix64 (Steele, Lea, Flood 2014).
pub struct Seeded(pub u64);

impl Seeded {
    /// The next 64 bits.
    #[allow(clippy::should_implement_trait)]
    pub fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// Below `count`.
    pub fn index(&mut self, count: usize) -> usize {
        (self.next() % count as u64) as usize
    }

    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Uniform in [0, 1).
    pub fn positive(&mut self) -> f64 {
        0.5 * (self.signed() + 1.0)
    }

    /// Between `low` and `high`, uniform in the logarithm.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.positive())
    }

    pub fn unit(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::from_fn(|_, _| self.signed());
            if v.norm() > 0.1 && v.norm() <= 1.0 {
                return v.normalize();
            }
        }
    }

    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        loop {
            let q = Quaternion::new(self.signed(), self.signed(), self.signed(), self.signed());
            if q.norm() > 0.1 && q.norm() <= 1.0 {
                return UnitQuaternion::new_normalize(q);
            }
        }
    }

    /// A rotation, and a translation of this length.
    pub fn pose(&mut self, length: f64) -> Pose {
        pose(self.unit() * length, &self.rotation())
    }
}

pub fn pose(translation: Vector3<f64>, rotation: &UnitQuaternion<f64>) -> Pose {
    Pose::from_quaternion(translation, rotation.coords.into()).expect("a unit quaternion and finite numbers")
}

pub fn at(x: f64, y: f64, z: f64) -> Pose {
    pose(Vector3::new(x, y, z), &UnitQuaternion::identity())
}

/// The pose moved by a world translation, which rounds once.
pub fn shifted(from: &Pose, by: Vector3<f64>) -> Pose {
    pose(from.translation() + by, from.rotation())
}

/// The pose turned about its own translation by a world rotation vector.
pub fn turned(from: &Pose, by: Vector3<f64>) -> Pose {
    pose(*from.translation(), &(UnitQuaternion::from_scaled_axis(by) * from.rotation()))
}

/// The pose after `step` along component k of the twists `(v_a, ω_a, v_b, ω_b)`, for the body
/// whose twist starts at `first`.
pub fn twisted(from: &Pose, k: usize, first: usize, step: f64) -> Pose {
    let along = |axis: usize| Vector3::from_fn(|i, _| if i == axis { step } else { 0.0 });
    match k.checked_sub(first) {
        Some(axis @ 0..3) => shifted(from, along(axis)),
        Some(axis @ 3..6) => turned(from, along(axis - 3)),
        _ => *from,
    }
}
