//! The distance of two bodies with 200 bits.

use super::active::{CLOSE, Trial, for_direction};
use super::big::{Big, Vector, add, big, cross, dot, double, doubles, norm, scaled, solve, sub, vector};
use super::dual::Dual;
use super::solid::{Jet, Solid};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Distance, Pose};

/// The distance in a bracket of its own, metres.
#[derive(Debug)]
pub struct Truth {
    pub lower: Big,
    pub upper: Big,
    /// Closest points, relative to the translation of the first body; world directions.
    pub x: Vector,
    pub y: Vector,
    /// Unit normal from the second body to the first.
    pub normal: Vector,
    /// Derivative with respect to the twists `(v_a, ω_a, v_b, ω_b)` of the bodies, each about its
    /// own translation.
    pub gradient: [f64; 12],
    /// What proves `lower`, with `normal`; none if nothing but 0 was proven.
    pub dual: Option<Dual>,
}

impl Truth {
    /// Width of the bracket, metres.
    pub fn width(&self) -> f64 {
        double(&(&self.upper - &self.lower))
    }

    pub fn value(&self) -> f64 {
        double(&self.upper)
    }

    /// Whether the answer's bracket contains the distance.
    pub fn inside(&self, answer: &Distance) -> bool {
        big(answer.lower) <= self.upper && self.lower <= big(answer.upper)
    }

    /// Whether the answer's bracket contains all that the distance may be.
    pub fn all_inside(&self, answer: &Distance) -> bool {
        big(answer.lower) <= self.lower && self.upper <= big(answer.upper)
    }

    /// Whether it distinguishes a right answer from a wrong one: as sharp as this share of the
    /// size, or, as between flush faces, with all that it may be in the answer's bracket, which
    /// proves as much.
    pub fn decides(&self, answer: &Distance, sharp: f64) -> bool {
        self.width() <= sharp || self.all_inside(answer)
    }

    pub fn normal(&self) -> Vector3<f64> {
        doubles(&self.normal)
    }
}

/// An iterate, with the lower and upper bound that it proves.
struct Best {
    lower: Big,
    upper: Big,
    x: Vector,
    y: Vector,
    n: Vector,
    unit: f64,
    dual: Option<Dual>,
}

/// Bracket at which an iterate is taken, in units of the larger body.
const TARGET: f64 = 1e-40;

/// Solves for the distance from the witnesses of an answer. The solve starts there and nowhere
/// else, but what it finds is proven by its own bracket: an answer cannot make it agree.
pub fn distance(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, answer: &Distance) -> Truth {
    let unit = a.circumscribed().radius.max(b.circumscribed().radius).log2().round().exp2();
    let origin = pose_a.translation();
    let (one, two) = (Solid::new(a, pose_a, origin, unit), Solid::new(b, pose_b, origin, unit));
    let local = |w: &Vector3<f64>| scaled(&sub(&vector(w), &vector(origin)), &(big(1.0) / big(unit)));
    let (x, y) = (local(&answer.witness_a), local(&answer.witness_b));
    let upper = norm(&sub(&one.interior, &two.interior));
    let mut best = Best { lower: big(0.0), upper, x, y, n: vector(&Vector3::x()), unit, dual: None };
    let (x, y) = (best.x.clone(), best.y.clone());
    raise(&one, &two, &x, &y, &mut best);
    if answer.upper == 0.0
        && let Some(v) = common(&one, &two, &x)
    {
        raise(&one, &two, &v, &v, &mut best);
    }
    let small = a.circumscribed().radius.min(b.circumscribed().radius) / unit;
    // On overlap there is no normal: any that parts the largest constraints there.
    let normal = answer.normal.unwrap_or_else(|| {
        let steepest = |body: &Solid<'_>, v: &Vector| {
            let i = (0..body.len()).max_by(|&i, &j| double(&body.value(i, v)).total_cmp(&double(&body.value(j, v))));
            doubles(&body.jet(i.expect("a body has constraints"), v).gradient)
        };
        let (g, h) = (steepest(&one, &x), steepest(&two, &y));
        (h.normalize() - g.normalize()).try_normalize(1e-300).unwrap_or_else(Vector3::x)
    });
    let scale = big(unit);
    let done = |best: &Best| &best.upper - &best.lower <= big(TARGET);
    // As much as is asked: the bracket of the answer contains all that the distance may be.
    let decided = |best: &Best| big(answer.lower) <= &best.lower * &scale && &best.upper * &scale <= big(answer.upper);
    for (pass, close) in CLOSE.into_iter().enumerate() {
        if done(&best) || pass > 0 && decided(&best) {
            break;
        }
        let (of_a, of_b) = (for_direction(&one, &x, &-normal, close), for_direction(&two, &y, &normal, close));
        'search: for rank in 0..of_a.len() + of_b.len() {
            for (i, j) in (0..=rank).map(|i| (i, rank - i)) {
                if let (Some(p), Some(q)) = (of_a.get(i), of_b.get(j)) {
                    newton((&one, p), (&two, q), (&x, &y, &vector(&normal)), small, &mut best);
                    if done(&best) {
                        break 'search;
                    }
                }
            }
        }
    }
    let (x, y) = (scaled(&best.x, &scale), scaled(&best.y, &scale));
    Truth {
        lower: best.lower * &scale,
        upper: best.upper * &scale,
        gradient: twists(&x, &y, &best.n, pose_a, pose_b),
        x,
        y,
        normal: best.n,
        dual: best.dual,
    }
}

/// Values of a trial set at a point.
struct At {
    jets: Vec<Jet>,
    sum: Vector,
    hessian: [Vector; 3],
}

fn at(body: &Solid<'_>, index: &[usize], multiplier: &[Big], v: &Vector) -> At {
    let jets: Vec<Jet> = index.iter().map(|&i| body.jet(i, v)).collect();
    let mut sum: Vector = std::array::from_fn(|_| big(0.0));
    let mut hessian: [Vector; 3] = std::array::from_fn(|_| sum.clone());
    for (jet, m) in jets.iter().zip(multiplier) {
        sum = add(&sum, &scaled(&jet.gradient, m));
        hessian = std::array::from_fn(|i| add(&hessian[i], &scaled(&jet.hessian[i], m)));
    }
    At { jets, sum, hessian }
}

/// Newton's method until an iterate is taken, or nothing is gained any more.
fn newton(
    (one, p): (&Solid<'_>, &Trial),
    (two, q): (&Solid<'_>, &Trial),
    (x, y, n): (&Vector, &Vector, &Vector),
    small: f64,
    best: &mut Best,
) {
    let mut iterate = Iterate::new(p, q, x, y, n);
    let mut stalled = 0;
    for step in 1..200 {
        let length = iterate.step(one, two, small);
        if !length.is_finite() {
            return;
        }
        if length < 1e-12 || step % 8 == 0 {
            let before = &best.upper - &best.lower;
            let Iterate { x, y, n, l, m, .. } = &iterate;
            bracket((one, p, l), (two, q, m), (x, y, n), best);
            let width = &best.upper - &best.lower;
            stalled = if width < before || length >= 1e-12 { 0 } else { stalled + 1 };
            if width <= big(TARGET) || stalled > 3 || length < 1e-57 {
                return;
            }
        }
    }
}

/// An iterate of Newton's method on `x - y = D n`, `n + Σ λ ∇g = 0`, `n - Σ μ ∇h = 0`, `n·n = 1`,
/// `g = 1`, `h = 1`; D has either sign.
pub(super) struct Iterate<'a> {
    index: (&'a [usize], &'a [usize]),
    pub(super) x: Vector,
    pub(super) y: Vector,
    pub(super) n: Vector,
    pub(super) d: Big,
    pub(super) l: Vec<Big>,
    pub(super) m: Vec<Big>,
}

impl<'a> Iterate<'a> {
    pub(super) fn new(p: &'a Trial, q: &'a Trial, x: &Vector, y: &Vector, n: &Vector) -> Self {
        Self {
            index: (&p.index, &q.index),
            x: x.clone(),
            y: y.clone(),
            n: n.clone(),
            d: dot(n, &sub(x, y)),
            l: p.multiplier.iter().map(|&m| big(m)).collect(),
            m: q.multiplier.iter().map(|&m| big(m)).collect(),
        }
    }

    /// The largest entry of what the equations leave, dimensionless and in units of points. Steps
    /// end without a solution, too, where the equations contradict each other.
    pub(super) fn residual(&self, one: &Solid<'_>, two: &Solid<'_>) -> f64 {
        self.system(one, two).1.iter().map(|entry| double(entry).abs()).fold(0.0, f64::max)
    }

    /// The matrix of a step and what the equations leave.
    fn system(&self, one: &Solid<'_>, two: &Solid<'_>) -> (Vec<Vec<Big>>, Vec<Big>) {
        let Self { x, y, n, d, l, m, .. } = self;
        let (la, lb) = (l.len(), m.len());
        let size = 10 + la + lb;
        let (a, b) = (at(one, self.index.0, l, x), at(two, self.index.1, m, y));
        let mut k = vec![vec![big(0.0); size]; size];
        let mut r = vec![big(0.0); size];
        for i in 0..3 {
            k[i][i] = big(1.0);
            k[i][3 + i] = big(-1.0);
            k[i][6 + i] = -d;
            k[i][9] = -&n[i];
            r[i] = d * &n[i] - &x[i] + &y[i];
            k[3 + i][6 + i] = big(1.0);
            k[6 + i][6 + i] = big(1.0);
            for j in 0..3 {
                k[3 + i][j] = a.hessian[i][j].clone();
                k[6 + i][3 + j] = -&b.hessian[i][j];
            }
            for (j, jet) in a.jets.iter().enumerate() {
                k[3 + i][10 + j] = jet.gradient[i].clone();
                k[10 + j][i] = jet.gradient[i].clone();
            }
            for (j, jet) in b.jets.iter().enumerate() {
                k[6 + i][10 + la + j] = -&jet.gradient[i];
                k[10 + la + j][3 + i] = jet.gradient[i].clone();
            }
            r[3 + i] = -(&n[i] + &a.sum[i]);
            r[6 + i] = &b.sum[i] - &n[i];
            k[9][6 + i] = &n[i] * big(2.0);
        }
        r[9] = big(1.0) - dot(n, n);
        for (j, jet) in a.jets.iter().chain(&b.jets).enumerate() {
            r[10 + j] = big(1.0) - &jet.value;
        }
        (k, r)
    }

    /// One step; its length, NaN where the system is singular.
    pub(super) fn step(&mut self, one: &Solid<'_>, two: &Solid<'_>, small: f64) -> f64 {
        let (k, r) = self.system(one, two);
        let Self { x, y, n, d, l, m, .. } = self;
        let s = solve(k, r);
        let part = |from: usize| -> Vector { std::array::from_fn(|i| s[from + i].clone()) };
        let (dx, dy, dn) = (part(0), part(3), part(6));
        let length = double(&norm(&dx)).max(double(&norm(&dy))).max(double(&norm(&dn)) * small);
        if !length.is_finite() {
            return f64::NAN;
        }
        let damping = big((0.5 * small / length.max(1e-300)).min(1.0));
        *x = add(x, &scaled(&dx, &damping));
        *y = add(y, &scaled(&dy, &damping));
        *n = add(n, &scaled(&dn, &damping));
        *d += &s[9] * &damping;
        for (value, change) in l.iter_mut().chain(m.iter_mut()).zip(&s[10..]) {
            *value += change * &damping;
        }
        length
    }
}

/// Derivative of the distance with respect to the twists of both bodies, from points relative to
/// the first one's translation.
pub(super) fn twists(x: &Vector, y: &Vector, n: &Vector, pose_a: &Pose, pose_b: &Pose) -> [f64; 12] {
    let arm = sub(y, &sub(&vector(pose_b.translation()), &vector(pose_a.translation())));
    let minus = |v: &Vector| -> Vector { v.clone().map(|c| -c) };
    let parts = [n.clone(), cross(x, n), minus(n), minus(&cross(&arm, n))];
    std::array::from_fn(|i| double(&parts[i / 3][i % 3]))
}

/// Takes the bounds that an iterate proves: numerics section 3.
fn bracket(
    (one, p, l): (&Solid<'_>, &Trial, &[Big]),
    (two, q, m): (&Solid<'_>, &Trial, &[Big]),
    (x, y, n): (&Vector, &Vector, &Vector),
    best: &mut Best,
) {
    let n = scaled(n, &(big(1.0) / norm(n)));
    let minus: Vector = n.clone().map(|c| -c);
    let lower = dot(&n, &sub(x, y)) - one.fall(&p.index, l, x, &n) - two.fall(&q.index, m, y, &minus);
    if lower > best.lower {
        best.lower = lower;
        best.n = n.clone();
        best.dual = Some(Dual::new((x, y), (p, l), (q, m), best.unit, true));
    } else if best.upper <= big(1e-30) {
        best.n = n.clone();
    }
    raise(one, two, x, y, best);
}

/// A common point next to v, which is one that has been rounded: steps into each body in turn as
/// far as it sticks out and half as far again.
fn common(one: &Solid<'_>, two: &Solid<'_>, v: &Vector) -> Option<Vector> {
    let mut v = v.clone();
    for _ in 0..100 {
        let mut inside = true;
        for (body, i) in [one, two].into_iter().flat_map(|body| (0..body.len()).map(move |i| (body, i))) {
            let jet = body.jet(i, &v);
            let excess = jet.value - big(1.0);
            if excess > big(0.0) {
                inside = false;
                v = sub(&v, &scaled(&jet.gradient, &(excess * big(1.5) / dot(&jet.gradient, &jet.gradient))));
            }
        }
        if inside {
            return Some(v);
        }
    }
    None
}

/// Takes trial points, pulled into their bodies, if they are closer than the best so far; a common
/// point is at distance 0.
fn raise(one: &Solid<'_>, two: &Solid<'_>, x: &Vector, y: &Vector, best: &mut Best) {
    let middle = scaled(&add(x, y), &big(0.5));
    if one.largest(&middle) <= big(1.0) && two.largest(&middle) <= big(1.0) {
        (best.upper, best.x, best.y) = (big(0.0), middle.clone(), middle);
        return;
    }
    if let (Some(x), Some(y)) = (one.pull_in(x), two.pull_in(y)) {
        let apart = norm(&sub(&x, &y));
        if apart < best.upper {
            (best.upper, best.x, best.y) = (apart, x, y);
        }
    }
}
