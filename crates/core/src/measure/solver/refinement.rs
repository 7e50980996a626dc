//! Brackets where doubles end: points, multipliers and bounds in double-double arithmetic.
//!
//! Rounding leaves the brackets of `bounds/duality_bounds` some hundred epsilon of the larger
//! body wide, and those of level distances over needles that times the slope of the needle's
//! polynomial. Where that is too wide, Newton's method goes on with residuals of twice the
//! precision (iterative refinement), and the same inequalities are evaluated there. Rounding then
//! plays no part: what is left is how near the iterates are to the solution.

use crate::body::largest;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::{Pair, Posed};
use crate::measure::solver::double_double::{
    Two, Twos, UNIT, apply, dot, doubles, minus, plus, product, times, transposed, twos,
};
use crate::measure::solver::kkt_newton::{Active, At, DistanceNewton, VIOLATED};
use crate::measure::solver::level_newton::LevelNewton;
use crate::measure::solver::linear_systems::{Augmented, MAX_UNKNOWNS, solve};
use crate::measure::solver::tangent_newton::ALIGNED;
use crate::polynomial::Polynomial;
use nalgebra::{Matrix3, Vector3};

/// Most Newton steps: tips that are flat of order eight take a dozen for each digit.
const MAX_STEPS: u32 = 48;

/// Most changes of the active constraints: a start with more wrong ones is near no solution.
const MAX_REVISED: u32 = 4;

/// By how much an inactive constraint may be violated, dimensionless, however near the bodies are:
/// values round at 1e-28 there.
///
/// Larger, normals near contact are off by constraints that are left out; smaller, rounding
/// exchanges constraints. Exercised by `alignment_turns_normals`.
const NEGLIGIBLE: f64 = 1e-26;

/// Steps of the level distance after which one that is still cut leads nowhere.
const PATIENCE: u32 = 8;

/// Bound of an evaluation's error in double-double arithmetic as a share of that in doubles;
/// dimensionless. Both count a few hundred roundings, of 2⁻¹⁰³ and of 2⁻⁵³; the share leaves a
/// factor of 100.
///
/// Smaller, a refined bracket could miss the truth; larger, it is no narrower than one of doubles.
/// Exercised by `refinement_goes_on_alone` from above and by the exact re-checks
/// (`tests/stability/recheck.rs`).
const SHARE: f64 = 1e-13;

/// A body in the query frame, `z = linear v + offset`.
struct RefinedBody<'a> {
    posed: &'a Posed<'a>,
    linear: [Twos; 3],
    offset: Twos,
    /// The nearest doubles of `linear`.
    rounded: Matrix3<f64>,
}

/// A constraint at a point.
struct RefinedJet {
    value: Two,
    /// With respect to points of the query frame.
    gradient: Twos,
    value_error: f64,
    /// Bound of the error of each component with respect to z.
    z_gradient_error: f64,
    /// Bound of the products that the gradient is made of.
    size: f64,
    hessian: Matrix3<f64>,
}

impl RefinedBody<'_> {
    fn z(&self, v: &Twos) -> Twos {
        plus(&apply(&self.linear, v), &self.offset)
    }

    fn polynomial(&self, i: usize) -> &Polynomial {
        &self.posed.body.constraints()[i].polynomial
    }

    fn jet(&self, i: usize, v: &Twos) -> RefinedJet {
        let (z, polynomial) = (self.z(v), self.polynomial(i));
        let (value, gradient) = expand(polynomial, &z);
        let rounded = doubles(&z);
        let jet = polynomial.evaluate(&rounded);
        let none = Vector3::zeros();
        // z is off by a few units of double-double arithmetic.
        let dz = Vector3::repeat(16.0 * UNIT * self.z_size(v));
        RefinedJet {
            value,
            gradient: apply(&transposed(&self.linear), &gradient),
            value_error: SHARE * polynomial.value_error(&rounded, &jet.gradient, &none)
                + 2.0 * jet.gradient.abs().dot(&dz),
            z_gradient_error: SHARE * polynomial.gradient_error(&rounded, &none) + 2.0 * jet.hessian.abs().sum() * dz.x,
            size: jet.gradient.norm() * self.rounded.norm() * (1.0 + 1e-12),
            hessian: self.rounded.transpose() * jet.hessian * self.rounded,
        }
    }

    /// Bound of the sum of the magnitudes that z is made of; the rows of the map are sums of larger
    /// ones for bodies that are long and turned.
    fn z_size(&self, v: &Twos) -> f64 {
        let rows: f64 = self.rounded.row_iter().map(|row| row.norm()).sum();
        rows * doubles(v).lp_norm(1) + doubles(&self.offset).lp_norm(1)
    }

    /// Rigorous upper bound of `-min r·(x' - v)` over the points x' of the body:
    /// [`crate::measure::bounds::duality_bounds::descent`].
    fn descent(&self, v: &Twos, r: &Twos, active: &RefinedActive) -> Two {
        let (mut slack, mut rest, mut error) = (Two::ZERO, *r, 0.0);
        let reach = self.posed.reach(&doubles(v));
        let z = doubles(&self.z(v)).abs();
        let spans = (self.posed.body.z_extent() + z) * (1.0 + 1e-12);
        for (i, multiplier) in active.positive() {
            let jet = self.jet(i, v);
            slack += multiplier * (Two::from(1.0) - jet.value);
            rest = plus(&rest, &times(&jet.gradient, multiplier));
            let rounding = 64.0 * UNIT * (1.0 + jet.value.double().abs() + jet.size * reach);
            error += multiplier.double() * (jet.value_error + jet.z_gradient_error * spans.sum() + rounding);
        }
        // In z, where needles cost no digits; what the inverse misses, in lengths.
        let in_z = self.posed.functional(&doubles(&rest)).0;
        let missed = minus(&rest, &apply(&transposed(&self.linear), &twos(&in_z)));
        let rounding = 64.0 * UNIT * (doubles(r).norm() + self.rounded.norm() * in_z.norm());
        error += in_z.abs().dot(&spans) + (doubles(&missed).norm() + rounding) * reach;
        slack + Two::from(error * (1.0 + 1e-12))
    }

    /// The point moved into the body against the gradients of violated constraints; none if that
    /// does not lead in.
    fn move_inside(&self, v: &Twos) -> Option<Twos> {
        let mut point = *v;
        for _ in 0..6 {
            let worst = (0..self.posed.len())
                .map(|i| self.jet(i, &point))
                .map(|jet| ((jet.value - Two::from(1.0)).double() + jet.value_error, jet))
                .max_by(|p, q| p.0.total_cmp(&q.0))?;
            let (excess, jet) = worst;
            if excess <= 0.0 {
                return Some(point);
            }
            let gradient = doubles(&jet.gradient);
            // A little past the boundary, as the next point is rounded too.
            let step = gradient * ((1.001 * excess + 2.0 * jet.value_error) / gradient.norm_squared());
            if !(step.norm() <= 1e-3 * self.posed.reach(&doubles(&point))) {
                return None;
            }
            point = minus(&point, &twos(&step));
        }
        None
    }

    /// Upper bound of the largest constraint.
    fn value_upper(&self, v: &Twos) -> f64 {
        let jets = (0..self.posed.len()).map(|i| self.jet(i, v));
        largest(jets.map(|jet| (jet.value + Two::from(jet.value_error)).double().next_up()))
    }

    /// For Newton's matrices, the nearest doubles; and for its residuals the sum of gradients and
    /// the values.
    fn at(&self, active: &RefinedActive, v: &Twos) -> (At, Twos, [Two; 3]) {
        let mut at = At::default();
        let (mut sum, mut values) = ([Two::ZERO; 3], [Two::ZERO; 3]);
        for k in 0..active.set.len {
            let jet = self.jet(active.set.index[k], v);
            let multiplier = active.multiplier[k];
            at.gradient[k] = doubles(&jet.gradient);
            at.hessian += jet.hessian * multiplier.double();
            sum = plus(&sum, &times(&jet.gradient, multiplier));
            values[k] = jet.value;
        }
        at.sum = doubles(&sum);
        (at, sum, values)
    }
}

/// Active constraints with multipliers in double-double.
struct RefinedActive {
    set: Active,
    multiplier: [Two; 3],
}

impl RefinedActive {
    fn new(set: &Active) -> Self {
        Self { set: *set, multiplier: set.multiplier.map(Two::from) }
    }

    fn positive(&self) -> impl Iterator<Item = (usize, Two)> + '_ {
        let all = self.set.index[..self.set.len].iter().copied().zip(self.multiplier);
        all.filter(|(_, multiplier)| multiplier.is_positive())
    }

    fn add(&mut self, steps: &[f64], damping: f64) {
        for (k, step) in steps.iter().enumerate() {
            self.multiplier[k] += Two::from(step * damping);
        }
        self.set.multiplier = self.multiplier.map(Two::double);
    }

    /// Drops constraints as [`DistanceNewton`] does and takes one that is violated by more than
    /// `excess`; whether any.
    fn revise(&mut self, body: &RefinedBody<'_>, v: &Twos, level: f64, excess: f64) -> bool {
        let mut set = self.set;
        let over = |i: usize| (body.jet(i, v).value - Two::from(level)).double();
        let rest = (0..body.posed.len()).filter(|i| set.bits() >> i & 1 == 0).map(|i| (i, over(i)));
        let worst = rest.filter(|(_, over)| *over > excess).max_by(|p, q| p.1.total_cmp(&q.1));
        let changed = set.drop_negative() | worst.is_some_and(|(i, _)| set.push(i));
        if changed {
            *self = Self::new(&set);
        }
        changed
    }
}

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
    /// Whether n is the normal of the solution, to [`ALIGNED`].
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
        let (unit, origin) = (Two::from(pair.unit()), twos(pair.origin()));
        let back = product(&transposed(&turn_b), &turn_a);
        let apart = minus(&twos(pose_b.translation()), &twos(pose_a.translation()));
        let shift = minus(&apply(&back, &origin), &apply(&transposed(&turn_b), &apart));
        let own = std::array::from_fn(|i| std::array::from_fn(|j| Two::from(f64::from(u8::from(i == j)))));
        let body = |posed: &'a Posed<'a>, turn: &[Twos; 3], shift: &Twos| {
            let normalization = posed.body.normalization();
            let rows: [Twos; 3] = std::array::from_fn(|i| twos(&normalization.linear.row(i).transpose()));
            let linear = product(&rows, turn).map(|row| times(&row, unit));
            let offset = apply(&rows, &minus(shift, &twos(&normalization.center)));
            let rounded = Matrix3::from_fn(|i, j| linear[i][j].double());
            RefinedBody { posed, linear, offset, rounded }
        };
        let radius = |posed: &Posed<'_>| posed.body.circumscribed().radius / pair.unit();
        Self {
            a: body(&pair.a, &own, &origin),
            b: body(&pair.b, &back, &shift),
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
        let (mut x, mut y, mut d) = (twos(&start.x), twos(&start.y), Two::from(start.distance));
        let (mut of_a, mut of_b) = (RefinedActive::new(&start.a), RefinedActive::new(&start.b));
        let mut revised = 0;
        for step in 1..=MAX_STEPS.min(limit) {
            let (a, sum_a, values_a) = self.a.at(&of_a, &x);
            let (b, sum_b, values_b) = self.b.at(&of_b, &y);
            let (la, lb) = (of_a.set.len, of_b.set.len);
            let size = 7 + la + lb;
            let mut m = newton_matrix(d.double(), &a, &b, la, lb);
            let offset = plus(&minus(&x, &y), &times(&sum_a, d));
            let balance = plus(&sum_a, &sum_b);
            for i in 0..3 {
                m[i][size] = -offset[i].double();
                m[3 + i][size] = -balance[i].double();
            }
            m[6][size] = 0.5 * (Two::from(1.0) - dot(&sum_a, &sum_a)).double();
            for (k, value) in values_a[..la].iter().chain(&values_b[..lb]).enumerate() {
                m[7 + k][size] = (Two::from(1.0) - *value).double();
            }
            let Some(step_) = equilibrated(&mut m, size) else {
                // Where both are flat the point at hand may do.
                accept(&self.distance_bracket(&x, &y, &of_a, &of_b));
                return step;
            };
            let (dx, dy) = (Vector3::from_row_slice(&step_[..3]), Vector3::from_row_slice(&step_[3..6]));
            let length = dx.norm().max(dy.norm());
            let damping = (0.5 * self.small / length).min(1.0);
            x = plus(&x, &twos(&(dx * damping)));
            y = plus(&y, &twos(&(dy * damping)));
            d += Two::from(step_[6] * damping);
            of_a.add(&step_[7..7 + la], damping);
            of_b.add(&step_[7 + la..size], damping);
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
        let slack = |of: &RefinedActive, at: &At, values: &[Two; 3]| {
            let carrying = (0..of.set.len).filter(|&k| of.multiplier[k].is_positive());
            let gaps = carrying.map(|k| (Two::from(1.0) - values[k]).double().abs() / at.gradient[k].norm());
            gaps.fold(0.0, f64::max)
        };
        let missed = doubles(&across).norm() + slack(of_a, &a, &values_a) + slack(of_b, &b, &values_b);
        let opposite = doubles(&plus(&sum_a, &sum_b)).norm() <= ALIGNED;
        RefinedDistance {
            // Not `max`: a NaN bounds nothing.
            lower: if lower > 0.0 { lower } else { 0.0 },
            upper,
            x: doubles(&p),
            y: doubles(&q),
            n: doubles(&n) / length.double(),
            aligned: opposite && missed <= ALIGNED * doubles(&apart).norm(),
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
            let size = 4 + la + lb;
            let mut m = level_matrix(&a, &b, la, lb);
            let balance = plus(&sum_a, &sum_b);
            for i in 0..3 {
                m[i][size] = -balance[i].double();
            }
            let total = of_a.multiplier[..la].iter().fold(Two::ZERO, |sum, multiplier| sum + *multiplier);
            m[3][size] = (Two::from(1.0) - total).double();
            for (k, value) in values_a[..la].iter().enumerate() {
                m[4 + k][size] = (s - *value).double();
            }
            for (k, value) in values_b[..lb].iter().enumerate() {
                m[4 + la + k][size] = (Two::from(1.0) - *value).double();
            }
            let Some(step_) = equilibrated(&mut m, size) else {
                accept(&self.level_bracket(&x, &of_a, &of_b));
                return step;
            };
            let dx = Vector3::from_row_slice(&step_[..3]);
            let length = dx.norm();
            let damping = (0.5 * self.small / length).min(1.0);
            x = plus(&x, &twos(&(dx * damping)));
            s += Two::from(step_[3] * damping);
            of_a.add(&step_[4..4 + la], damping);
            of_b.add(&step_[4 + la..size], damping);
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

/// Newton's matrix of the system of the distance for dx, dy, dD and the multipliers, from what is
/// known at the iterate and the counts of active constraints; column `7 + la + lb` is left to the
/// residuals.
fn newton_matrix(distance: f64, a: &At, b: &At, la: usize, lb: usize) -> Augmented {
    let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
    let scaled = a.hessian * distance;
    let turned = a.hessian * a.sum;
    for i in 0..3 {
        for j in 0..3 {
            m[i][j] = scaled[(i, j)] + f64::from(u8::from(i == j));
            m[3 + i][j] = a.hessian[(i, j)];
            m[3 + i][3 + j] = b.hessian[(i, j)];
        }
        m[i][3 + i] = -1.0;
        m[i][6] = a.sum[i];
        m[6][i] = turned[i];
        for k in 0..la {
            m[i][7 + k] = distance * a.gradient[k][i];
            m[3 + i][7 + k] = a.gradient[k][i];
            m[7 + k][i] = a.gradient[k][i];
        }
        for k in 0..lb {
            m[3 + i][7 + la + k] = b.gradient[k][i];
            m[7 + la + k][3 + i] = b.gradient[k][i];
        }
    }
    for k in 0..la {
        m[6][7 + k] = a.sum.dot(&a.gradient[k]);
    }
    m
}

/// Newton's matrix of the level distance, unknowns x, s and the multipliers; column `4 + la + lb`
/// is left to the residuals.
fn level_matrix(a: &At, b: &At, la: usize, lb: usize) -> Augmented {
    let hessian = a.hessian + b.hessian;
    let mut m: Augmented = [[0.0; MAX_UNKNOWNS + 1]; MAX_UNKNOWNS];
    for i in 0..3 {
        (0..3).for_each(|j| m[i][j] = hessian[(i, j)]);
        for (k, gradient) in a.gradient[..la].iter().chain(&b.gradient[..lb]).enumerate() {
            m[i][4 + k] = gradient[i];
            m[4 + k][i] = gradient[i];
        }
    }
    for k in 0..la {
        m[3][4 + k] = 1.0;
        m[4 + k][3] = -1.0;
    }
    m
}

/// Solves a system with columns of one size: needles make them differ.
fn equilibrated(m: &mut Augmented, size: usize) -> Option<[f64; MAX_UNKNOWNS]> {
    let mut scale = [1.0; MAX_UNKNOWNS];
    // Rows first, so that no row of large entries decides alone.
    for row in m.iter_mut().take(size) {
        let most = row[..size].iter().fold(0.0_f64, |most, entry| most.max(entry.abs()));
        row[..=size].iter_mut().for_each(|entry| *entry /= most);
    }
    for (j, scale) in scale.iter_mut().enumerate().take(size) {
        *scale = (0..size).fold(0.0_f64, |most, i| most.max(m[i][j].abs()));
        (0..size).for_each(|i| m[i][j] /= *scale);
    }
    let mut solution = solve(m, size)?;
    solution.iter_mut().zip(&scale).take(size).for_each(|(value, scale)| *value /= scale);
    solution[..size].iter().all(|value| value.is_finite()).then_some(solution)
}

/// Value and gradient of a polynomial, term by term.
fn expand(polynomial: &Polynomial, z: &Twos) -> (Two, Twos) {
    let powers: [[Two; 9]; 3] = std::array::from_fn(|i| {
        let mut powers = [Two::from(1.0); 9];
        for k in 0..8 {
            powers[k + 1] = powers[k] * z[i];
        }
        powers
    });
    let (mut value, mut gradient) = (Two::ZERO, [Two::ZERO; 3]);
    for (e, coefficient) in polynomial.terms() {
        let of = |i: usize| powers[i][usize::from(e[i])];
        let pairs = [of(1) * of(2), of(0) * of(2), of(0) * of(1)];
        value += of(0) * pairs[0] * *coefficient;
        for i in (0..3).filter(|&i| e[i] > 0) {
            let once = powers[i][usize::from(e[i] - 1)] * f64::from(e[i]);
            gradient[i] += once * pairs[i] * *coefficient;
        }
    }
    (value, gradient)
}

/// The rotation that a pose stands for: of its quaternion, normalised.
fn rotation(pose: &Pose) -> [Twos; 3] {
    let q = pose.rotation().coords;
    let [x, y, z, w] = [q.x, q.y, q.z, q.w].map(Two::from);
    let norm = x * x + y * y + z * z + w * w;
    let two = Two::from(2.0);
    let entry = |value: Two| value / norm;
    let (xx, yy, zz, ww) = (x * x, y * y, z * z, w * w);
    [
        [entry(ww + xx - yy - zz), entry((x * y - w * z) * two), entry((x * z + w * y) * two)],
        [entry((x * y + w * z) * two), entry(ww - xx + yy - zz), entry((y * z - w * x) * two)],
        [entry((x * z - w * y) * two), entry((y * z + w * x) * two), entry(ww - xx - yy + zz)],
    ]
}
