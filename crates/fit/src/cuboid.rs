//! The smallest box around points, at any orientation.
//!
//! Along a given axis the best box is known: the smallest rectangle around the points as seen along
//! the axis has a side along one of the sides of their outline (Freeman and Shapira, Determining
//! the minimum-area encasing rectangle for an arbitrary closed curve, Commun. ACM 18, 1975). What
//! is left is a search over the axis, which has many local minima: from the best of a lattice of
//! directions, by compass steps, and at each of them also about the other two axes of the box
//! found.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::TAU;
use sublevel_core::body::fibonacci_lattice;
use sublevel_core::optimize::outline;

/// Directions that are tried first, over half of the sphere.
const LATTICE: usize = 600;
/// How many of them are searched from.
const STARTS: usize = 8;
/// Directions of a compass, and the step at which a search ends, radians.
const COMPASS: usize = 8;

/// Step at which a search over directions ends, radians.
///
/// The volume of a box changes by the square of that near its minimum. A larger value leaves boxes
/// larger than need be; a smaller one ends in rounding. Boxes of the tests have faces along an
/// edge, which the search finds exactly: none fixes the value.
const LEAST_STEP: f64 = 1e-7;

/// A box at any orientation, units of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct OrientedBox {
    /// Its centre.
    pub center: Vector3<f64>,
    /// Unit vectors along its edges, as columns; right-handed.
    pub axes: Matrix3<f64>,
    /// Half of its extent along each.
    pub half_extents: Vector3<f64>,
}

impl OrientedBox {
    /// The smallest box around `points` with these axes; of no points, the point 0.
    pub fn along(axes: Matrix3<f64>, points: &[Vector3<f64>]) -> Self {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for point in points {
            let along = axes.tr_mul(point);
            (low, high) = (low.inf(&along), high.sup(&along));
        }
        if points.is_empty() {
            (low, high) = (Vector3::zeros(), Vector3::zeros());
        }
        Self { center: axes * (low + high) * 0.5, axes, half_extents: (high - low) * 0.5 }
    }

    /// Volume, cubed units of the points.
    pub fn volume(&self) -> f64 {
        8.0 * self.half_extents.product()
    }
}

/// The smallest box around `points` that the search of this module finds. It has found those of the
/// literature for common meshes; a proof that there is none smaller it has not.
pub fn smallest_box(points: &[Vector3<f64>]) -> OrientedBox {
    let mut starts: Vec<(f64, Vector3<f64>)> =
        fibonacci_lattice(2 * LATTICE).take(LATTICE).map(|axis| (best_along(&axis, points).volume(), axis)).collect();
    starts.sort_by(|a, b| a.0.total_cmp(&b.0));
    let found = starts.iter().take(STARTS).map(|(_, axis)| descend(axis, points));
    found.min_by(|a, b| a.volume().total_cmp(&b.volume())).unwrap_or(OrientedBox::along(Matrix3::identity(), points))
}

/// Compass search over the axis.
fn descend(axis: &Vector3<f64>, points: &[Vector3<f64>]) -> OrientedBox {
    let mut best = best_along(axis, points);
    let mut step = (TAU / LATTICE as f64).sqrt();
    while step > LEAST_STEP {
        let mut better = None;
        for k in 0..3 {
            let axis: Vector3<f64> = best.axes.column(k).into();
            let (right, up) = across(&axis);
            // About its own axis, the rectangle is the best already.
            let around = (0..COMPASS).map(|i| {
                let (sin, cos) = (TAU * i as f64 / COMPASS as f64).sin_cos();
                axis + (right * cos + up * sin) * step
            });
            let next = std::iter::once(axis).chain(around).map(|axis| best_along(&axis, points));
            better = better.into_iter().chain(next).min_by(|a, b| a.volume().total_cmp(&b.volume()));
        }
        // Less than a fair share of what a step could bring would make it creep.
        let enough = best.volume() * (1.0 - 1e-3 * step - 1e-12);
        match better.filter(|found| found.volume() < enough) {
            Some(found) => best = found,
            None => step *= 0.5,
        }
    }
    best
}

/// The smallest box with one edge along `axis`.
fn best_along(axis: &Vector3<f64>, points: &[Vector3<f64>]) -> OrientedBox {
    // Lengths that shrink by roundings would pass for smaller boxes.
    let axis = axis.normalize();
    let (right, up) = across(&axis);
    let mut flat: Vec<[f64; 2]> = points.iter().map(|x| [right.dot(x), up.dot(x)]).collect();
    let outline = outline(&mut flat);
    let sides = outline.iter().zip(outline.iter().cycle().skip(1));
    let turned = sides.map(|(a, b)| (b[1] - a[1]).atan2(b[0] - a[0])).map(|angle| {
        let (sin, cos) = angle.sin_cos();
        let extent = |x: f64, y: f64| {
            let along = outline.iter().map(|p| p[0] * x + p[1] * y);
            let (low, high) = along.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
            high - low
        };
        (extent(cos, sin) * extent(-sin, cos), (right * cos + up * sin).normalize())
    });
    let (_, side) = turned.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((0.0, right));
    OrientedBox::along(Matrix3::from_columns(&[axis, side, axis.cross(&side)]), points)
}

/// Two unit vectors that make a right-handed frame with the unit vector `axis`, which comes last.
fn across(axis: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    let other = if axis.x.abs() < 0.5 { Vector3::x() } else { Vector3::y() };
    let right = other.cross(axis).normalize();
    (right, axis.cross(&right))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::UnitQuaternion;
    use sublevel_testkit::Seeded;

    #[test]
    fn finds_a_turned_box_around_its_corners() {
        for seed in 0..12 {
            let mut random = Seeded(seed);
            let half = Vector3::from_fn(|_, _| 10_f64.powf(random.signed()));
            let turn = UnitQuaternion::from_euler_angles(3.0 * random.signed(), random.signed(), 3.0 * random.signed());
            let shift = Vector3::from_fn(|_, _| 10.0 * random.signed());
            let mut points: Vec<Vector3<f64>> = (0..8_usize)
                .map(|i| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { half[k] } else { -half[k] }))
                .collect();
            points.extend((0..50).map(|_| half.component_mul(&Vector3::from_fn(|_, _| random.signed()))));
            let points: Vec<_> = points.iter().map(|x| turn * x + shift).collect();
            let found = smallest_box(&points);
            assert!((found.volume() / (8.0 * half.product()) - 1.0).abs() < 1e-6, "seed {seed}: {}", found.volume());
            let inside = |x: &Vector3<f64>| {
                let along = found.axes.tr_mul(&(x - found.center));
                (0..3).all(|i| along[i].abs() <= found.half_extents[i] * (1.0 + 1e-12) + 1e-12)
            };
            assert!(points.iter().all(inside), "seed {seed}");
        }
    }

    #[test]
    fn of_a_regular_tetrahedron_is_its_cube() {
        // Edges along the diagonals of the faces of the unit cube: the smallest box of a regular
        // tetrahedron is that cube.
        let corners = [[0.0, 0.0, 0.0], [1.0, 1.0, 0.0], [1.0, 0.0, 1.0], [0.0, 1.0, 1.0]].map(Vector3::from);
        assert!((smallest_box(&corners).volume() - 1.0).abs() < 1e-6);
    }

    #[test]
    fn of_flat_and_of_few_points() {
        assert_eq!(smallest_box(&[]).volume(), 0.0);
        assert_eq!(smallest_box(&[Vector3::new(1.0, 2.0, 3.0)]).center, Vector3::new(1.0, 2.0, 3.0));
        let disc: Vec<_> = (0..9).map(|i| Vector3::new(f64::from(i).sin(), f64::from(i).cos(), 0.5)).collect();
        assert!(smallest_box(&disc).volume() < 1e-12);
    }
}
