//! Any measure of any pair.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::{Shape, Solid};
use sublevel_core::measure::{
    Distance, Impact, ImpactOptions, ImpactStatus, LevelDistance, Motion, Pose, SignedDistance, Status, Twist,
    distance, distance_to_point, growth_distance, level_distance, penetration, signed_distance, time_of_impact,
};

use super::answer::{Answer, AnswerStatus, Verdict};
use super::ask::Measure;
use super::decide::{Bracket, compare, decide};
use super::solver::{Pair, Solids, Solver};
use super::thing::{PairSlots, Thing, WorldHalfSpace};

impl Solver<'_> {
    /// The measure at a position of the question, of one pair.
    pub(crate) fn measure(&self, index: usize, pair: &Pair<'_>) -> Answer {
        let measure = self.ask.measures()[index];
        if self.stop.is_set() {
            return self.unsolved(measure, pair);
        }
        match (&pair.a, &pair.b) {
            (Thing::Solid { set: None, .. }, Thing::Solid { set: None, .. }) => self.solids(index, measure, pair),
            (Thing::Capsule { .. }, _) | (_, Thing::Capsule { .. }) => self.capsules(index, measure, pair),
            (Thing::Solid { set: Some(_), .. }, _) | (_, Thing::Solid { set: Some(_), .. }) => {
                self.sets(index, measure, pair)
            }
            (Thing::Solid { rungs, pose, .. }, Thing::HalfSpace(half_space)) => {
                self.half_space(index, (rungs, pose), half_space, pair.slots)
            }
            (Thing::HalfSpace(_), Thing::Solid { .. }) => self.measure_swapped(index, pair),
            (Thing::Solid { rungs, pose, .. }, Thing::Point(point)) => {
                self.point(index, (rungs, pose), point, pair.slots)
            }
            (Thing::Point(_), Thing::Solid { .. }) => self.measure_swapped(index, pair),
            (Thing::Point(point), Thing::HalfSpace(half_space)) => self.plane(measure, point, half_space),
            (Thing::HalfSpace(half_space), Thing::Point(point)) => self.plane(measure, point, half_space).swapped(),
            (Thing::HalfSpace(_), Thing::HalfSpace(_)) | (Thing::Point(_), Thing::Point(_)) => {
                Answer::without(AnswerStatus::NotDefined)
            }
        }
    }

    fn measure_swapped(&self, index: usize, pair: &Pair<'_>) -> Answer {
        self.measure(index, &pair.swapped()).swapped()
    }

    /// What is known of a pair when the time is over: what the balls say.
    pub(crate) fn unsolved(&self, measure: Measure, pair: &Pair<'_>) -> Answer {
        let mut answer = Answer::without(AnswerStatus::Deadline);
        let gap = pair.a.ball_gap_m(&pair.b);
        match measure {
            Measure::Distance => answer.lower = gap.max(0.0),
            Measure::Signed => answer.lower = gap,
            Measure::Penetration => answer.lower = 0.0,
            Measure::Overlap => answer.verdict = Some(if gap > 0.0 { Verdict::No } else { Verdict::Undecided }),
            Measure::NearerThan => {
                let far = gap > self.ask.threshold_m;
                answer.verdict = Some(if far { Verdict::No } else { Verdict::Undecided });
            }
            Measure::TimeOfImpact => (answer.lower, answer.verdict) = (0.0, Some(Verdict::Undecided)),
            Measure::LevelAOnB | Measure::LevelBOnA | Measure::Growth => {}
        }
        answer
    }

    fn solids(&self, index: usize, measure: Measure, pair: &Pair<'_>) -> Answer {
        let (Thing::Solid { rungs: rungs_a, pose: pose_a, .. }, Thing::Solid { rungs: rungs_b, pose: pose_b, .. }) =
            (&pair.a, &pair.b)
        else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let (Some(a), Some(b)) = (rungs_a.last(), rungs_b.last()) else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let rungs = [rungs_a.len() - 1, rungs_b.len() - 1];
        let options = &self.ask.options(index, self.stop);
        let both = Solids { a, pose_a, b, pose_b };
        let warm = |kind| (pair.slots, rungs, kind);
        let mut answer = match measure {
            Measure::Distance => {
                let (slots, rungs, kind) = warm(Measure::Distance);
                let found = self.warm(slots, rungs, kind, |warm| distance(&**a, pose_a, &**b, pose_b, options, warm));
                self.distance(&found, &both)
            }
            Measure::LevelAOnB => self.warm(pair.slots, rungs, measure, |warm| {
                self.level(&level_distance(&**a, pose_a, &**b, pose_b, options, warm))
            }),
            Measure::LevelBOnA => {
                let found = self.warm(pair.slots, rungs, measure, |warm| {
                    self.level(&level_distance(&**b, pose_b, &**a, pose_a, options, warm))
                });
                // The two answers of one pair have the gradients in the order of the pair.
                Answer { gradients: found.gradients.map(|[b, a]| [a, b]), ..found }
            }
            Measure::Growth => {
                let found = self.warm(pair.slots, rungs, measure, |warm| {
                    growth_distance(&**a, pose_a, &**b, pose_b, options, warm)
                });
                Answer {
                    witnesses: Some([found.witness; 2]),
                    normal: found.normal,
                    gradients: found.gradients.filter(|_| self.ask.gradients),
                    not_unique: found.tied,
                    iterations: found.iterations,
                    ..self.bracket(found.status, found.lower, found.upper)
                }
            }
            Measure::Signed => {
                let found = self.warm(pair.slots, rungs, measure, |warm| {
                    signed_distance(&**a, pose_a, &**b, pose_b, options, warm)
                });
                self.signed(&found)
            }
            Measure::Penetration => {
                let found = self
                    .warm(pair.slots, rungs, measure, |warm| penetration(&**a, pose_a, &**b, pose_b, options, warm));
                Answer {
                    witnesses: Some([found.witness_a, found.witness_b]),
                    normal: found.direction,
                    not_unique: found.tied,
                    iterations: found.iterations,
                    ..self.bracket(found.status, found.lower, found.upper)
                }
            }
            Measure::Overlap => return self.decided(&decide(self, pair, 0.0, *options)),
            Measure::NearerThan => return self.decided(&decide(self, pair, self.ask.threshold_m, *options)),
            Measure::TimeOfImpact => self.impact(&both, pair.slots),
        };
        answer.rungs = rungs.map(|rung| u8::try_from(rung).unwrap_or(u8::MAX));
        answer
    }

    /// A distance with what follows from it for the solids as they stand.
    pub(crate) fn distance(&self, found: &Distance, both: &Solids<'_>) -> Answer {
        let gradients = if self.ask.gradients { found.gradients(both.pose_a, both.pose_b) } else { None };
        Answer {
            witnesses: Some([found.witness_a, found.witness_b]),
            normal: found.normal,
            gradients,
            not_unique: found.tied,
            parts: found.parts,
            iterations: found.iterations,
            objects_upper: found.hulls_upper(both.a, both.b).unwrap_or(f64::NAN),
            ..self.bracket(found.status, found.lower, found.upper)
        }
    }

    pub(crate) fn signed(&self, found: &SignedDistance) -> Answer {
        let value = found.value();
        Answer {
            value: if value.is_finite() { value } else { f64::NAN },
            // Without an upper bound the points are none of the two.
            witnesses: (found.upper < f64::INFINITY).then_some([found.witness_a, found.witness_b]),
            normal: found.normal,
            gradients: found.gradients.filter(|_| self.ask.gradients),
            not_unique: found.tied,
            one_sided: found.at_contact,
            iterations: found.iterations,
            ..self.bracket(found.status, found.lower, found.upper)
        }
    }

    fn level(&self, found: &LevelDistance) -> Answer {
        Answer {
            witnesses: Some([found.witness; 2]),
            gradients: self.ask.gradients.then_some([found.gradient_a, found.gradient_b]),
            not_unique: found.tied,
            saturated: found.saturated,
            iterations: found.iterations,
            multiplier: found.multiplier,
            ..self.bracket(found.status, found.lower, found.upper)
        }
    }

    fn bracket(&self, status: Status, lower: f64, upper: f64) -> Answer {
        Answer::bracket(status, lower, upper, self.stop.is_set())
    }

    pub(super) fn decided(&self, found: &Bracket) -> Answer {
        let status = match found.verdict {
            Verdict::Undecided if self.stop.is_set() => AnswerStatus::Deadline,
            Verdict::Undecided => AnswerStatus::BracketWide,
            Verdict::Yes | Verdict::No => AnswerStatus::Converged,
        };
        let mut answer = Answer::without(status);
        (answer.lower, answer.upper) = (found.lower, found.upper);
        (answer.verdict, answer.rungs) = (Some(found.verdict), found.rungs);
        answer
    }

    fn impact(&self, both: &Solids<'_>, slots: Option<PairSlots>) -> Answer {
        let (Some(motions), Some(PairSlots { a, b })) = (&self.ask.motions, slots) else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let motion = |slot, pose: &Pose| motions.moving.get(&slot).copied().unwrap_or_else(|| Motion::still(*pose));
        let Ok(options) = ImpactOptions::new(motions.duration_s) else {
            return Answer::without(AnswerStatus::NotDefined);
        };
        let options = options.with_stop(self.stop.flag());
        let (a, b) = (motion(a, both.pose_a), motion(b, both.pose_b));
        let Impact { status, time, distance, queries } = time_of_impact(both.a, &a, both.b, &b, &options);
        let mut answer = Answer::without(AnswerStatus::Converged);
        (answer.lower, answer.iterations) = (time, queries);
        answer.verdict = Some(match status {
            ImpactStatus::Apart => Verdict::No,
            ImpactStatus::Contact => Verdict::Yes,
            ImpactStatus::Stopped => Verdict::Undecided,
        });
        match status {
            ImpactStatus::Contact => (answer.upper, answer.value) = (time, time),
            ImpactStatus::Apart => {}
            ImpactStatus::Stopped if self.stop.is_set() => answer.status = AnswerStatus::Deadline,
            ImpactStatus::Stopped => answer.status = AnswerStatus::BracketWide,
        }
        if let Some(found) = distance {
            answer.witnesses = Some([found.witness_a, found.witness_b]);
            (answer.normal, answer.not_unique, answer.parts) = (found.normal, found.tied, found.parts);
        }
        answer
    }

    fn half_space(
        &self,
        index: usize,
        (rungs, pose): (&[Arc<Shape>], &Pose),
        half_space: &WorldHalfSpace,
        slots: Option<PairSlots>,
    ) -> Answer {
        let measure = self.ask.measures()[index];
        let Some(solid) = rungs.last() else { return Answer::without(AnswerStatus::NotDefined) };
        let options = self.ask.options(index, self.stop);
        let found = self.half_space_distance(solid, pose, half_space, (slots, &options));
        let slack = half_space
            .slack_m(pose.translation().norm() + solid.circumscribed().center.norm() + solid.circumscribed().radius);
        let (lower, upper) = (found.lower - slack, found.upper + slack);
        let normal = *half_space.half_space.normal();
        let on_plane = found.witness - normal * found.upper;
        let gradients = || {
            let solid = found.pose_gradient(pose, &half_space.half_space);
            let arm = found.witness - half_space.origin;
            [solid, Twist { linear: -normal, angular: normal.cross(&arm) }]
        };
        let signed = Answer {
            witnesses: Some([found.witness, on_plane]),
            normal: Some(normal),
            gradients: self.ask.gradients.then(gradients),
            not_unique: found.tied,
            iterations: found.iterations,
            rungs: [u8::try_from(rungs.len() - 1).unwrap_or(u8::MAX), 0],
            ..self.bracket(found.status, lower, upper)
        };
        from_signed(measure, signed, self.ask.threshold_m)
    }

    fn point(
        &self,
        index: usize,
        (rungs, pose): (&[Arc<Shape>], &Pose),
        point: &Vector3<f64>,
        slots: Option<PairSlots>,
    ) -> Answer {
        let measure = self.ask.measures()[index];
        let not_defined = Answer::without(AnswerStatus::NotDefined);
        let Some(solid) = rungs.last() else { return not_defined };
        let options = self.ask.options(index, self.stop);
        let found = self.warm(slots, [0; 2], measure, |warm| distance_to_point(&**solid, pose, point, &options, warm));
        let Ok(found) = found else { return not_defined };
        let gradients = || {
            let solid = found.pose_gradient(pose)?;
            // A point turns about itself.
            Some([solid, Twist { linear: -solid.linear, angular: Vector3::zeros() }])
        };
        let answer = Answer {
            witnesses: Some([found.witness, *point]),
            normal: found.normal,
            gradients: if self.ask.gradients { gradients() } else { None },
            not_unique: found.tied,
            iterations: found.iterations,
            rungs: [u8::try_from(rungs.len() - 1).unwrap_or(u8::MAX), 0],
            ..self.bracket(found.status, found.lower, found.upper)
        };
        match measure {
            Measure::Distance => answer,
            Measure::Overlap => with_verdict(answer, compare::below_or_at(found.lower, found.upper, 0.0)),
            Measure::NearerThan => with_verdict(answer, compare::below(found.lower, found.upper, self.ask.threshold_m)),
            _ => not_defined,
        }
    }

    /// A point against a plane.
    fn plane(&self, measure: Measure, point: &Vector3<f64>, half_space: &WorldHalfSpace) -> Answer {
        let (normal, offset) = (half_space.half_space.normal(), half_space.half_space.offset());
        let signed = normal.dot(point) - offset;
        let slack = half_space.slack_m(point.norm()) + 8.0 * f64::EPSILON * (point.norm() + offset.abs());
        let gradients = || {
            let arm = point - half_space.origin;
            [
                Twist { linear: *normal, angular: Vector3::zeros() },
                Twist { linear: -normal, angular: normal.cross(&arm) },
            ]
        };
        let answer = Answer {
            witnesses: Some([*point, point - normal * signed]),
            normal: Some(*normal),
            gradients: self.ask.gradients.then(gradients),
            ..self.bracket(Status::Converged, signed - slack, signed + slack)
        };
        from_signed(measure, answer, self.ask.threshold_m)
    }
}

/// What the signed distance of a half-space says of another measure.
pub(super) fn from_signed(measure: Measure, signed: Answer, threshold_m: f64) -> Answer {
    let (lower, upper) = (signed.lower, signed.upper);
    match measure {
        Measure::Signed => signed,
        Measure::Distance => {
            let gradients = signed.gradients.filter(|_| lower > 0.0);
            let (lower, upper) = (lower.max(0.0), upper.max(0.0));
            Answer { lower, upper, value: known(upper), gradients, ..signed }
        }
        Measure::Penetration => {
            let gradients = signed.gradients.filter(|_| upper < 0.0);
            let gradients = gradients.map(|both| both.map(negated));
            let (lower, upper) = ((-upper).max(0.0), (-lower).max(0.0));
            Answer { lower, upper, value: known(upper), gradients, ..signed }
        }
        Measure::Overlap => with_verdict(signed, compare::below_or_at(lower, upper, 0.0)),
        Measure::NearerThan => with_verdict(signed, compare::below(lower, upper, threshold_m)),
        Measure::LevelAOnB | Measure::LevelBOnA | Measure::Growth | Measure::TimeOfImpact => {
            Answer::without(AnswerStatus::NotDefined)
        }
    }
}

/// A value where there is one.
fn known(upper: f64) -> f64 {
    if upper.is_finite() { upper } else { f64::NAN }
}

fn negated(twist: Twist) -> Twist {
    Twist { linear: -twist.linear, angular: -twist.angular }
}

fn with_verdict(answer: Answer, verdict: Verdict) -> Answer {
    let (lower, upper) = (answer.lower.max(0.0), answer.upper.max(0.0));
    let status = if verdict == Verdict::Undecided { answer.status } else { AnswerStatus::Converged };
    Answer {
        lower,
        upper,
        rungs: answer.rungs,
        iterations: answer.iterations,
        verdict: Some(verdict),
        ..Answer::without(status)
    }
}
