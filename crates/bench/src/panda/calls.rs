//! `CheckStates` over gRPC beside the same question in process.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use sublevel::client::{Client, RobotPlacement, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::query::{JointValues, StateVerdict, States};
use sublevel::scene::{Crew, NamedJointValues, RobotId};

use super::arm::Arm;
use super::place::{ARM, Site, rules};
use super::problems::Problem;
use super::representation::LoadedArm;
use super::states::on_the_way;
use crate::comparison::Random;
use crate::comparison::sweep::median;
use crate::loopback::Loopback;

/// States of a call: half on the straight way from start to goal, half anywhere.
const STATES: usize = 1000;
/// A server for robots, with a client.
pub(crate) struct RobotServer {
    server: Loopback,
    client: Client,
}

/// A call and the same question in process, both on all cores: medians.
#[derive(Clone, Copy, Debug)]
pub(crate) struct StatesCall {
    pub(crate) states: usize,
    pub(crate) free: usize,
    pub(crate) call_us: f64,
    pub(crate) inside_us: f64,
}

impl RobotServer {
    /// Starts a server on loopback in this process.
    ///
    /// # Errors
    /// A server that cannot be started.
    pub(crate) fn start() -> Result<Self, Box<dyn Error>> {
        let server = Loopback::start()?;
        let client = server.connect()?;
        Ok(Self { server, client })
    }

    /// Stores the bodies of a robot, and loads it.
    ///
    /// # Errors
    /// What the server refuses.
    pub(crate) fn load(&self, arm: &LoadedArm) -> Result<RobotId, Box<dyn Error>> {
        self.server.clients().block_on(async {
            for geometry in &arm.geometries {
                self.client.create_from_file(geometry.to_json()).await?;
            }
            Ok(self.client.load_robot(&arm.source).await?.id)
        })
    }

    /// Checks states of a robot, with self-collision, in both ways: so many turns after one that
    /// finds everything cold.
    ///
    /// # Errors
    /// What the server refuses, and other verdicts than in process.
    pub(crate) fn check_states(
        &self,
        (arm, loaded, robot): (&Arm, &LoadedArm, RobotId),
        site: &Site<'_>,
        (crew, turns): (&Crew, usize),
    ) -> Result<StatesCall, Box<dyn Error>> {
        const SCENE: &str = "problem";
        let (name, base, joints) = (Arc::from(ARM), Pose::identity(), NamedJointValues::default());
        self.server.clients().block_on(async {
            for geometry in &site.geometries {
                self.client.create_from_file(geometry.to_json()).await?;
            }
            self.client.create_scene(SCENE).await?;
            self.client.update_scene(SCENE, &site.update).await?;
            self.client.place_robot(SCENE, &RobotPlacement { name, robot, base, joints }).await?;
            self.client.update_scene(SCENE, &rules(true)).await
        })?;
        let states = states(arm, site.problem)?;
        let [_, own] = site.scenes(loaded)?;
        let (mut calls, mut insides) = (Vec::new(), Vec::new());
        let (mut free_there, mut free) = (0, 0);
        for turn in 0..=turns {
            let start = Instant::now();
            let question = StatesQuestion::of_robot(ARM, []).with_joint_values(&states);
            let verdicts = self.server.clients().block_on(self.client.check_states(SCENE, question))?.verdicts;
            let call = start.elapsed().as_secs_f64();
            let start = Instant::now();
            let question = States::of_joints(
                own.clone(),
                JointValues { robot: ARM, joints: &[], values: states.clone() },
                0.0,
                false,
            )?;
            let answers = crew.ask(Arc::new(question), Arc::default())?.concat();
            if turn > 0 {
                insides.push(1e6 * start.elapsed().as_secs_f64());
                calls.push(1e6 * call);
            }
            free_there = verdicts.iter().filter(|&&verdict| verdict == StateVerdict::Free).count();
            free = answers.iter().filter(|answer| answer.verdict == StateVerdict::Free).count();
        }
        self.server.clients().block_on(self.client.delete_scene(SCENE))?;
        if free != free_there {
            return Err("the server decides otherwise than the library".into());
        }
        Ok(StatesCall { states: STATES, free, call_us: median(&calls), inside_us: median(&insides) })
    }

    /// Stops the server.
    ///
    /// # Errors
    /// When it had failed.
    pub(crate) fn stop(self) -> Result<(), Box<dyn Error>> {
        self.server.stop()
    }
}

/// Packed joint values of the states of a call, radians.
fn states(arm: &Arm, problem: &Problem) -> Result<Vec<f64>, Box<dyn Error>> {
    let [start, goal] = problem.ends(&arm.kinematics)?;
    let mut random = Random(5);
    let mut states = on_the_way(&start, &goal, STATES / 2);
    for _ in STATES / 2..STATES {
        states.extend(arm.within_limits(|| random.positive()));
    }
    Ok(states)
}
