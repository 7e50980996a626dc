//! Ray cast: where a ray enters a body.
//!
//! Along a ray every constraint is a convex polynomial of one variable. Its values and slopes bound
//! the entry from both sides ([`Entry`]); its curvature says where to look next, and an
//! interpolation of its values, which proves nothing, where to look first. All in the normalized
//! coordinates of the body, into which the ray is taken once: `z(τ) = z_0 + τ ż`, τ measured from
//! the point closest to the centre of the circumscribed ball, so that a far origin costs one
//! rounding of its own size and no more.

use crate::body::{Body, MAX_CONSTRAINTS, Solid};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::options::Options;
use crate::measure::solver::convex_root_bracket::Entry;
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
use crate::polynomial::{Polynomial, gamma};
use nalgebra::{Matrix3, Vector3};

/// A ray of finite or infinite length in the world frame; checked when made.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::Ray;
///
/// let ray = Ray::new(Vector3::zeros(), Vector3::new(0.0, 3.0, 0.0), 10.0)?;
/// assert_eq!(ray.point(2.0), Vector3::new(0.0, 2.0, 0.0));
/// assert!(Ray::new(Vector3::zeros(), Vector3::zeros(), 10.0).is_err());
/// # Ok::<(), sublevel_core::measure::RayError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    origin: Vector3<f64>,
    direction: Vector3<f64>,
    max_length: f64,
}

/// Why numbers are not a ray.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RayError {
    /// A coordinate is NaN or infinite, or too large.
    #[error("{0} of the ray is not finite, or beyond 1e15 m")]
    NotFinite(&'static str),
    /// A direction without length.
    #[error("the direction of the ray is zero")]
    NoDirection,
    /// A length that is not positive.
    #[error("the ray is {0} m long; give a length above 0, which may be infinite")]
    Length(f64),
    /// A radius of the swept ball that is not positive.
    #[error("the swept ball has radius {0} m; give a radius above 0, or cast a ray")]
    Radius(f64),
}

impl Ray {
    /// The ray from `origin` (m) along `direction` (any length but zero; normalised) over
    /// `max_length` metres, which may be infinite.
    ///
    /// # Errors
    /// Numbers that are not finite, a zero direction, or a length that is not above 0.
    pub fn new(origin: Vector3<f64>, direction: Vector3<f64>, max_length: f64) -> Result<Self, RayError> {
        // Not `>`: a NaN is refused too.
        if !(origin.amax() <= 1e15 && origin.iter().all(|value| value.is_finite())) {
            return Err(RayError::NotFinite("origin"));
        }
        if !direction.iter().all(|value| value.is_finite()) {
            return Err(RayError::NotFinite("direction"));
        }
        let largest = direction.amax();
        if !(largest > 0.0) {
            return Err(RayError::NoDirection);
        }
        if !(max_length > 0.0) {
            return Err(RayError::Length(max_length));
        }
        Ok(Self { origin, direction: (direction / largest).normalize(), max_length })
    }

    /// Start, metres.
    pub fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// Direction, of length 1 up to rounding; parameters along the ray multiply this vector.
    pub fn direction(&self) -> &Vector3<f64> {
        &self.direction
    }

    /// Length, metres.
    pub fn max_length(&self) -> f64 {
        self.max_length
    }

    /// The point at a parameter in metres.
    pub fn point(&self, parameter: f64) -> Vector3<f64> {
        self.origin + self.direction * parameter
    }
}

/// What a ray, or a ball swept along it, meets.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum RayCast {
    /// Nothing: proven.
    Miss,
    /// The body: proven, with a bracket of where it is entered.
    Hit(RayHit),
    /// The ray passes within rounding of the surface, or the iterations ran out: if it enters the
    /// body at all, then first between these two parameters, metres.
    Undecided {
        /// No point of the body comes before; proven.
        lower: f64,
        /// The first point of the body, if there is one, does not come after; proven.
        upper: f64,
    },
}

impl RayCast {
    /// The hit, if there is one.
    pub fn hit(&self) -> Option<&RayHit> {
        if let Self::Hit(hit) = self { Some(hit) } else { None }
    }
}

/// Where a body is entered; metres, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayHit {
    /// How the solve ended.
    pub status: Status,
    /// No point of the body comes before this parameter; proven. 0 if the ray starts inside.
    pub lower: f64,
    /// The ray has entered the body by this parameter; proven. 0 if the ray starts inside.
    pub upper: f64,
    /// The point of the ray at `upper`; for a swept ball the point of the body that it touches.
    pub point: Vector3<f64>,
    /// Outward unit normal there; none if the ray starts inside.
    pub normal: Option<Vector3<f64>>,
    /// Iterations.
    pub iterations: u32,
}

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

/// Most evaluations along one ray; from outside 1 or 2 are usual, and halving the bracket alone
/// would need about 50.
const MAX_STEPS: u32 = 96;

fn cast_at(body: &Body, pose: &Pose, ray: &Ray, tolerance: f64, options: &Options<'_>) -> RayCast {
    let Some((along, mut entry)) = Along::new(body, pose, ray) else { return RayCast::Miss };
    // A little beyond a root being inside is provable, and the tangent is as good.
    let beyond = 0.25 * tolerance;
    let mut s = along.first(&entry, beyond);
    let mut normal = Vector3::zeros();
    // The last two steps, and how many looks in a row have changed nothing.
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

/// A ray in the normalized coordinates of a body: `z(τ) = z_0 + τ ż`.
struct Along<'a> {
    body: &'a Body,
    /// Parameter of the ray at τ = 0.
    base: f64,
    start: Vector3<f64>,
    velocity: Vector3<f64>,
    /// Bounds of the errors of the components of z and of ż.
    start_error: Vector3<f64>,
    velocity_error: Vector3<f64>,
    /// Bounds of the error of the value, but for that by the error of z to first order, and of each
    /// component of the gradient, of each constraint.
    errors: [(f64, f64); MAX_CONSTRAINTS],
}

/// What one evaluation says.
struct Look {
    inside: bool,
    /// Where the entry is expected.
    guess: f64,
    /// Gradient of the largest constraint in the body frame.
    normal: Vector3<f64>,
}

impl<'a> Along<'a> {
    /// The ray and the interval of τ where it is in the circumscribed ball and within the bounds of
    /// the normalized coordinates; none if there is no such τ.
    fn new(body: &'a Body, pose: &Pose, ray: &Ray) -> Option<(Self, Entry)> {
        let turn: Matrix3<f64> = pose.rotation().to_rotation_matrix().into_inner();
        let offset = ray.origin - pose.translation();
        let ball = body.circumscribed();
        let direction = turn.tr_mul(&ray.direction);
        let from_ball = turn.tr_mul(&offset) - ball.center;
        let base = -from_ball.dot(&direction);
        let closest = from_ball + direction * base;
        // All that is rounded before normalization moves a point of the ray by at most this much.
        let center = body.normalization().center;
        let far = offset.norm() + base.abs() + 2.0 * ball.radius;
        let relative = ROTATION_ERROR + gamma(16);
        let moved = relative * far + gamma(8) * (ball.center.norm() + center.norm());
        let reach = ball.radius * (1.0 + 1e-14) + moved;
        let half = reach * reach - closest.norm_squared();
        if half < 0.0 {
            return None;
        }
        let half = half.sqrt() * (1.0 + 1e-14) + moved;
        let mut entry = Entry::between((-half).max(-base), half.min(ray.max_length - base));

        let linear = &body.normalization().linear;
        let from_center = closest + (ball.center - center);
        let (start, velocity) = (linear * from_center, linear * direction);
        let rows = body.placement().row_norms();
        let start_error = rows * (moved + gamma(8) * (from_center.norm() + 2.0 * reach)) * (1.0 + 1e-14);
        let velocity_error = rows * relative;
        // The slabs of the normalized coordinates, wider by what the line may be off in the ball.
        let far = entry.from.abs().max(entry.to.abs());
        let extent = body.z_extent() + start_error;
        let slab = (extent + velocity_error * far) * (1.0 + 1e-14);
        for i in 0..3 {
            if velocity[i] == 0.0 && start[i].abs() <= slab[i] {
                continue;
            }
            let [one, other] = [-slab[i], slab[i]].map(|side| (side - start[i]) / velocity[i]);
            entry.clip(one.min(other), one.max(other));
        }
        if entry.missed() {
            return None;
        }
        let mut errors = [(0.0, 0.0); MAX_CONSTRAINTS];
        let corner = extent * (1.0 + 1e-6);
        for (constraint, errors) in body.constraints().iter().zip(&mut errors) {
            let polynomial = &constraint.polynomial;
            *errors = (
                polynomial.value_error(&corner, &Vector3::zeros(), &start_error),
                polynomial.gradient_error(&corner, &start_error),
            );
        }
        Some((Self { body, base, start, velocity, start_error, velocity_error, errors }, entry))
    }

    /// Where to look first: the start of a ray that may start inside, else where the last
    /// constraint is entered, as values along the ray have it.
    fn first(&self, entry: &Entry, beyond: f64) -> f64 {
        if entry.from <= -self.base || !runs(Stage::Interpolation) {
            return entry.from;
        }
        let (middle, half) = (0.5 * (entry.from + entry.to), 0.5 * (entry.to - entry.from));
        let (z, step) = (self.start + self.velocity * middle, self.velocity * half);
        let entered = |polynomial: &Polynomial| middle + half * polynomial.first_below_along(&z, &step, 1.0);
        let last = self.body.constraints().iter().map(|c| entered(&c.polynomial)).fold(entry.from, f64::max);
        // Beyond the interval nothing is proven.
        (last + beyond).min(entry.to)
    }

    /// All constraints at τ = s: cuts the interval with their tangents.
    #[inline]
    fn look(&self, s: f64, entry: &mut Entry) -> Look {
        let z = self.start + self.velocity * s;
        let mut look = Look { inside: true, guess: f64::NEG_INFINITY, normal: Vector3::zeros() };
        let mut largest = f64::NEG_INFINITY;
        let depth = 1.0 - self.body.min_value();
        for (constraint, (value_error, gradient_error)) in self.body.constraints().iter().zip(&self.errors) {
            let jet = constraint.polynomial.evaluate(&z);
            let magnitudes = jet.gradient.abs();
            let value = jet.value - 1.0;
            let slope = jet.gradient.dot(&self.velocity);
            let value_error = (value_error + magnitudes.dot(&self.start_error)) * (1.0 + 1e-14) + 2e-16 * value.abs();
            let slope_error = (gradient_error * self.velocity.abs().sum()
                + magnitudes.add_scalar(*gradient_error).dot(&self.velocity_error)
                + gamma(4) * magnitudes.dot(&self.velocity.abs()))
                * (1.0 + 1e-14);
            // Not `>`: a NaN is not inside.
            look.inside &= value + value_error <= 0.0;
            entry.cut(s, value - value_error, slope - slope_error, slope + slope_error);
            let curvature = self.velocity.dot(&(jet.hessian * self.velocity));
            if slope < 0.0 {
                look.guess = look.guess.max(s + step(value, slope, curvature, depth));
            } else if value > 0.0 {
                // Beyond the lowest point: the next guess is there.
                look.guess = look.guess.max(s - slope / curvature);
            }
            if value > largest {
                (largest, look.normal) = (value, jet.gradient);
            }
        }
        look.normal = self.body.normalization().linear.tr_mul(&look.normal);
        look
    }
}

/// Step from a point with this value `f - 1`, negative slope and curvature to the root of a model
/// of f, or to its lowest point if it has no root.
///
/// Near the surface the model is the quadratic with these derivatives; far outside it is the power
/// `(σ - s)^j` above the least value `1 - depth`, which the terms of highest degree make of f
/// there.
#[inline]
fn step(value: f64, slope: f64, curvature: f64, depth: f64) -> f64 {
    let above = value + depth;
    if value > depth {
        let power = (1.0 / (1.0 - above * curvature / (slope * slope))).clamp(1.0, 8.0);
        return power * above / -slope * (1.0 - (depth / above).powf(1.0 / power));
    }
    let discriminant = slope * slope - 2.0 * value * curvature;
    if discriminant >= 0.0 { 2.0 * value / (discriminant.sqrt() - slope) } else { -slope / curvature }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Compound;
    use crate::measure::tests::{random_pose, zoo};
    use nalgebra::UnitQuaternion;
    use sublevel_testkit::Seeded;

    fn cast(solid: &impl Solid, pose: &Pose, ray: &Ray) -> RayCast {
        cast_ray(solid, pose, ray, &Options::default())
    }

    /// First parameter at which the ray is in the body by the closed form of balls and boxes in
    /// their own frames.
    fn ball_entry(radius: f64, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<f64> {
        let (b, c) = (o.dot(d), o.norm_squared() - radius * radius);
        let discriminant = b * b - c;
        (c > 0.0 && b < 0.0 && discriminant >= 0.0).then(|| -b - discriminant.sqrt()).or((c <= 0.0).then_some(0.0))
    }

    fn box_entry(half: &Vector3<f64>, o: &Vector3<f64>, d: &Vector3<f64>) -> Option<f64> {
        let (mut from, mut to) = (0.0_f64, f64::INFINITY);
        for i in 0..3 {
            let (one, other) = ((-half[i] - o[i]) / d[i], (half[i] - o[i]) / d[i]);
            from = from.max(one.min(other));
            to = to.min(one.max(other));
        }
        (from <= to).then_some(from)
    }

    #[test]
    fn rays_that_end_before_the_surface_do_not_hit() {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        for seed in 0..2000 {
            let mut random = Seeded(seed);
            let pose = random_pose(&mut random, 1.0);
            let d = if seed % 2 == 0 { Vector3::repeat(1.0).normalize() } else { random.unit() };
            let aside = d.cross(&random.unit()) * if seed % 3 == 0 { 0.0 } else { 1.1 * random.signed().abs() };
            let Some(truth) = ball_entry(1.0, &(aside - d * 3.0), &d) else { continue };
            let short = 10_f64.powi(-2 - (seed % 9) as i32);
            let origin = pose.transform_point(&(aside - d * 3.0));
            let ray = Ray::new(origin, pose.transform_direction(&d), truth - short).unwrap();
            let accuracy = [1.0, 1e-3, 1e-6, 1e-9][(seed / 9 % 4) as usize];
            let options = Options::default().with_accuracy(accuracy).unwrap();
            let found = cast_ray(&ball, &pose, &ray, &options);
            assert!(found.hit().is_none(), "seed {seed}, {short} short, accuracy {accuracy}: {found:?}");
        }
    }

    #[test]
    fn balls_and_boxes_have_closed_forms() {
        let (mut hits, mut misses) = (0, 0);
        let bodies: Vec<_> = (0..20)
            .map(|seed| {
                let mut random = Seeded(seed);
                let scale = 10_f64.powi((seed % 5) as i32 * 3 - 6);
                let half = Vector3::from_fn(|_, _| scale * 4_f64.powf(random.signed()));
                let ball = || Body::ball("b", Vector3::zeros(), half.x);
                (scale, half, if seed % 2 == 0 { Body::cuboid("b", half) } else { ball() }.unwrap())
            })
            .collect();
        for seed in 0..4000 {
            let mut random = Seeded(seed);
            let (scale, half, body) = &bodies[(seed % 20) as usize];
            let (scale, is_box) = (*scale, seed % 2 == 0);
            let size = body.circumscribed().radius;
            let pose = random_pose(&mut random, scale * 3.0);
            let o = random.unit() * size * 6_f64.powf(1.0 + random.signed()) * 0.3;
            // Half of the rays aim at the surface's edge: grazing on purpose.
            let side = random.unit().cross(&o).normalize();
            let aim =
                if seed % 4 < 2 { random.unit() * size * 0.7 } else { side * half.x * (1.0 + 1e-3 * random.signed()) };
            let d = (aim - o).normalize();
            let length = if seed % 7 == 0 { o.norm() } else { f64::INFINITY };
            let world = |v: &Vector3<f64>| pose.transform_direction(v);
            let ray = Ray::new(world(&o) + pose.translation(), world(&d), length).unwrap();
            let truth = if is_box { box_entry(half, &o, &d) } else { ball_entry(half.x, &o, &d) };
            let truth = truth.filter(|s| *s <= length);
            let found = cast(body, &pose, &ray);
            let label = format!("seed {seed}: {found:?} against {truth:?}");
            match (found, truth) {
                (RayCast::Hit(hit), Some(truth)) => {
                    hits += 1;
                    // The oracle itself rounds: by a root at grazing incidence.
                    let slack = 1e-12 * size + 1e-13 * o.norm();
                    assert!(hit.status == Status::Converged && hit.upper - hit.lower <= 1e-9 * size, "{label}");
                    assert!((hit.upper - truth).abs() <= 1e-9 * size + slack * 1e4 || seed % 4 >= 2, "{label}");
                    let x = pose.rotation().inverse_transform_vector(&(hit.point - pose.translation()));
                    assert!(body.value(&x) <= 1.0 + 1e-9, "{label}");
                    assert_eq!(hit.normal.is_none(), truth == 0.0, "{label}");
                    assert!(hit.normal.is_none_or(|n| n.dot(ray.direction()) <= 1e-6), "{label}");
                }
                (RayCast::Miss, None) => misses += 1,
                // Only where the ray grazes may the answer be open or the oracle wrong by rounding.
                (found, _) => {
                    let nearest = -o.dot(&d);
                    let least = (0..20_000)
                        .map(|k| {
                            body.value(&(o + d * (nearest + size * (f64::from(k) / 1e4 - 1.0)).clamp(0.0, length)))
                        })
                        .fold(f64::MAX, f64::min);
                    assert!((least - 1.0).abs() < 1e-6, "{label}: {found:?}, least {least}");
                }
            }
        }
        assert!(hits > 1000 && misses > 400, "{hits} {misses}");
    }

    /// Everything with curvature against dense sampling of the constraint along the ray and
    /// bisection.
    #[test]
    fn curved_bodies_agree_with_sampling() {
        let (mut hits, mut misses) = (0, 0);
        let zoos: Vec<_> = (0..8).map(|seed| zoo(&mut Seeded(seed))).collect();
        for seed in 0..4000 {
            let mut random = Seeded(77_000 + seed);
            let bodies = &zoos[(seed % 8) as usize];
            let body = &bodies[random.next() as usize % bodies.len()];
            let ball = body.circumscribed();
            let pose = random_pose(&mut random, 2.0);
            let o = ball.center + random.unit() * ball.radius * (1.0 + 3.0 * random.signed().abs());
            let aim = ball.center + random.unit() * ball.radius * 0.4;
            let d = (aim - o).normalize();
            let ray = Ray::new(pose.transform_point(&o), pose.transform_direction(&d), f64::INFINITY).unwrap();
            let found = cast(body, &pose, &ray);
            let value = |s: f64| body.value(&(o + d * s));
            // Golden-section search for the lowest point of the convex restriction, then bisection.
            let (mut a, mut b) = (0.0, 8.0 * ball.radius);
            for _ in 0..200 {
                let (p, q) = (a + 0.381_966 * (b - a), a + 0.618_034 * (b - a));
                if value(p) < value(q) { b = q } else { a = p }
            }
            let lowest = 0.5 * (a + b);
            let label = format!("seed {seed} {}: {found:?}, lowest {} at {lowest}", body.name(), value(lowest));
            if value(lowest) > 1.0 + 1e-9 {
                misses += 1;
                assert_eq!(found, RayCast::Miss, "{label}");
            } else if value(lowest) < 1.0 - 1e-9 {
                hits += 1;
                let (mut out, mut inside) = (0.0, lowest);
                if value(0.0) > 1.0 {
                    for _ in 0..200 {
                        let middle = 0.5 * (out + inside);
                        if value(middle) <= 1.0 { inside = middle } else { out = middle }
                    }
                } else {
                    inside = 0.0;
                }
                let hit = found.hit().unwrap_or_else(|| panic!("{label}"));
                let slope = (value(inside) - value(inside - 1e-6 * ball.radius)) / (1e-6 * ball.radius);
                let slack = 1e-13 * ball.radius + 1e-12 / slope.abs().max(1e-3);
                assert!(hit.lower <= inside + slack && inside - slack <= hit.upper, "{label}: {inside}");
                assert!(hit.status == Status::Converged, "{label}");
            }
        }
        assert!(hits > 100 && misses > 100, "{hits} {misses}");
    }

    #[test]
    fn tangency_within_rounding_is_admitted() {
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let degree = [2, 4, 6, 8][(seed % 4) as usize];
            let body = Body::superellipsoid("q", Vector3::zeros(), Vector3::repeat(1.0), degree).unwrap();
            for offset in [1e-3, 1e-9, 1e-12, 1e-15, 0.0] {
                for sign in [-1.0, 1.0] {
                    let origin = Vector3::new(-3.0 - random.signed(), 1.0 + sign * offset, 0.0);
                    let found = cast(&body, &Pose::identity(), &Ray::new(origin, Vector3::x(), f64::INFINITY).unwrap());
                    let label = format!("degree {degree}, {}: {found:?}", sign * offset);
                    match found {
                        RayCast::Miss => assert!(sign > 0.0 && offset >= 1e-12, "{label}"),
                        RayCast::Hit(hit) => {
                            assert!(sign < 0.0 && offset >= 1e-15, "{label}");
                            let truth = -origin.x
                                - (1.0 - (1.0 - offset).powi(i32::from(degree))).powf(1.0 / f64::from(degree));
                            assert!(hit.lower <= truth + 1e-6 && truth <= hit.upper + 1e-6, "{label}: {truth}");
                        }
                        RayCast::Undecided { lower, upper } => {
                            assert!(offset <= 1e-12 && lower <= -origin.x && upper >= -origin.x, "{label}");
                        }
                    }
                }
            }
        }
    }

    #[test]
    fn rays_begin_and_end() {
        let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
        let along = |x: f64, length: f64| {
            cast(&ball, &Pose::identity(), &Ray::new(Vector3::new(x, 0.0, 0.0), Vector3::x(), length).unwrap())
        };
        assert_eq!(along(-3.0, 1.9), RayCast::Miss);
        assert!((along(-3.0, 2.1).hit().unwrap().upper - 2.0).abs() < 1e-9);
        assert_eq!(along(3.0, f64::INFINITY), RayCast::Miss);
        for x in [0.0, -0.999_999, 0.999_999] {
            let found = along(x, 1.0);
            let hit = found.hit().unwrap();
            assert!(hit.lower == 0.0 && hit.upper == 0.0 && hit.normal.is_none(), "{hit:?}");
        }
        // Far origins cost their own rounding and no more.
        let hit = *along(-1e9, f64::INFINITY).hit().unwrap();
        assert!(hit.lower <= 1e9 - 1.0 && hit.upper >= 1e9 - 1.0 && hit.upper - hit.lower < 1e-4, "{hit:?}");
    }

    #[test]
    fn the_first_part_counts() {
        for seed in 0..100 {
            let mut random = Seeded(seed);
            let parts: Vec<Body> = (0..4)
                .map(|_| {
                    let shift = Vector3::from_fn(|_, _| 3.0 * random.signed());
                    let turn = UnitQuaternion::from_euler_angles(random.signed(), random.signed(), random.signed());
                    Body::superellipsoid("q", Vector3::zeros(), Vector3::new(0.5, 1.0, 1.5), 4)
                        .unwrap()
                        .moved(&turn, &shift)
                        .unwrap()
                })
                .collect();
            let compound = Compound::new("c", parts).unwrap();
            let pose = random_pose(&mut random, 2.0);
            let origin = pose.translation() + random.unit() * 10.0;
            let ray = Ray::new(origin, pose.translation() - origin + random.unit(), f64::INFINITY).unwrap();
            let found = cast(&compound, &pose, &ray);
            let first = compound.parts().iter().filter_map(|part| cast(part, &pose, &ray).hit().copied());
            let first = first.min_by(|a, b| a.upper.total_cmp(&b.upper));
            match (found, first) {
                (RayCast::Hit(hit), Some(first)) => {
                    assert!((hit.upper - first.upper).abs() < 1e-8 && hit.lower <= first.upper, "seed {seed}");
                }
                (found, first) => {
                    assert!(found == RayCast::Miss && first.is_none(), "seed {seed}: {found:?} {first:?}");
                }
            }
        }
    }

    #[test]
    fn rays_are_checked() {
        let (o, d) = (Vector3::zeros(), Vector3::x());
        assert_eq!(Ray::new(o, o, 1.0), Err(RayError::NoDirection));
        for length in [0.0, -1.0, f64::NAN] {
            assert!(matches!(Ray::new(o, d, length), Err(RayError::Length(_))));
        }
        assert_eq!(Ray::new(d * f64::NAN, d, 1.0), Err(RayError::NotFinite("origin")));
        assert_eq!(Ray::new(d * 1e16, d, 1.0), Err(RayError::NotFinite("origin")));
        assert_eq!(Ray::new(o, d * f64::INFINITY, 1.0), Err(RayError::NotFinite("direction")));
        let tiny = Ray::new(o, d * 1e-300, 1.0).unwrap();
        assert!((tiny.direction().norm() - 1.0).abs() < 1e-15);
    }
}
