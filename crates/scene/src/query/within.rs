//! Everything within a margin, and the first contact.

use std::sync::atomic::{AtomicBool, Ordering};

use sublevel_core::measure::{Options, WithinMargin, within_margin};

use super::answer::{Answer, AnswerStatus, Verdict};
use super::ask::{Ask, Measure};
use super::candidates::Candidates;
use super::decide::{compare, decide};
use super::selection::Selection;
use super::solver::{Pair, Solids, Solver};
use super::thing::{PairSlots, Thing};
use crate::crew::{Question, Stop};
use crate::object::Slot;
use crate::scene::Scene;

/// Objects of a chunk.
const CHUNK: usize = 16;

/// Most objects that are asked about, and pairs that may be near, of a question that is answered
/// where it is asked.
const BRIEF_OBJECTS: usize = 2;
const BRIEF_PAIRS: usize = 16;

/// A pair that is not proven to be beyond the margin.
#[derive(Clone, Debug)]
pub struct Found {
    /// The two, in the order of their names.
    pub pair: [Slot; 2],
    /// All measures, in the order asked.
    pub answers: Vec<Answer>,
}

/// All pairs whose signed distance is not proven to be at least a margin and their padding.
#[derive(Debug)]
pub struct Within {
    candidates: Candidates,
    ask: Ask,
    margin_m: f64,
    /// Whether one pair, proven to be nearer, is enough.
    first_only: bool,
    found: AtomicBool,
}

impl Within {
    /// All pairs within a margin, metres.
    pub fn new(scene: Scene, ask: Ask, selection: Selection, margin_m: f64) -> Self {
        let candidates = Candidates::new(scene, selection, ask.include_allowed);
        Self { candidates, ask, margin_m, first_only: false, found: AtomicBool::new(false) }
    }

    /// One pair within a margin, metres, whichever is found first.
    pub fn first(scene: Scene, ask: Ask, selection: Selection, margin_m: f64) -> Self {
        Self { first_only: true, ..Self::new(scene, ask, selection, margin_m) }
    }

    /// The pair's answers unless it is beyond the threshold; and whether it is proven to be nearer.
    fn look(&self, solver: &Solver<'_>, pair: &Pair<'_>, threshold: f64) -> Option<(Vec<Answer>, bool)> {
        let measures = self.ask.measures();
        let mut known = None;
        let nearer;
        // The distance that decides is the answer to the one that is asked for.
        if let (Some(index), true) =
            (measures.iter().position(|&measure| measure == Measure::Distance), threshold >= 0.0)
            && let (
                Thing::Solid { rungs: rungs_a, pose: pose_a, set: None },
                Thing::Solid { rungs: rungs_b, pose: pose_b, set: None },
            ) = (&pair.a, &pair.b)
            && let ([a], [b]) = (rungs_a, rungs_b)
        {
            let options = self.ask.options(index, solver.stop);
            let found = solver.warm(pair.slots, [0; 2], Measure::Distance, |warm| {
                within_margin(&**a, pose_a, &**b, pose_b, threshold, &options, warm)
            });
            let Ok(WithinMargin::Within(found)) = found else { return None };
            nearer = found.upper < threshold || found.upper == 0.0;
            known = Some((index, solver.distance(&found, &Solids { a, pose_a, b, pose_b })));
        } else if let (Some(index), true) = (
            measures.iter().position(|measure| matches!(measure, Measure::Distance | Measure::Signed)),
            threshold >= 0.0,
        ) && pair.has_capsule()
        {
            if pair.a.box_gap_m(&pair.b) > threshold {
                return None;
            }
            let found = solver.capsule_within(pair, threshold, &self.ask.options(index, solver.stop))?;
            nearer = compare::against(found.lower, found.upper, threshold) == Verdict::Yes;
            known = Some((index, solver.answer_of_capsule(measures[index], pair, &found)));
        } else {
            let found = decide(solver, pair, threshold, Options::default().with_stop(solver.stop.flag()));
            if found.verdict == Verdict::No {
                return None;
            }
            nearer = found.verdict == Verdict::Yes;
        }
        let answer = |index: usize| match known {
            Some((known, answer)) if known == index => answer,
            _ => solver.measure(index, pair),
        };
        Some(((0..measures.len()).map(answer).collect(), nearer))
    }
}

impl Question for Within {
    /// Pairs, and whether the chunk was looked at whole.
    type Part = (Vec<Found>, bool);

    fn chunks(&self) -> usize {
        self.candidates.len().div_ceil(CHUNK)
    }

    fn is_brief(&self) -> bool {
        if self.candidates.len() > BRIEF_OBJECTS || self.ask.measures() != [Measure::Distance] {
            return false;
        }
        let (scene, mut pairs) = (self.candidates.scene(), 0);
        let is_single = |slot: Slot| scene.object(slot).is_some_and(|object| object.geometry.is_single());
        for index in 0..self.candidates.len() {
            self.candidates.visit(index, self.margin_m, |a, b| {
                pairs += if is_single(a) && is_single(b) { 1 } else { BRIEF_PAIRS };
            });
        }
        pairs <= BRIEF_PAIRS
    }

    fn solve(&self, chunk: usize, stop: &Stop) -> Self::Part {
        let scene = self.candidates.scene();
        let cache = (!self.ask.cold).then_some(&*scene.cache);
        let solver = Solver { ask: &self.ask, cache, stop };
        let mut found = Vec::new();
        for index in chunk * CHUNK..((chunk + 1) * CHUNK).min(self.candidates.len()) {
            if stop.is_set() {
                return (found, false);
            }
            let mut partners = Vec::new();
            self.candidates.visit(index, self.margin_m, |a, b| partners.push([a, b]));
            for [a, b] in partners {
                if self.first_only && self.found.load(Ordering::Relaxed) {
                    return (found, true);
                }
                let thing = |slot| Some(Thing::object(scene.object(slot)?, scene.pose_at(slot)));
                let (Some(thing_a), Some(thing_b)) = (thing(a), thing(b)) else { continue };
                let pair = Pair { a: thing_a, b: thing_b, slots: Some(PairSlots { a, b }) };
                let threshold = self.margin_m + scene.padding_m(a, b);
                if let Some((answers, nearer)) = self.look(&solver, &pair, threshold)
                    && (nearer || !self.first_only)
                {
                    found.push(Found { pair: [a, b], answers });
                    self.found.store(true, Ordering::Relaxed);
                }
            }
        }
        (found, true)
    }
}

/// The pairs of all chunks in the order of names, and whether every chunk was looked at whole.
pub fn combined(scene: &Scene, parts: Vec<(Vec<Found>, bool)>) -> (Vec<Found>, bool) {
    let complete = parts.iter().all(|(_, complete)| *complete);
    let mut found: Vec<Found> = parts.into_iter().flat_map(|(found, _)| found).collect();
    let ranks = &scene.structure.ranks;
    found.sort_unstable_by_key(|found| found.pair.map(|slot| ranks[slot as usize]));
    let complete =
        complete && found.iter().flat_map(|found| &found.answers).all(|a| a.status != AnswerStatus::Deadline);
    (found, complete)
}
