//! The durable catalogue of bodies, robots, scenes and jobs, embedded in the server.
//!
//! [`Store`] is the file: one redb database, `catalogue.redb`, in the data directory. [`Catalogue`]
//! keeps everything of it in memory for reading and writes every change through. Only this layer
//! knows bytes on disk.
//!
//! # What is durable, and why
//!
//! A change is one redb transaction committed with immediate durability: its pages and then the
//! header that points to them are written and synced before `commit` returns, and only then is the
//! change made in memory and answered. So:
//!
//! * **Killed or powered off before the header is on disk:** the old header still points to the old
//!   pages, which a commit never overwrites. The change was not acknowledged and is not there.
//! * **During the write of the header:** it names two roots with checksums; on opening, a root
//!   whose pages do not match is passed over for the other one. The change is there whole or not at
//!   all.
//! * **After the sync:** the change is there, acknowledged or not.
//! * **The disk is full or fails:** the transaction is dropped, the caller gets the reason, memory
//!   stays as it was. The database is opened again and read back, since a failed sync leaves open
//!   which root is on disk; memory then says what the disk says. Reading goes on meanwhile, and the
//!   next change tries again.
//! * **The first start:** the directory entry of the new file is synced too.
//! * **The file is gone or another one** when it is opened again: changes are refused until it is
//!   back. Nothing is made again but on a start that finds no file at all; one that finds an empty
//!   file is refused.
//!
//! Memory is thus never ahead of the disk but for streamed poses, which are written within a
//! second, and for forks, which end with the server. A revision that was seen is never given out
//! again: a scene's revision is part of every commit that changes it, revisions of streamed poses
//! are taken from a reserve that was written before, and deleting a scene raises the floor from
//! which later scenes start.

//! # What is proven, and when
//!
//! The file may have been damaged or written by anybody, so each body is proven again before its
//! first use, and a scene is made when all its bodies are. Loading reads rows only. A call for
//! a body or scene that is not proven waits for the proof, and [`Catalogue::prove_all`] proves the
//! rest in the background. A damaged body is named in the log and to those who ask for it, and
//! never used.

mod catalogue;
mod copy;
mod derive;
mod disk;
mod error;
mod format_3;
mod hierarchy;
mod job;
mod pose_row;
mod request;
mod restore;
mod robot;
mod robot_row;
mod rows;

pub use catalogue::{
    Catalogue, CatalogueError, Counts, FORK_IDLE, JobCounts, LiveScene, MAX_FORKS, Origin, SceneEntry,
};
pub use derive::{DeriveOutcome, DeriveRequest, DerivedLinkPair};
pub use disk::{BACKUP_PREFIX, JobMesh, Store};
pub use error::StoreError;
pub use hierarchy::{HierarchyMeasure, HierarchyOutcome, HierarchyRequest, HierarchySet};
pub use job::{
    FitOptimum, FitOutcome, FitTask, FittedBody, FittedKind, Job, JobKind, JobOutcome, JobState, JobTask,
    MAX_ENDED_JOBS, MAX_QUEUED_JOBS, MAX_REQUEST_ID_BYTES, NewJob,
};
pub use request::{
    FitBody, FitCompound, FitGroup, FitLadder, FitMode, FitPolynomial, FitPreparation, FitRequest, FitSosBody,
    FitWithinGap,
};
pub use restore::restore;
pub use robot::{LoadError, LoadedRobot, RobotSource};

#[cfg(test)]
pub(crate) mod tests;
