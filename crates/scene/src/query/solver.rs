//! What solving a pair takes: the question, warm starts, and the pair where it stands.

use sublevel_core::body::{Shape, Solid};
use sublevel_core::measure::{
    Capsule, Decision, HalfSpaceDistance, Options, Pose, WarmStart, capsule_nearer_to_half_space_than,
    distance_to_half_space, nearer_to_half_space_than, overlap_of_capsule_with_half_space, overlap_with_half_space,
};

use super::ask::{Ask, Measure};
use super::thing::{PairSlots, Thing, WorldHalfSpace};
use crate::crew::Stop;
use crate::pair_cache::{PairCache, PairKey};

/// What solving a pair needs besides the pair.
#[derive(Clone, Copy)]
pub(crate) struct Solver<'a> {
    pub(crate) ask: &'a Ask,
    /// Warm starts; none: every pair is solved cold.
    pub(crate) cache: Option<&'a PairCache>,
    pub(crate) stop: &'a Stop,
}

/// A pair of things with its place in the table of warm starts; without one it is solved cold.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pair<'a> {
    pub(crate) a: Thing<'a>,
    pub(crate) b: Thing<'a>,
    pub(crate) slots: Option<PairSlots>,
}

impl Pair<'_> {
    pub(crate) fn swapped(&self) -> Self {
        Self { a: self.b, b: self.a, slots: self.slots.map(|PairSlots { a, b }| PairSlots { a: b, b: a }) }
    }

    pub(crate) fn has_capsule(&self) -> bool {
        [&self.a, &self.b].iter().any(|thing| matches!(thing, Thing::Capsule { .. }))
    }

    /// The finest rungs of both; 0 where there are none.
    pub(crate) fn finest_rungs(&self) -> [u8; 2] {
        [&self.a, &self.b].map(|thing| match thing {
            Thing::Solid { rungs, .. } => u8::try_from(rungs.len().saturating_sub(1)).unwrap_or(u8::MAX),
            Thing::Capsule { .. } | Thing::HalfSpace(_) | Thing::Point(_) => 0,
        })
    }
}

/// Two solids of one pair where they stand.
#[derive(Clone, Copy)]
pub(crate) struct Solids<'a> {
    pub(crate) a: &'a Shape,
    pub(crate) pose_a: &'a Pose,
    pub(crate) b: &'a Shape,
    pub(crate) pose_b: &'a Pose,
}

impl Solver<'_> {
    /// Lends the warm start of a pair at two rungs for one kind of question.
    pub(crate) fn warm<T>(
        &self,
        slots: Option<PairSlots>,
        rungs: [usize; 2],
        kind: Measure,
        solve: impl FnOnce(&mut WarmStart) -> T,
    ) -> T {
        match (self.cache, slots) {
            (Some(cache), Some(PairSlots { a, b })) => {
                let rungs = rungs.map(|rung| u8::try_from(rung).unwrap_or(u8::MAX));
                cache.with(PairKey { a, b, rungs, kind: kind as u8 }, solve)
            }
            _ => solve(&mut WarmStart::default()),
        }
    }

    /// The signed distance of a solid from a half-space, metres.
    pub(crate) fn half_space_distance(
        &self,
        solid: &Shape,
        pose: &Pose,
        half_space: &WorldHalfSpace,
        (slots, options): (Option<PairSlots>, &Options<'_>),
    ) -> HalfSpaceDistance {
        self.warm(slots, [0; 2], Measure::Signed, |warm| {
            distance_to_half_space(solid, pose, &half_space.half_space, options, warm)
        })
    }

    /// Whether the signed distance of a solid from a half-space is below a threshold, metres, or at
    /// most 0: for all planes within the error of where the half-space stands.
    pub(crate) fn half_space_decision(
        &self,
        solid: &Shape,
        pose: &Pose,
        half_space: &WorldHalfSpace,
        threshold: f64,
        (slots, options): (Option<PairSlots>, &Options<'_>),
    ) -> Decision {
        let plane = &half_space.half_space;
        let ball = solid.circumscribed();
        let slack = half_space.slack_m(pose.translation().norm() + ball.center.norm() + ball.radius);
        self.warm(slots, [0; 2], Measure::Signed, |warm| {
            for_all_planes(slack, threshold, |asked| match asked {
                Asked::Overlap => overlap_with_half_space(solid, pose, plane, options, warm),
                // Only thresholds that are no numbers are refused.
                Asked::NearerThan(threshold) => {
                    nearer_to_half_space_than(solid, pose, plane, threshold, options, warm).unwrap_or(OPEN)
                }
            })
        })
    }
}

/// The same of a capsule.
pub(crate) fn capsule_above_half_space(
    capsule: &Capsule,
    pose: &Pose,
    half_space: &WorldHalfSpace,
    threshold: f64,
) -> Decision {
    let plane = &half_space.half_space;
    let slack = half_space.slack_m(pose.translation().norm() + capsule.reach_m());
    for_all_planes(slack, threshold, |asked| match asked {
        Asked::Overlap => overlap_of_capsule_with_half_space(capsule, pose, plane),
        // Only thresholds that are no numbers are refused.
        Asked::NearerThan(threshold) => {
            capsule_nearer_to_half_space_than(capsule, pose, plane, threshold).unwrap_or(OPEN)
        }
    })
}

/// What is known of a signed distance that nothing was found out about.
const OPEN: Decision = Decision::Undecided { lower: f64::NEG_INFINITY, upper: f64::INFINITY };

/// A question about the signed distance from one plane.
enum Asked {
    /// Whether it is at most 0.
    Overlap,
    /// Whether it is below a threshold, metres.
    NearerThan(f64),
}

/// Whether a signed distance is below a threshold, metres, or at most 0: for all planes whose
/// distances differ by `slack` metres at most from those of the plane that `decide` is about.
fn for_all_planes(slack: f64, threshold: f64, mut decide: impl FnMut(Asked) -> Decision) -> Decision {
    if slack == 0.0 {
        return decide(if threshold == 0.0 { Asked::Overlap } else { Asked::NearerThan(threshold) });
    }
    // What holds of this plane by that much more holds of all.
    let (least, most) = ((threshold - slack).next_down(), (threshold + slack).next_up());
    let known = match decide(Asked::NearerThan(most)) {
        Decision::No => return Decision::No,
        Decision::Undecided { lower, upper } => [lower, upper],
        Decision::Yes => match decide(Asked::NearerThan(least)) {
            Decision::Yes => return Decision::Yes,
            Decision::Undecided { lower, upper } => [lower, upper],
            Decision::No => [least, most],
        },
    };
    Decision::Undecided { lower: (known[0] - slack).next_down(), upper: (known[1] + slack).next_up() }
}
