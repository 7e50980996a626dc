//! What relates the points of two bodies at the solution of a measure, and what proves it: the part
//! of continuation in which the measures of pairs differ.

use crate::body::Body;
use crate::measure::bounds::separation::Separation;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{M3, V3, add, add_scaled, dot, subtract};
use crate::measure::solver::initial_guess::{Start, facing, meeting};
use crate::measure::solver::stages::{Stage, runs};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{
    ALIGNED, Bracket, Plane, Relative, Response, Step, SurfaceCurvature, newton,
};
use crate::polynomial::Simd;

/// A measure of two bodies that is attained by a point x of A and a point y of B with opposite
/// normals.
pub(in crate::measure) trait Relation: Copy {
    /// Where B stands as seen from A.
    fn relative<S: Simd>(&self, simd: S, a: &Body, b: &Body) -> Relative<f64>;

    /// Where to start from nothing but the poses, and where the outlines of A and of B keep that.
    fn start<S: Simd>(&self, simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> (Start<f64>, [f64; 2]);

    /// Whether a common point is an answer, so that an overlap ends the search.
    #[inline(always)]
    fn ends_at_contact(&self) -> bool {
        false
    }

    /// Whether a bracket is likely to suffice though it is only about as narrow as `width`, around
    /// a distance of the points along the normal; metres.
    #[inline(always)]
    fn decided_by(&self, _distance: f64, _width: f64) -> bool {
        false
    }

    /// A lower bound of the measure by planes across n, where that is all that is asked for. n
    /// points from B to A in A's frame; along it the bodies seem to be `height` metres apart.
    #[inline(always)]
    fn parted(&self, _: (&Body, &Body), _: &Relative<f64>, _n: V3<f64>, _height: f64) -> Option<f64> {
        None
    }

    /// Newton's step from points with `difference = x - y` in the frame, whose third vector is the
    /// normal from B to A: towards points with their difference along the normal; and how the
    /// solution answers motions. `smallest`: see [`newton`].
    #[inline(always)]
    fn newton<S: Simd>(
        &self,
        simd: S,
        a: (&Plane<f64>, &SurfaceCurvature<f64>),
        b: (&Plane<f64>, &SurfaceCurvature<f64>),
        _frame: &M3<f64>,
        difference: V3<f64>,
        smallest: f64,
    ) -> (Step<f64>, Response<f64>) {
        newton(simd, a, b, difference, smallest)
    }

    /// How far points with `difference = x - y` in the frame are from what the relation requires,
    /// along the tangents.
    #[inline(always)]
    fn aside<S: Simd>(&self, _: S, _frame: &M3<f64>, difference: V3<f64>) -> [f64; 2] {
        [difference[0], difference[1]]
    }

    /// What the bracket of the distance at points with `difference = x - y` in the frame says of
    /// the measure.
    fn judge<S: Simd>(&self, simd: S, found: &Bracket<f64>, frame: &M3<f64>, difference: V3<f64>) -> Verdict;
}

/// What a bracket is good for.
pub(in crate::measure) enum Verdict {
    /// Narrow enough.
    Proven {
        /// Lower bound of the measure.
        lower: f64,
        /// Upper bound of the measure.
        upper: f64,
    },
    /// Not yet.
    Wide,
    /// Probably an overlap, or too close to one to decide.
    Overlap,
}

/// The distance of bodies that are apart: x - y along the normal.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Apart<'a> {
    pub(in crate::measure) pose_a: &'a Pose,
    pub(in crate::measure) pose_b: &'a Pose,
    /// What the bracket has to decide, if that is less than being narrow.
    pub(in crate::measure) goal: &'a StopCriterion,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    /// Largest angle between the bodies' normals, radians, that an answer is taken at.
    pub(in crate::measure) angle: f64,
    /// From B to A, in A's frame, to start from; without one, across the gap of the ellipsoids that
    /// stand for the bodies.
    pub(in crate::measure) facing: Option<V3<f64>>,
}

impl Relation for Apart<'_> {
    #[inline(always)]
    fn relative<S: Simd>(&self, simd: S, a: &Body, b: &Body) -> Relative<f64> {
        Relative::new(simd, a, self.pose_a, b, self.pose_b)
    }

    #[inline(always)]
    fn start<S: Simd>(&self, simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> (Start<f64>, [f64; 2]) {
        let n = self.facing.unwrap_or_else(|| facing(simd, a, b, relative));
        meeting(simd, a, b, relative, n, None)
    }

    #[inline(always)]
    fn ends_at_contact(&self) -> bool {
        true
    }

    #[inline(always)]
    fn decided_by(&self, distance: f64, width: f64) -> bool {
        self.goal.met(distance - width, distance + width)
    }

    #[inline(always)]
    fn parted(&self, bodies: (&Body, &Body), relative: &Relative<f64>, n: V3<f64>, height: f64) -> Option<f64> {
        let far = self.goal.far;
        if height > far { parted_beyond(far, bodies, relative, n) } else { None }
    }

    #[inline(always)]
    fn judge<S: Simd>(&self, _: S, found: &Bracket<f64>, _: &M3<f64>, difference: V3<f64>) -> Verdict {
        // Below the rounding floor no bracket gets, however long Newton's method goes on.
        let narrow = found.upper - found.lower <= self.tolerance.max(4.0 * found.rounding);
        let enough = narrow && found.off <= self.angle || self.goal.met(found.lower, found.upper);
        // A bound that is not a number proves nothing.
        if enough && found.lower > 0.0 && found.upper.is_finite() {
            Verdict::Proven { lower: found.lower, upper: found.upper }
        } else if difference[2] <= 0.0 {
            Verdict::Overlap
        } else {
            Verdict::Wide
        }
    }
}

/// A lower bound of the distance by planes across n, if it is above `far` metres.
// Compiled once, and not with each search that asks.
#[inline(never)]
fn parted_beyond(far: f64, (a, b): (&Body, &Body), relative: &Relative<f64>, n: V3<f64>) -> Option<f64> {
    if !runs(Stage::Planes) {
        return None;
    }
    let lower = Separation::seen(a, b, relative).along(&n.into());
    (lower > far).then_some(lower)
}

/// The signed distance near a direction: x - y along the normal, one way or the other, so that
/// Newton's method passes through contact without noticing.
///
/// The lower bound is one of the signed distance, for a plane across any n shows at least
/// `-h_A(-n) - h_B(n)` of it; it is taken as proven where the points attain it, so that no normal
/// nearby shows more. The upper bound is that of the distance.
#[derive(Clone, Copy)]
pub(in crate::measure) struct Through<'a> {
    pub(in crate::measure) pose_a: &'a Pose,
    pub(in crate::measure) pose_b: &'a Pose,
    /// From B to A, in A's frame, to start from; without one, across the gap of the ellipsoids that
    /// stand for the bodies.
    pub(in crate::measure) facing: Option<V3<f64>>,
    /// How far from attained the lower bound may be, metres.
    pub(in crate::measure) tolerance: f64,
}

impl Relation for Through<'_> {
    #[inline(always)]
    fn relative<S: Simd>(&self, simd: S, a: &Body, b: &Body) -> Relative<f64> {
        Relative::new(simd, a, self.pose_a, b, self.pose_b)
    }

    #[inline(always)]
    fn start<S: Simd>(&self, simd: S, a: &Body, b: &Body, relative: &Relative<f64>) -> (Start<f64>, [f64; 2]) {
        let n = self.facing.unwrap_or_else(|| facing(simd, a, b, relative));
        meeting(simd, a, b, relative, n, None)
    }

    #[inline(always)]
    fn judge<S: Simd>(&self, _: S, found: &Bracket<f64>, _: &M3<f64>, difference: V3<f64>) -> Verdict {
        let enough = self.tolerance.max(4.0 * found.rounding);
        let between = subtract::<S, f64>(add::<S, f64>(difference, found.to_a), found.to_b);
        let attained = dot::<S, f64>(found.normal, between);
        let sideways = add_scaled::<S, f64>(between, -attained, found.normal);
        let close = attained - found.lower <= enough && dot::<S, f64>(sideways, sideways) <= enough * enough;
        let narrow = found.upper - found.lower <= enough;
        if (narrow || close) && found.off <= ALIGNED && found.upper.is_finite() {
            Verdict::Proven { lower: found.lower, upper: found.upper }
        } else {
            Verdict::Wide
        }
    }
}
