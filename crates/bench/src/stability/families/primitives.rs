//! All families between primitives: 101 to 127.

use super::super::method::{Method, PEER_ERROR};
use super::super::pair::{PairAnswer, parry_signed, run, solved, verdict};
use super::super::question::{CaseError, Verdict};
use super::depth::saturation_of;
use super::draws::{permuted_index, random};
use crate::comparison::Random;
use nalgebra::Vector3;
use std::sync::OnceLock;
use sublevel::body::{Body, Compound};
use sublevel::measure::{
    HalfSpace, Options, WarmStart, distance, distance_to_capsule, distance_to_half_space, distance_to_point,
};
use sublevel_testkit::bodies::{b, cut, cylinder, e, q};
use sublevel_testkit::catalogue::placement::OFFSETS;
use sublevel_testkit::catalogue::primitives::contact::{self, Slide, TOUCHING};
use sublevel_testkit::catalogue::primitives::{COUNT, Flaw, Pair, Solved, data, placement, scale};
use sublevel_testkit::catalogue::scale::{DOUBLINGS, scales};
use sublevel_testkit::catalogue::{derivatives, limits, ties};

type Put = Result<Option<Verdict>, CaseError>;

/// Puts one pair.
fn put(pair: &Pair, method: Method) -> Put {
    Ok(run(pair, method)?.map(|answer| answer.verdict))
}

/// Puts pairs, whose answers must also go together.
fn put_all(pairs: Vec<Pair>, method: Method, together: impl FnOnce(&[(Pair, PairAnswer)], Method) -> Verdict) -> Put {
    let mut answers = Vec::new();
    for pair in pairs {
        let Some(answer) = run(&pair, method)? else { return Ok(None) };
        if answer.verdict != Verdict::Pass {
            return Ok(Some(answer.verdict));
        }
        answers.push((pair, answer));
    }
    Ok(Some(together(&answers, method)))
}

/// How much answers may differ from the truth, metres.
fn slack(pair: &Pair, method: Method) -> f64 {
    pair.rounding()
        + pair.size() * if method.is_ours() { pair.accuracy.max(pair.floor / pair.size()) } else { PEER_ERROR }
}

/// Largest distance of shapes that overlap, metres: of ours the rounding floor that
/// `Options::with_accuracy` states.
fn contact_slack(pair: &Pair, method: Method) -> f64 {
    if method.is_ours() { pair.rounding().max(1e-13 * pair.sum()) } else { slack(pair, method) }
}

/// How far normals may turn.
const NORMAL: f64 = 1e-6;

/// From gap to gap no value falls, and no normal leaves the axis.
pub(super) fn kissing(seed: u64, method: Method) -> Put {
    let pairs = contact::kissing(permuted_index(seed, contact::KISSING));
    put_all(pairs, method, |answers, method| {
        let mut last = f64::NEG_INFINITY;
        for (pair, answer) in answers {
            let Some(value) = answer.value else { return Verdict::NoAnswer };
            let slack = if method.is_ours() { 1e-12 + pair.rounding() } else { 2.0 * slack(pair, method) };
            if !(value >= last - slack) {
                return Verdict::Off((last - value) / pair.size());
            }
            last = value;
            let Some(ours) = answer.ours else { continue };
            let truth = pair.reference(&ours);
            let (Some(n), Some(_)) = (ours.normal, truth.normal) else { continue };
            // Where a segment lies in the plane of a half-space, both have one origin.
            let Some(axis) = pair.pose_b.translation().try_normalize(0.0) else { continue };
            let angle = (n + axis).norm();
            if !(angle <= NORMAL + pair.turn_of_rounding(&truth)) {
                return Verdict::Off(angle);
            }
        }
        Verdict::Pass
    })
}

pub(super) fn few_iterations(seed: u64, method: Method) -> Put {
    let pair = placement::anywhere(seed, [0.2, 4.0], &mut random(102, seed), "few iterations");
    let limit = Some((seed / COUNT % 3) as u32 + limits::LIMITS.start());
    put(&Pair { limit, ..pair }, method)
}

pub(super) fn parallel_faces(seed: u64, method: Method) -> Put {
    put(&contact::parallel_faces(permuted_index(seed, contact::PARALLEL_FACES)), method)
}

pub(super) fn far_apart(seed: u64, method: Method) -> Put {
    put(&placement::anywhere(seed, [0.2, 100.0], &mut random(104, seed), "far apart"), method)
}

pub(super) fn common_point(seed: u64, method: Method) -> Put {
    let pair = placement::common_point(seed, &mut random(105, seed));
    put_all(vec![pair], method, |answers, method| {
        let [(pair, PairAnswer { value: Some(value), .. })] = answers else { return Verdict::NoAnswer };
        if *value <= contact_slack(pair, method) { Verdict::Pass } else { Verdict::Off(value / pair.size()) }
    })
}

pub(super) fn along_an_axis(seed: u64, method: Method) -> Put {
    put(&placement::along_an_axis(permuted_index(seed, placement::ALONG_AN_AXIS)), method)
}

/// All that an answer says is a number, and no overlap is missed.
pub(super) fn concentric(seed: u64, method: Method) -> Put {
    let offset = OFFSETS[(seed / COUNT % 8) as usize];
    let pair = placement::concentric(seed, offset, &mut random(107, seed));
    put_all(vec![pair], method, |answers, method| {
        let [(pair, answer)] = answers else { return Verdict::NoAnswer };
        let Some(value) = answer.value else { return Verdict::NoAnswer };
        // Half-spaces are concentric with what they halve, two segments with an offset between them
        // are not.
        if !(value <= offset + contact_slack(pair, method)) {
            return Verdict::Off(value / pair.size());
        }
        let Some(ours) = answer.ours else { return Verdict::Pass };
        let finite = |v: &Vector3<f64>| v.iter().all(|value| value.is_finite());
        let twists = ours.gradients.iter().flatten().all(|twist| finite(&twist.linear) && finite(&twist.angular));
        let vectors = [ours.witness_a, ours.witness_b].iter().chain(&ours.normal).all(finite);
        if twists && vectors { Verdict::Pass } else { Verdict::WrongStatus("a number of the answer is none".into()) }
    })
}

/// Touching pairs, from both sides where the answer goes through contact.
pub(super) fn touching(seed: u64, method: Method) -> Put {
    let gaps = TOUCHING.len() as u64 + 1;
    let gap = *TOUCHING.get((seed / COUNT % gaps) as usize).unwrap_or(&-1e-6);
    at_gap(contact::at_gap(seed, gap, &mut random(108, seed)), method)
}

/// Gradients in all regimes.
pub(super) fn gradient(seed: u64, method: Method) -> Put {
    let gap = derivatives::GAPS[(seed / COUNT % derivatives::GAPS.len() as u64) as usize];
    at_gap(contact::at_gap(seed, gap, &mut random(120, seed)), method)
}

/// A pair whose gradient is compared with that of 200 bits, angles in units of the size.
fn at_gap(pair: Pair, method: Method) -> Put {
    if !method.is_ours() {
        // What others say of hulls has other gradients, and Newton's method is asked in family 20.
        return Ok(None);
    }
    put_all(vec![pair], method, |answers, _| {
        let [(pair, PairAnswer { ours: Some(ours), .. })] = answers else { return Verdict::NoAnswer };
        match pair.slope_flaw(ours, &pair.truth()) {
            None => Verdict::Pass,
            Some(Flaw::Off(error)) => Verdict::Off(error),
            Some(Flaw::Status(what)) => Verdict::WrongStatus(format!("{}: {what}", pair.what)),
        }
    })
}

pub(super) fn ratio(seed: u64, method: Method) -> Put {
    put(&scale::ratio(seed, &mut random(109, seed)), method)
}

/// The same value but for what the coordinates lose.
pub(super) fn far_from_the_origin(seed: u64, method: Method) -> Put {
    let power = (seed / COUNT % 10) as i32;
    let pairs = scale::far_from_the_origin(seed, power, &mut random(110, seed));
    put_all(pairs.into(), method, |answers, method| {
        let [(pair, near), (there, far)] = answers else { return Verdict::NoAnswer };
        let (Some(one), Some(other)) = (near.value, far.value) else { return Verdict::NoAnswer };
        let lost = 4.0 * f64::EPSILON * there.pose_a.translation().norm().max(there.pose_b.translation().norm());
        let off = (one - other).abs() - lost;
        if off <= 2.0 * slack(pair, method) + 256.0 * f64::EPSILON * there.pose_a.translation().norm() {
            Verdict::Pass
        } else {
            Verdict::Off(off / pair.size())
        }
    })
}

/// The same in other units: of ours, bit for bit with as many iterations where nothing rounds,
/// elsewhere within the brackets.
pub(super) fn units(seed: u64, method: Method) -> Put {
    let all = scales();
    let s = all[(seed / COUNT) as usize * 7 % all.len()];
    put_all(scale::units(seed, s, 111_000_000 + seed).into(), method, |answers, method| {
        let [(pair, one), (_, other)] = answers else { return Verdict::NoAnswer };
        let (Some(value), Some(found)) = (one.value, other.value) else { return Verdict::NoAnswer };
        let off = (found / s - value).abs();
        if let (Some(one), Some(other)) = (&one.ours, &other.ours) {
            let is_exact = s == 1.0 || DOUBLINGS.iter().any(|k| s == 2_f64.powi(*k));
            let brackets = |answer: &Solved, s: f64| [answer.lower / s, answer.upper / s];
            let ([low, high], [lower, upper]) = (brackets(one, 1.0), brackets(other, s));
            if is_exact && ([low, high] != [lower, upper] || one.iterations != other.iterations) {
                let iterations = [one.iterations, other.iterations];
                return Verdict::WrongStatus(format!("{}: changed by {off:e} m, iterations {iterations:?}", pair.what));
            }
            let apart = (low - upper).max(lower - high) - 2.0 * pair.rounding();
            if !(apart <= 0.0) {
                return Verdict::Off(apart / pair.size());
            }
        }
        if off <= 2.0 * slack(pair, method) { Verdict::Pass } else { Verdict::Off(off / pair.size()) }
    })
}

pub(super) fn needles(seed: u64, method: Method) -> Put {
    // Of no factor that the settings have.
    let index = seed * 61;
    scale::needles(index % scale::ALL_NEEDLES, &mut random(112, seed)).map_or(Ok(None), |pair| put(&pair, method))
}

pub(super) fn parallel_flats(seed: u64, method: Method) -> Put {
    put(&contact::parallel_flats(permuted_index(seed, contact::PARALLEL_FLATS)), method)
}

pub(super) fn tips(seed: u64, method: Method) -> Put {
    let index = permuted_index(seed, contact::TIPS);
    contact::tips(index, &mut random(114, index)).map_or(Ok(None), |pair| put(&pair, method))
}

pub(super) fn grazing(seed: u64, method: Method) -> Put {
    put(&contact::grazing(seed, &mut random(115, seed)), method)
}

/// A slide from apart to concentric: the signed distance falls all the way, by no more than the
/// motion, to where the axis meets the body.
pub(super) fn slide(seed: u64, method: Method) -> Put {
    if !matches!(method, Method::Cold | Method::Warm | Method::Parry) {
        return Ok(None);
    }
    let Some(slide) = contact::slide(seed, &mut random(116, seed)) else { return Ok(None) };
    // Where they touch.
    let (mut outside, mut inside) = (0.0, 1.0);
    for _ in 0..60 {
        let middle = 0.5 * (outside + inside);
        let found = solved(&slide.after(middle), Method::Cold);
        *(if found.is_some_and(|found| found.upper > 0.0) { &mut outside } else { &mut inside }) = middle;
    }
    let mut warm = WarmStart::default();
    let mut last: Option<(f64, f64)> = None;
    let mut asked = false;
    for share in Slide::shares(outside) {
        let pair = slide.after(share);
        let truth = pair.truth();
        let small = 2.0 * slack(&pair, method);
        let value = if method == Method::Parry {
            // What it says of depths that nobody knows is not judged.
            if truth.lower.is_none() {
                continue;
            }
            let Some(value) = parry_signed(&pair) else { continue };
            let error = (value - truth.value()).abs() - slack(&pair, method);
            if !(error <= 0.0) {
                return Ok(Some(Verdict::Off(error / pair.size())));
            }
            value
        } else {
            if method == Method::Cold {
                warm = WarmStart::default();
            }
            let found = pair.solve(&pair.options(), &mut warm);
            let judged = verdict(&pair, &found, &truth);
            if judged != Verdict::Pass {
                return Ok(Some(judged));
            }
            found.value
        };
        asked = true;
        if let Some((before, earlier)) = last.replace((share, value)) {
            let moved = (share - before) * slide.length();
            let off = (value - earlier).max(earlier - moved - value) - small;
            if !(off <= 0.0) {
                return Ok(Some(Verdict::Off(off / pair.size())));
            }
        }
    }
    Ok(asked.then_some(Verdict::Pass))
}

/// Bad hints lead to the same bracketed value.
pub(super) fn bad_hint(seed: u64, method: Method) -> Put {
    if method != Method::Warm {
        return Ok(None);
    }
    let (pair, sources) = placement::bad_hints(seed, &mut random(118, seed));
    let options = Options::default();
    let cold = pair.solve(&options, &mut WarmStart::default());
    let truth = pair.truth();
    for source in &sources {
        let mut hint = WarmStart::default();
        source.solve(&options, &mut hint);
        let found = pair.solve(&options, &mut hint);
        let judged = verdict(&pair, &found, &truth);
        if judged != Verdict::Pass {
            return Ok(Some(judged));
        }
        let apart = (found.lower - cold.upper).max(cold.lower - found.upper);
        if !(apart <= 0.0) {
            return Ok(Some(Verdict::Off(apart / pair.size())));
        }
    }
    Ok(Some(Verdict::Pass))
}

/// The same values; of ours also the same normals, the other way round or carried along.
pub(super) fn swapped(seed: u64, method: Method) -> Put {
    let pairs = placement::swapped(seed, &mut random(119, seed));
    put_all(pairs.into(), method, |answers, method| {
        let [(first, one), rest @ ..] = answers else { return Verdict::NoAnswer };
        let Some(value) = one.value else { return Verdict::NoAnswer };
        let turn_of_rounding = one.ours.map_or(0.0, |ours| first.turn_of_rounding(&first.reference(&ours)));
        for (k, (pair, answer)) in rest.iter().enumerate() {
            let Some(found) = answer.value else { return Verdict::NoAnswer };
            let off = (found - value).abs() - pair.rounding();
            if !(off <= 2.0 * slack(first, method)) {
                return Verdict::Off(off / first.size());
            }
            let normal = |answer: &PairAnswer| answer.ours.and_then(|ours| ours.normal);
            let (Some(n), Some(m)) = (normal(one), normal(answer)) else { continue };
            let turn = pair.pose_a.rotation() * first.pose_a.rotation().inverse();
            let back = if k == 0 { -m } else { turn.inverse_transform_vector(&m) };
            if !((n - back).norm() <= 2.0 * (NORMAL + turn_of_rounding)) {
                return Verdict::Off((n - back).norm());
            }
        }
        Verdict::Pass
    })
}

/// Boxes or cylinders that mirror each other and a shape between them: tied in the mirror plane,
/// not beside it, and flagged wherever the normal jumps.
pub(super) fn ties(seed: u64, method: Method) -> Put {
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(None);
    }
    let mut random = random(121, seed);
    let turn = if (seed / 8).is_multiple_of(2) { nalgebra::UnitQuaternion::identity() } else { random.rotation() };
    let part = if seed.is_multiple_of(2) { b(0.5, 0.3, 0.4) } else { cylinder(0.4, 0.3) };
    let parts = [-1.0, 1.0].map(|side| {
        part.moved(&nalgebra::UnitQuaternion::identity(), &Vector3::new(side, 0.0, 0.0)).map_err(CaseError::other)
    });
    let [left, right] = parts;
    let both = Compound::new("both", vec![left?, right?]).map_err(CaseError::other)?;
    let kind = seed / 2 % 4;
    Ok(Some(mirrored(&both, kind, &turn, &mut random, method)?))
}

/// See [`ties`]: a capsule, a point, a box, or a half-space that tilts.
fn mirrored(
    both: &Compound,
    kind: u64,
    turn: &nalgebra::UnitQuaternion<f64>,
    random: &mut Random,
    method: Method,
) -> Result<Verdict, CaseError> {
    let still = sublevel_testkit::random::pose(Vector3::zeros(), turn);
    let (options, third, limb) = (Options::default(), b(0.3, 0.4, 0.2), placement::limb());
    let solve = |aside: f64, warm: &mut WarmStart| -> ties::Flagged {
        let place = turn * ties::Parts::passing(aside);
        let pose_b = sublevel_testkit::random::pose(place, turn);
        match kind {
            0 => {
                let found = distance_to_capsule(both, &still, &limb, &pose_b, &options, warm);
                (found.tied, found.normal.unwrap_or_default())
            }
            1 => match distance_to_point(both, &still, &place, &options, warm) {
                Ok(found) => (found.tied, found.normal.unwrap_or_default()),
                Err(_) => (false, Vector3::repeat(f64::NAN)),
            },
            2 => {
                let found = distance(both, &still, &third, &pose_b, &options, warm);
                (found.tied, found.normal.unwrap_or_default())
            }
            _ => {
                // The side of the lower part, whose witness it is, stands for the normal.
                let n = turn * Vector3::new(aside, 0.0, 1.0).normalize();
                let Ok(plane) = HalfSpace::new(n, -3.0) else { return (false, Vector3::repeat(f64::NAN)) };
                let found = distance_to_half_space(both, &still, &plane, &options, warm);
                (found.tied, Vector3::x() * turn.inverse_transform_vector(&found.witness).x.signum())
            }
        }
    };
    let mut warm = WarmStart::default();
    for (aside, expected) in [(0.0, true), (0.1, false)] {
        if method == Method::Warm {
            solve(aside - 0.02, &mut warm);
        }
        let (tied, _) = solve(aside, &mut warm);
        if tied != expected {
            return Ok(Verdict::WrongStatus(format!("tied: {tied}, {aside} beside the mirror plane, kind {kind}")));
        }
    }
    let (low, high) = (-random.between(1e-3, 1.0), random.between(1e-3, 1.0));
    let jumps = ties::follow(method == Method::Cold, |t, warm| solve(low + (high - low) * t, warm));
    Ok(match jumps.unflagged {
        Some(t) => Verdict::WrongStatus(format!("the nearest part changes without a flag at {t}, kind {kind}")),
        None => Verdict::Pass,
    })
}

/// The first seed is what must be refused, all others are shapes that are all but degenerate.
pub(super) fn ill_conditioned(seed: u64, method: Method) -> Put {
    if seed == 0 {
        let wrong = data::attempts().into_iter().find(|attempt| !attempt.is_right());
        let verdict = wrong.map_or(Verdict::Pass, |wrong| {
            Verdict::WrongStatus(format!("{}: refused: {:?}", wrong.what, wrong.refused))
        });
        return Ok((method == Method::Cold).then_some(verdict));
    }
    put(&data::extreme(seed, &mut random(125, seed)), method)
}

/// The level distance among balls, boxes, cylinders and what slabs cut, and over them; what is none
/// of bodies has none.
pub(super) fn saturation(seed: u64, method: Method) -> Put {
    static ZOO: OnceLock<Vec<Body>> = OnceLock::new();
    let zoo = ZOO.get_or_init(|| {
        vec![
            e(0.6, 0.6, 0.6),
            b(0.6, 0.9, 0.3),
            cylinder(0.5, 0.8),
            e(1.0, 0.7, 0.4),
            q(8, 0.8, 0.5, 1.1),
            cut(0.8, 0.5, 1.1),
        ]
    });
    saturation_of(zoo, &mut random(127, seed), method)
}
