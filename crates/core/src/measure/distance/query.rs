//! A question about the distance of two bodies.

use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::V3;
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;

/// Two bodies with their poses, and how much of their distance is asked for.
#[derive(Clone, Copy)]
pub(super) struct Query<'a> {
    pub(super) of_a: (&'a Body, &'a Pose),
    pub(super) of_b: (&'a Body, &'a Pose),
    pub(super) goal: &'a StopCriterion,
    pub(super) options: &'a Options<'a>,
    /// About the normal across the gap, if that is known: unit vector from B to A, A's frame.
    pub(super) facing: Option<V3<f64>>,
}
