//! Counts in sentences.

use std::fmt::Display;

/// A count with its noun: `one` after 1, `many` after any other number.
///
/// ```
/// use sublevel_robot::counted;
///
/// assert_eq!(counted(1, "body", "bodies"), "1 body");
/// assert_eq!(counted(0, "body", "bodies"), "0 bodies");
/// ```
pub fn counted<N: Display + From<u8> + PartialEq>(count: N, one: &str, many: &str) -> String {
    let noun = if count == N::from(1) { one } else { many };
    format!("{count} {noun}")
}
