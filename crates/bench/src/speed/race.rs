//! One pair: everybody walks the same poses, in turns.

use super::effort::Effort;
use super::meshes::Meshes;
use super::ours::{Method, Models};
use super::peers::{HullPair, Simple, hulls, judged};
use crate::comparison::ComparisonError;
use crate::comparison::Subject;
use crate::comparison::sweep::{Answer, Row};
use crate::comparison::{Coal, FitCache, PeerShape, motion, parry_pose};
use parry3d_f64::math::Pose as ParryPose;
use sublevel::body::Shape;
use sublevel::measure::{
    Capsule, Distance, Options, Pose, PoseError, WarmStart, distance, distance_batch, distance_of_capsules,
    signed_distance,
};

/// What is raced.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Who {
    /// One of ours.
    Ours(Method),
    /// Parry's ball, a formula.
    ParryBall,
    /// Parry's box.
    ParryBox,
    /// Parry's GJK on hulls of at most this many vertices, or exact ones.
    ParryHull(Option<usize>),
    /// Coal's.
    CoalHull(Option<usize>),
    /// Parry's meshes.
    ParryMesh,
}

/// Truth minus answer relative to the larger diameter, over all poses.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ModelError {
    pub(super) mean: f64,
    /// The largest of any sign.
    pub(super) most: f64,
    /// The least; below 0 where the truth is nearer than the answer.
    pub(super) least: f64,
}

/// A representation and method with all that was measured of it.
#[derive(Clone, Debug)]
pub(super) struct Line {
    pub(super) who: Who,
    /// Against the convex hulls.
    pub(super) hull: ModelError,
    /// Against the meshes.
    pub(super) mesh: ModelError,
    /// Nanoseconds per query without, with a hint from the pose before, and in a batch; NaN where
    /// there is no such form.
    pub(super) cold: f64,
    pub(super) warm: f64,
    pub(super) batch: f64,
    /// Queries of the cold form that did not converge, and those that found overlap.
    pub(super) failed: usize,
    pub(super) overlaps: usize,
    /// Answers of any form whose bracket does not hold the truth: cold, warm and batch apart from
    /// each other, or the object nearer than proven.
    pub(super) contradictions: usize,
}

/// A pair and its lines.
#[derive(Clone, Debug)]
pub(super) struct Race {
    pub(super) name: String,
    pub(super) diameter_m: f64,
    pub(super) queries: usize,
    pub(super) lines: Vec<Line>,
}

/// What the CSV does not have of a pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct About {
    pub(super) hull_vertices: [usize; 2],
    pub(super) triangles: [usize; 2],
    /// Least, median and largest distance of the hulls, metres.
    pub(super) distances_m: [f64; 3],
}

/// Distances may contradict each other by as much, relative to the larger diameter: what parry's
/// GJK is good for.
const AGREEMENT: f64 = 1e-7;
/// Most poses of a batch.
const BATCH: usize = 1024;

/// One of ours with its two shapes.
struct Ours {
    method: Method,
    forms: Forms,
}

/// Two shapes of a kind.
enum Forms {
    Shapes([Shape; 2]),
    /// With the frame of the first and the poses of the second in that of its object.
    Capsules {
        capsules: [Capsule; 2],
        frame: Pose,
        poses: Vec<Vec<Pose>>,
    },
}

/// Races a pair.
pub(super) fn race(
    [a, b]: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    coal: Option<&Coal>,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<(Race, About), ComparisonError> {
    let name = format!("{}-{}", a.name, b.name);
    let diameter_m = a.diameter_m.max(b.diameter_m);
    let mut models = Vec::new();
    for method in Method::all(effort.quick) {
        announce(&format!("{name}: {}", method.name()))?;
        models.push((method, method.build([a, b], cache)?));
    }
    announce(&format!("{name}: poses"))?;
    let apart = models.iter().filter(|(method, _)| matches!(method, Method::Body { refine: false, .. }));
    let apart: Vec<(&Shape, &Shape)> = apart.filter_map(|(_, models)| models.shapes()).collect();
    let poses = motion::separated(&apart, 0.5 * diameter_m, effort.trajectories, effort.poses)?;
    let ours = models.into_iter().map(|(method, models)| Ok(Ours { method, forms: Forms::new(models, &poses)? }));
    let ours = ours.collect::<Result<Vec<Ours>, ComparisonError>>()?;
    let parry_poses: Vec<Vec<ParryPose>> = poses.iter().map(|t| t.iter().map(parry_pose).collect()).collect();
    announce(&format!("{name}: exact distances"))?;
    let hulls = hulls(a, b, effort.quick)?;
    let meshes = Meshes::new([a, b])?;
    let simple = Simple::new(a, b, &poses);
    let walk = |of: &dyn Fn(&ParryPose) -> f64| -> Vec<f64> { parry_poses.iter().flatten().map(of).collect() };
    let truth = [walk(&|pose| hulls[0].parry.distance(pose)), walk(&|pose| meshes.distance(pose))];
    let error = |answers: &[f64]| [0, 1].map(|k| ModelError::new(&truth[k], answers, diameter_m));

    let mut lines = Vec::new();
    for one in &ours {
        announce(&format!("{name}: error of {}", one.method.name()))?;
        lines.push(one.line(&poses, &truth, diameter_m));
    }
    let same_as = |method: Method, lines: &[Line]| {
        let line = lines.iter().find(|line| line.who == Who::Ours(method));
        line.map_or([ModelError::NONE; 2], |line| [line.hull, line.mesh])
    };
    lines.push(Line::of(Who::ParryBall, same_as(Method::Ball, &lines)));
    lines.push(Line::of(Who::ParryBox, same_as(Method::OrientedBox, &lines)));
    for pair in &hulls {
        let [hull, mesh] = error(&walk(&|pose| pair.parry.distance(pose)));
        let hull = if pair.count.is_none() { ModelError::NONE } else { hull };
        lines.push(Line::of(Who::ParryHull(pair.count), [hull, mesh]));
        if coal.is_some() {
            lines.push(Line::of(Who::CoalHull(pair.count), [hull, mesh]));
        }
    }
    lines.push(Line::of(Who::ParryMesh, [error(&truth[1])[0], ModelError::NONE]));

    let every = (parry_poses.iter().map(Vec::len).sum::<usize>() / effort.slow_poses).max(1);
    let few: Vec<Vec<ParryPose>> = parry_poses.iter().map(|t| t.iter().step_by(every).copied().collect()).collect();
    let mut rows = Rows { rows: Vec::new() };
    ours.iter().for_each(|one| rows.ours(one, &poses));
    rows.peers(&hulls, &simple, &parry_poses);
    rows.meshes(&meshes, &few);
    let mut runs = Vec::new();
    for pair in hulls.iter().filter(|_| coal.is_some()) {
        let of = pair.count.map_or("exact".to_owned(), |count| count.to_string());
        let vertices = pair.vertices.each_ref().map(|vertices| PeerShape::Hull(vertices));
        let run =
            coal.map(|coal| coal.start(cache.folder(), &format!("speed-{name}-{of}"), vertices, &poses)).transpose()?;
        runs.extend(run.map(|run| (Who::CoalHull(pair.count), run)));
    }
    for pass in 0..effort.passes {
        announce(&format!("{name}: pass {} of {}", pass + 1, effort.passes))?;
        for (_, run) in &mut runs {
            run.pass()?;
        }
        for (who, _, row) in &mut rows.rows {
            match who {
                Who::ParryMesh if pass < effort.slow_passes => row.pass(),
                Who::ParryMesh => {}
                _ => row.turn(),
            }
        }
    }
    for line in &mut lines {
        rows.fill(line);
        if let Some((_, run)) = runs.iter().find(|(who, _)| *who == line.who) {
            (line.cold, line.warm) = run.times();
            let Who::CoalHull(count) = line.who else { continue };
            let Some(pair) = hulls.iter().find(|pair| pair.count == count) else { continue };
            let expected = walk(&|pose| pair.parry.distance(pose));
            let found: Vec<f64> = run.distances()?.concat();
            let differ = |(x, y): (&f64, &f64)| !((x - y).abs() <= COAL_AGREEMENT * diameter_m);
            line.contradictions = found.iter().zip(&expected).filter(|&pair| differ(pair)).count();
        }
    }
    let mut sorted = truth[0].clone();
    sorted.sort_by(f64::total_cmp);
    let distances_m = [0, sorted.len() / 2, sorted.len() - 1].map(|i| sorted[i]);
    let (hull_vertices, triangles) = ([a, b].map(|s| s.hull.len()), [a, b].map(|s| s.mesh.triangles.len()));
    Ok((Race { name, diameter_m, queries: sorted.len(), lines }, About { hull_vertices, triangles, distances_m }))
}

/// Coal's own tolerance is 1e-6 m; ten times that, for objects of a metre.
const COAL_AGREEMENT: f64 = 1e-5;

impl ModelError {
    /// Of what is the truth.
    const NONE: Self = Self { mean: 0.0, most: 0.0, least: 0.0 };

    fn new(truth: &[f64], answers: &[f64], diameter_m: f64) -> Self {
        let errors = || truth.iter().zip(answers).map(|(truth, answer)| (truth - answer) / diameter_m);
        Self {
            mean: errors().sum::<f64>() / truth.len() as f64,
            most: errors().max_by(|a, b| a.abs().total_cmp(&b.abs())).unwrap_or(f64::NAN),
            least: errors().fold(f64::INFINITY, f64::min),
        }
    }
}

impl Line {
    fn of(who: Who, [hull, mesh]: [ModelError; 2]) -> Self {
        let none = f64::NAN;
        Self { who, hull, mesh, cold: none, warm: none, batch: none, failed: 0, overlaps: 0, contradictions: 0 }
    }
}

impl Ours {
    /// All but the times: what it answers in each form, compared with the truth.
    fn line(&self, poses: &[Vec<Pose>], truth: &[Vec<f64>; 2], diameter_m: f64) -> Line {
        let answers = match &self.forms {
            Forms::Shapes(shapes) => answers_of_shapes(shapes, poses),
            Forms::Capsules { capsules: [a, b], frame, poses } => {
                let of = |pose| distance_of_capsules(a, frame, b, pose, &Options::default());
                let answers = poses.iter().flatten().map(of);
                // Brackets of signed distances, all the same in each form.
                answers.map(|found| (found.value(), [found.lower, found.upper.max(0.0)])).collect()
            }
        };
        let of = &truth[usize::from(!self.method.holds_hull())];
        let is_wrong =
            |([lower, upper], truth): ([f64; 2], &f64)| lower > upper || lower > truth + AGREEMENT * diameter_m;
        let wrong = answers.iter().map(|answer| answer.1).zip(of).filter(|found| is_wrong(*found)).count();
        let values: Vec<f64> = answers.iter().map(|answer| answer.0).collect();
        let errors = [0, 1].map(|k| ModelError::new(&truth[k], &values, diameter_m));
        Line { contradictions: wrong, ..Line::of(Who::Ours(self.method), errors) }
    }
}

/// The distance of each pose, minus its depth in overlap, and what all forms of the query prove of
/// it.
fn answers_of_shapes([a, b]: &[Shape; 2], poses: &[Vec<Pose>]) -> Vec<(f64, [f64; 2])> {
    let (origin, options) = (Pose::identity(), Options::default());
    let mut answers = Vec::new();
    for trajectory in poses {
        let mut hint = WarmStart::default();
        let mut batch = vec![Distance::default(); trajectory.len()];
        // There are poses, and as many places.
        let _ = distance_batch(a, &origin, b, trajectory, &options, &mut batch);
        for (pose, batched) in trajectory.iter().zip(batch) {
            let cold = distance(a, &origin, b, pose, &options, &mut WarmStart::default());
            let warm = distance(a, &origin, b, pose, &options, &mut hint);
            // In overlap the depth says how far off it is.
            let value = if cold.upper <= 0.0 {
                signed_distance(a, &origin, b, pose, &options, &mut WarmStart::default()).value()
            } else {
                cold.value()
            };
            let all = [cold, warm, batched];
            let lower = all.iter().map(|d| d.lower).fold(0.0, f64::max);
            let upper = all.iter().map(|d| d.upper).fold(f64::INFINITY, f64::min);
            answers.push((value, [lower, upper]));
        }
    }
    answers
}

impl Forms {
    fn new(models: Models, poses: &[Vec<Pose>]) -> Result<Self, PoseError> {
        match models {
            Models::Shapes(shapes) => Ok(Self::Shapes(shapes)),
            Models::Capsules([(a, frame), (b, frame_b)]) => {
                let placed = |pose: &Pose| {
                    let rotation = pose.rotation() * frame_b.rotation();
                    Pose::from_quaternion(pose.transform_point(frame_b.translation()), rotation.coords.into())
                };
                let poses = poses.iter().map(|trajectory| trajectory.iter().map(placed).collect());
                Ok(Self::Capsules { capsules: [a, b], frame, poses: poses.collect::<Result<_, _>>()? })
            }
        }
    }
}

/// How a query is asked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Form {
    Cold,
    Warm,
    Batch,
}

/// What is timed in this process.
struct Rows<'a> {
    rows: Vec<(Who, Form, Row<'a>)>,
}

impl<'a> Rows<'a> {
    fn ours(&mut self, one: &'a Ours, poses: &'a [Vec<Pose>]) {
        match &one.forms {
            Forms::Shapes(shapes) => self.shapes(one.method, shapes, poses),
            Forms::Capsules { capsules: [a, b], frame, poses } => {
                let query = move |pose: &Pose| {
                    let found = distance_of_capsules(a, frame, b, pose, &Options::default());
                    Answer::new(found.iterations, found.status, found.upper <= 0.0)
                };
                // A formula, which takes no hint.
                for form in [Form::Cold, Form::Warm] {
                    self.rows.push((Who::Ours(one.method), form, Row::cold(one.method.name(), poses, query)));
                }
            }
        }
    }

    fn shapes(&mut self, method: Method, [a, b]: &'a [Shape; 2], poses: &'a [Vec<Pose>]) {
        let judge = |found: &Distance| Answer::new(found.iterations, found.status, found.upper <= 0.0);
        let cold = Row::cold(method.name(), poses, move |pose| {
            judge(&distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default()))
        });
        let warm = Row::warm(method.name(), poses, move |pose, hint| {
            judge(&distance(a, &Pose::identity(), b, pose, &Options::default(), hint))
        });
        self.rows.extend([(Who::Ours(method), Form::Cold, cold), (Who::Ours(method), Form::Warm, warm)]);
        // All others are solved one by one.
        if matches!(method, Method::Ball | Method::Body { .. }) {
            let options = Options::default();
            let batch = move |poses: &[Pose], answers: &mut [Distance]| {
                // There are poses, and as many places.
                let _ = distance_batch(a, &Pose::identity(), b, poses, &options, answers);
            };
            let row = Row::batches(method.name(), poses, BATCH, batch, judge);
            self.rows.push((Who::Ours(method), Form::Batch, row));
        }
    }

    fn peers(&mut self, hulls: &'a [HullPair], simple: &'a Simple, poses: &'a [Vec<ParryPose>]) {
        for HullPair { count, parry, .. } in hulls {
            let who = Who::ParryHull(*count);
            // The exact hulls are known to be apart; simpler ones may overlap.
            let judge = move |found: Answer| Answer { failed: found.failed && count.is_none(), ..found };
            let cold = Row::cold("hull", poses, move |pose| judge(parry.cold(pose)));
            let warm = Row::warm("hull", poses, move |pose, kept| judge(parry.warm(pose, kept)));
            self.rows.extend([(who, Form::Cold, cold), (who, Form::Warm, warm)]);
        }
        let mut cold = |who, row| self.rows.push((who, Form::Cold, row));
        cold(Who::ParryBall, Row::cold("ball", &simple.ball_poses, move |pose| simple.ball(pose)));
        cold(Who::ParryBox, Row::cold("box", &simple.box_poses, move |pose| simple.cuboid(pose)));
    }

    fn meshes(&mut self, meshes: &'a Meshes, poses: &'a [Vec<ParryPose>]) {
        let row = Row::cold("mesh", poses, move |pose| judged(meshes.parry_distance(pose)));
        self.rows.push((Who::ParryMesh, Form::Cold, row));
    }

    /// Writes the times of a line.
    fn fill(&self, line: &mut Line) {
        for (_, form, row) in self.rows.iter().filter(|(who, ..)| *who == line.who) {
            match form {
                Form::Cold => {
                    line.cold = row.nanoseconds();
                    (line.failed, line.overlaps) = (row.tally.failed, row.tally.overlaps);
                }
                Form::Warm => line.warm = row.nanoseconds(),
                Form::Batch => line.batch = row.nanoseconds(),
            }
        }
    }
}
