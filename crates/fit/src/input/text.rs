//! Lines, fields and numbers of text formats, on bytes: comments and names need not be UTF-8.

use super::Defect;

/// Longest part of a field that an error quotes, bytes.
const MAX_QUOTED_BYTES: usize = 40;

/// A line of a text file.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line<'a> {
    /// Counted from 1.
    pub(super) number: usize,
    /// Without its end.
    pub(super) text: &'a [u8],
}

/// The lines of a file, which end with LF, CR LF or CR, without the byte-order mark that some
/// editors put in front.
///
/// # Errors
/// UTF-16 text, which no mesh format is made of.
pub(super) fn lines(bytes: &[u8]) -> Result<impl Iterator<Item = Line<'_>>, Defect> {
    let mut rest = Some(without_mark(bytes)?);
    let mut number = 0;
    Ok(std::iter::from_fn(move || {
        let bytes = rest?;
        number += 1;
        let Some(end) = bytes.iter().position(|byte| matches!(byte, b'\n' | b'\r')) else {
            rest = None;
            return Some(Line { number, text: bytes });
        };
        let next = end + if bytes[end..].starts_with(b"\r\n") { 2 } else { 1 };
        rest = Some(&bytes[next..]);
        Some(Line { number, text: &bytes[..end] })
    }))
}

/// What follows a byte-order mark, or everything.
pub(super) fn without_mark(bytes: &[u8]) -> Result<&[u8], Defect> {
    if bytes.starts_with(b"\xff\xfe") || bytes.starts_with(b"\xfe\xff") {
        return Err(Defect::new("first bytes", "this is UTF-16 text").remedy("save it as UTF-8 text"));
    }
    Ok(bytes.strip_prefix(b"\xef\xbb\xbf").unwrap_or(bytes))
}

impl<'a> Line<'a> {
    /// The line up to a mark that begins a comment: first in the line or behind a blank, as 1.#INF
    /// is a number.
    pub(super) fn without_comment(self, mark: &[u8]) -> Self {
        let begins = |at: &usize| self.text[*at..].starts_with(mark) && (*at == 0 || is_blank(self.text[at - 1]));
        let end = (0..self.text.len()).find(begins).unwrap_or(self.text.len());
        Self { text: &self.text[..end], ..self }
    }

    /// What stands between blanks.
    pub(super) fn fields(self) -> impl Iterator<Item = &'a [u8]> + Clone {
        self.text.split(|byte| is_blank(*byte)).filter(|field| !field.is_empty())
    }

    /// Whether it contains nothing but blanks.
    pub(super) fn is_blank(self) -> bool {
        self.text.iter().all(|byte| is_blank(*byte))
    }

    /// A defect in this line.
    pub(super) fn defect(self, reason: impl Into<String>) -> Defect {
        Defect::line(self.number, reason)
    }

    /// A number of this line.
    ///
    /// # Errors
    /// A field that is no number.
    pub(super) fn number(self, field: &[u8]) -> Result<f64, Defect> {
        number(field).map_err(|reason| self.defect(reason.text).remedy(reason.remedy))
    }

    /// Coordinates that a line holds first.
    ///
    /// # Errors
    /// Fewer than three fields, or one that is no number.
    pub(super) fn coordinates(self, mut fields: impl Iterator<Item = &'a [u8]>) -> Result<[f64; 3], Defect> {
        let mut point = [0.0; 3];
        for (axis, value) in point.iter_mut().enumerate() {
            let missing = || self.defect(format!("{axis} coordinates where 3 are needed"));
            *value = self.number(fields.next().ok_or_else(missing)?)?;
        }
        Ok(point)
    }

    /// An integer of this line.
    ///
    /// # Errors
    /// A field that is none, or out of range.
    pub(super) fn integer<T: std::str::FromStr>(self, field: &[u8]) -> Result<T, Defect> {
        integer(field).ok_or_else(|| self.defect(format!("{} is not the number of a vertex", quoted(field))))
    }
}

/// Whether a byte separates fields.
pub(super) fn is_blank(byte: u8) -> bool {
    matches!(byte, b' ' | b'\t' | b'\x0b' | b'\x0c' | b'\r' | b'\n')
}

/// Why a field is no number.
pub(super) struct NoNumber {
    pub(super) text: String,
    pub(super) remedy: &'static str,
}

/// The number that a field spells, in double precision. Whatever C libraries print for values that
/// are not a number is NaN here, for the caller to refuse or to leave out.
///
/// # Errors
/// The field, and the remedy where a decimal comma is the likely reason.
pub(super) fn number(field: &[u8]) -> Result<f64, NoNumber> {
    let text = str::from_utf8(field).ok();
    if let Some(value) = text.and_then(|text| text.parse().ok()) {
        return Ok(value);
    }
    let lower = field.to_ascii_lowercase();
    let unsigned = lower.strip_prefix(b"-").or_else(|| lower.strip_prefix(b"+")).unwrap_or(&lower);
    // glibc prints nan and nan(0x1), older Windows runtimes 1.#QNAN, 1.#IND and 1.#INF.
    let spelled = unsigned == b"nan" || unsigned.starts_with(b"nan(") && unsigned.ends_with(b")");
    if spelled || [&b"1.#qnan"[..], b"1.#snan", b"1.#nan", b"1.#ind", b"1.#inf"].iter().any(|s| unsigned.starts_with(s))
    {
        return Ok(f64::NAN);
    }
    let comma = text.is_some_and(|text| text.replacen(',', ".", 1).parse::<f64>().is_ok());
    let remedy = if comma { DECIMAL_COMMA } else { Defect::DAMAGED };
    Err(NoNumber { text: format!("{} is not a number", quoted(field)), remedy })
}

/// The remedy for decimal commas.
pub(super) const DECIMAL_COMMA: &str = "write decimal points in place of decimal commas";

/// The integer that a field spells.
pub(super) fn integer<T: std::str::FromStr>(field: &[u8]) -> Option<T> {
    str::from_utf8(field).ok()?.parse().ok()
}

/// The beginning of a message that may quote the content of a file, in one line.
pub(super) fn shortened(text: &str) -> String {
    const MAX_MESSAGE_CHARS: usize = 120;
    let shown: String = text.chars().take(MAX_MESSAGE_CHARS).flat_map(char::escape_debug).collect();
    if text.chars().nth(MAX_MESSAGE_CHARS).is_some() { shown + "..." } else { shown }
}

/// A field as an error shows it.
pub(super) fn quoted(field: &[u8]) -> String {
    let shown = String::from_utf8_lossy(&field[..field.len().min(MAX_QUOTED_BYTES)]);
    if field.len() > MAX_QUOTED_BYTES { format!("{shown:?}...") } else { format!("{shown:?}") }
}
