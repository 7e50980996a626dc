//! GJK of other libraries on the convex hulls: parry in this process, coal in one of its own.

use crate::objects::{Object, Pair, folder};
use crate::rows::Scene;
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

    /// Writes what the program reads.
    pub(crate) fn start<'a>(&'a self, scene: &Scene<'_>) -> Result<CoalRun<'a>, Box<dyn Error>> {
        let write = |object: &Object| -> Result<PathBuf, Box<dyn Error>> {
            let path = folder()?.join(format!("{}-hull.xyz", object.name));
            fs::write(&path, hull_text(&object.hull)).map_err(|error| format!("{}: {error}", path.display()))?;
            Ok(path)
        };
        Ok(CoalRun {
            coal: self,
            a: write(&scene.pair.a)?,
            b: write(&scene.pair.b)?,
            poses: scene.poses_file.clone(),
            distances: scene.poses_file.with_extension("coal"),
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
    coal: &'a Coal,
    a: PathBuf,
    b: PathBuf,
    poses: PathBuf,
    distances: PathBuf,
    runs: Vec<CoalTimes>,
}

impl CoalRun<'_> {
    /// One run, of 9 passes itself.
    pub(crate) fn run(&mut self) -> Result<(), Box<dyn Error>> {
        let program = &self.coal.program;
        let output = Command::new(program).args([&self.a, &self.b, &self.poses, &self.distances]).output();
        let output = output.map_err(|error| format!("{}: {error}", program.display()))?;
        if !output.status.success() {
            let complaint = String::from_utf8_lossy(&output.stderr);
            return Err(format!("{} failed: {}", program.display(), complaint.trim()).into());
        }
        self.runs.push(serde_json::from_slice(&output.stdout)?);
        Ok(())
    }

    /// Nanoseconds per query, cold and warm: medians of the runs.
    pub(crate) fn times(&self) -> (f64, f64) {
        let of = |time: fn(&CoalTimes) -> f64| median(&self.runs.iter().map(time).collect::<Vec<_>>());
        (of(|run| run.cold_ns), of(|run| run.warm_ns))
    }

    /// Tells where coal, parry and our bodies, which contain the hulls, contradict each other.
    pub(crate) fn check(&self, scene: &Scene<'_>) -> Result<(), Box<dyn Error>> {
        let text = fs::read_to_string(&self.distances)?;
        let distances: Vec<f64> = text.lines().map(str::parse).collect::<Result<_, _>>()?;
        let (a, b) = scene.pair.bodies(crate::rows::DEGREE);
        let poses: Vec<&Pose> = scene.poses(crate::rows::DEGREE).iter().flatten().collect();
        let last = self.runs.last().ok_or("coal was not run")?;
        if last.queries != poses.len() || last.vertices != [scene.pair.a.hull.len(), scene.pair.b.hull.len()] {
            eprintln!("note: coal used {:?} vertices and {} poses", last.vertices, last.queries);
        }
        let (mut differ, mut outside) = (0.0_f64, 0.0_f64);
        for (&coal, pose) in distances.iter().zip(poses) {
            differ = differ.max((coal - scene.hulls.parry_distance(&parry_pose(pose))).abs());
            let ours = distance(a, &Pose::identity(), b, pose, &Options::default(), &mut WarmStart::default());
            outside = outside.max(ours.lower - coal);
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
