//! The log of a run as Markdown.

use crate::state::State;
use crate::tally::WANTED;
use std::fmt::Write;

/// `given` says whether the bodies are others than those of the catalogue.
pub(crate) fn markdown(state: &State, given: bool, threads: usize) -> String {
    let tally = &state.tally;
    let mut text = String::new();
    let mut line = |what: std::fmt::Arguments<'_>| writeln!(text, "{what}").expect("a string takes all");
    line(format_args!("# Endurance\n"));
    line(format_args!(
        "Random, grazing, aligned and far queries of pairs of {}; `cargo bench -p sublevel-bench --bench endurance`.",
        if given { "given bodies" } else { "the bodies of a catalogue" }
    ));
    let with = if given { " --bodies DIR" } else { "" };
    line(format_args!("Block N of this run replays with `-- --seed {}{with} --block N`.\n", state.seed));
    line(format_args!("| run | |\n|---|---:|"));
    line(format_args!("| bracketed solves | {} |", grouped(tally.solves)));
    line(format_args!("| blocks | {} |", grouped(state.blocks())));
    line(format_args!("| failures | {} |", grouped(tally.failed())));
    let hours = state.seconds / 3600.0;
    line(format_args!("| hours on {threads} threads | {hours:.2} |"));
    line(format_args!("| largest deviation from the semidefinite program, of the size | {:.1e} |", tally.deviation));
    let commits: Vec<_> = state.commits.iter().map(String::as_str).collect();
    line(format_args!("| commits | {} |\n", commits.join(", ")));
    line(format_args!("| check | made | failed |\n|---|---:|---:|"));
    for (check, made) in &tally.checks {
        let failed = tally.failures.get(check).copied().unwrap_or(0);
        line(format_args!("| {} | {} | {} |", check.name(), grouped(*made), grouped(failed)));
    }
    line(format_args!(
        "\n| iterations | solves | mean | median | 99.9 % | above {WANTED} | most | where |\n|---|---:|---:|---:|---:|---:|---:|---|"
    ));
    for (name, iterations) in &tally.iterations {
        let worst = iterations.worst;
        line(format_args!(
            "| {name} | {} | {:.2} | {} | {} | {:.3} % | {} | block {} query {} |",
            grouped(iterations.solves()),
            iterations.mean(),
            iterations.quantile(0.5),
            iterations.quantile(0.999),
            100.0 * iterations.above(WANTED),
            worst.iterations,
            worst.block,
            worst.query
        ));
    }
    if !tally.kept.is_empty() {
        line(format_args!("\n| first failures | block | query |\n|---|---:|---:|"));
        for failure in tally.kept.iter().take(20) {
            line(format_args!("| {} | {} | {} |", failure.check.name(), failure.block, failure.query));
        }
    }
    text
}

/// `1 234 567`.
fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let mut text = String::new();
    for (i, digit) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            text.push(' ');
        }
        text.push(digit);
    }
    text
}
