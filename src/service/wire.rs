//! Between messages and the domain: the one place that knows both. Readers name the field they
//! refuse.

use std::collections::HashMap;
use std::sync::Arc;

use nalgebra::Vector3;

use crate::body::{Body, BodyId};
use crate::measure::{Distance, LevelDistance, Options, Pose, PoseError, Status, Twist};
use crate::scene::{Placement, Scene, Update, check_name};

use super::error::Invalid;
use super::limits::{DEFAULT_PAGE, MAX_PAGE};
use super::proto;

pub(super) fn body_file(json: &[u8]) -> Result<Body, Invalid> {
    let field = "body_file_json";
    let text = std::str::from_utf8(json).map_err(|error| Invalid::new(field, format!("is no UTF-8 text: {error}")))?;
    Body::from_json(text).map_err(|error| Invalid::new(field, error))
}

pub(super) fn body_id(id: &str, field: &str) -> Result<BodyId, Invalid> {
    id.parse()
        .map_err(|_| Invalid::new(field, "is no body id; give the 64 lowercase hexadecimal digits CreateBody returned"))
}

pub(super) fn name(name: &str, field: &str) -> Result<(), Invalid> {
    check_name(name).map_err(|error| Invalid::new(field, error))
}

/// A page: how many items, and the token of the last item before it.
pub(super) fn page(size: u32, token: &str) -> (usize, Option<&str>) {
    let size = if size == 0 { DEFAULT_PAGE } else { usize::try_from(size).unwrap_or(MAX_PAGE).min(MAX_PAGE) };
    (size, Some(token).filter(|token| !token.is_empty()))
}

pub(super) fn pose(pose: Option<&proto::Pose>, field: &str) -> Result<Pose, Invalid> {
    let missing = |field: String| Invalid::new(field, "is missing; send it, identity and zero included");
    let pose = pose.ok_or_else(|| missing(field.to_owned()))?;
    let at = |leaf: &str| format!("{field}.{leaf}");
    let translation = pose.translation_m.as_ref().ok_or_else(|| missing(at("translation_m")))?;
    let rotation = pose.rotation.as_ref().ok_or_else(|| missing(at("rotation")))?;
    let numbers = [
        ("translation_m.x", translation.x),
        ("translation_m.y", translation.y),
        ("translation_m.z", translation.z),
        ("rotation.x", rotation.x),
        ("rotation.y", rotation.y),
        ("rotation.z", rotation.z),
        ("rotation.w", rotation.w),
    ];
    for (leaf, number) in numbers {
        if !number.is_finite() {
            return Err(Invalid::new(at(leaf), format!("is {number}; send a finite number")));
        }
    }
    let translation = Vector3::new(translation.x, translation.y, translation.z);
    Pose::from_quaternion(translation, [rotation.x, rotation.y, rotation.z, rotation.w]).map_err(|error| {
        Invalid::new(at(if matches!(error, PoseError::TooFar(_)) { "translation_m" } else { "rotation" }), error)
    })
}

pub(super) fn update(request: &proto::UpdateSceneRequest) -> Result<Update, Invalid> {
    let mut update = Update { expected_revision: request.expected_revision, ..Update::default() };
    for (index, object) in request.upsert_objects.iter().enumerate() {
        let at = |leaf: &str| format!("upsert_objects[{index}].{leaf}");
        update.upserts.push(Placement {
            name: object.name.as_str().into(),
            body: body_id(&object.body_id, &at("body_id"))?,
            pose: pose(object.pose.as_ref(), &at("pose"))?,
            group: object.group.as_str().into(),
        });
    }
    for (index, object) in request.set_poses.iter().enumerate() {
        let pose = pose(object.pose.as_ref(), &format!("set_poses[{index}].pose"))?;
        update.poses.push((object.name.as_str().into(), pose));
    }
    update.removals = request.remove_objects.iter().map(|name| name.as_str().into()).collect();
    update.allow = request.allow_pairs.iter().map(names).collect();
    update.forbid = request.forbid_pairs.iter().map(names).collect();
    Ok(update)
}

fn names(pair: &proto::ObjectPair) -> (Arc<str>, Arc<str>) {
    (pair.a.as_str().into(), pair.b.as_str().into())
}

/// Poses that stand in for the scene's own, by object name.
pub(super) fn overrides(poses: &[proto::ObjectPose]) -> Result<HashMap<&str, Pose>, Invalid> {
    let mut overrides = HashMap::with_capacity(poses.len());
    for (index, object) in poses.iter().enumerate() {
        let at = |leaf: &str| format!("pose_overrides[{index}].{leaf}");
        name(&object.name, &at("name"))?;
        let pose = pose(object.pose.as_ref(), &at("pose"))?;
        if overrides.insert(object.name.as_str(), pose).is_some() {
            return Err(Invalid::new(at("name"), format!("object \"{}\" is named twice; name it once", object.name)));
        }
    }
    Ok(overrides)
}

pub(super) fn measures(request: &proto::EvaluateRequest) -> Result<Vec<proto::Measure>, Invalid> {
    let mut measures = Vec::new();
    for (index, &number) in request.measures.iter().enumerate() {
        let refused = |why: &str| Err(Invalid::new(format!("measures[{index}]"), why));
        match proto::Measure::try_from(number) {
            Err(_) | Ok(proto::Measure::Unspecified) => return refused("is no measure this server knows"),
            Ok(measure) if measures.contains(&measure) => return refused("is asked for twice; ask once"),
            Ok(measure) => measures.push(measure),
        }
    }
    if measures.is_empty() {
        return Err(Invalid::new("measures", "is empty; name at least one measure"));
    }
    Ok(measures)
}

/// How narrow the brackets of one call have to be, see `Accuracy` in `proto/`.
#[derive(Debug, Clone, Copy)]
pub(super) struct Accuracy {
    pub(super) distance: Options<'static>,
    pub(super) level: Options<'static>,
}

pub(super) fn accuracy(accuracy: Option<&proto::Accuracy>) -> Result<Accuracy, Invalid> {
    let mut result = Accuracy { distance: Options::default(), level: Options::default() };
    let asked = accuracy.copied().unwrap_or_default();
    for (leaf, asked, target) in [
        ("distance_relative", asked.distance_relative, &mut result.distance),
        ("level_relative", asked.level_relative, &mut result.level),
    ] {
        if let Some(value) = asked {
            *target = target.with_accuracy(value).map_err(|_| {
                let why = format!("is {value}; send a number above 0 and at most 1, or leave it out for 1e-9");
                Invalid::new(format!("accuracy.{leaf}"), why)
            })?;
        }
    }
    Ok(result)
}

pub(super) fn summary(body: &Body) -> proto::BodySummary {
    let bounds = body.bounding_box();
    proto::BodySummary {
        id: body.id().to_string(),
        name: body.name().to_owned(),
        degree: count(body.degree()),
        constraint_count: count(body.constraints().len()),
        volume_m3: body.volume().volume_m3,
        min_value: body.min_value(),
        bounding_box: Some(proto::BoundingBox { min_m: Some(vector(&bounds.min)), max_m: Some(vector(&bounds.max)) }),
    }
}

pub(super) fn scene_summary(scene: &Scene) -> proto::SceneSummary {
    proto::SceneSummary {
        name: scene.name().to_string(),
        revision: scene.revision(),
        object_count: count(scene.objects().len()),
    }
}

pub(super) fn scene(scene: &Scene) -> proto::Scene {
    let objects = scene.objects().map(|object| proto::Object {
        name: object.name.to_string(),
        body_id: object.body.id().to_string(),
        pose: Some(pose_message(&object.pose)),
        group: object.group.to_string(),
    });
    let pairs = scene.allowed_pairs().map(|(a, b)| proto::ObjectPair { a: a.to_string(), b: b.to_string() });
    proto::Scene {
        name: scene.name().to_string(),
        revision: scene.revision(),
        objects: objects.collect(),
        allowed_pairs: pairs.collect(),
    }
}

/// A distance with what follows from it for the bodies as they stand.
pub(super) fn distance(
    found: &Distance,
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
) -> proto::DistanceResult {
    let [gradient_a, gradient_b] =
        found.gradients(pose_a, pose_b).map_or([None; 2], |both| both.map(|twist| Some(gradient(&twist))));
    let [part_a, part_b] = found.parts.map(u32::from);
    proto::DistanceResult {
        status: status(found.status, found.lower, found.upper).into(),
        value_m: found.value(),
        lower_m: found.lower,
        upper_m: found.upper,
        witness_a_m: Some(vector(&found.witness_a)),
        witness_b_m: Some(vector(&found.witness_b)),
        normal: found.normal.as_ref().map(vector),
        iterations: found.iterations,
        hulls_upper_m: found.hulls_upper(a, b),
        gradient_a,
        gradient_b,
        tied: found.tied,
        part_a,
        part_b,
    }
}

pub(super) fn level_distance(found: &LevelDistance) -> proto::LevelDistanceResult {
    proto::LevelDistanceResult {
        status: status(found.status, found.lower, found.upper).into(),
        value: found.value(),
        lower: found.lower,
        upper: found.upper,
        witness_m: Some(vector(&found.witness)),
        iterations: found.iterations,
        multiplier: found.multiplier,
        saturated: found.saturated,
        gradient_p: Some(gradient(&found.gradient_a)),
        gradient_q: Some(gradient(&found.gradient_b)),
        tied: found.tied,
    }
}

/// A bracket without an end is never narrow enough, as `proto/` promises.
fn status(status: Status, lower: f64, upper: f64) -> proto::SolveStatus {
    match status {
        Status::Converged if lower.is_finite() && upper.is_finite() => proto::SolveStatus::Converged,
        Status::Converged | Status::BracketWide => proto::SolveStatus::BracketWide,
    }
}

fn pose_message(pose: &Pose) -> proto::Pose {
    let rotation = pose.rotation().coords;
    proto::Pose {
        translation_m: Some(vector(pose.translation())),
        rotation: Some(proto::Quaternion { x: rotation.x, y: rotation.y, z: rotation.z, w: rotation.w }),
    }
}

fn vector(v: &Vector3<f64>) -> proto::Vector3 {
    proto::Vector3 { x: v.x, y: v.y, z: v.z }
}

fn gradient(twist: &Twist) -> proto::PoseGradient {
    proto::PoseGradient { linear: Some(vector(&twist.linear)), angular: Some(vector(&twist.angular)) }
}

pub(super) fn count(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bracket_without_an_end_has_not_converged() {
        let (converged, wide) = (proto::SolveStatus::Converged, proto::SolveStatus::BracketWide);
        for (lower, upper, says) in [
            (1.0, 1.0, converged),
            (f64::NEG_INFINITY, 1.0, wide),
            (1.0, f64::INFINITY, wide),
            (f64::NAN, f64::NAN, wide),
        ] {
            let none = Twist { linear: Vector3::zeros(), angular: Vector3::zeros() };
            let found = LevelDistance {
                status: Status::Converged,
                lower,
                upper,
                witness: Vector3::zeros(),
                multiplier: 0.0,
                saturated: false,
                gradient_a: none,
                gradient_b: none,
                tied: false,
                iterations: 1,
            };
            let sent = level_distance(&found);
            assert_eq!(sent.status(), says);
            assert_eq!((sent.lower.to_bits(), sent.upper.to_bits()), (lower.to_bits(), upper.to_bits()));
        }
    }
}
