//! A tree of balls around the parts of a compound, so that a query meets few of them.

use super::bounds::Ball;
use super::convex_body::Body;
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

/// The points that parts are measured from, metres, frame of the compound.
#[derive(Clone, Copy, Debug)]
pub struct Centers {
    /// Contains the points of all parts.
    pub ball: Ball,
    /// Most that any point of a part is from the point of its own part.
    pub reach: f64,
}

/// What measures from points within the parts of a node need to know of all of them.
#[derive(Clone, Copy, Debug)]
pub struct PartCenters {
    /// Their interior points.
    pub interior: Centers,
    /// The centres from which they grow, [`Body::growth_ball`].
    pub growth: Centers,
    /// The largest [`Body::min_value`].
    pub min_value: f64,
}

impl PartCenters {
    /// Those of a single body.
    pub fn of(body: &Body) -> Self {
        let around = body.circumscribed();
        let of = |center: Vector3<f64>| {
            let reach = ((center - around.center).norm() + around.radius) * (1.0 + 8.0 * f64::EPSILON);
            Centers { ball: Ball { center, radius: 0.0 }, reach }
        };
        let (interior, growth) = (of(*body.interior_point()), of(body.growth_ball().center));
        Self { interior, growth, min_value: body.min_value() }
    }

    fn around<'a>(parts: impl Iterator<Item = &'a Self> + Clone) -> Self {
        let all = |pick: fn(&Self) -> &Centers| Centers {
            ball: around(parts.clone().map(|part| &pick(part).ball)),
            reach: parts.clone().map(|part| pick(part).reach).fold(0.0, f64::max),
        };
        let min_value = parts.clone().map(|part| part.min_value).fold(f64::NEG_INFINITY, f64::max);
        Self { interior: all(|part| &part.interior), growth: all(|part| &part.growth), min_value }
    }
}

/// A binary tree; the first node is the root.
#[derive(Clone, Debug)]
pub struct PartTree {
    nodes: Vec<PartNode>,
    /// In the same order: apart, for distances do not read them.
    centers: Vec<PartCenters>,
}

/// The parts of a tree while it is made.
struct Parts {
    balls: Vec<Ball>,
    centers: Vec<PartCenters>,
}

impl PartTree {
    /// The tree of these parts, at least one: halves along the axis on which their centres are
    /// spread most.
    pub(super) fn new(parts: &[Body]) -> Self {
        let count = 2 * parts.len();
        let mut tree = Self { nodes: Vec::with_capacity(count), centers: Vec::with_capacity(count) };
        let mut order: Vec<u16> = (0..parts.len() as u16).collect();
        let parts = Parts {
            balls: parts.iter().map(|part| *part.circumscribed()).collect(),
            centers: parts.iter().map(PartCenters::of).collect(),
        };
        tree.add(&parts, &mut order);
        tree
    }

    /// All nodes, the root first.
    pub fn nodes(&self) -> &[PartNode] {
        &self.nodes
    }

    /// The centres of the parts of each node, in the order of the nodes.
    pub fn centers(&self) -> &[PartCenters] {
        &self.centers
    }

    fn add(&mut self, parts: &Parts, order: &mut [u16]) -> u16 {
        let place = self.nodes.len();
        let of = |part: &u16| &parts.balls[usize::from(*part)];
        if let [part] = *order {
            self.nodes.push(PartNode { ball: *of(&part), content: NodeContent::Part(part) });
            self.centers.push(parts.centers[usize::from(part)]);
            return place as u16;
        }
        let spread = |axis: usize| {
            let along = || order.iter().map(|part| of(part).center[axis]);
            along().fold(f64::NEG_INFINITY, f64::max) - along().fold(f64::INFINITY, f64::min)
        };
        let axis = (0..3).max_by(|i, j| spread(*i).total_cmp(&spread(*j))).unwrap_or(0);
        order.sort_by(|p, q| of(p).center[axis].total_cmp(&of(q).center[axis]));
        let ball = around(order.iter().map(of));
        self.nodes.push(PartNode { ball, content: NodeContent::Nodes([0; 2]) });
        self.centers.push(PartCenters::around(order.iter().map(|part| &parts.centers[usize::from(*part)])));
        let (low, high) = order.split_at_mut(order.len() / 2);
        let children = [self.add(parts, low), self.add(parts, high)];
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
    use super::{Centers, NodeContent, PartCenters, PartTree};
    use crate::body::{Ball, Body};
    use nalgebra::Vector3;
    use sublevel_testkit::Seeded;

    fn eggs(count: u64) -> Vec<Body> {
        let mut random = Seeded(count);
        let mut egg = || {
            let center = Vector3::from_fn(|_, _| random.signed());
            let half = Vector3::from_fn(|_, _| 0.3 * 2_f64.powf(random.signed()));
            let egg = Body::ellipsoid("egg", center, half).unwrap();
            egg.with_growth_center(center + random.unit() * 0.05).unwrap()
        };
        (0..count).map(|_| egg()).collect()
    }

    #[test]
    fn nodes_contain_their_parts_and_every_part_is_there_once() {
        for count in [1, 2, 3, 7, 64, 256] {
            let parts = eggs(count);
            let tree = PartTree::new(&parts);
            assert_eq!(tree.nodes().len(), 2 * parts.len() - 1);
            assert_eq!(tree.centers().len(), tree.nodes().len());
            let mut seen = vec![0; parts.len()];
            // From the root, with all nodes on the way.
            let mut stack = vec![(0_u16, Vec::new())];
            while let Some((place, mut above)) = stack.pop() {
                let node = &tree.nodes()[usize::from(place)];
                above.push(usize::from(place));
                match node.content {
                    NodeContent::Part(part) => {
                        let body = &parts[usize::from(part)];
                        seen[usize::from(part)] += 1;
                        let label = format!("{count} parts: {part} in {above:?}");
                        assert!(above.iter().all(|&node| is_inside(&tree, node, body)), "{label}");
                    }
                    NodeContent::Nodes(children) => {
                        children.into_iter().for_each(|child| stack.push((child, above.clone())));
                    }
                }
            }
            assert!(seen.iter().all(|&count| count == 1));
        }
    }

    /// Whether a node contains a body, and its bounds hold of it.
    fn is_inside(tree: &PartTree, node: usize, body: &Body) -> bool {
        let holds = |outer: &Ball, center: &Vector3<f64>, radius: f64| {
            (outer.center - center).norm() + radius <= outer.radius * (1.0 + 1e-14)
        };
        let around = body.circumscribed();
        let PartCenters { interior, growth, min_value } = &tree.centers()[node];
        let center_holds = |centers: &Centers, center: &Vector3<f64>| {
            let farthest = (center - around.center).norm() + around.radius;
            holds(&centers.ball, center, 0.0) && farthest <= centers.reach
        };
        holds(&tree.nodes()[node].ball, &around.center, around.radius)
            && center_holds(interior, body.interior_point())
            && center_holds(growth, &body.growth_ball().center)
            && body.min_value() <= *min_value
    }
}
