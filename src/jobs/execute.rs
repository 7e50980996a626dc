//! Requests executed: all that they make, with what it took.

use std::borrow::Cow;
use std::ops::ControlFlow;
use std::sync::Arc;

use super::Phase;
use super::request::{FitPlan, RequestError, asked_group, body_name, enclosing, plan};
use crate::body::{Body, Compound, Obstacle, Shape, SolverStep, SosBody};
use crate::fit;
use crate::fit::{
    CompoundFit, Cover, EncloseError, FitError, Group, Mesh, Progress, Representation, Rung, SosFit, cheapest_within,
    coarsest_within, enclose_obstacles, fit_parts, fit_sos, group, ladder, thicken, trim,
};
use crate::scene::{Geometry, Ladder};
use crate::store::{FitOptimum, FitOutcome, FitPreparation, FitRequest, FittedBody, FittedKind};

/// Iterations of the solver that are kept with a job.
const MAX_LOGGED_STEPS: usize = 200;

/// All that a request made.
#[derive(Clone, Debug)]
pub struct FitOutput {
    /// What it took, in the order of the shapes.
    pub outcome: FitOutcome,
    /// What it made.
    pub shapes: Shapes,
    /// The ladder of the bodies, if they make one.
    pub ladder: Option<Arc<Ladder>>,
}

/// What a request can make.
#[derive(Clone, Debug)]
pub enum Shapes {
    /// Bodies: one, the rungs of a ladder, or those around a group.
    Bodies(Vec<Body>),
    /// The union of several.
    Compound(Box<Compound>),
    /// A set that need not be convex.
    SosBody(Box<SosBody>),
}

/// Why a request made nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// It cannot be used.
    #[error(transparent)]
    Request(#[from] RequestError),
    /// The points cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The bodies cannot be grouped.
    #[error(transparent)]
    Group(#[from] EncloseError),
}

impl FitOutput {
    /// All of it as a catalogue keeps it.
    pub(super) fn into_stored(self) -> Vec<Geometry> {
        let mut stored: Vec<Geometry> = match self.shapes {
            Shapes::Bodies(bodies) => bodies.into_iter().map(Geometry::from).collect(),
            Shapes::Compound(compound) => vec![(*compound).into()],
            Shapes::SosBody(body) => vec![(*body).into()],
        };
        stored.extend(self.ladder.map(Geometry::Ladder));
        stored
    }
}

impl From<Representation> for FitOutput {
    fn from(made: Representation) -> Self {
        match made {
            Representation::Body(rung) => vec![*rung].into(),
            Representation::Compound(fit) => (*fit).into(),
        }
    }
}

impl From<Vec<Rung>> for FitOutput {
    fn from(rungs: Vec<Rung>) -> Self {
        let took = |Rung { body, gap, seconds, report }: &Rung| FittedBody {
            id: body.id().to_string(),
            gap_m: Some(gap.most_m),
            mean_gap_m: Some(gap.mean_m),
            seconds: *seconds,
            optimum: report.as_ref().map(|report| FitOptimum {
                objective_value: report.objective_value,
                optimality_gap: report.optimality_gap,
                refinement_end: report.refinement_end.map(|end| end.to_string()),
                solver: Some(report.solver),
                fallback: report.fallback.clone(),
                log: logged(&report.log),
            }),
            ..FittedBody::default()
        };
        let bodies = rungs.iter().map(took).collect();
        Self::new(bodies, Shapes::Bodies(rungs.into_iter().map(|rung| rung.body).collect()))
    }
}

impl From<CompoundFit> for FitOutput {
    fn from(CompoundFit { compound, seconds, shortfall }: CompoundFit) -> Self {
        let (id, gap_m) = (compound.id().to_string(), compound.gap_m());
        let shortfall = shortfall.map(|shortfall| shortfall.to_string());
        let took = FittedBody { kind: FittedKind::Compound, id, gap_m, seconds, shortfall, ..FittedBody::default() };
        Self::new(vec![took], Shapes::Compound(Box::new(compound)))
    }
}

impl From<SosFit> for FitOutput {
    fn from(SosFit { body, report }: SosFit) -> Self {
        let optimum = report.program.map(|program| FitOptimum {
            objective_value: program.objective_value,
            optimality_gap: Some(program.optimality_gap).filter(|gap| gap.is_finite()),
            refinement_end: None,
            solver: Some(program.solver),
            fallback: program.fallback,
            log: logged(&program.log),
        });
        let (id, seconds) = (body.id().to_string(), report.seconds);
        let took = FittedBody { kind: FittedKind::SosBody, id, seconds, optimum, ..FittedBody::default() };
        Self::new(vec![took], Shapes::SosBody(Box::new(body)))
    }
}

impl FitOutput {
    fn new(bodies: Vec<FittedBody>, shapes: Shapes) -> Self {
        let outcome = FitOutcome { bodies, ladder: None, left_out: 0, left_out_m: 0.0 };
        Self { outcome, shapes, ladder: None }
    }
}

/// The last iterations of a fit, with numbers that can be kept.
fn logged(log: &[SolverStep]) -> Vec<SolverStep> {
    let finite = |value: f64| if value.is_nan() { 0.0 } else { value.clamp(f64::MIN, f64::MAX) };
    let step = |step: &SolverStep| SolverStep {
        primal: finite(step.primal),
        dual: finite(step.dual),
        primal_residual: finite(step.primal_residual),
        dual_residual: finite(step.dual_residual),
        step_length: finite(step.step_length),
        ..*step
    };
    log[log.len().saturating_sub(MAX_LOGGED_STEPS)..].iter().map(step).collect()
}

/// Executes a request about a mesh: thickens, trims and fits. `progress` can stop it.
///
/// # Errors
/// What is wrong with the request or the mesh, and what could not be solved or proven.
pub fn fit_mesh(
    request: &FitRequest,
    mut mesh: Mesh,
    mut progress: impl FnMut(Phase, Progress) -> ControlFlow<()>,
) -> Result<FitOutput, Failure> {
    // What was thickened or trimmed has lost its triangles.
    let FitPreparation { trim: fraction, min_thickness_m } = request.mode.preparation();
    if let Some(least_m) = min_thickness_m
        && let Cow::Owned(points) = thicken(&mesh.points, least_m)
    {
        mesh = Mesh { points, triangles: Vec::new() };
    }
    let (mut left_out, mut left_out_m) = (0, 0.0);
    if fraction > 0.0 {
        let trimmed = trim(&mesh.points, fraction, &mut |said| progress(Phase::Trimming, said))?;
        (left_out, left_out_m) = (trimmed.left_out.len(), trimmed.farthest_m);
        mesh = Mesh { points: trimmed.kept, triangles: Vec::new() };
    }
    let mut output = fit_prepared(request, &mesh, &mut |said| progress(Phase::Solving, said))?;
    (output.outcome.left_out, output.outcome.left_out_m) = (left_out, left_out_m);
    Ok(output)
}

fn fit_prepared(
    request: &FitRequest,
    mesh: &Mesh,
    tell: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<FitOutput, Failure> {
    let (name, points) = (&request.name, &mesh.points);
    Ok(match plan(request) {
        FitPlan::Body(options) => vec![fit::fit(name, points, &options, tell)?.into()].into(),
        FitPlan::Ladder(options) => as_ladder(name, ladder(name, points, &options, tell)?.into()),
        FitPlan::WithinGap(most_m, options) if mesh.triangles.is_empty() => {
            vec![coarsest_within(name, points, most_m, &options, tell)?].into()
        }
        FitPlan::WithinGap(most_m, options) => cheapest_within(name, mesh, most_m, &options, tell)?.into(),
        FitPlan::Compound(parts, options) => fit_parts(name, mesh, parts, &options, tell)?.into(),
        FitPlan::SosBody(options) => fit_sos(name, points, &mesh.triangles, &options, tell)?.into(),
        FitPlan::Group(_) => return Err(about_bodies().into()),
    })
}

/// Rungs with the ladder that they make; a single one makes none. Of a higher degree is not always
/// smaller: a rung that is larger than one before it is made all the same, and is none of the
/// ladder.
fn as_ladder(name: &str, mut made: FitOutput) -> FitOutput {
    if let Shapes::Bodies(bodies) = &made.shapes {
        let mut least_m3 = f64::INFINITY;
        let is_smaller = |body: &&Body| {
            let volume_m3 = body.volume().volume_m3;
            let smaller = volume_m3 <= least_m3;
            least_m3 = least_m3.min(volume_m3);
            smaller
        };
        let rungs = bodies.iter().filter(is_smaller).map(|body| Arc::new(Shape::Body(Box::new(body.clone()))));
        match Ladder::new(name, rungs.collect()) {
            Ok(ladder) => {
                made.outcome.ladder = Some(ladder.id().to_string());
                made.ladder = Some(Arc::new(ladder));
            }
            Err(error) => tracing::warn!(name, %error, "the rungs of a fit make no ladder"),
        }
    }
    made
}

fn about_bodies() -> RequestError {
    RequestError::new("group", "is about stored bodies, and a mesh is given; choose another mode")
}

/// Executes a request about a group, which is of these obstacles. `progress` can stop it.
///
/// # Errors
/// What is wrong with the request, and what could not be solved or proven.
pub fn fit_group(
    request: &FitRequest,
    obstacles: &[Obstacle],
    mut progress: impl FnMut(Phase, Progress) -> ControlFlow<()>,
) -> Result<FitOutput, Failure> {
    let asked = asked_group(request)?;
    let options = enclosing(asked);
    let mut tell = |said| progress(Phase::Solving, said);
    let groups = match asked.max_growth {
        Some(max_growth) => group(obstacles, max_growth, &options, &mut tell)?,
        None => {
            let all: Vec<&Obstacle> = obstacles.iter().collect();
            let enclosure = enclose_obstacles(&request.name, &all, &options, &mut tell)?;
            let cover = Cover::Around(Box::new(enclosure));
            vec![Group { members: (0..obstacles.len()).collect(), cover }]
        }
    };
    let (mut took, mut made) = (Vec::new(), Vec::new());
    for (index, Group { members, cover }) in groups.into_iter().enumerate() {
        let (body, enclosure) = (cover.body(), cover.enclosure());
        took.push(FittedBody {
            id: body.id().to_string(),
            gap_m: enclosure.map(|enclosure| enclosure.gap.most_m),
            mean_gap_m: enclosure.map(|enclosure| enclosure.gap.mean_m),
            seconds: enclosure.map_or(0.0, |enclosure| enclosure.seconds),
            optimum: enclosure.map(|enclosure| FitOptimum {
                objective_value: enclosure.objective_value,
                optimality_gap: Some(enclosure.optimality_gap),
                refinement_end: None,
                solver: enclosure.body.provenance().and_then(|provenance| provenance.solver),
                fallback: None,
                log: logged(&enclosure.log),
            }),
            members,
            ..FittedBody::default()
        });
        made.push(body.renamed(&body_name(request, index)).map_err(FitError::from)?);
    }
    Ok(FitOutput::new(took, Shapes::Bodies(made)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Vector3;

    #[test]
    fn a_rung_that_is_larger_is_left_out_of_the_ladder() {
        let points = [Vector3::new(0.1, 0.0, 0.0), Vector3::new(0.0, -0.2, 0.1)];
        let ball = |radius: f64| {
            let ball = Body::ball("rung", Vector3::zeros(), radius).expect("a ball");
            ball.with_points(&points).expect("contained")
        };
        let made = |radii: &[f64]| {
            let bodies: Vec<Body> = radii.iter().map(|radius| ball(*radius)).collect();
            as_ladder("steps", FitOutput::new(Vec::new(), Shapes::Bodies(bodies)))
        };
        let ladder = made(&[1.0, 0.8, 0.9, 0.7, 0.75]).ladder.expect("a ladder");
        let ids: Vec<_> = ladder.rungs().iter().map(|rung| *rung.id()).collect();
        assert_eq!(ids, [1.0, 0.8, 0.7].map(|radius| *ball(radius).id()));
        let Shapes::Bodies(bodies) = made(&[1.0, 0.8, 0.9]).shapes else { panic!("bodies") };
        assert_eq!(bodies.len(), 3);
        assert!(made(&[0.8, 0.9]).ladder.is_none());
    }
}
