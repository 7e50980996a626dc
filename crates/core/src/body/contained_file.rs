//! How a body file keeps the proofs of contained sets.

use super::body_error::check_name;
use super::containment::{ContainedSet, Containment, ProofFrame};
use super::file_error::BodyFileError;
use super::id::ParseIdError;
use crate::polynomial::ContainmentProof;
use nalgebra::{DMatrix, Matrix3};
use serde::{Deserialize, Serialize};

/// The identity of the set, the frame `x = origin_m + axes_m v`, and one proof per constraint of
/// the body.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct FileContainedSet {
    id: String,
    name: String,
    origin_m: [f64; 3],
    axes_m: [[f64; 3]; 3],
    proofs: Vec<FileProof>,
}

/// Gram matrices on all monomials of v up to a degree, by degree, within a degree from `v1^t` to
/// `v3^t`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct FileProof {
    multipliers: Vec<Vec<Vec<f64>>>,
    rest: Vec<Vec<f64>>,
}

impl From<&ContainedSet> for FileContainedSet {
    fn from(set: &ContainedSet) -> Self {
        let ContainedSet { id, name, containment: Containment { frame, proofs } } = set;
        let rows = |matrix: &DMatrix<f64>| matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
        let proof = |proof: &ContainmentProof| FileProof {
            multipliers: proof.multipliers().iter().map(rows).collect(),
            rest: rows(proof.rest()),
        };
        Self {
            id: id.to_string(),
            name: name.clone(),
            origin_m: frame.origin.into(),
            axes_m: frame.axes.transpose().into(),
            proofs: proofs.iter().map(proof).collect(),
        }
    }
}

impl FileContainedSet {
    /// The record, well-formed but not proven: that takes the set.
    pub(super) fn read(&self, index: usize) -> Result<ContainedSet, BodyFileError> {
        let place = format!("contained_sets[{index}]");
        let field = |key: &str, reason: String| BodyFileError::Field { field: format!("{place}.{key}"), reason };
        check_name(&self.name).map_err(|error| field("name", error.to_string()))?;
        let id = self.id.parse().map_err(|error: ParseIdError| field("id", error.to_string()))?;
        let matrix = |rows: &Vec<Vec<f64>>| {
            let n = rows.len();
            let square = rows.iter().all(|row| row.len() == n);
            let uneven = || field("proofs", "has a matrix with rows of another length than their number".into());
            square.then(|| DMatrix::from_fn(n, n, |i, j| rows[i][j])).ok_or_else(uneven)
        };
        let proof = |proof: &FileProof| {
            let multipliers = proof.multipliers.iter().map(matrix).collect::<Result<_, _>>()?;
            ContainmentProof::new(multipliers, matrix(&proof.rest)?).map_err(|error| field("proofs", error.to_string()))
        };
        let proofs = self.proofs.iter().map(proof).collect::<Result<_, _>>()?;
        let axes = Matrix3::from_fn(|i, j| self.axes_m[i][j]);
        let frame = ProofFrame { origin: self.origin_m.into(), axes };
        Ok(ContainedSet { id, name: self.name.clone(), containment: Containment { frame, proofs } })
    }
}
