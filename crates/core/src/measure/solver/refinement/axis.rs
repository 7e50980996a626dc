//! The distance of a body from a segment, or from a point, in double-double arithmetic.
//!
//! The body's nearest point x and the multipliers λ of the constraints active there satisfy
//!
//! ```text
//! q(x) - x = Σ λ_i ∇g_i(x),   g_i(x) = 1   (active i)
//! ```
//!
//! with the point q(x) = c + s h of the segment nearest to x, `s = h·(x - c) / |h|²` cut to
//! [-1, 1]. For any x and λ >= 0 the plane across `n = Σ λ_i ∇g_i(x)` keeps body and segment apart
//! by at least
//!
//! ```text
//! (n·(c - x) - |n·h| - Σ λ_i (1 - g_i(x))) / |n|
//! ```
//!
//! and x, moved into the body, and the point of the segment nearest to it are no nearer than the
//! distance. Iterates of doubles are off by 1e-16 of what they are computed from, and both bounds
//! by the square of that but for |n·h|: of a long segment beside a needle, whose normal turns by
//! more, Newton's method has to go on.

use super::body::{MAX_REVISED, NEGLIGIBLE, RefinedActive, RefinedBody, identity, rotation};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::solver::double_double::{
    Two, Twos, UNIT, apply, dot, doubles, minus, plus, times, transposed, twos,
};
use crate::measure::solver::equality_program;
use crate::measure::solver::kkt_newton::{Active, VIOLATED};
use crate::measure::solver::linear_systems::solve_equilibrated;
use crate::measure::solver::projection::Single;
use crate::measure::solver::tangent_newton::{ALIGNED, aligned_angle};
use nalgebra::{Matrix3, Vector3};

/// Most Newton steps: from where doubles end a few double the digits.
const MAX_STEPS: u32 = 16;

/// Square of a half axis, query units, from which on it has a direction: below, what a
/// double-double square rounds off is no number.
const SHORTEST_SQUARED: f64 = f64::MIN_POSITIVE / (UNIT * UNIT);

/// A body and a capsule as its axis, in the body's own query frame; a point where both sizes of the
/// capsule are 0.
pub(in crate::measure) struct RefinedAxis<'a> {
    body: RefinedBody<'a>,
    center: Twos,
    half_axis: Twos,
    /// The direction of the half axis; none of a point.
    along: Option<Vector3<f64>>,
    /// Sum of the lengths that points of the axis are computed from, query units.
    size: f64,
    /// Metres per unit of the query frame: a power of two.
    unit: f64,
    radius_m: f64,
}

/// What an iterate proves.
#[derive(Clone, Copy)]
pub(in crate::measure) struct RefinedOffset {
    /// Of the distance from the axis less the radius, metres; minus infinity where the axis is not
    /// proven to be outside of the body.
    lower: f64,
    upper: f64,
    /// Point of the body, query frame.
    pub(in crate::measure) x: Vector3<f64>,
    /// Where the nearest point of the axis is, in half axes from its middle on.
    pub(in crate::measure) place: f64,
    /// Unit vector from the body to the axis, query frame.
    pub(in crate::measure) n: Vector3<f64>,
    /// Whether x and n are those of the solution, to [`ALIGNED`].
    aligned: bool,
}

/// What is known after refinement, metres.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Refined {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    /// The narrowest bracket of a single iterate, if narrower than what was known before.
    pub(in crate::measure) at: Option<RefinedOffset>,
    pub(in crate::measure) steps: u32,
}

impl<'a> RefinedAxis<'a> {
    /// Of a capsule with this radius and half height, metres, at a pose.
    pub(in crate::measure) fn new(single: &'a Single<'a>, [radius_m, half_m]: [f64; 2], pose: &Pose) -> Self {
        let (unit, origin) = (single.unit, twos(&single.origin));
        let (per_metre, to_own) = (Two::from(1.0 / unit), transposed(&rotation(&single.pose)));
        let offset = minus(&twos(pose.translation()), &twos(single.pose.translation()));
        let half_axis = rotation(pose).map(|row| row[2] * half_m);
        let half_axis = times(&apply(&to_own, &half_axis), per_metre);
        let has_length = dot(&half_axis, &half_axis).double() >= SHORTEST_SQUARED;
        Self {
            body: RefinedBody::new(&single.body, unit, &identity(), (&origin, single.origin.norm())),
            center: times(&minus(&apply(&to_own, &offset), &origin), per_metre),
            half_axis,
            along: has_length.then(|| doubles(&half_axis).normalize()),
            size: (doubles(&offset).norm() + single.origin.norm() + half_m) / unit,
            unit,
            radius_m,
        }
    }

    /// From about the nearest point of the body on, query frame, until the bracket that is known,
    /// metres, is as narrow as the tolerance, metres, and the normal that of the solution.
    pub(in crate::measure) fn narrow(
        &self,
        [mut lower, mut upper]: [f64; 2],
        near: &Vector3<f64>,
        tolerance: f64,
        options: &Options<'_>,
    ) -> Refined {
        let (mut width, mut at) = (upper - lower, None);
        let steps = self.run(near, options.max_iterations(), |found| {
            lower = lower.max(found.lower);
            let own = found.upper - found.lower;
            // The upper bound stays the one that the points of the answer attain, also where a
            // point that proves no lower bound is nearer.
            if own.is_finite() && own <= width {
                (width, upper, at) = (own, found.upper, Some(*found));
            }
            upper - lower <= tolerance && found.aligned || options.stopped()
        });
        Refined { lower, upper, at, steps }
    }

    /// Newton's method until `accept` takes what an iterate proves, or the limit is reached;
    /// returns the steps taken.
    fn run(&self, near: &Vector3<f64>, limit: u32, mut accept: impl FnMut(&RefinedOffset) -> bool) -> u32 {
        let posed = self.body.posed;
        let mut x = twos(near);
        let pull = doubles(&self.pull(&x));
        let mut set = Active::near(posed, near, &pull);
        if !set.fit(posed, near, &pull) {
            return 0;
        }
        let mut active = RefinedActive::new(&set);
        let (mut length, mut revised) = (0.0, 0);
        for step in 1..=MAX_STEPS.min(limit) {
            if length < 1e-6 || step % 4 == 0 {
                if accept(&self.bracket(&x, &active)) {
                    return step;
                }
                let is_inside = active.multiplier[..active.set.len].iter().all(|of| of.double() < 0.0);
                let excess = (0.1 * ALIGNED * doubles(&self.pull(&x)).norm()).clamp(NEGLIGIBLE, VIOLATED);
                let changed = active.revise(&self.body, &x, 1.0, excess);
                revised += u32::from(changed);
                // What is known at the start of a point on the surface is rounding.
                if revised > MAX_REVISED || step > 1 && (is_inside || !changed && length < 1e-28) {
                    return step;
                }
            }
            // Where body and axis are flat along each other the point at hand has to do.
            let Some(taken) = self.step(&mut x, &mut active) else { return step };
            length = taken;
        }
        MAX_STEPS.min(limit)
    }

    /// One Newton step; its length in query units, or none if the system is singular.
    fn step(&self, x: &mut Twos, active: &mut RefinedActive) -> Option<f64> {
        let (at, sum, values) = self.body.at(active, x);
        let place = self.place(x).double();
        let mut hessian = Matrix3::identity() + at.hessian;
        if let Some(along) = self.along.filter(|_| place.abs() < 1.0) {
            hessian -= along * along.transpose();
        }
        let rest = minus(&sum, &self.pull(x));
        let rows = at.gradient.iter().zip(&values).take(active.set.len);
        let rows = rows.map(|(gradient, value)| (*gradient, (Two::from(1.0) - *value).double()));
        let (dx, steps) = equality_program::minimize(&hessian, &doubles(&rest), rows, solve_equilibrated)?;
        let length = dx.norm();
        let damping = (0.5 * self.body.posed.radius / length).min(1.0);
        *x = plus(x, &twos(&(dx * damping)));
        active.add(&steps[..active.set.len], damping);
        Some(length)
    }

    /// Where the point of the axis nearest to another one is, in half axes from its middle on.
    fn place(&self, v: &Twos) -> Two {
        if self.along.is_none() {
            return Two::ZERO;
        }
        let place = dot(&self.half_axis, &minus(v, &self.center)) / dot(&self.half_axis, &self.half_axis);
        if place.double().abs() < 1.0 { place } else { Two::from(1_f64.copysign(place.double())) }
    }

    /// The way to the nearest point of the axis.
    fn pull(&self, v: &Twos) -> Twos {
        minus(&plus(&self.center, &times(&self.half_axis, self.place(v))), v)
    }

    fn bracket(&self, x: &Twos, active: &RefinedActive) -> RefinedOffset {
        let (at, n, values) = self.body.at(active, x);
        let length = dot(&n, &n).sqrt();
        // A few dozen operations on what the axis is computed from.
        let slack = |point: &Twos| Two::from(64.0 * UNIT * (self.size + doubles(point).norm()));
        let in_metres = |distance: Two| (distance * self.unit - Two::from(self.radius_m)).double();

        let fall = self.body.descent(x, &n.map(|part| -part), active);
        let along = dot(&n, &self.half_axis);
        let along = if along.is_positive() { along } else { -along };
        let rounding = Two::from(64.0 * UNIT * fall.double().abs());
        let apart = (dot(&n, &minus(&self.center, x)) - along - fall - rounding) / length - slack(x);
        // Not where it is NaN, as without a normal.
        let lower = if apart.is_positive() { in_metres(apart).next_down() } else { f64::NEG_INFINITY };

        let inside = self.body.move_inside(x);
        let point = inside.unwrap_or(*x);
        let way = self.pull(&point);
        let upper = in_metres(dot(&way, &way).sqrt() + slack(&point)).next_up();

        let angle = aligned_angle(&[self.body.posed.body]);
        let n = times(&n, Two::from(1.0) / length);
        let across = minus(&way, &times(&n, dot(&n, &way)));
        // What carries next to nothing of the normal does not turn it, whether it is met or not.
        let missed = doubles(&across).norm() + active.gap(&at, &values, angle * length.double());
        RefinedOffset {
            lower,
            upper: if inside.is_some() && !upper.is_nan() { upper } else { f64::INFINITY },
            x: doubles(&point),
            place: self.place(&point).double(),
            n: doubles(&n),
            // Far away the place counts, not the angle.
            aligned: missed <= angle * doubles(&way).norm().min(self.body.posed.radius),
        }
    }
}
