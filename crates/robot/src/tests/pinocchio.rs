//! Poses and Jacobians against those of pinocchio, on the same descriptions. `pinocchio.py` writes
//! the values, and says how its conventions differ from those here.

use std::collections::BTreeMap;

use nalgebra::{Isometry3, Matrix3, Vector3};
use serde::Deserialize;

use super::robots::{mobile_manipulator, six_axis_arm};
use crate::{JointKind, Kinematics, read_urdf};

#[derive(Deserialize)]
struct Reference {
    /// Descriptions by the names of robots that are only here.
    trees: BTreeMap<String, String>,
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    robot: String,
    link: String,
    /// By joint, metres and radians; a joint of several values has as many entries in a row.
    values: Vec<(String, f64)>,
    /// Row by row.
    rotation: [f64; 9],
    translation: [f64; 3],
    /// By value, in the order of the values: velocity of the origin of the link, angular velocity;
    /// world frame.
    jacobian: Vec<(String, f64, f64, f64, f64, f64, f64)>,
}

fn reference() -> Reference {
    serde_json::from_str(include_str!("pinocchio.json")).expect("reference values")
}

/// Positions of the values of a case in a configuration, which they have to fill.
fn places(kinematics: &Kinematics, case: &Case) -> Vec<usize> {
    let mut places: Vec<usize> = Vec::new();
    let mut before = "";
    for (joint, _) in &case.values {
        let next = places.last().filter(|_| joint == before).map(|place| place + 1);
        places.push(next.unwrap_or_else(|| {
            let variable = kinematics.variable(joint).unwrap_or_else(|| panic!("{} has no joint {joint}", case.robot));
            kinematics.variables()[variable].first
        }));
        before = joint;
    }
    let mut sorted = places.clone();
    sorted.sort_unstable();
    assert!(sorted.into_iter().eq(0..kinematics.width()), "{}: values at {places:?}", case.robot);
    places
}

/// Compares all cases of a robot; returns how many there are.
fn compare(robot: &str, urdf: &str) -> usize {
    let kinematics = Kinematics::new(&read_urdf(urdf).expect("a description")).expect("a tree");
    let cases: Vec<Case> = reference().cases.into_iter().filter(|case| case.robot == robot).collect();
    for case in &cases {
        let places = places(&kinematics, case);
        let mut configuration = vec![0.0; kinematics.width()];
        for (place, (_, value)) in places.iter().zip(&case.values) {
            configuration[*place] = *value;
        }
        kinematics.check(&configuration).unwrap_or_else(|error| panic!("{robot}: {error}"));
        let mut poses = Vec::new();
        kinematics.forward(&Isometry3::identity(), &configuration, &mut poses);
        let link = kinematics.link(&case.link).expect("the link");
        let pose = &poses[link];
        let error = (pose.translation.vector - Vector3::from(case.translation)).norm();
        assert!(error < 1e-12, "{robot}, {}: position off by {error:e} m", case.link);
        let rotation = Matrix3::from_row_slice(&case.rotation);
        let error = (pose.rotation.to_rotation_matrix().matrix() - rotation).norm();
        assert!(error < 1e-12, "{robot}, {}: rotation off by {error:e}", case.link);
        let columns = kinematics.jacobian(&poses, &configuration, link, &pose.translation.vector);
        assert_eq!(case.jacobian.len(), kinematics.width(), "{robot}");
        for ((place, (valued, _)), (joint, x, y, z, i, j, k)) in places.iter().zip(&case.values).zip(&case.jacobian) {
            assert_eq!(valued, joint, "{robot}, {}", case.link);
            let (linear, angular) = columns[*place];
            let error = (linear - Vector3::new(*x, *y, *z)).norm() + (angular - Vector3::new(*i, *j, *k)).norm();
            assert!(error < 1e-12, "{robot}, {}, {joint}: Jacobian off by {error:e}", case.link);
        }
    }
    cases.len()
}

#[test]
fn generated_robots_agree_with_pinocchio() {
    assert_eq!(compare("six_axis", &six_axis_arm()), 8);
    assert_eq!(compare("mobile", &mobile_manipulator()), 12);
}

/// Joints of all kinds, most with oblique axes; two of each tree follow others with a factor and an
/// offset.
#[test]
fn trees_agree_with_pinocchio() {
    use JointKind::{Continuous, Fixed, Floating, Planar, Prismatic, Revolute};
    let mut compared = 0;
    for (robot, urdf) in &reference().trees {
        let description = read_urdf(urdf).expect("a description");
        let of_kind = |kind: JointKind| description.joints.iter().filter(|joint| joint.kind == kind).count();
        let counts = [Fixed, Revolute, Continuous, Prismatic, Planar, Floating].map(of_kind);
        assert_eq!(counts, [1, 1, 2, 2, 1, 1], "{robot}");
        let followers = description.joints.iter().filter(|joint| joint.mimic.is_some()).count();
        assert_eq!(followers, 2, "{robot}");
        compared += compare(robot, urdf);
    }
    assert_eq!((reference().trees.len(), compared), (4, 30));
}

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_panda_agrees_with_pinocchio() {
    let path = sublevel_testkit::data("panda/panda.urdf");
    assert_eq!(compare("panda", &std::fs::read_to_string(path).expect("the description")), 12);
}
