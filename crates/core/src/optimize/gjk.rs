//! Which point of a convex set that is known by its support points is nearest to 0: the algorithm
//! of Gilbert, Johnson and Keerthi (A fast procedure for computing the distance between complex
//! objects in three-dimensional space, IEEE J. Robotics and Automation 4, 1988). Of two bodies the
//! set is their difference, and 0 as near to it as they are to each other.

use nalgebra::{Matrix3, Vector3};

/// Most support points asked for.
const MAX_STEPS: usize = 16;

/// Least decrease of the squared distance that a support point must promise, relative to the
/// squared distance; dimensionless.
///
/// The simplex method is used for first guesses only. A larger value stops at worse guesses; a
/// smaller one spends [`MAX_STEPS`] on rounding. Pinned by
/// `the_bound_holds_in_all_directions_and_is_close`, a test of the gap in the crate `sublevel-fit`.
const LEAST_APPROACH: f64 = 1e-6;

/// Points of two sets, and their difference.
#[derive(Clone, Copy, Debug)]
pub struct Corner {
    /// Point of A.
    pub x: Vector3<f64>,
    /// Point of B.
    pub y: Vector3<f64>,
    /// Their difference, by which they are near or not.
    pub difference: Vector3<f64>,
}

/// Corners and the weights of the point nearest to 0 that they span; one with a weight of zero is
/// none.
#[derive(Clone, Copy)]
struct Simplex {
    corners: [Corner; 4],
    weights: [f64; 4],
    len: usize,
}

impl Simplex {
    fn nearest(&self, of: impl Fn(&Corner) -> Vector3<f64>) -> Vector3<f64> {
        (0..self.len).map(|k| of(&self.corners[k]) * self.weights[k]).sum()
    }

    /// The part of the simplex with one more corner that contains its point nearest to 0; the new
    /// corner belongs to it.
    fn with(&self, corner: Corner) -> Self {
        let alone = Self { corners: [corner; 4], weights: [1.0, 0.0, 0.0, 0.0], len: 1 };
        let mut best = (alone, corner.difference.norm_squared());
        for others in 1_usize..1 << self.len {
            let mut part = Self { corners: [corner; 4], weights: [0.0; 4], len: 1 };
            for k in (0..self.len).filter(|k| others >> k & 1 == 1) {
                part.corners[part.len] = self.corners[k];
                part.len += 1;
            }
            if part.weigh() {
                let square = part.nearest(|corner| corner.difference).norm_squared();
                if square < best.1 {
                    best = (part, square);
                }
            }
        }
        best.0
    }

    /// Finds the weights of the point nearest to 0 of all that the corners span; whether none is
    /// negative.
    fn weigh(&mut self) -> bool {
        let edge = |k: usize| {
            if k < self.len { self.corners[k].difference - self.corners[0].difference } else { Vector3::zeros() }
        };
        let edges = Matrix3::from_columns(&[edge(1), edge(2), edge(3)]);
        let mut normal = edges.transpose() * edges;
        for k in self.len - 1..3 {
            normal[(k, k)] = 1.0;
        }
        let right = -edges.transpose() * self.corners[0].difference;
        let Some(solution) = normal.cholesky().map(|factor| factor.solve(&right)) else { return false };
        self.weights = [1.0 - solution.sum(), solution[0], solution[1], solution[2]];
        self.weights.iter().all(|&weight| weight >= 0.0)
    }
}

/// Where two sets approach each other.
pub struct Approach {
    /// Point of A near the one nearest to B.
    pub x: Vector3<f64>,
    /// Point of B near the one nearest to A.
    pub y: Vector3<f64>,
    /// Unit vector from B to A; where the sets overlap, as it was when they did not yet seem to.
    pub n: Vector3<f64>,
    /// Points of A and of B farthest towards the other one: corners where the nearest points may
    /// lie anywhere on a side.
    pub corners: (Vector3<f64>, Vector3<f64>),
    /// A point of both sets.
    pub common: Option<Vector3<f64>>,
}

/// What is nearest to 0 of a convex set that is known by its support points along -n, from a
/// direction n on; a distance whose square is no larger than `none` counts as none.
pub fn gjk(none: f64, n: &Vector3<f64>, support: impl Fn(&Vector3<f64>) -> Corner) -> Approach {
    let mut last = support(n);
    let mut simplex = Simplex { corners: [last; 4], weights: [1.0, 0.0, 0.0, 0.0], len: 1 };
    let mut found = Approach { x: last.x, y: last.y, n: *n, corners: (last.x, last.y), common: None };
    for step in 1..=MAX_STEPS {
        let nearest = simplex.nearest(|corner| corner.difference);
        let (x, y) = (simplex.nearest(|corner| corner.x), simplex.nearest(|corner| corner.y));
        let square = nearest.norm_squared();
        if !(square > none) {
            return Approach { common: Some((x + y) * 0.5), ..found };
        }
        last = support(&nearest);
        found = Approach { x, y, n: nearest / square.sqrt(), corners: (last.x, last.y), common: None };
        // Four corners around 0 have no distance; a distance above 0 is rounding.
        let nearer = square - nearest.dot(&last.difference) > LEAST_APPROACH * square;
        if !nearer || simplex.len == 4 || step == MAX_STEPS {
            break;
        }
        simplex = simplex.with(last);
    }
    found
}
