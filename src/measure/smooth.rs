//! Distance by continuation: from the last answer of a pair along its motion, where one constraint of each body is active.
//!
//! What a hint keeps of the last answer is where it was attained and both constraints' value, gradient and Hessian there, each
//! in its own body's coordinates, where they stay true however the bodies move. So the first Newton step at new poses needs
//! no evaluation: it is the sensitivity of the last answer to the motion. Along a smooth trajectory what that step misses is
//! nearly the same each time, and is added on. One evaluation then mostly proves the answer or leaves one more step to it.

use super::pose::Pose;
use super::tangent::{Relative, Seen, Side, bracket, moved, newton};
use super::vector::{M3, V3, apply, apply_transposed, basis, dot, subtract};
use crate::body::Body;
use crate::polynomial::{NumberJet, Simd, WithSimd};
use nalgebra::Vector3;

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trace {
    /// Active constraint of A and of B.
    pub(super) active: [u8; 2],
    /// Point of A, in A's frame from its normalization's centre on, metres.
    pub(super) x: V3<f64>,
    /// Point of B, in B's frame from its normalization's centre on, metres.
    pub(super) y: V3<f64>,
    /// Normal in A's frame.
    pub(super) n: V3<f64>,
    /// Constraint of A at x, in normalized coordinates.
    pub(super) jet_a: NumberJet<f64>,
    /// Constraint of B at y, in normalized coordinates.
    pub(super) jet_b: NumberJet<f64>,
    /// What the last prediction missed at x, in A's frame.
    pub(super) drift_x: V3<f64>,
    /// What the last prediction missed at y, in B's frame.
    pub(super) drift_y: V3<f64>,
}

impl Trace {
    /// The trace of witnesses x of A and y of B, each in its own frame, with the normal in A's frame.
    pub(super) fn new(
        a: &Body,
        x: &Vector3<f64>,
        b: &Body,
        y: &Vector3<f64>,
        n: &Vector3<f64>,
        active: [u8; 2],
    ) -> Self {
        let local = |body: &Body, v: &Vector3<f64>, active: u8| {
            let from_center = v - body.normalization().center;
            let z = body.normalization().linear * from_center;
            let jet = body.constraints()[usize::from(active)].polynomial.evaluate(&z);
            (from_center.into(), NumberJet::from(jet))
        };
        let ((x, jet_a), (y, jet_b)) = (local(a, x, active[0]), local(b, y, active[1]));
        Self { active, x, y, n: (*n).into(), jet_a, jet_b, drift_x: [0.0; 3], drift_y: [0.0; 3] }
    }
}

/// A proven bracket and where it is attained; query frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proven {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) x: V3<f64>,
    pub(super) y: V3<f64>,
    pub(super) n: V3<f64>,
    /// Evaluations of both bodies.
    pub(super) rounds: u32,
    pub(super) trace: Trace,
}

/// Most evaluations before the bracket decides that another method is better.
const MAX_ROUNDS: u32 = 8;

/// Mismatch of the gradients, as an angle, above which a bracket is not worth its cost.
const WORTH_A_BRACKET: f64 = 1e-3;

/// Longest step relative to the bodies' sizes that the linearization may mean anything for.
const LONGEST: f64 = 0.5;

/// Continuation as work for the widest arithmetic.
pub(super) struct Follow<'a> {
    pub(super) a: &'a Body,
    pub(super) pose_a: &'a Pose,
    pub(super) b: &'a Body,
    pub(super) pose_b: &'a Pose,
    /// Width of the bracket that is narrow enough, metres.
    pub(super) tolerance: f64,
    /// Most rounds.
    pub(super) limit: u32,
    pub(super) trace: &'a Trace,
}

impl WithSimd for Follow<'_> {
    type Output = Result<Proven, u32>;

    /// The proven answer, or how many rounds were spent in vain.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Proven, u32> {
        let Trace { active, n, .. } = *self.trace;
        if usize::from(active[0]) >= self.a.constraints().len() || usize::from(active[1]) >= self.b.constraints().len() {
            return Err(0);
        }
        let relative = Relative::new(simd, self.a, self.pose_a, self.b, self.pose_b);
        let side_a = Side::at_home(simd, self.a, usize::from(active[0]));
        let side_b = Side::away(self.b, usize::from(active[1]), &relative);
        let size = self.a.trust().reach.min(self.b.trust().reach);

        // Prediction from the old jets at the new poses.
        let turned = apply::<S, f64>(&relative.rotation, self.trace.y);
        let mut at = Iterate { x: self.trace.x, y: plus(turned, relative.origin), n };
        let frame = basis(simd, at.n);
        let (a, b) = (side_a.see(simd, &self.trace.jet_a, &frame), side_b.see(simd, &self.trace.jet_b, &frame));
        if !at.advance(simd, &a, &b, &frame, LONGEST * size) {
            return Err(0);
        }
        let predicted = (at.x, at.y);
        at.x = plus(at.x, self.trace.drift_x);
        at.y = plus(at.y, apply::<S, f64>(&relative.rotation, self.trace.drift_y));

        for rounds in 1..=MAX_ROUNDS.min(self.limit) {
            let ((jet_a, inside_a), (jet_b, inside_b)) = (side_a.jet(simd, at.x), side_b.jet(simd, at.y));
            if !(inside_a && inside_b) {
                return Err(rounds);
            }
            let frame = basis(simd, at.n);
            let (a, b) = (side_a.see(simd, &jet_a, &frame), side_b.see(simd, &jet_b, &frame));
            let difference = apply::<S, f64>(&frame, subtract::<S, f64>(at.x, at.y));
            if a.mismatch(&b) < WORTH_A_BRACKET {
                let found = bracket(simd, (&side_a, &a), (&side_b, &b), difference);
                if found.upper - found.lower <= self.tolerance && found.lower > 0.0 {
                    let (x, y) = (moved::<S, f64>(at.x, found.to_a, &frame), moved::<S, f64>(at.y, found.to_b, &frame));
                    if !(side_a.others_hold(simd, x) && side_b.others_hold(simd, y)) {
                        return Err(rounds);
                    }
                    let n = apply_transposed::<S, f64>(&frame, found.normal);
                    let drift_y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(at.y, predicted.1));
                    let own_y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(at.y, relative.origin));
                    let drift_x = subtract::<S, f64>(at.x, predicted.0);
                    let trace = Trace { active, x: at.x, y: own_y, n, jet_a, jet_b, drift_x, drift_y };
                    return Ok(Proven {
                        lower: found.lower,
                        upper: found.upper,
                        x,
                        y,
                        n,
                        rounds,
                        trace,
                    });
                }
            }
            if !at.advance(simd, &a, &b, &frame, LONGEST * size) {
                return Err(rounds);
            }
        }
        Err(MAX_ROUNDS)
    }
}

/// Trial points and normal in the query frame.
#[derive(Clone, Copy)]
struct Iterate {
    x: V3<f64>,
    y: V3<f64>,
    n: V3<f64>,
}

impl Iterate {
    /// Takes one Newton step, unless it is longer than `longest` or not a number.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, a: &Seen<f64>, b: &Seen<f64>, frame: &M3<f64>, longest: f64) -> bool {
        let difference = apply::<S, f64>(frame, subtract::<S, f64>(self.x, self.y));
        let step = newton(simd, a, b, difference, 0.0);
        let length = dot::<S, f64>(step.dx, step.dx).max(dot::<S, f64>(step.dy, step.dy));
        if !(length <= longest * longest) {
            return false;
        }
        self.x = moved::<S, f64>(self.x, step.dx, frame);
        self.y = moved::<S, f64>(self.y, step.dy, frame);
        let turned = moved::<S, f64>(self.n, [step.dn[0], step.dn[1], 0.0], frame);
        let inverse = 1.0 / dot::<S, f64>(turned, turned).sqrt();
        self.n = turned.map(|entry| entry * inverse);
        true
    }
}

#[inline(always)]
fn plus(a: V3<f64>, b: V3<f64>) -> V3<f64> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
