//! The file of a compound: the files of its parts in one, with the record of what they were proven
//! to cover.

use super::compound::Compound;
use super::convex_body::Body;
use super::covering::Covering;
use super::division::DivisionError;
use super::file::File;
use super::file_error::BodyFileError;
use super::file_format::{COMPOUND_KIND, FORMAT, check_format, read, write};
use super::provenance::Provenance;
use serde::{Deserialize, Serialize};

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct CompoundFile {
    format: String,
    kind: String,
    id: String,
    name: String,
    gap_m: Option<f64>,
    covering: Option<Covering>,
    provenance: Option<Provenance>,
    parts: Vec<File>,
}

impl Compound {
    /// The compound's file; reading it back gives the same numbers exactly.
    pub fn to_json(&self) -> String {
        let file = CompoundFile {
            format: FORMAT.into(),
            kind: COMPOUND_KIND.into(),
            id: self.id().to_string(),
            name: self.name().into(),
            gap_m: self.gap_m(),
            covering: self.covering.clone(),
            provenance: self.provenance.clone(),
            parts: self.parts().iter().map(File::from).collect(),
        };
        write(&file, 2)
    }

    /// Reads a compound's file and re-proves every part as [`Body::from_json`] does. What it covers
    /// is a note until [`Compound::prove_covers`] is given the mesh.
    ///
    /// # Errors
    /// The field that is wrong, the reason and the remedy.
    pub fn from_json(text: &str) -> Result<Self, BodyFileError> {
        let file: CompoundFile = read(text)?;
        check_format(&file.format, &file.kind, COMPOUND_KIND)?;
        check_notes(&file)?;
        let part = |(index, part)| {
            Body::from_file(part).map_err(|source| BodyFileError::Part { index, source: Box::new(source) })
        };
        let parts = file.parts.into_iter().enumerate().map(part).collect::<Result<Vec<_>, _>>()?;
        let mut compound = Self::new(&file.name, parts)?;
        let derived = |field, stored: String, recomputed: String| {
            if stored == recomputed { Ok(()) } else { Err(BodyFileError::Derived { field, stored, recomputed }) }
        };
        derived("id", file.id, compound.id().to_string())?;
        derived("gap_m", format!("{:?}", file.gap_m), format!("{:?}", compound.gap_m()))?;
        compound.covering = file.covering;
        compound.provenance = file.provenance;
        Ok(compound)
    }
}

/// Checks what no proof covers, as far as it can be.
fn check_notes(file: &CompoundFile) -> Result<(), BodyFileError> {
    let refuse = |field: &str, reason: &str| BodyFileError::Field { field: field.into(), reason: reason.into() };
    if let Some(Covering { corners, division, .. }) = &file.covering {
        corners.check("covering.corners")?;
        division.check(file.parts.len()).map_err(|error| {
            let field = match error {
                DivisionError::Pieces { .. } if division.parts.is_empty() && !division.separated => {
                    return refuse("covering.cuts", "must be one fewer than there are parts, or covering null");
                }
                DivisionError::Pieces { .. } => "covering.cuts".to_owned(),
                DivisionError::Cut(index) => format!("covering.cuts[{index}]"),
                DivisionError::NoPart { piece, .. } => format!("covering.parts[{piece}]"),
                DivisionError::NoPiece(_) => "covering.parts".to_owned(),
            };
            refuse(&field, &error.to_string())
        })?;
    }
    if let Some(provenance) = &file.provenance {
        provenance.check()?;
    }
    Ok(())
}
