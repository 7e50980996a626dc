//! Links of robots by the slots of their objects.

use std::sync::Arc;

use super::Robot;
use crate::object::Slot;

/// Which object is which link of which robot, for the rules of pairs.
#[derive(Clone, Debug, Default)]
pub(crate) struct LinkTable {
    /// By slot: number of the instance and of the link; empty in scenes without robots.
    places: Vec<Option<(u32, u32)>>,
    /// By number of the instance.
    robots: Vec<Arc<Robot>>,
}

impl LinkTable {
    /// The table of instances: their robots, and the slots of links.
    pub(crate) fn new<'a>(
        slots: usize,
        instances: impl ExactSizeIterator<Item = (&'a Arc<Robot>, &'a [Option<Slot>])>,
    ) -> Self {
        if instances.len() == 0 {
            return Self::default();
        }
        let (mut places, mut robots) = (vec![None; slots], Vec::new());
        for (number, (robot, links)) in (0..).zip(instances) {
            robots.push(robot.clone());
            for (link, slot) in (0..).zip(links) {
                if let Some(slot) = slot {
                    places[*slot as usize] = Some((number, link));
                }
            }
        }
        Self { places, robots }
    }

    /// Whether two objects are links of one instance that may touch.
    pub(crate) fn is_allowed(&self, a: Slot, b: Slot) -> bool {
        if self.places.is_empty() {
            return false;
        }
        match (self.places[a as usize], self.places[b as usize]) {
            (Some((instance, a)), Some((other, b))) if instance == other => {
                self.robots[instance as usize].may_touch(a as usize, b as usize)
            }
            _ => false,
        }
    }
}
