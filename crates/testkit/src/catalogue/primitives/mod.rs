//! The families between primitives: boxes, cylinders, balls and ellipsoids, and what no polynomial
//! describes: capsules, segments, points and half-spaces; with each other and beside smooth bodies.
//!
//! Every family goes through [`PAIRS`] by its index, so that each primitive takes part in each.

pub mod contact;
pub mod data;
mod flaw;
mod pair;
pub mod placement;
pub mod scale;
mod shape;
mod solved;

use super::Draws;
use crate::random::{pose, shifted};
pub use flaw::Flaw;
use nalgebra::{UnitQuaternion, Vector3};
pub use pair::Pair;
pub use shape::{Kind, Shape};
pub use solved::{Reference, Solved};
use sublevel_core::measure::Pose;

/// The pairs that measures are defined for, each with both orders.
pub const PAIRS: [[Kind; 2]; 47] = {
    use Kind::{Ball, Capsule, Cuboid, Cut, Cylinder, Ellipsoid, HalfSpace, Point, Segment, Smooth};
    // The first of them have every primitive.
    [
        [Cuboid, Capsule],
        [Ball, Cylinder],
        [HalfSpace, Cuboid],
        [Segment, Ellipsoid],
        [Point, Cylinder],
        [Cuboid, Cuboid],
        [Capsule, Smooth],
        [Cylinder, Cuboid],
        [Capsule, Capsule],
        [Ball, Cuboid],
        [HalfSpace, Cylinder],
        [Cylinder, Smooth],
        [Cylinder, Capsule],
        [Segment, Cuboid],
        [Cuboid, Ellipsoid],
        [Ball, Capsule],
        [Point, Smooth],
        [Cylinder, Cylinder],
        [Cuboid, Smooth],
        [Capsule, Ellipsoid],
        [HalfSpace, Smooth],
        [Segment, Cylinder],
        [Ball, Smooth],
        [Point, Cuboid],
        [Cylinder, Ellipsoid],
        [Segment, Smooth],
        [Segment, Capsule],
        [HalfSpace, Ball],
        [Ball, Ball],
        [Point, Ellipsoid],
        [Segment, Segment],
        [Ellipsoid, Ball],
        [Cut, Capsule],
        [Point, Cut],
        [Segment, Cut],
        [HalfSpace, Cut],
        [Cut, Smooth],
        [Cuboid, Cut],
        [Cut, Cylinder],
        [Ellipsoid, Cut],
        [Ball, Cut],
        [Cut, Cut],
        [Point, Ball],
        [Segment, Ball],
        [HalfSpace, Ellipsoid],
        [HalfSpace, Capsule],
        [HalfSpace, Segment],
    ]
};

/// How many [`PAIRS`] there are.
pub const COUNT: u64 = PAIRS.len() as u64;

/// The shapes of a pair by its index, of these sizes in metres: every other time round in the other
/// order.
fn shapes(index: u64, sizes: [f64; 2], random: &mut dyn Draws) -> [Shape; 2] {
    let kinds = PAIRS[(index % COUNT) as usize];
    let [a, b] = [0, 1].map(|k| Shape::drawn(kinds[k], sizes[k], random));
    if (index / COUNT).is_multiple_of(2) { [a, b] } else { [b, a] }
}

/// Somewhere with the shapes' origins this far from each other, metres, half-spaces turned so that
/// their normals lead to the other one, about.
fn somewhere([a, b]: [Shape; 2], away: f64, reach: f64, random: &mut dyn Draws, what: &str) -> Pair {
    let (pose_a, far) = (random.pose(away), random.pose(reach));
    let pose_b = shifted(&far, *pose_a.translation());
    let between = pose_a.translation() - pose_b.translation();
    let aside = random.unit() * 0.3;
    let facing = |shape: &Shape, from: &Pose, towards: Vector3<f64>| {
        let Shape::HalfSpace = shape else { return *from };
        let n = towards.try_normalize(0.0).unwrap_or_else(Vector3::x) + aside;
        let turn = UnitQuaternion::rotation_between(&Vector3::z(), &n).unwrap_or_default();
        pose(*from.translation(), &turn)
    };
    let (pose_a, pose_b) = (facing(&a, &pose_a, -between), facing(&b, &pose_b, between));
    Pair::new(a, pose_a, b, pose_b, what)
}

/// Apart, by at least half of the sum of the sizes.
fn apart(shapes: [Shape; 2], random: &mut dyn Draws, what: &str) -> Pair {
    let sum: f64 = shapes.iter().map(Shape::reach_m).sum();
    // Of a half-space the height is 0.9 of the distance of the origins at least.
    let reach = 2.5 * if sum > 0.0 { sum } else { 1.0 };
    somewhere(shapes, 0.3, reach, random, what)
}
