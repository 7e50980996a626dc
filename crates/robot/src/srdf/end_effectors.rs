//! End effectors.

use std::collections::HashSet;

use super::robot::Robot;
use super::states::group;
use crate::error::DescriptionError;
use crate::semantics::{EndEffector, Group};
use crate::xml::{Element, check_unique};

/// The end effectors of a file.
pub(super) fn read(
    root: Element<'_, '_>,
    robot: &Robot<'_>,
    groups: &[Group],
) -> Result<Vec<EndEffector>, DescriptionError> {
    let mut names = HashSet::new();
    let mut found = Vec::new();
    for element in root.named("end_effector") {
        let name = element.required_name("name")?;
        check_unique(&mut names, element, name)?;
        // Some programs write an empty one.
        let parent_group = element.attribute("parent_group").filter(|name| !name.is_empty());
        found.push(EndEffector {
            name: name.into(),
            group: group(element, "group", groups)?,
            parent_link: robot.link(element, "parent_link")?,
            parent_group: parent_group.map(|_| group(element, "parent_group", groups)).transpose()?,
        });
    }
    Ok(found)
}
