//! Subsets of points that are spread as far as possible.

use nalgebra::Vector3;

/// Indices of at most `most` of the points: first the farthest from the origin, then again and
/// again the farthest from all those chosen before (Gonzalez, Theoret. Comput. Sci. 38, 1985). Of
/// points that are equally far the last one is chosen.
pub(super) fn farthest_points(points: &[Vector3<f64>], most: usize) -> Vec<usize> {
    let mut distances = vec![f64::INFINITY; points.len()];
    let mut next = (0..points.len()).max_by(|&a, &b| points[a].norm().total_cmp(&points[b].norm())).unwrap_or(0);
    let choose = |_| {
        let chosen = next;
        for (distance, point) in distances.iter_mut().zip(points) {
            *distance = distance.min((point - points[chosen]).norm());
        }
        next = (0..points.len()).max_by(|&a, &b| distances[a].total_cmp(&distances[b])).unwrap_or(0);
        chosen
    };
    (0..most.min(points.len())).map(choose).collect()
}

#[cfg(test)]
mod tests {
    use super::farthest_points;
    use nalgebra::Vector3;

    #[test]
    fn each_point_is_the_farthest_from_those_before() {
        let points: Vec<_> = [0.0, 1.0, 10.0, 6.0, 4.9].iter().map(|&x| Vector3::new(x, 0.0, 0.0)).collect();
        assert_eq!(farthest_points(&points, 5), [2, 0, 4, 3, 1]);
        assert_eq!(farthest_points(&points, 2), [2, 0]);
        assert_eq!(farthest_points(&points[..2], 9), [1, 0]);
        assert!(farthest_points(&[], 3).is_empty());
    }

    #[test]
    fn of_points_equally_far_the_last_is_chosen() {
        let corners: Vec<_> = [[-1.0, -1.0], [1.0, -1.0], [-1.0, 1.0], [1.0, 1.0]]
            .iter()
            .map(|&[x, y]| Vector3::new(x, y, 0.0))
            .collect();
        assert_eq!(farthest_points(&corners, 4), [3, 0, 2, 1]);
    }
}
