//! The signed distance of one body from a capsule: by closed forms, else along its axis.

use super::answer::CapsuleDistance;
use super::bounds::ball_and_plane;
use super::shape::Capsule;
use crate::body::{Body, ClosedForm};
use crate::measure::bounds::culling::{CULLING_SLACK, across};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::At;
use crate::measure::point::Projection;
use crate::measure::solver::exact_shape::{
    ExactProven, ExactQuery, ShapeDistance, between_shapes, direction_to_world, to_world,
};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// Most places along a segment at which the distance is taken.
const MAX_PLACES: u32 = 64;

/// A capsule where it stands, and how its distance is to be solved.
pub(super) struct Problem<'a> {
    pub(super) capsule: &'a Capsule,
    pub(super) capsule_pose: &'a Pose,
    /// Width of the bracket that is narrow enough, metres.
    pub(super) tolerance: f64,
    pub(super) options: &'a Options<'a>,
    /// What the signed distance is asked for.
    pub(super) goal: StopCriterion,
}

impl Problem<'_> {
    pub(super) fn solve(&self, of_body: At<'_, Body>, warm: &mut WarmStart) -> CapsuleDistance {
        let known = if self.goal.is_narrow() {
            [f64::NEG_INFINITY, f64::INFINITY]
        } else {
            ball_and_plane(of_body, (self.capsule, self.capsule_pose))
        };
        let found = if self.goal.met(known[0], known[1]) {
            CapsuleDistance { upper: f64::INFINITY, ..self.met(of_body.1.translation(), 0) }
        } else {
            self.search(of_body, warm)
        };
        CapsuleDistance { lower: found.lower.max(known[0]), upper: found.upper.min(known[1]), ..found }
    }

    fn search(&self, of_body: At<'_, Body>, warm: &mut WarmStart) -> CapsuleDistance {
        let found = if !runs(Stage::ClosedForm) {
            Err(0)
        } else if let Some(form) = of_body.0.closed_form() {
            self.of_shape((form, of_body.1), warm)
        } else if of_body.0.is_smooth() {
            self.of_smooth(of_body, warm)
        } else {
            Err(0)
        };
        found.unwrap_or_else(|spent| self.along_axis(of_body, spent, warm))
    }

    fn form(&self) -> ClosedForm {
        ClosedForm::capsule(self.capsule.radius_m(), self.capsule.half_height_m())
    }

    /// What the distance from the axis is asked for, with as much to spare as rounding may take.
    fn goal_of_axis(&self) -> StopCriterion {
        let (radius, StopCriterion { near, far }) = (self.capsule.radius_m(), self.goal);
        let spare = |limit: f64| 4.0 * f64::EPSILON * (radius + limit.abs());
        if self.goal.is_narrow() {
            return self.goal;
        }
        StopCriterion { near: near + radius - spare(near), far: far + radius + spare(far) }
    }

    /// Of a body with a single constraint.
    ///
    /// # Errors
    /// After how many evaluations nothing is proven.
    fn of_smooth(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> Result<CapsuleDistance, u32> {
        let Self { capsule_pose: form_pose, tolerance, options, .. } = *self;
        let (form, goal) = (self.form(), self.goal_of_axis());
        let trace = if let Hint::Exact(trace) = &warm.hint { Some(trace) } else { None };
        let query = ExactQuery { body, pose, form: &form, form_pose, goal: &goal, tolerance, options, trace };
        let found = dispatch(query).map_err(|lost| lost.rounds)?;
        let ExactProven { lower, upper, x, nearest, n, rounds, trace, .. } = found;
        let [witness, on_axis] = [x, nearest].map(|point| to_world(&form, form_pose, point));
        if upper == 0.0 {
            *warm = WarmStart::default();
            return Ok(self.met(&witness, rounds));
        }
        *warm = trace.map_or_else(WarmStart::default, |trace| Hint::Exact(trace).into());
        let normal = direction_to_world(&form, form_pose, n);
        Ok(self.apart([lower, upper], [witness, on_axis], normal, rounds))
    }

    /// Of a closed form where its body stands.
    ///
    /// # Errors
    /// After how many steps nothing is proven.
    fn of_shape(&self, of_body: (&ClosedForm, &Pose), warm: &mut WarmStart) -> Result<CapsuleDistance, u32> {
        let (_, pose) = of_body;
        let form = self.form();
        let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose.transform_point(x_a)) } else { None };
        let found =
            between_shapes(of_body, (&form, self.capsule_pose), start.as_ref(), (self.tolerance, self.options))?;
        let ShapeDistance { lower, upper, witness_a, witness_b, normal, steps, .. } = found;
        let x_a = pose.rotation().inverse_transform_vector(&(witness_a - pose.translation()));
        *warm = Hint::Shapes { x_a }.into();
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

    /// What is known by the way from a place on the axis to the body's interior point.
    fn to_interior_point(&self, (body, pose): At<'_, Body>, at: f64, iterations: u32) -> CapsuleDistance {
        let (place, interior) = (Vector3::new(0.0, 0.0, at), body.interior_point());
        let (way, apart, error) = across((pose, interior), (self.capsule_pose, &place));
        let (radius, normal) = (self.capsule.radius_m(), way.try_normalize(0.0));
        let on_axis = self.capsule_pose.transform_point(&place);
        CapsuleDistance {
            upper: (apart + error) * (1.0 + f64::EPSILON) - radius,
            witness_of_capsule: on_axis + normal.unwrap_or_default() * radius,
            normal,
            ..self.met(&pose.transform_point(interior), iterations)
        }
    }

    /// By the distances of points of the axis, after this number of steps.
    fn along_axis(&self, (body, pose): At<'_, Body>, spent: u32, warm: &mut WarmStart) -> CapsuleDistance {
        let (axis, half) = (self.capsule_pose.transform_direction(&Vector3::z()), self.capsule.half_height_m());
        let place = |at: f64| self.capsule_pose.translation() + axis * at;
        let projection = Projection::new(body, pose);
        // Places where the distance decreases towards the other one, with tangents that bound it.
        let mut ends: [Option<Tangent>; 2] = [None, None];
        let (mut lower, mut iterations) = (f64::NEG_INFINITY, spent);
        let center = pose.transform_point(body.interior_point()) - self.capsule_pose.translation();
        let mut at = axis.dot(&center).clamp(-half, half);
        // The centre of a ball has no error of a rotation.
        let turned = (ROTATION_ERROR + CULLING_SLACK) * (self.capsule_pose.translation().norm() + half);
        let error = if half == 0.0 { 0.0 } else { turned };
        let mut best = self.to_interior_point((body, pose), at, spent);
        for _ in 0..MAX_PLACES {
            if self.options.exhausted(iterations) {
                break;
            }
            let point = place(at);
            let found = projection.to(&point, self.tolerance * 0.25, &self.options.after(iterations), warm);
            iterations += found.iterations;
            if found.upper <= 0.0 {
                return CapsuleDistance { upper: error - self.capsule.radius_m(), ..self.met(&point, iterations) };
            }
            if found.upper < best.upper + self.capsule.radius_m() {
                let bracket = [0.0, found.upper + error];
                best = self.apart(bracket, [found.witness, point], -found.normal, iterations);
            }
            let tangent = Tangent { at, lower: found.lower - error, slope: found.normal.dot(&axis) };
            // One that does not separate is no bound.
            if found.lower > 0.0 {
                ends[usize::from(tangent.slope > 0.0)] = Some(tangent);
            }
            let (bound, next) = Tangent::least(&ends, half);
            lower = bound.max(lower);
            let radius = self.capsule.radius_m();
            let narrow = best.upper + radius - lower <= self.tolerance;
            let met = self.goal_of_axis().met(lower, best.upper + radius);
            if narrow || met || next == at {
                break;
            }
            at = next;
        }
        // How deep an axis is that is not proven outside is not known.
        let radius = self.capsule.radius_m() * (1.0 + f64::EPSILON);
        lower = if lower > 0.0 { lower - radius } else { f64::NEG_INFINITY };
        CapsuleDistance { status: Status::of(best.upper - lower <= self.tolerance), lower, iterations, ..best }
    }
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
