//! The distance of a body with a closed form from one without, whichever comes first, or from
//! another with a closed form.

use super::answer::Distance;
use super::balls::{of_ball_beside, of_balls};
use crate::body::{Body, ClosedForm};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::V3;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::edge_newton::{EdgeShapeProven, EdgeShapeQuery, EdgeShapeStart};
use crate::measure::solver::exact_shape::{
    ExactContact, ExactLost, ExactProven, ExactQuery, ExactTrace, ShapeDistance, active, between_shapes, common,
    direction_to_world, to_world,
};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// A pair of bodies, one of them with a closed form, the other without.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Exact<'a> {
    /// Without one.
    free: (&'a Body, &'a Pose),
    /// With one.
    shape: (&'a Body, &'a Pose),
    form: &'a ClosedForm,
    /// Whether the shape is the first one.
    swapped: bool,
}

impl<'a> Exact<'a> {
    /// The pair, if it is one and the body without a closed form is smooth. Balls are left to
    /// continuation, which is as fast.
    #[inline(always)]
    pub(in crate::measure) fn new(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose)) -> Option<Self> {
        let (swapped, free, shape) = match (of_a.0.is_smooth(), of_b.0.is_smooth()) {
            (true, false) => (false, of_a, of_b),
            (false, true) => (true, of_b, of_a),
            _ => return None,
        };
        let form = shape.0.closed_form()?;
        Some(Self { free, shape, form, swapped })
    }

    /// The same, or two balls, of which the first counts as the one without a closed form.
    #[inline(always)]
    pub(in crate::measure) fn beside_form(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose)) -> Option<Self> {
        let balls = || Some(Self { free: of_a, shape: of_b, form: of_b.0.closed_form()?, swapped: false });
        Self::new(of_a, of_b).or_else(balls)
    }

    /// The pair, if it is one and both have edges.
    pub(super) fn edged(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose)) -> Option<Self> {
        if of_a.0.is_smooth() || of_b.0.is_smooth() {
            return None;
        }
        match (of_a.0.closed_form(), of_b.0.closed_form()) {
            (None, Some(form)) => Some(Self { free: of_a, shape: of_b, form, swapped: false }),
            (Some(form), None) => Some(Self { free: of_b, shape: of_a, form, swapped: true }),
            _ => None,
        }
    }

    /// The answer with its hint, for a smooth body.
    ///
    /// # Errors
    /// After how many evaluations the general search has to go on, with a hint where to.
    // There is no allocation in a solve.
    #[allow(clippy::result_large_err)]
    pub(super) fn distance(
        &self,
        goal: &StopCriterion,
        options: &Options<'_>,
        hint: &Hint,
    ) -> Result<(Distance, Hint), (u32, Hint)> {
        let Self { free: (body, pose), shape: (_, form_pose), form, swapped } = *self;
        let tolerance = self.tolerance(options);
        let witness;
        let trace = match hint {
            Hint::Exact(trace) => Some(trace),
            // What the general search has found.
            Hint::Apart { x_a, y_b, .. } => {
                witness = ExactTrace::at(body, if swapped { y_b } else { x_a });
                Some(&witness)
            }
            _ => None,
        };
        match dispatch(ExactQuery { body, pose, form, form_pose, goal, tolerance, options, trace, facing: None }) {
            Ok(found) => Ok((self.answer(&found, tolerance), self.hint(&found))),
            Err(ExactLost { rounds, about }) => {
                Err((rounds, about.map_or(Hint::Cold, |about| self.general_hint(&about))))
            }
        }
    }

    /// The answer with its hint, for a body with edges.
    ///
    /// # Errors
    /// After how many evaluations the general search has to go on.
    pub(super) fn distance_of_edges(
        &self,
        goal: &StopCriterion,
        options: &Options<'_>,
        warm: &mut WarmStart,
    ) -> Result<Distance, u32> {
        let Self { free: (body, pose), shape: (other, form_pose), form, swapped } = *self;
        let tolerance = self.tolerance(options);
        let (a, b) = if swapped { (other, body) } else { (body, other) };
        let start = match (&warm.hint, warm.hint.witnesses(a, b)) {
            (Hint::EdgeShape(trace), _) => EdgeShapeStart::Last(trace),
            // What other methods have found.
            (_, Some([x_a, y_b])) => EdgeShapeStart::Witness(if swapped { y_b } else { x_a }),
            _ => EdgeShapeStart::Cold,
        };
        let found = dispatch(EdgeShapeQuery { body, pose, form, form_pose, goal, tolerance, options, start })?;
        let EdgeShapeProven { lower, upper, x, nearest, n, active, rounds, trace } = found;
        let Some(trace) = trace else {
            let found = common(x, rounds);
            warm.hint = self.hint(&found);
            return Ok(self.answer(&found, tolerance));
        };
        warm.hint = Hint::EdgeShape(trace);
        let bracket = Distance { lower, upper, iterations: rounds, ..Distance::default() };
        Ok(self.attained(bracket, tolerance, ([x, nearest, n], active)))
    }

    /// Width of the bracket that is narrow enough, metres.
    #[inline(always)]
    fn tolerance(&self, options: &Options<'_>) -> f64 {
        let [free, shape] = [self.free, self.shape].map(|(body, _)| body.circumscribed().radius);
        options.accuracy() * free.min(shape)
    }

    /// Whether the bodies overlap, decided without their distance, for a smooth body.
    ///
    /// # Errors
    /// After how many evaluations it cannot.
    pub(super) fn contact(&self, options: &Options<'_>, warm: &mut WarmStart) -> Result<Distance, u32> {
        let Self { free: (body, pose), shape: (_, form_pose), form, .. } = *self;
        if options.exhausted(0) {
            return Err(0);
        }
        let found = dispatch(ExactContact { body, pose, form, form_pose, options })?;
        if found.upper == 0.0 {
            warm.hint = self.hint(&found);
        }
        Ok(self.answer(&found, 0.0))
    }

    pub(in crate::measure) fn answer(&self, found: &ExactProven, tolerance: f64) -> Distance {
        let ExactProven { lower, upper, x, nearest, n, multiplier, rounds, .. } = *found;
        let bracket = Distance { lower, upper, iterations: rounds, ..Distance::default() };
        if upper == 0.0 {
            let witness = to_world(self.form, self.shape.1, x);
            let status = Status::of(upper - lower <= tolerance);
            return Distance { status, witness_a: witness, witness_b: witness, ..bracket };
        }
        self.attained(bracket, tolerance, ([x, nearest, n], ActiveConstraints::single(0, multiplier)))
    }

    /// A bracket as an answer, with the points of the body and of the shape and the normal from the
    /// one to the other, in the frame of the shape, and the body's constraints.
    #[inline(always)]
    fn attained(
        &self,
        bracket: Distance,
        tolerance: f64,
        ([x, nearest, n], of_free): ([V3<f64>; 3], ActiveConstraints),
    ) -> Distance {
        let Self { shape: (_, pose), form, swapped, .. } = *self;
        let (x, y) = (to_world(form, pose, x), to_world(form, pose, nearest));
        let answer = Distance { status: Status::of(bracket.upper - bracket.lower <= tolerance), ..bracket };
        let normal = direction_to_world(form, pose, n);
        let of_form = active(form.shape(), n);
        if swapped {
            let (active_a, active_b) = (of_form, of_free);
            Distance { witness_a: y, witness_b: x, normal: Some(-normal), active_a, active_b, ..answer }
        } else {
            let (active_a, active_b) = (of_free, of_form);
            Distance { witness_a: x, witness_b: y, normal: Some(normal), active_a, active_b, ..answer }
        }
    }

    /// A hint for the general search.
    #[cold]
    fn general_hint(&self, about: &ExactProven) -> Hint {
        let Self { free, shape, form, swapped } = *self;
        let own = |pose: &Pose, point: [f64; 3]| {
            pose.rotation().inverse_transform_vector(&(to_world(form, shape.1, point) - pose.translation()))
        };
        let (x, y) = (own(free.1, about.x), own(shape.1, about.nearest));
        let of_form = active(form.shape(), about.n).iter().fold(0, |bits, (index, _)| bits | 1 << index);
        let normal = direction_to_world(form, shape.1, about.n);
        let into_a = |pose: &Pose, n: Vector3<f64>| pose.rotation().inverse_transform_vector(&n);
        if swapped {
            let normal_a = into_a(shape.1, -normal);
            Hint::Apart { x_a: y, y_b: x, normal_a, active_a: of_form, active_b: 1 }
        } else {
            Hint::Apart { x_a: x, y_b: y, normal_a: into_a(free.1, normal), active_a: 1, active_b: of_form }
        }
    }

    fn hint(&self, found: &ExactProven) -> Hint {
        match found.trace {
            Some(trace) => Hint::Exact(trace),
            None => {
                // A common point, in the frame of the first body.
                let Self { free, shape, form, swapped } = *self;
                let world: Vector3<f64> = to_world(form, shape.1, found.x);
                let (_, pose_a) = if swapped { shape } else { free };
                let point_a = pose_a.rotation().inverse_transform_vector(&(world - pose_a.translation()));
                Hint::Overlap { point_a }
            }
        }
    }
}

/// The distance of two bodies that both have closed forms, or as much of it as the goal needs; none
/// if one has not.
///
/// # Errors
/// After how many steps it is not proven.
#[inline(always)]
pub(super) fn of_shapes(
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
    (goal, options): (&StopCriterion, &Options<'_>),
    warm: &mut WarmStart,
) -> Option<Result<Distance, u32>> {
    let (form_a, form_b) = (a.closed_form()?, b.closed_form()?);
    let (of_a, of_b) = ((form_a, pose_a), (form_b, pose_b));
    if let Some(found) = of_balls(of_a, of_b, options).or_else(|| of_ball_beside(of_a, of_b, options)) {
        warm.hint = Hint::Shapes { x_a: *form_a.center() };
        return Some(Ok(found));
    }
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose_a.transform_point(x_a)) } else { None };
    let found = match between_shapes(of_a, of_b, start.as_ref(), goal, (tolerance, options)) {
        Ok(found) => found,
        Err(steps) => return Some(Err(steps)),
    };
    let ShapeDistance { lower, upper, common, witness_a, witness_b, normal, own_normals: [of_a, of_b], steps } = found;
    let point_a = pose_a.rotation().inverse_transform_vector(&(witness_a - pose_a.translation()));
    warm.hint = Hint::Shapes { x_a: point_a };
    let answer = Distance {
        status: Status::of(upper.max(0.0) - lower.max(0.0) <= tolerance),
        lower: lower.max(0.0),
        upper: upper.max(0.0),
        witness_a,
        witness_b,
        iterations: steps,
        ..Distance::default()
    };
    if upper <= 0.0 {
        return Some(Ok(Distance { witness_a: common, witness_b: common, ..answer }));
    }
    if normal == Vector3::zeros() {
        // So near that no direction is known.
        return Some(if goal.met(answer.lower, answer.upper) { Ok(answer) } else { Err(steps) });
    }
    let (active_a, active_b) = (active(form_a.shape(), of_a), active(form_b.shape(), of_b));
    Some(Ok(Distance { normal: Some(normal), active_a, active_b, ..answer }))
}
