//! QueryService: snapshot, pairs, solver, answers.

use std::sync::Arc;

use tokio::sync::mpsc;
use tokio_stream::wrappers::ReceiverStream;
use tonic::{Request, Response, Status, Streaming};

use super::app_state::{AppState, stopped};
use super::call_time::CallTime;
use super::columns;
use super::error::{self, Invalid};
use super::limits::{MAX_ANSWERS, MAX_RAYS};
use super::packed::{self, Packed};
use super::placed_states::PlacedStates;
use super::proto::evaluate_request::Question;
use super::proto::query_service_server::QueryService;
use super::proto::{
    self, CastRaysRequest, CastRaysResponse, CheckMotionsRequest, CheckMotionsResponse, CheckStatesRequest,
    CheckStatesResponse, ClearanceRequest, ClearanceResponse, EvaluateRequest, EvaluateResponse, EvaluateStreamRequest,
    EvaluateStreamResponse, ExplainRequest, ExplainResponse, StreamError, VerifyMotionRequest, VerifyMotionResponse,
    WatchRequest, WatchResponse,
};
use super::query_wire::{NOTHING, NameTable, Outputs};
use super::reason::Reason;
use super::snapshot::snapshot;
use super::state_reasons::StateReasons;
use super::{contact_watch, explain, motions, query_wire, wire};
use crate::robot::counted;
use crate::scene::query::{
    Answer, AnswerStatus, Ask, Clearance, Found, JointValues, Pairs, RayAnswer, Rays, StateAnswer, StateVerdict,
    States, Within, closest_pair, combined,
};
use crate::scene::{OwnStarts, Scene, Stop};

#[derive(Debug)]
pub(super) struct Queries(pub(super) AppState);

#[tonic::async_trait]
impl QueryService for Queries {
    async fn evaluate(&self, request: Request<EvaluateRequest>) -> Result<Response<EvaluateResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        evaluate(&self.0, None, request.get_ref(), time).await.map(Response::new)
    }

    type EvaluateStreamStream = ReceiverStream<Result<EvaluateStreamResponse, Status>>;

    async fn evaluate_stream(
        &self,
        request: Request<Streaming<EvaluateStreamRequest>>,
    ) -> Result<Response<Self::EvaluateStreamStream>, Status> {
        let (sender, stream) = mpsc::channel(1);
        let (app, mut messages) = (self.0.clone(), request.into_inner());
        // One question after the other: a client that reads slowly is not read on.
        tokio::spawn(async move {
            let (mut stopping, mut starts) = (app.stopping(), OwnStarts::default());
            loop {
                let message = tokio::select! {
                    message = messages.message() => message,
                    () = stopped(&mut stopping) => {
                        let why = "the server stops; ask again when it is back";
                        Err(error::unavailable(Reason::Stopping, why))
                    }
                };
                let message = match message {
                    Ok(Some(message)) => message,
                    Ok(None) => return,
                    Err(status) => {
                        let _ = sender.send(Err(status)).await;
                        return;
                    }
                };
                let answered = tokio::select! {
                    answered = answer(&app, &mut starts, message) => answered,
                    () = sender.closed() => return,
                };
                if sender.send(Ok(answered)).await.is_err() {
                    return;
                }
            }
        });
        Ok(Response::new(ReceiverStream::new(stream)))
    }

    async fn check_states(
        &self,
        request: Request<CheckStatesRequest>,
    ) -> Result<Response<CheckStatesResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        let request = request.into_inner();
        let scene = snapshot(&self.0, &request.scene, request.at_least_revision).await?;
        let margin = query_wire::length(request.margin_m, "margin_m")?;
        let given = (&request.objects[..], &request.poses[..]);
        let of_robot = (&request.robot[..], &request.joints[..], &request.joint_values[..]);
        let placed = PlacedStates::of(&scene, given, of_robot)?;
        let revision = scene.revision();
        let include_allowed = request.include_allowed;
        let states = match placed {
            PlacedStates::Poses(slots, poses) => States::new(scene.clone(), &slots, poses, margin, include_allowed),
            PlacedStates::Joints(joints, values) => States::of_joints(
                scene.clone(),
                JointValues { robot: &request.robot, joints: &joints, values },
                margin,
                include_allowed,
            ),
        };
        let mut states = states.map_err(|error| query_wire::states_error(&error))?;
        match proto::Detail::try_from(request.detail) {
            Ok(proto::Detail::Unspecified | proto::Detail::Verdicts) => {}
            Ok(proto::Detail::WorstPair) => {
                let refused = |error| Invalid::new("accuracy", error);
                states = states.with_worst_pair(request.accuracy).map_err(refused)?;
            }
            Err(_) => return Err(Invalid::new("detail", "is no detail this server knows").into()),
        }
        if request.stop_at_first {
            states = states.stopping_at_first();
        }
        if request.cold {
            states = states.cold();
        }
        let parts = self.0.ask(Arc::new(states), time).await?;
        let answers: Vec<StateAnswer> = parts.into_iter().flatten().collect();
        self.0.metrics().checked(&answers);
        Ok(Response::new(states_response(&answers, &scene, revision)))
    }

    async fn check_motions(
        &self,
        request: Request<CheckMotionsRequest>,
    ) -> Result<Response<CheckMotionsResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        motions::check(&self.0, request.into_inner(), time).await.map(Response::new)
    }

    async fn verify_motion(
        &self,
        request: Request<VerifyMotionRequest>,
    ) -> Result<Response<VerifyMotionResponse>, Status> {
        let time = CallTime::of(&request, None)?;
        motions::verify(&self.0, request.into_inner(), time).await.map(Response::new)
    }

    async fn clearance(&self, request: Request<ClearanceRequest>) -> Result<Response<ClearanceResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        let request = request.into_inner();
        let scene = snapshot(&self.0, &request.scene, request.at_least_revision).await?;
        let influence = query_wire::length(request.influence_m, "influence_m")?;
        let given = (&request.objects[..], &request.poses[..]);
        let of_robot = (&request.robot[..], &request.joints[..], &request.joint_values[..]);
        let include_allowed = request.include_allowed;
        let clearance = match PlacedStates::of(&scene, given, of_robot)? {
            PlacedStates::Poses(slots, poses) => {
                Clearance::new(scene.clone(), &slots, poses, influence, include_allowed)
            }
            PlacedStates::Joints(joints, values) => Clearance::of_joints(
                scene.clone(),
                JointValues { robot: &request.robot, joints: &joints, values },
                influence,
                include_allowed,
            ),
        };
        let mut clearance = clearance.map_err(|error| query_wire::states_error(&error))?;
        if let Some(accuracy) = request.accuracy {
            clearance = clearance.with_accuracy(accuracy).map_err(|error| Invalid::new("accuracy", error))?;
        }
        if let Some(most) = request.max_pairs {
            clearance = clearance.with_max_pairs(usize::try_from(most).unwrap_or(usize::MAX));
        }
        if request.without_gradients {
            clearance = clearance.without_gradients();
        }
        if request.cold {
            clearance = clearance.cold();
        }
        let parts = self.0.ask(Arc::new(clearance), time).await?;
        let outputs = query_wire::clearance_outputs(&request);
        let response = query_wire::clearance(parts.into_iter().flatten(), &scene, &outputs);
        error::fits(&response)?;
        Ok(Response::new(response))
    }

    async fn explain(&self, request: Request<ExplainRequest>) -> Result<Response<ExplainResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        explain::explain(&self.0, request.into_inner(), time).await.map(Response::new)
    }

    async fn cast_rays(&self, request: Request<CastRaysRequest>) -> Result<Response<CastRaysResponse>, Status> {
        let time = CallTime::of(&request, request.get_ref().budget_ms)?;
        let request = request.into_inner();
        let scene = snapshot(&self.0, &request.scene, request.at_least_revision).await?;
        let selection = query_wire::selection(request.selection.as_ref(), &scene, "selection")?;
        let origins = packed::rows::<3>(&request.origins_m, "origins_m")?;
        let directions = packed::rows::<3>(&request.directions, "directions")?;
        if origins.len() != directions.len() {
            let rays = counted(directions.len(), "ray", "rays");
            let why = format!("holds {rays}, and origins_m {}; send as many", origins.len());
            return Err(Invalid::new("directions", why).into());
        }
        if origins.is_empty() {
            return Err(Invalid::new("origins_m", "is empty; send at least one ray").into());
        }
        error::at_most("origins_m", origins.len(), ("max_rays", MAX_RAYS))?;
        let rays: Vec<_> = origins.into_iter().map(Into::into).zip(directions.into_iter().map(Into::into)).collect();
        let sizes = (request.max_length_m, request.radius_m.unwrap_or(0.0));
        let rays = Rays::new(scene.clone(), selection, &rays, sizes).map_err(query_wire::rays_error)?;
        let rays = match request.accuracy {
            Some(accuracy) => rays.with_accuracy(accuracy).map_err(|error| Invalid::new("accuracy", error))?,
            None => rays,
        };
        let parts = self.0.ask(Arc::new(rays), time).await?;
        let answers: Vec<RayAnswer> = parts.into_iter().flatten().collect();
        let response = rays_response(&answers, &scene);
        error::fits(&response)?;
        Ok(Response::new(response))
    }

    type WatchStream = ReceiverStream<Result<WatchResponse, Status>>;

    async fn watch(&self, request: Request<WatchRequest>) -> Result<Response<Self::WatchStream>, Status> {
        let request = request.into_inner();
        let pause = wire::pause(request.max_rate_hz)?;
        query_wire::length(request.margin_m, "margin_m")?;
        let live = self.0.live_scene(&request.scene, "scene").await?;
        // A selection that names nobody is refused now, not in the stream.
        query_wire::selection(request.selection.as_ref(), &live.snapshot(), "selection")?;
        let (sender, stream) = mpsc::channel(1);
        tokio::spawn(contact_watch::run(self.0.clone(), live, (request, pause), sender));
        Ok(Response::new(ReceiverStream::new(stream)))
    }
}

/// Answers one message of a stream.
async fn answer(app: &AppState, starts: &mut OwnStarts, message: EvaluateStreamRequest) -> EvaluateStreamResponse {
    use proto::evaluate_stream_response::Result as Answered;
    let EvaluateStreamRequest { sequence, evaluate: question } = message;
    let answered = async {
        let question = question.ok_or_else(|| Invalid::new("evaluate", "is missing; send the question"))?;
        let time = CallTime::new(question.budget_ms)?;
        evaluate(app, Some(starts), &question, time).await
    };
    let result = match answered.await {
        Ok(answer) => Answered::Answer(answer),
        Err(status) => {
            let StreamError { code, reason, field, message } = error::in_stream(&status);
            Answered::Error(StreamError { code, reason, field, message })
        }
    };
    EvaluateStreamResponse { sequence, result: Some(result) }
}

/// Answers a question, from the warm starts of the caller where it has its own.
async fn evaluate(
    app: &AppState,
    starts: Option<&mut OwnStarts>,
    request: &EvaluateRequest,
    time: CallTime,
) -> Result<EvaluateResponse, Status> {
    let Some(question) = &request.question else {
        return Err(Invalid::new("question", "is missing; send pairs, within, closest or first_contact").into());
    };
    let scene = snapshot(app, &request.scene, request.at_least_revision).await?;
    let scene = match starts {
        Some(starts) => starts.lend(&scene),
        None => scene,
    };
    let outputs = query_wire::outputs(request)?;
    let ask = query_wire::ask(request, &outputs, &scene)?;
    let scene = match &request.pose_overrides {
        Some(table) => {
            let poses = query_wire::overrides(table, &scene)?;
            scene.posed(&poses).map_err(|error| Invalid::new("pose_overrides", error))?
        }
        None => scene,
    };
    let response = match question {
        Question::Pairs(list) => pairs(app, list, (scene, ask, outputs), time).await?,
        Question::Within(within) => {
            let margin = query_wire::length(within.margin_m, "within.margin_m")?;
            let selection = query_wire::selection(within.selection.as_ref(), &scene, "within.selection")?;
            let make = move |scene, ask| Within::new(scene, ask, selection, margin);
            within_margin(app, make, (scene, ask, outputs), time).await?
        }
        Question::FirstContact(first) => {
            let margin = query_wire::length(first.margin_m.unwrap_or(0.0), "first_contact.margin_m")?;
            let selection = query_wire::selection(first.selection.as_ref(), &scene, "first_contact.selection")?;
            let make = move |scene, ask| Within::first(scene, ask, selection, margin);
            within_margin(app, make, (scene, ask, outputs), time).await?
        }
        Question::Closest(closest) => {
            let most = match closest.max_distance_m {
                Some(most) => query_wire::length(most, "closest.max_distance_m")?,
                None => f64::INFINITY,
            };
            let selection = query_wire::selection(closest.selection.as_ref(), &scene, "closest.selection")?;
            let revision = scene.revision();
            let (crew, of, asked) = (app.crew(), scene.clone(), ask.clone());
            let search = move |stop: &Arc<Stop>| closest_pair(&crew, stop, (&of, &asked), &selection, most);
            let (found, complete) = app.search(search, time).await?.map_err(|_| error::abandoned())?;
            found_response(found.as_slice(), complete, (&scene, &ask, &outputs), revision)
        }
    };
    error::fits(&response)?;
    Ok(response)
}

async fn pairs(
    app: &AppState,
    list: &proto::PairList,
    (scene, ask, outputs): (Scene, Ask, Outputs),
    time: CallTime,
) -> Result<EvaluateResponse, Status> {
    let (operands, pairs) = query_wire::pair_list(list, &scene)?;
    if pairs.is_empty() {
        return Err(Invalid::new("pairs", "is empty; name at least one pair").into());
    }
    error::at_most("pairs", pairs.len() * ask.measures().len(), ("max_answers", MAX_ANSWERS))?;
    let scene_revision = scene.revision();
    let question = Pairs::new(scene, ask.clone(), operands, pairs).map_err(query_wire::pairs_error)?;
    let parts = app.ask(Arc::new(question), time).await?;
    let answers = || parts.iter().flatten();
    app.metrics().answered(answers());
    let complete = answers().all(|answer| answer.status != AnswerStatus::Deadline);
    let outcome = proto::Outcome::Found.into();
    let mut response = EvaluateResponse { scene_revision, outcome, complete, ..Default::default() };
    write(answers(), &ask, &outputs, &mut response);
    Ok(response)
}

async fn within_margin(
    app: &AppState,
    make: impl FnOnce(Scene, Ask) -> Within + Send + 'static,
    (scene, ask, outputs): (Scene, Ask, Outputs),
    time: CallTime,
) -> Result<EvaluateResponse, Status> {
    let revision = scene.revision();
    // The tree of a large scene takes milliseconds: not on a thread that serves connections.
    let (of, asked) = (scene.clone(), ask.clone());
    let question = app.prepare(&scene, move || make(of, asked)).await?;
    let parts = app.ask(Arc::new(question), time).await?;
    let (found, complete) = combined(&scene, parts);
    app.metrics().answered(found.iter().flat_map(|found| &found.answers));
    error::at_most("within", found.len() * ask.measures().len(), ("max_answers", MAX_ANSWERS))?;
    Ok(found_response(&found, complete, (&scene, &ask, &outputs), revision))
}

/// Answers as rows or in columns.
fn write<'a>(answers: impl Iterator<Item = &'a Answer>, ask: &Ask, outputs: &Outputs, response: &mut EvaluateResponse) {
    if outputs.columns {
        response.columns = columns::write(answers, ask.measures(), outputs);
    } else {
        response.answers = answers.map(|answer| query_wire::row(answer, outputs)).collect();
    }
}

fn found_response(
    found: &[Found],
    complete: bool,
    (scene, ask, outputs): (&Scene, &Ask, &Outputs),
    scene_revision: u64,
) -> EvaluateResponse {
    let (mut names, mut pairs) = (NameTable::default(), Packed::default());
    for slot in found.iter().flat_map(|found| found.pair) {
        pairs.index(names.place(slot, scene));
    }
    let outcome = if found.is_empty() { proto::Outcome::NothingInRange } else { proto::Outcome::Found };
    let mut response = EvaluateResponse {
        scene_revision,
        outcome: outcome.into(),
        complete,
        objects: names.names,
        pairs: pairs.into_bytes(),
        ..Default::default()
    };
    let answers = found.iter().flat_map(|found| &found.answers);
    write(answers, ask, outputs, &mut response);
    response
}

fn states_response(answers: &[StateAnswer], scene: &Scene, scene_revision: u64) -> CheckStatesResponse {
    let mut names = NameTable::default();
    let (mut verdicts, mut certainties, mut pairs) = (Packed::default(), Packed::default(), Packed::default());
    let (mut lower, mut upper) = (Packed::default(), Packed::default());
    let mut reasons = StateReasons::default();
    for answer in answers {
        reasons.push(answer.invalid.as_deref());
        let verdict = query_wire::verdict(answer.verdict);
        let certainty = query_wire::certainty(answer.certainty);
        verdicts.byte(u8::try_from(i32::from(verdict)).unwrap_or(0));
        certainties.byte(u8::try_from(i32::from(certainty)).unwrap_or(0));
        match answer.pair {
            Some(pair) => pair.into_iter().for_each(|slot| pairs.index(names.place(slot, scene))),
            None => [NOTHING; 2].into_iter().for_each(|index| pairs.index(index)),
        }
        lower.number(answer.lower_m);
        upper.number(answer.upper_m);
    }
    CheckStatesResponse {
        scene_revision,
        verdicts: verdicts.into_bytes(),
        certainties: certainties.into_bytes(),
        objects: names.names,
        pairs: pairs.into_bytes(),
        lower_m: lower.into_bytes(),
        upper_m: upper.into_bytes(),
        complete: answers.iter().all(|answer| answer.verdict != StateVerdict::NotChecked),
        solved_pairs: answers.iter().map(|answer| u64::from(answer.solved)).sum(),
        reasons: reasons.into_texts(),
    }
}

fn rays_response(answers: &[RayAnswer], scene: &Scene) -> CastRaysResponse {
    let (mut names, mut hits, mut status) = (NameTable::default(), Packed::default(), Packed::default());
    let (mut lower, mut upper) = (Packed::default(), Packed::default());
    let (mut points, mut normals) = (Packed::default(), Packed::default());
    for answer in answers {
        hits.index(answer.hit.map_or(NOTHING, |slot| names.place(slot, scene)));
        status.byte(u8::try_from(i32::from(query_wire::status(answer.status))).unwrap_or(0));
        lower.number(answer.lower_m);
        upper.number(answer.upper_m);
        points.vector(answer.point.as_ref());
        normals.vector(answer.normal.as_ref());
    }
    CastRaysResponse {
        scene_revision: scene.revision(),
        objects: names.names,
        hits: hits.into_bytes(),
        status: status.into_bytes(),
        lower_m: lower.into_bytes(),
        upper_m: upper.into_bytes(),
        points_m: points.into_bytes(),
        normals: normals.into_bytes(),
        complete: answers.iter().all(|answer| answer.status != AnswerStatus::Deadline),
    }
}
