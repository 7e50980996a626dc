//! The least answer of all pairs of parts.

use crate::body::Body;
use crate::measure::distance::Distance;
use crate::measure::growth::GrowthDistance;
use crate::measure::level::LevelDistance;
use crate::measure::penetration::Penetration;
use crate::measure::signed::SignedDistance;
use crate::measure::warm::WarmStart;

/// What can be least: an answer about two bodies with its bracket.
pub(super) trait Answer {
    fn bracket(&self) -> [f64; 2];
    fn iterations(&self) -> u32;
}

macro_rules! answer {
    ($($measure:ty),*) => {$(
        impl Answer for $measure {
            fn bracket(&self) -> [f64; 2] {
                [self.lower, self.upper]
            }

            fn iterations(&self) -> u32 {
                self.iterations
            }
        }
    )*};
}

answer!(Distance, GrowthDistance, LevelDistance, SignedDistance);

/// A depth counts as a negative distance.
impl Answer for Penetration {
    fn bracket(&self) -> [f64; 2] {
        [-self.upper, -self.lower]
    }

    fn iterations(&self) -> u32 {
        self.iterations
    }
}

/// The least of the answers, by their upper bounds, and what the others say of it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Least<T> {
    pub(super) best: T,
    /// Proven lower bound of all.
    pub(super) lower: f64,
    /// Whether the bracket of another pair meets that of the best: it may be the least as well.
    pub(super) tied: bool,
    /// Of all pairs together.
    pub(super) iterations: u32,
}

/// Solves for the pairs of parts one by one, but for those whose `bound`, a cheap lower bound, exceeds the best upper bound;
/// ends early with an upper bound of at most `enough`. The bracket of the minimum is the minimum of the brackets.
///
/// The pair of the last answer comes first, or that of the lowest bound: the smaller the first answer, the fewer of the
/// others need be looked at. `solve` is told the best upper bound: beyond it an answer does not count.
pub(super) fn least<T: Answer>(
    (a, b): (&[Body], &[Body]),
    bound: impl Fn(&Body, &Body) -> f64,
    enough: f64,
    warm: &mut WarmStart,
    mut solve: impl FnMut((usize, usize), f64, &mut WarmStart) -> T,
) -> Least<T> {
    let pairs = || (0..a.len()).flat_map(|i| (0..b.len()).map(move |j| (i, j)));
    let bound = |(i, j): (usize, usize)| bound(&a[i], &b[j]);
    let mut first = (usize::from(warm.parts.0), usize::from(warm.parts.1));
    if warm.is_cold() || first.0 >= a.len() || first.1 >= b.len() {
        first = pairs().min_by(|p, q| bound(*p).total_cmp(&bound(*q))).unwrap_or((0, 0));
        *warm = WarmStart::default();
    }
    let mut best = solve(first, f64::INFINITY, warm);
    warm.parts = (first.0 as u16, first.1 as u16);
    let (mut iterations, mut rival) = (best.iterations(), f64::INFINITY);
    for pair in pairs().filter(|pair| *pair != first) {
        let [lower, upper] = best.bracket();
        if upper <= enough {
            break;
        }
        if bound(pair) > upper {
            continue;
        }
        let mut hint = WarmStart::default();
        let found = solve(pair, upper, &mut hint);
        iterations += found.iterations();
        if found.bracket()[1] < upper {
            rival = rival.min(lower);
            best = found;
            *warm = hint;
            warm.parts = (pair.0 as u16, pair.1 as u16);
        } else {
            rival = rival.min(found.bracket()[0]);
        }
    }
    let [lower, upper] = best.bracket();
    Least { best, lower: lower.min(rival), tied: rival <= upper, iterations }
}
