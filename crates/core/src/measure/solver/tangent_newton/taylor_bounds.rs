//! What proves a distance at trial points: the tangent planes of both bodies there, or a step away
//! from there by Taylor's formula.

use super::plane::Plane;
use super::simd_body::Side;
use crate::body::Body;
use crate::measure::frames::pose::RELATIVE_QUATERNION_ERROR;
use crate::measure::frames::vector::{M3, V3, add_scaled, apply_symmetric, apply_transposed, dot, scaled, subtract};
use crate::polynomial::{NEAR_LEVEL, Number, NumberJet, Simd, gamma};

/// A plane that a Taylor polynomial gives, and by how much it may be off but for rounding.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Extrapolated<N> {
    pub(in crate::measure) plane: Plane<N>,
    /// The gradient by z.
    normalized_gradient: V3<N>,
    value_error: N,
    pub(in crate::measure) gradient_error: N,
    /// Curvature μ, by z: the constraint rises from its tangent plane by at least `¼ μ |δ|²` within
    /// `radius`.
    curvature: N,
    /// Where that holds, by z; farther away the rise is at least in proportion to the distance.
    radius: N,
}

impl<N: Copy> Side<'_, N> {
    /// The plane a step from where the jet is of, by Taylor's formula. With T the ceiling of third
    /// derivatives it is off by at most `T |δ|³ / 6` in value and `T |δ|² / 2` in gradient, δ the
    /// step in normalized coordinates; that holds from a point near the level for steps no longer
    /// than the leeway, else the errors are NaN. The step is in the basis that `local` is of.
    #[inline(always)]
    pub(in crate::measure) fn extrapolate<S: Simd>(
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
        // Second derivatives decrease by at most T per length. Within 3 μ / (2 T) a rise of ½ μ
        // |δ|² keeps half of it, and being convex it only steepens after that.
        let ceiling = N::splat(simd, self.trust().third.ceiling);
        let length = square.sqrt();
        let error = N::splat(simd, self.trust().curvature_error);
        let curvature = smallest_eigenvalue(simd, &jet.hessian) - error - ceiling * length;
        let radius = (N::splat(simd, self.trust().third.kept) * curvature).min(N::splat(simd, 0.5 * leeway));
        Extrapolated {
            plane,
            normalized_gradient: gradient,
            curvature,
            radius,
            value_error: third * length * N::splat(simd, 1.0 / 3.0 + 1e-9),
            gradient_error: third * N::splat(simd, self.body.trust().linear_norm),
        }
    }

    /// From a point with this plane to a point of the body nearby, against the gradient, in the
    /// basis of the plane, as far as the active constraint goes; and whether that is proven.
    #[inline(always)]
    pub(in crate::measure) fn inward<S: Simd>(&self, simd: S, at: &Extrapolated<N>) -> (V3<N>, N::Mask)
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

    /// Bound of how much farther along the unit vector n the body reaches than the point with this
    /// plane; not a number if the plane faces another way. n is in the basis of the plane, `pulled`
    /// is `M⁻ᵀ n` as computed by the body's inverse, the one that points of the body have by z.
    ///
    /// For every point `x + δ` of the body and λ >= 0, with `r = n - λ ∇g`,
    /// `n·δ = r·δ + λ ∇g·δ <= r·δ + λ (1 - g(x)) - λ (rise over the tangent plane)`. What is off in
    /// direction is bounded both in metres and by z, where `r·δ = (M⁻ᵀ n - λ ∇g)·(M δ)` with the
    /// gradient by z: across a thin body an error of the gradient counts for its thickness only.
    #[inline(always)]
    pub(in crate::measure) fn support_deficit<S: Simd>(
        &self,
        simd: S,
        at: &Extrapolated<N>,
        n: V3<N>,
        pulled: V3<N>,
    ) -> N
    where
        N: Number<S>,
    {
        let splat = |value: f64| N::splat(simd, value);
        let gradient = at.plane.gradient;
        let along = dot(n, gradient);
        let multiplier = splat(1.0) / along;
        let residual = add_scaled(n, -multiplier, gradient);
        let (near, trust) = (Near::new(self), self.body.trust());
        let length = dot(gradient, gradient).sqrt();
        let gradient_error = at.gradient_error + splat(near.gradient_error);
        let turned = splat(near.turn).mul_add(length, gradient_error);
        let off = Off::new(simd, dot(residual, residual), turned.mul_add(multiplier, splat(TAYLOR_ROUNDING)));
        // Gradients by z are off by as much as those in metres are per bound of M.
        let residual = add_scaled(pulled, -multiplier, at.normalized_gradient);
        let pulled_error = trust.inverse_error + trust.inverse_norm * (RELATIVE_QUATERNION_ERROR + TAYLOR_ROUNDING);
        let error = (gradient_error * splat((1.0 + TAYLOR_ROUNDING) / trust.linear_norm))
            .mul_add(multiplier, splat(pulled_error));
        let normalized = Off::new(simd, dot(residual, residual), error);
        let bound = Bound {
            curvature: at.curvature,
            radius: at.radius,
            inverse_square: splat(near.inverse_square),
            floor: splat(near.floor),
            span: splat(near.span),
        };
        let error = at.value_error + splat(self.trust().value_error);
        let slack = multiplier * (splat(1.0) - at.plane.value + error);
        let loss = bound.loss(simd, &off, multiplier);
        let loss = loss.min(bound.normalized_loss(simd, &normalized, multiplier, trust.normalized_span));
        (slack + loss).select(splat(f64::MIN_POSITIVE).le(along), splat(f64::NAN))
    }
}

/// Lower bound of the smallest eigenvalue of a positive definite matrix: the determinant over the
/// square of half the trace bounds it, as the product of two numbers is at most the square of their
/// mean. Not above 0 for any other matrix.
#[inline(always)]
fn smallest_eigenvalue<S: Simd, N: Number<S>>(simd: S, [xx, xy, xz, yy, yz, zz]: &[N; 6]) -> N {
    let half_trace = (*xx + *yy + *zz) * N::splat(simd, 0.5);
    let first = *yy * *zz - *yz * *yz;
    let determinant = *xx * first - *xy * (*xy * *zz - *yz * *xz) + *xz * (*xy * *yz - *yy * *xz);
    // Some 20 roundings of terms of at most the cube of the trace.
    (determinant / (half_trace * half_trace)) - half_trace * N::splat(simd, 256.0 * f64::EPSILON)
}

/// A proven bracket of the distance with the points that attain the upper bound, in the basis from
/// the trial points on.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Bracket<N> {
    pub(in crate::measure) lower: N,
    pub(in crate::measure) upper: N,
    /// What rounding alone leaves between them, about.
    pub(in crate::measure) rounding: N,
    /// Bound of the angle between the outward normal of one body and the inward normal of the
    /// other, but for terms of third order.
    pub(in crate::measure) off: N,
    /// Of A's and of B's constraint, metres.
    pub(in crate::measure) multipliers: [N; 2],
    /// Unit normal of the lower bound, in the basis.
    pub(in crate::measure) normal: V3<N>,
    /// From x to a point of A, in the basis.
    pub(in crate::measure) to_a: V3<N>,
    /// From y to a point of B, in the basis.
    pub(in crate::measure) to_b: V3<N>,
}

/// Rounding of a Taylor bracket's own arithmetic, basis included, relative to the sum of
/// magnitudes; dimensionless. Fewer than 256 operations of half an epsilon each.
///
/// A smaller value could make a bracket miss the distance; a larger one keeps brackets of far poses
/// wider than asked for. Pinned from below by `slacks_cover_the_roundings_they_are_counted_for`,
/// from above by `bodies_on_lines_are_bracketed_to_the_last_bits`; the exact re-checks
/// (`tests/stability/recheck.rs`) meet a small part of the bound only.
pub(in crate::measure) const TAYLOR_ROUNDING: f64 = 128.0 * f64::EPSILON;

/// Largest angle between the bodies' normals, radians, that an answer is taken at: its gradients
/// are off by about as much, and 1e-6 is promised.
///
/// Larger, gradients are off by more; smaller, more answers are refined. Pinned by
/// `family_20_distance_gradients` of the stability tests.
pub(in crate::measure) const ALIGNED: f64 = 2.5e-7;

/// The same between bodies of which one has edges: these may be flatter than smooth ones, and near
/// contact an angle stands for a longer way along the sides.
///
/// Larger, gradients near contact are off by more than 1e-6; smaller, more steps are made and more
/// answers refined. Pinned by `family_08_primitives_at_contact`, seed 934.
pub(in crate::measure) const ALIGNED_AT_EDGES: f64 = 1e-7;

/// Largest angle between the normals of the bodies of an answer, or of one and a shape, radians,
/// that it is taken at.
pub(in crate::measure) fn aligned_angle(bodies: &[&Body]) -> f64 {
    if bodies.iter().all(|body| body.is_smooth()) { ALIGNED } else { ALIGNED_AT_EDGES }
}

/// How much farther a point is moved than its constraint's linearization requires, dimensionless,
/// for the rounding of its gradient.
///
/// Smaller, gradients have to be known better than doubles do near flat spots, and no witness is
/// proven; larger, upper bounds are wider by as much of the move. Exercised by
/// `continuation_follows_alone`.
pub(in crate::measure) const NUDGE: f64 = 1e-4;

/// The bracket from the constraints at x and y with `difference = x - y` in the basis. NaN where it
/// proves nothing; it holds only if both points, and those extrapolated from, lie in their balls.
///
/// Lower bound. For a unit vector n and any multipliers, convexity with the curvature floor c of
/// `g(z)` gives for every point of a body `r·(x' - x) >= -λ (1 - g(x)) - |M⁻ᵀ(r + λ∇g)|² / (2 λ
/// c)`: what the tangent plane loses to a normal that is off by ε is of the order ε². n is the
/// normal of the body with the lower floor, which then loses only its rounding.
///
/// Upper bound. Along its gradient g of length G a constraint rises from its value by `t G` and at
/// most `½ κ t²` more, so a move by `t = (e + |e| (2q + NUDGE)) / G` against the gradient, `e =
/// g(x) + error - 1`, `q = κ |e| / G² <= 0.1`, leads to a point of the body (or, from within, no
/// farther than to the boundary).
#[inline(always)]
pub(in crate::measure) fn bracket<S: Simd, N: Number<S>>(
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
    let rounding = splat(TAYLOR_ROUNDING) * (difference[0].abs() + difference[1].abs() + difference[2].abs());

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
    let off = Off::new(simd, dot(residual, residual), turned.mul_add(multiplier, splat(TAYLOR_ROUNDING)));
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
        .mul_add(keeper, either_constant(near_a.turn + TAYLOR_ROUNDING, near_b.turn + TAYLOR_ROUNDING));
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
    let lower =
        dot(normal, difference) - (slack_a + slack_b) - (displaced + rounding) - splat(TAYLOR_ROUNDING) * magnitude;
    let lower = (loss + keeper_loss).mul_add(splat(-(1.0 + TAYLOR_ROUNDING)), lower);
    // Gradients that do not even point the same way leave no multiplier.
    let lower = lower.select(splat(f64::MIN_POSITIVE).le(along), splat(f64::NAN));

    let (move_a, fine_a) = near_a.move_inside(simd, a.value - one + error_a, length_a, inverse_a, gradient_error_a);
    let (move_b, fine_b) = near_b.move_inside(simd, b.value - one + error_b, length_b, inverse_b, gradient_error_b);
    let (to_a, to_b) = (scaled(outward_a, move_a), scaled(outward_b, move_b));
    let between = subtract(add_scaled(difference, one, to_a), to_b);
    let upper = dot(between, between).sqrt() * splat(1.0 + TAYLOR_ROUNDING) + displaced + rounding;
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
    /// Bound of the relative error of a gradient by the rounding of the body's map and of the
    /// basis.
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
            turn: RELATIVE_QUATERNION_ERROR + gamma(64) * body.condition,
            span: body.span,
            leeway: body.leeway,
            inverse_square: body.inverse_norm * body.inverse_norm,
        }
    }

    /// How far along the outward gradient to move so that an excess of the value over 1 is undone,
    /// and whether that is proven.
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

    /// By the square of a residual r and the error e of that: `(r + e)² <= (1 + ε) r² + (1 + 1/ε)
    /// e²`, which need not wait for the root.
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
    /// Bound of what a plane off by `off` in direction loses: the largest of `r·δ - λ (rise over
    /// the tangent plane)`, `|r| = off`, by the curvature at the point, by the one anywhere, and by
    /// the length of δ.
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
        // The stiffer of the two bounds, of the curvature here by z and of twice the one anywhere
        // by metres.
        let anywhere = splat(2.0) * self.floor * self.inverse_square;
        let stiffness = (self.curvature.max(anywhere) * multiplier).select(fine, anywhere * multiplier);
        (square / stiffness).min(off.angle * self.span)
    }

    /// The same by z: off is that of `M⁻ᵀ n - λ ∇g`, with the curvature at the point and the length
    /// of δ by z.
    #[inline(always)]
    fn normalized_loss<S: Simd>(&self, simd: S, off: &Off<N>, multiplier: N, span: f64) -> N
    where
        N: Number<S>,
    {
        let splat = |value: f64| N::splat(simd, value);
        let slope = splat(0.25) * multiplier * self.curvature * self.radius;
        let fine = N::and(simd, off.square.le(slope * slope), splat(0.0).le(self.curvature));
        let far = off.angle * splat(span);
        (off.square / (self.curvature * multiplier)).min(far).select(fine, far)
    }
}
