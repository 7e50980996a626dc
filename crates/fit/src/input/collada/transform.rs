//! Transformations of COLLADA's nodes.

use super::xml::{Xml, numbers, place_of};
use crate::input::error::Defect;
use nalgebra::{Matrix3, Rotation3, Unit, Vector3};

/// `x -> linear x + translation`, in units of the file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Affine {
    linear: Matrix3<f64>,
    translation: Vector3<f64>,
}

impl Affine {
    pub(super) fn identity() -> Self {
        Self { linear: Matrix3::identity(), translation: Vector3::zeros() }
    }

    pub(super) fn apply(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.linear * x + self.translation
    }

    /// Whether it turns the inside of a closed mesh out.
    pub(super) fn mirrors(&self) -> bool {
        self.linear.determinant() < 0.0
    }

    /// First `inner`, then this.
    fn after(&self, inner: &Self) -> Self {
        Self { linear: self.linear * inner.linear, translation: self.apply(&inner.translation) }
    }

    fn linear(linear: Matrix3<f64>) -> Self {
        Self { linear, translation: Vector3::zeros() }
    }

    /// The frame of a node in that of the scene, `self` being that of the node around it: the
    /// transformations that it lists, the last one applied to a point first.
    ///
    /// # Errors
    /// A transformation that is none, or of a kind that is not read.
    pub(super) fn of_node(&self, node: Xml<'_, '_>) -> Result<Self, Defect> {
        let mut frame = *self;
        for element in node.children().filter(Xml::is_element) {
            if let Some(step) = step(element)? {
                frame = frame.after(&step);
            }
        }
        Ok(frame)
    }
}

/// The transformation that an element is, if it is one.
fn step(element: Xml<'_, '_>) -> Result<Option<Affine>, Defect> {
    let values = |count: usize| {
        let values = numbers(element)?;
        if values.len() == count {
            return Ok(values);
        }
        Err(Defect::new(place_of(element), format!("{} numbers where {count} are expected", values.len())))
    };
    Ok(Some(match element.tag_name().name() {
        "matrix" => {
            let m = values(16)?;
            if m[12..] != [0.0, 0.0, 0.0, 1.0] {
                return Err(Defect::new(place_of(element), "the last row is not 0 0 0 1"));
            }
            let linear = Matrix3::from_fn(|i, j| m[4 * i + j]);
            Affine { linear, translation: Vector3::new(m[3], m[7], m[11]) }
        }
        "translate" => Affine { translation: Vector3::from_column_slice(&values(3)?), ..Affine::identity() },
        "scale" => Affine::linear(Matrix3::from_diagonal(&Vector3::from_column_slice(&values(3)?))),
        "rotate" => {
            let v = values(4)?;
            let axis = Unit::try_new(Vector3::new(v[0], v[1], v[2]), 0.0);
            match axis {
                Some(axis) => Affine::linear(*Rotation3::from_axis_angle(&axis, v[3].to_radians()).matrix()),
                // Programs write a rotation by nothing about no axis.
                None if v[3] == 0.0 => Affine::identity(),
                None => return Err(Defect::new(place_of(element), "the axis of the rotation is 0")),
            }
        }
        name @ ("lookat" | "skew") => {
            let reason = format!("the transformation {name} is not read");
            return Err(Defect::new(place_of(element), reason).remedy("export transformations as matrices"));
        }
        _ => return Ok(None),
    }))
}
