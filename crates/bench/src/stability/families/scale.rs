//! Sizes and units: 9, 10, 11, 12.

use super::super::method::{Answer, Method};
use super::super::question::{CaseError, Question, Verdict};
use super::draws::random;
use sublevel::measure::Distance;
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::catalogue::scale::{self, DOUBLINGS, NEEDLE_SETTINGS, NEEDLES, PARTNERS, UNIT_PAIRS};

pub(super) fn ratio(seed: u64) -> Case {
    let [_, near] = scale::ratio(seed, &mut random(9, seed));
    near
}

pub(super) fn far_from_the_origin(seed: u64) -> Vec<Case> {
    scale::far_from_the_origin((seed % 10) as i32, &mut random(10, seed)).into()
}

/// The same value but for what the coordinates lose.
pub(super) fn unmoved(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, near), (there, far)] = answers else { return Ok(Verdict::Pass) };
    let (Some(one), Some(other)) = (near.value, far.value) else { return Ok(Verdict::NoAnswer) };
    let lost = 4.0 * f64::EPSILON * there.pose_a.translation().norm();
    let slack = if method.is_ours() { case.slack(method) } else { 2.0 * case.slack(method) };
    let off = (one - other).abs() - lost;
    Ok(if off <= slack { Verdict::Pass } else { Verdict::Off(off / case.small()) })
}

pub(super) fn units(seed: u64) -> Vec<Case> {
    let mut random = random(11, seed);
    let scales = scale::scales();
    let pair = random.index(UNIT_PAIRS);
    scale::units(pair, scales[seed as usize % scales.len()], &mut random).into()
}

/// The same in other units: of ours, bit for bit with as many iterations where nothing rounds,
/// elsewhere within the brackets.
pub(super) fn unscaled(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, one), (scaled, other)] = answers else { return Ok(Verdict::Pass) };
    let (Some(value), Some(found)) = (one.value, other.value) else { return Ok(Verdict::NoAnswer) };
    // Exactly, where it is a power of two.
    let s = scaled.pose_b.translation().x / case.pose_b.translation().x;
    let off = (found / s - value).abs();
    if let (Some(one), Some(other)) = (&one.ours, &other.ours) {
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

pub(super) fn needles(seed: u64) -> Case {
    let mut random = random(12, seed);
    let aspect = 10_f64.powi((seed % 4) as i32 + 2);
    let pair = (random.index(NEEDLES), random.index(PARTNERS));
    let setting = seed as usize / 4 % NEEDLE_SETTINGS;
    scale::needles(aspect, pair, setting, &mut random).remove(usize::from(setting < 4))
}
