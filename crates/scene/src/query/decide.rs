//! Whether a pair is nearer than a threshold, by the finest rungs of ladders: the table of heights
//! decides about a body of any degree as fast as about an ellipsoid.

use std::sync::Arc;

use sublevel_core::body::Shape;
use sublevel_core::measure::{
    Capsule, Decision, Options, Pose, capsules_nearer_than, nearer_than, nearer_to_capsule_than, overlap,
    overlap_of_capsules, overlap_with_capsule, signed_distance,
};

use super::answer::Verdict;
use super::ask::Measure;
use super::solver::{Pair, Solver, capsule_above_half_space};
use super::thing::{PairSlots, Thing};

/// A decision with what is known of the signed distance, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bracket {
    /// YES: the signed distance is below the threshold (at 0 m: at most).
    pub(crate) verdict: Verdict,
    pub(crate) lower: f64,
    pub(crate) upper: f64,
    pub(crate) rungs: [u8; 2],
    /// Whether the solver was needed.
    pub(crate) solved: bool,
}

impl Bracket {
    fn of(verdict: Verdict, lower: f64, upper: f64) -> Self {
        Self { verdict, lower, upper, rungs: [0; 2], solved: true }
    }

    /// What a decision about the distance says of the signed distance when it is compared with a
    /// threshold.
    fn decided(decision: Decision, threshold: f64) -> Self {
        let found = Self::of_signed(decision, threshold);
        // A distance of 0 says nothing about depth.
        if found.lower > 0.0 || found.verdict != Verdict::Undecided {
            return found;
        }
        Self { lower: f64::NEG_INFINITY, ..found }
    }

    /// The same of a decision about the signed distance itself.
    fn of_signed(decision: Decision, threshold: f64) -> Self {
        match decision {
            Decision::Yes => Self::of(Verdict::Yes, f64::NEG_INFINITY, threshold),
            Decision::No => Self::of(Verdict::No, threshold, f64::INFINITY),
            Decision::Undecided { lower, upper } => Self::of(Verdict::Undecided, lower, upper),
        }
    }
}

/// Compares the signed distance of a pair with a threshold in metres, which may be negative.
pub(crate) fn decide(solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64, options: Options<'_>) -> Bracket {
    let mut gap = pair.a.ball_gap_m(&pair.b);
    if gap <= threshold && threshold >= 0.0 {
        gap = gap.max(pair.a.box_gap_m(&pair.b));
    }
    if gap > threshold {
        return Bracket { solved: false, ..Bracket::of(Verdict::No, gap, f64::INFINITY) };
    }
    if solver.stop.is_set() {
        return Bracket { solved: false, ..Bracket::of(Verdict::Undecided, gap, f64::INFINITY) };
    }
    match (&pair.a, &pair.b) {
        (Thing::Solid { set: None, .. }, Thing::Solid { set: None, .. }) => solids(solver, pair, threshold, options),
        (Thing::Solid { set: None, rungs, pose }, Thing::HalfSpace(half_space))
        | (Thing::HalfSpace(half_space), Thing::Solid { set: None, rungs, pose }) => {
            let Some(solid) = rungs.last() else { return Bracket::of(Verdict::Undecided, gap, f64::INFINITY) };
            let decision = solver.half_space_decision(solid, pose, half_space, threshold, (pair.slots, &options));
            Bracket::of_signed(decision, threshold)
        }
        (Thing::Solid { set: None, rungs, pose }, Thing::Capsule { capsule, pose: capsule_pose })
            if threshold >= 0.0 =>
        {
            solid_and_capsule(solver, (rungs, pose), (capsule, capsule_pose), threshold, (pair.slots, options))
        }
        (Thing::Capsule { .. }, Thing::Solid { set: None, .. }) => {
            let found = decide(solver, &pair.swapped(), threshold, options);
            let [solid, capsule] = found.rungs;
            Bracket { rungs: [capsule, solid], ..found }
        }
        (Thing::Capsule { capsule, pose }, Thing::Capsule { capsule: other, pose: other_pose }) if threshold >= 0.0 => {
            capsules((capsule, pose), (other, other_pose), threshold)
        }
        (Thing::Capsule { capsule, pose }, Thing::Point(point))
        | (Thing::Point(point), Thing::Capsule { capsule, pose })
            if threshold >= 0.0 =>
        {
            let place = Pose::identity().with_translation(*point);
            capsules((capsule, pose), (&Capsule::POINT, &place), threshold)
        }
        (Thing::Capsule { capsule, pose }, Thing::HalfSpace(half_space))
        | (Thing::HalfSpace(half_space), Thing::Capsule { capsule, pose }) => {
            Bracket::of_signed(capsule_above_half_space(capsule, pose, half_space, threshold), threshold)
        }
        (Thing::Capsule { .. }, _) | (_, Thing::Capsule { .. }) => {
            let found = solver.capsule_distance(pair, &options);
            let verdict = compare::against(found.lower, found.upper, threshold);
            Bracket { rungs: pair.finest_rungs(), ..Bracket::of(verdict, found.lower, found.upper) }
        }
        (Thing::HalfSpace(_), Thing::HalfSpace(_)) => Bracket {
            solved: false,
            // Two of them overlap nearly always, and nobody asks.
            ..Bracket::of(Verdict::No, f64::NEG_INFINITY, f64::INFINITY)
        },
        _ => {
            let is_signed = matches!(pair.a, Thing::HalfSpace(_)) || matches!(pair.b, Thing::HalfSpace(_));
            let asked = if is_signed { threshold } else { threshold.max(0.0) };
            let found = solver.set_distance(pair, Some(asked), options);
            // A distance of 0 says nothing about depth.
            let lower = if is_signed || found.lower_m > 0.0 { found.lower_m } else { f64::NEG_INFINITY };
            let verdict = compare::against(lower, found.upper_m, threshold);
            Bracket { rungs: pair.finest_rungs(), ..Bracket::of(verdict, lower, found.upper_m) }
        }
    }
}

fn solids(solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64, options: Options<'_>) -> Bracket {
    let (Thing::Solid { rungs: rungs_a, pose: pose_a, .. }, Thing::Solid { rungs: rungs_b, pose: pose_b, .. }) =
        (&pair.a, &pair.b)
    else {
        return Bracket::of(Verdict::Undecided, f64::NEG_INFINITY, f64::INFINITY);
    };
    let (Some(a), Some(b)) = (rungs_a.last(), rungs_b.last()) else {
        return Bracket::of(Verdict::Undecided, f64::NEG_INFINITY, f64::INFINITY);
    };
    let (a, b, rungs) = (&**a, &**b, [rungs_a.len() - 1, rungs_b.len() - 1]);
    let found = if threshold < 0.0 {
        let found = solver
            .warm(pair.slots, rungs, Measure::Signed, |warm| signed_distance(a, pose_a, b, pose_b, &options, warm));
        Bracket::of(compare::below(found.lower, found.upper, threshold), found.lower, found.upper)
    } else {
        let decision = solver.warm(pair.slots, rungs, Measure::Distance, |warm| {
            if threshold == 0.0 {
                return overlap(a, pose_a, b, pose_b, &options, warm);
            }
            // Only thresholds that are no lengths are refused.
            nearer_than(a, pose_a, b, pose_b, threshold, &options, warm)
                .unwrap_or(Decision::Undecided { lower: 0.0, upper: f64::INFINITY })
        });
        Bracket::decided(decision, threshold)
    };
    Bracket { rungs: pair.finest_rungs(), ..found }
}

/// Compares the distance of a solid from a capsule with a threshold that is not negative; rungs in
/// this order.
fn solid_and_capsule(
    solver: &Solver<'_>,
    (rungs, pose): (&[Arc<Shape>], &Pose),
    (capsule, capsule_pose): (&Capsule, &Pose),
    threshold: f64,
    (slots, options): (Option<PairSlots>, Options<'_>),
) -> Bracket {
    let Some((finest, coarser)) = rungs.split_last() else {
        return Bracket::of(Verdict::Undecided, f64::NEG_INFINITY, f64::INFINITY);
    };
    let solid = &**finest;
    let decision = solver.warm(slots, [coarser.len(), 0], Measure::Signed, |warm| {
        if threshold == 0.0 {
            return overlap_with_capsule(solid, pose, capsule, capsule_pose, &options, warm);
        }
        // Only thresholds that are no lengths are refused.
        nearer_to_capsule_than(solid, pose, capsule, capsule_pose, threshold, &options, warm)
            .unwrap_or(Decision::Undecided { lower: 0.0, upper: f64::INFINITY })
    });
    Bracket { rungs: [u8::try_from(coarser.len()).unwrap_or(u8::MAX), 0], ..Bracket::decided(decision, threshold) }
}

/// Compares the distance of two capsules with a threshold that is not negative.
fn capsules((a, pose_a): (&Capsule, &Pose), (b, pose_b): (&Capsule, &Pose), threshold: f64) -> Bracket {
    if threshold == 0.0 {
        return Bracket::decided(overlap_of_capsules(a, pose_a, b, pose_b), threshold);
    }
    // Only thresholds that are no lengths are refused.
    let decision = capsules_nearer_than(a, pose_a, b, pose_b, threshold)
        .unwrap_or(Decision::Undecided { lower: 0.0, upper: f64::INFINITY });
    Bracket::decided(decision, threshold)
}

/// Brackets against thresholds.
pub(crate) mod compare {
    use crate::query::answer::Verdict;

    /// Whether a value is below a threshold.
    pub(crate) fn below(lower: f64, upper: f64, threshold: f64) -> Verdict {
        if upper < threshold {
            Verdict::Yes
        } else if lower >= threshold {
            Verdict::No
        } else {
            Verdict::Undecided
        }
    }

    /// Whether a value is at most a threshold.
    pub(crate) fn below_or_at(lower: f64, upper: f64, threshold: f64) -> Verdict {
        if upper <= threshold {
            Verdict::Yes
        } else if lower > threshold {
            Verdict::No
        } else {
            Verdict::Undecided
        }
    }

    /// Whether a signed distance counts as contact: touching does, at a threshold of 0.
    pub(crate) fn against(lower: f64, upper: f64, threshold: f64) -> Verdict {
        if threshold == 0.0 { below_or_at(lower, upper, threshold) } else { below(lower, upper, threshold) }
    }
}
