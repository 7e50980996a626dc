//! Jobs in the metrics.

use std::fmt::Write;
use std::net::SocketAddr;

use serde_json::Value;
use sublevel::measure::Pose;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::{FitSolver, JobState};
use sublevel::store::{HierarchyMeasure, HierarchyRequest, HierarchySet};
use sublevel_testkit::Seeded;
use sublevel_testkit::catalogue::clouds::{DRAWN_KINDS, drawn};

use super::{asked, body, cloud, header, long, quick};
use crate::harness::{Running, ball, command, run};
use crate::operation::{eventually, free_port, page};

/// The value of a metric with these labels.
fn value(admin: SocketAddr, name: &str) -> f64 {
    let (status, text) = page(admin, "/metrics");
    assert_eq!(status, 200);
    let line = text.lines().find_map(|line| line.strip_prefix(name)?.strip_prefix(' '));
    line.and_then(|value| value.parse().ok()).unwrap_or_else(|| panic!("{name} is not in\n{text}"))
}

#[tokio::test(flavor = "multi_thread")]
async fn jobs_are_counted_by_task_and_outcome() {
    let dir = tempfile::tempdir().expect("a directory");
    let admin = free_port();
    let mut serve = command(dir.path());
    serve.args(["--admin", &admin.to_string()]);
    let server = Running::spawn(serve);
    let (mut clients, client) = (server.connect().await, server.client().await);
    let ended = |task: &str, outcome: &str| {
        value(admin, &format!("sublevel_ended_jobs_total{{task=\"{task}\",outcome=\"{outcome}\"}}"))
    };
    let open = |state: &str| value(admin, &format!("sublevel_jobs{{task=\"fit\",state=\"{state}\"}}"));
    let programs = |solver: &str, fallback: &str| {
        value(admin, &format!("sublevel_fit_programs_total{{solver=\"{solver}\",fallback=\"{fallback}\"}}"))
    };
    // All of them are there before the first job, at 0.
    for task in ["fit", "hierarchy", "derive"] {
        for outcome in ["succeeded", "failed", "cancelled"] {
            assert_eq!(ended(task, outcome), 0.0);
        }
    }
    assert_eq!([open("running"), open("queued"), programs("structured", "yes")], [0.0; 3]);

    // One that runs and two that wait; two of them are cancelled, each of them twice.
    let points = cloud(400, 11);
    let running = clients.queue(header("running", long()), &points).await.id;
    let queued = clients.queue(header("queued", long()), &points).await.id;
    let next = clients.queue(header("next", quick()), &points).await.id;
    clients.under_way(&running).await;
    assert_eq!([open("running"), open("queued")], [1.0, 2.0]);
    for id in [&queued, &running, &queued, &running] {
        clients.cancel(id).await;
    }
    assert_eq!(clients.ended(&next).await.state(), JobState::Succeeded);
    // Points in a plane, whose job fails.
    let flat: Vec<_> = points.iter().map(|point| nalgebra::Vector3::new(point.x, point.y, 0.0)).collect();
    let flat = clients.queue(header("flat", quick()), &flat).await.id;
    assert_eq!(clients.ended(&flat).await.state(), JobState::Failed);
    // A solve of the hierarchy.
    let set = clients.put(&ball(0.5)).await.parse().expect("an id");
    let there = Pose::identity().with_translation(nalgebra::Vector3::new(3.0, 0.0, 0.0));
    let sets = [Pose::identity(), there].map(|pose| HierarchySet { body: set, pose });
    let request = HierarchyRequest { measure: HierarchyMeasure::Distance, sets, level: 0 };
    client.solve_hierarchy(&request, |_| {}, std::future::pending()).await.expect("solved");

    // Watchers of a job get its end before it is counted.
    eventually(async || ended("hierarchy", "succeeded") == 1.0).await;
    assert_eq!(["succeeded", "failed", "cancelled"].map(|outcome| ended("fit", outcome)), [1.0, 1.0, 2.0]);
    assert_eq!(["succeeded", "failed", "cancelled"].map(|outcome| ended("derive", outcome)), [0.0; 3]);
    assert_eq!([open("running"), open("queued")], [0.0; 2]);
    let solver = if programs("clarabel", "no") == 1.0 { "structured" } else { "clarabel" };
    assert_eq!([programs("clarabel", "no") + programs("structured", "no"), programs(solver, "no")], [1.0, 0.0]);
    assert_eq!([programs("clarabel", "yes"), programs("structured", "yes")], [0.0; 2]);
    // What was cancelled took no time.
    for (task, count) in [("fit", 2.0), ("hierarchy", 1.0), ("derive", 0.0)] {
        assert_eq!(value(admin, &format!("sublevel_job_duration_seconds_count{{task=\"{task}\"}}")), count);
        let sum = value(admin, &format!("sublevel_job_duration_seconds_sum{{task=\"{task}\"}}"));
        assert!(sum < 60.0 && (sum > 0.0) == (count > 0.0), "{task}: {sum}");
    }
}

/// Clouds at degree 6 that clarabel leaves too far from the optimum; see `tests/fallback.rs` of the
/// crate of fits.
const HARD: [u64; 4] = [549, 575, 736, 1126];

/// Who has fits made hears of it where the first solver fails: in the job, in the metrics, on the
/// command line.
#[tokio::test(flavor = "multi_thread")]
async fn a_solver_that_takes_over_is_reported() {
    let dir = tempfile::tempdir().expect("a directory");
    let admin = free_port();
    let mut serve = command(&dir.path().join("data"));
    serve.args(["--admin", &admin.to_string()]);
    let server = Running::spawn(serve);
    let mut clients = server.connect().await;
    let mut reported = Vec::new();
    for seed in HARD {
        let (_, points, _) = drawn(seed % DRAWN_KINDS, &mut Seeded(seed));
        let id = clients.queue(header("hard", asked(Mode::Body(body(6)))), &points).await.id;
        let ended = clients.ended(&id).await;
        let bodies = ended.result.unwrap_or_else(|| panic!("seed {seed}: {}", ended.failure)).bodies;
        let optimum = bodies[0].optimum.clone().expect("an optimum");
        if optimum.fallback.is_empty() {
            assert_eq!(optimum.solver(), FitSolver::Clarabel, "seed {seed}");
        } else {
            assert_eq!(optimum.solver(), FitSolver::Structured, "seed {seed}");
            assert!(optimum.fallback.starts_with("clarabel failed: "), "seed {seed}: {}", optimum.fallback);
            reported.push((points, optimum.fallback));
        }
    }
    let programs = |solver: &str, fallback: &str| {
        value(admin, &format!("sublevel_fit_programs_total{{solver=\"{solver}\",fallback=\"{fallback}\"}}"))
    };
    let count = reported.len() as f64;
    eventually(async || programs("clarabel", "no") + programs("structured", "yes") == HARD.len() as f64).await;
    assert_eq!(
        [programs("structured", "yes"), programs("structured", "no"), programs("clarabel", "yes")],
        [count, 0.0, 0.0]
    );

    let (points, why) = reported.pop().expect("clarabel solves all of them now: choose others for the test");
    let text = points.iter().fold(String::new(), |mut text, point| {
        writeln!(text, "{} {} {}", point.x, point.y, point.z).expect("a string");
        text
    });
    let (file, out) = (dir.path().join("hard.xyz"), dir.path().join("out"));
    std::fs::write(&file, text).expect("written");
    let (file, out) = (file.to_str().expect("text"), out.to_str().expect("text"));
    let done = run(&["fit", file, "--degree", "6", "--out", out, "--json"]);
    let stderr = String::from_utf8_lossy(&done.stderr);
    let rows: Vec<Value> = serde_json::from_slice(&done.stdout).expect("JSON");
    assert_eq!((&rows[0]["solver"], &rows[0]["fallback"]), (&"structured".into(), &why.as_str().into()), "{stderr}");
    assert!(stderr.contains(&format!("solved by structured, since {why}")), "{stderr}");
}
