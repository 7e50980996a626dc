//! Words of the format at one place, and words that look like misspelt ones. What the format does
//! not have is passed over, as other readers do: files contain parts for simulators and drivers. A
//! misspelt word, or an element with collision geometry inside, is refused: without it a part of
//! the robot would be left out.

use super::{Element, quoted};
use crate::error::DescriptionError;

/// Words of one place.
pub(crate) struct Vocabulary {
    /// Those that are read.
    pub(crate) read: &'static [&'static str],
    /// Those that are known not to matter here.
    pub(crate) ignored: &'static [&'static str],
}

impl Vocabulary {
    /// Refuses child elements that look like misspelt ones, or that have collision geometry inside.
    pub(crate) fn check_children(&self, parent: Element<'_, '_>) -> Result<(), DescriptionError> {
        for child in parent.children().filter(|child| !self.has(child.name())) {
            if let Some(word) = self.resembled(child.name()) {
                let problem = format!("the format has no element {} here", quoted(child.name()));
                return Err(child.error(problem, format!("write <{word}>, or remove it")));
            }
            if child.all().any(|inner| inner.name() == "collision") {
                let problem = format!("the element {} has collision geometry, which is not read", quoted(child.name()));
                return Err(child.error(problem, "move <collision> into a <link>, or remove it"));
            }
        }
        Ok(())
    }

    /// Refuses attributes that look like misspelt ones.
    pub(crate) fn check_attributes(&self, element: Element<'_, '_>) -> Result<(), DescriptionError> {
        for (name, _) in element.attributes().filter(|(name, _)| !self.has(name)) {
            if let Some(word) = self.resembled(name) {
                let problem = format!("the format has no attribute {} here", quoted(name));
                return Err(element.attribute_error(name, problem, format!("write {word}, or remove it")));
            }
        }
        Ok(())
    }

    /// Whether the format has the word here.
    pub(crate) fn has(&self, word: &str) -> bool {
        self.read.contains(&word) || self.ignored.contains(&word)
    }

    /// A word that is read and of which this may be a misspelling.
    fn resembled(&self, word: &str) -> Option<&'static str> {
        let lower = word.to_lowercase();
        let close = |known: &&&str| {
            let most = if known.len() <= 4 { 1 } else { 2 };
            known.len().abs_diff(lower.chars().count()) <= most && edits(&lower, known) <= most
        };
        self.read.iter().find(close).copied()
    }
}

/// Least number of letters to insert, remove, replace or swap with the next (optimal string
/// alignment).
fn edits(a: &str, b: &str) -> usize {
    let (a, b): (Vec<char>, Vec<char>) = (a.chars().collect(), b.chars().collect());
    let mut before = vec![0; b.len() + 1];
    let mut last: Vec<usize> = (0..=b.len()).collect();
    for i in 0..a.len() {
        let mut row = vec![i + 1];
        for j in 0..b.len() {
            let replaced = last[j] + usize::from(a[i] != b[j]);
            let mut least = replaced.min(last[j + 1] + 1).min(row[j] + 1);
            if i > 0 && j > 0 && a[i] == b[j - 1] && a[i - 1] == b[j] {
                least = least.min(before[j - 1] + 1);
            }
            row.push(least);
        }
        before = std::mem::replace(&mut last, row);
    }
    last[b.len()]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn edits_are_counted() {
        for (a, b, count) in
            [("link", "link", 0), ("lnik", "link", 1), ("colision", "collision", 1), ("", "ab", 2), ("disk", "axis", 3)]
        {
            assert_eq!((edits(a, b), edits(b, a)), (count, count), "{a} {b}");
        }
    }
}
