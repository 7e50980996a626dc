//! Directions spread evenly over the unit sphere: a twice or more subdivided icosahedron, or a
//! lattice of any count.

use nalgebra::Vector3;
use std::collections::HashMap;
use std::f64::consts::PI;
use std::sync::OnceLock;

/// `count` unit vectors in equal steps of height from the north pole down, each turned from the
/// last by the golden angle. The first half are spread evenly over the northern hemisphere.
pub fn fibonacci_lattice(count: usize) -> impl Iterator<Item = Vector3<f64>> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    (0..count).map(move |i| {
        let z = 1.0 - (2 * i + 1) as f64 / count as f64;
        let (sin, cos) = (golden_angle * i as f64).sin_cos();
        let across = (1.0 - z * z).sqrt();
        Vector3::new(across * cos, across * sin, z)
    })
}

/// A triangulated unit sphere.
#[derive(Clone, Debug)]
pub struct Sphere {
    vertices: Vec<Vector3<f64>>,
    triangles: Vec<[usize; 3]>,
    covering_cosine: f64,
}

impl Sphere {
    /// The icosahedron with every triangle split into four `levels` times: 12, 42, 162, 642, ...
    /// vertices.
    ///
    /// Triangles are counter-clockwise seen from outside.
    pub fn subdivided(levels: usize) -> Self {
        let (mut vertices, mut triangles) = icosahedron();
        for _ in 0..levels {
            let mut midpoints: HashMap<(usize, usize), usize> = HashMap::new();
            let mut finer = Vec::with_capacity(4 * triangles.len());
            for &[a, b, c] in &triangles {
                let mut middle = |i: usize, j: usize| {
                    *midpoints.entry((i.min(j), i.max(j))).or_insert_with(|| {
                        vertices.push((vertices[i] + vertices[j]).normalize());
                        vertices.len() - 1
                    })
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        // Within a spherical triangle the point farthest from all corners is its circumcentre.
        let covering_cosine = triangles
            .iter()
            .map(|&[a, b, c]| {
                let normal = (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a])).normalize();
                normal.dot(&vertices[a])
            })
            .fold(1.0, f64::min)
            - 1e-12;
        Self { vertices, triangles, covering_cosine }
    }

    /// The 162 directions used for the bounds of every body.
    pub(super) fn shared() -> &'static Self {
        static SPHERE: OnceLock<Sphere> = OnceLock::new();
        SPHERE.get_or_init(|| Self::subdivided(2))
    }

    /// The 642 directions of outlines.
    pub(super) fn fine() -> &'static Self {
        static SPHERE: OnceLock<Sphere> = OnceLock::new();
        SPHERE.get_or_init(|| Self::subdivided(3))
    }

    /// Unit vectors.
    pub fn vertices(&self) -> &[Vector3<f64>] {
        &self.vertices
    }

    /// Triangles as indices of vertices.
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// Cosine of the covering angle: every direction is within that angle of some vertex (rounded
    /// down).
    pub fn covering_cosine(&self) -> f64 {
        self.covering_cosine
    }
}

fn icosahedron() -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
    let golden = 0.5 * (1.0 + 5.0_f64.sqrt());
    let mut vertices = Vec::with_capacity(12);
    for axis in 0..3 {
        for (one, phi) in [(1.0, golden), (1.0, -golden), (-1.0, golden), (-1.0, -golden)] {
            let mut vertex = Vector3::zeros();
            vertex[axis] = one;
            vertex[(axis + 1) % 3] = phi;
            vertices.push(vertex.normalize());
        }
    }
    // Faces are the triples of mutual neighbours; neighbours are at the cosine 1/√5.
    let adjacent = |i: usize, j: usize| vertices[i].dot(&vertices[j]) > 0.4;
    let mut triangles = Vec::with_capacity(20);
    for a in 0..12 {
        for b in a + 1..12 {
            for c in b + 1..12 {
                if adjacent(a, b) && adjacent(b, c) && adjacent(a, c) {
                    let outward =
                        (vertices[b] - vertices[a]).cross(&(vertices[c] - vertices[a])).dot(&vertices[a]) > 0.0;
                    triangles.push(if outward { [a, b, c] } else { [a, c, b] });
                }
            }
        }
    }
    (vertices, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn subdivision_keeps_a_closed_outward_sphere() {
        for (levels, vertices) in [(0, 12), (1, 42), (2, 162), (3, 642)] {
            let sphere = Sphere::subdivided(levels);
            assert_eq!(sphere.vertices().len(), vertices);
            assert_eq!(sphere.triangles().len(), 2 * vertices - 4);
            let volume: f64 = sphere
                .triangles()
                .iter()
                .map(|&[a, b, c]| {
                    let v = sphere.vertices();
                    v[a].dot(&v[b].cross(&v[c])) / 6.0
                })
                .sum();
            assert!(volume > 2.5 && volume < 4.19, "{volume}");
        }
    }

    #[test]
    fn covering_angle_covers() {
        let sphere = Sphere::subdivided(2);
        let mut worst = 1.0_f64;
        for i in 0..20_000 {
            let (a, z) = (f64::from(i) * 2.399_963, 1.0 - (f64::from(i) + 0.5) / 10_000.0);
            let r = (1.0 - z * z).sqrt();
            let u = Vector3::new(r * a.cos(), r * a.sin(), z);
            worst = worst.min(sphere.vertices().iter().map(|v| v.dot(&u)).fold(-1.0, f64::max));
        }
        assert!(worst >= sphere.covering_cosine(), "{worst} against {}", sphere.covering_cosine());
        assert!(worst < sphere.covering_cosine() + 1e-3);
    }
}
