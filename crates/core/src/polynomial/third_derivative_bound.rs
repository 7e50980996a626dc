//! Upper bound of the third derivatives of a convex polynomial near its level 1.
//!
//! The sum of absolute coefficients bounds a derivative on a box about the origin, but loses all
//! cancellation between terms: a factor of ten and more for fitted polynomials. So the
//! neighbourhood of the level is covered with small cubes; shifted to the centre of each, the
//! polynomial has its cancellation done, and what Taylor's formula adds for the small cube is
//! little.

use super::Polynomial;
use super::dense::{Dense, dense, shifted};
use super::rounding::gamma;
use nalgebra::Vector3;

/// Cubes along each axis of the cube around the ball.
const CUBES: usize = 16;

/// Distance of a value from 1 up to which the bound of the third derivatives holds; dimensionless.
///
/// Searches end at the level 1 and use the bound for their last steps only. A larger value makes
/// the bound larger, a smaller one leaves fewer points where it can be used. No test fixes the
/// value: those of the bound draw points from whatever interval it states.
pub const NEAR_LEVEL: f64 = 0.25;

/// Distance from a cube up to which its bound holds, relative to half its edge; dimensionless.
///
/// A step from a point near the level may end that far outside of the cubes that meet the level. A
/// larger value makes the bound larger; a smaller one shortens the steps that it covers. No test
/// fixes the value: those of the bound draw steps of the length that follows from it.
const SURROUNDINGS: f64 = 0.125;

/// A bound of third derivatives and how far from where it holds it still does.
#[derive(Clone, Copy, Debug)]
pub struct ThirdCeiling {
    /// Bound of `|D³p(z)[u, v, w]|` over unit vectors u, v, w.
    pub ceiling: f64,
    /// Length of a step from a point near the level along which the bound holds.
    pub leeway: f64,
    /// Length per second derivative along which a rise keeps half of what that alone would make it:
    /// 3/2 over the ceiling.
    pub kept: f64,
}

impl ThirdCeiling {
    fn new(ceiling: f64, leeway: f64) -> Self {
        Self { ceiling, leeway, kept: 1.5 * (1.0 - 1e-12) / ceiling }
    }
}

impl Polynomial {
    /// Upper bound of the third derivatives of this polynomial, which must be convex, over the
    /// points with `|z_i| <= radius` whose values are within [`NEAR_LEVEL`] of 1.
    pub fn third_ceiling(&self, radius: f64) -> ThirdCeiling {
        third_ceiling(self, radius, self.absolute.third_ceiling(2.0 * radius))
    }
}

/// Bound over the points with `|z_i| <= radius` where the convex `p` is within [`NEAR_LEVEL`] of 1,
/// and along steps of the leeway from there: the largest Frobenius norm of the third derivative.
/// `absolute` is the same bound by absolute coefficients on the cube of twice the size.
fn third_ceiling(p: &Polynomial, radius: f64, absolute: f64) -> ThirdCeiling {
    let half = radius / CUBES as f64;
    let leeway = SURROUNDINGS * half;
    let degree = p.degree();
    if degree < 3 {
        return ThirdCeiling::new(0.0, f64::INFINITY);
    }
    let dense = dense(p.terms());
    let corner = |i: usize| 2.0 * i as f64 * half - radius;
    let value = |i: usize, j: usize, k: usize| p.evaluate(&Vector3::new(corner(i), corner(j), corner(k))).value;
    let mut values = [[[0.0; CUBES + 1]; CUBES + 1]; CUBES + 1];
    for (i, plane) in values.iter_mut().enumerate() {
        for (j, line) in plane.iter_mut().enumerate() {
            for (k, entry) in line.iter_mut().enumerate() {
                *entry = value(i, j, k);
            }
        }
    }
    let mut largest = 0.0_f64;
    for i in 0..CUBES {
        let along_x = shifted(&dense, degree, corner(i) + half, 0);
        for j in 0..CUBES {
            let along_xy = shifted(&along_x, degree, corner(j) + half, 1);
            for k in 0..CUBES {
                let center = Vector3::new(corner(i) + half, corner(j) + half, corner(k) + half);
                let jet = p.evaluate(&center);
                // Convexity: nowhere in the cube is p below its tangent plane, nor above its
                // largest corner.
                let lowest = jet.value - half * jet.gradient.abs().sum();
                let corners = (0..8).map(|c| values[i + (c & 1)][j + (c >> 1 & 1)][k + (c >> 2)]);
                let highest = corners.fold(f64::MIN, f64::max);
                // Ten times what evaluations can be off by, or all of the cubes.
                let slack = 1e-6;
                if lowest <= 1.0 + NEAR_LEVEL + slack && highest >= 1.0 - NEAR_LEVEL - slack {
                    let here = shifted(&along_xy, degree, center.z, 2);
                    largest = largest.max(norm_within(&here, degree, 1.7321 * half + leeway));
                }
            }
        }
    }
    // Each coefficient passed through fewer than 3 * 8 * 2 roundings, on a sum bounded by the one
    // of absolute values.
    ThirdCeiling::new((largest * (1.0 + 1e-12) + gamma(100) * absolute) * (1.0 + 1e-12), leeway)
}

/// Bound of the Frobenius norm of the third derivative at all points within `distance`, by Taylor's
/// formula: the k-th derivative of `Σ c_e z^e` at the origin has the squared norm `Σ k! e! c_e²`
/// over the e of degree k.
fn norm_within(dense: &Dense, degree: usize, distance: f64) -> f64 {
    let mut squares = [0.0; 9];
    for a in 0..=degree {
        for b in 0..=degree - a {
            for c in 0..=degree - a - b {
                squares[a + b + c] += dense[a][b][c].powi(2) * FACTORIAL[a] * FACTORIAL[b] * FACTORIAL[c];
            }
        }
    }
    let term = |k: usize| (squares[k] * FACTORIAL[k]).sqrt() * distance.powi(k as i32 - 3) / FACTORIAL[k - 3];
    (3..=degree).map(term).sum()
}

const FACTORIAL: [f64; 9] = [1.0, 1.0, 2.0, 6.0, 24.0, 120.0, 720.0, 5040.0, 40320.0];

#[cfg(test)]
mod tests {
    use super::NEAR_LEVEL;
    use crate::polynomial::Polynomial;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn no_difference_of_hessians_exceeds_it() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let degree = [4_u8, 6, 8][(seed % 3) as usize];
            // Sums of powers of linear forms are convex.
            let mut terms = std::collections::BTreeMap::new();
            for _ in 0..6 {
                let a = Vector3::from_fn(|_, _| random.signed());
                for e in
                    super::super::monomials(usize::from(degree)).into_iter().filter(|e| e.iter().sum::<u8>() == degree)
                {
                    let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
                    let count = factorial(degree) / e.iter().map(|&n| factorial(n)).product::<f64>();
                    *terms.entry(e).or_insert(0.0) +=
                        count * (0..3).map(|i| a[i].powi(i32::from(e[i]))).product::<f64>();
                }
            }
            let p = Polynomial::new(terms.into_iter().collect()).unwrap();
            let radius = 3.0;
            let bound = p.third_ceiling(radius);
            let mut tried = 0;
            while tried < 500 {
                // Along a ray to the level, and a small step from there.
                let ray = Vector3::from_fn(|_, _| random.signed());
                let level = 1.0 + NEAR_LEVEL * random.signed();
                let u = ray * (level / p.evaluate(&ray).value).powf(1.0 / f64::from(degree));
                let step = Vector3::from_fn(|_, _| random.signed()).normalize() * bound.leeway * random.signed();
                if u.amax() > radius {
                    continue;
                }
                tried += 1;
                let change = (p.evaluate(&u).hessian - p.evaluate(&(u + step)).hessian).symmetric_eigenvalues().amax();
                assert!(change <= bound.ceiling * step.norm() + 1e-12, "seed {seed}: {change} above {bound:?}");
            }
        }
    }

    #[test]
    fn it_is_not_much_above_what_is_met() {
        // |z|^6: third derivatives of norm at most 6 · 4 · 5 on the unit sphere, times the count of
        // their index orders.
        let p = Polynomial::new(
            (0..=3_u8)
                .flat_map(|i| (0..=3 - i).map(move |j| [i, j, 3 - i - j]))
                .map(|e| {
                    let factorial = |n: u8| (1..=n).map(f64::from).product::<f64>();
                    (e.map(|n| 2 * n), 6.0 / e.iter().map(|&n| factorial(n)).product::<f64>())
                })
                .collect(),
        )
        .unwrap();
        let ceiling = p.third_ceiling(1.1).ceiling;
        let change = |u: Vector3<f64>, v: Vector3<f64>| {
            (p.evaluate(&u).hessian - p.evaluate(&v).hessian).symmetric_eigenvalues().amax() / (u - v).norm()
        };
        let met = change(Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.001, 0.0, 0.0));
        assert!(ceiling < 8.0 * met, "{ceiling} where {met} is met");
    }
}
