//! The distance of two bodies of several constraints, inside a proven bracket; see [`super`].

use super::aggregate::{Evaluated, Weighted};
use super::linearized::Linearized;
use super::quadratic_program::{Checked, OnActive, check, minimize};
use super::share_inside::share_inside;
use super::spot::Spot;
use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{
    M3, V3, add, add_scaled, apply, apply_symmetric, apply_transposed, basis, dot, scaled, subtract,
};
use crate::measure::options::Options;
use crate::measure::solver::active_constraints::ActiveConstraints;
use crate::measure::solver::active_set_qp::MAX_CHANGES;
use crate::measure::solver::common_point::CommonPoint;
use crate::measure::solver::continuation::{Lost, limits, worth_a_bracket};
use crate::measure::solver::initial_guess::Start;
use crate::measure::solver::predictor::Drift;
use crate::measure::solver::prospect::Prospect;
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::solver::tangent_newton::{
    ALIGNED_AT_EDGES, Bracket, LONGEST_MOVE, Relative, SEEK_ROUNDS, Side, Step, TAYLOR_ROUNDING, bracket, moved,
};
use crate::measure::solver::two_point_problem::{Apart, Relation, Verdict};
use crate::polynomial::{Simd, WithSimd};
use nalgebra::Vector3;

/// How much a linearized constraint may be violated, relative to the body's size. Larger, points
/// have to be moved farther into their body, which widens brackets; smaller, rounding changes the
/// active set. `cut_bodies_agree_with_the_general_search` counts what is solved.
pub(super) const VIOLATED: f64 = 1e-13;

/// Curvature times size, dimensionless, that is added where there is none: far below what any body
/// has, and far more than rounding leaves of that of a flat side, so that a program with no other
/// curvature leads along the side to its end. It changes time only; no test pins it.
pub(super) const FLATTEST: f64 = 1e-10;

/// Least distance of the points that a step is made for, relative to the smaller body: nearer, the
/// turn of their difference is lost in rounding. Double-double arithmetic goes on from there, so
/// that it changes time only; no test pins it.
const LEAST_DISTANCE: f64 = 1e-8;

/// What is kept of an answer for the next query of the pair.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct EdgeTrace {
    of_a: Spot,
    of_b: Spot,
    /// Unit normal from B to A, A's frame.
    n: V3<f64>,
    /// What the last prediction missed of the witnesses, each in its body's frame, and of n.
    drift: Drift<3>,
}

impl EdgeTrace {
    /// Witnesses of A and of B, each in its body's frame, from the centre of its normalization on,
    /// metres.
    pub(in crate::measure) fn points(&self) -> [V3<f64>; 2] {
        [self.of_a.point, self.of_b.point]
    }

    /// Unit normal from B to A, in A's frame.
    pub(in crate::measure) fn normal_a(&self) -> Vector3<f64> {
        self.n.into()
    }
}

/// A proven bracket, metres, and where it is attained.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct EdgeProven {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    /// Point of A from the centre of its normalization on, A's frame, metres.
    pub(in crate::measure) x: V3<f64>,
    /// Point of B, from there on, A's frame.
    pub(in crate::measure) y: V3<f64>,
    /// Unit normal from B to A, A's frame.
    pub(in crate::measure) n: V3<f64>,
    pub(in crate::measure) active_a: ActiveConstraints,
    pub(in crate::measure) active_b: ActiveConstraints,
    /// Evaluations of both bodies.
    pub(in crate::measure) rounds: u32,
}

/// The distance of two bodies that are apart.
pub(in crate::measure) struct EdgeQuery<'a> {
    pub(in crate::measure) a: &'a Body,
    pub(in crate::measure) pose_a: &'a Pose,
    pub(in crate::measure) b: &'a Body,
    pub(in crate::measure) pose_b: &'a Pose,
    pub(in crate::measure) goal: &'a StopCriterion,
    /// Width of the bracket that is narrow enough, metres.
    pub(in crate::measure) tolerance: f64,
    pub(in crate::measure) options: &'a Options<'a>,
    /// Where to start; else where the outlines are nearest.
    pub(in crate::measure) start: Option<EdgeStart>,
    /// Replaced by that of the answer where it is proven.
    pub(in crate::measure) trace: &'a mut EdgeTrace,
}

/// Where Newton's method for two bodies starts.
#[derive(Clone, Copy)]
pub(in crate::measure) enum EdgeStart {
    /// From the answer before, which the trace is of.
    Last,
    /// From about the nearest points.
    Witnesses(Start<f64>),
}

/// Trial points in the query frame, the basis whose third vector is the trial normal, and the
/// multipliers of the active constraints of A and of B, metres.
struct Iterate {
    x: V3<f64>,
    y: V3<f64>,
    frame: M3<f64>,
    active: [Weighted; 2],
}

/// A step and the multipliers of where it leads.
struct Found {
    step: Step<f64>,
    active: [Weighted; 2],
}

impl WithSimd for EdgeQuery<'_> {
    /// The proven answer, or what is left.
    type Output = Result<EdgeProven, Lost>;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Self::Output {
        let Self { a, pose_a, b, pose_b, goal, tolerance, options, start, trace } = self;
        let relation = Apart { pose_a, pose_b, goal, tolerance, angle: ALIGNED_AT_EDGES, facing: None };
        let relative = relation.relative(simd, a, b);
        let sides = (Side::at_home(simd, a, 0), Side::away(simd, b, 0, &relative));
        let solver = Solver { sides, relation, options, limits: limits(a, b) };
        let mut rounds = 0;
        let mut following = match start {
            Some(EdgeStart::Last) => solver.follow(simd, &relative, trace),
            _ => None,
        };
        // From the last answer, and if that fails from the poses alone.
        loop {
            let (at, predicted) = match following.take() {
                Some((at, predicted)) => (at, Some(predicted)),
                None => {
                    let start = match start {
                        Some(EdgeStart::Witnesses(start)) => start,
                        _ => relation.start(simd, a, b, &relative).0,
                    };
                    let height = dot::<S, f64>(start.n, subtract::<S, f64>(start.x, start.y));
                    if let Some(lower) = relation.parted((a, b), &relative, start.n, height) {
                        return Err(Lost::parted(lower, rounds));
                    }
                    if height < 0.0 {
                        let common = CommonPoint::between(simd, (&solver.sides.0, &solver.sides.1), start.x, start.y);
                        if common.is_some() {
                            return Err(Lost { common, ..Lost::after(rounds + 1) });
                        }
                    }
                    let active = [Weighted::default(); 2];
                    (Iterate { x: start.x, y: start.y, frame: basis(simd, start.n), active }, None)
                }
            };
            match solver.run(simd, &relative, at, (&mut rounds, trace)) {
                Ok(proven) => {
                    let Some([x, own_y, n]) = predicted else {
                        trace.drift = Drift::default();
                        return Ok(proven);
                    };
                    let from_b = subtract::<S, f64>(proven.y, relative.origin);
                    let missed = [
                        subtract::<S, f64>(proven.x, x),
                        subtract::<S, f64>(apply_transposed::<S, f64>(&relative.rotation, from_b), own_y),
                        subtract::<S, f64>(proven.n, n),
                    ];
                    trace.drift.update(simd, missed);
                    return Ok(proven);
                }
                Err(lost) if lost.common.is_some() || lost.parted.is_some() || predicted.is_none() => return Err(lost),
                Err(_) => {}
            }
        }
    }
}

struct Solver<'a> {
    sides: (Side<'a, f64>, Side<'a, f64>),
    relation: Apart<'a>,
    options: &'a Options<'a>,
    /// Longest moves of x and of y, metres.
    limits: [f64; 2],
}

impl Solver<'_> {
    /// From the last answer: the step for the poses as they are now, without an evaluation, and
    /// what it missed last time on top. Also what it led to, without that: x, y in B's frame, n.
    #[inline(always)]
    fn follow<S: Simd>(&self, simd: S, relative: &Relative<f64>, trace: &EdgeTrace) -> Option<(Iterate, [V3<f64>; 3])> {
        let (side_a, side_b) = &self.sides;
        let EdgeTrace { of_a, of_b, n, drift } = trace;
        let y = add::<S, f64>(apply::<S, f64>(&relative.rotation, of_b.point), relative.origin);
        let frame = basis(simd, *n);
        let (local_a, local_b) = (side_a.localize(simd, &frame), side_b.localize(simd, &frame));
        let (mut linear_a, mut linear_b) = (Linearized::none(), Linearized::none());
        linear_a.fill(simd, of_a.iter(), (&of_a.active, &of_a.hessian), &local_a);
        linear_b.fill(simd, of_b.iter(), (&of_b.active, &of_b.hessian), &local_b);
        let difference = apply::<S, f64>(&frame, subtract::<S, f64>(of_a.point, y));
        let Found { step, active } = self.step(simd, &linear_a, &linear_b, (difference, LEAST_DISTANCE))?;
        if !step.within(simd, self.limits) {
            return None;
        }
        let x = moved::<S, f64>(of_a.point, step.dx, &frame);
        let y = moved::<S, f64>(y, step.dy, &frame);
        let n = moved::<S, f64>(*n, [step.dn[0], step.dn[1], 0.0], &frame);
        let own_y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(y, relative.origin));
        let [of_x, of_y, of_n] = drift.expected();
        let at = Iterate {
            x: add::<S, f64>(x, of_x),
            y: add::<S, f64>(y, apply::<S, f64>(&relative.rotation, of_y)),
            frame: basis(simd, add::<S, f64>(n, of_n)),
            active,
        };
        Some((at, [x, own_y, n]))
    }

    /// Newton's method until the bracket is narrow, which the trace is then of.
    ///
    /// # Errors
    /// What is left.
    // There is no allocation in a solve.
    #[allow(clippy::result_large_err)]
    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        relative: &Relative<f64>,
        mut at: Iterate,
        (rounds, trace): (&mut u32, &mut EdgeTrace),
    ) -> Result<EdgeProven, Lost> {
        let (side_a, side_b) = &self.sides;
        let mut contacts = 0;
        let (mut of_a, mut of_b) = (Evaluated::none(), Evaluated::none());
        let (mut linear_a, mut linear_b) = (Linearized::none(), Linearized::none());
        for _ in 0..SEEK_ROUNDS {
            if self.options.exhausted(*rounds) {
                return Err(Lost::after(*rounds));
            }
            *rounds += 1;
            let inside_a = of_a.fill(simd, side_a, at.x);
            let inside_b = of_b.fill(simd, side_b, at.y);
            if !(inside_a && inside_b) {
                let near = (of_a.brought_near(simd, side_a, at.x), of_b.brought_near(simd, side_b, at.y));
                let (Some(x), Some(y)) = near else { return Err(Lost::after(*rounds)) };
                (at.x, at.y) = (x, y);
                continue;
            }
            let (local_a, local_b) = (side_a.localize(simd, &at.frame), side_b.localize(simd, &at.frame));
            let difference = apply::<S, f64>(&at.frame, subtract::<S, f64>(at.x, at.y));
            for (active, (evaluated, local)) in at.active.iter_mut().zip([(&of_a, &local_a), (&of_b, &local_b)]) {
                if active.len == 0 {
                    *active = Weighted::highest(simd, evaluated, local);
                }
            }
            let [active_a, active_b] = &at.active;
            let (bent_a, bent_b) = (active_a.sum(simd, &of_a).hessian, active_b.sum(simd, &of_b).hessian);
            linear_a.fill(simd, of_a.iter(), (active_a, &bent_a), &local_a);
            linear_b.fill(simd, of_b.iter(), (active_b, &bent_b), &local_b);
            let Some(mut found) = self.step_near_contact(simd, &linear_a, &linear_b, difference) else {
                return Err(Lost::after(*rounds));
            };
            let prospect = Prospect::new(simd, &self.relation, &found.step, difference[2], self.limits);
            if prospect == Prospect::Common {
                let x = moved::<S, f64>(at.x, found.step.dx, &at.frame);
                let y = moved::<S, f64>(at.y, found.step.dy, &at.frame);
                let common = CommonPoint::proven_between(simd, (side_a, side_b), x, y);
                if common.is_some() {
                    return Err(Lost { common, ..Lost::after(*rounds) });
                }
            }
            // With the weights of several constraints a proof costs more than an evaluation.
            let longest = worth_a_bracket(self.limits).map(|limit| 0.1 * limit);
            let near = found.step.within(simd, longest);
            if prospect == Prospect::Decided && !near {
                let Step { dx, dy, dn } = found.step;
                let n = moved::<S, f64>(at.frame[2], [dn[0], dn[1], 0.0], &at.frame);
                let height = difference[2] + dx[2] - dy[2];
                let bodies = (side_a.body(), side_b.body());
                if let Some(lower) = self.relation.parted(bodies, relative, n, height) {
                    return Err(Lost::parted(lower, *rounds));
                }
            }
            if prospect == Prospect::Decided || near {
                let evaluated = [(&of_a, &local_a), (&of_b, &local_b)];
                match self.prove(simd, relative, &at, &found, (evaluated, difference), trace) {
                    Ok(proven) => return Ok(EdgeProven { rounds: *rounds, ..proven }),
                    Err(touching) => contacts += u32::from(touching),
                }
                // The bodies seem to overlap: the general search finds their deepest point.
                if contacts == 3 {
                    return Err(Lost::after(*rounds));
                }
            }
            let step = &mut found.step;
            let of_x = side_a.relative_square(simd, &local_a, step.dx);
            let length = of_x.max(side_b.relative_square(simd, &local_b, step.dy)).sqrt();
            if !length.is_finite() {
                return Err(Lost::after(*rounds));
            }
            if length > LONGEST_MOVE {
                step.shorten(LONGEST_MOVE / length);
            }
            at.x = moved::<S, f64>(at.x, step.dx, &at.frame);
            at.y = moved::<S, f64>(at.y, step.dy, &at.frame);
            at.frame = basis(simd, moved::<S, f64>(at.frame[2], [step.dn[0], step.dn[1], 0.0], &at.frame));
            at.active = found.active;
        }
        Err(Lost::after(*rounds))
    }

    /// Newton's step from points with `difference = x - y` in the basis, or where it fails one for
    /// a distance of a twentieth of the smaller body, which turns the normal by less.
    #[inline(always)]
    fn step_near_contact<S: Simd>(
        &self,
        simd: S,
        a: &Linearized,
        b: &Linearized,
        difference: V3<f64>,
    ) -> Option<Found> {
        for least in [LEAST_DISTANCE, 0.05] {
            if let Some(found) = self.step(simd, a, b, (difference, least)) {
                return Some(found);
            }
        }
        None
    }

    /// Newton's step from points with `difference = x - y` in the basis, for a distance of at least
    /// so much, relative to the smaller body; none if the quadratic programs have no minimiser.
    #[inline(always)]
    fn step<S: Simd>(
        &self,
        simd: S,
        a: &Linearized,
        b: &Linearized,
        (difference, least): (V3<f64>, f64),
    ) -> Option<Found> {
        let [size_a, size_b] = self.limits;
        let least = least * size_a.min(size_b);
        let mut distance = (difference[2] + a.shift() - b.shift()).max(least);
        let tau = [difference[0], difference[1]];
        let (mut active_a, mut active_b) = (a.active, b.active);
        for exchange in 1..=MAX_CHANGES {
            let inverse = 1.0 / distance;
            // B's program times D: min ½ |τ + α - β|² - D n·dy + ½ D dyᵀ H dy.
            let mut hessian_b = b.hessian.map(|entry| entry * distance);
            hessian_b[0] += 1.0;
            hessian_b[3] += 1.0;
            let of_b = (VIOLATED * size_b, FLATTEST / size_b * distance);
            let follows = OnActive::new(simd, &hessian_b, b.rows(), &active_b, of_b.1)?;
            let y_at_rest = follows.minimizer(simd, &hessian_b, [-tau[0], -tau[1], -distance]);
            let s = &follows.compliance;
            let k = [(1.0 - s[0]) * inverse, -s[1] * inverse, (1.0 - s[3]) * inverse];
            let mut hessian_a = a.hessian;
            hessian_a[0] += k[0];
            hessian_a[1] += k[1];
            hessian_a[3] += k[2];
            let pull = [(tau[0] - y_at_rest[0]) * inverse, (tau[1] - y_at_rest[1]) * inverse, 1.0];
            // B's freedom to follow takes from the curvature of the distance, and rounds: none may
            // be left below 0.
            let of_a = (VIOLATED * size_a, FLATTEST / size_a + 8.0 * f64::EPSILON * inverse);
            let found = minimize(simd, (&hessian_a, pull), a.rows(), active_a, of_a)?;
            let dx = found.step;
            active_a = found.active;
            let moved = [dx[0], dx[1], 0.0];
            let dy = add::<S, f64>(y_at_rest, apply_symmetric::<S, f64>(s, moved));
            let apart = [tau[0] + dx[0], tau[1] + dx[1]];
            let of_dy = (&hessian_b, [-apart[0], -apart[1], -distance]);
            // How far apart they are then.
            let next = (difference[2] + dx[2] - dy[2]).max(least);
            // What the normal turns is in proportion to the inverse of the distance.
            let unlike = (next - distance).abs() > 0.1 * next.max(distance);
            if unlike && next > least && exchange <= 3 {
                distance = next;
                continue;
            }
            let allowed = (of_b.0, distance.max(size_b));
            if let Checked::Minimum(multipliers) = check(simd, of_dy, b.rows(), &mut active_b, dy, allowed)? {
                let dn = [(apart[0] - dy[0]) * inverse, (apart[1] - dy[1]) * inverse];
                let of_b = multipliers.map(|multiplier| multiplier * inverse);
                let active = [a.weighted(&active_a, found.multipliers), b.weighted(&active_b, of_b)];
                return Some(Found { step: Step { dx, dy, dn }, active });
            }
        }
        None
    }

    /// The answer where the step leads, which the trace is then of.
    ///
    /// # Errors
    /// There is none; whether that is because the bodies seem to touch.
    // There is no allocation in a solve.
    #[allow(clippy::result_large_err)]
    #[inline(always)]
    fn prove<S: Simd>(
        &self,
        simd: S,
        relative: &Relative<f64>,
        at: &Iterate,
        found: &Found,
        ([(of_a, local_a), (of_b, local_b)], difference): ([(&Evaluated, &M3<f64>); 2], V3<f64>),
        trace: &mut EdgeTrace,
    ) -> Result<EdgeProven, bool> {
        let (side_a, side_b) = &self.sides;
        let (a, b) = (side_a.body(), side_b.body());
        let Step { dx, dy, .. } = found.step;
        let (Some(weighted_a), Some(weighted_b)) = (found.active[0].normalized(), found.active[1].normalized()) else {
            return Err(false);
        };
        let (Some(trust_a), Some(trust_b)) = (weighted_a.trust(simd, a, of_a), weighted_b.trust(simd, b, of_b)) else {
            return Err(false);
        };
        let (sum_a, sum_b) = (side_a.with_trust(&trust_a), side_b.with_trust(&trust_b));
        let next_a = sum_a.extrapolate(simd, &weighted_a.sum(simd, of_a), local_a, dx);
        let next_b = sum_b.extrapolate(simd, &weighted_b.sum(simd, of_b), local_b, dy);
        let next = subtract::<S, f64>(add::<S, f64>(difference, dx), dy);
        let proven = bracket(simd, (&sum_a, &next_a), (&sum_b, &next_b), next);
        let (delta_a, delta_b) = (apply_transposed::<S, f64>(local_a, dx), apply_transposed::<S, f64>(local_b, dy));
        let shares = (share_inside(simd, a, of_a, (delta_a, dx)), share_inside(simd, b, of_b, (delta_b, dy)));
        let (Some(share_a), Some(share_b)) = shares else { return Err(false) };
        let x = moved::<S, f64>(at.x, dx, &at.frame);
        let y = moved::<S, f64>(at.y, dy, &at.frame);
        let home = |body: &Body| (body.interior_point() - body.normalization().center).into();
        let interior_b = add::<S, f64>(apply::<S, f64>(&relative.rotation, home(b)), relative.origin);
        let inward_a = scaled::<S, f64>(subtract::<S, f64>(home(a), x), share_a);
        let inward_b = scaled::<S, f64>(subtract::<S, f64>(interior_b, y), share_b);
        let inward = apply::<S, f64>(&at.frame, subtract::<S, f64>(inward_a, inward_b));
        let between = add::<S, f64>(next, inward);
        let displaced = (side_a.displacement + side_b.displacement) * (1.0 + 1e-14);
        let size = difference[0].abs() + difference[1].abs() + difference[2].abs();
        let rounding = TAYLOR_ROUNDING * (size + a.trust().span * share_a + b.trust().span * share_b);
        let upper = dot::<S, f64>(between, between).sqrt() * (1.0 + TAYLOR_ROUNDING) + displaced + rounding;
        let off = proven.off.max(tangent_of_angle(simd, proven.normal, between));
        let (lower, upper) = match self.relation.judge(simd, &Bracket { upper, off, ..proven }, &at.frame, next) {
            Verdict::Proven { lower, upper } => (lower, upper),
            Verdict::Wide => return Err(false),
            Verdict::Overlap => return Err(true),
        };
        let (x, y) = (add::<S, f64>(x, inward_a), add::<S, f64>(y, inward_b));
        let n = apply_transposed::<S, f64>(&at.frame, proven.normal);
        let own_y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(y, relative.origin));
        let [multiplier_a, multiplier_b] = proven.multipliers;
        let (active_a, active_b) = (weighted_a.times(multiplier_a), weighted_b.times(multiplier_b));
        trace.of_a = Spot::new(simd, x, active_a, (of_a, delta_a));
        trace.of_b = Spot::new(simd, own_y, active_b, (of_b, delta_b));
        trace.n = n;
        let (active_a, active_b) = (active_a.reported(), active_b.reported());
        Ok(EdgeProven { lower, upper, x, y, n, active_a, active_b, rounds: 0 })
    }
}

/// The tangent of the angle between a unit normal and the way between two points. At edges and
/// corners normals of both bodies may agree and yet be off it.
#[inline(always)]
pub(super) fn tangent_of_angle<S: Simd>(_: S, normal: V3<f64>, between: V3<f64>) -> f64 {
    let along = dot::<S, f64>(normal, between);
    let sideways = add_scaled::<S, f64>(between, -along, normal);
    dot::<S, f64>(sideways, sideways).sqrt() / along
}
