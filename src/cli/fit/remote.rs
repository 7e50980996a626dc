//! `sublevel fit --server`: the same, made elsewhere.

use crate::cli::remote::{connect, interrupted};
use crate::client::{JobProgress, SubmitError};
use crate::jobs::{FitOutput, Phase};
use crate::store::FitRequest;
use indicatif::ProgressBar;
use nalgebra::Vector3;
use std::error::Error;

/// Has the server execute a request about points (metres) and the triangles between them, or about
/// bodies that it has. Ctrl-C cancels.
pub(in crate::cli) fn execute(
    url: &str,
    request: &FitRequest,
    points: &[Vector3<f64>],
    triangles: &[[usize; 3]],
    bar: &ProgressBar,
) -> Result<FitOutput, Box<dyn Error>> {
    bar.set_message("sending");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let tell = |job: &JobProgress| bar.set_message(describe(job));
    let fitted =
        runtime.block_on(async { connect(url).await?.fit(request, (points, triangles), tell, interrupted()).await });
    Ok(fitted.map_err(|error: SubmitError| error)?)
}

fn describe(job: &JobProgress) -> String {
    let Some(progress) = job.progress else { return format!("job {} waits for its turn", job.id) };
    match progress.phase {
        Phase::Trimming | Phase::Solving => format!(
            "job {}: round {}, step {}, {:.0e} from the optimum of {} points",
            job.id, progress.rounds, progress.iterations, progress.gap, progress.active_points
        ),
        Phase::Preparing => format!("job {}: convex hull", job.id),
    }
}
