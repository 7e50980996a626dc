//! The least answer of all parts, or pairs of parts: measures of solids with several parts from
//! those of convex bodies.
//!
//! Distance, level distance and growth distance of unions are the least of those of the pairs of
//! parts. How deep unions overlap is another matter: a translation has to take all pairs apart at
//! once ([`crate::measure::signed::separating_translation`]).

use crate::measure::frames::pose::Pose;
use crate::measure::warm::WarmStart;

/// A part or a solid with its pose.
pub(in crate::measure) type At<'a, T> = (&'a T, &'a Pose);

/// What can be least: an answer about one or two bodies with its bracket.
pub(in crate::measure) trait Bracketed {
    /// Lower and upper bound of what is to be least.
    fn bracket(&self) -> [f64; 2];
    fn iterations(&self) -> u32;
}

/// Answers whose fields are `lower`, `upper` and `iterations`.
macro_rules! bracketed {
    ($measure:ty) => {
        impl crate::measure::pairwise_minimum::Bracketed for $measure {
            fn bracket(&self) -> [f64; 2] {
                [self.lower, self.upper]
            }

            fn iterations(&self) -> u32 {
                self.iterations
            }
        }
    };
}
pub(in crate::measure) use bracketed;

/// The least of the answers, by their upper bounds, and what the others say of it.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Least<T> {
    pub(in crate::measure) best: T,
    /// The parts that `best` is about.
    pub(in crate::measure) parts: (usize, usize),
    /// Proven lower bound of all.
    pub(in crate::measure) lower: f64,
    /// Whether the bracket of another pair meets that of the best: it may be the least as well.
    pub(in crate::measure) tied: bool,
    /// Of all pairs together.
    pub(in crate::measure) iterations: u32,
}

/// Solves for the pairs of this many parts one by one, but for those whose `bound`, a cheap lower
/// bound, exceeds the best upper bound; ends early with an upper bound of at most `enough`. The
/// bracket of the minimum is the minimum of the brackets.
///
/// The pair of the last answer comes first, or that of the lowest bound: the smaller the first
/// answer, the fewer of the others need be looked at. `warm` is left with the hint and the parts of
/// the least. `solve` is given the best upper bound: beyond it an answer does not count.
pub(in crate::measure) fn least<T: Bracketed>(
    (len_a, len_b): (usize, usize),
    bound: impl Fn((usize, usize)) -> f64,
    enough: f64,
    warm: &mut WarmStart,
    mut solve: impl FnMut((usize, usize), f64, &mut WarmStart) -> T,
) -> Least<T> {
    let pairs = || (0..len_a).flat_map(|i| (0..len_b).map(move |j| (i, j)));
    let mut first = (usize::from(warm.parts.0), usize::from(warm.parts.1));
    if warm.is_cold() || first.0 >= len_a || first.1 >= len_b {
        first = pairs().min_by(|p, q| bound(*p).total_cmp(&bound(*q))).unwrap_or((0, 0));
        *warm = WarmStart::default();
    }
    let (mut best, mut parts) = (solve(first, f64::INFINITY, warm), first);
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
            (best, parts) = (found, pair);
            *warm = hint;
        } else {
            rival = rival.min(found.bracket()[0]);
        }
    }
    warm.parts = (parts.0 as u16, parts.1 as u16);
    let [lower, upper] = best.bracket();
    Least { best, parts, lower: lower.min(rival), tied: rival <= upper, iterations }
}
