//! URDFs whose links and trees are refused: where, and why.

use super::{Bad, bad, check_all};
use crate::read_urdf;

pub(super) const ROBOT: &str = r#"<robot name="arm">
  <link name="base"/>
  <link name="upper">
    <collision>
      <origin xyz="0 0 1" rpy="0 0 0"/>
      <geometry><box size="1 2 3"/></geometry>
    </collision>
  </link>
  <link name="hand"/>
  <joint name="elbow" type="revolute">
    <origin xyz="0 0 1"/>
    <parent link="base"/>
    <child link="upper"/>
    <axis xyz="0 0 1"/>
    <limit lower="-1" upper="1" effort="1" velocity="1"/>
  </joint>
  <joint name="wrist" type="prismatic">
    <parent link="upper"/>
    <child link="hand"/>
    <limit lower="0" upper="0.1"/>
  </joint>
</robot>
"#;

pub(super) fn check(cases: &[Bad]) {
    check_all(ROBOT, read_urdf, cases);
}

const GEOMETRY: &str = "robot/link[upper]/collision/geometry";
const BOX: &str = r#"<box size="1 2 3"/>"#;

#[test]
fn shapes() {
    let inside = |shape: &'static str| match shape {
        "box" => "robot/link[upper]/collision/geometry/box",
        "cylinder" => "robot/link[upper]/collision/geometry/cylinder",
        "sphere" => "robot/link[upper]/collision/geometry/sphere",
        "capsule" => "robot/link[upper]/collision/geometry/capsule",
        _ => "robot/link[upper]/collision/geometry/mesh",
    };
    check(&[
        bad(BOX, "", 6, GEOMETRY, "it has no shape"),
        bad(BOX, r#"<box size="1 2 3"/><sphere radius="1"/>"#, 6, inside("sphere"), "the second shape"),
        bad(BOX, r#"<cone radius="1"/>"#, 6, "robot/link[upper]/collision/geometry/cone", "\"cone\" is not read"),
        bad(BOX, "<box/>", 6, inside("box"), "no attribute size"),
        bad(BOX, r#"<box size="1 2 0"/>"#, 6, inside("box"), "size holds 0.0"),
        bad(BOX, r#"<box size="1 2 -3"/>"#, 6, inside("box"), "size holds -3.0"),
        bad(BOX, r#"<box size="1 2 1.1e6"/>"#, 6, inside("box"), "at most 1e6"),
        bad(BOX, r#"<box sise="1 2 3" size="1 2 3"/>"#, 6, inside("box"), "no attribute \"sise\""),
        bad(BOX, r#"<cylinder length="1"/>"#, 6, inside("cylinder"), "no attribute radius"),
        bad(BOX, r#"<cylinder radius="1" length="0"/>"#, 6, inside("cylinder"), "length holds 0.0"),
        bad(BOX, r#"<sphere radius="-1"/>"#, 6, inside("sphere"), "radius holds -1.0"),
        bad(BOX, r#"<capsule radius="1"/>"#, 6, inside("capsule"), "no attribute length"),
        bad(BOX, "<mesh/>", 6, inside("mesh"), "no attribute filename"),
        bad(BOX, r#"<mesh filename=" "/>"#, 6, inside("mesh"), "filename is empty"),
        bad(BOX, r#"<mesh filename="a&#10;b"/>"#, 6, inside("mesh"), "control characters"),
        bad(BOX, r#"<mesh filename="a" scale="1 1 0"/>"#, 6, inside("mesh"), "scale holds 0.0"),
        bad(BOX, r#"<mesh filename="a" scale="1 1 -1e-10"/>"#, 6, inside("mesh"), "scale holds -1e-10"),
        bad(BOX, r#"<mesh filename="a" scale="1 1 1e10"/>"#, 6, inside("mesh"), "1e-9 to 1e9"),
        bad(BOX, r#"<mesh filename="a" scale="1 1 NaN"/>"#, 6, inside("mesh"), "not finite"),
        bad(BOX, r#"<mesh filename="a" scale="1 1 inf"/>"#, 6, inside("mesh"), "not finite"),
        bad(BOX, r#"<mesh filename="a" scale="2"/>"#, 6, inside("mesh"), "holds 1 number, not 3; write 3 numbers"),
    ]);
}

#[test]
fn numbers() {
    let path = "robot/link[upper]/collision/origin";
    check(&[
        bad("xyz=\"0 0 1\"", "xyz=\"0 0\"", 5, path, "xyz holds 2 numbers, not 3"),
        bad("xyz=\"0 0 1\"", "xyz=\"0 0 1 2\"", 5, path, "xyz holds 4 numbers, not 3"),
        bad("xyz=\"0 0 1\"", "xyz=\"\"", 5, path, "xyz holds 0 numbers, not 3"),
        bad("xyz=\"0 0 1\"", "xyz=\"0 0 1,5\"", 5, path, "has a comma; write decimal points"),
        bad("xyz=\"0 0 1\"", "xyz=\"0, 0, 1\"", 5, path, "blanks between numbers"),
        bad("xyz=\"0 0 1\"", "xyz=\"0 0 one\"", 5, path, "\"one\", which is not a number"),
        bad("xyz=\"0 0 1\"", "xyz=\"0 0 1e999\"", 5, path, "not finite"),
        bad("xyz=\"0 0 1\"", "xyz=\"0 0 2e6\"", 5, path, "beyond 1e6 metres"),
        bad("rpy=\"0 0 0\"", "rpy=\"0 nan 0\"", 5, path, "rpy holds \"nan\""),
        bad("rpy=\"0 0 0\"", "ryp=\"0 0 0\"", 5, path, "an origin has no attribute \"ryp\""),
        bad("rpy=\"0 0 0\"", "quat_xyzw=\"0 0 0 1\"", 5, path, "the rotation as rpy"),
    ]);
    let error = read_urdf(&ROBOT.replacen("rpy=\"0 0 0\"", "rpy=\"0 0 x\"", 1)).expect_err("refused");
    assert_eq!((error.line, error.column), (5, 27), "the column is that of the attribute");
}

#[test]
fn names() {
    let long: &'static str = Box::leak(format!("name=\"{}\"", "x".repeat(129)).into_boxed_str());
    let shown: &'static str = Box::leak(format!("robot/link[{}...]", "x".repeat(80)).into_boxed_str());
    check(&[
        bad("robot name=\"arm\"", "robot", 1, "robot", "no attribute name"),
        bad("name=\"arm\"", "name=\"\"", 1, "robot", "name is empty"),
        bad("name=\"base\"", "name=\" \"", 2, "robot/link[ ]", "name is empty"),
        bad("name=\"base\"", long, 2, shown, "129 bytes, and at most 128"),
        bad("name=\"base\"", "name=\"a&#9;b\"", 2, "robot/link[a\\tb]", "control characters"),
        bad("name=\"base\"", "name=\"hand\"", 9, "robot/link[hand]", "another link has the name \"hand\""),
        bad("name=\"wrist\"", "name=\"elbow\"", 17, "robot/joint[elbow]", "another joint has the name \"elbow\""),
        bad("<link name=\"base\"/>", "<link/>", 2, "robot/link[1]", "no attribute name"),
    ]);
}

#[test]
fn trees() {
    check(&[
        bad(
            "<link name=\"base\"/>",
            "<link name=\"base\"/><link name=\"x\"/>",
            1,
            "robot",
            "no parent: \"base\", \"x\"",
        ),
        bad(
            "child link=\"hand\"",
            "child link=\"upper\"",
            17,
            "robot/joint[wrist]",
            "child of two joints, this one and \"elbow\"",
        ),
        bad(
            "parent link=\"base\"",
            "parent link=\"hand\"",
            17,
            "robot/joint[wrist]",
            "\"upper\", \"hand\" form a cycle",
        ),
        bad("parent link=\"base\"", "parent link=\"upper\"", 10, "robot/joint[elbow]", "links \"upper\" form a cycle"),
    ]);
    let none = read_urdf("<robot name=\"r\">\n</robot>").expect_err("refused");
    assert_eq!((none.line, none.path.as_str()), (1, "robot"));
    assert!(none.to_string().contains("the robot has no link"));
    let circle = r#"<robot name="r"><link name="a"/>
      <joint name="j" type="fixed"><parent link="a"/><child link="a"/></joint></robot>"#;
    assert!(read_urdf(circle).expect_err("refused").problem.contains("form a cycle"));
}

#[test]
fn misspelt_elements() {
    check(&[
        bad("</link>", "</link><lnik/>", 8, "robot/lnik", "no element \"lnik\" here; write <link>"),
        bad("</link>", "</link><Joint/>", 8, "robot/Joint", "write <joint>"),
        bad("</link>", "<colision/></link>", 8, "robot/link[upper]/colision", "write <collision>"),
        bad("<geometry>", "<orgin/><geometry>", 6, "robot/link[upper]/collision/orgin", "write <origin>"),
        bad("</link>", "</link><part><collision/></part>", 8, "robot/part", "\"part\" has collision geometry"),
        bad("<geometry><box size=\"1 2 3\"/></geometry>", "", 4, "robot/link[upper]/collision", "it has no <geometry>"),
        bad(
            "<geometry>",
            "<geometry/><geometry>",
            6,
            "robot/link[upper]/collision/geometry[2]",
            "the second <geometry>",
        ),
    ]);
}

#[test]
fn too_many_links() {
    let links: String = (0..1001).map(|index| format!("<link name=\"l{index}\"/>\n")).collect();
    let error = read_urdf(&format!("<robot name=\"r\">\n{links}</robot>")).expect_err("refused");
    assert_eq!((error.line, error.path.as_str()), (1002, "robot/link[l1000]"));
    assert!(error.problem.contains("more than 1000 links"));
}
