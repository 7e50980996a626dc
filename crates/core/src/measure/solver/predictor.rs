//! What predictions miss along a trajectory: where motions are smooth it changes slowly, and can be
//! foreseen.

use crate::measure::frames::vector::{V3, add, dot, subtract};
use crate::polynomial::Simd;

/// What the last prediction of some vectors missed, and what the next one is expected to.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Drift<const K: usize> {
    missed: [V3<f64>; K],
    expected: [V3<f64>; K],
}

impl<const K: usize> Default for Drift<K> {
    fn default() -> Self {
        Self { missed: [[0.0; 3]; K], expected: [[0.0; 3]; K] }
    }
}

impl<const K: usize> Drift<K> {
    /// What the next prediction is expected to miss.
    #[inline(always)]
    pub(in crate::measure) fn expected(&self) -> [V3<f64>; K] {
        self.expected
    }

    /// After a prediction that missed this: more of the same, and where the change from the last
    /// one is small against it, that change again.
    #[inline(always)]
    pub(in crate::measure) fn update<S: Simd>(&mut self, _: S, missed: [V3<f64>; K]) {
        for i in 0..K {
            let change = subtract::<S, f64>(missed[i], self.missed[i]);
            let steady = 4.0 * dot::<S, f64>(change, change) <= dot::<S, f64>(missed[i], missed[i]);
            self.expected[i] = if steady { add::<S, f64>(missed[i], change) } else { missed[i] };
        }
        self.missed = missed;
    }
}

#[cfg(test)]
mod tests {
    use super::Drift;
    use crate::polynomial::Scalar;

    #[test]
    fn a_slow_change_goes_on_and_a_jump_does_not() {
        let mut drift = Drift::<1>::default();
        assert_eq!(drift.expected(), [[0.0; 3]]);
        let mut after = |missed: [f64; 3]| {
            drift.update(Scalar, [missed]);
            drift.expected()[0]
        };
        // The first miss is a jump from nothing.
        assert_eq!(after([1.0, 0.0, 0.0]), [1.0, 0.0, 0.0]);
        assert_eq!(after([1.25, 0.25, 0.0]), [1.5, 0.5, 0.0]);
        assert_eq!(after([-1.25, 0.25, 0.0]), [-1.25, 0.25, 0.0]);
        assert_eq!(after([-1.25, 0.25, 0.5]), [-1.25, 0.25, 1.0]);
    }
}
