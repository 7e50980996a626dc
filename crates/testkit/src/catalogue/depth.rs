//! Overlap: 16, 27.

use super::{Draws, any_two};
use crate::bodies::{b, c, cylinder, e, q};
use crate::random::pose;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Offsets of a slide, from touching to concentric.
const STEPS: u32 = 12;

/// How near to both ends there are more of them, relative to the whole slide.
const ENDS: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 1e-15];

/// Family 16. A slide of the second body towards the first, to where their centres coincide. About
/// these the bodies are their own mirror images: the signed distance along it is convex and even.
pub struct Slide {
    pub a: Body,
    pub pose_a: Pose,
    pub b: Body,
    turn: UnitQuaternion<f64>,
    direction: Vector3<f64>,
}

/// A slide anywhere, or one of bodies turned alike along one of their axes: then faces are
/// parallel all the way.
pub fn slide(is_aligned: bool, random: &mut dyn Draws) -> Slide {
    let bodies = [
        e(1.0, 0.7, 0.4),
        e(0.5, 0.5, 0.5),
        q(4, 0.8, 0.5, 1.1),
        q(8, 1.0, 0.6, 0.3),
        c(6, 0.8, 0.3),
        b(0.6, 0.9, 0.3),
        cylinder(0.5, 0.8),
    ];
    let (a, b, _) = any_two(random, &bodies);
    let (pose_a, turn, direction) = (random.pose(0.3), random.rotation(), random.unit());
    let (turn, direction) = if is_aligned {
        (*pose_a.rotation(), pose_a.rotation() * Vector3::ith(random.index(3), 1.0))
    } else {
        (turn, direction)
    };
    Slide { a: a.clone(), pose_a, b: b.clone(), turn, direction }
}

impl Slide {
    /// The second body's pose this far from where the centres coincide, metres.
    pub fn place(&self, offset: f64) -> Pose {
        pose(self.pose_a.translation() + self.direction * offset, &self.turn)
    }

    /// Where to look, relative to the whole slide: from just apart to concentric, and more of it at
    /// both ends.
    pub fn shares() -> Vec<f64> {
        let mut shares: Vec<f64> = (0..=STEPS).map(|k| 1.05 - 1.05 * f64::from(k) / f64::from(STEPS)).collect();
        shares.extend(ENDS.iter().flat_map(|near| [1.0 - near, *near]));
        shares.sort_by(|p, q| q.total_cmp(p));
        shares
    }
}

/// Family 27. A pair whose growth centres are to meet: on the way the seed of the level distance
/// lies inside the other body, while the growth distance is proportional to the offset.
pub struct Saturation {
    pub a: Body,
    pub pose_a: Pose,
    pub b: Body,
    /// Where the second body's origin is when the centres meet, metres.
    pub meet: Vector3<f64>,
    turn: UnitQuaternion<f64>,
    direction: Vector3<f64>,
}

pub fn saturation(zoo: &[Body], random: &mut dyn Draws) -> Saturation {
    let (a, b, _) = any_two(random, zoo);
    let (pose_a, turn, direction) = (random.pose(0.3), random.rotation(), random.unit());
    let meet = pose_a.transform_point(&a.growth_ball().center) - turn * b.growth_ball().center;
    Saturation { a: a.clone(), pose_a, b: b.clone(), meet, turn, direction }
}

impl Saturation {
    /// Offsets of the centres, relative to the sum of the circumradii.
    pub const SHARES: [f64; 12] = [1.2, 0.9, 0.5, 0.3, 0.2, 0.1, 0.03, 1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

    /// Sum of the circumradii, metres.
    pub fn sum(&self) -> f64 {
        self.a.circumscribed().radius + self.b.circumscribed().radius
    }

    /// The second body's pose at one of the [`Self::SHARES`].
    pub fn place(&self, share: f64) -> Pose {
        pose(self.meet + self.direction * (self.sum() * share), &self.turn)
    }

    /// The vector from the first growth centre to the second: poses are rounded, and this is how
    /// far they really are apart, metres.
    pub fn centres(&self, pose_b: &Pose) -> Vector3<f64> {
        let (a, b) = (&self.a.growth_ball().center, &self.b.growth_ball().center);
        pose_b.transform_point(b) - self.pose_a.transform_point(a)
    }

    /// The level of the first body's interior point, where its search begins, in the second body.
    pub fn seed_level(&self, pose_b: &Pose) -> f64 {
        let seed = self.pose_a.transform_point(self.a.interior_point()) - pose_b.translation();
        self.b.value(&pose_b.rotation().inverse_transform_vector(&seed))
    }
}
