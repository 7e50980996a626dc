//! Scenes and questions: what the service adds to the library, and how scenes grow.

mod calls;
mod clutter;
mod panda;
mod poses_at_rate;
mod report;
mod shown;
mod ticks;

use std::error::Error;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::Vector3;
use sublevel::body::{Body, BodyId};
use sublevel::measure::{Pose, PoseError};
use sublevel::scene::{Crew, Geometry, Placement, Scene, Update};

use super::Machine;
use super::comparison::sweep::median;
use super::comparison::{FitCache, Random};
use calls::Call;
use clutter::Clutter;
use poses_at_rate::Ages;
pub(crate) use shown::Shown;
use ticks::Tick;

/// What was measured.
pub struct Scenes {
    machine: Machine,
    quick: bool,
    calls: Vec<Call>,
    ticks: Vec<Tick>,
    ages: Ages,
    fork_us: f64,
    clutter: Clutter,
}

/// Measures calls to a server on loopback in this process, ticks of scenes of up to 100 000
/// objects, forks, streamed poses, and ladders. The robot and its problems are those of `data`;
/// fits are kept in the `cache`. `progress` receives what is going on and can stop it.
///
/// # Errors
/// Data that is missing, fits that fail, and a server that fails.
pub fn scenes(
    data: &Path,
    cache: &FitCache,
    quick: bool,
    progress: &mut dyn FnMut(&str) -> ControlFlow<()>,
) -> Result<Scenes, Box<dyn Error>> {
    let mut announce = |at: &str| if progress(at).is_break() { Err("stopped") } else { Ok(()) };
    let machine = Machine::this();
    let crew = Crew::new(machine.cores)?;
    announce("pairs of one message")?;
    let mut calls = vec![calls::evaluate(&crew)?];
    for problem in panda::problems(data, if quick { 2 } else { 7 })? {
        announce(&format!("states of a robot: {}", problem.set))?;
        calls.push(calls::check_states(&panda::task(&problem, data, cache)?, &crew)?);
    }
    let sizes: &[usize] =
        if quick { &[1000, 3000, 10_000] } else { &[1000, 2000, 5000, 10_000, 20_000, 50_000, 100_000] };
    let mut measured = Vec::new();
    for &objects in sizes {
        announce(&format!("a tick of {objects} objects"))?;
        measured.push(ticks::tick(objects, &crew)?);
    }
    announce("poses at 1 kHz")?;
    let ages = poses_at_rate::ages(if quick { 2.0 } else { 10.0 })?;
    announce("forks")?;
    let scene = bricks(5, 10_000, ticks::reach_m(10_000))?;
    let fork_us = 1e6 * seconds(|| scene.fork("fork").map(drop).map_err(Into::into))?;
    announce("ladders")?;
    let clutter = clutter::clutter(&crew)?;
    Ok(Scenes { machine, quick, calls, ticks: measured, ages, fork_us, clutter })
}

/// Median time of eleven runs after one that finds everything cold, seconds.
fn seconds(mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    run()?;
    let mut times = Vec::new();
    for _ in 0..11 {
        let start = Instant::now();
        run()?;
        times.push(start.elapsed().as_secs_f64());
    }
    Ok(median(&times))
}

/// A superellipsoid of degree 6, metres.
fn brick() -> Result<Body, Box<dyn Error>> {
    Ok(Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6)?)
}

/// A scene of so many bricks in a cube of this half edge, metres.
fn bricks(seed: u64, count: usize, reach_m: f64) -> Result<Scene, Box<dyn Error>> {
    let (mut random, body) = (Random(seed), Geometry::from(brick()?));
    let place = |index: usize| Ok(placement(&format!("brick-{index}"), body.id(), anywhere(&mut random, reach_m)?));
    let upserts = (0..count).map(place).collect::<Result<_, PoseError>>()?;
    let update = Update { upserts, ..Update::default() };
    Ok(Scene::new("bench", 0)?.updated(&update, |_: &BodyId| Some(body.clone()))?)
}

/// An object without group, padding and holder.
fn placement(name: &str, body: &BodyId, pose: Pose) -> Placement {
    let (name, group): (Arc<str>, Arc<str>) = (name.into(), "".into());
    Placement { name, body: *body, pose: Some(pose), group, padding_m: None, attachment: None }
}

/// A random pose in a cube of this half edge, metres.
fn anywhere(random: &mut Random, reach_m: f64) -> Result<Pose, PoseError> {
    let (rotation, translation) = (random.rotation(), Vector3::from_fn(|_, _| reach_m * random.signed()));
    Pose::from_quaternion(translation, rotation.coords.into())
}

/// As calls pack it: translation, then quaternion x y z w.
fn numbers(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation(), pose.rotation().coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}
