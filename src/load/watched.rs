//! What is looked at beside the calls: whether a server says that it is well, and what it holds.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use serde::Serialize;
use tokio::task::JoinHandle;

use super::process::{cpu_s, memory_mib};
use crate::client::Client;

/// Pause between two probes.
const PAUSE: Duration = Duration::from_millis(20);

/// A server that is looked at.
#[derive(Clone, Debug, Default)]
pub struct Watched {
    /// Its process, if it runs on this machine.
    pub pid: Option<u32>,
    /// A connection of its own for probes, if it answers these.
    pub probe: Option<Client>,
}

impl Watched {
    /// Seconds that the server has worked, and this process.
    pub(super) fn worked(&self) -> [Option<f64>; 2] {
        [self.pid.map(Some), Some(None)].map(|pid| pid.and_then(cpu_s))
    }

    /// Memory of the server, MiB.
    pub(super) fn memory_mib(&self) -> Option<f64> {
        self.pid.and_then(memory_mib)
    }
}

/// Probes of a server, one after the other, until they are dropped.
#[derive(Debug)]
pub(super) struct Probes {
    answered: Arc<Mutex<Health>>,
    asking: JoinHandle<()>,
}

/// What a server has said of itself.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Health {
    /// Longest time that it took to say that it is well, milliseconds.
    pub longest_ms: f64,
    /// Probes that it did not answer so.
    pub failed: u64,
}

impl Probes {
    pub(super) fn start(client: Client) -> Self {
        let answered = Arc::<Mutex<Health>>::default();
        let kept = answered.clone();
        let asking = tokio::spawn(async move {
            loop {
                let begun = Instant::now();
                let is_well = client.health().await.unwrap_or(false);
                let took_ms = 1e3 * begun.elapsed().as_secs_f64();
                {
                    let mut health = kept.lock().unwrap_or_else(PoisonError::into_inner);
                    if is_well {
                        health.longest_ms = health.longest_ms.max(took_ms);
                    } else {
                        health.failed += 1;
                    }
                }
                tokio::time::sleep(PAUSE).await;
            }
        });
        Self { answered, asking }
    }

    /// So far.
    pub(super) fn health(&self) -> Health {
        *self.answered.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Drop for Probes {
    fn drop(&mut self) {
        self.asking.abort();
    }
}
