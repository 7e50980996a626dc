//! When a search may stop.

/// What a bracket has to say for a search to stop before it is narrow.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct StopCriterion {
    /// The distance is at most this.
    pub(in crate::measure) near: f64,
    /// The distance exceeds this.
    pub(in crate::measure) far: f64,
}

impl StopCriterion {
    /// Only a narrow bracket will do.
    pub(in crate::measure) const NARROW: Self = Self { near: f64::NEG_INFINITY, far: f64::INFINITY };

    /// Which side of this distance.
    pub(in crate::measure) fn compare(distance: f64) -> Self {
        Self { near: distance, far: distance }
    }

    /// A narrow bracket unless the distance exceeds this.
    pub(in crate::measure) fn beyond(far: f64) -> Self {
        Self { far, ..Self::NARROW }
    }

    /// The same with lengths in units of this number of metres, a power of two.
    pub(in crate::measure) fn in_units_of(&self, unit: f64) -> Self {
        Self { near: self.near / unit, far: self.far / unit }
    }

    /// What it asks of the distance of sets around whose points this radius counts, metres: with as
    /// much to spare as its subtraction may round.
    pub(in crate::measure) fn beyond_radius(&self, radius: f64) -> Self {
        let spare = |limit: f64| 4.0 * f64::EPSILON * (radius + limit.abs());
        if radius == 0.0 || self.is_narrow() {
            return *self;
        }
        Self { near: self.near + radius - spare(self.near), far: self.far + radius + spare(self.far) }
    }

    pub(in crate::measure) fn is_narrow(&self) -> bool {
        self.near == f64::NEG_INFINITY && self.far == f64::INFINITY
    }

    /// Whether the question is on which side of contact the bodies are.
    pub(in crate::measure) fn is_contact(&self) -> bool {
        self.near == 0.0 && self.far == 0.0
    }

    /// Whether a narrow bracket is an answer, with all that comes with one, and not just a
    /// decision.
    pub(in crate::measure) fn wants_answer(&self) -> bool {
        self.near == f64::NEG_INFINITY
    }

    #[inline]
    pub(in crate::measure) fn met(&self, lower: f64, upper: f64) -> bool {
        upper <= self.near || lower > self.far
    }
}
