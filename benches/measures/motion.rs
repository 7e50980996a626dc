//! Smooth motions of one body about another in steps of one centimetre and one degree; poses in overlap; screw motions; rays.

use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::TAU;
use std::fmt::Write;
use sublevel::body::Body;
use sublevel::measure::{
    Motion, MotionError, Options, Pose, PoseError, Ray, RayError, WarmStart, distance, signed_distance,
};

/// Poses of `b` in the frame of `a`.
pub(crate) type Trajectory = Vec<Pose>;

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

/// Translation from pose to pose, metres.
const STEP: f64 = 0.01;
/// Rotation from pose to pose, radians.
const TURN: f64 = TAU / 360.0;
/// How much the directions of translation and rotation change in a step, radians.
const WANDER: f64 = 0.05;

/// The gap that separated motions keep about, and how far from it they are steered back with full strength, metres.
const MIDDLE: f64 = 0.4;
const HALF_RANGE: f64 = 0.35;
/// Below this gap of any pair a separated motion is thrown away, metres.
const CLEAR: f64 = 0.01;

/// Ranges of the gap of grazing motions and of those through contact, metres, and the poses in which they go through them.
const GRAZE: (f64, f64) = (1e-6, 0.01);
const CONTACT: (f64, f64) = (-0.05, 0.01);
const PERIOD: f64 = 90.0;

/// SplitMix64 (Steele, Lea, Flood 2014): the same motions everywhere.
struct Random(u64);

impl Random {
    /// Uniform in [-1, 1).
    fn signed(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    /// Uniform on the sphere.
    fn direction(&mut self) -> Vector3<f64> {
        loop {
            let v = Vector3::from_fn(|_, _| self.signed());
            if (0.1..1.0).contains(&v.norm()) {
                return v.normalize();
            }
        }
    }
}

/// A body on its way: where its middle is, how it is turned, where it goes and about which axis it turns.
struct Walk {
    middle: Vector3<f64>,
    position: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    heading: Vector3<f64>,
    axis: Vector3<f64>,
    random: Random,
}

impl Walk {
    /// Starts clear of `a` in a random direction.
    fn new(a: &Body, b: &Body, seed: u64) -> Self {
        let mut random = Random(seed);
        let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
        let position = ball_a.center + random.direction() * (ball_a.radius + ball_b.radius + MIDDLE);
        let rotation = UnitQuaternion::new(random.direction() * (TAU * random.signed()));
        let (heading, axis) = (random.direction(), random.direction());
        Self { middle: ball_b.center, position, rotation, heading, axis, random }
    }

    fn pose(&self) -> Result<Pose, PoseError> {
        Pose::from_quaternion(self.position - self.rotation * self.middle, self.rotation.coords.into())
    }

    /// One step; `steer` changes the heading first.
    fn step(&mut self, steer: impl FnOnce(Vector3<f64>) -> Vector3<f64>) {
        let wander = self.random.direction() * WANDER;
        self.heading = steer(self.heading + wander).normalize();
        self.axis = (self.axis + self.random.direction() * WANDER).normalize();
        self.position += self.heading * STEP;
        self.rotation = UnitQuaternion::new(self.axis * TURN) * self.rotation;
    }
}

/// Motions on which every one of these pairs stays apart.
pub(crate) fn separated(
    pairs: &[(&Body, &Body)],
    trajectories: usize,
    poses: usize,
) -> Result<Vec<Trajectory>, PoseError> {
    let mut found = Vec::new();
    let mut seed = 0;
    while found.len() < trajectories {
        seed += 1;
        found.extend(try_separated(pairs, poses, seed)?);
    }
    Ok(found)
}

/// None where the bodies came too close.
fn try_separated(pairs: &[(&Body, &Body)], poses: usize, seed: u64) -> Result<Option<Trajectory>, PoseError> {
    let Some((a, b)) = pairs.first() else { return Ok(None) };
    let mut walk = Walk::new(a, b, seed);
    let mut trajectory = Vec::new();
    while trajectory.len() < poses {
        let pose = walk.pose()?;
        let answers = pairs.iter().map(|(a, b)| gap(a, b, &pose, &mut WarmStart::default()));
        let Some((gap, normal)) = answers.min_by(|x, y| x.0.total_cmp(&y.0)) else { return Ok(None) };
        let Some(normal) = normal.filter(|_| gap >= CLEAR) else { return Ok(None) };
        // Within reach only: the way there is no part of the motion.
        if gap <= MIDDLE + HALF_RANGE || !trajectory.is_empty() {
            trajectory.push(pose);
        }
        // The normal points from b to a: along it b comes closer.
        let pull = ((gap - MIDDLE) / HALF_RANGE).powi(3).clamp(-2.0, 2.0);
        walk.step(|heading| heading + normal * (0.2 * pull));
    }
    Ok(Some(trajectory))
}

/// Motions of one body along the other with the gap going up and down through [`GRAZE`].
pub(crate) fn grazing(a: &Body, b: &Body, trajectories: usize, poses: usize) -> Result<Vec<Trajectory>, PoseError> {
    along(a, b, trajectories, poses, GRAZE, settle)
}

/// Motions of one body along the other with the gap going up and down through [`CONTACT`].
pub(crate) fn through_contact(
    a: &Body,
    b: &Body,
    trajectories: usize,
    poses: usize,
) -> Result<Vec<Trajectory>, PoseError> {
    along(a, b, trajectories, poses, CONTACT, settle_signed)
}

/// Moves a body until its gap to another is as wanted, from the normal of the pose before and with its hint; tells the new
/// normal.
type Settle = fn(&mut Walk, &Body, &Body, f64, Vector3<f64>, &mut WarmStart) -> Result<Vector3<f64>, PoseError>;

/// Motions of one body along the other with the gap going up and down through a range.
///
/// The step along the surface is a centimetre; turning adds what brings the gap back.
fn along(
    a: &Body,
    b: &Body,
    trajectories: usize,
    poses: usize,
    (least, most): (f64, f64),
    settle: Settle,
) -> Result<Vec<Trajectory>, PoseError> {
    (1..=trajectories as u64)
        .map(|seed| {
            let mut walk = Walk::new(a, b, seed);
            let mut warm = WarmStart::default();
            let mut normal = Vector3::x();
            let mut trajectory = Vec::new();
            for pose in 0..poses {
                let phase = TAU * pose as f64 / PERIOD;
                let wanted = least + (most - least) * 0.5 * (1.0 - phase.cos());
                normal = settle(&mut walk, a, b, wanted, normal, &mut warm)?;
                trajectory.push(walk.pose()?);
                walk.step(|heading| heading - normal * normal.dot(&heading));
            }
            Ok(trajectory)
        })
        .collect()
}

/// Moves the body along the normal until the gap is as wanted. One move is exact: the distance is convex in the translation
/// and falls along the normal with slope 1.
fn settle(
    walk: &mut Walk,
    a: &Body,
    b: &Body,
    wanted: f64,
    mut normal: Vector3<f64>,
    warm: &mut WarmStart,
) -> Result<Vector3<f64>, PoseError> {
    // Overlapping bodies are drawn apart by steps first, which is soon done.
    for _ in 0..1000 {
        let (gap, found) = gap(a, b, &walk.pose()?, warm);
        let Some(found) = found.filter(|_| gap > 0.0) else {
            walk.position -= normal * STEP;
            continue;
        };
        normal = found;
        walk.position += normal * (gap - wanted);
        if (gap - wanted).abs() <= 0.1 * GRAZE.0 {
            break;
        }
    }
    Ok(normal)
}

/// The same by the signed distance. In overlap a move to another face may be shorter by then: a few moves come close.
fn settle_signed(
    walk: &mut Walk,
    a: &Body,
    b: &Body,
    wanted: f64,
    mut normal: Vector3<f64>,
    warm: &mut WarmStart,
) -> Result<Vector3<f64>, PoseError> {
    for _ in 0..10 {
        let answer = signed_distance(a, &Pose::identity(), b, &walk.pose()?, &Options::default(), warm);
        normal = answer.normal.unwrap_or(normal);
        walk.position += normal * (answer.value() - wanted);
        if (answer.value() - wanted).abs() <= 0.01 * (CONTACT.1 - CONTACT.0) {
            break;
        }
    }
    Ok(normal)
}

/// Poses that have nothing to do with each other in all of which the bodies overlap, from all but apart to all but
/// concentric.
pub(crate) fn overlapping(a: &Body, b: &Body, trajectories: usize, poses: usize) -> Result<Vec<Trajectory>, PoseError> {
    let mut random = Random(0);
    let reach = a.circumscribed().radius + b.circumscribed().radius;
    let mut draw = || {
        let rotation = UnitQuaternion::new(random.direction() * (TAU * random.signed()));
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

/// Screw motions of both bodies that start in these poses, two seconds of which bring their middles about together.
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

/// Distance proven, and the normal from `b` to `a`.
fn gap(a: &Body, b: &Body, pose: &Pose, warm: &mut WarmStart) -> (f64, Option<Vector3<f64>>) {
    let answer = distance(a, &Pose::identity(), b, pose, &Options::default(), warm);
    (answer.lower, answer.normal)
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

/// The poses as text: `r00 r01 r02 r10 .. r22 tx ty tz` on a line each, an empty line after each trajectory.
pub(crate) fn to_text(trajectories: &[Trajectory]) -> String {
    let mut text = String::new();
    for trajectory in trajectories {
        for pose in trajectory {
            let rotation = pose.rotation().to_rotation_matrix();
            // Stored by columns; the text goes by rows. Writing to a string can not fail.
            let rows = rotation.matrix().transpose();
            for number in rows.iter() {
                let _ = write!(text, "{number:e} ");
            }
            let t = pose.translation();
            let _ = writeln!(text, "{:e} {:e} {:e}", t.x, t.y, t.z);
        }
        text.push('\n');
    }
    text
}
