//! Questions about a snapshot: pairs, everything within a margin, the closest pair, contact,
//! states, clearances, rays. Each is a [`Question`](crate::crew::Question) for a
//! [`Crew`](crate::Crew).
//!
//! `thing` is what stands in a pair; `solve` measures a pair, `sets` one of which a side need not
//! be convex, `decide` compares it with a threshold, `certain`
//! where poses are rounded. The questions are in files of their own.

mod answer;
mod around;
mod ask;
mod candidates;
mod capsules;
mod certain;
mod clearance;
mod closest;
mod decide;
mod explanation;
mod invalid_state;
mod least_change;
mod motions;
mod moving;
mod packed;
mod pairs;
mod placed;
mod rays;
mod selection;
mod sets;
mod solve;
mod solver;
mod states;
mod states_error;
mod thing;
mod within;

pub use answer::{Answer, AnswerStatus, Verdict};
pub use ask::{Ask, AskError, Measure, Motions};
pub use clearance::{Clearance, ClearanceRow, StateClearance};
pub use closest::{Closest, closest_pair};
pub use explanation::{ExplainedPair, ExplainedState, Explanation};
pub use invalid_state::InvalidState;
pub use motions::{MotionSettings, MovingObject, PathKind, RobotMotionAnswer, RobotMotions, RobotMotionsError};
pub use pairs::{Operand, Pairs, PairsError};
pub use placed::JointValues;
pub use rays::{RayAnswer, Rays, RaysError};
pub use selection::Selection;
pub use states::{Certainty, StateAnswer, StateVerdict, States};
pub use states_error::StatesError;
pub use within::{Found, Within, combined};
