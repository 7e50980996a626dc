//! Sizes and units: 9, 10, 11, 12.

use super::super::case::{Case, CaseError};
use super::super::method::pose;
use super::super::zoo::{ZooError, b, c, e, p, q};
use super::{moved_to, random, shifted, somewhere};
use crate::body::Body;
use crate::chart::duel::Random;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;

/// Ratio 10 to 1e6, apart, near, touching and overlapping: error of at most 1e-9 of the smaller and 64 ε of the larger.
pub(super) fn ratio(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(9, seed);
    let ratio = 10_f64.powi((seed % 6) as i32 + 1);
    let any = |random: &mut Random, s: f64| match random.index(5) {
        0 => e(s, 0.6 * s, 0.8 * s),
        1 => q(8, s, 0.5 * s, 0.7 * s),
        2 => p(6, s),
        3 => b(s, 0.4 * s, 0.6 * s),
        _ => c(4, s, 0.5 * s),
    };
    let (a, b) = (any(&mut random, 1.0)?, any(&mut random, 1.0 / ratio)?);
    let (a, b) = if (seed / 30).is_multiple_of(2) { (a, b) } else { (b, a) };
    let sum = a.circumscribed().radius + b.circumscribed().radius;
    let (pose_a, far) = (somewhere(&mut random, 0.5)?, somewhere(&mut random, 2.5 * sum)?);
    let gap = [1.0, 1e-3, 1e-6, -0.1, 0.0][(seed / 6 % 5) as usize];
    let case = Case::new(&a, pose_a, &b, far, format!("ratio {ratio:e}, gap {gap:e} of the smaller"));
    let bound = 1e-9 * case.small() + 64.0 * f64::EPSILON * case.large();
    let gap = gap * case.small();
    // At ratios above 1e5 the default accuracy lies below the rounding floor.
    Ok(Case { bound: Some(bound), floor: 2.0 * bound, ..moved_to(case, gap)? })
}

/// Both 1 to 1e9 m away.
pub(super) fn far_from_the_origin(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(10, seed);
    let bodies = [e(1.0, 0.6, 0.8)?, q(8, 0.5, 1.0, 0.7)?, b(0.5, 0.4, 0.3)?, p(6, 0.8)?, c(6, 0.4, 0.9)?];
    let (a, b) = (&bodies[random.index(5)], &bodies[random.index(5)]);
    let reach = random.positive() * 3.0 + 0.5;
    let away = 10_f64.powi((seed % 10) as i32);
    let along = random.direction() * away;
    let pose_a = shifted(&somewhere(&mut random, 0.5)?, along)?;
    let pose_b = shifted(&somewhere(&mut random, reach)?, along)?;
    Ok(Case::new(a, pose_a, b, pose_b, format!("{away:e} m from the origin")))
}

/// Everything 1e-9 to 1e9 times as large.
pub(super) fn units(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(11, seed);
    let s = 10_f64.powi((seed % 19) as i32 - 9);
    let (a, b) = match random.index(4) {
        0 => (e(s, 0.6 * s, 0.8 * s)?, e(0.3 * s, 0.9 * s, 0.5 * s)?),
        1 => (q(8, s, 0.5 * s, 0.7 * s)?, q(4, 0.4 * s, 0.5 * s, 0.3 * s)?),
        2 => (p(6, s)?, q(6, 0.5 * s, 0.6 * s, 0.7 * s)?),
        _ => (b(s, 0.4 * s, 0.6 * s)?, c(4, s, 0.5 * s)?),
    };
    let reach = 3.5 * random.positive() * s;
    let (pose_a, pose_b) = (somewhere(&mut random, 0.5 * s)?, somewhere(&mut random, reach)?);
    Ok(Case::new(&a, pose_a, &b, pose_b, format!("unit {s:e} m")))
}

/// Aspects of 1e2 to 1e5: near each other, or lying on a plate.
pub(super) fn needles(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(12, seed);
    let aspect = 10_f64.powi((seed % 4) as i32 + 2);
    let thin = 1.0 / aspect;
    let needle = |which: usize| -> Result<Body, ZooError> {
        match which {
            0 => e(thin, thin, 1.0),
            1 => q(8, thin, thin, 1.0),
            2 => q(4, thin, 2.0 * thin, 1.0),
            3 => b(thin, thin, 1.0),
            _ => c(6, thin, 1.0),
        }
    };
    let first = needle(random.index(5))?;
    let second = match random.index(7) {
        0 => b(1.0, 1.0, 1e-3)?,
        1 => q(8, 1.0, 1.0, thin)?,
        2 => e(1.0, 1.0, thin)?,
        3 => b(1.0, 0.5, thin)?,
        4 => c(8, 1.0, thin)?,
        which => needle(which - 5)?,
    };
    if seed / 4 % 5 == 4 {
        let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * FRAC_PI_2);
        let (flat, plate) =
            (pose(Vector3::new(0.1, 0.2, 0.01), &lying)?, pose(Vector3::zeros(), &UnitQuaternion::identity())?);
        return Ok(Case::new(&first, flat, &second, plate, format!("aspect {aspect:e}, lying, 1 cm up")));
    }
    let gap = [1.0, 1e-3, 0.1 * thin, -0.1 * thin][(seed / 4 % 5) as usize];
    let (pose_a, far) = (somewhere(&mut random, 0.2)?, somewhere(&mut random, 3.5)?);
    moved_to(Case::new(&first, pose_a, &second, far, format!("aspect {aspect:e}, gap {gap:e} m")), gap)
}
