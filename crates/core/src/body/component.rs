//! Connected components of a mesh.
//!
//! Triangles are connected across edges, not across spots: solids that touch in a vertex stay
//! apart. Where two triangles pass an edge in opposite directions they are neighbours. Where more
//! do, as where solids touch along an edge or in a face, those that bound the same wedge of the
//! solid are: going around the edge, each triangle that opens a wedge is paired with the one that
//! closes it, like brackets (the ordering of Weiler's radial-edge structure, Edge-based data
//! structures for solid modeling in curved-surface environments, IEEE CG&A 5, 1985). An edge that
//! is passed more often one way than the other connects all its triangles.
//!
//! So a component without such an edge is a cycle, and the others together are what is left of the
//! mesh: as chains the components add up to the mesh whatever the pairing, and no proof depends on
//! the angles. They are computed by operations that IEEE 754 rounds correctly, so a mesh has the
//! same components on every machine.

use super::mesh_piece::Piece;
use super::spot::Spot;
use nalgebra::Vector3;
use std::collections::HashMap;

/// Difference of the angles around an edge, in quarters of a turn, below which two triangles are
/// taken for coincident.
///
/// The angles round at about 1e-16. A smaller value pairs coincident faces in an order that
/// rounding decides; a larger one takes the faces of thin wedges for one. Pinned by
/// `solids_that_touch_are_apart`.
const COINCIDENT: f64 = 1e-9;

/// A triangle that passes an edge.
#[derive(Clone, Copy)]
struct Pass {
    triangle: usize,
    /// The corner that is not on the edge.
    apex: usize,
    /// Whether the edge is passed from its lower spot to its higher one.
    forward: bool,
}

/// Sets of triangles that are joined one by one.
struct Sets(Vec<usize>);

impl Sets {
    fn find(&mut self, mut member: usize) -> usize {
        while self.0[member] != member {
            self.0[member] = self.0[self.0[member]];
            member = self.0[member];
        }
        member
    }

    /// The lowest member names the set.
    fn join(&mut self, a: usize, b: usize) {
        let (a, b) = (self.find(a), self.find(b));
        self.0[a.max(b)] = a.min(b);
    }
}

impl Piece {
    /// The closed connected components, each a piece, in the order of their first triangles; what
    /// is in none of them is one more piece in that order.
    pub fn components(&self) -> Vec<Self> {
        let (spots, triangles) = (self.spots(), self.triangles());
        let mut edges: HashMap<(usize, usize), Vec<Pass>> = HashMap::new();
        for (triangle, &[a, b, c]) in triangles.iter().enumerate() {
            if a != b && b != c && c != a {
                for (p, q, apex) in [(a, b, c), (b, c, a), (c, a, b)] {
                    edges.entry((p.min(q), p.max(q))).or_default().push(Pass { triangle, apex, forward: p < q });
                }
            }
        }
        let inward = self.signed_volume() < 0.0;
        let mut sets = Sets((0..triangles.len()).collect());
        let mut open = Vec::new();
        for (&(low, high), passes) in &edges {
            let forward = passes.iter().filter(|pass| pass.forward).count();
            if 2 * forward != passes.len() {
                passes.windows(2).for_each(|pair| sets.join(pair[0].triangle, pair[1].triangle));
                open.push(passes[0].triangle);
            } else if let [one, other] = passes[..] {
                sets.join(one.triangle, other.triangle);
            } else {
                for [one, other] in wedges([&spots[low].x, &spots[high].x], passes, spots, inward) {
                    sets.join(one, other);
                }
            }
        }
        attach_degenerate(triangles, &mut sets, &mut open);
        // All that is open is one set.
        open.windows(2).for_each(|pair| sets.join(pair[0], pair[1]));
        let mut places = vec![usize::MAX; triangles.len()];
        let mut components: Vec<Vec<[usize; 3]>> = Vec::new();
        for (triangle, corners) in triangles.iter().enumerate() {
            let set = sets.find(triangle);
            if places[set] == usize::MAX {
                places[set] = components.len();
                components.push(Vec::new());
            }
            components[places[set]].push(*corners);
        }
        components.into_iter().map(|triangles| Self::of_triangles(spots, triangles)).collect()
    }
}

/// Triangles with equal corners bound nothing: each belongs to a triangle that has one of its
/// spots, or else to what is open.
fn attach_degenerate(triangles: &[[usize; 3]], sets: &mut Sets, open: &mut Vec<usize>) {
    let degenerate = |&[a, b, c]: &[usize; 3]| a == b || b == c || c == a;
    if !triangles.iter().any(degenerate) {
        return;
    }
    let mut owners = HashMap::new();
    for (triangle, corners) in triangles.iter().enumerate().filter(|(_, corners)| !degenerate(corners)) {
        for &corner in corners {
            owners.entry(corner).or_insert(triangle);
        }
    }
    for (triangle, corners) in triangles.iter().enumerate().filter(|(_, corners)| degenerate(corners)) {
        match corners.iter().find_map(|corner| owners.get(corner)) {
            Some(&owner) => sets.join(owner, triangle),
            None => open.push(triangle),
        }
    }
}

/// Pairs of triangles around an edge that bound one wedge of the solid; as many pass it forward as
/// backward.
fn wedges(ends: [&Vector3<f64>; 2], passes: &[Pass], spots: &[Spot], inward: bool) -> Vec<[usize; 2]> {
    let [low, high] = ends;
    let axis = high - low;
    let axis = axis / axis.norm();
    let across = |pass: &Pass| {
        let arm = spots[pass.apex].x - low;
        let arm = arm - axis * axis.dot(&arm);
        arm / arm.norm()
    };
    let first = across(&passes[0]);
    let second = axis.cross(&first);
    let angle = |pass: &Pass| {
        let arm = across(pass);
        quarters(arm.dot(&first), arm.dot(&second))
    };
    // A triangle that passes the edge forward has its normal towards larger angles. Where normals
    // point out of the solid, it closes the wedge that a triangle at a smaller angle has opened.
    let mut around: Vec<(f64, bool, usize)> =
        passes.iter().map(|pass| (angle(pass), pass.forward == inward, pass.triangle)).collect();
    around.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
    // Among coincident triangles wedges close before others open.
    let mut start = 0;
    for end in 1..=around.len() {
        if end == around.len() || !(around[end].0 - around[end - 1].0 < COINCIDENT) {
            around[start..end].sort_by_key(|&(_, opens, triangle)| (opens, triangle));
            start = end;
        }
    }
    // Twice around, every bracket meets its own.
    let mut unclosed = Vec::new();
    let mut paired = vec![false; around.len()];
    let mut pairs = Vec::new();
    for index in (0..around.len()).chain(0..around.len()) {
        if paired[index] {
            continue;
        }
        let (_, opens, triangle) = around[index];
        if opens {
            unclosed.push(index);
        } else if let Some(open) = unclosed.pop() {
            (paired[index], paired[open]) = (true, true);
            pairs.push([around[open].2, triangle]);
            unclosed.retain(|&other: &usize| other != open);
        }
    }
    pairs
}

/// A number from 0 to 4 that grows with the angle of a direction: cheap, and rounded alike
/// everywhere. Directions next to the first axis on either side count as on it.
fn quarters(x: f64, y: f64) -> f64 {
    let along = y / (x.abs() + y.abs());
    let turn = match (x >= 0.0, y >= 0.0) {
        (true, true) => along,
        (false, _) => 2.0 - along,
        (true, false) => 4.0 + along,
    };
    if turn > 4.0 - COINCIDENT || turn.is_nan() { 0.0 } else { turn }
}

#[cfg(test)]
mod tests {
    use super::quarters;
    use crate::body::Piece;
    use nalgebra::{Rotation3, Vector3};

    type Mesh = (Vec<Vector3<f64>>, Vec<[usize; 3]>);

    /// A box from one corner to the other, its faces divided along either diagonal.
    fn cuboid(low: [f64; 3], high: [f64; 3], other_diagonal: bool) -> Mesh {
        let corner = |i: u8, axis: usize| if i >> axis & 1 == 1 { high[axis] } else { low[axis] };
        let points = (0..8).map(|i| Vector3::from_fn(|axis, _| corner(i, axis))).collect();
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let split = |&[a, b, c, d]: &[usize; 4]| {
            if other_diagonal { [[a, b, d], [b, c, d]] } else { [[a, b, c], [a, c, d]] }
        };
        (points, faces.iter().flat_map(split).collect())
    }

    fn unit(at: [f64; 3], other_diagonal: bool) -> Mesh {
        cuboid(at, at.map(|x| x + 1.0), other_diagonal)
    }

    fn together(meshes: &[Mesh]) -> Mesh {
        let mut all: Mesh = (vec![], vec![]);
        for (points, triangles) in meshes {
            let before = all.0.len();
            all.0.extend(points);
            all.1.extend(triangles.iter().map(|triangle| triangle.map(|corner| corner + before)));
        }
        all
    }

    fn reversed((points, triangles): Mesh) -> Mesh {
        (points, triangles.into_iter().map(|[a, b, c]| [a, c, b]).collect())
    }

    fn components((points, triangles): &Mesh) -> Vec<Piece> {
        let whole = Piece::of_mesh(points, triangles).unwrap();
        let components = whole.components();
        assert_eq!(components.iter().map(|piece| piece.triangles().len()).sum::<usize>(), triangles.len());
        components
    }

    /// Sizes of closed and of open components.
    fn counts(mesh: &Mesh) -> Vec<(usize, bool)> {
        components(mesh).iter().map(|piece| (piece.triangles().len(), piece.is_closed())).collect()
    }

    #[test]
    fn solids_that_touch_are_apart() {
        let turn = Rotation3::from_euler_angles(0.3, -0.8, 1.2);
        let near = unit([0.0; 3], false);
        for (what, at) in [
            ("a face", [1.0, 0.0, 0.0]),
            ("an edge", [1.0, 1.0, 0.0]),
            ("a vertex", [1.0, 1.0, 1.0]),
            ("nothing", [3.0, 0.0, 0.0]),
            ("part of a face", [1.0, 0.5, 0.0]),
        ] {
            for other_diagonal in [false, true] {
                let both = together(&[near.clone(), unit(at, other_diagonal)]);
                let turned = (both.0.iter().map(|x| turn * x + Vector3::repeat(7.0)).collect(), both.1.clone());
                for mesh in [both.clone(), reversed(both), turned] {
                    assert_eq!(counts(&mesh), [(12, true), (12, true)], "{what}");
                }
            }
        }
        // Four around one edge, two of them with coincident faces, and eight around a vertex.
        let four = [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]].map(|[x, y]| unit([x, y, 0.0], x > y));
        assert_eq!(counts(&together(&four)), [(12, true); 4]);
        let eight = (0..8_u8).map(|i| unit([0, 1, 2].map(|axis| f64::from(i >> axis & 1)), i % 3 == 0));
        assert_eq!(counts(&together(&eight.collect::<Vec<_>>())), [(12, true); 8]);
    }

    #[test]
    fn a_cavity_is_a_component() {
        let hollow = together(&[cuboid([0.0; 3], [3.0; 3], false), reversed(unit([1.0; 3], true))]);
        assert_eq!(counts(&hollow), [(12, true), (12, true)]);
    }

    #[test]
    fn what_is_open_stays_together() {
        let (points, mut triangles) = unit([5.0, 0.0, 0.0], false);
        triangles.remove(7);
        let open = (points.clone(), triangles);
        let closed = unit([0.0; 3], false);
        assert_eq!(counts(&together(&[closed.clone(), open.clone()])), [(12, true), (11, false)]);
        let (more, lone) = (unit([9.0, 0.0, 0.0], false), (vec![Vector3::zeros(); 3], vec![[0, 1, 2]]));
        let sheet = (vec![Vector3::repeat(20.0), Vector3::x() * 30.0, Vector3::y() * 30.0], vec![[0, 1, 2]]);
        let all = together(&[open.clone(), closed, sheet, more]);
        assert_eq!(counts(&all), [(12, false), (12, true), (12, true)]);
        // Touching in a face does not open the closed one.
        assert_eq!(counts(&together(&[unit([4.0, 0.0, 0.0], false), open])), [(12, true), (11, false)]);
        // Triangles that are none belong to their spots, or to what is open.
        let (points, mut triangles) = unit([0.0; 3], false);
        triangles.extend([[3, 3, 4], [5, 5, 5]]);
        assert_eq!(counts(&(points, triangles)), [(14, true)]);
        assert_eq!(counts(&together(&[lone.clone(), unit([1.0; 3], true)]))[1], (12, true));
        assert_eq!(counts(&lone), [(1, true)]);
    }

    #[test]
    fn faults_open_a_component() {
        let (points, triangles) = unit([0.0; 3], false);
        let beside = unit([4.0; 3], false);
        let mut flipped = triangles.clone();
        flipped[3].swap(0, 1);
        assert_eq!(counts(&together(&[(points.clone(), flipped), beside.clone()])), [(12, false), (12, true)]);
        let mut doubled = triangles;
        doubled.push(doubled[4]);
        assert_eq!(counts(&together(&[(points, doubled), beside])), [(13, false), (12, true)]);
    }

    #[test]
    fn quarters_grow_with_the_angle() {
        let mut last = -1.0;
        for degrees in 0..360 {
            let (sin, cos) = f64::from(degrees).to_radians().sin_cos();
            let turn = quarters(cos, sin);
            assert!(turn > last && turn < 4.0, "{degrees}: {turn} after {last}");
            last = turn;
        }
        assert!(quarters(1.0, -1e-17) == 0.0 && quarters(f64::NAN, 0.0) == 0.0);
    }
}
