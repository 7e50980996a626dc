//! Jobs outlive their server, and what kills it twice is given up.

use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::{FitBody, JobState};
use tonic::Code;

use super::{asked, body, cloud, header, long, next, quick};
use crate::harness::{Running, reason};

#[tokio::test(flavor = "multi_thread")]
async fn a_job_survives_a_kill_and_is_not_repeated_once_done() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(300, 19);
    let options = asked(Mode::Body(FitBody { refine: true, ..body(6) }));
    let id = clients.queue(header("survivor", options), &points).await.id;
    let after = clients.queue(header("after", quick()), &points).await.id;
    assert_eq!(clients.under_way(&id).await.attempts, 1);
    server.kill();

    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let job = clients.ended(&id).await;
    assert_eq!((job.state(), job.attempts), (JobState::Succeeded, 2), "{}", job.failure);
    let body = clients.body(&job.result.as_ref().expect("a result").bodies[0].body_id).await;
    body.prove_contains(&points).expect("the points were kept");
    let other = clients.ended(&after).await;
    assert_eq!((other.state(), other.attempts), (JobState::Succeeded, 1));
    server.kill();

    // Bit for bit as it ended, its time included: it was not fitted again.
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    assert_eq!([clients.job(&id).await, clients.job(&after).await], [job, other]);
}

#[tokio::test(flavor = "multi_thread")]
async fn what_kills_the_server_twice_is_given_up() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(400, 23);
    let id = clients.queue(header("killer", long()), &points).await.id;
    for attempt in 1..=2 {
        assert_eq!(clients.under_way(&id).await.attempts, attempt);
        server.kill();
        server = Running::start(dir.path());
        clients = server.connect().await;
    }
    let job = clients.ended(&id).await;
    assert_eq!((job.state(), job.attempts), (JobState::Failed, 2));
    assert!(job.failure.contains("killed 2 times") && job.failure.contains("memory"), "{}", job.failure);
    let next = clients.queue(header("next", quick()), &points).await.id;
    assert_eq!(clients.ended(&next).await.state(), JobState::Succeeded);
}

/// An orderly stop is no attempt: however often the server is restarted, the job is done in the
/// end.
#[tokio::test(flavor = "multi_thread")]
async fn an_orderly_stop_puts_the_job_back() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(400, 29);
    let id = clients.queue(header("patient", long()), &points).await.id;
    for _ in 0..3 {
        assert_eq!(clients.under_way(&id).await.attempts, 1);
        let mut watch = clients.watch(&id).await;
        server.terminate();
        let message = loop {
            match next(&mut watch).await {
                Ok(Some(job)) => assert!(job.result.is_none()),
                Ok(None) => panic!("a watch ends with the final state"),
                Err(status) => break status,
            }
        };
        assert_eq!((message.code(), reason(&message).as_str()), (Code::Unavailable, "STOPPING"), "{message:?}");
        assert_eq!(server.wait().code(), Some(0));
        server = Running::start(dir.path());
        clients = server.connect().await;
    }
    assert_eq!(clients.under_way(&id).await.attempts, 1);
    assert_eq!(clients.cancel(&id).await.state(), JobState::Cancelled);
    server.kill();
    let server = Running::start(dir.path());
    assert_eq!(server.connect().await.job(&id).await.state(), JobState::Cancelled);
}
