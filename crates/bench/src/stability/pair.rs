//! Pairs of primitives: our answer against 200 bits, and those of parry and coal with shapes of
//! their own.

use super::arbiter::Truth;
use super::method::{Farthest, Method, PEER_ERROR, coal_distance, farthest, in_folder, sampled, supported};
use super::question::{CaseError, Question, Verdict};
use crate::comparison::{Coal, ParryShape, PeerShape};
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::{Body, ExactShape};
use sublevel::measure::{Pose, WarmStart};
use sublevel_testkit::catalogue::primitives::{Flaw, Pair, Reference, Shape, Solved};
use sublevel_testkit::random::pose;

/// A method's answer to a pair, and what it is worth.
#[derive(Clone, Debug)]
pub(super) struct PairAnswer {
    pub(super) verdict: Verdict,
    /// The distance, metres, negative where it is a depth.
    pub(super) value: Option<f64>,
    /// All of the answer, if it is one of ours.
    pub(super) ours: Option<Solved>,
}

/// Puts a pair to a method. None where it cannot be asked.
pub(super) fn run(pair: &Pair, method: Method) -> Result<Option<PairAnswer>, CaseError> {
    match method {
        Method::Cold | Method::Warm | Method::Batch => of_ours(pair, method),
        // They need a polynomial for each shape.
        Method::Newton | Method::Slsqp | Method::Clarabel => {
            let Some(case) = pair.bodies() else { return Ok(None) };
            let answer = Question(case).run(method)?;
            Ok(answer.map(|answer| PairAnswer { verdict: answer.verdict, value: answer.value, ours: None }))
        }
        // Others have other limits.
        Method::Parry | Method::Coal if pair.limit.is_some() => Ok(None),
        Method::Parry => judged(pair, of_parry(pair)),
        Method::Coal => {
            let Some(value) = of_coal(pair)? else { return Ok(None) };
            judged(pair, Some(value))
        }
    }
}

/// Our answer; a body beside a body as all others are put.
fn of_ours(pair: &Pair, method: Method) -> Result<Option<PairAnswer>, CaseError> {
    if let Some(case) = pair.bodies() {
        let (pose_a, pose_b) = (case.pose_a, case.pose_b);
        let Some(answer) = Question(case).run(method)? else { return Ok(None) };
        // Judged by 200 bits, as all pairs here.
        let ours = answer.ours.map(|found| Solved::of_bodies(&found, &pose_a, &pose_b));
        let verdict = ours.map_or(answer.verdict, |found| verdict(pair, &found, &pair.truth()));
        return Ok(Some(PairAnswer { verdict, value: answer.value, ours }));
    }
    let Some(found) = solved(pair, method) else { return Ok(None) };
    let verdict = verdict(pair, &found, &pair.truth());
    Ok(Some(PairAnswer { verdict, value: Some(found.value), ours: Some(found) }))
}

/// Our answer to a pair that is none of bodies; none of methods that it has not: batches are of
/// bodies, and capsules beside each other or a half-space take no hint.
pub(super) fn solved(pair: &Pair, method: Method) -> Option<Solved> {
    let mut warm = WarmStart::default();
    match method {
        Method::Cold => {}
        Method::Warm if takes_hints(pair) => {
            nearby(pair).solve(&pair.options(), &mut warm);
        }
        _ => return None,
    }
    Some(pair.solve(&pair.options(), &mut warm))
}

/// Whether the measure of a pair starts from a hint: closed forms of capsules have no use for one.
fn takes_hints(pair: &Pair) -> bool {
    let is_closed = |shape: &Shape| matches!(shape, Shape::Capsule(_) | Shape::HalfSpace);
    !(is_closed(&pair.a) && is_closed(&pair.b))
}

/// A hundredth of the pair's size and half a degree before.
fn nearby(pair: &Pair) -> Pair {
    let step = Vector3::new(0.006, -0.005, 0.006) * pair.size();
    let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.005, 0.005, -0.005));
    let turned = UnitQuaternion::new_normalize(*(turn * pair.pose_b.rotation()));
    Pair { pose_b: pose(pair.pose_b.translation() + step, &turned), ..pair.clone() }
}

/// Judges an answer of ours: its bracket, its status, its witnesses, its error.
pub(super) fn verdict(pair: &Pair, found: &Solved, truth: &Reference) -> Verdict {
    match pair.flaw(found, truth) {
        None => Verdict::Pass,
        Some(Flaw::Off(error)) => Verdict::Off(error),
        Some(Flaw::Status(what)) => Verdict::WrongStatus(format!("{}: {what}", pair.what)),
    }
}

/// Judges an answer of somebody else by its own problem.
fn judged(pair: &Pair, value: Option<Option<f64>>) -> Result<Option<PairAnswer>, CaseError> {
    let Some(value) = value else { return Ok(None) };
    let Some(value) = value else {
        return Ok(Some(PairAnswer { verdict: Verdict::NoAnswer, value, ours: None }));
    };
    let truth = match between_hulls(pair) {
        Some(truth) => truth,
        None => known(pair)?,
    };
    // Some say how deep, asked for a distance.
    let value = value.max(0.0);
    let error = (truth.lower - value).max(value - truth.upper) - truth.floor;
    let allowed = (PEER_ERROR * pair.size()).max(pair.bound.unwrap_or(0.0));
    // Not `>`: a NaN is off.
    let verdict = if error <= allowed { Verdict::Pass } else { Verdict::Off(error / pair.size()) };
    Ok(Some(PairAnswer { verdict, value: Some(value), ours: None }))
}

/// The distance of the shapes themselves, 0 in overlap.
fn known(pair: &Pair) -> Result<Truth, CaseError> {
    if let Some(case) = pair.bodies() {
        return Question(case).truth(&[]);
    }
    let truth = pair.truth();
    let lower = truth.lower.as_ref().map_or(0.0, |_| (truth.value() - truth.width()).max(0.0));
    Ok(Truth { lower, upper: truth.value().max(0.0), floor: pair.rounding() })
}

/// What others take in place of a shape.
enum Stand {
    Own(PeerShape<'static>),
    /// Points whose convex hull it is.
    Hull(Vec<Vector3<f64>>),
    Point,
    HalfSpace,
}

impl Stand {
    fn of(shape: &Shape) -> Self {
        match shape {
            Shape::Body(body) => own(body).map_or_else(|| Self::Hull(sampled(body)), Self::Own),
            Shape::Capsule(capsule) => {
                Self::Own(PeerShape::Capsule { radius_m: capsule.radius_m(), half_height_m: capsule.half_height_m() })
            }
            Shape::Point => Self::Point,
            Shape::HalfSpace => Self::HalfSpace,
        }
    }

    /// As a shape with a surface, if it is one.
    fn shape(&self) -> Option<PeerShape<'_>> {
        match self {
            Self::Own(shape) => Some(*shape),
            Self::Hull(points) => Some(PeerShape::Hull(points)),
            Self::Point | Self::HalfSpace => None,
        }
    }

    /// Its point that is farthest along a direction of its frame; none of half-spaces.
    fn farthest(&self, n: &Vector3<f64>) -> Option<Vector3<f64>> {
        let signs = |half: Vector3<f64>| half.zip_map(n, f64::copysign);
        let unit = |n: Vector3<f64>| n.try_normalize(0.0).unwrap_or_default();
        Some(match self {
            Self::Hull(points) => farthest(points, n),
            Self::Point => Vector3::zeros(),
            Self::HalfSpace => return None,
            Self::Own(PeerShape::Ball { radius_m }) => unit(*n) * *radius_m,
            Self::Own(PeerShape::Cuboid { half_extents_m }) => signs(*half_extents_m),
            Self::Own(PeerShape::Cylinder { radius_m, half_height_m }) => {
                unit(Vector3::new(n.x, n.y, 0.0)) * *radius_m + Vector3::z() * half_height_m.copysign(n.z)
            }
            Self::Own(PeerShape::Capsule { radius_m, half_height_m }) => {
                unit(*n) * *radius_m + Vector3::z() * half_height_m.copysign(n.z)
            }
            Self::Own(PeerShape::Hull(points)) => farthest(points, n),
        })
    }
}

/// A body as a shape that others have, if it is one.
fn own(body: &Body) -> Option<PeerShape<'static>> {
    let form = body.closed_form().filter(|form| form.axes().is_none() && *form.center() == Vector3::zeros())?;
    Some(match *form.shape() {
        ExactShape::Cuboid { half_extents_m, .. } => PeerShape::Cuboid { half_extents_m: half_extents_m.into() },
        ExactShape::Cylinder { radius_m, half_height_m, .. } => PeerShape::Cylinder { radius_m, half_height_m },
        ExactShape::Capsule { radius_m, .. } => PeerShape::Ball { radius_m },
    })
}

/// The distance of a pair in which a hull stands for a body; none of others.
fn between_hulls(pair: &Pair) -> Option<Truth> {
    let (a, b) = (Stand::of(&pair.a), Stand::of(&pair.b));
    if !matches!((&a, &b), (Stand::Hull(_), _) | (_, Stand::Hull(_))) {
        return None;
    }
    let floor = pair.rounding();
    match (&a, &b) {
        (Stand::Hull(points), Stand::HalfSpace) => Some(above(points, &pair.pose_a, &pair.pose_b, floor)),
        (Stand::HalfSpace, Stand::Hull(points)) => Some(above(points, &pair.pose_b, &pair.pose_a, floor)),
        _ => {
            // About the first one's origin, for the sake of digits.
            let shift = pair.pose_b.translation() - pair.pose_a.translation();
            let set = |stand: &Stand, at: &Pose, from: Vector3<f64>, n: &Vector3<f64>| {
                let own = at.rotation().inverse_transform_vector(n);
                at.rotation() * stand.farthest(&own).unwrap_or_default() + from
            };
            let first: Farthest<'_> = &|n| set(&a, &pair.pose_a, Vector3::zeros(), n);
            let second: Farthest<'_> = &|n| set(&b, &pair.pose_b, shift, n);
            let truth = supported([first, second], -shift, (shift.norm() + pair.sum(), pair.size()));
            Some(Truth { floor: truth.floor.max(floor), ..truth })
        }
    }
}

/// The height of the lowest of points over a half-space, at least 0.
fn above(points: &[Vector3<f64>], at: &Pose, plane: &Pose, floor: f64) -> Truth {
    let n = plane.transform_direction(&Vector3::z());
    let lowest = farthest(points, &-at.rotation().inverse_transform_vector(&n));
    let height = n.dot(&(at.rotation() * lowest + (at.translation() - plane.translation()))).max(0.0);
    Truth { lower: height, upper: height, floor }
}

/// The distance that parry finds: outer none where it cannot be asked, inner none where it has no
/// answer, as of hulls that it cannot make.
fn of_parry(pair: &Pair) -> Option<Option<f64>> {
    let (a, b) = (Stand::of(&pair.a), Stand::of(&pair.b));
    let shapes = match parry_shapes([&a, &b], pair) {
        Ok(shapes) => shapes,
        Err(_) => return Some(None),
    };
    match shapes {
        [Some(a), Some(b)] => a.distance(&b).map(Some),
        [Some(a), None] => Some(Some(a.distance_to_point(pair.pose_b.translation()))),
        [None, Some(b)] => Some(Some(b.distance_to_point(pair.pose_a.translation()))),
        [None, None] => None,
    }
}

/// The shapes of parry's; none of points.
fn parry_shapes(stands: [&Stand; 2], pair: &Pair) -> Result<[Option<ParryShape>; 2], crate::comparison::NoHull> {
    let made = |stand: &Stand, at: &Pose| match stand {
        Stand::HalfSpace => Ok(Some(ParryShape::half_space(at))),
        Stand::Point => Ok(None),
        Stand::Own(_) | Stand::Hull(_) => stand.shape().map(|shape| ParryShape::new(&shape, at)).transpose(),
    };
    Ok([made(stands[0], &pair.pose_a)?, made(stands[1], &pair.pose_b)?])
}

/// The signed distance that parry finds of shapes of its own; none where it cannot be asked.
pub(super) fn parry_signed(pair: &Pair) -> Option<f64> {
    let (a, b) = (Stand::of(&pair.a), Stand::of(&pair.b));
    if matches!((&a, &b), (Stand::Hull(_), _) | (_, Stand::Hull(_))) {
        return None;
    }
    match parry_shapes([&a, &b], pair) {
        Ok([Some(a), Some(b)]) => a.signed_distance(&b),
        _ => None,
    }
}

/// The distance that coal finds; none where its program has no such shape.
fn of_coal(pair: &Pair) -> Result<Option<Option<f64>>, CaseError> {
    let (a, b) = (Stand::of(&pair.a), Stand::of(&pair.b));
    let (Some(coal), Some(a), Some(b)) = (Coal::from_environment()?, a.shape(), b.shape()) else { return Ok(None) };
    let back = pair.pose_a.rotation().inverse();
    let shift = back * (pair.pose_b.translation() - pair.pose_a.translation());
    let relative = pose(shift, &UnitQuaternion::new_normalize(*(back * pair.pose_b.rotation())));
    Ok(Some(in_folder(|folder| coal_distance(&coal, folder, [a, b], relative))?))
}
