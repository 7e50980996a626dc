//! `sublevel fit`.

mod remote;
mod sos;

use super::write_atomically;
use crate::body::Provenance;
use crate::fit::{
    CompoundFit, Cone, Coordinates, FitError, FitOptions, Mesh, Progress, RefinementEnd, Representation, Rung, Trimmed,
    cheapest_within, coarsest_within, fit, fit_parts, ladder, read_mesh, thicken, trim,
};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use serde::Serialize;
use sos::{Choice, method};
use std::borrow::Cow;
use std::error::Error;
use std::io::{self, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// Fit certified bodies around meshes or point clouds (OFF, OBJ, PLY, STL, XYZ)
///
/// Each input becomes the file <stem>-d<degree>.json in the output folder: the sos-convex polynomial of that degree whose
/// set {p <= 1} holds every input point and, by convexity, every triangle. The volume itself is not convex in the
/// polynomial; what is minimised in its place is the objective. A file is written only with all proofs, and only when the
/// dual solution shows the objective to be optimal.
///
/// Higher degrees are tighter and cost more: 2 is an ellipsoid, 6 suits most objects and takes about a second, 8 about ten.
/// How far a body reaches beyond the convex hull of its points is told as the gap: a proven bound of the distance of its
/// farthest point, and a mean over directions, which overlooks narrow corners. It refers to the points that were fitted: those
/// that --trim leaves, as --min-thickness thickens them.
///
/// With --relax-convexity, and with the objective inverse-moment, the set need not be convex: tighter, but no distances are measured
/// from it. It is proven to hold the points; which triangles of the mesh it does not hold is told.
///
/// Meshes that are not convex can become compounds of several bodies: by --parts, or by --max-gap where that is cheaper to query. The
/// mesh is cut by planes; each part holds its piece, and the gap is measured to the convex hulls of the pieces. All triangles are
/// proven to be covered, and the interior of closed meshes ("surface_only" is said of others).
///
/// Examples:
///
///   sublevel fit mug.obj --scale 0.001 --out bodies
///
///   sublevel fit mug.obj --scale 0.001 --max-gap 5mm --out bodies
///
///   sublevel fit chair.off --ladder --out bodies
///
///   sublevel fit shelf-*.json --group shelf --degree 4 --out bodies
#[derive(Debug, clap::Args)]
pub(super) struct FitArgs {
    /// Mesh or point files; the ending tells the format. With --group, body files
    #[arg(required = true, value_name = "INPUT")]
    pub(super) inputs: Vec<PathBuf>,
    /// Folder for the body files; made with its parents when it is not there
    #[arg(long, value_name = "DIR")]
    pub(super) out: PathBuf,
    /// Degree of the polynomial: 2, 4, 6 or 8
    ///
    /// [default: 6; with --ladder and --max-gap the highest tried: 8, or as far as the objective goes; with --group 4]
    #[arg(long, value_name = "N")]
    pub(super) degree: Option<usize>,
    /// What the fit minimises: logdet-p, trace-p, logdet-h, trace-h or inverse-moment
    ///
    /// logdet-p: log det of the inverse Gram matrix P of p. Tightest nearly always, and
    ///   the body follows the object through every affine map: take it.
    /// trace-p: trace of the inverse of P. Looser, and depends on the frame: points
    ///   centred at their mean, largest norm 1.
    /// logdet-h: log det of the inverse Gram matrix H of the Hessian form, which asks
    ///   for curvature everywhere: bodies that bulge at flat sides. Degrees 2 to 6.
    /// trace-h: trace of the inverse of H, in the frame of trace-p. Degrees 2 to 6.
    /// inverse-moment: nothing; the inverse moment matrix of the points makes a set that
    ///   need not be convex (<stem>-d6-im.json), below the least level that holds them.
    #[arg(long, value_name = "NAME", default_value_t, verbatim_doc_comment)]
    objective: Choice,
    /// Let the set bend inwards: ask only that p + C |u|^degree be sos-convex, u being points with mean 0 and largest norm 1
    ///
    /// 0 is a convex body; 10 and 100 follow the object more and more (<stem>-d6-c10.json); inf asks for no convexity at all.
    #[arg(long, value_name = "C", default_value_t = 0.0, allow_negative_numbers = true)]
    relax_convexity: f64,
    /// Measure traces and C in the coordinates of the points, metres, in place of those with mean 0 and largest norm 1
    #[arg(long)]
    raw_frame: bool,
    /// Fast fits for streams of point clouds: sdsos or dsos; sos is the tightest
    ///
    /// sos: all sos-convex polynomials, by semidefinite programs, for the objective.
    /// sdsos: those whose Hessian form is a sum of squares of two terms each, by
    ///   second-order cones. Minimises the volume itself.
    /// dsos: those whose form is even diagonally dominant, by linear constraints.
    ///   Looser, and hardly faster. Both depend on the axes of the smallest ellipsoid.
    #[arg(long, value_name = "NAME", default_value_t, verbatim_doc_comment)]
    cone: Cone,
    /// Cut the body by at most this many slabs (pairs of parallel planes), each where it reaches farthest beyond the convex hull
    ///
    /// 0 to 15; they end where nothing is left to cut off. With --ladder all rungs but the ball are cut (<stem>-d4-s3.json has
    /// three slabs). Queries of bodies with such edges take several times as long.
    #[arg(long, value_name = "N", default_value_t = 0)]
    slabs: usize,
    /// Fit every rung up to --degree: smallest ball (<stem>-ball.json), ellipsoid (-d2), degree 4, 6, 8
    #[arg(long)]
    ladder: bool,
    /// Fit no finer than needed: the body cheapest to query that reaches at most this far beyond the object's convex hull
    ///
    /// Such as 5mm, 2cm, or 0.005 (metres). Tried in this order, which is that of the time of queries: ball, ellipsoid, degree 4, 6;
    /// compounds of two parts of degree 2 or 4; degree 8; compounds of up to 19 parts, each of the lowest degree that is near enough, 6
    /// at most (<stem>-d4-p3.json has three parts, of degree 4 at most); single bodies cut by slabs (<stem>-d4-s3.json has three).
    /// No degree above --degree. Compounds are made of meshes only, untrimmed and not thickened.
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with_all = ["ladder", "slabs"])]
    max_gap: Option<f64>,
    /// Fit a compound of at most this many convex parts, each of --degree: <stem>-d6-p4.json has four
    ///
    /// Fewer where no cut reduces the volume of the parts' convex hulls. Queries take about as many times as long as there are parts
    /// near the other body.
    #[arg(long, value_name = "N", conflicts_with_all = ["ladder", "max_gap", "trim", "min_thickness", "server"])]
    parts: Option<usize>,
    /// Minimise the volume itself afterwards, starting from the objective's optimum: 1 to 10 % smaller, several times as long
    ///
    /// Never makes the volume larger. Why it ended is reported when that was before it converged.
    #[arg(long)]
    refine: bool,
    /// Leave out this fraction of the points, the outermost, such as 0.01 of a scan with outliers; what was left out is told
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, allow_negative_numbers = true)]
    trim: f64,
    /// Give flat inputs a thickness: copies of the points to both sides, where they extend by less than this, such as 1mm
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    min_thickness: Option<f64>,
    /// Metres per unit of the input: 0.001 for files in millimetres
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, allow_negative_numbers = true)]
    scale: f64,
    /// Have this server fit, such as http://127.0.0.1:50051: it stores the bodies, and their files are written here, too
    ///
    /// Jobs wait for their turn there and survive its restart. Ctrl-C cancels the one that is under way.
    #[arg(long, value_name = "URL", conflicts_with_all = ["relax_convexity", "raw_frame", "cone"])]
    server: Option<String>,
    /// Put the bodies of all inputs, body files in one common frame, into one body: <NAME>-d<degree>.json
    ///
    /// It is proven to contain every body whole, by polynomial multipliers that its file keeps: 'verify --contains' checks them.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["ladder", "max_gap", "refine", "slabs", "trim", "min_thickness", "scale", "objective", "relax_convexity", "raw_frame", "cone", "server", "parts"])]
    pub(super) group: Option<String>,
    /// Put them into few bodies, <NAME>-1-d<degree>.json and so on, of at most 1 + FRACTION times the inputs' total volume
    ///
    /// What adds the least volume is merged first. Bodies that stay alone are written, too, as they are.
    #[arg(long, value_name = "FRACTION", requires = "group", allow_negative_numbers = true)]
    pub(super) max_growth: Option<f64>,
    /// Degree that the multipliers have at least: 0, 2 or 4; higher ones may make the body smaller and cost more
    ///
    /// [default: --degree less 2, at most 4]
    #[arg(long, value_name = "N", requires = "group")]
    pub(super) multiplier_degree: Option<usize>,
    /// Print a JSON array of reports instead of a table
    #[arg(long)]
    pub(super) json: bool,
}

#[derive(Serialize)]
struct Row {
    input: String,
    body: String,
    degree: usize,
    slabs: usize,
    /// 1 for a body that is no compound.
    parts: usize,
    /// What a compound is proven to cover of the mesh: "interior" or "surface_only".
    covers: Option<&'static str>,
    /// What was minimised: the objective, or the radius of a ball.
    objective: String,
    refined: bool,
    points: usize,
    /// Points that were trimmed, and the largest distance of one of them from the hull of the others.
    left_out: usize,
    left_out_m: f64,
    hull_vertices: usize,
    /// Of a compound the union of its parts, which may overlap.
    volume_m3: f64,
    volume_error_m3: f64,
    hull_volume_m3: f64,
    /// Proven bound of the distance of any point of the body from the hull, of a compound from the hulls of its pieces.
    gap_m: f64,
    /// Mean over directions of how much farther the body reaches than the hull; none for compounds.
    mean_gap_m: Option<f64>,
    seconds: f64,
    /// A fit that is not solved, or not proven, is an error.
    status: &'static str,
    proven: bool,
    #[serde(flatten)]
    solve: Option<Solve>,
}

/// What only fits of polynomials have.
#[derive(Serialize)]
struct Solve {
    /// Why the refinement ended; none without.
    refinement: Option<String>,
    objective_value: f64,
    optimality_gap: Option<f64>,
}

/// Fits every input in turn; what was fitted before an error stays.
pub(super) fn run(args: &FitArgs) -> Result<(), Box<dyn Error>> {
    if let Some(name) = &args.group {
        return super::group::run(args, name);
    }
    let stems = args.inputs.iter().map(|input| stem(input)).collect::<Result<Vec<_>, _>>()?;
    for (i, stem) in stems.iter().enumerate() {
        if let Some(j) = stems[..i].iter().position(|earlier| earlier == stem) {
            let (first, second) = (args.inputs[j].display(), args.inputs[i].display());
            return Err(format!(
                "{first} and {second} would both become {stem}-*.json; fit them into different folders"
            )
            .into());
        }
    }
    let relaxed = method(args)?;
    if relaxed.is_some() && args.server.is_some() {
        return Err("servers keep convex bodies only; leave --server out, or choose another --objective".into());
    }
    for (input, stem) in args.inputs.iter().zip(&stems) {
        match relaxed {
            Some(method) => sos::options(args, method, input).check(stem),
            None => options(args, input).check(stem),
        }
        .map_err(|error| format!("{}: {error}", input.display()))?;
    }
    make_folder(&args.out)?;
    match relaxed {
        Some(method) => each(args, &stems, |input, stem| Ok(vec![sos::one(args, method, input, stem)?]), sos::table),
        None => each(
            args,
            &stems,
            |input, stem| match &args.server {
                Some(url) => remote::one(args, url, input, stem),
                None => one(args, input, stem),
            },
            table,
        ),
    }
}

/// Fits the inputs and prints the rows of those before an error.
fn each<R: Serialize>(
    args: &FitArgs,
    stems: &[String],
    one: impl Fn(&Path, &str) -> Result<Vec<R>, Box<dyn Error>>,
    table: fn(&mut dyn Write, &[R]) -> io::Result<()>,
) -> Result<(), Box<dyn Error>> {
    let mut rows = Vec::new();
    let mut failure = None;
    for (input, stem) in args.inputs.iter().zip(stems) {
        match one(input, stem) {
            Ok(of_input) => rows.extend(of_input),
            // What was fitted before is on disk: it is reported before the error.
            Err(error) => {
                failure = Some(error);
                break;
            }
        }
    }
    let mut out = io::stdout().lock();
    if args.json {
        serde_json::to_writer_pretty(&mut out, &rows)?;
        writeln!(out)?;
    } else {
        table(&mut out, &rows)?;
    }
    failure.map_or(Ok(()), Err)
}

/// Makes the output folder.
pub(super) fn make_folder(path: &Path) -> Result<(), Box<dyn Error>> {
    std::fs::create_dir_all(path)
        .map_err(|error| format!("can not make {}: {error}; choose another --out", path.display()).into())
}

fn options(args: &FitArgs, input: &Path) -> FitOptions {
    let Choice::Minimise(objective) = args.objective else { return FitOptions::default() };
    FitOptions {
        degree: args.degree.unwrap_or(if args.ladder || args.max_gap.is_some() { objective.max_degree() } else { 6 }),
        objective,
        coordinates: coordinates(args),
        cone: args.cone,
        refine: args.refine,
        slabs: args.slabs,
        input: file_name(input),
        ..FitOptions::default()
    }
}

fn coordinates(args: &FitArgs) -> Coordinates {
    if args.raw_frame { Coordinates::Raw } else { Coordinates::Unit }
}

fn file_name(input: &Path) -> String {
    input.file_name().map(|name| name.to_string_lossy().into_owned()).unwrap_or_default()
}

fn stem(input: &Path) -> Result<String, Box<dyn Error>> {
    let stem = input.file_stem().ok_or_else(|| format!("{} names no file", input.display()))?;
    Ok(stem.to_string_lossy().into_owned())
}

/// A length with its unit, or in metres.
fn length(text: &str) -> Result<f64, String> {
    let units = [("mm", 1e-3), ("cm", 1e-2), ("m", 1.0), ("", 1.0)];
    units
        .into_iter()
        .find_map(|(unit, metres)| Some(text.strip_suffix(unit)?.trim_end().parse::<f64>().ok()? * metres))
        .filter(|length| *length > 0.0 && length.is_finite())
        .ok_or_else(|| "not a positive length such as 5mm, 2cm or 0.005 (metres)".to_owned())
}

/// The points of an input that are to be fitted.
struct Prepared {
    /// With its triangles only if the points are those of the file.
    mesh: Mesh,
    trimmed: Option<Trimmed>,
}

impl Prepared {
    /// Reads, thickens and trims as asked for.
    fn new(
        args: &FitArgs,
        input: &Path,
        bar: &ProgressBar,
        tell: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Self, Box<dyn Error>> {
        bar.set_message("reading");
        let mut mesh = read_mesh(input, args.scale)?;
        if let Some(least) = args.min_thickness
            && let Cow::Owned(points) = thicken(&mesh.points, least)
        {
            mesh = Mesh { points, triangles: Vec::new() };
        }
        if args.trim == 0.0 {
            return Ok(Self { mesh, trimmed: None });
        }
        let trimmed = trim(&mesh.points, args.trim, tell).map_err(|error| format!("{}: {error}", input.display()))?;
        let (place, count, all) = (input.display(), trimmed.left_out.len(), mesh.points.len());
        let farthest_m = trimmed.farthest_m;
        bar.suspend(|| {
            eprintln!("note: {place}: {count} of {all} points left out, up to {farthest_m:.3e} m outside the hull of the others");
        });
        let mesh = Mesh { points: trimmed.kept.clone(), triangles: Vec::new() };
        Ok(Self { mesh, trimmed: Some(trimmed) })
    }
}

/// What a bar says of a fit's progress.
fn telling(bar: &ProgressBar) -> impl FnMut(Progress) -> ControlFlow<()> + '_ {
    |progress: Progress| {
        let Progress { round, iterations, active_points, worst_violation, gap } = progress;
        bar.set_message(format!(
            "round {round}, step {iterations}, {gap:.0e} from the optimum of {active_points} points, others outside by \
             {worst_violation:.0e}"
        ));
        ControlFlow::Continue(())
    }
}

/// Fits what is asked for of one input, and writes it.
fn one(args: &FitArgs, input: &Path, stem: &str) -> Result<Vec<Row>, Box<dyn Error>> {
    let bar = progress_bar(stem);
    let mut tell = telling(&bar);
    let Prepared { mesh, trimmed } = Prepared::new(args, input, &bar, &mut tell)?;
    let options = options(args, input);
    // What was thickened or trimmed has lost its triangles.
    let fitted: Vec<Representation> = match (args.max_gap, args.parts) {
        (Some(max_gap), _) if !mesh.triangles.is_empty() => {
            cheapest_within(stem, &mesh, max_gap, &options, &mut tell).map(|one| vec![one])
        }
        (Some(max_gap), _) => {
            coarsest_within(stem, &mesh.points, max_gap, &options, &mut tell).map(|one| vec![one.into()])
        }
        (None, Some(parts)) => fit_parts(stem, &mesh, parts, &options, &mut tell).map(|one| vec![one.into()]),
        (None, None) if args.ladder => {
            ladder(stem, &mesh.points, &options, &mut tell).map(|rungs| rungs.into_iter().map(Into::into).collect())
        }
        (None, None) => fit(stem, &mesh.points, &options, &mut tell).map(|fit| vec![Rung::from(fit).into()]),
    }
    .map_err(|error: FitError| format!("{}: {error}", input.display()))?;
    bar.finish_and_clear();
    let written = fitted.iter().map(|one| match one {
        Representation::Body(rung) => write(args, input, stem, trimmed.as_ref(), rung),
        Representation::Compound(fit) => write_compound(args, input, stem, mesh.points.len(), fit),
    });
    written.collect()
}

/// Writes a compound and describes it.
fn write_compound(
    args: &FitArgs,
    input: &Path,
    stem: &str,
    points: usize,
    fit: &CompoundFit,
) -> Result<Row, Box<dyn Error>> {
    let CompoundFit { compound, seconds } = fit;
    let parts = compound.parts();
    let file = args.out.join(format!("{stem}-d{}-p{}.json", compound.degree(), parts.len()));
    write_atomically(&file, &compound.to_json())?;
    let Provenance { objective, refined, hull_vertices, hull_volume_m3, .. } =
        compound.provenance().cloned().unwrap_or_default();
    let volume = compound.volume();
    Ok(Row {
        input: input.display().to_string(),
        body: file.display().to_string(),
        degree: compound.degree(),
        slabs: parts.iter().map(|part| part.constraints().len() - 1).max().unwrap_or(0),
        parts: parts.len(),
        covers: compound.covering().map(|covering| covering.proven.name()),
        objective,
        refined,
        points,
        left_out: 0,
        left_out_m: 0.0,
        hull_vertices,
        volume_m3: volume.volume_m3,
        volume_error_m3: volume.error_m3,
        hull_volume_m3,
        gap_m: compound.gap_m().unwrap_or(f64::INFINITY),
        mean_gap_m: None,
        seconds: *seconds,
        status: "solved",
        proven: true,
        solve: None,
    })
}

/// Writes one body and describes it.
fn write(
    args: &FitArgs,
    input: &Path,
    stem: &str,
    trimmed: Option<&Trimmed>,
    rung: &Rung,
) -> Result<Row, Box<dyn Error>> {
    let Rung { body, gap, seconds, report } = rung;
    let slabs = body.constraints().len() - 1;
    let kind = match (report, slabs) {
        (None, _) => "ball".to_owned(),
        (Some(report), 0) => format!("d{}", report.degree),
        (Some(report), _) => format!("d{}-s{slabs}", report.degree),
    };
    let file = args.out.join(format!("{stem}-{kind}.json"));
    write_atomically(&file, &body.to_json())?;
    let refinement = report.as_ref().and_then(|report| report.refinement_end);
    if let Some(end) = refinement.filter(|&end| end != RefinementEnd::Converged) {
        eprintln!("note: {}: the refinement ended early: {end}; the body is proven all the same", file.display());
    }
    let made = body.provenance().cloned().unwrap_or_default();
    Ok(Row {
        input: input.display().to_string(),
        body: file.display().to_string(),
        degree: report.as_ref().map_or(2, |report| report.degree),
        slabs,
        parts: 1,
        covers: None,
        objective: made.objective,
        refined: made.refined,
        points: body.points().map_or(0, |points| points.count),
        left_out: trimmed.map_or(0, |trimmed| trimmed.left_out.len()),
        left_out_m: trimmed.map_or(0.0, |trimmed| trimmed.farthest_m),
        hull_vertices: made.hull_vertices,
        volume_m3: body.volume().volume_m3,
        volume_error_m3: body.volume().error_m3,
        hull_volume_m3: made.hull_volume_m3,
        gap_m: gap.most_m,
        mean_gap_m: Some(gap.mean_m),
        seconds: *seconds,
        status: "solved",
        // A fit returns a body only when it is proven.
        proven: true,
        solve: report.as_ref().map(|report| Solve {
            refinement: report.refinement_end.map(|end| end.to_string()),
            objective_value: report.objective_value,
            optimality_gap: report.optimality_gap,
        }),
    })
}

/// A spinner on a terminal, nothing elsewhere.
pub(super) fn progress_bar(stem: &str) -> ProgressBar {
    let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
    if let Ok(style) = ProgressStyle::with_template("{spinner} {prefix}: {msg} [{elapsed}]") {
        bar.set_style(style);
    }
    bar.set_prefix(stem.to_owned());
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

fn table(out: &mut dyn Write, rows: &[Row]) -> io::Result<()> {
    let width = rows.iter().map(|row| row.body.chars().count()).max().unwrap_or(0).max(4);
    writeln!(
        out,
        "{:width$}  degree  slabs  parts  points  hull vertices    volume m³  volume:hull      gap m  mean gap m  seconds  proven",
        "body"
    )?;
    for row in rows {
        writeln!(
            out,
            "{:width$}  {:>6}  {:>5}  {:>5}  {:>6}  {:>13}  {:>11.4e}  {:>11.3}  {:>9.3e}  {:>10}  {:>7.2}  {:>6}",
            row.body,
            row.degree,
            row.slabs,
            row.parts,
            row.points,
            row.hull_vertices,
            row.volume_m3,
            row.volume_m3 / row.hull_volume_m3,
            row.gap_m,
            row.mean_gap_m.map_or("-".to_owned(), |mean| format!("{mean:.3e}")),
            row.seconds,
            if row.proven { "yes" } else { "no" }
        )?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::length;

    #[test]
    fn lengths_have_units_or_are_metres() {
        for (text, metres) in [("5mm", 5e-3), ("2 cm", 2e-2), ("0.5m", 0.5), ("3e-3", 3e-3), ("1e3mm", 1.0)] {
            assert!((length(text).unwrap() - metres).abs() < 1e-15, "{text}");
        }
        for text in ["", "mm", "5in", "-1mm", "0", "nan", "inf", "5 5mm"] {
            assert!(length(text).is_err(), "{text}");
        }
    }
}
