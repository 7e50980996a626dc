//! Sizes and units of primitives: 9, 10, 11, 12.

use super::super::Draws;
use super::{Kind, Pair, Shape, apart, shapes, somewhere};
use crate::random::{Seeded, pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;
use sublevel_core::measure::Pose;

/// Family 9. Ratio 10 to 1e6; apart, near, touching or overlapping: error of at most 1e-9 of the
/// smaller and 64 ε of the larger body, of capsules beside flat sides the floor that
/// `Options::with_accuracy` states. A half-space is as large as the coordinates it is at.
pub fn ratio(index: u64, random: &mut dyn Draws) -> Pair {
    let ratio = 10_f64.powi(random.index(6) as i32 + 1);
    let gap = [1.0, 1e-3, 1e-6, -0.1, 0.0][random.index(5)];
    let sizes = if random.index(2) == 0 { [1.0, 1.0 / ratio] } else { [1.0 / ratio, 1.0] };
    let what = format!("ratio {ratio:e}, gap {gap:e} of the smaller");
    let pair = apart(shapes(index, sizes, random), random, &what);
    let (small, large) = (pair.size(), pair.a.reach_m().max(pair.b.reach_m()));
    let is_endless = matches!((&pair.a, &pair.b), (Shape::HalfSpace, _) | (_, Shape::HalfSpace));
    let coordinates = pair.pose_a.translation().norm() + pair.pose_b.translation().norm();
    let of_larger = if pair.bodies().is_none() && !is_endless && (pair.a.is_flat() || pair.b.is_flat()) {
        1e-12 * (large + (pair.pose_a.translation() - pair.pose_b.translation()).norm())
    } else {
        64.0 * f64::EPSILON * if is_endless { large + coordinates } else { large }
    };
    let bound = 1e-9 * small + of_larger;
    Pair { bound: Some(bound), floor: 2.0 * bound, ..pair }.moved_to(gap * small)
}

/// Family 10. Near the origin, and both carried `10^power` metres away, power 0 to 9.
pub fn far_from_the_origin(index: u64, power: i32, random: &mut dyn Draws) -> [Pair; 2] {
    let shapes = shapes(index, [1.0, 1.0], random);
    let sum: f64 = shapes.iter().map(Shape::reach_m).sum();
    let reach = sum * (0.3 + 1.2 * random.positive());
    let near = somewhere(shapes, 0.5, reach, random, "near the origin");
    let away = 10_f64.powi(power);
    let along = random.unit() * away;
    let far = near.clone().carried(|from| shifted(from, along));
    let what = format!("{}, carried {away:e} m away", near.what);
    [near, Pair { what, ..far }]
}

/// Family 11. A pair as it is, and everything `s` times as large.
pub fn units(index: u64, s: f64, seed: u64) -> [Pair; 2] {
    [1.0, s].map(|s| in_unit(index, s, seed))
}

/// One of [`units`].
pub fn in_unit(index: u64, s: f64, seed: u64) -> Pair {
    let random = &mut Seeded(seed);
    let shapes = shapes(index, [s, s], random);
    let reach = 3.5 * random.positive();
    let pair = somewhere(shapes, 0.5, reach, random, &format!("unit {s:e} m"));
    pair.carried(|from| pose(from.translation() * s, from.rotation()))
}

/// Needles of family 12 and partners of each.
pub const NEEDLES: u64 = 6;
/// See [`NEEDLES`].
pub const PARTNERS: u64 = 10;
/// Aspects of each pair, 1e2 and more.
const ASPECTS: u64 = 5;

/// Family 12. Aspects of 1e2 to 1e6: near each other, or lying on a plate. None where no measure is
/// for the two.
pub fn needles(index: u64, random: &mut dyn Draws) -> Option<Pair> {
    let of = Shape::of_sizes;
    let thin = 10_f64.powi(-((index / (NEEDLES * PARTNERS) % ASPECTS) as i32 + 2));
    let first = match index % NEEDLES {
        0 => of(Kind::Capsule, [thin, thin, 1.0]),
        1 => of(Kind::Cylinder, [thin, thin, 1.0]),
        2 => of(Kind::Cuboid, [thin, 2.0 * thin, 1.0]),
        3 => of(Kind::Segment, [0.0, 0.0, 1.0]),
        4 => of(Kind::Ellipsoid, [thin, 2.0 * thin, 1.0]),
        _ => of(Kind::Cut, [thin, 2.0 * thin, 1.0]),
    };
    let second = match index / NEEDLES % PARTNERS {
        0 => of(Kind::Cuboid, [1.0, 1.0, 1e-3]),
        1 => of(Kind::Cylinder, [1.0, 1.0, thin]),
        2 => of(Kind::Ellipsoid, [1.0, 1.0, thin]),
        3 => of(Kind::Capsule, [thin, thin, 1.0]),
        4 => of(Kind::Smooth, [1.0, 1.0, thin]),
        5 => of(Kind::Cuboid, [1.0, 0.5, thin]),
        6 => of(Kind::Ball, [thin; 3]),
        7 => Shape::HalfSpace,
        8 => of(Kind::Cut, [1.0, 1.0, thin]),
        _ => Shape::Point,
    };
    if matches!((&first, &second), (Shape::Capsule(_), Shape::Point)) {
        return None;
    }
    let setting = random.index(5);
    if setting == 4 && !matches!(second, Shape::HalfSpace) {
        // Parallel to the plate, as needles lie on tables.
        let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * FRAC_PI_2);
        let flat = pose(Vector3::new(0.1, 0.2, 0.03), &lying);
        return Some(Pair::new(first, flat, second, Pose::identity(), format!("aspect {:e}, lying", 1.0 / thin)));
    }
    let gap = [1.0, 1e-3, 0.1 * thin, -0.1 * thin, 0.0][setting];
    let far = apart([first, second], random, &format!("aspect {:e}, gap {gap:e} m", 1.0 / thin));
    Some(far.moved_to(gap))
}

/// All of them.
pub const ALL_NEEDLES: u64 = ASPECTS * NEEDLES * PARTNERS;
