//! SRDFs that are refused: where, and why.

use super::{Bad, bad, check_all, robots};
use crate::{read_srdf, read_urdf};

fn check(cases: &[Bad]) {
    let robot = read_urdf(&robots::two_arms("planar")).expect("a robot");
    check_all(&robots::two_arms_semantics(), |text| read_srdf(text, &robot), cases);
}

#[test]
fn robots_and_words() {
    check(&[
        bad("robot name=\"two_arms\"", "robot name=\"one_arm\"", 1, "robot", "write name=\"two_arms\""),
        bad("robot name=\"two_arms\"", "robot", 1, "robot", "no attribute name"),
        bad("<passive_joint", "<pasive_joint", 29, "robot/pasive_joint[right_2_joint]", "write <passive_joint>"),
        bad("<chain", "<chian", 4, "robot/group[left_arm]/chian", "write <chain>"),
    ]);
}

#[test]
fn virtual_joints() {
    let path = "robot/virtual_joint[world_joint]";
    check(&[
        bad("type=\"planar\"", "type=\"ball\"", 2, path, "\"ball\", which is not a kind of virtual joint"),
        bad("parent_frame=\"map\"", "", 2, path, "no attribute parent_frame"),
        bad("child_link=\"world\"", "child_link=\"earth\"", 2, path, "\"earth\", and the robot has no link"),
        bad(
            "name=\"world_joint\"",
            "name=\"neck\"",
            2,
            "robot/virtual_joint[neck]",
            "the URDF has a joint \"neck\", too",
        ),
        bad(
            "<group name=\"left_arm\">",
            r#"<virtual_joint name="world_joint" type="fixed" parent_frame="m" child_link="head"/><group name="left_arm">"#,
            3,
            path,
            "another virtual_joint has the name",
        ),
    ]);
}

#[test]
fn groups() {
    check(&[
        bad("tip_link=\"left_2\"", "tip_link=\"left_9\"", 4, "robot/group[left_arm]/chain", "tip_link is \"left_9\""),
        bad("base_link=\"torso\"", "", 4, "robot/group[left_arm]/chain", "no attribute base_link"),
        bad("link name=\"right_0\"", "link name=\"r\"", 7, "robot/group[right_arm]/link[r]", "no link of this name"),
        bad(
            "joint name=\"right_1_joint\"",
            "joint name=\"r\"",
            8,
            "robot/group[right_arm]/joint[r]",
            "no joint of this",
        ),
        bad(
            "group name=\"left_arm\"/",
            "group name=\"leg\"/",
            12,
            "robot/group[arms]/group[leg]",
            "no group of this name",
        ),
        bad(
            "group name=\"right_arm\">",
            "group name=\"left_arm\">",
            6,
            "robot/group[left_arm]",
            "another group has the name",
        ),
        bad(
            "<link name=\"right_0\"/>",
            "<group name=\"arms\"/>",
            6,
            "robot/group[right_arm]",
            "\"right_arm\", \"arms\", \"right_arm\"",
        ),
        bad(
            "<link name=\"right_0\"/>",
            "<group name=\"right_arm\"/>",
            6,
            "robot/group[right_arm]",
            "has itself inside",
        ),
    ]);
}

#[test]
fn states() {
    let state = "robot/group_state[home]";
    let joint = "robot/group_state[home]/joint[left_0_joint]";
    check(&[
        bad("group=\"left_arm\">", "group=\"leg\">", 21, state, "group is \"leg\", and the robot has no group"),
        bad("group=\"left_arm\">", ">", 21, state, "no attribute group"),
        bad("value=\"0.5\"", "", 22, joint, "no attribute value"),
        bad("value=\"0.5\"", "value=\"0,5\"", 22, joint, "has a comma"),
        bad("value=\"0.5\"", "value=\"1 2\"", 22, joint, "holds 2 numbers, and the joint \"left_0_joint\" takes 1"),
        bad("value=\"0.5\"", "value=\"\"", 22, joint, "holds 0 numbers"),
        bad("value=\"1 2 0.5\"", "value=\"1\"", 26, "robot/group_state[origin]/joint[world_joint]", "takes 3"),
        bad(
            "joint name=\"left_1_joint\"",
            "joint name=\"left_9\"",
            23,
            "robot/group_state[home]/joint[left_9]",
            "no joint of",
        ),
        bad(
            "joint name=\"left_1_joint\"",
            "joint name=\"neck\"",
            23,
            "robot/group_state[home]/joint[neck]",
            "not in the group \"left_arm\"",
        ),
        bad(
            "joint name=\"left_1_joint\"",
            "joint name=\"left_0_joint\"",
            23,
            "robot/group_state[home]/joint[left_0_joint]",
            "twice",
        ),
        bad(
            "name=\"origin\" group=\"base\"",
            "name=\"home\" group=\"left_arm\"",
            25,
            state,
            "the group has another state",
        ),
    ]);
}

#[test]
fn end_effectors_and_passive_joints() {
    let path = "robot/end_effector[tool]";
    check(&[
        bad("parent_link=\"left_1\"", "parent_link=\"x\"", 28, path, "parent_link is \"x\""),
        bad("group=\"hand\"", "group=\"x\"", 28, path, "group is \"x\", and the robot has no group"),
        bad("parent_group=\"left_arm\"", "parent_group=\"x\"", 28, path, "parent_group is \"x\""),
        bad(
            "passive_joint name=\"right_2_joint\"",
            "passive_joint name=\"x\"",
            29,
            "robot/passive_joint[x]",
            "no joint of this name",
        ),
    ]);
}

#[test]
fn pairs() {
    check(&[
        bad(
            "link2=\"left_0\"",
            "link2=\"x\"",
            30,
            "robot/disable_collisions[1]",
            "link2 is \"x\", and the robot has no link",
        ),
        bad("link2=\"left_0\"", "", 30, "robot/disable_collisions[1]", "no attribute link2"),
        bad("link1=\"right_0\"", "link1=\"torso\"", 31, "robot/disable_collisions[2]", "are both \"torso\""),
        bad("link=\"head\"", "link=\"x\"", 32, "robot/disable_default_collisions", "link is \"x\""),
        bad("link2=\"head\"", "link2=\"x\"", 33, "robot/enable_collisions", "link2 is \"x\""),
        bad(
            "link1=\"left_2\" link2=\"head\"",
            "link1=\"left_0\" link2=\"torso\"",
            33,
            "robot/enable_collisions",
            "both enabled and disabled",
        ),
    ]);
}
