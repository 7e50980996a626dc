//! `sublevel load`: what it reports of a server that answers, stands still, or is not there.

use std::process::{Command, Output, Stdio};
use std::time::Duration;

use serde_json::Value;
use sublevel::client::{Client, ClientOptions, Question, StatesQuestion};
use sublevel::load::EchoProcess;
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;

use crate::harness::{Running, command};
use crate::operation::{Issuer, https};

fn load(server: &str, arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel"));
    command.args(["load", "--server", server, "--connections", "2"]).args(arguments);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

fn read(output: &Output, path: &std::path::Path) -> Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_str(&std::fs::read_to_string(path).expect("written")).expect("JSON")
}

#[tokio::test(flavor = "multi_thread")]
async fn every_scenario_is_measured_beside_an_echo_and_leaves_nothing_behind() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let (json, svg) = (dir.path().join("load.json"), dir.path().join("load.svg"));
    for scenario in ["pair", "pairs", "within", "states", "mixed"] {
        let mut command = load(&server.url(), &[scenario, "--rate", "40,80", "--duration", "0.5", "--warmup", "0.1"]);
        let output = command.arg("--json").arg(&json).arg("--svg").arg(&svg).output().expect("it runs");
        let report = read(&output, &json);
        for target in ["server", "echo"] {
            for (rate, of) in [40.0, 80.0].iter().zip(report[target].as_array().expect("rates")) {
                assert_eq!(of["offered_per_s"].as_f64(), Some(*rate), "{scenario} {target}");
                let answered = of["answered_per_s"].as_f64().expect("a number") * 0.5;
                let due = of["due"].as_f64().expect("a number");
                assert!(due > 0.0 && answered == due, "{scenario} {target}: {answered} of {due}");
                assert!(of["errors"].as_object().expect("codes").is_empty(), "{scenario}: {of}");
                let latency = |key: &str| of["latency_ms"][key].as_f64().expect("a number");
                assert!(latency("p50") > 0.0 && latency("p50") <= latency("p99") && latency("p99") <= latency("max"));
                assert_eq!(of["health"].is_object(), target == "server", "{of}");
                assert!(of["server_mib"].as_f64().is_some_and(|mib| mib > 1.0) == (target == "echo"), "{of}");
            }
        }
        let table = String::from_utf8(output.stdout).expect("text");
        assert_eq!(table.lines().count(), 5, "{table}");
        assert!(std::fs::read_to_string(&svg).expect("written").contains("server, 99 %"));
    }
    assert!(server.client().await.list_scenes().await.expect("a list").is_empty());
}

/// Far more than a server can answer, with a short queue: some calls are answered, the others
/// are refused with a time to retry after; probes succeed meanwhile, and memory does not grow.
#[tokio::test(flavor = "multi_thread")]
async fn what_is_too_much_is_shed_while_the_server_stays_well() {
    let dir = tempfile::tempdir().expect("a directory");
    let (settings, scenario) = (dir.path().join("server.toml"), dir.path().join("what-if.toml"));
    std::fs::write(&settings, "[limits]\ncalls = 2\nqueue_ms = 5\n").expect("written");
    let states = "objects = 200\n[[calls]]\nkind = \"states\"\nstates = 2000\nmoving = 4\n";
    std::fs::write(&scenario, states).expect("written");
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--config").arg(&settings);
    let server = Running::spawn(serve);
    let json = dir.path().join("load.json");
    let name = scenario.to_str().expect("text");
    let mut command = load(&server.url(), &[name, "--rate", "20,2000", "--duration", "1", "--no-echo"]);
    let output = command.args(["--server-pid", &server.pid().to_string(), "--json"]).arg(&json).output();
    let report = read(&output.expect("it runs"), &json);
    let [calm, flooded] = [0, 1].map(|index| &report["server"][index]);
    let errors = flooded["errors"].as_object().expect("codes");
    assert_eq!(errors.keys().collect::<Vec<_>>(), ["ResourceExhausted"], "{flooded}");
    assert!(flooded["answered_per_s"].as_f64() > Some(0.0), "{flooded}");
    assert_eq!(flooded["health"]["failed"].as_u64(), Some(0), "{flooded}");
    assert!(flooded["health"]["longest_ms"].as_f64() > Some(0.0), "{flooded}");
    let [before, after] = [calm, flooded].map(|of| of["server_mib"].as_f64().expect("MiB"));
    // Windows of the connections, of which each holds messages that were not read.
    assert!(after < before + 100.0, "{before} MiB before, {after} after");
}

/// The transport of a server with certificates is compared with one that is encrypted alike.
#[tokio::test(flavor = "multi_thread")]
async fn the_echo_of_an_encrypted_server_is_encrypted() {
    let dir = tempfile::tempdir().expect("a directory");
    let issuer = Issuer::new();
    let [certificate, key] = issuer.write(dir.path(), "server", false);
    let (ca, json) = (dir.path().join("ca.pem"), dir.path().join("load.json"));
    issuer.write_root(&ca);
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--tls-certificate").arg(&certificate).arg("--tls-key").arg(&key);
    let server = Running::spawn(serve);
    let url = https(&server);
    let mut command = load(&url, &["pair", "--rate", "50", "--duration", "0.5", "--warmup", "0.1"]);
    let report = read(&command.env("SUBLEVEL_CA", &ca).arg("--json").arg(&json).output().expect("it runs"), &json);
    assert_eq!(report["encrypted"].as_bool(), Some(true));
    for target in ["server", "echo"] {
        let of = &report[target][0];
        assert!(of["errors"].as_object().expect("codes").is_empty() && of["due"].as_u64() > Some(0), "{of}");
    }

    let echo = EchoProcess::start(env!("CARGO_BIN_EXE_sublevel").as_ref(), 100, true, None).expect("an echo server");
    Client::connect_with(echo.url(), &echo.options()).await.expect("encrypted");
    let stranger = ClientOptions { ca: Some(ca), ..ClientOptions::default() };
    Client::connect_with(echo.url(), &stranger).await.expect_err("another root");
    if let Ok(client) = Client::connect(&echo.url().replace("https", "http")).await {
        client.list_scenes().await.expect_err("not encrypted");
    }
}

/// A tenth of the calls comes due while the server stands still; a closed loop would see one.
#[tokio::test(flavor = "multi_thread")]
async fn a_server_that_stands_still_is_seen() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let json = dir.path().join("load.json");
    let arguments =
        ["pair", "--rate", "200", "--duration", "3", "--warmup", "1", "--arrivals", "constant", "--no-echo"];
    let running = load(&server.url(), &arguments).arg("--json").arg(&json).spawn().expect("it runs");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    server.signal("-STOP");
    tokio::time::sleep(Duration::from_millis(400)).await;
    server.signal("-CONT");
    let report = read(&running.wait_with_output().expect("it ends"), &json);
    let of = &report["server"][0];
    let latency = |key: &str| of["latency_ms"][key].as_f64().expect("a number");
    assert!(latency("max") >= 350.0, "{of}");
    // 400 ms of 3 s: more than a tenth of all calls waited, half of those longer than 200 ms.
    assert!(latency("p99") >= 250.0 && latency("p50") < latency("p99"), "{of}");
    assert!(of["errors"].as_object().expect("codes").is_empty(), "{of}");
}

#[test]
fn what_cannot_be_measured_is_refused_with_the_remedy() {
    let nobody = "http://127.0.0.1:9";
    for (arguments, words) in [
        (&["pair"][..], "cannot reach"),
        (&["nowhere.toml"], "nowhere.toml"),
        (&["pair", "--rate", "0"], "--rate"),
        (&["pair", "--rate", "nan"], "--rate"),
        (&["pair", "--duration", "0"], "--duration"),
        (&["pair", "--connections", "0"], "--connections"),
    ] {
        let output = load(nobody, arguments).output().expect("it runs");
        let said = String::from_utf8(output.stderr).expect("text");
        assert!(!output.status.success() && said.contains(words), "{arguments:?}: {said}");
    }
}

/// What a client asks through the recorder is answered, and can be asked again.
#[tokio::test(flavor = "multi_thread")]
async fn recorded_calls_are_asked_again() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let direct = server.client().await;
    let body = direct.create_ball("ball", 0.1).await.expect("stored");
    direct.create_scene("cell").await.expect("made");
    let at = |x: f64| Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    direct.put_objects("cell", [("a", &body, at(0.0)), ("b", &body, at(1.0))]).await.expect("placed");

    let (recording, json) = (dir.path().join("calls.jsonl"), dir.path().join("load.json"));
    let mut record = Command::new(env!("CARGO_BIN_EXE_sublevel"));
    record.args(["record", "--server", &server.url(), "--listen", "127.0.0.1:0", "--out"]).arg(&recording);
    let mut recorder = {
        record.stdin(Stdio::null()).stdout(Stdio::piped());
        Running::spawn(record)
    };
    let client = recorder.client().await;
    for x in [0.5, 0.7, 0.9] {
        client.set_poses("cell", [("b", at(x))]).await.expect("passed on");
        let pairs = Question::pairs([("a", "b")]);
        let answers = client.evaluate("cell", pairs, &[Measure::Distance]).await.expect("an answer");
        assert!((answers.rows[0].value.expect("a value") - (x - 0.2)).abs() < 1e-7);
    }
    let states = StatesQuestion::new(["a"]).with_states(&[at(0.0), at(9.0)]);
    client.check_states("cell", states).await.expect("verdicts");
    client.scene("nowhere").await.expect_err("a refusal passes, too");
    recorder.interrupt();
    assert!(recorder.wait().success());
    assert_eq!(std::fs::read_to_string(&recording).expect("written").lines().count(), 4);

    let name = recording.to_str().expect("text");
    let output = load(&server.url(), &[name, "--rate", "100", "--duration", "0.5", "--warmup", "0"])
        .arg("--json")
        .arg(&json)
        .output();
    let report = read(&output.expect("it runs"), &json);
    let of = &report["server"][0];
    assert!(of["errors"].as_object().expect("codes").is_empty() && of["due"].as_u64().expect("a number") > 20, "{of}");
    assert_eq!(direct.list_scenes().await.expect("a list").len(), 1, "load has removed its own");

    let there = Command::new(env!("CARGO_BIN_EXE_sublevel")).args(["record", "--out", name]).output().expect("it runs");
    assert!(String::from_utf8_lossy(&there.stderr).contains("choose another --out"));
    std::fs::write(&recording, "{}\n").expect("written");
    let refused = load(&server.url(), &[name]).output().expect("it runs");
    assert!(String::from_utf8_lossy(&refused.stderr).contains("line 1 is no call"));
}
