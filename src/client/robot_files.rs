//! Robots of the files that planners have: URDF, SRDF and meshes.

use std::path::{Path, PathBuf};

use super::connection::Client;
use super::error::ClientError;
use super::robots::StoredRobot;
use crate::robot::{DescriptionError, Geometry, MeshPathError, MeshPaths, read_urdf};
use crate::service::limits::MAX_MESSAGE_BYTES;
use crate::service::proto::fit_mesh::Content;
use crate::service::proto::{FitMesh, LinkMesh, LoadRobotRequest, MeshFormat};

/// Bytes of all meshes of a message; what is beyond is uploaded before.
const INLINE: usize = MAX_MESSAGE_BYTES / 2;

/// The files of a robot on this machine.
#[derive(Clone, Debug)]
pub struct RobotFiles {
    urdf: PathBuf,
    srdf: Option<PathBuf>,
    meshes: MeshPaths,
    max_gap_m: Option<f64>,
}

/// Why a robot is not loaded from its files.
#[derive(Debug, thiserror::Error)]
pub enum RobotFilesError {
    /// A file cannot be read.
    #[error("{}: {source}; check the path and its permissions", .file.display())]
    Read {
        /// The file.
        file: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The URDF describes no robot.
    #[error("{}: {error}", .file.display())]
    Urdf {
        /// The file.
        file: PathBuf,
        /// Where and why.
        error: DescriptionError,
    },
    /// A mesh that the URDF names is not found.
    #[error("link \"{link}\": {error}")]
    Mesh {
        /// Name of the link.
        link: String,
        /// Which and why; the remedy names methods of [`RobotFiles`].
        error: MeshPathError,
    },
    /// A file that no reader of meshes knows.
    #[error("link \"{link}\": {}: meshes are read by their ending: off, obj, ply, stl, xyz or dae; convert the file", .file.display())]
    Format {
        /// Name of the link.
        link: String,
        /// The file.
        file: PathBuf,
    },
    /// The server refused the robot, or does not answer.
    #[error(transparent)]
    Client(#[from] ClientError),
}

impl RobotFiles {
    /// A URDF. Its meshes are looked for beside it; `package://NAME/...` as well.
    pub fn new(urdf: impl Into<PathBuf>) -> Self {
        let urdf = urdf.into();
        let folder = urdf.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        let meshes = MeshPaths::new(folder);
        Self { urdf, srdf: None, meshes, max_gap_m: None }
    }

    /// With an SRDF: pairs of links that it disables may touch.
    #[must_use]
    pub fn with_srdf(mut self, srdf: impl Into<PathBuf>) -> Self {
        self.srdf = Some(srdf.into());
        self
    }

    /// With the folder of a package, see [`MeshPaths::with_package`].
    #[must_use]
    pub fn with_package(mut self, name: impl Into<String>, folder: impl Into<PathBuf>) -> Self {
        self.meshes = self.meshes.with_package(name, folder);
        self
    }

    /// With a folder that is searched for packages, see [`MeshPaths::with_search`].
    #[must_use]
    pub fn with_search(mut self, folder: impl Into<PathBuf>) -> Self {
        self.meshes = self.meshes.with_search(folder);
        self
    }

    /// How far the body of a link may reach beyond the convex hull of its meshes, or of the parts
    /// of this, metres; where nothing is said, each link gets one body of degree 6.
    #[must_use]
    pub fn with_max_gap(mut self, max_gap_m: f64) -> Self {
        self.max_gap_m = Some(max_gap_m);
        self
    }

    /// The meshes that the URDF names, each once: URI, link and file.
    fn meshes(&self, urdf: &str) -> Result<Vec<(String, String, PathBuf)>, RobotFilesError> {
        let of_file = |error| RobotFilesError::Urdf { file: self.urdf.clone(), error };
        let description = read_urdf(urdf).map_err(of_file)?;
        let mut found: Vec<(String, String, PathBuf)> = Vec::new();
        for link in &description.links {
            for piece in &link.collisions {
                let Geometry::Mesh { uri, .. } = &piece.geometry else { continue };
                if found.iter().any(|(known, ..)| known == uri) {
                    continue;
                }
                let file = self.meshes.resolve(uri).map_err(|error| {
                    let error = MeshPathError { remedy: by_methods(&error.remedy), ..error };
                    RobotFilesError::Mesh { link: link.name.to_string(), error }
                })?;
                found.push((uri.clone(), link.name.to_string(), file));
            }
        }
        Ok(found)
    }
}

impl Client {
    /// Loads a robot from its files: the server fits bodies to the links that have meshes, which
    /// takes seconds per link, once per content. Of many links at small gaps that may take longer
    /// than [`ClientOptions::patience`](super::ClientOptions::patience).
    ///
    /// # Errors
    /// Files that are missing, that cannot be read, or that the server refuses.
    pub async fn load_robot_files(&self, files: &RobotFiles) -> Result<StoredRobot, RobotFilesError> {
        let urdf = text(&files.urdf).await?;
        let srdf = match &files.srdf {
            Some(srdf) => text(srdf).await?,
            None => String::new(),
        };
        let (mut meshes, mut inline) = (Vec::new(), 0);
        for (uri, link, file) in files.meshes(&urdf)? {
            let Some(format) = format(&file) else { return Err(RobotFilesError::Format { link, file }) };
            let bytes = tokio::fs::read(&file).await.map_err(|source| RobotFilesError::Read { file, source })?;
            inline += bytes.len();
            let content = if inline > INLINE {
                inline -= bytes.len();
                Content::BlobId(self.upload(&bytes).await?)
            } else {
                Content::File(bytes.into())
            };
            let mesh = Some(FitMesh { format: format.into(), content: Some(content) });
            meshes.push(LinkMesh { uri, mesh });
        }
        let max_gap_m = files.max_gap_m;
        let request = LoadRobotRequest { urdf, srdf, meshes, max_gap_m, ..LoadRobotRequest::default() };
        Ok(self.load_robot_with(request).await?)
    }
}

async fn text(file: &Path) -> Result<String, RobotFilesError> {
    tokio::fs::read_to_string(file).await.map_err(|source| RobotFilesError::Read { file: file.into(), source })
}

/// A remedy that names options of the command line, `--package NAME=DIR` and `--search DIR`, with
/// the methods of [`RobotFiles`] that do the same.
fn by_methods(remedy: &str) -> String {
    let remedy = remedy.replace("--search DIR", "with_search(DIR)");
    let Some((before, option)) = remedy.split_once("--package ") else { return remedy };
    let Some((name, after)) = option.split_once("=DIR") else { return remedy };
    format!("{before}with_package({name:?}, DIR){after}")
}

/// The format of a file, by its ending.
fn format(file: &Path) -> Option<MeshFormat> {
    let ending = file.extension()?.to_str()?.to_ascii_uppercase();
    MeshFormat::from_str_name(&format!("MESH_FORMAT_{ending}")).filter(|format| *format != MeshFormat::Unspecified)
}
