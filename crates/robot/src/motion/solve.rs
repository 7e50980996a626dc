//! The signed distance of two convex pieces, as the solver brackets it.

use nalgebra::Vector3;
use sublevel_core::measure::{
    ActiveConstraints, CapsuleDistance, HalfSpace, HalfSpaceDistance, Options, Pose, WarmStart, distance,
    distance_of_capsule_to_half_space, distance_of_capsules, distance_to_capsule, distance_to_half_space,
    signed_distance,
};

use super::geometry::Piece;

/// What the solver knows of a pair; metres, world frame.
#[derive(Clone, Debug)]
pub(crate) struct Solved {
    /// The signed distance is at least this.
    pub(crate) lower: f64,
    /// The signed distance is at most this; of overlap 0 where the depth was not asked for.
    pub(crate) upper: f64,
    /// Unit vector from B to A.
    pub(crate) normal: Option<Vector3<f64>>,
    /// Points of A and of B that the upper bound is the distance of.
    pub(crate) witnesses: [Vector3<f64>; 2],
    /// Constraints that the lower bound rests on; none where a closed form does.
    pub(crate) active: [ActiveConstraints; 2],
}

/// The signed distance of A from B. Of bodies the depth of an overlap is measured only if asked
/// for.
pub(crate) fn solve(
    (a, pose_a): (&Piece<'_>, &Pose),
    (b, pose_b): (&Piece<'_>, &Pose),
    depth: bool,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Solved {
    match (a, b) {
        (Piece::Body(a), Piece::Body(b)) if depth => {
            let found = signed_distance(*a, pose_a, *b, pose_b, options, warm);
            let witnesses = [found.witness_a, found.witness_b];
            Solved {
                lower: found.lower,
                upper: found.upper,
                normal: found.normal,
                witnesses,
                active: Default::default(),
            }
        }
        (Piece::Body(a), Piece::Body(b)) => {
            let found = distance(*a, pose_a, *b, pose_b, options, warm);
            Solved {
                lower: if found.lower > 0.0 { found.lower } else { f64::NEG_INFINITY },
                upper: found.upper,
                normal: found.normal,
                witnesses: [found.witness_a, found.witness_b],
                active: [found.active_a, found.active_b],
            }
        }
        (Piece::Body(a), Piece::Capsule(b)) => of_capsule(&distance_to_capsule(*a, pose_a, b, pose_b, options, warm)),
        (Piece::Capsule(_), Piece::Body(_)) => turned(solve((b, pose_b), (a, pose_a), depth, options, warm)),
        (Piece::Capsule(a), Piece::Capsule(b)) => of_capsule(&distance_of_capsules(a, pose_a, b, pose_b, options)),
        (Piece::Body(a), Piece::HalfSpace(b, error_m)) => {
            of_half_space(&distance_to_half_space(*a, pose_a, b, options, warm), b, *error_m)
        }
        (Piece::Capsule(a), Piece::HalfSpace(b, error_m)) => {
            of_half_space(&distance_of_capsule_to_half_space(a, pose_a, b, options), b, *error_m)
        }
        // No robot is made of half-spaces.
        (Piece::HalfSpace(..), Piece::HalfSpace(..)) => Solved {
            lower: f64::NEG_INFINITY,
            upper: f64::INFINITY,
            normal: None,
            witnesses: [Vector3::repeat(f64::NAN); 2],
            active: Default::default(),
        },
        (Piece::HalfSpace(..), _) => turned(solve((b, pose_b), (a, pose_a), depth, options, warm)),
    }
}

fn of_capsule(found: &CapsuleDistance) -> Solved {
    let witnesses = [found.witness, found.witness_of_capsule];
    Solved { lower: found.lower, upper: found.upper, normal: found.normal, witnesses, active: Default::default() }
}

/// Of a half-space whose plane is known up to an error, metres.
fn of_half_space(found: &HalfSpaceDistance, half_space: &HalfSpace, error_m: f64) -> Solved {
    let below = found.witness - half_space.normal() * found.upper;
    Solved {
        lower: (found.lower - error_m).next_down(),
        upper: (found.upper + error_m).next_up(),
        normal: Some(*half_space.normal()),
        witnesses: [found.witness, below],
        active: Default::default(),
    }
}

fn turned(solved: Solved) -> Solved {
    let ([a, b], [of_a, of_b]) = (solved.witnesses, solved.active);
    Solved { normal: solved.normal.map(|n| -n), witnesses: [b, a], active: [of_b, of_a], ..solved }
}
