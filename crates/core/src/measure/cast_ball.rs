//! Ball cast: where a ball swept along a ray first touches a body.
//!
//! The distance of the moving centre from the body is a convex function of the path, and a plane
//! that separates the centre from the body at one place bounds it everywhere: its lower bound there
//! is the value, and the normal times the direction the slope, of a tangent of `Entry`. So the
//! touch is found like the entry of a ray, from projections of the centre.

use crate::body::{Body, Solid};
use crate::measure::cast_ray::{Approach, MAX_STEPS, Ray, RayCast, RayError, RayHit, ShapeEntry, enter, first_hit};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::point::Projection;
use crate::measure::solver::exact_shape::{PointOffset, PointSide, offset_of_point};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// A ball that moves along a ray; checked when made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sweep {
    ray: Ray,
    radius: f64,
}

impl Sweep {
    /// The ball of `radius` metres whose centre moves along the ray.
    ///
    /// # Errors
    /// A radius that is not positive and finite.
    pub fn new(ray: Ray, radius: f64) -> Result<Self, RayError> {
        if radius > 0.0 && radius.is_finite() { Ok(Self { ray, radius }) } else { Err(RayError::Radius(radius)) }
    }
}

/// First parameter at which a ball swept along a ray touches a solid.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not; its lower end is never late. A ball that touches at the start hits
/// at 0. The point of a hit is the body's, not that of the ray.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, Ray, Sweep, cast_ball};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let ray = Ray::new(Vector3::new(-3.0, 0.0, 0.0), Vector3::x(), f64::INFINITY)?;
/// let found = cast_ball(&ball, &Pose::identity(), &Sweep::new(ray, 0.2)?, &Options::default());
/// assert!(found.hit().is_some_and(|hit| (hit.upper - 2.3).abs() < 1e-8));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cast_ball(solid: &impl Solid, pose: &Pose, sweep: &Sweep, options: &Options<'_>) -> RayCast {
    first_hit(solid, &sweep.ray, options, |part, ray, tolerance| {
        cast_at(part, pose, &Sweep { ray: *ray, ..*sweep }, tolerance, options)
    })
}

fn cast_at(body: &Body, pose: &Pose, sweep: &Sweep, tolerance: f64, options: &Options<'_>) -> RayCast {
    let Sweep { ray, radius } = sweep;
    if let Some(found) = at_shape(body, pose, sweep, tolerance, options) {
        return found;
    }
    // Where the swept ball touches the circumscribed one.
    let ball = body.circumscribed();
    let approach = Approach::within(ball.radius + radius, &ball.center, pose, ray);
    let Some(Approach { base, mut entry, .. }) = approach.filter(|approach| !approach.entry.missed()) else {
        return RayCast::Miss;
    };
    let projection = Projection::rough(body, pose);
    let mut warm = WarmStart::default();
    let mut s = entry.from;
    let (mut steps, mut idle, mut last) = ([f64::INFINITY; 2], 0, None::<(f64, f64)>);
    let mut hit = None;
    let mut iterations = 0;
    for _ in 0..MAX_STEPS {
        let before = entry;
        let center = ray.point(base + s);
        // Adding rounds: the centre may be off by this much.
        let off = gamma(4) * (ray.origin().norm() + (base + s).abs());
        let found = projection.to(&center, 0.05 * tolerance, options, &mut warm);
        iterations += found.iterations + 1;
        let slope = found.plane.dot(ray.direction());
        let error = ROTATION_ERROR + gamma(16);
        let excess = found.lower - radius - off - 4.0 * f64::EPSILON * radius;
        if found.plane != Vector3::zeros() && found.lower > 0.0 {
            entry.cut(s, excess, slope - error, slope + error);
        }
        if entry.missed() {
            return RayCast::Miss;
        }
        if found.upper + off <= *radius && s <= entry.inside {
            entry.touch(s);
            hit = Some(found);
        }
        idle = if entry == before { idle + 1 } else { 0 };
        if entry.inside.is_finite() && entry.width() <= tolerance || idle > 2 || options.exhausted(iterations) {
            break;
        }
        // The curvature is that of the last two slopes.
        let curvature = last.map_or(0.0, |(at, was)| ((slope - was) / (s - at)).max(0.0));
        last = Some((s, slope));
        let discriminant = slope * slope - 2.0 * excess * curvature;
        let step = if slope >= 0.0 || discriminant < 0.0 {
            -slope / curvature
        } else {
            2.0 * excess / (discriminant.sqrt() - slope)
        };
        let guess = if runs(Stage::Curvature) { s + step + 0.25 * tolerance } else { f64::NAN };
        let next = if (guess - s).abs() > 0.5 * steps[0] || idle > 0 { f64::NAN } else { guess };
        if !runs(Stage::Halving) && entry.safeguard(next) != next {
            break;
        }
        let next = entry.safeguard(next);
        steps = [steps[1], (next - s).abs()];
        s = next;
    }
    let lower = (base + entry.from).next_down().max(0.0);
    let upper = (base + entry.end()).next_up().min(ray.max_length());
    let Some(found) = hit else { return RayCast::Undecided { lower, upper } };
    let started = entry.inside <= -base;
    let upper = if started { 0.0 } else { upper };
    RayCast::Hit(RayHit {
        status: Status::of(entry.width() <= tolerance),
        lower: lower.min(upper),
        upper,
        point: found.witness,
        normal: found.normal.try_normalize(0.0).filter(|_| found.upper > 0.0),
        iterations,
    })
}

/// The cast at a ball or a box by its closed form; none at others, and where it is not as accurate
/// as asked for.
fn at_shape(
    body: &Body,
    pose: &Pose,
    Sweep { ray, radius }: &Sweep,
    tolerance: f64,
    options: &Options<'_>,
) -> Option<RayCast> {
    let form = body.closed_form().filter(|_| runs(Stage::ClosedForm))?;
    let (lower, upper) = match enter((form, pose), (ray, *radius), tolerance, options)? {
        ShapeEntry::Miss => return Some(RayCast::Miss),
        ShapeEntry::Hit { lower, upper, .. } => (lower, upper),
    };
    let center = ray.point(upper);
    let (point, normal) = match offset_of_point((form, pose), &center) {
        PointSide::Outside(PointOffset { witness, normal, .. }) => (witness, Some(normal)),
        PointSide::Inside => (center, None),
        PointSide::Open => return None,
    };
    Some(RayCast::Hit(RayHit { status: Status::Converged, lower, upper, point, normal, iterations: 0 }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::distance_to_point;
    use crate::measure::tests::{random_pose, zoo};
    use sublevel_testkit::Seeded;

    #[test]
    fn balls_meet_when_their_centres_are_near() {
        let ball = Body::ball("ball", Vector3::zeros(), 0.7).unwrap();
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let radius = 10_f64.powf(2.0 * random.signed());
            let reach = 0.7 + radius;
            let pose = random_pose(&mut random, 1.0);
            let d = random.unit();
            let side = d.cross(&random.unit()).normalize();
            // Head on, and grazing from either side.
            let aside = reach * [0.0, 0.5, 1.0 - 1e-6, 1.0 + 1e-6, 1.1][(seed % 5) as usize];
            let back = reach * (1.5 + random.signed());
            let origin = pose.translation() + side * aside - d * back;
            let sweep = Sweep::new(Ray::new(origin, d, f64::INFINITY).unwrap(), radius).unwrap();
            let found = cast_ball(&ball, &pose, &sweep, &Options::default());
            let o = origin - pose.translation();
            let discriminant = reach * reach - aside * aside;
            let label = format!("seed {seed} aside {}: {found:?}", aside / reach);
            if discriminant < 0.0 {
                assert_eq!(found, RayCast::Miss, "{label}");
            } else if o.norm() <= reach {
                assert!(found.hit().is_some_and(|hit| hit.upper == 0.0), "{label}");
            } else {
                let truth = back - discriminant.sqrt();
                let hit = found.hit().unwrap_or_else(|| panic!("{label}"));
                // The oracle's own rounding, enlarged by grazing.
                let slack = 1e-14 * reach * reach / discriminant.sqrt() * 4.0;
                assert!(hit.lower <= truth + slack && truth - slack <= hit.upper, "{label} {truth}");
                // At so small an angle the bracket of a distance of 1e-11 spans more of the path
                // than is asked for.
                assert!(
                    hit.status == Status::Converged || seed % 5 == 2 && hit.upper - hit.lower < 1e-7 * reach,
                    "{label}"
                );
            }
        }
    }

    #[test]
    fn sweeps_agree_with_sampling() {
        let zoos: Vec<_> = (0..4).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut hits, mut most) = (0, 0);
        for seed in 0..400 {
            let mut random = Seeded(5_000 + seed);
            let bodies = &zoos[(seed % 4) as usize];
            let body = &bodies[random.next() as usize % bodies.len()];
            let size = body.circumscribed().radius;
            let pose = random_pose(&mut random, 1.0);
            let center = pose.transform_point(&body.circumscribed().center);
            let origin = center + random.unit() * size * 4.0;
            let aim = center + random.unit() * size * 1.3 - origin;
            let radius = size * 10_f64.powf(-1.0 + random.signed());
            let ray = Ray::new(origin, aim, 10.0 * size).unwrap();
            let found = cast_ball(body, &pose, &Sweep::new(ray, radius).unwrap(), &Options::default());
            let mut warm = WarmStart::default();
            let mut at = |s: f64| {
                distance_to_point(body, &pose, &ray.point(s), &Options::default(), &mut warm).unwrap().value() - radius
            };
            let label = format!("seed {seed} {} radius {radius}: {found:?}", body.name());
            let touched = (0..=400).map(|k| f64::from(k) * size / 40.0).find(|s| at(*s) <= 0.0);
            match found {
                RayCast::Hit(hit) => {
                    hits += 1;
                    most = most.max(hit.iterations);
                    assert!(hit.status == Status::Converged, "{label}");
                    // Never late: all before is apart, and at the upper end it touches.
                    assert!(touched.is_none_or(|s| s >= hit.lower), "{label}");
                    assert!(at(hit.upper) <= 1e-8 * size, "{label}");
                    if hit.lower > 0.0 {
                        assert!(at(hit.lower - 1e-8 * size) >= -1e-8 * size, "{label}");
                    }
                    assert!(((hit.point - ray.point(hit.upper)).norm() - radius).abs() < 1e-8 * size, "{label}");
                }
                RayCast::Miss => assert!(touched.is_none(), "{label}: touched at {touched:?}"),
                RayCast::Undecided { .. } => panic!("{label}"),
            }
        }
        assert!(hits > 100 && most < 60, "{hits} {most}");
    }

    #[test]
    fn sweeps_are_checked() {
        let ray = Ray::new(Vector3::zeros(), Vector3::x(), 1.0).unwrap();
        for radius in [0.0, -1.0, f64::NAN, f64::INFINITY] {
            assert!(matches!(Sweep::new(ray, radius), Err(RayError::Radius(_))));
        }
    }
}
