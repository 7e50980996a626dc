//! `sublevel backup` and `sublevel restore`.

use std::error::Error;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::PathBuf;
use std::time::Duration;

use crate::client::{Client, ClientOptions};
use crate::robot::counted;
use crate::store::{self, Counts};

/// Copy the catalogue of a running server into a file
///
/// Bodies, scenes and fit jobs as they are at one moment; the server goes on meanwhile. Where the
/// server asks for tokens, one with the role admin is needed (SUBLEVEL_TOKEN).
///
/// Example: sublevel backup --server http://127.0.0.1:50051 --out sublevel-2026-11-25.redb
#[derive(Debug, clap::Args)]
pub(super) struct BackupArgs {
    /// Address of the server
    #[arg(long, value_name = "URL", default_value = "http://127.0.0.1:50051")]
    server: String,
    /// File to write; it is there whole or not at all
    #[arg(long, value_name = "FILE")]
    out: PathBuf,
}

/// Make the catalogue of a server that does not run yet out of a backup
///
/// Everything in the backup is read and proven first; a directory that has a catalogue is refused.
///
/// Example: sublevel restore sublevel-2026-11-25.redb --data sublevel-data
#[derive(Debug, clap::Args)]
pub(super) struct RestoreArgs {
    /// The backup
    file: PathBuf,
    /// Directory for the server's --data; made when it is not there
    #[arg(long, value_name = "DIR")]
    data: PathBuf,
}

/// Longest time for a piece of a backup.
const PATIENCE: Duration = Duration::from_secs(600);

/// Writes the backup.
///
/// # Errors
/// What the server refuses, and files that cannot be written.
pub(super) fn backup(args: &BackupArgs) -> Result<(), Box<dyn Error>> {
    let named = |error: io::Error| format!("cannot write {}: {error}; choose another --out", args.out.display());
    let dir = args.out.parent().filter(|dir| !dir.as_os_str().is_empty()).unwrap_or(".".as_ref());
    let mut file = tempfile::NamedTempFile::new_in(dir).map_err(named)?;
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let bytes = runtime.block_on(async {
        let options = ClientOptions { patience: PATIENCE, ..ClientOptions::from_environment() };
        let client = Client::connect_with(&args.server, &options).await?;
        client.backup(&mut BufWriter::new(file.as_file_mut())).await
    })?;
    file.as_file().sync_all().map_err(named)?;
    file.persist(&args.out).map_err(|error| named(error.error))?;
    File::open(dir).and_then(|dir| dir.sync_all()).map_err(named)?;
    writeln!(io::stdout().lock(), "{}: {}", args.out.display(), counted(bytes, "byte", "bytes"))?;
    Ok(())
}

/// Makes the catalogue.
///
/// # Errors
/// A directory that has one, and a file that is no backup or is not valid.
pub(super) fn restore(args: &RestoreArgs) -> Result<(), Box<dyn Error>> {
    let Counts { bodies, scenes, .. } = store::restore(&args.file, &args.data)?;
    let (bodies, scenes) = (counted(bodies, "body", "bodies"), counted(scenes, "scene", "scenes"));
    writeln!(io::stdout().lock(), "{}: {bodies}, {scenes}", args.data.display())?;
    Ok(())
}
