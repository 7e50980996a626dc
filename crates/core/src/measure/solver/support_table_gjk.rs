//! About where two bodies are nearest, by the support points that their outlines keep. Nothing is
//! proven by it; it shows Newton's method where to begin and which constraints are active.

use crate::measure::frames::query_frame::Pair;
use crate::optimize::{Approach, Corner, gjk};
use nalgebra::Vector3;

/// Square of the distance, relative to the smaller body, dimensionless, that counts as none: a
/// thousandth of its size, where support tables are off by percents.
///
/// Larger, near misses are taken for contacts; smaller, GJK iterates on the error of the tables.
/// Exercised by `a_common_point_shows_an_overlap`.
const NONE: f64 = 1e-6;

/// Points of the outlines of A farthest along -n and of B farthest along n, query frame.
pub(in crate::measure) fn corners(pair: &Pair<'_>, n: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
    (pair.farthest_a(&-n).0, pair.farthest_b(n).0)
}

/// The approach of two bodies, from a direction from B to A on.
pub(in crate::measure) fn approach(pair: &Pair<'_>, n: &Vector3<f64>) -> Approach {
    let support = |n: &Vector3<f64>| {
        let (x, y) = corners(pair, n);
        Corner { x, y, difference: x - y }
    };
    gjk(NONE * pair.a.radius.min(pair.b.radius).powi(2), n, support)
}

/// About where in B the polynomial of A is lowest, as A's normalized coordinates show it, in which
/// it rises about as fast every way: the point of B's outline nearest to A's interior point, and
/// the unit vector from there to it in those coordinates.
pub(in crate::measure) fn lowest(pair: &Pair<'_>) -> Approach {
    let support = |n: &Vector3<f64>| {
        let (point, _) = pair.farthest_b(&-pair.a.pulled_back(n));
        Corner { x: point, y: point, difference: pair.a.normalized(&(point - pair.a.interior)) }
    };
    let first = pair.a.normalized(&(pair.b.interior - pair.a.interior));
    let first = first.try_normalize(0.0).unwrap_or_else(Vector3::x);
    gjk(NONE * pair.a.body.trust().radius.powi(2), &first, support)
}

#[cfg(test)]
mod tests {
    use super::approach;
    use crate::body::Body;
    use crate::measure::Pose;
    use crate::measure::frames::query_frame::Pair;
    use crate::measure::tests::{at, random_pose};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

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
            let found = approach(&pair, &random.unit());
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
            let common = approach(&pair, &random.unit()).common.expect("half a metre apart");
            assert!(pair.common(&common), "seed {seed}");
        }
    }
}
