//! Calls as they were made, to be made again: a file with one JSON object a line.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};

use bytes::Bytes;
use serde::{Deserialize, Serialize};

/// A question of a recording.
#[derive(Clone, Debug, PartialEq)]
pub struct RecordedCall {
    /// When it was made, seconds after the recording began.
    pub at_s: f64,
    /// Such as `QueryService/Evaluate`.
    pub call: String,
    /// Its message, as protobuf writes it.
    pub message: Bytes,
}

/// Questions that are recorded; they change nothing, so they may be asked again.
pub(super) const QUESTIONS: [&str; 4] =
    ["QueryService/CastRays", "QueryService/CheckStates", "QueryService/Clearance", "QueryService/Evaluate"];

/// Why there is no recording.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    /// The file cannot be read.
    #[error("{}: {source}; name a file that `sublevel record` has written", path.display())]
    File {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// It says something else.
    #[error("{}: line {line} {why}; record the calls again", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// The line, from 1.
        line: usize,
        /// The reason.
        why: String,
    },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    at_s: f64,
    call: String,
    /// Hexadecimal digits.
    message: String,
}

impl RecordedCall {
    /// Its line of the file, with the end of the line.
    pub(super) fn line(&self) -> String {
        let mut message = String::with_capacity(2 * self.message.len());
        for byte in &self.message {
            // Writing to a string cannot fail.
            let _ = write!(message, "{byte:02x}");
        }
        let line = Line { at_s: self.at_s, call: self.call.clone(), message };
        // A number and strings: they can be written.
        serde_json::to_string(&line).unwrap_or_default() + "\n"
    }

    fn of_line(line: &str) -> Result<Self, String> {
        let Line { at_s, call, message } =
            serde_json::from_str(line).map_err(|error| format!("is no call: {error}"))?;
        if !QUESTIONS.contains(&call.as_str()) {
            return Err(format!("has the call \"{call}\", which is none of {}", QUESTIONS.join(", ")));
        }
        let digits = message.as_bytes();
        if !digits.len().is_multiple_of(2) || !digits.iter().all(u8::is_ascii_hexdigit) {
            return Err("has a message that is not made of hexadecimal digits".into());
        }
        let byte = |pair: &[u8]| -> u8 {
            pair.iter().fold(0, |byte, digit| byte << 4 | (*digit as char).to_digit(16).unwrap_or(0) as u8)
        };
        Ok(Self { at_s, call, message: digits.chunks(2).map(byte).collect() })
    }

    /// Reads a recording.
    ///
    /// # Errors
    /// A file that cannot be read, the first line that is no call, and a file without calls.
    pub fn read(path: &Path) -> Result<Vec<Self>, RecordingError> {
        let text =
            std::fs::read_to_string(path).map_err(|source| RecordingError::File { path: path.to_owned(), source })?;
        let refused = |line: usize, why: String| RecordingError::Content { path: path.to_owned(), line, why };
        let calls: Result<Vec<_>, _> = text
            .lines()
            .enumerate()
            .map(|(index, line)| Self::of_line(line).map_err(|why| refused(index + 1, why)))
            .collect();
        let calls = calls?;
        if calls.is_empty() { Err(refused(1, "is missing".into())) } else { Ok(calls) }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_call_is_read_as_it_was_written() {
        let dir = tempfile::tempdir().expect("a directory");
        let path = dir.path().join("calls.jsonl");
        let call = |index: u8| RecordedCall {
            at_s: 0.25 * f64::from(index),
            call: QUESTIONS[usize::from(index)].into(),
            message: (0..=255).rev().take(usize::from(index) * 100).collect(),
        };
        let calls: Vec<_> = (0..4).map(call).collect();
        std::fs::write(&path, calls.iter().map(RecordedCall::line).collect::<String>()).expect("written");
        assert_eq!(RecordedCall::read(&path).expect("calls"), calls);
        let good = calls[1].line();
        for (text, word) in [
            (String::new(), "line 1 is missing"),
            (format!("{good}{{}}"), "line 2 is no call"),
            (good.replace("CheckStates", "Watch"), "line 1 has the call"),
            (good.replace("\"message\":\"", "\"message\":\"z"), "hexadecimal"),
        ] {
            std::fs::write(&path, &text).expect("written");
            let why = RecordedCall::read(&path).expect_err(&text).to_string();
            assert!(why.contains(word), "{text}: {why}");
        }
        assert!(RecordedCall::read(&dir.path().join("nowhere")).is_err());
    }
}
