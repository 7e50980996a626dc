//! The echo server as a process of its own, so that it has a core of its own.

use std::io::{self, BufRead, BufReader, Write};
use std::path::Path;
use std::process::{Child, Command, Stdio};

use tempfile::NamedTempFile;

use crate::client::ClientOptions;

/// An echo server that runs until it is dropped.
#[derive(Debug)]
pub struct EchoProcess {
    child: Child,
    url: String,
    /// Its certificate, where it is encrypted.
    certificate: Option<NamedTempFile>,
}

impl EchoProcess {
    /// Starts `sublevel`, a program, as an echo server whose answers have so many bytes, encrypted
    /// or not, on one core if that is asked for.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(program: &Path, answer_bytes: usize, encrypted: bool, core: Option<usize>) -> io::Result<Self> {
        let mut command = Command::new(program);
        command.args(["echo", "--answer-bytes", &answer_bytes.to_string()]);
        if encrypted {
            command.arg("--encrypted");
        }
        if let Some(core) = core {
            command.args(["--core", &core.to_string()]);
        }
        // It ends with its standard input, and so with this process.
        let mut child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let stdout = child.stdout.take();
        let mut echo = Self { child, url: String::new(), certificate: None };
        let mut lines = stdout.map(BufReader::new).into_iter().flat_map(BufRead::lines);
        let silent = || io::Error::other("the echo server did not start");
        let addr = lines.next().ok_or_else(silent)??;
        let addr = addr.strip_prefix("listening on ").ok_or_else(silent)?;
        let scheme = if encrypted { "https" } else { "http" };
        echo.url = format!("{scheme}://{addr}");
        if encrypted {
            let mut file = NamedTempFile::new()?;
            loop {
                let line = lines.next().ok_or_else(silent)??;
                writeln!(file, "{line}")?;
                if line.starts_with("-----END") {
                    break;
                }
            }
            echo.certificate = Some(file);
        }
        Ok(echo)
    }

    /// How to connect to it.
    pub fn options(&self) -> ClientOptions {
        let ca = self.certificate.as_ref().map(|file| file.path().to_owned());
        ClientOptions { ca, ..ClientOptions::default() }
    }

    /// Where it is.
    pub fn url(&self) -> &str {
        &self.url
    }

    /// Its process id.
    pub fn pid(&self) -> u32 {
        self.child.id()
    }
}

impl Drop for EchoProcess {
    fn drop(&mut self) {
        // It has nothing to lose.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
