//! Proven lower bounds of distances between sets that need not be convex.
//!
//! The least of `f(u, v)` over two basic sets is at least the largest γ for which
//!
//! ```text
//! f - γ = Σ squares + Σ σ_i (1 - g_i),   σ_i sums of squares of degree 2 level at least,
//! ```
//!
//! (Lasserre, SIAM J. Optim. 11, 2001). f couples the sets by the products of their coordinates
//! alone, so the squares are of three groups of monomials: those of u, those of v, and of both up
//! to degree 1 + level (Waki, Kim, Kojima and Muramatsu, SIAM J. Optim. 17, 2006): matrices of 10,
//! 10 and 7 rows at degree 4 and level 0, where all monomials of both would make one of 28. Level 0 is
//! exact for sos-convex sets; for others it is a lower bound, which rises with the level.
//!
//! The program is solved in its dual, over moments; what comes out is proven from the numbers alone
//! ([`PairPolynomial::lower_bound`]), in the normalized coordinates of both sets, where the
//! constraints are the stored polynomials and only f is rounded.

mod error;
mod local_search;
mod moments;
mod placed_set;

use error::MAX_ROWS;
pub use error::{HierarchyError, MAX_LEVEL};
pub use placed_set::PlacedSet;

use crate::conic_program::solve;
use crate::error::FitError;
use crate::program::ProgramError;
use crate::progress::{Progress, Watch};
use local_search::nearest_points;
use moments::MomentRelaxation;
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::polynomial::PairPolynomial;

/// Width of a bracket, relative to the size of the sets, at which its lower bound is called exact.
const EXACT: f64 = 1e-5;

/// Tolerance asked of the solver; what it leaves is part of the bound.
const TOLERANCE: f64 = 1e-9;

/// A bracket of the distance of two sets.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchyBound {
    /// Level of the hierarchy.
    pub level: usize,
    /// Proven lower bound of the distance, metres.
    pub lower_m: f64,
    /// Distance of two points that are proven to lie in the sets, metres; infinite if none were
    /// found.
    pub upper_m: f64,
    /// These points, in the frame of the poses, metres.
    pub points: Option<[Vector3<f64>; 2]>,
    /// Whether the lower bound is the distance, to 1e-5 of half the diagonals of the boxes.
    pub is_exact: bool,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// The bracket of the Euclidean distance of two sets at a level of the hierarchy. `progress` is
/// called at every iteration of the solver and can stop it.
///
/// # Errors
/// [`HierarchyError`]: sets that cannot be used, a level that is too high, a program that would be
/// too large, and one that could not be solved.
pub fn hierarchy_distance(
    sets: [&PlacedSet; 2],
    level: usize,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<HierarchyBound, HierarchyError> {
    let start = Instant::now();
    if level > MAX_LEVEL {
        return Err(HierarchyError::Level(level));
    }
    for (index, set) in sets.iter().enumerate() {
        set.check(index)?;
    }
    let frames = [sets[0].frame(0)?, sets[1].frame(1)?];
    let objective = PairPolynomial::squared_distance(&frames[0], &frames[1]);
    let most = sets.map(PlacedSet::coordinate_bounds);
    let most: [f64; 6] = std::array::from_fn(|k| most[k / 3][k % 3]);

    let relaxation = MomentRelaxation::new(&objective, sets, level);
    let rows = relaxation.rows();
    if rows > MAX_ROWS {
        return Err(HierarchyError::TooLarge { level, rows });
    }
    let mut watch = Watch::new(progress);
    watch.round(0, 0.0);
    let (program, parts) = relaxation.program();
    let solution = solve(&program, TOLERANCE, relaxation.unit(), &mut watch).map_err(|error| match error {
        FitError::Program(ProgramError::Infeasible) => HierarchyError::Empty,
        error => error.into(),
    })?;
    let squares = relaxation.squares(&solution, &parts);
    let squared = objective.lower_bound(&squares, &most).unwrap_or(0.0).max(0.0);
    let lower_m = squared.sqrt().next_down().max(0.0);

    let guess = relaxation.first_moments(&solution);
    let found = nearest_points(sets, guess);
    let upper_m = found.map_or(f64::INFINITY, |(distance, _)| distance);
    let size = sets.iter().map(|set| set.radius_m()).sum::<f64>();
    Ok(HierarchyBound {
        level,
        lower_m,
        upper_m,
        points: found.map(|(_, points)| points),
        is_exact: lower_m <= upper_m && upper_m - lower_m <= EXACT * size,
        iterations: watch.progress().iterations,
        seconds: start.elapsed().as_secs_f64(),
    })
}

#[cfg(test)]
mod tests;
