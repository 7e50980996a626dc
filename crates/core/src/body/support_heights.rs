//! How far a body reaches at most along any direction: a table of proven support heights.
//!
//! The support function `h(e) = max e·(z - a)` over the body, a its interior point, is sublinear:
//! of a direction `e = Σ w_k e_k` with weights `w_k >= 0` it is at most `Σ w_k h(e_k)`. So upper
//! bounds for the corners of a grid on the faces of a cube, interpolated on its triangles, are
//! upper bounds for all directions, and no polynomial is evaluated for one. The grid is that of
//! normalized coordinates z, in which no body is much longer than wide. With W the inverse of their
//! map, the height along n of the body frame is the one along `e = Wᵀ n`.
//!
//! The bound of one corner is that of a tangent plane: for a point z near the support point, with
//! the constraints active there, their multipliers λ >= 0 and the residual `r = e - Σ λ_i ∇g_i`,
//! convexity gives `e·(z' - z) <= Σ λ_i (1 - g_i(z)) + |r| |z' - z|` for every point z' of the
//! body.

use super::Constraint;
use super::direction_grid::{corners, interpolated};
use super::error_bounds::Trust;
use super::support_bounds::farthest_point;
use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// Residual of a tangent plane, relative to the length of its normal, beyond which a support point
/// is computed by the interior-point method; dimensionless.
///
/// A height is too large by the residual times the size of the body. A larger value makes heights
/// too large by more, so that planes decide fewer questions; a smaller one only takes more time
/// when a body is made. Exercised by `heights_are_bounds_and_close`.
const COARSE: f64 = 1e-6;

/// Rounding of the interpolation between heights, relative to the largest of them; dimensionless. A
/// dozen operations of half an epsilon each, with a factor to spare.
///
/// A smaller value could give a height below that of a point of the body, and a plane that proves
/// nothing; a larger one gives larger heights. Exercised by `heights_are_bounds_and_close`.
const INTERPOLATION: f64 = 64.0 * f64::EPSILON;

/// A point near the support point along a direction, and the constraints that are active there.
pub(super) struct SupportGuess<'a> {
    /// Normalized coordinates.
    pub(super) point: Vector3<f64>,
    pub(super) active: &'a [usize],
}

/// Upper bounds of a body's support function on a grid of directions.
#[derive(Clone, Debug)]
pub(super) struct SupportHeights {
    corners: Vec<f64>,
    inverse: Matrix3<f64>,
    /// Error per length of a direction of the body frame, metres.
    slack_m: f64,
}

impl SupportHeights {
    /// The table, from guesses of the support points along the corners of the grid, in its order.
    pub(super) fn new<'a>(
        bound: &CornerBound<'_>,
        inverse: &Matrix3<f64>,
        guesses: impl Iterator<Item = SupportGuess<'a>>,
    ) -> Self {
        let trust = bound.trust;
        let corners: Vec<f64> = corners().zip(guesses).map(|(corner, guess)| bound.of(&corner, &guess)).collect();
        let highest = corners.iter().fold(0.0, |most: f64, height| most.max(*height));
        // The inverse of the map and its products with directions are rounded, as is the interior
        // point in normalized coordinates.
        let inverse_error = trust.inverse_error + gamma(8) * trust.inverse_norm;
        let slack_m = (inverse_error * 2.0 * trust.radius
            + trust.rounding * trust.reach
            + INTERPOLATION * highest * inverse.norm())
            * (1.0 + 1e-12);
        Self { corners, inverse: *inverse, slack_m }
    }

    /// Upper bound of `n·(x - a)` over the points x of the body, a its interior point; n of any
    /// length, body frame; metres times that length.
    #[inline(always)]
    pub(super) fn along(&self, n: &Vector3<f64>) -> f64 {
        interpolated(&self.corners, &self.inverse.tr_mul(n)) + self.slack_m * n.norm()
    }

    /// Size of the table, bytes.
    pub(super) fn bytes(&self) -> usize {
        self.corners.len() * size_of::<f64>()
    }
}

/// What the bound along a corner is computed from; normalized coordinates.
pub(super) struct CornerBound<'a> {
    pub(super) constraints: &'a [Constraint],
    /// Interior point in normalized coordinates.
    pub(super) interior: &'a Vector3<f64>,
    pub(super) trust: &'a Trust,
    /// Bounds of the coordinates' magnitudes over the body.
    pub(super) extent: &'a Vector3<f64>,
}

impl CornerBound<'_> {
    /// Upper bound of the support function along e.
    fn of(&self, e: &Vector3<f64>, guess: &SupportGuess<'_>) -> f64 {
        let length = e.norm();
        let (height, residual) = self.tangent(e, &guess.point, &self.multipliers(e, guess));
        if residual <= COARSE * length {
            return height;
        }
        let (point, multipliers) = farthest_point(self.constraints, &(e / length), self.interior);
        let multipliers: Vec<f64> = multipliers.iter().map(|multiplier| multiplier * length).collect();
        height.min(self.tangent(e, &point, &multipliers).0)
    }

    /// Multipliers of the active constraints that fit the direction best, the others zero; none is
    /// negative.
    fn multipliers(&self, e: &Vector3<f64>, guess: &SupportGuess<'_>) -> Vec<f64> {
        let mut multipliers = vec![0.0; self.constraints.len()];
        let count = guess.active.len().min(3);
        let mut gradients = Matrix3::zeros();
        for (k, &i) in guess.active.iter().take(3).enumerate() {
            gradients.set_column(k, &self.constraints[i].polynomial.evaluate(&guess.point).gradient);
        }
        let mut normal = gradients.tr_mul(&gradients);
        (count..3).for_each(|k| normal[(k, k)] = 1.0);
        if let Some(factor) = normal.cholesky() {
            let found = factor.solve(&gradients.tr_mul(e));
            for (k, &i) in guess.active.iter().take(3).enumerate() {
                multipliers[i] = found[k].max(0.0);
            }
        }
        multipliers
    }

    /// The bound of the tangent planes at z with these multipliers, and the norm of its residual.
    fn tangent(&self, e: &Vector3<f64>, z: &Vector3<f64>, multipliers: &[f64]) -> (f64, f64) {
        let none = Vector3::zeros();
        let (mut residual, mut slope, mut height) = (*e, 0.0, e.dot(&(z - self.interior)));
        let mut size = e.norm() * (z.norm() + self.interior.norm());
        for (constraint, &multiplier) in self.constraints.iter().zip(multipliers) {
            let jet = constraint.polynomial.evaluate(z);
            height += multiplier * (1.0 - jet.value + constraint.polynomial.value_error(z, &none, &none));
            residual -= jet.gradient * multiplier;
            // 1.8 > √3: the bound is one of each component.
            slope +=
                multiplier * (1.8 * constraint.polynomial.gradient_error(z, &none) + gamma(8) * jet.gradient.norm());
            size += multiplier * (1.0 + jet.value.abs());
        }
        let residual = residual.norm();
        let span = z.norm() + self.extent.norm().min(self.trust.radius * 2.0);
        let bound = height + (residual + slope) * span * (1.0 + 1e-12) + gamma(32) * size;
        (if bound.is_finite() { bound.next_up() } else { f64::INFINITY }, residual)
    }
}

#[cfg(test)]
mod tests {
    use crate::body::Body;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    /// The support function of `Σ |x_i / a_i|^k <= 1`.
    fn dual(half: &Vector3<f64>, n: &Vector3<f64>, k: f64) -> f64 {
        let q = k / (k - 1.0);
        half.component_mul(n).map(|c| c.abs().powf(q)).sum().powf(1.0 / q)
    }

    #[test]
    fn heights_are_bounds_and_close() {
        let half = Vector3::new(0.02, 1.0, 2.5);
        let center = Vector3::new(3.0, -2.0, 1.0);
        for (degree, most) in [(2, 1.004), (4, 1.02), (6, 1.03), (8, 1.04)] {
            let body = Body::superellipsoid("q", center, half, degree).unwrap();
            let mut random = Seeded(u64::from(degree));
            let mut worst = 1.0_f64;
            for _ in 0..3000 {
                // Evenly in normalized coordinates and in space.
                let n = random.unit();
                for n in [n, n.component_div(&half).normalize()] {
                    let truth = dual(&half, &n, degree.into()) + n.dot(&(center - body.interior_point()));
                    let bound = body.height(&n);
                    assert!(bound >= truth, "degree {degree}, {n:?}: {bound} below {truth}");
                    worst = worst.max(bound / truth);
                }
            }
            assert!(worst < most, "degree {degree}: {worst}");
        }
    }

    #[test]
    fn heights_of_boxes_and_cylinders_are_closed() {
        let half = Vector3::new(0.4, 1.0, 2.5);
        let (cuboid, cylinder) = (Body::cuboid("b", half).unwrap(), Body::cylinder("c", half.x, half.y).unwrap());
        let mut random = Seeded(7);
        for _ in 0..1000 {
            let n = random.unit();
            for (body, truth) in
                [(&cuboid, half.dot(&n.abs())), (&cylinder, half.x * n.x.hypot(n.y) + half.y * n.z.abs())]
            {
                let truth = truth - n.dot(body.interior_point());
                assert!((body.height(&n) - truth).abs() < 3e-14 && body.height(&n) >= truth, "{}", body.name());
            }
        }
    }

    /// A body with edges that has no closed form: a slanted box, and a superellipsoid cut by slabs.
    fn edged() -> [Body; 2] {
        let cuboid = Body::cuboid("box", Vector3::new(1.0, 0.3, 0.05)).unwrap();
        let mut slanted = *cuboid.normalization();
        slanted.linear[(0, 1)] = 0.7;
        let round = Body::superellipsoid("q6", Vector3::zeros(), Vector3::new(1.0, 0.8, 0.5), 6).unwrap();
        let mut constraints = round.constraints().to_vec();
        constraints.push(cuboid.constraints()[1].clone());
        let mut cut = *round.normalization();
        cut.linear[(1, 1)] *= 0.5;
        [
            Body::new("slanted", slanted, cuboid.constraints().to_vec()).unwrap(),
            Body::new("cut", cut, constraints).unwrap(),
        ]
    }

    #[test]
    fn heights_are_those_of_support_points() {
        for body in edged() {
            assert!(body.closed_form().is_none() && body.heights_bytes() > 0);
            let mut random = Seeded(100);
            for _ in 0..500 {
                let n = random.unit();
                let support = body.support(&n);
                let reached = n.dot(&(support.point - body.interior_point()));
                let height = body.height(&n);
                assert!(height >= reached * (1.0 - 1e-9), "{} {n:?}: {height} {reached}", body.name());
                assert!(height <= 1.1 * support.height_m, "{} {n:?}: {height} {}", body.name(), support.height_m);
            }
        }
    }
}
