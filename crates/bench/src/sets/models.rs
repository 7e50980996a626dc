//! Models of objects that are not convex: how far their distances from probes are off, against the
//! time of a query.

use crate::comparison::{ComparisonError, FitCache, PeerShape, Random, Subject};
use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Vector};
use parry3d_f64::query::PointQuery;
use parry3d_f64::shape::{SharedShape, TriMesh};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use sublevel::body::{Body, Shape, SosBody, SosMethod};
use sublevel::branch_and_bound::{BranchAndBound, Limits, PlacedSet};
use sublevel::fit::{Coordinates, FitOptions, Objective, SosOptions, fit_parts, fit_sos};
use sublevel::measure::{Options, Pose, WarmStart, distance};

/// The objects, and how many of them a quick run measures.
const OBJECTS: [&str; 5] = ["mug", "wingnut", "octopus", "chair", "hand"];
const QUICK: usize = 2;

/// Probes of an object, and of a quick run.
const PROBES: (usize, usize) = (200, 40);

/// Radius of the probes, and their least and largest distance from the object, in its diameters.
const RADIUS: f64 = 0.02;
const NEAR: (f64, f64) = (0.01, 0.3);

/// Numbers of parts of compounds, all of degree 4.
const PARTS: [usize; 4] = [2, 4, 8, 16];

/// Accuracy of all queries, relative to the probe.
const ACCURACY: f64 = 1e-2;

/// Kinds of models as rows name them.
pub(super) const KINDS: [&str; 4] = ["convex body", "compound", "sos-body", "hull"];

/// A model of an object, measured.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Model {
    pub(super) object: String,
    pub(super) kind: String,
    /// Degree, or parts, or what makes it not convex.
    pub(super) name: String,
    /// Mean error of the distance of a probe, in diameters of the object.
    pub(super) error: f64,
    /// Share of the probes that touch the model and not the object.
    pub(super) false_contacts: f64,
    /// Median time of a query, seconds, without a warm start.
    pub(super) seconds: f64,
}

/// What answers.
enum Answering {
    Solid(Shape),
    Set(Box<SosBody>),
    /// The convex hull, whose distances parry computes.
    Hull(SharedShape),
}

/// Measures all models of all objects.
///
/// # Errors
/// [`ComparisonError`].
pub(super) fn models(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<Model>, ComparisonError> {
    let mut all = Vec::new();
    for name in &OBJECTS[..if quick { QUICK } else { OBJECTS.len() }] {
        let subject = Subject::read(name, data)?;
        let probes = probes(&subject, if quick { PROBES.1 } else { PROBES.0 })?;
        for (kind, model, answering) in made(&subject, cache, announce)? {
            announce(&format!("{name}: {kind}, {model}"))?;
            all.push(measured(&subject, kind, model, &answering, &probes)?);
        }
    }
    Ok(all)
}

/// Every model of an object that can be made.
fn made(
    subject: &Subject,
    cache: &FitCache,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Vec<(&'static str, String, Answering)>, ComparisonError> {
    let (hull, _) = PeerShape::Hull(&subject.mesh.points).parry()?;
    let mut models = vec![(KINDS[3], "parry".to_owned(), Answering::Hull(hull))];
    for degree in [4, 6] {
        announce(&format!("{}: degree {degree}", subject.name))?;
        let options = FitOptions { degree, ..FitOptions::default() };
        let body = cache.body(subject.name, &subject.mesh, &options)?;
        models.push((KINDS[0], format!("degree {degree}"), Answering::Solid(Shape::Body(Box::new(body)))));
    }
    let options = FitOptions { degree: 4, ..FitOptions::default() };
    for parts in PARTS {
        announce(&format!("{}: {parts} parts", subject.name))?;
        let what = format!("{}-d4-p{parts}", subject.name);
        let shape = cache.take(&what, &subject.mesh, &format!("{options:?} {parts}"), || {
            let made = fit_parts(subject.name, &subject.mesh, parts, &options, &mut |_| ControlFlow::Continue(()))?;
            Ok(Shape::Compound(Box::new(made.compound)))
        })?;
        models.push((KINDS[1], format!("{parts} parts"), Answering::Solid(shape)));
    }
    let relaxed = SosMethod::Relaxed { c: 10.0, objective: Objective::default() };
    for (degree, method, name) in [
        (4, SosMethod::InverseMoment, "inverse moment degree 4"),
        (6, SosMethod::InverseMoment, "inverse moment degree 6"),
        (8, SosMethod::InverseMoment, "inverse moment degree 8"),
        (4, relaxed, "c = 10 degree 4"),
        (6, relaxed, "c = 10 degree 6"),
    ] {
        announce(&format!("{}: {name}", subject.name))?;
        let options =
            SosOptions { degree, method, coordinates: Coordinates::default(), solver: None, input: String::new() };
        // A set that cannot be proven is none that could be used.
        let made = fit_sos(subject.name, &subject.mesh.points, &[], &options, &mut |_| ControlFlow::Continue(()));
        if let Ok(made) = made {
            models.push((KINDS[2], name.to_owned(), Answering::Set(Box::new(made.body))));
        }
    }
    Ok(models)
}

/// Centres of balls near the object with their distances from it, metres.
fn probes(subject: &Subject, count: usize) -> Result<Vec<(Vector3<f64>, f64)>, ComparisonError> {
    let points = subject.mesh.points.iter().map(|x| Vector::new(x.x, x.y, x.z)).collect();
    let indices = subject.mesh.triangles.iter().map(|triangle| triangle.map(|corner| corner as u32)).collect();
    let surface = TriMesh::new(points, indices)
        .map_err(|error| ComparisonError::ParryMesh { mesh: subject.name, what: error.to_string() })?;
    let corner = |pick: fn(f64, f64) -> f64| {
        subject.mesh.points.iter().copied().reduce(|a, b| a.zip_map(&b, pick)).unwrap_or_default()
    };
    let (min, max) = (corner(f64::min), corner(f64::max));
    let reach = NEAR.1 * subject.diameter_m;
    let mut random = Random(11);
    let mut probes = Vec::new();
    while probes.len() < count {
        let x = Vector3::from_fn(|k, _| min[k] - reach + (max[k] - min[k] + 2.0 * reach) * random.positive());
        let away = surface.distance_to_point(&ParryPose::IDENTITY, Vector::new(x.x, x.y, x.z), false).abs();
        let gap = away - RADIUS * subject.diameter_m;
        if (NEAR.0 * subject.diameter_m..reach).contains(&gap) {
            probes.push((x, gap));
        }
    }
    Ok(probes)
}

fn measured(
    subject: &Subject,
    kind: &str,
    name: String,
    answering: &Answering,
    probes: &[(Vector3<f64>, f64)],
) -> Result<Model, ComparisonError> {
    let radius = RADIUS * subject.diameter_m;
    let failed = |what: String| ComparisonError::Representation { mesh: subject.name, method: name.clone(), what };
    let ball = Body::ball("probe", Vector3::zeros(), radius).map_err(|error| failed(error.to_string()))?;
    let options = Options::default().with_accuracy(ACCURACY)?;
    let limits = Limits { accuracy: 0.0, width: ACCURACY * radius, ..Limits::default() };
    let mut branches = BranchAndBound::new();
    let (mut errors, mut contacts, mut times) = (0.0, 0, Vec::new());
    for (center, truth) in probes {
        let pose = Pose::from_quaternion(*center, [0.0, 0.0, 0.0, 1.0])?;
        let start = Instant::now();
        let upper = match answering {
            Answering::Solid(shape) => {
                distance(shape, &Pose::identity(), &ball, &pose, &options, &mut WarmStart::default()).upper
            }
            Answering::Set(body) => {
                let sets = [PlacedSet::new(&**body, Pose::identity()), PlacedSet::new(&ball, pose)];
                let found = branches.distance(&sets[0], &sets[1], &limits);
                found.map_err(|(_, error)| failed(error.to_string()))?.upper_m
            }
            Answering::Hull(hull) => {
                let center = Vector::new(center.x, center.y, center.z);
                (hull.distance_to_point(&ParryPose::IDENTITY, center, true) - radius).max(0.0)
            }
        };
        times.push(start.elapsed().as_secs_f64());
        errors += (upper - truth).abs() / subject.diameter_m;
        contacts += usize::from(upper <= 0.0);
    }
    times.sort_by(f64::total_cmp);
    Ok(Model {
        object: subject.name.to_owned(),
        kind: kind.to_owned(),
        name,
        error: errors / probes.len() as f64,
        false_contacts: contacts as f64 / probes.len() as f64,
        seconds: times[times.len() / 2],
    })
}
