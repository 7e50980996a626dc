//! Newton's step towards the two nearest points of two bodies: the linear system of
//! [`crate::measure::solver::kkt_newton`], whatever digits its residuals are computed with. In
//! doubles it is Newton's method; with residuals in double-double arithmetic it is iterative
//! refinement ([`crate::measure::solver::refinement`]).
//!
//! The second of the equations gives `dn = -(n + u) - H_A dx - G_A dλ`, G the gradients and H the
//! weighted Hessians, which leaves dx, dy, dD and the multipliers. The first would give dy, too,
//! but with products of both Hessians: of thin bodies they leave the matrix few digits.

use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::measure::solver::linear_systems::{Augmented, EMPTY_SYSTEM, MAX_UNKNOWNS, RIGHT};
use nalgebra::{Matrix3, Vector3};

/// The active constraints of one body at its point.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Curved<'a> {
    pub(in crate::measure) gradients: &'a [Vector3<f64>],
    /// Sum of the Hessians with their multipliers.
    pub(in crate::measure) hessian: &'a Matrix3<f64>,
}

/// The system at an iterate.
#[derive(Clone, Copy)]
pub(in crate::measure) struct DistanceSystem<'a> {
    pub(in crate::measure) a: Curved<'a>,
    pub(in crate::measure) b: Curved<'a>,
    pub(in crate::measure) distance: f64,
    pub(in crate::measure) n: Vector3<f64>,
    /// Curvature to add along all directions.
    pub(in crate::measure) stiffness: f64,
}

/// What the equations are missed by.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Residuals {
    /// `x - y + D u`: the first equation with the normal that the second one gives.
    pub(in crate::measure) offset: Vector3<f64>,
    /// `n + u`.
    pub(in crate::measure) normal: Vector3<f64>,
    /// `u + w`.
    pub(in crate::measure) balance: Vector3<f64>,
    /// `(|n|² - 1) / 2`.
    pub(in crate::measure) length: f64,
    /// `g_i(x) - 1`.
    pub(in crate::measure) of_a: [f64; MAX_ACTIVE],
    /// `h_j(y) - 1`.
    pub(in crate::measure) of_b: [f64; MAX_ACTIVE],
}

/// Newton's step.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Step {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
    pub(in crate::measure) n: Vector3<f64>,
    pub(in crate::measure) distance: f64,
    /// Of the multipliers.
    pub(in crate::measure) of_a: [f64; MAX_ACTIVE],
    pub(in crate::measure) of_b: [f64; MAX_ACTIVE],
}

impl DistanceSystem<'_> {
    /// The step, by `solve` of [`crate::measure::solver::linear_systems`] or another one of its
    /// methods; none if the system is singular.
    pub(in crate::measure) fn step(
        &self,
        residuals: &Residuals,
        solve: impl FnOnce(&mut Augmented, usize) -> Option<[f64; MAX_UNKNOWNS]>,
    ) -> Option<Step> {
        let Self { a, b, .. } = *self;
        let (la, lb) = (a.gradients.len(), b.gradients.len());
        let size = 7 + la + lb;
        let solution = solve(&mut self.reduced(residuals), size)?;
        let (mut of_a, mut of_b) = ([0.0; MAX_ACTIVE], [0.0; MAX_ACTIVE]);
        of_a[..la].copy_from_slice(&solution[7..7 + la]);
        of_b[..lb].copy_from_slice(&solution[7 + la..size]);
        let (x, y) = (Vector3::from_row_slice(&solution[..3]), Vector3::from_row_slice(&solution[3..6]));
        // Of corners that stay where they are the normal turns.
        let turned: Vector3<f64> = a.gradients.iter().zip(of_a).map(|(gradient, step)| gradient * step).sum();
        let n = -residuals.normal - a.hessian * x - turned;
        Some(Step { x, y, n, distance: solution[6], of_a, of_b })
    }

    /// The system of dx, dy, dD and the multipliers.
    fn reduced(&self, residuals: &Residuals) -> Augmented {
        let Self { a, b, distance, n, stiffness } = *self;
        let la = a.gradients.len();
        let mut m = EMPTY_SYSTEM;
        let turned = a.hessian * n;
        for i in 0..3 {
            for j in 0..3 {
                // x - y = D n, and u + w = 0.
                m[i][j] = distance * a.hessian[(i, j)];
                m[3 + i][j] = a.hessian[(i, j)];
                m[3 + i][3 + j] = b.hessian[(i, j)];
            }
            m[i][i] += 1.0;
            m[i][3 + i] = -1.0;
            m[i][6] = -n[i];
            m[3 + i][i] += stiffness;
            for (k, gradient) in a.gradients.iter().enumerate() {
                m[i][7 + k] = distance * gradient[i];
                m[3 + i][7 + k] = gradient[i];
            }
            for (k, gradient) in b.gradients.iter().enumerate() {
                m[3 + i][7 + la + k] = gradient[i];
            }
            m[i][RIGHT] = -residuals.offset[i];
            m[3 + i][RIGHT] = -residuals.balance[i];
            // |n| = 1.
            m[6][i] = turned[i];
        }
        for (k, gradient) in a.gradients.iter().enumerate() {
            m[6][7 + k] = n.dot(gradient);
        }
        m[6][RIGHT] = residuals.length - n.dot(&residuals.normal);
        // g = 1 and h = 1.
        for (row, (gradient, value)) in m[7..].iter_mut().zip(a.gradients.iter().zip(&residuals.of_a)) {
            row[..3].copy_from_slice(gradient.as_slice());
            row[RIGHT] = -value;
        }
        for (row, (gradient, value)) in m[7 + la..].iter_mut().zip(b.gradients.iter().zip(&residuals.of_b)) {
            row[3..6].copy_from_slice(gradient.as_slice());
            row[RIGHT] = -value;
        }
        m
    }
}

#[cfg(test)]
mod tests {
    use super::{Curved, DistanceSystem, Residuals};
    use crate::measure::solver::linear_systems::{solve, solve_equilibrated};
    use nalgebra::{Matrix3, Vector3};
    use sublevel_testkit::Seeded;

    /// The step solves each of the linearized equations, of all counts of active constraints, on
    /// both sides of contact, and of bodies as thin as a ten-thousandth of their size.
    #[test]
    fn steps_solve_the_linearized_equations() {
        for seed in 0..1800 {
            let mut random = Seeded(seed);
            // Of thin bodies curvatures are larger by the inverse square of this.
            let thin = if seed % 2 == 0 { 1.0 } else { 1e-4 };
            let mut vector = || Vector3::from_fn(|_, _| random.signed());
            let mut bent = || {
                let root = Matrix3::from_columns(&[vector(), vector() / thin, vector() / thin]);
                root * root.transpose()
            };
            let (hessian_a, hessian_b) = (bent(), bent());
            let gradients = [(); 6].map(|()| vector());
            let n = vector().normalize();
            let residuals = Residuals {
                offset: vector(),
                normal: vector(),
                balance: vector(),
                length: vector().x,
                of_a: vector().into(),
                of_b: vector().into(),
            };
            let (la, lb) = (1 + seed as usize % 3, 1 + seed as usize / 3 % 3);
            let (a, b) = (&gradients[..la], &gradients[3..3 + lb]);
            let (distance, stiffness) = (3.0 * vector().x, [0.0, 0.5][seed as usize / 9 % 2]);
            let (curved_a, curved_b) =
                (Curved { gradients: a, hessian: &hessian_a }, Curved { gradients: b, hessian: &hessian_b });
            let system = DistanceSystem { a: curved_a, b: curved_b, distance, n, stiffness };
            let carried = |gradients: &[Vector3<f64>], steps: [f64; 3]| -> Vector3<f64> {
                gradients.iter().zip(steps).map(|(gradient, step)| gradient * step).sum()
            };
            let plain = (thin == 1.0).then(|| system.step(&residuals, solve));
            for step in [plain, Some(system.step(&residuals, solve_equilibrated))].into_iter().flatten() {
                let step = step.unwrap_or_else(|| panic!("seed {seed}: singular"));
                // x - y - D n.
                let apart = residuals.offset - residuals.normal * distance;
                let turned = hessian_a * step.x + carried(a, step.of_a);
                let bent = hessian_b * step.y + carried(b, step.of_b);
                let missed = [
                    (step.x - step.y - n * step.distance - step.n * distance + apart).norm(),
                    (step.n + turned + residuals.normal).norm(),
                    (turned + bent + step.x * stiffness + residuals.balance).norm(),
                    (n.dot(&step.n) + residuals.length).abs(),
                    a.iter().zip(residuals.of_a).map(|(g, value)| (g.dot(&step.x) + value).abs()).fold(0.0, f64::max),
                    b.iter().zip(residuals.of_b).map(|(g, value)| (g.dot(&step.y) + value).abs()).fold(0.0, f64::max),
                ];
                let size = 1.0 + step.x.norm() + step.y.norm() + step.n.norm() + step.distance.abs();
                let multipliers: f64 = step.of_a.iter().chain(&step.of_b).map(|step| step.abs()).sum();
                let stiff = hessian_a.norm() * step.x.norm() + hessian_b.norm() * step.y.norm();
                for (k, missed) in missed.into_iter().enumerate() {
                    let scale = (size + multipliers + stiff) * (1.0 + distance.abs());
                    assert!(missed < 1e-9 * scale, "seed {seed}, equation {k}: {missed:e}");
                }
            }
        }
    }
}
