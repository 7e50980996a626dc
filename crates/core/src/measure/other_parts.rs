//! What a query of solids with several parts keeps of all pairs of parts but the nearest one: a
//! lower bound of their distances, and where it was proven. Where the solids have moved since by at
//! most δ as seen from each other, the distances are shorter by at most δ; as long as that is more
//! than the distance of the nearest pair, no other one has to be looked at.

use crate::body::{Ball, BodyId, Solid};
use crate::measure::frames::pose::Pose;
use crate::measure::part_pairs::SeenFrame;

/// What was proven of all pairs of parts of two solids but the nearest one.
#[derive(Clone, Copy, Debug)]
pub(super) struct OtherParts {
    /// The two solids, and the pair of parts that is left out: nothing else keeps the bound from
    /// being used for others.
    solids: [BodyId; 2],
    parts: (u16, u16),
    seen: SeenFrame,
    /// Lower bound of the distances, metres; minus infinity where it is not above zero.
    lower: f64,
}

/// What is known now of all pairs of parts but that of the last answer.
#[derive(Clone, Copy, Debug)]
pub(super) struct Recalled {
    /// Lower bound of the distances, metres; minus infinity where none is known.
    pub(super) lower: f64,
    /// How much farther than the nearest pair others are to be proven, metres, so that the bound
    /// holds for some queries more.
    pub(super) margin: f64,
}

impl Recalled {
    pub(super) const NOTHING: Self = Self { lower: f64::NEG_INFINITY, margin: 0.0 };
}

/// How much farther than the nearest pair others are to be proven: relative to the motion since
/// the last proof, and at most relative to the smaller solid.
///
/// Larger, more pairs are searched at once; smaller, all are looked at again sooner. It changes time
/// only; `other_parts_are_left_out_along_motions` counts what is spared.
const MARGIN: f64 = 2.0;
const LARGEST_MARGIN: f64 = 0.05;

/// Longest motion since the last proof, relative to the smaller solid, that others like it are
/// expected after.
///
/// Larger, pairs are searched in vain after jumps; smaller, fast motions look at all pairs each
/// time. It changes time only.
const LONGEST_MOTION: f64 = 0.1;

/// Two solids, where the second is seen from the first.
pub(super) struct SeenSolids<'a> {
    solids: [&'a BodyId; 2],
    pub(super) seen: SeenFrame,
    /// A ball around the second one, in its frame, metres.
    ball_b: &'a Ball,
    /// Circumradius of the smaller one, metres.
    radius: f64,
}

impl<'a> SeenSolids<'a> {
    pub(super) fn new((a, pose_a): (&'a impl Solid, &Pose), (b, pose_b): (&'a impl Solid, &Pose)) -> Self {
        let ball_b = b.circumscribed();
        let radius = a.circumscribed().radius.min(ball_b.radius);
        Self { solids: [a.id(), b.id()], seen: SeenFrame::new(pose_a, pose_b), ball_b, radius }
    }

    /// What is known now of all pairs of parts but these, which are those of the last answer.
    pub(super) fn recall(&self, known: Option<&OtherParts>, parts: (u16, u16)) -> Recalled {
        match known {
            Some(known) if known.solids.each_ref() == self.solids && known.parts == parts => {
                let moved = self.seen.moved_since(&known.seen, self.ball_b);
                let lower = (known.lower - moved).next_down();
                let is_motion = moved <= LONGEST_MOTION * self.radius;
                Recalled {
                    // How deep others overlap does not leave them out: all directions count.
                    lower: if lower > 0.0 { lower } else { f64::NEG_INFINITY },
                    margin: if is_motion { (MARGIN * moved).min(LARGEST_MARGIN * self.radius) } else { 0.0 },
                }
            }
            _ => Recalled::NOTHING,
        }
    }

    /// What to keep of a lower bound of the distances, metres, of all pairs of parts but these.
    pub(super) fn kept(&self, lower: f64, parts: (u16, u16)) -> OtherParts {
        // A distance of zero does not say how deep the parts overlap.
        let lower = if lower > 0.0 { lower } else { f64::NEG_INFINITY };
        OtherParts { solids: self.solids.map(|id| *id), parts, seen: self.seen, lower }
    }
}
