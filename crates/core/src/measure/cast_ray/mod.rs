//! Ray cast: where a ray enters a body.
//!
//! Along a ray every constraint is a convex polynomial of one variable. Its values and slopes bound
//! the entry from both sides (`solver/convex_root_bracket.rs`); its curvature gives the next trial
//! parameter, and an interpolation of its values, which proves nothing, the first. All in the
//! normalized coordinates of the body, into which the ray is taken once: `z(τ) = z_0 + τ ż`, τ
//! measured from the point closest to the centre of the circumscribed ball, so that a far origin
//! costs one rounding of its own size and no more. Boxes, cylinders and balls are entered where
//! their closed forms say (`closed_form.rs`), but where the ray grazes them.

mod answer;
mod approach;
mod closed_form;
mod normalized_ray;
mod ray;
#[cfg(test)]
mod tests;

use crate::body::{Body, Solid};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
pub use answer::{RayCast, RayHit};
pub(super) use approach::Approach;
pub(super) use closed_form::{ShapeEntry, enter};
use nalgebra::Vector3;
use normalized_ray::NormalizedRay;
pub use ray::{Ray, RayError};

/// First point of a body on a ray; with several parts the first of all.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not. A ray that starts inside hits at 0.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, Ray, RayCast, cast_ray};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let ray = Ray::new(Vector3::new(-3.0, 0.3, 0.0), Vector3::x(), f64::INFINITY)?;
/// let RayCast::Hit(hit) = cast_ray(&ball, &Pose::identity(), &ray, &Options::default()) else { panic!("a miss") };
/// assert!((hit.upper - 2.6).abs() < 1e-9);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn cast_ray(solid: &impl Solid, pose: &Pose, ray: &Ray, options: &Options<'_>) -> RayCast {
    first_hit(solid, ray, options, |part, ray, tolerance| cast_at(part, pose, ray, tolerance, options))
}

/// The first hit among the parts of a solid; a hit shortens the ray for the parts after.
pub(super) fn first_hit(
    solid: &impl Solid,
    ray: &Ray,
    options: &Options<'_>,
    mut cast: impl FnMut(&Body, &Ray, f64) -> RayCast,
) -> RayCast {
    let tolerance = options.accuracy() * solid.circumscribed().radius;
    if let [body] = solid.parts() {
        return cast(body, ray, tolerance);
    }
    let mut ray = *ray;
    let mut first = RayCast::Miss;
    for part in solid.parts() {
        first = earlier(&first, &cast(part, &ray, tolerance), tolerance);
        if let RayCast::Hit(hit) = first {
            if hit.upper == 0.0 {
                break;
            }
            ray.max_length = hit.upper;
        }
    }
    first
}

/// The cast against the union of what two casts met.
fn earlier(one: &RayCast, other: &RayCast, tolerance: f64) -> RayCast {
    let sooner = |hit: &RayHit, lower: f64| {
        let lower = hit.lower.min(lower);
        let status = Status::of(hit.upper - lower <= tolerance);
        RayCast::Hit(RayHit { lower, status, ..*hit })
    };
    match (one, other) {
        (RayCast::Miss, found) | (found, RayCast::Miss) => *found,
        (RayCast::Hit(one), RayCast::Hit(other)) => {
            let (first, second) = if one.upper <= other.upper { (one, other) } else { (other, one) };
            sooner(&RayHit { iterations: one.iterations + other.iterations, ..*first }, second.lower)
        }
        (RayCast::Hit(hit), RayCast::Undecided { lower, .. })
        | (RayCast::Undecided { lower, .. }, RayCast::Hit(hit)) => sooner(hit, *lower),
        (RayCast::Undecided { lower: a, upper: b }, RayCast::Undecided { lower: c, upper: d }) => {
            RayCast::Undecided { lower: a.min(*c), upper: b.max(*d) }
        }
    }
}

/// Most evaluations along one ray, or projections along the path of a ball; from outside 1 or 2 are
/// usual, of balls 3 to 6, and halving the bracket alone would need about 50.
pub(super) const MAX_STEPS: u32 = 96;

/// The first point of one body on a ray, bracketed within a tolerance in metres.
fn cast_at(body: &Body, pose: &Pose, ray: &Ray, tolerance: f64, options: &Options<'_>) -> RayCast {
    if runs(Stage::ClosedForm)
        && let Some(form) = body.closed_form()
        && let Some(found) = enter((form, pose), (ray, 0.0), tolerance, options)
    {
        return match found {
            ShapeEntry::Miss => RayCast::Miss,
            ShapeEntry::Hit { lower, upper, normal } => {
                let (status, point) = (Status::Converged, ray.point(upper));
                RayCast::Hit(RayHit { status, lower, upper, point, normal, iterations: 0 })
            }
        };
    }
    let Some((along, mut entry)) = NormalizedRay::new(body, pose, ray) else { return RayCast::Miss };
    // A little beyond a root being inside is provable, and the tangent is as good.
    let beyond = 0.25 * tolerance;
    let mut s = along.first(&entry, beyond);
    let mut normal = Vector3::zeros();
    // The last two steps, and how many evaluations in a row have changed nothing.
    let (mut steps, mut idle) = ([f64::INFINITY; 2], 0);
    let mut iterations = 0;
    while iterations < MAX_STEPS && !options.exhausted(iterations) {
        iterations += 1;
        let before = entry;
        let look = along.look(s, &mut entry);
        if entry.missed() {
            return RayCast::Miss;
        }
        if look.inside && s <= entry.inside {
            entry.touch(s);
            normal = look.normal;
        }
        idle = if entry == before { idle + 1 } else { 0 };
        if entry.inside.is_finite() && entry.width() <= tolerance || idle > 2 {
            break;
        }
        // Steps that do not shrink (Brent's rule) or help make way for a halving.
        let guess = if runs(Stage::Curvature) { look.guess + beyond } else { f64::NAN };
        let next = if (guess - s).abs() > 0.5 * steps[0] || idle > 0 { f64::NAN } else { guess };
        if !runs(Stage::Halving) && entry.safeguard(next) != next {
            break;
        }
        let next = entry.safeguard(next);
        steps = [steps[1], (next - s).abs()];
        s = next;
    }
    let lower = (along.base + entry.from).next_down().max(0.0);
    if entry.inside == f64::INFINITY {
        return RayCast::Undecided { lower, upper: (along.base + entry.to).next_up().min(ray.max_length) };
    }
    let started = entry.inside <= -along.base;
    let upper = if started { 0.0 } else { (along.base + entry.inside).next_up().min(ray.max_length) };
    RayCast::Hit(RayHit {
        status: Status::of(entry.width() <= tolerance),
        lower: lower.min(upper),
        upper,
        point: ray.point(upper),
        normal: if started { None } else { pose.transform_direction(&normal).try_normalize(0.0) },
        iterations,
    })
}
