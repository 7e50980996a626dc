//! Newton's method for the distance of two bodies with one active constraint each, in the tangent
//! plane of their normal, and the bracket that comes with it.
//!
//! With the unit vector n from B to A, tangents T (3x2) across it, gradients `g`, Hessians `H` and
//! multipliers `λ_A = -1/(n·g_A)`, `λ_B = 1/(n·g_B)`, the optimality conditions `n + λ_A g_A = 0`,
//! `-n + λ_B g_B = 0`, `x - y = D n`, `g_A(x) = g_B(y) = 1` linearize, for steps `dx = T α + n a`,
//! `dy = T β + n b`, `dn = T θ` and up to terms of second order, to
//!
//! ```text
//! θ + W_A α = r_A,    W_A = λ_A TᵀH_A T,   r_A = -λ_A Tᵀ(g_A + a H_A n),   a = (g_A(x) - 1) λ_A
//! W_B β - θ = r_B,    W_B = λ_B TᵀH_B T,   r_B = -λ_B Tᵀ(g_B + b H_B n),   b = (1 - g_B(y)) λ_B
//! τ + α - β = D θ,    τ = Tᵀ(x - y),       D = n·(x - y) + a - b
//! ```
//!
//! `W` are the curvatures of the surfaces. Eliminating θ and α leaves two systems of order two,
//!
//! ```text
//! K = (I + D W_A)⁻¹,   (W_B + W_A K) β = r_A + r_B + W_A K (τ - D r_A),   α = K (β - τ + D r_A)
//! ```
//!
//! which are regular through contact, D = 0 included, wherever one of the bodies is curved.
//!
//! Points are given in A's frame from the centre of A's normalization on, metres ("query frame" in
//! these files); `T` and `n` are the rows of the basis.

mod limits;
mod plane;
mod simd_body;
mod taylor_bounds;

use crate::measure::frames::vector::{M3, V3, apply_symmetric, apply_transposed, dot, scaled};
use crate::polynomial::{Number, NumberJet, Simd};
pub(in crate::measure) use limits::{
    AT_REST_SQUARED, FEATURES, FLATTEST, LONGEST_MOVE, LONGEST_STEP, NEAR, PATIENCE, RETREATS, SEEK_ROUNDS, SETTLED,
    WORTH_A_BRACKET,
};
pub(in crate::measure) use plane::Plane;
pub(in crate::measure) use simd_body::{Relative, Side};
pub(in crate::measure) use taylor_bounds::{
    ALIGNED, ALIGNED_AT_EDGES, Bracket, Extrapolated, NUDGE, TAYLOR_ROUNDING, aligned_angle, bracket,
};

/// Second derivatives of a constraint at a point.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct SurfaceCurvature<N> {
    /// `TᵀHT`: 00, 01, 11.
    pub(in crate::measure) curvature: [N; 3],
    /// `TᵀHn`.
    pub(in crate::measure) tilt: [N; 2],
}

impl<N: Copy> SurfaceCurvature<N> {
    /// The constraint with this jet, along the vectors of a basis in its normalized coordinates.
    #[inline(always)]
    pub(in crate::measure) fn new<S: Simd>(_: S, jet: &NumberJet<N>, [t0, t1, n]: &M3<N>) -> Self
    where
        N: Number<S>,
    {
        let (h0, h1) = (apply_symmetric(&jet.hessian, *t0), apply_symmetric(&jet.hessian, *t1));
        Self { curvature: [dot(h0, *t0), dot(h0, *t1), dot(h1, *t1)], tilt: [dot(h0, *n), dot(h1, *n)] }
    }
}

/// A symmetric 2x2 matrix: entries 00, 01, 11.
pub(in crate::measure) type Symmetric2<N> = [N; 3];

#[inline(always)]
fn apply2<S: Simd, N: Number<S>>(m: &Symmetric2<N>, v: [N; 2]) -> [N; 2] {
    [m[1].mul_add(v[1], m[0] * v[0]), m[2].mul_add(v[1], m[1] * v[0])]
}

/// One Newton step.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Step<N> {
    /// Change of x in the basis.
    pub(in crate::measure) dx: V3<N>,
    /// Change of y in the basis.
    pub(in crate::measure) dy: V3<N>,
    /// Change of n along the tangents.
    pub(in crate::measure) dn: [N; 2],
}

impl Step<f64> {
    /// The mean of both points' moves along the tangents.
    #[inline(always)]
    pub(in crate::measure) fn along(&self) -> [f64; 2] {
        [0.5 * (self.dx[0] + self.dy[0]), 0.5 * (self.dx[1] + self.dy[1])]
    }

    /// Takes only this much of the step.
    #[inline(always)]
    pub(in crate::measure) fn shorten(&mut self, factor: f64) {
        for entry in self.dx.iter_mut().chain(&mut self.dy).chain(&mut self.dn) {
            *entry *= factor;
        }
    }

    /// Whether neither x nor y moves farther than its limit, and the step is a number.
    #[inline(always)]
    pub(in crate::measure) fn within<S: Simd>(&self, _: S, [of_x, of_y]: [f64; 2]) -> bool {
        dot::<S, f64>(self.dx, self.dx) <= of_x * of_x && dot::<S, f64>(self.dy, self.dy) <= of_y * of_y
    }
}

impl<N: Copy> Step<N> {
    /// Square of the moves of x and of y relative to their limits, the larger one.
    #[inline(always)]
    pub(in crate::measure) fn square<S: Simd>(&self, simd: S, [of_x, of_y]: [f64; 2]) -> N
    where
        N: Number<S>,
    {
        let relative = |step: V3<N>, limit: f64| dot(step, step) * N::splat(simd, 1.0 / (limit * limit));
        relative(self.dx, of_x).max(relative(self.dy, of_y))
    }

    /// The step scaled to its limits if it exceeds them, by the square of what it is relative to
    /// them.
    #[inline(always)]
    pub(in crate::measure) fn at_most<S: Simd>(self, simd: S, square: N) -> Self
    where
        N: Number<S>,
    {
        let one = N::splat(simd, 1.0);
        let factor = one / square.max(one).sqrt();
        let dn = [self.dn[0] * factor, self.dn[1] * factor];
        Self { dx: scaled(self.dx, factor), dy: scaled(self.dy, factor), dn }
    }
}

/// Newton's step from points x and y with `difference = x - y` in the basis whose third vector is
/// n.
///
/// In place of each constraint g it takes `2 (g - 1) / (g + 1) + 1`: the same set, and nearly 1 +
/// ln g, which is straighter along rays, so that the surface is found from farther away. Gradients
/// are then those of g over the square of the mean m of g and 1, Hessians `H - ∇g ∇gᵀ / m` over the
/// same.
///
/// `smallest` (per metre) is added to the curvature that is divided by: where both bodies are flat
/// it bounds the step.
#[inline(always)]
pub(in crate::measure) fn newton<S: Simd, N: Number<S>>(
    simd: S,
    (a, curvature_a): (&Plane<N>, &SurfaceCurvature<N>),
    (b, curvature_b): (&Plane<N>, &SurfaceCurvature<N>),
    difference: V3<N>,
    smallest: N,
) -> (Step<N>, Response<N>) {
    let (straight_a, straight_b) = straighten(simd, (a, curvature_a), (b, curvature_b));
    let distance = difference[2] + straight_a.shift - straight_b.shift;
    let (turn, response) = turn(simd, &straight_a, &straight_b, distance, [difference[0], difference[1]], smallest);
    let (alpha, beta) = (turn.alpha, turn.beta);
    // The tangential parts of the gradients, of second order, are at hand now.
    let along_a = (a.gradient[0] * alpha[0] + a.gradient[1] * alpha[1]) * straight_a.multiplier;
    let along_b = (b.gradient[0] * beta[0] + b.gradient[1] * beta[1]) * straight_b.multiplier;
    let step = Step {
        dx: [alpha[0], alpha[1], straight_a.shift + along_a],
        dy: [beta[0], beta[1], straight_b.shift - along_b],
        dn: turn.theta,
    };
    (step, response)
}

/// Newton's step towards points with `x - y` along a ray, a vector in the basis, and opposite
/// normals: the system above with `D = 0` once B is moved by the multiple ρ of the ray that makes
/// them touch, for which all but terms of second order are at hand before.
#[inline(always)]
pub(in crate::measure) fn newton_along<S: Simd>(
    simd: S,
    (a, curvature_a): (&Plane<f64>, &SurfaceCurvature<f64>),
    (b, curvature_b): (&Plane<f64>, &SurfaceCurvature<f64>),
    difference: V3<f64>,
    ray: V3<f64>,
    smallest: f64,
) -> (Step<f64>, Response<f64>) {
    let (straight_a, straight_b) = straighten(simd, (a, curvature_a), (b, curvature_b));
    let inverse = 1.0 / ray[2];
    let slope = [ray[0] * inverse, ray[1] * inverse];
    let height = difference[2] + straight_a.shift - straight_b.shift;
    let off = [difference[0] - height * slope[0], difference[1] - height * slope[1]];
    let (Turn { mut alpha, beta, theta }, response) = turn(simd, &straight_a, &straight_b, 0.0, off, smallest);
    // How far the surfaces lie below their tangent planes, of second order, changes where on the
    // ray they meet.
    let fallen = |plane: &Plane<f64>, straight: &Straight<f64>, along: [f64; 2]| {
        let bent = apply2::<S, f64>(&straight.curvature, along);
        let sloped = (plane.gradient[0] * along[0] + plane.gradient[1] * along[1]) * straight.multiplier;
        sloped + 0.5 * (bent[0] * along[0] + bent[1] * along[1])
    };
    let fallen_a = fallen(a, &straight_a, alpha);
    let fallen_b = fallen(b, &straight_b, beta);
    alpha[0] += (fallen_a + fallen_b) * slope[0];
    alpha[1] += (fallen_a + fallen_b) * slope[1];
    let step = Step {
        dx: [alpha[0], alpha[1], straight_a.shift + fallen_a],
        dy: [beta[0], beta[1], straight_b.shift - fallen_b],
        dn: theta,
    };
    (step, response)
}

/// Both constraints straightened, B's seen from A: with `n` in place of its inward normal.
#[inline(always)]
fn straighten<S: Simd, N: Number<S>>(
    simd: S,
    (a, curvature_a): (&Plane<N>, &SurfaceCurvature<N>),
    (b, curvature_b): (&Plane<N>, &SurfaceCurvature<N>),
) -> (Straight<N>, Straight<N>) {
    let (one, half) = (N::splat(simd, 1.0), N::splat(simd, 0.5));
    // Deep inside there is nothing to straighten.
    let deepest = N::splat(simd, 0.25);
    let (mean_a, mean_b) = (half.mul_add(a.value, half).max(deepest), half.mul_add(b.value, half).max(deepest));
    let [inverse_a, inverse_b] = N::reciprocals(simd, [a.gradient[2] * mean_a, b.gradient[2] * mean_b]);
    let (of_a, of_b) = (-mean_a * inverse_a, mean_b * inverse_b);
    let straight_a = Straight::new(a, curvature_a, of_a, (a.value - one) * mean_a, a.gradient[2] * inverse_a);
    let straight_b = Straight::new(b, curvature_b, of_b, (one - b.value) * mean_b, b.gradient[2] * inverse_b);
    (straight_a, straight_b)
}

/// The tangential part of a step.
struct Turn<N> {
    alpha: [N; 2],
    beta: [N; 2],
    theta: [N; 2],
}

/// Solves the system at the head of this file for α, β and θ, with D and τ.
#[inline(always)]
fn turn<S: Simd, N: Number<S>>(
    simd: S,
    a: &Straight<N>,
    b: &Straight<N>,
    distance: N,
    tau: [N; 2],
    smallest: N,
) -> (Turn<N>, Response<N>) {
    let one = N::splat(simd, 1.0);
    let (w_a, w_b, right_a, right_b) = (a.curvature, b.curvature, a.right, b.right);
    // I + D W_A, its determinant, and that times W_A K: the two commute.
    let m = [distance.mul_add(w_a[0], one), distance * w_a[1], distance.mul_add(w_a[2], one)];
    let determinant = m[0] * m[2] - m[1] * m[1];
    let more = distance * (w_a[0] * w_a[2] - w_a[1] * w_a[1]);
    let both = [w_a[0] + more, w_a[1], w_a[2] + more];
    let moment_arm = [tau[0] - distance * right_a[0], tau[1] - distance * right_a[1]];
    let pulled = apply2(&both, moment_arm);
    let sum = [
        determinant.mul_add(w_b[0] + smallest, both[0]),
        determinant.mul_add(w_b[1], both[1]),
        determinant.mul_add(w_b[2] + smallest, both[2]),
    ];
    let right = [
        determinant.mul_add(right_a[0] + right_b[0], pulled[0]),
        determinant.mul_add(right_a[1] + right_b[1], pulled[1]),
    ];
    let other = sum[0] * sum[2] - sum[1] * sum[1];
    let [of_m, of_sum] = N::reciprocals(simd, [determinant, other]);
    let beta = [(sum[2] * right[0] - sum[1] * right[1]) * of_sum, (sum[0] * right[1] - sum[1] * right[0]) * of_sum];
    let rest = [beta[0] - moment_arm[0], beta[1] - moment_arm[1]];
    let alpha = [(m[2] * rest[0] - m[1] * rest[1]) * of_m, (m[0] * rest[1] - m[1] * rest[0]) * of_m];
    let bent = apply2(&w_a, alpha);
    let turn = Turn { alpha, beta, theta: [right_a[0] - bent[0], right_a[1] - bent[1]] };
    let compliance = scaled([sum[2], -sum[1], sum[0]], of_sum);
    let response = Response {
        curvature_a: w_a,
        compliance: scaled(compliance, determinant),
        pull: [apply2(&both, [compliance[0], compliance[1]]), apply2(&both, [compliance[1], compliance[2]])],
        hold: scaled([m[2], -m[1], m[0]], of_m),
    };
    (turn, response)
}

/// How a solution answers a small motion of B, to first order, in the basis it was found in: the
/// system at the head of this file with all but τ and r_B at 0.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Response<N> {
    /// `W_A`.
    curvature_a: Symmetric2<N>,
    /// `G = (W_B + W_A K)⁻¹`, with what counts as no curvature added to `W_B`.
    pub(in crate::measure) compliance: Symmetric2<N>,
    /// `G W_A K`, by rows.
    pull: [[N; 2]; 2],
    /// `K`.
    hold: Symmetric2<N>,
}

impl Response<f64> {
    /// The step by how far x - y is from along the normal and how far B's outward normal has
    /// turned, both along the tangents.
    #[inline(always)]
    pub(in crate::measure) fn step<S: Simd>(&self, _: S, tau: [f64; 2], turned: [f64; 2]) -> Step<f64> {
        let pulled = apply2::<S, f64>(&self.compliance, turned);
        let along = |row: [f64; 2], less: f64| row[0] * tau[0] + row[1] * tau[1] - less;
        let beta = [along(self.pull[0], pulled[0]), along(self.pull[1], pulled[1])];
        let alpha = apply2::<S, f64>(&self.hold, [beta[0] - tau[0], beta[1] - tau[1]]);
        let theta = apply2::<S, f64>(&self.curvature_a, alpha);
        Step { dx: [alpha[0], alpha[1], 0.0], dy: [beta[0], beta[1], 0.0], dn: [-theta[0], -theta[1]] }
    }

    /// By how much the normal turns when x moves along the tangents.
    #[inline(always)]
    pub(in crate::measure) fn turned<S: Simd>(&self, _: S, along: [f64; 2]) -> [f64; 2] {
        let bent = apply2::<S, f64>(&self.curvature_a, along);
        [-bent[0], -bent[1]]
    }
}

/// What the linearization needs of a constraint that is straightened.
struct Straight<N> {
    /// Multiplier λ of the constraint itself.
    multiplier: N,
    /// Change along the normal.
    shift: N,
    /// Right side.
    right: [N; 2],
    /// Curvature of the surface.
    curvature: Symmetric2<N>,
}

impl<N: Copy> Straight<N> {
    /// With the multiplier λ of the constraint itself, `(g - 1) m` or its negative, and `1 / m`, m
    /// the mean of g and 1.
    #[inline(always)]
    fn new<S: Simd>(plane: &Plane<N>, bend: &SurfaceCurvature<N>, multiplier: N, excess: N, inverse_mean: N) -> Self
    where
        N: Number<S>,
    {
        let g = plane.gradient;
        let (s0, s1) = (inverse_mean * g[0], inverse_mean * g[1]);
        let t = bend.tilt;
        let shift = excess * multiplier;
        let tilt = [t[0] - s0 * g[2], t[1] - s1 * g[2]];
        Self {
            multiplier,
            shift,
            right: [-multiplier * shift.mul_add(tilt[0], g[0]), -multiplier * shift.mul_add(tilt[1], g[1])],
            // Without the tangential part of ∇g ∇gᵀ, which vanishes at the solution, it stays
            // positive semidefinite.
            curvature: scaled(bend.curvature, multiplier),
        }
    }
}

/// A point moved by a step in the basis.
#[inline(always)]
pub(in crate::measure) fn moved<S: Simd, N: Number<S>>(v: V3<N>, step: V3<N>, basis: &M3<N>) -> V3<N> {
    let by = apply_transposed(basis, step);
    [v[0] + by[0], v[1] + by[1], v[2] + by[2]]
}
