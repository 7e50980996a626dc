//! Triangles of meshes that are proven to intersect, by nothing but signs of volumes.

use nalgebra::Vector3;

/// Corners, metres.
pub type Triangle = [Vector3<f64>; 3];

/// Six times the volume of a tetrahedron below which its sign is not taken as known, m³. Of points
/// within 2 m rounding is below 1e-14, poses and their joints included. A larger value finds fewer
/// of the intersections there are, a smaller one counts triangles that only touch, which
/// `crossings_of_triangles_are_counted` would show.
const VOLUME: f64 = 1e-12;

/// Six times the signed volume of a tetrahedron, m³.
fn volume([a, b, c]: &Triangle, d: &Vector3<f64>) -> f64 {
    (a - d).cross(&(b - d)).dot(&(c - d))
}

/// Whether the segment is proven to cross the interior of the triangle: its ends lie on both sides,
/// and the line through them passes all edges on the same side.
fn crosses(p: &Vector3<f64>, q: &Vector3<f64>, triangle: &Triangle) -> bool {
    let (above, below) = (volume(triangle, p), volume(triangle, q));
    if above.abs() <= VOLUME || below.abs() <= VOLUME || (above > 0.0) == (below > 0.0) {
        return false;
    }
    let [a, b, c] = triangle;
    let around = [[a, b], [b, c], [c, a]].map(|[from, to]| volume(&[*p, *q, *from], to));
    around.iter().all(|side| *side > VOLUME) || around.iter().all(|side| *side < -VOLUME)
}

/// A box with sides along the axes: its least and its largest coordinates, metres.
pub type Bounds = [Vector3<f64>; 2];

/// The smallest such box around points.
pub fn bounds<'a>(points: impl IntoIterator<Item = &'a Vector3<f64>>) -> Bounds {
    let nothing = [f64::INFINITY, f64::NEG_INFINITY].map(Vector3::repeat);
    points.into_iter().fold(nothing, |[low, high], point| [low.inf(point), high.sup(point)])
}

/// Whether two boxes have a common point.
pub fn meet([low, high]: &Bounds, [other_low, other_high]: &Bounds) -> bool {
    (0..3).all(|axis| low[axis] <= other_high[axis] && other_low[axis] <= high[axis])
}

/// Pairs of triangles of two meshes that are proven to intersect.
pub fn crossings(a: &[Triangle], b: &[Triangle]) -> usize {
    let edges = |of: &Triangle, other: &Triangle| (0..3).any(|k| crosses(&of[k], &of[(k + 1) % 3], other));
    // Most triangles are not near the other mesh at all.
    let [of_a, of_b] = [a, b].map(|mesh| bounds(mesh.iter().flatten()));
    let near = |mesh: &[Triangle], other: &Bounds| -> Vec<(Triangle, Bounds)> {
        let boxed = mesh.iter().map(|triangle| (*triangle, bounds(triangle)));
        boxed.filter(|(_, around)| meet(around, other)).collect()
    };
    let (a, b) = (near(a, &of_b), near(b, &of_a));
    let pairs = a.iter().flat_map(|one| b.iter().map(move |other| (one, other)));
    let close = pairs.filter(|((_, around), (_, other_around))| meet(around, other_around));
    close.filter(|((one, _), (other, _))| edges(one, other) || edges(other, one)).count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn crossings_of_triangles_are_counted() {
        let triangle = |z: f64| [[0.0, 0.0, z], [1.0, 0.0, z], [0.0, 1.0, z]].map(Vector3::from);
        let through = [[0.2, 0.2, -0.5], [0.2, 0.3, 0.5], [0.3, 0.2, 0.5]].map(Vector3::from);
        let beside = through.map(|point| point + Vector3::new(0.9, 0.0, 0.0));
        assert_eq!(crossings(&[triangle(0.0), triangle(2.0)], &[through, beside]), 1);
        // A large one that a small one pierces with its edges, in either order.
        let spike = [[0.2, 0.2, -0.1], [0.21, 0.2, -0.1], [0.2, 0.2, 0.1]].map(Vector3::from);
        assert_eq!((crossings(&[triangle(0.0)], &[spike]), crossings(&[spike], &[triangle(0.0)])), (1, 1));
        assert_eq!(crossings(&[triangle(0.0)], &[triangle(0.0)]), 0, "what only touches proves nothing");
        assert_eq!(crossings(&[triangle(0.0)], &[]), 0);
    }

    #[test]
    fn boxes_contain_their_points() {
        let points = [[1.0, -2.0, 0.0], [0.0, 3.0, 0.5]].map(Vector3::from);
        let around = bounds(&points);
        assert_eq!(around, [[0.0, -2.0, 0.0], [1.0, 3.0, 0.5]].map(Vector3::from));
        let at = |x: f64| [Vector3::repeat(x), Vector3::repeat(x + 0.1)];
        assert!(meet(&around, &at(0.3)) && meet(&around, &at(-0.1)) && !meet(&around, &at(1.1)));
        assert!(!meet(&around, &bounds([])), "nothing meets nothing");
    }
}
