//! Thickness for points that have none: sheets, rods, single points.

use super::hull::principal_axes;
use nalgebra::Vector3;
use std::borrow::Cow;

/// Points that are at least so thick, metres: in each principal direction in which they extend by
/// less, every point gives way to two copies, half of that to either side. Bodies around the copies
/// contain the points.
pub fn thicken(points: &[Vector3<f64>], least_m: f64) -> Cow<'_, [Vector3<f64>]> {
    let mut thick = Cow::Borrowed(points);
    let (_, axes, extents) = principal_axes(points);
    for axis in (0..3).filter(|&axis| extents[axis] < least_m) {
        let offset = axes.column(axis) * (0.5 * least_m);
        thick = Cow::Owned(thick.iter().flat_map(|x| [x - offset, x + offset]).collect());
    }
    thick
}

#[cfg(test)]
mod tests {
    use super::thicken;
    use crate::hull::convex_hull;
    use nalgebra::{Rotation3, Vector3};

    #[test]
    fn sheets_rods_and_points_get_a_volume() {
        let turn = Rotation3::from_euler_angles(0.3, -1.1, 2.0);
        let grid = |n: [usize; 3]| -> Vec<Vector3<f64>> {
            let place = |i: usize, n: usize| if n > 1 { i as f64 / (n - 1) as f64 } else { 0.0 };
            (0..n[0] * n[1] * n[2])
                .map(|k| turn * Vector3::new(place(k % n[0], n[0]), place(k / n[0] % n[1], n[1]), 0.0))
                .collect()
        };
        for (counts, volume) in [([5, 4, 1], 1e-3), ([5, 1, 1], 1e-6), ([1, 1, 1], 1e-9)] {
            let points = grid(counts);
            let thick = thicken(&points, 1e-3);
            let found = convex_hull(&thick).unwrap().volume;
            assert!((found / volume - 1.0).abs() < 1e-6, "{counts:?}: {found}");
        }
    }

    #[test]
    fn what_is_thick_enough_stays() {
        let cube: Vec<_> = (0..8_u8).map(|i| Vector3::from_fn(|axis, _| f64::from(i >> axis & 1))).collect();
        assert_eq!(thicken(&cube, 0.99).len(), 8);
        assert_eq!(thicken(&cube, 1.01).len(), 64);
    }
}
