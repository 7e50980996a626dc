//! Time of impact: 22.

use super::super::method::Method;
use super::super::question::{CaseError, Verdict};
use super::draws::random;
use crate::comparison::parry_impact;
use sublevel::measure::{Impact, ImpactStatus, Motion, Options, WarmStart, distance, time_of_impact};
use sublevel_testkit::catalogue::motion::{Bullet, Meeting, Truth, blade, grazing, slab};

/// How much too late or early others may be, relative to the time.
const PEER_ERROR: f64 = 1e-4;

/// Times before an impact, evenly and closer and closer to it, at which nothing may overlap.
const SAMPLES: u32 = 100;
/// See [`SAMPLES`].
const CLOSER: u32 = 50;

/// A blade that turns, a flight through a slab, and grazing by a billionth: never later than the
/// closed form and dense sampling.
pub(super) fn impact(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Parry) {
        return Ok(None);
    }
    let (mut random, index) = (random(22, seed), seed / 3);
    let meeting = match seed % 3 {
        // Boxes that turn one way, which parry can be asked about.
        0 => blade(index % 8, &mut random),
        1 => slab(if index.is_multiple_of(2) { Bullet::BallThroughBox } else { Bullet::NoBall }, &mut random),
        _ => grazing(index.is_multiple_of(2), (index / 2).is_multiple_of(2), &mut random),
    };
    Ok(if method == Method::Cold { Some(ours(&meeting)) } else { of_parry(&meeting) })
}

/// Judges parry's time; none where it cannot be asked.
fn of_parry(meeting: &Meeting) -> Option<Verdict> {
    let (half, radius) = meeting.box_and_ball?;
    let found = parry_impact((&half, &meeting.a.1), (radius, &meeting.b.1), meeting.duration);
    Some(match (&meeting.truth, found) {
        (Truth::At { time, turn, .. }, Some(found)) => {
            let off = (found - time).abs() / turn;
            if off <= PEER_ERROR { Verdict::Pass } else { Verdict::Off(off) }
        }
        (Truth::Before(time), Some(found)) if found <= time * (1.0 + PEER_ERROR) => Verdict::Pass,
        (Truth::Before(time), Some(found)) => Verdict::Off(found / time - 1.0),
        (Truth::At { .. } | Truth::Before(_), None) => Verdict::NoAnswer,
        (Truth::Never, None) | (Truth::Sometime | Truth::Open, _) => Verdict::Pass,
        (Truth::Never, Some(found)) => Verdict::WrongStatus(format!("an impact at {found:e} s of bodies that miss")),
    })
}

/// Judges our time by the closed form and by sampling.
fn ours(meeting: &Meeting) -> Verdict {
    let motions = meeting.motions();
    let options = meeting.options();
    let found = time_of_impact(&meeting.a.0, &motions[0], &meeting.b.0, &motions[1], &options);
    let Impact { status, time, .. } = found;
    let wrong = |what: &str| Verdict::WrongStatus(format!("{status:?} at {time:e} s, {what}"));
    match meeting.truth {
        Truth::At { .. } | Truth::Sometime if status != ImpactStatus::Contact => return wrong("where they meet"),
        Truth::At { time: truth, early, rounding, turn } => {
            let off = (time - truth).max(truth - early - time) - rounding;
            if !(off <= 0.0) {
                return Verdict::Off(off / turn);
            }
        }
        Truth::Before(_) if status == ImpactStatus::Apart => return wrong("where they meet"),
        Truth::Before(latest) if !(time <= latest) => return Verdict::Off(time / latest - 1.0),
        Truth::Never if status == ImpactStatus::Contact => return wrong("where they miss"),
        Truth::Before(_) | Truth::Never | Truth::Sometime | Truth::Open => {}
    }
    late(meeting, &motions, &found).unwrap_or(Verdict::Pass)
}

/// What sampling finds: overlap before the time, or no contact at it.
fn late(meeting: &Meeting, motions: &[Motion; 2], found: &Impact) -> Option<Verdict> {
    let mut warm = WarmStart::default();
    let mut at = |t: f64| {
        let poses = motions.map(|motion| motion.pose(t));
        distance(&meeting.a.0, &poses[0], &meeting.b.0, &poses[1], &Options::default(), &mut warm)
    };
    let end = if found.status == ImpactStatus::Apart { meeting.duration } else { found.time };
    let evenly = (0..SAMPLES).map(|k| end * f64::from(k) / f64::from(SAMPLES));
    let closer = (1..=CLOSER).map(|k| end * (1.0 - 10_f64.powf(-0.3 * f64::from(k))));
    for t in evenly.chain(closer).filter(|t| *t < end) {
        if at(t).upper == 0.0 {
            return Some(Verdict::WrongStatus(format!("late: {end:e} s, overlap at {t:e} s")));
        }
    }
    let small = meeting.a.0.circumscribed().radius.min(meeting.b.0.circumscribed().radius);
    let gap = at(end).lower;
    let is_contact = found.status != ImpactStatus::Contact || gap <= 1.001 * meeting.contact * small;
    (!is_contact).then(|| Verdict::WrongStatus(format!("contact, yet {gap:e} m apart")))
}
