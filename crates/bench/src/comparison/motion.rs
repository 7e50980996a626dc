//! Smooth motions of one body about another in steps of one centimetre and one degree, for objects
//! of about two metres; those of other sizes move in proportion.

use super::Random;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::TAU;
use std::fmt::Write;
use sublevel::body::{Body, Solid};
use sublevel::measure::{Options, Pose, PoseError, WarmStart, distance, signed_distance};

/// Poses of `b` in the frame of `a`.
pub type Trajectory = Vec<Pose>;

/// Translation from pose to pose, metres at the usual size.
const STEP: f64 = 0.01;
/// Rotation from pose to pose, radians.
const TURN: f64 = TAU / 360.0;
/// How much the directions of translation and rotation change in a step, radians.
const WANDER: f64 = 0.05;

/// The gap that separated motions keep about, and how far from it they are steered back with full
/// strength, metres.
const MIDDLE: f64 = 0.4;
const HALF_RANGE: f64 = 0.35;
/// Below this gap of any pair a separated motion is discarded, metres.
const CLEAR: f64 = 0.01;

/// Ranges of the gap of grazing motions and of those through contact, metres, and the poses in
/// which they go through them.
const GRAZE: (f64, f64) = (1e-6, 0.01);
const CONTACT: (f64, f64) = (-0.05, 0.01);
const PERIOD: f64 = 90.0;

/// A body on its way: where its middle is, how it is turned, where it goes and about which axis it
/// turns.
struct Walk {
    middle: Vector3<f64>,
    position: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    heading: Vector3<f64>,
    axis: Vector3<f64>,
    random: Random,
    /// Translation of a step, metres.
    stride: f64,
}

impl Walk {
    /// Starts clear of `a` in a random direction; all lengths are in units of so many metres.
    fn new(a: &impl Solid, b: &impl Solid, unit_m: f64, seed: u64) -> Self {
        let mut random = Random(seed);
        let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
        let position = ball_a.center + random.direction() * (ball_a.radius + ball_b.radius + unit_m * MIDDLE);
        let rotation = random.rotation();
        let (heading, axis) = (random.direction(), random.direction());
        Self { middle: ball_b.center, position, rotation, heading, axis, random, stride: unit_m * STEP }
    }

    fn pose(&self) -> Result<Pose, PoseError> {
        Pose::from_quaternion(self.position - self.rotation * self.middle, self.rotation.coords.into())
    }

    /// One step; `steer` changes the heading first.
    fn step(&mut self, steer: impl FnOnce(Vector3<f64>) -> Vector3<f64>) {
        let wander = self.random.direction() * WANDER;
        self.heading = steer(self.heading + wander).normalize();
        self.axis = (self.axis + self.random.direction() * WANDER).normalize();
        self.position += self.heading * self.stride;
        self.rotation = UnitQuaternion::new(self.axis * TURN) * self.rotation;
    }
}

/// Motions on which every one of these pairs stays apart, the closest of them mostly by 5 to 75 cm,
/// in units of so many metres.
///
/// # Errors
/// None that could be met: a pose that is no pose.
pub fn separated<S: Solid>(
    pairs: &[(&S, &S)],
    unit_m: f64,
    trajectories: usize,
    poses: usize,
) -> Result<Vec<Trajectory>, PoseError> {
    let mut found = Vec::new();
    let mut seed = 0;
    while found.len() < trajectories {
        seed += 1;
        found.extend(try_separated(pairs, unit_m, poses, seed)?);
    }
    Ok(found)
}

/// None where the bodies came too close.
fn try_separated<S: Solid>(
    pairs: &[(&S, &S)],
    unit_m: f64,
    poses: usize,
    seed: u64,
) -> Result<Option<Trajectory>, PoseError> {
    let Some(&(a, b)) = pairs.first() else { return Ok(None) };
    let mut walk = Walk::new(a, b, unit_m, seed);
    let mut trajectory = Vec::new();
    while trajectory.len() < poses {
        let pose = walk.pose()?;
        let answers = pairs.iter().map(|&(a, b)| gap(a, b, &pose, &mut WarmStart::default()));
        let Some((gap, normal)) = answers.min_by(|x, y| x.0.total_cmp(&y.0)) else { return Ok(None) };
        let Some(normal) = normal.filter(|_| gap >= unit_m * CLEAR) else { return Ok(None) };
        // Within reach only: the way there is no part of the motion.
        if gap <= unit_m * (MIDDLE + HALF_RANGE) || !trajectory.is_empty() {
            trajectory.push(pose);
        }
        // The normal points from b to a: along it b comes closer.
        let pull = ((gap / unit_m - MIDDLE) / HALF_RANGE).powi(3).clamp(-2.0, 2.0);
        walk.step(|heading| heading + normal * (0.2 * pull));
    }
    Ok(Some(trajectory))
}

/// Motions of steps of one size in all directions, `step` being both their length in units of so
/// many metres and their angle in hundredths of its degrees: 0.01 is the usual step of a centimetre
/// and a degree. Without a step, poses that have nothing to do with each other. The gap stays where
/// that of [`separated`] motions does.
///
/// # Errors
/// None that could be met: a pose that is no pose.
pub fn stepping<S: Solid>(
    (a, b): (&S, &S),
    unit_m: f64,
    step: Option<f64>,
    trajectories: usize,
    poses: usize,
) -> Result<Vec<Trajectory>, PoseError> {
    let wanted = unit_m * CLEAR..=unit_m * (MIDDLE + HALF_RANGE);
    let one = |seed| {
        let mut walk = Walk::new(a, b, unit_m, seed);
        let mut trajectory: Trajectory = Vec::new();
        while trajectory.len() < poses {
            let mut next = Walk { random: walk.random.clone(), ..walk };
            match step {
                // The first pose is anywhere, too.
                Some(step) if !trajectory.is_empty() => {
                    next.position += next.random.direction() * (unit_m * step);
                    let angle = (TURN / STEP * step).min(0.5 * TAU);
                    next.rotation = UnitQuaternion::new(next.random.direction() * angle) * next.rotation;
                }
                _ => {
                    let reach = a.circumscribed().radius + b.circumscribed().radius + unit_m * MIDDLE;
                    next.position = a.circumscribed().center + next.random.direction() * (reach * next.random.signed());
                    next.rotation = next.random.rotation();
                }
            }
            // Rejected or not, the next try is another one.
            walk.random = next.random.clone();
            let pose = next.pose()?;
            if wanted.contains(&gap(a, b, &pose, &mut WarmStart::default()).0) {
                trajectory.push(pose);
                walk = next;
            }
        }
        Ok(trajectory)
    };
    (1..=trajectories as u64).map(one).collect()
}

/// Motions of one body along the other with the gap going up and down between a micrometre and a
/// centimetre.
///
/// # Errors
/// None that could be met: a pose that is no pose.
pub fn grazing(a: &Body, b: &Body, trajectories: usize, poses: usize) -> Result<Vec<Trajectory>, PoseError> {
    along((a, b), trajectories, poses, GRAZE, settle)
}

/// Motions of one body along the other with the gap going up and down from a centimetre apart to
/// five deep.
///
/// # Errors
/// None that could be met: a pose that is no pose.
pub fn through_contact(a: &Body, b: &Body, trajectories: usize, poses: usize) -> Result<Vec<Trajectory>, PoseError> {
    along((a, b), trajectories, poses, CONTACT, settle_signed)
}

/// Moves a body until its gap to another is as wanted, from the normal of the pose before and with
/// its hint; returns the new normal.
type Settle = fn(&mut Walk, (&Body, &Body), f64, Vector3<f64>, &mut WarmStart) -> Result<Vector3<f64>, PoseError>;

/// Motions of one body along the other with the gap going up and down through a range.
///
/// The step along the surface is a centimetre; turning adds what brings the gap back.
fn along(
    (a, b): (&Body, &Body),
    trajectories: usize,
    poses: usize,
    (least, most): (f64, f64),
    settle: Settle,
) -> Result<Vec<Trajectory>, PoseError> {
    (1..=trajectories as u64)
        .map(|seed| {
            let mut walk = Walk::new(a, b, 1.0, seed);
            let mut warm = WarmStart::default();
            let mut normal = Vector3::x();
            let mut trajectory = Vec::new();
            for pose in 0..poses {
                let phase = TAU * pose as f64 / PERIOD;
                let wanted = least + (most - least) * 0.5 * (1.0 - phase.cos());
                normal = settle(&mut walk, (a, b), wanted, normal, &mut warm)?;
                trajectory.push(walk.pose()?);
                walk.step(|heading| heading - normal * normal.dot(&heading));
            }
            Ok(trajectory)
        })
        .collect()
}

/// Moves the body along the normal until the gap is as wanted. One move is exact: the distance is
/// convex in the translation and decreases along the normal with slope 1.
fn settle(
    walk: &mut Walk,
    (a, b): (&Body, &Body),
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

/// The same by the signed distance. In overlap a move to another face may be shorter by then: a few
/// moves come close.
fn settle_signed(
    walk: &mut Walk,
    (a, b): (&Body, &Body),
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

/// Distance proven, and the normal from `b` to `a`.
fn gap(a: &impl Solid, b: &impl Solid, pose: &Pose, warm: &mut WarmStart) -> (f64, Option<Vector3<f64>>) {
    let answer = distance(a, &Pose::identity(), b, pose, &Options::default(), warm);
    (answer.lower, answer.normal)
}

/// The poses as text: `r00 r01 r02 r10 .. r22 tx ty tz` on a line each, an empty line after each
/// trajectory.
pub fn to_text(trajectories: &[Trajectory]) -> String {
    let mut text = String::new();
    for trajectory in trajectories {
        for pose in trajectory {
            let rotation = pose.rotation().to_rotation_matrix();
            // Stored by columns; the text goes by rows. Writing to a string cannot fail.
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
