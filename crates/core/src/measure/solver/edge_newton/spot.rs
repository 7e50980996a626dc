//! Where a body of several constraints was met, for the next query of the pair.

use super::aggregate::{Evaluated, Weighted};
use crate::measure::frames::vector::{V3, add, add_scaled, apply_symmetric, dot};
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::polynomial::{NumberJet, Simd};

/// A witness with the constraints that are active there, for the next query of the pair.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Spot {
    /// From the centre of the normalization on, body frame, metres.
    pub(super) point: V3<f64>,
    /// With multipliers, metres.
    pub(super) active: Weighted,
    /// Values and gradients of the active constraints there, in normalized coordinates.
    tangents: [(f64, V3<f64>); MAX_ACTIVE],
    /// Sum of their Hessians with their multipliers: xx, xy, xz, yy, yz, zz.
    pub(super) hessian: [f64; 6],
}

impl Spot {
    /// At the end of a step by normalized coordinates from where the constraints are evaluated.
    #[inline(always)]
    pub(super) fn new<S: Simd>(
        simd: S,
        point: V3<f64>,
        active: Weighted,
        (evaluated, delta): (&Evaluated, V3<f64>),
    ) -> Self {
        let mut tangents = [(0.0, [0.0; 3]); MAX_ACTIVE];
        for k in 0..active.len {
            tangents[k] = extrapolated(simd, &evaluated.jets[usize::from(active.index[k])], delta);
        }
        Self { point, active, tangents, hessian: active.sum(simd, evaluated).hessian }
    }

    /// The active constraints with their positions.
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64, V3<f64>)> {
        let tangent = |k: usize| (usize::from(self.active.index[k]), self.tangents[k].0, self.tangents[k].1);
        (0..self.active.len).map(tangent)
    }
}

/// Value and gradient at the end of a step by normalized coordinates, to second order.
#[inline(always)]
fn extrapolated<S: Simd>(_: S, jet: &NumberJet<f64>, delta: V3<f64>) -> (f64, V3<f64>) {
    let bent = apply_symmetric::<S, f64>(&jet.hessian, delta);
    let value = jet.value + dot::<S, f64>(delta, add_scaled::<S, f64>(jet.gradient, 0.5, bent));
    (value, add::<S, f64>(jet.gradient, bent))
}
