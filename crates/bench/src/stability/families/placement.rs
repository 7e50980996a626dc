//! Where bodies stand: far apart, overlapping, aligned, concentric, swapped: 4, 5, 6, 7, 19.

use super::super::arbiter::judge_along;
use super::super::method::{Answer, Method, proposal};
use super::super::question::{CaseError, Question, Verdict};
use super::draws::{permuted_index, random};
use crate::comparison::Random;
use nalgebra::Vector3;
use sublevel::measure::{
    Distance, Options, Twist, WarmStart, distance, distance_batch, growth_distance, level_distance,
};
use sublevel_testkit::bodies::chart_zoo;
use sublevel_testkit::catalogue::placement::{self, OFFSETS, POSES};
use sublevel_testkit::catalogue::{Case, any_two};

/// Pairs of bodies of a case of [`far_apart`]: with nine poses of the second body of each, 1008
/// pairs of poses.
const PAIRS: u64 = 112;

/// Directions between the bodies that are tried for each pair, beside those of the answer.
const DIRECTIONS: usize = 3;

/// Up to a hundred sizes apart: no plane between the bodies is farther than the answer says. Ours
/// get a block of pairs, in their batch nine at a time, warm from one to the next; others get the
/// first pair.
pub(super) fn far_apart(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    for k in 0..PAIRS {
        let mut random = random(4, seed * PAIRS + k);
        let (case, poses) = placement::far_apart(chart_zoo(), &mut random);
        let mut case = Question(case);
        case.0.what = format!("{}, pair {k}", case.what);
        if !method.is_ours() {
            return case.put(method);
        }
        let options = Options::default();
        let mut answers = [Distance::default(); POSES];
        if method == Method::Batch {
            let ((a, pose_a), (b, _)) = case.placed();
            distance_batch(a, pose_a, b, &poses, &options, &mut answers).map_err(CaseError::other)?;
        } else {
            let mut warm = WarmStart::default();
            for (answer, pose_b) in answers.iter_mut().zip(&poses) {
                if method == Method::Cold {
                    warm = WarmStart::default();
                }
                *answer = distance(&case.a, &case.pose_a, &case.b, pose_b, &options, &mut warm);
            }
        }
        for (answer, pose_b) in answers.iter().zip(&poses) {
            case.0.pose_b = *pose_b;
            match parted(&case, answer, &mut random)? {
                Verdict::Pass => {}
                Verdict::WrongStatus(what) => {
                    return Ok(Some(Verdict::WrongStatus(format!("{}: {what}", case.what))));
                }
                verdict => return Ok(Some(verdict)),
            }
        }
    }
    Ok(Some(Verdict::Pass))
}

/// Judges an answer by its own witnesses and planes, and by planes across the line of centres and
/// near it.
fn parted(case: &Question, answer: &Distance, random: &mut Random) -> Result<Verdict, CaseError> {
    let between = case.pose_a.translation() - case.pose_b.translation();
    let axis = between.try_normalize(0.0).unwrap_or_else(Vector3::x);
    let near = (0..DIRECTIONS).map(|k| {
        let aside = if k == 0 { 0.0 } else { random.between(1e-6, 2.0) };
        (axis + random.direction() * aside).try_normalize(0.0).unwrap_or(axis)
    });
    let truth = judge_along(case, &[proposal(answer)], near);
    let verdict = case.verdict_by(answer, &truth);
    // What these do not confirm a tight answer and directions all around may.
    if verdict == Verdict::Pass || case.is_known_by(&truth) { Ok(verdict) } else { case.verdict(answer) }
}

pub(super) fn common_point(seed: u64) -> Case {
    placement::common_point(chart_zoo(), &mut random(5, seed))
}

pub(super) fn along_an_axis(seed: u64) -> Case {
    placement::along_an_axis(permuted_index(seed, placement::ALONG_AN_AXIS))
}

pub(super) fn concentric(seed: u64) -> Vec<Case> {
    let mut random = random(7, seed);
    let (a, b, _) = any_two(&mut random, chart_zoo());
    vec![placement::concentric(a, b, OFFSETS[(seed % 8) as usize], &mut random)]
}

/// How far centres of symmetric bodies may be from each other, relative to the smaller body, for
/// the translation out to be flagged as tied: less than the accuracy of a depth.
const CENTRED: f64 = 1e-5;

/// All measures of bodies in each other have values, and say what is not unique: the normal of a
/// distance, the translation out of mirror images, the normal of centres that coincide, and a level
/// that is the least there is.
pub(super) fn defined(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, answer)] = answers else { return Ok(Verdict::Pass) };
    let Some(ours) = &answer.ours else { return Ok(Verdict::Pass) };
    let Case { a, pose_a, b, pose_b, .. } = &case.0;
    let wrong = |what: String| Ok(Verdict::WrongStatus(what));
    if ours.upper > 0.0 || ours.normal.is_some() {
        return wrong(format!("up to {:e} m apart, normal {:?}", ours.upper, ours.normal));
    }
    // Batches are of distances alone.
    if method == Method::Batch {
        return Ok(Verdict::Pass);
    }
    let options = Options::default();
    let signed = case.signed(method)?;
    let growth = case.measured(method, |pose_b, warm| growth_distance(a, pose_a, b, pose_b, &options, warm));
    let level = case.measured(method, |pose_b, warm| level_distance(a, pose_a, b, pose_b, &options, warm));
    let finite = |v: &Vector3<f64>| v.iter().all(|value| value.is_finite());
    let twists = |twists: Option<[Twist; 2]>| twists.iter().flatten().all(|t| finite(&t.linear) && finite(&t.angular));
    let numbers = [signed.lower, signed.upper, growth.lower, growth.upper, level.lower, level.upper, level.multiplier];
    let vectors = [signed.witness_a, signed.witness_b, growth.witness, level.witness];
    let slopes =
        twists(signed.gradients) && twists(growth.gradients) && twists(Some([level.gradient_a, level.gradient_b]));
    let normals = [signed.normal, growth.normal];
    if !(numbers.iter().all(|value| value.is_finite())
        && vectors.iter().chain(normals.iter().flatten()).all(finite)
        && slopes)
    {
        return wrong("a number of a measure is none".into());
    }
    if !(signed.upper < 0.0 && signed.normal.is_some()) {
        return wrong(format!("the signed distance is up to {:e} m", signed.upper));
    }
    let apart = (pose_a.transform_point(a.interior_point()) - pose_b.transform_point(b.interior_point())).norm();
    // Fitted bodies are not their own mirror images.
    let symmetric = [a, b].iter().all(|body| !body.name().starts_with('F'));
    if symmetric && apart <= CENTRED * case.small() && !signed.tied {
        return wrong("the way out is not flagged as tied".into());
    }
    let centres = pose_a.transform_point(&a.growth_ball().center) - pose_b.transform_point(&b.growth_ball().center);
    let gap = centres.norm();
    let grown = 1e-9 + 2.0 * gap / (a.growth_ball().radius + b.growth_ball().radius);
    if !(growth.lower >= 0.0 && growth.upper <= grown) {
        return wrong(format!("the growth distance of centres {gap:e} m apart is up to {:e}", growth.upper));
    }
    if gap == 0.0 && (growth.normal.is_some() || growth.gradients.is_some()) {
        return wrong("the growth distance has a normal where centres coincide".into());
    }
    if !level.saturated {
        return wrong(format!("the level distance is not flagged as saturated, {:e}", level.upper));
    }
    Ok(Verdict::Pass)
}

pub(super) fn swapped(seed: u64) -> Vec<Case> {
    placement::swapped(chart_zoo(), &mut random(19, seed)).into()
}

/// How far normals may turn: the bracket determines them to its square root.
const NORMAL: f64 = 1e-3;

/// The same values; of ours also the same normals, the other way round or carried along, where the
/// gap is wide enough to tell.
pub(super) fn unswapped(answers: &[(Question, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(first, one), rest @ ..] = answers else { return Ok(Verdict::Pass) };
    let Some(value) = one.value else { return Ok(Verdict::NoAnswer) };
    let sum = first.small() + first.large();
    for (k, (case, answer)) in rest.iter().enumerate() {
        let Some(found) = answer.value else { return Ok(Verdict::NoAnswer) };
        let away = case.pose_a.translation().norm().max(case.pose_b.translation().norm());
        let off = (found - value).abs() - 1e-14 * (sum + away);
        if !(off <= 2.0 * first.slack(method)) {
            return Ok(Verdict::Off(off / first.small()));
        }
        let normal = |answer: &Answer| answer.ours.and_then(|ours| ours.normal);
        let (Some(n), Some(m)) = (normal(one), normal(answer)) else { continue };
        let turn = case.pose_a.rotation() * first.pose_a.rotation().inverse();
        let back = if k == 0 { -m } else { turn.inverse_transform_vector(&m) };
        if value > 1e-6 * sum && !((n - back).norm() <= NORMAL) {
            return Ok(Verdict::Off((n - back).norm()));
        }
    }
    Ok(Verdict::Pass)
}
