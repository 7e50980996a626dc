//! Touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Answer, Method, pose};
use super::super::zoo::{c, e, p, q};
use super::derivatives::both_sides;
use super::{at, moved_to, permuted_index, random, somewhere};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::Body;
use sublevel::measure::{DEFAULT_ACCURACY, Pose, Status};

/// Normals may be off by about this.
const NORMAL: f64 = 1e-6;

/// Neighbouring gaps of a case of kissing contact; the last one is the first of the next case.
const RUN: usize = 4;

/// Runs that go through all 31 gaps.
const RUNS: u64 = 10;

/// Coaxial, along one of the axes, at gaps that follow each other from a centimetre of overlap to a
/// centimetre apart, over an ulp of the offset and none.
pub(super) fn kissing(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(1, seed);
    let all = 12 * RUNS;
    let index = permuted_index(seed, all);
    let (axis, first) = ((index / 4 % 3) as usize, (index / 12) as usize * (RUN - 1));
    let ball = [0.5; 3];
    // Beyond the first round of all settings with other sizes.
    let mut size = |usual: f64| if seed < all { usual } else { usual * random.between(0.5, 2.0) };
    let mut sizes = |usual: [f64; 3]| usual.map(&mut size);
    let (degree, halves_a, halves_b) = match index % 4 {
        0 => (2, ball, sizes([1.0, 0.25, 2.0])),
        1 => (2, sizes([1.0, 0.25, 2.0]), ball),
        2 => (8, sizes([1.0, 0.5, 0.25]), sizes([0.5, 2.0, 1.0])),
        _ => (8, sizes([0.25, 1.0, 1.0]), sizes([0.25, 0.5, 0.125])),
    };
    let make = |[x, y, z]: [f64; 3]| if degree == 2 { e(x, y, z) } else { q(degree, x, y, z) };
    let (a, b) = (make(halves_a)?, make(halves_b)?);
    let offset = halves_a[axis] + halves_b[axis];
    let ulp = offset.next_up() - offset;
    let mut gaps: Vec<f64> = (2..=15).map(|k| 10_f64.powi(-k)).chain([ulp]).flat_map(|gap| [-gap, gap]).collect();
    gaps.push(0.0);
    gaps.sort_by(f64::total_cmp);
    let case = |gap: &f64| {
        let place = at(Vector3::ith(axis, offset + gap))?;
        // The offset is rounded; what it is past the half-axes is exact.
        let exact = (place.translation()[axis] - offset).max(0.0);
        let case = Case::new(&a, Pose::identity(), &b, place, format!("along axis {axis}, gap {gap:e} m"));
        Ok(Case { accuracy: 1e-13, exact: Some(exact), bound: Some(1e-12), floor: 1e-12, ..case })
    };
    gaps[first..first + RUN].iter().map(case).collect()
}

/// From gap to gap no value falls, and no normal leaves the axis.
pub(super) fn rising(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let mut last = f64::NEG_INFINITY;
    for (case, said) in answers {
        let Some(value) = said.value else { return Ok(Verdict::NoAnswer) };
        let offset = case.pose_b.translation();
        let slack = if method.is_ours() { 4.0 * f64::EPSILON * offset.norm() } else { 2.0 * case.slack(method) };
        if !(value >= last - slack) {
            return Ok(Verdict::Off((last - value) / case.small()));
        }
        last = value;
        let Some(answer) = &said.answer else { continue };
        match answer.normal {
            // From the second body to the first.
            Some(n) => {
                let angle = (n + offset.normalize()).norm();
                if !(angle <= NORMAL) {
                    return Ok(Verdict::Off(angle));
                }
            }
            None if answer.lower > 0.0 => return Ok(Verdict::NoAnswer),
            None => {}
        }
    }
    Ok(Verdict::Pass)
}

/// Faces of degree 8, gap 1e-3 to 1e-12, tilt 1e-9 to 1e-3 rad.
pub(super) fn parallel_faces(seed: u64) -> Result<Case, CaseError> {
    let seed = permuted_index(seed, 80);
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

/// Touching pairs: the height along the normal is the distance up to what a deviation of [`NORMAL`]
/// costs; and without a gap, on both sides of contact, the signed distance has the slopes that it
/// says.
pub(super) fn normal(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let mut random = random(8, seed);
    let zoo = [e(1.0, 0.6, 0.8)?, q(4, 0.5, 0.7, 0.9)?, c(4, 0.6, 0.4)?, p(6, 0.7)?, q(6, 0.3, 1.0, 0.6)?];
    let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
    let gap = [1e-3, 1e-6, 1e-9, 1e-12, 0.0][(seed % 5) as usize];
    let apart = Case::new(a, somewhere(&mut random, 0.3)?, b, somewhere(&mut random, 4.0)?, format!("gap {gap:e} m"));
    let case = moved_to(Case { accuracy: 1e-13, floor: 1e-12, ..apart }, gap)?;
    let Some(proposal) = case.proposed(method)? else { return Ok(None) };
    let truth = case.truth(std::slice::from_ref(&proposal))?;
    let between = || proposal.points.and_then(|[x, y]| (x - y).try_normalize(0.0));
    if let Some(n) = proposal.normal.or_else(between) {
        let lost = truth.upper - case.height_at(&n, &proposal) - truth.floor;
        // Turned by an angle, the height falls by half its square times the bodies' curvature
        // radii, or less.
        let allowed = 8.0 * NORMAL * NORMAL * case.large();
        if !(lost <= allowed) {
            return Ok(Some(Verdict::Off((lost / case.large() / 8.0).sqrt())));
        }
    } else if truth.lower > 2.0 * truth.floor {
        // Nothing has to be said of a gap that may be none.
        return Ok(Some(Verdict::NoAnswer));
    }
    // Batches, and others, answer with distances alone, which have no slopes in overlap.
    if gap > 0.0 || !matches!(method, Method::Cold | Method::Warm) {
        return Ok(Some(Verdict::Pass));
    }
    both_sides(&Case { accuracy: DEFAULT_ACCURACY, ..case }, method).map(Some)
}

/// Flats of degree 8 a tenth apart: the error falls to the stated floor, beyond it the status says.
pub(super) fn tight(seed: u64) -> Result<Case, CaseError> {
    let seed = permuted_index(seed, 189);
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
    let seed = permuted_index(seed, 192);
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

/// 20 cm, 2 mm apart or into each other, anywhere or along an axis: error of at most 1e-10 m.
pub(super) fn smooth(seed: u64) -> Result<Vec<Case>, CaseError> {
    let mut random = random(15, seed);
    let (a, b, halves) = match seed % 4 {
        0 => (e(0.2, 0.15, 0.1)?, e(0.1, 0.2, 0.12)?, 0.2 + 0.1),
        1 => (c(4, 0.1, 0.2)?, e(0.2, 0.1, 0.15)?, 0.1 + 0.2),
        2 => (q(4, 0.2, 0.1, 0.15)?, q(4, 0.1, 0.2, 0.2)?, 0.2 + 0.1),
        _ => (e(0.2, 0.2, 0.2)?, e(0.1, 0.2, 0.12)?, 0.2 + 0.1),
    };
    let gap = if (seed / 4).is_multiple_of(2) { GRAZE } else { -GRAZE };
    let (pose_a, far) = (somewhere(&mut random, 0.1)?, somewhere(&mut random, 1.0)?);
    if (seed / 8).is_multiple_of(4) {
        let place = pose(pose_a.transform_point(&(Vector3::x() * (halves + gap))), pose_a.rotation())?;
        let case = Case::new(&a, pose_a, &b, place, format!("along an axis, gap {gap:e} m"));
        // Coordinates are rounded, far less than the error that is allowed.
        return Ok(vec![Case {
            accuracy: SMOOTH / case.small(),
            exact: Some(gap.max(0.0)),
            bound: Some(SMOOTH),
            ..case
        }]);
    }
    let apart = Case::new(&a, pose_a, &b, far, format!("gap {gap:e} m"));
    // That is where they stand.
    let placed = moved_to(Case { accuracy: 1e-13, ..apart }, gap)?;
    Ok(vec![Case { accuracy: SMOOTH / placed.small(), bound: Some(SMOOTH), ..placed }])
}

/// Error of smooth shapes that is allowed, and their accuracy that is asked for, metres.
const SMOOTH: f64 = 1e-10;

/// Gap and depth of smooth shapes, metres.
const GRAZE: f64 = 2e-3;

/// The same of the depth: signed distances say it on both sides.
pub(super) fn deep(answers: &[(Case, Answer)], method: Method) -> Result<Verdict, CaseError> {
    let [(case, said)] = answers else { return Ok(Verdict::Pass) };
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(Verdict::Pass);
    }
    let truth = if said.value > Some(0.5 * GRAZE) { GRAZE } else { -GRAZE };
    let answer = case.signed(method)?;
    let error = (answer.value() - truth).abs();
    if answer.tied || answer.status != Status::Converged {
        return Ok(Verdict::WrongStatus(format!("{:?}, tied: {}", answer.status, answer.tied)));
    }
    Ok(if error <= SMOOTH { Verdict::Pass } else { Verdict::Off(error / case.small()) })
}
