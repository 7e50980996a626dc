//! Triangles of a planar polygon, with or without holes.
//!
//! Where the fan about the first corner turns one way, as seen along the vector area of the outline
//! (Newell's normal), it lies inside the outline and is taken. Else the polygon is projected along
//! the axis nearest to that normal and triangulated inside its loops by a constrained Delaunay
//! triangulation (`spade`, with exact predicates): a face is inside where the way there from
//! outside passes an odd number of edges of the loops. Corners in the middle of an edge are kept,
//! so that the triangles of neighbours meet edge to edge and closed meshes stay closed.

use nalgebra::Vector3;
use spade::handles::FixedVertexHandle;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation, mitigate_underflow};
use std::collections::HashMap;

/// Edges that the loops may be divided into by corners on them, for each corner.
const EDGES_PER_CORNER: usize = 64;

/// Area of an outline below which it counts as flat, relative to the square of its size;
/// dimensionless.
///
/// Areas of coordinates in double precision round at about 1e-16, and of those in single precision
/// they are no less exact, being computed from the same numbers. A smaller value triangulates along
/// a direction that rounding chose; a larger one fans slender faces. Pinned by
/// `slender_outlines_are_triangulated_and_flat_ones_fanned`.
const FLAT_AREA: f64 = 1e-12;

/// Adds the triangles of a polygon, an outline and loops around holes, oriented as the outline is.
/// Loops of fewer than three corners enclose nothing.
///
/// Returns false where loops cross themselves or each other, so that no inside is defined: the
/// triangles are then the fan of the outline, whose boundary is the outline, and holes are filled.
pub(super) fn triangulate(points: &[Vector3<f64>], loops: &[&[usize]], triangles: &mut Vec<[usize; 3]>) -> bool {
    let mut loops = loops.iter().map(|corners| without_repeats(corners));
    let Some(outline) = loops.next().filter(|corners| corners.len() >= 3) else { return true };
    let holes: Vec<Vec<usize>> = loops.filter(|corners| corners.len() >= 3).collect();
    let area = vector_area(points, &outline);
    // An outline without area, but for rounding, encloses nothing.
    let is_flat = holes.is_empty() && !(area.norm() > FLAT_AREA * size(points, &outline).powi(2));
    if is_flat || holes.is_empty() && (outline.len() == 3 || turns_one_way(points, &outline, &area)) {
        triangles.extend(fan(&outline));
        return true;
    }
    let inside = inside(points, &outline, &holes, &area);
    let is_simple = inside.is_some();
    triangles.extend(inside.unwrap_or_else(|| fan(&outline).collect()));
    is_simple
}

/// The corners of a loop, without those that repeat the one before.
fn without_repeats(corners: &[usize]) -> Vec<usize> {
    let mut kept = corners.to_vec();
    kept.dedup();
    while kept.len() > 1 && kept.first() == kept.last() {
        kept.pop();
    }
    kept
}

/// Largest coordinate of the corners as seen from the first.
fn size(points: &[Vector3<f64>], corners: &[usize]) -> f64 {
    let origin = corners.first().map_or_else(Vector3::zeros, |&first| points[first]);
    corners.iter().map(|&corner| (points[corner] - origin).amax()).fold(0.0, f64::max)
}

fn fan(outline: &[usize]) -> impl Iterator<Item = [usize; 3]> {
    outline[1..].windows(2).map(|edge| [outline[0], edge[0], edge[1]])
}

/// Twice the vector area of a triangle.
fn cross(points: &[Vector3<f64>], [a, b, c]: [usize; 3]) -> Vector3<f64> {
    (points[b] - points[a]).cross(&(points[c] - points[a]))
}

/// Twice the vector area of an outline.
fn vector_area(points: &[Vector3<f64>], outline: &[usize]) -> Vector3<f64> {
    fan(outline).map(|triangle| cross(points, triangle)).sum()
}

/// Whether no triangle of the fan is turned against the outline.
fn turns_one_way(points: &[Vector3<f64>], outline: &[usize], area: &Vector3<f64>) -> bool {
    fan(outline).all(|triangle| cross(points, triangle).dot(area) >= 0.0)
}

/// The triangles inside the loops; none where loops cross.
fn inside(
    points: &[Vector3<f64>],
    outline: &[usize],
    holes: &[Vec<usize>],
    area: &Vector3<f64>,
) -> Option<Vec<[usize; 3]>> {
    // Along an axis and by powers of two, so that coordinates that are exact stay so, and a corner
    // that lies on an edge still does.
    let axis = area.iamax();
    let (mut right, mut up) = ((axis + 1) % 3, (axis + 2) % 3);
    if area[axis] < 0.0 {
        std::mem::swap(&mut right, &mut up);
    }
    let loops = || std::iter::once(outline).chain(holes.iter().map(Vec::as_slice));
    let origin = points[outline[0]];
    let all: Vec<usize> = loops().flatten().copied().collect();
    let unit = size(points, &all).log2().floor().exp2();
    let project = |corner: usize| {
        let offset = (points[corner] - origin) / unit;
        mitigate_underflow(Point2::new(offset[right], offset[up]))
    };

    let mut plane = ConstrainedDelaunayTriangulation::<Point2<f64>>::new();
    let mut handles: HashMap<usize, FixedVertexHandle> = HashMap::new();
    let mut corners: HashMap<FixedVertexHandle, usize> = HashMap::new();
    // In no order: along a curve each point would change the triangles of all before it.
    let mut shuffled = all;
    shuffled.sort_by_key(|corner| (*corner as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15));
    shuffled.dedup();
    let corner_count = shuffled.len();
    for corner in shuffled {
        let handle = plane.insert(project(corner)).ok()?;
        handles.insert(corner, handle);
        // Points above each other have one place in the plane: no triangle there is one of both.
        let known = *corners.entry(handle).or_insert(corner);
        if points[known] != points[corner] {
            return None;
        }
    }
    let mut budget = EDGES_PER_CORNER * corner_count;
    // How often the loops pass each edge.
    let mut passes: HashMap<[usize; 2], usize> = HashMap::new();
    for corners in loops() {
        for (index, from) in corners.iter().enumerate() {
            let (from, to) = (handles[from], handles[&corners[(index + 1) % corners.len()]]);
            if from == to {
                continue;
            }
            let edges = plane.try_add_constraint(from, to);
            if edges.is_empty() {
                return None;
            }
            // Edges through many corners: loops that overlap themselves.
            budget = budget.checked_sub(edges.len())?;
            for edge in edges {
                let ends = plane.directed_edge(edge).vertices().map(|vertex| vertex.fix());
                *passes.entry(undirected(ends)).or_default() += 1;
            }
        }
    }

    let mut is_inside = HashMap::from([(plane.outer_face().fix().index(), false)]);
    let hull = plane.convex_hull().map(|edge| if edge.face().is_outer() { edge } else { edge.rev() });
    // Edges whose own face is known, and that of the other side is not.
    let mut open: Vec<_> = hull.collect();
    while let Some(edge) = open.pop() {
        let beyond = edge.rev().face();
        if is_inside.contains_key(&beyond.fix().index()) {
            continue;
        }
        let ends = undirected(edge.vertices().map(|vertex| vertex.fix()));
        let crosses = passes.get(&ends).is_some_and(|count| count % 2 == 1);
        is_inside.insert(beyond.fix().index(), is_inside[&edge.face().fix().index()] != crosses);
        let around = [edge.rev(), edge.rev().next(), edge.rev().prev()];
        open.extend(around);
    }
    let faces = plane.inner_faces().filter(|face| is_inside.get(&face.fix().index()) == Some(&true));
    let triangle = faces.map(|face| face.vertices().map(|vertex| corners[&vertex.fix()]));
    Some(triangle.collect())
}

fn undirected(ends: [FixedVertexHandle; 2]) -> [usize; 2] {
    let [a, b] = ends.map(|vertex| vertex.index());
    [a.min(b), a.max(b)]
}

#[cfg(test)]
mod tests {
    use super::triangulate;
    use nalgebra::{Rotation3, Vector3};
    use std::collections::HashMap;
    use sublevel_testkit::Seeded;

    /// Twice the vector area of triangles, and the sum of the lengths of those.
    fn areas(points: &[Vector3<f64>], triangles: &[[usize; 3]]) -> (Vector3<f64>, f64) {
        let areas = triangles.iter().map(|t| super::cross(points, *t));
        areas.fold((Vector3::zeros(), 0.0), |(sum, total), area| (sum + area, total + area.norm()))
    }

    /// Edges of the triangles less those of the loops: empty if the triangles are bounded by the
    /// loops.
    fn boundary(triangles: &[[usize; 3]], loops: &[&[usize]]) -> HashMap<(usize, usize), i32> {
        let mut passes = HashMap::new();
        let mut pass = |a: usize, b: usize, sign: i32| {
            *passes.entry((a.min(b), a.max(b))).or_default() += if a < b { sign } else { -sign };
        };
        for [a, b, c] in triangles {
            [(*a, *b), (*b, *c), (*c, *a)].into_iter().for_each(|(a, b)| pass(a, b, 1));
        }
        for corners in loops {
            (0..corners.len()).for_each(|i| pass(corners[i], corners[(i + 1) % corners.len()], -1));
        }
        passes.retain(|(a, b), net| a != b && *net != 0);
        passes
    }

    fn check(points: &[Vector3<f64>], loops: &[&[usize]], area: f64) {
        let mut triangles = Vec::new();
        assert!(triangulate(points, loops, &mut triangles), "{loops:?}");
        let (sum, total) = areas(points, &triangles);
        // All turn one way, so none overlaps another or spills over.
        assert!((sum.norm() - 2.0 * area).abs() < 1e-9 * area, "{} for {area}", sum.norm() / 2.0);
        assert!((total - sum.norm()).abs() < 1e-9 * area, "{total} {}", sum.norm());
        assert!(boundary(&triangles, loops).is_empty(), "{loops:?}: {triangles:?}");
    }

    /// Placed in space where no axis fits.
    fn placed(outline: &[[f64; 2]]) -> Vec<Vector3<f64>> {
        let turn = Rotation3::from_euler_angles(0.4, -0.3, 0.9);
        outline.iter().map(|[x, y]| turn * Vector3::new(*x, *y, 0.7)).collect()
    }

    #[test]
    fn concave_outlines_are_filled_and_no_more() {
        let letter = placed(&[[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]);
        for first in 0..6 {
            let outline: Vec<usize> = (0..6).map(|i| (first + i) % 6).collect();
            check(&letter, &[&outline], 5.0);
            let reversed: Vec<usize> = outline.iter().rev().copied().collect();
            check(&letter, &[&reversed], 5.0);
        }
        // A corner in the middle of an edge stays a corner.
        let split = placed(&[[0.0, 0.0], [1.5, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]]);
        check(&split, &[&[0, 1, 2, 3, 4, 5, 6]], 5.0);
        check(&split, &[&[0, 0, 1, 2, 3, 4, 4, 5, 6, 0]], 5.0);
    }

    #[test]
    fn random_stars_are_filled() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let count = 4 + seed as usize % 40;
            let radii: Vec<f64> = (0..count).map(|_| 0.1 + random.signed().abs()).collect();
            let angle = |i: usize| std::f64::consts::TAU * i as f64 / count as f64;
            let outline: Vec<_> = (0..count).map(|i| [radii[i] * angle(i).cos(), radii[i] * angle(i).sin()]).collect();
            let wedge = (std::f64::consts::TAU / count as f64).sin();
            let area = 0.5 * wedge * (0..count).map(|i| radii[i] * radii[(i + 1) % count]).sum::<f64>();
            println!("seed {seed}");
            check(&placed(&outline), &[&(0..count).collect::<Vec<_>>()], area);
        }
    }

    #[test]
    fn holes_stay_open() {
        let frame = [[0.0, 0.0], [4.0, 0.0], [4.0, 4.0], [0.0, 4.0], [1.0, 1.0], [1.0, 3.0], [3.0, 3.0], [3.0, 1.0]];
        let points = placed(&frame);
        check(&points, &[&[0, 1, 2, 3], &[4, 5, 6, 7]], 12.0);
        // The same as one outline with a bridge that is passed both ways.
        check(&points, &[&[0, 1, 2, 3, 0, 4, 5, 6, 7, 4]], 12.0);
        let mut triangles = Vec::new();
        assert!(triangulate(&points, &[&[0, 1, 2, 3], &[7, 6, 5, 4]], &mut triangles));
        assert!((areas(&points, &triangles).1 - 24.0).abs() < 1e-9, "however the hole turns");
    }

    #[test]
    fn slender_outlines_are_triangulated_and_flat_ones_fanned() {
        let outline = |h: f64| placed(&[[0.0, 0.0], [4.0, 0.0], [4.0, h], [2.0, 0.25 * h], [0.0, h]]);
        let mut triangles = Vec::new();
        assert!(triangulate(&outline(1e-9), &[&[0, 1, 2, 3, 4]], &mut triangles));
        assert_ne!(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
        triangles.clear();
        assert!(triangulate(&outline(1e-13), &[&[0, 1, 2, 3, 4]], &mut triangles));
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3], [0, 3, 4]]);
    }

    #[test]
    fn crossing_outlines_become_fans_and_say_so() {
        let bow = placed(&[[0.0, 0.0], [2.0, 2.0], [2.0, 0.0], [0.0, 3.0]]);
        let mut triangles = Vec::new();
        assert!(!triangulate(&bow, &[&[0, 1, 2, 3]], &mut triangles));
        assert_eq!(triangles, [[0, 1, 2], [0, 2, 3]]);
        // Without area nothing is inside, and nothing crosses.
        let line = placed(&[[0.0, 0.0], [1.0, 0.0], [2.0, 0.0], [3.0, 0.0]]);
        triangles.clear();
        assert!(triangulate(&line, &[&[0, 2, 1, 3]], &mut triangles));
        for short in [&[][..], &[0], &[0, 1], &[0, 0, 1, 1]] {
            triangles.clear();
            assert!(triangulate(&line, &[short], &mut triangles) && triangles.is_empty());
        }
        assert!(triangulate(&line, &[], &mut triangles));
    }

    #[test]
    fn corners_on_edges_and_lines_keep_their_boundary() {
        // A corner exactly on another edge touches it and does not cross.
        let touching = [[0.0, 0.0], [15.0, 10.0], [5.0, 25.0], [12.0, 8.0], [-10.0, 15.0]];
        let points: Vec<_> = touching.iter().map(|[x, y]| Vector3::new(*x, *y, 0.5 * x - y)).collect();
        let mut triangles = Vec::new();
        assert!(triangulate(&points, &[&[0, 1, 2, 3, 4]], &mut triangles));
        // Flat but for rounding: the fan uses every corner.
        let line: Vec<_> = (0..6).map(|i| Vector3::new(0.1, 0.3, 0.7) * f64::from(i)).collect();
        triangles.clear();
        assert!(triangulate(&line, &[&[0, 1, 2, 3, 4, 5]], &mut triangles));
        assert!(boundary(&triangles, &[&[0, 1, 2, 3, 4, 5]]).is_empty() && triangles.len() == 4);
    }

    #[test]
    fn a_long_concave_outline_takes_little_time() {
        let count = 20_000;
        let mut points: Vec<_> =
            (0..count).map(|i| f64::from(i) / f64::from(count)).map(|x| Vector3::new(x, x * x, 0.0)).collect();
        points.push(Vector3::new(0.5, 0.6, 0.0));
        let outline: Vec<usize> = (0..points.len()).collect();
        let mut triangles = Vec::new();
        assert!(triangulate(&points, &[&outline], &mut triangles));
        assert_eq!(triangles.len(), points.len() - 2);
    }

    #[test]
    fn loops_that_overlap_themselves_take_little_time() {
        // From end to end of a line, through more and more corners, and back by three aside.
        let count = 4000;
        let at = |i: u32| Vector3::new(f64::from(i), 0.0, 0.0);
        let mut points: Vec<_> = (0..count).map(|i| at(if i % 2 == 0 { i / 2 } else { count - 1 - i / 2 })).collect();
        points.extend([Vector3::new(9.0, 5.0, 0.0), Vector3::new(5.0, 1.0, 0.0), Vector3::new(1.0, 5.0, 0.0)]);
        let outline: Vec<usize> = (0..points.len()).collect();
        assert!(!triangulate(&points, &[&outline], &mut Vec::new()));
    }

    #[test]
    fn sizes_and_offsets_do_not_matter() {
        let letter = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
        for scale in [1e-60, 1e-9, 1e9, 1e60] {
            let points: Vec<_> = placed(&letter).into_iter().map(|x| x * scale).collect();
            check(&points, &[&[0, 1, 2, 3, 4, 5]], 5.0 * scale * scale);
        }
        let far: Vec<_> = placed(&letter).into_iter().map(|x| x + Vector3::repeat(1e6)).collect();
        let mut triangles = Vec::new();
        assert!(triangulate(&far, &[&[0, 1, 2, 3, 4, 5]], &mut triangles) && triangles.len() == 4);
    }
}
