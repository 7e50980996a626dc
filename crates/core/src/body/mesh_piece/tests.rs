use super::{Caps, MeshError, Piece, Spot};
use crate::body::Sphere;
use dashu_ratio::RBig;
use nalgebra::Vector3;
use std::collections::HashMap;
use std::f64::consts::PI;
use sublevel_testkit::Seeded;

type Exact = [RBig; 3];

fn exact(x: f64) -> RBig {
    RBig::try_from(x).unwrap()
}

fn sum(values: impl Iterator<Item = RBig>) -> RBig {
    values.fold(RBig::ZERO, |sum, value| sum + value)
}

fn exact_point(x: &Vector3<f64>) -> Exact {
    [exact(x.x), exact(x.y), exact(x.z)]
}

/// `p + t (q - p)` without rounding.
fn exact_between(p: &Exact, q: &Exact, t: f64) -> Exact {
    std::array::from_fn(|i| p[i].clone() + exact(t) * (q[i].clone() - p[i].clone()))
}

fn holds(spot: &Spot, point: &Exact) -> bool {
    let x = exact_point(&spot.x);
    let square = |i: usize| (x[i].clone() - point[i].clone()) * (x[i].clone() - point[i].clone());
    sum((0..3).map(square)) <= exact(spot.radius) * exact(spot.radius)
}

/// A closed mesh with dents and spikes, as its points and triangles.
fn burr(seed: u64, center: f64) -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
    let mut random = Seeded(seed);
    let sphere = Sphere::subdivided(1);
    let points = sphere.vertices().iter().map(|u| u * (1.0 + 0.6 * random.signed()) + Vector3::repeat(center));
    (points.collect(), sphere.triangles().to_vec())
}

fn cube() -> (Vec<Vector3<f64>>, Vec<[usize; 3]>) {
    let points = (0..8_u8).map(|i| Vector3::from_fn(|axis, _| if i >> axis & 1 == 1 { 1.0 } else { -1.0 })).collect();
    let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
    (points, faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect())
}

fn piece((points, triangles): &(Vec<Vector3<f64>>, Vec<[usize; 3]>)) -> Piece {
    Piece::of_mesh(points, triangles).unwrap()
}

/// Six times the volume inside, each point being what it stands for.
fn exact_volume(piece: &Piece, points: impl Fn(&Spot) -> Exact) -> RBig {
    let corner = |i: usize| points(&piece.spots()[i]);
    sum(piece.triangles().iter().map(|&[a, b, c]| {
        let ([a0, a1, a2], [b0, b1, b2], [c0, c1, c2]) = (corner(a), corner(b), corner(c));
        a0 * (&b1 * &c2 - &b2 * &c1) + a1 * (&b2 * &c0 - &b0 * &c2) + a2 * (b0 * c1 - b1 * c0)
    }))
}

fn volume(piece: &Piece) -> f64 {
    let x = |i: usize| piece.spots()[i].x;
    piece.triangles().iter().map(|&[a, b, c]| x(a).dot(&x(b).cross(&x(c)))).sum::<f64>() / 6.0
}

/// Winding number about a point, by the solid angles of the triangles (van Oosterom and Strackee,
/// The solid angle of a plane triangle, IEEE Trans. Biomed. Eng. 30, 1983).
fn winding(piece: &Piece, about: &Vector3<f64>) -> f64 {
    let angle = |triangle: &[usize; 3]| {
        let [a, b, c] = triangle.map(|i| piece.spots()[i].x - about);
        let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
        2.0 * a.dot(&b.cross(&c)).atan2(la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb)
    };
    piece.triangles().iter().map(angle).sum::<f64>() / (4.0 * PI)
}

fn random_plane(random: &mut Seeded, center: f64) -> (Vector3<f64>, f64) {
    let normal = Vector3::from_fn(|_, _| random.signed()).normalize();
    (normal, normal.dot(&Vector3::repeat(center)) + 0.7 * random.signed())
}

#[test]
fn points_of_edges_are_within_their_radius() {
    for seed in 0..2_000 {
        let mut random = Seeded(seed);
        let scale = 10_f64.powf(12.0 * random.signed());
        let mut spot = || {
            let x = Vector3::from_fn(|_, _| scale * random.signed());
            let radius = if random.next().is_multiple_of(2) { 0.0 } else { 1e-13 * scale };
            // Some point of the ball, on its surface nearly.
            let away = Vector3::from_fn(|_, _| random.signed()).normalize() * (0.999 * radius);
            let (x0, away) = (exact_point(&x), exact_point(&away));
            (Spot { x, radius }, std::array::from_fn(|i| x0[i].clone() + away[i].clone()))
        };
        let ((p, exact_p), (q, exact_q)) = (spot(), spot());
        for t in [0.0, 1e-300, 1e-17, random.signed().abs(), 1.0 - f64::EPSILON / 2.0, 1.0] {
            let between = Spot::between(&p, &q, t);
            assert!(holds(&between, &exact_between(&exact_p, &exact_q, t)), "seed {seed}, t {t}: {between:?}");
            assert!(between.radius <= 1e-13 * scale + 3e-15 * scale, "seed {seed}: {between:?}");
        }
    }
}

/// What the spots of a piece stand for, by all that is known of them: at 10^6 m two can have the
/// same coordinates.
type Truth = HashMap<[u64; 4], Exact>;

fn key(spot: &Spot) -> [u64; 4] {
    [spot.x.x, spot.x.y, spot.x.z, spot.radius].map(f64::to_bits)
}

/// Adds the exact points where a plane splits edges of a piece.
fn split(piece: &Piece, truth: &mut Truth, normal: &Vector3<f64>, height: f64) {
    let heights: Vec<f64> = piece.spots().iter().map(|spot| normal.dot(&spot.x) - height).collect();
    for triangle in piece.triangles() {
        for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (triangle[i], triangle[j])) {
            let (a, b) = (a.min(b), a.max(b));
            if (heights[a] >= 0.0) != (heights[b] >= 0.0) {
                let t = heights[a] / (heights[a] - heights[b]);
                let (p, q) = (&piece.spots()[a], &piece.spots()[b]);
                let point = exact_between(&truth[&key(p)], &truth[&key(q)], t);
                truth.insert(key(&Spot::between(p, q, t)), point);
            }
        }
    }
}

#[test]
fn pieces_add_up_to_the_mesh_without_rounding() {
    for seed in 0..6 {
        let center = if seed % 2 == 0 { 0.0 } else { 1e6 };
        let mut random = Seeded(seed);
        let mesh = piece(&burr(seed, center));
        let corners: Truth = mesh.spots().iter().map(|spot| (key(spot), exact_point(&spot.x))).collect();
        let volume = |(piece, truth): &(Piece, Truth)| exact_volume(piece, |spot| truth[&key(spot)].clone());
        let mut pieces = vec![(mesh, corners)];
        let whole = volume(&pieces[0]);
        for _ in 0..4 {
            let (normal, height) = random_plane(&mut random, center);
            let halves = pieces.into_iter().flat_map(|(piece, mut truth)| {
                split(&piece, &mut truth, &normal, height);
                piece.cut(&normal, height).map(|half| (half, truth.clone()))
            });
            pieces = halves.collect();
        }
        for (piece, truth) in &pieces {
            assert!(piece.is_cycle(), "seed {seed}");
            for spot in piece.spots() {
                assert!(holds(spot, &truth[&key(spot)]), "seed {seed}: {spot:?}");
                assert!(spot.radius < 1e-13 * (1.0 + center), "seed {seed}: {spot:?}");
            }
        }
        assert!(sum(pieces.iter().map(volume)) == whole && whole > RBig::ZERO, "seed {seed}");
    }
}

#[test]
fn winding_numbers_add_up() {
    for (seed, caps) in (0..20).flat_map(|seed| [(seed, Caps::Cones), (seed, Caps::Sections)]) {
        let mut random = Seeded(seed);
        let mesh = piece(&burr(seed, 0.0));
        let mut pieces = vec![mesh.clone()];
        for _ in 0..3 {
            let (normal, height) = random_plane(&mut random, 0.0);
            pieces = pieces.iter().flat_map(|piece| piece.cut_with(&normal, height, caps)).collect();
        }
        assert!(pieces.iter().all(|piece| piece.is_closed() && piece.is_cycle()), "seed {seed}, {caps:?}");
        let mut inside = 0;
        for _ in 0..300 {
            let x = Vector3::from_fn(|_, _| 1.6 * random.signed());
            let (whole, parts) = (winding(&mesh, &x), pieces.iter().map(|piece| winding(piece, &x)).sum::<f64>());
            assert!(
                (whole - parts).abs() < 1e-6 && (whole - whole.round()).abs() < 1e-6,
                "seed {seed}: {whole} {parts}"
            );
            inside += usize::from(whole.round() != 0.0);
        }
        assert!((10..290).contains(&inside), "{inside}");
    }
}

#[test]
fn a_corner_where_cuts_meet_inside_belongs_to_its_pieces() {
    // No triangle of a cube's octant has the centre of the cube for a corner; without it the
    // octants' hulls leave a hole.
    let mut pieces = vec![piece(&cube())];
    for axis in 0..3 {
        pieces = pieces.iter().flat_map(|piece| piece.cut(&Vector3::ith(axis, 1.0), 0.1)).collect();
    }
    assert_eq!(pieces.len(), 8);
    for piece in &pieces {
        assert!(piece.spots().iter().any(|spot| (spot.x - Vector3::repeat(0.1)).norm() < 1e-12));
    }
    assert!((pieces.iter().map(volume).sum::<f64>() - 8.0).abs() < 1e-12);
}

#[test]
fn planes_through_corners_and_along_faces_do_no_harm() {
    let turned = Vector3::new(1.0, 1.0, 0.0).normalize();
    for (normal, height) in [
        (Vector3::x(), 1.0),
        (Vector3::x(), -1.0),
        (Vector3::x(), 0.0),
        (Vector3::x(), 1.0 + 1e-16),
        (Vector3::x(), 1.0 - 1e-16),
        (Vector3::x(), 2.0),
        (turned, 0.0),
        (turned, turned.x + turned.y),
        (Vector3::new(0.6, 0.8, 1e-17), 0.2),
    ] {
        for caps in [Caps::Cones, Caps::Sections] {
            let halves = piece(&cube()).cut_with(&normal, height, caps);
            assert!(halves.iter().all(Piece::is_cycle));
            let sum: f64 = halves.iter().map(volume).sum();
            assert!((sum - 8.0).abs() < 1e-12, "{caps:?} {normal:?} {height}: {sum}");
        }
    }
}

#[test]
fn open_meshes_are_distinguished_from_closed_ones() {
    let (points, triangles) = cube();
    assert!(piece(&(points.clone(), triangles.clone())).is_closed());
    // Each triangle with corners of its own, as STL has them.
    let soup: Vec<_> = triangles.iter().flatten().map(|&corner| points[corner]).collect();
    let own: Vec<_> = (0..triangles.len()).map(|i| [3 * i, 3 * i + 1, 3 * i + 2]).collect();
    assert!(piece(&(soup, own)).is_closed());
    let mut flipped = triangles.clone();
    flipped[3].swap(0, 1);
    assert!(!piece(&(points.clone(), flipped)).is_closed());
    let open = piece(&(points.clone(), triangles[1..].to_vec()));
    assert!(!open.is_closed());
    // No caps: the surface stays what it is.
    let area = |piece: &Piece| {
        let x = |i: usize| piece.spots()[i].x;
        piece.triangles().iter().map(|&[a, b, c]| (x(b) - x(a)).cross(&(x(c) - x(a))).norm() / 2.0).sum::<f64>()
    };
    let halves = open.cut(&Vector3::new(0.3, 0.5, 0.8).normalize(), 0.2);
    assert!((halves.iter().map(area).sum::<f64>() - 22.0).abs() < 1e-12 && halves.iter().all(|half| !half.is_closed()));

    assert!(matches!(Piece::of_mesh(&points, &[]), Err(MeshError::NoTriangles)));
    let bad = MeshError::Corner { triangle: 1, point: 8, points: 8 };
    assert_eq!(Piece::of_mesh(&points, &[[0, 1, 2], [0, 8, 1]]).unwrap_err(), bad);
    let mut nowhere = points;
    nowhere[2].y = f64::NAN;
    assert_eq!(Piece::of_mesh(&nowhere, &triangles).unwrap_err(), MeshError::NotFinite(2));
}

/// An L of two boxes, 1 m wide, and its mirror image inside out.
fn letter_l(inward: bool) -> Piece {
    let outline = [[0.0, 0.0], [3.0, 0.0], [3.0, 1.0], [1.0, 1.0], [1.0, 3.0], [0.0, 3.0]];
    let points: Vec<Vector3<f64>> =
        [0.0, 1.0].iter().flat_map(|&z| outline.map(|[x, y]| Vector3::new(x, y, z))).collect();
    let mut triangles = Vec::new();
    for [a, b, c] in [[0, 1, 2], [0, 2, 3], [0, 3, 5], [3, 4, 5]] {
        triangles.extend([[a, c, b], [a + 6, b + 6, c + 6]]);
    }
    for i in 0..6 {
        let next = (i + 1) % 6;
        triangles.extend([[i, next, next + 6], [i, next + 6, i + 6]]);
    }
    if inward {
        triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    Piece::of_mesh(&points, &triangles).unwrap()
}

#[test]
fn faces_in_the_plane_go_with_the_solid_behind_them() {
    for inward in [false, true] {
        for (normal, height) in [(Vector3::y(), 1.0), (-Vector3::y(), -1.0), (Vector3::x(), 1.0 + 1e-12)] {
            let halves = letter_l(inward).cut_with(&normal, height, Caps::Sections);
            for half in &halves {
                assert!(half.is_closed() && half.is_cycle());
                // Boxes have the corners of boxes and nothing else.
                let (low, high) = half
                    .spots()
                    .iter()
                    .fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(low, high), spot| {
                        (low.inf(&spot.x), high.sup(&spot.x))
                    });
                let bounds: f64 = (high - low).product();
                assert!((volume(half).abs() - bounds).abs() < 1e-9, "{inward} {normal:?}: {} {bounds}", volume(half));
            }
            let sum: f64 = halves.iter().map(volume).sum();
            assert!((sum.abs() - 5.0).abs() < 1e-9, "{sum}");
        }
    }
}

#[test]
fn sections_do_not_reach_across_holes() {
    // A box with a hole through it, cut across the hole and then along it: the sides of the second
    // cut have no spot in the hole.
    let ring = |half: f64, z: f64| {
        [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| Vector3::new(half * x, half * y, z))
    };
    let points = [ring(2.0, -1.0), ring(2.0, 1.0), ring(1.0, -1.0), ring(1.0, 1.0)].concat();
    let quads = (0..4).flat_map(|i| {
        let j = (i + 1) % 4;
        [[i, j, j + 4, i + 4], [j + 8, i + 8, i + 12, j + 12], [i + 4, j + 4, j + 12, i + 12], [j, i, i + 8, j + 8]]
    });
    let triangles: Vec<_> = quads.flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
    let frame = Piece::of_mesh(&points, &triangles).unwrap();
    let second = Vector3::new(0.8, 0.6, 0.0);
    for (caps, crossed) in [(Caps::Cones, true), (Caps::Sections, false)] {
        let [low, _] = frame.cut_with(&Vector3::z(), 0.1, caps);
        let halves = low.cut_with(&second, 0.05, caps);
        let in_hole = |spot: &Spot| spot.x.x.abs() < 1.0 - 1e-9 && spot.x.y.abs() < 1.0 - 1e-9;
        assert_eq!(halves.iter().any(|half| half.spots().iter().any(in_hole)), crossed, "{caps:?}");
    }
}

#[test]
fn corners_near_a_plane_are_on_it() {
    // The cube has the size 3.5: a plane that cuts off 1e-10 of it leaves its corners alone.
    for (depth, is_cut) in [(1e-10, false), (1e-6, true)] {
        let [below, _] = piece(&cube()).cut_with(&Vector3::x(), 1.0 - depth, Caps::Sections);
        assert_eq!(below.spots().iter().any(|spot| spot.x.x < 1.0 && spot.x.x > 0.5), is_cut, "{depth}");
    }
}
