//! Fits over the smaller cones, and their programs against clarabel's answers to the same programs
//! stated otherwise: with the whole matrix H in the variables, and dominance as sums of magnitudes
//! or of blocks with entries of their own.

use super::*;
use crate::descent::ModelProgram;
use crate::dominance::Dominance;
use crate::model::Model;
use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use sublevel_testkit::Seeded;

fn over(points: &[Vector3<f64>], degree: usize, cone: Cone) -> Result<Fit, FitError> {
    fit("test", points, &FitOptions { degree, cone, ..FitOptions::default() }, &mut unwatched)
}

#[test]
fn volumes_grow_from_cone_to_cone_and_all_bodies_are_proven() {
    let points = blob(150);
    for degree in [2, 4, 6, 8] {
        let mut last = 0.0;
        if degree < 8 {
            let options = FitOptions { degree, refine: true, ..FitOptions::default() };
            last = fit("test", &points, &options, &mut unwatched).unwrap().report.volume_m3;
        }
        for cone in [Cone::Sdsos, Cone::Dsos] {
            let Fit { body, report, .. } = over(&points, degree, cone).unwrap();
            println!("degree {degree}, {cone}: {} m³ after {last}, {:?}", report.volume_m3, report.refinement_m3);
            // each within a few thousandths of its least volume
            assert!(report.volume_m3 > 0.995 * last && report.volume_m3 > report.hull_volume_m3);
            assert!(report.refinement_m3.windows(2).all(|v| v[1] < v[0]), "{report:?}");
            assert!((report.volume_m3 / report.refinement_m3.last().unwrap() - 1.0).abs() < 1e-3);
            assert_eq!((report.optimality_gap, report.cone, body.degree()), (None, cone, degree));
            let again = Body::from_json(&body.to_json()).unwrap();
            assert!(again.prove_contains(&points).is_ok());
            assert_eq!(again.provenance().unwrap().objective, format!("volume, {cone}"));
            assert!(!again.provenance().unwrap().refined);
            last = report.volume_m3;
        }
    }
}

#[test]
fn degree_two_over_any_cone_is_the_smallest_ellipsoid() {
    let points = blob(300);
    let ellipsoid = minimum_ellipsoid(&points).unwrap().volume();
    for cone in Cone::ALL {
        let volume = over(&points, 2, cone).unwrap().report.volume_m3;
        // in the whitened frame its Gram matrix is diagonal
        assert!((volume / ellipsoid - 1.0).abs() < 1e-3, "{cone}: {volume} {ellipsoid}");
    }
}

#[test]
fn few_thin_and_flat_points_are_bodies_or_errors() {
    let tetrahedron = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    let sheet: Vec<_> = cube(1.0).iter().map(|p| Vector3::new(p.x, p.y, 1e-4 * p.z)).collect();
    let far: Vec<_> = blob(120).iter().map(|p| p * 1e-3 + Vector3::new(-20.0, 7.0, 3.0)).collect();
    let flat: Vec<_> = blob(50).iter().map(|p| Vector3::new(p.x, p.y, 0.2 * p.x + p.y)).collect();
    for cone in [Cone::Sdsos, Cone::Dsos] {
        for degree in [2, 4, 6, 8] {
            for (points, most) in [(&tetrahedron[..], 8.17), (&cube(2.0), 2.73), (&sheet, 2.73), (&far, 3.0)] {
                let report = over(points, degree, cone).unwrap().report;
                let ratio = report.volume_m3 / report.hull_volume_m3;
                assert!(ratio > 1.0 && ratio < most, "{cone}, degree {degree}, {} points: {ratio}", points.len());
            }
        }
        assert!(matches!(over(&flat, 4, cone), Err(FitError::Hull(HullError::Flat { .. }))));
        assert_eq!(over(&tetrahedron[..3], 4, cone).unwrap_err(), FitError::TooFewPoints(3));
    }
}

#[test]
fn other_objectives_and_refinement_are_refused() {
    let points = blob(50);
    let cone = Cone::Sdsos;
    for options in [
        FitOptions { cone, objective: Objective::TraceP, ..FitOptions::default() },
        FitOptions { cone, refine: true, ..FitOptions::default() },
    ] {
        let error = fit("test", &points, &options, &mut unwatched).unwrap_err();
        assert_eq!(error, FitError::Cone(cone));
        assert!(error.to_string().contains("sdsos") && error.to_string().contains("refinement"), "{error}");
    }
}

#[test]
fn a_descent_can_be_stopped() {
    let options = FitOptions { degree: 4, cone: Cone::Dsos, ..FitOptions::default() };
    for limit in [1, 10, 30] {
        let mut heard = 0;
        let result = fit("test", &blob(100), &options, &mut |_| {
            heard += 1;
            if heard == limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        assert_eq!((result.err(), heard), (Some(FitError::Cancelled), limit));
    }
}

/// `A x + s = b`, s in a product of cones, row by row.
#[derive(Default)]
struct Rows {
    at: (Vec<usize>, Vec<usize>, Vec<f64>),
    right: Vec<f64>,
    cones: Vec<SupportedConeT<f64>>,
}

impl Rows {
    fn row(&mut self, entries: impl IntoIterator<Item = (usize, f64)>, right: f64) {
        for (column, value) in entries {
            self.at.0.push(self.right.len());
            self.at.1.push(column);
            self.at.2.push(value);
        }
        self.right.push(right);
    }
}

/// The least `½ cᵀBc + q·c` by clarabel over c, the upper triangle of H, and what dominance needs
/// besides.
fn least(
    structure: &Structure,
    cone: Cone,
    values: &DMatrix<f64>,
    margin: f64,
    (curvature, linear): (&DMatrix<f64>, &DVector<f64>),
) -> f64 {
    let (count, size) = (structure.monomials.len(), structure.hessian.size);
    let entry = |i: usize, j: usize| count + i.max(j) * (i.max(j) + 1) / 2 + i.min(j);
    let mut columns = count + size * (size + 1) / 2;
    let mut rows = Rows::default();
    // D c - collapse(H) = 0
    let mut sums: Vec<Vec<(usize, f64)>> = structure.derivative.iter().map(|&(m, f)| vec![(m, f)]).collect();
    for i in 0..size {
        for j in 0..=i {
            sums[structure.hessian.key(i, j)].push((entry(i, j), if i == j { -1.0 } else { -2.0 }));
        }
    }
    sums.into_iter().for_each(|sum| rows.row(sum, 0.0));
    rows.cones.push(SupportedConeT::ZeroConeT(structure.hessian.keys));
    for x in values.column_iter() {
        rows.row(x.iter().copied().enumerate(), 1.0);
    }
    rows.cones.push(SupportedConeT::NonnegativeConeT(values.ncols()));
    let pairs: Vec<(usize, usize)> = (0..size).flat_map(|i| (0..i).map(move |j| (i, j))).collect();
    if cone == Cone::Dsos {
        // a_ij >= |h_ij| and h_ii - ε >= Σ_j a_ij
        let magnitude = |i: usize, j: usize| columns + i.max(j) * (i.max(j) - 1) / 2 + i.min(j);
        for &(i, j) in &pairs {
            rows.row([(magnitude(i, j), -1.0), (entry(i, j), 1.0)], 0.0);
            rows.row([(magnitude(i, j), -1.0), (entry(i, j), -1.0)], 0.0);
        }
        for i in 0..size {
            let others = (0..size).filter(|&j| j != i).map(|j| (magnitude(i, j), 1.0));
            rows.row(others.chain([(entry(i, i), -1.0)]), -margin);
        }
        rows.cones.push(SupportedConeT::NonnegativeConeT(2 * pairs.len() + size));
        columns += pairs.len();
    } else {
        // h_ii - ε = Σ_j m_ij, with (m_ij, m_ji, h_ij) a semidefinite block: m_ij + m_ji >= |(m_ij
        // - m_ji, 2 h_ij)|
        let share = |i: usize, j: usize| columns + i * size + j;
        for i in 0..size {
            let others = (0..size).filter(|&j| j != i).map(|j| (share(i, j), 1.0));
            rows.row(others.chain([(entry(i, i), -1.0)]), -margin);
        }
        rows.cones.push(SupportedConeT::ZeroConeT(size));
        for &(i, j) in &pairs {
            rows.row([(share(i, j), -1.0), (share(j, i), -1.0)], 0.0);
            rows.row([(share(i, j), -1.0), (share(j, i), 1.0)], 0.0);
            rows.row([(entry(i, j), -2.0)], 0.0);
            rows.cones.push(SupportedConeT::SecondOrderConeT(3));
        }
        columns += size * size;
    }
    let triangle: Vec<_> = (0..count).flat_map(|j| (0..=j).map(move |i| (i, j))).collect();
    let quadratic = CscMatrix::new_from_triplets(
        columns,
        columns,
        triangle.iter().map(|&(i, _)| i).collect(),
        triangle.iter().map(|&(_, j)| j).collect(),
        triangle.iter().map(|&(i, j)| curvature[(i, j)]).collect(),
    );
    let (at_rows, at_columns, entries) = rows.at;
    let matrix = CscMatrix::new_from_triplets(rows.right.len(), columns, at_rows, at_columns, entries);
    let linear: Vec<f64> = (0..columns).map(|i| if i < count { linear[i] } else { 0.0 }).collect();
    let _alone = crate::conic_program::alone();
    let settings = DefaultSettings { verbose: false, max_threads: 1, ..DefaultSettings::default() };
    let mut solver = DefaultSolver::new(&quadratic, &linear, &matrix, &rows.right, &rows.cones, settings).unwrap();
    solver.solve();
    assert_eq!(solver.solution.status, SolverStatus::Solved);
    solver.solution.obj_val
}

/// Random models around points that are at times few: the same least values, and matrices that are
/// in the cones.
#[test]
fn programs_agree_with_another_statement() {
    let mut random = Seeded(31);
    let margin = 1e-4;
    for degree in [2, 4, 6] {
        let structure = Structure::new(degree);
        let count = structure.monomials.len();
        for (cone, points) in
            [(Cone::Sdsos, blob(60)), (Cone::Dsos, blob(60)), (Cone::Sdsos, cube(1.1)), (Cone::Dsos, cube(1.1))]
        {
            let columns: Vec<_> = points.iter().map(|x| structure.values(&(x * 0.7))).collect();
            let values = DMatrix::from_columns(&columns);
            // A slope that rewards large values at random points, as that of a volume does.
            let seen: Vec<_> =
                (0..3 * count).map(|_| structure.values(&Vector3::from_fn(|_, _| random.signed()))).collect();
            let seen = DMatrix::from_columns(&seen);
            let slope = &seen * DVector::from_fn(seen.ncols(), |_, _| -1.0 - random.signed());
            let curvature = &seen * seen.transpose() + DMatrix::identity(count, count) * 1e-3;
            let origin = DVector::from_fn(count, |_, _| 0.3 * random.signed());
            let linear = &slope - &curvature * &origin;
            let model = Model::new(origin.clone(), slope, curvature.clone()).unwrap();
            let dominance = Dominance::new(&structure, cone);
            let program =
                ModelProgram { dominance: &dominance, structure: &structure, values: &values, margin, model: &model };
            let scale = 1.0 + linear.norm();
            let found = program.minimise(1.0, &mut Watch::new(&mut unwatched)).unwrap().unwrap();
            let value = |c: &DVector<f64>| 0.5 * c.dot(&(&curvature * c)) + linear.dot(c);
            let expected = least(&structure, cone, &values, margin, (&curvature, &linear));
            let difference = (value(&found.coefficients) - expected) / scale;
            println!("{cone}, degree {degree}, {} points: {expected}, {difference:.1e} of {scale:.0}", points.len());
            assert!(difference.abs() < 1e-6, "{difference}");
            // what was found is feasible
            assert!(values.tr_mul(&found.coefficients).max() < 1.0 + 1e-8);
            let form = structure.derivative_matrix() * &found.coefficients;
            let error = structure.hessian.collapse(&found.hessian) - &form;
            assert!(error.amax() < 1e-7 * (1.0 + form.amax()), "{}", error.amax());
            assert!(found.hessian.symmetric_eigenvalues().min() > 0.99 * margin);
            if cone == Cone::Dsos {
                for (i, row) in found.hessian.row_iter().enumerate() {
                    let others = row.iter().map(|h| h.abs()).sum::<f64>() - row[i].abs();
                    assert!(row[i] - others > 0.99 * margin, "row {i}: {} {others}", row[i]);
                }
            }
        }
    }
}
