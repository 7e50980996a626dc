//! Orders carried out: all that they make, with what it took.

use std::borrow::Cow;
use std::ops::ControlFlow;

use super::Phase;
use super::order::{FitPlan, OrderError, enclosing, plan};
use crate::body::{Body, Compound, Obstacle, SosBody};
use crate::fit::{
    CompoundFit, Cover, EncloseError, FitError, FitOptions, Group, Mesh, Progress, Representation, Rung, SosFit,
    cheapest_within, coarsest_within, enclose_obstacles, fit, fit_parts, fit_sos, group, ladder, thicken, trim,
};
use crate::store::{FitGroup, FitOptimum, FitOrder, FitOutcome, FittedBody, FittedKind};

/// All that an order made.
#[derive(Clone, Debug)]
pub struct FitOutput {
    /// What it took, in the order of the shapes.
    pub outcome: FitOutcome,
    /// What it made.
    pub shapes: Shapes,
}

/// What an order can make.
#[derive(Clone, Debug)]
pub enum Shapes {
    /// Bodies: one, the rungs of a ladder, or those around a group.
    Bodies(Vec<Body>),
    /// The union of several.
    Compound(Box<Compound>),
    /// A set that need not be convex.
    SosBody(Box<SosBody>),
}

/// Why an order made nothing.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// It cannot be understood.
    #[error(transparent)]
    Order(#[from] OrderError),
    /// The points cannot be fitted.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// The bodies cannot be grouped.
    #[error(transparent)]
    Group(#[from] EncloseError),
}

impl Shapes {
    /// The bodies, which a catalogue keeps; and the file of what it does not.
    pub(super) fn into_stored(self) -> (Vec<Body>, Option<String>) {
        match self {
            Self::Bodies(bodies) => (bodies, None),
            Self::Compound(compound) => (Vec::new(), Some(compound.to_json())),
            Self::SosBody(body) => (Vec::new(), Some(body.to_json())),
        }
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
        });
        let (id, seconds) = (body.id().to_string(), report.seconds);
        let took = FittedBody { kind: FittedKind::SosBody, id, seconds, optimum, ..FittedBody::default() };
        Self::new(vec![took], Shapes::SosBody(Box::new(body)))
    }
}

impl FitOutput {
    fn new(bodies: Vec<FittedBody>, shapes: Shapes) -> Self {
        Self { outcome: FitOutcome { bodies, left_out: 0, left_out_m: 0.0 }, shapes }
    }
}

/// Carries out an order about a mesh: thickens, trims and fits. `progress` can stop it.
///
/// # Errors
/// What is wrong with the order or the mesh, and what could not be solved or proven.
pub fn fit_mesh(
    order: &FitOrder,
    mut mesh: Mesh,
    mut progress: impl FnMut(Phase, Progress) -> ControlFlow<()>,
) -> Result<FitOutput, Failure> {
    // What was thickened or trimmed has lost its triangles.
    if let Some(least_m) = order.min_thickness_m
        && let Cow::Owned(points) = thicken(&mesh.points, least_m)
    {
        mesh = Mesh { points, triangles: Vec::new() };
    }
    let (mut left_out, mut left_out_m) = (0, 0.0);
    if order.trim > 0.0 {
        let trimmed = trim(&mesh.points, order.trim, &mut |said| progress(Phase::Trimming, said))?;
        (left_out, left_out_m) = (trimmed.left_out.len(), trimmed.farthest_m);
        mesh = Mesh { points: trimmed.kept, triangles: Vec::new() };
    }
    let mut tell = |said| progress(Phase::Fitting, said);
    let mut made = match plan(order)? {
        FitPlan::Convex(options) => fit_convex(order, &mesh, &options, &mut tell)?,
        FitPlan::Relaxed(options) => fit_sos(&order.name, &mesh.points, &mesh.triangles, &options, &mut tell)?.into(),
    };
    (made.outcome.left_out, made.outcome.left_out_m) = (left_out, left_out_m);
    Ok(made)
}

fn fit_convex(
    order: &FitOrder,
    mesh: &Mesh,
    options: &FitOptions,
    tell: &mut dyn FnMut(Progress) -> ControlFlow<()>,
) -> Result<FitOutput, FitError> {
    let (name, points) = (&order.name, &mesh.points);
    Ok(match (order.max_gap_m, order.parts) {
        (Some(most_m), _) if mesh.triangles.is_empty() => {
            vec![coarsest_within(name, points, most_m, options, tell)?].into()
        }
        (Some(most_m), _) => cheapest_within(name, mesh, most_m, options, tell)?.into(),
        (None, Some(parts)) => fit_parts(name, mesh, parts, options, tell)?.into(),
        (None, None) if order.ladder => ladder(name, points, options, tell)?.into(),
        (None, None) => vec![fit(name, points, options, tell)?.into()].into(),
    })
}

/// Carries out an order about a group, which is of these obstacles. `progress` can stop it.
///
/// # Errors
/// What is wrong with the order, and what could not be solved or proven.
pub fn fit_group(
    order: &FitOrder,
    obstacles: &[Obstacle],
    mut progress: impl FnMut(Phase, Progress) -> ControlFlow<()>,
) -> Result<FitOutput, Failure> {
    let asked = order.group.as_ref().ok_or_else(|| OrderError::new("group", "is missing; name the bodies"))?;
    let options = enclosing(order, asked);
    let mut tell = |said| progress(Phase::Fitting, said);
    let groups = match asked.max_growth {
        Some(max_growth) => group(obstacles, max_growth, &options, &mut tell)?,
        None => {
            let all: Vec<&Obstacle> = obstacles.iter().collect();
            let enclosure = enclose_obstacles(&order.name, &all, &options, &mut tell)?;
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
            }),
            members,
            ..FittedBody::default()
        });
        made.push(body.renamed(&body_name(order, index)).map_err(FitError::from)?);
    }
    Ok(FitOutput::new(took, Shapes::Bodies(made)))
}

/// Name of a body that an order makes, counted from 0: its own, with a number where several share
/// it.
pub fn body_name(order: &FitOrder, index: usize) -> String {
    let name = &order.name;
    match &order.group {
        Some(FitGroup { max_growth: Some(_), .. }) => format!("{name}-{}", index + 1),
        _ => name.clone(),
    }
}
