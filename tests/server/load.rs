//! Many calls and many connections at once.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::sync::Arc;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::Duration;

use sublevel::body::Body;
use sublevel::service::Config;
use sublevel::service::limits::{MAX_MESSAGE_BYTES, PREFACE_TIMEOUT};
use sublevel::service::proto::{EvaluateRequest, Measure, UpdateSceneRequest};

use tonic_health::pb::HealthCheckRequest;
use tonic_health::pb::health_client::HealthClient;

use crate::harness::{Clients, PATIENCE, Running, at, body_file, object, pair, question};

/// As many long calls as would take every core for themselves: short ones are answered while none
/// of these ends. In a queue each short call would wait for the end of a long one.
#[tokio::test(flavor = "multi_thread")]
async fn a_short_query_does_not_wait_for_long_ones() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let id = clients.put(&Body::cylinder("post", 0.2, 1.0).expect("a cylinder")).await;
    clients.make_scene("room").await;
    let upsert_objects = vec![object("a", &id, at(0.0)), object("b", &id, at(1.0))];
    clients.update(UpdateSceneRequest { scene: "room".into(), upsert_objects, ..Default::default() }).await;
    let ask = |count| EvaluateRequest {
        accuracy: Some(1e-300),
        outputs: Vec::new(),
        ..question(vec![pair("a", "b"); count], &[Measure::Distance])
    };

    let over = Arc::new(AtomicU32::new(0));
    let cores = std::thread::available_parallelism().map_or(1, usize::from);
    let mut long = Vec::new();
    for _ in 0..2 * cores {
        let (mut queries, over, request) = (server.connect().await.queries, over.clone(), ask(4096));
        long.push(tokio::spawn(async move {
            let answers = queries.evaluate(request).await.expect("answers").into_inner().answers;
            over.fetch_add(1, Ordering::SeqCst);
            answers
        }));
    }
    // They are under way by then.
    tokio::time::sleep(Duration::from_millis(30)).await;
    let (mut overtook, mut ended) = (0, over.load(Ordering::SeqCst));
    while overtook < 3 && (ended as usize) < 2 * cores {
        clients.queries.evaluate(ask(1)).await.expect("an answer");
        let now = over.load(Ordering::SeqCst);
        overtook += u32::from(now == ended);
        ended = now;
    }
    assert_eq!(overtook, 3, "short calls were held up to the end of long ones");
    for call in long {
        assert_eq!(call.await.expect("a call").len(), 4096);
    }
}

/// A call on a connection of its own, however long it takes to get in.
async fn call(server: &Running) -> Clients {
    let mut clients = server.connect().await;
    clients.make_scene("hall").await;
    clients
}

#[tokio::test(flavor = "multi_thread")]
async fn silent_connections_are_closed_and_do_not_lock_others_out() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let places = Config::default().limits.connections;
    let mut mute: Vec<_> = (0..places + 20).map(|_| TcpStream::connect(server.addr).expect("connected")).collect();
    // Half a greeting is as good as none.
    mute[0].write_all(b"PRI * HT").expect("written");
    let patience = PREFACE_TIMEOUT + PATIENCE;
    let mut clients = tokio::time::timeout(patience, call(&server)).await.expect("there is room again");
    mute[0].set_read_timeout(Some(patience)).expect("set");
    match mute[0].read(&mut [0; 64]) {
        Ok(count) => assert_eq!(count, 0, "nothing but the end"),
        Err(error) => assert_eq!(error.kind(), std::io::ErrorKind::ConnectionReset),
    }
    assert_eq!(clients.revision("hall").await, 1, "who speaks may pause as long as it likes");
}

#[tokio::test(flavor = "multi_thread")]
async fn running_out_of_file_descriptors_is_waited_out() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start_limited(dir.path(), 40);
    let mute: Vec<_> = (0..60).map(|_| TcpStream::connect(server.addr).expect("connected")).collect();
    tokio::time::sleep(Duration::from_millis(200)).await;
    let before = server.cpu();
    tokio::time::sleep(Duration::from_secs(2)).await;
    let spent = server.cpu() - before;
    assert!(spent < 0.5, "{spent} s of work in 2 s of waiting");
    drop(mute);
    tokio::time::timeout(PATIENCE, call(&server)).await.expect("there is room again");
    // One line for each time it begins to fail, not one for each try.
    let lines = Running::log(dir.path()).matches("cannot accept").count();
    assert!((1..=8).contains(&lines), "{lines} lines");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_flood_of_large_messages_stays_within_bounds_and_health_answers() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = call(&server).await;
    // Spaces are read to their end before the file is refused.
    let file = body_file(vec![b' '; MAX_MESSAGE_BYTES - 64]);
    let mut flood = Vec::new();
    for _ in 0..12 {
        let bodies = server.connect().await.bodies;
        for _ in 0..20 {
            let (mut bodies, file) = (bodies.clone(), file.clone());
            flood.push(tokio::spawn(async move { bodies.create_body(file).await.expect_err("refused").code() }));
        }
    }
    let mut health = HealthClient::new(clients.channel.clone());
    for _ in 0..5 {
        tokio::time::sleep(Duration::from_millis(50)).await;
        let check = health.check(HealthCheckRequest::default());
        tokio::time::timeout(PATIENCE, check).await.expect("in time").expect("an answer");
    }
    for call in flood {
        // They wait for their turn; none is turned away for the crowd.
        assert_eq!(call.await.expect("a call"), tonic::Code::InvalidArgument);
    }
    let peak = server.peak_memory_mib();
    println!("{peak} MiB at the peak");
    assert!(peak < 500, "{peak} MiB at the peak, of 960 MiB sent");
    assert_eq!(clients.revision("hall").await, 1);
}
