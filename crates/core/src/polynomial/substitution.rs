//! Polynomials of affine images, `p(A v + b)`, with coefficients that are enclosed by intervals.

use super::interval::Interval;
use super::monomial::{Exponents, count, degree_of, monomials, position};
use super::{MAX_DEGREE, Polynomial, PolynomialError};
use nalgebra::{Matrix3, Vector3};

/// An affine map `z = A v + b` known up to rounding: it stands for every map within.
#[derive(Clone, Copy, Debug)]
pub struct Substitution {
    linear: [[Interval; 3]; 3],
    offset: [Interval; 3],
}

impl Substitution {
    /// The exact `z = linear (origin + axes v - center)`: from a frame v, whose points are
    /// `origin + axes v` in metres, to normalized coordinates z.
    pub fn new(linear: &Matrix3<f64>, center: &Vector3<f64>, axes: &Matrix3<f64>, origin: &Vector3<f64>) -> Self {
        let row = |i: usize, column: &dyn Fn(usize) -> Interval| {
            (0..3).fold(Interval::ZERO, |sum, k| sum + Interval::of(linear[(i, k)]) * column(k))
        };
        let shift = |k: usize| Interval::of(origin[k]) - Interval::of(center[k]);
        Self {
            linear: std::array::from_fn(|i| std::array::from_fn(|j| row(i, &|k| Interval::of(axes[(k, j)])))),
            offset: std::array::from_fn(|i| row(i, &shift)),
        }
    }

    /// The map `x = R (L⁻¹ z + c) + t` from normalized coordinates to a space, R a rotation whose
    /// matrix is rounded; none where L has no inverse that can be enclosed.
    pub fn to_space(
        linear: &Matrix3<f64>,
        center: &Vector3<f64>,
        rotation: &Matrix3<f64>,
        translation: &Vector3<f64>,
    ) -> Option<Self> {
        let inverse = enclosed_inverse(linear)?;
        let rotation: [[Interval; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| Interval::around(rotation[(i, j)], ROTATION_ENTRY_ERROR)));
        let sum = |i: usize, of: &dyn Fn(usize) -> Interval| {
            (0..3).fold(Interval::ZERO, |sum, k| sum + rotation[i][k] * of(k))
        };
        Some(Self {
            linear: std::array::from_fn(|i| std::array::from_fn(|j| sum(i, &|k| inverse[k][j]))),
            offset: std::array::from_fn(|i| sum(i, &|k| Interval::of(center[k])) + Interval::of(translation[i])),
        })
    }

    /// This map into a space, followed by `z = L (Rᵀ (x - t) - c)` to normalized coordinates, R a
    /// rotation whose matrix is rounded.
    pub fn then_normalized(
        &self,
        linear: &Matrix3<f64>,
        center: &Vector3<f64>,
        rotation: &Matrix3<f64>,
        translation: &Vector3<f64>,
    ) -> Self {
        let transposed: [[Interval; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| Interval::around(rotation[(j, i)], ROTATION_ENTRY_ERROR)));
        let sum = |of: &dyn Fn(usize) -> Interval| (0..3).fold(Interval::ZERO, |sum, k| sum + of(k));
        let turned = |i: usize, column: &dyn Fn(usize) -> Interval| sum(&|k| transposed[i][k] * column(k));
        let mapped = |i: usize, column: &dyn Fn(usize) -> Interval| sum(&|k| Interval::of(linear[(i, k)]) * column(k));
        let from_origin = |k: usize| self.offset[k] - Interval::of(translation[k]);
        let from_center = |k: usize| turned(k, &from_origin) - Interval::of(center[k]);
        Self {
            linear: std::array::from_fn(|i| std::array::from_fn(|j| mapped(i, &|k| turned(k, &|l| self.linear[l][j])))),
            offset: std::array::from_fn(|i| mapped(i, &from_center)),
        }
    }

    /// A and b, rounded, and a bound of `|z - (A v + b)|` where `|v_i| <= most_i`, in units of z.
    pub fn rounded(&self, most: &Vector3<f64>) -> (Matrix3<f64>, Vector3<f64>, f64) {
        let middle = |i: usize, j: usize| self.linear[i][j].middle();
        let (linear, offset) = (Matrix3::from_fn(middle), Vector3::from_fn(|i, _| self.offset[i].middle()));
        let errors = Vector3::from_fn(|i, _| {
            let radius = |interval: Interval| (interval - Interval::of(interval.middle())).magnitude();
            (0..3).fold(radius(self.offset[i]), |sum, j| sum + radius(self.linear[i][j]) * most[j])
        });
        (linear, offset, errors.norm() * (1.0 + 1e-14))
    }

    /// `p(A v + b)` with rounded coefficients, and a bound of what they are off by where `|v_i| <=
    /// most_i`.
    ///
    /// # Errors
    /// A polynomial that rounding leaves without its leading terms, or numbers that are not finite.
    pub fn compose(&self, polynomial: &Polynomial, most: &Vector3<f64>) -> Result<(Polynomial, f64), PolynomialError> {
        let enclosed = self.apply(polynomial);
        let order = monomials(polynomial.degree());
        let power = |e: Exponents| (0..3).map(|k| most[k].powi(i32::from(e[k]))).product::<f64>();
        let error: f64 = enclosed
            .iter()
            .zip(&order)
            .map(|(interval, &e)| (*interval - Interval::of(interval.middle())).magnitude() * power(e))
            .sum();
        let terms = order.iter().zip(&enclosed).map(|(&e, interval)| (e, interval.middle())).collect();
        Ok((Polynomial::new(terms)?, error * (1.0 + 1e-13)))
    }

    /// A row of A, and of b.
    pub(super) fn row(&self, axis: usize) -> ([Interval; 3], Interval) {
        (self.linear[axis], self.offset[axis])
    }

    /// `p(A v + b)`, its coefficients in the order of [`monomials`].
    pub(super) fn apply(&self, polynomial: &Polynomial) -> Vec<Interval> {
        let order = monomials(polynomial.degree().min(MAX_DEGREE));
        // The image of each monomial is one factor z_i times that of a monomial of one degree less.
        let mut images: Vec<Vec<Interval>> = Vec::with_capacity(order.len());
        for &exponents in &order {
            let Some(axis) = (0..3).find(|&i| exponents[i] > 0) else {
                images.push(vec![Interval::of(1.0)]);
                continue;
            };
            let mut lower = exponents;
            lower[axis] -= 1;
            images.push(self.times(axis, &images[position(lower)], degree_of(exponents), &order));
        }
        let mut sum = vec![Interval::ZERO; order.len()];
        for &(exponents, coefficient) in polynomial.terms() {
            for (sum, &image) in sum.iter_mut().zip(&images[position(exponents)]) {
                *sum = *sum + Interval::of(coefficient) * image;
            }
        }
        sum
    }

    /// `z_axis` times a polynomial of v, of degree one less than `degree`.
    fn times(&self, axis: usize, known: &[Interval], degree: usize, order: &[Exponents]) -> Vec<Interval> {
        let mut product = vec![Interval::ZERO; count(degree)];
        for (&coefficient, &exponents) in known.iter().zip(order) {
            let place = position(exponents);
            product[place] = product[place] + self.offset[axis] * coefficient;
            for j in 0..3 {
                let mut higher = exponents;
                higher[j] += 1;
                let place = position(higher);
                product[place] = product[place] + self.linear[axis][j] * coefficient;
            }
        }
        product
    }

    /// Whether A is surely invertible.
    pub(super) fn is_invertible(&self) -> bool {
        let [a, b, c] = self.linear;
        let minor = |i: usize, j: usize| b[i] * c[j] - b[j] * c[i];
        (a[0] * minor(1, 2) - a[1] * minor(0, 2) + a[2] * minor(0, 1)).is_nonzero()
    }
}

/// Bound of the error of an entry of the matrix of a rotation, dimensionless, that was computed of
/// a quaternion of unit length but for rounding.
///
/// A smaller value could leave the exact map outside of the intervals, and proofs of containment
/// false; a larger one widens them. Exercised by `maps_through_a_space_contain_exact_images`.
const ROTATION_ENTRY_ERROR: f64 = 16.0 * f64::EPSILON;

/// The inverse, enclosed: with `E = I - LX` small, `L⁻¹ = X + X E (I - E)⁻¹`.
fn enclosed_inverse(linear: &Matrix3<f64>) -> Option<[[Interval; 3]; 3]> {
    let inverse = linear.try_inverse()?;
    let residual = |i: usize, j: usize| {
        let product =
            (0..3).fold(Interval::ZERO, |sum, k| sum + Interval::of(linear[(i, k)]) * Interval::of(inverse[(k, j)]));
        (Interval::of(f64::from(u8::from(i == j))) - product).magnitude()
    };
    let norms = (0..3).map(|i| (0..3).map(|j| residual(i, j)).sum::<f64>());
    let norm = norms
        .fold(0.0, |most: f64, norm| if norm.is_nan() || most.is_nan() { f64::NAN } else { most.max(norm) })
        * (1.0 + 1e-14);
    if !(norm < 0.5) {
        return None;
    }
    let radius = |i: usize| inverse.row(i).abs().sum() * (norm / (1.0 - norm)) * (1.0 + 1e-14);
    Some(std::array::from_fn(|i| std::array::from_fn(|j| Interval::around(inverse[(i, j)], radius(i)))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use dashu_ratio::RBig;
    use sublevel_testkit::Seeded;

    fn exact(value: f64) -> RBig {
        RBig::try_from(value).unwrap()
    }

    fn power(x: &RBig, exponent: u8) -> RBig {
        (0..exponent).fold(RBig::ONE, |product, _| product * x)
    }

    fn at(v: &[RBig; 3], e: Exponents) -> RBig {
        power(&v[0], e[0]) * power(&v[1], e[1]) * power(&v[2], e[2])
    }

    /// The exact value must lie between the polynomials of lower and of upper coefficients, at
    /// points with v >= 0.
    #[test]
    fn exact_values_lie_between_those_of_the_bounds() {
        for seed in 0..24 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            // A metre-sized or millimetre-sized set, near or far from the origin.
            let size = [1.0, 1e-3][(seed / 4 % 2) as usize];
            let far = [0.0, 1e6][(seed / 8 % 2) as usize];
            let p = Polynomial::new(monomials(degree).into_iter().map(|e| (e, random.signed())).collect()).unwrap();
            let linear = Matrix3::from_fn(|_, _| random.signed() / size);
            let axes = Matrix3::from_fn(|_, _| random.signed() * size);
            let center = Vector3::from_fn(|_, _| far + random.signed() * size);
            let origin = Vector3::from_fn(|_, _| far + random.signed() * size);
            let map = Substitution::new(&linear, &center, &axes, &origin);
            let enclosed = map.apply(&p);
            let v: [RBig; 3] = std::array::from_fn(|_| exact(random.signed().abs()));
            let x: [RBig; 3] = std::array::from_fn(|i| {
                (0..3).fold(exact(origin[i]) - exact(center[i]), |sum, j| sum + exact(axes[(i, j)]) * &v[j])
            });
            let z: [RBig; 3] =
                std::array::from_fn(|i| (0..3).fold(RBig::ZERO, |sum, j| sum + exact(linear[(i, j)]) * &x[j]));
            let value = p.terms().iter().fold(RBig::ZERO, |sum, &(e, c)| sum + exact(c) * at(&z, e));
            // |value - Σ middle v^e| <= Σ radius v^e
            let (mut middle, mut radius) = (RBig::ZERO, RBig::ZERO);
            for (&interval, e) in enclosed.iter().zip(monomials(degree)) {
                let half = (interval - Interval::of(interval.middle())).magnitude();
                middle += exact(interval.middle()) * at(&v, e);
                radius += exact(half) * at(&v, e);
                // Hundreds of terms, some of which cancel.
                assert!(half < 1e-10 * (1.0 + interval.magnitude()), "seed {seed}: {interval:?}");
            }
            let error = if value > middle { value - middle } else { middle - value };
            assert!(error <= radius, "seed {seed}");
        }
    }

    /// To a space and on to other normalized coordinates: exact images of points lie between those
    /// of the bounds, and both maps of one frame and pose undo each other.
    #[test]
    fn maps_through_a_space_contain_exact_images() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let mut frame = || {
                let linear = Matrix3::from_fn(|i, j| random.signed() + if i == j { 3.0 } else { 0.0 });
                let [center, translation] = [0; 2].map(|_| Vector3::from_fn(|_, _| random.signed()));
                (linear, center, random.rotation().to_rotation_matrix().into_inner(), translation)
            };
            let [(l, c, r, t), (m, d, q, s)] = [frame(), frame()];
            let space = Substitution::to_space(&l, &c, &r, &t).unwrap();
            let there = space.then_normalized(&m, &d, &q, &s);
            let back = space.then_normalized(&l, &c, &r, &t);
            let z = Vector3::from_fn(|_, _| random.signed());
            let image = m * (q.transpose() * (r * (l.try_inverse().unwrap() * z + c) + t - s) - d);
            for (map, image) in [(there, image), (back, z)] {
                for i in 0..3 {
                    let ((row, offset), mut width) = (map.row(i), 0.0);
                    let sum = (0..3).fold(offset, |sum, k| sum + row[k] * Interval::of(z[k]));
                    for entry in row.iter().chain([&offset]) {
                        width += (*entry - Interval::of(entry.middle())).magnitude();
                    }
                    // The image itself is rounded, by far less than the matrices may be.
                    let (off, half) = (image[i] - sum.middle(), (sum - Interval::of(sum.middle())).magnitude());
                    assert!(off.abs() <= half && width < 1e-12, "seed {seed}: {off} of {half}, {width}");
                }
            }
        }
    }

    #[test]
    fn only_provably_invertible_maps_are_called_so() {
        let of = |axes: Matrix3<f64>| {
            Substitution::new(&Matrix3::identity(), &Vector3::zeros(), &axes, &Vector3::zeros()).is_invertible()
        };
        assert!(of(Matrix3::new(1.0, 2.0, 0.0, 0.0, 1e-9, 0.0, 0.0, 5.0, -3.0)));
        assert!(!of(Matrix3::new(1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.1, 0.7, -3.0)));
        // Singular but for rounding.
        assert!(!of(Matrix3::new(0.1, 0.2, 0.3, 0.3, 0.6, 0.9 - 1e-16, 0.7, 0.1, 0.2)));
        assert!(!of(Matrix3::from_element(f64::NAN)));
    }
}
