//! Questions about many states, and the verdicts.

use prost::Message;

use super::columns::{index_pairs, name, text};
use super::connection::Client;
use super::error::ClientError;
use crate::measure::Pose;
use crate::scene::query::StateVerdict;
use crate::service::answer_wire;
use crate::service::packed::{POSE_NUMBERS, Packed};
use crate::service::proto::CheckStatesRequest;

/// Many states of some objects, or of a robot.
#[derive(Clone, Debug, Default)]
pub(super) struct PlacedStates {
    pub(super) objects: Vec<String>,
    pub(super) robot: String,
    pub(super) joints: Vec<String>,
    pub(super) poses: Packed,
    pub(super) joint_values: Packed,
}

impl PlacedStates {
    /// States that place these objects.
    pub(super) fn of_objects<'a>(objects: impl IntoIterator<Item = &'a str>) -> Self {
        Self { objects: objects.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// States that set joints of a robot of the scene: those that are named, or all in the order of
    /// joint vectors.
    pub(super) fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        Self { robot: robot.into(), joints: joints.into_iter().map(Into::into).collect(), ..Self::default() }
    }

    /// Adds values of the joints.
    pub(super) fn push_values(&mut self, values: &[f64]) {
        values.iter().for_each(|&value| self.joint_values.number(value));
    }

    /// Adds poses of the objects.
    pub(super) fn push_poses(&mut self, poses: &[Pose]) {
        poses.iter().for_each(|pose| self.poses.pose(pose));
    }

    /// Sets the poses of all states at once.
    pub(super) fn set_poses(&mut self, poses: &[Pose]) {
        self.poses = Packed::with_capacity(poses.len() * 8 * POSE_NUMBERS);
        self.push_poses(poses);
    }
}

/// Many states of some objects, or of a robot.
#[derive(Clone, Debug, Default)]
pub struct StatesQuestion {
    request: CheckStatesRequest,
    placed: PlacedStates,
}

impl StatesQuestion {
    /// States that place these objects.
    pub fn new<'a>(objects: impl IntoIterator<Item = &'a str>) -> Self {
        Self { placed: PlacedStates::of_objects(objects), ..Self::default() }
    }

    /// States that set joints of a robot of the scene: those that are named, or all in the order of
    /// joint vectors. The others are as in the scene.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        Self { placed: PlacedStates::of_robot(robot, joints), ..Self::default() }
    }

    /// Adds states by the values of the joints, in their order: radians, metres, unit quaternions.
    pub fn with_joint_values(mut self, values: &[f64]) -> Self {
        self.placed.push_values(values);
        self
    }

    /// Adds states by configurations, each the values of the joints in their order.
    pub fn with_configurations<Configuration: AsRef<[f64]>>(self, configurations: &[Configuration]) -> Self {
        configurations.iter().fold(self, |question, values| question.with_joint_values(values.as_ref()))
    }

    /// Adds a state: one pose per object, in their order.
    pub fn push(&mut self, poses: &[Pose]) {
        self.placed.push_poses(poses);
    }

    /// Sets all states at once: the poses of the first, then of the second, and so on.
    pub fn with_states(mut self, poses: &[Pose]) -> Self {
        self.placed.set_poses(poses);
        self
    }

    /// A pair is in contact below this margin and its padding, metres.
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    fn asked(self, scene: &str) -> CheckStatesRequest {
        let PlacedStates { objects, robot, joints, poses, joint_values } = self.placed;
        let (poses, joint_values) = (poses.into_bytes(), joint_values.into_bytes());
        CheckStatesRequest { scene: scene.into(), objects, robot, joints, poses, joint_values, ..self.request }
    }

    /// The request without its states, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut CheckStatesRequest {
        &mut self.request
    }
}

/// Verdicts of states.
#[derive(Clone, Debug)]
pub struct CheckedStates {
    /// Revision all of them are true of.
    pub revision: u64,
    /// One per state.
    pub verdicts: Vec<StateVerdict>,
    /// The pair that decided, where one did.
    pub pairs: Vec<Option<[String; 2]>>,
    /// One per state. Of a state that is invalid: the field that is wrong, why, and the remedy; the
    /// server sends at most 1 MiB of them.
    pub reasons: Vec<Option<String>>,
}

impl Client {
    /// Asks whether anything is in contact in each of many states.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn check_states(&self, scene: &str, question: StatesQuestion) -> Result<CheckedStates, ClientError> {
        let response = self.queries().check_states(question.asked(scene)).await.map_err(self.refused())?.into_inner();
        let pair = |[a, b]: [u32; 2]| Some([name(&response.objects, a)?, name(&response.objects, b)?]);
        let verdicts = answer_wire::verdicts(&response.verdicts)?;
        Ok(CheckedStates {
            revision: response.scene_revision,
            pairs: index_pairs(&response.pairs).map(pair).collect(),
            reasons: (0..verdicts.len()).map(|state| text(&response.reasons, state)).collect(),
            verdicts,
        })
    }

    /// Asks the same, and returns how many bytes the answer has: for those who measure servers.
    pub(crate) async fn check_states_bytes(
        &self,
        scene: &str,
        question: &StatesQuestion,
    ) -> Result<usize, ClientError> {
        let request = question.clone().asked(scene);
        Ok(self.queries().check_states(request).await.map_err(self.refused())?.get_ref().encoded_len())
    }
}
