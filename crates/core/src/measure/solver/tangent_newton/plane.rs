//! The linearization of a constraint in a basis of tangents and normal.

use crate::measure::frames::vector::{M3, V3, dot};
use crate::polynomial::{Number, NumberJet, Simd};

/// Value and gradient of a constraint at a point, the gradient along the two tangents and the
/// normal.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Plane<N> {
    pub(in crate::measure) value: N,
    pub(in crate::measure) gradient: V3<N>,
}

impl Plane<f64> {
    /// How much it descends along the normal per length along the tangents.
    #[inline(always)]
    pub(in crate::measure) fn slope(&self) -> [f64; 2] {
        let inverse = 1.0 / self.gradient[2];
        [self.gradient[0] * inverse, self.gradient[1] * inverse]
    }
}

impl<N: Copy> Plane<N> {
    /// The constraint with this jet, along the vectors of a basis in its normalized coordinates.
    #[inline(always)]
    pub(in crate::measure) fn new<S: Simd>(_: S, jet: &NumberJet<N>, [t0, t1, n]: &M3<N>) -> Self
    where
        N: Number<S>,
    {
        let g = jet.gradient;
        Self { value: jet.value, gradient: [dot(g, *t0), dot(g, *t1), dot(g, *n)] }
    }
}
