//! Placing, moving, replacing and removing robots.

use nalgebra::{Isometry3, Translation3, Vector3};
use sublevel_core::measure::{Options, WarmStart, signed_distance};
use sublevel_scene::{Attach, Geometry, Scene, Update};
use sublevel_testkit::Seeded;
use sublevel_testkit::random::at;

use super::{apart, applied, apply, cell, place, pose, robot, robot_with, set, slot, things, values};

/// The same by hand: turns about y, about y, about z, and a shift along x.
fn by_hand(configuration: &[f64]) -> [(&'static str, Isometry3<f64>); 5] {
    let turn = |axis: Vector3<f64>, angle: f64| Isometry3::rotation(axis * angle);
    let shift = |x: f64, y: f64, z: f64| Isometry3::from(Translation3::new(x, y, z));
    let &[shoulder, bend, spin, slide] = configuration else { panic!("four joints") };
    let base = shift(1.0, 0.0, 0.0);
    let upper = base * shift(0.0, 0.0, 0.1) * turn(Vector3::y(), shoulder);
    let fore = upper * shift(0.0, 0.0, 0.5) * turn(Vector3::y(), bend);
    let wrist = fore * shift(0.0, 0.0, 0.4) * turn(Vector3::z(), spin);
    let finger = wrist * shift(0.0, 0.0, 0.12) * shift(slide, 0.0, 0.0);
    [("base", base), ("upper", upper), ("fore", fore), ("wrist", wrist), ("finger", finger)]
}

#[test]
fn links_and_what_they_hold_follow_the_joints() {
    let (mut scene, mut random) = (cell(&[]), Seeded(1));
    assert_eq!(scene.len(), 7, "five links, a ball and a tool: frames are no objects");
    for step in 0..50 {
        let named = [2.5 * random.signed(), 3.0 * random.signed(), 9.0 * random.signed(), 0.05 * random.positive()];
        let before = scene.clone();
        scene = applied(&scene, &set("arm", values(&[], &named)));
        assert!(scene.same_structure(&before) && scene.revision() == before.revision() + 1);
        for (link, expected) in by_hand(&named) {
            let found = pose(&scene, &format!("arm/{link}"));
            let off = (found.translation() - expected.translation.vector).norm()
                + found.rotation().angle_to(&expected.rotation);
            assert!(off < 1e-14, "step {step} {link}: {off:e}");
        }
        let held = by_hand(&named)[3].1 * Isometry3::from(Translation3::new(0.0, 0.0, 0.35));
        let off = (pose(&scene, "tool").translation() - held.translation.vector).norm();
        assert!(off < 1e-14, "step {step}: {off:e}");
        let moved: Vec<_> = scene.moved_since(before.revision()).collect();
        assert!(moved.contains(&slot(&scene, "arm/wrist")) && !moved.contains(&slot(&scene, "arm/base")));
        assert_eq!(scene.robot("arm").expect("there").moved_at(), scene.revision());
    }
}

#[test]
fn joints_that_are_not_named_keep_their_values_and_a_new_base_moves_everything() {
    let scene = applied(&cell(&[]), &set("arm", values(&["bend", "slide"], &[0.5, 0.03])));
    let scene = applied(&scene, &set("arm", values(&["shoulder"], &[-0.4])));
    assert_eq!(scene.robot("arm").expect("there").configuration(), [-0.4, 0.5, 0.0, 0.03]);
    let base = at(-2.0, 1.0, 0.5);
    let both = Update {
        bases: vec![("arm".into(), base)],
        joints: vec![("arm".into(), values(&["spin"], &[1.0]))],
        ..Update::default()
    };
    let next = applied(&scene, &both);
    assert!(next.same_structure(&scene));
    let instance = next.robot("arm").expect("there");
    assert_eq!((instance.base(), instance.configuration()), (&base, &[-0.4, 0.5, 1.0, 0.03][..]));
    assert!(apart(&pose(&next, "arm/base"), &base) == 0.0);
    let moved = pose(&next, "tool").translation() - pose(&scene, "tool").translation();
    assert!((moved - Vector3::new(-3.0, 1.0, 0.5)).norm() < 1e-14, "the tool is on the axis of the wrist: {moved}");
}

#[test]
fn what_a_link_lets_go_stays_where_it_is() {
    let bent = applied(&cell(&[]), &set("arm", values(&[], &[0.3, -0.4, 1.0, 0.02])));
    let there = pose(&bent, "tool");
    let wrist = |scene: &Scene| slot(scene, "arm/wrist");
    assert!(bent.is_allowed(slot(&bent, "tool"), wrist(&bent)));
    let detach = Update { detach: vec!["tool".into()], ..Update::default() };
    let free = applied(&bent, &detach);
    assert!(apart(&pose(&free, "tool"), &there) < 1e-15);
    assert!(free.object(slot(&free, "tool")).expect("there").attachment.is_none());
    assert!(!free.is_allowed(slot(&free, "tool"), wrist(&free)), "it may touch what has held it no more");
    assert_eq!(free.revision(), bent.revision() + 1);
    // The arm moves without it, and can be removed, which it cannot while it holds something.
    let home = applied(&free, &set("arm", values(&[], &[0.0; 4])));
    assert!(
        apart(&pose(&home, "tool"), &there) < 1e-15
            && apart(&pose(&home, "arm/wrist"), &pose(&free, "arm/wrist")) > 0.1
    );
    let remove = Update { robot_removals: vec!["arm".into()], ..Update::default() };
    assert!(apply(&bent, &remove).is_err());
    assert_eq!(applied(&free, &remove).len(), 2);
    // All in one update: it lets go, and the arm moves; the tool stays where it was before.
    let both = Update { detach: vec!["tool".into()], ..set("arm", values(&["shoulder"], &[-1.0])) };
    let both = applied(&bent, &both);
    assert_eq!(both.robot("arm").expect("there").configuration()[0], -1.0);
    assert!(apart(&pose(&both, "tool"), &there) < 1e-14);
    // Held again where it is, it follows.
    let again = Attach { name: "tool".into(), to: "arm/wrist".into(), pose: None, touch: Vec::new() };
    let again = applied(&free, &Update { attach: vec![again], ..Update::default() });
    assert!(apart(&pose(&again, "tool"), &there) < 1e-14);
    let moved = applied(&again, &set("arm", values(&["shoulder"], &[-1.0])));
    assert!(apart(&pose(&moved, "tool"), &there) > 0.1);
}

#[test]
fn two_robots_of_a_kind_and_forks_are_apart() {
    let (scene, arm) = (cell(&[]), robot(&[]));
    let scene =
        applied(&scene, &Update { robots: vec![place("other", &arm, at(-1.0, 0.0, 0.0))], ..Update::default() });
    assert_eq!(scene.robots().map(|robot| robot.name().to_string()).collect::<Vec<_>>(), ["arm", "other"]);
    let fork = scene.fork("what if").expect("a fork");
    let fork = applied(&fork, &set("other", values(&["bend"], &[1.0])));
    assert_eq!(scene.robot("other").expect("there").configuration()[1], 0.0);
    assert_eq!(fork.robot("arm").expect("there").configuration()[1], 0.0);
    assert_eq!(fork.committed_to(&scene).robot("other").expect("there").configuration()[1], 1.0);
    let object = scene.object(slot(&scene, "other/fore")).expect("there");
    assert_eq!(&*object.group, "other");
    assert_eq!(object.link.as_ref().map(|of| (&*of.robot, of.link)), Some(("other", 3)));
}

#[test]
fn a_robot_is_replaced_with_what_it_holds_and_removed_with_its_rules() {
    let scene = cell(&[]);
    let [ball, _] = things();
    let other = robot_with(&[], &[("elbow".into(), ball.clone()), ("wrist".into(), ball)].into());
    let before = slot(&scene, "arm/wrist");
    let replaced =
        applied(&scene, &Update { robots: vec![place("arm", &other, at(0.0, 0.0, 0.0))], ..Update::default() });
    assert_eq!((replaced.len(), slot(&replaced, "arm/wrist")), (8, before), "the elbow is more than a frame now");
    assert!((pose(&replaced, "tool").translation() - Vector3::new(0.0, 0.0, 1.35)).norm() < 1e-14);
    let remove = Update { robot_removals: vec!["arm".into()], detach: vec!["tool".into()], ..Update::default() };
    let remove = Update { detach: Vec::new(), removals: vec!["tool".into()], ..remove };
    let removed = applied(&replaced, &remove);
    assert_eq!((removed.len(), removed.robot_count()), (1, 0));
    assert!(removed.slot("arm/wrist").is_none() && removed.robot("arm").is_none());
    let again =
        applied(&removed, &Update { robots: vec![place("arm", &other, at(3.0, 0.0, 0.0))], ..Update::default() });
    assert_eq!(again.len(), 7);
}

#[test]
fn primitives_are_taken_exactly_where_their_origins_put_them() {
    let (scene, options) = (cell(&[]), Options::default());
    let [ball, _] = things();
    // A ball on the axis of the upper arm, which ends at z = 0.1 + 0.25 + 0.2.
    let shape = |geometry: &Geometry| geometry.rungs().last().cloned().expect("a solid");
    let distance = |scene: &Scene, link: &str, x: f64, z: f64| {
        let object = scene.object(slot(scene, link)).expect("there");
        let (a, b) = (shape(&object.geometry), shape(&ball));
        assert_eq!(object.geometry.gap_m(), Some(0.0));
        signed_distance(&*a, &pose(scene, link), &*b, &at(x, 0.0, z), &options, &mut WarmStart::default()).value()
    };
    for (link, x, z, expected) in [
        ("arm/base", 1.0, 0.5, 0.3),
        ("arm/upper", 1.0, 1.0, 0.35),
        ("arm/upper", 1.5, 0.3, 0.35),
        ("arm/fore", 1.5, 0.6, 0.34),
        ("arm/fore", 1.0, 0.3, 0.14),
        ("arm/fore", 1.5, 0.8, 0.36),
        ("arm/wrist", 1.52, 1.05, 0.35),
        ("arm/finger", 1.0, 1.4, 0.14),
    ] {
        let found = distance(&scene, link, x, z);
        assert!((found - expected).abs() < 1e-9, "{link} {x} {z}: {found} and not {expected}");
    }
}
