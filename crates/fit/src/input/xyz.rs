//! Point clouds: one point in a line, its coordinates first, then columns that are ignored.
//!
//! Columns are separated by blanks, commas or semicolons, of one kind in a line: a comma beside
//! another separator may be a decimal comma, which must not be guessed. Names of columns, which say
//! where x, y and z are, and a count of the points may come first.

use super::surface::Surface;
use super::text::{DECIMAL_COMMA, Line, is_blank, lines, number};
use super::{Defect, text};
use nalgebra::Vector3;

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let mut surface = Surface::default();
    let mut announced = None;
    let mut axes = None;
    let mut columns = None;
    let (mut has_commas, mut has_points) = (true, false);
    for whole in lines(bytes)? {
        let line = whole.without_comment(b"#").without_comment(b"//");
        if line.is_blank() {
            // Programs put the names into a comment, too.
            if surface.points.is_empty() && axes.is_none() {
                axes = axes_of_comment(whole);
            }
            continue;
        }
        let fields = columns_of(line)?;
        if surface.points.is_empty() {
            if announced.is_none()
                && let [field] = fields[..]
                && let Some(count) = text::integer::<usize>(field)
            {
                announced = Some((line, count));
                continue;
            }
            if columns.is_none() && fields.iter().all(|field| is_name(field)) {
                axes = Some(axes_named(&fields).ok_or_else(|| {
                    line.defect("the columns have names, but not x, y and z").remedy("name them so, or remove the line")
                })?);
                // Names come once, one for each column.
                columns = Some(fields.len());
                continue;
            }
        }
        let [x, y, z] = axes.unwrap_or([0, 1, 2]);
        let chosen = [x, y, z].into_iter().map_while(|axis| fields.get(axis).copied());
        surface.points.push(Vector3::from(line.coordinates(chosen)?));
        let expected = *columns.get_or_insert(fields.len());
        if fields.len() != expected {
            let reason = format!("{} columns where the names or the points before have {expected}", fields.len());
            return Err(line.defect(reason));
        }
        has_commas &= separators_are_commas(line);
        has_points |= line.text.iter().any(|byte| matches!(byte, b'.' | b'e' | b'E'));
    }
    // 1,125,2,125,3,125 may be three numbers with decimal commas.
    if has_commas && !has_points && columns.is_some_and(|columns| columns >= 6 && columns % 2 == 0) {
        let reason = "the columns are whole numbers between commas, which may be decimal commas";
        return Err(Defect::new("all lines", reason).remedy("separate the columns by blanks or semicolons"));
    }
    match announced {
        Some((line, count)) if count != surface.points.len() => {
            Err(line.defect(format!("{count} points are announced, and {} follow", surface.points.len())))
        }
        _ => Ok(surface),
    }
}

/// The columns that the names x, y and z have, or those of points that ParaView writes.
fn axes_named(names: &[&[u8]]) -> Option<[usize; 3]> {
    let names: Vec<String> = names
        .iter()
        .map(|name| String::from_utf8_lossy(name).trim_matches(['"', '\'', '/', '#']).to_ascii_lowercase())
        .collect();
    let place = |axis: usize| {
        let known = [["x", "y", "z"][axis], ["points:0", "points:1", "points:2"][axis]];
        let mut places = (0..names.len()).filter(|&place| known.contains(&names[place].as_str()));
        places.next().filter(|_| places.next().is_none())
    };
    Some([place(0)?, place(1)?, place(2)?])
}

/// The same of a comment, if it contains nothing but names.
fn axes_of_comment(line: Line<'_>) -> Option<[usize; 3]> {
    let text = line.text.trim_ascii();
    let marks = text.iter().take_while(|byte| matches!(byte, b'#' | b'/')).count();
    let text = text[marks..].trim_ascii();
    let fields = columns_of(Line { text, ..line }).ok()?;
    if fields.iter().all(|field| is_name(field)) { axes_named(&fields) } else { None }
}

/// Whether a field can be the name of a column: no number, and not what is left of one.
fn is_name(field: &[u8]) -> bool {
    let begins = |byte: &u8| byte.is_ascii_alphabetic() || matches!(byte, b'"' | b'_' | 0x80..);
    field.first().is_some_and(begins) && number(field).is_err()
}

/// Whether commas alone, without blanks, separate the columns of a line.
fn separators_are_commas(line: Line<'_>) -> bool {
    let text = line.text.trim_ascii();
    text.contains(&b',') && !text.iter().any(|byte| is_blank(*byte) || *byte == b';')
}

/// The columns of a line.
fn columns_of(line: Line<'_>) -> Result<Vec<&[u8]>, Defect> {
    let is_separator = |byte: u8| is_blank(byte) || matches!(byte, b',' | b';');
    let text = line.text.trim_ascii();
    let mut kinds = Vec::new();
    let mut fields = Vec::new();
    let mut rest = text;
    loop {
        let end = rest.iter().position(|byte| is_separator(*byte)).unwrap_or(rest.len());
        fields.push(&rest[..end]);
        let length = rest[end..].iter().take_while(|byte| is_separator(**byte)).count();
        if length == 0 {
            break;
        }
        let separator = &rest[end..end + length];
        rest = &rest[end + length..];
        if rest.is_empty() {
            // A separator behind the last column, as some programs write it.
            break;
        }
        let has_blank = separator.iter().any(|byte| is_blank(*byte));
        let marks: Vec<u8> = separator.iter().copied().filter(|byte| !is_blank(*byte)).collect();
        match marks[..] {
            [] => kinds.push((b' ', true)),
            [mark] => kinds.push((mark, has_blank)),
            _ => return Err(line.defect("an empty column between two separators")),
        }
    }
    let first = kinds.first().copied();
    // Blanks beside a comma tell it from a decimal comma only where all commas have them.
    let is_mixed = kinds.iter().any(|kind| kind.0 != b',' && first.is_some_and(|first| first.0 != kind.0))
        || kinds.iter().any(|kind| kind.0 == b',' && Some(*kind) != first);
    if is_mixed {
        return Err(line.defect("commas beside other separators may be decimal commas").remedy(DECIMAL_COMMA));
    }
    Ok(fields)
}
