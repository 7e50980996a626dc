//! What stands on one side of a pair.

use std::sync::Arc;

use nalgebra::{Matrix3, UnitQuaternion, Vector3};
use sublevel_core::body::{Shape, Solid, SosBody};
use sublevel_core::measure::{Capsule, HalfSpace, Pose};

use crate::broad_phase::{WorldBall, world_ball};
use crate::geometry::Geometry;
use crate::object::{Object, Slot};

/// One side of a pair, where it stands.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Thing<'a> {
    /// Solids of one object, coarsest first, at a world pose. With `set` they only contain it, as
    /// the box around an sos-body does.
    Solid { rungs: &'a [Arc<Shape>], pose: &'a Pose, set: Option<&'a SosBody> },
    /// A capsule about the z axis of its frame, at a world pose.
    Capsule { capsule: &'a Capsule, pose: &'a Pose },
    /// A half-space of the world frame.
    HalfSpace(WorldHalfSpace),
    /// A point of the world frame, metres.
    Point(Vector3<f64>),
}

/// A half-space of the world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WorldHalfSpace {
    pub(crate) half_space: HalfSpace,
    /// About which it turns, metres.
    pub(crate) origin: Vector3<f64>,
    /// Bound of the error of its unit normal, from turning it.
    pub(crate) normal_error: f64,
    /// Bound of the error of its offset, metres; ∞ where it is too far away to be placed.
    offset_error_m: f64,
}

impl WorldHalfSpace {
    /// A half-space given in the world frame.
    pub(crate) fn fixed(half_space: HalfSpace) -> Self {
        Self { half_space, origin: Vector3::zeros(), normal_error: 0.0, offset_error_m: 0.0 }
    }

    /// A half-space of a body frame where it stands.
    fn placed(half_space: &HalfSpace, pose: &Pose) -> Self {
        if *pose == Pose::identity() {
            return Self::fixed(*half_space);
        }
        // A floor that was only moved keeps its normal, so that rays along it miss it.
        let (normal, normal_error) = if *pose.rotation() == UnitQuaternion::identity() {
            (*half_space.normal(), 0.0)
        } else {
            (pose.transform_direction(half_space.normal()).normalize(), 32.0 * f64::EPSILON)
        };
        let origin = *pose.translation();
        let offset = half_space.offset() + normal.dot(&origin);
        let offset_error_m = 8.0 * f64::EPSILON * (half_space.offset().abs() + origin.norm());
        match HalfSpace::new(normal, offset) {
            Ok(half_space) => Self { half_space, origin, normal_error, offset_error_m },
            Err(_) => Self { half_space: *half_space, origin, normal_error, offset_error_m: f64::INFINITY },
        }
    }

    /// Bound of the error of a signed distance of points within `reach_m` of the world's origin,
    /// metres.
    pub(crate) fn slack_m(&self, reach_m: f64) -> f64 {
        self.normal_error * (reach_m + self.origin.norm()) + self.offset_error_m
    }
}

impl<'a> Thing<'a> {
    /// An object where it stands.
    pub(crate) fn object(object: &'a Object, pose: &'a Pose) -> Self {
        match &object.geometry {
            Geometry::HalfSpace(half_space) => Self::HalfSpace(WorldHalfSpace::placed(half_space.half_space(), pose)),
            Geometry::Capsule(capsule) => Self::Capsule { capsule: capsule.capsule(), pose },
            Geometry::SosBody(body) => Self::Solid { rungs: object.solids(), pose, set: Some(body) },
            Geometry::Solid(_) | Geometry::Ladder(_) => Self::Solid { rungs: object.solids(), pose, set: None },
        }
    }

    /// Where it stands; none of half-spaces and points.
    pub(crate) fn pose(&self) -> Option<&'a Pose> {
        match self {
            Self::Solid { pose, .. } | Self::Capsule { pose, .. } => Some(pose),
            Self::HalfSpace(_) | Self::Point(_) => None,
        }
    }

    /// A ball around it in the world frame: centre and radius, metres; none around a half-space.
    pub(crate) fn ball(&self) -> Option<WorldBall> {
        match self {
            Self::Solid { rungs, pose, .. } => {
                let ball = rungs.last()?.circumscribed();
                Some(world_ball(pose, (ball.center, ball.radius)))
            }
            Self::Capsule { capsule, pose } => Some(world_ball(pose, (Vector3::zeros(), capsule.reach_m()))),
            Self::HalfSpace(_) => None,
            Self::Point(point) => Some((*point, 0.0)),
        }
    }

    /// Lower bound of the signed distance from balls alone, metres; −∞ where balls say nothing.
    pub(crate) fn ball_gap_m(&self, other: &Self) -> f64 {
        match (self, other) {
            (Self::HalfSpace(half_space), thing) | (thing, Self::HalfSpace(half_space)) => {
                thing.ball().map_or(f64::NEG_INFINITY, |ball| half_space_gap(half_space, ball))
            }
            (a, b) => match (a.ball(), b.ball()) {
                (Some(a), Some(b)) => ball_gap(a, b),
                _ => f64::NEG_INFINITY,
            },
        }
    }

    /// Lower bound of the signed distance from the boxes around two things in their own frames,
    /// metres. −∞ where a side has no box.
    pub(crate) fn box_gap_m(&self, other: &Self) -> f64 {
        match (self.oriented_box(), other.oriented_box()) {
            (Some(a), Some(b)) => a.gap_m(&b),
            _ => f64::NEG_INFINITY,
        }
    }

    /// The box around a solid or a capsule in its own frame, where it stands.
    pub(crate) fn oriented_box(&self) -> Option<OrientedBox> {
        let (pose, middle, half) = match self {
            Self::Solid { rungs, pose, .. } => {
                let bounds = rungs.last()?.bounding_box();
                (*pose, (bounds.max + bounds.min) * 0.5, (bounds.max - bounds.min) * 0.5)
            }
            Self::Capsule { capsule, pose } => {
                let radius = capsule.radius_m();
                (*pose, Vector3::zeros(), Vector3::new(radius, radius, capsule.reach_m()))
            }
            Self::HalfSpace(_) | Self::Point(_) => return None,
        };
        let axes = pose.rotation().to_rotation_matrix().into_inner();
        // Of the centre, which may be far from either origin although the box is not.
        let rounding = 32.0 * f64::EPSILON * (pose.translation().amax() + middle.amax() + half.amax());
        Some(OrientedBox { center: axes * middle + pose.translation(), axes, half: half.add_scalar(rounding) })
    }
}

/// A box with its edges along the columns of a rotation, metres, world frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct OrientedBox {
    center: Vector3<f64>,
    axes: Matrix3<f64>,
    half: Vector3<f64>,
}

impl OrientedBox {
    /// Lower bound of the signed distance of what is inside, metres, rounding included: the
    /// distance of one box from the box along the same axes around the other, or the other way
    /// round.
    pub(crate) fn gap_m(&self, other: &Self) -> f64 {
        let (a, b) = (self, other);
        let between = b.center - a.center;
        let rotation = a.axes.tr_mul(&b.axes);
        let (in_a, in_b) = (a.axes.tr_mul(&between), b.axes.tr_mul(&between));
        let turned = rotation.abs();
        let (reach_a, reach_b) = (a.half + turned * b.half, b.half + turned.tr_mul(&a.half));
        let gap = gap_of_sides(&(in_a.abs() - reach_a)).max(gap_of_sides(&(in_b.abs() - reach_b)));
        // Some twenty roundings, each relative to the largest length that occurs.
        gap - 64.0 * f64::EPSILON * (a.center.amax() + b.center.amax() + a.half.amax() + b.half.amax())
    }
}

/// Signed distance of two boxes along the same axes from their gaps along these, metres.
fn gap_of_sides(gaps: &Vector3<f64>) -> f64 {
    let largest = gaps.max();
    if largest > 0.0 { gaps.sup(&Vector3::zeros()).norm() } else { largest }
}

/// Lower bound of the distance of two balls, rounding included, metres.
pub(crate) fn ball_gap((a, radius_a): WorldBall, (b, radius_b): WorldBall) -> f64 {
    let (distance, radii) = ((a - b).norm(), radius_a + radius_b);
    // Rounding of the centres where they stand, of the norm and of the differences.
    distance - radii - 32.0 * f64::EPSILON * (a.norm() + b.norm() + radii)
}

fn half_space_gap(of: &WorldHalfSpace, (center, radius): WorldBall) -> f64 {
    let reach = center.norm() + radius;
    let height = of.half_space.normal().dot(&center) - of.half_space.offset();
    height - radius - of.slack_m(reach) - 32.0 * f64::EPSILON * (reach + of.half_space.offset().abs())
}

/// Which pair of a scene is solved, for its warm starts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PairSlots {
    pub(crate) a: Slot,
    pub(crate) b: Slot,
}

#[cfg(test)]
mod tests {
    use super::*;
    use sublevel_core::body::Body;
    use sublevel_testkit::Seeded;

    /// A sum of two numbers, exact to some 1e-31 of its size (Dekker 1971).
    #[derive(Clone, Copy)]
    struct Double(f64, f64);

    impl Double {
        fn sum(a: f64, b: f64) -> Self {
            let sum = a + b;
            let from_b = sum - a;
            Self(sum, (a - (sum - from_b)) + (b - from_b))
        }

        fn plus(self, other: Self) -> Self {
            let Self(high, low) = Self::sum(self.0, other.0);
            Self::sum(high, low + self.1 + other.1)
        }

        fn times(self, other: Self) -> Self {
            let high = self.0 * other.0;
            let low = self.0.mul_add(other.0, -high) + (self.0 * other.1 + self.1 * other.0);
            Self::sum(high, low)
        }
    }

    /// Where a pose takes a point, its quaternion normalised: t + (2 (q·p) q + (w² - q²) p + 2 w q
    /// x p) / |q|².
    fn placed(pose: &Pose, point: &Vector3<f64>) -> [Double; 3] {
        let double = |value: f64| Double(value, 0.0);
        let [x, y, z, w]: [Double; 4] = <[f64; 4]>::from(pose.rotation().coords).map(double);
        let p: [Double; 3] = <[f64; 3]>::from(*point).map(double);
        let q = [x, y, z];
        let minus = |a: Double| Double(-a.0, -a.1);
        let dot = |a: [Double; 3], b: [Double; 3]| a[0].times(b[0]).plus(a[1].times(b[1])).plus(a[2].times(b[2]));
        let (along, square) = (dot(q, p), dot(q, q));
        let size = square.plus(w.times(w));
        // 1 / size to second order: it is 1 but for rounding.
        let inverse = double(2.0).plus(minus(size));
        std::array::from_fn(|i| {
            let (j, k) = ((i + 1) % 3, (i + 2) % 3);
            let cross = q[j].times(p[k]).plus(minus(q[k].times(p[j])));
            let turned = double(2.0)
                .times(along.times(q[i]).plus(w.times(cross)))
                .plus(w.times(w).plus(minus(square)).times(p[i]));
            turned.times(inverse).plus(double(pose.translation()[i]))
        })
    }

    /// Far from their own frames' origins, and placed so that they are near the world's: what the
    /// rounding of a centre takes away is given back.
    #[test]
    fn balls_and_boxes_contain_what_is_far_from_its_own_frame() {
        let (mut random, mut largest) = (Seeded(5), 0.0_f64);
        let mut ball = || {
            let center = random.between(1.0, 1e7) * random.unit();
            let body = Body::ball("ball", center, 0.01).expect("a ball");
            (center, Arc::new(Shape::Body(Box::new(body))))
        };
        let balls: Vec<_> = (0..200).map(|_| ball()).collect();
        for step in 0..2000 {
            let (center, shape) = &balls[step % 200];
            let rotation = random.rotation();
            let pose = Pose::from_quaternion(random.unit() - rotation * center, rotation.coords.into());
            let pose = pose.expect("a pose");
            let thing = Thing::Solid { rungs: std::slice::from_ref(shape), pose: &pose, set: None };
            let (ball, bounds) = (shape.circumscribed(), shape.bounding_box());
            let error = |computed: &Vector3<f64>, of: &Vector3<f64>| {
                let exact = placed(&pose, of);
                let apart = |i: usize| Double::sum(computed[i], -exact[i].0).0 - exact[i].1;
                Vector3::from_fn(|i, _| apart(i)).norm()
            };
            let (middle, radius) = thing.ball().expect("a ball");
            let off = error(&middle, &ball.center);
            assert!(radius - ball.radius >= off, "seed 5, {step}: {off:e} {:e}", radius - ball.radius);
            let oriented = thing.oriented_box().expect("a box");
            let half = (bounds.max - bounds.min) * 0.5;
            let off_box = error(&oriented.center, &((bounds.max + bounds.min) * 0.5));
            assert!((oriented.half - half).min() >= off_box, "seed 5, {step}: {off_box:e}");
            largest = largest.max(off / (32.0 * f64::EPSILON * (middle.norm() + radius)));
        }
        // Of the size in the world alone no bound would hold.
        assert!(largest > 10.0, "{largest}");
    }
}
