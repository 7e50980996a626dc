//! Packed arrays of messages: little-endian float64 and uint32, row after row.

use bytes::Bytes;
use nalgebra::Vector3;

use crate::measure::{Pose, PoseError, Twist};
use crate::robot::counted;

use super::error::Invalid;

/// Numbers of a pose: translation, then quaternion x y z w.
pub(crate) const POSE_NUMBERS: usize = 7;

/// Numbers in rows of `WIDTH`.
pub(super) fn rows<const WIDTH: usize>(bytes: &[u8], field: &str) -> Result<Vec<[f64; WIDTH]>, Invalid> {
    let (numbers, rest) = bytes.as_chunks::<8>();
    let (rows, left) = numbers.as_chunks::<WIDTH>();
    if !rest.is_empty() || !left.is_empty() {
        let found = counted(bytes.len(), "byte", "bytes");
        let why = format!("has {found}; send {} bytes (float64) a row of {WIDTH}", 8 * WIDTH);
        return Err(Invalid::new(field, why));
    }
    Ok(rows.iter().map(|row| row.map(f64::from_le_bytes)).collect())
}

/// All numbers.
pub(super) fn numbers(bytes: &[u8], field: &str) -> Result<Vec<f64>, Invalid> {
    Ok(rows::<1>(bytes, field)?.into_iter().flatten().collect())
}

/// Indices in rows of `WIDTH`.
pub(super) fn indices<const WIDTH: usize>(bytes: &[u8], field: &str) -> Result<Vec<[u32; WIDTH]>, Invalid> {
    let (numbers, rest) = bytes.as_chunks::<4>();
    let (rows, left) = numbers.as_chunks::<WIDTH>();
    if !rest.is_empty() || !left.is_empty() {
        let found = counted(bytes.len(), "byte", "bytes");
        let why = format!("has {found}; send {} bytes (uint32) a row of {WIDTH}", 4 * WIDTH);
        return Err(Invalid::new(field, why));
    }
    Ok(rows.iter().map(|row| row.map(u32::from_le_bytes)).collect())
}

/// A pose; `field` is made only for what is refused.
pub(super) fn pose(row: &[f64; POSE_NUMBERS], field: impl Fn() -> String) -> Result<Pose, Invalid> {
    let &[x, y, z, i, j, k, w] = row;
    Pose::from_quaternion(Vector3::new(x, y, z), [i, j, k, w]).map_err(|error| refused(&error, field()))
}

fn refused(error: &PoseError, field: String) -> Invalid {
    Invalid::new(field, error)
}

/// One pose a row.
pub(super) fn poses(bytes: &[u8], field: &str) -> Result<Vec<Pose>, Invalid> {
    let rows = rows::<POSE_NUMBERS>(bytes, field)?;
    rows.iter().enumerate().map(|(index, row)| pose(row, || format!("{field}[{index}]"))).collect()
}

/// A packed array that is written.
#[derive(Clone, Debug, Default)]
pub(crate) struct Packed(Vec<u8>);

impl Packed {
    pub(crate) fn with_capacity(bytes: usize) -> Self {
        Self(Vec::with_capacity(bytes))
    }

    pub(crate) fn number(&mut self, value: f64) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub(crate) fn index(&mut self, value: u32) {
        self.0.extend_from_slice(&value.to_le_bytes());
    }

    pub(super) fn byte(&mut self, value: u8) {
        self.0.push(value);
    }

    /// Three numbers; NaN where there are none.
    pub(super) fn vector(&mut self, value: Option<&Vector3<f64>>) {
        let value = value.copied().unwrap_or_else(|| Vector3::repeat(f64::NAN));
        value.iter().for_each(|&number| self.number(number));
    }

    /// Six numbers; NaN where there are none.
    pub(super) fn twist(&mut self, value: Option<&Twist>) {
        self.vector(value.map(|twist| &twist.linear));
        self.vector(value.map(|twist| &twist.angular));
    }

    /// Seven numbers.
    pub(crate) fn pose(&mut self, pose: &Pose) {
        self.vector(Some(pose.translation()));
        pose.rotation().coords.iter().for_each(|&number| self.number(number));
    }

    pub(crate) fn into_bytes(self) -> Bytes {
        self.0.into()
    }
}

/// Bits, the first in the lowest of the first byte.
pub(super) fn bits(values: impl ExactSizeIterator<Item = bool>) -> Bytes {
    let mut packed = vec![0_u8; values.len().div_ceil(8)];
    for (index, _) in values.enumerate().filter(|(_, value)| *value) {
        packed[index / 8] |= 1 << (index % 8);
    }
    packed.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_survive_the_round_trip() {
        let mut packed = Packed::default();
        let values = [0.1, -2.5, f64::MAX, f64::MIN_POSITIVE, 0.0, -0.0];
        values.iter().for_each(|&value| packed.number(value));
        let read = rows::<3>(&packed.into_bytes(), "x").expect("rows");
        assert_eq!(read.as_flattened().iter().map(|v| v.to_bits()).collect::<Vec<_>>(), values.map(f64::to_bits));
        let mut packed = Packed::default();
        [7, u32::MAX].iter().for_each(|&index| packed.index(index));
        assert_eq!(indices::<2>(&packed.into_bytes(), "x").expect("rows"), [[7, u32::MAX]]);
        let nine = (0..9).map(|i| i % 4 == 0).collect::<Vec<_>>();
        assert_eq!(&bits(nine.into_iter())[..], [0b0001_0001, 1]);
    }

    #[test]
    fn what_is_no_whole_row_is_refused_by_name() {
        for length in [1, 8, 23, 25] {
            assert!(rows::<3>(&vec![0; length], "rays.origins_m").is_err(), "{length}");
        }
        assert!(indices::<2>(&[0; 12], "pairs").is_err());
        assert!(poses(&[0; 56], "poses").is_err(), "a zero quaternion");
    }
}
