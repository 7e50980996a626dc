//! Signed distance from a body to a capsule: all points within a radius of a segment.
//!
//! Where the segment lies outside of the body at the distance d, the signed distance of the capsule
//! is `d - radius`: no translation shorter than the difference takes them apart, or brings them
//! into contact, for a ball adds its radius to the support function along every direction. Of a
//! smooth body it is found by Newton's method ([`super::solver::exact_shape`]), of a box, a
//! cylinder or a ball in closed form. Of others the distance of the segment's points, a convex
//! function of the place along it, has its least value between the last two places where it fell
//! and where it rose; the planes that prove the distances there bound it from below.

use crate::body::{Body, ClosedForm, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::pairwise_minimum::{At, Least, bracketed, least};
use crate::measure::point::Projection;
use crate::measure::solver::exact_shape::{
    ExactProven, ExactQuery, ShapeDistance, between_shapes, direction_to_world, to_world,
};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::dispatch;
use nalgebra::Vector3;

/// Most places along a segment at which the distance is taken.
const MAX_PLACES: u32 = 64;

/// All points within a radius of the segment of the z axis from minus to plus a half height, in
/// their own frame; checked when made. A segment of a radius of 0, a ball of a half height of 0, a
/// point of both.
///
/// ```
/// use sublevel_core::measure::Capsule;
///
/// let forearm = Capsule::new(0.05, 0.2)?;
/// assert_eq!(forearm.half_height_m(), 0.2);
/// assert!(Capsule::new(-0.05, 0.2).is_err());
/// # Ok::<(), sublevel_core::measure::CapsuleError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Capsule {
    radius_m: f64,
    half_height_m: f64,
}

/// Why numbers are no capsule.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
#[error("the {size} of a capsule is {value} m; give a number from 0 to 1e15, 0 for none")]
pub struct CapsuleError {
    /// Which size.
    pub size: &'static str,
    /// What it was given as, metres.
    pub value: f64,
}

impl Capsule {
    /// The capsule of a radius and a half height, that of its axis, in metres.
    ///
    /// # Errors
    /// A size that is negative, not finite or beyond 1e15 m.
    pub fn new(radius_m: f64, half_height_m: f64) -> Result<Self, CapsuleError> {
        for (size, value) in [("radius", radius_m), ("half height", half_height_m)] {
            if !(0.0..=1e15).contains(&value) {
                return Err(CapsuleError { size, value });
            }
        }
        Ok(Self { radius_m, half_height_m })
    }

    /// A single point.
    pub const POINT: Self = Self { radius_m: 0.0, half_height_m: 0.0 };

    /// Radius, metres.
    pub fn radius_m(&self) -> f64 {
        self.radius_m
    }

    /// Half of the length of the axis, metres.
    pub fn half_height_m(&self) -> f64 {
        self.half_height_m
    }

    /// Radius of the ball about its centre that contains it, metres.
    pub fn reach_m(&self) -> f64 {
        self.radius_m + self.half_height_m
    }
}

/// Signed distance of a body from a capsule with its proof; lengths in metres, vectors in the world
/// frame.
#[derive(Clone, Copy, Debug)]
pub struct CapsuleDistance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; negative values are depths. Minus infinity where how deep they overlap
    /// is not measured: where the axis of the capsule meets a body that is no ball, and in solids
    /// of several parts.
    pub lower: f64,
    /// Proven upper bound.
    pub upper: f64,
    /// The point of the body nearest to the axis of the capsule.
    pub witness: Vector3<f64>,
    /// The point of the capsule nearest to the body, or deepest in it.
    pub witness_of_capsule: Vector3<f64>,
    /// Unit vector from the capsule to the body; none where the axis meets the body.
    pub normal: Option<Vector3<f64>>,
    /// Whether another part may be as near, their brackets meeting: witnesses and normal may then
    /// jump. Never for single bodies.
    pub tied: bool,
    /// Iterations.
    pub iterations: u32,
}

impl CapsuleDistance {
    /// The answer inside the bracket: the upper bound, which the witnesses attain.
    pub fn value(&self) -> f64 {
        self.upper
    }

    /// Gradients with respect to the poses of the body and of the capsule that the distance was
    /// asked for; through contact and in depth as well, as long as the axis is outside of the body.
    /// By the envelope theorem the witnesses count as fixed.
    pub fn gradients(&self, pose: &Pose, capsule_pose: &Pose) -> Option<[Twist; 2]> {
        let n = self.normal?;
        Some([
            Twist::of_gradient(n, &self.witness, pose.translation()),
            Twist::of_gradient(-n, &self.witness_of_capsule, capsule_pose.translation()),
        ])
    }
}

bracketed!(CapsuleDistance);

/// Signed distance of a solid at `pose` from a capsule at `capsule_pose` (both to the world frame):
/// positive apart, zero in contact, minus the penetration depth in overlap as long as the axis of
/// the capsule is outside of the solid.
///
/// The bracket is as narrow as `options` ask, relative to the smaller of both circumradii, or the
/// status says that it is not. `warm` is read and then replaced by the hint for the next query.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, Options, Pose, WarmStart, distance_to_capsule};
///
/// let crate_ = Body::cuboid("crate", Vector3::new(0.5, 0.5, 0.5))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let beside = Pose::from_quaternion(Vector3::new(1.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let (options, mut warm) = (Options::default(), WarmStart::default());
/// let origin = Pose::identity();
/// let found = distance_to_capsule(&crate_, &origin, &forearm, &beside, &options, &mut warm);
/// assert!((found.value() - 0.4).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_capsule(
    solid: &impl Solid,
    pose: &Pose,
    capsule: &Capsule,
    capsule_pose: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> CapsuleDistance {
    let size = if capsule.reach_m() > 0.0 { capsule.reach_m() } else { f64::INFINITY };
    let tolerance = options.accuracy() * solid.circumscribed().radius.min(size);
    let problem = Problem { capsule, capsule_pose, tolerance, options };
    let parts = solid.parts();
    if let [body] = parts {
        return problem.solve((body, pose), warm);
    }
    let bound = |(i, _): (usize, usize)| {
        let ball = parts[i].circumscribed();
        let center = pose.transform_point(&ball.center);
        let apart = (center - capsule_pose.translation()).norm();
        let size = center.norm() + capsule_pose.translation().norm() + ball.radius + capsule.reach_m();
        apart - ball.radius - capsule.reach_m() - (CULLING_SLACK + ROTATION_ERROR) * size
    };
    let found = least((parts.len(), 1), bound, f64::NEG_INFINITY, warm, |(i, _), _, hint| {
        problem.solve((&parts[i], pose), hint)
    });
    let Least { best, lower, tied, iterations, .. } = found;
    // How deep something is in a union no single part knows.
    let lower = if lower < 0.0 { f64::NEG_INFINITY } else { lower };
    CapsuleDistance { status: Status::of(best.upper - lower <= tolerance), lower, tied, iterations, ..best }
}

/// Signed distance of two capsules where they stand: positive apart, minus the penetration depth in
/// overlap as long as their axes do not meet. The witnesses are those of the first and of the
/// second, the normal leads from the second to the first.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Capsule, Options, Pose, distance_of_capsules};
///
/// let limb = Capsule::new(0.05, 0.2)?;
/// let beside = Pose::from_quaternion(Vector3::new(0.3, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let found = distance_of_capsules(&limb, &Pose::identity(), &limb, &beside, &Options::default());
/// assert!((found.value() - 0.2).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_of_capsules(
    a: &Capsule,
    pose_a: &Pose,
    b: &Capsule,
    pose_b: &Pose,
    options: &Options<'_>,
) -> CapsuleDistance {
    let size = [a.reach_m(), b.reach_m()].into_iter().filter(|&reach| reach > 0.0).fold(f64::INFINITY, f64::min);
    let between = (pose_a.translation() - pose_b.translation()).norm();
    // Two points have no size but their distance.
    let tolerance = options.accuracy() * if size.is_finite() { size } else { between };
    let (form_a, form_b) =
        (ClosedForm::capsule(a.radius_m, a.half_height_m), ClosedForm::capsule(b.radius_m, b.half_height_m));
    let radii = a.radius_m + b.radius_m;
    let Ok(found) = between_shapes((&form_a, pose_a), (&form_b, pose_b), None, (tolerance, options)) else {
        let slack = (CULLING_SLACK + ROTATION_ERROR) * (between + a.reach_m() + b.reach_m());
        let (witness, other) = (*pose_a.translation(), *pose_b.translation());
        return CapsuleDistance {
            status: Status::BracketWide,
            lower: (between - a.reach_m() - b.reach_m() - slack).max(-radii),
            upper: between - radii + slack,
            witness,
            witness_of_capsule: other,
            normal: None,
            tied: true,
            iterations: options.max_iterations(),
        };
    };
    let ShapeDistance { lower, upper, witness_a, witness_b, normal, steps, .. } = found;
    CapsuleDistance {
        status: Status::of(upper - lower <= tolerance),
        lower,
        upper,
        witness: witness_a,
        witness_of_capsule: witness_b,
        normal: normal.try_normalize(0.0),
        tied: false,
        iterations: steps,
    }
}

/// A capsule where it stands, and how its distance is to be solved.
struct Problem<'a> {
    capsule: &'a Capsule,
    capsule_pose: &'a Pose,
    /// Width of the bracket that is narrow enough, metres.
    tolerance: f64,
    options: &'a Options<'a>,
}

impl Problem<'_> {
    fn solve(&self, of_body: At<'_, Body>, warm: &mut WarmStart) -> CapsuleDistance {
        let found = if !runs(Stage::ClosedForm) {
            None
        } else if of_body.0.closed_form().is_some() {
            self.of_shape(of_body, warm)
        } else if of_body.0.is_smooth() {
            self.of_smooth(of_body, warm)
        } else {
            None
        };
        found.unwrap_or_else(|| self.along_axis(of_body, warm))
    }

    fn form(&self) -> ClosedForm {
        ClosedForm::capsule(self.capsule.radius_m, self.capsule.half_height_m)
    }

    /// Of a body with a single constraint.
    fn of_smooth(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> Option<CapsuleDistance> {
        let Self { capsule_pose: form_pose, tolerance, options, .. } = *self;
        let (form, goal) = (self.form(), StopCriterion::NARROW);
        let trace = if let Hint::Exact(trace) = &warm.hint { Some(trace) } else { None };
        let query = ExactQuery { body, pose, form: &form, form_pose, goal: &goal, tolerance, options, trace };
        let found = dispatch(query).ok()?;
        let ExactProven { lower, upper, x, nearest, n, rounds, trace, .. } = found;
        let [witness, on_axis] = [x, nearest].map(|point| to_world(&form, form_pose, point));
        if upper == 0.0 {
            *warm = WarmStart::default();
            return Some(self.met(&witness, rounds));
        }
        *warm = trace.map_or_else(WarmStart::default, |trace| Hint::Exact(trace).into());
        let normal = direction_to_world(&form, form_pose, n);
        Some(self.apart([lower, upper], [witness, on_axis], normal, rounds))
    }

    /// Of a body with a closed form.
    fn of_shape(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> Option<CapsuleDistance> {
        let form = self.form();
        let start = if let Hint::Shapes { x_a } = &warm.hint { Some(pose.transform_point(x_a)) } else { None };
        let of_body = (body.closed_form()?, pose);
        let found =
            between_shapes(of_body, (&form, self.capsule_pose), start.as_ref(), (self.tolerance, self.options)).ok()?;
        let ShapeDistance { lower, upper, witness_a, witness_b, normal, steps, .. } = found;
        let x_a = pose.rotation().inverse_transform_vector(&(witness_a - pose.translation()));
        *warm = Hint::Shapes { x_a }.into();
        if normal == Vector3::zeros() {
            let status = Status::of(upper - lower <= self.tolerance);
            return Some(CapsuleDistance { status, lower, upper, ..self.met(&witness_a, steps) });
        }
        Some(CapsuleDistance {
            status: Status::of(upper - lower <= self.tolerance),
            lower,
            upper,
            witness: witness_a,
            witness_of_capsule: witness_b,
            normal: Some(normal),
            tied: false,
            iterations: steps,
        })
    }

    /// An answer by the distance from the axis.
    fn apart(
        &self,
        [lower, upper]: [f64; 2],
        [witness, on_axis]: [Vector3<f64>; 2],
        normal: Vector3<f64>,
        iterations: u32,
    ) -> CapsuleDistance {
        let radius = self.capsule.radius_m;
        let rounding = f64::EPSILON * (radius + upper);
        let (lower, upper) = (lower - radius - rounding, upper - radius + rounding);
        let witness_of_capsule = on_axis + normal * radius;
        let status = Status::of(upper - lower <= self.tolerance);
        CapsuleDistance {
            status,
            lower,
            upper,
            witness,
            witness_of_capsule,
            normal: Some(normal),
            tied: false,
            iterations,
        }
    }

    /// The answer where a point of the axis lies in the body.
    fn met(&self, point: &Vector3<f64>, iterations: u32) -> CapsuleDistance {
        CapsuleDistance {
            status: Status::BracketWide,
            lower: f64::NEG_INFINITY,
            upper: -self.capsule.radius_m,
            witness: *point,
            witness_of_capsule: *point,
            normal: None,
            tied: false,
            iterations,
        }
    }

    /// By the distances of points of the axis.
    fn along_axis(&self, (body, pose): At<'_, Body>, warm: &mut WarmStart) -> CapsuleDistance {
        let (axis, half) = (self.capsule_pose.transform_direction(&Vector3::z()), self.capsule.half_height_m);
        let place = |at: f64| self.capsule_pose.translation() + axis * at;
        let projection = Projection::new(body, pose);
        // Places where the distance falls towards the other one, with tangents that bound it.
        let mut ends: [Option<Tangent>; 2] = [None, None];
        let mut best = CapsuleDistance { upper: f64::INFINITY, ..self.met(pose.translation(), 0) };
        let (mut lower, mut iterations) = (f64::NEG_INFINITY, 0);
        let center = pose.transform_point(body.interior_point()) - self.capsule_pose.translation();
        let mut at = axis.dot(&center).clamp(-half, half);
        let error = (ROTATION_ERROR + CULLING_SLACK) * (self.capsule_pose.translation().norm() + half);
        for _ in 0..MAX_PLACES {
            let point = place(at);
            let found = projection.to(&point, self.tolerance * 0.25, &self.options.after(iterations), warm);
            iterations += found.iterations;
            if found.upper <= 0.0 {
                return CapsuleDistance { upper: error - self.capsule.radius_m, ..self.met(&point, iterations) };
            }
            if found.upper < best.upper + self.capsule.radius_m {
                let bracket = [0.0, found.upper + error];
                best = self.apart(bracket, [found.witness, point], -found.normal, iterations);
            }
            let tangent = Tangent { at, lower: found.lower - error, slope: found.normal.dot(&axis) };
            // One that does not separate is no bound.
            if found.lower > 0.0 {
                ends[usize::from(tangent.slope > 0.0)] = Some(tangent);
            }
            let (bound, next) = Tangent::least(&ends, half);
            lower = bound.max(lower);
            let narrow = best.upper + self.capsule.radius_m - lower <= self.tolerance;
            if narrow || next == at || self.options.exhausted(iterations) {
                break;
            }
            at = next;
        }
        lower = lower.max(0.0) - self.capsule.radius_m * (1.0 + f64::EPSILON);
        CapsuleDistance { status: Status::of(best.upper - lower <= self.tolerance), lower, iterations, ..best }
    }
}

/// A line below the distance along an axis.
#[derive(Clone, Copy)]
struct Tangent {
    at: f64,
    lower: f64,
    slope: f64,
}

impl Tangent {
    fn value(&self, at: f64) -> f64 {
        self.lower + self.slope * (at - self.at)
    }

    /// The least value of a convex function above a line that falls and one that rises, or above
    /// the one there is, between minus and plus `half`; and where that is.
    fn least([falling, rising]: &[Option<Self>; 2], half: f64) -> (f64, f64) {
        match (falling, rising) {
            (Some(low), Some(high)) => {
                let steep = high.slope - low.slope;
                let crossing = (low.lower - high.lower + high.slope * high.at - low.slope * low.at) / steep;
                let at = if steep > 0.0 { crossing.max(-half).min(half) } else { 0.5 * (low.at + high.at) };
                (low.value(at).max(high.value(at)), at)
            }
            (Some(low), None) => (low.value(half), half),
            (None, Some(high)) => (high.value(-half), -half),
            (None, None) => (f64::NEG_INFINITY, 0.0),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::distance_to_point;
    use crate::measure::tests::{random_pose, twisted, zoo};
    use sublevel_testkit::Seeded;

    /// The distance of a body from the axis by golden sections, which know nothing of derivatives.
    fn brute_force(body: &Body, pose: &Pose, capsule: &Capsule, capsule_pose: &Pose) -> f64 {
        let axis = capsule_pose.transform_direction(&Vector3::z());
        let mut warm = WarmStart::default();
        let mut at = |t: f64| {
            let point = capsule_pose.translation() + axis * t;
            distance_to_point(body, pose, &point, &Options::default(), &mut warm).unwrap().upper
        };
        let golden = 0.5 * (5_f64.sqrt() - 1.0);
        let (mut low, mut high) = (-capsule.half_height_m(), capsule.half_height_m());
        for _ in 0..60 {
            let (p, q) = (high - golden * (high - low), low + golden * (high - low));
            if at(p) <= at(q) { high = q } else { low = p }
        }
        at(0.5 * (low + high)) - capsule.radius_m()
    }

    fn random_capsule(random: &mut Seeded, size: f64) -> Capsule {
        let mut length = || size * 10_f64.powf(random.signed() - 0.5);
        let (radius, half) = (length(), length());
        match random.next() % 6 {
            0 => Capsule::new(0.0, half),
            1 => Capsule::new(radius, 0.0),
            2 => Capsule::new(0.0, 0.0),
            _ => Capsule::new(radius, half),
        }
        .unwrap()
    }

    #[test]
    fn capsules_are_as_far_as_points_of_their_axes() {
        let zoos: Vec<_> = (0..6).map(|seed| zoo(&mut Seeded(seed))).collect();
        let (mut apart, mut deep) = (0, 0);
        for seed in 0..1200 {
            let mut random = Seeded(81_000 + seed);
            let bodies = &zoos[(seed % 6) as usize];
            let body = &bodies[random.next() as usize % bodies.len()];
            let size = body.circumscribed().radius;
            let capsule = random_capsule(&mut random, size);
            let pose = random_pose(&mut random, 1.0);
            let middle = pose.transform_point(&body.circumscribed().center);
            let far = (size + capsule.reach_m()) * (0.2 + random.signed().abs());
            let turned = random_pose(&mut random, 0.0);
            let capsule_pose = turned.with_translation(middle + random.unit() * far);
            let truth = brute_force(body, &pose, &capsule, &capsule_pose);
            let mut warm = WarmStart::default();
            for round in 0..2 {
                let found = distance_to_capsule(body, &pose, &capsule, &capsule_pose, &Options::default(), &mut warm);
                let label = format!("seed {seed}, {}, {capsule:?}, round {round}: {found:?}, {truth}", body.name());
                let slack = 1e-7 * size;
                // Of balls depths are known beyond that.
                assert!(found.lower <= truth + slack, "{label}");
                if truth > slack - capsule.radius_m() {
                    apart += 1;
                    assert!(found.status == Status::Converged, "{label}");
                    assert!(truth - slack <= found.upper && found.upper - truth < slack, "{label}");
                    let n = found.normal.expect("the axis is outside");
                    let along = (found.witness - found.witness_of_capsule).dot(&n);
                    assert!((along - found.upper).abs() < slack, "{label}");
                } else if capsule.radius_m() > 0.0 && found.upper == -capsule.radius_m() {
                    deep += 1;
                    assert!(found.lower == f64::NEG_INFINITY && found.normal.is_none(), "{label}");
                }
            }
        }
        assert!(apart > 1200 && deep > 50, "{apart} {deep}");
    }

    #[test]
    fn gradients_of_capsules_are_differences() {
        let egg = Body::ellipsoid("egg", Vector3::new(0.1, 0.2, 0.3), Vector3::new(0.5, 1.0, 0.8)).unwrap();
        let crate_ = Body::cuboid("crate", Vector3::new(0.3, 0.5, 0.7)).unwrap();
        let options = Options::default().with_accuracy(1e-12).unwrap();
        let mut count = 0;
        for seed in 0..200 {
            let mut random = Seeded(seed);
            let body = if seed % 2 == 0 { &egg } else { &crate_ };
            let capsule = Capsule::new(0.4, 0.5).unwrap();
            let (pose, capsule_pose) = (random_pose(&mut random, 1.0), random_pose(&mut random, 2.2));
            let at = |pose: &Pose, capsule_pose: &Pose| {
                distance_to_capsule(body, pose, &capsule, capsule_pose, &options, &mut WarmStart::default())
            };
            let Some([of_body, of_capsule]) = at(&pose, &capsule_pose).gradients(&pose, &capsule_pose) else {
                continue;
            };
            for axis in 0..3 {
                let e = Vector3::ith(axis, 1.0);
                for turn in [false, true] {
                    let part = |twist: &Twist| if turn { twist.angular[axis] } else { twist.linear[axis] };
                    let h = 1e-5;
                    let of = |step: f64| at(&twisted(&pose, &e, turn, step), &capsule_pose).value();
                    let other = |step: f64| at(&pose, &twisted(&capsule_pose, &e, turn, step)).value();
                    let slopes = [(of(h) - of(-h)) / (2.0 * h), (other(h) - other(-h)) / (2.0 * h)];
                    let expected = [part(&of_body), part(&of_capsule)];
                    // Where the nearest feature of a box changes, the second derivative jumps.
                    assert!(
                        (0..2).all(|i| (slopes[i] - expected[i]).abs() < 1e-4),
                        "seed {seed}: {slopes:?} {expected:?}"
                    );
                }
            }
            count += 1;
        }
        assert!(count > 100, "{count}");
    }

    #[test]
    fn sizes_of_capsules_are_checked() {
        for bad in [-1.0, f64::NAN, f64::INFINITY, 1e16] {
            assert!(Capsule::new(bad, 1.0).is_err() && Capsule::new(1.0, bad).is_err());
        }
        // From needles to planets.
        for (radius, half) in [(1e-9, 1e3), (1e6, 1e-9), (0.0, 0.0), (1e9, 1e9)] {
            let ball = Body::ball("ball", Vector3::zeros(), 1.0).unwrap();
            let capsule = Capsule::new(radius, half).unwrap();
            let pose = Pose::from_quaternion(Vector3::new(3.0 + radius, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).unwrap();
            let found = distance_to_capsule(
                &ball,
                &Pose::identity(),
                &capsule,
                &pose,
                &Options::default(),
                &mut WarmStart::default(),
            );
            assert!(found.lower <= 2.0 && 2.0 <= found.upper, "{radius} {half}: {found:?}");
        }
    }
}
