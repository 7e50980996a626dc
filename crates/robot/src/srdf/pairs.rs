//! Pairs of links that need no check.

use std::collections::BTreeSet;
use std::collections::btree_map::{BTreeMap, Entry};
use std::sync::Arc;

use super::robot::Robot;
use super::warnings::Warnings;
use crate::error::DescriptionError;
use crate::semantics::DisabledPair;
use crate::xml::{Element, quoted};

/// Pairs and links of a file, ascending.
pub(super) struct Pairs {
    pub(super) disabled: Vec<DisabledPair>,
    pub(super) disabled_links: Vec<usize>,
    pub(super) enabled: Vec<(usize, usize)>,
}

/// The pairs of a file.
pub(super) fn read(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    warnings: &mut Warnings,
) -> Result<Pairs, DescriptionError> {
    let mut disabled: BTreeMap<(usize, usize), Arc<str>> = BTreeMap::new();
    for element in root.named("disable_collisions") {
        let pair = pair(element, robot)?;
        let reason: Arc<str> = element.attribute("reason").unwrap_or_default().into();
        match disabled.entry(pair) {
            Entry::Vacant(entry) => drop(entry.insert(reason)),
            Entry::Occupied(_) => {
                warnings.add(element, format!("the pair {} is disabled more than once", shown(pair, robot)));
            }
        }
    }
    let mut enabled = BTreeSet::new();
    for element in root.named("enable_collisions") {
        let pair = pair(element, robot)?;
        if disabled.contains_key(&pair) {
            let problem = format!("the pair {} is both enabled and disabled", shown(pair, robot));
            return Err(element.error(problem, "remove <enable_collisions> or <disable_collisions>"));
        }
        if !enabled.insert(pair) {
            warnings.add(element, format!("the pair {} is enabled more than once", shown(pair, robot)));
        }
    }
    let disabled_links = disabled_links(root, robot, warnings)?;
    let disabled = disabled.into_iter().map(|((first, second), reason)| DisabledPair { first, second, reason });
    Ok(Pairs { disabled: disabled.collect(), disabled_links, enabled: enabled.into_iter().collect() })
}

fn disabled_links(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    warnings: &mut Warnings,
) -> Result<Vec<usize>, DescriptionError> {
    let mut links = BTreeSet::new();
    for element in root.named("disable_default_collisions") {
        let link = robot.link(element, "link")?;
        if !links.insert(link) {
            let name = quoted(&robot.description.links[link].name);
            warnings.add(element, format!("the link {name} is disabled more than once"));
        }
    }
    Ok(links.into_iter().collect())
}

/// Two different links, the smaller position first.
fn pair(element: Element<'_, '_>, robot: &Robot<'_>) -> Result<(usize, usize), DescriptionError> {
    let (one, other) = (robot.link(element, "link1")?, robot.link(element, "link2")?);
    if one == other {
        let problem = format!("link1 and link2 are both {}", quoted(&robot.description.links[one].name));
        return Err(element.error(problem, "name two different links, or remove it"));
    }
    Ok((one.min(other), one.max(other)))
}

fn shown((first, second): (usize, usize), robot: &Robot<'_>) -> String {
    let name = |link: usize| quoted(&robot.description.links[link].name);
    format!("{}, {}", name(first), name(second))
}
