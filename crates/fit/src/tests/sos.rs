//! Sets that need not be convex.

use super::*;
use sublevel_core::body::{SosBody, Volume};
use sublevel_core::polynomial::{NormPower, Polynomial};

fn options(degree: usize, method: SosMethod) -> SosOptions {
    SosOptions { degree, method, coordinates: Coordinates::Unit, solver: None, input: String::new() }
}

fn relaxed(degree: usize, c: f64) -> SosOptions {
    options(degree, SosMethod::Relaxed { c, objective: Objective::LogDetP })
}

fn fitted(points: &[Vector3<f64>], options: &SosOptions) -> SosFit {
    fit_sos("test", points, &[], options, &mut unwatched).unwrap()
}

/// A bent tube: three quarters of a ring, as thick as a third of its radius.
fn ring(count: usize) -> Vec<Vector3<f64>> {
    (0..count)
        .map(|i| {
            let (along, around) = (4.7 * i as f64 / count as f64, i as f64 * 2.399_963);
            let r = 1.0 + 0.3 * around.cos();
            Vector3::new(r * along.cos(), r * along.sin(), 0.3 * around.sin()) * 2.0 + Vector3::new(5.0, -3.0, 1.0)
        })
        .collect()
}

#[test]
fn sets_are_tighter_the_less_convexity_is_asked_for() {
    let points = ring(600);
    for degree in [4, 6] {
        let convex = super::fitted(&points, degree).report;
        let mut last = convex.volume_m3;
        for c in [1.0, 10.0, 100.0, f64::INFINITY] {
            let SosFit { body, report } = fitted(&points, &relaxed(degree, c));
            let Volume { volume_m3, .. } = body.volume();
            println!("degree {degree}, c = {c}: {volume_m3:.4} m³, {:?}", report.program);
            assert!(volume_m3 < last, "degree {degree}, c {c}: {volume_m3} after {last}");
            last = volume_m3;
            assert!(body.prove_contains(&points).is_ok() && body.points().is_some());
            assert_eq!(body.relaxation().map(|relaxation| relaxation.c), c.is_finite().then_some(c));
            let program = report.program.unwrap();
            assert!(program.optimality_gap.abs() <= 1e-5 * program.objective_value.abs().max(1.0));
            // Some point is at the level but for the room that is left.
            let highest = points.iter().map(|p| body.value_upper(p)).fold(0.0, f64::max);
            assert!(highest <= 1.0 - 0.9e-9 && highest > 1.0 - 1.1e-9, "{highest}");
            assert_eq!(SosBody::from_json(&body.to_json()).unwrap().to_json(), body.to_json());
        }
        assert!(last < report_hull(&points), "the hull of a ring is larger than a set that follows it");
    }
}

fn report_hull(points: &[Vector3<f64>]) -> f64 {
    fitted(points, &options(2, SosMethod::InverseMoment)).report.hull_volume_m3
}

/// The relaxation that a set claims is one: the Hessian of the sum bends down nowhere; and claims
/// for less fail.
#[test]
fn a_relaxation_holds_for_its_c_and_no_other() {
    let points = ring(400);
    let body = fitted(&points, &relaxed(4, 10.0)).body;
    let relaxation = body.relaxation().unwrap().clone();
    let power = NormPower::new(relaxation.c, &relaxation.linear, &relaxation.offset, 4);
    let sum = |polynomial: &Polynomial| {
        let mut terms: std::collections::BTreeMap<_, _> = polynomial.terms().iter().copied().collect();
        power.terms().iter().for_each(|(e, value, _)| *terms.entry(*e).or_insert(0.0) += value);
        Polynomial::new(terms.into_iter().collect()).unwrap()
    };
    let whole = sum(body.polynomial());
    let least = |p: &Polynomial, z: &Vector3<f64>| p.evaluate(z).hessian.symmetric_eigenvalues().min();
    let mut bent = f64::INFINITY;
    for z in points.iter().map(|x| body.normalization().linear * (x - body.normalization().center)) {
        for shrink in [0.2, 0.6, 1.0, 1.5] {
            assert!(least(&whole, &(z * shrink)) > -1e-9);
            bent = bent.min(least(body.polynomial(), &(z * shrink)));
        }
    }
    assert!(bent < -0.1, "the set makes use of its freedom: {bent}");
    // In the unit frame the farthest point has norm 1, and the mean is 0.
    let units: Vec<_> = points
        .iter()
        .map(|x| {
            relaxation.linear * (body.normalization().linear * (x - body.normalization().center)) + relaxation.offset
        })
        .collect();
    assert!((units.iter().map(Vector3::norm).fold(0.0, f64::max) - 1.0).abs() < 1e-12);
    assert!((units.iter().sum::<Vector3<f64>>() / 400.0).norm() < 1e-12);
    for c in [9.9, 10.1, 0.0, f64::NAN] {
        let claimed = sublevel_core::body::Relaxation { c, ..relaxation.clone() };
        let made =
            SosBody::new("test", *body.normalization(), body.polynomial().clone(), body.gram().clone(), Some(claimed));
        assert!(made.is_err(), "{c}");
    }
}

/// At degree 2 without convexity `log det P` is the volume all the same: P ≻ 0 makes p convex. And
/// any c > 0 changes nothing.
#[test]
fn degree_two_is_the_smallest_ellipsoid() {
    let points = blob(300);
    let truth = minimum_ellipsoid(&points).unwrap().volume();
    for c in [3.0, f64::INFINITY] {
        let volume = fitted(&points, &relaxed(2, c)).body.volume().volume_m3;
        assert!((volume / truth - 1.0).abs() < 1e-4, "{c}: {volume} {truth}");
    }
}

/// Without convexity the program is that of the smallest ellipsoid about 0 in the space of
/// monomials: at the optimum the largest of the values `m(x)ᵀ P m(x)` is 1, and weights that add up
/// to the number of monomials average to P⁻¹ (Kiefer and Wolfowitz, 1960).
#[test]
fn without_convexity_it_is_the_optimal_design() {
    let points = blob(200);
    let ellipsoid = minimum_ellipsoid(&points).unwrap();
    let whitened: Vec<_> = points.iter().map(|u| ellipsoid.linear * (u - ellipsoid.center)).collect();
    for degree in [4, 6] {
        let structure = Structure::without_convexity(degree);
        let identity = Affine { linear: Matrix3::identity(), offset: Vector3::zeros() };
        let problem = Problem::new(&structure, Objective::LogDetP, &identity, 1e-5);
        let optimum = generate(&problem, &whitened, &[], &mut Watch::new(&mut unwatched)).unwrap();
        // Titterington's iteration w <- w m(x)ᵀ M⁻¹ m(x) / N for the dual, which only ever
        // improves.
        let n = structure.gram.size as f64;
        let mut weights = DVector::repeat(points.len(), 1.0 / points.len() as f64);
        let values: Vec<_> = whitened.iter().map(|z| structure.values(z)).collect();
        let mut log_det = f64::NEG_INFINITY;
        for _ in 0..20_000 {
            let mean = values.iter().zip(weights.iter()).map(|(v, w)| v * *w).sum::<DVector<f64>>();
            let matrix = structure.gram.spread(&mean);
            log_det = spectral::log_det(&matrix).unwrap();
            let coefficients = structure.gram.collapse(&matrix.try_inverse().unwrap());
            weights.iter_mut().zip(&values).for_each(|(w, v)| *w *= v.dot(&coefficients) / n);
        }
        // -log det P at P = M⁻¹/N.
        let truth = log_det + n * n.ln();
        assert!((optimum.objective - truth).abs() < 1e-3, "degree {degree}: {} {truth}", optimum.objective);
        assert!(optimum.objective >= truth - 2e-5);
    }
}

#[test]
fn inverse_moments_have_closed_forms_and_follow_affine_maps() {
    // Points of a sphere and its centre: M = diag(1, s, s, s) with s = share/3; p = 1 + 3
    // |x|²/share, at most 1 + 3/share.
    let mut points: Vec<_> = cube(2.0 / 3.0_f64.sqrt());
    points.extend([Vector3::zeros(); 8]);
    let body = fitted(&points, &options(2, SosMethod::InverseMoment)).body;
    let share = 0.5;
    for x in [Vector3::new(0.3, -0.2, 0.9), Vector3::zeros(), Vector3::x()] {
        let truth = (1.0 + 3.0 * x.norm_squared() / share) / (1.0 + 3.0 / share);
        assert!((body.value(&x) - truth).abs() < 1e-8, "{} {truth}", body.value(&x));
    }
    assert!((body.volume().volume_m3 / (4.0 / 3.0 * std::f64::consts::PI) - 1.0).abs() < 1e-6);

    let points = ring(500);
    let map = Matrix3::new(2.0, 0.3, 0.0, 0.0, 0.5, -0.2, 0.1, 0.0, 4.0);
    let moved: Vec<_> = points.iter().map(|p| map * p + Vector3::new(3.0, -50.0, 7.0)).collect();
    for degree in [2, 4, 6] {
        let of = |points: &[Vector3<f64>]| fitted(points, &options(degree, SosMethod::InverseMoment)).body;
        let (first, second) = (of(&points), of(&moved));
        assert!(first.prove_contains(&points).is_ok() && first.relaxation().is_none());
        for (p, q) in points.iter().zip(&moved) {
            assert!((first.value(p) - second.value(q)).abs() < 1e-6);
        }
        let ratio = second.volume().volume_m3 / first.volume().volume_m3 / map.determinant();
        assert!((ratio - 1.0).abs() < 2e-3, "degree {degree}: {ratio}");
    }
}

#[test]
fn units_and_place_do_not_matter_in_the_unit_frame_but_in_the_raw_one() {
    let points = ring(300);
    let moved: Vec<_> = points.iter().map(|p| p * 1e-3 + Vector3::new(0.5, 0.0, -2.0)).collect();
    for objective in [Objective::LogDetP, Objective::TraceP] {
        let volume = |points: &[Vector3<f64>], coordinates| {
            let method = SosMethod::Relaxed { c: 10.0, objective };
            fitted(points, &SosOptions { coordinates, ..options(4, method) }).body.volume().volume_m3
        };
        let (here, there) = (volume(&points, Coordinates::Unit), volume(&moved, Coordinates::Unit));
        assert!((there * 1e9 / here - 1.0).abs() < 1e-3, "{objective}: {here} {there}");
        // A few metres from the origin |x|⁴ lets everything bend; in the unit frame 10 of it do
        // not. Traces change for other reasons, too.
        let raw = volume(&points, Coordinates::Raw);
        assert!(objective == Objective::TraceP || raw < 0.97 * here, "{objective}: {raw} {here}");
    }
}

#[test]
fn bad_input_is_refused_by_field() {
    let points = ring(100);
    let attempt = |points: &[Vector3<f64>], options: &SosOptions| {
        fit_sos("test", points, &[], options, &mut unwatched).expect_err("bad input must be refused")
    };
    for c in [0.0, -1.0] {
        assert_eq!(attempt(&points, &relaxed(4, c)), FitError::Relaxation(c));
    }
    assert!(matches!(attempt(&points, &relaxed(4, f64::NAN)), FitError::Relaxation(_)));
    assert_eq!(attempt(&points, &relaxed(5, 1.0)), FitError::Degree(5));
    let method = SosMethod::Relaxed { c: 1.0, objective: Objective::LogDetH };
    assert_eq!(attempt(&points, &options(4, method)), FitError::RelaxedObjective(Objective::LogDetH));
    let error = fit_sos("test", &points, &[[0, 1, 100]], &relaxed(2, 1.0), &mut unwatched).unwrap_err();
    assert!(error.to_string().contains("triangle 0"), "{error}");
    // A cube's corners are too few at degree 4; a sphere is a surface of degree 2.
    let flat: Vec<_> = points.iter().map(|p| Vector3::new(p.x, p.y, 0.2 * p.x + p.y)).collect();
    let sphere: Vec<_> = blob(200).iter().map(Vector3::normalize).collect();
    for method in [SosMethod::InverseMoment, relaxed(4, f64::INFINITY).method] {
        let error = attempt(&cube(1.0), &options(4, method));
        assert!(matches!(error, FitError::Span { degree: 4, rank: 7, monomials: 10 }), "{error}");
        assert!(matches!(attempt(&sphere, &options(4, method)), FitError::Span { rank: 9, .. }));
        assert!(matches!(attempt(&flat, &options(2, method)), FitError::Hull(_)));
        assert_eq!(attempt(&points[..3], &options(2, method)), FitError::TooFewPoints(3));
    }
    // With convexity bounded a sphere is no obstacle.
    let body = fitted(&sphere, &relaxed(4, 1.0)).body;
    assert!(body.volume().volume_m3 < 4.3, "{:?}", body.volume());
}

#[test]
fn progress_can_stop_the_fit() {
    let result = fit_sos("test", &ring(200), &[], &relaxed(4, 10.0), &mut |progress| {
        if progress.iterations == 12 { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    assert_eq!(result.err(), Some(FitError::Cancelled));
}
