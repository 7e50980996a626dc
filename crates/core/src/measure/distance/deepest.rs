//! The point deepest in two bodies, by quadratic programs: the least s with
//!
//! ```text
//! g_i(x) <= s   for the constraints of A,   h_j(x) <= s   for those of B.
//! ```
//!
//! Below 1 it lies in both. Above, its multipliers show the normal, also where the gap is too small
//! to have a direction.

use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::solver::active_set_qp::{Jets, Quadratic};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::tangent_newton::LONGEST_STEP;
use nalgebra::{Matrix3, Vector3, Vector4};

/// Newton iterates of the deepest point, query frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deepest {
    pub(super) x: Vector3<f64>,
    /// Largest constraint there, as the last linearizations have it.
    pub(super) s: f64,
    pub(super) a: Active,
    pub(super) b: Active,
}

impl Deepest {
    /// A start at a point where the largest constraint is s, with the constraints that are active
    /// there.
    pub(super) fn new(x: Vector3<f64>, s: f64, mut a: Active, mut b: Active) -> Self {
        let weight = 1.0 / (a.len + b.len).max(1) as f64;
        a.multiplier[..a.len].fill(weight);
        b.multiplier[..b.len].fill(weight);
        Self { x, s, a, b }
    }

    /// One step; its length relative to the bodies, or none if it leads nowhere.
    pub(super) fn step(&mut self, pair: &Pair<'_>) -> Option<f64> {
        let (of_a, of_b) = (Jets::new(&pair.a, &self.x), Jets::new(&pair.b, &self.x));
        let scale = self.s.abs().max(1.0);
        let program = Quadratic {
            hessian: (of_a.hessian(&self.a) + of_b.hessian(&self.b)).fixed_resize(0.0),
            cost: Vector4::w(),
            a: of_a.rows(scale, |jet| (jet.gradient.push(-1.0), -jet.value)),
            b: of_b.rows(scale, |jet| (jet.gradient.push(-1.0), -jet.value)),
            free_of_b: true,
        };
        let length = |dx: &Vector3<f64>| pair.a.relative_length(dx).max(pair.b.relative_length(dx));
        let stiffness = (stiff(&pair.a, scale) + stiff(&pair.b, scale)).fixed_resize(0.0);
        let found = program.step(self.a, self.b, length, &stiffness)?;
        let dx = found.v.xyz();
        let length = length(&dx);
        let share = (LONGEST_STEP / length).min(1.0);
        self.x += dx * share;
        self.s += (found.v.w - self.s) * share;
        (self.a, self.b) = (found.a, found.b);
        length.is_finite().then_some(length)
    }
}

/// What the Hessian of a body is about, of values like that.
fn stiff(body: &Posed<'_>, value: f64) -> Matrix3<f64> {
    let radius = body.body.trust().radius;
    body.metric() * (2.0 * value / (radius * radius))
}
