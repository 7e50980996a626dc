//! A tree of balls around the parts of a compound, so that a query meets few of them.

use super::bounds::Ball;
use nalgebra::Vector3;

/// A ball around some parts, metres, frame of the compound.
#[derive(Clone, Copy, Debug)]
pub struct PartNode {
    /// Contains all of its parts.
    pub ball: Ball,
    /// What is inside.
    pub content: NodeContent,
}

/// The content of a node of a tree.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NodeContent {
    /// One part, by its position in [`Solid::parts`](super::Solid::parts).
    Part(u16),
    /// Two nodes, by their positions in the tree.
    Nodes([u16; 2]),
}

/// A binary tree; the first node is the root.
#[derive(Clone, Debug)]
pub struct PartTree {
    nodes: Vec<PartNode>,
}

impl PartTree {
    /// The tree of parts with these balls around them, at least one: halves along the axis on which
    /// their centres are spread most.
    pub(super) fn new(balls: &[Ball]) -> Self {
        let mut tree = Self { nodes: Vec::with_capacity(2 * balls.len()) };
        let mut order: Vec<u16> = (0..balls.len() as u16).collect();
        tree.add(balls, &mut order);
        tree
    }

    /// All nodes, the root first.
    pub fn nodes(&self) -> &[PartNode] {
        &self.nodes
    }

    fn add(&mut self, balls: &[Ball], order: &mut [u16]) -> u16 {
        let place = self.nodes.len();
        if let [part] = *order {
            self.nodes.push(PartNode { ball: balls[usize::from(part)], content: NodeContent::Part(part) });
            return place as u16;
        }
        let of = |part: &u16| &balls[usize::from(*part)];
        let spread = |axis: usize| {
            let along = || order.iter().map(|part| of(part).center[axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        let axis = (0..3).max_by(|i, j| spread(*i).total_cmp(&spread(*j))).unwrap_or(0);
        order.sort_by(|p, q| of(p).center[axis].total_cmp(&of(q).center[axis]));
        let ball = around(order.iter().map(of));
        self.nodes.push(PartNode { ball, content: NodeContent::Nodes([0; 2]) });
        let (low, high) = order.split_at_mut(order.len() / 2);
        let children = [self.add(balls, low), self.add(balls, high)];
        self.nodes[place].content = NodeContent::Nodes(children);
        place as u16
    }
}

/// A ball around balls: about the middle of the box around their centres.
fn around<'a>(balls: impl Iterator<Item = &'a Ball> + Clone) -> Ball {
    let fold = |start: f64, pick: fn(f64, f64) -> f64| {
        Vector3::from_fn(|i, _| balls.clone().map(|ball| ball.center[i]).fold(start, pick))
    };
    let (min, max) = (fold(f64::INFINITY, f64::min), fold(f64::NEG_INFINITY, f64::max));
    let center = min + (max - min) * 0.5;
    // Roundings of the norm, the sum and the difference, which counts with the positions.
    let reach = |ball: &Ball| {
        let positions = f64::EPSILON * (center.norm() + ball.center.norm());
        ((ball.center - center).norm() + ball.radius + positions) * (1.0 + 8.0 * f64::EPSILON)
    };
    Ball { center, radius: balls.clone().map(reach).fold(0.0, f64::max) }
}

#[cfg(test)]
mod tests {
    use super::{NodeContent, PartTree};
    use crate::body::Ball;
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    #[test]
    fn nodes_contain_their_parts_and_every_part_is_there_once() {
        for count in [1, 2, 3, 7, 64, 256] {
            let mut random = Seeded(count);
            let balls: Vec<Ball> = (0..count)
                .map(|_| Ball { center: Vector3::from_fn(|_, _| random.signed()), radius: random.signed().abs() })
                .collect();
            let tree = PartTree::new(&balls);
            assert_eq!(tree.nodes().len(), 2 * balls.len() - 1);
            let mut seen = vec![0; balls.len()];
            // From the root, with all balls on the way.
            let mut stack = vec![(0_u16, Vec::new())];
            while let Some((place, mut above)) = stack.pop() {
                let node = &tree.nodes()[usize::from(place)];
                above.push(node.ball);
                match node.content {
                    NodeContent::Part(part) => {
                        let ball = &balls[usize::from(part)];
                        seen[usize::from(part)] += 1;
                        let inside = |outer: &Ball| {
                            (outer.center - ball.center).norm() + ball.radius <= outer.radius * (1.0 + 1e-14)
                        };
                        assert!(above.iter().all(inside), "{count} parts: {ball:?} in {above:?}");
                    }
                    NodeContent::Nodes(children) => {
                        children.into_iter().for_each(|child| stack.push((child, above.clone())));
                    }
                }
            }
            assert!(seen.iter().all(|&count| count == 1));
        }
    }
}
