//! The growth distance of two bodies with 200 bits: the smallest s at which the bodies, grown by s
//! about their centres, touch.

use super::active::{CLOSE, Trial, for_direction};
use super::big::{Big, Vector, add, big, cross, dot, double, norm, scaled, solve, sub, vector};
use super::dual::Dual;
use super::solid::{Jet, Solid};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{GrowthDistance, Pose};

/// The growth distance in a bracket of its own.
#[derive(Debug)]
pub struct Truth {
    pub lower: Big,
    pub upper: Big,
    /// Derivative with respect to the twists `(v_a, ω_a, v_b, ω_b)` of the bodies, each about its
    /// own translation.
    pub gradient: [f64; 12],
    /// The point of contact, metres, relative to the translation of the first body.
    pub contact: Vector,
    /// What proves `lower`, up to a common factor of all multipliers.
    pub dual: Dual,
}

impl Truth {
    pub fn width(&self) -> f64 {
        double(&(&self.upper - &self.lower))
    }

    pub fn value(&self) -> f64 {
        double(&self.upper)
    }

    /// Whether the answer's bracket contains the growth distance.
    pub fn inside(&self, answer: &GrowthDistance) -> bool {
        big(answer.lower) <= self.upper && self.lower <= big(answer.upper)
    }

    /// Whether it distinguishes a right answer from a wrong one, as that of distances does.
    pub fn decides(&self, answer: &GrowthDistance) -> bool {
        let sharp = self.width() <= 1e-16 * self.value().max(1.0);
        sharp || big(answer.lower) <= self.lower && self.upper <= big(answer.upper)
    }
}

/// What an answer says: the point of contact of the grown bodies in the world, s, and the normal
/// from B to A.
#[derive(Clone, Copy, Debug)]
pub struct Start {
    pub witness: Vector3<f64>,
    pub value: f64,
    pub normal: Vector3<f64>,
}

/// A body, its pose, and its centre in the body frame.
pub type Centred<'a> = (&'a Body, &'a Pose, &'a Vector3<f64>);

/// Both bodies in the frame of work, with their centres and the vector from the first centre to the
/// second.
struct Problem<'a> {
    one: Solid<'a>,
    two: Solid<'a>,
    c1: Vector,
    c2: Vector,
    delta: Vector,
}

struct Best {
    lower: Option<Big>,
    upper: Option<Big>,
    /// `Σ λ ∇g` with `r·Δ = 1`, and the point of contact.
    r: Vector,
    x: Vector,
    unit: f64,
    dual: Option<Dual>,
}

impl Best {
    fn width(&self) -> Option<Big> {
        Some(self.upper.as_ref()? - self.lower.as_ref()?)
    }
}

/// Bracket at which an iterate is taken.
const TARGET: f64 = 1e-40;

/// Solves for the growth distance from an answer; proven by its own bracket, as
/// [`super::distance()`]. None if no iterate proves anything, as where the centres coincide.
pub fn growth_distance(a: Centred<'_>, b: Centred<'_>, start: &Start) -> Option<Truth> {
    let unit = a.0.circumscribed().radius.max(b.0.circumscribed().radius).log2().round().exp2();
    let origin = a.1.translation();
    let (one, two) = (Solid::new(a.0, a.1, origin, unit), Solid::new(b.0, b.1, origin, unit));
    let (c1, c2) = (one.placed(a.2), two.placed(b.2));
    let delta = sub(&c2, &c1);
    let problem = Problem { one, two, c1, c2, delta };
    let x = scaled(&sub(&vector(&start.witness), &vector(origin)), &(big(1.0) / big(unit)));
    let s = big(start.value);
    if s <= Big::ZERO {
        return None;
    }
    let shrunk = |c: &Vector| add(c, &scaled(&sub(&x, c), &(big(1.0) / &s)));
    let (u, w) = (shrunk(&problem.c1), shrunk(&problem.c2));
    // r points from A to B, with r·Δ = 1.
    let against = -start.normal;
    let along = double(&dot(&vector(&against), &problem.delta));
    let target = against / along;
    let zero: Vector = std::array::from_fn(|_| big(0.0));
    let mut best = Best { lower: None, upper: None, r: zero.clone(), x: zero, unit, dual: None };
    'search: for close in CLOSE {
        let (of_a, of_b) =
            (for_direction(&problem.one, &u, &target, close), for_direction(&problem.two, &w, &-target, close));
        for rank in 0..of_a.len() + of_b.len() {
            for (i, j) in (0..=rank).map(|i| (i, rank - i)) {
                if let (Some(p), Some(q)) = (of_a.get(i), of_b.get(j)) {
                    problem.newton(p, q, (&u, &w, &s), &mut best);
                    if best.width().is_some_and(|width| width <= big(TARGET)) {
                        break 'search;
                    }
                }
            }
        }
    }
    let (lower, upper) = (best.lower?, best.upper?);
    let scale = big(unit);
    // Per metre: r carries one over the unit.
    let r = scaled(&best.r, &(&upper / &scale));
    let x = scaled(&best.x, &scale);
    let arm = sub(&x, &sub(&vector(b.1.translation()), &vector(origin)));
    let minus = |v: Vector| -> Vector { v.map(|c| -c) };
    let parts = [minus(r.clone()), minus(cross(&x, &r)), r.clone(), cross(&arm, &r)];
    let gradient = std::array::from_fn(|i| double(&parts[i / 3][i % 3]));
    Some(Truth { lower, upper, gradient, contact: x, dual: best.dual? })
}

impl Problem<'_> {
    /// Newton's method on `s (u - c_A - w + c_B) = Δ`, `Σ λ ∇g(u) + Σ μ ∇h(w) = 0`, `Σ λ ∇g(u)·Δ =
    /// 1`, `g = 1`, `h = 1`.
    fn newton(&self, p: &Trial, q: &Trial, (u, w, s): (&Vector, &Vector, &Big), best: &mut Best) {
        let (mut u, mut w, mut s) = (u.clone(), w.clone(), s.clone());
        let mut l: Vec<Big> = p.multiplier.iter().map(|&m| big(m)).collect();
        let mut m: Vec<Big> = q.multiplier.iter().map(|&m| big(m)).collect();
        let (la, lb) = (l.len(), m.len());
        let size = 7 + la + lb;
        let mut stalled = 0;
        for step in 1..200 {
            let of_a: Vec<Jet> = p.index.iter().map(|&i| self.one.jet(i, &u)).collect();
            let of_b: Vec<Jet> = q.index.iter().map(|&i| self.two.jet(i, &w)).collect();
            // u - c_A - (w - c_B).
            let spread = add(&sub(&u, &w), &self.delta);
            let mut k = vec![vec![big(0.0); size]; size];
            let mut r = vec![big(0.0); size];
            r[6] = big(1.0);
            for i in 0..3 {
                k[i][i] = s.clone();
                k[i][3 + i] = -&s;
                k[i][6] = spread[i].clone();
                r[i] = &self.delta[i] - &s * &spread[i];
            }
            for (j, (jet, multiplier)) in of_a.iter().zip(&l).chain(of_b.iter().zip(&m)).enumerate() {
                let (first, column) = (if j < la { 0 } else { 3 }, 7 + j);
                for i in 0..3 {
                    for o in 0..3 {
                        k[3 + i][first + o] += &jet.hessian[i][o] * multiplier;
                    }
                    k[3 + i][column] = jet.gradient[i].clone();
                    k[column][first + i] = jet.gradient[i].clone();
                    r[3 + i] -= &jet.gradient[i] * multiplier;
                    if j < la {
                        k[6][i] += dot(&jet.hessian[i], &self.delta) * multiplier;
                    }
                }
                if j < la {
                    k[6][column] = dot(&jet.gradient, &self.delta);
                    r[6] -= dot(&jet.gradient, &self.delta) * multiplier;
                }
                r[column] = big(1.0) - &jet.value;
            }
            let d = solve(k, r);
            let part = |from: usize| -> Vector { std::array::from_fn(|i| d[from + i].clone()) };
            let length = double(&norm(&part(0))).max(double(&norm(&part(3))));
            if !length.is_finite() {
                return;
            }
            let damping = big((0.5 / length.max(1e-300)).min(1.0));
            u = add(&u, &scaled(&part(0), &damping));
            w = add(&w, &scaled(&part(3), &damping));
            s += &d[6] * &damping;
            for (value, change) in l.iter_mut().chain(m.iter_mut()).zip(&d[7..]) {
                *value += change * &damping;
            }
            if length < 1e-12 || step % 8 == 0 {
                let before = best.width();
                self.bracket((p, &l), (q, &m), (&u, &w, &s), best);
                let width = best.width();
                stalled = if before.is_none() || width < before || length >= 1e-12 { 0 } else { stalled + 1 };
                if width.is_some_and(|width| width <= big(TARGET)) || stalled > 3 || length < 1e-57 {
                    return;
                }
            }
        }
    }

    /// Below, for any r, `s >= r·Δ / (max r·(A - c_A) + max -r·(B - c_B))` with the supports
    /// bounded by duality; above, a point that both bodies contain when grown.
    fn bracket(
        &self,
        (p, l): (&Trial, &[Big]),
        (q, m): (&Trial, &[Big]),
        (u, w, s): (&Vector, &Vector, &Big),
        best: &mut Best,
    ) {
        let sum = |body: &Solid<'_>, trial: &Trial, multiplier: &[Big], v: &Vector| {
            let (mut slack, mut sum): (Big, Vector) = (big(0.0), std::array::from_fn(|_| big(0.0)));
            for (&i, m) in trial.index.iter().zip(multiplier).filter(|(_, m)| **m > Big::ZERO) {
                let jet = body.jet(i, v);
                slack += m * (big(1.0) - jet.value);
                sum = add(&sum, &scaled(&jet.gradient, m));
            }
            (slack, sum)
        };
        let ((slack_a, r), (slack_b, t)) = (sum(&self.one, p, l, u), sum(&self.two, q, m, w));
        // A's own gradient is r: only B's differs from -r.
        let rest = norm(&add(&r, &t)) * self.two.reach(w);
        let supports = dot(&r, &sub(u, &self.c1)) - dot(&r, &sub(w, &self.c2)) + slack_a + slack_b + rest;
        if supports > Big::ZERO {
            let lower = dot(&r, &self.delta) / supports;
            if best.lower.as_ref().is_none_or(|old| lower > *old) {
                (best.lower, best.r) = (Some(lower), r);
                best.dual = Some(Dual::new((u, w), (p, l), (q, m), best.unit, false));
            }
        }
        let x = add(&self.c1, &scaled(&sub(u, &self.c1), s));
        for margin in [1e-57, 1e-54, 1e-50, 1e-46, 1e-42, 1e-36, 1e-30, 1e-24, 1e-18] {
            let grown = s * (big(1.0) + big(margin));
            let shrunk = |c: &Vector| add(c, &scaled(&sub(&x, c), &(big(1.0) / &grown)));
            if grown > Big::ZERO
                && self.one.largest(&shrunk(&self.c1)) <= big(1.0)
                && self.two.largest(&shrunk(&self.c2)) <= big(1.0)
            {
                if best.upper.as_ref().is_none_or(|old| grown < *old) {
                    (best.upper, best.x) = (Some(grown), x);
                }
                return;
            }
        }
    }
}
