//! What a user should know of a file that was read all the same.

use super::Mesh;
use crate::hull::convex_hull;
use nalgebra::Vector3;

/// What was left out of a file or is odd about it.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Remarks {
    /// Points left out since a coordinate of theirs was not finite.
    pub dropped_points: usize,
    /// Faces left out with them.
    pub dropped_faces: usize,
    /// Faces whose outlines cross themselves: no triangles are inside, the fan about the first
    /// corner was taken.
    pub crossing_faces: usize,
    /// Vertices that no triangle uses, of files with triangles; none where all are used.
    pub unused: Option<Unused>,
}

/// Vertices that no triangle uses.
#[derive(Clone, Debug, PartialEq)]
pub struct Unused {
    /// The vertices, metres.
    pub points: Vec<Vector3<f64>>,
    /// Whether they were left out of the mesh.
    pub dropped: bool,
}

/// What vertices that no triangle uses cost a body around all vertices.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnusedCost {
    /// Volume of the convex hull of all vertices, m³; none if they have no volume.
    pub hull_with_m3: Option<f64>,
    /// The same of those that triangles use.
    pub hull_without_m3: Option<f64>,
}

/// Relative change of the hull's volume that counts as rounding; dimensionless.
///
/// Hulls of the same vertices differ by about 1e-12. A larger value hides what stray vertices cost;
/// a smaller one reports rounding as a cost. Pinned by
/// `vertices_of_no_triangle_are_reported_with_their_cost`.
const NO_COST: f64 = 1e-9;

impl Unused {
    /// Looks for vertices that no triangle uses, and leaves them out if asked to.
    pub(super) fn find(mesh: &mut Mesh, drop: bool) -> Option<Self> {
        let is_used = mesh.are_used();
        if mesh.triangles.is_empty() || is_used.iter().all(|used| *used) {
            return None;
        }
        let mut places = vec![0; is_used.len()];
        let (mut used, mut unused) = (Vec::new(), Vec::new());
        for (corner, point) in mesh.points.iter().enumerate() {
            places[corner] = used.len();
            if is_used[corner] { used.push(*point) } else { unused.push(*point) }
        }
        if drop {
            mesh.points = used;
            mesh.triangles.iter_mut().flatten().for_each(|corner| *corner = places[*corner]);
        }
        Some(Self { points: unused, dropped: drop })
    }

    /// What they cost, or would have cost, in the mesh that they were found in.
    pub fn cost(&self, mesh: &Mesh) -> UnusedCost {
        let volume = |points: &[Vector3<f64>]| convex_hull(points).ok().map(|hull| hull.volume);
        let (with, without);
        if self.dropped {
            with = [&mesh.points[..], &self.points].concat();
            without = mesh.points.clone();
        } else {
            with = mesh.points.clone();
            let used = mesh.points.iter().zip(mesh.are_used()).filter(|(_, used)| *used);
            without = used.map(|(point, _)| *point).collect();
        }
        UnusedCost { hull_with_m3: volume(&with), hull_without_m3: volume(&without) }
    }

    fn sentence(&self, mesh: &Mesh) -> String {
        let count = self.points.len();
        let of = mesh.points.len() + if self.dropped { count } else { 0 };
        let UnusedCost { hull_with_m3, hull_without_m3 } = self.cost(mesh);
        let volume = |volume: Option<f64>| volume.map_or("no volume".to_owned(), |volume| format!("{volume:.4e} m³"));
        let (with, without) = (volume(hull_with_m3), volume(hull_without_m3));
        let growth = hull_with_m3.zip(hull_without_m3).map(|(with, without)| with / without);
        let what = match (self.dropped, growth) {
            (true, _) => format!(" and were left out; the convex hull has {without}, with them {with}"),
            (false, Some(growth)) if growth <= 1.0 + NO_COST => {
                "; they cost nothing, the convex hull is the same without them".to_owned()
            }
            (false, _) => format!(
                "; with them the convex hull has {with}, without them {without}: delete them, or leave them out by \
                 --drop-unused"
            ),
        };
        format!("{count} of {of} vertices belong to no triangle{what}")
    }
}

impl Remarks {
    /// One sentence for each remark about a mesh.
    pub fn sentences(&self, mesh: &Mesh) -> Vec<String> {
        let Self { dropped_points, dropped_faces, crossing_faces, unused } = self;
        let mut all = Vec::new();
        if *dropped_points > 0 {
            let faces =
                if *dropped_faces > 0 { format!(" and {dropped_faces} faces with them") } else { String::new() };
            all.push(format!("{dropped_points} points with coordinates that are not finite were left out{faces}"));
        }
        if *crossing_faces > 0 {
            all.push(format!(
                "{crossing_faces} faces have outlines that cross themselves; each was cut into the fan about its first \
                 corner"
            ));
        }
        all.extend(unused.as_ref().map(|unused| unused.sentence(mesh)));
        all
    }
}
