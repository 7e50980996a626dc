//! Level distances of sets that need not be convex.

use super::error::HierarchyError;
use super::level_search::lowest_points;
use super::minimisers::{are_all, attaining};
use super::moments::MomentRelaxation;
use super::placed_set::PlacedSet;
use super::solve::{EXACT, check, check_size, solved};
use crate::progress::{Progress, Watch};
use crate::unsolved::ProgramError;
use nalgebra::Vector3;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::polynomial::{PairPolynomial, Point};

/// A bracket of the level distance of two sets; unit-free but for the points.
#[derive(Clone, Debug, PartialEq)]
pub struct HierarchyLevelBound {
    /// Level of the hierarchy.
    pub level: usize,
    /// Proven lower bound; minus infinity where nothing is known.
    pub lower: f64,
    /// Proven upper bound, of the value at a point that is proven to lie in the second set;
    /// infinite if none was found.
    pub upper: f64,
    /// This point, in the frame of the poses, metres.
    pub point: Option<Vector3<f64>>,
    /// Whether the lower bound is the level distance, to 1e-5 of `max(1, |upper|)`, 1 being the
    /// level of the first set's boundary.
    pub is_exact: bool,
    /// Points that are proven to lie in the second set and, where the bound is exact, attain it to
    /// the same tolerance, the lowest first; points that agree to a hundredth of half the diagonal
    /// of its box count once. Frame of the poses, metres. Empty where the bound is not exact.
    pub minimisers: Vec<Vector3<f64>>,
    /// Whether these are all, as the ranks of the moment matrices say: a judgement of rounded
    /// numbers, not proven. False where minimisers are not finitely many.
    pub has_all_minimisers: bool,
    /// Iterations of the solver.
    pub iterations: usize,
    /// Wall time, seconds.
    pub seconds: f64,
}

/// The bracket of the level distance `d(p‖q) = min { p(x) : q(x) <= 1 }` of two sets at a level of
/// the hierarchy, p and q the largest of the polynomials of the first and of the second set, each
/// at its pose: as of [`sublevel_core::measure::level_distance`], with the sets in the same order
/// (Ahmadi, Hall, Makadia and Sindhwani, section IV-B). Above 1 the sets are apart, at 1 they
/// touch, below 1 they overlap; it is not symmetric. Boxes bound the second set alone: the first
/// set's polynomials count everywhere.
///
/// The program is of the normalized coordinates u of the second set, where those of the first are
/// affine, `z(u) = A u + b`:
///
/// ```text
/// p_i(z(u)) averaged with weights w - γ = squares + Σ σ_j (1 - q_j(u)),   w >= 0, Σ w = 1,
/// ```
///
/// squares of polynomials of degree `max(deg p, deg q)/2 + level`, as many in σ_j as that leaves
/// room for. An average is nowhere above the largest p_i, so γ is a lower bound; the weights are
/// variables of the program, multipliers of `t >= p_i`. For sos-convex polynomials level 0 is
/// exact, with several as with one. Otherwise, of several p_i, the bound rises with the level to
/// the largest minimum of an average, which may be below the level distance.
///
/// A solver's numbers are relative to the largest values of p on the second set's box: where these
/// are many thousand times `max(1, d)`, as for a second set that is several times larger than the
/// first one at degree 8, the bracket is wide, and is not called exact. `progress` is called at
/// every iteration of the solver and can stop it.
///
/// # Errors
/// [`HierarchyError`]: sets that cannot be used, a level that is too high, a program that would be
/// too large, and one that could not be solved.
pub fn hierarchy_level_distance(
    sets: [&PlacedSet; 2],
    level: usize,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<HierarchyLevelBound, HierarchyError> {
    let start = Instant::now();
    let (objectives, degree) = checked(sets, level)?;
    let second = sets[1];
    let [a, b, c] = second.coordinate_bounds();
    let most = [a, b, c, 0.0, 0.0, 0.0];
    // What the box alone says: each p_i is a lower bound of the largest.
    let of_box = objectives.iter().filter_map(|f| f.lower_bound(&[], &most)).fold(f64::NEG_INFINITY, f64::max);

    let mut found = lowest_points(sets, &[]);
    let expected = found.first().map_or(f64::INFINITY, |lowest| lowest.0.abs().max(1.0));
    let mut watch = Watch::new(progress);
    let (mut lower, mut atoms) = (of_box, Vec::new());
    // The solver's errors are relative to what the objective is divided by, and which is best is
    // not known: its largest coefficient, or about its minimum.
    let (mut is_solved, mut failed) = (false, None);
    for unit in [f64::INFINITY, expected] {
        let relaxation = MomentRelaxation::of_one(&objectives, degree, second, level).with_expected(unit);
        let (solution, rows) = match solved(&relaxation, level, &mut watch) {
            // Constraints that do not bound the set: the box does.
            Err(HierarchyError::Unsolved { why: ProgramError::Unbounded, .. }) => {
                is_solved = true;
                break;
            }
            // The other unit may do.
            Err(error @ HierarchyError::Unsolved { .. }) => {
                failed = Some(error);
                continue;
            }
            solution => solution?,
        };
        is_solved = true;
        let known = relaxation.atoms(&solution);
        let mut guesses = relaxation.first_moments(&solution);
        guesses.extend(known.iter().flat_map(|atoms| &atoms.points));
        found.extend(lowest_points(sets, &guesses));
        let average = PairPolynomial::average(&objectives, &relaxation.weights(&solution, &rows));
        let bound = average.and_then(|average| {
            let squares = relaxation.squares(&average, &solution, &rows);
            average.lower_bound(&squares, &most)
        });
        if let Some(bound) = bound.filter(|&bound| bound > lower) {
            (lower, atoms) = (bound, known);
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0));
        if is_closed(lower, &found) {
            break;
        }
    }
    if let Some(error) = failed.filter(|_| !is_solved) {
        return Err(error);
    }
    let lowest = found.first().copied();
    let upper = lowest.map_or(f64::INFINITY, |(value, _)| value);
    let (is_exact, tolerance) = (is_closed(lower, &found), tolerance(upper));
    let most = if is_exact { lower + tolerance } else { f64::NEG_INFINITY };
    let size = second.radius_m();
    let minimisers = attaining(&found, most, size);
    Ok(HierarchyLevelBound {
        level,
        lower,
        upper,
        point: lowest.map(|(_, [point])| point),
        is_exact,
        has_all_minimisers: !atoms.is_empty() && are_all(&minimisers, &atoms, size),
        minimisers: minimisers.into_iter().map(|[point]| point).collect(),
        iterations: watch.progress().iterations,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// Whether the bracket of a level distance can be asked for at a level, without a solve: what
/// [`hierarchy_level_distance`] refuses before it builds its program. Takes milliseconds.
///
/// # Errors
/// [`HierarchyError`]: sets that cannot be used, a level that is too high, and a program that would
/// be too large.
pub fn check_hierarchy_level(sets: [&PlacedSet; 2], level: usize) -> Result<(), HierarchyError> {
    let (objectives, degree) = checked(sets, level)?;
    check_size(&MomentRelaxation::of_one(&objectives, degree, sets[1], level), level)
}

/// The polynomials of the first set in the coordinates of the second, and their largest degree.
fn checked(sets: [&PlacedSet; 2], level: usize) -> Result<(Vec<PairPolynomial>, usize), HierarchyError> {
    check(sets, level)?;
    let [first, second] = sets;
    let polynomials = &first.set.polynomials;
    let map = second.frame_in(1, first)?;
    let objectives = polynomials.iter().map(|p| PairPolynomial::substituted(p, &map, Point::First)).collect();
    Ok((objectives, polynomials.iter().map(|p| p.degree()).max().unwrap_or(2)))
}

/// Width of a bracket at which it is called exact.
fn tolerance(upper: f64) -> f64 {
    EXACT * upper.abs().max(1.0)
}

/// Whether a lower bound and the lowest value that was found meet.
fn is_closed(lower: f64, found: &[(f64, [Vector3<f64>; 1])]) -> bool {
    found.first().is_some_and(|&(upper, _)| lower <= upper && upper - lower <= tolerance(upper))
}
