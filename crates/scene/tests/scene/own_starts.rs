//! Warm starts of one caller beside others that ask about the same pairs.

use std::sync::Arc;

use nalgebra::Vector3;
use sublevel_core::body::Body;
use sublevel_core::measure::Pose;
use sublevel_scene::query::{Answer, Ask, Measure, Operand, Pairs};
use sublevel_scene::{Crew, Geometry, OwnStarts, Scene, Update};
use sublevel_testkit::Seeded;

use crate::worlds::{lookup, placement};

const OBJECTS: usize = 12;

/// Bricks of degree 6 in a row, turned at random.
fn row() -> Scene {
    let brick = Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6).expect("a body");
    let (bodies, mut random) = ([Geometry::from(brick)], Seeded(7));
    let place = |index: usize| {
        let rotation = random.rotation();
        let pose = Pose::from_quaternion(Vector3::new(2.0 * index as f64, 0.0, 0.0), rotation.coords.into());
        placement(&format!("o{index}"), &bodies[0], pose.expect("a pose"))
    };
    let update = Update { upserts: (0..OBJECTS).map(place).collect(), ..Update::default() };
    Scene::new("row", 0).expect("a name").updated(&update, lookup(&bodies)).expect("an update")
}

/// The same with one object moved a little, or turned and moved anywhere.
fn moved(scene: &Scene, random: &mut Seeded, far: bool) -> Scene {
    let slot = random.index(OBJECTS) as u32;
    let pose = *scene.pose(slot).expect("an object");
    let pose = if far {
        Pose::from_quaternion(
            pose.translation() + Vector3::z() * 3.0 * random.signed(),
            random.rotation().coords.into(),
        )
    } else {
        let by = 0.01 * Vector3::from_fn(|_, _| random.signed());
        Pose::from_quaternion(pose.translation() + by, pose.rotation().coords.into())
    };
    scene.posed(&[(slot, pose.expect("a pose"))]).expect("moved")
}

fn ask(crew: &Crew, scene: Scene, cold: bool) -> Vec<Answer> {
    let mut ask = Ask::new(vec![Measure::Distance, Measure::Growth]).expect("measures");
    ask.cold = cold;
    let operands = (0..OBJECTS as u32).map(Operand::Object).collect();
    let pairs = (1..OBJECTS as u32).map(|index| [index - 1, index]).collect();
    let pairs = Pairs::new(scene, ask, operands, pairs).expect("pairs");
    crew.ask(Arc::new(pairs), Arc::default()).expect("answers").concat()
}

fn iterations(answers: &[Answer]) -> u32 {
    answers.iter().map(|answer| answer.iterations).sum()
}

/// Two callers move the same objects, one of them without any order. The other one, which has
/// starts of its own, needs as little as if it were alone, and its answers hold.
#[test]
fn a_caller_with_starts_of_its_own_does_not_depend_on_others() {
    let (crew, scene, mut random) = (Crew::new(1).expect("a thread"), row(), Seeded(11));
    let (mut own, mut state, mut alone) = (OwnStarts::default(), scene.clone(), row());
    ask(&crew, alone.clone(), false);
    ask(&crew, own.lend(&state), false);
    let mut sums = [0; 3];
    for step in 0..200 {
        // Of somebody else, in the scene's own table.
        ask(&crew, moved(&scene, &mut random, true), false);
        let mut same = Seeded(random.0);
        (state, alone) = (moved(&state, &mut random, false), moved(&alone, &mut same, false));
        let answers = ask(&crew, own.lend(&state), false);
        let cold = ask(&crew, state.clone(), true);
        for (a, b) in answers.iter().zip(&cold) {
            assert!(a.lower <= b.upper && b.lower <= a.upper, "step {step}: {a:?} {b:?}");
        }
        let sum = [&answers, &ask(&crew, alone.clone(), false), &cold].map(|answers| iterations(answers));
        (0..3).for_each(|index| sums[index] += sum[index]);
    }
    let [with_own, undisturbed, cold] = sums;
    assert_eq!(with_own, undisturbed);
    assert!(3 * with_own < cold, "{with_own} of {cold}");
}

#[test]
fn what_is_new_to_a_caller_starts_where_others_ended() {
    let (crew, scene) = (Crew::new(1).expect("a thread"), row());
    let cold = iterations(&ask(&crew, scene.clone(), false));
    let warm = iterations(&ask(&crew, scene.clone(), false));
    assert!(warm < cold);
    let mut own = OwnStarts::default();
    assert_eq!(iterations(&ask(&crew, own.lend(&scene), false)), warm);
    // A fork is of the same scene; another scene starts cold, and so does the first one after it.
    let fork = scene.fork("fork").expect("a name");
    assert_eq!(iterations(&ask(&crew, own.lend(&fork), false)), warm);
    let other = row();
    assert_eq!(iterations(&ask(&crew, own.lend(&other), false)), cold);
    assert_eq!(iterations(&ask(&crew, own.lend(&other), false)), warm);
}
