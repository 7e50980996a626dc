//! A polynomial along a line: as many values as fix it, side by side, and what they interpolate.

use super::horner::Nested;
use super::lanes::{Lanes, Vector};
use super::simd::{Simd, WithSimd, dispatch};
use super::simd_real::Number;
use nalgebra::Vector3;

/// Most values that are computed: those of degree 8, rounded up to whole vectors.
const MAX_LINE_VALUES: usize = 16;

/// Steps of Newton's method; the first guess is the root of a chord, and 3 to 5 are usual.
const ROOT_STEPS: usize = 8;

/// What is interpolated from equidistant values on [-1, 1], for one degree.
struct Scheme {
    nodes: [f64; MAX_LINE_VALUES],
    /// Row k: the coefficients, from the constant one on, of the polynomial that is 1 at node k and
    /// 0 at the others.
    basis: [[f64; MAX_LINE_VALUES]; 9],
}

/// One for each even degree.
static SCHEMES: [Scheme; 4] = [Scheme::new(2), Scheme::new(4), Scheme::new(6), Scheme::new(8)];

impl Scheme {
    const fn new(degree: usize) -> Self {
        let (mut nodes, mut basis) = ([1.0; MAX_LINE_VALUES], [[0.0; MAX_LINE_VALUES]; 9]);
        let mut k = 0;
        while k <= degree {
            nodes[k] = 2.0 * k as f64 / degree as f64 - 1.0;
            k += 1;
        }
        k = 0;
        while k <= degree {
            // The product over the other nodes t_j of (t - t_j) / (t_k - t_j).
            let row = &mut basis[k];
            row[0] = 1.0;
            let (mut j, mut length) = (0, 1);
            while j <= degree {
                if j != k {
                    let inverse = 1.0 / (nodes[k] - nodes[j]);
                    let mut i = length;
                    while i > 0 {
                        row[i] = (row[i - 1] - row[i] * nodes[j]) * inverse;
                        i -= 1;
                    }
                    row[0] *= -nodes[j] * inverse;
                    length += 1;
                }
                j += 1;
            }
            k += 1;
        }
        Self { nodes, basis }
    }
}

/// `f(t) = p(middle + t half)`, -1 <= t <= 1, from its values, as a task.
struct Line<'a> {
    nested: &'a Nested,
    middle: &'a Vector3<f64>,
    half: &'a Vector3<f64>,
    level: f64,
}

/// About the first t in [-1, 1] at which f, if convex, decreases to `level`; where f is lowest, of
/// equidistant t, if at none of these it lies below. A guess: nothing is proven of it.
pub(super) fn first_below(nested: &Nested, middle: &Vector3<f64>, half: &Vector3<f64>, level: f64) -> f64 {
    dispatch(Line { nested, middle, half, level })
}

impl WithSimd for Line<'_> {
    type Output = f64;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> f64 {
        let scheme = &SCHEMES[self.nested.degree() / 2 - 1];
        let (values, coefficients) = self.interpolate(simd, scheme);
        let (nodes, values) = (&scheme.nodes[..=self.nested.degree()], &values[..=self.nested.degree()]);
        let Some(k) = values.iter().position(|&value| value <= self.level) else {
            let lowest =
                (0..=self.nested.degree()).min_by(|&i, &j| values[i].total_cmp(&values[j])).unwrap_or_default();
            return nodes[lowest];
        };
        if k == 0 {
            return nodes[0];
        }
        // The chord of a convex function runs above it.
        let share = (values[k - 1] - self.level) / (values[k - 1] - values[k]);
        let mut t = nodes[k - 1] + share * (nodes[k] - nodes[k - 1]);
        for _ in 0..ROOT_STEPS {
            let (mut value, mut slope) = (0.0, 0.0);
            for &c in coefficients[..=self.nested.degree()].iter().rev() {
                slope = Number::<S>::mul_add(slope, t, value);
                value = Number::<S>::mul_add(value, t, c);
            }
            if slope >= 0.0 {
                // Beyond where f is lowest.
                t = 0.5 * (nodes[k - 1] + t);
                continue;
            }
            let step = (value - self.level) / slope;
            t = (t - step).clamp(nodes[k - 1], nodes[k]);
            if step.abs() <= 1e-13 {
                break;
            }
        }
        t
    }
}

impl Line<'_> {
    /// The values at the nodes, and the coefficients of f from the constant one on.
    #[inline(always)]
    fn interpolate<S: Simd>(&self, simd: S, scheme: &Scheme) -> ([f64; MAX_LINE_VALUES], [f64; MAX_LINE_VALUES]) {
        let splat = |v: f64| Lanes::<S>::splat(simd, v);
        let (mut values, mut coefficients) = ([0.0; MAX_LINE_VALUES], [0.0; MAX_LINE_VALUES]);
        for from in (0..=self.nested.degree()).step_by(Lanes::<S>::COUNT) {
            let t = Lanes::<S>::load(simd, &scheme.nodes[from..]);
            let mut z = [t; 3];
            for i in 0..3 {
                z[i] = t.mul_add(splat(self.half[i]), splat(self.middle[i]));
            }
            // The compiler leaves out what only derivatives need.
            self.nested.jet(simd, z).value.store(&mut values[from..]);
        }
        for from in (0..=self.nested.degree()).step_by(Lanes::<S>::COUNT) {
            let mut sum = splat(0.0);
            for (value, row) in values[..=self.nested.degree()].iter().zip(&scheme.basis) {
                sum = splat(*value).mul_add(Lanes::load(simd, &row[from..]), sum);
            }
            sum.store(&mut coefficients[from..]);
        }
        (values, coefficients)
    }
}

#[cfg(test)]
mod tests {
    use super::{Line, SCHEMES};
    use crate::polynomial::{Polynomial, Scalar, monomials};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn interpolates_what_it_was_given() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let p = Polynomial::new(monomials(degree).into_iter().map(|e| (e, random.signed())).collect()).unwrap();
            let [middle, half] = [0.5, 1.5].map(|size| Vector3::from_fn(|_, _| size * random.signed()));
            let line = Line { nested: &p.nested, middle: &middle, half: &half, level: 1.0 };
            let (values, coefficients) = line.interpolate(Scalar, &SCHEMES[degree / 2 - 1]);
            let largest = values.iter().fold(1.0, |most: f64, value| most.max(value.abs()));
            for i in 0..=50 {
                let t = f64::from(i) / 25.0 - 1.0;
                let interpolated = coefficients.iter().rev().fold(0.0, |sum, c| sum * t + c);
                let exact = p.evaluate(&(middle + half * t)).value;
                assert!((interpolated - exact).abs() <= 1e-12 * largest, "seed {seed}: {interpolated} against {exact}");
            }
        }
    }

    #[test]
    fn finds_the_first_root_of_a_convex_function() {
        let mut misses = 0;
        for seed in 0..400 {
            let mut random = Seeded(seed);
            let e = 2 * (1 + seed % 4) as u8;
            let p = Polynomial::new(vec![([e, 0, 0], 1.0), ([0, e, 0], 1.0), ([0, 0, e], 1.0)]).unwrap();
            // Along x, whose root is known.
            let [shift, y, z] = [0.3, 0.9, 0.9].map(|size| size * random.signed());
            let found =
                shift + 1.6 * p.first_below_along(&Vector3::new(shift, y, z), &Vector3::new(1.6, 0.0, 0.0), 1.0);
            let at = |x: f64| p.evaluate(&Vector3::new(x, y, z)).value;
            let nodes = (0..=e).map(|k| shift + 1.6 * (2.0 * f64::from(k) / f64::from(e) - 1.0));
            let lowest = nodes.map(at).fold(f64::INFINITY, f64::min);
            if lowest > 1.0 {
                misses += 1;
                assert!((at(found) - lowest).abs() < 1e-12, "seed {seed}");
                continue;
            }
            let root = -(1.0 - y.powi(e.into()) - z.powi(e.into())).powf(1.0 / f64::from(e));
            // What rounding of the values moves a root by.
            let off = 1e-13 + 1e-13 / (f64::from(e) * root.abs().powi(i32::from(e) - 1));
            assert!((found - root).abs() <= off, "seed {seed}: {found} against {root}");
        }
        assert!((1..200).contains(&misses), "{misses}");
    }
}
