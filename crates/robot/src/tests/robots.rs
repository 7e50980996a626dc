//! Descriptions of robots of common build, as texts. Dimensions are round numbers.

use std::fmt::Write as _;

/// An arm with six revolute joints `joint_1` to `joint_6`, meshes as collision geometry, and fixed
/// frames at both ends: 9 links `base`, `link_0` to `link_6`, `tool`.
pub(crate) fn six_axis_arm() -> String {
    let mut links = String::from("  <link name=\"base\"/>\n  <link name=\"tool\"/>\n");
    for index in 0..=6 {
        let _ = write!(
            links,
            r#"  <link name="link_{index}">
    <inertial><mass value="1"/><inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/></inertial>
    <visual><geometry><mesh filename="package://arm/visual/{index}.dae"/></geometry></visual>
    <collision>
      <origin xyz="0 0 0.1" rpy="0 1.5 0"/>
      <geometry><mesh filename="package://arm/collision/{index}.stl" scale="0.001 0.001 0.001"/></geometry>
    </collision>
  </link>
"#
        );
    }
    let mut joints = fixed("mount", "base", "link_0", "0 0 0") + &fixed("flange", "link_6", "tool", "0 0.1 0");
    for (index, axis) in ["0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"].iter().enumerate() {
        let number = index + 1;
        let _ = write!(
            joints,
            r#"  <joint name="joint_{number}" type="revolute">
    <parent link="link_{index}"/>
    <child link="link_{number}"/>
    <origin xyz="0 0.1 0.2" rpy="0 0.5 0"/>
    <axis xyz="{axis}"/>
    <limit lower="-6.25" upper="6.25" effort="150" velocity="3"/>
    <dynamics damping="0" friction="0"/>
  </joint>
  <transmission name="drive_{number}">
    <type>transmission_interface/SimpleTransmission</type>
    <joint name="joint_{number}"><hardwareInterface>PositionJointInterface</hardwareInterface></joint>
  </transmission>
"#
        );
    }
    format!("<?xml version=\"1.0\"?>\n<robot name=\"six_axis\">\n{links}{joints}</robot>\n")
}

/// A mobile base with two driven wheels, a prismatic torso, an arm whose joints are continuous or
/// revolute, and a gripper of which one finger follows the other: 11 links.
pub(crate) fn mobile_manipulator() -> String {
    let mut text = String::from("<robot name=\"mobile\">\n");
    text += "  <material name=\"grey\"><color rgba=\"0.5 0.5 0.5 1\"/></material>\n";
    for (name, shape) in [
        ("base", r#"<cylinder radius="0.25" length="0.4"/>"#),
        ("left_wheel", r#"<cylinder radius="0.06" length="0.03"/>"#),
        ("right_wheel", r#"<cylinder radius="0.06" length="0.03"/>"#),
        ("torso", r#"<box size="0.2 0.3 0.6"/>"#),
        ("shoulder", r#"<sphere radius="0.1"/>"#),
        ("upper_arm", r#"<capsule radius="0.06" length="0.3"/>"#),
        ("forearm", r#"<mesh filename="meshes/forearm.stl"/>"#),
        ("left_finger", r#"<box size="0.06 0.015 0.03"/>"#),
        ("right_finger", r#"<box size="0.06 0.015 0.03"/>"#),
    ] {
        text += &body(name, shape);
    }
    text += "  <link name=\"laser\"/>\n  <link name=\"gripper\"/>\n";
    text += &moving("left_wheel_joint", "continuous", "base", "left_wheel", r#"<axis xyz="0 1 0"/>"#);
    text += &moving("right_wheel_joint", "continuous", "base", "right_wheel", r#"<axis xyz="0 1 0"/>"#);
    text += &moving("lift", "prismatic", "base", "torso", r#"<axis xyz="0 0 1"/><limit lower="0" upper="0.4"/>"#);
    text += &moving("pan", "revolute", "torso", "shoulder", r#"<axis xyz="0 0 1"/><limit lower="-1.6" upper="1.6"/>"#);
    text += &moving("roll", "continuous", "shoulder", "upper_arm", r#"<axis xyz="1 0 0"/><limit effort="9"/>"#);
    text += &moving("flex", "revolute", "upper_arm", "forearm", r#"<axis xyz="0 1 0"/><limit lower="-2" upper="2"/>"#);
    text += &fixed("laser_joint", "base", "laser", "0.2 0 0.3");
    text += &fixed("gripper_joint", "forearm", "gripper", "0.2 0 0");
    let finger = r#"<axis xyz="0 1 0"/><limit lower="0" upper="0.05"/>"#;
    text += &moving("left_finger_joint", "prismatic", "gripper", "left_finger", finger);
    let follows = r#"<axis xyz="0 1 0"/><limit lower="-0.05" upper="0"/>
    <mimic joint="left_finger_joint" multiplier="-1" offset="0"/>"#;
    text += &moving("right_finger_joint", "prismatic", "gripper", "right_finger", follows);
    text + "  <gazebo reference=\"base\"><material>Gazebo/Grey</material></gazebo>\n</robot>\n"
}

/// A torso with two arms of three joints each, on a base of this kind of joint, `planar` or
/// `floating`: 9 links `world`, `torso`, `head` and those of the arms, such as `left_2`.
pub(crate) fn two_arms(base: &str) -> String {
    let mut text = String::from("<robot name=\"two_arms\">\n  <link name=\"world\"/>\n");
    text += &body("torso", r#"<box size="0.4 0.6 1.2"/>"#);
    text += &body("head", r#"<sphere radius="0.15"/>"#);
    text += &moving("base", base, "world", "torso", r#"<axis xyz="0 0 1"/>"#);
    text += &fixed("neck", "torso", "head", "0 0 0.8");
    for side in ["left", "right"] {
        let mut parent = "torso".to_string();
        let shapes = [r#"<capsule radius="0.08" length="0.3"/>"#, r#"<cylinder radius="0.06" length="0.3"/>"#];
        for (index, shape) in shapes.into_iter().chain([r#"<box size="0.1 0.1 0.2"/>"#]).enumerate() {
            let child = format!("{side}_{index}");
            text += &body(&child, shape);
            let inside = r#"<axis xyz="0 1 0"/><limit lower="-1.5" upper="1.5"/>"#;
            text += &moving(&format!("{child}_joint"), "revolute", &parent, &child, inside);
            parent = child;
        }
    }
    text + "</robot>\n"
}

/// A semantic description of [`two_arms`].
pub(crate) fn two_arms_semantics() -> String {
    String::from(
        r#"<robot name="two_arms">
  <virtual_joint name="world_joint" type="planar" parent_frame="map" child_link="world"/>
  <group name="left_arm">
    <chain base_link="torso" tip_link="left_2"/>
  </group>
  <group name="right_arm">
    <link name="right_0"/>
    <joint name="right_1_joint"/>
    <joint name="right_2_joint"/>
  </group>
  <group name="arms">
    <group name="left_arm"/>
    <group name="right_arm"/>
  </group>
  <group name="base">
    <joint name="world_joint"/>
  </group>
  <group name="hand">
    <link name="left_2"/>
  </group>
  <group_state name="home" group="left_arm">
    <joint name="left_0_joint" value="0.5"/>
    <joint name="left_1_joint" value="-1"/>
  </group_state>
  <group_state name="origin" group="base">
    <joint name="world_joint" value="1 2 0.5"/>
  </group_state>
  <end_effector name="tool" group="hand" parent_link="left_1" parent_group="left_arm"/>
  <passive_joint name="right_2_joint"/>
  <disable_collisions link1="torso" link2="left_0" reason="Adjacent"/>
  <disable_collisions link1="right_0" link2="torso" reason="Adjacent"/>
  <disable_default_collisions link="head"/>
  <enable_collisions link1="left_2" link2="head"/>
</robot>
"#,
    )
}

fn body(name: &str, shape: &str) -> String {
    format!("  <link name=\"{name}\">\n    <collision><geometry>{shape}</geometry></collision>\n  </link>\n")
}

fn fixed(name: &str, parent: &str, child: &str, xyz: &str) -> String {
    moving(name, "fixed", parent, child, &format!("<origin xyz=\"{xyz}\" rpy=\"0 0 0\"/>"))
}

fn moving(name: &str, kind: &str, parent: &str, child: &str, inside: &str) -> String {
    format!(
        r#"  <joint name="{name}" type="{kind}">
    <parent link="{parent}"/>
    <child link="{child}"/>
    {inside}
  </joint>
"#
    )
}
