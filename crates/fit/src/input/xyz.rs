//! Point clouds: one point in a line, its coordinates first, then columns that are ignored.
//!
//! Columns are separated by blanks, commas or semicolons, of one kind in a line: a comma beside
//! another separator may be a decimal comma, which must not be guessed. Names of columns and a
//! count of the points may come first.

use super::surface::Surface;
use super::text::{DECIMAL_COMMA, Line, is_blank, lines, number};
use super::{Defect, text};
use nalgebra::Vector3;

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let mut surface = Surface::default();
    let mut announced = None;
    let mut has_names = false;
    let mut columns = None;
    for line in lines(bytes)?.map(|line| line.without_comment(b"#").without_comment(b"//")) {
        if line.is_blank() {
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
            if !has_names && fields.iter().all(|field| is_name(field)) {
                has_names = true;
                continue;
            }
        }
        surface.points.push(Vector3::from(line.coordinates(fields.iter().copied())?));
        let expected = *columns.get_or_insert(fields.len());
        if fields.len() != expected {
            return Err(line.defect(format!("{} columns where the points before have {expected}", fields.len())));
        }
    }
    match announced {
        Some((line, count)) if count != surface.points.len() => {
            Err(line.defect(format!("{count} points are announced, and {} follow", surface.points.len())))
        }
        _ => Ok(surface),
    }
}

/// Whether a field can be the name of a column: no number, and not what is left of one.
fn is_name(field: &[u8]) -> bool {
    let begins = |byte: &u8| byte.is_ascii_alphabetic() || matches!(byte, b'"' | b'_' | 0x80..);
    field.first().is_some_and(begins) && number(field).is_err()
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
