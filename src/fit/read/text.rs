//! The line-based formats: OFF, OBJ and XYZ. Extra columns (normals, colours) are ignored.

use super::{Defect, Mesh};
use nalgebra::Vector3;

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
pub(super) fn off(bytes: &[u8]) -> Result<Mesh, Defect> {
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
    let mut mesh = Mesh::default();
    for index in 0..vertices {
        let (number, line) = lines
            .next()
            .ok_or_else(|| Defect::new("end of file", format!("vertex {index} of {vertices} is missing")))?;
        mesh.points.push(coordinates(number, line.split_ascii_whitespace())?);
    }
    for index in 0..faces {
        let (number, line) =
            lines.next().ok_or_else(|| Defect::new("end of file", format!("face {index} of {faces} is missing")))?;
        let mut fields = line.split_ascii_whitespace();
        let corners: usize = whole(number, fields.next().unwrap_or_default())?;
        let face = fields.take(corners).map(|field| whole(number, field)).collect::<Result<Vec<_>, _>>()?;
        if face.len() < corners {
            return Err(Defect::line(number, format!("{} corners where {corners} are announced", face.len())));
        }
        mesh.add_face(&face);
    }
    Ok(mesh)
}

fn whole<T: std::str::FromStr>(number: usize, field: &str) -> Result<T, Defect> {
    field.parse().map_err(|_| Defect::line(number, format!("{field:?} is not the number of a vertex")))
}

/// Wavefront: the `v` lines, also those that no face uses, and the `f` lines.
pub(super) fn obj(bytes: &[u8]) -> Result<Mesh, Defect> {
    let mut mesh = Mesh::default();
    for (number, line) in lines(bytes)? {
        let mut fields = line.split_ascii_whitespace();
        match fields.next() {
            Some("v") => mesh.points.push(coordinates(number, fields)?),
            Some("f") => {
                let known = mesh.points.len();
                let face = fields.map(|field| corner(number, field, known)).collect::<Result<Vec<_>, _>>()?;
                mesh.add_face(&face);
            }
            _ => {}
        }
    }
    Ok(mesh)
}

/// The vertex of `vertex/texture/normal`: counted from 1, or backwards from the `known` ones before this line.
fn corner(number: usize, field: &str, known: usize) -> Result<usize, Defect> {
    let index: i64 = whole(number, field.split('/').next().unwrap_or_default())?;
    let from_zero = if index > 0 { index - 1 } else { known as i64 + index };
    usize::try_from(from_zero)
        .ok()
        .filter(|_| index != 0)
        .ok_or_else(|| Defect::line(number, format!("there is no vertex {index}")))
}

/// One point per line, columns separated by blanks, commas or semicolons.
pub(super) fn xyz(bytes: &[u8]) -> Result<Mesh, Defect> {
    let separator = |c: char| c.is_ascii_whitespace() || c == ',' || c == ';';
    let points = lines(bytes)?
        .into_iter()
        .map(|(number, line)| coordinates(number, line.split(separator).filter(|field| !field.is_empty())))
        .collect::<Result<_, _>>()?;
    Ok(Mesh { points, ..Mesh::default() })
}
