//! Links whose meshes are sent along, and robots of many kinds.

use sublevel::client::{
    CertificateQuestion, ClearanceQuestion, MotionsQuestion, Question, RobotPlacement, StatesQuestion,
};
use sublevel::scene::NamedJointValues;
use sublevel::scene::query::{Measure, StateVerdict};
use sublevel::service::proto::fit_mesh::Content;
use sublevel::service::proto::{FitMesh, LinkMesh, LoadRobotRequest, MeshFormat};
use tonic::Code;

use super::{CUBE, SRDF, URDF, at, served};

fn mesh(uri: &str, format: MeshFormat, file: &str) -> LinkMesh {
    let content = Content::File(file.as_bytes().to_vec().into());
    LinkMesh { uri: uri.into(), mesh: Some(FitMesh { format: format.into(), content: Some(content) }) }
}

fn load(urdf: &str, srdf: &str, meshes: Vec<LinkMesh>) -> LoadRobotRequest {
    LoadRobotRequest { urdf: urdf.into(), srdf: srdf.into(), meshes, ..LoadRobotRequest::default() }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_link_is_fitted_within_its_gap_and_to_the_same_body_again() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, _) = served(dir.path()).await;
    let asked = load(URDF, SRDF, vec![mesh("hand.stl", MeshFormat::Off, CUBE)]);
    let first = client.load_robot_with(asked.clone()).await.expect("loaded");
    let hand = first.links.iter().find(|link| &*link.name == "hand").expect("a hand");
    let (body, gap) = (hand.body.expect("a body"), hand.gap_m.expect("a gap"));
    assert!(gap > 0.0 && gap.is_finite(), "{gap}");
    let again = client.load_robot_with(asked.clone()).await.expect("loaded");
    assert_eq!((again.id, again.created), (first.id, false));
    // The same file as a blob.
    let blob = client.upload(CUBE.as_bytes()).await.expect("a blob");
    let mesh = FitMesh { format: MeshFormat::Off.into(), content: Some(Content::BlobId(blob)) };
    let meshes = vec![LinkMesh { uri: "hand.stl".into(), mesh: Some(mesh) }];
    let of_blob = client.load_robot_with(LoadRobotRequest { meshes, ..asked.clone() }).await.expect("loaded");
    assert_eq!(of_blob.id, first.id);
    // A smaller gap makes another body, and another robot.
    let finer = LoadRobotRequest { max_gap_m: Some(0.5 * gap), ..asked };
    let finer = client.load_robot_with(finer).await.expect("loaded");
    let hand = finer.links.iter().find(|link| &*link.name == "hand").expect("a hand");
    assert!(hand.gap_m.expect("a gap") <= 0.5 * gap && hand.body != Some(body) && finer.id != first.id);
}

/// A wedge as OFF: a right-angled triangle with legs of 0.4 m along x and y, 0.1 m high.
const WEDGE: &str = "OFF\n6 8 0\n0 0 0\n0.4 0 0\n0 0.4 0\n0 0 0.1\n0.4 0 0.1\n0 0.4 0.1\n\
3 0 2 1\n3 3 4 5\n3 0 1 4\n3 0 4 3\n3 0 3 5\n3 0 5 2\n3 1 2 5\n3 1 5 4\n";

/// The wedge mirrored, three times as high, turned by a right angle and 1 m away.
const MIRRORED: &str = r#"<robot name="mirrored">
  <link name="base"/>
  <link name="wedge"><collision><origin xyz="1 0 0" rpy="0 0 1.5707963267948966"/>
    <geometry><mesh filename="wedge.off" scale="1 -1 3"/></geometry></collision></link>
  <joint name="turn" type="continuous"><parent link="base"/><child link="wedge"/><axis xyz="0 0 1"/></joint>
</robot>"#;

#[tokio::test(flavor = "multi_thread")]
async fn mirrored_and_scaled_meshes_are_where_they_should_be() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, _) = served(dir.path()).await;
    let meshes = vec![mesh("wedge.off", MeshFormat::Off, WEDGE)];
    let robot = client.load_robot_with(load(MIRRORED, "", meshes)).await.expect("loaded");
    let gap = robot.links[1].gap_m.expect("a gap");
    assert!(gap > 0.0 && gap.is_finite(), "{gap}");
    client.create_scene("room").await.expect("made");
    client.place_robot("room", &RobotPlacement::new("robot", &robot)).await.expect("placed");
    let ball = client.create_ball("ball", 0.05).await.expect("a ball");
    // The triangle of the mesh has its corners at (0, 0), (0.4, 0) and (0, -0.4) once it is
    // mirrored, and z from 0 to 0.3; a quarter turn takes (x, y) to (-y, x). Places of the centre
    // in the frame of the mesh, with the distance of the ball from the hull.
    let (beyond_the_corner, above) = ([0.0, -0.7, 0.15], [0.1, -0.1, 0.6]);
    let (within, where_the_mesh_would_be_unmirrored) = ([0.1, -0.1, 0.15], [0.1, 0.1, 0.15]);
    for ([x, y, z], expected_m) in [
        (beyond_the_corner, 0.3 - 0.05),
        (above, 0.3 - 0.05),
        (within, 0.0),
        (where_the_mesh_would_be_unmirrored, 0.1 - 0.05),
    ] {
        let place = at(1.0 - y, x, z);
        client.put_objects("room", [("ball", &ball, place)]).await.expect("placed");
        let ask = Question::pairs([("robot/wedge", "ball")]);
        let found = client.evaluate("room", ask, &[Measure::Distance]).await.expect("answered");
        let distance_m = found.rows[0].value.expect("a distance");
        // The body lies around the mesh, and reaches beyond it by its gap.
        let is_right = distance_m <= expected_m + 1e-6 && distance_m >= expected_m - gap - 1e-6;
        assert!(is_right, "{x}, {y}, {z}: {distance_m}, {expected_m} {gap}");
        let ask = StatesQuestion::new(["ball"]).with_states(&[place]);
        let found = client.check_states("room", ask).await.expect("answered");
        let expected = if expected_m == 0.0 { StateVerdict::Contact } else { StateVerdict::Free };
        assert_eq!(found.verdicts, [expected], "{x}, {y}, {z}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn absurd_scales_are_fitted_within_the_gap_or_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, _) = served(dir.path()).await;
    for (scale, most_m) in
        [("1e9 1e9 1e9", 1e9), ("1e-9 1e-9 1e-9", 0.02), ("-1e-9 1 1", 0.02), ("1 1 1e-9", 0.02), ("1e9 1 1e-9", 1e9)]
    {
        let urdf = MIRRORED.replace("1 -1 3", scale);
        let asked = load(&urdf, "", vec![mesh("wedge.off", MeshFormat::Off, WEDGE)]);
        match client.load_robot_with(LoadRobotRequest { max_gap_m: Some(most_m), ..asked }).await {
            Ok(robot) => {
                let gap = robot.links[1].gap_m;
                assert!(gap.is_some_and(|gap| (0.0..=most_m).contains(&gap)), "{scale}: {gap:?}");
            }
            Err(error) => {
                let expected = (Some(Code::InvalidArgument), Some("meshes"));
                assert_eq!((error.code(), error.field().as_deref()), expected, "{scale}: {error}");
                assert!(error.to_string().contains("of link \"wedge\""), "{scale}: {error}");
            }
        }
    }
}

/// A cube with edges of 1 unit of 0.1 m, as COLLADA.
const DAE: &str = r##"<?xml version="1.0"?>
<COLLADA xmlns="http://www.collada.org/2005/11/COLLADASchema" version="1.4.1">
<asset><unit name="decimetre" meter="0.1"/><up_axis>Z_UP</up_axis></asset>
<library_geometries><geometry id="cube"><mesh>
<source id="p"><float_array id="a" count="24">0 0 0 1 0 0 1 1 0 0 1 0 0 0 1 1 0 1 1 1 1 0 1 1</float_array>
<technique_common><accessor source="#a" count="8" stride="3"><param name="X" type="float"/>
<param name="Y" type="float"/><param name="Z" type="float"/></accessor></technique_common></source>
<vertices id="v"><input semantic="POSITION" source="#p"/></vertices>
<triangles count="12"><input semantic="VERTEX" source="#v" offset="0"/>
<p>0 2 1 0 3 2 4 5 6 4 6 7 0 1 5 0 5 4 1 2 6 1 6 5 2 3 7 2 7 6 3 0 4 3 4 7</p></triangles>
</mesh></geometry></library_geometries>
<library_visual_scenes><visual_scene id="s"><node><instance_geometry url="#cube"/></node></visual_scene>
</library_visual_scenes><scene><instance_visual_scene url="#s"/></scene></COLLADA>"##;

/// A cube with edges of 0.1 m, as text STL.
fn stl() -> String {
    let corner = |index: usize| {
        let bit = |axis: usize| if index >> axis & 1 == 1 { 0.1 } else { 0.0 };
        format!("vertex {} {} {}\n", bit(0), bit(1), bit(2))
    };
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]);
    let facet = |corners: [usize; 3]| {
        let corners: String = corners.iter().map(|&index| corner(index)).collect();
        format!("facet normal 0 0 0\nouter loop\n{corners}endloop\nendfacet\n")
    };
    format!("solid cube\n{}endsolid cube\n", triangles.map(facet).collect::<String>())
}

/// An arm like a UR5: six joints that turn, meshes by package, COLLADA.
fn ur5() -> String {
    let names = ["base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"];
    let links = names.map(|name| {
        format!(
            "<link name=\"{name}\"><collision><geometry><mesh filename=\"package://ur/{name}.dae\" \
             scale=\"0.6 0.6 0.6\"/></geometry></collision></link>"
        )
    });
    let axes = ["0 0 1", "0 1 0", "0 1 0", "0 1 0", "0 0 1", "0 1 0"];
    let joints = (1..names.len()).map(|index| {
        format!(
            "<joint name=\"{}_joint\" type=\"revolute\"><parent link=\"{}\"/><child link=\"{}\"/>\
             <origin xyz=\"0 0 0.2\" rpy=\"0 0 0\"/><axis xyz=\"{}\"/>\
             <limit lower=\"-6.28\" upper=\"6.28\" effort=\"1\" velocity=\"1\"/></joint>",
            names[index],
            names[index - 1],
            names[index],
            axes[index - 1]
        )
    });
    format!("<robot name=\"ur5_like\">{}{}</robot>", links.concat(), joints.collect::<String>())
}

/// A mobile robot like a Fetch: a planar base, a lift, continuous joints, a mirrored STL, and a
/// gripper whose second finger mimics the first.
const FETCH: &str = r#"<robot name="fetch_like">
  <link name="world"/>
  <link name="base"><collision><geometry><cylinder radius="0.28" length="0.36"/></geometry></collision></link>
  <link name="torso"><collision><geometry><mesh filename="torso.stl" scale="1 -1 3"/></geometry></collision></link>
  <link name="arm"><collision><geometry><capsule radius="0.06" length="0.4"/></geometry></collision></link>
  <link name="gripper"><collision><geometry><box size="0.06 0.12 0.06"/></geometry></collision></link>
  <link name="left"><collision><geometry><box size="0.06 0.01 0.03"/></geometry></collision></link>
  <link name="right"><collision><geometry><box size="0.06 0.01 0.03"/></geometry></collision></link>
  <joint name="drive" type="planar"><parent link="world"/><child link="base"/><axis xyz="0 0 1"/></joint>
  <joint name="lift" type="prismatic"><parent link="base"/><child link="torso"/><origin xyz="-0.1 0 0.4"/>
    <axis xyz="0 0 1"/><limit lower="0" upper="0.4" effort="1" velocity="1"/></joint>
  <joint name="shoulder" type="continuous"><parent link="torso"/><child link="arm"/>
    <origin xyz="0.3 0 0.3" rpy="0 1.5708 0"/><axis xyz="0 0 1"/></joint>
  <joint name="wrist" type="continuous"><parent link="arm"/><child link="gripper"/><origin xyz="0 0 0.4"/>
    <axis xyz="0 0 1"/></joint>
  <joint name="finger" type="prismatic"><parent link="gripper"/><child link="left"/><origin xyz="0 0.01 0.06"/>
    <axis xyz="0 1 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/></joint>
  <joint name="other" type="prismatic"><parent link="gripper"/><child link="right"/><origin xyz="0 -0.01 0.06"/>
    <axis xyz="0 -1 0"/><limit lower="0" upper="0.05" effort="1" velocity="1"/><mimic joint="finger"/></joint>
</robot>"#;

/// Two arms on one torso, as a Baxter has them, that floats.
fn baxter() -> String {
    let arm = |side: &str, y: f64| {
        format!(
            "<link name=\"{side}_upper\"><collision><origin xyz=\"0.2 0 0\" rpy=\"0 1.5708 0\"/><geometry>\
             <cylinder radius=\"0.06\" length=\"0.3\"/></geometry></collision></link>\
             <link name=\"{side}_fore\"><collision><geometry><sphere radius=\"0.07\"/></geometry></collision></link>\
             <joint name=\"{side}_s0\" type=\"revolute\"><parent link=\"torso\"/><child link=\"{side}_upper\"/>\
             <origin xyz=\"0.1 {y} 0.4\"/><axis xyz=\"0 0 1\"/>\
             <limit lower=\"-1.7\" upper=\"1.7\" effort=\"1\" velocity=\"1\"/></joint>\
             <joint name=\"{side}_e0\" type=\"revolute\"><parent link=\"{side}_upper\"/><child link=\"{side}_fore\"/>\
             <origin xyz=\"0.45 0 0\"/><axis xyz=\"1 0 0\"/>\
             <limit lower=\"-3\" upper=\"3\" effort=\"1\" velocity=\"1\"/></joint>"
        )
    };
    format!(
        "<robot name=\"baxter_like\"><link name=\"world\"/><link name=\"torso\"><collision><geometry>\
         <box size=\"0.2 0.4 0.8\"/></geometry></collision></link>\
         <joint name=\"float\" type=\"floating\"><parent link=\"world\"/><child link=\"torso\"/></joint>{}{}</robot>",
        arm("left", 0.3),
        arm("right", -0.3)
    )
}

/// A unit quaternion of a small turn about a direction that is no axis.
fn turned() -> [f64; 4] {
    let turn = nalgebra::UnitQuaternion::from_scaled_axis(nalgebra::Vector3::new(0.1, -0.05, 0.2));
    turn.coords.into()
}

#[tokio::test(flavor = "multi_thread")]
async fn robots_of_many_kinds_are_loaded_placed_and_checked() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, _clients, _) = served(dir.path()).await;
    let ball = client.create_ball("ball", 0.1).await.expect("a ball");
    let dae = |name: &str| mesh(&format!("package://ur/{name}.dae"), MeshFormat::Dae, DAE);
    let names = ["base", "shoulder", "upper_arm", "forearm", "wrist_1", "wrist_2", "wrist_3"];
    let folded = |width: usize| vec![0.0; width];
    let floating = vec![0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0];
    // Each with a configuration, one that it gets to without contact, and a place in it.
    let driven = vec![0.1, -0.1, 0.2, 0.05, 0.3, -1.0, 0.02];
    let flown = [&[0.05, -0.05, 0.1][..], &turned(), &[0.2, -0.3, 0.1, 0.3]].concat();
    let robots = [
        // The arm stands upright: its wrist is 1.2 m up.
        (ur5(), names.map(dae).to_vec(), folded(6), vec![0.3, 0.1, -0.2, 0.1, 0.4, 0.1], at(0.03, 0.03, 1.23)),
        (FETCH.to_owned(), vec![mesh("torso.stl", MeshFormat::Stl, &stl())], folded(7), driven, at(0.7, 0.0, 0.7)),
        (baxter(), Vec::new(), floating, flown, at(0.55, 0.3, 0.4)),
    ];
    for (index, (urdf, meshes, configuration, goal, place)) in robots.into_iter().enumerate() {
        let robot = client.load_robot_with(load(&urdf, "", meshes)).await.expect("loaded");
        let given: usize = robot.joints.iter().map(|joint| joint.kind.width()).sum();
        assert_eq!((given, given), (configuration.len(), goal.len()), "{}", robot.name);
        let scene = format!("cell {index}");
        client.create_scene(&scene).await.expect("made");
        let base = at(0.0, 0.0, 0.0);
        let joints = NamedJointValues { joints: Vec::new(), values: configuration.clone() };
        let placement = RobotPlacement { name: "robot".into(), robot: robot.id, base, joints };
        client.place_robot(&scene, &placement).await.expect("placed");
        let ask = || StatesQuestion::of_robot("robot", []).with_joint_values(&configuration);
        let alone = client.check_states(&scene, ask()).await.expect("answered");
        assert_eq!(alone.verdicts, [StateVerdict::Free], "{}: {:?}", robot.name, alone.pairs);
        // Beside a ball that is 0.4 m above that place it moves freely, which is proven, and keeps
        // no farther from everything than the pairs at both ends of the way do.
        let above = *place.translation() + nalgebra::Vector3::new(0.0, 0.0, 0.4);
        client.put_objects(&scene, [("ball", &ball, place.with_translation(above))]).await.expect("placed");
        let edge = [configuration.clone(), goal];
        let question = || MotionsQuestion::of_robot("robot", []).with_edges(&edge);
        let found = client.check_motions(&scene, question().with_certificates()).await.expect("answered");
        assert!(found.are_free() && found.complete, "{}: {found:?}", robot.name);
        let clearance = ClearanceQuestion::of_robot("robot", [], 0.5).with_configurations(&edge);
        let near = client.clearance(&scene, clearance).await.expect("answered");
        for state in &near.states {
            let row = state.closest_to("ball").expect("the ball is near");
            assert!(state.checked && row.lower_m > 0.05 && row.upper_m < 0.5, "{}: {row:?}", robot.name);
            let gradient = row.joint_gradient.as_ref().expect("a gradient");
            assert!(gradient.len() == given && gradient.iter().any(|slope| slope.abs() > 1e-3), "{row:?}");
            let closest = state.closest().expect("a pair");
            assert!(found.motions[0].clearance_lower_m <= closest.upper_m + 1e-9, "{}: {closest:?}", robot.name);
        }
        let certificate = found.motions[0].certificate.clone().expect("a certificate");
        let certificate = || CertificateQuestion::new(certificate.clone());
        let alone = client.verify_motion(certificate()).await.expect("answered").proof;
        assert!(alone.as_ref().is_ok_and(|proof| proof.clearance_lower_m > 0.0), "{}: {alone:?}", robot.name);
        let verify = || certificate().of_robot(&scene, "robot");
        assert_eq!(client.verify_motion(verify()).await.expect("answered").proof, alone, "{}", robot.name);
        // In the way it is met, on the edge as well, and the certificate holds no more.
        client.put_objects(&scene, [("ball", &ball, place)]).await.expect("placed");
        let met = client.check_states(&scene, ask()).await.expect("answered");
        assert_eq!(met.verdicts, [StateVerdict::Contact], "{}", robot.name);
        let met = client.check_motions(&scene, question()).await.expect("answered");
        assert_eq!(met.verdicts(), [StateVerdict::Contact], "{}", robot.name);
        let refused = client.verify_motion(verify()).await.expect("answered").proof.expect_err("the ball has moved");
        assert!(refused.contains("obstacles"), "{refused}");
    }
}
