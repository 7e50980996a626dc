//! The echo server as a process of its own, so that it has a core of its own.

use std::io::{self, BufRead, BufReader};
use std::process::{Child, Command, Stdio};

/// An echo server that runs until it is dropped.
#[derive(Debug)]
pub struct EchoProcess {
    child: Child,
    url: String,
}

impl EchoProcess {
    /// Starts this program as an echo server whose answers have so many bytes, on one core if that
    /// is asked for.
    ///
    /// # Errors
    /// When it cannot be started.
    pub fn start(answer_bytes: usize, core: Option<usize>) -> io::Result<Self> {
        let mut command = Command::new(std::env::current_exe()?);
        command.args(["echo", "--answer-bytes", &answer_bytes.to_string()]);
        if let Some(core) = core {
            command.args(["--core", &core.to_string()]);
        }
        // It ends with its standard input, and so with this process.
        let child = command.stdin(Stdio::piped()).stdout(Stdio::piped()).spawn()?;
        let mut echo = Self { child, url: String::new() };
        let mut line = String::new();
        if let Some(stdout) = echo.child.stdout.take() {
            BufReader::new(stdout).read_line(&mut line)?;
        }
        let addr = line.trim().strip_prefix("listening on ");
        echo.url = format!("http://{}", addr.ok_or_else(|| io::Error::other("the echo server did not start"))?);
        Ok(echo)
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
