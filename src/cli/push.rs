//! `sublevel push`.

use std::error::Error;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::client::{Client, ClientError, ClientOptions, StoredBody};
use crate::scene::Geometry;

/// Store files of bodies, compounds, ladders, sos-bodies and half-spaces in a running server
///
/// Each file is re-proven here and by the server; large ones are sent in pieces. Storing a body
/// again changes nothing and succeeds.
///
/// Example: sublevel push bodies/*.json --server http://127.0.0.1:50051
#[derive(Debug, clap::Args)]
pub(super) struct PushArgs {
    /// Files, as `sublevel fit` and `sublevel primitive` write them
    #[arg(required = true, value_name = "FILE")]
    pub(super) files: Vec<PathBuf>,
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    pub(super) server: String,
    /// Print a JSON array instead of a table
    #[arg(long)]
    pub(super) json: bool,
}

/// Why a file is not stored.
#[derive(Debug, thiserror::Error)]
enum PushError {
    /// It cannot be read.
    #[error("cannot read {}: {source}; check the path and its permissions", .file.display())]
    Read { file: PathBuf, source: io::Error },
    /// It is no valid file.
    #[error("{} cannot be stored: {why}", .file.display())]
    File { file: PathBuf, why: String },
    /// There is no server.
    #[error(transparent)]
    Connect(ClientError),
    /// The server refused it.
    #[error("{} was not stored: {source}", .file.display())]
    Refused { file: PathBuf, source: ClientError },
}

#[derive(Serialize)]
struct Row {
    file: String,
    kind: &'static str,
    id: String,
    name: String,
    degree: u32,
    volume_m3: Option<f64>,
    created: bool,
}

/// Stores the files and prints what the server has.
///
/// # Errors
/// The first file that could not be stored, and why.
pub(super) fn run(args: &PushArgs) -> Result<(), Box<dyn Error>> {
    let rows = push(&args.server, &args.files)?;
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        table(&mut out, &rows)?;
    }
    Ok(())
}

/// Stores files in a running server, for `sublevel fit --group`. All are checked before the first
/// is sent.
///
/// # Errors
/// The first file that could not be stored; those before it are.
#[cfg(feature = "fit")]
pub(super) fn store(server: &str, files: &[PathBuf]) -> Result<(), Box<dyn Error>> {
    push(server, files)?;
    Ok(())
}

fn push(server: &str, files: &[PathBuf]) -> Result<Vec<Row>, Box<dyn Error>> {
    let contents = files.iter().map(|file| read(file)).collect::<Result<Vec<_>, _>>()?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let rows = runtime.block_on(async {
        let client =
            Client::connect_with(server, &ClientOptions::from_environment()).await.map_err(PushError::Connect)?;
        let mut rows = Vec::with_capacity(files.len());
        for (file, text) in files.iter().zip(contents) {
            let stored = client.create_from_file(text).await;
            let stored = stored.map_err(|source| PushError::Refused { file: file.clone(), source })?;
            rows.push(row(file, stored));
        }
        Ok::<_, PushError>(rows)
    })?;
    Ok(rows)
}

fn read(file: &Path) -> Result<String, PushError> {
    let text = std::fs::read_to_string(file).map_err(|source| PushError::Read { file: file.into(), source })?;
    Geometry::from_json(&text).map_err(|error| PushError::File { file: file.into(), why: error.to_string() })?;
    Ok(text)
}

fn row(file: &Path, stored: StoredBody) -> Row {
    let StoredBody { id, name, kind, degree, volume_m3, created } = stored;
    Row { file: file.display().to_string(), kind, id: id.to_string(), name, degree, volume_m3, created }
}

fn table(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    let width = |title: &str, text: fn(&Row) -> usize| rows.iter().map(text).max().unwrap_or(0).max(title.len());
    let file = width("file", |row| row.file.chars().count());
    let name = width("name", |row| row.name.chars().count());
    writeln!(out, "{:file$}  {:name$}  kind        degree  volume m3     stored   id", "file", "name")?;
    for row in rows {
        let stored = if row.created { "new" } else { "before" };
        let volume = row.volume_m3.map_or("-".to_owned(), |volume| format!("{volume:.6e}"));
        writeln!(
            out,
            "{:file$}  {:name$}  {:<10}  {:>6}  {volume:<12}  {stored:<7}  {}",
            row.file, row.name, row.kind, row.degree, row.id
        )?;
    }
    Ok(())
}
