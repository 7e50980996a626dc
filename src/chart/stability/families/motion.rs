//! Time of impact: 22.

use super::super::case::{CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{b, e};
use super::random;
use crate::chart::duel::parry_impact;
use crate::measure::{ImpactOptions, ImpactStatus, Motion, time_of_impact};
use nalgebra::Vector3;

/// Contact distance of our searches, relative to the smaller body.
const CONTACT: f64 = 1e-6;

/// How much too late or early others may be, relative to the time.
const PEER_ERROR: f64 = 1e-4;

/// A blade strikes a ball where the ball's distance from the axis times the sine of the angle between them is the sum of half the
/// blade's thickness and the ball's radius.
pub(super) fn blade(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Parry) {
        return Ok(None);
    }
    let mut random = random(22, seed);
    let (thin, radius) = (random.between(1e-3, 0.05), random.between(1e-3, 0.1));
    let half = Vector3::new(2.0, thin, if seed.is_multiple_of(2) { 0.1 } else { 1.0 });
    let (place, rate) = (1.0 + 0.8 * random.positive(), random.between(1e-2, 1e3));
    let strike = ((thin + radius) / place).asin();
    let turn = strike + [1e-7, 1e-3, 0.3, 2.8][(seed / 2 % 4) as usize];
    let far = random.direction() * [0.0, 1.0, 1e3][random.index(3)];
    let frame = random.rotation();
    let ahead = Vector3::new(place * turn.cos(), place * turn.sin(), 0.05 * random.signed());
    let (start, still) = (pose(far, &frame)?, pose(far + frame * ahead, &frame)?);
    let spin = frame * Vector3::new(0.0, 0.0, rate);
    let (truth, duration) = ((turn - strike) / rate, 9.0 / rate);
    if method == Method::Parry {
        let found = parry_impact(&half, &start, &spin, radius, &still, duration);
        let allowed = PEER_ERROR * (turn / rate);
        return Ok(Some(match found {
            None => Verdict::NoAnswer,
            Some(time) if (time - truth).abs() <= allowed => Verdict::Pass,
            Some(time) => Verdict::Off((time - truth).abs() * rate / turn),
        }));
    }
    let other = |error: &dyn std::error::Error| CaseError::Other(error.to_string());
    let motion = Motion::new(start, Vector3::zeros(), spin, far).map_err(|error| other(&error))?;
    let options = ImpactOptions::new(duration).and_then(|options| options.with_contact(CONTACT));
    let options = options.map_err(|error| other(&error))?;
    let (blade, ball) = (b(half.x, half.y, half.z)?, e(radius, radius, radius)?);
    let found = time_of_impact(&blade, &motion, &ball, &Motion::still(still), &options);
    if found.status != ImpactStatus::Contact {
        return Ok(Some(Verdict::WrongStatus(format!("{:?}", found.status))));
    }
    // Where the blade really is at a time is rounded by as much as its pose.
    let rounding = 1e-13 * (1.0 + far.norm()) / (place * rate);
    let early = 2.0 * CONTACT * radius.min(2.0) / (place * strike.cos() * rate);
    let off = (found.time - truth).max(truth - early - found.time) - rounding;
    Ok(Some(if off <= 0.0 { Verdict::Pass } else { Verdict::Off(off * rate / turn) }))
}
