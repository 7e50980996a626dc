//! Line charts with a logarithmic vertical axis.

use super::canvas::{ChartError, FINE, FONT, LEFT, color, px, svg, tidy};
use super::ink::Ink;
use plotters::coord::combinators::IntoLogRange;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// One curve.
#[derive(Clone, Debug)]
pub struct Series {
    /// Name in the legend.
    pub label: String,
    /// Colour of the line.
    pub ink: Ink,
    /// Dashed instead of solid, so that two curves differ by more than their colour.
    pub dashed: bool,
    /// Points in drawing order. A value at or below zero is drawn on the lower edge.
    pub points: Vec<(f64, f64)>,
}

/// A horizontal line with a name.
#[derive(Clone, Debug)]
pub struct Mark {
    /// Height of the line.
    pub value: f64,
    /// Text at one of its ends.
    pub label: String,
}

/// Curves over a common axis; the vertical axis is logarithmic.
#[derive(Clone, Debug)]
pub struct LineChart {
    /// Heading.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x_label: String,
    /// Name and unit of the vertical axis.
    pub y_label: String,
    /// The curves.
    pub series: Vec<Series>,
    /// A marked height.
    pub mark: Mark,
}

/// Width and height, pixels.
const SIZE: (u32, u32) = (760, 440);
/// Decades below the mark at which a curve is cut off: nothing can be distinguished there.
const DECADES_BELOW: i32 = 3;
/// Width of a letter, pixels: a guess, as the reader's font is not known here.
const LETTER: i32 = 8;

impl LineChart {
    /// The chart as an SVG document.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if there is nothing to draw.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let frame = self.frame().ok_or(ChartError::Empty)?;
        svg(SIZE, |root| self.draw(root, &frame))
    }

    /// Ranges that contain all finite points and the mark, the vertical one in whole decades.
    fn frame(&self) -> Option<Frame> {
        let finite = || self.series.iter().flat_map(|s| &s.points).filter(|(x, y)| x.is_finite() && y.is_finite());
        finite().next()?;
        let heights = || finite().map(|(_, y)| *y).filter(|y| *y > 0.0).chain([self.mark.value]);
        let cut = self.mark.value * 10f64.powi(-DECADES_BELOW);
        let low = heights().fold(f64::INFINITY, f64::min).max(cut).log10().floor();
        let high = heights().fold(0.0, f64::max).log10().ceil();
        let left = finite().map(|(x, _)| *x).fold(f64::INFINITY, f64::min);
        let right = finite().map(|(x, _)| *x).fold(f64::NEG_INFINITY, f64::max);
        let pad = if right > left { 0.0 } else { 1.0 };
        // A little more than a decade above a curve that ends on one.
        Some(Frame { x: (left - pad, right + pad), y: (10f64.powf(low), 10f64.powf(high.max(low + 1.0)) * 1.05) })
    }

    fn draw(
        &self,
        root: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
        frame: &Frame,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let grey = color(Ink::Grey);
        let text = |size: i32| (FONT, px(size)).into_font().color(&grey);
        root.draw(&Text::new(self.title.as_str(), (px(LEFT), px(10)), text(17)))?;
        self.draw_legend(root)?;

        let (_, body) = root.split_vertically(px(58));
        let mut chart = ChartBuilder::on(&body)
            .margin_left(px(14))
            .margin_right(px(24))
            .margin_bottom(px(6))
            .x_label_area_size(px(46))
            .y_label_area_size(px(66))
            .build_cartesian_2d(frame.x.0..frame.x.1, (frame.y.0..frame.y.1).log_scale())?;
        chart
            .configure_mesh()
            .bold_line_style(grey.mix(0.25).stroke_width(FINE))
            .light_line_style(TRANSPARENT)
            .axis_style(grey.stroke_width(FINE))
            .set_all_tick_mark_size(px(5))
            .x_labels(9)
            .x_label_formatter(&|x| tidy(*x))
            .y_label_formatter(&|y| tidy(*y))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .label_style(text(13))
            .axis_desc_style(text(14))
            .draw()?;

        let mark = self.mark.value;
        chart.draw_series(LineSeries::new([(frame.x.0, mark), (frame.x.1, mark)], grey.stroke_width(2 * FINE)))?;
        let to_pixels = |(x, y): (f64, f64)| chart.backend_coord(&(x, y.max(frame.y.0)));
        let ends = [frame.x.1, frame.x.0].map(|x| to_pixels((x, mark)));
        let (corner, pos) = self.place_of_mark(ends, to_pixels);
        root.draw(&Text::new(self.mark.label.as_str(), corner, text(13).pos(pos)))?;

        for series in &self.series {
            let points = series.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
            let points: Vec<(f64, f64)> = points.map(|(x, y)| (*x, y.max(frame.y.0))).collect();
            let style = color(series.ink).stroke_width(3 * FINE);
            if series.dashed {
                chart.draw_series(DashedLineSeries::new(points, 9 * FINE, 6 * FINE, style))?;
            } else {
                chart.draw_series(LineSeries::new(points, style))?;
            }
        }
        Ok(())
    }

    /// Corner and anchor of the mark's text: at one of the line's ends, right and left, above or
    /// below it, where no curve runs through the text if there is such a place.
    fn place_of_mark(&self, ends: [(i32, i32); 2], to_pixels: impl Fn((f64, f64)) -> (i32, i32)) -> ((i32, i32), Pos) {
        let (width, height) = (px(LETTER * self.mark.label.chars().count() as i32), px(15));
        let mut curves = Vec::new();
        for series in &self.series {
            let points: Vec<_> = series.points.iter().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
            let pixels: Vec<_> = points.into_iter().map(|point| to_pixels(*point)).collect();
            curves.extend(pixels.windows(2).flat_map(|pair| between(pair[0], pair[1])));
        }
        let places = [(0, VPos::Bottom), (0, VPos::Top), (1, VPos::Bottom), (1, VPos::Top)].map(|(end, vertical)| {
            let (inwards, horizontal) = if end == 0 { (-1, HPos::Right) } else { (1, HPos::Left) };
            let up = if matches!(vertical, VPos::Bottom) { -1 } else { 1 };
            let corner = (ends[end].0 + inwards * px(4), ends[end].1 + up * px(4));
            let far = (corner.0 + inwards * width, corner.1 + up * height);
            (corner, far, Pos::new(horizontal, vertical))
        });
        let within = |value: i32, a: i32, b: i32| (a.min(b)..=a.max(b)).contains(&value);
        let clear = |corner: (i32, i32), far: (i32, i32)| {
            !curves.iter().any(|(x, y)| within(*x, corner.0, far.0) && within(*y, corner.1, far.1))
        };
        let [(first, _, above), ..] = places;
        places
            .into_iter()
            .find(|(corner, far, _)| clear(*corner, *far))
            .map_or((first, above), |(corner, _, pos)| (corner, pos))
    }

    /// Names of the curves in a row between heading and axes, where no curve can run behind them.
    fn draw_legend(
        &self,
        root: &DrawingArea<SVGBackend<'_>, plotters::coord::Shift>,
    ) -> Result<(), Box<dyn std::error::Error>> {
        let mut left = LEFT;
        for series in &self.series {
            let style = color(series.ink).stroke_width(3 * FINE);
            let ends = [(px(left), px(45)), (px(left + 34), px(45))];
            if series.dashed {
                let dashes = [(0, 9), (13, 22), (26, 34)];
                for (from, to) in dashes {
                    root.draw(&PathElement::new([(px(left + from), px(45)), (px(left + to), px(45))], style))?;
                }
            } else {
                root.draw(&PathElement::new(ends, style))?;
            }
            let text = (FONT, px(14)).into_font().color(&color(Ink::Grey)).pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(series.label.as_str(), (px(left + 42), px(45)), text))?;
            left += 70 + LETTER * series.label.chars().count() as i32;
        }
        Ok(())
    }
}

/// Pixels on the way from one point to another, no farther than a pixel apart or so.
fn between(a: (i32, i32), b: (i32, i32)) -> impl Iterator<Item = (i32, i32)> {
    let steps = (b.0 - a.0).abs().max((b.1 - a.1).abs()).max(1);
    (0..=steps).map(move |i| (a.0 + (b.0 - a.0) * i / steps, a.1 + (b.1 - a.1) * i / steps))
}

struct Frame {
    x: (f64, f64),
    y: (f64, f64),
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(f64, f64)>) -> LineChart {
        LineChart {
            title: "Title".into(),
            x_label: "position (m)".into(),
            y_label: "level distance".into(),
            series: vec![Series { label: "first".into(), ink: Ink::Blue, dashed: true, points }],
            mark: Mark { value: 1.0, label: "touching".into() },
        }
    }

    #[test]
    fn a_chart_names_its_axes_and_curves() {
        let svg = chart((0..50).map(|i| (f64::from(i) / 50.0, 0.2 + f64::from(i))).collect()).to_svg().unwrap();
        for text in ["Title", "position (m)", "level distance", "first", "touching"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn odd_values_are_drawn_or_refused() {
        assert_eq!(chart(vec![(f64::NAN, 1.0)]).to_svg(), Err(ChartError::Empty));
        assert!(chart(vec![(0.0, 1.0)]).to_svg().is_ok());
        assert!(chart(vec![(0.0, -2.0), (1.0, 0.0), (2.0, f64::INFINITY), (3.0, 1e300)]).to_svg().is_ok());
    }

    #[test]
    fn the_name_of_the_mark_gets_out_of_the_way() {
        let chart = |heights: [f64; 2]| {
            let points = |height: f64| vec![(0.0, height), (1.0, height)];
            let series = |height| Series { label: "s".into(), ink: Ink::Blue, dashed: false, points: points(height) };
            LineChart {
                title: "t".into(),
                x_label: "x".into(),
                y_label: "y".into(),
                series: heights.map(series).into(),
                mark: Mark { value: 1.0, label: "a name".into() },
            }
        };
        let ends = [(px(500), px(100)), (0, px(100))];
        // Ten pixels for a unit of height.
        let to_pixels = |(x, y): (f64, f64)| (px((500.0 * x) as i32), px(110 - (10.0 * y) as i32));
        let below = |heights: [f64; 2]| chart(heights).place_of_mark(ends, to_pixels).0.1 > px(100);
        assert!(!below([9.0, 8.0]), "above the line where that is free");
        assert!(below([2.0, 8.0]), "below it where a curve is right above");
        assert!(!below([2.0, 0.0]), "above where both are taken");
    }
}
