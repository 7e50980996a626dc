//! Errors of a text as a whole, where there is no element to name.

use super::text::position;
use crate::error::DescriptionError;

/// Path of errors where there is no element yet.
pub(super) const FILE: &str = "file";

/// An error of the text as a whole, at a byte of it.
pub(super) fn at(text: &str, offset: usize, problem: String, remedy: &str) -> DescriptionError {
    let (line, column) = position(text, offset);
    DescriptionError { line, column, path: FILE.into(), problem, remedy: remedy.into() }
}
