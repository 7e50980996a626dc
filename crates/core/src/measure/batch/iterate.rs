//! Newton's method in lanes: iterates and their steps.

use super::waiting::Group;
use crate::measure::frames::vector::{M3, V3, add_scaled, apply, basis, subtract};
use crate::measure::solver::tangent_newton::{Plane, Side, Step, SurfaceCurvature, moved, newton};
use crate::polynomial::{Number, NumberJet, Simd, Vector};

/// Trial points, and a normal of any length.
#[derive(Clone, Copy)]
pub(super) struct Iterate<N> {
    pub(super) x: V3<N>,
    pub(super) y: V3<N>,
    pub(super) n: V3<N>,
}

/// A Newton step with the bases it was made in.
pub(super) struct Linearized<N> {
    pub(super) frame: M3<N>,
    pub(super) local: (M3<N>, M3<N>),
    pub(super) difference: V3<N>,
    pub(super) step: Step<N>,
    /// Square of its moves relative to their limits.
    pub(super) square: N,
}

impl<N: Copy> Iterate<N> {
    #[inline(always)]
    pub(super) fn linearize<S: Simd>(
        &self,
        simd: S,
        (side_a, jet_a): (&Side<'_, N>, &NumberJet<N>),
        (side_b, jet_b): (&Side<'_, N>, &NumberJet<N>),
        limits: [f64; 2],
    ) -> Linearized<N>
    where
        N: Number<S>,
    {
        let frame = basis(simd, self.n);
        let local = (side_a.localize(simd, &frame), side_b.localize(simd, &frame));
        let (a, b) = (Plane::new(simd, jet_a, &local.0), Plane::new(simd, jet_b, &local.1));
        let (curvature_a, curvature_b) =
            (SurfaceCurvature::new(simd, jet_a, &local.0), SurfaceCurvature::new(simd, jet_b, &local.1));
        let difference = apply(&frame, subtract(self.x, self.y));
        let zero = N::splat(simd, 0.0);
        let (step, _) = newton(simd, (&a, &curvature_a), (&b, &curvature_b), difference, zero);
        let square = step.square(simd, limits);
        Linearized { frame, local, difference, step, square }
    }

    /// What a group was left with.
    #[inline(always)]
    pub(super) fn load<S: Simd, const LANES: usize>(simd: S, group: &Group<LANES>) -> Self
    where
        N: Vector<S>,
    {
        let column = |i: usize| N::load(simd, &group.at.0[i]);
        Self {
            x: [column(0), column(1), column(2)],
            y: [column(3), column(4), column(5)],
            n: [column(6), column(7), column(8)],
        }
    }

    /// Leaves it to the group.
    #[inline(always)]
    pub(super) fn store<S: Simd, const LANES: usize>(&self, group: &mut Group<LANES>)
    where
        N: Vector<S>,
    {
        for (coordinate, column) in [self.x, self.y, self.n].as_flattened().iter().zip(&mut group.at.0) {
            coordinate.store(column);
        }
    }

    /// Takes a step, within its limits.
    #[inline(always)]
    pub(super) fn advance<S: Simd>(&mut self, simd: S, Linearized { frame, step, square, .. }: &Linearized<N>)
    where
        N: Number<S>,
    {
        let step = step.at_most(simd, *square);
        self.x = moved(self.x, step.dx, frame);
        self.y = moved(self.y, step.dy, frame);
        self.n = add_scaled(add_scaled(frame[2], step.dn[0], frame[0]), step.dn[1], frame[1]);
    }
}
