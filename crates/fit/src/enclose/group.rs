//! Fewer bodies for a coarser map: neighbours are put into one body while that wastes little space.
//!
//! Greedy: the merge that adds the least volume comes first, until the next would add too much. The
//! hull of points inside them is a lower bound of the volume of every convex body around two
//! groups, so a pair's program is solved only once its bound is the least of all, and never for
//! pairs that are too far apart.

use super::enclosure::{Enclosure, enclose_obstacles};
use super::error::{EncloseError, MAX_SETS};
use super::options::EncloseOptions;
use super::region::Region;
use crate::hull::convex_hull;
use crate::{FitError, Progress};
use nalgebra::Vector3;
use std::ops::ControlFlow;
use sublevel_core::body::{Body, Obstacle};

/// Some of the obstacles, in one body.
#[derive(Clone, Debug)]
pub struct Group {
    /// Which of the obstacles, in ascending order.
    pub members: Vec<usize>,
    /// The body around them.
    pub cover: Cover,
}

/// The body around a group.
#[derive(Clone, Debug)]
pub enum Cover {
    /// The single member itself, a body that stays as it is.
    Itself(Box<Body>),
    /// One that was made around the members.
    Around(Box<Enclosure>),
}

impl Cover {
    /// The body.
    pub fn body(&self) -> &Body {
        match self {
            Self::Itself(body) => body,
            Self::Around(enclosure) => &enclosure.body,
        }
    }

    /// How the body was made, if it was.
    pub fn enclosure(&self) -> Option<&Enclosure> {
        match self {
            Self::Itself(_) => None,
            Self::Around(enclosure) => Some(enclosure),
        }
    }
}

/// A group that may still be merged.
struct Candidate {
    group: Group,
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

impl Candidate {
    /// Volume of its body, m³.
    fn volume(&self) -> f64 {
        self.group.cover.body().volume().volume_m3
    }
}

/// Puts obstacles into few groups, the volumes of whose bodies add up to at most `1 + max_growth`
/// times those of all obstacles, an obstacle that is not convex having that of the smallest body
/// around it.
///
/// Obstacles that overlap count twice.
///
/// # Errors
/// [`EncloseError::Growth`] for a growth that is not positive and finite, and as [`super::enclose`]
/// for options and cancellation; a pair around which no body is found or proven is not merged.
pub fn group(
    obstacles: &[Obstacle],
    max_growth: f64,
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Vec<Group>, EncloseError> {
    options.check()?;
    if !(max_growth > 0.0 && max_growth.is_finite()) {
        return Err(EncloseError::Growth(max_growth));
    }
    // Groups that were merged leave an empty place.
    let single = |i| single(obstacles, i, options, progress).map(Some);
    let mut candidates = (0..obstacles.len()).map(single).collect::<Result<Vec<_>, _>>()?;
    let mut left = max_growth * candidates.iter().flatten().map(Candidate::volume).sum::<f64>();
    let mut pairs: Vec<Pair> = (1..obstacles.len())
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
            if let Some(merged) = merge(obstacles, a, b, options, progress)? {
                let added = merged.volume() - a.volume() - b.volume();
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

fn single(
    obstacles: &[Obstacle],
    index: usize,
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Candidate, EncloseError> {
    let cover = match &obstacles[index] {
        Obstacle::Body(body) => Cover::Itself(body.clone()),
        obstacle @ Obstacle::SosBody(_) => {
            let made = enclose_obstacles(obstacle.name(), &[obstacle], options, progress);
            Cover::Around(Box::new(made.map_err(|error| error.of_set(index))?))
        }
    };
    let inside = Region::from(&obstacles[index]).inside;
    let points = hull_of(&inside).map_err(|source| EncloseError::Points { index, source })?.0;
    Ok(Candidate { group: Group { members: vec![index], cover }, points })
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
    let added = hull_of(&points).ok()?.1 - a.volume() - b.volume();
    Some(Pair { places, added, merged: None })
}

/// Both groups in one, if there is a body around them.
fn merge(
    obstacles: &[Obstacle],
    a: &Candidate,
    b: &Candidate,
    options: &EncloseOptions,
    progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<Option<Candidate>, EncloseError> {
    let mut members: Vec<usize> = a.group.members.iter().chain(&b.group.members).copied().collect();
    members.sort_unstable();
    let around: Vec<&Obstacle> = members.iter().map(|&i| &obstacles[i]).collect();
    let enclosure = match enclose_obstacles(around[0].name(), &around, options, progress) {
        Ok(enclosure) => enclosure,
        Err(EncloseError::Fit(FitError::Cancelled)) => return Err(FitError::Cancelled.into()),
        Err(_) => return Ok(None),
    };
    let points: Vec<_> = a.points.iter().chain(&b.points).copied().collect();
    let cover = Cover::Around(Box::new(enclosure));
    Ok(Some(Candidate { group: Group { members, cover }, points: hull_of(&points)?.0 }))
}
