//! Stanford PLY, text and binary of both byte orders.
//!
//! The header names elements, each a count of rows, and the properties of a row. The element
//! `vertex` has x, y and z; `face` a list of corners (`vertex_indices` or `vertex_index`), and
//! `tristrips` lists of corners in which each three in a row are a triangle and a negative number
//! begins the next strip. Whatever else there is is read over. Numbers that stand there as text are
//! read in double precision, also where the header calls them float.

use super::surface::{Place, Surface};
use super::text::{Line, lines, number, quoted};
use super::{Defect, text};
use nalgebra::Vector3;

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let (header, data) = Header::read(bytes)?;
    let mut surface = Collected::default();
    match header.encoding {
        Encoding::Text => {
            let mut lines = lines(data)?
                .map(|line| Line { number: line.number + header.lines, ..line })
                .filter(|line| !line.is_blank());
            header.rows(&mut surface, |element, index| {
                let missing = || {
                    let reason = format!("row {index} (counted from 0) of {} is missing", element.count);
                    element.defect(reason)
                };
                let line = lines.next().ok_or_else(missing)?;
                element.text_row(line)
            })?;
            if let Some(line) = lines.next() {
                return Err(line.defect("the header announces fewer rows, and this line comes after them"));
            }
        }
        Encoding::Binary { big_endian } => {
            let mut bytes = Bytes { rest: data, big_endian };
            header.rows(&mut surface, |element, index| {
                let ended = || {
                    let reason = format!("row {index} (counted from 0) of {} is not complete", element.count);
                    element.defect(reason)
                };
                element.binary_row(&mut bytes).ok_or_else(ended)
            })?;
            if !bytes.rest.iter().all(|byte| text::is_blank(*byte)) {
                let reason = format!("{} bytes come after the rows that the header announces", bytes.rest.len());
                return Err(Defect::new("end of file", reason));
            }
        }
    }
    surface.into_surface()
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Encoding {
    Text,
    Binary { big_endian: bool },
}

#[derive(Debug)]
struct Header {
    encoding: Encoding,
    elements: Vec<Element>,
    /// How many lines it has.
    lines: usize,
}

#[derive(Debug)]
struct Element {
    name: String,
    kind: Kind,
    count: usize,
    properties: Vec<Property>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Vertex,
    Face,
    Strips,
    Other,
}

#[derive(Debug)]
struct Property {
    name: String,
    role: Role,
    /// Type of the count of a list.
    list: Option<Type>,
    item: Type,
}

/// What a property is of use for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Role {
    Axis(usize),
    Corners,
    None,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Type {
    I8,
    U8,
    I16,
    U16,
    I32,
    U32,
    F32,
    F64,
}

impl Type {
    fn named(name: &[u8]) -> Option<Self> {
        Some(match name {
            b"char" | b"int8" => Self::I8,
            b"uchar" | b"uint8" => Self::U8,
            b"short" | b"int16" => Self::I16,
            b"ushort" | b"uint16" => Self::U16,
            b"int" | b"int32" => Self::I32,
            b"uint" | b"uint32" => Self::U32,
            b"float" | b"float32" => Self::F32,
            b"double" | b"float64" => Self::F64,
            _ => return None,
        })
    }

    fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl Header {
    /// The header, and the bytes after it.
    fn read(bytes: &[u8]) -> Result<(Self, &[u8]), Defect> {
        let bytes = text::without_mark(bytes)?;
        let not_ply = || Defect::new("header", "the first line is not \"ply\"");
        let first = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r')).ok_or_else(not_ply)?;
        // Lines end as the first one does: the first byte of binary data may look like a line end.
        let is_cr = bytes[first] == b'\r' && bytes.get(first + 1) != Some(&b'\n');
        let end = if is_cr { b'\r' } else { b'\n' };
        let mut rest = bytes;
        let first = take_line(&mut rest, end).ok_or_else(not_ply)?;
        if first.trim_ascii() != b"ply" {
            return Err(not_ply());
        }
        // Names are looked for among all before them.
        const MOST_LINES: usize = 10_000;
        let mut header = Self { encoding: Encoding::Text, elements: Vec::new(), lines: 1 };
        let mut encoding = None;
        loop {
            let ended = || Defect::new("header", "there is no line \"end_header\"");
            let text = take_line(&mut rest, end).ok_or_else(ended)?;
            header.lines += 1;
            let line = Line { number: header.lines, text };
            if header.lines > MOST_LINES {
                return Err(line.defect(format!("a header of more than {MOST_LINES} lines")));
            }
            let fields: Vec<&[u8]> = line.fields().collect();
            match fields[..] {
                [] | [b"comment" | b"obj_info", ..] => {}
                [b"format", kind, b"1.0"] => encoding = Some(encoding_named(line, kind)?),
                [b"element", name, count] => header.add_element(line, name, count)?,
                [b"property", b"list", count, item, name] => header.add_property(line, Some(count), item, name)?,
                [b"property", item, name] => header.add_property(line, None, item, name)?,
                [b"end_header"] => break,
                _ => return Err(line.defect(format!("{} is no line of a header", quoted(line.text)))),
            }
        }
        header.encoding = encoding.ok_or_else(|| Defect::new("header", "there is no line \"format\""))?;
        header.check(rest.len())?;
        Ok((header, rest))
    }

    fn add_element(&mut self, line: Line<'_>, name: &[u8], count: &[u8]) -> Result<(), Defect> {
        let count = text::integer(count).ok_or_else(|| line.defect(format!("{} is no count", quoted(count))))?;
        let kind = match name {
            b"vertex" => Kind::Vertex,
            b"face" => Kind::Face,
            b"tristrips" => Kind::Strips,
            _ => Kind::Other,
        };
        let written = quoted(name);
        let name = String::from_utf8_lossy(name).into_owned();
        if self.elements.iter().any(|element| element.name == name) {
            return Err(line.defect(format!("the element {written} is there twice")));
        }
        self.elements.push(Element { name, kind, count, properties: Vec::new() });
        Ok(())
    }

    fn add_property(&mut self, line: Line<'_>, count: Option<&[u8]>, item: &[u8], name: &[u8]) -> Result<(), Defect> {
        let named = |name: &[u8]| {
            Type::named(name).ok_or_else(|| line.defect(format!("{} is no type of numbers", quoted(name))))
        };
        let (list, item) = (count.map(named).transpose()?, named(item)?);
        let Some(element) = self.elements.last_mut() else {
            return Err(line.defect("a property comes before the first element"));
        };
        if list.is_some_and(|count| !count.is_integer()) {
            return Err(line.defect("the count of a list is no integer"));
        }
        let is_corners = matches!(name, b"vertex_indices" | b"vertex_index") && list.is_some();
        // A range grid lists the points of cells, which are no faces.
        if is_corners && matches!(element.kind, Kind::Vertex | Kind::Other) && element.name != "range_grid" {
            let reason = format!("the element {} has corners, but only face and tristrips are read", element.quoted());
            return Err(line.defect(reason).remedy("export the faces as triangles or polygons"));
        }
        if is_corners && element.properties.iter().any(|property| property.role == Role::Corners) {
            return Err(line.defect("the element has corners twice, as vertex_indices and as vertex_index"));
        }
        let role = match (element.kind, name, list) {
            (Kind::Vertex, b"x", None) => Role::Axis(0),
            (Kind::Vertex, b"y", None) => Role::Axis(1),
            (Kind::Vertex, b"z", None) => Role::Axis(2),
            (Kind::Face | Kind::Strips, b"vertex_indices" | b"vertex_index", Some(_)) => Role::Corners,
            _ => Role::None,
        };
        if role == Role::Corners && !item.is_integer() {
            return Err(line.defect("the corners of faces are no integers"));
        }
        let written = quoted(name);
        let name = String::from_utf8_lossy(name).into_owned();
        if element.properties.iter().any(|property| property.name == name) {
            return Err(line.defect(format!("the property {written} is there twice")));
        }
        element.properties.push(Property { name, role, list, item });
        Ok(())
    }

    /// Checks the elements against the bytes that are left for them.
    fn check(&self, bytes: usize) -> Result<(), Defect> {
        for element in &self.elements {
            // Every row takes at least a byte.
            if element.count > bytes || element.properties.is_empty() && element.count > 0 {
                return Err(element.defect(format!("{} rows do not fit in the file", element.count)));
            }
            let has = |role: Role| element.properties.iter().any(|property| property.role == role);
            let needed = match element.kind {
                Kind::Vertex if !(0..3).all(|axis| has(Role::Axis(axis))) => "the properties x, y and z are needed",
                Kind::Face | Kind::Strips if element.count > 0 && !has(Role::Corners) => {
                    "the list vertex_indices (or vertex_index) is needed"
                }
                _ => continue,
            };
            return Err(element.defect(needed));
        }
        if self.elements.iter().any(|element| element.kind == Kind::Vertex) {
            return Ok(());
        }
        Err(Defect::new("header", "there is no element \"vertex\""))
    }

    /// Reads all rows of all elements.
    fn rows(
        &self,
        into: &mut Collected,
        mut row: impl FnMut(&Element, usize) -> Result<Row, Defect>,
    ) -> Result<(), Defect> {
        for element in &self.elements {
            for index in 0..element.count {
                let row = row(element, index)?;
                into.add(element, index, row);
            }
        }
        Ok(())
    }
}

/// What stands before the next line end, which is taken, too; none without one.
fn take_line<'a>(rest: &mut &'a [u8], end: u8) -> Option<&'a [u8]> {
    let length = rest.iter().position(|byte| *byte == end)?;
    let line = &rest[..length];
    *rest = &rest[length + 1..];
    Some(line)
}

fn encoding_named(line: Line<'_>, name: &[u8]) -> Result<Encoding, Defect> {
    match name {
        b"ascii" => Ok(Encoding::Text),
        b"binary_little_endian" => Ok(Encoding::Binary { big_endian: false }),
        b"binary_big_endian" => Ok(Encoding::Binary { big_endian: true }),
        _ => Err(line.defect(format!("the format {} is not known", quoted(name)))),
    }
}

/// What is of use of a row.
#[derive(Default)]
struct Row {
    /// Line of the file; none of binary files.
    line: Option<usize>,
    point: Vector3<f64>,
    corners: Vec<i64>,
}

impl Row {
    fn set(&mut self, role: Role, value: f64) {
        match role {
            Role::Axis(axis) => self.point[axis] = value,
            // Integers of 32 bits are exact in double precision.
            Role::Corners => self.corners.push(value as i64),
            Role::None => {}
        }
    }
}

impl Element {
    fn quoted(&self) -> String {
        quoted(self.name.as_bytes())
    }

    fn defect(&self, reason: impl Into<String>) -> Defect {
        Defect::new(format!("element {}", self.quoted()), reason)
    }

    /// A row that is a line, all of it.
    fn text_row(&self, line: Line<'_>) -> Result<Row, Defect> {
        let mut fields = line.fields();
        let mut next = || {
            let field = fields.next().ok_or_else(|| {
                line.defect(format!("the row of the element {} has fewer numbers than the header says", self.quoted()))
            })?;
            Ok((field, number(field).map_err(|reason| line.defect(reason.text).remedy(reason.remedy))?))
        };
        let mut row = Row { line: Some(line.number), ..Row::default() };
        for property in &self.properties {
            let count = match property.list {
                None => 1,
                Some(_) => {
                    let (field, _) = next()?;
                    line.integer::<u32>(field)?
                }
            };
            for _ in 0..count {
                let (field, value) = next()?;
                if property.role == Role::Corners {
                    row.corners.push(line.integer(field)?);
                } else {
                    row.set(property.role, value);
                }
            }
        }
        match fields.next() {
            Some(field) => Err(line.defect(format!(
                "{} comes after what the header says of a row of the element {}",
                quoted(field),
                self.quoted()
            ))),
            None => Ok(row),
        }
    }

    /// A row; none if the file ends in it.
    fn binary_row(&self, bytes: &mut Bytes<'_>) -> Option<Row> {
        let mut row = Row::default();
        for property in &self.properties {
            let count = match property.list {
                None => 1,
                // A negative count is no count.
                Some(count) => Some(bytes.number(count)?).filter(|count| *count >= 0.0)? as usize,
            };
            for _ in 0..count {
                let value = bytes.number(property.item)?;
                row.set(property.role, value);
            }
        }
        Some(row)
    }
}

/// Binary numbers, one after the other.
struct Bytes<'a> {
    rest: &'a [u8],
    big_endian: bool,
}

impl Bytes<'_> {
    /// The next number; none at the end of the file.
    fn number(&mut self, kind: Type) -> Option<f64> {
        Some(match kind {
            Type::I8 => f64::from(i8::from_le_bytes(self.take()?)),
            Type::U8 => f64::from(u8::from_le_bytes(self.take()?)),
            Type::I16 => f64::from(i16::from_le_bytes(self.take()?)),
            Type::U16 => f64::from(u16::from_le_bytes(self.take()?)),
            Type::I32 => f64::from(i32::from_le_bytes(self.take()?)),
            Type::U32 => f64::from(u32::from_le_bytes(self.take()?)),
            Type::F32 => f64::from(f32::from_le_bytes(self.take()?)),
            Type::F64 => f64::from_le_bytes(self.take()?),
        })
    }

    /// The next bytes, the lowest first.
    fn take<const N: usize>(&mut self) -> Option<[u8; N]> {
        let (taken, rest) = self.rest.split_first_chunk::<N>()?;
        self.rest = rest;
        let mut taken = *taken;
        if self.big_endian {
            taken.reverse();
        }
        Some(taken)
    }
}

/// What the rows gave so far. Elements may come in any order.
#[derive(Default)]
struct Collected {
    points: Vec<Vector3<f64>>,
    faces: Vec<(Place, Vec<i64>)>,
}

impl Collected {
    fn add(&mut self, element: &Element, index: usize, row: Row) {
        let place = row.line.map_or(Place::Face(index), Place::Line);
        match element.kind {
            Kind::Vertex => self.points.push(row.point),
            // Fewer corners bound nothing.
            Kind::Face if row.corners.len() < 3 => {}
            Kind::Face => self.faces.push((place, row.corners)),
            Kind::Strips => self.faces.extend(strips(&row.corners).map(|triangle| (place, triangle.to_vec()))),
            Kind::Other => {}
        }
    }

    fn into_surface(self) -> Result<Surface, Defect> {
        let mut surface = Surface::default();
        surface.points = self.points;
        for (place, corners) in self.faces {
            let negative = |corner| place.defect(format!("{corner} is not the number of a vertex"));
            let corners = corners.into_iter().map(|corner| usize::try_from(corner).map_err(|_| negative(corner)));
            surface.add_face(place, corners.collect::<Result<Vec<_>, _>>()?);
        }
        Ok(surface)
    }
}

/// The triangles of strips: every other one is passed the other way round.
fn strips(corners: &[i64]) -> impl Iterator<Item = [i64; 3]> {
    let strips = corners.split(|corner| *corner < 0);
    strips.flat_map(|strip| {
        strip.windows(3).enumerate().map(|(index, corners)| match index % 2 {
            0 => [corners[0], corners[1], corners[2]],
            _ => [corners[1], corners[0], corners[2]],
        })
    })
}
