//! The measures under test: a table to extend when one is added.

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::measure::{
    Distance, GrowthDistance, LevelDistance, Options, Pose, Status, WarmStart, distance, growth_distance,
    level_distance,
};
use sublevel_testkit::bodies::Placed;
use sublevel_testkit::reference::{self, growth};

/// An answer of any measure.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Answer {
    Distance(Distance),
    Level(LevelDistance),
    Growth(GrowthDistance),
}

/// What 200 bits say of an answer.
pub(crate) struct Verdict {
    /// Whether the bracket contains the truth.
    pub(crate) inside: bool,
    /// Whether the reference is sharp enough to say so.
    pub(crate) decided: bool,
    pub(crate) truth: f64,
}

type Solve = fn(Placed<'_>, Placed<'_>, &Options<'_>, &mut WarmStart) -> Answer;
type Program = fn(Placed<'_>, Placed<'_>) -> Option<f64>;

/// A measure: its name, its solver, and its semidefinite program.
pub(crate) struct Measure {
    pub(crate) name: &'static str,
    pub(crate) solve: Solve,
    pub(crate) program: Option<Program>,
}

pub(crate) const MEASURES: &[Measure] = &[
    Measure {
        name: "distance",
        solve: |a, b, options, warm| Answer::Distance(distance(a.0, a.1, b.0, b.1, options, warm)),
        program: Some(crate::sos::distance),
    },
    Measure {
        name: "level distance",
        solve: |a, b, options, warm| Answer::Level(level_distance(a.0, a.1, b.0, b.1, options, warm)),
        program: Some(crate::sos::level_distance),
    },
    Measure {
        name: "growth distance",
        solve: |a, b, options, warm| Answer::Growth(growth_distance(a.0, a.1, b.0, b.1, options, warm)),
        program: None,
    },
];

impl Answer {
    pub(crate) fn converged(&self) -> bool {
        self.status() == Status::Converged
    }

    fn status(&self) -> Status {
        match self {
            Answer::Distance(answer) => answer.status,
            Answer::Level(answer) => answer.status,
            Answer::Growth(answer) => answer.status,
        }
    }

    pub(crate) fn bracket(&self) -> (f64, f64) {
        match self {
            Answer::Distance(answer) => (answer.lower, answer.upper),
            Answer::Level(answer) => (answer.lower, answer.upper),
            Answer::Growth(answer) => (answer.lower, answer.upper),
        }
    }

    pub(crate) fn iterations(&self) -> u32 {
        match self {
            Answer::Distance(answer) => answer.iterations,
            Answer::Level(answer) => answer.iterations,
            Answer::Growth(answer) => answer.iterations,
        }
    }

    /// Width that a converged bracket may have.
    pub(crate) fn tolerance(&self, a: &Body, b: &Body, accuracy: f64) -> f64 {
        let scale = match self {
            Answer::Distance(_) => a.circumscribed().radius.min(b.circumscribed().radius),
            Answer::Level(answer) => answer.upper.abs().max(1.0),
            Answer::Growth(answer) => answer.upper.max(1.0),
        };
        accuracy * scale * (1.0 + 1e-12)
    }

    /// Whether the witnesses lie in their bodies, up to what rounding them to world coordinates and
    /// in each other's frame moves them.
    pub(crate) fn feasible(&self, a: Placed<'_>, b: Placed<'_>) -> bool {
        match self {
            Answer::Distance(answer) => {
                let seen_from = |(body, pose): Placed<'_>, x: &Vector3<f64>| {
                    (x - pose.translation()).norm() + body.circumscribed().center.norm()
                };
                let (x, y) = (&answer.witness_a, &answer.witness_b);
                within(a, x, seen_from(b, x)) && within(b, y, seen_from(a, y))
            }
            Answer::Level(answer) => within(b, &answer.witness, 0.0),
            // In the bodies as they have grown, which is theirs to check.
            Answer::Growth(_) => true,
        }
    }

    /// Compares the bracket with 200 bits; none where there is nothing to compare it with.
    pub(crate) fn verdict(&self, a: Placed<'_>, b: Placed<'_>) -> Option<Verdict> {
        Some(match self {
            Answer::Distance(answer) => {
                let truth = reference::distance(a.0, a.1, b.0, b.1, answer);
                let small = a.0.circumscribed().radius.min(b.0.circumscribed().radius);
                let decided = truth.decides(answer, 1e-16 * small);
                Verdict { inside: truth.inside(answer), decided, truth: truth.value() }
            }
            Answer::Level(answer) => {
                let truth = reference::level_distance(a.0, a.1, b.0, b.1, answer);
                Verdict { inside: truth.inside(answer), decided: truth.decides(answer), truth: truth.value() }
            }
            Answer::Growth(answer) => {
                // Where the centres coincide the answer is 0 and has no normal.
                let start = growth::Start { witness: answer.witness, value: answer.upper, normal: answer.normal? };
                let centres = (a.0.growth_ball().center, b.0.growth_ball().center);
                let truth = growth::growth_distance((a.0, a.1, &centres.0), (b.0, b.1, &centres.1), &start)?;
                Verdict { inside: truth.inside(answer), decided: truth.decides(answer), truth: truth.value() }
            }
        })
    }

    /// The answer's value and the size that an arbiter's 1e-6 is relative to. None where a
    /// semidefinite program in doubles cannot resolve: sizes or values that are too far apart.
    pub(crate) fn comparable(&self, a: &Body, b: &Body) -> Option<(f64, f64)> {
        let (small, large) = (a.circumscribed().radius, b.circumscribed().radius);
        let (small, large) = (small.min(large), small.max(large));
        let value = self.bracket().1;
        match self {
            Answer::Distance(_) => (value < 10.0 * large).then_some((value, large)),
            Answer::Growth(_) => None,
            Answer::Level(_) => (value < 1e3 && large < 10.0 * small).then_some((value, value.abs().max(1.0))),
        }
    }
}

/// Whether a point of the world lies in a body, up to the rounding of its coordinates in the world,
/// in the body's frame, and in another one from whose origin it is `away`, metres.
fn within((body, pose): (&Body, &Pose), witness: &Vector3<f64>, away: f64) -> bool {
    let local = pose.rotation().inverse_transform_vector(&(witness - pose.translation()));
    let moved = 16.0 * f64::EPSILON * (witness.norm() + pose.translation().norm() + local.norm() + away);
    body.constraints().iter().all(|constraint| {
        let jet = body.placement().jet(constraint, &local);
        jet.value <= 1.0 + jet.gradient.norm() * moved * (1.0 + 1e-3) + 1e-12
    })
}
