//! Euclidean distance between two solids.

mod answer;
mod balls;
mod deepest;
mod edges;
mod exact;
mod pair;
mod planes;
mod query;
mod search;

use crate::body::{Body, PartNode, Solid};
use crate::measure::frames::pose::Pose;
use crate::measure::options::Options;
use crate::measure::other_parts::SeenSolids;
use crate::measure::pairwise_minimum::{At, nearest as nearest_parts};
use crate::measure::part_pairs::{ball_gaps, nodes, only_node};
use crate::measure::solver::stop_criterion::StopCriterion;
use crate::measure::status::Status;
use crate::measure::warm::WarmStart;
pub use answer::Distance;
pub(super) use exact::Exact;
pub(super) use pair::{between, nearest, settle};

/// Euclidean distance between solid `a` at `pose_a` and solid `b` at `pose_b` (body to world), 0
/// when they touch or overlap; of solids with several parts, that of their closest parts.
///
/// The bracket is as narrow as `options` ask, or the status says that it is not. Newton's method
/// finds the points with opposite normals along their difference: on from the last answer if `warm`
/// has one, else from where samples of both surfaces face each other. Where that fails an
/// interior-point method minimises ½|x - y|²; near contact, where that loses its curvature, the
/// point deepest in both bodies decides between overlap and a gap. `warm` is read and then replaced
/// by the hint for the next query of this pair.
///
/// ```
/// use nalgebra::Vector3;
/// use sublevel_core::body::Body;
/// use sublevel_core::measure::{Options, Pose, WarmStart, distance};
///
/// let ball = Body::ball("ball", Vector3::zeros(), 0.5)?;
/// let crate_ = Body::cuboid("crate", Vector3::new(1.0, 1.0, 1.0))?;
/// let apart = Pose::from_quaternion(Vector3::new(3.0, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0])?;
/// let answer = distance(&crate_, &Pose::identity(), &ball, &apart, &Options::default(), &mut WarmStart::default());
/// assert!((answer.value() - 1.5).abs() < 1e-8);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub fn distance(
    a: &impl Solid,
    pose_a: &Pose,
    b: &impl Solid,
    pose_b: &Pose,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    distance_until((a, pose_a), (b, pose_b), &StopCriterion::NARROW, options, warm)
}

/// Distance of two solids, or as much of it as the criterion needs.
#[inline]
pub(super) fn distance_until(
    (a, pose_a): At<'_, impl Solid>,
    (b, pose_b): At<'_, impl Solid>,
    goal: &StopCriterion,
    options: &Options<'_>,
    warm: &mut WarmStart,
) -> Distance {
    if let ([a], [b]) = (a.parts(), b.parts()) {
        return settle((a, pose_a), (b, pose_b), goal, options, warm);
    }
    let radius = a.circumscribed().radius.min(b.circumscribed().radius);
    let (own_a, own_b) = (only_node(a.circumscribed()), only_node(b.circumscribed()));
    let (nodes_a, nodes_b) = (nodes(a, &own_a), nodes(b, &own_b));
    let (of_a, of_b) = ((a.parts(), nodes_a), (b.parts(), nodes_b));
    let solids = SeenSolids::new((a, pose_a), (b, pose_b));
    let mut found = closest(&solids, (of_a, pose_a), (of_b, pose_b), goal, (options, warm));
    found.status = Status::of(found.upper - found.lower <= options.accuracy() * radius);
    found
}

/// Parts with the nodes of their tree, where they stand.
type Parts<'a> = ((&'a [Body], &'a [PartNode]), &'a Pose);

/// Not generic, so that it is compiled with this crate, whatever its callers are compiled for.
fn closest(
    solids: &SeenSolids<'_>,
    ((a, nodes_a), pose_a): Parts<'_>,
    ((b, nodes_b), pose_b): Parts<'_>,
    goal: &StopCriterion,
    (options, warm): (&Options<'_>, &mut WarmStart),
) -> Distance {
    let trees = ball_gaps(nodes_a, nodes_b, solids.seen);
    // Nothing is nearer than 0.
    let end = StopCriterion { near: goal.near.max(0.0), far: goal.far };
    let found =
        nearest_parts(&trees, &end, solids.recall(warm.others.as_ref(), warm.parts), warm, |(i, j), nearest, hint| {
            let goal = StopCriterion { near: goal.near, far: goal.far.min(nearest) };
            settle((&a[i], pose_a), (&b[j], pose_b), &goal, options, hint)
        });
    if !found.is_recalled {
        warm.others = Some(solids.kept(found.others, warm.parts));
    }
    let tied = found.tied && found.best.normal.is_some();
    let parts = [found.parts.0 as u16, found.parts.1 as u16];
    Distance { lower: found.lower, parts, tied, iterations: found.iterations, ..found.best }
}
