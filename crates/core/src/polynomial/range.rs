//! Lower bounds of a polynomial over boxes, by its Taylor expansion at the centre.

use super::dense::{dense, shifted};
use super::{Polynomial, gamma};
use nalgebra::Vector3;

/// Roundings on the way into the bound: 16 in each of three shifts, 9 for a term, 165 for their
/// sum; some to spare.
const RANGE_ROUNDINGS: usize = 300;

impl Polynomial {
    /// The value at `center`, up to rounding, and a proven lower bound of the values where `|z_i -
    /// center_i| <= half_i`.
    pub fn floor_within(&self, center: &Vector3<f64>, half: &Vector3<f64>) -> (f64, f64) {
        floor_within(self, center, half)
    }
}

/// Value at the centre, up to rounding, and lower bound of p over the box `|z_i - center_i| <=
/// half_i`: with `p(center + δ) = Σ c_e δ^e`, squares do not go below 0, and other terms not below
/// `-|c_e| half^e`. The bound is short by O(half²).
fn floor_within(p: &Polynomial, center: &Vector3<f64>, half: &Vector3<f64>) -> (f64, f64) {
    let degree = p.degree();
    let mut here = dense(p.terms());
    for axis in 0..3 {
        here = shifted(&here, degree, center[axis], axis);
    }
    let powers: [[f64; 9]; 3] = std::array::from_fn(|i| {
        let mut powers = [1.0; 9];
        for e in 1..=degree {
            powers[e] = powers[e - 1] * half[i];
        }
        powers
    });
    let mut least = here[0][0][0];
    for a in 0..=degree {
        for b in 0..=degree - a {
            for c in 0..=degree - a - b {
                let coefficient = here[a][b][c];
                let square = a % 2 == 0 && b % 2 == 0 && c % 2 == 0;
                if a + b + c > 0 && !(square && coefficient > 0.0) {
                    least -= coefficient.abs() * powers[0][a] * powers[1][b] * powers[2][c];
                }
            }
        }
    }
    // Every product that enters is one of |p| expanded at |center| and taken at half.
    let (magnitude, _) = p.absolute.magnitude((center.abs() + half).amax() * (1.0 + f64::EPSILON));
    (here[0][0][0], least - gamma(RANGE_ROUNDINGS) * magnitude)
}

#[cfg(test)]
mod tests {
    use crate::polynomial::{Polynomial, monomials};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn nothing_in_the_box_is_lower_and_small_boxes_are_bounded_closely() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let p = Polynomial::new(monomials(degree).into_iter().map(|e| (e, random.signed())).collect()).unwrap();
            for size in [0.5, 1e-2, 1e-4, 0.0] {
                let center = Vector3::from_fn(|_, _| 2.0 * random.signed());
                let half = Vector3::from_fn(|_, _| size * random.signed().abs());
                let (middle, bound) = p.floor_within(&center, &half);
                assert!((middle - p.evaluate(&center).value).abs() < 1e-9, "seed {seed}");
                let mut met = f64::INFINITY;
                for _ in 0..300 {
                    // Corners and faces too.
                    let z = center + half.map(|h| h * (2.0 * random.signed()).clamp(-1.0, 1.0));
                    met = met.min(p.evaluate(&z).value);
                }
                // What evaluations are off by.
                assert!(bound <= met + 1e-9, "seed {seed}: {bound} above {met}");
                if size <= 1e-2 {
                    let scale = p.evaluate(&center).hessian.amax() + 1e3;
                    assert!(met - bound < 10.0 * scale * size * size + 1e-4 * size * scale + 1e-9, "seed {seed}");
                }
            }
        }
    }
}
