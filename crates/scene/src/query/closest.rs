//! The closest pair.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::answer::Answer;
use super::ask::{Ask, AskError, Measure};
use super::candidates::Candidates;
use super::decide::decide;
use super::selection::Selection;
use super::solver::{Pair, Solver};
use super::thing::{PairSlots, Thing};
use super::{Found, Verdict};
use crate::crew::{Crew, Panicked, Question, Stop};
use crate::object::Slot;
use crate::scene::Scene;

/// Objects of a chunk.
const CHUNK: usize = 16;

/// The pair with the smallest signed distance less its padding, among those nearer than a reach.
#[derive(Debug)]
pub struct Closest {
    candidates: Candidates,
    /// Signed distance first, then what is asked for.
    ask: Ask,
    signed: Ask,
    reach_m: f64,
    /// Bits of the smallest upper bound so far, plus an offset that keeps their order.
    best: AtomicU64,
}

impl Closest {
    fn new(scene: Scene, ask: Ask, selection: Selection, reach_m: f64) -> Result<Self, AskError> {
        let mut signed = Ask::new(vec![Measure::Signed])?;
        (signed.cold, signed.include_allowed) = (ask.cold, ask.include_allowed);
        let candidates = Candidates::new(scene, selection, ask.include_allowed);
        Ok(Self { candidates, ask, signed, reach_m, best: AtomicU64::new(ordered(reach_m)) })
    }

    fn solver<'a>(&'a self, ask: &'a Ask, stop: &'a Stop) -> Solver<'a> {
        let cache = (!self.ask.cold).then_some(&*self.candidates.scene().cache);
        Solver { ask, cache, stop }
    }

    fn pair(&self, [a, b]: [Slot; 2]) -> Option<Pair<'_>> {
        let scene = self.candidates.scene();
        let thing = |slot| Some(Thing::object(scene.object(slot)?, scene.pose_at(slot)));
        Some(Pair { a: thing(a)?, b: thing(b)?, slots: Some(PairSlots { a, b }) })
    }

    /// Measures of the pair that was found.
    fn answers(&self, pair: [Slot; 2], stop: &Stop) -> Vec<Answer> {
        let solver = self.solver(&self.ask, stop);
        let Some(things) = self.pair(pair) else { return Vec::new() };
        (0..self.ask.measures().len()).map(|index| solver.measure(index, &things)).collect()
    }
}

impl Question for Closest {
    /// The nearest pair of the chunk with its clearance, metres; and whether all was looked at.
    type Part = (Option<([Slot; 2], f64)>, bool);

    fn chunks(&self) -> usize {
        self.candidates.len().div_ceil(CHUNK)
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> Self::Part {
        let scene = self.candidates.scene();
        let solver = self.solver(&self.signed, stop);
        let mut nearest: Option<([Slot; 2], f64)> = None;
        for index in chunk * CHUNK..((chunk + 1) * CHUNK).min(self.candidates.len()) {
            if stop.is_set() {
                return (nearest, false);
            }
            let mut partners = Vec::new();
            let reach = from_ordered(self.best.load(Ordering::Relaxed));
            self.candidates.visit(index, reach.max(0.0), |a, b| partners.push([a, b]));
            for slots in partners {
                let Some(pair) = self.pair(slots) else { continue };
                let padding = scene.padding_m(slots[0], slots[1]);
                let best = from_ordered(self.best.load(Ordering::Relaxed));
                let options = self.signed.options(0, stop);
                if decide(&solver, &pair, best + padding, options).verdict == Verdict::No {
                    continue;
                }
                let found = solver.measure(0, &pair);
                let clearance = if found.value.is_finite() { found.value } else { found.lower } - padding;
                if clearance < self.reach_m && nearest.is_none_or(|(_, least)| clearance < least) {
                    nearest = Some((slots, clearance));
                    self.best.fetch_min(ordered(clearance), Ordering::Relaxed);
                }
            }
        }
        (nearest, true)
    }
}

/// A number whose order as an integer is that of the float.
fn ordered(value: f64) -> u64 {
    let bits = value.to_bits();
    if bits >> 63 == 0 { bits | 1 << 63 } else { !bits }
}

fn from_ordered(bits: u64) -> f64 {
    f64::from_bits(if bits >> 63 == 1 { bits & !(1 << 63) } else { !bits })
}

/// Finds the closest pair nearer than `max_distance_m`, by reaches that double until one is in
/// them; and whether the search was completed. Blocks.
///
/// # Errors
/// When a chunk panicked, or the question was abandoned.
pub fn closest_pair(
    crew: &Crew,
    stop: &Arc<Stop>,
    (scene, ask): (&Scene, &Ask),
    selection: &Selection,
    max_distance_m: f64,
) -> Result<(Option<Found>, bool), Panicked> {
    let mut reach_m = first_reach(scene).min(max_distance_m);
    loop {
        let Ok(question) = Closest::new(scene.clone(), ask.clone(), selection.clone(), reach_m) else {
            return Err(Panicked);
        };
        let question = Arc::new(question);
        let parts = crew.ask(question.clone(), stop.clone())?;
        let complete = parts.iter().all(|(_, complete)| *complete);
        let ranks = &scene.structure.ranks;
        let rank = |pair: &[Slot; 2]| pair.map(|slot| ranks[slot as usize]);
        let nearest = parts.into_iter().filter_map(|(nearest, _)| nearest);
        let nearest = nearest.min_by(|(p, a), (q, b)| a.total_cmp(b).then(rank(p).cmp(&rank(q))));
        if let Some((pair, _)) = nearest {
            let answers = question.answers(pair, stop);
            return Ok((Some(Found { pair, answers }), complete));
        }
        if !complete || reach_m >= max_distance_m.min(MOST_REACH_M) {
            return Ok((None, complete));
        }
        reach_m = (8.0 * reach_m).min(max_distance_m);
    }
}

/// Poses are at most 1e15 m from the origin.
const MOST_REACH_M: f64 = 1e16;

/// About the size of an object: the pair that is nearest is rarely much farther apart.
fn first_reach(scene: &Scene) -> f64 {
    let radii = scene.structure.objects().filter_map(|(_, object)| object.ball()).map(|ball| ball.radius);
    let least = radii.fold(f64::INFINITY, f64::min);
    if least.is_finite() { least } else { 1.0 }
}
