//! What is asked of pairs.

use std::collections::HashMap;
use std::sync::Arc;

use sublevel_core::measure::{DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY, Motion, Options};

use crate::crew::Stop;
use crate::object::Slot;

/// What can be measured of a pair (A, B).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Measure {
    /// Euclidean distance, metres; 0 when the two touch or overlap.
    Distance,
    /// d(A||B), dimensionless.
    LevelAOnB,
    /// d(B||A), dimensionless.
    LevelBOnA,
    /// Growth distance, dimensionless.
    Growth,
    /// Signed distance, metres.
    Signed,
    /// Penetration depth, metres; 0 when the two are apart.
    Penetration,
    /// Whether the two have a common point.
    Overlap,
    /// Whether the two are nearer than the threshold.
    NearerThan,
    /// First time of contact along the motions, seconds.
    TimeOfImpact,
}

impl Measure {
    /// All of them.
    pub const ALL: [Self; 9] = [
        Self::Distance,
        Self::LevelAOnB,
        Self::LevelBOnA,
        Self::Growth,
        Self::Signed,
        Self::Penetration,
        Self::Overlap,
        Self::NearerThan,
        Self::TimeOfImpact,
    ];

    /// Whether it is a measure of convex bodies, and of unions of these.
    pub fn needs_convex(self) -> bool {
        matches!(self, Self::Growth | Self::Penetration | Self::TimeOfImpact)
    }
}

/// How objects move while a time of impact is looked for.
#[derive(Clone, Debug, Default)]
pub struct Motions {
    /// Motions of the objects that move.
    pub moving: HashMap<Slot, Motion>,
    /// Length of the time, seconds.
    pub duration_s: f64,
}

/// What to measure of every pair, and how.
#[derive(Clone, Debug)]
pub struct Ask {
    pub(crate) measures: Vec<Measure>,
    /// Per measure: accuracy of the bracket, and of depths.
    accuracies: Vec<(f64, f64)>,
    pub(crate) threshold_m: f64,
    /// Whether gradients are wanted.
    pub gradients: bool,
    /// Whether pairs that may touch count, too.
    pub include_allowed: bool,
    /// Whether earlier answers must not be used as starts.
    pub cold: bool,
    /// For [`Measure::TimeOfImpact`].
    pub motions: Option<Arc<Motions>>,
}

/// Why a question cannot be asked.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum AskError {
    /// No measure.
    #[error("is empty; name at least one measure")]
    NoMeasure,
    /// A measure twice.
    #[error("asks for {0:?} twice; ask once")]
    Twice(Measure),
    /// An accuracy that is none.
    #[error("is {0}; give a number above 0 and at most 1, or leave it out for {DEFAULT_ACCURACY:e}")]
    Accuracy(f64),
    /// A threshold that is no length.
    #[error("is {0} m; give a finite number that is not negative")]
    Threshold(f64),
}

impl Ask {
    /// Measures with the default accuracy, and a threshold of 0 m.
    ///
    /// # Errors
    /// No measure, or one twice.
    pub fn new(measures: Vec<Measure>) -> Result<Self, AskError> {
        if measures.is_empty() {
            return Err(AskError::NoMeasure);
        }
        for (index, measure) in measures.iter().enumerate() {
            if measures[..index].contains(measure) {
                return Err(AskError::Twice(*measure));
            }
        }
        let accuracies = vec![(DEFAULT_ACCURACY, DEFAULT_DEPTH_ACCURACY); measures.len()];
        Ok(Self {
            measures,
            accuracies,
            threshold_m: 0.0,
            gradients: false,
            include_allowed: false,
            cold: false,
            motions: None,
        })
    }

    /// Another accuracy for all measures, relative, above 0 and at most 1. Depths of overlap keep
    /// theirs unless it is wider.
    ///
    /// # Errors
    /// A number out of this range.
    pub fn with_accuracy(mut self, accuracy: f64) -> Result<Self, AskError> {
        check_accuracy(accuracy)?;
        for both in &mut self.accuracies {
            *both = (accuracy, accuracy.max(DEFAULT_DEPTH_ACCURACY));
        }
        Ok(self)
    }

    /// Another accuracy for one measure, of its depths, too.
    ///
    /// # Errors
    /// A number out of the range.
    pub fn with_measure_accuracy(mut self, of: Measure, accuracy: f64) -> Result<Self, AskError> {
        check_accuracy(accuracy)?;
        for (measure, both) in self.measures.iter().zip(&mut self.accuracies) {
            if *measure == of {
                *both = (accuracy, accuracy);
            }
        }
        Ok(self)
    }

    /// What [`Measure::NearerThan`] compares with, metres.
    ///
    /// # Errors
    /// A number that is negative or not finite.
    pub fn with_threshold(mut self, threshold_m: f64) -> Result<Self, AskError> {
        if !(threshold_m >= 0.0 && threshold_m.is_finite()) {
            return Err(AskError::Threshold(threshold_m));
        }
        self.threshold_m = threshold_m;
        Ok(self)
    }

    /// What is measured, in the order of the answers.
    pub fn measures(&self) -> &[Measure] {
        &self.measures
    }

    /// Options of the measure at a position.
    pub(crate) fn options<'a>(&self, index: usize, stop: &'a Stop) -> Options<'a> {
        let (accuracy, depth) = self.accuracies[index];
        options(accuracy, depth, stop)
    }
}

/// Checks that an accuracy is above 0 and at most 1.
pub(crate) fn check_accuracy(accuracy: f64) -> Result<(), AskError> {
    if accuracy > 0.0 && accuracy <= 1.0 { Ok(()) } else { Err(AskError::Accuracy(accuracy)) }
}

/// Options with accuracies that were checked.
pub(crate) fn options(accuracy: f64, depth: f64, stop: &Stop) -> Options<'_> {
    let options = Options::default().with_stop(stop.flag());
    let options = options.with_accuracy(accuracy).unwrap_or(options);
    options.with_depth_accuracy(depth).unwrap_or(options)
}
