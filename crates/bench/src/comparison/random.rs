//! Numbers that look random and are the same everywhere.

use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::TAU;
use sublevel::measure::Pose;
use sublevel_testkit::random::{Draws, pose};

/// SplitMix64 (Steele, Lea, Flood 2014): the same motions everywhere.
#[derive(Clone, Debug)]
pub struct Random(pub u64);

impl Random {
    /// Uniform in [-1, 1).
    pub fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Uniform in [0, 1).
    pub fn positive(&mut self) -> f64 {
        0.5 * (self.signed() + 1.0)
    }

    /// Below `count`, which is positive.
    pub fn index(&mut self, count: usize) -> usize {
        (self.positive() * count as f64) as usize
    }

    /// Between `low` and `high`, uniform in the logarithm.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.positive())
    }

    /// Uniform on the sphere.
    pub fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::from_fn(|_, _| self.signed());
            if (0.1..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }

    /// A rotation about a random axis.
    pub fn rotation(&mut self) -> UnitQuaternion<f64> {
        UnitQuaternion::new(self.direction() * (TAU * self.signed()))
    }
}

/// As the cases of the stability chart are drawn.
impl Draws for Random {
    fn signed(&mut self) -> f64 {
        Self::signed(self)
    }

    fn index(&mut self, count: usize) -> usize {
        Self::index(self, count)
    }

    fn unit(&mut self) -> Vector3<f64> {
        self.direction()
    }

    fn rotation(&mut self) -> UnitQuaternion<f64> {
        Self::rotation(self)
    }

    fn pose(&mut self, length: f64) -> Pose {
        let rotation = Self::rotation(self);
        pose(self.direction() * length, &rotation)
    }
}
