//! Exact bodies: ball, ellipsoid, box, cylinder, and even powers.

use super::{Body, BodyError, Constraint, Normalization};
use crate::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial};
use nalgebra::{DMatrix, Matrix3, Vector3};

/// `Σ_{i in axes} z_i^degree` with its diagonal certificate `degree (degree - 1)` on `y_i
/// z_i^(degree/2 - 1)`.
fn even_powers(axes: &[usize], degree: u8) -> Constraint {
    let along = |axis: usize, power: u8| -> Exponents { std::array::from_fn(|j| if j == axis { power } else { 0 }) };
    let terms = axes.iter().map(|&axis| (along(axis, degree), 1.0)).collect();
    let basis = axes
        .iter()
        .map(|&axis| HessianMonomial { direction: axis as u8, exponents: along(axis, degree / 2 - 1) })
        .collect();
    let diagonal = f64::from(degree) * f64::from(degree - 1);
    let matrix = DMatrix::identity(axes.len(), axes.len()) * diagonal;
    // Both are well formed for every even degree from 2 to 8, the only ones asked for here.
    let polynomial = Polynomial::new(terms).expect("an even power is a polynomial");
    let gram = HessianGram::new(basis, matrix).expect("a diagonal matrix is a certificate");
    Constraint { polynomial, gram }
}

impl Body {
    /// The ball of `radius` metres about `center`: one quadratic.
    ///
    /// # Errors
    /// A radius that is not positive and finite, or a bad name.
    pub fn ball(name: &str, center: Vector3<f64>, radius: f64) -> Result<Self, BodyError> {
        Self::ellipsoid(name, center, Vector3::from_element(radius))
    }

    /// The axis-aligned ellipsoid with these half-axes in metres about `center`: one quadratic.
    ///
    /// # Errors
    /// A half-axis that is not positive and finite, or a bad name.
    pub fn ellipsoid(name: &str, center: Vector3<f64>, half_axes: Vector3<f64>) -> Result<Self, BodyError> {
        Self::superellipsoid(name, center, half_axes, 2)
    }

    /// The axis-aligned body `Σ ((x_i - c_i) / a_i)^degree <= 1` of even degree 2 to 8, half-axes
    /// in metres.
    ///
    /// # Errors
    /// A half-axis that is not positive and finite, a bad name, or another degree.
    pub fn superellipsoid(
        name: &str,
        center: Vector3<f64>,
        half_axes: Vector3<f64>,
        degree: u8,
    ) -> Result<Self, BodyError> {
        if !matches!(degree, 2 | 4 | 6 | 8) {
            return Err(BodyError::Degree(degree));
        }
        Self::new(name, axis_aligned(center, half_axes)?, vec![even_powers(&[0, 1, 2], degree)])
    }

    /// The box with these half-extents in metres about the origin: three quadratics, one per pair
    /// of faces.
    ///
    /// # Errors
    /// A half-extent that is not positive and finite, or a bad name.
    pub fn cuboid(name: &str, half_extents: Vector3<f64>) -> Result<Self, BodyError> {
        let slabs = (0..3).map(|axis| even_powers(&[axis], 2)).collect();
        Self::new(name, axis_aligned(Vector3::zeros(), half_extents)?, slabs)
    }

    /// The cylinder about the z axis through the origin, metres: one quadratic for its wall, one
    /// for its caps.
    ///
    /// # Errors
    /// A size that is not positive and finite, or a bad name.
    pub fn cylinder(name: &str, radius: f64, half_height: f64) -> Result<Self, BodyError> {
        let normalization = axis_aligned(Vector3::zeros(), Vector3::new(radius, radius, half_height))?;
        Self::new(name, normalization, vec![even_powers(&[0, 1], 2), even_powers(&[2], 2)])
    }
}

fn axis_aligned(center: Vector3<f64>, half_sizes: Vector3<f64>) -> Result<Normalization, BodyError> {
    if !half_sizes.iter().all(|&size| size > 0.0 && size.is_finite()) {
        return Err(BodyError::Normalization("a size is not positive and finite"));
    }
    Ok(Normalization { center, linear: Matrix3::from_diagonal(&half_sizes.map(|size| 1.0 / size)) })
}
