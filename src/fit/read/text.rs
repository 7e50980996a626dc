//! The line-based formats: OFF, OBJ and XYZ. Extra columns (normals, colours) are ignored.

use super::Defect;
use nalgebra::Vector3;

type Points = Result<Vec<Vector3<f64>>, Defect>;

/// Lines that hold something, numbered, without comments.
fn lines(bytes: &[u8]) -> Result<Vec<(usize, &str)>, Defect> {
    // Some editors start files with a byte order mark.
    let bytes = bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes);
    let text = std::str::from_utf8(bytes).map_err(|error| {
        let line = bytes[..error.valid_up_to()].iter().filter(|&&b| b == b'\n').count();
        Defect::line(line, "not text")
    })?;
    let lines = text.lines().enumerate().map(|(number, line)| (number, line.split('#').next().unwrap_or("").trim()));
    Ok(lines.filter(|(_, line)| !line.is_empty()).collect())
}

/// The three coordinates a line starts with.
fn coordinates<'a>(number: usize, mut fields: impl Iterator<Item = &'a str>) -> Result<Vector3<f64>, Defect> {
    let mut point = Vector3::zeros();
    for axis in 0..3 {
        let field =
            fields.next().ok_or_else(|| Defect::line(number, format!("{axis} coordinates where 3 are needed")))?;
        point[axis] = field.parse().map_err(|_| Defect::line(number, format!("{field:?} is not a number")))?;
    }
    Ok(point)
}

/// Object file format: optional keyword, counts (also on the keyword's line), one vertex per line, faces.
pub(super) fn off(bytes: &[u8]) -> Points {
    let lines = lines(bytes)?;
    let mut lines = lines.into_iter();
    let end = || Defect::new("end of file", "the counts of vertices, faces and edges are missing");
    let (mut number, first) = lines.next().ok_or_else(end)?;
    let mut counts = first;
    if let Some(at) = first.find("OFF") {
        let prefix = &first[..at];
        if !["", "C", "N", "CN", "ST", "STC", "STN", "STCN"].contains(&prefix) || first.contains("BINARY") {
            return Err(Defect::line(
                number,
                format!("the kind {first:?} of OFF is not supported, only text in 3-D is"),
            ));
        }
        counts = first[at + 3..].trim();
        if counts.is_empty() {
            (number, counts) = lines.next().ok_or_else(end)?;
        }
    }
    let counts: Vec<usize> = counts.split_ascii_whitespace().map_while(|field| field.parse().ok()).collect();
    let &[vertices, faces, ..] = counts.as_slice() else {
        return Err(Defect::line(number, "the counts of vertices and faces are expected here"));
    };
    let mut points = Vec::new();
    for index in 0..vertices {
        let (number, line) = lines
            .next()
            .ok_or_else(|| Defect::new("end of file", format!("vertex {index} of {vertices} is missing")))?;
        points.push(coordinates(number, line.split_ascii_whitespace())?);
    }
    let found = lines.count();
    if found < faces {
        return Err(Defect::new("end of file", format!("face {found} of {faces} is missing")));
    }
    Ok(points)
}

/// Wavefront: the `v` lines, also those that no face uses.
pub(super) fn obj(bytes: &[u8]) -> Points {
    let mut points = Vec::new();
    for (number, line) in lines(bytes)? {
        let mut fields = line.split_ascii_whitespace();
        if fields.next() == Some("v") {
            points.push(coordinates(number, fields)?);
        }
    }
    Ok(points)
}

/// One point per line, columns separated by blanks, commas or semicolons.
pub(super) fn xyz(bytes: &[u8]) -> Points {
    let separator = |c: char| c.is_ascii_whitespace() || c == ',' || c == ';';
    lines(bytes)?
        .into_iter()
        .map(|(number, line)| coordinates(number, line.split(separator).filter(|field| !field.is_empty())))
        .collect()
}
