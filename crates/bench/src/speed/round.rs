//! Cylinders and capsules around points: of those about the three axes of the smallest box the
//! least.

use nalgebra::{Matrix3, Vector3};
use std::f64::consts::PI;
use sublevel::body::{Body, BodyError, Normalization};
use sublevel::fit::{smallest_ball, smallest_box};

/// Sizes are made larger by this part: rounding leaves no point outside.
const SLACK: f64 = 1e-9;

/// A cylinder, or a capsule whose axis is as long.
#[derive(Clone, Copy, Debug)]
pub(super) struct Round {
    pub(super) center: Vector3<f64>,
    /// Unit vectors as columns, right-handed; the last one is the axis.
    pub(super) axes: Matrix3<f64>,
    pub(super) radius: f64,
    pub(super) half_height: f64,
}

/// The least cylinder about one of the axes, each with the smallest circle across it.
pub(super) fn smallest_cylinder(points: &[Vector3<f64>]) -> Option<Round> {
    let volume = |found: &Round| found.radius.powi(2) * found.half_height;
    least(points, volume, |z, _| (z, z))
}

/// The least capsule about one of the axes, each with the radius of the smallest circle across it.
pub(super) fn smallest_capsule(points: &[Vector3<f64>]) -> Option<Round> {
    let volume = |found: &Round| PI * found.radius.powi(2) * (2.0 * found.half_height + 4.0 / 3.0 * found.radius);
    // The end of the axis may be as far below the point, or above it, as the ball about it reaches.
    least(points, volume, |z, reach| (z + reach, z - reach))
}

/// `ends` says of a point at a height, and of half the chord there of the ball about an end, how
/// high the axis may begin, and how high it has to end.
fn least(
    points: &[Vector3<f64>],
    volume: impl Fn(&Round) -> f64,
    ends: impl Fn(f64, f64) -> (f64, f64),
) -> Option<Round> {
    let edges = smallest_box(points).axes;
    let about = |k: usize| {
        let axes = Matrix3::from_columns(&[1, 2, 3].map(|i| edges.column((k + i) % 3).into_owned()));
        let along: Vec<Vector3<f64>> = points.iter().map(|point| axes.tr_mul(point)).collect();
        let across: Vec<Vector3<f64>> = along.iter().map(|point| Vector3::new(point.x, point.y, 0.0)).collect();
        let circle = smallest_ball(&across);
        let radius = circle.radius * (1.0 + SLACK);
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (point, across) in along.iter().zip(&across) {
            let reach = (radius.powi(2) - (across - circle.center).norm_squared()).max(0.0).sqrt();
            let (begins, ends) = ends(point.z, reach);
            (low, high) = (low.min(begins), high.max(ends));
        }
        let center = axes * (circle.center + Vector3::z() * (0.5 * (low + high)));
        // Where one ball is enough there is no axis.
        Round { center, axes, radius, half_height: (0.5 * (high - low) * (1.0 + SLACK)).max(0.0) }
    };
    (0..3).map(about).min_by(|a, b| volume(a).total_cmp(&volume(b)))
}

impl Round {
    /// The cylinder as a body.
    pub(super) fn cylinder(&self, name: &str) -> Result<Body, BodyError> {
        let unit = Body::cylinder(name, 1.0, 1.0)?;
        let sizes = Vector3::new(self.radius, self.radius, self.half_height);
        let linear = Matrix3::from_diagonal(&sizes.map(|size| 1.0 / size)) * self.axes.transpose();
        Body::new(name, Normalization { center: self.center, linear }, unit.constraints().to_vec())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::Random;

    /// How far a point is from the axis.
    fn from_axis(round: &Round, point: &Vector3<f64>) -> f64 {
        let own = round.axes.tr_mul(&(point - round.center));
        Vector3::new(own.x, own.y, own.z - own.z.clamp(-round.half_height, round.half_height)).norm()
    }

    #[test]
    fn both_hold_all_points_and_are_no_larger_than_needed() {
        let mut random = Random(5);
        for _ in 0..6 {
            let turn = random.rotation();
            let shift = random.direction() * 3.0;
            // Of a capsule of radius 0.3 whose axis is 1.4 long: the cylinder around it is known.
            let mut points: Vec<Vector3<f64>> = Vec::new();
            for _ in 0..500 {
                let n = random.direction();
                points.push(turn * (n * 0.3 + Vector3::z() * 0.7_f64.copysign(n.z)) + shift);
            }
            let cylinder = smallest_cylinder(&points).unwrap();
            let body = cylinder.cylinder("can").unwrap();
            assert!(body.closed_form().is_some() && body.clone().with_points(&points).is_ok());
            assert!((cylinder.radius - 0.3).abs() < 0.05 && (cylinder.half_height - 1.0).abs() < 0.05, "{cylinder:?}");
            let capsule = smallest_capsule(&points).unwrap();
            let most = points.iter().map(|point| from_axis(&capsule, point)).fold(0.0, f64::max);
            assert!(most <= capsule.radius && most > 0.99 * capsule.radius, "{most} of {capsule:?}");
            assert!((capsule.radius - 0.3).abs() < 0.05 && (capsule.half_height - 0.7).abs() < 0.05, "{capsule:?}");
        }
    }

    #[test]
    fn of_a_ball_the_capsule_has_no_axis() {
        let mut random = Random(7);
        let points: Vec<Vector3<f64>> = (0..3000).map(|_| random.direction()).collect();
        let capsule = smallest_capsule(&points).unwrap();
        assert!(capsule.half_height < 0.1 && capsule.radius < 1.0 + 1e-6, "{capsule:?}");
    }
}
