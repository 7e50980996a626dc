//! Who answers: our solver in its three forms, and others.

use super::arbiter::{Proposal, Truth, judge};
use super::question::{CaseError, Question, Verdict};
use crate::baselines::{Clarabel, ConicProgram, Posed, between, newton, slsqp};
use crate::comparison::{Coal, Hulls, PeerError, PeerShape, motion::Trajectory, parry_pose};
use nalgebra::{UnitQuaternion, Vector3};
use std::path::Path;
use std::str::FromStr;
use sublevel::body::{Body, fibonacci_lattice};
use sublevel::measure::{
    Distance, MAX_ITERATIONS, Options, Pose, SignedDistance, Status, WarmStart, distance, distance_batch,
    signed_distance,
};
use sublevel::optimize::{Corner, gjk};
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::random::pose;

/// Points of a body's surface whose convex hull stands for it where polytopes are asked for.
const SAMPLES: usize = 1000;

/// Error that others may have, relative to the smaller body.
pub(super) const PEER_ERROR: f64 = 1e-5;

/// Steps of plain Newton, and evaluations of SLSQP: both are done long before, or not at all.
const NEWTON_STEPS: u32 = 100;
/// Length of the last step, relative to the smaller body, below which it counts as arrived.
const NEWTON_STEP: f64 = 1e-6;
/// See [`NEWTON_STEPS`].
const SLSQP_EVALUATIONS: u32 = 1000;

/// Tolerance of clarabel: its default.
const CLARABEL: f64 = 1e-8;

/// Rounding of a polynomial's value on the surface.
const LEVEL: f64 = 1e-12;

/// Width of the bracket from which proposals come, relative to the smaller body.
const TIGHT: f64 = 1e-12;

/// A column of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    /// Ours without a hint.
    Cold,
    /// Ours with the hint of a pose nearby.
    Warm,
    /// Ours, as one of nine poses of a batch.
    Batch,
    /// Undamped Newton on the optimality system.
    Newton,
    /// A general nonlinear program, by SLSQP.
    Slsqp,
    /// Level 0 of the hierarchy, a semidefinite program, by clarabel.
    Clarabel,
    /// GJK of parry on sampled hulls.
    Parry,
    /// GJK of coal on sampled hulls.
    Coal,
}

/// No method of that name.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0} is none of cold, warm, batch, newton, slsqp, clarabel, parry, coal")]
pub struct UnknownMethod(String);

impl FromStr for Method {
    type Err = UnknownMethod;

    fn from_str(name: &str) -> Result<Self, UnknownMethod> {
        let named = Self::ALL.into_iter().find(|method| method.name() == name);
        named.ok_or_else(|| UnknownMethod(name.to_owned()))
    }
}

impl Method {
    /// All columns.
    pub const ALL: [Self; 8] =
        [Self::Cold, Self::Warm, Self::Batch, Self::Newton, Self::Slsqp, Self::Clarabel, Self::Parry, Self::Coal];

    /// Its name in commands and tables of numbers.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cold => "cold",
            Self::Warm => "warm",
            Self::Batch => "batch",
            Self::Newton => "newton",
            Self::Slsqp => "slsqp",
            Self::Clarabel => "clarabel",
            Self::Parry => "parry",
            Self::Coal => "coal",
        }
    }

    /// The heading of its column.
    pub fn title(self) -> &'static str {
        match self {
            Self::Cold => "ours, cold",
            Self::Warm => "ours, warm",
            Self::Batch => "ours, batch",
            Self::Newton => "plain Newton",
            Self::Slsqp => "SLSQP",
            Self::Clarabel => "semidefinite, clarabel",
            Self::Parry => "GJK on hulls, parry",
            Self::Coal => "GJK on hulls, coal",
        }
    }

    /// Most cases of a family that a quick run and a full one put to it: those of others take long,
    /// semidefinite programs up to a second each.
    pub(super) fn most_cases(self) -> [u64; 2] {
        match self {
            Self::Cold | Self::Warm | Self::Batch => [u64::MAX; 2],
            Self::Clarabel => [5, 24],
            Self::Newton | Self::Slsqp | Self::Parry | Self::Coal => [20, 100],
        }
    }

    /// Whether it is ours.
    pub fn is_ours(self) -> bool {
        matches!(self, Self::Cold | Self::Warm | Self::Batch)
    }
}

/// A method's answer to a case, and what it is worth.
#[derive(Clone, Debug)]
pub(super) struct Answer {
    pub(super) verdict: Verdict,
    /// The distance, metres, where it found one.
    pub(super) value: Option<f64>,
    /// All of the answer, if it is one of ours.
    pub(super) ours: Option<Distance>,
}

/// An answer of somebody else.
pub(super) struct Reply {
    /// The distance, metres; none if it says that it found none.
    pub(super) value: Option<f64>,
    pub(super) proposal: Proposal,
    /// The truth where the question was another one: about hulls.
    pub(super) own: Option<Truth>,
}

impl Question {
    /// Bodies, poses, our answer and the truth, for people.
    pub(super) fn describe(&self) -> String {
        let Case { a, pose_a, b, pose_b, accuracy, what, .. } = &self.0;
        let placed = |body: &Body, pose: &Pose| {
            let sizes =
                body.normalization().linear.try_inverse().map_or(Vector3::zeros(), |inverse| inverse.diagonal());
            let (t, q) = (pose.translation(), pose.rotation().coords);
            format!("{} of half-axes {sizes:?} m at {t:?} m, quaternion {q:?}", body.name())
        };
        let answer = self.ours(Method::Cold).map_or_else(|error| error.to_string(), |answer| format!("{answer:?}"));
        let truth = self.truth(&[]).map_or_else(|error| error.to_string(), |truth| format!("{truth:?}"));
        format!(
            "  {what}, accuracy {accuracy:e}\n  {}\n  {}\n  ours, cold: {answer}\n  {truth}",
            placed(a, pose_a),
            placed(b, pose_b)
        )
    }
}

impl Question {
    /// Puts the case to a method, and judges its answer. None where the method cannot be asked.
    pub(super) fn put(&self, method: Method) -> Result<Option<Verdict>, CaseError> {
        Ok(self.run(method)?.map(|answer| answer.verdict))
    }

    /// As [`Question::put`], with the answer.
    pub(super) fn run(&self, method: Method) -> Result<Option<Answer>, CaseError> {
        if method.is_ours() {
            let answer = self.ours(method)?;
            return Ok(Some(Answer {
                verdict: self.verdict(&answer)?,
                value: Some(answer.value()),
                ours: Some(answer),
            }));
        }
        // Others have other limits.
        if self.limit.is_some() {
            return Ok(None);
        }
        let Some(reply) = self.ask(method)? else { return Ok(None) };
        let truth = reply.own.map_or_else(|| self.truth(std::slice::from_ref(&reply.proposal)), Ok)?;
        Ok(Some(Answer { verdict: reply.verdict(&truth, self), value: reply.value, ours: None }))
    }

    /// How much answers of a method may differ from the truth, metres.
    pub(super) fn slack(&self, method: Method) -> f64 {
        self.small() * if method.is_ours() { self.accuracy } else { PEER_ERROR }
    }

    /// Our answer.
    pub(super) fn ours(&self, method: Method) -> Result<Distance, CaseError> {
        let options = self.options()?;
        let Case { a, pose_a, b, pose_b, .. } = &self.0;
        let near = self.pose_nearby();
        Ok(match method {
            Method::Batch => {
                let mut poses = [near; 9];
                poses[4] = *pose_b;
                let mut answers = [Distance::default(); 9];
                let solved = distance_batch(a, pose_a, b, &poses, &options, &mut answers);
                solved.map_err(CaseError::other)?;
                answers[4]
            }
            Method::Warm => {
                let mut warm = WarmStart::default();
                distance(a, pose_a, b, &near, &options, &mut warm);
                distance(a, pose_a, b, pose_b, &options, &mut warm)
            }
            _ => distance(a, pose_a, b, pose_b, &options, &mut WarmStart::default()),
        })
    }

    /// What another measure of ours says, by the pose of the second body: without a hint, or warm
    /// with that of the pose nearby.
    pub(super) fn measured<T>(&self, method: Method, measure: impl Fn(&Pose, &mut WarmStart) -> T) -> T {
        let mut warm = WarmStart::default();
        if method == Method::Warm {
            measure(&self.pose_nearby(), &mut warm);
        }
        measure(&self.pose_b, &mut warm)
    }

    /// Our signed distance.
    pub(super) fn signed(&self, method: Method) -> Result<SignedDistance, CaseError> {
        let Case { a, pose_a, b, .. } = &self.0;
        let options = self.options()?;
        Ok(self.measured(method, |pose_b, warm| signed_distance(a, pose_a, b, pose_b, &options, warm)))
    }

    /// Nearest points and normal as a method finds them. None where it cannot be asked: of hulls
    /// they are others.
    pub(super) fn proposed(&self, method: Method) -> Result<Option<Proposal>, CaseError> {
        match method {
            Method::Cold | Method::Warm | Method::Batch => Ok(Some(proposal(&self.ours(method)?))),
            Method::Newton => Ok(self.ask(method)?.map(|reply| reply.proposal)),
            Method::Slsqp | Method::Clarabel | Method::Parry | Method::Coal => Ok(None),
        }
    }

    fn options(&self) -> Result<Options<'static>, CaseError> {
        Ok(Options::default()
            .with_accuracy(self.accuracy)?
            .with_max_iterations(self.limit.unwrap_or(MAX_ITERATIONS))?)
    }

    /// A hundredth of the second body's size and half a degree before.
    fn pose_nearby(&self) -> Pose {
        let step = Vector3::new(0.006, -0.005, 0.006) * self.b.circumscribed().radius;
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.005, 0.005, -0.005));
        pose(self.pose_b.translation() + step, &(turn * self.pose_b.rotation()))
    }

    /// The truth, as these proposals and those of a tight answer of ours show it.
    pub(super) fn truth(&self, proposals: &[Proposal]) -> Result<Truth, CaseError> {
        let tight = Options::default().with_accuracy(TIGHT)?;
        let Case { a, pose_a, b, pose_b, .. } = &self.0;
        let answer = distance(a, pose_a, b, pose_b, &tight, &mut WarmStart::default());
        let mut all = proposals.to_vec();
        all.push(proposal(&answer));
        Ok(judge(self, &all))
    }

    /// Judges an answer of ours: its bracket, its status, its error.
    pub(super) fn verdict(&self, answer: &Distance) -> Result<Verdict, CaseError> {
        Ok(self.verdict_by(answer, &self.truth(&[proposal(answer)])?))
    }

    /// As [`Question::verdict`], by a truth that is known.
    pub(super) fn verdict_by(&self, answer: &Distance, truth: &Truth) -> Verdict {
        let Distance { lower, upper, status, iterations, .. } = *answer;
        let small = self.small();
        if !(lower >= 0.0 && lower <= upper && upper.is_finite()) {
            return Verdict::WrongStatus(format!("the bracket is [{lower:e}, {upper:e}]"));
        }
        let width = upper - lower;
        let is_narrow = width <= self.accuracy * small * (1.0 + 1e-12);
        if status == Status::Converged && !is_narrow {
            return Verdict::WrongStatus(format!("converged with a bracket of {width:e} m"));
        }
        if status == Status::BracketWide && self.limit.is_none() && width > self.floor {
            return Verdict::WrongStatus(format!("the bracket is still wide, {width:e} m"));
        }
        if iterations > self.limit.unwrap_or(MAX_ITERATIONS) {
            return Verdict::WrongStatus(format!("{iterations} iterations"));
        }
        // Points that were proposed may all be wrong: they decide only where directions confirm
        // them.
        if !self.is_known_by(truth) {
            return Verdict::WrongStatus(format!("not confirmed: [{:e}, {:e}] m", truth.lower, truth.upper));
        }
        let apart = (answer.witness_a - answer.witness_b).norm();
        if !(apart <= upper + truth.floor && apart >= lower - truth.floor) {
            return Verdict::WrongStatus(format!("the witnesses are {apart:e} m apart"));
        }
        let outside = (truth.lower - truth.floor - upper).max(lower - truth.upper - truth.floor);
        if outside > 0.0 {
            return Verdict::Off(outside / small);
        }
        let beyond = self.beyond(answer, truth.floor);
        if !(beyond <= 0.0) {
            return Verdict::WrongStatus(format!("a witness is outside of its body, by {beyond:e} of its level"));
        }
        let error = truth.error(answer.value());
        if self.bound.is_some_and(|bound| error > bound) { Verdict::Off(error / small) } else { Verdict::Pass }
    }

    /// Whether bounds meet as nearly as an answer to this case has to.
    pub(super) fn is_known_by(&self, truth: &Truth) -> bool {
        truth.upper - truth.lower <= (self.accuracy * self.small()).max(self.floor) + 2.0 * truth.floor
    }

    /// How far the witnesses are outside of their bodies, as levels of the polynomials, beyond what
    /// coordinates that are rounded by `floor` metres explain.
    fn beyond(&self, answer: &Distance, floor: f64) -> f64 {
        let of = |body: &Body, pose: &Pose, x: &Vector3<f64>| {
            let x = pose.rotation().inverse_transform_vector(&(x - pose.translation()));
            let samples = body.constraints().iter().map(|constraint| body.placement().sample(constraint, &x));
            let levels = samples.map(|sample| sample.value() - 1.0 - sample.gradient().norm() * floor - LEVEL);
            levels.fold(f64::NEG_INFINITY, f64::max)
        };
        of(&self.a, &self.pose_a, &answer.witness_a).max(of(&self.b, &self.pose_b, &answer.witness_b))
    }

    /// The answer of somebody else; none if it cannot be asked.
    pub(super) fn ask(&self, method: Method) -> Result<Option<Reply>, CaseError> {
        let plain = |value| Reply { value, proposal: Proposal::default(), own: None };
        Ok(match method {
            Method::Cold | Method::Warm | Method::Batch => None,
            // Theirs are problems of one constraint each.
            Method::Newton | Method::Slsqp if !(self.a.is_smooth() && self.b.is_smooth()) => None,
            Method::Newton => {
                let bodies = self.posed();
                let found = newton(&bodies, between(&bodies), NEWTON_STEPS);
                let has_converged = found.step_m <= NEWTON_STEP * self.small();
                let points = has_converged.then_some(found.points);
                let proposal = Proposal { points, normal: None, active: [vec![0], vec![0]] };
                Some(Reply { value: has_converged.then(|| found.apart()), proposal, own: None })
            }
            Method::Slsqp => {
                let bodies = self.posed();
                let (value, _) = slsqp(&bodies, between(&bodies), self.small(), SLSQP_EVALUATIONS);
                Some(plain(Some(value)))
            }
            Method::Clarabel => {
                let Some(solver) = Clarabel::find()? else { return Ok(None) };
                let posed = [(&self.a, &self.pose_a), (&self.b, &self.pose_b)];
                let unit = self.small();
                let program = ConicProgram::distance(posed, unit);
                let found = in_folder(|folder| solver.solve((folder, "case"), vec![program], &[CLARABEL], 1))?;
                let found = found.first().and_then(|of| of.first()).filter(|found| found.solved);
                Some(plain(found.and_then(|found| found.value).map(|value| value * unit)))
            }
            Method::Parry => {
                let (a, b) = (sampled(&self.a), sampled(&self.b));
                // Of some needles it makes no hull.
                let Ok(hulls) = Hulls::new(&a, &b) else { return Ok(Some(plain(None))) };
                let relative = parry_pose(&self.pose_a).inverse() * parry_pose(&self.pose_b);
                let own = Some(polytopes(&a, &b, &self.relative(), self.small()));
                Some(Reply { value: Some(hulls.distance(&relative)), own, ..plain(None) })
            }
            Method::Coal => {
                let Some(coal) = Coal::from_environment()? else { return Ok(None) };
                let (a, b, relative) = (sampled(&self.a), sampled(&self.b), self.relative());
                let value =
                    in_folder(|folder| coal_distance(&coal, folder, [&a[..], &b[..]].map(PeerShape::Hull), relative))?;
                Some(Reply { value, own: Some(polytopes(&a, &b, &relative, self.small())), ..plain(None) })
            }
        })
    }

    fn posed(&self) -> [Posed<'_>; 2] {
        [Posed::new(&self.a, &self.pose_a), Posed::new(&self.b, &self.pose_b)]
    }

    /// The second body's pose in the frame of the first.
    fn relative(&self) -> Pose {
        let back = self.pose_a.rotation().inverse();
        pose(back * (self.pose_b.translation() - self.pose_a.translation()), &(back * self.pose_b.rotation()))
    }
}

impl Reply {
    /// Judges it.
    pub(super) fn verdict(&self, truth: &Truth, case: &Question) -> Verdict {
        let Some(value) = self.value else { return Verdict::NoAnswer };
        // Not `>`: a NaN is off.
        let error = (truth.lower - value).max(value - truth.upper) - truth.floor;
        let allowed = (PEER_ERROR * case.small()).max(case.bound.unwrap_or(0.0));
        if error <= allowed { Verdict::Pass } else { Verdict::Off(error / case.small()) }
    }
}

pub(super) fn coal_distance(
    coal: &Coal,
    folder: &Path,
    shapes: [PeerShape<'_>; 2],
    relative: Pose,
) -> Result<Option<f64>, PeerError> {
    let trajectory: Trajectory = vec![relative];
    let mut run = coal.start(folder, "case", shapes, &[trajectory])?;
    run.pass()?;
    Ok(run.distances()?.first().and_then(|distances| distances.first()).copied())
}

/// Does something with a folder of this process alone, which is removed afterwards.
pub(super) fn in_folder<T>(work: impl FnOnce(&Path) -> Result<T, PeerError>) -> Result<T, CaseError> {
    let folder = std::env::temp_dir().join(format!("sublevel-stability-{}", std::process::id()));
    std::fs::create_dir_all(&folder).map_err(PeerError::io(&folder))?;
    let done = work(&folder);
    // What stays is in the folder for temporary files.
    let _ = std::fs::remove_dir_all(&folder);
    Ok(done?)
}

/// Most times that the search for the distance of hulls goes on from the direction it found.
const RESTARTS: usize = 50;

/// The distance of the hulls of points, the second ones posed in the frame of the first.
fn polytopes(a: &[Vector3<f64>], b: &[Vector3<f64>], relative: &Pose, small: f64) -> Truth {
    let b: Vec<_> = b.iter().map(|y| relative.transform_point(y)).collect();
    let size = a.iter().chain(&b).map(Vector3::norm).fold(0.0, f64::max);
    supported([&|n| farthest(a, n), &|n| farthest(&b, n)], a[0] - b[0], (size, small))
}

/// The point that is farthest along a direction.
pub(super) fn farthest(points: &[Vector3<f64>], n: &Vector3<f64>) -> Vector3<f64> {
    points.iter().copied().max_by(|x, y| n.dot(x).total_cmp(&n.dot(y))).unwrap_or_default()
}

/// A convex set as its point that is farthest along a direction.
pub(super) type Farthest<'a> = &'a dyn Fn(&Vector3<f64>) -> Vector3<f64>;

/// The distance of two convex sets, from a direction on: between points of theirs, and along the
/// line between these; bounds that do not meet are all that is known. Rounding is relative to
/// `size`, and what others may be wrong by to `small`, metres.
pub(super) fn supported(sets: [Farthest<'_>; 2], mut n: Vector3<f64>, (size, small): (f64, f64)) -> Truth {
    let support = |n: &Vector3<f64>| {
        let (x, y) = (sets[0](&-n), sets[1](n));
        Corner { x, y, difference: x - y }
    };
    let mut truth = Truth { lower: 0.0, upper: f64::INFINITY, floor: 16.0 * f64::EPSILON * size };
    for _ in 0..RESTARTS {
        let found = gjk(0.0, &n, support);
        if found.common.is_some() {
            return Truth { upper: 0.0, ..truth };
        }
        n = found.n;
        truth.lower = truth.lower.max(n.dot(&support(&n).difference));
        truth.upper = truth.upper.min((found.x - found.y).norm());
        if truth.upper - truth.lower <= 0.1 * PEER_ERROR * small {
            break;
        }
    }
    truth
}

/// Points of a body's surface, in its frame.
pub(super) fn sampled(body: &Body) -> Vec<Vector3<f64>> {
    fibonacci_lattice(SAMPLES).map(|u| body.boundary_along(&u)).collect()
}

/// What an answer of ours proposes.
pub(super) fn proposal(answer: &Distance) -> Proposal {
    let active = [&answer.active_a, &answer.active_b].map(|active| active.iter().map(|(index, _)| index).collect());
    Proposal { points: Some([answer.witness_a, answer.witness_b]), normal: answer.normal, active }
}
