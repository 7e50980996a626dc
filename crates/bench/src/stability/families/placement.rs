//! Where bodies stand: far apart, overlapping, aligned, concentric, swapped: 4, 5, 6, 7, 19.

use super::super::arbiter::judge_along;
use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Answer, Method, pose, proposal};
use super::super::zoo::{b, c, cylinder, e, q, zoo};
use super::{any, at, permuted_index, random, shifted, somewhere};
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::Body;
use sublevel::measure::{
    Distance, Options, Pose, Twist, WarmStart, distance, distance_batch, growth_distance, level_distance,
};

/// Pairs of bodies of a case of [`far_apart`], and poses of the second body of each: 1008 pairs of
/// poses.
const PAIRS: u64 = 112;
/// See [`PAIRS`].
const POSES: usize = 9;

/// Directions between the bodies that are tried for each pair, beside those of the answer.
const DIRECTIONS: usize = 3;

/// Up to a hundred sizes apart: no plane between the bodies is farther than the answer says. Ours
/// get a block of pairs, in their batch nine at a time, warm from one to the next; others get the
/// first pair.
pub(super) fn far_apart(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    for k in 0..PAIRS {
        let mut random = random(4, seed * PAIRS + k);
        let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
        let sum = a.circumscribed().radius + b.circumscribed().radius;
        let pose_a = somewhere(&mut random, 1.0)?;
        let mut poses = [Pose::identity(); POSES];
        for pose in &mut poses {
            let reach = sum * random.between(0.2, 100.0);
            *pose = somewhere(&mut random, reach)?;
        }
        let mut case = Case::new(a, pose_a, b, poses[0], format!("pair {k}"));
        if !method.is_ours() {
            return case.put(method);
        }
        let options = Options::default();
        let mut answers = [Distance::default(); POSES];
        if method == Method::Batch {
            distance_batch(a, &pose_a, b, &poses, &options, &mut answers).map_err(CaseError::other)?;
        } else {
            let mut warm = WarmStart::default();
            for (answer, pose_b) in answers.iter_mut().zip(&poses) {
                if method == Method::Cold {
                    warm = WarmStart::default();
                }
                *answer = distance(a, &pose_a, b, pose_b, &options, &mut warm);
            }
        }
        for (answer, pose_b) in answers.iter().zip(&poses) {
            case.pose_b = *pose_b;
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
fn parted(case: &Case, answer: &Distance, random: &mut Random) -> Result<Verdict, CaseError> {
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

/// A point of the body frame where the largest constraint is below 0.9.
fn inner(body: &Body, random: &mut Random) -> Vector3<f64> {
    loop {
        let x = body.boundary_along(&random.direction());
        let point = body.interior_point() + (x - body.interior_point()) * random.positive();
        if body.value(&point) < 0.9 {
            return point;
        }
    }
}

/// Overlapping by construction.
pub(super) fn common_point(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(5, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let (x, y) = (inner(a, &mut random), inner(b, &mut random));
    let (pose_a, turn) = (somewhere(&mut random, 0.5)?, random.rotation());
    let pose_b = pose(pose_a.transform_point(&x) - turn * y, &turn)?;
    Ok(Case { exact: Some(0.0), bound: Some(0.0), ..Case::new(a, pose_a, b, pose_b, "in overlap".into()) })
}

/// Identical bodies with integer coordinates: the distance is what the offset exceeds twice the
/// half-axis by.
pub(super) fn along_an_axis(seed: u64) -> Result<Case, CaseError> {
    let seed = permuted_index(seed, 336);
    let (body, halves) = match seed % 8 {
        0 => (e(1.0, 1.0, 1.0)?, [1.0, 1.0, 1.0]),
        1 => (e(2.0, 1.0, 3.0)?, [2.0, 1.0, 3.0]),
        2 => (q(4, 1.0, 2.0, 3.0)?, [1.0, 2.0, 3.0]),
        3 => (q(6, 2.0, 2.0, 2.0)?, [2.0, 2.0, 2.0]),
        4 => (q(8, 1.0, 1.0, 4.0)?, [1.0, 1.0, 4.0]),
        5 => (b(1.0, 2.0, 3.0)?, [1.0, 2.0, 3.0]),
        6 => (cylinder(1.0, 2.0)?, [1.0, 1.0, 2.0]),
        _ => (c(6, 1.0, 2.0)?, [1.0, 1.0, 2.0]),
    };
    let shifts = [-9.0, -5.0, -4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 100.0];
    let axis = (seed / 8 % 3) as usize;
    let shift: f64 = shifts[(seed / 24 % 14) as usize];
    let place = at(Vector3::ith(axis, shift))?;
    let exact = (shift.abs() - 2.0 * halves[axis]).max(0.0);
    let case = Case::new(&body, Pose::identity(), &body, place, format!("{shift} m along axis {axis}"));
    Ok(Case { exact: Some(exact), bound: Some(1e-9 * case.small()), ..case })
}

/// Interior points 0 to 1e-6 m from each other.
pub(super) fn concentric(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(7, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let offset = [0.0, 1e-18, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9, 1e-6][(seed % 8) as usize];
    let pose_a = somewhere(&mut random, 0.0)?;
    let meet = pose_a.transform_point(a.interior_point()) - pose_a.rotation() * b.interior_point();
    let pose_b = pose(meet + random.direction() * offset, pose_a.rotation())?;
    let case = Case::new(a, pose_a, b, pose_b, format!("centres {offset:e} m apart"));
    Ok(vec![Case { exact: Some(0.0), bound: Some(0.0), ..case }])
}

/// How far centres of symmetric bodies may be from each other, relative to the smaller body, for
/// the way out to be flagged as tied: less than the accuracy of a depth.
const CENTRED: f64 = 1e-5;

/// All measures of bodies in each other have values, and say what is not unique: the normal of a
/// distance, the way out of mirror images, the normal of centres that coincide, and a level that is
/// the least there is.
pub(super) fn defined(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, said)] = answers else { return Ok(Verdict::Pass) };
    let Some(answer) = &said.answer else { return Ok(Verdict::Pass) };
    let Case { a, pose_a, b, pose_b, .. } = case;
    let wrong = |what: String| Ok(Verdict::WrongStatus(what));
    if answer.upper > 0.0 || answer.normal.is_some() {
        return wrong(format!("up to {:e} m apart, normal {:?}", answer.upper, answer.normal));
    }
    // Batches are of distances alone.
    if method == Method::Batch {
        return Ok(Verdict::Pass);
    }
    let options = Options::default();
    let signed = case.signed(method)?;
    let growth = case.measured(method, |pose_b, warm| growth_distance(a, pose_a, b, pose_b, &options, warm))?;
    let level = case.measured(method, |pose_b, warm| level_distance(a, pose_a, b, pose_b, &options, warm))?;
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

/// As it is, with the arguments swapped, and with both carried along by a motion.
pub(super) fn swapped(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(19, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let sum = a.circumscribed().radius + b.circumscribed().radius;
    let reach = sum * random.between(0.3, 5.0);
    let (pose_a, pose_b) = (somewhere(&mut random, 0.2)?, somewhere(&mut random, reach)?);
    let (turn, shift) = (random.rotation(), random.direction() * 3.0);
    let carried = |from: &Pose| {
        let turned = pose(turn * from.translation(), &UnitQuaternion::new_normalize(*(turn * from.rotation())))?;
        shifted(&turned, shift)
    };
    Ok(vec![
        Case::new(a, pose_a, b, pose_b, "as it is".into()),
        Case::new(b, pose_b, a, pose_a, "swapped".into()),
        Case::new(a, carried(&pose_a)?, b, carried(&pose_b)?, "carried along".into()),
    ])
}

/// How far normals may turn: the bracket holds them to its square root.
const NORMAL: f64 = 1e-3;

/// The same values; of ours also the same normals, the other way round or carried along, where the
/// gap is wide enough to tell.
pub(super) fn unswapped(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(first, one), rest @ ..] = answers else { return Ok(Verdict::Pass) };
    let Some(value) = one.value else { return Ok(Verdict::NoAnswer) };
    let sum = first.small() + first.large();
    for (k, (case, said)) in rest.iter().enumerate() {
        let Some(found) = said.value else { return Ok(Verdict::NoAnswer) };
        let away = case.pose_a.translation().norm().max(case.pose_b.translation().norm());
        let off = (found - value).abs() - 1e-14 * (sum + away);
        if !(off <= 2.0 * first.slack(method)) {
            return Ok(Verdict::Off(off / first.small()));
        }
        let normal = |said: &Answer| said.answer.and_then(|answer| answer.normal);
        let (Some(n), Some(m)) = (normal(one), normal(said)) else { continue };
        let turn = case.pose_a.rotation() * first.pose_a.rotation().inverse();
        let back = if k == 0 { -m } else { turn.inverse_transform_vector(&m) };
        if value > 1e-6 * sum && !((n - back).norm() <= NORMAL) {
            return Ok(Verdict::Off((n - back).norm()));
        }
    }
    Ok(Verdict::Pass)
}
