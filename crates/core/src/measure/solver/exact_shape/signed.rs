//! The signed distance of two bodies with closed forms where they stand: of balls and others, and
//! of boxes and cylinders that overlap.
//!
//! A ball is a point that others are larger by a radius for, and so is a cylinder beside a parallel
//! one. What takes boxes apart soonest is one of 15 axes ([`super::cuboid_axes`]), a box and a
//! cylinder one of finitely many directions ([`super::cylinder_axes`]), two cylinders at an angle
//! one that branch and bound finds ([`super::crossed_cylinders`]); the points that come out last
//! are those that face each other once the shapes are apart along it, however far.

use super::beside::{Beside, beside};
use super::crossed_cylinders::CrossedCylinders;
use super::cuboid_axes::{ALIGNED, CuboidAxes, LeastOverlap};
use super::cylinder_axes::CuboidCylinder;
use super::placed::{direction_to_world, to_world};
use super::shapes::{Placed, ShapeContact, between_shapes, contact_of_shapes};
use crate::body::{ClosedForm, ExactShape};
use crate::measure::bounds::culling::across;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::measure::frames::vector::{V3, rows};
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::polynomial::{Scalar, gamma};
use nalgebra::{Matrix3, Vector3};

/// Sine of the angle between the axes of two cylinders up to which they count as parallel.
///
/// The bracket is wider by this times their sizes: larger, that is more than asked for; smaller,
/// cylinders whose poses were rounded to as much have no normal across both to 1e-7, and are left
/// to the general search. Exercised by `parallel_cylinders_overlap_as_one_does`.
const PARALLEL: f64 = 1e-10;

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

/// The shapes in the other order.
fn swapped(found: SignedShapes) -> SignedShapes {
    match found {
        SignedShapes::Apart(n) => SignedShapes::Apart(-n),
        SignedShapes::Signed(found) => {
            let (witness_a, witness_b) = (found.witness_b, found.witness_a);
            SignedShapes::Signed(SignedOfShapes { witness_a, witness_b, normal: -found.normal, ..found })
        }
    }
}

/// The signed distance of a ball and another shape, or of boxes and cylinders unless they are
/// apart; none of shapes that face each other along none of the directions as far as is known.
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
        return of_ball((of_b, radius), of_a, elsewhere).map(SignedShapes::Signed).map(swapped);
    }
    match (*of_a.0.shape(), *of_b.0.shape()) {
        (ExactShape::Cuboid { half_extents_m, .. }, ExactShape::Cylinder { radius_m, half_height_m, .. }) => {
            let sizes = (half_extents_m, [radius_m, half_height_m]);
            of_cuboid_and_cylinder(of_a, of_b, sizes, elsewhere, options)
        }
        (ExactShape::Cylinder { radius_m, half_height_m, .. }, ExactShape::Cuboid { half_extents_m, .. }) => {
            let sizes = (half_extents_m, [radius_m, half_height_m]);
            of_cuboid_and_cylinder(of_b, of_a, sizes, elsewhere, options).map(swapped)
        }
        (
            ExactShape::Cylinder { radius_m: radius_a, half_height_m: height_a, .. },
            ExactShape::Cylinder { radius_m: radius_b, half_height_m: height_b, .. },
        ) => {
            let sizes = [[radius_b, radius_a], [height_b, height_a]];
            of_cylinders(of_a, of_b, sizes, elsewhere, options)
        }
        _ => of_cuboids(of_a, of_b, elsewhere, (start, options)),
    }
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
    let axes = cuboid_axes(of_a, of_b)?;
    let least = axes.least_overlap(elsewhere);
    let normal = direction_to_world(of_b.0, of_b.1, least.n);
    let least = LeastTranslation { normal, least, error: axes.error(), is_decided: true, is_aligned: true };
    let moved = least.moved(of_a, of_b);
    let start = start.map(|start| start - of_a.1.translation() + moved.translation());
    least.taken((of_a, &moved), of_b, start.as_ref(), options)
}

fn of_cuboid_and_cylinder(
    cuboid: Placed<'_>,
    cylinder: Placed<'_>,
    (half, [radius, half_height]): (V3<f64>, [f64; 2]),
    elsewhere: f64,
    options: &Options<'_>,
) -> Option<SignedShapes> {
    let Seen { rotation, between, turned, displacement } = Seen::from(cylinder, cuboid);
    let axis = rotation.column(2).into();
    let pair = CuboidCylinder { half, radius, half_height, axis, between, turned, displacement };
    let least = pair.least_overlap(elsewhere, 1.0 + 2.0 * options.depth_accuracy())?;
    let normal = -direction_to_world(cuboid.0, cuboid.1, least.n);
    let least = LeastTranslation { normal, least, error: pair.error(), is_decided: false, is_aligned: true };
    least.taken_from_support(cuboid, cylinder, options)
}

/// Of two cylinders, by the radii and half heights of B and A: along the same direction, their
/// difference is a cylinder, too, of the summed sizes.
fn of_cylinders(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    sizes: [[f64; 2]; 2],
    elsewhere: f64,
    options: &Options<'_>,
) -> Option<SignedShapes> {
    let Seen { rotation, between, turned, displacement } = Seen::from(of_a, of_b);
    let axis: Vector3<f64> = rotation.column(2).into();
    let tilt = axis.x.hypot(axis.y);
    let [radii, half_heights] = sizes;
    let (least, error, is_aligned) = if tilt > PARALLEL {
        let pair = CrossedCylinders::new(sizes, (axis, between), (turned, displacement));
        (pair.least_overlap(elsewhere)?, pair.error(), true)
    } else {
        let sum = ExactShape::Cylinder {
            radius_m: radii.iter().sum(),
            half_height_m: half_heights.iter().sum(),
            wall_and_caps: [0, 1],
        };
        let found = beside(&sum, between.into(), elsewhere);
        let reach = of_a.0.reach_m() + of_b.0.reach_m() + between.norm();
        let error = displacement + (turned + tilt + gamma(64)) * reach;
        let (lower, upper) = (-found.upper - error, -found.lower + error);
        let least = LeastOverlap { lower, upper, n: found.n, elsewhere: found.elsewhere };
        (least, error, error <= ALIGNED * found.arm)
    };
    let normal = direction_to_world(of_b.0, of_b.1, least.n);
    let least = LeastTranslation { normal, least, error, is_decided: true, is_aligned };
    least.taken_from_support(of_a, of_b, options)
}

/// What takes A off B soonest.
struct LeastTranslation {
    /// Unit vector from B to A, world frame.
    normal: Vector3<f64>,
    least: LeastOverlap,
    /// Bound of the error of places, metres.
    error: f64,
    /// Whether shapes that are apart have a negative least overlap.
    is_decided: bool,
    /// Whether the normal is that of the solution.
    is_aligned: bool,
}

impl LeastTranslation {
    /// A's pose once it is apart along the normal, about the middle of B's frame. How far does not
    /// matter.
    fn moved(&self, (form_a, pose_a): Placed<'_>, (form_b, pose_b): Placed<'_>) -> Pose {
        let gap = form_a.reach_m().min(form_b.reach_m());
        let between = pose_a.translation() - pose_b.translation();
        pose_a.with_translation(between + self.normal * (self.least.upper + gap))
    }

    /// What of B is first along the normal faces A.
    fn taken_from_support(&self, of_a: Placed<'_>, of_b: Placed<'_>, options: &Options<'_>) -> Option<SignedShapes> {
        let (form_b, pose_b) = of_b;
        let along = form_b.support_point(&pose_b.rotation().inverse_transform_vector(&self.normal));
        let start = pose_b.transform_direction(&along);
        self.taken((of_a, &self.moved(of_a, of_b)), of_b, Some(&start), options)
    }

    /// The answer from the points that face each other once A is moved; from a point of it there.
    fn taken(
        &self,
        ((form_a, pose_a), moved): (Placed<'_>, &Pose),
        (form_b, pose_b): Placed<'_>,
        start: Option<&Vector3<f64>>,
        options: &Options<'_>,
    ) -> Option<SignedShapes> {
        let Self { normal, least: LeastOverlap { lower, upper, elsewhere, .. }, error, .. } = *self;
        if upper < 0.0 {
            return Some(SignedShapes::Apart(normal));
        }
        let gap = form_a.reach_m().min(form_b.reach_m());
        let beside = pose_b.with_translation(Vector3::zeros());
        let tolerance = ALIGNED * gap;
        let found =
            between_shapes((form_a, moved), (form_b, &beside), start, &StopCriterion::NARROW, (tolerance, options))
                .ok()?;
        if (found.normal - normal).norm() > ALIGNED {
            return None;
        }
        let (x, y) = (found.witness_a - normal * (upper + gap), found.witness_b);
        let overlap = || {
            let here = pose_a.with_translation(pose_a.translation() - pose_b.translation());
            let of_a = |point: &Vector3<f64>| is_within((form_a, &here), point, 8.0 * error);
            let of_b = |point: &Vector3<f64>| is_within((form_b, &beside), point, 8.0 * error);
            let middle = (x + y) * 0.5;
            let contact = || contact_of_shapes((form_a, pose_a), (form_b, pose_b), options);
            of_b(&x) || of_a(&y) || of_a(&middle) && of_b(&middle) || matches!(contact(), Ok(ShapeContact::Common(_)))
        };
        // Where they touch, points that all but agree are what bounds the distance.
        let near = (x - y).norm() + 4.0 * error;
        Some(SignedShapes::Signed(SignedOfShapes {
            lower: -upper,
            upper: if lower > 0.0 && (self.is_decided || overlap()) { -lower } else { near },
            witness_a: x + pose_b.translation(),
            witness_b: y + pose_b.translation(),
            normal,
            elsewhere,
            is_aligned: self.is_aligned,
            steps: found.steps,
        }))
    }
}

/// Whether a point of the world frame lies deeper in a shape than that, metres, but for rounding.
fn is_within((form, pose): Placed<'_>, point: &Vector3<f64>, depth: f64) -> bool {
    let own = pose.inverse_transform_point(point) - form.center();
    let own = form.axes().map_or(own, |axes| axes.tr_mul(&own));
    beside(form.shape(), own.into(), 1.0).upper < -depth
}

/// Where a shape A is as seen from a shape B.
struct Seen {
    rotation: Matrix3<f64>,
    /// From B's centre to A's, metres.
    between: Vector3<f64>,
    /// Bounds of the error of the rotation, and of places that are not turned by it, metres.
    turned: f64,
    displacement: f64,
}

impl Seen {
    fn from((form_a, pose_a): Placed<'_>, (form_b, pose_b): Placed<'_>) -> Self {
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
        Self { rotation, between, turned, displacement }
    }
}

/// The axes of two boxes; none of other shapes.
pub(super) fn cuboid_axes(of_a: Placed<'_>, of_b: Placed<'_>) -> Option<CuboidAxes> {
    let half = |form: &ClosedForm| match *form.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => Some(half_extents_m),
        _ => None,
    };
    let (half_a, half_b) = (half(of_a.0)?, half(of_b.0)?);
    let Seen { rotation, between, turned, displacement } = Seen::from(of_a, of_b);
    let rotation: [V3<f64>; 3] = rows(Scalar, &rotation);
    Some(CuboidAxes { half_a, half_b, rotation, between: between.into(), turned, displacement })
}
