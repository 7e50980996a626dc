//! Meshes of a COLLADA file: sources of numbers, and the primitives that index them.

use super::document::Document;
use super::xml::{Xml, child, children, integers, numbers, place_of, unexpected};
use crate::input::error::Defect;
use crate::input::text::quoted;
use nalgebra::Vector3;

/// A geometry in its own frame, in units of the file.
pub(super) struct Geometry {
    pub(super) points: Vec<Vector3<f64>>,
    /// Loops of each polygon: its outline, then those around its holes.
    pub(super) polygons: Vec<Vec<Vec<usize>>>,
}

impl Geometry {
    /// Reads the element `geometry`.
    ///
    /// # Errors
    /// What is wrong with it, and in which element.
    pub(super) fn read(document: &Document<'_, '_>, geometry: Xml<'_, '_>) -> Result<Self, Defect> {
        let mesh = child(geometry, "mesh").ok_or_else(|| {
            let kinds: Vec<_> = geometry.children().filter(Xml::is_element).map(|e| e.tag_name().name()).collect();
            let reason =
                format!("this geometry is no mesh but {}, which is not read", quoted(kinds.join(", ").as_bytes()));
            Defect::new(place_of(geometry), reason).remedy("export the shape as polygons")
        })?;
        let vertices = needed(mesh, "vertices")?;
        let position = children(vertices, "input")
            .find(|input| input.attribute("semantic") == Some("POSITION"))
            .ok_or_else(|| Defect::new(place_of(vertices), "no input has the semantic POSITION"))?;
        let points = positions(document.referenced(position, "source")?, document)?;
        let mut polygons = Vec::new();
        for element in mesh.children().filter(Xml::is_element) {
            match (Shape::named(element.tag_name().name()), element.tag_name().name()) {
                (Some(shape), _) => shape.read(element, vertices, points.len(), &mut polygons)?,
                (None, "source" | "vertices" | "lines" | "linestrips" | "extra") => {}
                _ => return Err(unexpected(element)),
            }
        }
        Ok(Self { points, polygons })
    }
}

fn needed<'a, 'i>(parent: Xml<'a, 'i>, name: &str) -> Result<Xml<'a, 'i>, Defect> {
    child(parent, name).ok_or_else(|| Defect::new(place_of(parent), format!("the element {name:?} is missing")))
}

/// A whole number in an attribute.
fn count(element: Xml<'_, '_>, name: &str, default: Option<usize>) -> Result<usize, Defect> {
    match (element.attribute(name), default) {
        (None, Some(default)) => Ok(default),
        (None, None) => Err(Defect::new(place_of(element), format!("the attribute {name:?} is missing"))),
        (Some(text), _) => text.trim().parse().map_err(|_| {
            Defect::new(
                place_of(element),
                format!("the attribute {name} is {}, which is no whole number", quoted(text.as_bytes())),
            )
        }),
    }
}

/// The points of an element `source`.
fn positions(source: Xml<'_, '_>, document: &Document<'_, '_>) -> Result<Vec<Vector3<f64>>, Defect> {
    let accessor = needed(needed(source, "technique_common")?, "accessor")?;
    let array = document.referenced(accessor, "source")?;
    let values = numbers(array)?;
    let announced = count(array, "count", None)?;
    if announced != values.len() {
        let reason = format!("{announced} numbers are announced, and {} are there", values.len());
        return Err(Defect::new(place_of(array), reason));
    }
    let (points, stride) = (count(accessor, "count", None)?, count(accessor, "stride", Some(1))?);
    let offset = count(accessor, "offset", Some(0))?;
    // Parameters without a name are passed over.
    let names: Vec<Option<&str>> = children(accessor, "param").map(|param| param.attribute("name")).collect();
    let place = |axis: usize| {
        let named = names.iter().position(|name| *name == Some(["X", "Y", "Z"][axis]));
        named.or_else(|| names.iter().all(Option::is_none).then_some(axis))
    };
    let axes = (0..3).map(place).collect::<Option<Vec<usize>>>().filter(|axes| axes.iter().all(|axis| *axis < stride));
    let axes = axes.ok_or_else(|| Defect::new(place_of(accessor), "it does not have the parameters X, Y and Z"))?;
    let needed = points.checked_mul(stride).and_then(|needed| needed.checked_add(offset));
    if needed.is_none_or(|needed| needed > values.len()) {
        let reason = format!("{points} points of {stride} numbers from number {offset} on, but there are {announced}");
        return Err(Defect::new(place_of(accessor), reason));
    }
    let rows = values[offset..].chunks_exact(stride).take(points);
    Ok(rows.map(|row| Vector3::new(row[axes[0]], row[axes[1]], row[axes[2]])).collect())
}

/// How corners make polygons.
#[derive(Clone, Copy)]
enum Shape {
    Triangles,
    Polylist,
    Polygons,
    Fans,
    Strips,
}

impl Shape {
    /// That of an element; none for lines, and for what is no primitive.
    fn named(name: &str) -> Option<Self> {
        Some(match name {
            "triangles" => Self::Triangles,
            "polylist" => Self::Polylist,
            "polygons" => Self::Polygons,
            "trifans" => Self::Fans,
            "tristrips" => Self::Strips,
            _ => return None,
        })
    }

    /// Adds the polygons of a primitive.
    fn read(
        self,
        element: Xml<'_, '_>,
        vertices: Xml<'_, '_>,
        points: usize,
        polygons: &mut Vec<Vec<Vec<usize>>>,
    ) -> Result<(), Defect> {
        let known = ["input", "vcount", "p", "ph", "extra"];
        let is_unknown = |part: &Xml<'_, '_>| part.is_element() && !known.contains(&part.tag_name().name());
        if let Some(unknown) = element.children().find(is_unknown) {
            return Err(unexpected(unknown));
        }
        let corners = Corners::new(element, vertices, points)?;
        let announced = count(element, "count", None)?;
        let wrong = |found: usize| {
            let reason = format!("{announced} primitives are announced, and {found} are there");
            Defect::new(place_of(element), reason)
        };
        let lists = children(element, "p").map(|p| corners.list(p)).collect::<Result<Vec<_>, _>>()?;
        let before = polygons.len();
        match self {
            Self::Triangles => {
                for list in &lists {
                    let (triangles, rest) = list.as_chunks::<3>();
                    if !rest.is_empty() {
                        return Err(Defect::new(place_of(element), "the last triangle is not complete"));
                    }
                    polygons.extend(triangles.iter().map(|triangle| vec![triangle.to_vec()]));
                }
            }
            Self::Polylist => {
                let counts = child(element, "vcount").map(integers).transpose()?.unwrap_or_default();
                let list = lists.concat();
                let total = counts.iter().try_fold(0_usize, |sum, count| sum.checked_add(*count));
                if total != Some(list.len()) {
                    let total = total.map_or("too many".to_owned(), |total| total.to_string());
                    let reason = format!("vcount announces {total} corners, and {} are there", list.len());
                    return Err(Defect::new(place_of(element), reason));
                }
                let mut rest = &list[..];
                for count in counts {
                    let (polygon, behind) = rest.split_at(count);
                    polygons.push(vec![polygon.to_vec()]);
                    rest = behind;
                }
            }
            Self::Polygons => {
                polygons.extend(lists.into_iter().map(|list| vec![list]));
                for holed in children(element, "ph") {
                    let loops = children(holed, "p").chain(children(holed, "h")).map(|list| corners.list(list));
                    polygons.push(loops.collect::<Result<Vec<_>, _>>()?);
                }
            }
            Self::Fans | Self::Strips => {
                if lists.len() != announced {
                    return Err(wrong(lists.len()));
                }
                let is_strip = matches!(self, Self::Strips);
                for list in &lists {
                    let triangle = |i: usize| match (is_strip, i % 2) {
                        (true, 0) => [list[i], list[i + 1], list[i + 2]],
                        (true, _) => [list[i + 1], list[i], list[i + 2]],
                        (false, _) => [list[0], list[i + 1], list[i + 2]],
                    };
                    polygons.extend((0..list.len().saturating_sub(2)).map(|i| vec![triangle(i).to_vec()]));
                }
                return Ok(());
            }
        }
        let found = polygons.len() - before;
        if found == announced { Ok(()) } else { Err(wrong(found)) }
    }
}

/// How the lists of a primitive name vertices.
struct Corners {
    /// Indices of each corner, and which of them is the vertex.
    stride: usize,
    offset: usize,
    points: usize,
}

impl Corners {
    fn new(element: Xml<'_, '_>, vertices: Xml<'_, '_>, points: usize) -> Result<Self, Defect> {
        let mut stride = 1;
        let mut offset = None;
        for input in children(element, "input") {
            let at = count(input, "offset", Some(0))?;
            stride = stride.max(at.saturating_add(1));
            if input.attribute("semantic") == Some("VERTEX") {
                let source = input.attribute("source").and_then(|source| source.strip_prefix('#'));
                if source.is_none() || source != vertices.attribute("id") {
                    return Err(Defect::new(place_of(input), "the source of VERTEX is not the vertices of this mesh"));
                }
                offset = Some(at);
            }
        }
        let offset = offset.ok_or_else(|| Defect::new(place_of(element), "no input has the semantic VERTEX"))?;
        Ok(Self { stride, offset, points })
    }

    /// The vertices of a list.
    fn list(&self, element: Xml<'_, '_>) -> Result<Vec<usize>, Defect> {
        let indices = integers(element)?;
        if indices.len() % self.stride != 0 {
            let reason = format!("{} indices, which are no multiple of {}", indices.len(), self.stride);
            return Err(Defect::new(place_of(element), reason));
        }
        let corners: Vec<usize> = indices.into_iter().skip(self.offset).step_by(self.stride).collect();
        match corners.iter().find(|&&corner| corner >= self.points) {
            Some(corner) => {
                let reason = format!("vertex {corner} (counted from 0) is named, but there are {}", self.points);
                Err(Defect::new(place_of(element), reason))
            }
            None => Ok(corners),
        }
    }
}
