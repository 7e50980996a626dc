//! How a mesh is divided among the parts of a compound.

use super::mesh_piece::{Caps, Piece};
use nalgebra::Vector3;
use serde::{Deserialize, Serialize};

/// A plane that divides one piece of a mesh into two.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Cut {
    /// Which piece it divides, of those that the cuts before have left: what is below the plane
    /// keeps this number, what is not gets the next free one. (In files that are not separated into
    /// components, and with one piece to a part, it is a part.)
    pub part: usize,
    /// Normal of the plane, pointing up, of length about 1.
    pub normal: [f64; 3],
    /// `normal·x` on the plane, metres.
    pub height_m: f64,
}

/// How a mesh is divided into pieces, and which part of a compound contains which of them.
///
/// As chains the pieces add up to the mesh (see [`Piece`]), also when one part contains several.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Division {
    /// Whether the first pieces are the components of the mesh ([`Piece::components`]) and are cut
    /// with [`Caps::Sections`]; else the mesh is the first piece and is cut with [`Caps::Cones`],
    /// as all files had it at first.
    pub separated: bool,
    /// Planes that divide pieces, one after the other.
    pub cuts: Vec<Cut>,
    /// For each piece the part that contains it; empty if these are the same numbers.
    pub parts: Vec<usize>,
}

/// Why a division is none of a mesh among parts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum DivisionError {
    /// More or fewer pieces than there are.
    #[error("{cuts} cuts of {components} component(s) leave {} pieces of a mesh for {expected}; only compounds with the division of their fit can be proven",
        cuts + components)]
    Pieces {
        /// How many cuts there are.
        cuts: usize,
        /// How many components the mesh has, or 1 if it is not separated.
        components: usize,
        /// How many pieces are assigned to parts.
        expected: usize,
    },
    /// A cut that is none.
    #[error("cut {0} must divide a piece made before by a plane with finite numbers and a unit normal")]
    Cut(usize),
    /// A piece of no part.
    #[error("piece {piece} is held by part {part} of {parts}; parts are counted from 0")]
    NoPart {
        /// The piece.
        piece: usize,
        /// Its part.
        part: usize,
        /// How many parts there are.
        parts: usize,
    },
    /// A part of nothing.
    #[error("part {0} holds no piece of the mesh")]
    NoPiece(usize),
}

impl Division {
    /// The division by planes alone, each piece contained in the part of its number.
    pub fn by_cuts(cuts: Vec<Cut>) -> Self {
        Self { separated: false, cuts, parts: Vec::new() }
    }

    /// How many pieces are assigned to this many parts.
    fn assigned(&self, parts: usize) -> usize {
        if self.parts.is_empty() { parts } else { self.parts.len() }
    }

    /// The part that contains a piece.
    pub fn part(&self, piece: usize) -> usize {
        self.parts.get(piece).copied().unwrap_or(piece)
    }

    /// Checks all that can be without the mesh.
    ///
    /// # Errors
    /// [`DivisionError`].
    pub fn check(&self, parts: usize) -> Result<(), DivisionError> {
        let (assigned, cuts) = (self.assigned(parts), self.cuts.len());
        let first = assigned.saturating_sub(cuts);
        if first == 0 || (!self.separated && first != 1) {
            return Err(DivisionError::Pieces { cuts, components: 1, expected: assigned });
        }
        let good = |(index, cut): (usize, &Cut)| {
            let numbers = cut.normal.iter().chain([&cut.height_m]).all(|number| number.is_finite());
            cut.part < first + index && numbers && (Vector3::from(cut.normal).norm() - 1.0).abs() < 1e-6
        };
        if let Some(index) = self.cuts.iter().enumerate().position(|entry| !good(entry)) {
            return Err(DivisionError::Cut(index));
        }
        if let Some(piece) = self.parts.iter().position(|&part| part >= parts) {
            return Err(DivisionError::NoPart { piece, part: self.parts[piece], parts });
        }
        let mut held = vec![self.parts.is_empty(); parts];
        self.parts.iter().for_each(|&part| held[part] = true);
        held.iter().position(|held| !held).map_or(Ok(()), |part| Err(DivisionError::NoPiece(part)))
    }

    /// For each of this many parts the pieces of a mesh that it contains (see [`Piece`] for what
    /// they say of the mesh).
    ///
    /// # Errors
    /// [`DivisionError`], also of a mesh that has other components.
    pub fn pieces(&self, mesh: Piece, parts: usize) -> Result<Vec<Vec<Piece>>, DivisionError> {
        self.check(parts)?;
        let mut pieces = if self.separated { mesh.components() } else { vec![mesh] };
        let (cuts, components, expected) = (self.cuts.len(), pieces.len(), self.assigned(parts));
        if components + cuts != expected {
            return Err(DivisionError::Pieces { cuts, components, expected });
        }
        for &Cut { part, normal, height_m } in &self.cuts {
            let caps = if self.separated { Caps::Sections } else { Caps::Cones };
            let [below, above] = pieces[part].cut_with(&normal.into(), height_m, caps);
            pieces[part] = below;
            pieces.push(above);
        }
        let mut held = vec![Vec::new(); parts];
        for (index, piece) in pieces.into_iter().enumerate() {
            held[self.part(index)].push(piece);
        }
        Ok(held)
    }
}
