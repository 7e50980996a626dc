//! The body file: JSON that any program can read, re-proven whenever it is read.

use super::constraint::Constraint;
use super::contained_file::FileContainedSet;
use super::contained_points::ContainedPoints;
use super::convex_body::Body;
use super::file_error::BodyFileError;
use super::file_format::{
    BODY_KIND, FORMAT, FileBall, FileBox, FileCertificate, FileNormalization, SOS_BODY_KIND, check_format,
    check_scalar, field, kind, read, read_hessian, read_polynomial, write,
};
use super::id::BodyId;
use super::normalization::Normalization;
use super::provenance::Provenance;
use super::support_bounds::deepest_point;
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// The body file of one body, which a compound's file has for each of its parts.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    format: String,
    kind: String,
    id: String,
    name: String,
    degree: usize,
    normalization: FileNormalization,
    constraints: Vec<FileConstraint>,
    interior_point_m: [f64; 3],
    min_value: f64,
    in_radius_m: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    growth_center_m: Option<[f64; 3]>,
    circumscribed_ball: FileBall,
    bounding_box: FileBox,
    volume_m3: f64,
    volume_error_m3: f64,
    gap_m: Option<f64>,
    contained_points: Option<ContainedPoints>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    contained_sets: Vec<FileContainedSet>,
    provenance: Option<Provenance>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileConstraint {
    exponents: Vec<[u8; 3]>,
    coefficients: Vec<f64>,
    certificate: FileCertificate,
}

impl Body {
    /// The body file of this body; reading it back gives the same numbers exactly.
    pub fn to_json(&self) -> String {
        write(&File::from(self), 1)
    }

    /// Reads a body file and re-proves it: the id is recomputed, the certificates are checked,
    /// every derived value is recomputed and compared.
    ///
    /// # Errors
    /// The field that is wrong, the reason and the remedy.
    pub fn from_json(text: &str) -> Result<Self, BodyFileError> {
        if kind(text).is_ok_and(|kind| kind == SOS_BODY_KIND) {
            return Err(BodyFileError::NotConvex);
        }
        Self::from_file(read(text)?)
    }

    pub(super) fn from_file(file: File) -> Result<Self, BodyFileError> {
        check_format(&file.format, &file.kind, BODY_KIND)?;
        let constraints = file
            .constraints
            .iter()
            .enumerate()
            .map(|(i, constraint)| read_constraint(i, constraint))
            .collect::<Result<Vec<_>, _>>()?;
        let normalization = Normalization::from(&file.normalization);
        let interior = Vector3::from(file.interior_point_m);
        let growth_center = file.growth_center_m.map(Vector3::from);
        let recomputed = BodyId::of(&normalization, &constraints, growth_center.as_ref()).to_string();
        if recomputed != file.id {
            return Err(BodyFileError::Derived { field: "id", stored: file.id, recomputed });
        }
        check_notes(&file)?;
        let sets = file.contained_sets.iter().enumerate().map(|(i, set)| set.read(i)).collect::<Result<_, _>>()?;
        let mut body = Self::with_interior(&file.name, normalization, constraints, Some(interior))?;
        check_derived(&file, &body)?;
        if let Some(center) = growth_center {
            body = body.with_growth_center(center)?;
        }
        body.points = file.contained_points;
        body.sets = sets;
        body.gap = file.gap_m;
        body.provenance = file.provenance;
        Ok(body)
    }
}

fn read_constraint(i: usize, constraint: &FileConstraint) -> Result<Constraint, BodyFileError> {
    let place = format!("constraints[{i}]");
    let polynomial = read_polynomial(&place, &constraint.exponents, &constraint.coefficients)?;
    Ok(Constraint { polynomial, gram: read_hessian(&place, &constraint.certificate)? })
}

/// Checks what no proof covers, as far as it can be: notes about the input must at least be
/// possible and printable.
fn check_notes(file: &File) -> Result<(), BodyFileError> {
    if let Some(points) = &file.contained_points {
        points.check("contained_points")?;
    }
    // Both the body and the hull lie in the circumscribed ball.
    if file.gap_m.is_some_and(|gap| !(0.0..=2.0 * file.circumscribed_ball.radius_m).contains(&gap)) {
        return Err(field("gap_m", "must be between 0 and the diameter of the circumscribed ball, or null"));
    }
    if let Some(provenance) = &file.provenance {
        provenance.check()?;
        // A hull inside the body is no larger than the body, up to the quadrature.
        if provenance.hull_volume_m3 > 1.01 * file.volume_m3 {
            return Err(field("provenance.hull_volume_m3", "must be between 0 and the volume of the body"));
        }
    }
    Ok(())
}

/// Compares every derived value with the one recomputed from the polynomials.
fn check_derived(file: &File, body: &Body) -> Result<(), BodyFileError> {
    let size = body.circumscribed.radius;
    let place = size + body.circumscribed.center.amax();
    let scalar = check_scalar;
    let vector = |field, stored: [f64; 3], recomputed: &Vector3<f64>| {
        (0..3).try_for_each(|i| scalar(field, stored[i], recomputed[i], place))
    };
    // The stored interior point was taken as it is; it must be as deep as the deepest.
    let deepest = deepest_point(&body.constraints).1;
    scalar("degree", file.degree as f64, body.degree() as f64, 0.0)?;
    scalar("interior_point_m", body.min_value, deepest, 1.0 + deepest.abs())?;
    scalar("min_value", file.min_value, body.min_value, 1.0 + body.min_value.abs())?;
    scalar("in_radius_m", file.in_radius_m, body.in_radius, size)?;
    vector("circumscribed_ball.center_m", file.circumscribed_ball.center_m, &body.circumscribed.center)?;
    scalar("circumscribed_ball.radius_m", file.circumscribed_ball.radius_m, size, size)?;
    vector("bounding_box.min_m", file.bounding_box.min_m, &body.bounding_box.min)?;
    vector("bounding_box.max_m", file.bounding_box.max_m, &body.bounding_box.max)?;
    scalar("volume_m3", file.volume_m3, body.volume.volume_m3, body.volume.volume_m3)?;
    scalar("volume_error_m3", file.volume_error_m3, body.volume.error_m3, body.volume.volume_m3)?;
    Ok(())
}

impl From<&Body> for File {
    fn from(body: &Body) -> Self {
        Self {
            format: FORMAT.into(),
            kind: BODY_KIND.into(),
            id: body.id.to_string(),
            name: body.name.clone(),
            degree: body.degree(),
            normalization: (&body.normalization).into(),
            constraints: body.constraints.iter().map(FileConstraint::from).collect(),
            interior_point_m: body.interior_point.into(),
            min_value: body.min_value,
            in_radius_m: body.in_radius,
            growth_center_m: body.growth.map(|ball| ball.center.into()),
            circumscribed_ball: (&body.circumscribed).into(),
            bounding_box: (&body.bounding_box).into(),
            volume_m3: body.volume.volume_m3,
            volume_error_m3: body.volume.error_m3,
            gap_m: body.gap,
            contained_points: body.points.clone(),
            contained_sets: body.sets.iter().map(FileContainedSet::from).collect(),
            provenance: body.provenance.clone(),
        }
    }
}

impl From<&Constraint> for FileConstraint {
    fn from(Constraint { polynomial, gram }: &Constraint) -> Self {
        let (exponents, coefficients) = polynomial.terms().iter().copied().unzip();
        Self { exponents, coefficients, certificate: gram.into() }
    }
}
