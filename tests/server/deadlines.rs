//! Deadlines and budgets of big calls: never CANCELLED, and what is known by then.

use std::error::Error;
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use sublevel::body::Body;
use sublevel::service::proto::evaluate_request::Question;
use sublevel::service::proto::{EvaluateRequest, Measure, PairList, SolveStatus, UpdateSceneRequest};
use tonic::{Code, Request};

use crate::harness::{Clients, Numbers, Running, object, question};

async fn room() -> (tempfile::TempDir, Running, Clients) {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let post = clients.put(&Body::cylinder("post", 0.2, 1.0).expect("a cylinder")).await;
    let cuboid = clients.put(&Body::cuboid("box", Vector3::new(0.5, 0.4, 0.3)).expect("a box")).await;
    clients.make_scene("room").await;
    let mut numbers = Numbers(5);
    let body = |i: usize| if i.is_multiple_of(2) { &post } else { &cuboid };
    let upsert_objects = (0..40).map(|i| object(&format!("o{i}"), body(i), numbers.pose())).collect();
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    (dir, server, clients)
}

/// Penetrations of boxes and cylinders, which take long; all pairs again and again.
fn big(count: u32) -> EvaluateRequest {
    let pairs: Vec<u8> =
        (0..count).flat_map(|i| [i % 40, (i + 1 + i / 40 % 38) % 40]).flat_map(u32::to_le_bytes).collect();
    let objects = (0..40).map(|i| format!("o{i}")).collect();
    let list = PairList { objects, pairs: pairs.into(), ..PairList::default() };
    let question = question(Vec::new(), &[Measure::SignedDistance]);
    EvaluateRequest { question: Some(Question::Pairs(list)), cold: true, outputs: Vec::new(), ..question }
}

#[tokio::test(flavor = "multi_thread")]
async fn what_a_deadline_ends_is_never_cancelled() {
    let (_dir, server, mut clients) = room().await;
    let mut numbers = Numbers(1);
    let (mut ended, mut answered, mut given_up) = (0, 0, 0);
    for _ in 0..60 {
        // From 1 ms to 1 s, evenly in their logarithm; such calls take tens of milliseconds.
        let micros = 1000.0 * 1000_f64.powf((numbers.next() + 1.0) / 2.0);
        let mut request = Request::new(big(40_000));
        request.metadata_mut().insert("grpc-timeout", format!("{}u", micros as u64).parse().expect("a header"));
        match clients.queries.evaluate(request).await {
            Ok(_) => answered += 1,
            // tonic's own client has a clock, too, which says CANCELLED with a source; the server's
            // word came too late for it.
            Err(status) if status.source().is_some() => given_up += 1,
            Err(status) => {
                ended += 1;
                assert_eq!(status.code(), Code::DeadlineExceeded, "{status:?}");
            }
        }
    }
    println!("{answered} answered, {ended} ended by the server, {given_up} by the client");
    // How many are which depends on the machine.
    assert!(ended > 0 && answered > 0, "{ended} {answered}");
    drop(server);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_budget_ends_with_what_is_known() {
    let (_dir, _server, mut clients) = room().await;
    let start = Instant::now();
    let request = EvaluateRequest { budget_ms: Some(30), ..big(100_000) };
    let response = clients.queries.evaluate(request).await.expect("answers").into_inner();
    println!("{:?} with a budget of 30 ms", start.elapsed());
    assert!(!response.complete);
    assert_eq!(response.answers.len(), 100_000);
    let late = response.answers.iter().filter(|answer| answer.status() == SolveStatus::Deadline).count();
    assert!(late > 0 && late < 100_000, "{late}");
    for answer in &response.answers {
        assert!(answer.lower <= answer.upper, "{answer:?}");
        assert!(answer.status() != SolveStatus::Converged || answer.upper.is_finite(), "{answer:?}");
    }
}

/// Calls that are dropped do not go on: what comes next is answered as fast as on an idle server.
#[tokio::test(flavor = "multi_thread")]
async fn calls_that_are_dropped_free_the_cores() {
    let (_dir, server, mut clients) = room().await;
    for _ in 0..20 {
        let mut queries = clients.queries.clone();
        let call = tokio::spawn(async move { queries.evaluate(big(100_000)).await.map(|_| ()) });
        tokio::time::sleep(Duration::from_millis(20)).await;
        call.abort();
    }
    tokio::time::sleep(Duration::from_millis(300)).await;
    let before = server.cpu();
    tokio::time::sleep(Duration::from_millis(1000)).await;
    let spent = server.cpu() - before;
    assert!(spent < 0.5, "{spent} s of work in 1 s after all calls were dropped");
    clients.queries.evaluate(big(10)).await.expect("an answer");
}
