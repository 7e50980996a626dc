//! The signed distance of a body or a capsule from a half-space with 200 bits.

use super::active::{CLOSE, Trial, for_direction};
use super::big::{Big, Vector, add, big, cross, dot, double, norm, scaled, solve, sub, vector};
use super::segment::Segment;
use super::solid::{Jet, Solid};
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Capsule, HalfSpace, Pose};

/// The signed distance in a bracket of its own, metres.
#[derive(Debug)]
pub struct Truth {
    pub lower: Big,
    pub upper: Big,
    /// Derivative with respect to the twist `(v, ω)` of the shape about the translation of its
    /// pose; one of several where a side lies flat.
    pub gradient: [f64; 6],
}

impl Truth {
    /// Width of the bracket, metres.
    pub fn width(&self) -> f64 {
        double(&(&self.upper - &self.lower))
    }

    pub fn value(&self) -> f64 {
        double(&self.upper)
    }
}

/// Bracket at which an iterate is taken, in units of the body.
const TARGET: f64 = 1e-40;

/// The least `n·x - offset` over the points of a body, from the witness of an answer; proven by its
/// own bracket.
pub fn signed_distance((body, pose): (&Body, &Pose), half_space: &HalfSpace, witness: &Vector3<f64>) -> Truth {
    let (unit, origin) = (body.circumscribed().radius.log2().round().exp2(), pose.translation());
    let one = Solid::new(body, pose, origin, unit);
    let (metres, n) = (big(unit), vector(half_space.normal()));
    let start = scaled(&sub(&vector(witness), &vector(origin)), &(big(1.0) / &metres));
    let height = dot(&n, &one.interior);
    let mut best =
        Best { lower: &height - norm(&n) * one.reach(&one.interior), upper: height, x: one.interior.clone() };
    raise(&one, &n, &start, &mut best);
    'search: for close in CLOSE {
        for trial in for_direction(&one, &start, &-half_space.normal(), close) {
            newton((&one, &trial), (&start, &n), &mut best);
            if best.done() {
                break 'search;
            }
        }
    }
    let base = dot(&n, &vector(origin)) - big(half_space.offset());
    let x = scaled(&best.x, &metres);
    let turning = cross(&x, &n);
    Truth {
        lower: &best.lower * &metres + &base,
        upper: &best.upper * &metres + base,
        gradient: std::array::from_fn(|i| double(if i < 3 { &n[i] } else { &turning[i - 3] })),
    }
}

/// The least `n·x - offset` over the points of a capsule: at the lower end of its axis, a radius
/// below it.
pub fn signed_distance_of_capsule((capsule, pose): (&Capsule, &Pose), half_space: &HalfSpace) -> Truth {
    let origin = pose.translation();
    let axis = Segment::new(capsule.half_height_m(), pose, origin, 1.0);
    let n = vector(half_space.normal());
    let end = if dot(&n, &axis.axis) > Big::ZERO { axis.at(&-&axis.half) } else { axis.at(&axis.half) };
    let below = big(half_space.offset()) + norm(&n) * big(capsule.radius_m());
    let height = dot(&n, &end) + dot(&n, &vector(origin)) - below;
    // The radius lies along the normal and turns nothing.
    let turning = cross(&end, &n);
    Truth {
        lower: height.clone(),
        upper: height,
        gradient: std::array::from_fn(|i| double(if i < 3 { &n[i] } else { &turning[i - 3] })),
    }
}

struct Best {
    lower: Big,
    upper: Big,
    x: Vector,
}

impl Best {
    fn done(&self) -> bool {
        &self.upper - &self.lower <= big(TARGET)
    }
}

/// Newton's method on `n + Σ λ ∇g = 0`, `g = 1`.
fn newton((one, trial): (&Solid<'_>, &Trial), (start, n): (&Vector, &Vector), best: &mut Best) {
    let mut x = start.clone();
    let mut l: Vec<Big> = trial.multiplier.iter().map(|&m| big(m)).collect();
    for step in 1..200 {
        let jets: Vec<Jet> = trial.index.iter().map(|&i| one.jet(i, &x)).collect();
        let size = 3 + l.len();
        let mut k = vec![vec![big(0.0); size]; size];
        let mut r = vec![big(0.0); size];
        for i in 0..3 {
            r[i] = -&n[i];
            for (j, (jet, m)) in jets.iter().zip(&l).enumerate() {
                for (c, second) in jet.hessian[i].iter().enumerate() {
                    k[i][c] += second * m;
                }
                k[i][3 + j] = jet.gradient[i].clone();
                k[3 + j][i] = jet.gradient[i].clone();
                r[i] -= &jet.gradient[i] * m;
            }
        }
        for (j, jet) in jets.iter().enumerate() {
            r[3 + j] = big(1.0) - &jet.value;
        }
        let s = solve(k, r);
        let dx: Vector = std::array::from_fn(|i| s[i].clone());
        let length = double(&norm(&dx));
        if !length.is_finite() {
            return;
        }
        let damping = big((0.5 / length.max(1e-300)).min(1.0));
        x = add(&x, &scaled(&dx, &damping));
        for (value, change) in l.iter_mut().zip(&s[3..]) {
            *value += change * &damping;
        }
        if length < 1e-12 || step % 8 == 0 {
            let lower = dot(n, &x) - one.fall(&trial.index, &l, &x, n);
            if lower > best.lower {
                best.lower = lower;
            }
            raise(one, n, &x, best);
            if best.done() || length < 1e-57 {
                return;
            }
        }
    }
}

/// Takes a trial point, pulled into the body.
fn raise(one: &Solid<'_>, n: &Vector, x: &Vector, best: &mut Best) {
    let Some(x) = one.pull_in(x) else { return };
    let height = dot(n, &x);
    if height < best.upper {
        (best.upper, best.x) = (height, x);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::{b, c, cylinder, e, q, support};
    use crate::random::{Seeded, twisted};
    use sublevel_core::measure::{Options, WarmStart, distance_to_half_space};

    /// No point of a capsule is lower, and one is as low; the gradient is the difference quotient.
    #[test]
    fn a_capsule_is_as_low_as_the_lowest_of_its_points() {
        for seed in 0..60 {
            let mut random = Seeded(1000 + seed);
            let radius = if seed % 3 == 0 { 0.0 } else { random.positive() };
            let capsule = Capsule::new(radius, 2.0 * random.positive()).unwrap();
            let (pose, n) = (random.pose(2.0), random.unit());
            let half_space = HalfSpace::new(n, random.signed()).unwrap();
            let found = signed_distance_of_capsule((&capsule, &pose), &half_space);
            let height = |along: f64| {
                let x = pose.transform_point(&(Vector3::z() * (along * capsule.half_height_m())));
                half_space.normal().dot(&x) - half_space.offset() - radius
            };
            let least = (-50..=50).map(|k| height(f64::from(k) / 50.0)).fold(f64::INFINITY, f64::min);
            assert!((found.value() - least).abs() < 2e-14 && found.width() == 0.0, "seed {seed}: {found:?} {least}");
            for k in 0..6 {
                let value =
                    |h: f64| signed_distance_of_capsule((&capsule, &twisted(&pose, k, 0, h)), &half_space).value();
                let slope = (value(1e-5) - value(-1e-5)) / 2e-5;
                assert!((slope - found.gradient[k]).abs() < 1e-8, "seed {seed}, {k}: {slope} {:?}", found.gradient);
            }
        }
    }

    #[test]
    fn heights_have_closed_forms() {
        let bodies = [b(0.6, 0.9, 0.3), cylinder(0.5, 0.8), e(1.0, 0.7, 0.4), q(8, 0.8, 0.5, 1.1), c(6, 0.8, 0.3)];
        for seed in 0..60 {
            let mut random = Seeded(seed);
            let body = &bodies[random.index(5)];
            let (pose, n) = (random.pose(2.0), random.unit());
            let half_space = HalfSpace::new(n, random.signed()).unwrap();
            // From where an answer of ours is attained, as tests of it do.
            let options = Options::default().with_accuracy(1e-12).unwrap();
            let ours = distance_to_half_space(body, &pose, &half_space, &options, &mut WarmStart::default());
            let found = signed_distance((body, &pose), &half_space, &ours.witness);
            let own = pose.rotation().inverse_transform_vector(half_space.normal());
            let exact = half_space.normal().dot(pose.translation()) - support(body, &-own) - half_space.offset();
            assert!(found.width() < 1e-35, "seed {seed} {}: {found:?}", body.name());
            assert!((found.value() - exact).abs() < 1e-14, "seed {seed} {}: {found:?} {exact}", body.name());
        }
    }
}
