//! Silhouettes of convex bodies, and drawings of them in a grid of panels with one common scale.

use super::ink::Ink;
use super::path::{Unit, push_line};
use super::region::covered;
use super::thin::thinned_loop;
use crate::body::fibonacci_lattice;
use crate::optimize::{outline as convex_outline, turn};
use nalgebra::Vector3;
use std::fmt::Write;

/// Where the onlooker stands; the picture's axes are in metres, the second one upwards.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum View {
    /// Seen from `-y`: x to the right, z up.
    Side,
    /// Seen from `+x`: y to the right, z up.
    Front,
    /// Seen from `+z`: x to the right, y up.
    Top,
}

impl View {
    /// The picture coordinates of a point, metres.
    pub fn project(self, point: &Vector3<f64>) -> [f64; 2] {
        match self {
            View::Side => [point.x, point.z],
            View::Front => [point.y, point.z],
            View::Top => [point.x, point.y],
        }
    }

    /// How far away from the picture plane a point is, metres, up to sign.
    pub(super) fn depth(self, point: &Vector3<f64>) -> f64 {
        match self {
            View::Side => point.y,
            View::Front => point.x,
            View::Top => point.z,
        }
    }

    /// The point at these picture coordinates and depth.
    pub(super) fn lift(self, [a, b]: [f64; 2], depth: f64) -> Vector3<f64> {
        match self {
            View::Side => Vector3::new(a, depth, b),
            View::Front => Vector3::new(depth, a, b),
            View::Top => Vector3::new(a, b, depth),
        }
    }

    /// Names of the picture's two axes and of the direction.
    pub fn name(self) -> &'static str {
        match self {
            View::Side => "side (x, z)",
            View::Front => "front (y, z)",
            View::Top => "top (x, y)",
        }
    }
}

/// `count` boundary points of a body, one along each of as many even directions (a Fibonacci
/// lattice).
///
/// `along` gives the boundary point met by the ray in a unit direction, such as
/// `Body::boundary_along`.
pub fn boundary_points(along: impl Fn(&Vector3<f64>) -> Vector3<f64>, count: usize) -> Vec<Vector3<f64>> {
    fibonacci_lattice(count).map(|direction| along(&direction)).collect()
}

/// The silhouette of the convex hull of `points`: its corners in picture coordinates, metres,
/// counter-clockwise.
pub fn outline(points: &[Vector3<f64>], view: View) -> Vec<[f64; 2]> {
    let mut flat: Vec<[f64; 2]> = points.iter().map(|point| view.project(point)).collect();
    convex_outline(&mut flat)
}

/// The silhouette of a convex set by its support points along `count` even directions of the
/// picture: its corners in picture coordinates, metres, counter-clockwise.
///
/// `support` gives the point of the set that lies farthest along a unit direction, such as
/// `Body::support`: corners are met exactly.
pub fn silhouette(support: impl Fn(&Vector3<f64>) -> Vector3<f64>, view: View, count: usize) -> Vec<[f64; 2]> {
    let direction = |k: usize| {
        let (sin, cos) = (std::f64::consts::TAU * (k as f64 + 0.5) / count as f64).sin_cos();
        view.lift([cos, sin], 0.0)
    };
    let points: Vec<_> = (0..count).map(|k| support(&direction(k))).collect();
    outline(&points, view)
}

/// One drawn thing: the outline of a body, or the triangles of an object.
#[derive(Clone, Debug)]
pub struct Outline {
    /// Colour.
    pub ink: Ink,
    /// Polygons in picture coordinates, metres.
    pub polygons: Vec<Vec<[f64; 2]>>,
    /// Drawn as one filled area, the union of the polygons, which are convex; otherwise as lines
    /// over a faint area.
    pub solid: bool,
}

impl Outline {
    /// The outline of a body.
    pub fn body(ink: Ink, polygon: Vec<[f64; 2]>) -> Outline {
        Outline { ink, polygons: vec![polygon], solid: false }
    }

    /// The picture of a triangle surface, the triangles facing the onlooker or not.
    pub fn surface(ink: Ink, vertices: &[Vector3<f64>], triangles: &[[usize; 3]], view: View) -> Outline {
        let flat: Vec<[f64; 2]> = vertices.iter().map(|vertex| view.project(vertex)).collect();
        let corners = triangles.iter().map(|[a, b, c]| [flat[*a], flat[*b], flat[*c]]);
        // One half of a closed surface covers the whole picture of it.
        let seen = corners.filter(|[a, b, c]| turn(*a, *b, *c) > 0.0);
        Outline { ink, polygons: seen.map(Vec::from).collect(), solid: true }
    }
}

/// Two points that belong together, such as the nearest ones of two bodies, drawn as a line with a
/// dot at each end.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Colour.
    pub ink: Ink,
    /// Picture coordinates, metres.
    pub ends: [[f64; 2]; 2],
}

/// One picture with its caption.
#[derive(Clone, Debug)]
pub struct Panel {
    /// Text above the picture.
    pub caption: String,
    /// What is drawn, from back to front.
    pub outlines: Vec<Outline>,
    /// Pairs of points, in front of all of it.
    pub spans: Vec<Span>,
}

/// Panels in rows, all at one scale, with a scale bar and a legend.
#[derive(Clone, Debug)]
pub struct Silhouettes {
    /// Heading.
    pub title: String,
    /// Colours and their meaning.
    pub legend: Vec<(Ink, String)>,
    /// Rows of panels.
    pub rows: Vec<Vec<Panel>>,
}

/// Side of the widest panel, pixels.
const PANEL: f64 = 250.0;
const GAP: f64 = 18.0;
const CAPTION: f64 = 22.0;
const HEADER: f64 = 58.0;
const FOOTER: f64 = 34.0;
/// From one line of the legend to the next, pixels.
const LEGEND_LINE: f64 = 20.0;
/// How far an outline may move for the sake of fewer vertices, pixels.
const TOLERANCE: f64 = 0.2;

impl Silhouettes {
    /// The drawing as an SVG document. Panels of a row share their vertical range, so that floors
    /// line up.
    pub fn to_svg(&self) -> String {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let boxes: Vec<Vec<Range2>> = self.rows.iter().map(|row| ranges(row)).collect();
        let all = || boxes.iter().flatten();
        let span = all().map(Range2::width).fold(0.0, f64::max);
        let span = if span > 0.0 { span } else { 1.0 };
        let tallest = all().map(Range2::height).fold(0.0, f64::max);
        // Pixels per metre, so that neither side of a panel grows out of hand.
        let scale = (PANEL / span).min(1.4 * PANEL / tallest.max(1e-300));
        let cell = (span * scale).max(150.0);
        let width = (GAP + columns as f64 * (cell + GAP)).max(420.0);
        let row_heights: Vec<f64> = boxes.iter().map(|row| row.first().map_or(0.0, |b| b.height() * scale)).collect();
        let legend = self.legend_places(width);
        let header = HEADER + legend.last().map_or(0.0, |place| place[1]);
        let height = header + row_heights.iter().map(|h| h + CAPTION + GAP).sum::<f64>() + FOOTER;

        let mut svg = String::new();
        let grey = Ink::Grey.hex();
        // Writing to a string cannot fail.
        let _ = writeln!(
            svg,
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width:.0} {height:.0}\" width=\"{width:.0}\" \
             height=\"{height:.0}\" font-family=\"sans-serif\" font-size=\"13\" fill=\"{grey}\">"
        );
        let _ = writeln!(svg, "<text x=\"{GAP}\" y=\"24\" font-size=\"17\">{}</text>", escaped(&self.title));
        self.write_legend(&mut svg, &legend);
        let mut top = header;
        for ((row, boxes), tall) in self.rows.iter().zip(&boxes).zip(&row_heights) {
            for (column, (panel, range)) in row.iter().zip(boxes).enumerate() {
                let left = GAP + column as f64 * (cell + GAP);
                let _ =
                    writeln!(svg, "<text x=\"{left:.1}\" y=\"{:.1}\">{}</text>", top + 14.0, escaped(&panel.caption));
                let middle = left + (cell - range.width() * scale) / 2.0;
                let origin = [middle - range.low[0] * scale, top + CAPTION + tall + range.low[1] * scale];
                for outline in &panel.outlines {
                    write_outline(&mut svg, outline, origin, scale);
                }
                for span in &panel.spans {
                    write_span(&mut svg, span, origin, scale);
                }
            }
            top += CAPTION + tall + GAP;
        }
        write_scale_bar(&mut svg, top + 6.0, scale, cell);
        svg.push_str("</svg>\n");
        svg
    }

    /// Where the entries of the legend begin, pixels from the left and from the first line: one
    /// after the other, on a further line where the picture ends.
    fn legend_places(&self, width: f64) -> Vec<[f64; 2]> {
        let (mut left, mut line) = (GAP, 0.0);
        let mut places = Vec::with_capacity(self.legend.len());
        for (_, label) in &self.legend {
            let wide = 7.5 * label.chars().count() as f64;
            if left > GAP && left + 21.0 + wide > width {
                (left, line) = (GAP, line + LEGEND_LINE);
            }
            places.push([left, line]);
            left += 46.0 + wide;
        }
        places
    }

    fn write_legend(&self, svg: &mut String, places: &[[f64; 2]]) {
        for ((ink, label), [left, line]) in self.legend.iter().zip(places) {
            let color = ink.hex();
            let _ = writeln!(
                svg,
                "<rect x=\"{left}\" y=\"{}\" width=\"14\" height=\"12\" fill=\"{color}\" fill-opacity=\"0.35\" \
                 stroke=\"{color}\" stroke-width=\"2\"/><text x=\"{}\" y=\"{}\">{}</text>",
                35.0 + line,
                left + 21.0,
                46.0 + line,
                escaped(label)
            );
        }
    }
}

/// A rectangle in picture coordinates, metres.
#[derive(Clone, Copy)]
struct Range2 {
    low: [f64; 2],
    high: [f64; 2],
}

impl Range2 {
    fn width(&self) -> f64 {
        self.high[0] - self.low[0]
    }

    fn height(&self) -> f64 {
        self.high[1] - self.low[1]
    }
}

/// The range of each panel of a row, the vertical one common to all.
fn ranges(row: &[Panel]) -> Vec<Range2> {
    let range = |points: &mut dyn Iterator<Item = [f64; 2]>| {
        let empty = Range2 { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2] };
        let wide = points.filter(|p| p.iter().all(|c| c.is_finite())).fold(empty, |range, p| Range2 {
            low: [range.low[0].min(p[0]), range.low[1].min(p[1])],
            high: [range.high[0].max(p[0]), range.high[1].max(p[1])],
        });
        if wide.width() >= 0.0 { wide } else { Range2 { low: [0.0; 2], high: [0.0; 2] } }
    };
    let points =
        |panel: &Panel| panel.outlines.iter().flat_map(|o| o.polygons.iter().flatten().copied()).collect::<Vec<_>>();
    let common = range(&mut row.iter().flat_map(points));
    let own = row.iter().map(|panel| range(&mut points(panel).into_iter()));
    own.map(|r| Range2 { low: [r.low[0], common.low[1]], high: [r.high[0], common.high[1]] }).collect()
}

fn write_outline(svg: &mut String, outline: &Outline, origin: [f64; 2], scale: f64) {
    let color = outline.ink.hex();
    let style = if outline.solid {
        format!(" opacity=\"0.5\" stroke=\"{color}\" stroke-width=\"0.6\" fill=\"{color}\"")
    } else {
        format!(" stroke=\"{color}\" stroke-width=\"2\" fill=\"{color}\" fill-opacity=\"0.12\"")
    };
    let pixel = |point: &[f64; 2]| [origin[0] + point[0] * scale, origin[1] - point[1] * scale];
    let polygons = outline.polygons.iter().map(|polygon| polygon.iter().map(pixel).collect());
    let mut polygons: Vec<Vec<[f64; 2]>> = polygons.collect();
    if outline.solid {
        polygons = covered(&polygons);
    }
    let mut d = String::new();
    for polygon in &polygons {
        let thin = thinned_loop(polygon, TOLERANCE);
        // What the tolerance leaves no area of is smaller than can be seen.
        if thin.len() > 2 || polygon.len() < 3 {
            let tenths: Vec<[i64; 2]> = thin.iter().map(|p| p.map(|c| (c * 10.0).round() as i64)).collect();
            push_line(&mut d, &tenths, true, Unit::Tenth);
        }
    }
    // Writing to a string cannot fail.
    let _ = writeln!(svg, "<path{style} stroke-linejoin=\"round\" d=\"{d}\"/>");
}

fn write_span(svg: &mut String, span: &Span, origin: [f64; 2], scale: f64) {
    let color = span.ink.hex();
    let [[x, y], [u, v]] = span.ends.map(|[a, b]| [origin[0] + a * scale, origin[1] - b * scale]);
    // Writing to a string cannot fail.
    let _ = writeln!(
        svg,
        "<path d=\"M{x:.1} {y:.1}L{u:.1} {v:.1}\" stroke=\"{color}\" stroke-width=\"2.5\"/><circle cx=\"{x:.1}\" \
         cy=\"{y:.1}\" r=\"4\" fill=\"{color}\"/><circle cx=\"{u:.1}\" cy=\"{v:.1}\" r=\"4\" fill=\"{color}\"/>"
    );
}

/// A bar of a round length, about a quarter of a panel.
fn write_scale_bar(svg: &mut String, top: f64, scale: f64, cell: f64) {
    let target = cell / 4.0 / scale;
    let decade = 10f64.powf(target.log10().floor());
    let length = [5.0, 2.0, 1.0].into_iter().find(|m| m * decade <= target).unwrap_or(1.0) * decade;
    let end = GAP + length * scale;
    let units = [(1.0, "m"), (1e-2, "cm"), (1e-3, "mm"), (1e-6, "µm"), (1e-9, "nm")];
    let label = match units.into_iter().find(|(unit, _)| length > 0.99 * unit) {
        Some((unit, name)) => format!("{:.0} {name}", length / unit),
        None => format!("{length:.0e} m"),
    };
    let _ = writeln!(
        svg,
        "<path d=\"M{GAP} {0:.1}v8M{GAP} {1:.1}H{end:.1}M{end:.1} {0:.1}v8\" stroke=\"{2}\" fill=\"none\"/>\
         <text x=\"{3:.1}\" y=\"{4:.1}\">{label}</text>",
        top,
        top + 4.0,
        Ink::Grey.hex(),
        end + 8.0,
        top + 9.0
    );
}

/// Text as XML wants it.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_outline_of_an_ellipsoid_is_full() {
        let axes = Vector3::new(1.0, 0.5, 2.0);
        let points = boundary_points(|u| u.component_mul(&axes) + Vector3::new(1.0, -2.0, 0.5), 4000);
        let outline = outline(&points, View::Top);
        let high = outline.iter().map(|p| p[0]).fold(f64::NEG_INFINITY, f64::max);
        assert!((high - 2.0).abs() < 5e-3, "{high}");
        let area: f64 =
            outline.iter().zip(outline.iter().cycle().skip(1)).map(|(a, b)| a[0] * b[1] - a[1] * b[0]).sum();
        assert!((area / 2.0 / (std::f64::consts::PI * 0.5) - 1.0).abs() < 0.01, "counter-clockwise and full");
    }

    #[test]
    fn support_points_draw_boxes_with_their_corners_and_balls_round() {
        let half = Vector3::<f64>::new(0.3, 0.2, 0.1);
        let corner = |n: &Vector3<f64>| Vector3::from_fn(|axis, _| f64::copysign(half[axis], n[axis]));
        assert_eq!(silhouette(corner, View::Front, 90), [[-0.2, -0.1], [0.2, -0.1], [0.2, 0.1], [-0.2, 0.1]]);
        let ball = silhouette(|n| n * 2.0 + Vector3::x(), View::Top, 90);
        assert_eq!(ball.len(), 90);
        assert!(ball.iter().all(|[x, y]| ((x - 1.0).hypot(*y) - 2.0).abs() < 1e-12));
    }

    #[test]
    fn a_long_legend_takes_several_lines_and_all_of_it_is_in_the_picture() {
        let square = vec![[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]];
        let panel = |_| Panel {
            caption: "it".into(),
            outlines: vec![Outline::body(Ink::Blue, square.clone())],
            spans: Vec::new(),
        };
        let svg = |labels: &[&str]| {
            let legend = labels.iter().map(|&label| (Ink::Blue, label.to_owned())).collect();
            Silhouettes { title: "legend".into(), legend, rows: vec![(0..2).map(panel).collect()] }.to_svg()
        };
        let lines = |svg: &str| -> Vec<f64> {
            let rows = svg.split("<rect x=\"18\" y=\"").skip(1).map(|rest| rest.split('"').next().expect("a number"));
            rows.map(|line| line.parse().expect("a number")).collect()
        };
        let height = |svg: &str| -> f64 {
            let text = svg.split("height=\"").nth(1).expect("a height");
            text.split('"').next().expect("a number").parse().expect("a number")
        };
        let (short, long) = (svg(&["one", "two"]), svg(&["a label of forty letters, more or less so"; 3]));
        assert_eq!((lines(&short), lines(&long)), (vec![35.0], vec![35.0, 55.0, 75.0]));
        assert_eq!(height(&long) - height(&short), 40.0);
    }

    #[test]
    fn spans_are_drawn_in_front() {
        let panel = Panel {
            caption: "two".into(),
            outlines: vec![Outline::body(Ink::Blue, vec![[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]])],
            spans: vec![Span { ink: Ink::Green, ends: [[0.0, 0.0], [1.0, 1.0]] }],
        };
        let svg = Silhouettes { title: "spans".into(), legend: vec![], rows: vec![vec![panel]] }.to_svg();
        let (body, span) = (svg.find("fill-opacity").expect("a body"), svg.find("<circle").expect("a dot"));
        assert!(body < span && svg.matches("<circle").count() == 2 && svg.contains(&Ink::Green.hex()), "{svg}");
    }

    #[test]
    fn the_outline_of_a_square_has_four_corners() {
        let corner = |x: f64, z: f64| Vector3::new(x, 0.3, z);
        let points = [
            corner(0.0, 0.0),
            corner(1.0, 0.0),
            corner(0.5, 0.5),
            corner(1.0, 1.0),
            corner(0.0, 1.0),
            corner(0.5, 0.0),
        ];
        assert_eq!(outline(&points, View::Side), [[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]]);
    }

    #[test]
    fn degenerate_drawings_contain_no_nan() {
        let panel = |polygon: Vec<[f64; 2]>| Panel {
            caption: "a < b".into(),
            outlines: vec![Outline::body(Ink::Blue, polygon)],
            spans: Vec::new(),
        };
        for rows in [vec![], vec![vec![]], vec![vec![panel(vec![])]], vec![vec![panel(vec![[1.0, 1.0]])]]] {
            let svg = Silhouettes { title: "R&D".into(), legend: vec![], rows }.to_svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
            assert!(svg.contains("R&amp;D") && !svg.contains("a < b"));
        }
    }
}
