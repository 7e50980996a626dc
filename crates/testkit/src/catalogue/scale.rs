//! Sizes and units: 9, 10, 11, 12.

use super::{Case, Draws};
use crate::bodies::{b, c, e, p, q};
use crate::random::{pose, shifted};
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Family 9. Ratio 10 to 1e6, far apart, and then apart, near, touching or overlapping: error of
/// at most 1e-9 of the smaller and 64 ε of the larger circumradius. The index goes through all
/// ratios, gaps and orders in 60.
pub fn ratio(index: u64, random: &mut dyn Draws) -> [Case; 2] {
    let ratio = 10_f64.powi((index % 6) as i32 + 1);
    let (a, b) = (any_of_size(1.0, random), any_of_size(1.0 / ratio, random));
    let (a, b) = if (index / 30).is_multiple_of(2) { (a, b) } else { (b, a) };
    let sum = a.circumscribed().radius + b.circumscribed().radius;
    let (pose_a, far) = (random.pose(0.5), random.pose(2.5 * sum));
    let gap = [1.0, 1e-3, 1e-6, -0.1, 0.0][(index / 6 % 5) as usize];
    let case = Case::new(&a, pose_a, &b, far, format!("ratio {ratio:e}, gap {gap:e} of the smaller"));
    let bound = 1e-9 * case.small() + 64.0 * f64::EPSILON * case.large();
    let gap = gap * case.small();
    // At ratios above 1e5 the default accuracy lies below the rounding floor.
    let far = Case { bound: Some(bound), floor: 2.0 * bound, ..case };
    [far.clone(), far.moved_to(gap)]
}

fn any_of_size(s: f64, random: &mut dyn Draws) -> Body {
    match random.index(5) {
        0 => e(s, 0.6 * s, 0.8 * s),
        1 => q(8, s, 0.5 * s, 0.7 * s),
        2 => p(6, s),
        3 => b(s, 0.4 * s, 0.6 * s),
        _ => c(4, s, 0.5 * s),
    }
}

/// Family 10. Near the origin, and both carried `10^power` metres away, power 0 to 9.
pub fn far_from_the_origin(power: i32, random: &mut dyn Draws) -> [Case; 2] {
    let bodies = [e(1.0, 0.6, 0.8), q(8, 0.5, 1.0, 0.7), b(0.5, 0.4, 0.3), p(6, 0.8), c(6, 0.4, 0.9)];
    let (a, b) = (&bodies[random.index(5)], &bodies[random.index(5)]);
    let reach = random.positive() * 3.0 + 0.5;
    let away = 10_f64.powi(power);
    let along = random.unit() * away;
    let (pose_a, pose_b) = (random.pose(0.5), random.pose(reach));
    [
        Case::new(a, pose_a, b, pose_b, "near the origin"),
        Case::new(a, shifted(&pose_a, along), b, shifted(&pose_b, along), format!("{away:e} m from the origin")),
    ]
}

/// Powers of two that everything is scaled by, beside those of ten: with them nothing rounds.
pub const DOUBLINGS: [i32; 7] = [-29, -20, -9, -1, 4, 15, 29];

/// Scales of family 11.
pub fn scales() -> Vec<f64> {
    (-9..=9).map(|k| 10_f64.powi(k)).chain(DOUBLINGS.map(|k| 2_f64.powi(k))).collect()
}

/// Pairs of family 11.
pub const UNIT_PAIRS: usize = 4;

/// Family 11. One of the pairs as it is, and everything `s` times as large.
pub fn units(pair: usize, s: f64, random: &mut dyn Draws) -> [Case; 2] {
    let reach = 3.5 * random.positive();
    let (pose_a, pose_b) = (random.pose(0.5), random.pose(reach));
    [1.0, s].map(|s| {
        let (a, b) = match pair {
            0 => (e(s, 0.6 * s, 0.8 * s), e(0.3 * s, 0.9 * s, 0.5 * s)),
            1 => (q(8, s, 0.5 * s, 0.7 * s), q(4, 0.4 * s, 0.5 * s, 0.3 * s)),
            2 => (p(6, s), q(6, 0.5 * s, 0.6 * s, 0.7 * s)),
            _ => (b(s, 0.4 * s, 0.6 * s), c(4, s, 0.5 * s)),
        };
        let times = |from: &Pose| pose(from.translation() * s, from.rotation());
        Case::new(&a, times(&pose_a), &b, times(&pose_b), format!("unit {s:e} m"))
    })
}

/// Needles of family 12, and partners of each: five plates and two of the needles.
pub const NEEDLES: usize = 5;
/// See [`NEEDLES`].
pub const PARTNERS: usize = 7;
/// Settings of [`needles`]: four gaps, and lying on the partner.
pub const NEEDLE_SETTINGS: usize = 5;

/// Unit length, `thin` across.
fn needle(which: usize, thin: f64) -> Body {
    match which {
        0 => e(thin, thin, 1.0),
        1 => q(8, thin, thin, 1.0),
        2 => q(4, thin, 2.0 * thin, 1.0),
        3 => b(thin, thin, 1.0),
        _ => c(6, thin, 1.0),
    }
}

/// Family 12. Aspects of 1e2 to 1e5: near each other, or lying on a plate. Those that are moved
/// near each other come with where they were before, first.
pub fn needles(aspect: f64, (which, partner): (usize, usize), setting: usize, random: &mut dyn Draws) -> Vec<Case> {
    let thin = 1.0 / aspect;
    let first = needle(which, thin);
    let second = match partner {
        0 => b(1.0, 1.0, 1e-3),
        1 => q(8, 1.0, 1.0, thin),
        2 => e(1.0, 1.0, thin),
        3 => b(1.0, 0.5, thin),
        4 => c(8, 1.0, thin),
        which => needle(which - 5, thin),
    };
    if setting == 4 {
        // Parallel to the plate, as needles lie on tables.
        let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * FRAC_PI_2);
        let flat = pose(Vector3::new(0.1, 0.2, 0.01), &lying);
        return vec![Case::new(&first, flat, &second, Pose::identity(), format!("aspect {aspect:e}, lying, 1 cm up"))];
    }
    let gap = [1.0, 1e-3, 0.1 * thin, -0.1 * thin][setting];
    let (pose_a, far) = (random.pose(0.2), random.pose(3.5));
    let far = Case::new(&first, pose_a, &second, far, format!("aspect {aspect:e}, gap {gap:e} m"));
    vec![far.clone(), far.moved_to(gap)]
}

/// Small and thin partners of fitted bodies, which take part in 9 to 12 by them.
pub fn small_and_thin() -> [Body; 3] {
    [e(1e-3, 1e-3, 1e-3), q(8, 1e-4, 1e-4, 0.3), b(1.0, 1.0, 1e-3)]
}

/// A fitted body up to 2 m from a small or thin one.
pub fn beside_small(body: &Body, other: &Body, random: &mut dyn Draws) -> Case {
    let reach = 2.0 * random.positive();
    let (pose_a, pose_b) = (random.pose(0.2), random.pose(reach));
    Case::new(body, pose_a, other, pose_b, "small or thin")
}
