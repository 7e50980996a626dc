//! The body file: JSON that any program can read, re-proven whenever it is read.

use super::contained_file::FileContainedSet;
use super::{
    Aabb, Ball, Body, BodyError, CompoundError, Constraint, ContainedPoints, Normalization, Provenance, SosBodyError,
    sos,
};
use crate::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial};
use nalgebra::{DMatrix, Matrix3, Vector3};
use serde::{Deserialize, Serialize};
use serde_json::ser::{CompactFormatter, Formatter};
use std::io;

pub(super) const FORMAT: &str = "sublevel/1";
const KIND: &str = "body";

/// Relative difference at which a stored derived value is called wrong: far above what another
/// machine's rounding does to it, far below what anybody could mean. Answers always use the
/// recomputed value.
const TOLERANCE: f64 = 1e-7;

/// Why a text is not a valid body file.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum BodyFileError {
    /// Not JSON, or not of this shape.
    #[error("not a body file: {0}; write it with 'sublevel fit' or see the format in the README")]
    Json(String),
    /// Another format or kind.
    #[error("{field} is {found:?} but this version reads {expected:?}; use a matching version of sublevel")]
    Format {
        /// Key in the file.
        field: &'static str,
        /// What it says.
        found: String,
        /// What it should say.
        expected: &'static str,
    },
    /// A defining value is not valid.
    #[error("{field}: {reason}")]
    Field {
        /// Key in the file.
        field: String,
        /// What is wrong with it, with the remedy.
        reason: String,
    },
    /// A stored value that is derived from others differs from what they give.
    #[error(
        "{field} does not follow from the polynomials: stored {stored}, recomputed {recomputed}; the file was changed, fit the body again"
    )]
    Derived {
        /// Key in the file.
        field: &'static str,
        /// Value in the file.
        stored: String,
        /// Value that follows.
        recomputed: String,
    },
    /// The proof fails.
    #[error(transparent)]
    Body(#[from] BodyError),
    /// The set of an sos-body where a convex body is needed.
    #[error(
        "kind is \"sos-body\": its set need not be convex, so that what bounds distances of convex bodies proves nothing of it; \
         fit a convex body to the same object ('sublevel fit' without --relax-convexity and inverse-moment)"
    )]
    NotConvex,
    /// The proof of an sos-body fails.
    #[error(transparent)]
    SosBody(#[from] SosBodyError),
    /// A part of a compound is wrong.
    #[error("parts[{index}]: {source}")]
    Part {
        /// Which part.
        index: usize,
        /// What is wrong with it.
        source: Box<BodyFileError>,
    },
    /// The parts do not make a compound.
    #[error(transparent)]
    Compound(#[from] CompoundError),
}

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
pub(super) struct FileNormalization {
    pub(super) center: [f64; 3],
    pub(super) linear: [[f64; 3]; 3],
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileConstraint {
    exponents: Vec<[u8; 3]>,
    coefficients: Vec<f64>,
    certificate: FileCertificate,
}

/// `gram` belongs to the basis `y_i z^(a, b, c)`, each element stored as `[i, a, b, c]`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileCertificate {
    basis: Vec<[u8; 4]>,
    gram: Vec<Vec<f64>>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileBall {
    pub(super) center_m: [f64; 3],
    pub(super) radius_m: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileBox {
    pub(super) min_m: [f64; 3],
    pub(super) max_m: [f64; 3],
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
        if kind(text).is_ok_and(|kind| kind == sos::KIND) {
            return Err(BodyFileError::NotConvex);
        }
        Self::from_file(read(text)?)
    }

    pub(super) fn from_file(file: File) -> Result<Self, BodyFileError> {
        check_format(&file.format, &file.kind, KIND)?;
        let constraints = file
            .constraints
            .iter()
            .enumerate()
            .map(|(i, constraint)| read_constraint(i, constraint))
            .collect::<Result<Vec<_>, _>>()?;
        let normalization = Normalization::from(&file.normalization);
        let interior = Vector3::from(file.interior_point_m);
        let growth_center = file.growth_center_m.map(Vector3::from);
        let recomputed = super::BodyId::of(&normalization, &constraints, growth_center.as_ref()).to_string();
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

/// The data of a file of some kind.
pub(super) fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, BodyFileError> {
    serde_json::from_str(text).map_err(|error| BodyFileError::Json(error.to_string()))
}

/// What kind a file says it is of.
pub(super) fn kind(text: &str) -> Result<String, BodyFileError> {
    #[derive(Deserialize)]
    struct Header {
        kind: String,
    }
    Ok(read::<Header>(text)?.kind)
}

/// Refuses another format, or another kind than the expected.
pub(super) fn check_format(format: &str, kind: &str, expected: &'static str) -> Result<(), BodyFileError> {
    for (field, found, expected) in [("format", format, FORMAT), ("kind", kind, expected)] {
        if found != expected {
            return Err(BodyFileError::Format { field, found: found.into(), expected });
        }
    }
    Ok(())
}

/// JSON text of a file, a line per key of its objects down to so many levels.
pub(super) fn write(file: &impl Serialize, levels: usize) -> String {
    let mut text = Vec::new();
    let mut serializer = serde_json::Serializer::with_formatter(&mut text, LinePerKey { levels, depth: 0 });
    // Writing plain data to memory does not fail, and JSON is UTF-8.
    let _ = file.serialize(&mut serializer);
    text.push(b'\n');
    String::from_utf8_lossy(&text).into_owned()
}

/// A polynomial as a file has it: `place` names it in errors.
pub(super) fn read_polynomial(
    place: &str,
    exponents: &[Exponents],
    coefficients: &[f64],
) -> Result<Polynomial, BodyFileError> {
    let field = |key: &str, reason: String| BodyFileError::Field { field: format!("{place}.{key}"), reason };
    if exponents.len() != coefficients.len() {
        let reason =
            format!("has {} entries for {} exponents; one is needed per exponent", coefficients.len(), exponents.len());
        return Err(field("coefficients", reason));
    }
    let terms: Vec<_> = exponents.iter().copied().zip(coefficients.iter().copied()).collect();
    let polynomial = Polynomial::new(terms.clone()).map_err(|error| field("coefficients", error.to_string()))?;
    if polynomial.terms() != terms {
        return Err(field("exponents", "must be in lexicographic order with non-zero coefficients".into()));
    }
    Ok(polynomial)
}

/// The matrix of a certificate with a basis of `n` elements.
pub(super) fn read_gram(place: &str, n: usize, rows: &[Vec<f64>]) -> Result<DMatrix<f64>, BodyFileError> {
    if rows.len() != n || rows.iter().any(|row| row.len() != n) {
        let reason = format!("must be {n}x{n} like its basis");
        return Err(BodyFileError::Field { field: format!("{place}.certificate.gram"), reason });
    }
    Ok(DMatrix::from_fn(n, n, |row, column| rows[row][column]))
}

/// The Gram matrix of a Hessian form.
pub(super) fn read_hessian(place: &str, certificate: &FileCertificate) -> Result<HessianGram, BodyFileError> {
    let basis = certificate.basis.iter();
    let basis: Vec<_> =
        basis.map(|&[direction, a, b, c]| HessianMonomial { direction, exponents: [a, b, c] }).collect();
    let matrix = read_gram(place, basis.len(), &certificate.gram)?;
    HessianGram::new(basis, matrix)
        .map_err(|error| BodyFileError::Field { field: format!("{place}.certificate"), reason: error.to_string() })
}

/// Rows of a matrix.
pub(super) fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

fn read_constraint(i: usize, constraint: &FileConstraint) -> Result<Constraint, BodyFileError> {
    let place = format!("constraints[{i}]");
    let polynomial = read_polynomial(&place, &constraint.exponents, &constraint.coefficients)?;
    Ok(Constraint { polynomial, gram: read_hessian(&place, &constraint.certificate)? })
}

fn field(name: impl Into<String>, reason: &str) -> BodyFileError {
    BodyFileError::Field { field: name.into(), reason: reason.into() }
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

impl ContainedPoints {
    pub(super) fn check(&self, name: &str) -> Result<(), BodyFileError> {
        let Self { count, sha256 } = self;
        if sha256.len() != 64 || !sha256.bytes().all(|b| matches!(b, b'0'..=b'9' | b'a'..=b'f')) {
            return Err(field(format!("{name}.sha256"), "must be 64 lowercase hexadecimal digits"));
        }
        if !(1..=1 << 40).contains(count) {
            return Err(field(format!("{name}.count"), "must be the number of points that were hashed"));
        }
        Ok(())
    }
}

impl Provenance {
    pub(super) fn check(&self) -> Result<(), BodyFileError> {
        for (name, text) in [("provenance.input", &self.input), ("provenance.objective", &self.objective)] {
            if !(text.is_empty() || super::check_name(text).is_ok()) {
                return Err(field(name, "must have at most 200 characters and no control characters"));
            }
        }
        if !(self.hull_volume_m3 >= 0.0) {
            return Err(field("provenance.hull_volume_m3", "must be a volume, m³"));
        }
        Ok(())
    }
}

/// Holds a stored value that follows from others against the recomputed one, at the accuracy of
/// `scale`.
pub(super) fn check_scalar(field: &'static str, stored: f64, recomputed: f64, scale: f64) -> Result<(), BodyFileError> {
    // Not `>`: a NaN is wrong too.
    if (stored - recomputed).abs() <= TOLERANCE * scale {
        return Ok(());
    }
    Err(BodyFileError::Derived { field, stored: format!("{stored:e}"), recomputed: format!("{recomputed:e}") })
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
    let deepest = super::support_bounds::deepest_point(&body.constraints).1;
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
            kind: KIND.into(),
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

impl From<&HessianGram> for FileCertificate {
    fn from(gram: &HessianGram) -> Self {
        let basis = gram.basis().iter().map(|b| [b.direction, b.exponents[0], b.exponents[1], b.exponents[2]]);
        Self { basis: basis.collect(), gram: rows(gram.matrix()) }
    }
}

impl From<&Normalization> for FileNormalization {
    fn from(Normalization { center, linear }: &Normalization) -> Self {
        Self { center: (*center).into(), linear: linear.transpose().into() }
    }
}

impl From<&FileNormalization> for Normalization {
    fn from(FileNormalization { center, linear }: &FileNormalization) -> Self {
        Self { center: (*center).into(), linear: Matrix3::from_fn(|i, j| linear[i][j]) }
    }
}

impl From<&Ball> for FileBall {
    fn from(Ball { center, radius }: &Ball) -> Self {
        Self { center_m: (*center).into(), radius_m: *radius }
    }
}

impl From<&Aabb> for FileBox {
    fn from(Aabb { min, max }: &Aabb) -> Self {
        Self { min_m: (*min).into(), max_m: (*max).into() }
    }
}

/// Compact JSON but for a line break before each key of the outer objects, so that a file can be
/// looked at.
struct LinePerKey {
    /// How many levels of objects are broken into lines.
    levels: usize,
    depth: usize,
}

impl LinePerKey {
    fn indent<W: ?Sized + io::Write>(&self, writer: &mut W) -> io::Result<()> {
        writer.write_all(b"\n")?;
        (0..self.depth).try_for_each(|_| writer.write_all(b"  "))
    }
}

impl Formatter for LinePerKey {
    fn begin_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth += 1;
        CompactFormatter.begin_object(writer)
    }

    fn end_object<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        self.depth -= 1;
        if self.depth < self.levels {
            self.indent(writer)?;
        }
        CompactFormatter.end_object(writer)
    }

    fn begin_object_key<W: ?Sized + io::Write>(&mut self, writer: &mut W, first: bool) -> io::Result<()> {
        CompactFormatter.begin_object_key(writer, first)?;
        if self.depth <= self.levels { self.indent(writer) } else { Ok(()) }
    }

    fn begin_object_value<W: ?Sized + io::Write>(&mut self, writer: &mut W) -> io::Result<()> {
        writer.write_all(if self.depth <= self.levels { b": " } else { b":" })
    }
}
