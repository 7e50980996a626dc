//! Starting, being ready, stopping; and the `push` command.

use std::time::Duration;

use sublevel::body::Body;
use sublevel::service::proto::{CreateSceneRequest, ListBodiesRequest};
use tonic_health::pb::health_client::HealthClient;
use tonic_health::pb::{HealthCheckRequest, health_check_response::ServingStatus};
use tonic_reflection::pb::v1::server_reflection_client::ServerReflectionClient;
use tonic_reflection::pb::v1::{
    ServerReflectionRequest, server_reflection_request::MessageRequest, server_reflection_response::MessageResponse,
};

use crate::harness::{Running, ball, command, run};

#[tokio::test(flavor = "multi_thread")]
async fn a_second_server_on_the_same_data_is_refused_by_name() {
    let dir = tempfile::tempdir().expect("a directory");
    let _first = Running::start(dir.path());
    let second = command(dir.path()).stderr(std::process::Stdio::piped()).output().expect("it runs");
    assert!(!second.status.success());
    assert!(second.stdout.is_empty(), "it never said that it listens");
    let stderr = String::from_utf8_lossy(&second.stderr);
    assert!(stderr.contains(dir.path().to_str().expect("text")) && stderr.contains("in use"), "{stderr}");
}

#[test]
fn a_server_that_can_not_start_says_why() {
    let dir = tempfile::tempdir().expect("a directory");
    let data = dir.path().join("data");
    let open = run(&["serve", "--listen", "0.0.0.0:0", "--data", data.to_str().expect("text")]);
    assert!(!open.status.success());
    assert!(String::from_utf8_lossy(&open.stderr).contains("--insecure"));

    let file = dir.path().join("file");
    std::fs::write(&file, "no directory").expect("written");
    let no_dir = run(&["serve", "--listen", "127.0.0.1:0", "--data", file.to_str().expect("text")]);
    assert!(!no_dir.status.success());
    assert!(String::from_utf8_lossy(&no_dir.stderr).contains("data directory"));

    std::fs::create_dir(&data).expect("made");
    std::fs::write(data.join("catalogue.redb"), "this was never a database, whatever its name says").expect("written");
    let damaged = run(&["serve", "--listen", "127.0.0.1:0", "--data", data.to_str().expect("text")]);
    assert!(!damaged.status.success());
    let stderr = String::from_utf8_lossy(&damaged.stderr);
    assert!(stderr.contains("catalogue") && !stderr.contains("panicked"), "{stderr}");
    assert!(open.stdout.is_empty() && no_dir.stdout.is_empty() && damaged.stdout.is_empty());
}

#[tokio::test(flavor = "multi_thread")]
async fn health_follows_loading_and_stopping() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    for i in 0..200 {
        clients.put(&Body::cylinder("post", 0.1 + f64::from(i) * 1e-3, 1.0).expect("a cylinder")).await;
    }
    server.kill();

    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mut health = HealthClient::new(clients.channel.clone());
    let service = "sublevel.v1.QueryService";
    let request = || HealthCheckRequest { service: service.into() };
    let mut watch = health.watch(request()).await.expect("a watch").into_inner();
    let mut now = ServingStatus::NotServing;
    while now != ServingStatus::Serving {
        now = watch.message().await.expect("a message").expect("a message").status();
    }
    // Bodies that are not proven yet are proven for the list.
    let page = clients.bodies.list_bodies(ListBodiesRequest { page_size: 1000, page_token: String::new() }).await;
    assert_eq!(page.expect("a page").into_inner().bodies.len(), 200);
    for service in ["", "sublevel.v1.BodyService", "sublevel.v1.SceneService"] {
        let now = health.check(HealthCheckRequest { service: service.into() }).await.expect("an answer").into_inner();
        assert_eq!(now.status(), ServingStatus::Serving);
    }

    // The open watch would keep the server from draining for ever.
    server.terminate();
    let now = watch.message().await.expect("a message").expect("a message").status();
    assert_eq!(now, ServingStatus::NotServing);
    let status = server.wait();
    assert_eq!(status.code(), Some(0));
}

#[tokio::test(flavor = "multi_thread")]
async fn idle_connections_do_not_delay_the_stop() {
    // A client that has nothing to say is asked to go; one that never said anything is cut after
    // the drain at the latest, which the log reports, or when a second signal says so.
    for (silent, twice) in [(false, false), (true, false), (true, true)] {
        let dir = tempfile::tempdir().expect("a directory");
        let mut server = Running::start_limited(dir.path(), 256);
        let mut clients = server.connect().await;
        clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list");
        let _silent = silent.then(|| std::net::TcpStream::connect(server.addr).expect("connected"));
        server.terminate();
        if twice {
            tokio::time::sleep(Duration::from_millis(500)).await;
            server.terminate();
        }
        assert_eq!(server.wait().code(), Some(0));
        let drained = Running::log(dir.path()).contains("still open after");
        assert!(!drained || silent && !twice, "silent: {silent}, a second signal: {twice}");
    }
}

/// As soon as the first line is out, both signals mean an orderly stop.
#[test]
fn the_first_line_promises_an_orderly_stop() {
    for _ in 0..20 {
        let dir = tempfile::tempdir().expect("a directory");
        let mut server = Running::start(dir.path());
        server.interrupt();
        assert_eq!(server.wait().code(), Some(0));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_log_states_what_was_loaded_changed_and_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start_limited(dir.path(), 256);
    let mut clients = server.connect().await;
    let id = clients.put(&ball(1.0)).await;
    clients.make_scene("room").await;
    clients.scenes.create_scene(CreateSceneRequest { name: "room".into() }).await.expect_err("taken");
    let log = Running::log(dir.path());
    for word in [dir.path().to_str().expect("text"), "catalogue loaded", &id, "scene created", "refused", "CreateScene"]
    {
        assert!(log.contains(word), "no {word} in\n{log}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn reflection_lists_the_services() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let clients = server.connect().await;
    let mut reflection = ServerReflectionClient::new(clients.channel);
    let ask = |message| ServerReflectionRequest { host: String::new(), message_request: Some(message) };
    let requests = tokio_stream::iter([
        ask(MessageRequest::ListServices(String::new())),
        ask(MessageRequest::FileContainingSymbol("sublevel.v1.QueryService".into())),
    ]);
    let mut answers = reflection.server_reflection_info(requests).await.expect("a stream").into_inner();
    let answer = answers.message().await.expect("an answer").expect("an answer").message_response;
    let Some(MessageResponse::ListServicesResponse(list)) = answer else { panic!("{answer:?}") };
    let names: Vec<_> = list.service.iter().map(|service| service.name.as_str()).collect();
    for name in
        ["BodyService", "SceneService", "QueryService", "HierarchyService"].map(|name| format!("sublevel.v1.{name}"))
    {
        assert!(names.contains(&name.as_str()), "{names:?}");
    }
    assert!(names.contains(&"grpc.health.v1.Health") && names.iter().any(|name| name.starts_with("grpc.reflection")));
    let answer = answers.message().await.expect("an answer").expect("an answer").message_response;
    assert!(matches!(answer, Some(MessageResponse::FileDescriptorResponse(_))), "{answer:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn push_stores_files_and_says_what_went_wrong() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let file = dir.path().join("ball.json");
    std::fs::write(&file, ball(1.0).to_json()).expect("written");
    let (file, url) = (file.to_str().expect("text"), server.url());
    let first = run(&["push", file, "--server", &url, "--json"]);
    assert!(first.status.success(), "{}", String::from_utf8_lossy(&first.stderr));
    let rows: serde_json::Value = serde_json::from_slice(&first.stdout).expect("JSON");
    assert_eq!(rows[0]["id"], ball(1.0).id().to_string());
    assert_eq!(rows[0]["created"], true);
    let again = run(&["push", file, "--server", &url]);
    assert!(again.status.success());
    assert!(String::from_utf8_lossy(&again.stdout).contains(&ball(1.0).id().to_string()));

    let changed = dir.path().join("changed.json");
    std::fs::write(&changed, ball(1.0).to_json().replacen("ball", "b\\u0000", 1)).expect("written");
    let free = std::net::TcpListener::bind("127.0.0.1:0").expect("a port").local_addr().expect("an address");
    let nobody = format!("http://{free}");
    let large = dir.path().join("large.json");
    std::fs::write(&large, " ".repeat((4 << 20) + 1)).expect("written");
    for (args, word) in [
        (["push", large.to_str().expect("text"), "--server", &url], "large.json"),
        (["push", "missing.json", "--server", &url], "check the path"),
        (["push", changed.to_str().expect("text"), "--server", &url], "changed.json"),
        (["push", "missing.json", "--server", &url], "missing.json"),
        (["push", file, "--server", &nobody], "sublevel serve"),
        (["push", file, "--server", "not a url"], "--server"),
    ] {
        let refused = run(&args);
        let stderr = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && refused.stdout.is_empty());
        assert!(stderr.contains(word) && stderr.trim_end().lines().count() == 1, "{stderr}");
        assert!(stderr.matches("sublevel fit").count() <= 1 && stderr.matches("; ").count() <= 1, "{stderr}");
    }
}
