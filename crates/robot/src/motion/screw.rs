//! Screw motions: how a floating joint goes from one pose to the next.
//!
//! The joint turns by the smaller angle θ about a line that stays where it is, at a constant rate,
//! while it slides along that line (Chasles). With `e` the way of the origin, a the unit vector of
//! the line and `e = e_a + e_n` the parts along and across a, the origin has gone
//!
//! ```text
//! t e_a + sin(t θ / 2) / sin(θ / 2) R(a, (t - 1) θ / 2) e_n
//! ```
//!
//! at t in [0, 1]: a chord of a circle whose whole chord is `e_n`. Without a turn it is `t e`.

use nalgebra::{Quaternion, UnitQuaternion, Vector3};

/// The motion from one pose of a floating joint to the next; frame of the joint at rest, metres.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Screw {
    origin: Vector3<f64>,
    rotation: UnitQuaternion<f64>,
    /// As a vector in the frame of the first pose, radians.
    turn: Vector3<f64>,
    /// Of the line, a unit vector; zero without a turn.
    axis: Vector3<f64>,
    /// From 0 to π.
    angle: f64,
    along: Vector3<f64>,
    across: Vector3<f64>,
}

/// Bound of the rounding of the way of an origin, relative to its length, and of an angle, radians:
/// two quaternions are normalised and multiplied, and the angle and the axis are taken from that
/// (fewer than 32 roundings). The axis of a small angle is rounded by more, but moves the origin in
/// proportion to that angle.
const SCREW_ROUNDING: f64 = 64.0 * f64::EPSILON;

impl Screw {
    /// Between two poses: translation and unit quaternion x y z w.
    ///
    /// # Panics
    /// When these are not seven numbers each.
    pub(crate) fn new(from: &[f64], to: &[f64]) -> Self {
        let [(origin, rotation), (end, last)] = [from, to].map(pose);
        let turn = (rotation.inverse() * last).scaled_axis();
        let (way, angle) = (end - origin, turn.norm());
        let axis = (rotation * turn).try_normalize(0.0).unwrap_or_default();
        let along = axis * axis.dot(&way);
        Self { origin, rotation, turn, axis, angle, along, across: way - along }
    }

    /// Writes the pose at t in [0, 1].
    ///
    /// # Panics
    /// When the pose is not of seven numbers.
    pub(crate) fn write_at(&self, t: f64, pose: &mut [f64]) {
        let half = 0.5 * self.angle;
        let chord = if half > 0.0 { (t * half).sin() / half.sin() } else { t };
        let ahead = UnitQuaternion::from_scaled_axis(self.axis * ((t - 1.0) * half));
        let origin = self.origin + self.along * t + ahead * (self.across * chord);
        let rotation = self.rotation * UnitQuaternion::from_scaled_axis(self.turn * t);
        pose[..3].copy_from_slice(origin.as_slice());
        pose[3..7].copy_from_slice(rotation.coords.as_slice());
    }

    /// Bounds, rounded upwards, of how far the origin gets, metres, and of how far the joint turns,
    /// radians, while t changes by `width`.
    pub(crate) fn deviations(&self, width: f64) -> (f64, f64) {
        let half = 0.5 * self.angle;
        // Arc over chord of the whole turn, at most π / 2.
        let arc = if half > 0.0 { half / half.sin() } else { 1.0 };
        let way = self.along.norm() + self.across.norm();
        let speed = self.along.norm().hypot(self.across.norm() * arc);
        let slack = SCREW_ROUNDING * way + if way > 0.0 { SCREW_ROUNDING * self.origin.norm() } else { 0.0 };
        (speed * width * (1.0 + SCREW_ROUNDING) + slack, self.angle * width + SCREW_ROUNDING)
    }
}

fn pose(numbers: &[f64]) -> (Vector3<f64>, UnitQuaternion<f64>) {
    let turned = Quaternion::new(numbers[6], numbers[3], numbers[4], numbers[5]);
    (Vector3::from_column_slice(&numbers[..3]), UnitQuaternion::new_normalize(turned))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Isometry3, Translation3};
    use sublevel_testkit::Seeded;

    fn numbers(pose: &Isometry3<f64>) -> [f64; 7] {
        let (p, q) = (pose.translation.vector, pose.rotation.coords);
        [p.x, p.y, p.z, q.x, q.y, q.z, q.w]
    }

    fn at(screw: &Screw, t: f64) -> Isometry3<f64> {
        let mut found = [0.0; 7];
        screw.write_at(t, &mut found);
        let (origin, rotation) = pose(&found);
        Isometry3::from_parts(Translation3::from(origin), rotation)
    }

    fn apart(a: &Isometry3<f64>, b: &Isometry3<f64>) -> f64 {
        (a.translation.vector - b.translation.vector).norm() + a.rotation.angle_to(&b.rotation)
    }

    /// Poses apart by a turn of this angle, radians, and a way of this length, metres.
    fn poses(seeded: &mut Seeded, angle: f64, way: f64) -> [Isometry3<f64>; 2] {
        let from = Isometry3::from_parts((seeded.unit() * 2.0).into(), seeded.rotation());
        let turn = UnitQuaternion::from_scaled_axis(seeded.unit() * angle);
        let to = from.translation.vector + seeded.unit() * way;
        [from, Isometry3::from_parts(to.into(), from.rotation * turn)]
    }

    #[test]
    fn equal_steps_are_one_motion_again_and_again() {
        // What screws are: the same rigid motion of the world takes every pose to the next one.
        let angles = [0.0, 1e-300, 1e-9, 1e-4, 0.5, 2.0, 3.1, std::f64::consts::PI - 1e-7];
        for seed in 0..400 {
            let mut seeded = Seeded(seed);
            let (angle, way) = (angles[seeded.index(8)], [0.0, 1e-6, 1.0, 30.0][seeded.index(4)]);
            let [from, to] = poses(&mut seeded, angle, way);
            let screw = Screw::new(&numbers(&from), &numbers(&to));
            let name = format!("seed {seed}: {angle:e} rad and {way:e} m");
            assert!(
                apart(&at(&screw, 0.0), &from) < 1e-13 && apart(&at(&screw, 1.0), &to) < 1e-13 * (1.0 + way),
                "{name}"
            );
            let steps = 2 + seeded.index(6);
            let step = at(&screw, 1.0 / steps as f64) * from.inverse();
            assert!((step.rotation.angle() - angle / steps as f64).abs() < 1e-13, "{name}: the smaller angle");
            let mut expected = from;
            for k in 1..=steps {
                expected = step * expected;
                let error = apart(&at(&screw, k as f64 / steps as f64), &expected);
                assert!(error < 1e-12 * (1.0 + way), "{name}, step {k} of {steps}: off by {error:e}");
            }
        }
    }

    #[test]
    fn no_part_of_it_goes_farther_than_its_deviations() {
        let mut ratios = [0.0_f64; 2];
        for seed in 0..400 {
            let mut seeded = Seeded(seed);
            let (angle, way) = ([0.0, 1e-9, 0.3, 3.1][seeded.index(4)], [0.0, 1e-5, 2.0][seeded.index(3)]);
            let [from, to] = poses(&mut seeded, angle, way);
            let screw = Screw::new(&numbers(&from), &numbers(&to));
            let width = [1.0, 0.5, 1e-3, 1e-9][seeded.index(4)];
            let (start, (shift, turned)) = (seeded.positive() * (1.0 - width), screw.deviations(width));
            for sample in 0..=20 {
                let [a, b] = [start, start + width * f64::from(sample) / 20.0].map(|t| at(&screw, t));
                let moved = (a.translation.vector - b.translation.vector).norm();
                assert!(moved <= shift, "seed {seed}: {moved:e} > {shift:e}");
                assert!(a.rotation.angle_to(&b.rotation) <= turned, "seed {seed}: {turned:e}");
                if moved > 1e-3 && angle > 0.1 {
                    ratios = [ratios[0].max(moved / shift), ratios[1].max(a.rotation.angle_to(&b.rotation) / turned)];
                }
            }
        }
        assert!(ratios.iter().all(|ratio| *ratio > 0.99), "the bounds are attained: {ratios:?}");
    }

    #[test]
    fn a_door_stays_on_its_hinge() {
        // About a hinge along z through (1, 0, 0), by a right angle, while it is lifted by 0.2 m.
        let from = [0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0];
        let half = std::f64::consts::FRAC_1_SQRT_2;
        let to = [1.0, -1.0, 0.2, 0.0, 0.0, half, half];
        let screw = Screw::new(&from, &to);
        for sample in 0..=10 {
            let t = f64::from(sample) / 10.0;
            let (sine, cosine) = (t * std::f64::consts::FRAC_PI_2).sin_cos();
            let found = at(&screw, t);
            let expected = Vector3::new(1.0 - cosine, -sine, 0.2 * t);
            assert!((found.translation.vector - expected).norm() < 1e-15, "{t}: {found}");
        }
        let (shift, turned) = screw.deviations(1.0);
        let quarter = std::f64::consts::FRAC_PI_2;
        assert!((shift - quarter.hypot(0.2)).abs() < 1e-12 && (turned - quarter).abs() < 1e-12, "{shift} {turned}");
    }
}
