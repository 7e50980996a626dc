//! The least value of a function over one set: cells, the lowest first.

use super::active_set::{ActiveSet, Objective};
use super::cover::Cover;
use super::goal::Goal;
use super::limits::Limits;
use super::placed_set::{PlacedSet, PlacedSetError};
use super::placing::Placing;
use super::waiting::Waiting;
use crate::measure::Status;
use nalgebra::Vector3;
use std::collections::BinaryHeap;

/// A bracket of the least value, in the unit of the goal.
pub(super) struct Minimum {
    pub(super) status: Status,
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) point: Option<Vector3<f64>>,
    pub(super) steps: usize,
}

impl Minimum {
    /// Over a set without points.
    pub(super) const OF_NOTHING: Self =
        Self { status: Status::Converged, lower: f64::INFINITY, upper: f64::INFINITY, point: None, steps: 0 };
}

/// Divides until the limits are reached. With `known`, a lower bound that is valid anyway.
pub(super) fn minimise(
    set: &PlacedSet<'_>,
    cover: &mut Cover,
    goal: &Goal<'_>,
    known: f64,
    limits: &Limits<'_>,
) -> Result<Minimum, PlacedSetError> {
    let placing = Placing::new(set, cover)?;
    let member = set.membership().ok_or(PlacedSetError::Normalization)?;
    let search = ActiveSet::new([set]);
    let mut best: Option<(f64, Vector3<f64>)> = None;
    let improve = |start: Vector3<f64>, best: &mut Option<(f64, Vector3<f64>)>| {
        let on_boundary = search.minimiser(goal, [start], true);
        let inside = goal.may_be_inside().then(|| search.minimiser(goal, [start], false));
        for [point] in [Some([start]), on_boundary, inside.flatten()].into_iter().flatten() {
            let Some(point) = member.pulled(point) else { continue };
            let value = goal.value_up(&point);
            if value.is_nan() {
                continue;
            }
            let value = value.max(known);
            if best.is_none_or(|(least, _)| value < least) {
                *best = Some((value, point));
            }
        }
    };
    let mut waiting = BinaryHeap::from([Waiting { lower: known, place: 0 }]);
    let (mut settled, mut steps, mut next_search) = (f64::INFINITY, 0, 0);
    let (lower, status) = loop {
        let upper = best.map_or(f64::INFINITY, |best| best.0);
        let lower = waiting.peek().map_or(settled, |cell| cell.lower.min(settled)).min(upper);
        let narrow = limits.narrow(lower, upper, goal.scale(), steps);
        if narrow || limits.decided(lower, upper) || lower == f64::INFINITY {
            break (lower, Status::Converged);
        }
        if limits.exhausted(steps) {
            break (lower, Status::BracketWide);
        }
        let Some(Waiting { lower: known, place: cell }) = waiting.pop() else { break (lower, Status::BracketWide) };
        if steps >= next_search {
            improve(placing.center(cover.cell(cell)), &mut best);
            next_search = steps + 1 + steps / 2;
        }
        steps += 1;
        if !cover.is_divisible(cell) {
            settled = settled.min(known);
            continue;
        }
        let upper = best.map_or(f64::INFINITY, |best| best.0);
        let enough = limits.enough(upper, goal.scale());
        for half in cover.halves(&set.of, cell) {
            let lower = goal.floor(&placing, cover, cover.cell(half)).max(known);
            if lower >= enough {
                settled = settled.min(lower);
            } else {
                waiting.push(Waiting { lower, place: half });
            }
        }
    };
    let upper = best.map_or(f64::INFINITY, |best| best.0);
    Ok(Minimum { status, lower, upper, point: best.map(|best| best.1), steps })
}
