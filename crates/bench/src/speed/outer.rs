//! Convex hulls with fewer vertices that still contain the object.
//!
//! Planes that touch the hull are intersected. It begins with a tetrahedron of them; then, again
//! and again, the vertex that stands out farthest from the hull is cut off by the plane that
//! touches the hull at the point nearest to it, across the way to it. That is the greedy way to the
//! least Hausdorff distance. Intersections of half-spaces that hold the origin are polar to convex
//! hulls: the plane `n·x <= h` is the point `n / h`, and a facet of the hull of these points is a
//! vertex.

use nalgebra::{Matrix3, Vector3};
use parry3d_f64::math::Vector;
use parry3d_f64::transformation::try_convex_hull;
use sublevel::optimize::{Corner, gjk};

/// How much is left of the space between two vertices that count as one, relative to the size of
/// the hull.
const SAME: f64 = 1e-9;
/// Each plane is moved out by this part of the size: rounding leaves no point of the object
/// outside.
const SLACK: f64 = 1e-12;

/// For each of `counts` the vertices of a polytope around the hull of `hull`, whose points are its
/// vertices; at most so many. None where the hull itself has no more, or has none that simple.
pub(super) fn outer(hull: &[Vector3<f64>], counts: &[usize]) -> Vec<Option<Vec<Vector3<f64>>>> {
    let center = hull.iter().sum::<Vector3<f64>>() / hull.len() as f64;
    let points: Vec<Vector3<f64>> = hull.iter().map(|x| x - center).collect();
    let size = points.iter().map(Vector3::norm).fold(0.0, f64::max);
    let mut planes: Vec<Vector3<f64>> = Vec::new();
    for (x, y, z) in [(1.0, 1.0, 1.0), (1.0, -1.0, -1.0), (-1.0, 1.0, -1.0), (-1.0, -1.0, 1.0)] {
        planes.push(touching(&points, &Vector3::new(x, y, z).normalize(), size));
    }
    let mut found: Vec<Option<Vec<Vector3<f64>>>> = vec![None; counts.len()];
    let most = counts.iter().copied().max().unwrap_or(0);
    // A plane takes a vertex away and brings three or more.
    while let Some(vertices) = vertices(&planes, size) {
        for (&count, found) in counts.iter().zip(&mut found) {
            if vertices.len() <= count {
                *found = Some(vertices.clone());
            }
        }
        if vertices.len() > most || planes.len() > 2 * most {
            break;
        }
        let beyond = vertices.iter().map(|v| excess(&points, v, size));
        let Some(away) = beyond.max_by(|a, b| a.norm().total_cmp(&b.norm())).filter(|a| a.norm() > SAME * size) else {
            break;
        };
        planes.push(touching(&points, &away.normalize(), size));
    }
    let simpler = |(count, found): (&usize, Option<Vec<Vector3<f64>>>)| found.filter(|_| *count < hull.len());
    let back = |vertices: Vec<Vector3<f64>>| vertices.into_iter().map(|v| v + center).collect();
    counts.iter().zip(found).map(simpler).map(|vertices| vertices.map(back)).collect()
}

/// The plane across the unit vector `n` that touches the hull, as the polar point `n / h`.
fn touching(points: &[Vector3<f64>], n: &Vector3<f64>, size: f64) -> Vector3<f64> {
    n / (height(points, n) + SLACK * size)
}

fn height(points: &[Vector3<f64>], n: &Vector3<f64>) -> f64 {
    points.iter().map(|x| n.dot(x)).fold(f64::NEG_INFINITY, f64::max)
}

/// The way from the nearest point of the hull to `v`.
fn excess(points: &[Vector3<f64>], v: &Vector3<f64>, size: f64) -> Vector3<f64> {
    let support = |n: &Vector3<f64>| {
        let farthest = points.iter().min_by(|a, b| n.dot(a).total_cmp(&n.dot(b)));
        // Never empty: a hull has vertices.
        let x = farthest.copied().unwrap_or_default();
        Corner { x, y: *v, difference: x - v }
    };
    let nearest = gjk((SAME * size).powi(2), &-v.normalize(), support);
    if nearest.common.is_some() { Vector3::zeros() } else { v - nearest.x }
}

/// The vertices of the intersection of planes given by their polar points; none if it is not
/// bounded or cannot be computed.
fn vertices(planes: &[Vector3<f64>], size: f64) -> Option<Vec<Vector3<f64>>> {
    let polar: Vec<Vector> = planes.iter().map(|p| Vector::new(p.x, p.y, p.z) * size).collect();
    // The hull code asserts its topology, which rounding can break.
    let (corners, facets) = std::panic::catch_unwind(|| try_convex_hull(&polar)).ok()?.ok()?;
    let corner = |i: u32| {
        let p = corners[i as usize];
        Vector3::new(p.x, p.y, p.z) / size
    };
    let mut found: Vec<Vector3<f64>> = Vec::new();
    for facet in facets {
        let rows = Matrix3::from_rows(&facet.map(|i| corner(i).transpose()));
        let vertex = rows.lu().solve(&Vector3::repeat(1.0))?;
        if !vertex.iter().all(|c| c.is_finite()) || vertex.norm() > 1e3 * size {
            return None;
        }
        // More than three planes may meet in one.
        if found.iter().all(|known| (known - vertex).norm() > SAME * size) {
            found.push(vertex);
        }
    }
    Some(found)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Random;
    use sublevel::fit::hull::convex_hull;

    #[test]
    fn every_simplification_holds_the_hull_and_is_closer_than_the_one_before() {
        let mut random = Random(3);
        let cloud: Vec<Vector3<f64>> =
            (0..600).map(|_| random.direction().component_mul(&Vector3::new(1.0, 0.4, 0.2)).add_scalar(2.0)).collect();
        let hull: Vec<Vector3<f64>> = convex_hull(&cloud).unwrap().vertices.iter().map(|&i| cloud[i]).collect();
        let counts = [16, 32, 64, 128];
        let found = outer(&hull, &counts);
        let mut last = f64::INFINITY;
        for (vertices, count) in found.iter().zip(counts) {
            let vertices = vertices.as_ref().unwrap();
            assert!((count / 2..=count).contains(&vertices.len()), "{} of {count}", vertices.len());
            let volume = convex_hull(vertices).unwrap().volume;
            assert!(volume < last, "{volume}");
            last = volume;
            for _ in 0..2000 {
                let n = random.direction();
                assert!(height(vertices, &n) >= height(&hull, &n));
            }
        }
    }

    #[test]
    fn of_a_box_there_is_nothing_to_simplify() {
        let corners: Vec<Vector3<f64>> = (0..8_u8).map(|i| Vector3::from_fn(|k, _| f64::from(i >> k & 1))).collect();
        assert_eq!(outer(&corners, &[16, 32]), [None, None]);
    }
}
