//! An element: its children, and errors that name its place.

use roxmltree::Node;

use super::text::{quoted, shortened};
use crate::error::DescriptionError;

/// Most elements of a path that errors show; deeper ones have the innermost shown.
const MOST_STEPS: usize = 8;

/// An element of a file.
#[derive(Clone, Copy)]
pub(crate) struct Element<'a, 'i: 'a>(pub(super) Node<'a, 'i>);

impl<'a, 'i> Element<'a, 'i> {
    pub(super) fn new(node: Node<'a, 'i>) -> Self {
        Self(node)
    }

    /// Its name, without a prefix.
    pub(crate) fn name(self) -> &'a str {
        self.0.tag_name().name()
    }

    /// Address of its namespace.
    pub(super) fn namespace(self) -> Option<&'a str> {
        self.0.tag_name().namespace()
    }

    /// It and all elements inside.
    pub(super) fn all(self) -> impl Iterator<Item = Self> {
        self.0.descendants().filter(Node::is_element).map(Self)
    }

    /// Child elements in the namespace of the file; those of others are extensions.
    pub(crate) fn children(self) -> impl Iterator<Item = Self> {
        let of_file = self.0.document().root_element().tag_name().namespace();
        let belongs = move |child: &Node<'a, 'i>| {
            let namespace = child.tag_name().namespace();
            child.is_element() && (namespace.is_none() || namespace == of_file)
        };
        self.0.children().filter(belongs).map(Self)
    }

    /// Child elements in any namespace.
    pub(crate) fn children_of_all_namespaces(self) -> impl Iterator<Item = Self> {
        self.0.children().filter(Node::is_element).map(Self)
    }

    /// Child elements of a name.
    pub(crate) fn named(self, name: &'static str) -> impl Iterator<Item = Self> {
        self.children().filter(move |child| child.name() == name)
    }

    /// The child element of a name, which may be missing, and is there once at most.
    pub(crate) fn optional(self, name: &'static str) -> Result<Option<Self>, DescriptionError> {
        let mut found = self.named(name);
        let first = found.next();
        match found.next() {
            None => Ok(first),
            Some(second) => {
                Err(second.error(format!("this is the second <{name}> of its element"), "keep one of them"))
            }
        }
    }

    /// The child element of a name, which is there once.
    pub(crate) fn required(self, name: &'static str, remedy: &str) -> Result<Self, DescriptionError> {
        self.optional(name)?.ok_or_else(|| self.error(format!("it has no <{name}>"), remedy))
    }

    /// An error of the element.
    pub(crate) fn error(self, problem: impl Into<String>, remedy: impl Into<String>) -> DescriptionError {
        self.error_at(self.0.range().start, problem.into(), remedy.into())
    }

    /// An error of an attribute: its line and column, the path of its element.
    pub(crate) fn attribute_error(
        self,
        name: &str,
        problem: impl Into<String>,
        remedy: impl Into<String>,
    ) -> DescriptionError {
        let attribute = self.0.attribute_node(name);
        let start = attribute.map_or(self.0.range().start, |attribute| attribute.range().start);
        self.error_at(start, problem.into(), remedy.into())
    }

    /// Line and column, from 1.
    pub(crate) fn position(self) -> (u32, u32) {
        let position = self.0.document().text_pos_at(self.0.range().start);
        (position.row, position.col)
    }

    fn error_at(self, offset: usize, problem: String, remedy: String) -> DescriptionError {
        let position = self.0.document().text_pos_at(offset);
        DescriptionError { line: position.row, column: position.col, path: self.path(), problem, remedy }
    }

    /// Such as `robot/joint[elbow]/limit`.
    pub(crate) fn path(self) -> String {
        let mut elements = self.0.ancestors().filter(Node::is_element);
        let mut steps: Vec<String> = elements.clone().take(MOST_STEPS).map(step).collect();
        if elements.nth(MOST_STEPS).is_some() {
            steps.push("...".into());
        }
        steps.reverse();
        steps.join("/")
    }
}

/// An element in a path: with its name, or its number from 1 if there are several.
fn step(node: Node<'_, '_>) -> String {
    let kind = shortened(node.tag_name().name());
    let Some(parent) = node.parent_element() else { return kind };
    if let Some(name) = node.attribute("name").filter(|name| !name.is_empty()) {
        return format!("{kind}[{}]", shortened(name));
    }
    let like = parent.children().filter(|other| other.is_element() && other.tag_name() == node.tag_name());
    if like.clone().nth(1).is_none() {
        return kind;
    }
    let number = 1 + like.take_while(|other| *other != node).count();
    format!("{kind}[{number}]")
}

/// Refuses the second of two elements with one name.
pub(crate) fn check_unique<'a, 'i: 'a>(
    names: &mut std::collections::HashSet<&'a str>,
    element: Element<'a, 'i>,
    name: &'a str,
) -> Result<(), DescriptionError> {
    if names.insert(name) {
        return Ok(());
    }
    let problem = format!("another {} has the name {}, too", element.name(), quoted(name));
    Err(element.attribute_error("name", problem, "give each a name of its own"))
}
