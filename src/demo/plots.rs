//! The demo's two pictures.

use super::sweep::{Answer, Sample, Sweep};
use super::table::crossings;
use crate::body::Body;
use crate::draw::{
    ChartError, Ink, LineChart, Mark, Outline, Panel, Series, Silhouettes, View, boundary_points, outline,
};
use crate::fit::shapes::Shape;
use nalgebra::Vector3;

/// Boundary points that an outline is made of.
const POINTS: usize = 6000;

/// Both level distances against the position of the chair.
pub(super) fn level_distances(sweep: &Sweep) -> Result<String, ChartError> {
    let curve = |answer: fn(&Sample) -> Answer| sweep.samples.iter().map(|s| (s.x, answer(s).value)).collect();
    let chart = LineChart {
        title: "A chair swept through a human: above 1 apart, below 1 overlapping".into(),
        x_label: "position of the chair along x (m)".into(),
        y_label: "level distance (dimensionless)".into(),
        series: vec![
            Series {
                label: "d(chair‖human)".into(),
                ink: Ink::Orange,
                dashed: false,
                points: curve(|s| s.chair_on_human),
            },
            Series {
                label: "d(human‖chair)".into(),
                ink: Ink::Blue,
                dashed: true,
                points: curve(|s| s.human_on_chair),
            },
        ],
        mark: Mark { value: 1.0, label: "1: touching".into() },
    };
    chart.to_svg()
}

/// Chair and human with their bodies at three stages of the sweep: apart, touching, overlapping.
pub(super) fn silhouettes(sweep: &Sweep, posed: [(&Shape, &Body); 2]) -> String {
    let first = sweep.samples.first().map_or(0.0, |sample| sample.x);
    let contact = crossings(&sweep.samples, |s| s.chair_on_human).first().copied().unwrap_or(first / 2.0);
    let boundaries = posed.map(|(_, body)| boundary_points(|direction| body.boundary_along(direction), POINTS));
    let stages = [("apart", first), ("touching", contact), ("overlapping", 0.0)];
    let rows = [View::Side, View::Top].map(|view| {
        let panel = |(state, x): (&str, f64)| {
            let moves = [(Ink::Orange, x), (Ink::Blue, 0.0)];
            let moved =
                |points: &[Vector3<f64>], x: f64| points.iter().map(|p| p + Vector3::x() * x).collect::<Vec<_>>();
            // The human stands behind, the outlines in front.
            let surfaces = posed.iter().zip(moves).rev().map(|((shape, _), (ink, x))| {
                Outline::surface(ink, &moved(&shape.vertices, x), &shape.triangles, view)
            });
            let outlines =
                boundaries.iter().zip(moves).rev().map(|(b, (ink, x))| Outline::body(ink, outline(&moved(b, x), view)));
            Panel {
                caption: format!("{state}, x = {x:.2} m, {}", view.name()),
                outlines: surfaces.chain(outlines).collect(),
                spans: Vec::new(),
            }
        };
        stages.map(panel).into()
    });
    let legend = vec![(Ink::Orange, "chair".into()), (Ink::Blue, "human".into())];
    Silhouettes { title: "Chair and human with their degree-6 bodies".into(), legend, rows: rows.into() }.to_svg()
}
