//! Volume of a union of convex bodies, which may overlap.
//!
//! Each point counts once, shared by the m(x) parts that it lies in:
//!
//! ```text
//! V = Σ_parts ∫_part dx / m(x) = Σ_parts ⅓ ∫ r(u)³ E[1 / m] du,
//! ```
//!
//! the mean E along the ray in direction u from the part's interior point, taken evenly in the cube
//! of the distance.

use super::radial::{Volume, radius, sphere_rule};
use super::{Aabb, Body, Compound};
use nalgebra::Vector3;

/// Points along a ray.
const UNION_RAY_POINTS: usize = 16;

/// Rings of rays.
const UNION_RINGS: usize = 24;

impl Compound {
    /// Volume of the union by quadrature: where parts overlap counts once. The overlaps' boundaries
    /// cost it accuracy, which the estimate of its error includes.
    pub fn volume(&self) -> Volume {
        let rule = |rings: usize| (0..self.parts().len()).map(|part| share(self.parts(), part, rings)).sum::<f64>();
        let (fine, coarse) = (rule(UNION_RINGS), rule(UNION_RINGS / 2));
        Volume { volume_m3: fine, error_m3: (fine - coarse).abs() }
    }
}

/// The volume that one part adds, m³.
fn share(parts: &[Body], part: usize, rings: usize) -> f64 {
    let body = &parts[part];
    let start = body.normalization().linear * (body.interior_point() - body.normalization().center);
    let others: Vec<_> = (0..parts.len()).filter(|&other| other != part).map(|other| &parts[other]).collect();
    let near: Vec<_> = others.into_iter().filter(|other| meet(body.bounding_box(), other.bounding_box())).collect();
    let along = |(u, weight): (Vector3<f64>, f64)| {
        let r = radius(body.constraints(), &start, &u);
        let ray = body.inverse() * u * r;
        let share = |step: usize| {
            let x = body.interior_point() + ray * ((step as f64 + 0.5) / UNION_RAY_POINTS as f64).cbrt();
            let holders =
                near.iter().filter(|other| inside(other.bounding_box(), &x) && other.value(&x) <= 1.0).count();
            1.0 / (1 + holders) as f64
        };
        weight * r.powi(3) / 3.0 * (0..UNION_RAY_POINTS).map(share).sum::<f64>() / UNION_RAY_POINTS as f64
    };
    sphere_rule(rings).map(along).sum::<f64>() / body.normalization().linear.determinant().abs()
}

fn meet(a: &Aabb, b: &Aabb) -> bool {
    (0..3).all(|i| a.min[i] <= b.max[i] && b.min[i] <= a.max[i])
}

fn inside(bounds: &Aabb, x: &Vector3<f64>) -> bool {
    (0..3).all(|i| bounds.min[i] <= x[i] && x[i] <= bounds.max[i])
}

#[cfg(test)]
mod tests {
    use crate::body::{Body, Compound};
    use nalgebra::{UnitQuaternion, Vector3};
    use std::f64::consts::PI;

    #[test]
    fn overlaps_count_once() {
        // Two unit balls d apart share two caps of height h = 1 - d/2, π h² (3 - h)/3 each.
        for d in [0.0, 0.3, 1.0, 1.7, 2.5_f64] {
            let ball = |x: f64| Body::ball("ball", Vector3::new(x, 0.2, -0.1), 1.0).unwrap();
            let volume = Compound::new("two", vec![ball(0.0), ball(d)]).unwrap().volume();
            let h = (1.0 - d / 2.0).max(0.0);
            let truth = 2.0 * 4.0 / 3.0 * PI - 2.0 * PI * h * h * (3.0 - h) / 3.0;
            assert!((volume.volume_m3 - truth).abs() < 3e-3 * truth, "{d}: {volume:?} {truth}");
            assert!((volume.volume_m3 - truth).abs() < 3.0 * volume.error_m3 + 1e-3 * truth, "{d}: {volume:?} {truth}");
        }
    }

    #[test]
    fn of_three_crossing_bars() {
        // Bars 2 x 2 x 6 along the axes share one cube of side 2.
        let bars = (0..3).map(|axis| {
            let half = Vector3::from_fn(|i, _| if i == axis { 3.0 } else { 1.0 });
            let turn = UnitQuaternion::from_euler_angles(0.0, 0.0, 0.0);
            Body::cuboid("bar", half).unwrap().moved(&turn, &Vector3::zeros()).unwrap()
        });
        let volume = Compound::new("cross", bars.collect()).unwrap().volume();
        assert!((volume.volume_m3 - 56.0).abs() < 1.0 && volume.error_m3 < 2.0, "{volume:?}");
    }
}
