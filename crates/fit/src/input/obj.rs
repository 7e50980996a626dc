//! Wavefront OBJ, text: vertices (`v`) and faces (`f`).

use super::Defect;
use super::surface::{Place, Surface};
use super::text::{Line, lines, quoted};
use nalgebra::Vector3;
use std::borrow::Cow;

/// Keywords whose lines contain nothing that a body needs: texture coordinates, normals, lines and
/// points between vertices, groups, materials, and how programs draw it all.
const IGNORED: [&[u8]; 18] = [
    b"vt",
    b"vn",
    b"vp",
    b"l",
    b"p",
    b"o",
    b"g",
    b"s",
    b"mg",
    b"usemtl",
    b"mtllib",
    b"usemap",
    b"maplib",
    b"bevel",
    b"c_interp",
    b"d_interp",
    b"lod",
    b"shadow_obj",
];

/// Keywords of shapes that are not read, and of files within files.
const REFUSED: [&[u8]; 17] = [
    b"cstype",
    b"deg",
    b"bmat",
    b"step",
    b"curv",
    b"curv2",
    b"surf",
    b"parm",
    b"trim",
    b"hole",
    b"scrv",
    b"sp",
    b"end",
    b"con",
    b"call",
    b"csh",
    b"trace_obj",
];

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let mut surface = Surface::default();
    let mut columns = None;
    let mut lines = lines(bytes)?;
    while let Some(first) = lines.next() {
        let text = continued(first, &mut lines);
        let line = Line { text: &text, ..first }.without_comment(b"#");
        let mut fields = line.fields();
        let Some(keyword) = fields.next() else { continue };
        match keyword {
            b"v" => surface.points.push(vertex(line, &mut columns)?),
            // fo is what faces were called before.
            b"f" | b"fo" => {
                let corners = face(line, surface.points.len())?;
                surface.add_face(Place::Line(line.number), corners);
            }
            known if IGNORED.contains(&known) => {}
            known if REFUSED.contains(&known) => {
                let reason =
                    format!("{} belongs to a curve, a surface or another file, which is not read", quoted(known));
                return Err(line.defect(reason).remedy("export the shape as polygons, in one file"));
            }
            unknown => return Err(line.defect(format!("{} is no keyword of this format", quoted(unknown)))),
        }
    }
    Ok(surface)
}

/// Keywords before names, which may end with a backslash that continues nothing.
const NAMED: [&[u8]; 7] = [b"o", b"g", b"usemtl", b"mtllib", b"usemap", b"maplib", b"shadow_obj"];

/// The text of a line with those that a backslash at its end goes on with; comments and names are
/// not continued.
fn continued<'a>(first: Line<'a>, lines: &mut impl Iterator<Item = Line<'a>>) -> Cow<'a, [u8]> {
    let first = first.without_comment(b"#");
    let mut text = Cow::Borrowed(first.text);
    if first.fields().next().is_some_and(|keyword| NAMED.contains(&keyword)) {
        return text;
    }
    while text.trim_ascii_end().ends_with(b"\\") {
        let joined = text.to_mut();
        joined.truncate(joined.trim_ascii_end().len() - 1);
        joined.push(b' ');
        match lines.next() {
            Some(next) => joined.extend_from_slice(next.without_comment(b"#").text),
            None => break,
        }
    }
    text
}

/// The point of `v x y z`, of `v x y z w`, which is (x, y, z) / w, or of `v x y z red green blue`.
/// All vertices have as many columns as the first one: a line that was cut would be taken for
/// another kind.
fn vertex(line: Line<'_>, columns: &mut Option<usize>) -> Result<Vector3<f64>, Defect> {
    let mut fields = line.fields().skip(1);
    let point = Vector3::from(line.coordinates(&mut fields)?);
    let rest = fields.map(|field| line.number(field)).collect::<Result<Vec<_>, _>>()?;
    let (found, expected) = (3 + rest.len(), *columns.get_or_insert(3 + rest.len()));
    if found != expected {
        let reason = format!("{found} numbers where the vertices before have {expected}");
        return Err(line.defect(reason).remedy("give all vertices a weight or a colour, or none"));
    }
    match rest[..] {
        [] | [_, _, _] => Ok(point),
        [0.0] => Err(line.defect("the weight w is 0, which puts the vertex at infinity").remedy("remove the vertex")),
        [weight] if !weight.is_finite() => Err(line.defect("the weight w is not finite").remedy("remove the vertex")),
        [weight] => Ok(point / weight),
        _ => Err(line.defect(format!("{found} numbers, where x y z, x y z w or x y z red green blue are expected"))),
    }
}

/// The vertices of `f vertex/texture/normal ...`, counted from 0.
fn face(line: Line<'_>, known: usize) -> Result<Vec<usize>, Defect> {
    let mut form = None;
    let mut corners = Vec::new();
    for field in line.fields().skip(1) {
        let mut parts = field.split(|byte| *byte == b'/');
        let vertex = parts.next().unwrap_or_default();
        let rest: Vec<&[u8]> = parts.collect();
        let found = [rest.len(), usize::from(rest.first().is_some_and(|texture| texture.is_empty()))];
        let is_cut = rest.len() > 2 || rest.last().is_some_and(|last| last.is_empty());
        if is_cut || *form.get_or_insert(found) != found {
            let reason = format!("{} is not of the form v, v/vt, v//vn or v/vt/vn as the others", quoted(field));
            return Err(line.defect(reason));
        }
        for index in rest.into_iter().filter(|index| !index.is_empty()) {
            let _: i64 = line.integer(index)?;
        }
        corners.push(corner(line, vertex, known)?);
    }
    if corners.len() < 3 {
        return Err(line.defect(format!("{} corners where a face has at least 3", corners.len())));
    }
    Ok(corners)
}

/// A vertex counted from 1, or backwards from the `known` ones before this line, counted from 0.
fn corner(line: Line<'_>, field: &[u8], known: usize) -> Result<usize, Defect> {
    let index: i64 = line.integer(field)?;
    let from_zero =
        if index > 0 { Some(index - 1) } else { i64::try_from(known).ok().and_then(|n| n.checked_add(index)) };
    from_zero
        .and_then(|corner| usize::try_from(corner).ok())
        .filter(|_| index != 0)
        .ok_or_else(|| line.defect(format!("there is no vertex {index}")))
}
