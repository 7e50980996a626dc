//! Exact distances of triangle meshes: both are trees of balls, and the pair of branches that may
//! be nearest is opened first.
//!
//! Parry answers the same question, and is timed at it, but looks at one mesh whole for each
//! triangle of the other: a quarter of a second for meshes of 17 000 triangles.

use crate::comparison::{ComparisonError, Subject};
use nalgebra::{Isometry3, Vector3};
use parry3d_f64::math::{Pose as ParryPose, Vector};
use parry3d_f64::query::details::distance_support_map_support_map;
use parry3d_f64::query::{DefaultQueryDispatcher, QueryDispatcher};
use parry3d_f64::shape::{TriMesh, Triangle};
use std::cmp::Ordering;
use std::collections::BinaryHeap;

/// The meshes of a pair.
pub(super) struct Meshes {
    trees: [Tree; 2],
    parry: [TriMesh; 2],
}

impl Meshes {
    pub(super) fn new(subjects: [&Subject; 2]) -> Result<Self, ComparisonError> {
        let [a, b] = subjects.map(|subject| {
            let points = subject.mesh.points.iter().map(|v| Vector::new(v.x, v.y, v.z)).collect();
            let triangles = subject.mesh.triangles.iter().map(|t| t.map(|corner| corner as u32)).collect();
            TriMesh::new(points, triangles)
                .map_err(|error| ComparisonError::ParryMesh { mesh: subject.name, what: error.to_string() })
        });
        Ok(Self { trees: subjects.map(Tree::new), parry: [a?, b?] })
    }

    /// As parry answers it, metres.
    pub(super) fn parry_distance(&self, pose: &ParryPose) -> f64 {
        DefaultQueryDispatcher.distance(pose, &self.parry[0], &self.parry[1]).map_or(f64::NAN, |found| found.distance)
    }

    /// Distance of the surfaces, metres.
    pub(super) fn distance(&self, pose: &ParryPose) -> f64 {
        let [a, b] = &self.trees;
        let (t, q) = (pose.translation, pose.rotation);
        let turn = nalgebra::UnitQuaternion::new_unchecked(nalgebra::Quaternion::new(q.w, q.x, q.y, q.z));
        let placed = Isometry3::from_parts(Vector3::new(t.x, t.y, t.z).into(), turn);
        let bound = |i: usize, j: usize| {
            let (a, b) = (&a.nodes[i], &b.nodes[j]);
            (a.center - placed.transform_point(&b.center.into()).coords).norm() - a.radius - b.radius
        };
        let mut least = f64::INFINITY;
        let mut open = BinaryHeap::from([Open { bound: bound(0, 0), nodes: [0, 0] }]);
        while let Some(Open { bound: nearest, nodes: [i, j] }) = open.pop() {
            if nearest >= least {
                break;
            }
            let (one, other) = (&a.nodes[i], &b.nodes[j]);
            match (&one.triangle, &other.triangle) {
                (Some(one), Some(other)) => least = least.min(distance_support_map_support_map(pose, one, other)),
                // The larger ball is opened.
                (None, second) if second.is_some() || one.radius >= other.radius => {
                    open.extend(one.halves.map(|i| Open { bound: bound(i, j), nodes: [i, j] }));
                }
                _ => open.extend(other.halves.map(|j| Open { bound: bound(i, j), nodes: [i, j] })),
            }
        }
        least
    }
}

/// Two branches and the least distance that they may have.
struct Open {
    bound: f64,
    nodes: [usize; 2],
}

impl PartialEq for Open {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Open {}

impl PartialOrd for Open {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Open {
    /// The nearest is the greatest: it comes first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound.total_cmp(&self.bound)
    }
}

/// A mesh as a tree of balls; the first node is the root.
struct Tree {
    nodes: Vec<Node>,
}

/// A ball around some triangles.
struct Node {
    center: Vector3<f64>,
    radius: f64,
    /// The branches; of a leaf, itself.
    halves: [usize; 2],
    /// Of a leaf.
    triangle: Option<Triangle>,
}

impl Tree {
    fn new(subject: &Subject) -> Self {
        let corners = |t: &[usize; 3]| t.map(|corner| subject.mesh.points[corner]);
        let mut triangles: Vec<[Vector3<f64>; 3]> = subject.mesh.triangles.iter().map(corners).collect();
        let mut tree = Self { nodes: Vec::with_capacity(2 * triangles.len()) };
        tree.grow(&mut triangles);
        tree
    }

    /// Adds the node of these triangles with all below it.
    fn grow(&mut self, triangles: &mut [[Vector3<f64>; 3]]) -> usize {
        let (mut low, mut high) = (Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY));
        for corner in triangles.iter().flatten() {
            (low, high) = (low.inf(corner), high.sup(corner));
        }
        let center = (low + high) * 0.5;
        let radius = triangles.iter().flatten().map(|corner| (corner - center).norm()).fold(0.0, f64::max);
        let index = self.nodes.len();
        let triangle = if let [[p, q, r]] = triangles {
            let [p, q, r] = [p, q, r].map(|v| Vector::new(v.x, v.y, v.z));
            Some(Triangle::new(p, q, r))
        } else {
            None
        };
        self.nodes.push(Node { center, radius, halves: [index; 2], triangle });
        if triangles.len() > 1 {
            let axis = (high - low).imax();
            let along = |triangle: &[Vector3<f64>; 3]| triangle.iter().map(|corner| corner[axis]).sum::<f64>();
            let half = triangles.len() / 2;
            triangles.select_nth_unstable_by(half, |s, t| along(s).total_cmp(&along(t)));
            let (below, above) = triangles.split_at_mut(half);
            let halves = [self.grow(below), self.grow(above)];
            self.nodes[index].halves = halves;
        }
        index
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::{Random, parry_pose};
    use sublevel::fit::Mesh;
    use sublevel::measure::Pose;

    #[test]
    fn parry_says_the_same() {
        let mut random = Random(5);
        let mut subject = |name| {
            let points: Vec<Vector3<f64>> = (0..60).map(|_| random.direction()).collect();
            let triangles = (0..58).map(|i| [i, i + 1, i + 2]).collect();
            Subject { name, mesh: Mesh { points: points.clone(), triangles }, hull: points, diameter_m: 2.0 }
        };
        let (a, b) = (subject("a"), subject("b"));
        let meshes = Meshes::new([&a, &b]).unwrap();
        for _ in 0..50 {
            let place = random.direction() * (2.5 + random.signed());
            let pose = parry_pose(&Pose::from_quaternion(place, random.rotation().coords.into()).unwrap());
            let (ours, theirs) = (meshes.distance(&pose), meshes.parry_distance(&pose));
            assert!((ours - theirs).abs() < 1e-9, "{ours} {theirs}");
        }
    }
}
