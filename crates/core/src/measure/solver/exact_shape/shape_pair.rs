//! The distance of two sets with closed forms.
//!
//! Of a point x of A the half squared distance from B has the gradient `v = x - P x` and the
//! Hessian `n nᵀ + D T K Tᵀ`, in the terms of [`super::projectable`]: for boxes it is a quadratic
//! in each region, and Newton's method for its least value over A, by [`Projectable::least`], ends
//! after as many steps as there are changes of regions. For cylinders it converges quadratically.
//! Steps that lead farther away are cut: [`share_of_step`].
//! What proves the answer is the support functions of both: a plane across n separates by `n·t -
//! h_A(-n) - h_B(n)`, t from the centre of B to that of A. What is off in n across an edge or a
//! face costs its length, so that n is taken from the normals that the features have.

use super::projectable::{Offset, Projectable};
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_transposed, dot, normalized, scaled, subtract,
};
use crate::measure::options::Options;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{ALIGNED, TAYLOR_ROUNDING};
use crate::polynomial::{Number, Scalar, Simd};

/// Most steps; boxes take fewer than ten.
const MAX_STEPS: u32 = 32;

/// Curvature, relative to that towards B, dimensionless, that is given to directions along which
/// the distance is flat, so that steps have an end.
///
/// Smaller, rounding would choose them; larger, sides tilted by less take many steps:
/// `distances_of_nearly_parallel_sides`.
pub(super) const FLAT: f64 = 1e-12;

/// How much farther away than before, relative to the distance, a step may seem to lead by the
/// rounding of both distances; dimensionless.
///
/// Smaller, the last step of cylinders, which no longer shortens the distance but turns the normal
/// the rest of the way, is not taken: a tenth of those some diameters apart were left to single
/// queries. Larger, steps that lead away pass. It changes time only.
pub(super) const LEVEL: f64 = 4.0 * f64::EPSILON;

/// Most of these steps of Newton's method back along a step.
///
/// With one instead of two, single queries were left with 3 of 12 000 poses more; with eight, with
/// none less. It changes time only.
pub(super) const MOST_CUTS: u32 = 2;

/// Largest angle between the normals of both sets, radians, that an answer is taken at.
///
/// Witnesses are off by it times the distance, or the sizes where those are smaller, and gradients
/// by their arms: a step more costs little here.
/// Larger, gradients of long bodies are off by more than 1e-6; smaller, rounding keeps answers from
/// being taken. Exercised by `shapes_against_shapes`.
pub(super) const FINELY_ALIGNED: f64 = ALIGNED / 8.0;

/// Square of the sine of the angle between two edges, dimensionless, above which the normal across
/// both is taken from them.
///
/// Smaller, rounding turns that normal; larger, edges at small angles are proven apart by less than
/// they are. Exercised by `shapes_against_shapes`.
pub(super) const CROSSED: f64 = 1e-12;

/// Largest slope of the distance along A at its witness, dimensionless, with which Newton's method
/// ends at once. Where A's edge or axis is at an angle θ to an edge of B, a distance D away, a
/// slope of s leaves the witness s D / θ² from the nearest point, and the normal turned by s / θ.
///
/// Larger, gradients of edges at small angles are off by more than 1e-6; smaller, steps are made
/// that move nothing. Pinned by `family_20_gradients_of_primitives`, seed 3123.
pub(super) const LEVEL_SLOPE: f64 = 1e-10;

/// Most steps of Newton's method from an answer that is aligned on to a slope below
/// [`LEVEL_SLOPE`]: each doubles the digits of the slope.
///
/// Smaller, gradients of edges at small angles are off by more than 1e-6; larger, steps are made
/// where rounding alone is left.
const MOST_POLISHING: u32 = 2;

/// Margin, relative to the sizes, dimensionless, by which sets have to overlap to be reported as
/// overlapping: some times what rounding adds to an upper bound.
///
/// Smaller, an overlap could be claimed of sets that touch; larger, slim overlaps are left to the
/// general search. Exercised by `contacts_of_shapes_are_decided`.
const MARGIN: f64 = 1e-12;

/// Two sets, A where it stands as seen from B.
pub(super) struct ShapePair<A, B> {
    pub(super) a: A,
    pub(super) b: B,
    /// From A's frame to B's.
    pub(super) rotation: M3<f64>,
    /// Of A's centre in B's frame, metres.
    pub(super) translation: V3<f64>,
    /// Bound of all errors of places, metres.
    pub(super) displacement: f64,
}

/// A proven bracket, metres, and where it is attained; in B's frame.
#[derive(Clone, Copy, Debug)]
pub(super) struct ShapeProven {
    pub(super) lower: f64,
    pub(super) upper: f64,
    pub(super) x: V3<f64>,
    pub(super) y: V3<f64>,
    /// Unit normal from B to A; zero where x is in both.
    pub(super) n: V3<f64>,
    pub(super) steps: u32,
    /// Whether the normal is that of the solution.
    pub(super) is_aligned: bool,
}

/// On which side of contact two sets are.
#[derive(Clone, Copy, Debug)]
pub(super) enum Contact {
    /// The point, in B's frame, lies in both.
    Common(V3<f64>),
    /// They are at least this far apart, metres.
    Apart(f64),
    /// Neither is proven.
    Open,
}

/// The share of a step, in B's frame, after which the distance is about the least along it, by
/// Newton's method from its end, where B is seen at this distance (metres) with the frame and the
/// curvature of its offset surface. The distance is convex, so that its derivative there points
/// back, and the edge or corner that is nearest from the end bends it: between nearly parallel
/// sides that finds the edge where they end.
#[inline(always)]
pub(super) fn share_of_step<S: Simd, N: Number<S>>(
    simd: S,
    (frame, k, distance): (&M3<N>, [N; 3], N),
    step: V3<N>,
) -> N {
    let (zero, one) = (N::splat(simd, 0.0), N::splat(simd, 1.0));
    let [u0, u1, u] = apply(frame, step);
    let bent = u0 * (k[0] * u0 + k[1] * u1) + u1 * (k[1] * u0 + k[2] * u1);
    let share = one - distance * u / (distance * bent + u * u);
    share.max(zero).min(one)
}

impl<A: Projectable, B: Projectable> ShapePair<A, B> {
    /// From a point of A in its frame on until the goal is met, the bracket is as narrow as the
    /// tolerance, metres, or no step is left.
    pub(super) fn solve(
        &self,
        start: V3<f64>,
        goal: &StopCriterion,
        tolerance: f64,
        options: &Options<'_>,
    ) -> ShapeProven {
        let mut own = self.a.project(Scalar, start);
        let mut best = ShapeProven {
            lower: 0.0,
            upper: f64::INFINITY,
            x: self.placed(own),
            y: [0.0; 3],
            n: [0.0; 3],
            steps: 0,
            is_aligned: false,
        };
        let mut seen = self.b.offset(Scalar, self.placed(own));
        let mut polished = 0;
        for steps in 1..=MAX_STEPS {
            if options.exhausted(steps - 1) {
                break;
            }
            let x = self.placed(own);
            best.steps = steps;
            if seen.distance == 0.0 {
                return ShapeProven { lower: 0.0, upper: self.rounding(x), x, y: x, n: [0.0; 3], ..best };
            }
            if seen.distance.is_nan() {
                break;
            }
            let (v, y) = (scaled::<Scalar, f64>(seen.frame[2], seen.distance), self.b.project(Scalar, x));
            let rounding = self.rounding(x);
            let upper = seen.distance + rounding;
            // Of an answer that is polished the last points and normal count, not what rounding
            // makes of the bracket.
            let is_polished = polished > 0;
            if upper < best.upper || is_polished && upper - best.lower <= tolerance {
                (best.upper, best.x, best.y) = (upper, x, y);
            }
            let mut highest = if is_polished { best.upper - tolerance } else { best.lower };
            for n in self.normals(own, seen.frame[2], seen.feature) {
                let lower = self.along(n) - rounding;
                if lower > highest || best.n == [0.0; 3] && !lower.is_nan() {
                    (best.lower, best.n) = (lower.max(best.lower), n);
                    highest = highest.max(lower);
                }
            }
            if goal.met(best.lower, best.upper) {
                break;
            }
            if best.upper - best.lower <= tolerance {
                let way = subtract::<Scalar, f64>(best.x, best.y);
                let off = subtract::<Scalar, f64>(way, scaled::<Scalar, f64>(best.n, seen.distance));
                // Far away the places count, not the angle; at short distances rounding allows no
                // better direction.
                let reach = self.a.reach() + self.b.reach();
                let floor = 2.0 * f64::EPSILON * (reach + seen.distance);
                let enough = (FINELY_ALIGNED * seen.distance.min(reach)).max(floor);
                let inward =
                    apply_transposed::<Scalar, f64>(&self.rotation, scaled::<Scalar, f64>(seen.frame[2], -1.0));
                let slides = self.a.slide(Scalar, own, inward) * seen.distance;
                best.is_aligned |= dot::<Scalar, f64>(off, off) <= enough * enough && slides <= enough;
                let is_level = slides <= floor.max(LEVEL_SLOPE * seen.distance) || polished == MOST_POLISHING;
                if best.is_aligned && is_level || best.upper <= tolerance {
                    break;
                }
                polished += u32::from(best.is_aligned);
            }
            // Newton's step in A's frame.
            let gradient = apply_transposed::<Scalar, f64>(&self.rotation, v);
            let mut hessian = self.hessian(&seen.frame, seen.curvature.map(|k| k * seen.distance));
            for i in [0, 3, 5] {
                hessian[i] += FLAT;
            }
            // Where rounding keeps the bracket wide, steps that only turn the normal have no end.
            let can_be_narrow = 2.0 * rounding <= tolerance;
            let farthest = if can_be_narrow { seen.distance * (1.0 + LEVEL) } else { seen.distance.next_down() };
            match self.nearer(own, self.a.least(Scalar, own, gradient, &hessian), farthest) {
                Some((next, of_next)) if next != own => (own, seen) = (next, of_next),
                _ => break,
            }
        }
        best
    }

    /// Where a step between two points of A's frame ends: at the second one if that is no farther
    /// from B than `farthest`, metres, else about where the distance is least; none if that is
    /// still farther. With what is seen of B from there.
    #[inline(always)]
    fn nearer(&self, from: V3<f64>, to: V3<f64>, farthest: f64) -> Option<(V3<f64>, Offset)> {
        let mut next = to;
        for _ in 0..=MOST_CUTS {
            let seen = self.b.offset(Scalar, self.placed(next));
            if seen.distance <= farthest {
                return Some((next, seen));
            }
            let way = subtract::<Scalar, f64>(next, from);
            let placed = apply::<Scalar, f64>(&self.rotation, way);
            let share = share_of_step(Scalar, (&seen.frame, seen.curvature, seen.distance), placed);
            next = add_scaled::<Scalar, f64>(from, share, way);
        }
        None
    }

    /// On which side of contact the sets are, and after how many steps. A common point is one of A
    /// made smaller by more than all errors, and within them of B made smaller. From a point of A
    /// in its frame.
    pub(super) fn contact(&self, start: V3<f64>, options: &Options<'_>) -> (Contact, u32) {
        let size = self.a.reach() + self.b.reach();
        let by = 4.0 * self.displacement + MARGIN * size;
        let smaller = ShapePair { a: self.a.shrunk(by), b: self.b.shrunk(by), ..*self };
        // Making both smaller adds at most 2 √3 `by` to their distance.
        let found = smaller.solve(start, &StopCriterion::beyond(8.0 * by), 0.5 * by, options);
        // Points and segments have no inside: what is near them has to be in the other set.
        let (of_a, of_b) = (self.a.thinnest(), self.b.thinnest());
        let fits = |thinnest: f64| thinnest > 2.0 * by || thinnest == 0.0;
        if found.upper <= 0.5 * by && fits(of_a) && fits(of_b) && (of_a > 0.0 || of_b > 0.0) {
            return (Contact::Common(if of_a == 0.0 { found.x } else { found.y }), found.steps);
        }
        let lower = self.along(found.n) - self.rounding(found.x);
        let apart = found.n != [0.0; 3] && lower > 0.0;
        (if apart { Contact::Apart(lower) } else { Contact::Open }, found.steps)
    }

    /// A point of A's frame in B's.
    #[inline(always)]
    fn placed(&self, own: V3<f64>) -> V3<f64> {
        add::<Scalar, f64>(self.translation, apply::<Scalar, f64>(&self.rotation, own))
    }

    /// Inverse of [`ShapePair::placed`].
    #[inline(always)]
    pub(super) fn own(&self, x: V3<f64>) -> V3<f64> {
        apply_transposed::<Scalar, f64>(&self.rotation, subtract::<Scalar, f64>(x, self.translation))
    }

    /// How far a plane across n keeps the sets apart.
    #[inline(always)]
    fn along(&self, n: V3<f64>) -> f64 {
        let own = apply_transposed::<Scalar, f64>(&self.rotation, n);
        self.b.separation(Scalar, n, (self.translation, self.a.height(Scalar, own)))
    }

    /// Bound of the error of the distance of a point of B's frame from either set, metres.
    #[inline(always)]
    pub(super) fn rounding(&self, x: V3<f64>) -> f64 {
        let size = x[0].abs() + x[1].abs() + x[2].abs() + 2.0 * (self.a.reach() + self.b.reach());
        TAYLOR_ROUNDING * size + self.displacement
    }

    /// Normals that touch the features of A at a point of its frame, and of B.
    #[inline(always)]
    fn normals(&self, own: V3<f64>, n: V3<f64>, of_b: u8) -> [V3<f64>; 2] {
        let of_a = self.a.feature_at(Scalar, own);
        let first = self.b.in_normal_cone(Scalar, of_b, n);
        let inward = scaled::<Scalar, f64>(apply_transposed::<Scalar, f64>(&self.rotation, first), -1.0);
        let of_a_own = self.a.in_normal_cone(Scalar, of_a, inward);
        let second = scaled::<Scalar, f64>(apply::<Scalar, f64>(&self.rotation, of_a_own), -1.0);
        let lines = (self.a.line(Scalar, of_a), self.b.line(Scalar, of_b));
        if let (Some(a), Some(b)) = lines {
            let a = apply::<Scalar, f64>(&self.rotation, a);
            let across = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
            if dot::<Scalar, f64>(across, across) > CROSSED {
                let across = normalized(Scalar, across);
                let sign = 1_f64.copysign(dot::<Scalar, f64>(across, n));
                return [first, scaled::<Scalar, f64>(across, sign)];
            }
        }
        [first, second]
    }

    /// `n nᵀ + T K Tᵀ` in A's frame.
    #[inline(always)]
    fn hessian(&self, frame: &M3<f64>, k: [f64; 3]) -> [f64; 6] {
        let own = frame.map(|row| apply_transposed::<Scalar, f64>(&self.rotation, row));
        let [t0, t1, n] = own;
        let entry = |i: usize, j: usize| {
            n[i] * n[j] + k[0] * t0[i] * t0[j] + k[1] * (t0[i] * t1[j] + t1[i] * t0[j]) + k[2] * t1[i] * t1[j]
        };
        [entry(0, 0), entry(0, 1), entry(0, 2), entry(1, 1), entry(1, 2), entry(2, 2)]
    }
}
