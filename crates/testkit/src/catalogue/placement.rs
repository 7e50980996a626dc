//! Where bodies stand: far apart, overlapping, aligned, concentric, swapped: 4, 5, 6, 7, 19.

use super::{Case, Draws, any_two};
use crate::bodies::{b, c, cylinder, e, q};
use crate::random::{pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Poses of the second body of a case of [`far_apart`]: a batch.
pub const POSES: usize = 9;

/// Family 4. Up to a hundred sizes apart: a pair, the second body at the first of its poses, and
/// all of these.
pub fn far_apart(zoo: &[Body], random: &mut dyn Draws) -> (Case, [Pose; POSES]) {
    let (a, b, sum) = any_two(random, zoo);
    let pose_a = random.pose(1.0);
    let poses = [(); POSES].map(|()| {
        let reach = sum * random.between(0.2, 100.0);
        random.pose(reach)
    });
    (Case::new(a, pose_a, b, poses[0], "far apart"), poses)
}

/// Level of both bodies below which the common point of family 5 lies.
pub const INNER: f64 = 0.9;

/// A point of the body frame where the largest constraint is below [`INNER`].
pub(super) fn inner(body: &Body, random: &mut dyn Draws) -> Vector3<f64> {
    loop {
        let x = body.boundary_along(&random.unit());
        let point = body.interior_point() + (x - body.interior_point()) * random.positive();
        if body.value(&point) < INNER {
            return point;
        }
    }
}

/// Family 5. Overlapping by construction.
pub fn common_point(zoo: &[Body], random: &mut dyn Draws) -> Case {
    let (a, b, _) = any_two(random, zoo);
    let (x, y) = (inner(a, random), inner(b, random));
    let (pose_a, turn) = (random.pose(0.5), random.rotation());
    let pose_b = pose(pose_a.transform_point(&x) - turn * y, &turn);
    Case { exact: Some(0.0), bound: Some(0.0), ..Case::new(a, pose_a, b, pose_b, "in overlap") }
}

/// Cases of [`along_an_axis`]: 8 bodies along 3 axes by 14 shifts.
pub const ALONG_AN_AXIS: u64 = 336;

/// Family 6. Identical bodies with integer coordinates: the distance is what the offset exceeds
/// twice the half-axis by.
pub fn along_an_axis(index: u64) -> Case {
    let (body, halves) = match index % 8 {
        0 => (e(1.0, 1.0, 1.0), [1.0, 1.0, 1.0]),
        1 => (e(2.0, 1.0, 3.0), [2.0, 1.0, 3.0]),
        2 => (q(4, 1.0, 2.0, 3.0), [1.0, 2.0, 3.0]),
        3 => (q(6, 2.0, 2.0, 2.0), [2.0, 2.0, 2.0]),
        4 => (q(8, 1.0, 1.0, 4.0), [1.0, 1.0, 4.0]),
        5 => (b(1.0, 2.0, 3.0), [1.0, 2.0, 3.0]),
        6 => (cylinder(1.0, 2.0), [1.0, 1.0, 2.0]),
        _ => (c(6, 1.0, 2.0), [1.0, 1.0, 2.0]),
    };
    let shifts = [-9.0, -5.0, -4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 100.0];
    let axis = (index / 8 % 3) as usize;
    let shift: f64 = shifts[(index / 24 % 14) as usize];
    let place = pose(Vector3::ith(axis, shift), &UnitQuaternion::identity());
    let exact = (shift.abs() - 2.0 * halves[axis]).max(0.0);
    let case = Case::new(&body, Pose::identity(), &body, place, format!("{shift} m along axis {axis}"));
    Case { exact: Some(exact), bound: Some(1e-9 * case.small()), ..case }
}

/// Offsets of family 7, metres.
pub const OFFSETS: [f64; 8] = [0.0, 1e-18, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9, 1e-6];

/// Family 7. Bodies turned alike whose interior points are this far from each other, metres: of
/// fitted bodies those are not the origins.
pub fn concentric(a: &Body, b: &Body, offset: f64, random: &mut dyn Draws) -> Case {
    let pose_a = random.pose(0.0);
    let meet = pose_a.transform_point(a.interior_point()) - pose_a.rotation() * b.interior_point();
    let pose_b = pose(meet + random.unit() * offset, pose_a.rotation());
    let case = Case::new(a, pose_a, b, pose_b, format!("centres {offset:e} m apart"));
    Case { exact: Some(0.0), bound: Some(0.0), ..case }
}

/// How far both bodies of family 19 are carried, metres.
pub const CARRIED: f64 = 3.0;

/// Family 19. As it is, with the arguments swapped, and with both carried along by a motion.
pub fn swapped(zoo: &[Body], random: &mut dyn Draws) -> [Case; 3] {
    let (a, b, sum) = any_two(random, zoo);
    let reach = sum * random.between(0.3, 5.0);
    let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
    let (turn, shift) = (random.rotation(), random.unit() * CARRIED);
    let carried = |from: &Pose| {
        let rotation = UnitQuaternion::new_normalize(*(turn * from.rotation()));
        shifted(&pose(turn * from.translation(), &rotation), shift)
    };
    [
        Case::new(a, pose_a, b, pose_b, "as it is"),
        Case::new(b, pose_b, a, pose_a, "swapped"),
        Case::new(a, carried(&pose_a), b, carried(&pose_b), "carried along"),
    ]
}
