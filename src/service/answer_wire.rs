//! Answers of questions in messages, as a client reads them; what cannot be read is named.

use nalgebra::Vector3;

use crate::measure::Twist;
use crate::scene::query::{Answer, AnswerStatus, Certainty, StateVerdict, Verdict};

use super::error::Invalid;
use super::proto;

fn no_value(field: String, number: i32, of: &str) -> Invalid {
    Invalid::new(field, format!("is {number}, which is no {of}"))
}

/// What a state or a motion is.
pub(crate) fn verdict(number: i32, field: impl FnOnce() -> String) -> Result<StateVerdict, Invalid> {
    match proto::Verdict::try_from(number) {
        Ok(proto::Verdict::Free) => Ok(StateVerdict::Free),
        Ok(proto::Verdict::Contact) => Ok(StateVerdict::Contact),
        Ok(proto::Verdict::Undecided) => Ok(StateVerdict::Undecided),
        Ok(proto::Verdict::Invalid) => Ok(StateVerdict::Invalid),
        Ok(proto::Verdict::NotChecked) => Ok(StateVerdict::NotChecked),
        Ok(proto::Verdict::Unspecified) | Err(_) => Err(no_value(field(), number, "verdict")),
    }
}

/// The verdicts of a column with one byte each.
pub(crate) fn verdicts(column: &[u8]) -> Result<Vec<StateVerdict>, Invalid> {
    let read = |(row, &byte): (usize, &u8)| verdict(byte.into(), || format!("verdicts[{row}]"));
    column.iter().enumerate().map(read).collect()
}

/// How an answer came about.
pub(crate) fn status(number: i32, field: impl FnOnce() -> String) -> Result<AnswerStatus, Invalid> {
    match proto::SolveStatus::try_from(number) {
        Ok(proto::SolveStatus::Converged) => Ok(AnswerStatus::Converged),
        Ok(proto::SolveStatus::BracketWide) => Ok(AnswerStatus::BracketWide),
        Ok(proto::SolveStatus::Deadline) => Ok(AnswerStatus::Deadline),
        Ok(proto::SolveStatus::NotDefined) => Ok(AnswerStatus::NotDefined),
        Ok(proto::SolveStatus::Allowed) => Ok(AnswerStatus::Allowed),
        Ok(proto::SolveStatus::Unspecified) | Err(_) => Err(no_value(field(), number, "status")),
    }
}

/// Whether contact of bodies is one of the objects inside.
pub(crate) fn certainty(number: i32, field: impl FnOnce() -> String) -> Result<Certainty, Invalid> {
    match proto::Certainty::try_from(number) {
        Ok(proto::Certainty::Unspecified) => Ok(Certainty::None),
        Ok(proto::Certainty::Certain) => Ok(Certainty::Certain),
        Ok(proto::Certainty::Possible) => Ok(Certainty::Possible),
        Err(_) => Err(no_value(field(), number, "certainty")),
    }
}

/// The answer to a yes-or-no question; none of other measures.
fn decision(number: i32, field: impl FnOnce() -> String) -> Result<Option<Verdict>, Invalid> {
    match proto::Decision::try_from(number) {
        Ok(proto::Decision::Unspecified) => Ok(None),
        Ok(proto::Decision::Yes) => Ok(Some(Verdict::Yes)),
        Ok(proto::Decision::No) => Ok(Some(Verdict::No)),
        Ok(proto::Decision::Undecided) => Ok(Some(Verdict::Undecided)),
        Err(_) => Err(no_value(field(), number, "decision")),
    }
}

/// A vector where there is one.
pub(crate) fn vector(of: Option<&proto::Vector3>) -> Option<Vector3<f64>> {
    of.map(|v| Vector3::new(v.x, v.y, v.z))
}

/// Two vectors where there are both.
pub(crate) fn vectors(a: Option<&proto::Vector3>, b: Option<&proto::Vector3>) -> Option<[Vector3<f64>; 2]> {
    Some([vector(a)?, vector(b)?])
}

fn twist(of: Option<&proto::PoseGradient>) -> Option<Twist> {
    let of = of?;
    Some(Twist { linear: vector(of.linear.as_ref())?, angular: vector(of.angular.as_ref())? })
}

/// One measure of one pair, by its place in `answers`; outputs that were not asked for are as of an
/// answer without them.
pub(crate) fn answer(message: &proto::Answer, index: usize) -> Result<Answer, Invalid> {
    let at = |leaf: &'static str| move || format!("answers[{index}].{leaf}");
    let part = |part: u32, leaf| u16::try_from(part).map_err(|_| Invalid::new(at(leaf)(), "is no number of a part"));
    let rung = |rung: u32, leaf| u8::try_from(rung).map_err(|_| Invalid::new(at(leaf)(), "is no number of a rung"));
    Ok(Answer {
        status: status(message.status, at("status"))?,
        lower: message.lower,
        upper: message.upper,
        value: message.value.unwrap_or(f64::NAN),
        verdict: decision(message.decision, at("decision"))?,
        witnesses: vectors(message.witness_a_m.as_ref(), message.witness_b_m.as_ref()),
        normal: vector(message.normal.as_ref()),
        gradients: twist(message.gradient_a.as_ref()).zip(twist(message.gradient_b.as_ref())).map(|(a, b)| [a, b]),
        not_unique: message.not_unique,
        saturated: message.saturated,
        one_sided: message.one_sided,
        parts: [part(message.part_a, "part_a")?, part(message.part_b, "part_b")?],
        rungs: [rung(message.rung_a, "rung_a")?, rung(message.rung_b, "rung_b")?],
        iterations: message.iterations,
        multiplier: message.multiplier.unwrap_or(f64::NAN),
        objects_upper: message.objects_upper.unwrap_or(f64::NAN),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::service::query_wire::{self, Outputs};

    #[test]
    fn what_the_service_writes_is_read() {
        let at = || "verdict".to_owned();
        for one in [
            StateVerdict::Free,
            StateVerdict::Contact,
            StateVerdict::Undecided,
            StateVerdict::Invalid,
            StateVerdict::NotChecked,
        ] {
            assert_eq!(verdict(query_wire::verdict(one).into(), at).expect("a verdict"), one);
        }
        for one in [
            AnswerStatus::Converged,
            AnswerStatus::BracketWide,
            AnswerStatus::Deadline,
            AnswerStatus::NotDefined,
            AnswerStatus::Allowed,
        ] {
            assert_eq!(status(query_wire::status(one).into(), at).expect("a status"), one);
        }
        for one in [Certainty::None, Certainty::Certain, Certainty::Possible] {
            assert_eq!(certainty(query_wire::certainty(one).into(), at).expect("a certainty"), one);
        }
        let twist = |x: f64| Twist { linear: Vector3::new(x, 2.0, 3.0), angular: Vector3::new(4.0, 5.0, 6.0) };
        let whole = Answer {
            status: AnswerStatus::Converged,
            lower: 0.25,
            upper: 0.5,
            value: 0.375,
            verdict: Some(Verdict::Yes),
            witnesses: Some([Vector3::new(1.0, 2.0, 3.0), Vector3::new(4.0, 5.0, 6.0)]),
            normal: Some(Vector3::z()),
            gradients: Some([twist(1.0), twist(-1.0)]),
            not_unique: true,
            saturated: false,
            one_sided: true,
            parts: [3, 4],
            rungs: [1, 2],
            iterations: 7,
            multiplier: 0.125,
            objects_upper: 0.75,
        };
        let all = Outputs {
            value: true,
            witnesses: true,
            normal: true,
            gradients: true,
            flags: true,
            parts: true,
            solver: true,
            objects: true,
            columns: false,
        };
        let message = query_wire::row(&whole, &all);
        assert_eq!(format!("{:?}", answer(&message, 0).expect("an answer")), format!("{whole:?}"));
    }

    #[test]
    fn what_cannot_be_read_is_named() {
        for (column, field) in [(&[1, 2, 0][..], "verdicts[2]"), (&[6], "verdicts[0]")] {
            assert_eq!(verdicts(column).expect_err("no verdict").field, field);
        }
        let good = proto::Answer { status: proto::SolveStatus::Converged.into(), ..Default::default() };
        answer(&good, 0).expect("an answer");
        for (bad, leaf) in [
            (proto::Answer { status: 0, ..good }, "status"),
            (proto::Answer { decision: 9, ..good }, "decision"),
            (proto::Answer { part_b: 1 << 16, ..good }, "part_b"),
            (proto::Answer { rung_a: 256, ..good }, "rung_a"),
        ] {
            let Invalid { field, why } = answer(&bad, 5).expect_err("unreadable");
            assert_eq!(field, format!("answers[5].{leaf}"));
            assert!(why.starts_with("is "), "{why}");
        }
        assert_eq!(certainty(3, || "certainty".into()).expect_err("no certainty").field, "certainty");
    }
}
