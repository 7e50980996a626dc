//! Questions.

use prost::Message;

use super::columns::{index_pairs, name};
use super::connection::{Client, Connection};
use super::error::ClientError;
use crate::measure::Pose;
use crate::scene::query::{Answer, Measure};
use crate::service::answer_wire;
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::evaluate_request;
use crate::service::proto::query_service_client::QueryServiceClient;
use crate::service::proto::{self, EvaluateRequest, ObjectPair, Output, PairList, Selection, WithinMargin};
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
    /// The answer; outputs that were not asked for are missing in it.
    pub answer: Answer,
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
        let rows = response.answers.iter().enumerate().map(|(index, message)| {
            let ObjectPair { a, b } = pairs[index / measures.len()].clone();
            let answer = answer_wire::answer(message, index)?;
            Ok(PairRow { a, b, measure: measures[index % measures.len()], value: message.value, answer })
        });
        let rows = rows.collect::<Result<_, ClientError>>()?;
        Ok(Answers { revision: response.scene_revision, rows, complete: response.complete })
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
}

fn found(response: &proto::EvaluateResponse) -> Result<Vec<ObjectPair>, ClientError> {
    let table = &response.objects;
    let pair = |[a, b]: [u32; 2]| Some(ObjectPair { a: name(table, a)?, b: name(table, b)? });
    let pairs: Option<Vec<_>> = index_pairs(&response.pairs).map(pair).collect();
    pairs.ok_or(ClientError::Unexpected("a pair without names"))
}
