//! Small dense linear systems on the stack.

use crate::polynomial::{Simd, WithSimd, dispatch};
use nalgebra::{Matrix3, Vector3};

/// Most unknowns of an optimality system: seven, and three active constraints of each body.
pub(in crate::measure) const MAX_UNKNOWNS: usize = 13;

/// A system of n <= [`MAX_UNKNOWNS`] equations; the right-hand side is column `n`.
pub(in crate::measure) type Augmented = [[f64; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];

/// Solves the system of the first n equations, whose right-hand side is column n, by Gaussian
/// elimination with row scaling and partial pivoting. None if the matrix is singular to working
/// accuracy.
pub(in crate::measure) fn solve<const N: usize, const W: usize>(
    system: &mut [[f64; W]; N],
    n: usize,
) -> Option<[f64; N]> {
    dispatch(Elimination { system, n })
}

/// An elimination as vectorized work: rows as a whole, for loops of one length make vectors.
struct Elimination<'a, const N: usize, const W: usize> {
    system: &'a mut [[f64; W]; N],
    n: usize,
}

impl<const N: usize, const W: usize> WithSimd for Elimination<'_, N, W> {
    type Output = Option<[f64; N]>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, _: S) -> Option<[f64; N]> {
        let Self { system, n } = self;
        for row in &mut system[..n] {
            let scale = row[..n].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
            if !(scale > 0.0 && scale.is_finite()) {
                return None;
            }
            let inverse = 1.0 / scale;
            row.iter_mut().for_each(|entry| *entry *= inverse);
        }
        for k in 0..n {
            let mut largest = (k, 0.0);
            for (i, row) in system[..n].iter().enumerate().skip(k) {
                if row[k].abs() > largest.1 {
                    largest = (i, row[k].abs());
                }
            }
            if !(largest.1 > 1e-13) {
                return None;
            }
            system.swap(k, largest.0);
            let (above, below) = system.split_at_mut(k + 1);
            let pivot = &above[k];
            let inverse = 1.0 / pivot[k];
            for row in &mut below[..n - k - 1] {
                let factor = row[k] * inverse;
                for (entry, above) in row.iter_mut().zip(pivot) {
                    *entry -= factor * above;
                }
            }
        }
        let mut solution = [0.0; N];
        for i in (0..n).rev() {
            let known: f64 =
                system[i][i + 1..n].iter().zip(&solution[i + 1..n]).map(|(entry, value)| entry * value).sum();
            solution[i] = (system[i][n] - known) / system[i][i];
        }
        solution[..n].iter().all(|value| value.is_finite()).then_some(solution)
    }
}

/// Solves a system of N equations by Gaussian elimination with partial pivoting, rows scaled. None
/// if it is singular to working accuracy.
pub(in crate::measure) fn eliminate<const N: usize>(m: &mut [[f64; N]; N], r: &mut [f64; N]) -> Option<()> {
    for (row, right) in m.iter_mut().zip(r.iter_mut()) {
        let scale = row.iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        let inverse = 1.0 / scale;
        row.iter_mut().for_each(|entry| *entry *= inverse);
        *right *= inverse;
    }
    for k in 0..N {
        let mut pivot = k;
        for i in k + 1..N {
            if m[i][k].abs() > m[pivot][k].abs() {
                pivot = i;
            }
        }
        if !(m[pivot][k].abs() > 1e-15) {
            return None;
        }
        m.swap(k, pivot);
        r.swap(k, pivot);
        let inverse = 1.0 / m[k][k];
        for i in k + 1..N {
            let factor = m[i][k] * inverse;
            for j in k..N {
                m[i][j] -= factor * m[k][j];
            }
            r[i] -= factor * r[k];
        }
    }
    for i in (0..N).rev() {
        for j in i + 1..N {
            r[i] -= m[i][j] * r[j];
        }
        r[i] /= m[i][i];
    }
    r.iter().all(|value| value.is_finite()).then_some(())
}

/// Factorization L D Lᵀ of a positive semidefinite 3x3 matrix, lifted where it is singular.
pub(in crate::measure) struct Curvature {
    l: [f64; 3],
    inverse_d: [f64; 3],
}

impl Curvature {
    /// Factors m; pivots below 1e-14 of the trace are lifted to that. None for a matrix without
    /// curvature or not finite.
    pub(in crate::measure) fn new(m: &Matrix3<f64>) -> Option<Self> {
        let trace = m.trace();
        if !(trace > 0.0 && trace.is_finite()) {
            return None;
        }
        let least = 1e-14 * trace;
        let d0 = m[(0, 0)].max(least);
        let i0 = 1.0 / d0;
        let (l10, l20) = (m[(1, 0)] * i0, m[(2, 0)] * i0);
        let i1 = 1.0 / (m[(1, 1)] - l10 * m[(1, 0)]).max(least);
        let l21 = (m[(2, 1)] - l20 * m[(1, 0)]) * i1;
        let i2 = 1.0 / (m[(2, 2)] - l20 * m[(2, 0)] - l21 * (m[(2, 1)] - l20 * m[(1, 0)])).max(least);
        Some(Self { l: [l10, l20, l21], inverse_d: [i0, i1, i2] })
    }

    /// Solution of m x = r.
    #[inline]
    pub(in crate::measure) fn solve(&self, r: &Vector3<f64>) -> Vector3<f64> {
        let [l10, l20, l21] = self.l;
        let y1 = r.y - l10 * r.x;
        let y2 = r.z - l20 * r.x - l21 * y1;
        let z = y2 * self.inverse_d[2];
        let y = y1 * self.inverse_d[1] - l21 * z;
        Vector3::new(r.x * self.inverse_d[0] - l10 * y - l20 * z, y, z)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn solves_what_it_should_and_refuses_the_singular() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let n = 1 + (seed as usize) % MAX_UNKNOWNS;
            let mut system: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
            let truth: Vec<f64> = (0..n).map(|_| random.signed()).collect();
            for i in 0..n {
                let scale = 10_f64.powi((random.next() % 9) as i32 - 4);
                for j in 0..n {
                    system[i][j] = random.signed() * scale;
                    system[i][n] += system[i][j] * truth[j];
                }
            }
            let mut copy = system;
            let solution = solve(&mut copy, n).unwrap_or_else(|| panic!("seed {seed}"));
            let error = (0..n).map(|i| (solution[i] - truth[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-8, "seed {seed}: {error:e}");
            if (2..=4).contains(&n) {
                for j in 0..=n {
                    system[n - 1][j] = system[0][j] * 3.0;
                }
                assert!(solve(&mut system, n).is_none(), "seed {seed}");
            }
        }
    }

    #[test]
    fn elimination_and_curvature_solve_their_systems() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let mut m: [[f64; 5]; 5] = std::array::from_fn(|_| std::array::from_fn(|_| random.signed()));
            let truth: [f64; 5] = std::array::from_fn(|_| random.signed());
            let mut r: [f64; 5] = std::array::from_fn(|i| (0..5).map(|j| m[i][j] * truth[j]).sum());
            eliminate(&mut m, &mut r).unwrap_or_else(|| panic!("seed {seed}"));
            assert!((0..5).all(|i| (r[i] - truth[i]).abs() < 1e-9), "seed {seed}: {r:?}");

            let root = Matrix3::from_fn(|_, _| random.signed());
            let m = root * root.transpose() + Matrix3::identity() * 1e-3;
            let x = Vector3::from_fn(|_, _| random.signed());
            let solved = Curvature::new(&m).unwrap().solve(&(m * x));
            assert!((solved - x).norm() < 1e-9, "seed {seed}");
        }
        assert!(Curvature::new(&Matrix3::zeros()).is_none() && Curvature::new(&Matrix3::repeat(f64::NAN)).is_none());
        // Without curvature along the second axis, what has no part there is still solved.
        let flat = Curvature::new(&Matrix3::from_diagonal(&Vector3::new(2.0, 0.0, 4.0))).unwrap();
        assert_eq!(flat.solve(&Vector3::new(2.0, 0.0, 4.0)), Vector3::new(1.0, 0.0, 1.0));
        assert!(eliminate(&mut [[1.0, 2.0], [2.0, 4.0]], &mut [1.0, 1.0]).is_none());
    }
}
