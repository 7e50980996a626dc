//! Proven containment of whole sets, not points, in a body.
//!
//! A basic set `{x : g_1(L (x - c)) <= 1, ...}` is contained in a body when each of the body's
//! constraints has a [`ContainmentProof`]. Set and body have normalized frames of their own, so the
//! proof has a third: a point is `x = origin + axes v`, axes invertible, v unit-free, which spans
//! the space. There both maps `v -> L (origin + axes v - c)` are products of stored numbers, whose
//! rounding is enclosed and covered by the margin of the proof: it holds for the exact maps and
//! every real x, however large, small or far from the origin the set is. A frame in which the set
//! fills the unit ball keeps that price low.

use super::id::BodyId;
use super::normalization::Normalization;
use crate::polynomial::{ContainmentProof, NotContaining, Polynomial, Substituted, Substitution};
use nalgebra::{Matrix3, Vector3};

/// A set `{x : g_1(z) <= 1, ..., g_m(z) <= 1}`, `z = L (x - c)`, x in metres; convex or not,
/// bounded or not.
#[derive(Clone, Debug)]
pub struct BasicSet<'a> {
    /// The map to z.
    pub normalization: &'a Normalization,
    /// The polynomials g.
    pub polynomials: Vec<&'a Polynomial>,
}

/// The frame of a proof: points `x = origin + axes v` in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProofFrame {
    /// Point that v = 0 stands for, metres.
    pub origin: Vector3<f64>,
    /// Metres per unit of v.
    pub axes: Matrix3<f64>,
}

impl ProofFrame {
    /// The map from v to the normalized coordinates of a set, enclosed.
    pub fn to(&self, normalization: &Normalization) -> Substitution {
        Substitution::new(&normalization.linear, &normalization.center, &self.axes, &self.origin)
    }
}

/// Proof that a set lies in the interior of a body.
#[derive(Clone, Debug, PartialEq)]
pub struct Containment {
    /// Frame of the identities.
    pub frame: ProofFrame,
    /// One per constraint of the body.
    pub proofs: Vec<ContainmentProof>,
}

impl Containment {
    /// Proves `inner` contained in `outer` from the stored numbers alone, rounding included; no
    /// program is solved.
    ///
    /// # Errors
    /// What is missing, and by how much.
    pub fn prove(&self, outer: &BasicSet, inner: &BasicSet) -> Result<(), NotContaining> {
        if self.proofs.len() != outer.polynomials.len() {
            let (found, needed) = (self.proofs.len(), outer.polynomials.len());
            return Err(NotContaining::Malformed(format!(
                "there are {found} proofs for the {needed} constraints of the body; one is needed for each"
            )));
        }
        let map = self.frame.to(outer.normalization);
        let set = Substituted { polynomials: &inner.polynomials, map: &self.frame.to(inner.normalization) };
        let mut pairs = self.proofs.iter().zip(&outer.polynomials);
        pairs.try_for_each(|(proof, polynomial)| proof.prove(polynomial, &map, set).map(|_| ()))
    }
}

/// A set that a body is proven to contain whenever the set is at hand.
#[derive(Clone, Debug, PartialEq)]
pub struct ContainedSet {
    /// Identity of the set.
    pub id: BodyId,
    /// Its name.
    pub name: String,
    /// The proof.
    pub containment: Containment,
}
