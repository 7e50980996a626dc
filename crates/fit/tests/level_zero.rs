//! The level-0 program of the hierarchy, solved by an interior-point method for semidefinite
//! programs: an arbiter that shares neither method nor starting point with the solver.
//!
//! For sos-convex constraints level 0 is exact. With a unit vector n from B to A,
//! `|x - y| >= n·(x - y)`, and the Lagrangian splits into one polynomial in x and one in y, so that
//! one small Gram matrix per body remains:
//!
//! ```text
//! D = max γ_A + γ_B   subject to   |n| <= 1,  λ, μ >= 0,
//!      n·x + Σ λ_i (g_i(x) - 1) - γ_A  sos,     -n·y + Σ μ_j (h_j(y) - 1) - γ_B  sos
//! ```
//!
//! Any feasible point proves `D >= γ_A + γ_B`; at the optimum both polynomials are sos-convex with
//! minimum 0, hence sos. The level distance needs one Gram matrix: `d = max γ` with
//! `Σ ν_i g_i + Σ μ_j (h_j - 1) - γ` sos, ν, μ >= 0, Σ ν = 1.

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use nalgebra::{Matrix3, Vector3};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;
use std::collections::BTreeMap;
use std::sync::{Mutex, PoisonError};
use sublevel_core::body::{Body, Constraint};
use sublevel_core::measure::Pose;
use sublevel_core::polynomial::{Exponents, degree_of, monomials};

/// Polynomial coefficients.
type Terms = BTreeMap<Exponents, f64>;

const ONE: Exponents = [0; 3];

static BLAS: Mutex<()> = Mutex::new(());

/// Distance of the bodies, metres; about 1e-8 of their size exact. None if the program could not be
/// solved.
pub(crate) fn distance((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> Option<f64> {
    let unit = a.circumscribed().radius.max(b.circumscribed().radius);
    let mut program = Program::default();
    let n: [usize; 3] = std::array::from_fn(|_| program.variable(0.0));
    for (body, pose, sign) in [(a, pose_a, 1.0), (b, pose_b, -1.0)] {
        // x = map z + origin, in units and relative to A's translation.
        let rotation = pose.rotation().to_rotation_matrix().into_inner();
        let map = rotation * body.inverse() / unit;
        let shift = pose.translation() - pose_a.translation();
        let origin = (rotation * body.normalization().center + shift) / unit;
        let mut rows: BTreeMap<Exponents, Vec<(usize, f64)>> = BTreeMap::new();
        for i in 0..3 {
            rows.entry(ONE).or_default().push((n[i], sign * origin[i]));
            for j in 0..3 {
                let linear = std::array::from_fn(|k| u8::from(k == j));
                rows.entry(linear).or_default().push((n[i], sign * map[(i, j)]));
            }
        }
        let gamma = program.variable(-1.0);
        rows.entry(ONE).or_default().push((gamma, -1.0));
        for constraint in body.constraints() {
            let multiplier = program.nonnegative();
            lagrangian(&mut rows, multiplier, &stored(constraint), 1.0);
        }
        program.sum_of_squares(rows, body.degree());
    }
    program.ball(&n);
    program.solve(1.0).map(|value| -value * unit)
}

/// Level distance `d(A‖B)`; about 1e-8 of `max(1, |d|)` exact where bodies are of similar size and
/// not far apart. None if the program could not be solved.
pub(crate) fn level_distance((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> Option<f64> {
    // World coordinates about A's translation, in which z_i = L_i (x - c_i).
    let place = |body: &Body, pose: &Pose| {
        let turn = pose.rotation().to_rotation_matrix().into_inner();
        let center = turn * body.normalization().center + pose.translation() - pose_a.translation();
        (body.normalization().linear * turn.transpose(), center)
    };
    let ((l_a, c_a), (l_b, c_b)) = (place(a, pose_a), place(b, pose_b));
    // Coordinates in which both are about round where they are nearest: w = F (x - c), FᵀF =
    // L_AᵀL_A + L_BᵀL_B, c on the way from B's centre to the minimiser of |z_A|² + |z_B|² as far as
    // |z_B| <= 1. B's coefficients then are of size 1 and A's of the value's.
    let (w_a, w_b) = (l_a.transpose() * l_a, l_b.transpose() * l_b);
    let factor = (w_a + w_b).cholesky()?;
    let way = factor.solve(&(w_a * c_a + w_b * c_b)) - c_b;
    let center = c_b + way / (l_b * way).norm().max(1.0);
    let inverse = factor.l().transpose().try_inverse()?;
    let moved = |body: &Body, l: &Matrix3<f64>, c: &Vector3<f64>| -> Vec<Terms> {
        body.constraints().iter().map(|g| substituted(&stored(g), &(l * inverse), &(l * (center - c)))).collect()
    };
    let (of_a, of_b) = (moved(a, &l_a, &c_a), moved(b, &l_b, &c_b));
    let scale = of_a.iter().flat_map(Terms::values).fold(1.0_f64, |most, c| most.max(c.abs()));
    let mut program = Program::default();
    let mut rows: BTreeMap<Exponents, Vec<(usize, f64)>> = BTreeMap::new();
    let gamma = program.variable(-1.0);
    rows.entry(ONE).or_default().push((gamma, -1.0));
    let mut weights = Vec::new();
    for terms in &of_a {
        let weight = program.nonnegative();
        weights.push((weight, 1.0));
        lagrangian(&mut rows, weight, &terms.iter().map(|(e, c)| (*e, c / scale)).collect(), 0.0);
    }
    program.equal(weights, 1.0);
    for terms in &of_b {
        let multiplier = program.nonnegative();
        lagrangian(&mut rows, multiplier, terms, 1.0);
    }
    program.sum_of_squares(rows, a.degree().max(b.degree()));
    program.solve(1.0 / scale).map(|value| -value * scale)
}

fn stored(constraint: &Constraint) -> Terms {
    constraint.polynomial.terms().iter().copied().collect()
}

/// Adds `multiplier (g - level)` to the coefficients of a polynomial.
fn lagrangian(rows: &mut BTreeMap<Exponents, Vec<(usize, f64)>>, multiplier: usize, g: &Terms, level: f64) {
    for (e, c) in g {
        rows.entry(*e).or_default().push((multiplier, *c));
    }
    rows.entry(ONE).or_default().push((multiplier, -level));
}

/// `g(map z + origin)` expanded.
fn substituted(g: &Terms, map: &Matrix3<f64>, origin: &Vector3<f64>) -> Terms {
    let product = |p: &Terms, q: &Terms| {
        let mut result = Terms::new();
        for (e, c) in p {
            for (f, d) in q {
                *result.entry(std::array::from_fn(|i| e[i] + f[i])).or_default() += c * d;
            }
        }
        result
    };
    let powers: [Vec<Terms>; 3] = std::array::from_fn(|i| {
        let unit = |j: usize| -> Exponents { std::array::from_fn(|k| u8::from(k == j)) };
        let line: Terms = (0..3).map(|j| (unit(j), map[(i, j)])).chain([(ONE, origin[i])]).collect();
        let mut powers = vec![Terms::from([(ONE, 1.0)])];
        for k in 0..8 {
            powers.push(product(&powers[k], &line));
        }
        powers
    });
    let mut result = Terms::new();
    for (e, c) in g {
        let of = |i: usize| &powers[i][usize::from(e[i])];
        for (f, d) in product(&product(of(0), of(1)), of(2)) {
            *result.entry(f).or_default() += c * d;
        }
    }
    result
}

/// A conic program under construction: rows `A x + s = b` with s in a cone, grouped by cone at the
/// end.
#[derive(Default)]
struct Program {
    objective: Vec<f64>,
    /// Rows `Σ c x = b`.
    equalities: Vec<(Vec<(usize, f64)>, f64)>,
    nonnegative: Vec<usize>,
    /// Variables of a unit ball.
    ball: Vec<usize>,
    /// First variable and size of each semidefinite matrix, held as the scaled upper triangle by
    /// columns.
    semidefinite: Vec<(usize, usize)>,
}

impl Program {
    fn variable(&mut self, cost: f64) -> usize {
        self.objective.push(cost);
        self.objective.len() - 1
    }

    fn nonnegative(&mut self) -> usize {
        let variable = self.variable(0.0);
        self.nonnegative.push(variable);
        variable
    }

    fn equal(&mut self, row: Vec<(usize, f64)>, value: f64) {
        self.equalities.push((row, value));
    }

    fn ball(&mut self, variables: &[usize]) {
        self.ball = variables.to_vec();
    }

    /// The polynomial with these coefficients, linear in the variables, is `mᵀ Q m` with Q positive
    /// semidefinite and m all monomials of half the degree.
    fn sum_of_squares(&mut self, mut rows: BTreeMap<Exponents, Vec<(usize, f64)>>, degree: usize) {
        let basis = monomials(degree / 2);
        let first = self.objective.len();
        for j in 0..basis.len() {
            for i in 0..=j {
                let entry = self.variable(0.0);
                let product = std::array::from_fn(|k| basis[i][k] + basis[j][k]);
                let weight = if i == j { 1.0 } else { std::f64::consts::SQRT_2 };
                rows.entry(product).or_default().push((entry, -weight));
            }
        }
        self.semidefinite.push((first, basis.len()));
        for (e, row) in rows {
            assert!(degree_of(e) <= degree, "a term above the degree");
            self.equal(row, 0.0);
        }
    }

    /// The least cost, to 1e-6 of itself or of `size`.
    fn solve(&self, size: f64) -> Option<f64> {
        let (mut row, mut triplets, mut b) = (0, (vec![], vec![], vec![]), Vec::new());
        let mut push = |entries: &[(usize, f64)], value: f64| {
            for &(column, coefficient) in entries {
                triplets.0.push(row);
                triplets.1.push(column);
                triplets.2.push(coefficient);
            }
            b.push(value);
            row += 1;
        };
        for (entries, value) in &self.equalities {
            push(entries, *value);
        }
        for &variable in &self.nonnegative {
            push(&[(variable, -1.0)], 0.0);
        }
        let mut cones = vec![
            SupportedConeT::ZeroConeT(self.equalities.len()),
            SupportedConeT::NonnegativeConeT(self.nonnegative.len()),
        ];
        if !self.ball.is_empty() {
            push(&[], 1.0);
            self.ball.iter().for_each(|&variable| push(&[(variable, -1.0)], 0.0));
            cones.push(SupportedConeT::SecondOrderConeT(self.ball.len() + 1));
        }
        for &(first, size) in &self.semidefinite {
            (first..first + size * (size + 1) / 2).for_each(|variable| push(&[(variable, -1.0)], 0.0));
            cones.push(SupportedConeT::PSDTriangleConeT(size));
        }
        let count = self.objective.len();
        let (i, j, v) = triplets;
        let matrix = CscMatrix::new_from_triplets(row, count, i, j, v);
        // Where one factorization loses too many digits to go on, the other one mostly does not.
        ["faer", "qdldl"].into_iter().find_map(|method| {
            let settings = DefaultSettings {
                verbose: false,
                max_threads: 1,
                tol_gap_abs: 1e-13,
                tol_gap_rel: 1e-13,
                tol_feas: 1e-13,
                direct_solve_method: method.to_string(),
                chordal_decomposition_enable: false,
                ..DefaultSettings::default()
            };
            let none = CscMatrix::zeros((count, count));
            // A serial BLAS is not made for tests of several threads.
            let _alone = BLAS.lock().unwrap_or_else(PoisonError::into_inner);
            let mut solver = DefaultSolver::new(&none, &self.objective, &matrix, &b, &cones, settings).ok()?;
            solver.solve();
            // Thin bodies leave no progress at the last digits: then the residuals decide.
            let info = &solver.info;
            let most = 1e-6 * size.max(solver.solution.obj_val.abs());
            let small = info.gap_abs < most && info.res_primal.max(info.res_dual) < most.min(1e-6);
            let stalled = [SolverStatus::AlmostSolved, SolverStatus::InsufficientProgress];
            let solved =
                solver.solution.status == SolverStatus::Solved || stalled.contains(&solver.solution.status) && small;
            solved.then_some(solver.solution.obj_val)
        })
    }
}

/// Random pairs at many distances, and overlapping ones: the answer agrees to 1e-6 of the size.
#[test]
fn answers_agree_with_the_level_zero_program() {
    use sublevel_core::measure::{Options, WarmStart};
    use sublevel_testkit::random::Seeded;
    let zoo = sublevel_testkit::bodies::zoo();
    let (mut worst, mut worst_level) = (0.0_f64, 0.0_f64);
    for seed in 0..60 {
        let mut random = Seeded(700_000 + seed);
        let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let reach = sum * 1.5 * random.positive();
        let (pose_a, pose_b) = (random.pose(0.3), random.pose(reach));
        let label = format!("seed {seed} {}-{}", a.name(), b.name());
        let options = Options::default();
        let answer = sublevel_core::measure::distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        let sos = distance((a, &pose_a), (b, &pose_b)).unwrap_or_else(|| panic!("{label}: not solved"));
        let error = (sos - answer.value()).abs() / sum;
        assert!(error <= 1e-6, "{label}: {sos} against {answer:?}");
        worst = worst.max(error);
        let level = sublevel_core::measure::level_distance(a, &pose_a, b, &pose_b, &options, &mut WarmStart::default());
        if level.value() > 1e3 {
            continue;
        }
        let sos = level_distance((a, &pose_a), (b, &pose_b)).unwrap_or_else(|| panic!("{label}: not solved"));
        let error = (sos - level.value()).abs() / level.value().abs().max(1.0);
        if error > 1e-7 {
            println!("{label}: {error:e}");
        }
        worst_level = worst_level.max(error);
    }
    println!("worst {worst:e}, level {worst_level:e}");
}
