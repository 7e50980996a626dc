//! The stability table: families of queries that broke collision libraries, put to our solver and
//! to others.
//!
//! The cases are those of `sublevel_testkit::catalogue`. Each is drawn from its seed alone and
//! judged by bounds that do not depend on the solver (`arbiter`), in a child process that is
//! stopped where it hangs (`runner`).

mod arbiter;
mod families;
mod method;
mod pair;
mod question;
mod report;
mod runner;
mod table;

use super::Machine;
use super::baselines::Clarabel;
use super::comparison::{Coal, ComparisonError};
use families::FAMILIES;
pub use method::{Method, UnknownMethod};
pub use question::Verdict;
pub use report::{Earlier, GuardError, Lost};
pub use runner::{NoShare, Share, serve};
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc::channel;
use std::thread;
use table::Row;
pub use table::Stability;

/// Puts all families to these methods, a tenth of the cases if `quick`. `program` is what to start
/// for the children: this one, with the command `chart stability`. Coal takes part where
/// `SUBLEVEL_COAL` names the program that times it, clarabel where its example is built. `progress`
/// receives what is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn stability(
    program: &Path,
    methods: &[Method],
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Stability, ComparisonError> {
    let (coal, solver) = (Coal::from_environment()?, Clarabel::find()?);
    let tasks: Vec<_> = (0..FAMILIES.len()).flat_map(|row| methods.iter().map(move |method| (row, *method))).collect();
    let next = AtomicUsize::new(0);
    let workers = thread::available_parallelism().map_or(1, usize::from);
    let mut rows: Vec<Row> =
        FAMILIES.iter().map(|family| Row { number: family.number(), name: family.name(), cells: Vec::new() }).collect();
    let (send, done) = channel();
    thread::scope(|scope| {
        for _ in 0..workers {
            let (send, tasks, next) = (send.clone(), &tasks, &next);
            scope.spawn(move || {
                while let Some(&(row, method)) = tasks.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let family = &FAMILIES[row];
                    let cases = family.cases[usize::from(!quick)].min(method.most_cases()[usize::from(!quick)]);
                    let found = runner::run(program, family, method, cases);
                    if send.send((row, method, found)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(send);
        for (count, (row, method, found)) in done.iter().enumerate() {
            let found = found.map_err(|source| {
                next.store(tasks.len(), Ordering::Relaxed);
                ComparisonError::Child { program: program.to_owned(), source }
            })?;
            rows[row].cells.extend(found);
            let at = format!("{} of {}: {}, {}", count + 1, tasks.len(), FAMILIES[row].name(), method.title());
            if progress(&at).is_break() {
                // No more tasks for anyone.
                next.store(tasks.len(), Ordering::Relaxed);
                return Err(ComparisonError::Cancelled);
            }
        }
        Ok(())
    })?;
    for row in &mut rows {
        row.cells.sort_by_key(|cell| Method::ALL.iter().position(|method| *method == cell.method));
    }
    let coal = coal.as_ref().map(Coal::version);
    let solver = solver.is_some().then(Clarabel::version);
    Ok(Stability { machine: Machine::this(), coal, solver, quick, methods: methods.to_vec(), rows })
}

#[cfg(test)]
mod tests;
