//! The boundary as seen from the interior point: radii along rays, an inscribed ball, the volume.

use super::Constraint;
use super::placement::Placement;
use super::sphere::Sphere;
use crate::polynomial::Polynomial;
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;

/// Distance from the interior point `start` along `direction` to the boundary, all in the
/// normalized frame: the smallest root of `g_i = 1` over the constraints. Infinite where no
/// constraint bounds the ray.
pub(super) fn radius(constraints: &[Constraint], start: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    constraints
        .iter()
        .fold(f64::INFINITY, |smallest, c| smallest.min(radius_within(&c.polynomial, start, direction, smallest)))
}

/// How far the boundary of one convex polynomial, `p = 1`, is from a point inside along a
/// direction; normalized frame, unit-free.
pub fn boundary_radius(polynomial: &Polynomial, start: &Vector3<f64>, direction: &Vector3<f64>) -> f64 {
    radius_within(polynomial, start, direction, f64::INFINITY)
}

/// Distance from `start`, where the convex `polynomial` is below 1, along `direction` to where it
/// is 1; infinite if that is nowhere, or not below `smallest`.
///
/// The polynomial is convex along the ray and below 1 at its start, so Newton's method lands
/// outside at once and then decreases monotonically to the root. Its first guess takes it for a
/// pure power of the distance.
fn radius_within(polynomial: &Polynomial, start: &Vector3<f64>, direction: &Vector3<f64>, smallest: f64) -> f64 {
    let along = |r: f64| {
        let jet = polynomial.evaluate(&(start + direction * r));
        (jet.value - 1.0, jet.gradient.dot(direction))
    };
    let unit = smallest.min(1.0);
    let (excess, _) = along(unit);
    let depth = 1.0 - polynomial.evaluate(start).value;
    let mut r = unit * (depth / (excess + depth)).max(1e-16).powf(1.0 / polynomial.degree() as f64);
    let mut outside = false;
    for _ in 0..200 {
        let (excess, slope) = along(r);
        if outside && excess <= 0.0 {
            // Only rounding brings the descent from outside to the other side.
            break;
        }
        outside = excess >= 0.0;
        if excess < 0.0 && r >= smallest.min(1e9) {
            // Another constraint is met first, or none bounds the ray.
            return f64::INFINITY;
        }
        let next = if slope > 0.0 { (r - excess / slope).min(4.0 * r) } else { 4.0 * r };
        if !next.is_finite() || (next - r).abs() <= 4e-16 * r || outside && next >= r {
            break;
        }
        r = next;
    }
    r
}

/// Points proven to lie in the body, close to its boundary, one per direction of the shared sphere.
pub(super) fn proven_boundary(
    constraints: &[Constraint],
    placement: &Placement,
    inverse: &Matrix3<f64>,
    interior: &Vector3<f64>,
) -> Vec<Vector3<f64>> {
    let start = placement.linear() * (interior - placement.origin());
    let inside = |x: &Vector3<f64>| constraints.iter().all(|c| placement.sample(c, x).value_upper(0.0) <= 1.0);
    Sphere::shared()
        .vertices()
        .iter()
        .map(|u| {
            let ray = inverse * u * radius(constraints, &start, u);
            // Pulled in by the rounding; the interior point itself is inside.
            let mut pull = 1e-15;
            loop {
                let x = interior + ray * (1.0 - pull);
                if inside(&x) {
                    return x;
                }
                if pull >= 0.5 {
                    return *interior;
                }
                pull *= 4.0;
            }
        })
        .collect()
}

/// Radius of a ball about the interior point inside the body: the body contains the tetrahedra that
/// the interior point spans with the triangles of its proven boundary points.
///
/// `mirrored` states that the map from directions to boundary points reverses orientation.
pub(super) fn in_radius(boundary: &[Vector3<f64>], interior: &Vector3<f64>, mirrored: bool) -> f64 {
    let outward = if mirrored { -1.0 } else { 1.0 };
    let size = interior.norm() + boundary.iter().map(Vector3::norm).fold(0.0, f64::max);
    let smallest = Sphere::shared()
        .triangles()
        .iter()
        .map(|&[a, b, c]| {
            let (ab, ac) = (boundary[b] - boundary[a], boundary[c] - boundary[a]);
            let normal = ab.cross(&ac);
            // Sharp triangles lose digits of their normal.
            let slack = 64.0 * f64::EPSILON * size * (1.0 + ab.norm() * ac.norm() / normal.norm());
            outward * normal.dot(&(boundary[a] - interior)) / normal.norm() - slack
        })
        .fold(f64::INFINITY, |least, value| if value.is_nan() || value < least { value } else { least });
    smallest * (1.0 - 1e-13)
}

/// Volume in cubic metres and an estimate of its quadrature error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Volume {
    /// Volume, m³.
    pub volume_m3: f64,
    /// Difference to the rule of half the resolution, m³.
    pub error_m3: f64,
}

/// `V = ⅓ ∫ r(u)³ du / |det L|` over the unit sphere of the normalized frame about the interior
/// point.
pub(super) fn volume(constraints: &[Constraint], linear: &Matrix3<f64>, start: &Vector3<f64>) -> Volume {
    let scale = 1.0 / linear.determinant().abs();
    let rule = |rings: usize| {
        sphere_rule(rings).map(|(u, weight)| weight * radius(constraints, start, &u).powi(3)).sum::<f64>() / 3.0 * scale
    };
    let (fine, coarse) = (rule(40), rule(20));
    Volume { volume_m3: fine, error_m3: (fine - coarse).abs() }
}

/// Nodes and weights of a rule for the unit sphere: `rings` by Gauss and Legendre, 2 `rings`
/// sectors each. Weights add up to 4π.
pub fn sphere_rule(rings: usize) -> impl Iterator<Item = (Vector3<f64>, f64)> {
    let sectors = 2 * rings;
    gauss_legendre(rings).into_iter().flat_map(move |(cosine, weight)| {
        let sine = (1.0 - cosine * cosine).sqrt();
        (0..sectors).map(move |k| {
            let angle = PI * (2 * k + 1) as f64 / sectors as f64;
            (Vector3::new(sine * angle.cos(), sine * angle.sin(), cosine), weight * 2.0 * PI / sectors as f64)
        })
    })
}

/// Nodes and weights of the Gauss-Legendre rule on [-1, 1] (Newton on the Legendre polynomial).
fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            for _ in 0..100 {
                let (mut previous, mut value) = (1.0, x);
                for k in 2..=n {
                    let k = k as f64;
                    (previous, value) = (value, ((2.0 * k - 1.0) * x * value - (k - 1.0) * previous) / k);
                }
                slope = n as f64 * (x * value - previous) / (x * x - 1.0);
                let step = value / slope;
                x -= step;
                if step.abs() < 1e-15 {
                    break;
                }
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}
