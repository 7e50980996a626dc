//! Groups: sets of joints and links by their names, chains and subgroups.

use std::collections::{BTreeSet, HashMap, HashSet};

use super::robot::{Named, Robot, unknown};
use super::warnings::Warnings;
use crate::error::DescriptionError;
use crate::semantics::{Group, VirtualJoint};
use crate::xml::{Element, Vocabulary, check_unique, quoted_list};

/// Most groups of a file.
const MOST_GROUPS: usize = 200;
/// Most chains of a file.
const MOST_CHAINS: usize = 1000;

const GROUP: Vocabulary = Vocabulary { read: &["link", "joint", "chain", "group", "passive_joint"], ignored: &[] };

/// What a group has itself, and its subgroups.
#[derive(Default)]
struct Content {
    joints: BTreeSet<usize>,
    virtual_joints: BTreeSet<usize>,
    links: BTreeSet<usize>,
    subgroups: BTreeSet<usize>,
}

/// The groups of a file, with all that their subgroups have.
pub(super) fn read(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    virtual_joints: &[VirtualJoint],
    warnings: &mut Warnings,
) -> Result<Vec<Group>, DescriptionError> {
    if let Some(group) = root.named("group").nth(MOST_GROUPS) {
        return Err(group.error(format!("the file has more than {MOST_GROUPS} groups"), "remove some"));
    }
    let elements: Vec<_> = root.named("group").collect();
    if let Some(chain) = elements.iter().flat_map(|group| group.named("chain")).nth(MOST_CHAINS) {
        return Err(chain.error(format!("the file has more than {MOST_CHAINS} chains"), "remove some"));
    }
    let mut names = HashSet::new();
    let mut positions = HashMap::new();
    for (index, element) in elements.iter().enumerate() {
        let name = element.required_name("name")?;
        check_unique(&mut names, *element, name)?;
        positions.insert(name, index);
    }
    let own = |element: &Element<'_, '_>| content(*element, robot, virtual_joints, &positions);
    let mut contents = elements.iter().map(own).collect::<Result<Vec<_>, _>>()?;
    add_subgroups(&mut contents, &elements)?;
    for (element, content) in elements.iter().zip(&contents) {
        if content.joints.is_empty() && content.virtual_joints.is_empty() && content.links.is_empty() {
            warnings.add(*element, "the group is empty".into());
        }
    }
    let group = |(element, content): (&Element<'_, '_>, Content)| {
        Ok(Group {
            name: element.required_name("name")?.into(),
            joints: content.joints.into_iter().collect(),
            virtual_joints: content.virtual_joints.into_iter().collect(),
            links: content.links.into_iter().collect(),
        })
    };
    elements.iter().zip(contents).map(group).collect()
}

/// What a group has itself.
fn content(
    group: Element<'_, '_>,
    robot: &Robot<'_>,
    virtual_joints: &[VirtualJoint],
    groups: &HashMap<&str, usize>,
) -> Result<Content, DescriptionError> {
    GROUP.check_children(group)?;
    let mut content = Content::default();
    for element in group.children() {
        match element.name() {
            "link" => {
                let link = robot.link(element, "name")?;
                content.links.insert(link);
                content.joints.extend(robot.parent_joint(link));
            }
            "joint" => match robot.joint(element, virtual_joints)? {
                Named::Joint(joint) => {
                    content.joints.insert(joint);
                    content.links.insert(robot.description.joints[joint].child);
                }
                Named::Virtual(joint) => {
                    content.virtual_joints.insert(joint);
                    content.links.insert(virtual_joints[joint].child_link);
                }
            },
            "chain" => {
                let (base, tip) = (robot.link(element, "base_link")?, robot.link(element, "tip_link")?);
                add_chain(&mut content, robot, base, tip);
            }
            "group" => {
                let name = element.required_attribute("name")?;
                let subgroup = groups.get(name).ok_or_else(|| unknown(element, "name", "group"))?;
                content.subgroups.insert(*subgroup);
            }
            _ => {}
        }
    }
    Ok(content)
}

/// Adds the way between two links: both go up to the root, and what they share counts only from
/// the link where they meet.
fn add_chain(content: &mut Content, robot: &Robot<'_>, base: usize, tip: usize) {
    let ((base_joints, base_links), (tip_joints, tip_links)) = (robot.to_root(base), robot.to_root(tip));
    let same = |(one, other): &(&usize, &usize)| one == other;
    let shared = base_joints.iter().rev().zip(tip_joints.iter().rev()).take_while(same).count();
    for (joints, links) in [(base_joints, base_links), (tip_joints, tip_links)] {
        let steps = joints.len() - shared;
        content.joints.extend(&joints[..steps]);
        content.links.extend(&links[..=steps]);
    }
}

/// Adds to each group what its subgroups have, innermost first.
fn add_subgroups(contents: &mut [Content], elements: &[Element<'_, '_>]) -> Result<(), DescriptionError> {
    let mut done = vec![false; contents.len()];
    loop {
        let is_ready = |index: &usize| !done[*index] && contents[*index].subgroups.iter().all(|group| done[*group]);
        let ready: Vec<usize> = (0..contents.len()).filter(is_ready).collect();
        if ready.is_empty() {
            break;
        }
        for index in ready {
            for subgroup in contents[index].subgroups.clone() {
                let inner = &contents[subgroup];
                let (joints, links) = (inner.joints.clone(), inner.links.clone());
                let virtual_joints = inner.virtual_joints.clone();
                contents[index].joints.extend(joints);
                contents[index].virtual_joints.extend(virtual_joints);
                contents[index].links.extend(links);
            }
            done[index] = true;
        }
    }
    match done.iter().position(|done| !done) {
        None => Ok(()),
        Some(first) => Err(cycle(contents, elements, &done, first)),
    }
}

/// From a group that is not done, subgroups that are not done lead into a cycle.
fn cycle(contents: &[Content], elements: &[Element<'_, '_>], done: &[bool], first: usize) -> DescriptionError {
    let mut way = vec![first];
    let mut at = first;
    while let Some(next) = contents[at].subgroups.iter().copied().find(|group| !done[*group]) {
        let seen = way.iter().position(|group| *group == next);
        way.push(next);
        if let Some(start) = seen {
            way.drain(..start);
            break;
        }
        at = next;
    }
    let names = way.iter().map(|group| elements[*group].attribute("name").unwrap_or_default());
    let problem = format!("the group has itself inside: {}", quoted_list(names));
    let element = way.first().map_or(elements[first], |group| elements[*group]);
    element.error(problem, "remove one of these subgroups")
}
