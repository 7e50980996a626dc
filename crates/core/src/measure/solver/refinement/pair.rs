//! The distance and the level distance of two bodies in double-double arithmetic.

use super::body::{MAX_REVISED, NEGLIGIBLE, RefinedActive, RefinedBody, identity, rotation};
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::solver::double_double::{
    Two, Twos, UNIT, apply, dot, doubles, minus, plus, product, times, transposed, twos,
};
use crate::measure::solver::equality_program;
use crate::measure::solver::kkt_newton::{Active, DistanceNewton, VIOLATED};
use crate::measure::solver::kkt_system::{DistanceSystem, Residuals};
use crate::measure::solver::level_newton::LevelNewton;
use crate::measure::solver::linear_systems::solve_equilibrated;
use crate::measure::solver::tangent_newton::{ALIGNED, aligned_angle};
use nalgebra::Vector3;

/// Most Newton steps: tips that are flat of order eight take a dozen for each digit.
const MAX_STEPS: u32 = 48;

/// Steps of the level distance after which one that is still cut leads nowhere.
const PATIENCE: u32 = 8;

/// Both bodies of a pair.
pub(in crate::measure) struct RefinedPair<'a> {
    a: RefinedBody<'a>,
    b: RefinedBody<'a>,
    /// Circumradius of the smaller body, query units.
    small: f64,
}

/// What an iterate proves, query units.
#[derive(Clone, Copy)]
pub(in crate::measure) struct RefinedDistance {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) y: Vector3<f64>,
    pub(in crate::measure) n: Vector3<f64>,
    /// Whether n is the normal of the solution, to [`aligned_angle`].
    pub(in crate::measure) aligned: bool,
    pub(in crate::measure) active: (Active, Active),
}

/// The same for a level distance.
#[derive(Clone, Copy)]
pub(in crate::measure) struct RefinedLevel {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) x: Vector3<f64>,
    pub(in crate::measure) active: (Active, Active),
}

impl<'a> RefinedPair<'a> {
    pub(in crate::measure) fn new(pair: &'a Pair<'a>) -> Self {
        let (pose_a, pose_b) = pair.poses();
        let (turn_a, turn_b) = (rotation(pose_a), rotation(pose_b));
        let origin = twos(pair.origin());
        let back = product(&transposed(&turn_b), &turn_a);
        let apart = minus(&twos(pose_b.translation()), &twos(pose_a.translation()));
        let shift = minus(&apply(&back, &origin), &apply(&transposed(&turn_b), &apart));
        let radius = |posed: &Posed<'_>| posed.body.circumscribed().radius / pair.unit();
        let of_origin = pair.origin().norm();
        Self {
            a: RefinedBody::new(&pair.a, pair.unit(), &identity(), (&origin, of_origin)),
            b: RefinedBody::new(&pair.b, pair.unit(), &back, (&shift, of_origin + doubles(&apart).norm())),
            small: radius(&pair.a).min(radius(&pair.b)),
        }
    }

    /// Newton's method in double-double arithmetic on the optimality system of the distance, from
    /// an iterate of that in doubles; returns the steps taken. It ends when `accept` takes what an
    /// iterate proves.
    pub(in crate::measure) fn distance(
        &self,
        start: &DistanceNewton,
        limit: u32,
        mut accept: impl FnMut(&RefinedDistance) -> bool,
    ) -> u32 {
        let (mut x, mut y) = (twos(&start.x), twos(&start.y));
        let (mut n, mut d) = (twos(&start.n), Two::from(start.distance));
        let (mut of_a, mut of_b) = (RefinedActive::new(&start.a), RefinedActive::new(&start.b));
        let mut revised = 0;
        for step in 1..=MAX_STEPS.min(limit) {
            let (a, sum_a, values_a) = self.a.at(&of_a, &x);
            let (b, sum_b, values_b) = self.b.at(&of_b, &y);
            let offset = plus(&minus(&x, &y), &times(&sum_a, d));
            let excess = |value: Two| (value - Two::from(1.0)).double();
            let system = DistanceSystem {
                a: a.curved(of_a.set.len),
                b: b.curved(of_b.set.len),
                distance: d.double(),
                n: doubles(&n),
                stiffness: 0.0,
            };
            let residuals = Residuals {
                offset: doubles(&offset),
                normal: doubles(&plus(&n, &sum_a)),
                balance: doubles(&plus(&sum_a, &sum_b)),
                length: 0.5 * excess(dot(&n, &n)),
                of_a: values_a.map(excess),
                of_b: values_b.map(excess),
            };
            let Some(newton) = system.step(&residuals, solve_equilibrated) else {
                // Where both are flat the point at hand may do.
                accept(&self.distance_bracket(&x, &y, &of_a, &of_b));
                return step;
            };
            let length = newton.x.norm().max(newton.y.norm());
            let damping = (0.5 * self.small / length).min(1.0);
            x = plus(&x, &twos(&(newton.x * damping)));
            y = plus(&y, &twos(&(newton.y * damping)));
            n = plus(&n, &twos(&(newton.n * damping)));
            d += Two::from(newton.distance * damping);
            of_a.add(&newton.of_a[..of_a.set.len], damping);
            of_b.add(&newton.of_b[..of_b.set.len], damping);
            if length < 1e-6 * self.small || step % 4 == 0 {
                let common = if d.is_positive() { None } else { self.common(&x, &y, &of_a, &of_b) };
                if accept(&common.unwrap_or_else(|| self.distance_bracket(&x, &y, &of_a, &of_b))) {
                    return step;
                }
                let excess = (0.1 * ALIGNED * d.double().abs()).clamp(NEGLIGIBLE, VIOLATED);
                let changed = of_a.revise(&self.a, &x, 1.0, excess) | of_b.revise(&self.b, &y, 1.0, excess);
                revised += u32::from(changed);
                if revised > MAX_REVISED || !changed && length < 1e-28 {
                    return step;
                }
            }
        }
        MAX_STEPS.min(limit)
    }

    /// The answer 0 if halfway between the points lies in both bodies.
    fn common(&self, x: &Twos, y: &Twos, of_a: &RefinedActive, of_b: &RefinedActive) -> Option<RefinedDistance> {
        let middle = times(&plus(x, y), Two::from(0.5));
        let both = self.a.value_upper(&middle) <= 1.0 && self.b.value_upper(&middle) <= 1.0;
        let v = doubles(&middle);
        let active = (of_a.set, of_b.set);
        both.then_some(RefinedDistance { lower: 0.0, upper: 0.0, x: v, y: v, n: Vector3::x(), aligned: false, active })
    }

    fn distance_bracket(&self, x: &Twos, y: &Twos, of_a: &RefinedActive, of_b: &RefinedActive) -> RefinedDistance {
        let (a, sum_a, values_a) = self.a.at(of_a, x);
        let (b, sum_b, values_b) = self.b.at(of_b, y);
        let n = times(&minus(&sum_b, &sum_a), Two::from(0.5));
        let falls = self.a.descent(x, &n, of_a) + self.b.descent(y, &n.map(|value| -value), of_b);
        let length = dot(&n, &n).sqrt();
        let bound = (dot(&n, &minus(x, y)) - falls) / length;
        let slack = 64.0 * UNIT * (doubles(x).norm() + doubles(y).norm() + falls.double().abs());
        let (upper, p, q) = match (self.a.move_inside(x), self.b.move_inside(y)) {
            (Some(p), Some(q)) => {
                let apart = minus(&p, &q);
                ((dot(&apart, &apart).sqrt().double() * (1.0 + 64.0 * UNIT)).next_up(), p, q)
            }
            _ => (f64::INFINITY, *x, *y),
        };
        let lower = (bound - Two::from(slack)).double().next_down();
        // As for doubles: opposite forces, the points along them, and no slack of what carries any.
        let apart = minus(&p, &q);
        let across = minus(&times(&apart, length), &times(&n, dot(&n, &apart) / length));
        let missed = doubles(&across).norm() + of_a.gap(&a, &values_a, 0.0) + of_b.gap(&b, &values_b, 0.0);
        let angle = aligned_angle(&[self.a.posed.body, self.b.posed.body]);
        let opposite = doubles(&plus(&sum_a, &sum_b)).norm() <= angle;
        RefinedDistance {
            // Not `max`: a NaN bounds nothing.
            lower: if lower > 0.0 { lower } else { 0.0 },
            upper,
            x: doubles(&p),
            y: doubles(&q),
            n: doubles(&n) / length.double(),
            aligned: opposite && missed <= angle * doubles(&apart).norm(),
            active: (of_a.set, of_b.set),
        }
    }

    /// The same for the level distance.
    pub(in crate::measure) fn level(
        &self,
        start: &LevelNewton,
        limit: u32,
        mut accept: impl FnMut(&RefinedLevel) -> bool,
    ) -> u32 {
        let mut x = twos(&start.x);
        let (mut of_a, mut of_b) = (RefinedActive::new(&start.a), RefinedActive::new(&start.b));
        let mut s = Two::from(self.a.value_upper(&x));
        let mut revised = 0;
        for step in 1..=MAX_STEPS.min(limit) {
            let (a, sum_a, values_a) = self.a.at(&of_a, &x);
            let (b, sum_b, values_b) = self.b.at(&of_b, &x);
            let (la, lb) = (of_a.set.len, of_b.set.len);
            let balance = plus(&sum_a, &sum_b);
            let total = of_a.multiplier[..la].iter().fold(Two::ZERO, |sum, multiplier| sum + *multiplier);
            let cost = doubles(&balance).push((Two::from(1.0) - total).double());
            // Of x and s.
            let row = |gradient: &Vector3<f64>, by_s: f64, residual: Two| (gradient.push(by_s), -residual.double());
            let rows_a = a.gradient[..la].iter().zip(values_a).map(|(gradient, value)| row(gradient, -1.0, value - s));
            let rows_b = b.gradient[..lb].iter().zip(values_b);
            let rows_b = rows_b.map(|(gradient, value)| row(gradient, 0.0, value - Two::from(1.0)));
            let hessian = (a.hessian + b.hessian).fixed_resize(0.0);
            let Some((dv, steps)) =
                equality_program::minimize(&hessian, &cost, rows_a.chain(rows_b), solve_equilibrated)
            else {
                accept(&self.level_bracket(&x, &of_a, &of_b));
                return step;
            };
            let dx = dv.xyz();
            let length = dx.norm();
            let damping = (0.5 * self.small / length).min(1.0);
            x = plus(&x, &twos(&(dx * damping)));
            s += Two::from(dv.w * damping);
            of_a.add(&steps[..la], damping);
            of_b.add(&steps[la..la + lb], damping);
            if length < 1e-6 * self.small || step % 4 == 0 {
                if accept(&self.level_bracket(&x, &of_a, &of_b)) {
                    return step;
                }
                let lone = of_b.set.len == 1 && !of_b.multiplier[0].is_positive();
                if lone {
                    of_b.set.len = 0;
                }
                let level = s.double();
                let changed = lone
                    | of_a.revise(&self.a, &x, level, VIOLATED * level.abs().max(1.0))
                    | of_b.revise(&self.b, &x, 1.0, VIOLATED);
                revised += u32::from(changed);
                let diverged = step >= PATIENCE && damping < 1.0;
                if revised > MAX_REVISED || diverged || !changed && length < 1e-28 {
                    return step;
                }
            }
        }
        MAX_STEPS.min(limit)
    }

    fn level_bracket(&self, x: &Twos, of_a: &RefinedActive, of_b: &RefinedActive) -> RefinedLevel {
        let (mut value, mut dual_gradient, mut total) = (Two::ZERO, [Two::ZERO; 3], Two::ZERO);
        let (mut error, mut slope_error) = (0.0, 0.0);
        for (i, weight) in of_a.positive() {
            let jet = self.a.jet(i, x);
            value += jet.value * weight;
            dual_gradient = plus(&dual_gradient, &times(&jet.gradient, weight));
            total += weight;
            error += weight.double() * (jet.value_error + 64.0 * UNIT * jet.value.double().abs());
            slope_error += weight.double() * (jet.z_gradient_error * self.a.rounded.norm() + 64.0 * UNIT * jet.size);
        }
        error += 2.0 * slope_error * self.b.posed.reach(&doubles(x));
        let fall = self.b.descent(x, &dual_gradient, of_b);
        let lower = ((value - fall - Two::from(error * (1.0 + 1e-12))) / total).double();
        let upper = self.b.move_inside(x).map(|x| (self.a.value_upper(&x), x));
        let (upper, point) = upper.unwrap_or((f64::INFINITY, *x));
        RefinedLevel {
            lower: if lower.is_finite() { lower.next_down() } else { f64::NEG_INFINITY },
            upper: if upper.is_nan() { f64::INFINITY } else { upper.next_up() },
            x: doubles(&point),
            active: (of_a.set, of_b.set),
        }
    }
}
