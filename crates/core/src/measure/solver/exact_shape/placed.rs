//! A body with a closed form where it stands, and another body as seen from there.

use super::cuboid::Cuboid;
use super::cylinder::Cylinder;
use super::distance::{ExactLost, ExactPair, ExactProven, ExactTrace, common, interior};
use super::level::{Level, LevelProblem};
use super::projectable::Projectable;
use super::segment::Segment;
use crate::body::{Body, ClosedForm, ExactShape};
use crate::measure::frames::pose::{Pose, RELATIVE_QUATERNION_ERROR};
use crate::measure::frames::vector::{V3, rows};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{Relative, Side};
use crate::polynomial::{Scalar, Simd, WithSimd, gamma};
use nalgebra::{Matrix3, Vector3};

/// A smooth body against one with a closed form, of capsules against their axes; as vectorized
/// work.
pub(in crate::measure) struct ExactQuery<'a> {
    /// With a single constraint.
    pub(in crate::measure) body: &'a Body,
    pub(in crate::measure) pose: &'a Pose,
    pub(in crate::measure) form: &'a ClosedForm,
    /// Of the body with the closed form.
    pub(in crate::measure) form_pose: &'a Pose,
    pub(in crate::measure) goal: &'a StopCriterion,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Of the answer before.
    pub(in crate::measure) trace: Option<&'a ExactTrace>,
    /// About the unit normal of a plane between both, from the shape to the body, in the frame of the
    /// shape.
    pub(in crate::measure) facing: Option<V3<f64>>,
}

impl WithSimd for ExactQuery<'_> {
    /// The answer in the frame of the shape, or what is left.
    type Output = Result<ExactProven, ExactLost>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let relative = seen_from(simd, self.form, self.form_pose, self.body, self.pose);
        match *self.form.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => {
                self.pair(relative, Cuboid { half_extents: half_extents_m }).with_simd(simd)
            }
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                self.pair(relative, Cylinder { radius: radius_m, half_height: half_height_m }).with_simd(simd)
            }
            ExactShape::Capsule { half_length_m, .. } => {
                self.pair(relative, Segment { half_length: half_length_m }).with_simd(simd)
            }
        }
    }
}

impl<'a> ExactQuery<'a> {
    #[inline(always)]
    fn pair<P>(self, relative: Relative<f64>, set: P) -> ExactPair<'a, P> {
        let Self { body, form, goal, tolerance, options, trace, facing, .. } = self;
        let displacement = form.displacement_m();
        ExactPair { body, relative, set, displacement, goal, tolerance, options, trace, facing }
    }
}

/// On which side of contact a smooth body and one with a closed form are; as vectorized work.
pub(in crate::measure) struct ExactContact<'a> {
    /// With a single constraint.
    pub(in crate::measure) body: &'a Body,
    pub(in crate::measure) pose: &'a Pose,
    pub(in crate::measure) form: &'a ClosedForm,
    /// Of the body with the closed form.
    pub(in crate::measure) form_pose: &'a Pose,
    pub(in crate::measure) options: &'a Options<'a>,
}

impl WithSimd for ExactContact<'_> {
    /// A common point or a lower bound of the distance above 0, in the frame of the shape; or the
    /// number of evaluations that decided neither.
    type Output = Result<ExactProven, u32>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { body, form, options, .. } = self;
        let relative = seen_from(simd, form, self.form_pose, body, self.pose);
        let displacement = form.displacement_m();
        match *form.shape() {
            ExactShape::Cuboid { half_extents_m, .. } => {
                contact(simd, body, &relative, Cuboid { half_extents: half_extents_m }, (displacement, options))
            }
            ExactShape::Cylinder { radius_m, half_height_m, .. } => {
                let set = Cylinder { radius: radius_m, half_height: half_height_m };
                contact(simd, body, &relative, set, (displacement, options))
            }
            ExactShape::Capsule { half_length_m, .. } => {
                contact(simd, body, &relative, Segment { half_length: half_length_m }, (displacement, options))
            }
        }
    }
}

/// By the least value of the body's polynomial over a set.
#[inline(always)]
fn contact<S: Simd, P: Projectable>(
    simd: S,
    body: &Body,
    relative: &Relative<f64>,
    set: P,
    (displacement, options): (f64, &Options<'_>),
) -> Result<ExactProven, u32> {
    let side = Side::away(simd, body, 0, relative);
    let start = set.project(simd, interior(simd, body, relative));
    let problem = LevelProblem { start, set, side: &side, displacement, settle: false, most: options.max_iterations() };
    match problem.with_simd(simd) {
        (Level::Common(y), rounds) => Ok(common(y, rounds)),
        (Level::Apart { lower, n, y }, rounds) => {
            Ok(ExactProven { lower, upper: f64::INFINITY, n, ..common(y, rounds) })
        }
        (Level::Open, rounds) => Err(rounds),
    }
}

/// Where a body stands as seen from the frame of a shape.
#[inline(always)]
pub(in crate::measure) fn seen_from<S: Simd>(
    simd: S,
    form: &ClosedForm,
    form_pose: &Pose,
    body: &Body,
    pose: &Pose,
) -> Relative<f64> {
    let conjugate = form_pose.rotation().conjugate();
    let translation = conjugate * (pose.translation() - form_pose.translation());
    let rotation = (conjugate * pose.rotation()).to_rotation_matrix().into_inner();
    let center = form.center();
    let Some(axes) = form.axes() else {
        return Relative::from_parts(simd, (center, center.norm()), rows(simd, &rotation), translation.into(), body);
    };
    let (rotation, translation, center) = (axes.tr_mul(&rotation), axes.tr_mul(&translation), axes.tr_mul(center));
    let mut relative =
        Relative::from_parts(simd, (&center, center.norm()), rows(simd, &rotation), translation.into(), body);
    // One more product, with axes that are orthogonal to as much.
    let reach = translation.norm() + center.norm() + body.trust().reach + body.trust().center;
    relative.displacement += (RELATIVE_QUATERNION_ERROR + gamma(8)) * reach;
    relative
}

/// A point of the frame of a shape in the world frame.
pub(in crate::measure) fn to_world(form: &ClosedForm, pose: &Pose, point: V3<f64>) -> Vector3<f64> {
    let point = Vector3::from(point);
    let turned = form.axes().map_or(point, |axes: &Matrix3<f64>| axes * point);
    pose.transform_point(&(turned + form.center()))
}

/// A direction of the frame of a shape in the world frame.
pub(in crate::measure) fn direction_to_world(form: &ClosedForm, pose: &Pose, direction: V3<f64>) -> Vector3<f64> {
    let direction = Vector3::from(direction);
    pose.transform_direction(&form.axes().map_or(direction, |axes: &Matrix3<f64>| axes * direction))
}

/// Unit normals of planes that may separate a shape from what is about a point of the world frame:
/// from its projection to the point, and those of the faces that the point lies beyond; and how
/// many they are. World frame, from the shape outwards.
pub(in crate::measure) fn normals_towards(
    form: &ClosedForm,
    pose: &Pose,
    point: &Vector3<f64>,
) -> ([Vector3<f64>; 4], usize) {
    let own = pose.rotation().inverse_transform_vector(&(point - pose.translation())) - form.center();
    let own = form.axes().map_or(own, |axes| axes.tr_mul(&own)).into();
    match *form.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => normals(form, pose, Cuboid { half_extents: half_extents_m }, own),
        ExactShape::Cylinder { radius_m, half_height_m, .. } => {
            normals(form, pose, Cylinder { radius: radius_m, half_height: half_height_m }, own)
        }
        ExactShape::Capsule { half_length_m, .. } => normals(form, pose, Segment { half_length: half_length_m }, own),
    }
}

#[inline(always)]
fn normals<P: Projectable>(form: &ClosedForm, pose: &Pose, set: P, point: V3<f64>) -> ([Vector3<f64>; 4], usize) {
    let mut found = [Vector3::zeros(); 4];
    let seen = set.offset(Scalar, point);
    if !(seen.distance > 0.0) {
        return (found, 0);
    }
    found[0] = direction_to_world(form, pose, seen.frame[2]);
    let (faces, count) = set.faces_towards(Scalar, point);
    if count < 2 {
        // The normal is that of the face.
        return (found, 1);
    }
    for (normal, face) in found[1..].iter_mut().zip(&faces[..count]) {
        *normal = direction_to_world(form, pose, *face);
    }
    (found, count + 1)
}

/// The constraints of a shape whose gradients span an outward unit normal of it, in its frame:
/// those are `2 y_i / h_i²` on a face, `2 / r` on a wall.
pub(in crate::measure) fn active(shape: &ExactShape, n: [f64; 3]) -> ActiveConstraints {
    let mut active = ActiveConstraints::default();
    let mut push = |index: u8, part: f64, half: f64| {
        if part != 0.0 {
            active.push(index.into(), 0.5 * part.abs() * half);
        }
    };
    match *shape {
        ExactShape::Cuboid { half_extents_m, faces } => (0..3).for_each(|i| push(faces[i], n[i], half_extents_m[i])),
        ExactShape::Cylinder { radius_m, half_height_m, wall_and_caps: [wall, caps] } => {
            push(wall, n[0].hypot(n[1]), radius_m);
            push(caps, n[2], half_height_m);
        }
        ExactShape::Capsule { radius_m, .. } => push(0, 1.0, radius_m),
    }
    active
}
