//! Small dense linear systems on the stack.

use crate::polynomial::{Simd, WithSimd, dispatch};

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
}
