//! Where everything is in the middle of an interval, and how far it can get from there.

use nalgebra::{Isometry3, Point3, Vector3};
use sublevel_core::measure::Pose;

use super::bound::{MovedBall, Moves};
use super::geometry::{MotionItem, PlacedObstacle};
use super::interval::Interval;
use super::path::Path;
use super::problem::{MotionProblem, PiecePair, motion, motion_bound_m, world};
use crate::kinematics::PlaceError;

/// Bound of the rounding of the pose of a body on its link, relative to the lengths.
const PLACING_ROUNDING: f64 = 64.0 * f64::EPSILON;

/// A numeral that no interval has.
const NEVER: u64 = 0;

/// Pieces where they are in the middle of an interval; computed when first asked for.
#[derive(Debug, Default)]
pub(crate) struct Placing {
    /// Numeral of the interval; grows.
    stamp: u64,
    /// Values in the middle.
    pub(crate) configuration: Vec<f64>,
    deviations: Vec<f64>,
    /// Poses of links.
    links: Vec<Isometry3<f64>>,
    errors: Vec<PlaceError>,
    moves: Moves,
    pieces: Vec<PlacedPiece>,
    /// Of all placed pieces; each knows where its own are.
    displacements: Vec<f64>,
    /// Path parameter in the middle, and how much the interval is of the path.
    s: f64,
    width: f64,
}

/// A piece where it is; metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PlacedPiece {
    /// Numeral of the interval that this is of.
    stamp: u64,
    /// Frame of the piece to the world.
    pub(crate) pose: Pose,
    pub(crate) ball: MovedBall,
    /// Place of its first displacement.
    first: usize,
    /// How far it moves though it is on no link.
    drift_m: f64,
    /// Bound of the error of its pose at its points.
    error_m: f64,
}

impl Placing {
    /// Goes to an interval.
    pub(crate) fn set(&mut self, problem: &MotionProblem, path: &Path, interval: &Interval) {
        path.middle(&problem.kinematics, interval, &mut self.configuration, &mut self.deviations);
        let segments = path.segments() as f64;
        self.s = (f64::from(interval.segment) + interval.middle()) / segments;
        self.width = 2.0 * interval.half_width() / segments;
        self.place(problem);
    }

    /// Goes to values that each may differ by so much, in the units of a path's deviations, with
    /// obstacles where they start.
    pub(crate) fn set_box(&mut self, problem: &MotionProblem, center: &[f64], half: &[f64]) {
        self.configuration.clear();
        self.configuration.extend(center);
        self.deviations.clear();
        self.deviations.extend(half);
        (self.s, self.width) = (0.0, 0.0);
        self.place(problem);
    }

    fn place(&mut self, problem: &MotionProblem) {
        self.stamp += 1;
        let unplaced = PlacedPiece {
            stamp: NEVER,
            pose: Pose::identity(),
            ball: MovedBall { center: Vector3::zeros(), radius: 0.0, link: 0 },
            first: 0,
            drift_m: 0.0,
            error_m: 0.0,
        };
        self.pieces.resize(problem.pieces.len(), unplaced);
        self.displacements.clear();
        problem.kinematics.forward(&problem.base, &self.configuration, &mut self.links);
        problem.kinematics.forward_errors(&self.links, &self.configuration, &mut self.errors);
        self.moves.set(&problem.kinematics, &self.links, &self.deviations);
    }

    /// Goes to a path that stands still, with obstacles where they are at s.
    #[cfg(test)]
    pub(crate) fn set_at(&mut self, problem: &MotionProblem, path: &Path, s: f64) {
        self.set(problem, path, &Interval::whole(0));
        (self.s, self.width) = (s, 0.0);
    }

    /// Path parameter in the middle.
    pub(crate) fn s(&self) -> f64 {
        self.s
    }

    /// Both pieces of a pair; none where one is too far away to have a pose.
    pub(crate) fn pair(&mut self, problem: &MotionProblem, pair: &PiecePair) -> Option<[PlacedPiece; 2]> {
        let [a, b] = pair.pieces;
        Some([self.piece(problem, a)?, self.piece(problem, b)?])
    }

    fn piece(&mut self, problem: &MotionProblem, index: u32) -> Option<PlacedPiece> {
        let placed = self.pieces[index as usize];
        if placed.stamp == self.stamp {
            return Some(placed);
        }
        let piece = &problem.pieces[index as usize];
        let mut placed = match piece.owner {
            MotionItem::Body(body) => self.on_link(problem, body, &piece.center, piece.radius)?,
            MotionItem::Obstacle(obstacle) => {
                self.obstacle(&problem.obstacles[obstacle].placed, &piece.center, piece.radius)?
            }
        };
        placed.first = self.displacements.len();
        self.moves.displacements(&placed.ball, &mut self.displacements);
        placed.stamp = self.stamp;
        self.pieces[index as usize] = placed;
        Some(placed)
    }

    fn on_link(&self, problem: &MotionProblem, body: usize, center: &Vector3<f64>, radius: f64) -> Option<PlacedPiece> {
        let (link, place) = (problem.bodies[body].link, &problem.bodies[body].place);
        let frame = &self.links[link];
        let rotation = (frame.rotation * place.rotation()).into_inner().normalize();
        let translation = world(frame, place.translation());
        let pose = Pose::from_quaternion(translation, rotation.coords.into()).ok()?;
        let reach = center.norm() + radius;
        let error_m = self.errors[link].within_m(reach)
            + PLACING_ROUNDING * (frame.translation.vector.norm() + reach + place.translation().norm());
        let ball = MovedBall { center: world(frame, center), radius: radius + error_m, link };
        Some(PlacedPiece { stamp: NEVER, pose, ball, first: 0, drift_m: 0.0, error_m })
    }

    fn obstacle(&self, placed: &PlacedObstacle, center: &Vector3<f64>, radius: f64) -> Option<PlacedPiece> {
        let (pose, drift_m, error_m) = match placed {
            PlacedObstacle::Still(_, pose) => (*pose, 0.0, 0.0),
            PlacedObstacle::Moving { from, to, place, .. } => {
                let frame = motion(from, to)?.pose(self.s);
                let rotation = (frame.rotation() * place.rotation()).into_inner().normalize();
                let translation = frame.transform_point(place.translation());
                let pose = Pose::from_quaternion(translation, rotation.coords.into()).ok()?;
                let way = from.translation().norm() + to.translation().norm() + place.translation().norm();
                let rounding = PLACING_ROUNDING * (way + center.norm() + radius);
                let held = place.transform_point(center);
                (pose, motion_bound_m(from, to, &held, radius, 0.5 * self.width), rounding)
            }
            PlacedObstacle::HalfSpace(..) => (Pose::identity(), 0.0, 0.0),
        };
        let size = center.norm() + pose.translation().norm();
        let center = pose.transform_point(center);
        let radius = radius * (1.0 + 4.0 * f64::EPSILON) + PLACING_ROUNDING * size;
        Some(PlacedPiece {
            stamp: NEVER,
            pose,
            ball: MovedBall { center, radius, link: 0 },
            first: 0,
            drift_m,
            error_m,
        })
    }

    /// Bound of how much nearer the pieces of a pair can get to each other, metres.
    pub(crate) fn approach_m(&self, pair: &PiecePair, placed: &[PlacedPiece; 2]) -> f64 {
        let of =
            |side: usize| self.displacements[placed[side].first + pair.steps[side] as usize] + placed[side].drift_m;
        of(0) + of(1)
    }

    /// The same along a unit vector of the world frame.
    pub(crate) fn approach_along_m(&self, pair: &PiecePair, placed: &[PlacedPiece; 2], n: &Vector3<f64>) -> f64 {
        let of = |side: usize| {
            let (steps, piece) = (pair.steps[side] as usize, &placed[side]);
            let displacements = &self.displacements[piece.first..];
            let along = self.moves.along(n, &piece.ball, steps, displacements);
            along.min(displacements[steps]) + piece.drift_m
        };
        of(0) + of(1)
    }

    /// Adds to `shares`, one number a value of a configuration, how far each of the joints of some
    /// links from that of a piece towards the root moves it by itself, metres.
    pub(crate) fn add_shares(&self, problem: &MotionProblem, placed: &PlacedPiece, steps: usize, shares: &mut [f64]) {
        self.moves.add_shares(&problem.kinematics, &placed.ball, steps, shares);
    }

    /// A point of the world in the frame of a piece, metres.
    pub(crate) fn local(placed: &PlacedPiece, point: &Vector3<f64>) -> Vector3<f64> {
        let frame = Isometry3::from_parts((*placed.pose.translation()).into(), *placed.pose.rotation());
        (frame.inverse() * Point3::from(*point)).coords
    }
}

impl PlacedPiece {
    /// Bound of the error of the pose at the points of the piece, metres.
    pub(crate) fn error_m(&self) -> f64 {
        self.error_m
    }
}
