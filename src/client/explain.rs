//! Why a state is in contact, and what frees it.

use nalgebra::Vector3;

use super::columns::numbers;
use super::connection::Client;
use super::error::ClientError;
use super::states::PlacedStates;
use crate::measure::Pose;
use crate::scene::query::{AnswerStatus, Certainty, StateVerdict};
use crate::service::answer_wire;
use crate::service::proto::{self, ExplainRequest, ExplainResponse};

/// One state of some objects, or of a robot.
#[derive(Clone, Debug, Default)]
pub struct ExplainQuestion {
    request: ExplainRequest,
    placed: PlacedStates,
}

impl ExplainQuestion {
    /// A state that places these objects.
    pub fn new<'a>(objects: impl IntoIterator<Item = &'a str>) -> Self {
        Self { placed: PlacedStates::of_objects(objects), ..Self::default() }
    }

    /// A state that sets joints of a robot of the scene: those that are named, or all in the order of
    /// joint vectors. The others are as in the scene, and all of them without values.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>) -> Self {
        Self { placed: PlacedStates::of_robot(robot, joints), ..Self::default() }
    }

    /// The values of the joints, in their order: radians, metres, unit quaternions.
    #[must_use]
    pub fn with_joint_values(mut self, values: &[f64]) -> Self {
        self.placed.push_values(values);
        self
    }

    /// The poses of the objects, one each in their order.
    #[must_use]
    pub fn with_poses(mut self, poses: &[Pose]) -> Self {
        self.placed.set_poses(poses);
        self
    }

    /// A pair is in contact below this margin and its padding, metres.
    #[must_use]
    pub fn with_margin(mut self, margin_m: f64) -> Self {
        self.request.margin_m = margin_m;
        self
    }

    fn asked(self, scene: &str) -> ExplainRequest {
        let PlacedStates { objects, robot, joints, poses, joint_values } = self.placed;
        let (poses, joint_values) = (poses.into_bytes(), joint_values.into_bytes());
        ExplainRequest { scene: scene.into(), objects, robot, joints, poses, joint_values, ..self.request }
    }

    /// The request without its state, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut ExplainRequest {
        &mut self.request
    }
}

/// A pair that is in contact, or may be.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplainedPair {
    /// An object that the state places, then the other one.
    pub pair: [String; 2],
    /// Whether the contact is proven, for the finest representation of both bodies.
    pub is_contact: bool,
    /// Whether it is one of the objects inside the bodies.
    pub certainty: Certainty,
    /// How the signed distance came about. The bracket is true whatever it is.
    pub status: AnswerStatus,
    /// The signed distance is at least this, metres; below 0 the two overlap by at most as much.
    /// Minus infinity where no depth is known.
    pub lower_m: f64,
    /// The signed distance is at most this, metres.
    pub upper_m: f64,
    /// Padding of the pair, metres; the bracket does not contain it.
    pub padding_m: f64,
    /// Points of the first and of the second object, metres, world frame: each nearest to the other
    /// object, or deepest in it where the two overlap. None where none were computed.
    pub witnesses_m: Option<[Vector3<f64>; 2]>,
    /// Unit vector from the second to the first object, world frame.
    pub normal: Option<Vector3<f64>>,
    /// The first object, moved by this along the normal, metres, is no longer in contact with the
    /// second. None where a body has several parts or need not be convex, and without a normal.
    pub separation_m: Option<f64>,
    /// Derivatives of the signed distance with respect to the values of the joints that were named,
    /// metres per radian or per metre; none of states that are poses, and where there is no
    /// gradient.
    pub joint_gradient: Option<Vec<f64>>,
}

/// What is known of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct ExplainedState {
    /// Revision all of this is true of.
    pub revision: u64,
    /// What the state is.
    pub verdict: StateVerdict,
    /// Every pair that is in contact or may be, the deepest first.
    pub pairs: Vec<ExplainedPair>,
    /// Values of the joints that were named, or of all, near those that were asked about, with which
    /// the robot is free: proven; radians, metres, unit quaternions. None of free states, of states
    /// that are poses, and where none were found.
    pub freed: Option<Vec<f64>>,
    /// Of a state that is invalid: the field that is wrong, why, and the remedy.
    pub reason: Option<String>,
}

impl Client {
    /// Asks which pairs of a state are in contact, how deep, and what frees them.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn explain(&self, scene: &str, question: ExplainQuestion) -> Result<ExplainedState, ClientError> {
        read(&self.queries().explain(question.asked(scene)).await.map_err(self.refused())?.into_inner())
    }
}

fn read(response: &ExplainResponse) -> Result<ExplainedState, ClientError> {
    let pairs = response.pairs.iter().enumerate().map(|(index, pair)| read_pair(pair, &format!("pairs[{index}]")));
    let freed = numbers("freed_joint_values", &response.freed_joint_values)?;
    Ok(ExplainedState {
        revision: response.scene_revision,
        verdict: answer_wire::verdict(response.verdict, || "verdict".into())?,
        pairs: pairs.collect::<Result<_, _>>()?,
        freed: Some(freed).filter(|values| !values.is_empty()),
        reason: Some(response.reason.clone()).filter(|reason| !reason.is_empty()),
    })
}

fn read_pair(pair: &proto::ExplainedPair, field: &str) -> Result<ExplainedPair, ClientError> {
    let at = |leaf: &'static str| move || format!("{field}.{leaf}");
    let gradient = numbers(&at("joint_gradient")(), &pair.joint_gradient)?;
    let is_known = !gradient.is_empty() && !gradient.iter().any(|value| value.is_nan());
    Ok(ExplainedPair {
        pair: [pair.a.clone(), pair.b.clone()],
        is_contact: pair.in_contact,
        certainty: answer_wire::certainty(pair.certainty, at("certainty"))?,
        status: answer_wire::status(pair.status, at("status"))?,
        lower_m: pair.lower_m,
        upper_m: pair.upper_m,
        padding_m: pair.padding_m,
        witnesses_m: answer_wire::vectors(pair.witness_a_m.as_ref(), pair.witness_b_m.as_ref()),
        normal: answer_wire::vector(pair.normal.as_ref()),
        separation_m: pair.separation_m,
        joint_gradient: is_known.then_some(gradient),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::proto::{SolveStatus, Verdict};

    #[test]
    fn what_cannot_be_read_is_named() {
        let pair = proto::ExplainedPair { status: SolveStatus::Converged.into(), ..Default::default() };
        let good = ExplainResponse {
            verdict: Verdict::Contact.into(),
            pairs: vec![pair.clone()],
            ..ExplainResponse::default()
        };
        assert_eq!(read(&good).expect("a state").freed, None);
        let with = |pair| ExplainResponse { pairs: vec![good.pairs[0].clone(), pair], ..good.clone() };
        for (bad, field) in [
            (ExplainResponse { verdict: 0, ..good.clone() }, "verdict"),
            (ExplainResponse { freed_joint_values: vec![0; 7].into(), ..good.clone() }, "freed_joint_values"),
            (with(proto::ExplainedPair { status: 77, ..pair.clone() }), "pairs[1].status"),
            (with(proto::ExplainedPair { certainty: 3, ..pair.clone() }), "pairs[1].certainty"),
            (with(proto::ExplainedPair { joint_gradient: vec![0; 12].into(), ..pair }), "pairs[1].joint_gradient"),
        ] {
            let error = read(&bad).expect_err(field);
            assert_eq!(error.field().as_deref(), Some(field), "{error}");
        }
    }
}
