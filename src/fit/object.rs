//! An object made ready for fits of any degree: hull, whitening, frames.

use super::ball::smallest_ball;
use super::basis::Affine;
use super::ellipsoid::{Ellipsoid, minimum_ellipsoid};
use super::gap::{Gap, NONE, gap};
use super::generate::{Optimum, generate};
use super::hull::{Frame, Hull, convex_hull};
use super::program::{Problem, ProgramError};
use super::progress::{Progress, Watch};
use super::refine::refine;
use super::slab::cut;
use super::structure::Structure;
use super::{DEFAULT_MARGIN, Fit, FitError, FitOptions, FitReport, Objective, Rung};
use crate::body::{Body, BodyError, Constraint, Normalization, Placement, Provenance, Volume};
use crate::polynomial::{HessianGram, Polynomial};
use nalgebra::{Matrix3, Vector3};
use std::ops::ControlFlow;
use std::time::Instant;

/// Factors on the margin for further attempts, when the certificate of a fit could not be proven.
const MARGIN_ATTEMPTS: [f64; 3] = [1.0, 10.0, 100.0];

/// What the smallest ball is said to minimise.
const BALL: &str = "radius";

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
    /// From there to the unit frame.
    unit: Affine,
    /// The points are known up to this distance, metres: bodies hold the balls around them.
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
        let unit = unit_frame(points, &normalization).ok_or(ProgramError::Singular)?;
        let seconds = start.elapsed().as_secs_f64();
        Ok(Self { name, points, input, hull, vertices, normalization, whitened, unit, clearance: 0.0, seconds })
    }

    /// The same object of points that are only known up to a distance, metres.
    pub(super) fn around(self, clearance: f64) -> Self {
        Self { clearance, ..self }
    }

    /// The smallest ball around the points.
    pub(super) fn ball(&self) -> Result<Rung, FitError> {
        let start = Instant::now();
        let ball = smallest_ball(&self.vertices);
        // Rounding of the coordinates, as seen from the centre.
        let body = Body::ball(self.name, ball.center, ball.radius * (1.0 + 1e-12) + 2.0 * self.clearance)?
            .with_points(self.points)?;
        let (body, gap) = self.finish(body, BALL, false);
        Ok(Rung { body, gap, seconds: self.seconds + start.elapsed().as_secs_f64(), report: None })
    }

    /// Values at all points of the polynomial of that degree with the least log det: 1 at the outermost.
    pub(super) fn levels(&self, degree: usize, watch: &mut Watch) -> Result<Vec<f64>, FitError> {
        let structure = Structure::new(degree);
        let problem = Problem::new(&structure, Objective::LogDetP, &self.unit, DEFAULT_MARGIN);
        let optimum = generate(problem, &self.whitened, watch)?;
        let Normalization { center, linear } = &self.normalization;
        let value = |x: &Vector3<f64>| structure.values(&(linear * (x - center))).dot(&optimum.coefficients);
        Ok(self.points.iter().map(value).collect())
    }

    /// The body of one polynomial with the least objective, refined as asked for.
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
            let problem = Problem::new(&structure, options.objective, &self.unit, margin);
            let mut optimum = generate(problem, &self.whitened, &mut watch)?;
            let (mut volumes, mut end) = (Vec::new(), None);
            if options.refine {
                let (coefficients, hessian) = (optimum.coefficients.clone(), optimum.hessian.clone());
                let refined = refine(&structure, &self.whitened, margin, coefficients, hessian, &mut watch)?;
                (optimum.coefficients, optimum.hessian) = (refined.coefficients, refined.hessian);
                (volumes, end) = (refined.volumes, Some(refined.end));
            }
            match self.certify(&structure, &optimum) {
                Ok(body) => break (body, optimum, margin, volumes, end),
                Err(FitError::Unproven(BodyError::Certificate { .. })) if attempts.len() > 0 => {}
                Err(error) => return Err(error),
            }
        };
        let (body, gap) = self.finish(body, options.objective.name(), volumes.len() > 1);
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
            objective_value: optimum.objective,
            optimality_gap: optimum.gap,
            rounds: watch.progress().round,
            iterations: watch.progress().iterations,
            margin,
        };
        Ok(Fit { body, gap, report })
    }

    /// Notes where the body is from and how far it reaches beyond the hull.
    fn finish(&self, body: Body, objective: &str, refined: bool) -> (Body, Gap) {
        let gap = self.gap(&body);
        let provenance = Provenance {
            input: self.input.to_owned(),
            objective: objective.to_owned(),
            refined,
            hull_vertices: self.hull.vertices.len(),
            hull_volume_m3: self.hull.volume,
        };
        (body.with_provenance(provenance).with_gap(gap.most_m), gap)
    }

    /// How far a body reaches beyond the hull, wherever within the clearance the points are.
    fn gap(&self, body: &Body) -> Gap {
        let gap = gap(body, &self.vertices);
        Gap { most_m: gap.most_m + self.clearance, ..gap }
    }

    /// Cuts a body by at most so many slabs, one after the other where it reaches farthest beyond the hull, until it reaches no
    /// farther than `enough`, metres.
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
            if gap.most_m <= enough.max(2.0 * NONE * body.circumscribed().radius) {
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

    /// Pulls all points, with what is around them, inside by the constant coefficient, which leaves the Hessian as it is, and proves the body.
    fn certify(&self, structure: &Structure, optimum: &Optimum) -> Result<Body, FitError> {
        let Self { name, points, normalization, clearance, .. } = self;
        let terms = structure.monomials.iter().copied().zip(optimum.coefficients.iter().copied()).collect();
        let polynomial = Polynomial::new(terms)?;
        let gram = HessianGram::nearest(&polynomial, structure.hessian_basis.clone(), optimum.hessian.clone())
            .map_err(|source| BodyError::Certificate { index: 0, source })?;
        let mut constraint = Constraint { polynomial, gram };
        let inverse = normalization.linear.try_inverse().ok_or(ProgramError::Singular)?;
        let placement = Placement::new(normalization.linear, inverse, normalization.center, 0.0, 0.0);
        // A million points are looked at once: which are highest does not change with the constant.
        let values: Vec<f64> = points.iter().map(|x| placement.jet(&constraint, x).value).collect();
        let top = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let outermost: Vec<_> = points.iter().zip(&values).filter(|(_, v)| **v >= top - 1e-3).map(|(x, _)| x).collect();
        // The bound of the rounding moves a little with the constant: a second pass settles it.
        for _ in 0..3 {
            let highest = outermost
                .iter()
                .map(|x| placement.sample(&constraint, x).value_upper(*clearance))
                .fold(f64::NEG_INFINITY, f64::max);
            let excess = highest - 1.0;
            if (-1e-15..=0.0).contains(&excess) {
                break;
            }
            constraint.polynomial = constraint.polynomial.with_constant_shifted(-(excess + 4.0 * f64::EPSILON));
        }
        Ok(Body::new(name, *normalization, vec![constraint])?.with_points(points)?)
    }
}

/// The map from the frame of the points to that of the ellipsoid around the conditioned points, with orthogonal rows: such a
/// map amplifies no rounding, however long the ellipsoid is.
fn whitening(frame: &Frame, ellipsoid: &Ellipsoid) -> Option<Normalization> {
    let center = frame.center + frame.linear.try_inverse()? * ellipsoid.center;
    let decomposition = (ellipsoid.linear * frame.linear).svd(false, true);
    let mut turn = decomposition.v_t?;
    if turn.determinant() < 0.0 {
        turn.row_mut(2).neg_mut();
    }
    Some(Normalization { center, linear: Matrix3::from_diagonal(&decomposition.singular_values) * turn })
}

/// The map from the whitened frame to the unit frame.
fn unit_frame(points: &[Vector3<f64>], whitened: &Normalization) -> Option<Affine> {
    let count = points.len() as f64;
    // About the center, which is near: far-off coordinates would round the mean away.
    let offset = points.iter().map(|p| (p - whitened.center) / count).sum::<Vector3<f64>>();
    let reach = points.iter().map(|p| (p - whitened.center - offset).norm()).fold(0.0, f64::max);
    Some(Affine { linear: whitened.linear.try_inverse()? / reach, offset: -offset / reach })
}

fn check(points: &[Vector3<f64>]) -> Result<(), FitError> {
    if points.len() < 4 {
        return Err(FitError::TooFewPoints(points.len()));
    }
    if let Some(index) = points.iter().position(|p| !p.iter().all(|v| v.is_finite())) {
        return Err(FitError::NotFinite(index));
    }
    let reach = points.iter().map(Vector3::amax).fold(0.0, f64::max);
    // Coinciding points at the origin are told as such later.
    if reach > 1e15 || reach > 0.0 && reach < 1e-15 { Err(FitError::OutOfRange(reach)) } else { Ok(()) }
}
