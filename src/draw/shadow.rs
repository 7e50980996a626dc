//! Shadows of sets that need not be convex: what `{x : p(x) <= level}` covers of the picture plane.

use super::contour::contours;
use super::silhouette::View;
use crate::body::Aabb;
use nalgebra::Vector3;

/// Grid lines per side of the picture.
const GRID: usize = 180;
/// Samples along a line of sight, and steps of the search for its least value between them.
const DEPTHS: usize = 48;
const REFINEMENTS: usize = 12;

/// The outlines of the shadow of `{x : value(x) <= level}`, in picture coordinates, metres; holes
/// run the other way round. The set lies in `bounds`.
///
/// The least value along each line of sight of a grid is found by sampling and a golden section,
/// and the outline is where that passes the level (marching squares): finer than a hundredth of the
/// picture, whatever the shape.
pub fn shadow(value: impl Fn(&Vector3<f64>) -> f64, level: f64, bounds: &Aabb, view: View) -> Vec<Vec<[f64; 2]>> {
    let (corner, opposite) = (view.project(&bounds.min), view.project(&bounds.max));
    // One empty cell all around closes every outline.
    let step = [0, 1].map(|i| (opposite[i] - corner[i]) / (GRID - 3) as f64);
    let place = |i: f64, j: f64| [corner[0] + (i - 1.0) * step[0], corner[1] + (j - 1.0) * step[1]];
    let (near, far) = (view.depth(&bounds.min), view.depth(&bounds.max));
    let least = |i: usize, j: usize| {
        let edge = [i, j].iter().any(|&k| k == 0 || k == GRID - 1);
        if edge {
            f64::INFINITY
        } else {
            least_along(|depth| value(&view.lift(place(i as f64, j as f64), depth)), near, far)
        }
    };
    let above: Vec<f64> = (0..GRID * GRID).map(|k| least(k % GRID, k / GRID) - level).collect();
    let metres = |outline: Vec<[f64; 2]>| outline.into_iter().map(|[i, j]| place(i, j)).collect();
    contours(&above, GRID).into_iter().map(metres).collect()
}

/// The least of a function between two ends, as far as samples tell.
fn least_along(f: impl Fn(f64) -> f64, near: f64, far: f64) -> f64 {
    let depth = |k: f64| near + (far - near) * k / (DEPTHS - 1) as f64;
    let values: [f64; DEPTHS] = std::array::from_fn(|k| f(depth(k as f64)));
    let best = (0..DEPTHS).min_by(|&a, &b| values[a].total_cmp(&values[b])).unwrap_or(0);
    let golden = 0.5 * (5_f64.sqrt() - 1.0);
    let (mut low, mut high) = (depth(best as f64 - 1.0), depth(best as f64 + 1.0));
    let mut least = values[best];
    for _ in 0..REFINEMENTS {
        let (a, b) = (high - golden * (high - low), low + golden * (high - low));
        let (at_a, at_b) = (f(a), f(b));
        least = least.min(at_a).min(at_b);
        if at_a < at_b { high = b } else { low = a }
    }
    least
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn area(polygon: &[[f64; 2]]) -> f64 {
        let sides = polygon.iter().zip(polygon.iter().cycle().skip(1));
        sides.map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum::<f64>() / 2.0
    }

    #[test]
    fn of_a_torus_has_a_hole() {
        // (|x|² + R² - r²)² <= 4 R² (x² + y²), R = 1, r = 0.3
        let torus = |x: &Vector3<f64>| {
            let outer = x.norm_squared() + 1.0 - 0.09;
            outer * outer - 4.0 * (x.x * x.x + x.y * x.y)
        };
        let bounds = Aabb { min: Vector3::new(-1.3, -1.3, -0.3), max: Vector3::new(1.3, 1.3, 0.3) };
        let mut areas: Vec<f64> = shadow(torus, 0.0, &bounds, View::Top).iter().map(|p| area(p)).collect();
        areas.sort_by(f64::total_cmp);
        let [hole, whole] = areas[..] else { panic!("{areas:?}") };
        assert!((whole / (PI * 1.69) - 1.0).abs() < 0.02, "counter-clockwise: {whole}");
        assert!((-hole / (PI * 0.49) - 1.0).abs() < 0.03, "clockwise: {hole}");
        let side: Vec<f64> = shadow(torus, 0.0, &bounds, View::Side).iter().map(|p| area(p)).collect();
        let [side] = side[..] else { panic!("{side:?}") };
        assert!((side / (2.0 * 0.6 + PI * 0.09) - 1.0).abs() < 0.02, "{side}");
    }

    #[test]
    fn parts_and_levels_have_outlines_of_their_own() {
        let two = |x: &Vector3<f64>| (x.x.abs() - 1.0).powi(2) + x.y * x.y + x.z * x.z;
        let bounds = Aabb { min: Vector3::new(-2.0, -1.0, -1.0), max: Vector3::new(2.0, 1.0, 1.0) };
        for (level, radius) in [(0.25, 0.5), (0.5, 0.5_f64.sqrt())] {
            let parts = shadow(two, level, &bounds, View::Front);
            assert_eq!(parts.len(), 1, "one behind the other");
            let parts = shadow(two, level, &bounds, View::Top);
            assert_eq!(parts.len(), 2);
            for part in parts {
                assert!((area(&part) / (PI * radius * radius) - 1.0).abs() < 0.02, "{}", area(&part));
            }
        }
        assert!(shadow(two, -1.0, &bounds, View::Top).is_empty());
    }
}
