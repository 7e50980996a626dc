//! Small dense linear systems on the stack.

use crate::polynomial::{Simd, WithSimd, dispatch};

/// Most unknowns of an optimality system: seven, and three active constraints of each body.
pub(in crate::measure) const MAX_UNKNOWNS: usize = 13;

/// Column of the right-hand side in [`Augmented`].
pub(in crate::measure) const RIGHT: usize = MAX_UNKNOWNS;

/// A system of n <= [`MAX_UNKNOWNS`] equations; the right-hand side is the last column.
pub(in crate::measure) type Augmented = [[f64; RIGHT + 1]; MAX_UNKNOWNS];

/// No equations yet.
pub(in crate::measure) const EMPTY_SYSTEM: Augmented = [[0.0; RIGHT + 1]; MAX_UNKNOWNS];

/// Solves the system of the first n equations, whose right-hand side is the last column, by
/// Gaussian elimination with row scaling and partial pivoting. None if the matrix is singular to
/// working accuracy.
pub(in crate::measure) fn solve<const N: usize, const W: usize>(
    system: &mut [[f64; W]; N],
    n: usize,
) -> Option<[f64; N]> {
    dispatch(Elimination { system, n })
}

/// As [`solve`], of a system whose columns may differ by orders of magnitude, as those of needles
/// do.
pub(in crate::measure) fn solve_equilibrated(m: &mut Augmented, size: usize) -> Option<[f64; MAX_UNKNOWNS]> {
    let mut scale = [1.0; MAX_UNKNOWNS];
    // Rows first, so that no row of large entries decides alone.
    for row in m.iter_mut().take(size) {
        let most = row[..size].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        row.iter_mut().for_each(|entry| *entry /= most);
    }
    for (j, scale) in scale.iter_mut().enumerate().take(size) {
        *scale = (0..size).fold(0.0_f64, |most, i| most.max(m[i][j].abs()));
        (0..size).for_each(|i| m[i][j] /= *scale);
    }
    let mut solution = solve(m, size)?;
    solution.iter_mut().zip(&scale).take(size).for_each(|(value, scale)| *value /= scale);
    solution[..size].iter().all(|value| value.is_finite()).then_some(solution)
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
            solution[i] = (system[i][W - 1] - known) / system[i][i];
        }
        solution[..n].iter().all(|value| value.is_finite()).then_some(solution)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Columns of sizes from 1e-12 to 1e12, of which the plain method takes many for singular; and
    /// neither takes a system that is.
    #[test]
    fn columns_of_all_sizes_are_solved() {
        let mut refused = 0;
        for seed in 0..200 {
            let mut random = Seeded(70_000 + seed);
            let n = 2 + (seed as usize) % (MAX_UNKNOWNS - 1);
            let scales: Vec<f64> = (0..n).map(|_| 10_f64.powi((random.next() % 25) as i32 - 12)).collect();
            let truth: Vec<f64> = scales.iter().map(|scale| random.signed() / scale).collect();
            let mut system = EMPTY_SYSTEM;
            for row in system.iter_mut().take(n) {
                for j in 0..n {
                    row[j] = random.signed() * scales[j];
                    row[RIGHT] += row[j] * truth[j];
                }
            }
            refused += u32::from(solve(&mut system.clone(), n).is_none());
            let solution =
                solve_equilibrated(&mut system.clone(), n).unwrap_or_else(|| panic!("seed {seed}: singular"));
            for (j, scale) in scales.iter().enumerate() {
                let error = (solution[j] - truth[j]).abs() * scale;
                assert!(error < 1e-8, "seed {seed}, column {j}: {error:e}");
            }
            let mut without_column = system;
            without_column.iter_mut().for_each(|row| row[n - 1] = 0.0);
            assert!(solve_equilibrated(&mut without_column, n).is_none(), "seed {seed}");
            system[n - 1] = [0.0; RIGHT + 1];
            assert!(solve_equilibrated(&mut system, n).is_none(), "seed {seed}");
        }
        assert!(refused > 50, "{refused} of 200");
    }

    #[test]
    fn solves_what_it_should_and_refuses_the_singular() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let n = 1 + (seed as usize) % MAX_UNKNOWNS;
            let mut system = EMPTY_SYSTEM;
            let truth: Vec<f64> = (0..n).map(|_| random.signed()).collect();
            for i in 0..n {
                let scale = 10_f64.powi((random.next() % 9) as i32 - 4);
                for j in 0..n {
                    system[i][j] = random.signed() * scale;
                    system[i][RIGHT] += system[i][j] * truth[j];
                }
            }
            let mut copy = system;
            let solution = solve(&mut copy, n).unwrap_or_else(|| panic!("seed {seed}"));
            let error = (0..n).map(|i| (solution[i] - truth[i]).abs()).fold(0.0, f64::max);
            assert!(error < 1e-8, "seed {seed}: {error:e}");
            if (2..=4).contains(&n) {
                for j in 0..=RIGHT {
                    system[n - 1][j] = system[0][j] * 3.0;
                }
                assert!(solve(&mut system, n).is_none(), "seed {seed}");
            }
        }
    }
}
