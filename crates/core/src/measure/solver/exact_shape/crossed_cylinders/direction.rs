//! The overlap of two cylinders along a direction, and how it changes nearby.
//!
//! The difference of the cylinders has, where its outward normal is n, a surface whose radius of
//! curvature in the direction of a tangent τ is
//!
//! ```text
//! ρ(n, τ) = Σ r (a · (n × τ))² / |n × a|³,
//! ```
//!
//! and kinks of f add to it. On the great circle from m along the tangent τ, f is after the angle s
//!
//! ```text
//! f = f(m) cos s + f'(m; τ) sin s + ∫₀ˢ ρ(σ) sin(s - σ) dσ.
//! ```
//!
//! `n × τ` is the same all along it, and `|n × a|` up to the angle β at most `sin(α + β)`, α the
//! acute angle between m and the axis, or 1 from π/2 on. So ρ is at least λ, the smaller eigenvalue
//! of the quadratic form
//! `Σ r (a · (m × τ))² / sin³(α + β)` of unit tangents τ, whose determinant is
//! `r r' ((a × a') · m)² / (sin(α + β) sin(α' + β))³`, and
//!
//! ```text
//! f >= λ + (f(m) - λ) cos s - |∇f(m)| sin s.
//! ```

use super::pair::CrossedCylinders;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Sine of the angle with an axis, up to which a direction counts as along it: what rounding leaves
/// of directions along it.
///
/// Larger, caps would be taken for rims; smaller, the side of the axis is chosen by rounding.
/// Exercised by `no_direction_overlaps_by_less`.
pub(super) const ON_AXIS: f64 = gamma(8);

/// A unit vector, and what is known of the overlap along it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Direction {
    pub(super) n: Vector3<f64>,
    /// Cosines and sines of the angles with the axes.
    pub(super) cosines: [f64; 2],
    pub(super) sines: [f64; 2],
    /// By how much the cylinders overlap, metres.
    pub(super) overlap: f64,
    /// A point of the difference, seen from t, that is farthest along n, metres: along any other
    /// unit vector m they overlap by at least `m · point`.
    pub(super) point: Vector3<f64>,
    /// Its part across n: the gradient of f, metres per radian, at a kink one of its subgradients.
    pub(super) gradient: Vector3<f64>,
}

/// Cosine and sine of an angle below π/2.
pub(super) type Angle = [f64; 2];

/// No angle.
pub(super) const HERE: Angle = [1.0, 0.0];

impl CrossedCylinders {
    /// What is known of the overlap along a unit vector.
    pub(super) fn along(&self, n: Vector3<f64>) -> Direction {
        let cosines = self.axes.map(|axis| axis.dot(&n));
        let mut sines = [0.0; 2];
        let mut point = -self.between;
        let mut overlap = -self.between.dot(&n);
        for (i, axis) in self.axes.iter().enumerate() {
            let (radius, half_height) = (self.radii[i], self.half_heights[i]);
            let across = n - axis * cosines[i];
            sines[i] = across.norm();
            overlap += radius * sines[i] + half_height * cosines[i].abs();
            point += axis * half_height.copysign(cosines[i]);
            // Along the axis any point of the cap will do.
            if sines[i] > ON_AXIS {
                let radial = across / sines[i];
                // Divided, what rounding has left along the axis counts.
                point += (radial - axis * axis.dot(&radial)) * radius;
            }
        }
        Direction { n, cosines, sines, overlap, point, gradient: point - n * point.dot(&n) }
    }

    /// `r / sin³(α + β)` of both, metres: the least of `r / |n × a|³` up to an angle.
    fn weights(&self, direction: &Direction, [cosine, sine]: Angle) -> [f64; 2] {
        [0, 1].map(|i| {
            let (along, across) = (direction.cosines[i].abs(), direction.sines[i]);
            let is_acute = along * cosine > across * sine;
            let farthest = if is_acute { (across * cosine + along * sine).min(1.0) } else { 1.0 };
            self.radii[i] / (farthest * farthest * farthest)
        })
    }

    /// Lower bound of the radius of curvature along all tangents up to an angle, metres: λ.
    pub(super) fn curvature(&self, direction: &Direction, angle: Angle) -> f64 {
        let [first, second] = self.weights(direction, angle);
        let raised = self.sine * direction.n.z;
        let determinant = first * second * raised * raised;
        let [a, b] = direction.sines;
        let trace = first * a * a + second * b * b;
        let larger = 0.5 * (trace + (trace * trace - 4.0 * determinant).max(0.0).sqrt());
        if larger > 0.0 { determinant / larger } else { 0.0 }
    }

    /// That quadratic form, metres, for tangents `e cos ω + f sin ω`, `f = n × e`: the factors of
    /// `cos² ω`, `2 cos ω sin ω` and `sin² ω`.
    pub(super) fn form(&self, direction: &Direction, (e, f): (&Vector3<f64>, &Vector3<f64>), angle: Angle) -> [f64; 3] {
        let mut form = [0.0; 3];
        for (axis, weight) in self.axes.iter().zip(self.weights(direction, angle)) {
            let (u, v) = (axis.dot(e), axis.dot(f));
            form[0] += weight * v * v;
            form[1] -= weight * u * v;
            form[2] += weight * u * u;
        }
        form
    }

    /// Lower bound of the overlap along directions up to an angle, metres.
    pub(super) fn bound(&self, direction: &Direction, [cosine, sine]: Angle) -> f64 {
        let slope = direction.gradient.norm();
        // A larger curvature would cancel more digits.
        let curvature = self.curvature(direction, [cosine, sine]);
        let curvature = if curvature > 0.0 { curvature.min(4.0 * (direction.overlap.abs() + slope)) } else { 0.0 };
        let bent = curvature - direction.overlap;
        if bent * sine > slope * cosine {
            curvature - (bent * bent + slope * slope).sqrt()
        } else {
            curvature - bent * cosine - slope * sine
        }
    }
}

/// Unit vectors e and `n × e` across a unit vector n.
pub(super) fn tangents(n: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let other = if n.x.abs() < 0.6 { Vector3::x() } else { Vector3::y() };
    let e = n.cross(&other).normalize();
    (e, n.cross(&e))
}
