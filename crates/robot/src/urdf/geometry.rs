//! Shapes: `<geometry>` with a box, cylinder, sphere, capsule or mesh.

use nalgebra::Vector3;

use crate::description::Geometry;
use crate::error::DescriptionError;
use crate::xml::{Element, Vocabulary, quoted};

/// Largest size and distance.
pub(super) const MOST_METRES: f64 = 1e6;
/// Least and largest factor of a mesh, by absolute value.
const FACTORS: std::ops::RangeInclusive<f64> = 1e-9..=1e9;
/// Most bytes of the path of a mesh.
const MOST_URI_BYTES: usize = 4096;

const SHAPES: &str = "box, cylinder, sphere, capsule or mesh";

/// Reads a `<geometry>`.
pub(super) fn geometry(element: Element<'_, '_>) -> Result<Geometry, DescriptionError> {
    let mut shapes = element.children_of_all_namespaces();
    let Some(shape) = shapes.next() else {
        return Err(element.error("it has no shape", format!("give it a {SHAPES}")));
    };
    if let Some(second) = shapes.next() {
        return Err(
            second.error("this is the second shape of its geometry", "give each shape a <collision> of its own")
        );
    }
    match shape.name() {
        "box" => cuboid(shape),
        "cylinder" => {
            let (radius_m, length_m) = round(shape)?;
            Ok(Geometry::Cylinder { radius_m, length_m })
        }
        "sphere" => {
            check_attributes(shape, &["radius"])?;
            Ok(Geometry::Sphere { radius_m: size(shape, "radius")? })
        }
        "capsule" => {
            let (radius_m, length_m) = round(shape)?;
            Ok(Geometry::Capsule { radius_m, length_m })
        }
        "mesh" => mesh(shape),
        other => Err(shape.error(format!("the shape {} is not read", quoted(other)), format!("use a {SHAPES}"))),
    }
}

fn cuboid(shape: Element<'_, '_>) -> Result<Geometry, DescriptionError> {
    check_attributes(shape, &["size"])?;
    let sides = shape.required_numbers("size")?;
    for side in sides {
        check_size(shape, "size", side)?;
    }
    Ok(Geometry::Box { sides_m: sides.into() })
}

/// Radius and length, metres.
fn round(shape: Element<'_, '_>) -> Result<(f64, f64), DescriptionError> {
    check_attributes(shape, &["radius", "length"])?;
    Ok((size(shape, "radius")?, size(shape, "length")?))
}

fn mesh(shape: Element<'_, '_>) -> Result<Geometry, DescriptionError> {
    check_attributes(shape, &["filename", "scale"])?;
    let uri = shape.required_attribute("filename")?;
    let problem = if uri.trim().is_empty() {
        Some("filename is empty".into())
    } else if uri.len() > MOST_URI_BYTES || uri.chars().any(char::is_control) {
        Some(format!("filename is {}, which is too long or has control characters", quoted(uri)))
    } else {
        None
    };
    if let Some(problem) = problem {
        return Err(shape.attribute_error("filename", problem, "write a path, file://... or package://NAME/..."));
    }
    let scale = shape.numbers("scale")?.unwrap_or([1.0; 3]);
    if let Some(factor) = scale.iter().find(|factor| !FACTORS.contains(&factor.abs())) {
        let problem = format!("scale holds {factor:?}, whose absolute value is not in 1e-9 to 1e9");
        return Err(shape.attribute_error("scale", problem, "write three factors, such as 0.001 0.001 0.001"));
    }
    Ok(Geometry::Mesh { uri: uri.into(), scale: Vector3::from(scale) })
}

/// A size of the shape, metres.
fn size(shape: Element<'_, '_>, attribute: &str) -> Result<f64, DescriptionError> {
    let [size] = shape.required_numbers(attribute)?;
    check_size(shape, attribute, size)
}

fn check_size(shape: Element<'_, '_>, attribute: &str, size: f64) -> Result<f64, DescriptionError> {
    if size > 0.0 && size <= MOST_METRES {
        return Ok(size);
    }
    let problem = format!("{attribute} holds {size:?}, which is not above 0 and at most {MOST_METRES:e}");
    Err(shape.attribute_error(attribute, problem, "write sizes in metres"))
}

fn check_attributes(shape: Element<'_, '_>, read: &'static [&'static str]) -> Result<(), DescriptionError> {
    Vocabulary { read, ignored: &[] }.check_attributes(shape)
}
