//! Why a state is in contact: every pair, how deep, and what frees it.

use std::sync::Arc;

use sublevel_core::body::Solid;
use sublevel_robot::{JointKind, Kinematics};

use super::answer::{Answer, Verdict};
use super::clearance::{Clearance, ClearanceRow, StateClearance};
use super::decide::compare;
use super::invalid_state::InvalidState;
use super::least_change::least_change;
use super::placed::JointValues;
use super::states::{Certainty, StateVerdict, is_exact};
use super::states_error::StatesError;
use crate::crew::{Question, Stop};
use crate::geometry::Geometry;
use crate::object::Slot;
use crate::robot::places;
use crate::scene::Scene;

/// How far beyond its threshold a pair is moved to free it, metres: what joint values change is
/// known to first order only.
const GUARD_M: f64 = 1e-3;

/// Relative error of how fast a signed distance grows along a normal: the square of the angle
/// between the normal and the true one.
const NORMAL: f64 = 1e-6;

/// Changes of joint values, one after the other, until the search for free ones is given up.
const MAX_CHANGES: usize = 30;

/// Starts of the search for free values: the state, and values around it.
const MAX_STARTS: usize = 12;

/// How much farther each start is from the state than the one before, radians and metres.
const FIRST_SHIFT: f64 = 0.08;

/// Largest change of all values together in one step, radians and metres: first order is no guide
/// beyond.
const MAX_CHANGE: f64 = 0.3;

/// A pair that is in contact, or may be.
#[derive(Clone, Debug)]
pub struct ExplainedPair {
    /// The two objects; the first is one that the state places.
    pub pair: [Slot; 2],
    /// Signed distance, with witnesses, normal and gradients.
    pub answer: Answer,
    /// Padding of the pair, metres.
    pub padding_m: f64,
    /// Whether the contact is proven, not only possible.
    pub is_contact: bool,
    /// Whether it is one of the objects inside the bodies.
    pub certainty: Certainty,
    /// The first object, moved by this along the normal, metres, is as far from the second as the
    /// margin and the padding ask for, since signed distances of convex bodies grow at least as
    /// fast along their gradient. None where a body has several parts or need not be convex, and
    /// without a normal.
    pub separation_m: Option<f64>,
    /// Derivatives of the signed distance with respect to the values of the joints that are named,
    /// metres per radian or per metre: along them the joints free the pair. Empty of states that
    /// are poses, NaN where there is no gradient.
    pub joint_gradient: Vec<f64>,
}

/// What is known of a state.
#[derive(Clone, Debug)]
pub struct ExplainedState {
    /// What it is.
    pub verdict: StateVerdict,
    /// Every pair in contact and every undecided one, the deepest first.
    pub pairs: Vec<ExplainedPair>,
    /// Values of the joints that are named, near those that were asked about, with which the robot
    /// is free: proven. None of free states, of states that are poses, and where none were found.
    pub freed: Option<Vec<f64>>,
    /// Why it is invalid, if it is.
    pub invalid: Option<Box<InvalidState>>,
}

/// One state, with all its contacts.
#[derive(Debug)]
pub struct Explanation {
    scene: Scene,
    margin_m: f64,
    include_allowed: bool,
    state: ExplainedPlacement,
}

/// Where the objects are.
#[derive(Debug)]
enum ExplainedPlacement {
    /// Objects, and their packed poses.
    Poses(Vec<Slot>, Vec<f64>),
    /// A robot, all of its joint values, and which of these are named.
    Joints { robot: Arc<str>, values: Vec<f64>, named: Vec<usize> },
}

impl Explanation {
    /// One state of some objects as packed poses, as in [`States::new`](super::States::new).
    ///
    /// # Errors
    /// No object, one twice, and numbers that are not one state.
    pub fn new(
        scene: Scene,
        slots: &[Slot],
        poses: Vec<f64>,
        margin_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        // Refused now, not by the question.
        let states = Clearance::new(scene.clone(), slots, poses.clone(), margin_m, include_allowed)?.states();
        if states != 1 {
            return Err(StatesError::Several(states));
        }
        let state = ExplainedPlacement::Poses(slots.to_vec(), poses);
        Ok(Self { scene, margin_m, include_allowed, state })
    }

    /// One state of a robot: the values of the joints that are named, or of all. Without values it
    /// is the state of the robot in the scene.
    ///
    /// # Errors
    /// A robot or a joint that is not there, a joint twice, and numbers that are not one state.
    pub fn of_joints(
        scene: Scene,
        asked: JointValues<'_>,
        margin_m: f64,
        include_allowed: bool,
    ) -> Result<Self, StatesError> {
        let JointValues { robot, joints, values } = asked;
        let instance = scene.robot(robot).ok_or_else(|| StatesError::NoRobot(robot.into()))?;
        let named = places(instance.robot().kinematics(), joints).map_err(StatesError::Joints)?;
        if named.is_empty() {
            return Err(StatesError::NoJoints(robot.into()));
        }
        let mut all = instance.configuration().to_vec();
        if !values.is_empty() {
            if values.len() != named.len() {
                return Err(StatesError::OneState { numbers: values.len(), per_state: named.len() });
            }
            named.iter().zip(values).for_each(|(&place, value)| all[place] = value);
        }
        Clearance::of_joints(
            scene.clone(),
            JointValues { robot, joints: &[], values: all.clone() },
            margin_m,
            include_allowed,
        )?;
        let state = ExplainedPlacement::Joints { robot: robot.into(), values: all, named };
        Ok(Self { scene, margin_m, include_allowed, state })
    }

    /// The pairs whose signed distance less their padding is below a bound, of these joint values
    /// or of the state that was asked about; none where the question has ended.
    fn near(&self, values: Option<&[f64]>, influence_m: f64, stop: &Stop) -> Option<StateClearance> {
        let (scene, allowed) = (self.scene.clone(), self.include_allowed);
        let clearance = match &self.state {
            ExplainedPlacement::Poses(slots, poses) => {
                Clearance::new(scene, slots, poses.clone(), influence_m, allowed)
            }
            ExplainedPlacement::Joints { robot, values: asked, .. } => {
                let values = values.unwrap_or(asked).to_vec();
                Clearance::of_joints(scene, JointValues { robot, joints: &[], values }, influence_m, allowed)
            }
        };
        clearance.ok()?.solve(0, stop).pop()
    }

    fn threshold_m(&self, row: &ClearanceRow) -> f64 {
        self.margin_m + row.padding_m
    }

    fn explained(&self, row: ClearanceRow, joint_gradient: &[f64]) -> Option<ExplainedPair> {
        let (threshold, answer) = (self.threshold_m(&row), row.answer);
        if answer.lower > threshold {
            return None;
        }
        let is_contact = compare::against(answer.lower, answer.upper, threshold) == Verdict::Yes;
        let exact = |slot: &Slot| self.scene.object(*slot).is_some_and(|object| is_exact(object));
        let is_certain = is_contact && row.pair.iter().all(exact);
        // The bound and the normal may be of different directions within the bracket.
        let separation_m = (threshold - answer.lower + (answer.upper - answer.lower).abs()) * (1.0 + NORMAL);
        let is_convex = row.pair.iter().all(|slot| self.is_one_convex_piece(*slot));
        let separation_m = Some(separation_m).filter(|length| length.is_finite() && is_convex);
        let joint_gradient = match &self.state {
            ExplainedPlacement::Joints { named, .. } => {
                named.iter().map(|&place| joint_gradient.get(place).copied().unwrap_or(f64::NAN)).collect()
            }
            ExplainedPlacement::Poses(..) => Vec::new(),
        };
        Some(ExplainedPair {
            pair: row.pair,
            padding_m: row.padding_m,
            is_contact,
            certainty: if is_certain { Certainty::Certain } else { Certainty::Possible },
            separation_m: separation_m.filter(|_| answer.normal.is_some()),
            joint_gradient,
            answer,
        })
    }

    fn is_one_convex_piece(&self, slot: Slot) -> bool {
        self.scene.object(slot).is_some_and(|object| match &object.geometry {
            Geometry::Capsule(_) | Geometry::HalfSpace(_) => true,
            Geometry::SosBody(_) => false,
            _ => object.solids().last().is_some_and(|solid| solid.parts().len() == 1),
        })
    }

    /// Joint values near those of the state with which every pair is farther apart than its
    /// threshold. Where the search from there finds none, it starts from values around them,
    /// farther and farther away: bodies may lie in each other so that every direction is as good.
    fn freed(&self, stop: &Stop) -> Option<Vec<f64>> {
        let ExplainedPlacement::Joints { robot, values, named } = &self.state else { return None };
        let kinematics = self.scene.robot(robot)?.robot().kinematics().clone();
        let limits = limits(&kinematics);
        (0..MAX_STARTS).find_map(|start| {
            let mut from = values.clone();
            for (index, &place) in named.iter().enumerate() {
                let [least, most] = limits[place];
                from[place] = (from[place] + FIRST_SHIFT * start as f64 * spread(start, index)).clamp(least, most);
            }
            normalise_quaternions(&kinematics, &mut from);
            self.freed_from(from, (&kinematics, &limits, named), stop)
        })
    }

    /// The same from other values: again and again the least change that moves all near pairs
    /// beyond their thresholds, to first order.
    fn freed_from(
        &self,
        mut values: Vec<f64>,
        (kinematics, limits, named): (&Kinematics, &[[f64; 2]], &[usize]),
        stop: &Stop,
    ) -> Option<Vec<f64>> {
        for _ in 0..MAX_CHANGES {
            let near = self.near(Some(&values), self.margin_m + GUARD_M, stop)?;
            if !near.checked {
                return None;
            }
            if near.rows.iter().all(|row| row.answer.lower > self.threshold_m(row)) {
                return Some(named.iter().map(|&place| values[place]).collect());
            }
            let width = kinematics.width().max(1);
            let wanted = near.rows.iter().zip(near.joint_gradients.chunks(width)).filter_map(|(row, gradient)| {
                let of_named: Vec<f64> = named.iter().map(|&place| gradient[place]).collect();
                // Of some pairs no depth is known; then the upper bound says in which direction.
                let Answer { lower, upper, .. } = row.answer;
                let missing = self.threshold_m(row) + GUARD_M - if lower.is_finite() { lower } else { upper };
                let is_known = missing.is_finite() && of_named.iter().all(|derivative| derivative.is_finite());
                is_known.then_some((of_named, missing))
            });
            let ranges: Vec<[f64; 2]> =
                named.iter().map(|&place| limits[place].map(|limit| limit - values[place])).collect();
            let change = least_change(&wanted.collect::<Vec<_>>(), &ranges)?;
            let length = change.iter().map(|change| change * change).sum::<f64>().sqrt();
            let share = (MAX_CHANGE / length).min(1.0);
            for (&place, change) in named.iter().zip(&change) {
                values[place] = (values[place] + share * change).clamp(limits[place][0], limits[place][1]);
            }
            normalise_quaternions(kinematics, &mut values);
        }
        None
    }
}

/// Numbers between -1 and 1 that fill the box evenly (a Kronecker sequence).
fn spread(start: usize, index: usize) -> f64 {
    const GOLDEN: f64 = 0.618_033_988_749_894_8;
    2.0 * ((start * (index + 1)) as f64 * (GOLDEN + 0.071 * index as f64)).fract() - 1.0
}

/// Least and largest value of each number of a configuration.
fn limits(kinematics: &Kinematics) -> Vec<[f64; 2]> {
    let mut limits = vec![[f64::NEG_INFINITY, f64::INFINITY]; kinematics.width()];
    for variable in kinematics.variables() {
        if let Some(range) = variable.limits {
            limits[variable.first] = [range.lower, range.upper];
        }
    }
    limits
}

/// Makes the quaternions of floating joints units.
fn normalise_quaternions(kinematics: &Kinematics, values: &mut [f64]) {
    for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
        let quaternion = &mut values[variable.first + 3..variable.first + 7];
        let norm = quaternion.iter().map(|value| value * value).sum::<f64>().sqrt();
        if norm > 0.0 {
            quaternion.iter_mut().for_each(|value| *value /= norm);
        }
    }
}

impl Question for Explanation {
    type Part = ExplainedState;

    fn chunks(&self) -> usize {
        1
    }

    fn solve(&self, _: usize, stop: &Stop) -> ExplainedState {
        // It was accepted when it was asked.
        let StateClearance { rows, joint_gradients, checked, invalid } =
            self.near(None, self.margin_m, stop).unwrap_or_default();
        if invalid.is_some() {
            return ExplainedState { verdict: StateVerdict::Invalid, pairs: Vec::new(), freed: None, invalid };
        }
        let width = joint_gradients.len() / rows.len().max(1);
        let gradient = |row: usize| &joint_gradients[row * width..(row + 1) * width];
        let explained = rows.into_iter().enumerate().filter_map(|(row, near)| self.explained(near, gradient(row)));
        let mut pairs: Vec<ExplainedPair> = explained.collect();
        pairs.sort_by(|a, b| (a.answer.lower - a.padding_m).total_cmp(&(b.answer.lower - b.padding_m)));
        let verdict = match pairs.iter().any(|pair| pair.is_contact) {
            true => StateVerdict::Contact,
            false if !checked => StateVerdict::NotChecked,
            false if pairs.is_empty() => StateVerdict::Free,
            false => StateVerdict::Undecided,
        };
        let freed = if pairs.is_empty() || !checked { None } else { self.freed(stop) };
        ExplainedState { verdict, pairs, freed, invalid }
    }
}
