//! Coal on the same states: hulls of the links against exact obstacles, by a program that times it
//! in a process of its own.

use std::error::Error;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::process::Command;

use serde::Deserialize;

use super::arm::Arm;
use super::place::BASE_LINK;
use super::problems::Problem;
use crate::comparison::peer::{named, printed};
use crate::comparison::{PeerError, version_beside};

/// The program: `program MESHES STATES` reads hulls, obstacles and poses of links, and prints its
/// times as JSON.
#[derive(Clone, Debug)]
pub(super) struct CoalPanda {
    program: PathBuf,
    meshes: PathBuf,
}

/// A file of states that it reads.
pub(super) struct CoalStates<'a> {
    coal: &'a CoalPanda,
    path: PathBuf,
    states: usize,
}

/// What it says of a file: the median of its passes.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(super) struct CoalTimes {
    /// Contact or not, nothing known before.
    pub(super) collide_cold: CoalPass,
    /// Contact or not, with the guesses of the state before.
    pub(super) collide_warm: CoalPass,
    /// Distances of all pairs.
    pub(super) distance_all: CoalPass,
}

/// A question put to all states.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(super) struct CoalPass {
    /// Microseconds.
    pub(super) us_per_state: f64,
    /// States in contact.
    pub(super) contacts: usize,
}

impl CoalPanda {
    /// As `SUBLEVEL_COAL_PANDA` says; none if it says nothing.
    pub(super) fn from_environment(arm: &Arm) -> Result<Option<Self>, PeerError> {
        let program = named("SUBLEVEL_COAL_PANDA", "the program that times coal on states of the Panda")?;
        Ok(program.map(|program| Self { program, meshes: arm.meshes.clone() }))
    }

    /// The version of the wheel it was built against.
    pub(super) fn version(&self) -> String {
        version_beside(&self.program)
    }

    /// Writes states of problems, packed joint values, for the links that move.
    pub(super) fn write(
        &self,
        folder: &Path,
        arm: &Arm,
        tasks: &[(&Problem, &[f64])],
    ) -> Result<CoalStates<'_>, Box<dyn Error>> {
        let moving = || (0..arm.links.len()).filter(|&link| &*arm.links[link].name != BASE_LINK);
        let names: Vec<&str> = moving().map(|link| arm.links[link].file.as_str()).collect();
        let (width, mut frames) = (arm.kinematics.width(), Vec::new());
        let mut text = names.join(" ") + "\n";
        let mut total = 0;
        for (problem, packed) in tasks {
            let states = packed.len() / width;
            total += states;
            // Writing to a string cannot fail.
            let _ = writeln!(text, "P {} {} {states}", problem.family, problem.obstacle_count());
            text += &problem.obstacle_lines();
            for state in packed.chunks_exact(width) {
                for (place, pose) in arm.mesh_poses(state, moving(), &mut frames).into_iter().enumerate() {
                    let (t, q) = (pose.translation.vector, pose.rotation.coords);
                    let space = if place == 0 { "" } else { " " };
                    let _ = write!(text, "{space}{} {} {} {} {} {} {}", t.x, t.y, t.z, q.x, q.y, q.z, q.w);
                }
                text.push('\n');
            }
        }
        let path = folder.join("states.txt");
        std::fs::write(&path, text).map_err(PeerError::io(&path))?;
        Ok(CoalStates { coal: self, path, states: total })
    }

    /// How many of these states are in contact.
    pub(super) fn contacts(
        &self,
        folder: &Path,
        arm: &Arm,
        tasks: &[(&Problem, &[f64])],
    ) -> Result<usize, Box<dyn Error>> {
        Ok(self.write(folder, arm, tasks)?.run()?.collide_cold.contacts)
    }
}

impl CoalStates<'_> {
    /// Runs the program; of no states there is nothing to say.
    pub(super) fn run(&self) -> Result<CoalTimes, PeerError> {
        if self.states == 0 {
            return Ok(CoalTimes::default());
        }
        let program = &self.coal.program;
        let output = printed(program, Command::new(program).args([&self.coal.meshes, &self.path]))?;
        // A time per pair is no number where no pair is near.
        let text =
            String::from_utf8_lossy(&output).replace("-nan", "null").replace("nan", "null").replace("inf", "null");
        serde_json::from_str(&text).map_err(|error| PeerError::program(program, format!("prints no times: {error}")))
    }
}
