//! What the files of bodies, sos-bodies and compounds have in common: format, kinds, the JSON of
//! their numbers, and the comparison of stored values with recomputed ones.

use super::body_error::check_name;
use super::bounds::{Aabb, Ball};
use super::contained_points::ContainedPoints;
use super::file_error::BodyFileError;
use super::normalization::Normalization;
use super::provenance::Provenance;
use crate::polynomial::{Exponents, HessianGram, HessianMonomial, Polynomial};
use nalgebra::{DMatrix, Matrix3};
use serde::{Deserialize, Serialize};
use serde_json::ser::{CompactFormatter, Formatter};
use std::io;

pub(super) const FORMAT: &str = "sublevel/1";
pub(super) const BODY_KIND: &str = "body";
pub(super) const SOS_BODY_KIND: &str = "sos-body";
pub(super) const COMPOUND_KIND: &str = "compound";

/// Largest difference of a stored derived value from the recomputed one, relative to the size of
/// the quantity; dimensionless.
///
/// Another machine's rounding changes derived values by 1e-12 or less; an edit changes them by far
/// more. A smaller value refuses files of other machines; a larger one accepts files whose derived
/// values do not follow from the polynomials. Answers always use the recomputed value. Pinned by
/// `stored_values_may_differ_by_rounding_only`.
const DERIVED_TOLERANCE: f64 = 1e-7;

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileNormalization {
    pub(super) center: [f64; 3],
    pub(super) linear: [[f64; 3]; 3],
}

/// `gram` belongs to the basis `y_i z^(a, b, c)`, each element stored as `[i, a, b, c]`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileCertificate {
    pub(super) basis: Vec<[u8; 4]>,
    pub(super) gram: Vec<Vec<f64>>,
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

/// The data of a file of some kind.
pub(super) fn read<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, BodyFileError> {
    serde_json::from_str(text).map_err(|error| BodyFileError::Json(error.to_string()))
}

/// The kind that a file names as its own.
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

/// JSON text of a file, a line per key of its objects down to a given depth.
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

/// A value that is not valid.
pub(super) fn field(name: impl Into<String>, reason: &str) -> BodyFileError {
    BodyFileError::Field { field: name.into(), reason: reason.into() }
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
            if !(text.is_empty() || check_name(text).is_ok()) {
                return Err(field(name, "must have at most 200 characters and no control characters"));
            }
        }
        if !(self.hull_volume_m3 >= 0.0) {
            return Err(field("provenance.hull_volume_m3", "must be a volume, m³"));
        }
        Ok(())
    }
}

/// Compares a stored value that follows from others with the recomputed one, at the accuracy of
/// `scale`.
pub(super) fn check_scalar(field: &'static str, stored: f64, recomputed: f64, scale: f64) -> Result<(), BodyFileError> {
    // Not `>`: a NaN is wrong too.
    if (stored - recomputed).abs() <= DERIVED_TOLERANCE * scale {
        return Ok(());
    }
    Err(BodyFileError::Derived { field, stored: format!("{stored:e}"), recomputed: format!("{recomputed:e}") })
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
