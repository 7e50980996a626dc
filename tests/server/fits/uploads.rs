//! What is sent comes back as bodies that contain it.

use std::time::Instant;

use nalgebra::Vector3;
use sha2::{Digest, Sha256};
use sublevel::fit;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::{
    CreateFitRequest, FitBody, FitLadder, FitMesh, FitObjective, FitOptions, FitPhase, FitWithinGap, JobState,
    MeshFormat, UploadBlobRequest, create_fit_request::Source, fit_mesh::Content,
};

use super::{asked, body, cloud, header, mesh_file, next, quick};
use crate::harness::{Numbers, Running};

#[tokio::test(flavor = "multi_thread")]
async fn a_million_points_become_a_body_and_progress_only_grows() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    // Filling a box and touching its sides, so that the hull is small.
    let mut numbers = Numbers(7);
    let sides = Vector3::new(0.5, 0.3, 0.2);
    let points: Vec<_> = (0..1_000_000)
        .map(|_| Vector3::from_fn(|_, _| (1.5 * numbers.next()).clamp(-1.0, 1.0)).component_mul(&sides))
        .collect();
    let job = clients.queue(header("box", asked(Mode::Body(body(4)))), &points).await;
    assert_eq!((job.point_count, job.name.as_str()), (1_000_000, "box"));

    let mut watch = clients.watch(&job.id).await;
    let (mut last, mut order) = (job.clone(), vec![job.state()]);
    while let Some(job) = next(&mut watch).await.expect("it goes on") {
        if let (Some(before), Some(now)) = (&last.progress, &job.progress) {
            assert!(now.iterations >= before.iterations && now.rounds >= before.rounds, "{before:?} {now:?}");
            assert!(now.phase >= before.phase, "{before:?} {now:?}");
        }
        order.push(job.state());
        last = job;
    }
    assert!(order.is_sorted_by_key(|state| i32::from(*state)), "{order:?}");
    assert_eq!(last.state(), JobState::Succeeded, "{}", last.failure);
    let result = last.result.expect("a result");
    let [fitted] = &result.bodies[..] else { panic!("{result:?}") };
    let body = clients.body(&fitted.body_id).await;
    assert_eq!((body.name(), body.degree(), body.points().map(|points| points.count)), ("box", 4, Some(1_000_000)));
    body.prove_contains(&points).expect("every point is inside");
    assert_eq!(body.gap_m(), fitted.gap_m);
    assert!(fitted.mean_gap_m < fitted.gap_m && fitted.duration_s > 0.0);
    let optimum = fitted.optimum.as_ref().expect("it is no ball");
    assert!(optimum.optimality_gap.unwrap() <= 1e-5 * optimum.objective_value.abs().max(1.0), "{optimum:?}");
}

/// The service and the library give the very same bodies.
#[tokio::test(flavor = "multi_thread")]
async fn options_mean_what_they_mean_to_the_library() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = cloud(300, 3);
    let fitted = |options: &fit::FitOptions| {
        fit::fit("it", &points, options, &mut |_| std::ops::ControlFlow::Continue(())).expect("a fit").body
    };
    let library = |degree| fit::FitOptions { degree, input: "it.xyz".into(), ..fit::FitOptions::default() };
    let trace = fit::FitOptions { objective: fit::Objective::TraceP, ..library(4) };
    let refined = fit::FitOptions { refine: true, slabs: 2, ..library(4) };
    let cases = [
        (FitOptions::default(), fitted(&library(6))),
        (asked(Mode::Body(FitBody { objective: FitObjective::TraceP.into(), ..body(4) })), fitted(&trace)),
        (asked(Mode::Body(FitBody { refine: true, slabs: 2, ..body(4) })), fitted(&refined)),
        (asked(Mode::WithinGap(FitWithinGap { max_gap_m: 10.0, ..FitWithinGap::default() })), {
            let tell = &mut |_| std::ops::ControlFlow::Continue(());
            fit::coarsest_within("it", &points, 10.0, &library(8), tell).expect("the ball").body
        }),
    ];
    for (options, expected) in cases {
        let mut header = header("it", options.clone());
        header.input = "it.xyz".into();
        let id = clients.queue(header, &points).await.id;
        let job = clients.ended(&id).await;
        let result = job.result.unwrap_or_else(|| panic!("{}", job.failure));
        assert_eq!(result.bodies[0].body_id, expected.id().to_string(), "{options:?}");
        let stored = clients.body(&result.bodies[0].body_id).await;
        assert_eq!(stored.provenance(), expected.provenance());
    }
    let ladder = FitLadder { degree: Some(4), ..FitLadder::default() };
    let options = FitOptions { trim: 0.01, scale: Some(1e-3), ..asked(Mode::Ladder(ladder)) };
    let id = clients.queue(header("it", options), &points).await.id;
    let result = clients.ended(&id).await.result.expect("a ladder");
    assert_eq!((result.bodies.len(), result.left_out_count), (3, 3));
    assert!(result.bodies.iter().all(|body| body.gap_m > Some(0.0) && body.gap_m < Some(1e-3)), "{result:?}");
    let ladder: serde_json::Value = serde_json::from_str(&clients.file(&result.ladder_id).await).expect("JSON");
    assert_eq!((ladder["kind"].as_str(), ladder["rungs"].as_array().map(Vec::len)), (Some("ladder"), Some(3)));
    assert!(result.bodies[0].optimum.is_none() && result.left_out_m < 1e-3, "{result:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_mesh_comes_as_the_bytes_of_its_file() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let mut file = "OFF\n8 0 0\n".to_owned();
    for i in 0..8 {
        file += &format!("{} {} {}\n", i & 1, i >> 1 & 1, i >> 2);
    }
    // In the message itself, and in pieces that are cut in the middle of numbers and lines.
    let blob_id: String = Sha256::digest(&file).iter().map(|byte| format!("{byte:02x}")).collect();
    for (index, piece) in file.as_bytes().chunks(7).enumerate() {
        let (blob_id, total_bytes, offset) = (blob_id.clone(), file.len() as u64, 7 * index as u64);
        let request = UploadBlobRequest { blob_id, total_bytes, offset, data: piece.to_vec().into() };
        let response = clients.blobs.upload_blob(request).await.expect("a piece").into_inner();
        assert_eq!(response.complete, response.received_bytes == total_bytes);
    }
    let format = MeshFormat::Off.into();
    let mut volume = 0.0;
    for source in
        [mesh_file(format, &file), Some(Source::Mesh(FitMesh { format, content: Some(Content::BlobId(blob_id)) }))]
    {
        let request = CreateFitRequest { source, ..header("cube", quick()) };
        let job = clients.upload(request).await.expect("queued").job;
        assert_eq!(job.point_count, 8);
        let result = clients.ended(&job.id).await.result.expect("a body");
        volume = clients.body(&result.bodies[0].body_id).await.volume().volume_m3;
    }
    // The smallest ellipsoid around a unit cube is its ball.
    let ball = std::f64::consts::PI * 3.0_f64.sqrt() / 2.0;
    assert!((volume / ball - 1.0).abs() < 1e-3, "{volume} {ball}");
}

/// Points that cannot be fitted are a failed job with the reason, and the next job goes on.
#[tokio::test(flavor = "multi_thread")]
async fn what_cannot_be_fitted_fails_by_name() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let flat: Vec<_> = cloud(50, 5).into_iter().map(|point| Vector3::new(point.x, point.y, 0.0)).collect();
    let failed = clients.queue(header("sheet", quick()), &flat).await.id;
    let close = FitWithinGap { max_gap_m: 1e-9, degree: Some(2), ..FitWithinGap::default() };
    let far = clients.queue(header("ball", asked(Mode::WithinGap(close))), &cloud(50, 6)).await.id;
    let thick = FitOptions { min_thickness_m: Some(1e-3), ..quick() };
    let done = clients.queue(header("sheet", thick), &flat).await.id;
    let job = clients.ended(&failed).await;
    assert_eq!(job.state(), JobState::Failed);
    assert!(job.failure.contains("coplanar") && job.result.is_none(), "{}", job.failure);
    let job = clients.ended(&far).await;
    assert!(job.failure.contains("max gap") && job.attempts == 1, "{}", job.failure);
    assert_eq!(clients.ended(&done).await.state(), JobState::Succeeded);
}

/// A watch that is not read does not pile up what it missed, and who comes late hears at once how
/// far it is.
#[tokio::test(flavor = "multi_thread")]
async fn a_slow_watcher_gets_the_latest() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let many_steps = asked(Mode::Body(FitBody { refine: true, slabs: 15, ..body(4) }));
    let begun = Instant::now();
    let id = clients.queue(header("steps", many_steps), &cloud(400, 9)).await.id;
    let mut slow = clients.watch(&id).await;
    clients.under_way(&id).await;
    let late = next(&mut clients.watch(&id).await).await.expect("it goes on").expect("a job");
    assert!(late.progress.is_some_and(|progress| progress.phase() == FitPhase::Fitting && progress.iterations > 0));
    let ended = clients.ended(&id).await;
    assert_eq!(ended.state(), JobState::Succeeded, "{}", ended.failure);
    let (mut count, mut last, elapsed) = (0, None, begun.elapsed().as_secs_f64());
    while let Some(job) = next(&mut slow).await.expect("it goes on") {
        (count, last) = (count + 1, Some(job));
    }
    assert_eq!(last, Some(ended));
    assert!(f64::from(count) <= 10.0 * elapsed + 3.0, "{count} messages in {elapsed} s");
}
