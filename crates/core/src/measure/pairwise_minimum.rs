//! The least answer of all parts, or pairs of parts: measures of solids with several parts from
//! those of convex bodies.
//!
//! Distance, level distance and growth distance of unions are the least of those of the pairs of
//! parts. How deep unions overlap is another matter: a translation has to take all pairs apart at
//! once ([`crate::measure::signed::separating_translation`]).

use crate::body::{NodeContent, PartNode};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::measure::warm::WarmStart;
use nalgebra::{Matrix3, Vector3};

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

/// The best answer so far of those that have been looked at.
struct Incumbent<T> {
    best: T,
    parts: (usize, usize),
    iterations: u32,
    /// Least lower bound of all others.
    rival: f64,
}

impl<T: Bracketed> Incumbent<T> {
    fn new(first: T, parts: (usize, usize)) -> Self {
        let iterations = first.iterations();
        Self { best: first, parts, iterations, rival: f64::INFINITY }
    }

    fn upper(&self) -> f64 {
        self.best.bracket()[1]
    }

    /// Takes an answer if it is the best so far, with its hint.
    fn take(&mut self, found: T, parts: (usize, usize), hint: &WarmStart, warm: &mut WarmStart) {
        self.iterations += found.iterations();
        let [lower, upper] = self.best.bracket();
        if found.bracket()[1] < upper {
            self.rival = self.rival.min(lower);
            (self.best, self.parts, *warm) = (found, parts, *hint);
        } else {
            self.rival = self.rival.min(found.bracket()[0]);
        }
    }

    fn least(self, warm: &mut WarmStart) -> Least<T> {
        let Self { best, parts, iterations, rival } = self;
        warm.parts = (parts.0 as u16, parts.1 as u16);
        let [lower, upper] = best.bracket();
        Least { best, parts, lower: lower.min(rival), tied: rival <= upper, iterations }
    }
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
    let first = of_last_answer(warm, (len_a, len_b))
        .unwrap_or_else(|| pairs().min_by(|p, q| bound(*p).total_cmp(&bound(*q))).unwrap_or((0, 0)));
    let mut known = Incumbent::new(solve(first, f64::INFINITY, warm), first);
    for pair in pairs().filter(|pair| *pair != first) {
        let upper = known.upper();
        if upper <= enough {
            break;
        }
        if bound(pair) > upper {
            continue;
        }
        let mut hint = WarmStart::default();
        let found = solve(pair, upper, &mut hint);
        known.take(found, pair, &hint, warm);
    }
    known.least(warm)
}

/// The same for the distance, by trees of balls: pairs of nodes whose balls are farther apart than
/// the best upper bound are left out with all of their parts, nearer ones come first.
pub(in crate::measure) fn nearest<T: Bracketed>(
    balls: &TreePair<'_>,
    enough: f64,
    warm: &mut WarmStart,
    mut solve: impl FnMut((usize, usize), f64, &mut WarmStart) -> T,
) -> Least<T> {
    let first = of_last_answer(warm, balls.parts()).unwrap_or_else(|| balls.descend());
    let mut known = Incumbent::new(solve(first, f64::INFINITY, warm), first);
    let mut stack = [(0.0, 0, 0); STACK];
    let mut height = 1;
    while height > 0 && known.upper() > enough {
        height -= 1;
        let (gap, i, j) = stack[height];
        if gap > known.upper() {
            continue;
        }
        match balls.divided(i, j) {
            Divided::Parts(pair) if pair != first => {
                let mut hint = WarmStart::default();
                let found = solve(pair, known.upper(), &mut hint);
                known.take(found, pair, &hint, warm);
            }
            Divided::Parts(_) => {}
            // The nearer one on top.
            Divided::Nodes([near, far]) => {
                for (i, j, gap) in [far, near] {
                    if gap <= known.upper() {
                        stack[height] = (gap, i, j);
                        height += 1;
                    }
                }
            }
        }
    }
    known.least(warm)
}

/// The parts of the last answer, if there was one of these solids; else `warm` is cold.
fn of_last_answer(warm: &mut WarmStart, (len_a, len_b): (usize, usize)) -> Option<(usize, usize)> {
    let parts = (usize::from(warm.parts.0), usize::from(warm.parts.1));
    if warm.is_cold() || parts.0 >= len_a || parts.1 >= len_b {
        *warm = WarmStart::default();
        return None;
    }
    Some(parts)
}

/// Most pairs of nodes that wait: each division adds one, and trees of 256 parts, halved, are nine
/// nodes high.
const STACK: usize = 2 * (u16::BITS as usize) + 2;

/// Trees of balls around the parts of two solids, where they stand.
pub(in crate::measure) struct TreePair<'a> {
    a: &'a [PartNode],
    b: &'a [PartNode],
    /// From B's frame to A's.
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
}

/// What a pair of nodes is made of.
enum Divided {
    /// Parts of A and of B.
    Parts((usize, usize)),
    /// Pairs of nodes with the gaps of their balls, the nearer one first.
    Nodes([(usize, usize, f64); 2]),
}

impl<'a> TreePair<'a> {
    /// A solid without a tree is one node.
    pub(in crate::measure) fn new((a, pose_a): At<'a, [PartNode]>, (b, pose_b): At<'a, [PartNode]>) -> Self {
        let inverse = pose_a.rotation().to_rotation_matrix().transpose().into_inner();
        let rotation = inverse * pose_b.rotation().to_rotation_matrix().into_inner();
        Self { a, b, rotation, translation: inverse * (pose_b.translation() - pose_a.translation()) }
    }

    /// How many parts there are.
    fn parts(&self) -> (usize, usize) {
        (self.a.len().div_ceil(2), self.b.len().div_ceil(2))
    }

    /// Lower bound of the distance of what is in two nodes, metres.
    fn gap(&self, i: usize, j: usize) -> f64 {
        let (ball_a, ball_b) = (&self.a[i].ball, &self.b[j].ball);
        let apart = (self.rotation * ball_b.center + self.translation - ball_a.center).norm();
        let size = apart + ball_a.radius + ball_b.radius + ball_a.center.norm() + ball_b.center.norm();
        apart - ball_a.radius - ball_b.radius - (RELATIVE_ERROR + CULLING_SLACK) * (size + self.translation.norm())
    }

    fn divided(&self, i: usize, j: usize) -> Divided {
        let (a, b) = (&self.a[i], &self.b[j]);
        let nodes = match (a.content, b.content) {
            (NodeContent::Part(part_a), NodeContent::Part(part_b)) => {
                return Divided::Parts((part_a.into(), part_b.into()));
            }
            // The larger one is divided.
            (NodeContent::Nodes(nodes), NodeContent::Part(_)) => nodes.map(|node| (usize::from(node), j)),
            (NodeContent::Nodes(nodes), NodeContent::Nodes(_)) if a.ball.radius >= b.ball.radius => {
                nodes.map(|node| (usize::from(node), j))
            }
            (_, NodeContent::Nodes(nodes)) => nodes.map(|node| (i, usize::from(node))),
        };
        let [first, second] = nodes.map(|(i, j)| (i, j, self.gap(i, j)));
        Divided::Nodes(if first.2 <= second.2 { [first, second] } else { [second, first] })
    }

    /// The parts that nearer balls lead to.
    fn descend(&self) -> (usize, usize) {
        let (mut i, mut j) = (0, 0);
        loop {
            match self.divided(i, j) {
                Divided::Parts(pair) => return pair,
                Divided::Nodes([near, _]) => (i, j) = (near.0, near.1),
            }
        }
    }
}
