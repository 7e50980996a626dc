//! Decisions of a cluttered scene with ladders, and with their finest rungs alone.

use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;

use nalgebra::Vector3;
use sublevel::body::{BodyId, Shape};
use sublevel::fit::{self, FitOptions};
use sublevel::measure::PoseError;
use sublevel::scene::query::{StateVerdict, States};
use sublevel::scene::{Crew, Geometry, Ladder, Scene, Slot, Update};

use super::bricks::{anywhere, numbers, placement, seconds};
use crate::comparison::Random;

/// Objects in a cube of this half edge, metres.
const OBJECTS: usize = 400;
const REACH_M: f64 = 5.0;
/// Objects that a state places, and states.
const MOVING: u32 = 11;
const STATES: usize = 500;

/// Times of the same decisions.
#[derive(Clone, Copy, Debug)]
pub(super) struct Clutter {
    /// States that are free.
    pub(super) free: usize,
    pub(super) finest_ms: f64,
    pub(super) ladder_ms: f64,
}

/// Decides the same states with bodies of degree 6 and with the ladders that end in them.
pub(super) fn clutter(crew: &Crew) -> Result<Clutter, Box<dyn Error>> {
    let mut random = Random(6);
    let mut point = || Vector3::new(0.3, 0.2, 0.1).component_mul(&Vector3::from_fn(|_, _| random.signed()));
    let points: Vec<Vector3<f64>> = (0..60).map(|_| point()).collect();
    let options = FitOptions { degree: 6, ..FitOptions::default() };
    let rungs = fit::ladder("object", &points, &options, &mut |_| ControlFlow::Continue(()))?;
    let rungs: Vec<Arc<Shape>> = rungs.into_iter().map(|rung| Arc::new(Shape::Body(Box::new(rung.body)))).collect();
    let finest = Geometry::Solid(rungs.last().ok_or("a ladder without rungs")?.clone());
    let ladder = Geometry::Ladder(Arc::new(Ladder::new("object", rungs)?));
    let (finest_ms, of_finest) = decide(&finest, crew)?;
    let (ladder_ms, of_ladder) = decide(&ladder, crew)?;
    if of_finest != of_ladder {
        return Err("ladders and their finest rungs decide differently".into());
    }
    let free = of_finest.iter().filter(|verdict| **verdict == StateVerdict::Free).count();
    Ok(Clutter { free, finest_ms, ladder_ms })
}

fn decide(geometry: &Geometry, crew: &Crew) -> Result<(f64, Vec<StateVerdict>), Box<dyn Error>> {
    let mut random = Random(7);
    let mut place = |index: usize| Ok(placement(&format!("o{index}"), geometry.id(), anywhere(&mut random, REACH_M)?));
    let upserts = (0..OBJECTS).map(&mut place).collect::<Result<_, PoseError>>()?;
    let update = Update { upserts, ..Update::default() };
    let scene = Scene::new("clutter", 0)?.updated(&update, |_: &BodyId| Some(geometry.clone()))?;
    let slots: Vec<Slot> = (0..MOVING).collect();
    let mut packed = Vec::new();
    for _ in 0..STATES * slots.len() {
        packed.extend(numbers(&anywhere(&mut random, REACH_M)?));
    }
    let mut verdicts = Vec::new();
    let time = seconds(|| {
        let question = States::new(scene.clone(), &slots, packed.clone(), 0.0, false)?;
        let answers = crew.ask(Arc::new(question), Arc::default())?.concat();
        verdicts = answers.iter().map(|answer| answer.verdict).collect();
        Ok(())
    })?;
    Ok((1e3 * time, verdicts))
}
