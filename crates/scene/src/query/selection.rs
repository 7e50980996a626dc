//! Which objects of a scene count.

use std::collections::HashSet;
use std::sync::Arc;

use crate::object::Slot;
use crate::scene::Scene;

/// Objects that are selected; none means all.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    /// By slot; none: all.
    slots: Option<Vec<bool>>,
}

impl Selection {
    /// Everything.
    pub fn all() -> Self {
        Self::default()
    }

    /// These objects and the members of these groups.
    pub fn of(scene: &Scene, slots: impl IntoIterator<Item = Slot>, groups: &HashSet<Arc<str>>) -> Self {
        let mut selected = vec![false; scene.structure.slots.len()];
        let all = if groups.is_empty() { None } else { Some(scene.structure.objects()) };
        let members = all.into_iter().flatten().filter(|(_, object)| groups.contains(&object.group));
        for slot in slots.into_iter().chain(members.map(|(slot, _)| slot)) {
            if let Some(selected) = selected.get_mut(slot as usize) {
                *selected = true;
            }
        }
        Self { slots: Some(selected) }
    }

    /// Whether an object is selected.
    pub fn contains(&self, slot: Slot) -> bool {
        self.slots.as_ref().is_none_or(|slots| slots.get(slot as usize).is_some_and(|selected| *selected))
    }
}
