//! Newton's method for the level distance, by quadratic programs: the unknowns are x, s and the multipliers of
//!
//! ```text
//! Σ ν_i ∇g_i + Σ μ_j ∇h_j = 0,   Σ ν_i = 1,   g_i(x) = s,   h_j(x) = 1.
//! ```

use crate::measure::active::MAX_ACTIVE;
use crate::measure::newton::{Active, At, MAX_STEPS, Pace, WORTH_A_BRACKET};
use crate::measure::pair::Pair;
use crate::measure::quadratic::{CENTER, Jets, LONGEST, Quadratic};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Newton iterates of the level-distance system.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelNewton {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) a: Active,
    pub(in crate::measure) b: Active,
}

impl LevelNewton {
    /// Iterates until `accept` takes one, they stop converging or `stop` says so after that many steps; returns the steps taken.
    pub(in crate::measure) fn run(
        &mut self,
        pair: &Pair<'_>,
        stop: impl Fn(u32) -> bool,
        mut accept: impl FnMut(&Self) -> bool,
    ) -> u32 {
        if self.a.len == 0 {
            return 0;
        }
        let mut s = self.start(pair);
        let mut pace = Pace::FIRST;
        for step in 1..=MAX_STEPS {
            if stop(step - 1) {
                return step - 1;
            }
            let Some(length) = self.step(pair, &mut s) else {
                // Where both are flat the system is singular, but the point at hand with its multipliers may do.
                accept(self);
                return step;
            };
            if (length < WORTH_A_BRACKET || step % 4 == 0) && accept(self) {
                return step;
            }
            if pace.ends_with(length) {
                return step;
            }
        }
        MAX_STEPS
    }

    /// First multipliers: equal weights of A, and those of B that fit; returns the first s.
    fn start(&mut self, pair: &Pair<'_>) -> f64 {
        self.a.multiplier = [1.0 / self.a.len as f64; MAX_ACTIVE];
        let a = At::new(&pair.a, &self.a, &self.x);
        if !self.b.fit(&pair.b, &self.x, &-a.sum) {
            self.b.len = 0;
        }
        a.value[..self.a.len].iter().sum::<f64>() / self.a.len as f64
    }

    /// One step; its length relative to B and to the distance from A's interior point, or none if it leads nowhere.
    fn step(&mut self, pair: &Pair<'_>, s: &mut f64) -> Option<f64> {
        let (of_a, of_b) = (Jets::new(&pair.a, &self.x), Jets::new(&pair.b, &self.x));
        let far = pair.a.relative_length(&(self.x - pair.a.interior)).max(CENTER);
        let length = |dx: &Vector3<f64>| pair.b.relative_length(dx).max(pair.a.relative_length(dx) / far);
        let program = Quadratic {
            hessian: of_point(of_a.hessian(&self.a) + of_b.hessian(&self.b)),
            cost: Vector4::w(),
            a: of_a.rows(s.abs().max(1.0), |jet| (jet.gradient.push(-1.0), -jet.value)),
            b: of_b.rows(1.0, |jet| (jet.gradient.push(0.0), 1.0 - jet.value)),
            free_of_b: true,
        };
        let found = program.step(self.a, self.b, length, &of_point(self.stiffness(pair, &of_a, far, *s)))?;
        let dx = found.v.xyz();
        let length = length(&dx);
        let share = (LONGEST / length).min(1.0);
        self.x += dx * share;
        *s += (found.v.w - *s) * share;
        (self.a, self.b) = (found.a, found.b);
        Some(length)
    }

    /// What the Hessian is about of values like s over lengths like that of B and the distance from A's interior point.
    fn stiffness(&self, pair: &Pair<'_>, of_a: &Jets, far: f64, s: f64) -> Matrix3<f64> {
        let degrees = self.a.iter().map(|(i, _)| pair.a.body.constraints()[i].polynomial.degree());
        let degree = degrees.max().unwrap_or(2) as f64;
        let stiff_a = degree * (degree - 1.0) * s.abs() / (far * pair.a.body.trust().radius).powi(2);
        let slope = pair.b.functional(&of_a.gradient(&self.a)).0;
        let stiff_b = slope.norm() / pair.b.body.trust().radius;
        pair.a.metric() * stiff_a + pair.b.metric() * stiff_b
    }
}

/// A matrix of the point's coordinates alone.
fn of_point(m: Matrix3<f64>) -> Matrix4<f64> {
    m.fixed_resize(0.0)
}
