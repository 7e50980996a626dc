//! What a load has shown: numbers, a table, a picture.

use std::collections::BTreeMap;
use std::fmt::Write;

use hdrhistogram::Histogram;
use serde::Serialize;

use super::watched::Health;
use crate::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

/// What came of all rates.
#[derive(Clone, Debug, Serialize)]
pub struct LoadReport {
    /// Name or file of the scenario.
    pub scenario: String,
    /// How calls arrived.
    pub arrivals: &'static str,
    /// Connections that the calls were spread over.
    pub connections: usize,
    /// Whether these were encrypted, those to the echo server, too.
    pub encrypted: bool,
    /// Seconds that were counted, of each rate.
    pub seconds: f64,
    /// Of the server.
    pub server: Vec<RateReport>,
    /// Of an echo server of equal message sizes, at the same rates.
    pub echo: Vec<RateReport>,
}

/// What came of one rate.
#[derive(Clone, Debug, Serialize)]
pub struct RateReport {
    /// Calls that were due, a second.
    pub offered_per_s: f64,
    /// Calls that were answered, a second.
    pub answered_per_s: f64,
    /// Calls that were due.
    pub due: u64,
    /// Calls that were not answered, by gRPC code; `NOT_SENT` where too many were open.
    pub errors: BTreeMap<String, u64>,
    /// Time from when a call was due to its answer, milliseconds.
    pub latency_ms: Latency,
    /// Cores that the client kept busy.
    pub client_cores: Option<f64>,
    /// Cores that the server kept busy, where its process is known.
    pub server_cores: Option<f64>,
    /// Memory of the server at the end, MiB, where its process is known.
    pub server_mib: Option<f64>,
    /// What the server said of itself, asked 50 times a second on a connection of its own; none of
    /// an echo server.
    pub health: Option<Health>,
}

/// Percentiles, milliseconds; 0 where nothing was answered.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Latency {
    /// Half of the calls are as fast.
    pub p50: f64,
    /// 90 % of the calls are as fast.
    pub p90: f64,
    /// 99 % of the calls are as fast.
    pub p99: f64,
    /// 99.9 % of the calls are as fast.
    pub p99_9: f64,
    /// The slowest.
    pub max: f64,
}

impl Latency {
    /// Of a histogram of nanoseconds.
    pub(super) fn of(nanoseconds: &Histogram<u64>) -> Self {
        let at = |quantile| 1e-6 * nanoseconds.value_at_quantile(quantile) as f64;
        Self { p50: at(0.5), p90: at(0.9), p99: at(0.99), p99_9: at(0.999), max: 1e-6 * nanoseconds.max() as f64 }
    }
}

impl LoadReport {
    /// A table for people.
    pub fn table(&self) -> String {
        let mut text = String::from(
            "target  offered/s  answered/s  p50 ms  p90 ms  p99 ms  p99.9 ms  max ms  cores of server, client  \
             server MiB  health ms  errors\n",
        );
        let or_dash = |number: Option<f64>, digits: usize| number.map_or("-".into(), |it| format!("{it:.digits$}"));
        for (target, rates) in [("server", &self.server), ("echo", &self.echo)] {
            for rate in rates {
                let Latency { p50, p90, p99, p99_9, max } = rate.latency_ms;
                let errors: Vec<String> = rate.errors.iter().map(|(code, count)| format!("{count} {code}")).collect();
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "{target:<6}  {:>9.0}  {:>10.0}  {p50:>6.2}  {p90:>6.2}  {p99:>6.2}  {p99_9:>8.2}  {max:>6.1}  \
                     {:>15}, {:>6}  {:>10}  {:>9}  {}",
                    rate.offered_per_s,
                    rate.answered_per_s,
                    or_dash(rate.server_cores, 2),
                    or_dash(rate.client_cores, 2),
                    or_dash(rate.server_mib, 0),
                    match rate.health {
                        Some(Health { failed: 1.., .. }) => "failed".to_owned(),
                        health => or_dash(health.map(|health| health.longest_ms), 1),
                    },
                    if errors.is_empty() { "-".to_owned() } else { errors.join(", ") }
                );
            }
        }
        text
    }

    /// Latency against offered load.
    ///
    /// # Errors
    /// When nothing was answered.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let group = |label: &str, ink, marker, rates: &[RateReport], of: fn(&Latency) -> f64| {
            let point =
                |rate: &RateReport| Point { x: rate.offered_per_s, y: of(&rate.latency_ms), label: String::new() };
            Group { label: label.into(), ink, marker, points: rates.iter().map(point).collect(), joined: true }
        };
        let groups = vec![
            group("server, 50 %", Ink::Blue, Marker::Disc, &self.server, |latency| latency.p50),
            group("server, 99 %", Ink::Orange, Marker::Triangle, &self.server, |latency| latency.p99),
            group("server, 99.9 %", Ink::Purple, Marker::Cross, &self.server, |latency| latency.p99_9),
            group("echo, 50 %", Ink::Grey, Marker::Disc, &self.echo, |latency| latency.p50),
            group("echo, 99 %", Ink::Grey, Marker::Triangle, &self.echo, |latency| latency.p99),
        ];
        Scatter {
            title: format!("{}: latency from when a call was due, {} arrivals", self.scenario, self.arrivals),
            x_label: "calls offered a second".into(),
            y_label: "latency (ms)".into(),
            groups: groups.into_iter().filter(|group| !group.points.is_empty()).collect(),
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}
