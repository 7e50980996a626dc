//! Planes of faces at reflex edges, where a solid bends inwards: cutting there leaves a corner to
//! neither side, so an L falls apart into two boxes exactly.

use nalgebra::Vector3;
use std::collections::HashMap;
use sublevel_core::body::Piece;

/// Cosine of the angle between the normals at an edge below which it is sharp: that of 20°.
///
/// Closer to 1, edges of curved surfaces count as ledges; smaller, chamfers are missed. Pinned by
/// `edges_are_sharp_from_twenty_degrees`.
const SHARP: f64 = 0.94;

/// Difference below which normals, and heights in proportion to the object, belong to one plane;
/// dimensionless.
///
/// Files in single precision round at 1e-7. A smaller value tells planes apart that are one but for
/// rounding; a larger one joins planes of different ledges. Pinned by
/// `faces_in_one_plane_are_one_ledge`.
const SAME: f64 = 1e-6;

/// Most planes that are distinguished.
const MAX_PLANES: usize = 48;

/// A plane along faces that end in reflex edges; the solid behind them is below.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ledge {
    pub(super) normal: Vector3<f64>,
    pub(super) height: f64,
    /// Part of the length of all sharp reflex edges, weighted by how far they bend, that lies in
    /// the plane.
    pub(super) share: f64,
}

/// The planes along the sharp reflex edges of pieces, those with the largest share first.
pub(super) fn ledges(pieces: &[&Piece]) -> Vec<Ledge> {
    let mut edges: Vec<Edge> = pieces.iter().flat_map(|piece| reflex_edges(piece)).collect();
    edges.sort_by(|a, b| b.weight.total_cmp(&a.weight));
    let total: f64 = edges.iter().map(|edge| edge.weight).sum();
    let corners = || pieces.iter().flat_map(|piece| piece.spots()).map(|spot| spot.x);
    let size = corners().fold(0.0, |most: f64, x| most.max(x.amax()));
    let near =
        |a: &(Vector3<f64>, f64), b: &(Vector3<f64>, f64)| (a.0 - b.0).norm() < SAME && (a.1 - b.1).abs() < SAME * size;
    let mut planes: Vec<((Vector3<f64>, f64), f64)> = Vec::new();
    for edge in &edges {
        for face in edge.faces {
            match planes.iter().position(|(plane, _)| near(plane, &face)) {
                Some(known) => planes[known].1 += edge.weight,
                None if planes.len() < MAX_PLANES => planes.push((face, edge.weight)),
                None => {}
            }
        }
    }
    let ledge = |((normal, height), weight)| Ledge { normal, height, share: weight / total };
    let mut ledges: Vec<Ledge> = planes.into_iter().map(ledge).collect();
    ledges.sort_by(|a, b| b.share.total_cmp(&a.share));
    ledges
}

/// A sharp reflex edge.
struct Edge {
    weight: f64,
    /// The planes of its triangles: unit normals out of the solid, and heights.
    faces: [(Vector3<f64>, f64); 2],
}

fn reflex_edges(piece: &Piece) -> Vec<Edge> {
    let at = |corner: usize| piece.spots()[corner].x;
    let inward = if piece.is_closed() && piece.signed_volume() < 0.0 { -1.0 } else { 1.0 };
    let normals: Vec<Option<Vector3<f64>>> = piece
        .triangles()
        .iter()
        .map(|&[a, b, c]| {
            let cross = (at(b) - at(a)).cross(&(at(c) - at(a))) * inward;
            let longest = (at(b) - at(a)).norm().max((at(c) - at(a)).norm());
            // Slivers have no usable direction.
            (cross.norm() > 1e-9 * longest * longest).then(|| cross.normalize())
        })
        .collect();
    let mut passes: HashMap<(usize, usize), [Option<usize>; 2]> = HashMap::new();
    let mut order = Vec::new();
    for (triangle, &[a, b, c]) in piece.triangles().iter().enumerate() {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            let edge = (p.min(q), p.max(q));
            let known = passes.entry(edge).or_insert_with(|| {
                order.push(edge);
                [None; 2]
            });
            known[usize::from(p > q)] = Some(triangle);
        }
    }
    let edge = |(p, q): (usize, usize)| {
        let [Some(forward), Some(backward)] = passes[&(p, q)] else { return None };
        let (n, m) = (normals[forward]?, normals[backward]?);
        let along = (at(q) - at(p)) * inward;
        let (cosine, reflex) = (n.dot(&m), n.cross(&m).dot(&along) < 0.0);
        let faces = [(n, n.dot(&at(p))), (m, m.dot(&at(p)))];
        (reflex && cosine < SHARP).then(|| Edge { weight: along.norm() * (1.0 - cosine).min(1.0), faces })
    };
    order.into_iter().filter_map(edge).collect()
}

#[cfg(test)]
mod tests {
    use super::ledges;
    use nalgebra::Vector3;
    use sublevel_core::body::Piece;

    /// A bar along z with a notch whose sides differ by an angle, in two lengths; the notch is
    /// deeper by `deeper` at the far end.
    fn notched(degrees: f64, deeper: f64) -> Piece {
        let depth = (0.5 * degrees.to_radians()).tan();
        let outline = |depth: f64| [[0.0, 0.0], [2.0, 0.0], [2.0, 1.0], [1.0, 1.0 - depth], [0.0, 1.0]];
        let layer = |z: f64, depth: f64| outline(depth).map(|[x, y]| Vector3::new(x, y, z));
        let points = [layer(0.0, depth), layer(1.0, depth), layer(2.0, depth + deeper)].concat();
        let mut triangles = Vec::new();
        for [a, b, c] in [[3, 4, 0], [3, 0, 1], [3, 1, 2]] {
            triangles.extend([[a, c, b], [a + 10, b + 10, c + 10]]);
        }
        for (first, i) in [0, 5].into_iter().flat_map(|first| (0..5).map(move |i| (first, i))) {
            let (p, q) = (first + i, first + (i + 1) % 5);
            triangles.extend([[p, q, q + 5], [p, q + 5, p + 5]]);
        }
        Piece::of_mesh(&points, &triangles).unwrap()
    }

    #[test]
    fn edges_are_sharp_from_twenty_degrees() {
        assert!(ledges(&[&notched(17.0, 0.0)]).is_empty());
        assert!(!ledges(&[&notched(23.0, 0.0)]).is_empty());
    }

    #[test]
    fn faces_in_one_plane_are_one_ledge() {
        for (deeper, planes) in [(0.0, 2), (1e-7, 2), (1e-4, 4)] {
            assert_eq!(ledges(&[&notched(40.0, deeper)]).len(), planes, "{deeper}");
        }
    }
}
