//! Queue, request ids, cancelling, pages.

use sublevel::service::proto::{
    CancelJobRequest, CreateFitRequest, GetJobRequest, JobState, ListBodiesRequest, ListJobsRequest, WatchJobRequest,
};
use tonic::Code;

use super::{cloud, header, long, points, quick};
use crate::harness::{Clients, Running, field, reason};

#[tokio::test(flavor = "multi_thread")]
async fn running_and_queued_jobs_are_cancelled_and_the_next_one_runs() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(400, 11);
    let running = clients.queue(header("running", long()), &points).await.id;
    let queued = clients.queue(header("queued", long()), &points).await.id;
    let next = clients.queue(header("next", quick()), &points).await.id;
    clients.under_way(&running).await;
    assert_eq!(clients.job(&queued).await.state(), JobState::Queued);
    for id in [&queued, &running] {
        for _ in 0..2 {
            let job = clients.cancel(id).await;
            assert_eq!((job.state(), job.progress), (JobState::Cancelled, None));
        }
    }
    let job = clients.ended(&next).await;
    assert_eq!(job.state(), JobState::Succeeded, "{}", job.failure);
    // A job that has ended stays as it is, and cancelled ones made nothing.
    assert_eq!(clients.cancel(&next).await, job);
    assert_eq!([clients.job(&running).await.attempts, clients.job(&queued).await.attempts], [1, 0]);
    let bodies = clients.bodies.list_bodies(ListBodiesRequest::default()).await.expect("a list").into_inner().bodies;
    assert_eq!(bodies.len(), 1);
}

#[tokio::test(flavor = "multi_thread")]
async fn a_request_id_makes_one_job_whatever_happens() {
    let dir = tempfile::tempdir().expect("a directory");
    let mut server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let named = cloud(60, 13);
    let request = |cloud: &[_]| CreateFitRequest {
        request_id: "8f14e45f".into(),
        source: points(cloud),
        ..header("named", quick())
    };
    let first = clients.upload(request(&named)).await.expect("queued");
    assert!(first.created);
    let ended = clients.ended(&first.job.id).await;
    for restarted in [false, true] {
        if restarted {
            server.kill();
            server = Running::start(dir.path());
            clients = server.connect().await;
        }
        let again = clients.upload(request(&named)).await.expect("known");
        assert_eq!((again.created, again.job), (false, ended.clone()));
        let other = clients.upload(request(&named[1..])).await.expect_err("another content");
        assert_eq!((other.code(), reason(&other).as_str()), (Code::AlreadyExists, "REQUEST_ID_USED"));
        assert!(other.message().contains("8f14e45f"), "{}", other.message());
    }
    // Without an id every call makes a job of its own.
    let one = clients.queue(header("named", quick()), &named).await.id;
    let two = clients.queue(header("named", quick()), &named).await.id;
    assert!(one != two && one != ended.id);
}

#[tokio::test(flavor = "multi_thread")]
async fn the_queue_has_an_end_and_lists_have_pages() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(400, 17);
    let first = clients.queue(header("first", long()), &points).await.id;
    clients.under_way(&first).await;
    let mut ids = vec![first];
    for i in 0..64 {
        ids.push(clients.queue(header(&format!("job {i}"), quick()), &points[..20]).await.id);
    }
    let one_more = CreateFitRequest { source: super::points(&points[..20]), ..header("full", quick()) };
    let full = clients.upload(one_more.clone()).await.expect_err("full");
    assert_eq!((full.code(), reason(&full).as_str()), (Code::ResourceExhausted, "QUEUE_FULL"));
    assert!(full.message().contains("cancel some"), "{}", full.message());
    assert_eq!(pages(&mut clients, 20).await, ids);
    assert_eq!(pages(&mut clients, 0).await, ids);

    clients.cancel(&ids[30]).await;
    let last = clients.upload(one_more).await.expect("space again").job.id;
    clients.cancel(&ids[0]).await;
    // The last comes last.
    clients.ended(&last).await;
    ids.push(last);
    for (i, id) in ids.iter().enumerate() {
        let expected = if i == 0 || i == 30 { JobState::Cancelled } else { JobState::Succeeded };
        assert_eq!(clients.job(id).await.state(), expected, "{i}");
    }
}

async fn pages(clients: &mut Clients, page_size: u32) -> Vec<String> {
    let (mut ids, mut page_token) = (Vec::new(), String::new());
    loop {
        let page =
            clients.jobs.list_jobs(ListJobsRequest { page_size, page_token }).await.expect("a page").into_inner();
        ids.extend(page.jobs.into_iter().map(|job| job.id));
        page_token = page.next_page_token;
        if page_token.is_empty() {
            return ids;
        }
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn unknown_jobs_are_named() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    for (id, code) in [("1", Code::NotFound), ("chair", Code::InvalidArgument), ("", Code::InvalidArgument)] {
        let got = clients.jobs.get_job(GetJobRequest { id: id.into() }).await.expect_err(id);
        let cancelled = clients.jobs.cancel_job(CancelJobRequest { id: id.into() }).await.expect_err(id);
        let watched = clients.jobs.watch_job(WatchJobRequest { id: id.into() }).await;
        for status in [got, cancelled, watched.expect_err(id)] {
            assert_eq!((status.code(), field(&status).as_str()), (code, "id"), "{}", status.message());
        }
    }
    let list = ListJobsRequest { page_token: "next".into(), page_size: 1 };
    let status = clients.jobs.list_jobs(list).await.expect_err("no token");
    assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "page_token"));
}
