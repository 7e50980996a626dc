//! Says what is missing where the BLAS of clarabel's semidefinite cones cannot be linked, before
//! the linker does at the end of the build.

use std::env;
use std::path::PathBuf;
use std::process::Command;

const MISSING: &str = "OpenBLAS with its development files is missing, which fitting needs: \
    Debian and Ubuntu have it as libopenblas-serial-dev with libgfortran-12-dev (or the version of your gcc) and pkg-config, \
    Fedora as openblas-devel with gcc-gfortran, Arch as openblas with gcc-fortran, Homebrew as openblas. \
    `.ci/setup` installs it; without fitting, `cargo build -p sublevel --no-default-features` needs none.";

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    // Cross builds link with tools of their own.
    let native = env::var("HOST") == env::var("TARGET");
    if env::var_os("DOCS_RS").is_some() || !native || env::var("CARGO_CFG_TARGET_OS").as_deref() != Ok("linux") {
        return;
    }
    if let Some(Err(why)) = link() {
        panic!("{MISSING}\n{why}");
    }
}

/// Whether a program links with OpenBLAS, by the flags that pkg-config names or by its name alone;
/// none where there is no C compiler to try it with.
fn link() -> Option<Result<(), String>> {
    let folder = PathBuf::from(env::var_os("OUT_DIR")?);
    let source = folder.join("blas.c");
    let text = "void dsyev_(void);\nint main(int n, char **v) { if (n > 99) dsyev_(); return v == 0; }\n";
    std::fs::write(&source, text).ok()?;
    let pkg_config = env::var_os("PKG_CONFIG").unwrap_or_else(|| "pkg-config".into());
    let named = Command::new(pkg_config).args(["--libs", "--static", "openblas"]).output();
    let named = named
        .ok()
        .filter(|found| found.status.success())
        .map(|found| String::from_utf8_lossy(&found.stdout).into_owned());
    let mut why = String::new();
    for flags in named.into_iter().chain(["-lopenblas".to_owned()]) {
        let mut compiler = Command::new("cc");
        compiler.arg("-o").arg(folder.join("blas")).arg(&source).args(flags.split_whitespace());
        let linked = compiler.output().ok()?;
        if linked.status.success() {
            return Some(Ok(()));
        }
        why += &String::from_utf8_lossy(&linked.stderr);
    }
    Some(Err(why))
}
