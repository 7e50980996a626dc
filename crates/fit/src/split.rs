//! Where to cut an object into pieces that are nearly convex: the search by gain alone.
//!
//! What a piece wastes is the part of its convex hull that the object does not fill. The pieces of
//! an object fill the same, so the best cut of a piece is the one whose two sides have hulls of the
//! least volume together; the best of all pieces is made, again and again. Planes are tried in many
//! directions and at many heights on a sample of the piece, by hulls of the samples farthest along
//! fixed directions; the few that promise most are made and measured exactly.

use super::hull::{principal_axes, rough_volume};
use nalgebra::Vector3;
use sublevel_core::body::{Cut, Piece, Sphere};

/// Heights tried per direction.
const HEIGHTS: usize = 15;

/// Cuts that are measured exactly.
pub(super) const FINALISTS: usize = 6;

/// Least volume of a side of a cut, as a part of the hull of the piece; dimensionless.
///
/// Thinner sides are not worth a part, and near [`FLATNESS`](crate::hull::FLATNESS) no body can be
/// fitted to them. A larger value forbids useful cuts beside thin walls. Pinned by
/// `slivers_are_not_cut_off`.
pub(super) const LEAST_SHARE: f64 = 1e-3;

/// Longest distance between samples of an edge, relative to the size of the piece; dimensionless.
///
/// A larger value estimates hulls of halves from too few points; a smaller one takes more time for
/// the same cuts. Pinned by `samples_are_no_farther_apart_than_the_spacing`.
const SAMPLE_SPACING: f64 = 1.0 / 64.0;

/// Most samples of a piece.
const MAX_SAMPLES: usize = 20_000;

/// A mesh cut into pieces.
pub(super) struct Partition {
    /// The cuts in their order.
    pub(super) cuts: Vec<Cut>,
    /// Total volumes of the pieces' hulls, before each cut and after the last.
    pub(super) totals: Vec<f64>,
    /// The pieces they leave, numbered as they say.
    pieces: Vec<Piece>,
    /// What is known of the best cut of each piece.
    plans: Vec<Best>,
}

/// The best cut of a piece.
enum Best {
    /// It was not looked for yet.
    Unknown,
    /// Nothing is gained by any.
    Nothing,
    /// The one that gains most.
    Cut(Plan),
}

/// A cut of a piece.
struct Plan {
    normal: Vector3<f64>,
    height: f64,
    /// By how much it reduces the volume of the hulls.
    gain: f64,
    sides: [Piece; 2],
}

impl Partition {
    /// The mesh in one piece.
    pub(super) fn new(mesh: Piece) -> Self {
        let total = rough_volume(&points(&mesh)).unwrap_or(0.0);
        Self { cuts: Vec::new(), totals: vec![total], pieces: vec![mesh], plans: vec![Best::Unknown] }
    }

    /// Makes the cut that gains most; returns whether there was one.
    pub(super) fn divide(&mut self) -> bool {
        for (piece, best) in self.pieces.iter().zip(&mut self.plans) {
            if let Best::Unknown = best {
                *best = plan(piece).map_or(Best::Nothing, Best::Cut);
            }
        }
        let gain = |best: &Best| if let Best::Cut(plan) = best { plan.gain } else { 0.0 };
        let part = (0..self.plans.len()).max_by(|&a, &b| gain(&self.plans[a]).total_cmp(&gain(&self.plans[b])));
        let Some(part) = part else { return false };
        let Best::Cut(Plan { normal, height, gain, sides: [below, above] }) =
            std::mem::replace(&mut self.plans[part], Best::Unknown)
        else {
            self.plans[part] = Best::Nothing;
            return false;
        };
        self.cuts.push(Cut { part, normal: normal.into(), height_m: height });
        self.totals.extend(self.totals.last().map(|total| total - gain));
        self.pieces[part] = below;
        self.pieces.push(above);
        self.plans.push(Best::Unknown);
        true
    }
}

/// The best cut of a piece.
fn plan(piece: &Piece) -> Option<Plan> {
    let whole = rough_volume(&points(piece))?;
    let mut promises = Scan::FULL.promises(&samples(&[piece]), whole);
    promises.sort_by(|a, b| b.gain.total_cmp(&a.gain));
    promises.truncate(FINALISTS);
    let measured = promises.into_iter().filter_map(|Promise { normal, height, .. }| {
        let sides = piece.cut(&normal, height);
        let volumes = [rough_volume(&points(&sides[0]))?, rough_volume(&points(&sides[1]))?];
        let gain = whole - volumes[0] - volumes[1];
        let thin = volumes.iter().any(|&volume| volume < LEAST_SHARE * whole);
        (gain > 0.0 && !thin).then_some(Plan { normal, height, gain, sides })
    });
    measured.max_by(|a, b| a.gain.total_cmp(&b.gain))
}

fn points(piece: &Piece) -> Vec<Vector3<f64>> {
    piece.spots().iter().map(|spot| spot.x).collect()
}

/// A plane and about what it gains.
pub(super) struct Promise {
    pub(super) normal: Vector3<f64>,
    pub(super) height: f64,
    pub(super) gain: f64,
}

/// How closely planes are looked through.
pub(super) struct Scan {
    /// Subdivisions of the icosahedron whose vertices the samples of a hull are farthest along.
    probes: usize,
    /// Subdivisions of the one whose vertices are normals; principal axes and those of coordinates
    /// alone if none.
    normals: Option<usize>,
    /// Heights per normal.
    heights: usize,
}

impl Scan {
    /// All that is looked through.
    pub(super) const FULL: Self = Self { probes: 2, normals: Some(1), heights: HEIGHTS };

    /// A glance, in a fortieth of the time.
    pub(super) const GLANCE: Self = Self { probes: 1, normals: None, heights: 7 };

    /// Planes of all directions and heights with what they gain by hulls of few samples.
    pub(super) fn promises(&self, samples: &[Vector3<f64>], whole: f64) -> Vec<Promise> {
        let (_, axes, _) = principal_axes(samples);
        let probes = Sphere::subdivided(self.probes);
        let reaches: Vec<Vec<f64>> =
            samples.iter().map(|x| probes.vertices().iter().map(|probe| probe.dot(x)).collect()).collect();
        let even = self.normals.map(|levels| Sphere::subdivided(levels).vertices().to_vec()).unwrap_or_default();
        let half = even.into_iter().filter(|n| (n.z, n.y, n.x) > (0.0, 0.0, 0.0));
        let normals = half.chain(axes.column_iter().map(Into::into)).chain((0..3).map(|i| Vector3::ith(i, 1.0)));
        normals.flat_map(|normal| along(samples, &reaches, normal, whole, self.heights)).collect()
    }
}

/// The planes across one direction.
fn along(
    samples: &[Vector3<f64>],
    reaches: &[Vec<f64>],
    normal: Vector3<f64>,
    whole: f64,
    planes: usize,
) -> Vec<Promise> {
    let heights: Vec<f64> = samples.iter().map(|x| normal.dot(x)).collect();
    let (low, high) = heights.iter().fold((f64::MAX, f64::MIN), |(low, high), &h| (low.min(h), high.max(h)));
    let step = (high - low) / (planes + 1) as f64;
    // For each layer between two planes how far it reaches along each probe, and the sample that
    // does.
    let nothing = vec![(f64::NEG_INFINITY, 0); reaches.first().map_or(0, Vec::len)];
    let mut layers = vec![nothing.clone(); planes + 1];
    for (sample, height) in heights.iter().enumerate() {
        let layer = &mut layers[(((height - low) / step) as usize).min(planes)];
        for (best, &reach) in layer.iter_mut().zip(&reaches[sample]) {
            if reach > best.0 {
                *best = (reach, sample);
            }
        }
    }
    // Hulls of all layers up to each plane.
    let volumes = |layers: &mut dyn Iterator<Item = &Vec<(f64, usize)>>| -> Vec<Option<f64>> {
        let mut farthest = nothing.clone();
        let up_to = |layer: &Vec<(f64, usize)>| {
            farthest.iter_mut().zip(layer).for_each(|(best, one)| {
                if one.0 > best.0 {
                    *best = *one;
                }
            });
            let mut corners: Vec<usize> =
                farthest.iter().filter(|best| best.0.is_finite()).map(|best| best.1).collect();
            corners.sort_unstable();
            corners.dedup();
            rough_volume(&corners.into_iter().map(|sample| samples[sample]).collect::<Vec<_>>())
        };
        layers.map(up_to).collect()
    };
    let below = volumes(&mut layers.iter());
    let above = volumes(&mut layers.iter().rev());
    let promise = |plane: usize| {
        let gain = whole - below[plane]? - above[planes - 1 - plane]?;
        Some(Promise { normal, height: low + step * (plane + 1) as f64, gain })
    };
    (0..planes).filter_map(promise).collect()
}

/// The corners of pieces, and points along their long edges, which planes may cut.
pub(super) fn samples(pieces: &[&Piece]) -> Vec<Vector3<f64>> {
    let corners = || pieces.iter().flat_map(|piece| piece.spots()).map(|spot| spot.x);
    let (low, high) = corners()
        .fold((Vector3::repeat(f64::MAX), Vector3::repeat(f64::MIN)), |(low, high), x| (low.inf(&x), high.sup(&x)));
    let spacing = SAMPLE_SPACING * (high - low).norm();
    let mut samples: Vec<_> = corners().collect();
    for piece in pieces {
        for triangle in piece.triangles() {
            for (a, b) in [(0, 1), (1, 2), (2, 0)].map(|(i, j)| (triangle[i], triangle[j])) {
                let (p, q) = (piece.spots()[a].x, piece.spots()[b].x);
                // Most edges are passed both ways.
                let count = if a < b { ((q - p).norm() / spacing) as usize } else { 0 };
                samples.extend((1..=count).map(|k| p + (q - p) * (k as f64 / (count + 1) as f64)));
            }
        }
    }
    let every = samples.len().div_ceil(MAX_SAMPLES);
    samples.into_iter().step_by(every).collect()
}

#[cfg(test)]
mod tests {
    use super::{plan, points, samples};
    use crate::hull::rough_volume;
    use nalgebra::Vector3;
    use sublevel_core::body::Piece;

    /// A cube with edge 1 and another one beside it.
    fn two_cubes(edge: f64) -> Piece {
        let faces = [[0, 4, 6, 2], [1, 3, 7, 5], [0, 1, 5, 4], [2, 6, 7, 3], [0, 2, 3, 1], [4, 5, 7, 6]];
        let (mut corners, mut triangles) = (Vec::new(), Vec::new());
        for (edge, shift) in [(1.0, 0.0), (edge, 2.0)] {
            let first = corners.len();
            corners.extend((0..8_u8).map(|i| Vector3::from_fn(|axis, _| shift + edge * f64::from(i >> axis & 1))));
            triangles.extend(faces.iter().flat_map(|&[a, b, c, d]| {
                [[a, b, c], [a, c, d]].map(|triangle: [usize; 3]| triangle.map(|corner| corner + first))
            }));
        }
        Piece::of_mesh(&corners, &triangles).unwrap()
    }

    #[test]
    fn slivers_are_not_cut_off() {
        // 2e-5 and 5e-3 of the whole hull.
        for (edge, is_cut_off) in [(0.03, false), (0.2, true)] {
            let piece = two_cubes(edge);
            let whole = rough_volume(&points(&piece)).unwrap();
            let found = plan(&piece).map(|plan| plan.sides.map(|side| rough_volume(&points(&side)).unwrap()));
            let least = found.map_or(whole, |volumes| volumes[0].min(volumes[1]));
            assert!(least >= 1e-3 * whole, "edge {edge}: {least} of {whole}");
            assert_eq!(least < 1.1 * edge.powi(3), is_cut_off, "edge {edge}: {least}");
        }
    }

    #[test]
    fn samples_are_no_farther_apart_than_the_spacing() {
        let corners = [Vector3::zeros(), Vector3::new(3.0, 0.0, 0.0), Vector3::new(0.0, 4.0, 0.0)];
        let piece = Piece::of_mesh(&corners, &[[0, 1, 2]]).unwrap();
        // The piece has the size 5; one edge runs from (0, 0) to (3, 0).
        let mut along: Vec<f64> = samples(&[&piece]).iter().filter(|x| x.y == 0.0).map(|x| x.x).collect();
        along.sort_by(f64::total_cmp);
        let widest = along.windows(2).map(|pair| pair[1] - pair[0]).fold(0.0, f64::max);
        assert!((5.0 / 80.0..=5.0 / 64.0).contains(&widest), "{widest}");
    }
}
