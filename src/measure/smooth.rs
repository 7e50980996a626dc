//! Distance by continuation: from the last answer of a pair along its motion, where one constraint of each body is active.
//!
//! What a hint keeps of the last answer is where it was attained and both constraints' value, gradient and Hessian there, each
//! in its own body's coordinates, where they stay true however the bodies move. So the first Newton step at new poses needs
//! no evaluation: it is the sensitivity of the last answer to the motion. Along a smooth trajectory what that step misses is
//! nearly the same each time, and is added on. One evaluation then mostly proves the answer or leaves one more step to it.

use super::pose::Pose;
use super::tangent::{Bend, Plane, Relative, Side, Step, bracket, moved, newton};
use super::vector::{M3, V3, apply, apply_transposed, basis, dot, subtract};
use crate::body::Body;
use crate::polynomial::{NumberJet, Scalar, Simd, WithSimd};
use nalgebra::Vector3;

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Trace {
    /// Active constraint of A and of B.
    active: [u8; 2],
    /// Point of A, in A's frame from its normalization's centre on, metres.
    x: V3<f64>,
    /// Point of B, in B's frame from its normalization's centre on, metres.
    y: V3<f64>,
    /// Basis in A's frame whose third vector is the normal.
    frame: M3<f64>,
    /// Constraint of A at x, in the basis.
    a: (Plane<f64>, Bend<f64>),
    /// Constraint of B at y, in B's normalized coordinates.
    jet_b: NumberJet<f64>,
    /// What the last prediction missed at x, in A's frame.
    drift_x: V3<f64>,
    /// What the last prediction missed at y, in B's frame.
    drift_y: V3<f64>,
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
        let simd = Scalar;
        let local = |body: &Body, v: &Vector3<f64>, active: u8| {
            let from_center = v - body.normalization().center;
            let z = body.normalization().linear * from_center;
            let jet = body.constraints()[usize::from(active)].polynomial.evaluate(&z);
            (from_center.into(), NumberJet::from(jet))
        };
        let ((x, jet_a), (y, jet_b)) = (local(a, x, active[0]), local(b, y, active[1]));
        let frame = basis(simd, (*n).into());
        let localized = Side::at_home(simd, a, usize::from(active[0])).localize(simd, &frame);
        let a = (Plane::new(simd, &jet_a, &localized), Bend::new(simd, &jet_a, &localized));
        Self { active, x, y, frame, a, jet_b, drift_x: [0.0; 3], drift_y: [0.0; 3] }
    }
}

/// A proven bracket and where it is attained, from the centre of A's normalization on, in A's frame, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proven {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) x: V3<f64>,
    pub(super) y: V3<f64>,
    pub(super) n: V3<f64>,
    /// Evaluations of both bodies.
    pub(super) rounds: u32,
}

/// Most evaluations before another method takes over.
const MAX_ROUNDS: u32 = 8;

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
    /// Read, and replaced if the answer is proven.
    pub(super) trace: &'a mut Trace,
}

impl WithSimd for Follow<'_> {
    type Output = Result<Proven, u32>;

    /// The proven answer, or how many rounds were spent in vain.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Proven, u32> {
        let active = self.trace.active.map(usize::from);
        if active[0] >= self.a.constraints().len() || active[1] >= self.b.constraints().len() {
            return Err(0);
        }
        let relative = Relative::new(simd, self.a, self.pose_a, self.b, self.pose_b);
        let side_a = Side::at_home(simd, self.a, active[0]);
        let side_b = Side::away(self.b, active[1], &relative);
        let longest = LONGEST * self.a.trust().reach.min(self.b.trust().reach);

        // Prediction from the old jets at the new poses.
        let trace = &*self.trace;
        let y = plus(apply::<S, f64>(&relative.rotation, trace.y), relative.origin);
        let mut at = Iterate { x: trace.x, y, frame: trace.frame };
        let local_b = side_b.localize(simd, &at.frame);
        let b = (Plane::new(simd, &trace.jet_b, &local_b), Bend::new(simd, &trace.jet_b, &local_b));
        let difference = apply::<S, f64>(&at.frame, subtract::<S, f64>(at.x, at.y));
        let step = newton(simd, (&trace.a.0, &trace.a.1), (&b.0, &b.1), difference, 0.0);
        if !step.within(longest) {
            return Err(0);
        }
        at.advance(simd, &step);
        let predicted = (at.x, at.y);
        at.x = plus(at.x, trace.drift_x);
        at.y = plus(at.y, apply::<S, f64>(&relative.rotation, trace.drift_y));

        let correct =
            Correct { sides: (side_a, side_b), tolerance: self.tolerance, limit: MAX_ROUNDS.min(self.limit), longest };
        let proven = correct.run(simd, &relative, at, self.trace)?;
        self.trace.drift_x = subtract::<S, f64>(proven.x, predicted.0);
        let drift_y = subtract::<S, f64>(proven.y, predicted.1);
        self.trace.drift_y = apply_transposed::<S, f64>(&relative.rotation, drift_y);
        Ok(proven)
    }
}

/// Correction of a start by Newton's method until the bracket is narrow.
struct Correct<'a> {
    sides: (Side<'a, f64>, Side<'a, f64>),
    tolerance: f64,
    limit: u32,
    /// Longest step, metres.
    longest: f64,
}

impl Correct<'_> {
    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        relative: &Relative<f64>,
        mut at: Iterate,
        trace: &mut Trace,
    ) -> Result<Proven, u32> {
        let (side_a, side_b) = &self.sides;
        for rounds in 1..=self.limit {
            let ((jet_a, inside_a), (jet_b, inside_b)) = (side_a.jet(simd, at.x), side_b.jet(simd, at.y));
            if !(inside_a && inside_b) {
                return Err(rounds);
            }
            let (local_a, local_b) = (side_a.localize(simd, &at.frame), side_b.localize(simd, &at.frame));
            let (a, b) = (Plane::new(simd, &jet_a, &local_a), Plane::new(simd, &jet_b, &local_b));
            let (bend_a, bend_b) = (Bend::new(simd, &jet_a, &local_a), Bend::new(simd, &jet_b, &local_b));
            let difference = apply::<S, f64>(&at.frame, subtract::<S, f64>(at.x, at.y));
            let step = newton(simd, (&a, &bend_a), (&b, &bend_b), difference, 0.0);
            if !step.within(self.longest) {
                return Err(rounds);
            }
            // The bracket where Newton's step leads, by extrapolation: mostly no other evaluation is needed.
            let next_a = side_a.extrapolate(simd, &jet_a, &local_a, step.dx);
            let next_b = side_b.extrapolate(simd, &jet_b, &local_b, step.dy);
            let next = subtract::<S, f64>(plus(difference, step.dx), step.dy);
            let found = bracket(simd, (side_a, &next_a), (side_b, &next_b), next);
            if found.upper - found.lower <= self.tolerance && found.lower > 0.0 {
                let x = moved::<S, f64>(at.x, plus(step.dx, found.to_a), &at.frame);
                let y = moved::<S, f64>(at.y, plus(step.dy, found.to_b), &at.frame);
                if !(side_a.others_hold(simd, x) && side_b.others_hold(simd, y)) {
                    return Err(rounds);
                }
                trace.x = at.x;
                trace.y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(at.y, relative.origin));
                trace.frame = at.frame;
                trace.a = (a, bend_a);
                trace.jet_b = jet_b;
                let n = apply_transposed::<S, f64>(&at.frame, found.normal);
                return Ok(Proven { lower: found.lower, upper: found.upper, x, y, n, rounds });
            }
            at.advance(simd, &step);
        }
        Err(self.limit)
    }
}

/// Trial points in the query frame and the basis whose third vector is the trial normal.
#[derive(Clone, Copy)]
struct Iterate {
    x: V3<f64>,
    y: V3<f64>,
    frame: M3<f64>,
}

impl Iterate {
    /// Takes a step; the basis follows the normal.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, step: &Step<f64>) {
        self.x = moved::<S, f64>(self.x, step.dx, &self.frame);
        self.y = moved::<S, f64>(self.y, step.dy, &self.frame);
        let turned = moved::<S, f64>(self.frame[2], [step.dn[0], step.dn[1], 0.0], &self.frame);
        let inverse = 1.0 / dot::<S, f64>(turned, turned).sqrt();
        self.frame = basis(simd, [turned[0] * inverse, turned[1] * inverse, turned[2] * inverse]);
    }
}

#[inline(always)]
fn plus(a: V3<f64>, b: V3<f64>) -> V3<f64> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}
