//! Planning problems: where the arm starts, where it is to go, and what stands in its way.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

use nalgebra::{Isometry3, Point3, Vector2, Vector3};
use serde::Deserialize;
use sublevel::body::Body;
use sublevel::cli::read;
use sublevel::measure::{Pose, PoseError};
use sublevel::robot::Kinematics;

/// A planning problem.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct Problem {
    /// Its family.
    #[serde(rename = "set")]
    pub(crate) family: String,
    start: BTreeMap<String, f64>,
    goal: BTreeMap<String, f64>,
    obstacles: Vec<Obstacle>,
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

/// Reads a file of problems.
///
/// # Errors
/// A file that is missing or none of problems.
pub(crate) fn read_problems(path: &Path) -> Result<Vec<Problem>, Box<dyn Error>> {
    #[derive(Deserialize)]
    struct File {
        problems: Vec<Problem>,
    }
    let file: File = serde_json::from_str(&read(path)?).map_err(|error| format!("{}: {error}", path.display()))?;
    if file.problems.is_empty() {
        return Err(format!("{}: holds no problems", path.display()).into());
    }
    Ok(file.problems)
}

/// The problems of each family, at most so many, in the order in which families come first.
pub(crate) fn families(problems: &[Problem], most: usize) -> Vec<Vec<&Problem>> {
    let mut families: Vec<Vec<&Problem>> = Vec::new();
    for problem in problems {
        match families.iter_mut().find(|family| family[0].family == problem.family) {
            Some(family) if family.len() < most => family.push(problem),
            Some(_) => {}
            None => families.push(vec![problem]),
        }
    }
    families
}

impl Problem {
    /// Start and goal in the order of the joints, radians.
    pub(super) fn ends(&self, kinematics: &Kinematics) -> Result<[Vec<f64>; 2], Box<dyn Error>> {
        let packed = |values: &BTreeMap<String, f64>| {
            let value = |name: &str| values.get(name).copied().ok_or_else(|| format!("no value of joint {name}"));
            kinematics.variables().iter().map(|variable| value(&variable.name)).collect::<Result<Vec<f64>, _>>()
        };
        Ok([packed(&self.start)?, packed(&self.goal)?])
    }

    /// Bodies of the obstacles, exact, with their poses.
    pub(super) fn obstacles(&self) -> Result<Vec<(Body, Pose)>, Box<dyn Error>> {
        let place = |(index, obstacle): (usize, &Obstacle)| {
            let body = obstacle.body().map_err(|error| format!("obstacle {index} of {}: {error}", self.family))?;
            Ok((body, obstacle.pose()?))
        };
        self.obstacles.iter().enumerate().map(place).collect()
    }

    /// The obstacles as points and triangles see them.
    pub(super) fn solids(&self) -> Result<Vec<SolidObstacle>, Box<dyn Error>> {
        self.obstacles.iter().map(Obstacle::solid).collect()
    }

    /// Number of obstacles.
    pub(super) fn obstacle_count(&self) -> usize {
        self.obstacles.len()
    }

    /// The lines of its obstacles as the program that times coal reads them.
    pub(super) fn obstacle_lines(&self) -> String {
        let mut text = String::new();
        for Obstacle { kind, dims, pos, quat } in &self.obstacles {
            text += kind;
            for number in dims.iter().chain(pos).chain(quat) {
                // Writing to a string cannot fail.
                let _ = write!(text, " {number}");
            }
            text.push('\n');
        }
        text
    }
}

/// A box or a cylinder where it stands.
#[derive(Clone, Debug)]
pub(super) struct SolidObstacle {
    /// Half the edges of a box; radius, radius and half the height of a cylinder about z, metres.
    half: Vector3<f64>,
    is_round: bool,
    frame: Isometry3<f64>,
}

/// Sides of the prism inside a cylinder.
const SIDES: usize = 32;

/// Nothing less deep inside an obstacle is said to be inside, metres: rounding is below 1e-14.
const INSIDE_M: f64 = 1e-9;

impl SolidObstacle {
    /// Whether a point of the world is inside.
    pub(super) fn contains(&self, point: &Vector3<f64>) -> bool {
        let at = self.frame.inverse_transform_point(&Point3::from(*point)).coords;
        let across = if self.is_round {
            at.xy().norm() < self.half.x - INSIDE_M
        } else {
            at.x.abs() < self.half.x - INSIDE_M && at.y.abs() < self.half.y - INSIDE_M
        };
        across && at.z.abs() < self.half.z - INSIDE_M
    }

    /// Triangles of its surface, world frame, metres; those of a cylinder make a prism inside it.
    pub(super) fn triangles(&self) -> Vec<[Vector3<f64>; 3]> {
        let [x, y, z] = self.half.into();
        let corner = |side: usize| {
            let (sine, cosine) = (std::f64::consts::TAU * side as f64 / SIDES as f64).sin_cos();
            if self.is_round {
                Vector2::new(x * cosine, y * sine)
            } else {
                [Vector2::new(x, y), Vector2::new(-x, y), Vector2::new(-x, -y), Vector2::new(x, -y)][side]
            }
        };
        let sides = if self.is_round { SIDES } else { 4 };
        let at = |side: usize, z: f64| {
            let corner = corner(side % sides);
            (self.frame * Point3::new(corner.x, corner.y, z)).coords
        };
        let walls = (0..sides).flat_map(|side| {
            let [a, b, c, d] = [at(side, -z), at(side + 1, -z), at(side + 1, z), at(side, z)];
            [[a, b, c], [a, c, d]]
        });
        let caps =
            [-z, z].into_iter().flat_map(|z| (1..sides - 1).map(move |side| [0, side, side + 1].map(|side| (side, z))));
        walls.chain(caps.map(|corners| corners.map(|(side, z)| at(side, z)))).collect()
    }
}

impl Obstacle {
    fn solid(&self) -> Result<SolidObstacle, Box<dyn Error>> {
        let (half, is_round) = match (&self.kind[..], &self.dims[..]) {
            ("box", &[x, y, z]) => (0.5 * Vector3::new(x, y, z), false),
            ("cylinder", &[height, radius]) => (Vector3::new(radius, radius, 0.5 * height), true),
            (kind, dims) => return Err(format!("is a {kind} of {} numbers", dims.len()).into()),
        };
        let pose = self.pose()?;
        let frame = Isometry3::from_parts((*pose.translation()).into(), *pose.rotation());
        Ok(SolidObstacle { half, is_round, frame })
    }

    fn body(&self) -> Result<Body, Box<dyn Error>> {
        let body = match (&self.kind[..], &self.dims[..]) {
            ("box", &[x, y, z]) => Body::cuboid("box", 0.5 * Vector3::new(x, y, z))?,
            ("cylinder", &[height, radius]) => Body::cylinder("cylinder", radius, 0.5 * height)?,
            (kind, dims) => return Err(format!("is a {kind} of {} numbers", dims.len()).into()),
        };
        Ok(body.with_gap(0.0))
    }

    fn pose(&self) -> Result<Pose, PoseError> {
        Pose::from_quaternion(self.pos.into(), self.quat)
    }
}

#[cfg(test)]
mod tests {
    use sublevel_testkit::data;

    use super::*;
    use crate::comparison::Random;
    use crate::panda::arm::Arm;

    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn the_problems_of_the_data_are_read() {
        let problems = read_problems(&data("panda/panda_problems.json")).expect("problems");
        let arm = Arm::read(&data("")).expect("the files of the arm");
        let all = families(&problems, usize::MAX);
        assert_eq!((problems.len(), all.len(), all.iter().map(Vec::len).sum::<usize>()), (700, 7, 700));
        assert!(families(&problems, 3).iter().all(|family| family.len() == 3));
        for problem in &problems {
            let [start, goal] = problem.ends(&arm.kinematics).expect("values of all joints");
            assert_eq!((arm.kinematics.check(&start), arm.kinematics.check(&goal)), (Ok(()), Ok(())));
            assert_eq!(problem.obstacle_count(), problem.obstacle_lines().lines().count());
        }
        for family in families(&problems, 1) {
            for ((body, pose), solid) in
                family[0].obstacles().expect("bodies").iter().zip(family[0].solids().expect("solids"))
            {
                // The corners are on the surface, and reach as far as the body, but for a prism in
                // a cylinder.
                let triangles = solid.triangles();
                let local = |corner: &Vector3<f64>| pose.rotation().inverse() * (corner - pose.translation());
                for corner in triangles.iter().flatten() {
                    let toward = |part: f64| pose.translation() + (corner - pose.translation()) * part;
                    assert!(solid.contains(&toward(0.999)) && !solid.contains(&toward(1.001)), "{corner}");
                }
                let mut random = Random(1);
                for _ in 0..50 {
                    let n = Vector3::from_fn(|_, _| random.positive() - 0.5).normalize();
                    let farthest = triangles.iter().flatten().map(|corner| n.dot(&local(corner))).fold(0.0, f64::max);
                    let exact = n.dot(&body.support(&n).point);
                    assert!(farthest <= exact + 1e-9 && farthest > 0.99 * exact, "{farthest} {exact}");
                }
                let of = |[a, b, c]: &[Vector3<f64>; 3]| local(a).dot(&local(b).cross(&local(c))).abs() / 6.0;
                let (volume, box_volume) = (triangles.iter().map(of).sum::<f64>(), 8.0 * solid.half.product());
                let exact = if solid.is_round { std::f64::consts::FRAC_PI_4 * box_volume } else { box_volume };
                assert!(volume <= exact * (1.0 + 1e-9) && volume > 0.99 * exact, "{volume} {exact}");
            }
            let obstacles = family[0].obstacles().expect("boxes and cylinders");
            assert!(obstacles.iter().all(|(body, _)| body.gap_m() == Some(0.0)), "{}", family[0].family);
        }
    }
}
