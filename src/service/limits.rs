//! What one call may ask for. Documented in `proto/` where users meet them.

use std::time::Duration;

/// Largest message in both directions, in bytes; tonic answers OUT_OF_RANGE above it.
pub const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// Bytes of a message that a client may send before the server has read any of it, and of all
/// messages of its connection: a message of many states comes without waiting on the way.
pub const WINDOW_BYTES: [u32; 2] = [1 << 20, 2 << 20];

/// Calls of a connection that were cancelled before the server looked at them; above it the
/// connection is closed, since a client that resets that many does nothing else.
pub const MAX_RESET_STREAMS: usize = 64;

/// Largest headers of a call, bytes.
pub const MAX_HEADER_BYTES: u32 = 16 << 10;

/// Objects of a scene up to which its tree is made at once, in a tenth of a millisecond, rather
/// than on a thread of its own.
pub const SMALL_SCENE: usize = 2000;

/// Most answers (pairs times measures) of one Evaluate.
pub const MAX_ANSWERS: usize = 1 << 17;

/// Most states of one CheckStates or Clearance.
pub const MAX_STATES: usize = 1 << 16;

/// Most poses (states times objects) of one CheckStates or Clearance: what fits in a message.
pub const MAX_STATE_POSES: usize = MAX_MESSAGE_BYTES / 56;

/// Most motions of one CheckMotions.
pub const MAX_MOTIONS: usize = 1 << 14;

/// Most motions of one CheckMotions that asks for certificates, which are long.
pub const MAX_CERTIFICATES: usize = 4;

/// Most rays of one CastRays.
pub const MAX_RAYS: usize = 1 << 15;

/// Objects of a page of GetScene when the request does not say.
pub const DEFAULT_OBJECTS_PAGE: usize = 1000;

/// Most objects of a page of GetScene.
pub const MAX_OBJECTS_PAGE: usize = 10_000;

/// Pause between two messages of WatchScene and Watch when the request does not say: 60 Hz.
pub const DEFAULT_WATCH_PAUSE: Duration = Duration::from_micros(16_667);

/// How long a question waits for the revision it asks for.
pub const REVISION_PATIENCE: Duration = Duration::from_secs(1);

/// How often streamed poses are written.
pub const POSES_WRITTEN_EVERY: Duration = Duration::from_millis(500);

/// Items of a page when the request does not say.
pub const DEFAULT_PAGE: usize = 100;

/// Most items of a page.
pub const MAX_PAGE: usize = 1000;

/// How long a call waits for the catalogue to be loaded, and for bodies to be proven, before it
/// gets UNAVAILABLE.
pub const LOADING_PATIENCE: Duration = Duration::from_secs(10);

/// Calls that wait for bodies to be proven at once, each on a thread.
pub const MAX_EXAMINING: usize = 32;

/// Niceness of the threads that prove bodies in the background: a tenth of the share of others.
pub const PROVER_NICE: i32 = 10;

/// How long a new connection may say nothing.
pub const PREFACE_TIMEOUT: Duration = Duration::from_secs(10);

/// The same while more than half of the places are taken.
pub const PREFACE_TIMEOUT_CROWDED: Duration = Duration::from_secs(1);

/// Pause after a connection could not be accepted.
pub const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Most points of one fit, counting those of a mesh file.
pub const MAX_FIT_POINTS: usize = 2 << 20;

/// Most triangles of one fit, counting those of a mesh file: a closed mesh has twice as many as
/// points.
pub const MAX_FIT_TRIANGLES: usize = 4 << 20;

/// Most bodies of one group: the hulls of all pairs are looked at before the first program.
pub const MAX_GROUP_BODIES: usize = 256;

/// Longest blob, in bytes.
pub const MAX_BLOB_BYTES: usize = 128 << 20;

/// Most bytes of all blobs together.
pub const MAX_BLOBS_BYTES: usize = 512 << 20;

/// Time after which a blob that nobody uses is forgotten.
pub const BLOB_IDLE: Duration = Duration::from_secs(600);

/// Divisions of the edges of a body's mesh when the request does not say.
pub const DEFAULT_MESH_DIVISIONS: u32 = 8;

/// Most divisions of the edges of a body's mesh.
pub const MAX_MESH_DIVISIONS: u32 = 32;

/// Meshes that are kept for those who ask again.
pub const MAX_KEPT_MESHES: usize = 64;

/// Meshes of fits that are read at once; further ones wait.
pub const MAX_UPLOADS: usize = 2;

/// Most items of a page of jobs, whose descriptions are long.
pub const MAX_JOBS_PAGE: usize = 500;

/// Pause between two messages about a job.
pub const WATCH_PAUSE: Duration = Duration::from_millis(100);
