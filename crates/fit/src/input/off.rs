//! Object file format (Geomview's OFF), text.
//!
//! An optional keyword, three counts, the vertices, the faces. Most files have one vertex or face
//! in a line, and then may have colours behind them; but line ends mean nothing to the format, so a
//! file that is not laid out like that is read as the stream of numbers that it is.

use super::surface::{Place, Surface};
use super::text::{Line, lines, quoted};
use super::{Defect, text};
use nalgebra::Vector3;

/// What the keyword states.
#[derive(Clone, Copy, Debug)]
struct Kind {
    /// Numbers that each vertex has behind its coordinates, normals and texture coordinates alone.
    extras: usize,
    has_colors: bool,
}

impl Kind {
    /// How many numbers a vertex has. Colours have four components, or three where the first
    /// vertex, in a line of its own, says so.
    fn width(self, lines: &[Line<'_>]) -> usize {
        let least = 3 + self.extras;
        let has_three = lines.get(1).is_some_and(|line| line.fields().count() == least + 3);
        match (self.has_colors, has_three) {
            (false, _) => least,
            (true, true) => least + 3,
            (true, false) => least + 4,
        }
    }
}

/// The counts.
#[derive(Clone, Copy, Debug)]
struct Counts {
    vertices: usize,
    faces: usize,
}

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let lines: Vec<Line<'_>> =
        lines(bytes)?.map(|line| line.without_comment(b"#")).filter(|line| !line.is_blank()).collect();
    let (kind, lines) = keyword(&lines)?;
    by_lines(&lines).or_else(|by_lines| {
        if is_laid_out_in_rows(&lines, kind) {
            return Err(by_lines);
        }
        as_stream(&lines, kind.width(&lines)).map_err(|error| match error {
            // Files with far fewer lines than rows were not laid out in lines.
            StreamError::Defect(defect, counts) if lines.len() < counts.vertices.saturating_add(counts.faces) / 2 => {
                defect
            }
            _ => by_lines,
        })
    })
}

/// Whether the file has one row in a line, so that a line which lost a number must not be read on
/// into the next: it has as many lines as rows, or most vertices, but not all, in lines of their
/// own.
fn is_laid_out_in_rows(lines: &[Line<'_>], kind: Kind) -> bool {
    let Some((first, rows)) = lines.split_first() else { return false };
    let counts: Option<Vec<usize>> = first.fields().map(text::integer).collect();
    let Some(&[vertices, faces, ..]) = counts.as_deref() else { return false };
    let width = kind.width(lines);
    let whole = rows.iter().take(vertices).filter(|line| line.fields().count() == width).count();
    Some(rows.len()) == vertices.checked_add(faces) || 2 * whole > vertices && whole < vertices
}

/// What the keyword states, and the lines behind it; without one the counts come first.
fn keyword<'a>(lines: &[Line<'a>]) -> Result<(Kind, Vec<Line<'a>>), Defect> {
    let first = *lines.first().ok_or_else(counts_missing)?;
    let Some(at) = first.text.windows(3).position(|word| word == b"OFF") else {
        return Ok((Kind { extras: 0, has_colors: false }, lines.to_vec()));
    };
    let prefix = first.text[..at].trim_ascii();
    let rest = Line { text: &first.text[at + 3..], ..first };
    let is_binary = rest.fields().any(|field| field.eq_ignore_ascii_case(b"BINARY"));
    let kinds: [(&[u8], usize, bool); 8] = [
        (b"", 0, false),
        (b"C", 0, true),
        (b"N", 3, false),
        (b"CN", 3, true),
        (b"ST", 2, false),
        (b"STC", 2, true),
        (b"STN", 5, false),
        (b"STCN", 5, true),
    ];
    let Some(&(_, extras, has_colors)) = kinds.iter().find(|(known, ..)| *known == prefix).filter(|_| !is_binary)
    else {
        let what = quoted(first.text);
        return Err(first
            .defect(format!("the kind {what} of OFF is not supported"))
            .remedy("export it as text in three dimensions"));
    };
    let mut behind = lines[1..].to_vec();
    if !rest.is_blank() {
        behind.insert(0, rest);
    }
    Ok((Kind { extras, has_colors }, behind))
}

fn counts_missing() -> Defect {
    Defect::new("end of file", "the counts of vertices, faces and edges are missing")
}

/// The file as one row in a line.
fn by_lines(lines: &[Line<'_>]) -> Result<Surface, Defect> {
    let mut lines = lines.iter().copied();
    let first = lines.next().ok_or_else(counts_missing)?;
    let wrong = || first.defect("the counts of vertices, faces and edges are expected here");
    let counts: Option<Vec<usize>> = first.fields().map(text::integer).collect();
    let counts = match counts.as_deref() {
        Some(&[vertices, faces] | &[vertices, faces, _]) => Counts { vertices, faces },
        _ => return Err(wrong()),
    };
    let mut surface = Surface::default();
    let mut columns = None;
    let missing = |what: &str, index: usize, count: usize| {
        Defect::new("end of file", format!("{what} {index} (counted from 0) of {count} is missing"))
    };
    for index in 0..counts.vertices {
        let line = lines.next().ok_or_else(|| missing("vertex", index, counts.vertices))?;
        surface.points.push(Vector3::from(line.coordinates(line.fields())?));
        let found = line.fields().count();
        let expected = *columns.get_or_insert(found);
        if found != expected {
            return Err(line.defect(format!("{found} numbers where the vertices before have {expected}")));
        }
    }
    let mut colors = None;
    for index in 0..counts.faces {
        let line = lines.next().ok_or_else(|| missing("face", index, counts.faces))?;
        let mut fields = line.fields();
        let count: usize = line.integer(fields.next().unwrap_or_default())?;
        let corners =
            fields.by_ref().take(count).map(|field| line.integer(field)).collect::<Result<Vec<usize>, _>>()?;
        if corners.len() < count {
            return Err(line.defect(format!("{} corners where {count} are announced", corners.len())));
        }
        let color = fields.map(|field| line.number(field)).collect::<Result<Vec<_>, _>>()?;
        if ![0, 1, 3, 4].contains(&color.len()) {
            return Err(line.defect(format!("{} numbers behind the {count} corners, which are no color", color.len())));
        }
        // A row that lost its count, or a corner, looks like one with another colour.
        let expected = *colors.get_or_insert(color.len());
        if color.len() != expected || count < 3 && !color.is_empty() {
            return Err(line.defect(format!(
                "{count} corners and {} numbers behind them, where the faces before have {expected} behind theirs",
                color.len()
            )));
        }
        surface.add_face(Place::Line(line.number), corners);
    }
    match lines.next() {
        Some(line) => Err(line.defect(format!(
            "{} vertices and {} faces are announced, and this line comes after them",
            counts.vertices, counts.faces
        ))),
        None => Ok(surface),
    }
}

enum StreamError {
    Defect(Defect, Counts),
    /// It does not begin with counts.
    Layout,
}

/// The file as a stream of numbers, so many for each vertex, without colours of faces.
fn as_stream(lines: &[Line<'_>], width: usize) -> Result<Surface, StreamError> {
    let mut fields = lines.iter().flat_map(|line| line.fields().map(move |field| (*line, field)));
    let mut count = || fields.next().and_then(|(_, field)| text::integer(field)).ok_or(StreamError::Layout);
    let counts = Counts { vertices: count()?, faces: count()? };
    let _edges = count()?;
    let failed = |defect| StreamError::Defect(defect, counts);
    let ended = |what: &str, index: usize| {
        let reason = format!("{what} {index} (counted from 0) is not complete");
        failed(Defect::new("end of file", reason))
    };
    let mut surface = Surface::default();
    for index in 0..counts.vertices {
        let mut point = Vector3::zeros();
        for column in 0..width {
            let (line, field) = fields.next().ok_or_else(|| ended("vertex", index))?;
            let value = line.number(field).map_err(failed)?;
            if column < 3 {
                point[column] = value;
            }
        }
        surface.points.push(point);
    }
    for index in 0..counts.faces {
        let (line, field) = fields.next().ok_or_else(|| ended("face", index))?;
        let count: usize = line.integer(field).map_err(failed)?;
        let mut corners = Vec::new();
        for _ in 0..count {
            let (line, field) = fields.next().ok_or_else(|| ended("face", index))?;
            corners.push(line.integer(field).map_err(failed)?);
        }
        // Without lines to go by, whatever is no proper face shows that the counts are wrong.
        let mut distinct = corners.clone();
        distinct.sort_unstable();
        distinct.dedup();
        if count < 3 || distinct.len() < count || distinct.iter().any(|&corner: &usize| corner >= counts.vertices) {
            let reason = format!("face {index} (counted from 0) does not name at least three different vertices");
            return Err(failed(line.defect(reason)));
        }
        surface.add_face(Place::Line(line.number), corners);
    }
    match fields.next() {
        Some((line, field)) => Err(failed(line.defect(format!("{} comes after the last face", quoted(field))))),
        None => Ok(surface),
    }
}
