//! Places in a text, and parts of it as errors show them.

/// Most characters of the text that an error repeats.
const MOST_SHOWN: usize = 80;
/// Most names that an error lists.
const MOST_NAMED: usize = 8;

/// Line and column, from 1, of a byte.
pub(super) fn position(text: &str, offset: usize) -> (u32, u32) {
    let before = text.get(..offset).unwrap_or(text);
    let line = before.matches('\n').count() + 1;
    let column = before.chars().rev().take_while(|character| *character != '\n').count() + 1;
    (u32::try_from(line).unwrap_or(u32::MAX), u32::try_from(column).unwrap_or(u32::MAX))
}

/// The start of a text, without line breaks and other control characters.
pub(super) fn shortened(text: &str) -> String {
    let mut shown: String = text.chars().take(MOST_SHOWN).flat_map(printable).collect();
    if text.chars().nth(MOST_SHOWN).is_some() {
        shown.push_str("...");
    }
    shown
}

/// The start of a text, in quotation marks.
pub(crate) fn quoted(text: &str) -> String {
    format!("\"{}\"", shortened(text))
}

/// The first of some names, in quotation marks.
pub(crate) fn quoted_list<'a>(mut names: impl Iterator<Item = &'a str>) -> String {
    let mut shown: Vec<_> = names.by_ref().take(MOST_NAMED).map(quoted).collect();
    if names.next().is_some() {
        shown.push("...".into());
    }
    shown.join(", ")
}

fn printable(character: char) -> impl Iterator<Item = char> {
    let escaped = character.is_control().then(|| character.escape_default());
    let plain = escaped.is_none().then_some(character);
    escaped.into_iter().flatten().chain(plain)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_count_lines_and_characters_from_one() {
        let text = "ab\nµ<c";
        assert_eq!(position(text, 0), (1, 1));
        assert_eq!(position(text, 2), (1, 3));
        assert_eq!(position(text, text.find('<').expect("there")), (2, 2));
        assert_eq!(position(text, 999), (2, 4));
    }

    #[test]
    fn what_is_shown_is_short_and_printable() {
        assert_eq!(quoted("a\nb"), "\"a\\nb\"");
        assert_eq!(shortened(&"x".repeat(81)), format!("{}...", "x".repeat(80)));
        assert_eq!(shortened(&"x".repeat(80)), "x".repeat(80));
        assert_eq!(quoted_list(["a", "b"].into_iter()), "\"a\", \"b\"");
        assert!(quoted_list(["a"; 9].into_iter()).ends_with("\"a\", ..."));
    }
}
