//! What `sublevel measure` measures.

use crate::body::Shape;
use crate::measure::{Distance, LevelDistance, Options, Pose, WarmStart, distance, level_distance};
use std::sync::Arc;

/// Two bodies or compounds and the accuracy asked for.
pub(super) struct Query {
    pub(super) a: Arc<Shape>,
    pub(super) b: Arc<Shape>,
    pub(super) options: Options<'static>,
}

impl Query {
    pub(super) fn distance(&self, pose: &Pose, warm: &mut WarmStart) -> Distance {
        distance(&*self.a, &Pose::identity(), &*self.b, pose, &self.options, warm)
    }

    pub(super) fn level_ab(&self, pose: &Pose, warm: &mut WarmStart) -> LevelDistance {
        level_distance(&*self.a, &Pose::identity(), &*self.b, pose, &self.options, warm)
    }

    pub(super) fn level_ba(&self, pose: &Pose, warm: &mut WarmStart) -> LevelDistance {
        level_distance(&*self.b, pose, &*self.a, &Pose::identity(), &self.options, warm)
    }
}
