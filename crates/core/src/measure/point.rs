//! Distance from a body to a point: the projection of the point on the body.
//!
//! For the unit vector n along `Σ λ_i ∇g_i(y)`, every point y' of the body has
//! `n·(q - y') >= n·(q - y) - deficit`, with the support deficit of
//! [`crate::measure::bounds::duality_bounds::descent`]; so the plane through y with the normal n
//! separates q from the body by as much. The program stays regular through contact: its Hessian is
//! the identity plus what the body's curvature adds.

use crate::body::{Body, Solid};
use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, descent};
use crate::measure::frames::pose::Pose;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, bracketed, least};
use crate::measure::solver::active_constraints::ActiveSet;
use crate::measure::solver::projection::{Objective, Single, SingleProblem, Trial, solve_single};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use nalgebra::Vector3;

/// Distance of a body from a point with its proof; lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct PointDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; 0 when the point is not proven outside.
    pub lower: f64,
    /// Proven upper bound, attained by the witness; 0 when the point is proven inside.
    pub upper: f64,
    /// Whether the point is proven to lie in the body; the distance is then 0, and depth is not
    /// measured.
    pub inside: bool,
    /// The nearest point of the body; the point itself if it is inside.
    pub witness: Vector3<f64>,
    /// Unit normal from the body to the point, at the witness; none inside.
    pub normal: Option<Vector3<f64>>,
    /// Whether another part may be as near, their brackets meeting: witness, normal and gradient
    /// may then jump. Never for single bodies, nor inside.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl PointDistance {
    /// The answer inside the bracket: the upper bound, which the witness attains.
    pub fn value(&self) -> f64 {
        self.upper
    }

    /// Gradient with respect to the pose the distance was asked for; that with respect to the point
    /// is `normal`. By the envelope theorem the witness counts as fixed to the body: `-n` and
    /// `-(y - t) × n`. None inside.
    pub fn pose_gradient(&self, pose: &Pose) -> Option<Twist> {
        self.normal.map(|n| Twist::of_gradient(-n, &self.witness, pose.translation()))
    }
}

/// A point that is none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("the point is not finite, or beyond 1e15 m")]
pub struct PointError;

/// Euclidean distance of a solid at `pose` from `point` (world frame, metres), 0 when the point is
/// inside.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next point.
///
/// # Errors
/// A point that is not finite.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance_to_point};
///
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let mut warm = WarmStart::default();
/// let point = Vector3::new(4.0, 5.0, 0.5);
/// let answer = distance_to_point(&crate_, &Pose::identity(), &point, &Options::default(), &mut warm)?;
/// assert!((answer.value() - 5.0).abs() < 1e-8);
/// assert!((answer.witness - Vector3::new(1.0, 1.0, 0.5)).norm() < 1e-4);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_point(
    solid: &impl Solid,
    pose: &Pose,
    point: &Vector3<f64>,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Result<PointDistance, PointError> {
    // Not `>`: a NaN is refused too.
    if !(point.amax() <= 1e15 && point.iter().all(|value| value.is_finite())) {
        return Err(PointError);
    }
    let tolerance = options.accuracy() * solid.circumscribed().radius;
    Ok(match solid.parts() {
        [body] => Projection::new(body, pose).to(point, tolerance, options, warm).into_distance(tolerance),
        parts => nearest((parts, pose), point, tolerance, options, warm),
    })
}

/// The nearest part.
fn nearest(
    (parts, pose): At<'_, [Body]>,
    point: &Vector3<f64>,
    tolerance: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> PointDistance {
    let bound = |(i, _): (usize, usize)| {
        let ball = parts[i].circumscribed();
        let center = pose.transform_point(&ball.center);
        (point - center).norm() - ball.radius - 1e-12 * (point.norm() + center.norm() + ball.radius)
    };
    let found = least((parts.len(), 1), bound, 0.0, warm, |(i, _), _, hint| {
        Projection::new(&parts[i], pose).to(point, tolerance, options, hint)
    });
    let Least { best, lower, tied, iterations, .. } = found;
    let answer = Projected { lower, iterations, ..best }.into_distance(tolerance);
    PointDistance { tied: tied && !answer.inside, ..answer }
}

/// A body to project points on.
pub(super) struct Projection<'a> {
    single: Single<'a>,
}

/// What a projection found; metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Projected {
    pub(super) lower: f64,
    pub(super) upper: f64,
    /// Unit vector along which the lower bound separates the point from the body; zero if there is
    /// none.
    pub(super) normal: Vector3<f64>,
    pub(super) witness: Vector3<f64>,
    pub(super) iterations: u32,
}

impl Projected {
    fn into_distance(self, tolerance: f64) -> PointDistance {
        let inside = self.upper == 0.0;
        PointDistance {
            status: Status::of(self.upper - self.lower <= tolerance),
            lower: self.lower,
            upper: self.upper,
            inside,
            witness: self.witness,
            normal: if inside { None } else { self.normal.try_normalize(0.0) },
            tied: false,
            iterations: self.iterations,
        }
    }
}

impl<'a> Projection<'a> {
    pub(super) fn new(body: &'a Body, pose: &Pose) -> Self {
        Self { single: Single::new(body, pose) }
    }

    pub(super) fn to(
        &self,
        point: &Vector3<f64>,
        tolerance: f64,
        options: &Options<'_>,
        warm: &mut WarmStart,
    ) -> Projected {
        let Single { body, unit, .. } = &self.single;
        let (q, error) = self.single.to_query(point);
        if body.value_upper(&q, error) <= 1.0 {
            return Projected { lower: 0.0, upper: 0.0, normal: Vector3::zeros(), witness: *point, iterations: 0 };
        }
        let objective = Objective::nearest(&q);
        let (start, active): (_, ActiveSet) = match warm.hint {
            Hint::Single { y, active } if y.iter().all(|value| value.is_finite()) => {
                (self.single.body_to_query(&y), active)
            }
            _ => (self.single.table(&objective), 0),
        };
        let (mut lower, mut upper) = (0.0_f64, f64::INFINITY);
        let (mut normal, mut witness) = (Vector3::zeros(), body.interior);
        let narrow = tolerance / unit;
        let problem = SingleProblem { body, objective: &objective, start, active };
        let stop = |count| options.exhausted(count);
        let (iterations, active) = solve_single(&problem, stop, |trial| {
            let (bound, n) = self.separation(&q, error, trial);
            if bound > lower || normal == Vector3::zeros() {
                (lower, normal) = (bound.max(0.0), n);
            }
            if let Some(y) = body.move_inside(&trial.y) {
                let apart = (q - y).norm() + body.displacement(&y) + error;
                if apart < upper {
                    (upper, witness) = (apart, y);
                }
            }
            upper - lower <= narrow
        });
        if upper == f64::INFINITY {
            // Stopped before the first trial point: the interior point is a point of the body.
            upper = (q - witness).norm() + body.displacement(&witness) + error;
        }
        *warm = Hint::Single { y: self.single.to_body(&witness), active }.into();
        Projected {
            lower: lower * unit * (1.0 - 4.0 * f64::EPSILON),
            upper: upper * unit * (1.0 + 4.0 * f64::EPSILON),
            normal: self.single.direction_to_world(&normal),
            witness: self.single.to_world(&witness),
            iterations,
        }
    }

    /// Lower bound of the distance in query units from the plane normal to the trial's pull, and
    /// that normal.
    fn separation(&self, q: &Vector3<f64>, error: f64, trial: &Trial) -> (f64, Vector3<f64>) {
        let body = &self.single.body;
        let length = trial.dual_gradient.norm();
        if !(length > 0.0 && length.is_finite()) {
            return (0.0, Vector3::zeros());
        }
        let n = trial.dual_gradient / length;
        let fall = descent(body, &trial.y, &-n, &trial.multipliers.map(|m| (m / length).max(0.0)));
        let slack = DUALITY_ROUNDING * (q.norm() + trial.y.norm() + fall.abs());
        let bound = n.dot(&(q - trial.y)) - fall - body.displacement(&trial.y) - error - slack;
        // Not `max`: a NaN bounds nothing.
        (if bound > 0.0 { bound } else { 0.0 }, n)
    }
}

bracketed!(Projected);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Compound;
    use crate::measure::tests::{random_pose, zoo};
    use sublevel_testkit::Seeded;

    fn cold(solid: &impl Solid, pose: &Pose, point: &Vector3<f64>) -> PointDistance {
        distance_to_point(solid, pose, point, &Options::default(), &mut WarmStart::default()).unwrap()
    }

    #[test]
    fn boxes_and_balls_have_closed_forms() {
        let half = Vector3::new(0.5, 1.0, 3.0);
        let bodies = [Body::cuboid("b", half).unwrap(), Body::ball("b", Vector3::zeros(), 1.5).unwrap()];
        for seed in 0..3000 {
            let mut random = Seeded(seed);
            let body = &bodies[(seed % 2) as usize];
            let pose = random_pose(&mut random, 2.0);
            // Over faces, edges and corners, near and far, inside and out.
            let x = Vector3::from_fn(|i, _| {
                half[i]
                    * [0.3, 0.99, 1.0 + 1e-9, 1.001, 2.0, 100.0][(random.next() % 6) as usize]
                    * random.signed().signum()
            });
            let truth =
                if seed % 2 == 0 { (x.abs() - half).map(|d| d.max(0.0)).norm() } else { (x.norm() - 1.5).max(0.0) };
            let found = cold(body, &pose, &pose.transform_point(&x));
            let label = format!("seed {seed}: {found:?} against {truth}");
            let floor = 1e-14 * (x.norm() + 2.0);
            assert_eq!(found.status, Status::Converged, "{label}");
            assert!(found.lower <= truth + floor && truth - floor <= found.upper, "{label}");
            assert!(!found.inside || truth <= floor, "{label}");
            let reached = (pose.transform_point(&x) - found.witness).norm();
            assert!((reached - found.upper).abs() <= 1e-12 * (1.0 + x.norm()), "{label}");
        }
    }

    #[test]
    fn projections_are_optimal() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut most, mut total, mut count) = (0, 0, 0);
        for seed in 0..3000 {
            let mut random = Seeded(11_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let body = &bodies[random.next() as usize % bodies.len()];
            let size = body.circumscribed().radius;
            let pose = random_pose(&mut random, 1.0);
            let x = body.circumscribed().center + random.unit() * size * 10_f64.powf(random.signed());
            let mut warm = WarmStart::default();
            for k in 0..3 {
                let point = pose.transform_point(&x) + Vector3::new(0.01, 0.02, 0.0) * size * f64::from(k);
                let found = distance_to_point(body, &pose, &point, &Options::default(), &mut warm).unwrap();
                let label = format!("seed {seed} {} step {k}: {found:?}", body.name());
                assert_eq!(found.status, Status::Converged, "{label}");
                (most, total, count) = (most.max(found.iterations), total + found.iterations, count + 1);
                let local = |v: &Vector3<f64>| pose.rotation().inverse_transform_vector(v);
                assert!(body.value(&local(&(found.witness - pose.translation()))) <= 1.0 + 1e-9, "{label}");
                assert_eq!(found.inside, body.value(&local(&(point - pose.translation()))) <= 1.0, "{label}");
                if let Some(n) = found.normal {
                    // No sampled point of the body is beyond the separating plane.
                    let plane = n.dot(&point) - found.lower;
                    for y in body.boundary() {
                        assert!(n.dot(&pose.transform_point(y)) <= plane + 1e-9 * size, "{label}");
                    }
                }
            }
        }
        assert!(total < 2 * count && most <= 60, "{total} of {count}, most {most}");
    }

    #[test]
    fn gradients_are_differences() {
        let zoos: Vec<_> = (0..4).map(|seed| zoo(&mut Seeded(seed))).collect();
        let accurate = Options::default().with_accuracy(1e-13).unwrap();
        for seed in 0..400 {
            let mut random = Seeded(seed);
            let bodies = &zoos[(seed % 4) as usize];
            // Curved ones: the witness, and with it the gradient, is accurate to the root of the
            // bracket elsewhere.
            let body = &bodies[(seed as usize / 4) % 2];
            let size = body.circumscribed().radius;
            let pose = random_pose(&mut random, 1.0);
            let point = pose.transform_point(&(body.circumscribed().center + random.unit() * 2.5 * size));
            let value = |pose: &Pose| {
                distance_to_point(body, pose, &point, &accurate, &mut WarmStart::default()).unwrap().value()
            };
            let found = distance_to_point(body, &pose, &point, &accurate, &mut WarmStart::default()).unwrap();
            let gradient = found.pose_gradient(&pose).unwrap();
            let h = 1e-4 * size;
            for axis in 0..3 {
                let e = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
                let moved =
                    |t: f64| Pose::from_quaternion(pose.translation() + e * t, pose.rotation().coords.into()).unwrap();
                let turned = |t: f64| {
                    let turn = nalgebra::UnitQuaternion::from_scaled_axis(e * t) * pose.rotation();
                    Pose::from_quaternion(*pose.translation(), turn.coords.into()).unwrap()
                };
                let slope = (value(&moved(h)) - value(&moved(-h))) / (2.0 * h);
                assert!((slope - gradient.linear[axis]).abs() < 1e-5, "seed {seed}: {slope} {gradient:?}");
                let slope = (value(&turned(1e-4)) - value(&turned(-1e-4))) / 2e-4;
                assert!(
                    (slope - gradient.angular[axis]).abs() < 1e-5 * (1.0 + size),
                    "seed {seed}: {slope} {gradient:?}"
                );
            }
        }
    }

    #[test]
    fn the_nearest_part_counts_and_points_are_checked() {
        let at = |x: f64| Body::ball("part", Vector3::new(x, 0.0, 0.0), 1.0).unwrap();
        let row = Compound::new("row", vec![at(0.0), at(5.0), at(10.0)]).unwrap();
        let mut warm = WarmStart::default();
        for k in 0..120 {
            let x = -1.0 + 0.1 * f64::from(k);
            let point = Vector3::new(x, 3.0, 0.0);
            let truth = [0.0, 5.0, 10.0].map(|c| (x - c).hypot(3.0) - 1.0).into_iter().fold(f64::MAX, f64::min);
            let found = distance_to_point(&row, &Pose::identity(), &point, &Options::default(), &mut warm).unwrap();
            assert!(
                (found.value() - truth).abs() < 1e-8 && found.lower <= truth && truth <= found.upper,
                "{x}: {found:?}"
            );
        }
        for bad in [f64::NAN, f64::INFINITY, 1e16] {
            let point = Vector3::new(0.0, bad, 0.0);
            let found = distance_to_point(&row, &Pose::identity(), &point, &Options::default(), &mut warm);
            assert_eq!(found.unwrap_err(), PointError);
        }
    }
}
