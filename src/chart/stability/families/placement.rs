//! Where bodies stand: far apart, overlapping, aligned, concentric, swapped: 4, 5, 6, 7, 19.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{b, c, cylinder, e, q, zoo};
use super::{any, at, random, shifted, somewhere, strewn};
use crate::body::Body;
use crate::chart::duel::Random;
use crate::measure::Pose;
use nalgebra::{UnitQuaternion, Vector3};

/// Up to a hundred sizes apart.
pub(super) fn far_apart(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(4, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let reach = (a.circumscribed().radius + b.circumscribed().radius) * random.between(0.2, 100.0);
    let (pose_a, pose_b) = (somewhere(&mut random, 1.0)?, somewhere(&mut random, reach)?);
    Ok(Case::new(a, pose_a, b, pose_b, format!("centres {reach:.3} m apart")))
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
    Ok(Case { exact: Some(0.0), ..Case::new(a, pose_a, b, pose_b, "in overlap".into()) })
}

/// Identical bodies with integer coordinates.
pub(super) fn along_an_axis(seed: u64) -> Result<Case, CaseError> {
    let seed = strewn(seed, 336);
    let body = match seed % 8 {
        0 => e(1.0, 1.0, 1.0)?,
        1 => e(2.0, 1.0, 3.0)?,
        2 => q(4, 1.0, 2.0, 3.0)?,
        3 => q(6, 2.0, 2.0, 2.0)?,
        4 => q(8, 1.0, 1.0, 4.0)?,
        5 => b(1.0, 2.0, 3.0)?,
        6 => cylinder(1.0, 2.0)?,
        _ => c(6, 1.0, 2.0)?,
    };
    let shifts = [-9.0, -5.0, -4.0, -3.0, -2.0, -1.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0, 8.0, 100.0];
    let axis = (seed / 8 % 3) as usize;
    let shift = shifts[(seed / 24 % 14) as usize];
    let place = at(Vector3::ith(axis, shift))?;
    Ok(Case::new(&body, Pose::identity(), &body, place, format!("{shift} m along axis {axis}")))
}

/// Interior points 0 to 1e-6 m from each other.
pub(super) fn concentric(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(7, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let offset = [0.0, 1e-18, 1e-17, 1e-16, 1e-15, 1e-12, 1e-9, 1e-6][(seed % 8) as usize];
    let pose_a = somewhere(&mut random, 0.0)?;
    let meet = pose_a.transform_point(a.interior_point()) - pose_a.rotation() * b.interior_point();
    let pose_b = pose(meet + random.direction() * offset, pose_a.rotation())?;
    Ok(Case { exact: Some(0.0), ..Case::new(a, pose_a, b, pose_b, format!("centres {offset:e} m apart")) })
}

/// The same answer with the arguments swapped, and with both carried along by a motion.
pub(super) fn swapped(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
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
    let first = Case::new(a, pose_a, b, pose_b, "as it is".into());
    let other = [
        Case::new(b, pose_b, a, pose_a, "swapped".into()),
        Case::new(a, carried(&pose_a)?, b, carried(&pose_b)?, "carried along".into()),
    ];
    let Some((one, accuracy)) = first.value(method)? else { return Ok(None) };
    let Some(one) = one else { return Ok(Some(Verdict::NoAnswer)) };
    let floor = 1e-14 * (sum + shift.norm() + pose_b.translation().norm());
    for case in &other {
        let Some((Some(found), _)) = case.value(method)? else { return Ok(Some(Verdict::NoAnswer)) };
        let off = (found - one).abs() - floor;
        if !(off <= 2.0 * accuracy * first.small()) {
            return Ok(Some(Verdict::Off(off / first.small())));
        }
    }
    Ok(Some(Verdict::Pass))
}
