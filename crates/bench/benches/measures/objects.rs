//! The objects: meshes, the vertices of their convex hulls, and the bodies of each degree around
//! them.

use nalgebra::Vector3;
use std::error::Error;
use std::fs;
use std::path::PathBuf;
use sublevel::body::Body;
use sublevel::fit::{FitOptions, Mesh, ReadOptions, hull::convex_hull, read_mesh};
use sublevel_bench::comparison::FitCache;

/// The pairs of the figures, with the nanoseconds of coal's cached guess where the figures that are
/// times were set.
pub(crate) const PAIRS: [(&str, &str, f64); 3] =
    [("chair", "human", 610.0), ("hand", "vase", 790.0), ("octopus", "chair", 640.0)];

/// Numbers of the meshes in the Princeton Mesh Segmentation Benchmark.
const MESHES: [(&str, u32); 5] = [("chair", 101), ("human", 10), ("hand", 181), ("vase", 361), ("octopus", 121)];

/// The degrees that are timed.
pub(crate) const DEGREES: [usize; 4] = [2, 4, 6, 8];

/// An object as a hull and as bodies.
pub(crate) struct Object {
    /// Vertices of the convex hull, metres.
    pub(crate) hull: Vec<Vector3<f64>>,
    /// One body for each of [`DEGREES`].
    bodies: Vec<Body>,
}

/// Two objects; the poses are those of `b` in the frame of `a`.
pub(crate) struct Pair {
    pub(crate) name: String,
    pub(crate) a: Object,
    pub(crate) b: Object,
    /// Nanoseconds of coal's cached guess on machines of the class named in the figures.
    pub(crate) coal_warm: f64,
}

impl Pair {
    /// Both bodies of a degree out of [`DEGREES`].
    pub(crate) fn bodies(&self, degree: usize) -> (&Body, &Body) {
        (self.a.body(degree), self.b.body(degree))
    }
}

impl Object {
    /// Reads the mesh and its bodies, and fits those that are not kept yet.
    pub(crate) fn load(name: &str) -> Result<Self, Box<dyn Error>> {
        let (_, number) = MESHES.into_iter().find(|(known, _)| *known == name).ok_or("no such mesh")?;
        let data = std::env::var_os("SUBLEVEL_DATA").ok_or("SUBLEVEL_DATA does not name the folder with the meshes")?;
        let path = PathBuf::from(data).join(format!("psb/{number}.off"));
        let mesh = read_mesh(&path, &ReadOptions::default())?.mesh;
        let hull = convex_hull(&mesh.points)?.vertices.into_iter().map(|i| mesh.points[i]).collect();
        let cache = FitCache::new(&folder()?)?;
        let bodies = DEGREES.into_iter().map(|degree| kept(&cache, name, degree, &mesh)).collect::<Result<_, _>>()?;
        Ok(Self { hull, bodies })
    }

    fn body(&self, degree: usize) -> &Body {
        let index = DEGREES.iter().position(|&known| known == degree).expect("one of the degrees that are fitted");
        &self.bodies[index]
    }
}

/// Folder of what is kept between runs.
pub(crate) fn folder() -> Result<PathBuf, Box<dyn Error>> {
    let target = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let folder = target.parent().ok_or("cargo names no target folder")?.join("bench-bodies");
    fs::create_dir_all(&folder).map_err(|error| format!("{}: {error}", folder.display()))?;
    Ok(folder)
}

/// The body of an earlier run, or a new fit.
fn kept(cache: &FitCache, name: &str, degree: usize, mesh: &Mesh) -> Result<Body, Box<dyn Error>> {
    let options = FitOptions { degree, ..FitOptions::default() };
    Ok(cache.body(name, mesh, &options)?)
}
