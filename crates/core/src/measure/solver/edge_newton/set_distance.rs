//! The distance of a body of several constraints from a set with a closed form, inside a proven
//! bracket.
//!
//! The body alone is linearized. With the unit normal n and the curvature K of the set's offset
//! surface through x, a step dx that minimises the distance to second order solves
//!
//! ```text
//! min n·dx + ½ dxᵀ (T K Tᵀ + Σ λ_i H_i) dx   over   (g_i(x) - 1) m_i + ∇g_i·dx <= 0
//! ```
//!
//! with the multipliers λ of the step before, and the constraints straightened by the mean m of
//! their value and 1. Where it leads to another feature of the set, n and K are those of the wrong
//! one: the program is solved again with the distance expanded where the step leads, `n'·dx + ½ (dx
//! - e)ᵀ T'K'T'ᵀ (dx - e)` with the step e before, and without an evaluation of the constraints.
//! Proofs are those of [`super`], with the set's support function in place of a second body.

use super::aggregate::{Evaluated, Weighted};
use super::distance::{FLATTEST, VIOLATED, tangent_of_angle};
use super::linearized::Linearized;
use super::quadratic_program::minimize;
use super::share_inside::share_inside;
use super::spot::Spot;
use crate::body::{Body, ClosedForm, ExactShape};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, dot, scaled, subtract,
};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::exact_shape::{
    Cuboid, Cylinder, Offset, Projectable, Segment, SeparatingPlane, cold_start, seen_from, separating_plane,
};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{
    ALIGNED_AT_EDGES, AT_REST_SQUARED, FEATURES, LONGEST_MOVE, LONGEST_STEP, PATIENCE, RETREATS, Relative, SEEK_ROUNDS,
    Side, TAYLOR_ROUNDING, WORTH_A_BRACKET, moved,
};
use crate::polynomial::{Simd, WithSimd};
use nalgebra::Vector3;

/// Gap where the last start is not tried, in parts of the body's reach: [`Stage::Edges`] answers.
///
/// Larger, bodies that are apart take a slower method; smaller, the last start fails in vain near
/// contact. It changes time only; no test pins it.
const NO_LAST_START: f64 = 0.05;

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct EdgeShapeTrace {
    spot: Spot,
    /// What the first step from there missed last time, body frame, metres.
    missed: V3<f64>,
}

/// Where Newton's method starts.
#[derive(Clone, Copy)]
pub(in crate::measure) enum EdgeShapeStart<'a> {
    /// From the poses alone.
    Cold,
    /// From the answer before.
    Last(&'a EdgeShapeTrace),
    /// From about the nearest point of the body, body frame, metres.
    Witness(Vector3<f64>),
}

/// A body of several constraints against one with a closed form, of capsules against their axes; as
/// vectorized work.
pub(in crate::measure) struct EdgeShapeQuery<'a> {
    pub(in crate::measure) body: &'a Body,
    pub(in crate::measure) pose: &'a Pose,
    pub(in crate::measure) form: &'a ClosedForm,
    /// Of the body with the closed form.
    pub(in crate::measure) form_pose: &'a Pose,
    pub(in crate::measure) goal: &'a StopCriterion,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    pub(in crate::measure) options: &'a Options<'a>,
    pub(in crate::measure) start: EdgeShapeStart<'a>,
}

/// A proven bracket, metres, and where it is attained, in the frame of the shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct EdgeShapeProven {
    pub(in crate::measure) lower: f64,
    /// 0 where a common point is known.
    pub(in crate::measure) upper: f64,
    /// Point of the body.
    pub(in crate::measure) x: V3<f64>,
    /// Point of the set.
    pub(in crate::measure) nearest: V3<f64>,
    /// Unit normal from the set to the body.
    pub(in crate::measure) n: V3<f64>,
    /// Constraints of the body.
    pub(in crate::measure) active: ActiveConstraints,
    /// Evaluations of the body.
    pub(in crate::measure) rounds: u32,
    /// None of a common point.
    pub(in crate::measure) trace: Option<EdgeShapeTrace>,
}

impl WithSimd for EdgeShapeQuery<'_> {
    /// The answer, or after how many evaluations there is none.
    type Output = Result<EdgeShapeProven, u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        if !runs(Stage::EdgesBesideShape) {
            return Err(0);
        }
        match *self.form.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => self.against(simd, Cuboid { half_extents: half_extents_m }),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                self.against(simd, Cylinder { radius: radius_m, half_height: half_height_m })
            }
            ExactShape::Capsule { half_length_m, .. } => self.against(simd, Segment { half_length: half_length_m }),
        }
    }
}

impl EdgeShapeQuery<'_> {
    #[inline(always)]
    fn against<S: Simd, P: Projectable>(self, simd: S, set: P) -> Result<EdgeShapeProven, u32> {
        let Self { body, pose, form, form_pose, goal, tolerance, options, start } = self;
        let relative = seen_from(simd, form, form_pose, body, pose);
        let side = Side::away(simd, body, 0, &relative);
        let displacement = form.displacement_m();
        let pair = EdgeShapePair { side, relative: &relative, set, displacement, goal, tolerance, options };
        pair.solve(simd, start)
    }
}

/// A body and a set, in the frame of the set.
struct EdgeShapePair<'a, P> {
    side: Side<'a, f64>,
    relative: &'a Relative<f64>,
    set: P,
    displacement: f64,
    goal: &'a StopCriterion,
    tolerance: f64,
    options: &'a Options<'a>,
}

/// A trial point, the set as seen from there, and the multipliers of the active constraints,
/// metres.
struct Iterate {
    x: V3<f64>,
    seen: Offset,
    active: Weighted,
}

/// Why a start leads to no answer.
enum Lost {
    /// Rounding keeps the bracket wide where no step is left to take.
    Wide,
    /// Another one may.
    Elsewhere,
}

/// A step along the tangents and the normal where it starts, and where it leads.
struct Found {
    step: V3<f64>,
    next: Offset,
    active: Weighted,
}

impl<P: Projectable> EdgeShapePair<'_, P> {
    #[inline(always)]
    fn solve<S: Simd>(&self, simd: S, start: EdgeShapeStart<'_>) -> Result<EdgeShapeProven, u32> {
        let mut rounds = 0;
        if let EdgeShapeStart::Last(trace) = start
            && let Some((at, predicted)) = self.follow(simd, trace)
        {
            match self.run(simd, at, &mut rounds) {
                Ok(mut proven) => {
                    if let Some(trace) = &mut proven.trace {
                        trace.missed = subtract::<S, f64>(trace.spot.point, predicted);
                    }
                    return Ok(proven);
                }
                Err(Lost::Wide) => return Err(rounds),
                Err(Lost::Elsewhere) => {}
            }
        }
        let center = self.interior(simd);
        let first = match start {
            EdgeShapeStart::Witness(witness) => {
                let x = self.placed(simd, (witness - self.side.body().normalization().center).into());
                Some(self.untried(simd, x))
            }
            _ => self.seek(simd, center),
        };
        if let Some(at) = first {
            match self.run(simd, at, &mut rounds) {
                Ok(proven) => return Ok(proven),
                Err(Lost::Wide) => return Err(rounds),
                Err(Lost::Elsewhere) => {}
            }
        }
        if self.options.exhausted(rounds) {
            return Err(rounds);
        }
        // Where the body's surface is about between the set and the centre, or else a common point.
        rounds += 1;
        let y = self.set.project(simd, center);
        let mut evaluated = Evaluated::none();
        evaluated.fill(simd, &self.side, y);
        let highest = evaluated.highest();
        let x = self.side.with_active(highest).on_the_surface(simd, y, evaluated.jets[highest].value);
        let at = self.untried(simd, x);
        // An active set for each of the two takes half the steps near contact. An axis has none.
        let near = NO_LAST_START * self.side.body().trust().reach;
        if self.set.thinnest() > 0.0 && at.seen.distance < near && runs(Stage::Edges) {
            return Err(rounds);
        }
        self.run(simd, at, &mut rounds).map_err(|_| rounds)
    }

    /// From the poses alone; none where the body's interior point is in the set, or where the plane
    /// across the start's normal does not separate it from the set, as near contact.
    #[inline(always)]
    fn seek<S: Simd>(&self, simd: S, center: V3<f64>) -> Option<Iterate> {
        let seen = self.set.offset(simd, center);
        if !(seen.distance > 0.0) {
            return None;
        }
        let (x, n) = cold_start(simd, &self.set, self.side.body(), self.relative, seen.frame[2]);
        (self.set.separation(simd, n, (x, 0.0)) > 0.0).then(|| self.untried(simd, x))
    }

    /// A point of which nothing else is known.
    #[inline(always)]
    fn untried<S: Simd>(&self, simd: S, x: V3<f64>) -> Iterate {
        Iterate { x, seen: self.set.offset(simd, x), active: Weighted::default() }
    }

    /// The body's interior point.
    #[inline(always)]
    fn interior<S: Simd>(&self, simd: S) -> V3<f64> {
        let body = self.side.body();
        self.placed(simd, (body.interior_point() - body.normalization().center).into())
    }

    /// A point of the body's frame, from the centre of its normalization on.
    #[inline(always)]
    fn placed<S: Simd>(&self, _: S, own: V3<f64>) -> V3<f64> {
        add::<S, f64>(self.relative.origin, apply::<S, f64>(&self.relative.rotation, own))
    }

    /// From the last answer: the step for the poses as they are now, without an evaluation, and
    /// what it missed last time on top. Also what it led to, without that, in the body's frame.
    #[inline(always)]
    fn follow<S: Simd>(&self, simd: S, trace: &EdgeShapeTrace) -> Option<(Iterate, V3<f64>)> {
        let EdgeShapeTrace { spot, missed } = trace;
        let x = self.placed(simd, spot.point);
        let seen = self.set.offset(simd, x);
        if !(seen.distance > 0.0) {
            return None;
        }
        let local = self.side.localize(simd, &seen.frame);
        let mut linear = Linearized::none();
        linear.fill(simd, spot.iter(), (&spot.active, &spot.hessian), &local);
        let Found { step, active, .. } = self.step(simd, &linear, x, &seen)?;
        if !(self.side.relative_square(simd, &local, step) < LONGEST_MOVE * LONGEST_MOVE) {
            return None;
        }
        let moved = apply_transposed::<S, f64>(&seen.frame, step);
        let own = apply_transposed::<S, f64>(&self.relative.rotation, moved);
        let predicted = add::<S, f64>(spot.point, own);
        let x = self.placed(simd, add::<S, f64>(predicted, *missed));
        Some((Iterate { x, seen: self.set.offset(simd, x), active }, predicted))
    }

    /// Newton's method until the bracket is narrow.
    ///
    /// # Errors
    /// Why it does not get there.
    // There is no allocation in a solve.
    #[allow(clippy::result_large_err)]
    #[inline(always)]
    fn run<S: Simd>(&self, simd: S, mut at: Iterate, rounds: &mut u32) -> Result<EdgeShapeProven, Lost> {
        let side = &self.side;
        let (mut before, mut halved, mut touched) = (None, 0, false);
        let (mut evaluated, mut linear) = (Evaluated::none(), Linearized::none());
        for round in 1..=SEEK_ROUNDS {
            if self.options.exhausted(*rounds) {
                return Err(Lost::Elsewhere);
            }
            *rounds += 1;
            if !evaluated.fill(simd, side, at.x) {
                at.x = evaluated.brought_near(simd, side, at.x).ok_or(Lost::Elsewhere)?;
                (at.seen, before) = (self.set.offset(simd, at.x), None);
                continue;
            }
            if !(at.seen.distance > 0.0) {
                if let Some(common) = self.common(simd, at.x, &evaluated) {
                    return Ok(EdgeShapeProven { rounds: *rounds, ..common });
                }
                let old = before.filter(|_| halved < RETREATS).ok_or(Lost::Elsewhere)?;
                at.x = scaled::<S, f64>(add::<S, f64>(at.x, old), 0.5);
                at.seen = self.set.offset(simd, at.x);
                halved += 1;
                continue;
            }
            let local = side.localize(simd, &at.seen.frame);
            if at.active.len == 0 {
                at.active = Weighted::highest(simd, &evaluated, &local);
            }
            let bent = at.active.sum(simd, &evaluated).hessian;
            linear.fill(simd, evaluated.iter(), (&at.active, &bent), &local);
            let Some(found) = self.step(simd, &linear, at.x, &at.seen) else {
                // The distance decreases all the way to the set without leaving the body: there may
                // be a common point.
                let inner = self.inner().filter(|_| !touched).ok_or(Lost::Elsewhere)?;
                (touched, before) = (true, Some(at.x));
                at = self.untried(simd, inner.project(simd, at.x));
                continue;
            };
            let square = side.relative_square(simd, &local, found.step);
            if !square.is_finite() {
                return Err(Lost::Elsewhere);
            }
            if square < WORTH_A_BRACKET * WORTH_A_BRACKET || self.is_decided(square, found.next.distance) {
                if let Some(proven) = self.prove(simd, &at, &found, (&evaluated, &local)) {
                    return Ok(EdgeShapeProven { rounds: *rounds, ..proven });
                }
                if square < AT_REST_SQUARED {
                    return Err(Lost::Wide);
                }
            }
            let longest = if round <= PATIENCE { LONGEST_STEP } else { 0.5 * LONGEST_STEP };
            let share = longest / square.sqrt();
            before = Some(at.x);
            let to = moved::<S, f64>(at.x, scaled::<S, f64>(found.step, share.min(1.0)), &at.seen.frame);
            let seen = if share < 1.0 { self.set.offset(simd, to) } else { found.next };
            at = Iterate { x: to, seen, active: found.active };
        }
        Err(Lost::Elsewhere)
    }

    /// Whether a bracket where a step leads probably decides what is asked, though it is only about
    /// as narrow as the cube of the step.
    #[inline(always)]
    fn is_decided(&self, square: f64, distance: f64) -> bool {
        let width = square * square.sqrt() * self.side.body().trust().reach;
        square < LONGEST_MOVE * LONGEST_MOVE && self.goal.met(distance - width, distance + width)
    }

    /// A set that lies in what the set stands for, if there is one.
    #[inline(always)]
    fn inner(&self) -> Option<P> {
        let is_inside = self.displacement == 0.0 || self.set.thinnest() > self.displacement;
        is_inside.then(|| self.set.shrunk(self.displacement))
    }

    /// A point of the set that is proven to lie in the body: near the one at which all constraints
    /// were evaluated, as far towards the body's interior point as they ask for.
    #[inline(always)]
    fn common<S: Simd>(&self, simd: S, x: V3<f64>, evaluated: &Evaluated) -> Option<EdgeShapeProven> {
        let inner = self.inner()?;
        let (highest, least) = (evaluated.jets[evaluated.highest()].value, self.side.body().min_value());
        // Values are convex along the way, and rounding counts.
        let share = ((highest - 1.0) / (highest - least)).max(0.0) * (1.0 + 1e-6);
        let x = add_scaled::<S, f64>(x, share, subtract::<S, f64>(self.interior(simd), x));
        let x = inner.project(simd, x);
        let [_, bound] = self.side.highest(simd, x);
        (bound <= 1.0).then_some(EdgeShapeProven {
            lower: 0.0,
            upper: 0.0,
            x,
            nearest: x,
            n: [0.0; 3],
            active: ActiveConstraints::default(),
            rounds: 0,
            trace: None,
        })
    }

    /// Newton's step from a point; none if the quadratic programs have no minimiser.
    #[inline(always)]
    fn step<S: Simd>(&self, simd: S, linear: &Linearized, x: V3<f64>, seen: &Offset) -> Option<Found> {
        let size = self.side.body().trust().reach;
        let limits = (VIOLATED * size, FLATTEST / size);
        let mut hessian = linear.hessian;
        let [k00, k01, k11] = seen.curvature;
        hessian[0] += k00;
        hessian[1] += k01;
        hessian[3] += k11;
        let (mut normal, mut gradient, mut active) = ([0.0, 0.0, 1.0], [0.0, 0.0, 1.0], linear.active);
        let (mut from, mut feature, mut again) = ([0.0; 3], seen.feature, 0);
        loop {
            let found = minimize(simd, (&hessian, gradient), linear.rows(), active, limits)?;
            let mut way = subtract::<S, f64>(found.step, from);
            let share = LONGEST_STEP * size / dot::<S, f64>(way, way).sqrt();
            let mut to = found.step;
            if share < 1.0 {
                way = scaled::<S, f64>(way, share);
                to = add::<S, f64>(from, way);
            }
            let mut next = self.set.offset(simd, moved::<S, f64>(x, to, &seen.frame));
            if next.feature == feature || !(next.distance > 0.0) || again == FEATURES {
                let active = linear.weighted(&found.active, found.multipliers);
                return Some(Found { step: to, next, active });
            }
            // Where it has come too far, back to about where the distance with what bends the
            // constraints is least on the way.
            let slope = |normal: V3<f64>, at: V3<f64>| {
                dot::<S, f64>(way, add::<S, f64>(normal, apply_symmetric::<S, f64>(&linear.hessian, at)))
            };
            let rising = slope(apply::<S, f64>(&seen.frame, next.frame[2]), to);
            if rising > 0.0 {
                let falling = slope(normal, from);
                to = add_scaled::<S, f64>(from, falling / (falling - rising), way);
                next = self.set.offset(simd, moved::<S, f64>(x, to, &seen.frame));
            }
            from = to;
            (feature, active, again) = (next.feature, found.active, again + 1);
            let bend = bend(simd, &next, &seen.frame);
            for k in 0..6 {
                hessian[k] = linear.hessian[k] + bend[k];
            }
            normal = apply::<S, f64>(&seen.frame, next.frame[2]);
            gradient = add_scaled::<S, f64>(normal, -1.0, apply_symmetric::<S, f64>(&bend, from));
        }
    }

    /// The answer where the step leads; none if it is not one.
    #[inline(always)]
    fn prove<S: Simd>(
        &self,
        simd: S,
        at: &Iterate,
        found: &Found,
        (evaluated, local): (&Evaluated, &M3<f64>),
    ) -> Option<EdgeShapeProven> {
        if !(found.next.distance > 0.0) {
            return None;
        }
        let (body, frame) = (self.side.body(), &at.seen.frame);
        let weighted = found.active.normalized()?;
        let trust = weighted.trust(simd, body, evaluated)?;
        let sum = self.side.with_trust(&trust);
        let there = sum.extrapolate(simd, &weighted.sum(simd, evaluated), local, found.step);
        let to = moved::<S, f64>(at.x, found.step, frame);
        let place = (&self.set, self.displacement);
        let SeparatingPlane { lower, n, outward, multiplier, rounding } =
            separating_plane(simd, place, (&sum, self.relative), &there, (to, found.next.feature), frame);
        let delta = apply_transposed::<S, f64>(local, found.step);
        let share = share_inside(simd, body, evaluated, (delta, found.step))?;
        let x = add_scaled::<S, f64>(to, share, subtract::<S, f64>(self.interior(simd), to));
        let nearest = self.set.project(simd, x);
        let between = subtract::<S, f64>(x, nearest);
        let rounding = rounding + TAYLOR_ROUNDING * share * body.trust().span;
        let upper = dot::<S, f64>(between, between).sqrt() + rounding;
        let off = subtract::<S, f64>(outward, found.next.frame[2]);
        let off = dot::<S, f64>(off, off).sqrt() + there.gradient_error * multiplier;
        let off = off.max(tangent_of_angle(simd, n, between));
        let narrow = upper - lower <= self.tolerance && off <= ALIGNED_AT_EDGES;
        if !(lower > 0.0 && lower <= upper && (narrow || self.goal.met(lower, upper))) {
            return None;
        }
        let own = apply_transposed::<S, f64>(&self.relative.rotation, subtract::<S, f64>(x, self.relative.origin));
        let spot = Spot::new(simd, own, weighted.times(multiplier), (evaluated, delta));
        let active = spot.active.reported();
        let trace = Some(EdgeShapeTrace { spot, missed: [0.0; 3] });
        Some(EdgeShapeProven { lower, upper, x, nearest, n, active, rounds: 0, trace })
    }
}

/// The Hessian `T K Tᵀ` of the distance from a set, per metre, in a frame: 00, 01, 02, 11, 12, 22.
#[inline(always)]
fn bend<S: Simd>(_: S, seen: &Offset, frame: &M3<f64>) -> [f64; 6] {
    let [k00, k01, k11] = seen.curvature;
    let (t0, t1) = (apply::<S, f64>(frame, seen.frame[0]), apply::<S, f64>(frame, seen.frame[1]));
    let b0 = add_scaled::<S, f64>(scaled::<S, f64>(t0, k00), k01, t1);
    let b1 = add_scaled::<S, f64>(scaled::<S, f64>(t1, k11), k01, t0);
    let entry = |i: usize, j: usize| b0[i] * t0[j] + b1[i] * t1[j];
    [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
}
