//! Distance of two bodies: in closed form on one side where there is one, else continuation first;
//! then the general search.

use super::answer::Distance;
use super::edges::of_edges;
use super::exact::{Exact, of_shapes};
use super::planes::planes_between;
use super::query::Query;
use super::search::Search;
use crate::body::{Body, ClosedForm};
use crate::measure::bounds::culling::{InnerGap, ball_gap, inner_gap};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::vector::V3;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::common_point::CommonPoint;
use crate::measure::solver::continuation::{Follow, Lost, Proven, Seek, Trace};
use crate::measure::solver::exact_shape::{ShapeContact, contact_of_shapes};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{ALIGNED, SEEK_ROUNDS, Side};
use crate::measure::solver::two_point_problem::{Apart, Relation};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{Simd, WithSimd, dispatch};
use nalgebra::Vector3;

/// Distance of two bodies as far as the goal needs it, cheapest bounds first. `warm` stays as it is
/// when bounds suffice.
#[inline]
pub(in crate::measure) fn settle(
    of_a: (&Body, &Pose),
    of_b: (&Body, &Pose),
    goal: &StopCriterion,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    // A ball's distance from a shape costs no more than bounds of it.
    let forms = [of_a, of_b].map(|(body, _)| body.closed_form());
    let is_ball = |form: &Option<&ClosedForm>| form.is_some_and(|form| form.shape().ball_radius_m().is_some());
    let is_beside_ball = forms.iter().all(Option::is_some) && forms.iter().any(is_ball);
    if goal.is_narrow() || is_beside_ball && runs(Stage::ClosedForm) {
        return between(of_a, of_b, goal, options, warm);
    }
    let has_balls = runs(Stage::Balls);
    let gap = if has_balls { ball_gap(of_a, of_b) } else { 0.0 };
    let mut bound = Distance { lower: gap.max(0.0), ..Distance::default() };
    if goal.met(bound.lower, bound.upper) {
        return bound;
    }
    // Balls inside decide where bodies are deep in each other, planes where they are apart.
    let [shell_a, shell_b] = [of_a.0, of_b.0].map(|body| body.circumscribed().radius - body.in_radius());
    let is_deep = gap < -(shell_a + shell_b);
    if is_deep && has_balls {
        bound = within_inner_balls(bound.lower, of_a, of_b);
        if goal.met(bound.lower, bound.upper) {
            return bound;
        }
    }
    let mut query = Query { of_a, of_b, goal, options, facing: None };
    if let Some(found) = query.still_overlapping(warm) {
        return found;
    }
    if runs(Stage::Planes) {
        let planes = planes_between(of_a, of_b, &warm.hint, goal);
        (bound.lower, query.facing) = (bound.lower.max(planes.lower), planes.facing);
        if goal.met(bound.lower, bound.upper) {
            return bound;
        }
    }
    if !is_deep && has_balls {
        bound = within_inner_balls(bound.lower, of_a, of_b);
        if goal.met(bound.lower, bound.upper) {
            return bound;
        }
    }
    let mut spent = 0;
    if runs(Stage::ClosedForm)
        && goal.is_contact()
        && let (Some(form_a), Some(form_b)) = (of_a.0.closed_form(), of_b.0.closed_form())
    {
        match contact_of_shapes((form_a, of_a.1), (form_b, of_b.1), options) {
            Ok(ShapeContact::Common(v)) => {
                let status = Status::Converged;
                return Distance { status, upper: 0.0, witness_a: v, witness_b: v, ..Distance::default() };
            }
            Ok(ShapeContact::Apart(lower)) => return Distance { lower: lower.max(bound.lower), ..bound },
            Err(steps) => spent = steps,
        }
    }
    if runs(Stage::ClosedForm)
        && goal.is_contact()
        && let Some(exact) = Exact::new(of_a, of_b)
    {
        match exact.contact(options, warm) {
            Ok(found) => {
                let (lower, iterations) = (found.lower.max(bound.lower), found.iterations);
                return Distance { lower, iterations, ..if found.upper < bound.upper { found } else { bound } };
            }
            Err(rounds) => spent = rounds,
        }
    }
    let found = Query { options: &options.after(spent), ..query }.solve(warm);
    let found = Distance { iterations: found.iterations + spent, ..found };
    // A search that stopped early may know less than the bounds it came after.
    let upper = if found.upper <= bound.upper { found } else { bound };
    Distance { lower: found.lower.max(bound.lower), status: found.status, iterations: found.iterations, ..upper }
}

/// What balls inside both bodies show, with a lower bound, metres, that is known.
#[inline(always)]
fn within_inner_balls(lower: f64, of_a: (&Body, &Pose), of_b: (&Body, &Pose)) -> Distance {
    let InnerGap { upper, witness_a, witness_b, normal } = inner_gap(of_a, of_b);
    Distance { lower, upper, witness_a, witness_b, normal, ..Distance::default() }
}

/// Distance of two bodies, or as much of it as the goal needs.
pub(in crate::measure) fn between(
    of_a: (&Body, &Pose),
    of_b: (&Body, &Pose),
    goal: &StopCriterion,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    Query { of_a, of_b, goal, options, facing: None }.solve(warm)
}

// Each method hands on to the next where it fails, and none hands back: an answer is written where
// the caller wants it, and not copied, for loads of what was just stored in other pieces have to
// wait.
impl<'a> Query<'a> {
    #[inline]
    fn solve(&self, warm: &mut WarmStart) -> Distance {
        let Self { of_a, of_b, goal, options, .. } = *self;
        if runs(Stage::ClosedForm)
            && let Some(found) = of_shapes(of_a, of_b, (goal, options), warm)
        {
            return match found {
                Ok(found) => found,
                Err(steps) => self.search(&Lost::after(steps), warm),
            };
        }
        if let Some(found) = self.still_overlapping(warm) {
            return found;
        }
        if runs(Stage::ClosedForm)
            && let Some(exact) = Exact::new(of_a, of_b)
        {
            return match exact.distance(goal, options, &warm.hint) {
                Ok((found, hint)) => {
                    warm.hint = hint;
                    found
                }
                Err((rounds, hint)) => {
                    warm.hint = hint;
                    self.search(&Lost::after(rounds), warm)
                }
            };
        }
        if !(of_a.0.is_smooth() && of_b.0.is_smooth()) {
            return self.of_edges(warm);
        }
        match warm.hint {
            Hint::Smooth(_) if runs(Stage::Follow) => dispatch(Warm { query: *self, warm }),
            _ => self.afresh(&Lost::after(0), warm),
        }
    }

    /// Of bodies of which at least one has several constraints, and at most one a closed form.
    fn of_edges(&self, warm: &mut WarmStart) -> Distance {
        let Self { of_a, of_b, goal, options, .. } = *self;
        let mut spent = 0;
        // Near contact two active sets find common points sooner.
        if runs(Stage::ClosedForm)
            && !goal.is_contact()
            && let Some(exact) = Exact::edged(of_a, of_b)
        {
            match exact.distance_of_edges(goal, options, warm) {
                Ok(found) => return found,
                Err(rounds) => spent = rounds,
            }
        }
        if !runs(Stage::Edges) || options.exhausted(spent) {
            return self.search(&Lost::after(spent), warm);
        }
        match of_edges(&Query { options: &options.after(spent), ..*self }, warm) {
            Ok(found) => Distance { iterations: found.iterations + spent, ..found },
            Err(lost) => self.search(&Lost { rounds: lost.rounds + spent, ..lost }, warm),
        }
    }

    #[inline(always)]
    fn relation(&self) -> Apart<'a> {
        let ((a, pose_a), (b, pose_b)) = (self.of_a, self.of_b);
        let tolerance = self.options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
        Apart { pose_a, pose_b, goal: self.goal, tolerance, angle: ALIGNED, facing: self.facing }
    }

    fn pair(&self) -> Pair<'a> {
        let ((a, pose_a), (b, pose_b)) = (self.of_a, self.of_b);
        Pair::new(a, pose_a, b, pose_b)
    }

    /// The answer if the bodies have the point of their last overlap still in common, which is
    /// forgotten if not.
    fn still_overlapping(&self, warm: &mut WarmStart) -> Option<Distance> {
        let Hint::Overlap { point_a } = warm.hint else { return None };
        let v = (point_a - self.of_a.0.normalization().center).into();
        if let Some(common) = dispatch(StillCommon { query: *self, v })
            && common.proven
        {
            return Some(self.overlapping(&common, 0, warm));
        }
        warm.hint = Hint::Cold;
        None
    }

    /// The answer that a proven point of both bodies is.
    fn overlapping(&self, common: &CommonPoint, iterations: u32, warm: &mut WarmStart) -> Distance {
        let (a, pose_a) = self.of_a;
        let point_a = a.normalization().center + Vector3::from(common.v);
        warm.hint = Hint::Overlap { point_a };
        let witness = pose_a.transform_point(&point_a);
        Distance {
            status: Status::Converged,
            lower: 0.0,
            upper: 0.0,
            witness_a: witness,
            witness_b: witness,
            iterations,
            ..Distance::default()
        }
    }

    /// From nothing but the poses, after what continuation has left.
    #[inline(never)]
    fn afresh(&self, lost: &Lost, warm: &mut WarmStart) -> Distance {
        // Where edges face each other no single constraint is to be followed.
        let smooth = self.of_a.0.is_smooth() && self.of_b.0.is_smooth();
        // From far away it does other than lanes, which bring no points back that have come too far
        // from the bodies.
        let diverged = matches!(warm.hint, Hint::Diverged) && !far_apart(self.of_a, self.of_b);
        let open = !lost.touching() && lost.parted.is_none();
        if runs(Stage::Seek) && smooth && !diverged && open && !self.options.exhausted(lost.rounds) {
            return dispatch(Cold { query: *self, before: lost.rounds, warm });
        }
        self.search(lost, warm)
    }

    /// By all that there is.
    #[inline(never)]
    fn search(&self, lost: &Lost, warm: &mut WarmStart) -> Distance {
        if let Some(common) = lost.common.filter(|common| common.proven) {
            return self.overlapping(&common, lost.rounds, warm);
        }
        if let Some(lower) = lost.parted {
            return parted(lower, lost.rounds);
        }
        let pair = self.pair();
        let mut search = Search::new(&pair, self.goal, self.options, lost.rounds);
        search.take_over(lost);
        if !search.decided() {
            search.run(&warm.hint);
        }
        warm.hint = search.hint();
        search.answer()
    }

    /// The answer that a proof gives, refined if rounding keeps it wide.
    #[inline(always)]
    fn answer<S: Simd>(&self, simd: S, proven: &Proven, tolerance: f64) -> Distance {
        let narrow = proven.upper - proven.lower <= tolerance;
        if !narrow && !self.goal.met(proven.lower, proven.upper) {
            return self.refined(proven.rounds, |search| search.resume(proven));
        }
        let (a, pose_a) = self.of_a;
        let [witness_a, witness_b, normal] = proven.world(simd, a, pose_a);
        Distance {
            status: Status::of(narrow),
            lower: proven.lower,
            upper: proven.upper,
            witness_a,
            witness_b,
            normal: Some(normal),
            active_a: ActiveConstraints::single(proven.active[0], proven.multipliers[0]),
            active_b: ActiveConstraints::single(proven.active[1], proven.multipliers[1]),
            parts: [0, 0],
            tied: false,
            iterations: proven.rounds,
        }
    }

    /// A proven answer that rounding keeps wide, refined in double-double arithmetic.
    #[cold]
    pub(super) fn refined(&self, rounds: u32, resume: impl FnOnce(&mut Search<'_>)) -> Distance {
        let pair = self.pair();
        let mut search = Search::new(&pair, self.goal, self.options, rounds);
        resume(&mut search);
        search.refine();
        search.attain_any();
        search.answer()
    }
}

/// Continuation from a smooth hint, as vectorized work.
struct Warm<'a> {
    query: Query<'a>,
    warm: &'a mut WarmStart,
}

impl WithSimd for Warm<'_> {
    type Output = Distance;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Distance {
        let Self { query, warm } = self;
        let relation = query.relation();
        let lost = match &mut warm.hint {
            Hint::Smooth(trace) => {
                let (a, b) = (query.of_a.0, query.of_b.0);
                match (Follow { a, b, relation, options: query.options, trace }).with_simd(simd) {
                    Ok(proven) => return query.answer(simd, &proven, relation.tolerance),
                    Err(lost) => lost,
                }
            }
            // Nothing to follow.
            _ => Lost::after(0),
        };
        query.afresh(&lost, warm)
    }
}

/// Whether a point lies in both bodies, as vectorized work.
struct StillCommon<'a> {
    query: Query<'a>,
    /// From the centre of A's normalization on, in A's frame, metres.
    v: V3<f64>,
}

impl WithSimd for StillCommon<'_> {
    type Output = Option<CommonPoint>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Option<CommonPoint> {
        let (a, b) = (self.query.of_a.0, self.query.of_b.0);
        let relative = self.query.relation().relative(simd, a, b);
        CommonPoint::at((&Side::at_home(simd, a, 0), &Side::away(simd, b, 0, &relative)), self.v)
    }
}

/// All that a plane between two bodies says, after so many evaluations.
#[inline(always)]
fn parted(lower: f64, iterations: u32) -> Distance {
    Distance { lower, iterations, ..Distance::default() }
}

/// A start from nothing but the poses, as vectorized work.
struct Cold<'a> {
    query: Query<'a>,
    /// Evaluations before it.
    before: u32,
    warm: &'a mut WarmStart,
}

impl WithSimd for Cold<'_> {
    type Output = Distance;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Distance {
        let Self { query, before, warm } = self;
        let (a, b, options, relation) = (query.of_a.0, query.of_b.0, query.options, query.relation());
        let most = SEEK_ROUNDS.min(options.max_iterations() - before);
        let mut trace = Trace::default();
        match (Seek { a, b, relation, from: None, most, options, trace: &mut trace }).with_simd(simd) {
            Ok(proven) => {
                warm.hint = Hint::Smooth(trace);
                let proven = Proven { rounds: before + proven.rounds, ..proven };
                query.answer(simd, &proven, relation.tolerance)
            }
            Err(Lost { parted: Some(lower), rounds, .. }) => parted(lower, before + rounds),
            Err(lost) => query.search(&Lost { rounds: before + lost.rounds, ..lost }, warm),
        }
    }
}

/// The point of B nearest to A in the query frame and the constraints that are active there; on
/// overlap a common point, and none.
pub(in crate::measure) fn nearest(
    pair: &Pair<'_>,
    options: &Options<'_>,
    iterations: &mut u32,
) -> (Vector3<f64>, Option<(Active, Active)>) {
    let mut search = Search::new(pair, &StopCriterion::NARROW, options, *iterations);
    search.run(&Hint::Cold);
    *iterations = search.iterations();
    search.nearest()
}

/// Distance of the bodies' middles relative to the sum of their circumradii, dimensionless, above
/// which a single query differs from lanes that have diverged, and so is worth its time.
///
/// It changes time only; no test pins it.
const FAR_APART: f64 = 2.0;

fn far_apart((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> bool {
    let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
    let middles = (pose_a.transform_point(&ball_a.center), pose_b.transform_point(&ball_b.center));
    (middles.0 - middles.1).norm() > FAR_APART * (ball_a.radius + ball_b.radius)
}
