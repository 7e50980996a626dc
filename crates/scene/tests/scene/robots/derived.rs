//! Pairs of links that can touch at all.

use std::ops::ControlFlow;

use sublevel_core::measure::Pose;
use sublevel_robot::motion::{DeriveOptions, PairClass};
use sublevel_scene::query::{JointValues, StateVerdict, States};
use sublevel_scene::{Crew, DerivedLinks, Scene, Update};
use sublevel_testkit::Seeded;

use super::{applied, place, robot};

#[test]
fn classes_of_links_agree_with_random_states() {
    let robot = robot(&[("base", "finger")]);
    let options = DeriveOptions { max_boxes: 20_000, ..DeriveOptions::default() };
    let mut said = Vec::new();
    let derived = robot
        .derive_pairs(0.0, &options, &mut |at| {
            said.push((at.done, at.pairs));
            ControlFlow::Continue(())
        })
        .expect("a problem");
    // Five links with geometry.
    assert_eq!(derived.len(), 10);
    assert!(said.is_sorted() && said.last() == Some(&(9, 10)), "{:?}", said.last());
    let name = |link: usize| robot.kinematics().links()[link].to_string();
    let class = |a: &str, b: &str| {
        let is_pair = |pair: &&DerivedLinks| pair.links.map(name) == [a, b];
        derived.iter().find(is_pair).expect("a pair").pair.class
    };
    assert_eq!(class("base", "upper"), PairClass::Adjacent);
    assert_eq!(class("upper", "fore"), PairClass::Adjacent, "a frame lies between");
    assert_eq!(class("wrist", "finger"), PairClass::Adjacent);
    // The fore arm folds back onto the base, and the wrist onto the upper arm.
    assert_eq!(class("base", "fore"), PairClass::Collides);
    assert_eq!(class("upper", "wrist"), PairClass::Collides);
    assert_eq!(class("fore", "finger"), PairClass::Never);
    // Primitives are the links themselves.
    let collides = |pair: &&DerivedLinks| pair.pair.class == PairClass::Collides;
    assert!(derived.iter().filter(collides).all(|pair| pair.is_certain && pair.pair.upper_m < 0.0));
    // Held against states with self-collision, of which the scene allows none but neighbours.
    let update = Update { robots: vec![place("arm", &super::robot(&[]), Pose::identity())], ..Update::default() };
    let scene = applied(&Scene::new("cell", 0).expect("a name"), &update);
    let (mut random, mut values) = (Seeded(3), Vec::new());
    for _ in 0..3000 {
        values.extend([2.5 * random.signed(), 3.0 * random.signed(), 9.0 * random.signed(), 0.05 * random.positive()]);
    }
    for pair in derived.iter().filter(collides) {
        values.extend(pair.pair.witness.as_ref().expect("a witness"));
    }
    let states = States::of_joints(scene.clone(), JointValues { robot: "arm", joints: &[], values }, 0.0, false)
        .expect("states");
    let answers = Crew::new(2).expect("threads").ask(std::sync::Arc::new(states), Default::default());
    let answers = answers.expect("answered").concat();
    let witnessed = derived.iter().filter(collides).count();
    assert!(answers[3000..].iter().all(|answer| answer.verdict == StateVerdict::Contact), "{witnessed} witnesses");
    let mut contacts = 0;
    for answer in answers.iter().filter(|answer| answer.verdict == StateVerdict::Contact) {
        let names = answer.pair.expect("a pair").map(|slot| scene.object(slot).expect("there").name.to_string());
        let [a, b] = names.map(|name| name.trim_start_matches("arm/").to_owned());
        let is_pair = |pair: &&DerivedLinks| {
            let links = pair.links.map(name);
            links == [a.clone(), b.clone()] || links == [b.clone(), a.clone()]
        };
        let class = derived.iter().find(is_pair).expect("a pair").pair.class;
        assert_eq!(class, PairClass::Collides, "{a} {b}");
        contacts += 1;
    }
    assert!(contacts > 100, "{contacts}");
}
