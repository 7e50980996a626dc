//! Newton's method on the optimality system of the distance, for a given set of active constraints.
//!
//! Regular through contact: the unknowns are x, y, the distance D, the normal n and multipliers λ
//! of A, μ of B, with `u = Σ λ_i ∇g_i(x)` and `w = Σ μ_j ∇h_j(y)`:
//!
//! ```text
//! x - y = D n,   n + u = 0,   w - n = 0,   (|n|² - 1) / 2 = 0,   g_i(x) = 1,   h_j(y) = 1   (active i, j)
//! ```
//!
//! The normal is an unknown of its own, although u and w say what it is: those of thin bodies turn
//! so fast with the point that Newton's method diverges by them from where it converges so
//! (Albersmeyer and Diehl, The lifted Newton method and its application in optimization, SIAM J.
//! Optimization 20, 2010).

use crate::measure::bounds::duality_bounds::Multipliers;
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::frames::vector::V3;
use crate::measure::solver::active_constraints::{ActiveConstraints, ActiveSet, MAX_ACTIVE};
use crate::measure::solver::kkt_system::{Curved, DistanceSystem, Residuals};
use crate::measure::solver::linear_systems::solve;
use crate::measure::solver::step_acceleration::{Series, Taken, across, along, tangents};
use crate::measure::solver::tangent_newton::{
    ALIGNED, LONGEST_MOVE, PATIENCE, SEEK_ROUNDS, WORTH_A_BRACKET, aligned_angle,
};
use crate::polynomial::Scalar;
use nalgebra::{Matrix3, Vector3};

/// The active constraints of one body with their multipliers.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Active {
    pub(in crate::measure) index: [usize; MAX_ACTIVE],
    pub(in crate::measure) multiplier: [f64; MAX_ACTIVE],
    pub(in crate::measure) len: usize,
}

impl Active {
    /// The set with these bits, all multipliers zero. None if too many for general position.
    pub(in crate::measure) fn from_bits(bits: ActiveSet, constraints: usize) -> Option<Self> {
        let mut active = Self::default();
        for i in (0..constraints).filter(|i| bits >> i & 1 == 1) {
            if active.len == MAX_ACTIVE {
                return None;
            }
            active.index[active.len] = i;
            active.len += 1;
        }
        Some(active)
    }

    /// The constraints that carry the largest of these multipliers.
    pub(in crate::measure) fn from_multipliers(multipliers: &Multipliers) -> Self {
        let largest = multipliers.iter().fold(0.0_f64, |most, &m| most.max(m));
        let mut active = Self::default();
        while active.len < MAX_ACTIVE {
            let next = (0..multipliers.len())
                .filter(|i| !active.index[..active.len].contains(i))
                .max_by(|&i, &j| multipliers[i].total_cmp(&multipliers[j]));
            match next {
                Some(i) if multipliers[i] > 1e-3 * largest => {
                    active.index[active.len] = i;
                    active.multiplier[active.len] = multipliers[i];
                    active.len += 1;
                }
                _ => break,
            }
        }
        active
    }

    /// The constraints whose multipliers times gradients at v are largest: those of thin bodies
    /// have steep ones.
    pub(in crate::measure) fn from_weighted_multipliers(
        body: &Posed<'_>,
        v: &Vector3<f64>,
        multipliers: &Multipliers,
    ) -> Self {
        let mut weighted = *multipliers;
        let carried = weighted.iter_mut().enumerate().take(body.len()).filter(|(_, residual)| **residual > 0.0);
        carried.for_each(|(i, residual)| *residual *= body.tangent(i, v).1.norm());
        let mut active = Self::from_multipliers(&weighted);
        (0..active.len).for_each(|k| active.multiplier[k] = multipliers[active.index[k]]);
        active
    }

    /// The constraints that a point near the surface is at, as far as they carry a dual gradient
    /// `target`.
    pub(in crate::measure) fn near(body: &Posed<'_>, v: &Vector3<f64>, target: &Vector3<f64>) -> Self {
        let mut values = [f64::NEG_INFINITY; crate::body::MAX_CONSTRAINTS];
        (0..body.len()).for_each(|i| values[i] = body.value(i, v));
        let highest = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let mut active = Self::default();
        while active.len < MAX_ACTIVE {
            let rest = (0..body.len()).filter(|i| !active.index[..active.len].contains(i));
            match rest.max_by(|&i, &j| values[i].total_cmp(&values[j])) {
                Some(i) if values[i] > highest - AT * highest.abs().max(1.0) => _ = active.push(i),
                _ => break,
            }
        }
        while active.len > 1 {
            if !active.fit(body, v, target) {
                // Of dependent gradients the lowest constraint's goes.
                active.len -= 1;
            } else if !active.drop_negative() {
                break;
            }
        }
        active
    }

    /// The only constraint, if there is but one.
    pub(in crate::measure) fn single(&self) -> Option<u8> {
        (self.len == 1).then_some(self.index[0] as u8)
    }

    pub(in crate::measure) fn bits(&self) -> ActiveSet {
        self.index[..self.len].iter().fold(0, |bits, i| bits | 1 << i)
    }

    /// The set for the user, with multipliers times `unit`; those not above zero are left out.
    pub(in crate::measure) fn reported(&self, unit: f64) -> ActiveConstraints {
        let mut reported = ActiveConstraints::default();
        for (index, multiplier) in self.iter().filter(|(_, multiplier)| multiplier * unit > 0.0) {
            reported.push(index, multiplier * unit);
        }
        reported
    }

    /// With multipliers `factor` times as large.
    pub(in crate::measure) fn scaled(mut self, factor: f64) -> Self {
        self.multiplier.iter_mut().for_each(|multiplier| *multiplier *= factor);
        self
    }

    /// Multipliers of all constraints, negative ones cut off.
    pub(in crate::measure) fn multipliers(&self) -> Multipliers {
        let mut all = [0.0; crate::body::MAX_CONSTRAINTS];
        for (i, multiplier) in self.iter() {
            all[i] = multiplier.max(0.0);
        }
        all
    }

    pub(in crate::measure) fn iter(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.index[..self.len].iter().copied().zip(self.multiplier[..self.len].iter().copied())
    }

    pub(in crate::measure) fn push(&mut self, index: usize) -> bool {
        let room = self.len < MAX_ACTIVE;
        if room {
            self.index[self.len] = index;
            self.multiplier[self.len] = 0.0;
            self.len += 1;
        }
        room
    }

    /// Drops the constraint with the most negative multiplier; whether there was one.
    pub(in crate::measure) fn drop_negative(&mut self) -> bool {
        let worst = (0..self.len).min_by(|&i, &j| self.multiplier[i].total_cmp(&self.multiplier[j]));
        match worst {
            Some(k) if self.multiplier[k] < 0.0 && self.len > 1 => {
                self.remove(k);
                true
            }
            _ => false,
        }
    }

    /// Drops the k-th constraint of the set.
    pub(in crate::measure) fn remove(&mut self, k: usize) {
        self.len -= 1;
        self.index.swap(k, self.len);
        self.multiplier.swap(k, self.len);
    }

    /// Adds a share of steps to the multipliers.
    fn add(&mut self, steps: &[f64; MAX_ACTIVE], share: f64) {
        self.multiplier[..self.len].iter_mut().zip(steps).for_each(|(multiplier, step)| *multiplier += step * share);
    }

    /// Least-squares multipliers of `Σ λ_i ∇g_i = target` at v. False if the gradients are
    /// dependent.
    pub(in crate::measure) fn fit(&mut self, body: &Posed<'_>, v: &Vector3<f64>, target: &Vector3<f64>) -> bool {
        let gradients: [Vector3<f64>; MAX_ACTIVE] =
            std::array::from_fn(|k| if k < self.len { body.tangent(self.index[k], v).1 } else { Vector3::zeros() });
        let mut system = [[0.0; MAX_ACTIVE + 1]; MAX_ACTIVE];
        for i in 0..self.len {
            for j in 0..self.len {
                system[i][j] = gradients[i].dot(&gradients[j]);
            }
            system[i][MAX_ACTIVE] = gradients[i].dot(target);
        }
        let Some(solution) = solve(&mut system, self.len) else { return false };
        self.multiplier[..self.len].copy_from_slice(&solution[..self.len]);
        true
    }

    /// How far what the constraints carry at v is from `target`, and how far v is at most from
    /// where those that carry anything are met and none is violated.
    fn misfit(&self, body: &Posed<'_>, v: &Vector3<f64>, target: &Vector3<f64>) -> (f64, f64) {
        let multipliers = self.multipliers();
        let (mut rest, mut gap) = (*target, 0.0_f64);
        for (i, multiplier) in multipliers.iter().enumerate().take(body.len()) {
            let (value, gradient) = body.tangent(i, v);
            let excess = value - 1.0;
            rest -= gradient * *multiplier;
            gap = gap.max(if *multiplier > 0.0 { excess.abs() } else { excess } / gradient.norm());
        }
        (rest.norm(), gap)
    }

    /// The most violated constraint that is not in the set, if violated by more than `excess`.
    pub(in crate::measure) fn violated_by(
        &self,
        excess: f64,
        body: &Posed<'_>,
        v: &Vector3<f64>,
        level: f64,
    ) -> Option<usize> {
        (0..body.len())
            .filter(|i| !self.index[..self.len].contains(i))
            .map(|i| (i, body.value(i, v) - level))
            .filter(|(_, by)| *by > excess)
            .max_by(|p, q| p.1.total_cmp(&q.1))
            .map(|(i, _)| i)
    }
}

/// Values, gradients and weighted sums of the active constraints of one body at one point.
#[derive(Default)]
pub(in crate::measure) struct At {
    pub(in crate::measure) value: [f64; MAX_ACTIVE],
    pub(in crate::measure) gradient: [Vector3<f64>; MAX_ACTIVE],
    pub(in crate::measure) sum: Vector3<f64>,
    pub(in crate::measure) hessian: Matrix3<f64>,
}

impl At {
    pub(in crate::measure) fn new(body: &Posed<'_>, active: &Active, v: &Vector3<f64>) -> Self {
        let mut at = Self::default();
        for (k, (i, multiplier)) in active.iter().enumerate() {
            let jet = body.jet(i, v);
            at.value[k] = jet.value;
            at.gradient[k] = jet.gradient;
            at.sum += jet.gradient * multiplier;
            at.hessian += jet.hessian * multiplier;
        }
        at
    }

    /// What Newton's matrix is made of, of so many active constraints.
    pub(in crate::measure) fn curved(&self, len: usize) -> Curved<'_> {
        Curved { gradients: &self.gradient[..len], hessian: &self.hessian }
    }
}

/// How far below the highest value of a constraint another one may be that counts as active at a
/// start, relative to that or to 1; dimensionless.
///
/// Larger, systems have constraints that they drop again, each for a step; smaller, edges are
/// missed at first. `support_tables_start_newton` counts what is solved.
pub(in crate::measure) const AT: f64 = 0.1;

/// By how much an inactive constraint may be violated, relative to its level; dimensionless. Values
/// round at 1e-15.
///
/// Larger, witnesses lie outside by more than brackets allow; smaller, rounding exchanges
/// constraints without end. Exercised by `active_sets_follow_alone`.
pub(in crate::measure) const VIOLATED: f64 = 1e-10;

/// Rounding of a value of a constraint, relative to 1; dimensionless: some ten roundings.
///
/// Smaller, refinement never accepts an answer near contact; larger, normals near contact are
/// accepted that are off. Exercised by `alignment_turns_normals`.
const ROUNDED: f64 = 8.0 * f64::EPSILON;

/// Length of a step along which there is no curvature, relative to the bodies and before it is cut,
/// dimensionless: the regularization is the residual divided by this.
///
/// Larger, systems of flat sides are singular to rounding; smaller, the regularization slows steps
/// where there is curvature. Exercised by `boxes_meet_face_edge_and_corner`.
const FARTHEST: f64 = 1e3;

/// Whether Newton's steps still shrink: fast near a solution, and those that do not are not near
/// one.
pub(in crate::measure) struct StepMonitor {
    last: f64,
    /// How often a short step was hardly shorter than the one before.
    stuck: u32,
}

impl StepMonitor {
    /// Of steps towards a system that none has been taken towards yet.
    pub(in crate::measure) fn new() -> Self {
        Self { last: f64::INFINITY, stuck: 0 }
    }

    /// Whether the steps, this one of this length the last, are still cut to the longest when they
    /// should no longer be: two in a row, or the first towards a new system. A single long one is
    /// taken where sides are flat, once it shows how far they reach.
    pub(in crate::measure) fn has_diverged(&self, step: u32, length: f64, longest: f64) -> bool {
        step >= PATIENCE && length.min(self.last) > longest
    }

    /// Whether no step is worth taking after one of this length, relative to the bodies.
    pub(in crate::measure) fn ends_with(&mut self, length: f64) -> bool {
        self.stuck += u32::from(length < WORTH_A_BRACKET && length > 0.9 * self.last);
        self.last = length;
        self.stuck == 2 || length < 1e-14
    }
}

/// Newton iterates of the distance system.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct DistanceNewton {
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
    pub(in crate::measure) distance: f64,
    /// Direction from B to A; of length about 1.
    pub(in crate::measure) n: Vector3<f64>,
    pub(in crate::measure) a: Active,
    pub(in crate::measure) b: Active,
}

impl DistanceNewton {
    /// Iterates until `accept` takes one, they stop converging or the limit is reached; returns the
    /// steps taken.
    pub(in crate::measure) fn run(
        &mut self,
        pair: &Pair<'_>,
        limit: u32,
        mut accept: impl FnMut(&Self) -> bool,
    ) -> u32 {
        let n = self.n;
        if self.a.len == 0 || self.b.len == 0 || !self.a.fit(&pair.a, &self.x, &-n) || !self.b.fit(&pair.b, &self.y, &n)
        {
            return 0;
        }
        let mut at = self.evaluate(pair);
        let (mut monitor, mut series, mut turned) = (StepMonitor::new(), Series::default(), false);
        let limit = SEEK_ROUNDS.min(limit);
        for step in 1..=limit {
            let before = (self.x, self.y);
            let Some(length) = self.step(pair, &at, &mut series) else {
                // Where both are flat the system is singular, but the point at hand with its
                // multipliers may do.
                accept(self);
                return step;
            };
            let moved = (self.x - before.0).norm() + (self.y - before.1).norm();
            // Where points have about arrived only the normal has to turn.
            if !turned && length > LONGEST_MOVE && moved < 0.1 * (self.x - self.y).norm() {
                self.turn(pair);
                turned = true;
            }
            at = self.evaluate(pair);
            // A long step has not converged: its bracket is not worth its cost, but for flat bodies
            // now and then.
            if (length < WORTH_A_BRACKET || step % 4 == 0 || step == limit) && accept(self) {
                return step;
            }
            if length < WORTH_A_BRACKET || step % 4 == 0 {
                let excess = self.negligible(pair);
                let changed = self.a.drop_negative()
                    | self.b.drop_negative()
                    | self.a.violated_by(excess, &pair.a, &self.x, 1.0).is_some_and(|i| self.a.push(i))
                    | self.b.violated_by(excess, &pair.b, &self.y, 1.0).is_some_and(|i| self.b.push(i));
                if changed {
                    (at, monitor, series, turned) = (self.evaluate(pair), StepMonitor::new(), Series::default(), false);
                    continue;
                }
            }
            if monitor.has_diverged(step, length, LONGEST_MOVE) || monitor.ends_with(length) {
                return step;
            }
        }
        limit
    }

    /// Whether the normal is that of the solution, to [`aligned_angle`] or to what rounding leaves
    /// of so short a distance. The narrowest of brackets determines it to about the root of its
    /// width relative to the distance; the equations determine it fully: n is along x - y and what the
    /// constraints of each body carry, none of them is violated, and those with a multiplier above
    /// 0 are met with equality.
    pub(in crate::measure) fn is_aligned(&self, pair: &Pair<'_>) -> bool {
        let angle = aligned_angle(&[pair.a.body, pair.b.body]);
        let (n, apart) = (self.n.normalize(), self.x - self.y);
        let (turned_a, gap_a) = self.a.misfit(&pair.a, &self.x, &-n);
        let (turned_b, gap_b) = self.b.misfit(&pair.b, &self.y, &n);
        let across = (apart - n * n.dot(&apart)).norm();
        let enough = (angle * apart.norm()).max(ROUNDED * pair.size());
        turned_a <= angle && turned_b <= angle && across + gap_a + gap_b <= enough
    }

    /// Turns the normal along x - y: of corners and edges that hold both points where they are it
    /// is off by long steps still.
    fn turn(&mut self, pair: &Pair<'_>) {
        let apart = self.x - self.y;
        let distance = apart.norm().copysign(self.n.dot(&apart));
        let (n, mut a, mut b) = (apart / distance, self.a, self.b);
        if a.fit(&pair.a, &self.x, &-n) && b.fit(&pair.b, &self.y, &n) {
            *self = Self { distance, n, a, b, ..*self };
        }
    }

    /// By how much a constraint may be violated that is not active: far below the distance, or it
    /// decides the normal.
    fn negligible(&self, pair: &Pair<'_>) -> f64 {
        (0.1 * ALIGNED * self.distance.abs() / pair.size()).clamp(ROUNDED, VIOLATED)
    }

    /// Both bodies at the current iterate.
    fn evaluate(&self, pair: &Pair<'_>) -> (At, At) {
        (At::new(&pair.a, &self.a, &self.x), At::new(&pair.b, &self.b, &self.y))
    }

    /// The curvature by which residuals along the tangents alone lead [`FARTHEST`]. Added to what
    /// there is it vanishes with them, which leaves Newton's method as fast as it is.
    fn stiffness(pair: &Pair<'_>, tangents: [V3<f64>; 2], residual: &Vector3<f64>) -> f64 {
        let residual = across(Scalar, tangents, along(Scalar, tangents, (*residual).into())).into();
        pair.a.relative_length(&residual).max(pair.b.relative_length(&residual)) / FARTHEST
    }

    /// One Newton step; its length relative to the bodies, or none if the system is singular.
    fn step(&mut self, pair: &Pair<'_>, (a, b): &(At, At), series: &mut Series) -> Option<f64> {
        let (curved_a, curved_b) = (a.curved(self.a.len), b.curved(self.b.len));
        let balance = a.sum + b.sum;
        let free = tangents(curved_a.gradients, curved_b.gradients);
        // Where a corrected step has led there may be no curvature at all.
        let stiff = free.filter(|_| series.is_corrected());
        let stiffness = stiff.map_or(0.0, |free| Self::stiffness(pair, free, &balance));
        let system = DistanceSystem { a: curved_a, b: curved_b, distance: self.distance, n: self.n, stiffness };
        let residuals = Residuals {
            offset: self.x - self.y + a.sum * self.distance,
            normal: self.n + a.sum,
            balance,
            length: 0.5 * (self.n.norm_squared() - 1.0),
            of_a: a.value.map(|value| value - 1.0),
            of_b: b.value.map(|value| value - 1.0),
        };
        let step = system.step(&residuals, solve)?;
        let bent = a.hessian + b.hessian;
        // A longer step leaves where the linearization means anything.
        let Taken { more, share: damping, length } =
            series.take(free, &step.x, (&-balance, &bent), LONGEST_MOVE, |more| {
                pair.a.relative_length(&(step.x + more)).max(pair.b.relative_length(&(step.y + more)))
            });
        let dn = step.n - a.hessian * more;
        self.x += (step.x + more) * damping;
        self.y += (step.y + more) * damping;
        self.n += dn * damping;
        self.distance += step.distance * damping;
        self.a.add(&step.of_a, damping);
        self.b.add(&step.of_b, damping);
        Some(length.max(dn.norm()))
    }
}
