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

/// The representation that most figures are about.
const MAIN: Representation = Representation::Degree6;

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
pub(super) fn summary(Tables { states, motions, meshes, srdf, .. }: &Tables) -> Vec<Figure> {
    let row = |name: &str| states.iter().find(|row| row.family == ALL && row.representation == name);
    let of = |name: &str, value: fn(&StateRow) -> f64| row(name).map_or(f64::NAN, value);
    let (main, coal) = (MAIN.name(), row(COAL));
    let of_coal = |value: fn(&StateRow) -> f64| coal.map_or(f64::NAN, value);
    let contacts = row(main).and_then(|row| row.contacts).map_or(f64::NAN, |contacts| contacts as f64);
    let mut all = Vec::new();
    let mut add = |what: String, value: f64, unit: Unit| {
        all.push(Figure { what, value, unit });
    };
    for links in [MAIN, Representation::Refined, Representation::Compound, Representation::AtMostTwo] {
        let what = format!("known-free states kept, {}", links.name());
        add(what, of(links.name(), StateRow::kept_share), Unit::Share);
    }
    // Earlier runs did not have it.
    if let Some(default) = row(Representation::Default.name()) {
        let name = Representation::Default.name();
        add(format!("known-free states kept, links {name}"), default.kept_share(), Unit::Share);
        add(
            format!("state among obstacles, links {name}, of coal with cached guesses"),
            default.scene_us / of_coal(|row| row.scene_us),
            Unit::Ratio,
        );
    }
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
    add(
        format!("state among obstacles, {main}, kinematics included, of coal with cached guesses"),
        of(main, |row| row.scene_us) / of_coal(|row| row.scene_us),
        Unit::Ratio,
    );
    add(
        "the same with self-collision, of the one before".into(),
        of(main, |row| row.self_us / row.scene_us),
        Unit::Ratio,
    );
    add(
        format!("distances of all pairs of a state, {main}, of coal"),
        of(main, |row| row.distances_us) / of_coal(|row| row.distances_us),
        Unit::Ratio,
    );
    add(
        "CheckStates over gRPC in batches of 1 000, of in process".into(),
        of(main, |row| row.call_us / row.inside_us),
        Unit::Ratio,
    );
    let state_us = of(main, |row| row.self_us);
    let of_kind = |kind: usize| {
        let is_kind = |row: &&MotionRow| {
            let at = KINDS[kind];
            row.family == ALL && row.representation == main && row.from == at.from() && row.length_rad == at.length_rad
        };
        motions.iter().find(is_kind)
    };
    let of_edge = |kind: usize, value: fn(&MotionRow) -> f64| of_kind(kind).map_or(f64::NAN, value);
    let kinds = ["free edge of 0.5 rad from a goal", "free edge of 1 rad", "free edge of 5 rad"];
    for (kind, what) in kinds.into_iter().enumerate() {
        let units = [("in state checks", state_us), ("in checks of its samples", of_edge(kind, MotionRow::sample_us))];
        for (words, unit_us) in units {
            add(format!("{what}, median, {words}"), of_edge(kind, |row| row.median_us) / unit_us, Unit::Ratio);
            add(format!("{what}, 99th percentile, {words}"), of_edge(kind, |row| row.p99_us) / unit_us, Unit::Ratio);
        }
    }
    let edge = "at 1 rad";
    add(
        format!("verification of a certificate, of the search that writes it, {edge}"),
        of_edge(1, |row| row.verify_us / row.certified_us),
        Unit::Ratio,
    );
    add(
        format!("the same, of the search that writes none, median {edge}"),
        of_edge(1, |row| row.verify_part),
        Unit::Ratio,
    );
    add(
        format!("proof, of our own checks of samples at 1/32 rad, {edge}"),
        of_edge(1, |row| row.mean_us / row.sampled_us),
        Unit::Ratio,
    );
    add(
        format!("proof, of coal's checks of as many samples, {edge}"),
        of_edge(1, |row| row.mean_us / row.coal_us),
        Unit::Ratio,
    );
    let all_rows = || motions.iter().filter(|row| row.family == ALL);
    let samples: usize = all_rows().map(|row| row.samples).sum();
    let contacts: usize = all_rows().map(|row| row.contacts).sum();
    add(format!("contacts among {samples} samples of edges that are proven free"), contacts as f64, Unit::Count);
    let of_coal =
        |value: fn(&MotionRow) -> Option<usize>| all_rows().filter_map(value).reduce(|sum, count| sum + count);
    if let (Some(samples), Some(contacts)) = (of_coal(|row| row.coal_samples), of_coal(|row| row.coal_contacts)) {
        add(format!("contacts of coal's hulls among {samples} of them, {main}"), contacts as f64, Unit::Count);
    }
    all
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
}
