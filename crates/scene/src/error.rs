//! Why an update cannot be applied.

use std::fmt;
use std::sync::Arc;

use sublevel_core::body::BodyId;
use sublevel_core::measure::PoseError;

use super::structure::MAX_HOLDERS;
use super::{MAX_NAME_BYTES, MAX_PADDING_M, NameError};
use crate::robot::{FrameHolder, JointsError};

/// The lists of an [`Update`](super::Update).
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum List {
    /// Objects to add or replace.
    Upserts,
    /// New poses.
    Poses,
    /// Objects to remove.
    Removals,
    /// Pairs to allow.
    Allow,
    /// Pairs to forbid.
    Forbid,
    /// Paddings of objects.
    ObjectPaddings,
    /// Paddings of groups.
    GroupPaddings,
    /// Paddings of pairs.
    PairPaddings,
    /// Objects to be held.
    Attach,
    /// Objects not to be held.
    Detach,
    /// Robots to place or replace.
    Robots,
    /// Joint values of robots.
    Joints,
    /// Base poses of robots.
    Bases,
    /// Robots to remove.
    RobotRemovals,
}

/// An entry of an [`Update`](super::Update): which list, the position in it from 0, and which part
/// of the entry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Entry {
    /// The list.
    pub list: List,
    /// Position in the list, from 0.
    pub index: usize,
    /// Part of the entry.
    pub part: Part,
}

/// What an entry of an [`Update`](super::Update) names.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Part {
    /// What is changed.
    Subject,
    /// What is to hold it.
    Holder,
    /// What it may touch while it is held, by the position in that list.
    Touch(usize),
}

impl Entry {
    /// The first part of an entry.
    pub(crate) fn of(list: List, index: usize) -> Self {
        Self { list, index, part: Part::Subject }
    }

    pub(crate) fn part(self, part: Part) -> Self {
        Self { part, ..self }
    }
}

/// Why an update cannot be applied. The scene is as it was.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
pub enum SceneError {
    /// Somebody else changed the scene first.
    #[error("the scene is at revision {current}, not at the expected {expected}; read it again and repeat the update")]
    Revision {
        /// What the update was made for.
        expected: u64,
        /// Where the scene is.
        current: u64,
    },
    /// A name cannot be stored.
    #[error("name {error}")]
    Name {
        /// Where.
        at: Entry,
        /// The rule it breaks.
        error: NameError,
    },
    /// A group label cannot be stored.
    #[error("group is longer than {MAX_NAME_BYTES} bytes or holds a control character; shorten it")]
    Group {
        /// Where.
        at: Entry,
    },
    /// Two entries change one object, so their order would matter.
    #[error("object \"{name}\" is named twice in one update; name it once")]
    Twice {
        /// The second entry.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// The update names an object that the scene does not have.
    #[error("no object \"{name}\" in the scene; add it first")]
    NoObject {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// A link without geometry, which is no object, is to hold something.
    #[error("link \"{link}\" of robot \"{robot}\" has no geometry; {instead}")]
    FrameLink {
        /// Where.
        at: Entry,
        /// The link.
        link: Arc<str>,
        /// The robot.
        robot: Arc<str>,
        /// What can hold it.
        instead: FrameHolder,
    },
    /// The update places a body that is not stored.
    #[error("no body {id}; create it first")]
    NoBody {
        /// Where.
        at: Entry,
        /// The body.
        id: BodyId,
    },
    /// A pair, or what is held and what holds it, are two objects.
    #[error("object \"{name}\" is named on both sides; name two objects")]
    Itself {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// An object that is not held has no pose.
    #[error("object \"{name}\" has no pose and is held by nothing; give it a pose")]
    NoPose {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// A new object is to keep a place that it does not have.
    #[error("object \"{name}\" is new, so it has no place to keep; give its pose in the holder's frame")]
    NoPlace {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
    },
    /// What would be held would have no pose.
    #[error("object \"{name}\" is held at no usable pose: {error}")]
    Pose {
        /// Name of the held object.
        name: Arc<str>,
        /// The reason.
        error: PoseError,
    },
    /// A link would have no pose.
    #[error("link \"{name}\" would have no usable pose: {error}")]
    LinkPose {
        /// The robot, or its joints or base.
        at: Entry,
        /// Name of the link's object.
        name: Arc<str>,
        /// The reason.
        error: PoseError,
    },
    /// A padding that is no length.
    #[error("padding is {padding_m} m; give a finite number of at most {MAX_PADDING_M} m either way")]
    Padding {
        /// Where.
        at: Entry,
        /// The padding.
        padding_m: f64,
    },
    /// Objects that hold one another in a circle.
    #[error("object \"{name}\" is held by itself, or through more than {MAX_HOLDERS} others; attach it elsewhere")]
    Circle {
        /// One of them.
        name: Arc<str>,
    },
    /// An object that others are attached to cannot go.
    #[error("object \"{name}\" holds \"{held}\"; detach or remove that in the same update")]
    Holds {
        /// Name of the holder.
        name: Arc<str>,
        /// What it holds.
        held: Arc<str>,
    },
    /// The update names a robot that the scene does not have.
    #[error("no robot \"{name}\" in the scene; place it first")]
    NoRobot {
        /// Where.
        at: Entry,
        /// The robot.
        name: Arc<str>,
    },
    /// Two entries change one robot, so their order would matter.
    #[error("robot \"{name}\" is named twice in one update; name it once")]
    RobotTwice {
        /// The second entry.
        at: Entry,
        /// The robot.
        name: Arc<str>,
    },
    /// The object of a link cannot be changed by itself.
    #[error(
        "object \"{name}\" is a link of robot \"{robot}\"; set the joints or the base of the robot, or remove the robot"
    )]
    OfRobot {
        /// Where.
        at: Entry,
        /// The object.
        name: Arc<str>,
        /// The robot.
        robot: Arc<str>,
    },
    /// The object of a link would have the name of another object.
    #[error("robot \"{robot}\" has a link for which the name \"{name}\" is taken; rename that object or the robot")]
    NameTaken {
        /// Where.
        at: Entry,
        /// Name of the object.
        name: Arc<str>,
        /// The robot.
        robot: Arc<str>,
    },
    /// The object of a link would have a name that cannot be stored.
    #[error("object name \"{name}\" {error}")]
    LinkName {
        /// Where.
        at: Entry,
        /// Name of the object.
        name: Arc<str>,
        /// The rule it breaks.
        error: NameError,
    },
    /// Values of joints that cannot be taken.
    #[error("{error}")]
    Joints {
        /// Where.
        at: Entry,
        /// The reason.
        error: JointsError,
    },
    /// The scene would be too large.
    #[error("the scene would hold {count} {what}, at most {limit} fit; split it into several scenes")]
    Full {
        /// What there would be too many of.
        what: &'static str,
        /// How many there would be.
        count: usize,
        /// How many fit.
        limit: usize,
    },
}

impl fmt::Display for Entry {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:?}[{}]", self.list, self.index)?;
        match self.part {
            Part::Subject => Ok(()),
            Part::Holder => f.write_str(".attachment.to"),
            Part::Touch(index) => write!(f, ".attachment.touch[{index}]"),
        }
    }
}

/// Items of a list with their entries.
pub(crate) fn entries<T>(list: List, items: impl IntoIterator<Item = T>) -> impl Iterator<Item = (Entry, T)> {
    items.into_iter().enumerate().map(move |(index, item)| (Entry::of(list, index), item))
}
