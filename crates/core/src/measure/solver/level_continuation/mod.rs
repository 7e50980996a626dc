//! Level distance by continuation: from the last answer of a pair along its motion, where one
//! constraint of each body is active.
//!
//! Points are given in B's normalized coordinates w, in which B never moves and its constraint g is
//! evaluated without any error of place. A is carried along by the affine map `z = M_A x`,
//! `x = K w + o` to its own normalized coordinates, x in metres in A's frame from its
//! normalization's centre on: `C = M_A K`. For A's constraint p the optimality conditions are
//!
//! ```text
//! G + μ b = 0,   g(w) = 1,   μ >= 0,   G = Cᵀ∇p(z),   b = ∇g(w)
//! ```
//!
//! and with `H = Cᵀ∇²p C + μ ∇²g` Newton's step δ and its multiplier μ' follow from
//! `H δ + μ' b = -G`, `b·δ = 1 - g`:
//!
//! ```text
//! μ' = -(1 - g + b·H⁻¹G) / (b·H⁻¹b),   δ = -H⁻¹(G + μ' b),   μ = -G·b / b·b before
//! ```
//!
//! H is regular wherever one of the bodies is curved, H⁻¹ by its cofactors.
//!
//! **Prediction.** The last answer w obeyed `G + μ b = 0` where A was then; where A is now G is
//! another, by the quadratic model of p about the point of the last jet: `∇p + ∇²p s`, s the way
//! from there to w's image. To first order the answer moves by `-P G`,
//! `P = H⁻¹ - H⁻¹b bᵀH⁻¹ / (b·H⁻¹b)`, for `P b = 0`. So the first step needs no evaluation. What it
//! misses changes slowly along a smooth trajectory; it is foreseen and added on.
//!
//! **Bracket**, at the point w' = w + δ where the step leads, values and gradients there by
//! Taylor's formula from the one evaluation; with its remainders and all rounding errors, `η` for
//! the error of x, metres:
//!
//! - From below, for any μ >= 0 and every point w'' of B, by `g(w'') <= 1`,
//!   `p >= p(z') - |M_Aᵀ∇p| η + μ (g(w') - 1) + ρ·(w'' - w') + rise`, `ρ = G + μ b`, where the rise
//!   of the convex `p + μ g` over its tangent plane is at least `¼ λ |w'' - w'|²` near w', λ a
//!   lower bound of the smallest eigenvalue of H around w', and farther away in proportion to the
//!   distance. So `d >= p(z') - |M_Aᵀ∇p| η + μ (g(w') - 1) - |ρ|²/λ`: an error of the point costs
//!   the square. Lengths are those of w, and where that is not good enough those of the metric
//!   `|d|² + |C d|²`: across a thin A a short step of w is a long one of z. Without any curvature
//!   the loss is at most |ρ| times the distance of the minimiser, of which the errors of `∇p` see
//!   only that in z: p is at most the upper bound there, so A, scaled, contains it.
//! - From above by a point of B, moved there along b (see
//!   [`crate::measure::solver::tangent_newton::taylor_bounds`]), and p there by its slope and
//!   curvature.
//!
//! The values of p range over orders of magnitude, and z lies outside A, where what
//! [`crate::body::Trust`] has of A is not valid here: bounds for p are made at each point
//! ([`crate::polynomial::Growth`]).

mod bracket;
mod sides;

use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{V3, add, apply_symmetric, apply_transposed, basis, dot, scaled, subtract};
use crate::measure::options::Options;
use crate::measure::solver::predictor::Drift;
use crate::measure::solver::step_acceleration::{Correction, Last, Series, across, along};
use crate::measure::solver::tangent_newton::{LONGEST_STEP, PATIENCE, SETTLED, WORTH_A_BRACKET};
use crate::polynomial::{NumberJet, Scalar, Simd, WithSimd};
use bracket::{Metric, ROOM};
use nalgebra::Vector3;
use sides::{Evaluated, Sides, Step, square};

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelTrace {
    /// Active constraint of A and of B.
    active: [u8; 2],
    /// Where in A's normalized coordinates A's gradient and Hessian are of.
    z: V3<f64>,
    gradient: V3<f64>,
    hessian: [f64; 6],
    /// The answer, in B's normalized coordinates.
    w: V3<f64>,
    /// `P`: xx, xy, xz, yy, yz, zz.
    response: [f64; 6],
    /// Of w.
    drift: Drift<1>,
}

impl LevelTrace {
    /// The trace of a minimiser, x in A's frame and y in B's.
    pub(in crate::measure) fn new(
        (a, pose_a, x): (&Body, &Pose, &Vector3<f64>),
        (b, pose_b, y): (&Body, &Pose, &Vector3<f64>),
        active: [u8; 2],
    ) -> Self {
        let normalized = |body: &Body, v: &Vector3<f64>| -> V3<f64> {
            (body.normalization().linear * (v - body.normalization().center)).into()
        };
        let (z, w) = (normalized(a, x), normalized(b, y));
        let sides = Sides::new(Scalar, (a, pose_a), (b, pose_b), active);
        let (jet_a, jet_b) = (sides.p.jet(Scalar, z), sides.g.jet(Scalar, w));
        let step = sides.newton(Scalar, &jet_a, &jet_b);
        Self::at(Scalar, active, (z, &jet_a), (w, jet_b.gradient), &step)
    }

    /// The trace of the answer w with the gradient of B's constraint there, where a step led from
    /// z.
    #[inline(always)]
    fn at<S: Simd>(
        simd: S,
        active: [u8; 2],
        (z, jet_a): (V3<f64>, &NumberJet<f64>),
        (w, gradient_b): (V3<f64>, V3<f64>),
        step: &Step,
    ) -> Self {
        let (gradient, hessian) = (jet_a.gradient, jet_a.hessian);
        Self { active, z, gradient, hessian, w, response: step.response(simd, gradient_b), drift: Drift::default() }
    }
}

/// A proven bracket and where it is attained, in A's frame from its normalization's centre on,
/// metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelProven {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) x: V3<f64>,
    /// Gradient of A's constraint at x, per metre.
    pub(in crate::measure) gradient: V3<f64>,
    /// Multiplier of B's constraint.
    pub(in crate::measure) multiplier: f64,
    /// Evaluations of both bodies.
    pub(in crate::measure) rounds: u32,
}

/// What is left where nothing was proven.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelLost {
    /// Evaluations of both bodies.
    pub(in crate::measure) rounds: u32,
    /// Where Newton's method ended, with a bracket that rounding keeps wide.
    pub(in crate::measure) settled: Option<Settled>,
}

/// A minimiser as good as doubles give it.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Settled {
    /// In B's frame, metres.
    pub(in crate::measure) point: Vector3<f64>,
    /// Active constraint of A and of B.
    pub(in crate::measure) active: [u8; 2],
    /// Multiplier of B's constraint.
    pub(in crate::measure) multiplier: f64,
}

impl LevelLost {
    fn after(rounds: u32) -> Self {
        Self { rounds, settled: None }
    }
}

/// Continuation as vectorized work.
pub(in crate::measure) struct FollowLevel<'a> {
    pub(in crate::measure) a: &'a Body,
    pub(in crate::measure) pose_a: &'a Pose,
    pub(in crate::measure) b: &'a Body,
    pub(in crate::measure) pose_b: &'a Pose,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Read, and replaced if the answer is proven.
    pub(in crate::measure) trace: &'a mut LevelTrace,
}

impl WithSimd for FollowLevel<'_> {
    type Output = Result<LevelProven, LevelLost>;

    /// The proven answer, or what is left.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<LevelProven, LevelLost> {
        let Self { a, b, options, trace, .. } = self;
        let [active_a, active_b] = trace.active.map(usize::from);
        if active_a >= a.constraints().len() || active_b >= b.constraints().len() {
            return Err(LevelLost::after(0));
        }
        let sides = Sides::new(simd, (a, self.pose_a), (b, self.pose_b), trace.active);
        let image = sides.map.to_a(simd, sides.map.apply(simd, trace.w));
        let moved = subtract::<S, f64>(image, trace.z);
        let gradient = add::<S, f64>(trace.gradient, apply_symmetric::<S, f64>(&trace.hessian, moved));
        let gradient_a = apply_transposed::<S, f64>(&sides.map.both, gradient);
        let delta = scaled::<S, f64>(apply_symmetric::<S, f64>(&trace.response, gradient_a), -1.0);
        if !(sides.length(simd, trace.z, delta) <= LONGEST_STEP) {
            return Err(LevelLost::after(0));
        }
        let predicted = add::<S, f64>(trace.w, delta);
        let [missed] = trace.drift.expected();
        let most = PATIENCE.min(options.max_iterations());
        // After two evaluations steps should be short: the start from nothing takes few more.
        let (proven, found) = sides.correct(simd, add::<S, f64>(predicted, missed), 2, most, options)?;
        let mut drift = trace.drift;
        drift.update(simd, [subtract::<S, f64>(found.w, predicted)]);
        *trace = LevelTrace { drift, ..found };
        Ok(proven)
    }
}

/// A start from a point of B, as vectorized work; for smooth bodies.
pub(in crate::measure) struct SeekLevel<'a> {
    pub(in crate::measure) a: &'a Body,
    pub(in crate::measure) pose_a: &'a Pose,
    pub(in crate::measure) b: &'a Body,
    pub(in crate::measure) pose_b: &'a Pose,
    /// Where to begin, in B's frame, metres.
    pub(in crate::measure) from: &'a Vector3<f64>,
    /// Most rounds.
    pub(in crate::measure) most: u32,
    /// Whose stop flag is polled.
    pub(in crate::measure) options: &'a Options<'a>,
}

impl WithSimd for SeekLevel<'_> {
    type Output = Result<(LevelProven, LevelTrace), LevelLost>;

    /// The proven answer with its trace, or what is left.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<(LevelProven, LevelTrace), LevelLost> {
        let Self { a, b, most, options, .. } = self;
        let sides = Sides::new(simd, (a, self.pose_a), (b, self.pose_b), [0, 0]);
        let w = b.normalization().linear * (self.from - b.normalization().center);
        sides.correct(simd, w.into(), most, most, options)
    }
}

impl Sides<'_> {
    /// Newton's method from w until the bracket is narrow, or steps are still long after `patience`
    /// rounds.
    #[inline(always)]
    fn correct<S: Simd>(
        &self,
        simd: S,
        mut w: V3<f64>,
        patience: u32,
        most: u32,
        options: &Options<'_>,
    ) -> Result<(LevelProven, LevelTrace), LevelLost> {
        let (mut multiplier, mut series) = (None, Series::default());
        for rounds in 1..=most {
            if options.stopped() {
                return Err(LevelLost::after(rounds - 1));
            }
            let x = self.map.apply(simd, w);
            let z = self.map.to_a(simd, x);
            let at = Evaluated { x, z, jet_a: self.p.jet(simd, z), w, jet_b: self.g.jet(simd, w) };
            let step = self.newton(simd, &at.jet_a, &at.jet_b);
            let length = self.length(simd, z, step.delta);
            if length <= ROOM {
                let end = add::<S, f64>(w, step.delta);
                let mut found = self.bracket(simd, &at, &step, &Metric::of_b(self, step.curvature));
                let mut proven = found.proves(options.accuracy());
                if !proven && length <= WORTH_A_BRACKET {
                    // So short a step leaves it wide for want of a better metric.
                    found = self.bracket(simd, &at, &step, &self.joint(&at));
                    proven = found.proves(options.accuracy());
                }
                if proven {
                    let attained = add::<S, f64>(end, found.inward);
                    if !self.others_hold(simd, attained, found.upper) {
                        return Err(LevelLost::after(rounds));
                    }
                    let of_b = (end, found.gradient_b);
                    let trace = LevelTrace::at(simd, self.active, (z, &at.jet_a), of_b, &step);
                    let proven = LevelProven {
                        lower: found.lower,
                        upper: found.upper,
                        x: self.map.apply(simd, attained),
                        gradient: found.gradient,
                        multiplier: found.multiplier,
                        rounds,
                    };
                    return Ok((proven, trace));
                }
                if length <= SETTLED {
                    if step.multiplier == 0.0 {
                        // On the side of B from which p decreases.
                        return Err(LevelLost::after(rounds));
                    }
                    let body = self.b;
                    let point = body.normalization().center + body.inverse() * Vector3::from(end);
                    let settled = Some(Settled { point, active: self.active, multiplier: step.multiplier });
                    return Err(LevelLost { rounds, settled });
                }
            }
            if length > ROOM && rounds >= patience {
                return Err(LevelLost::after(rounds));
            }
            let delta = if length <= ROOM || series.is_corrected() {
                self.corrected(simd, &mut series, &at, &step, length)
            } else {
                let (delta, next) = self.far_step(simd, &at, multiplier);
                (multiplier, series) = (Some(next.max(0.0)), Series::default());
                delta
            };
            w = add::<S, f64>(w, delta);
            if !square::<S>(w).is_finite() {
                return Err(LevelLost::after(rounds));
            }
        }
        Err(LevelLost::after(most))
    }

    /// A step of this length, made as long as those before it show that it has to be.
    #[inline(always)]
    fn corrected<S: Simd>(&self, simd: S, series: &mut Series, at: &Evaluated, step: &Step, length: f64) -> V3<f64> {
        let [t, u, _] = basis(simd, at.jet_b.gradient);
        let tangents = [t, u];
        let (newton, slope) =
            (along(simd, tangents, step.delta), along(simd, tangents, scaled::<S, f64>(step.dual_gradient, -1.0)));
        let (mut delta, mut corrected) = (step.delta, false);
        if series.may_have_to_be_corrected(newton, length) {
            let response = step.response(simd, at.jet_b.gradient);
            let of_t = apply_symmetric::<S, f64>(&response, t);
            let of_u = apply_symmetric::<S, f64>(&response, u);
            let compliance = [dot::<S, f64>(t, of_t), dot::<S, f64>(t, of_u), dot::<S, f64>(u, of_u)];
            let found = series.correction(simd, tangents, (newton, slope), compliance);
            corrected = found != Correction::default();
            let Correction { longer, shorter } = found;
            delta = add::<S, f64>(delta, across(simd, tangents, [longer[0] + shorter[0], longer[1] + shorter[1]]));
            let length = self.length(simd, at.z, delta);
            if length > LONGEST_STEP {
                delta = scaled::<S, f64>(delta, LONGEST_STEP / length);
            }
        }
        series.push(tangents, Last { newton, taken: along(simd, tangents, delta), slope, corrected });
        delta
    }
}
