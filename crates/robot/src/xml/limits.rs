//! Sizes beyond which a text is not parsed. The parser compares each attribute with the others of
//! its element, and each prefix with all that are declared.

use super::text_error::at;
use crate::error::DescriptionError;

/// Most bytes of a text.
const MOST_BYTES: usize = 16 << 20;
/// Most elements, texts and comments.
pub(super) const MOST_NODES: u32 = 1_000_000;
/// Most attributes of one element.
const MOST_ATTRIBUTES: usize = 256;
/// Most declarations of namespaces.
const MOST_NAMESPACES: usize = 256;

/// Refuses a text that would take the parser long.
pub(super) fn check(text: &str) -> Result<(), DescriptionError> {
    if text.len() > MOST_BYTES {
        let problem = format!("the file has {} bytes, and at most {MOST_BYTES} (16 MiB) are read", text.len());
        return Err(at(text, 0, problem, "keep meshes in files of their own"));
    }
    if let Some((offset, _)) = text.match_indices("xmlns").nth(MOST_NAMESPACES) {
        let problem = format!("more than {MOST_NAMESPACES} namespaces are declared");
        return Err(at(text, offset, problem, "declare each once, in the outermost element"));
    }
    let mut from = 0;
    while let Some(start) = text[from..].find('<').map(|start| from + start) {
        let (length, attributes) = markup(&text[start..]);
        if attributes > MOST_ATTRIBUTES {
            let problem = format!("an element has more than {MOST_ATTRIBUTES} attributes");
            return Err(at(text, start, problem, "remove those that the format does not have"));
        }
        from = start + length;
    }
    Ok(())
}

/// Length of the markup at the start of a text, and its number of attributes.
fn markup(text: &str) -> (usize, usize) {
    let up_to = |end: &str| (text.find(end).map_or(text.len(), |start| start + end.len()), 0);
    if text.starts_with("<!--") {
        up_to("-->")
    } else if text.starts_with("<![CDATA[") {
        up_to("]]>")
    } else if text.starts_with("<?") {
        up_to("?>")
    } else {
        tag(text)
    }
}

/// Length of a tag and its number of attributes, which is that of its quoted values.
fn tag(text: &str) -> (usize, usize) {
    let mut quote = None;
    let mut attributes = 0;
    for (index, byte) in text.bytes().enumerate() {
        match (quote, byte) {
            (None, b'>') => return (index + 1, attributes),
            (None, b'"' | b'\'') => {
                quote = Some(byte);
                attributes += 1;
            }
            (Some(open), _) if open == byte => quote = None,
            _ => {}
        }
    }
    (text.len(), attributes)
}
