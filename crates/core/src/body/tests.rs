//! Laws of bodies: extents, proofs and files.

use super::*;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;
use sublevel_testkit::Seeded;

fn axes(random: &mut Seeded, aspect: f64) -> Vector3<f64> {
    Vector3::from_fn(|_, _| aspect.powf(0.5 * random.signed()))
}

#[test]
fn extents_of_exact_bodies_match_closed_forms() {
    for seed in 0..60 {
        let mut random = Seeded(seed);
        let scale = 10_f64.powi((seed % 7) as i32 * 3 - 9);
        let aspect = [1.0, 10.0, 1e3, 1e5][(seed % 4) as usize];
        let a = axes(&mut random, aspect) * scale;
        let center = Vector3::from_fn(|_, _| random.signed() * scale * 10.0);
        let degree = [2, 4, 6, 8][(seed / 4 % 4) as usize];
        let body = Body::superellipsoid("q", center, a, degree).unwrap_or_else(|e| panic!("seed {seed}: {e}"));
        let Aabb { min, max } = *body.bounding_box();
        for i in 0..3 {
            assert!(max[i] >= center[i] + a[i] * (1.0 - 1e-15), "seed {seed}");
            assert!(
                (max[i] - center[i] - a[i]).abs() < (1e-9 + 1e-13 * aspect) * a.max(),
                "seed {seed}: {} {}",
                max[i] - center[i],
                a[i]
            );
            assert!((center[i] - min[i] - a[i]).abs() < (1e-9 + 1e-13 * aspect) * a.max(), "seed {seed}");
        }
        if degree == 2 {
            assert!(
                body.circumscribed().radius >= a.max() && body.circumscribed().radius < 1.03 * a.max(),
                "seed {seed}"
            );
            assert!(
                body.in_radius() <= a.min() && body.in_radius() > 0.9 * a.min(),
                "seed {seed}: {}",
                body.in_radius() / a.min()
            );
            let exact = 4.0 / 3.0 * PI * a.product();
            assert!((body.volume().volume_m3 / exact - 1.0).abs() < 1e-9, "seed {seed}");
        }
    }
}

#[test]
fn the_smallest_value_is_bounded_from_both_sides() {
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let aspect = [1.0, 10.0, 1e3][(seed % 3) as usize];
        let a = axes(&mut random, aspect);
        let center = Vector3::from_fn(|_, _| random.signed());
        let bodies = [
            Body::superellipsoid("q", center, a, [2, 4, 6, 8][(seed / 3 % 4) as usize]).unwrap(),
            Body::cuboid("box", a).unwrap(),
            Body::cylinder("can", a.x, a.y).unwrap(),
        ];
        for body in bodies {
            // All have the minimum 0.
            let least = body.trust().least;
            assert!(least <= 0.0 && body.min_value() >= 0.0, "seed {seed} {}", body.name());
            assert!(
                body.min_value() - least <= 1e-9,
                "seed {seed} {}: {least:e} to {:e}",
                body.name(),
                body.min_value()
            );
        }
    }
}

#[test]
fn the_error_of_the_inverse_is_bounded() {
    for seed in 0..40 {
        let mut random = Seeded(seed);
        let a = axes(&mut random, 1e4);
        let rotation = nalgebra::UnitQuaternion::from_scaled_axis(Vector3::from_fn(|_, _| 3.0 * random.signed()));
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let linear = Matrix3::from_diagonal(&a.map(f64::recip)) * rotation.to_rotation_matrix().matrix();
        let normalization = Normalization { center: Vector3::zeros(), linear };
        let body = Body::new("turned", normalization, ball.constraints().to_vec()).unwrap();
        // The inverse of the exact product, up to the rounding of the matrices themselves.
        let exact = rotation.inverse().to_rotation_matrix().matrix() * Matrix3::from_diagonal(&a);
        let error = (body.inverse() - exact).norm();
        assert!(error <= body.trust().inverse_error + 1e-14 * a.amax() * 1e4, "seed {seed}: {error:e}");
        assert!(body.trust().inverse_error <= 1e-10 * body.trust().inverse_norm, "seed {seed}");
    }
}

#[test]
fn a_normalization_may_mirror() {
    let ellipsoid = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(1.0, 2.0, 0.5)).unwrap();
    let mut normalization = *ellipsoid.normalization();
    normalization.linear = -normalization.linear;
    let mirrored = Body::new("egg", normalization, ellipsoid.constraints().to_vec()).unwrap();
    assert!((mirrored.in_radius() - ellipsoid.in_radius()).abs() < 1e-12);
}

#[test]
fn boxes_and_cylinders_are_tight() {
    let h = Vector3::new(0.5, 1.0, 2.0);
    let body = Body::cuboid("box", h).unwrap();
    assert!((body.bounding_box().max - h).amax() < 1e-9 && (body.bounding_box().min + h).amax() < 1e-9);
    assert!((body.circumscribed().radius - h.norm()).abs() < 1e-8);
    assert!((body.volume().volume_m3 - 8.0).abs() < 0.05, "{:?}", body.volume());
    let body = Body::cylinder("can", 0.3, 0.7).unwrap();
    assert!((body.bounding_box().max - Vector3::new(0.3, 0.3, 0.7)).amax() < 1e-9);
    assert!((body.volume().volume_m3 / (PI * 0.09 * 1.4) - 1.0).abs() < 0.01);
    assert_eq!(body.constraints()[1].gram.basis().len(), 1);
    assert_eq!(body.constraints()[0].gram.basis().len(), 2);
}

#[test]
fn bounds_contain_the_body_in_every_direction() {
    for seed in 0..20 {
        let mut random = Seeded(100 + seed);
        let body = Body::superellipsoid("q", Vector3::new(1.0, 2.0, 3.0), axes(&mut random, 100.0), 4).unwrap();
        for _ in 0..500 {
            let u = Vector3::from_fn(|_, _| random.signed());
            let x = body.boundary_along(&u);
            assert!((body.value(&x) - 1.0).abs() < 1e-10, "seed {seed}");
            assert!((x - body.circumscribed().center).norm() <= body.circumscribed().radius * (1.0 + 1e-12));
            assert!((x - body.interior_point()).norm() >= body.in_radius() * (1.0 - 1e-12));
        }
    }
}

#[test]
fn mirrored_frames_make_the_same_body() {
    let body = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(0.3, 0.4, 0.5)).unwrap();
    let mut normalization = *body.normalization();
    normalization.linear.row_mut(0).neg_mut();
    let mirrored = Body::new("egg", normalization, body.constraints().to_vec()).unwrap();
    assert!((mirrored.in_radius() - body.in_radius()).abs() < 1e-12);
    assert!((mirrored.volume().volume_m3 - body.volume().volume_m3).abs() < 1e-12);
}

#[test]
fn open_flat_and_shallow_sets_are_refused() {
    let slab = |axis: usize| Body::cuboid("b", Vector3::repeat(1.0)).unwrap().constraints()[axis].clone();
    let unit = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() };
    let error = Body::new("open", unit, vec![slab(0), slab(1)]).unwrap_err();
    assert!(matches!(error, BodyError::Unbounded { .. }), "{error}");
    assert_eq!(Body::new("none", unit, vec![]).unwrap_err(), BodyError::ConstraintCount(0));
    assert_eq!(Body::new("many", unit, vec![slab(0); 17]).unwrap_err(), BodyError::ConstraintCount(17));
    let mut shallow = Body::ball("b", Vector3::zeros(), 1.0).unwrap().constraints()[0].clone();
    shallow.polynomial = shallow.polynomial.with_constant_shifted(1.0 - 1e-12);
    assert!(matches!(Body::new("shallow", unit, vec![shallow]), Err(BodyError::Interior { .. })));
    let flat = Normalization { linear: Matrix3::from_diagonal(&Vector3::new(1.0, 1.0, 0.0)), ..unit };
    assert!(matches!(Body::new("flat", flat, vec![slab(0)]), Err(BodyError::Normalization(_))));
    for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(Body::ball("b", Vector3::zeros(), radius).is_err());
    }
    assert!(matches!(Body::ball("", Vector3::zeros(), 1.0), Err(BodyError::Name(_))));
}

#[test]
fn overflowing_polynomials_are_refused() {
    let unit = Normalization { center: Vector3::zeros(), linear: Matrix3::identity() };
    let ball = Body::ball("b", Vector3::zeros(), 1.0).unwrap().constraints()[0].clone();
    for constant in [-1e307, -1e308, 1e308] {
        let mut deep = ball.clone();
        deep.polynomial = deep.polynomial.with_constant_shifted(constant);
        assert!(Body::new("deep", unit, vec![deep]).is_err(), "{constant:e}");
    }
}

#[test]
fn containment_is_proven_point_by_point() {
    let body = Body::ball("b", Vector3::zeros(), 2.0).unwrap();
    let inside = [Vector3::new(1.9, 0.0, 0.0), Vector3::new(0.0, -1.0, 1.0)];
    assert!(body.prove_contains(&inside).is_ok());
    let outside = [Vector3::zeros(), Vector3::new(2.0 + 1e-9, 0.0, 0.0), Vector3::new(0.0, 2.1, 0.0)];
    assert_eq!(body.prove_contains(&outside).unwrap_err().index, 2);
    assert!(body.prove_contains(&[Vector3::new(f64::NAN, 0.0, 0.0)]).is_err());
    assert!(body.prove_contains(&[Vector3::zeros(), Vector3::new(0.0, f64::NAN, 0.0), Vector3::zeros()]).is_err());
    let body = body.with_points(&inside).unwrap();
    assert_eq!(body.points().unwrap().count, 2);
}

#[test]
fn files_round_trip_exactly() {
    let bodies = [
        Body::ellipsoid("egg", Vector3::new(0.1, -2.0, 1e6), Vector3::new(0.3, 1.0 / 3.0, 1e-3)).unwrap(),
        Body::cuboid("box", Vector3::new(0.1, 0.2, 0.7)).unwrap().with_points(&[Vector3::zeros()]).unwrap(),
        Body::cylinder("can", 0.3, 1.1)
            .unwrap()
            .with_provenance(Provenance { input: "can.off".into(), ..Default::default() }),
        Body::superellipsoid("q8", Vector3::zeros(), Vector3::new(1.0, 2.0, 3.0), 8).unwrap(),
        Body::ball("off", Vector3::zeros(), 1.0)
            .unwrap()
            .with_growth_center(Vector3::new(0.1, 1.0 / 3.0, 0.0))
            .unwrap(),
    ];
    for body in bodies {
        let text = body.to_json();
        let read = Body::from_json(&text).unwrap_or_else(|e| panic!("{}: {e}", body.name()));
        assert_eq!(read.to_json(), text);
        assert_eq!(read.id(), body.id());
        assert_eq!(body.id().to_string().parse::<BodyId>().unwrap(), *body.id());
    }
}

#[test]
fn changed_files_are_refused_by_name() {
    let body = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(0.3, 0.4, 0.5)).unwrap();
    let body = body.with_points(&[Vector3::zeros()]).unwrap().with_provenance(Provenance::default());
    let text = body.to_json();
    let value: serde_json::Value = serde_json::from_str(&text).unwrap();
    let change = |pointer: &str, new: serde_json::Value| {
        let mut value = value.clone();
        *value.pointer_mut(pointer).unwrap_or_else(|| panic!("{pointer}")) = new;
        Body::from_json(&value.to_string()).unwrap_err().to_string()
    };
    let cases = [
        ("/format", "sublevel/9".into(), "format"),
        ("/kind", "ladder".into(), "kind"),
        ("/constraints/0/coefficients/0", 1.5.into(), "id"),
        ("/normalization/center/0", 0.1.into(), "id"),
        ("/constraints/0/certificate/gram/0/0", 5.0.into(), "constraints[0]"),
        ("/constraints/0/certificate/gram/0/0", (-2.0).into(), "constraints[0]"),
        ("/interior_point_m/0", 0.1.into(), "interior_point_m"),
        ("/min_value", 0.1.into(), "min_value"),
        ("/in_radius_m", 0.31.into(), "in_radius_m"),
        ("/circumscribed_ball/radius_m", 0.4.into(), "circumscribed_ball.radius_m"),
        ("/bounding_box/max_m/2", 0.4.into(), "bounding_box.max_m"),
        ("/volume_m3", 1.0.into(), "volume_m3"),
        ("/gap_m", (-1e-3).into(), "gap_m"),
        ("/gap_m", 3.0.into(), "gap_m"),
        ("/degree", 4.into(), "degree"),
        ("/constraints/0/exponents/0/0", 1.into(), "constraints[0]"),
        ("/name", "".into(), "name"),
        ("/contained_points/sha256", "zz\nproven".into(), "contained_points.sha256"),
        ("/contained_points/count", 0.into(), "contained_points.count"),
        ("/provenance/input", "\u{1b}[2J".into(), "provenance.input"),
        ("/provenance/hull_volume_m3", 7.0.into(), "provenance.hull_volume_m3"),
        ("/volume_m3", serde_json::Value::Null, "not a body file"),
    ];
    for (pointer, new, expected) in cases {
        let message = change(pointer, new);
        assert!(message.contains(expected), "{pointer}: {message}");
    }
    for length in [0, 1, text.len() / 2, text.len() - 3] {
        assert!(matches!(Body::from_json(&text[..length]), Err(BodyFileError::Json(_))));
    }
}

#[test]
fn growth_centers_lie_inside_and_are_part_of_the_identity() {
    let body = Body::cuboid("box", Vector3::new(1.0, 2.0, 3.0)).unwrap();
    assert_eq!(body.growth_ball(), Ball { center: *body.interior_point(), radius: body.in_radius() });
    assert!(!body.to_json().contains("growth_center_m"));
    let moved = body.clone().with_growth_center(Vector3::new(0.5, 0.0, 0.0)).unwrap();
    assert_ne!(moved.id(), body.id());
    let ball = moved.growth_ball();
    assert!(ball.center.x == 0.5 && ball.radius <= 0.5 && ball.radius > 0.4, "{ball:?}");
    for bad in [Vector3::new(1.1, 0.0, 0.0), Vector3::repeat(f64::NAN), Vector3::new(0.0, f64::INFINITY, 0.0)] {
        let error = body.clone().with_growth_center(bad).unwrap_err();
        assert!(matches!(error, BodyError::GrowthCenter { .. }), "{error}");
    }
    let text = moved.to_json().replace("\"growth_center_m\": [0.5", "\"growth_center_m\": [0.25");
    assert!(matches!(Body::from_json(&text), Err(BodyFileError::Derived { field: "id", .. })), "{text}");
}

/// A depth of ten times the least is enough, a tenth of it is not.
#[test]
fn a_body_needs_a_depth_above_rounding() {
    let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
    let Constraint { polynomial, gram } = ball.constraints()[0].clone();
    let of_depth = |depth: f64| {
        let polynomial = polynomial.with_constant_shifted(1.0 - depth);
        Body::new("shallow", *ball.normalization(), vec![Constraint { polynomial, gram: gram.clone() }])
    };
    assert!(of_depth(1e-8).is_ok());
    assert!(matches!(of_depth(1e-10), Err(BodyError::Interior { .. })));
}

/// Another machine's rounding passes, a change does not.
#[test]
fn stored_values_may_differ_by_rounding_only() {
    let body = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(0.3, 0.4, 0.5)).unwrap();
    let stored = |factor: f64| {
        let mut value: serde_json::Value = serde_json::from_str(&body.to_json()).unwrap();
        value["volume_m3"] = (body.volume().volume_m3 * factor).into();
        Body::from_json(&value.to_string())
    };
    assert!(stored(1.0 + 2e-8).is_ok());
    assert!(matches!(stored(1.0 + 5e-7), Err(BodyFileError::Derived { field: "volume_m3", .. })));
}

#[test]
fn the_ball_of_the_bounds_is_little_larger_than_the_body() {
    let radius = Body::ball("ball", Vector3::zeros(), 2.0).unwrap().trust().radius;
    assert!((1.03..1.12).contains(&radius), "{radius}");
}

#[test]
fn tangent_heights_are_bounds_from_any_point_and_close_at_support_points() {
    let half = Vector3::new(0.3, 1.0, 0.6);
    for (seed, degree) in [(1, 2), (2, 4), (3, 6), (4, 8)] {
        let body = Body::superellipsoid("q", Vector3::new(0.5, -1.0, 2.0), half, degree).unwrap();
        let mut seeded = Seeded(seed);
        for case in 0..500 {
            let n = seeded.unit();
            let support = body.support(&n);
            let reached = n.dot(&(support.point - body.interior_point()));
            // The only constraint's gradient is along n there: λ = 1/|∇g|, by central differences.
            let slope = (body.value(&(support.point + n * 1e-6)) - body.value(&(support.point - n * 1e-6))) / 2e-6;
            let close = body.tangent_height(&n, &support.point, [(0, 1.0 / slope)]);
            assert!(close >= reached && close <= reached + 1e-6, "degree {degree}, case {case}: {close} {reached}");
            let (point, multipliers) = body.support_multipliers(&n);
            assert_eq!((point, multipliers.len()), (support.point, 1));
            let proven = body.tangent_height(&n, &point, multipliers);
            assert!(proven >= reached && proven <= reached + 1e-9, "degree {degree}, case {case}: {proven} {reached}");
            let anywhere = support.point + seeded.unit() * seeded.between(1e-9, 1.0);
            let far = body.tangent_height(&n, &anywhere, [(0, seeded.between(1e-6, 10.0) / slope)]);
            assert!(far >= reached, "degree {degree}, case {case}: {far} below {reached}");
            for wrong in [[(0, -1.0)], [(0, f64::NAN)], [(1, 1.0)]] {
                assert_eq!(body.tangent_height(&n, &support.point, wrong), f64::INFINITY);
            }
            let nowhere = Vector3::new(f64::NAN, 0.0, 0.0);
            assert_eq!(body.tangent_height(&n, &nowhere, [(0, 1.0)]), f64::INFINITY);
        }
    }
}
