//! What a scene is made of, without the poses.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use super::object::{Object, Slot, Subject};
use super::rules::{RuleTable, Rules};
use crate::robot::{Instance, LinkTable};

/// Objects by slot, their names, what holds what, and the rules. Shared between snapshots until
/// one of them changes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Structure {
    /// `None`: the slot is free.
    pub(crate) slots: Vec<Option<Arc<Object>>>,
    pub(crate) by_name: BTreeMap<Arc<str>, Slot>,
    /// Slots to use again.
    free: Vec<Slot>,
    pub(crate) rules: Rules,
    /// Robots by name.
    pub(crate) robots: BTreeMap<Arc<str>, Arc<Instance>>,
    /// Derived from all that by [`Structure::derive`].
    pub(crate) table: RuleTable,
    /// Position of each slot in the order of names; derived.
    pub(crate) ranks: Vec<u32>,
    /// What each object holds; derived.
    pub(crate) holding: HashMap<Slot, Vec<Slot>>,
    /// Slots of half-spaces, which no box bounds; derived.
    pub(crate) half_spaces: Vec<Slot>,
}

impl Structure {
    pub(crate) fn object(&self, slot: Slot) -> Option<&Arc<Object>> {
        self.slots.get(slot as usize)?.as_ref()
    }

    pub(crate) fn slot(&self, name: &str) -> Option<Slot> {
        self.by_name.get(name).copied()
    }

    /// Slots and objects in the order of names.
    pub(crate) fn objects(&self) -> impl DoubleEndedIterator<Item = (Slot, &Arc<Object>)> + Clone {
        self.by_name.values().filter_map(|&slot| Some((slot, self.object(slot)?)))
    }

    /// Adds an object, or replaces the one of its name.
    pub(crate) fn put(&mut self, object: Object) -> Slot {
        let slot = match self.by_name.get(&object.name) {
            Some(&slot) => slot,
            None => {
                let slot = self.free.pop().unwrap_or_else(|| {
                    self.slots.push(None);
                    Slot::try_from(self.slots.len() - 1).unwrap_or(Slot::MAX)
                });
                self.by_name.insert(object.name.clone(), slot);
                slot
            }
        };
        self.slots[slot as usize] = Some(Arc::new(object));
        slot
    }

    /// Changes an object that is there.
    pub(crate) fn change(&mut self, slot: Slot, change: impl FnOnce(&mut Object)) {
        if let Some(Some(object)) = self.slots.get_mut(slot as usize) {
            change(Arc::make_mut(object));
        }
    }

    /// Removes an object and returns its slot; [`Structure::forget`] is to follow.
    pub(crate) fn remove(&mut self, name: &str) -> Option<Slot> {
        let slot = self.by_name.remove(name)?;
        self.slots[slot as usize] = None;
        self.free.push(slot);
        Some(slot)
    }

    /// Removes objects that are gone from rules and from what held objects may touch.
    pub(crate) fn forget(&mut self, gone: impl Fn(&str) -> bool) {
        self.rules.forget(&gone);
        let is_gone = |subject: &Subject| matches!(subject, Subject::Object(name) if gone(name));
        for object in self.slots.iter_mut().flatten() {
            if object.attachment.as_ref().is_some_and(|attachment| attachment.touch.iter().any(is_gone))
                && let Some(attachment) = &mut Arc::make_mut(object).attachment
            {
                attachment.touch.retain(|subject| !is_gone(subject));
            }
        }
    }

    /// Recomputes what follows from objects and rules.
    pub(crate) fn derive(&mut self) {
        let mut ranks = vec![0; self.slots.len()];
        let (mut holding, mut half_spaces) = (HashMap::<Slot, Vec<Slot>>::new(), Vec::new());
        for (rank, (slot, object)) in (0..).zip(self.objects()) {
            ranks[slot as usize] = rank;
            if let Some(holder) = object.attachment.as_ref().and_then(|attachment| self.slot(&attachment.to)) {
                holding.entry(holder).or_default().push(slot);
            }
            if object.bounding_box().is_none() {
                half_spaces.push(slot);
            }
        }
        let objects = self.objects().map(|(slot, object)| (slot, &**object));
        let instances = self.robots.values().map(|instance| (&instance.robot, &*instance.slots));
        let links = LinkTable::new(self.slots.len(), instances);
        let table = RuleTable::new(&self.rules, self.slots.len(), objects, links, |name| self.slot(name));
        (self.table, self.ranks, self.holding, self.half_spaces) = (table, ranks, holding, half_spaces);
    }

    /// Slots of everything that these hold, directly or not, each after its holder; without
    /// themselves unless held by one of the others.
    pub(crate) fn held_by(&self, slots: &[Slot]) -> Vec<Slot> {
        let mut held = Vec::new();
        if self.holding.is_empty() {
            return held;
        }
        for &slot in slots {
            held.extend(self.holding.get(&slot).into_iter().flatten());
        }
        let mut next = 0;
        while let Some(&slot) = held.get(next) {
            held.extend(self.holding.get(&slot).into_iter().flatten());
            next += 1;
        }
        held
    }

    /// The first object, in the order of names, that is held through more than [`MAX_HOLDERS`]
    /// others: by itself, mostly.
    pub(crate) fn circle(&self) -> Option<&Arc<str>> {
        let holder = |object: &Object| self.slot(&object.attachment.as_ref()?.to);
        let mut held = self.objects().map(|(_, object)| object).filter(|object| object.attachment.is_some());
        let too_deep = |object: &&Arc<Object>| {
            let (mut at, mut holders) = (holder(object), 0);
            while let Some(slot) = at {
                holders += 1;
                if holders > MAX_HOLDERS {
                    return true;
                }
                at = self.object(slot).and_then(|object| holder(object));
            }
            false
        };
        held.find(too_deep).map(|object| &object.name)
    }
}

/// Longest chain of objects that hold one another: a gripper, a tool, a part, and some to spare.
pub(crate) const MAX_HOLDERS: usize = 32;
