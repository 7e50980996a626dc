//! Uploads that the server refuses: each names its field, and nothing is queued.

use sublevel::service::proto::create_fit_request::Part;
use sublevel::service::proto::fit_options::Mode;
use sublevel::service::proto::fit_sos_body::Method;
use sublevel::service::proto::{
    CreateFitRequest, FitBody, FitCompound, FitCone, FitHeader, FitLadder, FitObjective, FitOptions, FitRelaxed,
    FitSosBody, FitWithinGap, ListFitsRequest, MeshFormat, PointChunk, TriangleChunk,
};
use tonic::Code;

use super::{asked, body, chunk, cloud, header, message, quick};
use crate::harness::{Running, field, reason};

fn first(header: FitHeader) -> CreateFitRequest {
    message(Part::Header(header))
}

fn numbers(coordinates: Vec<f64>) -> CreateFitRequest {
    message(Part::Points(PointChunk { coordinates }))
}

fn corners(corners: Vec<u32>) -> CreateFitRequest {
    message(Part::Triangles(TriangleChunk { corners }))
}

fn bytes(text: &str) -> CreateFitRequest {
    message(Part::Mesh(text.to_owned().into_bytes().into()))
}

#[tokio::test(flavor = "multi_thread")]
async fn bad_uploads_are_refused_by_field() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let points = || chunk(&cloud(20, 31));
    let good = || first(header("it", quick()));
    let named = |name: &str| first(header(name, quick()));
    let options = |options| first(header("it", options));
    let mode = |mode| first(header("it", asked(mode)));
    let one = |body| mode(Mode::Body(body));
    let gap = |max_gap_m| mode(Mode::WithinGap(FitWithinGap { max_gap_m, ..FitWithinGap::default() }));
    let cut = |parts| Mode::Compound(FitCompound { parts, ..FitCompound::default() });
    let parts = || asked(cut(2));
    let set = |method| mode(Mode::SosBody(FitSosBody { method, ..FitSosBody::default() }));
    let relaxed = |c| set(Some(Method::Relaxed(FitRelaxed { c, objective: 0 })));
    let mesh = || first(FitHeader { mesh_format: MeshFormat::Off.into(), ..header("it", quick()) });
    let with = |change: fn(&mut FitHeader)| {
        let mut header = header("it", quick());
        change(&mut header);
        first(header)
    };
    let scaled = FitOptions { scale: Some(1e300), ..quick() };
    let cases = [
        (vec![], "header"),
        (vec![points()], "header"),
        (vec![CreateFitRequest { part: None }, points()], "header"),
        (vec![good(), points(), good()], "header"),
        (vec![good(), CreateFitRequest { part: None }], "part"),
        (vec![named(""), points()], "header.name"),
        (vec![named("two\nlines"), points()], "header.name"),
        (vec![with(|header| header.request_id = "x".repeat(129)), points()], "header.request_id"),
        (vec![with(|header| header.request_id = "\0".into()), points()], "header.request_id"),
        (vec![with(|header| header.input = "\t".into()), points()], "header.input"),
        (vec![with(|header| header.mesh_format = 99), points()], "header.mesh_format"),
        (vec![one(body(5)), points()], "header.options.body.degree"),
        (vec![one(body(0)), points()], "header.options.body.degree"),
        (vec![one(body(u32::MAX)), points()], "header.options.body.degree"),
        (vec![one(FitBody { objective: 99, ..body(2) }), points()], "header.options.body.objective"),
        (
            vec![one(FitBody { objective: FitObjective::TraceH.into(), ..body(8) }), points()],
            "header.options.body.objective",
        ),
        (vec![one(FitBody { slabs: 16, ..body(2) }), points()], "header.options.body.slabs"),
        (
            vec![mode(Mode::Ladder(FitLadder { slabs: 16, ..FitLadder::default() })), points()],
            "header.options.ladder.slabs",
        ),
        (vec![options(FitOptions { trim: 0.6, ..quick() }), points()], "header.options.trim"),
        (vec![options(FitOptions { trim: f64::NAN, ..quick() }), points()], "header.options.trim"),
        (vec![gap(0.0), points()], "header.options.within_gap.max_gap_m"),
        (vec![gap(f64::INFINITY), points()], "header.options.within_gap.max_gap_m"),
        (
            vec![options(FitOptions { min_thickness_m: Some(f64::INFINITY), ..quick() }), points()],
            "header.options.min_thickness_m",
        ),
        (vec![options(FitOptions { scale: Some(-1.0), ..quick() }), points()], "header.options.scale"),
        (vec![one(FitBody { cone: 99, ..body(2) }), points()], "header.options.body.cone"),
        (
            vec![one(FitBody { cone: FitCone::Dsos.into(), refine: true, ..body(2) }), points()],
            "header.options.body.cone",
        ),
        (vec![mode(cut(65)), points()], "header.options.compound.parts"),
        (vec![mode(cut(0)), points()], "header.options.compound.parts"),
        (vec![options(FitOptions { trim: 0.01, ..parts() }), points()], "header.options.compound.parts"),
        (
            vec![options(FitOptions { min_thickness_m: Some(0.1), ..parts() }), points()],
            "header.options.compound.parts",
        ),
        (vec![relaxed(-1.0), points()], "header.options.sos_body.relaxed.c"),
        (vec![relaxed(0.0), points()], "header.options.sos_body.relaxed.c"),
        (vec![relaxed(f64::NAN), points()], "header.options.sos_body.relaxed.c"),
        (vec![set(None), points()], "header.options.sos_body"),
        (
            vec![set(Some(Method::Relaxed(FitRelaxed { c: 1.0, objective: FitObjective::LogdetH.into() }))), points()],
            "header.options.sos_body.relaxed.objective",
        ),
        (vec![options(parts()), points()], "triangles"),
        (vec![options(parts()), points(), corners(vec![0, 1])], "triangles.corners"),
        (vec![options(parts()), corners(vec![0, 1, 2, 2, 1, 20]), points()], "triangles.corners"),
        (vec![options(parts()), corners(vec![0, 1, u32::MAX]), points()], "triangles.corners"),
        (vec![mesh(), corners(vec![0, 1, 2])], "triangles"),
        (
            vec![
                first(FitHeader { mesh_format: MeshFormat::Xyz.into(), ..header("it", parts()) }),
                bytes("0 0 0\n1 0 0\n0 1 0\n0 0 1\n"),
            ],
            "mesh",
        ),
        (vec![good()], "points"),
        (vec![good(), chunk(&cloud(3, 37))], "points"),
        (vec![good(), numbers(vec![1.0, 2.0])], "points.coordinates"),
        (vec![good(), points(), numbers(vec![0.0, f64::NAN, 0.0])], "points.coordinates"),
        (vec![good(), numbers(vec![0.0, 0.0, f64::NEG_INFINITY])], "points.coordinates"),
        (vec![options(scaled), numbers(vec![1e10; 12])], "points.coordinates"),
        (vec![good(), bytes("OFF")], "mesh"),
        (vec![mesh(), points()], "points"),
        (vec![mesh()], "mesh"),
        (vec![mesh(), bytes("OFF\n8 0 0\n0 0 0\n")], "mesh"),
        (vec![mesh(), bytes("\u{0}\u{1}")], "mesh"),
        (vec![mesh(), bytes("OFF\n4 0 0\n0 0 0\n1 0 0\n0 1 0\n0 0 inf\n")], "mesh"),
    ];
    for (index, (messages, at)) in cases.into_iter().enumerate() {
        let status = clients.upload(messages).await.expect_err(at);
        let found = (status.code(), field(&status), reason(&status));
        assert_eq!(found, (Code::InvalidArgument, at.to_owned(), "INVALID_FIELD".to_owned()), "{index}: {status:?}");
        assert!(status.message().starts_with(at) && status.message().len() > 30, "{}", status.message());
    }
    let nan = clients.upload(vec![good(), points(), numbers(vec![0.0, f64::NAN, 0.0])]).await.expect_err("NaN");
    assert!(nan.message().contains("point 20 "), "counted over all messages: {}", nan.message());
    let jobs = clients.fits.list_fits(ListFitsRequest::default()).await.expect("a list").into_inner().jobs;
    assert!(jobs.is_empty(), "{jobs:?}");
}

#[tokio::test(flavor = "multi_thread")]
async fn too_much_is_refused_while_it_comes() {
    let dir = tempfile::tempdir().expect("a directory");
    let server = Running::start(dir.path());
    let mut clients = server.connect().await;
    let many = vec![0.25; 3 * 120_000];
    let mut messages = vec![first(header("many", quick()))];
    messages.extend(std::iter::repeat_n(numbers(many), 18));
    let status = clients.upload(messages).await.expect_err("too many");
    assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "points.coordinates"), "{status:?}");
    assert!(status.message().contains("2097152"), "{}", status.message());

    let mut messages =
        vec![first(header("meshed", asked(Mode::Compound(FitCompound { parts: 2, ..FitCompound::default() }))))];
    messages.extend(std::iter::repeat_n(corners(vec![1; 3 * 400_000]), 11));
    let status = clients.upload(messages).await.expect_err("too many");
    assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "triangles.corners"), "{status:?}");
    assert!(status.message().contains("4194304"), "{}", status.message());

    let mesh = FitHeader { mesh_format: MeshFormat::Stl.into(), ..header("large", quick()) };
    let piece = message(Part::Mesh(vec![0; 4_000_000].into()));
    let mut messages = vec![first(mesh)];
    messages.extend(std::iter::repeat_n(piece, 34));
    let status = clients.upload(messages).await.expect_err("too large");
    assert_eq!((status.code(), field(&status).as_str()), (Code::InvalidArgument, "mesh"), "{status:?}");

    // A message beyond what any may be.
    let messages = vec![first(header("wide", quick())), numbers(vec![0.25; 3 * 200_000])];
    let status = clients.upload(messages).await.expect_err("too wide");
    assert_eq!(status.code(), Code::OutOfRange, "{status:?}");
    assert!(server.peak_memory_mib() < 1024, "{} MiB", server.peak_memory_mib());
}
