//! The planning problems of a Franka Emika Panda: its links in many states among obstacles.

use std::error::Error;
use std::f64::consts::{FRAC_PI_2, FRAC_PI_4, PI};
use std::path::Path;

use nalgebra::{Isometry3, Translation3, UnitQuaternion, Vector3};
use serde::Deserialize;
use sublevel::body::{Body, BodyId};
use sublevel::cli::read;
use sublevel::fit::{FitOptions, ReadOptions, read_mesh};
use sublevel::measure::{Pose, PoseError};
use sublevel::scene::{Geometry, Scene, Subject, Update};

use super::bricks::placement;
use crate::comparison::{FitCache, Random};

/// Frame of each joint in the frame of the link before: a turn about x (radians), then where it is
/// (metres). Each joint turns about its z. From the robot's URDF.
const JOINTS: [(f64, [f64; 3]); 7] = [
    (0.0, [0.0, 0.0, 0.333]),
    (-FRAC_PI_2, [0.0, 0.0, 0.0]),
    (FRAC_PI_2, [0.0, -0.316, 0.0]),
    (FRAC_PI_2, [0.0825, 0.0, 0.0]),
    (-FRAC_PI_2, [-0.0825, 0.384, 0.0]),
    (FRAC_PI_2, [0.0, 0.0, 0.0]),
    (FRAC_PI_2, [0.088, 0.0, 0.0]),
];
/// From the last joint to the hand: along z (metres) and a turn about it (radians).
const HAND: (f64, f64) = (0.107, -FRAC_PI_4);
/// The open fingers in the frame of the hand, metres.
const FINGERS: [f64; 2] = [0.065, 0.0584];
/// Limits of the joints, radians.
const LIMITS: [[f64; 2]; 7] = [
    [-2.8973, 2.8973],
    [-1.7628, 1.7628],
    [-2.8973, 2.8973],
    [-3.0718, -0.0698],
    [-2.8973, 2.8973],
    [-0.0175, 3.7525],
    [-2.8973, 2.8973],
];
/// Links by the names of their meshes, in the order of [`forward`].
const LINKS: [&str; 11] =
    ["link0", "link1", "link2", "link3", "link4", "link5", "link6", "link7", "hand", "finger", "finger"];
/// States of a problem: half on the straight path of the joints, half anywhere.
const STATES: usize = 1000;

/// A planning problem.
#[derive(Clone, Debug, Deserialize)]
pub(super) struct Problem {
    pub(super) set: String,
    start: Joints,
    goal: Joints,
    obstacles: Vec<Obstacle>,
}

#[derive(Clone, Debug, Deserialize)]
struct Joints {
    panda_joint1: f64,
    panda_joint2: f64,
    panda_joint3: f64,
    panda_joint4: f64,
    panda_joint5: f64,
    panda_joint6: f64,
    panda_joint7: f64,
}

/// A box by its edges, or a cylinder about z by its height and radius; metres, x y z w.
#[derive(Clone, Debug, Deserialize)]
struct Obstacle {
    #[serde(rename = "type")]
    kind: String,
    dims: Vec<f64>,
    pos: [f64; 3],
    quat: [f64; 4],
}

/// What a scene of a problem is made of.
pub(super) struct Task {
    pub(super) set: String,
    pub(super) bodies: Vec<Body>,
    /// The links, then the obstacles; pairs of links that touch at the start may do so.
    pub(super) update: Update,
    pub(super) links: Vec<String>,
    /// Poses of the links, state after state.
    pub(super) states: Vec<Pose>,
}

impl Task {
    /// The scene, in process.
    pub(super) fn scene(&self) -> Result<Scene, Box<dyn Error>> {
        let body = |id: &BodyId| self.bodies.iter().find(|body| body.id() == id).cloned().map(Geometry::from);
        Ok(Scene::new("task", 0)?.updated(&self.update, body)?)
    }
}

/// The first problem of each of so many sets.
pub(super) fn problems(data: &Path, count: usize) -> Result<Vec<Problem>, Box<dyn Error>> {
    #[derive(Deserialize)]
    struct File {
        problems: Vec<Problem>,
    }
    let path = data.join("panda/panda_problems.json");
    let file: File = serde_json::from_str(&read(&path)?).map_err(|error| format!("{}: {error}", path.display()))?;
    let mut first: Vec<Problem> = Vec::new();
    for problem in file.problems {
        if first.iter().all(|other| other.set != problem.set) {
            first.push(problem);
        }
    }
    first.truncate(count);
    Ok(first)
}

/// The robot, with bodies of degree 6 around its links, and the obstacles, exact.
pub(super) fn task(problem: &Problem, data: &Path, cache: &FitCache) -> Result<Task, Box<dyn Error>> {
    let options = FitOptions { degree: 6, ..FitOptions::default() };
    let (mut bodies, mut update, mut links) = (Vec::new(), Update::default(), Vec::new());
    let [start, goal] = [&problem.start, &problem.goal].map(Joints::angles);
    for (index, (mesh, pose)) in LINKS.iter().zip(forward(&start)?).enumerate() {
        let path = data.join("panda/meshes/collision").join(format!("{mesh}.obj"));
        let mesh_of_link = read_mesh(&path, &ReadOptions::default())?.mesh;
        let body = cache.body(&format!("panda-{mesh}"), &mesh_of_link, &options)?;
        let name = format!("{index:02} {mesh}");
        update.upserts.push(placement(&name, body.id(), pose));
        links.push(name);
        bodies.push(body);
    }
    for (index, Obstacle { kind, dims, pos, quat }) in problem.obstacles.iter().enumerate() {
        let body = match (&kind[..], &dims[..]) {
            ("box", &[x, y, z]) => Body::cuboid("box", 0.5 * Vector3::new(x, y, z))?,
            ("cylinder", &[height, radius]) => Body::cylinder("cylinder", radius, 0.5 * height)?,
            _ => {
                return Err(format!("obstacle {index} of {} is a {kind} of {} numbers", problem.set, dims.len()).into());
            }
        };
        let body = body.with_gap(0.0);
        let pose = Pose::from_quaternion((*pos).into(), *quat)?;
        update.upserts.push(placement(&format!("obstacle {index:02}"), body.id(), pose));
        bodies.push(body);
    }
    let mut task = Task { set: problem.set.clone(), bodies, update, links, states: Vec::new() };
    allow_what_touches(&mut task)?;
    let mut random = Random(5);
    for index in 0..STATES {
        let angles: [f64; 7] = if index < STATES / 2 {
            let part = index as f64 / (STATES / 2 - 1) as f64;
            std::array::from_fn(|joint| start[joint] + part * (goal[joint] - start[joint]))
        } else {
            LIMITS.map(|[low, high]| low + (high - low) * random.positive())
        };
        task.states.extend(forward(&angles)?);
    }
    Ok(task)
}

/// Pairs of links that touch at the start may touch, and those of neighbours.
fn allow_what_touches(task: &mut Task) -> Result<(), Box<dyn Error>> {
    let scene = task.scene()?;
    let pair = |a: &String, b: &String| (Subject::Object(a.as_str().into()), Subject::Object(b.as_str().into()));
    let solid = |name: &str| -> Option<(&sublevel::body::Shape, &Pose)> {
        let slot = scene.slot(name)?;
        let Geometry::Solid(shape) = &scene.object(slot)?.geometry else { return None };
        Some((shape, scene.pose(slot)?))
    };
    for (i, a) in task.links.iter().enumerate() {
        for (j, b) in task.links.iter().enumerate().skip(i + 1) {
            let (Some((of_a, at_a)), Some((of_b, at_b))) = (solid(a), solid(b)) else { continue };
            let decision =
                sublevel::measure::overlap(of_a, at_a, of_b, at_b, &Default::default(), &mut Default::default());
            if j == i + 1 || decision != sublevel::measure::Decision::No {
                task.update.allow.push(pair(a, b));
            }
        }
    }
    Ok(())
}

impl Joints {
    fn angles(&self) -> [f64; 7] {
        let Self { panda_joint1, panda_joint2, panda_joint3, panda_joint4, panda_joint5, panda_joint6, panda_joint7 } =
            *self;
        [panda_joint1, panda_joint2, panda_joint3, panda_joint4, panda_joint5, panda_joint6, panda_joint7]
    }
}

/// World poses of all links for the angles of the joints, radians.
fn forward(angles: &[f64; 7]) -> Result<Vec<Pose>, PoseError> {
    let turn = |axis: Vector3<f64>, angle: f64| UnitQuaternion::new(axis * angle);
    let place = |[x, y, z]: [f64; 3], rotation| Isometry3::from_parts(Translation3::new(x, y, z), rotation);
    let mut frames = vec![Isometry3::identity()];
    let mut frame = Isometry3::identity();
    for ((about_x, at), angle) in JOINTS.iter().zip(angles) {
        frame *= place(*at, turn(Vector3::x(), *about_x) * turn(Vector3::z(), *angle));
        frames.push(frame);
    }
    let hand = frame * place([0.0, 0.0, HAND.0], turn(Vector3::z(), HAND.1));
    let [aside, ahead] = FINGERS;
    frames.extend([
        hand,
        hand * place([0.0, aside, ahead], UnitQuaternion::identity()),
        hand * place([0.0, -aside, ahead], turn(Vector3::z(), PI)),
    ]);
    frames.iter().map(|frame| Pose::from_quaternion(frame.translation.vector, frame.rotation.coords.into())).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_arm_is_as_long_as_its_joints_say() {
        let upright = forward(&[0.0; 7]).unwrap();
        let hand = upright[8].translation();
        // 0.333 + 0.316 + 0.384 up, then the wrist hangs down.
        assert!((hand - Vector3::new(0.088, 0.0, 0.926)).norm() < 1e-12, "{hand:?}");
        let turned = forward(&[PI, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]).unwrap();
        assert!((turned[8].translation() - Vector3::new(-0.088, 0.0, 0.926)).norm() < 1e-12);
        assert!((turned[9].translation() - turned[10].translation()).norm() - 0.13 < 1e-12);
    }
}
