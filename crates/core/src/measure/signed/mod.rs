//! Signed distance: the distance of bodies that are apart, minus the penetration depth of those
//! that overlap.
//!
//! Both are one function: with the support functions h, the largest over all unit vectors n of
//! `-h_A(-n) - h_B(n)`, how far a plane across n parts the bodies. Its optimality system is that of
//! the distance with a distance of either sign, so Newton's method passes through contact without
//! noticing; x and y trade places along n. What differs is the proof: apart, any pair of points
//! bounds it from above; in overlap that takes all directions ([`crate::measure::penetration`]).

#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::Status;
use crate::measure::bounds::duality_bounds::distance_upper;
use crate::measure::distance::distance;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::penetration::{Best, prove, tolerance};
use crate::measure::solver::continuation::{Follow, Proven};
use crate::measure::solver::two_point_problem::Through;
use crate::measure::union;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{Scalar, dispatch};
use nalgebra::Vector3;

/// Signed distance with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct SignedDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative when the bodies may overlap.
    pub lower: f64,
    /// Proven upper bound; negative when the bodies are proven to overlap.
    pub upper: f64,
    /// Point of the first body nearest to the second, or deepest in it.
    pub witness_a: Vector3<f64>,
    /// Point of the second body nearest to the first, or deepest in it.
    pub witness_b: Vector3<f64>,
    /// Unit vector from the second body to the first: moving the first along it makes the signed
    /// distance grow as much. None only if the solve was stopped before any was found.
    pub normal: Option<Vector3<f64>>,
    /// Derivatives with respect to the twists of the first and of the second body; none without a
    /// normal.
    pub gradients: Option<[Twist; 2]>,
    /// Whether the bracket holds 0: the bodies may just touch. Smooth bodies have the same
    /// derivative on both sides; where edges or corners touch, the derivative in overlap may be
    /// another one.
    pub at_contact: bool,
    /// Whether another direction out of an overlap was seen to be about as short, or the one found
    /// is not known to be the best of those near it, or another pair of parts may be as near: value
    /// and bracket hold, but normal, witnesses and gradients may jump.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl SignedDistance {
    /// The answer inside the bracket that points or a direction attain: the upper bound of bodies
    /// apart, else the lower.
    pub fn value(&self) -> f64 {
        if self.lower > 0.0 { self.upper } else { self.lower }
    }
}

/// Signed distance of body `a` at `pose_a` and body `b` at `pose_b` (body to world).
///
/// The bracket is as narrow as `options` ask: relative to the smaller body when they are apart, and
/// relative to the depth when they overlap ([`Options::with_depth_accuracy`]), where the value
/// itself is as accurate as a distance unless another direction is a better one within that
/// bracket. `warm` is read and then replaced by the hint for the next query of this pair; it
/// carries through contact.
///
/// Of solids with several parts it is their distance, or minus the depth of their overlap
/// ([`crate::measure::penetration`]), which is known from a local search: in overlap the bracket
/// may stay wide. There the gradients are those of all the pairs of parts that hold the solids
/// back, and the witnesses belong to the one that does so most.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::{Body, Compound};
/// use sublevel_core::measure::{Options, Pose, WarmStart, signed_distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let mut warm = WarmStart::default();
/// for x in [1.75, 1.5, 1.25] {
///     let pose = Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
///     let answer = signed_distance(&ball, &pose, &crate_, &Pose::identity(), &Options::default(), &mut warm);
///     assert!((answer.value() - (x - 1.5)).abs() < 1e-8);
///     assert!((answer.gradients.unwrap()[0].linear - Vector3::x()).norm() < 1e-6);
/// }
///
/// let row = Compound::new("row", vec![crate_, Body::ball("far", Vector3::new(-5.0, 0.0, 0.0), 0.5)?])?;
/// let pose = Pose::from_quaternion(Vector3::new(1.25, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = signed_distance(&ball, &pose, &row, &Pose::identity(), &Options::default(), &mut warm);
/// assert!((answer.value() + 0.25).abs() < 1e-8 && !answer.tied);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn signed_distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> SignedDistance {
    union::signed_distance(a, pose_a, b, pose_b, options, warm)
}

/// Signed distance of two bodies.
pub(super) fn between(
    a: &Body,
    pose_a: &Pose,
    b: &Body,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> SignedDistance {
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let mut spent = 0;
    if let Hint::Smooth(trace) = &mut warm.hint {
        let relation = Through { pose_a, pose_b, facing: None, tolerance };
        // Apart, or nearly, the normal proves all there is.
        match dispatch(Follow { a, b, relation, options, trace }) {
            Ok(proven) if proven.upper - proven.lower <= tolerance => {
                let [x, y, normal] = proven.world(Scalar, a, pose_a);
                return Answer::of(&proven).report((x, y), Some(normal), pose_a, pose_b);
            }
            Ok(proven) => spent = proven.rounds,
            Err(lost) => spent = lost.rounds,
        }
    }
    let pair = Pair::new(a, pose_a, b, pose_b);
    let mut best = Best::new(&pair, pose_a, pose_b, options);
    best.iterations = spent;
    best.follow(&warm.hint);
    if best.depth.is_infinite() {
        best.seek(None);
    }
    let mut known = Known::of(&best);
    if best.depth.is_infinite() {
        // Nothing to follow: the distance says on which side the bodies are.
        let apart = distance(a, pose_a, b, pose_b, options, warm);
        best.iterations += apart.iterations;
        if apart.lower > 0.0 {
            let iterations = best.iterations;
            let answer =
                Answer { lower: apart.lower, upper: apart.upper, tied: false, iterations, status: apart.status };
            return answer.report((apart.witness_a, apart.witness_b), apart.normal, pose_a, pose_b);
        }
        best.follow(&warm.hint);
        known = Known::of(&best);
        known.attain(
            apart.upper / pair.unit(),
            pair.world_to_query(&apart.witness_a),
            pair.world_to_query(&apart.witness_b),
        );
    }
    if known.lower < 0.0 && !known.narrow(&best) {
        // Halfway between the deepest points is mostly a common one.
        let middle = (known.x + known.y) * 0.5;
        if pair.common(&middle) {
            known.attain(0.0, middle, middle);
        }
    }
    let mut tied = false;
    if best.depth > 0.0 && !known.narrow(&best) {
        let proof = prove(&mut best);
        tied = proof.tied;
        let before = known;
        known = Known::of(&best);
        if proof.lower > 0.0 {
            known.upper = -proof.lower;
        } else {
            known.attain(before.upper, before.x, before.y);
        }
    }
    if let Some(hint) = best.hint() {
        *warm = hint;
    }
    if known.lower > 0.0 && !known.narrow(&best) {
        let apart = distance(a, pose_a, b, pose_b, options, warm);
        let answer = Answer {
            lower: apart.lower.max(known.lower * pair.unit()),
            upper: apart.upper,
            tied,
            iterations: best.iterations + apart.iterations,
            status: apart.status,
        };
        return answer.report((apart.witness_a, apart.witness_b), apart.normal, pose_a, pose_b);
    }
    let status = if known.narrow(&best) { Status::Converged } else { Status::BracketWide };
    let unit = pair.unit();
    let answer =
        Answer { lower: known.lower * unit, upper: known.upper * unit, tied, iterations: best.iterations, status };
    let normal = best.n.map(|n| pair.direction_to_world(&n));
    answer.report((pair.to_world(&known.x), pair.to_world(&known.y)), normal, pose_a, pose_b)
}

/// A bracket of the signed distance in query units, and the points behind it.
struct Known {
    lower: f64,
    upper: f64,
    x: Vector3<f64>,
    y: Vector3<f64>,
}

impl Known {
    /// What the best direction shows, and the points of the bodies there.
    fn of(best: &Best<'_>) -> Self {
        let (lower, pair) = (-best.depth, best.pair);
        if let Some(upper) = best.attained {
            return Self { lower, upper, x: best.x, y: best.y };
        }
        match (pair.a.pull_in(&best.x), pair.b.pull_in(&best.y)) {
            (Some(x), Some(y)) => Self { lower, upper: distance_upper(pair, &x, &y), x, y },
            _ => Self { lower, upper: f64::INFINITY, x: best.x, y: best.y },
        }
    }

    /// Takes points that are nearer.
    fn attain(&mut self, upper: f64, x: Vector3<f64>, y: Vector3<f64>) {
        if upper < self.upper {
            (self.upper, self.x, self.y) = (upper, x, y);
        }
    }

    fn narrow(&self, best: &Best<'_>) -> bool {
        let depth = if self.upper < 0.0 { -self.lower } else { 0.0 };
        self.upper - self.lower <= tolerance(best.pair, best.options, depth)
    }
}

struct Answer {
    lower: f64,
    upper: f64,
    tied: bool,
    iterations: u32,
    status: Status,
}

impl Answer {
    fn of(proven: &Proven) -> Self {
        let Proven { lower, upper, rounds, .. } = *proven;
        Self { lower, upper, tied: false, iterations: rounds, status: Status::Converged }
    }

    fn report(
        self,
        (witness_a, witness_b): (Vector3<f64>, Vector3<f64>),
        normal: Option<Vector3<f64>>,
        pose_a: &Pose,
        pose_b: &Pose,
    ) -> SignedDistance {
        let Self { lower, upper, tied, iterations, status } = self;
        let gradients = normal.map(|n| {
            [
                Twist::of_force(n, &witness_a, pose_a.translation()),
                Twist::of_force(-n, &witness_b, pose_b.translation()),
            ]
        });
        let at_contact = lower <= 0.0 && upper >= 0.0;
        SignedDistance { status, lower, upper, witness_a, witness_b, normal, gradients, at_contact, tied, iterations }
    }
}
