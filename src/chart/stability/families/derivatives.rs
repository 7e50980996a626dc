//! Gradients and where they jump: 20, 21.

use super::super::case::{Case, CaseError, Verdict};
use super::super::method::{Method, pose};
use super::super::zoo::{b, e, q, zoo};
use super::{any, moved_to, random, somewhere};
use crate::body::Compound;
use crate::measure::{Options, Pose, WarmStart, distance, signed_distance};
use nalgebra::{UnitQuaternion, Vector3};

/// Largest error of a gradient, relative to its norm; that of the differences it is held against is far smaller.
const ERROR: f64 = 1e-6;

/// The gradient with respect to both poses against Richardson-extrapolated differences of tight distances.
pub(super) fn gradient(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    let mut random = random(20, seed);
    let (a, b) = (any(&mut random, zoo()?), any(&mut random, zoo()?));
    let sizes = [a.circumscribed().radius, b.circumscribed().radius];
    let small = sizes[0].min(sizes[1]);
    let gap = [10.0, 1.0, 0.3, 0.1][(seed % 4) as usize] * small;
    let far = 2.5 * (sizes[0] + sizes[1]) + gap;
    let apart = Case::new(a, somewhere(&mut random, 0.3)?, b, somewhere(&mut random, far)?, format!("gap {gap:.3} m"));
    let case = moved_to(apart, gap)?;
    let Some(proposal) = case.proposed(method)? else { return Ok(None) };
    let Some([x, y]) = proposal.points else { return Ok(Some(Verdict::NoAnswer)) };
    let Some(n) = proposal.normal.or_else(|| (x - y).try_normalize(0.0)) else { return Ok(Some(Verdict::NoAnswer)) };
    // A point at r from the translation moves by v + ω × r.
    let found =
        [(n, x - case.pose_a.translation()), (-n, y - case.pose_b.translation())].map(|(n, r)| (n, r.cross(&n)));
    let (mut off, mut norm) = (0.0, 0.0);
    for k in 0..12 {
        let (who, size) = (k / 6, if k % 6 < 3 { 1.0 } else { sizes[k / 6] });
        let along = |step: f64| -> Result<f64, CaseError> {
            let (pose_a, pose_b) = (case.pose_a, case.pose_b);
            let moved = |from: &Pose| twisted(from, k % 6, step / size);
            let (pose_a, pose_b) = if who == 0 { (moved(&pose_a)?, pose_b) } else { (pose_a, moved(&pose_b)?) };
            let tight = Options::default().with_accuracy(1e-13)?;
            Ok(distance(a, &pose_a, b, &pose_b, &tight, &mut WarmStart::default()).value())
        };
        let slope = |h: f64| Ok::<_, CaseError>((along(h)? - along(-h)?) / (2.0 * h));
        let h = 2e-3 * gap.min(small);
        // Errors of order h² and h⁴ are gone.
        let (one, two, four) = (slope(h)?, slope(h / 2.0)?, slope(h / 4.0)?);
        let [first, second] = [(4.0 * two - one) / 3.0, (4.0 * four - two) / 3.0];
        let truth = (16.0 * second - first) / 15.0;
        let part = if k % 6 < 3 { found[who].0[k % 6] } else { found[who].1[k % 6 - 3] / size };
        off += (part - truth).powi(2);
        norm += truth.powi(2);
    }
    let error = (off / norm).sqrt();
    Ok(Some(if error <= ERROR { Verdict::Pass } else { Verdict::Off(error) }))
}

/// The pose after a step along one component of a twist about its own translation.
fn twisted(from: &Pose, component: usize, step: f64) -> Result<Pose, CaseError> {
    let along = Vector3::ith(component % 3, step);
    if component < 3 {
        pose(from.translation() + along, from.rotation())
    } else {
        pose(*from.translation(), &(UnitQuaternion::from_scaled_axis(along) * from.rotation()))
    }
}

/// Two ways out of a symmetric overlap, two parts as near as each other: flagged.
pub(super) fn ties(seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
    if !matches!(method, Method::Cold | Method::Warm) {
        return Ok(None);
    }
    let mut random = random(21, seed);
    let options = Options::default();
    let turn = if seed.is_multiple_of(2) { UnitQuaternion::identity() } else { random.rotation() };
    let still = pose(Vector3::zeros(), &turn)?;
    let mut warm = WarmStart::default();
    if (seed / 2).is_multiple_of(2) {
        let inner = [e(0.2, 0.2, 0.2)?, q(4, 0.3, 0.2, 0.25)?, b(0.3, 0.2, 0.25)?, q(8, 0.2, 0.3, 0.2)?];
        let hosts =
            [b(1.0, 1.0, 1.0)?, b(1.0, 0.5, 2.0)?, q(8, 1.0, 1.0, 1.0)?, e(1.0, 1.0, 1.5)?, q(4, 1.0, 0.5, 1.0)?];
        let (a, host) = (&inner[random.index(4)], &hosts[random.index(5)]);
        if method == Method::Warm {
            let nearby = pose(turn * Vector3::new(0.01, 0.02, -0.01), &turn)?;
            signed_distance(a, &nearby, host, &still, &options, &mut warm);
        }
        let answer = signed_distance(a, &still, host, &still, &options, &mut warm);
        let what = format!("{}-{}, concentric, not flagged", a.name(), host.name());
        return Ok(Some(if answer.tied { Verdict::Pass } else { Verdict::WrongStatus(what) }));
    }
    // Mirror images on both sides, the third body in the mirror plane or beside it.
    let part = if random.index(2) == 0 { e(0.5, 0.3, 0.4)? } else { q(4, 0.4, 0.5, 0.3)? };
    let other = |error: crate::body::BodyError| CaseError::Other(error.to_string());
    let place = |side: f64| part.moved(&UnitQuaternion::identity(), &Vector3::x().scale(side)).map_err(other);
    let both = Compound::new("both", vec![place(-1.0)?, place(1.0)?]).map_err(|e| CaseError::Other(e.to_string()))?;
    let third = e(0.6, 0.5, 0.4)?;
    for (aside, expected) in [(0.0, true), (0.1, false)] {
        let pose_b = pose(turn * Vector3::new(aside, 2.0, 0.3), &turn)?;
        if method == Method::Warm {
            let nearby = pose(turn * Vector3::new(aside - 0.02, 2.0, 0.3), &turn)?;
            distance(&both, &still, &third, &nearby, &options, &mut warm);
        }
        let found = distance(&both, &still, &third, &pose_b, &options, &mut warm);
        if found.tied != expected {
            return Ok(Some(Verdict::WrongStatus(format!("tied: {}, {aside} m beside the mirror plane", found.tied))));
        }
    }
    Ok(Some(Verdict::Pass))
}
