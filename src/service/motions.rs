//! CheckMotions and VerifyMotion: paths of a robot, and certificates.

use std::sync::Arc;

use tonic::Status;

use super::app_state::AppState;
use super::call_time::CallTime;
use super::error::{self, Invalid};
use super::limits::{MAX_CERTIFICATES, MAX_MOTIONS, SMALL_SCENE};
use super::packed::{self, Packed};
use super::placed_states::joint_width;
use super::proto::{
    self, CheckMotionsRequest, CheckMotionsResponse, MovingObjects, VerifyMotionRequest, VerifyMotionResponse,
};
use super::query_wire::{self, NOTHING, NameTable};
use super::reason::Reason;
use super::snapshot::snapshot;
use crate::robot::motion::{Certificate, MotionAnswer, MotionProblemError, MotionVerdict, PathError, VerifyOptions};
use crate::robot::{Kinematics, counted};
use crate::scene::query::{MotionSettings, MovingObject, PathKind, RobotMotionAnswer, RobotMotions, RobotMotionsError};
use crate::scene::{Geometry, Scene, Stop};

/// Answers CheckMotions.
pub(super) async fn check(
    app: &AppState,
    request: CheckMotionsRequest,
    time: CallTime,
) -> Result<CheckMotionsResponse, Status> {
    let scene = snapshot(app, &request.scene, request.at_least_revision).await?;
    let is_small = scene.len() <= SMALL_SCENE && request.joint_values.len() <= SMALL_PATHS_BYTES;
    let prepare = move || asked(&scene, &request);
    let motions = if is_small { prepare()? } else { app.work(prepare).await?? };
    let motions = Arc::new(motions);
    let answers = app.ask(motions.clone(), time).await?;
    Ok(response(&answers, &motions))
}

/// Joint values of paths, in bytes, that are read on the thread that serves the connection.
const SMALL_PATHS_BYTES: usize = 1 << 16;

/// The motions of a request.
fn asked(scene: &Scene, request: &CheckMotionsRequest) -> Result<RobotMotions, Status> {
    let motions = motions(scene, &request.robot, request.moving.as_ref(), request.margin_m, request.include_allowed)?;
    let values = packed::numbers(&request.joint_values, "joint_values")?;
    let points = points(request, values.len(), motions.kinematics())?;
    error::at_most("point_counts", points.len(), ("max_motions", MAX_MOTIONS))?;
    if request.certificates {
        error::at_most("point_counts", points.len(), ("max_certificates", MAX_CERTIFICATES))?;
    }
    let kind = match proto::PathKind::try_from(request.kind) {
        Ok(proto::PathKind::Unspecified | proto::PathKind::Waypoints) => PathKind::Waypoints,
        Ok(proto::PathKind::Bezier) => PathKind::Bezier,
        Err(_) => return Err(Invalid::new("kind", "is no kind of path this server knows").into()),
    };
    let joints: Vec<Arc<str>> = request.joints.iter().map(|name| name.as_str().into()).collect();
    let motions = motions.with_joint_paths(&joints, &values, &points, kind);
    let motions = motions.map_err(|error| motions_error(&error, scene, request.moving.as_ref()))?;
    let motions = motions.with_settings(settings(request)?);
    Ok(if request.stop_at_first { motions.stopping_at_first() } else { motions })
}

/// Answers VerifyMotion.
pub(super) async fn verify(
    app: &AppState,
    request: VerifyMotionRequest,
    time: CallTime,
) -> Result<VerifyMotionResponse, Status> {
    let certificate =
        Certificate::from_json(&request.certificate).map_err(|error| Invalid::new("certificate", error))?;
    let against = match (request.scene.is_empty(), request.robot.is_empty()) {
        (true, true) => {
            if request.moving.is_some() || request.margin_m != 0.0 || request.include_allowed {
                let why = "is missing; moving, margin_m and include_allowed are about a robot in a scene";
                return Err(Invalid::new("scene", why).into());
            }
            None
        }
        (true, false) => return Err(Invalid::new("scene", "is missing; name the scene of the robot").into()),
        (false, true) => return Err(Invalid::new("robot", "is missing; name a robot of the scene").into()),
        (false, false) => {
            let scene = snapshot(app, &request.scene, request.at_least_revision).await?;
            let (moving, margin) = (request.moving.as_ref(), request.margin_m);
            Some(motions(&scene, &request.robot, moving, margin, request.include_allowed)?)
        }
    };
    let scene_revision = against.as_ref().map_or(0, |motions| motions.scene().revision());
    let catalogue = if app.is_loaded() { Some(app.catalogue().await?) } else { None };
    let check = move |stop: &Arc<Stop>| match against {
        Some(motions) => motions.verify(&certificate, stop),
        None => {
            let known = |id: &str| match catalogue.as_ref()?.geometry(&id.parse().ok()?) {
                Ok(Geometry::Solid(shape)) => Some(shape),
                _ => None,
            };
            certificate.verify_with(&VerifyOptions { known: Some(&known), stop: Some(stop.flag()) })
        }
    };
    // Proving the bodies of a certificate again takes some tens of milliseconds each.
    let verified = app.prove_within(check, time).await?;
    Ok(match verified {
        Ok(verified) => VerifyMotionResponse {
            holds: true,
            reason: String::new(),
            clearance_lower_m: verified.clearance_lower_m,
            configurations: u32::try_from(verified.configurations).unwrap_or(u32::MAX),
            scene_revision,
        },
        Err(error) => VerifyMotionResponse {
            holds: false,
            reason: error.to_string(),
            clearance_lower_m: f64::NAN,
            configurations: 0,
            scene_revision,
        },
    })
}

/// Motions of a robot among the objects of a scene.
fn motions(
    scene: &Scene,
    robot: &str,
    moving: Option<&MovingObjects>,
    margin_m: f64,
    include_allowed: bool,
) -> Result<RobotMotions, Status> {
    if robot.is_empty() {
        return Err(Invalid::new("robot", "is missing; name a robot of the scene").into());
    }
    if scene.robot(robot).is_none() {
        let why = format!("no robot \"{robot}\" in scene \"{}\"; place it first", scene.name());
        return Err(error::not_found(Reason::RobotNotFound, robot, "robot", why));
    }
    if !margin_m.is_finite() {
        return Err(Invalid::new("margin_m", format!("is {margin_m} m; give a finite number")).into());
    }
    let objects = moving.map(|moving| moving_objects(scene, moving)).transpose()?.unwrap_or_default();
    let motions = RobotMotions::new(scene.clone(), robot, &objects, margin_m, include_allowed);
    motions.map_err(|error| motions_error(&error, scene, moving).into())
}

fn moving_objects(scene: &Scene, moving: &MovingObjects) -> Result<Vec<MovingObject>, Status> {
    let slots = query_wire::slots(scene, &moving.names, "moving.names")?;
    let from = packed::poses(&moving.start_poses, "moving.start_poses")?;
    let to = packed::poses(&moving.end_poses, "moving.end_poses")?;
    for (poses, field) in [(&from, "moving.start_poses"), (&to, "moving.end_poses")] {
        if poses.len() != slots.len() {
            let (poses, names) = (counted(poses.len(), "pose", "poses"), counted(slots.len(), "name", "names"));
            let why = format!("holds {poses} for {names}; send one a name");
            return Err(Invalid::new(field, why).into());
        }
    }
    let objects = slots.into_iter().zip(from).zip(to);
    Ok(objects.map(|((slot, from), to)| MovingObject { slot, from, to }).collect())
}

/// Configurations of each path.
fn points(request: &CheckMotionsRequest, values: usize, kinematics: &Kinematics) -> Result<Vec<usize>, Invalid> {
    let counts = packed::indices::<1>(&request.point_counts, "point_counts")?;
    if !counts.is_empty() {
        return Ok(counts.into_iter().map(|[count]| count as usize).collect());
    }
    if values == 0 {
        return Err(Invalid::new("joint_values", "is empty; send 2 configurations for each edge"));
    }
    // At least one edge: names of joints and numbers of values that are wrong are refused with it.
    let width = joint_width(kinematics, &request.joints);
    Ok(vec![2; width.map_or(1, |width| values / (2 * width).max(1)).max(1)])
}

fn settings(request: &CheckMotionsRequest) -> Result<MotionSettings, Invalid> {
    let length = |value: Option<f64>, field: &str| match value {
        // Not `<=`: a NaN is refused, too.
        Some(value) if !(value > 0.0 && value.is_finite()) => {
            Err(Invalid::new(field, format!("is {value} m; give a finite number above 0, or leave it out")))
        }
        value => Ok(value),
    };
    let defaults = MotionSettings::default();
    if request.max_configurations == Some(0) {
        return Err(Invalid::new("max_configurations", "is 0; give a number above 0, or leave it out"));
    }
    Ok(MotionSettings {
        resolution_m: length(request.resolution_m, "resolution_m")?.unwrap_or(defaults.resolution_m),
        max_configurations: request.max_configurations.unwrap_or(defaults.max_configurations),
        first_contact: request.first_contact,
        clearance_accuracy_m: length(request.clearance_accuracy_m, "clearance_accuracy_m")?,
        certificates: request.certificates,
        cold: request.cold,
    })
}

/// Which field makes motions unusable.
fn motions_error(error: &RobotMotionsError, scene: &Scene, moving: Option<&MovingObjects>) -> Invalid {
    let of_moving = |list: &str, object: &str| match carrier(scene, moving, object) {
        Some(index) => format!("moving.{list}[{index}]"),
        None => "robot".to_owned(),
    };
    let field = match error {
        RobotMotionsError::NoRobot(_)
        | RobotMotionsError::Far(_)
        | RobotMotionsError::Problem(MotionProblemError::Pairs(_)) => "robot".to_owned(),
        RobotMotionsError::Held(object) | RobotMotionsError::HalfSpace(object) | RobotMotionsError::TooFar(object) => {
            of_moving("names", object)
        }
        RobotMotionsError::Twice(object) => {
            let names = moving.into_iter().flat_map(|moving| &moving.names).enumerate();
            let second = names.filter(|(_, name)| ***name == **object).nth(1);
            second.map_or_else(|| "moving.names".to_owned(), |(index, _)| format!("moving.names[{index}]"))
        }
        RobotMotionsError::NoShape(_) => "scene".to_owned(),
        RobotMotionsError::Problem(MotionProblemError::Obstacle(object)) => of_moving("end_poses", object),
        RobotMotionsError::Path { error: PathError::Floating, .. } => "kind".to_owned(),
        RobotMotionsError::Problem(_) => "margin_m".to_owned(),
        RobotMotionsError::Joints(error) => query_wire::joints_field(error),
        RobotMotionsError::Values { .. } | RobotMotionsError::Large { .. } => "joint_values".to_owned(),
        RobotMotionsError::Path { index, .. } => format!("point_counts[{index}]"),
    };
    Invalid::new(field, error)
}

/// Position, among the names of objects that move by themselves, of an object or else of what holds
/// it; none of what the robot holds.
fn carrier(scene: &Scene, moving: Option<&MovingObjects>, object: &str) -> Option<usize> {
    let names = &moving?.names;
    let mut slot = scene.slot(object)?;
    loop {
        let object = scene.object(slot)?;
        if let Some(index) = names.iter().position(|name| **name == *object.name) {
            return Some(index);
        }
        slot = scene.slot(&object.attachment.as_ref()?.to)?;
    }
}

/// Columns of an answer, a row a path.
#[derive(Default)]
struct Columns {
    names: NameTable,
    verdicts: Packed,
    alpha: Packed,
    clearance: Packed,
    pairs: Packed,
    contact_s: Packed,
    open_pairs: Packed,
    open_s: Packed,
    bounds: [Packed; 2],
    witnesses: Packed,
    normals: Packed,
    configurations: Packed,
    certificates: Vec<String>,
    reasons: Vec<String>,
}

impl Columns {
    fn row(&mut self, verdict: proto::Verdict, answer: Option<&MotionAnswer>, motions: &RobotMotions) {
        self.verdicts.byte(u8::try_from(i32::from(verdict)).unwrap_or(0));
        self.alpha.number(answer.map_or(0.0, |answer| answer.alpha));
        let clearance = answer.filter(|answer| answer.alpha > 0.0).map_or(f64::NAN, |answer| answer.clearance_lower_m);
        self.clearance.number(clearance);
        self.configurations.index(answer.map_or(0, |answer| answer.configurations));
        let contact = answer.and_then(|answer| answer.contact.as_ref());
        let open = answer.and_then(|answer| answer.open.as_ref());
        for (column, at) in [(&mut self.pairs, contact), (&mut self.open_pairs, open)] {
            let mut place = |item| self.names.place(motions.slot(item), motions.scene());
            let indices = at.map_or([NOTHING; 2], |at| at.items.map(&mut place));
            indices.into_iter().for_each(|index| column.index(index));
        }
        let number = |value: Option<f64>| value.unwrap_or(f64::NAN);
        self.contact_s.number(number(contact.map(|contact| contact.s)));
        self.open_s.number(number(open.map(|open| open.s)));
        self.bounds[0].number(number(contact.map(|contact| contact.lower_m)));
        self.bounds[1].number(number(contact.map(|contact| contact.upper_m)));
        for side in 0..2 {
            self.witnesses.vector(contact.map(|contact| &contact.witnesses[side]));
        }
        self.normals.vector(contact.and_then(|contact| contact.normal.as_ref()));
        let certificate = answer.and_then(|answer| answer.certificate.as_ref());
        self.certificates.push(certificate.map(|certificate| certificate.to_json()).unwrap_or_default());
    }
}

fn response(answers: &[RobotMotionAnswer], motions: &RobotMotions) -> CheckMotionsResponse {
    let mut columns = Columns::default();
    let (mut complete, mut first) = (true, 0);
    for (answer, path) in answers.iter().zip(motions.paths()) {
        let mut reason = String::new();
        let (verdict, answer) = match answer {
            RobotMotionAnswer::Checked(answer) => (verdict(answer.verdict), Some(&**answer)),
            RobotMotionAnswer::Invalid(point, error) => {
                let field = format!("joint_values[{}]", first + point);
                reason = Invalid::new(field, error).to_string();
                (proto::Verdict::Invalid, None)
            }
            RobotMotionAnswer::NotChecked => (proto::Verdict::NotChecked, None),
        };
        first += path.points().len();
        columns.reasons.push(reason);
        complete &= verdict != proto::Verdict::NotChecked && answer.is_none_or(|answer| !answer.ended_early);
        columns.row(verdict, answer, motions);
    }
    let [lower, upper] = columns.bounds;
    let unless_empty = |texts: Vec<String>| if texts.iter().all(String::is_empty) { Vec::new() } else { texts };
    CheckMotionsResponse {
        scene_revision: motions.scene().revision(),
        verdicts: columns.verdicts.into_bytes(),
        alpha: columns.alpha.into_bytes(),
        clearance_lower_m: columns.clearance.into_bytes(),
        objects: columns.names.names,
        pairs: columns.pairs.into_bytes(),
        contact_s: columns.contact_s.into_bytes(),
        lower_m: lower.into_bytes(),
        upper_m: upper.into_bytes(),
        witnesses_m: columns.witnesses.into_bytes(),
        normals: columns.normals.into_bytes(),
        configurations: columns.configurations.into_bytes(),
        certificates: unless_empty(columns.certificates),
        complete,
        reasons: unless_empty(columns.reasons),
        open_pairs: columns.open_pairs.into_bytes(),
        open_s: columns.open_s.into_bytes(),
    }
}

fn verdict(verdict: MotionVerdict) -> proto::Verdict {
    match verdict {
        MotionVerdict::Free => proto::Verdict::Free,
        MotionVerdict::Contact => proto::Verdict::Contact,
        MotionVerdict::Undecided => proto::Verdict::Undecided,
    }
}
