//! The level distance of two bodies with 200 bits.

use super::active::{CLOSE, Trial, fit, near, subsets};
use super::big::{Big, Vector, add, big, cross, double, norm, scaled, solve, sub, vector};
use super::dual::Dual;
use super::solid::Solid;
use nalgebra::{DVector, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::{LevelDistance, Pose};

/// The level distance in a bracket of its own.
#[derive(Debug)]
pub struct Truth {
    pub lower: Big,
    pub upper: Big,
    /// Minimiser, relative to the translation of the first body, metres; world directions.
    pub x: Vector,
    /// Derivative with respect to the twists `(v_a, ω_a, v_b, ω_b)` of the bodies, each about its
    /// own translation.
    pub gradient: [f64; 12],
    /// What proves `lower`.
    pub dual: Dual,
}

impl Truth {
    /// Width of the bracket relative to `max(1, |d|)`.
    pub fn width(&self) -> f64 {
        double(&(&self.upper - &self.lower)) / double(&self.upper).abs().max(1.0)
    }

    pub fn value(&self) -> f64 {
        double(&self.upper)
    }

    /// Whether the answer's bracket contains the level distance.
    pub fn inside(&self, answer: &LevelDistance) -> bool {
        (answer.lower == f64::NEG_INFINITY || big(answer.lower) <= self.upper)
            && (answer.upper == f64::INFINITY || self.lower <= big(answer.upper))
    }

    /// Whether it distinguishes a right answer from a wrong one, as that of distances does.
    pub fn decides(&self, answer: &LevelDistance) -> bool {
        let finite = answer.lower.is_finite() && answer.upper.is_finite();
        let all_inside = finite && big(answer.lower) <= self.lower && self.upper <= big(answer.upper);
        self.width() <= 1e-16 || all_inside
    }
}

struct Best {
    lower: Option<Big>,
    upper: Option<Big>,
    x: Vector,
    /// Gradients of A and of B at the minimiser, with their multipliers.
    pull: (Vector, Vector),
    unit: f64,
    dual: Option<Dual>,
}

impl Best {
    fn width(&self) -> Option<Big> {
        let (lower, upper) = (self.lower.as_ref()?, self.upper.as_ref()?);
        Some((upper - lower) / big(double(upper).abs().max(1.0)))
    }
}

/// Bracket at which an iterate is taken, relative to `max(1, |d|)`.
const TARGET: f64 = 1e-40;

/// Bracket at which the search ends where the target is out of reach.
const SHARP: f64 = 1e-13;

/// Solves for `d(A‖B)` from the witness of an answer; proven by its own bracket, as
/// [`super::distance()`].
pub fn level_distance(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, answer: &LevelDistance) -> Truth {
    let unit = b.circumscribed().radius.log2().round().exp2();
    let origin = pose_a.translation();
    let (one, two) = (Solid::new(a, pose_a, origin, unit), Solid::new(b, pose_b, origin, unit));
    let start = scaled(&sub(&vector(&answer.witness), &vector(origin)), &(big(1.0) / big(unit)));
    let none: Vector = std::array::from_fn(|_| big(0.0));
    let mut best = Best { lower: None, upper: None, x: start.clone(), pull: (none.clone(), none), unit, dual: None };
    // Between flush faces the system is singular: there a ridge keeps the steps across short.
    'search: for close in CLOSE {
        let trials = trials(&one, &two, &start, close);
        for (ridge, target) in [(0.0, TARGET), (1e-6, SHARP)] {
            for (p, q) in &trials {
                if best.width().is_some_and(|width| width <= big(target)) {
                    break 'search;
                }
                newton((&one, p), (&two, q), (&start, ridge), &mut best);
            }
        }
        if best.width().is_some_and(|width| width <= big(SHARP)) {
            break;
        }
    }
    let x = scaled(&best.x, &big(unit));
    let arm = sub(&x, &sub(&vector(pose_b.translation()), &vector(origin)));
    let (pull_a, pull_b) = &best.pull;
    // Gradients per unit of work: per metre after division.
    let parts = [pull_a.clone(), cross(&x, pull_a), pull_b.clone(), cross(&arm, pull_b)];
    Truth {
        lower: best.lower.expect("a trial set proves a lower bound"),
        upper: best.upper.expect("the interior point proves an upper bound"),
        gradient: std::array::from_fn(|i| -double(&parts[i / 3][i % 3]) / unit),
        x,
        dual: best.dual.expect("a trial set proves a lower bound"),
    }
}

/// Pairs of trial sets, the best fit of `Σ ν ∇g + Σ μ ∇h = 0`, `Σ ν = 1` first; B's may be empty.
fn trials(one: &Solid<'_>, two: &Solid<'_>, v: &Vector, close: f64) -> Vec<(Trial, Trial)> {
    let level = double(&one.largest(v));
    let of_a = subsets(&near(one, v, level, close));
    let mut of_b = vec![vec![]];
    of_b.extend(subsets(&near(two, v, 1.0, close)));
    let mut pairs = Vec::new();
    for set_a in &of_a {
        let scale = set_a.iter().map(|(_, g)| g.norm()).fold(1e-300, f64::max);
        let target = DVector::from_column_slice(&[0.0, 0.0, 0.0, 1.0]);
        for set_b in &of_b {
            let column = |g: &Vector3<f64>, last: f64| DVector::from_column_slice(&[g.x, g.y, g.z, last]);
            let columns: Vec<_> = set_a.iter().map(|(_, g)| column(&(g / scale), 1.0)).collect();
            let count = columns.len();
            let columns: Vec<_> = columns.into_iter().chain(set_b.iter().map(|(_, g)| column(g, 0.0))).collect();
            let (multiplier, residual) = fit(&columns, &target);
            let index = |set: &[(usize, Vector3<f64>)]| set.iter().map(|(i, _)| *i).collect::<Vec<_>>();
            let p = Trial { index: index(set_a), multiplier: multiplier[..count].to_vec() };
            // The rows of A were scaled: so are the multipliers of B.
            let q = Trial { index: index(set_b), multiplier: multiplier[count..].iter().map(|m| m * scale).collect() };
            pairs.push((residual + 1e-3 * (set_a.len() + set_b.len()) as f64, (p, q)));
        }
    }
    pairs.sort_by(|p, q| p.0.total_cmp(&q.0));
    pairs.into_iter().map(|(_, pair)| pair).collect()
}

/// Newton's method on `Σ ν ∇g + Σ μ ∇h = 0`, `Σ ν = 1`, `g = s`, `h = 1`.
fn newton(
    (one, p): (&Solid<'_>, &Trial),
    (two, q): (&Solid<'_>, &Trial),
    (start, ridge): (&Vector, f64),
    best: &mut Best,
) {
    let mut x = start.clone();
    let mut nu: Vec<Big> = p.multiplier.iter().map(|&m| big(m)).collect();
    let mut s = one.largest(&x);
    // Far away the values of A are many powers of ten: brought to about 1, or the pivots of the
    // system say nothing of its rank.
    let scale = big(double(&s).abs().max(1.0).log2().round().exp2());
    let factor = big(1.0) / &scale;
    s *= &factor;
    let mut mu: Vec<Big> = q.multiplier.iter().map(|&m| big(m) * &factor).collect();
    let (la, lb) = (nu.len(), mu.len());
    let size = 4 + la + lb;
    let mut stalled = 0;
    for step in 1..200 {
        let of_a: Vec<_> = p.index.iter().map(|&i| one.jet(i, &x).times(&factor)).collect();
        let of_b: Vec<_> = q.index.iter().map(|&i| two.jet(i, &x)).collect();
        let mut k = vec![vec![big(0.0); size]; size];
        let mut r = vec![big(0.0); size];
        for (j, (jet, m)) in of_a.iter().zip(&nu).chain(of_b.iter().zip(&mu)).enumerate() {
            for i in 0..3 {
                for l in 0..3 {
                    k[i][l] += &jet.hessian[i][l] * m;
                }
                k[i][4 + j] = jet.gradient[i].clone();
                k[4 + j][i] = jet.gradient[i].clone();
                r[i] -= &jet.gradient[i] * m;
            }
            r[4 + j] = if j < la { &s - &jet.value } else { big(1.0) - &jet.value };
        }
        let stiffest = (0..3).map(|i| double(&k[i][i])).fold(0.0, f64::max);
        (0..3).for_each(|i| k[i][i] += big(ridge * stiffest));
        r[3] = big(1.0);
        for j in 0..la {
            k[3][4 + j] = big(1.0);
            k[4 + j][3] = big(-1.0);
            r[3] -= &nu[j];
        }
        let step_ = solve(k, r);
        let dx: Vector = std::array::from_fn(|i| step_[i].clone());
        let length = double(&norm(&dx));
        if !length.is_finite() {
            return;
        }
        let damping = big((0.5 / length.max(1e-300)).min(1.0));
        x = add(&x, &scaled(&dx, &damping));
        s += &step_[3] * &damping;
        for (value, change) in nu.iter_mut().chain(mu.iter_mut()).zip(&step_[4..]) {
            *value += change * &damping;
        }
        if length < 1e-12 || step % 8 == 0 {
            let before = best.width();
            let unscaled: Vec<Big> = mu.iter().map(|m| m * &scale).collect();
            bracket((one, p, &nu), (two, q, &unscaled), &x, best);
            let width = best.width();
            let better = before.is_none() || width < before;
            stalled = if better || length >= 1e-12 { 0 } else { stalled + 1 };
            if width.is_some_and(|width| width <= big(TARGET)) || stalled > 3 || length < 1e-57 {
                return;
            }
        }
    }
}

/// Takes the bounds that an iterate proves: numerics section 3.
fn bracket(
    (one, p, nu): (&Solid<'_>, &Trial, &[Big]),
    (two, q, mu): (&Solid<'_>, &Trial, &[Big]),
    x: &Vector,
    best: &mut Best,
) {
    let positive = |m: &&Big| **m > Big::ZERO;
    let total = nu.iter().filter(positive).fold(big(0.0), |sum, m| sum + m);
    if total > Big::ZERO {
        let none: Vector = std::array::from_fn(|_| big(0.0));
        let (mut value, mut pull_a, mut pull_b) = (big(0.0), none.clone(), none);
        for (&i, m) in p.index.iter().zip(nu).filter(|(_, m)| positive(m)) {
            let (jet, weight) = (one.jet(i, x), m / &total);
            value += &jet.value * &weight;
            pull_a = add(&pull_a, &scaled(&jet.gradient, &weight));
        }
        for (&i, m) in q.index.iter().zip(mu).filter(|(_, m)| positive(m)) {
            let (jet, weight) = (two.jet(i, x), m / &total);
            value += (&jet.value - big(1.0)) * &weight;
            pull_b = add(&pull_b, &scaled(&jet.gradient, &weight));
        }
        let lower = value - norm(&add(&pull_a, &pull_b)) * two.reach(x);
        if best.lower.as_ref().is_none_or(|old| lower > *old) {
            best.lower = Some(lower);
            best.pull = (pull_a, pull_b);
            best.dual = Some(Dual::new((x, x), (p, nu), (q, mu), best.unit, false));
        }
    }
    if let Some(x) = two.pull_in(x) {
        let upper = one.largest(&x);
        if best.upper.as_ref().is_none_or(|old| upper < *old) {
            best.upper = Some(upper);
            best.x = x;
        }
    }
}
