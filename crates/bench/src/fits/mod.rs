//! Fits: time against volume, by each solver and over each cone.

mod fitting;
mod report;
mod shown;

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use sublevel::fit::{Cone, fit};

use super::Machine;
use super::comparison::Subject;
use fitting::{Fitting, Method};
pub(crate) use shown::Shown;

/// The meshes of the paper's Table I.
const SUBJECTS: [&str; 5] = ["human", "chair", "octopus", "hand", "vase"];

/// Runs of a fit, of which the median counts, unless one takes longer than [`LONG_S`].
const RUNS: usize = 5;
const LONG_S: f64 = 3.0;

/// What was measured.
pub struct Fits {
    machine: Machine,
    quick: bool,
    fittings: Vec<Fitting>,
}

/// Fits the five meshes of `data` by every method at degrees 2 to 8, or 2 to 6. `progress` receives
/// what is going on and can stop it.
///
/// # Errors
/// Data that is missing, and fits that fail.
pub fn fits(
    data: &Path,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Fits, Box<dyn Error>> {
    let mut fittings = Vec::new();
    for name in SUBJECTS {
        let subject = Subject::read(name, data)?;
        for degree in if quick { &[2, 4, 6][..] } else { &[2, 4, 6, 8] } {
            for method in Method::ALL {
                if progress(&format!("{name}, degree {degree}, {}", method.name())).is_break() {
                    return Err("stopped".into());
                }
                fittings.push(fitting(&subject, *degree, method, quick)?);
            }
        }
    }
    Ok(Fits { machine: Machine::this(), quick, fittings })
}

fn fitting(subject: &Subject, degree: usize, method: Method, quick: bool) -> Result<Fitting, Box<dyn Error>> {
    let options = method.options(degree);
    let mut times = Vec::new();
    let made = loop {
        let start = Instant::now();
        let made = fit(subject.name, &subject.mesh.points, &options, &mut |_| ControlFlow::Continue(()))?;
        let seconds = start.elapsed().as_secs_f64();
        times.push(seconds);
        if quick || seconds > LONG_S || times.len() == RUNS {
            break made.report;
        }
    };
    times.sort_by(f64::total_cmp);
    let is_sos = options.cone == Cone::Sos;
    Ok(Fitting {
        mesh: subject.name.to_owned(),
        vertices: made.hull_vertices,
        method: method.name().to_owned(),
        degree,
        seconds: times[times.len() / 2],
        ratio: made.volume_m3 / made.hull_volume_m3,
        objective: is_sos.then_some(made.objective_value),
        gap: made.optimality_gap,
        rounds: made.rounds,
        iterations: made.iterations,
    })
}
