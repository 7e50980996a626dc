//! Pairs of objects that may be within a margin, from the tree of boxes.

use std::sync::Arc;

use super::selection::Selection;
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
        for (slot, object) in scene.structure.objects() {
            if object.solids().is_empty() {
                continue;
            }
            match selection.contains(slot) {
                true => from.push((slot, false)),
                false if half_spaces => from.push((slot, true)),
                false => {}
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

    /// Visits the partners of one of them that may be nearer than `margin` and the padding of the
    /// pair: every pair once, over all objects.
    pub(crate) fn visit(&self, index: usize, margin_m: f64, mut visit: impl FnMut(Slot, Slot)) {
        let (slot, half_spaces_only) = self.from[index];
        let table = &self.scene.structure.table;
        let reach = margin_m + table.largest_padding_m();
        if let Some(around) = self.scene.object(slot).and_then(|object| world_box(object, self.scene.pose_at(slot)))
            && !half_spaces_only
        {
            let around = grown(&around, reach);
            for other in self.tree.meeting(&around) {
                // The other side finds the pair, too, if it is selected: the smaller slot has it.
                let twice = self.selection.contains(other) && other < slot;
                if other != slot && !twice {
                    self.offer(slot, other, &mut visit);
                }
            }
        }
        for &other in &self.scene.structure.half_spaces {
            if !half_spaces_only || self.selection.contains(other) {
                self.offer(slot, other, &mut visit);
            }
        }
    }

    fn offer(&self, a: Slot, b: Slot, visit: &mut impl FnMut(Slot, Slot)) {
        if self.include_allowed || !self.scene.is_allowed(a, b) {
            let ranks = &self.scene.structure.ranks;
            if ranks[a as usize] < ranks[b as usize] { visit(a, b) } else { visit(b, a) }
        }
    }
}
