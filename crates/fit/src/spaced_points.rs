//! Points that are added to a program together: not many from one spot.

use nalgebra::Vector3;

/// Least distance of points that are added together, in the whitened frame, where the object has
/// about the size of the unit ball; dimensionless. Closer points bound a polynomial of degree 8
/// almost alike. A larger value adds fewer points at a time and takes more rounds; a smaller one
/// spends rows of the program on points that bound the same. Pinned by
/// `points_close_to_one_before_are_left_out`.
const ADDED_SPACING: f64 = 0.05;

/// The first of the candidates, at most `most`, that are not close to one taken before.
pub(super) fn spaced_points(
    points: &[Vector3<f64>],
    candidates: impl IntoIterator<Item = usize>,
    most: usize,
) -> Vec<usize> {
    let mut taken: Vec<usize> = Vec::new();
    for index in candidates {
        if taken.len() < most && taken.iter().all(|&other| (points[other] - points[index]).norm() > ADDED_SPACING) {
            taken.push(index);
        }
    }
    taken
}

#[cfg(test)]
mod tests {
    use super::spaced_points;
    use nalgebra::Vector3;

    #[test]
    fn points_close_to_one_before_are_left_out() {
        let points: Vec<_> = [0.0, 0.04, 0.06, 0.09, 0.12].iter().map(|&x| Vector3::new(x, 0.0, 0.0)).collect();
        assert_eq!(spaced_points(&points, 0..5, 9), [0, 2, 4]);
        assert_eq!(spaced_points(&points, [1, 0, 4, 2], 9), [1, 4]);
        assert_eq!(spaced_points(&points, 0..5, 2), [0, 2]);
    }
}
