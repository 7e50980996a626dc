//! The growth distance of two shapes about their centres.
//!
//! Shapes are symmetric about their centres, so that their difference with the centres on each
//! other, which is what s is the gauge of, is their sum. That of a ball and a box is a rounded box,
//! which the ray through the vector between the centres leaves at the root of a quadratic; that of
//! two boxes is a polytope, whose gauge is the largest over the axes across its faces.
//!
//! The ray leaves any other sum no later than a plane that supports it. From there on Newton's
//! method takes the plane across the nearest points: off by an angle δ, it meets the ray within a
//! radius of curvature times `δ²/2`, and the next plane is off by about that over the radius.

use super::beside::beside;
use super::cuboid_axes::{ALIGNED, CuboidAxis};
use super::line::{Line, Target};
use super::placed::direction_to_world;
use super::shapes::{Placed, ShapeDistance, between_shapes};
use super::signed::cuboid_axes;
use crate::measure::bounds::culling::across;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// A proven bracket of the growth distance of two shapes, and where it is attained; world frame.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct GrowthOfShapes {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    /// A point of both shapes grown by the upper bound, metres.
    pub(in crate::measure) witness: Vector3<f64>,
    /// The point of A that grows there; world frame, metres.
    pub(in crate::measure) of_a: Vector3<f64>,
    /// Unit vector from B to A.
    pub(in crate::measure) normal: Vector3<f64>,
    /// Half of what both shapes cover along it, together, metres: the inverse of the slope.
    pub(in crate::measure) width: f64,
    pub(in crate::measure) steps: u32,
}

/// How far outside of the sum the nearest points are taken, relative to the smaller shape,
/// dimensionless.
///
/// A plane keeps `g / (g + ρ)` of the error of the normal of the one before, g this length and ρ
/// the radius of curvature of the sum. Larger, that is more; smaller, the rounding of short
/// distances turns normals, and one pair in ten is left to the general search. Exercised by
/// `cylinders_grow_as_the_general_search_says`.
const OUTSIDE: f64 = 1e-2;

/// Turn of the normal, radians, that counts as none: rounding of the points that it is across.
///
/// Beside an edge of the sum normals turn by the distance of the ray from the edge over
/// [`OUTSIDE`], plane after plane, however fast they settle along the edge. Larger, rays that far
/// from an edge get a normal of the edge in place of that of its side: with 7e-8 one of 5 000 pairs
/// was off by 30 degrees. Smaller, rays through edges are left to the general search. Pinned by
/// seed 206 801 of `family_20_growth_gradients`.
const AT_REST: f64 = 1e-3 * ALIGNED;

/// Most planes that are tried.
///
/// Fewer, more pairs are left to the general search; more are in vain where the ray leaves through
/// an edge. It changes time only.
const MOST_PLANES: u32 = 10;

/// The growth distance about the centres, given radii of balls about these in the shapes, metres,
/// and from a point of A on, world frame. Where the ray leaves through an edge, the normal is any
/// of those there.
///
/// # Errors
/// After how many steps it is not known, or its normal not to 1e-7.
pub(in crate::measure) fn growth_of_shapes(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    radii: [f64; 2],
    start: Option<&Vector3<f64>>,
    options: &Options<'_>,
) -> Result<GrowthOfShapes, u32> {
    if options.exhausted(0) {
        return Err(0);
    }
    match [of_a, of_b].map(|(form, _)| form.shape().ball_radius_m()) {
        // From the centre of the smaller ball, where the witness is rounded less.
        [Some(radius), other] if other.is_none_or(|other| radius <= other) => {
            with_ball((of_a, radius), of_b, radii).map(|(found, _)| found).ok_or(0)
        }
        [_, Some(radius)] => {
            let (found, of_other) = with_ball((of_b, radius), of_a, radii).ok_or(0_u32)?;
            Ok(GrowthOfShapes { of_a: of_other, normal: -found.normal, ..found })
        }
        _ => of_cuboids(of_a, of_b, radii, start, options).or_else(|spent| {
            let found = of_any(of_a, of_b, radii, start, &options.after(spent));
            found.map(|found| GrowthOfShapes { steps: spent + found.steps, ..found }).map_err(|steps| spent + steps)
        }),
    }
}

/// Of a ball A, with the point of B that grows to the witness.
fn with_ball(
    ((ball, pose), radius): (Placed<'_>, f64),
    of_b: Placed<'_>,
    [radius_a, radius_b]: [f64; 2],
) -> Option<(GrowthOfShapes, Vector3<f64>)> {
    let (form_b, pose_b) = of_b;
    let target = Target::within(radius, form_b.shape())?;
    let (vector, apart, error) = across((pose, ball.center()), (pose_b, form_b.center()));
    if !(apart * ALIGNED > error) {
        return None;
    }
    let own = pose_b.rotation().inverse_transform_vector(&vector);
    let u = form_b.axes().map_or(own, |axes| axes.tr_mul(&own)) / apart;
    let reach = target.reach();
    let turned = 3.0 * (RELATIVE_ERROR + gamma(8));
    let off = target.rounding(0.0) + turned * reach + ball.displacement_m() + form_b.displacement_m();
    // A ray from the centre leaves the set where the opposite ray, run backwards, enters it.
    let behind = Line { start: Vector3::zeros(), velocity: -u };
    let leaves = |larger: f64| target.first(&behind, larger, (-2.0 * reach, 0.0)).map(|s| -s);
    let (farthest, nearest) = (leaves(off)?, leaves(-off)?);
    if !(nearest > 0.0) {
        return None;
    }
    let error = error / (radius_a + radius_b);
    let lower = apart / farthest * (1.0 - gamma(8)) - error;
    let upper = (apart / nearest + error) * (1.0 + gamma(8));
    let seen = beside(form_b.shape(), (u * nearest).into(), 1.0);
    if off + nearest * turned > ALIGNED * seen.arm {
        return None;
    }
    let n = Vector3::from(seen.n);
    let normal = direction_to_world(form_b, pose_b, seen.n);
    let (center, center_b) = (pose.transform_point(ball.center()), pose_b.transform_point(form_b.center()));
    let witness = center - normal * (radius * upper);
    let found = GrowthOfShapes {
        lower: lower.max(0.0),
        upper,
        witness,
        of_a: center - normal * radius,
        normal,
        width: n.dot(&u) * nearest,
        steps: 0,
    };
    Some((found, center_b + (witness - center_b) / upper))
}

/// Of two boxes.
///
/// # Errors
/// After how many steps it is not known, and of other shapes after none.
fn of_cuboids(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    radii: [f64; 2],
    start: Option<&Vector3<f64>>,
    options: &Options<'_>,
) -> Result<GrowthOfShapes, u32> {
    let ((form_a, pose_a), (form_b, pose_b)) = (of_a, of_b);
    let axes = cuboid_axes(of_a, of_b).ok_or(0_u32)?;
    let ratio = |axis: &CuboidAxis| axis.apart.abs() / axis.width;
    let best = axes.all().into_iter().filter(CuboidAxis::is_accurate);
    let best = best.max_by(|p, q| ratio(p).total_cmp(&ratio(q))).ok_or(0_u32)?;
    let (vector, distance, vector_error) = across((pose_a, form_a.center()), (pose_b, form_b.center()));
    if !(distance * ALIGNED > vector_error && best.apart != 0.0) {
        return Err(0);
    }
    let n = best.n / (best.length * 1_f64.copysign(best.apart));
    let normal = direction_to_world(form_b, pose_b, n.into());
    // Where the boxes touch as they are turned, B about the origin; from there apart by any gap.
    let gap = form_a.reach_m().min(form_b.reach_m());
    let center = vector / ratio(&best) + normal * gap;
    let arms = [(form_a, pose_a), (form_b, pose_b)].map(|(form, pose)| pose.transform_direction(form.center()));
    let moved = (pose_a.with_translation(center - arms[0]), pose_b.with_translation(-arms[1]));
    let start = start.map(|start| start - pose_a.translation() + moved.0.translation());
    let goal = (ALIGNED * gap, options);
    let found = between_shapes((form_a, &moved.0), (form_b, &moved.1), start.as_ref(), &StopCriterion::NARROW, goal)?;
    if (found.normal - normal).norm() > ALIGNED {
        return Err(found.steps);
    }
    let error = axes.error();
    let lower = (best.apart.abs() - error) / (best.width + error) * (1.0 - gamma(8));
    let place = Touching { found, center, normal, width: best.width, error };
    place.grown((of_a, radii), (vector, vector_error), lower).ok_or(found.steps)
}

/// Of any two shapes with heights.
///
/// # Errors
/// After how many steps it is not known, or its normal not to 1e-7.
fn of_any(
    of_a: Placed<'_>,
    of_b: Placed<'_>,
    radii: [f64; 2],
    start: Option<&Vector3<f64>>,
    options: &Options<'_>,
) -> Result<GrowthOfShapes, u32> {
    let ((form_a, pose_a), (form_b, pose_b)) = (of_a, of_b);
    let (vector, distance, vector_error) = across((pose_a, form_a.center()), (pose_b, form_b.center()));
    if !(distance * ALIGNED > vector_error) {
        return Err(0);
    }
    let reaches = [form_a.reach_m(), form_b.reach_m()];
    let turned = 4.0 * (RELATIVE_ERROR + gamma(8));
    // Witnesses are places of the bodies, whose frames may be far from them.
    let displaced = form_a.displacement_m() + form_b.displacement_m();
    let lengths = reaches[0] + reaches[1] + form_a.center().norm() + form_b.center().norm();
    let error = turned * lengths + displaced;
    let [arm_a, arm_b] =
        [(form_a, pose_a), (form_b, pose_b)].map(|(form, pose)| pose.transform_direction(form.center()));
    let beside = pose_b.with_translation(-arm_b);
    let gap = OUTSIDE * reaches[0].min(reaches[1]);
    let width = |n: &Vector3<f64>| {
        let own = |pose: &Pose| pose.rotation().inverse_transform_vector(n);
        form_a.height(&own(pose_a)) + form_b.height(&own(pose_b)) + turned * (reaches[0] + reaches[1])
    };
    let mut nearest = start.map(|start| start - pose_a.translation() - arm_a);
    let (mut normal, mut steps) = (vector / distance, 0);
    for plane in 1..=MOST_PLANES {
        // Where the ray meets the plane the shapes are apart or touch.
        let center = vector * (width(&normal) / normal.dot(&vector)) + normal * gap;
        let moved = pose_a.with_translation(center - arm_a);
        let start = nearest.map(|nearest| nearest + center);
        let goal = (0.1 * gap, &options.after(steps));
        let found = between_shapes((form_a, &moved), (form_b, &beside), start.as_ref(), &StopCriterion::NARROW, goal)
            .map_err(|spent| steps + spent)?;
        steps += found.steps;
        if found.normal == Vector3::zeros() {
            break;
        }
        let turn = (found.normal - normal).norm();
        if turn <= AT_REST && (plane > 1 || turn == 0.0) {
            let normal = found.normal;
            let width = width(&normal);
            let lower = (normal.dot(&vector) - vector_error) / width * (1.0 - gamma(8));
            let place = Touching { found: ShapeDistance { steps, ..found }, center, normal, width, error };
            return place.grown((of_a, radii), (vector, vector_error), lower).ok_or(steps);
        }
        nearest = Some(found.witness_a - center);
        normal = found.normal;
    }
    Err(steps)
}

/// Where two shapes all but touch, B about the origin and A where the vector between the centres
/// is shorter or longer.
struct Touching {
    found: ShapeDistance,
    /// A's centre, world frame, metres.
    center: Vector3<f64>,
    /// Unit vector from B to A.
    normal: Vector3<f64>,
    /// Half of what both shapes cover along it, together, metres.
    width: f64,
    /// Bound of the error of the vector between the witnesses, metres.
    error: f64,
}

impl Touching {
    /// The answer with this lower bound, from the vector between the centres and its error.
    fn grown(
        &self,
        ((form_a, pose_a), [radius_a, radius_b]): (Placed<'_>, [f64; 2]),
        (vector, vector_error): (Vector3<f64>, f64),
        lower: f64,
    ) -> Option<GrowthOfShapes> {
        // As of any two points: t + |Δ - t w| / R.
        let (x, y) = (self.found.witness_a - self.center, self.found.witness_b);
        let w = y - x;
        let t = vector.norm_squared() / w.dot(&vector);
        let rest = vector - w * t;
        let missing = rest.norm() + vector_error + t * 4.0 * self.error;
        let upper = (t + missing / (radius_a + radius_b)) * (1.0 + gamma(16));
        if !(t > 0.0) {
            return None;
        }
        let from = pose_a.transform_point(form_a.center());
        Some(GrowthOfShapes {
            lower: lower.max(0.0),
            upper,
            witness: from + x * t - rest * (radius_a / (radius_a + radius_b)),
            of_a: from + x,
            normal: self.normal,
            width: self.width,
            steps: self.found.steps,
        })
    }
}
