//! The formats with a text and a binary variant: PLY and STL.

use super::Defect;
use nalgebra::Vector3;
use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Property, PropertyAccess, PropertyAccessResult};
use std::io::{BufReader, Cursor};

type Points = Result<Vec<Vector3<f64>>, Defect>;

/// A PLY element: its x, y and z if it has them.
struct Vertex(Vector3<f64>);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self(Vector3::repeat(f64::NAN))
    }

    fn set_property(&mut self, name: &str, property: Property) -> PropertyAccessResult {
        let axis = match name {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = match property {
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

/// Stanford PLY, text and binary of both byte orders.
pub(super) fn ply(bytes: &[u8]) -> Points {
    let mut reader = Reader::new(BufReader::new(bytes));
    let parser = Parser::<Vertex>::new();
    let header = parser.read_header(&mut reader).map_err(|error| Defect::new("header", first_line(&error)))?;
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
        if name == "vertex" {
            return Ok(values.into_iter().map(|vertex| vertex.0).collect());
        }
    }
    Err(Defect::new("header", "there is no element \"vertex\""))
}

/// Stereolithography, text or binary; each triangle's corners, repeated corners once.
pub(super) fn stl(bytes: &[u8]) -> Points {
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
    Ok(mesh.vertices.iter().map(|v| Vector3::new(v[0], v[1], v[2]).map(f64::from)).collect())
}

/// Parsers add the offending text on further lines; an error of ours is one line.
fn first_line(error: &impl std::fmt::Display) -> String {
    error.to_string().split_whitespace().collect::<Vec<_>>().join(" ")
}
