//! Proven lower bounds of distances and level distances between sets that need not be convex.
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
//! 10 and 7 rows at degree 4 and level 0, where all monomials of both would make one of 28. Where
//! changes of signs of coordinates leave f and all g as they are, each falls apart into blocks
//! (`sign_symmetry.rs`). Level 0 is exact for sos-convex sets; for others it is a lower bound,
//! which rises with the level. Of one point alone, the level distance has one group (`level.rs`).
//!
//! The program is solved in its dual, over moments; what comes out is proven from the numbers alone
//! ([`PairPolynomial::lower_bound`]), in the normalized coordinates of the sets, where the
//! constraints are the stored polynomials and only f is rounded.
//!
//! Minimisers are what local searches find from the moments (`atoms.rs`) and from points of the
//! sets; each is proven to be in its sets, and they are reported where they attain the bound.

mod atoms;
mod error;
mod level;
mod level_search;
mod local_search;
mod minimisers;
mod moments;
mod placed_set;
mod sign_symmetry;
mod solve;

pub use error::{HierarchyError, MAX_LEVEL};
pub use level::{HierarchyLevelBound, check_hierarchy_level, hierarchy_level_distance};
pub use placed_set::PlacedSet;

use crate::progress::{Progress, Watch};
use atoms::Atoms;
use local_search::nearest_points;
use minimisers::{are_all, attaining};
use moments::MomentRelaxation;
use nalgebra::Vector3;
use solve::{EXACT, check, check_size, solved};
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::polynomial::PairPolynomial;

/// Pairs of points that moments give with which a search begins, at most.
const MAX_PAIRS: usize = 24;

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
    /// Pairs of points that are proven to lie in the sets and, where the bound is exact, attain it
    /// to the same tolerance, the nearest first; pairs that agree to a hundredth of half the
    /// diagonals count once. Frame of the poses, metres. Empty where the bound is not exact.
    pub minimisers: Vec<[Vector3<f64>; 2]>,
    /// Whether these are all, as the ranks of the moment matrices say (`atoms.rs`): a judgement of
    /// rounded numbers, not proven. False where nearest pairs are not finitely many.
    pub has_all_minimisers: bool,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// Whether the bracket of two sets can be asked for at a level, without a solve: what
/// [`hierarchy_distance`] refuses before it builds its program. Takes milliseconds.
///
/// # Errors
/// [`HierarchyError`]: sets that cannot be used, a level that is too high, and a program that would
/// be too large.
pub fn check_hierarchy(sets: [&PlacedSet; 2], level: usize) -> Result<(), HierarchyError> {
    checked(sets, level).map(drop)
}

/// The objective and the moments of a bracket that can be computed.
fn checked<'a>(
    sets: [&'a PlacedSet<'a>; 2],
    level: usize,
) -> Result<(PairPolynomial, MomentRelaxation<'a>), HierarchyError> {
    check(sets, level)?;
    let frames = [sets[0].frame(0)?, sets[1].frame(1)?];
    let objective = PairPolynomial::squared_distance(&frames[0], &frames[1]);
    let relaxation = MomentRelaxation::of_two(&objective, sets, level);
    check_size(&relaxation, level)?;
    Ok((objective, relaxation))
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
    let (objective, relaxation) = checked(sets, level)?;
    let most = sets.map(PlacedSet::coordinate_bounds);
    let most: [f64; 6] = std::array::from_fn(|k| most[k / 3][k % 3]);
    let mut watch = Watch::new(progress);
    let (solution, rows) = solved(&relaxation, level, &mut watch)?;
    let squares = relaxation.squares(&objective, &solution, &rows);
    let squared = objective.lower_bound(&squares, &most).unwrap_or(0.0).max(0.0);
    let lower_m = squared.sqrt().next_down().max(0.0);

    let atoms = relaxation.atoms(&solution);
    let means = relaxation.first_moments(&solution);
    let mut guesses = vec![[means[0], means[1]]];
    guesses.extend(guessed_pairs(sets, &atoms));
    let found = nearest_points(sets, &guesses);
    let nearest = found.first().copied();
    let upper_m = nearest.map_or(f64::INFINITY, |(distance, _)| distance);
    let size = sets.iter().map(|set| set.radius_m()).sum::<f64>();
    let is_exact = lower_m <= upper_m && upper_m - lower_m <= EXACT * size;
    let most = if is_exact { lower_m + EXACT * size } else { f64::NEG_INFINITY };
    let minimisers = attaining(&found, most, size);
    Ok(HierarchyBound {
        level,
        lower_m,
        upper_m,
        points: nearest.map(|(_, points)| points),
        is_exact,
        has_all_minimisers: are_all(&minimisers, &atoms, size),
        minimisers,
        iterations: watch.progress().iterations,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// Pairs of the points that moments give, and of each with the nearest of the points that the other
/// set comes with; the nearest ones.
fn guessed_pairs(sets: [&PlacedSet; 2], atoms: &[Atoms]) -> Vec<[Vector3<f64>; 2]> {
    let [first, second] = [&atoms[0].points, &atoms[1].points];
    let facing = |side: usize, x: &Vector3<f64>| {
        let to_common = |y: &Vector3<f64>| sets[side].pose.transform_point(&(*y).into()).coords;
        let points = sets[side].near_boundary.iter().map(to_common);
        points.min_by(|a, b| (a - x).norm_squared().total_cmp(&(b - x).norm_squared()))
    };
    let between = first.iter().flat_map(|x| second.iter().map(move |y| [*x, *y]));
    let of_first = first.iter().filter_map(|x| Some([*x, facing(1, x)?]));
    let of_second = second.iter().filter_map(|y| Some([facing(0, y)?, *y]));
    let mut pairs: Vec<_> = between.chain(of_first).chain(of_second).collect();
    pairs.sort_by(|[a, b], [c, d]| (a - b).norm().total_cmp(&(c - d).norm()));
    pairs.truncate(MAX_PAIRS);
    pairs
}

#[cfg(test)]
mod tests;
