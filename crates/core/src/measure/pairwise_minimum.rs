//! The least answer of all parts, or pairs of parts: measures of solids with several parts from
//! those of convex bodies.
//!
//! Distance, level distance and growth distance of unions are the least of those of the pairs of
//! parts. How deep unions overlap is another matter: a translation has to take all pairs apart at
//! once ([`crate::measure::signed::separating_translation`]).

use crate::body::{Ball, Solid};
use crate::measure::frames::pose::Pose;
use crate::measure::other_parts::Recalled;
use crate::measure::part_pairs::{NodeBound, TreePair, count, nodes, only_node};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::warm::{Hint, WarmStart};
use nalgebra::Vector3;

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
    /// Proven lower bound of all; after an early end with an upper bound that meets the goal, of
    /// those that were looked at only.
    pub(in crate::measure) lower: f64,
    /// The same of all but `best`; minus infinity after an early end.
    pub(in crate::measure) others: f64,
    /// Whether that is what was known of them before.
    pub(in crate::measure) is_recalled: bool,
    /// Whether the bracket of another pair meets that of the best: it may be the least as well.
    pub(in crate::measure) tied: bool,
    /// Of all pairs together.
    pub(in crate::measure) iterations: u32,
}

/// The best answer so far of those that have been looked at.
struct Incumbent<T> {
    best: T,
    parts: (usize, usize),
    iterations: u32,
    /// Least lower bound of all others that were looked at.
    rival: f64,
    /// Whether all others were looked at.
    all: bool,
    /// Whether that was known before.
    is_recalled: bool,
}

impl<T: Bracketed> Incumbent<T> {
    fn new(first: T, parts: (usize, usize)) -> Self {
        let iterations = first.iterations();
        Self { best: first, parts, iterations, rival: f64::INFINITY, all: false, is_recalled: false }
    }

    fn upper(&self) -> f64 {
        self.best.bracket()[1]
    }

    /// Takes an answer if it is the best so far, with its hint.
    fn take(&mut self, found: T, parts: (usize, usize), hint: Hint, warm: &mut WarmStart) {
        self.iterations += found.iterations();
        let [lower, upper] = self.best.bracket();
        if found.bracket()[1] < upper {
            self.rival = self.rival.min(lower);
            (self.best, self.parts, warm.hint) = (found, parts, hint);
        } else {
            self.rival = self.rival.min(found.bracket()[0]);
        }
    }

    fn least(self, warm: &mut WarmStart) -> Least<T> {
        let Self { best, parts, iterations, rival, all, is_recalled } = self;
        warm.parts = (parts.0 as u16, parts.1 as u16);
        if !is_recalled {
            warm.others = None;
        }
        let [lower, upper] = best.bracket();
        let others = if all { rival } else { f64::NEG_INFINITY };
        Least { best, parts, lower: lower.min(rival), others, is_recalled, tied: rival <= upper, iterations }
    }
}

/// Solves for pairs of parts, the likeliest first, but for those whose bound exceeds the best upper
/// bound, or what the goal asks no more about; ends early with an upper bound that meets the goal.
/// The bracket of the minimum is the minimum of the brackets.
///
/// The pair of the last answer comes first, or that to which the trees lead: the smaller the first
/// answer, the fewer of the others need be looked at. `warm` is left with the hint and the parts of
/// the least. `solve` is given how far it matters: beyond that an answer does not count. `others`
/// is what is known of all pairs but that of the last answer.
pub(in crate::measure) fn nearest<T: Bracketed, F: Fn(usize, usize) -> NodeBound>(
    trees: &TreePair<'_, F>,
    goal: &StopCriterion,
    others: Recalled,
    warm: &mut WarmStart,
    mut solve: impl FnMut((usize, usize), f64, &mut WarmStart) -> T,
) -> Least<T> {
    let last = of_last_answer(warm, trees.parts());
    let first = last.unwrap_or_else(|| trees.likeliest());
    count::solved();
    let mut known = Incumbent::new(solve(first, f64::INFINITY, warm), first);
    if last.is_some() && others.lower > known.upper().min(goal.far) {
        (known.rival, known.all, known.is_recalled) = (others.lower, true, true);
        return known.least(warm);
    }
    let mut walk = trees.walk();
    while known.upper() > goal.near {
        let Some(pair) = walk.next(known.upper().min(goal.far) + others.margin) else {
            known.all = true;
            break;
        };
        if pair == first {
            continue;
        }
        let mut hint = WarmStart::default();
        count::solved();
        let found = solve(pair, known.upper() + others.margin, &mut hint);
        known.take(found, pair, hint.hint, warm);
    }
    known.rival = known.rival.min(walk.left_out);
    known.least(warm)
}

/// The same for the parts of one solid, with a bound of the measure for all that is in a ball of
/// its frame.
pub(in crate::measure) fn nearest_part<T: Bracketed>(
    solid: &impl Solid,
    bound: impl Fn(&Ball) -> f64,
    goal: &StopCriterion,
    warm: &mut WarmStart,
    mut solve: impl FnMut(usize, f64, &mut WarmStart) -> T,
) -> Least<T> {
    let own = only_node(solid.circumscribed());
    let (nodes, other) = (nodes(solid, &own), only_node(&Ball { center: Vector3::zeros(), radius: 0.0 }));
    let trees = TreePair::new(nodes, &other, |i, _| NodeBound::of(bound(&nodes[i].ball)));
    nearest(&trees, goal, Recalled::NOTHING, warm, |(i, _), upper, hint| solve(i, upper, hint))
}

/// The parts of the last answer, if there was one of these solids; else `warm` is cold.
fn of_last_answer(warm: &mut WarmStart, (len_a, len_b): (usize, usize)) -> Option<(usize, usize)> {
    let parts = (usize::from(warm.parts.0), usize::from(warm.parts.1));
    if warm.is_cold() || parts.0 >= len_a || parts.1 >= len_b {
        warm.hint = Hint::Cold;
        return None;
    }
    Some(parts)
}
