//! Where the files of meshes are that a description names.

use std::collections::BTreeMap;
use std::path::{Component, Path, PathBuf};

/// Folders in which the meshes of a robot are looked for.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct MeshPaths {
    folder: PathBuf,
    packages: BTreeMap<String, PathBuf>,
    roots: Vec<PathBuf>,
}

/// A mesh that a description names is not found.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("mesh {uri:?}: {problem}; {remedy}")]
pub struct MeshPathError {
    /// As the description names it.
    pub uri: String,
    /// What is wrong.
    pub problem: String,
    /// What to do about it.
    pub remedy: String,
}

impl MeshPaths {
    /// Meshes of a URDF in this folder. Relative paths start there, and it is the last folder that
    /// is searched for packages.
    pub fn new(folder: impl Into<PathBuf>) -> Self {
        Self { folder: folder.into(), ..Self::default() }
    }

    /// With the folder of a package: `package://name/rest` is `folder/rest`, and nothing else is
    /// searched for it. A later folder of the same name replaces an earlier one.
    #[must_use]
    pub fn with_package(mut self, name: impl Into<String>, folder: impl Into<PathBuf>) -> Self {
        self.packages.insert(name.into(), folder.into());
        self
    }

    /// With a folder that is searched for packages: `package://name/rest` is `folder/name/rest`, or
    /// else `folder/rest`. Folders are searched in the order in which they are given.
    #[must_use]
    pub fn with_search(mut self, folder: impl Into<PathBuf>) -> Self {
        self.roots.push(folder.into());
        self
    }

    /// The file of a mesh: `package://name/rest`, `file://` with an absolute path, or a path. It
    /// exists. Parts `..` of a package are resolved before symbolic links are.
    ///
    /// # Errors
    /// If there is no such file, if the URI is none of these, or if a package path leaves its
    /// package by `..`.
    pub fn resolve(&self, uri: &str) -> Result<PathBuf, MeshPathError> {
        if let Some(rest) = uri.strip_prefix("package://") {
            return self.of_package(uri, rest);
        }
        if let Some(rest) = uri.strip_prefix("file://") {
            return of_file(uri, rest);
        }
        if let Some((scheme, _)) = uri.split_once("://") {
            let problem = format!("addresses of kind {scheme}:// are not read");
            return Err(error(uri, problem, "save the file, and write its path, file://... or package://NAME/..."));
        }
        if uri.trim().is_empty() {
            return Err(error(uri, "the path is empty", "write the path of a file"));
        }
        // An absolute path replaces the folder.
        let path = self.folder.join(uri);
        if path.is_file() {
            return Ok(path);
        }
        let remedy = "correct the path, which is relative to the folder of the URDF or absolute";
        Err(error(uri, format!("there is no file {}", path.display()), remedy))
    }

    fn of_package(&self, uri: &str, path: &str) -> Result<PathBuf, MeshPathError> {
        let (name, rest) = path.split_once('/').unwrap_or((path, ""));
        let is_name = !matches!(name, "" | "." | "..") && !name.contains('\\');
        let Some(rest) = inside(rest).filter(|_| is_name) else {
            let problem = "it has no name of a package, no file, or leaves the package by \"..\"";
            let remedy = "write package://NAME/path/of/the/file; with files elsewhere use --package NAME=DIR";
            return Err(error(uri, problem, remedy));
        };
        if let Some(folder) = self.packages.get(name) {
            let path = folder.join(&rest);
            let problem = format!("there is no file {}", path.display());
            let remedy = format!("give the folder of the package: --package {name}=DIR");
            return if path.is_file() { Ok(path) } else { Err(error(uri, problem, remedy)) };
        }
        let roots = || self.roots.iter().chain([&self.folder]);
        let of_name = roots().map(|root| root.join(name).join(&rest));
        let without_name = roots().map(|root| root.join(&rest));
        of_name.chain(without_name).find(|path| path.is_file()).ok_or_else(|| {
            let searched: Vec<_> = roots().map(|root| shown(root)).collect();
            let problem = format!("the package {name:?} with this file is not in {}", searched.join(", "));
            let remedy = format!("give its folder, --package {name}=DIR, or one that has it inside, --search DIR");
            error(uri, problem, remedy)
        })
    }
}

/// The path without `.` and `..`; none if it is empty, absolute, or goes above its start.
fn inside(path: &str) -> Option<PathBuf> {
    let mut clean = PathBuf::new();
    for component in Path::new(path).components() {
        match component {
            Component::Normal(part) => clean.push(part),
            Component::CurDir => {}
            Component::ParentDir => {
                if !clean.pop() {
                    return None;
                }
            }
            Component::RootDir | Component::Prefix(_) => return None,
        }
    }
    (!clean.as_os_str().is_empty()).then_some(clean)
}

/// The file of `file://` with the rest: as it stands, or with `%20` and the like decoded.
fn of_file(uri: &str, rest: &str) -> Result<PathBuf, MeshPathError> {
    let rest = rest.strip_prefix("localhost").filter(|path| path.starts_with('/')).unwrap_or(rest);
    let path = PathBuf::from(rest);
    if !path.is_absolute() {
        return Err(error(uri, "the path after file:// is not absolute", "write file:///folder/file, or a path"));
    }
    let decoded = decoded(rest).map(PathBuf::from);
    let found = [Some(path), decoded].into_iter().flatten().find(|path| path.is_file());
    found.ok_or_else(|| error(uri, format!("there is no file {rest}"), "correct the path"))
}

/// The text with `%` and two hexadecimal digits as the bytes that they stand for.
fn decoded(text: &str) -> Option<String> {
    let mut parts = text.split('%');
    let mut bytes: Vec<u8> = parts.next()?.into();
    for part in parts {
        let digits = part.get(..2).filter(|digits| digits.bytes().all(|digit| digit.is_ascii_hexdigit()))?;
        bytes.push(u8::from_str_radix(digits, 16).ok()?);
        bytes.extend_from_slice(&part.as_bytes()[2..]);
    }
    String::from_utf8(bytes).ok()
}

fn shown(folder: &Path) -> String {
    if folder.as_os_str().is_empty() { ".".into() } else { folder.display().to_string() }
}

fn error(uri: &str, problem: impl Into<String>, remedy: impl Into<String>) -> MeshPathError {
    MeshPathError { uri: uri.into(), problem: problem.into(), remedy: remedy.into() }
}
