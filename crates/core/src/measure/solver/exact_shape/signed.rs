//! The signed distance of two bodies with closed forms where they stand: of balls and others, and
//! of boxes that overlap.
//!
//! A ball is a point that others are larger by a radius for. What takes boxes apart soonest is one
//! of 15 axes ([`super::cuboid_axes`]); the points that come out last are those that face each
//! other once the boxes are apart along it, however far.

use super::beside::{Beside, beside};
use super::cuboid_axes::{CuboidAxes, LeastOverlap};
use super::placed::{direction_to_world, to_world};
use super::shapes::{Placed, between_shapes};
use crate::body::{ClosedForm, ExactShape};
use crate::measure::bounds::culling::across;
use crate::measure::frames::pose::RELATIVE_ERROR;
use crate::measure::frames::vector::{V3, rows};
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::polynomial::{Scalar, gamma};
use nalgebra::Vector3;

/// Largest angle, radians, between the normal of an answer and that of the solution.
///
/// Larger, gradients would be off by more than 1e-6; smaller, balls beside edges and boxes that
/// touch are left to the general search. Exercised by `signed_shapes_have_gradients`.
pub(super) const ALIGNED: f64 = 1e-7;

/// A proven bracket of the signed distance of two shapes, metres, and where it is attained; world
/// frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct SignedOfShapes {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) witness_a: Vector3<f64>,
    pub(in crate::measure) witness_b: Vector3<f64>,
    /// Unit vector from B to A.
    pub(in crate::measure) normal: Vector3<f64>,
    /// The least translation along a direction elsewhere that is known to take the shapes apart.
    pub(in crate::measure) elsewhere: f64,
    /// Whether the normal is that of the solution: on the axis of a cylinder it is any.
    pub(in crate::measure) is_aligned: bool,
    pub(in crate::measure) steps: u32,
}

/// What is known of two shapes without their distance.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum SignedShapes {
    /// A plane across the unit vector from B to A parts them.
    Apart(Vector3<f64>),
    Signed(SignedOfShapes),
}

/// The signed distance of a ball and another shape, or of two boxes unless they are apart; none of
/// others, and of boxes that face each other along none of their axes as far as is known.
/// Directions at an angle with a cosine below `elsewhere` are others. From a point of A on, world
/// frame.
pub(in crate::measure) fn signed_of_shapes(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    elsewhere: f64,
    (start, options): (Option<&Vector3<f64>>, &Options<'_>),
) -> Option<SignedShapes> {
    if options.exhausted(0) {
        return None;
    }
    if let Some(radius) = of_a.0.shape().ball_radius_m() {
        return of_ball((of_a, radius), of_b, elsewhere).map(SignedShapes::Signed);
    }
    if let Some(radius) = of_b.0.shape().ball_radius_m() {
        let found = of_ball((of_b, radius), of_a, elsewhere)?;
        let (witness_a, witness_b) = (found.witness_b, found.witness_a);
        return Some(SignedShapes::Signed(SignedOfShapes { witness_a, witness_b, normal: -found.normal, ..found }));
    }
    of_cuboids(of_a, of_b, elsewhere, (start, options))
}

/// Of a ball A.
fn of_ball(((ball, pose), radius): (Placed<'_>, f64), of_b: Placed<'_>, elsewhere: f64) -> Option<SignedOfShapes> {
    let (form_b, pose_b) = of_b;
    let (vector, apart, error) = across((pose, ball.center()), (pose_b, form_b.center()));
    let own = pose_b.rotation().inverse_transform_vector(&vector);
    let y = form_b.axes().map_or(own, |axes| axes.tr_mul(&own));
    let Beside { lower, upper, n, nearest, elsewhere, arm } = beside(form_b.shape(), y.into(), elsewhere);
    let displacement = ball.displacement_m() + form_b.displacement_m();
    let moved = error + 2.0 * (RELATIVE_ERROR + gamma(8)) * apart + displacement;
    // As for a point.
    let size = y.abs().sum() + form_b.reach_m() + radius;
    let rounding = gamma(48) * size + moved;
    let normal = direction_to_world(form_b, pose_b, n);
    Some(SignedOfShapes {
        lower: lower - radius - rounding,
        upper: upper.max(lower) - radius + rounding,
        witness_a: pose.transform_point(ball.center()) - normal * radius,
        witness_b: to_world(form_b, pose_b, nearest),
        normal,
        elsewhere: elsewhere + radius,
        is_aligned: moved <= ALIGNED * arm,
        steps: 0,
    })
}

fn of_cuboids(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    elsewhere: f64,
    (start, options): (Option<&Vector3<f64>>, &Options<'_>),
) -> Option<SignedShapes> {
    let ((form_a, pose_a), (form_b, pose_b)) = (of_a, of_b);
    let axes = cuboid_axes(of_a, of_b)?;
    let LeastOverlap { lower, upper, n, elsewhere } = axes.least_overlap(elsewhere);
    let normal = direction_to_world(form_b, pose_b, n);
    if upper < 0.0 {
        return Some(SignedShapes::Apart(normal));
    }
    // Apart along the normal, about the middle of B's frame. How far does not matter.
    let gap = form_a.reach_m().min(form_b.reach_m());
    let beside = pose_b.with_translation(Vector3::zeros());
    let between = pose_a.translation() - pose_b.translation();
    let moved = pose_a.with_translation(between + normal * (upper + gap));
    let tolerance = ALIGNED * gap;
    let start = start.map(|start| start - pose_a.translation() + moved.translation());
    let found = between_shapes(
        (form_a, &moved),
        (form_b, &beside),
        start.as_ref(),
        &StopCriterion::NARROW,
        (tolerance, options),
    )
    .ok()?;
    if (found.normal - normal).norm() > ALIGNED {
        return None;
    }
    let x = found.witness_a - normal * (upper + gap);
    // Where they touch, points that all but agree are what bounds the distance.
    let near = (x - found.witness_b).norm() + 4.0 * axes.error();
    Some(SignedShapes::Signed(SignedOfShapes {
        lower: -upper,
        upper: if lower > 0.0 { -lower } else { near },
        witness_a: x + pose_b.translation(),
        witness_b: found.witness_b + pose_b.translation(),
        normal,
        elsewhere,
        is_aligned: true,
        steps: found.steps,
    }))
}

/// The axes of two boxes; none of other shapes.
pub(super) fn cuboid_axes((form_a, pose_a): Placed<'_>, (form_b, pose_b): Placed<'_>) -> Option<CuboidAxes> {
    let half = |form: &ClosedForm| match *form.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => Some(half_extents_m),
        _ => None,
    };
    let (half_a, half_b) = (half(form_a)?, half(form_b)?);
    let to_b = pose_b.rotation().to_rotation_matrix().transpose().into_inner();
    let offset = to_b * (pose_a.translation() - pose_b.translation());
    let mut rotation = to_b * pose_a.rotation().to_rotation_matrix().into_inner();
    let mut between = offset + rotation * form_a.center() - form_b.center();
    let mut factor = 1.0;
    if let Some(axes) = form_b.axes() {
        (between, rotation, factor) = (axes.tr_mul(&between), axes.tr_mul(&rotation), 2.0);
    }
    if let Some(axes) = form_a.axes() {
        (rotation, factor) = (rotation * axes, factor + 1.0);
    }
    let turned = factor * (RELATIVE_ERROR + gamma(8));
    let size = offset.norm() + form_a.center().norm() + form_b.center().norm();
    let displacement = turned * size + form_a.displacement_m() + form_b.displacement_m();
    let rotation: [V3<f64>; 3] = rows(Scalar, &rotation);
    Some(CuboidAxes { half_a, half_b, rotation, between: between.into(), turned, displacement })
}
