//! The constraints of one body around a trial point, as rows of quadratic programs.

use super::aggregate::Weighted;
use super::quadratic_program::{ActiveRows, Row};
use crate::body::MAX_CONSTRAINTS;
use crate::measure::frames::vector::{M3, V3, apply, apply_symmetric, dot, scaled};
use crate::measure::solver::active_constraints::MAX_ACTIVE;
use crate::polynomial::Simd;

/// One body's constraints around a trial point, in the basis.
pub(super) struct Linearized {
    rows: [Row; MAX_CONSTRAINTS],
    /// Lengths of the gradients, per metre.
    lengths: [f64; MAX_CONSTRAINTS],
    /// Which constraint of the body each row is.
    index: [u8; MAX_CONSTRAINTS],
    pub(super) count: usize,
    pub(super) active: ActiveRows,
    /// Sum of the Hessians of the active ones with their multipliers, per metre.
    pub(super) hessian: [f64; 6],
}

impl Linearized {
    /// A place for them: it is large, and so it is filled where it is.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self {
            rows: [Row::default(); MAX_CONSTRAINTS],
            lengths: [0.0; MAX_CONSTRAINTS],
            index: [0; MAX_CONSTRAINTS],
            count: 0,
            active: ActiveRows::default(),
            hessian: [0.0; 6],
        }
    }

    /// Takes constraints that are given by their positions in the body, values and gradients, and
    /// the sum of the Hessians of the active ones, in normalized coordinates.
    #[inline(always)]
    pub(super) fn fill<S: Simd>(
        &mut self,
        _: S,
        tangents: impl Iterator<Item = (usize, f64, V3<f64>)>,
        (active, bent): (&Weighted, &[f64; 6]),
        local: &M3<f64>,
    ) {
        (self.count, self.active) = (0, ActiveRows::default());
        for (i, value, gradient) in tangents {
            let is_active = active.iter().any(|(j, _)| j == i);
            // Along a step within a quarter of the body values of the edge of a slab do not grow
            // fivefold; what is left out is looked at again where the step leads.
            if !is_active && value <= 0.04 {
                continue;
            }
            let gradient = apply::<S, f64>(local, gradient);
            let length = dot::<S, f64>(gradient, gradient).sqrt();
            let inverse = 1.0 / length;
            let mean = (0.5 * value + 0.5).max(0.25);
            self.rows[self.count] =
                Row { normal: scaled::<S, f64>(gradient, inverse), excess: (value - 1.0) * mean * inverse };
            self.lengths[self.count] = length;
            self.index[self.count] = i as u8;
            if is_active {
                self.active.push(self.count);
            }
            self.count += 1;
        }
        // No closures: what is inlined into one is not compiled for the vectors at hand.
        let b0 = apply_symmetric::<S, f64>(bent, local[0]);
        let b1 = apply_symmetric::<S, f64>(bent, local[1]);
        let b2 = apply_symmetric::<S, f64>(bent, local[2]);
        self.hessian = [
            dot::<S, f64>(b0, local[0]),
            dot::<S, f64>(b0, local[1]),
            dot::<S, f64>(b0, local[2]),
            dot::<S, f64>(b1, local[1]),
            dot::<S, f64>(b1, local[2]),
            dot::<S, f64>(b2, local[2]),
        ];
    }

    #[inline(always)]
    pub(super) fn rows(&self) -> &[Row] {
        &self.rows[..self.count]
    }

    /// How far along the normal the first active constraint is, metres.
    #[inline(always)]
    pub(super) fn shift(&self) -> f64 {
        let row = &self.rows[usize::from(self.active.index[0])];
        -row.excess * row.normal[2]
    }

    /// The constraints of active rows with their multipliers, metres, by those of unit rows.
    #[inline(always)]
    pub(super) fn weighted(&self, active: &ActiveRows, multipliers: [f64; MAX_ACTIVE]) -> Weighted {
        let mut weighted = Weighted { len: active.len, ..Weighted::default() };
        for (k, i) in active.iter().enumerate() {
            weighted.index[k] = self.index[i];
            weighted.weight[k] = multipliers[k] / self.lengths[i];
        }
        weighted
    }
}
