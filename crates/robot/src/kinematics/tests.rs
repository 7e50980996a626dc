use std::sync::Arc;

use nalgebra::{Isometry3, Matrix4, Translation3, Unit, UnitQuaternion, Vector3};
use sublevel_testkit::Seeded;

use super::{ConfigurationError, Kinematics, KinematicsError};
use crate::description::{Description, Joint, JointKind, Limits, Link, Mimic};

const KINDS: [JointKind; 6] = [
    JointKind::Fixed,
    JointKind::Revolute,
    JointKind::Continuous,
    JointKind::Prismatic,
    JointKind::Planar,
    JointKind::Floating,
];

fn vector(seeded: &mut Seeded) -> Vector3<f64> {
    Vector3::new(seeded.signed(), seeded.signed(), seeded.signed())
}

fn rotation(seeded: &mut Seeded) -> UnitQuaternion<f64> {
    UnitQuaternion::from_scaled_axis(vector(seeded) * 3.0)
}

/// A tree of `count` links with joints of all kinds, some of which mimic others, in an order that
/// is not that of the tree.
pub(crate) fn tree(seeded: &mut Seeded, count: usize) -> Description {
    let links = (0..count).map(|link| Link { name: format!("link{link}").into(), collisions: Vec::new() }).collect();
    let mut joints: Vec<Joint> = Vec::new();
    for child in (1..count).rev() {
        let parent = seeded.index(child);
        let kind = KINDS[seeded.index(KINDS.len())];
        let origin = Isometry3::from_parts(Translation3::from(vector(seeded)), rotation(seeded));
        let axis = Unit::new_normalize(vector(seeded) + Vector3::new(0.0, 0.0, 1e-3));
        let limits = matches!(kind, JointKind::Revolute | JointKind::Prismatic);
        let limits = limits.then_some(Limits { lower: -2.0, upper: 2.0 });
        let followed = joints.iter().position(|joint| joint.kind.width() == 1 && joint.mimic.is_none());
        let mimic = followed.filter(|_| kind.width() == 1 && seeded.index(3) == 0);
        let mimic = mimic.map(|joint| Mimic { joint, multiplier: seeded.signed() * 2.0, offset: seeded.signed() });
        joints.push(Joint { name: format!("joint{child}").into(), kind, parent, child, origin, axis, limits, mimic });
    }
    Description { name: "tree".into(), links, joints }
}

pub(crate) fn configuration(seeded: &mut Seeded, kinematics: &Kinematics) -> Vec<f64> {
    let mut values: Vec<f64> = (0..kinematics.width()).map(|_| seeded.signed() * 2.0).collect();
    for variable in kinematics.variables().iter().filter(|variable| variable.kind == JointKind::Floating) {
        let own = &mut values[variable.first + 3..variable.first + 7];
        let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
        own.iter_mut().for_each(|x| *x /= length);
    }
    values
}

/// The same by homogeneous matrices and the exponential of a cross product (Rodrigues).
fn by_matrices(
    description: &Description,
    kinematics: &Kinematics,
    values: &[f64],
    base: &Isometry3<f64>,
    link: usize,
) -> Matrix4<f64> {
    let Some(joint) = description.joints.iter().find(|joint| joint.child == link) else { return base.to_homogeneous() };
    let source = joint.mimic.map_or(joint, |mimic| &description.joints[mimic.joint]);
    let first = kinematics.variable(&source.name).map_or(0, |variable| kinematics.variables()[variable].first);
    let value = || joint.mimic.map_or(values[first], |mimic| mimic.multiplier * values[first] + mimic.offset);
    let turn = |angle: f64| {
        let k = joint.axis.cross_matrix();
        (nalgebra::Matrix3::identity() + k * angle.sin() + k * k * (1.0 - angle.cos())).to_homogeneous()
    };
    let shift = |by: Vector3<f64>| Matrix4::new_translation(&by);
    let local = match joint.kind {
        JointKind::Fixed => Matrix4::identity(),
        JointKind::Revolute | JointKind::Continuous => turn(value()),
        JointKind::Prismatic => shift(*joint.axis * value()),
        JointKind::Planar => {
            let [one, two] = kinematics.joints.iter().find(|own| own.name == joint.name).expect("the joint").across;
            shift(one * values[first] + two * values[first + 1]) * turn(values[first + 2])
        }
        JointKind::Floating => {
            let [x, y, z, w] = [3, 4, 5, 6].map(|value| values[first + value]);
            let q = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
            shift(Vector3::new(values[first], values[first + 1], values[first + 2])) * q.to_homogeneous()
        }
    };
    by_matrices(description, kinematics, values, base, joint.parent) * joint.origin.to_homogeneous() * local
}

#[test]
fn poses_are_products_of_matrices_within_the_bound() {
    let mut joints = [0; 6];
    let mut mimics = 0;
    for seed in 0..300 {
        let mut seeded = Seeded(seed);
        let description = tree(&mut seeded, 12);
        let kinematics = Kinematics::new(&description).expect("a tree");
        let values = configuration(&mut seeded, &kinematics);
        kinematics.check(&values).expect("a configuration");
        let base = Isometry3::from_parts(Translation3::from(vector(&mut seeded)), rotation(&mut seeded));
        let mut poses = Vec::new();
        kinematics.forward(&base, &values, &mut poses);
        let mut errors = Vec::new();
        kinematics.forward_errors(&poses, &values, &mut errors);
        for link in 0..description.links.len() {
            let place = kinematics.link(&format!("link{link}")).expect("the link");
            let point = vector(&mut seeded);
            let expected = by_matrices(&description, &kinematics, &values, &base, link).transform_point(&point.into());
            let error = ((poses[place] * nalgebra::Point3::from(point)) - expected).norm();
            let bound = errors[place].within_m(point.norm());
            // The matrices are rounded, too; the bound covers both, since it counts twice.
            assert!(error <= bound + 1e-15, "seed {seed}, link {link}: {error:e} > {bound:e}");
            assert!(bound < 1e-11, "seed {seed}: {bound:e}");
        }
        for joint in &description.joints {
            joints[KINDS.iter().position(|kind| *kind == joint.kind).expect("a kind")] += 1;
            mimics += usize::from(joint.mimic.is_some());
        }
    }
    assert!(joints.iter().all(|&count| count > 300) && mimics > 100, "{joints:?}, {mimics} mimics");
}

#[test]
fn the_jacobian_is_the_derivative() {
    for seed in 0..200 {
        let mut seeded = Seeded(seed);
        let description = tree(&mut seeded, 9);
        let kinematics = Kinematics::new(&description).expect("a tree");
        let values = configuration(&mut seeded, &kinematics);
        let base = Isometry3::from_parts(Translation3::from(vector(&mut seeded)), rotation(&mut seeded));
        let (mut poses, mut ahead, mut behind) = (Vec::new(), Vec::new(), Vec::new());
        kinematics.forward(&base, &values, &mut poses);
        for (link, pose) in poses.iter().enumerate() {
            let local = vector(&mut seeded);
            let point = (pose * nalgebra::Point3::from(local)).coords;
            let columns = kinematics.jacobian(&poses, &values, link, &point);
            let (linear, angular) = (vector(&mut seeded), vector(&mut seeded));
            let mut row = vec![0.0; kinematics.width()];
            kinematics.add_gradient(&poses, &values, (link, &point), (&linear, &angular), &mut row);
            for (value, (v, w)) in columns.iter().enumerate() {
                let step = 1e-6;
                let (mut more, mut less) = (values.clone(), values.clone());
                more[value] += step;
                less[value] -= step;
                kinematics.forward(&base, &more, &mut ahead);
                kinematics.forward(&base, &less, &mut behind);
                let at = |pose: &Isometry3<f64>| (pose * nalgebra::Point3::from(local)).coords;
                let expected = (at(&ahead[link]) - at(&behind[link])) / (2.0 * step);
                assert!((expected - v).norm() < 1e-8, "seed {seed}, link {link}, value {value}: {expected} {v}");
                let turn = ahead[link].rotation * behind[link].rotation.inverse();
                let expected = turn.scaled_axis() / (2.0 * step);
                assert!((expected - w).norm() < 1e-8, "seed {seed}, link {link}, value {value}: {expected} {w}");
                let expected = linear.dot(v) + angular.dot(w);
                assert!((row[value] - expected).abs() < 1e-12, "seed {seed}: {} {expected}", row[value]);
            }
        }
    }
}

#[test]
fn what_is_no_tree_is_refused() {
    let mut description = tree(&mut Seeded(1), 5);
    description.joints.iter_mut().for_each(|joint| joint.mimic = None);
    let broken = |change: &dyn Fn(&mut Description)| {
        let mut description = description.clone();
        change(&mut description);
        Kinematics::new(&description).map(|_| ()).expect_err("no tree")
    };
    let joint = |index: usize| description.joints[index].name.clone();
    assert_eq!(broken(&|d| d.links.clear()), KinematicsError::Position(joint(0)));
    assert_eq!(broken(&|d| (d.links.clear(), d.joints.clear()).0), KinematicsError::NoLink("tree".into()));
    assert_eq!(broken(&|d| d.joints[0].child = 1), KinematicsError::TwoParents("link1".into()));
    let cut = broken(&|d| drop(d.joints.remove(0)));
    assert_eq!(cut, KinematicsError::NotConnected { root: "link0".into(), link: "link4".into() });
    let ring = |d: &mut Description| {
        d.joints[0].parent = 4;
    };
    assert_eq!(broken(&ring), KinematicsError::NotConnected { root: "link0".into(), link: "link4".into() });
    let circle = |d: &mut Description| {
        let mut closing = d.joints[0].clone();
        (closing.parent, closing.child, closing.name) = (4, 0, "closing".into());
        d.joints.push(closing);
    };
    assert_eq!(broken(&circle), KinematicsError::NoRoot("tree".into()));
    let chained = |d: &mut Description| {
        for joint in &mut d.joints[..2] {
            joint.kind = JointKind::Revolute;
            joint.mimic = Some(Mimic { joint: 0, multiplier: 1.0, offset: 0.0 });
        }
    };
    assert_eq!(broken(&chained), KinematicsError::Mimic(joint(0)));
}

#[test]
fn values_are_checked_by_name() {
    let link = |name: &str| Link { name: name.into(), collisions: Vec::new() };
    let joint = |name: &str, kind: JointKind, child: usize, limits: Option<Limits>| Joint {
        name: name.into(),
        kind,
        parent: child - 1,
        child,
        origin: Isometry3::identity(),
        axis: Vector3::z_axis(),
        limits,
        mimic: None,
    };
    let description = Description {
        name: "robot".into(),
        links: ["base", "lift", "wheel", "free", "finger"].map(link).into(),
        joints: vec![
            joint("lift", JointKind::Prismatic, 1, Some(Limits { lower: 0.5, upper: 1.5 })),
            joint("wheel", JointKind::Continuous, 2, Some(Limits { lower: 0.0, upper: 0.0 })),
            joint("free", JointKind::Floating, 3, None),
            Joint {
                mimic: Some(Mimic { joint: 0, multiplier: 2.0, offset: 0.0 }),
                ..joint("finger", JointKind::Prismatic, 4, Some(Limits { lower: 0.0, upper: 0.0 }))
            },
        ],
    };
    let kinematics = Kinematics::new(&description).expect("a tree");
    let defaults = kinematics.default_configuration();
    assert_eq!(defaults, [0.5, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    assert_eq!(kinematics.check(&defaults), Ok(()));
    let name = |name: &str| -> Arc<str> { name.into() };
    let with = |value: usize, number: f64| {
        let mut values = defaults.clone();
        values[value] = number;
        kinematics.check(&values)
    };
    assert_eq!(with(1, 1e3), Ok(()));
    assert_eq!(with(0, 1.5 + 1e-12), Ok(()));
    let beyond = ConfigurationError::Limits { joint: name("lift"), value: 1.51, lower: 0.5, upper: 1.5 };
    assert_eq!(with(0, 1.51), Err(beyond));
    // The finger follows to twice as far, beyond the limits of its own, which do not count.
    let finger = &kinematics.joints[3];
    assert_eq!((finger.value(&defaults), with(0, 1.5)), (1.0, Ok(())));
    assert_eq!(
        with(3, f64::INFINITY),
        Err(ConfigurationError::NotFinite { joint: name("free"), value: f64::INFINITY })
    );
    assert!(matches!(with(1, f64::NAN), Err(ConfigurationError::NotFinite { .. })));
    assert_eq!(with(8, 2.0), Err(ConfigurationError::NotUnit { joint: name("free"), length: 2.0 }));
    assert_eq!(kinematics.check(&defaults[1..]), Err(ConfigurationError::Width { given: 8, width: 9 }));
    assert_eq!((kinematics.link("wheel"), kinematics.parent(2), kinematics.parent(0)), (Some(2), Some(1), None));
}

#[test]
fn the_reach_of_followers_is_that_of_what_they_follow() {
    let link = |name: &str| Link { name: name.into(), collisions: Vec::new() };
    let joint = |name: &str, kind: JointKind, child: usize, mimic: Option<Mimic>| Joint {
        name: name.into(),
        kind,
        parent: child - 1,
        child,
        origin: Isometry3::translation(1.0, 0.0, 0.0),
        axis: Vector3::z_axis(),
        limits: None,
        mimic,
    };
    let reach_m = |multiplier: f64| {
        let follows = Some(Mimic { joint: 0, multiplier, offset: -0.5 });
        let joints =
            vec![joint("wheel", JointKind::Continuous, 1, None), joint("slide", JointKind::Prismatic, 2, follows)];
        let links = ["base", "wheel", "slide"].map(link).into();
        Kinematics::new(&Description { name: "robot".into(), links, joints }).expect("a tree").reach_m()
    };
    // Two origins 1 m from those before, and a slide that stays 0.5 m from its place or has no end.
    assert_eq!((reach_m(0.0), reach_m(0.1)), (2.5, f64::INFINITY));
}
