//! About where two bodies are nearest: the algorithm of Gilbert, Johnson and Keerthi (A fast procedure for computing
//! the distance between complex objects in three-dimensional space, IEEE J. Robotics and Automation 4, 1988) on the support
//! points that the outlines keep. Nothing is proven by it; it shows Newton's method where to begin and which constraints are active.

use super::pair::Pair;
use super::vector::{V3, apply_symmetric};
use crate::body::Body;
use crate::polynomial::Scalar;
use nalgebra::{Matrix3, Vector3};

/// Most support points asked for.
const MAX_STEPS: usize = 16;

/// How much nearer a support point must lead, relative to the square of the distance; and the square of the distance relative to
/// the smaller body that counts as none.
const WORTH: f64 = 1e-6;

/// Points of the outlines of both bodies, and their difference.
#[derive(Clone, Copy, Debug)]
pub(super) struct Corner {
    pub(super) x: Vector3<f64>,
    pub(super) y: Vector3<f64>,
    pub(super) difference: Vector3<f64>,
}

/// Corners and the weights of the point nearest to 0 that they span; one with a weight of zero is none.
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

    /// The part of the simplex with one more corner that holds its point nearest to 0; the new corner belongs to it.
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

    /// Finds the weights of the point nearest to 0 of all that the corners span; whether none is negative.
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

/// What the outlines of two bodies show, in the query frame.
pub(super) struct Approach {
    /// Point of A near the one nearest to B, query frame.
    pub(super) x: Vector3<f64>,
    /// Point of B near the one nearest to A.
    pub(super) y: Vector3<f64>,
    /// Unit vector from B to A; where the outlines overlap, as it was when they did not yet seem to.
    pub(super) n: Vector3<f64>,
    /// Points of A and of B farthest towards the other one: corners where the nearest points may lie anywhere on a side.
    pub(super) corners: (Vector3<f64>, Vector3<f64>),
    /// A point of both outlines.
    pub(super) common: Option<Vector3<f64>>,
}

/// Points of the outlines of A farthest along -n and of B farthest along n, query frame.
pub(super) fn corners(pair: &Pair<'_>, n: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (pair.a_to_query(&farthest(pair.a.body, &-n)), farthest_b(pair, n))
}

/// Point of B's outline farthest along n, query frame.
fn farthest_b(pair: &Pair<'_>, n: &Vector3<f64>) -> Vector3<f64> {
    pair.b_to_query(&farthest(pair.b.body, &pair.direction_to_b(n)))
}

/// Point of a body's outline farthest along n, both in the body's frame: of bodies with edges one on the surface.
fn farthest(body: &Body, n: &Vector3<f64>) -> Vector3<f64> {
    let n: V3<f64> = (*n).into();
    let cell = body.outline().cell::<_, f64>(Scalar, n);
    let turned = if body.is_smooth() { apply_symmetric::<Scalar, f64>(&cell.turn, n) } else { [0.0; 3] };
    body.normalization().center + Vector3::from(cell.point) + Vector3::from(turned)
}

/// The approach of two bodies, from a direction from B to A on.
pub(super) fn approach(pair: &Pair<'_>, n: &Vector3<f64>) -> Approach {
    let support = |n: &Vector3<f64>| {
        let (x, y) = corners(pair, n);
        Corner { x, y, difference: x - y }
    };
    gjk(WORTH * pair.a.radius.min(pair.b.radius).powi(2), n, support)
}

/// About where in B the polynomial of A is lowest, as A's normalized coordinates show it, in which it rises about as fast every
/// way: the point of B's outline nearest to A's interior point, and the unit vector from there to it in those coordinates.
pub(super) fn lowest(pair: &Pair<'_>) -> Approach {
    let support = |n: &Vector3<f64>| {
        let point = farthest_b(pair, &-pair.a.pulled_back(n));
        Corner { x: point, y: point, difference: pair.a.normalized(&(point - pair.a.interior)) }
    };
    let first = pair.a.normalized(&(pair.b.interior - pair.a.interior));
    let first = first.try_normalize(0.0).unwrap_or_else(Vector3::x);
    gjk(WORTH * pair.a.body.trust().radius.powi(2), &first, support)
}

/// What is nearest to 0 of a convex set that is known by its support points along -n, from a direction n on; a distance whose
/// square is no larger than `none` counts as none.
fn gjk(none: f64, n: &Vector3<f64>, support: impl Fn(&Vector3<f64>) -> Corner) -> Approach {
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
        // Four corners around 0 have no distance; if they do, rounding has the word.
        let nearer = square - nearest.dot(&last.difference) > WORTH * square;
        if !nearer || simplex.len == 4 || step == MAX_STEPS {
            break;
        }
        simplex = simplex.with(last);
    }
    found
}

#[cfg(test)]
mod tests {
    use super::approach;
    use crate::body::Body;
    use crate::measure::Pose;
    use crate::measure::pair::Pair;
    use crate::measure::tests::{at, random_pose, unit};
    use crate::polynomial::tests::Seeded;
    use nalgebra::Vector3;

    fn cuboid(x: f64, y: f64, z: f64) -> Body {
        Body::cuboid("box", Vector3::new(x, y, z)).unwrap()
    }

    #[test]
    fn boxes_approach_by_face_edge_and_corner() {
        let (a, b) = (cuboid(1.0, 0.8, 0.6), cuboid(0.5, 0.4, 0.3));
        // The gaps along the axes between boxes that stand side by side.
        for gaps in [[0.3, 0.0, 0.0], [0.0, 0.2, 0.0], [0.0, 0.3, 0.4], [0.2, 0.3, 0.6]] {
            let sums = [1.5, 1.2, 0.9];
            let place: [f64; 3] = std::array::from_fn(|i| if gaps[i] > 0.0 { sums[i] + gaps[i] } else { 0.1 });
            let pose = at(place[0], place[1], place[2]);
            let pair = Pair::new(&a, &Pose::identity(), &b, &pose);
            let found = approach(&pair, &-Vector3::from(place).normalize());
            assert!(found.common.is_none());
            let truth = Vector3::from(gaps).norm();
            assert!(
                ((found.x - found.y).norm() * pair.unit() - truth).abs() < 1e-9,
                "gaps {gaps:?}: {} {}",
                found.x,
                found.y
            );
        }
    }

    #[test]
    fn corners_of_turned_boxes_are_as_near_as_brute_force_finds() {
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let (a, b) = (cuboid(1.0, 0.8, 0.6), cuboid(0.5, 0.4, 0.3));
            let pose = random_pose(&mut random, 3.0);
            let pair = Pair::new(&a, &Pose::identity(), &b, &pose);
            let found = approach(&pair, &unit(&mut random));
            assert!(found.common.is_none(), "three metres apart");
            // Alternating projections between the boxes, a linear rate.
            let clamp = |v: Vector3<f64>, h: [f64; 3]| Vector3::from_fn(|i, _| v[i].clamp(-h[i], h[i]));
            let mut y = *pose.translation();
            for _ in 0..10_000 {
                let x = clamp(y, [1.0, 0.8, 0.6]);
                let local = pose.rotation().inverse() * (x - pose.translation());
                y = pose.transform_point(&clamp(local, [0.5, 0.4, 0.3]));
            }
            let truth = (clamp(y, [1.0, 0.8, 0.6]) - y).norm();
            let distance = (found.x - found.y).norm() * pair.unit();
            assert!((distance - truth).abs() < 1e-3 * truth, "seed {seed}: {distance} {truth}");
        }
    }

    #[test]
    fn a_common_point_shows_an_overlap() {
        for seed in 0..100 {
            let mut random = Seeded(seed);
            let (a, b) = (cuboid(1.0, 0.8, 0.6), Body::cylinder("can", 0.4, 0.5).unwrap());
            let pose = random_pose(&mut random, 0.5);
            let pair = Pair::new(&a, &Pose::identity(), &b, &pose);
            let common = approach(&pair, &unit(&mut random)).common.expect("half a metre apart");
            assert!(pair.common(&common), "seed {seed}");
        }
    }
}
