//! Explain: why a state is in contact, and what frees it.

use std::sync::Arc;

use tonic::Status;

use super::app_state::AppState;
use super::call_time::CallTime;
use super::error;
use super::placed_states::PlacedStates;
use super::proto::{self, ExplainRequest, ExplainResponse};
use super::query_wire;
use super::robot_wire::numbers;
use super::snapshot::snapshot;
use super::state_reasons::reason_of_one;
use super::wire::vector;
use crate::scene::Scene;
use crate::scene::query::{ExplainedPair, ExplainedState, Explanation, JointValues};

/// Answers Explain.
pub(super) async fn explain(
    app: &AppState,
    request: ExplainRequest,
    time: CallTime,
) -> Result<ExplainResponse, Status> {
    let scene = snapshot(app, &request.scene, request.at_least_revision).await?;
    let margin = query_wire::length(request.margin_m, "margin_m")?;
    let given = (&request.objects[..], &request.poses[..]);
    let of_robot = (&request.robot[..], &request.joints[..], &request.joint_values[..]);
    let allowed = request.include_allowed;
    let explanation = match PlacedStates::of(&scene, given, of_robot)? {
        PlacedStates::Poses(slots, poses) => Explanation::new(scene.clone(), &slots, poses, margin, allowed),
        PlacedStates::Joints(joints, values) => Explanation::of_joints(
            scene.clone(),
            JointValues { robot: &request.robot, joints: &joints, values },
            margin,
            allowed,
        ),
    };
    let explanation = explanation.map_err(|error| query_wire::states_error(&error))?;
    let states = app.ask(Arc::new(explanation), time).await?;
    let state = states.first().ok_or_else(error::abandoned)?;
    let response = message(state, &scene);
    error::fits(&response)?;
    Ok(response)
}

fn message(state: &ExplainedState, scene: &Scene) -> ExplainResponse {
    ExplainResponse {
        scene_revision: scene.revision(),
        verdict: query_wire::verdict(state.verdict).into(),
        pairs: state.pairs.iter().map(|pair| pair_message(pair, scene)).collect(),
        freed_joint_values: numbers(state.freed.as_deref().unwrap_or_default()),
        reason: state.invalid.as_deref().map(reason_of_one).unwrap_or_default(),
    }
}

fn pair_message(explained: &ExplainedPair, scene: &Scene) -> proto::ExplainedPair {
    let ExplainedPair { pair, answer, padding_m, is_contact, certainty, separation_m, joint_gradient } = explained;
    let [a, b] = pair.map(|slot| scene.object(slot).map(|object| object.name.to_string()).unwrap_or_default());
    let witness = |side: usize| answer.witnesses.map(|witnesses| vector(&witnesses[side]));
    proto::ExplainedPair {
        a,
        b,
        in_contact: *is_contact,
        certainty: query_wire::certainty(*certainty).into(),
        status: query_wire::status(answer.status).into(),
        lower_m: answer.lower,
        upper_m: answer.upper,
        padding_m: *padding_m,
        witness_a_m: witness(0),
        witness_b_m: witness(1),
        normal: answer.normal.as_ref().map(vector),
        separation_m: *separation_m,
        joint_gradient: numbers(joint_gradient),
    }
}
