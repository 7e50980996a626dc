//! Motions of a family of problems: proofs of edges beside sampled checks of ours and of coal.

use std::error::Error;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use sublevel::robot::motion::{Certificate, MotionAnswer, MotionVerdict, Path as JointPath};
use sublevel::scene::query::{MotionSettings, RobotMotionAnswer, RobotMotions, StateVerdict};
use sublevel::scene::{Crew, Question, Scene, Stop};

use super::arm::Arm;
use super::coal::CoalPanda;
use super::decisions::{alone, question};
use super::edges::{Edge, KINDS, candidates};
use super::place::{ARM, Site};
use super::representation::{LoadedArm, Representation};
use super::rows::MotionRow;
use crate::comparison::sweep::median;

/// Turns in which proofs, certificates and verifications of all edges of a problem follow each
/// other; samples are checked in the first one.
const TURNS: usize = 3;

/// An edge that is proven free: medians of the turns, microseconds.
#[derive(Clone, Debug)]
pub(super) struct EdgeTimes {
    kind: usize,
    proof_us: f64,
    configurations: u32,
    certified_us: f64,
    verify_us: f64,
    sampled_us: f64,
    samples: usize,
    contacts: usize,
}

/// The edges of a representation in a family.
pub(super) struct Measured {
    pub(super) family: String,
    pub(super) links: Representation,
    pub(super) problems: usize,
    pub(super) edges: Vec<EdgeTimes>,
    /// Of each kind: microseconds of coal per edge, samples, and contacts.
    pub(super) coal: [Option<CoalEdges>; KINDS.len()],
}

/// Coal on the samples of edges.
#[derive(Clone, Copy, Debug)]
pub(super) struct CoalEdges {
    edges: usize,
    us_per_edge: f64,
    samples: usize,
    contacts: usize,
}

/// Measures the edges of a family for one representation; of each edge so many samples are checked
/// besides.
pub(super) fn measure(
    arm: &Arm,
    (links, loaded): (Representation, &LoadedArm),
    sites: &[Site<'_>],
    (coal, folder): (Option<&CoalPanda>, &Path),
    (samples, crew): (usize, &Crew),
) -> Result<Measured, Box<dyn Error>> {
    let (mut edges, mut of_coal) = (Vec::new(), [(); KINDS.len()].map(|()| Vec::new()));
    for (seed, site) in (1..).zip(sites) {
        let [_, goal] = site.problem.ends(&arm.kinematics)?;
        let [_, scene] = site.scenes(loaded)?;
        let task = Task::new(arm, scene, candidates(arm, &goal, seed))?;
        edges.extend(task.times()?);
        for (edge, times) in task.edges.iter().zip(edges.iter_mut().rev().take(task.edges.len()).rev()) {
            let states = edge.evenly(samples);
            let answers = crew.ask(Arc::new(question(&task.scene, &states)?), Arc::default())?.concat();
            times.samples = answers.len();
            times.contacts = answers.iter().filter(|answer| answer.verdict == StateVerdict::Contact).count();
            of_coal[edge.kind].push((site.problem, edge.samples()));
        }
    }
    let mut found = [None; KINDS.len()];
    if let Some(coal) = coal {
        for (found, edges) in found.iter_mut().zip(&of_coal) {
            let tasks: Vec<_> = edges.iter().map(|(problem, states)| (*problem, &states[..])).collect();
            let samples = edges.iter().map(|(_, states)| states.len() / arm.kinematics.width()).sum();
            let times = coal.write(folder, arm, &tasks)?.run()?;
            let us_per_edge = times.collide_warm.us_per_state * samples as f64 / edges.len().max(1) as f64;
            let contacts = times.collide_cold.contacts;
            *found = Some(CoalEdges { edges: edges.len(), us_per_edge, samples, contacts });
        }
    }
    let family = sites.first().map(|site| site.problem.family.clone()).unwrap_or_default();
    Ok(Measured { family, links, problems: sites.len(), edges, coal: found })
}

/// Edges of a problem that are proven free, one of each kind at most.
struct Task {
    scene: Scene,
    edges: Vec<Edge>,
    motions: RobotMotions,
    certified: RobotMotions,
}

impl Task {
    /// The first candidates that are proven free.
    fn new(arm: &Arm, scene: Scene, candidates: Vec<Edge>) -> Result<Self, Box<dyn Error>> {
        let motions = motions(arm, &scene, &candidates, false)?;
        let mut edges: Vec<Edge> = Vec::new();
        for (index, edge) in candidates.iter().enumerate() {
            let is_known = edges.iter().any(|known| known.kind == edge.kind);
            if !is_known && prove(&motions, index).is_some() {
                edges.push(edge.clone());
            }
        }
        let [own, certified] = [false, true].map(|certificates| self::motions(arm, &scene, &edges, certificates));
        Ok(Self { scene, edges, motions: own?, certified: certified? })
    }

    /// Every turn goes through all edges, so that a search begins with what another edge has left.
    fn times(&self) -> Result<Vec<EdgeTimes>, Box<dyn Error>> {
        let questions: Vec<_> = self.edges.iter().map(Edge::samples).collect();
        let mut turns = vec![[const { Vec::new() }; 4]; self.edges.len()];
        let mut configurations = vec![0; self.edges.len()];
        for turn in 0..TURNS {
            for (index, times) in turns.iter_mut().enumerate() {
                let start = Instant::now();
                let proof = prove(&self.motions, index).ok_or("a motion that was free is not")?;
                times[0].push(1e6 * start.elapsed().as_secs_f64());
                configurations[index] = proof.configurations;
            }
            for (index, times) in turns.iter_mut().enumerate().filter(|_| turn == 0) {
                let start = Instant::now();
                std::hint::black_box(alone(&question(&self.scene, &questions[index])?));
                times[1].push(1e6 * start.elapsed().as_secs_f64());
            }
            for (index, times) in turns.iter_mut().enumerate() {
                let start = Instant::now();
                let proof = prove(&self.certified, index).ok_or("a motion that was free is not")?;
                times[2].push(1e6 * start.elapsed().as_secs_f64());
                let certificate: Box<Certificate> = proof.certificate.ok_or("a proof without its certificate")?;
                let start = Instant::now();
                self.certified.verify(&certificate, &Stop::default())?;
                times[3].push(1e6 * start.elapsed().as_secs_f64());
            }
        }
        let of_edge = |((edge, times), configurations): ((&Edge, &[Vec<f64>; 4]), u32)| EdgeTimes {
            kind: edge.kind,
            proof_us: median(&times[0]),
            configurations,
            sampled_us: median(&times[1]),
            certified_us: median(&times[2]),
            verify_us: median(&times[3]),
            samples: 0,
            contacts: 0,
        };
        Ok(self.edges.iter().zip(&turns).zip(configurations).map(of_edge).collect())
    }
}

/// The question about edges, with self-collision.
fn motions(arm: &Arm, scene: &Scene, edges: &[Edge], certificates: bool) -> Result<RobotMotions, Box<dyn Error>> {
    let paths = edges.iter().map(|edge| JointPath::waypoints(&arm.kinematics, edge.packed()));
    let settings = MotionSettings { certificates, ..MotionSettings::default() };
    let motions = RobotMotions::new(scene.clone(), ARM, &[], 0.0, false)?;
    Ok(motions.with_settings(settings).with_paths(paths.collect::<Result<_, _>>()?))
}

/// The answer of a motion that is proven free.
fn prove(motions: &RobotMotions, index: usize) -> Option<Box<MotionAnswer>> {
    match motions.solve(index, &Stop::default()) {
        RobotMotionAnswer::Checked(answer) if answer.verdict == MotionVerdict::Free => Some(answer),
        _ => None,
    }
}

/// The rows of a representation in some families, one of each kind of edges.
pub(super) fn rows(family: &str, measured: &[&Measured]) -> Vec<MotionRow> {
    (0..KINDS.len()).map(|kind| row(family, measured, kind)).collect()
}

fn row(family: &str, measured: &[&Measured], kind: usize) -> MotionRow {
    let edges: Vec<&EdgeTimes> =
        measured.iter().flat_map(|measured| &measured.edges).filter(|edge| edge.kind == kind).collect();
    let mean = |value: fn(&EdgeTimes) -> f64| edges.iter().map(|edge| value(edge)).sum::<f64>() / edges.len() as f64;
    let mut proofs: Vec<f64> = edges.iter().map(|edge| edge.proof_us).collect();
    proofs.sort_by(f64::total_cmp);
    let at = |part: f64| proofs.get((part * (proofs.len() as f64 - 1.0)).ceil() as usize).copied().unwrap_or(f64::NAN);
    let of_coal: Option<Vec<CoalEdges>> = measured.iter().map(|measured| measured.coal[kind]).collect();
    let coal_us = of_coal.as_ref().map_or(f64::NAN, |found| {
        let sum = found.iter().map(|found| found.us_per_edge * found.edges as f64).sum::<f64>();
        sum / found.iter().map(|found| found.edges).sum::<usize>() as f64
    });
    MotionRow {
        family: family.to_owned(),
        representation: measured.first().map(|measured| measured.links.name().to_owned()).unwrap_or_default(),
        from: KINDS[kind].from().into(),
        length_rad: KINDS[kind].length_rad,
        problems: measured.iter().map(|measured| measured.problems).sum(),
        free: edges.len(),
        mean_us: mean(|edge| edge.proof_us),
        median_us: at(0.5),
        p99_us: at(0.99),
        configurations: mean(|edge| f64::from(edge.configurations)),
        sampled_us: mean(|edge| edge.sampled_us),
        coal_us,
        certified_us: mean(|edge| edge.certified_us),
        verify_us: mean(|edge| edge.verify_us),
        verify_part: median(&edges.iter().map(|edge| edge.verify_us / edge.proof_us).collect::<Vec<_>>()),
        samples: edges.iter().map(|edge| edge.samples).sum(),
        contacts: edges.iter().map(|edge| edge.contacts).sum(),
        coal_samples: of_coal.as_ref().map(|found| found.iter().map(|found| found.samples).sum()),
        coal_contacts: of_coal.as_ref().map(|found| found.iter().map(|found| found.contacts).sum()),
    }
}
