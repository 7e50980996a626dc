//! The signed distance of two capsules from their axes, in closed form.
//!
//! For unit vectors n the planes across n part two segments about c_a and c_b with the half axes
//! `h_a u` and `h_b v` by
//!
//! ```text
//! gap(n) = n·(c_a - c_b) - h_a |n·u| - h_b |n·v|
//! ```
//!
//! at most their distance. Two segments that meet lie in a plane, and the gap across it is 0: the
//! signed distance of two capsules is the distance of their axes less the radii, whatever that is.
//! The least square over the rectangle of places is at the stationary point, where that is in it,
//! or on a side; the normal that proves it is across the axes on which it is not at an end. Both
//! are computed for all cases, and the best bounds count: each is valid, so that the cases need
//! not be distinguished.

use super::answer::CapsuleDistance;
use super::shape::Capsule;
use crate::body::ClosedForm;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// A capsule as its axis: the segment of points within a half length of a centre along a direction.
#[derive(Clone, Copy, Debug)]
pub(super) struct Axis {
    /// The translation of the pose, and what the centre is from there: their difference is taken
    /// first, so that absolute positions play no part.
    translation: Vector3<f64>,
    offset: Vector3<f64>,
    /// Of length 1 within [`ROTATION_ERROR`].
    along: Vector3<f64>,
    half: f64,
    radius: f64,
    /// Bound of what is wrong with it, metres.
    error: f64,
}

impl Axis {
    /// That of a capsule where it stands.
    pub(super) fn of_capsule(capsule: &Capsule, pose: &Pose) -> Self {
        let half = capsule.half_height_m();
        Self {
            translation: *pose.translation(),
            offset: Vector3::zeros(),
            along: pose.transform_direction(&Vector3::z()),
            half,
            radius: capsule.radius_m(),
            error: ROTATION_ERROR * half,
        }
    }

    /// That of a ball where its body stands, of no length; none of other shapes.
    pub(super) fn of_ball(form: &ClosedForm, pose: &Pose) -> Option<Self> {
        let radius = form.shape().ball_radius_m()?;
        let error = form.displacement_m() + ROTATION_ERROR * form.center().norm();
        let offset = pose.transform_direction(form.center());
        Some(Self { translation: *pose.translation(), offset, along: Vector3::z(), half: 0.0, radius, error })
    }

    fn at(&self, place: f64) -> Vector3<f64> {
        self.translation + (self.offset + self.along * place)
    }
}

/// Length of what is left of an axis across another one, relative to the axis, below which they are
/// parallel: then nothing is left of it but rounding, which is in no direction.
///
/// A larger value costs a share of it of the half length; a smaller one takes rounding for a
/// direction, which is as valid and of no use.
const PARALLEL: f64 = 8.0 * f64::EPSILON;

/// Share of the way between the nearest points that is left of it across both axes, dimensionless,
/// below which their product is the better direction. It changes nothing but which direction is
/// tried: all are valid.
const CROSSING: f64 = 1e-3;

/// Largest angle, radians, between the way from one axis to the other and the normal, and between
/// the normal and the plane across an axis in whose middle the nearest point is, at which a single
/// try is taken as it is: gradients are off by about as much, and 1e-6 is promised.
///
/// Larger, they are off by more; smaller, more pairs take the longer way. Exercised by
/// `family_20_distance_gradients`.
const ALIGNED: f64 = 1e-8;

/// The way from the middle of an axis to that of another, and a bound of the error of all ways
/// between their points, metres.
fn between_middles(a: &Axis, b: &Axis) -> (Vector3<f64>, f64) {
    let between = (a.translation - b.translation) + (a.offset - b.offset);
    let size = between.norm() + a.half + b.half + a.offset.norm() + b.offset.norm();
    // Lengths below 1e-162 m have squares of 0.
    (between, a.error + b.error + gamma(16) * size + 1e-160)
}

/// A bracket of the distance of the axes less the radii, metres.
fn less_radii([lower, upper]: [f64; 2], a: &Axis, b: &Axis) -> [f64; 2] {
    let radius = a.radius + b.radius;
    let rounding = 2.0 * f64::EPSILON * (radius + upper);
    [lower - radius - rounding, upper - radius + rounding]
}

/// A bracket of the signed distance of two capsules, metres, as far as it may decide: by the balls
/// around them, and else by points of the axes that are about the nearest and the planes across the
/// way between these.
pub(super) fn bounds_of_axes(a: &Axis, b: &Axis, goal: &StopCriterion) -> [f64; 2] {
    let (between, error) = between_middles(a, b);
    let apart = between.norm();
    let gap_of_balls = apart - a.half - b.half - error;
    let by_balls = less_radii([gap_of_balls, apart + error], a, b);
    if goal.met(by_balls[0], by_balls[1]) {
        return by_balls;
    }
    let (u, v) = (a.along, b.along);
    // Each is the nearest to the last one.
    let t = v.dot(&between).clamp(-b.half, b.half);
    let s = u.dot(&(v * t - between)).clamp(-a.half, a.half);
    let t = v.dot(&(between + u * s)).clamp(-b.half, b.half);
    let way = between + u * s - v * t;
    let length = way.norm();
    // Not along a way that is all rounding, or of no length.
    let gap = if length > error { gap_along(&(way / length), &between, a, b) - error } else { gap_of_balls };
    less_radii([gap, length + error], a, b)
}

/// The gap between the axes across a unit vector, by the way between their middles, metres.
fn gap_along(n: &Vector3<f64>, between: &Vector3<f64>, a: &Axis, b: &Axis) -> f64 {
    n.dot(between) - a.half * n.dot(&a.along).abs() - b.half * n.dot(&b.along).abs()
}

/// The signed distance of two capsules, as narrow as rounding allows. Never tied.
pub(super) fn of_axes(a: &Axis, b: &Axis, tolerance: f64) -> CapsuleDistance {
    let (between, error) = between_middles(a, b);
    let (u, v) = (a.along, b.along);
    let nearest_of_a = |t: f64| (u.dot(&(v * t - between))).clamp(-a.half, a.half);
    let nearest_of_b = |s: f64| (v.dot(&(between + u * s))).clamp(-b.half, b.half);
    // Again, for what rounding leaves of it along the first.
    let across = beside(beside(v, &u), &u);
    let sin_squared = across.norm_squared();
    // The place where both derivatives vanish, or about that: what it is off costs its square.
    let inner = if sin_squared > PARALLEL * PARALLEL {
        (across.dot(&between) / sin_squared).clamp(-b.half, b.half)
    } else {
        nearest_of_b(0.0)
    };
    // Each turn is the least along one axis.
    let turn = |t: f64| {
        let s = nearest_of_a(t);
        let t = nearest_of_b(s);
        (s, t, between + u * s - v * t)
    };
    let mut best = turn(inner);
    let mut length = best.2.norm();
    let is_inner = |s: f64, t: f64| [s.abs() < a.half, t.abs() < b.half];
    let (lower, n) = match across_way((a, b), (&between, &best.2, length), is_inner(best.0, best.1), error) {
        Some(proven) => proven,
        None => {
            for t in [nearest_of_b(a.half), nearest_of_b(-a.half), b.half, -b.half] {
                let other = turn(t);
                if other.2.norm_squared() < best.2.norm_squared() {
                    best = other;
                }
            }
            length = best.2.norm();
            parting((a, b), (&between, &best.2), &across, is_inner(best.0, best.1), error)
        }
    };
    let (s, t, _) = best;
    let [lower, upper] = less_radii([lower - error, length + error], a, b);
    // Below rounding there is no direction from one axis to the other.
    let normal = (length > error).then_some(n);
    let (x, y) = (a.at(s), b.at(t));
    let out = normal.unwrap_or_default();
    CapsuleDistance {
        status: Status::of(upper - lower <= tolerance),
        lower,
        upper,
        witness: x - out * a.radius,
        witness_of_capsule: y + out * b.radius,
        normal,
        tied: false,
        iterations: 1,
    }
}

/// The gap between the axes across the way between two of their points, of this length, and the
/// unit vector of that, where it is the distance within rounding and the direction is known; there
/// is nothing to gain by others then.
fn across_way(
    (a, b): (&Axis, &Axis),
    (between, way, length): (&Vector3<f64>, &Vector3<f64>, f64),
    inner: [bool; 2],
    error: f64,
) -> Option<(f64, Vector3<f64>)> {
    if !(length * ALIGNED > error) {
        return None;
    }
    let n = way / length;
    let is_across =
        [(a, inner[0]), (b, inner[1])].iter().all(|(axis, inner)| !inner || n.dot(&axis.along).abs() <= ALIGNED);
    let gap = gap_along(&n, between, a, b);
    (is_across && gap >= length - error).then_some((gap, n))
}

/// The largest gap between the axes along the way between their nearest points, or what is left of
/// it across one of them or both; and the unit vector of that. Of gaps that are the same within
/// rounding, `error` metres, the vector across those axes counts in whose middle the nearest point
/// is, by `inner`.
fn parting(
    (a, b): (&Axis, &Axis),
    (between, way): (&Vector3<f64>, &Vector3<f64>),
    across: &Vector3<f64>,
    inner: [bool; 2],
    error: f64,
) -> (f64, Vector3<f64>) {
    let (u, v) = (a.along, b.along);
    let both = if across.norm() > PARALLEL {
        let rest = across.normalize();
        let once = beside(beside(*way, &u), &rest);
        // Of axes that cross nothing is left.
        let crossing = u.cross(&rest);
        let once = if once.norm() > CROSSING * way.norm() { once } else { crossing * crossing.dot(between).signum() };
        // Again, for the sake of what the first time leaves.
        beside(beside(once, &u), &rest)
    } else {
        beside(beside(*way, &u), &v)
    };
    let gap = |n: &Vector3<f64>| gap_along(n, between, a, b);
    let mut best = (f64::NEG_INFINITY, Vector3::zeros());
    let ways = [*way, beside(*way, &u), beside(*way, &v), both];
    for way in ways {
        let Some(n) = way.try_normalize(0.0) else { continue };
        let gap = gap(&n);
        if gap > best.0 {
            best = (gap, n);
        }
    }
    let likely = ways[usize::from(inner[0]) + 2 * usize::from(inner[1])].try_normalize(0.0);
    if let Some(n) = likely.filter(|n| gap(n) >= best.0 - error) {
        best.1 = n;
    }
    if best.0 <= 0.0 {
        // They meet in a point or along a line, or all but that: any direction across both has a
        // gap of 0.
        let n = beside(Vector3::ith(u.iamin(), 1.0), &u).normalize();
        let n = if across.norm() > PARALLEL { u.cross(across).normalize() } else { n };
        let gap = gap(&n);
        if gap > best.0 || best.1 == Vector3::zeros() {
            best = (gap, n);
        }
    }
    best
}

/// What is left of a vector across an axis.
fn beside(w: Vector3<f64>, axis: &Vector3<f64>) -> Vector3<f64> {
    w - axis * (axis.dot(&w) / axis.norm_squared())
}
