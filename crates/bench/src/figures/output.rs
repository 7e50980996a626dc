//! Folders, progress on the terminal, reports, pictures and blocks of pages.

use super::arguments::TablesArgs;
use crate::numbers;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::Path;
use sublevel::cli::{self, write_atomically};

/// The pictures that a figure wrote, the most important first.
pub(super) type Drawn = Result<Vec<String>, Box<dyn Error>>;

pub(super) fn make_folder(out: &Path) -> Result<(), Box<dyn Error>> {
    let made = std::fs::create_dir_all(out);
    Ok(made.map_err(|error| format!("cannot make {}: {error}; choose another --out", out.display()))?)
}

pub(super) fn bar() -> Result<ProgressBar, Box<dyn Error>> {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    bar.set_style(ProgressStyle::with_template("{spinner} [{elapsed_precise}] {wide_msg}")?);
    Ok(bar)
}

/// Shows what is being measured; goes on in any case.
pub(super) fn show_progress(bar: &ProgressBar, at: &str) -> ControlFlow<()> {
    bar.set_message(at.to_owned());
    bar.tick();
    ControlFlow::Continue(())
}

/// Writes NAME.md, whose blocks are still empty, and NAME.csv.
pub(super) fn write_report(out: &Path, name: &str, markdown: &str, csv: &str) -> Result<(), Box<dyn Error>> {
    write_atomically(&out.join(format!("{name}.csv")), csv)?;
    write_atomically(&out.join(format!("{name}.md")), markdown)
}

/// Draws the pictures of a figure from its CSV and fills the blocks of its report.
pub(super) fn redraw(out: &Path, name: &str) -> Drawn {
    let mut pictures = numbers::pictures(&format!("{name}.csv"), out)?;
    if name == "detail" {
        pictures.extend(numbers::pictures("detail-parts.csv", out)?);
    }
    finish(out, name, pictures)
}

/// Writes pictures, fills the blocks of the report, and prints where that is; returns the names of
/// the pictures.
pub(super) fn finish(out: &Path, name: &str, pictures: Vec<(String, String)>) -> Drawn {
    let names = fill(out, name, pictures)?;
    print_place(out, name)?;
    Ok(names)
}

/// The same without printing.
pub(super) fn fill(out: &Path, name: &str, pictures: Vec<(String, String)>) -> Drawn {
    for (name, svg) in &pictures {
        write_atomically(&out.join(name), svg)?;
    }
    write_numbers_of(&out.join(format!("{name}.md")), out)?;
    Ok(pictures.into_iter().map(|(name, _)| name).collect())
}

pub(super) fn print_place(out: &Path, name: &str) -> Result<(), Box<dyn Error>> {
    Ok(writeln!(io::stdout().lock(), "{}", out.join(format!("{name}.md")).display())?)
}

pub(super) fn write_numbers(args: &TablesArgs) -> Result<(), Box<dyn Error>> {
    for page in numbers::pages(&args.out)?.iter().chain(&args.pages) {
        write_numbers_of(page, &args.out)?;
    }
    Ok(())
}

/// Fills the blocks of a page from the CSV files of a folder.
fn write_numbers_of(page: &Path, folder: &Path) -> Result<(), Box<dyn Error>> {
    let old = cli::read(page)?;
    let new = numbers::written_again(&old, folder).map_err(|error| format!("{}: {error}", page.display()))?;
    if new != old {
        write_atomically(page, &new)?;
    }
    Ok(())
}
