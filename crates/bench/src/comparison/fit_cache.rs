//! Fits that are kept between runs, so that a figure takes minutes once and seconds afterwards.

use sha2::{Digest, Sha256};
use std::fs;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use sublevel::body::{Body, Shape};
use sublevel::fit::{FitError, FitOptions, Mesh, fit};
use sublevel::jobs::{LinkBodyError, LinkFit, fit_link};
use sublevel::robot::Link;

/// Goes into every key. To be raised when a change of the fit makes other bodies of the same input:
/// nothing else says.
const REVISION: u32 = 1;

/// A folder of kept fits.
#[derive(Clone, Debug)]
pub struct FitCache {
    folder: PathBuf,
}

/// Why a fit is not to be had.
#[derive(Debug, thiserror::Error)]
pub enum FitCacheError {
    /// The folder cannot be used.
    #[error("{}: {source}; choose another folder to keep fits in", path.display())]
    Io {
        /// File or folder.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// Somebody put a compound where a body was kept.
    #[error("{0}: a compound is kept where a body is looked for; delete it")]
    Kind(String),
    /// The fit failed.
    #[error("{name}: {source}")]
    Fit {
        /// What was fitted.
        name: String,
        /// Why it cannot be.
        source: FitError,
    },
    /// The body of a link was not made.
    #[error("link {name}: {source}")]
    Link {
        /// The link.
        name: String,
        /// Why it has no body.
        source: LinkBodyError,
    },
}

impl FitCache {
    /// Keeps fits in this folder, which is made if it is not there.
    ///
    /// # Errors
    /// [`FitCacheError::Io`].
    pub fn new(folder: &Path) -> Result<Self, FitCacheError> {
        let cache = Self { folder: folder.to_owned() };
        fs::create_dir_all(folder).map_err(|source| cache.failed(folder, source))?;
        Ok(cache)
    }

    /// The folder.
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// What is kept of an earlier run for these very points, triangles and options, re-proven as
    /// any file is; else what `make` makes. `what` is its name for people, such as "chair-d6".
    ///
    /// # Errors
    /// [`FitCacheError`].
    pub fn take(
        &self,
        what: &str,
        mesh: &Mesh,
        options: &str,
        make: impl FnOnce() -> Result<Shape, FitError>,
    ) -> Result<Shape, FitCacheError> {
        let failed = |source| FitCacheError::Fit { name: what.to_owned(), source };
        self.keep(what, mesh, options, || make().map_err(failed))
    }

    /// The body that `sublevel robot` fits to the mesh of a link, in its frame.
    ///
    /// # Errors
    /// [`FitCacheError`].
    pub fn link(&self, link: &Link, mesh: &Mesh, how: LinkFit) -> Result<Shape, FitCacheError> {
        let what = format!("{}-link", link.name.replace('_', "-"));
        self.keep(&what, mesh, &format!("{how:?}"), || {
            let made = fit_link(link, mesh.clone(), how, || ControlFlow::Continue(()));
            made.map_err(|source| FitCacheError::Link { name: link.name.to_string(), source })
        })
    }

    fn keep(
        &self,
        what: &str,
        mesh: &Mesh,
        options: &str,
        make: impl FnOnce() -> Result<Shape, FitCacheError>,
    ) -> Result<Shape, FitCacheError> {
        let path = self.folder.join(format!("{what}-{}.json", key(mesh, options)));
        if let Some(kept) = fs::read_to_string(&path).ok().and_then(|text| Shape::from_json(&text).ok()) {
            return Ok(kept);
        }
        let made = make()?;
        let text = match &made {
            Shape::Body(body) => body.to_json(),
            Shape::Compound(compound) => compound.to_json(),
        };
        // Under another name first: two runs at once must not read halves.
        let partial = path.with_extension(format!("{}.tmp", std::process::id()));
        fs::write(&partial, text)
            .and_then(|()| fs::rename(&partial, &path))
            .map_err(|source| self.failed(&path, source))?;
        Ok(made)
    }

    /// The body that [`fit`] makes of the vertices of a mesh, under the mesh's name and the marks
    /// of its options.
    ///
    /// # Errors
    /// [`FitCacheError`].
    pub fn body(&self, name: &str, mesh: &Mesh, options: &FitOptions) -> Result<Body, FitCacheError> {
        let FitOptions { degree, refine, slabs, .. } = options;
        let mut what = format!("{name}-d{degree}{}", if *refine { "-refined" } else { "" });
        if *slabs > 0 {
            what += &format!("-s{slabs}");
        }
        let cloud = Mesh { points: mesh.points.clone(), triangles: Vec::new() };
        let made = self.take(&what, &cloud, &format!("{options:?}"), || {
            let made = fit(name, &mesh.points, options, &mut |_| ControlFlow::Continue(()))?;
            Ok(Shape::Body(Box::new(made.body)))
        })?;
        match made {
            Shape::Body(body) => Ok(*body),
            Shape::Compound(_) => Err(FitCacheError::Kind(what)),
        }
    }

    fn failed(&self, path: &Path, source: std::io::Error) -> FitCacheError {
        FitCacheError::Io { path: path.to_owned(), source }
    }
}

/// Twelve digits of a hash over all that determines a fit.
fn key(mesh: &Mesh, options: &str) -> String {
    let mut hash = Sha256::new();
    hash.update(format!("{REVISION} {} {options} {}", env!("CARGO_PKG_VERSION"), mesh.points.len()));
    for point in &mesh.points {
        point.iter().for_each(|c| hash.update(c.to_le_bytes()));
    }
    for corner in mesh.triangles.iter().flatten() {
        hash.update((*corner as u64).to_le_bytes());
    }
    hash.finalize().iter().take(6).map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;
    use sublevel::body::Body;

    #[test]
    fn a_fit_is_kept_for_its_input_only() {
        let folder = tempfile::tempdir().expect("a folder can be made");
        let cache = FitCache::new(folder.path()).unwrap();
        let mesh = |x: f64| Mesh { points: vec![Vector3::repeat(x)], triangles: vec![] };
        let ball = |radius: f64| {
            move || Ok(Shape::Body(Box::new(Body::ball("ball", Vector3::zeros(), radius).expect("a radius"))))
        };
        let radius = |shape: &Shape| match shape {
            Shape::Body(body) => body.circumscribed().radius.round(),
            Shape::Compound(_) => f64::NAN,
        };
        let take = |x: f64, options: &str, r: f64| radius(&cache.take("ball", &mesh(x), options, ball(r)).unwrap());
        assert_eq!(take(0.0, "a", 1.0), 1.0);
        assert_eq!(take(0.0, "a", 2.0), 1.0, "kept");
        assert_eq!(take(0.5, "a", 3.0), 3.0, "other points");
        assert_eq!(take(0.0, "b", 4.0), 4.0, "other options");
        // A damaged file is no fit.
        for entry in fs::read_dir(folder.path()).unwrap() {
            fs::write(entry.unwrap().path(), "{").unwrap();
        }
        assert_eq!(take(0.0, "a", 5.0), 5.0);
    }
}
