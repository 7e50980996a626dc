//! The formats with a text and a binary variant: PLY and STL.

use super::{Defect, Mesh};
use nalgebra::Vector3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufReader, Cursor};

/// A PLY element: its x, y and z if it is a vertex, its corners if it is a face.
struct Element {
    point: Vector3<f64>,
    corners: Vec<usize>,
}

impl PropertyAccess for Element {
    fn new() -> Self {
        Self { point: Vector3::repeat(f64::NAN), corners: Vec::new() }
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            "vertex_indices" | "vertex_index" => return self.set_corners(property),
            _ => return PropertyAccessResult::Ignored,
        };
        self.point[axis] = match property {
            Property::Char(v) => f64::from(v),
            Property::UChar(v) => f64::from(v),
            Property::Short(v) => f64::from(v),
            Property::UShort(v) => f64::from(v),
            Property::Int(v) => f64::from(v),
            Property::UInt(v) => f64::from(v),
            Property::Float(v) => f64::from(v),
            Property::Double(v) => v,
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

impl Element {
    fn set_corners(&mut self, property: Property) -> PropertyAccessResult {
        // A negative index is as wrong as one past the end, and told as such.
        fn indices<T: TryInto<usize>>(list: Vec<T>) -> Vec<usize> {
            list.into_iter().map(|index| index.try_into().unwrap_or(usize::MAX)).collect()
        }
        self.corners = match property {
            Property::ListChar(list) => indices(list),
            Property::ListUChar(list) => indices(list),
            Property::ListShort(list) => indices(list),
            Property::ListUShort(list) => indices(list),
            Property::ListInt(list) => indices(list),
            Property::ListUInt(list) => indices(list),
            _ => return PropertyAccessResult::UnsupportedType,
        };
        PropertyAccessResult::Set
    }
}

/// Stanford PLY, text and binary of both byte orders.
pub(super) fn ply(bytes: &[u8]) -> Result<Mesh, Defect> {
    let mut reader = Reader::new(BufReader::new(bytes));
    let parser = Parser::<Element>::new();
    let header = parser.read_header(&mut reader).map_err(|error| Defect::new("header", first_line(&error)))?;
    let mut mesh = None;
    let mut faces = Vec::new();
    for (name, element) in &header.elements {
        let place = format!("element {name:?}");
        // Every element takes at least a byte: a count beyond the file's size is a lie not worth looping for.
        if element.count > bytes.len() || (element.properties.is_empty() && element.count > 0) {
            return Err(Defect::new(place, format!("{} of them do not fit in the file", element.count)));
        }
        if name == "vertex" && !["x", "y", "z"].iter().all(|&axis| element.properties.contains_key(axis)) {
            return Err(Defect::new(place, "the properties x, y and z are needed"));
        }
        let values = parser
            .read_payload_for_element(&mut reader, element, &header)
            .map_err(|error| Defect::new(place, first_line(&error)))?;
        match name.as_str() {
            "vertex" => {
                let points = values.into_iter().map(|vertex| vertex.point).collect();
                mesh = Some(Mesh { points, ..Mesh::default() });
            }
            "face" => faces = values,
            _ => {}
        }
    }
    let mut mesh = mesh.ok_or_else(|| Defect::new("header", "there is no element \"vertex\""))?;
    for face in faces {
        mesh.add_face(&face.corners);
    }
    Ok(mesh)
}

/// Stereolithography, text or binary; corners that several triangles have are one vertex.
pub(super) fn stl(bytes: &[u8]) -> Result<Mesh, Defect> {
    const HEADER: usize = 84;
    const TRIANGLE: usize = 50;
    let mut bytes = bytes.to_vec();
    let binary_size = bytes.get(80..HEADER).map(|count| {
        let count = count.iter().rev().fold(0_usize, |count, &byte| count << 8 | usize::from(byte));
        HEADER + TRIANGLE * count
    });
    if binary_size == Some(bytes.len()) {
        // Some programs start the free header of binary files with the keyword of the text variant.
        bytes[..80].fill(0);
    } else if !bytes.starts_with(b"solid") {
        return Err(match binary_size {
            None => Defect::new("header", format!("{} bytes are too few for an STL file", bytes.len())),
            Some(size) => {
                Defect::new("triangle count", format!("it asks for {size} bytes, the file has {}", bytes.len()))
            }
        });
    } else {
        // The reader takes only a keyword followed by a blank, which nameless solids do not have.
        let end = bytes.iter().position(|&b| b == b'\n').unwrap_or(bytes.len());
        bytes.splice(..end, *b"solid ");
    }
    let mesh =
        stl_io::read_stl(&mut Cursor::new(bytes)).map_err(|error| Defect::new("triangles", first_line(&error)))?;
    let points = mesh.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).map(f64::from)).collect();
    Ok(Mesh { points, triangles: mesh.faces.iter().map(|face| face.vertices).collect() })
}

/// Parsers add the offending text on further lines; an error of ours is one line.
fn first_line(error: &impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
