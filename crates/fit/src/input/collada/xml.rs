//! Elements of an XML file, their children and the numbers in them.

use crate::input::error::Defect;
use crate::input::text;
use roxmltree::Node;

pub(super) type Xml<'a, 'i> = Node<'a, 'i>;

/// An element that the format does not have there: passing over it could leave out a shape.
pub(super) fn unexpected(element: Xml<'_, '_>) -> Defect {
    Defect::new(place_of(element), "the format has no such element here")
}

/// The first child element of a name.
pub(super) fn child<'a, 'i>(parent: Xml<'a, 'i>, name: &str) -> Option<Xml<'a, 'i>> {
    parent.children().find(|element| element.is_element() && element.tag_name().name() == name)
}

/// All child elements of a name.
pub(super) fn children<'a, 'i, 'n>(
    parent: Xml<'a, 'i>,
    name: &'n str,
) -> impl Iterator<Item = Xml<'a, 'i>> + use<'a, 'i, 'n> {
    parent.children().filter(move |element| element.is_element() && element.tag_name().name() == name)
}

/// An element as errors name it, with its line.
pub(super) fn place_of(element: Xml<'_, '_>) -> String {
    let line = element.document().text_pos_at(element.range().start).row;
    let id = element.attribute("id").map(|id| format!(" {}", text::quoted(id.as_bytes()))).unwrap_or_default();
    format!("line {line}, element {}{id}", text::shortened(element.tag_name().name()))
}

/// The words of an element's text, comments left out.
pub(super) fn words<'a>(element: Xml<'a, '_>) -> impl Iterator<Item = &'a str> {
    element.children().filter(Xml::is_text).filter_map(|text| text.text()).flat_map(str::split_ascii_whitespace)
}

/// The numbers in an element.
pub(super) fn numbers(element: Xml<'_, '_>) -> Result<Vec<f64>, Defect> {
    let number = |word: &str| {
        text::number(word.as_bytes())
            .map_err(|reason| Defect::new(place_of(element), reason.text).remedy(reason.remedy))
    };
    words(element).map(number).collect()
}

/// The whole numbers in an element.
pub(super) fn integers(element: Xml<'_, '_>) -> Result<Vec<usize>, Defect> {
    let integer = |word: &str| {
        text::integer(word.as_bytes()).ok_or_else(|| {
            let reason = format!("{} is not the number of a vertex", text::quoted(word.as_bytes()));
            Defect::new(place_of(element), reason)
        })
    };
    words(element).map(integer).collect()
}
