//! Convex hulls in the plane.

/// Corners of the convex hull of `points`, counter-clockwise, which are sorted on the way (Andrew's
/// monotone chain).
pub fn outline(points: &mut [[f64; 2]]) -> Vec<[f64; 2]> {
    points.sort_by(|a, b| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1])));
    // The lower side from left to right, the upper side back.
    let half = |points: &mut dyn Iterator<Item = &[f64; 2]>| {
        let mut chain: Vec<[f64; 2]> = Vec::new();
        for &point in points {
            while let [.., a, b] = chain[..] {
                if turn(a, b, point) > 0.0 {
                    break;
                }
                chain.pop();
            }
            chain.push(point);
        }
        chain.pop(); // the first of the other side
        chain
    };
    let mut corners = half(&mut points.iter());
    corners.extend(half(&mut points.iter().rev()));
    corners
}

/// Twice the signed area of the triangle a, b, c; positive if counter-clockwise.
pub fn turn(a: [f64; 2], b: [f64; 2], c: [f64; 2]) -> f64 {
    (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn of_a_square_has_four_corners() {
        let mut points = [[0.0, 0.0], [1.0, 0.0], [0.5, 0.5], [1.0, 1.0], [0.0, 1.0], [0.5, 0.0], [1.0, 1.0]];
        assert_eq!(outline(&mut points), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    }

    #[test]
    fn of_few_points_has_them() {
        assert!(outline(&mut []).is_empty());
        assert_eq!(outline(&mut [[1.0, 2.0], [0.0, 0.0]]), [[0.0, 0.0], [1.0, 2.0]]);
    }
}
