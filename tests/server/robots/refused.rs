//! What is refused, with the field that is wrong.

use sublevel::service::proto::fit_mesh::Content;
use sublevel::service::proto::{
    Attach, Attachment, CheckStatesRequest, ClearanceRequest, FitMesh, JointValues, LinkBody, LinkMesh,
    LoadRobotRequest, MeshFormat, Object, RobotInstance, SetJoints, SetRobotBase, StreamPosesRequest,
    UpdateSceneRequest,
};
use tonic::{Code, Status};

use super::{CUBE, SRDF, URDF, cell, served};
use crate::harness::{at, field, moved, object, reason, rows};

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
        (load(URDF, vec![hand(), hand()]), invalid, "link_bodies[1].link"),
        (load(URDF, vec![hand(), body("foot", &ball)]), invalid, "link_bodies[1].link"),
        (load(URDF, vec![body("hand", "ball")]), invalid, "link_bodies[0].body_id"),
        (load(URDF, vec![body("hand", &plane)]), invalid, "link_bodies[0].body_id"),
        (load(URDF, vec![body("hand", &"0".repeat(64))]), missing, "link_bodies[0].body_id"),
        (meshes(vec![mesh("foot.stl", stl, "")]), invalid, "meshes"),
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
        (
            UpdateSceneRequest { set_robot_bases: vec![SetRobotBase { robot: "one".into(), base: None }], ..update() },
            invalid,
            "set_robot_bases[0].base",
        ),
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
