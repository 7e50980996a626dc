use super::basis::Affine;
use super::ellipsoid::minimum_ellipsoid;
use super::generate::generate;
use super::program::Problem;
use super::progress::Watch;
use super::structure::Structure;
use super::*;
use nalgebra::{DMatrix, DVector, Matrix3, Rotation3};
use sublevel_core::polynomial::Polynomial;

mod cones;
pub(super) mod primal;
mod sos;

pub(super) fn unwatched(_: Progress) -> ControlFlow<()> {
    ControlFlow::Continue(())
}

fn fitted(points: &[Vector3<f64>], degree: usize) -> Fit {
    fit("test", points, &FitOptions { degree, ..FitOptions::default() }, &mut unwatched).unwrap()
}

/// A lopsided blob: points on a sphere with bumps.
fn blob(count: usize) -> Vec<Vector3<f64>> {
    (0..count)
        .map(|i| {
            let (height, turn) = (1.0 - (2 * i + 1) as f64 / count as f64, i as f64 * 2.399_963);
            let r = (1.0 - height * height).sqrt();
            let u = Vector3::new(r * turn.cos(), r * turn.sin(), height);
            u * (1.0 + 0.3 * (3.0 * u.x + 1.0).sin() * u.y) + Vector3::new(0.0, 0.0, 0.4 * u.x * u.x)
        })
        .collect()
}

fn cube(side: f64) -> Vec<Vector3<f64>> {
    (0..8_usize).map(|i| Vector3::from_fn(|axis, _| side * (((i >> axis) & 1) as f64 - 0.5))).collect()
}

#[test]
fn degree_two_is_the_smallest_ellipsoid() {
    let points = blob(300);
    let fit = fitted(&points, 2);
    // -log det prefers the representation 1/4 + 3/4 |z|² of the unit ball
    for (exponents, coefficient) in fit.body.constraints()[0].polynomial.terms() {
        let expected = match exponents.map(u32::from).iter().sum::<u32>() {
            0 => 0.25,
            2 if exponents.contains(&2) => 0.75,
            _ => 0.0,
        };
        assert!((coefficient - expected).abs() < 1e-5, "{exponents:?}: {coefficient}");
    }
    let ellipsoid = minimum_ellipsoid(&points).unwrap();
    assert!((fit.report.volume_m3 / ellipsoid.volume() - 1.0).abs() < 1e-5);
    assert!(fit.report.optimality_gap.unwrap().abs() < 1e-6);
}

#[test]
fn fits_follow_affine_maps() {
    let points = blob(200);
    let turn = Rotation3::from_euler_angles(0.4, -1.1, 2.0).into_inner();
    let map = turn * Matrix3::new(2.0, 0.3, 0.0, 0.0, 0.5, -0.2, 0.1, 0.0, 4.0);
    let moved: Vec<_> = points.iter().map(|p| map * p + Vector3::new(3.0, -50.0, 7.0)).collect();
    for (degree, objective) in [(4, Objective::LogDetP), (6, Objective::LogDetP), (4, Objective::LogDetH)] {
        let options = FitOptions { degree, objective, ..FitOptions::default() };
        let of = |points: &[Vector3<f64>]| fit("test", points, &options, &mut unwatched).unwrap();
        let (first, second) = (of(&points), of(&moved));
        let ratio = second.report.volume_m3 / first.report.volume_m3 / map.determinant().abs();
        // the margin is imposed in a frame that a rotation is free in, hence not exact
        assert!((ratio - 1.0).abs() < 1e-4, "degree {degree}: {ratio}");
        for (p, q) in points.iter().zip(&moved).step_by(7) {
            assert!((first.body.value(p) - second.body.value(q)).abs() < 1e-3);
        }
    }
}

#[test]
fn higher_degrees_are_smaller_and_never_below_the_hull() {
    let points = blob(250);
    let mut last = f64::INFINITY;
    for degree in [2, 4, 6] {
        let Fit { body, report, .. } = fitted(&points, degree);
        assert!(report.volume_m3 < last && report.volume_m3 > report.hull_volume_m3);
        assert!(body.prove_contains(&points).is_ok());
        assert_eq!((report.points, body.degree()), (points.len(), degree));
        // pulled tight: some point is on the boundary
        let highest = points.iter().map(|p| body.value_upper(p)).fold(0.0, f64::max);
        assert!(highest > 1.0 - 1e-13, "{highest}");
        last = report.volume_m3;
    }
}

/// Feasibility, weak duality and a small gap together prove the optimum, each checked without the
/// solver.
#[test]
fn the_optimum_is_feasible_and_its_bound_holds() {
    let points = blob(150);
    let hull = hull::convex_hull(&points).unwrap();
    let conditioned: Vec<_> = hull.vertices.iter().map(|&i| hull.frame.apply(&points[i])).collect();
    let ellipsoid = minimum_ellipsoid(&conditioned).unwrap();
    let whitened: Vec<_> = conditioned.iter().map(|u| ellipsoid.linear * (u - ellipsoid.center)).collect();
    let margin = 1e-4;
    for degree in [4, 6] {
        let structure = Structure::new(degree);
        let unit = Affine { linear: Matrix3::identity(), offset: Vector3::zeros() };
        let problem = Problem::new(&structure, Objective::LogDetP, &unit, margin);
        let optimum = generate(&problem, &whitened, &[], &mut Watch::new(&mut unwatched)).unwrap();
        assert!(optimum.gap.unwrap().abs() < 1e-5);
        assert!(optimum.hessian.symmetric_eigenvalues().min() > 0.5 * margin);
        for z in &whitened {
            assert!(structure.values(z).dot(&optimum.coefficients) < 1.0 + 1e-5);
        }
        let terms = structure.monomials.iter().copied().zip(optimum.coefficients.iter().copied()).collect();
        let polynomial = Polynomial::new(terms).unwrap();
        for (z, y) in whitened.iter().zip(whitened.iter().skip(5)) {
            let w = DVector::from_iterator(
                structure.hessian.size,
                structure.hessian_basis.iter().map(|m| {
                    (0..3).map(|i| z[i].powi(i32::from(m.exponents[i]))).product::<f64>() * y[usize::from(m.direction)]
                }),
            );
            let (left, right) = (y.dot(&(polynomial.evaluate(z).hessian * y)), w.dot(&(&optimum.hessian * &w)));
            assert!((left - right).abs() < 1e-5 * left.abs().max(1.0), "{left} {right}");
        }
        // -log det P at the optimum, against a feasible polynomial Σ wⱼ |z|²ʲ with its diagonal
        // Gram matrix
        let objective = optimum.objective;
        let mut simple = f64::INFINITY;
        for share in [0.2, 0.4, 0.6] {
            let parts = degree / 2 + 1;
            let gram = DMatrix::from_diagonal(&DVector::from_iterator(
                structure.gram.size,
                sublevel_core::polynomial::monomials(degree / 2).iter().map(|e| {
                    let total: u8 = e.iter().sum();
                    let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
                    let multinomial = factorial(total) / e.iter().map(|&n| factorial(n)).product::<f64>();
                    let weight = if total == 0 { share } else { (1.0 - share) / (parts - 1) as f64 };
                    weight * multinomial
                }),
            ));
            simple = simple.min(-spectral::log_det(&gram).unwrap());
        }
        assert!(objective < simple, "{objective} against {simple}");
    }
}

/// Every objective at every degree it has: optimal by its own gap, proven, and least among all
/// bodies in its own measure.
#[test]
fn objectives_are_optimal_and_proven() {
    let points = blob(150);
    for objective in Objective::ALL {
        for degree in [2, 4, 6] {
            let options = FitOptions { degree, objective, ..FitOptions::default() };
            let Fit { body, report, .. } = fit("test", &points, &options, &mut unwatched).unwrap();
            assert!(report.optimality_gap.unwrap().abs() <= 1e-5 * report.objective_value.abs().max(1.0), "{report:?}");
            assert!(body.prove_contains(&points).is_ok());
            assert!(report.volume_m3 > report.hull_volume_m3);
            assert_eq!(body.provenance().unwrap().objective, objective.name());
        }
    }
    let options = FitOptions { degree: 8, objective: Objective::TraceH, ..FitOptions::default() };
    let error = fit("test", &points, &options, &mut unwatched).unwrap_err();
    assert_eq!(error, FitError::Objective { objective: Objective::TraceH, degree: 8 });
}

/// At degree 2 with p a sum of squares, `tr H⁻¹` is half the sum of the squared semi-axes of the
/// ellipsoid, and `log det H` its volume: closed forms for a cuboid's corners a, where the least
/// sum of squares is (Σ aᵢ)².
#[test]
fn hessian_objectives_at_degree_two_have_closed_forms() {
    let half = Vector3::new(1.0, 2.0, 0.5);
    let corners: Vec<_> = cube(2.0).iter().map(|c| c.component_mul(&half)).collect();
    let fitted = |objective| {
        let options = FitOptions { degree: 2, objective, ..FitOptions::default() };
        fit("test", &corners, &options, &mut unwatched).unwrap().report
    };
    let trace = fitted(Objective::TraceH);
    // in the unit frame lengths are in units of the half diagonal
    let expected = half.sum().powi(2) / half.norm_squared() / 2.0;
    assert!((trace.objective_value / expected - 1.0).abs() < 1e-6, "{} {expected}", trace.objective_value);
    let volume = 4.0 / 3.0 * std::f64::consts::PI * 27_f64.sqrt() * half.product();
    assert!((fitted(Objective::LogDetH).volume_m3 / volume - 1.0).abs() < 1e-5);
}

#[test]
fn barrier_derivatives_agree_with_differences() {
    let structure = Structure::new(4);
    let points = blob(90);
    let mean = points.iter().map(|x| structure.values(x) / 90.0).sum::<DVector<f64>>();
    let other = points.iter().take(40).map(|x| structure.values(x) / 40.0).sum::<DVector<f64>>();
    let direction = &other - &mean;
    let barrier = barrier::Barrier { pattern: &structure.gram, weight: 3.0 };
    let at = |t: f64| &mean + &direction * t;
    let value = |t: f64| barrier.value(&at(t)).unwrap();
    let slope = |t: f64| -barrier.derivatives(&at(t)).unwrap().0.dot(&direction);
    let step = 1e-5;
    let difference = (value(step) - value(-step)) / (2.0 * step);
    assert!((difference / slope(0.0) - 1.0).abs() < 1e-6, "{difference} {}", slope(0.0));
    let curvature = barrier.derivatives(&at(0.0)).unwrap().1;
    let second = (slope(step) - slope(-step)) / (2.0 * step);
    assert!((direction.dot(&(&curvature * &direction)) / second - 1.0).abs() < 1e-6);
}

#[test]
fn the_gradient_of_the_volume_agrees_with_differences() {
    let structure = Structure::new(4);
    // |z|⁴ moved and squeezed, plus lower terms
    let mut coefficients = DVector::zeros(structure.monomials.len());
    for (value, e) in coefficients.iter_mut().zip(&structure.monomials) {
        *value = match e.iter().sum::<u8>() {
            4 if e.iter().all(|n| n % 2 == 0) => {
                if e.contains(&4) {
                    1.0
                } else {
                    2.0
                }
            }
            2 if e.contains(&2) => 0.3,
            1 => 0.05,
            _ => 0.0,
        };
    }
    let center = Vector3::new(0.05, -0.02, 0.01);
    let at = |c: &DVector<f64>| volume::volume(&volume::polynomial(&structure, c).unwrap(), &center);
    let p = volume::polynomial(&structure, &coefficients).unwrap();
    let expansion = volume::expansion(&structure, &p, &center);
    assert!((expansion.volume / at(&coefficients) - 1.0).abs() < 1e-12);
    for i in 0..coefficients.len() {
        let mut step = DVector::zeros(coefficients.len());
        step[i] = 1e-5;
        let difference = (at(&(&coefficients + &step)) - at(&(&coefficients - &step))) / 2e-5;
        assert!((difference - expansion.gradient[i]).abs() < 1e-7, "{i}: {difference} {}", expansion.gradient[i]);
    }
    // the ball |z|⁴ <= 1 has 4π/3, and scaled by 1 + ε in p the second derivative of (1 + ε)^(-3/4)
    // times it
    let ball =
        coefficients.map_with_location(|i, _, c| if structure.monomials[i].iter().sum::<u8>() == 4 { c } else { 0.0 });
    let p = volume::polynomial(&structure, &ball).unwrap();
    let expansion = volume::expansion(&structure, &p, &Vector3::zeros());
    let whole = 4.0 / 3.0 * std::f64::consts::PI;
    assert!((expansion.volume / whole - 1.0).abs() < 1e-12);
    assert!((ball.dot(&expansion.gradient) / (-0.75 * whole) - 1.0).abs() < 1e-12);
    assert!((ball.dot(&(&expansion.curvature * &ball)) / (0.75 * 1.75 * whole) - 1.0).abs() < 1e-12);
}

#[test]
fn refinement_is_monotone_contains_the_points_and_is_proven() {
    let points = blob(150);
    for degree in [4, 6] {
        let start = fitted(&points, degree);
        let options = FitOptions { degree, refine: true, ..FitOptions::default() };
        let Fit { body, report, .. } = fit("test", &points, &options, &mut unwatched).unwrap();
        assert!(report.refinement_m3.len() > 1 && report.refinement_m3.windows(2).all(|v| v[1] < v[0]), "{report:?}");
        assert!(report.volume_m3 < start.report.volume_m3 && report.volume_m3 > report.hull_volume_m3);
        // two quadratures of the same set
        let last = report.refinement_m3.last().unwrap();
        assert!((report.volume_m3 / last - 1.0).abs() < 1e-4, "{} {last}", report.volume_m3);
        assert_eq!(report.refinement_end, Some(RefinementEnd::Converged));
        assert!(body.prove_contains(&points).is_ok() && body.min_value().abs() < 1e-6, "{}", body.min_value());
        let again = Body::from_json(&body.to_json()).unwrap();
        assert!(again.provenance().unwrap().refined);
    }
}

#[test]
fn refits_of_a_stream_take_fewer_steps_and_end_where_fits_do() {
    let shape = blob(300);
    let (mut again, mut on) = (0, 0);
    let mut last: Option<Fit> = None;
    for frame in 0..8 {
        // It bends and swells a little from frame to frame.
        let t = 0.02 * f64::from(frame);
        let points: Vec<_> = shape.iter().map(|x| x * (1.0 + 0.5 * t) + Vector3::x() * (t * x.y * x.y)).collect();
        // The other solver is given all points at once.
        let options = FitOptions { degree: 4, solver: Some(Solver::Structured), ..FitOptions::default() };
        let fit = super::fit("test", &points, &options, &mut unwatched).unwrap();
        let previous = last.as_ref().unwrap_or(&fit);
        let refit = refit(&previous.body, &points, &options, &mut unwatched).unwrap();
        refit.body.prove_contains(&points).unwrap();
        let ratio = refit.report.volume_m3 / fit.report.volume_m3;
        assert!((ratio - 1.0).abs() < 1e-4, "frame {frame}: {ratio}");
        again += fit.report.iterations;
        on += refit.report.iterations;
        last = Some(refit);
    }
    println!("{again} steps again, {on} from the body before");
    assert!(on < again * 3 / 4, "{on} {again}");
    // A body that has nothing to do with the points does no harm.
    let elsewhere = fitted(&cube(1.0), 2);
    let options = FitOptions { degree: 4, ..FitOptions::default() };
    let far: Vec<_> = shape.iter().map(|x| x + Vector3::repeat(100.0)).collect();
    refit(&elsewhere.body, &far, &options, &mut unwatched).unwrap().body.prove_contains(&far).unwrap();
}

/// More vertices than clarabel is given at once.
#[test]
fn many_vertices_come_in_by_rounds() {
    let points = blob(2500);
    let [clarabel, structured] = Solver::ALL.map(|solver| {
        let options = FitOptions { degree: 4, solver: Some(solver), ..FitOptions::default() };
        fit("test", &points, &options, &mut unwatched).unwrap().report
    });
    assert!(clarabel.hull_vertices > 1000 && clarabel.rounds > 1, "{clarabel:?}");
    assert!((clarabel.objective_value - structured.objective_value).abs() < 1e-5);
    assert!((clarabel.volume_m3 / structured.volume_m3 - 1.0).abs() < 1e-5);
}

#[test]
fn both_solvers_are_tried_unless_one_is_asked_for() {
    let points = blob(60);
    let structure = Structure::new(4);
    let unit = Affine { linear: Matrix3::identity(), offset: Vector3::zeros() };
    // A margin of no meaning: H cannot be definite by it while p is at most 1 at the points.
    let problem = Problem::new(&structure, Objective::LogDetP, &unit, 1e3);
    let failed = generate(&problem, &points, &[], &mut Watch::new(&mut unwatched)).unwrap_err();
    let FitError::Unsolved(Unsolved { degree: 4, failures, is_solver_fixed: false }) = &failed else {
        panic!("{failed}")
    };
    assert_eq!(
        failures.iter().map(|failure| failure.solver).collect::<Vec<_>>(),
        [Solver::Clarabel, Solver::Structured]
    );
    let text = failed.to_string();
    println!("{text}");
    // The program also has points inside of the hull.
    let count = points.len() + 2 * structure.gram.size;
    let start = format!("clarabel did not solve the program of degree 4 on {count} points: ");
    assert!(text.starts_with(&start), "{text}");
    assert!(text.contains("; structured did not on ") && text.contains("; lower the degree, or "), "{text}");
    let problem = Problem::new(&structure, Objective::LogDetP, &unit, 1e-5);
    assert_eq!(problem.solvers(), [Solver::Clarabel, Solver::Structured]);
    assert_eq!(Problem { solver: Some(Solver::Structured), ..problem.clone() }.solvers(), [Solver::Structured]);
    let eighth = Structure::new(8);
    let problem = Problem::new(&eighth, Objective::LogDetP, &unit, 1e-5);
    assert_eq!(problem.solvers(), [Solver::Structured, Solver::Clarabel]);
    assert_eq!(Problem::new(&eighth, Objective::TraceP, &unit, 1e-5).solvers(), [Solver::Clarabel]);
}

#[test]
fn few_points_and_points_on_quadrics() {
    // the smallest ellipsoid of a tetrahedron has 8.162 times its volume
    let tetrahedron = [Vector3::zeros(), Vector3::x(), Vector3::y(), Vector3::z()];
    for degree in [2, 4, 6] {
        let fit = fitted(&tetrahedron, degree);
        assert!(fit.report.volume_m3 > 1.0 / 6.0 && fit.report.volume_m3 < 1.361);
        let fit = fitted(&cube(2.0), degree);
        assert!(fit.report.volume_m3 > 8.0 && fit.report.volume_m3 < 22.0, "{}", fit.report.volume_m3);
    }
}

#[test]
fn scale_offset_and_duplicates_do_not_matter() {
    let points = blob(120);
    let volume = fitted(&points, 4).report.volume_m3;
    for (scale, offset) in [(1e-6, 0.0), (1e6, 0.0), (1.0, 1e6), (1e-3, -20.0)] {
        let moved: Vec<_> =
            points.iter().chain(&points).map(|p| p * scale + Vector3::new(offset, 0.5 * offset, -offset)).collect();
        let fit = fitted(&moved, 4);
        let relative = fit.report.volume_m3 / scale.powi(3) / volume;
        assert!((relative - 1.0).abs() < 1e-4, "scale {scale}, offset {offset}: {relative}");
        assert_eq!(fit.body.points().map(|p| p.count), Some(240));
    }
}

#[test]
fn a_thin_sheet_is_fitted() {
    let sheet: Vec<_> = cube(1.0).iter().map(|p| Vector3::new(p.x, p.y, 1e-4 * p.z)).collect();
    let fit = fitted(&sheet, 4);
    assert!(fit.report.volume_m3 > 1e-4 && fit.report.volume_m3 < 2.72e-4, "{}", fit.report.volume_m3);
}

#[test]
fn bad_input_is_refused_by_field() {
    let good = blob(50);
    let attempt = |points: &[Vector3<f64>], degree, margin| {
        let options = FitOptions { degree, margin, ..FitOptions::default() };
        fit("test", points, &options, &mut unwatched).expect_err("bad input must be refused")
    };
    for degree in [0, 1, 3, 7, 10, usize::MAX] {
        let error = attempt(&good, degree, 1e-5);
        assert_eq!(error, FitError::Degree(degree));
        assert!(error.to_string().contains("degree") && error.to_string().contains("2, 4, 6, 8"));
    }
    for margin in [0.0, -1.0, 0.5] {
        assert_eq!(attempt(&good, 4, margin), FitError::Margin(margin));
    }
    assert!(matches!(attempt(&good, 4, f64::NAN), FitError::Margin(_)));
    assert_eq!(attempt(&good[..3], 4, 1e-5), FitError::TooFewPoints(3));
    let mut broken = good.clone();
    broken[17].y = f64::NAN;
    assert_eq!(attempt(&broken, 4, 1e-5), FitError::NotFinite(17));
    let flat: Vec<_> = good.iter().map(|p| Vector3::new(p.x, p.y, 0.2 * p.x + p.y)).collect();
    let error = attempt(&flat, 4, 1e-5).to_string();
    assert!(error.contains("coplanar") && error.contains("thickness"), "{error}");
    let line: Vec<_> = (0..40).map(|i| Vector3::new(1.0, 0.1, 7.0) * f64::from(i)).collect();
    assert!(attempt(&line, 4, 1e-5).to_string().contains("collinear"));
    assert!(attempt(&[good[0]; 9], 4, 1e-5).to_string().contains("coincident"));
}

#[test]
fn progress_is_reported_and_can_stop_the_fit_anywhere() {
    let points = blob(100);
    let options = FitOptions { degree: 4, refine: true, ..FitOptions::default() };
    let stopping_after = |limit: usize| {
        let mut heard = Vec::new();
        let result = fit("test", &points, &options, &mut |progress| {
            heard.push(progress);
            if heard.len() == limit { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
        (result, heard)
    };
    let (whole, heard) = stopping_after(usize::MAX);
    let report = whole.unwrap().report;
    assert_eq!((report.iterations, report.rounds), (heard.len(), heard.last().unwrap().round));
    assert!(heard.windows(2).all(|pair| pair[1].iterations == pair[0].iterations + 1));
    // at the start, amid the objective, amid the refinement, at the end
    for limit in [1, 10, heard.len() - 5, heard.len()] {
        let (stopped, heard) = stopping_after(limit);
        assert_eq!(stopped.err(), Some(FitError::Cancelled));
        assert_eq!(heard.len(), limit, "nothing goes on after it was asked to stop");
    }
}
