//! The paper's programs as they are printed, here for traces, in the primal and given straight to
//! clarabel: nothing of the dual, of paths or of frames is shared with what they are to check.

use super::*;
use crate::objective::{Matrix, Measure};
use crate::structure::Pattern;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use sublevel_core::polynomial::{NormPower, monomials};
// Links the BLAS that clarabel's semidefinite cones call.
use openblas_src as _;
use std::f64::consts::SQRT_2;

/// `A x + s = b`, s in a product of cones, row by row.
#[derive(Default)]
pub(crate) struct Program {
    /// Row, column, value.
    entries: Vec<(usize, usize, f64)>,
    right: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
    linear: Vec<f64>,
}

impl Program {
    pub(crate) fn variable(&mut self, cost: f64) -> usize {
        self.linear.push(cost);
        self.linear.len() - 1
    }

    /// Variables of a symmetric matrix, upper triangle by columns.
    pub(crate) fn matrix(&mut self, size: usize, trace_cost: f64) -> Vec<usize> {
        let entries = (0..size).flat_map(|j| (0..=j).map(move |i| i == j));
        entries.map(|diagonal| self.variable(if diagonal { trace_cost } else { 0.0 })).collect()
    }

    pub(crate) fn row(&mut self, entries: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        let row = self.right.len();
        self.entries.extend(entries.into_iter().map(|(column, value)| (row, column, value)));
        self.right.push(right);
    }

    /// `[[V, I], [I, Q]] ⪰ 0`, or `Q ⪰ floor I` without V.
    pub(crate) fn semidefinite(&mut self, v: Option<&[usize]>, q: &[usize], size: usize, floor: f64) {
        let first = if v.is_some() { size } else { 0 };
        for j in 0..first + size {
            for i in 0..=j {
                let scale = if i == j { 1.0 } else { SQRT_2 };
                let at = |i: usize, j: usize| j * (j + 1) / 2 + i;
                match v {
                    Some(v) if j < first => self.row([(v[at(i, j)], -scale)], 0.0),
                    _ if i < first => self.row([], if i + first == j { scale } else { 0.0 }),
                    _ => self.row([(q[at(i - first, j - first)], -scale)], if i == j { -floor } else { 0.0 }),
                }
            }
        }
        self.cones.push(SupportedConeT::PSDTriangleConeT(first + size));
    }

    /// All rows so far are equations.
    pub(crate) fn equations(&mut self) {
        self.cones.push(SupportedConeT::ZeroConeT(self.right.len()));
    }

    /// `log det Q >= Σ t` for new t, which are to be maximised: `[[Q, Z], [Zᵀ, diag Z]] ⪰ 0` with Z
    /// lower triangular and `exp(t_i) <= Z_ii`.
    pub(crate) fn log_det(&mut self, q: &[usize], size: usize) {
        let at = |i: usize, j: usize| j * (j + 1) / 2 + i;
        let z = self.matrix(size, 0.0);
        for j in 0..2 * size {
            for i in 0..=j {
                let scale = if i == j { 1.0 } else { SQRT_2 };
                match (i < size, j < size) {
                    (true, true) => self.row([(q[at(i, j)], -scale)], 0.0),
                    (true, false) if i >= j - size => self.row([(z[at(j - size, i)], -scale)], 0.0),
                    (false, false) if i == j => self.row([(z[at(i - size, i - size)], -1.0)], 0.0),
                    _ => self.row([], 0.0),
                }
            }
        }
        self.cones.push(SupportedConeT::PSDTriangleConeT(2 * size));
        for i in 0..size {
            let t = self.variable(-1.0);
            self.row([(t, -1.0)], 0.0);
            self.row([], 1.0);
            self.row([(z[at(i, i)], -1.0)], 0.0);
            self.cones.push(SupportedConeT::ExponentialConeT());
        }
    }

    pub(crate) fn minimum(mut self) -> f64 {
        self.entries.sort_by_key(|&(row, column, _)| (column, row));
        let columns = self.linear.len();
        let starts = (0..=columns).map(|c| self.entries.partition_point(|entry| entry.1 < c)).collect();
        let rows = self.entries.iter().map(|entry| entry.0).collect();
        let values = self.entries.iter().map(|entry| entry.2).collect();
        let matrix = CscMatrix::new(self.right.len(), columns, starts, rows, values);
        let settings = DefaultSettings {
            verbose: false,
            max_threads: 1,
            direct_solve_method: "faer".to_string(),
            chordal_decomposition_enable: false,
            ..DefaultSettings::default()
        };
        let nothing = CscMatrix::zeros((columns, columns));
        let _alone = crate::conic_program::alone();
        let mut solver =
            DefaultSolver::new(&nothing, &self.linear, &matrix, &self.right, &self.cones, settings).unwrap();
        solver.solve();
        // The gap between these answers and ours is asserted, whatever the solver thinks of its
        // own.
        let status = solver.solution.status;
        assert!(
            [SolverStatus::Solved, SolverStatus::AlmostSolved, SolverStatus::InsufficientProgress].contains(&status),
            "{status:?}"
        );
        solver.solution.obj_val
    }
}

/// Least `tr Q⁻¹` of the Gram matrix Q that `matrix` names, over sums of squares p with `H ⪰ floor
/// I` and `p <= 1` at the points, H being a Gram matrix of the Hessian form of `p + relaxation`.
///
/// With `symmetric`, the points are their own mirror images in all three coordinate planes. The
/// average of an optimum over the mirrors is one, too: p is even in each coordinate, and both Gram
/// matrices fall apart by parity.
fn least_trace(
    structure: &Structure,
    matrix: Matrix,
    (points, symmetric): (&[Vector3<f64>], bool),
    floor: f64,
    relaxation: &DVector<f64>,
) -> f64 {
    let parity = |e: [u8; 3]| if symmetric { e.map(|n| n % 2) } else { [0; 3] };
    let even = |monomial: usize| parity(structure.monomials[monomial]) == [0; 3];
    let of_monomials: Vec<_> = monomials(structure.degree / 2).into_iter().map(parity).collect();
    let of_form = structure.hessian_basis.iter().map(|b| {
        let mut exponents = b.exponents;
        exponents[usize::from(b.direction)] += 1;
        parity(exponents)
    });

    let mut program = Program::default();
    let coefficients: Vec<_> = (0..structure.monomials.len()).map(|m| even(m).then(|| program.variable(0.0))).collect();
    // Coefficients of each key less what the Gram matrix makes of it.
    let mut of_p: Vec<Vec<_>> = coefficients.iter().map(|c| c.map(|c| (c, -1.0)).into_iter().collect()).collect();
    let mut of_hessian: Vec<Vec<_>> = structure
        .derivative
        .iter()
        .map(|&(m, factor)| coefficients[m].map(|c| (c, -factor)).into_iter().collect())
        .collect();
    let p_blocks = blocks(&mut program, &structure.gram, &of_monomials, &mut of_p);
    let h_blocks = blocks(&mut program, &structure.hessian, &of_form.collect::<Vec<_>>(), &mut of_hessian);
    let (measured, other, floor) = match matrix {
        Matrix::Polynomial => (p_blocks, h_blocks, floor),
        Matrix::Hessian => (h_blocks, p_blocks, 0.0),
    };
    let inverses: Vec<_> = measured.iter().map(|&(size, _)| program.matrix(size, 1.0)).collect();

    of_p.into_iter().filter(|key| !key.is_empty()).for_each(|key| program.row(key, 0.0));
    for (key, &(monomial, factor)) in of_hessian.into_iter().zip(&structure.derivative) {
        if !key.is_empty() {
            program.row(key, factor * relaxation[monomial]);
        }
    }
    program.equations();
    for point in points {
        let values = structure.values(point);
        program.row(coefficients.iter().zip(&values).filter_map(|(c, v)| Some(((*c)?, *v))), 1.0);
    }
    program.cones.push(SupportedConeT::NonnegativeConeT(points.len()));
    other.iter().for_each(|(size, q)| program.semidefinite(None, q, *size, floor));
    measured.iter().zip(&inverses).for_each(|((size, q), v)| program.semidefinite(Some(v), q, *size, 0.0));
    program.minimum()
}

/// The diagonal blocks of a Gram matrix, one per class of its rows: sizes and variables. Adds them
/// up in `sums`, by key.
fn blocks(
    program: &mut Program,
    pattern: &Pattern,
    classes: &[[u8; 3]],
    sums: &mut [Vec<(usize, f64)>],
) -> Vec<(usize, Vec<usize>)> {
    let mut different = classes.to_vec();
    different.sort_unstable();
    different.dedup();
    let of_class = different.into_iter().map(|class| {
        let rows: Vec<usize> = (0..classes.len()).filter(|&i| classes[i] == class).collect();
        let variables = program.matrix(rows.len(), 0.0);
        let pairs = (0..rows.len()).flat_map(|j| (0..=j).map(move |i| (i, j)));
        for ((i, j), &variable) in pairs.zip(&variables) {
            sums[pattern.key(rows[i], rows[j])].push((variable, if i == j { 1.0 } else { 2.0 }));
        }
        (rows.len(), variables)
    });
    of_class.collect()
}

#[test]
fn traces_agree_with_the_printed_programs() {
    let cloud = |count| -> Vec<Vector3<f64>> {
        blob(count).into_iter().map(|x| x.component_mul(&Vector3::new(0.8, 0.7, 0.6))).collect()
    };
    let (lopsided, corners) = (cloud(150), cloud(30));
    let mirrored: Vec<_> = (0..8_usize)
        .flat_map(|octant| {
            let sign = Vector3::from_fn(|axis, _| if (octant >> axis) & 1 == 0 { 1.0 } else { -1.0 });
            corners.iter().map(move |x| x.component_mul(&sign))
        })
        .collect();
    let margin = 1e-7;
    for (degree, symmetric) in [(2, false), (4, false), (4, true), (6, true)] {
        let unit_points = if symmetric { &mirrored } else { &lopsided };
        let ellipsoid = minimum_ellipsoid(unit_points).unwrap();
        let whitened: Vec<_> = unit_points.iter().map(|u| ellipsoid.linear * (u - ellipsoid.center)).collect();
        let unit = Affine { linear: ellipsoid.linear.try_inverse().unwrap(), offset: ellipsoid.center };
        let structure = Structure::new(degree);
        for objective in [Objective::TraceP, Objective::TraceH] {
            let problem = Problem::new(&structure, objective, &unit, margin);
            let ours = generate(&problem, &whitened, &[], &mut Watch::new(&mut unwatched)).unwrap();
            let nothing = DVector::zeros(structure.monomials.len());
            let printed = least_trace(&structure, objective.matrix(), (unit_points, symmetric), margin, &nothing);
            let difference = ours.objective / printed - 1.0;
            println!(
                "{objective}, degree {degree}: {:.8}, as printed {printed:.8}, relative difference {difference:.1e}",
                ours.objective
            );
            assert!(difference.abs() < 1e-6);
        }
    }
}

/// `p + c |u|^2d` sos-convex, and no convexity at all: traces, which see the whole of P.
#[test]
fn relaxed_programs_agree_with_the_printed_one() {
    let points: Vec<_> = blob(120)
        .into_iter()
        .map(|x| x.component_mul(&Vector3::new(0.8, 0.7, 0.6)) * (1.0 - 0.5 * x.x.powi(2)))
        .collect();
    let ellipsoid = minimum_ellipsoid(&points).unwrap();
    let whitened: Vec<_> = points.iter().map(|u| ellipsoid.linear * (u - ellipsoid.center)).collect();
    let unit = Affine { linear: ellipsoid.linear.try_inverse().unwrap(), offset: ellipsoid.center };
    let (margin, degree, objective) = (1e-7, 4, Objective::TraceP);
    let mut last = f64::INFINITY;
    for c in [0.1, 10.0, f64::INFINITY] {
        let structure = if c.is_finite() { Structure::new(degree) } else { Structure::without_convexity(degree) };
        let power = |linear: &Matrix3<f64>, offset: &Vector3<f64>| NormPower::new(c, linear, offset, degree);
        let relaxed = c.is_finite().then(|| power(&unit.linear, &unit.offset));
        let problem = Problem::new(&structure, objective, &unit, margin).relaxed(relaxed.as_ref());
        let ours = generate(&problem, &whitened, &[], &mut Watch::new(&mut unwatched)).unwrap();
        let mut plain = DVector::zeros(structure.monomials.len());
        if c.is_finite() {
            for (value, monomial) in plain.iter_mut().zip(&structure.monomials) {
                let power = power(&Matrix3::identity(), &Vector3::zeros());
                *value = power.terms().iter().find(|term| term.0 == *monomial).map_or(0.0, |term| term.1);
            }
        }
        let printed = least_trace(&structure, objective.matrix(), (&points, false), margin, &plain);
        let difference = ours.objective / printed - 1.0;
        println!("c = {c}: {:.8}, as printed {printed:.8}, relative difference {difference:.1e}", ours.objective);
        assert!(difference.abs() < 2e-6);
        // What is asked for less is reached better.
        assert!(ours.objective < last * 0.999, "{} after {last}", ours.objective);
        last = ours.objective;
    }
}
