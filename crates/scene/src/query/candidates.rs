//! Pairs of objects that may be within a margin, from the tree of boxes.

use std::sync::Arc;

use super::selection::Selection;
use super::thing::{OrientedBox, Thing, ball_gap};
use crate::broad_phase::{Tree, grown, world_box};
use crate::object::Slot;
use crate::scene::Scene;

/// The pairs of a scene of which at least one side is selected, object by object.
#[derive(Debug)]
pub(crate) struct Candidates {
    scene: Scene,
    tree: Arc<Tree>,
    selection: Selection,
    include_allowed: bool,
    /// From which partners are looked for, and whether those are half-spaces only.
    from: Vec<(Slot, bool)>,
}

impl Candidates {
    /// Makes the tree of the scene where it is not there yet.
    pub(crate) fn new(scene: Scene, selection: Selection, include_allowed: bool) -> Self {
        let tree = scene.tree().clone();
        let half_spaces = scene.structure.half_spaces.iter().any(|&slot| selection.contains(slot));
        let mut from = Vec::new();
        for (slot, object) in (0..).zip(&scene.structure.slots) {
            let selected = selection.contains(slot);
            let is_bounded = || object.as_ref().is_some_and(|object| object.bounding_box().is_some());
            if (selected || half_spaces) && is_bounded() {
                from.push((slot, !selected));
            }
        }
        Self { scene, tree, selection, include_allowed, from }
    }

    pub(crate) fn scene(&self) -> &Scene {
        &self.scene
    }

    /// Number of objects from which partners are looked for.
    pub(crate) fn len(&self) -> usize {
        self.from.len()
    }

    /// Visits the partners of one of them that balls and boxes do not prove to be farther than
    /// `margin_m` and the padding of the pair: every pair once, over all objects.
    pub(crate) fn visit(&self, index: usize, margin_m: f64, mut visit: impl FnMut(Slot, Slot)) {
        let (slot, half_spaces_only) = self.from[index];
        let (table, pose) = (&self.scene.structure.table, self.scene.pose_at(slot));
        let Some(object) = self.scene.object(slot) else { return };
        let reach = margin_m + table.largest_padding_m();
        if let (false, Some(around)) = (half_spaces_only, world_box(object, pose)) {
            let around = grown(&around, reach);
            let thing = Thing::object(object, pose);
            let (ball, oriented) = (thing.ball(), thing.oriented_box());
            for other in self.tree.meeting(&around) {
                // The other side finds the pair, too, if it is selected: the smaller slot has it.
                let twice = self.selection.contains(other) && other < slot;
                if other == slot || twice || !self.counts(slot, other) {
                    continue;
                }
                let threshold = margin_m + table.padding_m(slot, other);
                let apart = ball.zip(self.tree.ball(other)).is_some_and(|(a, b)| ball_gap(a, b) > threshold);
                if !apart && self.may_be_near(oriented.as_ref(), other, threshold) {
                    self.in_order(slot, other, &mut visit);
                }
            }
        }
        for &other in &self.scene.structure.half_spaces {
            if (!half_spaces_only || self.selection.contains(other)) && self.counts(slot, other) {
                self.in_order(slot, other, &mut visit);
            }
        }
    }

    /// Whether the boxes in their own frames may be within a threshold, metres.
    fn may_be_near(&self, oriented: Option<&OrientedBox>, other: Slot, threshold: f64) -> bool {
        let of_other = self.scene.object(other);
        let of_other = of_other.and_then(|object| Thing::object(object, self.scene.pose_at(other)).oriented_box());
        oriented.zip(of_other).is_none_or(|(a, b)| a.gap_m(&b) <= threshold)
    }

    fn counts(&self, a: Slot, b: Slot) -> bool {
        self.include_allowed || !self.scene.is_allowed(a, b)
    }

    /// In the order of names.
    fn in_order(&self, a: Slot, b: Slot, visit: &mut impl FnMut(Slot, Slot)) {
        let ranks = &self.scene.structure.ranks;
        if ranks[a as usize] < ranks[b as usize] { visit(a, b) } else { visit(b, a) }
    }
}
