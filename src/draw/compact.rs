//! Makes plotters' SVG small. It writes every line, marker and letter with all its attributes, most
//! of them the defaults; here, lines and markers of one look become one path, and texts of one look
//! one group. A third to a fifth of the letters remain, and the picture is the same.

use super::path::{Unit, push_line};
use super::thin::thinned;
use std::fmt::Write;

/// How far a curve may move, in units of the view box: a fifth of a pixel.
const TOLERANCE: f64 = 2.0;

/// Letters and what is filled, where nothing else is said: the grey of texts.
const INHERITED: &str = "#7a7a7a";

/// One element of a drawing.
enum Element<'a> {
    /// Where it is, and how it looks.
    Text {
        place: String,
        look: String,
        text: &'a str,
    },
    Path {
        look: String,
        d: String,
    },
    /// Not one that plotters draws charts with: kept as it is.
    Other(&'a str),
}

/// The same picture in fewer letters.
pub(super) fn compact(svg: &str) -> String {
    let Some((head, body)) = svg.split_once('>') else { return svg.to_owned() };
    let Some((body, _)) = body.rsplit_once("</svg>") else { return svg.to_owned() };
    let mut elements: Vec<Element<'_>> = Vec::new();
    let mut rest = body.trim_start();
    while !rest.is_empty() {
        let end = end_of_element(rest);
        let (element, after) = rest.split_at(end);
        push(&mut elements, read(element.trim_end()));
        rest = after.trim_start();
    }
    let mut small = format!("{head} font-family=\"sans-serif\" fill=\"{INHERITED}\">\n");
    write_all(&elements, &mut small);
    small.push_str("</svg>\n");
    small
}

/// Where the first element ends: after its own tag, or after the end of its text.
fn end_of_element(rest: &str) -> usize {
    let tag = rest.find('>').map_or(rest.len(), |at| at + 1);
    if rest.starts_with("<text") && !rest[..tag].ends_with("/>") {
        return rest.find("</text>").map_or(rest.len(), |at| at + "</text>".len());
    }
    tag
}

/// Adds an element, to the path before it if that looks the same. Texts may lie between: plotters
/// writes ticks and their numbers in turn, which are beside each other.
fn push<'a>(elements: &mut Vec<Element<'a>>, element: Element<'a>) {
    if let Element::Path { look, d } = &element {
        let before = elements.iter_mut().rev().find(|element| !matches!(element, Element::Text { .. }));
        if let Some(Element::Path { look: same, d: longer }) = before
            && same == look
        {
            longer.push_str(d);
            return;
        }
    }
    elements.push(element);
}

fn read(element: &str) -> Element<'_> {
    let text = |name: &str| attribute(element, name).unwrap_or_default();
    let number = |name: &str| text(name).parse::<f64>().unwrap_or(0.0).round() as i64;
    let mut d = String::new();
    match element.split([' ', '>', '/']).next() {
        Some("<text") => {
            let Some((tag, content)) = element.split_once('>') else { return Element::Other(element) };
            let content = content.trim_end_matches("</text>").trim();
            return Element::Text { place: place_of_text(tag), look: look_of_text(tag), text: content };
        }
        Some("<line") => {
            let [x1, y1, x2, y2] = ["x1", "y1", "x2", "y2"].map(number);
            push_line(&mut d, &[[x1, y1], [x2, y2]], false, Unit::Whole);
        }
        Some(tag @ ("<polyline" | "<polygon")) => {
            let points: Option<Vec<[f64; 2]>> = text("points")
                .split_whitespace()
                .map(|pair| pair.split_once(',').and_then(|(x, y)| Some([x.parse().ok()?, y.parse().ok()?])))
                .collect();
            let Some(points) = points else { return Element::Other(element) };
            let points = thinned(&points, TOLERANCE);
            let points: Vec<[i64; 2]> = points.iter().map(|p| p.map(|c| c.round() as i64)).collect();
            push_line(&mut d, &points, tag == "<polygon", Unit::Whole);
        }
        Some("<circle") => {
            let [x, y, r] = ["cx", "cy", "r"].map(number);
            if text("fill") != "none" {
                // A line of no length with round ends.
                push_line(&mut d, &[[x, y]], false, Unit::Whole);
                let look = stroke(text("fill"), 2 * r, text("opacity")) + " stroke-linecap=\"round\"";
                return Element::Path { look, d };
            }
            let _ = write!(d, "M{} {y}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0-{} 0", x - r, 2 * r, 2 * r);
        }
        _ => return Element::Other(element),
    }
    let look = match (text("fill"), text("stroke")) {
        ("none" | "", ink) => stroke(ink, number("stroke-width"), text("opacity")),
        (fill, "none" | "") => format!(" fill=\"{}\"{}", fill.to_lowercase(), opacity(text("opacity"))),
        _ => return Element::Other(element),
    };
    Element::Path { look, d }
}

fn stroke(ink: &str, width: i64, part: &str) -> String {
    format!(" fill=\"none\" stroke=\"{}\" stroke-width=\"{width}\"{}", ink.to_lowercase(), opacity(part))
}

fn opacity(part: &str) -> String {
    if matches!(part, "" | "1") { String::new() } else { format!(" opacity=\"{part}\"") }
}

fn place_of_text(tag: &str) -> String {
    let mut place = String::new();
    for name in ["x", "y", "dy", "transform"] {
        if let Some(value) = attribute(tag, name).filter(|value| *value != "0") {
            // Writing to a string cannot fail.
            let _ = write!(place, " {name}=\"{value}\"");
        }
    }
    place
}

fn look_of_text(tag: &str) -> String {
    let mut look = String::new();
    if let Some(size) = attribute(tag, "font-size").and_then(|size| size.parse::<f64>().ok()) {
        let _ = write!(look, " font-size=\"{size:.0}\"");
    }
    if let Some(anchor) = attribute(tag, "text-anchor").filter(|anchor| *anchor != "start") {
        let _ = write!(look, " text-anchor=\"{anchor}\"");
    }
    let ink = attribute(tag, "fill").unwrap_or_default().to_lowercase();
    if !ink.is_empty() && ink != INHERITED {
        let _ = write!(look, " fill=\"{ink}\"");
    }
    look + &opacity(attribute(tag, "opacity").unwrap_or_default())
}

/// The value of an attribute.
fn attribute<'a>(tag: &'a str, name: &str) -> Option<&'a str> {
    let from = tag.find(&format!(" {name}=\""))? + name.len() + 3;
    let length = tag[from..].find('"')?;
    Some(&tag[from..from + length])
}

/// Paths and, where several texts of one look follow each other, their look once.
fn write_all(elements: &[Element<'_>], svg: &mut String) {
    let mut at = 0;
    while at < elements.len() {
        let look_at = |k: usize| match elements.get(k) {
            Some(Element::Text { look, .. }) => Some(look),
            _ => None,
        };
        match &elements[at] {
            // Writing to a string cannot fail.
            Element::Other(element) => drop(writeln!(svg, "{element}")),
            Element::Path { look, d } => drop(writeln!(svg, "<path{look} d=\"{d}\"/>")),
            Element::Text { look, .. } => {
                let end = (at..elements.len()).find(|&k| look_at(k) != Some(look)).unwrap_or(elements.len());
                let _ = writeln!(svg, "<g{look}>");
                for element in &elements[at..end] {
                    if let Element::Text { place, text, .. } = element {
                        let _ = writeln!(svg, "<text{place}>{text}</text>");
                    }
                }
                svg.push_str("</g>\n");
                at = end;
                continue;
            }
        }
        at += 1;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn small(body: &str) -> String {
        let text = compact(&format!("<svg width=\"7\" xmlns=\"http://www.w3.org/2000/svg\">\n{body}</svg>\n"));
        let (head, body) = text.split_once(">\n").expect("a head");
        assert!(head.starts_with("<svg width=\"7\"") && head.ends_with("fill=\"#7a7a7a\""), "{head}");
        body.strip_suffix("</svg>\n").expect("an end").to_owned()
    }

    #[test]
    fn lines_of_one_look_are_one_path() {
        let line = |ink: &str, y: i32| {
            format!(
                "<line opacity=\"0.25\" stroke=\"{ink}\" stroke-width=\"10\" x1=\"0\" y1=\"{y}\" x2=\"9\" y2=\"{y}\"/>\n"
            )
        };
        let text = "<text x=\"1\" y=\"2\" dy=\"0.5ex\" text-anchor=\"end\" font-family=\"sans-serif\" \
                    font-size=\"104.8\" opacity=\"1\" fill=\"#7A7A7A\">\na &lt; b\n</text>\n";
        let found = small(&[&line("#7A7A7A", 1), text, &line("#7A7A7A", 4), &line("#D55E00", 5)].concat());
        assert_eq!(
            found,
            "<path fill=\"none\" stroke=\"#7a7a7a\" stroke-width=\"10\" opacity=\"0.25\" d=\"M0 1h9M0 4h9\"/>\n\
             <g font-size=\"105\" text-anchor=\"end\">\n<text x=\"1\" y=\"2\" dy=\"0.5ex\">a &lt; b</text>\n</g>\n\
             <path fill=\"none\" stroke=\"#d55e00\" stroke-width=\"10\" opacity=\"0.25\" d=\"M0 5h9\"/>\n"
        );
    }

    #[test]
    fn markers_of_one_look_are_one_path() {
        let circle = |x: i32, fill: &str, stroke: &str| {
            format!(
                "<circle cx=\"{x}\" cy=\"5\" r=\"50\" opacity=\"1\" fill=\"{fill}\" stroke=\"{stroke}\" stroke-width=\"20\"/>\n"
            )
        };
        let discs: String = (0..3).map(|x| circle(100 * x, "#1F7FC4", "none")).collect();
        assert_eq!(
            small(&discs),
            "<path fill=\"none\" stroke=\"#1f7fc4\" stroke-width=\"100\" stroke-linecap=\"round\" \
             d=\"M0 5h0M100 5h0M200 5h0\"/>\n"
        );
        let ring = small(&circle(100, "none", "#D55E00"));
        assert!(ring.contains("stroke-width=\"20\" d=\"M50 5a50 50 0 1 0 100 0a50 50 0 1 0-100 0\"/>"), "{ring}");
        let triangle = "<polygon opacity=\"1\" fill=\"#00936B\" points=\"0,-60 -51,30 52,30 \"/>\n";
        assert_eq!(small(triangle), "<path fill=\"#00936b\" d=\"M0-60l-51 90h103z\"/>\n");
    }

    #[test]
    fn curves_are_thinned_and_what_is_unknown_stays() {
        let points: String = (0..500).map(|x| format!("{x},{} ", x / 100)).collect();
        let curve = format!(
            "<polyline fill=\"none\" opacity=\"1\" stroke=\"#1F7FC4\" stroke-width=\"30\" points=\"{points}\"/>\n"
        );
        assert!(small(&curve).len() < 100, "{}", small(&curve));
        let unknown = "<rect x=\"1\" y=\"2\" width=\"3\" height=\"4\" fill=\"#FFFFFF\"/>\n";
        assert_eq!(small(unknown), unknown);
        assert_eq!(compact("no picture"), "no picture");
    }
}
