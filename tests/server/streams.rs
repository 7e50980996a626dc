//! Streams: poses at a rate, scenes and contacts that are watched, questions one after the other.

use std::collections::BTreeMap;
use std::time::Duration;

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::client::Question;
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use sublevel::service::proto::{
    self, EvaluateRequest, EvaluateStreamRequest, StreamPosesRequest, UpdateSceneRequest, WatchRequest,
    WatchSceneRequest, evaluate_stream_response,
};
use tonic::Code;

use crate::harness::{Clients, PATIENCE, Running, at, ball, moved, object, pair, pose, question, rows};

fn along(x: f64) -> Pose {
    Pose::from_quaternion(Vector3::new(x, 0.0, 0.0), [0.0, 0.0, 0.0, 1.0]).expect("a pose")
}

fn packed(poses: &[Pose]) -> Vec<u8> {
    let numbers = |pose: &Pose| [pose.translation().as_slice(), pose.rotation().coords.as_slice()].concat();
    poses.iter().flat_map(numbers).flat_map(f64::to_le_bytes).collect()
}

async fn room(objects: usize) -> (tempfile::TempDir, Running, Clients) {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&ball(0.1)).await;
    clients.make_scene("room").await;
    let upsert_objects = (0..objects).map(|i| object(&format!("o{i}"), &id, at(i as f64))).collect();
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    (dir, server, clients)
}

#[tokio::test(flavor = "multi_thread")]
async fn streamed_poses_are_seen_at_once_and_are_on_disk_after_an_orderly_stop() {
    let (dir, mut server, mut clients) = room(3).await;
    let client = server.client().await;
    let start = clients.revision("room").await;
    let mut stream = client.stream_poses("room", ["o2", "o0"]).await.expect("a stream");
    let mut last = 0;
    for step in 0..200 {
        last = stream.send(&[along(f64::from(step)), along(-f64::from(step))]).await.expect("sent");
    }
    let mut messages = 0;
    loop {
        let said = stream.next().await.expect("no error").expect("an answer");
        assert!(said.refused.is_none(), "{said:?}");
        messages += said.messages;
        if said.sequence == last {
            // The first message, which names the objects, holds no poses.
            assert_eq!(messages, 201);
            assert!(said.revision > start);
            let question = Question::pairs([("o0", "o2")]).at_least_revision(said.revision);
            let answers = client.evaluate("room", question, &[Measure::Distance]).await.expect("answers");
            assert!((answers.rows[0].value.expect("a value") - (2.0 * 199.0 - 0.2)).abs() < 1e-7, "{answers:?}");
            break;
        }
    }
    let before = client.scene("room").await.expect("a scene");
    drop(stream);
    drop((client, clients));
    server.terminate();
    assert!(server.wait().success());
    let server = Running::start(dir.path());
    let after = server.client().await.scene("room").await.expect("a scene");
    assert_eq!((after.revision, &after.objects), (before.revision, &before.objects));
}

#[tokio::test(flavor = "multi_thread")]
async fn revisions_of_streamed_poses_are_not_given_out_again_after_a_kill() {
    let (dir, server, _clients) = room(1).await;
    let client = server.client().await;
    let mut stream = client.stream_poses("room", ["o0"]).await.expect("a stream");
    let mut seen = 0;
    for step in 0..50 {
        stream.send(&[along(f64::from(step))]).await.expect("sent");
        seen = stream.next().await.expect("no error").expect("an answer").revision.max(seen);
    }
    server.kill();
    let server = Running::start(dir.path());
    let now = server.client().await.scene("room").await.expect("a scene").revision;
    assert!(now > seen, "{now} after {seen}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_bad_message_is_reported_and_the_stream_goes_on() {
    let (_dir, _server, mut clients) = room(2).await;
    let first =
        StreamPosesRequest { scene: "room".into(), names: vec!["o0".into(), "o1".into()], ..Default::default() };
    let indices = |indices: &[u32]| indices.iter().flat_map(|index| index.to_le_bytes()).collect::<Vec<u8>>();
    let bad = [
        StreamPosesRequest { poses: vec![0; 55].into(), sequence: 1, ..Default::default() },
        StreamPosesRequest { poses: vec![0; 56].into(), sequence: 2, ..Default::default() },
        StreamPosesRequest { poses: packed(&[along(1.0)]).into(), sequence: 3, ..Default::default() },
        StreamPosesRequest {
            indices: indices(&[2]).into(),
            poses: packed(&[along(1.0)]).into(),
            sequence: 4,
            ..Default::default()
        },
        StreamPosesRequest { names: vec!["z".into()], sequence: 5, ..Default::default() },
        StreamPosesRequest { names: vec!["o0".into(), "o0".into()], sequence: 6, ..Default::default() },
        StreamPosesRequest { scene: "hall".into(), sequence: 7, ..Default::default() },
    ];
    let good = StreamPosesRequest {
        indices: indices(&[1]).into(),
        poses: packed(&[along(9.0)]).into(),
        sequence: 8,
        ..Default::default()
    };
    let fields = ["poses", "poses[0]", "poses", "indices[0]", "names[0]", "names[1]", "scene"];
    let messages: Vec<_> = std::iter::once(first).chain(bad).chain([good]).collect();
    let mut replies = clients.scenes.stream_poses(tokio_stream::iter(messages)).await.expect("a stream").into_inner();
    let mut refused = BTreeMap::new();
    let mut applied = 0;
    while let Some(reply) = replies.message().await.expect("no error") {
        match reply.error {
            Some(error) => {
                assert!(error.message.len() > 20 && !error.reason.is_empty(), "{error:?}");
                refused.insert(reply.sequence, error.field);
            }
            None => applied = applied.max(reply.sequence),
        }
    }
    assert_eq!(refused.into_values().collect::<Vec<_>>(), fields);
    assert_eq!(applied, 8);
    let moved = clients.scene("room").await.objects[1].pose.expect("a pose").translation_m.expect("one").x;
    assert_eq!(moved, 9.0);
    let nowhere = StreamPosesRequest { scene: "hall".into(), ..Default::default() };
    let mut replies = clients.scenes.stream_poses(tokio_stream::iter([nowhere])).await.expect("a stream").into_inner();
    assert_eq!(replies.message().await.expect_err("no scene").code(), Code::NotFound);
}

/// Numbers and positions along x of a watched scene.
async fn follow(
    watch: &mut tonic::Streaming<sublevel::service::proto::WatchSceneResponse>,
    known: &mut BTreeMap<u32, f64>,
) -> u64 {
    loop {
        let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time");
        let message = message.expect("no error").expect("a message");
        if message.reset {
            known.clear();
        }
        for watched in message.objects {
            let pose = watched.object.expect("an object").pose.expect("a pose");
            known.insert(watched.index, pose.translation_m.expect("one").x);
        }
        let numbers = message.moved.as_chunks::<4>().0.iter().map(|bytes| u32::from_le_bytes(*bytes));
        let poses = message.poses.as_chunks::<8>().0.as_chunks::<7>().0;
        for (number, pose) in numbers.zip(poses) {
            known.insert(number, f64::from_le_bytes(pose[0]));
        }
        if message.complete {
            return message.revision;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_watched_scene_is_what_the_scene_is() {
    let (_dir, server, mut clients) = room(30).await;
    let client = server.client().await;
    let request = WatchSceneRequest { scene: "room".into(), from_revision: None, max_rate_hz: Some(1000.0) };
    let mut watch = clients.scenes.watch_scene(request).await.expect("a stream").into_inner();
    let mut known = BTreeMap::new();
    let mut revision = follow(&mut watch, &mut known).await;
    assert_eq!(known.len(), 30);
    for step in 1..20 {
        let last = client.set_poses("room", [("o3", along(f64::from(100 * step)))]).await.expect("moved");
        while revision < last {
            revision = follow(&mut watch, &mut known).await;
        }
        let moved = f64::from(100 * step);
        assert_eq!(known.values().filter(|&&x| x == moved).count(), 1, "step {step}: {known:?}");
    }
    drop(watch);
    // A client that comes back gets what moved since, and nothing else.
    let last = client.set_poses("room", [("o5", along(-7.0))]).await.expect("moved");
    let request = WatchSceneRequest { scene: "room".into(), from_revision: Some(revision), max_rate_hz: None };
    let mut watch = clients.scenes.watch_scene(request).await.expect("a stream").into_inner();
    let mut since = BTreeMap::new();
    assert_eq!(follow(&mut watch, &mut since).await, last);
    assert_eq!(since.into_values().collect::<Vec<_>>(), [-7.0]);
    // Objects that come and go: the definitions are sent again.
    let remove_objects = vec!["o9".into()];
    clients.update(UpdateSceneRequest { scene: "room".into(), remove_objects, ..Default::default() }).await;
    follow(&mut watch, &mut known).await;
    assert_eq!(known.len(), 29);
    // A fork that takes the name and the revision of another one is not taken for it.
    client.fork_scene("room", "plan").await.expect("forked");
    let last = client.set_poses("plan", [("o5", along(1.0))]).await.expect("moved");
    client.delete_scene("plan").await.expect("deleted");
    client.fork_scene("room", "plan").await.expect("forked");
    assert_eq!(client.set_poses("plan", [("o5", along(2.0))]).await.expect("moved"), last);
    let request = WatchSceneRequest { scene: "plan".into(), from_revision: Some(last), max_rate_hz: None };
    let mut plan = clients.scenes.watch_scene(request).await.expect("a stream").into_inner();
    let mut seen = BTreeMap::new();
    follow(&mut plan, &mut seen).await;
    assert_eq!(seen.len(), 29);
    client.delete_scene("room").await.expect("deleted");
    let ended = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time");
    assert_eq!(ended.expect_err("the scene is gone").code(), Code::NotFound);
}

#[tokio::test(flavor = "multi_thread")]
async fn contacts_are_reported_when_they_come_and_go() {
    let (_dir, server, mut clients) = room(3).await;
    let client = server.client().await;
    let request =
        WatchRequest { scene: "room".into(), margin_m: 0.05, max_rate_hz: Some(1000.0), ..Default::default() };
    let mut watch = clients.queries.watch(request).await.expect("a stream").into_inner();
    let first = watch.message().await.expect("no error").expect("a message");
    assert!(first.reset && first.complete && first.crossings.is_empty(), "{first:?}");
    for (x, near) in [(1.22, true), (1.3, false), (1.0, true)] {
        client.set_poses("room", [("o0", along(x))]).await.expect("moved");
        let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time");
        let message = message.expect("no error").expect("a message");
        let [crossing] = &message.crossings[..] else { panic!("{message:?}") };
        assert_eq!((crossing.a.as_str(), crossing.b.as_str(), crossing.near), ("o0", "o1", near), "{message:?}");
        if near {
            let signed = (x - 1.0_f64).abs() - 0.2;
            assert!(crossing.lower_m <= signed + 1e-3 && crossing.upper_m >= signed - 1e-3, "{crossing:?}");
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn questions_of_a_stream_are_answered_in_order_and_a_bad_one_does_not_end_it() {
    let (_dir, _server, mut clients) = room(2).await;
    let good = question(vec![pair("o0", "o1")], &[proto::Measure::Distance]);
    let bad = question(vec![pair("o0", "z")], &[proto::Measure::Distance]);
    let ask = |sequence, evaluate| EvaluateStreamRequest { sequence, evaluate };
    let messages = [ask(7, Some(good.clone())), ask(8, Some(bad)), ask(9, None), ask(10, Some(good))];
    let mut answers =
        clients.queries.evaluate_stream(tokio_stream::iter(messages)).await.expect("a stream").into_inner();
    let mut seen = Vec::new();
    while let Some(answer) = answers.message().await.expect("no error") {
        match answer.result.expect("a result") {
            evaluate_stream_response::Result::Answer(found) => {
                assert!((found.answers[0].upper - 0.8).abs() < 1e-8, "{found:?}");
                seen.push((answer.sequence, String::new()));
            }
            evaluate_stream_response::Result::Error(error) => seen.push((answer.sequence, error.field)),
        }
    }
    let expected = [(7, ""), (8, "pairs.rows[0].b"), (9, "evaluate"), (10, "")];
    assert_eq!(seen, expected.map(|(sequence, field)| (sequence, field.to_owned())));
}

/// Two clients ask about the same pair, each with a pose of its own. The second message of the
/// stream starts where the first has ended; the other client has to come back from where the stream
/// was.
#[tokio::test(flavor = "multi_thread")]
async fn a_stream_starts_from_its_own_answers_whatever_others_ask() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let brick = Body::superellipsoid("brick", Vector3::zeros(), Vector3::new(0.5, 0.3, 0.2), 6).expect("a body");
    let id = clients.put(&brick).await;
    clients.make_scene("room").await;
    let upsert_objects = (0..2).map(|i| object(&format!("o{i}"), &id, at(2.0 * f64::from(i)))).collect();
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    let ask = |translation, rotation| EvaluateRequest {
        pose_overrides: rows(vec![moved("o1", pose(translation, rotation))]),
        ..question(vec![pair("o0", "o1")], &[proto::Measure::Distance])
    };
    let (sender, messages) = tokio::sync::mpsc::channel(1);
    let stream = clients.queries.evaluate_stream(tokio_stream::wrappers::ReceiverStream::new(messages)).await;
    let mut answers = stream.expect("a stream").into_inner();
    let (mut of_stream, mut of_other) = (Vec::new(), Vec::new());
    for step in 0..20_u32 {
        let near = ask([1.5, 0.4 + 1e-3 * f64::from(step), 0.3], [0.1, 0.2, 0.3, 0.9273618495495704]);
        let evaluate = Some(near.clone());
        sender.send(EvaluateStreamRequest { sequence: step.into(), evaluate }).await.expect("sent");
        let answer = answers.message().await.expect("no error").expect("an answer");
        let Some(evaluate_stream_response::Result::Answer(found)) = answer.result else { panic!("{answer:?}") };
        let cold = EvaluateRequest { cold: true, ..near };
        let cold = clients.queries.evaluate(cold).await.expect("an answer").into_inner();
        let (warm, cold) = (&found.answers[0], &cold.answers[0]);
        assert!(warm.lower <= cold.upper && cold.lower <= warm.upper, "{warm:?} {cold:?}");
        of_stream.push(warm.iterations);
        // Elsewhere in two ways: the scene's own start is of the other side each time.
        let side = if step % 2 == 0 { -1.5 } else { 1.5 };
        let far = ask([side, -0.6, side], [0.5, -0.5, 0.5, 0.5]);
        let other = clients.queries.evaluate(far).await.expect("an answer").into_inner();
        of_other.push(other.answers[0].iterations);
    }
    let sum = |iterations: &[u32]| iterations[1..].iter().sum::<u32>();
    assert!(of_stream[1] < of_stream[0] && of_stream[1..].iter().all(|&count| count <= 2), "{of_stream:?}");
    assert!(sum(&of_other) > 2 * sum(&of_stream), "{of_other:?} {of_stream:?}");
}

/// A client that sends and never reads: others go on, and so does the scene.
#[tokio::test(flavor = "multi_thread")]
async fn a_client_that_reads_nothing_harms_nobody() {
    let (_dir, server, mut clients) = room(2).await;
    let deaf = server.client().await;
    let mut stream = deaf.stream_poses("room", ["o0", "o1"]).await.expect("a stream");
    let request = WatchSceneRequest { scene: "room".into(), ..Default::default() };
    let _unread = clients.scenes.watch_scene(request).await.expect("a stream");
    for step in 0..20_000 {
        let poses = [along(f64::from(step)), along(-f64::from(step))];
        let sent = stream.send(&poses);
        tokio::time::timeout(PATIENCE, sent).await.expect("the server reads on").expect("sent");
    }
    let other = server.client().await;
    let answers = other.evaluate("room", Question::pairs([("o0", "o1")]), &[Measure::Distance]).await;
    assert!(answers.expect("answers").complete);
    tokio::time::sleep(Duration::from_millis(50)).await;
    let peak = server.peak_memory_mib();
    assert!(peak < 300, "{peak} MiB");
}
