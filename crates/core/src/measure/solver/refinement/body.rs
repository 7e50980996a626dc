//! A body in double-double arithmetic: its constraints with their errors, how far it reaches beyond
//! a point, and points of it.

use crate::body::largest;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Posed;
use crate::measure::solver::double_double::{
    Two, Twos, UNIT, apply, doubles, minus, plus, product, times, transposed, twos,
};
use crate::measure::solver::kkt_newton::{Active, At};
use crate::polynomial::Polynomial;
use nalgebra::{Matrix3, Vector3};

/// Most changes of the active constraints: a start with more wrong ones is near no solution.
pub(super) const MAX_REVISED: u32 = 4;

/// By how much an inactive constraint may be violated, dimensionless, however near the bodies are:
/// values round at 1e-28 there.
///
/// Larger, normals near contact are off by constraints that are left out; smaller, rounding
/// exchanges constraints. Exercised by `alignment_turns_normals`.
pub(super) const NEGLIGIBLE: f64 = 1e-26;

/// Bound of an evaluation's error in double-double arithmetic as a share of that in doubles;
/// dimensionless. Both count a few hundred roundings, of 2⁻¹⁰³ and of 2⁻⁵³; the share leaves a
/// factor of 100.
///
/// Smaller, a refined bracket could miss the truth; larger, it is no narrower than one of doubles.
/// Exercised by `refinement_goes_on_alone` from above and by the exact re-checks
/// (`tests/stability/recheck.rs`).
const SHARE: f64 = 1e-13;

/// A body in the query frame, `z = linear v + offset`.
pub(super) struct RefinedBody<'a> {
    pub(super) posed: &'a Posed<'a>,
    linear: [Twos; 3],
    offset: Twos,
    /// Sum of the lengths that `offset` is computed from, query units.
    size: f64,
    /// The nearest doubles of `linear`.
    pub(super) rounded: Matrix3<f64>,
}

/// A constraint at a point.
pub(super) struct RefinedJet {
    pub(super) value: Two,
    /// With respect to points of the query frame.
    pub(super) gradient: Twos,
    pub(super) value_error: f64,
    /// Bound of the error of each component with respect to z.
    pub(super) z_gradient_error: f64,
    /// Bound of the products that the gradient is made of.
    pub(super) size: f64,
    hessian: Matrix3<f64>,
}

impl<'a> RefinedBody<'a> {
    /// The body from whose frame a point v of the query frame is seen at `turn (unit v) + shift`,
    /// metres; the shift is computed from lengths of this sum, metres.
    pub(super) fn new(posed: &'a Posed<'a>, unit: f64, turn: &[Twos; 3], (shift, size_m): (&Twos, f64)) -> Self {
        let normalization = posed.body.normalization();
        let rows: [Twos; 3] = std::array::from_fn(|i| twos(&normalization.linear.row(i).transpose()));
        let linear = product(&rows, turn).map(|row| times(&row, Two::from(unit)));
        let offset = apply(&rows, &minus(shift, &twos(&normalization.center)));
        let rounded = Matrix3::from_fn(|i, j| linear[i][j].double());
        let size = (size_m + normalization.center.norm()) / unit;
        Self { posed, linear, offset, size, rounded }
    }

    fn z(&self, v: &Twos) -> Twos {
        plus(&apply(&self.linear, v), &self.offset)
    }

    fn polynomial(&self, i: usize) -> &Polynomial {
        &self.posed.body.constraints()[i].polynomial
    }

    pub(super) fn jet(&self, i: usize, v: &Twos) -> RefinedJet {
        let (z, polynomial) = (self.z(v), self.polynomial(i));
        let (value, gradient) = expand(polynomial, &z);
        let rounded = doubles(&z);
        let jet = polynomial.evaluate(&rounded);
        let none = Vector3::zeros();
        // z is off by a few units of double-double arithmetic.
        let dz = Vector3::repeat(16.0 * UNIT * self.z_size(v));
        RefinedJet {
            value,
            gradient: apply(&transposed(&self.linear), &gradient),
            value_error: SHARE * polynomial.value_error(&rounded, &jet.gradient, &none)
                + 2.0 * jet.gradient.abs().dot(&dz),
            z_gradient_error: SHARE * polynomial.gradient_error(&rounded, &none) + 2.0 * jet.hessian.abs().sum() * dz.x,
            size: jet.gradient.norm() * self.rounded.norm() * (1.0 + 1e-12),
            hessian: self.rounded.transpose() * jet.hessian * self.rounded,
        }
    }

    /// Bound of the sum of the magnitudes that z is made of; the rows of the map are sums of larger
    /// ones for bodies that are long and turned.
    fn z_size(&self, v: &Twos) -> f64 {
        let rows: f64 = self.rounded.row_iter().map(|row| row.norm()).sum();
        rows * (doubles(v).lp_norm(1) + self.size)
    }

    /// Rigorous upper bound of `-min r·(x' - v)` over the points x' of the body:
    /// [`crate::measure::bounds::duality_bounds::descent`].
    pub(super) fn descent(&self, v: &Twos, r: &Twos, active: &RefinedActive) -> Two {
        let (mut slack, mut rest, mut error) = (Two::ZERO, *r, 0.0);
        let reach = self.posed.reach(&doubles(v));
        let z = doubles(&self.z(v)).abs();
        let spans = (self.posed.body.z_extent() + z) * (1.0 + 1e-12);
        for (i, multiplier) in active.positive() {
            let jet = self.jet(i, v);
            slack += multiplier * (Two::from(1.0) - jet.value);
            rest = plus(&rest, &times(&jet.gradient, multiplier));
            let rounding = 64.0 * UNIT * (1.0 + jet.value.double().abs() + jet.size * reach);
            error += multiplier.double() * (jet.value_error + jet.z_gradient_error * spans.sum() + rounding);
        }
        // In z, where needles cost no digits; what the inverse misses, in lengths.
        let in_z = self.posed.functional(&doubles(&rest)).0;
        let missed = minus(&rest, &apply(&transposed(&self.linear), &twos(&in_z)));
        let rounding = 64.0 * UNIT * (doubles(r).norm() + self.rounded.norm() * in_z.norm());
        error += in_z.abs().dot(&spans) + (doubles(&missed).norm() + rounding) * reach;
        slack + Two::from(error * (1.0 + 1e-12))
    }

    /// The point moved into the body: against the gradients of violated constraints, or where that
    /// does not lead in, as in sharp edges, towards the interior point. None if neither does.
    pub(super) fn move_inside(&self, v: &Twos) -> Option<Twos> {
        let mut point = *v;
        for _ in 0..6 {
            let (excess, jet) = self.worst(&point)?;
            if excess <= 0.0 {
                return Some(point);
            }
            let gradient = doubles(&jet.gradient);
            // A little past the boundary, as the next point is rounded too.
            let step = gradient * ((1.001 * excess + 2.0 * jet.value_error) / gradient.norm_squared());
            if !(step.norm() <= 1e-3 * self.posed.reach(&doubles(&point))) {
                return None;
            }
            point = minus(&point, &twos(&step));
        }
        self.move_towards_interior(v)
    }

    /// Values are convex along the way: a share of it that is the excess divided by the depth of
    /// the interior point leads in, but for what rounding adds.
    fn move_towards_interior(&self, v: &Twos) -> Option<Twos> {
        let way = minus(&twos(&self.posed.interior), v);
        let share = 2.0 * self.worst(v)?.0 / (1.0 - self.posed.body.min_value());
        let tried = [1.0, 4.0, 16.0].map(|factor| plus(v, &times(&way, Two::from(factor * share))));
        tried.into_iter().find(|point| self.worst(point).is_some_and(|(excess, _)| excess <= 0.0))
    }

    /// The constraint with the largest bound of its value, and by how much that exceeds 1; none
    /// where one has no value.
    fn worst(&self, v: &Twos) -> Option<(f64, RefinedJet)> {
        let mut worst: Option<(f64, RefinedJet)> = None;
        for i in 0..self.posed.len() {
            let jet = self.jet(i, v);
            let excess = (jet.value - Two::from(1.0)).double() + jet.value_error;
            if excess.is_nan() {
                return None;
            }
            if worst.as_ref().is_none_or(|worst| excess > worst.0) {
                worst = Some((excess, jet));
            }
        }
        worst
    }

    /// Upper bound of the largest constraint.
    pub(super) fn value_upper(&self, v: &Twos) -> f64 {
        let jets = (0..self.posed.len()).map(|i| self.jet(i, v));
        largest(jets.map(|jet| (jet.value + Two::from(jet.value_error)).double().next_up()))
    }

    /// For Newton's matrices, the nearest doubles; and for its residuals the sum of gradients and
    /// the values.
    pub(super) fn at(&self, active: &RefinedActive, v: &Twos) -> (At, Twos, [Two; 3]) {
        let mut at = At::default();
        let (mut sum, mut values) = ([Two::ZERO; 3], [Two::ZERO; 3]);
        for k in 0..active.set.len {
            let jet = self.jet(active.set.index[k], v);
            let multiplier = active.multiplier[k];
            at.gradient[k] = doubles(&jet.gradient);
            at.hessian += jet.hessian * multiplier.double();
            sum = plus(&sum, &times(&jet.gradient, multiplier));
            values[k] = jet.value;
        }
        (at, sum, values)
    }
}

/// Active constraints with multipliers in double-double.
pub(super) struct RefinedActive {
    pub(super) set: Active,
    pub(super) multiplier: [Two; 3],
}

impl RefinedActive {
    pub(super) fn new(set: &Active) -> Self {
        Self { set: *set, multiplier: set.multiplier.map(Two::from) }
    }

    pub(super) fn positive(&self) -> impl Iterator<Item = (usize, Two)> + '_ {
        let all = self.set.index[..self.set.len].iter().copied().zip(self.multiplier);
        all.filter(|(_, multiplier)| multiplier.is_positive())
    }

    pub(super) fn add(&mut self, steps: &[f64], damping: f64) {
        for (k, step) in steps.iter().enumerate() {
            self.multiplier[k] += Two::from(step * damping);
        }
        self.set.multiplier = self.multiplier.map(Two::double);
    }

    /// How far the point that `at` and the values are of is at most from where the constraints are
    /// met that carry more than `least`, multiplier times gradient.
    pub(super) fn gap(&self, at: &At, values: &[Two; 3], least: f64) -> f64 {
        let lengths = at.gradient[..self.set.len].iter().map(Vector3::norm);
        let carried = lengths.zip(&self.multiplier).zip(values);
        let carrying = carried.filter(|((length, multiplier), _)| multiplier.double() * length > least);
        carrying.map(|((length, _), value)| (Two::from(1.0) - *value).double().abs() / length).fold(0.0, f64::max)
    }

    /// Drops constraints as [`Active::drop_negative`] does and takes one that is violated by more
    /// than `excess`; whether any.
    pub(super) fn revise(&mut self, body: &RefinedBody<'_>, v: &Twos, level: f64, excess: f64) -> bool {
        let mut set = self.set;
        let over = |i: usize| (body.jet(i, v).value - Two::from(level)).double();
        let rest = (0..body.posed.len()).filter(|i| set.bits() >> i & 1 == 0).map(|i| (i, over(i)));
        let worst = rest.filter(|(_, over)| *over > excess).max_by(|p, q| p.1.total_cmp(&q.1));
        let changed = set.drop_negative() | worst.is_some_and(|(i, _)| set.push(i));
        if changed {
            *self = Self::new(&set);
        }
        changed
    }
}

/// Value and gradient of a polynomial, term by term.
fn expand(polynomial: &Polynomial, z: &Twos) -> (Two, Twos) {
    let powers: [[Two; 9]; 3] = std::array::from_fn(|i| {
        let mut powers = [Two::from(1.0); 9];
        for k in 0..8 {
            powers[k + 1] = powers[k] * z[i];
        }
        powers
    });
    let (mut value, mut gradient) = (Two::ZERO, [Two::ZERO; 3]);
    for (e, coefficient) in polynomial.terms() {
        let of = |i: usize| powers[i][usize::from(e[i])];
        let pairs = [of(1) * of(2), of(0) * of(2), of(0) * of(1)];
        value += of(0) * pairs[0] * *coefficient;
        for i in (0..3).filter(|&i| e[i] > 0) {
            let once = powers[i][usize::from(e[i] - 1)] * f64::from(e[i]);
            gradient[i] += once * pairs[i] * *coefficient;
        }
    }
    (value, gradient)
}

/// The rotation that a pose stands for: of its quaternion, normalised.
pub(super) fn rotation(pose: &Pose) -> [Twos; 3] {
    let q = pose.rotation().coords;
    let [x, y, z, w] = [q.x, q.y, q.z, q.w].map(Two::from);
    let norm = x * x + y * y + z * z + w * w;
    let two = Two::from(2.0);
    let entry = |value: Two| value / norm;
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    [
        [entry(ww + xx - yy - zz), entry((x * y - w * z) * two), entry((x * z + w * y) * two)],
        [entry((x * y + w * z) * two), entry(ww - xx + yy - zz), entry((y * z - w * x) * two)],
        [entry((x * z - w * y) * two), entry((y * z + w * x) * two), entry(ww - xx - yy + zz)],
    ]
}

/// The rotation that turns nothing.
pub(super) fn identity() -> [Twos; 3] {
    std::array::from_fn(|i| std::array::from_fn(|j| Two::from(f64::from(u8::from(i == j)))))
}
