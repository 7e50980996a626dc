//! URDFs whose joints are refused: where, and why.

use super::urdf_errors::{ROBOT, check};
use super::{bad, check_all};
use crate::read_urdf;

#[test]
fn joints() {
    let elbow = "robot/joint[elbow]";
    check(&[
        bad("type=\"revolute\"", "", 10, elbow, "no attribute type"),
        bad("type=\"revolute\"", "type=\"hinge\"", 10, elbow, "\"hinge\", which is not a kind of joint"),
        bad("<parent link=\"base\"/>", "", 10, elbow, "it has no <parent>"),
        bad("<child link=\"upper\"/>", "", 10, elbow, "it has no <child>"),
        bad(
            "parent link=\"base\"",
            "parent link=\"bas\"",
            12,
            "robot/joint[elbow]/parent",
            "\"bas\", and the robot has no",
        ),
        bad("child link=\"upper\"", "child link=\"up\"", 13, "robot/joint[elbow]/child", "no link of this name"),
        bad("parent link=\"base\"", "parent", 12, "robot/joint[elbow]/parent", "no attribute link"),
        bad("axis xyz=\"0 0 1\"", "axis xyz=\"0 0 0\"", 14, "robot/joint[elbow]/axis", "length 0"),
        bad("axis xyz=\"0 0 1\"", "axis xzy=\"0 0 1\"", 14, "robot/joint[elbow]/axis", "no attribute \"xzy\""),
        bad("<axis xyz=\"0 0 1\"/>", "<axis/><axis/>", 14, "robot/joint[elbow]/axis[2]", "the second <axis>"),
    ]);
}

#[test]
fn limits() {
    let limit = r#"<limit lower="-1" upper="1" effort="1" velocity="1"/>"#;
    let path = "robot/joint[elbow]/limit";
    check(&[
        bad(limit, "", 10, "robot/joint[elbow]", "revolute and has no <limit>; write <limit lower"),
        bad(r#"<limit lower="0" upper="0.1"/>"#, "", 17, "robot/joint[wrist]", "prismatic and has no <limit>"),
        bad(limit, r#"<limit lower="2" upper="1"/>"#, 15, path, "lower is 2.0 and above upper, 1.0"),
        bad(limit, r#"<limit upper="-1"/>"#, 15, path, "one that is missing is 0"),
        bad(limit, r#"<limit lower="1,5" upper="2"/>"#, 15, path, "has a comma"),
        bad(limit, r#"<limit lover="1" upper="2"/>"#, 15, path, "write lower"),
        bad(limit, r#"<limits lower="1" upper="2"/>"#, 15, "robot/joint[elbow]/limits", "write <limit>"),
    ]);
}

#[test]
fn followers() {
    let wrist = r#"<limit lower="0" upper="0.1"/>"#;
    let elbow = r#"<axis xyz="0 0 1"/>"#;
    let path = "robot/joint[wrist]/mimic";
    check(&[
        bad(wrist, r#"<limit/><mimic joint="knee"/>"#, 20, path, "\"knee\", and the robot has no joint"),
        bad(wrist, "<limit/><mimic/>", 20, path, "no attribute joint"),
        bad(wrist, r#"<limit/><mimic joint="wrist"/>"#, 20, path, "follows itself: \"wrist\", \"wrist\""),
        bad(wrist, r#"<limit/><mimic joint="elbow" multiplier="1 2"/>"#, 20, path, "holds 2 numbers, not 1"),
        bad(wrist, r#"<limit/><mimic joint="elbow" ofset="1"/>"#, 20, path, "write offset"),
    ]);
    let circle = ROBOT.replacen(wrist, r#"<limit/><mimic joint="elbow"/>"#, 1);
    let both =
        [bad(elbow, r#"<mimic joint="wrist"/>"#, 14, "robot/joint[elbow]/mimic", "itself: \"elbow\", \"wrist\"")];
    check_all(&circle, read_urdf, &both);
}

#[test]
fn followers_of_followers_and_of_other_kinds() {
    let more = r#"<link name="a"/><link name="b"/>
      <joint name="ja" type="continuous"><parent link="base"/><child link="a"/></joint>
      <joint name="jb" type="continuous"><parent link="base"/><child link="b"/></joint>
      </robot>"#;
    let text = ROBOT.replacen("</robot>", more, 1);
    let ja = "<child link=\"a\"/>";
    let jb = "<child link=\"b\"/>";
    let follows = text.replacen(ja, r#"<child link="a"/><mimic joint="elbow" multiplier="2" offset="1"/>"#, 1);
    let path = "robot/joint[jb]/mimic";
    let remedy = "write joint=\"elbow\" multiplier=\"6.0\" offset=\"7.0\"";
    check_all(
        &follows,
        read_urdf,
        &[bad(jb, r#"<child link="b"/><mimic joint="ja" multiplier="3" offset="4"/>"#, 24, path, remedy)],
    );
    for kind in ["planar", "floating", "fixed"] {
        let other = text.replacen("name=\"ja\" type=\"continuous\"", &format!("name=\"ja\" type=\"{kind}\""), 1);
        let case = bad(jb, r#"<child link="b"/><mimic joint="ja"/>"#, 24, path, "only joints with one value follow");
        check_all(&other, read_urdf, &[case]);
        let other = text.replacen("name=\"jb\" type=\"continuous\"", &format!("name=\"jb\" type=\"{kind}\""), 1);
        let case = bad(jb, r#"<child link="b"/><mimic joint="ja"/>"#, 24, path, "only joints with one value follow");
        if kind != "fixed" {
            check_all(&other, read_urdf, &[case]);
        }
    }
}
