//! Two bodies as Newton's method for the level distance sees them: in B's normalized coordinates,
//! one constraint of each active. The formulas are those of [`super`].

use crate::body::{Body, ConstraintTrust};
use crate::measure::frames::pose::{Pose, RELATIVE_QUATERNION_ERROR};
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, cofactors, dot, rows, scaled, times_transposed,
};
use crate::measure::solver::active_set_qp::{CENTER, DAMPINGS, LEAST_DAMPING, MOST_BENT};
use crate::measure::solver::tangent_newton::{LONGEST_STEP, Relative};
use crate::polynomial::{Number, NumberJet, Polynomial, Simd, gamma};

/// The map from B's normalized coordinates w to A's, with its errors.
pub(super) struct Map {
    /// `K` in `x = K w + o`.
    pub(super) linear: M3<f64>,
    /// `o`.
    pub(super) origin: V3<f64>,
    /// `M_A` in `z = M_A x`.
    pub(super) to_a: M3<f64>,
    /// `M_A K`.
    pub(super) both: M3<f64>,
    /// Bound of the error of x, for w and steps within B's ball, metres.
    pub(super) displacement: f64,
    /// Relative bound of the displacement that the rounding of z amounts to.
    pub(super) rounding: f64,
    /// Bound of the error of `K` in operator norm.
    pub(super) turn: f64,
    /// Bound of `|M_A K|` in operator norm.
    pub(super) spread: f64,
}

impl Map {
    #[inline(always)]
    fn new<S: Simd>(simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> Self {
        let inverse = rows(simd, &b.inverse().transpose());
        let (to_a, origin) = (rows(simd, &a.normalization().linear), relative.origin);
        let linear = times_transposed::<S, f64>(&relative.rotation, &inverse);
        let both = product::<S>(&to_a, &linear);
        let trust = b.trust();
        let turn = (RELATIVE_QUATERNION_ERROR + gamma(16)) * trust.inverse_norm + trust.inverse_error;
        let far = origin[0].abs() + origin[1].abs() + origin[2].abs();
        let rounding = a.trust().rounding;
        let frobenius = (square::<S>(both[0]) + square::<S>(both[1]) + square::<S>(both[2])).sqrt();
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
            spread: frobenius * (1.0 + 1e-12) + a.trust().linear_norm * turn,
        }
    }

    #[inline(always)]
    pub(super) fn apply<S: Simd>(&self, _: S, w: V3<f64>) -> V3<f64> {
        add::<S, f64>(apply::<S, f64>(&self.linear, w), self.origin)
    }

    #[inline(always)]
    pub(super) fn to_a<S: Simd>(&self, _: S, x: V3<f64>) -> V3<f64> {
        apply::<S, f64>(&self.to_a, x)
    }

    /// The matrix of `of_a |C d|² + of_b |d|²`: xx, xy, xz, yy, yz, zz.
    #[inline(always)]
    pub(super) fn metric(&self, of_a: f64, of_b: f64) -> [f64; 6] {
        let [r, s, t] = self.both;
        let entry = |i: usize, j: usize| of_a * (r[i] * r[j] + s[i] * s[j] + t[i] * t[j]);
        [entry(0, 0) + of_b, entry(0, 1), entry(0, 2), entry(1, 1) + of_b, entry(1, 2), entry(2, 2) + of_b]
    }
}

/// Both bodies with their active constraints.
pub(super) struct Sides<'a> {
    pub(super) a: &'a Body,
    pub(super) b: &'a Body,
    /// Active constraint of A and of B.
    pub(super) active: [u8; 2],
    pub(super) p: &'a Polynomial,
    pub(super) g: &'a Polynomial,
    pub(super) trust: &'a ConstraintTrust,
    pub(super) map: Map,
}

/// Both constraints at one point.
pub(super) struct Evaluated {
    pub(super) x: V3<f64>,
    pub(super) z: V3<f64>,
    pub(super) jet_a: NumberJet<f64>,
    pub(super) w: V3<f64>,
    pub(super) jet_b: NumberJet<f64>,
}

/// A Newton step.
pub(super) struct Step {
    /// Change of w.
    pub(super) delta: V3<f64>,
    /// `G + μ b`.
    pub(super) dual_gradient: V3<f64>,
    /// Multiplier before the step, in H.
    pub(super) multiplier: f64,
    /// Lower bound of the smallest eigenvalue of H, but for the errors of its entries.
    pub(super) curvature: f64,
    /// The cofactors of H and its determinant.
    cofactors: [f64; 6],
    determinant: f64,
}

impl Step {
    /// How the answer moves against a gradient: `H⁻¹ - H⁻¹b bᵀH⁻¹ / (b·H⁻¹b)`, xx, xy, xz, yy, yz,
    /// zz.
    #[inline(always)]
    pub(super) fn response<S: Simd>(&self, _: S, b: V3<f64>) -> [f64; 6] {
        let v = apply_symmetric::<S, f64>(&self.cofactors, b);
        let (held, inverse) = (1.0 / dot::<S, f64>(b, v), 1.0 / self.determinant);
        let mut response = self.cofactors;
        let mut k = 0;
        for i in 0..3 {
            for j in i..3 {
                response[k] = (response[k] - held * v[i] * v[j]) * inverse;
                k += 1;
            }
        }
        response
    }
}

impl<'a> Sides<'a> {
    /// The bodies with these active constraints.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        (a, pose_a): (&'a Body, &Pose),
        (b, pose_b): (&'a Body, &Pose),
        active: [u8; 2],
    ) -> Self {
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

    /// How long a step from z is: relative to B, and to the distance from A's centre.
    #[inline(always)]
    pub(super) fn length<S: Simd>(&self, _: S, z: V3<f64>, delta: V3<f64>) -> f64 {
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
    pub(super) fn newton<S: Simd>(&self, simd: S, a: &NumberJet<f64>, b: &NumberJet<f64>) -> Step {
        let (gradient_a, multiplier) = self.balance(simd, a, b);
        let hessian = self.hessian(simd, a, b, multiplier);
        let dual_gradient = add_scaled::<S, f64>(gradient_a, multiplier, b.gradient);
        let (cofactors, determinant) = cofactors(simd, hessian);
        let u = apply_symmetric::<S, f64>(&cofactors, gradient_a);
        let v = apply_symmetric::<S, f64>(&cofactors, b.gradient);
        let excess = b.value - 1.0;
        let next = (determinant * excess - dot::<S, f64>(u, b.gradient)) / dot::<S, f64>(b.gradient, v);
        let delta = scaled::<S, f64>(add_scaled::<S, f64>(u, next, v), -1.0 / determinant);
        // The determinant over the square of half the trace, as in the tangent plane's bracket.
        let half_trace = 0.5 * (hessian[0] + hessian[3] + hessian[5]);
        let curvature = determinant / (half_trace * half_trace) - 256.0 * f64::EPSILON * half_trace;
        Step { delta, dual_gradient, multiplier, curvature, cofactors, determinant }
    }

    /// A step towards the solution from afar, where Newton's would be a long one, with the
    /// multiplier: towards the least of `p^(2/d)`, d the degree of p, which is about a square
    /// whatever d is, and damped (Levenberg and Marquardt) until it is short enough for the
    /// Hessians to mean something where it leads, but not much more.
    #[inline(always)]
    pub(super) fn far_step<S: Simd>(&self, simd: S, at: &Evaluated, multiplier: Option<f64>) -> (V3<f64>, f64) {
        let (gradient_a, fitting) = self.balance(simd, &at.jet_a, &at.jet_b);
        let hessian = self.hessian(simd, &at.jet_a, &at.jet_b, multiplier.unwrap_or(fitting));
        let (mut delta, mut next) = self.damped(simd, at, &gradient_a, &hessian, 0.0);
        let mut length = self.length(simd, at.z, delta);
        for (i, damping) in DAMPINGS.into_iter().enumerate() {
            if length <= LONGEST_STEP {
                return (delta, next);
            }
            (delta, next) = self.damped(simd, at, &gradient_a, &hessian, damping);
            length = self.length(simd, at.z, delta);
            if i == 0 && length < 0.5 * LONGEST_STEP {
                // Along flat sides a step is as long as the damping is little.
                let damping = damping * (2.0 * length / LONGEST_STEP).max(LEAST_DAMPING);
                let longer = self.damped(simd, at, &gradient_a, &hessian, damping);
                if self.length(simd, at.z, longer.0) <= LONGEST_STEP {
                    return longer;
                }
            }
        }
        (scaled::<S, f64>(delta, (LONGEST_STEP / length).min(1.0)), next)
    }

    /// The step with that much of a stiffness, and the multiplier.
    #[inline(always)]
    fn damped<S: Simd>(
        &self,
        simd: S,
        at: &Evaluated,
        gradient_a: &V3<f64>,
        hessian: &[f64; 6],
        damping: f64,
    ) -> (V3<f64>, f64) {
        let (a, b) = (&at.jet_a, &at.jet_b);
        let degree = self.p.degree() as f64;
        let stiff_a = degree * (degree - 1.0) * a.value / self.far::<S>(at.z);
        let stiff_b = square::<S>(*gradient_a).sqrt() / self.b.trust().radius;
        let mut h = self.map.metric(damping * stiff_a, damping * stiff_b);
        for (entry, of_hessian) in h.iter_mut().zip(hessian) {
            *entry += of_hessian;
        }
        let (cofactors, determinant) = cofactors(simd, h);
        let inverse = 1.0 / determinant;
        let u = scaled::<S, f64>(apply_symmetric::<S, f64>(&cofactors, *gradient_a), inverse);
        let v = scaled::<S, f64>(apply_symmetric::<S, f64>(&cofactors, b.gradient), inverse);
        // Of p^(2/d) the Hessian lacks this much of the square of the gradient; by the formula of
        // Sherman and Morrison.
        let (of_u, mixed) = (dot::<S, f64>(*gradient_a, u), dot::<S, f64>(b.gradient, u));
        let missing = ((1.0 - 2.0 / degree) / a.value).min(MOST_BENT / of_u);
        let more = 1.0 / (1.0 - missing * of_u);
        let v = add_scaled::<S, f64>(v, missing * mixed * more, u);
        let u = scaled::<S, f64>(u, more);
        let excess = b.value - 1.0;
        let next = (excess - dot::<S, f64>(u, b.gradient)) / dot::<S, f64>(b.gradient, v);
        (scaled::<S, f64>(add_scaled::<S, f64>(u, next, v), -1.0), next)
    }

    /// `G` and the multiplier that fits the gradients best.
    #[inline(always)]
    pub(super) fn balance<S: Simd>(&self, _: S, a: &NumberJet<f64>, b: &NumberJet<f64>) -> (V3<f64>, f64) {
        let gradient_a = apply_transposed::<S, f64>(&self.map.both, a.gradient);
        // Where p decreases inward B's constraint is inactive.
        let multiplier = (-dot::<S, f64>(gradient_a, b.gradient) / dot::<S, f64>(b.gradient, b.gradient)).max(0.0);
        (gradient_a, multiplier)
    }

    /// `H`: xx, xy, xz, yy, yz, zz.
    #[inline(always)]
    pub(super) fn hessian<S: Simd>(&self, _: S, a: &NumberJet<f64>, b: &NumberJet<f64>, multiplier: f64) -> [f64; 6] {
        let c = &self.map.both;
        let [xx, xy, xz, yy, yz, zz] = a.hessian;
        let bent = product::<S>(&[[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]], c);
        let mut hessian = b.hessian;
        let mut k = 0;
        for i in 0..3 {
            for j in i..3 {
                let gradient_a = fused::<S>(c[2][i], bent[2][j], fused::<S>(c[1][i], bent[1][j], c[0][i] * bent[0][j]));
                hessian[k] = fused::<S>(multiplier, hessian[k], gradient_a);
                k += 1;
            }
        }
        hessian
    }
}

#[inline(always)]
pub(super) fn square<S: Simd>(v: V3<f64>) -> f64 {
    dot::<S, f64>(v, v)
}

/// `M N`. No closures here: they would not be compiled for vectors.
#[inline(always)]
fn product<S: Simd>(m: &M3<f64>, n: &M3<f64>) -> M3<f64> {
    [apply_transposed::<S, f64>(n, m[0]), apply_transposed::<S, f64>(n, m[1]), apply_transposed::<S, f64>(n, m[2])]
}

#[inline(always)]
fn fused<S: Simd>(a: f64, b: f64, c: f64) -> f64 {
    <f64 as Number<S>>::mul_add(a, b, c)
}
