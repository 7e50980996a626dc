//! Texts that xacro has yet to turn into URDF.

use super::text::shortened;
use super::{Element, quoted};
use crate::error::DescriptionError;

/// What to do about it.
pub(super) const REMEDY: &str = "run xacro first: xacro file.xacro > file.urdf";

/// Refuses elements of xacro and its expressions. A declaration of its namespace is no harm.
pub(super) fn check(root: Element<'_, '_>) -> Result<(), DescriptionError> {
    for element in root.all() {
        if element.namespace().is_some_and(|address| address.trim_end_matches('/').ends_with("xacro")) {
            let problem = format!("the element {} belongs to xacro", quoted(element.name()));
            return Err(element.error(problem, REMEDY));
        }
        for (name, value) in element.attributes() {
            if value.contains("${") || value.contains("$(") {
                let problem = format!("{} is {}, an expression of xacro", shortened(name), quoted(value));
                return Err(element.attribute_error(name, problem, REMEDY));
            }
        }
    }
    Ok(())
}
