//! Files of meshes.

use std::path::{Path, PathBuf};

use crate::{MeshPathError, MeshPaths};

/// A folder of one test with empty files, removed at its end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str, files: &[&str]) -> Self {
        let folder = std::env::temp_dir().join(format!("sublevel-robot-{}-{test}", std::process::id()));
        for file in files {
            let path = folder.join(file);
            std::fs::create_dir_all(path.parent().expect("a folder")).expect("created");
            std::fs::write(path, "").expect("written");
        }
        Self(folder)
    }

    fn path(&self, path: &str) -> PathBuf {
        self.0.join(path)
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        // A folder that stays does no harm.
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn refused(paths: &MeshPaths, uri: &str, says: &str) -> MeshPathError {
    let error = paths.resolve(uri).expect_err(uri);
    assert!(error.uri == uri && error.to_string().contains(uri) && error.to_string().contains(says), "{error}");
    error
}

#[test]
fn packages_are_found() {
    let folder = Folder::new(
        "packages",
        &["urdf/meshes/a.stl", "other/arm/meshes/b.stl", "third/meshes/c.stl", "other/meshes/b.stl", "mapped/m/d.stl"],
    );
    let paths = MeshPaths::new(folder.path("urdf"))
        .with_search(folder.path("other"))
        .with_search(folder.path("third"))
        .with_package("given", folder.path("mapped"));
    let found = |uri: &str| paths.resolve(uri).expect(uri);
    assert_eq!(found("package://meshes/a.stl"), folder.path("urdf/meshes/a.stl"), "beside the URDF");
    assert_eq!(found("package://arm/meshes/b.stl"), folder.path("other/arm/meshes/b.stl"), "with its name first");
    assert_eq!(found("package://arm/meshes/c.stl"), folder.path("third/meshes/c.stl"), "without its name");
    assert_eq!(found("package://given/m/d.stl"), folder.path("mapped/m/d.stl"));
    assert_eq!(found("package://given/m/./x/../d.stl"), folder.path("mapped/m/d.stl"));
    refused(&paths, "package://given/meshes/a.stl", "--package given=DIR");
    let error =
        refused(&paths, "package://arm/meshes/none.stl", "--package arm=DIR, or one that has it inside, --search DIR");
    assert!(error.problem.contains("other"), "{error}");
}

#[test]
fn packages_are_not_left() {
    let folder = Folder::new("left", &["secret.stl", "root/arm/a.stl"]);
    let paths = MeshPaths::new(folder.path("root")).with_package("arm", folder.path("root/arm"));
    let uris = [
        "package://arm/../../secret.stl",
        "package://arm/x/../../../secret.stl",
        "package://x/../../secret.stl",
        "package://../secret.stl",
        "package://./a.stl",
        "package:///secret.stl",
        "package://arm//secret.stl",
        "package://arm",
        "package://arm/",
        "package://",
    ];
    for uri in uris {
        refused(&paths, uri, "package");
    }
}

#[test]
fn other_paths_are_found() {
    let folder = Folder::new("other", &["urdf/a.stl", "meshes/b c.stl"]);
    let paths = MeshPaths::new(folder.path("urdf"));
    let absolute = folder.path("meshes/b c.stl");
    let shown = absolute.to_str().expect("plain").to_string();
    assert_eq!(paths.resolve("a.stl").expect("relative"), folder.path("urdf/a.stl"));
    assert_eq!(paths.resolve("../meshes/b c.stl").expect("relative"), folder.path("urdf/../meshes/b c.stl"));
    assert_eq!(paths.resolve(&shown).expect("absolute"), absolute);
    let encoded = shown.replace(' ', "%20");
    for uri in [format!("file://{shown}"), format!("file://{encoded}"), format!("file://localhost{shown}")] {
        assert_eq!(paths.resolve(&uri).expect("a file"), absolute, "{uri}");
    }
}

#[test]
fn other_paths_are_refused() {
    let paths = MeshPaths::new(Path::new("nowhere"));
    refused(&paths, "a.stl", "relative to the folder of the URDF");
    refused(&paths, "", "the path is empty");
    refused(&paths, "file:///none%2.stl", "there is no file");
    refused(&paths, "file://a.stl", "not absolute");
    refused(&paths, "http://example.org/a.stl", "http://");
    refused(&paths, "model://arm/a.stl", "save the file");
}
