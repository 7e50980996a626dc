//! Pictures of the arm: time against states kept.

use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter, stacked};

use super::rows::{ALL, COAL, MotionRow, StateRow};

/// Length of the edges that the picture of motions shows, radians.
const SHOWN_RAD: f64 = 1.0;

/// µs per state against the share of the known-free states that is lost, over all families.
pub(super) fn chart_of_states(states: &[StateRow]) -> Result<String, ChartError> {
    let group = |label: &str, ink, marker, is_coal: bool, time: fn(&StateRow) -> f64| {
        let of_kind = |row: &&StateRow| row.family == ALL && (row.representation == COAL) == is_coal;
        let rows = states.iter().filter(of_kind);
        Group { label: label.into(), ink, marker, points: points(rows, NONE_LOST, time), joined: false }
    };
    let groups = vec![
        group("among obstacles, one thread", Ink::Blue, Marker::Disc, false, |row| row.scene_us),
        unnamed(group("with self-collision, one thread", Ink::Green, Marker::Triangle, false, |row| row.self_us)),
        unnamed(group("the same over gRPC, all cores", Ink::Purple, Marker::Ring, false, |row| row.call_us)),
        group("coal among obstacles, cached", Ink::Orange, Marker::Cross, true, |row| row.scene_us),
    ];
    scatter("States of a Panda among boxes and cylinders", "time of a state (µs)", NONE_LOST, groups)
}

/// The same, a chart for each of these families.
pub(super) fn chart_of_families(states: &[StateRow], families: &[&str]) -> Result<String, ChartError> {
    let chart = |family: &&str| {
        let group = |label: &str, ink, marker, is_coal: bool, time: fn(&StateRow) -> f64| {
            let of_kind = |row: &&StateRow| row.family == *family && (row.representation == COAL) == is_coal;
            let rows = states.iter().filter(of_kind);
            Group { label: label.into(), ink, marker, points: points(rows, NONE_OF_FAMILY_LOST, time), joined: false }
        };
        let groups = vec![
            group("among obstacles", Ink::Blue, Marker::Disc, false, |row| row.scene_us),
            unnamed(group("with self-collision", Ink::Green, Marker::Triangle, false, |row| row.self_us)),
            group("coal among obstacles, cached", Ink::Orange, Marker::Cross, true, |row| row.scene_us),
        ];
        scatter(&format!("States of {family}, one thread"), "time of a state (µs)", NONE_OF_FAMILY_LOST, groups)
    };
    Ok(stacked(&families.iter().map(chart).collect::<Result<Vec<_>, _>>()?))
}

/// Time across, the share of the known-free states that is lost up.
fn points<'a>(rows: impl Iterator<Item = &'a StateRow>, none: f64, time: fn(&StateRow) -> f64) -> Vec<Point> {
    rows.map(|row| Point { x: time(row), y: lost(row, none), label: row.representation.clone() }).collect()
}

fn unnamed(mut group: Group) -> Group {
    group.points.iter_mut().for_each(|point| point.label.clear());
    group
}

/// µs per radian against the share of the known-free states that is lost, over all families.
pub(super) fn chart_of_motions(states: &[StateRow], motions: &[MotionRow]) -> Result<String, ChartError> {
    let rows = || motions.iter().filter(|row| row.family == ALL && row.length_rad == SHOWN_RAD);
    let share = |name: &str| {
        let row = states.iter().find(|row| row.family == ALL && row.representation == name);
        row.map_or(f64::NAN, |row| lost(row, NONE_LOST))
    };
    let group = |label: &str, ink, marker, is_named: bool, time: fn(&MotionRow) -> f64| {
        let point = |row: &MotionRow| {
            let label = if is_named { row.representation.clone() } else { String::new() };
            Point { x: time(row) / row.length_rad, y: share(&row.representation), label }
        };
        Group { label: label.into(), ink, marker, points: rows().map(point).collect(), joined: false }
    };
    // One cross: the first representation whose edges coal takes.
    let of_coal = rows().find(|row| row.coal_us.is_finite()).into_iter();
    let of_coal = of_coal.map(|row| Point { x: row.coal_us / row.length_rad, y: share(COAL), label: COAL.into() });
    let groups = vec![
        group("proven", Ink::Blue, Marker::Disc, true, |row| row.mean_us),
        group("our checks of samples at 1/32 rad", Ink::Green, Marker::Triangle, false, |row| row.sampled_us),
        Group {
            label: "coal's checks, 32 per radian".into(),
            ink: Ink::Orange,
            marker: Marker::Cross,
            points: of_coal.collect(),
            joined: false,
        },
    ];
    let title = "Edges of 1 rad of a Panda that are free: proven and sampled";
    scatter(title, "time of a radian (µs)", NONE_LOST, groups)
}

/// Where a share of nothing is drawn, per cent: one state of 1 400 is 0.07 %, and one of the 200 of
/// a family 0.5 %.
const NONE_LOST: f64 = 0.03;
const NONE_OF_FAMILY_LOST: f64 = 0.25;

fn lost(row: &StateRow, none: f64) -> f64 {
    (100.0 * (1.0 - row.kept_share())).max(none)
}

fn scatter(title: &str, x_label: &str, none: f64, groups: Vec<Group>) -> Result<String, ChartError> {
    Scatter {
        title: title.into(),
        x_label: x_label.into(),
        y_label: format!("known-free states lost (%; {none} for none)"),
        groups: groups.into_iter().filter(|group| !group.points.is_empty()).collect(),
        stairs: Vec::new(),
        edge: None,
        named: None,
    }
    .to_svg()
}
