//! What URDFs are read as.

use nalgebra::{Isometry3, Rotation3, Vector3};

use super::robots;
use crate::{Description, Geometry, Joint, JointKind, Limits, Mimic, read_urdf};

fn read(text: &str) -> Description {
    read_urdf(text).expect("a robot")
}

fn joint<'d>(robot: &'d Description, name: &str) -> &'d Joint {
    robot.joints.iter().find(|joint| &*joint.name == name).expect("a joint of this name")
}

fn link(robot: &Description, name: &str) -> usize {
    robot.links.iter().position(|link| &*link.name == name).expect("a link of this name")
}

fn shape<'d>(robot: &'d Description, name: &str) -> &'d Geometry {
    &robot.links[link(robot, name)].collisions[0].geometry
}

/// A link with this inside.
fn with_link(inside: &str) -> Description {
    read(&format!("<robot name=\"r\"><link name=\"a\">{inside}</link></robot>"))
}

/// A joint with this inside.
fn with_joint(kind: &str, inside: &str) -> Joint {
    let text = format!(
        r#"<robot name="r"><link name="a"/><link name="b"/><joint name="j" type="{kind}">
        <parent link="a"/><child link="b"/>{inside}</joint></robot>"#
    );
    read(&text).joints.remove(0)
}

#[test]
fn a_six_axis_arm_is_read() {
    let robot = read(&robots::six_axis_arm());
    assert_eq!((&*robot.name, robot.links.len(), robot.joints.len()), ("six_axis", 9, 8));
    let revolute = robot.joints.iter().filter(|joint| joint.kind == JointKind::Revolute).count();
    assert_eq!(revolute, 6);
    let elbow = joint(&robot, "joint_2");
    assert_eq!((elbow.parent, elbow.child), (link(&robot, "link_1"), link(&robot, "link_2")));
    assert_eq!(elbow.limits, Some(Limits { lower: -6.25, upper: 6.25 }));
    assert_eq!(elbow.axis, Vector3::y_axis());
    let Geometry::Mesh { uri, scale } = shape(&robot, "link_3") else { panic!("a mesh") };
    assert_eq!((uri.as_str(), *scale), ("package://arm/collision/3.stl", Vector3::repeat(0.001)));
    assert!(robot.links[link(&robot, "tool")].collisions.is_empty());
}

#[test]
fn a_mobile_manipulator_is_read() {
    let robot = read(&robots::mobile_manipulator());
    assert_eq!((robot.links.len(), robot.joints.len()), (11, 10));
    let kinds = |kind| robot.joints.iter().filter(|joint| joint.kind == kind).count();
    assert_eq!(kinds(JointKind::Continuous), 3);
    assert_eq!(kinds(JointKind::Prismatic), 3);
    assert_eq!(kinds(JointKind::Fixed), 2);
    assert_eq!(joint(&robot, "roll").limits, None);
    let followed = robot.joints.iter().position(|joint| &*joint.name == "left_finger_joint").expect("there");
    let mimic = Mimic { joint: followed, multiplier: -1.0, offset: 0.0 };
    assert_eq!(joint(&robot, "right_finger_joint").mimic, Some(mimic));
    assert_eq!(shape(&robot, "upper_arm"), &Geometry::Capsule { radius_m: 0.06, length_m: 0.3 });
}

#[test]
fn two_arms_on_a_moving_base_are_read() {
    for (base, kind, width) in [("planar", JointKind::Planar, 3), ("floating", JointKind::Floating, 7)] {
        let robot = read(&robots::two_arms(base));
        assert_eq!((robot.links.len(), robot.joints.len()), (9, 8));
        assert_eq!((joint(&robot, "base").kind, joint(&robot, "base").kind.width()), (kind, width));
        assert_eq!(shape(&robot, "head"), &Geometry::Sphere { radius_m: 0.15 });
        assert_eq!(shape(&robot, "left_1"), &Geometry::Cylinder { radius_m: 0.06, length_m: 0.3 });
        assert_eq!(shape(&robot, "right_2"), &Geometry::Box { sides_m: Vector3::new(0.1, 0.1, 0.2) });
    }
}

#[test]
fn angles_turn_about_fixed_axes() {
    let joint = with_joint("fixed", r#"<origin xyz="1 2 3" rpy="0.3 -0.4 2"/>"#);
    let about = |axis, angle| Rotation3::from_axis_angle(&axis, angle);
    let (roll, pitch, yaw) =
        (about(Vector3::x_axis(), 0.3), about(Vector3::y_axis(), -0.4), about(Vector3::z_axis(), 2.0));
    let expected = (yaw * pitch * roll).into_inner();
    let found = joint.origin.rotation.to_rotation_matrix().into_inner();
    assert!((found - expected).amax() < 1e-15, "{found} {expected}");
    assert_eq!(joint.origin.translation.vector, Vector3::new(1.0, 2.0, 3.0));
}

#[test]
fn what_is_missing_has_its_default() {
    let joint = with_joint("revolute", "<limit/>");
    assert_eq!(joint.origin, Isometry3::identity());
    assert_eq!(joint.axis, Vector3::x_axis());
    assert_eq!(joint.limits, Some(Limits { lower: 0.0, upper: 0.0 }));
    let robot = with_link(r#"<collision><geometry><mesh filename="a.stl"/></geometry></collision>"#);
    let Geometry::Mesh { scale, .. } = shape(&robot, "a") else { panic!("a mesh") };
    assert_eq!(*scale, Vector3::repeat(1.0));
    assert_eq!(robot.links[0].collisions[0].origin, Isometry3::identity());
}

#[test]
fn axes_are_normalised_at_any_length() {
    for text in ["0 0 2", "0 0 1e-300", "0 0 1e300"] {
        let joint = with_joint("continuous", &format!("<axis xyz=\"{text}\"/>"));
        assert_eq!(joint.axis, Vector3::z_axis(), "{text}");
    }
    let joint = with_joint("continuous", r#"<axis xyz="1 1 0"/>"#);
    assert!((joint.axis.norm() - 1.0).abs() < 1e-15);
}

#[test]
fn kinds_without_axis_and_limits_ignore_them() {
    let joint = with_joint("fixed", r#"<axis xyz="0 0 0"/><limit lower="2" upper="1"/>"#);
    assert_eq!((joint.axis, joint.limits), (Vector3::x_axis(), None));
    assert_eq!(with_joint("floating", r#"<axis xyz="0 0 0"/>"#).axis, Vector3::x_axis());
    assert_eq!(with_joint("continuous", r#"<limit lower="-1" upper="1"/>"#).limits, None);
}

#[test]
fn a_fixed_joint_follows_nothing() {
    let text = robots::mobile_manipulator().replace(
        "<joint name=\"right_finger_joint\" type=\"prismatic\">",
        "<joint name=\"right_finger_joint\" type=\"fixed\">",
    );
    assert_eq!(joint(&read(&text), "right_finger_joint").mimic, None);
}

#[test]
fn a_link_has_all_its_collisions() {
    let one = r#"<collision name="x"><geometry><sphere radius="1."/></geometry></collision>"#;
    let two = r#"<collision><origin xyz="0 0 .5"/><geometry><sphere radius="+2e0"/></geometry></collision>"#;
    let robot = with_link(&format!("{one}{two}"));
    let radii: Vec<_> = robot.links[0].collisions.iter().map(|collision| collision.geometry.clone()).collect();
    assert_eq!(radii, [Geometry::Sphere { radius_m: 1.0 }, Geometry::Sphere { radius_m: 2.0 }]);
    assert_eq!(robot.links[0].collisions[1].origin.translation.z, 0.5);
}

#[test]
fn a_negative_factor_mirrors() {
    let inside = r#"<collision><geometry><mesh filename="a.stl" scale="1 -1 1e9"/></geometry></collision>"#;
    let Geometry::Mesh { scale, .. } = shape(&with_link(inside), "a").clone() else { panic!("a mesh") };
    assert_eq!(scale, Vector3::new(1.0, -1.0, 1e9));
}

#[test]
fn extensions_are_passed_over() {
    let text = r#"<robot name="r" version="1.0" xmlns:xacro="http://www.ros.org/wiki/xacro" xmlns:drake="http://d">
        <drake:joint/><gazebo><plugin><collision/></plugin></gazebo><loop_closure/>
        <ros2_control name="c" type="system"><joint name="j"><param name="p">1</param></joint></ros2_control>
        <link name="a" type="frame"><contact/><drake:collision/><verbose value="1"/>
        <collision drake:x="1" group="g"><verbose/><geometry><sphere radius="1"/></geometry></collision></link>
        </robot>"#;
    let robot = read(text);
    assert_eq!((robot.links.len(), robot.links[0].collisions.len(), robot.joints.len()), (1, 1, 0));
    let of_namespace = "<robot name=\"r\" xmlns=\"http://www.ros.org\"><link name=\"a\"/></robot>";
    assert_eq!(read(of_namespace).links.len(), 1);
    let marked = format!("\u{feff}{of_namespace}");
    assert_eq!(read(&marked).links.len(), 1);
}
