//! DeriveAllowedPairs as a job: progress, request ids, cancelling, restarts, refusals.

use std::future::{pending, ready};
use std::time::Instant;

use sublevel::client::{Client, JobProgress, SubmitError};
use sublevel::robot::motion::DEFAULT_DERIVE_RESOLUTION_M;
use sublevel::service::proto::job::Task;
use sublevel::service::proto::{
    AllowedPairsProgress, AllowedPairsResult, AllowedPairsTask, CancelJobRequest, DeriveAllowedPairsRequest,
    DeriveAllowedPairsResponse, GetJobRequest, Job, JobState, ListJobsRequest, PairClass, WatchJobRequest,
    WatchJobResponse,
};
use sublevel::store::{DeriveRequest, RobotSource};
use tokio::sync::Notify;
use tonic::{Code, Status, Streaming};

use super::served;
use crate::harness::{Clients, PATIENCE, Running, field, reason};

type Search = DeriveAllowedPairsRequest;

/// Three balls that go round another one by two joints each, 0.5 m away from it everywhere.
const ORBIT: &str = r#"<robot name="orbit">
  <link name="base"><collision><geometry><sphere radius="0.25"/></geometry></collision></link>
  <link name="middle"><collision><geometry><sphere radius="0.125"/></geometry></collision></link>
  <link name="one"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.25"/></geometry></collision></link>
  <link name="two"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.25"/></geometry></collision></link>
  <link name="three"><collision><origin xyz="1 0 0"/><geometry><sphere radius="0.25"/></geometry></collision></link>
  <joint name="a" type="continuous"><parent link="base"/><child link="middle"/><axis xyz="0 0 1"/></joint>
  <joint name="b" type="continuous"><parent link="middle"/><child link="one"/><axis xyz="0 1 0"/></joint>
  <joint name="c" type="continuous"><parent link="middle"/><child link="two"/><axis xyz="0 1 0"/></joint>
  <joint name="d" type="continuous"><parent link="middle"/><child link="three"/><axis xyz="0 1 0"/></joint>
</robot>"#;

/// Most boxes of a search that ends in well below a second.
const FEW: u32 = 500;

/// The distance as margin: no box is ever proven to be free or in contact, and the search goes on
/// to its last one.
fn search(robot: &str, max_boxes: u32) -> Search {
    let (robot_id, max_boxes) = (robot.to_owned(), Some(max_boxes));
    Search { robot_id, margin_m: 0.5, max_boxes, ..Search::default() }
}

fn quick(robot: &str) -> Search {
    search(robot, FEW)
}

/// Searches for much longer than any test waits for it to begin.
fn long(robot: &str) -> Search {
    Search { resolution_m: Some(1e-12), ..search(robot, 10_000_000) }
}

/// The same for the typed client.
fn long_of(robot: &str) -> DeriveRequest {
    let robot = robot.parse().expect("an id");
    DeriveRequest { robot, margin_m: 0.5, max_boxes: 10_000_000, resolution_m: 1e-12 }
}

/// A search as tests look at it.
#[derive(Clone, Debug, PartialEq)]
struct SearchJob {
    id: String,
    request_id: String,
    state: JobState,
    attempts: u32,
    failure: String,
    task: AllowedPairsTask,
}

impl SearchJob {
    fn progress(&self) -> AllowedPairsProgress {
        assert_eq!(self.state, JobState::Running);
        self.task.progress.expect("it runs")
    }

    fn result(&self) -> &AllowedPairsResult {
        assert_eq!(self.state, JobState::Succeeded, "{}", self.failure);
        assert_eq!(self.task.progress, None);
        self.task.result.as_ref().expect("a result")
    }
}

impl From<Job> for SearchJob {
    fn from(job: Job) -> Self {
        let (state, Job { id, request_id, attempts, failure, task, .. }) = (job.state(), job);
        let Some(Task::AllowedPairs(task)) = task else { panic!("a search") };
        Self { id, request_id, state, attempts, failure, task }
    }
}

impl Clients {
    async fn create_search(&mut self, request: Search) -> Result<DeriveAllowedPairsResponse, Status> {
        Ok(self.robots.derive_allowed_pairs(request).await?.into_inner())
    }

    async fn queue_search(&mut self, request: Search) -> String {
        let created = self.create_search(request).await.expect("queued");
        assert!(created.created);
        created.job_id
    }

    async fn search_job(&mut self, id: &str) -> SearchJob {
        let response = self.jobs.get_job(GetJobRequest { id: id.into() }).await.expect("there").into_inner();
        response.job.expect("a job").into()
    }

    async fn search_jobs(&mut self) -> Vec<SearchJob> {
        let response = self.jobs.list_jobs(ListJobsRequest::default()).await.expect("a list").into_inner();
        response.jobs.into_iter().map(SearchJob::from).collect()
    }

    async fn cancel_search(&mut self, id: &str) -> SearchJob {
        let request = CancelJobRequest { id: id.into() };
        self.jobs.cancel_job(request).await.expect("cancelled").into_inner().job.expect("a job").into()
    }

    async fn watch_search(&mut self, id: &str) -> Streaming<WatchJobResponse> {
        self.jobs.watch_job(WatchJobRequest { id: id.into() }).await.expect("a watch").into_inner()
    }

    /// Waits until more boxes than this were looked at.
    async fn searching(&mut self, id: &str, boxes: u64) -> SearchJob {
        let mut watch = self.watch_search(id).await;
        let start = Instant::now();
        loop {
            let job = next(&mut watch).await.expect("it goes on").expect("it has not ended");
            if job.task.progress.is_some_and(|progress| progress.boxes > boxes) {
                assert_eq!(job.state, JobState::Running);
                return job;
            }
            assert!(start.elapsed() < PATIENCE, "{job:?}");
        }
    }

    /// Waits for the end of a job.
    async fn searched(&mut self, id: &str) -> SearchJob {
        let mut watch = self.watch_search(id).await;
        let mut last = None;
        while let Some(job) = next(&mut watch).await.expect("it goes on") {
            last = Some(job);
        }
        last.expect("a state")
    }
}

/// The next message of a watch; none at its end.
async fn next(watch: &mut Streaming<WatchJobResponse>) -> Result<Option<SearchJob>, Status> {
    let message = tokio::time::timeout(PATIENCE, watch.message()).await.expect("in time")?;
    Ok(message.map(|message| message.job.expect("a job").into()))
}

/// Loads [`ORBIT`] and returns its id.
async fn orbit(client: &Client) -> String {
    let source = RobotSource { urdf: ORBIT.into(), ..RobotSource::default() };
    client.load_robot(&source).await.expect("a robot").id.to_string()
}

#[tokio::test(flavor = "multi_thread")]
async fn every_call_tells_of_progress_until_a_search_is_cancelled() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let robot = orbit(&server.client().await).await;
    let running = clients.queue_search(long(&robot)).await;
    let queued = clients.queue_search(long(&robot)).await;
    let last = clients.queue_search(quick(&robot)).await;
    // What was asked, without how far it is.
    let asked = AllowedPairsTask {
        robot_id: robot.clone(),
        margin_m: 0.5,
        max_boxes: 10_000_000,
        resolution_m: 1e-12,
        ..AllowedPairsTask::default()
    };
    let first = clients.searching(&running, 1).await;
    assert_eq!(AllowedPairsTask { progress: None, ..first.task.clone() }, asked);
    // The first pair are neighbours: one box.
    assert!(first.attempts == 1 && first.progress().pairs_begun >= 2, "{first:?}");
    let later = clients.search_job(&running).await;
    assert!(later.progress().boxes >= first.progress().boxes, "{later:?}");
    let listed = clients.search_jobs().await;
    let states = listed.iter().map(|job| (job.id.as_str(), job.state)).collect::<Vec<_>>();
    let waits = JobState::Queued;
    assert_eq!(states, [(running.as_str(), JobState::Running), (queued.as_str(), waits), (last.as_str(), waits)]);
    assert!(listed[0].progress().boxes >= later.progress().boxes, "{listed:?}");
    assert_eq!((listed[1].attempts, &listed[1].task), (0, &asked), "what waits has no progress");
    assert_eq!(clients.search_job(&queued).await, listed[1]);
    clients.searching(&running, listed[0].progress().boxes).await;

    for id in [&queued, &running] {
        for _ in 0..2 {
            let job = clients.cancel_search(id).await;
            assert_eq!((job.state, &job.task), (JobState::Cancelled, &asked));
        }
    }
    let done = clients.searched(&last).await;
    let result = done.result();
    assert!(result.duration_s >= 0.0 && done.attempts == 1, "{done:?}");
    let boxes = |class: PairClass| {
        let of_class = result.pairs.iter().filter(|pair| pair.class() == class);
        of_class.map(|pair| pair.boxes).collect::<Vec<_>>()
    };
    // The middle has all others as neighbours; those that go round meet each other.
    assert_eq!((boxes(PairClass::Adjacent), boxes(PairClass::Undecided)), (vec![1; 4], vec![FEW; 3]));
    assert_eq!((boxes(PairClass::Collides).len(), result.pairs.len()), (3, 10));
    assert_eq!([clients.search_job(&running).await.attempts, clients.search_job(&queued).await.attempts], [1, 0]);
    // What has ended stays as it is.
    assert_eq!(clients.cancel_search(&last).await, done);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_typed_client_cancels_and_learns_that_another_has() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    let robot = orbit(&client).await;
    let asked = long_of(&robot);
    // At once; then when it is under way.
    let cancelled = client.derive_allowed_pairs(&asked, |_| {}, ready(())).await;
    assert!(matches!(cancelled, Err(SubmitError::Cancelled)), "{cancelled:?}");
    let begun = Notify::new();
    let mut told = Vec::new();
    let tell = |job: &JobProgress| {
        told.push(job.clone());
        if job.progress.is_some_and(|progress| progress.iterations > 1) {
            begun.notify_one();
        }
    };
    let cancelled = client.derive_allowed_pairs(&asked, tell, begun.notified()).await;
    assert!(matches!(cancelled, Err(SubmitError::Cancelled)), "{cancelled:?}");
    let most = told.iter().filter_map(|job| job.progress).map(|progress| (progress.rounds, progress.iterations)).max();
    assert!(most.is_some_and(|(pairs, boxes)| pairs >= 2 && boxes > 1), "{told:?}");
    assert_eq!(clients.search_job(&told[0].id).await.state, JobState::Cancelled);

    let begun = Notify::new();
    let tell = |job: &JobProgress| {
        if job.progress.is_some_and(|progress| progress.iterations > 1) {
            begun.notify_one();
        }
    };
    let other = async {
        begun.notified().await;
        let id = clients.search_jobs().await.last().expect("a job").id.clone();
        clients.cancel_search(&id).await.state
    };
    let (cancelled, state) = tokio::join!(client.derive_allowed_pairs(&asked, tell, pending()), other);
    assert!(matches!(cancelled, Err(SubmitError::Cancelled)), "{cancelled:?}");
    assert_eq!(state, JobState::Cancelled);
    let states = clients.search_jobs().await.into_iter().map(|job| job.state);
    assert_eq!(states.collect::<Vec<_>>(), [JobState::Cancelled; 3]);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_id_makes_one_search_whatever_happens() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let robot = orbit(&server.client().await).await;
    let asked = Search { request_id: "6512bd43".into(), ..quick(&robot) };
    let id = clients.queue_search(asked.clone()).await;
    let ended = clients.searched(&id).await;
    assert_eq!((ended.result().pairs.len(), ended.request_id.as_str()), (10, "6512bd43"));
    // Without an id every call makes a job of its own.
    let without = Search { request_id: String::new(), ..asked.clone() };
    let [one, two] = [clients.queue_search(without.clone()).await, clients.queue_search(without.clone()).await];
    assert!(one != two && one != id);
    for restarted in [false, true] {
        if restarted {
            server.client().await.delete_robot(&robot.parse().expect("an id")).await.expect("no scene has it");
            server.kill();
            server = Running::start(dir.path());
            clients = server.connect().await;
        }
        let said = Search { resolution_m: Some(DEFAULT_DERIVE_RESOLUTION_M), ..asked.clone() };
        for same in [asked.clone(), said] {
            let again = clients.create_search(same).await.expect("known");
            assert_eq!((again.created, &again.job_id), (false, &id));
        }
        assert_eq!(clients.search_job(&id).await, ended);
        for other in [
            Search { robot_id: format!("{:064x}", 7), ..asked.clone() },
            Search { margin_m: 0.25, ..asked.clone() },
            Search { max_boxes: Some(FEW + 1), ..asked.clone() },
            Search { max_boxes: None, ..asked.clone() },
            Search { resolution_m: Some(2e-3), ..asked.clone() },
        ] {
            let status = clients.create_search(other).await.expect_err("another content");
            assert_eq!((status.code(), reason(&status).as_str()), (Code::AlreadyExists, "REQUEST_ID_USED"));
            assert!(status.message().contains("6512bd43"), "{}", status.message());
        }
    }
    let gone = clients.create_search(without).await.expect_err("deleted");
    assert_eq!((gone.code(), field(&gone).as_str()), (Code::NotFound, "robot_id"), "{gone:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_outlive_the_server_and_are_not_repeated_once_done() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let robot = orbit(&server.client().await).await;
    let named = Search { request_id: "patient".into(), ..long(&robot) };
    let running = clients.queue_search(named.clone()).await;
    let waiting = clients.queue_search(quick(&robot)).await;
    // An orderly stop is no attempt, a kill is one.
    assert_eq!(clients.searching(&running, 1).await.attempts, 1);
    let mut watch = clients.watch_search(&running).await;
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
        assert_eq!(clients.searching(&running, 1).await.attempts, attempts);
        assert_eq!(clients.search_job(&waiting).await.state, JobState::Queued);
        let again = clients.create_search(named.clone()).await.expect("known");
        assert_eq!((again.created, &again.job_id), (false, &running));
        server.kill();
    }
    server = Running::start(dir.path());
    clients = server.connect().await;
    let given_up = clients.searched(&running).await;
    assert_eq!((given_up.state, given_up.attempts), (JobState::Failed, 2));
    let why = &given_up.failure;
    assert!(why.contains("killed 2 times") && why.contains("allow fewer boxes"), "{why}");
    let done = clients.searched(&waiting).await;
    assert_eq!((done.attempts, done.result().pairs.len()), (1, 10));
    server.kill();

    // Bit for bit as it ended, its time included: the robot was not searched again.
    server = Running::start(dir.path());
    clients = server.connect().await;
    assert_eq!([clients.search_job(&running).await, clients.search_job(&waiting).await], [given_up, done]);

    // A robot that is deleted while its search waits.
    let client = server.client().await;
    let other = RobotSource { urdf: ORBIT.replace("orbit", "other"), ..RobotSource::default() };
    let other = client.load_robot(&other).await.expect("a robot").id;
    let first = clients.queue_search(long(&robot)).await;
    clients.searching(&first, 1).await;
    let orphan = clients.queue_search(quick(&other.to_string())).await;
    client.delete_robot(&other).await.expect("no scene has it");
    clients.cancel_search(&first).await;
    let failed = clients.searched(&orphan).await;
    assert_eq!((failed.state, failed.attempts), (JobState::Failed, 1));
    let why = &failed.failure;
    assert!(why.contains(&other.to_string()) && why.contains("was deleted meanwhile; load it again"), "{why}");
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_searches_are_refused_by_field_and_make_no_job() {
    let dir = tempfile::tempdir().expect("a directory");
    let (_server, _client, mut clients, robot) = served(dir.path()).await;
    let good = || Search { robot_id: robot.id.to_string(), ..Search::default() };
    for (request, at_field) in [
        (Search { robot_id: "crane".into(), ..good() }, "robot_id"),
        (Search { robot_id: String::new(), ..good() }, "robot_id"),
        (Search { margin_m: f64::NAN, ..good() }, "margin_m"),
        (Search { margin_m: f64::NEG_INFINITY, ..good() }, "margin_m"),
        (Search { max_boxes: Some(0), ..good() }, "max_boxes"),
        (Search { max_boxes: Some(10_000_001), ..good() }, "max_boxes"),
        (Search { resolution_m: Some(0.0), ..good() }, "resolution_m"),
        (Search { resolution_m: Some(-1e-3), ..good() }, "resolution_m"),
        (Search { resolution_m: Some(f64::INFINITY), ..good() }, "resolution_m"),
        (Search { request_id: "x".repeat(129), ..good() }, "request_id"),
        (Search { request_id: "a\nb".into(), ..good() }, "request_id"),
    ] {
        let status = clients.create_search(request).await.expect_err(at_field);
        assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, at_field), "{status:?}");
    }
    let nobody = format!("{:064x}", 7);
    let status = clients.create_search(Search { robot_id: nobody.clone(), ..good() }).await.expect_err("no robot");
    let found = (status.code(), field(&status), reason(&status));
    assert_eq!(found, (Code::NotFound, "robot_id".to_owned(), "ROBOT_NOT_FOUND".to_owned()), "{status:?}");
    assert!(status.message().contains(&nobody), "{}", status.message());
    assert_eq!(clients.search_jobs().await.len(), 0);
}

/// Balls 1 m apart that do not move, with names as long as names may be.
fn fence(balls: usize) -> String {
    let link = |index: usize| {
        let geometry = "<collision><geometry><sphere radius=\"0.1\"/></geometry></collision>";
        format!("<link name=\"{index:0>128}\">{geometry}</link>")
    };
    let joint = |index: usize| {
        format!(
            "<joint name=\"{index}\" type=\"fixed\"><parent link=\"{:0>128}\"/><child link=\"{index:0>128}\"/>\
             <origin xyz=\"{index} 0 0\"/></joint>",
            0
        )
    };
    let (links, joints): (String, String) = ((0..balls).map(link).collect(), (1..balls).map(joint).collect());
    format!("<robot name=\"fence\">{links}{joints}</robot>")
}

#[tokio::test(flavor = "multi_thread")]
async fn searches_whose_result_fits_no_message_are_refused() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let (client, mut clients) = (server.client().await, server.connect().await);
    // A reason of a pair is as long as one likes.
    let reason = "x".repeat(3_900_000);
    let long = format!(
        "<robot name=\"fence\"><disable_collisions link1=\"{:0>128}\" link2=\"{:0>128}\" reason=\"{reason}\"/></robot>",
        1, 2
    );
    for (balls, srdf) in [(175, String::new()), (100, long)] {
        let source = RobotSource { urdf: fence(balls), srdf, ..RobotSource::default() };
        let robot = client.load_robot(&source).await.expect("a robot").id.to_string();
        let refused = clients.create_search(Search { robot_id: robot, ..Search::default() }).await.expect_err("large");
        assert_eq!((refused.code(), field(&refused).as_str()), (Code::InvalidArgument, "robot_id"), "{refused:?}");
        assert!(refused.message().contains("fit no message"), "{}", refused.message());
    }
    assert_eq!(clients.search_jobs().await.len(), 0);
    // Almost as many are searched, and what was found arrives.
    let source = RobotSource { urdf: fence(160), ..RobotSource::default() };
    let robot = client.load_robot(&source).await.expect("a robot").id.to_string();
    let id = clients.queue_search(Search { robot_id: robot, ..Search::default() }).await;
    let done = clients.searched(&id).await;
    let of_class = |class: PairClass| done.result().pairs.iter().filter(|pair| pair.class() == class).count();
    assert_eq!([of_class(PairClass::Adjacent), of_class(PairClass::Never)], [159, 159 * 158 / 2]);
}
