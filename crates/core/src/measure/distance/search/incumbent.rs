//! The best bracket so far, what narrows it, and when it is narrow enough.

use super::Search;
use crate::measure::bounds::duality_bounds::{DualTrial, Multipliers, distance_lower, distance_upper};
use crate::measure::frames::vector::V3;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::continuation::Proven;
use crate::measure::solver::edge_newton::EdgeProven;
use crate::measure::solver::kkt_newton::{Active, DistanceNewton};
use crate::measure::solver::stages::{Stage, runs};
use nalgebra::Vector3;

/// Distance relative to the larger body, dimensionless, below which contact depends on how poses
/// are rounded: positions round at 1e-16 of it.
///
/// A larger value reports near misses without the normal of their solution; a smaller one refines
/// distances that no pose can resolve. Exercised by
/// `near_contact_distances_shrink_by_what_is_moved`.
const CONTACT: f64 = 1e-18;

impl Search<'_> {
    /// Whether the bracket is as narrow as asked for.
    pub(super) fn narrow(&self) -> bool {
        self.upper.is_finite() && self.upper - self.lower <= self.tolerance
    }

    /// Whether nothing is missing but the normal of the solution. Of bodies nearer than what is
    /// asked for contact is as good an answer.
    pub(super) fn has_to_be_aligned(&self) -> bool {
        let decided = self.goals.1.met(self.lower, self.upper) || !self.goals.0.wants_answer();
        self.narrow() && self.lower > 0.0 && self.upper > self.tolerance && !self.aligned && !decided
    }

    pub(super) fn done(&self) -> bool {
        self.narrow() || self.goals.1.met(self.lower, self.upper)
    }

    /// Whether the bracket is narrow enough and says on which side of contact the bodies are.
    pub(in crate::measure::distance) fn decided(&self) -> bool {
        self.done() && (self.lower > 0.0 || self.upper == 0.0)
    }

    /// Whether the distance is too short for any pose of doubles to tell it from contact.
    pub(super) fn touching(&self) -> bool {
        self.narrow() && self.upper <= CONTACT * self.pair.size()
    }

    /// Whether the bracket is narrow enough or no more may be done.
    pub(super) fn ended(&self) -> bool {
        self.done() || self.options.exhausted(self.iterations)
    }

    /// A point in A's frame from its normalization's centre on, metres.
    pub(super) fn centered(&self, v: &Vector3<f64>) -> [f64; 3] {
        (self.pair.to_a(v) - self.pair.a.body.normalization().center).into()
    }

    pub(super) fn newton(&mut self, x: Vector3<f64>, y: Vector3<f64>, n: Vector3<f64>, a: Active, b: Active) {
        if !runs(Stage::Newton) || ![x, y, n].iter().all(|v| v.iter().all(|value| value.is_finite())) {
            return;
        }
        let distance = n.dot(&(x - y)).max(0.0);
        let mut newton = DistanceNewton { x, y, distance, n, a, b };
        let left = self.options.after(self.iterations).max_iterations();
        let steps = newton.run(self.pair, left, |at| {
            // Stationary in an overlap.
            if at.distance <= 0.0 {
                return self.common(&((at.x + at.y) * 0.5));
            }
            let (of_a, of_b) = (at.a.multipliers(), at.b.multipliers());
            let trial = DualTrial { x: &at.x, y: &at.y, n: &at.n, of_a: &of_a, of_b: &of_b };
            let lower = distance_lower(self.pair, &trial);
            let raised = self.raise(lower, &at.n);
            if raised {
                self.tried[0] = Some(*at);
            }
            if raised | self.attain(&at.x, &at.y) {
                self.active = (at.a, at.b);
            }
            let ended = if self.has_to_be_aligned() { self.adopt(at) } else { self.done() };
            ended || self.options.stopped()
        });
        self.iterations += steps;
        self.tried[1] = Some(newton);
    }

    /// Takes the points and the normal of an iterate if that is the one of the solution, and the
    /// bracket stays narrow; whether it is.
    pub(super) fn adopt(&mut self, at: &DistanceNewton) -> bool {
        let pair = self.pair;
        if !at.is_aligned(pair) {
            return false;
        }
        let (Some(x), Some(y)) = (pair.a.move_inside(&at.x), pair.b.move_inside(&at.y)) else { return false };
        self.align_with(distance_upper(pair, &x, &y), [x, y, at.n], (at.a, at.b))
    }

    pub(super) fn align_with(&mut self, upper: f64, [x, y, n]: [Vector3<f64>; 3], active: (Active, Active)) -> bool {
        let narrow = upper - self.lower <= self.tolerance;
        if narrow {
            (self.upper, self.x, self.y, self.n, self.active, self.aligned) = (upper, x, y, n, active, true);
        }
        narrow
    }

    /// Improves the lower bound with multipliers for unit normals, trying each body's idea of the
    /// normal.
    pub(super) fn bound(&mut self, x: &Vector3<f64>, y: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let (u, w) = (self.pair.a.weighted_gradient(x, of_a), self.pair.b.weighted_gradient(y, of_b));
        let (lu, lw) = (u.norm(), w.norm());
        if !(lu > 0.0 && lw > 0.0) {
            return;
        }
        let (of_a, of_b) = (of_a.map(|m| m / lu), of_b.map(|m| m / lw));
        for n in [-u / lu, w / lw] {
            let trial = DualTrial { x, y, n: &n, of_a: &of_a, of_b: &of_b };
            if self.raise(distance_lower(self.pair, &trial), &n) {
                let (a, b) = (
                    Active::from_weighted_multipliers(&self.pair.a, x, &of_a),
                    Active::from_weighted_multipliers(&self.pair.b, y, &of_b),
                );
                self.tried[0] = Some(DistanceNewton { x: *x, y: *y, distance: n.dot(&(x - y)), n, a, b });
            }
        }
    }

    /// Takes a lower bound and its normal if it is the best so far.
    pub(super) fn raise(&mut self, lower: f64, n: &Vector3<f64>) -> bool {
        let better = lower > self.lower;
        if better {
            (self.lower, self.n, self.aligned) = (lower, *n, false);
        }
        better
    }

    /// Pulls trial points into their bodies and takes them if they are the closest so far.
    pub(super) fn attain(&mut self, x: &Vector3<f64>, y: &Vector3<f64>) -> bool {
        let (Some(x), Some(y)) = (self.pair.a.move_inside(x), self.pair.b.move_inside(y)) else { return false };
        self.take(distance_upper(self.pair, &x, &y), x, y)
    }

    /// Takes an upper bound and the points that attain it if it is the best so far.
    pub(super) fn take(&mut self, upper: f64, x: Vector3<f64>, y: Vector3<f64>) -> bool {
        let better = upper < self.upper;
        if better {
            (self.upper, self.x, self.y, self.aligned) = (upper, x, y, false);
        }
        better
    }

    /// Whether v is proven to lie in both bodies; if so the answer is 0.
    pub(in crate::measure::distance) fn common(&mut self, v: &Vector3<f64>) -> bool {
        let both = self.pair.common(v);
        if both {
            (self.lower, self.upper, self.x, self.y) = (0.0, 0.0, *v, *v);
        }
        both
    }

    /// Takes what is better in the bracket of continuation, and where that ended as a start.
    pub(in crate::measure::distance) fn resume(&mut self, proven: &Proven) {
        let active = [0, 1].map(|i| ActiveConstraints::single(proven.active[i], proven.multipliers[i]));
        self.resume_at((proven.lower, proven.upper), [proven.x, proven.y, proven.n], active);
    }

    /// The same of bodies with several constraints.
    pub(in crate::measure::distance) fn resume_edges(&mut self, proven: &EdgeProven) {
        let active = [proven.active_a, proven.active_b];
        self.resume_at((proven.lower, proven.upper), [proven.x, proven.y, proven.n], active);
    }

    /// Bounds, points from the centre of A's normalization on, and multipliers in metres.
    fn resume_at(&mut self, (lower, upper): (f64, f64), [x, y, n]: [V3<f64>; 3], active: [ActiveConstraints; 2]) {
        let pair = self.pair;
        let (unit, center) = (pair.unit(), pair.a.body.normalization().center);
        let to_query = |v: V3<f64>| pair.a_to_query(&(center + Vector3::from(v)));
        let [a, b] = active.map(|constraints| {
            let mut active = Active::default();
            for (k, (index, multiplier)) in constraints.iter().enumerate() {
                active.push(index);
                active.multiplier[k] = multiplier / unit;
            }
            active
        });
        let (x, y, n) = (to_query(x), to_query(y), Vector3::from(n));
        let raised = self.raise(lower / unit, &n);
        if raised | self.take(upper / unit, x, y) {
            self.active = (a, b);
        }
        self.tried[0] = Some(DistanceNewton { x, y, distance: n.dot(&(x - y)), n, a, b });
    }
}
