//! The charts: model error across, time up, a point for each representation.

use super::front::{Entry, front};
use super::ours::Method;
use super::race::{Line, Race, Who};
use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter, Stairs, stacked};

/// Which times are drawn, or judged.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Timing {
    /// With a hint from the pose before, where there is such a form.
    Warm,
    /// Without.
    Cold,
    /// In batches, where there is such a form; of peers the faster of their others.
    Batch,
}

/// What errors are measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Truth {
    Hulls,
    Meshes,
}

/// Errors below this part of the diameter are those of parry's GJK, not of a representation.
const EXACT: f64 = 1e-7;

impl Line {
    /// Nanoseconds; NaN where there is no such form.
    pub(super) fn nanoseconds(&self, timing: Timing) -> f64 {
        let peer = !matches!(self.who, Who::Ours(_));
        match timing {
            // The smaller of a number and NaN is the number.
            Timing::Warm => self.warm.min(if peer { self.cold } else { f64::NAN }),
            Timing::Cold => self.cold,
            Timing::Batch => {
                if peer {
                    self.warm.min(self.cold)
                } else {
                    self.batch
                }
            }
        }
    }

    /// Mean model error, 0 for what is exact; none for what does not contain the truth, so that it
    /// has no error of one sign.
    pub(super) fn error(&self, truth: Truth) -> Option<f64> {
        let error = if truth == Truth::Hulls { self.hull } else { self.mesh };
        let held = match (truth, self.who) {
            (Truth::Hulls, Who::Ours(method)) => method.holds_hull(),
            (Truth::Hulls, who) => who != Who::ParryMesh,
            (Truth::Meshes, _) => true,
        };
        held.then_some(if error.mean < EXACT { 0.0 } else { error.mean })
    }
}

impl Who {
    pub(super) fn name(self) -> String {
        let hull = |count: Option<usize>| count.map_or("hull".into(), |count| format!("hull, {count} vertices"));
        match self {
            Self::Ours(method) => method.name(),
            Self::ParryBall => "ball, parry".into(),
            Self::ParryBox => "oriented box, parry".into(),
            Self::ParryHull(count) => format!("{}, parry", hull(count)),
            Self::CoalHull(count) => format!("{}, coal", hull(count)),
            Self::ParryMesh => "mesh, parry".into(),
        }
    }

    fn mark(self) -> String {
        let hull = |count: Option<usize>| count.map_or("hull".into(), |count| count.to_string());
        match self {
            Self::Ours(method) => method.mark(),
            Self::ParryBall => "ball".into(),
            Self::ParryBox => "box".into(),
            Self::ParryHull(count) | Self::CoalHull(count) => hull(count),
            Self::ParryMesh => "mesh".into(),
        }
    }

    /// Whether its kind comes in sizes, which a line joins.
    fn is_of_a_series(self) -> bool {
        !matches!(
            self,
            Self::ParryBall
                | Self::ParryBox
                | Self::ParryMesh
                | Self::Ours(Method::AxisBox | Method::OrientedBox | Method::Cylinder | Method::Capsule)
        )
    }

    fn style(self) -> (&'static str, Ink, Marker) {
        match self {
            Self::Ours(Method::Ball | Method::Body { refine: false, .. }) => {
                ("ours: ball, degrees 2 to 8", Ink::Blue, Marker::Disc)
            }
            Self::Ours(Method::Body { .. }) => ("ours: degree, refined", Ink::Green, Marker::Disc),
            Self::Ours(Method::AxisBox | Method::OrientedBox) => ("ours: box", Ink::Green, Marker::Triangle),
            Self::Ours(Method::Cylinder | Method::Capsule) => ("ours: cylinder, capsule", Ink::Green, Marker::Ring),
            Self::Ours(Method::Slabs { .. }) => ("ours: degree + slabs", Ink::Blue, Marker::Triangle),
            Self::Ours(Method::Parts { .. }) => ("ours: compound of parts", Ink::Purple, Marker::Disc),
            Self::Ours(Method::Balls(_)) => ("ours: cover of balls", Ink::Purple, Marker::Triangle),
            Self::ParryHull(_) => ("parry: hull, of n vertices", Ink::Orange, Marker::Ring),
            Self::CoalHull(_) => ("coal: hull, of n vertices", Ink::Orange, Marker::Disc),
            Self::ParryBall | Self::ParryBox => ("parry: ball, box", Ink::Orange, Marker::Cross),
            Self::ParryMesh => ("parry: mesh", Ink::Orange, Marker::Triangle),
        }
    }
}

/// Representations with their errors and times as what is judged.
pub(super) fn as_entries(lines: &[(Who, f64, f64)]) -> Vec<Entry> {
    let entry = |&(who, error, nanoseconds): &(Who, f64, f64)| {
        let ours = matches!(who, Who::Ours(_));
        Entry { name: who.name(), ours, error, nanoseconds }
    };
    lines.iter().map(entry).collect()
}

/// What is drawn or judged of a pair.
pub(super) fn entries(race: &Race, truth: Truth, timing: Timing) -> Vec<Entry> {
    let entry = |line: &Line| {
        let nanoseconds = line.nanoseconds(timing);
        let error = line.error(truth).filter(|_| nanoseconds.is_finite())?;
        let ours = matches!(line.who, Who::Ours(_));
        Some(Entry { name: line.who.name(), ours, error, nanoseconds })
    };
    race.lines.iter().filter_map(entry).collect()
}

impl Race {
    /// The meshes are far enough from their hulls to tell bodies apart by them.
    pub(super) fn is_hollow(&self) -> bool {
        self.lines.iter().any(|line| line.who == Who::ParryHull(None) && line.mesh.mean > 1e-3)
    }
}

/// The pictures by name: all pairs together, and of each pair one chart below the other.
///
/// # Errors
/// [`ChartError::Empty`] if nothing was measured.
pub(super) fn pictures(races: &[Race]) -> Result<Vec<(String, String)>, ChartError> {
    let mut all = vec![("speed.svg".to_owned(), overall(races)?)];
    for race in races {
        let mut charts = Vec::new();
        for timing in [Timing::Warm, Timing::Cold, Timing::Batch] {
            charts.push(chart(race, Truth::Hulls, timing)?);
        }
        if race.is_hollow() {
            charts.push(chart(race, Truth::Meshes, Timing::Warm)?);
        }
        all.push((picture(race), stacked(&charts)));
    }
    Ok(all)
}

/// Name of the picture of a pair.
pub(super) fn picture(race: &Race) -> String {
    format!("speed-{}.svg", race.name)
}

/// Means over all pairs, with a hint and against hulls: of errors the mean, of times the geometric
/// one.
pub(super) fn means(races: &[Race]) -> Vec<(Who, f64, f64)> {
    let whos = races.iter().take(1).flat_map(|race| &race.lines).map(|line| line.who);
    let means = whos.filter_map(|who| {
        let same = races.iter().map(|race| race.lines.iter().find(|line| line.who == who));
        let same: Vec<&Line> = same.collect::<Option<_>>()?;
        let count = same.len() as f64;
        let errors = same.iter().map(|line| line.error(Truth::Hulls)).collect::<Option<Vec<f64>>>()?;
        let logs = same.iter().map(|line| line.nanoseconds(Timing::Warm).ln()).sum::<f64>();
        Some((who, errors.iter().sum::<f64>() / count, (logs / count).exp()))
    });
    means.collect()
}

fn overall(races: &[Race]) -> Result<String, ChartError> {
    if races.is_empty() {
        return Err(ChartError::Empty);
    }
    let title = format!("Distance queries with a hint, means over {} pairs", races.len());
    draw(means(races), title, Truth::Hulls)
}

fn chart(race: &Race, truth: Truth, timing: Timing) -> Result<String, ChartError> {
    let lines = race.lines.iter().filter_map(|line| Some((line.who, line.error(truth)?, line.nanoseconds(timing))));
    let how = match timing {
        Timing::Warm if truth == Truth::Meshes => " with a hint, against meshes",
        Timing::Warm => " with a hint from the pose before",
        Timing::Cold => " without a hint",
        Timing::Batch => ", ours in batches",
    };
    draw(lines.collect(), format!("{}: distance queries{how}", race.name), truth)
}

fn draw(lines: Vec<(Who, f64, f64)>, title: String, truth: Truth) -> Result<String, ChartError> {
    let mut groups: Vec<Group> = Vec::new();
    for &(who, x, y) in lines.iter().filter(|(_, _, y)| y.is_finite()) {
        let (label, ink, marker) = who.style();
        let point = Point { x, y: 1e-3 * y, label: who.mark() };
        match groups.iter_mut().find(|group| group.label == label) {
            Some(group) => group.points.push(point),
            None => groups.push(Group {
                label: label.into(),
                ink,
                marker,
                points: vec![point],
                joined: who.is_of_a_series(),
            }),
        }
    }
    for group in &mut groups {
        group.points.sort_by(|a, b| a.x.total_cmp(&b.x));
    }
    let entries = as_entries(&lines);
    let stairs = |label: &str, ink, dashed, ours: bool| {
        let points =
            front(entries.iter().filter(|e| e.ours == ours)).iter().map(|e| (e.error, 1e-3 * e.nanoseconds)).collect();
        Stairs { label: label.into(), ink, dashed, points }
    };
    let of = if truth == Truth::Hulls { "hulls" } else { "meshes" };
    Scatter {
        title,
        x_label: format!("mean model error: distance of the {of} less that answered (part of the larger diameter)"),
        y_label: "time of a query (µs)".into(),
        groups,
        stairs: vec![
            stairs("Pareto front of ours", Ink::Blue, false, true),
            stairs("Pareto front of the peers", Ink::Orange, true, false),
        ],
        edge: Some("exact".into()),
        named: None,
    }
    .to_svg()
}
