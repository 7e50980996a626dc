//! The workload of a planner: states and motions of a Franka Emika Panda among boxes and cylinders,
//! for several representations of its links, beside coal.

mod arm;
mod calls;
mod coal;
mod csv;
mod decisions;
mod edges;
mod meshes;
mod motions;
mod pictures;
mod place;
mod problems;
mod report;
mod representation;
mod rows;
mod shown;
mod srdf;
mod states;
mod summary;

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;

use sublevel::scene::Crew;

use super::Machine;
use super::comparison::FitCache;
pub(crate) use arm::Arm;
pub(crate) use calls::{RobotServer, StatesCall};
use coal::CoalPanda;
use decisions::Effort;
use motions::Measured;
pub(crate) use place::Site;
pub(crate) use problems::{Problem, families, read_problems};
pub(crate) use representation::{LoadedArm, Representation};
use rows::{ALL, MotionRow, StateRow, Tables};
pub(crate) use shown::Shown;

/// What was measured.
pub struct Panda {
    machine: Machine,
    quick: bool,
    /// Version of coal, if it took part.
    coal: Option<String>,
    tables: Tables,
}

/// How much is measured.
struct Extent {
    /// Problems of a family.
    problems: usize,
    effort: Effort,
    /// Turns of calls.
    turns: usize,
    /// Samples of an edge that are checked besides.
    samples: usize,
}

const FULL: Extent =
    Extent { problems: usize::MAX, effort: Effort { rounds: 3, random: 143 }, turns: 5, samples: 1000 };
const QUICK: Extent = Extent { problems: 4, effort: Effort { rounds: 2, random: 20 }, turns: 1, samples: 100 };

/// Measures states and motions of the arm of `data`, for its own problems or those of another file.
/// Fits are kept in the `cache`; coal takes part when `SUBLEVEL_COAL_PANDA` names its program.
/// `progress` receives what is going on and can stop it.
///
/// # Errors
/// Data that is missing, fits that fail, and a server or a program that fails.
pub fn panda(
    data: &Path,
    problems: Option<&Path>,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Panda, Box<dyn Error>> {
    let mut announce = |at: &str| if progress(at).is_break() { Err("stopped") } else { Ok(()) };
    let arm = Arm::read(data)?;
    let of_data = data.join("panda/panda_problems.json");
    let problems = read_problems(problems.unwrap_or(&of_data))?;
    let extent = if quick { QUICK } else { FULL };
    let families = families(&problems, extent.problems);
    let coal = CoalPanda::from_environment(&arm)?;
    let folder = tempfile::Builder::new().prefix("sublevel-bench-").tempdir()?;
    let beside = (coal.as_ref(), folder.path());
    let mut arms = Vec::new();
    for links in Representation::ALL {
        announce(&format!("bodies of the links: {}", links.name()))?;
        arms.push((links, arm.load(links, cache)?));
    }

    let mut states: Vec<StateRow> = Vec::new();
    let mut sites: Vec<Vec<Site<'_>>> = Vec::new();
    for family in &families {
        announce(&format!("states: {}", family[0].family))?;
        let own = family.iter().map(|problem| Site::new(problem)).collect::<Result<Vec<_>, _>>()?;
        states.extend(decisions::measure(&arm, &arms, &own, beside, extent.effort)?);
        sites.push(own);
    }
    let machine = Machine::this();
    let crew = Crew::new(machine.cores)?;
    add_calls(&arm, &arms, &sites, (&crew, extent.turns), (&mut states, &mut announce))?;
    states.extend(over_all(&states));

    let mut measured: Vec<Measured> = Vec::new();
    for (links, loaded) in arms.iter().filter(|(links, _)| links.has_motions()) {
        for own in &sites {
            announce(&format!("motions: {}, {}", links.name(), own[0].problem.family))?;
            // Coal takes the edges of the representations that the summary is about.
            let beside = if *links == summary::MAIN { beside } else { (None, folder.path()) };
            measured.push(motions::measure(&arm, (*links, loaded), own, beside, (extent.samples, &crew))?);
        }
    }
    let mut motions: Vec<MotionRow> =
        measured.iter().flat_map(|measured| motions::rows(&measured.family, &[measured])).collect();
    for links in Representation::ALL.into_iter().filter(|links| links.has_motions()) {
        let of_all: Vec<&Measured> = measured.iter().filter(|measured| measured.links == links).collect();
        motions.extend(motions::rows(ALL, &of_all));
    }
    announce("meshes of the links")?;
    let places: Vec<_> = sites.iter().flat_map(|own| (1..).zip(own)).collect();
    let meshes = meshes::measure(&arm, &arms, &places, (extent.effort.random, machine.cores))?;
    let mut srdf = Vec::new();
    for (links, loaded) in arms.iter().filter(|(links, _)| *links == Representation::Default) {
        announce("pairs of links")?;
        srdf.push(srdf::measure(&arm, *links, loaded)?);
    }
    let links = arms.iter().flat_map(|(_, loaded)| loaded.links.iter().cloned()).collect();
    let tables = Tables { states, motions, links, meshes, srdf };
    Ok(Panda { machine, quick, coal: coal.map(|coal| coal.version()), tables })
}

/// Says what is going on, and fails when it is to stop.
type Announce<'a> = dyn FnMut(&str) -> Result<(), &'static str> + 'a;

/// Fills in the times of calls, of the first problem of each family.
fn add_calls(
    arm: &Arm,
    arms: &[(Representation, LoadedArm)],
    sites: &[Vec<Site<'_>>],
    (crew, turns): (&Crew, usize),
    (states, announce): (&mut [StateRow], &mut Announce<'_>),
) -> Result<(), Box<dyn Error>> {
    let server = RobotServer::start()?;
    for (links, loaded) in arms {
        let robot = server.load(loaded)?;
        for site in sites.iter().filter_map(|own| own.first()) {
            let family = &site.problem.family;
            announce(&format!("calls: {}, {family}", links.name()))?;
            let StatesCall { states: count, call_us, inside_us, .. } =
                server.check_states((arm, loaded, robot), site, (crew, turns))?;
            let is_row = |row: &&mut StateRow| row.family == *family && row.representation == links.name();
            if let Some(row) = states.iter_mut().find(is_row) {
                [row.call_us, row.inside_us] = [call_us, inside_us].map(|us| us / count as f64);
            }
        }
    }
    server.stop()
}

/// The rows over all families, in the order of the representations.
fn over_all(rows: &[StateRow]) -> Vec<StateRow> {
    let mut names: Vec<&str> = Vec::new();
    for row in rows {
        if !names.contains(&row.representation.as_str()) {
            names.push(&row.representation);
        }
    }
    let of = |name: &str| -> Vec<StateRow> { rows.iter().filter(|row| row.representation == name).cloned().collect() };
    names.into_iter().filter_map(|name| StateRow::of_all(&of(name))).collect()
}
