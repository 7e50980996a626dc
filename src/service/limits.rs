//! What one call may ask for. Documented in `proto/` where users meet them.

use std::time::Duration;

/// Largest message in both directions, in bytes; tonic answers OUT_OF_RANGE above it.
pub const MAX_MESSAGE_BYTES: usize = 4 << 20;

/// Most results (pairs times measures) of one Evaluate.
pub const MAX_EVALUATIONS: usize = 4096;

/// Pairs an Evaluate solves before it lets other calls go first: some tens of milliseconds at
/// worst.
pub const PAIRS_AT_ONCE: usize = 32;

/// Items of a page when the request does not say.
pub const DEFAULT_PAGE: usize = 100;

/// Most items of a page.
pub const MAX_PAGE: usize = 1000;

/// How long a call that arrives while the catalogue is loading waits for it before it gets
/// UNAVAILABLE.
pub const LOADING_PATIENCE: Duration = Duration::from_secs(10);

/// How long open calls may go on after a stop was asked for. A second signal ends the wait.
pub const DRAIN: Duration = Duration::from_secs(5);

/// Concurrent calls of one connection; clients queue further ones.
pub const MAX_STREAMS: u32 = 32;

/// Concurrent calls of all connections together. Each may hold a message of [`MAX_MESSAGE_BYTES`]
/// in both directions and what is made of it; further calls wait unread.
pub const MAX_CALLS: usize = 64;

/// Longest time from the start of a call behind the limit to its answer.
pub const CALL_LIMIT: Duration = Duration::from_secs(120);

/// Silence after which a connection is asked for a sign of life.
pub const KEEPALIVE: Duration = Duration::from_secs(30);

/// Time to give the sign of life before the connection is closed.
pub const KEEPALIVE_TIMEOUT: Duration = Duration::from_secs(10);

/// Connections open at once; further ones queue in the system. Half of the 1024 file descriptors a
/// process mostly has.
pub const MAX_CONNECTIONS: usize = 512;

/// How long a new connection may say nothing.
pub const PREFACE_TIMEOUT: Duration = Duration::from_secs(10);

/// The same while more than half of the places are taken.
pub const PREFACE_TIMEOUT_CROWDED: Duration = Duration::from_secs(1);

/// Pause after a connection could not be accepted.
pub const ACCEPT_PAUSE: Duration = Duration::from_millis(100);

/// Most points of one fit job, counting those of a mesh file.
pub const MAX_FIT_POINTS: usize = 2 << 20;

/// Most triangles of one fit job, counting those of a mesh file: a closed mesh has twice as many as
/// points.
pub const MAX_FIT_TRIANGLES: usize = 4 << 20;

/// Most bodies of one group: the hulls of all pairs are looked at before the first program.
pub const MAX_GROUP_BODIES: usize = 256;

/// Longest mesh file of a fit job, in bytes.
pub const MAX_MESH_BYTES: usize = 128 << 20;

/// Uploads that are read at once, each with as much in memory; further ones wait unread.
pub const MAX_UPLOADS: usize = 2;

/// Most items of a page of fit jobs, whose descriptions are long.
pub const MAX_FITS_PAGE: usize = 500;

/// Pause between two messages about a fit job.
pub const WATCH_PAUSE: Duration = Duration::from_millis(100);
