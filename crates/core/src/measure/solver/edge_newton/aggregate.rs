//! Several constraints of a body at a point, and a weighted sum of those that are active.

use crate::body::{Body, ConstraintTrust, MAX_CONSTRAINTS};
use crate::measure::frames::vector::{M3, V3, add_scaled, apply, dot};
use crate::measure::solver::active_constraints::{ActiveConstraints, ActiveSet, MAX_ACTIVE};
use crate::measure::solver::tangent_newton::Side;
use crate::polynomial::{NEAR_LEVEL, NumberJet, Simd, ThirdCeiling};

/// Roundings of a sum of three terms with weights, relative to the sum of magnitudes.
const SUM_ROUNDING: f64 = 8.0 * f64::EPSILON;

/// No value, gradient or Hessian.
const NOTHING: NumberJet<f64> = NumberJet { value: 0.0, gradient: [0.0; 3], hessian: [0.0; 6] };

/// All constraints of a body at a point, in its normalized coordinates.
pub(super) struct Evaluated {
    pub(super) jets: [NumberJet<f64>; MAX_CONSTRAINTS],
    pub(super) count: usize,
}

impl Evaluated {
    /// A place for them: it is large, and so it is filled where it is.
    #[inline(always)]
    pub(super) fn none() -> Self {
        Self { jets: [NOTHING; MAX_CONSTRAINTS], count: 0 }
    }

    /// Evaluates them at a point; whether it lies in the ball of the body's [`crate::body::Trust`].
    #[inline(always)]
    pub(super) fn fill<S: Simd>(&mut self, simd: S, side: &Side<'_, f64>, v: V3<f64>) -> bool {
        let z = side.normalized(simd, v);
        let radius = side.body().trust().radius;
        let constraints = side.body().constraints();
        for (jet, constraint) in self.jets.iter_mut().zip(constraints) {
            *jet = constraint.polynomial.jet(simd, z);
        }
        self.count = constraints.len();
        dot::<S, f64>(z, z) <= radius * radius
    }

    /// Positions, values and gradients.
    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64, V3<f64>)> {
        self.jets[..self.count].iter().enumerate().map(|(i, jet)| (i, jet.value, jet.gradient))
    }

    /// The constraint with the largest value.
    #[inline(always)]
    pub(super) fn highest(&self) -> usize {
        (0..self.count).max_by(|&i, &j| self.jets[i].value.total_cmp(&self.jets[j].value)).unwrap_or(0)
    }

    /// The point, to which a step has led too far, brought near the body by that constraint; none
    /// if it is no place.
    #[inline(always)]
    pub(super) fn brought_near<S: Simd>(&self, simd: S, side: &Side<'_, f64>, v: V3<f64>) -> Option<V3<f64>> {
        let highest = self.highest();
        let v = side.with_active(highest).brought_near(simd, v, self.jets[highest].value);
        v.iter().all(|entry| entry.is_finite()).then_some(v)
    }
}

/// Constraints with their weights; those beyond are 0.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Weighted {
    pub(super) index: [u8; MAX_ACTIVE],
    pub(super) weight: [f64; MAX_ACTIVE],
    pub(super) len: usize,
}

impl Weighted {
    /// The constraint with the largest value alone, weighted so that its gradient has length 1 in
    /// the basis whose vectors are `local` in normalized coordinates.
    #[inline(always)]
    pub(super) fn highest<S: Simd>(_: S, all: &Evaluated, local: &M3<f64>) -> Self {
        let (mut active, highest) = (Self { len: 1, ..Self::default() }, all.highest());
        let gradient = apply::<S, f64>(local, all.jets[highest].gradient);
        active.index[0] = highest as u8;
        active.weight[0] = 1.0 / dot::<S, f64>(gradient, gradient).sqrt();
        active
    }

    #[inline(always)]
    pub(super) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..self.len).map(|k| (usize::from(self.index[k]), self.weight[k]))
    }

    /// Weights that sum to 1; none unless their sum is a positive number.
    #[inline(always)]
    pub(super) fn normalized(&self) -> Option<Self> {
        let sum = self.weight[0] + self.weight[1] + self.weight[2];
        if sum > 0.0 && sum.is_finite() { Some(self.times(1.0 / sum)) } else { None }
    }

    /// All weights times a factor.
    #[inline(always)]
    pub(super) fn times(&self, factor: f64) -> Self {
        let [a, b, c] = self.weight;
        Self { weight: [a * factor, b * factor, c * factor], ..*self }
    }

    /// The weighted sum of constraints.
    #[inline(always)]
    pub(super) fn sum<S: Simd>(&self, _: S, all: &Evaluated) -> NumberJet<f64> {
        let mut sum = NOTHING;
        for (i, weight) in self.iter() {
            let jet = &all.jets[i];
            sum.value += weight * jet.value;
            sum.gradient = add_scaled::<S, f64>(sum.gradient, weight, jet.gradient);
            for k in 0..6 {
                sum.hessian[k] += weight * jet.hessian[k];
            }
        }
        sum
    }

    /// Which have a weight.
    #[inline(always)]
    pub(super) fn set(&self) -> ActiveSet {
        self.iter().filter(|(_, weight)| *weight > 0.0).fold(0, |set, (i, _)| set | 1 << i)
    }

    /// As answers report them: without those of no weight.
    #[inline(always)]
    pub(super) fn reported(&self) -> ActiveConstraints {
        let mut active = ActiveConstraints::default();
        self.iter().filter(|(_, weight)| *weight > 0.0).for_each(|(i, weight)| active.push(i, weight));
        active
    }

    /// What is known of the sum `Σ w_i g_i` near the body, for weights that sum to 1, at a point
    /// with these jets; none if bounds of third derivatives do not hold there.
    #[inline(always)]
    pub(super) fn trust<S: Simd>(&self, _: S, body: &Body, jets: &Evaluated) -> Option<ConstraintTrust> {
        let mut sum = ConstraintTrust {
            value_error: 4.0 * SUM_ROUNDING,
            gradient_error: 0.0,
            curvature_floor: 0.0,
            curvature_ceiling: 0.0,
            curvature_error: 0.0,
            third: ThirdCeiling { ceiling: 0.0, leeway: f64::INFINITY, kept: f64::INFINITY },
        };
        for (i, weight) in self.iter() {
            let (trust, jet) = (&body.trust().constraints[i], &jets.jets[i]);
            let third = &trust.third;
            if third.ceiling > 0.0 && (jet.value - 1.0).abs() > NEAR_LEVEL {
                return None;
            }
            let slope = dot::<S, f64>(jet.gradient, jet.gradient).sqrt();
            let bend = jet.hessian.iter().fold(0.0, |sum, entry| sum + entry.abs());
            sum.value_error += weight * (trust.value_error + SUM_ROUNDING * jet.value.abs());
            sum.gradient_error += weight * (trust.gradient_error + SUM_ROUNDING * slope * body.trust().linear_norm);
            sum.curvature_floor += weight * trust.curvature_floor * (1.0 - SUM_ROUNDING);
            sum.curvature_ceiling += weight * trust.curvature_ceiling * (1.0 + SUM_ROUNDING);
            sum.curvature_error += weight * (trust.curvature_error + SUM_ROUNDING * bend);
            sum.third.ceiling += weight * third.ceiling * (1.0 + SUM_ROUNDING);
            sum.third.leeway = sum.third.leeway.min(third.leeway);
        }
        if sum.third.ceiling > 0.0 {
            sum.third.kept = 1.5 * (1.0 - 1e-12) / sum.third.ceiling;
        }
        Some(sum)
    }
}
