//! Questions that nobody waits for any more: the threads that worked on them are free.

use std::sync::Arc;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_scene::query::{Ask, Measure, Operand, Pairs, States};
use sublevel_scene::{Crew, Geometry, Question, Scene, Stop, Update};
use sublevel_testkit::Seeded;

use crate::worlds::{lookup, placement};

const OBJECTS: u32 = 40;

/// Boxes and cylinders in each other, whose depths take longest.
fn pile() -> Scene {
    let bodies: [Geometry; 2] = [
        Body::cylinder("post", 0.2, 1.0).expect("a cylinder").into(),
        Body::cuboid("box", Vector3::new(0.5, 0.4, 0.3)).expect("a box").into(),
    ];
    let mut random = Seeded(3);
    let place = |index: u32| placement(&format!("o{index}"), &bodies[index as usize % 2], random.pose(0.3));
    let update = Update { upserts: (0..OBJECTS).map(place).collect(), ..Update::default() };
    Scene::new("pile", 0).expect("a name").updated(&update, lookup(&bodies)).expect("an update")
}

/// Depths of all pairs, again and again.
fn depths(scene: &Scene) -> Pairs {
    let mut ask = Ask::new(vec![Measure::Signed, Measure::Penetration]).expect("measures");
    ask.cold = true;
    let pair = |index: u32| [index % OBJECTS, (index + 1 + index / OBJECTS % (OBJECTS - 2)) % OBJECTS];
    let operands = (0..OBJECTS).map(Operand::Object).collect();
    Pairs::new(scene.clone(), ask, operands, (0..50_000).map(pair).collect()).expect("pairs")
}

/// Many states of half of the objects among the other half.
fn states(scene: &Scene) -> States {
    let (slots, mut random): (Vec<u32>, _) = ((0..OBJECTS / 2).collect(), Seeded(4));
    let mut numbers = Vec::new();
    for _ in 0..20_000 {
        let pose = random.pose(0.3);
        numbers.extend(pose.translation().iter().chain(pose.rotation().coords.iter()).copied());
    }
    let states = States::new(scene.clone(), &slots, numbers, 0.0, false).expect("states");
    states.with_worst_pair(Some(1e-9)).expect("an accuracy")
}

/// Time from giving up a question that has begun to when its last thread has let go of it.
fn freed<Q: Question>(crew: &Crew, question: Q) -> Duration {
    let (stop, question) = (Arc::<Stop>::default(), Arc::new(question));
    crew.submit(question.clone(), stop.clone(), |_| ());
    std::thread::sleep(Duration::from_millis(10));
    assert!(Arc::strong_count(&question) > 1, "it was over before");
    let begun = Instant::now();
    stop.abandon();
    while Arc::strong_count(&question) > 1 {
        // Not spinning: that would take a core from those that are waited for.
        std::thread::sleep(Duration::from_micros(20));
    }
    begun.elapsed()
}

/// What stops is asked for between two evaluations, not between two pairs. One thread, and the best
/// of many tries, since it may have to wait for its turn on the machine.
#[test]
fn threads_are_free_within_a_millisecond() {
    let (crew, scene) = (Crew::new(1).expect("a thread"), pile());
    let tries = |freed: &dyn Fn() -> Duration| {
        let mut times: Vec<Duration> = (0..100).map(|_| freed()).collect();
        times.sort();
        println!("best {:?}, median {:?}, worst {:?}", times[0], times[50], times[99]);
        times[0]
    };
    assert!(tries(&|| freed(&crew, depths(&scene))) < Duration::from_millis(1));
    assert!(tries(&|| freed(&crew, states(&scene))) < Duration::from_millis(1));
}
