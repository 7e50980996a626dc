//! Which objects may be near which: a tree of world boxes, made when the first question needs it
//! and carried on from snapshot to snapshot.

use std::sync::{Arc, OnceLock};

use nalgebra::Vector3;
use parry3d_f64::bounding_volume::Aabb;
use parry3d_f64::math::Vector;
use parry3d_f64::partitioning::{Bvh, BvhBuildStrategy, BvhWorkspace};
use sublevel_core::measure::Pose;

use super::object::{Object, Slot};
use super::poses::Poses;
use super::structure::Structure;

/// The tree of a snapshot, or what it is made from.
#[derive(Debug, Default)]
pub(crate) struct BroadPhase {
    tree: OnceLock<Arc<Tree>>,
    /// The tree of an earlier snapshot, and the slots that have changed since.
    earlier: Option<(Arc<Tree>, Vec<Slot>)>,
}

/// World boxes of all objects but half-spaces.
#[derive(Clone)]
pub(crate) struct Tree {
    boxes: Bvh,
    /// World balls by slot; of slots without a box anything.
    balls: Vec<WorldBall>,
}

/// A ball of the world frame: centre and radius, metres.
pub(crate) type WorldBall = (Vector3<f64>, f64);

impl std::fmt::Debug for Tree {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Tree").field("leaves", &self.boxes.leaf_count()).finish()
    }
}

/// Fewest changes for which a new tree is made instead of bringing the old one up to date.
const REBUILD_FROM: usize = 1024;

impl BroadPhase {
    /// That of the snapshot after this one, in which these slots have changed.
    pub(crate) fn after(&self, slots: &[Slot]) -> Self {
        let (tree, mut changed) = match (self.tree.get(), &self.earlier) {
            (Some(tree), _) => (tree.clone(), Vec::new()),
            (None, Some((tree, changed))) => (tree.clone(), changed.clone()),
            (None, None) => return Self::default(),
        };
        changed.extend_from_slice(slots);
        let enough = changed.len() > REBUILD_FROM.max(tree.boxes.leaf_count() as usize);
        Self { tree: OnceLock::new(), earlier: (!enough).then_some((tree, changed)) }
    }

    /// The tree of the snapshot that this belongs to. Takes milliseconds for large scenes, once.
    pub(crate) fn tree(&self, structure: &Structure, poses: &Poses) -> &Arc<Tree> {
        self.tree.get_or_init(|| {
            Arc::new(match &self.earlier {
                Some((tree, changed)) => tree.updated(structure, poses, changed),
                None => Tree::new(structure, poses),
            })
        })
    }
}

impl Tree {
    fn new(structure: &Structure, poses: &Poses) -> Self {
        let boxes = structure.objects().filter_map(|(slot, object)| Some((slot, world_box(object, poses.get(slot))?)));
        let leaves: Vec<_> = boxes.collect();
        let mut balls = Vec::new();
        structure.objects().for_each(|(slot, object)| set_ball(&mut balls, slot, object, poses));
        if leaves.len() < 3 {
            // parry numbers so few leaves itself when it builds a tree of them.
            let mut boxes = Bvh::new();
            leaves.into_iter().for_each(|(slot, of)| boxes.insert(of, slot));
            return Self { boxes, balls };
        }
        let leaves = leaves.into_iter().map(|(slot, of)| (slot as usize, of));
        Self { boxes: Bvh::from_iter(BvhBuildStrategy::Binned, leaves.collect::<Vec<_>>()), balls }
    }

    fn updated(&self, structure: &Structure, poses: &Poses, changed: &[Slot]) -> Self {
        let (mut boxes, mut workspace) = (self.boxes.clone(), BvhWorkspace::default());
        let mut balls = self.balls.clone();
        for &slot in changed {
            let object = structure.object(slot);
            match object.and_then(|object| Some((object, world_box(object, poses.get(slot))?))) {
                Some((object, now)) => {
                    boxes.insert_or_update_partially(now, slot, 0.0);
                    set_ball(&mut balls, slot, object, poses);
                }
                None => boxes.remove(slot),
            }
        }
        boxes.refit(&mut workspace);
        boxes.optimize_incremental(&mut workspace);
        Self { boxes, balls }
    }

    /// A ball around what stands in a slot; none where there is no box.
    pub(crate) fn ball(&self, slot: Slot) -> Option<WorldBall> {
        self.balls.get(slot as usize).copied()
    }

    /// Slots of all objects whose boxes meet one.
    pub(crate) fn meeting<'a>(&'a self, of: &'a Aabb) -> impl Iterator<Item = Slot> + 'a {
        self.boxes.intersect_aabb(of)
    }

    /// Visits objects whose boxes a ray with this half width meets, nearest boxes first. `visit`
    /// returns the length from which on nothing counts any more.
    pub(crate) fn along(&self, ray: &WideRay, mut visit: impl FnMut(Slot) -> f64) {
        let mut reach = ray.length;
        let mut open = Vec::new();
        let enter = |node: &parry3d_f64::partitioning::BvhNode| ray.enters(&node.aabb());
        // A list of the leaves in the order of entry: what the ray meets is few.
        for slot in self.boxes.leaves(|node| enter(node).is_some()) {
            if let Some(from) = self.boxes.leaf_node(slot).and_then(enter) {
                open.push((from, slot));
            }
        }
        open.sort_by(|(a, i), (b, j)| a.total_cmp(b).then(i.cmp(j)));
        for (from, slot) in open {
            if from > reach {
                return;
            }
            reach = visit(slot).min(reach);
        }
    }
}

fn set_ball(balls: &mut Vec<WorldBall>, slot: Slot, object: &Object, poses: &Poses) {
    let slot_at = slot as usize;
    if balls.len() <= slot_at {
        balls.resize(slot_at + 1, (Vector3::zeros(), f64::INFINITY));
    }
    if let Some(ball) = object.ball() {
        balls[slot_at] = world_ball(poses.get(slot), (ball.center, ball.radius));
    }
}

/// A segment of a ray with a half width, for boxes.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WideRay {
    pub(crate) origin: Vector3<f64>,
    /// Of length one.
    pub(crate) direction: Vector3<f64>,
    pub(crate) length: f64,
    pub(crate) radius: f64,
}

impl WideRay {
    /// Length at which the ray enters a box grown by its radius and by rounding, if it does.
    fn enters(&self, of: &Aabb) -> Option<f64> {
        let (mins, maxs): ([f64; 3], [f64; 3]) = (of.mins.into(), of.maxs.into());
        let (mut from, mut to) = (0.0_f64, self.length);
        for i in 0..3 {
            let size = self.origin[i].abs().max(mins[i].abs()).max(maxs[i].abs());
            let grown = self.radius + 16.0 * f64::EPSILON * size;
            let (low, high) = (mins[i] - grown - self.origin[i], maxs[i] + grown - self.origin[i]);
            if self.direction[i].abs() < 1e-300 {
                if low > 0.0 || high < 0.0 {
                    return None;
                }
                continue;
            }
            let (near, far) = (low / self.direction[i], high / self.direction[i]);
            from = from.max(near.min(far));
            to = to.min(near.max(far));
        }
        // Rounding of the quotients.
        (from <= to * (1.0 + 1e-12)).then_some(from * (1.0 - 1e-12))
    }
}

/// A ball of a body frame where it stands, grown by the rounding of its centre, which may be far
/// from either origin although the ball is not.
pub(crate) fn world_ball(pose: &Pose, (center, radius): WorldBall) -> WorldBall {
    let rounding = 32.0 * f64::EPSILON * (pose.translation().norm() + center.norm() + radius);
    (pose.transform_point(&center), radius + rounding)
}

/// A box proven to contain an object where it stands, metres, world frame; none around a
/// half-space.
pub(crate) fn world_box(object: &Object, pose: &Pose) -> Option<Aabb> {
    let bounds = object.bounding_box()?;
    let (middle, half) = ((bounds.max + bounds.min) * 0.5, (bounds.max - bounds.min) * 0.5);
    let center = pose.transform_point(&middle);
    let rotation = pose.rotation().to_rotation_matrix();
    let extent = rotation.matrix().abs() * half;
    // Some ten roundings, each relative to the largest length that occurs.
    let size = pose.translation().amax() + middle.amax() + half.amax();
    let extent = extent.add_scalar(32.0 * f64::EPSILON * size);
    let corner = |v: Vector3<f64>| Vector::new(v.x, v.y, v.z);
    Some(Aabb::new(corner(center - extent), corner(center + extent)))
}

/// A box grown to all sides, metres.
pub(crate) fn grown(of: &Aabb, by: f64) -> Aabb {
    // What is negative would turn a box inside out; candidates may be too many.
    let by = Vector::splat(by.max(0.0) * (1.0 + 4.0 * f64::EPSILON));
    Aabb::new(of.mins - by, of.maxs + by)
}
