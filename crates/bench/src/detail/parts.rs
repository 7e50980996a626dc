//! Convex decompositions compared at equal numbers of parts: ours, the search by gain alone, and
//! V-HACD as parry has it (Mamou and Ghorbel, ICIP 2009).

use crate::comparison::{ComparisonError, Random};
use nalgebra::Vector3;
use parry3d_f64::math::{Pose, Vector};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{ConvexPolyhedron, TriMesh};
use parry3d_f64::transformation::vhacd::{VHACD, VHACDParameters};
use std::f64::consts::{PI, TAU};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use sublevel::fit::{FitError, Mesh, PartSearch, ReadOptions, convex_parts, hull::convex_hull, read_mesh};

/// Objects by name and file; the tube, which has none, is made.
pub(super) const OBJECTS: [(&str, &str); 7] = [
    ("shelf", "faults/shelf.off"),
    ("tube", ""),
    ("mug", "meshes/mbm_mug.off"),
    ("wingnut", "meshes/wingnut.off"),
    ("octopus", "psb/121.off"),
    ("chair", "psb/101.off"),
    ("hand", "psb/181.off"),
];
/// How many of them a quick run measures.
const QUICK_OBJECTS: usize = 3;

/// Numbers of parts.
const PARTS: [usize; 3] = [4, 8, 16];

/// Points sampled on the hulls of a decomposition.
const SAMPLES: usize = 4000;

/// Concavity limit of V-HACD, low enough that the number of parts ends its search.
const CONCAVITY: f64 = 1e-4;

/// Who divides an object.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Divider {
    Ours,
    Greedy,
    /// With this many voxels along the longest side.
    Vhacd(u32),
}

impl Divider {
    /// V-HACD twice: neither resolution is the better one for all objects.
    pub(super) const ALL: [Self; 4] = [Self::Ours, Self::Greedy, Self::Vhacd(64), Self::Vhacd(128)];

    pub(super) fn name(self) -> String {
        match self {
            Self::Ours => "ours".into(),
            Self::Greedy => "by gain alone".into(),
            Self::Vhacd(resolution) => format!("V-HACD {resolution}"),
        }
    }
}

/// A decomposition, measured.
#[derive(Clone, Debug)]
pub(super) struct Divided {
    pub(super) object: &'static str,
    pub(super) divider: Divider,
    pub(super) asked: usize,
    /// Parts with volume; none if the divider failed.
    pub(super) parts: usize,
    /// Total volume of the hulls, m³, and in volumes of the object's hull.
    pub(super) volume_m3: f64,
    pub(super) of_hull: f64,
    /// In volumes of the object; none of open meshes.
    pub(super) of_object: Option<f64>,
    /// Largest distance of a sample of the hulls from the object, metres, and in its diameters.
    pub(super) concavity_m: f64,
    pub(super) concavity: f64,
    /// Largest distance of a vertex of the object from the hulls, metres.
    pub(super) left_out_m: f64,
    pub(super) seconds: f64,
}

/// An object as it is measured against.
struct Object {
    name: &'static str,
    mesh: Mesh,
    surface: TriMesh,
    hull_m3: f64,
    diameter_m: f64,
    /// Volume inside; none of open meshes.
    own_m3: Option<f64>,
}

/// Divides all objects by all means.
///
/// # Errors
/// [`ComparisonError`].
pub(super) fn parts(
    data: &Path,
    quick: bool,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<Divided>, ComparisonError> {
    let (objects, counts) = if quick { (&OBJECTS[..QUICK_OBJECTS], &PARTS[..1]) } else { (&OBJECTS[..], &PARTS[..]) };
    let mut all = Vec::new();
    for &(name, file) in objects {
        let mesh = if file.is_empty() { tube() } else { read_mesh(&data.join(file), &ReadOptions::default())?.mesh };
        let object = Object::new(name, mesh)?;
        for &asked in counts {
            for divider in Divider::ALL {
                announce(&format!("{name}: {asked} parts, {}", divider.name()))?;
                let start = Instant::now();
                let points = object.divide(divider, asked)?.unwrap_or_default();
                let seconds = start.elapsed().as_secs_f64();
                all.push(object.measure(divider, asked, &points, seconds)?);
            }
        }
    }
    Ok(all)
}

fn parry(x: &Vector3<f64>) -> Vector {
    Vector::new(x.x, x.y, x.z)
}

impl Object {
    fn new(name: &'static str, mesh: Mesh) -> Result<Self, ComparisonError> {
        let points: Vec<Vector> = mesh.points.iter().map(parry).collect();
        let surface = TriMesh::new(points, indices(&mesh))
            .map_err(|error| ComparisonError::ParryMesh { mesh: name, what: error.to_string() })?;
        let hull = convex_hull(&mesh.points).map_err(|source| ComparisonError::Hull { mesh: name, source })?;
        let corners: Vec<_> = hull.vertices.iter().map(|&i| mesh.points[i]).collect();
        let apart = |a: &Vector3<f64>| corners.iter().map(|b| (b - a).norm()).fold(0.0, f64::max);
        let diameter_m = corners.iter().map(apart).fold(0.0, f64::max);
        let own_m3 = is_closed(&mesh).then(|| volume(&mesh).abs());
        Ok(Self { name, mesh, surface, hull_m3: hull.volume, diameter_m, own_m3 })
    }

    /// The points whose hulls are the parts; none where V-HACD panics.
    fn divide(&self, divider: Divider, parts: usize) -> Result<Option<Vec<Vec<Vector3<f64>>>>, ComparisonError> {
        let ours = |search| {
            convex_parts(&self.mesh, parts, search, &mut |_| ControlFlow::Continue(()))
                .map(Some)
                .map_err(|error: FitError| self.failed(divider, error))
        };
        match divider {
            Divider::Ours => ours(PartSearch::Best),
            Divider::Greedy => ours(PartSearch::Greedy),
            Divider::Vhacd(resolution) => Ok(self.vhacd(parts, resolution)),
        }
    }

    /// The exact hulls of V-HACD; none if it panics.
    fn vhacd(&self, parts: usize, resolution: u32) -> Option<Vec<Vec<Vector3<f64>>>> {
        let parameters = VHACDParameters {
            // Parry makes up to twice as many: it ends by the depth of its tree.
            max_convex_hulls: u32::try_from(parts.div_ceil(2)).ok()?,
            resolution,
            concavity: CONCAVITY,
            ..VHACDParameters::default()
        };
        let points: Vec<Vector> = self.mesh.points.iter().map(parry).collect();
        let hulls = std::panic::catch_unwind(|| {
            let found = VHACD::decompose(&parameters, &points, &indices(&self.mesh), true);
            found.compute_exact_convex_hulls(&points, &indices(&self.mesh))
        });
        let corners = |points: Vec<Vector>| points.iter().map(|x| Vector3::new(x.x, x.y, x.z)).collect();
        Some(hulls.ok()?.into_iter().map(|(points, _)| corners(points)).collect())
    }

    fn failed(&self, divider: Divider, what: impl ToString) -> ComparisonError {
        ComparisonError::Representation { mesh: self.name, method: divider.name(), what: what.to_string() }
    }

    fn measure(
        &self,
        divider: Divider,
        asked: usize,
        parts: &[Vec<Vector3<f64>>],
        seconds: f64,
    ) -> Result<Divided, ComparisonError> {
        let mut hulls = Vec::new();
        let mut volume_m3 = 0.0;
        for points in parts {
            // What is flat has no volume to count, and no surface to sample.
            let Ok(hull) = convex_hull(points) else { continue };
            let corners: Vec<Vector> = hull.vertices.iter().map(|&i| parry(&points[i])).collect();
            let solid = ConvexPolyhedron::from_convex_hull(&corners)
                .ok_or_else(|| self.failed(divider, "parry makes no hull of a part"))?;
            volume_m3 += hull.volume;
            hulls.push(solid);
        }
        let concavity_m = self.concavity(&hulls);
        let here = Pose::IDENTITY;
        let outside = |x: &Vector3<f64>| {
            let x = parry(x);
            hulls.iter().map(|hull| hull.distance_to_point(&here, x, true)).fold(f64::INFINITY, f64::min)
        };
        // Rounding leaves vertices of a hull some roundings outside.
        let left_out_m = self.mesh.points.iter().map(outside).fold(0.0, f64::max);
        Ok(Divided {
            object: self.name,
            divider,
            asked,
            parts: hulls.len(),
            volume_m3,
            of_hull: volume_m3 / self.hull_m3,
            of_object: self.own_m3.map(|own| volume_m3 / own),
            concavity_m,
            concavity: concavity_m / self.diameter_m,
            left_out_m: if left_out_m > 1e-9 * self.diameter_m { left_out_m } else { 0.0 },
            seconds,
        })
    }

    /// The largest distance of points on the hulls from the object, inside of which it is 0 (the
    /// concavity of Wei et al., SIGGRAPH 2022, from the hulls to the object).
    fn concavity(&self, hulls: &[ConvexPolyhedron]) -> f64 {
        let mut random = Random(1);
        let mut faces = Vec::new();
        for hull in hulls {
            let (points, triangles) = hull.to_trimesh();
            for triangle in triangles {
                let [a, b, c] = triangle.map(|corner| {
                    let x = points[corner as usize];
                    Vector3::new(x.x, x.y, x.z)
                });
                faces.push((a, b - a, c - a, (b - a).cross(&(c - a)).norm()));
            }
        }
        let total: f64 = faces.iter().map(|face| face.3).sum();
        let mut samples = Vec::new();
        let mut owed = 0.0;
        for (a, u, v, area) in faces {
            // In proportion to the area, remainders carried on.
            owed += SAMPLES as f64 * area / total;
            while owed > 0.0 {
                owed -= 1.0;
                let (s, t) = (random.positive(), random.positive());
                let (s, t) = if s + t > 1.0 { (1.0 - s, 1.0 - t) } else { (s, t) };
                samples.push(a + u * s + v * t);
            }
        }
        let here = Pose::IDENTITY;
        let mut far: Vec<(f64, Vector3<f64>)> =
            samples.into_iter().map(|x| (self.surface.distance_to_point(&here, parry(&x), false), x)).collect();
        far.sort_by(|a, b| b.0.total_cmp(&a.0));
        // The farthest that is not inside; what an open mesh encloses nothing says.
        let outside = |x: &Vector3<f64>| self.own_m3.is_none() || winding(&self.mesh, x).abs() < 0.5;
        far.iter().find(|(_, x)| outside(x)).map_or(0.0, |(distance, _)| distance.abs())
    }
}

fn indices(mesh: &Mesh) -> Vec<[u32; 3]> {
    mesh.triangles.iter().map(|triangle| triangle.map(|corner| corner as u32)).collect()
}

/// Volume inside a closed mesh, m³, negative if its triangles are clockwise seen from outside.
fn volume(mesh: &Mesh) -> f64 {
    let at = |corner: usize| mesh.points[corner];
    mesh.triangles.iter().map(|&[a, b, c]| at(a).dot(&at(b).cross(&at(c)))).sum::<f64>() / 6.0
}

/// Whether every edge is passed as often one way as the other.
fn is_closed(mesh: &Mesh) -> bool {
    sublevel::body::Piece::of_mesh(&mesh.points, &mesh.triangles).is_ok_and(|piece| piece.is_cycle())
}

/// Winding number of a closed mesh about a point, by solid angles (van Oosterom and Strackee,
/// 1983).
fn winding(mesh: &Mesh, x: &Vector3<f64>) -> f64 {
    let angle = |triangle: &[usize; 3]| {
        let [a, b, c] = triangle.map(|corner| mesh.points[corner] - x);
        let (p, q, r) = (a.norm(), b.norm(), c.norm());
        let below = p * q * r + a.dot(&b) * r + b.dot(&c) * p + c.dot(&a) * q;
        2.0 * a.dot(&b.cross(&c)).atan2(below)
    };
    mesh.triangles.iter().map(angle).sum::<f64>() / (4.0 * PI)
}

/// A tube of 10 cm, with a bore of 6 cm, 20 cm long, of 48 sides.
fn tube() -> Mesh {
    const SIDES: usize = 48;
    let ring = |radius: f64, z: f64| {
        (0..SIDES).map(move |i| {
            let (sin, cos) = (TAU * i as f64 / SIDES as f64).sin_cos();
            Vector3::new(radius * cos, radius * sin, z)
        })
    };
    // Rings in the order in which a section passes them.
    let rings = [(0.05, 0.0), (0.05, 0.2), (0.03, 0.2), (0.03, 0.0)];
    let points = rings.into_iter().flat_map(|(radius, z)| ring(radius, z)).collect();
    let quads = (0..4 * SIDES).flat_map(|k| {
        let (from, i) = (k / SIDES, k % SIDES);
        let (to, j) = ((from + 1) % 4, (i + 1) % SIDES);
        let [a, b, c, d] = [from * SIDES + i, from * SIDES + j, to * SIDES + j, to * SIDES + i];
        [[a, b, c], [a, c, d]]
    });
    Mesh { points, triangles: quads.collect() }
}

#[cfg(test)]
mod tests {
    use super::{Divider, Object, tube, volume, winding};
    use nalgebra::Vector3;
    use std::f64::consts::TAU;

    #[test]
    fn a_tube_is_measured_in_closed_form() {
        let area = |radius: f64| 24.0 * radius * radius * (TAU / 48.0).sin();
        let own = 0.2 * (area(0.05) - area(0.03));
        assert!((volume(&tube()) - own).abs() < 1e-12, "{} {own}", volume(&tube()));
        assert!(winding(&tube(), &Vector3::new(0.04, 0.0, 0.1)) > 0.99);
        assert!(winding(&tube(), &Vector3::new(0.0, 0.0, 0.1)).abs() < 1e-9);
        let object = Object::new("tube", tube()).unwrap();
        // Its hull leaves the middle of the ends 3 cm from the tube.
        let whole = object.measure(Divider::Ours, 1, std::slice::from_ref(&object.mesh.points), 0.0).unwrap();
        assert!((whole.of_hull - 1.0).abs() < 1e-9 && (whole.of_object.unwrap() - 0.2 * area(0.05) / own).abs() < 1e-9);
        assert!((0.027..=0.03).contains(&whole.concavity_m) && whole.left_out_m == 0.0, "{whole:?}");
        // Half of the points leave the other half out.
        let half: Vec<_> = object.mesh.points.iter().copied().filter(|x| x.x >= -1e-9).collect();
        let half = object.measure(Divider::Ours, 1, &[half], 0.0).unwrap();
        assert!((half.left_out_m - 0.05).abs() < 1e-3, "{half:?}");
        for divider in Divider::ALL {
            let parts = object.divide(divider, 8).unwrap().unwrap();
            let found = object.measure(divider, 8, &parts, 0.0).unwrap();
            assert!(found.parts <= 8 && found.of_object.unwrap() > 0.99 && found.concavity_m < 0.03, "{found:?}");
        }
    }
}
