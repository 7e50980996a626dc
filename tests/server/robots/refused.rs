//! What is refused, with the field that is wrong.

use std::time::{Duration, Instant};

use sublevel::service::proto::fit_mesh::Content;
use sublevel::service::proto::{
    Attach, Attachment, CheckStatesRequest, ClearanceRequest, DeleteRobotRequest, FitMesh, GetRobotRequest,
    JointValues, LinkBody, LinkMesh, ListRobotsRequest, LoadRobotRequest, MeshFormat, Object, RobotInstance, SetJoints,
    SetRobotBase, StreamPosesRequest, UpdateSceneRequest,
};
use sublevel::store::RobotSource;
use tonic::{Code, Status};

use super::{CUBE, SRDF, URDF, cell, served};
use crate::harness::{at, field, moved, object, pose, reason, rows};

fn check(status: &Status, code: Code, at: &str) {
    assert_eq!((status.code(), field(status).as_str()), (code, at), "{}", status.message());
    assert!(status.message().len() > 20 && !reason(status).is_empty(), "{}", status.message());
}

fn packed(values: &[f64]) -> bytes::Bytes {
    values.iter().flat_map(|value| value.to_le_bytes()).collect::<Vec<_>>().into()
}

#[tokio::test(flavor = "multi_thread")]
async fn loads() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, _) = served(dir.path()).await;
    let ball = clients.put(&crate::harness::ball(0.1)).await;
    let normal = nalgebra::Vector3::z();
    let plane = sublevel::client::BodySource::HalfSpace { normal, offset: 0.0 };
    let plane = client.create_body("floor", plane).await.expect("a plane").id.to_string();
    let body = |link: &str, id: &str| LinkBody { link: link.into(), body_id: id.into() };
    let load = |urdf: &str, link_bodies: Vec<LinkBody>| LoadRobotRequest {
        urdf: urdf.into(),
        srdf: SRDF.into(),
        link_bodies,
        ..Default::default()
    };
    let mesh = |uri: &str, format: MeshFormat, file: &str| LinkMesh {
        uri: uri.into(),
        mesh: Some(FitMesh { format: format.into(), content: Some(Content::File(file.as_bytes().to_vec().into())) }),
    };
    let meshes = |meshes: Vec<LinkMesh>| LoadRobotRequest { meshes, ..load(URDF, vec![]) };
    let (stl, off) = (MeshFormat::Stl, MeshFormat::Off);
    let blob = |uri: &str, id: &str| LinkMesh {
        uri: uri.into(),
        mesh: Some(FitMesh { format: off.into(), content: Some(Content::BlobId(id.into())) }),
    };
    let hand = || body("hand", &ball);
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let cases = [
        (load("", vec![]), invalid, "urdf"),
        (load("<robot", vec![]), invalid, "urdf"),
        (load(&URDF.replace("radius=\"0.05\"", "radius=\"-1\""), vec![hand()]), invalid, "urdf"),
        (LoadRobotRequest { srdf: "<robot".into(), ..load(URDF, vec![hand()]) }, invalid, "srdf"),
        (load(URDF, vec![]), invalid, "link_bodies"),
        (load(&URDF.replace("hand.stl", "package://tools/hand.stl"), vec![]), invalid, "link_bodies"),
        (load(URDF, vec![hand(), hand()]), invalid, "link_bodies[1].link"),
        (load(URDF, vec![hand(), body("foot", &ball)]), invalid, "link_bodies[1].link"),
        (load(URDF, vec![body("hand", "ball")]), invalid, "link_bodies[0].body_id"),
        (load(URDF, vec![body("hand", &plane)]), invalid, "link_bodies[0].body_id"),
        (load(URDF, vec![body("hand", &"0".repeat(64))]), missing, "link_bodies[0].body_id"),
        (meshes(vec![mesh("foot.stl", stl, "")]), invalid, "meshes"),
        (
            LoadRobotRequest {
                urdf: URDF.replace("hand.stl", "package://tools/hand.stl"),
                ..meshes(vec![mesh("hand.stl", off, CUBE)])
            },
            invalid,
            "meshes",
        ),
        (meshes(vec![mesh("hand.stl", stl, "not a mesh")]), invalid, "meshes[0].mesh"),
        (meshes(vec![mesh("hand.stl", MeshFormat::Unspecified, "")]), invalid, "meshes[0].mesh.format"),
        (meshes(vec![mesh("hand.stl", off, CUBE), mesh("hand.stl", off, CUBE)]), invalid, "meshes[1].uri"),
        (meshes(vec![mesh("hand.stl", off, CUBE), mesh("foot.stl", off, CUBE)]), invalid, "meshes[1].uri"),
        (LoadRobotRequest { max_gap_m: Some(-1.0), ..load(URDF, vec![hand()]) }, invalid, "max_gap_m"),
        (
            LoadRobotRequest { max_gap_m: Some(f64::NAN), ..meshes(vec![mesh("hand.stl", off, CUBE)]) },
            invalid,
            "max_gap_m",
        ),
        (meshes(vec![LinkMesh { uri: "hand.stl".into(), mesh: None }]), invalid, "meshes[0].mesh"),
        (meshes(vec![blob("hand.stl", &"0".repeat(64))]), missing, "meshes[0].mesh.blob_id"),
    ];
    for (request, code, at) in cases {
        check(&clients.robots.load_robot(request).await.expect_err("refused"), code, at);
    }
    let error = clients.robots.load_robot(load(URDF, vec![])).await.expect_err("refused");
    assert!(error.message().contains("hand.stl") && error.message().contains("fit a body"), "{}", error.message());
    assert_eq!(client.list_robots().await.expect("listed").len(), 1);
}

/// A finger more, which follows the one that follows the slide.
const NAIL: &str = r#"<link name="nail"/><joint name="clip" type="prismatic"><parent link="hand"/><child link="nail"/>
  <limit lower="0" upper="1"/><mimic joint="grip"/></joint></robot>"#;

#[tokio::test(flavor = "multi_thread")]
async fn texts_that_describe_no_robot() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, _) = served(dir.path()).await;
    let ball = clients.put(&crate::harness::ball(0.1)).await;
    let cases = [
        ("</robot>", "<x:arm xmlns:x=\"http://www.ros.org/wiki/xacro\"/></robot>", "run xacro first"),
        ("radius=\"0.05\"", "radius=\"${thick}\"", "run xacro first"),
        ("<parent link=\"post\"/>", "<parent link=\"finger\"/>", "form a cycle"),
        ("</robot>", "<link name=\"lost\"/></robot>", "2 links have no parent"),
        ("<child link=\"finger\"/>", "<child link=\"arm\"/>", "child of two joints"),
        ("<child link=\"finger\"/>", "<child link=\"thumb\"/>", "no link of this name"),
        ("hand.stl\"", "hand.stl\" scale=\"1 0 1\"", "scale holds 0.0"),
        ("hand.stl\"", "hand.stl\" scale=\"1 1e10 1\"", "1e-9 to 1e9"),
        ("hand.stl\"", "hand.stl\" scale=\"1 nan 1\"", "not finite"),
        ("hand.stl\"", " \"", "filename is empty"),
        ("radius=\"0.02\"", "radius=\"0\"", "radius holds 0.0"),
        ("radius=\"0.02\"", "radius=\"1e7\"", "at most 1e6"),
        ("lower=\"-2\" upper=\"2\"", "lower=\"2\" upper=\"-2\"", "above upper"),
        ("upper=\"0.2\"", "upper=\"inf\"", "not finite"),
        ("joint=\"slide\" multiplier", "joint=\"grip\" multiplier", "follows itself"),
        ("</robot>", NAIL, "write joint=\"slide\" multiplier=\"0.5\""),
    ];
    for (from, to, says) in cases {
        assert!(URDF.contains(from), "{from}");
        let hand = LinkBody { link: "hand".into(), body_id: ball.clone() };
        let urdf = URDF.replacen(from, to, 1);
        let request = LoadRobotRequest { urdf, link_bodies: vec![hand], ..Default::default() };
        let status = clients.robots.load_robot(request).await.expect_err(to);
        check(&status, Code::InvalidArgument, "urdf");
        let said = status.message();
        assert!(said.starts_with("urdf: line ") && said.contains(says), "{to}: {said}");
    }
    assert_eq!(client.list_robots().await.expect("listed").len(), 1);
}

/// Comparing each with all others would take more than a minute.
#[tokio::test(flavor = "multi_thread")]
async fn many_files_that_no_link_has_are_refused_at_once() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, _client, mut clients, _) = served(dir.path()).await;
    let meshes = (0..300_000).map(|index| LinkMesh { uri: format!("{index:05x}"), mesh: None });
    let request = LoadRobotRequest { urdf: URDF.into(), meshes: meshes.collect(), ..Default::default() };
    let begun = Instant::now();
    let status = clients.robots.load_robot(request).await.expect_err("none is that of the hand");
    check(&status, Code::InvalidArgument, "meshes");
    assert!(status.message().contains("hand.stl"), "{}", status.message());
    assert!(begun.elapsed() < Duration::from_secs(10), "{:?}", begun.elapsed());
}

#[tokio::test(flavor = "multi_thread")]
async fn ids_and_pages() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let (nobody, half) = (format!("{:064x}", 7), robot.id.to_string()[..32].to_owned());
    for (id, code) in [("", invalid), ("crane", invalid), (half.as_str(), invalid), (nobody.as_str(), missing)] {
        let get = clients.robots.get_robot(GetRobotRequest { id: id.into() }).await;
        check(&get.expect_err("no robot"), code, "id");
        let delete = clients.robots.delete_robot(DeleteRobotRequest { id: id.into() }).await;
        check(&delete.expect_err("no robot"), code, "id");
    }
    let list = ListRobotsRequest { page_size: 1, page_token: "next".into() };
    check(&clients.robots.list_robots(list).await.expect_err("no token"), invalid, "page_token");
    let hand = robot.links.iter().find(|link| link.name == "hand").and_then(|link| link.body).expect("a body");
    let renamed = |text: &str| text.replace("\"crane\"", "\"derrick\"");
    let other = RobotSource { urdf: renamed(URDF), srdf: renamed(SRDF), bodies: [("hand".into(), hand)].into() };
    client.load_robot(&other).await.expect("loaded");
    let (mut names, mut page_token) = (Vec::new(), String::new());
    for is_last in [false, true] {
        let page = clients.robots.list_robots(ListRobotsRequest { page_size: 1, page_token }).await;
        let page = page.expect("a page").into_inner();
        names.extend(page.robots.into_iter().map(|robot| robot.name));
        page_token = page.next_page_token;
        assert_eq!(page_token.is_empty(), is_last, "{names:?}");
    }
    names.sort();
    assert_eq!(names, ["crane", "derrick"]);
}

#[tokio::test(flavor = "multi_thread")]
async fn updates() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let before = clients.scene("cell").await;
    let ball = clients.put(&crate::harness::ball(0.1)).await;
    let update = || UpdateSceneRequest { scene: "cell".into(), ..Default::default() };
    let values = |joints: &[&str], values: &[f64]| JointValues {
        joints: joints.iter().map(|&name| name.into()).collect(),
        values: packed(values),
        rows: Vec::new(),
    };
    let set = |robot: &str, values: JointValues| UpdateSceneRequest {
        set_joints: vec![SetJoints { robot: robot.into(), joints: Some(values) }],
        ..update()
    };
    let base =
        |base| UpdateSceneRequest { set_robot_bases: vec![SetRobotBase { robot: "one".into(), base }], ..update() };
    let place = |placed: RobotInstance| UpdateSceneRequest { place_robots: vec![placed], ..update() };
    let attach = |object: &str, to: &str| {
        let attachment = Attachment { to: to.into(), pose: Some(at(0.0)), touch: Vec::new() };
        let attach = Attach { object: object.into(), attachment: Some(attachment) };
        UpdateSceneRequest { attach: vec![attach], ..update() }
    };
    let id = robot.id.to_string();
    let instance = || RobotInstance { name: "three".into(), robot_id: id.clone(), base: Some(at(9.0)), joints: None };
    let both = JointValues { rows: vec![0.0], ..values(&["lift"], &[0.0]) };
    let of_link = Object { robot: "one".into(), ..object("x", &ball, at(0.0)) };
    let held = Attachment { to: "two/flange".into(), pose: Some(at(0.0)), touch: Vec::new() };
    let of_frame = Object { pose: None, attachment: Some(held), ..object("x", &ball, at(0.0)) };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let cases = [
        (set("five", values(&[], &[0.0; 2])), missing, "set_joints[0].robot"),
        (set("one", values(&[], &[0.0; 3])), invalid, "set_joints[0].joints.values"),
        (set("one", values(&["lift"], &[2.1])), invalid, "set_joints[0].joints.values"),
        (set("one", values(&["lift"], &[f64::NAN])), invalid, "set_joints[0].joints.values"),
        (set("one", values(&["slide", "grip"], &[0.0; 2])), invalid, "set_joints[0].joints.joints[1]"),
        (set("one", values(&["lift", "lift"], &[0.0; 2])), invalid, "set_joints[0].joints.joints[1]"),
        (set("one", both), invalid, "set_joints[0].joints.rows"),
        (place(RobotInstance { robot_id: "crane".into(), ..instance() }), invalid, "place_robots[0].robot_id"),
        (place(RobotInstance { robot_id: "0".repeat(64), ..instance() }), missing, "place_robots[0].robot_id"),
        (place(RobotInstance { base: None, ..instance() }), invalid, "place_robots[0].base"),
        (
            place(RobotInstance { base: Some(pose([0.0; 3], [0.0, 0.0, 0.0, f64::NAN])), ..instance() }),
            invalid,
            "place_robots[0].base.rotation.w",
        ),
        (place(RobotInstance { name: String::new(), ..instance() }), invalid, "place_robots[0].name"),
        (
            place(RobotInstance { joints: Some(values(&["slide"], &[1.0])), ..instance() }),
            invalid,
            "place_robots[0].joints.values",
        ),
        (
            UpdateSceneRequest { place_robots: vec![instance(), instance()], ..update() },
            invalid,
            "place_robots[1].name",
        ),
        (
            UpdateSceneRequest {
                set_robot_bases: vec![SetRobotBase { robot: "five".into(), base: Some(at(0.0)) }],
                ..update()
            },
            missing,
            "set_robot_bases[0].robot",
        ),
        (base(None), invalid, "set_robot_bases[0].base"),
        (base(Some(at(f64::INFINITY))), invalid, "set_robot_bases[0].base.translation_m.x"),
        (base(Some(at(1.1e15))), invalid, "set_robot_bases[0].base.translation_m"),
        (base(Some(pose([0.0; 3], [0.0, 0.0, 0.0, 2.0]))), invalid, "set_robot_bases[0].base.rotation"),
        (UpdateSceneRequest { remove_robots: vec!["five".into()], ..update() }, missing, "remove_robots[0]"),
        (UpdateSceneRequest { remove_objects: vec!["two/arm".into()], ..update() }, invalid, "remove_objects[0]"),
        (UpdateSceneRequest { detach: vec!["two/arm".into()], ..update() }, invalid, "detach[0]"),
        (attach("two/arm", "two/arm"), invalid, "attach[0].object"),
        (attach("two/arm", "two/hand"), invalid, "attach[0].object"),
        (attach("post", "post"), invalid, "attach[0].attachment.to"),
        (attach("post", "two/flange"), invalid, "attach[0].attachment.to"),
        (attach("post", "two/tool"), missing, "attach[0].attachment.to"),
        (attach("post", ""), invalid, "attach[0].attachment.to"),
        (attach("beam", "two/hand"), missing, "attach[0].object"),
        (
            UpdateSceneRequest { set_poses: rows(vec![moved("two/arm", at(0.0))]), ..update() },
            invalid,
            "set_poses[0].name",
        ),
        (
            UpdateSceneRequest { upsert_objects: vec![object("two/arm", &ball, at(0.0))], ..update() },
            invalid,
            "upsert_objects[0].name",
        ),
        (UpdateSceneRequest { upsert_objects: vec![of_link], ..update() }, invalid, "upsert_objects[0].robot"),
        (UpdateSceneRequest { upsert_objects: vec![of_frame], ..update() }, invalid, "upsert_objects[0].attachment.to"),
    ];
    for (request, code, at) in cases {
        check(&clients.scenes.update_scene(request).await.expect_err(at), code, at);
    }
    let frame = clients.scenes.update_scene(attach("post", "two/flange")).await.expect_err("a frame");
    let why = "link \"flange\" of robot \"two\" has no geometry; attach to \"two/arm\" with the pose in its frame";
    assert_eq!(frame.message(), format!("attach[0].attachment.to: {why}"));
    let holds = UpdateSceneRequest { remove_robots: vec!["one".into()], ..update() };
    let refused = clients.scenes.update_scene(holds).await.expect_err("it holds something");
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::FailedPrecondition, "OBJECT_HOLDS"));
    let message = StreamPosesRequest { scene: "cell".into(), names: vec!["two/arm".into()], ..Default::default() };
    let mut answers = clients.scenes.stream_poses(tokio_stream::iter([message])).await.expect("a stream").into_inner();
    let answer = answers.message().await.expect("an answer").expect("one");
    assert_eq!(answer.error.map(|error| error.field).as_deref(), Some("names[0]"));
    let after = clients.scene("cell").await;
    assert_eq!((&after.objects, &after.robots), (&before.objects, &before.robots));
}

#[tokio::test(flavor = "multi_thread")]
async fn questions() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, client, mut clients, robot) = served(dir.path()).await;
    cell(&client, &robot).await;
    let ask = |robot: &str, joints: &[&str], values: &[f64]| CheckStatesRequest {
        scene: "cell".into(),
        robot: robot.into(),
        joints: joints.iter().map(|&name| name.into()).collect(),
        joint_values: packed(values),
        ..Default::default()
    };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let cases = [
        (ask("five", &[], &[0.0; 2]), missing, "robot"),
        (ask("", &[], &[0.0; 2]), invalid, "robot"),
        (CheckStatesRequest { objects: vec!["post".into()], ..ask("one", &[], &[0.0; 2]) }, invalid, "robot"),
        (CheckStatesRequest { poses: packed(&[0.0; 7]), ..ask("one", &[], &[0.0; 2]) }, invalid, "robot"),
        (ask("one", &[], &[0.0; 3]), invalid, "joint_values"),
        (ask("one", &[], &[]), invalid, "joint_values"),
        (ask("one", &["lift", "grip"], &[0.0; 2]), invalid, "joints[1]"),
        (ask("one", &["lift", "lift"], &[0.0; 2]), invalid, "joints[1]"),
        (
            CheckStatesRequest { joint_values: bytes::Bytes::from_static(&[0; 9]), ..ask("one", &[], &[]) },
            invalid,
            "joint_values",
        ),
    ];
    for (request, code, at) in cases {
        let CheckStatesRequest { scene, robot, joints, joint_values, objects, poses, .. } = request.clone();
        check(&clients.queries.check_states(request).await.expect_err(at), code, at);
        let same = ClearanceRequest { scene, robot, joints, joint_values, objects, poses, ..Default::default() };
        check(&clients.queries.clearance(same).await.expect_err(at), code, at);
    }
    let many = ask("one", &["lift"], &vec![0.0; (1 << 16) + 1]);
    check(&clients.queries.check_states(many).await.expect_err("too many"), Code::ResourceExhausted, "joint_values");
}
