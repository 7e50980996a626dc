//! The methods at all their settings, asked about the same poses.

use super::cases::{Case, Query};
use super::effort::Effort;
use crate::baselines::{Clarabel, ConicProgram, Posed, between, newton, slsqp};
use crate::comparison::sweep::{Answer, Row, median};
use crate::comparison::{Coal, ComparisonError, FitCache, Hulls, PeerShape, parry_pose};
use nalgebra::Vector3;
use std::hint::black_box;
use sublevel::body::{Body, fibonacci_lattice};
use sublevel::measure::{Options, Pose, Status, WarmStart, distance};

/// Who answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Method {
    /// Ours without and with the hint of the pose before.
    Cold,
    Warm,
    /// Newton's method from where the line of centres leaves the bodies, from our witnesses of a
    /// coarse answer, and from those of the pose before.
    NewtonPlain,
    NewtonOurs,
    NewtonBefore,
    /// A general nonlinear program.
    Slsqp,
    /// Level 0 by clarabel.
    LevelZero,
    /// Hulls of boundary points.
    Parry,
    Coal,
}

/// A method at a setting.
#[derive(Clone, Debug)]
pub(super) struct Cell {
    pub(super) method: Method,
    /// A tolerance, or a number of steps or points.
    pub(super) setting: String,
    pub(super) queries: usize,
    /// Nanoseconds per query.
    pub(super) nanoseconds: f64,
    /// Mean, where they are reported.
    pub(super) iterations: Option<f64>,
    /// Median and largest, as parts of the size.
    pub(super) error: [f64; 2],
    /// Median and largest width of the bracket, where there is one, likewise.
    pub(super) width: Option<[f64; 2]>,
    /// Answers that are none, or off by more than [`OFF`] of the size.
    pub(super) off: usize,
    /// Answers that do not keep the tolerance asked for, by the method's own judgement, where it
    /// has one.
    pub(super) short: Option<usize>,
}

/// Answers that are off by as much of the size count as failures, whatever the method says of them.
pub(super) const OFF: f64 = 1e-3;

const TOLERANCES: [f64; 10] = [1e-3, 1e-4, 1e-5, 1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12];
const STEPS: [u32; 13] = [1, 2, 3, 4, 5, 6, 8, 10, 15, 20, 30, 50, 100];
/// Evaluations at most.
const SLSQP: [u32; 12] = [2, 3, 5, 8, 12, 20, 30, 50, 80, 120, 200, 1000];
const CLARABEL: [f64; 7] = [1e-3, 1e-5, 1e-6, 1e-7, 1e-8, 1e-10, 1e-12];
/// The coarsest tolerance: what our own answer to it is worth as a start.
const EARLY: f64 = 1.0;
/// Queries of a row are timed in chunks, which are short enough that other processes spoil few.
const CHUNK: usize = 20;

/// What a method says of a query, lengths in metres.
struct MethodAnswer {
    value: f64,
    width: Option<f64>,
    iterations: Option<u32>,
    /// Whether it keeps the tolerance, by its own judgement.
    kept: Option<bool>,
}

/// Measures all methods on a case.
pub(super) fn measure(
    case: &Case,
    effort: &Effort,
    cache: &FitCache,
    (solver, coal): (Option<&Clarabel>, Option<&Coal>),
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<Cell>, ComparisonError> {
    let Case { a, b, size_m, queries, .. } = case;
    let chunks: Vec<Vec<Query>> = queries.chunks(CHUNK).map(<[Query]>::to_vec).collect();
    let some: Vec<Vec<Query>> = queries[..effort.few].chunks(CHUNK).map(<[Query]>::to_vec).collect();
    let mut sampled = Vec::new();
    for &points in effort.points {
        announce(&format!("{}: hulls of {points} points", case.name))?;
        let [points_a, points_b] = [a, b].map(|body| boundary(body, points));
        sampled.push((points, Hulls::new(&points_a, &points_b)?, [points_a, points_b]));
    }
    let mut timed = Vec::new();
    for accuracy in TOLERANCES {
        let options = Options::default().with_accuracy(accuracy)?;
        for method in [Method::Cold, Method::Warm] {
            let ask = move |query: &Query| ours(a, b, query, &options, method);
            timed.push(Timed::new((method, format!("{accuracy:e}")), &chunks, *size_m, ask));
        }
    }
    let early = Options::default().with_accuracy(EARLY)?;
    for method in [Method::NewtonPlain, Method::NewtonOurs, Method::NewtonBefore] {
        for steps in STEPS {
            let ask = move |query: &Query| {
                let bodies = [Posed::new(a, &Pose::identity()), Posed::new(b, &query.pose)];
                let start = match method {
                    Method::NewtonOurs => {
                        let at = distance(a, &Pose::identity(), b, &query.pose, &early, &mut WarmStart::default());
                        [at.witness_a, at.witness_b]
                    }
                    Method::NewtonBefore => query.before,
                    _ => between(&bodies),
                };
                let value = newton(&bodies, start, steps).apart();
                MethodAnswer { value, width: None, iterations: Some(steps), kept: None }
            };
            timed.push(Timed::new((method, steps.to_string()), &chunks, *size_m, ask));
        }
    }
    for most in SLSQP {
        let ask = move |query: &Query| {
            let bodies = [Posed::new(a, &Pose::identity()), Posed::new(b, &query.pose)];
            let (value, evaluations) = slsqp(&bodies, between(&bodies), *size_m, most);
            MethodAnswer { value, width: None, iterations: Some(evaluations), kept: None }
        };
        timed.push(Timed::new((Method::Slsqp, most.to_string()), &chunks, *size_m, ask));
    }
    for (points, hulls, _) in &sampled {
        let ask = move |query: &Query| {
            let value = hulls.distance(&parry_pose(&query.pose));
            MethodAnswer { value, width: None, iterations: None, kept: None }
        };
        timed.push(Timed::new((Method::Parry, points.to_string()), &some, *size_m, ask));
    }
    for pass in 0..effort.passes {
        announce(&format!("{}: pass {} of {}", case.name, pass + 1, effort.passes))?;
        timed.iter_mut().for_each(|timed| timed.row.turn());
    }
    let mut cells: Vec<Cell> = timed.into_iter().map(Timed::finished).collect();
    if let Some(solver) = solver {
        announce(&format!("{}: semidefinite programs", case.name))?;
        let few = &queries[..effort.programs];
        let origin = Pose::identity();
        let state = |query: &Query| ConicProgram::distance([(a, &origin), (b, &query.pose)], *size_m);
        let name = format!("accuracy-{}", case.name);
        let programs = few.iter().map(state).collect();
        let answers = solver.solve((cache.folder(), &name), programs, &CLARABEL, effort.passes)?;
        for (tolerance, answers) in CLARABEL.iter().zip(answers) {
            let replies: Vec<MethodAnswer> = answers
                .iter()
                .map(|found| MethodAnswer {
                    value: found.value.unwrap_or(f64::NAN) * size_m,
                    width: None,
                    iterations: Some(found.iterations),
                    kept: Some(found.solved),
                })
                .collect();
            let mut cell = Cell::judged((Method::LevelZero, format!("{tolerance:e}")), few, &replies, *size_m);
            cell.nanoseconds = answers.iter().map(|found| found.nanoseconds).sum::<f64>() / answers.len() as f64;
            cells.push(cell);
        }
    }
    if let Some(coal) = coal {
        for (points, _, [points_a, points_b]) in &sampled {
            announce(&format!("{}: coal, {points} points", case.name))?;
            let name = format!("accuracy-{}-{points}", case.name);
            let poses: Vec<Vec<Pose>> = some.iter().map(|chunk| chunk.iter().map(|q| q.pose).collect()).collect();
            let mut run =
                coal.start(cache.folder(), &name, [PeerShape::Hull(points_a), PeerShape::Hull(points_b)], &poses)?;
            // A process takes the median of nine walks by itself.
            run.pass()?;
            let found = run.distances()?.concat();
            let replies: Vec<MethodAnswer> =
                found.iter().map(|&value| MethodAnswer { value, width: None, iterations: None, kept: None }).collect();
            let mut cell = Cell::judged((Method::Coal, points.to_string()), &queries[..effort.few], &replies, *size_m);
            cell.nanoseconds = run.times().0;
            cells.push(cell);
        }
    }
    Ok(cells)
}

fn ours(a: &Body, b: &Body, query: &Query, options: &Options<'_>, method: Method) -> MethodAnswer {
    let mut hint = if method == Method::Warm { query.hint } else { WarmStart::default() };
    let found = distance(a, &Pose::identity(), b, &query.pose, options, &mut hint);
    MethodAnswer {
        value: found.value(),
        width: Some(found.upper - found.lower),
        iterations: Some(found.iterations),
        kept: Some(found.status == Status::Converged),
    }
}

/// So many boundary points in directions that are evenly spread in the normalized frame.
fn boundary(body: &Body, points: usize) -> Vec<Vector3<f64>> {
    fibonacci_lattice(points).map(|direction| body.boundary_along(&direction)).collect()
}

/// A cell that is being timed.
struct Timed<'a> {
    cell: Cell,
    row: Row<'a>,
}

impl<'a> Timed<'a> {
    fn new(
        what: (Method, String),
        chunks: &'a [Vec<Query>],
        size_m: f64,
        ask: impl Fn(&Query) -> MethodAnswer + 'a,
    ) -> Self {
        let queries: Vec<Query> = chunks.iter().flatten().cloned().collect();
        let replies: Vec<MethodAnswer> = queries.iter().map(&ask).collect();
        let cell = Cell::judged(what, &queries, &replies, size_m);
        let row = Row::cold("", chunks, move |query: &Query| {
            let reply = black_box(ask(query));
            Answer { iterations: reply.iterations, failed: false, overlap: false }
        });
        Self { cell, row }
    }

    fn finished(self) -> Cell {
        Cell { nanoseconds: self.row.nanoseconds(), ..self.cell }
    }
}

impl Cell {
    /// All but the time.
    fn judged((method, setting): (Method, String), queries: &[Query], replies: &[MethodAnswer], size_m: f64) -> Self {
        // Below half of the reference's bracket no error can be known.
        let error = |(query, reply): (&Query, &MethodAnswer)| {
            let error = (reply.value - query.truth).abs().max(query.half_width) / size_m;
            if error.is_finite() { error } else { f64::INFINITY }
        };
        let errors: Vec<f64> = queries.iter().zip(replies).map(error).collect();
        let both = |values: &[f64]| [median(values), values.iter().copied().fold(0.0, f64::max)];
        let widths: Option<Vec<f64>> = replies.iter().map(|reply| Some(reply.width? / size_m)).collect();
        let counts: Option<Vec<f64>> = replies.iter().map(|reply| reply.iterations.map(f64::from)).collect();
        let kept: Option<Vec<bool>> = replies.iter().map(|reply| reply.kept).collect();
        Self {
            method,
            setting,
            queries: replies.len(),
            nanoseconds: f64::NAN,
            iterations: counts.map(|counts| counts.iter().sum::<f64>() / counts.len() as f64),
            error: both(&errors),
            width: widths.as_deref().map(both),
            off: errors.iter().filter(|error| !(**error <= OFF)).count(),
            short: kept.map(|kept| kept.iter().filter(|kept| !**kept).count()),
        }
    }
}
