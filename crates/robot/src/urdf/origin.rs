//! Where a part is: `<origin xyz="..." rpy="..."/>`.

use nalgebra::{Isometry3, Translation3, UnitQuaternion};

use super::geometry::MOST_METRES;
use crate::error::DescriptionError;
use crate::xml::{Element, quoted};

/// The pose of the `<origin>` of an element, the identity if there is none: frame of the element to
/// the frame that it is in, metres. Its rotation is `Rz(yaw) Ry(pitch) Rx(roll)`.
pub(super) fn origin(parent: Element<'_, '_>) -> Result<Isometry3<f64>, DescriptionError> {
    let Some(element) = parent.optional("origin")? else { return Ok(Isometry3::identity()) };
    check_attributes(element)?;
    let [x, y, z] = element.numbers("xyz")?.unwrap_or_default();
    if [x, y, z].iter().any(|metres: &f64| metres.abs() > MOST_METRES) {
        let problem = format!("xyz holds a number beyond {MOST_METRES:e} metres");
        return Err(element.attribute_error("xyz", problem, "lengths are in metres"));
    }
    let [roll, pitch, yaw] = element.numbers("rpy")?.unwrap_or_default();
    Ok(Isometry3::from_parts(Translation3::new(x, y, z), UnitQuaternion::from_euler_angles(roll, pitch, yaw)))
}

/// Any other attribute could be a rotation that would be left out.
fn check_attributes(element: Element<'_, '_>) -> Result<(), DescriptionError> {
    match element.attributes().find(|(name, _)| !["xyz", "rpy"].contains(name)) {
        None => Ok(()),
        Some((name, _)) => {
            let problem = format!("an origin has no attribute {}", quoted(name));
            Err(element.attribute_error(name, problem, "write the position as xyz and the rotation as rpy"))
        }
    }
}
