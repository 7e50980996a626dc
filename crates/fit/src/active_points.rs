//! The points that a program knows, out of all that it has to contain.

use super::farthest_points::farthest_points;
use super::program::Problem;
use super::spaced_points::spaced_points;
use super::structure::Structure;
use nalgebra::{DMatrix, Vector3};
use sublevel_core::body::fibonacci_lattice;

/// Points in the start, in multiples of N, and the most that are taken for likely.
const START_MULTIPLE: usize = 10;
/// See [`START_MULTIPLE`].
const LIKELY_MULTIPLE: usize = 5;

/// The points a program knows.
pub(super) struct ActivePoints {
    /// Which of the points are in.
    used: Vec<bool>,
    chosen: Vec<Vector3<f64>>,
    /// Monomials of each chosen point, one column each.
    pub(super) values: DMatrix<f64>,
}

impl ActivePoints {
    /// A well-spread subset, the likeliest points, and for convex p some inside the hull: those
    /// constrain nothing, but with weight on them the moments are positive definite also when the
    /// points lie on a quadric, as the corners of a box do.
    pub(super) fn start(problem: &Problem, points: &[Vector3<f64>], likely: &[usize]) -> Self {
        let first = farthest_points(points, START_MULTIPLE * problem.structure.gram.size);
        Self::of(problem, points, likely, &first)
    }

    /// As [`ActivePoints::start`], with all points where these are at most `all`.
    pub(super) fn start_with_all(problem: &Problem, points: &[Vector3<f64>], likely: &[usize], all: usize) -> Self {
        if points.len() > all {
            return Self::start(problem, points, likely);
        }
        Self::of(problem, points, &[], &(0..points.len()).collect::<Vec<_>>())
    }

    fn of(problem: &Problem, points: &[Vector3<f64>], likely: &[usize], first: &[usize]) -> Self {
        let structure = problem.structure;
        let mut chosen: Vec<Vector3<f64>> = first.iter().map(|&index| points[index]).collect();
        if problem.is_convex() {
            chosen.extend(inner(structure));
        }
        let mut used = vec![false; points.len()];
        first.iter().for_each(|&index| used[index] = true);
        let unused = likely.iter().copied().filter(|&index| !used[index]);
        let likely = spaced_points(points, unused, LIKELY_MULTIPLE * structure.gram.size);
        likely.iter().for_each(|&index| used[index] = true);
        chosen.extend(likely.into_iter().map(|index| points[index]));
        let values = columns(structure, &chosen);
        Self { used, chosen, values }
    }

    /// Adds the worst of the points outside, but not many from one spot.
    pub(super) fn add(&mut self, structure: &Structure, points: &[Vector3<f64>], outside: &[(f64, usize)]) {
        let candidates = outside.iter().map(|&(_, index)| index).filter(|&index| !self.used[index]);
        let added = spaced_points(points, candidates, 2 * structure.gram.size);
        added.iter().for_each(|&index| self.used[index] = true);
        self.chosen.extend(added.into_iter().map(|index| points[index]));
        self.values = columns(structure, &self.chosen);
    }
}

fn columns(structure: &Structure, points: &[Vector3<f64>]) -> DMatrix<f64> {
    DMatrix::from_columns(&points.iter().map(|point| structure.values(point)).collect::<Vec<_>>())
}

/// Points of a ball that is in the hull, twice as many as monomials of half the degree: they
/// constrain nothing, but with weight on them moments are positive definite also where there are
/// few points, or points on a quadric. The unit ball is the smallest ellipsoid around the hull, so
/// the ball of a third of its radius is inside (John's theorem).
pub(super) fn inner(structure: &Structure) -> impl Iterator<Item = Vector3<f64>> {
    let count = 2 * structure.gram.size;
    fibonacci_lattice(count).enumerate().map(|(i, u)| u * (INNER_RADIUS * (i as f64 * RADIUS_STEP).fract().cbrt()))
}

/// Radius of the ball, and the step of a low-discrepancy sequence of its radii.
const INNER_RADIUS: f64 = 0.33;
const RADIUS_STEP: f64 = 0.754_878;
