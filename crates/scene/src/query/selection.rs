//! Which objects of a scene count.

use std::collections::HashSet;
use std::sync::Arc;

use crate::object::Slot;
use crate::scene::Scene;

/// Objects that are selected; none means all.
#[derive(Clone, Debug, Default)]
pub struct Selection {
    slots: Option<HashSet<Slot>>,
}

impl Selection {
    /// Everything.
    pub fn all() -> Self {
        Self::default()
    }

    /// These objects and the members of these groups.
    pub fn of(scene: &Scene, slots: impl IntoIterator<Item = Slot>, groups: &HashSet<Arc<str>>) -> Self {
        let mut selected: HashSet<Slot> = slots.into_iter().collect();
        if !groups.is_empty() {
            let members = scene.objects().filter(|(_, object, _)| groups.contains(&object.group));
            selected.extend(members.map(|(slot, _, _)| slot));
        }
        Self { slots: Some(selected) }
    }

    /// Whether an object is selected.
    pub fn contains(&self, slot: Slot) -> bool {
        self.slots.as_ref().is_none_or(|slots| slots.contains(&slot))
    }
}
