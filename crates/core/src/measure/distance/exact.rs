//! The distance of a body with a closed form from a smooth one, whichever comes first, or from
//! another with a closed form.

use super::answer::Distance;
use super::balls::of_balls;
use crate::body::{Body, ClosedForm};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::exact_shape::{
    ExactContact, ExactLost, ExactProven, ExactQuery, ExactTrace, ShapeDistance, active, between_shapes,
    direction_to_world, to_world,
};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// A pair of bodies, one of them smooth, the other with a closed form.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Exact<'a> {
    smooth: (&'a Body, &'a Pose),
    other: (&'a Body, &'a Pose),
    form: &'a ClosedForm,
    /// Whether the smooth body is the second one.
    swapped: bool,
}

impl<'a> Exact<'a> {
    /// The pair, if it is one. Balls are left to continuation, which is as fast.
    #[inline(always)]
    pub(in crate::measure) fn new(of_a: (&'a Body, &'a Pose), of_b: (&'a Body, &'a Pose)) -> Option<Self> {
        let (swapped, smooth, other) = match (of_a.0.is_smooth(), of_b.0.is_smooth()) {
            (true, false) => (false, of_a, of_b),
            (false, true) => (true, of_b, of_a),
            _ => return None,
        };
        let form = other.0.closed_form()?;
        Some(Self { smooth, other, form, swapped })
    }

    /// The answer with its hint.
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
    ) -> Result<(Distance, WarmStart), (u32, WarmStart)> {
        let Self { smooth: (body, pose), other: (other, form_pose), form, swapped } = *self;
        let tolerance = options.accuracy() * body.circumscribed().radius.min(other.circumscribed().radius);
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
        match dispatch(ExactQuery { body, pose, form, form_pose, goal, tolerance, options, trace }) {
            Ok(found) => Ok((self.answer(&found, tolerance), self.hint(&found))),
            Err(ExactLost { rounds, about }) => {
                Err((rounds, about.map_or_else(WarmStart::default, |about| self.general_hint(&about))))
            }
        }
    }

    /// Whether the bodies overlap, decided without their distance.
    ///
    /// # Errors
    /// After how many evaluations it cannot.
    pub(super) fn contact(&self, options: &Options<'_>, warm: &mut WarmStart) -> Result<Distance, u32> {
        let Self { smooth: (body, pose), other: (_, form_pose), form, .. } = *self;
        if options.exhausted(0) {
            return Err(0);
        }
        let found = dispatch(ExactContact { body, pose, form, form_pose, options })?;
        if found.upper == 0.0 {
            *warm = self.hint(&found);
        }
        Ok(self.answer(&found, 0.0))
    }

    pub(in crate::measure) fn answer(&self, found: &ExactProven, tolerance: f64) -> Distance {
        let Self { other: (_, pose), form, swapped, .. } = *self;
        let (x, y) = (to_world(form, pose, found.x), to_world(form, pose, found.nearest));
        let status = Status::of(found.upper - found.lower <= tolerance);
        let answer = Distance {
            status,
            lower: found.lower,
            upper: found.upper,
            iterations: found.rounds,
            ..Distance::default()
        };
        if found.upper == 0.0 {
            return Distance { witness_a: x, witness_b: x, ..answer };
        }
        let normal = direction_to_world(form, pose, found.n);
        let of_smooth = ActiveConstraints::single(0, found.multiplier);
        let of_form = active(form.shape(), found.n);
        if swapped {
            let (active_a, active_b) = (of_form, of_smooth);
            Distance { witness_a: y, witness_b: x, normal: Some(-normal), active_a, active_b, ..answer }
        } else {
            let (active_a, active_b) = (of_smooth, of_form);
            Distance { witness_a: x, witness_b: y, normal: Some(normal), active_a, active_b, ..answer }
        }
    }

    /// A hint for the general search.
    #[cold]
    fn general_hint(&self, about: &ExactProven) -> WarmStart {
        let Self { smooth, other, form, swapped } = *self;
        let own = |pose: &Pose, point: [f64; 3]| {
            pose.rotation().inverse_transform_vector(&(to_world(form, other.1, point) - pose.translation()))
        };
        let (x, y) = (own(smooth.1, about.x), own(other.1, about.nearest));
        let of_form = active(form.shape(), about.n).iter().fold(0, |bits, (index, _)| bits | 1 << index);
        let normal = direction_to_world(form, other.1, about.n);
        let into_a = |pose: &Pose, n: Vector3<f64>| pose.rotation().inverse_transform_vector(&n);
        if swapped {
            let normal_a = into_a(other.1, -normal);
            Hint::Apart { x_a: y, y_b: x, normal_a, active_a: of_form, active_b: 1 }.into()
        } else {
            Hint::Apart { x_a: x, y_b: y, normal_a: into_a(smooth.1, normal), active_a: 1, active_b: of_form }.into()
        }
    }

    fn hint(&self, found: &ExactProven) -> WarmStart {
        match found.trace {
            Some(trace) => Hint::Exact(trace).into(),
            None => {
                // A common point, in the frame of the first body.
                let Self { smooth, other, form, swapped } = *self;
                let world: Vector3<f64> = to_world(form, other.1, found.x);
                let (_, pose_a) = if swapped { other } else { smooth };
                let point_a = pose_a.rotation().inverse_transform_vector(&(world - pose_a.translation()));
                Hint::Overlap { point_a }.into()
            }
        }
    }
}

/// The distance of two bodies that both have closed forms; none if one has not.
///
/// # Errors
/// After how many steps it is not proven.
#[inline(always)]
pub(super) fn of_shapes(
    (a, pose_a): (&Body, &Pose),
    (b, pose_b): (&Body, &Pose),
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Option<Result<Distance, u32>> {
    let (form_a, form_b) = (a.closed_form()?, b.closed_form()?);
    if let Some(found) = of_balls((form_a, pose_a), (form_b, pose_b), options) {
        *warm = Hint::Shapes { x_a: *form_a.center() }.into();
        return Some(Ok(found));
    }
    let tolerance = options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
    let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose_a.transform_point(x_a)) } else { None };
    let found = match between_shapes((form_a, pose_a), (form_b, pose_b), start.as_ref(), (tolerance, options)) {
        Ok(found) => found,
        Err(steps) => return Some(Err(steps)),
    };
    let ShapeDistance { lower, upper, common, witness_a, witness_b, normal, own_normals: [of_a, of_b], steps } = found;
    let point_a = pose_a.rotation().inverse_transform_vector(&(witness_a - pose_a.translation()));
    *warm = Hint::Shapes { x_a: point_a }.into();
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
        return Some(Err(steps));
    }
    let (active_a, active_b) = (active(form_a.shape(), of_a), active(form_b.shape(), of_b));
    Some(Ok(Distance { normal: Some(normal), active_a, active_b, ..answer }))
}
