//! Where gradients jump: 21.

use super::super::method::Method;
use super::super::question::{CaseError, Verdict};
use super::draws::random;
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::measure::{Options, WarmStart, distance, signed_distance};
use sublevel_testkit::catalogue::ties::{self, Flagged, Parts, follow};
use sublevel_testkit::random::pose;

/// Two ways out of a symmetric overlap, two parts as near as each other: flagged there, and
/// wherever the normal jumps.
pub(super) fn ties(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(None);
    }
    let mut random = random(21, seed);
    let turn = if seed.is_multiple_of(2) { UnitQuaternion::identity() } else { random.rotation() };
    let put = if (seed / 2).is_multiple_of(2) { ways_out } else { pairs };
    put(&mut random, &turn, method).map(Some)
}

/// Of a small body inside of a host.
fn ways_out(random: &mut Random, turn: &UnitQuaternion<f64>, method: Method) -> Result<Verdict, CaseError> {
    let case = ties::ways_out(turn, random);
    let names = format!("{}-{}", case.inner.name(), case.host.name());
    let options = Options::default().with_depth_accuracy(case.depth_accuracy)?;
    let solve = |center: &Vector3<f64>, warm: &mut WarmStart| -> Flagged {
        let found = signed_distance(&case.inner, &case.place(center), &case.host, &case.still(), &options, warm);
        // Without a normal it jumps from whatever was before.
        (found.tied, found.normal.unwrap_or_default())
    };
    let mut warm = WarmStart::default();
    if method == Method::Warm {
        solve(&Vector3::new(0.01, 0.02, -0.01), &mut warm);
    }
    if !solve(&Vector3::zeros(), &mut warm).0 {
        return Ok(Verdict::WrongStatus(format!("{names}, concentric, not flagged")));
    }
    for [from, to] in &case.lines {
        let jumps = follow(method == Method::Cold, |t, warm| solve(&(from + (to - from) * t), warm));
        if let Some(t) = jumps.unflagged {
            return Ok(Verdict::WrongStatus(format!("{names}, the normal jumps without a flag at {t}")));
        }
    }
    Ok(Verdict::Pass)
}

/// The least distance over pairs: mirror images on both sides, the third body in the mirror plane
/// or beside it.
fn pairs(random: &mut Random, turn: &UnitQuaternion<f64>, method: Method) -> Result<Verdict, CaseError> {
    let Parts { both, third, .. } = ties::mirrored_parts(random);
    let still = pose(Vector3::zeros(), turn);
    let options = Options::default();
    let solve = |aside: f64, warm: &mut WarmStart| -> Flagged {
        let pose_b = pose(turn * Parts::passing(aside), turn);
        let found = distance(&both, &still, &third, &pose_b, &options, warm);
        (found.tied, found.normal.unwrap_or_default())
    };
    let mut warm = WarmStart::default();
    for (aside, expected) in [(0.0, true), (0.1, false)] {
        if method == Method::Warm {
            solve(aside - 0.02, &mut warm);
        }
        let (tied, _) = solve(aside, &mut warm);
        if tied != expected {
            return Ok(Verdict::WrongStatus(format!("tied: {tied}, {aside} m beside the mirror plane")));
        }
    }
    let (low, high) = (-random.between(1e-3, 1.0), random.between(1e-3, 1.0));
    let jumps = follow(method == Method::Cold, |t, warm| solve(low + (high - low) * t, warm));
    Ok(match jumps.unflagged {
        Some(t) => Verdict::WrongStatus(format!("the nearest part changes without a flag at {t}")),
        None => Verdict::Pass,
    })
}
