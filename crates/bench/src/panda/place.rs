//! The arm among the obstacles of a problem, as a scene.

use std::error::Error;
use std::sync::Arc;

use sublevel::body::BodyId;
use sublevel::measure::Pose;
use sublevel::scene::{Geometry, NamedJointValues, PlaceRobot, Placement, Scene, Subject, Update};

use super::problems::Problem;
use super::representation::LoadedArm;

/// Name of the arm in its scenes.
pub(super) const ARM: &str = "panda";

/// The link that stands: it counts against the other links only.
pub(super) const BASE_LINK: &str = "panda_link0";

/// Group of the obstacles.
const OBSTACLES: &str = "obstacles";

/// A problem with the bodies of its obstacles, which all representations of the arm share.
pub(crate) struct Site<'a> {
    pub(super) problem: &'a Problem,
    /// Places the obstacles.
    pub(super) update: Update,
    pub(super) geometries: Vec<Geometry>,
}

impl<'a> Site<'a> {
    /// Makes the bodies.
    ///
    /// # Errors
    /// Obstacles that are no boxes or cylinders.
    pub(crate) fn new(problem: &'a Problem) -> Result<Self, Box<dyn Error>> {
        let (mut update, mut geometries) = (Update::default(), Vec::new());
        for (index, (body, pose)) in problem.obstacles()?.into_iter().enumerate() {
            let (name, group): (Arc<str>, Arc<str>) = (format!("obstacle {index:02}").into(), OBSTACLES.into());
            let body = Geometry::from(body);
            let placement =
                Placement { name, body: *body.id(), pose: Some(pose), group, padding_m: None, attachment: None };
            update.upserts.push(placement);
            geometries.push(body);
        }
        Ok(Self { problem, update, geometries })
    }

    /// The scenes without and with self-collision.
    pub(super) fn scenes(&self, arm: &LoadedArm) -> Result<[Scene; 2], Box<dyn Error>> {
        let (name, robot, joints) = (Arc::from(ARM), arm.robot.clone(), NamedJointValues::default());
        let mut update = self.update.clone();
        update.robots.push(PlaceRobot { name, robot, base: Pose::identity(), joints });
        let body = |id: &BodyId| self.geometries.iter().find(|body| body.id() == id).cloned();
        let placed = Scene::new("problem", 0)?.updated(&update, body)?;
        let [without, with] = [false, true].map(|own| placed.updated(&rules(own), |_: &BodyId| None));
        Ok([without?, with?])
    }
}

/// Pairs that may touch besides those of the SRDF: the base and the obstacles, of which neither
/// moves, and without self-collision all links.
pub(super) fn rules(self_collision: bool) -> Update {
    let group = |name: &str| Subject::Group(name.into());
    let base = Subject::Object(format!("{ARM}/{BASE_LINK}").into());
    let mut update = Update { allow: vec![(base, group(OBSTACLES))], ..Update::default() };
    if !self_collision {
        update.allow.push((group(ARM), group(ARM)));
    }
    update
}
