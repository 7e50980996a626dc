//! Measures of pairs that are named.

use nalgebra::Vector3;
use sublevel_core::measure::HalfSpace;

use super::answer::{Answer, AnswerStatus};
use super::ask::{Ask, Measure};
use super::solver::{Pair, Solver};
use super::thing::{PairSlots, Thing, WorldHalfSpace};
use crate::crew::{Question, Stop};
use crate::geometry::Geometry;
use crate::object::Slot;
use crate::scene::Scene;

/// One side of a pair: an object of the scene, or something given with the question.
#[derive(Clone, Copy, Debug)]
pub enum Operand {
    /// An object.
    Object(Slot),
    /// A point of the world frame, metres.
    Point(Vector3<f64>),
    /// A half-space of the world frame.
    HalfSpace(HalfSpace),
}

/// Why pairs cannot be measured.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum PairsError {
    /// An index beyond the operands.
    #[error("pair {pair} names operand {operand}, and there are {count}; count from 0")]
    NoOperand {
        /// Position of the pair.
        pair: usize,
        /// The index.
        operand: u32,
        /// Number of operands.
        count: usize,
    },
    /// The same operand on both sides.
    #[error("pair {pair} pairs operand {operand} with itself; name two")]
    Itself {
        /// Position of the pair.
        pair: usize,
        /// The operand.
        operand: u32,
    },
    /// A measure of convex bodies, of a pair with an sos-body.
    #[error(
        "pair {pair} holds an sos-body, which need not be convex, and {measure:?} is a measure of convex bodies; ask for \
         Distance, LevelAOnB, LevelBOnA, Signed, Overlap or NearerThan, or place a convex body or a compound around it"
    )]
    NeedsConvex {
        /// Position of the pair.
        pair: usize,
        /// The measure.
        measure: Measure,
    },
    /// A pair without an object.
    #[error("pair {pair} holds no object of the scene; at least one side has to be one")]
    NoObject {
        /// Position of the pair.
        pair: usize,
    },
}

/// Pairs of a chunk: some tens of microseconds of warm work, so that threads share evenly.
const CHUNK: usize = 64;

/// The same where a side need not be convex: milliseconds.
const SET_CHUNK: usize = 1;

/// Most measures of a question that is answered where it is asked.
const BRIEF: usize = 4;

/// Measures of pairs that are named, all on one snapshot.
#[derive(Debug)]
pub struct Pairs {
    scene: Scene,
    ask: Ask,
    operands: Vec<Operand>,
    pairs: Vec<[u32; 2]>,
    /// Pairs of a chunk.
    chunk: usize,
}

impl Pairs {
    /// The pairs, as positions of operands.
    ///
    /// # Errors
    /// The first pair that is none.
    pub fn new(scene: Scene, ask: Ask, operands: Vec<Operand>, pairs: Vec<[u32; 2]>) -> Result<Self, PairsError> {
        for (pair, sides) in pairs.iter().enumerate() {
            for &operand in sides {
                if operand as usize >= operands.len() {
                    return Err(PairsError::NoOperand { pair, operand, count: operands.len() });
                }
            }
            let [a, b] = sides.map(|side| operands[side as usize]);
            match (a, b) {
                (Operand::Object(slot_a), Operand::Object(slot_b)) if slot_a == slot_b => {
                    return Err(PairsError::Itself { pair, operand: sides[0] });
                }
                (Operand::Object(_), _) | (_, Operand::Object(_)) => {
                    let is_set = |side: Operand| matches!(side, Operand::Object(slot) if is_sos_body(&scene, slot));
                    let is_plane = |side: Operand| match side {
                        Operand::Object(slot) => is_half_space(&scene, slot),
                        Operand::HalfSpace(_) => true,
                        Operand::Point(_) => false,
                    };
                    // The depth in a half-space is known of any set.
                    let is_refused = |measure: &&Measure| {
                        measure.needs_convex() && !(**measure == Measure::Penetration && (is_plane(a) || is_plane(b)))
                    };
                    if let Some(&measure) = ask.measures().iter().find(is_refused)
                        && (is_set(a) || is_set(b))
                    {
                        return Err(PairsError::NeedsConvex { pair, measure });
                    }
                }
                _ => return Err(PairsError::NoObject { pair }),
            }
        }
        let is_set = |side: &Operand| matches!(*side, Operand::Object(slot) if is_sos_body(&scene, slot));
        let chunk = if operands.iter().any(is_set) { SET_CHUNK } else { CHUNK };
        Ok(Self { scene, ask, operands, pairs, chunk })
    }

    /// Number of pairs.
    pub fn len(&self) -> usize {
        self.pairs.len()
    }

    /// Whether there are no pairs.
    pub fn is_empty(&self) -> bool {
        self.pairs.is_empty()
    }

    fn thing(&self, operand: u32) -> Option<Thing<'_>> {
        match self.operands[operand as usize] {
            Operand::Object(slot) => Some(Thing::object(self.scene.object(slot)?, self.scene.pose_at(slot))),
            Operand::Point(point) => Some(Thing::Point(point)),
            Operand::HalfSpace(half_space) => Some(Thing::HalfSpace(WorldHalfSpace::fixed(half_space))),
        }
    }

    fn slots(&self, [a, b]: [u32; 2]) -> Option<PairSlots> {
        // An operand of the call has no place in the table.
        match [a, b].map(|side| self.operands[side as usize]) {
            [Operand::Object(a), Operand::Object(b)] => Some(PairSlots { a, b }),
            _ => None,
        }
    }
}

fn is_half_space(scene: &Scene, slot: Slot) -> bool {
    scene.object(slot).is_some_and(|object| matches!(object.geometry, Geometry::HalfSpace(_)))
}

fn is_sos_body(scene: &Scene, slot: Slot) -> bool {
    scene.object(slot).is_some_and(|object| matches!(object.geometry, Geometry::SosBody(_)))
}

impl Question for Pairs {
    type Part = Vec<Answer>;

    fn chunks(&self) -> usize {
        self.pairs.len().div_ceil(self.chunk)
    }

    fn is_brief(&self) -> bool {
        let measures = self.ask.measures();
        let takes_long =
            |measure: &Measure| matches!(measure, Measure::Penetration | Measure::Signed | Measure::TimeOfImpact);
        let is_single = |operand: &Operand| match operand {
            Operand::Object(slot) => self.scene.object(*slot).is_none_or(|object| object.geometry.is_single()),
            Operand::Point(_) | Operand::HalfSpace(_) => true,
        };
        self.pairs.len() * measures.len() <= BRIEF
            && !measures.iter().any(takes_long)
            && self.operands.iter().all(is_single)
    }

    /// All measures of the first pair, then of the second, and so on.
    fn solve(&self, chunk: usize, stop: &Stop) -> Vec<Answer> {
        let cache = (!self.ask.cold).then_some(&*self.scene.cache);
        let solver = Solver { ask: &self.ask, cache, stop };
        let measures = self.ask.measures().len();
        let pairs = &self.pairs[chunk * self.chunk..((chunk + 1) * self.chunk).min(self.pairs.len())];
        let mut answers = Vec::with_capacity(pairs.len() * measures);
        for &sides in pairs {
            let slots = self.slots(sides);
            let skipped = !self.ask.include_allowed && slots.is_some_and(|s| self.scene.is_allowed(s.a, s.b));
            match (self.thing(sides[0]), self.thing(sides[1])) {
                (Some(a), Some(b)) if !skipped => {
                    let pair = Pair { a, b, slots };
                    answers.extend((0..measures).map(|index| solver.measure(index, &pair)));
                }
                _ => answers.extend((0..measures).map(|_| Answer::without(AnswerStatus::Allowed))),
            }
        }
        answers
    }
}
