//! `sublevel token`.

use std::error::Error;
use std::io::{self, Write};

use crate::service::{Role, tokens};

/// Make a token for the clients of a server
///
/// Prints the entry for the file that 'sublevel serve --tokens FILE' reads, which contains a hash
/// only, and on standard error the token itself, which is shown once. A client sends it as the
/// metadata 'authorization: Bearer TOKEN'; the commands of sublevel take it from SUBLEVEL_TOKEN.
///
/// Examples:
///   sublevel token planner --role read >> tokens.toml
///   SUBLEVEL_TOKEN=... sublevel scene list --server https://cell.example:50051
#[derive(Debug, clap::Args)]
#[command(verbatim_doc_comment)]
pub(super) struct TokenArgs {
    /// Whose it is; for logs and messages
    name: String,
    /// What it allows: questions (read), also changes (write), also backups (admin)
    #[arg(long, value_name = "ROLE", value_parser = role)]
    role: Role,
}

fn role(text: &str) -> Result<Role, String> {
    match text {
        "read" => Ok(Role::Read),
        "write" => Ok(Role::Write),
        "admin" => Ok(Role::Admin),
        _ => Err("give read, write or admin".into()),
    }
}

/// Prints a new token.
///
/// # Errors
/// When the system has no random numbers, or the output is closed.
pub(super) fn run(args: &TokenArgs) -> Result<(), Box<dyn Error>> {
    if args.name.is_empty() || args.name.chars().any(char::is_control) {
        return Err("the name is empty or holds a control character; give printable characters".into());
    }
    let (token, entry) = tokens::new_entry(&args.name, args.role)?;
    io::stdout().lock().write_all(entry.as_bytes())?;
    writeln!(io::stderr().lock(), "token of {}, shown once: {token}", args.name)?;
    Ok(())
}
