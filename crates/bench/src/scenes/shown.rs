//! What pages show of `scenes.csv`: tables, a picture, and sentences with numbers.

use std::fmt::Write;

use sublevel::draw::{ChartError, Group, Ink, Marker, Point, Scatter};

use super::calls::Call;
use super::clutter::Clutter;
use super::poses_at_rate::Ages;
use super::ticks::Tick;
use crate::csv::{CsvError, Row, Table};

/// The tables of a CSV.
pub(crate) struct Shown {
    calls: Vec<Call>,
    ticks: Vec<Tick>,
    ages: Ages,
    fork_us: f64,
    clutter: Clutter,
}

impl Shown {
    /// Reads what [`Scenes::csv`](super::Scenes::csv) wrote: three tables, empty lines between
    /// them.
    pub(crate) fn read(csv: &str) -> Result<Self, CsvError> {
        let mut parts = csv.split("\n\n");
        let mut table = || Table::read(parts.next().unwrap_or_default());
        let (calls, ticks, others) = (table()?, table()?, table()?);
        let call = |row: Row<'_>| {
            Ok(Call {
                method: row.text("method")?.to_owned(),
                about: row.text("about")?.to_owned(),
                items: row.get("items")?,
                free: row.maybe("free")?,
                call_us: row.number("call_us")?,
                inside_us: row.number("inside_us")?,
                transport_us: row.number("transport_us")?,
            })
        };
        let tick = |row: Row<'_>| {
            Ok(Tick {
                objects: row.get("objects")?,
                moved: row.get("moved")?,
                pairs: row.get("pairs")?,
                tick_ms: row.number("tick_ms")?,
                update_ms: row.number("update_ms")?,
                solve_ms: row.number("solve_ms")?,
            })
        };
        let calls = calls.rows().map(call).collect::<Result<_, CsvError>>()?;
        let ticks = ticks.rows().map(tick).collect::<Result<_, CsvError>>()?;
        let row = others.first()?;
        let ages = Ages {
            capacity_per_s: row.number("capacity_per_s")?,
            asked_per_s: row.number("asked_per_s")?,
            sent_per_s: row.number("sent_per_s")?,
            median_ms: row.number("median_ms")?,
            p99_ms: row.number("p99_ms")?,
        };
        let clutter = Clutter {
            free: row.get("free")?,
            finest_ms: row.number("finest_ms")?,
            ladder_ms: row.number("ladder_ms")?,
        };
        Ok(Self { calls, ticks, ages, fork_us: row.number("fork_us")?, clutter })
    }

    /// The pictures by name.
    pub(crate) fn pictures(&self) -> Result<Vec<(String, String)>, ChartError> {
        Ok(vec![("scenes-ticks.svg".into(), self.chart()?)])
    }

    /// What a block of a page holds.
    pub(crate) fn block(&self, name: &str) -> Option<String> {
        match name {
            "calls" => Some(self.calls()),
            "ticks" => Some(self.ticks() + "\n![scenes-ticks.svg](scenes-ticks.svg)\n"),
            "tick table" => Some(self.ticks()),
            "others" => Some(self.others()),
            _ => None,
        }
    }

    fn calls(&self) -> String {
        let mut text = String::from(
            "| call | about | of these free | call µs | in process µs | transport µs | ratio |\n|---|---|---|---|---|---|---|\n",
        );
        for call in &self.calls {
            let Call { method, about, items, free, call_us, inside_us, transport_us } = call;
            let free = free.map_or("-".into(), |free| free.to_string());
            let transport = if *transport_us > 0.0 { format!("{transport_us:.0}") } else { "-".into() };
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {method}, {items} | {about} | {free} | {call_us:.0} | {inside_us:.0} | {transport} | {:.2} |",
                call.ratio()
            );
        }
        text
    }

    fn ticks(&self) -> String {
        let mut text = String::from(
            "| objects | moved | near pairs | tick ms | of which poses ms | solving the pairs ms | tick over solving |\n\
             |---|---|---|---|---|---|---|\n",
        );
        for Tick { objects, moved, pairs, tick_ms, update_ms, solve_ms } in &self.ticks {
            let _ = writeln!(
                text,
                "| {objects} | {moved} | {pairs} | {tick_ms:.2} | {update_ms:.2} | {solve_ms:.2} | {:.2} |",
                tick_ms / solve_ms
            );
        }
        text
    }

    fn others(&self) -> String {
        let Ages { capacity_per_s, asked_per_s, sent_per_s, median_ms, p99_ms } = self.ages;
        let Clutter { free, finest_ms, ladder_ms } = self.clutter;
        format!(
            "- Poses of 100 objects of 1 000 are streamed {sent_per_s:.0} times a second, beside four clients that ask what is near\n  \
             {asked_per_s:.0} times a second (alone they get {capacity_per_s:.0} answers). The poses that an answer is true of were sent\n  \
             {median_ms:.2} ms before it in the median, {p99_ms:.2} ms at the 99th percentile.\n\
             - A fork of a scene of 10 000 objects takes {:.2} µs.\n\
             - 500 states of 11 among 400 objects: {ladder_ms:.2} ms with ladders, {finest_ms:.2} ms with their bodies of degree 6 alone\n  \
             ({:.1} times), with the same decisions; {free} states are free. The finest rung decides alone where it is one body, for its\n  \
             table of heights is as fast as that of a coarser one.\n",
            self.fork_us,
            finest_ms / ladder_ms
        )
    }

    fn chart(&self) -> Result<String, ChartError> {
        let group = |label: &str, ink, marker, of: &dyn Fn(&Tick) -> f64| {
            let point = |tick: &Tick| Point { x: tick.objects as f64, y: of(tick), label: String::new() };
            Group { label: label.into(), ink, marker, points: self.ticks.iter().map(point).collect(), joined: true }
        };
        // n log n through the first tick.
        let grown = |tick: &Tick| {
            let first = self.ticks.first().unwrap_or(tick);
            let size = |tick: &Tick| tick.objects as f64 * (tick.objects as f64).ln();
            first.tick_ms * size(tick) / size(first)
        };
        let groups = vec![
            group("a tick", Ink::Blue, Marker::Disc, &|tick| tick.tick_ms),
            group("solving its near pairs", Ink::Green, Marker::Triangle, &|tick| tick.solve_ms),
            group("n log n", Ink::Grey, Marker::Ring, &grown),
        ];
        Scatter {
            title: "A tenth of the objects moves, and all pairs within 5 cm are measured".into(),
            x_label: "objects".into(),
            y_label: "time (ms)".into(),
            groups,
            stairs: Vec::new(),
            edge: None,
            named: None,
        }
        .to_svg()
    }
}
