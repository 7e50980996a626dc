//! `sublevel fit --server`: the same bodies and the same table, fitted elsewhere.

use super::super::write_atomically;
use super::{FitArgs, Row, Solve, progress_bar};
use crate::body::Body;
use crate::fit::read_points;
use crate::service::proto::{FitJob, FitPhase, FitResult, FitState, FittedBody};
use crate::service::{self, Submitted};
use crate::store::FitOrder;
use std::error::Error;
use std::path::Path;

/// Has the server fit one input, and writes the files of its bodies.
pub(super) fn one(args: &FitArgs, url: &str, input: &Path, stem: &str) -> Result<Vec<Row>, Box<dyn Error>> {
    let bar = progress_bar(stem);
    bar.set_message("reading");
    let points = read_points(input, args.scale)?;
    bar.set_message("sending");
    let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build()?;
    let cancel = async {
        // Without signals nobody can cancel, and the fit ends by itself.
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    };
    let tell = |job: &FitJob| bar.set_message(describe(job));
    let Submitted { job, bodies } = runtime
        .block_on(service::submit(url, &order(args, input, stem), &points, tell, cancel))
        .map_err(|error| format!("{}: {error}", input.display()))?;
    bar.finish_and_clear();
    let result = job.result.unwrap_or_default();
    if result.left_out_count > 0 {
        let FitResult { left_out_count, left_out_m, .. } = result;
        let input = input.display();
        eprintln!(
            "note: {input}: {left_out_count} points left out, up to {left_out_m:.3e} m outside the hull of the others"
        );
    }
    bodies.iter().map(|(fitted, body)| row(args, input, stem, &result, fitted, body)).collect()
}

fn order(args: &FitArgs, input: &Path, stem: &str) -> FitOrder {
    FitOrder {
        name: stem.to_owned(),
        input: super::options(args, input).input,
        degree: args.degree,
        objective: args.objective.to_string(),
        refine: args.refine,
        slabs: args.slabs,
        ladder: args.ladder,
        max_gap_m: args.max_gap,
        trim: args.trim,
        min_thickness_m: args.min_thickness,
        // The points are in metres when they are sent.
        scale: 1.0,
    }
}

fn describe(job: &FitJob) -> String {
    let waits = format!("job {} waits for its turn", job.id);
    let Some(progress) = job.progress.filter(|_| job.state() == FitState::Running) else { return waits };
    match progress.phase() {
        FitPhase::Trimming | FitPhase::Fitting => format!(
            "job {}: round {}, step {}, {:.0e} from the optimum of {} points",
            job.id, progress.rounds, progress.iterations, progress.gap, progress.active_points
        ),
        FitPhase::Preparing | FitPhase::Unspecified => format!("job {}: convex hull", job.id),
    }
}

/// Writes one body and describes it.
fn row(
    args: &FitArgs,
    input: &Path,
    stem: &str,
    result: &FitResult,
    fitted: &FittedBody,
    body: &Body,
) -> Result<Row, Box<dyn Error>> {
    let slabs = body.constraints().len() - 1;
    let kind = match (&fitted.optimum, slabs) {
        (None, _) => "ball".to_owned(),
        (Some(_), 0) => format!("d{}", body.degree()),
        (Some(_), _) => format!("d{}-s{slabs}", body.degree()),
    };
    let file = args.out.join(format!("{stem}-{kind}.json"));
    write_atomically(&file, &body.to_json())?;
    let made = body.provenance().cloned().unwrap_or_default();
    Ok(Row {
        input: input.display().to_string(),
        body: file.display().to_string(),
        degree: body.degree(),
        slabs,
        parts: 1,
        covers: None,
        objective: made.objective,
        refined: made.refined,
        points: body.points().map_or(0, |points| points.count),
        left_out: usize::try_from(result.left_out_count)?,
        left_out_m: result.left_out_m,
        hull_vertices: made.hull_vertices,
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        hull_volume_m3: made.hull_volume_m3,
        gap_m: fitted.gap_m,
        mean_gap_m: Some(fitted.mean_gap_m),
        seconds: fitted.duration_s,
        status: "solved",
        // Re-proven when its file was read.
        proven: true,
        solve: fitted.optimum.as_ref().map(|optimum| Solve {
            refinement: Some(optimum.refinement_end.clone()).filter(|end| !end.is_empty()),
            objective_value: optimum.objective_value,
            optimality_gap: optimum.optimality_gap,
        }),
    })
}
