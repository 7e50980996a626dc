//! Small dense linear systems on the stack.

/// Most unknowns of an optimality system: seven, and three active constraints of each body.
pub(super) const MAX_UNKNOWNS: usize = 13;

/// A system of n <= [`MAX_UNKNOWNS`] equations; the right-hand side is column `n`.
pub(super) type Augmented = [[f64; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];

/// Solves the system by Gaussian elimination with row scaling and partial pivoting; the solution replaces the right-hand
/// side's place in the returned array. None if the matrix is singular to working accuracy.
pub(super) fn solve(system: &mut Augmented, n: usize) -> Option<[f64; MAX_UNKNOWNS]> {
    for row in system.iter_mut().take(n) {
        let scale = row[..n].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        if !(scale > 0.0 && scale.is_finite()) {
            return None;
        }
        row[..=n].iter_mut().for_each(|entry| *entry /= scale);
    }
    for k in 0..n {
        let pivot = (k..n).max_by(|&i, &j| system[i][k].abs().total_cmp(&system[j][k].abs()))?;
        if !(system[pivot][k].abs() > 1e-13) {
            return None;
        }
        system.swap(k, pivot);
        for i in k + 1..n {
            let factor = system[i][k] / system[k][k];
            if factor != 0.0 {
                for j in k..=n {
                    system[i][j] -= factor * system[k][j];
                }
            }
        }
    }
    let mut solution = [0.0; MAX_UNKNOWNS];
    for i in (0..n).rev() {
        let known: f64 = (i + 1..n).map(|j| system[i][j] * solution[j]).sum();
        solution[i] = (system[i][n] - known) / system[i][i];
    }
    solution[..n].iter().all(|value| value.is_finite()).then_some(solution)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::polynomial::tests::Seeded;

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
