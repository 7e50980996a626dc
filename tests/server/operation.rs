//! A server as operators run it: settings, certificates, tokens, probes, metrics.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::time::{Duration, Instant};

use nalgebra::Vector3;
use rcgen::{
    BasicConstraints, CertificateParams, CertificateRevocationListParams, CertifiedIssuer, IsCa, KeyIdMethod, KeyPair,
    RevokedCertParams,
};
use sublevel::body::Body;
use sublevel::client::{Client, ClientError, ClientOptions, Question, StatesQuestion};
use sublevel::measure::Pose;
use sublevel::scene::query::Measure;
use tonic::Code;

use crate::harness::{PATIENCE, Running, command};

/// Certificates of a test: a root, and what it has signed.
pub(crate) struct Issuer(CertifiedIssuer<'static, KeyPair>);

impl Issuer {
    pub(crate) fn new() -> Self {
        let mut params = CertificateParams::new(Vec::new()).expect("parameters");
        params.is_ca = IsCa::Ca(BasicConstraints::Unconstrained);
        Self(CertifiedIssuer::self_signed(params, KeyPair::generate().expect("a key")).expect("a root"))
    }

    pub(crate) fn write_root(&self, path: &Path) {
        std::fs::write(path, self.0.pem()).expect("written");
    }

    /// A certificate for 127.0.0.1 and its key, written as NAME.pem and NAME.key.
    pub(crate) fn write(&self, dir: &Path, name: &str, expired: bool) -> [PathBuf; 2] {
        self.write_with(dir, name, |params| {
            if expired {
                params.not_after = rcgen::date_time_ymd(2001, 1, 1);
            }
        })
    }

    /// The same with a number.
    fn write_numbered(&self, dir: &Path, name: &str, number: u64) -> [PathBuf; 2] {
        self.write_with(dir, name, |params| params.serial_number = Some(number.into()))
    }

    /// A list of numbers that are revoked.
    fn write_revoked(&self, path: &Path, numbers: &[u64]) {
        let revoked = |&number: &u64| RevokedCertParams {
            serial_number: number.into(),
            revocation_time: rcgen::date_time_ymd(2020, 1, 1),
            reason_code: None,
            invalidity_date: None,
        };
        let list = CertificateRevocationListParams {
            this_update: rcgen::date_time_ymd(2020, 1, 1),
            next_update: rcgen::date_time_ymd(4000, 1, 1),
            crl_number: 1.into(),
            issuing_distribution_point: None,
            revoked_certs: numbers.iter().map(revoked).collect(),
            key_identifier_method: KeyIdMethod::Sha256,
        };
        let signed = list.signed_by(&self.0).expect("signed");
        std::fs::write(path, signed.pem().expect("PEM")).expect("written");
    }

    fn write_with(&self, dir: &Path, name: &str, change: impl FnOnce(&mut CertificateParams)) -> [PathBuf; 2] {
        let mut params = CertificateParams::new(vec!["127.0.0.1".to_owned()]).expect("parameters");
        change(&mut params);
        let key = KeyPair::generate().expect("a key");
        let certificate = params.signed_by(&key, &self.0).expect("signed");
        let files = [dir.join(format!("{name}.pem")), dir.join(format!("{name}.key"))];
        std::fs::write(&files[0], certificate.pem()).expect("written");
        std::fs::write(&files[1], key.serialize_pem()).expect("written");
        files
    }
}

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sublevel")).args(arguments).output().expect("it runs")
}

/// A token, and the file that has its entry.
fn token(file: &Path, name: &str, role: &str) -> String {
    let made = run(&["token", name, "--role", role]);
    assert!(made.status.success());
    let mut text = std::fs::read_to_string(file).unwrap_or_default();
    text += &String::from_utf8(made.stdout).expect("an entry");
    std::fs::write(file, text).expect("written");
    String::from_utf8(made.stderr).expect("a token").trim().rsplit(' ').next().expect("a token").to_owned()
}

pub(crate) fn https(server: &Running) -> String {
    format!("https://{}", server.addr)
}

/// Tries until it works, or until it does not any more.
pub(crate) async fn eventually(mut works: impl AsyncFnMut() -> bool) {
    let start = Instant::now();
    while !works().await {
        assert!(start.elapsed() < PATIENCE, "it never came");
        tokio::time::sleep(Duration::from_millis(50)).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_client_needs_the_root_and_sees_a_new_certificate() {
    let dir = tempfile::tempdir().expect("a directory");
    let (issuer, stranger) = (Issuer::new(), Issuer::new());
    let [certificate, key] = issuer.write(dir.path(), "server", false);
    let (ca, other) = (dir.path().join("ca.pem"), dir.path().join("other.pem"));
    issuer.write_root(&ca);
    stranger.write_root(&other);
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--tls-certificate").arg(&certificate).arg("--tls-key").arg(&key);
    let server = Running::spawn(serve);
    let with = |ca: &Path| ClientOptions { ca: Some(ca.to_owned()), ..ClientOptions::default() };

    let client = Client::connect_with(&https(&server), &with(&ca)).await.expect("encrypted");
    client.create_scene("cell").await.expect("made");
    assert!(client.health().await.expect("an answer"));
    let unknown = Client::connect_with(&https(&server), &with(&other)).await.expect_err("another root");
    assert!(matches!(unknown, ClientError::Unreachable { .. }), "{unknown}");
    if let Ok(client) = Client::connect(&server.url()).await {
        client.list_scenes().await.expect_err("not encrypted");
    }
    // A server whose own certificate has expired is not believed.
    let [certificate_2, key_2] = issuer.write(dir.path(), "expired", true);
    let mut serve = command(&dir.path().join("data-2"));
    serve.arg("--tls-certificate").arg(&certificate_2).arg("--tls-key").arg(&key_2);
    let late = Running::spawn(serve);
    let expired = Client::connect_with(&https(&late), &with(&ca)).await.expect_err("expired");
    assert!(matches!(expired, ClientError::Unreachable { .. }), "{expired}");
    let rootless = Client::connect_with(&https(&server), &ClientOptions::default()).await.expect_err("no root");
    assert!(rootless.to_string().contains("SUBLEVEL_CA"), "{rootless}");

    // Files that are damaged change nothing; those of another root count from then on.
    std::fs::write(&certificate, "nonsense").expect("written");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    Client::connect_with(&https(&server), &with(&ca)).await.expect("the earlier certificate stays");
    stranger.write(dir.path(), "server", false);
    eventually(async || Client::connect_with(&https(&server), &with(&other)).await.is_ok()).await;
    assert!(Client::connect_with(&https(&server), &with(&ca)).await.is_err());
    client.list_scenes().await.expect("a connection that was open goes on");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_can_ask_clients_for_certificates() {
    let dir = tempfile::tempdir().expect("a directory");
    let (issuer, clients) = (Issuer::new(), Issuer::new());
    let [certificate, key] = issuer.write(dir.path(), "server", false);
    let (ca, client_ca) = (dir.path().join("ca.pem"), dir.path().join("clients.pem"));
    issuer.write_root(&ca);
    clients.write_root(&client_ca);
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--tls-certificate").arg(&certificate).arg("--tls-key").arg(&key);
    let crl = dir.path().join("revoked.pem");
    clients.write_revoked(&crl, &[]);
    serve.arg("--tls-client-ca").arg(&client_ca).arg("--tls-client-crl").arg(&crl);
    let server = Running::spawn(serve);
    let known = clients.write(dir.path(), "known", false);
    let lost = clients.write_numbered(dir.path(), "lost", 77);
    let expired = clients.write(dir.path(), "expired", true);
    let foreign = issuer.write(dir.path(), "foreign", false);
    let reach = async |identity: Option<[PathBuf; 2]>| {
        let options = ClientOptions { ca: Some(ca.clone()), identity, ..ClientOptions::default() };
        // With TLS 1.3 a client learns with its first call that it was refused.
        match Client::connect_with(&https(&server), &options).await {
            Ok(client) => client.list_scenes().await.is_ok(),
            Err(_) => false,
        }
    };
    assert!(reach(Some(known.clone())).await);
    assert!(reach(Some(lost.clone())).await);
    assert!(!reach(None).await, "no certificate");
    assert!(!reach(Some(expired)).await, "expired");
    assert!(!reach(Some(foreign)).await, "of another root");
    let torn = dir.path().join("torn.pem");
    let text = std::fs::read_to_string(&known[0]).expect("read");
    std::fs::write(&torn, &text[..text.len() / 2]).expect("written");
    assert!(!reach(Some([torn, known[1].clone()])).await, "malformed");

    clients.write_revoked(&crl, &[77]);
    eventually(async || !reach(Some(lost.clone())).await).await;
    assert!(reach(Some(known.clone())).await, "the others go on");
    // What is no list changes nothing.
    std::fs::write(&crl, "nonsense").expect("written");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    assert!(!reach(Some(lost)).await && reach(Some(known)).await, "the earlier list stays");
}

#[tokio::test(flavor = "multi_thread")]
async fn tokens_allow_what_their_role_says_and_can_be_changed() {
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("tokens.toml");
    let (reader, writer) = (token(&file, "planner", "read"), token(&file, "cell", "write"));
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--tokens").arg(&file);
    let server = Running::spawn(serve);
    let with = |token: &str| ClientOptions { token: Some(token.to_owned()), ..ClientOptions::default() };
    let connect = async |token: &str| Client::connect_with(&server.url(), &with(token)).await.expect("connected");

    let nobody = Client::connect(&server.url()).await.expect("connected");
    let refused = nobody.list_scenes().await.expect_err("no token");
    assert_eq!((refused.code(), refused.reason().as_deref()), (Some(Code::Unauthenticated), Some("TOKEN_MISSING")));
    eventually(async || nobody.health().await.expect("probes need no token")).await;
    for wrong in ["", "x", &reader[1..], &reader.to_uppercase(), &"f".repeat(64)] {
        let refused = connect(wrong).await.list_scenes().await.expect_err(wrong);
        assert_eq!((refused.code(), refused.reason().as_deref()), (Some(Code::Unauthenticated), Some("TOKEN_UNKNOWN")));
    }
    let reading = connect(&reader).await;
    assert!(reading.list_scenes().await.expect("allowed").is_empty());
    let refused = reading.create_scene("cell").await.expect_err("read only");
    assert_eq!((refused.code(), refused.reason().as_deref()), (Some(Code::PermissionDenied), Some("ROLE_NEEDED")));
    assert!(refused.to_string().contains("write") && refused.to_string().contains("planner"), "{refused}");
    connect(&writer).await.create_scene("cell").await.expect("allowed");

    let mut poses = connect(&writer).await.stream_poses("cell", []).await.expect("a stream");
    let mut unread = connect(&writer).await.stream_poses("cell", []).await.expect("a stream");
    // A token that is gone is refused, a new one is taken; nonsense changes nothing.
    std::fs::write(&file, "token = 7").expect("written");
    tokio::time::sleep(Duration::from_millis(2500)).await;
    reading.list_scenes().await.expect("the earlier tokens stay");
    std::fs::write(&file, "").expect("written");
    let fresh = token(&file, "next", "read");
    eventually(async || connect(&fresh).await.list_scenes().await.is_ok()).await;
    let refused = reading.list_scenes().await.expect_err("revoked");
    assert_eq!(refused.code(), Some(Code::Unauthenticated));
    // So do streams that were open, also one whose client reads nothing.
    eventually(async || unread.send(&[]).await.is_err()).await;
    let ended = loop {
        match poses.next().await {
            Ok(said) => assert!(said.is_some(), "it ended without a reason"),
            Err(error) => break error,
        }
    };
    assert_eq!((ended.code(), ended.reason().as_deref()), (Some(Code::Unauthenticated), Some("TOKEN_UNKNOWN")));
}

/// A port that was free a moment ago.
pub(crate) fn free_port() -> SocketAddr {
    std::net::TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port")
}

/// A page of the admin listener: status and text.
pub(crate) fn page(addr: SocketAddr, path: &str) -> (u16, String) {
    let mut stream = TcpStream::connect(addr).expect("connected");
    write!(stream, "GET {path} HTTP/1.1\r\nhost: probe\r\nconnection: close\r\n\r\n").expect("sent");
    let mut text = String::new();
    stream.read_to_string(&mut text).expect("an answer");
    let status = text.split(' ').nth(1).and_then(|status| status.parse().ok()).expect("a status");
    (status, text.split_once("\r\n\r\n").expect("a body").1.to_owned())
}

#[tokio::test(flavor = "multi_thread")]
async fn probes_and_metrics_say_what_was_asked() {
    let dir = tempfile::tempdir().expect("a directory");
    let admin = free_port();
    let mut serve = command(dir.path());
    serve.args(["--admin", &admin.to_string()]);
    let server = Running::spawn(serve);
    let client = server.client().await;
    let body = client.create_ball("ball", 0.1).await.expect("stored");
    client.create_scene("cell").await.expect("made");
    let at = |x: f64| Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    client.put_objects("cell", [("a", &body, at(0.0)), ("b", &body, at(1.0))]).await.expect("placed");
    client.evaluate("cell", Question::pairs([("a", "b")]), &[Measure::Distance]).await.expect("an answer");
    client.evaluate("cell", Question::pairs([("a", "z")]), &[Measure::Distance]).await.expect_err("nobody");
    let states = StatesQuestion::new(["a"]).with_states(&[at(0.0), at(1.0)]);
    client.check_states("cell", states).await.expect("verdicts");
    // A call that its client gives up counts, too.
    let names: Vec<String> = (0..400).map(|index| format!("o{index}")).collect();
    client.put_objects("cell", names.iter().map(|name| (name.as_str(), &body, at(0.5)))).await.expect("placed");
    let long = client.evaluate("cell", Question::within(1.0).cold(), &[Measure::Penetration]);
    assert!(tokio::time::timeout(Duration::from_millis(20), long).await.is_err());
    let cancelled = "sublevel_calls_total{call=\"QueryService/Evaluate\",code=\"CANCELLED\"} 1";
    eventually(async || page(admin, "/metrics").1.contains(cancelled)).await;
    assert_eq!(page(admin, "/livez"), (200, "ok\n".into()));
    assert_eq!(page(admin, "/readyz"), (200, "ok\n".into()));
    assert_eq!(page(admin, "/other").0, 404);
    let (status, text) = page(admin, "/metrics");
    assert_eq!(status, 200);
    for line in [
        "sublevel_ready 1",
        "sublevel_bodies 1",
        "sublevel_scenes 1",
        "sublevel_connections 1",
        "sublevel_calls_total{call=\"QueryService/Evaluate\",code=\"OK\"} 1",
        "sublevel_calls_total{call=\"QueryService/Evaluate\",code=\"NOT_FOUND\"} 1",
        "sublevel_answers_total{status=\"CONVERGED\"} 1",
        "sublevel_shed_calls_total 0",
        "# EOF",
    ] {
        assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
    }
    // What alerts, the dashboard and the page name is there.
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut named = 0;
    for file in ["deploy/prometheus/rules.yml", "deploy/grafana/sublevel.json", "docs/operations.md"] {
        let words = std::fs::read_to_string(root.join(file)).expect("a file");
        let is_name = |c: char| c.is_ascii_lowercase() || c == '_';
        for name in words.split(|c| !is_name(c)).filter(|word| word.starts_with("sublevel_")) {
            let bare = ["_total", "_bucket"].iter().find_map(|end| name.strip_suffix(end)).unwrap_or(name);
            assert!(text.contains(&format!("# TYPE {bare} ")), "{file}: {name}");
            named += 1;
        }
    }
    assert!(named > 40, "{named}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_server_answers_before_all_its_bodies_are_proven() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let client = server.client().await;
    let mut ids = Vec::new();
    for index in 0..600 {
        ids.push(clients.put(&Body::cylinder("post", 0.1 + 1e-3 * f64::from(index), 1.0).expect("a cylinder")).await);
    }
    let ball = client.create_ball("ball", 0.1).await.expect("stored");
    client.create_scene("cell").await.expect("made");
    let at = |x: f64| Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    client.put_objects("cell", [("a", &ball, at(0.0)), ("b", &ball, at(1.0))]).await.expect("placed");
    server.kill();

    let admin = std::net::TcpListener::bind("127.0.0.1:0").and_then(|listener| listener.local_addr()).expect("a port");
    let mut serve = command(dir.path());
    serve.args(["--admin", &admin.to_string()]);
    let server = Running::spawn(serve);
    eventually(async || page(admin, "/readyz").0 == 200).await;
    let (status, text) = page(admin, "/readyz");
    assert!(status == 200 && text.contains("of 601 bodies are still to be proven"), "{status} {text}");
    assert!(!page(admin, "/metrics").1.contains("\nsublevel_unproven_bodies 0\n"));
    // A scene, and a body at the end of the queue.
    let client = server.client().await;
    client.evaluate("cell", Question::pairs([("a", "b")]), &[Measure::Distance]).await.expect("an answer");
    let last = ids.iter().max().expect("there").parse().expect("an id");
    assert_eq!(client.body(&last).await.expect("proven").id(), &last);
    eventually(async || page(admin, "/readyz").1 == "ok\n").await;
    assert!(page(admin, "/metrics").1.contains("\nsublevel_unproven_bodies 0\n"));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_call_that_waits_too_long_is_shed_with_a_hint() {
    let dir = tempfile::tempdir().expect("a directory");
    let settings = dir.path().join("server.toml");
    std::fs::write(&settings, "[limits]\ncalls = 1\nqueue_ms = 50\n").expect("written");
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--config").arg(&settings);
    let server = Running::spawn(serve);
    let client = server.client().await;
    // Balls, boxes and their like have depths in closed form: these questions would be short.
    let smooth = Body::superellipsoid("smooth", Vector3::zeros(), Vector3::new(0.2, 0.15, 0.1), 6).expect("a body");
    let body = client.create_from_file(smooth.to_json()).await.expect("stored").id;
    client.create_scene("cell").await.expect("made");
    let names: Vec<String> = (0..300).map(|index| format!("o{index}")).collect();
    let at = |x: f64| Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    let objects = names.iter().enumerate().map(|(index, name)| (name.as_str(), &body, at(0.001 * index as f64)));
    client.put_objects("cell", objects).await.expect("placed");
    // The one place is taken by long questions again and again.
    let busy = client.clone();
    let work = tokio::spawn(async move {
        for _ in 0..200 {
            let mut question = Question::within(1.0).cold();
            question.request_mut().budget_ms = Some(300);
            let _ = busy.evaluate("cell", question, &[Measure::Penetration]).await;
        }
    });
    eventually(async || match client.list_scenes().await {
        Ok(_) => false,
        Err(error) => {
            assert_eq!((error.code(), error.reason().as_deref()), (Some(Code::ResourceExhausted), Some("OVERLOADED")));
            true
        }
    })
    .await;
    assert!(client.health().await.expect("probes do not wait"));
    work.abort();
}

#[test]
fn settings_come_from_file_environment_and_flags() {
    let dir = tempfile::tempdir().expect("a directory");
    let file = dir.path().join("server.toml");
    std::fs::write(&file, "listen = \"127.0.0.1:7001\"\n[limits]\ncalls = 7\nqueue_ms = 70\n").expect("written");
    let print = |variables: &[(&str, &str)], flags: &[&str]| {
        let mut serve = Command::new(env!("CARGO_BIN_EXE_sublevel"));
        serve.args(["serve", "--print-config", "--config"]).arg(&file).args(flags);
        serve.env_remove("RUST_LOG").env_remove("SUBLEVEL_SIMD").envs(variables.iter().copied()).stdin(Stdio::null());
        serve.output().expect("it runs")
    };
    let shown = |output: Output| String::from_utf8(output.stdout).expect("text");
    let of_file = shown(print(&[], &[]));
    assert!(of_file.contains("listen = \"127.0.0.1:7001\"") && of_file.contains("calls = 7"), "{of_file}");
    let variables = [("SUBLEVEL_SERVER_LIMITS__CALLS", "8"), ("RUST_LOG", "debug"), ("SUBLEVEL_SIMD", "baseline")];
    let of_environment = shown(print(&variables, &["--listen", "127.0.0.1:7003"]));
    for line in
        ["listen = \"127.0.0.1:7003\"", "calls = 8", "queue_ms = 70", "filter = \"debug\"", "simd = \"baseline\""]
    {
        assert!(of_environment.contains(line), "{line}: {of_environment}");
    }
    // What is printed can be read again.
    std::fs::write(&file, &of_environment).expect("written");
    assert_eq!(shown(print(&[], &[])), of_environment);
    for (variables, flags, words) in [
        (&[("SUBLEVEL_SERVER_LISEN", "x")][..], &[][..], "SUBLEVEL_SERVER_LISEN"),
        (&[("SUBLEVEL_SERVER_LIMITS__CALLS", "many")], &[], "SUBLEVEL_SERVER_LIMITS__CALLS"),
        (&[("SUBLEVEL_SERVER_LIMITS__CALLS", "0")], &[], "limits.calls is 0"),
        (&[("SUBLEVEL_SIMD", "avx3")], &[], "simd: "),
        (&[], &["--listen", "0.0.0.0:1"], "--insecure"),
        (&[("SUBLEVEL_SERVER_TLS__KEY", "k")], &[], "certificate"),
    ] {
        let output = print(variables, flags);
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(1), "{said}");
        assert!(said.contains(words) && said.lines().count() == 1, "{words}: {said}");
    }
}

#[test]
fn a_server_whose_files_cannot_be_used_says_which() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = |name: &str| dir.path().join(name).to_str().expect("text").to_owned();
    let issuer = Issuer::new();
    issuer.write(dir.path(), "one", false);
    issuer.write(dir.path(), "two", false);
    std::fs::write(path("empty"), "").expect("written");
    let data = path("data");
    for (flags, words) in [
        (vec!["--tls-certificate", "absent.pem", "--tls-key", &path("one.key")], vec!["absent.pem", "tls.certificate"]),
        (vec!["--tls-certificate", &path("empty"), "--tls-key", &path("one.key")], vec!["empty", "no certificate"]),
        (vec!["--tls-certificate", &path("one.pem"), "--tls-key", &path("empty")], vec!["empty", "tls.key"]),
        (vec!["--tls-certificate", &path("one.pem"), "--tls-key", &path("two.key")], vec!["key"]),
        (vec!["--tokens", "absent.toml"], vec!["absent.toml", "sublevel token"]),
        (vec!["--config", "absent.toml"], vec!["absent.toml", "--config"]),
    ] {
        let output = run(&[&["serve", "--listen", "127.0.0.1:0", "--data", &data][..], &flags[..]].concat());
        let said = String::from_utf8(output.stderr).expect("text");
        assert_eq!(output.status.code(), Some(1), "{flags:?}: {said}");
        let line = said.lines().last().expect("a line");
        assert!(words.iter().all(|word| line.contains(word)), "{words:?}: {said}");
    }
}

#[test]
fn health_is_a_probe() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut served = false;
    let start = Instant::now();
    while !served && start.elapsed() < PATIENCE {
        served = run(&["health", "--server", &server.url()]).status.success();
    }
    assert!(served);
    let url = server.url();
    server.kill();
    let gone = run(&["health", "--server", &url, "--timeout", "2"]);
    assert_eq!(gone.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&gone.stderr).contains("cannot reach"));
}

/// While poses are streamed and scenes change.
#[tokio::test(flavor = "multi_thread")]
async fn a_backup_is_the_catalogue_as_it_was() {
    let dir = tempfile::tempdir().expect("a directory");
    let path = |name: &str| dir.path().join(name).to_str().expect("text").to_owned();
    let file = dir.path().join("tokens.toml");
    let (writer, admin) = (token(&file, "cell", "write"), token(&file, "ops", "admin"));
    let mut serve = command(&dir.path().join("data"));
    serve.arg("--tokens").arg(&file);
    let server = Running::spawn(serve);
    let options = ClientOptions { token: Some(writer.clone()), ..ClientOptions::default() };
    let client = Client::connect_with(&server.url(), &options).await.expect("connected");
    let body = client.create_ball("ball", 0.1).await.expect("stored");
    client.create_scene("cell").await.expect("made");
    let at = |x: f64| Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose");
    client.put_objects("cell", [("a", &body, at(0.0))]).await.expect("placed");
    let mut stream = client.stream_poses("cell", ["a"]).await.expect("a stream");
    stream.send(&[at(7.0)]).await.expect("sent");
    stream.next().await.expect("no error").expect("applied");

    let back_up = |token: &str, out: &str| {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sublevel"));
        command.args(["backup", "--server", &server.url(), "--out", out]).env("SUBLEVEL_TOKEN", token);
        command.output().expect("it runs")
    };
    let refused = back_up(&writer, &path("refused.redb"));
    assert!(!refused.status.success() && String::from_utf8_lossy(&refused.stderr).contains("admin"));
    assert!(!Path::new(&path("refused.redb")).exists());
    let made = back_up(&admin, &path("backup.redb"));
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let before = client.scene("cell").await.expect("there");
    client.delete_scene("cell").await.expect("deleted");

    let restored = run(&["restore", &path("backup.redb"), "--data", &path("again")]);
    assert!(restored.status.success(), "{}", String::from_utf8_lossy(&restored.stderr));
    assert!(String::from_utf8_lossy(&restored.stdout).contains("1 body, 1 scene"));
    let again = Running::start(Path::new(&path("again")));
    let after = again.client().await.scene("cell").await.expect("there");
    assert_eq!(after.objects, before.objects);
    assert!(after.revision >= before.revision);

    // What a server that was cut off left of a backup goes at the next start.
    let cut = Path::new(&path("again")).join("catalogue.redb.backing-up-cut");
    std::fs::create_dir(&cut).expect("made");
    again.kill();
    let again = Running::start(Path::new(&path("again")));
    assert!(!cut.exists());
    drop(again);

    // A directory that is in use, and files that are none, cut or changed.
    let occupied = run(&["restore", &path("backup.redb"), "--data", &path("again")]);
    assert!(String::from_utf8_lossy(&occupied.stderr).contains("is there already"));
    let whole = std::fs::read(path("backup.redb")).expect("read");
    let body_at = whole.windows(9).position(|bytes| bytes == b"\"radius\":" || bytes == b"\"bounding").unwrap_or(9000);
    let mut changed = whole.clone();
    changed[body_at + 3] ^= 1;
    for (name, bytes) in
        [("cut", &whole[..whole.len() / 2]), ("empty", &[][..]), ("text", b"nonsense"), ("changed", &changed)]
    {
        std::fs::write(path(name), bytes).expect("written");
        let data = path(&format!("from-{name}"));
        let refused = run(&["restore", &path(name), "--data", &data]);
        assert_eq!(refused.status.code(), Some(1), "{name}: {}", String::from_utf8_lossy(&refused.stdout));
        assert!(!Path::new(&data).exists(), "{name} left something behind");
    }
}
