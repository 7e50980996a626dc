//! Value, gradient and Hessian at many points at once, a lane each, by nested Horner schemes.
//!
//! For one variable Horner's scheme with its derivatives is, for the coefficients c from the
//! highest on,
//!
//! ```text
//! e = e x + d,    d = d x + v,    v = v x + c
//! ```
//!
//! with the value v, the slope d and half the curvature e at the end. A polynomial in three
//! variables is one in z with coefficients that are polynomials in x and y, and these are
//! polynomials in y with coefficients in x: value, slopes and curvatures of the inner schemes are
//! the coefficients of the outer ones. Degree 6 takes 238 multiplications with additions where the
//! product of [`super::hessian_form`] takes 350, but has no rows to spread over a vector for a
//! single point.

use super::jet::NumberJet;
use super::monomial::{Exponents, count};
use super::simd::Simd;
use super::simd_real::{Constant, Number};
use std::cmp::Ordering;

/// All coefficients of a polynomial, zeros included, in the order the schemes take them: highest
/// powers of z first, of equal ones highest powers of y, of equal ones highest powers of x.
#[derive(Clone, Debug)]
pub(super) struct Nested {
    degree: usize,
    coefficients: Vec<Constant>,
}

impl Nested {
    /// Of the polynomial with these terms, of even degree `degree` in 2..=8.
    pub(super) fn new(degree: usize, terms: &[(Exponents, f64)]) -> Self {
        let mut coefficients = Vec::with_capacity(count(degree));
        for k in (0..=degree).rev() {
            for j in (0..=degree - k).rev() {
                for i in (0..=degree - k - j).rev() {
                    let exponents = [i as u8, j as u8, k as u8];
                    let known = terms.binary_search_by_key(&exponents, |term| term.0);
                    coefficients.push(known.map_or(0.0, |index| terms[index].1).into());
                }
            }
        }
        Self { degree, coefficients }
    }

    pub(super) fn degree(&self) -> usize {
        self.degree
    }

    /// Value, gradient and Hessian, to be inlined into work for [`super::dispatch`].
    #[inline(always)]
    pub(super) fn jet<S: Simd, N: Number<S>>(&self, simd: S, z: [N; 3]) -> NumberJet<N> {
        match self.degree {
            2 => jet::<S, N, 2, { count(2) }>(simd, &self.coefficients, z),
            4 => jet::<S, N, 4, { count(4) }>(simd, &self.coefficients, z),
            6 => jet::<S, N, 6, { count(6) }>(simd, &self.coefficients, z),
            _ => jet::<S, N, 8, { count(8) }>(simd, &self.coefficients, z),
        }
    }
}

/// Step number `at` of a scheme whose first coefficient comes with step number `first`.
#[inline(always)]
fn step<S: Simd, N: Number<S>>(at: usize, first: usize, sum: N, x: N, next: N) -> N {
    match at.cmp(&first) {
        Ordering::Less => sum,
        Ordering::Equal => next,
        Ordering::Greater => sum.mul_add(x, next),
    }
}

/// `$each` for all numbers from 0 up to a constant one of at most 8, each a constant: compilers do
/// not unroll loops of loops.
macro_rules! unrolled {
    ($constant:ident in 0..=$last:ident $each:block) => {
        unrolled!($constant $last $each 0 1 2 3 4 5 6 7 8)
    };
    ($constant:ident $last:ident $each:block $($number:literal)*) => {
        $(if $number < $last + 1 {
            const $constant: usize = $number;
            $each
        })*
    };
}

/// The coefficients that are left.
struct Coefficients<'a, const K: usize> {
    all: &'a [Constant; K],
    taken: usize,
}

impl<const K: usize> Coefficients<'_, K> {
    #[inline(always)]
    fn next<S: Simd, N: Number<S>>(&mut self, simd: S) -> N {
        self.taken += 1;
        N::constant(simd, &self.all[self.taken - 1])
    }
}

/// Value, slope and half the curvature of the polynomial in x of this degree that is next.
#[inline(always)]
fn in_x<S: Simd, N: Number<S>, const DEGREE: usize, const K: usize>(
    simd: S,
    coefficients: &mut Coefficients<'_, K>,
    x: N,
) -> [N; 3] {
    let [mut r, mut r_x, mut r_xx] = [N::splat(simd, 0.0); 3];
    unrolled!(I in 0..=DEGREE {
        r_xx = step(I, 2, r_xx, x, r_x);
        r_x = step(I, 1, r_x, x, r);
        r = step(I, 0, r, x, coefficients.next(simd));
    });
    [r, r_x, r_xx]
}

/// The same of a polynomial in x and y: value, slopes, the halves of xx and yy with xy between
/// them.
#[inline(always)]
fn in_x_y<S: Simd, N: Number<S>, const DEGREE: usize, const K: usize>(
    simd: S,
    coefficients: &mut Coefficients<'_, K>,
    [x, y]: [N; 2],
) -> [N; 6] {
    let [mut q, mut q_x, mut q_y, mut q_xx, mut q_xy, mut q_yy] = [x; 6];
    unrolled!(J in 0..=DEGREE {
        let [r, r_x, r_xx] = in_x::<S, N, J, K>(simd, coefficients, x);
        q_yy = step(J, 2, q_yy, y, q_y);
        q_xy = step(J, 2, q_xy, y, q_x);
        q_xx = step(J, 2, q_xx, y, r_xx);
        q_y = step(J, 1, q_y, y, q);
        q_x = step(J, 1, q_x, y, r_x);
        q = step(J, 0, q, y, r);
    });
    [q, q_x, q_y, q_xx, q_xy, q_yy]
}

/// The schemes with the degree known at compile time, so that all is unrolled and nothing is
/// computed with zeros.
#[inline(always)]
fn jet<S: Simd, N: Number<S>, const DEGREE: usize, const K: usize>(
    simd: S,
    coefficients: &[Constant],
    [x, y, z]: [N; 3],
) -> NumberJet<N> {
    // One check of the length here, none below.
    let all = coefficients.first_chunk::<K>().expect("a polynomial has as many coefficients as monomials");
    let mut coefficients = Coefficients { all, taken: 0 };
    let [mut p, mut p_x, mut p_y, mut p_z, mut p_xx, mut p_xy, mut p_xz, mut p_yy, mut p_yz, mut p_zz] = [x; 10];
    unrolled!(I in 0..=DEGREE {
        let [q, q_x, q_y, q_xx, q_xy, q_yy] = in_x_y::<S, N, I, K>(simd, &mut coefficients, [x, y]);
        p_zz = step(I, 2, p_zz, z, p_z);
        p_xz = step(I, 2, p_xz, z, p_x);
        p_yz = step(I, 2, p_yz, z, p_y);
        p_xx = step(I, 2, p_xx, z, q_xx);
        p_xy = step(I, 2, p_xy, z, q_xy);
        p_yy = step(I, 2, p_yy, z, q_yy);
        p_z = step(I, 1, p_z, z, p);
        p_x = step(I, 1, p_x, z, q_x);
        p_y = step(I, 1, p_y, z, q_y);
        p = step(I, 0, p, z, q);
    });
    NumberJet {
        value: p,
        gradient: [p_x, p_y, p_z],
        hessian: [p_xx + p_xx, p_xy, p_xz, p_yy + p_yy, p_yz, p_zz + p_zz],
    }
}

#[cfg(test)]
mod tests {
    use crate::polynomial::simd::levels;
    use crate::polynomial::{Arch, Lanes, Polynomial, Simd, Singles, Twice, Vector, WithSimd, monomials};

    fn polynomial(degree: usize) -> Polynomial {
        let terms = monomials(degree).into_iter().enumerate().map(|(i, e)| (e, (i as f64 * 0.7).sin())).collect();
        Polynomial::new(terms).unwrap()
    }

    /// Enough points for any vector.
    const POINTS: usize = 32;

    /// All ten numbers of a jet, point by point.
    type Entries = [[f64; POINTS]; 10];

    /// The jets at points, by every kind of number.
    struct Points<'a> {
        polynomial: &'a Polynomial,
        points: [[f64; POINTS]; 3],
    }

    impl Points<'_> {
        #[inline(always)]
        fn vectors<S: Simd, N: Vector<S>>(&self, simd: S) -> Entries {
            let mut found = [[0.0; POINTS]; 10];
            for start in (0..POINTS).step_by(N::COUNT) {
                let jet = self.polynomial.jet(simd, self.points.map(|row| N::load(simd, &row[start..])));
                let entries = [jet.value].into_iter().chain(jet.gradient).chain(jet.hessian);
                for (entry, row) in entries.zip(&mut found) {
                    entry.store(&mut row[start..]);
                }
            }
            found
        }

        #[inline(always)]
        fn one_by_one<S: Simd>(&self, simd: S) -> Entries {
            let mut found = [[0.0; POINTS]; 10];
            for i in 0..POINTS {
                let jet = self.polynomial.jet(simd, self.points.map(|row| row[i]));
                let entries = [jet.value].into_iter().chain(jet.gradient).chain(jet.hessian);
                for (entry, row) in entries.zip(&mut found) {
                    row[i] = entry;
                }
            }
            found
        }
    }

    impl WithSimd for Points<'_> {
        type Output = [(Entries, f64); 4];

        #[inline(always)]
        fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
            let (double, single) = (f64::EPSILON, f64::from(f32::EPSILON));
            [
                (self.one_by_one(simd), double),
                (self.vectors::<S, Lanes<S>>(simd), double),
                (self.vectors::<S, Singles<S>>(simd), single),
                (self.vectors::<S, Twice<Singles<S>>>(simd), single),
            ]
        }
    }

    #[test]
    fn every_level_and_every_lane_agrees_within_rounding() {
        for degree in [2, 4, 6, 8] {
            let polynomial = polynomial(degree);
            let points = [0.3, 0.2, -0.1].map(|step| std::array::from_fn(|i| 0.9 - 0.25 * step * i as f64));
            let [(plain, _), ..] = Arch::Scalar.dispatch(Points { polynomial: &polynomial, points });
            for arch in levels() {
                for (found, epsilon) in arch.dispatch(Points { polynomial: &polynomial, points }) {
                    for (a, b) in found.iter().flatten().zip(plain.iter().flatten()) {
                        let context = format!("degree {degree}, {arch:?}: {a} against {b}");
                        assert!((a - b).abs() < 400.0 * epsilon * (1.0 + b.abs()), "{context}");
                        assert!(epsilon == f64::EPSILON || f64::from(*a as f32) == *a, "{context}");
                    }
                }
            }
        }
    }
}
