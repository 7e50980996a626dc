//! Two bodies with closed forms where they stand.

use super::cuboid::Cuboid;
use super::cylinder::Cylinder;
use super::placed::{direction_to_world, to_world};
use super::projectable::Projectable;
use super::segment::Segment;
use super::shape_pair::{Contact, ShapePair, ShapeProven};
use crate::body::{ClosedForm, ExactShape};
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::measure::frames::vector::{V3, add_scaled, rows, subtract};
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::polynomial::{Scalar, gamma};
use nalgebra::{Matrix3, Vector3};

/// A proven bracket of the distance of two shapes, metres, and where it is attained; world frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct ShapeDistance {
    /// Of the signed distance of what has a radius: minus infinity where axes meet.
    pub(in crate::measure) lower: f64,
    /// 0 where a common point is known, and less by the radii.
    pub(in crate::measure) upper: f64,
    /// A point of both where the upper bound is not above 0.
    pub(in crate::measure) common: Vector3<f64>,
    pub(in crate::measure) witness_a: Vector3<f64>,
    pub(in crate::measure) witness_b: Vector3<f64>,
    /// Unit vector from B to A.
    pub(in crate::measure) normal: Vector3<f64>,
    /// The same from A to B in A's frame of its shape, of a ball in any, and from B to A in that of
    /// B's.
    pub(in crate::measure) own_normals: [V3<f64>; 2],
    pub(in crate::measure) steps: u32,
}

/// A shape where it stands.
pub(in crate::measure) type Placed<'a> = (&'a ClosedForm, &'a Pose);

/// The distance, or as much of it as the criterion needs, from a point of A on (world frame,
/// metres).
///
/// # Errors
/// After how many steps it is neither as narrow as the tolerance (metres) nor known to be that of
/// an overlap, nor the criterion met.
pub(in crate::measure) fn between_shapes(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    start: Option<&Vector3<f64>>,
    until: &StopCriterion,
    (tolerance, options): (f64, &Options<'_>),
) -> Result<ShapeDistance, u32> {
    let in_order =
        |of_a, of_b, start| Problem { of_a, of_b, start, tolerance, options, goal: Goal::Distance(*until) }.by_first();
    let is_ball = |form: &ClosedForm| form.shape().ball_radius_m().is_some();
    if is_ball(of_a.0) {
        // The projection of its centre is all there is to find.
        return in_order(of_a, of_b, None);
    }
    match (*of_a.0.shape(), *of_b.0.shape()) {
        // The least over a box is found exactly, step by step.
        (ExactShape::Cylinder { .. } | ExactShape::Capsule { .. }, ExactShape::Cuboid { .. })
        | (ExactShape::Capsule { .. }, ExactShape::Cylinder { .. }) => in_order(of_b, of_a, None).map(swapped),
        _ if is_ball(of_b.0) => in_order(of_b, of_a, None).map(swapped),
        _ => in_order(of_a, of_b, start),
    }
}

/// The distance of the shapes in the other order.
fn swapped(found: ShapeDistance) -> ShapeDistance {
    let [first, second] = found.own_normals;
    let (witness_a, witness_b) = (found.witness_b, found.witness_a);
    ShapeDistance { witness_a, witness_b, normal: -found.normal, own_normals: [second, first], ..found }
}

/// What is known of the contact of two shapes.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum ShapeContact {
    /// A point of both, world frame, metres.
    Common(Vector3<f64>),
    /// They are at least this far apart, metres.
    Apart(f64),
}

/// On which side of contact two boxes or cylinders are.
///
/// # Errors
/// After how many steps neither is proven; of shapes with radii after none.
pub(in crate::measure) fn contact_of_shapes(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    options: &Options<'_>,
) -> Result<ShapeContact, u32> {
    // What has a radius reaches beyond the points that are met.
    if [of_a, of_b].iter().any(|(form, _)| matches!(form.shape(), ExactShape::Capsule { .. })) {
        return Err(0);
    }
    let boxed = |form: &ClosedForm| matches!(form.shape(), ExactShape::Cuboid { .. });
    let (of_a, of_b) = if boxed(of_a.0) { (of_a, of_b) } else { (of_b, of_a) };
    let problem = Problem { of_a, of_b, start: None, tolerance: 0.0, options, goal: Goal::Contact };
    let found = problem.by_first()?;
    Ok(if found.lower > 0.0 { ShapeContact::Apart(found.lower) } else { ShapeContact::Common(found.common) })
}

/// What is asked of two shapes.
#[derive(Clone, Copy, Debug)]
enum Goal {
    /// Their distance, or as much of it as the criterion needs.
    Distance(StopCriterion),
    /// A point of both, or a lower bound of their distance above 0.
    Contact,
}

/// Two shapes, and what is asked of them.
struct Problem<'a> {
    of_a: Placed<'a>,
    of_b: Placed<'a>,
    start: Option<&'a Vector3<f64>>,
    tolerance: f64,
    options: &'a Options<'a>,
    goal: Goal,
}

impl Problem<'_> {
    fn by_first(&self) -> Result<ShapeDistance, u32> {
        match *self.of_a.0.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => self.with_first(Cuboid { half_extents: half_extents_m }, 0.0),
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                self.with_first(Cylinder { radius: radius_m, half_height: half_height_m }, 0.0)
            }
            ExactShape::Capsule { radius_m, half_length_m } => {
                self.with_first(Segment { half_length: half_length_m }, radius_m)
            }
        }
    }

    fn with_first<A: Projectable>(&self, a: A, radius: f64) -> Result<ShapeDistance, u32> {
        match *self.of_b.0.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => {
                self.solve((a, radius), (Cuboid { half_extents: half_extents_m }, 0.0))
            }
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                self.solve((a, radius), (Cylinder { radius: radius_m, half_height: half_height_m }, 0.0))
            }
            ExactShape::Capsule { radius_m, half_length_m } => {
                self.solve((a, radius), (Segment { half_length: half_length_m }, radius_m))
            }
        }
    }

    fn solve<A: Projectable, B: Projectable>(
        &self,
        (a, radius_a): (A, f64),
        (b, radius_b): (B, f64),
    ) -> Result<ShapeDistance, u32> {
        let ((form_a, pose_a), (form_b, pose_b)) = (self.of_a, self.of_b);
        let to_b = pose_b.rotation().to_rotation_matrix().transpose().into_inner();
        let between = to_b * (pose_a.translation() - pose_b.translation());
        let (center_a, center_b) = (form_a.center(), form_b.center());
        let placed_a = pose_a.rotation() * center_a;
        let mut translation = between + (to_b * placed_a - center_b);
        // However a point is turned, it is where it is.
        let is_point = a.reach() == 0.0;
        let mut rotation =
            if is_point { Matrix3::identity() } else { to_b * pose_a.rotation().to_rotation_matrix().into_inner() };
        let mut factor = 1.0;
        if let Some(axes) = form_b.axes() {
            (translation, factor) = (axes.tr_mul(&translation), 2.0);
            rotation = if is_point { rotation } else { axes.tr_mul(&rotation) };
        }
        if let Some(axes) = form_a.axes().filter(|_| !is_point) {
            (rotation, factor) = (rotation * axes, 2.0);
        }
        let size = between.norm() + center_a.norm() + center_b.norm() + a.reach();
        let displacement =
            factor * (RELATIVE_ERROR + gamma(8)) * size + form_a.displacement_m() + form_b.displacement_m();
        let rows: [V3<f64>; 3] = rows(Scalar, &rotation);
        let pair = ShapePair { a, b, rotation: rows, translation: translation.into(), displacement };
        // From where A is nearest to B's centre.
        let own = match self.start {
            Some(start) => {
                let own = pose_a.rotation().inverse_transform_vector(&(start - pose_a.translation())) - center_a;
                form_a.axes().map_or(own, |axes| axes.tr_mul(&own))
            }
            None => -rotation.tr_mul(&translation),
        };
        let met = |point: V3<f64>, [lower, upper]: [f64; 2], steps| {
            let point = to_world(form_b, pose_b, point);
            ShapeDistance {
                lower,
                upper,
                common: point,
                witness_a: point,
                witness_b: point,
                normal: Vector3::zeros(),
                own_normals: [[0.0; 3]; 2],
                steps,
            }
        };
        let Goal::Distance(until) = self.goal else {
            return match pair.contact(own.into(), self.options) {
                (Contact::Common(point), steps) => Ok(met(point, [0.0; 2], steps)),
                (Contact::Apart(lower), steps) => Ok(met([0.0; 3], [lower, f64::INFINITY], steps)),
                (Contact::Open, steps) => Err(steps),
            };
        };
        let radius = radius_a + radius_b;
        let until = until.beyond_radius(radius);
        let found = pair.solve(own.into(), &until, self.tolerance, self.options);
        let is_met = until.met(found.lower, found.upper);
        if is_met && found.n == [0.0; 3] {
            let upper = found.upper - radius + f64::EPSILON * (radius + found.upper);
            return Ok(met(found.x, [f64::NEG_INFINITY, upper], found.steps));
        }
        if is_met {
            return Ok(self.apart(&found, &rotation, (radius_a, radius_b)));
        }
        // Small sets are met where rounding alone exceeds their tolerance.
        let may_be_met = found.upper <= self.tolerance.max(2.0 * pair.rounding(found.x));
        // How deep radii reach beyond that is not known.
        if may_be_met && let (Contact::Common(point), _) = pair.contact(pair.own(found.x), self.options) {
            return Ok(met(point, [f64::NEG_INFINITY, -radius], found.steps));
        }
        if found.upper <= self.tolerance {
            // Segments have no inside to be deep in.
            let flat = pair.a.thinnest() == 0.0 && pair.b.thinnest() == 0.0;
            if flat || radius > 0.0 {
                let rounding = f64::EPSILON * (radius + found.upper);
                let lower = if flat || found.lower > 0.0 { found.lower - radius - rounding } else { f64::NEG_INFINITY };
                let way = subtract::<Scalar, f64>(found.x, found.y);
                let share = if found.upper > radius_b { radius_b / found.upper } else { 1.0 };
                let point = add_scaled::<Scalar, f64>(found.y, share, way);
                return Ok(met(point, [lower, found.upper - radius + rounding], found.steps));
            }
        }
        let narrow = found.upper - found.lower <= self.tolerance && found.lower > 0.0;
        if narrow && found.is_aligned {
            Ok(self.apart(&found, &rotation, (radius_a, radius_b)))
        } else {
            Err(found.steps)
        }
    }

    fn apart(&self, found: &ShapeProven, rotation: &Matrix3<f64>, (radius_a, radius_b): (f64, f64)) -> ShapeDistance {
        let (form_b, pose_b) = self.of_b;
        let radius = radius_a + radius_b;
        // Without radii nothing is subtracted that rounds.
        let rounding = if radius > 0.0 { f64::EPSILON * (radius + found.upper) } else { 0.0 };
        let way = subtract::<Scalar, f64>(found.x, found.y);
        let share = if found.upper > 0.0 { (radius_b / found.upper).min(1.0) } else { 0.0 };
        let x = add_scaled::<Scalar, f64>(found.x, -radius_a, found.n);
        let y = add_scaled::<Scalar, f64>(found.y, radius_b, found.n);
        ShapeDistance {
            lower: found.lower - radius - rounding,
            upper: found.upper - radius + rounding,
            common: to_world(form_b, pose_b, add_scaled::<Scalar, f64>(found.y, share, way)),
            witness_a: to_world(form_b, pose_b, x),
            witness_b: to_world(form_b, pose_b, y),
            normal: direction_to_world(form_b, pose_b, found.n),
            own_normals: [(-rotation.tr_mul(&Vector3::from(found.n))).into(), found.n],
            steps: found.steps,
        }
    }
}
