//! What cannot be done with robots, with the entry that is wrong.

use std::collections::BTreeMap;
use std::sync::Arc;

use sublevel_core::measure::HalfSpace;
use sublevel_robot::{Semantics, read_urdf};
use sublevel_scene::{
    Attach, Attachment, Entry, FrameHolder, Geometry, JointsError, List, NamedHalfSpace, Part, Placement, Robot,
    RobotError, RobotId, SceneError, Update,
};
use sublevel_testkit::random::at;

use super::{ARM, apply, cell, place, robot, set, slot, things, values};
use crate::worlds::placement;

fn refused(update: Update) -> SceneError {
    let scene = cell(&[]);
    let error = apply(&scene, &update).expect_err("refused");
    assert_eq!(scene.revision(), 1);
    error
}

fn entry(list: List) -> Entry {
    Entry { list, index: 0, part: Part::Subject }
}

fn held_by(list: List) -> Entry {
    Entry { part: Part::Holder, ..entry(list) }
}

#[test]
fn links_are_not_changed_one_by_one() {
    let link = || Arc::<str>::from("arm/fore");
    let [ball, _] = things();
    let pose = at(0.0, 0.0, 0.0);
    let attach = |to: &str| Attach { name: link(), to: to.into(), pose: None, touch: Vec::new() };
    for (list, update) in [
        (List::Upserts, Update { upserts: vec![placement("arm/fore", &ball, pose)], ..Update::default() }),
        (List::Poses, Update { poses: vec![(link(), pose)], ..Update::default() }),
        (List::Removals, Update { removals: vec![link()], ..Update::default() }),
        (List::Attach, Update { attach: vec![attach("ball")], ..Update::default() }),
        (List::Attach, Update { attach: vec![attach("arm/fore")], ..Update::default() }),
        (List::Attach, Update { attach: vec![attach("arm/upper")], ..Update::default() }),
        (List::Detach, Update { detach: vec![link()], ..Update::default() }),
        (List::Poses, Update { poses: vec![(link(), pose)], removals: vec!["tool".into()], ..Update::default() }),
    ] {
        let error = refused(update);
        let expected = SceneError::OfRobot { at: entry(list), name: link(), robot: "arm".into() };
        assert_eq!(error, expected);
        assert!(error.to_string().contains("set the joints or the base"));
    }
    let scene = cell(&[]);
    assert!(scene.with_poses(&[(slot(&scene, "ball"), pose), (slot(&scene, "arm/fore"), pose)]).is_err());
    assert!(scene.posed(&[(slot(&scene, "arm/fore"), pose)]).is_ok(), "a question may ask what if");
}

#[test]
fn nothing_is_held_by_itself() {
    let attach = |name: &str, to: &str| {
        let attach = Attach { name: name.into(), to: to.into(), pose: Some(at(0.0, 0.0, 1.0)), touch: Vec::new() };
        Update { attach: vec![attach], ..Update::default() }
    };
    for name in ["ball", "tool"] {
        let itself = SceneError::Itself { at: held_by(List::Attach), name: name.into() };
        assert_eq!(refused(attach(name, name)), itself);
    }
    let mut both = attach("ball", "tool");
    both.attach.extend(attach("tool", "ball").attach);
    assert!(matches!(refused(both), SceneError::Circle { .. }));
    let missing = refused(attach("ball", "arm/knee"));
    assert_eq!(missing, SceneError::NoObject { at: held_by(List::Attach), name: "arm/knee".into() });
    assert_eq!(held_by(List::Attach).to_string(), "Attach[0].attachment.to");
}

#[test]
fn links_without_geometry_hold_nothing_and_name_who_can() {
    let attach = |to: &str| Attach { name: "ball".into(), to: to.into(), pose: None, touch: Vec::new() };
    let frame = |list, link: &str, robot: &str, instead| SceneError::FrameLink {
        at: held_by(list),
        link: link.into(),
        robot: robot.into(),
        instead,
    };
    let fixed = FrameHolder::Fixed("arm/upper".into());
    let error = refused(Update { attach: vec![attach("arm/elbow")], ..Update::default() });
    assert_eq!(error, frame(List::Attach, "elbow", "arm", fixed.clone()));
    let text = "link \"elbow\" of robot \"arm\" has no geometry; attach to \"arm/upper\" with the pose in its frame";
    assert_eq!(error.to_string(), text);
    // The tip slides against the wrist.
    let error = refused(Update { attach: vec![attach("arm/tip")], ..Update::default() });
    assert_eq!(error, frame(List::Attach, "tip", "arm", FrameHolder::Moving("arm/wrist".into())));
    assert!(error.to_string().contains("it moves against \"arm/wrist\""), "{error}");
    // An object that is placed where it is held, and a robot that begins with a frame.
    let attachment = Attachment { to: "arm/elbow".into(), pose: at(0.0, 0.0, 0.1), touch: Vec::new() };
    let part = placement("part", &things()[0], at(0.0, 0.0, 0.0));
    let part = Placement { pose: None, attachment: Some(attachment), ..part };
    let error = refused(Update { upserts: vec![part], ..Update::default() });
    assert_eq!(error, frame(List::Upserts, "elbow", "arm", fixed));
    let body = "<collision><geometry><box size=\"0.3 0.3 0.2\"/></geometry></collision></link>";
    let urdf = ARM.replace(&format!("<link name=\"base\">{body}"), "<link name=\"base\"/>");
    let description = read_urdf(&urdf).expect("a description");
    assert!(description.links[0].collisions.is_empty());
    let (id, bodies) = (RobotId::of(&urdf, "", []), BTreeMap::new());
    let leg = Arc::new(Robot::new(id, &description, &Semantics::default(), &bodies).expect("a robot"));
    let leg = place("leg", &leg, at(3.0, 0.0, 0.0));
    let error = refused(Update { robots: vec![leg], attach: vec![attach("leg/base")], ..Update::default() });
    assert_eq!(error, frame(List::Attach, "base", "leg", FrameHolder::None));
    assert!(error.to_string().ends_with("attach to a link with geometry"), "{error}");
}

#[test]
fn names_are_checked() {
    let arm = robot(&[]);
    let base = at(0.0, 0.0, 0.0);
    let no_robot = |list| SceneError::NoRobot { at: entry(list), name: "leg".into() };
    assert_eq!(refused(set("leg", values(&[], &[0.0; 4]))), no_robot(List::Joints));
    assert_eq!(refused(Update { bases: vec![("leg".into(), base)], ..Update::default() }), no_robot(List::Bases));
    let remove = Update { robot_removals: vec!["leg".into()], ..Update::default() };
    assert_eq!(refused(remove), no_robot(List::RobotRemovals));
    let twice = Update { robots: vec![place("arm", &arm, base)], ..set("arm", values(&[], &[0.0; 4])) };
    assert_eq!(refused(twice), SceneError::RobotTwice { at: entry(List::Joints), name: "arm".into() });
    let twice = Update { bases: vec![("arm".into(), base); 2], ..Update::default() };
    assert!(matches!(refused(twice), SceneError::RobotTwice { at: Entry { list: List::Bases, index: 1, .. }, .. }));
    let [ball, _] = things();
    let taken = Update {
        upserts: vec![placement("leg/fore", &ball, base)],
        robots: vec![place("leg", &arm, base)],
        ..Update::default()
    };
    assert!(matches!(refused(taken), SceneError::NameTaken { name, .. } if &*name == "leg/fore"));
    let long = Update { robots: vec![place(&"x".repeat(125), &arm, base)], ..Update::default() };
    assert!(matches!(refused(long), SceneError::LinkName { .. }));
    let holds = refused(Update { robot_removals: vec!["arm".into()], ..Update::default() });
    assert_eq!(holds, SceneError::Holds { name: "arm/wrist".into(), held: "tool".into() });
}

#[test]
fn joint_values_are_checked() {
    let joints = |update: Update| match refused(update) {
        SceneError::Joints { at, error } => (at.list, error),
        error => panic!("{error}"),
    };
    let (list, error) = joints(set("arm", values(&[], &[0.0; 3])));
    assert_eq!((list, error), (List::Joints, JointsError::Width { given: 3, width: 4 }));
    for (name, value) in [("knee", 0.0), ("follow", 0.0), ("bend", f64::NAN), ("bend", 3.1), ("slide", -0.01)] {
        let (_, error) = joints(set("arm", values(&[name], &[value])));
        assert!(error.to_string().contains(name), "{error}");
    }
    let mut placed = place("leg", &robot(&[]), at(0.0, 0.0, 0.0));
    placed.joints = values(&["shoulder"], &[4.0]);
    let (list, error) = joints(Update { robots: vec![placed], ..Update::default() });
    assert_eq!(list, List::Robots);
    assert!(error.to_string().contains("outside its limits -2.5 to 2.5"), "{error}");
}

#[test]
fn descriptions_that_make_no_robot_are_refused() {
    let new = |urdf: &str, bodies: &BTreeMap<Arc<str>, Geometry>| {
        let description = read_urdf(urdf).expect("a description");
        Robot::new(RobotId::of(urdf, "", []), &description, &Semantics::default(), bodies).map(|_| ())
    };
    let sphere = "<sphere radius=\"0.06\"/>";
    let mesh = ARM.replace(sphere, "<mesh filename=\"fore.stl\"/>");
    let error = new(&mesh, &BTreeMap::new()).expect_err("refused");
    let expected = RobotError::Mesh { link: "fore".into(), piece: 1, uri: "fore.stl".into() };
    assert_eq!(error, expected);
    let [ball, _] = things();
    assert_eq!(new(&mesh, &[("fore".into(), ball.clone())].into()), Ok(()), "a body stands for it");
    let unknown = new(ARM, &[("knee".into(), ball)].into()).expect_err("refused");
    assert_eq!(unknown, RobotError::NoLink { link: "knee".into(), robot: "arm".into() });
    let plane = NamedHalfSpace::new("floor", HalfSpace::new(nalgebra::Vector3::z(), 0.0).expect("a plane"));
    let plane = Geometry::HalfSpace(Arc::new(plane.expect("a name")));
    let error = new(ARM, &[("fore".into(), plane)].into()).expect_err("refused");
    assert_eq!(error, RobotError::HalfSpace { link: "fore".into() });
}
