//! What is kept from query to query: the covers of sets.

use super::cover::Cover;
use super::distance::{PairDivision, SetDistance, are_one};
use super::goal::Goal;
use super::limits::Limits;
use super::minimise::{Minimum, minimise};
use super::placed_set::{BoundedSet, PlacedSet, PlacedSetError};
use super::single::{SetHeight, SetLevelDistance, SetPointDistance};
use crate::body::BodyId;
use crate::measure::{HalfSpace, Status};
use nalgebra::Vector3;
use std::collections::HashMap;

/// Most memory of the covers that are kept, bytes.
const MAX_BYTES: usize = 32 << 20;

/// Brackets by branch and bound, with the covers of the sets of earlier questions. One for each
/// thread.
#[derive(Debug, Default)]
pub struct BranchAndBound {
    covers: HashMap<BodyId, Cover>,
    /// Memory of the covers, bytes.
    bytes: usize,
}

impl BranchAndBound {
    /// Without covers.
    pub fn new() -> Self {
        Self::default()
    }

    /// Euclidean distance of two sets: 0 where they have a common point. The threshold of the
    /// limits is a length in metres; with 0 it ends when the sets are proven apart or a common
    /// point is found.
    ///
    /// # Errors
    /// Which set cannot be used, and why.
    pub fn distance(
        &mut self,
        a: &PlacedSet<'_>,
        b: &PlacedSet<'_>,
        limits: &Limits<'_>,
    ) -> Result<SetDistance, (usize, PlacedSetError)> {
        a.frame().map_err(|error| (0, error))?;
        b.frame().map_err(|error| (1, error))?;
        let empty = SetDistance {
            status: Status::Converged,
            lower_m: f64::INFINITY,
            upper_m: f64::INFINITY,
            points: None,
            steps: 0,
        };
        let Some(first) = self.take(&a.of).map_err(|error| (0, error))? else { return Ok(empty) };
        let mut covers = vec![first];
        let of = if are_one(&a.of, &b.of) {
            [0, 0]
        } else {
            let Some(second) = self.take(&b.of).map_err(|error| (1, error))? else { return Ok(empty) };
            covers.push(second);
            [0, 1]
        };
        let found = PairDivision { sets: [a, b], covers: &mut covers, of }.distance(limits);
        for (cover, set) in covers.into_iter().zip([&a.of, &b.of]) {
            self.keep(set, cover);
        }
        found
    }

    /// Level distance d(A‖B) = min max_i g_i(x) over the points x of B, the g those of A. The
    /// threshold of the limits is a level; with 1 it ends when
    /// they are proven apart or a common point is found.
    ///
    /// # Errors
    /// Which set cannot be used, and why.
    pub fn level_distance(
        &mut self,
        a: &PlacedSet<'_>,
        b: &PlacedSet<'_>,
        limits: &Limits<'_>,
    ) -> Result<SetLevelDistance, (usize, PlacedSetError)> {
        a.frame().map_err(|error| (0, error))?;
        b.frame().map_err(|error| (1, error))?;
        let goal = |cover: &Cover| Goal::level(b, cover, a).map_err(|error| (1, error));
        let found = self.over(b, f64::NEG_INFINITY, limits, goal).map_err(|(side, error)| (1 - side, error))?;
        Ok(SetLevelDistance {
            status: found.status,
            lower: found.lower,
            upper: found.upper,
            point: found.point,
            steps: found.steps,
        })
    }

    /// Signed distance of a set from a half-space of the common frame.
    ///
    /// # Errors
    /// Why the set cannot be used.
    pub fn height(
        &mut self,
        set: &PlacedSet<'_>,
        over: &HalfSpace,
        limits: &Limits<'_>,
    ) -> Result<SetHeight, PlacedSetError> {
        set.frame()?;
        let offset = over.offset();
        // Widths and thresholds are of the difference.
        let goal = |_: &Cover| Ok(Goal::Height { normal: *over.normal(), offset });
        let found = self.over(set, f64::NEG_INFINITY, limits, goal).map_err(|(_, error)| error)?;
        Ok(SetHeight {
            status: found.status,
            lower_m: found.lower,
            upper_m: found.upper,
            point: found.point,
            steps: found.steps,
        })
    }

    /// Distance of a set from a point of the common frame, metres.
    ///
    /// # Errors
    /// Why the set cannot be used.
    pub fn distance_to_point(
        &mut self,
        set: &PlacedSet<'_>,
        point: &Vector3<f64>,
        limits: &Limits<'_>,
    ) -> Result<SetPointDistance, PlacedSetError> {
        set.frame()?;
        let inside = set.membership().is_some_and(|member| member.contains(point));
        if inside {
            let (status, point) = (Status::Converged, Some(*point));
            return Ok(SetPointDistance { status, lower_m: 0.0, upper_m: 0.0, point, steps: 0 });
        }
        let found = self.over(set, 0.0, limits, |_| Ok(Goal::From(*point))).map_err(|(_, error)| error)?;
        Ok(SetPointDistance {
            status: found.status,
            lower_m: found.lower,
            upper_m: found.upper,
            point: found.point,
            steps: found.steps,
        })
    }

    /// The least value of a goal over a set, not below `known`.
    fn over<'a>(
        &mut self,
        set: &PlacedSet<'_>,
        known: f64,
        limits: &Limits<'_>,
        goal: impl FnOnce(&Cover) -> Result<Goal<'a>, (usize, PlacedSetError)>,
    ) -> Result<Minimum, (usize, PlacedSetError)> {
        let Some(mut cover) = self.take(&set.of).map_err(|error| (0, error))? else { return Ok(Minimum::OF_NOTHING) };
        let goal = goal(&cover)?;
        let found = minimise(set, &mut cover, &goal, known, limits).map_err(|error| (0, error));
        self.keep(&set.of, cover);
        found
    }

    /// The cover of a set, or a new one; none of a set that is empty.
    fn take(&mut self, of: &BoundedSet<'_>) -> Result<Option<Cover>, PlacedSetError> {
        let kept = of.id.and_then(|id| self.covers.remove(&id));
        self.bytes -= kept.as_ref().map_or(0, Cover::bytes);
        match kept.filter(|cover| cover.is_of(of)) {
            Some(cover) => Ok(Some(cover)),
            None => Cover::new(of),
        }
    }

    /// Keeps a cover for the next query, in place of others where memory is short.
    fn keep(&mut self, of: &BoundedSet<'_>, cover: Cover) {
        let Some(id) = of.id.filter(|_| cover.bytes() <= MAX_BYTES) else { return };
        while self.bytes + cover.bytes() > MAX_BYTES {
            let Some(other) = self.covers.keys().next().copied() else { break };
            self.bytes -= self.covers.remove(&other).map_or(0, |cover| cover.bytes());
        }
        self.bytes += cover.bytes();
        self.covers.insert(id, cover);
    }
}
