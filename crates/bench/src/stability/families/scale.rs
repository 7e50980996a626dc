//! Sizes and units: 9, 10, 11, 12.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Answer, Method, pose};
use super::super::zoo::{ZooError, b, c, e, p, q};
use super::{moved_to, random, shifted, somewhere};
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::FRAC_PI_2;
use sublevel::body::Body;
use sublevel::measure::{Distance, Pose};

/// Ratio 10 to 1e6, apart, near, touching and overlapping: error of at most 1e-9 of the smaller and
/// 64 ε of the larger.
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

/// Near the origin, and both carried 1 to 1e9 m away.
pub(super) fn far_from_the_origin(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(10, seed);
    let bodies = [e(1.0, 0.6, 0.8)?, q(8, 0.5, 1.0, 0.7)?, b(0.5, 0.4, 0.3)?, p(6, 0.8)?, c(6, 0.4, 0.9)?];
    let (a, b) = (&bodies[random.index(5)], &bodies[random.index(5)]);
    let reach = random.positive() * 3.0 + 0.5;
    let away = 10_f64.powi((seed % 10) as i32);
    let along = random.direction() * away;
    let (pose_a, pose_b) = (somewhere(&mut random, 0.5)?, somewhere(&mut random, reach)?);
    Ok(vec![
        Case::new(a, pose_a, b, pose_b, "near the origin".into()),
        Case::new(a, shifted(&pose_a, along)?, b, shifted(&pose_b, along)?, format!("{away:e} m from the origin")),
    ])
}

/// The same value but for what the coordinates lose.
pub(super) fn unmoved(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, near), (there, far)] = answers else { return Ok(Verdict::Pass) };
    let (Some(one), Some(other)) = (near.value, far.value) else { return Ok(Verdict::NoAnswer) };
    let lost = 4.0 * f64::EPSILON * there.pose_a.translation().norm();
    let slack = if method.is_ours() { case.slack(method) } else { 2.0 * case.slack(method) };
    let off = (one - other).abs() - lost;
    Ok(if off <= slack { Verdict::Pass } else { Verdict::Off(off / case.small()) })
}

/// Powers of two that everything is scaled by, beside those of ten: with them nothing rounds.
const DOUBLINGS: [i32; 7] = [-29, -20, -9, -1, 4, 15, 29];

/// As it is, and everything 1e-9 to 1e9 times as large.
pub(super) fn units(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(11, seed);
    let s = match (seed % 26) as usize {
        k @ ..19 => 10_f64.powi(k as i32 - 9),
        k => 2_f64.powi(DOUBLINGS[k - 19]),
    };
    let kind = random.index(4);
    let reach = 3.5 * random.positive();
    let (pose_a, pose_b) = (somewhere(&mut random, 0.5)?, somewhere(&mut random, reach)?);
    let at_unit = |s: f64| -> Result<Case, CaseError> {
        let (a, b) = match kind {
            0 => (e(s, 0.6 * s, 0.8 * s)?, e(0.3 * s, 0.9 * s, 0.5 * s)?),
            1 => (q(8, s, 0.5 * s, 0.7 * s)?, q(4, 0.4 * s, 0.5 * s, 0.3 * s)?),
            2 => (p(6, s)?, q(6, 0.5 * s, 0.6 * s, 0.7 * s)?),
            _ => (b(s, 0.4 * s, 0.6 * s)?, c(4, s, 0.5 * s)?),
        };
        let times = |from: &Pose| pose(from.translation() * s, from.rotation());
        Ok(Case::new(&a, times(&pose_a)?, &b, times(&pose_b)?, format!("unit {s:e} m")))
    };
    Ok(vec![at_unit(1.0)?, at_unit(s)?])
}

/// The same in other units: of ours, bit for bit with as many iterations where nothing rounds,
/// elsewhere within the brackets.
pub(super) fn unscaled(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, one), (scaled, other)] = answers else { return Ok(Verdict::Pass) };
    let (Some(value), Some(found)) = (one.value, other.value) else { return Ok(Verdict::NoAnswer) };
    // Exactly, where it is a power of two.
    let s = scaled.pose_b.translation().x / case.pose_b.translation().x;
    let off = (found / s - value).abs();
    if let (Some(one), Some(other)) = (&one.answer, &other.answer) {
        let is_exact = s == 1.0 || DOUBLINGS.iter().any(|k| s == 2_f64.powi(*k));
        let brackets = |answer: &Distance, s: f64| [answer.lower / s, answer.upper / s];
        let ([low, high], [lower, upper]) = (brackets(one, 1.0), brackets(other, s));
        if is_exact && ([low, high] != [lower, upper] || one.iterations != other.iterations) {
            let iterations = [one.iterations, other.iterations];
            return Ok(Verdict::WrongStatus(format!("changed by {off:e} m, iterations {iterations:?}")));
        }
        let apart = (low - upper).max(lower - high) - 16.0 * f64::EPSILON * (value + case.large());
        if !(apart <= 0.0) {
            return Ok(Verdict::Off(apart / case.small()));
        }
    }
    let slack = if method.is_ours() { case.slack(method) } else { 2.0 * case.slack(method) };
    Ok(if off <= slack { Verdict::Pass } else { Verdict::Off(off / case.small()) })
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
