//! Signed distance from a body to a half-space: its support point against the normal, closed for
//! boxes, cylinders and balls.
//!
//! The signed distance is `min n·x - offset` over the body. Where it is positive it is the
//! Euclidean distance, since the nearest point of the half-space lies along n. Where it is negative
//! its magnitude is the penetration depth: a translation t separates exactly if `n·t` makes up for
//! it, and the shortest such t is along n.

use crate::body::{Body, ClosedForm, Solid};
use crate::measure::bounds::duality_bounds::{DUALITY_ROUNDING, descent};
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, bracketed, least};
use crate::measure::solver::projection::{Objective, Single, SingleProblem, Worth, solve_single};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::gamma;
use nalgebra::Vector3;

/// Deviation of a normal from length 1, dimensionless, up to which it counts as normalised: five
/// roundings, each of 2^-53, make its length and this measure of it.
///
/// A smaller value would normalise again what is read from a file and change its last bits, and
/// with them its id; a larger one keeps normals whose length falsifies distances. Pinned by
/// `normals_settle` of scenes.
const NORMALISED_NORMAL: f64 = 3.0 * f64::EPSILON;

/// The half-space `{x : normal·x <= offset}` of the world frame; checked when made.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::HalfSpace;
///
/// let floor = HalfSpace::new(Vector3::z(), 0.0)?;
/// assert!(HalfSpace::new(Vector3::new(0.0, 0.0, 2.0), 0.0).is_err());
/// # Ok::<(), sublevel_core::measure::HalfSpaceError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HalfSpace {
    normal: Vector3<f64>,
    offset: f64,
}

/// Why numbers are not a half-space.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum HalfSpaceError {
    /// A number is NaN, infinite or too large.
    #[error("{0} of the half-space is not finite, or beyond 1e15 m")]
    NotFinite(&'static str),
    /// A normal that is not of length one.
    #[error(
        "the normal is not a unit vector: its length deviates by {0:.3e}, at most 1e-6 is accepted; normalise it and \
         scale the offset along"
    )]
    NotUnit(f64),
}

impl HalfSpace {
    /// The points x with `normal·x <= offset` (m), for an outward normal within 1e-6 of length 1,
    /// which is normalised; the normal of a half-space makes the same half-space again, bit for
    /// bit.
    ///
    /// # Errors
    /// Numbers that are not finite, or a normal that is farther from length 1.
    pub fn new(normal: Vector3<f64>, offset: f64) -> Result<Self, HalfSpaceError> {
        if !normal.iter().all(|value| value.is_finite()) {
            return Err(HalfSpaceError::NotFinite("normal"));
        }
        // Not `>`: a NaN is refused too.
        if !(offset.abs() <= 1e15) {
            return Err(HalfSpaceError::NotFinite("offset"));
        }
        let deviation = (normal.norm() - 1.0).abs();
        if deviation > 1e-6 {
            return Err(HalfSpaceError::NotUnit(deviation));
        }
        let normal = if deviation <= NORMALISED_NORMAL { normal } else { normal.normalize() };
        Ok(Self { normal, offset })
    }

    /// Outward unit normal.
    pub fn normal(&self) -> &Vector3<f64> {
        &self.normal
    }

    /// Largest `normal·x`, metres.
    pub fn offset(&self) -> f64 {
        self.offset
    }
}

/// Signed distance of a body from a half-space with its proof; lengths in metres, vectors in the
/// world frame.
#[derive(Clone, Copy, Debug)]
pub struct HalfSpaceDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative values are depths.
    pub lower: f64,
    /// Proven upper bound, attained by the witness.
    pub upper: f64,
    /// The point of the body nearest to the half-space, or deepest in it.
    pub witness: Vector3<f64>,
    /// Whether another part may lie as low, their brackets meeting: witness and gradient may then
    /// jump. Never for single bodies.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl HalfSpaceDistance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Gradient with respect to the pose the distance was asked for: `n` and `(x - t) × n`, x the
    /// witness; through contact and in depth as well. It is unique where the witness is.
    pub fn pose_gradient(&self, pose: &Pose, half_space: &HalfSpace) -> Twist {
        Twist::of_gradient(half_space.normal, &self.witness, pose.translation())
    }
}

/// Signed distance of a solid at `pose` from a half-space: positive apart, zero in contact, minus
/// the penetration depth in overlap.
///
/// The bracket is as narrow as `options` ask, relative to the circumradius of the solid, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next query.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{HalfSpace, Options, Pose, WarmStart, distance_to_half_space};
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 1.0, 2.0))?;
/// let floor = HalfSpace::new(Vector3::z(), -1.5)?;
/// let found = distance_to_half_space(&egg, &Pose::identity(), &floor, &Options::default(), &mut WarmStart::default());
/// assert!((found.value() + 0.5).abs() < 1e-8); // half a metre deep
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_half_space(
    solid: &impl Solid,
    pose: &Pose,
    half_space: &HalfSpace,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> HalfSpaceDistance {
    let tolerance = options.accuracy() * solid.circumscribed().radius;
    let parts = solid.parts();
    if let [body] = parts {
        return from_body((body, pose), half_space, tolerance, options, warm);
    }
    let bound = |(i, _): (usize, usize)| {
        let ball = parts[i].circumscribed();
        let center = pose.transform_point(&ball.center);
        let size = center.norm() + half_space.offset.abs() + ball.radius;
        half_space.normal.dot(&center) - half_space.offset - ball.radius - 1e-12 * size
    };
    let found = least((parts.len(), 1), bound, f64::NEG_INFINITY, warm, |(i, _), _, hint| {
        from_body((&parts[i], pose), half_space, tolerance, options, hint)
    });
    let Least { best, lower, tied, iterations, .. } = found;
    HalfSpaceDistance { status: Status::of(best.upper - lower <= tolerance), lower, tied, iterations, ..best }
}

fn from_body(
    (body, pose): At<'_, Body>,
    half_space: &HalfSpace,
    tolerance: f64,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> HalfSpaceDistance {
    if runs(Stage::ClosedForm)
        && let Some(form) = body.closed_form()
    {
        return from_shape((form, pose), half_space, tolerance);
    }
    let single = Single::new(body, pose);
    let HalfSpace { normal, offset } = half_space;
    let support = Support::new(&single, &-normal);
    let found = support.solve(tolerance / single.unit, options, warm);
    // n·x = n·(t + R (origin + unit v)), the last term being minus the support of -n.
    let anchor = pose.transform_point(&single.to_body(&Vector3::zeros()));
    let height = (normal.dot(&(anchor - pose.translation())) + normal.dot(pose.translation())) - offset;
    let size = anchor.norm() + pose.translation().norm() * 2.0 + offset.abs();
    let slack = (ROTATION_ERROR + gamma(16)) * size;
    let [lower, upper] = [height - found.upper * single.unit - slack, height - found.lower * single.unit + slack];
    HalfSpaceDistance {
        status: Status::of(upper - lower <= tolerance),
        lower,
        upper,
        witness: single.to_world(&found.point),
        tied: false,
        iterations: found.iterations,
    }
}

/// Of a box, a cylinder or a ball: the height of its lowest point.
fn from_shape((form, pose): (&ClosedForm, &Pose), half_space: &HalfSpace, tolerance: f64) -> HalfSpaceDistance {
    let HalfSpace { normal, offset } = half_space;
    let down = pose.rotation().inverse_transform_vector(&-normal);
    let [least, most] = form.heights(&down);
    // n·c = n·R c + n·t, c the centre of the shape.
    let center = normal.dot(&pose.transform_direction(form.center())) + normal.dot(pose.translation()) - offset;
    let reach = form.reach_m();
    let size = form.center().norm() + pose.translation().norm() + offset.abs() + reach;
    let slack = (ROTATION_ERROR + gamma(16)) * size;
    let (lower, upper) = (center - most - slack, center - least + slack);
    HalfSpaceDistance {
        status: Status::of(upper - lower <= tolerance),
        lower,
        upper,
        witness: pose.transform_point(&form.support_point(&down)),
        tied: false,
        iterations: 0,
    }
}

/// The support of one body along a direction of the world frame.
pub(super) struct Support<'a> {
    single: &'a Single<'a>,
    /// In the query frame; of length 1 up to rounding.
    direction: Vector3<f64>,
}

/// Bracket of `max r·v` over the points v of a body, r a unit vector; query frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct Supported {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) point: Vector3<f64>,
    pub(super) iterations: u32,
}

impl<'a> Support<'a> {
    pub(super) fn new(single: &'a Single<'a>, direction: &Vector3<f64>) -> Self {
        Self { single, direction: single.direction_to_query(direction) }
    }

    /// Brackets the support, for the exact direction, to `narrow` query units if possible.
    pub(super) fn solve(&self, narrow: f64, options: &Options<'_>, warm: &mut WarmStart) -> Supported {
        let (body, r) = (&self.single.body, &self.direction);
        // Points of the body have length at most 2 here: so much the error of the direction may do.
        let turned = 2.0 * ROTATION_ERROR * body.body.circumscribed().radius / self.single.unit + 8.0 * f64::EPSILON;
        let objective = Objective::Farthest(*r);
        let (start, active) = match warm.hint {
            Hint::Single { y, active } if y.iter().all(|value| value.is_finite()) => {
                (self.single.body_to_query(&y), active)
            }
            _ => (self.single.table(&objective), 0),
        };
        let mut found = Supported {
            lower: f64::NEG_INFINITY,
            upper: body.body.circumscribed().radius / self.single.unit * (1.0 + 1e-14) + turned,
            point: body.interior,
            iterations: 0,
        };
        let problem = SingleProblem { body, objective: &objective, start, active };
        let stop = |count| options.exhausted(count);
        let (iterations, active) = solve_single(&problem, stop, |trial| {
            let multipliers = trial.multipliers.map(|m| m.max(0.0));
            let rise = descent(body, &trial.y, &-r, &multipliers);
            let slack = DUALITY_ROUNDING * (trial.y.norm() + rise.abs());
            let upper = r.dot(&trial.y) + rise + body.displacement(&trial.y) + slack + turned;
            // Not `min`: a NaN bounds nothing.
            if upper < found.upper {
                found.upper = upper;
            }
            if let Some(y) = body.move_inside(&trial.y) {
                let lower = r.dot(&y) - body.displacement(&y) - turned;
                if lower > found.lower {
                    (found.lower, found.point) = (lower, y);
                }
            }
            if found.upper - found.lower <= narrow { Worth::Done } else { Worth::Wide }
        });
        if found.lower == f64::NEG_INFINITY {
            found.lower = r.dot(&found.point) - body.displacement(&found.point) - turned;
        }
        found.iterations = iterations;
        *warm = Hint::Single { y: self.single.to_body(&found.point), active }.into();
        found
    }
}

bracketed!(HalfSpaceDistance);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::body::Compound;
    use crate::measure::solver::stages::except;
    use crate::measure::tests::random_pose;
    use sublevel_testkit::Seeded;

    #[test]
    fn supports_have_closed_forms() {
        // A body and its support along a direction of its own frame.
        type Case = (Body, fn(&Vector3<f64>, &Vector3<f64>) -> f64);
        fn dual(half: &Vector3<f64>, n: &Vector3<f64>, k: f64) -> f64 {
            let q = k / (k - 1.0);
            half.component_mul(n).map(|c| c.abs().powf(q)).sum().powf(1.0 / q)
        }
        let half = Vector3::new(0.4, 1.0, 2.5);
        let power = |k| Body::superellipsoid("q", Vector3::zeros(), half, k).unwrap();
        let cases: [Case; 6] = [
            (power(2), |h, n| dual(h, n, 2.0)),
            (power(4), |h, n| dual(h, n, 4.0)),
            (power(6), |h, n| dual(h, n, 6.0)),
            (power(8), |h, n| dual(h, n, 8.0)),
            (Body::cuboid("b", half).unwrap(), |h, n| h.dot(&n.abs())),
            (Body::cylinder("c", half.x, half.y).unwrap(), |h, n| h.x * n.x.hypot(n.y) + h.y * n.z.abs()),
        ];
        let (mut most, mut total) = (0, 0);
        for seed in 0..3000 {
            let mut random = Seeded(seed);
            let (body, support) = &cases[(seed % 6) as usize];
            let pose = random_pose(&mut random, 3.0);
            // General directions, and nearly or exactly along an axis or a face.
            let mut n = random.unit();
            if seed % 5 > 1 {
                let small = [0.0, 1e-12, 1e-6, 1e-3][(random.next() % 4) as usize];
                n = (Vector3::from_fn(|i, _| f64::from(u8::from(i as u64 == seed % 3))) + n * small).normalize();
            }
            let offset = 3.0 * random.signed();
            let half_space = HalfSpace::new(pose.transform_direction(&n), offset).unwrap();
            let truth = half_space.normal().dot(pose.translation()) - support(&half, &-n) - offset;
            let mut warm = WarmStart::default();
            let ask =
                |warm: &mut WarmStart| distance_to_half_space(body, &pose, &half_space, &Options::default(), warm);
            // Closed forms are left out once, so that the search has to find what they say.
            for closed in [false, false, true] {
                let found = if closed { ask(&mut warm) } else { except(&[Stage::ClosedForm], || ask(&mut warm)) };
                let label = format!("seed {seed} {n:?}: {found:?} against {truth}");
                assert_eq!(found.status, Status::Converged, "{label}");
                assert!(found.lower <= truth + 1e-14 && truth - 1e-14 <= found.upper, "{label}");
                let height = half_space.normal().dot(&found.witness) - offset;
                assert!((height - found.upper).abs() < 1e-12, "{label}");
                (most, total) = (most.max(found.iterations), total + found.iterations);
            }
        }
        assert!(total < 4 * 6000 && most <= 90, "{total}, most {most}");
    }

    #[test]
    fn gradients_are_differences_apart_and_deep() {
        let body = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 1.0, 2.0)).unwrap();
        let options = Options::default().with_accuracy(1e-13).unwrap();
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let pose = random_pose(&mut random, 2.0);
            let half_space = HalfSpace::new(random.unit(), 2.0 * random.signed()).unwrap();
            let at =
                |pose: &Pose| distance_to_half_space(&body, pose, &half_space, &options, &mut WarmStart::default());
            let gradient = at(&pose).pose_gradient(&pose, &half_space);
            for axis in 0..3 {
                let e = Vector3::from_fn(|i, _| f64::from(u8::from(i == axis)));
                let turned = |t: f64| {
                    let turn = nalgebra::UnitQuaternion::from_scaled_axis(e * t) * pose.rotation();
                    Pose::from_quaternion(pose.translation() + e * t * 0.5, turn.coords.into()).unwrap()
                };
                let slope = (at(&turned(1e-4)).value() - at(&turned(-1e-4)).value()) / 2e-4;
                let expected = gradient.angular[axis] + 0.5 * gradient.linear[axis];
                assert!((slope - expected).abs() < 1e-5, "seed {seed}: {slope} against {expected}");
            }
        }
    }

    #[test]
    fn the_lowest_part_counts_and_half_spaces_are_checked() {
        let at = |x: f64, z: f64| Body::ball("part", Vector3::new(x, 0.0, z), 1.0).unwrap();
        let steps = Compound::new("steps", vec![at(0.0, 0.0), at(2.0, 0.5), at(4.0, 1.0)]).unwrap();
        let mut warm = WarmStart::default();
        for k in 0..60 {
            let (sine, cosine) = (0.1 * f64::from(k)).sin_cos();
            let half_space = HalfSpace::new(Vector3::new(sine, 0.0, cosine), -3.0).unwrap();
            let truth = [(0.0, 0.0), (2.0, 0.5), (4.0, 1.0)].map(|(x, z)| sine * x + cosine * z - 1.0 + 3.0);
            let truth = truth.into_iter().fold(f64::MAX, f64::min);
            let found = distance_to_half_space(&steps, &Pose::identity(), &half_space, &Options::default(), &mut warm);
            assert!((found.value() - truth).abs() < 1e-8 && found.lower <= truth, "{found:?} against {truth}");
        }
        assert!(matches!(HalfSpace::new(Vector3::z() * 1.001, 0.0), Err(HalfSpaceError::NotUnit(_))));
        assert_eq!(HalfSpace::new(Vector3::z() * f64::NAN, 0.0), Err(HalfSpaceError::NotFinite("normal")));
        assert_eq!(HalfSpace::new(Vector3::z(), f64::NAN), Err(HalfSpaceError::NotFinite("offset")));
    }
}
