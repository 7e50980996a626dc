//! Ill-conditioned data: 25.

use super::super::method::Method;
use super::super::question::{CaseError, Question, Verdict};
use super::draws::random;
use sublevel_testkit::catalogue::data::{EXTREMES, KINDS, attempts, extreme};

/// Every other time data that must be refused, as long as there are some, else bodies that are all
/// but degenerate: those are refused, or served within a bracket that is true.
pub(super) fn ill_conditioned(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let kind = seed / 2;
    if seed.is_multiple_of(2) && kind < KINDS {
        return Ok((method == Method::Cold).then(|| refused(kind)));
    }
    match extreme(seed % EXTREMES, &mut random(25, seed)) {
        Some(case) => Question(case).put(method),
        None => Ok(method.is_ours().then_some(Verdict::Pass)),
    }
}

/// What is refused, and beside it what is not.
fn refused(kind: u64) -> Verdict {
    match attempts(kind).into_iter().find(|attempt| !attempt.is_right()) {
        Some(wrong) => Verdict::WrongStatus(format!("{}: refused: {:?}", wrong.what, wrong.refused)),
        None => Verdict::Pass,
    }
}
