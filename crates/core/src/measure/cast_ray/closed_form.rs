//! Where a ray, or a ball swept along it, enters a body with a closed form.
//!
//! The ray is known in the frame of the shape but for an error, the shape is the body's set but for
//! its displacement, and roots round. All three count as other sizes of the shape: before the ray
//! enters the shape made larger by their sum it is not in the body, and where it is in the shape
//! made smaller it is.

use super::approach::Approach;
use super::ray::Ray;
use crate::body::ClosedForm;
use crate::measure::frames::pose::{Pose, RELATIVE_QUATERNION_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::exact_shape::{Line, Target};
use crate::polynomial::gamma;
use nalgebra::{Matrix3, Vector3};

/// What a ray, or a ball swept along it, does to a shape.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) enum ShapeEntry {
    /// It does not meet it: proven.
    Miss,
    /// It enters it between two parameters: proven; metres.
    Hit {
        lower: f64,
        upper: f64,
        /// Outward unit normal there, world frame; none inside from the start, and of balls swept
        /// towards boxes.
        normal: Option<Vector3<f64>>,
    },
}

/// Where the ray, swept with a radius, metres, or 0, enters the shape; none where that is known
/// less accurately than to the tolerance, metres, and of shapes that no quadratic bounds then.
#[inline(always)]
pub(in crate::measure) fn enter(
    (form, pose): (&ClosedForm, &Pose),
    (ray, radius): (&Ray, f64),
    tolerance: f64,
    options: &Options<'_>,
) -> Option<ShapeEntry> {
    let target = Target::within(radius, form.shape())?;
    if options.exhausted(0) {
        return None;
    }
    let reach = target.reach();
    let Some(approach) = Approach::within(reach + form.displacement_m(), form.center(), pose, ray) else {
        return Some(ShapeEntry::Miss);
    };
    let Approach { base, closest, direction, errors: (moved, turned), entry } = approach;
    let turn = |v: &Vector3<f64>| form.axes().map_or(*v, |axes: &Matrix3<f64>| axes.tr_mul(v));
    let line = Line { start: turn(&closest), velocity: turn(&direction) };
    let (out, span) = (closest.norm(), (entry.from, entry.to));
    // One more product, with axes that are orthogonal to as much.
    let axes = if form.axes().is_some() { RELATIVE_QUATERNION_ERROR + gamma(8) } else { 0.0 };
    let turned = (turned + axes) * (out + entry.from.abs().max(entry.to.abs()));
    let off = (moved + turned + form.displacement_m() + target.rounding(out)) * (1.0 + 1e-14);
    let Some(from) = target.first(&line, off, span) else { return Some(ShapeEntry::Miss) };
    let inside = target.first(&line, -off, span)?;
    if inside - from > tolerance {
        return None;
    }
    if inside <= -base {
        return Some(ShapeEntry::Hit { lower: 0.0, upper: 0.0, normal: None });
    }
    let lower = (base + from).next_down().max(0.0);
    let upper = (base + inside).next_up().min(ray.max_length);
    let normal = target.normal(&line, inside).map(|n| {
        let own = form.axes().map_or(n, |axes: &Matrix3<f64>| axes * n);
        pose.transform_direction(&own)
    });
    Some(ShapeEntry::Hit { lower: lower.min(upper), upper, normal })
}
