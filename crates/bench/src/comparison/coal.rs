//! GJK of coal on convex hulls and primitives, by a program that times it in a process of its own.

use super::motion::{self, Trajectory};
use super::peer::{PeerError, named, printed};
use super::peer_shape::PeerShape;
use super::sweep::median;
use nalgebra::Vector3;
use serde::Deserialize;
use std::ffi::{OsStr, OsString};
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program that times coal: `program A B POSES OUT`, A and B files of points or primitives such
/// as `ball:0.5`, walks the poses, prints its times as JSON and writes the distances.
#[derive(Clone, Debug)]
pub struct Coal {
    program: PathBuf,
}

/// What it prints.
#[derive(Clone, Debug, Deserialize)]
struct CoalTimes {
    vertices: [usize; 2],
    queries: usize,
    cold_ns: f64,
    warm_ns: f64,
}

impl Coal {
    /// As `SUBLEVEL_COAL` says; none if it says nothing.
    ///
    /// # Errors
    /// [`PeerError::NoProgram`].
    pub fn from_environment() -> Result<Option<Self>, PeerError> {
        Ok(named("SUBLEVEL_COAL", "the program that times coal")?.map(|program| Self { program }))
    }

    /// The version of the wheel it was built against, which lies beside it.
    pub fn version(&self) -> String {
        version_beside(&self.program)
    }

    /// Writes what the program reads into `folder`, under names that begin with `name`: the points
    /// of hulls, and a file of poses for each trajectory.
    ///
    /// # Errors
    /// [`PeerError::Io`].
    pub fn start(
        &self,
        folder: &Path,
        name: &str,
        [a, b]: [PeerShape<'_>; 2],
        trajectories: &[Trajectory],
    ) -> Result<CoalRun<'_>, PeerError> {
        let write = |ending: String, text: String| {
            let path = folder.join(format!("{name}-{ending}"));
            fs::write(&path, text).map_err(PeerError::io(&path))?;
            Ok(path)
        };
        let poses = trajectories
            .iter()
            .enumerate()
            .map(|(i, trajectory)| write(format!("{i}.poses"), motion::to_text(std::slice::from_ref(trajectory))));
        let argument = |ending: &str, shape: PeerShape<'_>| {
            shape.coal_argument(|points| write(ending.to_owned(), points_text(points)))
        };
        Ok(CoalRun {
            program: &self.program,
            a: argument("a.xyz", a)?,
            b: argument("b.xyz", b)?,
            poses: poses.collect::<Result<_, _>>()?,
            runs: Vec::new(),
        })
    }
}

/// The version of coal's wheel in the folder of a program that was built against it.
pub(crate) fn version_beside(program: &Path) -> String {
    let libraries = program.parent().unwrap_or(Path::new("")).join("venv/lib");
    let pythons = entries(&libraries);
    let packages = pythons.iter().flat_map(|python| entries(&python.join("site-packages")));
    let version = packages.filter_map(|path| {
        let name = path.file_name().and_then(OsStr::to_str)?;
        name.strip_prefix("coal-")?.strip_suffix(".dist-info").map(str::to_owned)
    });
    version.into_iter().next().unwrap_or_else(|| "of unknown version".to_owned())
}

/// One point per line, as coal's program and `sublevel fit` read them.
pub(crate) fn points_text(points: &[Vector3<f64>]) -> String {
    let mut text = String::new();
    for v in points {
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{:e} {:e} {:e}", v.x, v.y, v.z);
    }
    text
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).map_or(Vec::new(), |found| found.filter_map(|entry| Some(entry.ok()?.path())).collect())
}

/// Coal on one pair of shapes, run several times.
#[derive(Debug)]
pub struct CoalRun<'a> {
    program: &'a Path,
    a: OsString,
    b: OsString,
    /// A file for each trajectory.
    poses: Vec<PathBuf>,
    /// Of each pass over the trajectories.
    runs: Vec<Vec<CoalTimes>>,
}

impl CoalRun<'_> {
    /// One process for each trajectory, which reports the median of 9 passes.
    ///
    /// The parts are as short as those that our own rows are timed by, so that a busy machine does
    /// no more to one than to the other.
    ///
    /// # Errors
    /// [`PeerError`].
    pub fn pass(&mut self) -> Result<(), PeerError> {
        let run = self.poses.iter().map(|poses| {
            let mut command = Command::new(self.program);
            command.args([&self.a, &self.b]).args([poses, &poses.with_extension("coal")]);
            let output = printed(self.program, &mut command)?;
            serde_json::from_slice(&output)
                .map_err(|error| PeerError::program(self.program, format!("prints no times: {error}")))
        });
        self.runs.push(run.collect::<Result<_, _>>()?);
        Ok(())
    }

    /// Nanoseconds per query, cold and warm: the median run of each trajectory, averaged over the
    /// queries.
    pub fn times(&self) -> (f64, f64) {
        let mean = |time: fn(&CoalTimes) -> f64| {
            let of = |i: usize| median(&self.runs.iter().map(|run| time(&run[i])).collect::<Vec<_>>());
            let queries: Vec<usize> =
                self.runs.first().map_or(Vec::new(), |run| run.iter().map(|t| t.queries).collect());
            let total: f64 = queries.iter().enumerate().map(|(i, &count)| of(i) * count as f64).sum();
            total / queries.iter().sum::<usize>() as f64
        };
        (mean(|run| run.cold_ns), mean(|run| run.warm_ns))
    }

    /// How many vertices coal's hulls have; none before the first pass.
    pub fn vertices(&self) -> Option<[usize; 2]> {
        Some(self.runs.first()?.first()?.vertices)
    }

    /// The distances of the last pass, metres, trajectory by trajectory.
    ///
    /// # Errors
    /// [`PeerError`]: no pass yet, or files that changed since.
    pub fn distances(&self) -> Result<Vec<Vec<f64>>, PeerError> {
        let queries = self.runs.last().map_or(Vec::new(), |run| run.iter().map(|times| times.queries).collect());
        let failed = |reason: String| PeerError::program(self.program, reason);
        let read = |(poses, queries): (&PathBuf, usize)| {
            let path = poses.with_extension("coal");
            let text = fs::read_to_string(&path).map_err(PeerError::io(&path))?;
            let distances: Result<Vec<f64>, _> = text.lines().map(str::parse).collect();
            let distances = distances.map_err(|error| failed(format!("wrote no distances: {error}")))?;
            if distances.len() == queries {
                Ok(distances)
            } else {
                Err(failed(format!("answered {} of {queries} poses", distances.len())))
            }
        };
        self.poses.iter().zip(queries).map(read).collect()
    }
}
