//! The problems: pairs of bodies at random poses, each with a reference answer and what was known a
//! step before.

use super::effort::Effort;
use crate::comparison::{ComparisonError, FitCache, Random, Subject, motion};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::Body;
use sublevel::fit::FitOptions;
use sublevel::measure::{Options, Pose, PoseError, WarmStart, distance};

/// From the pose before to the pose of a query: in units of half of the larger diameter, and in
/// hundredths of degrees.
const STEP: f64 = 0.01;
/// Objects of the pairs.
const PAIRS: [[&str; 2]; 3] = [["chair", "human"], ["hand", "vase"], ["octopus", "chair"]];
/// What the reference is asked for: below the floor of rounding, so that its bracket is as narrow
/// as brackets get.
const REFERENCE: f64 = 1e-15;

/// A pair at random poses.
pub(super) struct Case {
    pub(super) name: String,
    pub(super) a: Body,
    pub(super) b: Body,
    /// Circumradius of the smaller body, metres, which tolerances and errors are parts of.
    pub(super) size_m: f64,
    pub(super) queries: Vec<Query>,
}

/// One of them.
#[derive(Clone)]
pub(super) struct Query {
    /// Of the second body in the frame of the first.
    pub(super) pose: Pose,
    /// Hint of the answer a step before.
    pub(super) hint: WarmStart,
    /// Witnesses of that answer, moved with their bodies to this pose, metres.
    pub(super) before: [Vector3<f64>; 2],
    /// The distance, metres: the middle of the reference's bracket, and half of its width.
    pub(super) truth: f64,
    pub(super) half_width: f64,
}

/// The pairs of a run; names with the degree.
pub(super) fn cases(
    data: &std::path::Path,
    effort: &Effort,
    cache: &FitCache,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<Case>, ComparisonError> {
    let mut all = Vec::new();
    for [a, b] in &PAIRS[..effort.pairs] {
        let [a, b] = [Subject::read(a, data)?, Subject::read(b, data)?];
        let unit_m = 0.5 * a.diameter_m.max(b.diameter_m);
        for &degree in effort.degrees {
            let name = format!("{}-{}-d{degree}", a.name, b.name);
            announce(&name)?;
            let options = FitOptions { degree, ..FitOptions::default() };
            let bodies = [cache.body(a.name, &a.mesh, &options)?, cache.body(b.name, &b.mesh, &options)?];
            let poses = motion::stepping((&bodies[0], &bodies[1]), unit_m, Some(STEP), effort.queries, 2)?;
            all.push(Case::new(name, bodies, poses.into_iter().map(|pair| [pair[0], pair[1]]))?);
        }
    }
    announce("flat faces")?;
    let [a, b] = [("slab", [0.5, 0.4, 0.3]), ("tile", [0.35, 0.3, 0.2])].map(|(name, [x, y, z])| {
        Body::superellipsoid(name, Vector3::zeros(), Vector3::new(x, y, z), 8).map_err(|error| {
            ComparisonError::Representation { mesh: "flat", method: name.into(), what: error.to_string() }
        })
    });
    all.push(Case::new("flat-faces-d8".into(), [a?, b?], flat_poses(effort.queries)?)?);
    Ok(all)
}

impl Case {
    /// With pairs of poses: the one before, and the one that is asked about.
    pub(super) fn new(
        name: String,
        [a, b]: [Body; 2],
        poses: impl IntoIterator<Item = [Pose; 2]>,
    ) -> Result<Self, ComparisonError> {
        let size_m = a.circumscribed().radius.min(b.circumscribed().radius);
        let sharp = Options::default().with_accuracy(REFERENCE)?;
        let origin = Pose::identity();
        let query = |[before, pose]: [Pose; 2]| {
            let mut hint = WarmStart::default();
            let old = distance(&a, &origin, &b, &before, &Options::default(), &mut hint);
            let known = distance(&a, &origin, &b, &pose, &sharp, &mut WarmStart::default());
            let in_b = before.rotation().inverse() * (old.witness_b - before.translation());
            let before = [old.witness_a, pose.transform_point(&in_b)];
            Query { pose, hint, before, truth: known.value(), half_width: 0.5 * (known.upper - known.lower) }
        };
        let queries = poses.into_iter().map(query).collect();
        Ok(Self { name, a, b, size_m, queries })
    }
}

/// Poses at which the upper face of the slab and the lower of the tile are nearly parallel, turned
/// by 1e-4 to 1e-2 rad, apart by 1 to 30 cm; a step before, the tile was a centimetre aside.
fn flat_poses(count: usize) -> Result<Vec<[Pose; 2]>, PoseError> {
    let one = |seed: usize| {
        let mut random = Random(seed as u64);
        let about = Vector3::new(random.signed(), random.signed(), 0.0).normalize();
        let turn = UnitQuaternion::new(about * 10_f64.powf(-3.0 + random.signed()));
        let gap = 0.155 + 0.145 * random.signed();
        let place = Vector3::new(0.1 * random.signed(), 0.1 * random.signed(), 0.3 + 0.2 + gap);
        let at = |aside: f64| Pose::from_quaternion(place + Vector3::x() * aside, turn.coords.into());
        Ok([at(0.01)?, at(0.0)?])
    };
    (1..=count).map(one).collect()
}
