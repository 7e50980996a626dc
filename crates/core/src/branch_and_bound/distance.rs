//! Distance of two sets: pairs of boxes, the nearest first.

use super::cover::{Cell, CellIndex, Cover};
use super::limits::Limits;
use super::local_search::{NearPoints, PairSearch};
use super::placed_set::{BoundedSet, PlacedSet, PlacedSetError};
use super::placing::Placing;
use super::waiting::Waiting;
use crate::measure::Status;
use nalgebra::Vector3;
use std::collections::BinaryHeap;

/// Most pairs that wait to be divided: 64 MB.
const MAX_WAITING: usize = 1 << 22;

/// A bracket of the Euclidean distance of two sets; lengths in metres, points in the common frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SetDistance {
    /// Whether the bracket is as narrow as asked for, or the comparison decided.
    pub status: Status,
    /// Proven lower bound; 0 where the sets are not proven apart, ∞ if a set is empty.
    pub lower_m: f64,
    /// Distance of two points that are proven to lie in the sets; 0 if one lies in both, ∞ if none
    /// were found.
    pub upper_m: f64,
    /// These points.
    pub points: Option<[Vector3<f64>; 2]>,
    /// Pairs of boxes that were divided.
    pub steps: usize,
}

/// Two sets with their covers, which may be one and the same.
pub(super) struct PairDivision<'a, 'b> {
    pub(super) sets: [&'a PlacedSet<'a>; 2],
    pub(super) covers: &'b mut [Cover],
    /// Which of the covers is of which set.
    pub(super) of: [usize; 2],
}

/// Planes that keep two cells apart: across a few directions, until one proves enough.
struct Planes<'a> {
    placings: &'a [Placing; 2],
    /// Rounding of the heights of both, metres.
    slack_m: f64,
    /// Unit vector from the nearest points found so far, from the first set to the second.
    towards: Option<Vector3<f64>>,
    /// Distance beyond which no better bound is needed, metres.
    enough_m: f64,
}

impl PairDivision<'_, '_> {
    /// Divides until the limits are reached.
    pub(super) fn distance(self, limits: &Limits<'_>) -> Result<SetDistance, (usize, PlacedSetError)> {
        let placing =
            |side: usize| Placing::new(self.sets[side], &self.covers[self.of[side]]).map_err(|error| (side, error));
        let placings = [placing(0)?, placing(1)?];
        let slack = placings[0].slack_m + placings[1].slack_m;
        let search = PairSearch::new(self.sets).ok_or((0, PlacedSetError::Normalization))?;
        let mut best: Option<NearPoints> = None;
        let mut waiting = BinaryHeap::from([Waiting { lower: 0.0, place: [0; 2] }]);
        // Least bound of the pairs that are not divided further.
        let (mut settled, mut steps, mut next_search) = (f64::INFINITY, 0, 0);
        let (lower, status) = loop {
            let upper = best.map_or(f64::INFINITY, |best| best.0);
            let lower = waiting.peek().map_or(settled, |pair| pair.lower.min(settled)).min(upper);
            let narrow = limits.narrow(lower, upper, 0.0, steps);
            if narrow || upper == 0.0 || limits.decided(lower, upper) || lower == f64::INFINITY {
                break (lower, Status::Converged);
            }
            if limits.exhausted(steps) || waiting.len() >= MAX_WAITING {
                break (lower, Status::BracketWide);
            }
            let Some(Waiting { lower: known, place: cells }) = waiting.pop() else {
                break (lower, Status::BracketWide);
            };
            let both = [0, 1].map(|side| self.covers[self.of[side]].cell(cells[side]));
            if steps >= next_search {
                let start = [placings[0].center(both[0]), placings[1].center(both[1])];
                let found = search.from(start).into_iter().flatten().chain(best);
                best = found.min_by(|a, b| a.0.total_cmp(&b.0));
                next_search = steps + 1 + steps / 2;
            }
            steps += 1;
            let side = usize::from(both[1].radius_m > both[0].radius_m);
            let side = if self.covers[self.of[side]].is_divisible(cells[side]) { side } else { 1 - side };
            if !self.covers[self.of[side]].is_divisible(cells[side]) {
                settled = settled.min(known);
                continue;
            }
            let upper = best.map_or(f64::INFINITY, |best| best.0);
            let enough = limits.enough(upper, 0.0);
            let towards = best.and_then(|(_, [x, y])| (y - x).try_normalize(0.0));
            let planes = Planes { placings: &placings, slack_m: slack, towards, enough_m: enough };
            for half in self.covers[self.of[side]].halves(&self.sets[side].of, cells[side]) {
                let mut cells = cells;
                cells[side] = half;
                let lower = self.lower_bound(&planes, cells, known);
                if lower >= enough {
                    settled = settled.min(lower);
                } else {
                    waiting.push(Waiting { lower, place: cells });
                }
            }
        };
        let upper_m = best.map_or(f64::INFINITY, |best| best.0);
        Ok(SetDistance { status, lower_m: lower.max(0.0), upper_m, points: best.map(|best| best.1), steps })
    }

    /// Lower bound of the distance of what is in two cells, at least `known`, metres.
    fn lower_bound(&self, planes: &Planes<'_>, cells: [CellIndex; 2], known: f64) -> f64 {
        let placings = planes.placings;
        let covers = self.of.map(|of| &self.covers[of]);
        let [a, b] = [0, 1].map(|side| covers[side].cell(cells[side]));
        let between = (placings[1].center(b) - placings[0].center(a)).try_normalize(0.0);
        let outwards = |side: usize, cell: &Cell| {
            let cut = covers[side].cuts(cell).first()?;
            (self.sets[side].linear().tr_mul(&cut.gradient)).try_normalize(0.0)
        };
        let mut lower = known;
        let mut across = |n: Option<Vector3<f64>>| {
            if let Some(n) = n {
                let gap = placings[1].least_along(&n, covers[1], b) + placings[0].least_along(&-n, covers[0], a);
                lower = lower.max((gap - planes.slack_m) * (1.0 - 4.0 * f64::EPSILON));
            }
            lower >= planes.enough_m
        };
        let _ =
            across(between) || across(planes.towards) || across(outwards(0, a)) || across(outwards(1, b).map(|n| -n));
        lower
    }
}

/// Whether two sets are one and the same, and share their cover.
pub(super) fn are_one(a: &BoundedSet<'_>, b: &BoundedSet<'_>) -> bool {
    a.id.is_some() && a.id == b.id && a.bounding_box == b.bounding_box
}
