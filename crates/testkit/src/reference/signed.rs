//! The signed distance of two bodies with 200 bits, along the branch of an answer.
//!
//! In overlap the shortest translation out is the least of many: what an answer's normal leads to
//! is a stationary one, and the optimality system of the distance with a negative D says which.
//! Whether another way is shorter is not decided here.

use super::active::{CLOSE, for_direction};
use super::big::{Big, Vector, big, double, scaled, sub, vector};
use super::distance::{Iterate, twists};
use super::dual::Dual;
use super::solid::Solid;
use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::{Pose, SignedDistance};

/// A stationary signed distance.
#[derive(Debug)]
pub struct Truth {
    /// Metres.
    pub value: f64,
    /// Derivative with respect to the twists `(v_a, ω_a, v_b, ω_b)` of the bodies, each about its
    /// own translation.
    pub gradient: [f64; 12],
    /// Unit normal from the second body to the first, and what proves that a plane across it parts
    /// the bodies by the value.
    pub normal: Vector,
    pub dual: Dual,
}

/// Step at which an iterate is taken, in units of the larger body.
const TARGET: f64 = 1e-40;

/// Residual up to which it solves its equations: gradients of thin bodies are that much larger than
/// the step.
const SOLVED: f64 = 1e-28;

/// Cosine of the angle between the normals of an answer and of a stationary point next to it, at
/// least. Smaller, the point may belong to another direction; larger, answers at flat sides, whose
/// normals turn a lot within the accuracy, have no reference.
const NEXT: f64 = 0.9;

/// Solves for the stationary point next to an answer. None if Newton's method finds none with
/// multipliers of the right sign, or only some whose normals are turned by more.
pub fn signed_distance(a: &Body, pose_a: &Pose, b: &Body, pose_b: &Pose, answer: &SignedDistance) -> Option<Truth> {
    let (large, small) = (a.circumscribed().radius, b.circumscribed().radius);
    let (large, small) = (large.max(small), large.min(small));
    let unit = large.log2().round().exp2();
    let origin = pose_a.translation();
    let (one, two) = (Solid::new(a, pose_a, origin, unit), Solid::new(b, pose_b, origin, unit));
    let local = |w: &Vector3<f64>| scaled(&sub(&vector(w), &vector(origin)), &(big(1.0) / big(unit)));
    let (x, y, normal) = (local(&answer.witness_a), local(&answer.witness_b), answer.normal?);
    for close in CLOSE {
        let (of_a, of_b) = (for_direction(&one, &x, &-normal, close), for_direction(&two, &y, &normal, close));
        for rank in 0..of_a.len() + of_b.len() {
            for (i, j) in (0..=rank).map(|i| (i, rank - i)) {
                let (Some(p), Some(q)) = (of_a.get(i), of_b.get(j)) else { continue };
                let mut iterate = Iterate::new(p, q, &x, &y, &vector(&normal));
                let settled =
                    (0..100).map(|_| iterate.step(&one, &two, small / unit)).find(|length| !(*length > TARGET));
                let signs = iterate.l.iter().chain(&iterate.m).all(|multiplier| *multiplier >= Big::ZERO);
                let inside = |body: &Solid<'_>, v| body.largest(v) <= big(1.0) + big(TARGET);
                let settled = settled.is_some_and(|length| length <= TARGET);
                let solved = settled && signs && iterate.residual(&one, &two) <= SOLVED;
                let found = Vector3::from_fn(|k, _| double(&iterate.n[k]));
                let solved = solved && found.dot(&normal) >= NEXT;
                if solved && inside(&one, &iterate.x) && inside(&two, &iterate.y) {
                    let metres = big(unit);
                    let (x, y) = (scaled(&iterate.x, &metres), scaled(&iterate.y, &metres));
                    let gradient = twists(&x, &y, &iterate.n, pose_a, pose_b);
                    let dual = Dual::new((&iterate.x, &iterate.y), (p, &iterate.l), (q, &iterate.m), unit, true);
                    return Some(Truth { value: double(&iterate.d) * unit, gradient, normal: iterate.n, dual });
                }
            }
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bodies::{b, cylinder};
    use sublevel_core::measure::{Options, WarmStart};

    /// A cylinder that lies within a box, tilted by 1.5e-5: Newton's method for the wall and the
    /// side alone, which have no common normal, ends without a solution. What is stationary is the
    /// overlap across the side, `0.7 + 0.3 sqrt(1 - a²) + 0.4 a` with a the cosine of the angle
    /// between its normal and the axis.
    #[test]
    fn equations_that_contradict_each_other_are_not_solved() {
        let (block, rod) = (b(1.5, 1.0, 0.7), cylinder(0.3, 0.4));
        let place = Vector3::new(-0.0, -1.3863125783687681e-15, -0.0);
        let turn = [0.7071013793078693, 4.295346140080226e-5, 3.5558578966985805e-5, 0.707112180825289];
        let (at, lying) = (Pose::identity(), Pose::from_quaternion(place, turn).unwrap());
        let options = Options::default();
        let found =
            sublevel_core::measure::signed_distance(&block, &at, &rod, &lying, &options, &mut WarmStart::default());
        let a = lying.transform_direction(&Vector3::z()).z.abs();
        let exact = -(0.7 + 0.3 * (1.0 - a * a).sqrt() + 0.4 * a);
        let truth = signed_distance(&block, &at, &rod, &lying, &found);
        assert!(truth.is_none_or(|truth| (truth.value - exact).abs() < 1e-14), "{exact}");
        assert!((found.value() - exact).abs() < 1e-12, "{found:?} {exact}");
    }
}
