//! The file of an sos-body: as that of a body, of the kind `sos-body`, and re-proven whenever it is
//! read.

use super::coverage::Coverage;
use super::relaxation::Relaxation;
use super::sos_body::SosBody;
use crate::body::contained_points::ContainedPoints;
use crate::body::file_error::BodyFileError;
use crate::body::file_format::{
    FORMAT, FileBall, FileBox, FileCertificate, FileNormalization, SOS_BODY_KIND, check_format, check_scalar, kind,
    read, read_gram, read_hessian, read_polynomial, rows, write,
};
use crate::body::id::BodyId;
use crate::body::normalization::Normalization;
use crate::body::provenance::Provenance;
use crate::polynomial::{Exponents, SosGram};
use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    format: String,
    kind: String,
    id: String,
    name: String,
    degree: usize,
    normalization: FileNormalization,
    polynomial: FilePolynomial,
    relaxation: Option<FileRelaxation>,
    /// Always: what lies between the points is not proven inside by their being inside.
    points_only: bool,
    circumscribed_ball: FileBall,
    bounding_box: FileBox,
    volume_m3: f64,
    volume_error_m3: f64,
    contained_points: Option<ContainedPoints>,
    coverage: Option<Coverage>,
    provenance: Option<Provenance>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FilePolynomial {
    exponents: Vec<Exponents>,
    coefficients: Vec<f64>,
    certificate: SosCertificate,
}

/// `gram` belongs to the basis `z^(a, b, c)`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SosCertificate {
    basis: Vec<Exponents>,
    gram: Vec<Vec<f64>>,
}

/// `p(z) + c |linear z + offset|^degree` is sos-convex.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileRelaxation {
    c: f64,
    linear: [[f64; 3]; 3],
    offset: [f64; 3],
    certificate: FileCertificate,
}

impl SosBody {
    /// Whether a text names itself the file of an sos-body.
    pub fn is_file(text: &str) -> bool {
        kind(text).is_ok_and(|kind| kind == SOS_BODY_KIND)
    }

    /// The file of this set; reading it back gives the same numbers exactly.
    pub fn to_json(&self) -> String {
        write(&File::from(self), 1)
    }

    /// Reads a file and re-proves it: the id is recomputed, the certificates are checked, every
    /// derived value is recomputed and compared. The coverage needs the mesh and is taken as it is.
    ///
    /// # Errors
    /// The field that is wrong, the reason and the remedy.
    pub fn from_json(text: &str) -> Result<Self, BodyFileError> {
        let file: File = read(text)?;
        check_format(&file.format, &file.kind, SOS_BODY_KIND)?;
        let field = |field: &str, reason: String| BodyFileError::Field { field: field.into(), reason };
        let normalization = Normalization::from(&file.normalization);
        let FilePolynomial { exponents, coefficients, certificate } = &file.polynomial;
        let polynomial = read_polynomial("polynomial", exponents, coefficients)?;
        let matrix = read_gram("polynomial", certificate.basis.len(), &certificate.gram)?;
        let gram = SosGram::new(certificate.basis.clone(), matrix)
            .map_err(|error| field("polynomial.certificate", error.to_string()))?;
        let relaxation = file.relaxation.as_ref().map(FileRelaxation::read).transpose()?;
        let recomputed = BodyId::of_sos(&normalization, &polynomial).to_string();
        if recomputed != file.id {
            return Err(BodyFileError::Derived { field: "id", stored: file.id, recomputed });
        }
        if !file.points_only {
            return Err(field("points_only", "must be true: nothing between the points is proven".into()));
        }
        check_notes(&file)?;
        let mut body = Self::new(&file.name, normalization, polynomial, gram, relaxation)?;
        check_derived(&file, &body)?;
        body.points = file.contained_points;
        body.coverage = file.coverage;
        body.provenance = file.provenance;
        Ok(body)
    }
}

impl FileRelaxation {
    fn read(&self) -> Result<Relaxation, BodyFileError> {
        Ok(Relaxation {
            c: self.c,
            linear: Matrix3::from_fn(|i, j| self.linear[i][j]),
            offset: self.offset.into(),
            gram: read_hessian("relaxation", &self.certificate)?,
        })
    }
}

/// Checks what no proof covers: notes must at least be possible.
fn check_notes(file: &File) -> Result<(), BodyFileError> {
    if let Some(points) = &file.contained_points {
        points.check("contained_points")?;
    }
    if let Some(Coverage { triangles, uncovered, area_m2, uncovered_area_m2, largest }) = &file.coverage {
        let areas = *area_m2 >= 0.0 && (0.0..=*area_m2 * (1.0 + 1e-12)).contains(uncovered_area_m2);
        let one = largest.is_none_or(|largest| {
            largest.triangle < *triangles
                && (0.0..=*uncovered_area_m2 * (1.0 + 1e-12)).contains(&largest.area_m2)
                && !(largest.value_upper <= 1.0)
        });
        if !(areas && one && uncovered <= triangles && (*uncovered > 0) == largest.is_some()) {
            let reason = "its numbers contradict each other; fit the set again".into();
            return Err(BodyFileError::Field { field: "coverage".into(), reason });
        }
    }
    file.provenance.as_ref().map_or(Ok(()), Provenance::check)
}

/// Compares every derived value with the one recomputed from the polynomial.
fn check_derived(file: &File, body: &SosBody) -> Result<(), BodyFileError> {
    let size = body.circumscribed.radius;
    let place = size + body.circumscribed.center.amax();
    let vector = |field, stored: [f64; 3], recomputed: &Vector3<f64>| {
        (0..3).try_for_each(|i| check_scalar(field, stored[i], recomputed[i], place))
    };
    check_scalar("degree", file.degree as f64, body.degree() as f64, 0.0)?;
    vector("circumscribed_ball.center_m", file.circumscribed_ball.center_m, &body.circumscribed.center)?;
    check_scalar("circumscribed_ball.radius_m", file.circumscribed_ball.radius_m, size, size)?;
    vector("bounding_box.min_m", file.bounding_box.min_m, &body.bounding_box.min)?;
    vector("bounding_box.max_m", file.bounding_box.max_m, &body.bounding_box.max)?;
    check_scalar("volume_m3", file.volume_m3, body.volume.volume_m3, body.volume.volume_m3)?;
    check_scalar("volume_error_m3", file.volume_error_m3, body.volume.error_m3, body.volume.volume_m3)
}

impl From<&SosBody> for File {
    fn from(body: &SosBody) -> Self {
        let (exponents, coefficients) = body.polynomial.terms().iter().copied().unzip();
        let certificate = SosCertificate { basis: body.gram.basis().to_vec(), gram: rows(body.gram.matrix()) };
        Self {
            format: FORMAT.into(),
            kind: SOS_BODY_KIND.into(),
            id: body.id.to_string(),
            name: body.name.clone(),
            degree: body.degree(),
            normalization: (&body.normalization).into(),
            polynomial: FilePolynomial { exponents, coefficients, certificate },
            relaxation: body.relaxation.as_ref().map(|relaxation| FileRelaxation {
                c: relaxation.c,
                linear: relaxation.linear.transpose().into(),
                offset: relaxation.offset.into(),
                certificate: (&relaxation.gram).into(),
            }),
            points_only: true,
            circumscribed_ball: (&body.circumscribed).into(),
            bounding_box: (&body.bounding_box).into(),
            volume_m3: body.volume.volume_m3,
            volume_error_m3: body.volume.error_m3,
            contained_points: body.points.clone(),
            coverage: body.coverage,
            provenance: body.provenance.clone(),
        }
    }
}
