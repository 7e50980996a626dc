//! Why the catalogue refuses something.

use std::sync::Arc;

use crate::body::BodyId;
use crate::scene::{LadderError, NameError, RobotId, SceneError};
use crate::store::StoreError;
use crate::store::job::MAX_QUEUED_JOBS;
use crate::store::robot::LoadError;

use super::live_scene::MAX_FORKS;

/// Why a change was not made. Memory and disk are as they were.
#[derive(Debug, thiserror::Error)]
pub enum CatalogueError {
    /// No body has this id.
    #[error("no body {0}; list the bodies, or create it first")]
    NoBody(BodyId),
    /// The body is in use.
    #[error("body {id} is used by object \"{object}\" of scene \"{scene}\"; remove the object first")]
    BodyUsed {
        /// The body.
        id: BodyId,
        /// A scene that uses it.
        scene: Arc<str>,
        /// An object made of it.
        object: Arc<str>,
    },
    /// The body is a rung.
    #[error("body {id} is a rung of ladder {ladder}; delete the ladder first")]
    RungUsed {
        /// The body.
        id: BodyId,
        /// The ladder.
        ladder: BodyId,
    },
    /// The body is that of a link.
    #[error("body {id} is that of a link of robot {robot}; delete the robot first")]
    BodyOfRobot {
        /// The body.
        id: BodyId,
        /// The robot.
        robot: RobotId,
    },
    /// No robot has this id.
    #[error("no robot {0}; list the robots, or load it first")]
    NoRobot(RobotId),
    /// An update places a robot that is not there.
    #[error("no robot {id}; list the robots, or load it first")]
    NoPlacedRobot {
        /// Position among the robots that the update places.
        index: usize,
        /// The robot.
        id: RobotId,
    },
    /// The robot is in use.
    #[error("robot {id} is \"{robot}\" of scene \"{scene}\"; remove it there first")]
    RobotUsed {
        /// The robot.
        id: RobotId,
        /// A scene that has it.
        scene: Arc<str>,
        /// Its name there.
        robot: Arc<str>,
    },
    /// The robot cannot be loaded.
    #[error(transparent)]
    Load(#[from] LoadError),
    /// The robot on disk is not what was stored.
    #[error("robot {id} is damaged: {why}; delete what uses it and load it again, or restore a backup")]
    DamagedRobot {
        /// The robot.
        id: RobotId,
        /// The damage.
        why: Arc<str>,
    },
    /// A rung was stored before, without what a ladder needs of it.
    #[error("a rung of the ladder is stored already, and {0}; delete that body, and store the ladder again")]
    Ladder(#[from] LadderError),
    /// The body on disk is not what was stored.
    #[error("body {id} is damaged: {why}; store it again, delete what uses it, or restore a backup")]
    DamagedBody {
        /// The body.
        id: BodyId,
        /// The damage.
        why: Arc<str>,
    },
    /// The scene on disk is not what was stored.
    #[error("scene \"{scene}\" is damaged: {why}; delete it and make it again, or restore a backup")]
    DamagedScene {
        /// The scene.
        scene: Arc<str>,
        /// The damage.
        why: String,
    },
    /// No scene has this name.
    #[error("no scene \"{0}\"; list the scenes, or create it first")]
    NoScene(String),
    /// The name is taken.
    #[error("there is a scene \"{0}\"; use it, delete it, or choose another name")]
    SceneExists(String),
    /// The scene is no fork.
    #[error("scene \"{0}\" is no fork; name one that ForkScene made")]
    NoFork(String),
    /// A fork has lost its parent.
    #[error("scene \"{parent}\", of which \"{fork}\" was made, was deleted; delete the fork")]
    NoParent {
        /// The fork.
        fork: String,
        /// Its parent.
        parent: Arc<str>,
    },
    /// The parent has changed since the fork was made.
    #[error(
        "fork \"{fork}\" was made at revision {expected} of its parent, which is at {current} now; fork it again and \
         repeat the changes"
    )]
    ParentChanged {
        /// The fork.
        fork: String,
        /// Revision of the parent then.
        expected: u64,
        /// Revision of the parent now.
        current: u64,
    },
    /// Too many forks.
    #[error("there are {MAX_FORKS} forks (max_forks); delete or commit some")]
    TooManyForks,
    /// The name is not usable.
    #[error("the name of the scene {0}")]
    SceneName(#[from] NameError),
    /// The update cannot be applied to the scene.
    #[error(transparent)]
    Scene(#[from] SceneError),
    /// No job has this id.
    #[error("no job {0}; list the jobs, or create it first")]
    NoJob(String),
    /// The request id names another job.
    #[error("the request id \"{request_id}\" was used for job {job}, which has another content; choose another id")]
    RequestUsed {
        /// The request id.
        request_id: String,
        /// The job it made.
        job: u64,
    },
    /// A group names a body that is not there.
    #[error("no body {id}; list the bodies, or create it first")]
    NoMember {
        /// Its place in the group.
        index: usize,
        /// The body.
        id: BodyId,
    },
    /// A solve of the hierarchy names a body that is not there.
    #[error("no body {id}; list the bodies, or create it first")]
    NoSet {
        /// Which of the two sets, from 0.
        index: usize,
        /// The body.
        id: BodyId,
    },
    /// Too many jobs wait.
    #[error("{MAX_QUEUED_JOBS} jobs wait already; try again when some are done, or cancel some")]
    QueueFull,
    /// The disk failed.
    #[error(transparent)]
    Store(#[from] StoreError),
}
