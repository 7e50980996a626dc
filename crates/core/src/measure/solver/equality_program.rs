//! Quadratic programs with equations alone: the step of Newton's method for a given set of active
//! constraints.

use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::linear_systems::{Augmented, EMPTY_SYSTEM, MAX_UNKNOWNS, RIGHT};
use nalgebra::{SMatrix, SVector};

/// Most equations: the active constraints of both bodies.
pub(in crate::measure) const MAX_EQUATIONS: usize = 2 * MAX_ACTIVE;

/// The minimiser d of `½ dᵀ H d + c·d` over `g_k·d = r_k`, and the multipliers of
/// `H d + c + Σ λ_k g_k = 0`, by `solve` of [`crate::measure::solver::linear_systems`] or another
/// one of its methods. None if the system is singular. At most [`MAX_EQUATIONS`] equations in at
/// most four unknowns.
pub(in crate::measure) fn minimize<const N: usize>(
    hessian: &SMatrix<f64, N, N>,
    cost: &SVector<f64, N>,
    equations: impl IntoIterator<Item = (SVector<f64, N>, f64)>,
    solve: impl FnOnce(&mut Augmented, usize) -> Option<[f64; MAX_UNKNOWNS]>,
) -> Option<(SVector<f64, N>, [f64; MAX_EQUATIONS])> {
    let mut system = EMPTY_SYSTEM;
    for i in 0..N {
        (0..N).for_each(|j| system[i][j] = hessian[(i, j)]);
        system[i][RIGHT] = -cost[i];
    }
    let mut size = N;
    for (gradient, right) in equations {
        for i in 0..N {
            system[i][size] = gradient[i];
            system[size][i] = gradient[i];
        }
        system[size][RIGHT] = right;
        size += 1;
    }
    let solution = solve(&mut system, size)?;
    let mut multipliers = [0.0; MAX_EQUATIONS];
    multipliers[..size - N].copy_from_slice(&solution[N..size]);
    Some((SVector::from_column_slice(&solution[..N]), multipliers))
}

#[cfg(test)]
mod tests {
    use super::{MAX_EQUATIONS, minimize};
    use crate::measure::solver::linear_systems::{solve, solve_equilibrated};
    use nalgebra::{Matrix4, Vector4};
    use sublevel_testkit::Seeded;

    /// Gradients that differ by orders of magnitude, as those of needles do: the point meets the
    /// equations, and the gradient of the Lagrangian vanishes.
    #[test]
    fn minimisers_meet_the_equations_and_balance_the_cost() {
        for seed in 0..500 {
            let mut random = Seeded(seed);
            let mut vector = |size: f64| Vector4::from_fn(|_, _| size * random.signed());
            let root = Matrix4::from_columns(&[(); 4].map(|()| vector(1.0)));
            let (hessian, cost) = (root * root.transpose() + Matrix4::identity() * 0.1, vector(1.0));
            let count = seed as usize % 4;
            let equations: Vec<_> =
                (0..count).map(|k| (vector(10_f64.powi(4 * k as i32 - 4)), vector(1.0).x)).collect();
            let (d, multipliers) =
                minimize(&hessian, &cost, equations.iter().copied(), solve_equilibrated).expect("a minimiser");
            assert_eq!(multipliers[count..], [0.0; MAX_EQUATIONS][count..]);
            let mut rest = hessian * d + cost;
            let mut size = rest.norm() + cost.norm() + (hessian * d).norm();
            for ((gradient, right), multiplier) in equations.iter().zip(multipliers) {
                let scale = gradient.norm() * d.norm() + right.abs();
                assert!((gradient.dot(&d) - right).abs() < 1e-9 * scale, "seed {seed}");
                rest += gradient * multiplier;
                size += gradient.norm() * multiplier.abs();
            }
            assert!(rest.norm() < 1e-9 * size, "seed {seed}: {rest}");
        }
    }

    #[test]
    fn dependent_equations_have_no_multipliers() {
        let gradient = Vector4::new(1.0, 2.0, 3.0, 4.0);
        let equations = [(gradient, 1.0), (gradient * 2.0, 2.0)];
        assert!(minimize(&Matrix4::identity(), &Vector4::x(), equations, solve).is_none());
        assert!(minimize(&Matrix4::identity(), &Vector4::x(), equations, solve_equilibrated).is_none());
    }
}
