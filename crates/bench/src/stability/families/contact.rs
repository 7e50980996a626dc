//! Touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use super::super::method::{Answer, Method};
use super::super::question::{CaseError, Question, Verdict};
use super::derivatives::both_sides;
use super::draws::{permuted_index, random};
use sublevel::measure::{DEFAULT_ACCURACY, Status};
use sublevel_testkit::catalogue::contact::{self, GRAZE, SMOOTH, TOUCHING};
use sublevel_testkit::catalogue::{Case, Draws};

/// Normals may be off by about this.
const NORMAL: f64 = 1e-6;

/// All settings, and beyond the first round of them other sizes.
pub(super) fn kissing(seed: u64) -> Vec<Case> {
    let index = permuted_index(seed, contact::KISSING);
    let mut random = random(1, seed);
    let stretch: Option<&mut dyn Draws> = if seed < contact::KISSING { None } else { Some(&mut random) };
    contact::kissing(index, stretch)
}

/// From gap to gap no value falls, and no normal leaves the axis.
pub(super) fn rising(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let mut last = f64::NEG_INFINITY;
    for (case, answer) in answers {
        let Some(value) = answer.value else { return Ok(Verdict::NoAnswer) };
        let offset = case.pose_b.translation();
        let slack = if method.is_ours() { 4.0 * f64::EPSILON * offset.norm() } else { 2.0 * case.slack(method) };
        if !(value >= last - slack) {
            return Ok(Verdict::Off((last - value) / case.small()));
        }
        last = value;
        let Some(ours) = &answer.ours else { continue };
        match ours.normal {
            // From the second body to the first.
            Some(n) => {
                let angle = (n + offset.normalize()).norm();
                if !(angle <= NORMAL) {
                    return Ok(Verdict::Off(angle));
                }
            }
            None if ours.lower > 0.0 => return Ok(Verdict::NoAnswer),
            None => {}
        }
    }
    Ok(Verdict::Pass)
}

pub(super) fn parallel_faces(seed: u64) -> Case {
    contact::parallel_faces(permuted_index(seed, contact::PARALLEL_FACES))
}

/// Touching pairs: the height along the normal is the distance up to what a deviation of [`NORMAL`]
/// costs; and without a gap, on both sides of contact, the signed distance has the slopes that it
/// says.
pub(super) fn normal(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let gap = TOUCHING[(seed % 5) as usize];
    let case = Question(contact::touching(gap, &mut random(8, seed)));
    let Some(proposal) = case.proposed(method)? else { return Ok(None) };
    let truth = case.truth(std::slice::from_ref(&proposal))?;
    let between = || proposal.points.and_then(|[x, y]| (x - y).try_normalize(0.0));
    if let Some(n) = proposal.normal.or_else(between) {
        let lost = truth.upper - case.height_at(&n, &proposal) - truth.floor;
        // Turned by an angle, the height falls by half its square times the bodies' curvature
        // radii, or less.
        let allowed = 8.0 * NORMAL * NORMAL * case.large();
        if !(lost <= allowed) {
            return Ok(Some(Verdict::Off((lost / case.large() / 8.0).sqrt())));
        }
    } else if truth.lower > 2.0 * truth.floor {
        // Nothing has to be said of a gap that may be none.
        return Ok(Some(Verdict::NoAnswer));
    }
    // Batches, and others, answer with distances alone, which have no slopes in overlap.
    if gap > 0.0 || !matches!(method, Method::Cold | Method::Warm) {
        return Ok(Some(Verdict::Pass));
    }
    both_sides(&Question(Case { accuracy: DEFAULT_ACCURACY, ..case.0 }), method).map(Some)
}

pub(super) fn parallel_flats(seed: u64) -> Case {
    contact::parallel_flats(permuted_index(seed, contact::PARALLEL_FLATS))
}

pub(super) fn tips(seed: u64) -> Case {
    let index = permuted_index(seed, contact::TIPS);
    contact::tips(index, &mut random(14, index))
}

pub(super) fn smooth(seed: u64) -> Vec<Case> {
    vec![contact::smooth(seed, &mut random(15, seed))]
}

/// The same of the depth: signed distances say it on both sides.
pub(super) fn deep(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, answer)] = answers else { return Ok(Verdict::Pass) };
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(Verdict::Pass);
    }
    let truth = if answer.value > Some(0.5 * GRAZE) { GRAZE } else { -GRAZE };
    let answer = case.signed(method)?;
    let error = (answer.value() - truth).abs();
    if answer.tied || answer.status != Status::Converged {
        return Ok(Verdict::WrongStatus(format!("{:?}, tied: {}", answer.status, answer.tied)));
    }
    Ok(if error <= SMOOTH { Verdict::Pass } else { Verdict::Off(error / case.small()) })
}
