//! Limits and hints: 2, 18.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{q, zoo};
use super::{any, random, shifted, somewhere};
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use std::f64::consts::PI;
use sublevel::body::Body;
use sublevel::measure::{Distance, Options, Pose, Status, WarmStart, distance, level_distance};

fn pair(random: &mut Random) -> Result<(&'static Body, &'static Body, f64), CaseError> {
    let (a, b) = (any(random, zoo()?), any(random, zoo()?));
    Ok((a, b, a.circumscribed().radius + b.circumscribed().radius))
}

/// Not enough iterations: the bracket holds the truth all the same, and the status says.
pub(super) fn few_iterations(seed: u64) -> Result<Case, CaseError> {
    let mut random = random(2, seed);
    let (a, b, sum) = pair(&mut random)?;
    let reach = sum * random.between(0.2, 4.0);
    let (pose_a, pose_b) = (somewhere(&mut random, 0.2)?, somewhere(&mut random, reach)?);
    let limit = (seed % 3) as u32 + 1;
    Ok(Case { limit: Some(limit), ..Case::new(a, pose_a, b, pose_b, format!("limit {limit}")) })
}

/// Hints of other poses, other pairs, swapped ones, from beyond floating point: the same bracketed
/// value.
pub(super) fn bad_hint(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if method != Method::Warm {
        return Ok(None);
    }
    let mut random = random(18, seed);
    let (a, b, sum) = pair(&mut random)?;
    let (other_a, other_b, _) = pair(&mut random)?;
    let reach = sum * random.between(0.3, 3.0);
    let (pose_a, pose_b) = (somewhere(&mut random, 0.2)?, somewhere(&mut random, reach)?);
    let options = Options::default();
    let solve = |hint: &mut WarmStart| distance(a, &pose_a, b, &pose_b, &options, hint);
    let cold = solve(&mut WarmStart::default());
    let half_turn = UnitQuaternion::from_scaled_axis(random.direction() * PI);
    let tiny = q(8, 1e-24, 1e-24, 1e-24)?;
    let nowhere = pose(Vector3::new(1e15, -1e15, 1e15), &UnitQuaternion::identity())?;
    let origin = Pose::identity();
    let sources = [
        (a, pose_a, b, shifted(&pose_b, random.direction() * 0.01 * sum)?),
        (other_a, pose_a, other_b, pose_b),
        (b, pose_b, a, pose_a),
        (a, pose_a, b, pose(-pose_b.translation(), &(half_turn * pose_b.rotation()))?),
        (a, pose_a, b, pose_a),
        // Overflow fills a hint with what floating point has to offer.
        (&tiny, origin, &tiny, nowhere),
        (&tiny, origin, a, nowhere),
        (a, origin, &tiny, nowhere),
    ];
    let case = Case::new(a, pose_a, b, pose_b, "hints".into());
    for (p, pose_p, q, pose_q) in sources {
        let mut hint = WarmStart::default();
        distance(p, &pose_p, q, &pose_q, &options, &mut hint);
        let mut level_hint = WarmStart::default();
        level_distance(p, &pose_p, q, &pose_q, &options, &mut level_hint);
        for mut hint in [hint, level_hint] {
            let Distance { status, lower, upper, .. } = solve(&mut hint);
            if status != Status::Converged {
                return Ok(Some(Verdict::WrongStatus(format!("still wide, {:e} m", upper - lower))));
            }
            let apart = (lower - cold.upper).max(cold.lower - upper);
            if !(apart <= 0.0) {
                return Ok(Some(Verdict::Off(apart / case.small())));
            }
        }
    }
    Ok(Some(Verdict::Pass))
}
