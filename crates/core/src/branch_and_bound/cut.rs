//! How far what is in a box and in some half-spaces reaches.

use crate::body::MAX_CONSTRAINTS;
use nalgebra::Vector3;

/// A half-space `gradient·δ <= slack` about the centre of a box.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cut {
    pub(super) gradient: Vector3<f64>,
    pub(super) slack: f64,
}

impl Cut {
    /// Whether no point of the box is in it.
    pub(super) fn excludes(&self, half: &Vector3<f64>) -> bool {
        let reach = self.gradient.abs().dot(half);
        self.slack < -reach - 8.0 * f64::EPSILON * (reach + self.slack.abs())
    }
}

/// Upper bound of `m·δ` over the points of the box `|δ_i| <= half_i` that are in all cuts.
///
/// For any λ >= 0, `m·δ <= Σ λ_k slack_k + Σ_i half_i |m - Σ λ_k gradient_k|_i` (duality of linear
/// programs). The right-hand side is convex and piecewise linear in each λ_k: it is minimised over
/// one after the other, which for a single cut is exact.
pub(super) fn support(half: &Vector3<f64>, cuts: &[Cut], m: &Vector3<f64>) -> f64 {
    let mut rest = *m;
    let mut multipliers = [0.0; MAX_CONSTRAINTS];
    let passes = if cuts.len() > 1 { 2 } else { 1 };
    for _ in 0..passes {
        for (cut, multiplier) in cuts.iter().zip(&mut multipliers) {
            let bound = |step: f64| step * cut.slack + half.dot(&(rest - cut.gradient * step).abs());
            let (mut best, mut step) = (bound(0.0), 0.0);
            // A minimum is at a kink, or where the multiplier is 0.
            let kinks = (0..3).map(|i| rest[i] / cut.gradient[i]).chain(std::iter::once(-*multiplier));
            for kink in kinks.filter(|kink| kink.is_finite()) {
                let kink = kink.max(-*multiplier);
                let value = bound(kink);
                if value < best {
                    (best, step) = (value, kink);
                }
            }
            *multiplier = (*multiplier + step).max(0.0);
            rest -= cut.gradient * step;
        }
    }
    // Again from the multipliers alone, with what every term may be off by.
    let (mut sum, mut size) = (0.0, half.dot(&m.abs()));
    rest = *m;
    for (cut, &multiplier) in cuts.iter().zip(&multipliers).filter(|(_, multiplier)| **multiplier > 0.0) {
        sum += multiplier * cut.slack;
        size += multiplier * (cut.slack.abs() + half.dot(&cut.gradient.abs()));
        rest -= cut.gradient * multiplier;
    }
    sum + half.dot(&rest.abs()) + 32.0 * f64::EPSILON * size
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_testkit::Seeded;

    #[test]
    fn no_point_of_the_box_and_the_cuts_reaches_farther() {
        let (mut close, mut cases) = (0, 0);
        for seed in 0..400 {
            let mut random = Seeded(seed);
            let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.signed());
            let (half, m) = (vector(1.0).abs(), vector(1.0));
            let cuts: Vec<Cut> =
                (0..seed % 4).map(|k| Cut { gradient: vector(2.0), slack: vector(0.4)[k as usize % 3] }).collect();
            let bound = support(&half, &cuts, &m);
            let mut reached = f64::NEG_INFINITY;
            for _ in 0..4000 {
                let point = half.component_mul(&Vector3::from_fn(|_, _| (1.5 * random.signed()).clamp(-1.0, 1.0)));
                if cuts.iter().all(|cut| cut.gradient.dot(&point) <= cut.slack) {
                    reached = reached.max(m.dot(&point));
                }
            }
            assert!(reached <= bound, "seed {seed}: {reached} beyond {bound}");
            // One cut is exact; samples come near.
            if cuts.len() <= 1 && reached.is_finite() {
                cases += 1;
                close += u32::from(bound - reached < 0.1 * half.dot(&m.abs()));
            }
            if cuts.iter().any(|cut| cut.excludes(&half)) {
                assert_eq!(reached, f64::NEG_INFINITY, "seed {seed}");
            }
        }
        assert!(close * 10 > cases * 9, "{close} of {cases}");
    }
}
