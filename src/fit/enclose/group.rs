//! Fewer bodies for a coarser map: neighbours are put into one body while that wastes little space.
//!
//! Greedy: the merge that adds the least volume comes first, until the next would add too much. The hull of points inside them is a
//! lower bound of the volume of every convex body around two groups, so a pair's program is solved only once its bound is the least
//! of all, and never for pairs that are too far apart.

use super::{EncloseError, EncloseOptions, Enclosure, MAX_SETS, enclose_bodies};
use crate::body::Body;
use crate::fit::hull::convex_hull;
use crate::fit::{FitError, Progress};
use nalgebra::Vector3;
use std::ops::ControlFlow;

/// Some of the bodies, in one body.
#[derive(Clone, Debug)]
pub struct Group {
    /// Which of the bodies, in ascending order.
    pub members: Vec<usize>,
    /// The body around them; none around a single one, which stays as it is.
    pub enclosure: Option<Enclosure>,
}

/// A group that may still be merged.
struct Candidate {
    group: Group,
    /// Volume of its body, m³.
    volume: f64,
    /// Vertices of the hull of points inside its members.
    points: Vec<Vector3<f64>>,
}

/// Two places in the list of candidates.
struct Pair {
    places: [usize; 2],
    /// Volume that merging them adds, m³: a lower bound until they are merged for trial.
    added: f64,
    /// The trial.
    merged: Option<Candidate>,
}

/// Puts bodies into few groups, the volumes of whose bodies add up to at most `1 + max_growth` times those of all bodies.
///
/// Bodies that overlap count twice.
///
/// # Errors
/// [`EncloseError::Growth`] for a growth that is not positive and finite, and as [`super::enclose`] for options and cancellation; a
/// pair around which no body is found or proven is not merged.
pub fn group(
    bodies: &[Body],
    max_growth: f64,
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Vec<Group>, EncloseError> {
    options.check()?;
    if !(max_growth > 0.0 && max_growth.is_finite()) {
        return Err(EncloseError::Growth(max_growth));
    }
    // Groups that were merged leave an empty place.
    let mut candidates = (0..bodies.len()).map(|i| single(bodies, i).map(Some)).collect::<Result<Vec<_>, _>>()?;
    let mut left = max_growth * bodies.iter().map(|body| body.volume().volume_m3).sum::<f64>();
    let mut pairs: Vec<Pair> = (1..bodies.len())
        .flat_map(|j| (0..j).map(move |i| [i, j]))
        .filter_map(|places| pair(&candidates, places))
        .collect();
    while let Some(least) = (0..pairs.len()).min_by(|&a, &b| pairs[a].added.total_cmp(&pairs[b].added)) {
        let Pair { places: [i, j], added, merged } = pairs.swap_remove(least);
        if added > left {
            // So would all others.
            break;
        }
        let (Some(a), Some(b)) = (&candidates[i], &candidates[j]) else { continue };
        let Some(merged) = merged else {
            if let Some(merged) = merge(bodies, a, b, options, progress)? {
                let added = merged.volume - a.volume - b.volume;
                pairs.push(Pair { places: [i, j], added, merged: Some(merged) });
            }
            continue;
        };
        left -= added;
        (candidates[i], candidates[j]) = (None, None);
        candidates.push(Some(merged));
        let last = candidates.len() - 1;
        pairs.extend((0..last).filter_map(|k| pair(&candidates, [k, last])));
    }
    let mut groups: Vec<Group> = candidates.into_iter().flatten().map(|candidate| candidate.group).collect();
    groups.sort_by_key(|group| group.members[0]);
    Ok(groups)
}

fn single(bodies: &[Body], index: usize) -> Result<Candidate, EncloseError> {
    let body = &bodies[index];
    let points = hull_of(body.boundary()).map_err(|source| EncloseError::Points { index, source })?.0;
    let group = Group { members: vec![index], enclosure: None };
    Ok(Candidate { group, volume: body.volume().volume_m3, points })
}

/// The vertices of a hull and its volume, m³.
fn hull_of(points: &[Vector3<f64>]) -> Result<(Vec<Vector3<f64>>, f64), FitError> {
    let hull = convex_hull(points)?;
    Ok((hull.vertices.iter().map(|&i| points[i]).collect(), hull.volume))
}

/// Two groups that are there and may be merged.
fn pair(candidates: &[Option<Candidate>], places: [usize; 2]) -> Option<Pair> {
    let [a, b] = [candidates[places[0]].as_ref()?, candidates[places[1]].as_ref()?];
    if a.group.members.len() + b.group.members.len() > MAX_SETS {
        return None;
    }
    let points: Vec<_> = a.points.iter().chain(&b.points).copied().collect();
    let added = hull_of(&points).ok()?.1 - a.volume - b.volume;
    Some(Pair { places, added, merged: None })
}

/// Both groups in one, if there is a body around them.
fn merge(
    bodies: &[Body],
    a: &Candidate,
    b: &Candidate,
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Option<Candidate>, EncloseError> {
    let mut members: Vec<usize> = a.group.members.iter().chain(&b.group.members).copied().collect();
    members.sort_unstable();
    let around: Vec<&Body> = members.iter().map(|&i| &bodies[i]).collect();
    let enclosure = match enclose_bodies(around[0].name(), &around, options, progress) {
        Ok(enclosure) => enclosure,
        Err(EncloseError::Fit(FitError::Cancelled)) => return Err(FitError::Cancelled.into()),
        Err(_) => return Ok(None),
    };
    let points: Vec<_> = a.points.iter().chain(&b.points).copied().collect();
    let (points, volume) = (hull_of(&points)?.0, enclosure.body.volume().volume_m3);
    Ok(Some(Candidate { group: Group { members, enclosure: Some(enclosure) }, volume, points }))
}
