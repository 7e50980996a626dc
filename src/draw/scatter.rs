//! Points on two logarithmic axes, each with a word beside it; fronts as stairs below them.

use super::canvas::{ChartError, FINE, FONT, LEFT, color, px, svg, tidy};
use super::ink::Ink;
use super::labels::{Area, place};
use plotters::coord::Shift;
use plotters::coord::combinators::{BindKeyPoints, IntoLogRange};
use plotters::element::DashedPathElement;
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

/// One measured thing.
#[derive(Clone, Debug)]
pub struct Point {
    /// Horizontal coordinate, positive; 0 puts it on the [`Scatter::edge`].
    pub x: f64,
    /// Vertical coordinate, positive.
    pub y: f64,
    /// Written beside it.
    pub label: String,
}

/// How a point looks: distinguished without colours.
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

/// Points of one kind.
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
    /// Whether a thin line joins them in their order.
    pub joined: bool,
}

/// A front: a value holds from its point on to the right, until the next one.
#[derive(Clone, Debug)]
pub struct Stairs {
    /// Name in the legend.
    pub label: String,
    /// Colour.
    pub ink: Ink,
    /// Dashed instead of solid.
    pub dashed: bool,
    /// Its points from left to right; an `x` of 0 is on the edge.
    pub points: Vec<(f64, f64)>,
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
    /// Below the points.
    pub stairs: Vec<Stairs>,
    /// What it means that `x` is 0: the tick label of a strip at the left edge.
    pub edge: Option<String>,
    /// A place on the horizontal axis that has a word for a number.
    pub named: Option<(f64, String)>,
}

/// Width, pixels; and height without the legend.
const WIDTH: u32 = 760;
const HEIGHT: u32 = 500;
/// Entries of the legend in a row, and the height of a row, pixels.
const COLUMNS: usize = 3;
const ROW: i32 = 20;
/// Radius of a marker, pixels.
const RADIUS: i32 = 5;
/// Space beyond the outermost points, as a factor.
const SPACE: f64 = 1.25;
/// How far the edge, and the line beside it, lie left of the leftmost point, as factors.
const EDGE: f64 = 2.6;
const BESIDE: f64 = 1.7;

impl Scatter {
    /// The chart as an SVG document.
    ///
    /// # Errors
    /// [`ChartError::Empty`] if no point has positive finite coordinates.
    pub fn to_svg(&self) -> Result<String, ChartError> {
        let places = || self.groups.iter().flat_map(|group| &group.points).map(|p| (p.x, p.y));
        let drawable = || places().filter(|place| self.drawable(*place));
        // All on the edge leave no scale to choose; any will do.
        let x = range(drawable().map(|p| p.0).filter(|x| *x > 0.0)).or(self.edge.as_ref().map(|_| (1e-3, 1.0)));
        let (Some(x), Some(y)) = (x, range(drawable().map(|p| p.1))) else { return Err(ChartError::Empty) };
        let rows = (self.groups.len() + self.stairs.len()).div_ceil(COLUMNS) as u32;
        svg((WIDTH, HEIGHT + rows * ROW as u32), |root| self.draw(root, x, y))
    }

    fn drawable(&self, (x, y): (f64, f64)) -> bool {
        let across = x > 0.0 || (x == 0.0 && self.edge.is_some());
        across && y > 0.0 && [x, y].iter().all(|v| v.is_finite())
    }

    fn draw(
        &self,
        root: &DrawingArea<SVGBackend<'_>, Shift>,
        data: (f64, f64),
        y: (f64, f64),
    ) -> Result<(), Box<dyn std::error::Error>> {
        let edge = data.0 / EDGE;
        let mut x_ticks = ticks(data);
        let named = self.edge.iter().map(|word| (edge, word)).chain(self.named.iter().map(|(x, word)| (*x, word)));
        let named: Vec<(f64, &String)> = named.collect();
        x_ticks.extend(self.named.iter().map(|(x, _)| *x));
        let x = if self.edge.is_some() {
            x_ticks.push(edge);
            (edge / SPACE.powi(2), data.1)
        } else {
            data
        };
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
                (x.0..x.1).log_scale().with_key_points(x_ticks),
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
            .x_label_formatter(&|x| {
                named.iter().find(|(place, _)| place == x).map_or_else(|| tidy(*x), |(_, word)| (*word).clone())
            })
            .y_label_formatter(&|y| tidy(*y))
            .x_desc(self.x_label.as_str())
            .y_desc(self.y_label.as_str())
            .label_style(text(13))
            .axis_desc_style(text(14))
            .draw()?;
        let at = |(x, y): (f64, f64)| chart.backend_coord(&(if x > 0.0 { x } else { edge }, y));
        if self.edge.is_some() {
            let [top, bottom] = [y.1, y.0].map(|y| chart.backend_coord(&(data.0 / BESIDE, y)));
            root.draw(&PathElement::new([top, bottom], grey.stroke_width(FINE)))?;
        }
        for Stairs { ink, dashed, points, .. } in &self.stairs {
            draw_stairs(root, color(*ink), *dashed, points.iter().map(|p| at(*p)).collect(), at((x.1, y.0)).0)?;
        }
        let mut labels = Vec::new();
        let mut markers = Vec::new();
        for group in &self.groups {
            let ink = color(group.ink);
            let points: Vec<&Point> = group.points.iter().filter(|p| self.drawable((p.x, p.y))).collect();
            let places: Vec<(i32, i32)> = points.iter().map(|p| at((p.x, p.y))).collect();
            let joined: Vec<_> =
                places.iter().zip(&points).filter(|(_, p)| p.x > 0.0).map(|(place, _)| *place).collect();
            if group.joined {
                root.draw(&PathElement::new(joined, ink.mix(0.4).stroke_width(FINE)))?;
            }
            for (&place, point) in places.iter().zip(points) {
                draw_marker(root, group.marker, ink, place)?;
                let place = (f64::from(place.0) / f64::from(FINE), f64::from(place.1) / f64::from(FINE));
                markers.push(Area::around(place, f64::from(RADIUS)));
                if !point.label.is_empty() {
                    labels.push((place, point.label.as_str(), ink));
                }
            }
        }
        let pixels = |v: i32| f64::from(v) / f64::from(FINE);
        let ((left, top), (right, bottom)) = (chart.backend_coord(&(x.0, y.1)), chart.backend_coord(&(x.1, y.0)));
        let frame = Area { left: pixels(left), top: pixels(top), right: pixels(right), bottom: pixels(bottom) };
        let texts: Vec<((f64, f64), &str)> = labels.iter().map(|(place, text, _)| (*place, *text)).collect();
        for ((left, top), (_, text, ink)) in
            place(&texts, &markers, &frame, f64::from(RADIUS) + 1.0).into_iter().zip(&labels)
        {
            let style = (FONT, px(12)).into_font().color(ink).pos(Pos::new(HPos::Left, VPos::Top));
            let fine = |v: f64| (v * f64::from(FINE)).round() as i32;
            root.draw(&Text::new(*text, (fine(left), fine(top)), style))?;
        }
        Ok(())
    }

    /// Names of the groups in rows between heading and axes, where no point can lie behind them.
    /// Returns where the axes may begin, pixels from the top.
    fn draw_legend(&self, root: &DrawingArea<SVGBackend<'_>, Shift>) -> Result<i32, Box<dyn std::error::Error>> {
        let wide = (WIDTH as i32 - LEFT) / COLUMNS as i32;
        for (i, group) in self.groups.iter().enumerate() {
            let (left, middle) = (LEFT + (i % COLUMNS) as i32 * wide, 45 + (i / COLUMNS) as i32 * ROW);
            draw_marker(root, group.marker, color(group.ink), (px(left + RADIUS), px(middle)))?;
            let style = (FONT, px(13)).into_font().color(&color(Ink::Grey)).pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(group.label.as_str(), (px(left + 18), px(middle)), style))?;
        }
        for (i, stairs) in (self.groups.len()..).zip(&self.stairs) {
            let (left, middle) = (LEFT + (i % COLUMNS) as i32 * wide, 45 + (i / COLUMNS) as i32 * ROW);
            let from = (px(left - 4), px(middle));
            draw_stairs(root, color(stairs.ink), stairs.dashed, vec![from], px(left + 14))?;
            let style = (FONT, px(13)).into_font().color(&color(Ink::Grey)).pos(Pos::new(HPos::Left, VPos::Center));
            root.draw(&Text::new(stairs.label.as_str(), (px(left + 18), px(middle)), style))?;
        }
        Ok(42 + (self.groups.len() + self.stairs.len()).div_ceil(COLUMNS) as i32 * ROW)
    }
}

/// Each point's height holds until the next point, that of the last one until `end`.
fn draw_stairs(
    root: &DrawingArea<SVGBackend<'_>, Shift>,
    ink: RGBColor,
    dashed: bool,
    points: Vec<(i32, i32)>,
    end: i32,
) -> Result<(), Box<dyn std::error::Error>> {
    let ends = points.iter().skip(1).map(|p| p.0).chain([end]);
    let path: Vec<(i32, i32)> = points.iter().zip(ends).flat_map(|(&(x, y), end)| [(x, y), (end, y)]).collect();
    let style = ink.mix(0.55).stroke_width(3 * FINE / 2);
    if dashed {
        root.draw(&DashedPathElement::new(path, 6 * FINE, 4 * FINE, style))?;
    } else {
        root.draw(&PathElement::new(path, style))?;
    }
    Ok(())
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

/// The range of positive values, with some space.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let ends = values
        .fold(None, |ends: Option<(f64, f64)>, v| Some(ends.map_or((v, v), |(low, high)| (low.min(v), high.max(v)))));
    ends.map(|(low, high)| (low / SPACE, high * SPACE))
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
        let group = Group { label: "first".into(), ink: Ink::Purple, marker: Marker::Ring, points, joined: true };
        Scatter {
            title: "Title".into(),
            x_label: "time (s)".into(),
            y_label: "volume (m³)".into(),
            groups: vec![group],
            stairs: vec![],
            edge: None,
            named: None,
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
    fn what_is_exact_stands_on_the_edge() {
        let mut chart = scatter(vec![(0.0, 2.0), (0.1, 1.0)]);
        chart.edge = Some("exact".into());
        chart.stairs =
            vec![Stairs { label: "front".into(), ink: Ink::Grey, dashed: true, points: vec![(0.0, 2.0), (0.1, 1.0)] }];
        let svg = chart.to_svg().unwrap();
        for text in ["exact", "front"] {
            assert!(svg.contains(text), "{text} is missing");
        }
        assert!(!svg.contains("NaN"));
        chart.groups[0].points.truncate(1);
        assert!(chart.to_svg().is_ok(), "nothing but exact ones");
    }

    #[test]
    fn ticks_are_round() {
        assert_eq!(ticks((0.8, 5.0)), [1.0, 1.5, 2.0, 3.0, 4.0, 5.0]);
        assert_eq!(ticks((0.4, 30.0)), [0.5, 1.0, 2.0, 5.0, 10.0, 20.0]);
        assert_eq!(ticks((0.5e-3, 20.0)), [1e-3, 1e-2, 1e-1, 1.0, 10.0]);
    }
}
