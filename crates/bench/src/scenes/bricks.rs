//! What all of these measurements are made of: bricks at random poses, and a clock.

use std::error::Error;
use std::sync::Arc;
use std::time::Instant;

use nalgebra::{UnitQuaternion, Vector3};
use sublevel::body::{Body, BodyId};
use sublevel::measure::{Pose, PoseError};
use sublevel::scene::{Geometry, Placement, Scene, Update};

use crate::comparison::Random;
use crate::comparison::sweep::median;

/// Runs of which the median counts: on shared cores that of a dozen changes by a fifth.
pub(super) const RUNS: usize = 51;

/// Median time of [`RUNS`] runs after one that finds everything cold, seconds.
pub(super) fn seconds(mut run: impl FnMut() -> Result<(), Box<dyn Error>>) -> Result<f64, Box<dyn Error>> {
    run()?;
    let mut times = Vec::new();
    for _ in 0..RUNS {
        let start = Instant::now();
        run()?;
        times.push(start.elapsed().as_secs_f64());
    }
    Ok(median(&times))
}

/// A superellipsoid of degree 6, metres.
pub(super) fn brick() -> Result<Body, Box<dyn Error>> {
    Ok(Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6)?)
}

/// A scene of so many bricks in a cube of this half edge, metres.
pub(super) fn bricks(seed: u64, count: usize, reach_m: f64) -> Result<Scene, Box<dyn Error>> {
    let (mut random, body) = (Random(seed), Geometry::from(brick()?));
    let place = |index: usize| Ok(placement(&format!("brick-{index}"), body.id(), anywhere(&mut random, reach_m)?));
    let upserts = (0..count).map(place).collect::<Result<_, PoseError>>()?;
    let update = Update { upserts, ..Update::default() };
    Ok(Scene::new("bench", 0)?.updated(&update, |_: &BodyId| Some(body.clone()))?)
}

/// A store room of so many bricks: side by side with gaps of 2.5 to 6.5 cm, each turned by a
/// degree.
pub(super) fn stacked(seed: u64, count: usize) -> Result<Scene, Box<dyn Error>> {
    let (mut random, body) = (Random(seed), Geometry::from(brick()?));
    let side = (count as f64).cbrt().ceil() as usize;
    let place = |index: usize| {
        let cell = [index % side, index / side % side, index / side / side].map(|at| at as f64);
        let middle = Vector3::from(cell).component_mul(&Vector3::new(1.045, 0.645, 0.445));
        let translation = middle + 0.01 * Vector3::from_fn(|_, _| random.signed());
        let rotation = UnitQuaternion::new(0.02 * random.direction());
        let pose = Pose::from_quaternion(translation, rotation.coords.into())?;
        Ok(placement(&format!("brick-{index}"), body.id(), pose))
    };
    let upserts = (0..count).map(place).collect::<Result<_, PoseError>>()?;
    let update = Update { upserts, ..Update::default() };
    Ok(Scene::new("store room", 0)?.updated(&update, |_: &BodyId| Some(body.clone()))?)
}

/// An object without group, padding and holder.
pub(super) fn placement(name: &str, body: &BodyId, pose: Pose) -> Placement {
    let (name, group): (Arc<str>, Arc<str>) = (name.into(), "".into());
    Placement { name, body: *body, pose: Some(pose), group, padding_m: None, attachment: None }
}

/// A random pose in a cube of this half edge, metres.
pub(super) fn anywhere(random: &mut Random, reach_m: f64) -> Result<Pose, PoseError> {
    let (rotation, translation) = (random.rotation(), Vector3::from_fn(|_, _| reach_m * random.signed()));
    Pose::from_quaternion(translation, rotation.coords.into())
}

/// As calls pack it: translation, then quaternion x y z w.
pub(super) fn numbers(pose: &Pose) -> [f64; 7] {
    let (t, q) = (pose.translation(), pose.rotation().coords);
    [t.x, t.y, t.z, q.x, q.y, q.z, q.w]
}
