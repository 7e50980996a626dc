//! Packed columns of answers, read row by row.

use nalgebra::Vector3;

use super::error::ClientError;
use crate::measure::Twist;
use crate::robot::counted;

/// Rows of two indices.
pub(super) fn index_pairs(bytes: &[u8]) -> impl Iterator<Item = [u32; 2]> {
    let pairs = bytes.as_chunks::<4>().0.as_chunks::<2>().0;
    pairs.iter().map(|pair| pair.map(u32::from_le_bytes))
}

/// Indices.
pub(super) fn indices(bytes: &[u8]) -> impl Iterator<Item = u32> {
    bytes.as_chunks::<4>().0.iter().map(|index| u32::from_le_bytes(*index))
}

/// The number in a row of a column; NaN beyond its end.
pub(super) fn number(column: &[u8], row: usize) -> f64 {
    column.as_chunks::<8>().0.get(row).map_or(f64::NAN, |bytes| f64::from_le_bytes(*bytes))
}

/// The vector in a row of a column of three numbers each; none of NaN and beyond its end.
pub(super) fn vector(column: &[u8], row: usize) -> Option<Vector3<f64>> {
    let vector = Vector3::from_fn(|axis, _| number(column, 3 * row + axis));
    (!vector.iter().any(|number| number.is_nan())).then_some(vector)
}

/// The twist in a row of a column of six numbers each; none of NaN and beyond its end.
pub(super) fn twist(column: &[u8], row: usize) -> Option<Twist> {
    Some(Twist { linear: vector(column, 2 * row)?, angular: vector(column, 2 * row + 1)? })
}

/// The name that an index of a table stands for.
pub(super) fn name(table: &[String], index: u32) -> Option<String> {
    table.get(usize::try_from(index).ok()?).cloned()
}

/// The text in a row; none where it is empty, and where there are no texts.
pub(super) fn text(texts: &[String], row: usize) -> Option<String> {
    texts.get(row).filter(|text| !text.is_empty()).cloned()
}

/// Refuses a column that has not `width` bytes for each of the rows.
pub(super) fn of_rows(field: &str, column: &[u8], rows: usize, width: usize) -> Result<(), ClientError> {
    if column.len() == rows * width {
        return Ok(());
    }
    let (bytes, rows) = (counted(column.len(), "byte", "bytes"), counted(rows, "row", "rows"));
    Err(ClientError::unreadable(field, format!("has {bytes} for {rows} of {width}")))
}

/// All numbers of a column.
pub(super) fn numbers(field: &str, column: &[u8]) -> Result<Vec<f64>, ClientError> {
    let (numbers, rest) = column.as_chunks::<8>();
    if rest.is_empty() {
        return Ok(numbers.iter().map(|bytes| f64::from_le_bytes(*bytes)).collect());
    }
    let bytes = counted(column.len(), "byte", "bytes");
    Err(ClientError::unreadable(field, format!("has {bytes}; a number has 8")))
}
