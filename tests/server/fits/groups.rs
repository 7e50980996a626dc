//! Stored bodies put into fewer.

use std::ops::ControlFlow;

use nalgebra::Vector3;
use sublevel::body::{BasicSet, Body, Obstacle};
use sublevel::fit::{EncloseOptions, enclose_obstacles};
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::{CreateFitRequest, DeleteBodyRequest, FitGroup, FitOptions, JobState};
use tonic::Code;

use super::{asked, cloud, header, long, mesh_file, points};
use crate::harness::{Clients, Running, field, reason};

/// Balls of radius 1/2 about points of the x axis.
fn balls() -> [Body; 3] {
    let ball = |name: &str, x: f64| Body::ball(name, Vector3::new(x, 0.0, 0.0), 0.5).expect("a ball");
    [ball("near", 0.0), ball("next", 1.2), ball("far", 9.0)]
}

fn grouping(name: &str, body_ids: &[String], group: FitGroup) -> CreateFitRequest {
    let group = FitGroup { body_ids: body_ids.to_vec(), ..group };
    header(name, asked(Mode::Group(group)))
}

async fn stored(clients: &mut Clients) -> Vec<String> {
    let mut ids = Vec::new();
    for ball in balls() {
        ids.push(clients.put(&ball).await);
    }
    ids
}

#[tokio::test(flavor = "multi_thread")]
async fn stored_bodies_are_put_into_one_or_few() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let (ids, balls) = (stored(&mut clients).await, balls());

    let id = clients.queue(grouping("pair", &ids[..2], FitGroup::default()), &[]).await.id;
    let job = clients.ended(&id).await;
    assert_eq!((job.state(), job.point_count), (JobState::Succeeded, 0), "{}", job.failure);
    let made = job.result.expect("a result").bodies.remove(0);
    let options = EncloseOptions::new(4);
    let unwatched = &mut |_| ControlFlow::Continue(());
    let [near, next] = [0, 1].map(|i: usize| Obstacle::from(balls[i].clone()));
    let expected = enclose_obstacles("pair", &[&near, &next], &options, unwatched).expect("a body").body;
    let found = clients.body(&made.body_id).await;
    assert_eq!(found.to_json(), expected.to_json());
    assert_eq!((made.members, made.gap_m), (vec![0, 1], expected.gap_m()));
    for (set, ball) in found.sets().iter().zip(&balls) {
        set.containment.prove(&BasicSet::from(&found), &BasicSet::from(ball)).expect("proven to be inside");
    }

    let few = FitGroup { max_growth: Some(0.9), multiplier_degree: Some(4), degree: Some(6), ..FitGroup::default() };
    let id = clients.queue(grouping("some", &ids, few), &[]).await.id;
    let made = clients.ended(&id).await.result.expect("two bodies").bodies;
    assert_eq!(made.iter().map(|made| &made.members[..]).collect::<Vec<_>>(), [&[0, 1][..], &[2]]);
    assert_eq!((&made[1].body_id, made[1].gap_m), (&ids[2], None));
    let body = clients.body(&made[0].body_id).await;
    assert_eq!((body.name(), body.degree()), ("some-1", 6));
}

#[tokio::test(flavor = "multi_thread")]
async fn a_group_is_of_bodies_that_are_there() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let ids = stored(&mut clients).await;
    let nobody = format!("{:064x}", 7);
    let unknown = [ids[0].clone(), nobody.clone()];
    let status = clients.upload(grouping("it", &unknown, FitGroup::default())).await.expect_err("no such body");
    let found = (status.code(), field(&status), reason(&status));
    let expected = (Code::NotFound, "options.group.body_ids[1]".to_owned(), "BODY_NOT_FOUND".to_owned());
    assert_eq!(found, expected, "{status:?}");
    assert!(status.message().contains(&nobody), "{}", status.message());

    // Deleted while the job waits: it fails by name, and its request id stands for it all the same.
    let first = clients.queue(header("first", long()), &cloud(400, 47)).await.id;
    clients.under_way(&first).await;
    let mut request = grouping("it", &ids, FitGroup::default());
    request.request_id = "c9f0f895".into();
    let waiting = clients.queue(request.clone(), &[]).await.id;
    clients.bodies.delete_body(DeleteBodyRequest { id: ids[1].clone() }).await.expect("no scene uses it");
    clients.cancel(&first).await;
    let failed = clients.ended(&waiting).await;
    assert_eq!(failed.state(), JobState::Failed);
    assert!(failed.failure.contains(&ids[1]) && failed.failure.contains("deleted"), "{}", failed.failure);
    assert_eq!(clients.queue(request, &[]).await, failed);
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_groups_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let ids = stored(&mut clients).await;
    let few = |max_growth| FitGroup { max_growth: Some(max_growth), ..FitGroup::default() };
    let many = |count: usize| vec![ids[0].clone(); count];
    let plain = || grouping("it", &ids, FitGroup::default());
    let with = |change: fn(&mut FitOptions)| {
        let mut header = plain();
        change(header.options.as_mut().unwrap());
        header
    };
    let of_degree = |degree| FitGroup { degree: Some(degree), ..FitGroup::default() };
    let odd = FitGroup { multiplier_degree: Some(3), ..FitGroup::default() };
    for (header, at) in [
        (grouping("it", &[], FitGroup::default()), "group.body_ids"),
        (grouping("it", &many(65), FitGroup::default()), "group.body_ids"),
        (grouping("it", &many(257), few(0.2)), "group.body_ids"),
        (grouping("it", &["chair".into()], FitGroup::default()), "group.body_ids[0]"),
        (grouping("it", &ids, few(0.0)), "group.max_growth"),
        (grouping("it", &ids, few(f64::NAN)), "group.max_growth"),
        (grouping("it", &ids, odd), "group.multiplier_degree"),
        (grouping("it", &ids, of_degree(5)), "group.degree"),
        (grouping("it", &ids, of_degree(0)), "group.degree"),
        (with(|options| options.trim = 0.1), "group"),
        (with(|options| options.min_thickness_m = Some(0.1)), "group"),
        (with(|options| options.scale = Some(1e-3)), "group"),
    ] {
        let status = clients.upload(header).await.expect_err(at);
        assert_eq!((status.code(), field(&status)), (Code::InvalidArgument, format!("options.{at}")), "{status:?}");
        assert!(status.message().len() > at.len() + 40, "{}", status.message());
    }
    for source in [points(&cloud(20, 53)), mesh_file(1, "OFF\n")] {
        let status = clients.upload(CreateFitRequest { source, ..plain() }).await.expect_err("points");
        assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "source"), "{status:?}");
    }
}
