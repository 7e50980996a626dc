//! Where a line enters a convex set, as far as is proven.

/// What is known of the parameters s at which a line is in a convex set `φ(s) <= 0`, φ convex.
///
/// Each value of φ with its slope cuts off the side where its tangent is positive; from outside
/// that is Newton's method, which never passes the first root of a convex function, and from inside
/// it bounds the root from the other side.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::measure) struct Entry {
    /// No smaller parameter is in the set.
    pub(in crate::measure) from: f64,
    /// No larger parameter is in the set.
    pub(in crate::measure) to: f64,
    /// The smallest parameter known to be in the set; infinite while none is.
    pub(in crate::measure) inside: f64,
}

impl Entry {
    pub(in crate::measure) fn between(from: f64, to: f64) -> Self {
        Self { from, to, inside: f64::INFINITY }
    }

    /// Takes note that `φ(t) >= value + slope (t - s)` for some slope between the two, for all t.
    pub(in crate::measure) fn cut(&mut self, s: f64, value: f64, slope_low: f64, slope_high: f64) {
        // Zero of the tangent, moved towards s by more than the rounding of its computation.
        let zero = |slope: f64| {
            let step = -value / slope * (1.0 - 4.0 * f64::EPSILON * value.signum());
            (s + step, 2.0 * f64::EPSILON * (s.abs() + step.abs()))
        };
        if value > 0.0 {
            // Nothing between the zeros to the left and to the right of s is in the set.
            let left = if slope_high > 0.0 { zero(slope_high) } else { (f64::NEG_INFINITY, 0.0) };
            let right = if slope_low < 0.0 { zero(slope_low) } else { (f64::INFINITY, 0.0) };
            if left.0 + left.1 < self.from {
                self.from = self.from.max(right.0 - right.1);
            }
            if right.0 - right.1 > self.to {
                self.to = self.to.min(left.0 + left.1);
            }
        } else {
            if slope_high < 0.0 {
                let (zero, error) = zero(slope_high);
                self.from = self.from.max(zero - error);
            }
            if slope_low > 0.0 {
                let (zero, error) = zero(slope_low);
                self.to = self.to.min(zero + error);
            }
        }
    }

    /// Takes note that the set lies between two parameters that are off by at most two roundings.
    pub(in crate::measure) fn clip(&mut self, from: f64, to: f64) {
        self.from = self.from.max(from - 2.0 * f64::EPSILON * from.abs());
        self.to = self.to.min(to + 2.0 * f64::EPSILON * to.abs());
    }

    /// Takes note that s is in the set.
    pub(in crate::measure) fn touch(&mut self, s: f64) {
        self.inside = self.inside.min(s);
    }

    /// Whether no parameter is in the set.
    pub(in crate::measure) fn missed(&self) -> bool {
        self.from > self.to
    }

    /// Upper bound of the first parameter in the set, if any is.
    pub(in crate::measure) fn end(&self) -> f64 {
        self.inside.min(self.to)
    }

    pub(in crate::measure) fn width(&self) -> f64 {
        self.end() - self.from
    }

    /// The guess if it lies strictly between the bounds, else their middle.
    pub(in crate::measure) fn safeguard(&self, guess: f64) -> f64 {
        if guess > self.from && guess < self.end() { guess } else { self.from + 0.5 * self.width() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    /// Tangents of |s - c|^k - h anywhere, with slopes known to a little, never cut off a parameter
    /// of the set.
    #[test]
    fn cuts_keep_the_set() {
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let (c, h) = (random.signed(), 10_f64.powf(-4.0 + 4.0 * random.signed()));
            let k = 1 + (seed % 8) as i32;
            let mut entry = Entry::between(-3.0, 3.0);
            let radius = h.powf(1.0 / f64::from(k));
            for _ in 0..12 {
                let s = if seed % 2 == 0 { 3.0 * random.signed() } else { entry.safeguard(3.0 * random.signed()) };
                let d: f64 = s - c;
                let value = d.abs().powi(k) - h;
                let slope = d.signum() * f64::from(k) * d.abs().powi(k - 1);
                let error = 1e-9 * random.signed().abs() * if seed % 3 == 0 { 1e6 } else { 1.0 };
                entry.cut(s, value - 1e-15, slope - error, slope + error);
                if value <= 0.0 {
                    entry.touch(s);
                }
                assert!(entry.from <= c - radius + 1e-14 && entry.to >= c + radius - 1e-14, "seed {seed}: {entry:?}");
                assert!(entry.inside >= c - radius - 1e-14, "seed {seed}: {entry:?}");
                assert!(!entry.missed() || radius < 1e-14, "seed {seed}: {entry:?}");
            }
        }
    }

    #[test]
    fn one_tangent_can_prove_a_miss() {
        let mut entry = Entry::between(0.0, 1.0);
        entry.cut(0.5, 1.0, -1e-3, 1e-3);
        assert!(entry.missed());
    }
}
