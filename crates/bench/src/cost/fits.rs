//! Fits against degree and number of points.

use super::effort::Effort;
use super::growth::{self, Growth, Line, Unit};
use super::memory::peak;
use crate::comparison::sweep::median;
use crate::comparison::{ComparisonError, FitCacheError, Random, Subject, points_text};
use nalgebra::Vector3;
use std::fs;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use sublevel::body::Body;
use sublevel::fit::{FitOptions, Mesh, fit};

/// Of fits against the number of points.
const DEGREE: usize = 6;
/// Fits are repeated up to this number of points; those of more take long enough to be timed once.
const REPEATED: usize = 3_000;

/// Points that are all vertices of their hull are fitted up to this number: a million would take
/// minutes.
const MOST_ON_HULL: usize = 100_000;

/// What fits are made of and measured with.
pub(super) struct Fitting<'a> {
    /// `sublevel`, whose memory is looked at in a process of its own; without it memory is not
    /// reported.
    pub(super) program: Option<&'a Path>,
    /// For its files.
    pub(super) folder: &'a Path,
}

/// Against the degree.
pub(super) fn degrees(
    subject: &Subject,
    effort: &Effort,
    fitting: &Fitting<'_>,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Growth, ComparisonError> {
    let mut lines = [Line::new("fit", Unit::Nanoseconds), Line::new("peak of the process", Unit::Bytes)];
    for &degree in effort.degrees {
        announce(&format!("fit of degree {degree}"))?;
        fitting.measure((&subject.mesh.points, degree), effort.passes, degree as f64, &mut lines)?;
    }
    let lines = lines.into_iter().filter(|line| !line.points.is_empty()).collect();
    Ok(Growth {
        axis: growth::FIT_DEGREE,
        what: format!("The {} vertices of {}, log det.", subject.mesh.points.len(), subject.name),
        lines,
    })
}

/// Against the number of points.
pub(super) fn points(
    subject: &Subject,
    effort: &Effort,
    fitting: &Fitting<'_>,
    announce: &mut dyn FnMut(&str) -> Result<(), ComparisonError>,
) -> Result<Growth, ComparisonError> {
    let failed = |what: String| ComparisonError::Representation { mesh: "pillow", method: "points".into(), what };
    let pillow = Body::superellipsoid("pillow", Vector3::zeros(), Vector3::new(1.0, 0.7, 0.5), 4);
    let pillow = pillow.map_err(|error| failed(error.to_string()))?;
    let mut lines = Vec::new();
    type Sampled<'a> = Box<dyn Fn(&mut Random) -> Vector3<f64> + 'a>;
    let samplers: [(String, Option<usize>, Sampled<'_>); 2] = [
        (format!("on {}", subject.name), None, Box::new(|random| on_surface(&subject.mesh, random))),
        ("all on their hull".into(), Some(MOST_ON_HULL), Box::new(|random| pillow.boundary_along(&random.direction()))),
    ];
    for (name, most, sample) in samplers {
        let mut both =
            [Line::new(&name, Unit::Nanoseconds), Line::new(&format!("{name}, peak of the process"), Unit::Bytes)];
        for &count in effort.points.iter().filter(|count| most.is_none_or(|most| **count <= most)) {
            announce(&format!("fit of {count} points {name}"))?;
            let mut random = Random(count as u64);
            let points: Vec<Vector3<f64>> = (0..count).map(|_| sample(&mut random)).collect();
            let repeats = if count > REPEATED { 1 } else { effort.passes };
            fitting.measure((&points, DEGREE), repeats, count as f64, &mut both)?;
        }
        lines.extend(both.into_iter().filter(|line| !line.points.is_empty()));
    }
    Ok(Growth {
        axis: growth::FIT_POINTS,
        what: format!(
            "Degree {DEGREE}, log det: random points on the surface of {}, few of them vertices of their hull, and on a superellipsoid of degree 4, all of them vertices.",
            subject.name
        ),
        lines,
    })
}

impl Fitting<'_> {
    /// Adds time and peak of a fit to both lines.
    fn measure(
        &self,
        (points, degree): (&[Vector3<f64>], usize),
        repeats: usize,
        size: f64,
        [time, memory]: &mut [Line; 2],
    ) -> Result<(), ComparisonError> {
        let options = FitOptions { degree, ..FitOptions::default() };
        let mut runs = Vec::new();
        for _ in 0..repeats {
            let start = Instant::now();
            let made = fit("cost", points, &options, &mut |_| ControlFlow::Continue(()));
            runs.push(start.elapsed().as_nanos() as f64);
            made.map_err(|source| FitCacheError::Fit {
                name: format!("{} points, degree {degree}", points.len()),
                source,
            })?;
        }
        time.points.push((size, median(&runs)));
        let peak = self.program.and_then(|program| self.peak(program, points, degree));
        memory.points.extend(peak.map(|bytes| (size, bytes)));
        Ok(())
    }

    /// The most memory of `sublevel fit`, bytes; none where it cannot be known.
    fn peak(&self, program: &Path, points: &[Vector3<f64>], degree: usize) -> Option<f64> {
        let [input, out] = ["cost-points.xyz", "cost-fits"].map(|name| self.folder.join(name));
        fs::write(&input, points_text(points)).ok()?;
        let degree = degree.to_string();
        let found = peak(program, &["fit", input.to_str()?, "--degree", &degree, "--out", out.to_str()?]);
        // What is left there harms nobody.
        let _ = fs::remove_file(&input);
        let _ = fs::remove_dir_all(&out);
        found
    }
}

/// A point of a random triangle, of any size.
fn on_surface(mesh: &Mesh, random: &mut Random) -> Vector3<f64> {
    let Some(corners) = mesh.triangles.get(random.index(mesh.triangles.len())) else { return Vector3::zeros() };
    let (mut s, mut t) = (random.positive(), random.positive());
    if s + t > 1.0 {
        (s, t) = (1.0 - s, 1.0 - t);
    }
    let [a, b, c] = corners.map(|i| mesh.points[i]);
    a + (b - a) * s + (c - a) * t
}
