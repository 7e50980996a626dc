//! Which links of a robot can touch each other at all.

use std::ops::ControlFlow;
use std::sync::Arc;

use sublevel_core::measure::Pose;
use sublevel_robot::motion::{
    DeriveOptions, DerivedPair, MotionBody, MotionItem, MotionProblem, MotionProblemError, MotionRobot, MotionShape,
    PairClass,
};

use super::Robot;
use crate::geometry::Geometry;
use crate::object::Object;

/// Two links, and whether they can be in contact at any joint values within the limits.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedLinks {
    /// Positions of the links in [`Kinematics::links`](sublevel_robot::Kinematics::links), the
    /// first before the second.
    pub links: [usize; 2],
    /// What is known of their bodies.
    pub pair: DerivedPair,
    /// Whether the convex hulls of the links, or of their parts, are in contact: it is deeper than
    /// the gaps of both bodies together. False where there is none.
    pub is_certain: bool,
}

/// How far the search is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DeriveProgress {
    /// Pairs before the one that is looked at.
    pub done: usize,
    /// Pairs that there are.
    pub pairs: usize,
    /// Boxes of joint values that were looked at for the pair.
    pub boxes: u32,
}

impl Robot {
    /// Whether each pair of links with geometry can be nearer than `margin_m`, metres, at any joint
    /// values within their limits: proven, by branch and bound, see [`MotionProblem::derive`].
    /// Pairs that the robot allows are looked at as well. `progress` can end the search; what was
    /// not looked at is undecided then.
    ///
    /// # Errors
    /// A margin that is not finite, and bodies that make too many pairs of pieces.
    pub fn derive_pairs(
        &self,
        margin_m: f64,
        options: &DeriveOptions,
        progress: &mut dyn FnMut(DeriveProgress) -> ControlFlow<()>,
    ) -> Result<Vec<DerivedLinks>, MotionProblemError> {
        let mut bodies = Vec::new();
        for (link, of_link) in self.links().iter().enumerate() {
            let Some(of_link) = of_link else { continue };
            let name = self.kinematics().links()[link].clone();
            if let Some(shape) = shape(&name, &of_link.geometry) {
                bodies.push(MotionBody { name, link, place: Pose::identity(), shape });
            }
        }
        let links: Vec<usize> = bodies.iter().map(|body| body.link).collect();
        let robot = MotionRobot { kinematics: self.kinematics().clone(), base: Pose::identity(), bodies };
        let problem = MotionProblem::new(robot, Vec::new(), margin_m, |_, _| Some(0.0))?;
        let pairs: Vec<_> = problem.body_pairs().collect();
        let derived = pairs.iter().enumerate().map(|(done, &items)| {
            let mut said = |boxes| progress(DeriveProgress { done, pairs: pairs.len(), boxes });
            let pair = problem.derive(items, options, &mut said);
            let links = items.map(|item| match item {
                MotionItem::Body(index) | MotionItem::Obstacle(index) => links[index],
            });
            self.classified(links, pair, margin_m)
        });
        Ok(derived.collect())
    }

    /// The box around an sos-body is in contact where the body need not be.
    fn classified(&self, links: [usize; 2], mut pair: DerivedPair, margin_m: f64) -> DerivedLinks {
        let geometries = links.map(|link| self.links()[link].as_ref().map(|link| &link.geometry));
        let is_box = geometries.iter().flatten().any(|geometry| matches!(geometry, Geometry::SosBody(_)));
        if is_box && matches!(pair.class, PairClass::Always | PairClass::Collides) {
            pair.class = PairClass::Undecided;
        }
        let [a, b] = geometries.map(|geometry| geometry.and_then(Geometry::gap_m));
        let gaps = a.zip(b).map(|(a, b)| a + b);
        let is_certain = pair.witness.is_some() && gaps.is_some_and(|gaps| pair.upper_m < margin_m - gaps);
        DerivedLinks { links, pair, is_certain }
    }
}

/// The finest body of a link, the box around an sos-body.
fn shape(name: &Arc<str>, geometry: &Geometry) -> Option<MotionShape> {
    if let Geometry::Capsule(capsule) = geometry {
        return Some(MotionShape::Capsule(*capsule.capsule()));
    }
    let object = Object::new(name.clone(), geometry.clone(), "".into(), None, None);
    object.solids().last().map(|solid| MotionShape::Solid(solid.clone()))
}
