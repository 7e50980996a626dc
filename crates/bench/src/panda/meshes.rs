//! States anywhere against the meshes of the links, by nothing but triangles and points: what is
//! called free has to be.

use std::error::Error;

use nalgebra::{Isometry3, Point3, Vector3};
use sublevel_testkit::triangles::{Bounds, Triangle, bounds, crossings, meet};

use super::arm::{Arm, ArmLink};
use super::decisions::free;
use super::place::{BASE_LINK, Site};
use super::problems::SolidObstacle;
use super::representation::{LoadedArm, Representation};
use super::rows::MeshRow;
use super::states::ProblemStates;

/// What the meshes of the links meet in a state.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Met {
    /// A moving link an obstacle.
    obstacle: bool,
    /// A link another one that it may not touch.
    link: bool,
}

/// The mesh of a link, or an obstacle, in the world, metres.
struct Placed {
    points: Vec<Vector3<f64>>,
    around: Bounds,
}

/// Compares what representations call free with what the meshes meet, in `random` states anywhere
/// of each problem: those of [`ProblemStates`]. All cores work.
///
/// # Errors
/// Obstacles that are no boxes or cylinders.
pub(super) fn measure(
    arm: &Arm,
    arms: &[(Representation, LoadedArm)],
    sites: &[(u64, &Site<'_>)],
    (random, cores): (usize, usize),
) -> Result<Vec<MeshRow>, Box<dyn Error>> {
    let Some((_, any)) = arms.first() else { return Ok(Vec::new()) };
    let pairs = pairs(arm, any);
    let (states, met) = met_everywhere(arm, &pairs, sites, (random, cores))?;
    let is_met = |met: &&Met| met.obstacle || met.link;
    let mut rows = Vec::new();
    for (links, loaded) in arms {
        let mut row = MeshRow {
            representation: links.name().into(),
            states: met.iter().map(Vec::len).sum(),
            contacts: met.iter().flatten().filter(is_met).count(),
            free: 0,
            free_self: 0,
            missed: 0,
        };
        for ((states, met), (_, site)) in states.iter().zip(&met).zip(sites) {
            let [without, with] = site.scenes(loaded)?;
            let (without, with) = (free(&without, &states.random)?, free(&with, &states.random)?);
            for ((met, &free), &free_self) in met.iter().zip(&without).zip(&with) {
                row.free += usize::from(free);
                row.free_self += usize::from(free_self);
                row.missed += usize::from(free && met.obstacle || free_self && (met.obstacle || met.link));
            }
        }
        rows.push(row);
    }
    Ok(rows)
}

/// Pairs of [`Arm::links`] that may not touch: they are checked against each other.
fn pairs(arm: &Arm, loaded: &LoadedArm) -> Vec<[usize; 2]> {
    let count = arm.links.len();
    let all = (0..count).flat_map(|a| (a + 1..count).map(move |b| [a, b]));
    all.filter(|&[a, b]| !loaded.robot.may_touch(arm.links[a].index, arm.links[b].index)).collect()
}

/// The states of each problem, and what is met in each of its random ones.
type Everywhere = (Vec<ProblemStates>, Vec<Vec<Met>>);

/// The states of all problems, and what is met in each.
fn met_everywhere(
    arm: &Arm,
    pairs: &[[usize; 2]],
    sites: &[(u64, &Site<'_>)],
    (random, cores): (usize, usize),
) -> Result<Everywhere, Box<dyn Error>> {
    let (mut states, mut obstacles) = (Vec::new(), Vec::new());
    for (seed, site) in sites {
        states.push(ProblemStates::new(arm, site.problem, random, *seed)?);
        obstacles.push(site.problem.solids()?);
    }
    let work: Vec<_> = states.iter().zip(&obstacles).collect();
    let of = |(states, solids): &(&ProblemStates, &Vec<SolidObstacle>)| met(arm, pairs, solids, &states.random);
    let shares = work.chunks(work.len().div_ceil(cores.max(1)).max(1));
    let met = std::thread::scope(|scope| {
        let running: Vec<_> = shares.map(|share| scope.spawn(|| share.iter().map(of).collect::<Vec<_>>())).collect();
        running
            .into_iter()
            .map(|thread| thread.join().map_err(|_| "a thread has failed"))
            .collect::<Result<Vec<_>, _>>()
    })?;
    Ok((states, met.concat()))
}

/// What is met in each of the packed states.
fn met(arm: &Arm, pairs: &[[usize; 2]], solids: &[SolidObstacle], states: &[f64]) -> Vec<Met> {
    let obstacles: Vec<(Vec<Triangle>, Bounds)> = solids
        .iter()
        .map(|solid| {
            let triangles = solid.triangles();
            let around = bounds(triangles.iter().flatten());
            (triangles, around)
        })
        .collect();
    let mut frames = Vec::new();
    let of_state = |state: &[f64]| {
        arm.kinematics.forward(&Isometry3::identity(), state, &mut frames);
        let placed: Vec<Placed> = arm.links.iter().map(|link| Placed::new(link, &frames[link.index])).collect();
        let obstacle =
            arm.links.iter().zip(&placed).filter(|(link, _)| &*link.name != BASE_LINK).any(|(link, placed)| {
                let near = solids.iter().zip(&obstacles).filter(|(_, (_, around))| meet(around, &placed.around));
                near.into_iter().any(|(solid, (triangles, _))| {
                    placed.points.iter().any(|point| solid.contains(point))
                        || crossings(&placed.triangles(link), triangles) > 0
                })
            });
        let link = pairs.iter().any(|&[a, b]| {
            let (of_a, of_b) = (&placed[a], &placed[b]);
            meet(&of_a.around, &of_b.around)
                && crossings(&of_a.triangles(&arm.links[a]), &of_b.triangles(&arm.links[b])) > 0
        });
        Met { obstacle, link }
    };
    states.chunks_exact(arm.kinematics.width()).map(of_state).collect()
}

impl Placed {
    fn new(link: &ArmLink, frame: &Isometry3<f64>) -> Self {
        let points: Vec<_> = link.mesh.points.iter().map(|point| (frame * Point3::from(*point)).coords).collect();
        let around = bounds(&points);
        Self { points, around }
    }

    fn triangles(&self, link: &ArmLink) -> Vec<Triangle> {
        link.mesh.triangles.iter().map(|corners| corners.each_ref().map(|&corner| self.points[corner])).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::comparison::FitCache;
    use crate::panda::{families, read_problems};
    use sublevel_testkit::data;
    use sublevel_testkit::random::few_or;

    /// Ten states of every fifth problem, or 143 of each of the 700, 1e5 in all, where
    /// `SUBLEVEL_LONG` is set.
    #[test]
    #[ignore = "needs SUBLEVEL_DATA"]
    fn no_state_that_is_proven_free_has_meshes_that_meet() {
        let arm = Arm::read(&data("")).expect("the files of the arm");
        let problems = read_problems(&data("panda/panda_problems.json")).expect("problems");
        let [random, step] = [few_or(10, 143), few_or(5, 1)].map(|count| usize::try_from(count).expect("a number"));
        let folder = tempfile::tempdir().expect("a folder");
        let cache = FitCache::new(folder.path()).expect("a folder");
        let representations = [Representation::Spheres, Representation::Degree6, Representation::Default];
        let arms = representations.map(|links| (links, arm.load(links, &cache).expect("bodies")));
        let sites: Vec<_> = families(&problems, usize::MAX)
            .into_iter()
            .flat_map(|family| (1..).zip(family).step_by(step))
            .map(|(seed, problem)| (seed, Site::new(problem).expect("bodies of obstacles")))
            .collect();
        assert_eq!(sites.len(), 700 / step);
        let places: Vec<_> = sites.iter().map(|(seed, site)| (*seed, site)).collect();
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let rows = measure(&arm, &arms, &places, (random, cores)).expect("measured");
        for row in &rows {
            println!("{row:?}");
            assert!(
                row.states == sites.len() * random && row.contacts > row.states / 30 && row.free > row.states / 2,
                "{row:?}"
            );
        }
        // The spheres leave parts of the links out: the meshes tell what that misses.
        let [spheres, bodies @ ..] = &rows[..] else { panic!("no rows") };
        assert!(spheres.missed > 0 && bodies.iter().all(|row| row.missed == 0), "{rows:?}");
    }
}
