//! Capsules with a name, as limbs and rounded rods.

use nalgebra::Vector3;
use sublevel_core::body::{Aabb, BodyError, BodyId, check_name};
use sublevel_core::measure::Capsule;

/// A capsule about the z axis of the body frame, with a name.
#[derive(Clone, Debug)]
pub struct NamedCapsule {
    name: String,
    id: BodyId,
    capsule: Capsule,
    bounding_box: Aabb,
}

impl NamedCapsule {
    /// A capsule with a name.
    ///
    /// # Errors
    /// A name that bodies may not have either.
    pub fn new(name: &str, capsule: Capsule) -> Result<Self, BodyError> {
        check_name(name)?;
        let radius = capsule.radius_m();
        let half = Vector3::new(radius, radius, capsule.reach_m().next_up());
        let id = BodyId::of_capsule(radius, capsule.half_height_m());
        Ok(Self { name: name.to_owned(), id, capsule, bounding_box: Aabb { min: -half, max: half } })
    }

    /// Name given by its maker.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Hash of its sizes.
    pub fn id(&self) -> &BodyId {
        &self.id
    }

    /// The capsule in the body frame.
    pub fn capsule(&self) -> &Capsule {
        &self.capsule
    }

    /// The box around it in the body frame, metres.
    pub fn bounding_box(&self) -> &Aabb {
        &self.bounding_box
    }

    /// Volume, m³.
    pub fn volume_m3(&self) -> f64 {
        let (radius, half) = (self.capsule.radius_m(), self.capsule.half_height_m());
        std::f64::consts::PI * radius * radius * (2.0 * half + 4.0 / 3.0 * radius)
    }
}
