//! Linear bounds of a polynomial over boxes, by its Taylor expansion at the centre.

use super::dense::{dense, shift};
use super::{Polynomial, gamma};
use nalgebra::Vector3;

/// Roundings on the way into the bounds: 16 in each of three shifts, 9 for a term, 165 for their
/// sum; some to spare.
const RANGE_ROUNDINGS: usize = 300;

/// `value + gradient·δ + below <= p(center + δ) <= value + gradient·δ + above` where `|δ_i| <=
/// half_i`; rounding is part of `below <= 0` and `above >= 0`, which are O(half²).
#[derive(Clone, Copy, Debug)]
pub struct LinearBounds {
    /// The value at the centre, up to rounding.
    pub value: f64,
    /// The gradient there, up to rounding.
    pub gradient: Vector3<f64>,
    /// What is to be added for a lower bound.
    pub below: f64,
    /// What is to be added for an upper bound.
    pub above: f64,
}

impl LinearBounds {
    /// Lower bound over the box with these half edges, without a unit.
    pub fn least(&self, half: &Vector3<f64>) -> f64 {
        self.value + self.below - self.reach(half)
    }

    /// Upper bound over the box with these half edges, without a unit.
    pub fn most(&self, half: &Vector3<f64>) -> f64 {
        self.value + self.above + self.reach(half)
    }

    /// Of the linear term. The bounds cover its rounding.
    fn reach(&self, half: &Vector3<f64>) -> f64 {
        self.gradient.abs().dot(half)
    }
}

impl Polynomial {
    /// Proven linear bounds on the box of points with `|z_i - center_i| <= half_i`.
    ///
    /// With `p(center + δ) = Σ c_e δ^e`, a term of order two or more does not exceed `|c_e|
    /// half^e`, nor fall below 0 where it is a positive multiple of a square. Of order two the
    /// mixed terms are set against the squares, `2 |c δ_i δ_j| <= |c| half_i half_j (s_i² + s_j²)`
    /// with `δ_i = half_i s_i`, so that small boxes where p is convex lose what is of order three
    /// only.
    pub fn linear_bounds(&self, center: &Vector3<f64>, half: &Vector3<f64>) -> LinearBounds {
        let degree = self.degree();
        let mut here = dense(self.terms());
        for axis in 0..3 {
            shift(&mut here, degree, center[axis], axis);
        }
        let powers: [[f64; 9]; 3] = std::array::from_fn(|i| {
            let mut powers = [1.0; 9];
            for e in 1..=degree {
                powers[e] = powers[e - 1] * half[i];
            }
            powers
        });
        let gradient = Vector3::new(here[1][0][0], here[0][1][0], here[0][0][1]);
        let (mut below, mut above) = (0.0, 0.0);
        for a in 0..=degree {
            for b in 0..=degree - a {
                let size = powers[0][a] * powers[1][b];
                for c in 3_usize.saturating_sub(a + b)..=degree - a - b {
                    let most = here[a][b][c].abs() * size * powers[2][c];
                    let square = a % 2 == 0 && b % 2 == 0 && c % 2 == 0;
                    if !square || here[a][b][c] > 0.0 {
                        above += most;
                    }
                    if !square || here[a][b][c] < 0.0 {
                        below -= most;
                    }
                }
            }
        }
        let squares = [here[2][0][0], here[0][2][0], here[0][0][2]];
        let mixed =
            [here[0][1][1] * half[1] * half[2], here[1][0][1] * half[0] * half[2], here[1][1][0] * half[0] * half[1]];
        for axis in 0..3 {
            let others = 0.5 * (mixed[(axis + 1) % 3].abs() + mixed[(axis + 2) % 3].abs());
            let own = squares[axis] * powers[axis][2];
            above += (own + others).max(0.0);
            below += (own - others).min(0.0);
        }
        // Every product that enters is one of |p| expanded at |center| and taken at half.
        let (magnitude, _) = self.absolute.magnitude((center.abs() + half).amax() * (1.0 + f64::EPSILON));
        let rounding = gamma(RANGE_ROUNDINGS) * magnitude;
        LinearBounds { value: here[0][0][0], gradient, below: below - rounding, above: above + rounding }
    }
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
                let linear = p.linear_bounds(&center, &half);
                let bound = linear.least(&half);
                assert!((linear.value - p.evaluate(&center).value).abs() < 1e-9, "seed {seed}");
                let mut met = f64::INFINITY;
                for _ in 0..300 {
                    // Corners and faces too.
                    let z = center + half.map(|h| h * (2.0 * random.signed()).clamp(-1.0, 1.0));
                    let (value, along) = (p.evaluate(&z).value, linear.value + linear.gradient.dot(&(z - center)));
                    assert!(along + linear.below <= value + 1e-9, "seed {seed}");
                    assert!(along + linear.above >= value - 1e-9, "seed {seed}");
                    assert!(linear.most(&half) >= value - 1e-9, "seed {seed}");
                    met = met.min(value);
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
