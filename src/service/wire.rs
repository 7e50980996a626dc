//! Between messages and the domain: the one place that knows both. Readers name the field they
//! refuse.

use std::time::Duration;

use nalgebra::Vector3;

use crate::body::BodyId;
use crate::measure::{Pose, PoseError, Twist};
use crate::scene::check_name;

use super::error::Invalid;
use super::limits::{DEFAULT_PAGE, DEFAULT_WATCH_PAUSE, MAX_PAGE};
use super::proto;

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

pub(crate) fn pose(pose: Option<&proto::Pose>, field: &str) -> Result<Pose, Invalid> {
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

/// Pause between two messages of a watcher.
pub(super) fn pause(max_rate_hz: Option<f64>) -> Result<Duration, Invalid> {
    match max_rate_hz {
        None => Ok(DEFAULT_WATCH_PAUSE),
        // Slower than once an hour is a mistake.
        Some(rate) if rate >= 1.0 / 3600.0 => Ok(Duration::from_secs_f64(1.0 / rate)),
        Some(rate) => {
            Err(Invalid::new("max_rate_hz", format!("is {rate}; send a rate above 0, or leave it out for 60")))
        }
    }
}

pub(super) fn pose_message(pose: &Pose) -> proto::Pose {
    let rotation = pose.rotation().coords;
    proto::Pose {
        translation_m: Some(vector(pose.translation())),
        rotation: Some(proto::Quaternion { x: rotation.x, y: rotation.y, z: rotation.z, w: rotation.w }),
    }
}

pub(super) fn vector(v: &Vector3<f64>) -> proto::Vector3 {
    proto::Vector3 { x: v.x, y: v.y, z: v.z }
}

pub(super) fn gradient(twist: &Twist) -> proto::PoseGradient {
    proto::PoseGradient { linear: Some(vector(&twist.linear)), angular: Some(vector(&twist.angular)) }
}

pub(super) fn count(count: usize) -> u32 {
    u32::try_from(count).unwrap_or(u32::MAX)
}
