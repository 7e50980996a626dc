//! What may be a name.

use super::MAX_NAME_BYTES;

/// Why a name is not usable.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
pub enum NameError {
    /// Names hold at least one byte.
    #[error("is empty; give a name of 1 to {MAX_NAME_BYTES} bytes")]
    Empty,
    /// Names are short enough to print.
    #[error("is {0} bytes long; give a name of 1 to {MAX_NAME_BYTES} bytes")]
    Long(usize),
    /// Names print on one line.
    #[error("holds a control character; use printable characters only")]
    Control,
}

/// Checks that a name of a scene, object or group is usable: 1 to [`MAX_NAME_BYTES`] bytes, no
/// control characters.
///
/// # Errors
/// The first rule the name breaks.
pub fn check_name(name: &str) -> Result<(), NameError> {
    if name.is_empty() {
        Err(NameError::Empty)
    } else if name.len() > MAX_NAME_BYTES {
        Err(NameError::Long(name.len()))
    } else if name.chars().any(char::is_control) {
        Err(NameError::Control)
    } else {
        Ok(())
    }
}
