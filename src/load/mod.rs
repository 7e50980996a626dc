//! Load on a server in an open loop: calls are begun when they are due, however long earlier ones
//! take, and their time counts from then on. A server that stands still is seen, as its clients
//! would see it.

mod echo;
mod echo_process;
mod process;
mod recorder;
mod recording;
mod report;
mod run;
mod scenario;
mod schedule;
mod watched;

pub use echo::{Echo, echo};
pub use echo_process::EchoProcess;
pub use recorder::Recorder;
pub use recording::{RecordedCall, RecordingError};
pub use report::{Latency, LoadReport, RateReport};
pub use run::{LoadError, LoadOptions, Prepared, connect, measure, prepare};
pub use scenario::{Scenario, ScenarioError, Share};
pub use schedule::Arrivals;
pub use watched::{Health, Watched};
