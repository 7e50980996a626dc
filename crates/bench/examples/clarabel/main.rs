//! Solves the semidefinite programs of `sublevel-bench accuracy` by clarabel and times it:
//! `clarabel IN OUT`.
//!
//! A process of its own, as for coal: clarabel's semidefinite cones need a BLAS, and the product
//! needs none.

mod solve;

use serde::Deserialize;
use solve::{Program, Solved, solve};
use std::error::Error;
use std::fs;

/// What is asked for.
#[derive(Deserialize)]
struct Asked {
    programs: Vec<Program>,
    /// Each program is solved to each of these.
    tolerances: Vec<f64>,
    /// So many times, of which the median counts.
    repeats: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut files = std::env::args_os().skip(1);
    let (Some(read), Some(write)) = (files.next(), files.next()) else { return Err("usage: clarabel IN OUT".into()) };
    let asked: Asked = serde_json::from_str(&fs::read_to_string(read)?)?;
    let one = |program: &Program, tolerance: f64| {
        let mut runs: Vec<Solved> = (0..asked.repeats.max(1)).map(|_| solve(program, tolerance)).collect();
        runs.sort_by(|a, b| a.nanoseconds.total_cmp(&b.nanoseconds));
        runs[runs.len() / 2]
    };
    // The first solve of a process finds everything cold.
    if let (Some(program), Some(&tolerance)) = (asked.programs.first(), asked.tolerances.first()) {
        solve(program, tolerance);
    }
    let of_all = |tolerance: &f64| asked.programs.iter().map(|p| one(p, *tolerance)).collect::<Vec<_>>();
    let answers: Vec<Vec<Solved>> = asked.tolerances.iter().map(of_all).collect();
    fs::write(write, serde_json::to_string(&answers)?)?;
    Ok(())
}
