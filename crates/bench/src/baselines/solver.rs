//! Level 0 solved by clarabel, in a process of its own: clarabel's semidefinite cones need a BLAS,
//! and this program needs none.

use super::level0::ConicProgram;
use crate::comparison::peer::{PeerError, named, printed};
use serde::{Deserialize, Serialize};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// The program that solves: `program IN OUT`, the example `clarabel` of this package.
#[derive(Clone, Debug)]
pub(crate) struct Clarabel {
    program: PathBuf,
}

/// What it is asked.
#[derive(Serialize)]
struct Asked<'a> {
    programs: Vec<ConicProgram>,
    tolerances: &'a [f64],
    repeats: usize,
}

/// What it says of a program.
#[derive(Clone, Copy, Debug, Deserialize)]
pub(crate) struct Solved {
    pub(crate) nanoseconds: f64,
    /// In the unit of the program; none if there is no number.
    pub(crate) value: Option<f64>,
    pub(crate) iterations: u32,
    pub(crate) solved: bool,
}

impl Clarabel {
    /// As `SUBLEVEL_CLARABEL` says; else the example beside this program, where cargo puts it; none
    /// if it is not there.
    ///
    /// # Errors
    /// [`PeerError::NoProgram`].
    pub(crate) fn find() -> Result<Option<Self>, PeerError> {
        let what = "the program that `cargo build --release -p sublevel-bench --example clarabel` makes";
        if let Some(program) = named("SUBLEVEL_CLARABEL", what)? {
            return Ok(Some(Self { program }));
        }
        let here = std::env::current_exe().ok();
        let beside = here.as_deref().and_then(Path::parent).map(|folder| folder.join("examples/clarabel"));
        Ok(beside.filter(|program| program.is_file()).map(|program| Self { program }))
    }

    /// The version that the example is built with.
    pub(crate) fn version() -> String {
        crate::machine::locked("clarabel")
    }

    /// For each tolerance, for each program; files for that lie in `folder` under `name`.
    ///
    /// # Errors
    /// [`PeerError`].
    pub(crate) fn solve(
        &self,
        (folder, name): (&Path, &str),
        programs: Vec<ConicProgram>,
        tolerances: &[f64],
        repeats: usize,
    ) -> Result<Vec<Vec<Solved>>, PeerError> {
        let count = programs.len();
        let asked = Asked { programs, tolerances, repeats };
        let failed = |reason: String| PeerError::program(&self.program, reason);
        let read = folder.join(format!("{name}.programs"));
        let write = read.with_extension("solved");
        let text = serde_json::to_string(&asked).map_err(|error| failed(error.to_string()))?;
        fs::write(&read, text).map_err(PeerError::io(&read))?;
        let mut command = Command::new(&self.program);
        printed(&self.program, command.args([&read, &write]).env("OPENBLAS_NUM_THREADS", "1"))?;
        let text = fs::read_to_string(&write).map_err(PeerError::io(&write))?;
        let answers: Vec<Vec<Solved>> =
            serde_json::from_str(&text).map_err(|error| failed(format!("wrote no answers: {error}")))?;
        let complete = answers.len() == tolerances.len() && answers.iter().all(|of| of.len() == count);
        if complete { Ok(answers) } else { Err(failed("did not answer every program".into())) }
    }
}
