//! What is odd in a file.

use crate::semantics::Warning;
use crate::xml::Element;

/// Most warnings: to find each place takes long in a large file.
const MOST_WARNINGS: usize = 100;

/// The first warnings of a file.
#[derive(Default)]
pub(super) struct Warnings(Vec<Warning>);

impl Warnings {
    /// Adds one about an element.
    pub(super) fn add(&mut self, element: Element<'_, '_>, message: String) {
        if self.0.len() < MOST_WARNINGS {
            let (line, column) = element.position();
            self.0.push(Warning { line, column, path: element.path(), message });
        }
    }

    /// In the order of the file.
    pub(super) fn into_list(mut self) -> Vec<Warning> {
        self.0.sort_by_key(|warning| (warning.line, warning.column));
        self.0
    }
}
