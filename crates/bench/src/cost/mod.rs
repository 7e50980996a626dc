//! Cost: how time and memory grow with degree, constraints, parts, poses of a batch, pairs of a
//! message, and points of a fit; and what a body takes before the first query.

mod bodies;
mod effort;
mod fits;
mod growth;
mod memory;
mod queries;
mod report;
mod shown;

use super::Machine;
use super::comparison::{ComparisonError, FitCache, Subject};
use effort::Effort;
use fits::Fitting;
use growth::{Growth, Line, Unit};
pub(crate) use shown::Shown;
use std::ops::ControlFlow;
use std::path::Path;

/// Nanoseconds of a message with this many pairs, sent to a server and answered, for each number of
/// pairs. The server lives in another module.
pub type Messages<'a> = &'a mut dyn FnMut(&[usize]) -> Result<Vec<f64>, String>;

/// What grows how fast.
pub struct Cost {
    machine: Machine,
    quick: bool,
    passes: usize,
    growths: Vec<Growth>,
}

/// Measures chair and human of the meshes in `data`. Fits are kept in the `cache`; `messages` sends
/// messages to a server, and `program` is `sublevel`, whose memory is looked at as it fits.
/// `progress` receives what is going on and can stop it.
///
/// # Errors
/// [`ComparisonError`].
pub fn cost(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    (messages, program): (Messages<'_>, Option<&Path>),
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Cost, ComparisonError> {
    let effort = if quick {
        Effort {
            degrees: &[2, 4, 6],
            slabs: &[0, 1, 3, 7],
            parts: &[1, 2, 4],
            batches: &[1, 8, 64, 512],
            messages: &[1, 16, 256],
            points: &[100, 1000, 3000],
            trajectories: 2,
            poses: 100,
            passes: 3,
        }
    } else {
        Effort {
            degrees: &[2, 4, 6, 8],
            slabs: &[0, 1, 3, 5, 7, 11, 15],
            parts: &[1, 2, 4, 8, 12, 16],
            batches: &[1, 2, 4, 8, 16, 32, 64, 128, 256, 512, 1024, 2048, 4096],
            messages: &[1, 4, 16, 64, 256, 1024, 2048, 4096],
            points: &[100, 300, 1000, 3000, 10_000, 30_000, 100_000, 300_000, 1_000_000],
            trajectories: 4,
            poses: 400,
            passes: 5,
        }
    };
    let mut announce = |at: &str| if progress(at).is_break() { Err(ComparisonError::Cancelled) } else { Ok(()) };
    let [chair, human] = [Subject::read("chair", data)?, Subject::read("human", data)?];
    let pair = [&chair, &human];
    let mut growths = vec![
        queries::degrees(pair, &effort, cache, &mut announce)?,
        bodies::bodies(&chair, &effort, cache, &mut announce)?,
        queries::constraints(pair, &effort, cache, &mut announce)?,
        queries::parts(pair, &effort, cache, &mut announce)?,
        queries::batches(pair, &effort, cache, &mut announce)?,
    ];
    announce("messages")?;
    growths.push(sent(effort.messages, messages)?);
    let fitting = Fitting { program, folder: cache.folder() };
    growths.push(fits::degrees(&chair, &effort, &fitting, &mut announce)?);
    growths.push(fits::points(&chair, &effort, &fitting, &mut announce)?);
    Ok(Cost { machine: Machine::this(), quick, passes: effort.passes, growths })
}

fn sent(sizes: &[usize], messages: Messages<'_>) -> Result<Growth, ComparisonError> {
    let times = messages(sizes).map_err(ComparisonError::Messages)?;
    let mut whole = Line::new("a message", Unit::Nanoseconds);
    let mut each = Line::new("a pair of it", Unit::Nanoseconds);
    for (&size, time) in sizes.iter().zip(times) {
        whole.points.push((size as f64, time));
        each.points.push((size as f64, time / size as f64));
    }
    Ok(Growth {
        axis: growth::MESSAGE,
        what: "Evaluate over gRPC on loopback, client and server in one process: distances of pairs of bodies of degree 4, 64 of each of two kinds in a scene of \
               20 m, all pairs of a message different."
            .into(),
        lines: vec![whole, each],
    })
}
