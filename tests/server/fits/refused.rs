//! Requests that the server refuses: each names its field, and nothing is queued.

use sublevel::service::proto::create_fit_request::Source;
use sublevel::service::proto::fit_mesh::Content;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::fit_points::{Coordinates, Corners};
use sublevel::service::proto::fit_sos_body::Method;
use sublevel::service::proto::{
    CreateFitRequest, FitBody, FitCompound, FitCone, FitLadder, FitMesh, FitObjective, FitOptions, FitPoints,
    FitRelaxed, FitSosBody, FitWithinGap, ListJobsRequest, MeshFormat, UploadBlobRequest,
};
use tonic::Code;

use super::{asked, body, cloud, header, mesh_file, quick};
use crate::harness::{Running, field, reason};

fn numbers(header: CreateFitRequest, numbers: &[f64]) -> CreateFitRequest {
    let bytes: Vec<u8> = numbers.iter().flat_map(|number| number.to_le_bytes()).collect();
    let coordinates = Some(Coordinates::Points(bytes.into()));
    CreateFitRequest { source: Some(Source::Points(FitPoints { coordinates, corners: None })), ..header }
}

fn with_corners(header: CreateFitRequest, corners: &[u32]) -> CreateFitRequest {
    let bytes: Vec<u8> = corners.iter().flat_map(|corner| corner.to_le_bytes()).collect();
    let coordinates = Some(Coordinates::Points(super::coordinates(&cloud(20, 31)).into()));
    let corners = Some(Corners::Triangles(bytes.into()));
    CreateFitRequest { source: Some(Source::Points(FitPoints { coordinates, corners })), ..header }
}

fn mesh_of(options: FitOptions, format: MeshFormat, file: &str) -> CreateFitRequest {
    CreateFitRequest { source: mesh_file(format.into(), file), ..header("it", options) }
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_requests_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = |header: CreateFitRequest| CreateFitRequest { source: super::points(&cloud(20, 31)), ..header };
    let good = || header("it", quick());
    let named = |name: &str| header(name, quick());
    let options = |options| header("it", options);
    let mode = |mode| header("it", asked(mode));
    let one = |body| mode(Mode::Body(body));
    let gap = |max_gap_m| mode(Mode::WithinGap(FitWithinGap { max_gap_m, ..FitWithinGap::default() }));
    let cut = |parts| Mode::Compound(FitCompound { parts, ..FitCompound::default() });
    let parts = || asked(cut(2));
    let set = |method| mode(Mode::SosBody(FitSosBody { method, ..FitSosBody::default() }));
    let relaxed = |c| set(Some(Method::Relaxed(FitRelaxed { c, objective: 0 })));
    let mesh = |format, file| CreateFitRequest { source: mesh_file(format, file), ..header("it", quick()) };
    let with = |change: fn(&mut CreateFitRequest)| {
        let mut header = header("it", quick());
        change(&mut header);
        header
    };
    let scaled = FitOptions { scale: Some(1e300), ..quick() };
    let cases = [
        (good(), "source"),
        (points(named("")), "name"),
        (points(named("two\nlines")), "name"),
        (points(with(|header| header.request_id = "x".repeat(129))), "request_id"),
        (points(with(|header| header.request_id = "\0".into())), "request_id"),
        (points(with(|header| header.input = "\t".into())), "input"),
        (mesh(99, "OFF\n"), "mesh.format"),
        (mesh(0, "OFF\n"), "mesh.format"),
        (points(one(body(5))), "options.body.degree"),
        (points(one(body(0))), "options.body.degree"),
        (points(one(body(u32::MAX))), "options.body.degree"),
        (points(one(FitBody { objective: 99, ..body(2) })), "options.body.objective"),
        (points(one(FitBody { objective: FitObjective::TraceH.into(), ..body(8) })), "options.body.objective"),
        (points(one(FitBody { slabs: 16, ..body(2) })), "options.body.slabs"),
        (points(mode(Mode::Ladder(FitLadder { slabs: 16, ..FitLadder::default() }))), "options.ladder.slabs"),
        (points(options(FitOptions { trim: 0.6, ..quick() })), "options.trim"),
        (points(options(FitOptions { trim: f64::NAN, ..quick() })), "options.trim"),
        (points(gap(0.0)), "options.within_gap.max_gap_m"),
        (points(gap(f64::INFINITY)), "options.within_gap.max_gap_m"),
        (points(options(FitOptions { min_thickness_m: Some(f64::INFINITY), ..quick() })), "options.min_thickness_m"),
        (points(options(FitOptions { scale: Some(-1.0), ..quick() })), "options.scale"),
        (points(one(FitBody { cone: 99, ..body(2) })), "options.body.cone"),
        (points(one(FitBody { cone: FitCone::Dsos.into(), refine: true, ..body(2) })), "options.body.cone"),
        (points(mode(cut(65))), "options.compound.parts"),
        (points(mode(cut(0))), "options.compound.parts"),
        (points(options(FitOptions { trim: 0.01, ..parts() })), "options.compound.parts"),
        (points(options(FitOptions { min_thickness_m: Some(0.1), ..parts() })), "options.compound.parts"),
        (points(relaxed(-1.0)), "options.sos_body.relaxed.c"),
        (points(relaxed(0.0)), "options.sos_body.relaxed.c"),
        (points(relaxed(f64::NAN)), "options.sos_body.relaxed.c"),
        (points(set(None)), "options.sos_body"),
        (
            points(set(Some(Method::Relaxed(FitRelaxed { c: 1.0, objective: FitObjective::LogdetH.into() })))),
            "options.sos_body.relaxed.objective",
        ),
        (points(options(parts())), "points.triangles"),
        (with_corners(options(parts()), &[0, 1]), "points.triangles"),
        (with_corners(options(parts()), &[0, 1, 2, 2, 1, 20]), "points.triangles"),
        (with_corners(options(parts()), &[0, 1, u32::MAX]), "points.triangles"),
        (mesh_of(parts(), MeshFormat::Xyz, "0 0 0\n1 0 0\n0 1 0\n0 0 1\n"), "mesh"),
        (CreateFitRequest { source: Some(Source::Points(FitPoints::default())), ..good() }, "points.points"),
        (CreateFitRequest { source: Some(Source::Mesh(FitMesh { format: 1, content: None })), ..good() }, "mesh.file"),
        (numbers(good(), &cloud(3, 37).iter().flatten().copied().collect::<Vec<_>>()), "points"),
        (numbers(good(), &[1.0, 2.0]), "points.points"),
        (numbers(good(), &[0.0, f64::NAN, 0.0]), "points.points"),
        (numbers(good(), &[0.0, 0.0, f64::NEG_INFINITY]), "points.points"),
        (numbers(options(scaled), &[1e10; 12]), "points.points"),
        (mesh(1, ""), "mesh"),
        (mesh(1, "OFF\n8 0 0\n0 0 0\n"), "mesh"),
        (mesh(1, "\u{0}\u{1}"), "mesh"),
        (mesh(1, "OFF\n4 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 inf\n"), "mesh"),
    ];
    for (index, (request, at)) in cases.into_iter().enumerate() {
        let status = clients.upload(request).await.expect_err(at);
        let found = (status.code(), field(&status), reason(&status));
        assert_eq!(found, (Code::InvalidArgument, at.to_owned(), "INVALID_FIELD".to_owned()), "{index}: {status:?}");
        assert!(status.message().starts_with(at) && status.message().len() > 30, "{}", status.message());
    }
    let mut bad: Vec<f64> = cloud(20, 31).iter().flatten().copied().collect();
    bad.extend([0.0, f64::NAN, 0.0]);
    let nan = clients.upload(numbers(good(), &bad)).await.expect_err("NaN");
    assert!(nan.message().contains("point 20 "), "{}", nan.message());
    // Blobs that are not there, or not whole.
    let nobody = "5f".repeat(32);
    let half = UploadBlobRequest { blob_id: nobody.clone(), total_bytes: 96, offset: 0, data: vec![0; 48].into() };
    assert!(!clients.blobs.upload_blob(half).await.expect("a piece").into_inner().complete);
    let coordinates = Some(Coordinates::PointsBlobId(nobody.clone()));
    let from_blob = Source::Points(FitPoints { coordinates, corners: None });
    let content = Some(Content::BlobId("6e".repeat(32)));
    for (source, at) in
        [(from_blob, "points.points_blob_id"), (Source::Mesh(FitMesh { format: 1, content }), "mesh.blob_id")]
    {
        let status = clients.upload(CreateFitRequest { source: Some(source), ..good() }).await.expect_err(at);
        assert_eq!((status.code(), field(&status).as_str()), (Code::NotFound, at), "{status:?}");
    }
    let rest = UploadBlobRequest { blob_id: nobody, total_bytes: 96, offset: 48, data: vec![0; 48].into() };
    let wrong = clients.blobs.upload_blob(rest).await.expect_err("another hash");
    assert_eq!((wrong.code(), field(&wrong).as_str()), (Code::InvalidArgument, "blob_id"), "{wrong:?}");
    let jobs = clients.jobs.list_jobs(ListJobsRequest::default()).await.expect("a list").into_inner().jobs;
    assert!(jobs.is_empty(), "{jobs:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn too_much_is_refused_by_its_limit() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let client = server.client().await;
    let many = client.upload(&vec![0; 24 * (2_097_152 + 1)]).await.expect("a blob");
    let coordinates = Some(Coordinates::PointsBlobId(many));
    let source = Some(Source::Points(FitPoints { coordinates: coordinates.clone(), corners: None }));
    let status = clients.upload(CreateFitRequest { source, ..header("many", quick()) }).await.expect_err("too many");
    assert_eq!(
        (status.code(), field(&status).as_str()),
        (Code::ResourceExhausted, "points.points_blob_id"),
        "{status:?}"
    );
    assert!(status.message().contains("2097152"), "{}", status.message());

    let corners = client.upload(&vec![1; 12 * (4_194_304 + 1)]).await.expect("a blob");
    let coordinates = Some(Coordinates::Points(super::coordinates(&cloud(20, 31)).into()));
    let corners = Some(Corners::TrianglesBlobId(corners));
    let source = Some(Source::Points(FitPoints { coordinates, corners }));
    let status = clients.upload(CreateFitRequest { source, ..header("meshed", quick()) }).await.expect_err("too many");
    assert_eq!(
        (status.code(), field(&status).as_str()),
        (Code::ResourceExhausted, "points.triangles_blob_id"),
        "{status:?}"
    );
    assert!(status.message().contains("4194304"), "{}", status.message());

    let long = UploadBlobRequest {
        blob_id: "5f".repeat(32),
        total_bytes: (128 << 20) + 1,
        offset: 0,
        data: vec![0; 10].into(),
    };
    let status = clients.blobs.upload_blob(long).await.expect_err("too long");
    assert_eq!((status.code(), field(&status).as_str()), (Code::ResourceExhausted, "total_bytes"), "{status:?}");
    assert!(status.message().contains("max_blob_bytes"), "{}", status.message());

    // A message beyond what any may be.
    let status = clients.upload(numbers(header("wide", quick()), &vec![0.25; 3 * 200_000])).await;
    let status = status.expect_err("too wide");
    assert_eq!(status.code(), Code::ResourceExhausted, "{status:?}");
    assert!(status.message().contains("max_message_bytes"), "{}", status.message());
    assert!(server.peak_memory_mib() < 1024, "{} MiB", server.peak_memory_mib());
}
