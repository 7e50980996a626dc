//! One query of a family.

use crate::bodies::Placed;
use crate::random::shifted;
use sublevel_core::body::Body;
use sublevel_core::measure::{DEFAULT_ACCURACY, Options, Pose, WarmStart, distance};

/// Two bodies at their poses whose distance is asked for, and what is known of it.
#[derive(Clone, Debug)]
pub struct Case {
    pub a: Body,
    pub pose_a: Pose,
    pub b: Body,
    pub pose_b: Pose,
    /// Accuracy asked for, relative to the smaller body.
    pub accuracy: f64,
    /// Most iterations, where the family is about that.
    pub limit: Option<u32>,
    /// The distance, metres, where it is known.
    pub exact: Option<f64>,
    /// Largest error of our answers, metres, where the family asks for more than a true bracket.
    pub bound: Option<f64>,
    /// Largest width, metres, that the bracket of a case below the rounding floor may keep; its
    /// status must say so then.
    pub floor: f64,
    /// Bodies and settings in words.
    pub what: String,
}

impl Case {
    /// At the default accuracy, with nothing known.
    pub fn new(a: &Body, pose_a: Pose, b: &Body, pose_b: Pose, what: impl AsRef<str>) -> Self {
        let what = format!("{}-{} {}", a.name(), b.name(), what.as_ref());
        let (a, b, accuracy) = (a.clone(), b.clone(), DEFAULT_ACCURACY);
        Self { a, pose_a, b, pose_b, accuracy, limit: None, exact: None, bound: None, floor: 0.0, what }
    }

    /// Circumradius of the smaller body, metres.
    pub fn small(&self) -> f64 {
        self.a.circumscribed().radius.min(self.b.circumscribed().radius)
    }

    /// Circumradius of the larger body, metres.
    pub fn large(&self) -> f64 {
        self.a.circumscribed().radius.max(self.b.circumscribed().radius)
    }

    /// Both bodies at their poses.
    pub fn placed(&self) -> (Placed<'_>, Placed<'_>) {
        ((&self.a, &self.pose_a), (&self.b, &self.pose_b))
    }

    /// The case with the second body moved along the line of the nearest points until the gap is
    /// this, metres; first they are apart. As exact as a distance of the case's accuracy.
    #[must_use]
    pub fn moved_to(mut self, gap: f64) -> Self {
        let options = Options::default().with_accuracy(self.accuracy).expect("in range");
        let hint = &mut WarmStart::default();
        let answer = distance(&self.a, &self.pose_a, &self.b, &self.pose_b, &options, hint);
        if let Some(n) = answer.normal {
            self.pose_b = shifted(&self.pose_b, n * (answer.value() - gap));
        }
        self
    }
}
