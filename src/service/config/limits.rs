//! Limits of connections and calls that operators set. What one call may ask for is fixed, see
//! [`crate::service::limits`].

use std::time::Duration;

use serde::{Deserialize, Serialize};

use super::error::ConfigError;

/// Limits of connections and calls.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct LimitsConfig {
    /// Connections open at once; further ones wait in the system. Each takes a file descriptor.
    pub connections: usize,
    /// Calls of one connection at once; clients queue further ones.
    pub calls_per_connection: u32,
    /// Calls at once. Each may hold a message in both directions; further ones wait unread.
    pub calls: usize,
    /// Longest time that a call waits for its place, milliseconds; then it is refused with
    /// RESOURCE_EXHAUSTED and may be tried again.
    pub queue_ms: u64,
    /// Longest time from the start of a call to its answer, seconds.
    pub call_s: f64,
    /// Silence after which a connection is asked for a sign of life, seconds.
    pub keepalive_s: f64,
    /// Time to give the sign of life, seconds; then the connection is closed.
    pub keepalive_timeout_s: f64,
    /// Age at which a connection is asked to end, seconds, so that clients spread over new servers;
    /// 0: never.
    pub connection_age_s: f64,
    /// Time that calls have to end after that, and after a stop was asked for, seconds.
    pub drain_s: f64,
    /// Threads that answer questions; 0: one per core.
    pub solver_threads: usize,
}

impl Default for LimitsConfig {
    fn default() -> Self {
        Self {
            connections: 512,
            calls_per_connection: 32,
            calls: 64,
            queue_ms: 5000,
            call_s: 120.0,
            keepalive_s: 30.0,
            keepalive_timeout_s: 10.0,
            connection_age_s: 0.0,
            drain_s: 5.0,
            solver_threads: 0,
        }
    }
}

impl LimitsConfig {
    pub(super) fn check(&self) -> Result<(), ConfigError> {
        let whole = [
            ("connections", self.connections, 1, 1 << 20),
            ("calls_per_connection", self.calls_per_connection as usize, 1, 1 << 16),
            ("calls", self.calls, 1, 1 << 16),
            ("solver_threads", self.solver_threads, 0, 4096),
        ];
        for (key, value, least, most) in whole {
            if !(least..=most).contains(&value) {
                return refused(key, &value, &format!("a whole number from {least} to {most}"));
            }
        }
        if !(1..=600_000).contains(&self.queue_ms) {
            return refused("queue_ms", &self.queue_ms, "milliseconds from 1 to 600000");
        }
        let seconds = [
            ("call_s", self.call_s, 0.001),
            ("keepalive_s", self.keepalive_s, 1.0),
            ("keepalive_timeout_s", self.keepalive_timeout_s, 0.1),
            ("connection_age_s", self.connection_age_s, 0.0),
            ("drain_s", self.drain_s, 0.0),
        ];
        for (key, value, least) in seconds {
            // Not `<`: a NaN is refused too.
            if !(value >= least && value <= 1e6) {
                return refused(key, &value, &format!("seconds from {least} to 1e6"));
            }
        }
        Ok(())
    }

    /// See [`LimitsConfig::queue_ms`].
    pub fn queue(&self) -> Duration {
        Duration::from_millis(self.queue_ms)
    }

    /// See [`LimitsConfig::call_s`].
    pub fn call(&self) -> Duration {
        Duration::from_secs_f64(self.call_s)
    }

    /// See [`LimitsConfig::keepalive_s`] and [`LimitsConfig::keepalive_timeout_s`].
    pub fn keepalive(&self) -> [Duration; 2] {
        [self.keepalive_s, self.keepalive_timeout_s].map(Duration::from_secs_f64)
    }

    /// See [`LimitsConfig::connection_age_s`].
    pub fn connection_age(&self) -> Option<Duration> {
        (self.connection_age_s > 0.0).then(|| Duration::from_secs_f64(self.connection_age_s))
    }

    /// See [`LimitsConfig::drain_s`].
    pub fn drain(&self) -> Duration {
        Duration::from_secs_f64(self.drain_s)
    }

    /// See [`LimitsConfig::solver_threads`].
    pub fn threads(&self) -> usize {
        match self.solver_threads {
            0 => std::thread::available_parallelism().map_or(1, usize::from),
            threads => threads,
        }
    }
}

fn refused(key: &str, value: &dyn std::fmt::Display, accepted: &str) -> Result<(), ConfigError> {
    Err(ConfigError::Setting { key: format!("limits.{key}"), why: format!("is {value}; give {accepted}") })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_cannot_be_a_limit_is_refused_by_name() {
        let of = |change: &dyn Fn(&mut LimitsConfig)| {
            let mut limits = LimitsConfig::default();
            change(&mut limits);
            limits.check().expect_err("refused").to_string()
        };
        assert!(LimitsConfig::default().check().is_ok());
        assert!(of(&|limits| limits.calls = 0).contains("limits.calls is 0"));
        assert!(of(&|limits| limits.queue_ms = 0).contains("limits.queue_ms"));
        assert!(of(&|limits| limits.call_s = f64::NAN).contains("limits.call_s is NaN"));
        assert!(of(&|limits| limits.keepalive_s = 0.5).contains("limits.keepalive_s"));
        assert!(of(&|limits| limits.drain_s = -1.0).contains("limits.drain_s"));
    }
}
