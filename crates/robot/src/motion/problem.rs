//! What a motion is checked against: bodies, obstacles, and the pairs of these that count.

use std::sync::{Arc, OnceLock};

use nalgebra::{Isometry3, Point3, Vector3};
use sublevel_core::measure::{Motion, Pose};

use super::claim::DigestedClaim;
use super::geometry::{MotionBody, MotionItem, MotionObstacle, Piece, PlacedObstacle};
use crate::kinematics::Kinematics;

/// A robot with what is fixed to its links, among obstacles. Made once, it serves many paths.
#[derive(Clone, Debug)]
pub struct MotionProblem {
    pub(crate) kinematics: Arc<Kinematics>,
    /// Root link to world.
    pub(crate) base: Isometry3<f64>,
    pub(crate) bodies: Vec<MotionBody>,
    pub(crate) obstacles: Vec<MotionObstacle>,
    /// Pairs of items that count, with their paddings.
    pub(crate) rules: Vec<(MotionItem, MotionItem, f64)>,
    pub(crate) margin_m: f64,
    pub(crate) pieces: Vec<PieceOf>,
    pub(crate) pairs: Vec<PiecePair>,
    /// What certificates say of all this; made when first asked for.
    pub(crate) claim: OnceLock<Arc<DigestedClaim>>,
}

/// A robot with what is fixed to its links.
#[derive(Clone, Debug)]
pub struct MotionRobot {
    /// Its kinematic tree.
    pub kinematics: Arc<Kinematics>,
    /// Root link to world.
    pub base: Pose,
    /// Bodies that are fixed to links.
    pub bodies: Vec<MotionBody>,
}

/// Why bodies and obstacles are no problem.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum MotionProblemError {
    /// A body on a link that is not there.
    #[error("body {0} is fixed to a link that the robot does not have")]
    Link(Arc<str>),
    /// A margin or padding that is not finite.
    #[error("the margin or padding of a pair is {0} m; give a finite number")]
    Threshold(f64),
    /// An obstacle that moves too far.
    #[error("obstacle {0} cannot move between these poses: they are too far apart")]
    Obstacle(Arc<str>),
    /// More pairs than are kept in memory.
    #[error(
        "at least {0} pairs of convex pieces count, and at most {MAX_PIECE_PAIRS} are taken; allow pairs that cannot \
         touch, or use bodies of fewer parts"
    )]
    Pairs(usize),
}

/// Most pairs of convex pieces of a problem.
pub const MAX_PIECE_PAIRS: usize = 1 << 22;

/// A convex piece of an item.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PieceOf {
    pub(crate) owner: MotionItem,
    pub(crate) part: usize,
    /// Centre of a ball around it, in the frame of the link of a body, of an obstacle in its own.
    pub(crate) center: Vector3<f64>,
    pub(crate) radius: f64,
}

/// Two pieces that must keep apart.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PiecePair {
    pub(crate) pieces: [u32; 2],
    /// Links from each towards the root up to where the two branches meet.
    pub(crate) steps: [u32; 2],
    /// Signed distance below which the two are in contact, metres.
    pub(crate) threshold_m: f64,
    pub(crate) padding_m: f64,
}

impl MotionProblem {
    /// A robot among obstacles. Two items are in contact
    /// when their signed distance is below `margin_m` plus their padding; `padding_m` gives that of
    /// two items in metres, or none for a pair that does not count. Pairs of obstacles never do.
    ///
    /// # Errors
    /// A body on a link that is not there, a margin or padding that is not finite, and more pairs
    /// than [`MAX_PIECE_PAIRS`].
    pub fn new(
        robot: MotionRobot,
        obstacles: Vec<MotionObstacle>,
        margin_m: f64,
        mut padding_m: impl FnMut(MotionItem, MotionItem) -> Option<f64>,
    ) -> Result<Self, MotionProblemError> {
        let (mut rules, mut pairs) = (Vec::new(), 0);
        let count = robot.bodies.len();
        for a in 0..count {
            let others = (a + 1..count).map(MotionItem::Body);
            for b in others.chain((0..obstacles.len()).map(MotionItem::Obstacle)) {
                let Some(padding_m) = padding_m(MotionItem::Body(a), b) else { continue };
                let pieces = match b {
                    MotionItem::Body(b) => robot.bodies[b].shape.pieces(),
                    MotionItem::Obstacle(b) => obstacles[b].placed.pieces(),
                };
                pairs += robot.bodies[a].shape.pieces() * pieces;
                // Rules of many items take more memory than there is.
                if pairs > MAX_PIECE_PAIRS {
                    return Err(MotionProblemError::Pairs(pairs));
                }
                rules.push((MotionItem::Body(a), b, padding_m));
            }
        }
        Self::of_rules(robot, obstacles, margin_m, rules)
    }

    /// The same with the pairs that count as a list.
    pub(crate) fn of_rules(
        robot: MotionRobot,
        obstacles: Vec<MotionObstacle>,
        margin_m: f64,
        rules: Vec<(MotionItem, MotionItem, f64)>,
    ) -> Result<Self, MotionProblemError> {
        let MotionRobot { kinematics, base, bodies } = robot;
        let base = Isometry3::from_parts((*base.translation()).into(), *base.rotation());
        let mut problem = Self {
            kinematics,
            base,
            bodies,
            obstacles,
            rules,
            margin_m,
            pieces: Vec::new(),
            pairs: Vec::new(),
            claim: OnceLock::new(),
        };
        problem.check()?;
        let firsts = problem.take_pieces();
        let pieces = |item: MotionItem| {
            let place = problem.place(item);
            firsts[place + 1] - firsts[place]
        };
        let pairs = problem.rules.iter().map(|&(a, b, _)| pieces(a) * pieces(b)).fold(0, usize::saturating_add);
        if pairs > MAX_PIECE_PAIRS {
            return Err(MotionProblemError::Pairs(pairs));
        }
        problem.take_pairs(&firsts);
        Ok(problem)
    }

    fn check(&self) -> Result<(), MotionProblemError> {
        let links = self.kinematics.links().len();
        if let Some(body) = self.bodies.iter().find(|body| body.link >= links) {
            return Err(MotionProblemError::Link(body.name.clone()));
        }
        let paddings = self.rules.iter().map(|(_, _, padding_m)| self.margin_m + padding_m);
        if let Some(wrong) = paddings.chain([self.margin_m]).find(|threshold| !threshold.is_finite()) {
            return Err(MotionProblemError::Threshold(wrong));
        }
        for obstacle in &self.obstacles {
            if let PlacedObstacle::Moving { from, to, .. } = &obstacle.placed
                && motion(from, to).is_none()
            {
                return Err(MotionProblemError::Obstacle(obstacle.name.clone()));
            }
        }
        Ok(())
    }

    /// Fills the list of pieces; returns the first piece of each body and, after them, of each
    /// obstacle, and the end.
    fn take_pieces(&mut self) -> Vec<usize> {
        let mut firsts = Vec::new();
        let mut pieces = Vec::new();
        for (index, body) in self.bodies.iter().enumerate() {
            firsts.push(pieces.len());
            for part in 0..body.shape.pieces() {
                let (center, radius) = body.shape.piece(part).ball();
                let center = body.place.transform_point(&center);
                let radius = radius + 8.0 * f64::EPSILON * (center.norm() + body.place.translation().norm());
                pieces.push(PieceOf { owner: MotionItem::Body(index), part, center, radius });
            }
        }
        for (index, obstacle) in self.obstacles.iter().enumerate() {
            firsts.push(pieces.len());
            for part in 0..obstacle.placed.pieces() {
                let (center, radius) = obstacle.placed.piece(part).ball();
                pieces.push(PieceOf { owner: MotionItem::Obstacle(index), part, center, radius });
            }
        }
        firsts.push(pieces.len());
        self.pieces = pieces;
        firsts
    }

    /// Position of an item among the bodies and, after them, the obstacles.
    fn place(&self, item: MotionItem) -> usize {
        match item {
            MotionItem::Body(index) => index,
            MotionItem::Obstacle(index) => self.bodies.len() + index,
        }
    }

    fn take_pairs(&mut self, firsts: &[usize]) {
        let mut pairs = Vec::new();
        // Parents come before children.
        let mut depths: Vec<u32> = Vec::new();
        for link in 0..self.kinematics.links().len() {
            depths.push(self.kinematics.parent(link).map_or(0, |parent| depths[parent] + 1));
        }
        for &(a, b, padding_m) in &self.rules {
            let steps = self.steps(a, b, &depths);
            let threshold_m = self.margin_m + padding_m;
            let [of_a, of_b] = [a, b].map(|item| self.place(item)).map(|place| firsts[place]..firsts[place + 1]);
            for piece in of_a {
                let with = of_b.clone().map(|other| PiecePair {
                    pieces: [piece, other].map(|piece| u32::try_from(piece).unwrap_or(u32::MAX)),
                    steps,
                    threshold_m,
                    padding_m,
                });
                pairs.extend(with);
            }
        }
        self.pairs = pairs;
    }

    /// Links from each of two items towards the root up to their last common one.
    fn steps(&self, a: MotionItem, b: MotionItem, depths: &[u32]) -> [u32; 2] {
        let link = |item: MotionItem| match item {
            MotionItem::Body(index) => self.bodies[index].link,
            MotionItem::Obstacle(_) => 0,
        };
        let (mut at, mut steps) = ([link(a), link(b)], [0, 0]);
        while at[0] != at[1] {
            let side = usize::from(depths[at[1]] > depths[at[0]]);
            at[side] = self.kinematics.parent(at[side]).unwrap_or(0);
            steps[side] += 1;
        }
        steps
    }

    /// The robot.
    pub fn kinematics(&self) -> &Arc<Kinematics> {
        &self.kinematics
    }

    /// Bodies, as they were given.
    pub fn bodies(&self) -> &[MotionBody] {
        &self.bodies
    }

    /// Obstacles, as they were given.
    pub fn obstacles(&self) -> &[MotionObstacle] {
        &self.obstacles
    }

    /// Name of an item.
    pub fn name(&self, item: MotionItem) -> &Arc<str> {
        match item {
            MotionItem::Body(index) => &self.bodies[index].name,
            MotionItem::Obstacle(index) => &self.obstacles[index].name,
        }
    }

    pub(crate) fn piece(&self, index: u32) -> (&PieceOf, Piece<'_>) {
        let piece = &self.pieces[index as usize];
        let shape = match piece.owner {
            MotionItem::Body(index) => self.bodies[index].shape.piece(piece.part),
            MotionItem::Obstacle(index) => self.obstacles[index].placed.piece(piece.part),
        };
        (piece, shape)
    }

    /// The items of a pair of pieces.
    pub(crate) fn items(&self, pair: &PiecePair) -> [MotionItem; 2] {
        pair.pieces.map(|piece| self.pieces[piece as usize].owner)
    }
}

/// The motion between two poses over the path parameter; none between poses too far apart.
pub(crate) fn motion(from: &Pose, to: &Pose) -> Option<Motion> {
    let turn = (to.rotation() * from.rotation().inverse()).scaled_axis();
    Motion::new(*from, to.translation() - from.translation(), turn, *from.translation()).ok()
}

/// Bound of how far points within `radius` of `center` (body frame) move while the path parameter
/// changes by `width`, metres.
pub(crate) fn motion_bound_m(from: &Pose, to: &Pose, center: &Vector3<f64>, radius: f64, width: f64) -> f64 {
    let shift = (to.translation() - from.translation()).norm();
    let turn = from.rotation().angle_to(to.rotation());
    let arm = center.norm() + radius;
    let rounding = 1e-14 * (arm + from.translation().norm() + to.translation().norm());
    (shift + turn * arm) * width * (1.0 + 1e-12) + rounding
}

/// World position of a point of a frame, metres.
pub(crate) fn world(frame: &Isometry3<f64>, point: &Vector3<f64>) -> Vector3<f64> {
    (frame * Point3::from(*point)).coords
}
