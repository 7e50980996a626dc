//! Pairs within an influence distance, state by state, with gradients and nearest points.

use nalgebra::Vector3;

use super::columns::{index_pairs, indices, name, number, of_rows, text, twist, vector};
use super::connection::Client;
use super::error::ClientError;
use super::states::PlacedStates;
use crate::measure::{Pose, Twist};
use crate::scene::query::AnswerStatus;
use crate::service::answer_wire;
use crate::service::proto::{ClearanceRequest, ClearanceResponse};

/// Many states of some objects, or of a robot, and up to which distance pairs are of interest.
#[derive(Clone, Debug, Default)]
pub struct ClearanceQuestion {
    request: ClearanceRequest,
    placed: PlacedStates,
}

impl ClearanceQuestion {
    /// States that place these objects. Pairs are answered whose signed distance less their padding
    /// is below `influence_m`, metres, at least 0.
    pub fn new<'a>(objects: impl IntoIterator<Item = &'a str>, influence_m: f64) -> Self {
        Self::of(PlacedStates::of_objects(objects), influence_m)
    }

    /// States that set joints of a robot of the scene: those that are named, or all in the order of
    /// joint vectors. The others are as in the scene. Pairs are answered as by
    /// [`ClearanceQuestion::new`], with a gradient in joint space.
    pub fn of_robot<'a>(robot: &str, joints: impl IntoIterator<Item = &'a str>, influence_m: f64) -> Self {
        Self::of(PlacedStates::of_robot(robot, joints), influence_m)
    }

    fn of(placed: PlacedStates, influence_m: f64) -> Self {
        Self { request: ClearanceRequest { influence_m, ..ClearanceRequest::default() }, placed }
    }

    /// Adds states by the values of the joints, in their order: radians, metres, unit quaternions.
    #[must_use]
    pub fn with_joint_values(mut self, values: &[f64]) -> Self {
        self.placed.push_values(values);
        self
    }

    /// Adds states by configurations, each the values of the joints in their order.
    #[must_use]
    pub fn with_configurations<Configuration: AsRef<[f64]>>(self, configurations: &[Configuration]) -> Self {
        configurations.iter().fold(self, |question, values| question.with_joint_values(values.as_ref()))
    }

    /// Adds a state: one pose per object, in their order.
    pub fn push(&mut self, poses: &[Pose]) {
        self.placed.push_poses(poses);
    }

    /// Sets all states at once: the poses of the first, then of the second, and so on.
    #[must_use]
    pub fn with_states(mut self, poses: &[Pose]) -> Self {
        self.placed.set_poses(poses);
        self
    }

    /// At most so many pairs a state, the nearest.
    #[must_use]
    pub fn with_max_pairs(mut self, max_pairs: u32) -> Self {
        self.request.max_pairs = Some(max_pairs);
        self
    }

    /// Brackets without gradients, in less time.
    #[must_use]
    pub fn without_gradients(mut self) -> Self {
        self.request.without_gradients = true;
        self
    }

    /// With the points of both objects that attain the distances, 48 bytes a pair more.
    #[must_use]
    pub fn with_witnesses(mut self) -> Self {
        self.request.with_witnesses = true;
        self
    }

    fn asked(self, scene: &str) -> ClearanceRequest {
        let PlacedStates { objects, robot, joints, poses, joint_values } = self.placed;
        let (poses, joint_values) = (poses.into_bytes(), joint_values.into_bytes());
        ClearanceRequest { scene: scene.into(), objects, robot, joints, poses, joint_values, ..self.request }
    }

    /// The request without its states, for what this type does not say.
    pub fn request_mut(&mut self) -> &mut ClearanceRequest {
        &mut self.request
    }
}

/// A pair within the influence distance.
#[derive(Clone, Debug, PartialEq)]
pub struct NearPair {
    /// An object that the states place, then the other one.
    pub pair: [String; 2],
    /// How the answer came about. The bracket is true whatever it is.
    pub status: AnswerStatus,
    /// The signed distance is at least this, metres.
    pub lower_m: f64,
    /// The signed distance is at most this, metres.
    pub upper_m: f64,
    /// Padding of the pair, metres; the bracket does not contain it.
    pub padding_m: f64,
    /// Unit vector from the second to the first object, world frame.
    pub normal: Option<Vector3<f64>>,
    /// Points of the first and of the second object that attain the distance, metres, world frame:
    /// each nearest to the other object, or deepest in it where the two overlap. They are points of
    /// the bodies, which padding does not move. None unless asked for, and where none were computed.
    pub witnesses_m: Option<[Vector3<f64>; 2]>,
    /// Derivatives of the signed distance with respect to the twists of the two.
    pub gradients: Option<[Twist; 2]>,
    /// Of states of a robot: derivatives of the signed distance with respect to the values of the
    /// state, metres per radian or per metre; none where there are no gradients.
    pub joint_gradient: Option<Vec<f64>>,
    /// Whether another minimiser may be as good: the gradients are those of one of them.
    pub not_unique: bool,
    /// Whether the two are within rounding of contact.
    pub one_sided: bool,
}

/// The pairs of a state.
#[derive(Clone, Debug, PartialEq)]
pub struct StateClearance {
    /// In the order of names.
    pub near: Vec<NearPair>,
    /// Whether the poses or joint values are usable and all pairs were looked at.
    pub checked: bool,
    /// Where the poses or joint values are not usable: the field that is wrong, why, and the remedy;
    /// the server sends at most 1 MiB of them.
    pub reason: Option<String>,
}

impl StateClearance {
    /// The pair that may be nearest to its padding: the one with the least lower bound less it.
    pub fn closest(&self) -> Option<&NearPair> {
        closest(self.near.iter())
    }

    /// The same of the pairs with an object.
    pub fn closest_to(&self, object: &str) -> Option<&NearPair> {
        closest(self.near.iter().filter(|near| near.pair.iter().any(|name| name == object)))
    }
}

fn closest<'a>(pairs: impl Iterator<Item = &'a NearPair>) -> Option<&'a NearPair> {
    let room = |pair: &NearPair| pair.lower_m - pair.padding_m;
    pairs.min_by(|a, b| room(a).total_cmp(&room(b)))
}

/// Clearances of states.
#[derive(Clone, Debug)]
pub struct Clearances {
    /// Revision all of them are true of.
    pub revision: u64,
    /// One per state.
    pub states: Vec<StateClearance>,
}

impl Client {
    /// Asks in each of many states for the pairs within an influence distance.
    ///
    /// # Errors
    /// When the question cannot be answered.
    pub async fn clearance(&self, scene: &str, question: ClearanceQuestion) -> Result<Clearances, ClientError> {
        let response = self.queries().clearance(question.asked(scene)).await.map_err(self.refused())?.into_inner();
        let states = read(&response)?;
        Ok(Clearances { revision: response.scene_revision, states })
    }
}

/// The rows of all states.
fn read(response: &ClearanceResponse) -> Result<Vec<StateClearance>, ClientError> {
    let rows = response.status.len();
    of_rows("pairs", &response.pairs, rows, 8)?;
    of_rows("lower_m", &response.lower_m, rows, 8)?;
    of_rows("upper_m", &response.upper_m, rows, 8)?;
    let width = response.joint_gradients.len() / 8 / rows.max(1);
    of_rows("joint_gradients", &response.joint_gradients, rows, 8 * width)?;
    for (field, column) in [("witness_a_m", &response.witness_a_m), ("witness_b_m", &response.witness_b_m)] {
        if !column.is_empty() {
            of_rows(field, column, rows, 24)?;
        }
    }
    let mut near = Vec::with_capacity(rows);
    for (row, pair) in index_pairs(&response.pairs).enumerate() {
        near.push(near_pair(response, row, pair, width)?);
    }
    let (mut near, mut states) = (near.into_iter(), Vec::with_capacity(response.checked.len()));
    let offsets: Vec<u32> = indices(&response.offsets).collect();
    of_rows("offsets", &response.offsets, response.checked.len() + 1, 4)?;
    for (state, (bounds, &checked)) in offsets.windows(2).zip(&response.checked[..]).enumerate() {
        let count = bounds[1].checked_sub(bounds[0]).ok_or(ClientError::Unexpected("rows in no order"))?;
        let near = near.by_ref().take(count as usize).collect();
        states.push(StateClearance { near, checked: checked == 1, reason: text(&response.reasons, state) });
    }
    let said = offsets.last().map(|&last| last as usize);
    if said != Some(rows) { Err(ClientError::Unexpected("rows of no state")) } else { Ok(states) }
}

fn near_pair(
    response: &ClearanceResponse,
    row: usize,
    [a, b]: [u32; 2],
    width: usize,
) -> Result<NearPair, ClientError> {
    let gradient: Vec<f64> =
        (row * width..(row + 1) * width).map(|entry| number(&response.joint_gradients, entry)).collect();
    let known = width > 0 && !gradient.iter().any(|value| value.is_nan());
    let flag = |bit: u8| response.flags.get(row).is_some_and(|flags| flags & bit != 0);
    let named = |index| {
        name(&response.objects, index)
            .ok_or_else(|| ClientError::unreadable(format!("pairs[{row}]"), "names an object that is not listed"))
    };
    let points = [&response.witness_a_m, &response.witness_b_m].map(|column| vector(column, row));
    Ok(NearPair {
        pair: [named(a)?, named(b)?],
        status: answer_wire::status(response.status[row].into(), || format!("status[{row}]"))?,
        lower_m: number(&response.lower_m, row),
        upper_m: number(&response.upper_m, row),
        padding_m: number(&response.padding_m, row),
        normal: vector(&response.normal, row),
        witnesses_m: points[0].zip(points[1]).map(|(a, b)| [a, b]),
        gradients: twist(&response.gradient_a, row).zip(twist(&response.gradient_b, row)).map(|(a, b)| [a, b]),
        joint_gradient: known.then_some(gradient),
        not_unique: flag(1),
        one_sided: flag(4),
    })
}
