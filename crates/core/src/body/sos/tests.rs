use super::*;
use crate::body::{Aabb, Ball, Body, BodyFileError, Normalization, Provenance, Volume};
use crate::polynomial::{Exponents, Polynomial, SosGram, monomials};
use nalgebra::{DMatrix, Matrix3, Vector3};
use std::collections::BTreeMap;
use std::f64::consts::PI;
use sublevel_testkit::Seeded;

type Terms = BTreeMap<Exponents, f64>;

fn sum(parts: &[(f64, &Terms)]) -> Terms {
    let mut terms = Terms::new();
    for (factor, part) in parts {
        for (e, c) in *part {
            *terms.entry(*e).or_default() += factor * c;
        }
    }
    terms
}

fn linear(x: f64, y: f64, z: f64, constant: f64) -> Terms {
    Terms::from([([1, 0, 0], x), ([0, 1, 0], y), ([0, 0, 1], z), ([0; 3], constant)])
}

/// The set of `Σ squares + ε Σ m² <= level` over all monomials m of half the degree: a definite
/// Gram matrix, and hardly smaller.
fn set_of(squares: &[Terms], level: f64, epsilon: f64) -> SosBody {
    let degree = squares.iter().flatten().map(|(e, _)| e.iter().map(|&n| usize::from(n)).sum::<usize>()).max().unwrap();
    let basis = monomials(degree);
    let mut matrix = DMatrix::identity(basis.len(), basis.len()) * epsilon;
    for square in squares {
        let column = DMatrix::from_fn(basis.len(), 1, |i, _| square.get(&basis[i]).copied().unwrap_or(0.0));
        matrix += &column * column.transpose();
    }
    matrix /= level;
    let mut terms = Terms::new();
    for (i, a) in basis.iter().enumerate() {
        for (j, b) in basis.iter().enumerate() {
            *terms.entry(std::array::from_fn(|k| a[k] + b[k])).or_default() += matrix[(i, j)];
        }
    }
    let polynomial = Polynomial::new(terms.into_iter().collect()).unwrap();
    let gram = SosGram::nearest(&polynomial, basis, (&matrix + matrix.transpose()) * 0.5).unwrap();
    let normalization = Normalization { center: Vector3::new(0.2, 0.1, -0.3), linear: Matrix3::identity() };
    SosBody::new("set", normalization, polynomial, gram, None).unwrap()
}

/// `((x - 2)² + y² + z²)((x + 2)² + y² + z²) <= 1`: the two ovals of Cassini, turned about x.
fn cassini() -> SosBody {
    // a = 2: |v|⁴ - 8 (x² - y² - z²) + 16 = (|v|² - 4)² + 16 (y² + z²).
    let norm = Terms::from([([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0; 3], -4.0)]);
    set_of(&[norm, linear(0.0, 4.0, 0.0, 0.0), linear(0.0, 0.0, 4.0, 0.0)], 1.0, 1e-9)
}

/// The torus `(|v|² + 1 - r²)² <= 4 (x² + y²)` with tube radius r about the unit circle, as
/// `(|v|² - 1 - r²)² + 4 z² <= 4 r²`.
fn torus(r: f64) -> SosBody {
    let norm = Terms::from([([2, 0, 0], 1.0), ([0, 2, 0], 1.0), ([0, 0, 2], 1.0), ([0; 3], -1.0 - r * r)]);
    set_of(&[norm, linear(0.0, 0.0, 2.0, 0.0)], 4.0 * r * r, 1e-10)
}

#[test]
fn volumes_agree_with_closed_forms() {
    for r in [0.3, 0.6, 0.9] {
        let (body, truth) = (torus(r), 2.0 * PI * PI * r * r);
        let Volume { volume_m3, error_m3 } = body.volume();
        assert!((volume_m3 / truth - 1.0).abs() < 2e-3, "{r}: {volume_m3} {truth}");
        assert!((volume_m3 - truth).abs() < 10.0 * error_m3 + 1e-6, "{r}: {volume_m3} {truth} {error_m3}");
        // Along z it reaches r, across 1 + r; bounds are proven and close.
        let Aabb { min, max } = *body.bounding_box();
        let center = body.normalization().center;
        for (bound, reach) in [(max - center, 1.0), (center - min, 1.0)] {
            let truth = Vector3::new(1.0 + r, 1.0 + r, r) * reach;
            assert!(
                (0..3).all(|i| bound[i] >= truth[i] * (1.0 - 1e-8) && bound[i] < 1.02 * truth[i] + 0.02),
                "{bound}"
            );
        }
        let Ball { radius, .. } = *body.circumscribed();
        assert!(radius > 1.0 + r - 1e-6 && radius < 1.1 * (1.0 + r), "{radius}");
    }
    // y² + z² = √(16 x² + 1) - x² - 4 between x² = 4 ± 1, twice.
    let slices = 200_000;
    let area = |x: f64| PI * ((16.0 * x * x + 1.0).sqrt() - x * x - 4.0);
    let (from, to) = (3.0_f64.sqrt(), 5.0_f64.sqrt());
    let step = (to - from) / f64::from(slices);
    let truth = 2.0 * (0..slices).map(|i| area(from + (f64::from(i) + 0.5) * step)).sum::<f64>() * step;
    let body = cassini();
    let Volume { volume_m3, error_m3 } = body.volume();
    assert!((volume_m3 / truth - 1.0).abs() < 5e-3, "{volume_m3} {truth} {error_m3}");
    // Nothing of it is near its centre.
    assert!(body.value(&body.normalization().center) > 10.0 && body.value(body.interior_point()) < 0.5);
}

/// A random quartic with dents: brute force on a grid, and no point of the set outside its bounds.
#[test]
fn volumes_and_bounds_agree_with_a_grid() {
    for seed in 0..6 {
        let mut random = Seeded(seed);
        let mut quadratic = |constant: f64| {
            let list = monomials(2).into_iter().map(|e| (e, random.signed())).collect();
            sum(&[(1.0, &list), (1.0, &Terms::from([([0; 3], constant)]))])
        };
        let squares: Vec<Terms> = (0..6).map(|i| quadratic(if i == 0 { -1.0 } else { 0.0 })).collect();
        let body = set_of(&squares, 3.0, 1e-2);
        let Aabb { min, max } = *body.bounding_box();
        let (center, half) = ((min + max) * 0.5, (max - min) * 0.6);
        let cells = 90;
        let mut inside = 0;
        for i in 0..cells {
            for j in 0..cells {
                for k in 0..cells {
                    let share = Vector3::new(i, j, k).map(|n| (2.0 * f64::from(n) + 1.0) / f64::from(cells) - 1.0);
                    let x = center + half.component_mul(&share);
                    if body.value(&x) <= 1.0 {
                        inside += 1;
                        assert!((0..3).all(|i| x[i] >= min[i] && x[i] <= max[i]), "seed {seed}");
                        assert!((x - body.circumscribed().center).norm() <= body.circumscribed().radius);
                    }
                }
            }
        }
        let grid = f64::from(inside) * (half * (2.0 / f64::from(cells))).product();
        let volume = body.volume();
        assert!((volume.volume_m3 / grid - 1.0).abs() < 0.02, "seed {seed}: {volume:?} {grid}");
    }
}

#[test]
fn triangles_are_distinguished_although_all_points_are_inside() {
    let body = torus(0.5);
    let center = body.normalization().center;
    // Corners on the circle of the torus: a short triangle within the tube, and one across the
    // hole.
    let at = |angle: f64, r: f64| center + Vector3::new(angle.cos(), angle.sin(), 0.0) * r;
    let points = [at(0.0, 1.0), at(0.1, 1.1), at(0.2, 1.0), at(2.0, 1.0), at(4.0, 1.0)];
    assert!(body.prove_contains(&points).is_ok());
    let coverage = body.coverage(&points, &[[0, 1, 2], [0, 3, 4], [0, 0, 0]]).unwrap();
    assert_eq!((coverage.triangles, coverage.uncovered), (3, 1));
    let Uncovered { triangle, area_m2, value, value_upper } = coverage.largest.unwrap();
    assert_eq!((triangle, area_m2), (1, coverage.uncovered_area_m2));
    // At the centre of the hole p is ((1 + r²)² / 4 r²) = 1.5625.
    assert!(value > 1.55 && value <= value_upper && value_upper < 1.57, "{value} {value_upper}");
    assert_eq!(
        body.coverage(&points, &[[0, 1, 2], [0, 5, 1]]),
        Err(TriangleError { triangle: 1, vertex: 5, points: 5 })
    );
}

#[test]
fn files_are_read_back_and_reproven() {
    let points = [Vector3::new(1.2, 0.1, -0.3), Vector3::new(0.2, 1.1, -0.3)];
    let body = torus(0.5).with_points(&points).unwrap();
    let coverage = body.coverage(&points, &[[0, 1, 1]]).unwrap();
    let body = body.with_coverage(coverage).with_provenance(Provenance::default());
    let text = body.to_json();
    let again = SosBody::from_json(&text).unwrap();
    assert_eq!(again.to_json(), text);
    assert!(SosBody::is_file(&text) && again.id() == body.id() && again.points() == body.points());
    assert!(text.contains("\"points_only\": true") && text.contains("\"kind\": \"sos-body\""));
    // Where convexity is needed it is refused for what it is.
    assert_eq!(Body::from_json(&text).unwrap_err(), BodyFileError::NotConvex);
    let ball = Body::ball("b", Vector3::zeros(), 1.0).unwrap().to_json();
    assert!(!SosBody::is_file(&ball) && SosBody::from_json(&ball).is_err());

    let file: serde_json::Value = serde_json::from_str(&text).unwrap();
    let refused = |change: &dyn Fn(&mut serde_json::Value)| {
        let mut file = file.clone();
        change(&mut file);
        SosBody::from_json(&file.to_string()).unwrap_err().to_string()
    };
    assert!(refused(&|file| file["points_only"] = false.into()).contains("points_only"));
    assert!(refused(&|file| file["volume_m3"] = 4.0.into()).contains("volume_m3"));
    assert!(refused(&|file| file["polynomial"]["coefficients"][0] = 7.0.into()).contains("id"));
    assert!(refused(&|file| file["polynomial"]["certificate"]["gram"][0][0] = 7.0.into()).contains("polynomial"));
    assert!(refused(&|file| file["coverage"]["uncovered"] = 5.into()).contains("coverage"));
    assert!(refused(&|file| file["bounding_box"]["max_m"][0] = 1.0.into()).contains("bounding_box"));
    assert!(refused(&|file| file["circumscribed_ball"]["radius_m"] = 1.0.into()).contains("circumscribed_ball"));
}
