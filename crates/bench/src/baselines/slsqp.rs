//! A general solver of nonlinear programs: SLSQP, sequential quadratic programming after Kraft (ACM
//! TOMS 20, 1994), as NLopt has it, in the translation of the crate `slsqp`.
//!
//! It minimises `|x - y|²` over `p(x) <= 1`, `q(y) <= 1` in units of the size of the bodies, with
//! exact gradients.

use super::posed::Posed;
use nalgebra::Vector3;
use slsqp::{Func, StopTols, minimize};
use std::cell::Cell;

/// Relative change of the objective below which it stops: that of rounding. NLopt heeds it at
/// feasible iterates only, and those of a convex constraint come from outside, so that a coarser
/// one changes nothing: accuracy is bought by evaluations.
const CHANGE: f64 = 1e-16;

/// Distance of the last points evaluated, metres, after at most so many evaluations of the
/// objective, and how many they were.
pub(crate) fn slsqp(bodies: &[Posed<'_>; 2], start: [Vector3<f64>; 2], size_m: f64, most: u32) -> (f64, u32) {
    let (evaluations, last) = (Cell::new(0), Cell::new(f64::NAN));
    let origin = start[0];
    let objective = |v: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
        evaluations.set(evaluations.get() + 1);
        let apart: [f64; 3] = std::array::from_fn(|i| v[i] - v[i + 3]);
        if let Some(gradient) = gradient {
            for (i, d) in apart.iter().enumerate() {
                (gradient[i], gradient[i + 3]) = (2.0 * d, -2.0 * d);
            }
        }
        last.set(apart.iter().map(|d| d * d).sum());
        last.get()
    };
    let inside = |which: usize| {
        move |v: &[f64], gradient: Option<&mut [f64]>, (): &mut ()| {
            let at = Vector3::from_fn(|i, _| v[i + 3 * which]) * size_m + origin;
            let jet = bodies[which].jet(&at);
            if let Some(gradient) = gradient {
                gradient.fill(0.0);
                (0..3).for_each(|i| gradient[i + 3 * which] = jet.gradient[i] * size_m);
            }
            jet.value - 1.0
        }
    };
    let (in_a, in_b) = (inside(0), inside(1));
    let constraints: [&dyn Func<()>; 2] = [&in_a, &in_b];
    let scaled: Vec<f64> = start.iter().flat_map(|x| <[f64; 3]>::from((x - origin) / size_m)).collect();
    let bounds = [(f64::NEG_INFINITY, f64::INFINITY); 6];
    let stop = StopTols { ftol_rel: CHANGE, ..StopTols::default() };
    // Only the last point counts: what it returns is the best one that is feasible to the last
    // digit, often the start, as the crate takes no tolerance of constraints and iterates come from
    // outside. How it ended is seen from the error.
    let _ = minimize(objective, &scaled, &bounds, &constraints, (), most as usize, Some(stop));
    (last.get().sqrt() * size_m, evaluations.get())
}

#[cfg(test)]
mod tests {
    use super::super::posed::Posed;
    use super::super::tests::{aside, axes_apart, balls_apart};
    use super::slsqp;

    #[test]
    fn it_finds_the_distance_of_balls_and_ellipsoids() {
        for (a, b, pose, distance) in [balls_apart(), axes_apart()] {
            let bodies = [Posed::new(&a, &sublevel::measure::Pose::identity()), Posed::new(&b, &pose)];
            let (found, evaluations) = slsqp(&bodies, aside(&bodies), 1.0, 1000);
            assert!((found - distance).abs() < 1e-7, "{found} for {distance}");
            assert!((2..200).contains(&evaluations), "{evaluations}");
            let (_, evaluations) = slsqp(&bodies, aside(&bodies), 1.0, 1);
            assert_eq!(evaluations, 1);
        }
    }
}
