//! Pairs of which a side need not be convex, by branch and bound.

use std::cell::RefCell;

use nalgebra::Vector3;
use sublevel_core::body::{Body, Shape, Solid, SosBody};
use sublevel_core::branch_and_bound::{BranchAndBound, Limits, PlacedSet};
use sublevel_core::measure::{Options, Pose, Status, Twist};

use super::answer::{Answer, AnswerStatus};
use super::ask::Measure;
use super::decide::decide;
use super::solve::from_signed;
use super::solver::{Pair, Solver};
use super::thing::{Thing, ball_gap};
use crate::broad_phase::{WorldBall, world_ball};

thread_local! {
    /// Covers of the sets that this thread was asked about.
    static BRANCHES: RefCell<BranchAndBound> = RefCell::default();
}

/// A bracket of the distance of a pair, metres; 0 in overlap, but signed of a half-space.
#[derive(Clone, Copy, Debug)]
pub(crate) struct SetBracket {
    status: Status,
    pub(crate) lower_m: f64,
    pub(crate) upper_m: f64,
    /// Points of the two, world frame.
    points: Option<[Vector3<f64>; 2]>,
    steps: usize,
    /// Parts of the two that the points are of.
    parts: [u16; 2],
}

impl SetBracket {
    /// Nothing is known.
    const OPEN: Self = Self {
        status: Status::BracketWide,
        lower_m: 0.0,
        upper_m: f64::INFINITY,
        points: None,
        steps: 0,
        parts: [0; 2],
    };

    /// With the sides exchanged.
    fn swapped(self) -> Self {
        let [a, b] = self.parts;
        Self { points: self.points.map(|[x, y]| [y, x]), parts: [b, a], ..self }
    }
}

impl Solver<'_> {
    /// A measure of a pair with an sos-body in it.
    pub(crate) fn sets(&self, index: usize, measure: Measure, pair: &Pair<'_>) -> Answer {
        let options = self.ask.options(index, self.stop);
        // Of a half-space depths are known, too.
        if let (Thing::Solid { .. }, Thing::HalfSpace(half_space)) = (&pair.a, &pair.b)
            && !matches!(measure, Measure::Overlap | Measure::NearerThan)
        {
            let found = self.set_distance(pair, None, options);
            let signed = self.set_answer(&found, pair);
            let signed = Answer { normal: Some(*half_space.half_space.normal()), ..signed };
            return from_signed(measure, signed, self.ask.threshold_m);
        }
        if let (Thing::HalfSpace(_), Thing::Solid { .. }) = (&pair.a, &pair.b) {
            return self.sets(index, measure, &pair.swapped()).swapped();
        }
        match measure {
            Measure::Distance => self.set_answer(&self.set_distance(pair, None, options), pair),
            Measure::Signed => {
                let found = self.set_distance(pair, None, options);
                let answer = self.set_answer(&found, pair);
                if found.lower_m > 0.0 {
                    return answer;
                }
                // How deep sets overlap is known of convex ones alone.
                let status = if self.stop.is_set() { AnswerStatus::Deadline } else { AnswerStatus::BracketWide };
                Answer { status, lower: f64::NEG_INFINITY, ..answer }
            }
            Measure::Overlap => self.decided(&decide(self, pair, 0.0, options)),
            Measure::NearerThan => self.decided(&decide(self, pair, self.ask.threshold_m, options)),
            Measure::LevelAOnB => self.set_level(pair, options),
            Measure::LevelBOnA => self.set_level(&pair.swapped(), options).swapped(),
            Measure::Growth | Measure::Penetration | Measure::TimeOfImpact => Answer::without(AnswerStatus::NotDefined),
        }
    }

    /// The distance of a pair with an sos-body in it, the signed one of a half-space; with a
    /// threshold, in metres, until it is decided.
    pub(crate) fn set_distance(&self, pair: &Pair<'_>, threshold: Option<f64>, options: Options<'_>) -> SetBracket {
        let limits = self.limits(pair, threshold, &options);
        match (&pair.a, &pair.b) {
            (Thing::Solid { rungs, pose, set }, Thing::Solid { rungs: rungs_b, pose: pose_b, set: set_b }) => {
                let (Some(a), Some(b)) = (rungs.last(), rungs_b.last()) else { return SetBracket::OPEN };
                let (a, b) = (parts(a, *set, pose), parts(b, *set_b, pose_b));
                least(&a, &b, &limits)
            }
            (Thing::Solid { set: Some(body), pose, .. }, Thing::Point(point)) => {
                let set = PlacedSet::new(*body, **pose);
                let found = BRANCHES.with_borrow_mut(|branches| branches.distance_to_point(&set, point, &limits));
                let Ok(found) = found else { return SetBracket::OPEN };
                SetBracket {
                    status: found.status,
                    lower_m: found.lower_m,
                    upper_m: found.upper_m,
                    points: found.point.map(|x| [x, *point]),
                    steps: found.steps,
                    parts: [0; 2],
                }
            }
            (Thing::Solid { set: Some(body), pose, .. }, Thing::HalfSpace(half_space)) => {
                let set = PlacedSet::new(*body, **pose);
                let plane = &half_space.half_space;
                let found = BRANCHES.with_borrow_mut(|branches| branches.height(&set, plane, &limits));
                let Ok(found) = found else { return SetBracket::OPEN };
                let ball = body.circumscribed();
                let slack = half_space.slack_m(pose.translation().norm() + ball.center.norm() + ball.radius);
                let onto = |x: Vector3<f64>| x - plane.normal() * (plane.normal().dot(&x) - plane.offset());
                SetBracket {
                    status: found.status,
                    lower_m: found.lower_m - slack,
                    upper_m: found.upper_m + slack,
                    points: found.point.map(|x| [x, onto(x)]),
                    steps: found.steps,
                    parts: [0; 2],
                }
            }
            (_, Thing::Solid { set: Some(_), .. }) => self.set_distance(&pair.swapped(), threshold, options).swapped(),
            _ => SetBracket::OPEN,
        }
    }

    /// The level distance of the second thing in the first.
    fn set_level(&self, pair: &Pair<'_>, options: Options<'_>) -> Answer {
        let (Thing::Solid { rungs, pose, set }, Thing::Solid { rungs: rungs_b, pose: pose_b, set: set_b }) =
            (&pair.a, &pair.b)
        else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let (Some(a), Some(b)) = (rungs.last(), rungs_b.last()) else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let limits =
            Limits { accuracy: options.accuracy(), width: 0.0, stop: Some(self.stop.flag()), ..Limits::default() };
        let (not_unique, rungs) = (true, pair.finest_rungs());
        let mut answer = Answer { lower: f64::INFINITY, not_unique, rungs, ..Answer::without(AnswerStatus::Converged) };
        let (a, b) = (parts(a, *set, pose), parts(b, *set_b, pose_b));
        for (i, first) in a.iter().enumerate() {
            for (j, second) in b.iter().enumerate() {
                // What is proven to be above a pair before needs no closer look.
                let limits = Limits { beyond: Some(answer.upper), ..limits };
                let found = BRANCHES.with_borrow_mut(|branches| branches.level_distance(first, second, &limits));
                let Ok(found) = found else { return Answer::without(AnswerStatus::BracketWide) };
                let status = Answer::bracket(found.status, found.lower, found.upper, self.stop.is_set()).status;
                if status != AnswerStatus::Converged {
                    answer.status = status;
                }
                if found.upper < answer.upper {
                    answer.upper = found.upper;
                    answer.value = found.upper;
                    answer.witnesses = found.point.map(|point| [point; 2]);
                    answer.parts = [index(i), index(j)];
                }
                answer.lower = answer.lower.min(found.lower);
                answer.iterations += count(found.steps);
            }
        }
        answer
    }

    /// Widths as of the solver: relative to the smaller of the two.
    fn limits(&self, pair: &Pair<'_>, threshold: Option<f64>, options: &Options<'_>) -> Limits<'_> {
        let radius = |thing: &Thing<'_>| thing.ball().map_or(f64::INFINITY, |(_, radius)| radius);
        let positive = |radius: f64| if radius > 0.0 { radius } else { f64::INFINITY };
        let smaller = positive(radius(&pair.a)).min(positive(radius(&pair.b)));
        let width = options.accuracy() * smaller;
        Limits { accuracy: 0.0, width, threshold, stop: Some(self.stop.flag()), ..Limits::default() }
    }

    fn set_answer(&self, found: &SetBracket, pair: &Pair<'_>) -> Answer {
        let normal = found.points.and_then(|[x, y]| (x - y).try_normalize(0.0));
        // Of the nearest points found, where these are proven to be the nearest.
        let gradients = || {
            let ([x, y], n) = (found.points?, normal?);
            let twist = |thing: &Thing<'_>, at: Vector3<f64>, n: Vector3<f64>| {
                let arm = match thing {
                    Thing::Solid { pose, .. } => at - pose.translation(),
                    Thing::Capsule { pose, .. } => at - pose.translation(),
                    Thing::HalfSpace(half_space) => at - half_space.origin,
                    Thing::Point(_) => Vector3::zeros(),
                };
                Twist { linear: n, angular: arm.cross(&n) }
            };
            let is_known = found.status == Status::Converged && found.lower_m > 0.0;
            is_known.then(|| [twist(&pair.a, x, n), twist(&pair.b, y, -n)])
        };
        Answer {
            witnesses: found.points,
            normal,
            gradients: if self.ask.gradients { gradients() } else { None },
            // Sets that bend inwards may have other points that are as near.
            not_unique: true,
            parts: found.parts,
            rungs: pair.finest_rungs(),
            iterations: count(found.steps),
            ..Answer::bracket(found.status, found.lower_m, found.upper_m, self.stop.is_set())
        }
    }
}

/// The sets that a solid is the union of.
fn parts<'a>(solid: &'a Shape, set: Option<&'a SosBody>, pose: &Pose) -> Vec<PlacedSet<'a>> {
    match set {
        Some(body) => vec![PlacedSet::new(body, *pose)],
        None => solid.parts().iter().map(|body: &Body| PlacedSet::new(body, *pose)).collect(),
    }
}

/// The least distance of all pairs of parts, those first whose boxes are nearest.
fn least(a: &[PlacedSet<'_>], b: &[PlacedSet<'_>], limits: &Limits<'_>) -> SetBracket {
    let mut pairs: Vec<_> = (0..a.len())
        .flat_map(|i| (0..b.len()).map(move |j| (i, j)))
        .map(|(i, j)| (ball_gap(ball_of(&a[i]), ball_of(&b[j])).max(0.0), i, j))
        .collect();
    pairs.sort_by(|p, q| p.0.total_cmp(&q.0));
    let mut all = SetBracket { status: Status::Converged, lower_m: f64::INFINITY, ..SetBracket::OPEN };
    for (gap_m, i, j) in pairs {
        // What is proven to be farther than a pair before needs no closer look.
        let is_settled = limits.threshold.is_some_and(|threshold| all.upper_m <= threshold || gap_m > threshold);
        if is_settled || gap_m > all.upper_m {
            all.lower_m = all.lower_m.min(gap_m);
            continue;
        }
        let limits = Limits { beyond: Some(all.upper_m), ..*limits };
        let found = BRANCHES.with_borrow_mut(|branches| branches.distance(&a[i], &b[j], &limits));
        let Ok(found) = found else { return SetBracket::OPEN };
        all.lower_m = all.lower_m.min(found.lower_m.max(gap_m));
        all.steps += found.steps;
        if found.status != Status::Converged {
            all.status = Status::BracketWide;
        }
        if found.upper_m < all.upper_m {
            (all.upper_m, all.points, all.parts) = (found.upper_m, found.points, [index(i), index(j)]);
        }
    }
    all
}

/// A ball around a set where it stands, metres.
fn ball_of(set: &PlacedSet<'_>) -> WorldBall {
    let bounds = &set.of.bounding_box;
    world_ball(&set.pose, ((bounds.min + bounds.max) * 0.5, (bounds.max - bounds.min).norm() * 0.5))
}

fn index(part: usize) -> u16 {
    u16::try_from(part).unwrap_or(u16::MAX)
}

fn count(steps: usize) -> u32 {
    u32::try_from(steps).unwrap_or(u32::MAX)
}
