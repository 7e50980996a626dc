//! What commands return, and the exit code of the process.

use std::error::Error;
use std::io;
use std::process::ExitCode;

/// What a command returns: whether what it was asked to check holds, or the error to print.
pub type Outcome = Result<bool, Box<dyn Error>>;

/// The exit code of what a command returned, its error printed in one line on standard error.
pub fn exit_code(outcome: Outcome) -> ExitCode {
    match outcome {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        // The reader of the output has closed it: no message would arrive.
        Err(error) if is_broken_pipe(error.as_ref()) => ExitCode::FAILURE,
        Err(error) => {
            // Nothing but standard output gives a bare system error: files are named.
            let place = if error.is::<io::Error>() { "cannot write the output: " } else { "" };
            eprintln!("error: {place}{}", one_line(&error.to_string()));
            ExitCode::FAILURE
        }
    }
}

fn is_broken_pipe(error: &(dyn Error + 'static)) -> bool {
    let mut cause = Some(error);
    while let Some(error) = cause {
        let plain = error.downcast_ref::<io::Error>().map(io::Error::kind);
        let in_json = error.downcast_ref::<serde_json::Error>().and_then(serde_json::Error::io_error_kind);
        if plain.or(in_json) == Some(io::ErrorKind::BrokenPipe) {
            return true;
        }
        cause = error.source();
    }
    false
}

/// One printable line of at most about a thousand characters: messages quote input, which may hold
/// anything.
pub(super) fn one_line(text: &str) -> String {
    const LONGEST: usize = 1000;
    let mut line: String = text
        .chars()
        .take(LONGEST)
        .flat_map(|c| if c.is_control() { c.escape_default().collect() } else { vec![c] })
        .collect();
    if text.chars().nth(LONGEST).is_some() {
        line.push_str(" ...");
    }
    line
}
