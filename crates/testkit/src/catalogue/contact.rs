//! Touching, flat and nearly touching bodies: 1, 3, 8, 13, 14, 15.

use super::{Case, Draws};
use crate::bodies::{c, e, p, q};
use crate::random::{at, pose};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;

/// Cases of [`kissing`]: 4 pairs along 3 axes, in 10 runs through all 31 gaps.
pub const KISSING: u64 = 120;

/// Neighbouring gaps of a case of [`kissing`]; the last one is the first of the next case.
const RUN: usize = 4;

/// Family 1. Coaxial, along one of the axes, at gaps that follow each other from a centimetre of
/// overlap to a centimetre apart, over an ulp of the offset and none. `stretch` draws factors for
/// the sizes: none leaves them as they are.
pub fn kissing(index: u64, mut stretch: Option<&mut dyn Draws>) -> Vec<Case> {
    let (axis, first) = ((index / 4 % 3) as usize, (index / 12) as usize * (RUN - 1));
    let ball = [0.5; 3];
    let mut size = |usual: f64| usual * stretch.as_mut().map_or(1.0, |random| random.between(0.5, 2.0));
    let mut sizes = |usual: [f64; 3]| usual.map(&mut size);
    let (degree, halves_a, halves_b) = match index % 4 {
        0 => (2, ball, sizes([1.0, 0.25, 2.0])),
        1 => (2, sizes([1.0, 0.25, 2.0]), ball),
        2 => (8, sizes([1.0, 0.5, 0.25]), sizes([0.5, 2.0, 1.0])),
        _ => (8, sizes([0.25, 1.0, 1.0]), sizes([0.25, 0.5, 0.125])),
    };
    let make = |[x, y, z]: [f64; 3]| if degree == 2 { e(x, y, z) } else { q(degree, x, y, z) };
    let (a, b) = (make(halves_a), make(halves_b));
    let offset = halves_a[axis] + halves_b[axis];
    let case = |gap: &f64| {
        let place = pose(Vector3::ith(axis, offset + gap), &UnitQuaternion::identity());
        // The offset is rounded; what it is past the half-axes is exact.
        let exact = (place.translation()[axis] - offset).max(0.0);
        let case = Case::new(&a, Pose::identity(), &b, place, format!("along axis {axis}, gap {gap:e} m"));
        Case { accuracy: 1e-13, exact: Some(exact), bound: Some(1e-12), floor: 1e-12, ..case }
    };
    gaps(offset)[first..first + RUN].iter().map(case).collect()
}

/// Both signs of the gaps 0, 1 ulp of the offset, and 1e-15 to 1e-2 m, in increasing order.
pub(super) fn gaps(offset: f64) -> Vec<f64> {
    let ulp = offset.next_up() - offset;
    let mut gaps: Vec<f64> = (2..=15).map(|k| 10_f64.powi(-k)).chain([ulp]).flat_map(|gap| [-gap, gap]).collect();
    gaps.push(0.0);
    gaps.sort_by(f64::total_cmp);
    gaps
}

/// Cases of [`parallel_faces`]: 10 gaps at 8 tilts.
pub const PARALLEL_FACES: u64 = 80;

/// Family 3. Faces of degree 8, gap 1e-3 to 1e-12 m, tilt none and 1e-9 to 1e-3 rad.
pub fn parallel_faces(index: u64) -> Case {
    let (a, b) = (q(8, 1.0, 1.0, 0.5), q(8, 0.75, 1.25, 0.5));
    let gap = 10_f64.powi(-3 - (index % 10) as i32);
    let tilt = match index / 10 % 8 {
        0 => 0.0,
        k => 10_f64.powi(-10 + k as i32),
    };
    let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, 0.8 * tilt, 0.0));
    let place = pose(Vector3::new(0.0, 0.0, 1.0 + gap), &tilted);
    Case::new(&a, Pose::identity(), &b, place, format!("gap {gap:e} m, tilt {tilt:e} rad"))
}

/// Gaps of [`touching`], metres.
pub const TOUCHING: [f64; 5] = [1e-3, 1e-6, 1e-9, 1e-12, 0.0];

/// Family 8. Smooth bodies moved towards each other until the gap is this, metres.
pub fn touching(gap: f64, random: &mut dyn Draws) -> Case {
    let zoo = [e(1.0, 0.6, 0.8), q(4, 0.5, 0.7, 0.9), c(4, 0.6, 0.4), p(6, 0.7), q(6, 0.3, 1.0, 0.6)];
    let (a, b) = (&zoo[random.index(zoo.len())], &zoo[random.index(zoo.len())]);
    let apart = Case::new(a, random.pose(0.3), b, random.pose(4.0), format!("gap {gap:e} m"));
    Case { accuracy: 1e-13, floor: 1e-12, ..apart }.moved_to(gap)
}

/// Cases of [`parallel_flats`]: 3 pairs at 7 tilts with 9 accuracies.
pub const PARALLEL_FLATS: u64 = 189;

/// Family 13. Flats of degree 8 a tenth apart: the error falls to the floor that
/// `Options::with_accuracy` states for flat surfaces, beyond it the status says.
pub fn parallel_flats(index: u64) -> Case {
    let (a, b) = match index % 3 {
        0 => (q(8, 1.0, 1.0, 0.5), q(8, 0.75, 1.25, 0.5)),
        1 => (q(8, 1.0, 1.0, 0.5), p(8, 0.5)),
        _ => (p(8, 1.0), p(8, 1.0)),
    };
    let tilt = [0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 1e-2][(index / 3 % 7) as usize];
    let accuracy = 10_f64.powi(-[4, 6, 8, 9, 10, 11, 12, 13, 14][(index / 21 % 9) as usize]);
    // In the direction z both kinds have a face of zero curvature, or nearly.
    let height = |body: &Body| body.boundary_along(&Vector3::z()).z;
    let tilted = UnitQuaternion::from_scaled_axis(Vector3::new(0.6 * tilt, -0.8 * tilt, 0.0));
    let place = pose(Vector3::new(0.0, 0.0, height(&a) + height(&b) + 0.1), &tilted);
    let what = format!("tilt {tilt:e} rad, accuracy {accuracy:e}");
    let case = Case::new(&a, Pose::identity(), &b, place, what);
    let floor = 1e-12 * (case.large() + 0.1);
    let wanted = accuracy * case.small();
    // A bracket has two sides.
    let wide = if wanted < floor { 2.0 * floor } else { 0.0 };
    Case { accuracy, floor: wide, bound: Some(wanted.max(floor)), ..case }
}

/// Cases of [`tips`]: 4 tips on 3 flats, at 4 gaps in 4 places.
pub const TIPS: u64 = 192;

/// Family 14. Where Newton's method converges linearly: a tip of up to degree 8 against a flat.
pub fn tips(index: u64, random: &mut dyn Draws) -> Case {
    let tip = match index % 4 {
        0 => q(8, 0.1, 0.1, 1.0),
        1 => q(8, 0.01, 0.02, 1.0),
        2 => q(6, 0.05, 0.05, 1.0),
        _ => q(4, 0.1, 0.05, 1.0),
    };
    let (flat, thick) = match index / 4 % 3 {
        0 => (q(8, 1.0, 1.0, 0.1), 0.1),
        1 => (q(8, 2.0, 1.0, 0.01), 0.01),
        _ => (q(6, 1.0, 1.0, 0.05), 0.05),
    };
    let gap = [1e-9, 1e-6, 1e-3, 0.3][(index / 12 % 4) as usize];
    let aside = [0.0, 1e-6, 1e-3, 0.2][(index / 48 % 4) as usize];
    let turn = UnitQuaternion::from_scaled_axis(Vector3::z() * random.signed());
    let place = pose(Vector3::new(aside, -0.5 * aside, 1.0 + thick + gap), &turn);
    Case::new(&flat, Pose::identity(), &tip, place, format!("gap {gap:e} m, {aside:e} m aside"))
}

/// Error of smooth shapes that is allowed, and their accuracy that is asked for, metres.
pub const SMOOTH: f64 = 1e-10;

/// Gap and depth of smooth shapes, metres.
pub const GRAZE: f64 = 2e-3;

/// Signed gap of a case of [`smooth`], metres.
pub fn smooth_gap(index: u64) -> f64 {
    if (index / 4).is_multiple_of(2) { GRAZE } else { -GRAZE }
}

/// Family 15. 20 cm, 2 mm apart or into each other, anywhere or along an axis: error of at most
/// [`SMOOTH`]. Of eight indices that follow each other each has another pair or gap; the first
/// eight of 32 are along an axis.
pub fn smooth(index: u64, random: &mut dyn Draws) -> Case {
    let (a, b, halves) = match index % 4 {
        0 => (e(0.2, 0.15, 0.1), e(0.1, 0.2, 0.12), 0.2 + 0.1),
        1 => (c(4, 0.1, 0.2), e(0.2, 0.1, 0.15), 0.1 + 0.2),
        2 => (q(4, 0.2, 0.1, 0.15), q(4, 0.1, 0.2, 0.2), 0.2 + 0.1),
        _ => (e(0.2, 0.2, 0.2), e(0.1, 0.2, 0.12), 0.2 + 0.1),
    };
    let gap = smooth_gap(index);
    let (pose_a, far) = (random.pose(0.1), random.pose(1.0));
    if (index / 8).is_multiple_of(4) {
        let place = pose(pose_a.transform_point(&(Vector3::x() * (halves + gap))), pose_a.rotation());
        let case = Case::new(&a, pose_a, &b, place, format!("along an axis, gap {gap:e} m"));
        // Coordinates are rounded, far less than the error that is allowed.
        return Case { accuracy: SMOOTH / case.small(), exact: Some(gap.max(0.0)), bound: Some(SMOOTH), ..case };
    }
    let apart = Case::new(&a, pose_a, &b, far, format!("gap {gap:e} m"));
    // That is where they stand.
    let placed = Case { accuracy: 1e-13, ..apart }.moved_to(gap);
    Case { accuracy: SMOOTH / placed.small(), bound: Some(SMOOTH), ..placed }
}

/// Family 15 in closed form, unrotated: 2 mm apart, and 2 mm into each other.
pub fn smooth_along_x() -> [Case; 2] {
    let (a, b) = (q(4, 0.25, 0.125, 0.0625), q(4, 0.125, 0.25, 0.0625));
    [0.377, 0.373].map(|offset| {
        let case = Case::new(&a, Pose::identity(), &b, at(offset, 0.0, 0.0), format!("offset {offset} m along x"));
        Case { exact: Some((offset - 0.375).max(0.0)), bound: Some(SMOOTH), ..case }
    })
}
