//! Caps of cut pieces: the section of a closed piece with a plane, triangulated.
//!
//! A cap is a chain of triangles whose boundary is a given set of chords, reversed. That it is one
//! is a matter of counting alone: the chords are traced into loops, holes are joined to the loops
//! around them by bridges, which are passed once each way, and from the resulting polygons
//! triangles are clipped until nothing is left. Where coordinates decide, as about which ear is
//! clipped next (Meisters, Polygons have ears, Amer. Math. Monthly 82, 1975), a wrong decision
//! makes a cap that covers more than the section, but a cap all the same. Operations are those that
//! IEEE 754 rounds correctly, so a cut has the same caps on every machine.

use super::spot::Spot;
use nalgebra::{Vector2, Vector3};
use std::collections::{BTreeMap, HashMap};

/// Area below which a triangle of a section counts as flat, relative to the square of the size of
/// the section; dimensionless.
///
/// Areas round at about 1e-16. A smaller value lets rounding decide which corner is clipped; a
/// larger one makes caps of thin sections cover too much. Pinned by
/// `caps_cover_the_section_and_no_more`.
const THIN: f64 = 1e-13;

/// Ears are looked for among no more corners than this; the time grows with the square.
pub(super) const MOST_CORNERS: usize = 4096;

/// Triangles whose boundary passes the chords, each from `p` to `q`, the other way. The chords are
/// a cycle, near a plane with this normal.
pub(super) fn cap(spots: &[Spot], chords: &[(usize, usize)], normal: &Vector3<f64>) -> Vec<[usize; 3]> {
    let axis = normal.iamin();
    let first = normal.cross(&Vector3::ith(axis, 1.0)).normalize();
    let second = normal.cross(&first);
    let mut section = Section { at: HashMap::new(), thin: 0.0 };
    for &(p, q) in chords {
        for corner in [p, q] {
            let x = spots[corner].x;
            section.at.insert(corner, Vector2::new(first.dot(&x), second.dot(&x)));
        }
    }
    let mut loops = loops(chords);
    let Some(widest) = loops.iter().map(|corners| section.area(corners)).max_by(|a, b| a.abs().total_cmp(&b.abs()))
    else {
        return Vec::new();
    };
    // The widest loop is no hole: seen from one side or the other it is counter-clockwise.
    if widest < 0.0 {
        section.at.values_mut().for_each(|x| x.y = -x.y);
    }
    let size = section.at.values().fold(0.0, |most: f64, x| most.max((x - section.at[&chords[0].0]).norm()));
    section.thin = THIN * size * size;
    loops.sort_by(|a, b| section.area(b).total_cmp(&section.area(a)));
    let (mut polygons, holes): (Vec<_>, Vec<_>) = loops.into_iter().partition(|corners| section.area(corners) > 0.0);
    let mut alone = Vec::new();
    section.bridge(&mut polygons, holes, &mut alone);
    polygons.into_iter().chain(alone).flat_map(|polygon| section.clip(polygon)).collect()
}

/// The chords, passed the other way, as loops that pass no corner twice.
fn loops(chords: &[(usize, usize)]) -> Vec<Vec<usize>> {
    // Chords that are passed both ways cancel.
    let mut net: BTreeMap<(usize, usize), i64> = BTreeMap::new();
    for &(p, q) in chords.iter().filter(|(p, q)| p != q) {
        *net.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
    }
    let mut next: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
    for ((low, high), count) in net {
        let (from, to) = if count > 0 { (high, low) } else { (low, high) };
        (0..count.unsigned_abs()).for_each(|_| next.entry(from).or_default().push(to));
    }
    let mut loops = Vec::new();
    while let Some((&start, _)) = next.first_key_value() {
        let mut path = vec![start];
        let mut places = HashMap::from([(start, 0)]);
        while let Some(&end) = path.last() {
            let Some(ways) = next.get_mut(&end) else { break };
            let Some(to) = ways.pop() else { break };
            if ways.is_empty() {
                next.remove(&end);
            }
            match places.get(&to) {
                Some(&place) => {
                    let made = path.split_off(place);
                    made.iter().for_each(|corner| {
                        places.remove(corner);
                    });
                    loops.push(made);
                    if place == 0 {
                        break;
                    }
                    // The corner where the loop closed is still on the path.
                    places.insert(to, place);
                    path.push(to);
                }
                None => {
                    places.insert(to, path.len());
                    path.push(to);
                }
            }
        }
    }
    loops
}

/// Corners in a plane.
struct Section {
    at: HashMap<usize, Vector2<f64>>,
    /// Twice an area that counts as none.
    thin: f64,
}

impl Section {
    /// Twice the area of a triangle, positive if it is counter-clockwise.
    fn turn(&self, a: usize, b: usize, c: usize) -> f64 {
        let (a, b, c) = (self.at[&a], self.at[&b], self.at[&c]);
        (b - a).perp(&(c - a))
    }

    /// Twice the area of a loop.
    fn area(&self, corners: &[usize]) -> f64 {
        (1..corners.len().saturating_sub(1)).map(|i| self.turn(corners[0], corners[i], corners[i + 1])).sum()
    }

    /// Whether a loop goes around a corner.
    fn around(&self, polygon: &[usize], corner: usize) -> bool {
        let x = self.at[&corner];
        let ends = polygon.iter().zip(polygon.iter().cycle().skip(1)).map(|(a, b)| (self.at[a], self.at[b]));
        let crossed =
            ends.filter(|(a, b)| (a.y > x.y) != (b.y > x.y) && x.x < a.x + (b.x - a.x) * ((x.y - a.y) / (b.y - a.y)));
        crossed.count() % 2 == 1
    }

    /// Whether two segments cross at a point inside both.
    fn cross(&self, [a, b]: [usize; 2], [c, d]: [usize; 2]) -> bool {
        let apart = |one: f64, other: f64| (one > 0.0 && other < 0.0) || (one < 0.0 && other > 0.0);
        apart(self.turn(a, b, c), self.turn(a, b, d)) && apart(self.turn(c, d, a), self.turn(c, d, b))
    }

    /// Joins each hole to the narrowest polygon around it; what is in none stays alone.
    fn bridge(&self, polygons: &mut [Vec<usize>], holes: Vec<Vec<usize>>, alone: &mut Vec<Vec<usize>>) {
        // Polygons are sorted by area, the widest first.
        let outlines = polygons.to_vec();
        let mut inside = vec![Vec::new(); polygons.len()];
        for hole in holes {
            match outlines.iter().rposition(|outline| self.around(outline, hole[0])) {
                Some(polygon) => inside[polygon].push(hole),
                None => alone.push(hole),
            }
        }
        for (polygon, mut holes) in polygons.iter_mut().zip(inside) {
            // From one side to the other, so that no bridge meets a hole that is not joined yet.
            let right = |hole: &[usize]| hole.iter().map(|corner| self.at[corner].x).fold(f64::NEG_INFINITY, f64::max);
            holes.sort_by(|a, b| right(b).total_cmp(&right(a)));
            for index in 0..holes.len() {
                let (hole, others) = (&holes[index], &holes[index + 1..]);
                self.join(polygon, hole, others);
            }
        }
    }

    /// Makes a hole part of a polygon, by a bridge that crosses neither them nor other holes if
    /// there is one.
    fn join(&self, polygon: &mut Vec<usize>, hole: &[usize], others: &[Vec<usize>]) {
        let rightmost = (0..hole.len()).max_by(|&i, &j| self.at[&hole[i]].x.total_cmp(&self.at[&hole[j]].x));
        let Some(from) = rightmost else { return };
        let corner = hole[from];
        let distance = |place: usize| (self.at[&polygon[place]] - self.at[&corner]).norm_squared();
        let mut places: Vec<usize> = (0..polygon.len()).collect();
        places.sort_by(|&i, &j| distance(i).total_cmp(&distance(j)));
        let visible = |&place: &usize| {
            let to = polygon[place];
            let (before, after) =
                (polygon[(place + polygon.len() - 1) % polygon.len()], polygon[(place + 1) % polygon.len()]);
            // Where a corner is passed twice, only one of the two angles contains the bridge.
            let (left, right) = (self.turn(before, to, corner) > 0.0, self.turn(to, after, corner) > 0.0);
            let within = if self.turn(before, to, after) >= 0.0 { left && right } else { left || right };
            let all = [&polygon[..], hole].into_iter().chain(others.iter().map(Vec::as_slice));
            let mut edges = all.flat_map(|part| part.iter().zip(part.iter().cycle().skip(1)));
            within && !edges.any(|(&a, &b)| self.cross([corner, to], [a, b]))
        };
        let Some(&place) = places.iter().find(|place| visible(place)).or(places.first()) else { return };
        let around = hole[from..].iter().chain(&hole[..=from]).copied();
        let bridged: Vec<usize> =
            polygon[..=place].iter().copied().chain(around).chain(polygon[place..].iter().copied()).collect();
        *polygon = bridged;
    }

    /// Triangles of a polygon.
    fn clip(&self, mut polygon: Vec<usize>) -> Vec<[usize; 3]> {
        let mut triangles = Vec::new();
        // Since the last ear.
        let mut tried = 0;
        let mut place = 0;
        while polygon.len() >= 3 {
            let count = polygon.len();
            let corners = [place, place + 1, place + 2].map(|place| polygon[place % count]);
            if tried >= count || self.is_ear(&polygon, corners) {
                triangles.push(corners);
                polygon.remove((place + 1) % count);
                // What was before the removed corner keeps its place, unless the first was removed.
                place = if place + 1 >= count { count - 2 } else { place };
                // The next ear is looked for beyond: fans have thin triangles.
                place = (place + 1) % polygon.len();
                tried = 0;
            } else {
                place = (place + 1) % count;
                tried += 1;
            }
        }
        triangles
    }

    /// Whether a triangle at three corners in a row can be clipped: it has all of the polygon
    /// outside.
    fn is_ear(&self, polygon: &[usize], [a, b, c]: [usize; 3]) -> bool {
        let turn = self.turn(a, b, c);
        if turn.abs() <= self.thin {
            // A corner on the way from one to the other, or at one of them.
            let (x, y, z) = (self.at[&a], self.at[&b], self.at[&c]);
            return (x - y).dot(&(z - y)) <= 0.0;
        }
        let inside = |&corner: &usize| {
            self.turn(a, b, corner) > 0.0 && self.turn(b, c, corner) > 0.0 && self.turn(c, a, corner) >= -self.thin
        };
        let apart = |corner: &&usize| {
            ![a, b, c].contains(corner) && ![a, b, c].iter().any(|end| self.at[end] == self.at[*corner])
        };
        turn > 0.0 && !polygon.iter().filter(apart).any(inside)
    }
}

#[cfg(test)]
mod tests {
    use super::cap;
    use crate::body::Spot;
    use nalgebra::{Rotation3, Vector3};
    use std::collections::HashMap;
    use std::f64::consts::TAU;
    use sublevel_testkit::Seeded;

    /// The chords of loops, each passed in its order.
    fn chords(loops: &[Vec<[f64; 2]>]) -> (Vec<[f64; 2]>, Vec<(usize, usize)>) {
        let (mut points, mut chords) = (Vec::new(), Vec::new());
        for corners in loops {
            let before = points.len();
            points.extend(corners);
            chords.extend((0..corners.len()).map(|i| (before + i, before + (i + 1) % corners.len())));
        }
        (points, chords)
    }

    fn circle(center: [f64; 2], radius: f64, sides: usize, sense: f64) -> Vec<[f64; 2]> {
        let corner = |i: usize| {
            let (sin, cos) = (sense * TAU * i as f64 / sides as f64).sin_cos();
            [center[0] + radius * cos, center[1] + radius * sin]
        };
        (0..sides).map(corner).collect()
    }

    /// Checks that a cap has the chords for its boundary, and returns its area, all triangles
    /// counted as positive.
    fn area(points: &[[f64; 2]], chords: &[(usize, usize)], turn: &Rotation3<f64>) -> f64 {
        let spots: Vec<Spot> = points
            .iter()
            .map(|[x, y]| Spot { x: turn * Vector3::new(*x, *y, 0.3) + Vector3::repeat(2.0), radius: 0.0 })
            .collect();
        let triangles = cap(&spots, chords, &(turn * Vector3::z()));
        let mut net: HashMap<(usize, usize), i64> = HashMap::new();
        let passes = triangles.iter().flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)]).chain(chords.iter().copied());
        for (p, q) in passes.filter(|(p, q)| p != q) {
            *net.entry((p.min(q), p.max(q))).or_default() += if p < q { 1 } else { -1 };
        }
        assert!(net.values().all(|&count| count == 0), "the boundary is not that of the chords");
        let at = |corner: usize| spots[corner].x;
        triangles.iter().map(|&[a, b, c]| (at(b) - at(a)).cross(&(at(c) - at(a))).norm() / 2.0).sum()
    }

    #[test]
    fn caps_cover_the_section_and_no_more() {
        let square = |low: f64, high: f64| vec![[low, low], [high, low], [high, high], [low, high]];
        let hole = |low: f64, high: f64| square(low, high).into_iter().rev().collect::<Vec<_>>();
        let comb: Vec<[f64; 2]> = (0..9)
            .flat_map(|i| {
                [[f64::from(i), 1.0], [f64::from(i) + 0.4, 1.0], [f64::from(i) + 0.4, 0.1], [f64::from(i) + 1.0, 0.1]]
            })
            .chain([[9.0, 0.0], [0.0, 0.0]])
            .collect();
        // With corners on straight edges, as planes make them of divided faces.
        let divided: Vec<[f64; 2]> = (0..12)
            .map(|i| f64::from(i % 3) / 3.0 + f64::from(i / 3))
            .map(|way| match way {
                way if way < 1.0 => [way, 0.0],
                way if way < 2.0 => [1.0, way - 1.0],
                way if way < 3.0 => [3.0 - way, 1.0],
                way => [0.0, 4.0 - way],
            })
            .collect();
        let sieve: Vec<_> = [circle([0.0; 2], 1.0, 64, 1.0)]
            .into_iter()
            .chain((0..7).map(|i| {
                let (sin, cos) = (TAU * f64::from(i) / 7.0).sin_cos();
                circle([0.6 * cos, 0.6 * sin], 0.15, 12, -1.0)
            }))
            .chain([circle([0.0; 2], 0.3, 20, -1.0)])
            .collect();
        let polygon = |radius: f64, sides: f64| 0.5 * sides * radius * radius * (TAU / sides).sin();
        let cases = [
            (vec![square(0.0, 1.0)], 1.0),
            (vec![divided.clone()], 1.0),
            (vec![comb], 9.0 * 0.1 + 9.0 * 0.4 * 0.9),
            (vec![square(0.0, 4.0), hole(1.0, 3.0)], 12.0),
            (vec![square(0.0, 4.0), hole(1.0, 3.0), square(1.5, 2.5), square(5.0, 6.0)], 14.0),
            (
                vec![circle([0.0; 2], 0.05, 48, 1.0), circle([0.0; 2], 0.03, 48, -1.0)],
                polygon(0.05, 48.0) - polygon(0.03, 48.0),
            ),
            (sieve, polygon(1.0, 64.0) - 7.0 * polygon(0.15, 12.0) - polygon(0.3, 20.0)),
        ];
        for (case, (loops, expected)) in cases.into_iter().enumerate() {
            for turn in [Rotation3::identity(), Rotation3::from_euler_angles(0.4, 1.1, -2.0)] {
                let (points, chords) = chords(&loops);
                let reversed: Vec<_> = chords.iter().map(|&(p, q)| (q, p)).collect();
                for chords in [chords, reversed] {
                    let found = area(&points, &chords, &turn);
                    assert!((found - expected).abs() < 1e-9 * expected, "case {case}: {found} {expected}");
                }
            }
        }
    }

    #[test]
    fn any_cycle_gets_a_cap() {
        for seed in 0..300 {
            let mut random = Seeded(seed);
            let mut index = |count: usize| (random.next() % count as u64) as usize;
            // Loops that cross themselves and each other, share corners and pass chords both ways.
            let points: Vec<[f64; 2]> = (0..4 + index(20)).map(|_| [index(7) as f64, index(7) as f64]).collect();
            let chords: Vec<(usize, usize)> = (0..1 + index(5))
                .flat_map(|_| {
                    let corners: Vec<usize> = (0..1 + index(9)).map(|_| index(points.len())).collect();
                    (0..corners.len()).map(|i| (corners[i], corners[(i + 1) % corners.len()])).collect::<Vec<_>>()
                })
                .collect();
            let found = area(&points, &chords, &Rotation3::identity());
            assert!(found.is_finite(), "seed {seed}");
        }
        assert!(cap(&[], &[], &Vector3::z()).is_empty());
    }
}
