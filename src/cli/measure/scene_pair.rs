//! `sublevel measure` of what is no body or compound: sos-bodies, capsules and half-spaces, as
//! scenes measure them.

use super::undefined::Undefined;
use crate::body::BodyId;
use crate::measure::{DEFAULT_ACCURACY, Pose};
use crate::scene::query::{Answer, AnswerStatus, Ask, Measure, Operand, Pairs, Verdict};
use crate::scene::{Geometry, Placement, Question, Scene, Slot, Stop, Update};
use nalgebra::Vector3;
use serde::Serialize;
use std::error::Error;

/// Accuracy of pairs with an sos-body in them: each digit takes several times as long as the one
/// before.
const SET_ACCURACY: f64 = 1e-3;

/// What is measured, in the order of the answers.
const MEASURES: [Measure; 4] = [Measure::Distance, Measure::Overlap, Measure::LevelAOnB, Measure::LevelBOnA];

/// Two objects of a scene, A at its origin.
pub(super) struct ScenePair {
    scene: Scene,
    slots: [Slot; 2],
    ask: Ask,
}

/// One pose's answers; none where a measure does not exist for the pair.
#[derive(Serialize)]
pub(super) struct Line {
    pub(super) status: &'static str,
    pub(super) overlap: &'static str,
    pub(super) distance_m: Option<f64>,
    pub(super) distance_lower_m: f64,
    pub(super) distance_upper_m: Option<f64>,
    pub(super) level_ab: Option<f64>,
    pub(super) level_ab_lower: Option<f64>,
    pub(super) level_ab_upper: Option<f64>,
    pub(super) level_ba: Option<f64>,
    pub(super) level_ba_lower: Option<f64>,
    pub(super) level_ba_upper: Option<f64>,
    witness_a: Option<[f64; 3]>,
    witness_b: Option<[f64; 3]>,
    normal: Option<[f64; 3]>,
    /// Of the distance.
    iterations: u32,
}

impl ScenePair {
    /// Two objects, and the accuracy asked for.
    ///
    /// # Errors
    /// Pairs that have no distance, and accuracies that are none.
    pub(super) fn new([a, b]: &[Geometry; 2], accuracy: Option<f64>) -> Result<Self, Box<dyn Error>> {
        check(a, b)?;
        let is_set = [a, b].iter().any(|side| matches!(side, Geometry::SosBody(_)));
        let accuracy = accuracy.unwrap_or(if is_set { SET_ACCURACY } else { DEFAULT_ACCURACY });
        let ask = Ask::new(MEASURES.into())?.with_accuracy(accuracy).map_err(|error| format!("--accuracy {error}"))?;
        let put = |name: &str, geometry: &Geometry| Placement {
            name: name.into(),
            body: *geometry.id(),
            pose: Some(Pose::identity()),
            group: "".into(),
            padding_m: None,
            attachment: None,
        };
        let update = Update { upserts: vec![put("A", a), put("B", b)], ..Update::default() };
        let lookup = |id: &BodyId| [a, b].into_iter().find(|geometry| geometry.id() == id).cloned();
        let scene = Scene::new("measure", 0)?.updated(&update, lookup)?;
        let slots = ["A", "B"].map(|name| scene.slot(name));
        let [Some(a), Some(b)] = slots else { return Err("an object is missing that was placed".into()) };
        Ok(Self { scene, slots: [a, b], ask })
    }

    /// The answers with B at a pose in A's frame.
    ///
    /// # Errors
    /// What scenes do not take.
    pub(super) fn measure(&self, pose: &Pose) -> Result<Line, Box<dyn Error>> {
        let scene = self.scene.posed(&[(self.slots[1], *pose)])?;
        let pairs = Pairs::new(scene, self.ask.clone(), self.slots.map(Operand::Object).into(), vec![[0, 1]])?;
        let answers: Vec<Answer> = (0..pairs.chunks()).flat_map(|chunk| pairs.solve(chunk, &Stop::default())).collect();
        let [distance, overlap, ab, ba] = &answers[..] else { return Err("an answer is missing".into()) };
        Ok(Line::new(distance, overlap, [ab, ba]))
    }
}

/// Pairs that have a distance.
fn check(a: &Geometry, b: &Geometry) -> Result<(), Undefined> {
    match (a, b) {
        (Geometry::HalfSpace(_), Geometry::HalfSpace(_)) => Err(Undefined::HalfSpaces),
        (Geometry::Capsule(_), Geometry::SosBody(_)) | (Geometry::SosBody(_), Geometry::Capsule(_)) => {
            Err(Undefined::CapsuleAndSet)
        }
        _ => Ok(()),
    }
}

impl Line {
    fn new(distance: &Answer, overlap: &Answer, [ab, ba]: [&Answer; 2]) -> Self {
        let is_narrow = |answer: &&Answer| matches!(answer.status, AnswerStatus::Converged | AnswerStatus::NotDefined);
        let converged = [distance, overlap, ab, ba].iter().all(is_narrow);
        let finite = |value: f64| value.is_finite().then_some(value);
        let point = |index: usize| distance.witnesses.map(|points| points[index].into());
        Self {
            status: if converged { "converged" } else { "bracket_wide" },
            overlap: match overlap.verdict {
                Some(Verdict::Yes) => "yes",
                Some(Verdict::No) => "no",
                Some(Verdict::Undecided) | None => "undecided",
            },
            distance_m: finite(distance.value),
            distance_lower_m: distance.lower,
            distance_upper_m: finite(distance.upper),
            level_ab: finite(ab.value),
            level_ab_lower: finite(ab.lower),
            level_ab_upper: finite(ab.upper),
            level_ba: finite(ba.value),
            level_ba_lower: finite(ba.lower),
            level_ba_upper: finite(ba.upper),
            witness_a: point(0),
            witness_b: point(1),
            normal: distance.normal.filter(|_| distance.lower > 0.0).map(Vector3::into),
            iterations: distance.iterations,
        }
    }

    /// A row of the table.
    pub(super) fn row(&self, number: usize) -> String {
        let value = |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |value| format!("{value:.9}"));
        let width = |lower: Option<f64>, upper: Option<f64>| {
            upper.zip(lower).map_or_else(|| "-".to_owned(), |(upper, lower)| format!("{:.1e}", upper - lower))
        };
        format!(
            "{number:>5}  {:>14}  {:>8}  {:>9}  {:>14}  {:>8}  {:>14}  {:>8}  {}",
            value(self.distance_m),
            width(Some(self.distance_lower_m), self.distance_upper_m),
            self.overlap,
            value(self.level_ab),
            width(self.level_ab_lower, self.level_ab_upper),
            value(self.level_ba),
            width(self.level_ba_lower, self.level_ba_upper),
            self.status
        )
    }
}

/// The head of the table.
pub(super) fn head() -> String {
    format!(
        "{:>5}  {:>14}  {:>8}  {:>9}  {:>14}  {:>8}  {:>14}  {:>8}  status",
        "pose", "distance m", "± m", "overlap", "d(A‖B)", "±", "d(B‖A)", "±"
    )
}
