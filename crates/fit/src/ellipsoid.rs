//! The minimum-volume ellipsoid around points: whitening, and the exact answer at degree 2.

use nalgebra::{Matrix3, Matrix4, SymmetricEigen, Vector3, Vector4};

/// Relative accuracy of the optimality conditions; dimensionless.
///
/// The volume is off by about twice this. A larger value makes bodies of degree 2 larger than need
/// be; a smaller one takes more of the linearly convergent steps, up to [`MAX_ASCENT_STEPS`].
/// Pinned by `of_points_on_a_known_ellipsoid`.
const HEIGHT_TOLERANCE: f64 = 1e-7;
/// Steps before giving up; tens to a few thousand are used in practice.
const MAX_ASCENT_STEPS: usize = 200_000;
/// Points that may all have a weight at first.
const FEW: usize = 1000;
/// Rank-one updates between two factorizations from scratch, which bounds the drift of the inverse.
const REFRESH: usize = 100;

/// The ellipsoid `|linear (x - center)| <= 1`.
#[derive(Clone, Debug, PartialEq)]
pub struct Ellipsoid {
    /// Centre, in the frame of the points.
    pub center: Vector3<f64>,
    /// Symmetric positive definite; maps the ellipsoid to the unit ball.
    pub linear: Matrix3<f64>,
    /// Weight of each point at the optimum; they add up to 1, and only points on the surface have
    /// any.
    pub weights: Vec<f64>,
}

impl Ellipsoid {
    /// Volume in cubed units of the points.
    pub fn volume(&self) -> f64 {
        4.0 / 3.0 * std::f64::consts::PI / self.linear.determinant()
    }
}

/// The smallest ellipsoid by volume around `points`, to a relative 1e-6, scaled so that it contains
/// all of them.
///
/// Khachiyan's coordinate ascent on the dual with the away steps of Todd and Yıldırım (Discrete
/// Applied Mathematics 155, 2007), which make it converge linearly. `None` when the points are flat
/// to rounding: condition them first.
pub fn minimum_ellipsoid(points: &[Vector3<f64>]) -> Option<Ellipsoid> {
    let lifted: Vec<Vector4<f64>> = points.iter().map(|p| p.push(1.0)).collect();
    let mut weights = first_weights(points)?;
    let (mut inverse, mut heights) = heights(&lifted, &weights)?;
    for step in 1..=MAX_ASCENT_STEPS {
        let (mut far, mut near) = (0, None::<usize>);
        for (i, &height) in heights.iter().enumerate() {
            if height > heights[far] {
                far = i;
            }
            if weights[i] > 0.0 && near.is_none_or(|n| height < heights[n]) {
                near = Some(i);
            }
        }
        let near = near?;
        let (above, below) = (heights[far] / 4.0 - 1.0, 1.0 - heights[near] / 4.0);
        if above.max(below) <= HEIGHT_TOLERANCE {
            break;
        }
        // Exact line search towards the highest point, or away from the lowest (not past weight
        // zero).
        let (j, beta) = if above >= below {
            (far, (heights[far] - 4.0) / (4.0 * (heights[far] - 1.0)))
        } else {
            let full = (heights[near] - 4.0) / (4.0 * (heights[near] - 1.0));
            let limit = -weights[near] / (1.0 - weights[near]);
            // Heights at or below 1 make the objective grow all the way to the limit.
            (near, if heights[near] <= 1.0 { limit } else { full.max(limit) })
        };
        for weight in &mut weights {
            *weight *= 1.0 - beta;
        }
        weights[j] = (weights[j] + beta).max(0.0);
        if beta < 0.0 && weights[j] < 1e-15 {
            weights[j] = 0.0;
        }
        if step % REFRESH == 0 {
            (inverse, heights) = self::heights(&lifted, &weights)?;
        } else {
            // ((1-β) X + β q qᵀ)⁻¹ by Sherman and Morrison
            let direction = inverse * lifted[j];
            let scale = beta / (1.0 - beta + beta * heights[j]);
            for (height, q) in heights.iter_mut().zip(&lifted) {
                let along = direction.dot(q);
                *height = (*height - scale * along * along) / (1.0 - beta);
            }
            inverse = (inverse - direction * direction.transpose() * scale) / (1.0 - beta);
        }
    }
    let center: Vector3<f64> = points.iter().zip(&weights).map(|(p, w)| p * *w).sum();
    let scatter: Matrix3<f64> =
        points.iter().zip(&weights).map(|(p, w)| (p - center) * (p - center).transpose() * *w).sum();
    let eigen = SymmetricEigen::new(scatter * 3.0);
    if eigen.eigenvalues.min() <= 0.0 || !eigen.eigenvalues.iter().all(|e| e.is_finite()) {
        return None;
    }
    let root = Matrix3::from_diagonal(&eigen.eigenvalues.map(|e| 1.0 / e.sqrt()));
    let linear = eigen.eigenvectors * root * eigen.eigenvectors.transpose();
    let linear = (linear + linear.transpose()) * 0.5;
    let reach = points.iter().map(|p| (linear * (p - center)).norm()).fold(0.0, f64::max);
    (reach > 0.0 && reach.is_finite()).then(|| Ellipsoid { center, linear: linear / reach, weights })
}

/// Equal weights: on all of few points, which keeps their symmetry, and with it the axes of the
/// ellipsoid of a cube; on six that span the space of many, nearly all of which would have to lose
/// their weight again. Those are the farthest both ways along three directions, each across the
/// spans found before (Kumar and Yıldırım, J. Optim. Theory Appl. 126, 2005).
fn first_weights(points: &[Vector3<f64>]) -> Option<Vec<f64>> {
    if points.len() <= FEW {
        return Some(vec![1.0 / points.len() as f64; points.len()]);
    }
    let mut weights = vec![0.0; points.len()];
    let mut spans: Vec<Vector3<f64>> = Vec::new();
    for axis in 0..3 {
        let mut across = match *spans.as_slice() {
            [first, second] => first.cross(&second),
            [first] => Vector3::ith(first.iamin(), 1.0).cross(&first),
            _ => Vector3::ith(axis, 1.0),
        };
        across = across.try_normalize(0.0)?;
        let heights = || points.iter().map(|p| across.dot(p)).enumerate();
        let (low, _) = heights().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (high, _) = heights().max_by(|a, b| a.1.total_cmp(&b.1))?;
        weights[low] += 1.0 / 6.0;
        weights[high] += 1.0 / 6.0;
        spans.push(points[high] - points[low]);
    }
    Some(weights)
}

/// Inverse of `Σ w q qᵀ` and the heights `qᵀ (Σ w q qᵀ)⁻¹ q`, which are at most 4 at the optimum.
fn heights(lifted: &[Vector4<f64>], weights: &[f64]) -> Option<(Matrix4<f64>, Vec<f64>)> {
    let scatter: Matrix4<f64> = lifted.iter().zip(weights).map(|(q, w)| q * q.transpose() * *w).sum();
    let inverse = scatter.cholesky()?.inverse();
    let heights = lifted.iter().map(|q| q.dot(&(inverse * q))).collect();
    Some((inverse, heights))
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_core::body::fibonacci_lattice;

    #[test]
    fn of_a_cuboid() {
        let corners: Vec<_> = (0..8)
            .map(|i| {
                let sign = |bit: i32| if i & bit == 0 { -1.0 } else { 1.0 };
                Vector3::new(5.0 + sign(1), -3.0 + 2.0 * sign(2), 0.5 * sign(4))
            })
            .collect();
        let ellipsoid = minimum_ellipsoid(&corners).unwrap();
        assert!((ellipsoid.center - Vector3::new(5.0, -3.0, 0.0)).norm() < 1e-6);
        // axes are √3 times the half extents
        let expected = 4.0 / 3.0 * std::f64::consts::PI * 27_f64.sqrt();
        assert!((ellipsoid.volume() / expected - 1.0).abs() < 1e-6);
    }

    #[test]
    fn of_a_regular_tetrahedron_with_points_inside() {
        let corners = [
            Vector3::new(1.0, 1.0, 1.0),
            Vector3::new(1.0, -1.0, -1.0),
            Vector3::new(-1.0, 1.0, -1.0),
            Vector3::new(-1.0, -1.0, 1.0),
        ];
        let mut points = corners.to_vec();
        points.extend((0..50).map(|i| corners[i % 4] * 0.5 + corners[(i / 4) % 4] * 0.3));
        let ellipsoid = minimum_ellipsoid(&points).unwrap();
        assert!(ellipsoid.center.norm() < 1e-6);
        assert!((ellipsoid.linear - Matrix3::identity() / 3_f64.sqrt()).norm() < 1e-6);
        assert!(ellipsoid.weights[4..].iter().all(|&w| w < 1e-6));
    }

    #[test]
    fn of_points_on_a_known_ellipsoid() {
        let axes = Vector3::new(3.0, 1.0, 0.2);
        for count in [400, 20_000] {
            let points: Vec<_> = fibonacci_lattice(count).map(|u| u.component_mul(&axes)).collect();
            let ellipsoid = minimum_ellipsoid(&points).unwrap();
            assert!((ellipsoid.linear - Matrix3::from_diagonal(&axes.map(|a| 1.0 / a))).norm() < 1e-4, "{count}");
            assert!(points.iter().all(|p| (ellipsoid.linear * (p - ellipsoid.center)).norm() <= 1.0 + 1e-15));
        }
    }

    #[test]
    fn flat_points_have_none() {
        for count in [20, 2000] {
            let points: Vec<_> = (0..count).map(|i| Vector3::new((i as f64).sin(), (i as f64).cos(), 0.0)).collect();
            assert!(minimum_ellipsoid(&points).is_none(), "{count}");
        }
    }
}
