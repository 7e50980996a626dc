//! Planning problems: where the arm starts, where it is to go, and what stands in its way.

use std::collections::BTreeMap;
use std::error::Error;
use std::fmt::Write;
use std::path::Path;

use nalgebra::Vector3;
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

impl Obstacle {
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
            let obstacles = family[0].obstacles().expect("boxes and cylinders");
            assert!(obstacles.iter().all(|(body, _)| body.gap_m() == Some(0.0)), "{}", family[0].family);
        }
    }
}
