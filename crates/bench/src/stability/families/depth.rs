//! Overlap: 16, 27.

use super::super::method::{Method, sampled};
use super::super::question::{CaseError, Question, Verdict};
use super::draws::random;
use crate::comparison::{Hulls, Random, parry_pose};
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{Options, SignedDistance, Status, WarmStart, growth_distance, level_distance, signed_distance};
use sublevel_testkit::bodies::chart_zoo;
use sublevel_testkit::catalogue::Case;
use sublevel_testkit::catalogue::depth::{self, Saturation, Slide};

/// Offset from the common centre, relative to the whole slide, up to which the mirrored translation
/// out is as short, and reported.
const MIRRORED: f64 = 1e-6;

/// Deviation that others may have from what a signed distance does, relative to the smaller body.
const PEER_ERROR: f64 = 1e-5;

/// What is said of one place of a slide, metres.
#[derive(Clone, Copy)]
struct Step {
    offset: f64,
    value: f64,
    lower: f64,
    upper: f64,
    tied: bool,
}

/// A slide from touching to concentric. About their centres the bodies are their own mirror images:
/// the signed distance falls all the way, by no more than the motion; ours says how well it is
/// known, that the translation out is tied where it is, and exists everywhere.
pub(super) fn slide(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Warm | Method::Parry) {
        return Ok(None);
    }
    let slide = depth::slide(false, &mut random(16, seed));
    let Slide { a, pose_a, b, .. } = &slide;
    let small = a.circumscribed().radius.min(b.circumscribed().radius);
    // The offset at which they touch.
    let (mut inside, mut outside) = (0.0, 2.0 * (a.circumscribed().radius + b.circumscribed().radius));
    for _ in 0..60 {
        let middle = 0.5 * (inside + outside);
        let question = Question(Case::new(a, *pose_a, b, slide.place(middle), "on a slide"));
        *(if question.ours(Method::Cold)?.upper > 0.0 { &mut outside } else { &mut inside }) = middle;
    }
    let hulls = match method {
        Method::Parry => {
            let Ok(made) = Hulls::new(&sampled(a), &sampled(b)) else { return Ok(Some(Verdict::NoAnswer)) };
            Some(made)
        }
        _ => None,
    };
    let options = Options::default();
    let mut warm = WarmStart::default();
    let mut last: Option<Step> = None;
    for share in Slide::shares() {
        let offset = inside * share;
        let pose_b = slide.place(offset);
        let (step, slack) = if let Some(hulls) = &hulls {
            let relative = parry_pose(pose_a).inverse() * parry_pose(&pose_b);
            let Some(value) = hulls.signed_distance(&relative) else { return Ok(Some(Verdict::NoAnswer)) };
            (Step { offset, value, lower: value, upper: value, tied: false }, PEER_ERROR * small)
        } else {
            if method == Method::Cold {
                warm = WarmStart::default();
            }
            let answer = signed_distance(a, pose_a, b, &pose_b, &options, &mut warm);
            let SignedDistance { status, lower, upper, tied, normal, .. } = answer;
            let what = |what: &str| {
                let pair = format!("{}-{} at {share:e} of the slide", a.name(), b.name());
                Ok(Some(Verdict::WrongStatus(format!("{pair}: {what}, [{lower:e}, {upper:e}] m"))))
            };
            let depth = if upper < 0.0 { -lower } else { 0.0 };
            let allowed = (options.accuracy() * small).max(options.depth_accuracy() * depth) * (1.0 + 1e-12);
            if !(lower <= upper) || (status == Status::Converged) != (upper - lower <= allowed) {
                return what("the status is not what the bracket says");
            }
            if normal.is_none() {
                return what("no way out");
            }
            if share < MIRRORED && !tied {
                return what("the mirrored way out is not reported");
            }
            // Concentric balls have no translation out that is better than others: wide is right
            // there, and reported as a tie.
            if status != Status::Converged && !(tied && upper - lower <= 1e-2 * lower.abs()) {
                return what("still wide");
            }
            (Step { offset, value: answer.value(), lower, upper, tied }, 2e-9 * small)
        };
        if let Some(before) = last.replace(step) {
            let moved = before.offset - offset;
            // Of ties only the brackets are known to go on.
            let mut off = (step.lower - before.upper).max(before.lower - moved - step.upper);
            if !step.tied && !before.tied {
                off = off.max(step.value - before.value).max(before.value - moved - step.value);
            }
            if !(off <= slack) {
                return Ok(Some(Verdict::Off((off - slack) / small)));
            }
        }
    }
    Ok(Some(Verdict::Pass))
}

/// The seed of the level distance inside the other body: flagged, while the growth distance goes on
/// in proportion to the offset.
pub(super) fn saturation(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    saturation_of(chart_zoo(), &mut random(27, seed), method)
}

/// The same of a pair of these bodies.
pub(super) fn saturation_of(zoo: &[Body], random: &mut Random, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(None);
    }
    let pair = depth::saturation(zoo, random);
    let Saturation { a, pose_a, b, meet, .. } = &pair;
    let options = Options::default();
    let (mut growth_warm, mut level_warm) = (WarmStart::default(), WarmStart::default());
    // Bounds of the growth distance per metre of the centres' distance.
    let (mut low, mut high) = (0.0_f64, f64::INFINITY);
    for share in Saturation::SHARES {
        if method == Method::Cold {
            (growth_warm, level_warm) = (WarmStart::default(), WarmStart::default());
        }
        let pose_b = pair.place(share);
        let apart = pair.centres(&pose_b);
        let known = 1e-14 * (pair.sum() + meet.norm());
        let growth = growth_distance(a, pose_a, b, &pose_b, &options, &mut growth_warm);
        if growth.status != Status::Converged {
            return Ok(Some(Verdict::WrongStatus("the growth distance is still wide".into())));
        }
        low = low.max(growth.lower / (apart.norm() + known));
        high = high.min(growth.upper / (apart.norm() - known));
        if !(low <= high * (1.0 + 1e-12)) {
            return Ok(Some(Verdict::Off(low / high - 1.0)));
        }
        let level = level_distance(a, pose_a, b, &pose_b, &options, &mut level_warm);
        let value = pair.seed_level(&pose_b);
        // Near the boundary, and where the value is all but the least, either is right.
        let is_free = value > 1.0 + 1e-6 && level.lower > a.min_value() + 1e-6;
        if (level.saturated && is_free) || (!level.saturated && value < 1.0 - 1e-6) {
            return Ok(Some(Verdict::WrongStatus(format!("saturated: {}, the seed is at {value}", level.saturated))));
        }
        if level.status != Status::Converged {
            return Ok(Some(Verdict::WrongStatus("the level distance is still wide".into())));
        }
        if level.saturated && (level.multiplier != 0.0 || level.gradient_b.linear != Vector3::zeros()) {
            return Ok(Some(Verdict::WrongStatus("saturated, and yet with a gradient".into())));
        }
    }
    Ok(Some(Verdict::Pass))
}
