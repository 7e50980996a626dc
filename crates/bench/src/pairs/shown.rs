//! What pages show of `pairs.csv`: tables and pictures of all pairs, and sentences.

use std::fmt::Write;

use sublevel::draw::{ChartError, HeatMap};

use super::kind::Kind;
use super::race::{Question, Time, Who};
use crate::csv::{CsvError, Row, Table};
use crate::words::{Span, listed};

/// The rows of a CSV.
pub(crate) struct Shown {
    times: Vec<Time>,
}

/// The pair that others are compared with.
const SMOOTH: [Kind; 2] = [Kind::Degree(6), Kind::Degree(6)];

/// By so much two times of the same work may differ from turn to turn.
const NOISE: f64 = 0.03;

/// The file of the picture of a question.
fn picture_of(question: Question) -> String {
    format!("pairs-{}.svg", question.name())
}

impl Shown {
    /// Reads what [`Pairs::csv`](super::Pairs::csv) wrote.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let time = |row: Row<'_>| {
            let kind = |column| {
                let name = row.text(column)?;
                Kind::named(name).ok_or_else(|| row.error(format!("{column} is '{name}', no kind of shape")))
            };
            let (who, question) = (row.text("who")?, row.text("question")?);
            Ok(Time {
                kinds: [kind("a")?, kind("b")?],
                who: Who::ALL
                    .into_iter()
                    .find(|known| known.name() == who)
                    .ok_or_else(|| row.error(format!("who is '{who}'")))?,
                question: Question::ALL
                    .into_iter()
                    .find(|known| known.name() == question)
                    .ok_or_else(|| row.error(format!("question is '{question}'")))?,
                nanoseconds: row.number("ns")?,
                queries: row.get("queries")?,
                failed: row.get("failed")?,
                differs_m: row.maybe("differs_m")?,
            })
        };
        Ok(Self { times: Table::read(csv)?.rows().map(time).collect::<Result<_, CsvError>>()? })
    }

    /// A picture for each question, the most telling first.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        let titles = [
            (Question::Warm, "Distance with a hint from the pose before (ns)"),
            (Question::Cold, "Distance from nothing but the poses (ns)"),
            (Question::Near, "Overlap or not near contact (ns)"),
            (Question::NearDistance, "Distance at the poses near contact (ns)"),
            (Question::Apart, "Overlap or not apart (ns)"),
        ];
        let kinds = self.kinds();
        let picture = |(question, title): (Question, &str)| {
            let row = |a: &Kind| kinds.iter().map(|b| self.ours([*a, *b], question)).collect();
            let map = HeatMap {
                title: title.into(),
                labels: kinds.iter().map(|kind| kind.name().to_owned()).collect(),
                cells: kinds.iter().filter(|kind| kind.is_first()).map(row).collect(),
            };
            Ok((picture_of(question), map.to_svg()?))
        };
        let is_there = |(question, _): &(Question, &str)| self.times.iter().any(|time| time.question == *question);
        titles.into_iter().filter(is_there).map(picture).collect()
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        if let Some(question) = Question::ALL.into_iter().find(|question| question.name() == name) {
            let cell = |kinds| {
                let ns = self.ours(kinds, question)?;
                let decided = if question == Question::NearDistance { self.decision_share(kinds) } else { None };
                Some(format!("{ns:.0}{}", decided.map_or(String::new(), |share| format!(" ({share:.2})"))))
            };
            let mut text = format!("{}\n![{1}]({1})\n", self.matrix(cell), picture_of(question));
            if question == Question::NearDistance {
                text += &format!("\n{}", self.slower_decisions());
            }
            return Some(text);
        }
        match name {
            "coal" => Some(self.matrix(|kinds| {
                let [cold, warm] =
                    [Question::Cold, Question::Warm].map(|question| self.share(kinds, Who::Coal, question));
                Some(format!("{:.2} / {:.2}", cold?, warm?))
            })),
            "parry" => Some(self.matrix(|kinds| {
                let [cold, apart] = [Question::Cold, Question::Apart]
                    .map(|question| self.share(kinds, Who::Parry, question).map(|share| format!("{share:.2}")));
                Some(format!("{} / {}", cold?, apart.unwrap_or("-".into())))
            })),
            "agreement" => Some(self.agreement()),
            "summary" => self.summary(),
            "edges in short" => self.edges_in_short(),
            _ => None,
        }
    }

    fn kinds(&self) -> Vec<Kind> {
        let there = |kind: &Kind| self.times.iter().any(|time| time.kinds.contains(kind));
        Kind::ALL.into_iter().filter(there).collect()
    }

    fn time(&self, kinds: [Kind; 2], who: Who, question: Question) -> Option<f64> {
        let same = |time: &&Time| time.kinds == kinds && time.who == who && time.question == question;
        self.times.iter().find(same).map(|time| time.nanoseconds)
    }

    fn ours(&self, kinds: [Kind; 2], question: Question) -> Option<f64> {
        self.time(kinds, Who::Ours, question)
    }

    /// Our time in parts of another's.
    fn share(&self, kinds: [Kind; 2], who: Who, question: Question) -> Option<f64> {
        Some(self.ours(kinds, question)? / self.time(kinds, who, question)?)
    }

    /// Time of a decision near contact in parts of that of the distance at the same poses.
    fn decision_share(&self, kinds: [Kind; 2]) -> Option<f64> {
        Some(self.ours(kinds, Question::Near)? / self.ours(kinds, Question::NearDistance)?)
    }

    /// For how many pairs a decision takes longer than the distance.
    fn slower_decisions(&self) -> String {
        let kinds = self.kinds();
        let pairs = kinds.iter().flat_map(|a| kinds.iter().map(|b| [*a, *b]));
        let shares: Vec<_> = pairs.filter_map(|kinds| Some((kinds, self.decision_share(kinds)?))).collect();
        let mut slower: Vec<_> = shares.iter().filter(|(_, share)| *share > 1.0 + NOISE).collect();
        slower.sort_by(|a, b| b.1.total_cmp(&a.1));
        let named = slower.iter().map(|([a, b], share)| format!("{} and {} ({share:.2})", a.name(), b.name()));
        match slower.len() {
            0 => format!(
                "No decision of {} pairs takes longer than the distance by more than {:.0} %.\n",
                shares.len(),
                100.0 * NOISE
            ),
            count => format!(
                "The decision takes longer than the distance by more than {:.0} % for {count} of {} pairs: {}.\n",
                100.0 * NOISE,
                shares.len(),
                listed(named)
            ),
        }
    }

    /// A row for each kind of the first shape, a column for each of the second.
    fn matrix(&self, cell: impl Fn([Kind; 2]) -> Option<String>) -> String {
        let kinds = self.kinds();
        let mut text = String::from("| |");
        kinds.iter().for_each(|kind| text += &format!(" {} |", kind.name()));
        text += "\n|---|";
        kinds.iter().for_each(|_| text += "---|");
        text.push('\n');
        for a in kinds.iter().filter(|kind| kind.is_first()) {
            text += &format!("| {} |", a.name());
            kinds.iter().for_each(|b| text += &format!(" {} |", cell([*a, *b]).unwrap_or_default()));
            text.push('\n');
        }
        text
    }

    /// How far the answers are from coal's where both have the same shapes, and what failed.
    fn agreement(&self) -> String {
        let mut text = String::new();
        let differs = self
            .times
            .iter()
            .filter_map(|time| time.differs_m)
            .fold(None, |most: Option<f64>, differs| Some(most.map_or(differs, |most| most.max(differs))));
        if let Some(differs) = differs {
            // Writing to a string cannot fail.
            let _ = write!(
                text,
                "Where both have the same shapes, distances differ from coal's by at most {differs:.0e} m; coal's own tolerance is \
                 1e-6 m. "
            );
        }
        let of_ours = || self.times.iter().filter(|time| time.who == Who::Ours);
        let (failed, queries): (usize, usize) =
            (of_ours().map(|time| time.failed).sum(), of_ours().map(|time| time.queries).sum());
        let _ = writeln!(text, "Of {queries} of our answers {failed} are wider than asked for or undecided.");
        text
    }

    /// What bodies that slabs cut take beside others, as a list item.
    fn edges_in_short(&self) -> Option<String> {
        let span = |cut: bool, question| {
            let ours = self.times.iter().filter(|time| time.who == Who::Ours && time.question == question);
            let of_kind = ours.filter(|time| time.kinds[1].is_first() && time.kinds.contains(&Kind::SlabCut) == cut);
            let (least, most) = of_kind.fold((f64::INFINITY, 0.0_f64), |(least, most), time| {
                (least.min(1e-3 * time.nanoseconds), most.max(1e-3 * time.nanoseconds))
            });
            // Of a quick run there is nothing to say.
            (most > 0.0)
                .then(|| if cut { format!("{least:.1} to {most:.1}") } else { format!("{least:.2} to {most:.1}") })
        };
        Some(format!(
            "- Bodies that slabs cut take {} µs with a hint and {} µs cold, where pairs of all other shapes take {} and {} µs\n  \
             ([pairs](docs/pairs.md)).{}\n",
            span(true, Question::Warm)?,
            span(true, Question::Cold)?,
            span(false, Question::Warm)?,
            span(false, Question::Cold)?,
            self.half_spaces_in_short().unwrap_or_default()
        ))
    }

    /// What bodies take above half-spaces, of which there are none in earlier runs.
    fn half_spaces_in_short(&self) -> Option<String> {
        let above = |kind| self.ours([kind, Kind::HalfSpace], Question::Cold);
        let smooth = Kind::ALL.into_iter().filter(|kind| matches!(kind, Kind::Degree(_))).filter_map(above);
        let (smooth, cut) = (Span::of(smooth)?, above(Kind::SlabCut)?);
        Some(format!(
            " From half-spaces\n  smooth bodies take {} cold, and those that slabs cut {:.1} µs.",
            smooth.microseconds(),
            1e-3 * cut
        ))
    }

    /// Shapes with edges beside smooth ones, as a table for other pages.
    fn summary(&self) -> Option<String> {
        let smooth = |question| self.ours(SMOOTH, question);
        let mut text = String::from(
            "| pair | cold | warm | overlap near contact | overlap apart | cold, of coal cold | warm, of coal cached |\n\
             |---|---|---|---|---|---|---|\n",
        );
        let shown = [
            SMOOTH,
            [Kind::Degree(6), Kind::SlabCut],
            [Kind::Degree(6), Kind::Cuboid],
            [Kind::Degree(6), Kind::Cylinder],
            [Kind::Degree(6), Kind::Capsule],
            [Kind::Cuboid, Kind::Cuboid],
            [Kind::Cuboid, Kind::Cylinder],
            [Kind::Cylinder, Kind::Cylinder],
            [Kind::Ball, Kind::Ball],
            [Kind::Degree(6), Kind::HalfSpace],
        ];
        // Earlier runs had no half-spaces.
        for kinds in shown.into_iter().filter(|kinds| self.ours(*kinds, Question::Cold).is_some()) {
            let time = |question| Some(format!("{:.0} ns", self.ours(kinds, question)?));
            let of_smooth = |question| {
                Some(format!("{} ({:.1})", time(question)?, self.ours(kinds, question)? / smooth(question)?))
            };
            let share =
                |question| self.share(kinds, Who::Coal, question).map_or("-".into(), |share| format!("{share:.2}"));
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {} - {} | {} | {} | {} | {} | {} | {} |",
                kinds[0].name(),
                kinds[1].name(),
                of_smooth(Question::Cold)?,
                of_smooth(Question::Warm)?,
                time(Question::Near).unwrap_or("-".into()),
                time(Question::Apart).unwrap_or("-".into()),
                share(Question::Cold),
                share(Question::Warm)
            );
        }
        Some(text)
    }
}
