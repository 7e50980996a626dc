//! The figures of the arm in short.

use super::edges::KINDS;
use super::representation::Representation;
use super::rows::{ALL, COAL, MotionRow, StateRow, Tables};

/// A figure.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub(super) struct Figure {
    /// What it is about.
    pub(super) what: String,
    /// What it is; NaN where it was not measured.
    pub(super) value: f64,
    /// How it is written.
    #[serde(skip)]
    pub(super) unit: Unit,
}

/// How a figure is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Unit {
    /// A share of 1 as per cent.
    Share,
    /// A number of things.
    Count,
    /// A ratio.
    Ratio,
}

/// The representation whose states and edges the figures are about.
pub(super) const MAIN: Representation = Representation::Default;

impl Unit {
    /// A value as text.
    pub(super) fn text(self, value: f64) -> String {
        match self {
            _ if value.is_nan() => "not measured".into(),
            Self::Share => format!("{:.2} %", 100.0 * value),
            Self::Count => format!("{value:.0}"),
            Self::Ratio => format!("{value:.2}"),
        }
    }
}

/// The figures over all families.
pub(super) fn summary(tables: &Tables) -> Vec<Figure> {
    let Tables { states, motions, meshes, srdf, .. } = tables;
    let (main, mut all) = (MAIN.name(), Vec::new());
    let mut add = |what: String, value: f64, unit: Unit| all.push(Figure { what, value, unit });
    for links in [MAIN, Representation::Degree6, Representation::Compound, Representation::AtMostTwo] {
        let value = of_all(states, links.name()).map_or(f64::NAN, StateRow::kept_share);
        add(format!("known-free states kept, {}", links.name()), value, Unit::Share);
    }
    let contacts = of_all(states, main).and_then(|row| row.contacts).map_or(f64::NAN, |contacts| contacts as f64);
    add(format!("states anywhere that {main} calls free and coal's hulls in contact"), contacts, Unit::Count);
    if let Some(row) = meshes.iter().find(|row| row.representation == main) {
        let what = format!("of {} states anywhere, those that {main} calls free and in which meshes meet", row.states);
        add(what, row.missed as f64, Unit::Count);
    }
    for row in srdf {
        let what = format!("of the {} pairs that the SRDF says never touch, proven", row.never);
        add(what, row.proven as f64, Unit::Count);
        add("time of all pairs, s".into(), row.seconds, Unit::Ratio);
    }
    add_states(tables, &mut add);
    add_edges(tables, &mut add);
    let all_rows = || motions.iter().filter(|row| row.family == ALL);
    let samples: usize = all_rows().map(|row| row.samples).sum();
    let contacts: usize = all_rows().map(|row| row.contacts).sum();
    add(format!("contacts among {samples} samples of edges that are proven free"), contacts as f64, Unit::Count);
    let rows = || all_rows().filter(|row| row.representation == main);
    let of_coal = |value: fn(&MotionRow) -> Option<usize>| rows().filter_map(value).reduce(|sum, count| sum + count);
    if let (Some(samples), Some(contacts)) = (of_coal(|row| row.coal_samples), of_coal(|row| row.coal_contacts)) {
        add(format!("contacts of coal's hulls among {samples} of them"), contacts as f64, Unit::Count);
    }
    all
}

/// The row over all families of a representation.
fn of_all<'a>(states: &'a [StateRow], name: &str) -> Option<&'a StateRow> {
    states.iter().find(|row| row.family == ALL && row.representation == name)
}

/// Figures of states.
fn add_states(tables: &Tables, add: &mut impl FnMut(String, f64, Unit)) {
    let (row, coal) = (of_all(&tables.states, MAIN.name()), of_all(&tables.states, COAL));
    let own = |value: fn(&StateRow) -> f64| row.map_or(f64::NAN, value);
    let of_coal = |value: fn(&StateRow) -> f64| own(value) / coal.map_or(f64::NAN, value);
    add(
        "state among obstacles, poses of the links given, of coal with cached guesses".into(),
        of_coal(|row| row.given_us),
        Unit::Ratio,
    );
    add(
        "state among obstacles, kinematics included, of coal with cached guesses".into(),
        of_coal(|row| row.scene_us),
        Unit::Ratio,
    );
    add("the same with self-collision, of the one before".into(), own(|row| row.self_us / row.scene_us), Unit::Ratio);
    add("distances of all pairs of a state, of coal".into(), of_coal(|row| row.distances_us), Unit::Ratio);
    add(
        "CheckStates over gRPC in batches of 1 000, of in process".into(),
        own(|row| row.call_us / row.inside_us),
        Unit::Ratio,
    );
}

/// Figures of edges.
fn add_edges(tables: &Tables, add: &mut impl FnMut(String, f64, Unit)) {
    let state_us = of_all(&tables.states, MAIN.name()).map_or(f64::NAN, |row| row.self_us);
    let of_kind = |kind: usize| {
        let is_kind = |row: &&MotionRow| {
            let at = KINDS[kind];
            let is_own = row.family == ALL && row.representation == MAIN.name();
            is_own && row.from == at.from() && row.length_rad == at.length_rad
        };
        tables.motions.iter().find(is_kind)
    };
    let of_edge = |kind: usize, value: fn(&MotionRow) -> f64| of_kind(kind).map_or(f64::NAN, value);
    let kinds = ["free edge of 0.5 rad from a goal", "free edge of 1 rad", "free edge of 5 rad"];
    for (kind, what) in kinds.into_iter().enumerate() {
        let units = [("in state checks", state_us), ("in checks of its samples", of_edge(kind, MotionRow::sample_us))];
        for (words, unit_us) in units {
            let [median, p99] = [of_edge(kind, |row| row.median_us), of_edge(kind, |row| row.p99_us)];
            add(format!("{what}, median, {words}"), median / unit_us, Unit::Ratio);
            add(format!("{what}, 99th percentile, {words}"), p99 / unit_us, Unit::Ratio);
        }
    }
    type OfRow = fn(&MotionRow) -> f64;
    let at_a_radian: [(&str, OfRow); 4] = [
        ("verification of a certificate, of the search that writes it, at 1 rad", |row| {
            row.verify_us / row.certified_us
        }),
        ("the same, of the search that writes none, median at 1 rad", |row| row.verify_part),
        ("proof, of our own checks of samples at 1/32 rad, at 1 rad", |row| row.mean_us / row.sampled_us),
        ("proof, of coal's checks of as many samples, at 1 rad", |row| row.mean_us / row.coal_us),
    ];
    for (what, value) in at_a_radian {
        add(what.to_owned(), of_edge(1, value), Unit::Ratio);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn figures_that_were_not_measured_say_so() {
        let figures = summary(&Tables::default());
        let unmeasured = figures.iter().filter(|figure| figure.unit.text(figure.value) == "not measured");
        assert!(unmeasured.count() > 10);
        assert_eq!([Unit::Share.text(0.998), Unit::Count.text(3.0)], ["99.80 %", "3"]);
    }

    #[test]
    fn figures_are_those_of_the_default() {
        let state = |representation: &str, us: f64| StateRow {
            family: ALL.into(),
            representation: representation.into(),
            pieces: 11,
            known: 4,
            kept: 3,
            kept_self: 3,
            random: 0,
            random_free: 0,
            contacts: None,
            cold_us: us,
            scene_us: us,
            given_us: 0.5 * us,
            self_us: 3.0 * us,
            distances_us: 10.0 * us,
            call_us: 5.0,
            inside_us: 4.0,
        };
        let edge = MotionRow {
            family: ALL.into(),
            representation: MAIN.name().into(),
            from: KINDS[1].from().into(),
            length_rad: KINDS[1].length_rad,
            problems: 2,
            free: 2,
            mean_us: 50.0,
            median_us: 48.0,
            p99_us: 96.0,
            configurations: 7.0,
            sampled_us: 100.0,
            coal_us: 200.0,
            certified_us: 80.0,
            verify_us: 20.0,
            verify_part: 0.375,
            samples: 2000,
            contacts: 0,
            coal_samples: Some(66),
            coal_contacts: Some(1),
        };
        let tables = Tables {
            states: vec![
                state(MAIN.name(), 4.0),
                state("degree 6", 2.0),
                StateRow { given_us: 8.0, ..state(COAL, 8.0) },
            ],
            motions: vec![edge],
            ..Tables::default()
        };
        let value = |figures: &[Figure], what: &str| {
            let found: Vec<f64> = figures.iter().filter(|own| own.what == what).map(|own| own.value).collect();
            assert_eq!(found.len(), 1, "{what}");
            found[0]
        };
        let figures = summary(&tables);
        for (what, expected) in [
            ("known-free states kept, degree 6 refined, as by default", 0.75),
            ("state among obstacles, poses of the links given, of coal with cached guesses", 0.25),
            ("state among obstacles, kinematics included, of coal with cached guesses", 0.5),
            ("distances of all pairs of a state, of coal", 0.5),
            ("the same with self-collision, of the one before", 3.0),
            ("CheckStates over gRPC in batches of 1 000, of in process", 1.25),
            ("free edge of 1 rad, median, in state checks", 4.0),
            ("free edge of 1 rad, 99th percentile, in state checks", 8.0),
            ("verification of a certificate, of the search that writes it, at 1 rad", 0.25),
            ("the same, of the search that writes none, median at 1 rad", 0.375),
            ("proof, of our own checks of samples at 1/32 rad, at 1 rad", 0.5),
            ("proof, of coal's checks of as many samples, at 1 rad", 0.25),
            ("contacts of coal's hulls among 66 of them", 1.0),
        ] {
            assert_eq!(value(&figures, what), expected, "{what}");
        }
    }
}
