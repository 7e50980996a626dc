//! The families of the catalogue: each case is drawn from its seed alone.

mod clouds;
mod contact;
mod data;
mod depth;
mod derivatives;
mod limits;
mod motion;
mod placement;
mod scale;
mod ties;

use super::case::{Case, CaseError, Verdict};
use super::method::{Answer, Method, pose};
use crate::comparison::Random;
use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::Body;
use sublevel::measure::Pose;

/// A row of the table.
pub(super) struct Family {
    pub(super) number: u8,
    pub(super) name: &'static str,
    /// Cases of a quick run and of a full one.
    pub(super) cases: [u64; 2],
    pub(super) put: Put,
}

/// How a case is put.
pub(super) enum Put {
    /// As a distance, to all methods.
    Distance(fn(u64) -> Result<Case, CaseError>),
    /// As distances, to all methods, whose answers must also go together.
    Distances(fn(u64) -> Result<Vec<Case>, CaseError>, Together),
    /// In the family's own way; none where a method cannot be asked.
    Own(fn(u64, Method) -> Result<Option<Verdict>, CaseError>),
}

/// Judges answers that passed each for itself, a case and what was said of it at a time.
type Together = fn(&[(Case, Answer)], Method) -> Result<Verdict, CaseError>;

/// All rows, in the order of the catalogue.
pub(super) const FAMILIES: [Family; 24] = [
    row(1, "kissing contact, gap of an ulp", [40, 360], Put::Distances(contact::kissing, contact::rising)),
    row(2, "iteration limit of 1 to 3", [30, 300], Put::Distance(limits::few_iterations)),
    row(3, "all but parallel faces", [40, 80], Put::Distance(contact::parallel_faces)),
    row(4, "far apart, 1008 pairs a case", [10, 340], Put::Own(placement::far_apart)),
    row(5, "a common point inside", [60, 1000], Put::Distance(placement::common_point)),
    row(6, "alike, shifted along an axis", [60, 336], Put::Distance(placement::along_an_axis)),
    row(7, "coincident centres", [40, 400], Put::Distances(placement::concentric, placement::defined)),
    row(8, "normal and derivatives at contact", [30, 300], Put::Own(contact::normal)),
    row(9, "size ratio of up to a million", [40, 240], Put::Distance(scale::ratio)),
    row(10, "up to 1e9 m from the origin", [40, 300], Put::Distances(scale::far_from_the_origin, scale::unmoved)),
    row(11, "units of 1e-9 to 1e9 m", [40, 312], Put::Distances(scale::units, scale::unscaled)),
    row(12, "needles and plates", [40, 300], Put::Distance(scale::needles)),
    row(13, "parallel flats, accuracy 1e-4 to 1e-14", [40, 189], Put::Distance(contact::tight)),
    row(14, "tip of degree 8 against a flat", [40, 192], Put::Distance(contact::tips)),
    row(15, "smooth shapes of 20 cm, gap ±2 mm", [32, 240], Put::Distances(contact::smooth, contact::deep)),
    row(16, "deep penetration, on the way in", [6, 60], Put::Own(depth::slide)),
    row(18, "bad warm start", [20, 200], Put::Own(limits::bad_hint)),
    row(19, "arguments swapped, frame moved", [20, 200], Put::Distances(placement::swapped, placement::unswapped)),
    row(20, "gradients against differences", [56, 560], Put::Own(derivatives::gradient)),
    row(21, "ties are flagged, jumps too", [12, 120], Put::Own(ties::ties)),
    row(22, "time of impact: blade, slab, grazing", [30, 300], Put::Own(motion::impact)),
    row(25, "ill-conditioned data", [2 * data::BAD, 3 * data::BAD + 100], Put::Own(data::ill_conditioned)),
    row(26, "fits of degenerate clouds", [clouds::KINDS - 1, 6 * clouds::KINDS], Put::Own(clouds::clouds)),
    row(27, "level distance saturates", [20, 200], Put::Own(depth::saturation)),
];

const fn row(number: u8, name: &'static str, cases: [u64; 2], put: Put) -> Family {
    Family { number, name, cases, put }
}

impl Family {
    /// Puts one case to a method.
    pub(super) fn put(&self, seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
        let verdict = match self.put {
            Put::Distance(case) => case(seed)?.put(method)?,
            Put::Distances(cases, together) => put_together(cases(seed)?, together, method)?,
            Put::Own(put) => put(seed, method)?,
        };
        Ok(verdict.map(|verdict| match verdict {
            Verdict::Off(error) if !error.is_finite() => Verdict::WrongStatus("an answer is no number".into()),
            verdict => verdict,
        }))
    }
}

impl Family {
    /// Bodies and poses of a case, for people; empty for families that put theirs in their own way.
    pub(super) fn describe(&self, seed: u64) -> String {
        let cases = match self.put {
            Put::Distance(case) => case(seed).map(|case| vec![case]),
            Put::Distances(cases, _) => cases(seed),
            Put::Own(_) => return String::new(),
        };
        match cases {
            Ok(cases) => cases.iter().map(Case::describe).collect::<Vec<_>>().join("\n"),
            Err(error) => error.to_string(),
        }
    }
}

/// Each for itself, then all together; the first failure counts.
fn put_together(cases: Vec<Case>, together: Together, method: Method) -> Result<Option<Verdict>, CaseError> {
    let mut answers = Vec::new();
    for case in cases {
        let Some(said) = case.run(method)? else { return Ok(None) };
        if said.verdict != Verdict::Pass {
            return Ok(Some(said.verdict));
        }
        answers.push((case, said));
    }
    together(&answers, method).map(Some)
}

/// The index of a seed's case among so many that go through all settings, permuted so that the
/// first seeds meet all settings.
fn permuted_index(seed: u64, cases: u64) -> u64 {
    // Prime, and no factor of the numbers of cases.
    seed % cases * 61 % cases
}

/// A draw for a case of a family.
fn random(family: u64, seed: u64) -> Random {
    Random(family * 1_000_000 + seed)
}

/// A body of a list.
fn any<'a>(random: &mut Random, bodies: &'a [Body]) -> &'a Body {
    &bodies[random.index(bodies.len())]
}

/// A rotation, and a translation of this length, metres.
fn somewhere(random: &mut Random, length: f64) -> Result<Pose, CaseError> {
    let rotation = random.rotation();
    pose(random.direction() * length, &rotation)
}

/// Upright at a place, metres.
fn at(place: Vector3<f64>) -> Result<Pose, CaseError> {
    pose(place, &UnitQuaternion::identity())
}

/// The pose moved by a translation of the world, metres.
fn shifted(from: &Pose, by: Vector3<f64>) -> Result<Pose, CaseError> {
    pose(from.translation() + by, from.rotation())
}

/// The case with the second body moved along the line of the nearest points until the gap is this,
/// metres; first they are apart.
fn moved_to(mut case: Case, gap: f64) -> Result<Case, CaseError> {
    let answer = case.ours(Method::Cold)?;
    if let Some(n) = answer.normal {
        case.pose_b = shifted(&case.pose_b, n * (answer.value() - gap))?;
    }
    Ok(case)
}
