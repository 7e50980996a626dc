//! The paper's Table I, computed again: the volumes of bounding sets of five meshes, beside those
//! printed, and what they cost to build.

mod pictures;
mod report;
mod rows;

use super::Machine;
use crate::csv::{self, CsvError};
use nalgebra::{Matrix3, Vector3};
use rows::{MESHES, Method, Row, rows};
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;
use sublevel::body::{Aabb, Body, SosBody, Volume};
use sublevel::draw::ChartError;
use sublevel::fit::{
    Coordinates, FitError, FitOptions, Mesh, OrientedBox, ReadError, ReadOptions, SosMethod, SosOptions, ball, fit,
    fit_sos, hull, hull::HullError, read_mesh, smallest_box,
};

/// Degrees of a quick run, and its limit on what is refined.
const QUICK_DEGREE: usize = 4;

/// Why there is no table.
#[derive(Debug, thiserror::Error)]
pub enum Table1Error {
    /// A mesh cannot be read.
    #[error(
        "{0}; the meshes 10, 101, 121, 181 and 361 of the Princeton Mesh Segmentation Benchmark are needed as .off files"
    )]
    Mesh(#[from] ReadError),
    /// A mesh has no hull.
    #[error("{mesh}: {source}")]
    Hull {
        /// The mesh.
        mesh: &'static str,
        /// What is wrong with it.
        source: HullError,
    },
    /// Stopped by the caller.
    #[error("the table was cancelled")]
    Cancelled,
    /// A picture failed.
    #[error(transparent)]
    Chart(#[from] ChartError),
    /// The numbers of an earlier run cannot be read.
    #[error(transparent)]
    Csv(#[from] CsvError),
    /// A fit of today is not that of the earlier run.
    #[error("{set} around the {mesh} has {now} m³ now, and {then} m³ in the CSV; make the whole table again")]
    Changed {
        /// The set.
        set: String,
        /// The mesh.
        mesh: &'static str,
        /// Its volume now.
        now: f64,
        /// In the CSV.
        then: f64,
    },
}

/// Volumes of the same fit may differ by as much, as a part: on other processors, in the last
/// digits.
const SAME: f64 = 1e-6;

/// One set around one mesh.
#[derive(Clone, Debug)]
struct FitOutput {
    volume_m3: f64,
    /// Estimate of the error of the volume; 0 where it is a formula.
    error_m3: f64,
    seconds: f64,
    /// The set, where it is one of ours.
    set: Option<Set>,
}

/// One of our sets.
#[derive(Clone, Debug)]
enum Set {
    Body(Box<Body>),
    Sos(Box<SosBody>),
}

impl Set {
    fn value(&self, x: &Vector3<f64>) -> f64 {
        match self {
            Self::Body(body) => body.value(x),
            Self::Sos(body) => body.value(x),
        }
    }

    fn bounding_box(&self) -> &Aabb {
        match self {
            Self::Body(body) => body.bounding_box(),
            Self::Sos(body) => body.bounding_box(),
        }
    }

    fn volume(&self) -> Volume {
        match self {
            Self::Body(body) => body.volume(),
            Self::Sos(body) => body.volume(),
        }
    }
}

/// One of the meshes.
struct Subject {
    name: &'static str,
    /// Empty where only the numbers are known.
    mesh: Mesh,
    hull_volume_m3: f64,
}

/// What was built around every mesh, or why not.
pub struct Table1 {
    machine: Machine,
    subjects: Vec<Subject>,
    rows: Vec<(Row, Vec<Result<FitOutput, String>>)>,
}

/// How far a table is.
#[derive(Clone, Debug)]
pub struct Table1Progress {
    /// Cells done.
    pub done: usize,
    /// Cells in all.
    pub cells: usize,
    /// What is being built around what.
    pub at: String,
}

/// Builds every set of the table around the meshes `10.off`, `101.off`, ... in `meshes`; `quick`
/// leaves out what is above degree 4.
///
/// Takes about five minutes on one core, half a minute if quick. A fit that fails is a cell that
/// says so. `progress` receives every cell and of every Newton step in between, and can stop it.
///
/// # Errors
/// [`Table1Error`]: a mesh that cannot be read, or the callback's wish.
pub fn table1(
    meshes: &Path,
    quick: bool,
    progress: &mut dyn FnMut(&Table1Progress) -> ControlFlow<()>,
) -> Result<Table1, Table1Error> {
    let subjects = MESHES.map(|(name, number)| Subject::read(name, &meshes.join(format!("{number}.off"))));
    let subjects = subjects.into_iter().collect::<Result<Vec<_>, _>>()?;
    let rows: Vec<Row> =
        rows().into_iter().filter(|row| !quick || row.method.degree().is_none_or(|d| d <= QUICK_DEGREE)).collect();
    let mut announce = Table1Progress { done: 0, cells: rows.len() * subjects.len(), at: String::new() };
    let mut table = Table1 { machine: Machine::this(), subjects, rows: Vec::new() };
    for row in rows {
        let mut cells = Vec::new();
        for subject in &table.subjects {
            announce.at = format!("{} around the {}", row.method.name(), subject.name);
            if progress(&announce).is_break() {
                return Err(Table1Error::Cancelled);
            }
            let made = subject.make(row.method, &mut || progress(&announce));
            cells.push(match made {
                Err(FitError::Cancelled) => return Err(Table1Error::Cancelled),
                made => made.map_err(|error| error.to_string()),
            });
            announce.done += 1;
        }
        table.rows.push((row, cells));
    }
    Ok(table)
}

impl Table1 {
    /// The numbers of an earlier run, out of what [`Self::csv`] wrote: for the tables, not for the
    /// pictures of shapes.
    ///
    /// # Errors
    /// [`CsvError`].
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let table = csv::Table::read(csv)?;
        let mut subjects: Vec<Subject> = Vec::new();
        let mut rows: Vec<(Row, Vec<Result<FitOutput, String>>)> = Vec::new();
        for line in table.rows() {
            let (set, mesh) = (line.text("set")?, line.text("mesh")?);
            let name = MESHES.iter().map(|(name, _)| *name).find(|name| *name == mesh);
            let name = name.ok_or_else(|| line.error(format!("no mesh is named '{mesh}'")))?;
            if !subjects.iter().any(|subject| subject.name == name) {
                let hull_volume_m3 = line.number("hull_volume_m3")?;
                subjects.push(Subject { name, mesh: Mesh::default(), hull_volume_m3 });
            }
            let row = self::rows().into_iter().find(|row| row.method.name() == set);
            let row = row.ok_or_else(|| line.error(format!("no set is named '{set}'")))?;
            let made = line.maybe("volume_m3")?.ok_or_else(|| "refused".to_owned());
            let (error_m3, seconds) = (line.number("volume_error_m3")?, line.number("seconds")?);
            let made = made.map(|volume_m3| FitOutput { volume_m3, error_m3, seconds, set: None });
            match rows.last_mut().filter(|(known, _)| known.method == row.method) {
                Some((_, cells)) => cells.push(made),
                None => rows.push((row, vec![made])),
            }
        }
        Ok(Self { machine: Machine::this(), subjects, rows })
    }

    /// Fits again what the pictures show of an earlier run around the meshes; volumes and times
    /// stay those of that run.
    ///
    /// # Errors
    /// [`Table1Error`]: a mesh that cannot be read, a fit that is another now, or the callback's
    /// wish.
    pub fn fitted_again(
        csv: &str,
        meshes: &Path,
        progress: &mut dyn FnMut(&Table1Progress) -> ControlFlow<()>,
    ) -> Result<Self, Table1Error> {
        let mut table = Self::read(csv)?;
        for subject in &mut table.subjects {
            let number = MESHES.iter().find(|(name, _)| *name == subject.name).map_or("", |(_, number)| number);
            *subject = Subject::read(subject.name, &meshes.join(format!("{number}.off")))?;
        }
        let drawn = |row: &Row| row.method.is_drawn();
        let cells = table.rows.iter().filter(|(row, _)| drawn(row)).map(|(_, cells)| cells.len()).sum();
        let mut announce = Table1Progress { done: 0, cells, at: String::new() };
        for (row, cells) in table.rows.iter_mut().filter(|(row, _)| drawn(row)) {
            for (made, subject) in cells.iter_mut().zip(&table.subjects) {
                announce.at = format!("{} around the {}", row.method.name(), subject.name);
                if progress(&announce).is_break() {
                    return Err(Table1Error::Cancelled);
                }
                let now = match subject.make(row.method, &mut || progress(&announce)) {
                    Err(FitError::Cancelled) => return Err(Table1Error::Cancelled),
                    now => now,
                };
                announce.done += 1;
                let (Ok(made), Ok(now)) = (made, now) else { continue };
                let (volume, then) = (now.volume_m3, made.volume_m3);
                // Written so that NaN differs, too.
                if !((volume - then).abs() <= SAME * then) {
                    let (set, mesh) = (row.method.name(), subject.name);
                    return Err(Table1Error::Changed { set, mesh, now: volume, then });
                }
                made.set = now.set;
            }
        }
        Ok(table)
    }
}

impl Subject {
    fn read(name: &'static str, path: &Path) -> Result<Self, Table1Error> {
        let mesh = read_mesh(path, &ReadOptions::default())?.mesh;
        let hull = hull::convex_hull(&mesh.points).map_err(|source| Table1Error::Hull { mesh: name, source })?;
        Ok(Self { name, mesh, hull_volume_m3: hull.volume })
    }

    fn make(&self, method: Method, progress: &mut dyn FnMut() -> ControlFlow<()>) -> Result<FitOutput, FitError> {
        let start = Instant::now();
        let exact =
            |volume_m3| FitOutput { volume_m3, error_m3: 0.0, seconds: start.elapsed().as_secs_f64(), set: None };
        let points = &self.mesh.points;
        Ok(match method {
            Method::Hull => exact(hull::convex_hull(points)?.volume),
            Method::AxisBox => exact(OrientedBox::along(Matrix3::identity(), points).volume()),
            Method::OrientedBox => {
                let vertices: Vec<_> = hull::convex_hull(points)?.vertices.iter().map(|&i| points[i]).collect();
                exact(smallest_box(&vertices).volume())
            }
            Method::Ball => {
                let rung = ball(self.name, points)?;
                FitOutput::of(Set::Body(Box::new(rung.body)), rung.seconds)
            }
            Method::Convex(objective, degree, refine) => {
                let options = FitOptions { degree, objective, refine, ..FitOptions::default() };
                let fit = fit(self.name, points, &options, &mut |_| progress())?;
                FitOutput::of(Set::Body(Box::new(fit.body)), fit.report.seconds)
            }
            Method::InverseMoment(degree) => self.sos(degree, SosMethod::InverseMoment, progress)?,
            Method::Relaxed(c, objective, degree) => self.sos(degree, SosMethod::Relaxed { c, objective }, progress)?,
        })
    }

    /// A set that need not be convex; c is measured in the meshes' own frame.
    fn sos(
        &self,
        degree: usize,
        method: SosMethod,
        progress: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<FitOutput, FitError> {
        let options = SosOptions { degree, method, coordinates: Coordinates::Raw, solver: None, input: String::new() };
        let fit = fit_sos(self.name, &self.mesh.points, &[], &options, &mut |_| progress())?;
        Ok(FitOutput::of(Set::Sos(Box::new(fit.body)), fit.report.seconds))
    }
}

impl FitOutput {
    fn of(set: Set, seconds: f64) -> Self {
        let Volume { volume_m3, error_m3 } = set.volume();
        Self { volume_m3, error_m3, seconds, set: Some(set) }
    }
}
