//! Poses and Jacobians against those of pinocchio, on the same descriptions.

use nalgebra::{Isometry3, Matrix3, Vector3};
use serde::Deserialize;

use super::robots::{mobile_manipulator, six_axis_arm};
use crate::{Kinematics, read_urdf};

#[derive(Deserialize)]
struct Reference {
    cases: Vec<Case>,
}

#[derive(Deserialize)]
struct Case {
    robot: String,
    link: String,
    values: Vec<(String, f64)>,
    /// Row by row.
    rotation: [f64; 9],
    translation: [f64; 3],
    /// By joint: velocity of the origin of the link, angular velocity; world frame.
    jacobian: Vec<(String, f64, f64, f64, f64, f64, f64)>,
}

/// Compares all cases of a robot; returns how many there are.
fn compare(robot: &str, urdf: &str) -> usize {
    let reference: Reference = serde_json::from_str(include_str!("pinocchio.json")).expect("reference values");
    let kinematics = Kinematics::new(&read_urdf(urdf).expect("a description")).expect("a tree");
    let cases: Vec<Case> = reference.cases.into_iter().filter(|case| case.robot == robot).collect();
    for case in &cases {
        let first = |joint: &str| {
            let variable = kinematics.variable(joint).unwrap_or_else(|| panic!("{robot} has no joint {joint}"));
            kinematics.variables()[variable].first
        };
        let mut configuration = kinematics.default_configuration();
        for (joint, value) in &case.values {
            configuration[first(joint)] = *value;
        }
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
        for (joint, x, y, z, i, j, k) in &case.jacobian {
            let (linear, angular) = columns[first(joint)];
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

#[test]
#[ignore = "needs SUBLEVEL_DATA"]
fn the_panda_agrees_with_pinocchio() {
    let path = sublevel_testkit::data("panda/panda.urdf");
    assert_eq!(compare("panda", &std::fs::read_to_string(path).expect("the description")), 12);
}
