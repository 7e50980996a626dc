//! Links and joints make one tree with one root.

use crate::description::{Joint, Link};
use crate::error::DescriptionError;
use crate::xml::{Element, quoted, quoted_list};

/// Refuses what is no tree: a link with two parents, a cycle, no root, several roots.
pub(super) fn check(
    robot: Element<'_, '_>,
    links: &[Link],
    joints: &[Joint],
    elements: &[Element<'_, '_>],
) -> Result<(), DescriptionError> {
    if links.is_empty() {
        return Err(robot.error("the robot has no link", "add a <link>"));
    }
    let parents = parents(links, joints, elements)?;
    check_cycles(links, joints, elements, &parents)?;
    let roots = links.iter().zip(&parents).filter(|(_, parent)| parent.is_none()).map(|(link, _)| &*link.name);
    if roots.clone().nth(1).is_none() {
        return Ok(());
    }
    let count = roots.clone().count();
    let problem = format!("{count} links have no parent: {}", quoted_list(roots));
    Err(robot.error(problem, "connect all but one of them to the others by joints"))
}

/// The joint above each link.
fn parents(
    links: &[Link],
    joints: &[Joint],
    elements: &[Element<'_, '_>],
) -> Result<Vec<Option<usize>>, DescriptionError> {
    let mut parents = vec![None; links.len()];
    for (index, joint) in joints.iter().enumerate() {
        if let Some(other) = parents[joint.child].replace(index) {
            let (link, other) = (quoted(&links[joint.child].name), quoted(&joints[other].name));
            let problem = format!("the link {link} is the child of two joints, this one and {other}");
            return Err(elements[index].error(problem, "remove one of them; closed loops are not read"));
        }
    }
    Ok(parents)
}

/// Follows each link up to what was visited before; a cycle returns to the same walk.
fn check_cycles(
    links: &[Link],
    joints: &[Joint],
    elements: &[Element<'_, '_>],
    parents: &[Option<usize>],
) -> Result<(), DescriptionError> {
    let mut walks = vec![usize::MAX; links.len()];
    for first in 0..links.len() {
        let mut link = first;
        while walks[link] == usize::MAX {
            walks[link] = first;
            let Some(joint) = parents[link] else { break };
            link = joints[joint].parent;
            if walks[link] == first {
                let cycle = cycle(link, joints, parents);
                let problem = format!(
                    "the links {} form a cycle, in which each is the parent of the one before",
                    quoted_list(cycle.iter().map(|link| &*links[*link].name))
                );
                return Err(elements[joint].error(problem, "remove one of the joints between them"));
            }
        }
    }
    Ok(())
}

/// The links of the cycle that a link is in, each before its parent.
fn cycle(first: usize, joints: &[Joint], parents: &[Option<usize>]) -> Vec<usize> {
    let above = |link: &usize| parents[*link].map(|joint| joints[joint].parent).filter(|parent| *parent != first);
    std::iter::successors(Some(first), above).collect()
}
