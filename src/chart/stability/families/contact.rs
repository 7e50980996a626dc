//! Touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{c, e, p, q};
use super::{at, moved_to, random, somewhere, strewn};
use crate::body::Body;
use crate::measure::Pose;
use nalgebra::{UnitQuaternion, Vector3};

/// Normals may be off by about this.
const NORMAL: f64 = 1e-6;

/// Coaxial, gaps of both signs from none to an ulp of the offset to a centimetre.
pub(super) fn kissing(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(1, seed);
    let (a, b) = match random.index(4) {
        0 => (e(0.5, 0.5, 0.5)?, e(1.0, 0.25, 2.0)?),
        1 => (e(1.0, 0.25, 2.0)?, e(0.5, 0.5, 0.5)?),
        2 => (q(8, 1.0, 0.5, 0.25)?, q(8, 0.5, 2.0, 1.0)?),
        _ => (q(8, 0.25, 1.0, 1.0)?, q(8, 0.25, 0.5, 0.125)?),
    };
    let axis = random.index(3);
    let half = |body: &Body| 1.0 / body.normalization().linear[(axis, axis)];
    let offset = half(&a) + half(&b);
    let sign = if random.index(2) == 0 { 1.0 } else { -1.0 };
    let gap = sign
        * match random.index(16) {
            0 => 0.0,
            1 => offset.next_up() - offset,
            k => 10_f64.powi(-(k as i32)),
        };
    let place = at(Vector3::ith(axis, offset + gap))?;
    // The offset is rounded; what it is past the half-axes is exact.
    let exact = (place.translation()[axis] - offset).max(0.0);
    let case = Case::new(&a, Pose::identity(), &b, place, format!("along axis {axis}, gap {gap:e} m"));
    Ok(Case { accuracy: 1e-13, exact: Some(exact), bound: Some(1e-12), floor: 1e-12, ..case })
}

/// Faces of degree 8, gap 1e-3 to 1e-12, tilt 1e-9 to 1e-3 rad.
pub(super) fn parallel_faces(seed: u64) -> Result<Case, CaseError> {
    let seed = strewn(seed, 80);
    let (a, b) = (q(8, 1.0, 1.0, 0.5)?, q(8, 0.75, 1.25, 0.5)?);
    let gap = 10_f64.powi(-3 - (seed % 10) as i32);
    let tilt = match seed / 10 % 8 {
        0 => 0.0,
        k => 10_f64.powi(-10 + k as i32),
    };
    let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, 0.8 * tilt, 0.0));
    let place = pose(Vector3::new(0.0, 0.0, 1.0 + gap), &tilted)?;
    Ok(Case::new(&a, Pose::identity(), &b, place, format!("gap {gap:e} m, tilt {tilt:e} rad")))
}

/// Touching pairs: the height along the normal is the distance up to what a deviation of [`NORMAL`] costs.
pub(super) fn normal(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let mut random = random(8, seed);
    let zoo = [e(1.0, 0.6, 0.8)?, q(4, 0.5, 0.7, 0.9)?, c(4, 0.6, 0.4)?, p(6, 0.7)?, q(6, 0.3, 1.0, 0.6)?];
    let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
    let gap = [1e-3, 1e-6, 1e-9, 1e-12][(seed % 4) as usize];
    let apart = Case::new(a, somewhere(&mut random, 0.3)?, b, somewhere(&mut random, 4.0)?, format!("gap {gap:e} m"));
    let case = Case { accuracy: 1e-13, floor: 1e-12, ..moved_to(apart, gap)? };
    let Some(proposal) = case.proposed(method)? else { return Ok(None) };
    let truth = case.truth(std::slice::from_ref(&proposal))?;
    let between = || proposal.points.and_then(|[x, y]| (x - y).try_normalize(0.0));
    let Some(n) = proposal.normal.or_else(between) else {
        // Nothing has to be said of a gap that may be none.
        return Ok(Some(if truth.lower <= 2.0 * truth.floor { Verdict::Pass } else { Verdict::NoAnswer }));
    };
    let lost = truth.upper - case.height_at(&n, &proposal) - truth.floor;
    // Turned by an angle, the height falls by half its square times the bodies' curvature radii, or less.
    let allowed = 8.0 * NORMAL * NORMAL * case.large();
    Ok(Some(if lost <= allowed { Verdict::Pass } else { Verdict::Off((lost / case.large() / 8.0).sqrt()) }))
}

/// Flats of degree 8 a tenth apart: the error falls to the stated floor, beyond it the status tells.
pub(super) fn tight(seed: u64) -> Result<Case, CaseError> {
    let seed = strewn(seed, 189);
    let (a, b) = match seed % 3 {
        0 => (q(8, 1.0, 1.0, 0.5)?, q(8, 0.75, 1.25, 0.5)?),
        1 => (q(8, 1.0, 1.0, 0.5)?, p(8, 0.5)?),
        _ => (p(8, 1.0)?, p(8, 1.0)?),
    };
    let tilt = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2][(seed / 3 % 7) as usize];
    let accuracy = 10_f64.powi(-[4, 6, 8, 9, 10, 11, 12, 13, 14][(seed / 21 % 9) as usize]);
    let height = |body: &Body| body.boundary_along(&Vector3::z()).z;
    let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, -0.8 * tilt, 0.0));
    let place = pose(Vector3::new(0.0, 0.0, height(&a) + height(&b) + 0.1), &tilted)?;
    let case = Case::new(&a, Pose::identity(), &b, place, format!("tilt {tilt:e} rad, accuracy {accuracy:e}"));
    // The floor that `Options::with_accuracy` states for flat surfaces; a bracket has two sides.
    let floor = 1e-12 * (case.large() + 0.1);
    let wanted = accuracy * case.small();
    Ok(Case { accuracy, floor: if wanted < floor { 2.0 * floor } else { 0.0 }, bound: Some(wanted.max(floor)), ..case })
}

/// Where Newton's method converges linearly: a tip of degree 8 against a flat of degree 8.
pub(super) fn tips(seed: u64) -> Result<Case, CaseError> {
    let seed = strewn(seed, 192);
    let mut random = random(14, seed);
    let tip = match seed % 4 {
        0 => q(8, 0.1, 0.1, 1.0)?,
        1 => q(8, 0.01, 0.02, 1.0)?,
        2 => q(6, 0.05, 0.05, 1.0)?,
        _ => q(4, 0.1, 0.05, 1.0)?,
    };
    let (flat, thick) = match seed / 4 % 3 {
        0 => (q(8, 1.0, 1.0, 0.1)?, 0.1),
        1 => (q(8, 2.0, 1.0, 0.01)?, 0.01),
        _ => (q(6, 1.0, 1.0, 0.05)?, 0.05),
    };
    let gap = [1e-9, 1e-6, 1e-3, 0.3][(seed / 12 % 4) as usize];
    let aside = [0.0, 1e-6, 1e-3, 0.2][(seed / 48 % 4) as usize];
    let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * random.signed());
    let place = pose(Vector3::new(aside, -0.5 * aside, 1.0 + thick + gap), &turn)?;
    Ok(Case::new(&flat, Pose::identity(), &tip, place, format!("gap {gap:e} m, {aside:e} m aside")))
}

/// 20 cm, 2 mm apart or into each other: error of at most 1e-10 m.
pub(super) fn smooth(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(15, seed);
    let (a, b) = match seed % 3 {
        0 => (e(0.2, 0.15, 0.1)?, e(0.1, 0.2, 0.12)?),
        1 => (c(4, 0.1, 0.2)?, e(0.2, 0.1, 0.15)?),
        _ => (q(4, 0.2, 0.1, 0.15)?, q(4, 0.1, 0.2, 0.2)?),
    };
    let gap = if (seed / 3).is_multiple_of(2) { 2e-3 } else { -2e-3 };
    let apart = Case::new(&a, somewhere(&mut random, 0.1)?, &b, somewhere(&mut random, 1.0)?, format!("gap {gap:e} m"));
    Ok(Case { bound: Some(1e-10), ..moved_to(apart, gap)? })
}
