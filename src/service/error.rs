//! The one place where errors become gRPC statuses: a code, a message with the remedy, and details
//! for programs (`ErrorInfo` with a reason, `BadRequest` with field paths, `ResourceInfo`,
//! `PreconditionFailure`).

use std::collections::HashMap;
use std::fmt;
use std::time::Duration;

use tonic::{Code, Status};
use tonic_types::{ErrorDetails, StatusExt};

use crate::scene::{Entry, List, SceneError};
use crate::store::{CatalogueError, StoreError};

/// A field of a request that cannot be used.
#[derive(Debug)]
pub(super) struct Invalid {
    /// Path in the request, such as `pairs[3].a`.
    field: String,
    /// The reason and the remedy.
    why: String,
}

impl Invalid {
    pub(super) fn new(field: impl Into<String>, why: impl fmt::Display) -> Self {
        Self { field: field.into(), why: why.to_string() }
    }
}

impl From<Invalid> for Status {
    fn from(Invalid { field, why }: Invalid) -> Self {
        let message = short(format!("{field}: {why}"));
        let mut details = details("INVALID_FIELD");
        details.add_bad_request_violation(field, short(why));
        Self::with_error_details(Code::InvalidArgument, message, details)
    }
}

/// NOT_FOUND for a named thing; `field` is where the request named it.
pub(super) fn not_found(kind: &str, name: &str, field: &str, why: impl fmt::Display) -> Status {
    let mut details = details(&format!("{}_NOT_FOUND", kind.to_uppercase()));
    let why = short(why.to_string());
    details.set_resource_info(kind, name, "", why.clone());
    details.add_bad_request_violation(field, why.clone());
    Status::with_error_details(Code::NotFound, format!("{field}: {why}"), details)
}

/// UNAVAILABLE: the client may try again.
pub(super) fn unavailable(reason: &str, message: &str) -> Status {
    Status::with_error_details(Code::Unavailable, message, details(reason))
}

/// DEADLINE_EXCEEDED: a call that was too much, or whose message did not come.
pub(super) fn too_slow(limit: Duration) -> Status {
    let message = format!("the call was not read and answered within {} s; ask for less in one call", limit.as_secs());
    Status::with_error_details(Code::DeadlineExceeded, message, details("CALL_TOO_LONG"))
}

/// INTERNAL for a task that panicked.
pub(super) fn internal_panic(error: &tokio::task::JoinError) -> Status {
    tracing::error!(%error, "a call was ended by a panic");
    let message = "the call was ended by a panic in the server; its log says more, please report it";
    Status::with_error_details(Code::Internal, message, details("INTERNAL_PANIC"))
}

fn failed_precondition(reason: &str, subject: &str, message: String) -> Status {
    let mut details = details(reason);
    details.add_precondition_failure_violation(reason, subject, message.clone());
    Status::with_error_details(Code::FailedPrecondition, message, details)
}

/// Maps a failure of the catalogue; `field` is where the request named the scene or body the call
/// is about.
pub(super) fn catalogue(error: &CatalogueError, field: &str) -> Status {
    let message = error.to_string();
    match error {
        CatalogueError::NoBody(id) => not_found("body", &id.to_string(), field, message),
        CatalogueError::NoScene(name) => not_found("scene", name, field, message),
        CatalogueError::BodyUsed { id, .. } => failed_precondition("BODY_IN_USE", &format!("body/{id}"), message),
        CatalogueError::SceneExists(name) => {
            let mut details = details("SCENE_EXISTS");
            details.set_resource_info("scene", name, "", message.clone());
            Status::with_error_details(Code::AlreadyExists, message, details)
        }
        CatalogueError::NoMember { index, id } => {
            not_found("body", &id.to_string(), &format!("header.options.group.body_ids[{index}]"), message)
        }
        CatalogueError::NoJob(id) => not_found("fit", id, field, message),
        CatalogueError::RequestUsed { request_id, .. } => {
            let mut details = details("REQUEST_ID_USED");
            details.set_resource_info("fit", request_id, "", message.clone());
            Status::with_error_details(Code::AlreadyExists, message, details)
        }
        CatalogueError::QueueFull => {
            Status::with_error_details(Code::ResourceExhausted, message, details("QUEUE_FULL"))
        }
        CatalogueError::SceneName(error) => Invalid::new(field, error).into(),
        CatalogueError::Scene(error) => scene(error),
        CatalogueError::Store(error) => store(error),
    }
}

fn scene(error: &SceneError) -> Status {
    let invalid = |at: &Entry, leaf| Invalid::new(path(at, leaf), error).into();
    match error {
        SceneError::Revision { .. } => failed_precondition("REVISION_MISMATCH", "expected_revision", error.to_string()),
        SceneError::Full { .. } => failed_precondition("SCENE_FULL", "scene", error.to_string()),
        SceneError::NoObject { at, name } => not_found("object", name, &path(at, Leaf::Name), error),
        SceneError::NoBody { at, id } => not_found("body", &id.to_string(), &path(at, Leaf::Body), error),
        SceneError::Group { at } => invalid(at, Leaf::Group),
        SceneError::Name { at, .. } | SceneError::Twice { at, .. } | SceneError::Itself { at, .. } => {
            invalid(at, Leaf::Name)
        }
    }
}

#[derive(Clone, Copy)]
enum Leaf {
    Name,
    Body,
    Group,
}

/// Path of an entry of an update in `UpdateSceneRequest`.
fn path(at: &Entry, leaf: Leaf) -> String {
    let list = match at.list {
        List::Upserts => "upsert_objects",
        List::Poses => "set_poses",
        List::Removals => "remove_objects",
        List::Allow => "allow_pairs",
        List::Forbid => "forbid_pairs",
    };
    let leaf = match (at.list, leaf) {
        (List::Removals | List::Allow | List::Forbid, _) => "",
        (_, Leaf::Name) => ".name",
        (_, Leaf::Body) => ".body_id",
        (_, Leaf::Group) => ".group",
    };
    format!("{list}[{}]{leaf}", at.index)
}

fn store(error: &StoreError) -> Status {
    tracing::error!(%error, "the catalogue could not be written");
    let (code, reason) = match error {
        StoreError::Full { .. } => (Code::ResourceExhausted, "DISK_FULL"),
        StoreError::Damaged { .. } | StoreError::Empty { .. } | StoreError::Format { .. } => {
            (Code::DataLoss, "CATALOGUE_DAMAGED")
        }
        StoreError::InUse { .. } | StoreError::Directory { .. } | StoreError::Disk { .. } => {
            (Code::Internal, "DISK_FAILED")
        }
    };
    Status::with_error_details(code, error.to_string(), details(reason))
}

fn details(reason: &str) -> ErrorDetails {
    ErrorDetails::with_error_info(reason, "sublevel", HashMap::new())
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
