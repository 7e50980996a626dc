//! Where gradients jump: 21.

use super::super::case::{CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{b, e, q};
use super::random;
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::{Body, Compound};
use sublevel::measure::{Options, Pose, WarmStart, distance, signed_distance};

/// Normals that differ by this much have jumped.
const JUMP: f64 = 0.3;

/// Steps along a line on which jumps are looked for, and the share of the line to which one is
/// narrowed down without a flag.
const STEPS: u32 = 20;
/// See [`STEPS`].
const NARROW: f64 = 1e-12;

/// Whether an answer flags a tie, and its normal.
type Flagged = (bool, Vector3<f64>);

/// Answers along a line from 0 to 1.
type Line<'a> = &'a dyn Fn(f64, &mut WarmStart) -> Result<Flagged, CaseError>;

/// Two ways out of a symmetric overlap, two parts as near as each other: flagged there, and
/// wherever the normal jumps.
pub(super) fn ties(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(None);
    }
    let mut random = random(21, seed);
    // Turned by nothing, ties are exact.
    let turn = if seed.is_multiple_of(2) { UnitQuaternion::identity() } else { random.rotation() };
    let put = if (seed / 2).is_multiple_of(2) { ways_out } else { pairs };
    put(&mut random, &turn, method).map(Some)
}

/// A small body inside of a host, both turned alike: tied at the common centre, and across mirror
/// planes.
fn ways_out(random: &mut Random, turn: &UnitQuaternion<f64>, method: Method) -> Result<Verdict, CaseError> {
    let inner = [e(0.2, 0.2, 0.2)?, q(4, 0.3, 0.2, 0.25)?, b(0.3, 0.2, 0.25)?, q(8, 0.2, 0.3, 0.2)?];
    let hosts = [b(1.0, 1.0, 1.0)?, b(1.0, 0.5, 2.0)?, q(8, 1.0, 1.0, 1.0)?, e(1.0, 1.0, 1.5)?, q(4, 1.0, 0.5, 1.0)?];
    let (a, host) = (&inner[random.index(4)], &hosts[random.index(5)]);
    let still = pose(Vector3::zeros(), turn)?;
    let options = Options::default().with_depth_accuracy([1e-3, 1e-5][random.index(2)])?;
    let solve = |place: Vector3<f64>, warm: &mut WarmStart| -> Result<Flagged, CaseError> {
        let found = signed_distance(a, &pose(turn * place, turn)?, host, &still, &options, warm);
        // Without a normal it jumps from whatever was before.
        Ok((found.tied, found.normal.unwrap_or_default()))
    };
    let mut warm = WarmStart::default();
    if method == Method::Warm {
        solve(Vector3::new(0.01, 0.02, -0.01), &mut warm)?;
    }
    if !solve(Vector3::zeros(), &mut warm)?.0 {
        return Ok(Verdict::WrongStatus(format!("{}-{}, concentric, not flagged", a.name(), host.name())));
    }
    let from = Vector3::from_fn(|_, _| 0.3 * random.signed());
    let mirrored = Vector3::new(-from.x, from.y, from.z);
    let axis = random.index(3);
    // Across a diagonal, to where another way out is the shortest.
    let other = Vector3::from_fn(|i, _| if i == axis { 0.35 } else { 0.05 * random.signed() });
    for to in [mirrored, other] {
        let line = |t: f64, warm: &mut WarmStart| solve(from + (to - from) * t, warm);
        if let Some(t) = unflagged_jump(&line, method)? {
            let what = format!("{}-{}, the normal jumps without a flag at {t}", a.name(), host.name());
            return Ok(Verdict::WrongStatus(what));
        }
    }
    Ok(Verdict::Pass)
}

/// The least distance over pairs: mirror images on both sides, the third body in the mirror plane
/// or beside it.
fn pairs(random: &mut Random, turn: &UnitQuaternion<f64>, method: Method) -> Result<Verdict, CaseError> {
    let part = if random.index(2) == 0 { e(0.5, 0.3, 0.4)? } else { q(4, 0.4, 0.5, 0.3)? };
    let place = |side: f64| part.moved(&UnitQuaternion::identity(), &Vector3::x().scale(side));
    let parts: Vec<Body> = [-1.0, 1.0].into_iter().map(place).collect::<Result<_, _>>().map_err(CaseError::other)?;
    let both = Compound::new("both", parts).map_err(CaseError::other)?;
    let third = e(0.6, 0.5, 0.4)?;
    let still = pose(Vector3::zeros(), turn)?;
    let options = Options::default();
    let solve = |aside: f64, warm: &mut WarmStart| -> Result<Flagged, CaseError> {
        let pose_b: Pose = pose(turn * Vector3::new(aside, 2.0, 0.3), turn)?;
        let found = distance(&both, &still, &third, &pose_b, &options, warm);
        Ok((found.tied, found.normal.unwrap_or_default()))
    };
    let mut warm = WarmStart::default();
    for (aside, expected) in [(0.0, true), (0.1, false)] {
        if method == Method::Warm {
            solve(aside - 0.02, &mut warm)?;
        }
        let (tied, _) = solve(aside, &mut warm)?;
        if tied != expected {
            return Ok(Verdict::WrongStatus(format!("tied: {tied}, {aside} m beside the mirror plane")));
        }
    }
    let (low, high) = (-random.between(1e-3, 1.0), random.between(1e-3, 1.0));
    let line = |t: f64, warm: &mut WarmStart| solve(low + (high - low) * t, warm);
    Ok(match unflagged_jump(&line, method)? {
        Some(t) => Verdict::WrongStatus(format!("the nearest part changes without a flag at {t}")),
        None => Verdict::Pass,
    })
}

/// Follows a line in small steps, warm ones with the hint of the step before, and narrows down each
/// jump of the normal until a flag is met; where none is.
fn unflagged_jump(line: Line<'_>, method: Method) -> Result<Option<f64>, CaseError> {
    let jumped = |p: &Flagged, q: &Flagged| !p.0 && !q.0 && (p.1 - q.1).norm() > JUMP;
    let mut warm = WarmStart::default();
    let mut last = (0.0, line(0.0, &mut warm)?);
    for k in 1..=STEPS {
        let t = f64::from(k) / f64::from(STEPS);
        if method == Method::Cold {
            warm = WarmStart::default();
        }
        let found = (t, line(t, &mut warm)?);
        let (mut low, mut high) = (last, found);
        while jumped(&low.1, &high.1) {
            let middle = 0.5 * (low.0 + high.0);
            if high.0 - low.0 <= NARROW {
                return Ok(Some(middle));
            }
            let between = (middle, line(middle, &mut WarmStart::default())?);
            *(if jumped(&low.1, &between.1) { &mut high } else { &mut low }) = between;
        }
        last = found;
    }
    Ok(None)
}
