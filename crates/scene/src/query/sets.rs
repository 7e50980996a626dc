//! Pairs of which a side need not be convex, by branch and bound.

use std::cell::RefCell;

use nalgebra::Vector3;
use sublevel_core::body::{Body, Shape, Solid, SosBody};
use sublevel_core::branch_and_bound::{BranchAndBound, Limits, PlacedSet};
use sublevel_core::measure::{Options, Pose, Status, Twist};

use super::answer::{Answer, AnswerStatus, Verdict};
use super::ask::Measure;
use super::decide::compare;
use super::solver::{Pair, Solver};
use super::thing::Thing;

thread_local! {
    /// Covers of the sets that this thread was asked about.
    static BRANCHES: RefCell<BranchAndBound> = RefCell::default();
}

/// A bracket of the distance of a pair, metres; 0 in overlap.
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
            Measure::Overlap => {
                let found = self.set_distance(pair, Some(0.0), options);
                self.set_verdict(&found, compare::below_or_at(found.lower_m, found.upper_m, 0.0))
            }
            Measure::NearerThan => {
                let threshold = self.ask.threshold_m;
                let found = self.set_distance(pair, Some(threshold), options);
                self.set_verdict(&found, compare::below(found.lower_m, found.upper_m, threshold))
            }
            Measure::LevelAOnB => self.set_level(pair, options),
            Measure::LevelBOnA => {
                let answer = self.set_level(&pair.swapped(), options).swapped();
                Answer { witnesses: answer.witnesses, ..answer }
            }
            Measure::Growth | Measure::Penetration | Measure::TimeOfImpact => Answer::without(AnswerStatus::NotDefined),
        }
    }

    /// The distance of a pair with an sos-body in it; with a threshold, in metres, until it is
    /// decided.
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
                let onto = |x: Vector3<f64>| x - plane.normal() * (plane.normal().dot(&x) - plane.offset()).max(0.0);
                SetBracket {
                    status: found.status,
                    lower_m: (found.lower_m - slack).max(0.0),
                    upper_m: (found.upper_m + slack).max(0.0),
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
        let mut answer = Answer { lower: f64::INFINITY, ..Answer::without(AnswerStatus::Converged) };
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
        // As of convex bodies, where the two are apart; where several pairs of points are as near,
        // it is that of one of them.
        let gradients = || {
            let ([x, y], n) = (found.points?, normal?);
            let twist = |thing: &Thing<'_>, at: Vector3<f64>, n: Vector3<f64>| {
                let arm = match thing {
                    Thing::Solid { pose, .. } => at - pose.translation(),
                    Thing::HalfSpace(half_space) => at - half_space.origin,
                    Thing::Point(_) => Vector3::zeros(),
                };
                Twist { linear: n, angular: arm.cross(&n) }
            };
            (found.lower_m > 0.0).then(|| [twist(&pair.a, x, n), twist(&pair.b, y, -n)])
        };
        Answer {
            witnesses: found.points,
            normal,
            gradients: if self.ask.gradients { gradients() } else { None },
            parts: found.parts,
            iterations: count(found.steps),
            ..Answer::bracket(found.status, found.lower_m, found.upper_m, self.stop.is_set())
        }
    }

    fn set_verdict(&self, found: &SetBracket, verdict: Verdict) -> Answer {
        let status = match verdict {
            Verdict::Undecided if self.stop.is_set() => AnswerStatus::Deadline,
            Verdict::Undecided => AnswerStatus::BracketWide,
            Verdict::Yes | Verdict::No => AnswerStatus::Converged,
        };
        Answer {
            lower: found.lower_m,
            upper: found.upper_m,
            verdict: Some(verdict),
            iterations: count(found.steps),
            ..Answer::without(status)
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

/// The least distance of all pairs of parts.
fn least(a: &[PlacedSet<'_>], b: &[PlacedSet<'_>], limits: &Limits<'_>) -> SetBracket {
    let mut all = SetBracket { status: Status::Converged, lower_m: f64::INFINITY, ..SetBracket::OPEN };
    for (i, first) in a.iter().enumerate() {
        for (j, second) in b.iter().enumerate() {
            // What is proven to be farther than a pair before needs no closer look.
            let limits = Limits { beyond: Some(all.upper_m), ..*limits };
            let found = BRANCHES.with_borrow_mut(|branches| branches.distance(first, second, &limits));
            let Ok(found) = found else { return SetBracket::OPEN };
            all.lower_m = all.lower_m.min(found.lower_m);
            all.steps += found.steps;
            if found.status != Status::Converged {
                all.status = Status::BracketWide;
            }
            if found.upper_m < all.upper_m {
                (all.upper_m, all.points, all.parts) = (found.upper_m, found.points, [index(i), index(j)]);
            }
        }
    }
    all
}

fn index(part: usize) -> u16 {
    u16::try_from(part).unwrap_or(u16::MAX)
}

fn count(steps: usize) -> u32 {
    u32::try_from(steps).unwrap_or(u32::MAX)
}
