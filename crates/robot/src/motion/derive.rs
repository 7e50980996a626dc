//! Which pairs of bodies of a robot can touch at all: branch and bound over the joint box.
//!
//! With the values of the joints between two bodies in a box, no point moves farther than the bound
//! of [`super::bound`] from where it is at the centre. A box in which a pair keeps apart is done; a
//! contact at a centre is a witness; otherwise the box is cut across the joint that moves the pair
//! most. Boxes that may contain the deepest contact come first, so that a witness is found early.

use std::cmp::Ordering;
use std::collections::BinaryHeap;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Vector3;
use serde::{Deserialize, Serialize};
use sublevel_core::measure::{Options, WarmStart};

use super::geometry::MotionItem;
use super::placing::Placing;
use super::planes::{Height, gap};
use super::problem::{MotionProblem, PiecePair};
use super::solve::solve;
use crate::description::JointKind;
use crate::kinematics::{Kinematics, LIMIT_SLACK};

/// Default of [`DeriveOptions::max_boxes`].
pub const DEFAULT_MAX_BOXES: u32 = 200_000;

/// Default of [`DeriveOptions::resolution_m`].
pub const DEFAULT_DERIVE_RESOLUTION_M: f64 = 1e-3;

/// Numbers that boxes which wait may take, pairs of pieces counted as [`PAIR_NUMBERS`]: half a
/// gigabyte.
const MAX_WAITING: usize = 1 << 26;

/// Numbers that an open pair of pieces takes.
const PAIR_NUMBERS: usize = size_of::<PiecePair>() / size_of::<f64>();

/// Boxes that are looked at for a deeper contact after the first one.
const DEEPER_BOXES: u32 = 1000;

/// First step of the search for the deepest contact near the one that was found, relative to the
/// range of each joint; it is halved where no step goes deeper.
const FIRST_STEP: f64 = 0.1;

/// Last step.
const LAST_STEP: f64 = 1e-4;

/// What is known of a pair of bodies over all configurations within the joint limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum PairClass {
    /// Their links are joined directly, through frames without geometry at most.
    Adjacent,
    /// They are never in contact: proven.
    Never,
    /// They are always in contact: proven.
    Always,
    /// They are in contact at the witness: proven.
    Collides,
    /// Nothing is proven within the limits of the search.
    Undecided,
}

/// A pair of bodies and what is known of it.
#[derive(Clone, Debug, PartialEq)]
pub struct DerivedPair {
    /// The two bodies.
    pub items: [MotionItem; 2],
    /// What is known.
    pub class: PairClass,
    /// A configuration at which they are in contact, the deepest that was seen; of adjacent and
    /// undecided pairs the nearest, if any.
    pub witness: Option<Vec<f64>>,
    /// Signed distance at the witness at most, metres; of pairs that are never in contact, the
    /// least that was seen at any configuration.
    pub upper_m: f64,
    /// Boxes of joint values that were looked at.
    pub boxes: u32,
}

/// When the search for one pair ends.
#[derive(Clone, Copy, Debug)]
pub struct DeriveOptions {
    /// Most boxes for one pair.
    pub max_boxes: u32,
    /// Boxes in which no point moves by more than this, metres, are not cut again.
    pub resolution_m: f64,
}

impl Default for DeriveOptions {
    fn default() -> Self {
        Self { max_boxes: DEFAULT_MAX_BOXES, resolution_m: DEFAULT_DERIVE_RESOLUTION_M }
    }
}

/// Joint values around a centre, with the pairs of pieces that are open in it.
struct JointBox {
    /// Least signed distance that is possible, metres.
    bound: f64,
    center: Vec<f64>,
    half: Vec<f64>,
    open: Arc<[PiecePair]>,
}

impl JointBox {
    /// Numbers that it takes, the open pairs shared with the other half.
    fn numbers(&self) -> usize {
        2 * self.center.len() + self.open.len() * PAIR_NUMBERS / 2
    }
}

impl PartialEq for JointBox {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for JointBox {}

impl PartialOrd for JointBox {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for JointBox {
    /// The least bound is the greatest box: a heap returns it first.
    fn cmp(&self, other: &Self) -> Ordering {
        other.bound.total_cmp(&self.bound)
    }
}

impl MotionProblem {
    /// Pairs of bodies that count, in order.
    pub fn body_pairs(&self) -> impl Iterator<Item = [MotionItem; 2]> + '_ {
        let is_body = |item: &MotionItem| matches!(item, MotionItem::Body(_));
        self.rules.iter().filter(move |(a, b, _)| is_body(a) && is_body(b)).map(|&(a, b, _)| [a, b])
    }

    /// Whether a pair of bodies that counts can be in contact within the joint limits. Obstacles
    /// play no part. Nothing is proven of pairs with joints between them that have no end but those
    /// that turn; and of pairs that do not count. `progress` receives the number of boxes that were
    /// looked at, and can end the search.
    pub fn derive(
        &self,
        mut items: [MotionItem; 2],
        options: &DeriveOptions,
        progress: &mut dyn FnMut(u32) -> ControlFlow<()>,
    ) -> DerivedPair {
        items.sort();
        Derivation::new(self, items, options).run(progress)
    }

    /// Whether the links of two bodies are the same or joined directly, through frames without
    /// bodies at most.
    fn is_adjacent(&self, items: [MotionItem; 2]) -> bool {
        let link = |item: MotionItem| match item {
            MotionItem::Body(index) => self.bodies[index].link,
            MotionItem::Obstacle(_) => 0,
        };
        let has_body = |link: usize| self.bodies.iter().any(|body| body.link == link);
        let [a, b] = items.map(link);
        let holds = |low: usize, high: usize| {
            let mut at = self.kinematics.parent(low);
            while let Some(link) = at.filter(|&link| link != high && !has_body(link)) {
                at = self.kinematics.parent(link);
            }
            at == Some(high)
        };
        a == b || holds(a, b) || holds(b, a)
    }
}

/// Least and largest value of the joints that have an end or turn, with their places.
fn ranges(kinematics: &Kinematics) -> impl Iterator<Item = (usize, [f64; 2])> {
    kinematics.variables().iter().filter_map(|variable| {
        let range = match (variable.kind, variable.limits) {
            (JointKind::Continuous, _) => [-std::f64::consts::PI, std::f64::consts::PI],
            (_, Some(limits)) => [limits.lower, limits.upper],
            _ => return None,
        };
        Some((variable.first, range))
    })
}

/// The search for one pair.
struct Derivation<'a> {
    problem: &'a MotionProblem,
    options: &'a DeriveOptions,
    items: [MotionItem; 2],
    placing: Placing,
    heap: BinaryHeap<JointBox>,
    boxes: u32,
    /// Numbers that the boxes in the heap take.
    waiting: usize,
    /// The deepest configuration that was seen, and its signed distance at most, metres.
    deepest: (Option<Vec<f64>>, f64),
    /// Whether a box is neither free nor in contact throughout, and is not cut.
    is_open: bool,
    /// Whether the pair keeps apart at some configuration.
    is_free_somewhere: bool,
    /// Whether the pair is in contact at some configuration.
    is_in_contact: bool,
}

/// Signed distances of a pair, metres.
struct BoxBracket {
    /// At least, all over the box.
    lower: f64,
    /// At least, at its centre.
    lower_at_center: f64,
    /// At most, at its centre.
    upper_at_center: f64,
    /// Bound of how much it changes over the box.
    change: f64,
}

impl<'a> Derivation<'a> {
    fn new(problem: &'a MotionProblem, items: [MotionItem; 2], options: &'a DeriveOptions) -> Self {
        Self {
            problem,
            options,
            items,
            placing: Placing::default(),
            heap: BinaryHeap::new(),
            boxes: 0,
            waiting: 0,
            deepest: (None, f64::INFINITY),
            is_open: false,
            is_free_somewhere: false,
            is_in_contact: false,
        }
    }

    fn run(mut self, progress: &mut dyn FnMut(u32) -> ControlFlow<()>) -> DerivedPair {
        let all: Vec<PiecePair> =
            self.problem.pairs.iter().filter(|pair| self.problem.items(pair) == self.items).copied().collect();
        let open = all.clone();
        let is_adjacent = self.problem.is_adjacent(self.items);
        // Nothing is known of pairs that do not count, nor over joints without end.
        self.is_open = open.is_empty() || open.iter().any(|pair| self.is_endless(pair));
        let mut first = self.whole(open);
        if is_adjacent {
            first.half.fill(0.0);
        }
        self.push(first);
        let mut most = self.options.max_boxes;
        while let Some(joint_box) = self.heap.pop() {
            self.waiting -= joint_box.numbers();
            let is_over = self.boxes >= most || self.waiting > MAX_WAITING;
            if is_over || progress(self.boxes).is_break() {
                self.is_open = true;
                break;
            }
            self.boxes += 1;
            self.look(joint_box);
            // Contact somewhere and none elsewhere: nothing is left to learn but how deep it is.
            if self.is_in_contact && self.is_free_somewhere {
                most = most.min(self.boxes.saturating_add(DEEPER_BOXES));
            }
        }
        let is_witnessed = self.is_in_contact;
        if is_witnessed && !is_adjacent {
            self.deepen(&all);
        }
        let class = match (is_adjacent, is_witnessed) {
            (true, _) => PairClass::Adjacent,
            (false, true) if !self.is_free_somewhere && !self.is_open => PairClass::Always,
            (false, true) => PairClass::Collides,
            (false, false) if self.is_open => PairClass::Undecided,
            (false, false) => PairClass::Never,
        };
        let (witness, upper_m) = self.deepest;
        let is_shown = !matches!(class, PairClass::Never);
        DerivedPair { items: self.items, class, witness: witness.filter(|_| is_shown), upper_m, boxes: self.boxes }
    }

    /// Whether a joint between two pieces takes values that no box contains: those that move in a
    /// plane or freely, that turn or slide without limits, or that follow one that turns without
    /// end.
    fn is_endless(&self, pair: &PiecePair) -> bool {
        let kinematics = &self.problem.kinematics;
        let link = |piece: u32| match self.problem.pieces[piece as usize].owner {
            MotionItem::Body(index) => self.problem.bodies[index].link,
            MotionItem::Obstacle(_) => 0,
        };
        (0..2).any(|side| {
            let chain = std::iter::successors(Some(link(pair.pieces[side])), |&at| kinematics.parent(at));
            let mut joints = chain.take(pair.steps[side] as usize).filter_map(|at| kinematics.joints.get(at - 1));
            joints.any(|joint| {
                let followed = kinematics.variables().iter().find(|variable| variable.first == joint.first);
                let has_limits = followed.is_some_and(|variable| variable.limits.is_some());
                match joint.kind {
                    JointKind::Fixed => false,
                    JointKind::Planar | JointKind::Floating => true,
                    JointKind::Continuous => joint.mimic.is_some() && !has_limits,
                    JointKind::Revolute | JointKind::Prismatic => !has_limits,
                }
            })
        })
    }

    /// The box of all values within the limits.
    fn whole(&self, open: Vec<PiecePair>) -> JointBox {
        let kinematics = &self.problem.kinematics;
        let (mut center, mut half) = (kinematics.default_configuration(), vec![0.0; kinematics.width()]);
        for (place, [lower, upper]) in ranges(kinematics) {
            center[place] = 0.5 * lower + 0.5 * upper;
            // What is accepted as within the limits, and the rounding of the middle.
            let slack = LIMIT_SLACK * lower.abs().max(upper.abs()).max(1.0);
            half[place] = (0.5 * upper - 0.5 * lower) * (1.0 + 4.0 * f64::EPSILON) + slack;
        }
        JointBox { bound: f64::NEG_INFINITY, center, half, open: open.into() }
    }

    fn push(&mut self, joint_box: JointBox) {
        self.waiting += joint_box.numbers();
        self.heap.push(joint_box);
    }

    /// Looks at the centre of a box, and cuts it where pairs stay open.
    fn look(&mut self, joint_box: JointBox) {
        self.placing.set_box(self.problem, &joint_box.center, &joint_box.half);
        let (mut bound, mut change) = (f64::INFINITY, 0.0_f64);
        let (mut is_always, mut is_free_at_center) = (false, true);
        let mut open = joint_box.open.to_vec();
        open.retain(|pair| {
            let Some(found) = self.bracket(pair) else {
                (bound, is_free_at_center) = (f64::NEG_INFINITY, false);
                return true;
            };
            if found.upper_at_center < self.deepest.1 {
                self.deepest = (Some(joint_box.center.clone()), found.upper_at_center);
            }
            self.is_in_contact |= found.upper_at_center < pair.threshold_m;
            is_always |= found.upper_at_center < pair.threshold_m - found.change;
            is_free_at_center &= found.lower_at_center > pair.threshold_m;
            bound = bound.min(found.lower);
            let is_open = found.lower <= pair.threshold_m;
            change = change.max(if is_open { found.change } else { 0.0 });
            is_open
        });
        // Pairs that are not open are free at the centre, too.
        self.is_free_somewhere |= is_free_at_center || open.is_empty();
        if open.is_empty() || is_always {
            return;
        }
        let cut = self.widest(&open, joint_box.half.len());
        match cut.filter(|_| change > self.options.resolution_m) {
            Some(variable) => self.cut(JointBox { bound, open: open.into(), ..joint_box }, variable),
            None => self.is_open = true,
        }
    }

    /// Goes from the deepest contact that was seen to a deeper one nearby, joint by joint.
    fn deepen(&mut self, pairs: &[PiecePair]) {
        let (Some(mut at), mut least) = self.deepest.clone() else { return };
        let ranges: Vec<_> = ranges(&self.problem.kinematics).collect();
        let mut step = FIRST_STEP;
        while step > LAST_STEP {
            let mut is_deeper = false;
            for &(place, [lower, upper]) in &ranges {
                for side in [-step, step] {
                    let before = at[place];
                    at[place] = (before + side * (upper - lower)).max(lower).min(upper);
                    let found = self.signed_distance_upper_m(pairs, &at);
                    if found < least {
                        (least, is_deeper) = (found, true);
                    } else {
                        at[place] = before;
                    }
                }
            }
            if !is_deeper {
                step *= 0.5;
            }
        }
        self.deepest = (Some(at), least);
    }

    /// Upper bound of the signed distance at a configuration, metres.
    fn signed_distance_upper_m(&mut self, pairs: &[PiecePair], at: &[f64]) -> f64 {
        let still = vec![0.0; at.len()];
        self.placing.set_box(self.problem, at, &still);
        pairs
            .iter()
            .filter_map(|pair| self.bracket(pair))
            .map(|found| found.upper_at_center)
            .fold(f64::INFINITY, f64::min)
    }

    /// None where a link has no pose.
    fn bracket(&mut self, pair: &PiecePair) -> Option<BoxBracket> {
        let placed = self.placing.pair(self.problem, pair)?;
        let [a, b] = pair.pieces.map(|piece| self.problem.piece(piece).1);
        let error = placed[0].error_m() + placed[1].error_m();
        let change = self.placing.approach_m(pair, &placed);
        let between = placed[0].ball.center - placed[1].ball.center;
        let balls = between.norm() * (1.0 - 1e-15) - placed[0].ball.radius - placed[1].ball.radius;
        if balls - change > pair.threshold_m {
            let (lower, upper_at_center) = (balls - change, f64::INFINITY);
            return Some(BoxBracket { lower, lower_at_center: balls, upper_at_center, change });
        }
        let (pose_a, pose_b) = (&placed[0].pose, &placed[1].pose);
        let found = solve((&a, pose_a), (&b, pose_b), true, &Options::default(), &mut WarmStart::default());
        let lower_at_center = found.lower - error;
        let mut lower = lower_at_center - change;
        if let Some(n) = found.normal.and_then(|n: Vector3<f64>| n.try_normalize(0.0)) {
            let along = self.placing.approach_along_m(pair, &placed, &n);
            let planes = gap((&a, pose_a, Height::Table), (&b, pose_b, Height::Table), &n);
            lower = lower.max(planes - error - along);
        }
        Some(BoxBracket { lower, lower_at_center, upper_at_center: found.upper + error, change })
    }

    /// The value that moves the open pairs most over a box.
    fn widest(&mut self, open: &[PiecePair], width: usize) -> Option<usize> {
        let mut shares = vec![0.0; width];
        for pair in open {
            let Some(placed) = self.placing.pair(self.problem, pair) else { continue };
            for side in 0..2 {
                let steps = pair.steps[side] as usize;
                self.placing.add_shares(self.problem, &placed[side], steps, &mut shares);
            }
        }
        let (widest, share) = (0..).zip(&shares).max_by(|a: &(usize, &f64), b| a.1.total_cmp(b.1))?;
        (*share > 0.0).then_some(widest)
    }

    fn cut(&mut self, joint_box: JointBox, variable: usize) {
        let quarter = 0.5 * joint_box.half[variable];
        for side in [-1.0, 1.0] {
            let (mut center, mut half) = (joint_box.center.clone(), joint_box.half.clone());
            center[variable] += side * quarter;
            // The centres are rounded.
            half[variable] = quarter * (1.0 + 4.0 * f64::EPSILON) + f64::EPSILON * center[variable].abs();
            self.push(JointBox { bound: joint_box.bound, center, half, open: joint_box.open.clone() });
        }
    }
}
