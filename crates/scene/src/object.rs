//! What is placed in a scene.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::{Aabb, Ball, Body, Shape, Solid};
use sublevel_core::measure::Pose;

use super::Geometry;

/// Position of an object in its scene; stays the same while the object is there.
pub type Slot = u32;

/// An object without its pose, which is kept apart because it changes far more often.
#[derive(Clone, Debug)]
pub struct Object {
    /// Unique in its scene.
    pub name: Arc<str>,
    /// What it is made of.
    pub geometry: Geometry,
    /// Label that puts objects together; may be empty.
    pub group: Arc<str>,
    /// Padding of its own, metres.
    pub padding_m: Option<f64>,
    /// What holds it, if anything does.
    pub attachment: Option<Attachment>,
    /// Of which link of which robot it is the geometry, if of any.
    pub link: Option<LinkOf>,
    /// The box around an sos-body: what culling and rays take of it.
    pub(crate) enclosure: Option<Arc<Shape>>,
}

/// How an object is held.
#[derive(Clone, Debug, PartialEq)]
pub struct Attachment {
    /// Name of the object that holds it.
    pub to: Arc<str>,
    /// Frame of the held body to the frame of the holder, metres.
    pub pose: Pose,
    /// What it may touch besides its holder.
    pub touch: Vec<Subject>,
}

/// The link that an object is the geometry of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LinkOf {
    /// Name of the robot in the scene.
    pub robot: Arc<str>,
    /// Position of the link in [`Kinematics::links`](sublevel_robot::Kinematics::links).
    pub link: usize,
}

/// An object or a group of objects, by name.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Subject {
    /// One object.
    Object(Arc<str>),
    /// All objects of a group.
    Group(Arc<str>),
}

impl Object {
    pub(crate) fn new(
        name: Arc<str>,
        geometry: Geometry,
        group: Arc<str>,
        padding_m: Option<f64>,
        attachment: Option<Attachment>,
    ) -> Self {
        let enclosure = match &geometry {
            Geometry::SosBody(body) => {
                let bounds = body.bounding_box();
                let (half, middle) = ((bounds.max - bounds.min) * 0.5, (bounds.max + bounds.min) * 0.5);
                // The middle and the half extents are rounded.
                let slack = 4.0 * f64::EPSILON * (bounds.max.amax().max(bounds.min.amax()));
                let half = half.map(|half| half * (1.0 + 4.0 * f64::EPSILON) + slack);
                Body::cuboid(body.name(), half)
                    .and_then(|cuboid| cuboid.moved(&nalgebra::UnitQuaternion::identity(), &middle))
                    .ok()
                    .map(|cuboid| Arc::new(Shape::Body(Box::new(cuboid))))
            }
            _ => None,
        };
        Self { name, geometry, group, padding_m, attachment, link: None, enclosure }
    }

    /// The solids, coarsest first; the box around an sos-body; none for capsules and half-spaces.
    pub(crate) fn solids(&self) -> &[Arc<Shape>] {
        match &self.enclosure {
            Some(enclosure) => std::slice::from_ref(enclosure),
            None => self.geometry.rungs(),
        }
    }

    /// A box around it in its body frame, metres; none around a half-space.
    pub(crate) fn bounding_box(&self) -> Option<&Aabb> {
        self.solids().last().map(|solid| solid.bounding_box()).or_else(|| self.geometry.bounding_box())
    }

    /// A ball around it in its body frame, metres; none around a half-space.
    pub(crate) fn ball(&self) -> Option<Ball> {
        if let Geometry::Capsule(capsule) = &self.geometry {
            return Some(Ball { center: Vector3::zeros(), radius: capsule.capsule().reach_m().next_up() });
        }
        self.solids().last().map(|solid| *solid.circumscribed())
    }
}
