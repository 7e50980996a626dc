//! How far a difference of two bodies reaches along a ray: the program behind the growth distance.
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

use crate::measure::active::MAX_ACTIVE;
use crate::measure::linear::{Curvature, eliminate};
use crate::measure::newton::Active;
use crate::measure::options::Options;
use crate::measure::pair::{Pair, Posed};
use crate::measure::programs::near_boundary;
use crate::optimize::{Program, Row, Rows};
use crate::polynomial::Jet;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// The program in coordinates along u and across it, the same across for x and y: variables (a, p, q, b) with
/// `x = center_a + a u + p v + q w`, `y = center_b + b u + p v + q w`, minimising b - a.
pub(super) struct ReachProgram<'a> {
    pair: &'a Pair<'a>,
    /// Columns u, v, w.
    axes: Matrix3<f64>,
    center_a: Vector3<f64>,
    center_b: Vector3<f64>,
}

impl<'a> ReachProgram<'a> {
    pub(super) fn new(
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

    /// A strictly feasible start: most of the way from the centres to the boundaries, where these are curved.
    pub(super) fn start(&self) -> SVector<f64, 4> {
        let u = self.axes.column(0).into_owned();
        let x = near_boundary(&self.pair.a, &self.center_a, &u);
        let y = near_boundary(&self.pair.b, &self.center_b, &-u);
        SVector::from([(x - self.center_a).dot(&u), 0.0, 0.0, (y - self.center_b).dot(&u)])
    }

    /// The two points of the variables.
    pub(super) fn points(&self, v: &SVector<f64, 4>) -> (Vector3<f64>, Vector3<f64>) {
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

/// The active constraints of one body at one point.
struct Local {
    jets: [Jet; MAX_ACTIVE],
    len: usize,
}

impl Local {
    fn new(body: &Posed<'_>, active: &Active, v: &Vector3<f64>) -> Self {
        let blank = Jet { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        let mut jets = [blank; MAX_ACTIVE];
        for (jet, (i, _)) in jets.iter_mut().zip(active.iter()) {
            *jet = body.jet(i, v);
        }
        Self { jets, len: active.len }
    }

    fn iter<'s>(&'s self, active: &'s Active) -> impl Iterator<Item = (&'s Jet, f64)> {
        self.jets[..self.len].iter().zip(active.multiplier)
    }

    fn hessian(&self, active: &Active) -> Matrix3<f64> {
        self.iter(active).fold(Matrix3::zeros(), |sum, (jet, multiplier)| sum + jet.hessian * multiplier)
    }

    fn gradient(&self, active: &Active) -> Vector3<f64> {
        self.iter(active).fold(Vector3::zeros(), |sum, (jet, multiplier)| sum + jet.gradient * multiplier)
    }
}

/// Largest number of Newton steps.
const MAX_STEPS: u32 = 16;

/// Longest Newton step, in query units, after which a bracket may be narrow: what remains is about its square.
const WORTH_A_BRACKET: f64 = 1e-3;

/// Most rows of the reduced system: ρ and three multipliers of each body.
const MOST: usize = 1 + 2 * MAX_ACTIVE;

/// Newton iterates of the optimality system; each step evaluates each active constraint once.
///
/// x and ρ carry the curvature of both bodies, `M = Σ λ_i ∇²g_i + Σ μ_j ∇²h_j`, and y follows x: what is left after M is one
/// equation for ρ and one for each multiplier.
pub(super) struct ReachNewton {
    pub(super) x: Vector3<f64>,
    pub(super) y: Vector3<f64>,
    /// Normal from A to B with `n·u = 1` at the solution.
    pub(super) n: Vector3<f64>,
    pub(super) a: Active,
    pub(super) b: Active,
    u: Vector3<f64>,
    offset: Vector3<f64>,
}

impl ReachNewton {
    /// A start from points near the surfaces and a normal from A to B; none if they are of no use for u.
    #[allow(clippy::too_many_arguments)]
    pub(super) fn new(
        pair: &Pair<'_>,
        u: Vector3<f64>,
        offset: Vector3<f64>,
        x: Vector3<f64>,
        y: Vector3<f64>,
        n: &Vector3<f64>,
        mut a: Active,
        mut b: Active,
    ) -> Option<Self> {
        // A normal nearly across u has turned too far to be the start of anything.
        let along = n.dot(&u);
        if !(along > 1e-3 * n.norm()) || a.len == 0 || b.len == 0 {
            return None;
        }
        let n = n / along;
        let finite = x.iter().chain(&y).chain(&n).all(|value| value.is_finite());
        let fits = finite && a.fit(&pair.a, &x, &n) && b.fit(&pair.b, &y, &-n);
        fits.then_some(Self { x, y, n, a, b, u, offset })
    }

    /// Iterates until `accept` takes one, they stop converging or the options say so after `before` iterations and these;
    /// returns the steps taken.
    pub(super) fn run(
        &mut self,
        pair: &Pair<'_>,
        options: &Options<'_>,
        before: u32,
        mut accept: impl FnMut(&Self) -> bool,
    ) -> u32 {
        let mut last = f64::INFINITY;
        for step in 1..=MAX_STEPS {
            if options.exhausted(before + step - 1) {
                return step - 1;
            }
            let Some(length) = self.step(pair) else {
                // Where both are flat the system is singular, but the point at hand with its multipliers may do.
                accept(self);
                return step;
            };
            // A long step has not converged: its bracket is not worth its cost, but for flat bodies now and then.
            if (length < WORTH_A_BRACKET || step % 4 == 0) && accept(self) {
                return step;
            }
            if length < 1e-9 || step % 4 == 0 {
                let changed = self.a.drop_negative()
                    | self.b.drop_negative()
                    | self.a.violated(&pair.a, &self.x, 1.0).is_some_and(|i| self.a.push(i))
                    | self.b.violated(&pair.b, &self.y, 1.0).is_some_and(|i| self.b.push(i));
                if !changed && (length > 0.9 * last || length < 1e-14) {
                    return step;
                }
            }
            last = length;
        }
        MAX_STEPS
    }

    /// One Newton step; its length, or none if the system is singular.
    fn step(&mut self, pair: &Pair<'_>) -> Option<f64> {
        let (a, b) = (Local::new(&pair.a, &self.a, &self.x), Local::new(&pair.b, &self.b, &self.y));
        let (of_a, of_b) = (a.hessian(&self.a), b.hessian(&self.b));
        let curvature = Curvature::new(&(of_a + of_b))?;
        // y moves by dx + e - u dρ, with the part of e along u already in ρ.
        let e = self.x - self.y + self.offset;
        let e = e - self.u * e.dot(&self.u);
        let (k, q) = (of_b * self.u, of_b * e);
        let (c, d) = (curvature.solve(&k), curvature.solve(&q));
        let (dx, drho) = if self.a.len == 1 && self.b.len == 1 {
            self.reduced::<3>(&a, &b, &curvature, [&e, &k, &q, &c, &d])?
        } else {
            self.reduced::<MOST>(&a, &b, &curvature, [&e, &k, &q, &c, &d])?
        };
        let dy = dx + e - self.u * drho;
        let length = dx.norm().max(dy.norm());
        // Bodies have size 1 here: a longer step leaves where the linearization means anything.
        let damping = (0.5 / length).min(1.0);
        self.x += dx * damping;
        self.y += dy * damping;
        // The linearized gradient at the new point: both bodies' are the same.
        self.n = a.gradient(&self.a) + of_a * dx * damping;
        length.is_finite().then_some(length)
    }

    /// Solves for the multipliers (which it replaces), dx and dρ. N is 1 + the number of active constraints, or more.
    fn reduced<const N: usize>(
        &mut self,
        a: &Local,
        b: &Local,
        curvature: &Curvature,
        [e, k, q, c, d]: [&Vector3<f64>; 5],
    ) -> Option<(Vector3<f64>, f64)> {
        let mut m = [[0.0; N]; N];
        let mut r = [0.0; N];
        // Rows beyond the active constraints say that an unused unknown is 0.
        (0..N).for_each(|i| m[i][i] = 1.0);
        let jets =
            || a.jets[..a.len].iter().zip([false; MAX_ACTIVE]).chain(b.jets[..b.len].iter().zip([true; MAX_ACTIVE]));
        let mut columns = [Vector3::zeros(); N];
        for (i, (jet, _)) in jets().enumerate() {
            columns[i + 1] = curvature.solve(&jet.gradient);
        }
        // n·u = 1, seen from B.
        (m[0][0], r[0]) = (self.u.dot(k) - k.dot(c), 1.0 + self.u.dot(q) - k.dot(d));
        for (i, (jet, of_b)) in jets().enumerate() {
            let g = &jet.gradient;
            let (slope, shift) = if of_b { (self.u.dot(g), e.dot(g)) } else { (0.0, 0.0) };
            m[0][i + 1] = g.dot(c) - slope;
            m[i + 1][0] = g.dot(c) - slope;
            for j in 0..a.len + b.len {
                m[i + 1][j + 1] = -g.dot(&columns[j + 1]);
            }
            r[i + 1] = 1.0 - jet.value - shift + g.dot(d);
        }
        eliminate(&mut m, &mut r)?;
        let mut dx = c * r[0] - d;
        for (column, multiplier) in columns[1..].iter().zip(&r[1..]) {
            dx -= column * *multiplier;
        }
        self.a.multiplier[..a.len].copy_from_slice(&r[1..=a.len]);
        self.b.multiplier[..b.len].copy_from_slice(&r[a.len + 1..=a.len + b.len]);
        Some((dx, r[0]))
    }
}
