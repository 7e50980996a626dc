//! Most points of a large cloud are far from its convex hull's surface: they are left out before
//! the hull is computed.
//!
//! The extreme points along some directions span a polytope inside the hull, and what lies inside
//! that is no vertex (Akl and Toussaint, A fast convex hull algorithm, Inf. Process. Lett. 7,
//! 1978). More directions, for the fewer points that are left, leave fewer still.

use super::facets::facets;
use super::facing::{Facing, cell_count, cell_of};
use nalgebra::Vector3;
use sublevel_core::body::fibonacci_lattice;

/// Fewer points than this are not worth the work.
const MANY: usize = 4096;

/// How corners of the polytopes are chosen, one after the other.
const CHOICES: [Choice; 3] = [Choice::Extreme(64), Choice::Extreme(512), Choice::Farthest(24)];

/// Depth inside of the polytope from which a point is left out, the points having extents near 1;
/// dimensionless.
///
/// Depths round at about 1e-15. A smaller value leaves out points whose side rounding decides; a
/// larger one keeps more points, which only costs time. Pinned by `corners_and_duplicates_stay`.
const LEAST_DEPTH_INSIDE: f64 = 1e-9;

/// Which points span a polytope.
enum Choice {
    /// The extreme ones along as many directions: finds the corners of an object.
    Extreme(usize),
    /// The farthest from the middle in each cell of directions, by cells along the edge of a cube:
    /// follows smooth surfaces, which takes many.
    Farthest(usize),
}

/// Indices of the points that may be vertices of the convex hull, ascending; the others lie inside
/// the hull of these. The points have extents near 1.
pub(super) fn outermost(points: &[Vector3<f64>]) -> Vec<usize> {
    let mut left: Vec<usize> = (0..points.len()).collect();
    for choice in CHOICES {
        if left.len() < MANY {
            break;
        }
        // Without a polytope nothing is known to be inside.
        if let Some(polytope) = polytope(points, &choice.among(points, &left)) {
            left.retain(|&i| polytope.beyond(&points[i]) > -LEAST_DEPTH_INSIDE);
        }
    }
    left
}

impl Choice {
    fn among(&self, points: &[Vector3<f64>], left: &[usize]) -> Vec<usize> {
        let places = match *self {
            Self::Extreme(count) => count,
            Self::Farthest(grid) => cell_count(grid),
        };
        let mut best = vec![(f64::NEG_INFINITY, 0); places];
        let mut compete = |place: usize, height: f64, i: usize| {
            let best: &mut (f64, usize) = &mut best[place];
            if height > best.0 {
                *best = (height, i);
            }
        };
        match *self {
            Self::Extreme(count) => {
                let directions: Vec<Vector3<f64>> = fibonacci_lattice(count).collect();
                for &i in left {
                    directions.iter().enumerate().for_each(|(k, direction)| compete(k, direction.dot(&points[i]), i));
                }
            }
            Self::Farthest(grid) => {
                left.iter().for_each(|&i| compete(cell_of(&points[i], grid), points[i].norm_squared(), i));
            }
        }
        let mut chosen: Vec<usize> = best.iter().filter(|best| best.0.is_finite()).map(|&(_, i)| i).collect();
        chosen.sort_unstable();
        chosen.dedup();
        chosen
    }
}

/// The convex hull of few points; none if the hull code fails.
fn polytope(points: &[Vector3<f64>], chosen: &[usize]) -> Option<Facing> {
    let corners: Vec<Vector3<f64>> = chosen.iter().map(|&i| points[i]).collect();
    let (_, triangles) = facets(&corners).ok()?;
    let planes = triangles.iter().map(|&[a, b, c]| {
        let normal = (corners[b] - corners[a]).cross(&(corners[c] - corners[a])).try_normalize(1e-12)?;
        Some((normal, normal.dot(&corners[a])))
    });
    // A sliver has no usable plane, and without it the polytope would be larger than it is.
    let planes: Option<Vec<_>> = planes.collect();
    Facing::new(corners.iter().sum::<Vector3<f64>>() / corners.len() as f64, planes?.into_iter())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeSet;
    use sublevel_testkit::Seeded;

    #[test]
    fn nothing_that_is_extreme_is_left_out() {
        for seed in 0..6 {
            let mut random = Seeded(seed);
            // A ball, a cube, a shell with noise.
            let point = |random: &mut Seeded| {
                let x = Vector3::from_fn(|_, _| random.signed());
                match seed % 3 {
                    0 => x.normalize() * random.signed().abs().cbrt(),
                    1 => x * 0.5,
                    _ => x.normalize() * (1.0 + 1e-3 * random.signed()),
                }
            };
            let points: Vec<_> = (0..20_000).map(|_| point(&mut random)).collect();
            let left: BTreeSet<usize> = outermost(&points).into_iter().collect();
            // Of the shell hardly any point is deep inside.
            assert!(seed % 3 == 2 || left.len() < points.len() / 2, "seed {seed}: {} left", left.len());
            for _ in 0..3000 {
                let direction = Vector3::from_fn(|_, _| random.signed()).normalize();
                let farthest =
                    (0..points.len()).max_by(|&a, &b| direction.dot(&points[a]).total_cmp(&direction.dot(&points[b])));
                assert!(left.contains(&farthest.unwrap()), "seed {seed}");
            }
        }
    }

    #[test]
    fn corners_and_duplicates_stay() {
        let corners: Vec<Vector3<f64>> =
            (0..8).map(|i| Vector3::from_fn(|k, _| if i >> k & 1 == 1 { 0.5 } else { -0.5 })).collect();
        let mut random = Seeded(1);
        let mut points: Vec<_> = (0..10_000).map(|_| Vector3::from_fn(|_, _| 0.49 * random.signed())).collect();
        points.extend(corners.iter().chain(&corners));
        let left = outermost(&points);
        assert!((10_000..10_008).all(|i| left.contains(&i) || left.contains(&(i + 8))), "{left:?}");
        assert!(left.len() < 100, "{}", left.len());
    }
}
