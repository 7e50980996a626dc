//! The interior-point methods, for the distance and for the point deepest in both bodies.

use super::Search;
use crate::measure::bounds::duality_bounds::Multipliers;
use crate::measure::distance::deepest::Deepest;
use crate::measure::solver::barrier_programs::{Closest, Level, points, split};
use crate::measure::solver::kkt_newton::{Active, StepMonitor};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::tangent_newton::{SEEK_ROUNDS, WORTH_A_BRACKET};
use crate::optimize::minimise;
use nalgebra::{SVector, Vector3};
use std::ops::ControlFlow;

impl Search<'_> {
    /// Interior-point method on ½|x - y|², with Newton's method tried as soon as it shows the
    /// active constraints; ends at distances below `near` times the size.
    pub(super) fn closest(&mut self, near: f64) {
        if !runs(Stage::InteriorDistance) {
            return;
        }
        let (start_x, start_y) = (self.pair.a.interior, self.pair.b.interior);
        let mut v = SVector::<f64, 6>::zeros();
        v.fixed_rows_mut::<3>(0).copy_from(&start_x);
        v.fixed_rows_mut::<3>(3).copy_from(&start_y);
        if self.common(&((start_x + start_y) * 0.5)) {
            return;
        }
        self.attain(&start_x, &start_y);
        if self.done() {
            return;
        }
        let first = 0.5 * (start_x - start_y).norm_squared();
        let near = near * self.pair.size();
        let mut attempt = 1e-1;
        minimise(&Closest(self.pair), &mut v, first.max(1e-6), |iterate| {
            self.iterations += 1;
            let (x, y) = points(iterate.v);
            let apart = (x - y).norm();
            let value = 0.5 * apart * apart;
            // A midpoint inside both settles overlaps within the first steps.
            if apart < self.pair.size() && self.common(&((x + y) * 0.5)) {
                return ControlFlow::Break(());
            }
            // Early iterates, still outside the bodies, may meet by chance.
            if apart < near && iterate.gap < near {
                self.attain(&x, &y);
                return ControlFlow::Break(());
            }
            if iterate.gap < attempt * value {
                attempt = (iterate.gap / value) * 1e-2;
                let (of_a, of_b) = split(self.pair, iterate.multipliers, 1.0 / apart);
                let n = (x - y) / apart;
                self.bound(&x, &y, &of_a, &of_b);
                self.attain(&x, &y);
                if !self.done() {
                    self.newton(x, y, n, Active::from_multipliers(&of_a), Active::from_multipliers(&of_b));
                }
                if self.done() || attempt < 1e-18 {
                    return ControlFlow::Break(());
                }
            }
            if self.options.exhausted(self.iterations) {
                // What is known by now is the answer.
                self.attain(&x, &y);
                return ControlFlow::Break(());
            }
            ControlFlow::Continue(())
        });
    }

    /// The point deepest in both bodies, by Newton's method from a point and a normal.
    pub(super) fn deepest(&mut self, v: &Vector3<f64>, n: &Vector3<f64>) {
        if !runs(Stage::Deepest) {
            return;
        }
        let pair = self.pair;
        let (a, b) = (Active::near(&pair.a, v, &-n), Active::near(&pair.b, v, n));
        let mut deepest = Deepest::new(*v, self.depth(v), a, b);
        let mut monitor = StepMonitor::new();
        for _ in 0..SEEK_ROUNDS {
            if self.options.exhausted(self.iterations) {
                return;
            }
            self.iterations += 1;
            let Some(length) = deepest.step(pair) else { return };
            if deepest.s < 1.0 && self.common(&deepest.x) {
                return;
            }
            if monitor.ends_with(length) || length < WORTH_A_BRACKET && deepest.s > 1.0 {
                self.part(&deepest.x, &deepest.a.multipliers(), &deepest.b.multipliers());
                return;
            }
        }
    }

    /// Newton's method for the distance from a point between both bodies, with multipliers of the
    /// constraints that are largest there.
    pub(super) fn part(&mut self, v: &Vector3<f64>, of_a: &Multipliers, of_b: &Multipliers) {
        let pair = self.pair;
        let (u, w) = (pair.a.weighted_gradient(v, of_a), pair.b.weighted_gradient(v, of_b));
        if !(u.norm() > 0.0 && w.norm() > 0.0) {
            return;
        }
        let n = (w / w.norm() - u / u.norm()).try_normalize(0.0).unwrap_or(self.n);
        let (x, y) = (pair.a.enter(v, &n), pair.b.enter(v, &-n));
        self.bound(v, v, of_a, of_b);
        self.attain(&x, &y);
        if !self.done() {
            self.newton(x, y, n, Active::from_multipliers(of_a), Active::from_multipliers(of_b));
        }
    }

    /// The largest constraint of both bodies.
    pub(super) fn depth(&self, v: &Vector3<f64>) -> f64 {
        let pair = self.pair;
        let values = (0..pair.a.len()).map(|i| pair.a.value(i, v));
        values.chain((0..pair.b.len()).map(|i| pair.b.value(i, v))).fold(f64::MIN, f64::max)
    }

    /// The point deepest in both bodies, by the interior-point method: inside both, it proves
    /// overlap; else its multipliers show the normal.
    pub(super) fn contact(&mut self) {
        if !runs(Stage::InteriorLevel) {
            return;
        }
        let pair = self.pair;
        // Far outside a small body its values would hide all else, and a witness is a better start.
        let starts = [(self.x + self.y) * 0.5, self.x, self.y].map(|v| (self.depth(&v), v));
        let (least, start) = starts.into_iter().min_by(|p, q| p.0.total_cmp(&q.0)).unwrap_or(starts[0]);
        let mut v = SVector::from([start.x, start.y, start.z, least + 0.5]);
        let mut attempt = 1e-1;
        let program = Level { pair, both: true, scale: 1.0 };
        minimise(&program, &mut v, 1.0, |iterate| {
            self.iterations += 1;
            let x = iterate.v.xyz();
            if iterate.v[3] < 1.0 && self.common(&x) {
                return ControlFlow::Break(());
            }
            if iterate.gap < attempt {
                attempt = iterate.gap * 1e-2;
                let (of_a, of_b) = split(pair, iterate.multipliers, 1.0);
                self.part(&x, &of_a, &of_b);
            }
            let ended = self.decided() || attempt < 1e-18 || self.options.exhausted(self.iterations);
            if ended { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        });
    }
}
