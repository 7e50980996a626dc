//! The point of a body of several constraints that is farthest along a unit vector n, with a proven
//! bracket of how far that is.
//!
//! From a point x a step d to second order solves
//!
//! ```text
//! min -n·d + ½ dᵀ (Σ λ_i H_i) d   over   (g_i(x) - 1) m_i + ∇g_i·d <= 0
//! ```
//!
//! with the constraints straightened by the mean m of their value and 1, and the multipliers λ of
//! the step before. Where it leads to other active constraints, λ are those of the wrong ones: the
//! program is solved again with its own multipliers, without an evaluation. The first multipliers
//! are those of the program with a stiffness in place of the Hessians: on the surface they are the
//! shares of n's projection onto the cone of the normals.
//!
//! The proof is that of [`super`], with the tangent plane of `Σ w_i g_i <= 1` alone.

use super::aggregate::{Evaluated, Weighted};
use super::distance::{FLATTEST, VIOLATED};
use super::linearized::Linearized;
use super::quadratic_program::minimize;
use super::share_inside::share_inside;
use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply_symmetric, apply_transposed, dot, rows, scaled, subtract,
};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::support_point::{Asked, Height};
use crate::measure::solver::tangent_newton::{AT_REST_SQUARED, LONGEST_MOVE, LONGEST_STEP, Side, TAYLOR_ROUNDING};
use crate::polynomial::{Simd, WithSimd};
use nalgebra::Vector3;

/// Most evaluations. It changes time only; no test pins it.
const MAX_ROUNDS: u32 = 10;

/// How far a body of several constraints reaches along a unit vector, as vectorized work.
pub(in crate::measure) struct FarthestOfEdges<'a> {
    pub(in crate::measure) body: &'a Body,
    /// The unit vector, body frame.
    pub(in crate::measure) n: Vector3<f64>,
    /// About where, from the centre of the normalization on, body frame, metres.
    pub(in crate::measure) known: Option<Vector3<f64>>,
    pub(in crate::measure) asked: Asked,
    pub(in crate::measure) options: &'a Options<'a>,
}

/// What is known where there is no height as accurate as asked for.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct FarthestLost {
    /// Evaluations.
    pub(in crate::measure) rounds: u32,
    /// Where the last of them led, body frame, metres, and what is active there.
    pub(in crate::measure) end: Option<(Vector3<f64>, ActiveSet)>,
}

impl WithSimd for FarthestOfEdges<'_> {
    /// The height as accurate as asked for.
    type Output = Result<Height, FarthestLost>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { body, n, known, asked, options } = self;
        let n: V3<f64> = n.into();
        let side = Side::at_home(simd, body, 0);
        let local = side.localize(simd, &[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        let pulled = apply_transposed::<S, f64>(&rows(simd, body.inverse()), n);
        let mut end = None;
        let found = Search { side, local, n, pulled, asked }.run(simd, known, options, &mut end);
        let center = &body.normalization().center;
        found.map_err(|rounds| FarthestLost { rounds, end: end.map(|(x, active)| (center + Vector3::from(x), active)) })
    }
}

struct Search<'a> {
    side: Side<'a, f64>,
    /// The axes of the body frame in normalized coordinates.
    local: M3<f64>,
    n: V3<f64>,
    /// `M⁻ᵀ n` with the map M to normalized coordinates.
    pulled: V3<f64>,
    asked: Asked,
}

impl Search<'_> {
    /// Newton's method until the bracket is narrow; `end` is where the last step led, with what is
    /// active there.
    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        known: Option<Vector3<f64>>,
        options: &Options<'_>,
        end: &mut Option<(V3<f64>, ActiveSet)>,
    ) -> Result<Height, u32> {
        let (side, n) = (&self.side, self.n);
        let cell = side.body().outline().cell(simd, n);
        let mut x = match known.map(V3::<f64>::from) {
            // The cell's point is one of the body: one that is less far along n is of no use.
            Some(known) if dot::<S, f64>(n, known) >= dot::<S, f64>(n, cell.point) => known,
            _ => cell.farthest(simd, n),
        };
        let mut active = Weighted::default();
        let (mut evaluated, mut linear) = (Evaluated::none(), Linearized::none());
        for rounds in 1..=MAX_ROUNDS {
            if options.exhausted(rounds - 1) {
                return Err(rounds - 1);
            }
            if !evaluated.fill(simd, side, x) {
                x = evaluated.brought_near(simd, side, x).ok_or(rounds)?;
                continue;
            }
            let (step, found) = self.step(simd, &mut linear, &evaluated, active).ok_or(rounds)?;
            active = found;
            let square = side.relative_square(simd, &self.local, step);
            if !square.is_finite() {
                return Err(rounds);
            }
            if square > LONGEST_MOVE * LONGEST_MOVE {
                x = add_scaled::<S, f64>(x, (LONGEST_STEP / square.sqrt()).min(1.0), step);
                *end = Some((x, active.set()));
                continue;
            }
            let to = add::<S, f64>(x, step);
            *end = Some((to, active.set()));
            // By how much the surface bends away from its tangent planes, and brackets are about as
            // wide.
            let bend = 0.5 * dot::<S, f64>(step, apply_symmetric::<S, f64>(&linear.hessian, step));
            if bend <= self.asked.tolerance {
                if let Some(height) = self.prove(simd, &evaluated, &active, (x, step)) {
                    return Ok(Height { iterations: rounds, ..height });
                }
                if square < AT_REST_SQUARED {
                    return Err(rounds);
                }
            }
            x = to;
        }
        Err(MAX_ROUNDS)
    }

    /// Newton's step, and the multipliers of where it leads, from the multipliers before, if there
    /// are any; none if a program has no minimiser.
    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        linear: &mut Linearized,
        evaluated: &Evaluated,
        mut active: Weighted,
    ) -> Option<(V3<f64>, Weighted)> {
        let size = self.side.body().trust().reach;
        let limits = (VIOLATED * size, FLATTEST / size);
        let down = scaled::<S, f64>(self.n, -1.0);
        let mut is_stiff = active.len == 0;
        if is_stiff {
            (active.index[0], active.len) = (evaluated.highest() as u8, 1);
        }
        let mut programs = 0;
        loop {
            programs += 1;
            let bent = active.sum(simd, evaluated).hessian;
            linear.fill(simd, evaluated.iter(), (&active, &bent), &self.local);
            if is_stiff {
                // Steps of a tenth of the body at most: only constraints near the start count.
                let stiff = 10.0 / size;
                linear.hessian = [stiff, 0.0, 0.0, stiff, 0.0, stiff];
            }
            let found = minimize(simd, (&linear.hessian, down), linear.rows(), linear.active, limits)?;
            let next = linear.weighted(&found.active, found.multipliers);
            if !is_stiff && (next.set() == active.set() || programs == 4) {
                return Some((found.step, next));
            }
            (active, is_stiff) = (next, false);
        }
    }

    /// The height where a step leads from a point; none if it is not as accurate as asked for.
    #[inline(always)]
    fn prove<S: Simd>(
        &self,
        simd: S,
        evaluated: &Evaluated,
        active: &Weighted,
        (x, step): (V3<f64>, V3<f64>),
    ) -> Option<Height> {
        let Self { side, local, n, pulled, asked } = self;
        let body = side.body();
        let weighted = active.normalized()?;
        let trust = weighted.trust(simd, body, evaluated)?;
        let sum = side.with_trust(&trust);
        let there = sum.extrapolate(simd, &weighted.sum(simd, evaluated), local, step);
        let multiplier = 1.0 / dot::<S, f64>(*n, there.plane.gradient);
        let off = add_scaled::<S, f64>(*n, -multiplier, there.plane.gradient);
        let short = sum.support_deficit(simd, &there, *n, *pulled);
        let share = share_inside(simd, body, evaluated, (apply_transposed::<S, f64>(local, step), step))?;
        let to = add::<S, f64>(x, step);
        let center = body.normalization().center;
        let inward = scaled::<S, f64>(subtract::<S, f64>((body.interior_point() - center).into(), to), share);
        let x = add::<S, f64>(to, inward);
        let deficit = short + TAYLOR_ROUNDING * (short.abs() + multiplier) - dot::<S, f64>(*n, inward);
        // Not `>`: numbers that are none prove nothing.
        if !(deficit <= asked.tolerance && dot::<S, f64>(off, off) <= asked.angle * asked.angle) {
            return None;
        }
        let along = dot::<S, f64>(*n, x);
        let rounding = TAYLOR_ROUNDING * (dot::<S, f64>(x, x).sqrt() + share * body.trust().span);
        let slack = side.displacement + rounding;
        Some(Height {
            lower: along - slack,
            upper: along + deficit + slack,
            point: center + Vector3::from(x),
            active: active.set(),
            iterations: 0,
        })
    }
}
