//! What SRDFs are read as.

use super::robots;
use crate::{Description, JointValues, Kinematics, Semantics, VirtualJointKind, read_srdf, read_urdf};

fn two_arms() -> Description {
    read_urdf(&robots::two_arms("planar")).expect("a robot")
}

fn read(text: &str) -> Semantics {
    read_srdf(text, &two_arms()).expect("semantics")
}

fn link_names<'d>(robot: &'d Description, links: &[usize]) -> Vec<&'d str> {
    links.iter().map(|link| &*robot.links[*link].name).collect()
}

fn joint_names<'d>(robot: &'d Description, joints: &[usize]) -> Vec<&'d str> {
    joints.iter().map(|joint| &*robot.joints[*joint].name).collect()
}

#[test]
fn groups_are_sets_of_joints_and_links() {
    let (robot, semantics) = (two_arms(), read(&robots::two_arms_semantics()));
    let group = |name| &semantics.groups[semantics.group(name).expect("a group")];
    let left = group("left_arm");
    assert_eq!(joint_names(&robot, &left.joints), ["left_0_joint", "left_1_joint", "left_2_joint"]);
    assert_eq!(link_names(&robot, &left.links), ["torso", "left_0", "left_1", "left_2"]);
    let right = group("right_arm");
    assert_eq!(joint_names(&robot, &right.joints), ["right_0_joint", "right_1_joint", "right_2_joint"]);
    assert_eq!(link_names(&robot, &right.links), ["right_0", "right_1", "right_2"]);
    assert_eq!((group("arms").joints.len(), group("arms").links.len()), (6, 7));
    let base = group("base");
    assert_eq!((&base.joints[..], &base.virtual_joints[..]), (&[][..], &[0][..]));
    assert_eq!(semantics.group("head"), None);
    assert_eq!(semantics.warnings, []);
}

#[test]
fn a_chain_goes_through_where_both_ends_meet() {
    let robot = two_arms();
    let chain = |base, tip| {
        let chain = format!("<chain base_link=\"{base}\" tip_link=\"{tip}\"/>");
        let semantics = read(&format!("<robot name=\"two_arms\"><group name=\"g\">{chain}</group></robot>"));
        let group = &semantics.groups[0];
        (joint_names(&robot, &group.joints).join(" "), link_names(&robot, &group.links).join(" "))
    };
    let through = chain("left_0", "right_0");
    assert_eq!(through, ("left_0_joint right_0_joint".into(), "torso left_0 right_0".into()));
    assert_eq!(chain("right_1", "right_0"), ("right_1_joint".into(), "right_0 right_1".into()));
    assert_eq!(chain("head", "head"), (String::new(), "head".into()));
    assert_eq!(chain("world", "head"), ("base neck".into(), "world torso head".into()));
}

#[test]
fn subgroups_are_resolved_in_any_order() {
    let text = r#"<robot name="two_arms"><group name="a"><group name="b"/><group name="c"/></group>
        <group name="b"><group name="c"/></group><group name="c"><link name="head"/></group></robot>"#;
    let semantics = read(text);
    assert!(semantics.groups.iter().all(|group| group.links == semantics.groups[2].links));
}

#[test]
fn states_end_effectors_and_joints() {
    let (robot, semantics) = (two_arms(), read(&robots::two_arms_semantics()));
    let joint = |name| robot.joints.iter().position(|joint| &*joint.name == name).expect("a joint");
    let [home, origin] = &semantics.states[..] else { panic!("two") };
    assert_eq!((&*home.name, home.group), ("home", 0));
    let expected = [("left_0_joint", 0.5), ("left_1_joint", -1.0)];
    assert_eq!(home.values, expected.map(|(name, value)| JointValues { joint: joint(name), values: vec![value] }));
    assert_eq!(origin.virtual_values, [JointValues { joint: 0, values: vec![1.0, 2.0, 0.5] }]);
    let virtual_joint = &semantics.virtual_joints[0];
    assert_eq!((virtual_joint.kind, virtual_joint.kind.width()), (VirtualJointKind::Planar, 3));
    assert_eq!((&*virtual_joint.parent_frame, virtual_joint.child_link), ("map", 0));
    assert_eq!(semantics.passive_joints, [joint("right_2_joint")]);
    let tool = &semantics.end_effectors[0];
    assert_eq!((&*tool.name, tool.group, tool.parent_group), ("tool", 4, Some(0)));
}

#[test]
fn states_have_values_for_configurations() {
    let own = |robot: &Description, text: &str| -> Vec<(String, Vec<f64>)> {
        let semantics = read_srdf(text, robot).expect("semantics");
        let order: Vec<_> = Kinematics::new(robot).expect("a tree").variables().to_vec();
        let own = semantics.states[0].own_values(&robot.joints);
        let place = |name: &str| order.iter().position(|variable| &*variable.name == name).expect("a variable");
        assert!(own.is_sorted_by_key(|(joint, _)| place(&joint.name)));
        own.into_iter().map(|(joint, values)| (joint.name.to_string(), values.to_vec())).collect()
    };
    let mobile = read_urdf(&robots::mobile_manipulator()).expect("a robot");
    let text = r#"<robot name="mobile">
  <group name="some"><chain base_link="base" tip_link="left_finger"/><joint name="right_finger_joint"/></group>
  <group_state name="holds" group="some">
    <joint name="right_finger_joint" value="-0.02"/><joint name="left_finger_joint" value="0.02"/>
    <joint name="lift" value="0.25"/>
  </group_state>
</robot>"#;
    let expected = [("lift".to_owned(), vec![0.25]), ("left_finger_joint".to_owned(), vec![0.02])];
    assert_eq!(own(&mobile, text), expected, "the other finger follows");
    let text = r#"<robot name="two_arms">
  <virtual_joint name="world_joint" type="planar" parent_frame="map" child_link="world"/>
  <group name="arm"><joint name="world_joint"/><chain base_link="world" tip_link="left_2"/></group>
  <group_state name="home" group="arm">
    <joint name="left_0_joint" value="0.5"/><joint name="world_joint" value="3 4 5"/>
    <joint name="base" value="1 2 -0.5"/>
  </group_state>
</robot>"#;
    let expected = [("base".to_owned(), vec![1.0, 2.0, -0.5]), ("left_0_joint".to_owned(), vec![0.5])];
    assert_eq!(own(&two_arms(), text), expected);
}

#[test]
fn pairs_are_disabled_and_enabled() {
    let (robot, semantics) = (two_arms(), read(&robots::two_arms_semantics()));
    let link = |name| robot.links.iter().position(|link| &*link.name == name).expect("a link");
    let is_disabled = |one, other| {
        let answer = semantics.is_disabled(link(one), link(other));
        assert_eq!(answer, semantics.is_disabled(link(other), link(one)));
        answer
    };
    assert!(is_disabled("torso", "left_0"));
    assert!(is_disabled("torso", "right_0"), "in either order");
    assert!(!is_disabled("left_0", "right_0"));
    assert!(is_disabled("head", "left_1"), "by default");
    assert!(!is_disabled("head", "left_2"), "enabled again");
    assert_eq!(semantics.disabled_pairs.len(), 2);
    assert!(semantics.disabled_pairs.iter().all(|pair| &*pair.reason == "Adjacent" && pair.first < pair.second));
}

#[test]
fn what_is_odd_is_a_warning() {
    let text = r#"<robot name="two_arms">
  <virtual_joint name="v" type="fixed" parent_frame="w" child_link="head"/>
  <group name="empty"/>
  <group name="arm"><chain base_link="world" tip_link="left_2"/></group>
  <group name="neck"><joint name="neck"/></group>
  <group_state name="far" group="arm"><joint name="left_0_joint" value="2"/></group_state>
  <group_state name="stiff" group="neck"><joint name="neck" value="1"/></group_state>
  <disable_collisions link1="head" link2="torso"/>
  <disable_collisions link1="torso" link2="head"/>
  <enable_collisions link1="head" link2="left_0"/>
  <enable_collisions link1="head" link2="left_0"/>
  <disable_default_collisions link="head"/>
  <disable_default_collisions link="head"/>
  <something/>
</robot>"#;
    let semantics = read(text);
    let expected = [
        (2, "robot/virtual_joint[v]", "not the root"),
        (3, "robot/group[empty]", "is empty"),
        (6, "robot/group_state[far]/joint[left_0_joint]", "2.0 is not within the limits"),
        (7, "robot/group_state[stiff]/joint[neck]", "takes no value"),
        (9, "robot/disable_collisions[2]", "disabled more than once"),
        (11, "robot/enable_collisions[2]", "enabled more than once"),
        (13, "robot/disable_default_collisions[2]", "disabled more than once"),
        (14, "robot/something", "is not read"),
    ];
    assert_eq!(semantics.warnings.len(), expected.len(), "{:?}", semantics.warnings);
    for (warning, (line, path, says)) in semantics.warnings.iter().zip(expected) {
        assert_eq!((warning.line, warning.path.as_str()), (line, path), "{warning}");
        assert!(warning.to_string().contains(says), "{warning}");
    }
    assert_eq!(semantics.states[0].values.len(), 1, "a value out of limits stays");
    assert!(semantics.states[1].values.is_empty());
}

#[test]
fn warnings_are_limited() {
    let pair = "<disable_collisions link1=\"head\" link2=\"torso\"/>\n".repeat(300);
    assert_eq!(read(&format!("<robot name=\"two_arms\">{pair}</robot>")).warnings.len(), 100);
}
