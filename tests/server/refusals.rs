//! What the server refuses: each bad request gets its code, names its field, and leaves everything
//! as it was.

use crate::harness::{
    Clients, Running, at, body_file, field, moved, object, pair, pose, question, reason, rows, subjects,
};
use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::service::proto::create_body_request::Source;
use sublevel::service::proto::evaluate_request::Question;
use sublevel::service::proto::{
    self, Attach, Attachment, BallSize, BoxSize, CapsuleSize, CastRaysRequest, CheckStatesRequest, ClearanceRequest,
    CreateBodyRequest, CreateSceneRequest, CylinderSize, DeleteBodyRequest, DeleteSceneRequest, EllipsoidSize,
    EvaluateRequest, EvaluateStreamRequest, ExplainRequest, GetBodyRequest, GetSceneRequest, HalfSpaceSize,
    LadderRungs, Layout, ListBodiesRequest, Measure, MeasureAccuracy, Object, ObjectPair, ObjectPose, PairList, Pose,
    Selection, UpdateSceneRequest, WithinMargin, evaluate_stream_response,
};
use tonic::{Code, Status};

async fn room() -> (tempfile::TempDir, Running, Clients, String) {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&Body::ball("ball", Vector3::zeros(), 1.0).expect("a ball")).await;
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &id, at(0.0)), object("b", &id, at(3.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
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
    let update = || UpdateSceneRequest { scene: "room".into(), ..Default::default() };
    let upsert = |object: Object| UpdateSceneRequest { upsert_objects: vec![object], ..update() };
    let set =
        |pose: Pose| UpdateSceneRequest { set_poses: rows(vec![moved("a", at(1.0)), moved("b", pose)]), ..update() };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let unit = [0.0, 0.0, 0.0, 1.0];
    let unknown = "0".repeat(64);
    let twice = object("c", &id, at(9.0));
    let attach = |pairs: &[(&str, &str)]| {
        let attach = |(object, to): &(&str, &str)| {
            let attachment = Some(Attachment { to: (*to).into(), ..Attachment::default() });
            Attach { object: (*object).into(), attachment }
        };
        UpdateSceneRequest { attach: pairs.iter().map(attach).collect(), ..update() }
    };
    let touch = |names: &[&str]| names.iter().filter_map(|name| subjects(name, name).a).collect::<Vec<_>>();
    let touching = |name: &str| {
        let mut update = attach(&[("a", "b")]);
        update.attach[0].attachment = Some(Attachment { to: "b".into(), touch: touch(&["b", name]), pose: None });
        update
    };
    let held = |to: &str, names: &[&str]| {
        let attachment = Attachment { to: to.into(), pose: Some(at(1.0)), touch: touch(names) };
        Object { attachment: Some(attachment), pose: None, ..object("c", &id, at(9.0)) }
    };
    let cases = [
        (UpdateSceneRequest { scene: "elsewhere".into(), ..update() }, missing, "scene"),
        (UpdateSceneRequest { scene: String::new(), ..update() }, invalid, "scene"),
        (upsert(object("c", &unknown, at(0.0))), missing, "upsert_objects[0].body_id"),
        (upsert(object("c", "chair", at(0.0))), invalid, "upsert_objects[0].body_id"),
        (upsert(object("", &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(object("two\nlines", &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(object(&"x".repeat(129), &id, at(0.0))), invalid, "upsert_objects[0].name"),
        (upsert(Object { pose: None, ..object("c", &id, at(0.0)) }), invalid, "upsert_objects[0].pose"),
        (upsert(Object { group: "g".repeat(129), ..object("c", &id, at(0.0)) }), invalid, "upsert_objects[0].group"),
        (set(pose([f64::NAN, 0.0, 0.0], unit)), invalid, "set_poses.rows[1].pose.translation_m.x"),
        (set(pose([0.0, f64::INFINITY, 0.0], unit)), invalid, "set_poses.rows[1].pose.translation_m.y"),
        (set(pose([0.0; 3], [0.0, 0.0, f64::NAN, 1.0])), invalid, "set_poses.rows[1].pose.rotation.z"),
        (set(pose([0.0; 3], [0.0, 0.0, 0.0, 1.00001])), invalid, "set_poses.rows[1].pose.rotation"),
        (set(pose([0.0; 3], [0.0; 4])), invalid, "set_poses.rows[1].pose.rotation"),
        (set(pose([0.0; 3], [1e200; 4])), invalid, "set_poses.rows[1].pose.rotation"),
        (set(Pose { rotation: None, ..at(0.0) }), invalid, "set_poses.rows[1].pose.rotation"),
        (set(Pose { translation_m: None, ..at(0.0) }), invalid, "set_poses.rows[1].pose.translation_m"),
        (UpdateSceneRequest { set_poses: rows(vec![moved("z", at(0.0))]), ..update() }, missing, "set_poses[0].name"),
        (UpdateSceneRequest { remove_objects: vec!["z".into()], ..update() }, missing, "remove_objects[0]"),
        (UpdateSceneRequest { remove_objects: vec!["a".into(), "a".into()], ..update() }, invalid, "remove_objects[1]"),
        (UpdateSceneRequest { allow_pairs: vec![subjects("a", "z")], ..update() }, missing, "allow_pairs[0]"),
        (UpdateSceneRequest { forbid_pairs: vec![subjects("a", "a")], ..update() }, invalid, "forbid_pairs[0]"),
        (attach(&[("z", "a")]), missing, "attach[0].object"),
        (attach(&[("a", "z")]), missing, "attach[0].attachment.to"),
        (attach(&[("b", "a"), ("a", "z")]), missing, "attach[1].attachment.to"),
        (attach(&[("a", "a")]), invalid, "attach[0].attachment.to"),
        (attach(&[("a", "two\nlines")]), invalid, "attach[0].attachment.to"),
        (touching("z"), missing, "attach[0].attachment.touch[1]"),
        (touching(""), invalid, "attach[0].attachment.touch[1]"),
        (upsert(held("z", &[])), missing, "upsert_objects[0].attachment.to"),
        (upsert(held("c", &[])), invalid, "upsert_objects[0].attachment.to"),
        (upsert(held("a", &["b", "z"])), missing, "upsert_objects[0].attachment.touch[1]"),
        (attach(&[("a", "b"), ("b", "a")]), invalid, "attach"),
        (UpdateSceneRequest { detach: vec!["z".into()], ..update() }, missing, "detach[0]"),
        (
            UpdateSceneRequest { upsert_objects: vec![twice.clone(), twice], ..update() },
            invalid,
            "upsert_objects[1].name",
        ),
    ];
    for (request, code, at) in cases {
        // A refused update changes nothing, so the good half of it must not be seen either.
        let request =
            UpdateSceneRequest { allow_pairs: [vec![subjects("a", "b")], request.allow_pairs].concat(), ..request };
        let at = at.replace("allow_pairs[0]", "allow_pairs[1]");
        let status = clients.scenes.update_scene(request).await.expect_err(&at);
        check(&status, code, &at);
    }
    let stale =
        UpdateSceneRequest { expected_revision: Some(before.scene.as_ref().expect("one").revision - 1), ..update() };
    let stale = clients.scenes.update_scene(stale).await.expect_err("stale");
    assert_eq!((stale.code(), reason(&stale).as_str()), (Code::Aborted, "REVISION_MISMATCH"));
    assert!(stale.message().contains(&before.scene.as_ref().expect("one").revision.to_string()));

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
        &clients
            .scenes
            .get_scene(GetSceneRequest { name: "hall".into(), ..Default::default() })
            .await
            .expect_err("unknown"),
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
        let status = clients.bodies.create_body(body_file(bad.into_bytes())).await;
        check(&status.expect_err("refused"), Code::InvalidArgument, "file");
    }
    let status = clients.bodies.create_body(body_file(vec![0xff, 0xfe])).await;
    check(&status.expect_err("refused"), Code::InvalidArgument, "file");
    let listed = clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list").into_inner();
    assert_eq!(listed.bodies.len(), 1, "nothing was stored");
}

#[tokio::test(flavor = "multi_thread")]
async fn primitives_are_refused_by_field() {
    let (_dir, _server, mut clients, ball_id) = room().await;
    let named = |name: &str, source: Source| CreateBodyRequest { name: name.into(), source: Some(source) };
    let vector = |[x, y, z]: [f64; 3]| Some(proto::Vector3 { x, y, z });
    let ball = |radius_m: f64| Source::Ball(BallSize { radius_m });
    let ellipsoid = |axes: [f64; 3]| Source::Ellipsoid(EllipsoidSize { half_axes_m: vector(axes) });
    let cuboid = |extents: [f64; 3]| Source::Box(BoxSize { half_extents_m: vector(extents) });
    let cylinder = |radius_m: f64, half_height_m: f64| Source::Cylinder(CylinderSize { radius_m, half_height_m });
    let capsule = |radius_m: f64, half_height_m: f64| Source::Capsule(CapsuleSize { radius_m, half_height_m });
    let plane = |normal: [f64; 3], offset_m: f64| Source::HalfSpace(HalfSpaceSize { normal: vector(normal), offset_m });
    let ladder = |ids: &[&str]| Source::Ladder(LadderRungs { body_ids: ids.iter().map(|&id| id.to_owned()).collect() });
    let rod = clients.bodies.create_body(named("", capsule(0.1, 0.5))).await.expect("stored").into_inner();
    let rod = rod.body.expect("a body").id;
    let (nan, inf) = (f64::NAN, f64::INFINITY);

    let mut cases: Vec<(Source, String)> = Vec::new();
    // Bodies have sizes from 1e-30 to 1e30 m.
    for bad in [0.0, -1.0, nan, inf, -inf, 9e-31, 1.1e30] {
        cases.push((ball(bad), "ball.radius_m".into()));
        cases.push((cylinder(bad, 1.0), "cylinder.radius_m".into()));
        cases.push((cylinder(1.0, bad), "cylinder.half_height_m".into()));
        for (place, axis) in ["x", "y", "z"].into_iter().enumerate() {
            let mut sizes = [1.0, 2.0, 3.0];
            sizes[place] = bad;
            cases.push((ellipsoid(sizes), format!("ellipsoid.half_axes_m.{axis}")));
            cases.push((cuboid(sizes), format!("box.half_extents_m.{axis}")));
        }
    }
    // A capsule may be a segment or a ball.
    for bad in [-1.0, nan, inf, 1.1e15] {
        cases.push((capsule(bad, 1.0), "capsule.radius_m".into()));
        cases.push((capsule(1.0, bad), "capsule.half_height_m".into()));
    }
    for normal in [[0.0; 3], [0.0, 0.0, 2.0], [0.0, nan, 1.0], [inf, 0.0, 0.0]] {
        cases.push((plane(normal, 0.0), "half_space.normal".into()));
    }
    for offset in [nan, inf, 1e16, -1e16] {
        cases.push((plane([0.0, 0.0, 1.0], offset), "half_space.offset_m".into()));
    }
    let others = [
        // So thin that rounding leaves no ball that is proven to lie inside: the sizes are wrong
        // together.
        (ellipsoid([1e9, 1.0, 1.0]), "ellipsoid.half_axes_m"),
        (cuboid([1e9, 1.0, 1.0]), "box.half_extents_m"),
        (cylinder(1.0, 1e9), "cylinder"),
        (Source::Ellipsoid(EllipsoidSize { half_axes_m: None }), "ellipsoid.half_axes_m"),
        (Source::Box(BoxSize { half_extents_m: None }), "box.half_extents_m"),
        (Source::HalfSpace(HalfSpaceSize { normal: None, offset_m: 0.0 }), "half_space.normal"),
        (ladder(&[]), "ladder.body_ids"),
        (ladder(&[&ball_id]), "ladder.body_ids"),
        (ladder(&[&rod]), "ladder.body_ids[0]"),
        (ladder(&[&ball_id, &rod]), "ladder.body_ids[1]"),
        (ladder(&[&ball_id, "chair"]), "ladder.body_ids[1]"),
        // It was not fitted, so that it is not proven to contain any points.
        (ladder(&[&ball_id, &ball_id]), "ladder.body_ids[0]"),
    ];
    cases.extend(others.map(|(source, at)| (source, at.to_owned())));
    for (source, at) in cases {
        let what = format!("{source:?}");
        let status = clients.bodies.create_body(named("", source)).await.expect_err(&what);
        assert_eq!(field(&status), at, "{what}: {}", status.message());
        check(&status, Code::InvalidArgument, &at);
    }
    let missing = named("", ladder(&[&ball_id, &"0".repeat(64)]));
    let status = clients.bodies.create_body(missing).await.expect_err("unknown");
    check(&status, Code::NotFound, "ladder.body_ids[1]");
    let sources = [
        ball(1.0),
        ellipsoid([1.0, 2.0, 3.0]),
        cuboid([1.0, 2.0, 3.0]),
        cylinder(1.0, 2.0),
        capsule(1.0, 2.0),
        plane([0.0, 0.0, 1.0], 0.0),
        ladder(&[&ball_id, &ball_id]),
    ];
    for source in sources {
        for name in ["two\nlines", &"x".repeat(201)] {
            let status = clients.bodies.create_body(named(name, source.clone())).await.expect_err("a bad name");
            check(&status, Code::InvalidArgument, "name");
        }
    }
    let listed = clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list").into_inner();
    assert_eq!(listed.bodies.len(), 2, "nothing was stored");
    // A segment and its radius are kept as they are, whatever their ratio.
    clients.bodies.create_body(named("", capsule(1.0, 1e9))).await.expect("a thin capsule");
}

#[tokio::test(flavor = "multi_thread")]
async fn queries() {
    let (_dir, _server, mut clients, _) = room().await;
    let distance = || question(vec![pair("a", "b")], &[Measure::Distance]);
    let of = |list: PairList| EvaluateRequest { question: Some(Question::Pairs(list)), ..distance() };
    let pairs = |rows: Vec<ObjectPair>| of(PairList { rows, ..PairList::default() });
    let packed = |indices: &[u32]| {
        let bytes: Vec<u8> = indices.iter().flat_map(|index| index.to_le_bytes()).collect();
        of(PairList { objects: vec!["a".into(), "b".into()], pairs: bytes.into(), ..PairList::default() })
    };
    let within = |margin_m: f64| {
        let within = WithinMargin { margin_m, selection: None };
        EvaluateRequest { question: Some(Question::Within(within)), ..distance() }
    };
    let over = |poses| EvaluateRequest { pose_overrides: rows(poses), ..distance() };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let three = PairList { points_m: vec![0; 20].into(), ..PairList::default() };
    let both = PairList { objects: vec!["a".into()], rows: vec![pair("a", "b")], ..PairList::default() };
    let unit = [1.0, 0.0, 0.0, f64::NAN].iter().flat_map(|number: &f64| number.to_le_bytes()).collect::<Vec<u8>>();
    let plane = PairList { half_spaces: unit.into(), ..PairList::default() };
    let accuracies = vec![MeasureAccuracy { measure: Measure::Distance.into(), accuracy: -1e-9 }];
    let nearer =
        |threshold_m| EvaluateRequest { measures: vec![Measure::NearerThan.into()], threshold_m, ..distance() };
    let cases = [
        (EvaluateRequest { scene: "hall".into(), ..distance() }, missing, "scene"),
        (EvaluateRequest { scene: String::new(), ..distance() }, invalid, "scene"),
        (EvaluateRequest { question: None, ..distance() }, invalid, "question"),
        (pairs(vec![]), invalid, "pairs"),
        (pairs(vec![pair("a", "z")]), missing, "pairs.rows[0].b"),
        (pairs(vec![pair("a", "b"), pair("", "b")]), invalid, "pairs.rows[1].a"),
        (pairs(vec![pair("a", "a")]), invalid, "pairs[0]"),
        (packed(&[0, 1, 0]), invalid, "pairs.pairs"),
        (packed(&[0, 1, 0, 2]), invalid, "pairs[1]"),
        (packed(&[1, 1]), invalid, "pairs[0]"),
        (of(three), invalid, "pairs.points_m"),
        (of(both), invalid, "pairs.rows"),
        (of(plane), invalid, "pairs.half_spaces[0]"),
        (within(-1e-9), invalid, "within.margin_m"),
        (within(f64::INFINITY), invalid, "within.margin_m"),
        (within(f64::NAN), invalid, "within.margin_m"),
        (EvaluateRequest { measures: vec![], ..distance() }, invalid, "measures"),
        (EvaluateRequest { measures: vec![0], ..distance() }, invalid, "measures[0]"),
        (EvaluateRequest { measures: vec![77], ..distance() }, invalid, "measures[0]"),
        (EvaluateRequest { measures: vec![1, 1], ..distance() }, invalid, "measures"),
        (EvaluateRequest { outputs: vec![99], ..distance() }, invalid, "outputs[0]"),
        (EvaluateRequest { layout: 9, ..distance() }, invalid, "layout"),
        (EvaluateRequest { accuracy: Some(0.0), ..distance() }, invalid, "accuracy"),
        (EvaluateRequest { accuracy: Some(f64::NAN), ..distance() }, invalid, "accuracy"),
        (EvaluateRequest { accuracies, ..distance() }, invalid, "accuracies[0].accuracy"),
        (EvaluateRequest { budget_ms: Some(0), ..distance() }, invalid, "budget_ms"),
        (EvaluateRequest { measures: vec![Measure::TimeOfImpact.into()], ..distance() }, invalid, "motions"),
        (nearer(None), invalid, "threshold_m"),
        (nearer(Some(-1.0)), invalid, "threshold_m"),
        (over(vec![moved("z", at(0.0))]), missing, "pose_overrides.rows[0]"),
        (over(vec![moved("a", at(0.0)), moved("a", at(1.0))]), invalid, "pose_overrides.rows[1]"),
        (over(vec![moved("a", at(f64::NAN))]), invalid, "pose_overrides.rows[0].pose.translation_m.x"),
        (over(vec![ObjectPose { name: "a".into(), pose: None }]), invalid, "pose_overrides.rows[0].pose"),
    ];
    for (request, code, at) in cases {
        let status = clients.queries.evaluate(request).await.expect_err(at);
        check(&status, code, at);
    }
    // As far as numbers go is no reason to refuse: everything is near.
    let all = clients.queries.evaluate(within(f64::MAX)).await.expect("answers").into_inner();
    assert_eq!((all.objects.len(), all.answers.len()), (2, 1));
    let later = EvaluateRequest { at_least_revision: Some(1 << 40), ..distance() };
    let status = clients.queries.evaluate(later).await.expect_err("not reached");
    assert_eq!((status.code(), reason(&status).as_str()), (Code::Unavailable, "REVISION_NOT_REACHED"));

    let many = |count: usize| packed(&[0, 1].repeat(count));
    let most = EvaluateRequest { layout: Layout::Columns.into(), outputs: Vec::new(), ..many(1 << 17) };
    let columns = clients.queries.evaluate(most).await.expect("the limit itself is fine").into_inner().columns;
    assert_eq!((columns[0].status.len(), columns[0].lower.len()), (1 << 17, 8 << 17));
    let status = clients.queries.evaluate(many((1 << 17) + 1)).await.expect_err("too many");
    check(&status, Code::ResourceExhausted, "pairs");
    assert!(status.message().contains("max_answers"), "{}", status.message());
    let status = clients.queries.evaluate(many(1 << 16)).await.expect_err("too long an answer");
    assert_eq!(status.code(), Code::ResourceExhausted);
    assert!(status.message().contains("max_message_bytes"), "{}", status.message());
}

#[tokio::test(flavor = "multi_thread")]
async fn states_and_rays() {
    let (_dir, _server, mut clients, _) = room().await;
    let numbers = |numbers: &[f64]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let still = numbers(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]);
    let states = || CheckStatesRequest {
        scene: "room".into(),
        objects: vec!["a".into()],
        poses: still.clone().into(),
        ..Default::default()
    };
    let (invalid, missing) = (Code::InvalidArgument, Code::NotFound);
    let twice = CheckStatesRequest { objects: vec!["a".into(), "a".into()], ..states() };
    let cases = [
        (CheckStatesRequest { scene: "hall".into(), ..states() }, missing, "scene"),
        (CheckStatesRequest { objects: vec![], ..states() }, invalid, "objects"),
        (CheckStatesRequest { objects: vec!["z".into()], ..states() }, missing, "objects[0]"),
        (CheckStatesRequest { poses: vec![0; 55].into(), ..states() }, invalid, "poses"),
        (CheckStatesRequest { poses: vec![0; 64].into(), ..states() }, invalid, "poses"),
        (CheckStatesRequest { poses: vec![].into(), ..states() }, invalid, "poses"),
        (CheckStatesRequest { poses: [still.clone(), still.clone()].concat().into(), ..twice }, invalid, "objects[1]"),
        (CheckStatesRequest { margin_m: -0.1, ..states() }, invalid, "margin_m"),
        (CheckStatesRequest { margin_m: f64::INFINITY, ..states() }, invalid, "margin_m"),
        (CheckStatesRequest { detail: 9, ..states() }, invalid, "detail"),
    ];
    for (request, code, at) in cases {
        let status = clients.queries.check_states(request).await.expect_err(at);
        check(&status, code, at);
    }
    let many = (1 << 16) + 1;
    let status = clients.queries.check_states(CheckStatesRequest { poses: still.repeat(many).into(), ..states() });
    let status = status.await.expect_err("too many");
    check(&status, Code::ResourceExhausted, "poses");
    assert!(status.message().contains("max_states"), "{}", status.message());
    // A pose that is none makes its state INVALID, and the others are answered.
    let mut poses = still.clone();
    poses.extend(numbers(&[f64::NAN, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    poses.extend(numbers(&[3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    poses.extend(numbers(&[3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0]));
    let request = CheckStatesRequest { poses: poses.into(), ..states() };
    let verdicts = clients.queries.check_states(request).await.expect("answers").into_inner().verdicts;
    assert_eq!(&verdicts[..], [1, 4, 2, 4]);

    let rays = || CastRaysRequest {
        scene: "room".into(),
        origins_m: numbers(&[-5.0, 0.0, 0.0]).into(),
        directions: numbers(&[2.0, 0.0, 0.0]).into(),
        max_length_m: 10.0,
        ..Default::default()
    };
    let selection = |name: &str| Some(Selection { objects: vec![name.into()], groups: Vec::new() });
    let cases = [
        (CastRaysRequest { origins_m: vec![].into(), directions: vec![].into(), ..rays() }, invalid, "origins_m"),
        (CastRaysRequest { directions: vec![0; 8].into(), ..rays() }, invalid, "directions"),
        (CastRaysRequest { directions: vec![0; 24].into(), ..rays() }, invalid, "rays[0]"),
        (CastRaysRequest { directions: vec![0; 48].into(), ..rays() }, invalid, "directions"),
        (CastRaysRequest { max_length_m: 0.0, ..rays() }, invalid, "max_length_m"),
        (CastRaysRequest { radius_m: Some(-1.0), ..rays() }, invalid, "radius_m"),
        (CastRaysRequest { selection: selection("z"), ..rays() }, missing, "selection.objects[0]"),
        (CastRaysRequest { accuracy: Some(2.0), ..rays() }, invalid, "accuracy"),
    ];
    for (request, code, at) in cases {
        let status = clients.queries.cast_rays(request).await.expect_err(at);
        check(&status, code, at);
    }
    let many = (1 << 15) + 1;
    let bundle = CastRaysRequest {
        origins_m: numbers(&[-5.0, 0.0, 0.0]).repeat(many).into(),
        directions: numbers(&[1.0, 0.0, 0.0]).repeat(many).into(),
        ..rays()
    };
    let status = clients.queries.cast_rays(bundle).await.expect_err("too many");
    check(&status, Code::ResourceExhausted, "origins_m");
    assert!(status.message().contains("max_rays"), "{}", status.message());
    let hit = clients.queries.cast_rays(rays()).await.expect("answers").into_inner();
    let lower = f64::from_le_bytes(hit.lower_m[..8].try_into().expect("a number"));
    assert_eq!((hit.objects, &hit.hits[..]), (vec!["a".to_owned()], &[0, 0, 0, 0][..]));
    assert!((lower - 4.0).abs() < 1e-8, "{lower}");
}

#[tokio::test(flavor = "multi_thread")]
async fn budgets_of_no_time() {
    let (_dir, _server, mut clients, _) = room().await;
    let numbers = |numbers: &[f64]| numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>();
    let (scene, objects) = ("room".to_owned(), vec!["a".to_owned()]);
    let poses = bytes::Bytes::from(numbers(&[0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0]));
    let evaluate = |budget_ms| EvaluateRequest { budget_ms, ..question(vec![pair("a", "b")], &[Measure::Distance]) };
    for budget_ms in [Some(0), Some(60_000), None] {
        let (scene, objects, poses) = (|| scene.clone(), || objects.clone(), || poses.clone());
        let states = CheckStatesRequest {
            scene: scene(),
            objects: objects(),
            poses: poses(),
            budget_ms,
            ..CheckStatesRequest::default()
        };
        let clearance = ClearanceRequest {
            scene: scene(),
            objects: objects(),
            poses: poses(),
            budget_ms,
            ..ClearanceRequest::default()
        };
        let explain = ExplainRequest {
            scene: scene(),
            objects: objects(),
            poses: poses(),
            budget_ms,
            ..ExplainRequest::default()
        };
        let rays = CastRaysRequest {
            scene: scene(),
            origins_m: numbers(&[-5.0, 0.0, 0.0]).into(),
            directions: numbers(&[1.0, 0.0, 0.0]).into(),
            max_length_m: 10.0,
            budget_ms,
            ..CastRaysRequest::default()
        };
        let answers = [
            ("Evaluate", clients.queries.evaluate(evaluate(budget_ms)).await.map(|_| ())),
            ("CheckStates", clients.queries.check_states(states).await.map(|_| ())),
            ("Clearance", clients.queries.clearance(clearance).await.map(|_| ())),
            ("Explain", clients.queries.explain(explain).await.map(|_| ())),
            ("CastRays", clients.queries.cast_rays(rays).await.map(|_| ())),
        ];
        for (call, answer) in answers {
            match (budget_ms, answer) {
                (Some(0), Err(status)) => check(&status, Code::InvalidArgument, "budget_ms"),
                (Some(1..) | None, Ok(())) => {}
                (budget_ms, answer) => panic!("{call} with {budget_ms:?}: {answer:?}"),
            }
        }
    }
    // In a stream the message is refused, and the next one is answered.
    let messages = [(1, Some(0)), (2, Some(60_000))];
    let messages =
        messages.map(|(sequence, budget_ms)| EvaluateStreamRequest { sequence, evaluate: Some(evaluate(budget_ms)) });
    let stream = clients.queries.evaluate_stream(tokio_stream::iter(messages)).await;
    let mut answers = stream.expect("a stream").into_inner();
    let first = answers.message().await.expect("no error").expect("an answer");
    let Some(evaluate_stream_response::Result::Error(error)) = first.result else { panic!("{first:?}") };
    assert_eq!((first.sequence, error.field.as_str()), (1, "budget_ms"));
    let second = answers.message().await.expect("no error").expect("an answer");
    let is_answer = matches!(second.result, Some(evaluate_stream_response::Result::Answer(_)));
    assert!(second.sequence == 2 && is_answer, "{second:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn oversized_messages() {
    let (_dir, _server, mut clients, _) = room().await;
    let status = clients.bodies.create_body(body_file(vec![b' '; (4 << 20) + 1])).await.expect_err("too large");
    assert_eq!(status.code(), Code::ResourceExhausted, "{}", status.message());
    assert!(status.message().contains("max_message_bytes"), "{}", status.message());
    assert_eq!(clients.scene("room").await.objects.len(), 2, "the server goes on");
}

#[tokio::test(flavor = "multi_thread")]
async fn long_names_do_not_break_the_answer() {
    let (_dir, _server, mut clients, _) = room().await;
    let name = "x".repeat(1 << 20);
    check(
        &clients
            .scenes
            .get_scene(GetSceneRequest { name: name.clone(), ..Default::default() })
            .await
            .expect_err("long"),
        Code::InvalidArgument,
        "name",
    );
    let get = GetBodyRequest { id: name.clone() };
    check(&clients.bodies.get_body(get).await.expect_err("long"), Code::InvalidArgument, "id");
    let file = format!("{{\"format\": \"{name}\"}}").into_bytes();
    let status = clients.bodies.create_body(body_file(file)).await.expect_err("long");
    check(&status, Code::InvalidArgument, "file");
}
