//! How far a body can move while joint values stay near those of a configuration.
//!
//! With values within w_j of the configuration, walk from the link of the body towards the root and
//! add up `Δ <- Δ + w_j (r_j + Δ)` for a joint that turns, r_j the distance from its axis to the
//! farthest point of the body, and `Δ <- Δ + w_j` for one that slides: when a distal joint has
//! moved the point by Δ, it is at most `r_j + Δ` away from the axis.
//!
//! Along a fixed unit vector n less is possible. With the position `x(q)` of a point, Taylor's
//! formula gives `|n·(x(q) - x)| <= Σ_j w_j |n·∂_j x| + ½ Σ_jk w_j w_k |∂_jk x|`. For a turning
//! joint `∂_j x = a_j × (x - o_j)`. Of two joints, k the more distal one, `∂_jk x = a_j × ∂_k x` if
//! j turns and 0 if it slides, and `|∂_k x| <= r_k + Δ_k` over the whole box of values if k turns,
//! at most 1 if it slides, Δ_k what the joints distal to k move. So the second sum is what each
//! turning joint adds: `w_j Δ_j + ½ w_j² (r_j + Δ_j)`.

use nalgebra::{Isometry3, Vector3};

use crate::description::JointKind;
use crate::kinematics::Kinematics;

/// Relative rounding of the sums here, with room: fewer than 64 operations a joint.
const ROUNDED_UP: f64 = 1.0 + 1e-12;

/// What the joint above a link does to it on an interval; world frame.
#[derive(Clone, Copy, Debug)]
struct Move {
    /// Largest turn from the middle, radians.
    turn: f64,
    /// About this unit vector; zero: about any.
    axis: Vector3<f64>,
    /// Where the axis is, metres.
    origin: Vector3<f64>,
    /// Shifts: largest length, metres, and unit vector; zero: along any.
    slides: [(f64, Vector3<f64>); 2],
    parent: usize,
}

/// What all joints do on an interval.
#[derive(Debug, Default)]
pub(crate) struct Moves {
    /// Of link `i + 1`.
    joints: Vec<Move>,
}

/// A ball in which a body lies at the configuration in the middle; world frame, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct MovedBall {
    pub(crate) center: Vector3<f64>,
    pub(crate) radius: f64,
    /// The link that it is fixed to.
    pub(crate) link: usize,
}

impl Moves {
    /// From the poses of all links in the middle and the deviations of a path.
    pub(crate) fn set(&mut self, kinematics: &Kinematics, poses: &[Isometry3<f64>], deviations: &[f64]) {
        self.joints.clear();
        self.joints.extend(kinematics.joints.iter().zip(1..).map(|(joint, link)| {
            let none = Vector3::zeros();
            let mut moved = Move {
                turn: 0.0,
                axis: none,
                origin: poses[link].translation.vector,
                slides: [(0.0, none); 2],
                parent: joint.parent,
            };
            let rest = || poses[joint.parent].rotation * joint.rotation;
            let deviation = |value: usize| deviations[joint.first + value] * joint.rate().abs();
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Revolute | JointKind::Continuous => {
                    // The axis of a joint turns with nothing but its parent.
                    (moved.turn, moved.axis) = (deviation(0), rest() * joint.axis);
                }
                JointKind::Prismatic => moved.slides[0] = (deviation(0), rest() * joint.axis),
                JointKind::Planar => {
                    moved.slides = [0, 1].map(|value| (deviation(value), rest() * joint.across[value]));
                    (moved.turn, moved.axis) = (deviation(2), rest() * joint.axis);
                }
                JointKind::Floating => {
                    moved.slides[0].0 = deviation(0);
                    moved.turn = deviation(3);
                }
            }
            moved
        }));
    }

    /// Appends bounds of how far points of a ball move, metres: the k-th by the joints of the k
    /// links from its own towards the root.
    pub(crate) fn displacements(&self, ball: &MovedBall, bounds: &mut Vec<f64>) {
        bounds.push(0.0);
        let (mut moved, mut at) = (0.0, ball.link);
        while at > 0 {
            let joint = &self.joints[at - 1];
            if joint.turn > 0.0 {
                moved += joint.turn * (joint.reach(ball) + moved);
            }
            moved = (moved + joint.slides[0].0 + joint.slides[1].0) * ROUNDED_UP;
            bounds.push(moved);
            at = joint.parent;
        }
    }

    /// Bound of how far points of a ball move along a unit vector, metres, by the joints of `steps`
    /// links from its own towards the root; `displacements` are those of the ball.
    pub(crate) fn along(&self, n: &Vector3<f64>, ball: &MovedBall, steps: usize, displacements: &[f64]) -> f64 {
        let (mut first, mut second, mut at) = (0.0, 0.0, ball.link);
        for &before in &displacements[..steps] {
            let joint = &self.joints[at - 1];
            if joint.turn > 0.0 {
                first += joint.turn * joint.lever(n, ball);
                second += joint.turn * before + 0.5 * joint.turn * joint.turn * (joint.reach(ball) + before);
            }
            for (length, axis) in &joint.slides {
                if *length > 0.0 {
                    first += length * if *axis == Vector3::zeros() { 1.0 } else { axis.dot(n).abs() + SLACK };
                }
            }
            at = joint.parent;
        }
        (first + second) * ROUNDED_UP
    }

    /// Adds to `shares`, one number a value of a configuration, how far each joint of `steps` links
    /// from that of a ball towards the root moves it by itself, metres.
    pub(crate) fn add_shares(&self, kinematics: &Kinematics, ball: &MovedBall, steps: usize, shares: &mut [f64]) {
        let mut at = ball.link;
        for _ in 0..steps {
            let (joint, moved) = (&kinematics.joints[at - 1], &self.joints[at - 1]);
            let turned = moved.turn * moved.reach(ball);
            match joint.kind {
                JointKind::Fixed => {}
                JointKind::Revolute | JointKind::Continuous => shares[joint.first] += turned,
                JointKind::Prismatic => shares[joint.first] += moved.slides[0].0,
                JointKind::Planar => {
                    shares[joint.first] += moved.slides[0].0;
                    shares[joint.first + 1] += moved.slides[1].0;
                    shares[joint.first + 2] += turned;
                }
                JointKind::Floating => {
                    shares[joint.first] += moved.slides[0].0;
                    shares[joint.first + 3] += turned;
                }
            }
            at = moved.parent;
        }
    }
}

impl Move {
    /// Largest distance of a point of the ball from the axis.
    fn reach(&self, ball: &MovedBall) -> f64 {
        let arm = ball.center - self.origin;
        let away = if self.axis == Vector3::zeros() { arm.norm() } else { self.axis.cross(&arm).norm() };
        away + ball.radius + SLACK * arm.norm()
    }

    /// Largest `|n·(a × (x - o))|` over the points x of the ball.
    fn lever(&self, n: &Vector3<f64>, ball: &MovedBall) -> f64 {
        let arm = ball.center - self.origin;
        let slack = SLACK * (arm.norm() + ball.radius);
        if self.axis == Vector3::zeros() {
            return n.cross(&arm).norm() + ball.radius + slack;
        }
        let across = n.cross(&self.axis);
        across.dot(&arm).abs() + ball.radius * across.norm() + slack
    }
}

/// Rounding of products of unit vectors, which are of length 1 within rounding, and of the poses
/// that turned them: 42 units of roundoff a joint, of a thousand joints at most.
const SLACK: f64 = 1e-11;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kinematics::tests::{configuration, tree};
    use crate::motion::Path;
    use crate::motion::interval::Interval;
    use nalgebra::Point3;
    use sublevel_testkit::Seeded;

    #[test]
    fn no_point_moves_farther_than_the_bounds() {
        let (mut tight, mut tighter, mut counted) = (0.0_f64, 0.0_f64, 0);
        for seed in 0..300 {
            let mut seeded = Seeded(seed);
            let kinematics = Kinematics::new(&tree(&mut seeded, 9)).expect("a tree");
            let base = Isometry3::from_parts((seeded.unit() * 2.0).into(), seeded.rotation());
            let from = configuration(&mut seeded, &kinematics);
            // From small motions, where first orders count, to whole turns.
            let size = seeded.between(1e-4, 3.0);
            let mut to: Vec<f64> = from.iter().map(|value| value + size * seeded.signed()).collect();
            for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
                let own = &mut to[variable.first + 3..variable.first + 7];
                let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
                own.iter_mut().for_each(|x| *x /= length);
            }
            let path = Path::waypoints(&kinematics, [from, to].concat()).expect("a path");
            let (mut middle, mut deviations) = (Vec::new(), Vec::new());
            path.middle(&kinematics, &Interval::whole(0), &mut middle, &mut deviations);
            let (mut poses, mut moves) = (Vec::new(), Moves::default());
            kinematics.forward(&base, &middle, &mut poses);
            moves.set(&kinematics, &poses, &deviations);
            for (link, pose) in poses.iter().enumerate() {
                let ball =
                    MovedBall { center: pose * Point3::from(seeded.unit()) - Point3::origin(), radius: 0.3, link };
                let mut bounds = Vec::new();
                moves.displacements(&ball, &mut bounds);
                let steps = bounds.len() - 1;
                let point = ball.center + seeded.unit() * ball.radius;
                let local = pose.inverse() * Point3::from(point);
                let n = seeded.unit();
                let along = moves.along(&n, &ball, steps, &bounds);
                let (mut most, mut most_along) = (0.0_f64, 0.0_f64);
                let mut there = Vec::new();
                for sample in 0..=40 {
                    let values = path.at(&kinematics, f64::from(sample) / 40.0);
                    kinematics.forward(&base, &values, &mut there);
                    let moved = (there[link] * local).coords - point;
                    most = most.max(moved.norm());
                    most_along = most_along.max(moved.dot(&n).abs());
                }
                let rounding = 1e-13 * (1.0 + point.norm());
                assert!(most <= bounds[steps] + rounding, "seed {seed}, link {link}: {most} > {}", bounds[steps]);
                assert!(most_along <= along + rounding, "seed {seed}, link {link}: {most_along} > {along}");
                if bounds[steps] > 0.0 && size < 0.01 {
                    tight += most / bounds[steps];
                    tighter += along / bounds[steps];
                    counted += 1;
                }
            }
        }
        // Neither bound is a constant.
        let (tight, tighter) = (tight / f64::from(counted), tighter / f64::from(counted));
        assert!(counted > 200 && tight > 0.3 && tighter < 0.75, "{counted}: {tight:.2} and {tighter:.2}");
    }
}
