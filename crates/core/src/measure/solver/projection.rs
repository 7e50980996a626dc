//! Convex programs over one body: the point nearest to a segment or a point, and the point farthest
//! along a direction.
//!
//! They are `min f` over the points y of the body, f half the squared distance from the segment or
//! `-r·y` for the direction r. From the segment with the middle c and the half axis h, its nearest
//! point being `c + s h` with `s = h·(y - c) / |h|²` cut to [-1, 1],
//!
//! ```text
//! ∇f = y - c - s h,   ∇²f = I - h hᵀ / |h|² beside it, I beyond its ends
//! ```
//!
//! The steps are those of sequential quadratic programming,
//!
//! ```text
//! min over d of ½ dᵀ(∇²f + Σ λ_i ∇²g_i) d + ∇f·d   subject to   g_i(y) + ∇g_i(y)·d <= 1
//! ```
//!
//! with the active constraints found by exchange, one at a time, without new evaluations. Where the
//! steps do not settle, an interior-point method does. Brackets are the caller's.

use crate::body::{Body, MAX_CONSTRAINTS};
use crate::measure::bounds::duality_bounds::Multipliers;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::query_frame::Posed;
use crate::measure::solver::active_constraints::{ActiveSet, MAX_ACTIVE};
use crate::measure::solver::equality_program;
use crate::measure::solver::linear_systems::solve;
use crate::measure::solver::stages::{Stage, runs};
use crate::optimize::{Program, Row, Rows, minimise};
use crate::polynomial::{Jet, gamma};
use nalgebra::{Matrix3, Vector3};
use std::ops::ControlFlow;

/// One body in its own query frame: that of the body, moved to the centre of its circumscribed ball
/// and scaled by a power of two near its radius.
pub(in crate::measure) struct Single<'a> {
    pub(in crate::measure) body: Posed<'a>,
    /// Metres per unit of the query frame: a power of two.
    pub(in crate::measure) unit: f64,
    /// Origin of the query frame in the body frame, metres.
    pub(in crate::measure) origin: Vector3<f64>,
    pub(in crate::measure) pose: Pose,
}

impl<'a> Single<'a> {
    pub(in crate::measure) fn new(body: &'a Body, pose: &Pose) -> Self {
        let ball = body.circumscribed();
        let unit = ball.radius.log2().round().exp2();
        Self { body: Posed::own(body, unit), unit, origin: ball.center, pose: *pose }
    }

    /// A world point in the query frame, with a bound of its error.
    pub(in crate::measure) fn to_query(&self, x: &Vector3<f64>) -> (Vector3<f64>, f64) {
        let offset = x - self.pose.translation();
        let point = (self.pose.rotation().inverse_transform_vector(&offset) - self.origin) / self.unit;
        let error = (ROTATION_ERROR + gamma(16)) * offset.norm() + gamma(4) * self.origin.norm();
        (point, error / self.unit * (1.0 + 1e-14))
    }

    pub(in crate::measure) fn to_world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose.transform_point(&self.to_body(v))
    }

    /// Point of the query frame in the body frame, metres.
    pub(in crate::measure) fn to_body(&self, v: &Vector3<f64>) -> Vector3<f64> {
        v * self.unit + self.origin
    }

    /// Inverse of [`Single::to_body`].
    pub(in crate::measure) fn body_to_query(&self, x: &Vector3<f64>) -> Vector3<f64> {
        (x - self.origin) / self.unit
    }

    /// A world direction in the query frame; of the same length within `ROTATION_ERROR`.
    pub(in crate::measure) fn direction_to_query(&self, n: &Vector3<f64>) -> Vector3<f64> {
        self.pose.rotation().inverse_transform_vector(n)
    }

    pub(in crate::measure) fn direction_to_world(&self, n: &Vector3<f64>) -> Vector3<f64> {
        self.pose.transform_direction(n)
    }

    /// Boundary point of the stored table that is best for the objective.
    pub(in crate::measure) fn table(&self, objective: &Objective) -> Vector3<f64> {
        let points = self.body.body.boundary().iter().map(|x| self.body_to_query(x));
        let best = points.map(|y| (objective.value(&y), y)).min_by(|p, q| p.0.total_cmp(&q.0));
        best.map_or(self.body.interior, |(_, y)| y)
    }
}

/// A segment; a point where its half axis is 0.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Segment {
    pub(in crate::measure) center: Vector3<f64>,
    pub(in crate::measure) half_axis: Vector3<f64>,
}

impl Segment {
    /// Where its point nearest to another one is, in half axes from its centre on.
    fn place(&self, y: &Vector3<f64>) -> f64 {
        let square = self.half_axis.norm_squared();
        if square > 0.0 { (self.half_axis.dot(&(y - self.center)) / square).clamp(-1.0, 1.0) } else { 0.0 }
    }

    /// Its point nearest to another one.
    pub(in crate::measure) fn nearest(&self, y: &Vector3<f64>) -> Vector3<f64> {
        self.center + self.half_axis * self.place(y)
    }
}

/// What is minimised.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum Objective {
    /// Half the squared distance from a segment.
    Nearest(Segment),
    /// The negative height along a direction.
    Farthest(Vector3<f64>),
}

impl Objective {
    fn value(&self, y: &Vector3<f64>) -> f64 {
        match self {
            Self::Nearest(segment) => 0.5 * (y - segment.nearest(y)).norm_squared(),
            Self::Farthest(direction) => -direction.dot(y),
        }
    }

    /// The negative gradient.
    fn pull(&self, y: &Vector3<f64>) -> Vector3<f64> {
        match self {
            Self::Nearest(segment) => segment.nearest(y) - y,
            Self::Farthest(direction) => *direction,
        }
    }

    fn hessian(&self, y: &Vector3<f64>) -> Matrix3<f64> {
        match self {
            Self::Nearest(segment) if segment.place(y).abs() < 1.0 => {
                // Of a point, or what is as short as one, there is no axis.
                let axis = segment.half_axis.try_normalize(0.0).unwrap_or_default();
                Matrix3::identity() - axis * axis.transpose()
            }
            Self::Nearest(_) => Matrix3::identity(),
            Self::Farthest(_) => Matrix3::zeros(),
        }
    }
}

/// A trial point with multipliers of all constraints: `Σ λ_i ∇g_i = -∇f` at the solution.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Trial {
    pub(in crate::measure) y: Vector3<f64>,
    pub(in crate::measure) multipliers: Multipliers,
    /// `Σ λ_i ∇g_i(y)`.
    pub(in crate::measure) dual_gradient: Vector3<f64>,
}

/// Most steps of [`solve_single`] before, and after each iterate of, the interior-point method.
const MAX_STEPS: u32 = 12;

/// Brackets are computed after steps, in query units, shorter than this or the root of the width
/// asked for, whichever is longer: brackets are about as wide as the square of the step.
///
/// Larger, brackets are computed that stay wide; smaller, a step more is taken. It changes time
/// only; no test pins it.
const WORTH_A_BRACKET: f64 = 1e-3;

/// A point to begin at, with the constraints that may be active there; none, if nothing is known.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Start {
    pub(in crate::measure) y: Vector3<f64>,
    pub(in crate::measure) active: ActiveSet,
}

/// A minimisation over one body from a start.
#[derive(Clone, Copy)]
pub(in crate::measure) struct SingleProblem<'a> {
    pub(in crate::measure) body: &'a Posed<'a>,
    pub(in crate::measure) objective: &'a Objective,
    pub(in crate::measure) start: Start,
    /// Where to begin again if that leads nowhere, before the interior-point method.
    pub(in crate::measure) other: Option<Start>,
    /// Width of the bracket asked for, query units.
    pub(in crate::measure) narrow: f64,
}

/// What a trial point is worth.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::measure) enum Worth {
    /// All that is asked for.
    Done,
    /// The bracket is as narrow as asked for; a step more makes the point better.
    Narrow,
    /// Not enough.
    Wide,
}

/// Steps that are made after the bracket was narrow first: the error falls as its square, and of
/// flat sides by a share of it.
///
/// With less, normals and witnesses near contact stay off by the root of the bracket's width; more
/// are spent on rounding where the normal cannot be had. Exercised by
/// `family_20_gradients_of_primitives`.
const MORE_STEPS: u32 = 3;

/// Minimises until `judge` has all that it asks for; returns the iterations and the constraints
/// that were active last.
pub(in crate::measure) fn solve_single(
    &SingleProblem { body, objective, start, other, narrow }: &SingleProblem<'_>,
    mut exhausted: impl FnMut(u32) -> bool,
    mut judge: impl FnMut(&Trial) -> Worth,
) -> (u32, ActiveSet) {
    let worth = WORTH_A_BRACKET.max(narrow.sqrt());
    let mut steps = Steps { body, objective, active: 0, worth, narrow: 0 };
    let mut count = 0;
    for Start { y, active } in [Some(start), other].into_iter().flatten() {
        steps.active = active;
        if steps.run(y, &mut count, &mut exhausted, &mut judge) {
            return (count, steps.active);
        }
    }
    if exhausted(count) || !runs(Stage::ProjectionInterior) {
        return (count, steps.active);
    }
    let mut y = body.interior;
    let gap = objective.pull(&y).norm();
    let mut attempt = 1e-1;
    minimise(&Inner { body, objective }, &mut y, gap.max(1e-6), |iterate| {
        count += 1;
        if iterate.gap < attempt * gap {
            attempt = iterate.gap / gap * 1e-2;
            let mut multipliers = [0.0; MAX_CONSTRAINTS];
            multipliers[..body.len()].copy_from_slice(iterate.multipliers);
            let dual_gradient = body.weighted_gradient(iterate.v, &multipliers);
            let done = judge(&Trial { y: *iterate.v, multipliers, dual_gradient }) == Worth::Done;
            steps.active = held(&multipliers);
            if done || steps.run(*iterate.v, &mut count, &mut exhausted, &mut judge) {
                return ControlFlow::Break(());
            }
        }
        if attempt < 1e-18 || exhausted(count) { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    (count, steps.active)
}

/// The constraints that carry the multipliers.
fn held(multipliers: &Multipliers) -> ActiveSet {
    let largest = multipliers.iter().fold(0.0_f64, |most, m| most.max(*m));
    let carries = |i: &usize| multipliers[*i] > 1e-3 * largest;
    (0..MAX_CONSTRAINTS).filter(carries).take(MAX_ACTIVE).fold(0, |bits, i| bits | 1 << i)
}

struct Steps<'a> {
    body: &'a Posed<'a>,
    objective: &'a Objective,
    active: ActiveSet,
    /// Longest step after which a bracket is computed.
    worth: f64,
    /// Trial points since the bracket was narrow.
    narrow: u32,
}

impl Steps<'_> {
    /// Whether the bracket is narrow: as good as it gets, or as `judge` asks for.
    fn run(
        &mut self,
        start: Vector3<f64>,
        count: &mut u32,
        exhausted: &mut impl FnMut(u32) -> bool,
        judge: &mut impl FnMut(&Trial) -> Worth,
    ) -> bool {
        if !runs(Stage::ProjectionSteps) {
            return false;
        }
        let blank = Jet { value: 0.0, gradient: Vector3::zeros(), hessian: Matrix3::zeros() };
        let mut jets = [blank; MAX_CONSTRAINTS];
        let mut y = start;
        let mut multipliers = [0.0; MAX_CONSTRAINTS];
        let mut last = f64::INFINITY;
        for step in 0..=MAX_STEPS {
            for (i, jet) in jets.iter_mut().enumerate().take(self.body.len()) {
                *jet = self.body.jet(i, &y);
            }
            let jets = &jets[..self.body.len()];
            if step > 0 {
                let dual_gradient = jets.iter().zip(&multipliers).map(|(jet, m)| jet.gradient * *m).sum();
                if last < self.worth || step % 4 == 0 {
                    let worth = judge(&Trial { y, multipliers, dual_gradient });
                    self.narrow += u32::from(worth == Worth::Narrow);
                    if worth == Worth::Done || self.narrow > MORE_STEPS {
                        return true;
                    }
                }
                *count += 1;
            } else {
                multipliers = self.first_multipliers(jets, &y);
            }
            if exhausted(*count) {
                return self.narrow > 0;
            }
            let Some((d, found)) = self.step(jets, &y, &multipliers) else { return self.narrow > 0 };
            let length = d.norm();
            // Steps that no longer shrink are rounding.
            if !length.is_finite() || length < 1e-12 && length >= last {
                return self.narrow > 0;
            }
            // Bodies have size 1 here: a longer step leaves where the linearization means anything.
            y += d * (0.5 / length).min(1.0);
            (multipliers, last) = (found, length);
        }
        self.narrow > 0
    }

    /// Multipliers for a start without any: the largest constraint alone, as far as it turns
    /// against the objective.
    fn first_multipliers(&mut self, jets: &[Jet], y: &Vector3<f64>) -> Multipliers {
        let mut multipliers = [0.0; MAX_CONSTRAINTS];
        let aim = self.objective.pull(y);
        let most = (0..jets.len()).max_by(|&i, &j| jets[i].value.total_cmp(&jets[j].value)).unwrap_or(0);
        if self.active == 0 || u32::from(self.active) >> jets.len() != 0 || self.active.count_ones() > MAX_ACTIVE as u32
        {
            self.active = 1 << most;
        }
        let share = aim.norm() / f64::from(self.active.count_ones());
        for (i, jet) in jets.iter().enumerate().filter(|(i, _)| self.active >> i & 1 == 1) {
            multipliers[i] = share / jet.gradient.norm().max(f64::MIN_POSITIVE);
        }
        multipliers
    }

    /// The step and the new multipliers from the quadratic program, exchanging one constraint at a
    /// time.
    fn step(
        &mut self,
        jets: &[Jet],
        y: &Vector3<f64>,
        multipliers: &Multipliers,
    ) -> Option<(Vector3<f64>, Multipliers)> {
        let aim = self.objective.pull(y);
        let mut hessian: Matrix3<f64> = jets.iter().zip(multipliers).map(|(jet, m)| jet.hessian * m.max(0.0)).sum();
        hessian += self.objective.hessian(y);
        // Enough for flat directions to have an answer, too little to slow the others.
        let regularization = 1e-10 * hessian.diagonal().amax().max(1e-3 * aim.norm());
        hessian += Matrix3::identity() * regularization;
        for _ in 0..3 * MAX_ACTIVE {
            let (d, found) = self.equality_step(jets, &hessian, &aim)?;
            let held = |i: &usize| self.active >> i & 1 == 1;
            let negative = (0..jets.len()).filter(held).min_by(|&i, &j| found[i].total_cmp(&found[j]));
            if let Some(i) = negative.filter(|&i| found[i] < 0.0) {
                self.active &= !(1 << i);
                continue;
            }
            let excess = |i: usize| jets[i].value - 1.0 + jets[i].gradient.dot(&d);
            let free = (0..jets.len()).filter(|i| !held(i) && excess(*i) > 1e-12);
            match free.max_by(|&i, &j| excess(i).total_cmp(&excess(j))) {
                Some(i) if self.active.count_ones() < MAX_ACTIVE as u32 => self.active |= 1 << i,
                _ => return Some((d, found)),
            }
        }
        None
    }

    fn equality_step(
        &self,
        jets: &[Jet],
        hessian: &Matrix3<f64>,
        aim: &Vector3<f64>,
    ) -> Option<(Vector3<f64>, Multipliers)> {
        let active = (0..jets.len()).filter(|i| self.active >> i & 1 == 1);
        let length = |i: usize| jets[i].gradient.norm();
        // Multipliers of unit gradients: rows and columns of one size.
        let rows = active.clone().map(|i| (jets[i].gradient / length(i), (1.0 - jets[i].value) / length(i)));
        let (d, found) = equality_program::minimize(hessian, &-aim, rows, solve)?;
        let mut multipliers = [0.0; MAX_CONSTRAINTS];
        active.zip(found).for_each(|(i, multiplier)| multipliers[i] = multiplier / length(i));
        Some((d, multipliers))
    }
}

/// The same program for the interior-point method.
struct Inner<'a> {
    body: &'a Posed<'a>,
    objective: &'a Objective,
}

impl Program<3> for Inner<'_> {
    fn objective(&self, y: &Vector3<f64>) -> (Vector3<f64>, Matrix3<f64>) {
        (-self.objective.pull(y), self.objective.hessian(y))
    }

    fn constraints(&self, y: &Vector3<f64>, rows: &mut Rows<3>) {
        for i in 0..self.body.len() {
            let jet = self.body.jet(i, y);
            rows.push(Row { value: jet.value - 1.0, gradient: jet.gradient, hessian: jet.hessian, block: 0 });
        }
    }
}
