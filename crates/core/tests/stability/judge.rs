//! What every answer is compared with, whatever the family.

use sublevel_core::body::Body;
use sublevel_core::measure::{
    DEFAULT_ACCURACY, Distance, LevelDistance, MAX_ITERATIONS, Options, Status, WarmStart, distance, level_distance,
};
use sublevel_testkit::bodies::Placed;
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::reference;

/// As [`all`], of a case.
pub(crate) fn all_of(case: &Case, label: &str) -> (Distance, reference::distance::Truth) {
    let (a, b) = case.placed();
    all(a, b, label)
}

/// As [`judged`], of a case, with its own accuracy and limit.
pub(crate) fn judged_of(case: &Case, label: &str) -> (Distance, reference::distance::Truth) {
    let (a, b) = case.placed();
    judged(a, b, &options_of(case), label)
}

/// What a case asks for.
pub(crate) fn options_of(case: &Case) -> Options<'static> {
    let options = Options::default().with_accuracy(case.accuracy).expect("in range");
    options.with_max_iterations(case.limit.unwrap_or(MAX_ITERATIONS)).expect("in range")
}

/// The size that lengths are relative to: the circumradius of the smaller body.
pub(crate) fn small(a: &Body, b: &Body) -> f64 {
    a.circumscribed().radius.min(b.circumscribed().radius)
}

pub(crate) fn large(a: &Body, b: &Body) -> f64 {
    a.circumscribed().radius.max(b.circumscribed().radius)
}

/// A cold distance, checked without a reference: the status is what the bracket says, the numbers
/// are numbers, the caps are kept.
pub(crate) fn plain((a, pose_a): Placed<'_>, (b, pose_b): Placed<'_>, options: &Options<'_>, label: &str) -> Distance {
    warm((a, pose_a), (b, pose_b), options, &mut WarmStart::default(), label)
}

/// As [`plain`], from a warm start.
pub(crate) fn warm(
    (a, pose_a): Placed<'_>,
    (b, pose_b): Placed<'_>,
    options: &Options<'_>,
    start: &mut WarmStart,
    label: &str,
) -> Distance {
    let answer = distance(a, pose_a, b, pose_b, options, start);
    let label = format!("{label}: {}-{} {answer:?}", a.name(), b.name());
    assert!(answer.lower >= 0.0 && answer.lower <= answer.upper && answer.upper.is_finite(), "{label}");
    let narrow = answer.upper - answer.lower <= options.accuracy() * small(a, b) * (1.0 + 1e-12);
    assert!(narrow || answer.status == Status::BracketWide, "claims to have converged, {label}");
    assert!(answer.iterations <= options.max_iterations().min(MAX_ITERATIONS), "exceeds its limit, {label}");
    for number in answer.witness_a.iter().chain(&answer.witness_b).chain(answer.normal.iter().flatten()) {
        assert!(number.is_finite(), "{label}");
    }
    assert!(answer.normal.is_none_or(|n| (n.norm() - 1.0).abs() < 1e-12), "{label}");
    answer
}

/// A cold distance compared with 200 bits.
pub(crate) fn judged(
    a: Placed<'_>,
    b: Placed<'_>,
    options: &Options<'_>,
    label: &str,
) -> (Distance, reference::distance::Truth) {
    let answer = plain(a, b, options, label);
    let truth = verdict(a, b, &answer, label);
    (answer, truth)
}

/// Compares an answer with 200 bits.
pub(crate) fn verdict(
    (a, pose_a): Placed<'_>,
    (b, pose_b): Placed<'_>,
    answer: &Distance,
    label: &str,
) -> reference::distance::Truth {
    let truth = reference::distance(a, pose_a, b, pose_b, answer);
    let label = format!("{label}: {}-{} {answer:?}, truth {:e}", a.name(), b.name(), truth.value());
    assert!(truth.decides(answer, 1e-16 * small(a, b)), "the reference is wide, {:e}, {label}", truth.width());
    assert!(truth.inside(answer), "the bracket misses the truth, {label}");
    truth
}

/// A cold level distance compared with 200 bits.
pub(crate) fn judged_level(
    (a, pose_a): Placed<'_>,
    (b, pose_b): Placed<'_>,
    options: &Options<'_>,
    label: &str,
) -> (LevelDistance, reference::level::Truth) {
    let answer = level_distance(a, pose_a, b, pose_b, options, &mut WarmStart::default());
    let truth = reference::level_distance(a, pose_a, b, pose_b, &answer);
    let label = format!("{label}: {}-{} {answer:?}, truth {:e}", a.name(), b.name(), truth.value());
    assert!(answer.lower <= answer.upper, "{label}");
    let narrow = answer.upper - answer.lower <= options.accuracy() * answer.upper.abs().max(1.0) * (1.0 + 1e-12);
    assert!(narrow || answer.status == Status::BracketWide, "claims to have converged, {label}");
    assert!(answer.iterations <= options.max_iterations().min(MAX_ITERATIONS), "exceeds its limit, {label}");
    // A thousandth of what it is compared to; at minimisers where all is flat, 200 bits get no
    // farther.
    let sharp = 1e-3 * DEFAULT_ACCURACY * truth.value().abs().max(1.0);
    assert!(truth.width() <= sharp, "the reference is wide, {:e}, {label}", truth.width());
    assert!(truth.inside(&answer), "the bracket misses the truth, {label}");
    (answer, truth)
}

/// Distance and both level distances at the default accuracy, all converged and all true.
pub(crate) fn all(a: Placed<'_>, b: Placed<'_>, label: &str) -> (Distance, reference::distance::Truth) {
    let options = Options::default();
    let (answer, truth) = judged(a, b, &options, label);
    assert_eq!(answer.status, Status::Converged, "{label}: {}-{} {answer:?}", a.0.name(), b.0.name());
    for (p, q) in [(a, b), (b, a)] {
        let (level, _) = judged_level(p, q, &options, label);
        assert_eq!(level.status, Status::Converged, "{label}: {}-{} {level:?}", p.0.name(), q.0.name());
    }
    (answer, truth)
}
