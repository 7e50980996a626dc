//! Packed states: poses of objects, or joint values of a robot.

use std::sync::Arc;

use nalgebra::{Isometry3, Vector3};
use sublevel_core::measure::{Pose, PoseError, Twist};
use sublevel_robot::PlaceError;

use super::around::Around;
use super::invalid_state::InvalidState;
use super::moving::Moving;
use super::states_error::StatesError;
use super::thing::Thing;
use crate::poses::compose;
use crate::robot::{Robot, RobotInstance, isometry, link_error_m, places, pose_of};

/// Poses of one object in a packed state: translation, then quaternion x y z w.
pub(crate) const POSE_NUMBERS: usize = 7;

/// Rounding of one product of poses, per metre.
const ROUNDING: f64 = 32.0 * f64::EPSILON;

/// Where everything that moves stands in one state. Kept from state to state.
#[derive(Debug, Default)]
pub(crate) struct State {
    /// World poses of all moving objects.
    pub(crate) poses: Vec<Pose>,
    /// What contains each; none of half-spaces.
    around: Vec<Option<Around>>,
    /// How far each may be from where exact arithmetic puts it, metres; empty: not at all.
    errors: Vec<f64>,
    /// Joint values of a robot.
    configuration: Vec<f64>,
    /// World poses of its links.
    links: Vec<Isometry3<f64>>,
    link_errors: Vec<PlaceError>,
}

impl State {
    /// What contains a moving object, by its position.
    pub(crate) fn around(&self, index: usize) -> Option<&Around> {
        self.around[index].as_ref()
    }

    /// How far points of a moving object may be from where exact arithmetic puts them, metres.
    pub(crate) fn error_m(&self, index: usize) -> f64 {
        self.errors.get(index).copied().unwrap_or(0.0)
    }
}

/// Packed states, and how they place the objects that they name.
#[derive(Debug)]
pub(crate) enum Packed {
    /// Poses of so many objects, 7 numbers each.
    Poses { objects: usize, numbers: Vec<f64> },
    /// Joint values of a robot.
    Joints(JointStates),
}

/// States of a robot by the values of its joints.
#[derive(Debug)]
pub(crate) struct JointStates {
    robot: Arc<Robot>,
    base: Isometry3<f64>,
    /// Values of joints that the states do not name.
    rest: Vec<f64>,
    /// Where the values of a state are in a configuration.
    places: Vec<usize>,
    numbers: Vec<f64>,
}

impl JointStates {
    /// Packed values of some joints, of all where none is named; the others are as in the scene.
    pub(crate) fn new(
        instance: &RobotInstance<'_>,
        joints: &[Arc<str>],
        numbers: Vec<f64>,
    ) -> Result<Self, StatesError> {
        let places = places(instance.robot().kinematics(), joints).map_err(StatesError::Joints)?;
        let per_state = places.len();
        if numbers.is_empty() {
            return Err(StatesError::NoJointState);
        }
        if per_state == 0 || !numbers.len().is_multiple_of(per_state) {
            return Err(StatesError::JointNumbers { numbers: numbers.len(), per_state });
        }
        let (robot, base, rest) = (instance.robot().clone(), isometry(instance.base()), instance.configuration());
        Ok(Self { robot, base, rest: rest.to_vec(), places, numbers })
    }
}

impl Packed {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Poses { objects, numbers } => numbers.len() / (objects * POSE_NUMBERS),
            Self::Joints(joints) => joints.numbers.len() / joints.places.len(),
        }
    }

    /// Places all moving objects in a state.
    ///
    /// # Errors
    /// Numbers that are no pose or no joint values, and a link or a held object that is too far
    /// away to have a pose.
    pub(crate) fn place(&self, index: usize, moving: &[Moving], state: &mut State) -> Result<(), InvalidState> {
        state.poses.clear();
        state.errors.clear();
        match self {
            Self::Poses { objects, numbers } => {
                let per_state = objects * POSE_NUMBERS;
                let numbers = &numbers[index * per_state..(index + 1) * per_state];
                for pose in numbers.as_chunks::<POSE_NUMBERS>().0 {
                    let &[x, y, z, i, j, k, w] = pose;
                    let pose = Pose::from_quaternion(Vector3::new(x, y, z), [i, j, k, w]);
                    let at = state.poses.len();
                    state.poses.push(pose.map_err(|error| self.no_pose(index, (moving, at), error))?);
                }
            }
            Self::Joints(joints) => joints.place(index, moving, state)?,
        }
        // What is not placed by now is held.
        for (at, held) in moving.iter().enumerate().skip(state.poses.len()) {
            let Some((holder, place)) = &held.holder else { break };
            let pose = compose(&state.poses[*holder], place);
            state.poses.push(pose.map_err(|error| self.no_pose(index, (moving, at), error))?);
        }
        let around = |(moving, pose): (&Moving, &Pose)| Around::new(&Thing::object(&moving.object, pose));
        state.around.clear();
        state.around.extend(moving.iter().zip(&state.poses).map(around));
        if matches!(self, Self::Joints(_)) {
            for (moving, pose) in moving.iter().zip(&state.poses) {
                let error = moving.link.map_or(f64::INFINITY, |link| {
                    link_error_m(&state.links[link], &state.link_errors[link], moving.reach_m)
                });
                let products = f64::from(moving.holders);
                let held = products * ROUNDING * (moving.reach_m + pose.translation().norm());
                state.errors.push(error + held);
            }
        }
        Ok(())
    }

    /// Why a state is invalid in which a moving object, by its position, has no pose.
    #[cold]
    fn no_pose(&self, index: usize, (moving, at): (&[Moving], usize), error: PoseError) -> InvalidState {
        let pose = match self {
            Self::Poses { objects, .. } => {
                let mut named = at;
                while let Some((holder, _)) = &moving[named].holder {
                    named = *holder;
                }
                Some(index * objects + named)
            }
            Self::Joints(_) => None,
        };
        InvalidState::Pose { object: moving[at].object.name.clone(), pose, error }
    }

    /// The states where they are joint values.
    pub(crate) fn joints(&self) -> Option<&JointStates> {
        match self {
            Self::Poses { .. } => None,
            Self::Joints(joints) => Some(joints),
        }
    }
}

impl JointStates {
    fn place(&self, index: usize, moving: &[Moving], state: &mut State) -> Result<(), InvalidState> {
        state.configuration.clear();
        state.configuration.extend_from_slice(&self.rest);
        let width = self.places.len();
        for (place, value) in self.places.iter().zip(&self.numbers[index * width..(index + 1) * width]) {
            state.configuration[*place] = *value;
        }
        let kinematics = self.robot.kinematics();
        kinematics.check(&state.configuration)?;
        kinematics.forward(&self.base, &state.configuration, &mut state.links);
        kinematics.forward_errors(&state.links, &state.configuration, &mut state.link_errors);
        for moving in moving.iter().take_while(|moving| moving.holder.is_none()) {
            let Some(link) = moving.link else { break };
            let pose = pose_of(&state.links[link]);
            let no_pose = |error| InvalidState::Pose { object: moving.object.name.clone(), pose: None, error };
            state.poses.push(pose.map_err(no_pose)?);
        }
        Ok(())
    }

    /// Number of values of a state.
    pub(crate) fn width(&self) -> usize {
        self.places.len()
    }

    /// Adds the derivatives of a quantity with respect to the values of a state to `row`, of
    /// [`JointStates::width`] numbers. `twists` are its derivatives with respect to the poses of
    /// moving objects; `all` is space for one row over all joints.
    pub(crate) fn add_gradients<'a>(
        &self,
        state: &State,
        twists: impl Iterator<Item = (&'a Moving, &'a Pose, &'a Twist)>,
        all: &mut Vec<f64>,
        row: &mut [f64],
    ) {
        let kinematics = self.robot.kinematics();
        all.clear();
        all.resize(kinematics.width(), 0.0);
        for (moving, pose, twist) in twists {
            let Some(link) = moving.link else { continue };
            let (at, twist) = ((link, pose.translation()), (&twist.linear, &twist.angular));
            kinematics.add_gradient(&state.links, &state.configuration, at, twist, all);
        }
        for (value, place) in row.iter_mut().zip(&self.places) {
            *value += all[*place];
        }
    }
}
