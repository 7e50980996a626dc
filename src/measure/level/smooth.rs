//! Level distance by continuation: from the last answer of a pair along its motion, where one constraint of each body is
//! active.
//!
//! Points are given in B's normalized coordinates w, in which B never moves and its constraint g is evaluated without any
//! error of place. A is carried along by the affine map `z = M_A x`, `x = K w + o` to its own normalized coordinates, x in metres
//! in A's frame from its normalization's centre on: `C = M_A K`. For A's constraint p the optimality conditions are
//!
//! ```text
//! G + μ b = 0,   g(w) = 1,   μ >= 0,   G = Cᵀ∇p(z),   b = ∇g(w)
//! ```
//!
//! and with `H = Cᵀ∇²p C + μ ∇²g` Newton's step δ and its multiplier μ' follow from `H δ + μ' b = -G`, `b·δ = 1 - g`:
//!
//! ```text
//! μ' = -(1 - g + b·H⁻¹G) / (b·H⁻¹b),   δ = -H⁻¹(G + μ' b),   μ = -G·b / b·b before
//! ```
//!
//! H is regular wherever one of the bodies is curved, H⁻¹ by its cofactors.
//!
//! **Prediction.** The last answer's jets of p and g stay true however the bodies move, but then belong to two different points,
//! z and w: with `s = C w + M_A o - z` the quadratic model of p has at w's image the gradient `∇p + ∇²p s`. So the first step
//! needs no evaluation. What it misses is nearly the same each time along a smooth trajectory, and is added on.
//!
//! **Bracket**, at the point w' = w + δ where the step leads, values and gradients there by Taylor's formula from the one
//! evaluation; with its remainders and all rounding errors, `η` for the error of x, metres:
//!
//! - From below, for any μ >= 0 and every point w'' of B, by `g(w'') <= 1`,
//!   `p >= p(z') - |M_Aᵀ∇p| η + μ (g(w') - 1) + ρ·(w'' - w') + rise`, `ρ = G + μ b`, where the rise of the convex `p + μ g` over its
//!   tangent plane is at least `¼ λ |w'' - w'|²` near w', λ a lower bound of the smallest eigenvalue of H around w', and
//!   farther away in proportion to the distance. So `d >= p(z') - |M_Aᵀ∇p| η + μ (g(w') - 1) - |ρ|²/λ`: an error of the
//!   point costs the square. Lengths are those of w, and where that is not good enough those of the metric `|d|² + |C d|²`:
//!   across a thin A a short step of w is a long one of z. Without any curvature the loss is at most |ρ| times the distance of
//!   the minimiser, of which the errors of `∇p` see only that in z: p is at most the upper bound there, so A, scaled, holds it.
//! - From above by a point of B, moved there along b (see [`crate::measure::tangent::bracket`]), and p there by its slope and curvature.
//!
//! The values of p range over orders of magnitude, and z lies outside A, where what [`crate::body::Trust`] knows of A does not
//! hold: bounds for p are made at each point ([`crate::polynomial::Growth`]).

use crate::body::{Body, ConstraintTrust};
use crate::measure::options::Options;
use crate::measure::pose::Pose;
use crate::measure::tangent::{NUDGE, Relative, SLACK, Side, TURNED};
use crate::measure::vector::{
    M3, V3, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, rows, subtract, times_transposed,
};
use crate::polynomial::{NEAR_LEVEL, Number, NumberJet, Polynomial, Scalar, Simd, WithSimd, gamma};
use nalgebra::Vector3;

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelTrace {
    /// Active constraint of A and of B.
    active: [u8; 2],
    /// Where in A's normalized coordinates A's jet is of.
    z: V3<f64>,
    jet_a: NumberJet<f64>,
    /// Where in B's normalized coordinates B's jet is of.
    w: V3<f64>,
    jet_b: NumberJet<f64>,
    /// What the last prediction missed, in B's normalized coordinates.
    drift: V3<f64>,
}

impl LevelTrace {
    /// The trace of a minimiser, x in A's frame and y in B's.
    pub(super) fn new(a: &Body, x: &Vector3<f64>, b: &Body, y: &Vector3<f64>, active: [u8; 2]) -> Self {
        let local = |body: &Body, v: &Vector3<f64>, active: u8| {
            let z: V3<f64> = (body.normalization().linear * (v - body.normalization().center)).into();
            (z, body.constraints()[usize::from(active)].polynomial.jet(Scalar, z))
        };
        let ((z, jet_a), (w, jet_b)) = (local(a, x, active[0]), local(b, y, active[1]));
        Self { active, z, jet_a, w, jet_b, drift: [0.0; 3] }
    }
}

/// A proven bracket and where it is attained, in A's frame from its normalization's centre on, metres.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelProven {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) x: V3<f64>,
    /// Gradient of A's constraint at x, per metre.
    pub(super) gradient: V3<f64>,
    /// Multiplier of B's constraint.
    pub(super) multiplier: f64,
    /// Evaluations of both bodies.
    pub(super) rounds: u32,
}

/// What is left where nothing was proven.
#[derive(Clone, Copy, Debug)]
pub(super) struct LevelLost {
    /// Evaluations of both bodies.
    pub(super) rounds: u32,
    /// Where Newton's method ended, with a bracket that rounding keeps wide.
    pub(super) settled: Option<Settled>,
}

/// A minimiser as good as doubles give it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settled {
    /// In B's frame, metres.
    pub(super) point: Vector3<f64>,
    /// Active constraint of A and of B.
    pub(super) active: [u8; 2],
    /// Multiplier of B's constraint.
    pub(super) multiplier: f64,
}

impl LevelLost {
    fn after(rounds: u32) -> Self {
        Self { rounds, settled: None }
    }
}

/// Most evaluations before another method takes over.
const MAX_ROUNDS: u32 = 8;

/// Most evaluations from a cold start before another method takes over.
pub(super) const SEEK_ROUNDS: u32 = 16;

/// Longest step that is as good as none, so that a bracket it leaves wide is worth a second one in a better metric.
const SHORT: f64 = 1e-3;

/// Largest imbalance of the gradients, relative to them, that an answer is taken at: its gradients are off by about as much, a few
/// times more in metres.
const BALANCED: f64 = 1e-7;

/// Longest step after which none is left but rounding.
const SETTLED: f64 = 1e-9;

/// Slope of p per length of A or of B that an answer's gradient need not be better than relative to.
const FORCE: f64 = 1e-3;

/// Distance from A's centre, relative to A, that counts as none.
const CENTER: f64 = 0.02;

/// How much a step may be damped, relative to what the Hessian is of such values over such lengths.
const DAMPINGS: [f64; 7] = [0.0, 1e-5, 1e-4, 1e-3, 1e-2, 1e-1, 1.0];

/// Most of the curvature along the gradient of p that is not that of the root of p.
const MOST_BENT: f64 = 0.9;

/// Longest step, relative to B and to the distance from A's centre, that the linearization may mean anything for.
const LONGEST: f64 = 0.5;

/// Longest step that bounds are made for: relative to the distance from A's centre, or to B.
const ROOM: f64 = 1.0 / 16.0;

/// Continuation as work for the widest arithmetic.
pub(super) struct FollowLevel<'a> {
    pub(super) a: &'a Body,
    pub(super) pose_a: &'a Pose,
    pub(super) b: &'a Body,
    pub(super) pose_b: &'a Pose,
    pub(super) options: &'a Options<'a>,
    /// Read, and replaced if the answer is proven.
    pub(super) trace: &'a mut LevelTrace,
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
        let moved = shifted(simd, &trace.jet_a, subtract::<S, f64>(image, trace.z));
        let step = sides.newton(simd, &moved, &trace.jet_b);
        if !(sides.length(simd, trace.z, step.delta) <= LONGEST) {
            return Err(LevelLost::after(0));
        }
        let predicted = plus(trace.w, step.delta);
        let most = MAX_ROUNDS.min(options.max_iterations());
        let (proven, found) = sides.correct(simd, plus(predicted, trace.drift), most, options)?;
        *trace = LevelTrace { drift: subtract::<S, f64>(found.end, predicted), ..found.trace };
        Ok(proven)
    }
}

/// A start from a point of B, as work for the widest arithmetic; for smooth bodies.
pub(super) struct SeekLevel<'a> {
    pub(super) a: &'a Body,
    pub(super) pose_a: &'a Pose,
    pub(super) b: &'a Body,
    pub(super) pose_b: &'a Pose,
    /// Where to begin, in B's frame, metres.
    pub(super) from: &'a Vector3<f64>,
    /// Most rounds.
    pub(super) most: u32,
    /// Whose stop flag is polled.
    pub(super) options: &'a Options<'a>,
}

impl WithSimd for SeekLevel<'_> {
    type Output = Result<(LevelProven, LevelTrace), LevelLost>;

    /// The proven answer with its trace, or what is left.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<(LevelProven, LevelTrace), LevelLost> {
        let Self { a, b, most, options, .. } = self;
        let sides = Sides::new(simd, (a, self.pose_a), (b, self.pose_b), [0, 0]);
        let w = b.normalization().linear * (self.from - b.normalization().center);
        let (proven, found) = sides.correct(simd, w.into(), most, options)?;
        Ok((proven, found.trace))
    }
}

/// Where Newton's method was when it proved its answer.
struct Found {
    trace: LevelTrace,
    /// Where its last step led.
    end: V3<f64>,
}

/// The map from B's normalized coordinates w to A's, with its errors.
struct Map {
    /// `K` in `x = K w + o`.
    linear: M3<f64>,
    /// `o`.
    origin: V3<f64>,
    /// `M_A` in `z = M_A x`.
    to_a: M3<f64>,
    /// `M_A K`.
    both: M3<f64>,
    /// Bound of the error of x, for w and steps within B's ball, metres.
    displacement: f64,
    /// Relative bound of the displacement that the rounding of z amounts to.
    rounding: f64,
    /// Bound of the error of `K` in operator norm.
    turn: f64,
}

impl Map {
    #[inline(always)]
    fn new<S: Simd>(simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> Self {
        let inverse = rows(simd, &b.inverse().transpose());
        let (to_a, origin) = (rows(simd, &a.normalization().linear), relative.origin);
        let linear = times_transposed::<S, f64>(&relative.rotation, &inverse);
        let both = product::<S>(&to_a, &linear);
        let trust = b.trust();
        let turn = (TURNED + gamma(16)) * trust.inverse_norm + trust.inverse_error;
        let far = origin[0].abs() + origin[1].abs() + origin[2].abs();
        let rounding = a.trust().rounding;
        Self {
            linear,
            origin,
            to_a,
            both,
            // Twice: w and the step.
            displacement: (relative.displacement + 2.0 * turn * trust.radius + gamma(4) * far) * (1.0 + 1e-13)
                + rounding * trust.inverse_norm * trust.radius,
            rounding,
            turn,
        }
    }

    #[inline(always)]
    fn apply<S: Simd>(&self, _: S, w: V3<f64>) -> V3<f64> {
        plus(apply::<S, f64>(&self.linear, w), self.origin)
    }

    #[inline(always)]
    fn to_a<S: Simd>(&self, _: S, x: V3<f64>) -> V3<f64> {
        apply::<S, f64>(&self.to_a, x)
    }

    /// The matrix of `of_a |C d|² + of_b |d|²`: xx, xy, xz, yy, yz, zz.
    #[inline(always)]
    fn metric(&self, of_a: f64, of_b: f64) -> [f64; 6] {
        let [r, s, t] = self.both;
        let entry = |i: usize, j: usize| of_a * (r[i] * r[j] + s[i] * s[j] + t[i] * t[j]);
        [entry(0, 0) + of_b, entry(0, 1), entry(0, 2), entry(1, 1) + of_b, entry(1, 2), entry(2, 2) + of_b]
    }
}

/// Both bodies with their active constraints.
struct Sides<'a> {
    a: &'a Body,
    b: &'a Body,
    /// Active constraint of A and of B.
    active: [u8; 2],
    p: &'a Polynomial,
    g: &'a Polynomial,
    trust: &'a ConstraintTrust,
    map: Map,
}

/// Both constraints at one point.
struct Evaluated {
    x: V3<f64>,
    z: V3<f64>,
    jet_a: NumberJet<f64>,
    w: V3<f64>,
    jet_b: NumberJet<f64>,
}

/// A Newton step.
struct Step {
    /// Change of w.
    delta: V3<f64>,
    /// Multiplier before the step, in H.
    multiplier: f64,
    /// Lower bound of the smallest eigenvalue of H, but for the errors of its entries.
    curvature: f64,
}

/// How steps of w are measured: by a norm that bounds their lengths in both bodies' normalized coordinates.
struct Metric {
    /// Bound of `|C d|` by the norm of d.
    of_a: f64,
    /// Bound of `|d|`.
    of_b: f64,
    /// Lower bound of the smallest curvature by the norm's square, but for the errors of the Hessian's entries.
    curvature: f64,
    /// Of the symmetric matrix of the norm: xx, xy, xz, yy, yz, zz.
    inverse: [f64; 6],
}

impl Metric {
    /// B's normalized coordinates.
    #[inline(always)]
    fn of_b(spread: f64, curvature: f64) -> Self {
        Self { of_a: spread, of_b: 1.0, curvature, inverse: [1.0, 0.0, 0.0, 1.0, 0.0, 1.0] }
    }
}

/// A bracket at the end of a step.
struct Bracket {
    lower: f64,
    upper: f64,
    /// From there to a point of B, by w.
    inward: V3<f64>,
    /// Gradient of A's constraint in A's frame, per metre.
    gradient: V3<f64>,
    multiplier: f64,
    /// Whether the gradients oppose each other well enough for gradients of the answer.
    aligned: bool,
}

impl Bracket {
    #[inline(always)]
    fn proves(&self, accuracy: f64) -> bool {
        self.upper - self.lower <= accuracy * self.upper.abs().max(1.0) && self.aligned
    }
}

impl<'a> Sides<'a> {
    /// The bodies with these active constraints.
    #[inline(always)]
    fn new<S: Simd>(simd: S, (a, pose_a): (&'a Body, &Pose), (b, pose_b): (&'a Body, &Pose), active: [u8; 2]) -> Self {
        let [of_a, of_b] = active.map(usize::from);
        Self {
            a,
            b,
            active,
            p: &a.constraints()[of_a].polynomial,
            g: &b.constraints()[of_b].polynomial,
            trust: &b.trust().constraints[of_b],
            map: Map::new(simd, a, b, &Relative::new(simd, a, pose_a, b, pose_b)),
        }
    }

    /// Newton's method from w until the bracket is narrow.
    #[inline(always)]
    fn correct<S: Simd>(
        &self,
        simd: S,
        mut w: V3<f64>,
        most: u32,
        options: &Options<'_>,
    ) -> Result<(LevelProven, Found), LevelLost> {
        let mut multiplier = None;
        for rounds in 1..=most {
            if options.stopped() {
                return Err(LevelLost::after(rounds - 1));
            }
            let x = self.map.apply(simd, w);
            let z = self.map.to_a(simd, x);
            let at = Evaluated { x, z, jet_a: self.p.jet(simd, z), w, jet_b: self.g.jet(simd, w) };
            let step = self.newton(simd, &at.jet_a, &at.jet_b);
            let length = self.length(simd, z, step.delta);
            if !(length <= ROOM) {
                let (delta, next) = self.damped(simd, &at, multiplier);
                w = plus(w, delta);
                multiplier = Some(next.max(0.0));
                if !square::<S>(w).is_finite() {
                    return Err(LevelLost::after(rounds));
                }
                continue;
            }
            let mut found = self.bracket(simd, &at, &step, &Metric::of_b(self.spread(), step.curvature));
            let end = plus(w, step.delta);
            let mut proven = found.proves(options.accuracy());
            if !proven && length <= SHORT {
                found = self.bracket(simd, &at, &step, &self.joint(&at));
                proven = found.proves(options.accuracy());
            }
            if proven {
                let attained = plus(end, found.inward);
                if !self.others_hold(simd, attained, found.upper) {
                    return Err(LevelLost::after(rounds));
                }
                let trace = LevelTrace { active: self.active, z, jet_a: at.jet_a, w, jet_b: at.jet_b, drift: [0.0; 3] };
                let proven = LevelProven {
                    lower: found.lower,
                    upper: found.upper,
                    x: self.map.apply(simd, attained),
                    gradient: found.gradient,
                    multiplier: found.multiplier,
                    rounds,
                };
                return Ok((proven, Found { trace, end }));
            }
            if length <= SETTLED {
                let body = self.b;
                let point = body.normalization().center + body.inverse() * Vector3::from(end);
                let settled = Some(Settled { point, active: self.active, multiplier: step.multiplier });
                return Err(LevelLost { rounds, settled });
            }
            w = end;
        }
        Err(LevelLost::after(most))
    }

    /// How long a step from z is: relative to B, and to the distance from A's centre.
    #[inline(always)]
    fn length<S: Simd>(&self, _: S, z: V3<f64>, delta: V3<f64>) -> f64 {
        let of_b = self.b.trust().radius;
        let in_a = square::<S>(apply::<S, f64>(&self.map.both, delta)) / self.far::<S>(z);
        in_a.max(square::<S>(delta) / (of_b * of_b)).sqrt()
    }

    /// Square of the distance of z from A's centre, or of what counts as none.
    #[inline(always)]
    fn far<S: Simd>(&self, z: V3<f64>) -> f64 {
        square::<S>(z).max((CENTER * self.a.trust().radius).powi(2))
    }

    /// Newton's step.
    #[inline(always)]
    fn newton<S: Simd>(&self, simd: S, a: &NumberJet<f64>, b: &NumberJet<f64>) -> Step {
        let (pulled, multiplier) = self.balance(simd, a, b);
        let hessian = self.hessian(simd, a, b, multiplier);
        let (cofactors, determinant) = cofactors(simd, hessian);
        let u = apply_symmetric::<S, f64>(&cofactors, pulled);
        let v = apply_symmetric::<S, f64>(&cofactors, b.gradient);
        let excess = b.value - 1.0;
        let next = (determinant * excess - dot::<S, f64>(u, b.gradient)) / dot::<S, f64>(b.gradient, v);
        let delta = scaled(add_scaled::<S, f64>(u, next, v), -1.0 / determinant);
        // The determinant over the square of half the trace, as in the tangent plane's bracket.
        let half_trace = 0.5 * (hessian[0] + hessian[3] + hessian[5]);
        let curvature = determinant / (half_trace * half_trace) - 256.0 * f64::EPSILON * half_trace;
        Step { delta, multiplier, curvature }
    }

    /// A step towards the solution from afar, where Newton's would be a long one: towards the least of `p^(2/d)`, d the degree of p,
    /// which is about a square whatever d is, and damped (Levenberg and Marquardt) until it is short enough for the Hessians
    /// to mean something where it leads.
    #[inline(always)]
    fn damped<S: Simd>(&self, simd: S, at: &Evaluated, multiplier: Option<f64>) -> (V3<f64>, f64) {
        let (a, b) = (&at.jet_a, &at.jet_b);
        let (pulled, fitting) = self.balance(simd, a, b);
        let multiplier = multiplier.unwrap_or(fitting);
        let hessian = self.hessian(simd, a, b, multiplier);
        let degree = self.p.degree() as f64;
        let of_b = self.b.trust().radius;
        let stiff_a = degree * (degree - 1.0) * a.value / self.far::<S>(at.z);
        let stiff_b = square::<S>(pulled).sqrt() / of_b;
        let (mut delta, mut next) = ([f64::NAN; 3], 0.0);
        for damping in DAMPINGS {
            let mut h = self.map.metric(damping * stiff_a, damping * stiff_b);
            for (entry, of_hessian) in h.iter_mut().zip(hessian) {
                *entry += of_hessian;
            }
            let (cofactors, determinant) = cofactors(simd, h);
            let inverse = 1.0 / determinant;
            let u = scaled(apply_symmetric::<S, f64>(&cofactors, pulled), inverse);
            let v = scaled(apply_symmetric::<S, f64>(&cofactors, b.gradient), inverse);
            // Of p^(2/d) the Hessian lacks this much of the square of the gradient; by the formula of Sherman and Morrison.
            let (of_u, mixed) = (dot::<S, f64>(pulled, u), dot::<S, f64>(b.gradient, u));
            let lacks = ((1.0 - 2.0 / degree) / a.value).min(MOST_BENT / of_u);
            let more = 1.0 / (1.0 - lacks * of_u);
            let v = add_scaled::<S, f64>(v, lacks * mixed * more, u);
            let u = scaled(u, more);
            let excess = b.value - 1.0;
            next = (excess - dot::<S, f64>(u, b.gradient)) / dot::<S, f64>(b.gradient, v);
            delta = scaled(add_scaled::<S, f64>(u, next, v), -1.0);
            let length = self.length(simd, at.z, delta);
            if length <= LONGEST {
                return (delta, next);
            }
        }
        (scaled(delta, LONGEST / self.length(simd, at.z, delta)), next)
    }

    /// `G` and the multiplier that fits the gradients best.
    #[inline(always)]
    fn balance<S: Simd>(&self, _: S, a: &NumberJet<f64>, b: &NumberJet<f64>) -> (V3<f64>, f64) {
        let pulled = apply_transposed::<S, f64>(&self.map.both, a.gradient);
        // Where p falls inward B's constraint holds nothing back.
        let multiplier = (-dot::<S, f64>(pulled, b.gradient) / dot::<S, f64>(b.gradient, b.gradient)).max(0.0);
        (pulled, multiplier)
    }

    /// `H`: xx, xy, xz, yy, yz, zz.
    #[inline(always)]
    fn hessian<S: Simd>(&self, _: S, a: &NumberJet<f64>, b: &NumberJet<f64>, multiplier: f64) -> [f64; 6] {
        let c = &self.map.both;
        let [xx, xy, xz, yy, yz, zz] = a.hessian;
        let bent = product::<S>(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], c);
        let mut hessian = b.hessian;
        let mut k = 0;
        for i in 0..3 {
            for j in i..3 {
                let pulled = fused::<S>(c[2][i], bent[2][j], fused::<S>(c[1][i], bent[1][j], c[0][i] * bent[0][j]));
                hessian[k] = fused::<S>(multiplier, hessian[k], pulled);
                k += 1;
            }
        }
        hessian
    }

    /// The metric that counts lengths in both bodies' normalized coordinates, `|d|² + |C d|²`: however thin a body is, none of its
    /// bounds suffers from how long a step across it is in the coordinates of the other.
    fn joint(&self, at: &Evaluated) -> Metric {
        let spread = self.spread();
        let n = self.map.metric(1.0, 1.0);
        let (_, multiplier) = self.balance(Scalar, &at.jet_a, &at.jet_b);
        let h = self.hessian(Scalar, &at.jet_a, &at.jet_b, multiplier);
        let (of_n, det_n) = cofactors(Scalar, n);
        let (_, det_h) = cofactors(Scalar, h);
        let trace = |m: &[f64; 6]| m[0] + m[3] + m[5];
        let rounding = 64.0 * f64::EPSILON;
        // Of the eigenvalues of N⁻¹H the smallest is at least the determinant over the square of half the trace.
        let (trace_n, trace_h) = (trace(&n), trace(&h));
        let mixed = of_n[0] * h[0] + of_n[3] * h[3] + of_n[5] * h[5];
        let mixed = mixed + 2.0 * (of_n[1] * h[1] + of_n[2] * h[2] + of_n[4] * h[4]);
        let least_n = det_n - rounding * trace_n.powi(3);
        let half_trace = 0.5 * (mixed + rounding * trace_n * trace_n * trace_h) / least_n;
        let ratio = (det_h - rounding * trace_h.powi(3)) / (det_n + rounding * trace_n.powi(3));
        // The entries of N are rounded, too.
        let kept = 1.0 - rounding * trace_n;
        let curvature = if least_n > 0.0 && kept > 0.5 { ratio / (half_trace * half_trace) } else { 0.0 };
        let kept = kept.max(0.5);
        Metric {
            of_a: spread / (kept + spread * spread).sqrt() * (1.0 + 1e-12),
            of_b: (1.0 / kept).sqrt() * (1.0 + 1e-12),
            curvature,
            inverse: of_n.map(|entry| entry / det_n),
        }
    }

    /// Bound of the length of `C d` by that of d.
    #[inline(always)]
    fn spread(&self) -> f64 {
        let [r, s, t] = self.map.both;
        let square = |v: V3<f64>| v[0] * v[0] + v[1] * v[1] + v[2] * v[2];
        (square(r) + square(s) + square(t)).sqrt() * (1.0 + 1e-12) + self.a.trust().linear_norm * self.map.turn
    }

    /// The bracket at the end of a step, with lengths of steps in a metric; NaN where nothing is proven.
    #[inline(always)]
    fn bracket<S: Simd>(&self, _: S, at: &Evaluated, step: &Step, metric: &Metric) -> Bracket {
        let Self { map, .. } = self;
        let (trust_a, trust_b) = (self.a.trust(), self.b.trust());
        let norm = |v: V3<f64>| dot::<S, f64>(v, v).sqrt();
        let sum = |v: V3<f64>| v[0].abs() + v[1].abs() + v[2].abs();

        // A at the end of the step, with errors that hold as far again.
        let dz = map.to_a_step::<S>(step.delta);
        let bent = apply_symmetric::<S, f64>(&at.jet_a.hessian, dz);
        let value_a = at.jet_a.value + dot::<S, f64>(dz, add_scaled::<S, f64>(at.jet_a.gradient, 0.5, bent));
        let gradient_z = plus(at.jet_a.gradient, bent);
        let length = norm(at.z);
        let room = ROOM * if length > trust_a.radius { length } else { trust_a.radius };
        let coordinate = at.z.iter().fold(0.0_f64, |most, entry| if entry.abs() > most { entry.abs() } else { most });
        let growth = self.p.growth(coordinate + 2.0 * room, length + 2.0 * room);
        let step_a = norm(dz);
        let half_third_a = 0.5 * growth.third * step_a * step_a * (1.0 + 1e-12);
        let error_a = growth.value_error + half_third_a * step_a * (1.0 / 3.0 + 1e-9);
        // 1.8 > √3.
        let gradient_error = 1.8 * growth.gradient_error + half_third_a + gamma(16) * sum(gradient_z);
        let gradient = apply_transposed::<S, f64>(&map.to_a, gradient_z);
        let slope = norm(gradient) * (1.0 + 1e-14) + trust_a.linear_norm * gradient_error;
        let pulled = apply_transposed::<S, f64>(&map.linear, gradient);
        let displaced = map.displacement + map.rounding * sum(at.x);
        let trace = |h: &[f64; 6]| h[0] + h[3] + h[5];
        let (trace_a, trace_b) = (trace(&at.jet_a.hessian), trace(&at.jet_b.hessian));
        let ceiling_a = trace_a + growth.third * 2.0 * room + growth.curvature_error;
        let spread = self.spread();
        let rounded = gamma(16) * trust_a.linear_norm * trust_b.inverse_norm * sum(gradient_z);
        // In z, and what is added by the map, in w.
        let z_error = gradient_error + ceiling_a * trust_a.linear_norm * displaced;
        let w_error = slope * map.turn + rounded;
        let pulled_error = spread * z_error + w_error;

        // B at the end of the step.
        let bent = apply_symmetric::<S, f64>(&at.jet_b.hessian, step.delta);
        let value_b = at.jet_b.value + dot::<S, f64>(step.delta, add_scaled::<S, f64>(at.jet_b.gradient, 0.5, bent));
        let b = plus(at.jet_b.gradient, bent);
        let third = self.trust.third;
        let room_b = (0.5 * third.leeway).min(ROOM * trust_b.radius);
        let step_b = norm(step.delta);
        let half_third_b = 0.5 * third.ceiling * step_b * step_b * (1.0 + 1e-12);
        // Four times: twice for Taylor's formula, and (17/16)⁸ < 2 for the step out of the ball.
        let error_b = 4.0 * self.trust.value_error + half_third_b * step_b * (1.0 / 3.0 + 1e-9);
        let b_error = 4.0 * self.trust.gradient_error / trust_b.linear_norm + half_third_b;

        // Lower bound.
        let square = dot::<S, f64>(b, b);
        let inverse = 1.0 / square.sqrt();
        let multiplier = -dot::<S, f64>(pulled, b) * (inverse * inverse);
        let (of_a, of_b) = (metric.of_a, metric.of_b);
        let rest =
            norm(add_scaled::<S, f64>(pulled, multiplier, b)) + (w_error + multiplier * b_error) + SLACK * sum(pulled);
        let off = of_a * z_error + of_b * rest;
        let entries = of_a * of_a * growth.curvature_error
            + trace_a
                * trust_a.linear_norm
                * (3.0 * of_a * of_b * map.turn + gamma(64) * of_b * of_b * spread * trust_b.inverse_norm)
            + step.multiplier * of_b * of_b * (self.trust.curvature_error + gamma(64) * trace_b);
        let bending_a = growth.third * of_a * of_a;
        let bending_b = multiplier * third.ceiling * of_b * of_b;
        let bending = bending_a * of_a + bending_b * of_b;
        let kept = if multiplier < step.multiplier { multiplier / step.multiplier } else { 1.0 };
        let curvature = kept * (metric.curvature - entries) - (bending_a * step_a + bending_b * step_b);
        let reach = (room_b / of_b).min(room / of_a);
        // Second derivatives fall by at most `bending` per length.
        let slope_there =
            0.25 * curvature * if 1.5 * curvature < bending * reach { 1.5 * curvature / bending } else { reach };
        let span_b = trust_b.radius * (1.0 + ROOM) + self.b.z_extent().norm() * (1.0 + 1e-14);
        let slack = SLACK * (value_a.abs() + multiplier * (1.0 + value_b.abs()) + error_a) + slope * displaced;

        // Upper bound: into B along b, as far as its curvature may ask.
        let excess = value_b - 1.0 + error_b;
        let ceiling = trace_b + third.ceiling * (step_b + room_b) + 2.0 * self.trust.curvature_error;
        let q = ceiling * excess.abs() * inverse * inverse * (1.0 + 1e-9);
        let distance = (excess + excess.abs() * (2.0 * q + NUDGE)) * inverse;
        let way = distance.abs();
        let lift = spread * way + trust_a.linear_norm * displaced;
        let upper = value_a
            + error_a
            + distance * multiplier * square * inverse
            + (way * pulled_error + 0.5 * ceiling_a * lift * lift)
            + slack
            + SLACK * way * sum(pulled);

        // Only the minimiser counts, where A's polynomial is at most `upper`: by convexity A, scaled about its interior point by
        // this, holds all such points.
        let scale = ((upper - self.a.min_value()) / (1.0 - self.a.min_value())).max(1.0);
        let extent = self.a.z_extent().norm() * (1.0 + 1e-9);
        let span_a = (spread * span_b).min(length + step_a + (1.0 + 2.0 * scale) * extent);
        let linear = z_error * span_a + rest * span_b;
        let loss = if curvature > 0.0 && off <= slope_there { (off * off / curvature).min(linear) } else { linear };
        let fall = multiplier * (value_b - 1.0 - error_b);
        let slack = slack + SLACK * loss;
        let lower = value_a - error_a + fall - loss - slack;

        let inside = dot::<S, f64>(at.w, at.w) <= trust_b.radius * trust_b.radius
            && (at.jet_b.value - 1.0).abs() <= NEAR_LEVEL
            && step_b <= room_b
            && way <= room_b
            && step_a <= room
            && lift <= room
            && multiplier >= 0.0
            && q <= 0.1
            && b_error * (4.0 / NUDGE) * inverse <= 1.0;
        let turned = apply_symmetric::<S, f64>(&metric.inverse, b);
        let force = multiplier * dot::<S, f64>(b, turned).sqrt();
        let aligned = off <= BALANCED * if force > FORCE { force } else { FORCE };
        Bracket {
            lower: if inside { lower } else { f64::NAN },
            upper,
            inward: scaled(b, -distance * inverse),
            gradient,
            multiplier,
            aligned,
        }
    }

    /// Whether at the point w of B's normalized coordinates the other constraints of B are proven to hold, and those of A not
    /// to exceed `upper`.
    #[inline(always)]
    fn others_hold<S: Simd>(&self, simd: S, w: V3<f64>, upper: f64) -> bool {
        let [active_a, active_b] = self.active.map(usize::from);
        let mut hold = true;
        let (trust_a, trust_b) = (self.a.trust(), self.b.trust());
        if self.b.constraints().len() > 1 {
            hold &= dot::<S, f64>(w, w) <= trust_b.radius * trust_b.radius;
            for (i, constraint) in self.b.constraints().iter().enumerate().filter(|(i, _)| *i != active_b) {
                // Twice: w itself is rounded.
                hold &= constraint.polynomial.jet(simd, w).value + 2.0 * trust_b.constraints[i].value_error <= 1.0;
            }
        }
        if self.a.constraints().len() > 1 {
            let x = self.map.apply(simd, w);
            let z = Vector3::from(self.map.to_a(simd, x));
            let far = x[0].abs() + x[1].abs() + x[2].abs();
            let dz = Vector3::repeat(trust_a.linear_norm * (self.map.displacement + self.map.rounding * far));
            for (_, constraint) in self.a.constraints().iter().enumerate().filter(|(i, _)| *i != active_a) {
                let jet = constraint.polynomial.jet(simd, z.into());
                hold &= jet.value + constraint.polynomial.value_error(&z, &Vector3::from(jet.gradient), &dz) < upper;
            }
        }
        hold
    }
}

impl Map {
    /// Change of z by a step of w.
    #[inline(always)]
    fn to_a_step<S: Simd>(&self, delta: V3<f64>) -> V3<f64> {
        apply::<S, f64>(&self.to_a, apply::<S, f64>(&self.linear, delta))
    }
}

#[inline(always)]
fn square<S: Simd>(v: V3<f64>) -> f64 {
    dot::<S, f64>(v, v)
}

/// The quadratic model of a jet, about a point `by` away.
#[inline(always)]
fn shifted<S: Simd>(_: S, jet: &NumberJet<f64>, by: V3<f64>) -> NumberJet<f64> {
    let bent = apply_symmetric::<S, f64>(&jet.hessian, by);
    // The value is not needed for the step.
    NumberJet { value: f64::NAN, gradient: plus(jet.gradient, bent), hessian: jet.hessian }
}

/// Whether the interior point of A is proven to lie in B: then B does not hold the minimiser of A's polynomial back.
pub(super) struct Saturated<'a> {
    pub(super) a: &'a Body,
    pub(super) pose_a: &'a Pose,
    pub(super) b: &'a Body,
    pub(super) pose_b: &'a Pose,
}

impl WithSimd for Saturated<'_> {
    type Output = bool;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> bool {
        let Self { a, b, .. } = self;
        let relative = Relative::new(simd, a, self.pose_a, b, self.pose_b);
        let from = a.interior_point();
        let x = from - a.normalization().center;
        let displaced = relative.displacement + gamma(4) * (from.norm() + a.normalization().center.norm());
        let trust = b.trust();
        let dz = trust.linear_norm * displaced;
        let mut hold = displaced <= trust.leeway;
        for (i, constraint) in trust.constraints.iter().enumerate() {
            let (jet, inside) = Side::away(b, i, &relative).jet(simd, x.into());
            let slope =
                dot::<S, f64>(jet.gradient, jet.gradient).sqrt() + constraint.gradient_error / trust.linear_norm;
            let rise = slope * dz + constraint.curvature_ceiling * displaced * displaced;
            hold &= inside && jet.value + constraint.value_error + 1.01 * rise <= 1.0;
        }
        hold
    }
}

/// `M N`. No closures here: they would not be compiled for the widest arithmetic.
#[inline(always)]
fn product<S: Simd>(m: &M3<f64>, n: &M3<f64>) -> M3<f64> {
    [apply_transposed::<S, f64>(n, m[0]), apply_transposed::<S, f64>(n, m[1]), apply_transposed::<S, f64>(n, m[2])]
}

#[inline(always)]
fn plus(a: V3<f64>, b: V3<f64>) -> V3<f64> {
    [a[0] + b[0], a[1] + b[1], a[2] + b[2]]
}

#[inline(always)]
fn fused<S: Simd>(a: f64, b: f64, c: f64) -> f64 {
    <f64 as Number<S>>::mul_add(a, b, c)
}

#[inline(always)]
fn scaled(v: V3<f64>, s: f64) -> V3<f64> {
    [v[0] * s, v[1] * s, v[2] * s]
}
