//! The figure of the paper's Table I.

use super::output::{Drawn, bar, finish, make_folder, show_progress, write_report};
use crate::table1::{Table1, Table1Error, Table1Progress, table1};
use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use sublevel::cli;

pub(super) fn run_table1(meshes: &Path, out: &Path, quick: bool) -> Drawn {
    make_folder(out)?;
    let table = watched(|progress| table1(meshes, quick, progress))?;
    write_report(out, "table1", &table.markdown(), &table.csv())?;
    finish(out, "table1", table.pictures()?)
}

pub(super) fn redraw_table1(meshes: &Path, out: &Path) -> Drawn {
    let csv = cli::read(&out.join("table1.csv"))?;
    let table = watched(|progress| Table1::fitted_again(&csv, meshes, progress))?;
    finish(out, "table1", table.pictures()?)
}

/// Makes a table under a spinner.
fn watched(
    make: impl FnOnce(&mut dyn FnMut(&Table1Progress) -> ControlFlow<()>) -> Result<Table1, Table1Error>,
) -> Result<Table1, Box<dyn Error>> {
    let bar = bar()?;
    let table = make(&mut |progress| {
        let Table1Progress { done, cells, at } = progress;
        show_progress(&bar, &format!("{} of {cells}: {at}", done + 1))
    })?;
    bar.finish_and_clear();
    Ok(table)
}
