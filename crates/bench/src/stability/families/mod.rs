//! The families of the catalogue: each case is drawn from its seed alone.

mod clouds;
mod contact;
mod data;
mod depth;
mod derivatives;
mod draws;
mod limits;
mod motion;
mod placement;
mod primitives;
mod scale;
mod ties;

use super::method::{Answer, Method};
use super::question::{CaseError, Question, Verdict};
use sublevel_testkit::catalogue::{self, Case};

/// A row of the table.
pub(super) struct Family {
    /// As the catalogue has it.
    entry: catalogue::Family,
    /// Cases of a quick run and of a full one.
    pub(super) cases: [u64; 2],
    pub(super) put: Put,
}

/// How a case is put.
pub(super) enum Put {
    /// As a distance, to all methods.
    Distance(fn(u64) -> Case),
    /// As distances, to all methods, whose answers must also go together.
    Distances(fn(u64) -> Vec<Case>, Together),
    /// In the family's own way; none where a method cannot be asked.
    Own(fn(u64, Method) -> Result<Option<Verdict>, CaseError>),
}

/// Judges answers that passed each for itself, each beside its case.
type Together = fn(&[(Question, Answer)], Method) -> Result<Verdict, CaseError>;

/// All rows, in the order of the catalogue.
pub(super) const FAMILIES: [Family; 46] = [
    row(1, [40, 360], Put::Distances(contact::kissing, contact::rising)),
    of_primitives(101, [47, 141], primitives::kissing),
    row(2, [30, 300], Put::Distance(limits::few_iterations)),
    of_primitives(102, [32, 376], primitives::few_iterations),
    row(3, [40, 80], Put::Distance(contact::parallel_faces)),
    of_primitives(103, [32, 640], primitives::parallel_faces),
    row(4, [10, 340], Put::Own(placement::far_apart)),
    of_primitives(104, [32, 640], primitives::far_apart),
    row(5, [60, 1000], Put::Distance(placement::common_point)),
    of_primitives(105, [32, 640], primitives::common_point),
    row(6, [60, 336], Put::Distance(placement::along_an_axis)),
    of_primitives(106, [48, 658], primitives::along_an_axis),
    row(7, [40, 400], Put::Distances(placement::concentric, placement::defined)),
    of_primitives(107, [32, 512], primitives::concentric),
    row(8, [30, 300], Put::Own(contact::normal)),
    of_primitives(108, [32, 320], primitives::touching),
    row(9, [40, 240], Put::Distance(scale::ratio)),
    of_primitives(109, [32, 640], primitives::ratio),
    row(10, [40, 300], Put::Distances(scale::far_from_the_origin, scale::unmoved)),
    of_primitives(110, [32, 320], primitives::far_from_the_origin),
    row(11, [40, 312], Put::Distances(scale::units, scale::unscaled)),
    of_primitives(111, [32, 832], primitives::units),
    row(12, [40, 300], Put::Distance(scale::needles)),
    of_primitives(112, [36, 600], primitives::needles),
    row(13, [40, 189], Put::Distance(contact::parallel_flats)),
    of_primitives(113, [32, 504], primitives::parallel_flats),
    row(14, [40, 192], Put::Distance(contact::tips)),
    of_primitives(114, [32, 720], primitives::tips),
    row(15, [32, 240], Put::Distances(contact::smooth, contact::deep)),
    of_primitives(115, [32, 320], primitives::grazing),
    row(16, [6, 60], Put::Own(depth::slide)),
    of_primitives(116, [32, 128], primitives::slide),
    row(18, [20, 200], Put::Own(limits::bad_hint)),
    of_primitives(118, [32, 320], primitives::bad_hint),
    row(19, [20, 200], Put::Distances(placement::swapped, placement::unswapped)),
    of_primitives(119, [32, 320], primitives::swapped),
    row(20, [56, 560], Put::Own(derivatives::gradient)),
    of_primitives(120, [32, 896], primitives::gradient),
    row(21, [12, 120], Put::Own(ties::ties)),
    of_primitives(121, [16, 160], primitives::ties),
    row(22, [30, 300], Put::Own(motion::impact)),
    row(25, [2 * catalogue::data::KINDS, 3 * catalogue::data::KINDS + 100], Put::Own(data::ill_conditioned)),
    of_primitives(125, [23, 221], primitives::ill_conditioned),
    row(26, [catalogue::clouds::KINDS - 1, 6 * catalogue::clouds::KINDS], Put::Own(clouds::clouds)),
    row(27, [20, 200], Put::Own(depth::saturation)),
    of_primitives(127, [10, 100], primitives::saturation),
];

/// The row of the catalogue's family of this number.
const fn row(number: u8, cases: [u64; 2], put: Put) -> Family {
    let mut index = 0;
    while catalogue::FAMILIES[index].number != number {
        index += 1;
    }
    Family { entry: catalogue::FAMILIES[index], cases, put }
}

/// The row of the catalogue's family of this number between primitives.
const fn of_primitives(
    number: u8,
    cases: [u64; 2],
    put: fn(u64, Method) -> Result<Option<Verdict>, CaseError>,
) -> Family {
    let mut index = 0;
    while catalogue::PRIMITIVES[index].number != number {
        index += 1;
    }
    Family { entry: catalogue::PRIMITIVES[index], cases, put: Put::Own(put) }
}

impl Family {
    pub(super) fn number(&self) -> u8 {
        self.entry.number
    }

    pub(super) fn name(&self) -> &'static str {
        self.entry.name
    }

    /// Puts one case to a method.
    pub(super) fn put(&self, seed: u64, method: Method) -> Result<Option<Verdict>, CaseError> {
        let verdict = match self.put {
            Put::Distance(case) => Question(case(seed)).put(method)?,
            Put::Distances(cases, together) => put_together(cases(seed), together, method)?,
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
            Put::Distance(case) => vec![case(seed)],
            Put::Distances(cases, _) => cases(seed),
            Put::Own(_) => return String::new(),
        };
        cases.into_iter().map(|case| Question(case).describe()).collect::<Vec<_>>().join("\n")
    }
}

/// Each for itself, then all together; the first failure counts.
fn put_together(cases: Vec<Case>, together: Together, method: Method) -> Result<Option<Verdict>, CaseError> {
    let mut answers = Vec::new();
    for question in cases.into_iter().map(Question) {
        let Some(answer) = question.run(method)? else { return Ok(None) };
        if answer.verdict != Verdict::Pass {
            return Ok(Some(answer.verdict));
        }
        answers.push((question, answer));
    }
    together(&answers, method).map(Some)
}
