//! `sublevel fit --server`.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use sublevel::service::proto::{FitState, ListFitsRequest};

use super::cloud;
use crate::harness::{Running, run};

fn write_points(file: &Path, count: usize) {
    let text = cloud(count, 41).iter().fold(String::new(), |mut text, point| {
        writeln!(text, "{} {} {}", point.x, point.y, point.z).expect("a string");
        text
    });
    std::fs::write(file, text).expect("written");
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_writes_the_same_files_with_and_without_a_server() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let mut clients = server.connect().await;
    let file = dir.path().join("cloud.xyz");
    write_points(&file, 200);
    let (file, url) = (file.to_str().expect("text"), server.url());
    let out = |name: &str| dir.path().join(name).to_str().expect("text").to_owned();
    let options = ["--degree", "4", "--ladder", "--trim", "0.02", "--scale", "0.001", "--json"];
    let rows = |out: &str, server: &[&str]| {
        let done = run(&[&["fit", file, "--out", out][..], &options, server].concat());
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        let mut rows: serde_json::Value = serde_json::from_slice(&done.stdout).expect("JSON");
        for row in rows.as_array_mut().expect("rows") {
            let row = row.as_object_mut().expect("a row");
            assert!(row.remove("seconds").expect("a time").as_f64() > Some(0.0));
            let body = row.remove("body").expect("a file");
            let name = Path::new(body.as_str().expect("text")).file_name().expect("a name").to_owned();
            row.insert("name".into(), name.to_str().expect("text").into());
        }
        rows
    };
    let (here, there) = (out("here"), out("there"));
    let expected = rows(&here, &[]);
    assert_eq!(rows(&there, &["--server", &url]), expected);
    assert_eq!(expected.as_array().map(Vec::len), Some(3));
    for row in expected.as_array().expect("rows") {
        let name = row["name"].as_str().expect("text");
        let [one, other] = [&here, &there].map(|out| std::fs::read(Path::new(out).join(name)).expect("a file"));
        assert!(one == other, "{name} differs");
        let id: serde_json::Value = serde_json::from_slice(&one).expect("JSON");
        clients.body(id["id"].as_str().expect("text")).await;
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_says_what_went_wrong_and_ctrl_c_cancels() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let mut clients = server.connect().await;
    let (flat, file) = (dir.path().join("flat.xyz"), dir.path().join("cloud.xyz"));
    std::fs::write(&flat, "0 0 0\n1 0 0\n0 1 0\n1 1 0\n2 1 0\n").expect("written");
    write_points(&file, 400);
    let (out, url) = (dir.path().join("out"), server.url());
    let (flat, file, out) = (flat.to_str().expect("text"), file.to_str().expect("text"), out.to_str().expect("text"));
    for (url, word) in [(url.as_str(), "coplanar"), ("http://127.0.0.1:1", "sublevel serve"), ("no url", "--server")] {
        let refused = run(&["fit", flat, "--out", out, "--server", url]);
        let stderr = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && stderr.contains(word) && stderr.contains("flat.xyz"), "{stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    }

    let mut child = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["fit", file, "--out", out, "--server", &url, "--degree", "8", "--refine", "--slabs", "15"])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts");
    let begun = Instant::now();
    let id = loop {
        let jobs = clients.fits.list_fits(ListFitsRequest::default()).await.expect("a list").into_inner().jobs;
        if let Some(job) = jobs.iter().find(|job| job.name == "cloud") {
            break job.id.clone();
        }
        assert!(begun.elapsed() < super::PATIENCE && child.try_wait().expect("waited for").is_none());
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    clients.under_way(&id).await;
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().expect("kill runs").success());
    let ended = child.wait_with_output().expect("it ends");
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.code() == Some(1) && stderr.contains("cancelled"), "{stderr}");
    assert_eq!(clients.job(&id).await.state(), FitState::Cancelled);
}
