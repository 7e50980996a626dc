//! What a search has found: the answer, and hints for the next query.

use super::Search;
use crate::measure::distance::answer::Distance;
use crate::measure::frames::query_frame::Posed;
use crate::measure::solver::continuation::Trace;
use crate::measure::solver::kkt_newton::Active;
use crate::measure::status::Status;
use crate::measure::warm::Hint;
use nalgebra::Vector3;

impl Search<'_> {
    pub(in crate::measure::distance) fn iterations(&self) -> u32 {
        self.iterations
    }

    /// The nearest point of B and the constraints that are active there; on overlap a common point,
    /// and none.
    pub(in crate::measure::distance) fn nearest(&self) -> (Vector3<f64>, Option<(Active, Active)>) {
        (self.y, (self.upper > 0.0).then_some(self.active))
    }

    pub(in crate::measure::distance) fn hint(&self) -> Hint {
        if self.upper == 0.0 {
            Hint::Overlap { point_a: self.pair.to_a(&self.x) }
        } else if let Some(trace) = self.trace() {
            Hint::Smooth(trace)
        } else {
            Hint::apart(self.pair, [&self.x, &self.y, &self.n], &self.active)
        }
    }

    /// The answer as a start for continuation, if one constraint of each body is active.
    pub(super) fn trace(&self) -> Option<Trace> {
        if self.trace.is_some() {
            return self.trace;
        }
        let active = [self.active.0.single()?, self.active.1.single()?];
        let (pair, (pose_a, pose_b)) = (self.pair, self.pair.poses());
        let places = [self.centered(&self.x), self.centered(&self.y), self.n.into()];
        Some(Trace::of_distance((pair.a.body, pose_a), (pair.b.body, pose_b), places, active))
    }

    pub(in crate::measure::distance) fn answer(&self) -> Distance {
        let unit = self.pair.unit();
        let witness_a = self.pair.to_world(&self.x);
        let (witness_b, normal) = if self.upper == 0.0 {
            (witness_a, None)
        } else {
            let n = if self.lower > 0.0 { self.n } else { self.between_normals() };
            let n = n.try_normalize(0.0).map(|n| self.pair.direction_to_world(&n));
            (self.pair.to_world(&self.y), n)
        };
        Distance {
            status: Status::of(self.narrow()),
            lower: self.lower * unit,
            upper: self.upper * unit,
            witness_a,
            witness_b,
            normal,
            active_a: self.active.0.reported(if normal.is_some() { unit } else { 0.0 }),
            active_b: self.active.1.reported(if normal.is_some() { unit } else { 0.0 }),
            parts: [0, 0],
            tied: false,
            iterations: self.iterations,
        }
    }

    /// Halfway between the outward normal of B and the inward one of A at the witnesses: what the
    /// normal is where no lower bound has proven one.
    pub(super) fn between_normals(&self) -> Vector3<f64> {
        let outward = |body: &Posed<'_>, v: &Vector3<f64>| {
            let jets = (0..body.len()).map(|i| body.jet(i, v));
            let highest = jets.max_by(|p, q| p.value.total_cmp(&q.value));
            highest.and_then(|jet| jet.gradient.try_normalize(0.0)).unwrap_or_default()
        };
        outward(&self.pair.b, &self.y) - outward(&self.pair.a, &self.x)
    }
}
