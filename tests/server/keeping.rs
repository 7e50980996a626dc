//! What the catalogue keeps, and the answers about it.

use std::time::Instant;

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::service::proto::{
    DeleteBodyRequest, DeleteSceneRequest, EvaluateRequest, GetBodyRequest, ListBodiesRequest, ListScenesRequest,
    Measure, UpdateSceneRequest, get_body_response::Content,
};
use tonic::Code;

use crate::harness::{
    Numbers, PATIENCE, Running, at, ball, bits, body_file, moved, object, pair, question, reason, rows, subjects,
};

fn shapes() -> [Body; 3] {
    let cuboid = Body::cuboid("box", Vector3::new(0.2, 0.3, 0.4)).expect("a box");
    [ball(0.5), cuboid, Body::cylinder("cylinder", 0.2, 0.6).expect("a cylinder")]
}

fn everything(a: &str, b: &str) -> EvaluateRequest {
    question(vec![pair(a, b)], &[Measure::Distance, Measure::LevelDistanceAOnB, Measure::LevelDistanceBOnA])
}

/// The promise of the store: what was acknowledged is there after SIGKILL, and revisions do not go
/// back.
#[tokio::test(flavor = "multi_thread")]
async fn everything_acknowledged_survives_a_kill() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mut files = Vec::new();
    for body in shapes() {
        files.push((clients.put(&body).await, body.to_json()));
    }
    clients.make_scene("room").await;
    let names = ["a", "b", "c", "racer"];
    let mut numbers = Numbers(7);
    let mut upsert_objects: Vec<_> =
        names.iter().zip([0, 1, 2, 0]).map(|(name, i)| object(name, &files[i].0, at(0.0))).collect();
    // Poses that are normalised on the way in, for normalising them again on the way back would
    // show in the last bits.
    upsert_objects.extend((0..60).map(|i| object(&format!("still {i}"), &files[i % 3].0, numbers.pose())));
    let count = upsert_objects.len();
    let allow_pairs = vec![subjects("b", "a")];
    let mut revision = clients
        .update(UpdateSceneRequest { scene: "room".into(), upsert_objects, allow_pairs, ..Default::default() })
        .await;

    let start = Instant::now();
    for step in 0..1000 {
        let name = names[step % 3];
        let update = UpdateSceneRequest {
            scene: "room".into(),
            expected_revision: Some(revision),
            set_poses: rows(vec![moved(name, numbers.pose())]),
            ..Default::default()
        };
        let next = clients.update(update).await;
        assert_eq!(next, revision + 1);
        revision = next;
        let request = EvaluateRequest { include_allowed: true, ..everything("a", "b") };
        let response = clients.queries.evaluate(request).await.expect("answers").into_inner();
        assert_eq!((response.answers.len(), response.scene_revision), (3, revision));
        for answer in response.answers {
            assert!(answer.lower <= answer.upper, "{answer:?}");
        }
    }
    println!("1000 durable updates and 1000 queries of 3 measures in {:?}", start.elapsed());
    let before = clients.scene("room").await;
    assert_eq!(before.scene.as_ref().map(|scene| scene.revision), Some(revision));

    // Somebody is writing at the very moment of the kill.
    let mut racing = server.connect().await;
    let (tally, mut counted) = tokio::sync::watch::channel(0);
    let racer = tokio::spawn(async move {
        let mut numbers = Numbers(11);
        let mut acknowledged = (revision, at(0.0));
        loop {
            let pose = numbers.pose();
            let set_poses = rows(vec![moved("racer", pose)]);
            let update = UpdateSceneRequest { scene: "room".into(), set_poses, ..Default::default() };
            match racing.scenes.update_scene(update).await {
                Ok(response) => {
                    acknowledged = (response.into_inner().revision, pose);
                    tally.send_modify(|count| *count += 1);
                }
                Err(_) => return (acknowledged, pose),
            }
        }
    });
    let written = tokio::time::timeout(PATIENCE, counted.wait_for(|count| *count >= 20)).await;
    written.expect("the racer is acknowledged").expect("the racer goes on");
    server.kill();
    let ((acknowledged, last), unanswered) = racer.await.expect("the racer");
    assert!(acknowledged > revision, "the racer was acknowledged before the kill");

    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let after = clients.scene("room").await;
    let now = after.scene.as_ref().expect("a summary").revision;
    let landed = now == acknowledged + 1;
    assert!(landed || now == acknowledged, "{now} after {acknowledged}");
    for (was, is) in before.objects.iter().zip(&after.objects) {
        let (was_pose, is_pose) = (was.pose.as_ref().expect("a pose"), is.pose.as_ref().expect("a pose"));
        assert_eq!((&was.name, &was.body_id, &was.group), (&is.name, &is.body_id, &is.group));
        if is.name == "racer" {
            let translation = if landed { unanswered.translation_m } else { last.translation_m };
            assert_eq!(is_pose.translation_m, translation);
        } else {
            assert_eq!(bits(was_pose), bits(is_pose), "{}", is.name);
        }
    }
    assert_eq!(after.objects.len(), count);
    assert_eq!(before.allowed_pairs, after.allowed_pairs);
    for (id, file) in files {
        let found = clients.bodies.get_body(GetBodyRequest { id }).await.expect("the body").into_inner();
        assert_eq!(found.content, Some(Content::File(file.into_bytes().into())));
    }
    let set_poses = rows(vec![moved("a", at(1.0))]);
    let next = clients.update(UpdateSceneRequest { scene: "room".into(), set_poses, ..Default::default() }).await;
    assert_eq!(next, now + 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn bodies_are_stored_once_listed_in_pages_and_kept_while_used() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let file = ball(1.0).to_json().into_bytes();
    let request = body_file(file.clone());
    let first = clients.bodies.create_body(request.clone()).await.expect("stored").into_inner();
    let again = clients.bodies.create_body(request).await.expect("stored").into_inner();
    assert!(first.created && !again.created);
    assert_eq!(first.body, again.body);
    let used = first.body.expect("a body");
    assert_eq!((used.degree, used.constraint_count, used.name.as_str()), (2, 1, "ball"));
    let volume = used.volume_m3.expect("a volume");
    assert!((volume - 4.0 / 3.0 * std::f64::consts::PI).abs() < 1e-6, "{volume}");

    let mut ids = vec![used.id.clone()];
    for radius in [2.0, 3.0, 4.0, 5.0] {
        ids.push(clients.put(&ball(radius)).await);
    }
    ids.sort();
    let mut listed = Vec::new();
    let mut page_token = String::new();
    loop {
        let page = clients.bodies.list_bodies(ListBodiesRequest { page_size: 2, page_token }).await;
        let page = page.expect("a page").into_inner();
        assert!((1..=2).contains(&page.bodies.len()));
        listed.extend(page.bodies.into_iter().map(|body| body.id));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            break;
        }
    }
    assert_eq!(listed, ids);

    clients.make_scene("room").await;
    let upsert_objects = vec![object("o", &used.id, at(0.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    let delete = DeleteBodyRequest { id: used.id.clone() };
    let refused = clients.bodies.delete_body(delete.clone()).await.expect_err("in use");
    assert_eq!((refused.code(), reason(&refused).as_str()), (Code::FailedPrecondition, "BODY_IN_USE"));
    assert!(refused.message().contains("\"o\"") && refused.message().contains("\"room\""), "{}", refused.message());
    let remove_objects = vec!["o".into()];
    clients.update(UpdateSceneRequest { scene: "room".into(), remove_objects, ..Default::default() }).await;
    clients.bodies.delete_body(delete.clone()).await.expect("deleted");
    let gone = clients.bodies.delete_body(delete).await.expect_err("gone");
    assert_eq!((gone.code(), reason(&gone).as_str()), (Code::NotFound, "BODY_NOT_FOUND"));
    let gone = clients.bodies.get_body(GetBodyRequest { id: used.id }).await.expect_err("gone");
    assert_eq!(gone.code(), Code::NotFound);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_deleted_scene_never_hands_out_its_revisions_again() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&ball(1.0)).await;
    assert_eq!(clients.make_scene("room").await, 1);
    let upsert_objects = vec![object("o", &id, at(0.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    clients.scenes.delete_scene(DeleteSceneRequest { name: "room".into() }).await.expect("deleted");
    server.kill();

    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let listed = clients.scenes.list_scenes(ListScenesRequest::default()).await.expect("a list").into_inner();
    assert!(listed.scenes.is_empty());
    assert_eq!(clients.make_scene("room").await, 3);
    assert!(clients.scene("room").await.objects.is_empty());
    let listed = clients.scenes.list_scenes(ListScenesRequest::default()).await.expect("a list").into_inner();
    assert_eq!(listed.scenes.len(), 1);
    assert_eq!((listed.scenes[0].revision, listed.scenes[0].object_count), (3, 0));
}

#[tokio::test(flavor = "multi_thread")]
async fn answers_are_right_and_overrides_last_one_call() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (one, two) = (clients.put(&ball(1.0)).await, clients.put(&ball(2.0)).await);
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &one, at(0.0)), object("b", &two, at(5.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;

    let over = EvaluateRequest { pose_overrides: rows(vec![moved("b", at(7.0))]), ..everything("a", "b") };
    // Ball a at 0 of radius 1; ball b of radius 2 at x: p_a on b is ((x - 2) / 1)^2, p_b on a is
    // ((x - 1) / 2)^2.
    for (request, x) in [(everything("a", "b"), 5.0), (over, 7.0_f64), (everything("a", "b"), 5.0)] {
        let answers = clients.queries.evaluate(request).await.expect("answers").into_inner().answers;
        let normal = answers[0].normal.expect("a normal when apart");
        assert!((normal.x + 1.0).abs() < 1e-6, "from B to A: {normal:?}");
        assert!((answers[0].witness_a_m.expect("a witness").x - 1.0).abs() < 1e-6);
        assert!((answers[0].witness_b_m.expect("a witness").x - (x - 2.0)).abs() < 1e-6);
        for (answer, truth) in answers.iter().zip([x - 3.0, (x - 2.0).powi(2), ((x - 1.0) / 2.0).powi(2)]) {
            let (lower, value, upper) = (answer.lower, answer.value.expect("a value"), answer.upper);
            assert!(lower <= truth * (1.0 + 1e-12) && truth * (1.0 - 1e-12) <= upper, "{lower} {truth} {upper}");
            assert!((value - truth).abs() <= 1e-7 * truth && upper - lower <= 1e-7 * truth, "{lower} {truth} {upper}");
        }
    }
    let results = EvaluateRequest { pose_overrides: rows(vec![moved("b", at(0.5))]), ..everything("a", "b") };
    let touching = clients.queries.evaluate(results).await.expect("answers").into_inner().answers[0];
    assert_eq!((touching.lower, touching.upper), (0.0, 0.0));
    assert!(touching.normal.is_none() && touching.witness_a_m == touching.witness_b_m);
}
