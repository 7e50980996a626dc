//! GJK of other libraries on the convex hulls: parry in this process, coal in one of its own.

use crate::motion;
use crate::objects::{Object, Pair, folder};
use crate::rows::{DEGREE, Scene};
use crate::sweep::{Answer, median};
use nalgebra::Vector3;
use parry3d_f64::math::{Pose as ParryPose, Rotation, Vector};
use parry3d_f64::query::details::{
    closest_points_support_map_support_map_with_params, distance_support_map_support_map,
};
use parry3d_f64::query::gjk::{GJKResult, VoronoiSimplex};
use parry3d_f64::shape::ConvexPolyhedron;
use serde::Deserialize;
use std::error::Error;
use std::ffi::OsStr;
use std::fmt::Write;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use sublevel::measure::{Options, Pose, WarmStart, distance};

/// Answers that contradict each other by more, metres, are told: ten times the tolerance coal has by default.
const AGREEMENT: f64 = 1e-5;

/// The hulls as parry's shapes.
pub(crate) struct Hulls {
    a: ConvexPolyhedron,
    b: ConvexPolyhedron,
}

/// The pose in parry's types.
pub(crate) fn parry_pose(pose: &Pose) -> ParryPose {
    let (t, q) = (pose.translation(), pose.rotation());
    ParryPose::from_parts(Vector::new(t.x, t.y, t.z), Rotation::from_xyzw(q.i, q.j, q.k, q.w))
}

impl Hulls {
    pub(crate) fn new(pair: &Pair) -> Result<Self, Box<dyn Error>> {
        let shape = |object: &Object| {
            let points: Vec<Vector> = object.hull.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
            ConvexPolyhedron::from_convex_hull(&points).ok_or("parry finds no hull")
        };
        Ok(Self { a: shape(&pair.a)?, b: shape(&pair.b)? })
    }

    fn parry_distance(&self, pose: &ParryPose) -> f64 {
        distance_support_map_support_map(pose, &self.a, &self.b)
    }

    /// The hulls lie inside bodies that are apart: 0 is a failure.
    pub(crate) fn parry_cold(&self, pose: &ParryPose) -> Answer {
        let distance = self.parry_distance(pose);
        Answer { iterations: None, failed: distance <= 0.0, overlap: distance <= 0.0 }
    }

    pub(crate) fn parry_warm(&self, pose: &ParryPose, direction: &mut Option<Vector>) -> Answer {
        let mut simplex = VoronoiSimplex::new();
        let found = closest_points_support_map_support_map_with_params(
            pose,
            &self.a,
            &self.b,
            f64::MAX,
            &mut simplex,
            *direction,
        );
        let apart = match found {
            // From a to b, which is the direction of the support point to begin with.
            GJKResult::ClosestPoints(x, y, _) => {
                *direction = Some(y - x);
                true
            }
            _ => {
                *direction = None;
                false
            }
        };
        Answer { iterations: None, failed: !apart, overlap: !apart }
    }
}

/// The program that times coal.
pub(crate) struct Coal {
    program: PathBuf,
}

/// What it prints.
#[derive(Deserialize)]
struct CoalTimes {
    vertices: [usize; 2],
    queries: usize,
    cold_ns: f64,
    warm_ns: f64,
}

impl Coal {
    /// As `SUBLEVEL_COAL` says; none, with a note, if it says nothing.
    pub(crate) fn from_environment() -> Result<Option<Self>, Box<dyn Error>> {
        let Some(program) = std::env::var_os("SUBLEVEL_COAL").map(PathBuf::from) else {
            eprintln!(
                "note: without coal; build it with '../shared/peers/build.sh DIR' and set SUBLEVEL_COAL=DIR/coal_gjk"
            );
            return Ok(None);
        };
        if !program.is_file() {
            return Err(format!("SUBLEVEL_COAL: {} is no file", program.display()).into());
        }
        Ok(Some(Self { program }))
    }

    /// The version of the wheel it was built against, which lies beside it.
    pub(crate) fn version(&self) -> String {
        let libraries = self.program.parent().unwrap_or(Path::new("")).join("venv/lib");
        let pythons = entries(&libraries);
        let packages = pythons.iter().flat_map(|python| entries(&python.join("site-packages")));
        let version = packages.filter_map(|path| {
            let name = path.file_name().and_then(OsStr::to_str)?;
            name.strip_prefix("coal-")?.strip_suffix(".dist-info").map(str::to_owned)
        });
        version.into_iter().next().unwrap_or_else(|| "of unknown version".to_owned())
    }

    /// Writes what the program reads: the hulls, and a file of poses for each trajectory.
    pub(crate) fn start<'a>(&'a self, scene: &Scene<'_>) -> Result<CoalRun<'a>, Box<dyn Error>> {
        let write = |name: String, text: String| -> Result<PathBuf, Box<dyn Error>> {
            let path = folder()?.join(name);
            fs::write(&path, text).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(path)
        };
        let hull = |object: &Object| write(format!("{}-hull.xyz", object.name), hull_text(&object.hull));
        let name = format!("{}-{}", scene.pair.name, scene.kind.name());
        let trajectories = scene.poses(DEGREE).iter().enumerate();
        let poses = trajectories.map(|(i, trajectory)| {
            write(format!("{name}-{i}.poses"), motion::to_text(std::slice::from_ref(trajectory)))
        });
        Ok(CoalRun {
            program: &self.program,
            a: hull(&scene.pair.a)?,
            b: hull(&scene.pair.b)?,
            poses: poses.collect::<Result<_, _>>()?,
            runs: Vec::new(),
        })
    }
}

fn hull_text(hull: &[Vector3<f64>]) -> String {
    let mut text = String::new();
    for v in hull {
        // Writing to a string can not fail.
        let _ = writeln!(text, "{:e} {:e} {:e}", v.x, v.y, v.z);
    }
    text
}

fn entries(folder: &Path) -> Vec<PathBuf> {
    fs::read_dir(folder).map_or(Vec::new(), |found| found.filter_map(|entry| Some(entry.ok()?.path())).collect())
}

/// Coal on one scene, run several times.
pub(crate) struct CoalRun<'a> {
    program: &'a Path,
    a: PathBuf,
    b: PathBuf,
    /// A file for each trajectory.
    poses: Vec<PathBuf>,
    /// Of each pass over the trajectories.
    runs: Vec<Vec<CoalTimes>>,
}

impl CoalRun<'_> {
    /// One process for each trajectory, which reports the median of 9 passes.
    ///
    /// The parts are as short as those that our own rows are timed by, so that a busy machine does no more to one than to
    /// the other.
    pub(crate) fn pass(&mut self) -> Result<(), Box<dyn Error>> {
        let run = self.poses.iter().map(|poses| {
            let output =
                Command::new(self.program).args([&self.a, &self.b, poses, &poses.with_extension("coal")]).output();
            let output = output.map_err(|error| format!("{}: {error}", self.program.display()))?;
            if !output.status.success() {
                let complaint = String::from_utf8_lossy(&output.stderr);
                return Err(format!("{} failed: {}", self.program.display(), complaint.trim()).into());
            }
            Ok(serde_json::from_slice(&output.stdout)?)
        });
        self.runs.push(run.collect::<Result<_, Box<dyn Error>>>()?);
        Ok(())
    }

    /// Nanoseconds per query, cold and warm: the median run of each trajectory, averaged over the queries.
    pub(crate) fn times(&self) -> (f64, f64) {
        let mean = |time: fn(&CoalTimes) -> f64| {
            let of = |i: usize| median(&self.runs.iter().map(|run| time(&run[i])).collect::<Vec<_>>());
            let queries: Vec<usize> =
                self.runs.first().map_or(Vec::new(), |run| run.iter().map(|t| t.queries).collect());
            let total: f64 = queries.iter().enumerate().map(|(i, &count)| of(i) * count as f64).sum();
            total / queries.iter().sum::<usize>() as f64
        };
        (mean(|run| run.cold_ns), mean(|run| run.warm_ns))
    }

    /// Tells where coal, parry and our bodies, which contain the hulls, contradict each other.
    pub(crate) fn check(&self, scene: &Scene<'_>) -> Result<(), Box<dyn Error>> {
        let (a, b) = scene.pair.bodies(DEGREE);
        let ours = [scene.pair.a.hull.len(), scene.pair.b.hull.len()];
        if let Some(other) = self.runs.iter().flatten().find(|run| run.vertices != ours) {
            eprintln!("note: coal's hulls of {} have {:?} vertices, ours {ours:?}", scene.pair.name, other.vertices);
        }
        let (mut differ, mut outside) = (0.0_f64, 0.0_f64);
        for (trajectory, path) in scene.poses(DEGREE).iter().zip(&self.poses) {
            let text = fs::read_to_string(path.with_extension("coal"))?;
            let distances: Vec<f64> = text.lines().map(str::parse).collect::<Result<_, _>>()?;
            if distances.len() != trajectory.len() {
                return Err(format!("coal answered {} of {} poses", distances.len(), trajectory.len()).into());
            }
            for (coal, pose) in distances.into_iter().zip(trajectory) {
                differ = differ.max((coal - scene.hulls.parry_distance(&parry_pose(pose))).abs());
                let ours = distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default());
                outside = outside.max(ours.lower - coal);
            }
        }
        if differ > AGREEMENT {
            eprintln!("note: coal and parry differ by up to {differ:.1e} m");
        }
        if outside > AGREEMENT {
            eprintln!("note: coal's hulls are closer than proven for the bodies around them, by up to {outside:.1e} m");
        }
        Ok(())
    }
}
