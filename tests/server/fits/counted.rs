//! Jobs in the metrics.

use std::net::SocketAddr;

use sublevel::measure::Pose;
use sublevel::service::proto::JobState;
use sublevel::store::{HierarchyMeasure, HierarchyRequest, HierarchySet};

use super::{cloud, header, long, quick};
use crate::harness::{Running, ball, command};
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

    // The end of a job is told to its watchers first.
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
