//! Pairs of parts of two solids by their trees: a bound that holds for all parts of two nodes
//! leaves them out together, and the likelier ones come first.

use crate::body::{Ball, Body, NodeContent, PartCenters, PartNode, PartTree, Solid};
use crate::measure::bounds::culling::CULLING_SLACK;
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::FRAC_1_SQRT_2;

/// What is known of a measure of all pairs of parts in two nodes.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct NodeBound {
    /// Proven lower bound.
    pub(in crate::measure) lower: f64,
    /// The smaller, the sooner: it says what is likely where nothing is proven.
    pub(in crate::measure) order: f64,
}

impl NodeBound {
    /// A bound that says what is likely as well.
    pub(in crate::measure) fn of(lower: f64) -> Self {
        Self { lower, order: lower }
    }
}

/// The frame of B as seen from that of A.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct SeenFrame {
    rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    /// Length of the translation, metres.
    offset: f64,
}

impl SeenFrame {
    pub(in crate::measure) fn new(pose_a: &Pose, pose_b: &Pose) -> Self {
        let inverse = pose_a.rotation().to_rotation_matrix().transpose().into_inner();
        let rotation = inverse * pose_b.rotation().to_rotation_matrix().into_inner();
        let translation = inverse * (pose_b.translation() - pose_a.translation());
        Self { rotation, translation, offset: translation.norm() }
    }

    /// Lower bound of the distance of two balls, of A and of B, in their frames, metres; minus the
    /// depth where they overlap.
    pub(in crate::measure) fn gap(&self, of_a: &Ball, of_b: &Ball) -> f64 {
        let apart = (self.rotation * of_b.center + self.translation - of_a.center).norm();
        let size = apart + of_a.radius + of_b.radius + of_a.center.norm() + of_b.center.norm();
        apart - of_a.radius - of_b.radius - (RELATIVE_ERROR + CULLING_SLACK) * (size + self.offset)
    }

    /// Upper bound of how far points in a ball of B have moved since B was seen `before`, by A,
    /// metres.
    ///
    /// A point x has moved by `(R' - R) x + t' - t`. The difference of two rotations has singular
    /// values s, s and 0, so that its norm is Frobenius' norm over √2.
    pub(in crate::measure) fn moved_since(&self, before: &Self, Ball { center, radius }: &Ball) -> f64 {
        let turned = self.rotation - before.rotation;
        let size = center.norm() + radius + self.offset + before.offset;
        let moved = (turned * center + self.translation - before.translation).norm();
        // Either rotation may be off by the relative error, and is none by as much.
        moved + turned.norm() * FRAC_1_SQRT_2 * radius + 4.0 * (RELATIVE_ERROR + CULLING_SLACK) * size
    }
}

/// The tree of a single part.
pub(in crate::measure) fn only_node(ball: &Ball) -> [PartNode; 1] {
    [PartNode { ball: *ball, content: NodeContent::Part(0) }]
}

/// The centres of a solid without a tree.
pub(in crate::measure) fn only_centers(parts: &[Body]) -> [PartCenters; 1] {
    [PartCenters::of(&parts[0])]
}

/// The centres of the nodes of a solid: `own`, which are those of its only one, if it has no tree.
pub(in crate::measure) fn centers<'a>(solid: &'a impl Solid, own: &'a [PartCenters; 1]) -> &'a [PartCenters] {
    solid.tree().map_or(&own[..], PartTree::centers)
}

/// The nodes of a solid: `own`, which is its only one, if it has no tree.
pub(in crate::measure) fn nodes<'a>(solid: &'a impl Solid, own: &'a [PartNode; 1]) -> &'a [PartNode] {
    solid.tree().map_or(&own[..], PartTree::nodes)
}

/// Two trees, with a bound for each pair of their nodes, which are given by their positions.
#[derive(Clone, Copy)]
pub(in crate::measure) struct TreePair<'a, F> {
    a: &'a [PartNode],
    b: &'a [PartNode],
    bound: F,
}

/// Two trees, that of B where it is seen from A, with the gaps of their balls: lower bounds of
/// distances, and of minus the depths, of all parts.
pub(in crate::measure) fn ball_gaps<'a>(
    a: &'a [PartNode],
    b: &'a [PartNode],
    seen: SeenFrame,
) -> TreePair<'a, impl Fn(usize, usize) -> NodeBound + use<'a>> {
    TreePair::new(a, b, move |i, j| NodeBound::of(seen.gap(&a[i].ball, &b[j].ball)))
}

/// What a pair of nodes is made of.
enum Divided {
    /// Parts of A and of B.
    Parts((usize, usize)),
    /// Pairs of nodes with their bounds, the likelier one first.
    Nodes([Waiting; 2]),
}

/// A pair of nodes that waits for its turn.
#[derive(Clone, Copy)]
struct Waiting {
    nodes: [u16; 2],
    lower: f64,
}

impl<'a, F: Fn(usize, usize) -> NodeBound> TreePair<'a, F> {
    pub(in crate::measure) fn new(a: &'a [PartNode], b: &'a [PartNode], bound: F) -> Self {
        Self { a, b, bound }
    }

    /// How many parts there are.
    pub(in crate::measure) fn parts(&self) -> (usize, usize) {
        (self.a.len().div_ceil(2), self.b.len().div_ceil(2))
    }

    fn divided(&self, [i, j]: [u16; 2]) -> Divided {
        let (a, b) = (&self.a[usize::from(i)], &self.b[usize::from(j)]);
        let pairs = match (a.content, b.content) {
            (NodeContent::Part(part_a), NodeContent::Part(part_b)) => {
                return Divided::Parts((part_a.into(), part_b.into()));
            }
            // The larger one is divided.
            (NodeContent::Nodes(nodes), NodeContent::Part(_)) => nodes.map(|node| [node, j]),
            (NodeContent::Nodes(nodes), NodeContent::Nodes(_)) if a.ball.radius >= b.ball.radius => {
                nodes.map(|node| [node, j])
            }
            (_, NodeContent::Nodes(nodes)) => nodes.map(|node| [i, node]),
        };
        let [first, second] = pairs.map(|nodes| {
            let [i, j] = nodes.map(usize::from);
            count::bound();
            let NodeBound { lower, order } = (self.bound)(i, j);
            (order, Waiting { nodes, lower })
        });
        Divided::Nodes(if first.0 <= second.0 { [first.1, second.1] } else { [second.1, first.1] })
    }

    /// The parts that the likelier nodes lead to.
    pub(in crate::measure) fn likeliest(&self) -> (usize, usize) {
        let mut nodes = [0, 0];
        loop {
            match self.divided(nodes) {
                Divided::Parts(pair) => return pair,
                Divided::Nodes([likely, _]) => nodes = likely.nodes,
            }
        }
    }

    pub(in crate::measure) fn walk(&self) -> Walk<'_, 'a, F> {
        let root = Waiting { nodes: [0, 0], lower: f64::NEG_INFINITY };
        Walk { trees: self, waiting: [root; MOST_WAITING], count: 1, left_out: f64::INFINITY }
    }

    /// The pairs of parts whose bounds are at most a limit.
    pub(in crate::measure) fn within(&self, limit: f64) -> impl Iterator<Item = (usize, usize)> {
        let mut walk = self.walk();
        std::iter::from_fn(move || walk.next(limit))
    }
}

/// Most pairs of nodes that wait: each division adds one, and trees of 256 parts, halved, are nine
/// nodes high.
const MOST_WAITING: usize = 2 * (u16::BITS as usize) + 2;

/// A way through the pairs of parts, the likelier ones first.
pub(in crate::measure) struct Walk<'t, 'a, F> {
    trees: &'t TreePair<'a, F>,
    waiting: [Waiting; MOST_WAITING],
    count: usize,
    /// Least bound of what was left out.
    pub(in crate::measure) left_out: f64,
}

impl<F: Fn(usize, usize) -> NodeBound> Walk<'_, '_, F> {
    /// The next pair of parts whose bound is at most this.
    pub(in crate::measure) fn next(&mut self, limit: f64) -> Option<(usize, usize)> {
        while self.count > 0 {
            self.count -= 1;
            let Waiting { nodes, lower } = self.waiting[self.count];
            if lower > limit {
                self.left_out = self.left_out.min(lower);
                continue;
            }
            match self.trees.divided(nodes) {
                Divided::Parts(pair) => return Some(pair),
                // The likelier one on top.
                Divided::Nodes([likely, other]) => {
                    self.waiting[self.count] = other;
                    self.waiting[self.count + 1] = likely;
                    self.count += 2;
                }
            }
        }
        None
    }
}

#[cfg(not(test))]
pub(in crate::measure) mod count {
    #[inline(always)]
    pub(super) fn bound() {}

    #[inline(always)]
    pub(in crate::measure) fn solved() {}
}

/// How many bounds of nodes were evaluated and how many pairs of parts solved, in this thread.
#[cfg(test)]
pub(in crate::measure) mod count {
    use std::cell::Cell;

    thread_local! {
        static BOUNDS: Cell<u32> = const { Cell::new(0) };
        static SOLVED: Cell<u32> = const { Cell::new(0) };
    }

    pub(super) fn bound() {
        BOUNDS.set(BOUNDS.get() + 1);
    }

    pub(in crate::measure) fn solved() {
        SOLVED.set(SOLVED.get() + 1);
    }

    /// Does `work`, and how many bounds and pairs it took.
    pub(in crate::measure) fn touched<T>(work: impl FnOnce() -> T) -> (T, [u32; 2]) {
        BOUNDS.set(0);
        SOLVED.set(0);
        let done = work();
        (done, [BOUNDS.get(), SOLVED.get()])
    }
}
