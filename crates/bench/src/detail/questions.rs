//! Random pairs of poses at distances about a threshold, and whether a rung can tell on which side
//! of it the objects are.

use crate::comparison::{Hulls, Random, Subject, parry_pose};
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{Options, Pose, PoseError, WarmStart, distance};

/// Thresholds of "nearer than m?", as parts of the larger diameter; 0 asks whether they touch.
pub(super) const THRESHOLDS: [f64; 10] = [0.0, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0];

/// Halvings on the way to a distance: below a thousandth of a millionth of the way.
const HALVINGS: usize = 40;

/// Poses of `b` in the frame of `a` at which the hulls are apart by lengths that are uniform
/// between 0 and twice `threshold_m`, or, of a threshold of 0, between 0 and one diameter;
/// directions and rotations are random. With each the distance, metres.
pub(super) fn ask(
    [a, b]: [&Subject; 2],
    hulls: &Hulls,
    threshold_m: f64,
    count: usize,
    seed: u64,
) -> Result<Vec<(Pose, f64)>, PoseError> {
    let mut random = Random(seed);
    let size = a.diameter_m.max(b.diameter_m);
    let middle = |subject: &Subject| subject.hull.iter().sum::<Vector3<f64>>() / subject.hull.len() as f64;
    let (from, own) = (middle(a), middle(b));
    let most = if threshold_m > 0.0 { 2.0 * threshold_m } else { size };
    let mut asked = Vec::new();
    while asked.len() < count {
        let (rotation, direction) = (random.rotation(), random.direction());
        let wanted = 0.5 * most * (1.0 + random.signed());
        let at = |way: f64| {
            let place = from + direction * way - rotation * own;
            Pose::from_quaternion(place, rotation.coords.into())
        };
        // The distance is convex along the way and 0 where the middles meet: one way out it only
        // grows.
        let (mut near, mut far) = (0.0, wanted + 2.0 * size);
        for _ in 0..HALVINGS {
            let way = 0.5 * (near + far);
            if hulls.distance(&parry_pose(&at(way)?)) < wanted { near = way } else { far = way }
        }
        let pose = at(far)?;
        asked.push((pose, hulls.distance(&parry_pose(&pose))));
    }
    Ok(asked)
}

/// What became of the questions about one threshold on one rung.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Settled {
    /// Parts of all questions answered by yes and by no.
    pub(super) yes: f64,
    pub(super) no: f64,
    /// Answers that the hulls contradict.
    pub(super) wrong: usize,
}

/// Asks a rung: the hulls are at least as far apart as the bodies, and nearer than these plus both
/// gaps.
pub(super) fn settle((a, b): (&Body, &Body), asked: &[(Pose, f64)], threshold_m: f64) -> Settled {
    let mut found = Settled::default();
    let part = 1.0 / asked.len() as f64;
    for (pose, truth_m) in asked {
        let answer = distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default());
        let beyond = if threshold_m > 0.0 { answer.lower >= threshold_m } else { answer.lower > 0.0 };
        let within = answer.hulls_upper(a, b).is_some_and(|upper| upper < threshold_m);
        found.yes += if within { part } else { 0.0 };
        found.no += if beyond { part } else { 0.0 };
        let wrong = (within && *truth_m >= threshold_m) || (beyond && *truth_m < threshold_m);
        found.wrong += usize::from(wrong);
    }
    found
}
