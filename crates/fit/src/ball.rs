//! The smallest ball around points: the coarsest rung of a ladder.

use nalgebra::Vector3;

/// Relative accuracy of the square of the radius; dimensionless.
///
/// The ball is the coarsest rung of a ladder, whose gap is measured afterwards. A larger value
/// makes the ball larger than need be; a smaller one takes more of the linearly convergent steps.
/// Pinned by `it_is_the_smallest`.
const SQUARED_RADIUS_TOLERANCE: f64 = 1e-9;

/// Steps before giving up; tens to a few thousand are used in practice.
const MAX_ASCENT_STEPS: usize = 200_000;

/// A ball, units of the points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EnclosingBall {
    /// Centre.
    pub center: Vector3<f64>,
    /// Distance of the farthest point from it.
    pub radius: f64,
}

/// The smallest ball around `points`, its radius to a relative 1e-9; of no points, the point 0.
///
/// The dual gives weights to the points: the centre is their mean, and the variance `γ = Σ w |x -
/// c|²` is at most the square of the smallest radius. Coordinate ascent towards the farthest point,
/// and away from the nearest one with a weight, converges linearly (Yıldırım, Two algorithms for
/// the minimum enclosing ball problem, SIAM J. Optimization 19, 2008).
pub fn smallest_ball(points: &[Vector3<f64>]) -> EnclosingBall {
    let Some(first) = points.first() else { return EnclosingBall { center: Vector3::zeros(), radius: 0.0 } };
    let farthest = |from: &Vector3<f64>| {
        (0..points.len())
            .max_by(|&i, &j| (points[i] - from).norm_squared().total_cmp(&(points[j] - from).norm_squared()))
    };
    let mut weights = vec![0.0; points.len()];
    // From two points that are far apart.
    let one = farthest(first).unwrap_or(0);
    let other = farthest(&points[one]).unwrap_or(0);
    weights[one] += 0.5;
    weights[other] += 0.5;
    let mut center = (points[one] + points[other]) * 0.5;
    let mut radius = 0.0;
    for step in 0..MAX_ASCENT_STEPS {
        let squares: Vec<f64> = points.iter().map(|x| (x - center).norm_squared()).collect();
        let variance: f64 = squares.iter().zip(&weights).map(|(square, weight)| square * weight).sum();
        let (mut far, mut near) = (0, None::<usize>);
        for (i, &square) in squares.iter().enumerate() {
            if square > squares[far] {
                far = i;
            }
            if weights[i] > 0.0 && near.is_none_or(|n| square < squares[n]) {
                near = Some(i);
            }
        }
        radius = squares[far].sqrt();
        let (Some(near), true) = (near, variance > 0.0) else { break };
        let (above, below) = (squares[far] / variance - 1.0, 1.0 - squares[near] / variance);
        if above <= SQUARED_RADIUS_TOLERANCE || step + 1 == MAX_ASCENT_STEPS {
            break;
        }
        // Exact line search; away from a point not past weight zero.
        let (j, share) = if above >= below {
            (far, above / (2.0 * (1.0 + above)))
        } else {
            let limit = weights[near] / (1.0 - weights[near]);
            let full = if below < 1.0 { below / (2.0 * (1.0 - below)) } else { f64::INFINITY };
            (near, -full.min(limit))
        };
        weights.iter_mut().for_each(|weight| *weight *= 1.0 - share);
        weights[j] = if share < 0.0 && weights[j] + share < 1e-15 { 0.0 } else { weights[j] + share };
        center += (points[j] - center) * share;
    }
    EnclosingBall { center, radius }
}

#[cfg(test)]
mod tests {
    use super::smallest_ball;
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    /// The smallest ball through two, three or four points that contains all, by trying them all.
    fn brute_force(points: &[Vector3<f64>]) -> f64 {
        let n = points.len();
        let mut best = f64::INFINITY;
        let mut consider = |on: &[usize]| {
            let origin = points[on[0]];
            let edges: Vec<_> = on[1..].iter().map(|&i| points[i] - origin).collect();
            // The centre among combinations of the edges, as far from 0 as from each of them.
            let gram = Matrix3::from_fn(|i, j| match (edges.get(i), edges.get(j)) {
                (Some(p), Some(q)) => 2.0 * p.dot(q),
                _ => f64::from(u8::from(i == j)),
            });
            let right = Vector3::from_fn(|i, _| edges.get(i).map_or(0.0, Vector3::norm_squared));
            let Some(solution) = gram.lu().solve(&right) else { return };
            let center = origin + edges.iter().zip(solution.iter()).map(|(edge, s)| edge * *s).sum::<Vector3<f64>>();
            let radius = (points[on[0]] - center).norm();
            if radius < best && points.iter().all(|x| (x - center).norm() <= radius * (1.0 + 1e-9)) {
                best = radius;
            }
        };
        for a in 0..n {
            for b in a + 1..n {
                consider(&[a, b]);
                for c in b + 1..n {
                    consider(&[a, b, c]);
                    (c + 1..n).for_each(|d| consider(&[a, b, c, d]));
                }
            }
        }
        best
    }

    #[test]
    fn it_is_the_smallest() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let flat = if seed % 3 == 0 { 1e-6 } else { 1.0 };
            let points: Vec<_> =
                (0..12).map(|_| Vector3::new(random.signed(), random.signed(), flat * random.signed())).collect();
            let (found, truth) = (smallest_ball(&points), brute_force(&points));
            assert!((found.radius / truth - 1.0).abs() < 1e-8, "seed {seed}: {found:?} {truth}");
            assert!(points.iter().all(|x| (x - found.center).norm() <= found.radius));
        }
    }

    #[test]
    fn coinciding_points_have_a_ball_without_a_radius() {
        let point = Vector3::new(1.0, -2.0, 3.0);
        let found = smallest_ball(&[point; 5]);
        assert!(found.radius == 0.0 && found.center == point);
        assert!(smallest_ball(&[]).radius == 0.0);
    }
}
