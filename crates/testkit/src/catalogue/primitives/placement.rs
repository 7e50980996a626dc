//! Where primitives stand: 2, 4, 5, 6, 7, 18, 19.

use super::super::Draws;
use super::super::placement::{CARRIED, inner};
use super::{COUNT, Kind, PAIRS, Pair, Shape, shapes, somewhere};
use crate::random::{pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::measure::{Capsule, Pose};

/// Families 2, 4 and 18. Up to so many sizes apart, or in each other.
pub fn anywhere(index: u64, [near, far]: [f64; 2], random: &mut dyn Draws, what: &str) -> Pair {
    let shapes = shapes(index, [1.0, 1.0], random);
    let sum: f64 = shapes.iter().map(Shape::reach_m).sum();
    let reach = random.between(near, far) * if sum > 0.0 { sum } else { 1.0 };
    somewhere(shapes, 0.5, reach, random, what)
}

/// A point well inside.
fn inside(shape: &Shape, random: &mut dyn Draws) -> Vector3<f64> {
    match shape {
        Shape::Body(body) => inner(body, random),
        Shape::Capsule(capsule) => {
            let along = Vector3::z() * (0.9 * capsule.half_height_m() * random.signed());
            along + random.unit() * (0.9 * capsule.radius_m() * random.positive())
        }
        Shape::Point => Vector3::zeros(),
        Shape::HalfSpace => Vector3::new(random.signed(), random.signed(), -random.between(1e-3, 10.0)),
    }
}

/// Family 5. With a common point well inside of both; of segments and points on them. Two shapes
/// without an inside meet in no ball.
pub fn common_point(index: u64, random: &mut dyn Draws) -> Pair {
    let [a, b] = shapes(index, [1.0, 1.0], random);
    let (x, y) = (inside(&a, random), inside(&b, random));
    let (pose_a, turn) = (random.pose(0.5), random.rotation());
    let pose_b = pose(pose_a.transform_point(&x) - turn * y, &turn);
    Pair::new(a, pose_a, b, pose_b, "in overlap")
}

/// Cases of [`along_an_axis`]: all pairs along 3 axes by 14 shifts.
pub const ALONG_AN_AXIS: u64 = 3 * 14 * COUNT;

/// Family 6. Of the same sizes, or over a half-space, with integer coordinates: each mirrors itself
/// in the planes of the axes, so that the distance is what the offset exceeds both half-sizes by.
pub fn along_an_axis(index: u64) -> Pair {
    let sizes = [1.0, 2.0, 3.0];
    let kinds = PAIRS[(index % COUNT) as usize];
    let shifts = [-12.0, -7.0, -6.0, -5.0, -4.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 8.0, 100.0];
    let axis = (index / COUNT % 3) as usize;
    let shift: f64 = shifts[(index / (3 * COUNT) % 14) as usize];
    let [half_a, half_b] = kinds.map(|kind| Shape::halves(kind, sizes)[axis]);
    let [a, b] = kinds.map(|kind| Shape::of_sizes(kind, sizes));
    let toward = Vector3::ith(axis, 1.0);
    let is_over = kinds[0] == Kind::HalfSpace;
    let turn = if is_over {
        UnitQuaternion::rotation_between(&Vector3::z(), &toward).unwrap_or_default()
    } else {
        UnitQuaternion::identity()
    };
    let place = pose(toward * shift, &UnitQuaternion::identity());
    let offset = if is_over { shift } else { shift.abs() };
    let exact = (offset - half_a - half_b).max(0.0);
    let pair = Pair::new(a, pose(Vector3::zeros(), &turn), b, place, format!("{shift} m along axis {axis}"));
    Pair { exact: Some(exact), bound: Some(1e-9 * pair.size()), ..pair }
}

/// Family 7. Turned alike, origins this far from each other, metres.
pub fn concentric(index: u64, offset: f64, random: &mut dyn Draws) -> Pair {
    let [a, b] = PAIRS[(index % COUNT) as usize].map(|kind| Shape::centred(kind, 1.0, random));
    let pose_a = random.pose(0.0);
    let pose_b = pose(random.unit() * offset, pose_a.rotation());
    Pair::new(a, pose_a, b, pose_b, format!("centres {offset:e} m apart"))
}

/// Family 18. A pair, and others whose hints it is to be asked with: a pose before, other shapes,
/// the same ones swapped, the other side of the world, and coincident frames.
pub fn bad_hints(index: u64, random: &mut dyn Draws) -> (Pair, Vec<Pair>) {
    let pair = anywhere(index, [0.3, 3.0], random, "hints");
    let another = anywhere(random.index(COUNT as usize) as u64, [0.3, 3.0], random, "another pair");
    let step = random.unit() * (0.01 * pair.size());
    let before = Pair { pose_b: shifted(&pair.pose_b, step), ..pair.clone() };
    let half_turn = UnitQuaternion::from_scaled_axis(random.unit() * std::f64::consts::PI);
    let behind =
        pose(-pair.pose_b.translation(), &UnitQuaternion::new_normalize(*(half_turn * pair.pose_b.rotation())));
    let sources = vec![
        before,
        another,
        pair.clone().swapped(),
        Pair { pose_b: behind, ..pair.clone() },
        Pair { pose_b: pair.pose_a, ..pair.clone() },
    ];
    (pair, sources)
}

/// Family 19. As it is, with the arguments swapped, and with both carried along by a motion.
pub fn swapped(index: u64, random: &mut dyn Draws) -> [Pair; 3] {
    let pair = anywhere(index, [0.3, 5.0], random, "as it is");
    let (turn, shift) = (random.rotation(), random.unit() * CARRIED);
    let carried = |from: &Pose| {
        let rotation = UnitQuaternion::new_normalize(*(turn * from.rotation()));
        shifted(&pose(turn * from.translation(), &rotation), shift)
    };
    [pair.clone(), pair.clone().swapped(), pair.carried(carried)]
}

/// A capsule in a body of two parts that mirror each other, for family 21.
pub fn limb() -> Capsule {
    Capsule::new(0.2, 0.4).expect("sizes are not negative")
}
