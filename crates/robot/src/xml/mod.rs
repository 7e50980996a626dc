//! XML with limits, for URDF and SRDF: what is read, and how errors name places in it.

mod attribute;
mod element;
mod limits;
mod text;
mod text_error;
mod vocabulary;
mod xacro;

use roxmltree::{Document, Error, ParsingOptions};

use crate::error::DescriptionError;

pub(crate) use element::{Element, check_unique};
pub(crate) use text::{quoted, quoted_list};
use text_error::{FILE, at};
pub(crate) use vocabulary::Vocabulary;

/// Parses a text of limited size.
pub(crate) fn parse(text: &str) -> Result<Document<'_>, DescriptionError> {
    limits::check(text)?;
    let options = ParsingOptions { nodes_limit: limits::MOST_NODES, ..ParsingOptions::default() };
    Document::parse_with_options(text, options).map_err(|error| explained(text, &error))
}

/// The outermost element, which is `robot`, of a text without xacro.
pub(crate) fn robot<'a, 'i>(document: &'a Document<'i>) -> Result<Element<'a, 'i>, DescriptionError> {
    let root = Element::new(document.root_element());
    if root.name() != "robot" {
        let problem = format!("the outermost element is {}, not \"robot\"", quoted(root.name()));
        let remedy = if root.name() == "sdf" {
            "convert the SDF file to URDF"
        } else {
            "give a URDF or SRDF file, whose outermost element is <robot>"
        };
        return Err(root.error(problem, remedy));
    }
    xacro::check(root)?;
    Ok(root)
}

/// What the parser says, with a remedy.
fn explained(text: &str, error: &Error) -> DescriptionError {
    match error {
        Error::DtdDetected => {
            let problem = "the file has a document type declaration (<!DOCTYPE>), which is not read";
            at(text, text.find("<!DOCTYPE").unwrap_or(0), problem.into(), "remove it, and write out its entities")
        }
        Error::NodesLimitReached => {
            let problem = format!("the file has more than {} elements and texts", limits::MOST_NODES);
            at(text, 0, problem, "remove what does not describe the robot")
        }
        Error::UnknownNamespace(prefix, position) => DescriptionError {
            line: position.row,
            column: position.col,
            path: FILE.into(),
            problem: format!("the prefix {} is not declared", quoted(prefix)),
            remedy: if prefix == "xacro" {
                xacro::REMEDY.into()
            } else {
                "declare it in the outermost element: xmlns:PREFIX=\"ADDRESS\"".into()
            },
        },
        _ => DescriptionError {
            line: error.pos().row,
            column: error.pos().col,
            path: FILE.into(),
            problem: format!("this is not well-formed XML: {}", text::shortened(&error.to_string())),
            remedy: "correct it, or export the file again".into(),
        },
    }
}
