//! Pieces of a mesh: what planes leave of it, closed again where they cut.
//!
//! A piece is a chain of triangles. A plane divides it into one piece below and one above:
//! triangles with corners on both sides are split at points of their edges, and where a closed
//! piece was cut open both sides get a cap, with opposite orientation. Two things follow, whatever
//! the plane and however coarsely its side of a corner was decided:
//!
//! - **The surface** lies in the hulls of the pieces: a triangle is the union of those it is split
//!   into, and each piece has its own among its triangles.
//! - **The interior** of a closed mesh, where its winding number is not 0, does so too. As chains,
//!   the mesh is the sum of its pieces: caps cancel. Each is a cycle, as the boundary of a cap is
//!   what the cut leaves of the piece's own. So the winding numbers about a point add up, and where
//!   the mesh's is not 0 that of some piece is not either. But about a point outside its hull a
//!   cycle has winding number 0. (On the triangles themselves it is not defined; hulls are closed,
//!   and these points limits of others.)
//!
//! Neither needs the points to lie on the plane, only on the edges they split. In floating point
//! they do not even do that. What a [`Spot`] stands for is the exact point `p + t (q - p)` of the
//! edge between the exact points p and q, t the rounded number that was used; its coordinates are
//! known to be within a radius of it, which grows by a few roundings with each cut. So the claims
//! hold for convex sets that contain not the spots alone but balls of their radii.

use super::cap::{MOST_CORNERS, cap};
use super::spot::Spot;
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Distance from a plane, relative to the size of the piece, below which a spot counts as on it
/// when caps are sections; dimensionless.
///
/// Coordinates of cut points round at about 1e-15, and planes are placed at corners only up to
/// that. A smaller value splits triangles into slivers beside the plane; a larger one takes thin
/// features for part of the plane. Pinned by `corners_near_a_plane_are_on_it`.
const ON_PLANE: f64 = 1e-9;

/// Why triangles are no mesh.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MeshError {
    /// No triangles.
    #[error("the mesh has no triangles; a compound is made of those, a single body of points")]
    NoTriangles,
    /// A corner that does not exist.
    #[error("triangle {triangle} (counted from 0) names point {point} of {points}; repair the mesh")]
    Corner {
        /// The triangle.
        triangle: usize,
        /// The point it names.
        point: usize,
        /// How many points there are.
        points: usize,
    },
    /// A coordinate is not finite.
    #[error("point {0} (counted from 0) has a NaN or infinite coordinate; remove it or repair the mesh")]
    NotFinite(usize),
}

/// What closes a piece again where a plane has cut it open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Caps {
    /// Cones over what the cut leaves of the boundary, one over each part that hangs together: they
    /// can reach across a hole.
    Cones,
    /// The section with the plane, triangulated; cones where it has more than a few thousand
    /// corners.
    Sections,
    /// Nothing: the pieces are open. They have the spots that they have with sections.
    Missing,
}

/// A chain of triangles; each spot is a corner of some.
#[derive(Clone, Debug, Default)]
pub struct Piece {
    spots: Vec<Spot>,
    triangles: Vec<[usize; 3]>,
    closed: bool,
}

impl Piece {
    /// The whole mesh, points with equal coordinates taken for one.
    ///
    /// # Errors
    /// [`MeshError`] for triangles that are none.
    pub fn of_mesh(points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> Result<Self, MeshError> {
        if triangles.is_empty() {
            return Err(MeshError::NoTriangles);
        }
        if let Some(index) = points.iter().position(|x| !x.iter().all(|value| value.is_finite())) {
            return Err(MeshError::NotFinite(index));
        }
        let mut known = HashMap::new();
        let mut piece = Self::default();
        for (triangle, corners) in triangles.iter().enumerate() {
            if let Some(&point) = corners.iter().find(|&&corner| corner >= points.len()) {
                return Err(MeshError::Corner { triangle, point, points: points.len() });
            }
            piece.triangles.push(corners.map(|corner| {
                // + 0.0 makes the two zeros one key.
                let x = points[corner].add_scalar(0.0);
                *known.entry([x.x.to_bits(), x.y.to_bits(), x.z.to_bits()]).or_insert_with(|| {
                    piece.spots.push(Spot { x, radius: 0.0 });
                    piece.spots.len() - 1
                })
            }));
        }
        piece.closed = piece.is_cycle();
        Ok(piece)
    }

    /// The piece of some triangles between spots, with those that it needs.
    pub(super) fn of_triangles(spots: &[Spot], triangles: Vec<[usize; 3]>) -> Self {
        let mut piece = Self::compact(spots, triangles, false);
        piece.closed = piece.is_cycle();
        piece
    }

    /// Corners of the triangles.
    pub fn spots(&self) -> &[Spot] {
        &self.spots
    }

    /// Triangles as indices of spots.
    pub fn triangles(&self) -> &[[usize; 3]] {
        &self.triangles
    }

    /// Whether the chain is a cycle: every edge is passed as often one way as the other.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Largest radius of a spot, metres.
    pub fn uncertainty(&self) -> f64 {
        self.spots.iter().map(|spot| spot.radius).fold(0.0, f64::max)
    }

    /// The pieces where `normal·x < height` and where not. Either may be empty.
    pub fn cut(&self, normal: &Vector3<f64>, height: f64) -> [Self; 2] {
        let mut spots = self.spots.clone();
        let heights: Vec<f64> = spots.iter().map(|spot| normal.dot(&spot.x) - height).collect();
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            let (a, b) = (a.min(b), a.max(b));
            *middles.entry((a, b)).or_insert_with(|| {
                // One height is negative, the other is not.
                let t = heights[a] / (heights[a] - heights[b]);
                spots.push(Spot::between(&spots[a], &spots[b], t));
                spots.len() - 1
            })
        };
        let mut sides = [Vec::new(), Vec::new()];
        // Edges between cut points, as the boundary of what is below passes them.
        let mut chords = Vec::new();
        for triangle in &self.triangles {
            let above = triangle.map(|corner| usize::from(heights[corner] >= 0.0));
            let Some(lone) = (0..3).find(|&i| above[i] != above[(i + 1) % 3] && above[i] != above[(i + 2) % 3]) else {
                sides[above[0]].push(*triangle);
                continue;
            };
            let [a, b, c] = [0, 1, 2].map(|i| triangle[(lone + i) % 3]);
            let (p, q) = (middle(a, b), middle(a, c));
            sides[above[lone]].push([a, p, q]);
            sides[1 - above[lone]].extend([[p, b, c], [p, c, q]]);
            chords.push(if above[lone] == 0 { (p, q) } else { (q, p) });
        }
        if self.closed {
            cone(&mut sides, &chords);
        }
        sides.map(|triangles| Self::compact(&spots, triangles, self.closed))
    }

    /// As [`Piece::cut`], with other caps, and more exactly along faces: spots that are near the
    /// plane, in proportion to the piece, are on it and belong to both sides.
    pub fn cut_with(&self, normal: &Vector3<f64>, height: f64, caps: Caps) -> [Self; 2] {
        if caps == Caps::Cones {
            return self.cut(normal, height);
        }
        let mut spots = self.spots.clone();
        let heights = self.heights(normal, height);
        let mut middles = HashMap::new();
        let mut middle = |a: usize, b: usize| {
            let (a, b) = (a.min(b), a.max(b));
            *middles.entry((a, b)).or_insert_with(|| {
                let t = heights[a] / (heights[a] - heights[b]);
                spots.push(Spot::between(&spots[a], &spots[b], t));
                spots.len() - 1
            })
        };
        let mut sides = [Vec::new(), Vec::new()];
        let mut flat = Vec::new();
        for triangle in &self.triangles {
            let signs = triangle.map(|corner| heights[corner].partial_cmp(&0.0).unwrap_or(Ordering::Equal));
            let [below, above] = [Ordering::Less, Ordering::Greater].map(|sign| signs.contains(&sign));
            match (below, above) {
                (false, false) => flat.push(*triangle),
                (true, false) => sides[0].push(*triangle),
                (false, true) => sides[1].push(*triangle),
                (true, true) => {
                    let of = |i: usize| usize::from(signs[i] == Ordering::Greater);
                    if let Some(i) = signs.iter().position(|&sign| sign == Ordering::Equal) {
                        let [on, b, c] = [0, 1, 2].map(|k| triangle[(i + k) % 3]);
                        let p = middle(b, c);
                        sides[of((i + 1) % 3)].push([on, b, p]);
                        sides[of((i + 2) % 3)].push([on, p, c]);
                    } else if let Some(i) = (0..3).find(|&i| of(i) != of((i + 1) % 3) && of(i) != of((i + 2) % 3)) {
                        let [a, b, c] = [0, 1, 2].map(|k| triangle[(i + k) % 3]);
                        let (p, q) = (middle(a, b), middle(a, c));
                        sides[of(i)].push([a, p, q]);
                        sides[1 - of(i)].extend([[p, b, c], [p, c, q]]);
                    }
                }
            }
        }
        if !flat.is_empty() {
            let inward = self.signed_volume() < 0.0;
            for triangle in flat {
                // A face in the plane belongs to the side where the solid behind it is.
                let [a, b, c] = triangle.map(|corner| spots[corner].x);
                let up = (b - a).cross(&(c - a)).dot(normal) >= 0.0;
                sides[usize::from(up == inward)].push(triangle);
            }
        }
        let closed = self.closed && caps == Caps::Sections;
        if closed {
            // The piece is a cycle: what bounds one side bounds the other, passed the other way.
            let chords: Vec<(usize, usize)> = boundary(&sides[0]).collect();
            if chords.len() <= MOST_CORNERS {
                let section = cap(&spots, &chords, normal);
                sides[0].extend(&section);
                sides[1].extend(section.iter().map(|&[a, b, c]| [a, c, b]));
            } else {
                cone(&mut sides, &chords);
            }
        }
        sides.map(|triangles| Self::compact(&spots, triangles, closed))
    }

    /// Whether [`Piece::cut_with`] leaves the piece whole, below the plane (0) or above it (1);
    /// none if it is divided.
    pub fn side(&self, normal: &Vector3<f64>, height: f64) -> Option<usize> {
        let heights = self.heights(normal, height);
        let [below, above] = [heights.iter().any(|&h| h < 0.0), heights.iter().any(|&h| h > 0.0)];
        (!(below && above)).then_some(usize::from(above))
    }

    /// Heights of the spots above a plane, 0 near it.
    fn heights(&self, normal: &Vector3<f64>, height: f64) -> Vec<f64> {
        let ends = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        let [low, high] = self.spots.iter().fold(ends, |[low, high], spot| [low.inf(&spot.x), high.sup(&spot.x)]);
        let near = ON_PLANE * (high - low).norm();
        let above = |spot: &Spot| normal.dot(&spot.x) - height;
        self.spots.iter().map(above).map(|h| if h.abs() <= near { 0.0 } else { h }).collect()
    }

    /// Volume inside a closed piece, negative if its triangles are clockwise seen from outside.
    pub fn signed_volume(&self) -> f64 {
        let Some(origin) = self.spots.first() else { return 0.0 };
        let at = |corner: usize| self.spots[corner].x - origin.x;
        self.triangles.iter().map(|&[a, b, c]| at(a).dot(&at(b).cross(&at(c)))).sum::<f64>() / 6.0
    }

    /// The piece of some triangles, with the spots that they need.
    fn compact(spots: &[Spot], mut triangles: Vec<[usize; 3]>, closed: bool) -> Self {
        let mut places = vec![usize::MAX; spots.len()];
        let mut kept = Vec::new();
        for corner in triangles.iter_mut().flatten() {
            if places[*corner] == usize::MAX {
                places[*corner] = kept.len();
                kept.push(spots[*corner]);
            }
            *corner = places[*corner];
        }
        Self { spots: kept, triangles, closed }
    }

    /// Whether every edge is passed as often one way as the other, counted.
    pub fn is_cycle(&self) -> bool {
        boundary(&self.triangles).next().is_none()
    }
}

/// Edges that triangles pass more often one way than the other, in their order, as often as they
/// do.
fn boundary(triangles: &[[usize; 3]]) -> impl Iterator<Item = (usize, usize)> {
    let mut passes: HashMap<(usize, usize), i64> = HashMap::new();
    for &[a, b, c] in triangles {
        for (p, q) in [(a, b), (b, c), (c, a)] {
            *passes.entry((p.min(q), p.max(q))).or_default() += (q as i64 - p as i64).signum();
        }
    }
    let mut passes: Vec<_> = passes.into_iter().filter(|&(_, net)| net != 0).collect();
    passes.sort_unstable();
    passes.into_iter().flat_map(|((low, high), net)| {
        let chord = if net > 0 { (low, high) } else { (high, low) };
        std::iter::repeat_n(chord, net.unsigned_abs() as usize)
    })
}

/// Closes both sides of a cut by cones over the chords, which pass the boundary of what is below.
fn cone(sides: &mut [Vec<[usize; 3]>; 2], chords: &[(usize, usize)]) {
    let apex = apexes(chords);
    for &(p, q) in chords {
        let apex = apex[&p];
        if apex != p && apex != q {
            sides[0].push([apex, q, p]);
            sides[1].push([apex, p, q]);
        }
    }
}

/// For each end of a chord one end of the chords it hangs together with: each loop gets a cap of
/// its own, or caps would reach from one limb of an object to the next.
fn apexes(chords: &[(usize, usize)]) -> HashMap<usize, usize> {
    let mut neighbours: HashMap<usize, Vec<usize>> = HashMap::new();
    for &(p, q) in chords {
        neighbours.entry(p).or_default().push(q);
        neighbours.entry(q).or_default().push(p);
    }
    let mut apexes = HashMap::new();
    for &(apex, _) in chords {
        let mut open = vec![apex];
        while let Some(end) = open.pop() {
            if let Entry::Vacant(place) = apexes.entry(end) {
                place.insert(apex);
                open.extend(&neighbours[&end]);
            }
        }
    }
    apexes
}

#[cfg(test)]
mod tests;
