//! How far a difference of two bodies reaches along a ray: the program behind the growth distance,
//! and with u a normal and no offset one that finds what a distance rests on.
//!
//! ```text
//! max ρ   subject to   x - y + offset = ρ u,   g_i(x) <= 1,   h_j(y) <= 1
//! ```
//!
//! with a unit vector u. At the optimum there are multipliers with
//!
//! ```text
//! Σ λ_i ∇g_i(x) = n,   Σ μ_j ∇h_j(y) = -n,   n·u = 1.
//! ```

use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::options::Options;
use crate::measure::solver::active_set_qp::{Jets, Quadratic};
use crate::measure::solver::barrier_programs::near_boundary;
use crate::measure::solver::kkt_newton::{Active, StepMonitor};
use crate::measure::solver::step_acceleration::{Series, Taken, tangents};
use crate::measure::solver::tangent_newton::{LONGEST_MOVE, LONGEST_STEP, SEEK_ROUNDS, WORTH_A_BRACKET};
use crate::optimize::{Program, Row, Rows};
use nalgebra::{Matrix3, Matrix4, SMatrix, SVector, Vector3, Vector4};

/// The program in coordinates along u and across it, the same across for x and y: variables (a, p,
/// q, b) with `x = center_a + a u + p v + q w`, `y = center_b + b u + p v + q w`, minimising b - a.
pub(in crate::measure) struct ReachProgram<'a> {
    pair: &'a Pair<'a>,
    /// Columns u, v, w.
    axes: Matrix3<f64>,
    center_a: Vector3<f64>,
    center_b: Vector3<f64>,
}

impl<'a> ReachProgram<'a> {
    pub(in crate::measure) fn new(
        pair: &'a Pair<'a>,
        ray: &Vector3<f64>,
        center_a: &Vector3<f64>,
        center_b: &Vector3<f64>,
    ) -> Self {
        let u = ray.normalize();
        let mut least = Vector3::zeros();
        least[u.iamin()] = 1.0;
        let v = u.cross(&least).normalize();
        Self { pair, axes: Matrix3::from_columns(&[u, v, u.cross(&v)]), center_a: *center_a, center_b: *center_b }
    }

    /// A strictly feasible start: most of the way from the centres to the boundaries, where these
    /// are curved.
    pub(in crate::measure) fn start(&self) -> SVector<f64, 4> {
        let u = self.axes.column(0).into_owned();
        let x = near_boundary(&self.pair.a, &self.center_a, &u);
        let y = near_boundary(&self.pair.b, &self.center_b, &-u);
        SVector::from([(x - self.center_a).dot(&u), 0.0, 0.0, (y - self.center_b).dot(&u)])
    }

    /// The two points of the variables.
    pub(in crate::measure) fn points(&self, v: &SVector<f64, 4>) -> (Vector3<f64>, Vector3<f64>) {
        (
            self.center_a + self.axes * Vector3::new(v[0], v[1], v[2]),
            self.center_b + self.axes * Vector3::new(v[3], v[1], v[2]),
        )
    }
}

impl Program<4> for ReachProgram<'_> {
    fn objective(&self, _: &SVector<f64, 4>) -> (SVector<f64, 4>, SMatrix<f64, 4, 4>) {
        (SVector::from([-1.0, 0.0, 0.0, 1.0]), SMatrix::zeros())
    }

    fn constraints(&self, v: &SVector<f64, 4>, rows: &mut Rows<4>) {
        let (x, y) = self.points(v);
        let turn = self.axes.transpose();
        for i in 0..self.pair.a.len() {
            let jet = self.pair.a.jet(i, &x);
            let g = turn * jet.gradient;
            let gradient = SVector::from([g[0], g[1], g[2], 0.0]);
            rows.push(Row { value: jet.value - 1.0, gradient, hessian: turn * jet.hessian * self.axes, block: 0 });
        }
        // For y the coordinate along u comes last.
        let cycled = Matrix3::from_columns(&[self.axes.column(1), self.axes.column(2), self.axes.column(0)]);
        let turn = cycled.transpose();
        for i in 0..self.pair.b.len() {
            let jet = self.pair.b.jet(i, &y);
            let g = turn * jet.gradient;
            let gradient = SVector::from([0.0, g[0], g[1], g[2]]);
            rows.push(Row { value: jet.value - 1.0, gradient, hessian: turn * jet.hessian * cycled, block: 1 });
        }
    }
}

/// The program's ray, and a start for it; query frame.
pub(in crate::measure) struct RayStart {
    /// Unit vector along the ray.
    pub(in crate::measure) u: Vector3<f64>,
    /// What is added to x - y.
    pub(in crate::measure) offset: Vector3<f64>,
    /// A point near A's surface.
    pub(in crate::measure) x: Vector3<f64>,
    /// A point near B's surface.
    pub(in crate::measure) y: Vector3<f64>,
    /// About the normal there, from A to B, of any length.
    pub(in crate::measure) n: Vector3<f64>,
    /// What seems to be active of A.
    pub(in crate::measure) a: Active,
    /// What seems to be active of B.
    pub(in crate::measure) b: Active,
}

/// Newton iterates of the program in x and ρ, with `y = x + offset - ρ u`.
pub(in crate::measure) struct ReachNewton {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
    /// Normal from A to B with `n·u = 1` at the solution.
    pub(in crate::measure) n: Vector3<f64>,
    pub(in crate::measure) a: Active,
    pub(in crate::measure) b: Active,
    u: Vector3<f64>,
    /// Length of the last step, relative to the bodies.
    length: f64,
}

impl ReachNewton {
    /// The first iterate; none if the start is of no use for u.
    pub(in crate::measure) fn new(pair: &Pair<'_>, start: RayStart) -> Option<Self> {
        let RayStart { u, offset, x, y, n, mut a, mut b } = start;
        // A normal nearly across u has turned too far to be the start of anything.
        let along = n.dot(&u);
        if !(along > 1e-3 * n.norm()) || a.len == 0 || b.len == 0 {
            return None;
        }
        let n = n / along;
        let finite = x.iter().chain(&y).chain(&n).all(|value| value.is_finite());
        let fits = finite && a.fit(&pair.a, &x, &n) && b.fit(&pair.b, &y, &-n);
        let y = x + offset - u * (x + offset - y).dot(&u);
        fits.then_some(Self { x, y, n, a, b, u, length: f64::INFINITY })
    }

    /// Iterates until `accept` takes one, they stop converging or the options say so after `before`
    /// iterations and these; returns the steps taken.
    pub(in crate::measure) fn run(
        &mut self,
        pair: &Pair<'_>,
        options: &Options<'_>,
        before: u32,
        mut accept: impl FnMut(&Self) -> bool,
    ) -> u32 {
        let (mut monitor, mut series) = (StepMonitor::new(), Series::default());
        for step in 1..=SEEK_ROUNDS {
            if options.exhausted(before + step - 1) {
                return step - 1;
            }
            let Some(length) = self.step(pair, &mut series) else {
                // Where both are flat the system is singular, but the point at hand with its
                // multipliers may do.
                accept(self);
                return step;
            };
            self.length = length;
            // A long step has not converged: its bracket is not worth its cost, but for flat bodies
            // now and then.
            if (length < WORTH_A_BRACKET || step % 4 == 0) && accept(self) {
                return step;
            }
            if monitor.has_diverged(step, length, LONGEST_STEP) || monitor.ends_with(length) {
                return step;
            }
        }
        SEEK_ROUNDS
    }

    /// Whether the last step is no longer than those of Newton's method for the distance, which
    /// then goes on from here.
    pub(in crate::measure) fn is_near(&self) -> bool {
        self.length < LONGEST_MOVE
    }

    /// One Newton step; its length relative to the bodies, or none if it leads nowhere.
    fn step(&mut self, pair: &Pair<'_>, series: &mut Series) -> Option<f64> {
        let (of_a, of_b) = (Jets::new(&pair.a, &self.x), Jets::new(&pair.b, &self.y));
        let (bent_a, bent_b) = (of_a.hessian(&self.a), of_b.hessian(&self.b));
        let u = self.u;
        let program = Quadratic {
            hessian: self.joint(&bent_a, &bent_b),
            cost: -Vector4::w(),
            a: of_a.rows(1.0, |jet| (jet.gradient.push(0.0), 1.0 - jet.value)),
            b: of_b.rows(1.0, |jet| (jet.gradient.push(-jet.gradient.dot(&u)), 1.0 - jet.value)),
            free_of_b: false,
        };
        // y moves by dx - u dρ, but how far B's constraints let dρ go is not known before.
        let found =
            program.step(self.a, self.b, |dx| pair.a.relative_length(dx), &self.stiffness(pair, &of_a, &of_b))?;
        let (dx, dy) = (found.v.xyz(), found.v.xyz() - u * found.v.w);
        let same = self.a.bits() == found.a.bits() && self.b.bits() == found.b.bits();
        let free = tangents(&of_a.gradients(&self.a)[..self.a.len], &of_b.gradients(&self.b)[..self.b.len]);
        let residual = -(of_a.gradient(&self.a) + of_b.gradient(&self.b));
        let Taken { more, share, length } =
            series.take(free.filter(|_| same), &dx, (&residual, &(bent_a + bent_b)), LONGEST_STEP, |more| {
                pair.a.relative_length(&(dx + more)).max(pair.b.relative_length(&(dy + more)))
            });
        let (dx, dy) = ((dx + more) * share, (dy + more) * share);
        self.x += dx;
        self.y += dy;
        (self.a, self.b) = (found.a, found.b);
        // The linearized gradient at the new point: both bodies' are the same.
        self.n = of_a.gradient(&self.a) + bent_a * dx;
        length.is_finite().then_some(length)
    }

    /// The quadratic form of dx and dρ that is one of A of dx, and one of B of `dx - u dρ`.
    fn joint(&self, of_a: &Matrix3<f64>, of_b: &Matrix3<f64>) -> Matrix4<f64> {
        let mut m: Matrix4<f64> = (of_a + of_b).fixed_resize(0.0);
        let turned = of_b * self.u;
        m.fixed_view_mut::<3, 1>(0, 3).copy_from(&-turned);
        m.fixed_view_mut::<1, 3>(3, 0).copy_from(&-turned.transpose());
        m[(3, 3)] = self.u.dot(&turned);
        m
    }

    /// What the Hessian is about of constraints with such gradients over lengths like those of the
    /// bodies.
    fn stiffness(&self, pair: &Pair<'_>, of_a: &Jets, of_b: &Jets) -> Matrix4<f64> {
        let stiff = |body: &Posed<'_>, gradient: Vector3<f64>| {
            let (slope, radius) = (body.functional(&gradient).0.norm(), body.body.trust().radius);
            body.metric() * (slope / radius)
        };
        self.joint(&stiff(&pair.a, of_a.gradient(&self.a)), &stiff(&pair.b, of_b.gradient(&self.b)))
    }
}
