//! Newton's method for the level distance, by quadratic programs: the unknowns are x, s and the
//! multipliers of
//!
//! ```text
//! Σ ν_i ∇g_i + Σ μ_j ∇h_j = 0,   Σ ν_i = 1,   g_i(x) = s,   h_j(x) = 1.
//! ```
//!
//! From afar values decrease by orders of magnitude, and towards the least of a power d steps are a
//! (d - 1)-th part of the way. There the Hessians are those of `g_i^(2/d)`, about a square whatever
//! d is.

use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::active_set_qp::{CENTER, DAMPINGS, Jets, MOST_BENT, Quadratic, TO_CENTER};
use crate::measure::solver::kkt_newton::{Active, At, StepMonitor};
use crate::measure::solver::step_acceleration::{Series, Taken, tangents};
use crate::measure::solver::tangent_newton::{ALIGNED, LONGEST_STEP, NEAR, SEEK_ROUNDS, WORTH_A_BRACKET};
use nalgebra::{Matrix3, Matrix4, Vector3, Vector4};

/// Newton iterates of the level-distance system.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct LevelNewton {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) a: Active,
    pub(in crate::measure) b: Active,
}

/// How the iterates ended.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Ended {
    pub(in crate::measure) steps: u32,
    /// Whether there is no step left to take, though none was accepted: rounding keeps the bracket
    /// wide.
    pub(in crate::measure) settled: bool,
}

impl LevelNewton {
    /// Iterates until `accept` takes one, they stop converging or `stop` says so after that many
    /// steps.
    pub(in crate::measure) fn run(
        &mut self,
        pair: &Pair<'_>,
        stop: impl Fn(u32) -> bool,
        mut accept: impl FnMut(&Self) -> bool,
    ) -> Ended {
        if self.a.len == 0 {
            return Ended { steps: 0, settled: false };
        }
        let mut s = self.start(pair);
        let (mut monitor, mut last, mut series) = (StepMonitor::new(), f64::INFINITY, Series::default());
        for step in 1..=SEEK_ROUNDS {
            if stop(step - 1) {
                return Ended { steps: step - 1, settled: false };
            }
            // After a step that is not near values may still decrease by orders of magnitude, as a
            // power of the distance.
            let Some(length) = self.step(pair, &mut s, last > 2.0 * NEAR, &mut series) else {
                // Where both are flat the system is singular, but the point at hand with its
                // multipliers may do.
                accept(self);
                return Ended { steps: step, settled: false };
            };
            if (length < WORTH_A_BRACKET || step % 4 == 0) && accept(self) {
                return Ended { steps: step, settled: false };
            }
            if monitor.ends_with(length) {
                return Ended { steps: step, settled: true };
            }
            last = length;
        }
        Ended { steps: SEEK_ROUNDS, settled: false }
    }

    /// Whether the forces of the bodies are opposite, to [`ALIGNED`] or to what rounding leaves of
    /// them: brackets determine them to about the root of their width.
    pub(in crate::measure) fn is_balanced(&self, pair: &Pair<'_>) -> bool {
        let force = |body: &Posed<'_>, active: &Active| {
            let (mut sum, mut rounding) = (Vector3::zeros(), 0.0);
            for (i, multiplier) in active.iter().filter(|(_, multiplier)| *multiplier > 0.0) {
                let sample = body.sample(i, &self.x);
                sum += sample.gradient() * multiplier;
                rounding += sample.gradient_error() * multiplier;
            }
            (sum, rounding)
        };
        let ((of_a, error_a), (of_b, error_b)) = (force(&pair.a, &self.a), force(&pair.b, &self.b));
        // If B's constraints are inactive, A's gradient has to vanish.
        self.b.len == 0 || (of_a + of_b).norm() <= ALIGNED * of_a.norm() + error_a + error_b
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

    /// One step; its length relative to B and to the distance from A's interior point, or none if
    /// it leads nowhere.
    fn step(&mut self, pair: &Pair<'_>, s: &mut f64, from_afar: bool, series: &mut Series) -> Option<f64> {
        let (of_a, of_b) = (Jets::new(&pair.a, &self.x), Jets::new(&pair.b, &self.x));
        let far = pair.a.relative_length(&(self.x - pair.a.interior)).max(CENTER);
        let length = |dx: &Vector3<f64>| pair.b.relative_length(dx).max(TO_CENTER * pair.a.relative_length(dx) / far);
        let stiffness = self.stiffness(pair, &of_a, far, *s);
        let mut hessian = of_a.hessian(&self.a) + of_b.hessian(&self.b);
        if from_afar {
            hessian -= self.bent(&pair.a, &of_a, &(hessian + stiffness * DAMPINGS[0]));
        }
        // Values of A range over orders of magnitude, those of B are about 1.
        let scale = s.abs().max(1.0);
        let program = Quadratic {
            hessian: of_point(hessian / scale),
            cost: Vector4::w(),
            a: of_a.rows(1.0, |jet| ((jet.gradient / scale).push(-1.0), -jet.value / scale)),
            b: of_b.rows(1.0, |jet| (jet.gradient.push(0.0), 1.0 - jet.value)),
            free_of_b: true,
        };
        let found = program.step(self.a, self.b, length, &of_point(stiffness / scale))?;
        let dx = found.v.xyz();
        let same = self.a.bits() == found.a.bits() && self.b.bits() == found.b.bits();
        // Of several constraints of A only the differences are kept at 0.
        let free = tangents(&of_b.gradients(&self.b)[..self.b.len], &of_a.gradients(&self.a)[..self.a.len]);
        let free = free.filter(|_| same && self.a.len == 1);
        let force = -of_a.gradient(&self.a);
        let Taken { more, share, length } =
            series.take(free, &dx, (&force, &hessian), LONGEST_STEP, |more| length(&(dx + more)));
        self.x += (dx + more) * share;
        *s += (found.v.w * scale - *s) * share;
        (self.a, self.b) = (found.a, found.b.scaled(scale));
        Some(length)
    }

    /// What the Hessian of A's constraints has more than that of their roots.
    fn bent(&self, a: &Posed<'_>, of_a: &Jets, hessian: &Matrix3<f64>) -> Matrix3<f64> {
        let Some(inverse) = hessian.try_inverse() else { return Matrix3::zeros() };
        let mut bent = Matrix3::zeros();
        for (i, multiplier) in self.a.iter().filter(|(_, multiplier)| *multiplier > 0.0) {
            let (degree, jet) = (a.body.constraints()[i].polynomial.degree() as f64, of_a.jet(i));
            let most = MOST_BENT / (self.a.len as f64 * jet.gradient.dot(&(inverse * jet.gradient)));
            let more = (multiplier * (1.0 - 2.0 / degree) / jet.value).min(most);
            if more > 0.0 {
                bent += jet.gradient * jet.gradient.transpose() * more;
            }
        }
        bent
    }

    /// What the Hessian is about of values like s over lengths like that of B and the distance from
    /// A's interior point.
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
