//! Limits and hints: 2, 18.

use super::super::method::Method;
use super::super::question::{CaseError, Question, Verdict};
use super::draws::random;
use sublevel::measure::{Distance, Options, Status, WarmStart, distance, level_distance};
use sublevel_testkit::bodies::chart_zoo;
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::catalogue::limits::{self, Hints};

pub(super) fn few_iterations(seed: u64) -> Case {
    let limit = (seed % 3) as u32 + limits::LIMITS.start();
    limits::few_iterations(limit, chart_zoo(), &mut random(2, seed))
}

/// Bad hints lead to the same bracketed value.
pub(super) fn bad_hint(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if method != Method::Warm {
        return Ok(None);
    }
    let Hints { case, sources } = limits::bad_hints(chart_zoo(), &mut random(18, seed));
    let question = Question(case);
    let options = Options::default();
    let ((a, pose_a), (b, pose_b)) = question.placed();
    let solve = |hint: &mut WarmStart| distance(a, pose_a, b, pose_b, &options, hint);
    let cold = solve(&mut WarmStart::default());
    for (p, pose_p, q, pose_q) in &sources {
        let mut hint = WarmStart::default();
        distance(p, pose_p, q, pose_q, &options, &mut hint);
        let mut level_hint = WarmStart::default();
        level_distance(p, pose_p, q, pose_q, &options, &mut level_hint);
        for mut hint in [hint, level_hint] {
            let Distance { status, lower, upper, .. } = solve(&mut hint);
            if status != Status::Converged {
                return Ok(Some(Verdict::WrongStatus(format!("still wide, {:e} m", upper - lower))));
            }
            let apart = (lower - cold.upper).max(cold.lower - upper);
            if !(apart <= 0.0) {
                return Ok(Some(Verdict::Off(apart / question.small())));
            }
        }
    }
    Ok(Some(Verdict::Pass))
}
