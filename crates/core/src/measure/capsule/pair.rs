//! The signed distance of one body from a capsule: by closed forms, else by the projection of its
//! axis on the body, and where rounding ends that along the axis and in double-double arithmetic.

use super::answer::CapsuleDistance;
use super::axes::{Axis, of_axes};
use super::bounds::{EarlyBounds, early_bounds};
use super::shape::Capsule;
use crate::body::{Body, ClosedForm};
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::point::Projection;
use crate::measure::solver::edge_newton::{EdgeShapeProven, EdgeShapeQuery, EdgeShapeStart};
use crate::measure::solver::exact_shape::{
    ExactProven, ExactQuery, ShapeDistance, between_shapes, direction_to_world, to_world,
};
use crate::measure::solver::projection::{Segment, Single};
use crate::measure::solver::refinement::{Refined, RefinedAxis, RefinedOffset};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// Most places along a segment at which the distance is taken.
const MAX_PLACES: u32 = 64;

/// Width of a bracket, relative to the larger of both and their distance, dimensionless, that the
/// projection of the axis is asked for where the tolerance may be below what doubles can prove;
/// refinement goes on from there.
///
/// Smaller, the projection takes steps that rounding keeps wide; larger, refinement starts farther
/// from the solution. Exercised by `family_13_parallel_flats_of_primitives`.
const ROUNDING_FLOOR: f64 = 1e-12;

/// Largest derivative of the distance along the axis, dimensionless, at a place that counts as the
/// nearest one in its middle: gradients are off by about as much, and 1e-6 is promised.
///
/// Larger, they are off by more; smaller, rounding keeps places from being taken. Exercised by
/// `family_08_primitives_at_contact`.
const LEVEL: f64 = 1e-7;

/// Most places that are tried after the bracket was narrow first, for the sake of the gradients.
const MORE_PLACES: u32 = 12;

/// A capsule where it stands, and how its distance is to be solved.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Problem<'a> {
    pub(in crate::measure) capsule: &'a Capsule,
    pub(in crate::measure) capsule_pose: &'a Pose,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    pub(in crate::measure) options: &'a Options<'a>,
    /// What the signed distance is asked for.
    pub(in crate::measure) goal: StopCriterion,
}

/// The axis of the capsule as seen from a place in the world.
struct SeenAxis {
    /// The place.
    origin: Vector3<f64>,
    /// The middle of the axis, from there on.
    center: Vector3<f64>,
    half_axis: Vector3<f64>,
    /// Bound of what is wrong with that, metres.
    error: f64,
}

impl Problem<'_> {
    pub(super) fn solve(&self, of_body: At<'_, Body>, warm: &mut WarmStart) -> CapsuleDistance {
        let known = if self.goal.is_narrow() {
            EarlyBounds::NONE
        } else {
            early_bounds(of_body, (self.capsule, self.capsule_pose), &self.goal)
        };
        let found = if self.goal.met(known.lower, known.upper) {
            CapsuleDistance { upper: f64::INFINITY, ..self.met(of_body.1.translation(), 0) }
        } else {
            self.search(of_body, known.facing, warm)
        };
        CapsuleDistance { lower: found.lower.max(known.lower), upper: found.upper.min(known.upper), ..found }
    }

    /// Beyond what is known early: from the normal of a plane between them, if one was tried.
    fn search(&self, of_body: At<'_, Body>, facing: Option<Vector3<f64>>, warm: &mut WarmStart) -> CapsuleDistance {
        match self.by_newton(of_body, facing, warm) {
            Ok(found) => self.refined(of_body, found),
            Err(spent) => self.beyond_newton(of_body, spent, warm),
        }
    }

    /// Where Newton's method has not found a bracket as narrow as asked for: from the projection of
    /// the axis if rounding may be the reason, or along the axis.
    #[cold]
    fn beyond_newton(&self, of_body: At<'_, Body>, mut spent: u32, warm: &mut WarmStart) -> CapsuleDistance {
        let floor = ROUNDING_FLOOR * self.size(of_body);
        if floor > self.tolerance && self.goal.wants_answer() && !self.options.exhausted(spent) {
            let found = self.by_projection(of_body, floor, spent, warm);
            let found = self.refined(of_body, found);
            if found.upper - found.lower <= floor || self.is_decided(&found) {
                return found;
            }
            spent = found.iterations;
        }
        self.refined(of_body, self.along_axis(of_body, spent, warm))
    }

    /// Whether an answer says what is asked, or that the axis meets the body, beyond which nothing
    /// is measured.
    fn is_decided(&self, found: &CapsuleDistance) -> bool {
        self.goal.met(found.lower, found.upper) || found.upper <= -self.capsule.radius_m()
    }

    /// An answer that is asked for, in double-double arithmetic as well where it is wider than the
    /// tolerance.
    fn refined(&self, of_body: At<'_, Body>, found: CapsuleDistance) -> CapsuleDistance {
        let is_open = found.upper - found.lower > self.tolerance && !self.is_decided(&found);
        let may_go_on = self.goal.wants_answer() && !self.options.exhausted(found.iterations);
        if is_open && may_go_on && runs(Stage::Refinement) { self.with_more_digits(of_body, found) } else { found }
    }

    /// The answer inside the bracket in double-double arithmetic as well: both are proven.
    #[cold]
    fn with_more_digits(&self, (body, pose): At<'_, Body>, found: CapsuleDistance) -> CapsuleDistance {
        let single = Single::new(body, pose);
        let [radius, half] = [self.capsule.radius_m(), self.capsule.half_height_m()];
        let axis = RefinedAxis::new(&single, [radius, half], self.capsule_pose);
        let (near, _) = single.to_query(&found.witness);
        let options = self.options.after(found.iterations);
        let refined = axis.narrow([found.lower, found.upper], &near, self.tolerance, &options);
        let Refined { lower, upper, at, steps } = refined;
        let status = Status::of(upper - lower <= self.tolerance);
        let known = CapsuleDistance { status, lower, upper, iterations: found.iterations + steps, ..found };
        let Some(RefinedOffset { x, place, n, .. }) = at else { return known };
        let normal = -single.direction_to_world(&n);
        let on_axis = self.capsule_pose.transform_point(&Vector3::new(0.0, 0.0, half * place));
        let witness_of_capsule = on_axis + normal * radius;
        CapsuleDistance { witness: single.to_world(&x), witness_of_capsule, normal: Some(normal), ..known }
    }

    /// What rounding of coordinates grows with, metres: the larger of both and how far they are
    /// apart.
    fn size(&self, (body, pose): At<'_, Body>) -> f64 {
        let between = pose.translation() - self.capsule_pose.translation();
        self.capsule.reach_m().max(body.circumscribed().radius) + between.norm()
    }

    /// In a bracket as narrow as asked for; of balls in one as narrow as rounding allows.
    ///
    /// # Errors
    /// After how many iterations nothing is proven, or nothing as narrow.
    fn by_newton(
        &self,
        of_body: At<'_, Body>,
        facing: Option<Vector3<f64>>,
        warm: &mut WarmStart,
    ) -> Result<CapsuleDistance, u32> {
        if !runs(Stage::ClosedForm) {
            Err(0)
        } else if let Some(form) = of_body.0.closed_form() {
            match Axis::of_ball(form, of_body.1) {
                Some(ball) => {
                    warm.hint = Hint::Cold;
                    Ok(of_axes(&ball, &Axis::of_capsule(self.capsule, self.capsule_pose), self.tolerance))
                }
                None => self.of_shape((form, of_body.1), warm),
            }
        } else if of_body.0.is_smooth() {
            self.of_smooth(of_body, facing, warm)
        } else {
            self.of_edged(of_body, warm)
        }
    }

    /// Of a body with a single constraint.
    ///
    /// # Errors
    /// After how many evaluations nothing is proven.
    fn of_smooth(
        &self,
        (body, pose): At<'_, Body>,
        facing: Option<Vector3<f64>>,
        warm: &mut WarmStart,
    ) -> Result<CapsuleDistance, u32> {
        let Self { tolerance, options, .. } = *self;
        let form_pose = self.capsule_pose;
        let (form, goal) = (self.capsule.closed_form(), self.goal.beyond_radius(self.capsule.radius_m()));
        let trace = if let Hint::Exact(trace) = &warm.hint { Some(trace) } else { None };
        let facing = facing.map(|n| form_pose.rotation().inverse_transform_vector(&n).into());
        let query = ExactQuery { body, pose, form: &form, form_pose, goal: &goal, tolerance, options, trace, facing };
        let found = dispatch(query).map_err(|lost| lost.rounds)?;
        if found.upper == 0.0 {
            warm.hint = Hint::Cold;
            return Ok(self.met(&to_world(&form, form_pose, found.x), found.rounds));
        }
        warm.hint = found.trace.map_or(Hint::Cold, Hint::Exact);
        Ok(self.outside(&form, &found))
    }

    /// The answer where the axis is outside of the body at the distance that is proven, in the
    /// frame of the capsule.
    #[inline(always)]
    pub(in crate::measure) fn outside(&self, form: &ClosedForm, found: &ExactProven) -> CapsuleDistance {
        let form_pose = self.capsule_pose;
        let ExactProven { lower, upper, x, nearest, n, rounds, .. } = *found;
        let witnesses = [x, nearest].map(|point| to_world(form, form_pose, point));
        self.apart([lower, upper], witnesses, direction_to_world(form, form_pose, n), rounds)
    }

    /// Of a body with several constraints.
    ///
    /// # Errors
    /// After how many steps nothing is proven.
    fn of_edged(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> Result<CapsuleDistance, u32> {
        let Self { capsule_pose: form_pose, tolerance, options, .. } = *self;
        let (form, goal) = (self.capsule.closed_form(), self.goal.beyond_radius(self.capsule.radius_m()));
        let start = match &warm.hint {
            Hint::EdgeShape(trace) => EdgeShapeStart::Last(trace),
            Hint::Single { y, .. } => EdgeShapeStart::Witness(*y),
            _ => EdgeShapeStart::Cold,
        };
        let query = EdgeShapeQuery { body, pose, form: &form, form_pose, goal: &goal, tolerance, options, start };
        let spent = match dispatch(query) {
            Ok(found) => {
                let EdgeShapeProven { lower, upper, x, nearest, n, rounds, trace, .. } = found;
                warm.hint = trace.map_or(Hint::Cold, Hint::EdgeShape);
                if upper == 0.0 {
                    return Ok(self.met(&to_world(&form, form_pose, x), rounds));
                }
                let witnesses = [x, nearest].map(|point| to_world(&form, form_pose, point));
                return Ok(self.apart([lower, upper], witnesses, direction_to_world(&form, form_pose, n), rounds));
            }
            Err(rounds) => rounds,
        };
        let found = self.by_projection((body, pose), tolerance, spent, warm);
        let is_narrow = found.upper - found.lower <= tolerance;
        if is_narrow || self.is_decided(&found) { Ok(found) } else { Err(found.iterations) }
    }

    /// By the projection of the axis on the body, which is asked for a bracket of this width,
    /// metres, after so many steps.
    fn by_projection(
        &self,
        (body, pose): At<'_, Body>,
        width: f64,
        spent: u32,
        warm: &mut WarmStart,
    ) -> CapsuleDistance {
        let goal = self.goal.beyond_radius(self.capsule.radius_m());
        let SeenAxis { origin, center, half_axis, error } = self.axis(pose);
        let pose = pose.with_translation(Vector3::zeros());
        let wants_normal = self.goal.wants_answer();
        let projection = if wants_normal { Projection::new(body, &pose) } else { Projection::rough(body, &pose) };
        let segment = Segment { center, half_axis };
        // The radius is subtracted with rounding.
        let found = projection.to_segment((&segment, error), (0.5 * width, &goal), (spent, self.options), warm);
        if found.upper == 0.0 {
            return self.met(&(found.nearest + origin), found.iterations);
        }
        let witnesses = [found.witness + origin, found.nearest + origin];
        let answer = self.apart([found.lower, found.upper], witnesses, -found.normal, found.iterations);
        // How deep an axis is that is not proven outside is not known.
        let unknown = CapsuleDistance { lower: f64::NEG_INFINITY, status: Status::BracketWide, ..answer };
        if found.lower > 0.0 { answer } else { unknown }
    }

    /// The axis as seen from the translation of a pose, for the sake of digits.
    fn axis(&self, pose: &Pose) -> SeenAxis {
        let origin = *pose.translation();
        let center = self.capsule_pose.translation() - origin;
        let half = self.capsule.half_height_m();
        let half_axis = self.capsule_pose.transform_direction(&Vector3::z()) * half;
        let error = f64::EPSILON * center.norm() + (ROTATION_ERROR + CULLING_SLACK) * half;
        SeenAxis { origin, center, half_axis, error }
    }

    /// Of a closed form where its body stands.
    ///
    /// # Errors
    /// After how many steps nothing is proven.
    fn of_shape(&self, of_body: (&ClosedForm, &Pose), warm: &mut WarmStart) -> Result<CapsuleDistance, u32> {
        let ((_, pose), form_pose, goal) = (of_body, self.capsule_pose, &self.goal);
        let form = self.capsule.closed_form();
        let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose.transform_point(x_a)) } else { None };
        let effort = (self.tolerance, self.options);
        let found = between_shapes(of_body, (&form, form_pose), start.as_ref(), goal, effort)?;
        let ShapeDistance { lower, upper, witness_a, witness_b, normal, steps, .. } = found;
        let x_a = pose.rotation().inverse_transform_vector(&(witness_a - pose.translation()));
        warm.hint = Hint::Shapes { x_a };
        if normal == Vector3::zeros() {
            let status = Status::of(upper - lower <= self.tolerance);
            return Ok(CapsuleDistance { status, lower, upper, ..self.met(&witness_a, steps) });
        }
        Ok(CapsuleDistance {
            status: Status::of(upper - lower <= self.tolerance),
            lower,
            upper,
            witness: witness_a,
            witness_of_capsule: witness_b,
            normal: Some(normal),
            tied: false,
            iterations: steps,
        })
    }

    /// An answer by the distance from the axis.
    fn apart(
        &self,
        [lower, upper]: [f64; 2],
        [witness, on_axis]: [Vector3<f64>; 2],
        normal: Vector3<f64>,
        iterations: u32,
    ) -> CapsuleDistance {
        let radius = self.capsule.radius_m();
        let rounding = |bound: f64| f64::EPSILON * (radius + bound);
        let (lower, upper) = (lower - radius - rounding(lower), upper - radius + rounding(upper));
        let witness_of_capsule = on_axis + normal * radius;
        let status = Status::of(upper - lower <= self.tolerance);
        CapsuleDistance {
            status,
            lower,
            upper,
            witness,
            witness_of_capsule,
            // None where the distance of the axis is below rounding.
            normal: Some(normal).filter(|normal| *normal != Vector3::zeros()),
            tied: false,
            iterations,
        }
    }

    /// The answer where a point of the axis lies in the body.
    fn met(&self, point: &Vector3<f64>, iterations: u32) -> CapsuleDistance {
        CapsuleDistance {
            status: Status::BracketWide,
            lower: f64::NEG_INFINITY,
            upper: -self.capsule.radius_m(),
            witness: *point,
            witness_of_capsule: *point,
            normal: None,
            tied: false,
            iterations,
        }
    }

    /// What is known by the way from a place on the axis, whose middle is at `center`, to the
    /// body's interior point.
    fn towards_interior(
        &self,
        (body, pose): At<'_, Body>,
        (center, at): (&Vector3<f64>, f64),
        iterations: u32,
    ) -> CapsuleDistance {
        let (place, interior) = (Vector3::new(0.0, 0.0, at), body.interior_point());
        let capsule_pose = self.capsule_pose.with_translation(*center);
        let (way, apart, error) = across((pose, interior), (&capsule_pose, &place));
        let (radius, normal) = (self.capsule.radius_m(), way.try_normalize(0.0));
        let on_axis = capsule_pose.transform_point(&place);
        let rounding = f64::EPSILON * (center.norm() + apart);
        CapsuleDistance {
            upper: (apart + error + rounding) * (1.0 + f64::EPSILON) - radius,
            witness_of_capsule: on_axis + normal.unwrap_or_default() * radius,
            normal,
            ..self.met(&pose.transform_point(interior), iterations)
        }
    }

    /// By the distances of points of the axis, after this number of steps.
    fn along_axis(&self, (body, pose): At<'_, Body>, spent: u32, warm: &mut WarmStart) -> CapsuleDistance {
        let SeenAxis { origin, center, error, .. } = self.axis(pose);
        let pose = pose.with_translation(Vector3::zeros());
        let (axis, half) = (self.capsule_pose.transform_direction(&Vector3::z()), self.capsule.half_height_m());
        let radius = self.capsule.radius_m();
        let goal_of_axis = self.goal.beyond_radius(radius);
        let wants_normal = self.goal.wants_answer();
        let projection = if wants_normal { Projection::new(body, &pose) } else { Projection::rough(body, &pose) };
        let projection = projection.without_newton();
        // Places where the distance decreases towards the other one, with tangents that bound it.
        let mut ends: [Option<Tangent>; 2] = [None, None];
        let (mut lower, mut iterations) = (f64::NEG_INFINITY, spent);
        let mut at = axis.dot(&(pose.transform_point(body.interior_point()) - center)).clamp(-half, half);
        let mut best = self.towards_interior((body, &pose), (&center, at), spent);
        // How much the distance falls along the axis where it is the best.
        let (mut slant, mut more) = (f64::INFINITY, 0);
        for _ in 0..if runs(Stage::AlongAxis) { MAX_PLACES } else { 0 } {
            if self.options.exhausted(iterations) {
                break;
            }
            let point = center + axis * at;
            let found = projection.to(&point, self.tolerance * 0.25, &self.options.after(iterations), warm);
            iterations += found.iterations;
            if found.upper <= 0.0 {
                best = CapsuleDistance { upper: error - radius, ..self.met(&point, iterations) };
                lower = f64::NEG_INFINITY;
                break;
            }
            let here = self.apart([0.0, found.upper + error], [found.witness, point], -found.normal, iterations);
            // Far away the place counts, not the angle.
            let far = if half > 0.0 { (found.upper / half).max(1.0) } else { 1.0 };
            let fall = fall_within(found.normal.dot(&axis), at, half) * far;
            let is_better = if more == 0 {
                here.upper < best.upper
            } else {
                here.upper + radius - lower <= self.tolerance && fall < slant
            };
            if is_better {
                (best, slant) = (here, fall);
            }
            // One that does not separate is no bound.
            if found.lower > 0.0 {
                let tangent = Tangent { at, lower: found.lower - error, slope: found.plane.dot(&axis) };
                ends[usize::from(tangent.slope > 0.0)] = Some(tangent);
            }
            let (bound, next) = Tangent::least(&ends, half);
            lower = bound.max(lower);
            let narrow = best.upper + radius - lower <= self.tolerance;
            let met = goal_of_axis.met(lower, best.upper + radius);
            if narrow && (!wants_normal || slant <= LEVEL || more == MORE_PLACES) || met || next == at {
                break;
            }
            more += u32::from(narrow);
            // Where the derivative vanishes by the last two, and by turns where the tangents meet.
            at = Tangent::level(&ends).filter(|_| more % 2 == 1).unwrap_or(next);
        }
        // How deep an axis is that is not proven outside is not known.
        let lower = if lower > 0.0 { lower - radius * (1.0 + f64::EPSILON) } else { f64::NEG_INFINITY };
        let status = Status::of(best.upper - lower <= self.tolerance);
        let (witness, witness_of_capsule) = (best.witness + origin, best.witness_of_capsule + origin);
        CapsuleDistance { status, lower, witness, witness_of_capsule, iterations, ..best }
    }
}

/// How much a distance of this slope falls towards another place of an axis, whose half length is
/// `half`: 0 at an end that is the nearest place.
fn fall_within(slope: f64, at: f64, half: f64) -> f64 {
    let is_end = slope > 0.0 && at <= -half || slope < 0.0 && at >= half;
    if is_end { 0.0 } else { slope.abs() }
}

/// A line below the distance along an axis.
#[derive(Clone, Copy)]
struct Tangent {
    at: f64,
    lower: f64,
    slope: f64,
}

impl Tangent {
    fn value(&self, at: f64) -> f64 {
        self.lower + self.slope * (at - self.at)
    }

    /// About where the derivative vanishes between two places: as if it were linear.
    fn level(ends: &[Option<Self>; 2]) -> Option<f64> {
        let [Some(low), Some(high)] = ends else { return None };
        let at = low.at - low.slope * (high.at - low.at) / (high.slope - low.slope);
        at.is_finite().then_some(at)
    }

    /// The least value of a convex function above a decreasing and an increasing line, or above the
    /// one there is, between minus and plus `half`; and where that is.
    fn least([falling, rising]: &[Option<Self>; 2], half: f64) -> (f64, f64) {
        match (falling, rising) {
            (Some(low), Some(high)) => {
                let steep = high.slope - low.slope;
                let crossing = (low.lower - high.lower + high.slope * high.at - low.slope * low.at) / steep;
                let at = if steep > 0.0 { crossing.max(-half).min(half) } else { 0.5 * (low.at + high.at) };
                (low.value(at).max(high.value(at)), at)
            }
            (Some(low), None) => (low.value(half), half),
            (None, Some(high)) => (high.value(-half), -half),
            (None, None) => (f64::NEG_INFINITY, 0.0),
        }
    }
}
