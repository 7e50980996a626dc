//! When calls are due.

use std::time::Duration;

/// How calls arrive.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Arrivals {
    /// At equal distances.
    Constant,
    /// Independent of each other: distances are exponentially distributed.
    Poisson,
}

/// Times at which calls are due, from the beginning on.
#[derive(Clone, Debug)]
pub(super) struct Schedule {
    arrivals: Arrivals,
    mean_s: f64,
    next_s: f64,
    random: u64,
}

impl Schedule {
    pub(super) fn new(arrivals: Arrivals, rate_per_s: f64, seed: u64) -> Self {
        Self { arrivals, mean_s: 1.0 / rate_per_s, next_s: 0.0, random: seed }
    }

    /// Uniform in (0, 1], by SplitMix64 (Steele, Lea, Flood 2014).
    pub(super) fn uniform(&mut self) -> f64 {
        self.random = self.random.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11).wrapping_add(1) as f64 / (1_u64 << 53) as f64
    }

    /// When the next call is due.
    pub(super) fn next(&mut self) -> Duration {
        let due = Duration::from_secs_f64(self.next_s);
        self.next_s += match self.arrivals {
            Arrivals::Constant => self.mean_s,
            Arrivals::Poisson => -self.uniform().ln() * self.mean_s,
        };
        due
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn calls_arrive_at_the_rate_that_is_asked_for() {
        for arrivals in [Arrivals::Constant, Arrivals::Poisson] {
            let mut schedule = Schedule::new(arrivals, 500.0, 3);
            let times: Vec<f64> = (0..20_001).map(|_| schedule.next().as_secs_f64()).collect();
            assert!((times[20_000] - 40.0).abs() < 1.0, "{arrivals:?}: {}", times[20_000]);
            let gaps: Vec<f64> = times.windows(2).map(|pair| pair[1] - pair[0]).collect();
            let spread = gaps.iter().map(|gap| (gap - 0.002).powi(2)).sum::<f64>() / gaps.len() as f64;
            // The deviation of an exponential distribution is its mean.
            let expected = if arrivals == Arrivals::Poisson { 0.002 } else { 0.0 };
            assert!((spread.sqrt() - expected).abs() < 1e-4, "{arrivals:?}: {}", spread.sqrt());
        }
    }
}
