//! Measures by continuation: from the last answer of a pair along its motion, where one constraint
//! of each body is active.
//!
//! What a hint keeps of the last answer is where it was attained, with the normal there, each
//! body's part in its own frame, where it stays true however the bodies move, and how the solution
//! answers motions to first order. So the first step at new poses needs no evaluation. Along a
//! smooth trajectory what that step misses changes slowly; it is foreseen and added on. One
//! evaluation then mostly proves the answer or leaves one more step to it.

use crate::body::Body;
use crate::measure::frames::pose::Pose;
use crate::measure::frames::vector::{M3, V3, add, add_scaled, apply, apply_transposed, basis, dot, rows, subtract};
use crate::measure::options::Options;
use crate::measure::solver::common_point::CommonPoint;
use crate::measure::solver::initial_guess::Start;
use crate::measure::solver::predictor::Drift;
use crate::measure::solver::prospect::Prospect;
use crate::measure::solver::step_acceleration::{Correction, Last, Series};
use crate::measure::solver::tangent_newton::{
    ALIGNED, Bracket, FLATTEST, LONGEST_MOVE, NEAR, PATIENCE, Plane, Relative, Response, SETTLED, Side, Step,
    SurfaceCurvature, bracket, moved, newton,
};
use crate::measure::solver::two_point_problem::{Relation, Verdict};
use crate::polynomial::{Scalar, Simd, WithSimd};
use nalgebra::Vector3;

/// What is kept of an answer for the next query of the pair. Points from the centres of the bodies'
/// normalizations on, metres.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::measure) struct Trace {
    /// Active constraint of A and of B.
    active: [u8; 2],
    /// Point of A and normal from B to A, in A's frame.
    of_a: Spot,
    /// Point of B and the same normal, in B's frame.
    of_b: Spot,
    /// Vectors across the normal in A's frame, along which the response is.
    tangents: [V3<f64>; 2],
    response: Response<f64>,
    /// Of the points, each in its body's frame, and of the normal in A's.
    drift: Drift<3>,
}

/// A point of a surface with its normal.
#[derive(Clone, Copy, Debug, Default)]
struct Spot {
    point: V3<f64>,
    normal: V3<f64>,
}

impl Trace {
    /// Witnesses of A and of B, each in its body's frame, from the centre of its normalization on,
    /// metres.
    pub(in crate::measure) fn points(&self) -> [V3<f64>; 2] {
        [self.of_a.point, self.of_b.point]
    }

    /// Unit normal from B to A, in A's frame.
    pub(in crate::measure) fn normal_a(&self) -> Vector3<f64> {
        self.of_a.normal.into()
    }

    /// Takes down witnesses x of A and y of B, in the query frame of `relative`, with the normal.
    #[inline(always)]
    fn take_down<S: Simd>(
        &mut self,
        _: S,
        relative: &Relative<f64>,
        [x, y, n]: [V3<f64>; 3],
        frame: &M3<f64>,
        response: Response<f64>,
    ) {
        let from_b = subtract::<S, f64>(y, relative.origin);
        self.of_a = Spot { point: x, normal: n };
        self.of_b.point = apply_transposed::<S, f64>(&relative.rotation, from_b);
        self.of_b.normal = apply_transposed::<S, f64>(&relative.rotation, n);
        // The last step has turned the normal: along the old tangents the way between the points
        // would not be taken for none.
        let across = |tangent: V3<f64>| add_scaled::<S, f64>(tangent, -dot::<S, f64>(tangent, n), n);
        self.tangents = [across(frame[0]), across(frame[1])];
        self.response = response;
    }

    /// The trace of a distance's witnesses x of A and y of B, both in A's frame, with the normal.
    pub(in crate::measure) fn of_distance(
        (a, pose_a): (&Body, &Pose),
        (b, pose_b): (&Body, &Pose),
        [x, y, n]: [V3<f64>; 3],
        active: [u8; 2],
    ) -> Self {
        let simd = Scalar;
        let relative = Relative::new(simd, a, pose_a, b, pose_b);
        let frame = basis(simd, n);
        let linearized = |side: &Side<'_, f64>, v: V3<f64>| {
            let ((jet, _), local) = (side.jet(simd, v), side.localize(simd, &frame));
            (Plane::new(simd, &jet, &local), SurfaceCurvature::new(simd, &jet, &local))
        };
        let of_a = linearized(&Side::at_home(simd, a, active[0].into()), x);
        let of_b = linearized(&Side::away(simd, b, active[1].into(), &relative), y);
        let difference = apply::<Scalar, f64>(&frame, subtract::<Scalar, f64>(x, y));
        let (_, response) = newton(simd, (&of_a.0, &of_a.1), (&of_b.0, &of_b.1), difference, flattest(limits(a, b)));
        let mut trace = Self { active, ..Self::default() };
        trace.take_down(simd, &relative, [x, y, n], &frame, response);
        trace
    }
}

/// A proven bracket and where it is attained, from the centre of A's normalization on, in A's
/// frame, metres.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Proven {
    pub(in crate::measure) lower: f64,
    pub(in crate::measure) upper: f64,
    pub(in crate::measure) x: V3<f64>,
    pub(in crate::measure) y: V3<f64>,
    pub(in crate::measure) n: V3<f64>,
    /// Active constraint of A and of B.
    pub(in crate::measure) active: [u8; 2],
    /// Their multipliers, metres.
    pub(in crate::measure) multipliers: [f64; 2],
    /// Evaluations of both bodies.
    pub(in crate::measure) rounds: u32,
}

impl Proven {
    /// The points x and y and the normal in the world frame.
    #[inline(always)]
    pub(in crate::measure) fn world<S: Simd>(&self, simd: S, a: &Body, pose_a: &Pose) -> [Vector3<f64>; 3] {
        let rotation = rows(simd, pose_a.rotation().to_rotation_matrix().matrix());
        let (center, translation) = (a.normalization().center.into(), (*pose_a.translation()).into());
        let turned = |v: V3<f64>| apply::<S, f64>(&rotation, v);
        let moved = |v: V3<f64>| add::<S, f64>(turned(add::<S, f64>(v, center)), translation).into();
        [moved(self.x), moved(self.y), turned(self.n).into()]
    }
}

/// What is left where nothing was proven.
#[derive(Clone, Copy, Debug)]
pub(in crate::measure) struct Lost {
    /// Evaluations of both bodies.
    pub(in crate::measure) rounds: u32,
    /// A point that lies in both bodies, or seems to.
    pub(in crate::measure) common: Option<CommonPoint>,
    /// Where Newton's method ended without a narrow bracket, which only double-double arithmetic
    /// may prove: near contact, where doubles do not show on which side, or where the normals do
    /// not agree well enough.
    pub(in crate::measure) grazing: Option<Proven>,
    /// A lower bound by planes that is all that was asked for.
    pub(in crate::measure) parted: Option<f64>,
}

impl Lost {
    pub(in crate::measure) fn after(rounds: u32) -> Self {
        Self { rounds, common: None, grazing: None, parted: None }
    }

    /// By a plane that proves all that was asked for.
    pub(in crate::measure) fn parted(lower: f64, rounds: u32) -> Self {
        Self { parted: Some(lower), ..Self::after(rounds) }
    }

    /// Whether the bodies seem to touch or overlap.
    pub(in crate::measure) fn touching(&self) -> bool {
        self.common.is_some() || self.grazing.is_some()
    }
}

/// Moves, for the longest ones, beyond which no extrapolation is close enough for a bracket, whose
/// remainder is of third order: a hundredth of them, relative to the smaller body, too.
///
/// Longer, brackets are computed that stay wide; shorter, an evaluation more is taken. It changes
/// time only: `.ci/instructions` pins it.
#[inline(always)]
pub(in crate::measure) fn worth_a_bracket([of_x, of_y]: [f64; 2]) -> [f64; 2] {
    [1e-2 * of_x.min(of_y); 2]
}

/// The longest moves of a point of A and of a point of B, metres.
#[inline(always)]
pub(in crate::measure) fn limits(a: &Body, b: &Body) -> [f64; 2] {
    [LONGEST_MOVE * a.trust().reach, LONGEST_MOVE * b.trust().reach]
}

/// Curvature that counts as none for bodies with these longest moves, per metre.
#[inline(always)]
fn flattest([of_x, of_y]: [f64; 2]) -> f64 {
    FLATTEST / of_x.min(of_y)
}

/// Continuation as vectorized work.
pub(in crate::measure) struct Follow<'a, R> {
    pub(in crate::measure) a: &'a Body,
    pub(in crate::measure) b: &'a Body,
    pub(in crate::measure) relation: R,
    /// Whose iteration limit and stop flag end it.
    pub(in crate::measure) options: &'a Options<'a>,
    /// Read, and replaced if the answer is proven.
    pub(in crate::measure) trace: &'a mut Trace,
}

impl<R: Relation> WithSimd for Follow<'_, R> {
    type Output = Result<Proven, Lost>;

    /// The proven answer, or what is left.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Proven, Lost> {
        let Self { a, b, relation, options, trace } = self;
        let active = trace.active.map(usize::from);
        if active[0] >= a.constraints().len() || active[1] >= b.constraints().len() {
            return Err(Lost::after(0));
        }
        let relative = relation.relative(simd, a, b);
        let most = PATIENCE.min(options.max_iterations());
        let sides = (Side::at_home(simd, a, active[0]), Side::away(simd, b, active[1], &relative));
        let correct = Correct { sides, relation, patience: most, most, options, limits: limits(a, b) };

        let Trace { of_a, of_b, tangents, response, .. } = trace;
        let y = add::<S, f64>(apply::<S, f64>(&relative.rotation, of_b.point), relative.origin);
        let turned = subtract::<S, f64>(apply::<S, f64>(&relative.rotation, of_b.normal), of_a.normal);
        let frame = [tangents[0], tangents[1], of_a.normal];
        let difference = apply::<S, f64>(&frame, subtract::<S, f64>(of_a.point, y));
        let turned = [dot::<S, f64>(tangents[0], turned), dot::<S, f64>(tangents[1], turned)];
        let step = response.step(simd, relation.aside(simd, &frame, difference), turned);
        if !step.within(simd, correct.limits) {
            return Err(Lost::after(0));
        }
        let x = moved::<S, f64>(of_a.point, step.dx, &frame);
        let y = moved::<S, f64>(y, step.dy, &frame);
        let n = moved::<S, f64>(of_a.normal, [step.dn[0], step.dn[1], 0.0], &frame);
        let [of_x, of_y, of_n] = trace.drift.expected();
        let at = Iterate {
            x: add::<S, f64>(x, of_x),
            y: add::<S, f64>(y, apply::<S, f64>(&relative.rotation, of_y)),
            frame: basis(simd, add::<S, f64>(n, of_n)),
        };
        let proven = correct.run(simd, &relative, at, trace)?;
        let missed_y = apply_transposed::<S, f64>(&relative.rotation, subtract::<S, f64>(proven.y, y));
        let missed = [subtract::<S, f64>(proven.x, x), missed_y, subtract::<S, f64>(proven.n, n)];
        trace.drift.update(simd, missed);
        Ok(proven)
    }
}

/// A start from nothing but the poses, as vectorized work: where the bodies face each other, as
/// their outlines show it, and Newton's method from there.
pub(in crate::measure) struct Seek<'a, R> {
    pub(in crate::measure) a: &'a Body,
    pub(in crate::measure) b: &'a Body,
    pub(in crate::measure) relation: R,
    /// Where to begin instead, of smooth bodies.
    pub(in crate::measure) from: Option<Start<f64>>,
    /// Most rounds.
    pub(in crate::measure) most: u32,
    /// Whose stop flag is polled.
    pub(in crate::measure) options: &'a Options<'a>,
    /// Blank before; that of the answer if it is proven, else of no meaning.
    pub(in crate::measure) trace: &'a mut Trace,
}

impl<R: Relation> WithSimd for Seek<'_, R> {
    type Output = Result<Proven, Lost>;

    /// The proven answer, or what is left.
    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Result<Proven, Lost> {
        let Self { a, b, relation, from, most, options, trace } = self;
        let relative = relation.relative(simd, a, b);
        let (start, active) = match from {
            Some(start) => (start, [0; 2]),
            None => {
                let (start, places) = relation.start(simd, a, b, &relative);
                (start, [a.outline().active(places[0]) as u8, b.outline().active(places[1]) as u8])
            }
        };
        // From where the outlines are nearest thin bodies take more rounds to come near.
        let patience = if from.is_some() { most } else { PATIENCE };
        let sides = (Side::at_home(simd, a, active[0].into()), Side::away(simd, b, active[1].into(), &relative));
        let correct = Correct { sides, relation, patience, most, options, limits: limits(a, b) };
        let height = dot::<S, f64>(start.n, subtract::<S, f64>(start.x, start.y));
        if let Some(lower) = relation.parted((a, b), &relative, start.n, height) {
            return Err(Lost::parted(lower, 0));
        }
        if relation.ends_at_contact() && height < 0.0 {
            let common = CommonPoint::between(simd, (&correct.sides.0, &correct.sides.1), start.x, start.y);
            if common.is_some() {
                return Err(Lost { common, ..Lost::after(1) });
            }
        }
        let at = Iterate { x: start.x, y: start.y, frame: basis(simd, start.n) };
        trace.active = active;
        correct.run(simd, &relative, at, trace)
    }
}

/// Correction of a start by Newton's method until the bracket is narrow.
struct Correct<'a, R> {
    sides: (Side<'a, f64>, Side<'a, f64>),
    relation: R,
    /// Rounds after which steps should be short.
    patience: u32,
    /// Most rounds.
    most: u32,
    options: &'a Options<'a>,
    /// Longest moves of x and of y, metres.
    limits: [f64; 2],
}

impl<R: Relation> Correct<'_, R> {
    // What is lost is about as large as what is proven, and there is no allocation in a solve.
    #[allow(clippy::result_large_err)]
    #[inline(always)]
    fn run<S: Simd>(
        &self,
        simd: S,
        relative: &Relative<f64>,
        mut at: Iterate,
        trace: &mut Trace,
    ) -> Result<Proven, Lost> {
        let (side_a, side_b) = &self.sides;
        let mut series = Series::default();
        let mut overlap = f64::INFINITY;
        for rounds in 1..=self.most {
            if self.options.stopped() {
                return Err(Lost::after(rounds - 1));
            }
            let ((jet_a, inside_a), (jet_b, inside_b)) = (side_a.jet(simd, at.x), side_b.jet(simd, at.y));
            if !(inside_a && inside_b) {
                // A step has led too far.
                if rounds >= self.patience || !at.is_finite() {
                    return Err(Lost::after(rounds));
                }
                series = Series::default();
                (at.x, at.y) =
                    (side_a.brought_near(simd, at.x, jet_a.value), side_b.brought_near(simd, at.y, jet_b.value));
                continue;
            }
            let (local_a, local_b) = (side_a.localize(simd, &at.frame), side_b.localize(simd, &at.frame));
            let (a, b) = (Plane::new(simd, &jet_a, &local_a), Plane::new(simd, &jet_b, &local_b));
            let (curvature_a, curvature_b) =
                (SurfaceCurvature::new(simd, &jet_a, &local_a), SurfaceCurvature::new(simd, &jet_b, &local_b));
            let difference = apply::<S, f64>(&at.frame, subtract::<S, f64>(at.x, at.y));
            let (of_a, of_b) = ((&a, &curvature_a), (&b, &curvature_b));
            let (mut step, response) =
                self.relation.newton(simd, of_a, of_b, &at.frame, difference, flattest(self.limits));
            let near = step.within(simd, worth_a_bracket(self.limits));
            let prospect = Prospect::new(simd, &self.relation, &step, difference[2], self.limits);
            if prospect == Prospect::Common {
                let x = moved::<S, f64>(at.x, step.dx, &at.frame);
                let y = moved::<S, f64>(at.y, step.dy, &at.frame);
                let common = CommonPoint::proven_between(simd, (side_a, side_b), x, y);
                if common.is_some() {
                    return Err(Lost { common, ..Lost::after(rounds) });
                }
            }
            let decisive = prospect == Prospect::Decided;
            if decisive && !near {
                // The step is mostly too long for a bracket by extrapolation.
                let n = moved::<S, f64>(at.frame[2], [step.dn[0], step.dn[1], 0.0], &at.frame);
                let height = difference[2] + step.dx[2] - step.dy[2];
                let bodies = (side_a.body(), side_b.body());
                if let Some(lower) = self.relation.parted(bodies, relative, n, height) {
                    return Err(Lost::parted(lower, rounds));
                }
            }
            // Where sides are flat the point at hand may do long before its step is short enough.
            let local = (&local_a, &local_b);
            let flat = series.is_slow(step.along())
                && series.may_have_to_be_corrected(step.along(), self.relative_length(simd, &step, local));
            if near || flat || decisive {
                // The bracket there, or where Newton's step leads, by extrapolation: mostly no
                // other evaluation is needed.
                let (dx, dy) = if flat && !decisive { ([0.0; 3], [0.0; 3]) } else { (step.dx, step.dy) };
                let next_a = side_a.extrapolate(simd, &jet_a, &local_a, dx);
                let next_b = side_b.extrapolate(simd, &jet_b, &local_b, dy);
                let next = subtract::<S, f64>(add::<S, f64>(difference, dx), dy);
                let found = bracket(simd, (side_a, &next_a), (side_b, &next_b), next);
                let settled = step.within(simd, self.limits.map(|limit| SETTLED * limit));
                let verdict = match self.relation.judge(simd, &found, &at.frame, next) {
                    // No step is left to take: rounding keeps the bracket wide.
                    Verdict::Wide if settled && self.relation.ends_at_contact() => last_resort(&found),
                    verdict => verdict,
                };
                match verdict {
                    Verdict::Proven { lower, upper } => {
                        let x = moved::<S, f64>(at.x, add::<S, f64>(dx, found.to_a), &at.frame);
                        let y = moved::<S, f64>(at.y, add::<S, f64>(dy, found.to_b), &at.frame);
                        if !(side_a.others_hold(simd, x) && side_b.others_hold(simd, y)) {
                            return Err(Lost::after(rounds));
                        }
                        let n = apply_transposed::<S, f64>(&at.frame, found.normal);
                        trace.take_down(simd, relative, [x, y, n], &at.frame, response);
                        let (active, multipliers) = (trace.active, found.multipliers);
                        return Ok(Proven { lower, upper, x, y, n, active, multipliers, rounds });
                    }
                    Verdict::Overlap if near => {
                        let common = CommonPoint::between(simd, (side_a, side_b), at.x, at.y);
                        let deep = -next[2] > NEAR * self.limits[0].min(self.limits[1]);
                        // Bodies that touch are left to double-double arithmetic when a step does
                        // not halve the bracket.
                        let touching = settled || found.upper > 0.5 * overlap;
                        if common.is_some() || touching || deep && rounds >= PATIENCE {
                            let grazing = (!deep).then(|| at.grazing(simd, &step, &found, trace.active, rounds));
                            return Err(Lost { common, grazing, ..Lost::after(rounds) });
                        }
                        overlap = found.upper;
                    }
                    Verdict::Wide | Verdict::Overlap => {}
                }
            }
            let mut length = self.relative_length(simd, &step, local);
            let tangents = [at.frame[0], at.frame[1]];
            let part = series.part(simd, tangents, step.along(), length);
            if correct(simd, &mut series, (&mut step, length), (&a, &b), &response, tangents) {
                length = self.relative_length(simd, &step, local);
            }
            let late = f64::from(1_u32 << rounds.saturating_sub(self.patience));
            if !near && rounds >= self.patience && !(length * late <= NEAR) {
                return Err(Lost::after(rounds));
            }
            // The linearization is not valid farther away.
            let part = part.min(LONGEST_MOVE / length);
            if part < 1.0 {
                step.shorten(part);
            }
            series.took(step.along());
            at.advance(simd, &step);
        }
        Err(Lost::after(self.most))
    }

    /// How long a step is in normalized coordinates, relative to the bodies' sizes there.
    #[inline(always)]
    fn relative_length<S: Simd>(&self, simd: S, step: &Step<f64>, (local_a, local_b): (&M3<f64>, &M3<f64>)) -> f64 {
        let (side_a, side_b) = &self.sides;
        side_a.relative_square(simd, local_a, step.dx).max(side_b.relative_square(simd, local_b, step.dy)).sqrt()
    }
}

/// What a bracket is good for that no step makes narrower.
#[inline(always)]
fn last_resort(found: &Bracket<f64>) -> Verdict {
    if found.off <= ALIGNED && found.lower > 0.0 && found.upper.is_finite() {
        Verdict::Proven { lower: found.lower, upper: found.upper }
    } else {
        Verdict::Overlap
    }
}

/// Makes a step of this relative length as long as those before it show that it has to be; whether
/// that is another length.
#[inline(always)]
fn correct<S: Simd>(
    simd: S,
    series: &mut Series,
    (step, length): (&mut Step<f64>, f64),
    (a, b): (&Plane<f64>, &Plane<f64>),
    response: &Response<f64>,
    tangents: [V3<f64>; 2],
) -> bool {
    let (newton, of_a, of_b) = (step.along(), a.slope(), b.slope());
    let slope = [of_a[0] - of_b[0], of_a[1] - of_b[1]];
    let mut corrected = false;
    if series.may_have_to_be_corrected(newton, length) {
        let found = series.correction(simd, tangents, (newton, slope), response.compliance);
        corrected = found != Correction::default();
        // The same for x and y: they stay where they are seen from each other.
        let turned = response.turned(simd, found.shorter);
        for i in 0..2 {
            step.dx[i] += found.longer[i] + found.shorter[i];
            step.dy[i] += found.longer[i] + found.shorter[i];
            step.dx[2] -= of_a[i] * found.shorter[i];
            step.dy[2] -= of_b[i] * found.shorter[i];
            step.dn[i] += turned[i];
        }
    }
    series.push(tangents, Last { newton, taken: step.along(), slope, corrected });
    corrected
}

/// Trial points in the query frame and the basis whose third vector is the trial normal.
#[derive(Clone, Copy)]
struct Iterate {
    x: V3<f64>,
    y: V3<f64>,
    frame: M3<f64>,
}

impl Iterate {
    fn is_finite(&self) -> bool {
        [self.x, self.y, self.frame[2]].as_flattened().iter().all(|entry| entry.is_finite())
    }

    /// Takes a step; the basis follows the normal.
    #[inline(always)]
    fn advance<S: Simd>(&mut self, simd: S, step: &Step<f64>) {
        self.x = moved::<S, f64>(self.x, step.dx, &self.frame);
        self.y = moved::<S, f64>(self.y, step.dy, &self.frame);
        let turned = moved::<S, f64>(self.frame[2], [step.dn[0], step.dn[1], 0.0], &self.frame);
        self.frame = basis(simd, turned);
    }

    /// Where a step leads that doubles prove nothing narrow at; a lower bound is one all the same.
    #[inline(always)]
    fn grazing<S: Simd>(&self, _: S, step: &Step<f64>, found: &Bracket<f64>, active: [u8; 2], rounds: u32) -> Proven {
        Proven {
            lower: found.lower.max(0.0),
            upper: f64::INFINITY,
            x: moved::<S, f64>(self.x, step.dx, &self.frame),
            y: moved::<S, f64>(self.y, step.dy, &self.frame),
            n: apply_transposed::<S, f64>(&self.frame, found.normal),
            active,
            multipliers: found.multipliers,
            rounds,
        }
    }
}
