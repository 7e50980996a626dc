//! `sublevel fit --server`.

use std::fmt::Write;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::Value;
use sublevel::body::Body;
use sublevel::service::proto::job::Task;
use sublevel::service::proto::{Job, JobState, ListJobsRequest};

use super::{arc, cloud, off};
use crate::harness::{PATIENCE, Running, run};

fn write_points(file: &Path, count: usize) {
    let text = cloud(count, 41).iter().fold(String::new(), |mut text, point| {
        writeln!(text, "{} {} {}", point.x, point.y, point.z).expect("a string");
        text
    });
    std::fs::write(file, text).expect("written");
}

/// Runs `sublevel fit` and returns its rows without what differs from run to run: times, and the
/// folder.
fn rows(args: &[&str]) -> Vec<Value> {
    let done = run(&[&["fit"][..], args, &["--json"]].concat());
    assert!(done.status.success(), "{args:?}: {}", String::from_utf8_lossy(&done.stderr));
    let mut rows: Vec<Value> = serde_json::from_slice(&done.stdout).expect("JSON");
    for row in &mut rows {
        let row = row.as_object_mut().expect("a row");
        row.remove("seconds");
        let body = row.remove("body").expect("a file");
        let name = Path::new(body.as_str().expect("text")).file_name().expect("a name").to_owned();
        row.insert("name".into(), name.to_str().expect("text").into());
    }
    rows
}

/// Runs `sublevel fit` without and with a server; the files that both wrote, which are the same.
fn both(dir: &Path, url: &str, args: &[&str]) -> Vec<String> {
    let [here, there] = ["here", "there"].map(|out| dir.join(out).to_str().expect("text").to_owned());
    let expected = rows(&[args, &["--out", &here]].concat());
    assert_eq!(rows(&[args, &["--out", &there, "--server", url]].concat()), expected, "{args:?}");
    let names = expected.iter().map(|row| row["name"].as_str().expect("text").to_owned());
    names
        .inspect(|name| {
            let [one, other] = [&here, &there].map(|out| std::fs::read(Path::new(out).join(name)).expect("a file"));
            assert!(one == other, "{args:?}: {name} differs");
        })
        .collect()
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_writes_the_same_files_with_and_without_a_server() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let mut clients = server.connect().await;
    let path = |name: &str| dir.path().join(name).to_str().expect("text").to_owned();
    let (cloud, mesh) = (path("cloud.xyz"), path("arc.off"));
    write_points(Path::new(&cloud), 200);
    std::fs::write(&mesh, off(&arc())).expect("written");
    let stored =
        both(dir.path(), &server.url(), &[&cloud, "--degree", "4", "--ladder", "--trim", "0.02", "--scale", "0.001"]);
    assert_eq!(stored, ["cloud-ball.json", "cloud-d2.json", "cloud-d4.json"]);
    for name in stored {
        let file = std::fs::read(dir.path().join("here").join(name)).expect("a file");
        let file: Value = serde_json::from_slice(&file).expect("JSON");
        clients.body(file["id"].as_str().expect("text")).await;
    }
    for (options, name) in [
        (&["--degree", "4", "--cone", "sdsos"][..], "arc-d4.json"),
        (&["--degree", "4", "--objective", "trace-p", "--raw-frame", "--scale", "0.01"], "arc-d4.json"),
        (&["--degree", "2", "--parts", "3", "--scale", "0.01"], "arc-d2-p3.json"),
        (&["--degree", "2", "--parts", "2", "--slabs", "1", "--refine"], "arc-d2-p2.json"),
        (&["--degree", "4", "--relax-convexity", "10"], "arc-d4-c10.json"),
        (&["--degree", "4", "--relax-convexity", "inf", "--raw-frame"], "arc-d4-cinf.json"),
        (&["--degree", "4", "--objective", "inverse-moment", "--trim", "0.02"], "arc-d4-im.json"),
    ] {
        assert_eq!(both(dir.path(), &server.url(), &[&[mesh.as_str()], options].concat()), [name]);
    }
    // A gap for which three parts are the cheapest.
    let three = rows(&[&mesh, "--degree", "2", "--parts", "3", "--out", &path("three")]);
    let gap = format!("{}", 1.0001 * three[0]["gap_m"].as_f64().expect("a gap"));
    let [compound] = &both(dir.path(), &server.url(), &[&mesh, "--degree", "2", "--max-gap", &gap])[..] else {
        panic!("one file")
    };
    assert!(compound.starts_with("arc-d2-p"), "{compound}");

    let bodies = [("near", 0.0), ("next", 1.2), ("far", 9.0)].map(|(name, x)| {
        let ball = Body::ball(name, nalgebra::Vector3::new(x, 0.0, 0.0), 0.5).expect("a ball");
        let file = path(&format!("{name}.json"));
        std::fs::write(&file, ball.to_json()).expect("written");
        file
    });
    let [near, next, far] = bodies.each_ref().map(String::as_str);
    assert_eq!(both(dir.path(), &server.url(), &[near, next, "--group", "pair"]), ["pair-d4.json"]);
    let few = [near, next, far, "--group", "few", "--max-growth", "0.9", "--multiplier-degree", "2"];
    assert_eq!(both(dir.path(), &server.url(), &few), ["few-1-d4.json", "few-2-d2.json"]);
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
    let message = run(&["fit", file, "--out", out, "--server", &url, "--parts", "2"]);
    let stderr = String::from_utf8_lossy(&message.stderr);
    assert!(!message.status.success() && stderr.contains("no triangles"), "{stderr}");
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
        let jobs = clients.jobs.list_jobs(ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
        let is_cloud = |job: &&Job| matches!(&job.task, Some(Task::Fit(fit)) if fit.name == "cloud");
        if let Some(job) = jobs.iter().find(is_cloud) {
            break job.id.clone();
        }
        assert!(begun.elapsed() < PATIENCE && child.try_wait().expect("waited for").is_none());
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    clients.under_way(&id).await;
    let pid = child.id().to_string();
    assert!(Command::new("kill").args(["-INT", &pid]).status().expect("kill runs").success());
    let ended = child.wait_with_output().expect("it ends");
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.code() == Some(1) && stderr.contains("cancelled"), "{stderr}");
    assert_eq!(clients.job(&id).await.state(), JobState::Cancelled);
}
