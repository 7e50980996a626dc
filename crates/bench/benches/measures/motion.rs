//! What is asked besides distances along motions: poses in overlap, screw motions, rays; and what
//! motions are like.

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{Motion, MotionError, Options, Pose, PoseError, Ray, RayError, WarmStart, signed_distance};
use sublevel_bench::comparison::Random;
pub(crate) use sublevel_bench::comparison::motion::{Trajectory, grazing, separated, through_contact, to_text};

/// How close the bodies come.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, clap::ValueEnum)]
#[serde(rename_all = "lowercase")]
pub(crate) enum Kind {
    /// Bodies of every degree are apart, the closest of them mostly by 5 to 75 cm.
    Separated,
    /// The gap goes between a micrometre and a centimetre.
    Grazing,
    /// Through contact and back: from a centimetre apart to five centimetres deep.
    Contact,
}

impl Kind {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Separated => "separated",
            Self::Grazing => "grazing",
            Self::Contact => "contact",
        }
    }
}

/// Poses that have nothing to do with each other in all of which the bodies overlap, from all but
/// apart to all but concentric.
pub(crate) fn overlapping(a: &Body, b: &Body, trajectories: usize, poses: usize) -> Result<Vec<Trajectory>, PoseError> {
    let mut random = Random(0);
    let reach = a.circumscribed().radius + b.circumscribed().radius;
    let mut draw = || {
        let rotation = random.rotation();
        let place = a.interior_point() + random.direction() * (reach * random.signed());
        Pose::from_quaternion(place - rotation * b.interior_point(), rotation.coords.into())
    };
    let mut trajectory = || {
        let mut found = Vec::new();
        while found.len() < poses {
            let pose = draw()?;
            let answer =
                signed_distance(a, &Pose::identity(), b, &pose, &Options::default(), &mut WarmStart::default());
            found.extend((answer.upper < 0.0).then_some(pose));
        }
        Ok(found)
    };
    (0..trajectories).map(|_| trajectory()).collect()
}

/// Screw motions of both bodies that start in these poses, two seconds of which bring their middles
/// about together.
pub(crate) fn screws(a: &Body, b: &Body, starts: &[Trajectory]) -> Result<Vec<Vec<(Motion, Motion)>>, MotionError> {
    let mut random = Random(0);
    let (middle_a, middle_b) = (a.circumscribed().center, b.circumscribed().center);
    let size = a.circumscribed().radius + b.circumscribed().radius;
    let mut screw = |start: Pose, velocity: Vector3<f64>, middle: Vector3<f64>| {
        let center = middle + random.direction() * (0.3 * size * random.signed());
        Motion::new(start, velocity, random.direction() * (2.0 * random.signed()), center)
    };
    let mut pair = |pose: &Pose| {
        let middle = pose.transform_point(&middle_b);
        let way = middle_a - middle;
        Ok((screw(Pose::identity(), way * -0.25, middle_a)?, screw(*pose, way * 0.25, middle)?))
    };
    starts.iter().map(|trajectory| trajectory.iter().map(&mut pair).collect()).collect()
}

/// Rays from the middle of `b` to points all over the inside of `a`: all of them hit `a`.
pub(crate) fn rays(a: &Body, b: &Body, poses: &[Trajectory]) -> Result<Vec<Vec<Ray>>, RayError> {
    let targets: Vec<_> = a.boundary().iter().map(|point| a.interior_point().lerp(point, 0.95)).collect();
    let mut targets = targets.iter().cycle();
    let mut ray = |pose: &Pose| {
        let from = pose.transform_point(&b.circumscribed().center);
        Ray::new(from, targets.next().unwrap_or(a.interior_point()) - from, f64::INFINITY)
    };
    poses.iter().map(|trajectory| trajectory.iter().map(&mut ray).collect()).collect()
}

/// What a motion is like, in metres.
#[derive(Clone, Copy, Debug, serde::Serialize)]
pub(crate) struct Character {
    /// Smallest, median and largest signed distance.
    pub(crate) gaps: [f64; 3],
    /// Median and largest way of the middle of `b` from pose to pose.
    pub(crate) steps: [f64; 2],
}

impl Character {
    /// Of `b` moving about `a`.
    pub(crate) fn new(a: &Body, b: &Body, trajectories: &[Trajectory]) -> Self {
        let poses = trajectories.iter().flatten();
        let signed =
            |pose| signed_distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default()).lower;
        let gaps = sorted(poses.map(signed));
        let middle = b.circumscribed().center;
        let steps = sorted(trajectories.iter().flat_map(|trajectory| {
            let way = |pair: &[Pose]| (pair[1].transform_point(&middle) - pair[0].transform_point(&middle)).norm();
            trajectory.windows(2).map(way).collect::<Vec<_>>()
        }));
        let at = |values: &[f64], part: f64| {
            let last = values.len().saturating_sub(1) as f64;
            values.get((part * last).round() as usize).copied().unwrap_or(f64::NAN)
        };
        Self { gaps: [0.0, 0.5, 1.0].map(|part| at(&gaps, part)), steps: [0.5, 1.0].map(|part| at(&steps, part)) }
    }
}

fn sorted(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_by(f64::total_cmp);
    sorted
}
