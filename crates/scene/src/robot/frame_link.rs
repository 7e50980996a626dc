//! Links without geometry: frames, which are no objects and hold nothing.

use std::collections::BTreeMap;
use std::fmt;
use std::sync::Arc;

use super::Instance;

/// What can hold an object in place of a link without geometry.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum FrameHolder {
    /// The object of the nearest link with geometry that the link is fixed to.
    Fixed(Arc<str>),
    /// The object of the nearest link with geometry before the link, which moves against it.
    Moving(Arc<str>),
    /// No link before it has geometry.
    None,
}

impl fmt::Display for FrameHolder {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(object) => write!(f, "attach to \"{object}\" with the pose in its frame"),
            Self::Moving(object) => {
                write!(f, "it moves against \"{object}\", the next link before it that has; attach to that one")
            }
            Self::None => f.write_str("no link before it has; attach to a link with geometry"),
        }
    }
}

/// A link without geometry of a robot in a scene.
#[derive(Debug)]
pub(crate) struct FrameLink {
    /// Name of the link.
    pub(crate) link: Arc<str>,
    /// Name of the robot in the scene.
    pub(crate) robot: Arc<str>,
    pub(crate) holder: FrameHolder,
}

impl FrameLink {
    /// The link that is meant by a name `ROBOT/LINK`, if it has no geometry.
    pub(crate) fn named(robots: &BTreeMap<Arc<str>, Arc<Instance>>, name: &str) -> Option<Self> {
        robots.iter().find_map(|(robot, instance)| {
            let link = name.strip_prefix(&**robot)?.strip_prefix('/')?;
            let place = instance.robot.kinematics().link(link)?;
            let is_frame = instance.slots[place].is_none();
            is_frame.then(|| Self { link: link.into(), robot: robot.clone(), holder: holder(robot, instance, place) })
        })
    }
}

fn holder(robot: &str, instance: &Instance, link: usize) -> FrameHolder {
    let kinematics = instance.robot.kinematics();
    let (mut at, mut is_fixed) = (link, true);
    while let Some(parent) = kinematics.parent(at) {
        is_fixed &= kinematics.is_fixed(at);
        if instance.slots[parent].is_some() {
            let object = format!("{robot}/{}", kinematics.links()[parent]).into();
            return if is_fixed { FrameHolder::Fixed(object) } else { FrameHolder::Moving(object) };
        }
        at = parent;
    }
    FrameHolder::None
}
