//! Distance from a body to a point, or to a segment: its projection on the body.
//!
//! For the unit vector n along `Σ λ_i ∇g_i(y)`, every point y' of the body has
//! `n·(q - y') >= n·(q - y) - deficit`, with the support deficit of
//! [`crate::measure::bounds::duality_bounds::descent`]; so the plane through y with the normal n
//! separates q from the body by as much, and the segment of the points within a half axis h of q by
//! `|n·h|` less. The program of a point stays regular through contact: its Hessian is the identity
//! plus what the body's curvature adds. That of a segment has no curvature along the axis of its
//! own.

use crate::body::{Ball, Body, ClosedForm, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, descent};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::query_frame::Posed;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, bracketed, nearest_part};
use crate::measure::solver::edge_newton::{EdgeShapeProven, EdgeShapeQuery, EdgeShapeStart};
use crate::measure::solver::exact_shape::{
    ExactQuery, PointOffset, PointSide, direction_to_world, offset_of_point, to_world,
};
use crate::measure::solver::projection::{
    Objective, Segment, Single, SingleProblem, Start, Trial, Worth, solve_single,
};
use crate::measure::solver::refinement::{Refined, RefinedAxis, RefinedOffset};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{dispatch, gamma};
use nalgebra::Vector3;
use std::cell::OnceCell;

/// Distance of a body from a point with its proof; lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct PointDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; 0 when the point is not proven outside.
    pub lower: f64,
    /// Proven upper bound, which the witness attains; 0 when the point is proven inside.
    pub upper: f64,
    /// Whether the point is proven to lie in the body; the distance is then 0, and depth is not
    /// measured.
    pub inside: bool,
    /// The nearest point of the body; the point itself if it is inside.
    pub witness: Vector3<f64>,
    /// Unit normal from the body to the point, at the witness; none inside.
    pub normal: Option<Vector3<f64>>,
    /// Whether another part may be as near, their brackets meeting: witness, normal and gradient
    /// may then jump. Never for single bodies, nor inside.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl PointDistance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Gradient with respect to the pose the distance was asked for; that with respect to the point
    /// is `normal`. By the envelope theorem the witness counts as fixed to the body: `-n` and
    /// `-(y - t) × n`. None unless the point is proven outside.
    pub fn pose_gradient(&self, pose: &Pose) -> Option<Twist> {
        self.normal.filter(|_| self.lower > 0.0).map(|n| Twist::of_gradient(-n, &self.witness, pose.translation()))
    }
}

/// A point that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the point is not finite, or beyond 1e15 m")]
pub struct PointError;

/// Euclidean distance of a solid at `pose` from `point` (world frame, metres), 0 when the point is
/// inside.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next point.
///
/// # Errors
/// A point that is not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance_to_point};
///
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let mut warm = WarmStart::default();
/// let point = Vector3::new(4.0, 5.0, 0.5);
/// let answer = distance_to_point(&crate_, &Pose::identity(), &point, &Options::default(), &mut warm)?;
/// assert!((answer.value() - 5.0).abs() < 1e-8);
/// assert!((answer.witness - Vector3::new(1.0, 1.0, 0.5)).norm() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_point(
    solid: &impl Solid,
    pose: &Pose,
    point: &Vector3<f64>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<PointDistance, PointError> {
    // Not `>`: a NaN is refused too.
    if !(point.amax() <= 1e15 && point.iter().all(|value| value.is_finite())) {
        return Err(PointError);
    }
    let tolerance = options.accuracy() * solid.circumscribed().radius;
    Ok(match solid.parts() {
        [body] => {
            let projection = Projection::new(body, pose);
            let found = projection.to(point, tolerance, options, warm);
            projection.refined(found, point, tolerance, options).into_distance(tolerance)
        }
        _ => nearest((solid, pose), point, tolerance, options, warm),
    })
}

/// The nearest part.
fn nearest(
    (solid, pose): At<'_, impl Solid>,
    point: &Vector3<f64>,
    tolerance: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> PointDistance {
    let seen = pose.rotation().inverse_transform_vector(&(point - pose.translation()));
    let error = (ROTATION_ERROR + gamma(16)) * seen.norm();
    let bound = |ball: &Ball| {
        let apart = (seen - ball.center).norm();
        apart - ball.radius - error - CULLING_SLACK * (apart + ball.radius + ball.center.norm())
    };
    let (parts, end) = (solid.parts(), StopCriterion { near: 0.0, ..StopCriterion::NARROW });
    let found = nearest_part(solid, bound, &end, warm, |part, upper, hint| {
        let projection = Projection::new(&parts[part], pose);
        let found = projection.to(point, tolerance, options, hint);
        if found.lower > upper { found } else { projection.refined(found, point, tolerance, options) }
    });
    let Least { best, lower, tied, iterations, .. } = found;
    let answer = Projected { lower, iterations, ..best }.into_distance(tolerance);
    PointDistance { tied: tied && !answer.inside, ..answer }
}

/// A body to project points on.
pub(super) struct Projection<'a> {
    body: &'a Body,
    pose: Pose,
    /// Where no closed form has the answer.
    single: OnceCell<Single<'a>>,
    /// Whether a narrow bracket is all that is asked for.
    is_rough: bool,
    /// Whether Newton's method against shapes is tried first.
    has_newton: bool,
}

/// Angle between the normal of the surface at the witness and the way to the point, radians, up to
/// which both count as those of the solution: Newton's method ends far below it.
///
/// A larger value lets gradients be off by more than 1e-6, most of all those of flat bodies far
/// away, whose witness is off by this times the radius of curvature; a smaller one spends steps on
/// rounding. Exercised by `family_20_gradients_of_primitives`.
const FACING: f64 = 1e-8;

/// What a projection found; metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Unit vector along which the lower bound separates the point from the body; zero if there is
    /// none.
    pub(super) plane: Vector3<f64>,
    /// About the normal of the surface at the witness, of length 1.
    pub(super) normal: Vector3<f64>,
    /// Attains the upper bound.
    pub(super) witness: Vector3<f64>,
    /// The point itself, or that of the segment nearest to the witness; one that lies in the body
    /// where the upper bound is 0.
    pub(super) nearest: Vector3<f64>,
    pub(super) iterations: u32,
}

impl Projected {
    fn inside(point: &Vector3<f64>, iterations: u32) -> Self {
        let (plane, normal) = (Vector3::zeros(), Vector3::zeros());
        Self { lower: 0.0, upper: 0.0, plane, normal, witness: *point, nearest: *point, iterations }
    }

    fn into_distance(self, tolerance: f64) -> PointDistance {
        let inside = self.upper == 0.0;
        PointDistance {
            status: Status::of(self.upper - self.lower <= tolerance),
            lower: self.lower,
            upper: self.upper,
            inside,
            witness: self.witness,
            normal: if inside { None } else { self.normal.try_normalize(0.0) },
            tied: false,
            iterations: self.iterations,
        }
    }
}

impl<'a> Projection<'a> {
    pub(super) fn new(body: &'a Body, pose: &Pose) -> Self {
        Self { body, pose: *pose, single: OnceCell::new(), is_rough: false, has_newton: true }
    }

    /// The same for those who need the bracket alone: a step or two less.
    pub(super) fn rough(body: &'a Body, pose: &Pose) -> Self {
        Self { is_rough: true, ..Self::new(body, pose) }
    }

    /// The same without Newton's method against shapes, where it has failed.
    pub(super) fn without_newton(self) -> Self {
        Self { has_newton: false, ..self }
    }

    pub(super) fn to(
        &self,
        point: &Vector3<f64>,
        tolerance: f64,
        options: &Options<'_>,
        warm: &mut WarmStart,
    ) -> Projected {
        if let Some(form) = self.body.closed_form().filter(|_| runs(Stage::ClosedForm)) {
            warm.hint = Hint::Cold;
            match offset_of_point((form, &self.pose), point) {
                PointSide::Inside => return Projected::inside(point, 0),
                PointSide::Outside(PointOffset { lower, upper, normal, witness, .. }) => {
                    let nearest = *point;
                    return Projected { lower, upper, plane: normal, normal, witness, nearest, iterations: 0 };
                }
                PointSide::Open => {}
            }
        }
        let spent = match self.by_newton(point, tolerance, options, warm) {
            Ok(found) => return found,
            Err(spent) => spent,
        };
        let segment = Segment { center: *point, half_axis: Vector3::zeros() };
        self.to_segment((&segment, 0.0), (tolerance, &StopCriterion::NARROW), (spent, options), warm)
    }

    /// What was found of a point, in double-double arithmetic as well where rounding keeps it wider
    /// than the tolerance, metres.
    fn refined(&self, found: Projected, point: &Vector3<f64>, tolerance: f64, options: &Options<'_>) -> Projected {
        let is_narrow = found.upper - found.lower <= tolerance;
        if is_narrow || options.exhausted(found.iterations) || !runs(Stage::Refinement) {
            return found;
        }
        self.with_more_digits(found, point, tolerance, options)
    }

    #[cold]
    fn with_more_digits(
        &self,
        found: Projected,
        point: &Vector3<f64>,
        tolerance: f64,
        options: &Options<'_>,
    ) -> Projected {
        let single = self.single.get_or_init(|| Single::new(self.body, &self.pose));
        let axis = RefinedAxis::new(single, [0.0; 2], &Pose::identity().with_translation(*point));
        let (near, _) = single.to_query(&found.witness);
        let refined = axis.narrow([found.lower, found.upper], &near, tolerance, &options.after(found.iterations));
        let Refined { lower, upper, at, steps } = refined;
        let known = Projected { lower, upper, iterations: found.iterations + steps, ..found };
        let Some(RefinedOffset { x, n, .. }) = at else { return known };
        let normal = single.direction_to_world(&n);
        Projected { plane: normal, normal, witness: single.to_world(&x), ..known }
    }

    /// Of a segment of the world frame that is known up to an error, metres, without closed forms
    /// and Newton's method against shapes, after so many evaluations: until the bracket is as
    /// narrow as the tolerance, metres, or says what is asked.
    pub(super) fn to_segment(
        &self,
        (segment, off): (&Segment, f64),
        (tolerance, goal): (f64, &StopCriterion),
        (spent, options): (u32, &Options<'_>),
        warm: &mut WarmStart,
    ) -> Projected {
        let single = self.single.get_or_init(|| Single::new(self.body, &self.pose));
        let Single { body, unit, .. } = single;
        let (center, error) = single.to_query(&segment.center);
        let q = Segment { center, half_axis: single.direction_to_query(&segment.half_axis) / *unit };
        let error = error + (ROTATION_ERROR + gamma(16)) * q.half_axis.norm() + off / unit * (1.0 + f64::EPSILON);
        let first = q.nearest(&body.interior);
        if body.value_upper(&first, error) <= 1.0 {
            return Projected::inside(&segment.nearest(&single.to_world(&first)), spent);
        }
        let objective = Objective::Nearest(q);
        let is_point = q.half_axis == Vector3::zeros();
        let mut common = None;
        let start = match warm.hint {
            Hint::Single { y, active } if y.iter().all(|value| value.is_finite()) => {
                Start { y: single.body_to_query(&y), active }
            }
            _ => Start { y: single.table(&objective), active: 0 },
        };
        let (mut lower, mut upper, mut plane, mut witness) = (0.0_f64, f64::INFINITY, Vector3::zeros(), body.interior);
        // Of the point that its normal leads from to the segment best: how much that is off, the
        // normal, and how far it is.
        let mut facing: Option<(f64, Vector3<f64>, f64)> = None;
        let narrow = tolerance / unit;
        let in_metres = |bound: f64, side: f64| bound * unit * (1.0 + side * 4.0 * f64::EPSILON);
        let problem = SingleProblem { body, objective: &objective, start, other: None, narrow };
        let stop = |count| options.exhausted(spent + count);
        let (iterations, active) = solve_single(&problem, stop, |trial| {
            let (bound, n) = separation(body, &q, error, trial);
            if bound == 0.0 && !is_point {
                // The segment may lead through the body.
                common = point_inside(body, &q, &q.nearest(&trial.y), error);
                if common.is_some() {
                    return Worth::Done;
                }
            }
            if bound > lower || plane == Vector3::zeros() {
                (lower, plane) = (bound.max(0.0), n);
            }
            let Some(y) = body.move_inside(&trial.y) else { return Worth::Wide };
            let nearest = q.nearest(&y);
            let apart = (nearest - y).norm() + body.displacement(&y) + error;
            // The bracket says of normal and witness no more than its root: the solution is where
            // the surface's normal leads to the point.
            if !self.is_rough && n != Vector3::zeros() && apart - lower <= narrow {
                let off = (n - (nearest - y) / (nearest - y).norm()).norm();
                if facing.is_none_or(|(least, ..)| off < least) {
                    (facing, witness) = (Some((off, n, apart)), y);
                }
            }
            if apart < upper {
                upper = apart;
                witness = if facing.is_none() { y } else { witness };
            }
            if goal.met(in_metres(lower, -1.0), in_metres(upper, 1.0)) {
                return Worth::Done;
            }
            match upper - lower <= narrow {
                true if self.is_rough || facing.is_some_and(|(off, ..)| off <= FACING) => Worth::Done,
                true => Worth::Narrow,
                false => Worth::Wide,
            }
        });
        if let Some(common) = common {
            return Projected::inside(&segment.nearest(&single.to_world(&common)), spent + iterations);
        }
        let normal = facing.map_or(plane, |(_, n, _)| n);
        // As narrow as asked for, too, and what the witness attains.
        upper = facing.map_or(upper, |(.., apart)| apart);
        if upper == f64::INFINITY {
            // Stopped before the first trial point: the interior point is a point of the body.
            upper = (q.nearest(&witness) - witness).norm() + body.displacement(&witness) + error;
        }
        warm.hint = Hint::Single { y: single.to_body(&witness), active };
        Projected {
            lower: in_metres(lower, -1.0),
            upper: in_metres(upper, 1.0),
            plane: single.direction_to_world(&plane),
            normal: single.direction_to_world(&normal),
            witness: single.to_world(&witness),
            nearest: segment.nearest(&single.to_world(&witness)),
            iterations: spent + iterations,
        }
    }

    /// Whether a point is in the body's inscribed ball.
    fn is_near_interior_point(&self, point: &Vector3<f64>) -> bool {
        let (interior, offset) = (self.body.interior_point(), point - self.pose.translation());
        let apart = (self.pose.rotation().inverse_transform_vector(&offset) - interior).norm();
        apart + (ROTATION_ERROR + gamma(16)) * (offset.norm() + interior.norm()) < self.body.in_radius()
    }

    /// As that of a capsule of no size.
    ///
    /// # Errors
    /// After how many evaluations nothing is proven.
    fn by_newton(
        &self,
        point: &Vector3<f64>,
        tolerance: f64,
        options: &Options<'_>,
        warm: &mut WarmStart,
    ) -> Result<Projected, u32> {
        // A hint of the general search says that this method has failed before.
        let has_failed = matches!(warm.hint, Hint::Single { .. });
        if has_failed || !self.has_newton || !runs(Stage::ClosedForm) {
            return Err(0);
        }
        if self.is_near_interior_point(point) {
            return Ok(Projected::inside(point, 0));
        }
        let (form, form_pose) = (ClosedForm::capsule(0.0, 0.0), Pose::identity().with_translation(*point));
        let (body, pose, goal) = (self.body, &self.pose, &StopCriterion::NARROW);
        if !body.is_smooth() {
            let start = if let Hint::EdgeShape(trace) = &warm.hint {
                EdgeShapeStart::Last(trace)
            } else {
                EdgeShapeStart::Cold
            };
            let (form, form_pose) = (&form, &form_pose);
            let query = EdgeShapeQuery { body, pose, form, form_pose, goal, tolerance, options, start };
            let found = dispatch(query)?;
            let EdgeShapeProven { lower, upper, x, n, rounds, trace, .. } = found;
            warm.hint = trace.map_or(Hint::Cold, Hint::EdgeShape);
            if upper == 0.0 {
                return Ok(Projected::inside(point, rounds));
            }
            let (normal, witness) = (-direction_to_world(form, form_pose, n), to_world(form, form_pose, x));
            return Ok(Projected { lower, upper, plane: normal, normal, witness, nearest: *point, iterations: rounds });
        }
        let trace = if let Hint::Exact(trace) = &warm.hint { Some(trace) } else { None };
        let query = ExactQuery {
            body,
            pose,
            form: &form,
            form_pose: &form_pose,
            goal,
            tolerance,
            options,
            trace,
            facing: None,
        };
        let found = dispatch(query).map_err(|lost| lost.rounds)?;
        if found.upper == 0.0 {
            warm.hint = Hint::Cold;
            return Ok(Projected::inside(point, found.rounds));
        }
        warm.hint = found.trace.map_or(Hint::Cold, Hint::Exact);
        let normal = -direction_to_world(&form, &form_pose, found.n);
        Ok(Projected {
            lower: found.lower,
            upper: found.upper,
            plane: normal,
            normal,
            witness: to_world(&form, &form_pose, found.x),
            nearest: *point,
            iterations: found.rounds,
        })
    }
}

/// Steps along a segment from where it meets the surface of a body, relative to its size,
/// dimensionless: past what rounding leaves of the surface, and not past the other end of a short
/// way through the body. Other steps find other overlaps that are slim; none claims what is not
/// proven.
const INWARD: [f64; 4] = [0.0, 1e-9, 1e-6, 1e-3];

/// Largest value above 1 of the constraints at a point, dimensionless, from which such steps are
/// tried. It changes time only; no test pins it.
const ON_SURFACE: f64 = 1e-3;

/// A point of a segment, known up to an error, that is proven to lie in a body: one of it that
/// seems to be on the surface, or a little on from there along the segment, into the body.
fn point_inside(body: &Posed<'_>, segment: &Segment, point: &Vector3<f64>, error: f64) -> Option<Vector3<f64>> {
    let value = |i: &usize| body.value(*i, point);
    let highest = (0..body.len()).max_by(|i, j| value(i).total_cmp(&value(j)))?;
    if !(value(&highest) <= 1.0 + ON_SURFACE) {
        return None;
    }
    let axis = segment.half_axis.try_normalize(0.0)?;
    let inward = axis * -body.sample(highest, point).gradient().dot(&axis).signum();
    let along = INWARD.map(|step| segment.nearest(&(point + inward * step)));
    along.into_iter().find(|point| body.value_upper(point, error) <= 1.0)
}

/// Lower bound of the distance in query units from the plane normal to the trial's pull, and
/// that normal.
fn separation(body: &Posed<'_>, q: &Segment, error: f64, trial: &Trial) -> (f64, Vector3<f64>) {
    let length = trial.dual_gradient.norm();
    if !(length > 0.0 && length.is_finite()) {
        return (0.0, Vector3::zeros());
    }
    let n = trial.dual_gradient / length;
    let fall = descent(body, &trial.y, &-n, &trial.multipliers.map(|m| (m / length).max(0.0)));
    let size = q.center.norm() + q.half_axis.norm();
    let slack = DUALITY_ROUNDING * (size + trial.y.norm() + fall.abs());
    let bound =
        n.dot(&(q.center - trial.y)) - n.dot(&q.half_axis).abs() - fall - body.displacement(&trial.y) - error - slack;
    // Not `max`: a NaN bounds nothing.
    (if bound > 0.0 { bound } else { 0.0 }, n)
}

bracketed!(Projected);

#[cfg(test)]
mod tests;
