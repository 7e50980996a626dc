//! Answers as packed arrays, one set for each measure.

use super::packed::{self, Packed};
use super::proto::Columns;
use super::query_wire::{Outputs, flags, measure_message, status};
use crate::scene::query::{Answer, Measure, Verdict};

/// Answers, all measures of a pair after the other, in columns.
pub(super) fn write<'a>(
    answers: impl Iterator<Item = &'a Answer>,
    measures: &[Measure],
    outputs: &Outputs,
) -> Vec<Columns> {
    let mut columns: Vec<ColumnWriter> = measures.iter().map(|_| ColumnWriter::default()).collect();
    // Answers are large: each is looked at once.
    let mut next = 0;
    for answer in answers {
        columns[next].push(answer, outputs);
        next = (next + 1) % measures.len();
    }
    columns.into_iter().zip(measures).map(|(column, &measure)| column.finish(measure)).collect()
}

/// The columns of one measure.
#[derive(Debug, Default)]
struct ColumnWriter {
    status: Packed,
    lower: Packed,
    upper: Packed,
    value: Packed,
    verdicts: Vec<Option<Verdict>>,
    witnesses: [Packed; 2],
    normal: Packed,
    gradients: [Packed; 2],
    flags: Packed,
    parts: Packed,
    iterations: Packed,
    multiplier: Packed,
    objects_upper: Packed,
}

impl ColumnWriter {
    fn push(&mut self, answer: &Answer, outputs: &Outputs) {
        self.status.byte(u8::try_from(i32::from(status(answer.status))).unwrap_or(0));
        self.lower.number(answer.lower);
        self.upper.number(answer.upper);
        self.verdicts.push(answer.verdict);
        if outputs.value {
            self.value.number(answer.value);
        }
        if outputs.witnesses {
            let points = answer.witnesses.as_ref();
            self.witnesses[0].vector(points.map(|[a, _]| a));
            self.witnesses[1].vector(points.map(|[_, b]| b));
        }
        if outputs.normal {
            self.normal.vector(answer.normal.as_ref());
        }
        if outputs.gradients {
            let twists = answer.gradients.as_ref();
            self.gradients[0].twist(twists.map(|[a, _]| a));
            self.gradients[1].twist(twists.map(|[_, b]| b));
        }
        if outputs.flags {
            self.flags.byte(flags(answer));
        }
        if outputs.parts {
            answer.parts.iter().for_each(|&part| self.parts.byte(u8::try_from(part).unwrap_or(u8::MAX)));
            answer.rungs.iter().for_each(|&rung| self.parts.byte(rung));
        }
        if outputs.solver {
            self.iterations.index(answer.iterations);
            self.multiplier.number(answer.multiplier);
        }
        if outputs.objects {
            self.objects_upper.number(answer.objects_upper);
        }
    }

    fn finish(self, measure: Measure) -> Columns {
        let decides = self.verdicts.iter().any(Option::is_some);
        let bits = |verdict: Verdict| match decides {
            true => packed::bits(self.verdicts.iter().map(|found| *found == Some(verdict))),
            false => bytes::Bytes::new(),
        };
        let [witness_a_m, witness_b_m] = self.witnesses.map(Packed::into_bytes);
        let [gradient_a, gradient_b] = self.gradients.map(Packed::into_bytes);
        Columns {
            measure: measure_message(measure).into(),
            status: self.status.into_bytes(),
            lower: self.lower.into_bytes(),
            upper: self.upper.into_bytes(),
            value: self.value.into_bytes(),
            yes: bits(Verdict::Yes),
            undecided: bits(Verdict::Undecided),
            witness_a_m,
            witness_b_m,
            normal: self.normal.into_bytes(),
            gradient_a,
            gradient_b,
            flags: self.flags.into_bytes(),
            parts: self.parts.into_bytes(),
            iterations: self.iterations.into_bytes(),
            multiplier: self.multiplier.into_bytes(),
            objects_upper: self.objects_upper.into_bytes(),
        }
    }
}
