//! `sublevel push`.

use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

use serde::Serialize;

use crate::service::{self, Pushed};

/// Store body files in a running server
///
/// Each file is re-proven here and by the server. Storing a body again changes nothing and
/// succeeds.
///
/// Example: sublevel push bodies/*.json --server http://127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(super) struct PushArgs {
    /// Body files, as `sublevel fit` writes them
    #[arg(required = true, value_name = "FILE")]
    pub(super) files: Vec<PathBuf>,
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    pub(super) server: String,
    /// Print a JSON array instead of a table
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Serialize)]
struct Row<'a> {
    file: String,
    id: &'a str,
    name: &'a str,
    degree: u32,
    volume_m3: f64,
    created: bool,
}

/// Stores the files and prints what the server has.
///
/// # Errors
/// The first file that could not be stored, and why.
pub(super) fn run(args: &PushArgs) -> Result<(), Box<dyn Error>> {
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let pushed = runtime.block_on(service::push(&args.server, &args.files))?;
    let rows: Vec<_> = pushed.iter().map(row).collect();
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        table(&mut out, &rows)?;
    }
    Ok(())
}

fn row(pushed: &Pushed) -> Row<'_> {
    Row {
        file: pushed.file.display().to_string(),
        id: &pushed.body.id,
        name: &pushed.body.name,
        degree: pushed.body.degree,
        volume_m3: pushed.body.volume_m3,
        created: pushed.created,
    }
}

fn table(out: &mut impl Write, rows: &[Row<'_>]) -> io::Result<()> {
    let width = |title: &str, text: fn(&Row<'_>) -> usize| rows.iter().map(text).max().unwrap_or(0).max(title.len());
    let file = width("file", |row| row.file.chars().count());
    let name = width("name", |row| row.name.chars().count());
    writeln!(out, "{:file$}  {:name$}  degree  volume m3     stored   id", "file", "name")?;
    for row in rows {
        let stored = if row.created { "new" } else { "before" };
        writeln!(
            out,
            "{:file$}  {:name$}  {:>6}  {:<12.6e}  {stored:<7}  {}",
            row.file, row.name, row.degree, row.volume_m3, row.id
        )?;
    }
    Ok(())
}
