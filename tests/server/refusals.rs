//! What the server refuses: each bad request gets its code, names its field, and leaves everything
//! as it was.

use crate::harness::{Clients, Running, at, field, moved, object, pair, pose, reason};
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::service::proto::{
    Accuracy, CreateBodyRequest, CreateSceneRequest, DeleteBodyRequest, DeleteSceneRequest, EvaluateRequest,
    GetBodyRequest, GetSceneRequest, ListBodiesRequest, Measure, Object, ObjectPose, Pose, UpdateSceneRequest,
};
use tonic::{Code, Status};

async fn room() -> (tempfile::TempDir, Running, Clients, String) {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&Body::ball("ball", Vector3::zeros(), 1.0).expect("a ball")).await;
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &id, at(0.0)), object("b", &id, at(3.0))];
    clients.update(UpdateSceneRequest { name: "room".into(), upsert_objects, ..Default::default() }).await;
    (dir, server, clients, id)
}

fn check(status: &Status, code: Code, at: &str) {
    assert_eq!((status.code(), field(status).as_str()), (code, at), "{}", status.message());
    assert!(status.message().len() > 20 && !reason(status).is_empty(), "{}", status.message());
}

#[tokio::test(flavor = "multi_thread")]
async fn scene_updates() {
    let (_dir, _server, mut clients, id) = room().await;
    let before = clients.scene("room").await;
    let update = || UpdateSceneRequest { name: "room".into(), ..Default::default() };
    let upsert = |object: Object| UpdateSceneRequest { upsert_objects: vec![object], ..update() };
    let set = |pose: Pose| UpdateSceneRequest { set_poses: vec![moved("a", at(1.0)), moved("b", pose)], ..update() };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let unit = [0.0, 0.0, 0.0, 1.0];
    let unknown = "0".repeat(64);
    let cases = [
        (UpdateSceneRequest { name: "elsewhere".into(), ..update() }, missing, "name"),
        (UpdateSceneRequest { name: String::new(), ..update() }, invalid, "name"),
        (upsert(object("c", &unknown, at(0.0))), missing, "upsert_objects[0].body_id"),
        (upsert(object("c", "chair", at(0.0))), invalid, "upsert_objects[0].body_id"),
        (upsert(object("", &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(object("two\nlines", &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(object(&"x".repeat(129), &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(Object { pose: None, ..object("c", &id, at(0.0)) }), invalid, "upsert_objects[0].pose"),
        (upsert(Object { group: "g".repeat(129), ..object("c", &id, at(0.0)) }), invalid, "upsert_objects[0].group"),
        (set(pose([f64::NAN, 0.0, 0.0], unit)), invalid, "set_poses[1].pose.translation_m.x"),
        (set(pose([0.0, f64::INFINITY, 0.0], unit)), invalid, "set_poses[1].pose.translation_m.y"),
        (set(pose([0.0; 3], [0.0, 0.0, f64::NAN, 1.0])), invalid, "set_poses[1].pose.rotation.z"),
        (set(pose([0.0; 3], [0.0, 0.0, 0.0, 1.00001])), invalid, "set_poses[1].pose.rotation"),
        (set(pose([0.0; 3], [0.0; 4])), invalid, "set_poses[1].pose.rotation"),
        (set(pose([0.0; 3], [1e200; 4])), invalid, "set_poses[1].pose.rotation"),
        (set(Pose { rotation: None, ..at(0.0) }), invalid, "set_poses[1].pose.rotation"),
        (set(Pose { translation_m: None, ..at(0.0) }), invalid, "set_poses[1].pose.translation_m"),
        (UpdateSceneRequest { set_poses: vec![moved("z", at(0.0))], ..update() }, missing, "set_poses[0].name"),
        (UpdateSceneRequest { remove_objects: vec!["z".into()], ..update() }, missing, "remove_objects[0]"),
        (UpdateSceneRequest { remove_objects: vec!["a".into(), "a".into()], ..update() }, invalid, "remove_objects[1]"),
        (UpdateSceneRequest { allow_pairs: vec![pair("a", "z")], ..update() }, missing, "allow_pairs[0]"),
        (UpdateSceneRequest { forbid_pairs: vec![pair("a", "a")], ..update() }, invalid, "forbid_pairs[0]"),
    ];
    for (request, code, at) in cases {
        // A refused update changes nothing, so the good half of it must not be seen either.
        let request =
            UpdateSceneRequest { allow_pairs: [vec![pair("a", "b")], request.allow_pairs].concat(), ..request };
        let at = at.replace("allow_pairs[0]", "allow_pairs[1]");
        let status = clients.scenes.update_scene(request).await.expect_err(&at);
        check(&status, code, &at);
    }
    let stale = UpdateSceneRequest { expected_revision: Some(before.revision - 1), ..update() };
    let stale = clients.scenes.update_scene(stale).await.expect_err("stale");
    assert_eq!((stale.code(), reason(&stale).as_str()), (Code::FailedPrecondition, "REVISION_MISMATCH"));
    assert!(stale.message().contains(&before.revision.to_string()));

    let upsert_objects = (0..5000).map(|i| object(&format!("o{i}"), &id, at(0.0))).collect();
    let full = clients.scenes.update_scene(UpdateSceneRequest { upsert_objects, ..update() }).await.expect_err("full");
    assert_eq!((full.code(), reason(&full).as_str()), (Code::FailedPrecondition, "SCENE_FULL"));

    assert_eq!(clients.scene("room").await, before);
    let rounded = set(pose([0.0; 3], [0.0, 0.0, 0.0, 1.0 + 5e-7]));
    clients.update(rounded).await;
    let w = clients.scene("room").await.objects[1].pose.as_ref().and_then(|pose| pose.rotation).expect("a rotation").w;
    assert_eq!(w, 1.0, "normalised");
}

#[tokio::test(flavor = "multi_thread")]
async fn scenes_and_bodies() {
    let (_dir, _server, mut clients, _) = room().await;
    let create = |name: &str| CreateSceneRequest { name: name.into() };
    let taken = clients.scenes.create_scene(create("room")).await.expect_err("taken");
    assert_eq!((taken.code(), reason(&taken).as_str()), (Code::AlreadyExists, "SCENE_EXISTS"));
    check(&clients.scenes.create_scene(create("")).await.expect_err("empty"), Code::InvalidArgument, "name");
    check(
        &clients.scenes.get_scene(GetSceneRequest { name: "hall".into() }).await.expect_err("unknown"),
        Code::NotFound,
        "name",
    );
    check(
        &clients.scenes.delete_scene(DeleteSceneRequest { name: "hall".into() }).await.expect_err("unknown"),
        Code::NotFound,
        "name",
    );

    let get = |id: String| GetBodyRequest { id };
    check(&clients.bodies.get_body(get("0".repeat(64))).await.expect_err("unknown"), Code::NotFound, "id");
    check(&clients.bodies.get_body(get("chair".into())).await.expect_err("no id"), Code::InvalidArgument, "id");
    check(
        &clients.bodies.delete_body(DeleteBodyRequest { id: "0".repeat(64) }).await.expect_err("unknown"),
        Code::NotFound,
        "id",
    );
    let list = ListBodiesRequest { page_size: 1, page_token: "next".into() };
    check(&clients.bodies.list_bodies(list).await.expect_err("no token"), Code::InvalidArgument, "page_token");

    let good = Body::ball("other", Vector3::zeros(), 2.0).expect("a ball").to_json();
    let truncated = good[..good.len() / 2].to_owned();
    let edited = |path: &str, value: f64| {
        let mut file: serde_json::Value = serde_json::from_str(&good).expect("JSON");
        *file.pointer_mut(path).expect("such a key") = value.into();
        file.to_string()
    };
    let coefficient = edited("/constraints/0/coefficients/0", 1.0 + 1e-15);
    let (center, volume) = (edited("/normalization/center/1", 1e-300), edited("/volume_m3", 33.0));
    for bad in [String::new(), "{}".into(), truncated, coefficient, center, volume, "\u{0}".into()] {
        assert_ne!(bad, good);
        let status = clients.bodies.create_body(CreateBodyRequest { body_file_json: bad.into_bytes().into() }).await;
        check(&status.expect_err("refused"), Code::InvalidArgument, "body_file_json");
    }
    let status = clients.bodies.create_body(CreateBodyRequest { body_file_json: vec![0xff, 0xfe].into() }).await;
    check(&status.expect_err("refused"), Code::InvalidArgument, "body_file_json");
    let listed = clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list").into_inner();
    assert_eq!(listed.bodies.len(), 1, "nothing was stored");
}

#[tokio::test(flavor = "multi_thread")]
async fn queries() {
    let (_dir, _server, mut clients, _) = room().await;
    let distance = || EvaluateRequest {
        scene: "room".into(),
        pairs: vec![pair("a", "b")],
        measures: vec![Measure::Distance.into()],
        ..EvaluateRequest::default()
    };
    let accurate = |accuracy| EvaluateRequest { accuracy: Some(accuracy), ..distance() };
    let over = |pose_overrides| EvaluateRequest { pose_overrides, ..distance() };
    let relative = |number| Accuracy { distance_relative: Some(number), level_relative: None };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let cases = [
        (EvaluateRequest { scene: "hall".into(), ..distance() }, missing, "scene"),
        (EvaluateRequest { scene: String::new(), ..distance() }, invalid, "scene"),
        (EvaluateRequest { pairs: vec![], ..distance() }, invalid, "pairs"),
        (EvaluateRequest { pairs: vec![pair("a", "z")], ..distance() }, missing, "pairs[0].b"),
        (EvaluateRequest { pairs: vec![pair("a", "b"), pair("", "b")], ..distance() }, invalid, "pairs[1].a"),
        (EvaluateRequest { pairs: vec![pair("a", "a")], ..distance() }, invalid, "pairs[0]"),
        (EvaluateRequest { pairs: vec![pair("a", "b"); 4097], ..distance() }, invalid, "pairs"),
        (EvaluateRequest { measures: vec![], ..distance() }, invalid, "measures"),
        (EvaluateRequest { measures: vec![0], ..distance() }, invalid, "measures[0]"),
        (EvaluateRequest { measures: vec![77], ..distance() }, invalid, "measures[0]"),
        (EvaluateRequest { measures: vec![1, 1], ..distance() }, invalid, "measures[1]"),
        (accurate(relative(0.0)), invalid, "accuracy.distance_relative"),
        (accurate(relative(f64::NAN)), invalid, "accuracy.distance_relative"),
        (
            accurate(Accuracy { distance_relative: None, level_relative: Some(-1e-9) }),
            invalid,
            "accuracy.level_relative",
        ),
        (over(vec![moved("z", at(0.0))]), missing, "pose_overrides[0].name"),
        (over(vec![moved("a", at(0.0)), moved("a", at(1.0))]), invalid, "pose_overrides[1].name"),
        (over(vec![moved("a", at(f64::NAN))]), invalid, "pose_overrides[0].pose.translation_m.x"),
        (over(vec![ObjectPose { name: "a".into(), pose: None }]), invalid, "pose_overrides[0].pose"),
    ];
    for (request, code, at) in cases {
        let status = clients.queries.evaluate(request).await.expect_err(at);
        check(&status, code, at);
    }
    let most = EvaluateRequest { pairs: vec![pair("a", "b"); 4096], ..distance() };
    let results = clients.queries.evaluate(most).await.expect("the limit itself is fine").into_inner().results;
    assert_eq!(results.len(), 4096);
    assert_eq!(results.last().map(|result| result.pair_index), Some(4095));
}

#[tokio::test(flavor = "multi_thread")]
async fn oversized_messages() {
    let (_dir, _server, mut clients, _) = room().await;
    let body_file_json = vec![b' '; (4 << 20) + 1].into();
    let status = clients.bodies.create_body(CreateBodyRequest { body_file_json }).await.expect_err("too large");
    assert_eq!(status.code(), Code::OutOfRange, "{}", status.message());
    assert_eq!(clients.scene("room").await.objects.len(), 2, "the server goes on");
}

#[tokio::test(flavor = "multi_thread")]
async fn long_names_do_not_break_the_answer() {
    let (_dir, _server, mut clients, _) = room().await;
    let name = "x".repeat(1 << 20);
    check(
        &clients.scenes.get_scene(GetSceneRequest { name: name.clone() }).await.expect_err("long"),
        Code::InvalidArgument,
        "name",
    );
    let get = GetBodyRequest { id: name.clone() };
    check(&clients.bodies.get_body(get).await.expect_err("long"), Code::InvalidArgument, "id");
    let body_file_json = format!("{{\"format\": \"{name}\"}}").into_bytes().into();
    let status = clients.bodies.create_body(CreateBodyRequest { body_file_json }).await.expect_err("long");
    check(&status, Code::InvalidArgument, "body_file_json");
}
