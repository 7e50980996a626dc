//! What rays and swept balls hit first.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::measure::{
    Capsule, DEFAULT_ACCURACY, Options, Pose, Ray, RayCast, RayError, RayHit, Status, Sweep, cast_ball, cast_ray,
};

use super::answer::AnswerStatus;
use super::ask::{AskError, check_accuracy, options};
use super::selection::Selection;
use super::thing::{Thing, WorldHalfSpace};
use crate::broad_phase::{Tree, WideRay};
use crate::crew::{Question, Stop};
use crate::object::Slot;
use crate::scene::Scene;

/// Rays of a chunk.
const CHUNK: usize = 32;

/// Rays, or balls swept along them, through one snapshot.
#[derive(Debug)]
pub struct Rays {
    scene: Scene,
    tree: Arc<Tree>,
    selection: Selection,
    rays: Vec<Ray>,
    /// 0: rays.
    radius_m: f64,
    accuracy: f64,
}

/// Why rays cannot be cast.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RaysError {
    /// One of them is none.
    #[error("ray {index}: {error}")]
    Ray {
        /// Its position.
        index: usize,
        /// The reason.
        error: RayError,
    },
    /// The radius is no length.
    #[error("radius is {0} m; give a finite number that is not negative")]
    Radius(f64),
}

/// What a ray hits first.
#[derive(Clone, Copy, Debug)]
pub struct RayAnswer {
    /// How the bracket came about.
    pub status: AnswerStatus,
    /// What is hit; none within its length.
    pub hit: Option<Slot>,
    /// The ray is proven free up to this length, metres; NaN without a hit.
    pub lower_m: f64,
    /// The ray has hit at this length, metres; NaN without a hit, ∞ where only an outer bound is
    /// known.
    pub upper_m: f64,
    /// Point of the surface, metres, world frame.
    pub point: Option<Vector3<f64>>,
    /// Outward unit normal there.
    pub normal: Option<Vector3<f64>>,
}

impl RayAnswer {
    fn without(status: AnswerStatus) -> Self {
        Self { status, hit: None, lower_m: f64::NAN, upper_m: f64::NAN, point: None, normal: None }
    }
}

impl Rays {
    /// Rays as origins and directions of any length, metres, world frame, each of them `max_length`
    /// long; with a radius, balls that are swept along.
    ///
    /// # Errors
    /// The first ray that is none, and a radius that is no length.
    pub fn new(
        scene: Scene,
        selection: Selection,
        rays: &[(Vector3<f64>, Vector3<f64>)],
        (max_length_m, radius_m): (f64, f64),
    ) -> Result<Self, RaysError> {
        if !(radius_m >= 0.0 && radius_m.is_finite()) {
            return Err(RaysError::Radius(radius_m));
        }
        let ray = |(index, (origin, direction)): (usize, &(Vector3<f64>, Vector3<f64>))| {
            // Lengths along the ray are metres only if the direction is a unit vector.
            let length = direction.norm();
            let unit = if length.is_normal() && length.is_finite() { direction / length } else { *direction };
            Ray::new(*origin, unit, max_length_m).map_err(|error| RaysError::Ray { index, error })
        };
        let rays = rays.iter().enumerate().map(ray).collect::<Result<_, _>>()?;
        let tree = scene.tree().clone();
        Ok(Self { scene, tree, selection, rays, radius_m, accuracy: DEFAULT_ACCURACY })
    }

    /// Another accuracy, relative.
    ///
    /// # Errors
    /// A number that is none.
    pub fn with_accuracy(mut self, accuracy: f64) -> Result<Self, AskError> {
        check_accuracy(accuracy)?;
        self.accuracy = accuracy;
        Ok(self)
    }

    /// Number of rays.
    pub fn len(&self) -> usize {
        self.rays.len()
    }

    /// Whether there are no rays.
    pub fn is_empty(&self) -> bool {
        self.rays.is_empty()
    }

    fn cast(&self, ray: &Ray, options: &Options<'_>, stop: &Stop) -> RayAnswer {
        let length = ray.max_length();
        let wide = WideRay { origin: *ray.origin(), direction: *ray.direction(), length, radius: self.radius_m };
        let (mut best, mut free_m, mut reach) = (RayAnswer::without(AnswerStatus::Converged), f64::INFINITY, length);
        let mut look = |slot: Slot| {
            if let Some(found) = self.hit(slot, ray, options) {
                free_m = free_m.min(found.lower_m);
                let order = |answer: &RayAnswer| (answer.upper_m, answer.lower_m);
                if best.hit.is_none() || order(&found) < order(&best) {
                    best = found;
                    reach = reach.min(best.upper_m);
                }
            }
            if stop.is_set() { 0.0 } else { reach }
        };
        for &slot in self.scene.structure.half_spaces.iter().filter(|&&slot| self.selection.contains(slot)) {
            look(slot);
        }
        self.tree.along(&wide, |slot| if self.selection.contains(slot) { look(slot) } else { f64::INFINITY });
        if stop.is_set() {
            return RayAnswer::without(AnswerStatus::Deadline);
        }
        if free_m < best.lower_m {
            // Something else may be hit before, whose own end is not known.
            (best.lower_m, best.status) = (free_m, AnswerStatus::BracketWide);
        }
        best
    }

    fn hit(&self, slot: Slot, ray: &Ray, options: &Options<'_>) -> Option<RayAnswer> {
        let object = self.scene.object(slot)?;
        match Thing::object(object, self.scene.pose_at(slot)) {
            Thing::Solid { rungs, pose, set } => {
                let solid = &**rungs.last()?;
                let cast = if self.radius_m > 0.0 {
                    let sweep = Sweep::new(*ray, self.radius_m).ok()?;
                    cast_ball(solid, pose, &sweep, options)
                } else {
                    cast_ray(solid, pose, ray, options)
                };
                // Where it is open whether the ray enters at all, it is free up to the lower bound.
                let open = |lower_m| RayAnswer {
                    hit: Some(slot),
                    lower_m,
                    upper_m: f64::INFINITY,
                    ..RayAnswer::without(AnswerStatus::BracketWide)
                };
                match cast {
                    RayCast::Miss => None,
                    RayCast::Undecided { lower, .. } => Some(open(lower)),
                    RayCast::Hit(RayHit { lower, .. }) if set.is_some() => Some(open(lower)),
                    RayCast::Hit(RayHit { status, lower, upper, point, normal, .. }) => {
                        let status = match status {
                            Status::Converged => AnswerStatus::Converged,
                            Status::BracketWide => AnswerStatus::BracketWide,
                        };
                        let (lower_m, upper_m, point) = (lower, upper, Some(point));
                        Some(RayAnswer { status, hit: Some(slot), lower_m, upper_m, point, normal })
                    }
                }
            }
            Thing::Capsule { capsule, pose } => {
                self.capsule(slot, &AxisDistance::new(capsule, pose, self.radius_m), ray)
            }
            Thing::HalfSpace(half_space) => self.plane(slot, &half_space, ray),
            Thing::Point(_) => None,
        }
    }

    /// Where a ball around a point of the ray first touches a plane: at height / sinking, each with
    /// its error. None where it is proven to miss it.
    fn plane(&self, slot: Slot, placed: &WorldHalfSpace, ray: &Ray) -> Option<RayAnswer> {
        let (normal, offset) = (placed.half_space.normal(), placed.half_space.offset());
        let height = normal.dot(ray.origin()) - offset - self.radius_m;
        let size = ray.origin().norm() + offset.abs() + self.radius_m;
        let slack = placed.slack_m(ray.origin().norm()) + 8.0 * f64::EPSILON * size;
        let sinking = -normal.dot(ray.direction());
        // Without an error where no product is rounded: along a floor, say.
        let rounding = 4.0 * f64::EPSILON * normal.component_mul(ray.direction()).abs().sum();
        let tilt = placed.normal_error + rounding;
        let (lower, upper) = if height <= -slack {
            (0.0, 0.0)
        } else if sinking + tilt <= 0.0 && height > slack {
            return None;
        } else {
            let up = 1.0 + 4.0 * f64::EPSILON;
            let lower = if height > slack { (height - slack) / (sinking + tilt) / up } else { 0.0 };
            let upper = if sinking > tilt { (height + slack) / (sinking - tilt) * up } else { f64::INFINITY };
            (lower, upper.max(0.0))
        };
        if lower > ray.max_length() {
            return None;
        }
        let known = upper <= ray.max_length() && upper.is_finite();
        let narrow = known && upper - lower <= self.accuracy * (size + upper);
        let status = if narrow { AnswerStatus::Converged } else { AnswerStatus::BracketWide };
        let point = known.then(|| ray.point(upper) - normal * self.radius_m);
        Some(RayAnswer { status, hit: Some(slot), lower_m: lower, upper_m: upper, point, normal: Some(*normal) })
    }
}

/// How far the surface around a segment is from points: that of a capsule, or of one around which a
/// ball rolls.
struct AxisDistance<'a> {
    pose: &'a Pose,
    half_m: f64,
    radius_m: f64,
    /// Of the capsule itself, metres.
    own_radius_m: f64,
}

impl<'a> AxisDistance<'a> {
    fn new(capsule: &Capsule, pose: &'a Pose, ball_m: f64) -> Self {
        let own_radius_m = capsule.radius_m();
        Self { pose, half_m: capsule.half_height_m(), radius_m: own_radius_m + ball_m, own_radius_m }
    }

    /// The distance, negative inside, the unit vector from the axis to the point and the point of
    /// the axis; world frame, metres.
    fn of(&self, point: &Vector3<f64>) -> (f64, Vector3<f64>, Vector3<f64>) {
        let axis = self.pose.transform_direction(&Vector3::z());
        let from = point - self.pose.translation();
        let nearest = axis * axis.dot(&from).clamp(-self.half_m, self.half_m);
        let way = from - nearest;
        let length = way.norm();
        (length - self.radius_m, way.try_normalize(0.0).unwrap_or(axis), self.pose.translation() + nearest)
    }
}

/// Halvings after which no double is left between two parameters.
const HALVINGS: u32 = 64;

impl Rays {
    /// Where a ray enters the surface around an axis. The distance is convex along the ray: between
    /// its start, outside, and its least value, inside, it is 0 once.
    fn capsule(&self, slot: Slot, surface: &AxisDistance<'_>, ray: &Ray) -> Option<RayAnswer> {
        let reach = surface.half_m + surface.radius_m;
        let center = surface.pose.translation();
        let along = ray.direction().dot(&(center - ray.origin()));
        let size = ray.origin().norm() + center.norm() + reach;
        let last = ray.max_length().min((along + reach).max(0.0));
        let error = 64.0 * f64::EPSILON * (size + last);
        let at = |t: f64| surface.of(&ray.point(t));
        let found = |lower_m: f64, upper_m: f64| {
            let (_, normal, on_axis) = at(upper_m);
            let narrow = upper_m - lower_m <= self.accuracy * (size + upper_m);
            let status = if narrow { AnswerStatus::Converged } else { AnswerStatus::BracketWide };
            let point = Some(on_axis + normal * surface.own_radius_m);
            let normal = (upper_m > 0.0).then_some(normal);
            Some(RayAnswer { status, hit: Some(slot), lower_m, upper_m, point, normal })
        };
        if at(0.0).0 <= -error {
            return found(0.0, 0.0);
        }
        // The least distance, by the sign of its slope.
        let (mut low, mut high) = (0.0, last);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (low + high);
            let falls = at(middle).1.dot(ray.direction()) < 0.0;
            if falls { low = middle } else { high = middle }
        }
        let deepest = if at(low).0 < at(high).0 { low } else { high };
        let (least, ..) = at(deepest);
        if least - (high - low) > error {
            return None;
        }
        // The last parameter that is outside for sure, and the first that is inside.
        let (mut outside, mut inside) = (0.0, deepest);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (outside + inside);
            let (value, ..) = at(middle);
            if value > error { outside = middle } else { inside = middle }
        }
        if least > -error {
            let upper_m = f64::INFINITY;
            return Some(RayAnswer {
                hit: Some(slot),
                lower_m: outside,
                upper_m,
                ..RayAnswer::without(AnswerStatus::BracketWide)
            });
        }
        let (mut before, mut entered) = (outside, deepest);
        for _ in 0..HALVINGS {
            let middle = 0.5 * (before + entered);
            if at(middle).0 <= -error { entered = middle } else { before = middle }
        }
        found(outside, entered)
    }
}

impl Question for Rays {
    type Part = Vec<RayAnswer>;

    fn chunks(&self) -> usize {
        self.rays.len().div_ceil(CHUNK)
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> Vec<RayAnswer> {
        let options = options(self.accuracy, self.accuracy, stop);
        let rays = &self.rays[chunk * CHUNK..((chunk + 1) * CHUNK).min(self.rays.len())];
        rays.iter().map(|ray| self.cast(ray, &options, stop)).collect()
    }
}
