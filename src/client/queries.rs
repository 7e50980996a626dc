//! Questions.

use prost::Message;

use super::connection::{Client, Connection};
use super::error::ClientError;
use crate::measure::Pose;
use crate::scene::query::Measure;
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::packed::{POSE_NUMBERS, Packed};
use crate::service::proto::evaluate_request;
use crate::service::proto::query_service_client::QueryServiceClient;
use crate::service::proto::{
    self, CheckStatesRequest, EvaluateRequest, ObjectPair, Output, PairList, Selection, WithinMargin,
};
use crate::service::{query_wire, scene_wire};

/// Which pairs a question is about, and how it is asked.
#[derive(Clone, Debug, Default)]
pub struct Question {
    request: EvaluateRequest,
}

/// One measure of one pair.
#[derive(Clone, Debug)]
pub struct PairRow {
    /// Name of the first object.
    pub a: String,
    /// Name of the second object.
    pub b: String,
    /// What was measured.
    pub measure: Measure,
    /// The answer in the words of the protocol.
    pub answer: proto::Answer,
    /// The value, unit of the measure; none where no upper bound was found.
    pub value: Option<f64>,
}

/// Answers of one call.
#[derive(Clone, Debug)]
pub struct Answers {
    /// Revision all of them are true of.
    pub revision: u64,
    /// All measures of the first pair in the order asked, then of the second, and so on.
    pub rows: Vec<PairRow>,
    /// Whether the question was answered whole.
    pub complete: bool,
}

impl Question {
    /// Pairs by name.
    pub fn pairs<'a>(pairs: impl IntoIterator<Item = (&'a str, &'a str)>) -> Self {
        let rows = pairs.into_iter().map(|(a, b)| ObjectPair { a: a.into(), b: b.into() }).collect();
        let question = evaluate_request::Question::Pairs(PairList { rows, ..PairList::default() });
        Self::of(question)
    }

    /// All pairs nearer than a margin, metres.
    pub fn within(margin_m: f64) -> Self {
        Self::of(evaluate_request::Question::Within(WithinMargin { margin_m, selection: None }))
    }

    /// The pair with the smallest signed distance.
    pub fn closest() -> Self {
        Self::of(evaluate_request::Question::Closest(proto::ClosestPair::default()))
    }

    fn of(question: evaluate_request::Question) -> Self {
        let outputs = [Output::Value, Output::Witnesses, Output::Normal, Output::Flags];
        let outputs = outputs.map(i32::from).to_vec();
        Self { request: EvaluateRequest { question: Some(question), outputs, ..EvaluateRequest::default() } }
    }

    /// Only pairs with one of these objects.
    pub fn with_objects<'a>(mut self, objects: impl IntoIterator<Item = &'a str>) -> Self {
        let selection = Some(Selection { objects: objects.into_iter().map(Into::into).collect(), groups: Vec::new() });
        match &mut self.request.question {
            Some(evaluate_request::Question::Within(within)) => within.selection = selection,
            Some(evaluate_request::Question::Closest(closest)) => closest.selection = selection,
            Some(evaluate_request::Question::FirstContact(first)) => first.selection = selection,
            _ => {}
        }
        self
    }

    /// Poses that stand in for the scene's own.
    pub fn with_poses<'a>(mut self, poses: impl IntoIterator<Item = (&'a str, Pose)>) -> Self {
        self.request.pose_overrides = Some(scene_wire::pose_table_message(poses));
        self
    }

    /// With gradients.
    pub fn with_gradients(mut self) -> Self {
        self.request.outputs.push(Output::Gradients.into());
        self
    }

    /// Uses no earlier answers as starts: equal calls then give equal bits.
    pub fn cold(mut self) -> Self {
        self.request.cold = true;
        self
    }

    /// At a revision of the scene that is at least this.
    pub fn at_least_revision(mut self, revision: u64) -> Self {
        self.request.at_least_revision = Some(revision);
        self
    }

    fn asked(mut self, scene: &str, measures: &[Measure]) -> EvaluateRequest {
        self.request.scene = scene.into();
        self.request.measures = measures.iter().map(|&measure| query_wire::measure_message(measure).into()).collect();
        self.request
    }

    /// The request, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut EvaluateRequest {
        &mut self.request
    }
}

/// Many states of some objects.
#[derive(Clone, Debug, Default)]
pub struct StatesQuestion {
    request: CheckStatesRequest,
    poses: Packed,
    joint_values: Packed,
}

impl StatesQuestion {
    /// States that place these objects.
    pub fn new<'a>(objects: impl IntoIterator<Item = &'a str>) -> Self {
        let objects = objects.into_iter().map(Into::into).collect();
        Self { request: CheckStatesRequest { objects, ..CheckStatesRequest::default() }, ..Self::default() }
    }

    /// States that set joints of a robot of the scene: those that are named, or all in the order of
    /// joint vectors. The others are as in the scene.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        let joints = joints.into_iter().map(Into::into).collect();
        let request = CheckStatesRequest { robot: robot.into(), joints, ..CheckStatesRequest::default() };
        Self { request, ..Self::default() }
    }

    /// Adds states by the values of the joints, in their order: radians, metres, unit quaternions.
    pub fn with_joint_values(mut self, values: &[f64]) -> Self {
        values.iter().for_each(|&value| self.joint_values.number(value));
        self
    }

    /// Adds a state: one pose per object, in their order.
    pub fn push(&mut self, poses: &[Pose]) {
        poses.iter().for_each(|pose| self.poses.pose(pose));
    }

    /// Sets all states at once: the poses of the first, then of the second, and so on.
    pub fn with_states(mut self, poses: &[Pose]) -> Self {
        self.poses = Packed::with_capacity(poses.len() * 8 * POSE_NUMBERS);
        self.push(poses);
        self
    }

    /// A pair is in contact below this margin and its padding, metres.
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    fn asked(self, scene: &str) -> CheckStatesRequest {
        let (poses, joint_values) = (self.poses.into_bytes(), self.joint_values.into_bytes());
        CheckStatesRequest { scene: scene.into(), poses, joint_values, ..self.request }
    }

    /// The request without its poses, for what this type does not say.
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
    pub verdicts: Vec<proto::Verdict>,
    /// The pair that decided, where one did.
    pub pairs: Vec<Option<[String; 2]>>,
}

impl Client {
    pub(super) fn queries(&self) -> QueryServiceClient<Connection> {
        QueryServiceClient::new(self.channel()).max_decoding_message_size(MAX_MESSAGE_BYTES)
    }

    /// Asks about pairs of a scene.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn evaluate(
        &self,
        scene: &str,
        question: Question,
        measures: &[Measure],
    ) -> Result<Answers, ClientError> {
        let request = question.asked(scene, measures);
        let named = match &request.question {
            Some(evaluate_request::Question::Pairs(list)) => list.rows.clone(),
            _ => Vec::new(),
        };
        let response = self.queries().evaluate(request).await.map_err(self.refused())?.into_inner();
        let pairs = if named.is_empty() { found(&response)? } else { named };
        if response.answers.len() != pairs.len() * measures.len() {
            return Err(ClientError::Unexpected("another number of answers"));
        }
        let rows = response.answers.into_iter().enumerate().map(|(index, answer)| {
            let ObjectPair { a, b } = pairs[index / measures.len()].clone();
            PairRow { a, b, measure: measures[index % measures.len()], value: answer.value, answer }
        });
        Ok(Answers { revision: response.scene_revision, rows: rows.collect(), complete: response.complete })
    }

    /// Asks about pairs of a scene, and returns how many bytes the answer has: for those who
    /// measure servers.
    pub(crate) async fn evaluate_bytes(
        &self,
        scene: &str,
        question: &Question,
        measures: &[Measure],
    ) -> Result<usize, ClientError> {
        let request = question.clone().asked(scene, measures);
        Ok(self.queries().evaluate(request).await.map_err(self.refused())?.get_ref().encoded_len())
    }

    /// The same of states.
    pub(crate) async fn check_states_bytes(
        &self,
        scene: &str,
        question: &StatesQuestion,
    ) -> Result<usize, ClientError> {
        let request = question.clone().asked(scene);
        Ok(self.queries().check_states(request).await.map_err(self.refused())?.get_ref().encoded_len())
    }

    /// Asks whether anything is in contact in each of many states.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn check_states(&self, scene: &str, question: StatesQuestion) -> Result<CheckedStates, ClientError> {
        let response = self.queries().check_states(question.asked(scene)).await.map_err(self.refused())?.into_inner();
        let verdict = |&byte: &u8| proto::Verdict::try_from(i32::from(byte)).unwrap_or_default();
        let name = |index: u32| usize::try_from(index).ok().and_then(|index| response.objects.get(index)).cloned();
        let pair = |[a, b]: [u32; 2]| Some([name(a)?, name(b)?]);
        Ok(CheckedStates {
            revision: response.scene_revision,
            verdicts: response.verdicts.iter().map(verdict).collect(),
            pairs: index_pairs(&response.pairs).map(pair).collect(),
        })
    }
}

pub(super) fn index_pairs(bytes: &[u8]) -> impl Iterator<Item = [u32; 2]> {
    let pairs = bytes.as_chunks::<4>().0.as_chunks::<2>().0;
    pairs.iter().map(|pair| pair.map(u32::from_le_bytes))
}

fn found(response: &proto::EvaluateResponse) -> Result<Vec<ObjectPair>, ClientError> {
    let name = |index: u32| usize::try_from(index).ok().and_then(|index| response.objects.get(index)).cloned();
    let pair = |[a, b]: [u32; 2]| Some(ObjectPair { a: name(a)?, b: name(b)? });
    let pairs: Option<Vec<_>> = index_pairs(&response.pairs).map(pair).collect();
    pairs.ok_or(ClientError::Unexpected("a pair without names"))
}
