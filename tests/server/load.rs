//! Many calls and many connections at once.

use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};

use sublevel::body::Body;
use sublevel::service::proto::{Accuracy, EvaluateRequest, Measure, UpdateSceneRequest};

use crate::harness::{Running, at, object, pair};

/// As many long calls as would take every core for themselves; none of them is over when the short one is answered.
#[tokio::test(flavor = "multi_thread")]
async fn a_short_query_does_not_wait_for_long_ones() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&Body::cylinder("post", 0.2, 1.0).expect("a cylinder")).await;
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &id, at(0.0)), object("b", &id, at(1.0))];
    clients.update(UpdateSceneRequest { name: "room".into(), upsert_objects, ..Default::default() }).await;
    let ask = |count| EvaluateRequest {
        scene: "room".into(),
        pairs: vec![pair("a", "b"); count],
        measures: vec![Measure::Distance.into()],
        accuracy: Some(Accuracy { distance_relative: Some(1e-300), level_relative: None }),
        ..EvaluateRequest::default()
    };

    let over = Arc::new(AtomicU32::new(0));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut long = Vec::new();
    for _ in 0..2 * cores {
        let (mut queries, over, request) = (server.connect().await.queries, over.clone(), ask(4096));
        long.push(tokio::spawn(async move {
            let results = queries.evaluate(request).await.expect("answers").into_inner().results;
            over.fetch_add(1, Ordering::SeqCst);
            results
        }));
    }
    tokio::time::sleep(std::time::Duration::from_millis(30)).await;
    assert_eq!(over.load(Ordering::SeqCst), 0, "the long calls are too short for this test");
    for _ in 0..3 {
        clients.queries.evaluate(ask(1)).await.expect("an answer");
    }
    assert_eq!(over.load(Ordering::SeqCst), 0, "a short call was held up to the end of a long one");
    for call in long {
        let results = call.await.expect("a call");
        assert!((0..4096).eq(results.iter().map(|result| result.pair_index)), "every pair once and in order");
    }
}
