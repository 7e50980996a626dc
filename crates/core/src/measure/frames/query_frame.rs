//! Two bodies in one frame: the query frame of a measure.
//!
//! The query frame is the frame of the first body, moved to the centre of its circumscribed ball
//! and scaled by a power of two near the larger circumradius, so that lengths are about 1 whatever
//! the unit, and absolute positions play no part.

use crate::body::{Body, Placement, Sample, largest};
use crate::measure::frames::pose::{Pose, RELATIVE_ERROR};
use crate::polynomial::{Jet, gamma};
use nalgebra::{Matrix3, Vector3};
use std::cell::Cell;

/// A body in the query frame.
pub(in crate::measure) struct Posed<'a> {
    pub(in crate::measure) body: &'a Body,
    placement: Placement,
    /// Stored interior point.
    pub(in crate::measure) interior: Vector3<f64>,
    center: Vector3<f64>,
    pub(in crate::measure) radius: f64,
    /// The last evaluation: a step, its bracket and its feasible point begin at the same place.
    last: Cell<Option<Evaluated>>,
}

/// Value of a constraint, dimensionless, below which it is met at a point and at those about as far
/// from it as rounding leads.
///
/// Above 1 it would be violated; lower, more constraints are evaluated without need: it changes
/// time only, and no test pins it.
const WELL_INSIDE: f64 = 0.9;

/// A constraint of more than degree 2 where it was evaluated, by normalized coordinates.
#[derive(Clone, Copy)]
struct Evaluated {
    constraint: usize,
    z: Vector3<f64>,
    jet: Jet,
}

impl Posed<'_> {
    /// Number of constraints.
    pub(in crate::measure) fn len(&self) -> usize {
        self.body.constraints().len()
    }

    /// Constraint i at the point v.
    pub(in crate::measure) fn jet(&self, i: usize, v: &Vector3<f64>) -> Jet {
        self.placement.pull_back(self.evaluated(i, &self.placement.coordinates(v)))
    }

    /// Value of constraint i at the point v.
    pub(in crate::measure) fn value(&self, i: usize, v: &Vector3<f64>) -> f64 {
        self.value_at(i, &self.placement.coordinates(v))
    }

    /// Value of constraint i by the normalized coordinates of a point.
    fn value_at(&self, i: usize, z: &Vector3<f64>) -> f64 {
        let polynomial = &self.body.constraints()[i].polynomial;
        if polynomial.degree() == 2 { polynomial.value(z) } else { self.evaluated(i, z).value }
    }

    /// Value and gradient of constraint i at the point v.
    pub(in crate::measure) fn tangent(&self, i: usize, v: &Vector3<f64>) -> (f64, Vector3<f64>) {
        let Jet { value, gradient, .. } = self.evaluated(i, &self.placement.coordinates(v));
        (value, self.pulled_back(&gradient))
    }

    /// Constraint i by the normalized coordinates of a point.
    fn evaluated(&self, i: usize, z: &Vector3<f64>) -> Jet {
        let polynomial = &self.body.constraints()[i].polynomial;
        if polynomial.degree() == 2 {
            return polynomial.evaluate(z);
        }
        if let Some(last) = self.last.get()
            && last.constraint == i
            && last.z == *z
        {
            return last.jet;
        }
        let jet = polynomial.evaluate(z);
        self.last.set(Some(Evaluated { constraint: i, z: *z, jet }));
        jet
    }

    /// Sum of the gradients at v, weighted by multipliers of all constraints.
    pub(in crate::measure) fn weighted_gradient(&self, v: &Vector3<f64>, multipliers: &[f64]) -> Vector3<f64> {
        (0..self.len()).map(|i| self.tangent(i, v).1 * multipliers[i]).sum()
    }

    /// Constraint i at the point v with its error bounds.
    pub(in crate::measure) fn sample(&self, i: usize, v: &Vector3<f64>) -> Sample<'_> {
        let z = self.placement.coordinates(v);
        self.placement.sample_at(&self.body.constraints()[i].polynomial, v, (z, self.evaluated(i, &z)))
    }

    /// Bound of the distance between v and the point of the exact frame that its samples are of.
    pub(in crate::measure) fn displacement(&self, v: &Vector3<f64>) -> f64 {
        self.placement.displacement(v)
    }

    /// A linear functional of points in the body's normalized coordinates, with a bound of each
    /// component's error.
    pub(in crate::measure) fn functional(&self, r: &Vector3<f64>) -> (Vector3<f64>, Vector3<f64>) {
        self.placement.functional(r)
    }

    /// Bounds of how far the normalized coordinates of points of the body are from those of v.
    pub(in crate::measure) fn spans(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.placement.spans(v, self.body.z_extent())
    }

    /// Rigorous upper bound of the largest constraint at all points within `distance` of v.
    pub(in crate::measure) fn value_upper(&self, v: &Vector3<f64>, distance: f64) -> f64 {
        largest((0..self.len()).map(|i| self.sample(i, v).value_upper(distance)))
    }

    /// Rigorous upper bound of the largest constraint at some point within the displacement of v.
    fn nearby_value_upper(&self, v: &Vector3<f64>) -> f64 {
        largest((0..self.len()).map(|i| self.sample(i, v).nearby_value_upper()))
    }

    /// Whether v is proven to lie in the body.
    pub(in crate::measure) fn contains(&self, v: &Vector3<f64>) -> bool {
        self.value_upper(v, 0.0) <= 1.0
    }

    /// How long a step is in normalized coordinates, relative to the body's size there.
    pub(in crate::measure) fn relative_length(&self, step: &Vector3<f64>) -> f64 {
        self.normalized(step).norm() / self.body.trust().radius
    }

    /// The matrix of the square of a step's length in normalized coordinates.
    pub(in crate::measure) fn metric(&self) -> Matrix3<f64> {
        self.placement.linear().tr_mul(self.placement.linear())
    }

    /// A step in normalized coordinates.
    pub(in crate::measure) fn normalized(&self, step: &Vector3<f64>) -> Vector3<f64> {
        self.placement.linear() * step
    }

    /// A gradient in normalized coordinates as one in the query frame.
    pub(in crate::measure) fn pulled_back(&self, gradient: &Vector3<f64>) -> Vector3<f64> {
        self.placement.linear().tr_mul(gradient)
    }

    /// Upper bound ρ of the distance from v, or a point within its displacement, to any point of
    /// the body.
    pub(in crate::measure) fn reach(&self, v: &Vector3<f64>) -> f64 {
        ((v - self.center).norm() + self.radius + self.displacement(v)) * (1.0 + 1e-14)
    }

    /// The point where the line from v along the unit vector `direction` enters the body, up to
    /// rounding; v itself if it is inside, anywhere if the line misses.
    ///
    /// Each constraint is convex along the line, so Newton's method for its root never passes it.
    pub(in crate::measure) fn enter(&self, v: &Vector3<f64>, direction: &Vector3<f64>) -> Vector3<f64> {
        let mut point = *v;
        for _ in 0..16 {
            let tangents = (0..self.len()).map(|i| self.tangent(i, &point));
            let steps = tangents.map(|(value, gradient)| (value - 1.0, -gradient.dot(direction)));
            let longest =
                steps.filter(|(excess, _)| *excess > 0.0).map(|(excess, slope)| excess / slope).fold(0.0, f64::max);
            point += direction * longest;
            if longest < 1e-15 {
                break;
            }
        }
        point
    }

    /// A point within whose displacement a point of the body is proven to lie, near v.
    ///
    /// Against the gradients of the violated constraints the way to the body is shortest; where
    /// steps that way do not lead in, the line to the interior point does. None if not even that is
    /// proven inside in this frame.
    pub(in crate::measure) fn move_inside(&self, v: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut point = *v;
        let mut nudge = 4.0 * f64::EPSILON;
        for _ in 0..4 {
            let (mut step, mut inside) = (Vector3::zeros(), true);
            let z = self.placement.coordinates(&point);
            let trust = Some(self.body.trust()).filter(|trust| z.norm() <= trust.radius);
            for i in 0..self.len() {
                // Most constraints of many are far from their boundaries.
                if let Some(trust) = trust
                    && self.value_at(i, &z) + trust.constraints[i].value_error < WELL_INSIDE
                {
                    continue;
                }
                let sample = self.sample(i, &point);
                let error = sample.nearby_value_error();
                let excess = (sample.value() + error).next_up() - 1.0;
                inside &= excess <= 0.0;
                if excess.is_nan() {
                    return self.move_towards_interior(v);
                }
                let gradient = sample.gradient();
                // What the steps for other constraints leave of it.
                let left = excess + gradient.dot(&step);
                if left > 0.0 {
                    // Past the boundary by about the error that is paid for anyway, so that how
                    // rounding falls does not matter.
                    step -= gradient * ((left + error) / gradient.norm_squared() * (1.0 + nudge));
                }
            }
            if inside {
                return Some(point);
            }
            if !(step.norm() <= 0.1 * self.radius) {
                break;
            }
            point += step;
            nudge = 1e-6;
        }
        self.move_towards_interior(v)
    }

    /// Convexity along the segment gives the factor `s = (1 - g(a)) / (g(v) - g(a))` from the
    /// interior point a; rounding takes a little more.
    fn move_towards_interior(&self, v: &Vector3<f64>) -> Option<Vector3<f64>> {
        let mut value = self.nearby_value_upper(v);
        if value <= 1.0 {
            return Some(*v);
        }
        let deepest = self.body.min_value();
        let mut margin = 4.0 * f64::EPSILON;
        let mut point = *v;
        for _ in 0..24 {
            if !value.is_finite() {
                break;
            }
            let factor = ((1.0 - deepest) / (value - deepest)).min(1.0) * (1.0 - margin);
            point = self.interior + (point - self.interior) * factor;
            value = self.nearby_value_upper(&point);
            if value <= 1.0 {
                return Some(point);
            }
            margin *= 4.0;
        }
        (self.nearby_value_upper(&self.interior) <= 1.0).then_some(self.interior)
    }
}

impl<'a> Posed<'a> {
    /// A body in its own frame, moved to the centre of its circumscribed ball and scaled to units
    /// of this number of metres, a power of two.
    pub(in crate::measure) fn own(body: &'a Body, unit: f64) -> Self {
        let (origin, center) = (body.circumscribed().center, body.normalization().center);
        let placement = Placement::new(
            body.normalization().linear * unit,
            body.inverse() / unit,
            (center - origin) / unit,
            0.0,
            gamma(2) * (center.norm() + origin.norm()) / unit,
        );
        Self {
            body,
            placement,
            interior: (body.interior_point() - origin) / unit,
            center: Vector3::zeros(),
            radius: body.circumscribed().radius / unit,
            last: Cell::new(None),
        }
    }
}

/// Two bodies in the query frame.
pub(in crate::measure) struct Pair<'a> {
    pub(in crate::measure) a: Posed<'a>,
    pub(in crate::measure) b: Posed<'a>,
    /// Metres per unit of the query frame: a power of two.
    unit: f64,
    /// Origin of the query frame in the frame of the first body, metres.
    origin: Vector3<f64>,
    /// Rotation and translation of the second body's frame in the first's, metres.
    pub(in crate::measure) rotation: Matrix3<f64>,
    translation: Vector3<f64>,
    pose_a: Pose,
    pose_b: Pose,
}

impl<'a> Pair<'a> {
    pub(in crate::measure) fn new(a: &'a Body, pose_a: &Pose, b: &'a Body, pose_b: &Pose) -> Self {
        // Differences of translations are exact to one rounding, however far from the world origin.
        let inverse_a = pose_a.rotation().to_rotation_matrix().transpose().into_inner();
        let rotation = inverse_a * pose_b.rotation().to_rotation_matrix().into_inner();
        let translation = inverse_a * (pose_b.translation() - pose_a.translation());
        let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
        let unit = ball_a.radius.max(ball_b.radius).log2().round().exp2();
        let origin = ball_a.center;

        let own_center = a.normalization().center;
        let placement_a = Placement::new(
            a.normalization().linear * unit,
            a.inverse() / unit,
            (own_center - origin) / unit,
            0.0,
            gamma(2) * (own_center.norm() + origin.norm()) / unit,
        );
        let to_query = |point: &Vector3<f64>| (rotation * point + translation - origin) / unit;
        let other_center = b.normalization().center;
        let relative = RELATIVE_ERROR;
        let off = |point: &Vector3<f64>| {
            (relative * (point.norm() + translation.norm()) + gamma(8) * origin.norm()) / unit * (1.0 + 1e-14)
        };
        let placement_b = Placement::new(
            b.normalization().linear * rotation.transpose() * unit,
            rotation * b.inverse() / unit,
            to_query(&other_center),
            relative,
            off(&other_center),
        );
        Self {
            a: Posed {
                body: a,
                placement: placement_a,
                interior: (a.interior_point() - origin) / unit,
                center: Vector3::zeros(),
                radius: ball_a.radius / unit,
                last: Cell::new(None),
            },
            b: Posed {
                body: b,
                placement: placement_b,
                interior: to_query(b.interior_point()),
                center: to_query(&ball_b.center),
                radius: ball_b.radius / unit + off(&ball_b.center),
                last: Cell::new(None),
            },
            unit,
            origin,
            rotation,
            translation,
            pose_a: *pose_a,
            pose_b: *pose_b,
        }
    }

    /// Whether v is proven to lie in both bodies.
    pub(in crate::measure) fn common(&self, v: &Vector3<f64>) -> bool {
        self.a.contains(v) && self.b.contains(v)
    }

    /// Whether neither body has edges.
    pub(in crate::measure) fn smooth(&self) -> bool {
        self.a.body.is_smooth() && self.b.body.is_smooth()
    }

    /// Metres per unit of the query frame.
    pub(in crate::measure) fn unit(&self) -> f64 {
        self.unit
    }

    /// Origin of the query frame in the first body's frame, metres.
    pub(in crate::measure) fn origin(&self) -> &Vector3<f64> {
        &self.origin
    }

    /// The poses of both bodies.
    pub(in crate::measure) fn poses(&self) -> (&Pose, &Pose) {
        (&self.pose_a, &self.pose_b)
    }

    /// Width in query units of a bracket of this accuracy: see
    /// [`crate::measure::Options::with_accuracy`].
    pub(in crate::measure) fn tolerance(&self, accuracy: f64) -> f64 {
        let other = self.b.body.circumscribed().radius / self.unit;
        accuracy * self.a.radius.min(other)
    }

    /// Circumradius of the larger body in query units.
    pub(in crate::measure) fn size(&self) -> f64 {
        self.a.radius.max(self.b.body.circumscribed().radius / self.unit)
    }

    /// World position of a point of the query frame, metres.
    pub(in crate::measure) fn to_world(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.pose_a.transform_point(&self.to_a(v))
    }

    /// World direction of a direction of the query frame.
    pub(in crate::measure) fn direction_to_world(&self, n: &Vector3<f64>) -> Vector3<f64> {
        self.pose_a.transform_direction(n)
    }

    /// Point of the query frame in the first body's frame, metres.
    pub(in crate::measure) fn to_a(&self, v: &Vector3<f64>) -> Vector3<f64> {
        v * self.unit + self.origin
    }

    /// Inverse of [`Pair::to_a`].
    pub(in crate::measure) fn a_to_query(&self, x: &Vector3<f64>) -> Vector3<f64> {
        (x - self.origin) / self.unit
    }

    /// Point of the query frame in the second body's frame, metres.
    pub(in crate::measure) fn to_b(&self, v: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * (self.to_a(v) - self.translation)
    }

    /// Inverse of [`Pair::to_b`].
    pub(in crate::measure) fn b_to_query(&self, y: &Vector3<f64>) -> Vector3<f64> {
        self.a_to_query(&(self.rotation * y + self.translation))
    }

    /// Inverse of [`Pair::to_world`].
    pub(in crate::measure) fn world_to_query(&self, x: &Vector3<f64>) -> Vector3<f64> {
        let from_a = x - self.pose_a.translation();
        self.a_to_query(&self.pose_a.rotation().inverse_transform_vector(&from_a))
    }

    /// Growth centres of both bodies, and a bound of the error of either.
    pub(in crate::measure) fn growth_centers(&self) -> (Vector3<f64>, Vector3<f64>, f64) {
        let (a, b) = (self.a.body.growth_ball().center, self.b.body.growth_ball().center);
        let relative = RELATIVE_ERROR;
        let lengths = a.norm() + b.norm() + self.translation.norm() + self.origin.norm();
        (self.a_to_query(&a), self.b_to_query(&b), relative * lengths / self.unit * (1.0 + 1e-14))
    }

    /// A direction of the query frame in that of the second body.
    pub(in crate::measure) fn direction_to_b(&self, n: &Vector3<f64>) -> Vector3<f64> {
        self.rotation.transpose() * n
    }

    /// About the point of the first body farthest along a unit vector of the query frame, by its
    /// table, and the constraint active there.
    pub(in crate::measure) fn farthest_a(&self, n: &Vector3<f64>) -> (Vector3<f64>, usize) {
        let (point, active) = self.a.body.farthest_in_table(n);
        (self.a_to_query(&point), active)
    }

    /// The same of the second body.
    pub(in crate::measure) fn farthest_b(&self, n: &Vector3<f64>) -> (Vector3<f64>, usize) {
        let (point, active) = self.b.body.farthest_in_table(&self.direction_to_b(n));
        (self.b_to_query(&point), active)
    }
}
