//! Joints that follow others: `<mimic joint="..." multiplier="..." offset="..."/>`.

use std::collections::HashMap;

use crate::description::{Joint, JointKind, Mimic};
use crate::error::DescriptionError;
use crate::xml::{Element, Vocabulary, quoted, quoted_list};

const MIMIC: Vocabulary = Vocabulary { read: &["joint", "multiplier", "offset"], ignored: &[] };

/// Adds to joints what they follow.
pub(super) fn resolve(joints: &mut [Joint], elements: &[Element<'_, '_>]) -> Result<(), DescriptionError> {
    let names: HashMap<_, _> = joints.iter().enumerate().map(|(index, joint)| (joint.name.clone(), index)).collect();
    let mut places = vec![None; joints.len()];
    for (index, element) in elements.iter().enumerate() {
        let Some(mimic) = element.optional("mimic")? else { continue };
        let read = read(mimic, &names)?;
        // A fixed joint has no value that could follow; files that fix a gripper leave this there.
        if joints[index].kind == JointKind::Fixed {
            continue;
        }
        check_width(mimic, &joints[index], &joints[read.joint])?;
        joints[index].mimic = Some(read);
        places[index] = Some(mimic);
    }
    for (index, place) in places.iter().enumerate() {
        if let Some(mimic) = place {
            check_chain(*mimic, joints, index)?;
        }
    }
    Ok(())
}

fn read(mimic: Element<'_, '_>, names: &HashMap<std::sync::Arc<str>, usize>) -> Result<Mimic, DescriptionError> {
    MIMIC.check_attributes(mimic)?;
    let name = mimic.required_attribute("joint")?;
    let Some(joint) = names.get(name).copied() else {
        let problem = format!("joint is {}, and the robot has no joint of this name", quoted(name));
        return Err(mimic.attribute_error("joint", problem, "correct the name, or remove the <mimic>"));
    };
    let multiplier = mimic.number("multiplier")?.unwrap_or(1.0);
    Ok(Mimic { joint, multiplier, offset: mimic.number("offset")?.unwrap_or(0.0) })
}

fn check_width(mimic: Element<'_, '_>, follower: &Joint, followed: &Joint) -> Result<(), DescriptionError> {
    match [follower, followed].into_iter().find(|joint| joint.kind.width() != 1) {
        None => Ok(()),
        Some(joint) => {
            let (name, width) = (quoted(&joint.name), joint.kind.width());
            let problem = format!("the joint {name} has {width} values, and only joints with one value follow");
            let remedy = "follow a revolute, continuous or prismatic joint, or remove the <mimic>";
            Err(mimic.error(problem, remedy))
        }
    }
}

/// Refuses a joint that follows a follower, or itself.
fn check_chain(mimic: Element<'_, '_>, joints: &[Joint], index: usize) -> Result<(), DescriptionError> {
    let Some(own) = joints[index].mimic else { return Ok(()) };
    let Some(next) = joints[own.joint].mimic else { return Ok(()) };
    let mut chain = vec![index];
    let mut at = Some(own.joint);
    while let Some(joint) = at {
        let seen = chain.contains(&joint);
        chain.push(joint);
        if seen {
            break;
        }
        at = joints[joint].mimic.map(|mimic| mimic.joint);
    }
    if chain[1..].contains(&index) {
        let names = chain.iter().map(|joint| &*joints[*joint].name);
        let problem = format!("the joint follows itself: {}", quoted_list(names));
        return Err(mimic.error(problem, "let one of them have a value of its own: remove its <mimic>"));
    }
    let (followed, target) = (&joints[own.joint].name, &joints[next.joint].name);
    let problem = format!("the joint follows {}, which follows {}", quoted(followed), quoted(target));
    let (multiplier, offset) = (own.multiplier * next.multiplier, own.multiplier * next.offset + own.offset);
    let remedy = format!("write joint={} multiplier=\"{multiplier:?}\" offset=\"{offset:?}\"", quoted(target));
    Err(mimic.error(problem, remedy))
}
