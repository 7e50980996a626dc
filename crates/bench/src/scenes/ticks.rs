//! A tenth of the objects moves, and everything near to them is asked for.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use sublevel::measure::Pose;
use sublevel::scene::query::{Ask, Measure, Operand, Pairs, Selection, Within, combined};
use sublevel::scene::{Crew, Scene, Slot};

use super::bricks::stacked;
use crate::comparison::Random;
use crate::comparison::sweep::median;

/// Nearer than this counts, metres.
const MARGIN_M: f64 = 0.05;
/// One of so many objects moves.
const MOVED: u32 = 10;
/// Farthest from where it was at first along each axis, metres.
const STEP_M: f64 = 0.01;
/// Ticks of a scene.
pub(super) const TICKS: usize = 15;

/// Ticks of a scene: medians.
#[derive(Clone, Debug)]
pub(super) struct Tick {
    pub(super) objects: usize,
    pub(super) moved: usize,
    /// Pairs with a moved object that are within the margin.
    pub(super) pairs: usize,
    pub(super) tick_ms: f64,
    /// Of which to set the poses.
    pub(super) update_ms: f64,
    /// The same pairs, known beforehand.
    pub(super) solve_ms: f64,
}

/// Ticks of a scene of so many objects.
pub(super) fn tick(objects: usize, crew: &Crew) -> Result<Tick, Box<dyn Error>> {
    // The second one knows its pairs beforehand; each has warm starts of its own.
    let (mut scene, mut known) = (stacked(3, objects)?, stacked(3, objects)?);
    let start = scene.clone();
    let mut random = Random(4);
    let moved: Vec<Slot> = (0..u32::try_from(objects)?).filter(|slot| slot % MOVED == 0).collect();
    let ask = Ask::new(vec![Measure::Distance])?;
    let (mut ticks, mut updates, mut solves, mut pairs) = (Vec::new(), Vec::new(), Vec::new(), 0);
    for _ in 0..TICKS {
        let poses = moved.iter().map(|&slot| step(&start, slot, &mut random)).collect::<Result<Vec<_>, _>>()?;
        let begun = Instant::now();
        scene = scene.with_poses(&poses)?;
        updates.push(begun.elapsed().as_secs_f64());
        let selection = Selection::of(&scene, moved.iter().copied(), &Default::default());
        let question = Within::new(scene.clone(), ask.clone(), selection, MARGIN_M);
        let (found, _) = combined(&scene, crew.ask(Arc::new(question), Arc::default())?);
        ticks.push(begun.elapsed().as_secs_f64());

        let operands = scene.objects().map(|(slot, _, _)| slot).max().map_or(0, |last| last + 1);
        let operands = (0..operands).map(Operand::Object).collect();
        let near = found.iter().map(|found| found.pair).collect();
        known = known.with_poses(&poses)?;
        let question = Pairs::new(known.clone(), ask.clone(), operands, near)?;
        let begun = Instant::now();
        crew.ask(Arc::new(question), Arc::default())?;
        solves.push(begun.elapsed().as_secs_f64());
        pairs = found.len();
    }
    // The first one makes the tree and finds everything cold.
    let [tick_ms, update_ms, solve_ms] = [&ticks, &updates, &solves].map(|times| 1e3 * median(&times[1..]));
    Ok(Tick { objects, moved: moved.len(), pairs, tick_ms, update_ms, solve_ms })
}

/// A pose near the first one.
fn step(scene: &Scene, slot: Slot, random: &mut Random) -> Result<(Slot, Pose), Box<dyn Error>> {
    let pose = scene.pose(slot).ok_or("no such object")?;
    let by = STEP_M * Vector3::from_fn(|_, _| random.signed());
    Ok((slot, Pose::from_quaternion(pose.translation() + by, pose.rotation().coords.into())?))
}
