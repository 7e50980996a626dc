//! Parts merged two by two, always those whose joint hull adds the least volume to their own: a
//! sequence of partitions, each in the next coarser one, for every number of parts at once. (The
//! bottom-up half of hierarchical approximate convex decomposition; Mamou and Ghorbel, A simple and
//! efficient approach for 3D mesh approximate convex decomposition, ICIP 2009.)

use super::FitError;
use super::hull::rough_hull;
use nalgebra::Vector3;
use std::cmp::Ordering;
use std::collections::{BTreeSet, BinaryHeap};

/// With more parts than this, only those that are near each other are candidates.
const ALL_PAIRS: usize = 48;

/// How many candidates a part then has at most, and how many are looked at along each axis.
const NEAREST: usize = 12;
const WINDOW: usize = 24;

/// The hull of a part.
#[derive(Clone, Debug)]
pub(super) struct Hull {
    pub(super) vertices: Vec<Vector3<f64>>,
    /// None of points without volume.
    pub(super) volume: Option<f64>,
}

impl Hull {
    pub(super) fn of(points: Vec<Vector3<f64>>) -> Self {
        match rough_hull(&points) {
            Some((vertices, volume)) => Self { vertices, volume: Some(volume) },
            None => Self { vertices: points, volume: None },
        }
    }

    /// Of both together.
    fn joint(&self, other: &Self) -> Self {
        Self::of([&self.vertices[..], &other.vertices[..]].concat())
    }

    fn own(&self) -> f64 {
        self.volume.unwrap_or(0.0)
    }

    fn bounds(&self) -> [Vector3<f64>; 2] {
        let ends = [Vector3::repeat(f64::INFINITY), Vector3::repeat(f64::NEG_INFINITY)];
        self.vertices.iter().fold(ends, |[low, high], x| [low.inf(x), high.sup(x)])
    }
}

/// A merger that may be next.
struct Candidate {
    /// Parts without volume come first: no body is fitted to them.
    flat: bool,
    /// By how much the joint hull is larger.
    added: f64,
    /// The two, by numbers that are never used again.
    pair: [usize; 2],
}

impl Ord for Candidate {
    /// The greatest is the next.
    fn cmp(&self, other: &Self) -> Ordering {
        let by = (self.flat.cmp(&other.flat)).then(other.added.total_cmp(&self.added));
        by.then(other.pair.cmp(&self.pair))
    }
}

impl PartialOrd for Candidate {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl PartialEq for Candidate {
    fn eq(&self, other: &Self) -> bool {
        self.cmp(other) == Ordering::Equal
    }
}

impl Eq for Candidate {}

/// One merger.
#[derive(Clone, Copy, Debug)]
pub(super) struct Merger {
    /// Numbers of the two: those before the first merger count the parts, each merger makes the
    /// next number.
    pub(super) pair: [usize; 2],
    /// Total volume of the hulls afterwards; infinite while a part has none.
    pub(super) total: f64,
}

/// Merges parts until one is left, or until the joint hull of any two adds more than `most`. `step`
/// is called with how many are left.
///
/// # Errors
/// What `step` returns.
pub(super) fn merge(
    hulls: Vec<Hull>,
    most: f64,
    step: &mut dyn FnMut(usize) -> Result<(), FitError>,
) -> Result<Vec<Merger>, FitError> {
    let mut left = hulls.len();
    let mut hulls: Vec<Option<Hull>> = hulls.into_iter().map(Some).collect();
    let mut neighbours = vec![BTreeSet::new(); hulls.len()];
    let mut open = BinaryHeap::new();
    let candidate = |hulls: &[Option<Hull>], pair: [usize; 2]| {
        let (Some(a), Some(b)) = (&hulls[pair[0]], &hulls[pair[1]]) else { return None };
        let added = a.joint(b).own() - a.own() - b.own();
        Some(Candidate { flat: a.volume.is_none() || b.volume.is_none(), added, pair })
    };
    let mut mergers = Vec::new();
    while left > 1 {
        if open.is_empty() {
            // The first time; and again where groups of neighbours have become one part each.
            let (alive, bounds): (Vec<usize>, Vec<_>) =
                hulls.iter().enumerate().filter_map(|(part, hull)| Some((part, hull.as_ref()?.bounds()))).unzip();
            for (place, others) in near_each_other(&bounds).into_iter().enumerate() {
                step(left)?;
                neighbours[alive[place]] = others.iter().map(|&other| alive[other]).collect();
                let later = others.range(place + 1..).map(|&other| [alive[place], alive[other]]);
                open.extend(later.filter_map(|pair| candidate(&hulls, pair)));
            }
        }
        let Some(Candidate { flat, added, pair: [a, b] }) = open.pop() else { break };
        if !flat && added > most {
            break;
        }
        let (Some(one), Some(other)) = (&hulls[a], &hulls[b]) else { continue };
        step(left)?;
        let (joint, made) = (one.joint(other), hulls.len());
        (hulls[a], hulls[b]) = (None, None);
        hulls.push(Some(joint));
        left -= 1;
        let mut others = BTreeSet::new();
        for part in [a, b] {
            others.extend(std::mem::take(&mut neighbours[part]).into_iter().filter(|&other| hulls[other].is_some()));
        }
        others.iter().for_each(|&other| {
            neighbours[other].insert(made);
        });
        open.extend(others.iter().filter_map(|&other| candidate(&hulls, [other, made])));
        neighbours.push(others);
        let total = hulls.iter().flatten().map(|hull| hull.volume.unwrap_or(f64::INFINITY)).sum();
        mergers.push(Merger { pair: [a, b], total });
    }
    Ok(mergers)
}

/// The total volume of hulls; infinite if one has none.
pub(super) fn total(hulls: &[Hull]) -> f64 {
    hulls.iter().map(|hull| hull.volume.unwrap_or(f64::INFINITY)).sum()
}

/// Which parts may be merged with which, by the boxes around them.
fn near_each_other(bounds: &[[Vector3<f64>; 2]]) -> Vec<BTreeSet<usize>> {
    let count = bounds.len();
    if count <= ALL_PAIRS {
        return (0..count).map(|part| (0..count).filter(|&other| other != part).collect()).collect();
    }
    let apart = |a: usize, b: usize| {
        let ([low, high], [least, most]) = (bounds[a], bounds[b]);
        let gap = (least - high).sup(&(low - most)).map(|gap| gap.max(0.0)).norm();
        (gap, ((low + high) - (least + most)).norm())
    };
    let mut near = vec![BTreeSet::new(); count];
    for axis in 0..3 {
        let mut order: Vec<usize> = (0..count).collect();
        order.sort_by(|&a, &b| (bounds[a][0][axis]).total_cmp(&bounds[b][0][axis]).then(a.cmp(&b)));
        for (place, &part) in order.iter().enumerate() {
            let window = &order[place + 1..(place + 1 + WINDOW).min(count)];
            near[part].extend(window);
            window.iter().for_each(|&other| {
                near[other].insert(part);
            });
        }
    }
    let mut kept = vec![BTreeSet::new(); count];
    for (part, near) in near.into_iter().enumerate() {
        let mut near: Vec<usize> = near.into_iter().collect();
        near.sort_by(|&a, &b| {
            let (a, b) = (apart(part, a), apart(part, b));
            a.0.total_cmp(&b.0).then(a.1.total_cmp(&b.1))
        });
        for &other in near.iter().take(NEAREST) {
            kept[part].insert(other);
            kept[other].insert(part);
        }
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::{Hull, merge, total};
    use crate::FitError;
    use nalgebra::Vector3;

    fn cube(at: [f64; 3]) -> Hull {
        let corners = (0..8_u8).map(|i| Vector3::from_fn(|axis, _| at[axis] + f64::from(i >> axis & 1)));
        Hull::of(corners.collect())
    }

    #[test]
    fn what_adds_least_is_merged_first() {
        let hulls: Vec<Hull> = [0.0, 1.0, 3.0, 9.0].map(|x| cube([x, 0.0, 0.0])).into();
        assert!((total(&hulls) - 4.0).abs() < 1e-5);
        let mergers = merge(hulls.clone(), f64::INFINITY, &mut |_| Ok(())).unwrap();
        let pairs: Vec<_> = mergers.iter().map(|merger| merger.pair).collect();
        assert_eq!(pairs, [[0, 1], [2, 4], [3, 5]]);
        for (merger, total) in mergers.iter().zip([4.0, 5.0, 10.0]) {
            assert!((merger.total - total).abs() < 1e-5, "{merger:?}");
        }
        assert_eq!(merge(hulls.clone(), 1e-5, &mut |_| Ok(())).unwrap().len(), 1);
        let stopped = merge(hulls, 1.0, &mut |_| Err(FitError::Cancelled));
        assert_eq!(stopped.unwrap_err(), FitError::Cancelled);
    }

    #[test]
    fn flat_parts_are_merged_whatever_that_adds() {
        let sheet = |z: f64| Hull::of((0..4).map(|i| Vector3::new(f64::from(i % 2), f64::from(i / 2), z)).collect());
        let hulls = vec![sheet(9.0), cube([0.0; 3]), cube([5.0, 0.0, 0.0])];
        assert!(total(&hulls).is_infinite());
        let mergers = merge(hulls, 0.0, &mut |_| Ok(())).unwrap();
        assert_eq!(mergers.len(), 1);
        assert!(mergers[0].pair.contains(&0) && mergers[0].total.is_finite());
    }

    #[test]
    fn many_parts_become_one() {
        let places =
            (0..150).map(|i| [3.0 * f64::from(i % 10), 2.0 * f64::from(i / 10), if i < 75 { 0.0 } else { 500.0 }]);
        let hulls: Vec<Hull> = places.map(cube).collect();
        let mergers = merge(hulls, f64::INFINITY, &mut |_| Ok(())).unwrap();
        assert_eq!(mergers.len(), 149);
        // Only the last merger joins the two groups.
        assert!(mergers[..148].iter().all(|merger| merger.total < 1e4) && mergers[148].total > 1e5);
    }
}
