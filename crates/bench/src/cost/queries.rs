//! Queries against degree, constraints, parts, and poses in a batch.

use super::effort::Effort;
use super::growth::{self, Growth, Line, Unit};
use super::memory::bytes_of;
use crate::comparison::motion::{self, Trajectory};
use crate::comparison::sweep::{Answer, Row};
use crate::comparison::{ComparisonError, FitCache, Subject};
use std::ops::ControlFlow;
use sublevel::body::{Body, Shape, Solid};
use sublevel::fit::{FitOptions, MAX_SLABS, fit_parts};
use sublevel::measure::{Distance, Options, Pose, WarmStart, distance, distance_batch};

/// From pose to pose, in units of half of the larger diameter.
const STEP: f64 = 0.01;
/// Of bodies with slabs and of compounds.
const DEGREE: usize = 4;
/// Of what the batch is about.
const BATCH_DEGREE: usize = 6;

type Announce<'a> = &'a mut dyn FnMut(&str) -> Result<(), ComparisonError>;

/// Against the degree of both bodies.
pub(super) fn degrees(
    pair: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    announce: Announce<'_>,
) -> Result<Growth, ComparisonError> {
    let mut shapes = Vec::new();
    for &degree in effort.degrees {
        announce(&format!("degree {degree}"))?;
        let options = FitOptions { degree, ..FitOptions::default() };
        let body = |subject: &Subject| Ok::<_, ComparisonError>(cache.body(subject.name, &subject.mesh, &options)?);
        shapes.push((degree, boxed(body(pair[0])?), boxed(body(pair[1])?)));
    }
    let lines = against(pair, &shapes, effort)?;
    Ok(Growth {
        axis: growth::DEGREE,
        what: format!("{} and {}, one constraint each.", pair[0].name, pair[1].name),
        lines,
    })
}

/// Against the number of constraints of the first body.
pub(super) fn constraints(
    pair: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    announce: Announce<'_>,
) -> Result<Growth, ComparisonError> {
    let mut shapes = Vec::new();
    let plain = FitOptions { degree: DEGREE, ..FitOptions::default() };
    let other = boxed(cache.body(pair[1].name, &pair[1].mesh, &plain)?);
    for &slabs in effort.slabs {
        announce(&format!("{slabs} slabs"))?;
        let options = FitOptions { slabs: slabs.min(MAX_SLABS), ..plain.clone() };
        let body = cache.body(pair[0].name, &pair[0].mesh, &options)?;
        shapes.push((body.constraints().len(), boxed(body), other.clone()));
    }
    let lines = against(pair, &shapes, effort)?;
    Ok(Growth {
        axis: growth::CONSTRAINTS,
        what: format!(
            "{} of degree {DEGREE}, cut by slabs, each a constraint of degree 2; {} has one constraint.",
            pair[0].name, pair[1].name
        ),
        lines,
    })
}

/// Against the number of parts of the first solid.
pub(super) fn parts(
    pair: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    announce: Announce<'_>,
) -> Result<Growth, ComparisonError> {
    let mut shapes: Vec<(usize, Shape, Shape)> = Vec::new();
    let options = FitOptions { degree: DEGREE, ..FitOptions::default() };
    let other = boxed(cache.body(pair[1].name, &pair[1].mesh, &options)?);
    let Subject { name, mesh, .. } = pair[0];
    for &count in effort.parts {
        announce(&format!("{count} parts"))?;
        // The name and the key of the figure of speed: both share their fits.
        let key = format!("{count} parts {options:?}");
        let shape = cache.take(&format!("{name}-d{DEGREE}-p{count}"), mesh, &key, || {
            let made = fit_parts(name, mesh, count, &options, &mut |_| ControlFlow::Continue(()))?;
            Ok(Shape::Compound(Box::new(made.compound)))
        })?;
        // A mesh may be convex enough in fewer.
        if shapes.last().is_none_or(|(before, ..)| *before < shape.parts().len()) {
            shapes.push((shape.parts().len(), shape, other.clone()));
        }
    }
    let lines = against(pair, &shapes, effort)?;
    Ok(Growth {
        axis: growth::PARTS,
        what: format!("{name} in parts of degree {DEGREE}; {} is one body.", pair[1].name),
        lines,
    })
}

/// Against the number of poses of a batch.
pub(super) fn batches(
    pair: [&Subject; 2],
    effort: &Effort,
    cache: &FitCache,
    announce: Announce<'_>,
) -> Result<Growth, ComparisonError> {
    announce("batches")?;
    let options = FitOptions { degree: BATCH_DEGREE, ..FitOptions::default() };
    let body = |subject: &Subject| Ok::<_, ComparisonError>(cache.body(subject.name, &subject.mesh, &options)?);
    let (a, b) = (body(pair[0])?, body(pair[1])?);
    let most = effort.batches.iter().copied().max().unwrap_or(1);
    let poses = motion::stepping((&a, &b), unit_m(pair), Some(STEP), 1, most)?;
    let origin = Pose::identity();
    let mut rows: Vec<(usize, Row<'_>)> = effort
        .batches
        .iter()
        .map(|&size| {
            let batch = |poses: &[Pose], answers: &mut [Distance]| {
                // There are poses, and as many places.
                let _ = distance_batch(&a, &origin, &b, poses, &Options::default(), answers);
            };
            (size, Row::batches("", &poses, size, batch, judge))
        })
        .collect();
    for _ in 0..effort.passes {
        rows.iter_mut().for_each(|(_, row)| row.turn());
    }
    let mut whole = Line::new("a batch", Unit::Nanoseconds);
    let mut each = Line::new("a pose of it", Unit::Nanoseconds);
    let mut places = Line::new("poses and answers", Unit::Bytes);
    for (size, row) in &rows {
        let count = *size as f64;
        whole.points.push((count, count * row.nanoseconds()));
        each.points.push((count, row.nanoseconds()));
        places.points.push((count, count * (size_of::<Pose>() + size_of::<Distance>()) as f64));
    }
    Ok(Growth {
        axis: growth::BATCH,
        what: format!(
            "{} and {} of degree {BATCH_DEGREE}. A pose takes {} bytes and an answer {}, both in places of the caller; a batch allocates nothing.",
            pair[0].name,
            pair[1].name,
            size_of::<Pose>(),
            size_of::<Distance>()
        ),
        lines: vec![whole, each, places],
    })
}

fn boxed(body: Body) -> Shape {
    Shape::Body(Box::new(body))
}

fn unit_m([a, b]: [&Subject; 2]) -> f64 {
    0.5 * a.diameter_m.max(b.diameter_m)
}

/// Cold and warm queries, in the same poses for all sizes: those of the first, which are the
/// widest.
fn against(
    pair: [&Subject; 2],
    shapes: &[(usize, Shape, Shape)],
    effort: &Effort,
) -> Result<Vec<Line>, ComparisonError> {
    let Some((_, wide_a, wide_b)) = shapes.first() else { return Ok(Vec::new()) };
    let poses = motion::stepping((wide_a, wide_b), unit_m(pair), Some(STEP), effort.trajectories, effort.poses)?;
    let mut rows: Vec<[Row<'_>; 2]> = shapes.iter().map(|(_, a, b)| timed(a, b, &poses)).collect();
    for _ in 0..effort.passes {
        rows.iter_mut().flatten().for_each(Row::turn);
    }
    let mut cold = Line::new("cold", Unit::Nanoseconds);
    let mut warm = Line::new("warm", Unit::Nanoseconds);
    let mut memory = Line::new("in memory", Unit::Bytes);
    let mut file = Line::new("as a file", Unit::Bytes);
    for ((size, a, _), [of_cold, of_warm]) in shapes.iter().zip(&rows) {
        let size = *size as f64;
        cold.points.push((size, of_cold.nanoseconds()));
        warm.points.push((size, of_warm.nanoseconds()));
        let text = match a {
            Shape::Body(body) => body.to_json(),
            Shape::Compound(compound) => compound.to_json(),
        };
        memory.points.extend(bytes_of(a, a.parts().len()).map(|bytes| (size, bytes)));
        file.points.push((size, text.len() as f64));
    }
    Ok(vec![cold, warm, memory, file])
}

fn judge(found: &Distance) -> Answer {
    Answer::new(found.iterations, found.status, found.upper <= 0.0)
}

fn timed<'a>(a: &'a Shape, b: &'a Shape, poses: &'a [Trajectory]) -> [Row<'a>; 2] {
    let query = move |pose: &Pose, hint: &mut WarmStart| {
        judge(&distance(a, &Pose::identity(), b, pose, &Options::default(), hint))
    };
    [Row::cold("cold", poses, move |pose| query(pose, &mut WarmStart::default())), Row::warm("warm", poses, query)]
}
