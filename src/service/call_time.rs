//! How long a call may take: the deadline of its client, and the budget it asks for.

use std::time::{Duration, Instant};

use tonic::Request;
use tonic::codegen::http;

use super::error::Invalid;

/// When a call ends at the latest.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct CallTime {
    /// Nothing is answered any more.
    pub(super) deadline: Option<Instant>,
    /// What is known is answered.
    pub(super) budget: Option<Instant>,
}

/// The deadline of a call, as an extension of its request.
#[derive(Clone, Copy, Debug)]
pub(super) struct Deadline(pub(super) Instant);

/// Sleeps until an instant; for ever without one.
pub(super) async fn until(instant: Option<Instant>) {
    match instant {
        Some(instant) => tokio::time::sleep_until(instant.into()).await,
        None => std::future::pending().await,
    }
}

/// How long before the client's deadline a call ends: a twentieth of its time, at least and at most
/// this. The client looks at a clock of its own, too, and may say CANCELLED.
const BEFORE_DEADLINE: [Duration; 2] = [Duration::from_millis(1), Duration::from_millis(10)];

impl CallTime {
    /// Of a request that arrives now.
    pub(super) fn of<T>(request: &Request<T>, budget_ms: Option<u32>) -> Result<Self, Invalid> {
        let deadline = request.extensions().get::<Deadline>().map(|deadline| deadline.0);
        Ok(Self { deadline, ..Self::new(budget_ms)? })
    }

    /// The deadline of the client of a call that arrives now.
    pub(super) fn deadline(headers: &http::HeaderMap) -> Option<Instant> {
        let timeout = headers.get("grpc-timeout").and_then(|value| value.to_str().ok()).and_then(timeout)?;
        let [least, most] = BEFORE_DEADLINE;
        Instant::now().checked_add(timeout.saturating_sub((timeout / 20).clamp(least, most)))
    }

    /// Of a message that arrives now, without a deadline.
    pub(super) fn new(budget_ms: Option<u32>) -> Result<Self, Invalid> {
        if budget_ms == Some(0) {
            return Err(Invalid::new("budget_ms", "is 0; send a time above 0, or leave it out"));
        }
        let budget = budget_ms.map(|budget| Instant::now() + Duration::from_millis(budget.into()));
        Ok(Self { deadline: None, budget })
    }
}

/// The header of gRPC: up to eight digits and a unit.
fn timeout(text: &str) -> Option<Duration> {
    let (digits, unit) = text.split_at_checked(text.len().checked_sub(1)?)?;
    if digits.len() > 8 {
        return None;
    }
    let value: u64 = digits.parse().ok()?;
    Some(match unit {
        "H" => Duration::from_secs(value * 3600),
        "M" => Duration::from_secs(value * 60),
        "S" => Duration::from_secs(value),
        "m" => Duration::from_millis(value),
        "u" => Duration::from_micros(value),
        "n" => Duration::from_nanos(value),
        _ => return None,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn timeouts_are_read_as_grpc_writes_them() {
        assert_eq!(timeout("100m"), Some(Duration::from_millis(100)));
        assert_eq!(timeout("3S"), Some(Duration::from_secs(3)));
        assert_eq!(timeout("99999999u"), Some(Duration::from_micros(99_999_999)));
        for bad in ["", "m", "1", "123456789S", "-1S", "1x"] {
            assert_eq!(timeout(bad), None, "{bad}");
        }
    }
}
