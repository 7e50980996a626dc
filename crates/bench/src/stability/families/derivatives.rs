//! Gradients against differences: 20, and both sides of contact for 8.

use super::super::method::Method;
use super::super::question::{CaseError, Question, Verdict};
use super::draws::random;
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{Options, Pose, Twist, WarmStart, distance, growth_distance, level_distance, signed_distance};
use sublevel_testkit::bodies::chart_zoo;
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::catalogue::derivatives::{APART, GAPS, apart};
use sublevel_testkit::random::twisted;

/// Largest error of a gradient, relative to its norm.
const ERROR: f64 = 1e-6;

/// Accuracy of the values that differences are of.
const TIGHT: f64 = 1e-13;

/// What differences may leave open of that.
const DOUBT: f64 = 2e-7;

/// Steps of differences, relative to the usual one, until one leaves no more open than [`DOUBT`].
const STEPS: [f64; 7] = [1.0, 0.25, 4.0, 0.0625, 16.0, 0.015625, 64.0];

/// Draws of a case until one has a gradient: most have.
const DRAWS: u32 = 20;

/// A measure with gradients.
#[derive(Clone, Copy, PartialEq)]
enum Measure {
    Distance,
    Signed,
    Level,
    Growth,
}

/// What a measure says.
struct Found {
    value: f64,
    gradients: Option<[Twist; 2]>,
    /// It says itself that the gradient may jump, or is none.
    flagged: bool,
}

impl Measure {
    fn of(self, (a, b): (&Body, &Body), poses: [&Pose; 2], options: &Options<'_>, warm: &mut WarmStart) -> Found {
        let [pose_a, pose_b] = poses;
        match self {
            Self::Distance => {
                let found = distance(a, pose_a, b, pose_b, options, warm);
                Found { value: found.value(), gradients: found.gradients(pose_a, pose_b), flagged: found.tied }
            }
            Self::Signed => {
                let found = signed_distance(a, pose_a, b, pose_b, options, warm);
                Found { value: found.value(), gradients: found.gradients, flagged: found.tied }
            }
            Self::Level => {
                let found = level_distance(a, pose_a, b, pose_b, options, warm);
                let gradients = Some([found.gradient_a, found.gradient_b]);
                Found { value: found.value(), gradients, flagged: found.saturated }
            }
            Self::Growth => {
                let found = growth_distance(a, pose_a, b, pose_b, options, warm);
                Found { value: found.value(), gradients: found.gradients, flagged: found.tied }
            }
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Distance => "distance",
            Self::Signed => "signed distance",
            Self::Level => "level distance",
            Self::Growth => "growth distance",
        }
    }

    /// What has the same derivatives, and has them on both sides of a small gap.
    fn through_contact(self) -> Self {
        if self == Self::Distance { Self::Signed } else { self }
    }
}

/// The gradients of all measures, in all regimes, with respect to both poses, against differences
/// of tight values.
pub(super) fn gradient(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let measure = [Measure::Distance, Measure::Signed, Measure::Level, Measure::Growth][(seed % 4) as usize];
    let is_asked = match method {
        Method::Cold | Method::Warm => true,
        Method::Batch | Method::Newton => measure == Measure::Distance,
        Method::Slsqp | Method::Clarabel | Method::Parry | Method::Coal => false,
    };
    if !is_asked {
        return Ok(None);
    }
    let mut random = random(20, seed);
    for _ in 0..DRAWS {
        let apart = apart(chart_zoo(), &mut random);
        let ((a, _), (b, _)) = apart.placed();
        if method == Method::Newton && !(a.is_smooth() && b.is_smooth()) {
            return Ok(None);
        }
        let small = apart.small();
        let regimes = if measure == Measure::Distance { APART } else { GAPS.len() };
        let mut gap = GAPS[seed as usize / 4 % regimes];
        // Where edges touch, many planes part the bodies: the derivative on one side is not the one
        // on the other.
        let edged = !(a.is_smooth() && b.is_smooth());
        if edged && gap.abs() < 1e-2 {
            gap = 1e-2_f64.copysign(gap);
        }
        let what = format!("{}-{} {} at a gap of {gap:e}", a.name(), b.name(), measure.name());
        let case = Question(Case { what, ..apart }.moved_to(gap * small));
        let (a, b) = (&case.a, &case.b);
        let answer = match method {
            Method::Newton => newton_gradients(&case)?,
            Method::Batch => Some(case.ours(method)?.gradients(&case.pose_a, &case.pose_b)),
            _ => {
                let found = case.measured(method, |pose_b, warm| {
                    measure.of((a, b), [&case.pose_a, pose_b], &Options::default(), warm)
                });
                (!found.flagged).then_some(found.gradients)
            }
        };
        // What is flagged is the question of another family.
        let Some(answer) = answer else { continue };
        let Some(found) = answer else { return Ok(Some(Verdict::NoAnswer)) };
        let options = Options::default().with_accuracy(TIGHT)?;
        let value =
            |poses: [&Pose; 2]| measure.through_contact().of((a, b), poses, &options, &mut WarmStart::default()).value;
        let usual = 2e-3 * (gap.abs() * small).clamp(0.1 * small, small);
        let differences = Differences { case: &case, value: &value };
        return Ok(Some(differences.verdict(&found, usual, Side::Both)));
    }
    Ok(Some(Verdict::WrongStatus("the gradient is flagged in every draw".into())))
}

/// As the points of plain Newton show them; the inner one is none without an answer.
fn newton_gradients(case: &Question) -> Result<Option<Option<[Twist; 2]>>, CaseError> {
    let points = case.proposed(Method::Newton)?.and_then(|proposal| proposal.points);
    let normal = points.and_then(|[x, y]| (x - y).try_normalize(0.0));
    let (Some([x, y]), Some(n)) = (points, normal) else { return Ok(Some(None)) };
    // A point at r from the translation moves by v + ω × r.
    let of = |n: Vector3<f64>, r: Vector3<f64>| Twist { linear: n, angular: r.cross(&n) };
    Ok(Some(Some([of(n, x - case.pose_a.translation()), of(-n, y - case.pose_b.translation())])))
}

/// The slopes of the signed distance of touching bodies, towards each other and away, are those
/// that it says.
pub(super) fn both_sides(case: &Question, method: Method) -> Result<Verdict, CaseError> {
    let found = case.signed(method)?;
    let Some(gradients) = found.gradients else { return Ok(Verdict::NoAnswer) };
    if found.tied {
        return Ok(Verdict::WrongStatus("tied at contact".into()));
    }
    // From where they touch, without the proof that no translation out far away is shorter.
    let options = Options::default().with_accuracy(TIGHT)?.with_depth_accuracy(1.0)?;
    let bodies = (&case.a, &case.b);
    let mut touching = WarmStart::default();
    Measure::Signed.of(bodies, [&case.pose_a, &case.pose_b], &options, &mut touching);
    let value = |poses: [&Pose; 2]| Measure::Signed.of(bodies, poses, &options, &mut touching.clone()).value;
    let differences = Differences { case, value: &value };
    for side in [Side::Above, Side::Below] {
        let verdict = differences.verdict(&gradients, 2e-4 * case.small(), side);
        if verdict != Verdict::Pass {
            return Ok(verdict);
        }
    }
    Ok(Verdict::Pass)
}

/// On which side of a pose differences are taken.
#[derive(Clone, Copy, PartialEq)]
enum Side {
    Both,
    /// Where the value is larger.
    Above,
    /// Where the value is smaller.
    Below,
}

/// Slopes of a measure along the 12 components of the twists of both bodies, angles in units of the
/// bodies' sizes: all are per metre.
struct Differences<'a> {
    case: &'a Question,
    value: &'a dyn Fn([&Pose; 2]) -> f64,
}

impl Differences<'_> {
    /// Compares gradients with differences of the first step that leaves little open.
    fn verdict(&self, found: &[Twist; 2], usual: f64, side: Side) -> Verdict {
        let sizes = [self.case.a.circumscribed().radius, self.case.b.circumscribed().radius];
        let mut parts = [0.0; 12];
        for (k, part) in parts.iter_mut().enumerate() {
            let Twist { linear, angular } = &found[k / 6];
            *part = if k % 6 < 3 { linear[k % 3] } else { angular[k % 3] / sizes[k / 6] };
        }
        let norm = |values: &[f64; 12]| values.iter().map(|value| value * value).sum::<f64>().sqrt();
        let mut least = f64::INFINITY;
        for step in STEPS {
            let (mut off, mut doubts, mut slopes) = ([0.0; 12], [0.0; 12], [0.0; 12]);
            for k in 0..12 {
                // The value grows with the component by its sign.
                let towards = match side {
                    Side::Both | Side::Above => parts[k],
                    Side::Below => -parts[k],
                };
                let h = (usual * step).copysign(towards);
                (slopes[k], doubts[k]) = self.slope(k, h, sizes[k / 6], side);
                off[k] = parts[k] - slopes[k];
            }
            least = least.min(norm(&doubts) / norm(&slopes));
            if least <= DOUBT {
                let error = norm(&off) / norm(&slopes);
                return if error <= ERROR { Verdict::Pass } else { Verdict::Off(error) };
            }
        }
        let what = &self.case.what;
        Verdict::WrongStatus(format!("{what}, differences of the value leave {least:.1e} open"))
    }

    /// The slope along a component, extrapolated from three steps of which the first is h, and how
    /// much the last extrapolation changed.
    fn slope(&self, k: usize, h: f64, size: f64, side: Side) -> (f64, f64) {
        let after = |step: f64| {
            let Case { pose_a, pose_b, .. } = &self.case.0;
            let step = if k % 6 < 3 { step } else { step / size };
            (self.value)([&twisted(pose_a, k, 0, step), &twisted(pose_b, k, 6, step)])
        };
        // Errors are series in h², of one-sided differences in h.
        let (ratio, here) = if side == Side::Both { (4.0, None) } else { (2.0, Some(after(0.0))) };
        let slope = |h: f64| match here {
            None => (after(h) - after(-h)) / (2.0 * h),
            Some(here) => (after(h) - here) / h,
        };
        let (one, two, four) = (slope(h), slope(h / 2.0), slope(h / 4.0));
        let better = |rough: f64, fine: f64, ratio: f64| (ratio * fine - rough) / (ratio - 1.0);
        let (first, second) = (better(one, two, ratio), better(two, four, ratio));
        let last = better(first, second, ratio * ratio);
        (last, (last - second).abs())
    }
}
