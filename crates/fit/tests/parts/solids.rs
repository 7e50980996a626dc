//! Solids that tests divide into parts: closed meshes, triangles counter-clockwise seen from
//! outside, metres.

use nalgebra::Vector3;
use std::f64::consts::TAU;
use sublevel_fit::Mesh;

/// Meshes as one.
pub(crate) fn together(meshes: &[Mesh]) -> Mesh {
    let mut all = Mesh { points: vec![], triangles: vec![] };
    for Mesh { points, triangles } in meshes {
        let before = all.points.len();
        all.points.extend(points);
        all.triangles.extend(triangles.iter().map(|triangle| triangle.map(|corner| corner + before)));
    }
    all
}

fn quads(quads: &[[usize; 4]]) -> Vec<[usize; 3]> {
    quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect()
}

fn corners(low: [f64; 3], high: [f64; 3]) -> impl Iterator<Item = Vector3<f64>> {
    (0..8_u8).map(move |i| Vector3::from_fn(|axis, _| if i >> axis & 1 == 1 { high[axis] } else { low[axis] }))
}

/// A box from one corner to the other.
pub(crate) fn cuboid(low: [f64; 3], high: [f64; 3]) -> Mesh {
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    Mesh { points: corners(low, high).collect(), triangles: quads(&faces) }
}

/// The same surface seen from the other side.
pub(crate) fn reversed(mesh: Mesh) -> Mesh {
    Mesh { triangles: mesh.triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect(), ..mesh }
}

/// A box open at the top, with walls and a bottom of one thickness.
pub(crate) fn bin(size: [f64; 3], wall: f64) -> Mesh {
    let inner = corners([wall; 3], [size[0] - wall, size[1] - wall, size[2]]);
    let points = corners([0.0; 3], size).chain(inner).collect();
    // The inside is that of a box, seen from the other side; the rim joins the two tops.
    let outside = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1]];
    let inside = outside.map(|[a, b, c, d]| [d + 8, c + 8, b + 8, a + 8]);
    let rim = [[4, 5], [5, 7], [7, 6], [6, 4]].map(|[a, b]| [a, b, b + 8, a + 8]);
    Mesh { points, triangles: quads(&[&outside[..], &inside[..], &rim[..]].concat()) }
}

/// A tube along z, from z = 0, of this many sides.
pub(crate) fn tube(radius: f64, bore: f64, length: f64, sides: usize) -> Mesh {
    let ring = |radius: f64, z: f64| {
        (0..sides).map(move |i| {
            let (sin, cos) = (TAU * i as f64 / sides as f64).sin_cos();
            Vector3::new(radius * cos, radius * sin, z)
        })
    };
    let points = ring(radius, 0.0).chain(ring(radius, length)).chain(ring(bore, 0.0)).chain(ring(bore, length));
    let [low, high, bore_low, bore_high] = [0, sides, 2 * sides, 3 * sides];
    let faces = (0..sides).flat_map(|i| {
        let j = (i + 1) % sides;
        [
            [low + i, low + j, high + j, high + i],
            [bore_low + j, bore_low + i, bore_high + i, bore_high + j],
            [high + i, high + j, bore_high + j, bore_high + i],
            [low + j, low + i, bore_low + i, bore_low + j],
        ]
    });
    Mesh { points: points.collect(), triangles: quads(&faces.collect::<Vec<_>>()) }
}

/// Volume inside.
pub(crate) fn volume(mesh: &Mesh) -> f64 {
    let at = |corner: usize| mesh.points[corner];
    mesh.triangles.iter().map(|&[a, b, c]| at(a).dot(&at(b).cross(&at(c)))).sum::<f64>() / 6.0
}
