//! Motions in time: a constant velocity and a constant rate of turn.

use crate::measure::frames::pose::{Pose, ROTATION_ERROR};
use crate::polynomial::gamma;
use nalgebra::{UnitQuaternion, Vector3};

/// A rigid motion: a point fixed to the body, the centre, moves with constant velocity, and the
/// body turns about it at a constant rate,
///
/// ```text
/// x(t) = c + v t + exp(ω t) (x(0) - c)
/// ```
///
/// in the world frame, seconds and metres. With v along ω it is a screw motion about the axis
/// through c; with c the centre of mass it is free flight. Checked when made.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::measure::{Motion, Pose};
///
/// let quarter = Vector3::z() * std::f64::consts::FRAC_PI_2; // rad/s
/// let start = Pose::from_quaternion(Vector3::x(), [0.0, 0.0, 0.0, 1.0])?;
/// let screw = Motion::new(start, Vector3::z(), quarter, Vector3::zeros())?;
/// assert!((screw.pose(1.0).translation() - Vector3::new(0.0, 1.0, 1.0)).norm() < 1e-15);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    start: Pose,
    velocity: Vector3<f64>,
    angular_velocity: Vector3<f64>,
    center: Vector3<f64>,
}

/// Why numbers are not a motion.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MotionError {
    /// A number is NaN, infinite or too large.
    #[error("{0} of the motion is not finite, or beyond 1e15")]
    NotFinite(&'static str),
}

impl Motion {
    /// The motion from the pose `start`, of the centre `center` (world, m, at time 0) with
    /// `velocity` (m/s), turning at `angular_velocity` (rad/s, along the axis).
    ///
    /// # Errors
    /// Numbers that are not finite.
    pub fn new(
        start: Pose,
        velocity: Vector3<f64>,
        angular_velocity: Vector3<f64>,
        center: Vector3<f64>,
    ) -> Result<Self, MotionError> {
        for (name, vector) in [("velocity", velocity), ("angular velocity", angular_velocity), ("centre", center)] {
            // Not `>`: a NaN is refused too.
            if !vector.iter().all(|value| value.abs() <= 1e15) {
                return Err(MotionError::NotFinite(name));
            }
        }
        Ok(Self { start, velocity, angular_velocity, center })
    }

    /// No motion.
    pub fn still(pose: Pose) -> Self {
        let none = Vector3::zeros();
        Self { start: pose, velocity: none, angular_velocity: none, center: *pose.translation() }
    }

    /// Pose at time `t`, seconds.
    pub fn pose(&self, t: f64) -> Pose {
        if !self.is_turning() {
            return Pose::of_parts(*self.start.rotation(), self.start.translation() + self.velocity * t);
        }
        let turn = UnitQuaternion::from_scaled_axis(self.angular_velocity * t);
        let arm = turn * (self.start.translation() - self.center);
        Pose::of_parts(turn * self.start.rotation(), self.center + self.velocity * t + arm)
    }

    /// Velocity (m/s) at time `t` of the point of the body that is at `x` (world, m) then.
    pub fn velocity_at(&self, t: f64, x: &Vector3<f64>) -> Vector3<f64> {
        self.velocity + self.angular_velocity.cross(&(x - self.center - self.velocity * t))
    }

    pub(in crate::measure) fn is_turning(&self) -> bool {
        self.angular_velocity != Vector3::zeros()
    }

    /// A direction fixed to the body, at time `to`, that is `n` at time `from`, with a bound of its
    /// error.
    pub(in crate::measure) fn carry(&self, n: &Vector3<f64>, from: f64, to: f64) -> (Vector3<f64>, f64) {
        if !self.is_turning() {
            return (*n, 0.0);
        }
        let turn = self.angular_velocity * (to - from);
        (UnitQuaternion::from_scaled_axis(turn) * n, gamma(8) * turn.norm() + gamma(32))
    }

    /// Bound of `|d²/dt² n·x|` for a fixed unit vector n and the points x of the body within
    /// `radius` of `point` (body frame), at all times: `n·(ω × (ω × ρ))` with `|ω × ρ|` constant.
    pub(in crate::measure) fn acceleration_along(&self, n: &Vector3<f64>, point: &Vector3<f64>, radius: f64) -> f64 {
        let omega = &self.angular_velocity;
        n.cross(omega).norm() * (self.arm(point).cross(omega).norm() + radius * omega.norm()) * (1.0 + 1e-12)
    }

    /// Bound of `|d²/dt² n·(x - y)|` between two times for a unit vector n fixed to this body, the
    /// points x of this body and the points y of another within `radius` of `point` (its body
    /// frame).
    ///
    /// `n·(x - c)` is constant. What remains is `n·w - n·b` with w from the other's point to c and
    /// b from it to y: by `n' = ω × n` and the product rule
    ///
    /// ```text
    /// |n''·(w - b)| + 2 |n'·(w' - b')| + |n·(w'' - b'')|,   |n'| = |ω × n|,  |n''| <= |ω| |n'|
    /// ```
    pub(in crate::measure) fn acceleration_between(
        &self,
        other: &Self,
        (point, radius): (&Vector3<f64>, f64),
        n: &Vector3<f64>,
        (from, to): (f64, f64),
    ) -> f64 {
        let (omega, turn) = (&self.angular_velocity, &other.angular_velocity);
        let around = other.arm(point).cross(turn).norm();
        let speed = (self.velocity - other.velocity).norm() + around;
        let center = self.center + self.velocity * from;
        let far = (center - other.pose(from).transform_point(point)).norm() + (to - from) * speed;
        let first = n.cross(omega).norm();
        let across = if first == 0.0 { n.cross(turn).norm() } else { turn.norm() };
        let sum = first * omega.norm() * (far + radius)
            + 2.0 * first * (speed + turn.norm() * radius)
            + across * (around + turn.norm() * radius);
        sum * (1.0 + 1e-12)
    }

    /// From the centre to a point of the body frame, at time 0.
    fn arm(&self, point: &Vector3<f64>) -> Vector3<f64> {
        self.start.transform_point(point) - self.center
    }

    /// Bound of how far [`Motion::pose`] misplaces the points within `reach` of the body frame's
    /// origin at time t.
    pub(in crate::measure) fn error(&self, t: f64, reach: f64) -> f64 {
        let moved = self.velocity.norm() * t;
        let places = self.start.translation().norm() + moved;
        if !self.is_turning() {
            return gamma(4) * places + ROTATION_ERROR * reach;
        }
        // The angle rounds four times, its sine and cosine and the products with them a few times
        // more.
        let turned = 4.0 * f64::EPSILON * self.angular_velocity.norm() * t + ROTATION_ERROR + gamma(32);
        let arm = (self.start.translation() - self.center).norm();
        turned * (arm + reach) + gamma(8) * (places + self.center.norm())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::tests::random_pose;
    use sublevel_testkit::Seeded;

    #[test]
    fn points_of_the_body_move_as_stated() {
        for seed in 0..300 {
            let mut random = Seeded(seed);
            let start = random_pose(&mut random, 2.0);
            let mut vector = || Vector3::from_fn(|_, _| 3.0 * random.signed());
            let (v, omega, c, point) = (vector(), vector(), vector(), vector());
            let motion = Motion::new(start, v, omega, c).unwrap();
            let x = |t: f64| motion.pose(t).transform_point(&point);
            assert!((x(0.0) - start.transform_point(&point)).norm() < 1e-14, "seed {seed}");
            let (t, h) = (2.0 + random.signed(), 1e-5);
            let rate = (x(t + h) - x(t - h)) / (2.0 * h);
            assert!((rate - motion.velocity_at(t, &x(t))).norm() < 1e-7, "seed {seed}");
            // Rodrigues' formula about the moving centre.
            let (axis, angle) = (omega.normalize(), omega.norm() * t);
            let arm = start.transform_point(&point) - c;
            let turned =
                arm * angle.cos() + axis.cross(&arm) * angle.sin() + axis * axis.dot(&arm) * (1.0 - angle.cos());
            let truth = c + v * t + turned;
            assert!((x(t) - truth).norm() < motion.error(t, point.norm()) + 1e-14, "seed {seed}");
            let n = random.unit();
            let second = n.dot(&(x(t + 1e-3) + x(t - 1e-3) - x(t) * 2.0)) / 1e-6;
            assert!(second.abs() <= motion.acceleration_along(&n, &point, 0.0) + 1e-6, "seed {seed}");
        }
    }

    #[test]
    fn planes_fixed_to_a_body_accelerate_no_faster_than_bounded() {
        for seed in 0..500 {
            let mut random = Seeded(seed);
            let mut vector = |size: f64| Vector3::from_fn(|_, _| size * random.signed());
            let still = seed % 3 == 0;
            let mut motion = || {
                let (start, v, omega, c) = (vector(2.0), vector(3.0), vector(2.0), vector(2.0));
                let pose = Pose::from_quaternion(start, [0.5, -0.5, 0.5, 0.5]).unwrap();
                Motion::new(pose, v, if still { Vector3::zeros() } else { omega }, c).unwrap()
            };
            let (a, b) = (motion(), motion());
            let (n, x, point, y) = (vector(1.0).normalize(), vector(1.0), vector(1.0), vector(1.0));
            let (from, to) = (0.5, 1.7);
            let bound = a.acceleration_between(&b, (&point, (y - point).norm()), &n, (from, to));
            let gap = |t: f64| {
                let apart = a.pose(t).transform_point(&x) - b.pose(t).transform_point(&y);
                a.carry(&n, from, t).0.dot(&apart)
            };
            for k in 1..12 {
                let t = from + 0.1 * f64::from(k);
                let second = (gap(t + 1e-3) + gap(t - 1e-3) - 2.0 * gap(t)) / 1e-6;
                assert!(second.abs() <= bound * (1.0 + 1e-5) + 1e-6, "seed {seed}: {second} above {bound}");
            }
        }
    }

    #[test]
    fn motions_are_checked() {
        let still = Motion::still(random_pose(&mut Seeded(1), 1.0));
        assert_eq!(still.pose(0.0).translation(), still.pose(9.0).translation());
        let bad = Motion::new(Pose::identity(), Vector3::x() * f64::NAN, Vector3::zeros(), Vector3::zeros());
        assert_eq!(bad.unwrap_err(), MotionError::NotFinite("velocity"));
    }
}
