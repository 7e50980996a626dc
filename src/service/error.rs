//! The one place where errors become gRPC statuses: a code, a message with the remedy, and details
//! for programs (`ErrorInfo` with a reason, `BadRequest` with field paths, `ResourceInfo`,
//! `PreconditionFailure`).

use std::collections::HashMap;
use std::fmt;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

use crate::scene::{Entry, JointsError, List, Part, SceneError};
use crate::store::{CatalogueError, MAX_FORKS, StoreError};

use super::limits::MAX_MESSAGE_BYTES;
use super::proto::StreamError;
use super::reason::Reason;
use super::tokens::Role;

/// A field of a request that cannot be used.
#[derive(Debug)]
pub(crate) struct Invalid {
    /// Path in the request, such as `pairs[3].a`.
    pub(crate) field: String,
    /// The reason and the remedy.
    pub(crate) why: String,
}

impl Invalid {
    pub(super) fn new(field: impl Into<String>, why: impl fmt::Display) -> Self {
        Self { field: field.into(), why: why.to_string() }
    }
}

impl fmt::Display for Invalid {
    /// As errors of the service say it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&short(format!("{}: {}", self.field, self.why)))
    }
}

impl From<Invalid> for Status {
    fn from(invalid: Invalid) -> Self {
        let message = invalid.to_string();
        let Invalid { field, why } = invalid;
        let mut details = details(Reason::InvalidField);
        details.add_bad_request_violation(field, short(why));
        Self::with_error_details(Code::InvalidArgument, message, details)
    }
}

/// NOT_FOUND for a named thing; `field` is where the request named it.
pub(super) fn not_found(reason: Reason, name: &str, field: &str, why: impl fmt::Display) -> Status {
    let mut details = details(reason);
    let why = short(why.to_string());
    let kind = reason.name().trim_end_matches("_NOT_FOUND").to_lowercase();
    details.set_resource_info(kind, short(name.to_owned()), "", why.clone());
    details.add_bad_request_violation(field, why.clone());
    Status::with_error_details(Code::NotFound, format!("{field}: {why}"), details)
}

/// ABORTED: somebody else was first; `revision` is where the scene is now.
pub(super) fn aborted(reason: Reason, field: &str, why: impl fmt::Display, revision: u64) -> Status {
    let mut details = details_with(reason, [("revision", revision.to_string())]);
    let why = short(why.to_string());
    details.add_bad_request_violation(field, why.clone());
    Status::with_error_details(Code::Aborted, why, details)
}

/// RESOURCE_EXHAUSTED where a list is longer than its limit, which has a name in `Limits`.
pub(super) fn at_most(field: &str, count: usize, (name, limit): (&str, usize)) -> Result<(), Status> {
    if count <= limit {
        return Ok(());
    }
    let why = format!("asks for {count}, and a call takes at most {limit} ({name}); split it into several calls");
    let mut details = details_with(Reason::LimitExceeded, [("limit", name.to_owned()), ("value", limit.to_string())]);
    details.add_bad_request_violation(field, why.clone());
    Err(Status::with_error_details(Code::ResourceExhausted, format!("{field}: {why}"), details))
}

/// RESOURCE_EXHAUSTED for a message that is longer than its limit.
pub(super) fn message_fits(bytes: usize) -> Result<(), Status> {
    let limit = MAX_MESSAGE_BYTES;
    if bytes <= limit {
        return Ok(());
    }
    let message = format!(
        "the message has {bytes} bytes, and one may have {limit} (max_message_bytes); split it, or upload files with \
         UploadBlob"
    );
    let limits = [("limit", "max_message_bytes".to_owned()), ("value", limit.to_string())];
    Err(Status::with_error_details(Code::ResourceExhausted, message, details_with(Reason::LimitExceeded, limits)))
}

/// RESOURCE_EXHAUSTED where an answer does not fit in a message.
pub(super) fn fits(response: &impl prost::Message) -> Result<(), Status> {
    let (bytes, limit) = (response.encoded_len(), MAX_MESSAGE_BYTES);
    if bytes <= limit {
        return Ok(());
    }
    let message = format!(
        "the answer has {bytes} bytes, and a message at most {limit} (max_message_bytes); ask for fewer pairs, states \
         or outputs, or for LAYOUT_COLUMNS"
    );
    let limits = [("limit", "max_message_bytes".to_owned()), ("value", limit.to_string())];
    Err(Status::with_error_details(Code::ResourceExhausted, message, details_with(Reason::LimitExceeded, limits)))
}

/// FAILED_PRECONDITION: a body without a bounded surface.
pub(super) fn no_surface(id: &str) -> Status {
    let message = format!("body {id} is a half-space, which has no bounded surface; draw its plane");
    failed_precondition(Reason::NoSurface, &format!("body/{id}"), message)
}

/// DEADLINE_EXCEEDED: the client's own time is over.
pub(super) fn deadline() -> Status {
    let message = "the deadline of the call has passed; ask for less, allow more time, or send budget_ms for what is \
                   known by then";
    Status::with_error_details(Code::DeadlineExceeded, message, details(Reason::Deadline))
}

/// UNAUTHENTICATED: no token, or one that is not known.
pub(super) fn unauthenticated(shown: bool) -> Status {
    let (reason, message) = if shown {
        (Reason::TokenUnknown, "the token is not known; send the one you were given as authorization: Bearer TOKEN")
    } else {
        (Reason::TokenMissing, "the call needs a token; send it in the metadata as authorization: Bearer TOKEN")
    };
    Status::with_error_details(Code::Unauthenticated, message, details(reason))
}

/// PERMISSION_DENIED: the role of a token is not enough.
pub(super) fn permission_denied(path: &str, name: &str, needed: Role) -> Status {
    let needed = match needed {
        Role::Read => "read",
        Role::Write => "write",
        Role::Admin => "admin",
    };
    let message =
        format!("{path} needs the role {needed}, which the token \"{name}\" does not have; ask for one that has");
    let details = details_with(Reason::RoleNeeded, [("role", needed.to_owned())]);
    Status::with_error_details(Code::PermissionDenied, short(message), details)
}

/// RESOURCE_EXHAUSTED: the call has waited for its turn as long as it may.
pub(super) fn shed(waited: Duration) -> Status {
    let message =
        format!("the server is busy: the call waited {waited:?} for its turn; try again later, or ask less often");
    let mut details = details(Reason::Overloaded);
    details.set_retry_info(Some(waited));
    Status::with_error_details(Code::ResourceExhausted, message, details)
}

/// INTERNAL: a question ended without an answer.
pub(super) fn abandoned() -> Status {
    tracing::error!("a question was ended by a panic");
    let message = "the question was ended by a panic in the server; its log says more, please report it";
    Status::with_error_details(Code::Internal, message, details(Reason::InternalPanic))
}

/// INTERNAL for what cannot happen.
pub(super) fn internal(error: &dyn fmt::Display) -> Status {
    tracing::error!(%error, "a defect");
    Status::with_error_details(Code::Internal, "a defect of the server; please report it", details(Reason::Internal))
}

/// A status inside a stream that goes on.
pub(super) fn in_stream(status: &Status) -> StreamError {
    let details = status.get_error_details();
    let violation = details.bad_request().and_then(|bad| bad.field_violations.first());
    StreamError {
        code: u32::try_from(i32::from(status.code())).unwrap_or(0),
        reason: details.error_info().map(|info| info.reason.clone()).unwrap_or_default(),
        field: violation.map(|violation| violation.field.clone()).unwrap_or_default(),
        message: status.message().to_owned(),
    }
}

/// UNAVAILABLE: the client may try again.
pub(super) fn unavailable(reason: Reason, message: &str) -> Status {
    Status::with_error_details(Code::Unavailable, message, details(reason))
}

/// DEADLINE_EXCEEDED: a call that was too much, or whose message did not come.
pub(super) fn too_slow(limit: Duration) -> Status {
    too_long(format!("the call was not read and answered within {} s; ask for less in one call", limit.as_secs()))
}

/// DEADLINE_EXCEEDED: a piece of an answer that its client did not read.
pub(super) fn not_read(limit: Duration) -> Status {
    too_long(format!("the client read nothing for {} s; ask again on a better connection", limit.as_secs()))
}

fn too_long(message: String) -> Status {
    Status::with_error_details(Code::DeadlineExceeded, message, details(Reason::CallTooLong))
}

/// INTERNAL for a task that panicked.
pub(super) fn internal_panic(error: &tokio::task::JoinError) -> Status {
    tracing::error!(%error, "a call was ended by a panic");
    let message = "the call was ended by a panic in the server; its log says more, please report it";
    Status::with_error_details(Code::Internal, message, details(Reason::InternalPanic))
}

fn failed_precondition(reason: Reason, subject: &str, message: String) -> Status {
    let mut details = details(reason);
    details.add_precondition_failure_violation(reason.name(), subject, message.clone());
    Status::with_error_details(Code::FailedPrecondition, message, details)
}

fn damaged(reason: Reason, kind: &str, name: &str, message: String) -> Status {
    let mut details = details(reason);
    details.set_resource_info(kind, name, "", message.clone());
    Status::with_error_details(Code::DataLoss, message, details)
}

/// Maps a failure of the catalogue; `field` is where the request named the scene or body the call
/// is about.
pub(super) fn catalogue(error: &CatalogueError, field: &str) -> Status {
    let message = error.to_string();
    match error {
        CatalogueError::NoBody(id) => not_found(Reason::BodyNotFound, &id.to_string(), field, message),
        CatalogueError::DamagedBody { id, .. } => damaged(Reason::DamagedBody, "body", &id.to_string(), message),
        CatalogueError::DamagedScene { scene, .. } => damaged(Reason::DamagedScene, "scene", scene, message),
        CatalogueError::NoScene(name) => not_found(Reason::SceneNotFound, name, field, message),
        CatalogueError::BodyUsed { id, .. } => failed_precondition(Reason::BodyInUse, &format!("body/{id}"), message),
        CatalogueError::NoRobot(id) => not_found(Reason::RobotNotFound, &id.to_string(), field, message),
        CatalogueError::NoPlacedRobot { index, id } => {
            not_found(Reason::RobotNotFound, &id.to_string(), &format!("place_robots[{index}].robot_id"), message)
        }
        CatalogueError::RobotUsed { id, .. } => {
            failed_precondition(Reason::RobotInUse, &format!("robot/{id}"), message)
        }
        CatalogueError::BodyOfRobot { id, .. } => {
            failed_precondition(Reason::BodyInUse, &format!("body/{id}"), message)
        }
        CatalogueError::DamagedRobot { id, .. } => damaged(Reason::DamagedRobot, "robot", &id.to_string(), message),
        CatalogueError::Load(_) => Invalid::new(field, message).into(),
        CatalogueError::SceneExists(name) => {
            let mut details = details(Reason::SceneExists);
            details.set_resource_info("scene", name, "", message.clone());
            Status::with_error_details(Code::AlreadyExists, message, details)
        }
        CatalogueError::NoMember { index, id } => {
            not_found(Reason::BodyNotFound, &id.to_string(), &format!("options.group.body_ids[{index}]"), message)
        }
        CatalogueError::NoSet { index, id } => {
            let field = if *index == 0 { "a.body_id" } else { "b.body_id" };
            not_found(Reason::BodyNotFound, &id.to_string(), field, message)
        }
        CatalogueError::RungUsed { id, .. } => failed_precondition(Reason::BodyInUse, &format!("body/{id}"), message),
        CatalogueError::NoJob(id) => not_found(Reason::JobNotFound, id, field, message),
        CatalogueError::RequestUsed { request_id, .. } => {
            let mut details = details(Reason::RequestIdUsed);
            details.set_resource_info("job", request_id, "", message.clone());
            Status::with_error_details(Code::AlreadyExists, message, details)
        }
        CatalogueError::QueueFull => {
            Status::with_error_details(Code::ResourceExhausted, message, details(Reason::QueueFull))
        }
        CatalogueError::Ladder(_) => failed_precondition(Reason::RungWithoutPoints, field, message),
        CatalogueError::NoFork(_) => failed_precondition(Reason::NotAFork, "fork", message),
        CatalogueError::NoParent { .. } => failed_precondition(Reason::ParentGone, "fork", message),
        CatalogueError::ParentChanged { current, .. } => aborted(Reason::ParentChanged, field, message, *current),
        CatalogueError::TooManyForks => {
            let limits = [("limit", "max_forks".to_owned()), ("value", MAX_FORKS.to_string())];
            Status::with_error_details(Code::ResourceExhausted, message, details_with(Reason::LimitExceeded, limits))
        }
        CatalogueError::SceneName(error) => Invalid::new(field, error).into(),
        CatalogueError::Scene(error) => scene(error),
        CatalogueError::Store(error) => store(error),
    }
}

fn scene(error: &SceneError) -> Status {
    let invalid = |at: &Entry, leaf| Invalid::new(path(at, leaf), error).into();
    match error {
        SceneError::Revision { current, .. } => aborted(Reason::RevisionMismatch, "expected_revision", error, *current),
        SceneError::Full { .. } => failed_precondition(Reason::SceneFull, "scene", error.to_string()),
        SceneError::NoObject { at, name } => not_found(Reason::ObjectNotFound, name, &path(at, Leaf::Name), error),
        SceneError::NoBody { at, id } => not_found(Reason::BodyNotFound, &id.to_string(), &path(at, Leaf::Body), error),
        SceneError::Group { at } => invalid(at, Leaf::Group),
        SceneError::Padding { at, .. } => invalid(at, Leaf::Padding),
        SceneError::NoPose { at, .. } => invalid(at, Leaf::Pose),
        SceneError::NoPlace { at, .. } => invalid(at, Leaf::Attachment),
        SceneError::Name { at, .. }
        | SceneError::Twice { at, .. }
        | SceneError::Itself { at, .. }
        | SceneError::FrameLink { at, .. }
        | SceneError::RobotTwice { at, .. }
        | SceneError::OfRobot { at, .. }
        | SceneError::NameTaken { at, .. }
        | SceneError::LinkName { at, .. } => invalid(at, Leaf::Name),
        SceneError::NoRobot { at, name } => not_found(Reason::RobotNotFound, name, &path(at, Leaf::Name), error),
        SceneError::Joints { at, error } => {
            let leaf = match error {
                JointsError::NoJoint { index, .. } | JointsError::Twice { index, .. } => format!("joints[{index}]"),
                JointsError::Width { .. } | JointsError::Configuration(_) => "values".to_owned(),
            };
            Invalid::new(format!("{}.{leaf}", path(at, Leaf::Joints)), error).into()
        }
        SceneError::LinkPose { at, .. } if at.list == List::Bases => invalid(at, Leaf::Base),
        SceneError::LinkPose { at, .. } => invalid(at, Leaf::Joints),
        SceneError::Pose { .. } => Invalid::new("set_poses", error).into(),
        SceneError::Circle { .. } => Invalid::new("attach", error).into(),
        SceneError::Holds { .. } => failed_precondition(Reason::ObjectHolds, "remove_objects", error.to_string()),
    }
}

#[derive(Clone, Copy)]
enum Leaf {
    Name,
    Body,
    Group,
    Pose,
    Padding,
    Attachment,
    Joints,
    Base,
}

/// Path of an entry of an update in `UpdateSceneRequest`.
fn path(at: &Entry, leaf: Leaf) -> String {
    let list = match at.list {
        List::Upserts => "upsert_objects",
        List::Poses => "set_poses",
        List::Removals => "remove_objects",
        List::Allow => "allow_pairs",
        List::Forbid => "forbid_pairs",
        List::ObjectPaddings => "set_object_paddings",
        List::GroupPaddings => "set_group_paddings",
        List::PairPaddings => "set_pair_paddings",
        List::Attach => "attach",
        List::Detach => "detach",
        List::Robots => "place_robots",
        List::Joints => "set_joints",
        List::Bases => "set_robot_bases",
        List::RobotRemovals => "remove_robots",
    };
    match (at.part, leaf) {
        (Part::Holder, Leaf::Name) => return format!("{list}[{}].attachment.to", at.index),
        (Part::Touch(touch), Leaf::Name) => return format!("{list}[{}].attachment.touch[{touch}]", at.index),
        _ => {}
    }
    let leaf = match (at.list, leaf) {
        (List::Removals | List::Allow | List::Forbid | List::Detach | List::RobotRemovals, _) => "",
        (List::Joints | List::Bases, Leaf::Name) => ".robot",
        (List::ObjectPaddings | List::Attach, Leaf::Name) => ".object",
        (List::GroupPaddings, Leaf::Name) => ".group",
        (List::PairPaddings, Leaf::Name) => ".pair",
        (_, Leaf::Name) => ".name",
        (_, Leaf::Body) => ".body_id",
        (_, Leaf::Group) => ".group",
        (_, Leaf::Pose) => ".pose",
        (_, Leaf::Padding) => ".padding_m",
        (_, Leaf::Attachment) => ".attachment.pose",
        (_, Leaf::Joints) => ".joints",
        (_, Leaf::Base) => ".base",
    };
    format!("{list}[{}]{leaf}", at.index)
}

/// The log says where on the disk; clients hear what to do.
fn store(error: &StoreError) -> Status {
    tracing::error!(%error, "the catalogue could not be read or written");
    let (code, reason, message) = match error {
        StoreError::Full { .. } => {
            let message = "no space is left for the catalogue; free some on the server, and repeat the call";
            (Code::ResourceExhausted, Reason::DiskFull, message)
        }
        StoreError::Damaged { .. } | StoreError::Empty { .. } | StoreError::Format { .. } => {
            let message = "the catalogue is damaged; the server's log says where; restore a backup";
            (Code::DataLoss, Reason::CatalogueDamaged, message)
        }
        StoreError::InUse { .. }
        | StoreError::Occupied { .. }
        | StoreError::Directory { .. }
        | StoreError::Disk { .. } => {
            let message = "the catalogue cannot be read or written; the server's log says why; check its disk";
            (Code::Internal, Reason::DiskFailed, message)
        }
    };
    Status::with_error_details(code, message, details(reason))
}

fn details(reason: Reason) -> ErrorDetails {
    details_with(reason, [])
}

fn details_with<const N: usize>(reason: Reason, about: [(&str, String); N]) -> ErrorDetails {
    let about: HashMap<String, String> = about.into_iter().map(|(key, value)| (key.to_owned(), value)).collect();
    ErrorDetails::with_error_info(reason.name(), "sublevel", about)
}

/// Statuses travel in headers, which clients limit; a reason that quotes the input is cut.
fn short(mut text: String) -> String {
    const LONGEST: usize = 1024;
    if text.len() > LONGEST {
        let end = (0..=LONGEST).rev().find(|&end| text.is_char_boundary(end)).unwrap_or(0);
        text.truncate(end);
        text.push('…');
    }
    text
}

#[cfg(test)]
mod tests;
