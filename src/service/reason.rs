//! The reasons of refused calls, for programs. Each has a section in `docs/errors.md`.

/// Writes the enum, its names and the list of all of them from one table.
macro_rules! reasons {
    ($($(#[$about:meta])* $reason:ident = $name:literal,)*) => {
        /// Why a call is refused: `reason` of `google.rpc.ErrorInfo`, under the domain `sublevel`.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Reason {
            $($(#[$about])* $reason,)*
        }

        impl Reason {
            /// All of them.
            pub const ALL: &[Self] = &[$(Self::$reason,)*];

            /// As it travels.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$reason => $name,)*
                }
            }
        }
    };
}

reasons! {
    /// A field of the request cannot be used.
    InvalidField = "INVALID_FIELD",
    /// No scene has the name.
    SceneNotFound = "SCENE_NOT_FOUND",
    /// No object of the scene has the name.
    ObjectNotFound = "OBJECT_NOT_FOUND",
    /// No body has the id.
    BodyNotFound = "BODY_NOT_FOUND",
    /// No robot has the id, or the name in a scene.
    RobotNotFound = "ROBOT_NOT_FOUND",
    /// No job has the id.
    JobNotFound = "JOB_NOT_FOUND",
    /// No complete blob has the id.
    BlobNotFound = "BLOB_NOT_FOUND",
    /// The scene is at another revision than the update expects.
    RevisionMismatch = "REVISION_MISMATCH",
    /// The parent of a fork has changed since the fork was made.
    ParentChanged = "PARENT_CHANGED",
    /// Objects came or went between two pages of a scene.
    SceneChanged = "SCENE_CHANGED",
    /// The call asks for more than one call may.
    LimitExceeded = "LIMIT_EXCEEDED",
    /// The call waited for its turn as long as it may.
    Overloaded = "OVERLOADED",
    /// The call shows no token.
    TokenMissing = "TOKEN_MISSING",
    /// The call shows a token that the server does not know.
    TokenUnknown = "TOKEN_UNKNOWN",
    /// The token's role is not enough.
    RoleNeeded = "ROLE_NEEDED",
    /// Something uses the body that is to be deleted.
    BodyInUse = "BODY_IN_USE",
    /// A scene has the robot that is to be deleted.
    RobotInUse = "ROBOT_IN_USE",
    /// The name is that of a scene.
    SceneExists = "SCENE_EXISTS",
    /// The scene would have more than fits in one.
    SceneFull = "SCENE_FULL",
    /// The object that is to be removed holds another.
    ObjectHolds = "OBJECT_HOLDS",
    /// The scene that is to be committed is no fork.
    NotAFork = "NOT_A_FORK",
    /// The parent of a fork was deleted.
    ParentGone = "PARENT_GONE",
    /// A rung of a ladder was stored without the points that it contains.
    RungWithoutPoints = "RUNG_WITHOUT_POINTS",
    /// The body has no bounded surface.
    NoSurface = "NO_SURFACE",
    /// As many jobs wait as may.
    QueueFull = "QUEUE_FULL",
    /// The request id is that of another job.
    RequestIdUsed = "REQUEST_ID_USED",
    /// The disk or quota is used up.
    DiskFull = "DISK_FULL",
    /// The disk fails.
    DiskFailed = "DISK_FAILED",
    /// The catalogue holds what no server wrote.
    CatalogueDamaged = "CATALOGUE_DAMAGED",
    /// A body on disk is not what was stored.
    DamagedBody = "DAMAGED_BODY",
    /// A robot on disk is not what was stored.
    DamagedRobot = "DAMAGED_ROBOT",
    /// A scene on disk is not what was stored.
    DamagedScene = "DAMAGED_SCENE",
    /// The call took longer than any may.
    CallTooLong = "CALL_TOO_LONG",
    /// The client's own time is over.
    Deadline = "DEADLINE",
    /// The catalogue is loading, or bodies are still to be proven.
    Loading = "LOADING",
    /// The server stops.
    Stopping = "STOPPING",
    /// The scene has not come to the revision that the question waits for.
    RevisionNotReached = "REVISION_NOT_REACHED",
    /// A defect.
    Internal = "INTERNAL",
    /// A panic ended the call.
    InternalPanic = "INTERNAL_PANIC",
}
