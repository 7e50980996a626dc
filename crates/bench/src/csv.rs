//! The committed CSV files of the figures, read back: what is drawn and printed of them comes from
//! there.

use std::str::FromStr;

/// Why a CSV is none of ours.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("line {line} of the CSV: {what}; give the file that an earlier run of the same figure wrote")]
pub struct CsvError {
    line: usize,
    what: String,
}

/// A table with a head.
pub(crate) struct Table {
    heads: Vec<String>,
    rows: Vec<(usize, Vec<String>)>,
}

/// A line of it.
#[derive(Clone, Copy)]
pub(crate) struct Row<'a> {
    heads: &'a [String],
    line: usize,
    cells: &'a [String],
}

impl Table {
    /// Reads a table whose first line, but for comments that begin with `#`, names the columns.
    pub(crate) fn read(text: &str) -> Result<Self, CsvError> {
        let mut lines = text.lines().zip(1..).filter(|(line, _)| !line.is_empty() && !line.starts_with('#'));
        let (head, _) = lines.next().ok_or(CsvError { line: 1, what: "there is no head".into() })?;
        let heads = cells(head);
        let mut rows = Vec::new();
        for (text, line) in lines {
            let cells = cells(text);
            if cells.len() != heads.len() {
                let what = format!("{} cells where the head has {}", cells.len(), heads.len());
                return Err(CsvError { line, what });
            }
            rows.push((line, cells));
        }
        Ok(Self { heads, rows })
    }

    /// The first row.
    pub(crate) fn first(&self) -> Result<Row<'_>, CsvError> {
        self.rows().next().ok_or_else(|| CsvError { line: 2, what: "there is no row".into() })
    }

    pub(crate) fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        self.rows.iter().map(|(line, cells)| Row { heads: &self.heads, line: *line, cells })
    }
}

impl<'a> Row<'a> {
    pub(crate) fn error(&self, what: impl Into<String>) -> CsvError {
        CsvError { line: self.line, what: what.into() }
    }

    /// The cell of a column.
    pub(crate) fn text(&self, column: &str) -> Result<&'a str, CsvError> {
        let index = self.heads.iter().position(|head| head == column);
        let cell = index.and_then(|index| self.cells.get(index));
        cell.map(String::as_str).ok_or_else(|| self.error(format!("no column {column}")))
    }

    /// What the cell reads as.
    pub(crate) fn get<T: FromStr>(&self, column: &str) -> Result<T, CsvError> {
        let text = self.text(column)?;
        text.parse().map_err(|_| self.error(format!("{column} is '{text}'")))
    }

    /// The same; none of an empty cell.
    pub(crate) fn maybe<T: FromStr>(&self, column: &str) -> Result<Option<T>, CsvError> {
        if self.text(column)?.is_empty() { Ok(None) } else { self.get(column).map(Some) }
    }

    /// A number; NaN of an empty cell.
    pub(crate) fn number(&self, column: &str) -> Result<f64, CsvError> {
        Ok(self.maybe(column)?.unwrap_or(f64::NAN))
    }
}

/// Decimal digits of what is measured and drawn.
pub(crate) const MEASURED: usize = 4;

/// `value` rounded to that many decimal digits, so that a file holds no more than was measured.
pub(crate) fn significant(value: f64, digits: usize) -> f64 {
    let rounded = format!("{value:.*e}", digits.saturating_sub(1));
    rounded.parse().expect("what is printed of a number reads back as one")
}

/// `value` rounded down to that many decimal digits: of a proven lower bound one that holds.
pub(crate) fn rounded_down(value: f64, digits: usize) -> f64 {
    let nearest = significant(value, digits);
    if !(nearest > value) {
        return nearest;
    }
    let last_digit = 10_f64.powf(value.abs().log10().floor() + 1.0 - digits as f64);
    significant(nearest - last_digit, digits)
}

/// `value` rounded up to that many decimal digits: of a proven upper bound one that holds.
pub(crate) fn rounded_up(value: f64, digits: usize) -> f64 {
    -rounded_down(-value, digits)
}

/// The cells of a line; those between quotes may contain commas.
fn cells(line: &str) -> Vec<String> {
    let mut cells = vec![String::new()];
    let mut quoted = false;
    for letter in line.chars() {
        match letter {
            '"' => quoted = !quoted,
            ',' if !quoted => cells.push(String::new()),
            _ => {
                if let Some(cell) = cells.last_mut() {
                    cell.push(letter);
                }
            }
        }
    }
    cells
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_are_found_by_the_name_of_their_column() {
        let table = Table::read("# a comment\nwho,ns,count\n\"degree 6, refined\",2.5e2,7\nhull,,0\n").unwrap();
        let rows: Vec<Row<'_>> = table.rows().collect();
        assert_eq!(rows.len(), 2);
        assert_eq!(rows[0].text("who"), Ok("degree 6, refined"));
        assert_eq!(rows[0].number("ns"), Ok(250.0));
        assert_eq!(rows[0].get::<usize>("count"), Ok(7));
        assert!(rows[1].number("ns").unwrap().is_nan());
        assert_eq!(rows[1].maybe::<f64>("ns"), Ok(None));
    }

    #[test]
    fn numbers_are_rounded_to_digits() {
        assert_eq!(significant(0.012345678, 4), 0.01235);
        assert_eq!(significant(-2.0 / 3.0, 13), -0.6666666666667);
        assert_eq!(significant(0.0, 4), 0.0);
        assert_eq!(significant(f64::INFINITY, 4), f64::INFINITY);
        assert!(significant(f64::NAN, 4).is_nan());
        assert_eq!([rounded_down(0.12346, 4), rounded_up(0.12344, 4)], [0.1234, 0.1235]);
        assert_eq!([rounded_down(-0.12344, 4), rounded_up(-0.12346, 4)], [-0.1235, -0.1234]);
        assert_eq!([rounded_down(0.5, 4), rounded_up(0.5, 4)], [0.5, 0.5]);
        assert_eq!([rounded_down(0.0, 4), rounded_up(f64::INFINITY, 4)], [0.0, f64::INFINITY]);
        for k in 1..2000 {
            let value = 1.0 / f64::from(k);
            let [low, high] = [rounded_down(value, 13), rounded_up(value, 13)];
            assert!(low <= value && value <= high && high - low < 2e-13, "{value}: {low} {high}");
        }
    }

    #[test]
    fn errors_name_the_line() {
        let error = |text: &str| Table::read(text).err().map(|error| error.to_string());
        assert!(error("").unwrap().starts_with("line 1 of the CSV: there is no head"));
        assert!(Table::read("a,b\n").unwrap().first().is_err());
        assert!(error("a,b\n1,2\n\n3\n").unwrap().starts_with("line 4 of the CSV: 1 cells"));
        let table = Table::read("a,b\n1,x\n").unwrap();
        let row = table.rows().next().unwrap();
        assert!(row.get::<f64>("b").unwrap_err().to_string().contains("line 2 of the CSV: b is 'x'"));
        assert!(row.text("c").unwrap_err().to_string().contains("no column c"));
    }
}
