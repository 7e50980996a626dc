//! Families 17, 23 and 24 of the stability catalogue, through gRPC.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

use sublevel::client::Question;
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use sublevel::service::proto::evaluate_request::Question as Asked;
use sublevel::service::proto::{ClosestPair, EvaluateRequest, FirstContact, Outcome, UpdateSceneRequest, WithinMargin};

use crate::harness::{Clients, Numbers, Running, ball, object, pair, question, subjects};

async fn room(objects: usize) -> (tempfile::TempDir, Running, Clients) {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (small, large) = (clients.put(&ball(0.3)).await, clients.put(&ball(0.6)).await);
    clients.make_scene("room").await;
    let mut numbers = Numbers(3);
    let id = |i: usize| if i.is_multiple_of(2) { &small } else { &large };
    let upsert_objects = (0..objects).map(|i| object(&format!("o{i}"), id(i), numbers.pose())).collect();
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    (dir, server, clients)
}

fn asks(asked: Asked) -> EvaluateRequest {
    EvaluateRequest { question: Some(asked), ..question(Vec::new(), &[sublevel::service::proto::Measure::Distance]) }
}

/// Family 17: a margin chooses pairs and changes no distance, and no pair is dropped on the way.
#[tokio::test(flavor = "multi_thread")]
async fn margins_do_not_change_distances_and_lose_no_pair() {
    let (_dir, server, mut clients) = room(40).await;
    let names: Vec<String> = (0..40).map(|i| format!("o{i}")).collect();
    let mut pairs = Vec::new();
    for (i, a) in names.iter().enumerate() {
        pairs.extend(names[i + 1..].iter().map(|b| if a < b { pair(a, b) } else { pair(b, a) }));
    }
    let all = clients.queries.evaluate(question(pairs.clone(), &[sublevel::service::proto::Measure::Distance])).await;
    let all = all.expect("answers").into_inner().answers;
    let client = server.client().await;
    for margin in [0.0, 1e-9, 0.01, 0.1, 0.5, 1.0] {
        let found = client.evaluate("room", Question::within(margin), &[Measure::Distance]).await.expect("answers");
        let is_found = |a: &str, b: &str| found.rows.iter().find(|row| row.a == a && row.b == b);
        for (named, alone) in pairs.iter().zip(&all) {
            match is_found(&named.a, &named.b) {
                Some(row) => {
                    assert!(alone.lower <= margin, "{named:?} {alone:?}");
                    let difference = (row.answer.upper - alone.upper).abs();
                    assert!(difference <= 1e-8, "margin {margin}: {named:?} {row:?} {alone:?}");
                }
                None => assert!(alone.upper >= margin, "margin {margin}: {named:?} {alone:?}"),
            }
        }
    }
}

/// Family 23: nothing is said as nothing, never as a huge number.
#[tokio::test(flavor = "multi_thread")]
async fn nothing_in_range_is_an_outcome() {
    let (_dir, _server, mut clients) = room(2).await;
    let empty = |scene: &str| {
        let within = WithinMargin { margin_m: 1e6, selection: None };
        [
            Asked::Within(within),
            Asked::Closest(ClosestPair::default()),
            Asked::FirstContact(FirstContact { selection: None, margin_m: Some(1e6) }),
        ]
        .map(|asked| EvaluateRequest { scene: scene.into(), ..asks(asked) })
    };
    let none = |response: sublevel::service::proto::EvaluateResponse| {
        assert_eq!(response.outcome(), Outcome::NothingInRange, "{response:?}");
        assert!(response.complete && response.answers.is_empty() && response.pairs.is_empty(), "{response:?}");
    };
    // Beyond the cut-off.
    let near = Asked::Closest(ClosestPair { selection: None, max_distance_m: Some(1e-6) });
    let far = clients.queries.evaluate(asks(near)).await.expect("answers").into_inner();
    let alone =
        clients.queries.evaluate(question(vec![pair("o0", "o1")], &[sublevel::service::proto::Measure::Distance]));
    if alone.await.expect("answers").into_inner().answers[0].lower > 1e-6 {
        none(far);
    }
    // All pairs are allowed.
    let allow_pairs = vec![subjects("o0", "o1")];
    clients.update(UpdateSceneRequest { scene: "room".into(), allow_pairs, ..Default::default() }).await;
    for request in empty("room") {
        none(clients.queries.evaluate(request).await.expect("answers").into_inner());
    }
    // An empty scene.
    clients.make_scene("void").await;
    for request in empty("void") {
        none(clients.queries.evaluate(request).await.expect("answers").into_inner());
    }
    let [within, ..] = empty("room");
    let with_allowed = EvaluateRequest { include_allowed: true, ..within };
    let found = clients.queries.evaluate(with_allowed).await.expect("answers").into_inner();
    assert_eq!((found.outcome(), found.answers.len()), (Outcome::Found, 1));
}

/// Family 24: while poses stream, every answer is the serial answer of the revision it names, bit
/// for bit.
#[tokio::test(flavor = "multi_thread")]
async fn answers_are_those_of_their_revision() {
    let (_dir, server, _clients) = room(8).await;
    let client = server.client().await;
    let names = ["o0", "o1", "o2", "o3"];
    let at = |step: u64| -> Vec<Pose> {
        let mut numbers = Numbers(step);
        let pose = |pose: sublevel::service::proto::Pose| {
            let (t, q) = (pose.translation_m.expect("t"), pose.rotation.expect("q"));
            Pose::from_quaternion(nalgebra::Vector3::new(t.x, t.y, t.z), [q.x, q.y, q.z, q.w]).expect("a pose")
        };
        names.iter().map(|_| pose(numbers.pose())).collect()
    };
    // One message at a time, so that revisions and steps go together.
    let mut stream = client.stream_poses("room", names).await.expect("a stream");
    let first = stream.next().await.expect("no error").expect("the names").revision;
    let (writer, done) = (server.client().await, Arc::new(AtomicBool::new(false)));
    drop(writer);
    let ask = || Question::pairs([("o0", "o1"), ("o1", "o2"), ("o2", "o3"), ("o0", "o7")]).cold();
    let mut readers = Vec::new();
    for _ in 0..64 {
        let (client, done, question) = (client.clone(), done.clone(), ask());
        readers.push(tokio::spawn(async move {
            let mut seen = Vec::new();
            while !done.load(Ordering::Relaxed) {
                let found = client.evaluate("room", question.clone(), &[Measure::Distance]).await.expect("answers");
                seen.push((found.revision, bits(&found.rows)));
            }
            seen
        }));
    }
    let mut steps = std::collections::BTreeMap::new();
    for step in 1..=150 {
        stream.send(&at(step)).await.expect("sent");
        let said = stream.next().await.expect("no error").expect("an answer");
        assert_eq!((said.sequence, said.messages), (step, 1));
        steps.insert(said.revision, step);
    }
    done.store(true, Ordering::Relaxed);
    let mut checked = 0;
    for reader in readers {
        for (revision, bits_seen) in reader.await.expect("a reader") {
            let Some(&step) = steps.get(&revision) else {
                assert!(revision <= first, "an answer of revision {revision}, which nobody made");
                continue;
            };
            // Again, alone.
            let poses = at(step);
            let question = ask().with_poses(names.iter().copied().zip(poses));
            let again = client.evaluate("room", question, &[Measure::Distance]).await.expect("answers");
            assert_eq!(bits(&again.rows), bits_seen, "revision {revision}, step {step}");
            checked += 1;
        }
    }
    println!("{checked} answers of {} revisions", steps.len());
    assert!(checked > 200, "{checked}");
}

fn bits(rows: &[sublevel::client::PairRow]) -> Vec<[u64; 2]> {
    rows.iter().map(|row| [row.answer.lower.to_bits(), row.answer.upper.to_bits()]).collect()
}
