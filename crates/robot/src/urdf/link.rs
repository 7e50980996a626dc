//! Links: names and collision geometry.

use std::collections::HashSet;

use super::geometry::geometry;
use super::origin::origin;
use crate::description::{Collision, Link};
use crate::error::DescriptionError;
use crate::xml::{Element, Vocabulary, check_unique};

/// Most links of a robot.
const MOST_LINKS: usize = 1000;

const LINK: Vocabulary = Vocabulary {
    read: &["collision"],
    ignored: &["inertial", "visual", "contact", "material", "sensor", "gazebo", "self_collision_checking"],
};

const COLLISION: Vocabulary = Vocabulary {
    read: &["origin", "geometry"],
    ignored: &["material", "contact", "contact_coefficients", "surface", "verbose"],
};

/// The links of a robot, in the order of the file.
pub(super) fn links(robot: Element<'_, '_>) -> Result<Vec<Link>, DescriptionError> {
    if let Some(link) = robot.named("link").nth(MOST_LINKS) {
        let problem = format!("the robot has more than {MOST_LINKS} links");
        return Err(link.error(problem, "describe what does not move together as several robots"));
    }
    let mut names = HashSet::new();
    let read =
        |link: Element<'_, '_>| Ok(Link { name: link.required_name("name")?.into(), collisions: collisions(link)? });
    let mut links = Vec::new();
    for element in robot.named("link") {
        links.push(read(element)?);
        check_unique(&mut names, element, element.required_name("name")?)?;
    }
    Ok(links)
}

fn collisions(link: Element<'_, '_>) -> Result<Vec<Collision>, DescriptionError> {
    LINK.check_children(link)?;
    link.named("collision").map(collision).collect()
}

fn collision(element: Element<'_, '_>) -> Result<Collision, DescriptionError> {
    COLLISION.check_children(element)?;
    let shape = element.required("geometry", "give it a <geometry>, or remove the <collision>")?;
    Ok(Collision { origin: origin(element)?, geometry: geometry(shape)? })
}
