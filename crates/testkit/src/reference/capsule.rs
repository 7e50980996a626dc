//! The signed distance of a body from a capsule, and of two capsules, with 200 bits: that of the
//! axis less the radius.
//!
//! Against a body the distance of the axis is solved for by Newton's method and bracketed in the
//! same 200 bits, as [`super::distance()`] is. Two axes have a closed form: the least square over a
//! rectangle is at its stationary point or on one of its sides.

use super::active::{CLOSE, Trial, for_direction};
use super::big::{Big, Vector, abs, add, big, dot, double, doubles, norm, scaled, solve, sub, vector};
use super::distance::twists;
use super::segment::Segment;
use super::solid::{Jet, Solid};
use nalgebra::Vector3;
use sublevel_core::body::{Body, ExactShape};
use sublevel_core::measure::{Capsule, Pose};

/// A signed distance in a bracket of its own, metres; the second of both is a capsule.
#[derive(Debug)]
pub struct Truth {
    /// None where no depth is known: where the axis of the capsule meets a body that is no ball.
    pub lower: Option<Big>,
    pub upper: Big,
    /// From the capsule to the body, where the axis is outside.
    pub normal: Option<Vector3<f64>>,
    /// Derivative with respect to the twists `(v_a, ω_a, v_b, ω_b)`, each about the translation of
    /// its pose, where there is a normal.
    pub gradient: [f64; 12],
}

impl Truth {
    /// Width of the bracket, metres; infinite without a lower end.
    pub fn width(&self) -> f64 {
        self.lower.as_ref().map_or(f64::INFINITY, |lower| double(&(&self.upper - lower)))
    }

    /// The upper end: the value, or where no depth is known what it is at most.
    pub fn value(&self) -> f64 {
        double(&self.upper)
    }

    /// Whether a bracket has the truth in it; of an unknown depth no lower end is proven.
    pub fn inside(&self, lower: f64, upper: f64) -> bool {
        let above = match &self.lower {
            Some(least) => *least <= big(upper),
            None => true,
        };
        above && (lower == f64::NEG_INFINITY || self.lower.is_some() && big(lower) <= self.upper)
    }
}

/// The distance from an axis, in the frame of work.
struct OfAxis {
    lower: Big,
    upper: Big,
    x: Vector,
    y: Vector,
    n: Vector,
}

/// Bracket at which an iterate is taken, and within which an axis counts as met; in units of the
/// body.
const TARGET: f64 = 1e-40;

/// How far along the axis Newton's method starts, in units of the body: where the surface has no
/// curvature, no step leads out of the middle of its flat.
const STARTS: [f64; 3] = [0.0, 1.0 / 32.0, -1.0 / 32.0];

/// The signed distance of a body from a capsule, from a point of the body and a direction to it
/// that an answer gives: what is found is proven by its own bracket.
pub fn signed_distance(
    (body, pose): (&Body, &Pose),
    (capsule, capsule_pose): (&Capsule, &Pose),
    (witness, normal): (&Vector3<f64>, Option<Vector3<f64>>),
) -> Truth {
    if let Some(truth) = of_ball((body, pose), (capsule, capsule_pose)) {
        return truth;
    }
    let (unit, origin) = (body.circumscribed().radius.log2().round().exp2(), pose.translation());
    let one = Solid::new(body, pose, origin, unit);
    let axis = Segment::new(capsule.half_height_m(), capsule_pose, origin, unit);
    let metres = big(unit);
    let x = scaled(&sub(&vector(witness), &vector(origin)), &(big(1.0) / &metres));
    let found = distance_of_axis(&one, &axis, &x, normal);
    let radius = big(capsule.radius_m());
    let meets = found.upper <= big(TARGET);
    let (x, y) = (scaled(&found.x, &metres), scaled(&found.y, &metres));
    Truth {
        lower: (!meets).then(|| &found.lower * &metres - &radius),
        upper: if meets { -radius } else { &found.upper * &metres - radius },
        normal: (!meets).then(|| doubles(&found.n)),
        gradient: twists(&x, &y, &found.n, pose, capsule_pose),
    }
}

/// Of a ball, whose depth is known: its centre is a capsule of no length.
fn of_ball((body, pose): (&Body, &Pose), (capsule, capsule_pose): (&Capsule, &Pose)) -> Option<Truth> {
    let ExactShape::Capsule { .. } = body.closed_form()?.shape() else { return None };
    let (normalization, placed) = (body.normalization(), *pose);
    // About the origin of its frame and unturned, as all balls here: else in the general way.
    if normalization.center != Vector3::zeros() || normalization.linear[(1, 0)] != 0.0 {
        return None;
    }
    let radius = big(1.0) / big(normalization.linear[(0, 0)]);
    let center = Capsule::POINT;
    let found = signed_distance_of_two((&center, &placed), (capsule, capsule_pose));
    Some(Truth { lower: found.lower.map(|lower| lower - &radius), upper: found.upper - radius, ..found })
}

/// The signed distance of two capsules; normal and gradient where their axes do not meet. Where they
/// do, both lie in a plane, across which the shortest translation out leads: its length is the sum
/// of the radii.
pub fn signed_distance_of_two((a, pose_a): (&Capsule, &Pose), (b, pose_b): (&Capsule, &Pose)) -> Truth {
    let origin = pose_a.translation();
    let one = Segment::new(a.half_height_m(), pose_a, origin, 1.0);
    let two = Segment::new(b.half_height_m(), pose_b, origin, 1.0);
    let mut places = vec![];
    for s in [&one.half, &-&one.half] {
        places.push((s.clone(), two.place(&one.at(s))));
    }
    for t in [&two.half, &-&two.half] {
        places.push((one.place(&two.at(t)), t.clone()));
    }
    // Where both derivatives of the square are 0, unless the axes are parallel.
    let (cos, between) = (dot(&one.axis, &two.axis), sub(&two.center, &one.center));
    let sin_squared = big(1.0) - &cos * &cos;
    if sin_squared > big(1e-45) {
        let (of_a, of_b) = (dot(&one.axis, &between), dot(&two.axis, &between));
        let s = (&of_a - &cos * &of_b) / &sin_squared;
        let t = (&cos * &of_a - &of_b) / &sin_squared;
        if abs(&s) <= one.half && abs(&t) <= two.half {
            places.push((s, t));
        }
    }
    let pairs = places.into_iter().map(|(s, t)| {
        let (x, y) = (one.at(&s), two.at(&t));
        (norm(&sub(&x, &y)), x, y)
    });
    let (apart, x, y) = pairs.reduce(|p, q| if q.0 < p.0 { q } else { p }).expect("five at most, four at least");
    let radii = big(a.radius_m()) + big(b.radius_m());
    let size = a.reach_m().max(b.reach_m()).max(norm_of(&between));
    let meets = apart <= big(TARGET * size);
    let n = if meets { vector(&Vector3::zeros()) } else { scaled(&sub(&x, &y), &(big(1.0) / &apart)) };
    let value = if meets { -radii } else { apart - radii };
    Truth {
        lower: Some(value.clone()),
        upper: value,
        normal: (!meets).then(|| doubles(&n)),
        gradient: twists(&x, &y, &n, pose_a, pose_b),
    }
}

fn norm_of(v: &Vector) -> f64 {
    double(&norm(v))
}

/// The distance of a body from a segment, from a point of the body.
fn distance_of_axis(one: &Solid<'_>, axis: &Segment, start: &Vector, normal: Option<Vector3<f64>>) -> OfAxis {
    let y = axis.nearest(&one.interior);
    let mut best = OfAxis {
        lower: big(0.0),
        upper: norm(&sub(&one.interior, &y)),
        x: one.interior.clone(),
        y,
        n: vector(&Vector3::x()),
    };
    raise(one, axis, start, &mut best);
    // An answer without a normal says that they meet.
    if normal.is_none() && meet(one, axis, start, &mut best) {
        return best;
    }
    let y = axis.nearest(start);
    let towards = normal.or_else(|| doubles(&sub(start, &y)).try_normalize(1e-300)).unwrap_or_else(Vector3::x);
    // Nearest in its middle, or at one of its ends: first as it looks.
    let place = axis.place(start);
    let inner = abs(&place) < &axis.half * big(1.0 - 1e-9);
    let of_sign = |sign: f64| Some(&axis.half * big(sign));
    let near = if place < Big::ZERO { -1.0 } else { 1.0 };
    let mut ends = vec![of_sign(near), of_sign(-near)];
    ends.insert(usize::from(!inner), None);
    for along in STARTS {
        let start = &add(start, &scaled(&axis.axis, &big(along)));
        for close in CLOSE {
            for trial in for_direction(one, start, &-towards, close) {
                for end in &ends {
                    newton((one, &trial), (axis, end.as_ref()), (start, &towards), &mut best);
                    if &best.upper - &best.lower <= big(TARGET) {
                        return best;
                    }
                }
            }
        }
    }
    best
}

/// Newton's method on `x - s = D n`, `n + Σ λ ∇g = 0`, `n·n = 1`, `g = 1` with `s = c + t u` and
/// `n·u = 0`, or t at an end.
fn newton(
    (one, trial): (&Solid<'_>, &Trial),
    (axis, end): (&Segment, Option<&Big>),
    (start, towards): (&Vector, &Vector3<f64>),
    best: &mut OfAxis,
) {
    let (mut x, mut n) = (start.clone(), vector(towards));
    let mut t = end.map_or_else(|| axis.place(start), Big::clone);
    let mut d = dot(&n, &sub(&x, &axis.at(&t)));
    let mut l: Vec<Big> = trial.multiplier.iter().map(|&m| big(m)).collect();
    let mut stalled = 0;
    for step in 1..200 {
        let jets: Vec<Jet> = trial.index.iter().map(|&i| one.jet(i, &x)).collect();
        let size = 8 + l.len();
        let mut k = vec![vec![big(0.0); size]; size];
        let mut r = vec![big(0.0); size];
        let apart = sub(&x, &axis.at(&t));
        for i in 0..3 {
            k[i][i] = big(1.0);
            k[i][3 + i] = -&d;
            k[i][6] = -&n[i];
            k[i][7] = -&axis.axis[i];
            r[i] = &d * &n[i] - &apart[i];
            k[3 + i][3 + i] = big(1.0);
            r[3 + i] = -&n[i];
            for (j, (jet, m)) in jets.iter().zip(&l).enumerate() {
                for (c, second) in jet.hessian[i].iter().enumerate() {
                    k[3 + i][c] += second * m;
                }
                k[3 + i][8 + j] = jet.gradient[i].clone();
                k[8 + j][i] = jet.gradient[i].clone();
                r[3 + i] -= &jet.gradient[i] * m;
            }
            k[6][3 + i] = &n[i] * big(2.0);
            if end.is_none() {
                k[7][3 + i] = axis.axis[i].clone();
            }
        }
        r[6] = big(1.0) - dot(&n, &n);
        match end {
            None => r[7] = -dot(&n, &axis.axis),
            Some(_) => k[7][7] = big(1.0),
        }
        for (j, jet) in jets.iter().enumerate() {
            r[8 + j] = big(1.0) - &jet.value;
        }
        let s = solve(k, r);
        let part = |from: usize| -> Vector { std::array::from_fn(|i| s[from + i].clone()) };
        let (dx, dn) = (part(0), part(3));
        let length = norm_of(&dx).max(norm_of(&dn));
        if !length.is_finite() {
            return;
        }
        let damping = big((0.5 / length.max(1e-300)).min(1.0));
        x = add(&x, &scaled(&dx, &damping));
        n = add(&n, &scaled(&dn, &damping));
        d += &s[6] * &damping;
        // A place beyond the ends would only lead farther away.
        t = axis.within(&t + &s[7] * &damping);
        for (value, change) in l.iter_mut().zip(&s[8..]) {
            *value += change * &damping;
        }
        if length < 1e-12 || step % 8 == 0 {
            let before = &best.upper - &best.lower;
            bracket((one, trial, &l), axis, (&x, &n), best);
            let width = &best.upper - &best.lower;
            stalled = if width < before || length >= 1e-12 { 0 } else { stalled + 1 };
            if width <= big(TARGET) || stalled > 3 || length < 1e-57 {
                return;
            }
        }
    }
}

/// Takes the bounds that an iterate proves: the plane across n, with what the tangent planes at x
/// leave open, against the height of the segment.
fn bracket(
    (one, trial, l): (&Solid<'_>, &Trial, &[Big]),
    axis: &Segment,
    (x, n): (&Vector, &Vector),
    best: &mut OfAxis,
) {
    let n = scaled(n, &(big(1.0) / norm(n)));
    let fall = one.fall(&trial.index, l, x, &n);
    let lower = dot(&n, x) - fall - axis.height(&n);
    if lower > best.lower {
        (best.lower, best.n) = (lower, n);
    }
    raise(one, axis, x, best);
}

/// Takes a trial point, pulled into the body, with the point of the segment nearest to it.
fn raise(one: &Solid<'_>, axis: &Segment, x: &Vector, best: &mut OfAxis) {
    let Some(x) = one.pull_in(x) else { return };
    let y = axis.nearest(&x);
    if one.largest(&y) <= big(1.0) {
        (best.upper, best.x, best.y) = (big(0.0), y.clone(), y);
        return;
    }
    let apart = norm(&sub(&x, &y));
    if apart < best.upper {
        (best.upper, best.x, best.y) = (apart, x, y);
    }
}

/// Whether a point of the segment lies in the body: steps into the body and back onto the segment.
fn meet(one: &Solid<'_>, axis: &Segment, start: &Vector, best: &mut OfAxis) -> bool {
    for begin in [start, &one.interior] {
        let mut v = axis.nearest(begin);
        for _ in 0..100 {
            let worst = (0..one.len()).map(|i| one.jet(i, &v)).reduce(|p, q| if q.value > p.value { q } else { p });
            let worst = worst.expect("a body has constraints");
            let excess = &worst.value - big(1.0);
            if excess <= Big::ZERO {
                (best.upper, best.x, best.y) = (big(0.0), v.clone(), v);
                return true;
            }
            let step = excess * big(1.5) / dot(&worst.gradient, &worst.gradient);
            v = axis.nearest(&sub(&v, &scaled(&worst.gradient, &step)));
        }
    }
    false
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::{b, cylinder, e, q};
    use crate::random::{Seeded, at, pose, twisted};
    use nalgebra::UnitQuaternion;
    use sublevel_core::measure::{Options, WarmStart, distance_to_capsule};

    /// From where an answer of ours is attained, as tests of it do.
    fn truth_of(body: &Body, at: &Pose, capsule: &Capsule, pose: &Pose) -> Truth {
        let options = Options::default().with_accuracy(1e-12).unwrap();
        let found = distance_to_capsule(body, at, capsule, pose, &options, &mut WarmStart::default());
        signed_distance((body, at), (capsule, pose), (&found.witness, found.normal))
    }

    #[test]
    fn coaxial_shapes_have_closed_forms() {
        let limb = Capsule::new(0.25, 0.5).unwrap();
        for (body, half) in
            [(b(0.5, 0.25, 1.0), 1.0), (cylinder(0.5, 0.5), 0.5), (e(1.0, 2.0, 0.5), 0.5), (q(8, 1.0, 1.0, 0.5), 0.5)]
        {
            for gap in [2.0, 1e-3, 1e-12, -1e-12, -0.125] {
                let place = at(0.0, 0.0, half + 0.75 + gap);
                let found = truth_of(&body, &Pose::identity(), &limb, &place);
                let exact = place.translation().z - half - 0.75;
                assert!(
                    (found.value() - exact).abs() < 1e-30 && found.width() < 1e-35,
                    "{} {gap:e}: {found:?}",
                    body.name()
                );
                assert!((found.gradient[6].abs() + (found.gradient[8] - 1.0).abs()) < 1e-15, "{found:?}");
            }
            let inside = truth_of(&body, &Pose::identity(), &limb, &at(0.0, 0.0, half));
            assert!(inside.lower.is_none() && inside.value() == -0.25 && inside.normal.is_none(), "{inside:?}");
        }
        let balls = truth_of(&e(0.5, 0.5, 0.5), &Pose::identity(), &limb, &at(0.125, 0.0, 0.25));
        assert!((balls.value() - (0.125 - 0.75)).abs() < 1e-30 && balls.lower.is_some(), "{balls:?}");
    }

    /// Lying over a face, across an edge, beside a corner.
    #[test]
    fn boxes_have_closed_forms() {
        let cube = b(1.0, 1.0, 1.0);
        let lying = UnitQuaternion::from_scaled_axis(Vector3::y() * std::f64::consts::FRAC_PI_2);
        let limb = Capsule::new(0.125, 0.5).unwrap();
        for (x, y, z, exact) in
            [(0.0, 0.0, 1.5, 0.375), (0.0, 4.0, 5.0, 4.875), (1.0 + 3.0 + 0.5, 1.0 + 4.0, 1.0 + 12.0, 12.875)]
        {
            let found = truth_of(&cube, &Pose::identity(), &limb, &pose(Vector3::new(x, y, z), &lying));
            assert!((found.value() - exact).abs() < 1e-15, "{exact}: {found:?}");
            // On a face each point will do, and the bracket is as wide as the turn is off a quarter.
            assert!(found.width() < if x == 0.0 { 1e-15 } else { 1e-35 }, "{exact}: {found:?}");
        }
    }

    /// The least over many places of both axes is no less, and next to it.
    #[test]
    fn two_axes_are_as_near_as_their_points() {
        for seed in 0..40 {
            let mut random = Seeded(seed);
            let [a, b] = [(); 2].map(|()| Capsule::new(0.1, random.between(0.1, 3.0)).unwrap());
            let (pose_a, far) = (random.pose(0.3), 3.0 * random.positive());
            let pose_b = if seed % 4 == 0 { pose(random.unit() * far, pose_a.rotation()) } else { random.pose(far) };
            let found = signed_distance_of_two((&a, &pose_a), (&b, &pose_b)).value();
            let along = |capsule: &Capsule, pose: &Pose, k: i32| {
                pose.transform_point(&(Vector3::z() * (capsule.half_height_m() * f64::from(k) / 100.0)))
            };
            let least = (-100..=100)
                .flat_map(|i| (-100..=100).map(move |j| (i, j)))
                .map(|(i, j)| (along(&a, &pose_a, i) - along(&b, &pose_b, j)).norm() - 0.2)
                .fold(f64::INFINITY, f64::min);
            assert!(least >= found - 1e-14 && least - found < 0.05, "seed {seed}: {found} beside {least}");
        }
    }

    #[test]
    fn gradients_are_derivatives() {
        for seed in 0..12 {
            let mut random = Seeded(seed);
            let bodies = [b(0.6, 0.9, 0.3), cylinder(0.5, 0.8), e(1.0, 0.7, 0.4), q(6, 0.8, 0.5, 1.1)];
            let body = &bodies[random.index(4)];
            let capsule = Capsule::new(0.1, 0.4).unwrap();
            let (pose_a, pose_b) = (random.pose(0.1), random.pose(2.5));
            let found = truth_of(body, &pose_a, &capsule, &pose_b);
            for k in 0..12 {
                let value =
                    |h: f64| truth_of(body, &twisted(&pose_a, k, 0, h), &capsule, &twisted(&pose_b, k, 6, h)).value();
                let slope = (value(1e-5) - value(-1e-5)) / 2e-5;
                assert!((slope - found.gradient[k]).abs() < 1e-8, "seed {seed}, {k}: {slope} {}", found.gradient[k]);
            }
        }
    }
}
