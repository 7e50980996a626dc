//! Newton's method on the optimality system of the distance, taken at its word: full steps, no
//! safeguard, no test of the end.
//!
//! With the objective `|x - y|²/2`, which unlike `|x - y|` is smooth everywhere, the system is
//!
//! ```text
//! x - y + λ ∇p(x) = 0,    y - x + μ ∇q(y) = 0,    p(x) = 1,    q(y) = 1:
//! ```
//!
//! eight equations. Any of its solutions will do for Newton, such as the farthest pair of points.

use super::posed::Posed;
use nalgebra::{Matrix3, SMatrix, SVector, Vector3};

/// Where it is after so many steps; not finite once a step could not be made.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Iterates {
    /// One per body, metres.
    pub(crate) points: [Vector3<f64>; 2],
    /// Length of the last step of both together, metres.
    pub(crate) step_m: f64,
}

impl Iterates {
    /// Their distance, metres.
    pub(crate) fn apart(&self) -> f64 {
        (self.points[0] - self.points[1]).norm()
    }
}

/// The iterates after so many steps.
pub(crate) fn newton(bodies: &[Posed<'_>; 2], [mut x, mut y]: [Vector3<f64>; 2], steps: u32) -> Iterates {
    let mut step_m = f64::INFINITY;
    let [p, q] = [bodies[0].jet(&x), bodies[1].jet(&y)];
    // What the multipliers are if the start is the solution.
    let apart = (x - y).norm();
    let (mut lambda, mut mu) = (apart / p.gradient.norm(), apart / q.gradient.norm());
    for _ in 0..steps {
        let [p, q] = [bodies[0].jet(&x), bodies[1].jet(&y)];
        let (f, g) = (p.gradient, q.gradient);
        let identity = Matrix3::identity();
        let mut system = SMatrix::<f64, 8, 8>::zeros();
        system.fixed_view_mut::<3, 3>(0, 0).copy_from(&(identity + p.hessian * lambda));
        system.fixed_view_mut::<3, 3>(0, 3).copy_from(&-identity);
        system.fixed_view_mut::<3, 3>(3, 0).copy_from(&-identity);
        system.fixed_view_mut::<3, 3>(3, 3).copy_from(&(identity + q.hessian * mu));
        system.fixed_view_mut::<3, 1>(0, 6).copy_from(&f);
        system.fixed_view_mut::<3, 1>(3, 7).copy_from(&g);
        system.fixed_view_mut::<1, 3>(6, 0).copy_from(&f.transpose());
        system.fixed_view_mut::<1, 3>(7, 3).copy_from(&g.transpose());
        let mut residual = SVector::<f64, 8>::zeros();
        residual.fixed_rows_mut::<3>(0).copy_from(&(x - y + f * lambda));
        residual.fixed_rows_mut::<3>(3).copy_from(&(y - x + g * mu));
        residual[6] = p.value - 1.0;
        residual[7] = q.value - 1.0;
        let Some(step) = system.lu().solve(&residual) else {
            return Iterates { points: [Vector3::repeat(f64::NAN); 2], step_m: f64::NAN };
        };
        step_m = step.fixed_rows::<6>(0).norm();
        x -= step.fixed_rows::<3>(0);
        y -= step.fixed_rows::<3>(3);
        lambda -= step[6];
        mu -= step[7];
    }
    Iterates { points: [x, y], step_m }
}

#[cfg(test)]
mod tests {
    use super::super::posed::Posed;
    use super::super::tests::{aside, axes_apart, balls_apart};
    use super::newton;

    #[test]
    fn a_few_steps_find_the_distance_of_balls_and_ellipsoids() {
        for (a, b, pose, distance) in [balls_apart(), axes_apart()] {
            let bodies = [Posed::new(&a, &sublevel::measure::Pose::identity()), Posed::new(&b, &pose)];
            let found = newton(&bodies, aside(&bodies), 12).apart();
            assert!((found - distance).abs() < 1e-12, "{found} for {distance}");
        }
    }
}
