#![no_main]

mod described;

use std::collections::{BTreeMap, HashMap, HashSet};
use std::path::{Component, Path};

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion, Vector3};
use sublevel::robot::{Description, Geometry, Joint, JointKind, Kinematics, MeshPaths, Semantics, read_urdf};
use sublevel::scene::{Robot, RobotError, RobotId};

/// Largest size and distance that is read, metres; values of joints up to it are looked at.
const MOST: f64 = 1e6;

/// A package of this name and folder is where meshes are looked for.
const PACKAGE: (&str, &str) = ("fuzz", env!("CARGO_MANIFEST_DIR"));

// A URDF: refused with a reason, or numbers within their limits and one tree. Its links stand where
// the joints put them one after the other, and with bodies for its meshes it is a robot.
libfuzzer_sys::fuzz_target!(|text: &str| {
    let description = match read_urdf(text) {
        Ok(description) => description,
        Err(error) => return described::check_error(text, &error),
    };
    check_links(&description);
    check_joints(&description);
    let kinematics = Kinematics::new(&description).expect("links and joints are one tree");
    check_order(&description, &kinematics);
    let defaults = kinematics.default_configuration();
    for values in [others(&kinematics, &defaults), defaults] {
        assert_eq!(kinematics.check(&values), Ok(()));
        check_places(&description, &kinematics, &values);
    }
    check_robot(text, &description, &kinematics);
});

fn check_links(description: &Description) {
    let names: HashSet<_> = description.links.iter().map(|link| &link.name).collect();
    assert_eq!(names.len(), description.links.len());
    let is_size = |size: f64| size > 0.0 && size <= MOST;
    for piece in description.links.iter().flat_map(|link| &link.collisions) {
        check_origin(&piece.origin);
        match &piece.geometry {
            Geometry::Box { sides_m } => assert!(sides_m.iter().all(|side| is_size(*side))),
            Geometry::Sphere { radius_m } => assert!(is_size(*radius_m)),
            Geometry::Cylinder { radius_m, length_m } | Geometry::Capsule { radius_m, length_m } => {
                assert!(is_size(*radius_m) && is_size(*length_m));
            }
            Geometry::Mesh { uri, scale } => {
                assert!(scale.iter().all(|factor| (1e-9..=1e9).contains(&factor.abs())));
                check_mesh(uri);
            }
        }
    }
}

fn check_origin(origin: &Isometry3<f64>) {
    assert!(origin.translation.vector.iter().all(|metres| metres.abs() <= MOST), "{origin}");
    assert!((origin.rotation.into_inner().norm() - 1.0).abs() < 1e-12, "{origin}");
}

/// A mesh is a file that is there, of a package inside its folder, or the error names it.
fn check_mesh(uri: &str) {
    let (name, folder) = PACKAGE;
    match MeshPaths::new(folder).with_package(name, folder).resolve(uri) {
        Ok(path) => {
            assert!(path.is_file(), "{uri}");
            let is_inside =
                path.starts_with(Path::new(folder)) && !path.components().any(|part| part == Component::ParentDir);
            assert!(is_inside || !uri.starts_with("package://"), "{uri}: {}", path.display());
        }
        Err(error) => assert!(error.uri == uri && !error.problem.is_empty() && !error.remedy.is_empty(), "{error}"),
    }
}

/// Joints are one tree of the links; limits and what is followed are numbers of the right kinds.
fn check_joints(description: &Description) {
    let Description { links, joints, .. } = description;
    let names: HashSet<_> = joints.iter().map(|joint| &joint.name).collect();
    let children: HashSet<_> = joints.iter().map(|joint| joint.child).collect();
    assert_eq!((names.len(), children.len(), links.len()), (joints.len(), joints.len(), joints.len() + 1));
    for joint in joints {
        assert!(joint.parent < links.len() && joint.child < links.len());
        check_origin(&joint.origin);
        assert!((joint.axis.into_inner().norm() - 1.0).abs() < 1e-12, "{joint:?}");
        let has_limits = matches!(joint.kind, JointKind::Revolute | JointKind::Prismatic);
        assert_eq!(joint.limits.is_some(), has_limits, "{joint:?}");
        if let Some(limits) = joint.limits {
            assert!(limits.lower.is_finite() && limits.upper.is_finite() && limits.lower <= limits.upper, "{joint:?}");
        }
        if let Some(mimic) = joint.mimic {
            let followed = &joints[mimic.joint];
            assert!(joint.kind.width() == 1 && followed.kind.width() == 1 && followed.mimic.is_none(), "{joint:?}");
            assert!(mimic.multiplier.is_finite() && mimic.offset.is_finite(), "{joint:?}");
        }
    }
}

/// Parents come before their children, and values of joints one after the other.
fn check_order(description: &Description, kinematics: &Kinematics) {
    assert_eq!(kinematics.links().len(), description.links.len());
    for (place, name) in kinematics.links().iter().enumerate() {
        assert_eq!(kinematics.link(name), Some(place));
        assert!(kinematics.parent(place).map_or(place == 0, |parent| parent < place), "{name}");
    }
    let mut first = 0;
    for variable in kinematics.variables() {
        assert_eq!(variable.first, first, "{variable:?}");
        first += variable.kind.width();
    }
    assert_eq!(kinematics.width(), first);
    let own = description.joints.iter().filter(|joint| joint.mimic.is_none() && joint.kind.width() > 0);
    assert!(own.map(|joint| &joint.name).eq(kinematics.variables().iter().map(|variable| &variable.name)));
}

/// Values within the limits that are not the defaults. Joints in planes only turn: which directions
/// their other two values take is theirs to choose.
fn others(kinematics: &Kinematics, defaults: &[f64]) -> Vec<f64> {
    let mut values = defaults.to_vec();
    for variable in kinematics.variables() {
        let own = &mut values[variable.first..variable.first + variable.kind.width()];
        match (variable.kind, variable.limits) {
            (JointKind::Planar, _) => own[2] = 0.7,
            (JointKind::Floating, _) => own.copy_from_slice(&[0.1, -0.2, 0.3, 0.5, -0.5, 0.5, 0.5]),
            (_, Some(limits)) => own[0] = 0.7 * limits.lower + 0.3 * limits.upper,
            _ => own[0] = 1.0,
        }
    }
    values
}

/// Links are where their joints put them, one pose after the other, and within reach of the root.
fn check_places(description: &Description, kinematics: &Kinematics, values: &[f64]) {
    let above: HashMap<_, _> =
        description.joints.iter().map(|joint| (&description.links[joint.child].name, joint)).collect();
    let base = Isometry3::new(Vector3::new(0.3, -0.2, 0.5), Vector3::new(0.1, 0.2, 0.3));
    let (mut expected, mut size_m) = (vec![base], 1.0);
    for (place, name) in kinematics.links().iter().enumerate().skip(1) {
        let joint = above[name];
        let own = own_values(description, kinematics, joint, values);
        if own.iter().any(|value| value.abs() > MOST) {
            // No robot slides so far, and poses overflow.
            return;
        }
        let parent = kinematics.link(&description.links[joint.parent].name).expect("a link");
        assert_eq!(kinematics.parent(place), Some(parent));
        let local = joint.origin * motion(joint, &own);
        size_m += local.translation.vector.norm();
        expected.push(expected[parent] * local);
    }
    let mut poses = Vec::new();
    kinematics.forward(&base, values, &mut poses);
    assert_eq!(poses.len(), expected.len());
    let reach_m = kinematics.reach_m();
    for (pose, expected) in poses.iter().zip(&expected) {
        let [way, from_root] = [expected, &base].map(|from| (pose.translation.vector - from.translation.vector).norm());
        let turn = (pose.rotation.into_inner() - expected.rotation.into_inner()).norm();
        assert!(way <= 1e-12 * size_m && turn <= 1e-12, "{pose} {expected}");
        assert!(from_root <= reach_m + 1e-12 * size_m, "{pose} {reach_m}");
    }
}

/// The values that a joint has, which may be those of another one.
fn own_values(description: &Description, kinematics: &Kinematics, joint: &Joint, values: &[f64]) -> Vec<f64> {
    let first = |name: &str| kinematics.variables()[kinematics.variable(name).expect("a variable")].first;
    match joint.mimic {
        Some(mimic) => {
            vec![mimic.multiplier * values[first(&description.joints[mimic.joint].name)] + mimic.offset]
        }
        None if joint.kind == JointKind::Fixed => Vec::new(),
        None => values[first(&joint.name)..][..joint.kind.width()].to_vec(),
    }
}

/// What a joint does with these values.
fn motion(joint: &Joint, values: &[f64]) -> Isometry3<f64> {
    let at = |rotation: UnitQuaternion<f64>| Isometry3::from_parts(Translation3::identity(), rotation);
    let turn = |angle: f64| at(UnitQuaternion::from_axis_angle(&joint.axis, angle));
    match (joint.kind, values) {
        (JointKind::Revolute | JointKind::Continuous, &[angle]) | (JointKind::Planar, &[_, _, angle]) => turn(angle),
        (JointKind::Prismatic, &[metres]) => Translation3::from(joint.axis.into_inner() * metres).into(),
        (JointKind::Floating, &[x, y, z, i, j, k, w]) => {
            Translation3::new(x, y, z) * at(UnitQuaternion::new_normalize(Quaternion::new(w, i, j, k)))
        }
        _ => Isometry3::identity(),
    }
}

/// With a body for every mesh it is a robot, or a link says which primitive no body can be.
fn check_robot(text: &str, description: &Description, kinematics: &Kinematics) {
    let (bodies, semantics) = (described::bodies(description), Semantics::default());
    let id = RobotId::of(text, "", bodies.iter().map(|(link, body)| (&**link, body.id())));
    if !bodies.is_empty() {
        let without = Robot::new(id, description, &semantics, &BTreeMap::new());
        assert!(matches!(without, Err(RobotError::Mesh { .. } | RobotError::Primitive { .. })));
    }
    let robot = match Robot::new(id, description, &semantics, &bodies) {
        Ok(robot) => robot,
        Err(RobotError::Primitive { link, piece, .. }) => {
            let of = description.links.iter().find(|of| of.name == link).expect("a link");
            assert!(!described::has_mesh(of) && piece < of.collisions.len());
            return;
        }
        Err(error) => panic!("{error}"),
    };
    assert_eq!(robot.links().len(), description.links.len());
    for link in &description.links {
        let place = kinematics.link(&link.name).expect("a link");
        let geometry = robot.links()[place].as_ref().map(|of| &of.geometry);
        assert_eq!(geometry.is_some(), !link.collisions.is_empty(), "{}", link.name);
        let Some(geometry) = geometry else { continue };
        let bounds = geometry.bounding_box().expect("links have an end");
        // The middle of every primitive is inside.
        for piece in link.collisions.iter().filter(|_| !described::has_mesh(link)) {
            for axis in 0..3 {
                let middle = piece.origin.translation.vector[axis];
                let slack = 1e-12 * piece.origin.translation.vector.amax();
                let is_inside = bounds.min[axis] - slack <= middle && middle <= bounds.max[axis] + slack;
                assert!(is_inside, "{}: {bounds:?}", link.name);
            }
        }
        if let Some(parent) = kinematics.parent(place).filter(|&parent| robot.links()[parent].is_some()) {
            assert!(robot.may_touch(place, parent) && robot.may_touch(parent, place), "{}", link.name);
        }
    }
}
