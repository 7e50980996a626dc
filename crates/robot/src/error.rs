//! Why a description of a robot is not read.

/// What is wrong with the text of a URDF or SRDF, where, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line}, column {column}, {path}: {problem}; {remedy}")]
pub struct DescriptionError {
    /// Line, from 1.
    pub line: u32,
    /// Column in characters, from 1.
    pub column: u32,
    /// The element, such as `robot/joint[elbow]/limit`. Elements without a name have a number, from
    /// 1, if there are several. `file` if the text is not XML.
    pub path: String,
    /// What is wrong.
    pub problem: String,
    /// What to do about it.
    pub remedy: String,
}
