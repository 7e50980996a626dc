//! Signed distances of a solid and a capsule at many poses at once.

use super::error::BatchError;
use super::lane_poses::pose_of;
use super::rounds::MOST_ROUNDS;
use super::shape_pairs::distances_of_axes;
use super::shapes::{ShapeAnswers, ShapeBatch};
use crate::body::{Body, Solid};
use crate::measure::capsule::{Capsule, CapsuleDistance, Problem, distance_to_capsule};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::exact_shape::{ExactProven, Segment};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
use crate::polynomial::dispatch_lanes;

/// Signed distances between `solid` at `poses` and `capsule` at `capsule_poses` (both to the world
/// frame), written to `answers` in their order. Either side may move or stand still: there are as
/// many of its poses as answers, or a single one that stands for all. [`Capsule::POINT`] gives the
/// distances of points.
///
/// Each answer is one of [`distance_to_capsule`] from a cold start in all that is proven of it, and
/// depends on its own poses only, to the last bit. Bodies of one constraint but balls, and boxes
/// and cylinders beside capsules with an axis, are solved several poses at a time, which takes a
/// fraction of the time of as many queries; all others, and poses that do not converge at once such
/// as those in which the axis meets the body, are solved one by one.
///
/// # Errors
/// No poses, different numbers of poses, or a number of places that is not the number of poses;
/// nothing is computed then.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Capsule, CapsuleDistance, Options, Pose, WarmStart};
/// use sublevel_core::measure::distance_to_capsule_batch;
///
/// let egg = Body::ellipsoid("egg", Vector3::zeros(), Vector3::new(1.0, 0.8, 0.6))?;
/// let forearm = Capsule::new(0.1, 0.3)?;
/// let along = |x: f64| Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]);
/// let poses = [along(2.0)?, along(3.0)?, along(4.0)?];
/// let mut answers = [CapsuleDistance::default(); 3];
/// distance_to_capsule_batch(
///     &egg, &[Pose::identity()], &forearm, &poses, &Options::default(), &mut answers,
/// )?;
/// for (answer, gap) in answers.iter().zip([0.9, 1.9, 2.9]) {
///     assert!((answer.value() - gap).abs() < 1e-8);
/// }
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance_to_capsule_batch(
    solid: &impl Solid,
    poses: &[Pose],
    capsule: &Capsule,
    capsule_poses: &[Pose],
    options: &Options<'_>,
    answers: &mut [CapsuleDistance],
) -> Result<(), BatchError> {
    let (of_solid, of_capsule) = (poses.len(), capsule_poses.len());
    if of_solid == 0 || of_capsule == 0 {
        return Err(BatchError::Empty);
    }
    if of_solid != of_capsule && of_solid != 1 && of_capsule != 1 {
        return Err(BatchError::Sides { solid: of_solid, capsule: of_capsule });
    }
    if answers.len() != of_solid.max(of_capsule) {
        return Err(BatchError::Lengths { poses: of_solid.max(of_capsule), answers: answers.len() });
    }
    if let [body] = solid.parts()
        && is_capsule_solved_in_lanes(solid, capsule)
        && options.max_iterations() >= MOST_ROUNDS
        && runs(Stage::Lanes)
    {
        in_lanes((body, poses), (capsule, capsule_poses), options, answers);
    } else {
        for (i, answer) in answers.iter_mut().enumerate() {
            let (pose, capsule_pose) = (pose_of(poses, i), pose_of(capsule_poses, i));
            *answer = distance_to_capsule(solid, pose, capsule, capsule_pose, options, &mut WarmStart::default());
        }
    }
    Ok(())
}

/// Whether [`distance_to_capsule_batch`] solves several poses at a time: of balls, or of a box or a
/// cylinder and a point, the distance is a formula.
pub fn is_capsule_solved_in_lanes(solid: &impl Solid, capsule: &Capsule) -> bool {
    let [body] = solid.parts() else { return false };
    match body.closed_form() {
        Some(form) => !body.is_smooth() && form.axes().is_none() && capsule.half_height_m() > 0.0,
        None => body.is_smooth(),
    }
}

/// The answers of a single body. Not generic, so that it is compiled with this crate, whatever its
/// callers are compiled for.
fn in_lanes(
    of_body: (&Body, &[Pose]),
    of_capsule: (&Capsule, &[Pose]),
    options: &Options<'_>,
    answers: &mut [CapsuleDistance],
) {
    let capsule = of_capsule.0;
    let form = capsule.closed_form();
    let tolerance = options.accuracy() * capsule.smaller_size_m(of_body.0.circumscribed().radius);
    let answers = OfCapsules { of_body, of_capsule, options, tolerance, answers };
    let (axis, half_length) = ((&form, of_capsule.1), capsule.half_height_m());
    if let Some(shape) = of_body.0.closed_form() {
        distances_of_axes((shape, of_body.1), (axis, half_length), tolerance, answers);
    } else {
        dispatch_lanes(ShapeBatch { smooth: of_body, form: axis, set: Segment { half_length }, tolerance, answers });
    }
}

/// Signed distances of a body and a capsule.
struct OfCapsules<'a> {
    of_body: (&'a Body, &'a [Pose]),
    of_capsule: (&'a Capsule, &'a [Pose]),
    options: &'a Options<'a>,
    tolerance: f64,
    answers: &'a mut [CapsuleDistance],
}

impl OfCapsules<'_> {
    fn poses(&self, answer: usize) -> (&Pose, &Pose) {
        (pose_of(self.of_body.1, answer), pose_of(self.of_capsule.1, answer))
    }
}

impl ShapeAnswers for OfCapsules<'_> {
    fn count(&self) -> usize {
        self.answers.len()
    }

    fn is_stopped(&self) -> bool {
        self.options.stopped()
    }

    fn write(&mut self, answer: usize, found: &ExactProven) {
        let (capsule, (_, capsule_pose)) = (self.of_capsule.0, self.poses(answer));
        let (tolerance, options, goal) = (self.tolerance, self.options, StopCriterion::NARROW);
        let answer_of_axis =
            Problem { capsule, capsule_pose, tolerance, options, goal }.outside(&capsule.closed_form(), found);
        // The radius is subtracted with rounding, for which a single query has more digits.
        if answer_of_axis.status == Status::Converged {
            self.answers[answer] = answer_of_axis;
        } else {
            self.solve_alone(answer, found.rounds);
        }
    }

    fn solve_alone(&mut self, answer: usize, rounds: u32) {
        let ((body, _), (capsule, _), (pose, capsule_pose)) = (self.of_body, self.of_capsule, self.poses(answer));
        let options = self.options.after(rounds);
        let found = distance_to_capsule(body, pose, capsule, capsule_pose, &options, &mut WarmStart::default());
        self.answers[answer] = CapsuleDistance { iterations: found.iterations + rounds, ..found };
    }
}
