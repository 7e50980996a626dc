//! The distance of a smooth body from a set with a closed form, inside a proven bracket.
//!
//! Newton's method for the nearest point x of the body ([`super::newton`]) starts from the last
//! answer or from where the outlines face each other ([`super::start`]). What proves the distance:
//! for a unit vector n the plane across it separates by `n·x - (how much farther the body reaches
//! along -n) - h(n)`, h the support function of the set, which is closed; and x, moved into the
//! body, and its projection attain an upper bound. Where the body seems to reach the set, the least
//! value of its polynomial there decides ([`super::level`]).

use super::along_body::AlongBody;
use super::level::{Level, LevelProblem};
use super::newton::newton;
use super::projectable::{Offset, Projectable};
use super::separating_plane::{SeparatingPlane, separating_plane};
use super::start::{on_the_ellipsoid, on_the_table};
use crate::body::Body;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, dot, rows, scaled, subtract,
};
use crate::measure::options::Options;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::step_acceleration::{Correction, Last, Series};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{
    ALIGNED, AT_REST_SQUARED, Extrapolated, FLATTEST, LONGEST_MOVE, LONGEST_STEP, PATIENCE, Plane, RETREATS, Relative,
    SEEK_ROUNDS, Side, SurfaceCurvature, WORTH_A_BRACKET, moved,
};
use crate::polynomial::{NumberJet, Scalar, Simd, WithSimd, dispatch};
use nalgebra::Vector3;

/// Square of the tangent of the angle between the normals of a thin body and of the set's offset
/// surface, dimensionless, above which Newton's method takes the tangents of the body: 3 degrees.
///
/// Larger, steps along its sides are short; smaller, tangents are taken twice where that changes
/// nothing. It changes time only.
const TILTED_SQUARED: f64 = 3e-3;

/// Square of the longest step, in normalized coordinates relative to the body's size there,
/// dimensionless, after which the bracket where it leads is computed.
pub(in crate::measure) const WORTH_A_BRACKET_SQUARED: f64 = WORTH_A_BRACKET * WORTH_A_BRACKET;

/// What is kept of an answer for the next query of the pair: the body's constraint at the nearest
/// point, all in normalized coordinates.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct ExactTrace {
    point: V3<f64>,
    jet: NumberJet<f64>,
    /// What the first step from there missed last time.
    missed: V3<f64>,
}

impl ExactTrace {
    /// As from an answer with this witness, body frame, metres.
    pub(in crate::measure) fn at(body: &Body, witness: &Vector3<f64>) -> Self {
        let normalization = body.normalization();
        let point = (normalization.linear * (witness - normalization.center)).into();
        let jet = body.constraints()[0].polynomial.jet::<Scalar, f64>(Scalar, point);
        Self { point, jet, missed: [0.0; 3] }
    }
}

/// A smooth body and a set, in the frame of the set.
pub(in crate::measure) struct ExactPair<'a, P> {
    pub(in crate::measure) body: &'a Body,
    /// Where the body stands as seen from the set.
    pub(in crate::measure) relative: Relative<f64>,
    pub(in crate::measure) set: P,
    /// Bound of how far the set is from what it stands for, metres.
    pub(in crate::measure) displacement: f64,
    pub(in crate::measure) goal: &'a StopCriterion,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Of the answer before.
    pub(in crate::measure) trace: Option<&'a ExactTrace>,
    /// About the unit normal of a plane between both, from the set to the body.
    pub(in crate::measure) facing: Option<V3<f64>>,
}

/// A proven bracket, metres, and where it is attained, in the frame of the set.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct ExactProven {
    pub(in crate::measure) lower: f64,
    /// 0 where a common point is known.
    pub(in crate::measure) upper: f64,
    /// Point of the body.
    pub(in crate::measure) x: V3<f64>,
    /// Point of the set.
    pub(in crate::measure) nearest: V3<f64>,
    /// Unit normal from the set to the body.
    pub(in crate::measure) n: V3<f64>,
    /// Multiplier of the body's constraint, metres.
    pub(in crate::measure) multiplier: f64,
    /// Evaluations of the body.
    pub(in crate::measure) rounds: u32,
    pub(in crate::measure) trace: Option<ExactTrace>,
}

/// What is left where nothing was proven.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct ExactLost {
    /// Evaluations of the body.
    pub(in crate::measure) rounds: u32,
    /// About where the answer is attained, where Newton's method converged; its bracket means
    /// nothing.
    pub(in crate::measure) about: Option<ExactProven>,
}

/// How Newton's method ended.
enum Ended {
    Proven(ExactProven),
    /// The body seems to reach the set, or there is another reason why steps lead nowhere.
    Lost,
    /// Rounding keeps the bracket wide where no step is left to take, or there were too many.
    Wide(ExactProven),
}

/// Where Newton's method starts: a point of the body, and the set as seen from there.
type Guess = (V3<f64>, Offset);

impl<P: Projectable> WithSimd for ExactPair<'_, P> {
    /// The answer, or what is left.
    type Output = Result<ExactProven, ExactLost>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let side = Side::away(simd, self.body, 0, &self.relative);
        let center = interior(simd, self.body, &self.relative);
        let (mut rounds, mut from_level) = (0, false);
        let followed = self.trace.and_then(|trace| self.follow(simd, &side, trace));
        let mut predicted = followed.map(|(_, predicted)| predicted);
        let mut guess = followed.map(|(guess, _)| guess);
        if guess.is_none() {
            guess = self.seek(simd, &side, center, &mut rounds);
        }
        loop {
            // No closure: what is inlined into one is not compiled for the vectors at hand.
            if let Some(guess) = guess {
                match self.iterate(simd, &side, guess, predicted, from_level, &mut rounds) {
                    Ended::Proven(proven) => return Ok(proven),
                    Ended::Wide(about) => return Err(ExactLost { rounds, about: Some(about) }),
                    Ended::Lost => {}
                }
            }
            if from_level || self.options.exhausted(rounds) || !runs(Stage::ExactLevel) {
                return Err(ExactLost { rounds, about: None });
            }
            // Either they overlap, or the least value shows where to start again.
            from_level = true;
            let most = self.options.max_iterations() - rounds;
            let (level, count) = dispatch(self.level(simd, &side, center, most));
            rounds += count;
            let x = match level {
                Level::Common(y) => return Ok(common(y, rounds)),
                // Where the body's tangent plane there has its surface.
                Level::Apart { lower, n, y } => add_scaled::<S, f64>(y, lower, n),
                Level::Open => return Err(ExactLost { rounds, about: None }),
            };
            (guess, predicted) = (Some((x, self.set.offset(simd, x))), None);
        }
    }
}

impl<P: Projectable> ExactPair<'_, P> {
    /// From the poses alone; none where the body's interior point is in the set, or where the plane
    /// across the start's normal does not separate it from the set, as near contact. Of thin bodies
    /// it is enough that the start lies outside of the set and faces it.
    #[inline(always)]
    fn seek<S: Simd>(&self, simd: S, side: &Side<'_, f64>, center: V3<f64>, rounds: &mut u32) -> Option<Guess> {
        let seen = self.set.offset(simd, center);
        if !(seen.distance > 0.0) {
            return None;
        }
        let n = match self.facing {
            Some(n) => n,
            None => on_the_ellipsoid(simd, &self.set, self.body, &self.relative, seen.frame[2]),
        };
        let (x, n) = on_the_table(simd, &self.set, self.body, &self.relative, n);
        let seen = self.set.offset(simd, x);
        let is_beside = self.set.separation(simd, n, (x, 0.0)) > 0.0;
        if is_beside || !self.body.outline().is_thin() || self.options.exhausted(*rounds) {
            return is_beside.then_some((x, seen));
        }
        // Tables overshoot flat tips, into the set or beyond: back to the surface.
        *rounds += 1;
        let (jet, _) = side.jet(simd, x);
        let x = side.on_the_surface(simd, x, jet.value);
        let seen = self.set.offset(simd, x);
        (seen.distance > 0.0 && dot::<S, f64>(seen.frame[2], n) > 0.0).then_some((x, seen))
    }

    /// Which side of contact they are on, by the least value over the set.
    #[inline(always)]
    fn level<'a, S: Simd>(
        &'a self,
        simd: S,
        side: &'a Side<'a, f64>,
        center: V3<f64>,
        most: u32,
    ) -> LevelProblem<'a, P> {
        let Self { set, displacement, .. } = *self;
        LevelProblem { start: set.project(simd, center), set, side, displacement, settle: true, most }
    }

    /// From the last answer: Newton's step for the poses as they are now, without an evaluation,
    /// and what it missed last time on top. Also the normalized coordinates that the step led to.
    #[inline(always)]
    fn follow<S: Simd>(&self, simd: S, side: &Side<'_, f64>, trace: &ExactTrace) -> Option<(Guess, V3<f64>)> {
        let x = self.located(simd, trace.point);
        let seen = self.set.offset(simd, x);
        if !(seen.distance > 0.0) {
            return None;
        }
        let local = side.localize(simd, &seen.frame);
        let plane = Plane::new(simd, &trace.jet, &local);
        let bend = SurfaceCurvature::new(simd, &trace.jet, &local);
        let found = newton(simd, &self.set, x, &seen, (&plane, &bend), self.smallest())?;
        if !(side.relative_square(simd, &local, found.step) < LONGEST_MOVE * LONGEST_MOVE) {
            return None;
        }
        let predicted = add::<S, f64>(trace.point, apply_transposed::<S, f64>(&local, found.step));
        let x = self.located(simd, add::<S, f64>(predicted, trace.missed));
        let seen = self.set.offset(simd, x);
        (seen.distance > 0.0).then_some(((x, seen), predicted))
    }

    /// Curvature that counts as none, per metre.
    fn smallest(&self) -> f64 {
        FLATTEST / self.body.trust().reach
    }

    /// A point of the body by its normalized coordinates.
    #[inline(always)]
    fn located<S: Simd>(&self, simd: S, z: V3<f64>) -> V3<f64> {
        let inverse: M3<f64> = rows(simd, self.body.inverse());
        let own = apply::<S, f64>(&inverse, z);
        add::<S, f64>(self.relative.origin, apply::<S, f64>(&self.relative.rotation, own))
    }

    /// Newton's method from a point and the set as seen from there; `apart` if the body is known
    /// not to reach the set, so that steps into it are too long.
    #[inline(always)]
    fn iterate<S: Simd>(
        &self,
        simd: S,
        side: &Side<'_, f64>,
        (mut x, mut seen): Guess,
        predicted: Option<V3<f64>>,
        apart: bool,
        rounds: &mut u32,
    ) -> Ended {
        let is_thin = self.body.outline().is_thin();
        let (mut before, mut halved) = (None, 0);
        let (mut brought, mut series) = (0, Series::default());
        for round in 1..=SEEK_ROUNDS {
            while !(seen.distance > 0.0) {
                let Some(old) = before.filter(|_| apart && halved < RETREATS) else { return Ended::Lost };
                halved += 1;
                x = scaled::<S, f64>(add::<S, f64>(x, old), 0.5);
                seen = self.set.offset(simd, x);
            }
            if self.options.exhausted(*rounds) {
                return Ended::Lost;
            }
            *rounds += 1;
            let (jet, inside) = side.jet(simd, x);
            if !inside {
                // A step has led too far.
                if brought == RETREATS || !(jet.value < f64::INFINITY) {
                    return Ended::Lost;
                }
                brought += 1;
                x = side.brought_near(simd, x, jet.value);
                (seen, before, series) = (self.set.offset(simd, x), None, Series::default());
                continue;
            }
            let local = side.localize(simd, &seen.frame);
            let plane = Plane::new(simd, &jet, &local);
            let [across_0, across_1, along] = plane.gradient;
            let across = across_0 * across_0 + across_1 * across_1;
            if is_thin && across > TILTED_SQUARED * along * along && along < 0.0 {
                let inward = scaled::<S, f64>(apply_transposed::<S, f64>(&seen.frame, plane.gradient), -1.0);
                let (set, smallest, share) = (&self.set, self.smallest(), damping(round));
                (before, halved) = (Some(x), 0);
                (x, seen) =
                    dispatch(AlongBody { set, side, x, jet: &jet, inward, smallest, longest: LONGEST_STEP, share });
                series = Series::default();
                continue;
            }
            let bend = SurfaceCurvature::new(simd, &jet, &local);
            let Some(found) = newton(simd, &self.set, x, &seen, (&plane, &bend), self.smallest()) else {
                // The step before has led behind the body.
                let Some(old) = before.filter(|_| halved < RETREATS) else { return Ended::Lost };
                halved += 1;
                x = scaled::<S, f64>(add::<S, f64>(x, old), 0.5);
                (seen, series) = (self.set.offset(simd, x), Series::default());
                continue;
            };
            halved = 0;
            let square = side.relative_square(simd, &local, found.step);
            let along = [found.step[0], found.step[1]];
            // Where sides are flat the point at hand may do long before its step is short enough.
            let may_be_flat = series.may_have_to_be_corrected(along, square.sqrt());
            let is_flat = may_be_flat && series.is_slow(along);
            if square < WORTH_A_BRACKET_SQUARED || is_flat {
                // There the normal is that of the face: on to the surface.
                let step = if is_flat { [0.0, 0.0, found.shift] } else { found.step };
                let at = side.extrapolate(simd, &jet, &local, step);
                let to = moved::<S, f64>(x, step, &seen.frame);
                let there = if is_flat { &self.set.offset(simd, to) } else { &found.next };
                if let Some(proven) = self.bracket(simd, side, &at, (to, there), &seen.frame) {
                    let delta = apply_transposed::<S, f64>(&local, step);
                    let trace = trace_of(simd, &jet, (side.normalized(simd, x), delta), predicted);
                    return Ended::Proven(ExactProven { rounds: *rounds, trace: Some(trace), ..proven });
                }
                if square < AT_REST_SQUARED {
                    return Ended::Wide(self.about(simd, to, &seen));
                }
            }
            let tangents = [seen.frame[0], seen.frame[1]];
            let part = series.part(simd, tangents, along, square.sqrt());
            let (mut step, mut length, slope) = (found.step, square.sqrt(), plane.slope());
            let (mut corrected, mut next) = (false, found.next);
            if may_be_flat {
                let more = series.correction(simd, tangents, (along, slope), found.compliance);
                if more != Correction::default() {
                    let mut tried = step;
                    for i in 0..2 {
                        tried[i] += more.longer[i] + more.shorter[i];
                        tried[2] -= slope[i] * more.shorter[i];
                    }
                    let there = self.set.offset(simd, moved::<S, f64>(x, tried, &seen.frame));
                    // Newton's own step may lead anywhere from where there is no curvature.
                    corrected = found.next.feature == seen.feature || there.feature == seen.feature;
                    if corrected {
                        (step, next) = (tried, there);
                        length = side.relative_square(simd, &local, step).sqrt();
                    }
                }
            }
            series.push(tangents, Last { newton: along, taken: [step[0], step[1]], slope, corrected });
            let mut share = part.min(LONGEST_STEP / length);
            if !corrected && square > WORTH_A_BRACKET_SQUARED {
                share *= damping(round);
            }
            before = Some(x);
            if share < 1.0 {
                step = scaled::<S, f64>(step, share);
                series.took([step[0], step[1]]);
            }
            x = moved::<S, f64>(x, step, &seen.frame);
            seen = if share < 1.0 { self.set.offset(simd, x) } else { next };
        }
        // Flat sides take more steps than this; others lead in circles.
        if series.is_corrected() { Ended::Wide(self.about(simd, x, &seen)) } else { Ended::Lost }
    }

    /// What is known about a point that nothing proves.
    #[inline(always)]
    fn about<S: Simd>(&self, simd: S, x: V3<f64>, seen: &Offset) -> ExactProven {
        ExactProven {
            lower: 0.0,
            upper: f64::INFINITY,
            n: seen.frame[2],
            nearest: self.set.project(simd, x),
            ..common(x, 0)
        }
    }

    /// The answer at a point that was stepped to, with the body's constraint there in the frame of
    /// the step; none if the bracket is too wide.
    #[inline(always)]
    fn bracket<S: Simd>(
        &self,
        simd: S,
        side: &Side<'_, f64>,
        at: &Extrapolated<f64>,
        (to, seen): (V3<f64>, &Offset),
        frame: &M3<f64>,
    ) -> Option<ExactProven> {
        if !(seen.distance > 0.0) {
            return None;
        }
        let place = (&self.set, self.displacement);
        let SeparatingPlane { lower, n, outward, multiplier, rounding } =
            separating_plane(simd, place, (side, &self.relative), at, (to, seen.feature), frame);
        let (inward, fine) = side.inward(simd, at);
        let x = moved::<S, f64>(to, inward, frame);
        let nearest = self.set.project(simd, x);
        let between = subtract::<S, f64>(x, nearest);
        let upper = dot::<S, f64>(between, between).sqrt() + rounding;
        if !(fine && lower <= upper) {
            return None;
        }
        let off = subtract::<S, f64>(outward, seen.frame[2]);
        // Across a thin body the gradient turns with the error of its extrapolation.
        let is_known = !self.body.outline().is_thin() || at.gradient_error * multiplier <= ALIGNED;
        let is_aligned = is_known && dot::<S, f64>(off, off) <= ALIGNED * ALIGNED;
        let narrow = upper - lower <= self.tolerance;
        let enough = narrow && is_aligned || self.goal.met(lower, upper);
        let proven = ExactProven { lower, upper, x, nearest, n, multiplier, rounds: 0, trace: None };
        (enough && lower > 0.0).then_some(proven)
    }
}

/// The share of a step that is taken in a round.
#[inline(always)]
fn damping(round: u32) -> f64 {
    if round <= PATIENCE {
        1.0
    } else if round & 1 == 0 {
        0.5
    } else {
        0.8
    }
}

/// What to keep of an answer that a step from a point with this jet has led to, both in normalized
/// coordinates.
#[inline(always)]
fn trace_of<S: Simd>(
    _: S,
    jet: &NumberJet<f64>,
    (z, delta): (V3<f64>, V3<f64>),
    predicted: Option<V3<f64>>,
) -> ExactTrace {
    let bent = apply_symmetric::<S, f64>(&jet.hessian, delta);
    let point = add::<S, f64>(z, delta);
    let value = jet.value + dot::<S, f64>(delta, add_scaled::<S, f64>(jet.gradient, 0.5, bent));
    let jet = NumberJet { value, gradient: add::<S, f64>(jet.gradient, bent), hessian: jet.hessian };
    let missed = predicted.map_or([0.0; 3], |predicted| subtract::<S, f64>(point, predicted));
    ExactTrace { point, jet, missed }
}

/// A body's interior point in the frame of the set.
#[inline(always)]
pub(super) fn interior<S: Simd>(_: S, body: &Body, relative: &Relative<f64>) -> V3<f64> {
    let own = body.interior_point() - body.normalization().center;
    add::<S, f64>(relative.origin, apply::<S, f64>(&relative.rotation, own.into()))
}

/// A common point.
pub(in crate::measure) fn common(y: V3<f64>, rounds: u32) -> ExactProven {
    ExactProven { lower: 0.0, upper: 0.0, x: y, nearest: y, n: [0.0; 3], multiplier: 0.0, rounds, trace: None }
}
