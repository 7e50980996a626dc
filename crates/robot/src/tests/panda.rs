//! The Franka Panda arm of the test data.

use sublevel_testkit::data;

use crate::{Description, Geometry, JointKind, MeshPaths, read_srdf, read_urdf};

fn text(path: &str) -> String {
    std::fs::read_to_string(data(path)).expect("a file of the test data")
}

fn panda() -> Description {
    read_urdf(&text("panda/panda.urdf")).expect("a robot")
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_arm_is_read() {
    let robot = panda();
    assert_eq!((&*robot.name, robot.links.len(), robot.joints.len()), ("panda", 13, 12));
    let arm: Vec<_> = robot.joints.iter().filter(|joint| joint.kind == JointKind::Revolute).collect();
    let names: Vec<_> = arm.iter().map(|joint| joint.name.to_string()).collect();
    let expected: Vec<_> = (1..=7).map(|number| format!("panda_joint{number}")).collect();
    assert_eq!(names, expected);
    let limits: Vec<_> = arm.iter().filter_map(|joint| joint.limits).map(|limits| limits.upper).collect();
    assert_eq!(limits, [2.9671, 1.8326, 2.9671, 0.0873, 2.9671, 3.8223, 2.9671]);
    let fingers: Vec<_> = robot.joints.iter().filter(|joint| joint.name.contains("finger")).collect();
    assert_eq!(fingers.len(), 2);
    assert!(fingers.iter().all(|joint| joint.kind == JointKind::Fixed && joint.mimic.is_none()));
    let bodies = robot.links.iter().filter(|link| !link.collisions.is_empty()).count();
    assert_eq!(bodies, 11);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn its_meshes_are_found_beside_it() {
    let paths = MeshPaths::new(data("panda"));
    for collision in panda().links.iter().flat_map(|link| &link.collisions) {
        let Geometry::Mesh { uri, .. } = &collision.geometry else { panic!("a mesh") };
        let path = paths.resolve(uri).expect("a file");
        assert!(path.starts_with(data("panda/meshes/collision")), "{}", path.display());
    }
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn its_semantics_are_read() {
    let robot = panda();
    let semantics = read_srdf(&text("panda/panda.srdf"), &robot).expect("semantics");
    assert_eq!(semantics.disabled_pairs.len(), 34);
    let groups: Vec<_> = semantics.groups.iter().map(|group| &*group.name).collect();
    assert_eq!(groups, ["panda_arm", "hand", "panda_arm_hand"]);
    assert_eq!((semantics.groups[0].joints.len(), semantics.groups[0].links.len()), (8, 9));
    let states: Vec<_> = semantics.states.iter().map(|state| (&*state.name, state.values.len())).collect();
    assert_eq!(states, [("ready", 7), ("extended", 7), ("transport", 7), ("open", 0), ("close", 0)]);
    // The fingers of this file are fixed, and its states move them.
    assert_eq!(semantics.warnings.len(), 4, "{:?}", semantics.warnings);
    assert_eq!(semantics.end_effectors.len(), 1);
    assert_eq!(semantics.virtual_joints.len(), 1);
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_arm_of_spheres_is_read() {
    let robot = read_urdf(&text("panda/panda_spherized.urdf")).expect("a robot");
    let shapes = robot.links.iter().flat_map(|link| &link.collisions);
    let spheres = shapes.filter(|collision| matches!(collision.geometry, Geometry::Sphere { .. })).count();
    assert_eq!(spheres, 59);
}
