//! Which pairs may touch, and what is added to the margins of the others.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};
use std::sync::Arc;

use foldhash::fast::RandomState;

use super::object::{Object, Slot, Subject};
use crate::robot::LinkTable;

/// An unordered pair of subjects, the smaller first.
pub type SubjectPair = (Subject, Subject);

/// The rules of a scene as they are set, by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Rules {
    /// Pairs that may touch.
    pub(crate) allowed: BTreeSet<SubjectPair>,
    /// Paddings of groups, metres.
    pub(crate) groups: BTreeMap<Arc<str>, f64>,
    /// Paddings of pairs, metres.
    pub(crate) pairs: BTreeMap<SubjectPair, f64>,
}

/// The one order in which an unordered pair is kept.
pub(crate) fn ordered((a, b): SubjectPair) -> SubjectPair {
    if a <= b { (a, b) } else { (b, a) }
}

impl Rules {
    /// Removes what names an object that is gone.
    pub(crate) fn forget(&mut self, gone: &impl Fn(&str) -> bool) {
        let names = |subject: &Subject| matches!(subject, Subject::Object(name) if gone(name));
        self.allowed.retain(|(a, b)| !names(a) && !names(b));
        self.pairs.retain(|(a, b), _| !names(a) && !names(b));
    }
}

/// Number of an object or a group: what rules are looked up by.
type Key = u64;

/// The same rules by number, for pairs of slots.
#[derive(Clone, Debug, Default)]
pub(crate) struct RuleTable {
    /// Per slot: the number of its group, and the padding of its side, metres.
    sides: Vec<(Key, f64)>,
    allowed: HashSet<(Key, Key), RandomState>,
    pairs: HashMap<(Key, Key), f64, RandomState>,
    /// Links of robots that may touch each other.
    links: LinkTable,
    /// No padding of a pair exceeds it, metres.
    largest_padding_m: f64,
    padded: bool,
}

/// Numbers of groups come after those of slots.
const GROUPS: Key = 1 << 32;

impl RuleTable {
    pub(crate) fn new<'a>(
        rules: &Rules,
        slots: usize,
        objects: impl Iterator<Item = (Slot, &'a Object)> + Clone,
        links: LinkTable,
        slot_of: impl Fn(&str) -> Option<Slot>,
    ) -> Self {
        let mut groups: HashMap<Arc<str>, Key> = HashMap::new();
        let mut group = |name: &Arc<str>| {
            let next = GROUPS + groups.len() as Key;
            *groups.entry(name.clone()).or_insert(next)
        };
        let mut sides = vec![(GROUPS - 1, 0.0); slots];
        for (slot, object) in objects.clone() {
            let padding = object.padding_m.or_else(|| rules.groups.get(&object.group).copied()).unwrap_or(0.0);
            // Nothing is said of those without a group.
            let key = if object.group.is_empty() { GROUPS - 1 } else { group(&object.group) };
            sides[slot as usize] = (key, padding);
        }
        let mut key = |subject: &Subject| match subject {
            Subject::Object(name) => slot_of(name).map(Key::from),
            Subject::Group(name) => Some(group(name)),
        };
        let mut allowed: HashSet<(Key, Key), RandomState> = HashSet::default();
        for (a, b) in &rules.allowed {
            if let (Some(a), Some(b)) = (key(a), key(b)) {
                allowed.insert(sorted(a, b));
            }
        }
        let mut pairs: HashMap<(Key, Key), f64, RandomState> = HashMap::default();
        for ((a, b), padding) in &rules.pairs {
            if let (Some(a), Some(b)) = (key(a), key(b)) {
                pairs.insert(sorted(a, b), *padding);
            }
        }
        // What is held may touch its holder, and what it says.
        for (slot, object) in objects {
            let Some(attachment) = &object.attachment else { continue };
            let touched = attachment.touch.iter().filter_map(&mut key).chain(slot_of(&attachment.to).map(Key::from));
            allowed.extend(touched.map(|other| sorted(Key::from(slot), other)).collect::<Vec<_>>());
        }
        let mut largest = [0.0_f64; 2];
        for (_, padding) in &sides {
            if *padding > largest[1] {
                largest[1] = *padding;
                largest.sort_by(|a, b| b.total_cmp(a)); // the largest first
            }
        }
        let largest_padding_m = pairs.values().copied().fold(largest[0] + largest[1], f64::max);
        let padded = !pairs.is_empty() || sides.iter().any(|(_, padding)| *padding != 0.0);
        Self { sides, allowed, pairs, links, largest_padding_m, padded }
    }

    /// Upper bound of the paddings of all pairs, metres, at least 0.
    pub(crate) fn largest_padding_m(&self) -> f64 {
        self.largest_padding_m
    }

    /// Whether two objects may touch.
    pub(crate) fn is_allowed(&self, a: Slot, b: Slot) -> bool {
        let is_set = || self.keys(a, b).any(|key| self.allowed.contains(&key));
        !self.allowed.is_empty() && is_set() || self.links.is_allowed(a, b)
    }

    /// What is added to the margin of a pair, metres: what is set for the pair, objects before
    /// groups, else the sum of its two sides.
    pub(crate) fn padding_m(&self, a: Slot, b: Slot) -> f64 {
        if !self.padded {
            return 0.0;
        }
        let set =
            if self.pairs.is_empty() { None } else { self.keys(a, b).find_map(|key| self.pairs.get(&key)).copied() };
        set.unwrap_or_else(|| self.sides[a as usize].1 + self.sides[b as usize].1)
    }

    /// The pairs of numbers that apply to two slots, the most specific first.
    fn keys(&self, a: Slot, b: Slot) -> impl Iterator<Item = (Key, Key)> {
        let (group_a, group_b) = (self.sides[a as usize].0, self.sides[b as usize].0);
        let (a, b) = (Key::from(a), Key::from(b));
        [sorted(a, b), sorted(a, group_b), sorted(group_a, b), sorted(group_a, group_b)].into_iter()
    }
}

fn sorted(a: Key, b: Key) -> (Key, Key) {
    if a <= b { (a, b) } else { (b, a) }
}
