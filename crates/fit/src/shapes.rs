//! The two shapes the demo makes itself: a chair and a standing human figure.
//!
//! Both are closed triangle surfaces in metres, z up, standing on the floor `z = 0` about the
//! origin, front towards `+x`. They are made of overlapping parts; what a fit needs of them is
//! their vertices.

use nalgebra::Vector3;
use std::f64::consts::{FRAC_PI_2, TAU};
use std::fmt::Write;

/// A triangle surface, in metres.
#[derive(Clone, Debug, Default)]
pub struct Shape {
    /// Corner points, metres.
    pub vertices: Vec<Vector3<f64>>,
    /// Indices into `vertices`, counter-clockwise seen from outside.
    pub triangles: Vec<[usize; 3]>,
}

impl Shape {
    /// The surface as the text of an OFF file; a reader gets exactly these coordinates back.
    pub fn to_off(&self) -> String {
        let mut text = format!("OFF\n{} {} 0\n", self.vertices.len(), self.triangles.len());
        // Writing to a string cannot fail.
        for v in &self.vertices {
            let _ = writeln!(text, "{} {} {}", v.x, v.y, v.z);
        }
        for [a, b, c] in &self.triangles {
            let _ = writeln!(text, "3 {a} {b} {c}");
        }
        text
    }

    /// The same surface with coordinates rounded to a micrometre, which keeps files short.
    fn in_micrometres(mut self) -> Shape {
        for vertex in &mut self.vertices {
            *vertex = vertex.map(|c| (c * 1e6).round() / 1e6 + 0.0); // + 0.0: no negative zero
        }
        self
    }

    /// Adds the quadrilateral a, b, c, d (counter-clockwise from outside).
    fn quad(&mut self, a: usize, b: usize, c: usize, d: usize) {
        self.triangles.extend([[a, b, c], [a, c, d]]);
    }

    /// Adds a straight bar with rectangular ends centred at `from` and `to`; `half` holds half its
    /// sides along x and y.
    fn bar(&mut self, from: Vector3<f64>, to: Vector3<f64>, half: [f64; 2]) {
        let first = self.vertices.len();
        for end in [from, to] {
            for (x, y) in [(-1.0, -1.0), (1.0, -1.0), (1.0, 1.0), (-1.0, 1.0)] {
                self.vertices.push(end + Vector3::new(x * half[0], y * half[1], 0.0));
            }
        }
        let at = |ring: usize, corner: usize| first + 4 * ring + corner % 4;
        for corner in 0..4 {
            self.quad(at(0, corner), at(0, corner + 1), at(1, corner + 1), at(1, corner));
        }
        self.quad(at(0, 3), at(0, 2), at(0, 1), at(0, 0));
        self.quad(at(1, 0), at(1, 1), at(1, 2), at(1, 3));
    }

    /// Adds a tube of elliptic rings through `stations`, closed by rounded caps.
    fn tube(&mut self, stations: &[Station]) {
        let (Some(start), Some(end)) = (stations.first(), stations.last()) else { return };
        let along = (end.center - start.center).try_normalize(1e-9).unwrap_or_else(Vector3::z);
        let across = (Vector3::y() - along * along.y).try_normalize(1e-3).unwrap_or_else(Vector3::x);
        let third = along.cross(&across);

        let rings = rounded(stations, &along);
        let first = self.vertices.len();
        for ring in &rings {
            for side in 0..SIDES {
                let (sin, cos) = (TAU * side as f64 / SIDES as f64).sin_cos();
                self.vertices.push(ring.center + across * (ring.width * cos) + third * (ring.depth * sin));
            }
        }
        let at = |ring: usize, side: usize| first + SIDES * ring + side % SIDES;
        for ring in 0..rings.len() - 1 {
            for side in 0..SIDES {
                self.quad(at(ring, side), at(ring, side + 1), at(ring + 1, side + 1), at(ring + 1, side));
            }
        }
        let apex = self.vertices.len();
        self.vertices.push(start.center - along * start.cap);
        self.vertices.push(end.center + along * end.cap);
        for side in 0..SIDES {
            self.triangles.push([apex, at(0, side + 1), at(0, side)]);
            self.triangles.push([apex + 1, at(rings.len() - 1, side), at(rings.len() - 1, side + 1)]);
        }
    }
}

/// Corners of a ring of a tube.
const SIDES: usize = 16;
/// Rings of a rounded cap.
const CAP_RINGS: usize = 4;

/// One elliptic cross-section of a tube, in metres.
#[derive(Clone, Copy)]
struct Station {
    center: Vector3<f64>,
    /// Half-axis in the direction nearest to y.
    width: f64,
    /// Half-axis in the third direction.
    depth: f64,
    /// Height of the rounded cap, if this station is an end.
    cap: f64,
}

/// A station whose cap is as high as it is wide.
fn ring(x: f64, y: f64, z: f64, width: f64, depth: f64) -> Station {
    Station { center: Vector3::new(x, y, z), width, depth, cap: width.min(depth) }
}

/// The stations with the rings of the caps before and after them.
fn rounded(stations: &[Station], along: &Vector3<f64>) -> Vec<Station> {
    let cap = |station: &Station, sign: f64, step: usize| {
        let (sin, cos) = (FRAC_PI_2 * step as f64 / (CAP_RINGS + 1) as f64).sin_cos();
        Station {
            center: station.center + along * (sign * station.cap * sin),
            width: station.width * cos,
            depth: station.depth * cos,
            cap: 0.0,
        }
    };
    let mut rings = Vec::new();
    if let (Some(start), Some(end)) = (stations.first(), stations.last()) {
        rings.extend((1..=CAP_RINGS).rev().map(|step| cap(start, -1.0, step)));
        rings.extend_from_slice(stations);
        rings.extend((1..=CAP_RINGS).map(|step| cap(end, 1.0, step)));
    }
    rings
}

/// A chair, 0.48 m wide, 0.5 m deep and 0.9 m high: seat, slightly reclined back with three slats,
/// four legs.
pub fn chair() -> Shape {
    let mut chair = Shape::default();
    let at = Vector3::new;
    chair.bar(at(0.0, 0.0, 0.43), at(0.0, 0.0, 0.47), [0.22, 0.24]);
    for y in [-0.21, 0.21] {
        chair.bar(at(0.2, y, 0.0), at(0.19, y, 0.43), [0.02, 0.02]);
        chair.bar(at(-0.22, y, 0.0), at(-0.19, y, 0.43), [0.02, 0.02]);
        chair.bar(at(-0.2, y, 0.47), at(-0.26, y, 0.9), [0.02, 0.02]);
    }
    for z in [0.56, 0.68, 0.8] {
        let x = -0.2 - 0.06 * (z - 0.47) / 0.43;
        chair.bar(at(x, 0.0, z), at(x - 0.011, 0.0, z + 0.08), [0.01, 0.2]);
    }
    subdivided(&chair, 0.06).in_micrometres()
}

/// A standing human figure, 1.75 m tall, arms somewhat out; limbs and head are swept ellipses.
pub fn human() -> Shape {
    let mut human = Shape::default();
    human.tube(&[
        ring(0.0, 0.0, 0.93, 0.165, 0.115),
        ring(0.0, 0.0, 1.08, 0.14, 0.095),
        ring(0.0, 0.0, 1.28, 0.165, 0.115),
        ring(0.0, 0.0, 1.4, 0.18, 0.085),
    ]);
    human.tube(&[ring(0.0, 0.0, 1.42, 0.055, 0.055), ring(0.01, 0.0, 1.54, 0.052, 0.055)]);
    human.tube(&[Station { center: Vector3::new(0.015, 0.0, 1.635), width: 0.076, depth: 0.096, cap: 0.115 }]);
    for side in [-1.0, 1.0] {
        let limb = |x: f64, y: f64, z: f64, radius: f64| ring(x, side * y, z, radius, radius);
        human.tube(&[limb(0.0, 0.19, 1.4, 0.055), limb(-0.01, 0.33, 1.12, 0.042)]);
        human.tube(&[limb(-0.01, 0.33, 1.12, 0.042), limb(0.05, 0.43, 0.89, 0.03)]);
        human.tube(&[ring(0.055, side * 0.44, 0.87, 0.022, 0.04), ring(0.075, side * 0.475, 0.79, 0.018, 0.042)]);
        human.tube(&[limb(0.0, 0.095, 0.9, 0.085), limb(0.005, 0.115, 0.5, 0.055)]);
        human.tube(&[limb(0.005, 0.115, 0.5, 0.055), limb(-0.015, 0.13, 0.1, 0.038)]);
        human.tube(&[ring(-0.04, side * 0.13, 0.04, 0.038, 0.04), ring(0.15, side * 0.15, 0.03, 0.045, 0.03)]);
    }
    // The feet slope a little, so the lowest point is only nearly on the floor.
    let (low, high) = human.vertices.iter().fold((f64::MAX, f64::MIN), |(low, high), v| (low.min(v.z), high.max(v.z)));
    for vertex in &mut human.vertices {
        vertex.z = (vertex.z - low) / (high - low) * 1.75;
    }
    human.in_micrometres()
}

/// The same surface with every edge halved until none is longer than `longest` metres: a scan has
/// many vertices too.
fn subdivided(shape: &Shape, longest: f64) -> Shape {
    let mut fine = Shape { vertices: shape.vertices.clone(), triangles: Vec::new() };
    let mut middles = std::collections::BTreeMap::new();
    let mut pending = shape.triangles.clone();
    while let Some([a, b, c]) = pending.pop() {
        let length = |i: usize, j: usize| (fine.vertices[i] - fine.vertices[j]).norm();
        // The longest edge is cut, the same way from both of its triangles, so the surface stays
        // closed.
        let edges = [(length(a, b), [a, b, c]), (length(b, c), [b, c, a]), (length(c, a), [c, a, b])];
        let Some((size, [i, j, k])) = edges.into_iter().max_by(|x, y| x.0.total_cmp(&y.0)) else { continue };
        if size <= longest {
            fine.triangles.push([a, b, c]);
            continue;
        }
        let middle = *middles.entry((i.min(j), i.max(j))).or_insert_with(|| {
            fine.vertices.push((fine.vertices[i] + fine.vertices[j]) / 2.0);
            fine.vertices.len() - 1
        });
        pending.extend([[i, middle, k], [middle, j, k]]);
    }
    fine
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::collections::BTreeMap;

    fn extent(shape: &Shape) -> (Vector3<f64>, Vector3<f64>) {
        let first = shape.vertices[0];
        shape.vertices.iter().fold((first, first), |(low, high), v| (low.inf(v), high.sup(v)))
    }

    /// Six times the volume each part encloses, by the divergence theorem.
    fn signed_volume(shape: &Shape) -> f64 {
        let corner = |i: usize| shape.vertices[i];
        shape.triangles.iter().map(|&[a, b, c]| corner(a).dot(&corner(b).cross(&corner(c)))).sum::<f64>() / 6.0
    }

    #[test]
    fn the_shapes_have_the_stated_size() {
        let (low, high) = extent(&chair());
        assert!(low.z.abs() < 1e-9 && (high.z - 0.9).abs() < 1e-9 && (high.y - low.y - 0.48).abs() < 1e-9);
        let (low, high) = extent(&human());
        assert!(low.z.abs() < 1e-9 && (high.z - 1.75).abs() < 1e-9, "{low} {high}");
        assert!((low.y + high.y).abs() < 1e-9, "the figure is symmetric");
    }

    #[test]
    fn the_surfaces_are_closed_and_face_outwards() {
        for shape in [chair(), human()] {
            assert!((300..5000).contains(&shape.vertices.len()), "{}", shape.vertices.len());
            let mut edges = BTreeMap::new();
            for [a, b, c] in &shape.triangles {
                for (from, to) in [(a, b), (b, c), (c, a)] {
                    *edges.entry((*from, *to)).or_insert(0) += 1;
                }
            }
            assert!(edges.iter().all(|((from, to), count)| edges.get(&(*to, *from)) == Some(count)));
            assert!(signed_volume(&shape) > 0.0);
        }
        assert!((0.05..0.09).contains(&signed_volume(&human())), "{}", signed_volume(&human()));
    }

    #[test]
    fn the_off_text_lists_what_it_counts() {
        let shape = chair();
        let text = shape.to_off();
        assert_eq!(text.lines().count(), 2 + shape.vertices.len() + shape.triangles.len());
        assert!(text.starts_with("OFF\n"));
        let first: Vec<f64> = text.lines().nth(2).unwrap().split(' ').map(|c| c.parse().unwrap()).collect();
        assert_eq!(first, shape.vertices[0].as_slice(), "coordinates survive exactly");
    }
}
