//! What is said of a robot.

use std::io::{self, Write};

use serde::Serialize;

use super::link_fit::FittedLink;
use super::pairs::Pairs;
use crate::body::{Body, Solid};
use crate::client::StoredRobot;
use crate::robot::{GroupState, Joint, Kinematics, Semantics, counted};
use crate::scene::{Geometry, Robot};

/// A robot as it would be loaded.
#[derive(Serialize)]
pub(super) struct Report {
    robot: String,
    id: String,
    /// Values of a joint vector.
    width: usize,
    joints: Vec<JointRow>,
    links: Vec<LinkRow>,
    /// Links without geometry.
    frames: usize,
    /// Pairs of links with geometry that are checked against each other.
    checked_pairs: usize,
    /// Pairs that may touch: neighbours, and what the SRDF disables.
    allowed_pairs: usize,
    groups: Vec<String>,
    /// Named states of the groups, in the order of the SRDF.
    group_states: Vec<StateRow>,
    warnings: Vec<String>,
    /// Whether a server has made it; none without a server.
    created: Option<bool>,
    /// Which pairs of links can touch; none unless that was asked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pairs: Option<Pairs>,
}

#[derive(Serialize)]
struct JointRow {
    name: String,
    lower: Option<f64>,
    upper: Option<f64>,
}

#[derive(Serialize)]
struct StateRow {
    name: String,
    group: String,
    /// The joints with values of their own that it sets, in the order of joint vectors.
    joints: Vec<StateJoint>,
}

#[derive(Serialize)]
struct StateJoint {
    name: String,
    /// As many as the joint takes: radians, metres, a unit quaternion.
    values: Vec<f64>,
}

#[derive(Serialize)]
struct LinkRow {
    link: String,
    body: String,
    degree: usize,
    parts: usize,
    /// How far it reaches beyond the convex hull of the link, or of its parts, metres; 0 of
    /// primitives.
    gap_m: Option<f64>,
    /// "exact", "fitted" or "kept" from an earlier run.
    source: &'static str,
}

impl Report {
    pub(super) fn new(robot: &Robot, semantics: &Semantics, fits: &[FittedLink]) -> Self {
        let kinematics = robot.kinematics();
        let with_geometry: Vec<usize> =
            (0..robot.links().len()).filter(|&link| robot.links()[link].is_some()).collect();
        let pairs =
            || with_geometry.iter().enumerate().flat_map(|(k, &a)| with_geometry[k + 1..].iter().map(move |&b| (a, b)));
        let allowed_pairs = pairs().filter(|&(a, b)| robot.may_touch(a, b)).count();
        let links = kinematics.links().iter().zip(robot.links()).filter_map(|(name, link)| {
            let link = link.as_ref()?;
            let fit = fits.iter().find(|fit| fit.link == *name);
            Some(LinkRow::new(name, &link.geometry, fit))
        });
        let joints = kinematics.variables().iter().map(|variable| JointRow {
            name: variable.name.to_string(),
            lower: variable.limits.map(|limits| limits.lower),
            upper: variable.limits.map(|limits| limits.upper),
        });
        Self {
            robot: robot.name().to_string(),
            id: robot.id().to_string(),
            width: kinematics.width(),
            joints: joints.collect(),
            links: links.collect(),
            frames: robot.links().len() - with_geometry.len(),
            checked_pairs: pairs().count() - allowed_pairs,
            allowed_pairs,
            groups: semantics.groups.iter().map(|group| group.name.to_string()).collect(),
            group_states: semantics.states.iter().map(|state| StateRow::new(state, semantics, kinematics)).collect(),
            warnings: semantics.warnings.iter().map(ToString::to_string).collect(),
            created: None,
            pairs: None,
        }
    }

    /// The robot is loaded.
    pub(super) fn loaded(&mut self, robot: &StoredRobot) {
        self.created = Some(robot.created);
    }

    /// The pairs of links were looked at.
    pub(super) fn derived(&mut self, pairs: Pairs) {
        self.pairs = Some(pairs);
    }

    pub(super) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let width = self.links.iter().map(|row| row.link.chars().count()).max().unwrap_or(0).max(4);
        writeln!(out, "{:width$}  degree  parts   gap mm  source", "link")?;
        for row in &self.links {
            let gap = row.gap_m.map_or_else(|| "-".to_owned(), |gap| format!("{:.1}", 1e3 * gap));
            let degree = if row.degree == 0 { "-".to_owned() } else { row.degree.to_string() };
            writeln!(out, "{:width$}  {degree:>6}  {:>5}  {gap:>7}  {}", row.link, row.parts, row.source)?;
        }
        writeln!(
            out,
            "robot {}: {}, {}, {}; {}, {} may touch",
            self.robot,
            counted(self.links.len(), "link with geometry", "links with geometry"),
            counted(self.frames, "frame", "frames"),
            counted(self.width, "joint value", "joint values"),
            counted(self.checked_pairs, "pair of links is checked", "pairs of links are checked"),
            self.allowed_pairs
        )?;
        let state = match self.created {
            None => "",
            Some(true) => ", loaded",
            Some(false) => ", loaded before",
        };
        writeln!(out, "id {}{state}", self.id)?;
        self.group_states.iter().try_for_each(|state| state.write(out))?;
        self.pairs.as_ref().map_or(Ok(()), |pairs| pairs.write(out))
    }
}

impl StateRow {
    fn new(state: &GroupState, semantics: &Semantics, kinematics: &Kinematics) -> Self {
        let own = state.own_values(&kinematics.description().joints);
        let joint =
            |(joint, values): (&Joint, &[f64])| StateJoint { name: joint.name.to_string(), values: values.to_vec() };
        Self {
            name: state.name.to_string(),
            group: semantics.groups[state.group].name.to_string(),
            joints: own.into_iter().map(joint).collect(),
        }
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        let mut joints = Vec::new();
        for StateJoint { name, values } in &self.joints {
            let values: Vec<String> = values.iter().map(ToString::to_string).collect();
            joints.push(format!("{name} {}", values.join(" ")));
        }
        let joints = if joints.is_empty() { "no joint with values of its own".to_owned() } else { joints.join(", ") };
        writeln!(out, "state {} of group {}: {joints}", self.name, self.group)
    }
}

impl LinkRow {
    fn new(name: &str, geometry: &Geometry, fit: Option<&FittedLink>) -> Self {
        let (degree, parts, gap_m) = match geometry {
            Geometry::Solid(shape) => {
                (shape.parts().iter().map(Body::degree).max().unwrap_or(0), shape.parts().len(), shape.gap_m())
            }
            _ => (0, 1, Some(0.0)),
        };
        Self {
            link: name.to_owned(),
            body: geometry.id().to_string(),
            degree: fit.map_or(degree, |fit| fit.degree),
            parts: fit.map_or(parts, |fit| fit.parts),
            gap_m,
            source: fit.map_or("exact", |fit| if fit.was_kept { "kept" } else { "fitted" }),
        }
    }
}
