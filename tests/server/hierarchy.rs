//! Solves of the hierarchy as jobs: brackets, progress, cancelling, restarts, refusals.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use nalgebra::{Isometry3, Point3, UnitQuaternion, Vector3};
use serde_json::Value;
use sublevel::body::{Body, Compound, SosBody, SosMethod};
use sublevel::client::SubmitError;
use sublevel::fit::{Coordinates, FitOptions, SosOptions, fit_parts, fit_sos};
use sublevel::measure::Pose;
use sublevel::service::proto::create_body_request::Source;
use sublevel::service::proto::job::Task;
use sublevel::service::proto::{
    self, CancelJobRequest, CreateBodyRequest, CreateHierarchySolveRequest, CreateHierarchySolveResponse,
    DeleteBodyRequest, GetJobRequest, HierarchyMeasure, HierarchyProgress, HierarchyResult, HierarchySet,
    HierarchyTask, Job, JobState, LadderRungs, WatchJobRequest, WatchJobResponse,
};
use sublevel::store::{HierarchyRequest, HierarchySet as StoredSet};
use tonic::{Code, Status, Streaming};

use crate::fits::arc;
use crate::harness::{Clients, PATIENCE, Running, at, ball, field, pose, reason, run};

type Solve = CreateHierarchySolveRequest;

fn set(body_id: &str, pose: Option<proto::Pose>) -> Option<HierarchySet> {
    Some(HierarchySet { body_id: body_id.into(), pose })
}

/// A pair at level 0, the first set where it is.
fn solve(a: &str, b: &str, pose: proto::Pose) -> Solve {
    Solve { a: set(a, None), b: set(b, Some(pose)), ..Solve::default() }
}

/// No plane of symmetry of a set at the origin is one of a set here, which would make solves of
/// both faster.
fn askew() -> proto::Pose {
    pose([3.0, 0.0, 0.0], [0.2, 0.4, 0.4, 0.8])
}

/// The same as an argument.
const ASKEW: &str = "3,0,0,0.2,0.4,0.4,0.8";

/// Solves for much longer than any test waits for it to begin.
fn long(body: &str) -> Solve {
    Solve { level: Some(2), ..solve(body, body, askew()) }
}

fn sextic() -> Body {
    Body::superellipsoid("sextic", Vector3::zeros(), Vector3::new(1.0, 0.8, 0.6), 6).expect("a body")
}

/// A quarter of a ring that is not filled up to its convex hull.
fn bent() -> SosBody {
    let mesh = arc();
    let method = SosMethod::Relaxed { c: f64::INFINITY, objective: Default::default() };
    let (coordinates, input) = (Coordinates::Unit, String::new());
    let options = SosOptions { degree: 4, method, coordinates, solver: None, input };
    let mut unwatched = |_| std::ops::ControlFlow::Continue(());
    fit_sos("arc", &mesh.points, &mesh.triangles, &options, &mut unwatched).expect("a set").body
}

fn compound() -> Compound {
    let options = FitOptions { degree: 2, ..FitOptions::default() };
    let mut unwatched = |_| std::ops::ControlFlow::Continue(());
    fit_parts("arc", &arc(), 2, &options, &mut unwatched).expect("a compound").compound
}

/// A job as tests look at it.
#[derive(Clone, Debug, PartialEq)]
struct SolveJob {
    id: String,
    state: JobState,
    attempts: u32,
    failure: String,
    task: HierarchyTask,
}

impl SolveJob {
    fn progress(&self) -> Option<HierarchyProgress> {
        self.task.progress
    }

    fn result(&self) -> HierarchyResult {
        assert_eq!(self.state, JobState::Succeeded, "{}", self.failure);
        self.task.result.expect("a result")
    }
}

impl From<Job> for SolveJob {
    fn from(job: Job) -> Self {
        let (state, Job { id, attempts, failure, task, .. }) = (job.state(), job);
        let Some(Task::Hierarchy(task)) = task else { panic!("a solve") };
        Self { id, state, attempts, failure, task }
    }
}

impl Clients {
    async fn create_solve(&mut self, request: Solve) -> Result<CreateHierarchySolveResponse, Status> {
        Ok(self.hierarchy.create_hierarchy_solve(request).await?.into_inner())
    }

    async fn queue_solve(&mut self, request: Solve) -> String {
        let created = self.create_solve(request).await.expect("queued");
        assert!(created.created);
        created.job_id
    }

    async fn solve_job(&mut self, id: &str) -> SolveJob {
        let response = self.jobs.get_job(GetJobRequest { id: id.into() }).await.expect("there").into_inner();
        response.job.expect("a job").into()
    }

    async fn cancel_solve(&mut self, id: &str) -> SolveJob {
        let request = CancelJobRequest { id: id.into() };
        self.jobs.cancel_job(request).await.expect("cancelled").into_inner().job.expect("a job").into()
    }

    async fn watch_solve(&mut self, id: &str) -> Streaming<WatchJobResponse> {
        self.jobs.watch_job(WatchJobRequest { id: id.into() }).await.expect("a watch").into_inner()
    }

    /// Waits until the solver has made a step.
    async fn solving(&mut self, id: &str) -> SolveJob {
        let mut watch = self.watch_solve(id).await;
        let start = Instant::now();
        loop {
            let job = next(&mut watch).await.expect("it goes on").expect("it has not ended");
            if job.progress().is_some_and(|progress| progress.iterations > 0) {
                assert_eq!(job.state, JobState::Running);
                return job;
            }
            assert!(start.elapsed() < PATIENCE, "{job:?}");
        }
    }

    async fn solved(&mut self, id: &str) -> SolveJob {
        let mut watch = self.watch_solve(id).await;
        let mut last = None;
        while let Some(job) = next(&mut watch).await.expect("it goes on") {
            last = Some(job);
        }
        last.expect("a state")
    }
}

/// The next message of a watch; none at its end.
async fn next(watch: &mut Streaming<WatchJobResponse>) -> Result<Option<SolveJob>, Status> {
    let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time")?;
    Ok(message.map(|message| message.job.expect("a job").into()))
}

fn points(result: &HierarchyResult) -> [Vector3<f64>; 2] {
    [result.point_a_m, result.point_b_m].map(|point| {
        let proto::Vector3 { x, y, z } = point.expect("a point");
        Vector3::new(x, y, z)
    })
}

/// Half a turn about an axis that is none of the coordinates.
const TURN: [f64; 4] = [0.6, 0.0, 0.8, 0.0];

fn turned(translation: [f64; 3]) -> (proto::Pose, Isometry3<f64>) {
    let [x, y, z, w] = TURN;
    let turn = UnitQuaternion::from_quaternion(nalgebra::Quaternion::new(w, x, y, z));
    (pose(translation, TURN), Isometry3::from_parts(Vector3::from(translation).into(), turn))
}

#[tokio::test(flavor = "multi_thread")]
async fn a_job_brackets_a_distance_that_is_known() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (small, large) = (clients.put(&ball(0.5)).await, clients.put(&ball(1.0)).await);
    let (there, _) = turned([3.0, 0.0, 4.0]);
    let asked = Solve { level: Some(1), ..solve(&small, &large, there) };
    let id = clients.queue_solve(asked.clone()).await;
    let job = clients.solved(&id).await;
    let result = job.result();
    let upper = result.upper.expect("points");
    assert!(result.lower <= 3.5 && 3.5 <= upper && upper - result.lower < 1e-5, "{result:?}");
    assert!(result.is_exact && result.iterations > 0 && result.duration_s > 0.0, "{result:?}");
    let [a, b] = points(&result);
    let apart = (a - b).norm();
    assert!((apart - upper).abs() < 1e-12, "{apart} {upper}");
    assert!((a - Vector3::new(0.3, 0.0, 0.4)).norm() < 1e-3, "{a}");
    // The job says what was asked, with what was left out.
    let task = job.task;
    assert_eq!((task.a, task.b, task.level), (set(&small, Some(at(0.0))), asked.b, 1));
    assert_eq!((task.measure, task.progress), (HierarchyMeasure::Distance.into(), None));
    // Two that overlap: both bounds are 0, to what the solver leaves.
    let id = clients.queue_solve(solve(&small, &large, at(0.7))).await;
    let result = clients.solved(&id).await.result();
    assert!(result.lower < 1e-3 && result.upper.is_none_or(|upper| upper >= result.lower), "{result:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_set_that_is_not_convex_is_bracketed_by_points_that_lie_in_it() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (bent, ball) = (bent(), ball(0.2));
    let ids = [clients.put_file(bent.to_json()).await, clients.put(&ball).await];
    let (there, isometry) = turned([0.4, 1.9, 0.3]);
    let asked = Solve { a: set(&ids[1], None), b: set(&ids[0], Some(there)), ..Solve::default() };
    let id = clients.queue_solve(asked).await;
    let result = clients.solved(&id).await.result();
    let [on_ball, on_bent] = points(&result);
    let upper = result.upper.expect("points");
    assert!(result.lower <= upper && (on_ball - on_bent).norm() <= upper + 1e-12, "{result:?}");
    assert!(on_ball.norm() <= 0.2 + 1e-9, "{on_ball}");
    let home = isometry.inverse_transform_point(&Point3::from(on_bent)).coords;
    let frame = bent.normalization();
    let value = bent.polynomial().evaluate(&(frame.linear * (home - frame.center))).value;
    assert!(value <= 1.0 + 1e-9, "{value}");
    // No point of the set is nearer than the bound.
    let nearest = bent.chords(400).into_iter().flat_map(|(from, to)| [from, to]);
    let nearest = nearest.map(|point| isometry.transform_point(&point.into()).coords.norm() - 0.2);
    let nearest = nearest.fold(f64::INFINITY, f64::min);
    assert!(nearest > 0.0 && result.lower <= nearest && upper <= nearest + 1e-3, "{nearest} {result:?}");

    // The typed client finds the same.
    let client = server.client().await;
    let sets = [(&ids[1], Pose::identity()), (&ids[0], Pose::from_quaternion([0.4, 1.9, 0.3].into(), TURN).unwrap())];
    let sets = sets.map(|(id, pose)| StoredSet { body: id.parse().expect("an id"), pose });
    let request = HierarchyRequest { measure: Default::default(), sets, level: 0 };
    let mut heard = Vec::new();
    let found = client.solve_hierarchy(&request, |job| heard.push(job.clone()), std::future::pending()).await;
    let found = found.expect("solved");
    assert_eq!((found.lower, found.upper, found.is_exact), (result.lower, result.upper, result.is_exact));
    assert_eq!(found.points_m.map(|points| points.map(Vector3::from)), Some([on_ball, on_bent]));
    assert!(heard.iter().all(|job| job.id == heard[0].id) && heard[0].id != id, "{heard:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn running_and_queued_solves_are_cancelled_and_the_next_one_runs() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (body, ball) = (clients.put(&sextic()).await, clients.put(&ball(0.5)).await);
    let running = clients.queue_solve(long(&body)).await;
    let queued = clients.queue_solve(long(&body)).await;
    let quick = clients.queue_solve(solve(&ball, &ball, at(3.0))).await;
    let first = clients.solving(&running).await.progress().expect("it runs").iterations;
    assert_eq!(clients.solve_job(&queued).await.state, JobState::Queued);
    // The count goes up.
    let mut watch = clients.watch_solve(&running).await;
    while next(&mut watch).await.expect("it goes on").expect("it runs").progress().expect("it runs").iterations <= first
    {
    }
    for id in [&queued, &running] {
        for _ in 0..2 {
            let job = clients.cancel_solve(id).await;
            assert_eq!((job.state, job.task.progress, job.task.result), (JobState::Cancelled, None, None));
        }
    }
    assert!((clients.solved(&quick).await.result().lower - 2.0).abs() < 1e-4);
    assert_eq!([clients.solve_job(&running).await.attempts, clients.solve_job(&queued).await.attempts], [1, 0]);

    // By the typed client, and what another client has cancelled.
    let client = server.client().await;
    let sets = [0.0, 3.0].map(|x: f64| StoredSet {
        body: body.parse().expect("an id"),
        pose: Pose::from_quaternion([x, 0.0, 0.0].into(), [0.0, 0.0, 0.0, 1.0]).expect("a pose"),
    });
    let request = HierarchyRequest { measure: Default::default(), sets, level: 2 };
    let cancelled = client.solve_hierarchy(&request, |_| {}, std::future::ready(())).await;
    assert!(matches!(cancelled, Err(SubmitError::Cancelled)), "{cancelled:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_id_makes_one_solve_whatever_happens() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (small, large) = (clients.put(&ball(0.5)).await, clients.put(&ball(1.0)).await);
    let asked = Solve { request_id: "45c48cce".into(), ..solve(&small, &large, at(3.0)) };
    let id = clients.queue_solve(asked.clone()).await;
    let ended = clients.solved(&id).await;
    ended.result();
    for restarted in [false, true] {
        if restarted {
            clients.bodies.delete_body(DeleteBodyRequest { id: large.clone() }).await.expect("nothing uses it");
            server.kill();
            server = Running::start(dir.path());
            clients = server.connect().await;
        }
        let again = clients.create_solve(asked.clone()).await.expect("known");
        assert_eq!((again.created, &again.job_id), (false, &id));
        assert_eq!(clients.solve_job(&id).await, ended);
        for other in [
            Solve { level: Some(1), ..asked.clone() },
            Solve { b: set(&large, Some(at(3.5))), ..asked.clone() },
            Solve { a: set(&large, None), b: set(&small, Some(at(3.0))), ..asked.clone() },
        ] {
            let status = clients.create_solve(other).await.expect_err("another content");
            assert_eq!((status.code(), reason(&status).as_str()), (Code::AlreadyExists, "REQUEST_ID_USED"));
        }
    }
    let gone = clients.create_solve(Solve { request_id: String::new(), ..asked }).await.expect_err("deleted");
    assert_eq!((gone.code(), field(&gone).as_str()), (Code::NotFound, "b.body_id"), "{gone:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let good = clients.put(&ball(0.5)).await;
    let octic = Body::superellipsoid("octic", Vector3::zeros(), Vector3::repeat(1.0), 8).expect("a body");
    let octic = clients.put(&octic).await;
    let compound = clients.put_file(compound().to_json()).await;
    let mut make = async |name: &str, source: Source| {
        let request = CreateBodyRequest { name: name.into(), source: Some(source) };
        clients.bodies.create_body(request).await.expect("stored").into_inner().body.expect("a body").id
    };
    let up = proto::Vector3 { x: 0.0, y: 0.0, z: 1.0 };
    let floor = make("floor", Source::HalfSpace(proto::HalfSpaceSize { normal: Some(up), offset_m: 0.0 })).await;
    let rungs = [1.0, 0.75].map(|radius| {
        let body = ball(radius).with_points(&[Vector3::new(0.1, 0.0, 0.0)]).expect("inside");
        Source::File(body.to_json().into_bytes().into())
    });
    let mut body_ids = Vec::new();
    for rung in rungs {
        body_ids.push(make("", rung).await);
    }
    let ladder = make("steps", Source::Ladder(LadderRungs { body_ids })).await;

    let pair = || solve(&good, &good, at(3.0));
    let with_b = |id: &str| Solve { b: set(id, None), ..pair() };
    let with_pose = |pose: proto::Pose| Solve { a: set(&good, Some(pose)), ..pair() };
    for (request, at_field, word) in [
        (Solve { a: None, ..pair() }, "a", "name a body"),
        (Solve { b: None, ..pair() }, "b", "name a body"),
        (Solve { a: set("chair", None), ..pair() }, "a.body_id", "64 lowercase"),
        (with_b(""), "b.body_id", "64 lowercase"),
        (with_b(&compound), "b.body_id", "parts one by one"),
        (with_b(&ladder), "b.body_id", "one of its rungs"),
        (Solve { a: set(&floor, None), ..pair() }, "a.body_id", "unbounded"),
        (with_pose(proto::Pose::default()), "a.pose.translation_m", "missing"),
        (with_pose(pose([0.0, f64::NAN, 0.0], TURN)), "a.pose.translation_m.y", "finite"),
        (with_pose(pose([0.0; 3], [0.0, 0.0, 0.0, 2.0])), "a.pose.rotation", "unit"),
        (Solve { measure: 99, ..pair() }, "measure", "knows"),
        (Solve { level: Some(3), ..pair() }, "level", "between 0 and 2"),
        (Solve { level: Some(u32::MAX), ..pair() }, "level", "between 0 and 2"),
        (Solve { level: Some(2), ..solve(&octic, &octic, askew()) }, "level", "10820 entries"),
        (Solve { request_id: "x".repeat(129), ..pair() }, "request_id", "UUID"),
        (Solve { request_id: "a\nb".into(), ..pair() }, "request_id", "UUID"),
    ] {
        let status = clients.create_solve(request).await.expect_err(at_field);
        assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, at_field), "{status:?}");
        assert!(status.message().contains(word), "{}", status.message());
    }
    let nobody = format!("{:064x}", 7);
    for (request, at_field) in
        [(Solve { a: set(&nobody, None), ..pair() }, "a.body_id"), (with_b(&nobody), "b.body_id")]
    {
        let status = clients.create_solve(request).await.expect_err("no such body");
        let found = (status.code(), field(&status), reason(&status));
        assert_eq!(found, (Code::NotFound, at_field.to_owned(), "BODY_NOT_FOUND".to_owned()), "{status:?}");
        assert!(status.message().contains(&nobody), "{}", status.message());
    }
    let jobs = clients.jobs.list_jobs(proto::ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
    assert_eq!(jobs.len(), 0, "what is refused makes no job");
}

#[tokio::test(flavor = "multi_thread")]
async fn solves_outlive_the_server_and_fail_by_name_without_their_bodies() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (body, small) = (clients.put(&sextic()).await, clients.put(&ball(0.5)).await);
    let large = clients.put(&ball(1.0)).await;
    let running = clients.queue_solve(long(&body)).await;
    let waiting = clients.queue_solve(solve(&small, &small, at(3.0))).await;
    // An orderly stop is no attempt, a kill is one.
    assert_eq!(clients.solving(&running).await.attempts, 1);
    let mut watch = clients.watch_solve(&running).await;
    server.terminate();
    let status = loop {
        match next(&mut watch).await {
            Ok(job) => assert!(job.expect("a watch ends with the final state").task.result.is_none()),
            Err(status) => break status,
        }
    };
    assert_eq!((status.code(), reason(&status).as_str()), (Code::Unavailable, "STOPPING"), "{status:?}");
    assert_eq!(server.wait().code(), Some(0));
    for attempts in [1, 2] {
        server = Running::start(dir.path());
        clients = server.connect().await;
        assert_eq!(clients.solving(&running).await.attempts, attempts);
        assert_eq!(clients.solve_job(&waiting).await.state, JobState::Queued);
        server.kill();
    }
    server = Running::start(dir.path());
    clients = server.connect().await;
    let given_up = clients.solved(&running).await;
    assert_eq!((given_up.state, given_up.attempts), (JobState::Failed, 2));
    assert!(given_up.failure.contains("killed 2 times") && given_up.failure.contains("level"), "{}", given_up.failure);
    let done = clients.solved(&waiting).await;
    assert_eq!(done.attempts, 1);
    assert!((done.result().lower - 2.0).abs() < 1e-4);

    // A body that is deleted while its solve waits.
    let first = clients.queue_solve(long(&body)).await;
    clients.solving(&first).await;
    let orphan = clients.queue_solve(solve(&small, &large, at(3.5))).await;
    clients.bodies.delete_body(DeleteBodyRequest { id: large.clone() }).await.expect("no scene uses it");
    clients.cancel_solve(&first).await;
    let failed = clients.solved(&orphan).await;
    assert_eq!(failed.state, JobState::Failed);
    assert!(failed.failure.contains(&large) && failed.failure.contains("deleted"), "{}", failed.failure);
}

/// Files of a ball, and of a set that need not be convex.
fn files(dir: &Path) -> [String; 2] {
    [("ball.json", ball(0.5).to_json()), ("arc.json", bent().to_json())].map(|(name, content)| {
        let file = dir.join(name);
        std::fs::write(&file, content).expect("written");
        file.to_str().expect("text").to_owned()
    })
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_brackets_the_same_with_and_without_a_server() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let mut clients = server.connect().await;
    let [ball, arc] = files(dir.path());
    let poses = dir.path().join("poses.txt");
    std::fs::write(&poses, "1 0 0 0 1 0 0 0 1 0 0 3\n\n1 0 0 0 1 0 0 0 1 4 0 0\n").expect("written");
    let poses = poses.to_str().expect("text");
    // Lines without their times.
    let lines = |options: &[&str]| -> Vec<Value> {
        let done = run(&[&["hierarchy", &arc, &ball, "--poses", poses, "--json"], options].concat());
        assert!(done.status.success(), "{options:?}: {}", String::from_utf8_lossy(&done.stderr));
        let text = String::from_utf8(done.stdout).expect("text");
        let line = |line: &str| {
            let mut line: Value = serde_json::from_str(line).expect("JSON");
            assert!(line.as_object_mut().expect("a line").remove("seconds").is_some());
            line
        };
        text.lines().map(line).collect()
    };
    let url = server.url();
    for options in [&["--level", "1"][..], &["--measure", "level-distance"]] {
        let there = lines(&[options, &["--server", &url]].concat());
        assert_eq!(there, lines(options), "{options:?}");
        assert!(
            there.len() == 2 && there.iter().all(|line| line["lower"].as_f64().expect("a bound") > 0.5),
            "{there:?}"
        );
    }
    // They were jobs, with the sets that the command stored.
    let jobs = clients.jobs.list_jobs(proto::ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
    assert_eq!(jobs.len(), 4);
    let ids = [bent().id().to_string(), crate::harness::ball(0.5).id().to_string()];
    for job in jobs.into_iter().map(SolveJob::from) {
        let asked = [job.task.a.expect("a set"), job.task.b.expect("a set")].map(|set| set.body_id);
        assert_eq!((job.state, &asked), (JobState::Succeeded, &ids));
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn the_command_says_what_went_wrong_and_ctrl_c_cancels() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(&dir.path().join("data"));
    let mut clients = server.connect().await;
    let [ball, _] = files(dir.path());
    let url = server.url();
    let octic = Body::superellipsoid("octic", Vector3::zeros(), Vector3::repeat(1.0), 8).expect("a body");
    let (octic_file, sextic_file) = (dir.path().join("octic.json"), dir.path().join("sextic.json"));
    std::fs::write(&octic_file, octic.to_json()).expect("written");
    std::fs::write(&sextic_file, sextic().to_json()).expect("written");
    let (octic, sextic) = (octic_file.to_str().expect("text"), sextic_file.to_str().expect("text"));
    for (files, url, level, word) in [
        ([octic, octic], url.as_str(), "2", "10820 entries"),
        ([&*ball, &*ball], &url, "3", "between 0 and 2"),
        ([&ball, &ball], "http://127.0.0.1:1", "0", "sublevel serve"),
        ([&ball, &ball], "no url", "0", "--server"),
        ([&ball, "missing.json"], &url, "0", "check the path"),
    ] {
        let refused = run(&["hierarchy", files[0], files[1], "--pose", ASKEW, "--level", level, "--server", url]);
        let stderr = String::from_utf8_lossy(&refused.stderr);
        assert!(!refused.status.success() && stderr.contains(word), "{word}: {stderr}");
        assert_eq!(stderr.trim_end().lines().count(), 1, "{stderr}");
    }

    let child = Command::new(env!("CARGO_BIN_EXE_sublevel"))
        .args(["hierarchy", sextic, sextic, "--pose", ASKEW, "--level", "2", "--server", &url])
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .expect("it starts");
    let begun = Instant::now();
    let id = loop {
        let jobs = clients.jobs.list_jobs(proto::ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
        if let Some(job) = jobs.first() {
            break job.id.clone();
        }
        assert!(begun.elapsed() < PATIENCE, "it makes no job");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    clients.solving(&id).await;
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().expect("kill runs").success());
    let ended = child.wait_with_output().expect("it ends");
    let stderr = String::from_utf8_lossy(&ended.stderr);
    assert!(ended.status.code() == Some(1) && stderr.contains("cancelled"), "{stderr}");
    assert_eq!(clients.solve_job(&id).await.state, JobState::Cancelled);
}
