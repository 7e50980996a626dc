//! What all plots have in common: a fine canvas, inks, tick labels.

use super::compact::compact;
use super::ink::Ink;
use plotters::coord::Shift;
use plotters::prelude::*;

/// Why a chart could not be drawn.
#[derive(Debug, thiserror::Error, PartialEq)]
pub enum ChartError {
    /// No series has a finite point.
    #[error("a chart needs at least one finite point; none of its series has any")]
    Empty,
    /// The drawing library gave up.
    #[error("the chart cannot be drawn: {0}")]
    Drawing(String),
}

/// The backend rounds to whole units: drawing this many to a pixel keeps curves smooth.
pub(super) const FINE: u32 = 10;
/// Left end of the axes, pixels.
pub(super) const LEFT: i32 = 80;
pub(super) const FONT: &str = "sans-serif";

/// The SVG document of `width x height` pixels that `draw` fills, in the units of [`px`].
pub(super) fn svg(
    (width, height): (u32, u32),
    draw: impl FnOnce(&DrawingArea<SVGBackend<'_>, Shift>) -> Result<(), Box<dyn std::error::Error>>,
) -> Result<String, ChartError> {
    let failed = |error: &dyn std::fmt::Display| ChartError::Drawing(error.to_string());
    let mut svg = String::new();
    {
        let root = SVGBackend::with_string(&mut svg, (width * FINE, height * FINE)).into_drawing_area();
        draw(&root).map_err(|error| failed(&error))?;
        root.present().map_err(|error| failed(&error))?;
    }
    // Drawn fine, shown at its size: the view box keeps the fine units.
    let fine = format!("width=\"{}\" height=\"{}\"", width * FINE, height * FINE);
    Ok(compact(&svg.replacen(&fine, &format!("width=\"{width}\" height=\"{height}\""), 1)))
}

/// Pixels in the units of the drawing.
pub(super) fn px(pixels: i32) -> i32 {
    pixels * FINE as i32
}

pub(super) fn color(ink: Ink) -> RGBColor {
    let (red, green, blue) = ink.rgb();
    RGBColor(red, green, blue)
}

/// A tick label without trailing zeros and without the noise of binary fractions.
pub(super) fn tidy(value: f64) -> String {
    let text = if value != 0.0 && (value.abs() >= 1e4 || value.abs() < 1e-3) {
        return format!("{value:.0e}");
    } else {
        format!("{value:.4}")
    };
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0".into() } else { text.into() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tick_labels_are_short() {
        for (value, text) in
            [(0.0, "0"), (-1e-17, "-1e-17"), (0.1, "0.1"), (100.0, "100"), (-1.5, "-1.5"), (1e6, "1e6")]
        {
            assert_eq!(tidy(value), text);
        }
    }
}
