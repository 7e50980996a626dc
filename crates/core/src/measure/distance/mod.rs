//! Euclidean distance between two bodies.

mod deepest;
mod search;

use crate::body::{Body, MAX_CONSTRAINTS, Solid};
use crate::measure::Status;
use crate::measure::bounds::duality_bounds::Multipliers;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::query_frame::Pair;
use crate::measure::frames::twist::Twist;
use crate::measure::options::Options;
use crate::measure::overlap::Goal;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::continuation::{Follow, Lost, Proven, SEEK_ROUNDS, Seek};
use crate::measure::solver::kkt_newton::Active;
use crate::measure::solver::two_point_problem::Apart;
use crate::measure::union;
use crate::measure::warm::{Hint, WarmStart};
use crate::polynomial::{Simd, WithSimd, dispatch};
use nalgebra::Vector3;
use search::Search;

/// Distance of two bodies with its proof, lengths in metres, vectors in the world frame.
#[derive(Clone, Copy, Debug)]
pub struct Distance {
    /// How the solve ended.
    pub status: Status,
    /// Proven lower bound; 0 when the bodies are not proven apart.
    pub lower: f64,
    /// Proven upper bound, attained by the witnesses; 0 on overlap.
    pub upper: f64,
    /// A point of the first body.
    pub witness_a: Vector3<f64>,
    /// A point of the second body; on overlap the same common point.
    pub witness_b: Vector3<f64>,
    /// Unit normal from the second body to the first; none on overlap.
    pub normal: Option<Vector3<f64>>,
    /// Constraints of the first body, or of its part, that the answer rests on, with multipliers:
    /// `-n = Σ λ_i ∇g_i`; none on overlap.
    pub active_a: ActiveConstraints,
    /// Constraints of the second body, or of its part, that the answer rests on: `n = Σ λ_i ∇g_i`;
    /// none on overlap.
    pub active_b: ActiveConstraints,
    /// Which part of each solid the answer is about: positions in [`Solid::parts`], 0 for single
    /// bodies.
    pub parts: [u16; 2],
    /// Whether another pair of parts may be as near, their brackets meeting: normal, witnesses and
    /// gradients may then jump. Never for single bodies, nor on overlap.
    pub tied: bool,
    /// Iterations of all methods together.
    pub iterations: u32,
}

impl Default for Distance {
    /// What is known of any two bodies: a place for an answer.
    fn default() -> Self {
        Self {
            status: Status::BracketWide,
            lower: 0.0,
            upper: f64::INFINITY,
            witness_a: Vector3::zeros(),
            witness_b: Vector3::zeros(),
            normal: None,
            active_a: ActiveConstraints::default(),
            active_b: ActiveConstraints::default(),
            parts: [0, 0],
            tied: false,
            iterations: 0,
        }
    }
}

impl Distance {
    /// The answer: the middle of the bracket.
    pub fn value(&self) -> f64 {
        0.5 * (self.lower + self.upper)
    }

    /// Upper bound of the distance of the convex hulls of the objects that the bodies `a` and `b`
    /// of this answer were fitted to, metres: the bodies contain them, so that `lower` is a bound
    /// of their distance as well, and reach at most their gaps ([`Body::gap_m`]) beyond. None where
    /// a gap is not known. Of solids with several parts, each the hull of its own piece.
    ///
    /// ```
    /// use nalgebra::Vector3;
    /// use sublevel_core::body::Body;
    /// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
    ///
    /// let ball = Body::ball("ball", Vector3::zeros(), 1.0)?.with_gap(0.25);
    /// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
    /// let origin = Pose::identity();
    /// let answer = distance(&ball, &origin, &ball, &apart, &Options::default(), &mut WarmStart::default());
    /// assert!((answer.hulls_upper(&ball, &ball).expect("both gaps are known") - 1.5).abs() < 1e-8);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn hulls_upper(&self, a: &impl Solid, b: &impl Solid) -> Option<f64> {
        let gap = |solid: &[Body], part: u16| solid.get(usize::from(part))?.gap_m();
        let gaps = (gap(a.parts(), self.parts[0])? + gap(b.parts(), self.parts[1])?).next_up();
        Some((self.upper + gaps).next_up())
    }

    /// Derivatives with respect to the twists of the first and of the second body at the poses the
    /// distance was asked for (envelope theorem: the witnesses count as fixed to their bodies), to
    /// 1e-6 of their norm at distances above the accuracy that was asked for. None unless the
    /// bodies are proven apart: at contact the distance has no gradient, which is what
    /// [`crate::measure::signed_distance`] is for.
    pub fn gradients(&self, pose_a: &Pose, pose_b: &Pose) -> Option<[Twist; 2]> {
        let n = self.normal.filter(|_| self.lower > 0.0)?;
        Some([
            Twist::of_force(n, &self.witness_a, pose_a.translation()),
            Twist::of_force(-n, &self.witness_b, pose_b.translation()),
        ])
    }
}

/// Distance of the bodies' middles relative to the sum of their sizes, above which they are far
/// apart.
const FAR: f64 = 2.0;

fn far_apart((a, pose_a): (&Body, &Pose), (b, pose_b): (&Body, &Pose)) -> bool {
    let (ball_a, ball_b) = (a.circumscribed(), b.circumscribed());
    let middles = (pose_a.transform_point(&ball_a.center), pose_b.transform_point(&ball_b.center));
    (middles.0 - middles.1).norm() > FAR * (ball_a.radius + ball_b.radius)
}

/// Euclidean distance between solid `a` at `pose_a` and solid `b` at `pose_b` (body to world), 0
/// when they touch or overlap; of solids with several parts, that of their closest parts.
///
/// The bracket is as narrow as `options` ask, or the status says that it is not. Newton's method
/// finds the points with opposite normals along their difference: on from the last answer if `warm`
/// has one, else from where samples of both surfaces face each other. Where that fails an
/// interior-point method minimises ½|x - y|²; near contact, where that loses its curvature, the
/// point deepest in both bodies decides between overlap and a gap. `warm` is read and then replaced
/// by the hint for the next query of this pair.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = distance(&crate_, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((answer.value() - 1.5).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    union::distance(a, pose_a, b, pose_b, &Goal::NARROW, options, warm)
}

/// Distance of two bodies, or as much of it as the goal needs.
pub(super) fn between(
    of_a: (&Body, &Pose),
    of_b: (&Body, &Pose),
    goal: &Goal,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    let query = Query { of_a, of_b, goal, options };
    match warm.hint {
        Hint::Smooth(_) => dispatch(Warm { query, warm }),
        Hint::Overlap { point_a } => query.overlapping(&point_a, warm),
        _ => query.afresh(&Lost::after(0), warm),
    }
}

/// What is asked. Each way to the answer hands on to the next where it fails, and none hands back:
/// an answer is written where the caller wants it, and not copied, for loads of what was just
/// stored in other pieces have to wait.
#[derive(Clone, Copy)]
struct Query<'a> {
    of_a: (&'a Body, &'a Pose),
    of_b: (&'a Body, &'a Pose),
    goal: &'a Goal,
    options: &'a Options<'a>,
}

impl<'a> Query<'a> {
    #[inline(always)]
    fn relation(&self) -> Apart<'a> {
        let ((a, pose_a), (b, pose_b)) = (self.of_a, self.of_b);
        let tolerance = self.options.accuracy() * a.circumscribed().radius.min(b.circumscribed().radius);
        Apart { pose_a, pose_b, goal: self.goal, tolerance }
    }

    fn pair(&self) -> Pair<'a> {
        let ((a, pose_a), (b, pose_b)) = (self.of_a, self.of_b);
        Pair::new(a, pose_a, b, pose_b)
    }

    /// From a point of A in its frame that both bodies had in common.
    #[inline(never)]
    fn overlapping(&self, point_a: &Vector3<f64>, warm: &mut WarmStart) -> Distance {
        let pair = self.pair();
        let mut search = Search::new(&pair, self.goal, self.options, 0);
        if search.common(&pair.a_to_query(point_a)) {
            return search.answer();
        }
        self.afresh(&Lost::after(0), warm)
    }

    /// From nothing but the poses, after what continuation has left.
    #[inline(never)]
    fn afresh(&self, lost: &Lost, warm: &mut WarmStart) -> Distance {
        // Where edges face each other no single constraint is to be followed.
        let smooth = self.of_a.0.is_smooth() && self.of_b.0.is_smooth();
        // From far away it does other than lanes, which bring no points back that have come too far
        // from the bodies.
        let astray = matches!(warm.hint, Hint::Astray) && !far_apart(self.of_a, self.of_b);
        if smooth && !astray && !lost.touching() && !self.options.exhausted(lost.rounds) {
            return dispatch(Cold { query: *self, before: lost.rounds, warm });
        }
        self.search(lost, warm)
    }

    /// By all that there is.
    #[inline(never)]
    fn search(&self, lost: &Lost, warm: &mut WarmStart) -> Distance {
        let pair = self.pair();
        let mut search = Search::new(&pair, self.goal, self.options, lost.rounds);
        search.take_over(lost);
        if !search.decided() {
            search.run(&warm.hint);
        }
        *warm = search.hint();
        search.answer()
    }

    /// The answer that a proof gives, sharpened if rounding keeps it wide.
    #[inline(always)]
    fn answer<S: Simd>(&self, simd: S, proven: &Proven, tolerance: f64) -> Distance {
        let narrow = proven.upper - proven.lower <= tolerance;
        if !narrow && !self.goal.met(proven.lower, proven.upper) {
            return self.sharpened(proven);
        }
        let (a, pose_a) = self.of_a;
        let [witness_a, witness_b, normal] = proven.world(simd, a, pose_a);
        Distance {
            status: if narrow { Status::Converged } else { Status::BracketWide },
            lower: proven.lower,
            upper: proven.upper,
            witness_a,
            witness_b,
            normal: Some(normal),
            active_a: ActiveConstraints::single(proven.active[0], proven.multipliers[0]),
            active_b: ActiveConstraints::single(proven.active[1], proven.multipliers[1]),
            parts: [0, 0],
            tied: false,
            iterations: proven.rounds,
        }
    }

    /// A proven answer that rounding keeps wide, gone on with in twice the precision.
    #[cold]
    fn sharpened(&self, proven: &Proven) -> Distance {
        let pair = self.pair();
        let mut search = Search::new(&pair, self.goal, self.options, proven.rounds);
        search.resume(proven);
        search.sharpen();
        search.attain_any();
        search.answer()
    }
}

/// Continuation from a smooth hint, as vectorized work.
struct Warm<'a> {
    query: Query<'a>,
    warm: &'a mut WarmStart,
}

impl WithSimd for Warm<'_> {
    type Output = Distance;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Distance {
        let Self { query, warm } = self;
        let relation = query.relation();
        let lost = match &mut warm.hint {
            Hint::Smooth(trace) => {
                let (a, b) = (query.of_a.0, query.of_b.0);
                match (Follow { a, b, relation, options: query.options, trace }).with_simd(simd) {
                    Ok(proven) => return query.answer(simd, &proven, relation.tolerance),
                    Err(lost) => lost,
                }
            }
            // Nothing to follow.
            _ => Lost::after(0),
        };
        query.afresh(&lost, warm)
    }
}

/// A start from nothing but the poses, as vectorized work.
struct Cold<'a> {
    query: Query<'a>,
    /// Evaluations before it.
    before: u32,
    warm: &'a mut WarmStart,
}

impl WithSimd for Cold<'_> {
    type Output = Distance;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Distance {
        let Self { query, before, warm } = self;
        let (a, b, options, relation) = (query.of_a.0, query.of_b.0, query.options, query.relation());
        let most = SEEK_ROUNDS.min(options.max_iterations() - before);
        match (Seek { a, b, relation, from: None, most, options }).with_simd(simd) {
            Ok((proven, trace)) => {
                *warm = Hint::Smooth(trace).into();
                let proven = Proven { rounds: before + proven.rounds, ..proven };
                query.answer(simd, &proven, relation.tolerance)
            }
            Err(lost) => query.search(&Lost { rounds: before + lost.rounds, ..lost }, warm),
        }
    }
}

/// The point of B nearest to A in the query frame and the constraints that are active there; on
/// overlap a common point, and none.
pub(super) fn nearest(
    pair: &Pair<'_>,
    options: &Options<'_>,
    iterations: &mut u32,
) -> (Vector3<f64>, Option<(Active, Active)>) {
    let mut search = Search::new(pair, &Goal::NARROW, options, *iterations);
    search.run(&Hint::Cold);
    *iterations = search.iterations();
    search.nearest()
}

/// Splits the multipliers of a program's rows into those of A and of B, times `factor`.
pub(super) fn split(pair: &Pair<'_>, rows: &[f64], factor: f64) -> (Multipliers, Multipliers) {
    let (mut of_a, mut of_b) = ([0.0; MAX_CONSTRAINTS], [0.0; MAX_CONSTRAINTS]);
    let (first, second) = rows.split_at(pair.a.len());
    for (to, from) in of_a.iter_mut().zip(first).chain(of_b.iter_mut().zip(second)) {
        *to = from * factor;
    }
    (of_a, of_b)
}
