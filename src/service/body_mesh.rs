//! Triangle meshes of bodies, for viewers: an icosahedron whose faces are divided, every vertex
//! moved to the surface along its direction from an interior point.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use nalgebra::Vector3;

use crate::body::{Body, BodyId, Solid, SosBody};
use crate::scene::Geometry;

use super::limits::MAX_KEPT_MESHES;
use super::packed::Packed;
use super::proto::GetBodyMeshResponse;
use super::wire;

/// A mesh that is shared by those who ask for it.
type SharedMesh = Arc<GetBodyMeshResponse>;

/// Meshes that were asked for, by body and divisions; the table is emptied when it is full.
#[derive(Debug, Default)]
pub(super) struct Meshes(Mutex<HashMap<(BodyId, u32), SharedMesh>>);

impl Meshes {
    /// The mesh of a body; none of a half-space.
    pub(super) fn get(&self, geometry: &Geometry, divisions: u32) -> Option<SharedMesh> {
        let key = (*geometry.id(), divisions);
        if let Some(mesh) = self.0.lock().unwrap_or_else(PoisonError::into_inner).get(&key) {
            return Some(mesh.clone());
        }
        let mesh = Arc::new(mesh(geometry, divisions)?);
        let mut kept = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        if kept.len() >= MAX_KEPT_MESHES {
            kept.clear();
        }
        kept.insert(key, mesh.clone());
        Some(mesh)
    }
}

fn mesh(geometry: &Geometry, divisions: u32) -> Option<GetBodyMeshResponse> {
    let (directions, faces) = sphere(divisions);
    let of_body = |body: &Body| -> Vec<Vector3<f64>> {
        // Directions of the normalized frame, in which bodies are about round.
        directions.iter().map(|direction| body.boundary_along(direction)).collect()
    };
    let parts: Vec<Vec<Vector3<f64>>> = match geometry {
        Geometry::Solid(shape) => shape.parts().iter().map(of_body).collect(),
        Geometry::Ladder(ladder) => ladder.finest().parts().iter().map(of_body).collect(),
        Geometry::SosBody(body) => vec![directions.iter().map(|direction| outermost(body, direction)).collect()],
        Geometry::Capsule(capsule) => {
            let (radius, half) = (capsule.capsule().radius_m(), capsule.capsule().half_height_m());
            let onto = |n: &Vector3<f64>| n * radius + Vector3::z() * half.copysign(n.z);
            vec![directions.iter().map(onto).collect()]
        }
        Geometry::HalfSpace(_) => return None,
    };
    let (mut vertices, mut triangles, mut count) = (Packed::default(), Packed::default(), 0);
    for part in &parts {
        part.iter().for_each(|vertex| vertices.vector(Some(vertex)));
        for face in &faces {
            face.iter().for_each(|&corner| triangles.index(corner + count));
        }
        count += wire::count(part.len());
    }
    Some(GetBodyMeshResponse {
        vertices_m: vertices.into_bytes(),
        triangles: triangles.into_bytes(),
        vertex_count: count,
        triangle_count: wire::count(parts.len() * faces.len()),
    })
}

/// Where a ray from an interior point leaves a set for the last time: what is not seen from there
/// does not show.
fn outermost(body: &SosBody, direction: &Vector3<f64>) -> Vector3<f64> {
    const STEPS: u32 = 256;
    let (start, ball) = (body.interior_point(), body.circumscribed());
    let far = (ball.center - start).norm() + ball.radius;
    let at = |length: f64| start + direction * length;
    let step = far / f64::from(STEPS);
    let inside = (0..STEPS).rev().map(|k| f64::from(k) * step).find(|&length| body.value(&at(length)) <= 1.0);
    let (mut low, mut high) = (inside.unwrap_or(0.0), inside.unwrap_or(0.0) + step);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if body.value(&at(middle)) <= 1.0 { low = middle } else { high = middle }
    }
    at(low)
}

/// Unit vectors and the triangles between them, counter-clockwise seen from outside: an
/// icosahedron, each edge cut into so many pieces.
fn sphere(divisions: u32) -> (Vec<Vector3<f64>>, Vec<[u32; 3]>) {
    let golden = f64::midpoint(1.0, 5.0_f64.sqrt());
    let corners: Vec<Vector3<f64>> = (0..3)
        .flat_map(|axis| {
            [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)].map(|(one, long)| {
                let mut corner = Vector3::zeros();
                (corner[(axis + 1) % 3], corner[(axis + 2) % 3]) = (one, long);
                corner
            })
        })
        .collect();
    let is_edge = |a: usize, b: usize| (corners[a] - corners[b]).norm() < 2.1;
    let n = i32::try_from(divisions).unwrap_or(1).max(1);
    let (mut places, mut vertices, mut faces) = (HashMap::new(), Vec::new(), Vec::new());
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if !(is_edge(a, b) && is_edge(b, c) && is_edge(a, c)) {
                    continue;
                }
                let outward = (corners[b] - corners[a]).cross(&(corners[c] - corners[a])).dot(&corners[a]) > 0.0;
                let (b, c) = if outward { (b, c) } else { (c, b) };
                let mut vertex = |j: i32, k: i32| {
                    let weights = [(a, n - j - k), (b, j), (c, k)];
                    let point: Vector3<f64> = weights.iter().map(|&(i, w)| corners[i] * f64::from(w)).sum();
                    // Points on an edge belong to two faces.
                    let mut key: Vec<(usize, i32)> = weights.into_iter().filter(|(_, weight)| *weight > 0).collect();
                    key.sort_unstable();
                    *places.entry(key).or_insert_with(|| {
                        vertices.push(point.normalize());
                        wire::count(vertices.len() - 1)
                    })
                };
                for j in 0..n {
                    for k in 0..n - j {
                        faces.push([vertex(j, k), vertex(j + 1, k), vertex(j, k + 1)]);
                        if j + k + 1 < n {
                            faces.push([vertex(j + 1, k), vertex(j + 1, k + 1), vertex(j, k + 1)]);
                        }
                    }
                }
            }
        }
    }
    (vertices, faces)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::packed;
    use std::collections::HashSet;

    #[test]
    fn meshes_are_closed_and_lie_on_the_surface() {
        let cylinder = Body::cylinder("c", 0.3, 0.5).expect("a cylinder");
        let egg = Body::ellipsoid("e", Vector3::new(1.0, 0.0, 0.0), Vector3::new(1.0, 0.5, 0.2)).expect("an egg");
        for (body, divisions) in [(&cylinder, 1), (&cylinder, 8), (&egg, 5)] {
            let mesh = mesh(&body.clone().into(), divisions).expect("a mesh");
            let vertices = packed::rows::<3>(&mesh.vertices_m, "").expect("rows");
            let triangles = packed::indices::<3>(&mesh.triangles, "").expect("rows");
            assert_eq!(triangles.len(), 20 * (divisions * divisions) as usize);
            // Euler: a sphere.
            let edges: HashSet<(u32, u32)> = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).collect();
            assert_eq!(edges.len(), 3 * triangles.len(), "every edge once in each direction");
            assert!(edges.iter().all(|&(a, b)| edges.contains(&(b, a))), "closed");
            assert_eq!(vertices.len() + triangles.len(), edges.len() / 2 + 2);
            for vertex in &vertices {
                assert!((body.value(&Vector3::from(*vertex)) - 1.0).abs() < 1e-9);
            }
            // The volume inside is positive and at most the body's.
            let corner = |index: u32| Vector3::from(vertices[index as usize]);
            let volume: f64 =
                triangles.iter().map(|&[a, b, c]| corner(a).cross(&corner(b)).dot(&corner(c)) / 6.0).sum();
            assert!(volume > 0.3 * body.volume().volume_m3 && volume < body.volume().volume_m3 * (1.0 + 1e-9));
        }
    }
}
