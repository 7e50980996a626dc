//! An object made ready for fits of any degree: hull, whitening, frames.

use super::ball::smallest_ball;
use super::basis::Affine;
use super::coordinates::Coordinates;
use super::descent::descend;
use super::ellipsoid::{Ellipsoid, minimum_ellipsoid};
use super::gap::{Gap, RESOLVED_GAP, gap};
use super::generate::{Optimum, generate};
use super::hull::{Frame, Hull, convex_hull};
use super::margin::{DEFAULT_MARGIN, MARGIN_ATTEMPTS};
use super::path::Interior;
use super::program::Problem;
use super::progress::{Progress, Watch};
use super::refine::{Refined, RefinementEnd, refine};
use super::slab::cut;
use super::structure::Structure;
use super::unsolved::ProgramError;
use super::{Cone, Fit, FitError, FitOptions, FitReport, Objective, Rung};
use nalgebra::{Matrix3, Vector3};
use std::cell::RefCell;
use std::ops::ControlFlow;
use std::time::Instant;
use sublevel_core::body::{Body, BodyError, Constraint, Normalization, Placement, Provenance, Solver, Volume};
use sublevel_core::polynomial::{HessianGram, Polynomial};

/// What the smallest ball minimises, as its provenance names it.
const BALL: &str = "radius";

/// Value of the previous body's constraint above which a vertex is likely to bound the next body;
/// dimensionless, 1 on the surface.
///
/// Only the first set of points depends on it. A larger value misses points that come to bound the
/// body, a smaller one starts with many that do not. Pinned by
/// `refits_of_a_stream_take_fewer_steps_and_end_where_fits_do`.
const LIKELY_VALUE: f64 = 0.9;

/// Points with what every fit around them needs.
pub(super) struct Object<'a> {
    name: &'a str,
    points: &'a [Vector3<f64>],
    /// Name of the file the points are from.
    input: &'a str,
    hull: Hull,
    /// Vertices of the hull, metres.
    vertices: Vec<Vector3<f64>>,
    /// To the frame in which the smallest ellipsoid is the unit ball.
    normalization: Normalization,
    /// The vertices there.
    whitened: Vec<Vector3<f64>>,
    /// Indices of vertices that are likely to bound the next fit, the likeliest first.
    likely: RefCell<Vec<usize>>,
    /// The points are known up to this distance, metres: bodies contain the balls around them.
    clearance: f64,
    /// What all this took.
    seconds: f64,
}

impl<'a> Object<'a> {
    pub(super) fn new(name: &'a str, points: &'a [Vector3<f64>], input: &'a str) -> Result<Self, FitError> {
        let start = Instant::now();
        check(points)?;
        let hull = convex_hull(points)?;
        let vertices: Vec<Vector3<f64>> = hull.vertices.iter().map(|&i| points[i]).collect();
        let conditioned: Vec<Vector3<f64>> = vertices.iter().map(|x| hull.frame.apply(x)).collect();
        let ellipsoid = minimum_ellipsoid(&conditioned).ok_or(ProgramError::Singular)?;
        let normalization = whitening(&hull.frame, &ellipsoid).ok_or(ProgramError::Singular)?;
        let whitened = vertices.iter().map(|x| normalization.linear * (x - normalization.center)).collect();
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self {
            name,
            points,
            input,
            hull,
            vertices,
            normalization,
            whitened,
            likely: RefCell::default(),
            clearance: 0.0,
            seconds,
        })
    }

    /// The same object of points that are only known up to a distance, metres.
    pub(super) fn around(self, clearance: f64) -> Self {
        Self { clearance, ..self }
    }

    /// Lets the next fit begin with the vertices near the surface of a body, or outside of it.
    pub(super) fn begin_with(&self, body: &Body) {
        let values = self.vertices.iter().map(|x| body.value(x)).enumerate();
        let mut near: Vec<(usize, f64)> = values.filter(|(_, value)| *value > LIKELY_VALUE).collect();
        near.sort_by(|a, b| b.1.total_cmp(&a.1));
        self.likely.replace(near.into_iter().map(|(index, _)| index).collect());
    }

    /// Its name.
    pub(super) fn name(&self) -> &str {
        self.name
    }

    /// All points, metres.
    pub(super) fn points(&self) -> &[Vector3<f64>] {
        self.points
    }

    /// Their convex hull.
    pub(super) fn hull(&self) -> &Hull {
        &self.hull
    }

    /// The map to the frame in which the smallest ellipsoid is the unit ball.
    pub(super) fn normalization(&self) -> Normalization {
        self.normalization
    }

    /// A point there.
    pub(super) fn whiten(&self, x: &Vector3<f64>) -> Vector3<f64> {
        self.normalization.linear * (x - self.normalization.center)
    }

    /// The map from there to other coordinates.
    pub(super) fn coordinates(&self, coordinates: Coordinates) -> Result<Affine, ProgramError> {
        coordinates.map(self.points, &self.normalization).ok_or(ProgramError::Singular)
    }

    /// The smallest ball around the points.
    pub(super) fn ball(&self) -> Result<Rung, FitError> {
        let start = Instant::now();
        let ball = smallest_ball(&self.vertices);
        // Rounding of the coordinates relative to the centre.
        let body = Body::ball(self.name, ball.center, ball.radius * (1.0 + 1e-12) + 2.0 * self.clearance)?
            .with_points(self.points)?;
        let (body, gap) = self.finish(body, BALL, false, None);
        Ok(Rung { body, gap, seconds: self.seconds + start.elapsed().as_secs_f64(), report: None })
    }

    /// How far out every point lies: the values of the polynomial of that degree with the least log
    /// det, 1 at the outermost.
    pub(super) fn levels(&self, degree: usize, watch: &mut Watch) -> Result<Vec<f64>, FitError> {
        let structure = Structure::new(degree);
        let coordinates = self.coordinates(Coordinates::Unit)?;
        let problem = Problem::new(&structure, Objective::LogDetP, &coordinates, DEFAULT_MARGIN);
        let optimum = generate(&problem, &self.whitened, &[], watch)?;
        let value = |x: &Vector3<f64>| structure.values(&self.whiten(x)).dot(&optimum.coefficients);
        Ok(self.points.iter().map(value).collect())
    }

    /// The body of one polynomial with the least objective, refined as asked for. The next fit
    /// begins with what bounds this one.
    pub(super) fn fit(
        &self,
        options: &FitOptions,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Fit, FitError> {
        let start = Instant::now();
        let structure = Structure::new(options.degree);
        let mut attempts = MARGIN_ATTEMPTS.iter().map(|factor| factor * options.margin);
        let mut watch = Watch::new(progress);
        let (body, optimum, margin, volumes, refinement_end) = loop {
            let margin = attempts.next().unwrap_or(options.margin);
            let (optimum, volumes, end) = if options.cone == Cone::Sos {
                self.least_objective(&structure, options, margin, &mut watch)?
            } else {
                let found = descend(&structure, options.cone, &self.whitened, margin, &mut watch)?;
                let objective = found.volumes.last().copied().unwrap_or(f64::NAN);
                let Refined { coefficients, hessian, volumes, end } = found;
                let (gap, solver, fallback) = (None, Solver::Clarabel, None);
                (Optimum { coefficients, hessian, gram: None, gap, objective, solver, fallback }, volumes, Some(end))
            };
            match self.certify(&structure, &optimum) {
                Ok(body) => break (body, optimum, margin, volumes, end),
                Err(FitError::Unproven(BodyError::Certificate { .. })) if attempts.len() > 0 => {}
                Err(error) => return Err(error),
            }
        };
        let objective = match options.cone {
            Cone::Sos => options.objective.name().to_owned(),
            cone => format!("volume, {cone}"),
        };
        self.begin_with(&body);
        let refined = options.refine && volumes.len() > 1;
        let (body, gap) = self.finish(body, &objective, refined, Some(optimum.solver));
        let report = FitReport {
            degree: options.degree,
            points: self.points.len(),
            hull_vertices: self.hull.vertices.len(),
            volume_m3: body.volume().volume_m3,
            volume_error_m3: body.volume().error_m3,
            refinement_m3: volumes.iter().map(|v| v / self.normalization.linear.determinant().abs()).collect(),
            hull_volume_m3: self.hull.volume,
            seconds: self.seconds + start.elapsed().as_secs_f64(),
            refinement_end,
            objective: options.objective,
            cone: options.cone,
            objective_value: optimum.objective,
            optimality_gap: optimum.gap,
            rounds: watch.progress().round,
            iterations: watch.progress().iterations,
            margin,
            solver: optimum.solver,
            fallback: optimum.fallback,
            log: watch.log().to_vec(),
        };
        Ok(Fit { body, gap, report })
    }

    /// The optimum of the objective over all sos-convex polynomials, refined if asked for, with the
    /// volumes of that and its end.
    fn least_objective(
        &self,
        structure: &Structure,
        options: &FitOptions,
        margin: f64,
        watch: &mut Watch,
    ) -> Result<(Optimum, Vec<f64>, Option<RefinementEnd>), FitError> {
        let coordinates = self.coordinates(options.coordinates)?;
        let problem = Problem::new(structure, options.objective, &coordinates, margin).solved_by(options.solver);
        let optimum = generate(&problem, &self.whitened, &self.likely.borrow(), watch)
            .map_err(|error| error.of_objective(options.objective))?;
        if !options.refine {
            return Ok((optimum, Vec::new(), None));
        }
        let Optimum { coefficients, hessian, gap, objective, solver, fallback, .. } = optimum;
        let Refined { coefficients, hessian, volumes, end } =
            refine(structure, &self.whitened, margin, Interior { coefficients, hessian }, watch)?;
        Ok((Optimum { coefficients, hessian, gram: None, gap, objective, solver, fallback }, volumes, Some(end)))
    }

    /// Notes where the body is from and how far it reaches beyond the hull.
    pub(super) fn finish(&self, body: Body, objective: &str, refined: bool, solver: Option<Solver>) -> (Body, Gap) {
        let gap = self.gap(&body);
        let provenance = Provenance {
            input: self.input.to_owned(),
            objective: objective.to_owned(),
            refined,
            hull_vertices: self.hull.vertices.len(),
            hull_volume_m3: self.hull.volume,
            solver,
        };
        (body.with_provenance(provenance).with_gap(gap.most_m), gap)
    }

    /// How far a body reaches beyond the hull, wherever within the clearance the points are.
    fn gap(&self, body: &Body) -> Gap {
        let gap = gap(body, &self.vertices);
        Gap { most_m: gap.most_m + self.clearance, ..gap }
    }

    /// Cuts a body by at most this many slabs, one after the other where it reaches farthest beyond
    /// the hull, until it reaches no farther than `enough`, metres.
    pub(super) fn cut(
        &self,
        fit: Fit,
        most: usize,
        enough: f64,
        progress: &mut dyn FnMut(Progress) -> ControlFlow<()>,
    ) -> Result<Fit, FitError> {
        let start = Instant::now();
        let mut watch = Watch::new(progress);
        let Fit { mut body, mut gap, report } = fit;
        for _ in 0..most {
            // Below what is resolved there is nothing to cut off.
            if gap.most_m <= enough.max(2.0 * RESOLVED_GAP * body.circumscribed().radius) {
                break;
            }
            watch.round(self.vertices.len(), 0.0);
            watch.iteration(gap.most_m)?;
            let slabbed = cut(&body, self.points, self.clearance, &gap.direction)?;
            gap = self.gap(&slabbed);
            body = slabbed.with_gap(gap.most_m);
        }
        let seconds = report.seconds + start.elapsed().as_secs_f64();
        let Volume { volume_m3, error_m3: volume_error_m3 } = body.volume();
        Ok(Fit { body, gap, report: FitReport { volume_m3, volume_error_m3, seconds, ..report } })
    }

    /// Pulls all points, with what is around them, inside by the constant coefficient, which leaves
    /// the Hessian as it is, and proves the body.
    fn certify(&self, structure: &Structure, optimum: &Optimum) -> Result<Body, FitError> {
        let Self { name, points, normalization, clearance, .. } = self;
        let terms = structure.monomials.iter().copied().zip(optimum.coefficients.iter().copied()).collect();
        let polynomial = Polynomial::new(terms)?;
        let gram = HessianGram::nearest(&polynomial, structure.hessian_basis.clone(), optimum.hessian.clone())
            .map_err(|source| BodyError::Certificate { index: 0, source })?;
        let inverse = normalization.linear.try_inverse().ok_or(ProgramError::Singular)?;
        let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
        let polynomial = pulled_inside(polynomial, points, &placement, *clearance, 0.0);
        Ok(Body::new(name, *normalization, vec![Constraint { polynomial, gram }])?.with_points(points)?)
    }
}

/// The map from the frame of the points to that of the ellipsoid around the conditioned points,
/// with orthogonal rows: such a map amplifies no rounding, however long the ellipsoid is.
fn whitening(frame: &Frame, ellipsoid: &Ellipsoid) -> Option<Normalization> {
    let center = frame.center + frame.linear.try_inverse()? * ellipsoid.center;
    let decomposition = (ellipsoid.linear * frame.linear).svd(false, true);
    let mut turn = decomposition.v_t?;
    if turn.determinant() < 0.0 {
        turn.row_mut(2).neg_mut();
    }
    Some(Normalization { center, linear: Matrix3::from_diagonal(&decomposition.singular_values) * turn })
}

/// The polynomial with the constant coefficient that brings the highest of its values at the points
/// to `1 - slack`, rounding included.
pub(super) fn pulled_inside(
    mut polynomial: Polynomial,
    points: &[Vector3<f64>],
    placement: &Placement,
    clearance: f64,
    slack: f64,
) -> Polynomial {
    // Each of a million points is evaluated only once: which are highest does not depend on the
    // constant.
    let values: Vec<f64> = points.iter().map(|x| placement.sample_of(&polynomial, x).value()).collect();
    let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let outermost: Vec<_> = points.iter().zip(&values).filter(|(_, v)| **v >= top - 1e-3).map(|(x, _)| x).collect();
    // The bound of the rounding moves a little with the constant: a second pass settles it.
    for _ in 0..3 {
        let highest = outermost
            .iter()
            .map(|x| placement.sample_of(&polynomial, x).value_upper(clearance))
            .fold(f64::NEG_INFINITY, f64::max);
        let excess = highest - (1.0 - slack);
        if (-1e-15..=0.0).contains(&excess) {
            break;
        }
        polynomial = polynomial.with_constant_shifted(-(excess + 4.0 * f64::EPSILON));
    }
    polynomial
}

fn check(points: &[Vector3<f64>]) -> Result<(), FitError> {
    if points.len() < 4 {
        return Err(FitError::TooFewPoints(points.len()));
    }
    if let Some(index) = points.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(FitError::NotFinite(index));
    }
    let reach = points.iter().map(Vector3::amax).fold(0.0, f64::max);
    // Coinciding points at the origin are reported as such later.
    if reach > 1e15 || reach > 0.0 && reach < 1e-15 { Err(FitError::OutOfRange(reach)) } else { Ok(()) }
}
