//! A table of numbers whose cells are coloured by their logarithms.

use std::fmt::Write;

use super::canvas::{ChartError, FONT, tidy};
use super::ink::Ink;

/// Numbers of pairs of things of the same kinds.
#[derive(Clone, Debug)]
pub struct HeatMap {
    /// Heading.
    pub title: String,
    /// Names of rows and columns.
    pub labels: Vec<String>,
    /// Row by row; none leaves a cell empty.
    pub cells: Vec<Vec<Option<f64>>>,
}

/// Width of the names, width and height of a cell, height of the heading with the names of the
/// columns, space below; pixels.
const LEFT: usize = 92;
const CELL: (usize, usize) = (72, 26);
const TOP: usize = 62;
const BOTTOM: usize = 18;

/// Colours of the least and of the largest number, red, green and blue; text is readable on all
/// between.
const LEAST: [f64; 3] = [222.0, 240.0, 233.0];
const LARGEST: [f64; 3] = [236.0, 146.0, 66.0];

impl HeatMap {
    /// The table as an SVG document.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if no cell has a positive finite number.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let numbers = || self.cells.iter().flatten().flatten().copied().filter(|v| *v > 0.0 && v.is_finite());
        let least = numbers().fold(f64::INFINITY, f64::min);
        let largest = numbers().fold(0.0, f64::max);
        if largest == 0.0 {
            return Err(ChartError::Empty);
        }
        let columns = self.labels.len();
        let (width, height) = (LEFT + columns * CELL.0 + 12, TOP + self.cells.len() * CELL.1 + BOTTOM);
        let grey = Ink::Grey.hex();
        let mut svg = format!(
            "<svg width=\"{width}\" height=\"{height}\" viewBox=\"0 0 {width} {height}\" xmlns=\"http://www.w3.org/2000/svg\">\n\
             <g font-family=\"{FONT}\" font-size=\"12\" fill=\"{grey}\">\n\
             <text x=\"{LEFT}\" y=\"20\" font-size=\"16\">{}</text>\n",
            escaped(&self.title)
        );
        for (k, label) in self.labels.iter().enumerate() {
            let x = LEFT + k * CELL.0 + CELL.0 / 2;
            // Writing to a string cannot fail.
            let _ = writeln!(svg, "<text x=\"{x}\" y=\"{}\" text-anchor=\"middle\">{}</text>", TOP - 8, escaped(label));
        }
        for (i, row) in self.cells.iter().enumerate() {
            let (top, middle) = (TOP + i * CELL.1, TOP + i * CELL.1 + CELL.1 / 2 + 4);
            let label = self.labels.get(i).map_or("", String::as_str);
            let _ =
                writeln!(svg, "<text x=\"{}\" y=\"{middle}\" text-anchor=\"end\">{}</text>", LEFT - 8, escaped(label));
            for (k, value) in row.iter().enumerate() {
                let Some(value) = value.filter(|v| *v > 0.0 && v.is_finite()) else { continue };
                let share = if largest > least { (value / least).ln() / (largest / least).ln() } else { 0.0 };
                let [red, green, blue] = [0, 1, 2].map(|c| LEAST[c] + share * (LARGEST[c] - LEAST[c]));
                let text = match value {
                    ..10.0 => format!("{value:.1}"),
                    10.0..1e6 => format!("{value:.0}"),
                    _ => tidy(value),
                };
                let x = LEFT + k * CELL.0;
                let _ = writeln!(
                    svg,
                    "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\" rx=\"3\" fill=\"#{:02x}{:02x}{:02x}\"/>\
                     <text x=\"{}\" y=\"{middle}\" text-anchor=\"middle\" fill=\"#222\">{text}</text>",
                    x + 1,
                    top + 1,
                    CELL.0 - 2,
                    CELL.1 - 2,
                    red.round() as u8,
                    green.round() as u8,
                    blue.round() as u8,
                    x + CELL.0 / 2
                );
            }
        }
        svg.push_str("</g>\n</svg>\n");
        Ok(svg)
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cells_stand_where_their_row_and_column_meet() {
        let map = HeatMap {
            title: "a < b".into(),
            labels: vec!["one".into(), "two".into()],
            cells: vec![vec![Some(1.0), Some(1e4)], vec![None, Some(100.0)]],
        };
        let svg = map.to_svg().unwrap();
        assert_eq!(svg.matches("<rect").count(), 3);
        assert!(svg.contains("a &lt; b"));
        // The least, the largest, and halfway between in the logarithm.
        for color in ["#def0e9", "#ec9242", "#e5c196"] {
            assert!(svg.contains(color), "{color}: {svg}");
        }
    }

    #[test]
    fn nothing_is_no_map() {
        let map = HeatMap { title: String::new(), labels: vec!["one".into()], cells: vec![vec![None]] };
        assert_eq!(map.to_svg(), Err(ChartError::Empty));
    }
}
