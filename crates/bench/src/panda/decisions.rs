//! States of a family of problems, by every representation and by coal, in turns.

use std::error::Error;
use std::path::Path;
use std::time::Instant;

use nalgebra::Isometry3;
use sublevel::scene::query::{Clearance, JointValues, StateVerdict, States};
use sublevel::scene::{Question, Scene, Slot, Stop};

use super::arm::Arm;
use super::coal::{CoalPanda, CoalStates, CoalTimes};
use super::place::{ARM, BASE_LINK, Site};
use super::problems::Problem;
use super::representation::{LoadedArm, Representation};
use super::rows::{COAL, StateRow};
use super::states::{ProblemStates, marked};
use crate::comparison::sweep::median;

/// Farther than this is nothing, metres: all pairs are within.
const FAR_M: f64 = 100.0;
/// Relative width of the brackets of distances, that of coal's GJK.
const ACCURACY: f64 = 1e-6;

/// A problem with its states.
struct Task<'a> {
    problem: &'a Problem,
    states: ProblemStates,
}

/// A representation in the scenes of all problems of the family.
struct Entry<'a> {
    links: Representation,
    arm: &'a LoadedArm,
    /// Without and with self-collision.
    scenes: Vec<[Scene; 2]>,
    /// The timed states of each problem as poses.
    given: Vec<LinkPoses>,
    /// Microseconds per state, round by round.
    times: [Vec<f64>; 5],
}

/// States as world poses of the links that move, the base at the origin.
struct LinkPoses {
    /// Objects of the links.
    slots: Vec<Slot>,
    /// Translations, metres, and quaternions x y z w, packed.
    numbers: Vec<f64>,
}

impl LinkPoses {
    /// Those of packed joint values, radians.
    fn new(scene: &Scene, states: &[f64]) -> Result<Self, Box<dyn Error>> {
        let instance = scene.robot(ARM).ok_or("a scene without the arm")?;
        let base = scene.slot(&format!("{ARM}/{BASE_LINK}"));
        let objects = instance.link_slots().iter().enumerate();
        let moving: Vec<(usize, Slot)> =
            objects.filter_map(|(link, &slot)| Some((link, slot?))).filter(|(_, slot)| Some(*slot) != base).collect();
        let kinematics = instance.robot().kinematics();
        let (mut frames, mut numbers) = (Vec::new(), Vec::new());
        for state in states.chunks_exact(kinematics.width()) {
            kinematics.forward(&Isometry3::identity(), state, &mut frames);
            for (link, _) in &moving {
                let (translation, rotation) = (frames[*link].translation.vector, frames[*link].rotation.coords);
                numbers.extend(translation.iter());
                // As the library places links.
                numbers.extend((rotation / rotation.norm()).iter());
            }
        }
        Ok(Self { slots: moving.into_iter().map(|(_, slot)| slot).collect(), numbers })
    }

    /// The question about these states, whose poses are `numbers`.
    fn question(&self, scene: &Scene, numbers: Vec<f64>) -> Result<States, Box<dyn Error>> {
        Ok(States::new(scene.clone(), &self.slots, numbers, 0.0, false)?)
    }

    /// Compares with what is proven of the same states as joint values.
    ///
    /// # Errors
    /// A state that is free one way and in contact the other.
    fn compare(&self, scene: &Scene, states: &[f64]) -> Result<(), Box<dyn Error>> {
        let by_joints = alone(&question(scene, states)?).concat();
        let by_poses = alone(&self.question(scene, self.numbers.clone())?).concat();
        let differ =
            |pair: [StateVerdict; 2]| pair.contains(&StateVerdict::Free) && pair.contains(&StateVerdict::Contact);
        if by_joints.len() != by_poses.len()
            || by_joints.iter().zip(&by_poses).any(|(a, b)| differ([a.verdict, b.verdict]))
        {
            return Err("states are decided otherwise by poses of links than by joint values".into());
        }
        Ok(())
    }
}

/// How much is measured.
#[derive(Clone, Copy, Debug)]
pub(super) struct Effort {
    /// Rounds in which all take their turns.
    pub(super) rounds: usize,
    /// States anywhere of a problem.
    pub(super) random: usize,
}

/// The rows of a family; the last one is coal's, if it takes part.
pub(super) fn measure(
    arm: &Arm,
    arms: &[(Representation, LoadedArm)],
    sites: &[Site<'_>],
    (coal, folder): (Option<&CoalPanda>, &Path),
    effort: Effort,
) -> Result<Vec<StateRow>, Box<dyn Error>> {
    let width = arm.kinematics.width();
    let mut tasks = Vec::new();
    for (seed, site) in (1..).zip(sites) {
        let states = ProblemStates::new(arm, site.problem, effort.random, seed)?;
        tasks.push(Task { problem: site.problem, states });
    }
    let mut entries = Vec::new();
    for (links, loaded) in arms {
        let scenes = sites.iter().map(|site| site.scenes(loaded)).collect::<Result<Vec<_>, _>>()?;
        let of_task = |(task, scenes): (&Task<'_>, &[Scene; 2])| LinkPoses::new(&scenes[0], &task.states.timed);
        let given = tasks.iter().zip(&scenes).map(of_task).collect::<Result<Vec<_>, _>>()?;
        entries.push(Entry { links: *links, arm: loaded, scenes, given, times: Default::default() });
    }
    let reference = entries.iter().position(|entry| entry.links == Representation::Default).unwrap_or(0);
    for (index, task) in tasks.iter_mut().enumerate() {
        let marks = free(&entries[reference].scenes[index][0], &task.states.timed)?;
        task.states.free = marked(&task.states.timed, width, &marks);
    }

    let timed: Vec<_> = tasks.iter().map(|task| (task.problem, &task.states.timed[..])).collect();
    let of_coal = coal.map(|coal| coal.write(folder, arm, &timed)).transpose()?;
    let mut coal_runs: Vec<CoalTimes> = Vec::new();
    for round in 0..effort.rounds {
        coal_runs.extend(of_coal.as_ref().map(CoalStates::run).transpose()?);
        for entry in &mut entries {
            entry.round(&tasks, width, round == 0)?;
        }
    }

    let mut rows = Vec::new();
    for entry in &entries {
        rows.push(entry.row(arm, &tasks, (coal, folder))?);
    }
    if let Some(coal) = coal {
        rows.push(coal_row(arm, &tasks, (coal, folder), &coal_runs)?);
    }
    Ok(rows)
}

/// Answers a question on this thread.
pub(super) fn alone<Q: Question>(question: &Q) -> Vec<Q::Part> {
    let stop = Stop::default();
    (0..question.chunks()).map(|chunk| question.solve(chunk, &stop)).collect()
}

/// The question about packed states of the arm.
pub(super) fn question(scene: &Scene, states: &[f64]) -> Result<States, Box<dyn Error>> {
    Ok(States::of_joints(scene.clone(), JointValues { robot: ARM, joints: &[], values: states.to_vec() }, 0.0, false)?)
}

/// Which of these states are proven free.
pub(super) fn free(scene: &Scene, states: &[f64]) -> Result<Vec<bool>, Box<dyn Error>> {
    if states.is_empty() {
        return Ok(Vec::new());
    }
    let answers = alone(&question(scene, states)?).concat();
    Ok(answers.iter().map(|answer| answer.verdict == StateVerdict::Free).collect())
}

impl Entry<'_> {
    /// One turn: states with hints, by joint values without and with self-collision, and by poses;
    /// in the first one also states cold, and distances.
    fn round(&mut self, tasks: &[Task<'_>], width: usize, is_first: bool) -> Result<(), Box<dyn Error>> {
        let count = |pick: fn(&ProblemStates) -> &[f64]| {
            (tasks.iter().map(|task| pick(&task.states).len()).sum::<usize>() / width) as f64
        };
        let timed: fn(&ProblemStates) -> &[f64] = |states| &states.timed;
        for (place, (side, is_cold)) in [(0, true), (0, false), (1, false)].into_iter().enumerate() {
            if is_cold && !is_first {
                continue;
            }
            let start = Instant::now();
            for (task, scenes) in tasks.iter().zip(&self.scenes) {
                let question = question(&scenes[side], timed(&task.states))?;
                std::hint::black_box(alone(&if is_cold { question.cold() } else { question }));
            }
            self.times[place].push(1e6 * start.elapsed().as_secs_f64() / count(timed));
        }
        let numbers: Vec<Vec<f64>> = self.given.iter().map(|given| given.numbers.clone()).collect();
        let start = Instant::now();
        for ((given, numbers), scenes) in self.given.iter().zip(numbers).zip(&self.scenes) {
            std::hint::black_box(alone(&given.question(&scenes[0], numbers)?));
        }
        self.times[4].push(1e6 * start.elapsed().as_secs_f64() / count(timed));
        if !is_first {
            return Ok(());
        }
        let start = Instant::now();
        for (task, scenes) in tasks.iter().zip(&self.scenes).filter(|(task, _)| !task.states.free.is_empty()) {
            let question = Clearance::of_joints(
                scenes[0].clone(),
                JointValues { robot: ARM, joints: &[], values: task.states.free.clone() },
                FAR_M,
                false,
            )?;
            std::hint::black_box(alone(&question.without_gradients().with_accuracy(ACCURACY)?));
        }
        self.times[3].push(1e6 * start.elapsed().as_secs_f64() / count(|states| &states.free));
        Ok(())
    }

    /// What came of it, with the verdicts.
    fn row(
        &self,
        arm: &Arm,
        tasks: &[Task<'_>],
        (coal, folder): (Option<&CoalPanda>, &Path),
    ) -> Result<StateRow, Box<dyn Error>> {
        let (width, mut kept, mut random_free) = (arm.kinematics.width(), [0, 0], Vec::new());
        for ((task, scenes), given) in tasks.iter().zip(&self.scenes).zip(&self.given) {
            for (kept, scene) in kept.iter_mut().zip(scenes) {
                *kept += free(scene, &task.states.ends)?.into_iter().filter(|free| *free).count();
            }
            given.compare(&scenes[0], &task.states.timed)?;
            let marks = free(&scenes[0], &task.states.random)?;
            random_free.push((task.problem, marked(&task.states.random, width, &marks)));
        }
        let proven: Vec<_> = random_free.iter().map(|(problem, states)| (*problem, &states[..])).collect();
        let [cold_us, scene_us, self_us, distances_us, given_us] =
            [0, 1, 2, 3, 4].map(|place| median(&self.times[place]));
        Ok(StateRow {
            family: tasks.first().map(|task| task.problem.family.clone()).unwrap_or_default(),
            representation: self.links.name().into(),
            pieces: self.arm.pieces,
            known: 2 * tasks.len(),
            kept: kept[0],
            kept_self: kept[1],
            random: count(tasks, width),
            random_free: random_free.iter().map(|(_, states)| states.len() / width).sum(),
            contacts: coal.map(|coal| coal.contacts(folder, arm, &proven)).transpose()?,
            cold_us,
            scene_us,
            given_us,
            self_us,
            distances_us,
            call_us: f64::NAN,
            inside_us: f64::NAN,
        })
    }
}

fn count(tasks: &[Task<'_>], width: usize) -> usize {
    tasks.iter().map(|task| task.states.random.len() / width).sum()
}

/// Coal on the same states.
fn coal_row(
    arm: &Arm,
    tasks: &[Task<'_>],
    (coal, folder): (&CoalPanda, &Path),
    runs: &[CoalTimes],
) -> Result<StateRow, Box<dyn Error>> {
    let of = |pick: fn(&ProblemStates) -> &[f64]| -> Vec<(&Problem, &[f64])> {
        tasks.iter().map(|task| (task.problem, pick(&task.states))).collect()
    };
    let time = |time: fn(&CoalTimes) -> f64| median(&runs.iter().map(time).collect::<Vec<_>>());
    let distances = coal.write(folder, arm, &of(|states| &states.free))?.run()?.distance_all.us_per_state;
    let contacts = coal.contacts(folder, arm, &of(|states| &states.random))?;
    let random = count(tasks, arm.kinematics.width());
    Ok(StateRow {
        family: tasks.first().map(|task| task.problem.family.clone()).unwrap_or_default(),
        representation: COAL.into(),
        pieces: arm.links.len(),
        known: 2 * tasks.len(),
        kept: 2 * tasks.len() - coal.contacts(folder, arm, &of(|states| &states.ends))?,
        kept_self: 0,
        random,
        random_free: random - contacts,
        contacts: Some(contacts),
        cold_us: time(|run| run.collide_cold.us_per_state),
        scene_us: time(|run| run.collide_warm.us_per_state),
        given_us: time(|run| run.collide_warm.us_per_state),
        self_us: f64::NAN,
        distances_us: distances,
        call_us: f64::NAN,
        inside_us: f64::NAN,
    })
}
