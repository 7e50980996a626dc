//! Identity of a body: a hash of what it is, not of what it is called.

use super::{Constraint, Normalization};
use crate::polynomial::Polynomial;
use nalgebra::Vector3;
use serde::{Deserialize, Deserializer, Serialize, Serializer, de};
use sha2::{Digest, Sha256};
use std::fmt;
use std::str::FromStr;

/// SHA-256 of a body's content: center, linear (rows), then per constraint the number of its terms
/// and each term's three exponents and coefficient in lexicographic order of the exponents, then,
/// if one was set, -1 and the growth centre, or -2 for an sos-body; everything as little-endian
/// f64. That of a compound is the SHA-256 of the ids of its parts, 32 bytes each, in their order.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct BodyId([u8; 32]);

impl BodyId {
    pub(super) fn of(
        normalization: &Normalization,
        constraints: &[Constraint],
        growth_center: Option<&Vector3<f64>>,
    ) -> Self {
        // No number of terms is negative.
        let growth = growth_center.into_iter().flat_map(|center| [-1.0].into_iter().chain(center.iter().copied()));
        Self::hash(normalization, constraints.iter().map(|constraint| &constraint.polynomial), growth)
    }

    pub(super) fn of_sos(normalization: &Normalization, polynomial: &Polynomial) -> Self {
        Self::hash(normalization, [polynomial].into_iter(), [-2.0].into_iter())
    }

    fn hash<'a>(
        normalization: &Normalization,
        polynomials: impl Iterator<Item = &'a Polynomial>,
        rest: impl Iterator<Item = f64>,
    ) -> Self {
        let mut hash = Sha256::new();
        let mut feed = |value: f64| hash.update(value.to_le_bytes());
        normalization.center.iter().for_each(|&value| feed(value));
        normalization.linear.transpose().iter().for_each(|&value| feed(value));
        for polynomial in polynomials {
            let terms = polynomial.terms();
            feed(terms.len() as f64);
            for (exponents, coefficient) in terms {
                exponents.iter().for_each(|&e| feed(f64::from(e)));
                feed(*coefficient);
            }
        }
        rest.for_each(feed);
        Self(hash.finalize().into())
    }

    /// That of a ladder: SHA-256 of `ladder` and the ids of its rungs, 32 bytes each, in their
    /// order.
    pub fn of_ladder<'a>(rungs: impl Iterator<Item = &'a Self>) -> Self {
        let mut hash = Sha256::new_with_prefix("ladder");
        rungs.for_each(|rung| hash.update(rung.0));
        Self(hash.finalize().into())
    }

    /// That of a half-space: SHA-256 of `half-space`, the normal and the offset, as little-endian
    /// f64.
    pub fn of_half_space(normal: &Vector3<f64>, offset: f64) -> Self {
        let mut hash = Sha256::new_with_prefix("half-space");
        normal.iter().chain([&offset]).for_each(|value| hash.update(value.to_le_bytes()));
        Self(hash.finalize().into())
    }

    /// That of a capsule: SHA-256 of `capsule`, the radius and the half height, as little-endian
    /// f64.
    pub fn of_capsule(radius_m: f64, half_height_m: f64) -> Self {
        let mut hash = Sha256::new_with_prefix("capsule");
        [radius_m, half_height_m].iter().for_each(|value| hash.update(value.to_le_bytes()));
        Self(hash.finalize().into())
    }

    pub(super) fn of_parts<'a>(parts: impl Iterator<Item = &'a Self>) -> Self {
        let mut hash = Sha256::new();
        parts.for_each(|part| hash.update(part.0));
        Self(hash.finalize().into())
    }
}

/// SHA-256 of points in metres, in their order, as little-endian f64.
pub(super) fn hash_points(points: &[Vector3<f64>]) -> String {
    let mut hash = Sha256::new();
    for point in points {
        point.iter().for_each(|value| hash.update(value.to_le_bytes()));
    }
    hash.finalize().iter().map(|byte| format!("{byte:02x}")).collect()
}

impl fmt::Display for BodyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for BodyId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "BodyId({self})")
    }
}

/// As its text.
impl Serialize for BodyId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for BodyId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(de::Error::custom)
    }
}

/// A text that is not the id of a body.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("'{0}' is not a body id; an id is 64 hexadecimal digits, as 'sublevel show' prints it")]
pub struct ParseIdError(String);

impl FromStr for BodyId {
    type Err = ParseIdError;

    fn from_str(text: &str) -> Result<Self, ParseIdError> {
        let error = || ParseIdError(text.chars().take(80).collect());
        if text.len() != 64 || !text.bytes().all(|b| b.is_ascii_hexdigit()) {
            return Err(error());
        }
        let mut bytes = [0; 32];
        for (i, byte) in bytes.iter_mut().enumerate() {
            *byte = u8::from_str_radix(&text[2 * i..2 * i + 2], 16).map_err(|_| error())?;
        }
        Ok(Self(bytes))
    }
}
