//! Stereolithography, text or binary. Corners that several triangles have are one vertex; normals
//! are not read, as the order of the corners gives the same.
//!
//! Text holds one solid after the other, each from `solid` to `endsolid`, keywords in any case,
//! with blanks and line ends anywhere but in names. Its numbers are read in double precision; those
//! of binary files have single precision.

use super::Defect;
use super::surface::{Place, Surface};
use super::text::{Line, is_blank, lines, number, quoted, without_mark};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Bytes before the triangles of a binary file: a free text, and the count of the triangles.
const HEADER: usize = 84;

/// Bytes of a triangle: normal, three corners, an attribute.
const TRIANGLE: usize = 50;

/// Reads a file.
pub(super) fn read(bytes: &[u8]) -> Result<Surface, Defect> {
    let count = bytes.get(80..HEADER).and_then(|count| count.try_into().ok()).map(u32::from_le_bytes);
    let size = count.and_then(|count| usize::try_from(count).ok()?.checked_mul(TRIANGLE)?.checked_add(HEADER));
    // Some programs start the free text of binary files with the keyword of the text variant.
    if size == Some(bytes.len()) {
        return Ok(binary(&bytes[HEADER..]));
    }
    let text = without_mark(bytes)?.trim_ascii_start();
    let is_text = text.get(..5).is_some_and(|word| word.eq_ignore_ascii_case(b"solid")) && !bytes.contains(&0);
    if is_text {
        return solids(bytes);
    }
    Err(match count {
        None => Defect::new("header", format!("{} bytes are too few for an STL file", bytes.len())),
        Some(count) => Defect::new(
            "triangle count",
            format!(
                "this is no text, which begins with \"solid\", and as a binary file of {count} triangles it would have \
                 {} bytes, not {}",
                HEADER as u64 + TRIANGLE as u64 * u64::from(count),
                bytes.len()
            ),
        ),
    })
}

fn binary(triangles: &[u8]) -> Surface {
    let mut corners = Corners::default();
    for (index, triangle) in triangles.chunks_exact(TRIANGLE).enumerate() {
        let value = |at: usize| {
            let bytes = [0, 1, 2, 3].map(|byte| triangle[at + byte]);
            f64::from(f32::from_le_bytes(bytes))
        };
        let face = [12, 24, 36].map(|at| corners.add(Vector3::new(value(at), value(at + 4), value(at + 8))));
        corners.surface.add_face(Place::Face(index), face);
    }
    corners.surface
}

/// The corners met so far.
#[derive(Default)]
struct Corners {
    surface: Surface,
    known: HashMap<[u64; 3], usize>,
}

impl Corners {
    /// The vertex at this place.
    fn add(&mut self, x: Vector3<f64>) -> usize {
        let points = &mut self.surface.points;
        // + 0.0 makes the two zeros one key.
        let key = [x.x, x.y, x.z].map(|value| (value + 0.0).to_bits());
        *self.known.entry(key).or_insert_with(|| {
            points.push(x);
            points.len() - 1
        })
    }
}

/// All solids of a text file.
fn solids(bytes: &[u8]) -> Result<Surface, Defect> {
    let mut words = Words { lines: lines(bytes)?, line: Line { number: 1, text: &[] } };
    let mut corners = Corners::default();
    while let Some(first) = words.next() {
        words.expect(first, "solid")?;
        words.pass_name()?;
        loop {
            let word = words.needed("facet or endsolid")?;
            if word.eq_ignore_ascii_case(b"endsolid") {
                words.pass_name()?;
                break;
            }
            words.expect(word, "facet")?;
            facet(&mut words, &mut corners)?;
        }
    }
    Ok(corners.surface)
}

/// What follows the keyword of a facet.
fn facet<'a>(words: &mut Words<'a, impl Iterator<Item = Line<'a>>>, corners: &mut Corners) -> Result<(), Defect> {
    let place = Place::Line(words.line.number);
    // The normal, however it is spelled: programs write what no parser of numbers takes.
    let mut word = words.needed("normal or outer loop")?;
    if word.eq_ignore_ascii_case(b"normal") {
        word = words.needed("a normal")?;
        for _ in 0..3 {
            if word.eq_ignore_ascii_case(b"outer") {
                break;
            }
            word = words.needed("outer loop")?;
        }
    }
    words.expect(word, "outer")?;
    words.expect_next("loop")?;
    let mut face = [0; 3];
    for corner in &mut face {
        words.expect_next("vertex")?;
        let mut x = Vector3::zeros();
        for axis in 0..3 {
            let word = words.needed("three coordinates")?;
            x[axis] = number(word).map_err(|reason| words.line.defect(reason.text).remedy(reason.remedy))?;
        }
        *corner = corners.add(x);
    }
    words.expect_next("endloop")?;
    words.expect_next("endfacet")?;
    corners.surface.add_face(place, face);
    Ok(())
}

/// The words of a file, one after the other.
struct Words<'a, L> {
    lines: L,
    /// What is left of the line of the last word.
    line: Line<'a>,
}

impl<'a, L: Iterator<Item = Line<'a>>> Words<'a, L> {
    fn next(&mut self) -> Option<&'a [u8]> {
        loop {
            let text = self.line.text.trim_ascii_start();
            if !text.is_empty() {
                let end = text.iter().position(|byte| is_blank(*byte)).unwrap_or(text.len());
                let (word, rest) = text.split_at(end);
                self.line.text = rest;
                return Some(word);
            }
            self.line = self.lines.next()?;
        }
    }

    /// Passes over the name of a solid, the rest of the line.
    fn pass_name(&mut self) -> Result<(), Defect> {
        let words: Vec<&[u8]> = self.line.fields().collect();
        let begins = |pair: &[&[u8]]| {
            let follows = [&b"normal"[..], b"outer"].iter().any(|word| pair[1].eq_ignore_ascii_case(word));
            pair[0].eq_ignore_ascii_case(b"facet") && follows
        };
        if words.windows(2).any(begins) {
            let reason = "a facet begins in the line of the name of a solid, which the format ends with the line";
            return Err(self.line.defect(reason).remedy("put a line end behind each name"));
        }
        self.line.text = &[];
        Ok(())
    }

    /// The next word, of which the file is in need.
    fn needed(&mut self, what: &str) -> Result<&'a [u8], Defect> {
        self.next().ok_or_else(|| {
            let reason = format!("the file ends where {what} is expected: a solid has no endsolid");
            Defect::new(format!("end of file (line {})", self.line.number), reason)
        })
    }

    fn expect(&self, word: &[u8], keyword: &str) -> Result<(), Defect> {
        if word.eq_ignore_ascii_case(keyword.as_bytes()) {
            return Ok(());
        }
        Err(self.line.defect(format!("{} where {keyword:?} is expected", quoted(word))))
    }

    fn expect_next(&mut self, keyword: &str) -> Result<(), Defect> {
        let word = self.needed(keyword)?;
        self.expect(word, keyword)
    }
}
