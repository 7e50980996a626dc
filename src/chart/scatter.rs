//! Points on two logarithmic axes, each with a word beside it.

use super::Ink;
use super::canvas::{ChartError, FINE, FONT, LEFT, color, px, svg, tidy};
use plotters::coord::Shift;
use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// One measured thing.
#[derive(Clone, Debug)]
pub struct Point {
    /// Horizontal coordinate, positive.
    pub x: f64,
    /// Vertical coordinate, positive.
    pub y: f64,
    /// Written to the right of it.
    pub label: String,
}

/// How a point looks: told apart without colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Marker {
    /// A filled circle.
    Disc,
    /// An empty circle.
    Ring,
    /// A filled triangle.
    Triangle,
    /// Two strokes.
    Cross,
}

/// Points of one kind, joined in their order by a thin line.
#[derive(Clone, Debug)]
pub struct Group {
    /// Name in the legend.
    pub label: String,
    /// Colour.
    pub ink: Ink,
    /// Shape of its points.
    pub marker: Marker,
    /// The points.
    pub points: Vec<Point>,
}

/// A chart of points.
#[derive(Clone, Debug)]
pub struct Scatter {
    /// Heading.
    pub title: String,
    /// Name and unit of the horizontal axis.
    pub x_label: String,
    /// Name and unit of the vertical axis.
    pub y_label: String,
    /// What is drawn.
    pub groups: Vec<Group>,
}

/// Width, pixels; and height without the legend.
const WIDTH: u32 = 760;
const HEIGHT: u32 = 460;
/// Entries of the legend in a row, and the height of a row, pixels.
const COLUMNS: usize = 3;
const ROW: i32 = 20;
/// Radius of a marker, pixels.
const RADIUS: i32 = 5;
/// Room beyond the outermost points, as a factor.
const ROOM: f64 = 1.25;

impl Scatter {
    /// The chart as an SVG document.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if no point has positive finite coordinates.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let (x, y) = (range(self.points().map(|p| p.x)), range(self.points().map(|p| p.y)));
        let (Some(x), Some(y)) = (x, y) else { return Err(ChartError::Empty) };
        let rows = self.groups.len().div_ceil(COLUMNS) as u32;
        svg((WIDTH, HEIGHT + rows * ROW as u32), |root| self.draw(root, x, y))
    }

    fn points(&self) -> impl Iterator<Item = &Point> {
        self.groups.iter().flat_map(|group| &group.points).filter(|p| drawable(p))
    }

    fn draw(
        &self,
        root: &DrawingArea<SVGBackend<'_>, Shift>,
        x: (f64, f64),
        y: (f64, f64),
    ) -> Result<(), Box<dyn std::error::Error>> {
        let grey = color(Ink::Grey);
        let text = |size: i32| (FONT, px(size)).into_font().color(&grey);
        root.draw(&Text::new(self.title.as_str(), (px(LEFT), px(10)), text(17)))?;
        let bottom = self.draw_legend(root)?;
        let (_, body) = root.split_vertically(px(bottom));
        let mut chart = ChartBuilder::on(&body)
            .margin_left(px(14))
            .margin_right(px(24))
            .margin_bottom(px(6))
            .x_label_area_size(px(46))
            .y_label_area_size(px(66))
            .build_cartesian_2d(
                (x.0..x.1).log_scale().with_key_points(ticks(x)),
                (y.0..y.1).log_scale().with_key_points(ticks(y)),
            )?;
        chart
            .configure_mesh()
            .bold_line_style(grey.mix(0.25).stroke_width(FINE))
            .light_line_style(TRANSPARENT)
            .axis_style(grey.stroke_width(FINE))
            .set_all_tick_mark_size(px(5))
            .x_labels(99)
            .y_labels(99)
            .x_label_formatter(&|x| tidy(*x))
            .y_label_formatter(&|y| tidy(*y))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .label_style(text(13))
            .axis_desc_style(text(14))
            .draw()?;
        for group in &self.groups {
            let ink = color(group.ink);
            let places: Vec<(i32, i32)> =
                group.points.iter().filter(|p| drawable(p)).map(|p| chart.backend_coord(&(p.x, p.y))).collect();
            root.draw(&PathElement::new(places.clone(), ink.mix(0.4).stroke_width(FINE)))?;
            let labels = group.points.iter().filter(|p| drawable(p)).map(|p| p.label.as_str());
            for (&place, label) in places.iter().zip(labels) {
                draw_marker(root, group.marker, ink, place)?;
                let style = (FONT, px(12)).into_font().color(&ink).pos(Pos::new(HPos::Left, VPos::Bottom));
                root.draw(&Text::new(label, (place.0 + px(RADIUS), place.1 - px(RADIUS) / 2), style))?;
            }
        }
        Ok(())
    }

    /// Names of the groups in rows between heading and axes, where no point can lie behind them. Returns where the axes may
    /// begin, pixels from the top.
    fn draw_legend(&self, root: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<i32, Box<dyn std::error::Error>> {
        let wide = (WIDTH as i32 - LEFT) / COLUMNS as i32;
        for (i, group) in self.groups.iter().enumerate() {
            let (left, middle) = (LEFT + (i % COLUMNS) as i32 * wide, 45 + (i / COLUMNS) as i32 * ROW);
            draw_marker(root, group.marker, color(group.ink), (px(left + RADIUS), px(middle)))?;
            let style = (FONT, px(13)).into_font().color(&color(Ink::Grey)).pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(group.label.as_str(), (px(left + 18), px(middle)), style))?;
        }
        Ok(42 + self.groups.len().div_ceil(COLUMNS) as i32 * ROW)
    }
}

fn draw_marker(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    marker: Marker,
    ink: RGBColor,
    (x, y): (i32, i32),
) -> Result<(), Box<dyn std::error::Error>> {
    let (r, line) = (px(RADIUS), ink.stroke_width(2 * FINE));
    match marker {
        Marker::Disc => root.draw(&Circle::new((x, y), r, ink.filled()))?,
        Marker::Ring => root.draw(&Circle::new((x, y), r, line))?,
        Marker::Triangle => root.draw(&TriangleMarker::new((x, y), r + px(1), ink.filled()))?,
        Marker::Cross => root.draw(&plotters::element::Cross::new((x, y), r, line))?,
    }
    Ok(())
}

fn drawable(point: &Point) -> bool {
    [point.x, point.y].iter().all(|v| *v > 0.0 && v.is_finite())
}

/// The range of positive values, with some room.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let ends = values
        .fold(None, |ends: Option<(f64, f64)>, v| Some(ends.map_or((v, v), |(low, high)| (low.min(v), high.max(v)))));
    ends.map(|(low, high)| (low / ROOM, high * ROOM))
}

/// Where the axis is labelled: whole decades, and the fewer there are, the more of their multiples.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let steps: &[f64] = match (high / low).log10() {
        wide if wide > 3.0 => &[1.0],
        some if some > 1.2 => &[1.0, 2.0, 5.0],
        _ => &[1.0, 1.5, 2.0, 3.0, 4.0, 5.0, 7.0],
    };
    let decades = low.log10().floor() as i32..=high.log10().ceil() as i32;
    let all = decades.flat_map(|decade| steps.iter().map(move |step| step * 10_f64.powi(decade)));
    all.filter(|tick| (low..=high).contains(tick)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scatter(points: Vec<(f64, f64)>) -> Scatter {
        let points = points.into_iter().map(|(x, y)| Point { x, y, label: "label".into() }).collect();
        let group = Group { label: "first".into(), ink: Ink::Purple, marker: Marker::Ring, points };
        Scatter {
            title: "Title".into(),
            x_label: "time (s)".into(),
            y_label: "volume (m³)".into(),
            groups: vec![group],
        }
    }

    #[test]
    fn a_scatter_names_its_axes_groups_and_points() {
        let svg = scatter(vec![(0.1, 1.0), (1.0, 0.7), (10.0, 0.6)]).to_svg().unwrap();
        for text in ["Title", "time (s)", "volume (m³)", "first", "label"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        assert!(!svg.contains("NaN"));
    }

    #[test]
    fn odd_points_are_left_out_or_refused() {
        assert_eq!(scatter(vec![(f64::NAN, 1.0), (0.0, 1.0), (1.0, -1.0)]).to_svg(), Err(ChartError::Empty));
        assert!(scatter(vec![(1.0, 1.0), (0.0, f64::INFINITY)]).to_svg().is_ok());
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks((0.8, 5.0)), [1.0, 1.5, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(ticks((0.4, 30.0)), [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(ticks((0.5e-3, 20.0)), [1e-3, 1e-2, 1e-1, 1.0, 10.0]);
    }
}
