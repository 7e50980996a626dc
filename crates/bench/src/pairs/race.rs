//! One pair of kinds: everybody walks the same poses, in turns.

use nalgebra::Vector3;
use parry3d_f64::math::Pose as ParryPose;
use parry3d_f64::query;
use parry3d_f64::shape::SharedShape;
use sublevel::measure::{Options, Pose, PoseError, WarmStart, distance};

use super::kind::Kind;
use super::model::Model;
use crate::comparison::motion::{self, Trajectory};
use crate::comparison::sweep::{Answer, Row};
use crate::comparison::{Coal, CoalRun, ComparisonError, FitCache, parry_pose};

/// What is asked of a pose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Question {
    /// The distance, from nothing but the poses.
    Cold,
    /// The distance, with a hint from the pose before.
    Warm,
    /// Whether they overlap, a centimetre or less from contact, from nothing but the poses.
    Near,
    /// The distance at the poses of that decision, from nothing but them.
    NearDistance,
    /// The decision where they are apart.
    Apart,
}

impl Question {
    pub(super) const ALL: [Self; 5] = [Self::Cold, Self::Warm, Self::Near, Self::NearDistance, Self::Apart];

    /// Its name in the CSV.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Cold => "cold",
            Self::Warm => "warm",
            Self::Near => "near",
            Self::NearDistance => "near-distance",
            Self::Apart => "apart",
        }
    }
}

/// Who answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    Ours,
    Coal,
    Parry,
}

impl Who {
    pub(super) const ALL: [Self; 3] = [Self::Ours, Self::Coal, Self::Parry];

    /// Its name in the CSV.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Ours => "sublevel",
            Self::Coal => "coal",
            Self::Parry => "parry",
        }
    }
}

/// One question put to one library about one pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct Time {
    pub(super) kinds: [Kind; 2],
    pub(super) who: Who,
    pub(super) question: Question,
    pub(super) nanoseconds: f64,
    pub(super) queries: usize,
    /// Answers that are wider than asked for, or decisions that are none.
    pub(super) failed: usize,
    /// Largest difference of a distance from coal's where both have the same shapes, metres.
    pub(super) differs_m: Option<f64>,
}

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    pub(super) trajectories: usize,
    pub(super) poses: usize,
    pub(super) turns: usize,
}

/// Largest gap near contact, in units of half the larger diameter; depths are three quarters of it
/// at most.
const NEAR: f64 = 0.01;

/// Parry's shapes of a pair, with the relative poses of its frames.
struct Parry {
    shapes: [SharedShape; 2],
    far: Vec<Vec<ParryPose>>,
    near: Vec<Vec<ParryPose>>,
}

/// Times a pair by everybody; `unit_m` is half the larger diameter.
pub(super) fn race(
    kinds: [Kind; 2],
    [a, b]: [&Model; 2],
    unit_m: f64,
    effort: &Effort,
    (cache, coal): (&FitCache, Option<&Coal>),
) -> Result<Vec<Time>, ComparisonError> {
    let mut far = motion::separated(&[(a.body(), b.body())], unit_m, effort.trajectories, effort.poses)?;
    if b.is_half_space() {
        far = far.iter().map(|trajectory| above((a, b), trajectory)).collect::<Result<_, _>>()?;
    }
    let near = far.iter().map(|trajectory| brought_near((a, b), unit_m, trajectory)).collect::<Result<Vec<_>, _>>()?;
    let parry = Parry::new([a, b], [&far, &near])?;
    let mut rows = [
        (
            Who::Ours,
            Question::Cold,
            Row::cold("", &far, |pose| a.distance(b, pose, &mut WarmStart::default()).answer()),
        ),
        (Who::Ours, Question::Warm, Row::warm("", &far, |pose, warm| a.distance(b, pose, warm).answer())),
        (Who::Ours, Question::Near, Row::cold("", &near, |pose| a.overlap(b, pose))),
        (
            Who::Ours,
            Question::NearDistance,
            Row::cold("", &near, |pose| a.distance(b, pose, &mut WarmStart::default()).answer()),
        ),
        (Who::Ours, Question::Apart, Row::cold("", &far, |pose| a.overlap(b, pose))),
        (Who::Parry, Question::Cold, Row::cold("", &parry.far, |pose| parry.distance(pose))),
        (Who::Parry, Question::Near, Row::cold("", &parry.near, |pose| parry.overlap(pose))),
        (Who::Parry, Question::Apart, Row::cold("", &parry.far, |pose| parry.overlap(pose))),
    ];
    let name = format!("pairs-{}-{}", kinds[0].name(), kinds[1].name()).replace(' ', "-");
    let asked = coal.and_then(|coal| Some((coal, [a.coal()?, b.coal()?])));
    let mut run = asked.map(|(coal, shapes)| coal.start(cache.folder(), &name, shapes, &far)).transpose()?;
    for _ in 0..effort.turns {
        run.as_mut().map_or(Ok(()), CoalRun::pass)?;
        rows.iter_mut().for_each(|(.., row)| row.turn());
    }
    let time = |(who, question, row): &(Who, Question, Row<'_>)| {
        let (nanoseconds, queries, failed) = (row.nanoseconds(), row.tally.queries, row.tally.failed);
        Time { kinds, who: *who, question: *question, nanoseconds, queries, failed, differs_m: None }
    };
    let mut times: Vec<Time> = rows.iter().map(time).collect();
    if let Some(run) = run {
        let same = kinds.iter().all(|kind| kind.is_exact());
        let differs_m = same.then(|| run.distances().map(|found| difference([a, b], &far, &found))).transpose()?;
        let queries = far.iter().map(Vec::len).sum();
        let (cold, warm) = run.times();
        times.extend([(Question::Cold, cold), (Question::Warm, warm)].map(|(question, nanoseconds)| Time {
            kinds,
            who: Who::Coal,
            question,
            nanoseconds,
            queries,
            failed: 0,
            differs_m,
        }));
    }
    Ok(times)
}

/// Poses of a shape above a half-space, turning and with gaps as about the ball that stands for it.
fn above((a, half_space): (&Model, &Model), poses: &[Pose]) -> Result<Trajectory, PoseError> {
    let moved = |pose: &Pose| {
        let gap_m = distance(
            a.body(),
            &Pose::identity(),
            half_space.body(),
            pose,
            &Options::default(),
            &mut WarmStart::default(),
        );
        let turned = Pose::from_quaternion(Vector3::zeros(), pose.rotation().inverse().coords.into())?;
        at_gap((a, half_space), &turned, gap_m.lower)
    };
    poses.iter().map(moved).collect()
}

/// The poses moved along the normal to gaps and depths up to [`NEAR`], in turn.
fn brought_near((a, b): (&Model, &Model), unit_m: f64, poses: &[Pose]) -> Result<Trajectory, PoseError> {
    let moved = |(index, pose): (usize, &Pose)| {
        // Nine of them, none of which is 0.
        at_gap((a, b), pose, unit_m * NEAR * (((index * 5) % 9) as f64 - 3.5) / 4.5)
    };
    poses.iter().enumerate().map(moved).collect()
}

/// The pose moved along the normal to this gap or depth.
fn at_gap((a, b): (&Model, &Model), pose: &Pose, wanted_m: f64) -> Result<Pose, PoseError> {
    let found = a.distance(b, pose, &mut WarmStart::default());
    // The normal leads from the second to the first, and beside a half-space the first is moved.
    let way_m = if b.is_half_space() { wanted_m - found.upper_m } else { found.upper_m - wanted_m };
    let moved = pose.translation() + found.normal.unwrap_or_else(Vector3::zeros) * way_m;
    Pose::from_quaternion(moved, pose.rotation().coords.into())
}

/// The largest difference of our distances from others.
fn difference([a, b]: [&Model; 2], poses: &[Trajectory], found: &[Vec<f64>]) -> f64 {
    let ours = poses.iter().flatten().map(|pose| a.distance(b, pose, &mut WarmStart::default()).upper_m);
    let differences = ours.zip(found.iter().flatten()).map(|(x, y)| (x - y).abs());
    differences.max_by(f64::total_cmp).unwrap_or(0.0)
}

impl Parry {
    fn new([a, b]: [&Model; 2], [far, near]: [&[Trajectory]; 2]) -> Result<Self, ComparisonError> {
        let [(shape_a, frame_a), (shape_b, frame_b)] = [a.parry()?, b.parry()?];
        let relative = |poses: &[Trajectory]| {
            // Poses beside a half-space are those of the first.
            let pose = |pose: &Pose| match b.is_half_space() {
                true => (parry_pose(pose) * frame_a).inv_mul(&frame_b),
                false => frame_a.inv_mul(&(parry_pose(pose) * frame_b)),
            };
            poses.iter().map(|trajectory| trajectory.iter().map(pose).collect()).collect()
        };
        Ok(Self { shapes: [shape_a, shape_b], far: relative(far), near: relative(near) })
    }

    fn distance(&self, pose: &ParryPose) -> Answer {
        let found = query::distance(&ParryPose::IDENTITY, &*self.shapes[0], pose, &*self.shapes[1]);
        Answer { iterations: None, failed: found.is_err(), overlap: found.is_ok_and(|found| found.distance <= 0.0) }
    }

    fn overlap(&self, pose: &ParryPose) -> Answer {
        let found = query::intersection_test(&ParryPose::IDENTITY, &*self.shapes[0], pose, &*self.shapes[1]);
        Answer { iterations: None, failed: found.is_err(), overlap: found.is_ok_and(|found| found.intersecting) }
    }
}
