//! Newton's method for the distance of two bodies with one active constraint each, in the tangent plane of their normal,
//! and the bracket that comes with it.
//!
//! With the unit vector n from B to A, tangents T (3x2) across it, gradients `g`, Hessians `H` and multipliers
//! `λ_A = -1/(n·g_A)`, `λ_B = 1/(n·g_B)`, the optimality conditions `n + λ_A g_A = 0`, `-n + λ_B g_B = 0`, `x - y = D n`,
//! `g_A(x) = g_B(y) = 1` linearize, for steps `dx = T α + n a`, `dy = T β + n b`, `dn = T θ` and up to terms of second order,
//! to
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
//! Points are given in A's frame from the centre of A's normalization on, metres ("query frame" in this file); `T` and `n`
//! are the rows of the basis.

use super::pose::{Pose, ROTATION_ERROR};
use super::vector::{
    M3, V3, add_scaled, apply, apply_symmetric, apply_transposed, dot, rows, scaled, subtract, times_transposed,
};
use crate::body::{Body, ConstraintTrust};
use crate::polynomial::{NEAR_LEVEL, Number, NumberJet, Simd, gamma};
use nalgebra::Vector3;

/// Bound of the error of a relative rotation in operator norm: both rotations are off by at most [`ROTATION_ERROR`]; their
/// product, its matrix and sums with it round a few times more.
pub(super) const TURNED: f64 = 2.0 * ROTATION_ERROR + gamma(40);

/// Where B stands as seen from A.
#[derive(Clone, Copy, Debug)]
pub(super) struct Relative<N> {
    /// Rotation from B's frame to A's.
    pub(super) rotation: M3<N>,
    /// Centre of B's normalization in the query frame.
    pub(super) origin: V3<N>,
    /// `M` of B: `z = M (y - origin)`.
    pub(super) linear: M3<N>,
    /// Bound of the displacement of a computed z of B within its ball, metres.
    pub(super) displacement: N,
}

impl Relative<f64> {
    /// B at `pose_b` as seen from A at `pose_a`.
    #[inline(always)]
    pub(super) fn new<S: Simd>(simd: S, a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose) -> Self {
        // Differences of translations are exact to one rounding, however far from the world origin.
        let conjugate = pose_a.rotation().conjugate();
        let moved = conjugate * (pose_b.translation() - pose_a.translation());
        let rotation = (conjugate * pose_b.rotation()).to_rotation_matrix();
        Self::from_parts(simd, a, rows(simd, rotation.matrix()), [moved.x, moved.y, moved.z], b)
    }
}

impl<N: Copy> Relative<N> {
    /// B turned by `rotation` and then moved by `translation`, as seen from A.
    #[inline(always)]
    pub(super) fn from_parts<S: Simd>(simd: S, a: &Body, rotation: M3<N>, translation: V3<N>, b: &Body) -> Self
    where
        N: Number<S>,
    {
        let splat = |v: &Vector3<f64>| [N::splat(simd, v.x), N::splat(simd, v.y), N::splat(simd, v.z)];
        let (center_a, center_b) = (a.normalization().center, b.normalization().center);
        let turned = apply(&rotation, splat(&center_b));
        let from = splat(&center_a);
        let mut origin = from;
        for i in 0..3 {
            origin[i] = turned[i] + (translation[i] - from[i]);
        }
        let linear = rows(simd, &b.normalization().linear);
        let trust = b.trust();
        let fixed = (TURNED + trust.rounding) * trust.reach + TURNED * trust.center + gamma(8) * a.trust().center;
        let far = translation[0].abs() + translation[1].abs() + translation[2].abs();
        Self {
            rotation,
            origin,
            linear: times_transposed(&linear, &rotation),
            displacement: N::splat(simd, TURNED + gamma(8)).mul_add(far, N::splat(simd, fixed * (1.0 + 1e-13))),
        }
    }
}

/// A body in the query frame: its map to normalized coordinates and what is known near it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Side<'a, N> {
    body: &'a Body,
    /// Which of the constraints is active.
    pub(super) active: usize,
    linear: M3<N>,
    origin: V3<N>,
    displacement: N,
}

impl<'a, N: Copy> Side<'a, N> {
    /// The body whose frame the query frame is.
    #[inline(always)]
    pub(super) fn at_home<S: Simd>(simd: S, body: &'a Body, active: usize) -> Self
    where
        N: Number<S>,
    {
        let zero = N::splat(simd, 0.0);
        Self {
            body,
            active,
            linear: rows(simd, &body.normalization().linear),
            origin: [zero; 3],
            displacement: N::splat(simd, body.trust().rounding * body.trust().reach),
        }
    }

    /// The other body.
    #[inline(always)]
    pub(super) fn away(body: &'a Body, active: usize, relative: &Relative<N>) -> Self {
        let Relative { linear, origin, displacement, .. } = *relative;
        Self { body, active, linear, origin, displacement }
    }

    #[inline(always)]
    pub(super) fn body(&self) -> &'a Body {
        self.body
    }

    #[inline(always)]
    fn trust(&self) -> &'a ConstraintTrust {
        &self.body.trust().constraints[self.active]
    }

    /// The active constraint at a point in its normalized coordinates, and whether the point lies in the ball of the body's
    /// [`crate::body::Trust`].
    #[inline(always)]
    pub(super) fn jet<S: Simd>(&self, simd: S, v: V3<N>) -> (NumberJet<N>, N::Mask)
    where
        N: Number<S>,
    {
        let z = apply(&self.linear, subtract(v, self.origin));
        let radius = self.body.trust().radius;
        let inside = dot(z, z).le(N::splat(simd, radius * radius));
        (self.body.constraints()[self.active].polynomial.jet(simd, z), inside)
    }

    /// The plane a step from where the jet is of, by Taylor's formula. With T the ceiling of third derivatives it is off by at
    /// most `T |δ|³ / 6` in value and `T |δ|² / 2` in gradient, δ the step in normalized coordinates; that holds from a point
    /// near the level for steps no longer than the leeway, else the errors are NaN. The step is in the basis that `local` is of.
    #[inline(always)]
    pub(super) fn extrapolate<S: Simd>(
        &self,
        simd: S,
        jet: &NumberJet<N>,
        local: &M3<N>,
        step: V3<N>,
    ) -> Extrapolated<N>
    where
        N: Number<S>,
    {
        let half = N::splat(simd, 0.5);
        let delta = apply_transposed(local, step);
        let bent = apply_symmetric(&jet.hessian, delta);
        let gradient = [jet.gradient[0] + bent[0], jet.gradient[1] + bent[1], jet.gradient[2] + bent[2]];
        let value = jet.value + dot(delta, add_scaled(jet.gradient, half, bent));
        let square = dot(delta, delta);
        let third = N::splat(simd, self.trust().third.ceiling * (0.5 * (1.0 + 1e-12))) * square;
        let leeway = self.trust().third.leeway;
        let near = (jet.value - N::splat(simd, 1.0)).abs().le(N::splat(simd, NEAR_LEVEL));
        let near = N::and(simd, near, square.le(N::splat(simd, 0.25 * leeway * leeway)));
        let third = third.select(near, N::splat(simd, f64::NAN));
        let plane =
            Plane { value, gradient: [dot(gradient, local[0]), dot(gradient, local[1]), dot(gradient, local[2])] };
        // Second derivatives fall by at most T per length. Within 3 μ / (2 T) a rise of ½ μ |δ|² keeps half of it, and being
        // convex it only steepens after that.
        let ceiling = N::splat(simd, self.trust().third.ceiling);
        let length = square.sqrt();
        let error = N::splat(simd, self.trust().curvature_error);
        let curvature = smallest_eigenvalue(simd, &jet.hessian) - error - ceiling * length;
        let radius = (N::splat(simd, self.trust().third.kept) * curvature).min(N::splat(simd, 0.5 * leeway));
        Extrapolated {
            plane,
            curvature,
            radius,
            value_error: third * length * N::splat(simd, 1.0 / 3.0 + 1e-9),
            gradient_error: third * N::splat(simd, self.body.trust().linear_norm),
        }
    }

    /// The vectors of the basis, each in normalized coordinates.
    #[inline(always)]
    pub(super) fn localize<S: Simd>(&self, _: S, basis: &M3<N>) -> M3<N>
    where
        N: Number<S>,
    {
        [apply(&self.linear, basis[0]), apply(&self.linear, basis[1]), apply(&self.linear, basis[2])]
    }

    /// From a point with this plane to a point of the body nearby, against the gradient, in the basis of the plane, as far as the
    /// active constraint goes; and whether that is proven.
    #[inline(always)]
    pub(super) fn inward<S: Simd>(&self, simd: S, at: &Extrapolated<N>) -> (V3<N>, N::Mask)
    where
        N: Number<S>,
    {
        let gradient = at.plane.gradient;
        let length = dot(gradient, gradient).sqrt();
        let inverse = N::splat(simd, 1.0) / length;
        let error = at.value_error + N::splat(simd, self.trust().value_error);
        let excess = at.plane.value - N::splat(simd, 1.0) + error;
        let near = Near::new(self);
        let gradient_error = at.gradient_error + N::splat(simd, near.gradient_error);
        let (distance, fine) = near.move_inside(simd, excess, length, inverse, gradient_error);
        (scaled(gradient, inverse * distance), fine)
    }

    /// Bound of how much farther along the unit vector n the body reaches than the point with this plane; not a number if the
    /// plane faces another way. All in the basis of the plane.
    #[inline(always)]
    pub(super) fn lack<S: Simd>(&self, simd: S, at: &Extrapolated<N>, n: V3<N>) -> N
    where
        N: Number<S>,
    {
        let splat = |value: f64| N::splat(simd, value);
        let gradient = at.plane.gradient;
        let along = dot(n, gradient);
        let multiplier = splat(1.0) / along;
        let residual = add_scaled(n, -multiplier, gradient);
        let near = Near::new(self);
        let length = dot(gradient, gradient).sqrt();
        let turned = splat(near.turn).mul_add(length, at.gradient_error + splat(near.gradient_error));
        let off = Off::new(simd, dot(residual, residual), turned.mul_add(multiplier, splat(SLACK)));
        let bound = Bound {
            curvature: at.curvature,
            radius: at.radius,
            inverse_square: splat(near.inverse_square),
            floor: splat(near.floor),
            span: splat(near.span),
        };
        let error = at.value_error + splat(self.trust().value_error);
        let slack = multiplier * (splat(1.0) - at.plane.value + error);
        (slack + bound.loss(simd, &off, multiplier)).select(splat(f64::MIN_POSITIVE).le(along), splat(f64::NAN))
    }
}

impl Side<'_, f64> {
    /// The point itself if it lies in the ball of the body's [`crate::body::Trust`], else about where the line to the centre meets
    /// the surface, by the value of the active constraint at the point.
    #[inline(always)]
    pub(super) fn brought_near<S: Simd>(&self, _: S, v: V3<f64>, value: f64) -> V3<f64> {
        let from = subtract::<S, f64>(v, self.origin);
        let z = apply::<S, f64>(&self.linear, from);
        let fraction = self.body.trust().radius / dot::<S, f64>(z, z).sqrt();
        if fraction >= 1.0 {
            return v;
        }
        let degree = self.body.constraints()[self.active].polynomial.degree() as f64;
        // Well inside the ball, or rounding would leave it outside.
        let fraction = (0.97 * fraction).min(value.powf(-1.0 / degree));
        add_scaled::<S, f64>(self.origin, fraction, from)
    }

    /// Square of a step in the basis that `local` is of, in normalized coordinates, relative to the body's size there: however
    /// thin a body is, its surface bends about as much over all steps of the same relative length.
    #[inline(always)]
    pub(super) fn relative_square<S: Simd>(&self, _: S, local: &M3<f64>, step: V3<f64>) -> f64 {
        let delta = apply_transposed::<S, f64>(local, step);
        dot::<S, f64>(delta, delta) / self.body.trust().radius.powi(2)
    }

    /// Whether all constraints but the active one are proven to hold at (a point within the displacement of) v.
    #[inline(always)]
    pub(super) fn others_hold<S: Simd>(&self, simd: S, v: V3<f64>) -> bool {
        let mut hold = true;
        if self.body.constraints().len() > 1 {
            for i in (0..self.body.constraints().len()).filter(|&i| i != self.active) {
                let (jet, inside) = Self { active: i, ..*self }.jet(simd, v);
                hold &= inside && jet.value + self.body.trust().constraints[i].value_error <= 1.0;
            }
        }
        hold
    }
}

/// Value and gradient of a constraint at a point, the gradient along the two tangents and the normal.
#[derive(Clone, Copy, Debug)]
pub(super) struct Plane<N> {
    pub(super) value: N,
    pub(super) gradient: V3<N>,
}

/// A plane that a Taylor polynomial gives, and by how much it may be off but for rounding.
#[derive(Clone, Copy, Debug)]
pub(super) struct Extrapolated<N> {
    pub(super) plane: Plane<N>,
    value_error: N,
    gradient_error: N,
    /// Curvature μ, by z: the constraint rises from its tangent plane by at least `¼ μ |δ|²` within `radius`.
    curvature: N,
    /// Where that holds, by z; farther away the rise is at least in proportion to the distance.
    radius: N,
}

impl Plane<f64> {
    /// How much it falls along the normal per length along the tangents.
    #[inline(always)]
    pub(super) fn slope(&self) -> [f64; 2] {
        let inverse = 1.0 / self.gradient[2];
        [self.gradient[0] * inverse, self.gradient[1] * inverse]
    }
}

impl<N: Copy> Plane<N> {
    /// The constraint with this jet, along the vectors of a basis in its normalized coordinates.
    #[inline(always)]
    pub(super) fn new<S: Simd>(_: S, jet: &NumberJet<N>, [t0, t1, n]: &M3<N>) -> Self
    where
        N: Number<S>,
    {
        let g = jet.gradient;
        Self { value: jet.value, gradient: [dot(g, *t0), dot(g, *t1), dot(g, *n)] }
    }
}

/// Second derivatives of a constraint at a point.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bend<N> {
    /// `TᵀHT`: 00, 01, 11.
    pub(super) curvature: [N; 3],
    /// `TᵀHn`.
    pub(super) tilt: [N; 2],
}

impl<N: Copy> Bend<N> {
    /// The constraint with this jet, along the vectors of a basis in its normalized coordinates.
    #[inline(always)]
    pub(super) fn new<S: Simd>(_: S, jet: &NumberJet<N>, [t0, t1, n]: &M3<N>) -> Self
    where
        N: Number<S>,
    {
        let (h0, h1) = (apply_symmetric(&jet.hessian, *t0), apply_symmetric(&jet.hessian, *t1));
        Self { curvature: [dot(h0, *t0), dot(h0, *t1), dot(h1, *t1)], tilt: [dot(h0, *n), dot(h1, *n)] }
    }
}

/// A symmetric 2x2 matrix: entries 00, 01, 11.
pub(super) type Symmetric2<N> = [N; 3];

#[inline(always)]
fn apply2<S: Simd, N: Number<S>>(m: &Symmetric2<N>, v: [N; 2]) -> [N; 2] {
    [m[1].mul_add(v[1], m[0] * v[0]), m[2].mul_add(v[1], m[1] * v[0])]
}

/// Lower bound of the smallest eigenvalue of a positive definite matrix: the determinant over the square of half the trace
/// bounds it, as the product of two numbers is at most the square of their mean. Not above 0 for any other matrix.
#[inline(always)]
fn smallest_eigenvalue<S: Simd, N: Number<S>>(simd: S, [xx, xy, xz, yy, yz, zz]: &[N; 6]) -> N {
    let half_trace = (*xx + *yy + *zz) * N::splat(simd, 0.5);
    let first = *yy * *zz - *yz * *yz;
    let determinant = *xx * first - *xy * (*xy * *zz - *yz * *xz) + *xz * (*xy * *yz - *yy * *xz);
    // Some 20 roundings of terms of at most the cube of the trace.
    (determinant / (half_trace * half_trace)) - half_trace * N::splat(simd, 256.0 * f64::EPSILON)
}

/// One Newton step.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step<N> {
    /// Change of x in the basis.
    pub(super) dx: V3<N>,
    /// Change of y in the basis.
    pub(super) dy: V3<N>,
    /// Change of n along the tangents.
    pub(super) dn: [N; 2],
}

impl Step<f64> {
    /// The mean of both points' moves along the tangents.
    #[inline(always)]
    pub(super) fn along(&self) -> [f64; 2] {
        [0.5 * (self.dx[0] + self.dy[0]), 0.5 * (self.dx[1] + self.dy[1])]
    }

    /// Takes only this much of the step.
    #[inline(always)]
    pub(super) fn shorten(&mut self, factor: f64) {
        for entry in self.dx.iter_mut().chain(&mut self.dy).chain(&mut self.dn) {
            *entry *= factor;
        }
    }

    /// Whether neither x nor y moves farther than its limit, and the step is a number.
    #[inline(always)]
    pub(super) fn within<S: Simd>(&self, _: S, [of_x, of_y]: [f64; 2]) -> bool {
        dot::<S, f64>(self.dx, self.dx) <= of_x * of_x && dot::<S, f64>(self.dy, self.dy) <= of_y * of_y
    }
}

impl<N: Copy> Step<N> {
    /// Square of the moves of x and of y relative to their limits, the larger one.
    #[inline(always)]
    pub(super) fn square<S: Simd>(&self, simd: S, [of_x, of_y]: [f64; 2]) -> N
    where
        N: Number<S>,
    {
        let relative = |step: V3<N>, limit: f64| dot(step, step) * N::splat(simd, 1.0 / (limit * limit));
        relative(self.dx, of_x).max(relative(self.dy, of_y))
    }

    /// The step scaled to its limits if it exceeds them, by the square of what it is relative to them.
    #[inline(always)]
    pub(super) fn at_most<S: Simd>(self, simd: S, square: N) -> Self
    where
        N: Number<S>,
    {
        let one = N::splat(simd, 1.0);
        let factor = one / square.max(one).sqrt();
        let dn = [self.dn[0] * factor, self.dn[1] * factor];
        Self { dx: scaled(self.dx, factor), dy: scaled(self.dy, factor), dn }
    }
}

/// Newton's step from points x and y with `difference = x - y` in the basis whose third vector is n.
///
/// In place of each constraint g it takes `2 (g - 1) / (g + 1) + 1`: the same set, and nearly 1 + ln g, which is straighter along
/// rays, so that the surface is found from farther away. Gradients are then those of g over the square of the mean m of g and
/// 1, Hessians `H - ∇g ∇gᵀ / m` over the same.
///
/// `smallest` (per metre) is added to the curvature that is divided by: where both bodies are flat it bounds the step.
#[inline(always)]
pub(super) fn newton<S: Simd, N: Number<S>>(
    simd: S,
    (a, bend_a): (&Plane<N>, &Bend<N>),
    (b, bend_b): (&Plane<N>, &Bend<N>),
    difference: V3<N>,
    smallest: N,
) -> (Step<N>, Response<N>) {
    let (straight_a, straight_b) = straighten(simd, (a, bend_a), (b, bend_b));
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

/// Newton's step towards points with `x - y` along a ray, a vector in the basis, and opposite normals: the system above with
/// `D = 0` once B is moved by the multiple ρ of the ray that makes them touch, for which all but terms of second order are at
/// hand before.
#[inline(always)]
pub(super) fn newton_along<S: Simd>(
    simd: S,
    (a, bend_a): (&Plane<f64>, &Bend<f64>),
    (b, bend_b): (&Plane<f64>, &Bend<f64>),
    difference: V3<f64>,
    ray: V3<f64>,
    smallest: f64,
) -> (Step<f64>, Response<f64>) {
    let (straight_a, straight_b) = straighten(simd, (a, bend_a), (b, bend_b));
    let inverse = 1.0 / ray[2];
    let slope = [ray[0] * inverse, ray[1] * inverse];
    let height = difference[2] + straight_a.shift - straight_b.shift;
    let off = [difference[0] - height * slope[0], difference[1] - height * slope[1]];
    let (Turn { mut alpha, beta, theta }, response) = turn(simd, &straight_a, &straight_b, 0.0, off, smallest);
    // What the surfaces fall below their tangent planes, of second order, changes where on the ray they meet.
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
    (a, bend_a): (&Plane<N>, &Bend<N>),
    (b, bend_b): (&Plane<N>, &Bend<N>),
) -> (Straight<N>, Straight<N>) {
    let (one, half) = (N::splat(simd, 1.0), N::splat(simd, 0.5));
    // Deep inside there is nothing to straighten.
    let deepest = N::splat(simd, 0.25);
    let (mean_a, mean_b) = (half.mul_add(a.value, half).max(deepest), half.mul_add(b.value, half).max(deepest));
    let [inverse_a, inverse_b] = N::reciprocals(simd, [a.gradient[2] * mean_a, b.gradient[2] * mean_b]);
    let (of_a, of_b) = (-mean_a * inverse_a, mean_b * inverse_b);
    let straight_a = Straight::new(a, bend_a, of_a, (a.value - one) * mean_a, a.gradient[2] * inverse_a);
    let straight_b = Straight::new(b, bend_b, of_b, (one - b.value) * mean_b, b.gradient[2] * inverse_b);
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
    let lever = [tau[0] - distance * right_a[0], tau[1] - distance * right_a[1]];
    let pulled = apply2(&both, lever);
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
    let rest = [beta[0] - lever[0], beta[1] - lever[1]];
    let alpha = [(m[2] * rest[0] - m[1] * rest[1]) * of_m, (m[0] * rest[1] - m[1] * rest[0]) * of_m];
    let bent = apply2(&w_a, alpha);
    let turn = Turn { alpha, beta, theta: [right_a[0] - bent[0], right_a[1] - bent[1]] };
    let give = scaled([sum[2], -sum[1], sum[0]], of_sum);
    let response = Response {
        curvature_a: w_a,
        give: scaled(give, determinant),
        pull: [apply2(&both, [give[0], give[1]]), apply2(&both, [give[1], give[2]])],
        hold: scaled([m[2], -m[1], m[0]], of_m),
    };
    (turn, response)
}

/// How a solution answers a small motion of B, to first order, in the basis it was found in: the system at the head of this
/// file with all but τ and r_B at 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Response<N> {
    /// `W_A`.
    curvature_a: Symmetric2<N>,
    /// `G = (W_B + W_A K)⁻¹`, with what counts as no curvature added to `W_B`.
    pub(super) give: Symmetric2<N>,
    /// `G W_A K`, by rows.
    pull: [[N; 2]; 2],
    /// `K`.
    hold: Symmetric2<N>,
}

impl Response<f64> {
    /// The step by how far x - y is from along the normal and how far B's outward normal has turned, both along the tangents.
    #[inline(always)]
    pub(super) fn step<S: Simd>(&self, _: S, tau: [f64; 2], turned: [f64; 2]) -> Step<f64> {
        let pulled = apply2::<S, f64>(&self.give, turned);
        let along = |row: [f64; 2], less: f64| row[0] * tau[0] + row[1] * tau[1] - less;
        let beta = [along(self.pull[0], pulled[0]), along(self.pull[1], pulled[1])];
        let alpha = apply2::<S, f64>(&self.hold, [beta[0] - tau[0], beta[1] - tau[1]]);
        let theta = apply2::<S, f64>(&self.curvature_a, alpha);
        Step { dx: [alpha[0], alpha[1], 0.0], dy: [beta[0], beta[1], 0.0], dn: [-theta[0], -theta[1]] }
    }

    /// By how much the normal turns when x moves along the tangents.
    #[inline(always)]
    pub(super) fn turned<S: Simd>(&self, _: S, along: [f64; 2]) -> [f64; 2] {
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
    /// With the multiplier λ of the constraint itself, `(g - 1) m` or its negative, and `1 / m`, m the mean of g and 1.
    #[inline(always)]
    fn new<S: Simd>(plane: &Plane<N>, bend: &Bend<N>, multiplier: N, excess: N, inverse_mean: N) -> Self
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
            // Without the tangential part of ∇g ∇gᵀ, which vanishes at the solution, it stays positive semidefinite.
            curvature: scaled(bend.curvature, multiplier),
        }
    }
}

/// A proven bracket of the distance with the points that attain the upper bound, in the basis from the trial points on.
#[derive(Clone, Copy, Debug)]
pub(super) struct Bracket<N> {
    pub(super) lower: N,
    pub(super) upper: N,
    /// What rounding alone leaves between them, about.
    pub(super) rounding: N,
    /// Bound of the angle between the outward normal of one body and the inward normal of the other, but for terms of third order.
    pub(super) off: N,
    /// Of A's and of B's constraint, metres.
    pub(super) multipliers: [N; 2],
    /// Unit normal of the lower bound, in the basis.
    pub(super) normal: V3<N>,
    /// From x to a point of A, in the basis.
    pub(super) to_a: V3<N>,
    /// From y to a point of B, in the basis.
    pub(super) to_b: V3<N>,
}

/// Relative slack for the rounding of the bracket's own arithmetic, basis included: fewer than 256 operations on the sum
/// of magnitudes.
pub(super) const SLACK: f64 = 128.0 * f64::EPSILON;

/// Largest angle between the bodies' normals that an answer is taken at: its gradients are off by about as much.
pub(super) const ALIGNED: f64 = 2.5e-7;

/// How much farther a point is moved than its constraint's linearization asks, for the rounding of its gradient.
pub(super) const NUDGE: f64 = 1e-4;

/// The bracket from the constraints at x and y with `difference = x - y` in the basis. NaN where it proves nothing; it
/// holds only if both points, and those extrapolated from, lie in their balls.
///
/// Lower bound. For a unit vector n and any multipliers, convexity with the curvature floor c of `g(z)` gives for every
/// point of a body `r·(x' - x) >= -λ (1 - g(x)) - |M⁻ᵀ(r + λ∇g)|² / (2 λ c)`: what the tangent plane loses to a normal that
/// is off by ε is of the order ε². n is the normal of the body with the lower floor, which then loses only its rounding.
///
/// Upper bound. Along its gradient g of length G a constraint rises from its value by `t G` and at most `½ κ t²` more, so a
/// move by `t = (e + |e| (2q + NUDGE)) / G` against the gradient, `e = g(x) + error - 1`, `q = κ |e| / G² <= 0.1`, leads to a
/// point of the body (or, from within, no farther than to the boundary).
#[inline(always)]
pub(super) fn bracket<S: Simd, N: Number<S>>(
    simd: S,
    (side_a, extrapolated_a): (&Side<'_, N>, &Extrapolated<N>),
    (side_b, extrapolated_b): (&Side<'_, N>, &Extrapolated<N>),
    difference: V3<N>,
) -> Bracket<N> {
    let splat = |value: f64| N::splat(simd, value);
    let one = splat(1.0);
    let (a, b) = (&extrapolated_a.plane, &extrapolated_b.plane);
    let (near_a, near_b) = (Near::new(side_a), Near::new(side_b));
    let (length_a, length_b) = (dot(a.gradient, a.gradient).sqrt(), dot(b.gradient, b.gradient).sqrt());
    let [inverse_a, inverse_b] = N::reciprocals(simd, [length_a, length_b]);
    let (outward_a, outward_b) = (scaled(a.gradient, inverse_a), scaled(b.gradient, inverse_b));
    let displaced = (side_a.displacement + side_b.displacement) * splat(1.0 + 1e-14);
    let rounding = splat(SLACK) * (difference[0].abs() + difference[1].abs() + difference[2].abs());

    // The flatter body keeps its own normal; the other one's gradient leaves a residual across it.
    let a_keeps = (extrapolated_a.curvature * splat(near_b.inverse_square) * inverse_a)
        .le(extrapolated_b.curvature * splat(near_a.inverse_square) * inverse_b);
    let either = |of_a: N, of_b: N| of_a.select(a_keeps, of_b);
    let either_constant = |of_a: f64, of_b: f64| splat(of_a).select(a_keeps, splat(of_b));
    let mut normal = [one; 3];
    let mut other = [one; 3];
    for i in 0..3 {
        normal[i] = either(-outward_a[i], outward_b[i]);
        other[i] = either(b.gradient[i], -a.gradient[i]);
    }
    let along = -dot(a.gradient, b.gradient);
    // The reciprocal of `normal·other`, found beside the lengths.
    let multiplier = either(length_a, length_b) * (one / along);
    let residual = add_scaled(normal, -multiplier, other);
    let gradient_error_a = extrapolated_a.gradient_error + splat(near_a.gradient_error);
    let gradient_error_b = extrapolated_b.gradient_error + splat(near_b.gradient_error);
    let turned = either_constant(near_b.turn, near_a.turn)
        .mul_add(either(length_b, length_a), either(gradient_error_b, gradient_error_a));
    let (square, turned) = (dot(residual, residual), turned.mul_add(multiplier, splat(SLACK)));
    let off = Off::new(simd, square, turned);
    let bent = Bound {
        curvature: either(extrapolated_b.curvature, extrapolated_a.curvature),
        radius: either(extrapolated_b.radius, extrapolated_a.radius),
        inverse_square: either_constant(near_b.inverse_square, near_a.inverse_square),
        floor: either_constant(near_b.floor, near_a.floor),
        span: either_constant(near_b.span, near_a.span),
    };
    let loss = bent.loss(simd, &off, multiplier);
    let keeper = either(inverse_a, inverse_b);
    let keeper_off = either(gradient_error_a, gradient_error_b)
        .mul_add(keeper, either_constant(near_a.turn + SLACK, near_b.turn + SLACK));
    let kept = Bound {
        curvature: either(extrapolated_a.curvature, extrapolated_b.curvature),
        radius: either(extrapolated_a.radius, extrapolated_b.radius),
        inverse_square: either_constant(near_a.inverse_square, near_b.inverse_square),
        floor: either_constant(near_a.floor, near_b.floor),
        span: either_constant(near_a.span, near_b.span),
    };
    let keeper_loss = kept.loss(simd, &Off::by(keeper_off), keeper);

    let error_a = extrapolated_a.value_error + splat(side_a.trust().value_error);
    let error_b = extrapolated_b.value_error + splat(side_b.trust().value_error);
    let (of_a, of_b) = (either(inverse_a, multiplier), either(multiplier, inverse_b));
    let slack_a = of_a * (one - a.value + error_a);
    let slack_b = of_b * (one - b.value + error_b);
    let magnitude = slack_a.abs() + slack_b.abs() + of_a + of_b;
    // The losses come last: they are what takes longest.
    let lower = dot(normal, difference) - (slack_a + slack_b) - (displaced + rounding) - splat(SLACK) * magnitude;
    let lower = (loss + keeper_loss).mul_add(splat(-(1.0 + SLACK)), lower);
    // Gradients that do not even point the same way leave no multiplier.
    let lower = lower.select(splat(f64::MIN_POSITIVE).le(along), splat(f64::NAN));

    let (move_a, fine_a) = near_a.move_inside(simd, a.value - one + error_a, length_a, inverse_a, gradient_error_a);
    let (move_b, fine_b) = near_b.move_inside(simd, b.value - one + error_b, length_b, inverse_b, gradient_error_b);
    let (to_a, to_b) = (scaled(outward_a, move_a), scaled(outward_b, move_b));
    let between = subtract(add_scaled(difference, one, to_a), to_b);
    let upper = dot(between, between).sqrt() * splat(1.0 + SLACK) + displaced + rounding;
    let upper = upper.select(N::and(simd, fine_a, fine_b), splat(f64::NAN));
    let evaluated = of_a * splat(side_a.trust().value_error) + of_b * splat(side_b.trust().value_error);
    let rounding = splat(2.0) * (displaced + rounding + evaluated);
    Bracket { lower, upper, rounding, off: off.angle, multipliers: [of_a, of_b], normal, to_a, to_b }
}

/// What is known of one body's active constraint near the body, in metres.
struct Near {
    floor: f64,
    ceiling: f64,
    gradient_error: f64,
    /// Bound of the relative error of a gradient by the rounding of the body's map and of the basis.
    turn: f64,
    span: f64,
    leeway: f64,
    /// Square of the bound of `|M⁻¹ r| / |r|`, m².
    inverse_square: f64,
}

impl Near {
    #[inline(always)]
    fn new<N: Copy>(side: &Side<'_, N>) -> Self {
        let (body, constraint) = (side.body.trust(), side.trust());
        Self {
            floor: constraint.curvature_floor,
            ceiling: constraint.curvature_ceiling,
            gradient_error: constraint.gradient_error,
            turn: TURNED + gamma(64) * body.condition,
            span: body.span,
            leeway: body.leeway,
            inverse_square: body.inverse_norm * body.inverse_norm,
        }
    }

    /// How far along the outward gradient to move so that an excess of the value over 1 is undone, and whether that is proven.
    #[inline(always)]
    fn move_inside<S: Simd, N: Number<S>>(
        &self,
        simd: S,
        excess: N,
        length: N,
        inverse: N,
        gradient_error: N,
    ) -> (N, N::Mask) {
        let splat = |value: f64| N::splat(simd, value);
        let q = splat(self.ceiling) * excess.abs() * inverse * inverse;
        let distance = (excess.abs().mul_add(q + q + splat(NUDGE), excess)) * inverse;
        let error = splat(self.turn).mul_add(length, gradient_error) * splat(4.0 / NUDGE);
        let near = N::and(simd, error.le(length), distance.abs().le(splat(self.leeway)));
        (-distance, N::and(simd, q.le(splat(0.1)), near))
    }
}

/// By how much a plane is off in direction.
struct Off<N> {
    /// Bound of the angle.
    angle: N,
    /// Bound of its square.
    square: N,
}

impl<N: Copy> Off<N> {
    /// By the angle.
    #[inline(always)]
    fn by<S: Simd>(angle: N) -> Self
    where
        N: Number<S>,
    {
        Self { angle, square: angle * angle }
    }

    /// By the square of a residual r and the error e of that: `(r + e)² <= (1 + ε) r² + (1 + 1/ε) e²`, which need not wait
    /// for the root.
    #[inline(always)]
    fn new<S: Simd>(simd: S, square: N, error: N) -> Self
    where
        N: Number<S>,
    {
        let (share, rest) = (N::splat(simd, 1.0 + 1.0 / 16.0), N::splat(simd, 1.0 + 16.0));
        Self { angle: square.sqrt() + error, square: square.mul_add(share, error * error * rest) }
    }
}

/// What bounds the rise of a constraint over its tangent plane.
struct Bound<N> {
    curvature: N,
    radius: N,
    inverse_square: N,
    floor: N,
    span: N,
}

impl<N: Copy> Bound<N> {
    /// Bound of what a plane off by `off` in direction loses: the largest of `r·δ - λ (rise over the tangent plane)`, `|r| = off`,
    /// by the curvature at the point, by the one anywhere, and by the length of δ.
    #[inline(always)]
    fn loss<S: Simd>(&self, simd: S, off: &Off<N>, multiplier: N) -> N
    where
        N: Number<S>,
    {
        let splat = |value: f64| N::splat(simd, value);
        // By z, r is at most the bound of the inverse times as long.
        let square = off.square * self.inverse_square;
        let slope = splat(0.25) * multiplier * self.curvature * self.radius;
        // Both factors may be negative where the surface is flat.
        let fine = N::and(simd, square.le(slope * slope), splat(0.0).le(self.curvature));
        // The stiffer of the two bounds, of the curvature here by z and of twice the one anywhere by metres.
        let anywhere = splat(2.0) * self.floor * self.inverse_square;
        let stiffness = (self.curvature.max(anywhere) * multiplier).select(fine, anywhere * multiplier);
        (square / stiffness).min(off.angle * self.span)
    }
}

/// A point moved by a step in the basis.
#[inline(always)]
pub(super) fn moved<S: Simd, N: Number<S>>(v: V3<N>, step: V3<N>, basis: &M3<N>) -> V3<N> {
    let by = apply_transposed(basis, step);
    [v[0] + by[0], v[1] + by[1], v[2] + by[2]]
}
