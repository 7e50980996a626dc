//! Arguments of `sublevel fit`.

use super::choice::Choice;
use super::length::length;
use crate::cli::mesh::MeshArgs;
use crate::fit::{Cone, Solver};
use std::path::PathBuf;

/// Fit certified bodies around meshes or point clouds (OFF, OBJ, PLY, STL, COLLADA, XYZ)
///
/// Each input becomes the file <stem>-d<degree>.json in the output folder: the sos-convex
/// polynomial of that degree whose set {p <= 1} holds every input point and, by convexity, every
/// triangle. The volume itself is not convex in the polynomial; what is minimised in its place is
/// the objective. A file is written only with all proofs, and only when the dual solution shows the
/// objective to be optimal.
///
/// Higher degrees are tighter and cost more: 2 is an ellipsoid, 6 suits most objects and takes
/// about a second, 8 about ten. How far a body reaches beyond the convex hull of its points is
/// reported as the gap: a proven bound of the distance of its farthest point, and a mean over
/// directions, which overlooks narrow corners. It refers to the points that were fitted: those that
/// --trim leaves, as --min-thickness thickens them.
///
/// With --relax-convexity, and with the objective inverse-moment, the set need not be convex:
/// tighter, but no distances are measured from it. It is proven to contain the points; which
/// triangles of the mesh it does not contain is reported.
///
/// Meshes that are not convex can become compounds of several bodies: by --parts, or by --max-gap
/// where that is cheaper to query. Connected closed components are parts of their own, and the mesh
/// is cut by planes; the gap is measured to the convex hulls of the parts. All triangles are proven
/// to be covered, and the interior of closed meshes ("surface_only" is reported of others).
///
/// Examples:
///
/// sublevel fit mug.obj --scale 0.001 --out bodies
///
/// sublevel fit mug.obj --scale 0.001 --max-gap 5mm --out bodies
///
/// sublevel fit chair.off --ladder --out bodies
///
/// sublevel fit shelf-*.json --group shelf --degree 4 --out bodies
#[derive(Debug, clap::Args)]
pub(in crate::cli) struct FitArgs {
    /// Mesh or point files; the ending says the format. With --group, body files
    #[arg(required = true, value_name = "INPUT")]
    pub(in crate::cli) inputs: Vec<PathBuf>,
    /// Folder for the body files; made with its parents when it is not there
    #[arg(long, value_name = "DIR")]
    pub(in crate::cli) out: PathBuf,
    /// Degree of the polynomial: 2, 4, 6 or 8
    ///
    /// [default: 6; with --ladder and --max-gap the highest tried: 8, or as far as the objective
    /// goes; with --group 4]
    #[arg(long, value_name = "N")]
    pub(in crate::cli) degree: Option<usize>,
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
    ///   need not be convex (<stem>-d6-im.json), below the least level that contains them.
    #[arg(long, value_name = "NAME", default_value_t, verbatim_doc_comment)]
    pub(in crate::cli) objective: Choice,
    /// Let the set bend inwards: ask only that p + C |u|^degree be sos-convex, u being points with
    /// mean 0 and largest norm 1
    ///
    /// 0 is a convex body; 10 and 100 follow the object more and more (<stem>-d6-c10.json); inf
    /// asks for no convexity at all.
    #[arg(long, value_name = "C", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(in crate::cli) relax_convexity: f64,
    /// Measure traces and C in the coordinates of the points, metres, in place of those with mean 0
    /// and largest norm 1
    #[arg(long)]
    pub(in crate::cli) raw_frame: bool,
    /// Smaller cones, without semidefinite programs: sdsos or dsos; sos is the tightest
    ///
    /// sos: all sos-convex polynomials, by semidefinite programs, for the objective.
    /// sdsos: those whose Hessian form is a sum of squares of two terms each, by
    ///   second-order cones. Minimises the volume itself.
    /// dsos: those whose form is even diagonally dominant, by linear constraints.
    ///   Looser. Both depend on the axes of the smallest ellipsoid.
    #[arg(long, value_name = "NAME", default_value_t, verbatim_doc_comment)]
    pub(in crate::cli) cone: Cone,
    /// What solves the programs: clarabel or structured
    ///
    /// Left out, the faster one is taken, and the other where that fails: clarabel, a conic solver
    /// for every objective, up to degree 6; structured, which follows the central path of logdet-p,
    /// at degree 8. Both reach the same optimum, and every body is proven from its numbers alone.
    /// The steps of --refine are always those of the structured solver.
    #[arg(long, value_name = "NAME")]
    pub(in crate::cli) solver: Option<Solver>,
    /// Cut the body by at most this many slabs (pairs of parallel planes), each where it reaches
    /// farthest beyond the convex hull
    ///
    /// 0 to 15; they end where nothing is left to cut off. With --ladder all rungs but the ball are
    /// cut (<stem>-d4-s3.json has three slabs). Queries of bodies with such edges take several
    /// times as long.
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub(in crate::cli) slabs: usize,
    /// Fit every rung up to --degree: smallest ball (<stem>-ball.json), ellipsoid (-d2), degree 4,
    /// 6, 8
    #[arg(long)]
    pub(in crate::cli) ladder: bool,
    /// Fit no finer than needed: the body cheapest to query that reaches at most this far beyond
    /// the object's convex hull
    ///
    /// Such as 5mm, 2cm, or 0.005 (metres). Tried in this order, which is that of the time of
    /// queries: ball, ellipsoid, degree 4, 6; compounds of two parts of degree 2 or 4; degree 8;
    /// compounds of up to 19 parts, each of the lowest degree that is near enough, 6 at most
    /// (<stem>-d4-p3.json has three parts, of degree 4 at most); single bodies cut by slabs
    /// (<stem>-d4-s3.json has three). No degree above --degree. Compounds are made of meshes only,
    /// untrimmed and not thickened.
    #[arg(long, value_name = "LENGTH", value_parser = length, conflicts_with_all = ["ladder", "slabs"])]
    pub(in crate::cli) max_gap: Option<f64>,
    /// Fit a compound of at most this many convex parts, each of --degree: <stem>-d6-p4.json has
    /// four
    ///
    /// The partition whose parts have the least volume of convex hulls of those that are found.
    /// Fewer parts where no cut reduces that volume: then a note says why. Where a mesh has more
    /// components, those whose joint hull adds least are merged. Queries take about as many times
    /// as long as there are parts near the other body.
    #[arg(long, value_name = "N", conflicts_with_all = ["ladder", "max_gap", "trim", "min_thickness"])]
    pub(in crate::cli) parts: Option<usize>,
    /// Minimise the volume itself afterwards, starting from the objective's optimum: 1 to 10 %
    /// smaller, several times as long
    ///
    /// Never makes the volume larger. Why it ended is reported when that was before it converged.
    #[arg(long)]
    pub(in crate::cli) refine: bool,
    /// Leave out this fraction of the points, the outermost, such as 0.01 of a scan with outliers;
    /// what was left out is reported
    #[arg(long, value_name = "FRACTION", default_value_t = 0.0, allow_negative_numbers = true)]
    pub(in crate::cli) trim: f64,
    /// Give flat inputs a thickness: copies of the points to both sides, where they extend by less
    /// than this, such as 1mm
    #[arg(long, value_name = "LENGTH", value_parser = length)]
    pub(in crate::cli) min_thickness: Option<f64>,
    #[command(flatten)]
    pub(in crate::cli) mesh: MeshArgs,
    /// Have this server fit, such as http://127.0.0.1:50051: it stores the bodies, and the same
    /// files are written here
    ///
    /// All options mean what they mean without a server; with --group the bodies of the inputs are
    /// stored there first. Compounds and sets that need not be convex are kept with their jobs, not
    /// among the server's bodies. Jobs wait for their turn there and survive its restart. Ctrl-C
    /// cancels the one that is under way.
    #[arg(long, value_name = "URL")]
    pub(in crate::cli) server: Option<String>,
    /// Put the bodies of all inputs, body files in one common frame, into one body:
    /// <NAME>-d<degree>.json
    ///
    /// Inputs may be sos-bodies, which need not be convex: the smallest body around one is its
    /// convexification. It is proven to contain every body whole, by polynomial multipliers that
    /// its file keeps: 'verify --contains' checks them.
    #[arg(long, value_name = "NAME", conflicts_with_all = ["ladder", "max_gap", "refine", "slabs", "trim", "min_thickness", "scale", "drop_nan", "drop_unused", "objective", "relax_convexity", "raw_frame", "cone", "parts"])]
    pub(in crate::cli) group: Option<String>,
    /// Put them into few bodies, <NAME>-1-d<degree>.json and so on, of at most 1 + FRACTION times
    /// the inputs' total volume
    ///
    /// What adds the least volume is merged first. Bodies that stay alone are written, too, as they
    /// are, and sos-bodies in the body around them, whose volume counts for theirs.
    #[arg(long, value_name = "FRACTION", requires = "group", allow_negative_numbers = true)]
    pub(in crate::cli) max_growth: Option<f64>,
    /// Degree that the multipliers have at least: 0, 2 or 4; higher ones may make the body smaller
    /// and cost more
    ///
    /// [default: --degree less 2, at most 4]
    #[arg(long, value_name = "N", requires = "group")]
    pub(in crate::cli) multiplier_degree: Option<usize>,
    /// Print a JSON array of reports instead of a table
    #[arg(long)]
    pub(in crate::cli) json: bool,
}
